"""What newcomers write, and what they are told: what is wrong, and what to write instead."""

import re

import numpy as np
import pint
import pytest

import vcc
from vcc import kernels, patterns, surfaces
from vcc.formats import save_light_field
from vcc.recover import refocused
from vcc.store import open_store, save_store
from vcc.units import mm

LENS, SENSOR = vcc.Lens(50 * mm), vcc.Sensor(52 * mm, (8, 8), 1 * mm)
CAMERA = vcc.Camera([LENS], SENSOR)
VIEWS = np.full((3, 3, 8, 8), 0.5, np.float32)
FIELD = vcc.LightField.from_views(VIEWS, 1 * mm, 0.02)
QUANTITY = pint.UnitRegistry().Quantity(50, "millimeter")

LENGTHS = {
    "focal length": (lambda: vcc.Lens("50 mm"), "focal_length of lens", "50 * mm"),
    "diameter": (lambda: vcc.Lens(50 * mm, "20 mm"), "diameter of lens", "20 * mm"),
    "place": (lambda: vcc.Lens(50 * mm, z="1e1 mm", name="L"), 'z of lens "L"', "1e1 * mm"),
    "decentre": (lambda: vcc.Lens(50 * mm, decentre=("1 mm", 0)), "decentre of lens", "1 * mm"),
    "sheet": (lambda: vcc.Mask(np.eye(3), "10 mm"), "width of mask", "10 * mm"),
    "pattern": (lambda: patterns.CosineSum("1.5 mm"), "period of cosine sum", "1.5 * mm"),
    "pitch of lenslets": (lambda: vcc.LensArray("125 µm", 500e-6), "pitch", "125 * um"),
    "their focal length": (lambda: vcc.LensArray(125e-6, "500 um"), "focal_length of lens array", "500 * um"),
    "several": (lambda: vcc.LensArray(125e-6, ("500 um", 4e-4)), "focal_length of lens array", "500 * um"),
    "angle": (lambda: vcc.LensArray(125e-6, 5e-4, rotation="1°"), "rotation", "1 * deg"),
    "slope": (lambda: kernels.Gaussian("1 mrad"), "sigma of a Gaussian", "1 * mrad"),
    "thickness": (lambda: vcc.FirstOrder.thick_lens((0.05, -0.05), "6 mm", 1.5), "thickness", "6 * mm"),
    "radius": (lambda: vcc.FirstOrder.thick_lens(("50 mm", 1.0), 6 * mm, 1.5), "a radius of", "50 * mm"),
    "sensor": (lambda: vcc.Sensor("52 mm", (8, 8), 1 * mm), "the sensor's z", "52 * mm"),
    "pixels": (lambda: vcc.Sensor(52 * mm, (8, 8), ("5 um", 5e-6)), "the sensor's pitch", "5 * um"),
    "wavelength": (lambda: vcc.Electronics(wavelength="550 nm"), "wavelength", "550 * nm"),
    "views": (lambda: vcc.LightField.from_views(VIEWS, "1 mm", 0.02), "spacing", "1 * mm"),
    "focus": (lambda: refocused(FIELD, "1.2 m"), "distance", "1.2 * m"),
    "psf": (lambda: vcc.analysis.psf(CAMERA, "1 m"), "distance", "1 * m"),
    "plane": (lambda: CAMERA.light_field_at(FIELD, "10 mm"), "z must be", "10 * mm"),
    "rays": (lambda: CAMERA.rays_at("10 mm"), "z must be", "10 * mm"),
}


@pytest.mark.parametrize("name", LENGTHS)
def test_text_with_a_unit_is_refused_with_the_expression_to_write(name):
    make, what, expression = LENGTHS[name]
    with pytest.raises(vcc.InputError) as told:
        make()
    assert what in str(told.value)
    assert f"write {expression} (from vcc.units import {expression.split()[-1]})" in str(told.value)


@pytest.mark.parametrize(
    "make",
    [
        lambda: vcc.Lens(QUANTITY),
        lambda: vcc.Lens(50 * mm, z=QUANTITY),
        lambda: vcc.Sensor(52 * mm, (8, 8), QUANTITY),
        lambda: patterns.Circle(QUANTITY),
        lambda: vcc.LensArray(125e-6, QUANTITY),
        lambda: vcc.LightField.from_views(VIEWS, QUANTITY, 0.02),
    ],
)
def test_quantities_of_pint_are_refused_with_how_to_give_them(make):
    with pytest.raises(vcc.InputError, match=r"give its number in SI units: quantity.to_base_units\(\).magnitude"):
        make()


WRONG = {
    "sensor among the elements": (
        lambda: vcc.Camera([LENS, SENSOR]),
        "behind the list, vcc.Camera([lens, …], sensor",
    ),
    "exchanged": (lambda: vcc.Camera(SENSOR, [LENS]), "exchanged: write vcc.Camera([lens, …], sensor)"),
    "no list": (lambda: vcc.Camera(LENS, SENSOR), "write vcc.Camera([lens], sensor)"),
    "no sensor": (lambda: vcc.Camera([LENS]), "a camera needs a vcc.Sensor, and nothing is given"),
    "a class": (lambda: vcc.Camera([LENS], vcc.Sensor), "and the class Sensor itself is given"),
    "a class among elements": (lambda: vcc.Camera([vcc.Lens], SENSOR), "not the class Lens itself"),
    "nothing": (lambda: vcc.Camera(None, SENSOR), "elements are a list of vcc.Element objects"),
    "a camera file": (lambda: vcc.Camera("camera.toml"), "vcc.load_camera('camera.toml')"),
    "square shape": (lambda: vcc.Sensor(52 * mm, 200, 1 * mm), "not 200; for as many each way write (200, 200)"),
    "one pitch": (
        lambda: vcc.Sensor(52 * mm, (8, 8), (1 * mm,)),
        "one number of metres or (vertical, horizontal)",
    ),
    "mura": (lambda: vcc.Mask("mura"), "write vcc.Mask(vcc.patterns.mura(29), width=10 * mm)"),
    "the function": (lambda: vcc.Mask(patterns.mura, 10 * mm), "write vcc.Mask(vcc.patterns.mura(29)"),
    "cosine_sum": (lambda: vcc.Mask("cosine_sum"), "write vcc.patterns.CosineSum(period=…)"),
    "Circle": (lambda: vcc.Mask(patterns.Circle), "that is the class; write vcc.patterns.Circle(diameter=…)"),
    "unknown": (lambda: vcc.Mask("star"), "vcc.patterns has Open, Circle, Polygon, CosineSum, Cells, Bounded"),
    "a picture": (
        lambda: vcc.Mask("code.png", 1 * mm),
        "vcc.Mask(vcc.files.pictures.read_grey('code.png'), width=",
    ),
    "a number": (lambda: vcc.Mask(29), "an array of transmissions, not int"),
    "a bounded name": (lambda: patterns.Bounded("circle", 1.0, 1.0), "write vcc.patterns.Circle(diameter=…)"),
    "text as cells": (lambda: patterns.Cells("mura", 1.0), "rows of equally many numbers, not str"),
    "prime as text": (lambda: patterns.mura("29"), "whole number, 5 or more, not '29'; write 29, without quotes"),
    "gaussian": (lambda: vcc.Diffuser("gaussian"), "write vcc.kernels.Gaussian(sigma=…)"),
    "sigma alone": (lambda: vcc.Diffuser(0.01), "write vcc.kernels.Gaussian(sigma=0.01)"),
    "coded": (lambda: vcc.CodedDiffuser("gaussian", 1.0), "write vcc.kernels.Gaussian(sigma=…)"),
    "surface": (lambda: vcc.PhasePlate("cubic"), "vcc.surfaces.Surface, such as Cubic(250.0)"),
    "class of surface": (lambda: vcc.PhasePlate(surfaces.Cubic), "not Cubic"),
    "capture an array": (lambda: CAMERA.capture(VIEWS), "vcc.LightField.from_views(values, spacing=…, slope_per"),
    "capture a list": (lambda: CAMERA.capture(VIEWS.tolist()), "vcc.LightField.from_views(values, spacing=…"),
    "capture a name": (lambda: CAMERA.capture("views"), "vcc.open_light_field('views')"),
    "capture a store": (lambda: CAMERA.capture("a.zarr"), "vcc.store.open_store('a.zarr')"),
    "capture a view": (lambda: CAMERA.capture(FIELD.view(0, 0)), "light_field is a vcc.LightField, not a Image"),
    "explain": (lambda: CAMERA.explain(VIEWS), "vcc.LightField.from_views"),
    "compile": (lambda: CAMERA.compile(VIEWS), "vcc.LightField.from_views"),
    "expose": (lambda: CAMERA.expose(VIEWS, 1.0), "vcc.LightField.from_views"),
    "inside": (lambda: CAMERA.light_field_at(VIEWS, 0.01), "vcc.LightField.from_views"),
    "refocus": (lambda: refocused(VIEWS, 1.0), "vcc.LightField.from_views"),
    "save a store": (lambda: save_store("views", "x.zarr"), "vcc.open_light_field('views')"),
    "save": (lambda: save_light_field(VIEWS, "x.npz"), "vcc.LightField.from_views"),
    "light field of lists": (lambda: vcc.LightField.from_views([[1]], 1.0, 1.0), "numpy.asarray(values, dtype="),
    "light field of a name": (
        lambda: vcc.LightField.from_views("views", 1.0, 1.0),
        "vcc.open_light_field('views')",
    ),
    "no frame": (
        lambda: vcc.LightField(VIEWS, None),
        "LightField.from_views(values, spacing, slope_per_pixel, focus_distance)",
    ),
    "spacing in words": (lambda: vcc.open_light_field(".", spacing="2"), "no light field was found"),
    "open an array": (
        lambda: vcc.open_light_field(VIEWS),
        "the name of a file or folder is text or a pathlib.Path",
    ),
    "open a number": (lambda: open_store(3), "the name of a file or folder is text or a pathlib.Path"),
    "load a camera": (lambda: vcc.load_camera(CAMERA), "the name of a file or folder is text or a pathlib.Path"),
    "load a lens": (lambda: vcc.load_lens(50 * mm), "the name of a file or folder is text or a pathlib.Path"),
    "one radius": (lambda: vcc.FirstOrder.thick_lens(50 * mm, 6 * mm, 1.5), "are (R1, R2) in metres, not 0.05"),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_meant_is_said(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    make, told = WRONG[name]
    with pytest.raises(vcc.InputError, match=re.escape(told)):
        make()
    assert not list(tmp_path.iterdir())


def test_numbers_of_any_library_are_numbers():
    lens = vcc.Lens(np.float32(0.05), np.float64(0.02), z=np.int64(0))
    assert lens.focal_length == pytest.approx(0.05)
    assert vcc.Sensor(52 * mm, (np.int64(8), 8), [1 * mm, 2 * mm]).pitches == (1 * mm, 2 * mm)
