"""The HCI 4D light field benchmark (Honauer et al. 2016): ``input_CamNNN.png`` and ``parameters.cfg``.

INRIA's synthetic light fields use the same camera file with other names.
"""

from __future__ import annotations

import configparser
import math
import re
from pathlib import Path

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.reading import number, read_bytes, read_text
from vcc.base.units import mm, nm
from vcc.base.wavelengths import wavelengths as all_checked
from vcc.fields.grid import Sample
from vcc.formats.cameras import Cameras
from vcc.formats.grid import Geometry, Place, ViewGrid, arrange, pictures_in, stated_sample

PARAMETERS = "parameters.cfg"
KIND = "HCI 4D light-field benchmark"
_FOCAL_LENGTH = 100 * mm
"""Focal length to write: only its ratio to the sensor size is known, and HCI's scenes have 100 mm."""

_NAME = re.compile(r"input_Cam(\d+)", re.IGNORECASE)


def find(folder: Path, *, sparse: bool = False) -> ViewGrid | None:
    """The grid of the ``input_CamNNN`` pictures, NNN = row × columns + column; None if there are none.

    ``parameters.cfg`` states the grid and the cameras. Without this file the grid must be square.

    Raises:
        InputError: an invalid ``parameters.cfg``, a number of views that is not a square (without this file),
            or as in `vcc.formats.grid.arrange`.
    """
    numbered = {file: int(match[1]) for file in pictures_in(folder) if (match := _NAME.fullmatch(file.stem))}
    if not numbered:
        return None
    stated = read_grid_shape(folder)
    rows, columns = stated or _square(list(numbered.values()), folder)
    places = [Place(n // columns, n % columns, file) for file, n in numbered.items()]
    files = arrange(places, folder, (range(rows), range(columns)), sparse=sparse)
    return ViewGrid(KIND, files, read_geometry(folder) or Geometry())


def read_grid_shape(folder: Path) -> tuple[int, int] | None:
    """(rows, columns) of views stated by ``parameters.cfg``; None without this file.

    Raises:
        InputError: the file is invalid.
    """
    settings = _settings(folder)
    if settings is None:
        return None
    rows, columns = (_number(settings, "extrinsics", f"num_cams_{axis}", folder) for axis in "yx")
    if rows < 1 or columns < 1 or rows % 1 or columns % 1:
        raise InputError(f"{parameters_file(folder)} states a grid of {rows:g}×{columns:g} cameras")
    return int(rows), int(columns)


def read_geometry(folder: Path) -> Geometry | None:
    """The cameras of ``parameters.cfg``; None without this file.

    spacing = baseline_mm, slope per pixel = sensor_size_mm / focal_length_mm / max(W, H), and a
    focus_distance_m of 0 means parallel cameras. The disparity in pixels per view is b·f_px·(1/Z − 1/F),
    positive if nearer than the focus distance. An additional entry of this package, baseline_y_mm, states the
    spacing of rows if it differs.

    Raises:
        InputError: the file is invalid.
    """
    settings = _settings(folder)
    if settings is None:
        return None

    def positive(section: str, key: str) -> float:
        return checks.above_zero(f"{parameters_file(folder)}: {key}", _number(settings, section, key, folder))

    width = positive("intrinsics", "image_resolution_x_px")
    height = positive("intrinsics", "image_resolution_y_px")
    baseline = positive("extrinsics", "baseline_mm") * mm
    between_rows = baseline
    if not math.isnan(_number(settings, "extrinsics", "baseline_y_mm", folder, required=False)):
        between_rows = positive("extrinsics", "baseline_y_mm") * mm
    sensor = positive("intrinsics", "sensor_size_mm") * mm
    focal_length = positive("intrinsics", "focal_length_mm") * mm
    focus = _number(settings, "extrinsics", "focus_distance_m", folder)
    checks.zero_or_more(f"{parameters_file(folder)}: focus_distance_m", focus)
    low = _number(settings, "meta", "disp_min", folder, required=False)
    high = _number(settings, "meta", "disp_max", folder, required=False)
    return Geometry(
        spacing=(between_rows, baseline),
        slope_per_pixel=sensor / focal_length / max(width, height),
        focus_distance=focus if focus > 0 else math.inf,
        disparity_range=(low, high) if low <= high else None,  # NaN if not stated
        picture_shape=(int(height), int(width)),
        sample=stated_sample(settings.get("meta", "sample", fallback=None), f"{parameters_file(folder)}: sample"),
        wavelengths=_wavelengths(settings, folder),
    )


def parameters_text(
    views: tuple[int, int],
    picture: tuple[int, int],
    cameras: Cameras,
    scene: str,
    *,
    disparity_range: tuple[float, float] | None = None,
    sample: Sample = "mean",
    wavelengths: tuple[float, ...] | None = None,
) -> str:
    """The text of a ``parameters.cfg`` that `read_geometry` reads as these cameras.

    Args:
        views: (rows, columns).
        picture: (height, width) of a view in pixels, which are square.
        cameras: cameras of the views.
        scene: name of the scene.
        disparity_range: (lowest, highest), pixels per view, if known.
        sample: meaning of a sample.
        wavelengths: of the channels, metres, if known.
    """
    rows, columns = views
    height, width = picture
    between_rows, baseline = cameras.spacing
    sensor = cameras.slope_per_pixel[1] * max(width, height) * _FOCAL_LENGTH
    lines = [
        "[intrinsics]",
        f"focal_length_mm = {_FOCAL_LENGTH / mm!r}",
        f"image_resolution_x_px = {width}",
        f"image_resolution_y_px = {height}",
        f"sensor_size_mm = {sensor / mm!r}",
        "",
        "[extrinsics]",
        f"num_cams_x = {columns}",
        f"num_cams_y = {rows}",
        f"baseline_mm = {baseline / mm!r}",
        *([f"baseline_y_mm = {between_rows / mm!r}"] if between_rows != baseline else []),
        f"focus_distance_m = {0.0 if cameras.are_parallel else cameras.focus_distance!r}",
        *(f"center_cam_{name} = 0.0" for name in ("x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad")),
        "",
        "[meta]",
        f"scene = {' '.join(scene.split())}",
    ]
    if disparity_range is not None:
        low, high = map(float, disparity_range)
        lines += [f"disp_min = {low!r}", f"disp_max = {high!r}"]
    if sample != "mean":
        lines.append(f"sample = {sample}")
    if wavelengths is not None:
        lines.append(f"wavelengths_nm = {', '.join(repr(round(each / nm, 9)) for each in wavelengths)}")
    return "\n".join(lines) + "\n"


def parameters_file(folder: Path) -> Path | None:
    """The folder's ``parameters.cfg``, else the only .cfg file with the same sections (INRIA's), else None."""
    path = folder / PARAMETERS
    if path.is_file():
        return path
    others = [file for file in sorted(folder.glob("*.cfg")) if b"[extrinsics]" in read_bytes(file, "camera file")]
    if len(others) > 1:
        raise InputError(
            f"{folder} has {len(others)} camera files, {', '.join(file.name for file in others)}. "
            "Leave the right one there"
        )
    return others[0] if others else None


def _wavelengths(settings: configparser.ConfigParser, folder: Path) -> tuple[float, ...] | None:
    """An entry of ours: nanometres, one for each channel."""
    stated = settings.get("meta", "wavelengths_nm", fallback=None)
    if stated is None:
        return None
    place = f"{parameters_file(folder)}: wavelengths_nm"
    try:
        given = [float(each) * nm for each in stated.replace(",", " ").split()]
    except ValueError:
        raise InputError(f'{place} is "{stated}": write numbers, such as 610, 540, 465') from None
    return all_checked(place, given)


def _settings(folder: Path) -> configparser.ConfigParser | None:
    path = parameters_file(folder)
    if path is None:
        return None
    settings = configparser.ConfigParser(interpolation=None, strict=False)
    try:
        settings.read_string(read_text(path, "camera file"))
    except configparser.Error as error:
        raise InputError(f"{path} cannot be read as an HCI camera file: {' '.join(str(error).split())}") from None
    return settings


def _number(
    settings: configparser.ConfigParser | None,
    section: str,
    key: str,
    folder: Path,
    *,
    required: bool = True,
) -> float:
    """A number of the file; NaN for an optional one that is missing."""
    text = settings.get(section, key, fallback=None) if settings is not None else None
    if text is None:
        if not required:
            return math.nan
        raise InputError(f"{parameters_file(folder)} does not state {key} in its section [{section}]. Add it")
    value = number(text)
    if not math.isfinite(value):
        raise InputError(f'{parameters_file(folder)}: {key} is "{text}", not a number')
    return value


def _square(numbers: list[int], folder: Path) -> tuple[int, int]:
    """The side of the square grid of these views, from their count or their last number."""
    side = math.isqrt(len(numbers))
    if side * side != len(numbers):
        side = math.isqrt(max(numbers) + 1)
        if side * side != max(numbers) + 1:
            raise InputError(
                f"{folder} holds {len(numbers)} views input_CamNNN, which is not a square grid, "
                "and no "
                f"{PARAMETERS} that states num_cams_x and num_cams_y. Add that file or a views.csv"
            )
    return side, side
