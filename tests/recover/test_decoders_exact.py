"""Decoders at their limits: how many views, what is too washed out, what light is divided by."""

from __future__ import annotations

import math

import numpy as np
import pytest

import vcc
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.recover import Decoder
from vcc.shapes.patterns import CosineSum, Open

D, GAP, APART = 60 * mm, 2 * mm, 0.3 * mm
"""From the lens to the lenslets, from these to the sensor, and between micro-images."""
WHOLE = APART * D / GAP
"""Wide enough an opening for micro-images that touch: its pictures are GAP/D times as wide."""


def lenslets(pixels, width, height=None, *, pitches=(1.0, 1.0), focal_length=GAP, fill_factor=None, before=()):
    """Micro-images ``pixels`` times the pitches apart, (down, across); an opening as a share of the whole."""
    array = vcc.LensArray(APART / (1 + GAP / D), focal_length, z=D, fill_factor=fill_factor, name="array")
    height = width if height is None else height
    stop = [] if width is None else [vcc.Mask(Open(), width=width * WHOLE, height=height * WHOLE)]
    sensor = vcc.Sensor(D + GAP, (60, 60), tuple(APART / pixels * each for each in pitches))
    return vcc.Camera([vcc.Lens(50 * mm), *stop, *before, array], sensor)


@pytest.mark.parametrize(
    ("pixels", "lit", "views"),
    [
        # A pixel counts of which half is lit: those up to lit/2 from the middle.
        (9, 4.0, 5),
        (9, 3.99, 3),
        (9, 6.01, 7),
        (9, 5.99, 5),
        (9, 2.0, 3),
        # The neighbour's picture may reach a quarter of a pixel in: 9 − lit/2 − ¼ from the middle.
        (9, 9.0, 9),
        (9, 9.49, 9),
        (9, 9.51, 7),
        (9, 11.49, 7),
        (9, 11.51, 5),
        # And no pixel reaches beyond half the way to the next lenslet.
        (7, 6.9, 7),
        (6.99, 6.9, 5),
        (3, 3.0, 3),
    ],
)
def test_views_are_counted_by_what_is_lit_of_outermost_pixels(pixels, lit, views):
    assert Decoder.of(lenslets(pixels, lit / pixels)).views == (views, views)


@pytest.mark.parametrize(
    ("pixels", "lit", "words"),
    [
        (2.99, 2.9, "3 views need 3 pixels"),
        (9, 1.99, r"and 2 pixels wide, and 3 views need 2 or more"),
        (9, 15.6, r"neighbours overlap.*stop the lens down to 58% of its width"),
    ],
)
def test_too_few_views_are_refused_with_what_would_help(pixels, lit, words):
    with pytest.raises(InputError, match=words):
        Decoder.of(lenslets(pixels, lit / pixels))


def test_rows_and_columns_are_counted_by_themselves():
    # 9 pixels down and 4.5 across, of which 7 and 4.1 are lit: up to 3 and to 1.75 from the middle.
    assert Decoder.of(lenslets(9, 4.1 / 4.5, 7 / 9, pitches=(1.0, 2.0))).views == (7, 3)
    assert Decoder.of(lenslets(9, 7 / 9, 4.1 / 4.5, pitches=(2.0, 1.0))).views == (3, 7)


def test_the_narrowest_of_openings_and_views_bounds_the_light():
    """An opening a way behind the lens is seen from the lenslets as it is, and larger than one at the lens."""
    later = vcc.Mask(Open(), width=5 / 9 * WHOLE * 2 / 3, height=5 / 9 * WHOLE * 2 / 3, z=D / 3)
    assert Decoder.of(lenslets(9, 1.0, before=[later])).views == (5, 5)
    assert Decoder.of(lenslets(9, 3.5 / 9, before=[later])).views == (3, 3)
    at_lenslets = vcc.Mask(Open(), width=1 * mm, height=1 * mm, z=D)
    assert Decoder.of(lenslets(9, 5 / 9, before=[at_lenslets])).views == (5, 5)
    # Views 7 pixels' worth across and 5 down, by their cells together; where the frame turns them, the other way.
    field = vcc.LightField.from_views(
        np.ones((5, 7, 4, 4), np.float32), (5 / 9 * WHOLE / 5, 7 / 9 * WHOLE / 7), 0.1, 1.0
    )
    assert Decoder.of(lenslets(9, None), field.grid).views == (5, 7)
    assert Decoder.of(lenslets(9, 3.5 / 9), field.grid).views == (3, 3)
    quarter = np.zeros((4, 4))
    quarter[[0, 1, 2, 3], [1, 0, 3, 2]] = [1, -1, 1, -1]
    turned = vcc.LightField(field.values, Affine.from_parts(quarter, np.zeros(4)) @ field.frame)
    assert Decoder.of(lenslets(9, None), turned.grid).views == (7, 5)
    # With nothing that bounds it, light of all neighbours would fall everywhere: all pixels are taken as free.
    assert Decoder.of(lenslets(9, None)).views == (9, 9)


@pytest.mark.parametrize(
    ("focal_length", "fill_factor", "fits"),
    [
        # A point of the lens lights |1 + b/d − b/f| of an opening: by 1 + b/d, as micro-images are apart.
        (GAP / (0.51 * (1 + GAP / D)), None, True),
        (GAP / (0.49 * (1 + GAP / D)), None, False),
        (GAP / (1.49 * (1 + GAP / D)), None, True),
        (GAP / (1.51 * (1 + GAP / D)), None, False),
        # An opening half as wide may be twice as far off.
        (GAP / (0.01 * (1 + GAP / D)), 0.25, True),
        (GAP / (1.99 * (1 + GAP / D)), 0.25, True),
        (GAP / (2.01 * (1 + GAP / D)), 0.25, False),
        # Of interleaved ones the mean power counts.
        ((GAP, GAP / (0.2 * (1 + GAP / D))), None, True),
        ((GAP / (0.5 * (1 + GAP / D)), GAP / (0.4 * (1 + GAP / D))), None, False),
    ],
)
def test_a_point_may_light_half_of_a_micro_image(focal_length, fill_factor, fits):
    camera = lenslets(9, 5 / 9, focal_length=focal_length, fill_factor=fill_factor)
    if fits:
        assert Decoder.of(camera).views == (5, 5)
    else:
        with pytest.raises(InputError, match="washed out over half a micro-image"):
            Decoder.of(camera)


def test_only_affine_optics_stand_before_lenslets():
    bent = vcc.PhasePlate(vcc.surfaces.Cubic(1.0), z=1 * mm, name="plate")
    with pytest.raises(InputError, match="bends or scatters light in another way"):
        Decoder.of(lenslets(9, 5 / 9, before=[bent]))


@pytest.mark.parametrize("factor", [0.8, 1.0, 1.01])
@pytest.mark.parametrize("axis", [0, 1])
def test_views_wider_than_a_mask_tells_apart_are_refused(factor, axis):
    """Where nothing bounds the light at the entrance: a period P at g before the sensor tells P·d/g apart."""
    periods = np.array([0.06, 0.09]) * mm
    mask = vcc.Mask(CosineSum(tuple(map(float, periods)), harmonics=1), z=51.7 * mm)
    d = 52 * mm
    across = periods * d / (d - 51.7 * mm)
    pitches = tuple(float(p * d / 51.7 / mm / 3) for p in periods[::-1])
    camera = vcc.Camera([vcc.Lens(50 * mm), mask], vcc.Sensor(d, (60, 60), pitches))
    sizes = across * [factor if n == axis else 0.5 for n in (0, 1)]
    field = vcc.LightField.from_views(np.ones((4, 5, 8, 8), np.float32), (sizes[1] / 4, sizes[0] / 5), 0.01, 1.3)
    if factor <= 1:
        assert Decoder.of(camera, field.grid).views == (3, 3)
    else:
        with pytest.raises(InputError, match="nothing bounds the light at the entrance"):
            Decoder.of(camera, field.grid)
    stop = vcc.Mask(Open(), width=float(across[0]), height=float(across[1]))
    assert Decoder.of(vcc.Camera([stop, *camera.elements], camera.sensor), field.grid).views == (3, 3)


@pytest.mark.parametrize("cut", [np.s_[:, :, :, :], np.s_[:, :, 5:, :-7]])
def test_white_light_comes_from_where_the_light_field_does_and_around(cut):
    """Of even radiance 1: a pixel sees its lenslet under p²/b², whichever part of the scene is given."""
    camera = lenslets(5, 1.0)
    whole = vcc.LightField.from_views(
        np.full((9, 9, 40, 41), 0.3, np.float32), 1.2 * WHOLE / 9, 1.5 * 60 / 5 * APART / D / 40, 1.0
    )
    field = whole[cut]
    white = np.asarray(Decoder.of(camera).calibration(field).values, float)
    # By hand: all of the same views, from three times as wide a scene around the whole one.
    wide = vcc.LightField.from_views(
        np.ones((9, 9, 40, 41), np.float32), 1.2 * WHOLE / 9, 3 * 1.5 * 60 / 5 * APART / D / 40, 1.0
    )
    even = np.asarray(camera.capture(wide).values, float)
    assert white.shape == even.shape
    assert abs(white.mean() / even.mean() - 1) < 0.01
    assert np.sqrt(np.mean((white - even) ** 2)) < 0.03 * even.mean()
    assert math.isfinite(white.max())
