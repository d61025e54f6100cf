"""Where views are: what a camera sees is what the frame of the light field says."""

import math

import numpy as np
import pytest

from vcc import InputError
from vcc.base.units import deg, mm
from vcc.sources import CameraArray


def seen_at(camera, point, distance):
    """Pixel (row, column) at which a pinhole camera sees a point, by similar triangles."""
    rows, columns = camera.pixels
    across = ((point[0] - camera.x) / distance - camera.left) / (camera.right - camera.left)
    down = ((point[1] - camera.y) / distance - camera.top) / (camera.bottom - camera.top)
    return down * rows - 0.5, across * columns - 0.5


@pytest.mark.parametrize("focus", [math.inf, 0.7])
def test_a_point_is_seen_where_the_frame_says(focus):
    array = CameraArray((3, 5), (40, 60), (2 * mm, 3 * mm), (1e-3, 2e-3), focus)
    point, distance = (4 * mm, -6 * mm), 1.3
    for row, column in np.ndindex(3, 5):
        camera = array.camera(row, column)
        l, k = seen_at(camera, point, distance)
        u, v, s, t = array.frame(np.array([column, row, k, l]))
        assert np.allclose((u, v), (camera.x, camera.y), atol=1e-15)
        # The ray through the pinhole with this slope left the scene's plane at the point.
        assert np.allclose((u - distance * s, v - distance * t), point, atol=1e-12)


def test_disparity_is_how_far_a_point_moves():
    array = CameraArray((1, 2), (4, 400), 3 * mm, 1e-3, 2.0)
    places = [seen_at(array.camera(0, column), (1 * mm, 0), 0.5)[1] for column in (0, 1)]
    assert array.disparity(0.5) == pytest.approx(places[0] - places[1], abs=1e-9)


def test_views_over_an_aperture_fill_it():
    array = CameraArray.over_aperture((10 * mm, 20 * mm), 60 * deg, views=(5, 4), pixels=(30, 40))
    assert array.spacings == (2 * mm, 5 * mm)
    assert array.slopes_per_pixel[1] * 40 == pytest.approx(2 * math.tan(math.pi / 6))
    assert array.light_field(np.zeros(array.shape, np.uint8)).frame == array.frame


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"views": (0, 3)}, r"views is \(rows, columns\), .*not \(0, 3\)"),
        ({"pixels": (3.5, 3)}, "pixels is"),
        ({"spacing": 0.0}, "spacing must be greater than 0"),
        ({"slope_per_pixel": -1.0}, "slope_per_pixel must be"),
        ({"focus_distance": 0.0}, "focus_distance must be"),
    ],
)
def test_impossible_arrays_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        CameraArray(**arguments)


def test_views_and_angles_that_there_are_not():
    with pytest.raises(InputError, match=r"no view \(3, 0\) in an array of 3×2"):
        CameraArray((3, 2)).camera(3, 0)
    with pytest.raises(InputError, match="between 0 and π radians, not 40"):
        CameraArray.over_aperture(1 * mm, 40)
