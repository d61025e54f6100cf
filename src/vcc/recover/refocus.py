"""Images from light fields: refocused by the ideal lens, and interpolated between the views."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.checks import above_zero
from vcc.base.errors import InputError, warn_of_result, without_result_warnings
from vcc.base.progress import Progress, tell
from vcc.camera import Camera
from vcc.fields.grid import Grid, skew
from vcc.fields.samples import check_is_light_field
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Element, Lens, Mask
from vcc.optics.sensor import Sensor
from vcc.plan.choice import compile_best
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.operators import AlongAxes, Blur
from vcc.shapes import patterns
from vcc.store import StoredLightField

IMAGE_DISTANCE = 50e-3
"""Distance from the lens to the sensor of the ideal camera, metres. Images do not depend on it: the scale of
pixels and irradiance is divided out."""
SWEEP_STEP = 0.25
"""Largest shift between neighbouring planes of a plane sweep, pixels per view."""
SWEEP_WINDOW = 2.5
"""Standard deviation of the Gaussian over which a plane sweep compares views, pixels."""
MOST_PLANES = 512
_UNSEEN = 1e-6
"""Pixels with a smaller share of the aperture count as seen by no view: rounding of float32."""


def ideal_camera(
    light_field: LightField | StoredLightField,
    distance: float,
    *,
    diameter: float | None = None,
    centre: tuple[float, float] = (0.0, 0.0),
) -> Camera:
    """A perfect thin lens focused on a distance, with a sensor of the views' resolution.

    The lens is at the plane of the light field. The sensor stays `IMAGE_DISTANCE` d behind it, and the focal
    length follows the thin-lens equation, 1/f = 1/d + 1/Z, so that images of all distances Z have the same
    scale: a pixel is one pixel of a view, and points at Z are at their pixel in the middle view. Capturing
    with this camera is the shift-and-add refocusing of Ng et al., *Light Field Photography with a Hand-held
    Plenoptic Camera* (2005), with footprints of samples instead of shifted points.

    Args:
        light_field: in memory or on disk.
        distance: Z before the light field's plane, metres; may be infinite.
        diameter: of the round aperture, metres; None uses all views.
        centre: (u, v) of the aperture's centre, metres.

    Raises:
        InputError: a distance or diameter that is not positive, a centre without a diameter, or a light field
            given at the plane of that distance, where all pixels of a view show the same point.
    """
    check_is_light_field(light_field)
    check_distance(distance, "distance")
    if diameter is not None:
        above_zero("the diameter of the aperture", diameter, unit="m", infinite=True)
    if diameter is None and tuple(centre) != (0.0, 0.0):
        raise InputError(f"centre = {centre} m is the middle of a round aperture: give its diameter too")
    d = IMAGE_DISTANCE
    # A ray meets the sensor at x = u + d·(s − u/f) = d·(s − u/Z), linear in the sample's index.
    focal_length = 1 / (1 / d + 1 / distance)
    rays = Affine.propagation(d) @ Affine.lens(focal_length) @ light_field.frame
    pitch = math.hypot(rays.linear[1, 2], rays.linear[1, 3]), math.hypot(rays.linear[0, 2], rays.linear[0, 3])
    if min(pitch) < 1e-9 * d * max(abs(light_field.frame.linear[2:, 2:]).max(), 1e-300):
        raise InputError(
            f"at a distance of {distance} m all pixels of a view of this light field show one place: nothing can "
            "be focused there"
        )
    nv, nu, nt, ns = light_field.shape[:4]
    x, y, _, _ = rays([(nu - 1) / 2, (nv - 1) / 2, (ns - 1) / 2, (nt - 1) / 2])
    sensor = Sensor(z=d, shape=(nt, ns), pitch=pitch, decentre=(float(x), float(y)))
    elements: list[Element] = [Lens(focal_length=focal_length)]
    if diameter is not None:  # a mask, since the lens stays on the axis if the hole is off it
        elements.append(Mask(patterns.Circle(diameter), decentre=centre, name="aperture"))
    return Camera(elements, sensor)


def refocused(
    light_field: LightField | StoredLightField,
    distance: float,
    *,
    diameter: float | None = None,
    centre: tuple[float, float] = (0.0, 0.0),
    interpolation: str = "sharp",
    between_views: str = "auto",
    memory_limit: int | None = None,
    progress: Progress | None = None,
) -> Image:
    """The image focused on a distance, upright, with the pixels of a view: the mean radiance over the aperture.

    Computed with `ideal_camera`. Uniform radiance 1 gives 1 everywhere: each pixel is divided by the share of the
    aperture that the views cover, which falls towards the borders of an out-of-focus image.

    Args:
        light_field: in memory, or on disk and then read in pieces.
        distance: metres before the light field's plane; may be infinite.
        diameter: of the round aperture, metres; None uses all views. A smaller one has more depth of field.
        centre: (u, v) of the aperture's centre, metres.
        interpolation: within a view, see `vcc.Camera.capture`. ``"sharp"`` compensates after the division by the
            coverage, so that borders of views do not ring.
        between_views: whether to interpolate between views that are too far apart, see `vcc.Camera.capture`.
        memory_limit: for a light field on disk, see `vcc.Camera.capture`.
        progress: called with (done, total).

    Returns:
        Linear radiance, float32, (rows, columns[, channels]); the frame is the viewing direction of the middle
        view's pixels, as in `vcc.LightField.view`.

    Warns:
        ResultWarning: pixels that no view sees, which are 0.

    Raises:
        InputError: as for `ideal_camera` and `vcc.Camera.capture`, or an aperture that contains no view.
    """
    camera = ideal_camera(light_field, distance, diameter=diameter, centre=centre)
    sharp = interpolation == "sharp"
    options: dict[str, Any] = {
        "method": "footprints",
        "interpolation": "linear" if sharp else interpolation,
        "between_views": between_views,
    }
    with warnings.catch_warnings():
        # The warning "rays are missing; the image is darker there" does not apply after division by the
        # coverage.
        warnings.filterwarnings("ignore", message=".*of the rays that this camera asks for.*")
        warnings.filterwarnings(
            "ignore", message="the picture is 0 everywhere.*"
        )  # told below, or in its own words
        taken = camera.capture(light_field, **options, memory_limit=memory_limit, progress=progress)
        covered = _coverage(camera, light_field.grid, options)
    most = float(covered.max())
    if not most > 0:
        raise InputError(
            f"an aperture of {diameter} m around {centre} m is outside all views: the image would be black"
        )
    seen = covered > _UNSEEN * most
    if not seen.all():
        warn_of_result(f"{1 - seen.mean():.1%} of the pixels are seen by no view and are 0")
    share = np.where(seen, covered, np.inf)
    values = taken.to_numpy().astype(np.float64)
    values /= share if values.ndim == 2 else share[..., None]
    if sharp:
        plan = compile_best(camera, light_field.grid, How.of(None, options | {"interpolation": "sharp"}))
        values = _sharpened(values, plan)
    nv, nu, nt, ns = light_field.shape[:4]
    s, t = light_field.frame([(nu - 1) / 2, (nv - 1) / 2, (ns - 1) / 2, (nt - 1) / 2])[2:]
    on_sensor = Affine.translation(-camera.sensor.decentre[0], -camera.sensor.decentre[1]) @ taken.frame
    looks_at = Affine.translation(-s, -t) @ Affine.scaling(-1 / IMAGE_DISTANCE, -1 / IMAGE_DISTANCE) @ on_sensor
    return Image(values.astype(np.float32), looks_at).upright()


def _sharpened(values: NDArray[np.float64], plan: Plan) -> NDArray[np.float64]:
    """An image sharpened as in a plan; its edge is repeated beyond its border."""
    from scipy.ndimage import convolve, convolve1d

    for operator in plan.after:
        if isinstance(operator, AlongAxes) and not any(operator.half_widths):
            for axis, weights in enumerate((operator.down, operator.across)):
                values = convolve1d(values, weights, axis=axis, mode="nearest")
        elif isinstance(operator, Blur):  # for a rotated pixel grid
            kernel = operator.kernel if values.ndim == 2 else operator.kernel[..., None]
            values = convolve(values, kernel, mode="nearest")
    return values


def _coverage(camera: Camera, grid: Grid, options: dict[str, Any]) -> NDArray[np.float64]:
    """The image of uniform radiance 1, (rows, columns), as a sum over rows of views, without reading samples.

    Pieces of a light field are treated like the whole (with the same disparity range), so that their images
    add up.
    """
    total = np.zeros(camera.sensor.shape)
    for row in range(grid.shape[0]):
        piece, _ = grid.piece(slice(row, row + 1))
        ones = LightField.of(np.ones(piece.shape[:4], np.float32), replace(piece, shape=piece.shape[:4]))
        with without_result_warnings():
            total += camera.capture(ones, **options).to_numpy()
    return total


def novel_view(
    light_field: LightField,
    u: float,
    v: float,
    *,
    scene_distance: float | None = None,
    progress: Progress | None = None,
) -> Image:
    """The view of a camera between the views, interpolated along the scene's parallax.

    The four views around the position (two or one on the grid's lines) are shifted to it by the parallax of a
    distance and averaged with bilinear weights. This blends rays of neighbouring cameras as in Levoy & Hanrahan,
    *Light Field Rendering* (1996), with the depth correction of Gortler et al., *The Lumigraph* (1996). If the
    distance is not given, each pixel uses the distance at which these views agree best within a Gaussian window
    (plane sweep: Collins, *A Space-Sweep Approach to True Multi-Image Matching*, 1996), among planes in equal
    steps of disparity over the light field's range. At the position of a view, the result is exactly that view.

    Args:
        light_field: in memory, from a grid of parallel cameras (positions by view, slopes by pixel and view, axes
            not mixed).
        u: position of the camera, metres to the right, inside the grid of views.
        v: position of the camera, metres downwards.
        scene_distance: one distance for the whole scene, metres; None estimates it for each pixel.
        progress: called with (planes done, planes).

    Returns:
        Linear radiance, float32, upright, as in `vcc.LightField.view`.

    Raises:
        InputError: a position outside the views, a frame that mixes axes, a distance that is not positive, or a
            disparity range that is unknown and cannot be estimated.
    """
    i, j = _view_index(light_field, u, v)
    if scene_distance is not None:
        check_distance(scene_distance, "scene_distance")
    around = _views_around(light_field, i, j)
    farthest = max(max(abs(near.column - i), abs(near.row - j)) for near in around)
    if scene_distance is not None or farthest == 0:
        vergences = np.array([1 / scene_distance if scene_distance is not None else 0.0])
    else:
        vergences = _sweep(light_field)
    sizes = light_field.shape[2:4]
    best = np.full(sizes, np.inf)
    picture = np.zeros((*sizes, light_field.channels or 1))
    for done, vergence in enumerate(vergences):
        mean, cost = _blend(light_field, around, (i, j), float(vergence))
        if len(vergences) == 1:
            picture = mean
        else:
            better = cost < best
            best = np.where(better, cost, best)
            picture[better] = mean[better]
        tell(progress, done + 1, len(vergences))
    at_view = light_field.frame @ Affine.translation(i, j, 0, 0)
    looks_at = Affine.from_parts(-at_view.linear[2:, 2:], -at_view.offset[2:])
    if light_field.channels is None:
        picture = picture[..., 0]
    return Image(picture.astype(np.float32), looks_at, inverted=False)


class _Near:
    """A view around a position: its index, its weight, and its samples as splines."""

    def __init__(self, light_field: LightField, row: int, column: int, share: float) -> None:
        from scipy import ndimage

        self.row, self.column, self.share = row, column, share
        picture = light_field.view(row, column).to_numpy().astype(np.float64)
        self.samples = picture if picture.ndim == 3 else picture[..., None]
        # Splines with mirrored borders, as `ndimage.shift` expects them in this mode.
        self.splines = np.stack(
            [ndimage.spline_filter(self.samples[..., c], 3, mode="mirror") for c in range(self.samples.shape[2])]
        )

    def moved(self, down: float, right: float) -> NDArray[np.float64]:
        """The image shifted by a number of pixels, (rows, columns, channels), its borders mirrored."""
        from scipy import ndimage

        if down == 0 and right == 0:
            return self.samples
        channels = [
            ndimage.shift(each, (down, right), order=3, mode="mirror", prefilter=False) for each in self.splines
        ]
        return np.stack(channels, axis=-1)


def _views_around(light_field: LightField, i: float, j: float) -> list[_Near]:
    """The views with a positive bilinear weight at (i, j)."""
    found = []
    for row in {math.floor(j), math.ceil(j)}:
        for column in {math.floor(i), math.ceil(i)}:
            share = (1 - abs(i - column)) * (1 - abs(j - row))
            found.append(_Near(light_field, row, column, share))
    return found


def _blend(
    light_field: LightField, around: list[_Near], place: tuple[float, float], vergence: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The mean of the views at a position for the parallax of a plane, and their local difference, by pixel."""
    from scipy import ndimage

    linear = light_field.frame.linear
    # A point at 1/Z is seen at pixel k − D·i in view i: D = (∂s/∂i − ∂u/∂i/Z)/(∂s/∂k), likewise down.
    right = (linear[2, 0] - linear[0, 0] * vergence) / linear[2, 2]
    down = (linear[3, 1] - linear[1, 1] * vergence) / linear[3, 3]
    rows, columns = np.arange(light_field.shape[2]), np.arange(light_field.shape[3])
    moved, weights = [], []
    for near in around:
        shift = down * (near.row - place[1]), right * (near.column - place[0])
        moved.append(near.moved(*shift))
        inside = [
            (index - by >= -1e-9) & (index - by <= len(index) - 1 + 1e-9)
            for index, by in zip((rows, columns), shift, strict=True)
        ]
        # Views that do not reach a pixel have almost no weight there, unless no view reaches it.
        weights.append(near.share * np.where(inside[0][:, None] & inside[1], 1.0, 1e-9))
    pictures, shares = np.stack(moved), np.stack(weights)[..., None]
    mean = (shares * pictures).sum(axis=0) / shares.sum(axis=0)
    cost = ((pictures - pictures.mean(axis=0)) ** 2).mean(axis=(0, 3))
    return mean, ndimage.gaussian_filter(cost, SWEEP_WINDOW, mode="mirror")


def _sweep(light_field: LightField) -> NDArray[np.float64]:
    """The planes of a sweep, 1/metre, over the light field's disparity range."""
    found = light_field.measured_disparity_range()
    if found is None:
        raise InputError(
            "the distance of the scene cannot be estimated from this light field (too few views, or no texture): "
            "pass scene_distance="
        )
    ends = np.array([1 / light_field.distance_of(each) for each in found])
    linear = light_field.frame.linear
    # A small margin at both ends: estimated ranges are percentiles.
    per_vergence = max(abs(linear[0, 0] / linear[2, 2]), abs(linear[1, 1] / linear[3, 3]))
    margin = SWEEP_STEP / per_vergence
    low, high = ends.min() - margin, ends.max() + margin
    planes = math.ceil((high - low) * per_vergence / SWEEP_STEP) + 1
    if planes > MOST_PLANES:
        raise InputError(
            f"the scene's disparities, {found[0]:.3g} to {found[1]:.3g} pixels per view, would take a sweep of "
            f"{planes} planes, more than {MOST_PLANES}: give scene_distance=, or views that stand closer"
        )
    return np.linspace(low, high, planes)


def _view_index(light_field: LightField, u: float, v: float) -> tuple[float, float]:
    """(i, j) of a position in the grid of views."""
    linear, offset = light_field.frame.linear, light_field.frame.offset
    if np.abs(skew(light_field.frame)).max() > 1e-9 * np.abs(linear).max(axis=1).min():
        raise InputError(
            "views are interpolated in light fields of parallel cameras, whose frame does not mix its axes; this "
            f"one's does:\n{light_field.frame!r}\nResample it first (LightField.resampled)"
        )
    index = []
    for name, place, axis, count in (("u", u, 0, light_field.shape[1]), ("v", v, 1, light_field.shape[0])):
        step = linear[axis, axis]
        start = light_field.frame([0, 0, 0, 0])[axis]
        found = (place - start) / step
        nearest = float(np.rint(found))
        if abs(found - nearest) < 1e-9:
            found = nearest
        if not -1e-9 <= found <= count - 1 + 1e-9:
            ends = sorted((float(offset[axis]), float(offset[axis] + step * (count - 1))))
            raise InputError(
                f"{name} = {place} m lies outside the views, which stand from {ends[0]:.6g} m to {ends[1]:.6g} m: "
                "a view can be interpolated between others, not beyond them"
            )
        index.append(found)
    return index[0], index[1]


def check_distance(distance: float, name: str) -> None:
    """Check a distance to focus on.

    Raises:
        InputError: not positive, or NaN.
    """
    above_zero(name, distance, unit="m", infinite=True, way_out="it may be infinite")
