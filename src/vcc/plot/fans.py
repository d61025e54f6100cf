"""Choose rays for drawings: fans from a point in focus, from a nearer one, and from one off the axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import mm, short
from vcc.fields.samples import InMemory
from vcc.optics import CellDeflection, Element, FirstOrder, Lens, RealLens
from vcc.optics.real_lens import TracedLens
from vcc.optics.real_rays import entrance_box
from vcc.optics.train import Stage, Train
from vcc.plot.elements import half_size
from vcc.plot.tracing import Paths, fan, openings, trace

RAYS = 9
"""Rays per fan from a point on the axis; odd, so that one is on the axis."""
RAYS_THAT_SPLIT = 5
"""Rays per fan if diffusers split rays."""
OFF_AXIS_RAYS = 3
"""Rays per fan from a point off the axis."""
SCENE_SHARE = 0.45
"""Length of the scene's side that is drawn, as a share of the camera's length."""
NEAR_BLUR = 0.25
"""The nearer point is so near that its blur covers this share of the entrance."""


def focused_distance(camera: Train) -> float | None:
    """The distance before the entrance plane at which a point is sharp on the sensor, metres.

    Position and slope at the entrance map to position x = A·u + B·s at a plane. A point at distance Z sends s
    = u/Z, and all its rays meet at this plane if A + B/Z = 0. The plane is the sensor's, or the one that an
    array of lenslets of focal length f, at b before the sensor, relays to it: a before the array, 1/a + 1/b =
    1/f (Lumsdaine and Georgiev 2009). For b = f, where a is infinite, the optics before the array are assumed
    to be focused on the array itself (Ng et al. 2005). If lenslets have several focal lengths, the first one
    counts.

    Returns:
        The distance; infinite if parallel light is focused; None if no real point is sharp (a camera without a
        lens, or one focused beyond infinity).
    """
    matrix = _to_focus(camera).matrix
    position, slope = float(matrix[0, 0]), float(matrix[0, 2])
    if abs(position) <= 1e-12 * max(1.0, abs(slope)):
        return math.inf if slope != 0 else None
    distance = -slope / position
    return distance if distance > 0 else None


def _lenslets(camera: Train) -> Stage | None:
    """The last array of cells with optical power before the sensor, and not on it."""
    found = None
    for stage in camera.stages:
        cells = stage.faces.bending
        if isinstance(cells, CellDeflection) and cells.powers.flat[0] != 0 and stage.z < camera.sensor.z:
            found = stage
    return found


def plane_to_focus(camera: Train) -> tuple[float, float]:
    """The plane where an image must be to be sharp on the sensor, metres.

    Returns:
        The z up to which elements count, that of the sensor or of the last array of lenslets; and the
        distance from there to the plane that lenslets image.
    """
    stage = _lenslets(camera)
    if stage is None:
        return camera.sensor.z, 0.0
    assert isinstance(stage.faces.bending, CellDeflection)
    behind = camera.sensor.z - stage.z
    vergence = float(stage.faces.bending.powers.flat[0]) - 1 / behind
    return stage.z, -1 / vergence if abs(vergence * behind) > 1e-6 else 0.0


def _to_focus(camera: Train) -> Affine:
    """Map of rays from the entrance plane to the plane where an image must be to be sharp on the sensor."""
    z, beyond = plane_to_focus(camera)
    if z == camera.sensor.z:
        return camera.rays_at(z, before=True)
    to_array = camera.rays_at(z)
    if beyond == 0.0 and (to_array.matrix[2, 0] == 0 or to_array.matrix[0, 2] == 0):
        # Nothing before the array can focus on it: parallel light is sharp there, x = s.
        return Affine.abcd(((0.0, 1.0), (-1.0, 0.0))) @ to_array
    return Affine.propagation(beyond) @ to_array


@dataclass(frozen=True)
class Point:
    """A point of the scene.

    Args:
        distance: before the entrance plane, metres; may be infinite.
        offset: its position off the axis, as a slope.
        role: why it is drawn: ``"focused"``, ``"near"``, ``"off axis"`` or ``"given"``.
        label: as text.
    """

    distance: float
    offset: float
    role: str
    label: str


def points_to_show(camera: Train, distances: Sequence[float] | None, axis: int) -> list[Point]:
    """The points whose rays show how a camera works.

    Args:
        camera: for the rays.
        distances: of points on the axis, metres; None uses the distance in focus, on and off the axis, and a
            nearer one.
        axis: 0 for x, 1 for y.

    Raises:
        InputError: a distance that is not positive.
    """
    if distances is not None:
        for distance in distances:
            checks.above_zero("an object distance", distance, unit="m", infinite=True)
        return [Point(distance, 0.0, "given", f"point {_away(distance)}") for distance in distances]
    matrix = camera.rays_at(camera.sensor.z, before=True).matrix
    reach = abs(float(matrix[axis, 2 + axis])) or max(camera.sensor.z, 10 * mm)
    focus = focused_distance(camera)
    far = math.inf if focus is None else focus
    near = _rounded(1 / (NEAR_BLUR / reach + 1 / far))
    points = [
        Point(far, 0.0, "focused", f"{'in focus' if focus else 'not in focus'}: {_away(far)}"),
        Point(near, 0.0, "near", f"nearer: {_away(near)}"),
    ]
    if focus is not None:
        landing = 0.3 * camera.sensor.size[1 - axis]
        points.append(Point(far, landing / reach, "off axis", f"in focus, off the axis: {_away(far)}"))
    return points


def _rounded(length: float) -> float:
    return float(f"{length:.2g}")


def _away(distance: float) -> str:
    return "parallel light" if math.isinf(distance) else f"{short(distance, digits=3)} away"


def scene_length(camera: Train, points: Sequence[Point]) -> float:
    """Length of the scene's side to draw, metres: a fixed part, or up to points that are close."""
    shown = SCENE_SHARE * (camera.sensor.z or 10 * mm)
    near = [point.distance for point in points if point.distance < 2.5 * shown]
    glass = [-1.3 * (element.z + element.front) for element in camera.elements if isinstance(element, RealLens)]
    return max([shown, *glass, *(1.08 * distance for distance in near)])


def trace_point(
    camera: Train, point: Point, light_field: InMemory | None, axis: int, rays: int, start: float
) -> Paths:
    """The fan of one point; see `trace_points`."""
    return trace_points(camera, [(point, rays)], light_field, axis, start)[0]


def trace_points(
    camera: Train,
    fans: Sequence[tuple[Point, int]],
    light_field: InMemory | None,
    axis: int,
    start: float,
    within_rim: bool = False,
) -> list[Paths]:
    """The fans from points; each starts at the point itself if that is in the drawing.

    Args:
        camera: for the rays.
        fans: points of the scene, and the number of rays of each.
        light_field: fans fill its width on the entrance plane; None fills the first lens with a rim.
        axis: 0 for x, 1 for y.
        start: of the drawing, metres, 0 or less.
        within_rim: whether a fan that fills the light field is limited to what the first lens with a rim passes.
    """
    rim = within_rim and light_field is not None and any(True for _ in openings(camera, axis))
    bundles, starts = [], []
    for point, rays in fans:
        low, high = _entrance(camera, point, light_field, axis)
        if rim:
            least, most = _entrance(camera, point, None, axis)
            if max(low, least) < min(high, most):
                low, high = max(low, least), min(high, most)
        bundles.append(fan(np.linspace(low, high, rays), point.distance, point.offset, axis))
        starts.append(np.full(rays, max(start, -point.distance)))
    traced = trace(camera, np.concatenate(bundles), np.concatenate(starts), split_along=axis)
    ends = np.cumsum([rays for _, rays in fans])
    return [traced.coming_from(range(end - rays, end)) for end, (_, rays) in zip(ends, fans, strict=True)]


def _entrance(camera: Train, point: Point, light_field: InMemory | None, axis: int) -> tuple[float, float]:
    """The range on the entrance plane that the rays of a point fill, metres."""
    if light_field is not None:
        return _through_views(point, light_field, axis)
    if any(isinstance(element, TracedLens) for element in camera.elements):
        field = np.zeros(2)
        field[axis] = point.offset
        try:
            box = entrance_box(camera, point.distance, field)
        except InputError:  # no light of this point passes
            half = camera.sensor.size[1 - axis] / 3
            return -half, half
        middle, half = (box[1][axis] + box[0][axis]) / 2, (box[1][axis] - box[0][axis]) / 2
        return float(middle - 0.97 * half), float(middle + 0.97 * half)
    found = list(openings(camera, axis))
    lenses = [one for one in found if isinstance(one[0], Lens | FirstOrder)]
    # A lens's rim is more characteristic than a mask's border; for a thick lens all rims count.
    first = (lenses or found)[:1]
    rims = [one for one in found if one[0] is first[0][0]] if first else []
    low, high = -math.inf, math.inf
    for element, ray, half in rims:
        matrix = ray.matrix
        growth = float(matrix[axis, axis] + matrix[axis, axis + 2] / point.distance)
        if growth:
            # Slightly inside: rounding must not stop the outermost ray at the rim.
            reach = 0.97 * half / abs(growth)
            shift = element.decentre[axis] - matrix[axis, 4] + matrix[axis, axis + 2] * point.offset
            low, high = max(low, shift / growth - reach), min(high, shift / growth + reach)
    if low < high and math.isfinite(high - low):
        return low, high
    half = camera.sensor.size[1 - axis] / 3
    return -half, half


def _through_views(point: Point, light_field: InMemory, axis: int) -> tuple[float, float]:
    """Positions on the entrance plane of the rays of a point that pass the outer borders of the views, metres.

    The border's pixel k that sees the point has position x and slope s with s = x/Z − offset, as the point's
    rays. If the views are in the entrance plane, x does not depend on k.
    """
    counts, linear, offset = light_field.shape[1::-1], light_field.frame.linear, light_field.frame.offset
    middle = np.array([(count - 1) / 2 for count in (*counts, light_field.shape[3], light_field.shape[2])])
    aside = np.where(np.arange(4) % 2 == axis, 0.0, middle)  # centre along the other axis
    place, slope = (linear[n] @ aside + offset[n] for n in (axis, axis + 2))
    by_view, by_pixel = linear[np.ix_([axis, axis + 2], [axis, axis + 2])].T
    borders = np.array([-0.5, counts[axis] - 0.5])
    unlike = by_pixel[1] - by_pixel[0] / point.distance
    wanted = (place + by_view[0] * borders) / point.distance - point.offset - slope - by_view[1] * borders
    pixels = wanted / unlike if unlike else np.full(2, middle[axis + 2])
    low, high = np.sort(place + by_view[0] * borders + by_pixel[0] * pixels)
    return float(low), float(high)


def half_height(camera: Train, paths: Sequence[Paths], axis: int) -> float:
    """Half the height of a drawing, metres: bounded elements, the sensor, and rays within limits."""
    sizes = [camera.sensor.size[1 - axis] / 2 + abs(camera.sensor.decentre[axis])]
    halves = [(half_size(element, axis), abs(element.decentre[axis])) for element in camera.elements]
    sizes += [1.08 * half + decentre for half, decentre in halves if math.isfinite(half)]
    highest = max(float(np.abs(path.positions[:, 1:, axis]).max()) for path in paths)
    return max(*sizes, min(highest, 2 * max(sizes)))


def beam_at(element: Element, paths: Sequence[Paths], axis: int) -> float:
    """Half the height of the drawn rays, relative to an element's centre, metres."""
    highest = 0.0
    for path in paths:
        front = element.z + min(element.front, 0.0) if isinstance(element, RealLens) else element.z
        inside = (path.z >= front) & (path.z <= element.z + element.length) & (path.z < path.z[-1])
        heights = np.abs(path.positions[:, inside, axis] - element.decentre[axis])
        highest = max(highest, float(np.where(path.shares[:, inside] > 0, heights, 0.0).max(initial=0.0)))
    return highest
