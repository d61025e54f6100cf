"""What ``vcc info`` says of a light field, and its picture of the grid of views."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.cli import options as given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from vcc.base.affine import Affine
    from vcc.formats import FolderInfo
    from vcc.light_field import LightField
    from vcc.store import StoredLightField

_NAMED_AT_MOST = 12
_LOW, _HIGH = 0.1, 99.9  # per cent of the samples between which the dynamic range is measured
_MOST_SAMPLES = 4_000_000  # of floating-point samples that are sorted for it
_SHEET = 1400  # pixels: about the longer side of the picture of the grid
_NARROWEST = 190  # pixels, so that title and labels fit
_SMALLEST, _LARGEST = 24, 260  # pixels of the longer side of a view in it


def describe(path: Path, quick: bool = False, picture: Path | None = None) -> str:
    """What a light field is, line by line.

    Args:
        path: a folder of views, a file or a store.
        quick: leave out what takes reading all views.
        picture: where to draw the grid of views; this reads them all.

    Raises:
        InputError: what opening it refuses, or a picture that cannot be written.
    """
    from vcc.formats import lytro_lfp
    from vcc.store import is_store

    path = path.expanduser()
    if lytro_lfp.recognised(path):
        if picture is not None:
            raise InputError(f"{path} is a raw recording of a Lytro camera: it has no grid of views to draw")
        return _table(_lytro_facts(path))
    if is_store(path):
        return _describe_store(path, quick, picture)
    from vcc.formats import open_sparse_views, read_geometry
    from vcc.light_field import LightField

    facts = read_geometry(path, sparse=True)
    lines = _facts(facts)
    if quick and picture is None:
        return _table(lines)
    # Linear keeps the type of the files: disparities do not need light, and memory is short.
    if facts.missing:
        sparse = open_sparse_views(path, transfer="linear")
        held = dict(zip(sparse.places, sparse.pictures, strict=True))
        views = _Views(held.get, sparse.shape, sparse.frame, facts.transfer)
        disparities = "" if quick else _sparse_disparities(sparse, facts)
    else:
        whole = given.read_light_field(path, "linear", None, None, None, "auto")
        assert isinstance(whole, LightField)  # a store was described above
        values = whole.values
        views = _Views(lambda place: values[place], (facts.rows, facts.columns), whole.frame, facts.transfer)
        disparities = "" if quick else _disparities(whole, facts)
    if not quick:
        lines["disparities"] = disparities
        lines["brightness"] = _brightness(views.all(), facts.transfer)
    if picture is not None:
        lines["picture"] = _draw(views, path.resolve().name, picture, assumed="spacing" in facts.unknown)
    return _table(lines)


@dataclass(frozen=True)
class _Views:
    """The views of a light field, one at a time.

    Args:
        at: the samples of the view at (row, column); None if it is missing.
        shape: (rows, columns) of views.
        frame: of the light field.
        transfer: "srgb" or "linear": how integers stand for light.
    """

    at: Callable[[tuple[int, int]], NDArray[Any] | None]
    shape: tuple[int, int]
    frame: Affine
    transfer: str

    def all(self) -> Iterable[NDArray[Any]]:
        """Those there are, row by row."""
        for place in np.ndindex(*self.shape):
            view = self.at((place[0], place[1]))
            if view is not None:
                yield view


def _table(lines: dict[str, str]) -> str:
    width = max(map(len, lines)) + 2
    return "\n".join(f"{name:<{width}}{value}" for name, value in lines.items())


# --- in words ---


def _describe_store(path: Path, quick: bool, picture: Path | None) -> str:
    from vcc.cli.convert import store_facts
    from vcc.store import open_store

    text = store_facts(path, quick)
    stored = open_store(path)
    there = stored.shape[:2]
    missing = set(stored.missing())

    def view(place: tuple[int, int]) -> NDArray[Any] | None:
        if place in missing:
            return None
        piece = stored[place[0] : place[0] + 1, place[1] : place[1] + 1]
        samples: NDArray[Any] = piece.values[0, 0]
        return samples

    views = _Views(view, (there[0], there[1]), stored.frame, "linear")
    lines: dict[str, str] = {}
    if missing:
        lines["missing"] = _missing(sorted(missing), there[0] * there[1])
    if not quick and len(missing) < there[0] * there[1]:
        lines["brightness"] = _brightness(views.all(), "linear")
    if picture is not None:
        lines["picture"] = _draw(views, path.resolve().name, picture, assumed=False)
    return f"{text}\n{_table(lines)}" if lines else text


def _facts(facts: FolderInfo) -> dict[str, str]:
    """What the folder or file states and what is taken for granted, line by line."""
    from vcc.base.units import short
    from vcc.fields.grid import SAMPLES_IN_WORDS

    def assumed(name: str) -> str:
        return "  (not stated: assumed)" if name in facts.unknown else ""

    samples = facts.rows * facts.columns * facts.height * facts.width * (facts.channels or 1)
    colour = "grey" if facts.channels is None else f"{facts.channels} channels"
    kind = "floating-point" if facts.bits == 32 else f"{facts.bits}-bit"
    vertical, horizontal = facts.spacing
    apart = short(vertical)
    if vertical != horizontal:
        apart = f"{apart} (rows), {short(horizontal)} (columns)"
    focus = facts.focus_distance
    wide, high = (2 * math.degrees(math.atan(n * facts.slope_per_pixel / 2)) for n in (facts.width, facts.height))
    slope = f"{facts.slope_per_pixel:.6g}, a field of view of {wide:.3g}° × {high:.3g}°"
    lines = {
        "format": facts.format,
        "views": f"{facts.rows} × {facts.columns} (rows × columns)",
        "pictures": f"{facts.width} × {facts.height} pixels, {colour}, {kind}",
        "samples": SAMPLES_IN_WORDS[facts.sample],
        "size": f"{samples * facts.bits // 8 / 1e6:,.1f} MB in memory as stored, "
        f"{samples * 4 / 1e6:,.1f} MB as linear light",
        "spacing": apart + assumed("spacing"),
        "slope per pixel": slope + assumed("slope_per_pixel"),
        "views are": ("parallel" if math.isinf(focus) else f"converge {short(focus)} away")
        + assumed("focus_distance"),
    }
    if facts.missing:
        lines["missing"] = _missing(facts.missing, facts.rows * facts.columns)
    if facts.disparity_range is not None:
        low, highest = facts.disparity_range
        lines["disparities"] = f"{low:.3g} to {highest:.3g} pixels per view (stated)"
    for number, remark in enumerate(facts.remarks):
        lines["remark" if number == 0 else f"remark {number + 1}"] = remark
    return lines


def _missing(places: Iterable[tuple[int, int]], total: int) -> str:
    missing = list(places)
    named = ", ".join(f"({row}, {column})" for row, column in missing[:_NAMED_AT_MOST])
    more = ", …" if len(missing) > _NAMED_AT_MOST else ""
    return f"{len(missing)} of the {total} views, by (row, column): {named}{more}"


def _disparities(field: LightField | StoredLightField, facts: FolderInfo) -> str:
    """The disparities and what they mean in metres."""
    from vcc.base.units import short

    known = field.measured_disparity_range()
    if known is None:
        return "none to measure: one view, or pictures without texture"
    low, high = known
    source = "measured" if facts.disparity_range is None else "stated"
    words = f"{low:.3g} to {high:.3g} pixels per view ({source})"
    near, far = field.distance_of(high), field.distance_of(low)
    if 0 < near < far:
        places = f"{short(near, digits=3)} to {short(far, digits=3)}"
        words += f": things {places} away"
        words += " if what is assumed is right" if facts.unknown else ""
    return words


def _sparse_disparities(sparse: Any, facts: FolderInfo) -> str:
    """The disparities of an incomplete grid: stated, or measured along its most central complete row."""
    whole = np.flatnonzero(sparse.present.all(axis=1))
    if facts.disparity_range is None and not whole.size:
        return "not stated, and not measured: no row of views is complete"
    row = int(whole[np.abs(whole - (sparse.shape[0] - 1) / 2).argmin()]) if whole.size else None
    if row is not None:
        words = _disparities(sparse[row, :], facts)
        return words if facts.disparity_range is not None else f"{words} (along row {row})"
    low, high = facts.disparity_range or (math.nan, math.nan)
    return f"{low:.3g} to {high:.3g} pixels per view (stated)"


def _brightness(views: Iterable[NDArray[Any]], transfer: str) -> str:
    """The dynamic range of linear light, and how much of it is black or at the end of the scale."""
    levels, counts = _histogram(views, transfer)
    shares = np.cumsum(counts) / counts.sum()
    low, high = (float(levels[np.searchsorted(shares, share / 100)]) for share in (_LOW, _HIGH))
    dark = float(counts[levels <= 0].sum() / counts.sum())
    if high <= 0:
        return "black everywhere"
    if low <= 0:
        low = float(levels[levels > 0].min())  # the darkest that is not black
    words = (
        f"{low:.3g} to {high:.3g} in linear light ({_LOW} % and {_HIGH} % of the samples): "
        f"a range of 1 : {_rounded(high / low)}, {math.log2(high / low):.1f} stops"
    )
    full = float(counts[levels >= 1].sum() / counts.sum()) if levels.max() == 1 else 0.0
    if dark > 0:
        words += f"; {dark:.2%} of the samples are black"
    if full > 0:
        words += f"; {full:.2%} are at the end of the scale, so perhaps clipped"
    return words


def _rounded(ratio: float) -> str:
    return f"{ratio:,.0f}" if ratio >= 100 else f"{ratio:.3g}"


def _histogram(views: Iterable[NDArray[Any]], transfer: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Linear light that occurs, growing, and how often; of very many floating-point samples only some are seen."""
    from vcc.files import transfer as curves

    counts: NDArray[np.float64] | None = None
    some: list[NDArray[Any]] = []
    kept, step = 0, 1
    for view in views:
        if view.dtype in (np.uint8, np.uint16):
            bits = 8 * view.dtype.itemsize
            found = np.bincount(view.ravel(), minlength=2**bits).astype(np.float64)
            counts = found if counts is None else counts + found
        else:
            some.append(view.ravel()[::step])
            kept += some[-1].size
            if kept > _MOST_SAMPLES:
                step *= 2
                some = [samples[::2] for samples in some]
                kept = sum(samples.size for samples in some)
    if counts is not None:
        bits = int(math.log2(counts.size))
        levels = curves.table(bits) if transfer == "srgb" else np.arange(counts.size) / (counts.size - 1)
        there = counts > 0
        return levels.astype(np.float64)[there], counts[there]
    values, number = np.unique(np.concatenate(some), return_counts=True)
    return values.astype(np.float64), number.astype(np.float64)


def _lytro_facts(path: Path) -> dict[str, str]:
    from vcc.base.units import short
    from vcc.formats.lytro_lfp import read_lytro

    raw = read_lytro(path)
    rows, columns = raw.mosaic.shape
    lines = {
        "format": "raw recording of a Lytro camera: no light field until it is decoded",
        "camera": raw.camera,
        "sensor": f"{columns} × {rows} pixels, {raw.bits}-bit, {raw.color_filter}",
        "numbers": f"{raw.mosaic.min()} to {raw.mosaic.max()}",
    }
    for name, levels in (("black", raw.black), ("white", raw.white)):
        if levels is not None:
            lines[f"{name} levels"] = ", ".join(f"{level:g}" for level in levels)
    geometry = raw.geometry
    for name, length in (
        ("pixel pitch", geometry.pixel_pitch),
        ("microlens pitch", geometry.lens_pitch),
        ("microlenses", geometry.lens_height),
        ("focal length", geometry.focal_length),
        ("exit pupil", geometry.exit_pupil_distance),
    ):
        if length is not None:
            away = {"microlenses": " above the sensor", "exit pupil": " from the microlenses"}.get(name, "")
            lines[name] = short(length) + away
    if geometry.lens_rotation is not None:
        lines["microlens grid"] = f"turned by {math.degrees(geometry.lens_rotation):.4g}°"
    if geometry.f_number is not None:
        lines["f-number"] = f"{geometry.f_number:g}"
    return lines


# --- as a picture ---


def _draw(views: _Views, title: str, path: Path, assumed: bool) -> str:
    """Write the picture of the grid of views; returns its path."""
    from vcc.files.atomic import atomic_path

    figure = grid_figure(views.at, views.shape, views.frame, views.transfer, title, assumed)
    with atomic_path(path) as temporary:
        figure.savefig(temporary)
    return f"{path}: written"


def grid_figure(
    at: Callable[[tuple[int, int]], NDArray[Any] | None],
    shape: tuple[int, int],
    frame: Affine,
    transfer: str = "linear",
    title: str = "",
    assumed: bool = False,
) -> Figure:
    """All views, small, each where its camera stands, seen as someone sees them who looks at the scene.

    Args:
        at: the samples of the view at (row, column), None for one that is missing.
        shape: (rows, columns) of views.
        frame: of the light field, for the places of the cameras.
        transfer: "srgb" or "linear": how integers stand for light.
        title: what is shown.
        assumed: whether the places are assumed rather than known.
    """
    from vcc.plot.style import NOTHING, SMALL, TEXT, TITLE, new_axes

    rows, columns = shape
    small = {place: _small(view, shape, transfer) for place in _places(shape) if (view := at(place)) is not None}
    if not small:
        raise InputError("there is no view to draw")
    height, width = next(iter(small.values())).shape[:2]
    gap = max(1, round(0.02 * max(height, width)))
    sheet = np.ones((rows * (height + gap) - gap, columns * (width + gap) - gap, 3), np.float32)
    exposure = _exposure(small, shape)
    for (row, column), view in small.items():
        top, left = row * (height + gap), column * (width + gap)
        sheet[top : top + height, left : left + width] = _shown(view * exposure)
    high, wide = (max(pixels, _NARROWEST) / 100 for pixels in sheet.shape[:2])  # at 100 dots per inch
    axes = new_axes(wide + 1.3, high + 1.5)  # room for labels
    axes.imshow(sheet, interpolation="none" if max(height, width) < _LARGEST else "antialiased")
    for row, column in set(_places(shape)) - set(small):
        _mark_missing(axes, column * (width + gap), row * (height + gap), width, height, NOTHING)
    note = " (assumed)" if assumed else ""
    middle = ((columns - 1) / 2, (rows - 1) / 2)
    for axis, count, size, name in (
        (axes.xaxis, columns, width, "u"),
        (axes.yaxis, rows, height, "v"),
    ):
        every = max(1, math.ceil(count / 12))
        numbers = np.arange(0, count, every)
        indices = np.zeros((len(numbers), 4))
        indices[:, :2] = [(n, middle[1]) if name == "u" else (middle[0], n) for n in numbers]
        where = frame(indices)[:, 0 if name == "u" else 1]
        unit, factor = _unit(float(np.ptp(where)))
        labels = [f"{n}\n{place * factor:.4g}".replace("-", "−") for n, place in zip(numbers, where, strict=True)]
        axis.set_ticks(numbers * (size + gap) + (size - 1) / 2, labels, fontsize=SMALL)
        kind = "column" if name == "u" else "row"
        axis.set_label_text(f"{kind}, and {name} in {unit}{note}", fontsize=TEXT)
    axes.spines[:].set_visible(False)
    missing = rows * columns - len(small)
    words = f"{title}: {rows} × {columns} views" + (f", {missing} missing" if missing else "")
    axes.set_title(words, fontsize=TITLE)
    figure: Figure = axes.figure
    return figure


def _places(shape: tuple[int, int]) -> list[tuple[int, int]]:
    return [(row, column) for row in range(shape[0]) for column in range(shape[1])]


def _mark_missing(axes: Any, left: float, top: float, width: float, height: float, colour: str) -> None:
    from matplotlib.patches import Rectangle

    corner = (left - 0.5, top - 0.5)
    axes.add_patch(
        Rectangle(corner, width, height, facecolor="white", edgecolor=colour, hatch="////", linewidth=0)
    )


def _small(view: NDArray[Any], shape: tuple[int, int], transfer: str) -> NDArray[np.float32]:
    """A view's linear light in blocks of whole pixels, so that all views fit on a sheet."""
    from vcc.files import transfer as curves

    room = np.clip(_SHEET / max(shape), _SMALLEST, _LARGEST)
    step = max(1, math.ceil(max(view.shape[:2]) / room))
    height, width = (max(1, n // step) for n in view.shape[:2])
    piece = view[: height * step, : width * step]
    if piece.dtype in (np.uint8, np.uint16) and transfer == "srgb":
        light = curves.decode(piece)
    else:
        full = np.iinfo(piece.dtype).max if piece.dtype.kind == "u" else 1
        light = piece.astype(np.float32) / np.float32(full)
    light = light.reshape(light.shape[0], light.shape[1], -1)
    step_y, step_x = light.shape[0] // height, light.shape[1] // width
    light = light.reshape(height, step_y, width, step_x, light.shape[2]).mean(axis=(1, 3))
    if light.shape[2] != 3:
        light = np.repeat(light.mean(axis=2, keepdims=True), 3, axis=2)  # no colours that people know
    return light


def _exposure(small: dict[tuple[int, int], NDArray[np.float32]], shape: tuple[int, int]) -> np.float32:
    """1 where the middle view is not too bright, else what makes it fit; dark pictures are brightened too."""
    from vcc.files.pictures import auto_exposure

    middle = ((shape[0] - 1) / 2, (shape[1] - 1) / 2)
    nearest = min(small, key=lambda place: math.dist(place, middle))
    return np.float32(auto_exposure(small[nearest]))


def _shown(light: NDArray[np.float32]) -> NDArray[np.float32]:
    from vcc.files import transfer as curves

    return curves.from_linear(np.clip(light, 0, 1))


def _unit(extent: float) -> tuple[str, float]:
    """The unit that a length is best read in, and how many of it make a metre."""
    for unit, factor in (("m", 1.0), ("mm", 1e3), ("µm", 1e6)):
        if extent * factor >= 1:
            return unit, factor
    return "mm", 1e3
