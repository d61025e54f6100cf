"""What each element looks like from the side: its own marks, and glass of the shape that bends rays so."""

import math
from dataclasses import dataclass

import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from matplotlib.patches import Polygon
from numpy.polynomial import Polynomial

import vcc
from vcc.base.units import mm, um
from vcc.plot import focused_distance, plot_camera, style
from vcc.plot.elements import MOST_CELLS, Span, magnification
from vcc.plot.labels import label_of
from vcc.shapes.surfaces import Cubic

SENSOR = vcc.Sensor(52 * mm, (500, 500), 48 * um)
LENS = vcc.Lens(50 * mm, diameter=20 * mm)


def drawn(*elements: vcc.Element, **options):
    return plot_camera(vcc.Camera(elements, SENSOR), **options)


def pieces(axes, colour):
    """Polygons filled with a colour: (z, height) of their corners, mm."""
    from matplotlib.colors import same_color

    return [patch.get_xy() for patch in axes.patches if isinstance(patch, Polygon)
            and patch.get_facecolor()[3] and same_color(patch.get_facecolor()[:3], colour)]  # fmt: skip


def glass(axes):
    (piece,) = pieces(axes, style.GLASS)
    return piece


def words(axes):
    return "\n".join(text.get_text() for text in axes.texts)


def thickness(axes, z):
    """Heights and how far glass reaches towards the scene there, both mm."""
    corners = glass(axes)
    front = corners[corners[:, 0] < z / mm - 1e-9]
    return front[:, 1], z / mm - front[:, 0]


def test_a_phase_plate_has_the_profile_of_its_path():
    height, depth = thickness(drawn(vcc.PhasePlate(Cubic(300.0), width=16 * mm, z=20 * mm)), 20 * mm)
    # Glass is drawn as thick as its optical path a·x³ is long, but for a factor and a constant.
    fit = Polynomial.fit(height**3, depth, 1)
    assert np.ptp(height) == pytest.approx(16, rel=1e-3)
    assert depth == pytest.approx(fit(height**3), abs=1e-4 * np.ptp(depth))
    assert fit.convert().coef[1] > 0


@pytest.mark.parametrize("deflection", [0.03, -0.03])
def test_a_biprism_has_a_roof(deflection):
    axes = drawn(LENS, vcc.Biprism(deflection, z=30 * mm, diameter=18 * mm))
    roof = max(pieces(axes, style.GLASS), key=lambda corners: corners[:, 0].max())
    front = roof[roof[:, 0] < 30 - 1e-9]
    height, depth = front[:, 1], 30 - front[:, 0]
    # Thickest where light is bent to: at the ridge, or at the rims.
    assert abs(height[np.argmax(np.sign(deflection) * depth)]) < 0.1
    assert depth == pytest.approx(Polynomial.fit(abs(height), depth, 1)(abs(height)), abs=1e-3 * np.ptp(depth))
    assert ("biprism", f"δ = {deflection}".replace("-", "−")) == tuple(
        next(text.get_text() for text in axes.texts if "biprism" in text.get_text()).split("\n")
    )


def bulges(depth) -> int:
    """How many places are thicker than both neighbours."""
    inner = depth[1:-1]
    return int(((inner > depth[:-2]) & (inner >= depth[2:])).sum())


def test_an_array_shows_each_of_its_lenslets():
    axes = drawn(vcc.LensArray(pitch=2 * mm, focal_length=30 * mm, width=18 * mm, z=20 * mm))
    height, depth = thickness(axes, 20 * mm)
    assert bulges(depth) == 9
    assert (height.min(), height.max()) == pytest.approx((-9, 9))
    assert "9 cells of 2 mm\nf = 30 mm" in words(axes)
    assert "as large" not in words(axes)
    assert len(axes.figure.axes) == 1


def test_an_array_of_very_many_lenslets_is_a_symbol_and_says_so():
    array = vcc.LensArray(pitch=0.1 * mm, focal_length=1 * mm, width=20 * mm, z=51 * mm)
    axes = drawn(LENS, array)
    scale = magnification(array, array.faces(), 0, *(side * 13.44 * mm for side in (-1, 1)))
    assert scale == 5  # 200 cells, some 40 instead
    piece = max(pieces(axes, style.GLASS), key=lambda corners: corners[:, 0].max())
    assert bulges(51 - piece[piece[:, 0] < 51 - 1e-9, 0]) == 39  # and a half one at each rim
    assert "200 cells of 100 µm\nf = 1 mm\ndrawn 5× as large" in words(axes)
    assert magnification(LENS, LENS.faces(), 0, -1, 1) == 1
    assert MOST_CELLS == 60


def test_prisms_side_by_side_lean_each_its_own_way():
    slopes = np.zeros((1, 3, 2))
    slopes[0, :, 0] = (0.05, 0.0, -0.05)
    height, depth = thickness(drawn(vcc.PrismArray(slopes, pitch=6 * mm, z=20 * mm)), 20 * mm)
    for middle, sign in ((-6, 1), (0, 0), (6, -1)):
        inside = abs(height - middle) < 2.9
        gradient = np.polyfit(height[inside], depth[inside], 1)[0]
        assert np.sign(round(gradient, 9)) == sign


@pytest.mark.parametrize("coded", [False, True])
def test_diffusers_are_frosted_more_where_they_scatter_more(coded):
    if coded:
        diffuser = vcc.CodedDiffuser(
            vcc.kernels.Gaussian(1.0), width=20 * mm, widths=np.array([[0.0, 0.02, 0.05]]), z=30 * mm
        )
    else:
        diffuser = vcc.Diffuser(vcc.kernels.Gaussian(0.05), width=20 * mm, z=30 * mm)
    axes = drawn(LENS, diffuser)
    (frost,) = pieces(axes, style.FROST)
    teeth = frost[:, 0].reshape(-1) - 30
    assert teeth.min() >= -1e-9
    assert teeth.max() > 0.1
    low, high = (teeth[(side * frost[:, 1] > 2)].max() for side in (-1, 1))
    assert (low < 0.5 * high) == coded
    (tones,) = (mesh for mesh in axes.collections if isinstance(mesh, QuadMesh))
    tone = np.asarray(tones.get_array()).ravel()
    assert (tone[0] < 0.1) == coded
    assert tone[-1] == pytest.approx(1, abs=0.02)
    assert "σ = 0 to 0.05" in words(axes) if coded else "σ = 0.05" in words(axes)


def test_the_legend_is_as_strong_where_rays_split():
    axes = drawn(LENS, vcc.Diffuser(vcc.kernels.Gaussian(0.05), z=30 * mm))
    assert [line.get_alpha() for line in axes.get_legend().get_lines()] == [None] * 3
    assert [line.get_color() for line in axes.get_legend().get_lines()] == [style.BLUE, style.ORANGE, style.GREEN]


def test_a_first_order_system_is_a_block_with_principal_planes_and_stop():
    lens = vcc.FirstOrder.thick_lens((40 * mm, -60 * mm), 12 * mm, 1.5, diameter=18 * mm, z=5 * mm)
    # Hecht, Optics, eq. 6.3 and 6.4, from the vertices.
    f = lens.focal_length
    front, back = (-f * 0.5 * 12 * mm / (1.5 * r) for r in (-60 * mm, 40 * mm))
    axes = drawn(lens)
    block = glass(axes)
    assert sorted(set(block[:, 0].round(9))) == [5, 17]
    dashed = {round(line.get_xdata()[0], 6) for line in axes.lines if line.get_color() == style.GLASS_EDGE}
    assert dashed == {round(5 + front / mm, 6), round(17 + back / mm, 6)}
    assert {"H", "H′"} <= {text.get_text() for text in axes.texts}
    stop = [line for line in axes.lines if line.get_color() == style.INK and line.get_linewidth() == 3]
    assert sorted(abs(line.get_ydata()[0]) for line in stop) == pytest.approx([9, 9])
    assert f"f = {f / mm:.4g} mm, f/{f / (18 * mm):.3g}" in words(axes)


def test_an_afocal_system_has_no_principal_planes():
    axes = drawn(vcc.FirstOrder(((2.0, 0.03), (0.0, 0.5)), 30 * mm))
    assert "afocal" in words(axes)
    assert "H" not in {text.get_text() for text in axes.texts}


@dataclass(frozen=True)
class Ring(vcc.Element):
    """Any faces: it bends, scatters and absorbs."""

    radius: float

    def faces(self) -> vcc.Faces:
        return vcc.Faces(
            deflection=lambda x, y: (30.0 * x**2, 0 * x * y),
            transmission=lambda x, y: np.where(np.hypot(x, y) < self.radius, 0.0, 1.0),
            scatter=vcc.kernels.Gaussian(0.01),
        )


def test_a_users_own_element_is_drawn_by_its_faces():
    axes = drawn(Ring(3 * mm, z=20 * mm, name="mine"))
    assert len(pieces(axes, style.GLASS)) == len(pieces(axes, style.FROST)) == 1
    black = [mesh for mesh in axes.collections if isinstance(mesh, QuadMesh) and mesh.get_zorder() == 3]
    (mask,) = black
    edges = np.asarray(mask.get_coordinates())[:, 0, 1]
    dark = np.asarray(mask.get_array()).ravel() == 0
    assert (edges[:-1][dark][0], edges[1:][dark][-1]) == pytest.approx((-3, 3), abs=0.02)
    assert "ring mine" in words(axes)


@pytest.mark.parametrize("across", ["x", "y"])
def test_all_of_them_in_one_camera_and_off_the_axis(across):
    aside = {"decentre": (1 * mm, -2 * mm)}
    elements = [
        LENS,
        vcc.Pyramid(3, 0.02, z=8 * mm, **aside),
        vcc.Diffuser(vcc.kernels.TopHat(0.02), z=15 * mm, **aside),
        vcc.PhasePlate(Cubic(20.0), width=20 * mm, z=22 * mm, **aside),
        Ring(1 * mm, z=28 * mm, **aside),
        vcc.Mask(vcc.patterns.mura(7), width=12 * mm, z=35 * mm, **aside),
        vcc.LensArray(pitch=1 * mm, focal_length=(8 * mm, 9 * mm, 10 * mm), layout="hexagonal", circular=True,
                      fill_factor=0.8, z=45 * mm, **aside),
    ]  # fmt: skip
    axes = drawn(*elements, across=across)
    axes.figure.canvas.draw()
    assert len(pieces(axes, style.GLASS)) == 5
    assert "f = 8 mm, 9 mm, 10 mm" in words(axes)


@pytest.mark.parametrize(
    ("element", "expected"),
    [
        (vcc.Prism((0.1, -0.02)), "prism\nδ = 0.1, −0.02"),
        (vcc.Pyramid(4, -0.04, name="P"), "pyramid P\n4 sides, δ = −0.04"),
        (vcc.PhasePlate(lambda x, y: (x, y), width=1 * mm), "phase plate\nslopes by <lambda>"),
        (vcc.LensArray(pitch=1 * mm, focal_length=math.inf, circular=True), "lens array\npitch 1 mm"),
        (vcc.PrismArray(np.zeros((1, 3, 2)), pitch=1 * mm), "prism array\n3 cells of 1 mm"),
    ],
)
def test_labels(element, expected):
    pen = Span(0, -10 * mm, 10 * mm)
    assert label_of(element, pen) == expected


# --- plenoptic cameras ---


def plenoptic(b: float, z: float = 52 * mm, f: float = 0.5 * mm, **options) -> vcc.Camera:
    lens = vcc.Lens(50 * mm, diameter=12.5 * mm)
    array = vcc.LensArray(pitch=0.125 * mm, focal_length=f, width=20 * mm, z=z, **options)
    return vcc.Camera([lens, array], vcc.Sensor(z + b, (1000, 1000), 12.5 * um))


def test_a_plenoptic_camera_is_focused_on_its_array():
    assert focused_distance(plenoptic(0.5 * mm)) == pytest.approx(1 / (1 / 0.05 - 1 / 0.052))


@pytest.mark.parametrize("b", [0.7 * mm, 0.4 * mm])  # a real picture before the array, a virtual one behind it
def test_a_focused_plenoptic_camera_is_focused_on_what_its_lenslets_relay(b):
    a = 1 / (1 / (0.5 * mm) - 1 / b)
    assert focused_distance(plenoptic(b)) == pytest.approx(1 / (1 / 0.05 - 1 / (0.052 - a)))


def test_lenslets_without_a_main_lens_look_at_their_own_distance():
    array = vcc.LensArray(pitch=1 * mm, focal_length=3 * mm)
    assert focused_distance(vcc.Camera([array], vcc.Sensor(3 * mm, (9, 9), 1 * mm))) == math.inf
    assert focused_distance(vcc.Camera([array], vcc.Sensor(4 * mm, (9, 9), 1 * mm))) == pytest.approx(12 * mm)
    assert focused_distance(vcc.Camera([array], vcc.Sensor(2 * mm, (9, 9), 1 * mm))) is None


def rays_in(axes, colour, z):
    """Ends at z (mm) of the lines of a colour."""
    lines = [line.get_xydata() for line in axes.lines if line.get_color() == colour and len(line.get_xdata()) == 2]
    return np.array([line[1, 1] for line in lines if abs(line[1, 0] - z) < 1e-9])


def test_micro_images_are_shown_magnified():
    axes = plot_camera(plenoptic(0.5 * mm))
    main, magnified = axes.figure.axes
    assert main is axes
    assert magnified.get_title() == "5 cells magnified"
    assert np.ptp(magnified.get_ylim()) == pytest.approx(5 * 0.125)
    assert magnified.get_xlim()[0] < 52 < 52.5 < magnified.get_xlim()[1]
    # The micro-image of the main lens under the middle cell, and under a neighbour: f/d · 12.5 mm wide.
    blue, green = (rays_in(magnified, colour, 52.5) for colour in (style.BLUE, style.GREEN))
    assert np.ptp(blue) == pytest.approx(0.97 * 12.5 * 0.5 / 52)
    assert np.mean(blue) == pytest.approx(0, abs=1e-9)
    assert np.mean(green) == pytest.approx(0.125 * (1 + 0.5 / 52))
    borders = [line.get_ydata()[0] for line in magnified.lines if line.get_color() == "white"]
    assert np.diff(sorted(borders)) == pytest.approx(12.5e-3)
    assert len(borders) > 40
    axes.figure.canvas.draw()


def test_the_relayed_picture_is_sharp_under_each_lenslet():
    b = 0.7 * mm
    axes = plot_camera(plenoptic(b))
    magnified = axes.figure.axes[1]
    a = 1 / (1 / 0.5 - 1 / 0.7)
    places = rays_in(magnified, style.BLUE, 52.7)
    # A picture at (0, −a) lands magnified by −b/a about each lenslet's middle.
    cells = np.round(places / (0.125 * (1 + 0.7 / a)))
    assert len(np.unique(cells)) > 2
    assert places == pytest.approx(cells * 0.125 * (1 + 0.7 / a), abs=1e-9)


def test_a_magnified_piece_is_drawn_where_it_is_asked_for():
    camera = plenoptic(0.5 * mm)
    assert len(plot_camera(camera, magnified=False).figure.axes) == 1
    coarse = vcc.Camera([LENS, vcc.LensArray(pitch=2 * mm, focal_length=9 * mm, width=20 * mm, z=43 * mm)], SENSOR)
    assert len(plot_camera(coarse).figure.axes) == 1
    assert len(plot_camera(coarse, magnified=True).figure.axes) == 2
    left, right = style.new_axes(9, 4, 1, 2)
    assert plot_camera(camera, axes=left) is left
    assert not right.lines
    plot_camera(camera, axes=left, magnified=right, across="y")
    assert right.get_title() == "5 cells magnified"
    assert right.yaxis_inverted()
    left.figure.canvas.draw()


def test_refuses_to_magnify_what_is_not_there():
    with pytest.raises(vcc.InputError, match="needs an array of cells before the sensor"):
        drawn(LENS, magnified=True)
    with pytest.raises(vcc.InputError, match="pass them as magnified="):
        plot_camera(plenoptic(0.5 * mm), magnified=True, axes=style.new_axes(4, 3))


def test_rays_fill_the_stop_of_a_thick_lens():
    lens = vcc.FirstOrder.thick_lens((40 * mm, -60 * mm), 12 * mm, 1.5, diameter=18 * mm)
    axes = drawn(lens, object_distances=[math.inf])
    entering = [line.get_xydata() for line in axes.lines if line.get_color() == style.BLUE]
    heights = [piece[1, 1] for piece in entering if piece[1, 0] == 0]
    assert (min(heights), max(heights)) == pytest.approx((-0.97 * 9, 0.97 * 9))


def test_phase_space_behind_a_diffuser_and_a_real_lens(tmp_path):
    from vcc.plot import plot_phase_space_stages

    lens = vcc.FirstOrder.thick_lens((40 * mm, -60 * mm), 12 * mm, 1.5, diameter=18 * mm, z=5 * mm)
    camera = vcc.Camera([vcc.Diffuser(vcc.kernels.Gaussian(0.02)), lens], SENSOR)
    field = vcc.LightField.from_views(np.ones((3, 9, 4, 16), np.float32), 2 * mm, 0.01)
    figure = plot_phase_space_stages(camera, field)
    figure.savefig(tmp_path / "stages.png", dpi=30)
    assert [axes.get_title() for axes in figure.axes if axes.get_visible()][1:] == [
        "behind diffuser, z = 0 mm",
        "behind first order, z = 17 mm",
        "on the sensor, z = 52 mm",
    ]
