"""Arrays as light fields: what is written and read back is the same, and what is ambiguous is asked."""

from dataclasses import replace

import numpy as np
import pytest

from vcc import Affine, LightField
from vcc.base.errors import InputError
from vcc.formats import arrays


@pytest.fixture
def samples():
    return np.random.default_rng(1).integers(0, 65536, (2, 3, 5, 7, 3), np.uint16)


@pytest.mark.filterwarnings("ignore:the samples are float:vcc.errors.ResultWarning")  # whole numbers, as codes are
@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float16, np.float32, np.float64])
def test_own_file_keeps_everything(tmp_path, samples, kind):
    values = (samples % 251).astype(kind)
    views = LightField.from_views(
        values, (1e-3, 2e-3), (0.01, 0.02), 1.5, disparity_range=(-1.0, 2.0), sample="point"
    )
    piece = views[:, ::-1, 1:]
    light_field = replace(piece, frame=Affine.propagation(0.02) @ piece.frame)  # no camera array has it
    path = tmp_path / "Kiste 1.npz"
    arrays.save(light_field, path)
    assert arrays.recognised(path)
    back = arrays.read(path)
    assert back.values.dtype == kind
    assert np.array_equal(back.values, light_field.values)
    assert back.frame == light_field.frame
    assert back.transfer == "linear"
    assert back.geometry.disparity_range == light_field.measured_disparity_range()
    assert back.geometry.sample == "point"


def test_arrays_that_do_not_say_what_samples_are_hold_means(tmp_path, samples):
    np.savez(tmp_path / "a.npz", values=samples)
    assert arrays.read(tmp_path / "a.npz").geometry.sample == "mean"
    np.savez(tmp_path / "a.npz", values=samples, sample=np.array("cell"))
    with pytest.raises(InputError, match='"sample" is \'cell\'; "mean" and "point" are known'):
        arrays.read(tmp_path / "a.npz")


def test_npy(tmp_path, samples):
    path = tmp_path / "a.npy"
    np.save(path, samples)
    back = arrays.read(path)
    assert np.array_equal(back.values, samples)
    assert (back.transfer, back.frame, back.geometry.spacing) == ("srgb", None, None)
    np.save(path, samples.astype(np.float32))
    assert arrays.read(path).transfer == "linear"


def test_shapes_and_axes(tmp_path, samples):
    path = tmp_path / "a.npy"
    np.save(path, samples.reshape(6, 5, 7, 3))  # views row by row
    for shape in ((2, 3), (2, 3, 5, 7, 3)):
        assert np.array_equal(arrays.read(path, shape=shape).values, samples)
    grey = samples[..., 0]
    np.save(path, grey.reshape(6, 5, 7))
    assert np.array_equal(arrays.read(path, shape=(2, 3)).values, grey)
    np.save(path, grey.ravel())
    assert np.array_equal(arrays.read(path, shape=(2, 3, 5, 7)).values, grey)
    np.save(path, np.einsum("vutsc->stuvc", samples))
    assert np.array_equal(arrays.read(path, axes="stuvc").values, samples)
    np.save(path, np.einsum("vutsc->cuvts", samples).reshape(3, 6, 35))
    assert np.array_equal(arrays.read(path, shape=(3, 3, 2, 5, 7), axes="cuvts").values, samples)
    np.save(path, grey[..., :3])
    assert np.array_equal(arrays.read(path, axes="vuts").values, grey[..., :3])


def test_arrays_by_name(tmp_path, samples):
    path = tmp_path / "a.npz"
    np.savez(path, lf=samples)
    assert np.array_equal(arrays.read(path).values, samples)
    np.savez(path, lf=samples, depth=samples[..., 0])
    assert np.array_equal(arrays.read(path, key="lf").values, samples)


@pytest.mark.parametrize(
    ("names", "options", "message"),
    [
        (("lf", "depth"), {}, '"lf", "depth": say which one'),
        (("lf", "depth"), {"key": "views"}, 'no array "views", but "lf", "depth"'),
        ((), {}, "holds no array"),
    ],
)
def test_names_that_do_not_tell_are_refused(tmp_path, samples, names, options, message):
    np.savez(tmp_path / "a.npz", **dict.fromkeys(names, samples))
    with pytest.raises(InputError, match=message):
        arrays.read(tmp_path / "a.npz", **options)


@pytest.mark.parametrize(
    ("values", "options", "message"),
    [
        (np.zeros((6, 5, 7)), {}, r"shape \(6, 5, 7\).*shape=\(rows, columns\)"),
        (np.zeros((6, 5, 7, 3)), {}, "last axis may be"),
        (np.zeros((6, 5, 7)), {"shape": (2, 4)}, "cannot be divided"),
        (np.zeros((6, 5, 7)), {"shape": (2, 0)}, "whole numbers above 0"),
        (np.zeros((6, 5, 7)), {"shape": (2, 3, 35)}, "holds an array of shape"),
        (np.zeros((2, 3, 5, 7)), {"axes": "vutt"}, "each once"),
        (np.zeros((2, 3, 5, 7)), {"axes": "vutsc"}, "names 5 axes"),
        (np.zeros((2, 3, 5, 7)), {"key": "a"}, "without a name"),
        (np.zeros((2, 3, 5, 7), int), {}, "samples of type int64"),
        (np.zeros((2, 3, 5, 7), complex), {}, "samples of type complex128"),
    ],
)
def test_what_does_not_fit_is_refused(tmp_path, values, options, message):
    path = tmp_path / "a.npy"
    np.save(path, values)
    with pytest.raises(InputError, match=message):
        arrays.read(path, **options)


def test_damaged_files_are_refused(tmp_path, samples):
    path = tmp_path / "a.npz"
    np.savez_compressed(path, values=samples)
    whole = path.read_bytes()
    broken = [whole[:length] for length in range(0, len(whole), len(whole) // 7)]
    broken.append(whole[:200] + bytes(50) + whole[250:])
    for data in broken:
        path.write_bytes(data)
        with pytest.raises(InputError, match=r"a\.npz cannot be read"):
            arrays.read(path)
    plain = tmp_path / "a.npy"
    np.save(plain, samples)
    for data in (plain.read_bytes()[:-1], b"", b"nonsense"):
        plain.write_bytes(data)
        with pytest.raises(InputError, match=r"a\.npy cannot be read"):
            arrays.read(plain)
    np.save(plain, np.array([{}], dtype=object), allow_pickle=True)
    with pytest.raises(InputError, match="Save numbers only"):
        arrays.read(plain)


@pytest.mark.parametrize("harm", ["hidden", "renamed"])
def test_a_directory_that_hides_a_member_is_refused(tmp_path, samples, harm):
    """Without its frame a light field would be one of unknown cameras."""
    path = tmp_path / "a.npz"
    arrays.save(LightField.from_views(samples, 1e-3, 1e-3), path)
    data = path.read_bytes()
    start = data.index(b"PK\1\2")
    entries = data[start : data.index(b"PK\5\6")].split(b"PK\1\2")[1:]
    kept = [entry for entry in entries if b"frame.npy" not in entry]
    if harm == "renamed":
        kept = [entry.replace(b"frame.npy", b"frbme.npy") for entry in entries]
    assert len(kept) + (harm == "hidden") == len(entries) == 4
    directory = b"".join(b"PK\1\2" + entry for entry in kept)
    count = len(kept).to_bytes(2, "little")
    ends = len(directory).to_bytes(4, "little") + start.to_bytes(4, "little")
    path.write_bytes(data[:start] + directory + b"PK\5\6" + bytes(4) + count + count + ends + bytes(2))
    with np.load(path) as loaded:
        assert "frame" not in loaded.files
    with pytest.raises(InputError, match="is damaged: its directory"):
        arrays.read(path)


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"frame": np.zeros((4, 4))}, 'its "frame" is wrong'),
        ({"transfer": np.array("gamma")}, "'gamma'; \"linear\" and"),
        ({"disparity_range": np.array([2, 1])}, "lowest first"),
    ],
)
def test_wrong_entries_are_refused(tmp_path, samples, entry, message):
    path = tmp_path / "a.npz"
    np.savez(path, values=samples, **entry)
    with pytest.raises(InputError, match=message):
        arrays.read(path)


def test_a_frame_is_for_the_axes_as_stored(tmp_path, samples):
    path = tmp_path / "a.npz"
    arrays.save(LightField.from_views(samples, 1e-3, 0.01), path)
    with pytest.raises(InputError, match="leave shape= and axes= out"):
        arrays.read(path, axes="uvtsc")
    with pytest.raises(InputError, match=r"end its name in \.npz"):
        arrays.save(LightField.from_views(samples, 1e-3, 0.01), tmp_path / "a.npy")
