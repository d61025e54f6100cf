"""A light-field display is a camera's transpose: a panel in the place of the sensor emits light through the
optics.

A pixel of a camera records the mean irradiance over its sensitive area A_p,

    I_p = (1/A_p) Σ_q G_pq L_q,

where G_pq is the étendue (area times slopes, m²) that the pixel shares with the cell of sample q through the
optics; both étendue and radiance are conserved. A panel whose pixels have the radiances P_p fills the part G_pq
of the étendue V_q of each cell with radiance P_p, so that it emits the mean radiance

    L_q = (1/V_q) Σ_p G_pq P_p = (A_p/V_q) (Aᵀ P)_q.

So Aᵀ P is in units of radiance times slope squared. Times a pixel's area it is the flux that leaves through a
cell (in units of radiance times m²); this flux divided by the cell's étendue is the mean radiance there.

Oracle: a panel at the focal length f of a lens array in the plane of the light field. Light that leaves a cell
with centre c anywhere has come from x = c + f·s of the panel, the line through the centre, along each axis.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.plan.model import Plan
from vcc.run.backwards import back

LENSLETS, PITCH, FOCAL_LENGTH = 5, 1 * mm, 5 * mm
PIXELS, PIXEL = 60, 0.1 * mm
SLOPES, STEP = 8, 0.02
"""Slopes of the light field: its beams stay within 0.4 mm of a lenslet's centre on the panel."""
CENTRES = (np.arange(LENSLETS) - (LENSLETS - 1) / 2) * PITCH
DIRECTIONS = -(np.arange(SLOPES) - (SLOPES - 1) / 2) * STEP  # views are pictures: pixels run against slopes
PLACES = (np.arange(PIXELS) - (PIXELS - 1) / 2) * PIXEL
RAYS = 1024
CELL = PITCH**2 * STEP**2
"""Étendue of a sample."""

CAMERA = vcc.Camera(
    [vcc.LensArray(pitch=PITCH, focal_length=FOCAL_LENGTH, z=0.0)],
    vcc.Sensor(z=FOCAL_LENGTH, shape=(PIXELS, PIXELS), pitch=PIXEL),
)


@cache
def planned() -> tuple[Plan, vcc.LightField]:
    """One view per lenslet: a cell of the light field has light from one lenslet only."""
    shape = (LENSLETS, LENSLETS, SLOPES, SLOPES)
    field = vcc.LightField.from_views(np.zeros(shape, np.float32), PITCH, STEP, np.inf, disparity_range=(0, 0))
    return CAMERA.compile(field, method="rays", samples=RAYS, between_views="none"), field


def radiance(panel: np.ndarray) -> np.ndarray:
    """The emitted light, (v, u, t, s)."""
    sent = back(*planned(), panel).samples
    return np.asarray(sent, dtype=np.float64) * PIXEL**2 / CELL


def test_each_sample_is_what_its_line_through_the_lenslets_centre_meets():
    x, y = np.meshgrid(PLACES, PLACES)
    panel = 1 + 0.5 * np.cos(2 * np.pi * x / (3.1 * mm) + 1) * np.cos(2 * np.pi * y / (4.3 * mm))
    # Brute force: lines through a lenslet's centre, spread over the slopes of each cell.
    within = (np.arange(20) + 0.5) / 20 - 0.5
    place = CENTRES[:, None, None] + FOCAL_LENGTH * (DIRECTIONS[:, None] + within * STEP)  # (views, slopes, 20)
    met = np.floor(place / PIXEL + PIXELS / 2).astype(int)
    lines = panel[met[:, None, :, None, :, None], met[None, :, None, :, None, :]]  # (v, u, t, s, 20, 20)
    expected = lines.mean(axis=(-2, -1))
    # Looked up by tents instead of cells: 1 − sinc²(0.1/3.1) = 0.3 % of the cosine. The rest is chance: two
    # thousand rays, evenly spread, fall into each sample.
    # Two samples from the border of a view are left out: there the filter by which views are sharpened goes on.
    inner = (..., slice(2, -2), slice(2, -2))
    found = radiance(panel)
    np.testing.assert_allclose(found[inner], expected[inner], rtol=0, atol=0.5 * 0.003 + 0.002)
    np.testing.assert_allclose(radiance(np.ones((PIXELS, PIXELS)))[inner], 1, rtol=1e-3)


def test_a_pixel_sends_a_beam_through_each_lenslet_along_the_line_through_its_centre():
    panel = np.zeros((PIXELS, PIXELS))
    row, column = 27, 31
    panel[row, column] = 1.0
    sent = radiance(panel)
    lit = 0
    for view, centre in enumerate(CENTRES):
        slope = (PLACES[column] - centre) / FOCAL_LENGTH
        across = sent.sum(axis=(0, 2))[view]
        if abs(slope) < 3 * STEP:
            lit += 1
            assert (across * DIRECTIONS).sum() / across.sum() == pytest.approx(slope, abs=0.05 * STEP)
        elif abs(slope) > 6 * STEP:
            assert np.abs(across).max() < 1e-6 * sent.max()
    assert lit == 1


def test_what_a_pixel_sends_out_is_its_radiance_times_etendue():
    # Through one lenslet, whose solid angle seen from the pixel is that of the cell: (pitch/f)².
    panel = np.zeros((PIXELS, PIXELS))
    panel[29, 30] = 3.0
    flux = radiance(panel).sum() * CELL
    assert flux == pytest.approx(3.0 * PIXEL**2 * (PITCH / FOCAL_LENGTH) ** 2, rel=1e-2)
