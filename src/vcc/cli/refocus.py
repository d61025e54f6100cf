"""``vcc refocus``: refocused images of a light field, focal stacks, and images sharp everywhere."""

from typing import Annotated, Any

from cyclopts import Parameter, Token

from vcc.base.errors import InputError, warn_of_result
from vcc.cli.console import check_output, progress, show
from vcc.cli.options import (
    MAKING,
    Factor,
    Length,
    LightFieldFile,
    Output,
    Reading,
    Size,
    length,
)
from vcc.cli.store_words import BEYOND, places_of
from vcc.files.pictures import WRITE_ENDINGS
from vcc.formats.films import ENDINGS
from vcc.light_field import LightField
from vcc.plan.how import BetweenViews, Interpolation
from vcc.recover.focal_stack import focal_stack, focus_distances
from vcc.recover.refocus import refocused
from vcc.store import StoredLightField

PICTURES_WITHOUT_STACK = 16
"""Images that --all-in-focus uses without --stack."""


def _stack(_: Any, tokens: tuple[Token, ...]) -> tuple[float, ...]:
    """The distances of a focal stack from its nearest, farthest and number of images."""
    nearest, farthest, number = (token.value for token in tokens)
    if not number.isdecimal():
        raise InputError(
            f'--stack has "{number}" pictures: write two lengths and a whole number, "0.8 m" "3 m" 12'
        )
    return focus_distances(length(nearest, "--stack"), length(farthest, "--stack"), int(number))


def refocus(
    light_field: LightFieldFile,
    /,
    *,
    output: Output,
    distance: Length | None = None,
    stack: Annotated[
        tuple[float, ...] | None,
        Parameter(converter=_stack, n_tokens=3, metavar="NEAREST FARTHEST PICTURES", allow_leading_hyphen=True),
    ] = None,
    all_in_focus: bool = False,
    aperture: Length | None = None,
    exposure: Factor = "auto",
    frames_per_second: float = 8.0,
    interpolation: Annotated[Interpolation, Parameter(group=MAKING)] = "sharp",
    between_views: Annotated[BetweenViews, Parameter(group=MAKING)] = "auto",
    memory_limit: Size | None = None,
    reading: Reading = Reading(),
) -> None:
    """Refocus a light field at one distance, at many, or at all.

    Examples:
        vcc refocus views/ --distance "1.2 m" -o picture.png
        vcc refocus views/ --stack "0.8 m" "3 m" 12 -o stack.mp4
        vcc refocus views/ --all-in-focus -o sharp.png

    Args:
        output: An image, .png, .tif, .exr or .npy; for a focal stack a film, .mp4 or .gif.
        distance: Where to focus, "1.2 m", or inf.
        stack: A focal stack: "0.8 m" "3 m" 12 focuses at 12 distances in equal steps of blur.
        all_in_focus: One image of everything that is sharp anywhere in a focal stack; without --stack, of a
            stack over the scene's depth.
        aperture: Diameter of the round aperture, "10 mm". Default: all views.
        exposure: Factor from radiance to the brightness of an image for viewing. auto shows the brightest
            parts white and prints the factor.
        frames_per_second: Of a film.
        interpolation: Within a view; sharp is linear with its blur compensated.
        between_views: Whether to interpolate between views if neighbouring ones differ by more than a pixel:
            auto does along one parallax, if nothing is in focus; depth creates views in between by each
            pixel's own depth, which is estimated first and kept in a store; none never does.
        memory_limit: Memory for the images of a focal stack, "1.5 GB"; for one image, memory for reading a
            store in pieces. Default: 1 GiB for pieces.
    """
    if distance is not None and (stack is not None or all_in_focus):
        raise InputError("--distance is one picture: leave out --stack and --all-in-focus")
    if distance is None and stack is None and not all_in_focus:
        raise InputError(
            'where should it focus? Give --distance "1.2 m", --stack "0.8 m" "3 m" 12 or --all-in-focus'
        )
    film = stack is not None and not all_in_focus
    output = check_output(output, ENDINGS if film else WRITE_ENDINGS)
    options: dict[str, Any] = {
        "diameter": aperture,
        "interpolation": interpolation,
        "between_views": between_views,
        "memory_limit": memory_limit,
    }
    field = reading.light_field(light_field)
    if distance is not None:
        with progress("Refocusing") as advance:
            image = refocused(field, distance, **options, progress=advance)
        show(image.save(output, exposure=exposure).description)
        return
    with progress("Refocusing") as advance:
        pictures = focal_stack(field, stack or _distances_of(field), **options, progress=advance)
    if film:
        show(pictures.save(output, frames_per_second=frames_per_second, exposure=exposure))
    else:
        show(pictures.all_in_focus(memory_limit=memory_limit).image.save(output, exposure=exposure).description)


def _distances_of(field: LightField | StoredLightField) -> tuple[float, ...]:
    """Distances over the depth that a light field's parallax shows.

    Raises:
        InputError: it shows no depth, or the whole scene lies beyond infinity.
    """
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
    if field.distance_of(found[0]) < 0 and field.grid.disparity_of(float("inf")) - found[0] > BEYOND:
        warn_of_result(f"{places_of(field.grid, *found)}: see vcc info. Infinity is the farthest focus")
    farthest = 1 / vergences[0] if vergences[0] > 0 else float("inf")
    return focus_distances(1 / vergences[1], farthest, PICTURES_WITHOUT_STACK)
