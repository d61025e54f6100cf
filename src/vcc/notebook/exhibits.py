"""The display of each kind of object. Other objects show their `repr`, as in the terminal."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import fields, is_dataclass, replace
from functools import singledispatch
from itertools import islice
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.advice.explain import Explanation
from vcc.analysis import (
    OptimisedAperture,
    PlaneSpectrum,
    PointSpread,
    SamplingAdvice,
    Spectrum,
    plot_plane_spectrum,
    plot_spectrum,
)
from vcc.base.describe import kind_in_words, parameters_listed
from vcc.base.errors import InputError
from vcc.base.units import mm, short, um
from vcc.fields.sampled import has_values
from vcc.files.pictures import SavedPicture
from vcc.files.transfer import encode
from vcc.gallery.entry import Picture, Result
from vcc.image import Image
from vcc.light_field import LightField
from vcc.notebook.contacts import contact_panel, strip_panel
from vcc.notebook.html import Exhibit, Panel, Table
from vcc.notebook.pictures import codes_panel, drawn, light_panel, map_panel
from vcc.optics import Element, Faces
from vcc.optics.electronics import Electronics
from vcc.optics.sensor import Sensor
from vcc.optics.train import Train
from vcc.plan.how import How
from vcc.plot.camera_plot import plot_camera
from vcc.plot.element_plot import UNBOUNDED, plot_element
from vcc.recording import Recording
from vcc.recover import AllInFocus, Deblurred, DefocusDepth, DepthMap, FocalStack, PhotodiodeDepth, StereoDepth
from vcc.shapes.kernels import Kernel
from vcc.shapes.patterns import Circle, Pattern
from vcc.shapes.surface import Surface
from vcc.store import StoredLightField
from vcc.sweeps import Sweep, contact_sheet

FRONT = 256
"""Points along a side for front views of patterns, kernels and surfaces."""
SWEPT_ROWS = 12
"""Rows shown of a sweep's table."""
MOST_PICTURES = 6
"""Pictures shown of a gallery result."""
SIDE_BY_SIDE = 270
"""Their width, pixels."""
PERIODS = 6
"""Periods shown of an unbounded periodic pattern."""


@singledispatch
def exhibit(thing: Any) -> Exhibit:
    """The display of an object; the default is its `repr` with the first line as a heading."""
    first, _, rest = repr(thing).partition("\n")
    title, words = _parted(first)
    return Exhibit(title, words, text=rest)


def _parted(line: str) -> tuple[str, str]:
    """The name and the text in parentheses after it; a line without parentheses is a name."""
    found = re.fullmatch(r"(\w+)\((.*)\)", line)
    return (found[1], found[2]) if found else (line, "")


# --- pictures ---


@exhibit.register
def _(image: Image) -> Exhibit:
    title, words = _parted(repr(image))
    return Exhibit(title, words, _light(image))


@exhibit.register
def _(recording: Recording) -> Exhibit:
    first, _, rest = repr(recording).partition("\n")
    electronics = recording.electronics
    full = electronics.largest_number - electronics.black_level
    upright = (recording.values[::-1, ::-1].astype(np.float32) - electronics.black_level) / full
    panel = light_panel(np.maximum(upright, 0), "the numbers above black, turned upright")
    return Exhibit(*_parted(first), (panel,), text=rest)


def _light(image: Image, share: int = 1) -> tuple[Panel, ...]:
    """The panel of an upright image; empty if it has no values, as under a tracer."""
    if not has_values(image.values):
        return ()
    return (light_panel(image.upright().to_numpy(), "turned upright" if image.inverted else "", share),)


# --- light fields ---


@exhibit.register(LightField)
@exhibit.register(StoredLightField)
def _(light_field: LightField | StoredLightField) -> Exhibit:
    title, words = _parted(repr(light_field))
    seen = not isinstance(light_field, LightField) or has_values(light_field.values)
    return Exhibit(title, words, (contact_panel(light_field),) if seen else ())


@exhibit.register
def _(stack: FocalStack) -> Exhibit:
    count, rows, columns = stack.pictures.shape[:3]
    return Exhibit("FocalStack", f"{count} pictures of {rows}×{columns} pixels", (strip_panel(stack),))


@exhibit.register
def _(found: AllInFocus) -> Exhibit:
    distances = map_panel(found.distance, "distance of the sharpest picture [m]")
    return Exhibit("AllInFocus", repr(found.image), (*_light(found.image, share=2), distances))


@exhibit.register
def _(swept: Sweep) -> Exhibit:
    first = repr(swept).partition("\n")[0]
    names = [each.name for each in swept.coordinates]
    places = list(islice(np.ndindex(*swept.shape), SWEPT_ROWS))
    rows = [[*swept.values(place), *(f"{each[place]:.5g}" for each in swept.numbers.values())] for place in places]
    more = f"… and {len(swept) - SWEPT_ROWS} more rows: swept.table" if len(swept) > SWEPT_ROWS else ""
    seen = swept.pictures is not None and swept.done.any()
    panels = (drawn(lambda: contact_sheet(swept)),) if seen else ()
    return Exhibit(*_parted(first), panels, Table((*names, *swept.numbers), rows), text=more)


# --- cameras and their parts ---


@exhibit.register
def _(train: Train) -> Exhibit:
    rows = [_place(each.z, each.kind, each.name, each.described()) for each in train.elements]
    sensor = train.sensor
    electronics = sensor.electronics
    said = train.listed()[-1].partition("sensor, ")[2]
    if electronics is not None:
        said += f", {electronics.bit_depth} bits, {electronics.filter_in_words}"
    table = Table(("z", "element", "name", "parameters"), [*rows, (f"{sensor.z / mm:.6g} mm", "sensor", "", said)])
    head = repr(train).partition("\n")[0]
    panels, failed = _drawing(lambda: plot_camera(train))
    return Exhibit(train.name or head, "" if not train.name else head, panels, table, failed)


def _place(z: float, *words: str) -> tuple[str, ...]:
    return (f"{z / mm:.6g} mm", *words)


@exhibit.register
def _(element: Element) -> Exhibit:
    panels, failed = _drawing(lambda: plot_element(element), "from the side, with parallel light")
    if not failed:
        panels += tuple(map(_front, filter(_is_patterned, _patterns(element))))
    title = element.kind[0].upper() + element.kind[1:]
    name = f'"{element.name}"' if element.name else ""
    beside = () if any(element.decentre) else ("decentre",)
    return Exhibit(title, name, panels, _parameters(element, ("name", "source", *beside)), failed)


def _patterns(element: Element) -> list[Pattern]:
    faces = [part for part in element.parts() if isinstance(part, Faces)]
    return [part.pattern for part in faces if part.pattern is not None]


def _is_patterned(pattern: Pattern) -> bool:
    """Whether the pattern shows more than the rim of a sheet or a lens."""
    return not isinstance(pattern, Circle) and float(np.ptp(_transmission(pattern)[0])) > 0


def _drawing(draw: Callable[[], Any], caption: str = "") -> tuple[tuple[Panel, ...], str]:
    """A drawing, or the error message if a user's element is invalid."""
    try:
        return (drawn(draw, caption),), ""
    except InputError as error:
        return (), f"Not drawn\n  {error}"


@exhibit.register(Sensor)
@exhibit.register(Electronics)
@exhibit.register(How)
def _(thing: Any) -> Exhibit:
    return Exhibit(type(thing).__name__, table=_parameters(thing, leave_out=("electronics",)), text=_inside(thing))


def _inside(thing: Any) -> str:
    """The parameters of a sensor's electronics."""
    electronics = getattr(thing, "electronics", None)
    if electronics is None:
        return ""
    return "\n".join(["Electronics", *(f"  {name}: {value}" for name, value in parameters_listed(electronics))])


def _parameters(thing: Any, leave_out: tuple[str, ...] = ()) -> Table | None:
    """A table of the parameters of a dataclass."""
    if not is_dataclass(thing) or not fields(thing):
        return None
    return Table(("parameter", "value"), parameters_listed(thing, leave_out))


# --- functions of position ---


@exhibit.register
def _(pattern: Pattern) -> Exhibit:
    return Exhibit(_kind(pattern), "", (_front(pattern),), _parameters(pattern))


@exhibit.register
def _(kernel: Kernel) -> Exhibit:
    half = [reach or 1e-3 for reach in kernel.reach]
    s, t = (np.linspace(-each, each, FRONT) for each in half)
    density = kernel.density(s[None, :], t[:, None])
    caption = f"from −{half[0]:.3g} to {half[0]:.3g} in δs, from −{half[1]:.3g} to {half[1]:.3g} in δt"
    return Exhibit(
        _kind(kernel), "", (map_panel(density, "density", caption, outliers=False),), _parameters(kernel)
    )


@exhibit.register
def _(surface: Surface) -> Exhibit:
    width, height = _bounded(surface.size)
    path = surface.path(*_raster(width, height))
    panel = map_panel(path / um, "optical path [µm]", _size_in_words(width, height), outliers=False)
    return Exhibit(_kind(surface), "", (panel,), _parameters(surface))


def _kind(thing: Any) -> str:
    words = kind_in_words(type(thing))
    return words[0].upper() + words[1:]


def _front(pattern: Pattern) -> Panel:
    """The transmission of a pattern, seen from the front: x to the right, y down."""
    values, size = _transmission(pattern)
    caption = f"from the front, {size}; white lets all light through"
    panel = codes_panel(values, lambda part: np.rint(np.clip(part, 0, 1) * 255).astype(np.uint8), caption, share=2)
    return replace(panel, framed=True)


def _transmission(pattern: Pattern) -> tuple[NDArray[np.float64], str]:
    """Means over the cells of a raster, and the size of the area as text."""
    period = getattr(getattr(pattern, "pattern", pattern), "period", None)
    periods = [each for each in np.ravel(period if period is not None else ()) if math.isfinite(each)]
    width, height = _bounded(pattern.size, PERIODS * max(periods) if periods else 2 * UNBOUNDED)
    x, y = _raster(width, height)
    return np.asarray(pattern.mean(x, y, width / x.size, height / y.size)), _size_in_words(width, height)


def _bounded(size: tuple[float, float], otherwise: float = 2 * UNBOUNDED) -> tuple[float, float]:
    """A size with infinities replaced."""
    width, height = (each if math.isfinite(each) else otherwise for each in size)
    return width, height


def _raster(width: float, height: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres of square cells, `FRONT` along the longer side: x and y."""
    cell = max(width, height) / FRONT
    columns, rows = (max(round(side / cell), 1) for side in (width, height))
    x, y = (((np.arange(n) + 0.5) / n - 0.5) * side for n, side in ((columns, width), (rows, height)))
    return x[None, :], y[:, None]


def _size_in_words(width: float, height: float) -> str:
    return f"{short(width, digits=3)} × {short(height, digits=3)}"


# --- text ---


@exhibit.register
def _(explanation: Explanation) -> Exhibit:
    return Exhibit("Explanation", text=str(explanation))


@exhibit.register
def _(advice: SamplingAdvice) -> Exhibit:
    panels, failed = _drawing(advice.plot)
    return Exhibit("SamplingAdvice", "", panels, text=str(advice) + failed)


@exhibit.register
def _(saved: SavedPicture) -> Exhibit:
    return Exhibit("SavedPicture", saved.description)


# --- results ---


@exhibit.register
def _(spread: PointSpread) -> Exhibit:
    brightest = float(spread.values.max()) or 1.0
    caption = "as light lands on the sensor; the brightest pixel is white"
    panel = codes_panel(spread.values, lambda part: encode(part / np.float32(brightest), 8), caption)
    outside = f", {spread.outside:.2%} of the light beside it" if spread.outside > 0 else ""
    title, words = _parted(repr(spread))
    return Exhibit(title, words + outside, (panel,))


@exhibit.register
def _(spectrum: PlaneSpectrum) -> Exhibit:
    panels, failed = _drawing(lambda: plot_plane_spectrum(spectrum))
    return Exhibit(*_parted(repr(spectrum)), panels, text=failed)


@exhibit.register
def _(spectrum: Spectrum) -> Exhibit:
    panels, failed = _drawing(lambda: plot_spectrum(spectrum))
    return Exhibit(*_parted(repr(spectrum)), panels, text=failed)


@exhibit.register
def _(depth: DepthMap) -> Exhibit:
    panels = (
        map_panel(depth.disparity, "disparity [pixels per view]", "nearer is brighter"),
        map_panel(depth.confidence, "confidence"),
    )
    rows, columns = depth.disparity.shape
    return Exhibit("DepthMap", f"of view {depth.view}, {rows}×{columns} pixels", panels)


@exhibit.register(StereoDepth)
@exhibit.register(PhotodiodeDepth)
@exhibit.register(DefocusDepth)
def _(depth: StereoDepth | PhotodiodeDepth | DefocusDepth) -> Exhibit:
    panels = (map_panel(depth.distance, "distance [m]"), map_panel(depth.confidence, "confidence"))
    rows, columns = depth.distance.shape
    return Exhibit(type(depth).__name__, f"{rows}×{columns} blocks", panels)


@exhibit.register
def _(found: Deblurred) -> Exhibit:
    steps = f" after {found.iterations} steps" if found.iterations else ""
    panel = light_panel(np.maximum(found.picture, 0), "as the recording lies")
    return Exhibit("Deblurred", f"{found.message}{steps}", (panel,))


@exhibit.register
def _(result: Result) -> Exhibit:
    pictures = [picture for row in result.pictures for picture in row][:MOST_PICTURES]
    left_out = sum(map(len, result.pictures)) - len(pictures)
    panels = tuple(_of_gallery(picture, share=len(pictures)) for picture in pictures)
    rows = [(found.what, found.claim or "–", found.measured, found.verdict, found.why) for found in result.numbers]
    table = Table(("what", "claimed", "measured here", "claim", "why"), rows) if rows else None
    more = f"{left_out} more pictures: vcc.gallery.write_entry writes all" if left_out else ""
    return Exhibit("Result", more, panels, table, text=result.assumed)


def _of_gallery(picture: Picture, share: int) -> Panel:
    """A picture of the gallery, as an array for display or as a figure."""
    if not isinstance(picture.content, np.ndarray):
        return drawn(lambda: picture.content, picture.title, share)
    panel = codes_panel(
        picture.content, lambda part: np.rint(np.clip(part, 0, 1) * 255).astype(np.uint8), picture.title, share
    )
    return replace(panel, width=min(panel.width, SIDE_BY_SIDE))


@exhibit.register
def _(found: OptimisedAperture) -> Exhibit:
    codes = codes_panel(found.pattern, lambda part: np.rint(part * 255).astype(np.uint8), "white is open")
    return Exhibit("OptimisedAperture", f"R(K) = {found.error:.4g}: {found.message}", (codes,))
