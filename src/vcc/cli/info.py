"""``vcc info``: a report on a light field."""

import math
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError, ResultWarning
from vcc.base.reading import expanded, reading, shown
from vcc.base.units import short
from vcc.base.wavelengths import as_text
from vcc.cli.brightness import brightness
from vcc.cli.console import DRAWINGS, check_output, show
from vcc.cli.options import Arrangement, File, LightFieldFile, Reading, ViewCameras, given_options
from vcc.cli.store_words import looked_at, places_of, store_facts, video_facts
from vcc.cli.view_grid import Views, draw
from vcc.fields.grid import SAMPLES_IN_WORDS, pair
from vcc.formats import FolderInfo, keep_geometry, lytro_lfp, open_sparse_views, open_unstructured, read_geometry
from vcc.formats.dark_views import dark_words, mean_light
from vcc.formats.lytro_lfp import read_lytro
from vcc.formats.unstructured import recognised as has_poses
from vcc.light_field import LightField
from vcc.store import is_store, is_video, open_store, open_video

AS_STORED = Reading(transfer="as-is")
_NAMED_AT_MOST = 12


def info(
    light_field: LightFieldFile,
    /,
    *,
    quick: bool = False,
    picture: File | None = None,
    keep: bool = False,
    cameras: ViewCameras = ViewCameras(),
    arrangement: Arrangement = Arrangement(),
) -> None:
    """Report views, geometry, disparities and brightness of a light field, and what is unknown.

    Examples:
        vcc info views/
        vcc info views/ --quick
        vcc info views/ --picture grid.png
        vcc info mosaic.png --views 9 9
        vcc info views/ --keep --spacing "2 mm" --slope-per-pixel 0.0012 --focus-distance "1.3 m"

    Args:
        quick: Read one view only: nothing is measured, and views are not compared.
        picture: Draw all views at the positions of their cameras, .png, .svg or .pdf.
        keep: Write the cameras into the folder, as parameters.cfg, so that nothing is assumed when it is
            opened again. The options below have priority, then the files, then the assumptions.
    """
    if picture is not None:
        picture = check_output(picture, DRAWINGS)
    how = replace(AS_STORED, **cameras.given(), **arrangement.given())
    show(describe(light_field, how, quick=quick, picture=picture, keep=keep))


def describe(
    light_field: Path,
    how: Reading = AS_STORED,
    *,
    quick: bool = False,
    picture: Path | None = None,
    keep: bool = False,
) -> str:
    """The text that ``vcc info`` prints for a path; for the other arguments see `info`.

    Raises:
        InputError: it cannot be read, or an option does not apply to it.
    """
    path = expanded(light_field)
    given = [*given_options(how, but=("transfer",)), *(["--keep"] if keep else [])]
    if given and (is_store(path) or lytro_lfp.recognised(path)):
        what = "a store, which states its cameras" if is_store(path) else "a raw recording: it has no views yet"
        raise InputError(f"{path} is {what}: leave out {', '.join(given)}")
    with reading(path, "a light field"):
        if has_poses(path):
            if given or picture is not None:
                what = "photographs with poses, which state their cameras"
                raise InputError(f"{path} is {what}: leave out {', '.join(given or ['--picture'])}")
            lines = open_unstructured(path).facts()
        elif lytro_lfp.recognised(path):
            if picture is not None:
                raise InputError(f"{path} is a raw recording of a Lytro camera: it has no grid of views to draw")
            lines = _lytro_facts(path)
        elif is_video(path):
            lines = _of_a_video(path, quick, picture)
        elif is_store(path):
            lines = _of_a_store(path, quick, picture)
        else:
            kept = {}
            if keep:
                kept["kept"] = _keep(path, how)
                how = replace(AS_STORED, **how.given(Arrangement))
            lines = _of_files(path, quick, picture, how) | kept
    width = max(map(len, lines)) + 2
    return "\n".join(f"{name:<{width}}{shown(value)}" for name, value in lines.items())


def _keep(path: Path, how: Reading) -> str:
    """Save the cameras in the folder; return the file, and which of them were assumed."""
    assumed = _with(how, read_geometry(path, sparse=True, **how.given(Arrangement))).unknown
    file = keep_geometry(path, **how.given(ViewCameras), **how.given(Arrangement))
    if not assumed:
        return f"{file}"
    names = ", ".join(name.replace("_", " ") for name in assumed)
    return f"{file}; assumed, because not stated: {names}. Later runs do not report this: correct it in the file"


def _of_files(path: Path, quick: bool, picture: Path | None, how: Reading) -> dict[str, str]:
    """Facts of a folder or a file by name; views are read to measure and to draw."""
    facts = _with(how, read_geometry(path, sparse=True, **how.given(Arrangement)))
    lines = _facts(facts)
    if quick and picture is None:
        return lines
    with warnings.catch_warnings():  # on assumptions and dark views, which the lines report
        for said in (".* do not state ", ".* black or nearly so"):
            warnings.filterwarnings("ignore", message=said, category=ResultWarning)
        return lines | _measured(path, facts, quick, picture, how)


def _measured(path: Path, facts: FolderInfo, quick: bool, picture: Path | None, how: Reading) -> dict[str, str]:
    """Measurements of the views, by name."""
    lines = {}
    # Use the stored numbers if possible: disparities do not need linear light, and it takes more memory.
    as_stored, transfer = facts.codes
    if facts.missing:
        where = how.given(Arrangement)
        sparse = open_sparse_views(path, transfer=as_stored, **how.given(ViewCameras), **where)
        held = dict(zip(sparse.places, sparse.pictures, strict=True))
        views = Views(held.get, sparse.shape, sparse.frame, transfer)
        disparities = "" if quick else _sparse_disparities(sparse, facts)
    else:
        whole = replace(how, transfer=as_stored).in_memory(path)
        values = whole.values
        views = Views(lambda place: values[place], (facts.rows, facts.columns), whole.frame, transfer)
        disparities = "" if quick else _disparities(whole, facts)
    if not quick:
        lines = {"disparities": disparities, **_light(views)}
    if picture is not None:
        lines["picture"] = draw(views, path.resolve().name, picture, assumed="spacing" in facts.unknown)
    return lines


def _with(how: Reading, facts: FolderInfo) -> FolderInfo:
    """Facts with the camera parameters that the user gave."""
    given = how.given(ViewCameras)
    unknown = tuple(name for name in facts.unknown if name not in given)
    if "spacing" in given:
        given["spacing"] = pair(given["spacing"])
    return replace(facts, **given, unknown=unknown)


def _of_a_store(path: Path, quick: bool, picture: Path | None) -> dict[str, str]:
    """Facts of a store, by name."""
    stored = open_store(path)
    lines = store_facts(stored, quick)
    there = stored.shape[:2]
    missing = set(stored.missing())

    def view(place: tuple[int, int]) -> NDArray[Any] | None:
        if place in missing:
            return None
        piece = stored[place[0] : place[0] + 1, place[1] : place[1] + 1]
        samples: NDArray[Any] = piece.values[0, 0]
        return samples

    views = Views(view, (there[0], there[1]), stored.frame, "linear")
    if missing:
        lines["missing"] = _missing(sorted(missing), there[0] * there[1], "write them")
    if not quick and len(missing) < there[0] * there[1]:
        lines |= _light(views)
    if picture is not None:
        lines["picture"] = draw(views, path.resolve().name, picture, assumed=False)
    return lines


def _of_a_video(path: Path, quick: bool, picture: Path | None) -> dict[str, str]:
    """Facts of a video, by name."""
    video = open_video(path)
    if picture is not None and video:
        raise InputError(f"{path} is a video: draw the views of one frame, {video[0].path}")
    lines = video_facts(video, quick)
    if not quick and video:
        some = looked_at(video)
        views = (
            video[number].linear_view(row, column, 0, video.shape[2])
            for number in some
            for row, column in np.ndindex(*video.shape[:2])
        )
        of_these = f"; of frames {', '.join(map(str, some))}" if len(some) < len(video) else ""
        lines["brightness"] = brightness(views, "linear") + of_these
    return lines | ({"one frame": f"vcc info {video[0].path}"} if video else {})


def _facts(facts: FolderInfo) -> dict[str, str]:
    """What the folder or file states, and what is assumed, line by line."""

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
        **({} if facts.wavelengths is None else {"bands": as_text(facts.wavelengths).partition(" ")[2]}),
        "samples": SAMPLES_IN_WORDS[facts.sample],
        "size": f"{samples * facts.bits // 8 / 1e6:,.1f} MB in memory as stored, "
        f"{samples * 4 / 1e6:,.1f} MB as linear light",
        "spacing": apart + assumed("spacing"),
        "slope per pixel": slope + assumed("slope_per_pixel"),
        "views are": ("parallel" if math.isinf(focus) else f"converge {short(focus)} away")
        + assumed("focus_distance"),
    }
    if facts.off_grid is not None:
        rows, columns = facts.off_grid
        lines["positions"] = (
            f"{rows:.2g} (rows) and {columns:.2g} (columns) of a step off an even grid, by the names"
        )
    if facts.metadata.said:
        lines["numbers"] = f"{facts.metadata.in_words}, as the pictures state"
    if facts.unknown:
        options = ", ".join(f"--{name.replace('_', '-')}" for name in facts.unknown)
        keep = "; with --keep they are kept in the folder" if facts.files else ""
        lines["assumed"] = f"distances and blur depend on these assumptions: give {options} if you know them{keep}"
    if facts.missing:
        lines["missing"] = _missing(facts.missing, facts.rows * facts.columns, _FILLED)
    if facts.disparity_range is not None:
        low, highest = facts.disparity_range
        lines["disparities"] = f"{low:.3g} to {highest:.3g} pixels per view (stated)"
    for number, remark in enumerate(facts.notices):
        lines["remark" if number == 0 else f"remark {number + 1}"] = remark
    return lines


_FILLED = (
    "add them, or pass --missing fill, which renders them from the others by depth and estimates the error, or "
    "--missing dark"
)


def _missing(places: Iterable[tuple[int, int]], total: int, way_out: str) -> str:
    missing = list(places)
    named = ", ".join(f"({row}, {column})" for row, column in missing[:_NAMED_AT_MOST])
    more = ", …" if len(missing) > _NAMED_AT_MOST else ""
    return (
        f"{len(missing)} of the {total} views, by (row, column): {named}{more}. A capture "
        f"raises an error: {way_out}"
    )


def _light(views: Views) -> dict[str, str]:
    """The brightness of the views, and which are dark, by name; each view is read once."""
    light: dict[tuple[int, int], float] = {}

    def passing() -> Iterator[NDArray[Any]]:
        for place, view in views.all():
            light[place] = mean_light(view, views.transfer)
            yield view

    lines = {"brightness": brightness(passing(), views.transfer)}
    if dark := dark_words(light):
        lines["dark views"] = dark
    return lines


def _disparities(field: LightField, facts: FolderInfo) -> str:
    """The disparities, and the distances in metres that they correspond to."""
    known = field.measured_disparity_range()
    if known is None:
        return "none to measure: one view, or pictures without texture"
    low, high = known
    source = "measured" if facts.disparity_range is None else "stated"
    words = f"{low:.3g} to {high:.3g} pixels per view ({source}): {places_of(field.grid, low, high)}"
    return words + (" if the assumptions are right" if facts.unknown else "")


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


def _lytro_facts(path: Path) -> dict[str, str]:

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
