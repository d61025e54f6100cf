"""Elements without effect change nothing: neither the image nor the method.

Oracle: the same camera without the element, or with the equivalent prism or lens.
"""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.optics import CellDeflection, Faces, FacetDeflection, Lattice
from vcc.shapes.surfaces import Axicon, Cubic, HeightMap, PathMap, Rough, Tilt, Zernike

D = 1 / (1 / 50e-3 - 1)
NOTHING = {
    "biprism": vcc.Biprism(0.0, 0.3, z=20 * mm),
    "pyramid": vcc.Pyramid(5, 0.0, z=20 * mm),
    "cubic plate": vcc.PhasePlate(Cubic(0.0), z=20 * mm),
    "axicon": vcc.PhasePlate(Axicon(0.0), z=20 * mm),
    "Zernike": vcc.PhasePlate(Zernike((3e-6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), 20 * mm), z=20 * mm),
    "path map": vcc.PhasePlate(PathMap(np.full((5, 6), 2e-6), 60 * mm), z=20 * mm),
    "height map": vcc.PhasePlate(HeightMap(np.full((5, 6), 1 * mm), 60 * mm), z=20 * mm),
    "smooth glass": vcc.PhasePlate(Rough(0.0, 1 * mm, 60 * mm), z=20 * mm),
    "lens array": vcc.LensArray(pitch=1 * mm, focal_length=np.inf, z=20 * mm),
    "prism array": vcc.PrismArray(np.zeros((30, 40, 2)), 2 * mm, z=20 * mm),
    "hexagonal prisms": vcc.PrismArray(np.zeros((40, 40, 2)), 2 * mm, "hexagonal", z=20 * mm),
}


def capture(*elements: vcc.Element) -> np.ndarray:
    values = np.random.default_rng(0).random((6, 6, 20, 20)).astype(np.float32)
    lf = vcc.LightField.from_views(values, 1 * mm, 4e-3, 1.0, disparity_range=(-0.2, 0.4))
    camera = vcc.Camera([vcc.Lens(50 * mm, diameter=5 * mm), *elements], vcc.Sensor(D, (9, 10), D * 6e-3))
    assert not camera.compile(lf).by_rays
    return np.asarray(camera.capture(lf).values)


@pytest.mark.parametrize("name", list(NOTHING))
def test_nothing_is_nothing(name):
    assert NOTHING[name].faces().deflection is None
    np.testing.assert_allclose(capture(NOTHING[name]), capture(), rtol=1e-5)


PRISM = (0.004, -0.002)
ALIKE = {
    "prisms": vcc.PrismArray(np.broadcast_to(PRISM, (30, 40, 2)), 2 * mm, z=20 * mm),
    "facets": FacetDeflection([[1, 0], [-1, 0]], [PRISM, PRISM]),
    "cells": CellDeflection(Lattice("hexagonal", 1 * mm), np.zeros((2, 2)), np.broadcast_to(PRISM, (2, 2, 2))),
}


@pytest.mark.parametrize("name", list(ALIKE))
def test_prisms_that_are_all_alike_are_one(name):
    one = ALIKE[name]
    faces = one.faces() if isinstance(one, vcc.Element) else Faces(one)
    assert faces.deflection == vcc.Affine.prism(PRISM)
    if isinstance(one, vcc.Element):
        np.testing.assert_allclose(capture(one), capture(vcc.Prism(PRISM, z=20 * mm)), rtol=1e-5)


def test_what_does_something_stays():
    slopes = np.zeros((3, 4, 2))
    slopes[1, 2, 0] = 1e-9
    for element in (
        vcc.Biprism(1e-9),
        vcc.PrismArray(slopes, 1 * mm),
        vcc.LensArray(pitch=1 * mm, focal_length=(np.inf, 1e6)),
        vcc.PhasePlate(Rough(1e-9, 1 * mm, 9 * mm)),
        vcc.PhasePlate(Cubic(1e-9)),
    ):
        assert element.faces().bending is not None
    assert vcc.PhasePlate(Tilt((1e-9, 0.0))).faces().deflection == vcc.Affine.prism((1e-9, 0.0))
