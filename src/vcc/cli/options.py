"""Options that several commands share: values with units, and records whose fields become options of a command.

A record is declared once; its docstring is its help. `given_options` returns the options that a user gave.
Annotations are objects here, not strings: cyclopts evaluates them also if a record is extended in another
file.
"""

import dataclasses
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from cyclopts import Group, Parameter, Token

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.reading import number
from vcc.base.units import parse, short
from vcc.base.wavelengths import wavelengths as all_checked
from vcc.cli.console import as_options, progress
from vcc.formats import open_light_field
from vcc.formats.orders import Order
from vcc.formats.tiles import Layout
from vcc.formats.writing import Kind
from vcc.light_field import LightField
from vcc.plan.how import BetweenViews, EngineName, How, Interpolation, Method  # noqa: F401  # How's fields name them
from vcc.store import StoredLightField, StoredVideo, is_store, is_video, open_store, open_video

MAKING = Group("Making the image", sort_key=2)
READING = Group("Reading the light field", sort_key=3)

Field = TypeVar("Field", LightField, StoredLightField)

# --- values ---


def length(text: str, option: str) -> float:
    """Metres of a length on the command line; "inf" is accepted.

    Raises:
        InputError: no unit, or not a length.
    """
    return math.inf if text.strip().lower() in ("inf", "infinity") else parse(text, "length", option)


def lengths(text: str, option: str) -> float | tuple[float, float]:
    """Metres of one length, or of two separated by a comma.

    Raises:
        InputError: more than two, no unit, or not a length.
    """
    parts = [length(part, option) for part in text.split(",")]
    if len(parts) > 2:
        raise InputError(f'{option} is "{text}": one length, or two with a comma between them')
    return parts[0] if len(parts) == 1 else (parts[0], parts[1])


def wavelengths(text: str, option: str) -> tuple[float, ...]:
    """Metres of wavelengths separated by commas; a unit is also that of those before it without one.

    Raises:
        InputError: no unit, or not wavelengths of light.
    """
    unit, found = "", []
    for part in reversed(text.split(",")):
        own = part.lstrip("+-.0123456789eE ")
        unit = own or unit
        if not unit:
            raise InputError(f'{option} is "{text}": wavelengths end with a unit, such as "610, 540, 465 nm"')
        found.append(parse(part if own else part + unit, "length", option))
    return all_checked(option, found[::-1])


def memory_size(text: str, option: str = "--memory-limit") -> int:
    """Bytes of a size on the command line, "800 MB" or "1.5 GiB".

    Raises:
        InputError: no unit, or not a size above 0.
    """
    units = {"kb": 1e3, "mb": 1e6, "gb": 1e9, "tb": 1e12, "kib": 2**10, "mib": 2**20, "gib": 2**30, "tib": 2**40}
    count, unit = text.strip().rstrip("BbiIkKmMgGtT"), text.strip().lstrip("0123456789.eE+- ")
    size = number(count) * units.get(unit.lower(), math.nan)
    if not (size >= 1 and math.isfinite(size)):
        raise InputError(f'{option} is "{text}": a size has a number and a unit, like "800 MB" or "1.5 GiB"')
    return int(size)


def above_zero(text: str, option: str) -> float:
    """A number above 0.

    Raises:
        InputError: anything else.
    """
    found = number(text)
    if not (found > 0 and math.isfinite(found)):
        raise InputError(f'{option} is "{text}": it is a number above 0, like 0.8')
    return found


def whole_number(text: str, option: str) -> int:
    """A whole number; fractions are rejected, not rounded.

    Raises:
        InputError: anything else.
    """
    try:
        return int(text)
    except ValueError:
        raise InputError(f'{option} is "{text}": it is a whole number, like 3') from None


def duration(text: str, option: str) -> float:
    """Seconds of a time on the command line.

    Raises:
        InputError: no unit, or not a time.
    """
    return parse(text, "time", option)


Reader = Callable[[str, str], Any]
"""Function from the text of a value and the name of its option, for messages, to the value."""


def auto_or(read: Reader) -> Reader:
    """A reader that also accepts "auto"."""

    def read_either(text: str, option: str) -> Any:
        try:
            return "auto" if text == "auto" else read(text, option)
        except InputError as error:
            raise InputError(f"{error}, or auto") from None

    return read_either


def quantity(
    metavar: str,
    read: Reader,
    *,
    tokens: int = 1,
    repeated: bool = False,
    written: Callable[[Any], str] = str,
) -> Parameter:
    """How an option is parsed and its default is shown; a leading minus is part of its value.

    Args:
        metavar: placeholder for the value in help.
        read: parses a token, or each token if there are several.
        tokens: number of words of a value.
        repeated: whether it may be given more than once; the value is then a tuple.
        written: formats a default as one would type it.
    """

    def converter(_: Any, given: tuple[Token, ...]) -> Any:
        values = tuple(read(token.value, token.keyword or "") for token in given)
        return values if tokens > 1 or repeated else values[0]

    return Parameter(
        converter=converter,
        metavar=metavar,
        n_tokens=tokens,
        allow_leading_hyphen=True,
        show_choices=False,
        show_default=lambda default: None if default is None else written(default),
    )


Length = Annotated[float, quantity("LENGTH", length, written=short)]
Lengths = Annotated[float | tuple[float, float], quantity("LENGTH", lengths, written=short)]
Wavelengths = Annotated[
    tuple[float, ...],
    quantity("LENGTH,…", wavelengths, written=lambda given: ", ".join(short(each) for each in given)),
]
Number = Annotated[float, quantity("NUMBER", above_zero)]
Whole = Annotated[int, quantity("NUMBER", whole_number)]
Counts = Annotated[
    tuple[int, int], quantity("ROWS COLUMNS", whole_number, tokens=2, written=lambda two: "{} {}".format(*two))
]
Size = Annotated[int, quantity("SIZE", memory_size)]
Factor = Annotated[float | Literal["auto"], quantity("auto|NUMBER", auto_or(above_zero))]
Time = Annotated[float | Literal["auto"], quantity("auto|TIME", auto_or(duration))]

CameraFile = Annotated[Path, Parameter(help="The camera file, .toml.")]
LightFieldFile = Annotated[Path, Parameter(help="A folder of views, a file or a store.")]
Output = Annotated[Path, Parameter(alias="-o", metavar="FILE")]
File = Annotated[Path, Parameter(metavar="FILE")]
OutputFolder = Annotated[Path, Parameter(alias="-o", metavar="FOLDER")]
ShownLightField = Annotated[Path, Parameter(metavar="LIGHT_FIELD")]
OutputFile = Annotated[
    Path,
    Parameter(
        help="The output: a store (.zarr); or .npz, .mat, .png (all views in one), .mp4 (a flight through the "
        "views), a folder (no ending).",
    ),
]
FolderNames = Annotated[
    Literal["hci", "views"],
    Parameter(help="Names of views in a folder: as in the HCI benchmark (the default), or row and column."),
]
FileKind = Annotated[
    Literal["hci", "views", "eslf", "mosaic"],
    Parameter(
        help="For a folder, the names of its views: as in the HCI benchmark (hci, the default), or row and column "
        "(views). For one .png: the blocks of views of lenslets side by side (eslf, the default), or whole views "
        "(mosaic)."
    ),
]
ViewExposure = Annotated[
    float | Literal["auto"],
    quantity("auto|NUMBER", auto_or(above_zero), written=lambda factor: f"{factor:g}"),
    Parameter(
        help="Factor to the brightness of a folder's or film's views; auto shows the brightest parts white. Other "
        "formats keep the numbers, and do not support it."
    ),
]
Overwrite = Annotated[bool, Parameter(help="Replace an existing output.")]


def exposed(exposure: float | Literal["auto"], kind: Kind) -> dict[str, Any]:
    """Keyword arguments of the writer of a format for an exposure of views.

    Raises:
        InputError: the format has no exposure.
    """
    if exposure == 1:
        return {}
    if kind not in ("hci", "views", "mp4"):
        raise InputError("--exposure is for folders of views and films; others keep the numbers: leave it out")
    return {"exposure": exposure}


# --- records ---


def given_options(record: Any, *, but: tuple[str, ...] = ()) -> list[str]:
    """The options of a record that differ from their defaults, as typed."""
    fields = [field for field in dataclasses.fields(record) if field.name not in but]
    changed = [field.name for field in fields if getattr(record, field.name) != field.default]
    return [f"--{name.replace('_', '-')}" for name in changed]


@dataclass(frozen=True)
class Given:
    """A record of options; None and False mean that an option was not given."""

    def given(self, part: type["Given"] | None = None) -> dict[str, Any]:
        """The given options by name; with ``part``, only the fields that ``part`` has."""
        names = [field.name for field in dataclasses.fields(type(self) if part is None else part)]
        chosen = {name: getattr(self, name) for name in names}
        return {name: value for name, value in chosen.items() if value is not None and value is not False}


@Parameter(name="*", group=READING)
@dataclass(frozen=True, kw_only=True)
class ViewCameras(Given):
    """The cameras of the views, for what the files do not state.

    Args:
        spacing: Distance between neighbouring views with its unit, "1 mm"; two lengths, "1 mm, 2 mm", are for
            rows and columns. Default: from the files.
        slope_per_pixel: Pixel pitch over focal length of the cameras, no unit. Default: from the files.
        focus_distance: Where the views converge, "1.2 m", or inf if they are parallel. Default: from the files.
    """

    spacing: Lengths | None = None
    slope_per_pixel: float | None = None
    focus_distance: Length | None = None


@Parameter(name="*", group=READING)
@dataclass(frozen=True, kw_only=True)
class Arrangement(Given):
    """The arrangement of views, for files that do not state it.

    Args:
        views: Rows and columns of views, "9 9": for names with a single running number, for a video over a
            grid, and for one picture of all views, which requires it. Default: found from names, or from the
            pictures.
        order: Order of the views in names with a running number, or in the frames of a video: row by row
            (row-major), column by column, serpentine (every other row backwards), or the fields of one colour
            of a chessboard before the others (chess). Default: found from the pictures.
        every: For a video, use every Nth frame as a view. Default: all.
        layout: Layout of one picture of all views: a mosaic, whole views side by side, or eslf, the blocks of
            views of lenslets side by side. Default: found from the picture.
        files_outside: Let a views.csv name files outside of its folder. Only for lists that you trust.
    """

    views: Counts | None = None
    order: Order | None = None
    every: Whole | None = None
    layout: Layout | None = None
    files_outside: bool = False


@Parameter(name="*", group=READING)
@dataclass(frozen=True, kw_only=True)
class Reading(Arrangement, ViewCameras):
    """How a light field is read.

    Args:
        transfer: Encoding of the views' pixel values: srgb, as in pictures for viewing, linear (proportional
            to light), or auto: as the files state, srgb if they do not. as-is reads the stored numbers as
            linear, whatever the files state. A store contains linear light.
        orientation: Direction of rows and columns of views. auto checks it by parallax and corrects it; as-is
            uses the files as they are.
        missing: Views that are missing in a folder's grid: fill renders them from the others by depth and reports
            the estimated error; dark leaves them without light.
        wavelengths: Wavelength of each channel, "610, 540, 465 nm", for cameras that depend on it. Default: stated
            by the light field, if it is.
    """

    transfer: Literal["auto", "srgb", "linear", "as-is"] = "auto"
    orientation: Literal["auto", "as-is", "flip-rows", "flip-columns", "flip-both", "transpose"] = "auto"
    missing: Literal["refuse", "fill", "dark"] = "refuse"
    wavelengths: Wavelengths | None = None

    def light(self, path: Path) -> LightField | StoredLightField | StoredVideo:
        """As `light_field`, but a video is supported, too."""
        if not is_video(path):
            return self.light_field(path)
        self._check_nothing_told(path, "a video of stored light fields", but=("transfer",))
        return open_video(path)

    def light_field(self, path: Path) -> LightField | StoredLightField:
        """The light field at a path, read with a progress bar; a store is opened, not read.

        Raises:
            InputError: see `vcc.open_light_field`; a video; a store with camera options.
        """
        if is_store(path):
            self._check_nothing_told(path, "a store", but=("transfer", "wavelengths"))
            return self._with_wavelengths(open_store(path))
        told = {name: value for name, value in self.given().items() if name != "wavelengths"}
        with progress("Reading views") as advance:
            found = open_light_field(path, progress=advance, **told)
        return self._with_wavelengths(found)

    def _with_wavelengths(self, found: Field) -> Field:
        """The light field with the wavelengths that the user gave."""
        if self.wavelengths is None:
            return found
        with checks.within("--wavelengths"):
            return found.with_wavelengths(self.wavelengths)

    def _check_nothing_told(self, path: Path, kind: str, but: tuple[str, ...]) -> None:
        if names := given_options(self, but=but):
            raise InputError(f"{path} is {kind}, which states its cameras: leave out {', '.join(names)}")

    def in_memory(self, path: Path) -> LightField:
        """The light field at a path, read into memory."""
        field = self.light_field(path)
        return field if isinstance(field, LightField) else field.read()


@Parameter(name="*", group=MAKING)
@dataclass(frozen=True, kw_only=True, eq=False)
class Making(How):
    """How an image is made; the help is that of `How`, except that lengths and sizes have units here."""

    scene_distance: Annotated[
        Length | None,
        Parameter(
            help='Distance of the scene before the camera, "1.2 m", for the interpolation between views. Default: '
            "stated by the light field, or measured."
        ),
    ] = None
    refine: Annotated[int | Literal["auto"], quantity("auto|NUMBER", auto_or(whole_number))] = "auto"
    samples: Whole | None = None
    seed: Annotated[Whole, Parameter(name="--ray-seed")] = 0
    threads: Whole | None = None
    memory_limit: Annotated[
        Size | None,
        Parameter(
            help='Memory for reading a light field in a store in pieces, "1.5 GB". Default: 1 GiB. With rays, '
            "smaller pieces take more time, because all rays are traced for each piece."
        ),
    ] = None
    diffraction: Annotated[
        bool,
        Parameter(
            help="Convolve the image of each band with the spread of a point in focus by the camera's stop, by "
            'waves; needs a light field with wavelengths. See "Waves" in the docs for its error out of focus.'
        ),
    ] = False


def _for_people(docstring: str) -> str:
    """A record's docstring as help: initial capitals, code without quotes, None as a default."""
    text = re.sub(r"(?m)^( +\w+: )(\w)", lambda match: match[1] + match[2].upper(), docstring)
    text = re.sub(r'``"(\w+)"``', r"`\1`", text)
    text = re.sub(r";\s+None\s+does\s+not\.", ".", text)
    text = re.sub(r"[;.]\s+None\s+takes\s+", ". Default: ", text)
    return as_options(text.replace("`vcc.Camera.explain`", "`vcc explain`"))


Making.__doc__ = _for_people(How.__doc__ or "")
