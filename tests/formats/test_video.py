"""Videos written here with PyAV: frames as views, in order, and flights that come back as they went."""

import struct

import numpy as np
import pytest
from scipy import ndimage

from tests.formats.small_views import moving_texture
from vcc import LightField
from vcc.base.errors import InputError
from vcc.files import transfer
from vcc.formats import video

av = pytest.importorskip("av", reason="PyAV is not installed")


@pytest.fixture(scope="module")
def frames():
    """Ten frames of a texture that moves to the left by 3 pixels, as a camera sees it that moves to the right."""
    noise = ndimage.gaussian_filter(np.random.default_rng(1).random((32, 100, 3)), (3, 3, 0))
    texture = np.rint((noise - noise.min()) / np.ptp(noise) * 255).astype(np.uint8)
    return np.stack([texture[:, 3 * n : 3 * n + 48] for n in range(10)])


def written(path, frames, *, codec="libx264rgb", pixels="rgb24", curve=None, **options):
    """A video, lossless unless told otherwise."""
    container_options = {"movflags": "+faststart"} if path.suffix == ".mp4" else {}
    with av.open(str(path), "w", options=container_options) as container:
        stream = container.add_stream(codec, rate=25, options={"qp": "0", **options})
        stream.height, stream.width = frames.shape[1:3]
        stream.pix_fmt = pixels
        if curve is not None:
            stream.codec_context.color_trc = curve
        for frame in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")))
        container.mux(stream.encode(None))
    return path


@pytest.mark.parametrize("ending", ["mp4", "mkv", "mov"])
def test_frames_are_views(tmp_path, frames, ending):
    path = written(tmp_path / f"Fahrt 1.{ending}", frames)
    calls = []
    back = video.read(path, progress=lambda *n: calls.append(n))
    assert video.recognised(path)
    assert np.array_equal(back.values, frames[None])
    assert back.transfer == "srgb"
    assert back.geometry.spacing is None
    assert "equal steps" in back.notices[0]
    assert calls[-1][0] == 10
    assert np.array_equal(video.read(path, every=3).values[0], frames[::3])
    assert np.array_equal(video.read(path, every=2, first=1, last=7).values[0], frames[1:8:2])
    assert np.array_equal(video.read(path, moves="left").values[0], frames[::-1])
    assert np.array_equal(video.read(path, moves="down").values[:, 0], frames)
    assert np.array_equal(video.read(path, moves="up").values[:, 0], frames[::-1])


def test_disparities_are_those_of_a_camera_that_moves_right(tmp_path, frames):
    back = video.read(written(tmp_path / "a.mp4", frames))
    light_field = LightField.from_views(back.values, 1e-3, 0.01)
    low, high = light_field.measured_disparity_range()
    assert low == pytest.approx(3, abs=0.1)  # what parallax measures of whole pixels
    assert high == pytest.approx(3, abs=0.1)


@pytest.fixture(scope="module")
def grid():
    return moving_texture(4, 5, size=(32, 48))


@pytest.mark.parametrize("order", ["serpentine", "serpentine-columns", "chess"])
def test_frames_over_a_grid(tmp_path, grid, order):
    """4×5 views, filmed one by one: the places are those of the drawing in the docs, walked by hand."""
    places = {
        "serpentine": [(r, c if r % 2 == 0 else 4 - c) for r in range(4) for c in range(5)],
        "serpentine-columns": [(r if c % 2 == 0 else 3 - r, c) for c in range(5) for r in range(4)],
        "chess": [(r, c) for colour in (0, 1) for r in range(4) for c in range(5) if (r + c) % 2 == colour],
    }[order]
    path = written(tmp_path / "a.mp4", np.stack([grid[place] for place in places]))
    for told in ({"views": (4, 5), "order": order}, {"views": (4, 5)}, {"order": order}):
        back = video.read(path, **told)
        assert np.array_equal(back.values, grid)
        assert back.format == f"video of a grid, 4×5 views, {order}"
    with pytest.raises(InputError, match=r"gives 10 frames, and views=\(4, 5\) would be 20\. every="):
        video.read(path, every=2, views=(4, 5))
    with pytest.raises(InputError, match="is of a camera on a line"):
        video.read(path, moves="up", order=order)


def test_a_video_that_is_to_be_turned(tmp_path, frames):
    path = written(tmp_path / "a.mp4", frames)
    data = path.read_bytes()
    # ISO 14496-12: the matrix of a track stands 40 bytes behind its version; this one turns clockwise by 90°.
    place = data.index(b"tkhd") + 4 + 40
    turned = struct.pack(">9i", 0, 65536, 0, -65536, 0, 0, 32 * 65536, 0, 1 << 30)
    path.write_bytes(data[:place] + turned + data[place + 36 :])
    back = video.read(path)
    assert np.array_equal(back.values[0], np.stack([np.rot90(frame, -1) for frame in frames]))


def test_ten_bits(tmp_path, frames):
    path = written(tmp_path / "a.mkv", frames, codec="ffv1", pixels="gbrp10le")
    back = video.read(path, last=1)
    assert back.values.dtype == np.uint16
    # swscale widens codes by shifting, so that 255 may become 255/256 of full scale; and it rounds.
    assert np.abs(back.values[0] / 65535 - frames[:2] / 255).max() < 1.5 / 255


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"every": 20}, "gives 1 of its 10 frames with every=20"),
        ({"every": 0}, "every is a whole number, 1 or more, not 0"),
        ({"every": 1.5}, "every is a whole number, 1 or more, not 1.5"),
        ({"first": -1}, "first is a whole number, 0 or more, not -1"),
        ({"first": 5, "last": 3}, "last is a whole number, 5 or more, not 3"),
        ({"moves": "forward"}, "moves is one of .*not 'forward'"),
        ({"order": "zigzag"}, "order is one of .*not 'zigzag'"),
    ],
)
def test_frames_that_cannot_be_taken_are_refused(tmp_path, frames, options, message):
    with pytest.raises(InputError, match=message):
        video.read(written(tmp_path / "a.mp4", frames), **options)


def test_high_dynamic_range_is_refused(tmp_path, frames):
    with pytest.raises(InputError, match=r"PQ \(high dynamic range\)"):
        video.read(written(tmp_path / "b.mp4", frames, curve=16))


@pytest.mark.parametrize("ending", ["mp4", "mkv"])
def test_truncated_videos_are_refused(tmp_path, frames, ending):
    path = written(tmp_path / f"a.{ending}", frames)
    whole = path.read_bytes()
    for share in (0.0, 0.02, 0.4, 0.7, 0.9):
        path.write_bytes(whole[: int(len(whole) * share)])
        with pytest.raises(InputError, match=rf"a\.{ending}"):
            video.read(path)
    path.write_bytes(b"no video at all" * 100)
    with pytest.raises(InputError, match="cannot be read as a video"):
        video.read(path)
    with pytest.raises(InputError, match="cannot be read as a video"):
        video.read(tmp_path / "lost.mp4")


@pytest.fixture(scope="module")
def light_field(frames):
    """2×5 views, linear."""
    return LightField.from_views(transfer.decode(frames.reshape(2, 5, *frames.shape[1:])), 1e-3, 0.01)


def test_lossless_flights_keep_each_code(tmp_path, light_field, frames):
    path = tmp_path / "flight.mp4"
    for flight, order in (("serpentine", [0, 1, 2, 3, 4, 9, 8, 7, 6, 5]), ("row", [0, 1, 2, 3, 4])):
        assert video.save(light_field, path, flight=flight, lossless=True) == (len(order), 1.0, 0.0)
        assert np.array_equal(video.read(path).values[0], frames[order])
        if flight == "serpentine":  # comes back as it was
            assert np.array_equal(
                video.read(path, views=(2, 5), order=flight).values.reshape(frames.shape), frames
            )
    column = light_field[:, :1, :31, :47]
    assert video.save(column, path, flight="row", lossless=True)[0] == 2
    assert np.array_equal(video.read(path).values[0], frames[[0, 5], :31, :47])


def test_flights_for_people(tmp_path, light_field, frames):
    path = tmp_path / "flight.mp4"
    frames = np.repeat(frames[..., 1:2], 3, axis=3)
    grey = light_field.replaced(light_field.values[..., 1])
    assert video.save(grey[:, :, :31, :47], path, flight="row", quality=10)[0] == 5
    back = video.read(path).values[0]
    assert back.shape == (5, 32, 48, 3)  # H.264 wants even sizes
    error = back[:, :31, :47].astype(float) - frames[:5, :31, :47]
    # Brightness has 219 codes (ITU-R BT.709), and the quantiser's step at this quality is 2 of them (H.264's at
    # qp 10): errors of a few codes. A wrong matrix or range would shift the brightness by 5 % or more, 6 codes.
    assert np.sqrt(np.mean(error**2)) < 2
    assert abs(error.mean()) < 1
    with av.open(str(path)) as container:
        assert float(container.streams.video[0].average_rate) == 25


def test_a_circle_passes_each_view_of_the_rim_once(tmp_path, frames):
    views = np.tile(np.arange(63, dtype=np.float32).reshape(7, 9, 1, 1), (1, 1, 16, 16)) / 62
    light_field = LightField.from_views(views, 1e-3, 0.01)
    count, _, _ = video.save(light_field, tmp_path / "a.mp4", flight="circle", lossless=True)
    shown = transfer.decode(video.read(tmp_path / "a.mp4").values[0, :, 0, 0, 0]) * 62
    way = [divmod(int(n), 9) for n in np.rint(shown)]
    assert len(way) == len(set(way)) == count
    rows, columns = np.array(way).T
    assert {rows.min(), rows.max()} == {0, 6}
    assert {columns.min(), columns.max()} == {0, 8}
    radius = np.hypot((rows - 3) / 3, (columns - 4) / 4)  # within half a view of the ellipse, either way
    assert np.abs(radius - 1).max() <= np.hypot(0.5 / 3, 0.5 / 4)
    closed = np.array([*way, way[0]])
    assert np.abs(np.diff(closed, axis=0)).max() == 1  # from view to neighbouring view, also at the seam


def test_what_is_too_bright_is_counted(tmp_path, light_field):
    bright = light_field.replaced(light_field.values * 4)
    _, exposure, clipped = video.save(bright, tmp_path / "a.mp4")
    assert exposure == 1
    assert clipped == pytest.approx(float((bright.values > 1 + 0.5 / 255).mean()))  # less rounds to white
    _, exposure, clipped = video.save(bright, tmp_path / "a.mp4", exposure="auto")
    assert clipped < 0.02
    assert exposure < 0.5


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("a.mp4", {"flight": "loop"}, "flight is 'serpentine', 'circle' or 'row', not 'loop'"),
        ("a.mp4", {"frames_per_second": 0}, "frames_per_second must be greater than 0"),
        ("a.mp4", {"quality": 99}, "0 to 51, not 99"),
        ("a.mp4", {"exposure": "bright"}, "exposure is"),
        ("a.mp4", {"exposure": -1}, "exposure is"),
        ("a.avi", {}, r"end its name in \.mp4"),
        ("lost/a.mp4", {}, "there is no folder"),
    ],
)
def test_flights_that_cannot_be(tmp_path, light_field, name, options, message):
    with pytest.raises(InputError, match=message):
        video.save(light_field, tmp_path / name, **options)


def test_channels_that_a_video_does_not_have_are_refused(tmp_path, light_field):
    with pytest.raises(InputError, match="has 2"):
        video.save(light_field[..., :2], tmp_path / "a.mp4")


def test_frames_that_need_no_bytes_have_an_end(tmp_path, monkeypatch):
    """A frame that repeats the last one takes a few bytes: so many may unpack to any size."""
    path = written(tmp_path / "a.mp4", np.zeros((6, 48, 64, 3), np.uint8))
    monkeypatch.setattr(video, "LIGHT_FIELD", 5 * 48 * 64 * 3)
    with pytest.raises(
        InputError, match=r"a\.mp4 claims 55,296 bytes of samples in .*take fewer frames with every="
    ):
        video.read(path)
    assert video.read(path, every=2).values.shape == (1, 3, 48, 64, 3)


def test_a_playlist_opens_no_other_file(tmp_path):
    written(tmp_path / "real.mp4", np.zeros((3, 48, 64, 3), np.uint8))
    path = tmp_path / "a.mp4"
    path.write_text("ffconcat version 1.0\nfile real.mp4\n")
    with pytest.raises(InputError, match=r"a\.mp4 cannot be read as a video"):
        video.read(path)
