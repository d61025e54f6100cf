"""``vcc decode``: from the raw recording of a computational camera to its light field."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from vcc.base.errors import InputError
from vcc.cli import options as given
from vcc.cli.console import progress, show

EPILOG = (
    "Example:  vcc decode raw.tif --camera camera.toml -o field.zarr\n\n"
    "Example:  vcc decode raw.tif --white white.tif --dark dark.tif --views 9 -o views\n\n"
    "Example:  vcc decode photo.lfp --white white.lfp -o field.zarr\n\n"
    "Example:  vcc decode raw.png --centres centres.csv --color-filter BGGR -o field.zarr"
)
_LENSLETS, _MASK, _OUTPUT = "A camera with lenslets", "A camera with a mask of cosines", "The light field"


def decode(
    recording: Annotated[
        Path,
        typer.Argument(
            metavar="RAW",
            help="The recording: a picture whose numbers are proportional to light, as vcc expose or a real "
            "camera writes it, or a Lytro file, .lfp or .lfr.",
            show_default=False,
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="OUT",
            help="What to make: a store (.zarr); or .npz, .mat, .png (ESLF), .mp4 (a flight through the views), a "
            "folder (no ending).",
            show_default=False,
        ),
    ],
    camera: Annotated[
        Path | None,
        typer.Option(
            metavar="CAMERA.toml",
            help="What recorded it: lenses and, last, an array of lenslets; or lenses and a mask of cosines. With "
            "it distances are right; without it only disparities are.",
            show_default=False,
        ),
    ] = None,
    black: Annotated[
        float | None,
        typer.Option(
            metavar="NUMBER",
            help="The number in RAW that stands for no light. Default: what --dark, the camera's electronics or "
            "the Lytro file say, or 0.",
            show_default=False,
        ),
    ] = None,
    upright: Annotated[
        bool,
        typer.Option(
            "--upright",
            help="The recording has been turned upright (vcc capture does that, vcc expose does not). Default: it "
            "is upside down, as it lies on a sensor.",
        ),
    ] = False,
    memory_limit: Annotated[
        str | None,
        typer.Option(metavar="SIZE", help='What the light field may take, "1.5 GB".', show_default=False),
    ] = None,
    white: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="A recording of something evenly white by the same camera: micro-images are found in it, and the "
            "recording is divided by it.",
            show_default=False,
            rich_help_panel=_LENSLETS,
        ),
    ] = None,
    dark: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="A recording without light, subtracted from both.",
            show_default=False,
            rich_help_panel=_LENSLETS,
        ),
    ] = None,
    centres: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Where the micro-images' centres are, .csv, .npy or .mat: two numbers each, pixels.",
            show_default=False,
            rich_help_panel=_LENSLETS,
        ),
    ] = None,
    centres_order: Annotated[
        Literal["x-y", "row-column"] | None,
        typer.Option(
            help="Which of the two numbers comes first. Default: what the first line of a .csv says, or x-y.",
            show_default=False,
            rich_help_panel=_LENSLETS,
        ),
    ] = None,
    centres_from: Annotated[
        int,
        typer.Option(
            min=0,
            max=1,
            metavar="0|1",
            help="The number of the first pixel in them; 1 in lists made by MATLAB.",
            rich_help_panel=_LENSLETS,
        ),
    ] = 0,
    color_filter: Annotated[
        str | None,
        typer.Option(
            metavar="TILE",
            help="Of a mosaic, row by row: RGGB and its like. Default: what the camera or the Lytro file says.",
            show_default=False,
            rich_help_panel=_LENSLETS,
        ),
    ] = None,
    views: Annotated[
        int | None,
        typer.Option(
            metavar="NUMBER",
            help="How many each way. Default: all that a circle in the micro-images holds.",
            show_default=False,
            rich_help_panel=_LENSLETS,
        ),
    ] = None,
    view_step: Annotated[
        float,
        typer.Option(metavar="PIXELS", help="Between views, within a micro-image.", rich_help_panel=_LENSLETS),
    ] = 1.0,
    calibration: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="A recording of something white through a pinhole in the middle of the aperture. Default: "
            "simulated.",
            show_default=False,
            rich_help_panel=_MASK,
        ),
    ] = None,
    border: Annotated[
        float,
        typer.Option(
            metavar="SHARE",
            help="Of the sensor, 0 to 0.25, that is faded out at each edge and cut off the views.",
            rich_help_panel=_MASK,
        ),
    ] = 0.1,
    kind: Annotated[
        Literal["hci", "views"] | None,
        typer.Option(
            help="Names of views in a folder: as the HCI benchmark has them (the default), or row and column.",
            show_default=False,
            rich_help_panel=_OUTPUT,
        ),
    ] = None,
    exposure: Annotated[
        str,
        typer.Option(
            metavar="NUMBER",
            help="Factor to the brightness of a folder's or film's views. auto shows the brightest parts white. "
            "Other formats keep the numbers.",
            rich_help_panel=_OUTPUT,
        ),
    ] = "auto",
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace what has that name.", rich_help_panel=_OUTPUT)
    ] = False,
) -> None:
    """Turn the raw recording of a plenoptic or mask-modulated camera into a light field.

    Where lenslets' micro-images are is taken from --centres, or found in --white, or follows from --camera.
    Through a mask of cosines, carriers follow from --camera.
    """
    from vcc.cli.convert import free_output
    from vcc.cli.raw_recordings import (
        described,
        grid_of,
        has_carrier,
        read_raw,
        through_a_mask,
        through_lenslets,
        write_light_field,
    )
    from vcc.files.camera_file import load_camera
    from vcc.formats.writing import kind_of

    factor, limit = given.exposure_of(exposure), given.memory_size(memory_limit)
    output = free_output(output, overwrite)
    told: Any = kind
    kind_of(output, told)  # an ending that is not known, before the work
    optics = None if camera is None else load_camera(camera)
    if optics is not None and has_carrier(optics):
        of_lenslets = {"--white": white, "--dark": dark, "--centres": centres, "--color-filter": color_filter}
        _refuse(of_lenslets | {"--views": views}, "is for lenslets, and this camera has a mask of cosines")
        raw = read_raw(recording, optics, None, black)
        shadow = None if calibration is None else read_raw(calibration, optics, None, black).light()
        with progress("Decoding"):
            field = through_a_mask(raw, optics, shadow, border, upright, limit)
        how = "spectral tiles rearranged, calibration " + ("simulated" if calibration is None else "given")
    else:
        _refuse({"--calibration": calibration}, "is for a mask of cosines, and there is none")
        if dark is not None:
            _refuse({"--black": black}, "is said pixel by pixel by --dark")
        raw = read_raw(recording, optics, color_filter, black)
        even = None if white is None else read_raw(white, optics, color_filter, black)
        without_light = raw.black if dark is None else read_raw(dark, optics, color_filter, None).numbers
        grid = None
        if centres is not None:
            grid = grid_of(centres, centres_order, centres_from, raw if even is None else even)
        with progress("Decoding"):
            field, how = through_lenslets(
                raw, grid, optics, even, without_light, (views, view_step), upright, limit
            )
    write_light_field(field, output, kind, factor, overwrite, recording)
    show(f"  made of {recording}: {how}")
    show("\n".join(described(field, optics, output)))


def _refuse(told: dict[str, Any], why: str) -> None:
    """Options that mean nothing for this camera."""
    if wrong := [name for name, value in told.items() if value is not None]:
        raise InputError(f"{', '.join(wrong)} {why}: leave it out")
