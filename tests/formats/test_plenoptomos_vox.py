"""``.vox`` files as the format's page describes them; the frame against a point traced through a thin lens."""

import numpy as np
import pytest

from vcc import LightField
from vcc.base.errors import InputError
from vcc.formats import plenoptomos_vox as vox

h5py = pytest.importorskip("h5py", reason="h5py is not installed")

F1, Z1, PITCH, APART = 50e-3, 52e-3, (40e-6, 20e-6), (0.5e-3, 0.25e-3)


@pytest.fixture
def samples():
    return np.random.default_rng(1).integers(0, 4000, (3, 5, 6, 8), np.uint16)


def written(path, samples, *, axes="v:u:t:s", mode="sub-aperture", change=None):
    """A file like the toolbox's; ``change`` has the last word on it."""
    with h5py.File(path, "w") as file:
        file.attrs["description"] = "VoxelDataFormat"
        file.attrs["version"] = "v0"
        image = file.create_dataset("data/image", data=samples)
        image.attrs["axes"], image.attrs["mode"], image.attrs["units"] = axes, mode, "counts"

        def state(name, value, unit, of=None):
            data = file.create_dataset(f"instrument/camera/{name}", data=value)
            data.attrs["units"] = unit
            if of:
                data.attrs["axes"] = of

        state("main_lens/pixel_size", np.array(APART) * 1e3, "mm", "v:u")
        state("main_lens/f1", F1 * 1e3, "mm")
        state("micro_lens/physical_size", np.array(PITCH[::-1]) * 1e6, "um", "s:t")
        state("micro_lens/f2", 0.1, "mm")
        state("micro_lenses_array/position", [0, 0, Z1], "m", "x:y:z")
        state("sensor/position", [0, 0, Z1 * 1e3 + 0.1], "mm", "x:y:z")
        if change:
            change(file)
    return path


def test_rays_go_where_a_thin_lens_sends_them(tmp_path, samples):
    back = vox.read(written(tmp_path / "a b.vox", samples))
    assert np.array_equal(back.values, samples)
    assert (back.transfer, back.notices, back.values.dtype) == ("linear", (), np.uint16)
    rays = back.frame.inverse()
    x, y, distance = 1.5e-3, -2e-3, 0.7
    for j, i in np.ndindex(3, 5):
        u, v = (i - 2) * APART[1], (j - 1) * APART[0]
        s, t = (u - x) / distance, (v - y) / distance  # from the point to the lens …
        at_x, at_y = u + Z1 * (s - u / F1), v + Z1 * (t - v / F1)  # … and on to the microlenses
        k, l = 3.5 - at_x / PITCH[1], 2.5 - at_y / PITCH[0]  # the picture is turned upright
        assert rays([u, v, s, t]) == pytest.approx([i, j, k, l], abs=1e-9)


def test_the_frame_is_that_of_cameras_which_converge_in_focus(tmp_path, samples):
    frame = vox.read(written(tmp_path / "a.vox", samples)).frame
    focus = 1 / (1 / F1 - 1 / Z1)  # Gauss's lens formula
    same = LightField.from_views(samples, APART, (PITCH[0] / Z1, PITCH[1] / Z1), focus).frame
    assert frame.isclose(same, 1e-12)


@pytest.mark.parametrize("axes", ["t:s:v:u", "s:t:u:v"])
def test_axes_in_any_order(tmp_path, samples, axes):
    stored = np.einsum(f"vuts->{axes.replace(':', '')}", samples)
    assert np.array_equal(
        vox.read(written(tmp_path / "a.vox", stored, axes=axes, mode="micro-image")).values, samples
    )


def test_counts_and_colours(tmp_path, samples):
    counts = samples.astype(np.int32) + 100_000
    back = vox.read(written(tmp_path / "a.vox", np.stack([counts] * 3, -1), axes="v:u:t:s:c"))
    assert back.values.shape == (3, 5, 6, 8, 3)
    assert back.values.dtype == np.float32
    assert np.array_equal(back.values[..., 1], counts)
    counts = samples.astype(np.uint32) + 2**25  # more than float32 holds exactly
    back = vox.read(written(tmp_path / "a.vox", counts))
    assert np.array_equal(back.values, counts)


def test_what_is_not_stated_is_said(tmp_path, samples):
    def no_distance(file):
        del file["instrument/camera/micro_lenses_array"]
        file.create_dataset("data/white", data=samples)
        file["instrument/camera"].attrs["model"] = "home-made"

    back = vox.read(written(tmp_path / "a.vox", samples, change=no_distance))
    assert back.frame is None
    assert back.geometry.spacing == pytest.approx(APART)
    assert "does not state all of its camera" in back.notices[0]
    assert "white pictures too, which are not applied" in back.notices[1]
    assert back.metadata == {"camera": "home-made"}

    def uncalibrated(file):
        file["instrument/camera/main_lens/pixel_size"][:] = 0

    back = vox.read(written(tmp_path / "a.vox", samples, change=uncalibrated))
    assert (back.frame, back.geometry.spacing) == (None, None)

    def focused(file):
        file["instrument/camera/sensor/position"][2] += 0.02

    back = vox.read(written(tmp_path / "a.vox", samples, change=focused))
    assert back.frame is None
    assert "a focused plenoptic camera" in back.notices[0]

    def nothing(file):
        del file["instrument"]

    assert vox.read(written(tmp_path / "a.vox", samples, change=nothing)).frame is None


def changed(name, **attributes):
    def change(file):
        (file[name] if name else file).attrs.update(attributes)

    return change


def removed(file):
    del file["data/image"]


def shortened(file):
    del file["instrument/camera/main_lens/pixel_size"]
    file["instrument/camera/main_lens/pixel_size"] = [1.0, 2.0, 3.0]


def endless(file):
    file["instrument/camera/main_lens/f1"][...] = np.nan


def negative(file):
    file["instrument/camera/main_lens/pixel_size"][0] = -1


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (changed("", description="another"), 'its description is "another"'),
        (removed, "has no /data/image"),
        (changed("data/image", mode="raw"), "holds a raw picture of the sensor"),
        (changed("data/image", axes="tau:sigma"), "holds a raw picture of the sensor"),
        (changed("data/image", axes="v:u:t"), 'the axes of /data/image are "v:u:t"'),
        (changed("instrument/camera/main_lens/f1", units="inch"), 'is in "inch"; m, mm'),
        (changed("instrument/camera/main_lens/pixel_size", axes="t:s"), 'numbers along "t:s", not along "v:u"'),
        (shortened, "holds 3 numbers"),
        (endless, "not finite numbers"),
        (negative, "a length is above 0"),
    ],
)
def test_what_is_wrong_is_refused(tmp_path, samples, change, message):
    path = written(tmp_path / "wrong.vox", samples, change=change)
    with pytest.raises(InputError, match=message) as caught:
        vox.read(path)
    assert "wrong.vox" in str(caught.value)


def test_damaged_files_are_refused(tmp_path, samples):
    path = written(tmp_path / "a.vox", -samples.astype(np.int32))
    with pytest.raises(InputError, match="holds negative samples"):
        vox.read(path)
    whole = written(path, samples).read_bytes()
    for data in (whole[: len(whole) // 2], whole[:600], b"nonsense", b""):
        path.write_bytes(data)
        with pytest.raises(InputError, match=r"a\.vox"):
            vox.read(path)
    assert vox.recognised(path)
    assert not vox.recognised(tmp_path / "lost.vox")
