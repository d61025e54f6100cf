"""Focal stacks. Oracles: closed forms, a scene's true pinhole view, other libraries' readers of films."""

from __future__ import annotations

import io

import numpy as np
import pytest

import vcc
from tests.command_line import run
from vcc.base.affine import Affine
from vcc.base.measures import psnr
from vcc.recover.focal_stack import FocalStack, focal_stack, focus_distances
from vcc.recover.refocus import refocused
from vcc.showcase.scene import demo_scene


@pytest.fixture(scope="module")
def demo_field() -> vcc.LightField:
    return demo_scene().light_field(
        (7, 7), (120, 120), spacing=2.5e-3, slope_per_pixel=0.4 / 120, focus_distance=1.3, dtype=np.float32
    )


@pytest.fixture(scope="module")
def demo_stack(demo_field) -> FocalStack:
    return focal_stack(demo_field, focus_distances(0.8, 3.0, 8))


def halves() -> FocalStack:
    """Left half sharp at 1 m and grey at 2 m, the right half the other way round."""
    bars = np.tile(np.where(np.arange(40) % 4 < 2, 0.9, 0.1), (24, 1))
    first, second = bars.copy(), bars.copy()
    first[:, 20:], second[:, :20] = 0.5, 0.5
    return FocalStack(np.stack([first, second]).astype(np.float32), (1.0, 2.0), Affine.identity(2))


def test_distances_lie_in_equal_steps_of_blur():
    assert focus_distances(1.0, 2.0, 3) == pytest.approx((1.0, 4 / 3, 2.0), rel=1e-12)
    assert focus_distances(0.5, np.inf, 2) == (0.5, np.inf)
    assert focus_distances(1.0, 2.0, 1) == pytest.approx((4 / 3,))


def test_a_stack_holds_the_refocused_pictures(demo_field):
    seen = []
    stack = focal_stack(
        demo_field, (0.8, np.inf), diameter=8e-3, progress=lambda done, total: seen.append((done, total))
    )
    assert seen == [(1, 2), (2, 2)]
    assert stack.distances == (0.8, np.inf)
    for number, distance in enumerate(stack.distances):
        single = refocused(demo_field, distance, diameter=8e-3)
        np.testing.assert_array_equal(stack.image(number).values, single.values)
        assert stack.frame == single.frame


@pytest.mark.parametrize("selectivity", [4.0, np.inf])
def test_each_part_comes_from_the_picture_that_is_sharp_there(selectivity):
    stack = halves()
    found = stack.all_in_focus(window=1.0, selectivity=selectivity)
    expected = np.tile(np.where(np.arange(40) % 4 < 2, 0.9, 0.1), (24, 1))
    # A window of σ = 1, cut at 4σ: 5 pixels from the seam a flat part has no sharpness at all.
    far = np.r_[:14, 26:40]
    np.testing.assert_allclose(found.image.values[:, far], expected[:, far], atol=1e-6)
    np.testing.assert_allclose(found.distance[:, :14], 1.0, rtol=1e-6)
    np.testing.assert_allclose(found.distance[:, 26:], 2.0, rtol=1e-6)


def test_no_selectivity_is_the_mean_and_so_is_no_detail():
    stack = halves()
    mean = stack.pictures.mean(axis=0)
    np.testing.assert_allclose(stack.all_in_focus(selectivity=0).image.values, mean, atol=1e-7)
    flat = FocalStack(
        np.stack([np.full((9, 9), 0.2), np.full((9, 9), 0.4)]).astype(np.float32), (1.0, 3.0), stack.frame
    )
    found = flat.all_in_focus()
    np.testing.assert_allclose(found.image.values, 0.3, rtol=1e-6)
    np.testing.assert_allclose(found.distance, 1.5, rtol=1e-6)  # the mean of 1 and 1/3, inverted
    black = FocalStack(np.zeros((2, 9, 9), np.float32), (1.0, 3.0), stack.frame)
    assert not black.all_in_focus().image.values.any()


def test_all_of_the_demo_scene_gets_sharp(demo_field, demo_stack):
    """Against what a pinhole in the middle sees: its view."""
    truth = demo_field.view(3, 3).to_numpy()
    singles = [psnr(picture, truth) for picture in demo_stack.pictures]
    together = psnr(demo_stack.all_in_focus().image.values, truth)
    print(f"single pictures {min(singles):.1f} to {max(singles):.1f} dB, all in focus {together:.1f} dB")
    # Leaves, chart and town take turns in being sharp: the best single picture has one or two of the three, and a
    # choice that is right for half of what is left saves half of its squared error.
    assert together > max(singles) + 3


@pytest.mark.parametrize("shape", [(120, 120, 3), (119, 117, 3), (30, 33), (30, 33, 1)])
@pytest.mark.parametrize("ending", ["mp4", "gif"])
def test_films_hold_the_pictures(tmp_path, demo_stack, shape, ending):
    pictures = demo_stack.pictures[:4, : shape[0], : shape[1]]
    pictures = pictures[..., 1].reshape(4, *shape) if shape[-1] != 3 else pictures
    stack = FocalStack(np.ascontiguousarray(pictures), demo_stack.distances[:4], demo_stack.frame)
    path = tmp_path / f"stack.{ending}"
    words = stack.save(path, exposure=1.0)
    assert "4 pictures" in words
    assert "in 6 frames" in words
    if ending == "mp4":
        import av

        with av.open(str(path)) as container:
            frames = [frame.to_ndarray(format="rgb24") for frame in container.decode(video=0)]
    else:
        from PIL import Image, ImageSequence

        with Image.open(path) as film:
            frames = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(film)]
    assert len(frames) == 6
    even = [n + n % 2 for n in shape[:2]] if ending == "mp4" else list(shape[:2])
    assert all(list(frame.shape[:2]) == even for frame in frames)
    from vcc.files.transfer import encode

    for frame, number in zip(frames, (0, 1, 2, 3, 2, 1), strict=True):
        codes = encode(stack.pictures[number].reshape(*shape[:2], -1), 8).astype(float)
        error = np.sqrt(np.mean((frame[: shape[0], : shape[1]] - codes) ** 2))
        # H.264 with half the chroma at rate factor 18, or 256 colours with dithering: some codes of 255
        assert error < 12


def test_a_film_goes_into_a_buffer(tmp_path, demo_stack):
    stack = FocalStack(demo_stack.pictures[:2, :16, :16], demo_stack.distances[:2], demo_stack.frame)
    buffer = io.BytesIO()
    assert stack.save(buffer, format="gif").startswith("gif in a buffer: 2 pictures")
    stack.save(tmp_path / "stack.gif")
    assert buffer.getvalue() == (tmp_path / "stack.gif").read_bytes()
    with pytest.raises(vcc.InputError, match="add format=, mp4, gif"):
        stack.save(io.BytesIO())


def test_the_command_makes_pictures_and_films(tmp_path, demo_field):
    from vcc.store import save_store

    views = tmp_path / "views.zarr"
    save_store(demo_field[1:6, 1:6, 30:90, 30:90], views)
    for arguments, name in (
        (["--distance", "1.2 m", "--aperture", "8 mm"], "one.png"),
        (["--distance", "inf"], "far.exr"),
        (["--stack", "0.8 m", "3 m", "4"], "stack.mp4"),
        (["--stack", "0.8 m", "inf", "3"], "stack.gif"),
        (["--stack", "0.8 m", "3 m", "4", "--all-in-focus"], "sharp.png"),
        (["--all-in-focus"], "sharp.npy"),
    ):
        done = run("refocus", views, *arguments, "-o", tmp_path / name)
        assert done.exit_code == 0, done.output
        assert name in done.output
        assert (tmp_path / name).stat().st_size > 0
    for arguments, name, words in (
        ([], "one.png", "where should it focus?"),
        (["--distance", "1 m", "--all-in-focus"], "one.png", "leave out --stack"),
        (["--distance", "1"], "one.png", "needs a unit"),
        (["--distance", "1 m"], "one.mp4", "cannot be written"),
        (["--stack", "3 m", "1 m", "4"], "stack.mp4", "exchange them"),
        (["--stack", "1 m", "3 m", "0"], "stack.mp4", "1 or more, not 0"),
        (["--stack", "1 m", "3 m", "4"], "stack.png", "cannot be written"),
    ):
        done = run("refocus", views, *arguments, "-o", tmp_path / name)
        assert done.exit_code == 2, done.output
        assert words in done.output


STACK = halves()


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: focus_distances(2.0, 1.0, 3), "exchange them"),
        (lambda: focus_distances(0.0, 1.0, 3), "greater than 0 m"),
        (lambda: focus_distances(1.0, 2.0, 2.5), "must be an integer"),
        (lambda: focal_stack(vcc.LightField.from_views(np.ones((1, 1, 4, 4)), 1e-3, 0.01), ()), "at least one"),
        (
            lambda: focal_stack(
                vcc.LightField.from_views(np.ones((1, 1, 4, 4)), 1e-3, 0.01), (1.0,), memory_limit=60
            ),
            "60 bytes are allowed.*memory_limit",
        ),
        (lambda: FocalStack(STACK.pictures, (1.0,), STACK.frame), "2 pictures have 1 distances"),
        (lambda: FocalStack(STACK.pictures[0], (1.0,), STACK.frame), "has the axes"),
        (lambda: FocalStack(STACK.pictures * np.float32(np.nan), (1.0, 2.0), STACK.frame), "finite samples"),
        (lambda: STACK.all_in_focus(window=0), "window must be greater than 0 pixels"),
        (lambda: STACK.all_in_focus(selectivity=-1), "selectivity must be 0 or more"),
        (lambda: STACK.all_in_focus(memory_limit=10), "10 bytes are allowed.*memory_limit"),
        (lambda: STACK.save("stack.avi"), "end its name in .mp4, .gif"),
        (lambda: STACK.save("stack.gif", frames_per_second=60), "up to 50, not 60"),
        (lambda: STACK.save("stack.mp4", frames_per_second=0), "above 0, not 0"),
    ],
)
def test_what_cannot_be_is_refused(call, words):
    with pytest.raises(vcc.InputError, match=words):
        call()
