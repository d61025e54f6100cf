"""HCI's lf.h5 of 2013, against a plane at a known distance and a sign that only the truth tells."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.formats.small_views import moving_texture
from vcc.base.errors import InputError, ResultWarning
from vcc.formats import open_light_field, read_container, read_geometry, read_ground_truth

h5py = pytest.importorskip("h5py")

SHIFT = 2.0
"""Pixels by which the benchmark's pictures are moved together."""


def write(path: Path, values: NDArray[Any], disparity: float, depth: bool = True, **attributes: object) -> None:
    """Cameras 0.05 m apart with a focal length of 64 pixels: Z follows from disparity = dH·f/Z − shift."""
    stated = {"dV": 0.05, "dH": 0.05, "focalLength": 64.0, "shift": SHIFT, "xRes": 64, "yRes": 48} | attributes
    with h5py.File(path, "w") as file:
        file["LF"] = values
        if depth:
            file["GT_DEPTH"] = np.full(values.shape[:4], 0.05 * 64 / (disparity + SHIFT))
        for name, value in stated.items():
            if value is not None:
                file.attrs[name] = np.array([value])  # as the benchmark's files have them


def test_geometry_and_truth(tmp_path: Path) -> None:
    views = moving_texture(3, 3, 1.0)
    write(tmp_path / "lf.h5", views, 1.0)
    with pytest.warns(ResultWarning, match="do not state spacing.*unit is taken as m") as said:
        field = open_light_field(tmp_path / "lf.h5", transfer="linear")
    assert len(said) == 1
    np.testing.assert_array_equal(field.values, views)
    assert field.disparity_of(0.05 * 64 / 3) == pytest.approx(1.0)
    assert field.disparity_of(math.inf) == pytest.approx(-SHIFT)
    truth = read_ground_truth(tmp_path / "lf.h5")
    assert truth.disparity is not None
    assert truth.disparity.shape == (3, 3, 48, 64)
    np.testing.assert_allclose(truth.disparity, 1.0, rtol=1e-6)
    # The unit is not stated: another baseline keeps the disparities, and so the shift; all distances scale.
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        field = open_light_field(tmp_path / "lf.h5", spacing=0.005)
    assert field.disparity_of(0.005 * 64 / 3) == pytest.approx(1.0)


@pytest.mark.parametrize("flip", [(1, -1), (-1, 1), (-1, -1)])
@pytest.mark.parametrize("disparity", [1.0, -1.0])
def test_the_truth_tells_which_axis_is_reversed(flip: tuple[int, int], disparity: float, tmp_path: Path) -> None:
    views = moving_texture(3, 3, disparity)
    write(tmp_path / "lf.h5", views[:: flip[0], :: flip[1]], disparity)
    with pytest.warns(ResultWarning, match="true disparities have the other sign"):
        field = open_light_field(tmp_path / "lf.h5", transfer="linear", spacing=0.05)
    np.testing.assert_array_equal(field.values, views)


def test_grey_and_without_truth(tmp_path: Path) -> None:
    write(tmp_path / "lf.h5", moving_texture(3, 3)[..., 0], 1.0, depth=False, shift=0.0)
    info = read_geometry(tmp_path / "lf.h5")
    assert (info.channels, info.focus_distance, info.unknown) == (None, math.inf, ("spacing",))
    assert read_container(tmp_path / "lf.h5").metadata["xRes"] == 64
    with pytest.raises(InputError, match="no true depth"):
        read_ground_truth(tmp_path / "lf.h5")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"dH": None}, "does not state the attribute dH"),
        ({"focalLength": math.nan}, "focalLength is .*not a finite number"),
        ({"dV": -1.0}, "they are above 0"),
        ({"shift": -2.0}, "shifted apart, by 2.0 pixels per view"),
    ],
)
def test_bad_attributes(change: dict[str, Any], message: str, tmp_path: Path) -> None:
    write(tmp_path / "lf.h5", moving_texture(2, 2), 1.0, **change)
    with pytest.raises(InputError, match=message):
        open_light_field(tmp_path / "lf.h5")


def holding(name: str, values: Any) -> Callable[[Path], None]:
    def write_it(path: Path) -> None:
        with h5py.File(path, "w") as file:
            file[name] = values

    return write_it


def cut_off(path: Path) -> None:
    write(path, moving_texture(2, 2), 1.0)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


@pytest.mark.parametrize(
    ("write_it", "message"),
    [
        (lambda path: path.write_bytes(b"not HDF5"), r"lf\.h5 is not an HDF5 file"),
        (cut_off, "truncated or damaged"),
        (holding("LF", np.zeros((2, 2))), r"LF has the shape \(2, 2\)"),
        (holding("other", 1), "no data set LF"),
    ],
)
def test_bad_files(write_it: Callable[[Path], Any], message: str, tmp_path: Path) -> None:
    write_it(tmp_path / "lf.h5")
    with pytest.raises(InputError, match=message):
        open_light_field(tmp_path / "lf.h5")
