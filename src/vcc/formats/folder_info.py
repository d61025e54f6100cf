"""Content of a folder of views or a file, and the cameras that it states."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.wavelengths import as_text
from vcc.fields.grid import Sample, pair
from vcc.files.pictures import read_picture
from vcc.files.spectral import wavelengths_in
from vcc.formats.cameras import Cameras, Pair
from vcc.formats.grid import DEFAULT_SPACING, Decoded, Geometry, ViewGrid
from vcc.formats.hci import parameters_file
from vcc.formats.views_with_metadata import ViewsWithMetadata


@dataclass(frozen=True, repr=False)
class FolderInfo(Brief):
    """Content of a folder of views, or of a file with a light field.

    Args:
        format: name of the format, for people.
        rows: number of rows of views.
        columns: number of columns of views.
        height: height of a view, pixels.
        width: width of a view, pixels.
        channels: colour channels; None for grey pictures.
        bits: bits per stored sample: 8, 16 or 32 (floating point).
        spacing: distance (dv, du) between neighbouring views, metres.
        slope_per_pixel: pixel pitch over focal length.
        focus_distance: distance at which the views converge, metres; infinite if parallel.
        disparity_range: (lowest, highest), pixels per view; None if not stated.
        unknown: names among spacing, slope_per_pixel and focus_distance that the folder does not state (or
            states without a unit), so that the value is a default.
        files: ``files[row][column]``, row 0 at the top, column 0 at the left; None for a missing view; empty for
            a light field in one file.
        directions: +1 or −1 for rows and columns of views: the sign of the steps between stated camera
            positions; None if the format states no positions.
        missing: (row, column) of the missing views.
        transfer: "srgb" or "linear", as defined by the format.
        frame: the full 5×5 frame if the format states one; spacing and the next two are then derived from it.
        notices: notices of the format's reader, each a sentence.
        sample: ``"mean"`` or ``"point"``, see `vcc.LightField`; ``"mean"`` unless the files state otherwise.
        metadata: metadata of the pictures of a folder.
        off_grid: root mean square distance of stated camera positions from an even grid, in its steps along rows
            and columns of views; None if the format states no positions.
        wavelengths: of the channels, metres; None if not stated.
    """

    format: str
    rows: int
    columns: int
    height: int
    width: int
    channels: int | None
    bits: int
    spacing: tuple[float, float]
    slope_per_pixel: float
    focus_distance: float
    disparity_range: tuple[float, float] | None
    unknown: tuple[str, ...]
    files: tuple[tuple[Path | None, ...], ...]
    directions: tuple[int, int] | None = None
    missing: tuple[tuple[int, int], ...] = ()
    transfer: Literal["srgb", "linear"] = "srgb"
    frame: Affine | None = None
    notices: tuple[str, ...] = ()
    sample: Sample = "mean"
    metadata: ViewsWithMetadata = field(default_factory=lambda: ViewsWithMetadata({}, None))
    off_grid: tuple[float, float] | None = None
    wavelengths: tuple[float, ...] | None = None

    @property
    def codes(self) -> tuple[Literal["as-is", "auto"], Literal["srgb", "linear"]]:
        """The ``transfer`` with which to open the stored numbers, and their transfer function.

        Numbers that were exposed or rotated on writing are available as linear light only.
        """
        return ("as-is", self.transfer) if self.metadata.is_neutral else ("auto", "linear")

    @property
    def picture_shape(self) -> tuple[int, ...]:
        """Shape of a view: (height, width) or (height, width, channels)."""
        return (self.height, self.width) + (() if self.channels is None else (self.channels,))


def info_of_grid(grid: ViewGrid) -> FolderInfo:
    """Content of a grid of files, from its first picture.

    Raises:
        InputError: a picture that cannot be read, or has another size than stated; pictures with contradictory
            metadata.
    """
    some = next(iter(grid.present.values()))
    first, bits = read_picture(some)
    stated = grid.geometry.picture_shape
    if stated not in (None, first.shape[:2]):
        raise InputError(
            f"{some} has {first.shape[1]}×{first.shape[0]} pixels, and {parameters_file(some.parent)} states "
            f"{stated[1]}×{stated[0]}. Correct image_resolution_x_px and image_resolution_y_px (and, if the "
            "pictures were cropped or scaled, sensor_size_mm, disp_min and disp_max)"
        )
    info = _info(grid.format, grid.shape, first.shape, bits, grid.geometry)
    info = replace(info, wavelengths=_wavelengths(grid))
    said = ViewsWithMetadata.of(grid.present.values())
    transfer = said.transfer or info.transfer
    return replace(info, files=grid.files, missing=grid.missing, transfer=transfer, metadata=said)


def _wavelengths(grid: ViewGrid) -> tuple[float, ...] | None:
    """The wavelengths that pictures state for their channels, or those of ``parameters.cfg``.

    Raises:
        InputError: pictures that state different ones.
    """
    some, *others = grid.present.values()
    known, source = grid.geometry.wavelengths, parameters_file(some.parent)
    if (stated := wavelengths_in(some)) is None:
        return known
    if known is None:
        known, source = stated, some
    for file in (some, *others):
        if (found := wavelengths_in(file)) != known:
            raise InputError(
                f"{file} states {as_text(found) if found else 'no wavelengths'}, and {source} {as_text(known)}: "
                "all views have the same bands"
            )
    return known


def info_of_file(decoded: Decoded) -> FolderInfo:
    """Content of a decoded file."""
    shape, bits = decoded.values.shape, decoded.values.dtype.itemsize * 8
    info = _info(decoded.format, shape[:2], shape[2:], bits, decoded.geometry)
    info = replace(info, transfer=decoded.transfer, notices=decoded.notices, frame=decoded.frame)
    if decoded.frame is None:
        return info
    linear = decoded.frame.linear
    vergence = linear[2, 0] / linear[0, 0] if linear[0, 0] else 0.0
    return replace(
        info,
        spacing=(abs(linear[1, 1]), abs(linear[0, 0])),
        slope_per_pixel=abs(linear[2, 2]),
        focus_distance=1 / vergence if vergence else math.inf,
        unknown=(),
    )


def _info(
    kind: str, views: tuple[int, ...], picture: tuple[int, ...], bits: int, geometry: Geometry
) -> FolderInfo:
    """Stated values, and defaults for the others."""
    stated = {
        "spacing": geometry.spacing is not None and not geometry.spacing_unit,
        "slope_per_pixel": geometry.slope_per_pixel is not None,
        "focus_distance": geometry.focus_distance is not None or geometry.disparity_at_infinity is not None,
    }
    spacing = geometry.spacing or (DEFAULT_SPACING, DEFAULT_SPACING)
    slope = 1 / max(picture[:2]) if geometry.slope_per_pixel is None else geometry.slope_per_pixel
    return FolderInfo(
        format=kind,
        rows=views[0],
        columns=views[1],
        height=picture[0],
        width=picture[1],
        channels=picture[2] if len(picture) == 3 else None,
        bits=bits,
        spacing=spacing,
        slope_per_pixel=slope,
        focus_distance=_focus(geometry, spacing[1], slope),
        disparity_range=geometry.disparity_range,
        unknown=tuple(name for name, known in stated.items() if not known),
        files=(),
        directions=geometry.directions,
        off_grid=geometry.off_grid,
        wavelengths=geometry.wavelengths,
        sample=geometry.sample,
    )


def _focus(geometry: Geometry, spacing: float, slope_per_pixel: float) -> float:
    """Distance at which the views converge; negative if their pictures are shifted apart."""
    if geometry.focus_distance is not None:
        return geometry.focus_distance
    shift = geometry.disparity_at_infinity
    return -spacing / (slope_per_pixel * shift) if shift else math.inf


@dataclass(frozen=True)
class Given:
    """The user's arguments on the cameras; None to use the files. See `vcc.formats.open_light_field`."""

    spacing: Pair | None
    slope_per_pixel: Pair | None
    focus_distance: float | None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the given values."""
        return tuple(name for name, value in vars(self).items() if value is not None)


def _both(name: str, given: Pair) -> tuple[float, float]:
    one, other = pair(given)
    return checks.above_zero(name, one), checks.above_zero(name, other)


def cameras_for(info: FolderInfo, stated: Geometry, given: Given, path: Path) -> Cameras | None:
    """The cameras of a folder or file; given values override stated ones. None if a frame is stated.

    Args:
        info: content of the folder or file.
        stated: geometry stated by the format.
        given: values given by the user.
        path: path for messages.

    Raises:
        InputError: a given value that contradicts a stated frame, views that do not converge, or a spacing,
            slope or focus distance of zero or less.
    """
    if info.frame is not None:
        if given.names:
            raise InputError(
                f"{path} ({info.format}) states its full frame, and {', '.join(f'{n}=' for n in given.names)} "
                "would contradict it. Leave that out; vcc.LightField.from_views takes cameras of your own"
            )
        return None
    spacing = _both("spacing", info.spacing if given.spacing is None else given.spacing)
    slope_given = info.slope_per_pixel if given.slope_per_pixel is None else given.slope_per_pixel
    slope = _both("slope_per_pixel", slope_given)
    focus = given.focus_distance
    if focus is None:
        focus = _focus(stated, spacing[1], slope[1]) if spacing[1] > 0 and slope[1] > 0 else math.inf
        if focus < 0:
            raise InputError(
                f"{path} ({info.format}) states that its pictures are shifted apart, by "
                f"{stated.disparity_at_infinity} pixels per view: its views converge nowhere. "
                "Pass focus_distance=…"
            )
    cameras = Cameras(spacing, slope, focus)
    cameras.frame((1, 1, 1, 1))  # raises before the slow reading
    return cameras
