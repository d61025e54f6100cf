"""Cameras of all elements, to learn their parameters."""

from __future__ import annotations

import numpy as np

import vcc
from vcc import kernels, patterns, surfaces
from vcc.optics.prescription import Prescription, Surface
from vcc.units import deg, mm, nm, um


def mask(pattern, **options):
    return vcc.Mask(pattern, name="code", **options)


def plate(surface, **options):
    return vcc.PhasePlate(surface, name="plate", **options)


HEIGHTS = np.random.default_rng(0).normal(size=(4, 5)) * um
WEIGHTS = np.stack([np.linspace(0, 1, 9), np.linspace(1, 0, 9)]).reshape(2, 3, 3)
CELLS = np.random.default_rng(1).uniform(0.2, 0.8, (3, 4))

ELEMENTS: dict[str, vcc.Element] = {
    "lens": vcc.Lens(50 * mm, diameter=8 * mm, name="main"),
    "prism": vcc.Prism((0.001, -0.002), name="wedge"),
    "biprism": vcc.Biprism(0.003, rotation=10 * deg, diameter=9 * mm, name="pair"),
    "pyramid": vcc.Pyramid(4, 0.003, rotation=10 * deg, diameter=9 * mm, name="pyramid"),
    "mask of cells": mask(CELLS, width=8 * mm),
    "mask of cells with a height": mask(CELLS, width=8 * mm, height=7 * mm),
    "mask of placed cells": mask(patterns.Cells(CELLS, 8 * mm, middle=(1 * mm, 0.0))),
    "mask of cosines": mask(patterns.CosineSum(1 * mm, 2)),
    "mask of cosines on a sheet": mask(patterns.CosineSum((1 * mm, 2 * mm), 2, phase=0.3), width=8 * mm),
    "circle": mask(patterns.Circle(6 * mm)),
    "polygon": mask(patterns.Polygon(6, 6 * mm, 0.1)),
    "bounded": mask(patterns.Bounded(patterns.Circle(6 * mm), 5 * mm, 7 * mm)),
    "gaussian diffuser": vcc.Diffuser(kernels.Gaussian(0.002), name="frosted"),
    "gaussian diffuser of two widths": vcc.Diffuser(kernels.Gaussian((0.002, 0.001)), name="frosted"),
    "top hat": vcc.Diffuser(kernels.TopHat(0.002), diameter=8 * mm, name="frosted"),
    "radial diffuser": vcc.Diffuser(kernels.Radial((0.0, 0.01), (1.0, 0.0), normalise=True), name="frosted"),
    "measured diffuser": vcc.Diffuser(np.full((3, 3), 1 / 9), slope_pitch=0.001, width=8 * mm, name="frosted"),
    "stretched diffuser": vcc.CodedDiffuser(
        kernels.Gaussian(1.0), 8 * mm, widths=np.full((3, 3), 0.002), name="frosted"
    ),
    "mixed diffuser": vcc.CodedDiffuser(
        (kernels.Gaussian(0.002), kernels.TopHat(0.004)), 8 * mm, weights=WEIGHTS, name="frosted"
    ),
    "quadratic plate": plate(surfaces.Quadratic(1.0), diameter=8 * mm),
    "tilted plate": plate(surfaces.Tilt((0.001, 0.002)), width=8 * mm, height=7 * mm),
    "cubic plate": plate(surfaces.Cubic(50.0), width=8 * mm),
    "axicon": plate(surfaces.Axicon(0.002), diameter=8 * mm),
    "zernike plate": plate(surfaces.Zernike((0.0, 0.0, 0.0, 200 * nm, 0.0, 0.0, 500 * nm), 8 * mm)),
    "height map": plate(surfaces.HeightMap(HEIGHTS, 8 * mm)),
    "path map": plate(surfaces.PathMap(HEIGHTS, 8 * mm, 7 * mm)),
    "rough plate": plate(surfaces.Rough(1 * um, 1 * mm, 8 * mm)),
    "lens array": vcc.LensArray(
        0.5 * mm, 2 * mm, rotation=0.01, offset=(0.1 * mm, 0.0), fill_factor=0.7, width=6 * mm, name="array"
    ),
    "lens array of two": vcc.LensArray(0.5 * mm, (2 * mm, 3 * mm), "hexagonal", circular=True, name="array"),
    "real lens": vcc.RealLens.of(
        Prescription(
            (
                Surface(30 * mm, 1.2 * mm, 1.6, 9 * mm, conic=-0.5, aspheres=(1e-5 / mm**3,)),
                Surface(-90 * mm, 0.5 * mm, 1.0),
                Surface(np.inf, 0.5 * mm, 1.0, 2.4 * mm, True),
                Surface(-80 * mm, 1 * mm, 1.5),
                Surface(-90 * mm, 0.0, 1.0, 8 * mm),
            )
        ),
        softness=0.8 * mm,
        transmission=0.9,
        fresnel=True,
        name="objective",
    ),
    "prism array": vcc.PrismArray(np.full((2, 3, 2), 0.001), 2 * mm, focal_length=50 * mm, name="array"),
    "first order": vcc.FirstOrder(
        ((0.9, 0.01), (-19.0, 0.9)), 5 * mm, np.eye(2), 8 * mm, entrance_diameter=9 * mm, name="relay"
    ),
}
"""An element of each kind, by what it is."""

SENSOR = vcc.Sensor(60 * mm, (6, 8), (0.4 * mm, 0.5 * mm), fill_factor=0.8, electronics=vcc.Electronics())


def camera_with(element: vcc.Element, z: float = 10 * mm) -> vcc.Camera:
    """A lens at the entrance plane, the element behind it, and a sensor."""
    from dataclasses import replace

    lens = [] if element.name == "main" else [vcc.Lens(60 * mm, name="main")]
    return vcc.Camera([*lens, replace(element, z=z)], SENSOR)
