"""What things show in notebooks. Oracles: an XML parser, the codes that `Image.to_srgb` gives, traced rays."""

from __future__ import annotations

import base64
import re
import warnings
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import imagecodecs
import numpy as np
import pytest
import torch
from matplotlib.figure import Figure

import vcc
from vcc import analysis, gallery, kernels, patterns, recover, surfaces
from vcc.files.transfer import encode, from_linear
from vcc.notebook.pictures import GAP, LARGEST_SIDE, MOST_BYTES
from vcc.plot import plot_element
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves
from vcc.store import open_store, save_store
from vcc.store.reading import StoredLightField
from vcc.units import mm, um

RANDOM = np.random.default_rng(0)


def light_field(rows: int = 3, columns: int = 4, *channels: int) -> vcc.LightField:
    values = RANDOM.random((rows, columns, 12, 16, *channels), dtype=np.float32)
    return vcc.LightField.from_views(values, 2 * mm, 1e-3, 1.3, disparity_range=(0.0, 0.0))


FIELD = light_field(3, 4, 3)
SENSOR = vcc.Sensor(z=52 * mm, shape=(12, 16), pitch=50 * um, electronics=vcc.Electronics(color_filter="RGGB"))
LENS = vcc.Lens(focal_length=50 * mm, diameter=6 * mm, name="main")
MASK = vcc.Mask(patterns.CosineSum(period=1.5 * mm), width=30 * mm, z=40 * mm)
CAMERA = vcc.Camera([LENS, MASK], SENSOR)
FRAME = SENSOR.frame


def drawing() -> Figure:
    figure = Figure(figsize=(2, 1))
    figure.subplots().plot([0, 1])
    return figure


def things() -> dict[str, Any]:
    """One of each kind of what a cell may end with."""
    point = analysis.psf(vcc.Camera([LENS], SENSOR), distance=2.0, pitch=8 * um)
    stack = recover.focal_stack(FIELD, [0.8, 1.3])
    image = CAMERA.capture(FIELD)
    return {
        "light field": FIELD,
        "camera": CAMERA,
        "lenslets": vcc.Camera.plenoptic(
            50 * mm, lenslet_pitch=0.2 * mm, f_number=6.3, pixels_per_lenslet=5, lenslets=(20, 20)
        ),
        "image": image,
        "grey image": vcc.Image(image.values[..., 0], FRAME),
        "many channels": vcc.Image(np.ones((4, 5, 31)), FRAME),
        "not finite": vcc.Image(np.array([[1.0, np.nan], [np.inf, 0.5]]), FRAME),
        "black": vcc.Image(np.zeros((4, 5)), FRAME),
        "recording": CAMERA.expose(FIELD),
        "plan": CAMERA.compile(FIELD),
        "explanation": CAMERA.explain(FIELD),
        "how": vcc.How(),
        "sensor": SENSOR,
        "electronics": SENSOR.electronics,
        "lens": LENS,
        "mask": MASK,
        "cells": vcc.Mask(patterns.mura(11), width=5 * mm),
        "diffuser": vcc.Diffuser(kernels.Gaussian(0.01), diameter=10 * mm),
        "plate": vcc.PhasePlate(surfaces.Cubic(30.0), diameter=8 * mm),
        "prism": vcc.Prism(deflection=(0.01, 0.0)),
        "biprism": vcc.Biprism(0.01),
        "pyramid": vcc.Pyramid(deflection=0.01, sides=4),
        "system": vcc.FirstOrder(((1.0, 0.01), (-20.0, 0.8)), length=10 * mm),
        "pattern": patterns.Circle(3 * mm),
        "unbounded": patterns.Open(),
        "kernel": kernels.TopHat(0.01),
        "surface": surfaces.Quadratic(0.1),
        "stack": stack,
        "sharp": stack.all_in_focus(),
        "point": point,
        "transfer": analysis.mtf(point),
        "spectrum": analysis.fft4(FIELD),
        "advice": analysis.sampling_advice(CAMERA, FIELD),
        "depth": recover.DepthMap(np.ones((4, 5)), np.full((4, 5), np.inf), np.zeros((4, 5)), (1, 1)),
        "result": gallery.Result(
            "<p>how it was made</p>",
            (
                (
                    gallery.Picture("a", "left", "", RANDOM.random((8, 9, 3))),
                    gallery.Picture("b", "right", "", drawing()),
                ),
            ),
            (gallery.Finding("contrast", "above 1 dB", 2.5, "dB", True),),
        ),
        "best aperture": analysis.OptimisedAperture(np.eye(5), 0.1, (0.2, 0.1), (0.3, 0.2), True, "done"),
    }


with warnings.catch_warnings():
    warnings.simplefilter("ignore", vcc.ResultWarning)
    THINGS = things()


def parsed(thing: Any) -> ElementTree.Element:
    """What a thing shows as HTML; whoever leaves a tag open or a sign unescaped ends here."""
    return ElementTree.fromstring(thing._repr_html_())


def words(thing: Any) -> str:
    return "".join(parsed(thing).itertext())


def picture(thing: Any) -> np.ndarray:
    return imagecodecs.png_decode(thing._repr_png_())


@pytest.mark.parametrize("name", THINGS)
def test_each_thing_shows_itself_in_little_room(name):
    thing = THINGS[name]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bundle = thing._repr_mimebundle_()
    assert bundle["text/plain"] == repr(thing)
    shown = ElementTree.fromstring(bundle["text/html"])
    assert {each.tag for each in shown.iter()} <= {
        *("div", "b", "figure", "figcaption", "img", "table", "tr", "th", "td", "pre")
    }
    pictures = [each.get("src", "").partition("base64,")[2] for each in shown.iter("img")]
    if "image/png" in bundle:
        assert bundle["image/png"] == pictures[0]
    else:
        assert not pictures
    assert sum(len(base64.b64decode(each)) for each in pictures) < MOST_BYTES
    # no wall of numbers: rows of a matrix would stand here
    assert not re.search(r"(-?\d+\.\d+[,\s]+){8}", "".join(shown.itertext()))


OTHERS = {
    "stages": CAMERA.stages,
    "faces": LENS.faces(),
    "grid": FIELD.grid,
    "ray map": CAMERA.rays_at(52 * mm),
    "operator": CAMERA.operator(FIELD),
    "adjoint": CAMERA.operator(FIELD).T,
    "disparities": FIELD.disparity,
    "scene": PlanesScene([TexturedPlane(Waves(0.1), 1.0), TexturedPlane(Waves(0.1), 2.0)]),
    "refocuser": analysis.Refocuser(FIELD),
    "entry": gallery.entry("plenoptic"),
    "elements": CAMERA.elements,
}


@pytest.mark.parametrize("name", OTHERS)
def test_what_shows_its_words_alone_needs_few(name):
    text = repr(OTHERS[name])
    assert len(text) < 600, text
    assert text.count("\n") < 6
    assert " object at 0x" not in text


def test_a_result_of_the_gallery_lists_what_it_found():
    rows = [[cell.text or "" for cell in row] for row in parsed(THINGS["result"]).iter("tr")]
    assert rows[1] == ["contrast", "above 1 dB", "2.5 dB", "reached", ""]
    assert "left" in words(THINGS["result"])


def test_what_was_saved_is_said_in_a_line(tmp_path):
    saved = THINGS["image"].save(tmp_path / "picture.png")
    assert saved.description.replace(" um", " µm") in words(saved)


def test_only_what_is_asked_for_is_given():
    image = THINGS["image"]
    bundle = image._repr_mimebundle_()
    assert set(bundle) == {"text/plain", "text/html", "image/png"}
    assert bundle["text/html"] == image._repr_html_()
    assert base64.b64decode(bundle["image/png"]) == image._repr_png_()
    assert set(image._repr_mimebundle_(include=["text/html"])) == {"text/html"}
    assert set(image._repr_mimebundle_(exclude=["image/png"])) == {"text/plain", "text/html"}


@pytest.mark.parametrize("name", ["image", "grey image"])
def test_a_picture_is_what_a_png_would_hold(name):
    image = THINGS[name]
    np.testing.assert_array_equal(picture(image), image.to_srgb())
    assert "turned upright, exposure" in words(image)


def test_light_is_averaged_not_codes():
    board = (np.indices((2, 2 * LARGEST_SIDE)).sum(axis=0) % 2).astype(np.float32)
    shown = picture(vcc.Image(board, FRAME))
    assert shown.shape == (1, LARGEST_SIDE)
    # all pixels are half as bright as the brightest, and exposed to white by themselves: the curve is not in it
    exposure = float(re.search(r"exposure ([\d.]+)", words(vcc.Image(board, FRAME)))[1])
    assert exposure == 1
    np.testing.assert_array_equal(shown, round(float(from_linear(0.5)) * 255))


def test_pure_noise_stays_small_and_says_that_it_was_averaged():
    noise = vcc.Image(RANDOM.random((600, 600, 3), dtype=np.float32), FRAME)
    assert len(noise._repr_png_()) <= MOST_BYTES
    assert "2×2 pixels as one" in words(noise)
    assert "width:600px" in noise._repr_html_()


@pytest.mark.parametrize("shape", [(1, 5000), (5000, 3), (1, 1), (700, 5, 3)])
def test_pictures_of_any_shape_fit(shape):
    thing = vcc.Image(RANDOM.random(shape, dtype=np.float32), FRAME)
    assert 1 <= max(picture(thing).shape[:2]) <= LARGEST_SIDE
    width = int(re.search(r"img[^>]*width:(\d+)px", thing._repr_html_())[1])
    assert width * picture(thing).shape[0] / picture(thing).shape[1] <= 2 * LARGEST_SIDE


def test_what_is_not_finite_is_said():
    assert "50.00% of the values are not finite, and shown black" in words(THINGS["not finite"])
    assert "the mean of 31 channels" in words(THINGS["many channels"])


def test_what_has_no_numbers_yet_has_no_picture():
    for thing in (
        vcc.Image(torch.empty((4, 6), device="meta"), FRAME),
        FIELD.replaced(torch.empty(FIELD.shape, device="meta")),
    ):
        assert thing._repr_png_() is None
        assert "img" not in thing._repr_html_()


def test_views_stand_in_their_places_at_one_exposure():
    sheet = picture(FIELD)
    exposure = float(re.search(r"exposure ([\d.]+)", words(FIELD))[1])
    for row, column in np.ndindex(3, 4):
        down, right = row * (12 + GAP), column * (16 + GAP)
        piece = sheet[down : down + 12, right : right + 16]
        view = encode(FIELD.view(row, column).to_numpy() * np.float32(exposure), 8).astype(int)
        assert np.abs(piece[..., :3] - view).max() <= 1  # the exposure is told to 4 digits
        assert (piece[..., 3] == 255).all()
    assert (sheet[12 : 12 + GAP, :, 3] == 0).all()
    assert "all 3×4 views" in words(FIELD)


@pytest.mark.parametrize(
    ("rows", "columns", "said"),
    [
        (9, 9, "5×5 of 9×9 views: rows 0, 2, 4, 6, 8 and columns 0, 2, 4, 6, 8, counted from 0"),
        (1, 12, "1×8 of 1×12 views: row 0 and columns 0, 2, 3, 5, 6, 8, 9, 11, counted from 0"),
        (1, 1, "its one view"),
    ],
)
def test_of_many_views_some_are_shown(rows, columns, said):
    assert said in words(light_field(rows, columns))


def test_of_a_store_only_what_is_shown_is_read(tmp_path, monkeypatch):
    save_store(light_field(9, 7, 3), tmp_path / "views.zarr")
    stored = open_store(tmp_path / "views.zarr")
    seen = []
    read = StoredLightField.stored_view
    monkeypatch.setattr(
        StoredLightField, "stored_view", lambda self, *place: seen.append(place[:2]) or read(self, *place)
    )
    picture(stored)
    assert sorted(seen) == [(row, column) for row in (0, 2, 4, 6, 8) for column in (0, 2, 3, 4, 6)]
    monkeypatch.setattr("vcc.notebook.contacts.MOST_READ", 4 * 12 * 16 * 3 * 9)
    seen.clear()
    picture(stored)
    assert len(seen) == 9


def test_views_that_are_missing_are_holes(tmp_path):
    save_store(light_field(3, 3), tmp_path / "views.zarr")
    stored = open_store(tmp_path / "views.zarr")
    stored.view_file(0, 1).unlink()
    sheet = picture(stored)
    assert (sheet[:12, 16 + GAP : 32 + GAP, 3] == 0).all()
    assert "1 view is missing" in words(stored)
    for place in np.ndindex(3, 3):
        stored.view_file(*place).unlink(missing_ok=True)
    assert "9 views are missing" in words(stored)


def test_a_camera_lists_place_kind_name_and_parameters(monkeypatch):
    monkeypatch.setattr("vcc.notebook.exhibits.plot_camera", lambda train: plot_element(LENS))  # faster
    rows = [[cell.text or "" for cell in row] for row in parsed(CAMERA).iter("tr")]
    assert rows[1] == ["0 mm", "lens", "main", "focal length 50 mm, diameter 6 mm"]
    assert rows[2][:3] == ["40 mm", "mask", ""]
    assert rows[3] == ["52 mm", "sensor", "", "12×16 pixels of 50 µm, 12 bits, RGGB"]


def test_an_element_lists_all_of_its_parameters_with_units():
    rows = {row[0].text: row[1].text for row in parsed(LENS).iter("tr")}
    assert rows == {"parameter": "value", "z": "0 m", "focal length": "50 mm", "diameter": "6 mm"}
    moved = vcc.Lens(0.05, decentre=(1 * mm, 0.0))
    assert {row[0].text: row[1].text for row in parsed(moved).iter("tr")}["decentre"] == "(1 mm, 0 m)"


def test_names_are_no_markup():
    html = vcc.Camera([vcc.Lens(0.05, name='<script>alert("1")</script>&')], SENSOR, name="<b>")._repr_html_()
    assert "<script" not in html
    shown = "".join(ElementTree.fromstring(html).itertext())
    assert '<script>alert("1")</script>&' in shown
    assert shown.startswith("<b>")


@dataclass(frozen=True)
class Broken(vcc.Element):
    def faces(self) -> vcc.Faces:
        return None  # type: ignore[return-value]


@pytest.mark.parametrize("thing", [Broken(), vcc.Camera([Broken()], SENSOR)])
def test_what_cannot_be_drawn_says_why(thing):
    assert "faces() of broken at z = 0 mm must return vcc.Faces" in words(thing)


def test_drawings_belong_to_their_cell_alone():
    from matplotlib import pyplot

    before = pyplot.get_fignums()
    LENS._repr_html_()
    assert pyplot.get_fignums() == before


def test_explanations_have_headings_and_all_of_their_words():
    explanation = THINGS["explanation"]
    bold = [each.text for each in parsed(explanation).iter("b")]
    assert "How the picture is made" in bold
    assert str(explanation).replace(" um", " µm") in words(explanation)


def test_a_long_text_is_cut_and_says_so(monkeypatch):
    monkeypatch.setattr("vcc.notebook.html.LONGEST", 100)
    left = len(THINGS["explanation"]) - 100
    assert f"and {left} letters more" in words(THINGS["explanation"])


# --- elements from the side ---


def ends(axes: Any) -> np.ndarray:
    """The last pieces of the rays drawn, each two points (z, height) in millimetres."""
    lines = [
        line.get_xydata() for line in axes.lines if line.get_color() == "#0072B2" and len(line.get_xdata()) == 2
    ]
    last = max(float(line[1, 0]) for line in lines)
    return np.array([line for line in lines if line[1, 0] == last])


def test_parallel_light_meets_where_a_lens_focuses_it():
    for line in ends(plot_element(LENS)):
        (z, x), (end, there) = line
        at_focus = x + (there - x) * (50 - z) / (end - z)  # millimetres
        assert at_focus == pytest.approx(0, abs=1e-9)


@pytest.mark.parametrize("across", "xy")
def test_a_prism_turns_light_along_its_axis(across):
    prism = vcc.Prism(deflection=(0.02, -0.03), z=0.1, decentre=(1.0, 2.0))
    for (z, x), (end, there) in ends(plot_element(prism, across=across)):
        assert (there - x) / (end - z) == pytest.approx({"x": 0.02, "y": -0.03}[across])


def test_cells_are_shown_one_by_one():
    array = vcc.LensArray(pitch=0.2 * mm, focal_length=2 * mm, width=30 * mm)
    lines = ends(plot_element(array))
    focus = [x + (there - x) * (2 - z) / (end - z) for (z, x), (end, there) in lines]
    assert len(lines) == 25
    np.testing.assert_allclose(np.unique(np.round(focus, 9)), np.arange(-2, 3) * 0.2, atol=1e-9)
