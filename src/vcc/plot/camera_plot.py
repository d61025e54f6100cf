"""A camera from the side: elements in their places, and fans of rays through them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import mm, short
from vcc.fields.samples import InMemory
from vcc.optics import CellDeflection, Element, FirstOrder, Lens
from vcc.optics.train import Stage, Train
from vcc.plot import style
from vcc.plot.elements import Pen, draw_element, draw_sensor, half_size, magnification
from vcc.plot.labels import draw_labels
from vcc.plot.tracing import Paths, fan, openings, trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

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
CELLS_MAGNIFIED = 5
"""Of an array, in the magnified piece beside the drawing."""
RAYS_A_CELL = 5
"""There, about so many of a fan go through each cell."""


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


def _to_focus(camera: Train) -> Affine:
    """Rays from the entrance plane to the plane in which a picture must stand to be sharp on the sensor."""
    stage = _lenslets(camera)
    if stage is None:
        return camera.rays_at(camera.sensor.z, before=True)
    assert isinstance(stage.faces.bending, CellDeflection)
    behind = camera.sensor.z - stage.z
    vergence = float(stage.faces.bending.powers.flat[0]) - 1 / behind
    to_array = camera.rays_at(stage.z)
    if abs(vergence * behind) > 1e-6:
        return Affine.propagation(-1 / vergence) @ to_array
    if to_array.matrix[2, 0] == 0 or to_array.matrix[0, 2] == 0:
        # Nothing before the array can focus on it: light that is parallel there is sharp, x = s.
        return Affine.abcd(((0.0, 1.0), (-1.0, 0.0))) @ to_array
    return to_array


def plot_camera(
    camera: Train,
    *,
    light_field: InMemory | None = None,
    object_distances: Sequence[float] | None = None,
    across: str = "x",
    rays: int | None = None,
    magnified: Axes | bool | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw a camera from the side: light goes to the right, the scene is at the left.

    Elements stand in their true places with their true heights; their thickness is a symbol, and glass that bends
    rays otherwise than a lens or a prism has the profile that does so. Rays bend as in the camera, and one that a
    mask or a rim stops ends there in a dot. Where a diffuser scatters, each ray goes on as three, fainter ones, at
    the 1/6, 1/2 and 5/6 quantiles of the kernel, each with a third of the light. Heights are magnified against z
    as the axes show. Of the scene's side only a piece is drawn: rays enter with their true slopes.

    An array of very many cells is drawn with fewer, larger ones (its label says so), while rays bend as the true
    cells do; some true cells, the sensor's pixels and their rays are shown magnified beside the drawing.

    Args:
        camera: what to draw.
        light_field: whose width on the entrance plane the rays fill; without it they fill the
            first lens that has a rim, or else the first element that has one.
        object_distances: of points on the axis, metres before the entrance plane (infinity for
            parallel light), one colour for each. None draws the distance in focus, also off the
            axis, and a nearer one.
        across: ``"x"`` or ``"y"``, the axis drawn upwards in the figure (y points down).
        rays: how many from each point; None takes 9, and 5 where diffusers split them.
        magnified: whether to draw a magnified piece of an array of cells beside a new figure's drawing, or the
            axes in which to draw it; None does so on a new figure, for arrays whose cells are too small to see.
        axes: where to draw; None makes a new figure.

    Returns:
        The axes; ``.figure.savefig(path)`` writes them to a file.

    Raises:
        InputError: another axis, fewer than 2 rays, an object distance of 0 or less, a magnified piece of a
            camera without an array before its sensor or without axes for it beside given ones, or an element that
            returns what it must not.
    """
    checks.one_of("across", across, "xy")
    if rays is not None:
        checks.whole_number_between("rays", rays, 2)
    if magnified is True and axes is not None:
        raise InputError("beside axes that are given, a magnified piece needs axes too: pass them as magnified=")
    from matplotlib.lines import Line2D

    axis = "xy".index(across)
    scattering = any(stage.faces.spread is not None for stage in camera.stages)
    rays = rays or (RAYS_THAT_SPLIT if scattering else RAYS)
    points = _points(camera, object_distances, axis)
    start = -_scene_length(camera, points)
    paths = [
        _trace_point(camera, point, light_field, axis, OFF_AXIS_RAYS if point.offset else rays, start)
        for point in points
    ]
    half = _half_height(camera, paths, axis)
    wanted = axes is None if magnified is None else magnified is not False
    array = _array_to_magnify(camera, axis, half, needed=bool(magnified)) if wanted else None
    beside = None if isinstance(magnified, bool) else magnified
    own_figure = axes is None
    if axes is None:
        if array is None or beside is not None:
            axes = style.new_axes(9.5, 4.8)
        else:
            axes, beside = style.new_axes(11.5, 4.8, 1, 2, width_ratios=(2.4, 1))
    pen = Pen(axes, axis, -half, half, 0.016 * (camera.sensor.z - start))
    set_limits(axes, start, camera.sensor.z, half, across)
    draw_optical_axis(axes)
    for point, path in zip(points, paths, strict=True):
        draw_paths(axes, point, path, axis)
    for element in camera.elements:
        draw_element(pen, element, _beam(element, paths, axis))
    draw_sensor(pen, camera.sensor)
    axes.legend(
        handles=[Line2D([], [], color=point.colour, label=point.label) for point in points],
        loc="upper center",
        bbox_to_anchor=(0.5, -0.16),
        ncols=len(points),
        frameon=False,
        fontsize=style.SMALL,
        handlelength=1.5,
        columnspacing=1.6,
    )
    style.tidy(axes, "z [mm], light goes to the right", f"{across} [mm]")
    if array is not None and beside is not None:
        _draw_magnified(beside, axes, camera, array, points, light_field, axis)
    draw_labels(pen, camera, own_figure)
    return axes


# --- which rays ---


@dataclass(frozen=True)
class ScenePoint:
    """A point of the scene: its distance in metres, its place off the axis as a slope, its look."""

    distance: float
    offset: float
    colour: str
    label: str


def _points(camera: Train, distances: Sequence[float] | None, axis: int) -> list[ScenePoint]:
    colours = (style.BLUE, style.ORANGE, style.GREEN)
    if distances is not None:
        for distance in distances:
            checks.above_zero("an object distance", distance, unit="m", infinite=True)
        return [
            ScenePoint(distance, 0.0, colours[number % 3], f"point {_away(distance)}")
            for number, distance in enumerate(distances)
        ]
    matrix = camera.rays_at(camera.sensor.z, before=True).matrix
    reach = abs(float(matrix[axis, 2 + axis])) or max(camera.sensor.z, 10 * mm)
    focus = focused_distance(camera)
    far = math.inf if focus is None else focus
    near = _rounded(1 / (NEAR_BLUR / reach + 1 / far))
    points = [
        ScenePoint(far, 0.0, style.BLUE, f"{'in focus' if focus else 'not in focus'}: {_away(far)}"),
        ScenePoint(near, 0.0, style.ORANGE, f"nearer: {_away(near)}"),
    ]
    if focus is not None:
        landing = 0.3 * camera.sensor.size[1 - axis]
        points.append(ScenePoint(far, landing / reach, style.GREEN, f"in focus, off the axis: {_away(far)}"))
    return points


def _rounded(length: float) -> float:
    return float(f"{length:.2g}")


def _away(distance: float) -> str:
    return "parallel light" if math.isinf(distance) else f"{short(distance, digits=3)} away"


def _scene_length(camera: Train, points: list[ScenePoint]) -> float:
    """How much of the scene's side to draw, metres: a piece, or up to points that are close."""
    shown = SCENE_SHARE * (camera.sensor.z or 10 * mm)
    near = [point.distance for point in points if point.distance < 2.5 * shown]
    return max([shown, *(1.08 * distance for distance in near)])


def _trace_point(
    camera: Train,
    point: ScenePoint,
    light_field: InMemory | None,
    axis: int,
    rays: int,
    start: float,
) -> Paths:
    """The fan from a point; it starts at the point itself where that is in the drawing."""
    low, high = _entrance(camera, point, light_field, axis)
    bundle = fan(np.linspace(low, high, rays), point.distance, point.offset, axis)
    return trace(camera, bundle, max(start, -point.distance), split_along=axis)


def _entrance(camera: Train, point: ScenePoint, light_field: InMemory | None, axis: int) -> tuple[float, float]:
    """From where to where on the entrance plane the rays of a point go, metres."""
    if light_field is not None:
        ends = np.array(light_field.shape[1::-1]) - 0.5
        corners = np.array([[-0.5, -0.5, 0, 0], [ends[0], ends[1], 0, 0]])
        low, high = np.sort(light_field.frame(corners)[:, axis])
        return float(low), float(high)
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


# --- drawing ---


def _half_height(camera: Train, paths: list[Paths], axis: int) -> float:
    """Half the height of the drawing, metres: bounded elements, the sensor, and rays within reason."""
    sizes = [camera.sensor.size[1 - axis] / 2 + abs(camera.sensor.decentre[axis])]
    halves = [(half_size(element, axis), abs(element.decentre[axis])) for element in camera.elements]
    sizes += [1.08 * half + decentre for half, decentre in halves if math.isfinite(half)]
    highest = max(float(np.abs(path.positions[:, 1:, axis]).max()) for path in paths)
    return max(*sizes, min(highest, 2 * max(sizes)))


def _beam(element: Element, paths: list[Paths], axis: int) -> float:
    """Half the height, around an element's middle, of the rays that are drawn through it, metres."""
    highest = 0.0
    for path in paths:
        inside = (path.z >= element.z) & (path.z <= element.z + element.length) & (path.z < path.z[-1])
        heights = np.abs(path.positions[:, inside, axis] - element.decentre[axis])
        highest = max(highest, float(np.where(path.shares[:, inside] > 0, heights, 0.0).max(initial=0.0)))
    return highest


def set_limits(axes: Axes, start: float, end: float, half: float, across: str) -> None:
    """Axes from so far before the camera to its end, metres, with a margin."""
    length = end - start
    axes.set_xlim((start - 0.02 * length) / mm, (end + 0.06 * length) / mm)
    up = -1 if across == "y" else 1  # y points down
    axes.set_ylim(-1.12 * up * half / mm, 1.12 * up * half / mm)


def draw_optical_axis(axes: Axes) -> None:
    """The line on which elements stand."""
    axes.axhline(0, color=style.QUIET, linewidth=0.8, linestyle=(0, (8, 3, 1, 3)), zorder=0)


def draw_paths(axes: Axes, point: ScenePoint, paths: Paths, axis: int, width: float = 1.1) -> None:
    """Each ray piece by piece, fainter where it lost light; a dot where one is stopped."""
    z, heights = paths.z / mm, paths.positions[..., axis] / mm
    for height, shares, first in zip(heights, paths.shares, paths.starts, strict=True):
        for piece in range(first, len(z) - 1):
            share = shares[piece + 1]
            if share <= 0:
                if shares[piece] > 0:
                    axes.plot(z[piece], height[piece], ".", color=point.colour, markersize=5)
                break
            axes.plot(
                z[piece : piece + 2],
                height[piece : piece + 2],
                color=point.colour,
                linewidth=width * (0.6 + 0.4 * share),
                alpha=0.3 + 0.55 * share,
                solid_capstyle="round",
                zorder=2,
            )
    if z[0] <= -point.distance / mm:
        axes.plot(z[0], heights[:, 0].mean(), "o", color=point.colour, markersize=5)


# --- a magnified piece of an array ---


def _array_to_magnify(camera: Train, axis: int, half: float, needed: bool) -> Stage | None:
    """The last array of cells before the sensor; None where it has none, or (unless needed) none that is small."""
    arrays = [
        stage
        for stage in camera.stages
        if isinstance(stage.faces.bending, CellDeflection) and stage.z < camera.sensor.z
    ]
    if needed:
        if not arrays:
            raise InputError("magnified needs an array of cells before the sensor, and this camera has none")
        return arrays[-1]
    small = [one for one in arrays if magnification(one.element, one.faces, axis, -half, half) > 1]
    return small[-1] if small else None


def _draw_magnified(
    inset: Axes,
    axes: Axes,
    camera: Train,
    stage: Stage,
    points: list[ScenePoint],
    light_field: InMemory | None,
    axis: int,
) -> None:
    """Some cells in the middle of an array, with what is behind them up to the sensor."""
    cells = stage.faces.bending
    assert isinstance(cells, CellDeflection)
    pitch = cells.lattice.pitch
    gap = camera.sensor.z - stage.z
    centre = np.array(stage.element.decentre)
    middle = float((centre + cells.lattice.centre_of(*cells.lattice.cell_of(*-centre)))[axis])
    low, high = middle - CELLS_MAGNIFIED / 2 * pitch, middle + CELLS_MAGNIFIED / 2 * pitch
    inset.set_xlim((stage.z - 0.45 * gap) / mm, (camera.sensor.z + 0.12 * gap) / mm)
    inset.set_ylim(*((low / mm, high / mm) if axis == 0 else (high / mm, low / mm)))
    pen = Pen(inset, axis, low, high, 0.035 * gap)
    draw_optical_axis(inset)
    to_array = camera.rays_at(stage.z)
    for point in points:
        # Off the axis so far that its light goes through the next cell.
        aside = to_array.matrix[axis, axis + 2]
        if point.offset and aside:
            point = replace(point, offset=-pitch / float(aside))
        ends = _trace_point(camera, point, light_field, axis, 2, 0.0)
        at_array = ends.positions[:, int(np.argmax(ends.z >= stage.z)), axis]
        number = int(np.clip(RAYS_A_CELL * np.ptp(at_array) / pitch, RAYS, 20 * RAYS))
        draw_paths(inset, point, _trace_point(camera, point, light_field, axis, number, 0.0), axis, width=0.9)
    for element in camera.elements:
        if element.z >= stage.z:
            draw_element(pen, element)
    draw_sensor(pen, camera.sensor, most_pixels=200)
    inset.locator_params(nbins=4)
    inset.set_title(f"{CELLS_MAGNIFIED} cells magnified", fontsize=style.SMALL, color=style.INK)
    style.tidy(inset, "z [mm]", f"{'xy'[axis]} [mm]")
    inset.spines[["top", "right"]].set_visible(True)
    inset.spines[:].set_color(style.QUIET)
    inset.yaxis.set_label_position("right")
    inset.yaxis.tick_right()
    _join(axes, (camera.sensor.z, low, high), inset)


def _join(axes: Axes, piece: tuple[float, float, float], inset: Axes) -> None:
    """Lines from a piece of the drawing, (z, low, high) in metres, to the axes in which it is magnified."""
    from matplotlib.patches import ConnectionPatch

    z, low, high = piece
    for height, corner in ((low, 0.0), (high, 1.0)):
        up = 1 - corner if inset.yaxis_inverted() else corner
        line = ConnectionPatch(
            (z / mm, height / mm),
            (0.0, up),
            axes.transData,
            inset.transAxes,
            axesA=axes,
            axesB=inset,
            color=style.QUIET,
            linewidth=0.8,
            zorder=4,
        )
        line.set_in_layout(False)
        axes.figure.add_artist(line)
