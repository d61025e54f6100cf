"""``vcc synth depth``: views around one picture, from its depth map."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from vcc.base.errors import InputError
from vcc.cli import options as given
from vcc.cli import synth
from vcc.cli.console import show

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

_READING = "Reading the picture"


@synth.synth.command(
    epilog='Example:  vcc synth depth room.png room-depth.exr -o room.zarr --field-of-view "60 deg"\n\n'
    'Example:  vcc synth depth kinect.png kinect-depth.png -o out.zarr --depth-unit "1 mm"\n\n'
    'Example:  vcc synth depth view.png disparity.pfm -o out.zarr --meaning disparity --focus-distance "4 m"'
)
def depth(
    picture: Annotated[
        Path, typer.Argument(metavar="PICTURE", help="What the middle view sees.", show_default=False)
    ],
    depth_map: Annotated[
        Path,
        typer.Argument(
            metavar="DEPTH",
            help="Of the same pixels: .exr, .pfm, .npy, .tif or 16-bit .png; one channel.",
            show_default=False,
        ),
    ],
    output: synth.Output,
    views: synth.Views = (9, 9),
    aperture: synth.Aperture = "20 mm",
    field_of_view: synth.FieldOfView = "40 deg",
    focus_distance: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help='Where the views converge, "1.3 m", or inf for parallel. Default: in the middle of the scene.',
            show_default=False,
            rich_help_panel="Where the views are",
        ),
    ] = None,
    meaning: Annotated[
        Literal["depth", "disparity"],
        typer.Option(
            help="Whether DEPTH holds distances, or disparities in pixels per view, positive nearer "
            "than where they converge.",
            rich_help_panel=_READING,
        ),
    ] = "depth",
    depth_unit: Annotated[
        str,
        typer.Option(
            metavar="LENGTH",
            help='What a value of 1 in DEPTH stands for, "1 mm" in most 16-bit files.',
            rich_help_panel=_READING,
        ),
    ] = "1 m",
    transfer: Annotated[
        Literal["srgb", "linear"],
        typer.Option(help="How whole numbers in PICTURE stand for light.", rich_help_panel=_READING),
    ] = "srgb",
    dtype: synth.Dtype = "float16",
) -> None:
    """Make the views around a picture from its depth; what no picture shows is made up behind edges."""
    import numpy as np

    from vcc.base.units import parse
    from vcc.files.pictures import read_picture
    from vcc.files.transfer import decode
    from vcc.sources.depth_map import DepthMapScene

    output = synth.check_store(output)
    unit = parse(depth_unit, "length", "--depth-unit")
    samples = read_picture(picture)[0]
    full = np.iinfo(samples.dtype).max if samples.dtype.kind == "u" else 1
    radiance = decode(samples) if transfer == "srgb" else samples.astype(np.float32) / full
    distances = _depth_samples(depth_map)
    if distances.shape != radiance.shape[:2]:
        raise InputError(
            f"{depth_map} has {distances.shape[1]}×{distances.shape[0]} pixels, and {picture} has "
            f"{radiance.shape[1]}×{radiance.shape[0]}: they must be of the same pixels"
        )
    pixels = (radiance.shape[0], radiance.shape[1])
    if meaning == "disparity":
        if focus_distance is None:
            raise InputError("disparities are against where the views converge: give --focus-distance")
        cameras = synth.camera_array(views, pixels, aperture, field_of_view, focus_distance)
        scene = DepthMapScene.from_disparity(radiance, distances, cameras)
    else:
        distances = distances * unit
        bad = ~(distances > 0)
        if bad.any():
            row, column = (int(n) for n in np.argwhere(bad)[0])
            raise InputError(
                f"{depth_map} has no distance in {bad.sum()} pixels, the first at row {row}, column {column} "
                f"({distances[row, column]:g} m): fill them first"
            )
        if focus_distance is None:
            focus = 2 / (1 / distances.min() + 1 / distances.max())
            focus_distance = "inf" if math.isinf(focus) else f"{focus} m"
        else:
            given.length(focus_distance, "--focus-distance")
        cameras = synth.camera_array(views, pixels, aperture, field_of_view, focus_distance)
        scene = DepthMapScene.for_cameras(radiance, distances, cameras)
    synth.make(scene, cameras, output, dtype)
    corner = scene.uncovered(cameras.camera(0, 0))
    show(f"{float(corner.mean()):.1%} of the view in the corner was made up: behind edges and beyond the border")


def _depth_samples(path: Path) -> NDArray[np.float64]:
    """The numbers of a depth map as they are stored, (rows, columns).

    Raises:
        InputError: a file that cannot be read, or one with channels that differ.
    """
    import numpy as np

    from vcc.files.pictures import read_picture

    if path.suffix.lower() == ".pfm":
        from vcc.files.pfm import read_pfm

        return read_pfm(path).astype(np.float64)
    samples = np.asarray(read_picture(path)[0], dtype=np.float64)
    if samples.ndim == 3:
        if not (samples == samples[..., :1]).all():
            raise InputError(
                f"{path} has {samples.shape[2]} channels that differ: a depth map has one number a pixel"
            )
        samples = samples[..., 0]
    return samples
