"""``vcc spectrum``: the 4-D spectrum of a light field, drawn across two of its coordinates."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from vcc.cli import options as given
from vcc.cli.console import check_output, show

EPILOG = (
    "Example:  vcc spectrum views/ -o spectrum.png\n\n"
    "Example:  vcc spectrum scene.zarr -o section.svg --across vt --of section"
)


def spectrum(
    light_field: given.LightFieldFolder,
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar="FILE", help="The drawing, .png, .svg or .pdf.", show_default=False
        ),
    ],
    across: Annotated[
        Literal["us", "vt", "uv", "st", "ut", "vs"],
        typer.Option(help="The two coordinates: the frequency of the first runs to the right."),
    ] = "us",
    of: Annotated[
        Literal["power", "section"],
        typer.Option(
            help="power sums over the other two frequencies; section takes the plane through their zero."
        ),
    ] = "power",
    window: Annotated[
        Literal["hann", "none"],
        typer.Option(help="hann: let pictures fade towards their borders, which otherwise show as a cross."),
    ] = "hann",
    memory_limit: Annotated[
        str | None,
        typer.Option(
            metavar="SIZE",
            help='What the spectrum may take, "1.5 GB", at 8 bytes a sample. Default: 4 GiB.',
            show_default=False,
        ),
    ] = None,
    transfer: given.Transfer = "auto",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
) -> None:
    """Draw the spectrum of a light field: where its detail lies in frequency, and how optics would shear it."""
    output = check_output(output, (".png", ".svg", ".pdf"))
    limit = given.memory_size(memory_limit)
    field = given.read_light_field(light_field, transfer, spacing, slope_per_pixel, focus_distance, orientation)
    from vcc.analysis import fft4, plot_spectrum
    from vcc.analysis.spectrum import check_size
    from vcc.files.atomic import atomic_path
    from vcc.light_field import LightField

    if not isinstance(field, LightField):
        check_size(field.grid.shape, limit, "the spectrum")  # before anything is read
        field = field.read()
    pictures_only = [None, None, "hann", "hann"]  # there are too few views to fade
    found = fft4(field, pictures_only if window == "hann" else None, memory_limit=limit)
    axes = plot_spectrum(found, (across[0], across[1]), of=of)
    with atomic_path(output) as temporary:
        axes.figure.savefig(temporary)  # type: ignore[union-attr]  # a new figure is no part of another
    show(f"{output}: written")
