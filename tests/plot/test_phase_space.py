"""Phase space: cells stand where the frame puts them, and the paper's Figure 4 comes out."""

import numpy as np
import pytest

from vcc import Affine, Camera, InputError, Lens, LightField, Mask, Sensor
from vcc.plot import plot_phase_space, plot_phase_space_stages, style
from vcc.plot.phase_space import cell_corners
from vcc.units import mm


def some_light_field(channels=None):
    shape = (3, 5, 4, 6) + (() if channels is None else (channels,))
    values = np.random.default_rng(1).random(shape, np.float32)
    return LightField.from_views(values, (2 * mm, 1 * mm), (0.02, 0.01), 0.7)


def mesh_of(axes):
    (mesh,) = axes.collections
    return mesh


def corners_of(axes):
    return np.asarray(mesh_of(axes).get_coordinates())


@pytest.mark.parametrize("channels", [None, 1, 3, 4])
def test_cells_stand_where_the_frame_puts_them(channels):
    light_field = some_light_field(channels).transformed(
        Affine.propagation(0.3) @ Affine.prism((0.1, 0.2)) @ Affine.lens(0.2)
    )
    corners = corners_of(plot_phase_space(light_field, row=2, pixel_row=1))
    assert corners.shape == (6, 7, 2)
    for i, k in np.ndindex(6, 7):
        ray = light_field.frame([i - 0.5, 2, k - 0.5, 1])
        assert corners[i, k] == pytest.approx((ray[0] / mm, ray[2]))


def test_the_other_axis():
    light_field = some_light_field()
    axes = plot_phase_space(light_field, across="v", row=4, pixel_row=2)
    corners = corners_of(axes)
    ray = light_field.frame([4, 1.5, 2, 3.5])
    assert corners[2, 4] == pytest.approx((ray[1] / mm, ray[3]))
    assert axes.get_xlabel() == "v [mm]"
    assert axes.get_ylabel() == "t [slope]"


def test_each_cell_has_the_brightness_of_its_sample():
    light_field = some_light_field()
    shown = mesh_of(plot_phase_space(light_field, row=1, pixel_row=3)).get_array()
    values = light_field.values[1, :, 3, :]
    order = np.argsort(values.ravel())
    assert (np.diff(np.asarray(shown).ravel()[order]) >= 0).all()
    assert shown.max() == pytest.approx(1)


def test_unsigned_integers_and_a_white_of_ones_own():
    values = np.full((1, 2, 1, 2), 51, np.uint8)
    axes = plot_phase_space(LightField.from_views(values, 1 * mm, 0.1), white=0.2)
    assert np.asarray(mesh_of(axes).get_array()) == pytest.approx(1)
    black = LightField.from_views(np.zeros((1, 2, 1, 2), np.uint8), 1 * mm, 0.1)
    assert not np.asarray(mesh_of(plot_phase_space(black)).get_array()).any()


def point_at_infinity(views=21, pixels=21):
    """The paper's Figure 4: light that comes parallel to the axis."""
    values = np.zeros((1, views, 1, pixels), np.float32)
    values[..., pixels // 2] = 1
    return LightField.from_views(values, 1 * mm, 0.01)


def test_the_papers_figure_4():
    """Example 1: a horizontal line, tilted by the lens, upright at d = f."""
    focal_length = 50 * mm
    camera = Camera([Lens(focal_length)], Sensor(focal_length, (10, 10), 1 * mm))
    figure = plot_phase_space_stages(camera, point_at_infinity())
    lines = []
    for axes in figure.axes:
        mesh = mesh_of(axes)
        corners = corners_of(axes)
        middles = (corners[:-1, :-1] + corners[1:, 1:]) / 2
        bright = np.asarray(mesh.get_array()) > 0.5
        lines.append(middles[bright])
    entrance, behind_lens, sensor = lines
    u = np.arange(-10, 11)
    assert entrance == pytest.approx(np.stack([u, 0 * u], axis=1))
    assert behind_lens == pytest.approx(np.stack([u, -u / 50], axis=1))
    assert sensor == pytest.approx(np.stack([0 * u, -u / 50], axis=1))


def test_stages_of_a_camera(tmp_path):
    elements = [
        Lens(50 * mm, 20 * mm, name="main"),
        Mask(np.eye(4), 8 * mm, z=0),
        Mask(np.eye(4), 8 * mm, z=10 * mm),
        Lens(40 * mm, z=20 * mm),
    ]
    camera = Camera(elements, Sensor(52 * mm, (10, 10), 1 * mm))
    figure = plot_phase_space_stages(camera, some_light_field(3))
    titles = [axes.get_title() for axes in figure.axes if axes.get_visible()]
    assert titles == [
        "entrance, z = 0 mm",
        "behind lens main and mask, z = 0 mm",
        "behind mask, z = 10 mm",
        "behind lens, z = 20 mm",
        "on the sensor, z = 52 mm",
    ]
    figure.savefig(tmp_path / "stages.png", dpi=30)
    masked = np.asarray(mesh_of(figure.axes[1]).get_array())
    assert masked.mean() < np.asarray(mesh_of(figure.axes[0]).get_array()).mean()


def test_a_mask_at_the_sensor_is_the_last_stage():
    camera = Camera([Mask(np.eye(2), 1 * mm, z=9 * mm)], Sensor(9 * mm, (2, 2), 1 * mm))
    figure = plot_phase_space_stages(camera, some_light_field(), across="v")
    assert [axes.get_title() for axes in figure.axes] == [
        "entrance, z = 0 mm",
        "behind mask, z = 9 mm",
    ]


def test_corners_of_a_slice_are_those_of_the_whole():
    light_field = some_light_field()[1:2, :, 2:3, :]
    u, s = cell_corners(light_field)
    assert u.shape == s.shape == (6, 7)


def test_draws_on_axes_that_are_given():
    axes = style.new_axes(4, 3)
    assert plot_phase_space(some_light_field(), axes=axes) is axes


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"across": "x"}, 'across is "u" or "v"'),
        ({"row": 3}, "row is 3, and there are 3"),
        ({"pixel_row": -5}, "pixel_row is -5, and there are 4"),
    ],
)
def test_refuses(options, message):
    with pytest.raises(InputError, match=message):
        plot_phase_space(some_light_field(), **options)
