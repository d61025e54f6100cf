"""Plenoptic decoding against closed forms: where micro-images lie, and views integrated by hand.

An array of pitch p at d behind the main lens, the sensor b behind the array. A pixel at δ from the centre of the
micro-image of the lenslet at x saw the main lens at −δ·d/b through the whole lenslet. With pixels w wide and
lenslets that image the main lens sharply, its value is the mean over that lenslet and over w·d/b of the main lens.
"""

from __future__ import annotations

from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import vcc
from tests.physics.brute_force import psnr
from tests.physics.two_planes import TwoPlanes
from vcc.base.errors import InputError, ResultWarning
from vcc.base.units import m, mm, um
from vcc.recover.plenoptic import LensletGrid, decode_plenoptic, find_lenslets

DATA = Path(__file__).parents[3] / "shared" / "data" / "plenoptic_raw"
real = pytest.mark.skipif(not DATA.is_dir(), reason=f"real recordings are not here: {DATA}")

F, FOCUS = 50 * mm, 1 * m
D = 1 / (1 / F - 1 / FOCUS)


def micro_image_centres(layout, pitch, rotation, offset, growth, sensor):
    """(x, y) of all that are on the sensor, in its pixels, by writing the lattice out."""
    height = np.sqrt(3) / 2 if layout == "hexagonal" else 1.0
    row, column = np.mgrid[-40:41, -40:41]
    across = (column + (0.5 * (row % 2) if layout == "hexagonal" else 0.0)) * pitch
    down = row * height * pitch
    x = (np.cos(rotation) * across - np.sin(rotation) * down + offset[0]) * growth
    y = (np.sin(rotation) * across + np.cos(rotation) * down + offset[1]) * growth
    rows, columns = sensor.shape
    places = np.stack([x / sensor.pitch + (columns - 1) / 2, y / sensor.pitch + (rows - 1) / 2], axis=-1)
    places = places.reshape(-1, 2)
    margin = pitch * growth / sensor.pitch / 2
    inside = (places >= margin).all(axis=1) & (places <= np.array([columns, rows]) - 1 - margin).all(axis=1)
    return places[inside]


# -- the grid


@pytest.mark.parametrize("layout", ["square", "hexagonal"])
@pytest.mark.parametrize("rotation", [0.0, 0.12, -0.03])
@pytest.mark.parametrize("share", [0.6, 0.85])
def test_the_lattice_is_found_in_a_white_image(layout, rotation, share):
    pitch, gap, offset = 0.5 * mm, 2.5 * mm, (0.19 * mm, -0.06 * mm)
    growth = 1 + gap / D
    lens = vcc.Lens(focal_length=F, diameter=share * pitch * growth * D / gap)
    array = vcc.LensArray(pitch=pitch, focal_length=gap, layout=layout, rotation=rotation, offset=offset, z=D)
    sensor = vcc.Sensor(z=D + gap, shape=(120, 130), pitch=37 * um)
    camera = vcc.Camera([lens, array], sensor)
    white = vcc.LightField.from_views(np.ones((4, 4, 8, 8), np.float32), 5 * mm, 40e-3, FOCUS)
    found = find_lenslets(camera.capture(white, samples=64))

    truth = micro_image_centres(layout, pitch, rotation, offset, growth, sensor)
    for grid, tolerance in (
        (LensletGrid.of_camera(camera), 1e-9),
        (LensletGrid.from_lattice(array.micro_images(D, gap), sensor), 1e-9),
        (LensletGrid.from_centres(truth), 1e-9),
        # A border that cuts a pixel at a share g adds g(1 − g)/2 ≤ 1/8 pixel² to the first moment of an image of
        # 8 pixels or more, 0.015 pixel at most; of dozens together, fitted by six numbers, less.
        (found, 0.02),
    ):
        assert grid.layout == layout
        worst = np.abs(grid.centre_of(*np.rint(grid.index_of(truth)).T) - truth).max()
        assert worst < tolerance
    print(f"{len(truth)} micro-images, worst {worst:.4f} pixel, fitted to {found.residual:.4f}")
    assert found.rotation == pytest.approx(rotation, abs=2e-3)
    assert found.pitch == pytest.approx(pitch * growth / sensor.pitch, rel=1e-3)


def discs(layout: str, pitch: float, diameter: float, rotation: float) -> tuple[np.ndarray, np.ndarray]:
    """A white image of soft discs drawn by hand under vignetting, and the places of their centres."""
    sensor = vcc.Sensor(z=1.0, shape=(150, 170), pitch=1.0)
    centres = micro_image_centres(layout, pitch, rotation, (0.3, 0.1), 1.0, sensor)
    y, x = np.mgrid[:150, :170]
    distance = np.min([np.hypot(x - a, y - b) for a, b in centres], axis=0)
    vignetting = 1 - 0.5 * ((x - 85) ** 2 + (y - 75) ** 2) / 110**2
    return np.clip(diameter / 2 - distance + 0.5, 0, 1) * vignetting, centres


@pytest.mark.parametrize(("layout", "rotation"), [("hexagonal", 0.0), ("hexagonal", 0.06), ("square", -0.1)])
def test_discs_that_touch_are_not_taken_for_their_overtones(layout, rotation):
    """Hexagonal discs that touch have hardly any power at the lattice's own frequencies (Airy's first zero)."""
    white, centres = discs(layout, 11.3, 11.3, rotation)
    grid = find_lenslets(white)
    off = grid.centre_of(*np.rint(grid.index_of(centres)).T) - centres
    assert grid.layout == layout
    # Left alone, vignetting of 0.7 % a pixel would move the middle of a disc of radius r by 0.7 % · r²/4, 0.06
    # pixel, and twice that through the windows that follow. What is left are pixels cut by borders, as above.
    assert np.abs(off).max() < 0.02
    assert grid.pitch == pytest.approx(11.3, rel=2e-4)


def test_rounded_centres_are_averaged():
    sensor = vcc.Sensor(z=1.0, shape=(300, 310), pitch=1.0)
    centres = micro_image_centres("hexagonal", 9.93, -0.005, (0.0, 0.0), 1.0, sensor)
    grid = LensletGrid.from_centres(np.rint(centres))
    off = grid.centre_of(*np.rint(grid.index_of(centres)).T) - centres
    # Rounding has a variance of 1/12 each way; a fit of 3 numbers each way to n points leaves at its edges about
    # √(7/n) of the deviation, four times that at most.
    assert np.abs(off).max() < 4 * np.sqrt(7 / len(centres) / 12)
    assert grid.residual == pytest.approx(np.sqrt(2 / 12), rel=0.1)


# -- views


PITCH, PIXELS_EACH, LENSLETS, STOP = 0.25 * mm, 9, 17, 9 * mm
GAP = 1.4 * mm
GROWTH = 1 + GAP / D
PLANES = TwoPlanes(16, 0.75 * mm, 1e-3, 96, 0.4, FOCUS)


@cache
def plenoptic(layout="square", rotation=0.0):
    """A camera of 9×9 pixels a lenslet, and what it records of the planes, raw."""
    array = vcc.LensArray(
        pitch=PITCH, focal_length=1 / (1 / GAP + 1 / D), z=D, layout=layout, rotation=rotation, fill_factor=None
    )
    size = LENSLETS * PIXELS_EACH
    sensor = vcc.Sensor(z=D + GAP, shape=(size, size), pitch=PITCH * GROWTH / PIXELS_EACH)
    camera = vcc.Camera([vcc.Lens(focal_length=F), vcc.Mask(pattern=np.ones((1, 1)), width=STOP), array], sensor)
    return camera, camera.capture(PLANES.light_field, samples=512)


def seen_through(decoded, lenslet=PITCH, window=PITCH * GROWTH / PIXELS_EACH * D / GAP):
    """The scene's mean over each sample's lenslet and its pixel's share of the main lens: Gauss-Legendre.

    A lenslet's middle at x is seen from u at the slope u/1 m + x/d before the main lens.
    """
    nv, nu, nt, ns = decoded.shape
    j, i, row, column = np.ogrid[:nv, :nu, :nt, :ns]
    matrix = decoded.frame.matrix
    u, v, s, t = (matrix[n, 0] * i + matrix[n, 1] * j + matrix[n, 2] * column + matrix[n, 3] * row + matrix[n, 4]
                  for n in range(4))  # fmt: skip
    x, y = s - u / FOCUS, t - v / FOCUS
    nodes, weights = np.polynomial.legendre.leggauss(3)
    rule = list(zip(nodes, weights, strict=True))
    total = 0.0
    for (a, wa), (b, wb), (c, wc), (e, we) in product(rule, repeat=4):
        du, dv = u + a * window / 2, v + b * window / 2
        ds, dt = x + c * lenslet / 2 / D + du / FOCUS, y + e * lenslet / 2 / D + dv / FOCUS
        total = total + wa * wb * wc * we / 16 * PLANES.scene.radiance(du, dv, ds, dt)
    return total


def test_decoded_views_are_the_true_ones():
    camera, image = plenoptic()
    decoded = decode_plenoptic(image, camera=camera, views=7)
    assert decoded.shape == (7, 7, LENSLETS, LENSLETS)
    # Irradiance to radiance: a pixel sees its lenslet under p²/b².
    values = decoded.values / (PITCH / GAP) ** 2
    truth = seen_through(decoded)
    error = np.sqrt(np.mean((values - truth) ** 2))
    parallax = psnr(truth[3, 0], truth[3, 6])
    print(f"{psnr(values, truth):.1f} dB; views at the ends differ by {parallax:.1f} dB; noise of rays "
          f"{image.sampling_error / image.values.mean():.1e}")  # fmt: skip
    assert parallax < 25
    # The light field that was photographed holds the scene to 60 dB (tests/physics/test_plenoptic.py); rays err by
    # what the recording states, relative to its mean.
    assert error < 1e-3 * truth.max() + 2 * image.sampling_error / image.values.mean() * truth.mean()


def test_the_frame_is_that_of_the_camera():
    """Views PIXEL·d/b apart, pixels p/d apart, converging on what is in focus."""
    camera, image = plenoptic()
    decoded = decode_plenoptic(image, camera=camera, views=(5, 7))
    spacing = camera.sensor.pitch * D / GAP
    expected = vcc.LightField.from_views(np.ones((5, 7, LENSLETS, LENSLETS)), spacing, PITCH / D, FOCUS)
    assert decoded.frame.isclose(expected.frame)


def test_turned_recordings_give_the_same_light_field():
    camera, image = plenoptic()
    one = decode_plenoptic(image, camera=camera, views=5)
    other = decode_plenoptic(image.values[::-1, ::-1], camera=camera, views=5, inverted=False)
    np.testing.assert_allclose(other.values, one.values, atol=1e-7)
    assert other.frame.isclose(one.frame)


@pytest.mark.parametrize(("layout", "rotation"), [("square", 0.07), ("hexagonal", 0.05)])
def test_lattices_that_must_be_resampled(layout, rotation):
    camera, image = plenoptic(layout, rotation)
    white = vcc.LightField.from_views(np.ones((4, 4, 8, 8), np.float32), 5 * mm, 40e-3, FOCUS)
    flat = camera.capture(white, samples=256)
    decoded = decode_plenoptic(image, LensletGrid.of_camera(camera), camera=camera, white=flat, views=3)
    truth = seen_through(decoded)
    reached = psnr(decoded.values, truth)
    print(f"{reached:.1f} dB")
    # Linear interpolation over at most a pitch p of a cosine of period P is short by (1 − cos(πp/P)) at most, half
    # of it as root mean square of place and phase; likewise over a pixel of the main lens. The shortest period is
    # 26 samples of 1e-3·d = 5.5 p: 0.16 of an amplitude of 0.1, both ways 0.014 of a peak of 0.9, 36 dB.
    assert reached > 36


def test_white_images_undo_vignetting_and_dark_frames_the_offset():
    camera, image = plenoptic()
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    shade = 1 - 0.6 * ((x - 70) ** 2 + (y - 80) ** 2) / 110**2
    dark = 0.02 + 0.001 * (x % 3)
    plain = decode_plenoptic(image, camera=camera, views=7)
    decoded = decode_plenoptic(
        image.values * shade + dark,
        LensletGrid.of_camera(camera),
        camera=camera,
        white=2 * shade + dark,
        dark=dark,
        views=7,
    )
    np.testing.assert_allclose(decoded.values, plain.values / 2, atol=1e-6)


def test_mosaics_are_demosaiced_after_devignetting():
    """A grey scene stays grey: filters of different strength are in the white image too."""
    camera, image = plenoptic()
    strength = np.tile([[0.5, 1.0], [1.0, 0.7]], (77, 77))[: image.shape[0], : image.shape[1]]
    decoded = decode_plenoptic(
        image.values * strength, LensletGrid.of_camera(camera), white=strength, color_filter="RGGB", views=5
    )
    assert decoded.channels == 3
    red, green, blue = np.moveaxis(decoded.values, -1, 0)
    assert np.abs(red - green).max() < 0.15 * green.max()  # what bilinear demosaicing blurs
    assert red.mean() == pytest.approx(green.mean(), rel=0.01)
    assert blue.mean() == pytest.approx(green.mean(), rel=0.01)


# -- bad input


def test_dark_white_images_are_refused():
    camera, image = plenoptic()
    with pytest.raises(InputError, match="white image is dark"):
        decode_plenoptic(image, camera=camera, white=np.zeros(image.shape))
    with pytest.raises(InputError, match="white image is dark"):
        find_lenslets(np.full((100, 100), 200, np.uint16))
    with pytest.raises(InputError, match="no lattice"):
        find_lenslets(np.random.default_rng(0).random((150, 150)) + 10)
    with pytest.raises(InputError, match="no lattice"):
        find_lenslets(np.ones((150, 150)))


def test_dark_corners_are_said():
    white, _ = discs("square", 12.0, 8.0, 0.0)
    with pytest.warns(ResultWarning, match="white image is dark"):
        decoded = decode_plenoptic(white, find_lenslets(white), white=white, views=11)
    assert decoded.values[0, 0].max() == 0
    assert decoded.values[5, 5].min() == pytest.approx(1.0, abs=1e-3)


def broken(raw: np.ndarray) -> np.ndarray:
    holed = raw.copy()
    holed[0, 0] = np.nan
    return holed


OTHER_PITCH = LensletGrid("square", (0, 0), ((10, 0), (0, 10)))


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda raw, camera: decode_plenoptic(raw[:-1], camera=camera), "sensor 153×153"),
        (
            lambda raw, camera: decode_plenoptic(raw, camera=camera, white=np.ones((150, 153))),
            "the white image is 150×153",
        ),
        (lambda raw, camera: decode_plenoptic(raw), "are unknown"),
        (lambda raw, camera: decode_plenoptic(raw, OTHER_PITCH, camera=camera), "not of this camera"),
        (lambda raw, camera: decode_plenoptic(raw, camera=camera, views=11), "do not fit into micro-images"),
        (lambda raw, camera: decode_plenoptic(raw, camera=camera, views=0), "one whole number or"),
        (lambda raw, camera: decode_plenoptic(broken(raw), camera=camera), r"not finite.*\(0, 0\)"),
        (
            lambda raw, camera: LensletGrid.of_camera(vcc.Camera([vcc.Lens(focal_length=F)], camera.sensor)),
            r"last element is a vcc\.LensArray",
        ),
        (lambda raw, camera: decode_plenoptic(raw, camera=camera, memory_limit=1000), "decoded light field"),
        (
            lambda raw, camera: LensletGrid("oblique", (0, 0), ((1, 0), (0, 1))),
            "layout is 'square' or 'hexagonal'",
        ),
        (lambda raw, camera: LensletGrid("square", (0, np.nan), ((1, 0), (0, 1))), "finite pixels"),
        (lambda raw, camera: LensletGrid("square", (0, 0), ((1, 0), (2, 0))), "along one line"),
        (lambda raw, camera: LensletGrid.from_centres(np.random.default_rng(0).random((400, 2)) * 300), "lattice"),
        (lambda raw, camera: LensletGrid.from_centres(np.zeros((20, 2))), "on top of one another"),
    ],
)
def test_what_does_not_fit_is_refused(call, words):
    camera, image = plenoptic()
    with pytest.raises(InputError, match=words):
        call(image.values, camera)


# -- real recordings


def shift_of(one: np.ndarray, other: np.ndarray) -> float:
    """How many columns ``other`` is to the right of ``one``: the peak of their correlation, by a parabola."""
    shifts = np.arange(-8, 9)
    cut = slice(8, -8)
    a = one[:, cut] - one[:, cut].mean()
    scores = []
    for shift in shifts:
        b = np.roll(other, -shift, axis=1)[:, cut]
        b = b - b.mean()
        scores.append((a * b).sum() / np.sqrt((a * a).sum() * (b * b).sum()))
    best = int(np.clip(np.argmax(scores), 1, len(scores) - 2))
    low, middle, high = scores[best - 1 : best + 2]
    return float(shifts[best] + 0.5 * (low - high) / (low - 2 * middle + high))


@real
def test_a_lytro_recording_shows_true_parallax():
    """Across and down a thing shifts alike, and half as far over half the way: what only parallax does."""
    import imagecodecs
    import scipy.io

    corner, size = 1000, 1400  # a part of it: less time
    raw = imagecodecs.imread(DATA / "lytro_f01" / "IMG_3.jpg")[corner : corner + size, corner : corner + size]
    listed = scipy.io.loadmat(DATA / "lytro_f01" / "image_cords.mat")["image_cords"].reshape(-1, 2).astype(float)
    grid = LensletGrid.from_centres(listed[:, ::-1] - 1 - corner)
    assert grid.layout == "hexagonal"
    assert grid.pitch == pytest.approx(10, rel=0.02)
    # Rounded to whole pixels they are √(2/12) = 0.41 off by that alone.
    assert grid.residual < 0.5
    decoded = decode_plenoptic(raw, grid, color_filter="BGGR", views=7)
    green = decoded.values[..., 1]
    blocks = [np.s_[r : r + 44, c : c + 44] for r in range(4, 100, 32) for c in range(4, 100, 32)]
    across = np.array([shift_of(green[3, 0][block], green[3, 6][block]) for block in blocks])
    half = np.array([shift_of(green[3, 0][block], green[3, 3][block]) for block in blocks])
    down = np.array([shift_of(green[0, 3][block].T, green[6, 3][block].T) for block in blocks])
    print("across", across.round(1), "down", down.round(1), "half", half.round(1))
    assert np.abs(across).max() > 1.5
    assert np.median(np.abs(across - down)) < 0.5
    assert np.median(np.abs(across - 2 * half)) < 0.5


@real
def test_a_microscope_shows_true_parallax():
    """Optics as its text files state them; the views are places in the objective's pupil."""
    import imagecodecs

    raw, white, dark = (
        imagecodecs.imread(DATA / "microscope_guv" / f"{name}_GUVExperim1.tif")
        for name in ("Lightfield", "Radiometry", "DarkFrame")
    )
    tube, lenslet = 200 * mm, 2.5 * mm
    camera = vcc.Camera(
        [vcc.Lens(focal_length=tube, z=tube), vcc.LensArray(pitch=100 * um, focal_length=lenslet, z=2 * tube)],
        vcc.Sensor(z=2 * tube + lenslet, shape=(436, 436), pitch=6.5 * um),
    )
    grid = find_lenslets(white, dark=dark)
    # As stated, 100/6.5 = 15.385 pixels apart, within the 0.2 % of the relay lens between array and sensor.
    assert grid.layout == "square"
    assert grid.pitch == pytest.approx(100 / 6.5, rel=2e-3)
    assert grid.residual < 0.05
    decoded = decode_plenoptic(raw, camera=camera, white=white, dark=dark, views=11)
    # In the pupil, a pixel behind the lenslets is f_tube/f_lenslet pixels; what is in focus is collimated.
    assert decoded.frame.matrix[0, 0] == pytest.approx(6.5 * um * tube / lenslet)
    assert decoded.frame.matrix[2, 0] == pytest.approx(0, abs=1e-9)
    # The vesicle's far side shifts against its rim: the views differ, alike both ways, as a thing of depth has it.
    across = shift_of(decoded.values[5, 1], decoded.values[5, 9])
    down = shift_of(decoded.values[1, 5].T, decoded.values[9, 5].T)
    half = shift_of(decoded.values[5, 1], decoded.values[5, 5])
    print(f"across {across:.2f}, half way {half:.2f}, down {down:.2f}")
    assert across == pytest.approx(down, abs=0.3)
    assert across < -0.2  # nearer than what is in focus: to the left in the view from the right


def test_pitches_of_pixels_that_are_not_square():
    """Hexagonal micro-images 9 columns apart, turned, on pixels 1.3 times as high as wide."""
    turned = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    steps = np.diag([1, 1 / 1.3]) @ turned @ np.array([[1, 0.5], [0, np.sqrt(3) / 2]]) * 9
    grid = LensletGrid("hexagonal", (0.0, 0.0), tuple(map(tuple, steps.T)))
    np.testing.assert_allclose(grid.pitches, (9, 9 / 1.3), rtol=1e-12)


def test_a_grey_white_image_serves_recordings_in_colour():
    camera, image = plenoptic()
    y, x = np.mgrid[: image.shape[0], : image.shape[1]]
    shade = 1 - 0.6 * ((x - 70) ** 2 + (y - 80) ** 2) / 110**2
    colours = np.array([1.0, 0.5, 0.25])
    plain = decode_plenoptic(image, camera=camera, views=5)
    raw = (image.values * shade)[..., None] * colours
    decoded = decode_plenoptic(raw, LensletGrid.of_camera(camera), camera=camera, white=shade, views=5)
    np.testing.assert_allclose(decoded.values, plain.values[..., None] * colours, atol=1e-6)
