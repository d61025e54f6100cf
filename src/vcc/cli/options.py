"""Options that several commands share, and what is made of them."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from vcc.base.errors import InputError

if TYPE_CHECKING:
    from vcc.light_field import LightField
    from vcc.store import StoredLightField

_READING = "Reading the light field"
_CAPTURING = "Making the picture"

CameraFile = Annotated[Path, typer.Argument(metavar="CAMERA.toml", help="The camera file.", show_default=False)]
LightFieldFolder = Annotated[
    Path,
    typer.Argument(metavar="LIGHTFIELD", help="A folder of views, a file or a store.", show_default=False),
]

Transfer = Annotated[
    Literal["auto", "srgb", "linear"],
    typer.Option(
        help="How pixel values of the views stand for light: srgb, as pictures for people do, linear "
        "(proportional to it), or auto: as the format says, srgb where it says nothing.",
        rich_help_panel=_READING,
    ),
]
Spacing = Annotated[
    str | None,
    typer.Option(
        metavar="LENGTH",
        help='Distance between neighbouring views with its unit, "1 mm"; two of them, "1 mm, 2 mm", '
        "are for rows and columns. Default: what the folder states.",
        show_default=False,
        rich_help_panel=_READING,
    ),
]
SlopePerPixel = Annotated[
    float | None,
    typer.Option(
        metavar="NUMBER",
        help="Pixel pitch over focal length of the cameras, no unit. Default: what the folder states.",
        show_default=False,
        rich_help_panel=_READING,
    ),
]
FocusDistance = Annotated[
    str | None,
    typer.Option(
        metavar="LENGTH",
        help='Where the views converge, "1.2 m", or inf if they are parallel. Default: what the folder states.',
        show_default=False,
        rich_help_panel=_READING,
    ),
]
Orientation = Annotated[
    Literal["auto", "as-is", "flip-rows", "flip-columns", "flip-both", "transpose"],
    typer.Option(
        help="Order of the views. auto checks it by parallax and puts it right; as-is takes the "
        "files as they are.",
        rich_help_panel=_READING,
    ),
]
Method = Annotated[
    Literal["auto", "footprints", "rays"],
    typer.Option(
        help="footprints spread each sample over the sensor, exactly, where lenses, prisms and masks are all "
        "there is; rays are traced through anything. auto takes footprints where it can.",
        rich_help_panel=_CAPTURING,
    ),
]
Samples = Annotated[
    int | None,
    typer.Option(
        metavar="NUMBER",
        help="Rays a pixel, where rays are traced; rounded up to a power of two. Default: 64.",
        show_default=False,
        rich_help_panel=_CAPTURING,
    ),
]
Tolerance = Annotated[
    float | None,
    typer.Option(
        metavar="NUMBER",
        help="Double the rays until the picture's sampling error is at most this share of its mean, like 0.01.",
        show_default=False,
        rich_help_panel=_CAPTURING,
    ),
]
RaySeed = Annotated[
    int,
    typer.Option(
        metavar="NUMBER",
        help="Of the choice of rays: the same number gives the same picture.",
        rich_help_panel=_CAPTURING,
    ),
]
Interpolation = Annotated[
    Literal["sharp", "nearest", "linear", "cubic"],
    typer.Option(
        help="Interpolation within a view; sharp is linear with what that costs given back.",
        rich_help_panel=_CAPTURING,
    ),
]
BetweenViews = Annotated[
    Literal["auto", "none", "depth"],
    typer.Option(
        help="Whether to interpolate between views where neighbouring ones differ by more than a pixel: auto does "
        "along one parallax, where nothing is in focus; depth makes views in between by each pixel's own depth, "
        "which is found first and kept in a store; none never does.",
        rich_help_panel=_CAPTURING,
    ),
]
SceneDistance = Annotated[
    str | None,
    typer.Option(
        metavar="LENGTH",
        help='Distance of the scene before the camera, "1.2 m", by which that interpolation goes. '
        "Default: what the light field states or shows.",
        show_default=False,
        rich_help_panel=_CAPTURING,
    ),
]
Refine = Annotated[
    str,
    typer.Option(
        metavar="NUMBER",
        help="Divide samples by this number each way where a mask is finer than they are, 1 to 8. "
        "auto decides, and explain says what it costs.",
        rich_help_panel=_CAPTURING,
    ),
]
Engine = Annotated[
    Literal["numba", "array_api", "reference"],
    typer.Option(
        help="What computes: numba is fast, reference slow and plain.",
        rich_help_panel=_CAPTURING,
    ),
]
MemoryLimit = Annotated[
    str | None,
    typer.Option(
        metavar="SIZE",
        help='Of a light field in a store: what reading it in pieces may take, "1.5 GB". Default: 1 GiB.',
        show_default=False,
        rich_help_panel=_CAPTURING,
    ),
]


def how_made(
    *,
    method: str,
    interpolation: str,
    between_views: str,
    scene_distance: str | None,
    refine: str,
    samples: int | None,
    ray_seed: int,
) -> dict[str, Any]:
    """The options of `vcc.Camera.compile` from those of the command line.

    Raises:
        InputError: a distance without a unit, or a refinement that is no number.
    """
    return {
        "method": method,
        "interpolation": interpolation,
        "between_views": between_views,
        "scene_distance": length(scene_distance, "--scene-distance"),
        "refine": refinement(refine),
        "samples": samples,
        "seed": ray_seed,
    }


def refinement(given: str) -> int | str:
    """What --refine says: "auto" or a whole number (whose range the camera checks).

    Raises:
        InputError: neither.
    """
    if given == "auto":
        return given
    try:
        return int(given)
    except ValueError:
        raise InputError(f'--refine is "auto" or a whole number, not "{given}"') from None


def length(given: str | None, option: str) -> float | None:
    """Metres of a length on the command line; None if it is not given.

    Raises:
        InputError: no unit, or not a length.
    """
    from vcc.base.units import parse

    if given is None:
        return None
    if given.strip().lower() in ("inf", "infinity"):
        return math.inf
    return parse(given, "length", option)


def memory_size(given: str | None, option: str = "--memory-limit") -> int | None:
    """Bytes of a size on the command line, "800 MB" or "1.5 GiB"; None if it is not given.

    Raises:
        InputError: no unit, or not a size above 0.
    """
    if given is None:
        return None
    units = {"kb": 1e3, "mb": 1e6, "gb": 1e9, "tb": 1e12, "kib": 2**10, "mib": 2**20, "gib": 2**30, "tib": 2**40}
    number, unit = given.strip().rstrip("BbiIkKmMgGtT"), given.strip().lstrip("0123456789.eE+- ")
    try:
        size = float(number) * units[unit.lower()]
    except (ValueError, KeyError):
        size = math.nan
    if not (size >= 1 and math.isfinite(size)):
        raise InputError(f'{option} is "{given}": a size has a number and a unit, like "800 MB" or "1.5 GiB"')
    return int(size)


def spacing_of(given: str | None) -> float | tuple[float, float] | None:
    """Metres of one length, or of two (rows, columns) with a comma between them.

    Raises:
        InputError: more than two, no unit, or not a length.
    """
    if given is None:
        return None
    parts = [length(part, "--spacing") or 0.0 for part in given.split(",")]
    if len(parts) > 2:
        raise InputError(f'--spacing is "{given}": one length, or two with a comma between them')
    return parts[0] if len(parts) == 1 else (parts[0], parts[1])


def exposure_of(given: str) -> Any:
    """ "auto" or a number above 0.

    Raises:
        InputError: anything else.
    """
    if given == "auto":
        return given
    try:
        number = float(given)
    except ValueError:
        number = math.nan
    if not (number > 0 and math.isfinite(number)):
        raise InputError(f'--exposure is "{given}": it is auto or a number above 0, like 0.8')
    return number


def exposure_time(given: str) -> Any:
    """ "auto" or the seconds of a time on the command line.

    Raises:
        InputError: no unit, or not a time.
    """
    from vcc.base.units import parse

    return given if given == "auto" else parse(given, "time", "--exposure")


def read_light_field(
    folder: Path,
    transfer: str,
    spacing: str | None,
    slope_per_pixel: float | None,
    focus_distance: str | None,
    orientation: str,
    **layout: Any,
) -> LightField | StoredLightField:
    """The light field that the options of a command ask for, with a progress bar; a store is opened, not read.

    ``layout`` holds what some formats need besides, see `vcc.open_light_field`: views, order, every.

    Raises:
        InputError: what `vcc.open_light_field` and the lengths refuse; a store and cameras told beside it.
    """
    from vcc.store import is_store, open_store

    if is_store(folder):
        told = {"--spacing": spacing, "--slope-per-pixel": slope_per_pixel, "--focus-distance": focus_distance}
        names = [name for name, value in told.items() if value is not None]
        names += ["--orientation"] if orientation != "auto" else []
        names += [f"--{name}" for name in layout]
        if names:
            raise InputError(f"{folder} is a store, which states its cameras: leave out {', '.join(names)}")
        return open_store(folder)
    given: dict[str, Any] = {
        "transfer": transfer,
        "orientation": orientation,
        "spacing": spacing_of(spacing),
        "slope_per_pixel": slope_per_pixel,
        "focus_distance": length(focus_distance, "--focus-distance"),
        **layout,
    }
    from vcc.cli.console import progress
    from vcc.formats import open_light_field

    with progress("Reading views") as advance:
        return open_light_field(folder, progress=advance, **given)
