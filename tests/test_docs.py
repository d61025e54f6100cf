"""Pages lead somewhere and leave nothing out; the example of an own element does what its page says.

The reference names all that is public, and the gallery's pages are those of its cameras as they are now.
"""

import contextlib
import functools
import importlib
import inspect
import pkgutil
import re
import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import vcc
from vcc.camera_file import ELEMENT_KINDS
from vcc.gallery.page import plain
from vcc.sources import PlanesScene, TexturedPlane

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]


def name_of(page):
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if "://" in target:
            continue
        file, _, heading = target.partition("#")
        there = page.parent / file if file else page
        assert there.exists(), f"{name_of(page)} links to {target}"
        if heading:
            titles = re.findall(r"^#+ (.*)$", there.read_text(encoding="utf-8"), re.M)
            slugs = [re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles]
            assert heading in slugs, f"{name_of(page)} links to {target}"


def test_every_element_has_a_page_with_a_picture():
    index = (ROOT / "docs" / "elements.md").read_text(encoding="utf-8")
    for page in (ROOT / "docs" / "elements").glob("*.md"):
        assert f"elements/{page.name}" in index
        text = page.read_text(encoding="utf-8")
        assert "](../images/elements/" in text
        assert "\n## Limits\n" in text
    pages = " ".join(p.read_text(encoding="utf-8") for p in (ROOT / "docs" / "elements").glob("*.md"))
    for kind, element in ELEMENT_KINDS.items():
        assert f'kind = "{kind}"' in pages
        assert re.search(rf"vcc\.{element.__name__}\b", pages)


def test_own_element_makes_rings_of_its_closed_form():
    """Slopes a/r, so that light of a point lands at radii ρ = a·z/r, r between the plate's two radii."""
    example = runpy.run_path(str(ROOT / "examples" / "own_element.py"))
    plate = example["SpiralPlate"](
        charge=20, wavelength=550e-9, inner_diameter=4e-3, outer_diameter=10e-3, name="spiral"
    )
    camera = example["camera_with"](plate)
    # The example's scene, but no more of it than its middle point needs.
    scene = PlanesScene([TexturedPlane(example["points_of_light"], 10.0)]).light_field(
        (13, 13), (200, 200), spacing=1e-3, slope_per_pixel=20e-6, focus_distance=10.0
    )
    camera = vcc.Camera(camera.elements, replace(camera.sensor, shape=(100, 100)))
    image = camera.capture(scene, samples=256).to_numpy()[..., 1]
    pitch = camera.sensor.pitches[0]
    rows, columns = image.shape
    y, x = np.mgrid[:rows, :columns]
    radius = np.hypot(x - (columns - 1) / 2, y - (rows - 1) / 2) * pitch
    a = 20 * 550e-9 / (2 * np.pi) * camera.sensor.z
    inner, outer = a / 5e-3, a / 2e-3
    # The point itself is a Gaussian of σ = 0.25 mm at 10 m, 2.5 µm on the sensor, and the views are cells of
    # 1 mm in the plate's plane: 4 σ and two pixels on either side hold all of a ring.
    margin = 4 * 2.5e-6 + 2 * pitch
    near = radius < 95e-6  # where other rings hardly reach
    ring = (radius > inner - margin) & (radius < outer + margin)
    assert image[near & ring].sum() > 0.999 * image[near].sum()
    assert abs(image[radius < inner - margin]).max() < 6e-5 * image.max()  # of a Gaussian beyond 4 σ


WITHOUT = ("vcc.cli", "vcc.engines", "vcc.plan", "vcc.__main__", "vcc.run.torch_physics", "vcc.zoo.torch_denoiser")
"""What has no public names; the last needs deepinv, which does not load beside every build of PyTorch."""


def public_names():
    """Each name in the ``__all__`` of a public package, with what it stands for."""
    for info in pkgutil.walk_packages(vcc.__path__, "vcc."):
        if not info.name.startswith(WITHOUT):
            module = importlib.import_module(info.name)
            for name in getattr(module, "__all__", ()):
                yield f"{info.name}.{name}", getattr(module, name)
    for name in vcc.__all__:
        yield f"vcc.{name}", getattr(vcc, name)


def located(name):
    """What the site shows under a name: a module goes before what its package calls the same."""
    parts = name.split(".")
    for cut in range(len(parts), 0, -1):
        with contextlib.suppress(ModuleNotFoundError):
            module = importlib.import_module(".".join(parts[:cut]))
            return functools.reduce(lambda held, part: getattr(held, part, None), parts[cut:], module)
    return None


@pytest.fixture(scope="module")
def documented():
    """What the reference names."""
    pages = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "reference").glob("*.md"))
    shown = re.findall(r"^::: (\S+)$", pages, re.M)
    assert len(shown) == len(set(shown))
    return {name: located(name) for name in shown}


def test_the_reference_has_every_public_name(documented):
    assert [name for name, found in documented.items() if found is None] == []
    things = {id(found) for found in documented.values()}
    # A module is there with all that it holds, or name by name.
    things |= {
        id(held) for found in documented.values() if inspect.ismodule(found) for held in vars(found).values()
    }
    missing = {
        name
        for name, thing in public_names()
        if id(thing) not in things
        and name not in documented
        and not (inspect.ismodule(thing) and any(each.startswith(f"{thing.__name__}.") for each in documented))
    }
    assert missing == set(), "name them in docs/reference"


def test_the_reference_shows_no_module_in_place_of_the_function_of_its_name(documented):
    for name, found in documented.items():
        parent, _, last = name.rpartition(".")
        if inspect.ismodule(found) and parent:
            held = getattr(importlib.import_module(parent), last)
            assert held is found, f"{name} is a module on the site: say {name}.{last}"


def test_no_docstring_has_a_table_that_markdown_does_not_know(documented):
    for name, found in documented.items():
        inside = vars(found).values() if inspect.ismodule(found) or inspect.isclass(found) else ()
        for thing in (found, *inside):
            assert not re.search(r"^\s*=+ +=+", inspect.getdoc(thing) or "", re.M), name


@pytest.mark.parametrize("module", ["patterns", "kernels", "surfaces"])
def test_the_reference_has_every_pattern_kernel_and_surface(module):
    page = (ROOT / "docs" / "reference" / "patterns.md").read_text(encoding="utf-8")
    members = re.search(rf"^::: vcc\.{module}\n.*?members: \[(.*?)\]", page, re.M | re.S)[1].split(", ")
    home = getattr(vcc, module)
    public = {name for name in home.__all__ if inspect.isclass(getattr(home, name))}
    assert len(public) >= 5
    assert public <= set(members)
    assert all(hasattr(home, name) for name in members)


@pytest.mark.parametrize("name", vcc.gallery.ENTRIES)
def test_every_camera_of_the_gallery_has_a_page_of_its_own_run(name):
    pages = runpy.run_path(str(ROOT / "tools" / "docs" / "gallery_pages.py"))
    again = f"run: python tools/docs/gallery_pages.py {name}"
    page = ROOT / "docs" / "gallery" / f"{name}.md"
    assert page.exists(), again
    text = page.read_text(encoding="utf-8")
    made = vcc.gallery.entry(name)
    for words in (made.title, made.citation, made.claim):
        assert plain(words) in text, again
    assert f"source {pages['fingerprint'](name)}," in text, f"the camera's code has changed since; {again}"
    assert f"]({name}.md)" in (page.parent / "index.md").read_text(encoding="utf-8"), again


def test_no_page_or_picture_of_the_gallery_is_left_over():
    names = {*vcc.gallery.ENTRIES}
    assert {page.stem for page in (ROOT / "docs" / "gallery").iterdir()} - names == {"index"}
    pictures = ROOT / "docs" / "images" / "gallery"
    assert {folder.name for folder in pictures.iterdir()} <= names
    shown = "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs" / "gallery").glob("*.md"))
    for picture in pictures.rglob("*.*"):
        assert f"../images/gallery/{picture.relative_to(pictures).as_posix()})" in shown


def test_pictures_of_pages_are_stored_as_webp():
    kinds = {path.suffix for path in (ROOT / "docs" / "images").rglob("*.*")}
    assert kinds == {".webp"}, "run: python tools/docs/webp.py"
