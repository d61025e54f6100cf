"""A camera from the side: elements in their places, and fans of rays through them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.camera import Camera
from vcc.errors import InputError
from vcc.light_field import LightField
from vcc.optics import Element, Lens, Prism
from vcc.plot import style
from vcc.plot.tracing import Paths, fan, trace
from vcc.units import mm, short

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

RAYS = 9
"""In each fan from a point on the axis; odd, so that one goes along the axis."""
SCENE_SHARE = 0.45
"""How much of the scene's side is drawn, as a share of the camera's length."""
NEAR_BLUR = 0.25
"""The nearer point is taken so near that it blurs over this share of the entrance."""


def focused_distance(camera: Camera) -> float | None:
    """How far before the entrance plane a point must be to be sharp on the sensor, metres.

    With position and slope at the entrance mapped to the sensor by x = A·u + B·s, a point at
    distance Z sends s = u/Z, and all its rays meet where A + B/Z = 0.

    Returns:
        The distance; infinite if parallel light is brought to a point; None if no real point is
        sharp (a camera without a lens, or one focused beyond infinity).
    """
    matrix = camera.rays_at(camera.sensor.z, before=True).matrix
    position, slope = float(matrix[0, 0]), float(matrix[0, 2])
    if abs(position) <= 1e-12:
        return math.inf if slope != 0 else None
    distance = -slope / position
    return distance if distance > 0 else None


def plot_camera(
    camera: Camera,
    *,
    light_field: LightField | None = None,
    object_distances: Sequence[float] | None = None,
    across: str = "x",
    rays: int = RAYS,
    axes: Axes | None = None,
) -> Axes:
    """Draw a camera from the side: light goes to the right, the scene is at the left.

    Elements stand in their true places with their true heights (their thickness is a symbol), rays
    bend as in the camera, and one that a mask or a rim stops ends there. Heights are magnified
    against z as the axes show. Of the scene's side only a piece is drawn: rays enter with their
    true slopes.

    Args:
        camera: what to draw.
        light_field: whose width on the entrance plane the rays fill; without it they fill the
            first element that has a rim.
        object_distances: of points on the axis, metres before the entrance plane (infinity for
            parallel light), one colour for each. None draws the distance in focus, also off the
            axis, and a nearer one.
        across: ``"x"`` or ``"y"``, the axis drawn upwards in the figure (y points down).
        rays: how many from each point.
        axes: where to draw; None makes a new figure.

    Returns:
        The axes; ``.figure.savefig(path)`` writes them to a file.

    Raises:
        InputError: another axis, fewer than 2 rays or an object distance of 0 or less.
    """
    if across not in ("x", "y"):
        raise InputError(f'across is "x" or "y", not {across!r}')
    if rays < 2:
        raise InputError(f"a fan has 2 rays or more, not {rays}")
    axis = "xy".index(across)
    points = _points(camera, object_distances, axis)
    if axes is None:
        axes = style.new_axes(9.5, 4.8)
    start = -_scene_length(camera, points)
    paths = [
        _trace_point(camera, point, light_field, axis, rays if not point.offset else 3, start) for point in points
    ]
    half = _half_height(camera, paths, axis)
    pen = _Pen(axes, axis, half, camera.sensor.z - start)
    _set_limits(axes, start, camera.sensor.z, half, across)
    axes.axhline(0, color=style.QUIET, linewidth=0.8, linestyle=(0, (8, 3, 1, 3)), zorder=0)
    for point, path in zip(points, paths, strict=True):
        _draw_paths(axes, point, path, axis, start)
    for element in camera.elements:
        _draw_element(pen, element)
    _draw_sensor(pen, camera)
    _draw_labels(pen, camera)
    axes.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.16),
        ncols=len(points),
        frameon=False,
        fontsize=style.SMALL,
        handlelength=1.5,
        columnspacing=1.6,
    )
    style.tidy(axes, "z [mm], light goes to the right", f"{across} [mm]")
    return axes


# --- which rays ---


@dataclass(frozen=True)
class _Point:
    """A point of the scene: its distance in metres, its place off the axis as a slope, its look."""

    distance: float
    offset: float
    colour: str
    label: str


def _points(camera: Camera, distances: Sequence[float] | None, axis: int) -> list[_Point]:
    colours = (style.BLUE, style.ORANGE, style.GREEN)
    if distances is not None:
        for distance in distances:
            if not distance > 0:
                raise InputError(f"an object distance must be greater than 0 m, not {distance}")
        return [
            _Point(distance, 0.0, colours[number % 3], f"point {_away(distance)}")
            for number, distance in enumerate(distances)
        ]
    matrix = camera.rays_at(camera.sensor.z, before=True).matrix
    reach = abs(float(matrix[axis, 2 + axis])) or max(camera.sensor.z, 10 * mm)
    focus = focused_distance(camera)
    far = math.inf if focus is None else focus
    near = _rounded(1 / (NEAR_BLUR / reach + 1 / far))
    points = [
        _Point(far, 0.0, style.BLUE, f"{'in focus' if focus else 'not in focus'}: {_away(far)}"),
        _Point(near, 0.0, style.ORANGE, f"nearer: {_away(near)}"),
    ]
    if focus is not None:
        landing = 0.3 * camera.sensor.size[1 - axis]
        points.append(_Point(far, landing / reach, style.GREEN, f"in focus, off the axis: {_away(far)}"))
    return points


def _rounded(length: float) -> float:
    return float(f"{length:.2g}")


def _away(distance: float) -> str:
    return "parallel light" if math.isinf(distance) else f"{short(distance, digits=3)} away"


def _scene_length(camera: Camera, points: list[_Point]) -> float:
    """How much of the scene's side to draw, metres: a piece, or up to points that are close."""
    shown = SCENE_SHARE * (camera.sensor.z or 10 * mm)
    near = [point.distance for point in points if point.distance < 2.5 * shown]
    return max([shown, *(1.08 * distance for distance in near)])


def _trace_point(
    camera: Camera,
    point: _Point,
    light_field: LightField | None,
    axis: int,
    rays: int,
    start: float,
) -> Paths:
    """The fan from a point; it starts at the point itself where that is in the drawing."""
    low, high = _entrance(camera, point, light_field, axis)
    bundle = fan(np.linspace(low, high, rays), point.distance, point.offset, axis)
    return trace(camera, bundle, max(start, -point.distance))


def _entrance(camera: Camera, point: _Point, light_field: LightField | None, axis: int) -> tuple[float, float]:
    """From where to where on the entrance plane the rays of a point go, metres."""
    if light_field is not None:
        ends = np.array(light_field.shape[1::-1]) - 0.5
        corners = np.array([[-0.5, -0.5, 0, 0], [ends[0], ends[1], 0, 0]])
        low, high = np.sort(light_field.frame(corners)[:, axis])
        return float(low), float(high)
    for rim in (True, False):  # a lens's rim says more about a camera than a mask's sheet
        for element in camera.elements:
            half = _half_size(element, axis)
            if math.isinf(half) or isinstance(element, Lens) != rim:
                continue
            matrix = camera.rays_at(element.z, before=True).matrix
            growth = float(matrix[axis, axis] + matrix[axis, axis + 2] / point.distance)
            if growth:
                # Just inside: the outermost ray must not end at the rim by rounding.
                reach = 0.97 * half / abs(growth)
                shift = (element.decentre[axis] + matrix[axis, axis + 2] * point.offset) / growth
                return shift - reach, shift + reach
    half = camera.sensor.size[1 - axis] / 3
    return -half, half


def _half_size(element: Element, axis: int) -> float:
    pattern = element.faces().pattern
    return math.inf if pattern is None else pattern.size[axis] / 2


# --- drawing ---


@dataclass(frozen=True)
class _Pen:
    """Where and how large to draw: the axes, 0 for x or 1 for y, half the height and the length, m."""

    axes: Axes
    axis: int
    half: float
    length: float

    def fill(self, z: Any, height: Any, **options: Any) -> None:
        from matplotlib.patches import Polygon

        points = np.column_stack([np.asarray(z) / mm, np.asarray(height) / mm])
        self.axes.add_patch(Polygon(points, closed=True, **options))


def _half_height(camera: Camera, paths: list[Paths], axis: int) -> float:
    """Half the height of the drawing, metres: bounded elements, the sensor, and rays within reason."""
    sizes = [camera.sensor.size[1 - axis] / 2 + abs(camera.sensor.decentre[axis])]
    sizes += [
        1.08 * _half_size(element, axis) + abs(element.decentre[axis])
        for element in camera.elements
        if math.isfinite(_half_size(element, axis))
    ]
    highest = max(float(np.abs(path.positions[:, 1:, axis]).max()) for path in paths)
    return max(*sizes, min(highest, 2 * max(sizes)))


def _set_limits(axes: Axes, start: float, end: float, half: float, across: str) -> None:
    length = end - start
    axes.set_xlim((start - 0.02 * length) / mm, (end + 0.06 * length) / mm)
    up = -1 if across == "y" else 1  # y points down
    axes.set_ylim(-1.12 * up * half / mm, 1.12 * up * half / mm)


def _draw_paths(axes: Axes, point: _Point, paths: Paths, axis: int, start: float) -> None:
    """Each ray piece by piece, fainter where a mask took part of it; a dot where one is stopped."""
    z, heights = paths.z / mm, paths.positions[..., axis] / mm
    label = point.label
    for height, shares in zip(heights, paths.shares, strict=True):
        for piece in range(len(z) - 1):
            share = shares[piece + 1]
            if share <= 0:
                if shares[piece] > 0:
                    axes.plot(z[piece], height[piece], ".", color=point.colour, markersize=5)
                break
            axes.plot(
                z[piece : piece + 2],
                height[piece : piece + 2],
                color=point.colour,
                linewidth=1.1,
                alpha=0.25 + 0.6 * share,
                solid_capstyle="round",
                zorder=2,
                label=label,
            )
            label = ""
    if point.distance <= -start:
        axes.plot(z[0], heights[:, 0].mean(), "o", color=point.colour, markersize=5)


def _draw_element(pen: _Pen, element: Element) -> None:
    if isinstance(element, Lens):
        _draw_lens(pen, element)
    elif isinstance(element, Prism):
        _draw_prism(pen, element)
    elif element.faces().pattern is None:
        _draw_sheet(pen, element)
    if element.faces().pattern is not None and not isinstance(element, Lens):
        _draw_mask(pen, element)


def _draw_lens(pen: _Pen, lens: Lens) -> None:
    """Two arcs, bulging for a converging lens and hollow for a diverging one; a stop outside the rim."""
    bounded = lens.diameter is not None
    half = lens.diameter / 2 if lens.diameter is not None else 1.02 * pen.half
    across = np.linspace(-1, 1, 41)
    thick = 0.016 * pen.length
    bulge = 1 - across**2
    depth = thick * (0.1 + bulge) if lens.focal_length > 0 else thick * (1.05 - 0.8 * bulge)
    height = half * across + lens.decentre[pen.axis]
    pen.fill(
        np.concatenate([lens.z - depth, lens.z + depth[::-1]]),
        np.concatenate([height, height[::-1]]),
        facecolor=style.GLASS,
        edgecolor=style.GLASS_EDGE,
        alpha=0.85,
        linewidth=1.2,
        linestyle="-" if bounded else (0, (4, 2)),
        zorder=1,
    )
    if bounded:
        _draw_stop(pen, lens, half)


def _draw_stop(pen: _Pen, element: Element, half: float) -> None:
    """The opaque surroundings of an opening: heavy at its edge, thin further out."""
    centre, z = element.decentre[pen.axis], element.z / mm
    for side in (-1, 1):
        edge = centre + side * half
        for end, width in ((edge + side * 0.08 * pen.half, 3.0), (side * 1.06 * pen.half, 1.0)):
            if side * (end - edge) > 0:
                pen.axes.plot(
                    [z, z],
                    [edge / mm, end / mm],
                    color=style.INK,
                    linewidth=width,
                    solid_capstyle="butt",
                    zorder=3,
                )


def _draw_prism(pen: _Pen, prism: Prism) -> None:
    """A wedge, thick on the side to which it deflects."""
    half, thick = 1.02 * pen.half, 0.016 * pen.length
    side = 1.0 if prism.deflection[pen.axis] >= 0 else -1.0
    flat = prism.deflection[pen.axis] == 0  # it deflects along the other axis only
    top, base = half * -side, half * side
    tip = thick if flat else 0.05 * thick
    pen.fill(
        prism.z + np.array([-tip, tip, thick, -thick]),
        np.array([top, top, base, base]),
        facecolor=style.GLASS,
        edgecolor=style.GLASS_EDGE,
        alpha=0.85,
        linewidth=1.2,
        linestyle=(0, (4, 2)),
        zorder=1,
    )


def _draw_sheet(pen: _Pen, element: Element) -> None:
    """What has neither a known shape nor a transmission: a thin sheet."""
    z = element.z / mm
    limit = 1.02 * pen.half / mm
    pen.axes.plot([z, z], [-limit, limit], color=style.GLASS_EDGE, linewidth=2, zorder=1)


def _draw_mask(pen: _Pen, element: Element) -> None:
    """The mask's middle row as a bar, black where it is opaque and white where it is open."""
    pattern = element.faces().pattern
    assert pattern is not None
    half = min(pattern.size[pen.axis] / 2, 1.02 * pen.half)
    steps = (np.arange(1024) + 0.5) / 512 - 1
    places = [half * steps, np.zeros(1)]
    x, y = places if pen.axis == 0 else places[::-1]
    values = np.asarray(pattern(x, y))
    # Neighbours that are alike become one piece, so that a picture for print stays small.
    cuts = np.flatnonzero(np.diff(values)) + 1
    edges = half * np.concatenate([[-1.0], cuts / 512 - 1, [1.0]]) + element.decentre[pen.axis]
    wide = 0.007 * pen.length
    pen.axes.pcolormesh(
        np.array([element.z - wide, element.z + wide]) / mm,
        edges / mm,
        values[np.concatenate([[0], cuts])][:, None],
        cmap="gray",
        vmin=0,
        vmax=1,
        zorder=3,
    )
    pen.fill(
        element.z + wide * np.array([-1, 1, 1, -1]),
        edges[[0, 0, -1, -1]],
        facecolor="none",
        edgecolor=style.INK,
        linewidth=0.8,
        zorder=3.1,
    )
    if math.isfinite(pattern.size[pen.axis]):
        _draw_stop(pen, element, half)


def _draw_sensor(pen: _Pen, camera: Camera) -> None:
    sensor = camera.sensor
    half, thick = sensor.size[1 - pen.axis] / 2, 0.02 * pen.length
    pen.fill(
        sensor.z + np.array([0, thick, thick, 0]),
        sensor.decentre[pen.axis] + half * np.array([-1, -1, 1, 1]),
        facecolor="#5A5A5A",
        edgecolor=style.INK,
        linewidth=1.0,
        zorder=3,
    )


def _draw_labels(pen: _Pen, camera: Camera) -> None:
    """What each thing is, side by side above the drawing, each with a line to its place."""
    sensor = camera.sensor
    rows, columns = sensor.shape
    pitch = short(sensor.pitches[1 - pen.axis], digits=4).replace("um", "µm")
    things = [(element.z, _describe(element)) for element in camera.elements]
    things.append((sensor.z, f"sensor\n{rows} × {columns}, {pitch}"))
    frame = pen.axes.get_xaxis_transform()
    labels = [
        pen.axes.annotate(
            words,
            (z / mm, 1.0),
            xycoords=frame,
            xytext=(z / mm, 1.07),
            textcoords=frame,
            ha="center",
            va="bottom",
            fontsize=style.SMALL,
            color=style.INK,
            annotation_clip=False,
            arrowprops={
                "arrowstyle": "-",
                "color": style.QUIET,
                "linewidth": 0.8,
                "relpos": (0.5, 0.0),
                "shrinkA": 1,
                "shrinkB": 0,
            },
        )
        for z, words in _merged(things)
    ]
    left, right = pen.axes.get_xlim()
    millimetres = (right - left) / pen.axes.bbox.width  # per pixel
    widths = [(label.get_window_extent().width + 10) * millimetres for label in labels]
    places = spread([label.xy[0] for label in labels], widths)
    for label, place in zip(labels, places, strict=True):
        label.set_position((place, 1.07))


def spread(wanted: Sequence[float], widths: Sequence[float]) -> list[float]:
    """Middles of things side by side that do not overlap, as near to the wanted ones as can be.

    Args:
        wanted: the middles asked for, increasing.
        widths: of the things, in the same unit.
    """
    # Without the room that all before it take, "no overlap" is "not decreasing", and the nearest
    # such sequence has the means of groups that would decrease (pool adjacent violators).
    room = np.concatenate([[0.0], np.cumsum((np.array(widths[:-1]) + np.array(widths[1:])) / 2)])
    groups: list[list[float]] = []
    for place in np.array(wanted) - room:
        groups.append([place])
        while len(groups) > 1 and np.mean(groups[-2]) > np.mean(groups[-1]):
            last = groups.pop()
            groups[-1].extend(last)
    means = [float(np.mean(group)) for group in groups for _ in group]
    return [float(mean + taken) for mean, taken in zip(means, room, strict=True)]


def _merged(things: list[tuple[float, str]]) -> list[tuple[float, str]]:
    """Things at one place share a label."""
    merged: list[tuple[float, str]] = []
    for z, words in things:
        if merged and merged[-1][0] == z:
            merged[-1] = (z, f"{merged[-1][1]}\n{words}")
        else:
            merged.append((z, words))
    return merged


def _describe(element: Element) -> str:
    first = f"{element.kind} {element.name}".strip()
    if isinstance(element, Lens):
        focal_length = short(element.focal_length, digits=4).replace("-", "−")
        return f"{first}\nf = {focal_length}"
    if isinstance(element, Prism):
        return f"{first}\nδ = {element.deflection[0]:.3g}, {element.deflection[1]:.3g}".replace("-", "−")
    return first
