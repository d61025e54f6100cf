"""``vcc decode`` of what a plenoptic camera recorded through its lenslets."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from cyclopts import Group, Parameter
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.cli.console import progress
from vcc.cli.lenslet_centres import grid_of
from vcc.cli.options import File, Whole
from vcc.cli.raw_recordings import RawRecording, Recorded, check_alike, check_camera, read_raw
from vcc.light_field import LightField
from vcc.recover import LensletGrid, decode_plenoptic, find_lenslets


@Parameter(name="*", group=Group("A camera with lenslets", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class Lenslets:
    """What there is of a camera with lenslets.

    Args:
        white: A recording of something evenly white by the same camera: micro-images are found in it, and the
            recording is divided by it.
        dark: A recording without light, subtracted from both.
        centres: Where the micro-images' centres are, .csv, .npy or .mat: two numbers each, pixels.
        centres_order: Which of the two numbers comes first. Default: what the first line of a .csv says, or x-y.
        centres_from: The number of the first pixel in them; 1 in lists made by MATLAB.
        color_filter: Of a mosaic, row by row: RGGB and its like. Default: what the camera or the Lytro file says.
        views: How many each way. Default: all that a circle in the micro-images holds.
        view_step: Between views, within a micro-image.
    """

    white: File | None = None
    dark: File | None = None
    centres: File | None = None
    centres_order: Literal["x-y", "row-column"] | None = None
    centres_from: Literal[0, 1] = 0
    color_filter: Annotated[str | None, Parameter(metavar="TILE")] = None
    views: Whole | None = None
    view_step: Annotated[float, Parameter(metavar="PIXELS")] = 1.0


def through_lenslets(
    path: Path, camera: Camera | None, recorded: Recorded, given: Lenslets
) -> tuple[LightField, str]:
    """The light field of a plenoptic camera, and how its micro-images were found, in words.

    Args:
        path: of the recording.
        camera: the optics, for a metric frame.
        recorded: how it was recorded.
        given: what there is of it besides.

    Raises:
        InputError: micro-images whose place nothing tells, or what `vcc.recover.decode_plenoptic` refuses.
    """
    if given.dark is not None and recorded.black is not None:
        raise InputError("--black is said pixel by pixel by --dark: leave it out")
    raw = read_raw(path, camera, given.color_filter, recorded)
    others = [
        None if each is None else read_raw(each, camera, given.color_filter, recorded)
        for each in (given.white, given.dark)
    ]
    for each in filter(None, (raw, *others)):
        check_alike(raw, each)
        check_camera(each, camera, recorded.camera)
    white, darkness = others
    dark = raw.black if darkness is None else darkness.numbers
    listed = None
    if given.centres is not None:
        bright = raw if white is None else white
        listed = grid_of(given.centres, given.centres_order, given.centres_from, bright)
    tile: Any = raw.color_filter
    with progress("Decoding"):
        grid, source = _lattice(raw, listed, white, dark, camera)
        field = decode_plenoptic(
            raw.numbers,
            grid,
            camera=camera,
            white=None if white is None else white.numbers,
            dark=_each_channel(dark, raw),
            color_filter=tile,
            views=given.views,
            view_step=given.view_step,
            memory_limit=recorded.memory_limit,
        )
    if white is None and raw.scale != 1:
        field = field.replaced(np.asarray(field.values) / np.float32(raw.scale))
    off = f", {grid.residual:.2f} pixels off it (rms)" if grid.residual else ""
    words = (
        f"micro-images {source}, a {grid.layout} lattice of {grid.pitch:.3f} pixels turned by "
        f"{np.degrees(grid.rotation):.2f}°{off}"
    )
    divided = "" if white is None else f"divided by {white.path.name}"
    return field, "; ".join(filter(None, (words, divided, raw.in_words)))


def _lattice(
    raw: RawRecording,
    listed: LensletGrid | None,
    white: RawRecording | None,
    dark: NDArray[Any] | None,
    camera: Camera | None,
) -> tuple[LensletGrid, str]:
    """Where the micro-images are, and who says so."""
    if listed is not None:
        return listed, "given centres"
    if white is not None:
        mosaic = raw.color_filter is not None
        return find_lenslets(white.numbers, dark=_each_channel(dark, raw), color_filter=mosaic), (
            f"found in {white.path.name}"
        )
    if camera is not None:
        return LensletGrid.of_camera(camera), "by the camera file"
    raise InputError(
        f"where the micro-images of {raw.path.name} are is not known: give --white (a recording of something "
        "evenly white by the same camera), --centres or --camera"
    )


def _each_channel(dark: NDArray[Any] | None, raw: RawRecording) -> NDArray[Any] | None:
    """What stands for no light, in as many channels as the recording has."""
    if dark is None or dark.ndim >= raw.numbers.ndim:
        return dark
    return np.broadcast_to(dark[..., None], raw.numbers.shape)
