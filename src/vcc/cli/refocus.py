"""``vcc refocus``: pictures of a light field focused elsewhere, focal stacks, and what is sharp in all of them."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vcc.base.errors import InputError
from vcc.cli import options as given
from vcc.cli.console import check_output, progress, show

if TYPE_CHECKING:
    from vcc.light_field import LightField
    from vcc.store import StoredLightField

EPILOG = (
    'Example:  vcc refocus views/ --distance "1.2 m" -o picture.png\n\n'
    'Example:  vcc refocus views/ --stack "0.8 m" "3 m" 12 -o stack.mp4\n\n'
    "Example:  vcc refocus views/ --all-in-focus -o sharp.png"
)
PICTURES_WITHOUT_STACK = 16
"""How many pictures --all-in-focus takes where --stack does not say."""


def refocus(
    light_field: given.LightFieldFolder,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="A picture, .png, .tif, .exr or .npy; of a focal stack a film, .mp4 or .gif.",
            show_default=False,
        ),
    ],
    distance: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help='Where to focus, "1.2 m", or inf.', show_default=False),
    ] = None,
    stack: Annotated[
        tuple[str, str, int] | None,
        typer.Option(
            metavar="NEAREST FARTHEST PICTURES",
            help='A focal stack: "0.8 m" "3 m" 12 focuses on 12 distances in equal steps of blur.',
            show_default=False,
        ),
    ] = None,
    all_in_focus: Annotated[
        bool,
        typer.Option(
            "--all-in-focus",
            help="One picture of all that is sharp in any of a focal stack; without --stack of one over the "
            "scene's depth.",
        ),
    ] = False,
    aperture: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help='Diameter of the round aperture, "10 mm". Default: all views.',
            show_default=False,
        ),
    ] = None,
    exposure: Annotated[
        str,
        typer.Option(
            metavar="NUMBER",
            help="Factor from radiance to the brightness of a picture for people. auto shows the brightest parts "
            "white and says which factor that took.",
        ),
    ] = "auto",
    frames_per_second: Annotated[float, typer.Option(metavar="NUMBER", help="Of a film.")] = 8.0,
    interpolation: given.Interpolation = "sharp",
    between_views: given.BetweenViews = "auto",
    memory_limit: Annotated[
        str | None,
        typer.Option(
            metavar="SIZE",
            help='What the pictures of a focal stack may take, "1.5 GB"; of one picture, what reading a store in '
            "pieces may. Default: 1 GiB for pieces.",
            show_default=False,
        ),
    ] = None,
    transfer: given.Transfer = "auto",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
) -> None:
    """Focus a light field on a distance after the fact, on many, or on all of them."""
    if distance is not None and (stack is not None or all_in_focus):
        raise InputError("--distance is one picture: leave out --stack and --all-in-focus")
    if distance is None and stack is None and not all_in_focus:
        raise InputError(
            'where should it focus? Give --distance "1.2 m", --stack "0.8 m" "3 m" 12 or --all-in-focus'
        )
    from vcc.files.pictures import WRITE_ENDINGS
    from vcc.recover.focal_stack import ENDINGS, focal_stack, focus_distances
    from vcc.recover.refocus import refocused

    film = stack is not None and not all_in_focus
    output = check_output(output, ENDINGS if film else WRITE_ENDINGS)
    factor = given.exposure_of(exposure)
    where, limit = given.length(distance, "--distance"), given.memory_size(memory_limit)
    options: dict[str, Any] = {
        "diameter": given.length(aperture, "--aperture"),
        "interpolation": interpolation,
        "between_views": between_views,
    }
    distances = None
    if stack is not None:
        ends = [given.length(each, "--stack") or 0.0 for each in stack[:2]]
        distances = focus_distances(ends[0], ends[1], stack[2])
    field = given.read_light_field(light_field, transfer, spacing, slope_per_pixel, focus_distance, orientation)
    if where is not None:
        with progress("Refocusing") as advance:
            image = refocused(field, where, **options, memory_limit=limit, progress=advance)
        show(image.save(output, exposure=factor).description)
        return
    with progress("Refocusing") as advance:
        chosen = distances or _distances_of(field)
        pictures = focal_stack(field, chosen, **options, memory_limit=limit, progress=advance)
    if film:
        show(pictures.save(output, frames_per_second=frames_per_second, exposure=factor))
    else:
        show(pictures.all_in_focus(memory_limit=limit).image.save(output, exposure=factor).description)


def _distances_of(field: LightField | StoredLightField) -> tuple[float, ...]:
    """Distances over the depth that a light field's parallax shows.

    Raises:
        InputError: it shows none, or things beyond infinity.
    """
    from vcc.recover.focal_stack import focus_distances

    found = field.measured_disparity_range()
    if found is None:
        raise InputError(
            "the depth of the scene cannot be measured from this light field (too few views, or no texture): "
            'give it with --stack "0.8 m" "3 m" 12'
        )
    vergences = sorted(max(1 / field.distance_of(each), 0.0) for each in found)
    if vergences[1] == 0:
        raise InputError(
            "all of the scene seems to lie beyond infinity: the spacing, focus distance or orientation of the "
            "views is wrong, see vcc info"
        )
    farthest = 1 / vergences[0] if vergences[0] > 0 else float("inf")
    return focus_distances(1 / vergences[1], farthest, PICTURES_WITHOUT_STACK)
