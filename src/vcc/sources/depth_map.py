"""A light field from one image and its depth map: surfaces are cut at depth jumps, and hidden parts are inpainted.

The image is converted to surfaces over its pixels (one mesh each), which are drawn for every view (layered
depth images, Shade et al. 1998):

1. A jump in depth, as opposed to a slope, cuts the surface. Mixed pixels along a cut are separated into the
   colours of the near and the far side and the fraction of the near side; the outline is where this fraction is
   ½, so it lies between pixels instead of along their borders.
2. Behind the near side of each cut, as far as any view can see, the far side is extended: its depth along its
   own slope, its image mirrored at the cut. The border of the image is extended likewise: constant depth, mirrored
   image.
3. A view draws all surfaces with a depth test, with several samples per pixel that are then averaged.
"""

from __future__ import annotations

import hashlib
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks, lazy_import
from vcc.base.errors import InputError
from vcc.fields.grid import pair
from vcc.sources.views import CameraArray, ViewCamera

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_SLOPE_FACTOR = 3.0
"""A depth step is a jump if it is this many times the smaller of its two neighbouring steps."""
_WINDOW = 3
"""Radius in pixels of the search for unmixed colours of both sides of a cut."""


class DepthMapScene:
    """The views around one image, from its depth map; a renderer for `vcc.sources.synthesize`.

    Parts that the image does not show are inpainted to look plausible; `uncovered` returns them. Surfaces are
    Lambertian (no highlights or mirrors) and opaque, and only one surface is extended behind each edge. Samples
    are interpolated linearly, which blurs detail near the pixel size.

    Args:
        radiance: the image, linear, (rows, columns) or (rows, columns, 3), as seen by the pinhole at the centre
            of the array; row 0 at the top.
        depth: distance of each pixel along the axis, metres, (rows, columns); infinite for the sky.
        slope_per_pixel: pixel pitch over focal length of the image: one number or (pt, ps).
        reach: maximum distance of a view from the centre along either axis, metres; a larger reach needs more
            inpainting.
        focus_distance: distance at which the views will converge, metres; infinite for parallel views. It
            determines how far views see past the border of the image.
        edge: a jump in depth is cut if it opens a gap of at least this many pixels in a view at ``reach``.
        supersampling: samples along each axis that are averaged for one pixel of a view.

    Raises:
        InputError: shapes that do not match, radiance that is negative or not finite, a depth that is 0,
            negative or NaN, a slope, reach, focus distance or edge that is not above 0, or a scene so near that
            a view would need more than four times the image.
    """

    def __init__(
        self,
        radiance: ArrayLike,
        depth: ArrayLike,
        slope_per_pixel: float | tuple[float, float],
        *,
        reach: float,
        focus_distance: float = math.inf,
        edge: float = 1.0,
        supersampling: int = 2,
    ) -> None:
        picture, distance = np.asarray(radiance, dtype=np.float64), np.asarray(depth, dtype=np.float64)
        if picture.ndim == 2:
            picture = np.repeat(picture[..., None], 3, axis=-1)
        if picture.ndim != 3 or picture.shape[2] != 3 or min(picture.shape) < 2:
            raise InputError(
                f"radiance has (rows, columns) and 1 or 3 channels, not the shape {np.shape(radiance)}"
            )
        if distance.shape != picture.shape[:2]:
            raise InputError(
                f"the depth map has the shape {distance.shape}, and the picture {picture.shape[:2]}: "
                "they are of the same pixels"
            )
        checks.all_finite("radiance", picture)
        checks.none_negative("radiance", picture)
        if not (distance > 0).all():
            where = tuple(int(n) for n in np.argwhere(~(distance > 0))[0])
            raise InputError(
                f"depth must be above 0 m in every pixel, and at {where} (row, column) it is "
                f"{distance[where]}; use infinity for the sky"
            )
        slopes = pair(slope_per_pixel)
        for name, value in (("slope_per_pixel", min(slopes)), ("reach", reach), ("edge", edge)):
            checks.above_zero(name, value)
        self.slopes, self.reach, self.edge = slopes, float(reach), float(edge)
        self.supersampling = checks.whole_number_between("supersampling", supersampling, 1, 16)
        self.focus_distance = checks.above_zero("focus_distance", focus_distance, unit="m", infinite=True)
        self._picture, self._vergence = picture, 1 / distance
        farthest = float(np.abs(self._vergence - 1 / self.focus_distance).max())
        margins = [self.reach * farthest / slope for slope in slopes]
        for margin, size in zip(margins, picture.shape, strict=False):
            if margin > 1.5 * size:
                raise InputError(
                    f"views {self.reach:g} m from the middle see things up to {margin:.0f} pixels from where the "
                    f"picture of {size} has them (the nearest are {distance.min():g} m away): nearly all would be "
                    "made up. Take a smaller reach, or views that converge on the scene"
                )
        self._margin = (math.ceil(margins[0]) + 2, math.ceil(margins[1]) + 2)
        self._surfaces: list[_Surface] | None = None

    @classmethod
    def for_cameras(
        cls, radiance: ArrayLike, depth: ArrayLike, cameras: CameraArray, **options: Any
    ) -> DepthMapScene:
        """A scene for an array whose central camera took the image, with the array's slope per pixel and extent.

        Args:
            radiance: see the class.
            depth: see the class.
            cameras: the array; in a converging array, each view shows the centre of the image.
            options: further arguments of the class.

        Raises:
            InputError: as in the class.
        """
        extents = [(n - 1) / 2 * d for n, d in zip(cameras.views, cameras.spacings, strict=True)]
        reach = max(*extents, 1e-3 * min(cameras.spacings))  # a single view has no extent
        return cls(
            radiance,
            depth,
            cameras.slopes_per_pixel,
            reach=reach,
            focus_distance=cameras.focus_distance,
            **options,
        )

    @classmethod
    def from_disparity(
        cls, radiance: ArrayLike, disparity: ArrayLike, cameras: CameraArray, **options: Any
    ) -> DepthMapScene:
        """A scene from disparities in pixels per view along u: d = du·(1/Z − 1/F)/ps, positive before the focus.

        Args:
            radiance: see the class.
            disparity: (rows, columns).
            cameras: the array to which the disparities refer.
            options: further arguments of the class.

        Raises:
            InputError: disparities of objects beyond infinity, or as in the class.
        """
        vergence = (
            np.asarray(disparity, dtype=np.float64) * cameras.slopes_per_pixel[1] / cameras.spacings[1]
            + 1 / cameras.focus_distance
        )
        if not (vergence >= 0).all():
            lowest = cameras.disparity(math.inf)
            raise InputError(
                f"disparities go down to {np.nanmin(disparity):g} pixels a view, and infinitely far points have "
                f"{lowest:g}: a nearer focus distance of the cameras, or a larger spacing, makes them fit"
            )
        with np.errstate(divide="ignore"):
            return cls.for_cameras(radiance, 1 / vergence, cameras, **options)

    def description(self) -> dict[str, Any]:
        """Everything that the images depend on except the cameras; image and depth map by their SHA-256."""
        digest = hashlib.sha256(np.ascontiguousarray(self._picture).tobytes())
        digest.update(np.ascontiguousarray(self._vergence).tobytes())
        return {
            "renderer": "depth map",
            "pixels": list(self._vergence.shape),
            "sha256": digest.hexdigest(),
            "slope_per_pixel": list(self.slopes),
            "reach": self.reach,
            "focus_distance": None if math.isinf(self.focus_distance) else self.focus_distance,
            "edge": self.edge,
            "supersampling": self.supersampling,
        }

    def render(self, camera: ViewCamera) -> NDArray[np.float32]:
        """Render the image of one view.

        Args:
            camera: position and viewing direction of the view.

        Returns:
            Linear radiance, (rows, columns, 3), row 0 at the top.

        Raises:
            InputError: a camera beyond the reach, or one that looks past the extended image.
        """
        return np.ascontiguousarray(self._drawn(camera)[..., :3])

    def uncovered(self, camera: ViewCamera) -> NDArray[np.float32]:
        """The fraction of each pixel of a view that was inpainted, 0 to 1, (rows, columns).

        Raises:
            InputError: as in `render`.
        """
        return np.asarray(1 - self._drawn(camera)[..., 3])

    def _drawn(self, camera: ViewCamera) -> NDArray[np.float32]:
        self._check(camera)
        if self._surfaces is None:
            self._surfaces = _surfaces(
                self._picture, self._vergence, self._margin, self.slopes, self.reach, self.edge
            )
        fine = self.supersampling
        rows, columns = camera.pixels[0] * fine, camera.pixels[1] * fine
        scale = (columns / (camera.right - camera.left), rows / (camera.bottom - camera.top))
        nearest = np.full((rows, columns), -1.0, np.float32)
        out = np.zeros((rows, columns, 4), np.float32)
        across, down = (
            (np.arange(size + 2 * margin) - margin - (size - 1) / 2) * slope
            for size, margin, slope in zip(
                self._vergence.shape[::-1], self._margin[::-1], self.slopes[::-1], strict=True
            )
        )
        offset = (-camera.left * scale[0] - 0.5, -camera.top * scale[1] - 0.5)
        pinhole = _Pinhole(across, down, offset, scale, (camera.x, camera.y))
        kernels = lazy_import.module("vcc.sources.depth_kernels")
        for surface in self._surfaces:
            kernels.draw_surface(surface, pinhole, nearest, out)
        if kernels.fill_gaps(nearest, out):
            raise InputError(
                f"view ({camera.row}, {camera.column}) looks past all that the picture shows: it needs a camera "
                "with a smaller field of view, or nearer to the middle"
            )
        averaged = out.reshape(camera.pixels[0], fine, camera.pixels[1], fine, 4).mean(axis=(1, 3))
        return np.asarray(averaged, dtype=np.float32)

    def _check(self, camera: ViewCamera) -> None:
        view = f"view ({camera.row}, {camera.column})"
        away = max(abs(camera.x), abs(camera.y))
        if away > self.reach * (1 + 1e-9):
            raise InputError(
                f"{view} is {away:g} m from the centre, and hidden surfaces were computed for "
                f"{self.reach:g} m: give the scene reach={away:g}"
            )
        span = self._vergence.min(), self._vergence.max()
        for low, high, offset, axis in (
            (camera.left, camera.right, camera.x, 1),
            (camera.top, camera.bottom, camera.y, 0),
        ):
            shown = (self._vergence.shape[axis] / 2 + self._margin[axis]) * self.slopes[axis]
            asked = max(max(-low - offset * w, high + offset * w) for w in span)
            if asked > shown:
                raise InputError(
                    f"{view} looks {math.degrees(math.atan(asked)):.3g}° to a side, and the picture with what can "
                    f"be made up around it ends at {math.degrees(math.atan(shown)):.3g}°: take fewer pixels, a "
                    "smaller slope_per_pixel, or give the scene the focus_distance of the views"
                )


class _Surface(NamedTuple):
    """A mesh over the pixels of the image with its margin.

    Args:
        quads: (rows − 1, columns − 1), whether the four pixels from (r, c) on span a part of the surface.
        vergence: (rows, columns), 1 / distance.
        colour: (rows, columns, 4): red, green, blue, and 1 for pixels of the image, 0 for inpainted ones.
        cover: (rows, columns), interpolated; the surface is absent where it is below ½.
    """

    quads: Mask
    vergence: Array
    colour: NDArray[np.float32]
    cover: NDArray[np.float32]


class _Pinhole(NamedTuple):
    """Projection of a view: column offset[0] + scale[0] · (across − place[0] · vergence), rows likewise.

    Args:
        across: (columns,), direction tangents of the image's columns, seen from the image's own pinhole.
        down: (rows,), likewise for its rows.
        offset: (column, row) of direction 0.
        scale: columns and rows per unit of the tangent.
        place: (x, y) of the view, metres from the image's own pinhole.
    """

    across: Array
    down: Array
    offset: tuple[float, float]
    scale: tuple[float, float]
    place: tuple[float, float]


def _surfaces(
    picture: Array,
    vergence: Array,
    margin: tuple[int, int],
    slopes: tuple[float, float],
    reach: float,
    edge: float,
) -> list[_Surface]:
    """The visible surface, the outlines of near sides, and the extensions behind them."""
    # vergence in pixels of displacement in a view at ``reach``
    unit = reach / min(slopes)
    parallax = _without_mixed_depths(vergence * unit, edge)
    border = ((margin[0],) * 2, (margin[1],) * 2)
    parallax = np.pad(parallax, border, mode="edge")
    colour = np.pad(picture, (*border, (0, 0)), mode="symmetric")
    known = np.pad(np.ones(picture.shape[:2]), border)
    cuts = [_jumps(parallax, axis, edge) for axis in (0, 1)]
    torn = _quads_with(cuts)
    full = np.ones(parallax.shape, np.float32)
    if not torn.any():
        return [_Surface(~torn, parallax / unit, _with_known(colour, known), full)]

    from scipy.ndimage import distance_transform_edt

    near_at_cut, far_at_cut, nearer, farther = _sides(parallax, torn)
    share, near_colour, far_colour = _parted(colour, parallax, near_at_cut, far_at_cut, nearer, farther)
    clean = colour.copy()
    clean[near_at_cut] = near_colour[near_at_cut]
    clean[far_at_cut] = far_colour[far_at_cut]
    visible = _Surface(~torn, parallax / unit, _with_known(clean, known), full)

    # Outline of the near side: its parts at cuts, also over the far side's pixels, visible where its fraction
    # is ≥ ½.
    row, column = distance_transform_edt(~near_at_cut, return_distances=False, return_indices=True)
    outline_parallax = np.where(far_at_cut, parallax[row, column], parallax)
    outline_colour = np.where(far_at_cut[..., None], near_colour, clean)
    outline = _Surface(torn, outline_parallax / unit, _with_known(outline_colour, known), share.astype(np.float32))
    surfaces = [visible, outline]
    # Small cuts within a near object must not stop the extension behind its outline: extend once for all cuts,
    # once for cuts of more than 4 times the smallest jump, and so on; the depth test picks the nearest result.
    jump = np.where(far_at_cut, nearer - parallax, 0)
    least = edge
    while (far := far_at_cut & (jump >= least)).any():
        quads, going_on, made_up = _hidden(parallax, clean, known, far, near_at_cut, edge)
        surfaces.append(_Surface(quads, going_on / unit, made_up, full))
        least *= 4
    return surfaces


def _with_known(colour: Array, known: Array) -> NDArray[np.float32]:
    return np.concatenate([colour, known[..., None]], axis=-1).astype(np.float32)


def _steps(values: Array, axis: int) -> Array:
    return np.abs(np.diff(values, axis=axis))


def _without_mixed_depths(parallax: Array, edge: float) -> Array:
    """Assign depths between the two sides of an edge, as in smoothed maps, to one of the sides."""
    result = parallax.copy()
    for axis in (0, 1):
        values = np.moveaxis(result, axis, 0)
        if len(values) < 5:
            continue
        before, at, after = values[1:-3], values[2:-2], values[3:-1]
        rise = np.abs(after - before)
        beside = np.minimum(np.abs(before - values[:-4]), np.abs(values[4:] - after))
        lower, upper = np.abs(at - before), np.abs(after - at)
        between = (np.minimum(lower, upper) > 0.1 * rise) & (np.maximum(lower, upper) < rise)
        mixed = between & (rise > edge) & (rise > _SLOPE_FACTOR * beside)
        values[2:-2] = np.where(mixed, np.where(lower < upper, before, after), at)
    return result


def _jumps(parallax: Array, axis: int, edge: float) -> Mask:
    """Whether depth jumps between neighbours along an axis: (n − 1) pairs along it."""
    step = np.moveaxis(_steps(parallax, axis), axis, 0)
    before = np.concatenate([step[:1] * 0, step[:-1]])
    after = np.concatenate([step[1:], step[:1] * 0])
    jump = (step > edge) & (step > _SLOPE_FACTOR * np.minimum(before, after))
    # The rim of a round object is steep next to its outline: a small step next to a large one is not a jump.
    return np.moveaxis(jump & (step > np.maximum(before, after) / 4), 0, axis)


def _quads_with(cuts: list[Mask]) -> Mask:
    """The squares of four pixels that contain a cut."""
    rows, columns = cuts
    return np.asarray(rows[:, :-1] | rows[:, 1:] | columns[:-1] | columns[1:])


def _corners(shape: tuple[int, ...]) -> list[tuple[slice, slice]]:
    rows, columns = shape
    return [(slice(r, rows - 1 + r), slice(c, columns - 1 + c)) for r in (0, 1) for c in (0, 1)]


def _sides(parallax: Array, torn: Mask) -> tuple[Mask, Mask, Array, Array]:
    """Pixels on the near and on the far side of cut squares, and the depths of both sides there, as parallax."""
    nearer, farther = np.full(parallax.shape, -np.inf), np.full(parallax.shape, np.inf)
    corners = _corners(parallax.shape)
    high = np.max([parallax[corner] for corner in corners], axis=0)
    low = np.min([parallax[corner] for corner in corners], axis=0)
    for corner in corners:
        nearer[corner] = np.maximum(nearer[corner], np.where(torn, high, -np.inf))
        farther[corner] = np.minimum(farther[corner], np.where(torn, low, np.inf))
    beside = np.isfinite(nearer)
    middle = np.where(beside, (np.where(beside, nearer, 0) + np.where(beside, farther, 0)) / 2, 0)
    return beside & (parallax > middle), beside & (parallax <= middle), nearer, farther


def _parted(
    colour: Array, parallax: Array, near: Mask, far: Mask, nearer: Array, farther: Array
) -> tuple[Array, Array, Array]:
    """In pixels at cuts, the near side's fraction and the colours of both sides, from unmixed pixels nearby.

    A mixed pixel is fraction·near + (1 − fraction)·far. The depth map assigns the pixel to a side, and thereby
    its fraction to one side of ½. Pixels that are hardly mixed keep their own colour, and so their texture.
    """
    rows, columns = np.nonzero(near | far)
    sums = np.zeros((2, len(rows), 3))
    weights = np.zeros((2, len(rows)))
    middle = (nearer[rows, columns] + farther[rows, columns]) / 2
    mixed = near | far
    for r in range(-_WINDOW, _WINDOW + 1):
        for c in range(-_WINDOW, _WINDOW + 1):
            y, x = np.clip(rows + r, 0, len(near) - 1), np.clip(columns + c, 0, near.shape[1] - 1)
            value = parallax[y, x]
            # nearby pixels count more, unmixed ones far more; those of a third surface belong to neither side
            weight = np.exp(-(r * r + c * c) / 4) * np.where(mixed[y, x], 1e-6, 1.0)
            is_near = value > middle
            other = np.where(is_near, nearer[rows, columns], farther[rows, columns])
            weight = weight * (np.abs(value - other) < 0.5 * np.abs(nearer - farther)[rows, columns])
            for side, belongs in enumerate((is_near, ~is_near)):
                sums[side] += (weight * belongs)[:, None] * colour[y, x]
                weights[side] += weight * belongs
    own = colour[rows, columns]
    sides = np.where(weights[..., None] > 0, sums / np.maximum(weights, 1e-300)[..., None], own)
    contrast = sides[0] - sides[1]
    strength = (contrast**2).sum(axis=-1)
    mix = ((own - sides[1]) * contrast).sum(axis=-1) / np.maximum(strength, 1e-12)
    on_near = near[rows, columns]
    mix = np.where(strength > 1e-6, mix, on_near)  # without contrast, use the depth map
    mix = np.where(on_near, np.clip(mix, 0.5, 1), np.clip(mix, 0, 0.5))
    share = near.astype(np.float64)
    share[rows, columns] = mix
    share[~mixed] = 1
    near_colour, far_colour = colour.copy(), colour.copy()
    near_colour[rows, columns] = np.where((on_near & (mix > 0.98))[:, None], own, sides[0])
    far_colour[rows, columns] = np.where((~on_near & (mix < 0.02))[:, None], own, sides[1])
    return share, near_colour, far_colour


def _hidden(
    parallax: Array, colour: Array, known: Array, far: Mask, near: Mask, edge: float
) -> tuple[Mask, Array, NDArray[np.float32]]:
    """The extension behind near objects: its squares, parallax and colours, all inpainted."""
    from scipy.ndimage import distance_transform_edt, gaussian_filter

    distance, nearest = distance_transform_edt(~far, return_indices=True)
    rows, columns = np.indices(parallax.shape)
    at = parallax[nearest[0], nearest[1]]
    covered = parallax - at > edge
    # It is visible as far as the near object moves against it, in both directions at once.
    hidden = covered & (distance <= math.sqrt(2) * (parallax - at) + 3)
    mirrored = (
        np.clip(2 * nearest[0] - rows, 0, parallax.shape[0] - 1),
        np.clip(2 * nearest[1] - columns, 0, parallax.shape[1] - 1),
    )
    there = parallax[mirrored]
    same = np.abs(there - at) < np.maximum(edge, 0.1 * distance)
    # A straight slope continues straight, but never in front of the occluding surface.
    going_on = np.where(same, 2 * at - there, at)
    going_on = np.clip(going_on, parallax.min(), np.maximum(parallax - edge / 2, parallax.min()))
    made_up = np.where(same[..., None], colour[mirrored], colour[nearest[0], nearest[1]])

    own = far | ((distance <= 2) & ~covered & ~near)  # the extension joins the visible surface
    values = np.where(own, parallax, going_on)
    colours = np.where(own[..., None], colour, made_up)
    there_is = own | hidden
    # Neighbours may be mirrored at different pixels of a curved outline: smooth the noise within a surface.
    weight = np.maximum(gaussian_filter(there_is.astype(np.float64), 1.0, truncate=2), 1e-9)

    def mean(quantity: Array) -> Array:
        return np.asarray(gaussian_filter(np.where(there_is, quantity, 0), 1.0, truncate=2) / weight)

    even = hidden & ~own & (np.abs(mean(values) - values) < edge / 4)
    for channel in range(3):
        colours[..., channel] = np.where(even, mean(colours[..., channel]), colours[..., channel])
    corners = _corners(parallax.shape)
    whole = np.all([there_is[corner] for corner in corners], axis=0)
    some_hidden = np.any([hidden[corner] for corner in corners], axis=0)
    spread = np.ptp([values[corner] for corner in corners], axis=0)
    quads = whole & some_hidden & (spread < np.maximum(2 * edge, 1.0))
    return quads, values, _with_known(colours, np.where(own, known, 0))
