"""Tables of rays as .csv, and ray transfer functions of ISET, against lenses in closed form."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import vcc
from tests.optics.traced_tables import thin_table
from vcc.optics.real_rays import to_sensor
from vcc.units import mm, nm, um

FOCAL, GAP = 50.0, 40.0
"""Millimetres: of a lens that is linear in direction cosines, and the coefficient of direction in place."""


def transfer_function(**changes: Any) -> dict[str, Any]:
    """A ray transfer function in the layout of isetrtf: x' = x + g·p, p' = −x/f + (1 − g/f)·p with direction
    cosines p.

    Its plane on the side of the film is 3 mm behind the glass of 10 mm, its other one 2 mm before it.
    """
    one, zero = [1.0], [0]
    along = {"x": (zero, one, zero), "y": (zero, zero, one)}
    poly = []
    for axis in "xy":
        place = {"termr": [1, 0], "termdx": [0, 0], "termdy": [0, 1]}
        if axis == "x":  # the ray begins on +y
            r, dx, dy = along["x"]
            poly.append({"outputname": "outx", "coeff": [GAP], "termr": r, "termdx": dx, "termdy": dy})
            poly.append(
                {"outputname": "outdx", "coeff": [1 - GAP / FOCAL], "termr": r, "termdx": dx, "termdy": dy}
            )
        else:
            poly.append({"outputname": "outy", "coeff": [1.0, GAP], **place})
            poly.append({"outputname": "outdy", "coeff": [-1 / FOCAL, 1 - GAP / FOCAL], **place})
    poly.append({"outputname": "outz", "coeff": [2.0], "termr": [0], "termdx": [0], "termdy": [0]})
    passes = {
        "method": "minimalellipse",
        "positions": [0, 4, 8],
        "centersX": [0, 0, 0],
        "centersY": [0, 2, 4],
        "radiiX": [3, 3, 3],
        "radiiY": [3, 3, 2],
        "intersectPlaneDistance": 20,
    }
    entry = {"wavelength_nm": 550, "passnopass": passes, "poly": poly}
    head = {"name": "linear", "thickness": 10.0, "planeoffsetinput": 3.0, "planeoffsetoutput": 2.0}
    return head | {"useDZpolynomial": False, "polynomials": [entry]} | changes


def written(path: Path, tree: dict[str, Any]) -> Path:
    path.write_text(json.dumps(tree))
    return path


def cosines(slopes: np.ndarray) -> np.ndarray:
    return slopes / np.sqrt(1 + (slopes**2).sum(axis=1, keepdims=True))


def test_a_ray_transfer_function(tmp_path: Path) -> None:
    lens = vcc.load_lens(written(tmp_path / "a.json", transfer_function()), model="ray table", z=5 * mm)
    assert lens.length == pytest.approx(15 * mm)
    assert lens.focal_length == pytest.approx(FOCAL * mm, rel=1e-4)
    camera = vcc.Camera([lens], vcc.Sensor(lens.z + lens.length + 30 * mm, (4, 4), 1 * mm))
    before = lens.table.rays[::50, :4]
    at_z = np.column_stack([before[:, :2] - 5 * mm * before[:, 2:], before[:, 2:]])
    found, light = to_sensor(camera, at_z)
    # Along the light, with the signs of slopes reversed: the inverse of the file's map.
    g, f, p = GAP * mm, FOCAL * mm, cosines(before[:, 2:])
    place, direction = (1 - g / f) * before[:, :2] + g * p, -before[:, :2] / f + p
    slope = direction / np.sqrt(1 - (direction**2).sum(axis=1, keepdims=True))
    lit = light > 0
    assert lit.mean() > 0.95
    np.testing.assert_allclose(found[lit, :2], (place + 30 * mm * slope)[lit], atol=1 * um)
    # The opening: ellipses 20 mm before the plane on the side of the film.
    assert np.abs(lens.table.rays[:, 4:6]).max() == pytest.approx(8 * mm, rel=0.01)


def test_older_files_with_circles_and_several_wavelengths(tmp_path: Path) -> None:
    tree = transfer_function()
    entry = tree["polynomials"][0]
    older = {"outdx": "outu", "outdy": "outv", "termdx": "termu", "termdy": "termv"}
    poly = [
        {
            older.get(key, key): older.get(value, value) if isinstance(value, str) else value
            for key, value in one.items()
        }
        for one in entry["poly"]
    ]
    circles = {"circleRadii": [3.0, 4.0], "circleSensitivities": [0.5, -0.1], "circlePlaneZ": 20.0}
    head = {"name": "older", "thickness": 10.0, "planeoffset": 3.0, "poly": poly, **circles}
    lens = vcc.load_lens(written(tmp_path / "b.json", head), model="ray table")
    assert lens.length == pytest.approx(16 * mm)
    assert lens.focal_length == pytest.approx(FOCAL * mm, rel=1e-3)
    # Two circles part where their centres are as far apart as both radii: at 7/0.6 mm.
    assert np.abs(lens.table.rays[:, 5]).max() == pytest.approx(7 / 0.6 * mm, rel=0.02)
    tree["polynomials"] = [entry, {**entry, "wavelength_nm": 450}]
    file = written(tmp_path / "c.json", tree)
    with pytest.raises(
        vcc.InputError, match=r"polynomials for 550 nm, 450 nm: name one of them, wavelength=550 . nm"
    ):
        vcc.load_lens(file, model="ray table")
    assert vcc.load_lens(file, model="ray table", wavelength=450 * nm).length == pytest.approx(15 * mm)


def test_rays_beside_the_axis_are_left_out_with_their_share(tmp_path: Path) -> None:
    tree = transfer_function()
    for poly in tree["polynomials"][0]["poly"]:
        if poly["outputname"] in ("outdx", "outdy"):
            poly["coeff"] = [9 * one for one in poly["coeff"]]
    with pytest.warns(vcc.ResultWarning, match=r"% of its rays are at more than 80° from the axis"):
        vcc.load_lens(written(tmp_path / "d.json", tree), model="ray table")


def test_a_table_as_csv(tmp_path: Path) -> None:
    table = thin_table(50 * mm, 12 * mm, 0.3, 1000)
    lines = ["# thickness = 2 mm", "x_mm,y_um,s,t,x_out_m,y_out_mm,s_out,t_out"]
    factors = np.array([1e3, 1e6, 1, 1, 1, 1e3, 1, 1])
    lines += [",".join(f"{value:.17g}" for value in row) for row in table.rays * factors]
    lines.append("0,0,0,0,nan,nan,nan,nan")  # a ray that does not pass
    (tmp_path / "thin.csv").write_text("\n".join(lines))
    lens = vcc.load_lens(tmp_path / "thin.csv", model="ray table", z=1 * mm, accuracy=1 * um, name="thin")
    assert (lens.name, lens.source, lens.length, lens.table.accuracy) == ("thin", "thin.csv", 2 * mm, 1 * um)
    np.testing.assert_allclose(lens.table.rays, table.rays, rtol=1e-12, atol=1e-15)
    assert "1000 rays, map of degree 1" in lens.described()
    saved = tmp_path / "camera.toml"
    saved.write_text(
        '[[elements]]\nkind = "ray_table_lens"\nlens_file = "thin.csv"\n'
        'z = "1 mm"\naccuracy = "1 um"\nname = "thin"\n'
        '[sensor]\nz = "60 mm"\nshape = [3, 4]\npitch = "1 um"\n'
    )
    assert vcc.load_camera(saved).elements[0] == lens


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y,s,t\n1,2,3,4", r"line 1: the columns of a table of rays are x_mm,y_mm,s,t,x_out_mm"),
        ("x_mm,y_mm,s,t,x_out_mm,y_out_mm,s_out,t_out\n1,2", r"line 2 should have 8 numbers"),
        ("x_mm,y_mm,s,t,x_out_mm,y_out_mm,s_out,t_out\n", r"lists no rays"),
        ("# thickness = 3\nx_mm", r"line 1: thickness"),
    ],
)
def test_wrong_tables(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "wrong.csv").write_text(text)
    with pytest.raises(vcc.InputError, match=message):
        vcc.load_lens(tmp_path / "wrong.csv", model="ray table")


def test_options_and_files_that_do_not_fit(tmp_path: Path) -> None:
    file = written(tmp_path / "a.json", transfer_function())
    with pytest.raises(vcc.InputError, match="f_number is no option of a lens known by its rays"):
        vcc.load_lens(file, model="ray table", f_number=4)
    with pytest.raises(vcc.InputError, match="tables of rays"):
        vcc.load_lens(tmp_path / "a.csv", model="real")
    with pytest.raises(vcc.InputError, match=r"no table of rays: .csv, or .json"):
        vcc.load_lens("double-gauss-50mm", model="ray table")
    tree = transfer_function()
    del tree["polynomials"][0]["passnopass"]["method"]
    with pytest.raises(vcc.InputError, match="rays that pass are described by None"):
        vcc.load_lens(written(file, tree), model="ray table")
    tree = transfer_function()
    tree["polynomials"][0]["poly"][0]["coeff"] = [1, 2]
    with pytest.raises(vcc.InputError, match="polynomial outx has 2/1/1/1 coefficients and powers"):
        vcc.load_lens(written(file, tree), model="ray table")
