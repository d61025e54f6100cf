"""What a folder of views or a file holds, and the cameras that it states."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.grid import Sample, pair
from vcc.files.pictures import read_picture
from vcc.formats.cameras import Cameras, Pair
from vcc.formats.grid import DEFAULT_SPACING, Decoded, Geometry, ViewGrid
from vcc.formats.hci import parameters_file
from vcc.formats.views_with_metadata import ViewsWithMetadata


@dataclass(frozen=True, repr=False)
class FolderInfo(Brief):
    """What a folder of views, or a file with a light field, holds.

    Args:
        format: what its files follow, for people.
        rows: how many rows of views.
        columns: how many columns of views.
        height: of a view, pixels.
        width: of a view, pixels.
        channels: colour channels; None for grey pictures.
        bits: bits per stored sample: 8, 16 or 32 (floating point).
        spacing: distance (dv, du) between neighbouring views, metres.
        slope_per_pixel: pixel pitch over focal length.
        focus_distance: where the views converge, metres; infinite if parallel.
        disparity_range: (lowest, highest), pixels per view; None if not stated.
        unknown: which of spacing, slope_per_pixel and focus_distance the folder does not state (or
            not with a unit), so that a default stands above.
        files: ``files[row][column]``, row 0 at the top, column 0 at the left; None for a missing view; empty for
            a light field in one file.
        directions: +1 or −1 for rows and columns of views: whether the camera positions that the
            format states grow from one to the next; None if it states none.
        missing: (row, column) of the views that there are not.
        transfer: "srgb" or "linear", as the format has it.
        frame: the full 5×5 frame, where the format states one; spacing and the next two are then read from it.
        notices: of the format's reader, sentences.
        sample: ``"mean"`` or ``"point"``, see `vcc.LightField`; means unless the files say otherwise.
        metadata: of the pictures of a folder.
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

    @property
    def codes(self) -> tuple[Literal["as-is", "auto"], Literal["srgb", "linear"]]:
        """As which ``transfer`` to open it to have the stored numbers, and how these stand for light.

        Numbers that were exposed or turned when they were written are had as linear light only.
        """
        return ("as-is", self.transfer) if self.metadata.is_neutral else ("auto", "linear")

    @property
    def picture_shape(self) -> tuple[int, ...]:
        """Of a view: (height, width) or (height, width, channels)."""
        return (self.height, self.width) + (() if self.channels is None else (self.channels,))


def info_of_grid(grid: ViewGrid) -> FolderInfo:
    """What a grid of files holds, from its first picture.

    Raises:
        InputError: a picture that cannot be read, or of another size than stated; pictures that say contradictory
            things of their numbers.
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
    said = ViewsWithMetadata.of(grid.present.values())
    transfer = said.transfer or info.transfer
    return replace(info, files=grid.files, missing=grid.missing, transfer=transfer, metadata=said)


def info_of_file(decoded: Decoded) -> FolderInfo:
    """What a decoded file holds."""
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
    """What is stated, and defaults for what is not."""
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
        sample=geometry.sample,
    )


def _focus(geometry: Geometry, spacing: float, slope_per_pixel: float) -> float:
    """Where the views converge; negative where their pictures are shifted apart."""
    if geometry.focus_distance is not None:
        return geometry.focus_distance
    shift = geometry.disparity_at_infinity
    return -spacing / (slope_per_pixel * shift) if shift else math.inf


@dataclass(frozen=True)
class Given:
    """What a user says of the cameras; None for what is left to the files. See `vcc.formats.open_light_field`."""

    spacing: Pair | None
    slope_per_pixel: Pair | None
    focus_distance: float | None

    @property
    def names(self) -> tuple[str, ...]:
        """What is given."""
        return tuple(name for name, value in vars(self).items() if value is not None)


def _both(name: str, given: Pair) -> tuple[float, float]:
    one, other = pair(given)
    return checks.above_zero(name, one), checks.above_zero(name, other)


def cameras_for(info: FolderInfo, stated: Geometry, given: Given, path: Path) -> Cameras | None:
    """The cameras of a folder or file: what is given goes before what is stated. None where a frame is stated.

    Args:
        info: what it holds.
        stated: what its format states of the cameras.
        given: what the user says.
        path: how to name it in an error.

    Raises:
        InputError: something given that a stated frame contradicts, views that converge nowhere, or a spacing,
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
    cameras.frame((1, 1, 1, 1))  # refuse before the long reading
    return cameras
