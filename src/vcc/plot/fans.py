"""Which rays show what a camera does: fans from a point in focus, from a nearer one, and from one off the axis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.units import mm, short
from vcc.fields.samples import InMemory
from vcc.optics import CellDeflection, Element, FirstOrder, Lens
from vcc.optics.train import Stage, Train
from vcc.plot.elements import half_size
from vcc.plot.tracing import Paths, fan, openings, trace

RAYS = 9
"""In each fan from a point on the axis; odd, so that one goes along the axis."""
RAYS_THAT_SPLIT = 5
"""In each fan where diffusers split rays."""
OFF_AXIS_RAYS = 3
"""In the fan from a point off the axis."""
SCENE_SHARE = 0.45
"""How much of the scene's side is drawn, as a share of the camera's length."""
NEAR_BLUR = 0.25
"""The nearer point is taken so near that it blurs over this share of the entrance."""


def focused_distance(camera: Train) -> float | None:
    """How far before the entrance plane a point must be to be sharp on the sensor, metres.

    With position and slope at the entrance mapped to a plane by x = A·u + B·s, a point at distance Z sends
    s = u/Z, and all its rays meet there where A + B/Z = 0. The plane is the sensor's; or the one that an array of
    lenslets of focal length f, b before the sensor, relays to it: a before the array, 1/a + 1/b = 1/f (Lumsdaine
    and Georgiev 2009). At b = f, where a is infinite, optics before the array are taken to be focused on the array
    itself (Ng et al. 2005). Of lenslets of several focal lengths it is the first.

    Returns:
        The distance; infinite if parallel light is brought to a point; None if no real point is
        sharp (a camera without a lens, or one focused beyond infinity).
    """
    matrix = _to_focus(camera).matrix
    position, slope = float(matrix[0, 0]), float(matrix[0, 2])
    if abs(position) <= 1e-12 * max(1.0, abs(slope)):
        return math.inf if slope != 0 else None
    distance = -slope / position
    return distance if distance > 0 else None


def _lenslets(camera: Train) -> Stage | None:
    """The last array of cells with a power, before the sensor and not on it."""
    found = None
    for stage in camera.stages:
        cells = stage.faces.bending
        if isinstance(cells, CellDeflection) and cells.powers.flat[0] != 0 and stage.z < camera.sensor.z:
            found = stage
    return found


def plane_to_focus(camera: Train) -> tuple[float, float]:
    """Where a picture must stand to be sharp on the sensor, metres.

    Returns:
        The place up to which elements count, that of the sensor or of the last array of lenslets; and how far from
        there the plane is, which lenslets look at.
    """
    stage = _lenslets(camera)
    if stage is None:
        return camera.sensor.z, 0.0
    assert isinstance(stage.faces.bending, CellDeflection)
    behind = camera.sensor.z - stage.z
    vergence = float(stage.faces.bending.powers.flat[0]) - 1 / behind
    return stage.z, -1 / vergence if abs(vergence * behind) > 1e-6 else 0.0


def _to_focus(camera: Train) -> Affine:
    """Rays from the entrance plane to the plane in which a picture must stand to be sharp on the sensor."""
    z, beyond = plane_to_focus(camera)
    if z == camera.sensor.z:
        return camera.rays_at(z, before=True)
    to_array = camera.rays_at(z)
    if beyond == 0.0 and (to_array.matrix[2, 0] == 0 or to_array.matrix[0, 2] == 0):
        # Nothing before the array can focus on it: light that is parallel there is sharp, x = s.
        return Affine.abcd(((0.0, 1.0), (-1.0, 0.0))) @ to_array
    return Affine.propagation(beyond) @ to_array


@dataclass(frozen=True)
class Point:
    """A point of the scene.

    Args:
        distance: before the entrance plane, metres; may be infinite.
        offset: its place off the axis as a slope.
        role: why it is shown: ``"focused"``, ``"near"``, ``"off axis"`` or ``"given"``.
        label: in words.
    """

    distance: float
    offset: float
    role: str
    label: str


def points_to_show(camera: Train, distances: Sequence[float] | None, axis: int) -> list[Point]:
    """The points whose rays show what a camera does.

    Args:
        camera: through which they go.
        distances: of points on the axis, metres; None takes the distance in focus, also off the axis, and a nearer
            one.
        axis: 0 for x, 1 for y.

    Raises:
        InputError: a distance of 0 or less.
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
    """How much of the scene's side to draw, metres: a piece, or up to points that are close."""
    shown = SCENE_SHARE * (camera.sensor.z or 10 * mm)
    near = [point.distance for point in points if point.distance < 2.5 * shown]
    return max([shown, *(1.08 * distance for distance in near)])


def trace_point(
    camera: Train,
    point: Point,
    light_field: InMemory | None,
    axis: int,
    rays: int,
    start: float,
) -> Paths:
    """The fan from a point; it starts at the point itself where that is in the drawing.

    Args:
        camera: through which it goes.
        point: where it comes from.
        light_field: whose width on the entrance plane it fills; None fills the first lens with a rim.
        axis: 0 for x, 1 for y.
        rays: how many.
        start: of the drawing, metres, 0 or less.
    """
    low, high = _entrance(camera, point, light_field, axis)
    bundle = fan(np.linspace(low, high, rays), point.distance, point.offset, axis)
    return trace(camera, bundle, max(start, -point.distance), split_along=axis)


def _entrance(camera: Train, point: Point, light_field: InMemory | None, axis: int) -> tuple[float, float]:
    """From where to where on the entrance plane the rays of a point go, metres."""
    if light_field is not None:
        return _through_views(point, light_field, axis)
    found = list(openings(camera, axis))
    lenses = [one for one in found if isinstance(one[0], Lens | FirstOrder)]
    # A lens's rim says more about a camera than a mask's sheet; of a thick one all rims count.
    first = (lenses or found)[:1]
    rims = [one for one in found if one[0] is first[0][0]] if first else []
    low, high = -math.inf, math.inf
    for element, ray, half in rims:
        matrix = ray.matrix
        growth = float(matrix[axis, axis] + matrix[axis, axis + 2] / point.distance)
        if growth:
            # Just inside: the outermost ray must not end at the rim by rounding.
            reach = 0.97 * half / abs(growth)
            shift = element.decentre[axis] - matrix[axis, 4] + matrix[axis, axis + 2] * point.offset
            low, high = max(low, shift / growth - reach), min(high, shift / growth + reach)
    if low < high and math.isfinite(high - low):
        return low, high
    half = camera.sensor.size[1 - axis] / 3
    return -half, half


def _through_views(point: Point, light_field: InMemory, axis: int) -> tuple[float, float]:
    """Where the rays of a point that pass the outer borders of the views meet the entrance plane, metres.

    The border's pixel k that sees the point is the one whose place x and slope s have s = x/Z − offset, as its
    rays do; where the views stand in the entrance plane, x does not depend on k.
    """
    counts, linear, offset = light_field.shape[1::-1], light_field.frame.linear, light_field.frame.offset
    middle = np.array([(count - 1) / 2 for count in (*counts, light_field.shape[3], light_field.shape[2])])
    aside = np.where(np.arange(4) % 2 == axis, 0.0, middle)  # of the other axis the middle
    place, slope = (linear[n] @ aside + offset[n] for n in (axis, axis + 2))
    by_view, by_pixel = linear[np.ix_([axis, axis + 2], [axis, axis + 2])].T
    borders = np.array([-0.5, counts[axis] - 0.5])
    unlike = by_pixel[1] - by_pixel[0] / point.distance
    wanted = (place + by_view[0] * borders) / point.distance - point.offset - slope - by_view[1] * borders
    pixels = wanted / unlike if unlike else np.full(2, middle[axis + 2])
    low, high = np.sort(place + by_view[0] * borders + by_pixel[0] * pixels)
    return float(low), float(high)


def half_height(camera: Train, paths: Sequence[Paths], axis: int) -> float:
    """Half the height of a drawing, metres: bounded elements, the sensor, and rays within reason."""
    sizes = [camera.sensor.size[1 - axis] / 2 + abs(camera.sensor.decentre[axis])]
    halves = [(half_size(element, axis), abs(element.decentre[axis])) for element in camera.elements]
    sizes += [1.08 * half + decentre for half, decentre in halves if math.isfinite(half)]
    highest = max(float(np.abs(path.positions[:, 1:, axis]).max()) for path in paths)
    return max(*sizes, min(highest, 2 * max(sizes)))


def beam_at(element: Element, paths: Sequence[Paths], axis: int) -> float:
    """Half the height, around an element's middle, of the rays that are drawn through it, metres."""
    highest = 0.0
    for path in paths:
        inside = (path.z >= element.z) & (path.z <= element.z + element.length) & (path.z < path.z[-1])
        heights = np.abs(path.positions[:, inside, axis] - element.decentre[axis])
        highest = max(highest, float(np.where(path.shares[:, inside] > 0, heights, 0.0).max(initial=0.0)))
    return highest
