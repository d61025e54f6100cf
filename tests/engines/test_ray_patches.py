"""Rays of a plain lens sharpen only the parts of views that they read, as if whole views were sharpened.

Oracle: the reference engine, which sharpens all views with NumPy and reads whole views.
"""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.base.units import mm, um
from vcc.engines import numba_cpu, ray_patches
from vcc.plan.how import How
from vcc.run.drive import Drive, drive

LENS = vcc.Lens(focal_length=50 * mm, diameter=9 * mm)
SQUARE = vcc.Mask(vcc.patterns.Circle(7 * mm), width=6 * mm, height=5 * mm, z=0)


def field(kind: str = "uint8", channels: tuple[int, ...] = (3,), **options) -> vcc.LightField:
    values = np.random.default_rng(0).random((6, 5, 60, 70, *channels))
    values = (values * np.iinfo(kind).max).astype(kind) if kind.startswith("u") else values.astype(kind)
    given = {"spacing": 2 * mm, "slope_per_pixel": 1e-3, "focus_distance": 1.0, "disparity_range": (-0.5, 0.8)}
    return vcc.LightField.from_views(values, **(given | options))


def sensor(z: float = 52 * mm, pitch: float = 50 * um, **options) -> vcc.Sensor:
    return vcc.Sensor(z, (90, 100), pitch, **options)


CASES = {
    "focused": (field(), [LENS], sensor()),
    "defocused by many pixels": (field(), [LENS], sensor(49 * mm)),
    "parallax followed": (field(disparity_range=(2.0, 3.0)), [LENS], sensor()),
    "wider than the views": (field(), [LENS], sensor(pitch=90 * um)),
    "pixels finer than those of views": (field(), [LENS], sensor(pitch=8 * um)),
    "a rectangular stop": (field(), [vcc.Lens(focal_length=50 * mm), SQUARE], sensor()),
    "decentred": (
        field(),
        [vcc.Lens(focal_length=50 * mm, diameter=6 * mm, decentre=(2 * mm, -1 * mm))],
        sensor(),
    ),
    "two lenses": (field(), [LENS, vcc.Lens(focal_length=200 * mm, diameter=12 * mm, z=20 * mm)], sensor()),
    **{f"{n} channels": (field(channels=(n,)), [LENS], sensor()) for n in (1, 2, 4)},
    "grey": (field(channels=()), [LENS], sensor()),
    **{kind: (field(kind), [LENS], sensor()) for kind in ("uint16", "float16", "float32", "float64")},
}


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")
@pytest.mark.parametrize("name", CASES)
def test_parts_are_looked_up_as_whole_views_are(name, monkeypatch):
    lf, elements, at = CASES[name]
    # Caches of a kilobyte per view, so that there are many overlapping tiles.
    monkeypatch.setattr(ray_patches, "CACHE", 2**16)
    monkeypatch.setattr(ray_patches, "MOST", 50)
    plan = vcc.Camera(elements, at).compile(lf, method="rays", samples=16)
    parted = Drive(plan, lf, How())
    assert ray_patches.patches_of(parted.core, 6) is not None
    found = parted.recorded()
    assert "prepared" not in vars(parted)  # no filtered copy of the light field is made
    whole = Drive(plan, lf, How())
    assert isinstance(whole.prepared, np.ndarray)  # reused, as it is sharpened already
    # Up to rounding: at a part's border rays are looked up sample by sample, with another order of sums.
    assert np.abs(found.values - whole.recorded().values).max() <= 2**-22 * found.values.max()
    # Single precision and sums of 16 rays, each rounded to 2⁻²⁴: below 1e-6 of the largest.
    reference = drive(plan, lf, How(engine="reference")).values
    assert np.abs(found.values - reference).max() <= 1e-6 * reference.max()
    assert found.values.max() > 0


def test_what_bends_or_scatters_looks_up_whole_views():
    for element in (
        vcc.PhasePlate(vcc.surfaces.Cubic(5.0), diameter=9 * mm),
        vcc.Diffuser(vcc.kernels.Gaussian(0.01)),
    ):
        lf = field()
        plan = vcc.Camera([LENS, element], sensor()).compile(lf, method="rays", samples=16)
        assert isinstance(numba_cpu.prepared(plan.before, lf.values, 1, plan.core), np.ndarray)
