"""The side view as data: where rays go by similar triangles, what elements are drawn as, what is said of them."""

import json
import math

import numpy as np
import pytest

import vcc
from tests.bench.on_bench import NOWHERE, START, noise
from vcc.bench.document import Document
from vcc.bench.side import MOST_PIECES, side
from vcc.units import mm


def drawn(document=START, light_field=None):
    described = document.train(NOWHERE)
    grid = None if light_field is None else light_field.grid
    return side(described, light_field, grid)


def with_element(**table):
    return START.changed(["elements"], [START.camera["elements"][0], {"z": "26 mm", **table}])


def test_rays_land_where_similar_triangles_put_them():
    found = drawn()
    focus = 1 / (1 / 0.05 - 1 / 0.052)
    by_role = {rays["role"]: rays for rays in found["rays"]}
    assert list(by_role) == ["off axis", "near", "focused"]  # the one in focus is drawn on top
    assert by_role["focused"]["distance"] == pytest.approx(focus)
    # by Newton the image of a point at Z is 1/(1/f − 1/Z) behind the lens; the near one's is far behind the sensor
    assert {role: rays["meet"] and rays["meet"][0] for role, rays in by_role.items()} == {
        "off axis": pytest.approx(0.052, rel=1e-4),
        "near": None,
        "focused": pytest.approx(0.052, rel=1e-4),
    }
    field = noise()
    for rays in drawn(START, field)["rays"]:
        if rays["meet"] is not None and rays["distance"] is not None:
            assert rays["meet"][0] == pytest.approx(1 / (1 / 0.05 - 1 / rays["distance"]), rel=1e-4)
    assert all(abs(path[-1][1]) < 1e-7 for path in by_role["focused"]["paths"])
    near = by_role["near"]
    for path in near["paths"]:
        height = next(y for z, y, _ in path if z == 0)
        if path[-1][0] == 0.052:  # what the stop at 26 mm lets through
            assert path[-1][1] == pytest.approx(height * (1 + 0.052 * (1 / near["distance"] - 1 / 0.05)), abs=1e-6)
        else:
            assert abs(height * (1 + 0.026 * (1 / near["distance"] - 1 / 0.05))) >= 6 * mm


def test_the_scene_says_which_distances_matter():
    field = noise()
    found = drawn(START, field)
    nearest, farthest = (field.distance_of(disparity) for disparity in (1.0, -1.0))
    by_role = {rays["role"]: rays["distance"] for rays in found["rays"]}
    assert by_role["near"] == pytest.approx(nearest)
    assert by_role["far"] == (pytest.approx(farthest) if 0 < farthest < math.inf else None)
    sharp = 1 / (1 / 0.05 - 1 / nearest)
    assert any(snap["z"] == pytest.approx(sharp) and "nearest" in snap["words"] for snap in found["snaps"])


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        (
            {"kind": "lens", "focal_length": "-1 m"},
            {"drawn": "lens", "converging": False, "openings": [], "half": None},
        ),
        ({"kind": "prism", "deflection": [-0.1, 0]}, {"drawn": "prism", "towards": -1.0}),
        (
            {"kind": "mask", "pattern": {"name": "circle", "diameter": "8 mm"}, "decentre": ["1 mm", "0 mm"]},
            {"drawn": "mask", "openings": [[0.026, -0.003, 0.005]], "decentre": 0.001, "half": 0.004},
        ),
        ({"kind": "diffuser", "kernel": {"name": "gaussian", "sigma": 0.01}}, {"drawn": "frosted"}),
        ({"kind": "biprism", "deflection": 0.01}, {"drawn": "glass"}),
        ({"kind": "lens_array", "pitch": "1 mm", "focal_length": "3 mm"}, {"drawn": "glass"}),
        (
            {"kind": "first_order", "matrix": [[1, 0.01], [0, 1]], "length": "10 mm"},
            {"drawn": "block", "length": 0.01},
        ),
    ],
)
def test_elements_are_drawn_as_what_they_are(table, expected):
    found = drawn(with_element(**table))["elements"][1]
    for name, value in expected.items():
        close = pytest.approx(value) if isinstance(value, float) else value
        assert found[name] == close or np.allclose(found[name], value), name


def test_glass_is_as_deep_as_its_path_and_a_mask_as_dark_as_its_cells():
    glass = drawn(with_element(kind="biprism", deflection=-0.01))["elements"][1]["profile"]
    heights, depths = np.array(glass).T
    # thin at the edges, thickest at the middle or the other way round, and straight in between
    slope = np.abs(np.diff(depths) / np.diff(heights))
    assert np.ptp(slope) < 0.02 * slope.max() + 2e-3 / np.diff(heights).min()
    cells = [[0.25, 0.5, 1.0, 0.0]]
    mask = drawn(with_element(kind="mask", pattern=cells, width="8 mm", height="2 mm"))["elements"][1]["shades"]
    assert [piece[2] for piece in mask] == cells[0]
    assert np.allclose(
        [piece[:2] for piece in mask], [[-4e-3, -2e-3], [-2e-3, 0], [0, 2e-3], [2e-3, 4e-3]], atol=1e-5
    )


def test_a_fine_mask_has_few_pieces_and_lets_as_much_through():
    fine = with_element(kind="mask", pattern={"name": "cosine_sum", "period": "50 um"}, width="10 mm")
    pieces = np.array(drawn(fine)["elements"][1]["shades"])
    assert len(pieces) <= MOST_PIECES
    assert np.average(pieces[:, 2], weights=pieces[:, 1] - pieces[:, 0]) == pytest.approx(0.5, abs=0.02)


def test_fans_fill_what_the_lens_and_the_views_pass():
    wide, narrow = noise(), noise().scaled(0.3)  # views of 20 mm and of 6 mm before a lens of 18 mm
    for field, half in ((wide, 9 * mm), (narrow, 3 * mm)):
        described = with_element(kind="prism", deflection=[0, 0]).train(NOWHERE)
        for rays in side(described, field, field.grid)["rays"]:
            heights = [next(y for z, y, _ in path if z == 0) for path in rays["paths"]]
            assert 0.95 * half < max(map(abs, heights)) <= half
            assert all(path[-1][0] == 0.052 for path in rays["paths"])  # none is stopped


def test_handles_change_what_they_stand_on():
    table = {"kind": "lens_array", "pitch": "1 mm", "focal_length": "3 mm", "rotation": "5 deg", "width": "8 mm"}
    found = drawn(with_element(**table, decentre=["1 mm", "2 mm"]))
    handles = {each["words"]: each for each in found["elements"][1]["handles"]}
    assert set(handles) == {"decentre", "width", "focal length", "rotation"}
    assert handles["width"]["height"] == pytest.approx(5 * mm)  # the upper edge; both edges move
    assert (handles["width"]["value"], handles["width"]["rate"]) == (8 * mm, 2.0)
    assert (handles["focal length"]["z"], handles["focal length"]["along"]) == (3 * mm, "z")
    assert (handles["decentre"]["value"], handles["decentre"]["other"]) == (1 * mm, 2 * mm)
    assert handles["rotation"]["value"] == pytest.approx(math.radians(5))
    pitch = found["sensor"]["handles"][1]
    assert pitch["height"] == pytest.approx(24 / 2 * mm)
    assert pitch["rate"] * 24 / 2 == pytest.approx(1)  # the edge follows the hand
    above = side(with_element(**table, decentre=["1 mm", "2 mm"]).train(NOWHERE), None, None, axis=1)
    handles = {each["words"]: each for each in above["elements"][1]["handles"]}
    assert handles["decentre"]["value"] == 2 * mm
    circle = {"kind": "mask", "pattern": {"name": "circle", "diameter": "6 mm"}}
    (_, size) = drawn(with_element(**circle))["elements"][1]["handles"]
    assert (size["where"], size["value"]) == (["pattern", "diameter"], 6 * mm)
    cone = {"kind": "angle_filter", "z": "40 mm", "pattern": {"name": "circle", "diameter": "0.3 m"}}
    (_, steepest) = drawn(with_element(**cone))["elements"][1]["handles"]
    assert (steepest["where"], steepest["value"]) == (["pattern", "diameter"], 0.3)
    assert (steepest["z"], steepest["height"]) == (-40 * mm, pytest.approx(6 * mm))  # slope 0.15, 40 mm before it
    assert steepest["rate"] * 40 * mm / 2 == pytest.approx(1)  # the ray follows the hand


def test_it_is_json_whatever_is_infinite():
    document = Document({"sensor": {"z": "0 mm", "shape": [4, 4], "pitch": "1 mm"}}, "noise")
    for each in (START, START.changed(["sensor", "z"], "50 mm"), document):
        json.dumps(drawn(each), allow_nan=False)
        json.dumps(drawn(each, vcc.LightField(np.ones((1, 1, 4, 4)), vcc.Affine.identity())), allow_nan=False)
    assert "No real distance is in focus" in drawn(document)["words"][0]
