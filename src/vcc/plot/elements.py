"""Draw optical elements from the side: their glass, their stops, their scattering.

An element is drawn from its faces, so that user-defined elements need no code here: glass has the profile whose
slopes bend rays as the element does, diffusers are frosted, and opaque parts are black.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.optics import (
    CellDeflection,
    Deflection,
    Element,
    Faces,
    FirstOrder,
    Lens,
    Louvre,
    Prism,
    RayTableLens,
    RealLens,
    Scatter,
)
from vcc.optics.refraction import Refraction
from vcc.optics.sensor import Sensor
from vcc.plot import style
from vcc.plot.tracing import Crossing, crossings, spread_along
from vcc.shapes.patterns import Pattern

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

MOST_CELLS = 60
"""An array with more cells than this in the height of the drawing is drawn with fewer, larger ones."""
CELLS_INSTEAD = 40
"""Approximate number of these cells."""
POINTS = 801
"""Number of points at which a glass profile is evaluated."""
MOST_WALLS = 60
"""Walls of a louvre that are drawn; with more, a dotted sheet is drawn."""


@dataclass(frozen=True)
class Span:
    """The drawn range of heights.

    Args:
        axis: 0 draws x upwards, 1 draws y.
        low: the lowest height drawn, metres.
        high: the highest, metres.
    """

    axis: int
    low: float
    high: float

    @property
    def half(self) -> float:
        """Half the height of the drawing, metres."""
        return (self.high - self.low) / 2


@dataclass(frozen=True)
class Pen(Span):
    """Where and how large to draw.

    Args:
        axis: see `Span`.
        low: see `Span`.
        high: see `Span`.
        thick: half the thickness of a lens symbol, metres; thin elements have no thickness.
        axes: in millimetres.
    """

    thick: float
    axes: Axes

    def fill(self, z: Any, height: Any, **options: Any) -> None:
        """A closed polygon; z and height in metres."""
        from matplotlib.patches import Polygon

        points = np.column_stack([np.asarray(z) / mm, np.asarray(height) / mm])
        self.axes.add_patch(Polygon(points, closed=True, **options))

    def line(self, z: Any, height: Any, **options: Any) -> None:
        """A line; z and height in metres."""
        self.axes.plot(np.asarray(z) / mm, np.asarray(height) / mm, **options)

    def glass(self, z: Any, height: Any, bounded: bool, **options: Any) -> None:
        """A closed piece of glass; its outline is dashed if it has no rim."""
        looks = {"facecolor": style.GLASS, "edgecolor": style.GLASS_EDGE, "alpha": 0.85, "linewidth": 1.2}
        self.fill(z, height, linestyle="-" if bounded else (0, (4, 2)), **{"zorder": 1, **looks, **options})


def half_size(element: Element, axis: int) -> float:
    """Half the height of an element, metres; infinite without a rim.

    For a thick element, half the widest beam of distant light that passes one of its openings.
    """
    if isinstance(element, RealLens):
        rims = [surface.radius for surface in element.onward if math.isfinite(surface.radius)]
        return max([*rims, *([element.mask.size[axis] / 2] if element.mask is not None else [])])
    if isinstance(element, RayTableLens):
        return element.half_size
    halves = []
    for crossing in crossings(element):
        half = half_opening(crossing.faces, axis)
        growth = abs(float(crossing.from_entrance.matrix[axis, axis]))
        if math.isfinite(half):
            halves.append(max(half, half / growth if growth > 0.1 else half))
    return max(halves, default=math.inf)


def half_opening(faces: Faces, axis: int) -> float:
    """Half the height of the opening, metres; infinite without one."""
    return math.inf if faces.pattern is None else faces.pattern.size[axis] / 2


def draw_element(pen: Pen, element: Element, beam: float = 0.0) -> None:
    """Draw an element at its position.

    Args:
        pen: where and how large.
        element: what to draw.
        beam: half the height of the rays through it, metres: the drawn size of a thick element with unknown rims.
    """
    if isinstance(element, RealLens):
        _draw_real_lens(pen, element, beam)
        return
    planes = crossings(element)
    if len(planes) > 1 or element.length > 0:
        _draw_block(pen, element, planes, beam)
    elif isinstance(element, Lens):
        _draw_lens(pen, element)
    elif isinstance(element, Prism):
        _draw_prism(pen, element)
    elif isinstance(element, Louvre):
        _draw_louvre(pen, element)
    else:
        _draw_by_faces(pen, element, planes[0].faces)


def _draw_real_lens(pen: Pen, lens: RealLens, beam: float) -> None:
    """The glass between the surfaces of a real lens, and its stop as two blades.

    Surfaces without a clear diameter are drawn as far as the drawn rays reach.
    """
    centre, unknown = lens.decentre[pen.axis], 1.05 * beam or half_size(lens, pen.axis)
    arcs, z = [], lens.z
    for surface in lens.onward:
        z += surface.distance
        half = min(surface.radius if math.isfinite(surface.radius) else unknown, _widest_sag(surface))
        height = np.linspace(-half, half, 121)
        arcs.append((z + surface.sag(height**2)[0], height))
    for number, (index, (front, low), (back, high)) in enumerate(
        zip((each.index for each in lens.prescription.surfaces), arcs, arcs[1:], strict=False)
    ):
        if index == 1:
            continue
        edge = max(low[-1], high[-1])  # the smaller of both sides is flat beyond its clear diameter
        depths = np.concatenate([front, [front[-1], back[-1]], back[::-1], [back[0], front[0]]])
        heights = np.concatenate([low, [edge, edge], high[::-1], [-edge, -edge]])
        bounded = all(math.isfinite(each.radius) for each in lens.onward[number : number + 2])
        pen.glass(depths, heights + centre, bounded)
    place = lens.stop_number
    assert place is not None
    half = lens.mask.size[pen.axis] / 2 if lens.mask is not None else lens.onward[place].radius
    if math.isfinite(half):
        beside = [heights[-1] for _, heights in arcs[max(place - 1, 0) : place + 2]]
        _draw_stop(pen, float(arcs[place][0][-1]), centre, half, max(1.4 * half, *beside))


def _widest_sag(surface: Refraction) -> float:
    """The radius up to which a surface is drawn: nearly that where a sphere is vertical."""
    square = (1 + surface.conic) * surface.curvature**2
    return 0.999 / math.sqrt(square) if square > 0 else math.inf


def _draw_lens(pen: Pen, lens: Lens) -> None:
    """Two arcs, convex for a converging lens and concave for a diverging one; a stop outside the rim."""
    half = lens.diameter / 2 if lens.diameter is not None else 1.02 * pen.half
    across = np.linspace(-1, 1, 41)
    bulge = 1 - across**2
    depth = pen.thick * (0.1 + bulge if lens.focal_length > 0 else 1.05 - 0.8 * bulge)
    height = half * across + lens.decentre[pen.axis]
    pen.glass(
        np.concatenate([lens.z - depth, lens.z + depth[::-1]]),
        np.concatenate([height, height[::-1]]),
        bounded=lens.diameter is not None,
    )
    if lens.diameter is not None:
        _draw_stop(pen, lens.z, lens.decentre[pen.axis], half)


def _draw_prism(pen: Pen, prism: Prism) -> None:
    """A wedge, thick on the side to which it deflects."""
    half = 1.02 * pen.half
    side = 1.0 if prism.deflection[pen.axis] >= 0 else -1.0
    flat = prism.deflection[pen.axis] == 0  # deflects along the other axis only
    middle = (pen.low + pen.high) / 2
    top, base = middle - half * side, middle + half * side
    tip = pen.thick if flat else 0.05 * pen.thick
    pen.glass(
        prism.z + np.array([-tip, tip, pen.thick, -pen.thick]), np.array([top, top, base, base]), bounded=False
    )


def _draw_block(pen: Pen, element: Element, planes: list[Crossing], beam: float) -> None:
    """A thick element: glass from end to end, its rims and stop, and principal planes if it has any."""
    centre = element.decentre[pen.axis]
    half = half_size(element, pen.axis)
    bounded = math.isfinite(half)
    half = min(1.08 * max(half, beam), 1.02 * pen.half)
    start, end = element.z, element.z + element.length
    if element.length == 0:
        start, end = start - pen.thick / 2, end + pen.thick / 2
    corners = np.array([start, end, end, start]), centre + half * np.array([-1, -1, 1, 1])
    pen.glass(*corners, bounded=bounded, alpha=0.5)
    for plane in planes:
        opening = half_opening(plane.faces, pen.axis)
        if math.isfinite(opening):
            _draw_stop(pen, plane.z, centre, opening, half)
    for z, name, side in _principal_planes(element):
        left, right = sorted(pen.axes.get_xlim())
        if not left < z / mm < right:
            continue
        pen.line(
            [z, z], [centre - half, centre + half], color=style.GLASS_EDGE, linewidth=1, dashes=(5, 3), zorder=1.5
        )
        pen.axes.annotate(
            name,
            (z / mm, (centre - half if pen.axis == 0 else centre + half) / mm),
            xytext=(3 * side, 3),
            textcoords="offset points",
            ha="left" if side > 0 else "right",
            va="bottom",
            fontsize=style.TEXT,
            bbox={"boxstyle": "square,pad=0.05", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
            color=style.GLASS_EDGE,
        )


def _principal_planes(element: Element) -> list[tuple[float, str, int]]:
    """(z, name, side of the line with space for the name) of each principal plane."""
    if not isinstance(element, FirstOrder):
        return []
    try:
        front = element.z + element.front_principal_distance
        back = element.z + element.length + element.back_principal_distance
    except InputError:  # afocal, or without an axis of symmetry: it has none
        return []
    return [(front, "H", -1 if front <= back else 1), (back, "H′", 1 if front <= back else -1)]


def _draw_by_faces(pen: Pen, element: Element, faces: Faces) -> None:
    """Any thin element: glass that bends as the element does, frosted if it scatters, black where it is opaque."""
    bends, scatters = faces.deflection is not None, faces.spread is not None
    half = half_opening(faces, pen.axis)
    if bends:
        _draw_glass(pen, element, faces)
    if faces.spread is not None:
        _draw_frosted(pen, element, faces.spread, half)
    if faces.pattern is None:
        if not (bends or scatters):
            _draw_sheet(pen, element, by_direction=bool(faces.terms) or faces.by_ray is not None)
        return
    if not (bends or scatters):
        _draw_mask(pen, element, faces.pattern)
    elif not _all_clear(pen, element, faces):
        _draw_mask(
            pen,
            element,
            faces.pattern,
            scale=magnification(element, faces, pen.axis, pen.low, pen.high),
            over_glass=True,
        )
    if math.isfinite(half):
        _draw_stop(pen, element.z, element.decentre[pen.axis], half)


def drawn_range(pen: Span, element: Element, half: float) -> tuple[float, float]:
    """The range of heights in which an element is drawn, relative to its centre, metres."""
    centre = element.decentre[pen.axis]
    margin = 0.02 * pen.half
    return max(-half, pen.low - margin - centre), min(half, pen.high + margin - centre)


def along(axis: int, places: Array) -> tuple[Array, Array]:
    """(x, y) of positions on the drawn line through an element's centre."""
    return (places, np.zeros_like(places)) if axis == 0 else (np.zeros_like(places), places)


def _all_clear(pen: Pen, element: Element, faces: Faces) -> bool:
    assert faces.pattern is not None
    low, high = drawn_range(pen, element, half_opening(faces, pen.axis))
    places = np.linspace(low, high, 2 * POINTS + 1)[1:-1] / magnification(
        element, faces, pen.axis, pen.low, pen.high
    )
    return bool((faces.pattern(*along(pen.axis, places)) == 1).all())


def magnification(element: Element, faces: Faces, axis: int, bottom: float, top: float) -> int:
    """By which factor the cells of an array are enlarged to be visible; 1 for elements without cells.

    Args:
        element: the array.
        faces: of it.
        axis: 0 draws x upwards, 1 draws y.
        bottom: of the drawing, metres.
        top: of the drawing, metres.
    """
    if not isinstance(faces.bending, CellDeflection):
        return 1
    half, centre = half_opening(faces, axis), element.decentre[axis]
    low, high = max(-half, bottom - centre), min(half, top - centre)
    cells = (high - low) / faces.bending.lattice.pitch
    return 1 if cells <= MOST_CELLS else math.ceil(cells / CELLS_INSTEAD)


def glass_profile(span: Span, element: Element, faces: Faces) -> tuple[Array, Array] | None:
    """The profile of a thin piece of glass that bends rays as an element does.

    Args:
        span: the drawn range.
        element: the element.
        faces: its faces, with a deflection.

    Returns:
        Heights relative to the element's centre, metres, and the depth of the glass there, 0 to 1; None if the
        element is outside the drawing.
    """
    low, high = drawn_range(span, element, half_opening(faces, span.axis))
    if high <= low:
        return None
    if isinstance(faces.bending, CellDeflection):
        scale = magnification(element, faces, span.axis, span.low, span.high)
        height, depth = _cell_profile(faces.bending, span.axis, low, high, scale)
    else:
        height = np.linspace(low, high, POINTS)
        depth = _profile(faces, span.axis, height)
    deepest = float(depth.max())
    return height, depth / deepest if deepest > 0 else depth


def _draw_glass(pen: Pen, element: Element, faces: Faces) -> None:
    """Glass that is flat at the element's position, with the profile of its optical path towards the scene."""
    profile = glass_profile(pen, element, faces)
    if profile is None:
        return
    height, depth = profile
    depth = pen.thick * (0.4 + 1.1 * depth)
    pen.glass(
        np.concatenate([[element.z], element.z - depth, [element.z]]),
        element.decentre[pen.axis] + np.concatenate([height[:1], height, height[-1:]]),
        bounded=math.isfinite(half_opening(faces, pen.axis)),
    )


def _profile(faces: Faces, axis: int, places: Array) -> Array:
    """The optical path along the drawn line, minimum 0, metres: the integral of the change of slope."""
    # At midpoints: at the points themselves two facets may meet.
    x, y = along(axis, (places[1:] + places[:-1]) / 2)
    if faces.affine is not None:
        slopes = faces.affine(np.stack([x, y, 0 * x, 0 * x], axis=-1))[:, 2 + axis]
    else:
        assert isinstance(faces.bending, Deflection)
        slopes = np.asarray(faces.bending(x, y)[axis])
    path = np.concatenate([[0.0], np.cumsum(np.diff(places) * slopes)])
    path -= path.min()
    # Rounding errors of a plane are not a shape.
    return path if path.max() > 1e-12 * max(1e-3, float(np.ptp(places))) else np.zeros_like(path)


def _cell_profile(cells: CellDeflection, axis: int, low: float, high: float, scale: int) -> tuple[Array, Array]:
    """Heights, and the thickness of each cell's glass above its minimum, metres; cells ``scale`` times larger."""
    lattice = cells.lattice
    count = (high - low) / (lattice.pitch * scale)
    places = np.linspace(low, high, int(min(max(24 * count, POINTS), 4000)))
    x, y = along(axis, places / scale)
    row, column = lattice.cell_of(x, y)
    centre_x, centre_y = lattice.centre_of(row, column)
    rows, columns = cells.powers.shape
    power, slope = cells.powers[row % rows, column % columns], cells.slopes[row % rows, column % columns]
    dx, dy = x - centre_x, y - centre_y
    path = slope[:, 0] * dx + slope[:, 1] * dy - power * (dx * dx + dy * dy) / 2
    first = np.flatnonzero(np.r_[True, (np.diff(row) != 0) | (np.diff(column) != 0)])
    thinnest = np.minimum.reduceat(path, first)
    return places, path - np.repeat(thinnest, np.diff(np.r_[first, len(path)]))


def _draw_frosted(pen: Pen, element: Element, scatter: Scatter, half: float) -> None:
    """A sheet with a rough side towards the sensor; rougher and darker where it scatters more."""
    low, high = drawn_range(pen, element, half)
    if high <= low:
        return
    teeth = max(int(60 * (high - low) / (2 * pen.half)), 6)
    height = np.linspace(low, high, 2 * teeth + 1)
    spread = spread_along(scatter, pen.axis, *along(pen.axis, height))
    strength = spread / spread.max() if spread.max() > 0 else 0 * spread
    # Uneven teeth, as on ground glass, but the same in each drawing.
    tooth = np.where(np.arange(len(height)) % 2 == 0, 0.0, np.random.default_rng(0).uniform(0.4, 1, len(height)))
    centre, thick = element.decentre[pen.axis], pen.thick
    pen.fill(
        np.concatenate([[element.z], element.z + thick * tooth * (0.1 + 0.9 * strength), [element.z]]),
        centre + np.concatenate([[low], height, [high]]),
        facecolor=style.FROST,
        edgecolor=style.FROST_EDGE,
        linewidth=0.8,
        zorder=1,
    )
    edges = centre + np.linspace(low, high, 2 * teeth + 1)
    pen.axes.pcolormesh(
        np.array([element.z - 0.5 * thick, element.z]) / mm,
        edges / mm,
        ((strength[1:] + strength[:-1]) / 2)[:, None],
        cmap=style.frost_tones(),
        vmin=0,
        vmax=1,
        zorder=1.1,
    )
    bounded = math.isfinite(half)
    outline = np.array([-0.5, 0, 0, -0.5]) * thick + element.z, centre + np.array([low, low, high, high])
    looks = {"facecolor": "none", "edgecolor": style.FROST_EDGE, "linewidth": 1.0, "zorder": 1.2}
    pen.fill(*outline, linestyle="-" if bounded else (0, (4, 2)), **looks)


def _draw_sheet(pen: Pen, element: Element, by_direction: bool = False) -> None:
    """An element without known shape or mask: a thin sheet, dotted if it filters directions."""
    middle = (pen.low + pen.high) / 2
    ends = middle + 1.02 * pen.half * np.array([-1, 1])
    looks: dict[str, Any] = {"dashes": (1, 1)} if by_direction else {}
    pen.line([element.z, element.z], ends, color=style.GLASS_EDGE, linewidth=2, zorder=1, **looks)


def _draw_louvre(pen: Pen, louvre: Louvre) -> None:
    """The walls in the drawing's plane; a dotted sheet if it is parallel to them or they are too many."""
    across = math.cos(louvre.rotation) if pen.axis == 0 else math.sin(louvre.rotation)
    pitch = louvre.pitch / max(abs(across), 1e-9)
    if 2 * pen.half / pitch > MOST_WALLS:
        _draw_sheet(pen, louvre, by_direction=True)
        return
    centre, thick = louvre.decentre[pen.axis], louvre.wall / max(abs(across), 1e-9)
    first, last = math.floor((pen.low - centre) / pitch - 0.5), math.ceil((pen.high - centre) / pitch - 0.5)
    for n in range(first, last + 1):
        middle = centre + (n + 0.5) * pitch
        if not pen.low <= middle <= pen.high:
            continue
        z = louvre.z + np.array([0.0, louvre.height, louvre.height, 0.0])
        pen.fill(
            z,
            middle + thick / 2 * np.array([-1, -1, 1, 1]),
            facecolor="black",
            edgecolor="black",
            linewidth=0.8,
            zorder=2,
        )


def mask_bar(
    span: Span, element: Element, pattern: Pattern, scale: int = 1, points: int = 1024
) -> tuple[Array, Array] | None:
    """The middle row of a mask as pieces of constant transmission.

    Args:
        span: the drawn range.
        element: the mask.
        pattern: of the mask.
        scale: enlargement, see `magnification`.
        points: number of points at which the pattern is evaluated.

    Returns:
        The edges of the pieces, metres on the drawing, and the transmission of each piece, one fewer; None if
        the mask is outside the drawing.
    """
    low, high = drawn_range(span, element, pattern.size[span.axis] / 2)
    if high <= low:
        return None
    steps = (np.arange(points) + 0.5) / points
    values = np.asarray(pattern(*along(span.axis, (low + (high - low) * steps) / scale)))
    # Merge equal neighbours, so that vector files stay small.
    cuts = np.flatnonzero(np.diff(values)) + 1
    edges = low + (high - low) * np.concatenate([[0.0], cuts / points, [1.0]]) + element.decentre[span.axis]
    return edges, values[np.concatenate([[0], cuts])]


def _draw_mask(pen: Pen, element: Element, pattern: Pattern, scale: int = 1, over_glass: bool = False) -> None:
    """The mask's middle row as a bar, black where opaque and white (on glass: transparent) where open."""
    bar = mask_bar(pen, element, pattern, scale, 1024 if scale == 1 and not over_glass else 4096)
    if bar is None:
        return
    edges, values = bar
    wide = 0.45 * pen.thick
    sides = np.array([element.z - wide, element.z + (0 if over_glass else wide)])
    pen.axes.pcolormesh(
        sides / mm,
        edges / mm,
        values[:, None],
        cmap=style.black_tones() if over_glass else "gray",
        vmin=0,
        vmax=1,
        zorder=3,
    )
    if over_glass:
        return
    pen.fill(
        sides[[0, 1, 1, 0]],
        edges[[0, 0, -1, -1]],
        facecolor="none",
        edgecolor=style.INK,
        linewidth=0.8,
        zorder=3.1,
    )
    if math.isfinite(pattern.size[pen.axis]):
        _draw_stop(pen, element.z, element.decentre[pen.axis], pattern.size[pen.axis] / 2)


def _draw_stop(pen: Pen, z: float, centre: float, half: float, reach: float = math.inf) -> None:
    """The opaque surroundings of an opening: thick at the edge, thin farther out, up to ``reach``."""
    for side in (-1, 1):
        edge = centre + side * half
        border = (pen.high if side > 0 else pen.low) + side * 0.06 * pen.half
        outmost = border if math.isinf(reach) else centre + side * reach
        for end, width in ((edge + side * 0.08 * pen.half, 3.0), (outmost, 1.0)):
            end = min(end, outmost) if side > 0 else max(end, outmost)
            if side * (end - edge) > 0:
                pen.line([z, z], [edge, end], color=style.INK, linewidth=width, solid_capstyle="butt", zorder=3)


def draw_sensor(pen: Pen, sensor: Sensor, most_pixels: int = 0) -> None:
    """The sensor, with the borders of its pixels if at most ``most_pixels`` are within the drawing."""
    half, thick = sensor.size[1 - pen.axis] / 2, 1.25 * pen.thick
    centre = sensor.decentre[pen.axis]
    low, high = max(centre - half, pen.low - pen.half), min(centre + half, pen.high + pen.half)
    pen.fill(
        sensor.z + np.array([0, thick, thick, 0]),
        np.array([low, low, high, high]),
        facecolor="#5A5A5A",
        edgecolor=style.INK,
        linewidth=1.0,
        zorder=3,
    )
    pitch = sensor.pitches[1 - pen.axis]
    if 2 * pen.half / pitch <= most_pixels:
        first, last = math.ceil((low - centre + half) / pitch), math.floor((high - centre + half) / pitch)
        for border in centre - half + pitch * np.arange(first, last + 1):
            pen.line(sensor.z + np.array([0, thick]), [border, border], color="white", linewidth=0.7, zorder=3.2)
