"""Sampling advice against closed forms of thin lenses, and ghosts against pictures that show them."""

import math

import numpy as np
import pytest

import vcc
from vcc.advice.mask_limits import finest_detail
from vcc.advice.words import tangent_over_sine
from vcc.analysis import sampling_advice
from vcc.base.units import mm, nm, um
from vcc.shapes.kernels import Gaussian
from vcc.shapes.patterns import Bounded, Cells, Circle, CosineSum
from vcc.store import save_store

F, SENSOR, PITCH, DIAMETER = 50 * mm, 52 * mm, 20 * um, 16 * mm
FOCUS = 1 / (1 / F - 1 / SENSOR)
SPACING, SLOPE = 1 * mm, 3e-4
LENS = vcc.Lens(F, DIAMETER)
EXACT = 1e-9
"""Products of a few numbers in double precision, one bisection to 1e-12 of its value among them."""


def camera(*behind: vcc.Element) -> vcc.Camera:
    return vcc.Camera([LENS, *behind], vcc.Sensor(SENSOR, (300, 400), PITCH))


def light_field(views=16, spacing=SPACING, slope=SLOPE, focus_distance=1.3, pixels=(300, 400)) -> vcc.LightField:
    values = np.broadcast_to(np.uint8(0), (views, views, *pixels))
    return vcc.LightField.from_views(values, spacing, slope, focus_distance)


def gap(distance, spacing=SPACING):
    """Pixels between views: a ray of a point through u meets the sensor at u·(1 + d/Z − d/f)."""
    return abs(1 + SENSOR / distance - SENSOR / F) * spacing / PITCH


@pytest.mark.parametrize("focus_distance", [0.7, 1.3, math.inf])
def test_disparity_per_view_whatever_plane_the_views_converge_on(focus_distance):
    advice = sampling_advice(camera(), light_field(focus_distance=focus_distance), depths=(0.6, 4.0))
    assert advice["disparity near"].value == pytest.approx(gap(0.6), rel=EXACT)
    assert advice["disparity far"].value == pytest.approx(gap(4.0), rel=EXACT)
    assert advice["disparity focus"].value == 0.0
    assert advice.focus_distance == pytest.approx(FOCUS, rel=EXACT)
    assert advice.disparity(0.9) == pytest.approx(gap(0.9), rel=EXACT)
    assert advice.disparity(math.inf) == pytest.approx(gap(math.inf), rel=EXACT)


def test_two_lenses_and_a_decentred_prism():
    """Matrices by hand: lens f₁, flight a, lens f₂, flight b; a prism moves pictures, not their gaps."""
    f1, f2, a, b = 80 * mm, 60 * mm, 30 * mm, 25 * mm
    elements = [vcc.Lens(f1, 10 * mm), vcc.Prism((0.01, 0.02), z=10 * mm, decentre=(2 * mm, 0)), vcc.Lens(f2, z=a)]
    advice = sampling_advice(
        vcc.Camera(elements, vcc.Sensor(a + b, (10, 10), PITCH)), light_field(), depths=(0.3, 2)
    )
    for key, distance in (("near", 0.3), ("far", 2.0)):
        place, slope = 1.0, 1 / distance - 1 / f1
        place += a * slope
        place += b * (slope - place / f2)
        assert advice[f"disparity {key}"].value == pytest.approx(abs(place) * SPACING / PITCH, rel=EXACT)


def test_a_field_that_flew_is_the_same_field_before_a_camera_further_on():
    flown = sampling_advice(camera(), light_field().transformed(vcc.Affine.propagation(0.1)))
    further = vcc.Camera([vcc.Lens(F, DIAMETER, z=0.1)], vcc.Sensor(0.1 + SENSOR, (300, 400), PITCH))
    still = sampling_advice(further, light_field())
    for distance in (0.5, 0.8, 3.0):
        assert flown.disparity(distance + 0.1) == pytest.approx(still.disparity(distance), rel=1e-6)
    assert flown.free_of_ghosts == pytest.approx(np.array(still.free_of_ghosts) + 0.1, rel=1e-6)
    assert flown.focus_distance == pytest.approx(still.focus_distance + 0.1, rel=1e-6)


def test_free_of_ghosts_in_closed_form():
    """|1 + d/Z − d/f|·du = p at the ends; samples here are finer than pixels."""
    advice = sampling_advice(camera(), light_field(), depths=(0.6, 4.0))
    assert SENSOR * SLOPE < PITCH
    reach = PITCH / (SPACING * SENSOR)
    near, far = advice.free_of_ghosts
    assert near == pytest.approx(1 / (1 / FOCUS + reach), rel=EXACT)
    assert far == pytest.approx(1 / (1 / FOCUS - reach), rel=EXACT)
    assert advice.disparity(near) == pytest.approx(1, rel=EXACT)
    assert advice["disparity near"].verdict == advice["views across"].verdict == "watch out"
    inside = sampling_advice(camera(), light_field(), depths=(near * 1.001, far / 1.001))
    assert inside["disparity near"].fine
    assert inside["views across"].fine


def test_samples_wider_than_a_pixel_hide_ghosts_up_to_their_width():
    wide = 5 * SLOPE
    advice = sampling_advice(camera(), light_field(slope=wide), depths=(0.6, 4.0))
    assert advice["samples"].value == pytest.approx(SENSOR * wide, rel=EXACT)
    assert advice["samples"].limit == pytest.approx(PITCH, rel=EXACT)
    assert advice.disparity(advice.free_of_ghosts[0]) == pytest.approx(SENSOR * wide / PITCH, rel=EXACT)
    assert "1170×1560 pixels" in advice["samples"].advice  # 78 µm samples, 20 µm pixels


def a_point(distance: float, views: int = 9) -> vcc.LightField:
    """One point on the axis in 1×views views, in samples as wide as a pixel on the sensor."""
    pixels, slope = 161, PITCH / SENSOR
    values = np.zeros((1, views, 9, pixels), np.float32)
    for i in range(views):
        # s = u/F − (k − k₀)·p in the frame, u/Z for the point; here the views are parallel.
        place = -(i - (views - 1) / 2) * SPACING / distance / slope + (pixels - 1) / 2
        left = math.floor(place)
        values[0, i, :, left] += 1 - (place - left)
        values[0, i, :, left + 1] += place - left
    return vcc.LightField.from_views(values, SPACING, slope)


@pytest.mark.parametrize(("share", "ghosts"), [(0.5, False), (0.9, False), (3.0, True), (5.0, True)])
def test_pictures_show_ghosts_beyond_the_range_and_none_within(share, ghosts):
    """``share`` of the limit of a pixel from view to view; the picture is the plain sum of the views.

    Tents of two pixels, laid between samples by another such tent, averaged over a pixel, g ≤ 1 apart: their sum
    ripples by 2·sinc⁵(1/g) of its mean, below 1e-3. Three pixels apart or more, at most 2.5 pixels wide from the
    middle each way, they leave the pixels half-way between nearly dark: below a third of the peaks.
    """
    reach = PITCH / (SPACING * SENSOR)
    distance = 1 / (1 / FOCUS + share * reach)
    camera = vcc.Camera([vcc.Lens(F)], vcc.Sensor(SENSOR, (3, 121), PITCH))
    field = a_point(distance)
    advice = sampling_advice(camera, field, depths=(distance, distance))
    assert advice["disparity near"].value == pytest.approx(share, rel=1e-6)
    assert advice["disparity near"].fine is not ghosts
    row = camera.capture(field, between_views="none").values[1]
    lit = np.flatnonzero(row > row.max() / 2)
    core = row[lit[0] : lit[-1] + 1]
    peaks = np.count_nonzero((core[1:-1] < core[:-2]) & (core[1:-1] <= core[2:]) & (core[1:-1] < core.max() / 3))
    assert (peaks >= 8) == ghosts
    if not ghosts:
        assert peaks == 0


def test_views_that_a_stop_keeps_out_make_no_ghosts():
    """A stop of 4 mm lets in 4 of 16 views of 1 mm; one smaller than a view shows one."""
    for diameter, let_in in ((4 * mm, 4), (0.5 * mm, 1)):
        stopped = vcc.Camera([vcc.Lens(F, diameter)], vcc.Sensor(SENSOR, (300, 400), PITCH))
        advice = sampling_advice(stopped, light_field(), depths=(0.6, 4.0))
        if let_in > 1:
            item = advice["views across"]
            assert (item.value, item.limit) == (let_in, math.ceil(gap(0.6, diameter)))
        else:
            assert "views across" not in advice.items
            assert advice.free_of_ghosts == (0.0, math.inf)


def test_views_needed_are_just_enough():
    """A camera alone asks for as many views of its opening as the nearest depth needs."""
    advice = sampling_advice(camera(), depths=(0.7, 3.0))
    needed = math.ceil(max(gap(0.7, DIAMETER), gap(3.0, DIAMETER)))
    assert advice.views == (needed, needed)
    assert advice["views across"].fine
    assert advice["samples"].fine
    fewer = sampling_advice(camera(), depths=(0.7, 3.0), views=(needed - 1, 7))
    assert not fewer["views across"].fine
    assert (fewer["views down"].value, fewer["views down"].limit) == (needed - 1, needed)
    assert fewer["views across"].value == 7
    assert "none given" in str(advice)


@pytest.mark.parametrize(("slope", "share"), [(0.3, 0.0440), (0.1, 0.00499), (0.0, 0.0)])
def test_tangent_and_sine(slope, share):
    """√(1 + m²) − 1: m²/2 to first order, less m⁴/8."""
    assert tangent_over_sine(slope) == pytest.approx(share, rel=2e-3)


def test_the_largest_slope_and_the_airy_radius():
    """From the lens' rim to the sensor's opposite corner: the rays that bend most."""
    advice = sampling_advice(camera(), depths=(FOCUS, FOCUS), views=(5, 5))
    # The corner lies at atan(3/4) from x; the nearest of eight places around the rim at 45°.
    corner = np.array([400, 300]) * PITCH / 2
    rim = DIAMETER / 2 * np.array([1, 1]) / math.sqrt(2)
    assert advice["slope"].value == pytest.approx(np.linalg.norm(corner + rim) / SENSOR, rel=EXACT)
    radius = 1.22 * 550 * nm * SENSOR / DIAMETER
    assert advice["airy"].value == pytest.approx(radius, rel=EXACT)
    assert advice["airy"].fine
    red = sampling_advice(camera(), depths=(FOCUS, FOCUS), wavelength=700 * nm)
    assert red["airy"].value == pytest.approx(radius * 700 / 550, rel=EXACT)
    pinhole = vcc.Camera([vcc.Mask(Circle(0.5 * mm))], vcc.Sensor(SENSOR, (300, 400), PITCH))
    found = sampling_advice(pinhole, depths=(1.0, 2.0))
    assert found["airy"].value == pytest.approx(1.22 * 550 * nm * SENSOR / (0.5 * mm), rel=EXACT)
    assert not found["airy"].fine
    assert found.focus_distance is None


def test_a_mask_before_the_sensor():
    """Similar triangles from the lens over the mask to the sensor."""
    place, period = 50 * mm, 0.4 * mm
    code = vcc.Mask(CosineSum(period, harmonics=4), width=30 * mm, z=place, name="code")
    advice = sampling_advice(camera(code), light_field(), depths=(0.6, 4.0))
    detail = period / 4 / 2
    views, samples = advice['mask "code" views'], advice['mask "code" samples']
    assert views.value == pytest.approx(SPACING * (1 - place / SENSOR), rel=1e-6)  # of a point in focus
    assert samples.value == pytest.approx(place * SLOPE, rel=EXACT)
    assert views.limit == samples.limit == detail
    assert advice['mask "code" shadow'].value == pytest.approx(detail * SENSOR / place, rel=EXACT)
    fresnel = advice['mask "code" diffraction']
    assert fresnel.value == pytest.approx(math.sqrt(550 * nm * (SENSOR - place)), rel=EXACT)
    assert fresnel.limit == detail
    coarse = sampling_advice(camera(code), light_field(slope=4 * SLOPE), depths=(0.6, 4.0))
    item = coarse['mask "code" samples']
    assert not item.fine
    assert f"{math.ceil(300 * item.value / detail)}×{math.ceil(400 * item.value / detail)} pixels" in item.advice


def test_samples_coarser_than_a_mask_lose_it_in_the_picture():
    """The picture of even light through a cosine mask: its contrast falls by sinc(sample at the mask / period)."""
    place, period = 51 * mm, 0.4 * mm
    one = vcc.Mask(CosineSum((period, math.inf)), width=30 * mm, z=place, name="code")
    camera = vcc.Camera([vcc.Lens(F), one], vcc.Sensor(SENSOR, (4, 200), PITCH))
    contrasts = []
    for samples_a_period in (8, 1):
        slope = period / samples_a_period / place
        values = np.ones((1, 1, 60, 60 * samples_a_period), np.float32)
        field = vcc.LightField.from_views(values, 1e-6, slope)
        item = sampling_advice(camera, field)['mask "code" samples']
        assert item.value == pytest.approx(period / samples_a_period, rel=EXACT)
        assert item.fine == (samples_a_period == 8)
        row = camera.capture(field, refine=1).values[2, 20:180].astype(float)
        contrasts.append((row.max() - row.min()) / (row.max() + row.min()))
    # Of eight samples a period means leave sinc(1/8), tents between them sinc²(1/8), pixels of 20 of 408 µm 0.996:
    # 0.92, and the tents' own ripple, sinc²(7/8) = 0.02, may lower the peaks and fill the valleys by as much.
    assert contrasts[0] > 0.88
    assert contrasts[1] < 0.02


def test_a_code_in_the_aperture():
    """Holes of width a: diffraction λ·d/a against their picture, a·|1 + d/Z − d/f|."""
    code = vcc.Mask(np.eye(7), 14 * mm, name="code")
    advice = sampling_advice(camera(code), light_field(), depths=(0.6, 4.0))
    item = advice['mask "code" diffraction']
    assert item.value == pytest.approx(550 * nm * SENSOR / (2 * mm), rel=EXACT)
    assert item.limit == pytest.approx(gap(0.6, 2 * mm) * PITCH, rel=EXACT)
    assert item.fine
    assert 'mask "code" shadow' not in advice.items
    near = sampling_advice(camera(code), light_field(), depths=(FOCUS * 0.9999, FOCUS))
    assert not near['mask "code" diffraction'].fine


def test_behind_a_lens_array_only_what_is_well_defined():
    """Views du apart, seen through the middle of a lenslet: du·b/a, by the intercept theorem."""
    array = vcc.LensArray(0.2 * mm, 1 * mm, z=51 * mm, name="micro")
    advice = sampling_advice(camera(array), light_field(), depths=(0.6, 4.0))
    assert advice["view behind lenslet"].value == pytest.approx(SPACING * 1 * mm / (51 * mm), rel=EXACT)
    assert advice["samples"].value == pytest.approx(51 * mm * SLOPE, rel=EXACT)
    assert advice["samples"].limit == 0.2 * mm
    assert advice["lenslet airy"].value == pytest.approx(1.22 * 550 * nm * 1 * mm / (0.2 * mm), rel=EXACT)
    assert not {"disparity near", "views across", "airy"} & set(advice.items)
    assert advice.free_of_ghosts is None
    with pytest.raises(vcc.InputError, match='not given behind lens array "micro"'):
        advice.disparity(1.0)
    with pytest.raises(vcc.InputError, match=r"no sampling item is named 'airy'.*behind lens array"):
        advice["airy"]


def test_plates_facets_and_diffusers():
    plate = vcc.PhasePlate(vcc.surfaces.Cubic(50.0), name="cubic")
    assert "samples" not in sampling_advice(camera(plate), light_field()).items
    facets = sampling_advice(camera(vcc.Biprism(0.01, z=10 * mm, name="two")), light_field(), depths=(0.6, 4.0))
    assert facets["disparity near"].value == pytest.approx(gap(0.6), rel=EXACT)
    assert "within each" in str(facets)
    ground = sampling_advice(camera(vcc.Diffuser(kernel=Gaussian(1e-3), z=2 * mm, name="frost")), light_field())
    assert 'diffuser "frost" spreads light by up to 200 um' in ground.notes[0]  # 4 σ over 50 mm
    holes = sampling_advice(camera(vcc.Mask(lambda x, y: (x > 0) * 1.0, z=9 * mm, name="own")), light_field())
    assert 'detail of mask "own" is not given' in holes.notes[0]


def test_finest_detail():
    assert finest_detail(Cells(np.eye(4), 8 * mm)) == pytest.approx(2 * mm)
    assert finest_detail(Bounded(CosineSum((0.3 * mm, math.inf), 3), 1.0, 1.0)) == pytest.approx(0.05 * mm)
    assert finest_detail(Circle(1 * mm)) is None
    assert finest_detail(Cells(np.ones((3, 3)), 8 * mm)) is None


def test_a_field_of_unknown_depths_and_one_whose_light_converges():
    still = vcc.LightField.from_views(np.zeros((4, 4, 20, 20), np.uint8), SPACING, SLOPE)
    advice = sampling_advice(camera(), still)
    assert advice.depths is None
    assert advice.free_of_ghosts is not None
    behind_lens = sampling_advice(camera(), light_field().transformed(vcc.Affine.lens(30 * mm)), depths=None)
    assert behind_lens["samples"].value == pytest.approx(SENSOR * SLOPE, rel=EXACT)
    stated = vcc.LightField.from_views(np.zeros((4, 4, 20, 20), np.uint8), SPACING, SLOPE, 1.3, (-3, 1))
    # 1/Z = 1/1.3 + disparity·slope/spacing
    found = sampling_advice(camera(), stated)
    assert found.depths == pytest.approx((1 / (1 / 1.3 + 0.3), 1 / (1 / 1.3 - 0.9)), rel=EXACT)
    assert "beyond infinity" in str(found)


def test_it_is_told_in_words_and_drawn(tmp_path):
    code = vcc.Mask(CosineSum(0.4 * mm, 4), width=30 * mm, z=50 * mm, name="code")
    advice = sampling_advice(camera(code), light_field(), depths=(0.6, 4.0))
    text = str(advice)
    assert max(map(len, text.splitlines())) <= 100
    assert text.index("Watch out") < text.index("views across: 16 (at least") < text.index("Fine")
    figure = advice.plot()
    gaps, lengths = figure.axes
    lines = {line.get_label(): line for line in gaps.get_lines()}
    distance, shown = lines["from one view to the next"].get_data()
    assert shown == pytest.approx(np.abs(1 + SENSOR / distance - SENSOR / F) * SPACING / PITCH, rel=1e-6, abs=1e-6)
    assert lines["blur: all views together"].get_ydata() == pytest.approx(16 * shown)
    shaded = gaps.patches[0].get_x() + np.array([0, gaps.patches[0].get_width()])
    assert shaded == pytest.approx(advice.free_of_ghosts)
    assert len(lengths.get_lines()) - 1 == sum(item.unit == "m" for item in advice.items.values())
    figure.savefig(tmp_path / "advice.png")
    bars = sampling_advice(camera(vcc.LensArray(0.2 * mm, 1 * mm, z=51 * mm)), light_field()).plot()
    assert len(bars.axes) == 1


def test_a_light_field_on_disk_gets_the_same_advice(tmp_path):
    given = vcc.LightField.from_views(np.zeros((4, 5, 20, 22), np.uint8), SPACING, SLOPE, 1.3, (-3, 1))
    stored = save_store(given, tmp_path / "views.zarr")
    assert str(sampling_advice(camera(), stored)) == str(sampling_advice(camera(), given))
    assert sampling_advice(camera(), stored[1:3, :, ::2]).views == (2, 5)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "needs a light field, or the scene's depths"),
        ({"depths": (2.0, 1.0)}, "depths is"),
        ({"depths": (0.0, 1.0)}, "depths is"),
        ({"depths": (float("nan"), 1.0)}, "depths is"),
        ({"depths": (1.0, 2.0), "views": (0, 3)}, "views is"),
        ({"depths": (1.0, 2.0), "wavelength": 0.0}, "wavelength is a length, greater than 0 m"),
        ({"light_field": light_field(), "views": (3, 3)}, "views is for advice without"),
        ({"light_field": "views/"}, "light_field is a vcc.LightField, not a str"),
        ({"depths": (1e-9, 2.0)}, "views: are they in metres"),
    ],
)
def test_refuses(given, message):
    with pytest.raises(vcc.InputError, match=message):
        sampling_advice(camera(), **given)


def test_refuses_what_it_cannot_know():
    sensor = vcc.Sensor(SENSOR, (10, 10), PITCH)
    with pytest.raises(vcc.InputError, match="nothing bounds the light"):
        sampling_advice(vcc.Camera([vcc.Lens(F)], sensor), depths=(1, 2))
    with pytest.raises(vcc.InputError, match='lens array "micro" bends rays'):
        sampling_advice(camera(vcc.LensArray(1 * mm, 1 * mm, z=9 * mm, name="micro")), depths=(1, 2))
    with pytest.raises(vcc.InputError, match="lies at an image"):
        sampling_advice(vcc.Camera([LENS], vcc.Sensor(0.0, (10, 10), PITCH)), depths=(1, 2))
    with pytest.raises(vcc.InputError, match=r"for a vcc\.Camera"):
        sampling_advice("camera.toml", depths=(1, 2))
    with pytest.raises(vcc.InputError, match="distance of a point"):
        sampling_advice(camera(), light_field()).disparity(0.0)
