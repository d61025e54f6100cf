"""Draw one element from the side, with parallel light through it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from vcc.base import checks
from vcc.base.units import mm
from vcc.optics import CellDeflection, Element, Faces, Louvre, RealLens
from vcc.optics.real_lens import TracedLens
from vcc.optics.real_rays import entrance_box
from vcc.optics.sensor import Sensor
from vcc.optics.train import Train
from vcc.plot import style
from vcc.plot.camera_plot import draw_optical_axis, draw_paths
from vcc.plot.elements import Pen, draw_element, half_size
from vcc.plot.tracing import Paths, fan, trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

UNBOUNDED_SLOPE = 0.3
"""Slope up to which light is drawn that meets an element which filters directions without a bound."""
UNBOUNDED = 10 * mm
"""Half the drawn height of an element without a rim, metres."""
CELLS = 5
"""Number of cells of an array that are drawn; only light through these is drawn."""
RAYS, RAYS_THAT_SPLIT, RAYS_A_CELL = 9, 5, 5
ROOM_BEHIND = (1.5, 60.0)
"""Bounds for the length of the rays behind the element, in half heights of the drawing."""


def plot_element(element: Element, *, across: str = "x", axes: Axes | None = None) -> Axes:
    """Draw an element from the side, with parallel light through it to the right.

    Of an element without a rim, a part 20 mm high is drawn, of an array the five central cells. Rays continue
    about as far as the element needs to focus or separate them; z starts at the element.
    Elements that filter directions are drawn with light of three directions.

    Args:
        element: what to draw; its position is ignored.
        across: ``"x"`` or ``"y"``, the axis drawn upwards in the figure (y points down).
        axes: where to draw; None makes a new figure.

    Returns:
        The axes; ``.figure.savefig(path)`` writes them to a file.

    Raises:
        InputError: an invalid axis, or an element with an invalid result.
    """
    checks.one_of("across", across, "xy")
    axis = "xy".index(across)
    element = replace(element, z=0.0, decentre=(0.0, 0.0))
    if isinstance(element, RealLens):
        element = replace(element, front=0.0)
    half, rays = _part(element, axis)
    beam = _beam(element, half, axis)
    places = np.linspace(-0.97 * beam, 0.97 * beam, rays)
    bundle = np.concatenate([fan(places, math.inf, slope, axis) for slope in _slopes(element, axis)])
    paths = _traced(element, bundle, half, axis)
    end = float(paths.z[-1])
    before = 0.4 * (end - element.length)
    axes = style.new_axes(5.0, 2.9) if axes is None else axes
    axes.set_xlim(-before / mm, end / mm)
    reached = float(np.abs(paths.positions[:, :, axis]).max(initial=0.0))
    highest = 1.12 * max(half, min(reached, 1.6 * half)) / mm
    axes.set_ylim(*((-highest, highest) if axis == 0 else (highest, -highest)))
    pen = Pen(axis, -half, half, 0.03 * (end + before), axes)
    draw_optical_axis(axes)
    positions = paths.positions.copy()  # light arrives along straight lines, however far before it is drawn from
    arriving = (positions[:, 1] - positions[:, 0]) / (paths.z[1] - paths.z[0])
    positions[:, 0] = positions[:, 1] - arriving * before
    paths = replace(paths, z=np.array([-before, *paths.z[1:]]), positions=positions)
    draw_paths(axes, math.inf, paths, axis, style.BLUE)
    draw_element(pen, element, half)
    style.tidy(axes, "z from the element [mm]", f"{across} [mm]")
    return axes


def _part(element: Element, axis: int) -> tuple[float, int]:
    """Half the drawn height, metres, and the number of rays."""
    half = half_size(element, axis)
    if isinstance(element, Louvre):
        return 2.4 * element.pitch, 4 * RAYS_A_CELL
    faces = [part for part in element.parts() if isinstance(part, Faces)]
    cells = next((part.bending for part in faces if isinstance(part.bending, CellDeflection)), None)
    if cells is not None:
        return min(half, CELLS * cells.lattice.pitch / 2), RAYS_A_CELL * CELLS
    scatters = any(part.spread is not None for part in faces)
    return half if math.isfinite(half) else UNBOUNDED, RAYS_THAT_SPLIT if scatters else RAYS


def _beam(element: Element, half: float, axis: int) -> float:
    """Half the height of the light, metres: that which a real lens lets pass, or that of the drawing."""
    if not isinstance(element, TracedLens):
        return half
    train = Train([element], Sensor(z=element.length, shape=(1, 1), pitch=1.0))
    return float(entrance_box(train, math.inf, np.zeros(2))[1][axis])


def _slopes(element: Element, axis: int) -> tuple[float, ...]:
    """Slopes of the drawn light: 0, and two more for an element that filters directions."""
    faces = [part for part in element.parts() if isinstance(part, Faces)]
    terms = [term for part in faces for term in part.terms]
    if not terms and all(part.by_ray is None for part in faces):
        return (0.0,)
    steepest = min((term.steepest[axis] for term in terms), default=math.inf)
    most = steepest if math.isfinite(steepest) else UNBOUNDED_SLOPE
    return (0.0, 0.55 * most, -1.1 * most)


def _traced(element: Element, bundle: np.ndarray, half: float, axis: int) -> Paths:
    """Rays through the element and behind it, until their change of slope is visible."""

    def through(room: float) -> Paths:
        sensor = Sensor(z=element.occupied_length + room, shape=(1, 1), pitch=1.0)
        return trace(Train([element], sensor), bundle, -half, split_along=axis)

    one = through(half)
    slopes = np.diff(one.positions[..., axis][:, -2:], axis=1)[:, 0] / half
    steepest = float(np.abs(slopes[one.shares[:, -1] > 0]).max(initial=0.0))
    height = half / CELLS if len(bundle) == RAYS_A_CELL * CELLS else half  # each cell has its own focus
    wanted = 1.3 * height / steepest if steepest > 0 else 2 * half
    nearest, farthest = (bound * height for bound in ROOM_BEHIND)
    return through(min(max(wanted, nearest), farthest))
