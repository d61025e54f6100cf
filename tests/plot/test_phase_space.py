"""Phase space: cells stand where the frame puts them, and the paper's Figure 4 comes out."""

import numpy as np
import pytest

from vcc import (
    Affine,
    Biprism,
    Camera,
    Diffuser,
    FirstOrder,
    InputError,
    Lens,
    LensArray,
    LightField,
    Mask,
    PhasePlate,
    Prism,
    Sensor,
)
from vcc.base.units import mm
from vcc.plot import phase_space_at, phase_space_stages, plot_phase_space, plot_phase_space_stages, style
from vcc.plot.phase_space import cell_corners
from vcc.plot.phase_space_rays import sheet_of_rays, slice_of
from vcc.shapes.kernels import Gaussian
from vcc.shapes.surfaces import Cubic


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
        ({"row": 3}, "row is 3, but there are 3"),
        ({"pixel_row": -5}, "pixel_row is -5, but there are 4"),
    ],
)
def test_refuses(options, message):
    with pytest.raises(InputError, match=message):
        plot_phase_space(some_light_field(), **options)


# -- what bends or scatters otherwise: rays


def beam(views=40, pixels=5, slopes=0.01, across="u"):
    """Even light of radiance 1 over 20 mm and a few slopes around 0."""
    shape = (1, views, 1, pixels) if across == "u" else (views, 1, pixels, 1)
    return LightField.from_views(np.ones(shape, np.float32), 20 * mm / views, slopes / pixels)


LIGHT = 20 * mm * 0.01
"""Radiance 1 over the beam's phase space."""


def middles(picture):
    """Places of the columns, and the mean of the second coordinate of the light in each."""
    light = picture.radiance * picture.filled
    second = (picture.second[1:] + picture.second[:-1]) / 2
    lit = light.sum(axis=0) > 0
    return (picture.first[1:] + picture.first[:-1])[lit] / 2, light.T[lit] @ second / light.sum(axis=0)[lit]


def sensor(z):
    return Sensor(z, (10, 10), 1 * mm)


@pytest.mark.parametrize("across", ["u", "v"])
def test_a_lens_array_cuts_phase_space_into_sawteeth(across):
    """Δs = −(u − c)/f in each cell; a column that straddles two cells is left out. A column is du/f in slope wide,
    and a mean over it is right to the raster's half cell and the lattice of rays, a fifth of a column at most."""
    pitch, f = 2 * mm, 8 * mm
    camera = Camera([LensArray(pitch, f)], sensor(8 * mm))
    entrance, behind, on_sensor = phase_space_stages(camera, beam(across=across), across=across)
    place, slope = middles(behind)
    column = place[1] - place[0]
    from_centre = place - pitch * np.round(place / pitch)
    inside = np.abs(from_centre) < pitch / 2 - column
    raster = behind.second[1] - behind.second[0]
    assert np.count_nonzero(inside) > 300
    assert slope[inside] == pytest.approx(-from_centre[inside] / f, abs=raster / 2 + 0.2 * column / f)
    # f behind, each lenslet's cell has come together at its centre: slopes of ±0.005 leave ±f·0.005 around it.
    place, _ = middles(on_sensor)
    assert np.abs(place - pitch * np.round(place / pitch)).max() <= f * 0.005 + column
    for picture in (entrance, behind, on_sensor):
        assert picture.light == pytest.approx(LIGHT, rel=1e-9)  # rays are neither made nor lost


def test_a_biprism_moves_two_halves_apart():
    camera = Camera([Biprism(0.05, decentre=(3 * mm, 0))], sensor(10 * mm))
    _, behind, on_sensor = phase_space_stages(camera, beam())
    place, slope = middles(behind)
    clear = np.abs(place - 3 * mm) > place[1] - place[0]
    raster = behind.second[1] - behind.second[0]
    assert slope[clear] == pytest.approx(np.where(place[clear] > 3 * mm, -0.05, 0.05), abs=raster / 2)
    assert on_sensor.light == pytest.approx(LIGHT, rel=1e-9)


def test_a_cubic_plate_bends_by_its_gradient():
    """OPL = a·(x³ + y³): Δs = 3a·x²."""
    camera = Camera([PhasePlate(Cubic(50.0))], sensor(10 * mm))
    place, slope = middles(phase_space_stages(camera, beam())[1])
    # A column's mean of x² and its middle's differ by less than 1e-3 of what the raster shows.
    assert slope == pytest.approx(150 * place**2, abs=3e-4)


def test_a_gaussian_diffuser_widens_slopes():
    """Variances add: of the light field's Gaussian, of its cells' and the raster's boxes, and of the kernel."""
    sigma, width, pixels = 0.02, 0.03, 101
    step = 8 * width / pixels
    slopes = (np.arange(pixels) - pixels // 2) * step
    values = np.repeat(np.exp(-(slopes**2) / 2 / width**2)[None, None, None, :], 20, axis=1).astype(np.float32)
    field = LightField.from_views(values, 1 * mm, step)
    camera = Camera([Lens(50 * mm), Diffuser(kernel=Gaussian(sigma), z=10 * mm)], sensor(10 * mm))
    entrance, behind_lens, behind = phase_space_stages(camera, field)
    assert behind.light == pytest.approx(entrance.light, rel=1e-6)
    column = np.argmin(np.abs(behind.first))
    light = behind.radiance[:, column] * behind.filled[:, column]
    slope = (behind.second[1:] + behind.second[:-1]) / 2
    # At u = 0, 10 mm behind a lens of 50 mm, light of slope s comes from −10 mm·s before: (s + u/f) = s·0.8.
    kept = np.sum(values[0, 0, 0] * slopes**2) / values[0, 0, 0].sum() + step**2 / 12
    wanted = kept / 0.8**2 + (0.99946 * sigma) ** 2
    mean = (light @ slope) / light.sum()
    assert mean == pytest.approx(0, abs=1e-3)
    # Laid out in cells twice, and shared between neighbours once: 1/12 + 1/12 + 1/6 of a cell squared.
    cell = slope[1] - slope[0]
    assert light @ (slope - mean) ** 2 / light.sum() == pytest.approx(wanted + cell**2 / 3, rel=5e-3)
    assert behind_lens.light == pytest.approx(entrance.light, rel=1e-9)


def test_masks_multiply_behind_what_bends():
    camera = Camera([LensArray(2 * mm, 8 * mm), Mask(lambda x, y: (x > 0) * 0.25, z=1 * mm)], sensor(2 * mm))
    _, before, behind, _ = phase_space_stages(camera, beam())
    place = (behind.first[1:] + behind.first[:-1]) / 2
    assert not behind.radiance[:, place < -0.1 * mm].any()
    right = behind.filled[:, place > 0.1 * mm] > 0
    np.testing.assert_allclose(behind.radiance[:, place > 0.1 * mm][right], 0.25, rtol=1e-6)
    assert behind.light == pytest.approx(
        before.light / 8, rel=1e-2
    )  # the middle lenslet's light leans to one side


def test_rays_agree_with_the_frame_where_both_can_be_had():
    """Cells of a frame behind a lens and a flight, looked up at the middles of the raster."""
    field = LightField.from_views(np.random.default_rng(3).random((1, 6, 1, 8), np.float32), 2 * mm, 0.02, 0.7)
    camera = Camera([Lens(60 * mm), Prism((0.03, 0.01), z=5 * mm)], sensor(20 * mm))
    traced = phase_space_stages(camera, field)[-1]
    u, s = np.meshgrid((traced.first[1:] + traced.first[:-1]) / 2, (traced.second[1:] + traced.second[:-1]) / 2)
    frame = camera.light_field_at(field, 20 * mm).frame
    matrix = frame.linear[np.ix_([0, 2], [0, 2])]
    index = np.linalg.solve(matrix, np.stack([u.ravel(), s.ravel()]) - frame.offset[[0, 2], None])
    whole = np.abs(index - np.round(index)).max(axis=0) < 0.4  # a cell of the raster is less than 0.1 sample
    inside = whole & (np.round(index) >= 0).all(axis=0) & (np.round(index) < [[6], [8]]).all(axis=0)
    i, k = np.round(index[:, inside]).astype(int)
    assert inside.sum() > 20_000
    np.testing.assert_allclose(traced.radiance.ravel()[inside], field.values[0, i, 0, k], rtol=0, atol=1e-6)
    outside = whole & ((np.round(index) < 0) | (np.round(index) >= [[6], [8]])).any(axis=0)
    assert not traced.filled.ravel()[outside].any()


# -- slices across other coordinates


def linear_field():
    """L = 3 + 20u − 30v + 4s + 6t, which interpolation between samples gives exactly."""
    field = LightField.from_views(np.zeros((6, 7, 20, 24), np.float32), (2 * mm, 1 * mm), (0.02, 0.01), 0.7)
    j, i, l, k = np.indices(field.shape)
    rays = field.frame(np.stack([i, j, k, l], axis=-1).reshape(-1, 4))
    values = 3 + rays @ [20, -30, 4, 6]
    return field.replaced(values.reshape(field.shape).astype(np.float32))


@pytest.mark.parametrize("across", ["us", "su", "vt", "uv", "vu", "st", "ut", "vs"])
def test_any_slice_holds_the_other_two_coordinates(across):
    field = linear_field()
    held = {"u": 0.4 * mm, "v": -1.1 * mm, "s": 0.013, "t": -0.021}
    fixed = tuple(value for name, value in held.items() if name not in across)
    sheet = sheet_of_rays(field, slice_of(across), fixed)
    a, b = np.indices(sheet.values.shape) + 0.5
    rays = sheet.origin + a[..., None] * sheet.first + b[..., None] * sheet.second
    for name, value in held.items():
        if name not in across:
            assert rays[..., "uvst".index(name)] == pytest.approx(value)
    # Half a sample from the border values are those of the outermost samples.
    index = field.frame.inverse()(rays)
    inside = ((index >= 0) & (index <= [6, 5, 23, 19])).all(axis=-1)
    assert inside.sum() > 10
    assert sheet.values[inside] == pytest.approx((3 + rays @ [20, -30, 4, 6])[inside], rel=1e-6)


def test_one_direction_on_its_way_through_a_lens_comes_to_its_focus():
    """Light of one direction (s, t) over the aperture, f behind a lens: one place, f·(s, t)."""
    field, f = linear_field(), 50 * mm
    camera = Camera([Lens(f)], sensor(f))
    pictures = phase_space_stages(camera, field, across="uv", fixed=(0.01, 0.02))
    at = pictures[-1]
    assert (at.first[[0, -1]], at.second[[0, -1]]) == (
        pytest.approx([0.5 * mm] * 2, abs=1e-8),
        pytest.approx([1 * mm] * 2, abs=1e-8),
    )
    assert set(np.unique(at.filled)) <= {0.0, 1.0}


def test_the_strip_behind_a_lens_array_is_drawn(tmp_path):
    camera = Camera([Lens(50 * mm, 20 * mm), LensArray(2 * mm, 6 * mm, z=50 * mm, name="micro")], sensor(56 * mm))
    figure = plot_phase_space_stages(camera, some_light_field(3))
    assert [axes.get_title() for axes in figure.axes] == [
        "entrance, z = 0 mm",
        "behind lens, z = 0 mm",
        "behind lens array micro, z = 50 mm",
        "on the sensor, z = 56 mm",
    ]
    assert [len(axes.images) for axes in figure.axes] == [0, 0, 1, 1]
    limits = {(axes.get_xlim(), axes.get_ylim()) for axes in figure.axes}
    assert len(limits) == 1
    ((across, up),) = limits
    corners = corners_of(figure.axes[1])
    assert across[0] <= corners[..., 0].min() <= corners[..., 0].max() <= across[1]
    assert up[0] <= corners[..., 1].min() <= corners[..., 1].max() <= up[1]
    figure.savefig(tmp_path / "strip.png", dpi=40)


def test_pictures_of_places_and_of_slopes_are_upright():
    axes = plot_phase_space(linear_field(), across="uv", fixed=(0.0, 0.0))
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("u [mm]", "v [mm]")
    assert axes.yaxis_inverted()
    assert not plot_phase_space(linear_field(), across="ut").yaxis_inverted()
    black = LightField.from_views(np.zeros((2, 2, 2, 2), np.uint8), 1 * mm, 0.1)
    seen = plot_phase_space(black, across="st")
    assert seen.xaxis_inverted()  # the scene's right side sends light of s < 0
    assert not seen.yaxis_inverted()  # and what is above, at −y, of t > 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"across": "uu"}, "or two of u, v, s and t"),
        ({"across": "uv", "row": 1}, r"fixed=\(s, t\)"),
        ({"across": "us", "fixed": (0.0, 0.0), "pixel_row": 1}, r"fixed=\(v, t\)"),
        ({"across": "uv", "fixed": (0.1,)}, "fixed must be two numbers, s and t"),
        ({"across": "uv", "fixed": (5.0, 0.0)}, "holds no rays of s = 5 and t = 0"),
    ],
)
def test_refuses_slices(options, message):
    with pytest.raises(InputError, match=message):
        plot_phase_space(some_light_field(), **options)


def test_refuses_a_diffuser_in_a_slice_that_it_leads_out_of():
    camera = Camera([Diffuser(kernel=Gaussian(0.1), name="frost")], sensor(1 * mm))
    with pytest.raises(InputError, match='diffuser "frost" scatters light out of the slice "uv"'):
        plot_phase_space_stages(camera, some_light_field(), across="uv")
    with pytest.raises(InputError, match="rays must be 1 or more"):
        phase_space_stages(camera, some_light_field(), rays=0)


def test_any_plane_of_the_axis_holds_the_light_that_flew_there():
    field = some_light_field()
    camera = Camera([Lens(50 * mm, z=10 * mm), Lens(70 * mm, z=30 * mm)], Sensor(60 * mm, (4, 4), 1 * mm))
    places = (-0.2, 0.004, 0.02, 0.03, 0.06)
    stages = phase_space_stages(camera, field, rays=40_000)
    pictures = [phase_space_at(camera, field, z, rays=40_000) for z in places]
    middle = field[1:2, :, 2:3, :]
    ends = np.array(np.meshgrid([-0.5, 4.5], [0.0], [-0.5, 5.5], [0.0], indexing="ij")).reshape(4, -1).T
    for z, picture in zip(places, pictures, strict=True):
        flown = Affine.propagation(z) if z < 0 else camera.rays_at(z)
        rays = flown(middle.frame(ends))
        cell = picture.first[1] - picture.first[0], picture.second[1] - picture.second[0]
        # the outermost rays stand half a cell of theirs inside of the samples' corners: 40 000 rays, 200 a side
        for borders, wanted, step in zip(
            (picture.first, picture.second), (rays[:, 0], rays[:, 2]), cell, strict=True
        ):
            reach = np.ptp(wanted) / 100 + step
            assert borders[[0, -1]] == pytest.approx([wanted.min(), wanted.max()], abs=reach)
        assert picture.z == z
        assert picture.light == pytest.approx(stages[0].light, rel=2e-3)
    assert [picture.title for picture in pictures] == [
        "before the camera, z = -200 mm",
        "z = 4 mm",
        "z = 20 mm",
        "behind lens, z = 30 mm",
        "z = 60 mm",
    ]
    np.testing.assert_array_equal(pictures[-2].radiance, stages[2].radiance)
    np.testing.assert_array_equal(pictures[-1].radiance, stages[3].radiance)
    with pytest.raises(InputError, match="behind the sensor"):
        phase_space_at(camera, field, 61 * mm)


def test_a_plane_within_something_thick_is_refused():
    block = FirstOrder([[1, 0.01], [0, 1]], z=10 * mm, length=20 * mm)
    camera = Camera([block], Sensor(60 * mm, (4, 4), 1 * mm))
    with pytest.raises(InputError, match="lies inside"):
        phase_space_at(camera, some_light_field(), 20 * mm)
