"""Draw a camera from the side: elements at their positions, and fans of rays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.units import mm, nm
from vcc.base.wavelengths import wavelengths as checked_wavelengths
from vcc.fields.samples import InMemory
from vcc.optics import CellDeflection
from vcc.optics.band import Band
from vcc.optics.bands import bands_of, ways_of
from vcc.optics.train import Stage, Train
from vcc.plot import style
from vcc.plot.elements import Pen, draw_element, draw_sensor, magnification
from vcc.plot.fans import (
    OFF_AXIS_RAYS,
    RAYS,
    RAYS_THAT_SPLIT,
    Point,
    beam_at,
    half_height,
    points_to_show,
    scene_length,
    trace_point,
)
from vcc.plot.labels import draw_labels
from vcc.plot.tracing import Paths

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

CELLS_MAGNIFIED = 5
"""Number of cells of an array in the magnified inset."""
RAYS_A_CELL = 5
"""Approximate number of rays per cell in the inset."""


def plot_camera(
    camera: Train,
    *,
    light_field: InMemory | None = None,
    object_distances: Sequence[float] | None = None,
    across: str = "x",
    rays: int | None = None,
    magnified: Axes | bool | None = None,
    wavelengths: Sequence[float] | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw a camera from the side: light travels to the right, the scene is on the left.

    Elements have their true positions and heights; their thickness is symbolic, and glass that bends rays in
    other ways than a lens or a prism has the corresponding profile. Rays bend as in the camera; a ray that a
    mask or a rim stops ends in a dot. At a diffuser, each ray splits into three fainter ones, at the 1/6, 1/2
    and 5/6 quantiles of the kernel, each with a third of the light. Heights are magnified relative to z, as
    the axes show. Only a part of the scene's side is drawn: rays enter with their true slopes.

    An array of very many cells is drawn with fewer, larger ones (its label reports this), while rays bend as
    in the true cells. A magnified inset shows some true cells, the sensor's pixels and their rays.

    If bands of light take different paths, the rays of one point are drawn for several of them, in the colours of
    their wavelengths (of the spectrum from 400 to 700 nm). Elements are those of the design wavelength.

    Args:
        camera: what to draw.
        light_field: the rays fill its width on the entrance plane; without it they fill the first lens that has a
            rim, or else the first element that has one.
        object_distances: of points on the axis, metres before the entrance plane (infinity for parallel
            light), one colour each. None draws the distance in focus, on and off the axis, and a nearer one.
        across: ``"x"`` or ``"y"``, the axis drawn upwards in the figure (y points down).
        rays: number per point; None uses 9, or 5 if diffusers split them.
        magnified: whether to draw a magnified inset of an array of cells next to a new figure's drawing, or
            the axes for it; None draws it on a new figure for arrays with cells too small to see.
        wavelengths: of the bands, metres; None uses the shortest, the middle and the longest of the light field,
            if it states wavelengths. In a band with several orders, its brightest is drawn.
        axes: where to draw; None makes a new figure.

    Returns:
        The axes; ``.figure.savefig(path)`` writes them to a file.

    Raises:
        InputError: an invalid axis, fewer than 2 rays, an object distance that is not positive, an inset for
            a camera without an array before its sensor, or without axes for it when ``axes`` are given; or an
            element with an invalid result.
    """
    checks.one_of("across", across, "xy")
    if rays is not None:
        checks.whole_number_between("rays", rays, 2)
    if magnified is True and axes is not None:
        raise InputError("with axes=, a magnified inset needs axes as well: pass them as magnified=")
    from matplotlib.lines import Line2D

    axis = "xy".index(across)
    scattering = any(stage.faces.spread is not None for stage in camera.stages)
    rays = rays or (RAYS_THAT_SPLIT if scattering else RAYS)
    points = points_to_show(camera, object_distances, axis)
    bands = _bands_to_show(camera, light_field, wavelengths)
    points = points[:1] if bands else points
    start = -scene_length(camera, points)
    fans = [
        _Fan(camera, point, OFF_AXIS_RAYS if point.offset else rays, _colour(number), point.label)
        for number, point in enumerate(points)
    ]
    if bands:
        labels = [f"{points[0].label}, {band.stated('a ray') / nm:.5g} nm" for band in bands]
        # The first are the widest: where paths agree, all colours remain visible.
        widths = np.linspace(2.7, 0.9, len(bands))
        fans = [
            _Fan(
                _brightest(camera, band),
                points[0],
                rays,
                _of_wavelength(band.stated("a ray")),
                label,
                float(width),
            )
            for band, label, width in zip(bands, labels, widths, strict=True)
        ]
    paths = [trace_point(fan.train, fan.point, light_field, axis, fan.rays, start) for fan in fans]
    half = half_height(camera, paths, axis)
    wanted = axes is None if magnified is None else magnified is not False
    array = _array_to_magnify(camera, axis, half, required=bool(magnified)) if wanted else None
    beside = None if isinstance(magnified, bool) else magnified
    own_figure = axes is None
    if axes is None:
        if array is None or beside is not None:
            axes = style.new_axes(9.5, 4.8)
        else:
            axes, beside = style.new_axes(11.5, 4.8, 1, 2, width_ratios=(2.4, 1))
    pen = Pen(axis, -half, half, 0.016 * (camera.sensor.z - start), axes)
    set_limits(axes, start, camera.sensor.z, half, across)
    draw_optical_axis(axes)
    for fan, path in zip(fans, paths, strict=True):
        draw_paths(axes, fan.point.distance, path, axis, fan.colour, fan.width)
    for element in camera.elements:
        draw_element(pen, element, beam_at(element, paths, axis))
    draw_sensor(pen, camera.sensor)
    axes.legend(
        handles=[Line2D([], [], color=fan.colour, label=fan.label) for fan in fans],
        loc="upper center",
        bbox_to_anchor=(0.5, -0.16),
        ncols=len(fans),
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


# --- bands of light ---


@dataclass(frozen=True, eq=False, repr=False)
class _Fan(Brief):
    """Rays of a point, in a colour.

    Args:
        train: that they take.
        point: where they come from.
        rays: number of them.
        colour: of the rays.
        label: in the legend.
        width: of the lines, points.
    """

    train: Train
    point: Point
    rays: int
    colour: Any
    label: str
    width: float = 1.1


def _bands_to_show(
    camera: Train, light_field: InMemory | None, wavelengths: Sequence[float] | None
) -> Sequence[Band]:
    """The bands whose rays are drawn; none if all take the same path."""
    if wavelengths is not None:
        given = checked_wavelengths("wavelengths", wavelengths)
        return bands_of(len(given), given)
    grid = None if light_field is None else light_field.grid
    if grid is None or grid.wavelengths is None or not camera.depends_on_bands:
        return ()
    bands = sorted(bands_of(grid.channels, grid.wavelengths), key=lambda band: band.stated("a ray"))
    some = [bands[0], bands[len(bands) // 2], bands[-1]] if len(bands) > 2 else bands
    lit = [band for band in some if ways_of(camera, band)]
    return lit if len({_brightest(camera, band) for band in lit}) > 1 else ()


def _brightest(camera: Train, band: Band) -> Train:
    """The train that most light of a band takes.

    Raises:
        InputError: nothing of the band passes.
    """
    ways = ways_of(camera, band)
    if not ways:
        raise InputError(
            f"no light of {band.stated('a ray') / nm:.5g} nm passes this camera: draw other wavelengths"
        )
    return max(ways, key=lambda way: way[0])[1]


def _of_wavelength(wavelength: float) -> Any:
    """A colour of the spectrum, blue at 400 nm and red at 700 nm and beyond."""
    from matplotlib import colormaps

    return colormaps["turbo"](0.05 + 0.9 * float(np.clip((wavelength / nm - 400) / 300, 0, 1)))


# --- drawing ---


def _colour(number: int) -> str:
    """The colour of the rays from a point, by its number."""
    return (style.BLUE, style.ORANGE, style.GREEN)[number % 3]


def set_limits(axes: Axes, start: float, end: float, half: float, across: str) -> None:
    """Set the axes from ``start`` to the camera's end, metres, with a margin."""
    length = end - start
    axes.set_xlim((start - 0.02 * length) / mm, (end + 0.06 * length) / mm)
    up = -1 if across == "y" else 1  # y points down
    axes.set_ylim(-1.12 * up * half / mm, 1.12 * up * half / mm)


def draw_optical_axis(axes: Axes) -> None:
    """The optical axis."""
    axes.axhline(0, color=style.QUIET, linewidth=0.8, linestyle=(0, (8, 3, 1, 3)), zorder=0)


def draw_paths(axes: Axes, distance: float, paths: Paths, axis: int, colour: str, width: float = 1.1) -> None:
    """Each ray in pieces, fainter where it lost light; a dot where it is stopped."""
    depths, heights = paths.depths / mm, paths.positions[..., axis] / mm
    for z, height, shares, first in zip(depths, heights, paths.shares, paths.starts, strict=True):
        for piece in range(first, len(z) - 1):
            share = shares[piece + 1]
            if share <= 0:
                if shares[piece] > 0:
                    axes.plot(z[piece], height[piece], ".", color=colour, markersize=5)
                break
            axes.plot(
                z[piece : piece + 2],
                height[piece : piece + 2],
                color=colour,
                linewidth=width * (0.6 + 0.4 * share),
                alpha=0.3 + 0.55 * share,
                solid_capstyle="round",
                zorder=2,
            )
    if paths.z[0] <= -distance:
        axes.plot(paths.z[0] / mm, heights[:, 0].mean(), "o", color=colour, markersize=5)


# --- magnified inset of an array ---


def _array_to_magnify(camera: Train, axis: int, half: float, required: bool) -> Stage | None:
    """The last array of cells before the sensor; unless required, only one with small cells; None if none."""
    arrays = [
        stage
        for stage in camera.stages
        if isinstance(stage.faces.bending, CellDeflection) and stage.z < camera.sensor.z
    ]
    if required:
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
    points: list[Point],
    light_field: InMemory | None,
    axis: int,
) -> None:
    """Some cells in the middle of an array, with all that is behind them up to the sensor."""
    cells = stage.faces.bending
    assert isinstance(cells, CellDeflection)
    pitch = cells.lattice.pitch
    gap = camera.sensor.z - stage.z
    centre = np.array(stage.element.decentre)
    middle = float((centre + cells.lattice.centre_of(*cells.lattice.cell_of(*-centre)))[axis])
    low, high = middle - CELLS_MAGNIFIED / 2 * pitch, middle + CELLS_MAGNIFIED / 2 * pitch
    inset.set_xlim((stage.z - 0.45 * gap) / mm, (camera.sensor.z + 0.12 * gap) / mm)
    inset.set_ylim(*((low / mm, high / mm) if axis == 0 else (high / mm, low / mm)))
    pen = Pen(axis, low, high, 0.035 * gap, inset)
    draw_optical_axis(inset)
    to_array = camera.rays_at(stage.z)
    for place, point in enumerate(points):
        # Off the axis by so much that the light goes through the next cell.
        aside = to_array.matrix[axis, axis + 2]
        if point.offset and aside:
            point = replace(point, offset=-pitch / float(aside))
        ends = trace_point(camera, point, light_field, axis, 2, 0.0)
        at_array = ends.positions[:, int(np.argmax(ends.z >= stage.z)), axis]
        number = int(np.clip(RAYS_A_CELL * np.ptp(at_array) / pitch, RAYS, 20 * RAYS))
        draw_paths(
            inset,
            point.distance,
            trace_point(camera, point, light_field, axis, number, 0.0),
            axis,
            _colour(place),
            width=0.9,
        )
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
    """Lines from a part of the drawing, (z, low, high) in metres, to the axes that magnify it."""
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
