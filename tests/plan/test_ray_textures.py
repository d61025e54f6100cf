"""Functions of position as textures: as coarse as an image allows, and no coarser.

Oracles: the same mask as uniform cells, which has sharp edges for rays; and path maps of functions with a known
gradient.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.plan.rays import steps
from vcc.plan.rays.model import Rays
from vcc.shapes.patterns import Cells
from vcc.shapes.surfaces import PathMap

D = 1 / (1 / 50e-3 - 1)
LENS = vcc.Lens(focal_length=50 * mm, diameter=8 * mm)
BOARD = np.indices((40, 40)).sum(axis=0) % 2


def board(x, y):
    """The checkerboard of `BOARD`, squares of 0.5 mm."""
    row, column = (np.floor(place / (0.5 * mm)).astype(int) + 20 for place in (y, x))
    inside = (row >= 0) & (row < 40) & (column >= 0) & (column < 40)
    return np.where(inside, BOARD[np.clip(row, 0, 39), np.clip(column, 0, 39)], 0.0)


def field(views: int = 5) -> vcc.LightField:
    random = np.random.default_rng(0)
    values = random.random((views, views, 40, 40)).astype(np.float32)
    return vcc.LightField.from_views(values, 8 * mm / views, 6e-3, 1.0, disparity_range=(-0.2, 0.4))


def camera(mask: vcc.Mask) -> vcc.Camera:
    return vcc.Camera([LENS, mask], vcc.Sensor(D, (60, 60), D * 3e-3))


def texture_of(plan) -> steps.Texture:
    assert isinstance(plan.core, Rays)
    (weigh,) = (step for step in plan.core.steps if isinstance(step, steps.TextureShares))
    return weigh.texture


@pytest.mark.parametrize("z", [0.0, 10 * mm, D / 2, 48 * mm])
def test_a_sharp_mask_given_as_a_function_is_as_good_as_its_cells(z):
    lf, sensor = field(), vcc.Sensor(D, (16, 16), D * 6e-3)
    masks = vcc.Mask(Cells(BOARD, 20 * mm), z=z), vcc.Mask(board, width=20 * mm, z=z)
    cells, function = (vcc.Camera([LENS, mask], sensor).capture(lf, method="rays", samples=8192) for mask in masks)
    peak = cells.values.max()
    assert cells.values.std() > 0.03 * peak
    error = np.sqrt(np.mean((function.values - cells.values) ** 2)) / peak
    light = function.values.mean() / cells.values.mean() - 1
    print(f"{error:.1e} of the peak, light {light:+.1e}")
    # 0.6 % of an edge at most, over an eighth of its ramp: 0.2 % root mean square; and both pictures are sampled.
    noise = np.hypot(cells.sampling_error, function.sampling_error) / peak
    assert error < np.hypot(0.6e-2 / np.sqrt(8), noise)
    # Means are kept: no light is lost but by chance, of which the mean of 16² pixels has a sixteenth.
    assert abs(light) < 3 * noise / 16 * peak / cells.values.mean()


def test_textures_are_as_coarse_as_pixels_allow():
    """At the stop a pixel's rays fill it; towards the sensor they spread over less and less of the mask."""
    stripes = vcc.Mask(lambda x, y: np.floor(x / (0.1 * mm)) % 2 + 0 * y)
    at = {z: camera(replace(stripes, z=z)).compile(field(), method="rays") for z in (0.0, 48 * mm, 51 * mm)}
    points = {z: texture_of(plan).values.shape[0] for z, plan in at.items()}
    print(points)
    assert points[0.0] == 257
    assert points[0.0] < points[48 * mm] < points[51 * mm]
    # What the points do not show is said, and how many of them a pixel averages.
    (note,) = (note for note in at[0.0].notes if "texture" in note)
    assert "a pixel averages 256 points across" in note


def test_compiling_a_mask_s_function_asks_for_few_places():
    """What takes time is the function: 2049² places and more where textures were as fine as they can be."""
    asked = 0

    def counted(x, y):
        nonlocal asked
        asked += np.broadcast(x, y).size
        return board(x, y)

    camera(vcc.Mask(counted, z=D / 2)).compile(field(), method="rays")
    print(asked)
    assert 0 < asked < 2049**2 / 3  # of the three sizes that were tried before, 5.5 million


def test_splines_on_lattices_are_those_at_places():
    surface = PathMap(np.random.default_rng(2).standard_normal((9, 12)) * 1e-6, 4 * mm)
    x, y = np.linspace(-2.5 * mm, 2.5 * mm, 31)[None, :], np.linspace(-2 * mm, 2 * mm, 23)[:, None]
    on_lattice = [surface.path(x, y), *surface.slopes(x, y)]
    x, y = np.broadcast_arrays(x, y)
    for one, other in zip(on_lattice, [surface.path(x, y), *surface.slopes(x, y)], strict=True):
        assert one.shape == (23, 31)
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-18)
        assert not one[:, 0].any()  # beyond the sheet


def test_a_bend_may_err_by_a_thousandth_of_a_sample():
    """Path maps of a paraboloid, which is a lens, and of waves on it: rays must move by 1e-3 samples at most."""
    place = ((np.arange(300) + 0.5) / 300 - 0.5) * 10 * mm
    paths = -(place**2 + place[:, None] ** 2) / 2 / 0.3
    bumps = 2e-8 * np.sin(place / (0.2 * mm)) * np.sin(place[:, None] / (0.2 * mm))
    sensor = vcc.Sensor(D, (10, 10), D * 3e-3)
    lf = field()
    for surface, lens in ((PathMap(paths, 10 * mm), True), (PathMap(paths + bumps, 10 * mm), False)):
        plan = vcc.Camera([LENS, vcc.PhasePlate(surface)], sensor).compile(lf, samples=512)
        assert isinstance(plan.core, Rays)
        (bend,) = (step for step in plan.core.steps if isinstance(step, steps.TextureUnbend))
        x, y = np.random.default_rng(3).uniform(-3 * mm, 3 * mm, (2, 4000))
        if lens:
            truth = np.stack([-x / 0.3, -y / 0.3], axis=-1)
        else:
            wave = 1 / (0.2 * mm)
            truth = np.stack(
                [
                    -x / 0.3 + 2e-8 * wave * np.cos(x * wave) * np.sin(y * wave),
                    -y / 0.3 + 2e-8 * wave * np.sin(x * wave) * np.cos(y * wave),
                ],
                axis=-1,
            )
        off = np.sqrt(np.mean((bend.texture(x, y) - truth) ** 2, axis=0))
        # At the light field's plane a slope moves k by 1/slope_per_pixel samples.
        assert (off / 6e-3 < 1e-3).all()


def test_cells_that_are_no_squares_are_those_of_footprints():
    cells = Cells(np.random.default_rng(4).random((3, 5)), 3 * mm, 5 * mm)
    optics = vcc.Camera(
        [LENS, vcc.Mask(cells, z=D / 2, decentre=(0.4 * mm, -0.3 * mm))], vcc.Sensor(D, (16, 16), D * 9e-3)
    )
    lf = field(9)
    rays, footprints = optics.capture(lf, method="rays", samples=2048), optics.capture(lf, method="footprints")
    assert footprints.values.std() > 0.1 * footprints.values.max()
    error = np.sqrt(np.mean((rays.values - footprints.values) ** 2))
    # 45 dB is what a mask of cells reaches that nine views a side are coarse for, beside what rays state.
    assert error < np.hypot(footprints.values.max() * 10 ** (-45 / 20), 2 * rays.sampling_error)
