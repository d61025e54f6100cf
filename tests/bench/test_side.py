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
    return side(described.elements, described.train, light_field, grid)


def with_element(**table):
    return START.changed(["elements"], [START.camera["elements"][0], {"z": "26 mm", **table}])


def test_rays_land_where_similar_triangles_put_them():
    found = drawn()
    focus = 1 / (1 / 0.05 - 1 / 0.052)
    assert found["focus"] == pytest.approx(focus)
    by_role = {rays["colour"]: rays for rays in found["rays"]}
    assert set(by_role) == {"focused", "near", "off axis"}
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
    by_role = {rays["colour"]: rays["distance"] for rays in found["rays"]}
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


def test_it_is_json_whatever_is_infinite():
    document = Document({"sensor": {"z": "0 mm", "shape": [4, 4], "pitch": "1 mm"}}, "noise")
    for each in (START, START.changed(["sensor", "z"], "50 mm"), document):
        json.dumps(drawn(each), allow_nan=False)
        json.dumps(drawn(each, vcc.LightField(np.ones((1, 1, 4, 4)), vcc.Affine.identity())), allow_nan=False)
    assert "No real distance is in focus" in drawn(document)["words"][0]
