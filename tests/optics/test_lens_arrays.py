"""Sheets of lenslets: where they stand, and how large their openings can be."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.errors import InputError
from vcc.base.units import mm, um
from vcc.optics.plenoptic import Plenoptic


@pytest.mark.parametrize(("layout", "covered"), [("square", np.pi / 4), ("hexagonal", np.pi / 12**0.5)])
def test_discs_cover_so_much_of_their_cells_at_most(layout, covered):
    """Of diameter 1 in cells of area 1 and √3/2."""
    options = {"layout": layout, "circular": True}
    vcc.LensArray(1 * mm, 5 * mm, fill_factor=covered, **options)
    with pytest.raises(InputError, match=f"discs cover at most {covered:.4f}"):
        vcc.LensArray(1 * mm, 5 * mm, fill_factor=covered + 1e-4, **options)


@pytest.mark.parametrize("lenslets", [(5, 8), (6, 7)])
def test_the_axis_goes_through_the_middle_of_the_lenslets(lenslets):
    """Of an odd number the middle one stands on the axis; of an even number two stand half a pitch off it."""
    optics = Plenoptic(
        focal_length=50 * mm, f_number=4, lenslet_pitch=100 * um, pixels_per_lenslet=5, lenslets=lenslets,
        focus_distance=1.0,
    )  # fmt: skip
    _, array = optics.elements
    assert array.offset == tuple(0.0 if count % 2 else 50 * um for count in lenslets[::-1])
    assert optics.sensor(None).shape == (5 * lenslets[0], 5 * lenslets[1])


# --- lenslets ---

SOME = {"pitch": 1 * mm, "focal_length": 5 * mm, "rotation": 0.3, "offset": (0.2 * mm, -0.1 * mm)}
X, Y = np.meshgrid(np.arange(-150, 150) * 0.04 * mm + 0.011 * mm, np.arange(-150, 150) * 0.04 * mm + 0.007 * mm)


@pytest.mark.parametrize("layout", ["square", "hexagonal"])
@pytest.mark.parametrize("circular", [False, True])
@pytest.mark.parametrize("fill_factor", [None, 0.3, 1.0])
def test_openings_cover_the_fill_factor(layout, circular, fill_factor):
    """The mean over 90 000 places, 12 cells wide; openings that end at cells' borders are counted to 1 %."""
    if circular and fill_factor == 1.0:
        return
    array = vcc.LensArray(**SOME, layout=layout, circular=circular, fill_factor=fill_factor)
    pattern = array.faces().pattern
    if not circular and fill_factor in (None, 1.0):
        assert pattern is None
        return
    disc = {"square": math.pi / 4, "hexagonal": math.pi / (2 * math.sqrt(3))}[layout]
    assert pattern(X, Y).mean() == pytest.approx(disc if fill_factor is None else fill_factor, abs=0.01)


def test_kinds_of_lenslets_have_their_own_focal_lengths():
    array = vcc.LensArray(1 * mm, [2 * mm, -4 * mm], width=8 * mm, height=6 * mm)
    assert (array.focal_lengths, array.f_numbers) == ((2 * mm, -4 * mm), (2.0, -4.0))
    faces = array.faces()
    for column in range(-3, 4):
        for row in range(-2, 3):  # a checkerboard
            f = (2 * mm, -4 * mm)[(row + column) % 2]
            s, t = faces.bending(column * mm + 0.2 * mm, row * mm - 0.3 * mm)
            np.testing.assert_allclose([s, t], [-0.2 * mm / f, 0.3 * mm / f], rtol=1e-9)
    np.testing.assert_array_equal(faces.pattern(X, Y), (abs(X) < 4 * mm) & (abs(Y) < 3 * mm))
    assert vcc.LensArray(1 * mm, 5 * mm, width=8 * mm).faces().pattern.size == (8 * mm, 8 * mm)
    one = vcc.LensArray(1 * mm, 5 * mm)
    assert (one.focal_lengths, one.f_numbers) == ((5 * mm,), (5.0,))
    pinholes = vcc.LensArray(1 * mm, math.inf, circular=True, fill_factor=0.01).faces()
    assert pinholes.bending is None


def test_micro_images_stand_on_rays_from_the_middle_of_the_main_lens():
    array = vcc.LensArray(**SOME, layout="hexagonal", decentre=(0.5 * mm, 0.4 * mm))
    images = array.micro_images(50 * mm, 4 * mm)
    row, column = np.mgrid[-3:4, -3:4]
    x, y = array.lattice.centre_of(row, column)
    growth = (50 + 4) / 50
    np.testing.assert_allclose(
        images.centre_of(row, column), (growth * (x + 0.5 * mm), growth * (y + 0.4 * mm)), rtol=1e-12, atol=1e-15
    )
    at_lenslets = array.micro_images(1 * mm, 0.0)
    assert (at_lenslets.pitch, at_lenslets.offset) == (1 * mm, pytest.approx((0.7 * mm, 0.3 * mm)))
    for distances in ((0.0, 1 * mm), (-1 * mm, 1 * mm), (1 * mm, -1e-9), (math.nan, 0.0), (1.0, math.nan)):
        with pytest.raises(InputError, match="stands before"):
            array.micro_images(*distances)


@pytest.mark.parametrize(
    "wrong",
    [
        {"pitch": 0.0}, {"focal_length": 0.0}, {"focal_length": ()}, {"focal_length": (1.0, 0.0)},
        {"layout": "round"}, {"fill_factor": 0.0}, {"fill_factor": 1.01}, {"width": 0.0}, {"height": 1.0},
        {"offset": (0.0, math.nan)}, {"rotation": math.inf},
    ],
)  # fmt: skip
def test_lenslets_that_are_none_are_refused(wrong):
    with pytest.raises(InputError, match=next(iter(wrong))):
        vcc.LensArray(**{**SOME, **wrong})
    vcc.LensArray(1 * mm, 1.0, circular=True, fill_factor=math.pi / 4 * (1 + 0.9e-9))  # a limit worked out by hand


# --- prisms ---


@pytest.mark.parametrize("rotation", [0.0, 0.5])
@pytest.mark.parametrize("layout", ["square", "hexagonal"])
@pytest.mark.parametrize("rows", [1, 3, 4])
def test_prisms_stand_around_the_middle_each_with_its_own_slopes(layout, rotation, rows):
    """Centres by hand: rows of 5 counted from the upper left, every second one half a pitch further right."""
    slopes = np.random.default_rng(1).uniform(-0.1, 0.1, (rows, 5, 2))
    array = vcc.PrismArray(slopes, 1 * mm, layout, focal_length=20 * mm, rotation=rotation)
    assert array.shape == (rows, 5)
    row, column = np.mgrid[:rows, :5]
    hexagonal = layout == "hexagonal"
    across = column + 0.5 * (row % 2) * hexagonal
    down = row * (math.sqrt(3) / 2 if hexagonal else 1.0)
    across, down = across - (across.min() + across.max()) / 2, down - (down.min() + down.max()) / 2
    x = (math.cos(rotation) * across - math.sin(rotation) * down) * mm
    y = (math.sin(rotation) * across + math.cos(rotation) * down) * mm
    faces = array.faces()
    s, t = faces.bending(x + 0.1 * mm, y - 0.2 * mm)
    np.testing.assert_allclose(s, slopes[..., 0] - 0.1 / 20, atol=1e-12)
    np.testing.assert_allclose(t, slopes[..., 1] + 0.2 / 20, atol=1e-12)
    assert (faces.pattern(x, y) == 1).all()
    # the cells' area, all but what lies on their borders, is clear, and nothing else
    area = faces.pattern(X, Y).sum() * 0.04**2
    assert area == pytest.approx(rows * 5 * (math.sqrt(3) / 2 if hexagonal else 1.0), rel=0.02)
    plain = vcc.PrismArray(slopes, 1 * mm, layout, rotation=rotation).faces().bending(x + 0.1 * mm, y - 0.2 * mm)
    np.testing.assert_allclose(np.stack(plain, -1), slopes, atol=1e-15)


def test_arrays_of_prisms_say_what_they_are_and_refuse_what_they_cannot_be():
    slopes = np.zeros((2, 3, 2))
    slopes[1, 2] = 0.01, -0.03
    assert vcc.PrismArray(slopes, 1 * mm).described() == "2×3 prisms of up to 0.03, pitch 1 mm"
    for wrong in ({"slopes": slopes[0]}, {"slopes": slopes[..., :1]}, {"pitch": 0.0}, {"focal_length": 0.0}):
        with pytest.raises(InputError, match=next(iter(wrong))):
            vcc.PrismArray(**{"slopes": slopes, "pitch": 1 * mm, **wrong})
    assert vcc.PrismArray(slopes, 1 * mm) == vcc.PrismArray(slopes.copy(), 1 * mm)


# --- plenoptic cameras ---


def test_the_algebra_of_a_plenoptic_camera():
    """Lenslets stand where the main lens is sharp, and see of it discs that just touch: similar triangles."""
    optics = Plenoptic(
        focal_length=50 * mm, f_number=4, lenslet_pitch=100 * um, pixels_per_lenslet=5, lenslets=(6, 7),
        focus_distance=1.0,
    )  # fmt: skip
    d = 1 / (1 / 0.05 - 1 / 1.0)
    main, array = optics.elements
    sensor = optics.sensor(None)
    assert (main.focal_length, main.z, array.z) == (50 * mm, 0.0, pytest.approx(d))
    assert array.focal_lengths == (pytest.approx(0.4 * mm),)
    assert sensor.z - array.z == pytest.approx(0.4 * mm)
    images = array.micro_images(d, 0.4 * mm)
    assert optics.micro_image == pytest.approx(images.pitch) == pytest.approx(5 * sensor.pitch)
    # through the middle of a lenslet the main lens is as wide on the sensor as micro-images stand apart
    assert main.diameter * 0.4 * mm / d == pytest.approx(images.pitch)
    electronics = vcc.Electronics()
    assert optics.sensor(electronics).electronics is electronics
    far = Plenoptic(50 * mm, 100 * um, 4, 1, (1, 1), math.inf)
    assert far.to_lenslets == pytest.approx(50 * mm)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"focal_length": 0.0}, "focal_length"),
        ({"lenslet_pitch": -1.0}, "lenslet_pitch"),
        ({"f_number": 0}, "f_number"),
        ({"pixels_per_lenslet": 0}, "pixels_per_lenslet"),
        ({"lenslets": (0, 5)}, "lenslets"),
        ({"focus_distance": 50 * mm}, "Take one farther away"),
        ({"focal_length": 0.99, "focus_distance": 0.9}, "Take one farther away"),
        ({"focal_length": 50.0}, r"did you mean 50 \* mm"),
        ({"focal_length": 1.0}, r"did you mean 1 \* mm"),
    ],
)
def test_plenoptic_cameras_that_are_none_are_refused(wrong, message):
    given = {
        "focal_length": 50 * mm, "lenslet_pitch": 100 * um, "f_number": 4, "pixels_per_lenslet": 5,
        "lenslets": (5, 5), "focus_distance": 1.0,
    }  # fmt: skip
    Plenoptic(**given)
    Plenoptic(**{**given, "pixels_per_lenslet": 1})
    with pytest.raises(InputError, match=message):
        Plenoptic(**{**given, **wrong})
