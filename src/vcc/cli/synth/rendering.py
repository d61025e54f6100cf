"""Options that renderers share, and the rendering itself.

A renderer's command is a function that ends in `make`; `vcc.cli.app` names it.
"""

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter

from vcc.base import checks
from vcc.base.units import deg, mm, parse, short
from vcc.cli.console import progress, show
from vcc.cli.executing import Who, opened
from vcc.cli.options import Counts, Length, Lengths, Whole, quantity
from vcc.files.atomic import check_parent
from vcc.sources import CameraArray, Renderer, synthesize

WHERE = Group("Where the views are", sort_key=2)
HOW = Group("How they are rendered", sort_key=3)


def _angle(text: str, option: str) -> float:
    return parse(text, "angle", option)


Angle = Annotated[
    float,
    quantity("ANGLE", _angle, written=lambda angle: short(angle, "angle")),
]
Store = Annotated[Path, Parameter(alias="-o", metavar="STORE.zarr", help="The store to write or to resume.")]
Unit = Annotated[Length, Parameter(group=WHERE, help='Length of a unit of the scene, "1 m", "1 cm".')]
SampleType = Annotated[
    Literal["float16", "float32", "uint8", "uint16"],
    Parameter(
        group=HOW,
        help="Type of the stored samples: float16 and float32 hold linear radiance as it is; in uint8 and uint16 "
        "full scale is radiance 1, and brighter values are clipped.",
    ),
]
Samples = Annotated[Whole, Parameter(group=HOW, help="Paths per pixel.")]
Seed = Annotated[Whole, Parameter(group=HOW, help="Of the noise: the same seed gives the same views.")]
RenderedBy = Annotated[
    Who,
    Parameter(
        group=HOW,
        help="What renders the views, some in each task: `processes` or `threads`, one per core of this machine, "
        'or a Dask cluster by its scheduler, "dask://host:8786". Each task uses one thread. Default: one view '
        "after the other, on all cores.",
    ),
]
Variant = Annotated[
    str,
    Parameter(
        group=HOW,
        metavar="NAME",
        help="Variant of Mitsuba. auto is llvm_ad_rgb if the system has a suitable LLVM, otherwise scalar_rgb.",
    ),
]


@Parameter(name="*", group=WHERE)
@dataclass(frozen=True, kw_only=True)
class Views:
    """Where the views are; None leaves the choice to the scene.

    Args:
        views: Rows and columns of views.
        aperture: Side of the square that the views fill, "20 mm"; two lengths, "10 mm, 20 mm", are height and
            width.
        field_of_view: Angle that the width of a view spans, "40 deg".
        focus_distance: Where the views converge, "1.3 m", or inf for parallel.
    """

    views: Counts = (20, 20)
    aperture: Lengths | None = 20 * mm
    field_of_view: Angle | None = 40 * deg
    focus_distance: Length | None = 1.3

    def cameras(self, **otherwise: Any) -> CameraArray:
        """The cameras of the views.

        Args:
            otherwise: arguments of `CameraArray.over_aperture` for options that are None.

        Raises:
            InputError: see `CameraArray.over_aperture`.
        """
        asked = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        told = {name: value for name, value in asked.items() if value is not None}
        return CameraArray.over_aperture(**otherwise | told)


@dataclass(frozen=True, kw_only=True)
class ViewsAndPixels(Views):
    """Where the views are, and their resolution.

    Args:
        pixels: Rows and columns of a view's pixels.
    """

    pixels: Counts = (500, 500)


def check_store(path: Path) -> Path:
    """Check that a store can be written at this path, before a scene is loaded.

    Raises:
        InputError: a name that does not end in .zarr, or a folder that does not exist.
    """
    path = path.expanduser()
    checks.ending("a store", path, ".zarr")
    check_parent(path)
    return path


def make(renderer: Renderer, cameras: CameraArray, output: Path, dtype: str, executor: str | None = None) -> None:
    """Render all views into a store, with a progress bar, and print a summary.

    Raises:
        InputError: see `synthesize`.
    """
    try:
        with opened(executor) as running, progress("Rendering views") as advance:
            made = synthesize(renderer, cameras, output, dtype=dtype, executor=running, progress=advance)
    finally:
        close = getattr(renderer, "close", None)
        if close is not None:
            close()
    (rows, columns), (high, wide) = cameras.views, cameras.pixels
    show(f"{output}: {rows}×{columns} views of {high}×{wide} pixels, {made.shape[-1]} channels, {dtype}, linear")
