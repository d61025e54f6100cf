"""A light field that stands elsewhere: by the thin-lens formula, and by moving the camera instead."""

import tomllib

import numpy as np
import pytest

import vcc
from tests.bench.on_bench import NOWHERE, START, Client, noise
from vcc.base.errors import InputError
from vcc.bench.aperture import Aperture, drawn_aperture
from vcc.bench.document import Document
from vcc.bench.offered import Field
from vcc.bench.picture import take
from vcc.bench.side import side
from vcc.files.camera_reading import tables_of_text
from vcc.units import mm

FOCAL_LENGTH, WIDE = 50 * mm, 20 * mm


def flat(distance, views=5, pixels=48):
    """Noise on a plane: all views that converge on it are the same picture."""
    picture = np.random.default_rng(3).uniform(0, 1, (pixels, pixels)).astype(np.float32)
    values = np.broadcast_to(picture, (views, views, pixels, pixels))
    return vcc.LightField.from_views(values, WIDE / views, 0.005, distance, disparity_range=(0.0, 0.0))


def document(elements, sensor, **aperture):
    return Document.of_json(
        {"camera": {"elements": elements, "sensor": sensor}, "light_field": "noise", "aperture": aperture or None}
    )


def pictured(shown, light_field):
    return take(shown.train(NOWHERE).train, Field(light_field), shown).values


@pytest.mark.parametrize("z", [-0.2, 0.0, 0.1])
def test_what_is_z_before_the_views_is_sharp_where_the_lens_images_it_from_the_camera(z):
    field = flat(0.5)
    places = np.linspace(52, 66, 29) * mm
    contrast = []
    for place in places:
        sensor = {"z": f"{place / mm} mm", "shape": [16, 16], "pitch": f"{0.005 * place / mm} mm"}
        lens = {"kind": "lens", "focal_length": "50 mm", "diameter": "18 mm"}
        picture = pictured(document([lens], sensor, z=f"{z} m"), field)
        contrast.append(float(picture.std() / picture.mean()))
    expected = 1 / (1 / FOCAL_LENGTH - 1 / (0.5 - z))
    assert abs(places[np.argmax(contrast)] - expected) <= places[1] - places[0]


@pytest.mark.parametrize("by_rays", [False, True])
def test_it_is_the_same_as_moving_the_camera_the_other_way(by_rays):
    field = noise()
    elements = [
        {"kind": "lens", "z": "3 mm", "focal_length": "50 mm", "diameter": "16 mm"},
        {"kind": "mask", "z": "26 mm", "pattern": {"name": "circle", "diameter": "11 mm"}},
    ]
    if by_rays:
        elements.append({"kind": "lens_array", "z": "50 mm", "pitch": "3 mm", "focal_length": "20 mm"})
    sensor = {"z": "52 mm", "shape": [20, 20], "pitch": "1 mm"}
    aperture = {"z": "-7 mm", "decentre": ["1.25 mm", "-0.5 mm"]}
    moved = [
        each | {"z": f"{float(each['z'].split()[0]) + 7} mm", "decentre": ["-1.25 mm", "0.5 mm"]}
        for each in [*elements, sensor]
    ]
    one = pictured(document(elements, sensor, **aperture), field)
    other = pictured(document(moved[:-1], moved[-1]), field)
    # By rays the two take other random ones only where their cells' borders round otherwise.
    assert np.abs(one - other).max() <= (2e-2 if by_rays else 1e-5) * other.max()
    assert np.abs(one - pictured(document(elements, sensor), field)).max() > 0.05 * other.max()


def test_rays_in_the_side_view_pass_the_borders_of_the_views():
    field, aperture = noise(), Aperture("-20 mm", ("2 mm", "0 mm"))
    described = START.train(NOWHERE)
    drawn = drawn_aperture(aperture, field, described.train, 0)
    assert drawn["borders"] == pytest.approx(np.array([-10, -10 / 3, 10 / 3, 10]) * mm + 2 * mm)
    assert [snap["z"] for snap in drawn["snaps"]] == [0.0]
    placed = aperture.placed(field)
    seen = side(described, placed, placed.grid, drawn)
    assert seen["start"] < -0.02
    for rays in seen["rays"]:
        if rays["distance"] is None or rays["role"] == "off axis":
            continue
        heights = [path[0][1] + (-0.02 - path[0][0]) * _slope(path) for path in rays["paths"]]
        assert min(heights) == pytest.approx(-8 * mm, abs=1e-5)  # the lowest border of the views
        assert max(heights) < 12 * mm
        assert max(path[0][1] - path[0][0] * _slope(path) for path in rays["paths"]) < 9 * mm  # the lens's rim
    nearest = field.distance_of(1.0) + 0.02
    assert any(rays["distance"] == pytest.approx(nearest) for rays in seen["rays"])


def _slope(path):
    (z, y, _), (later, other, _) = path[:2]
    return (other - y) / (later - z)


def test_a_camera_within_the_scene_and_what_is_no_place_are_refused():
    field = noise()
    nearest = field.distance_of(1.0)
    Aperture(f"{0.99 * nearest} m").placed(field)
    with pytest.raises(InputError, match="would stand within the scene"):
        Aperture(f"{1.01 * nearest} m").placed(field)
    for given in ({"z": 3}, {"z": "2 km"}, {"z": "1e300 m"}, {"decentre": "1 mm"}, {"x": "1 mm"}, "1 mm"):
        with pytest.raises(InputError):
            Document.of_json(START.as_json() | {"aperture": given})


def test_it_is_kept_undone_and_said_in_the_camera_file():
    client = Client()
    client.do("hello")
    client.at_rest()
    client.do("set", where=["aperture", "z"], value="-20 mm")
    state = client.until("state")[0]
    assert state["document"]["aperture"] == {"z": "-20 mm", "decentre": ["0 mm", "0 mm"]}
    assert state["side"]["aperture"]["z"] == -0.02
    client.at_rest()
    client.do("export", what="toml")
    _, (data,) = client.until("file")
    text = data.decode()
    assert text.startswith("# This file does not contain the position of the light field: z = -20 mm.")
    assert tables_of_text(text) == tomllib.loads(text)
    client.do("set", where=["aperture", "z"], value="1 m")
    assert "within the scene" in client.until("refused")[0]["words"]
    client.until("state")
    client.do("set", where=["aperture"], value=None)
    assert client.until("state")[0]["document"]["aperture"]["z"] == "0 mm"
    client.do("undo")
    assert client.until("state")[0]["document"]["aperture"]["z"] == "-20 mm"
    client.close()
