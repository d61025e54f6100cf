"""Light fields in phase space: the u–s diagram, in which optics are geometry (the paper's Figure 4)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import mm, short
from vcc.fields.sampled import to_numpy
from vcc.fields.samples import InMemory
from vcc.files.transfer import from_linear
from vcc.optics import Faces
from vcc.optics.sensor import Sensor
from vcc.optics.train import Train, touch
from vcc.plot import style
from vcc.plot.phase_space_rays import (
    FULL,
    IN_ONE_PLANE,
    NAMES,
    RASTER,
    RAYS,
    PhaseSpacePicture,
    Sheet,
    radiance_of,
    sheet_of_rays,
    sheet_of_samples,
    slice_of,
    traced,
)
from vcc.run.operators import carried_to

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

NO_OPTICS = Train([], Sensor(0.0, (1, 1), 1.0))
"""A camera without elements, for drawing a light field where it is."""
ENTRANCE = "entrance, z = 0 mm"
CELLS_DRAWN_ONE_BY_ONE = 20_000
"""More cells than this are rasterised in .svg and .pdf files, which would otherwise grow too large."""


def plot_phase_space(
    light_field: InMemory,
    *,
    row: int | None = None,
    pixel_row: int | None = None,
    across: str = "u",
    fixed: tuple[float, float] | None = None,
    white: float | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw the u–s diagram of a light field: position across, slope up, as the paper's Figure 4(c).

    It is a 2-D slice for one row of views and one row of pixels. Each sample is drawn as its cell, placed by
    the frame: nothing is resampled, so that free propagation is a shear along u, and a lens a shear along s.
    Areas without samples are grey.

    Other slices fix the other two coordinates: ``across="uv"`` shows light from one direction, and ``"st"``
    light at one point of this plane, upright: light from the right has s < 0. They are interpolated linearly
    between samples.

    Args:
        light_field: at any plane.
        row: which row of views (v); None uses the middle one. A column of views for across="v".
        pixel_row: which row of pixels (t); None uses the middle one; a column for across="v".
        across: ``"u"`` draws u and s, ``"v"`` draws v and t; or two of u, v, s and t, the horizontal one first.
        fixed: the other two coordinates instead of rows, in the order u, v, s, t: metres and slopes. None uses the
            middle of the light field, unless ``across`` is u and s or v and t.
        white: the radiance drawn white; None uses the maximum of the slice.
        axes: where to draw; None makes a new figure.

    Returns:
        The axes; ``.figure.savefig(path)`` writes them to a file.

    Raises:
        InputError: an invalid row or axis, rows together with ``fixed``, or rays outside the light field.
    """
    chosen = slice_of(across)
    axes = style.new_axes(5.2, 4.2) if axes is None else axes
    if not _held_by_samples(chosen, row, pixel_row, fixed):
        (picture,) = traced(NO_OPTICS, sheet_of_rays(light_field, chosen, fixed), {-1.0: ENTRANCE})
        brightest = float(picture.radiance.max()) or 1.0
        _draw_picture(axes, picture, chosen, brightest if white is None else white)
        _set_limits(axes, [picture], chosen)
        _label(axes, chosen)
        return axes
    across = NAMES[chosen[0]]
    piece = _slice(light_field, row, pixel_row, across)
    u, s = cell_corners(piece, across)
    values = _radiance(piece, across)
    if white is None:
        white = float(values.max()) or 1.0
    axes.set_facecolor(style.NOTHING)
    axes.pcolormesh(
        u / mm,
        s,
        _for_display(values / white),
        cmap="gray",
        vmin=0,
        vmax=1,
        rasterized=values.shape[0] * values.shape[1] > CELLS_DRAWN_ONE_BY_ONE,
    )
    _label(axes, chosen)
    return axes


def plot_phase_space_stages(
    camera: Train,
    light_field: InMemory,
    *,
    row: int | None = None,
    pixel_row: int | None = None,
    across: str = "u",
    fixed: tuple[float, float] | None = None,
) -> Figure:
    """Draw u–s diagrams along the way through a camera: at the entrance, behind each element, on the sensor.

    All diagrams have the same scales and the same white, so that the effect of each element is visible: the
    paper's Figure 4(c) for any camera. Behind lens arrays, prisms of several faces, phase plates and
    diffusers, the slice's rays are traced and collected in a raster; before these, its cells are drawn.

    The slice is chosen at the entrance: its rays have fixed values of the other two coordinates there. If
    optics change these as well (for example lenslets off the row), the diagram shows the positions of the
    rays in the two drawn coordinates, for any values of the others. A diffuser spreads light along the drawn
    slope; the light that it scatters out of the slice is assumed to be replaced by neighbouring slices.

    Args:
        camera: the camera.
        light_field: at the entrance plane.
        row: as in `plot_phase_space`, also the next three.
        pixel_row: which row of pixels.
        across: two coordinates.
        fixed: the other two, at the entrance plane.

    Returns:
        The figure; ``.savefig(path)`` writes it to a file.

    Raises:
        InputError: as for `plot_phase_space`, or a diffuser for a slice other than of a position and its slope.
    """
    chosen = slice_of(across)
    titles = [(-1.0, ENTRANCE), *_planes(camera)]
    cells: dict[float, InMemory] = {}
    if _held_by_samples(chosen, row, pixel_row, fixed):
        piece = _slice(light_field, row, pixel_row, NAMES[chosen[0]])  # first: fewer samples for later steps
        cells = {
            z: piece if z < 0 else carried_to(camera, piece, z) for z, _ in titles if z < _traced_from(camera)
        }
    pictures: dict[float, PhaseSpacePicture] = {}
    if len(cells) < len(titles):
        found = phase_space_stages(camera, light_field, row=row, pixel_row=pixel_row, across=across, fixed=fixed)
        pictures = {z: picture for (z, _), picture in zip(titles, found, strict=True)}
    brightest = _radiance(cells[-1.0], NAMES[chosen[0]]) if cells else pictures[-1.0].radiance
    white = float(brightest.max()) or 1.0
    rows = math.ceil(len(titles) / 4)
    columns = math.ceil(len(titles) / rows)
    grid = style.new_axes(
        max(5.2, 3.1 * columns), 3.3 * rows, rows, columns, sharex=True, sharey=True, squeeze=False
    )
    figure: Figure = grid[0, 0].figure
    for place, ((z, title), axes) in enumerate(zip(titles, grid.flat, strict=False)):
        if z in cells:
            plot_phase_space(cells[z], across=NAMES[chosen[0]], white=white, axes=axes)
        else:
            _draw_picture(axes, pictures[z], chosen, white)
            _label(axes, chosen)
        axes.set_title(title, fontsize=style.TEXT, color=style.INK)
        if place % columns:
            axes.set_ylabel("")
        axes.tick_params(labelbottom=place + columns >= len(titles))
        if place + columns < len(titles):
            axes.set_xlabel("")
    if pictures:
        _set_limits(grid[0, 0], list(pictures.values()), chosen)
    for axes in grid.flat[len(titles) :]:
        axes.set_visible(False)
    return figure


def phase_space_stages(
    camera: Train,
    light_field: InMemory,
    *,
    row: int | None = None,
    pixel_row: int | None = None,
    across: str = "u",
    fixed: tuple[float, float] | None = None,
    rays: int = RAYS,
) -> list[PhaseSpacePicture]:
    """The data of `plot_phase_space_stages`: rasters of radiance at each plane, from traced rays.

    Args:
        camera: the camera; the other arguments as in `plot_phase_space_stages`.
        rays: approximate number of traced rays, 1 or more.

    Raises:
        InputError: as for `plot_phase_space_stages`.
    """
    sheet = _sheet(light_field, across, (row, pixel_row), fixed)
    return list(traced(camera, sheet, {-1.0: ENTRANCE} | dict(_planes(camera)), rays=_some(rays)))


def phase_space_at(
    camera: Train,
    light_field: InMemory,
    z: float,
    *,
    row: int | None = None,
    pixel_row: int | None = None,
    across: str = "u",
    fixed: tuple[float, float] | None = None,
    rays: int = RAYS,
    raster: tuple[int, int] = RASTER,
) -> PhaseSpacePicture:
    """A raster of radiance, as from `phase_space_stages`, at any plane of the axis.

    Args:
        camera: the camera.
        light_field: at the entrance plane.
        z: of the plane, metres, up to the sensor's; negative before the camera. If an element is there, the
            plane is just behind it.
        row: as in `plot_phase_space_stages`, also the next three.
        pixel_row: which row of pixels.
        across: two coordinates.
        fixed: the other two, at the entrance plane.
        rays: approximate number of traced rays, 1 or more.
        raster: (columns, rows) of the image.

    Raises:
        InputError: as for `phase_space_stages`; a plane behind the sensor or inside a thick element.
    """
    sheet, z = _sheet(light_field, across, (row, pixel_row), fixed), checks.finite("z of a plane", z, "metres")
    place = short(z, digits=6)
    if z < 0:
        before = {-1.0: f"before the camera, z = {place}"}
        (picture,) = traced(NO_OPTICS, sheet.moved(Affine.propagation(z)), before, rays=_some(rays), raster=raster)
        return replace(picture, z=z)
    if z > camera.sensor.z and not touch(z, camera.sensor.z):
        raise InputError(f"z = {place} lies behind the sensor, which stands at z = {short(camera.sensor.z)}")
    camera.rays_at(z)  # raises an error inside a thick element
    met = [one for one in camera.elements if one.z < z or touch(one.z, z)]
    behind = [one.called for one in met if touch(one.z + one.length, z)]
    title = f"behind {' and '.join(behind)}, z = {place}" if behind else f"z = {place}"
    z = max([z, *(one.z + one.length for one in met)])  # the same, to rounding
    return list(
        traced(
            Train(met, Sensor(z, (1, 1), 1.0)), sheet, {-1.0: ENTRANCE, z: title}, rays=_some(rays), raster=raster
        )
    )[-1]


def _sheet(
    light_field: InMemory,
    across: str,
    rows: tuple[int | None, int | None],
    fixed: tuple[float, float] | None,
) -> Sheet:
    """The slice to follow."""
    chosen = slice_of(across)
    if _held_by_samples(chosen, *rows, fixed):
        return sheet_of_samples(_slice(light_field, *rows, NAMES[chosen[0]]), chosen)
    return sheet_of_rays(light_field, chosen, fixed)


def _some(rays: int) -> int:
    if not rays >= 1:
        raise InputError(f"rays must be 1 or more, not {rays}")
    return rays


def _held_by_samples(
    chosen: tuple[int, int], row: int | None, pixel_row: int | None, fixed: tuple[float, float] | None
) -> bool:
    """Whether rows of samples are fixed, rather than coordinates."""
    if chosen in IN_ONE_PLANE and fixed is None:
        return True
    if row is not None or pixel_row is not None:
        names = [NAMES[n] for n in range(4) if n not in chosen]
        raise InputError(
            "row and pixel_row are supported only for u and s, or v and t: pass the fixed coordinates as "
            f"fixed=({names[0]}, {names[1]})"
        )
    return False


def _traced_from(camera: Train) -> float:
    """The z of the first plane behind which cells are no longer given by a frame."""
    for element in camera.elements:
        for part in element.parts():
            if isinstance(part, Faces) and (part.bending is not None or part.spread is not None):
                return element.z
    return math.inf


def _draw_picture(axes: Axes, picture: PhaseSpacePicture, chosen: tuple[int, int], white: float) -> None:
    """Draw a raster; partly filled cells fade into the grey of empty areas."""
    shown = np.asarray(_for_display(picture.radiance / white), dtype=np.float64)
    shown = shown if shown.ndim == 3 else np.repeat(shown[..., None], 3, axis=2)
    axes.set_facecolor(style.NOTHING)
    extent = [
        float(borders[end] / (mm if n < 2 else 1.0))
        for n, borders in zip(chosen, (picture.first, picture.second), strict=True)
        for end in (0, -1)
    ]
    opacity = np.minimum(picture.filled / FULL, 1.0)
    axes.imshow(
        np.concatenate([shown, opacity[..., None]], axis=2),
        extent=(extent[0], extent[1], extent[2], extent[3]),
        origin="lower",
        aspect="auto",
        interpolation="antialiased",
        interpolation_stage="rgba",
    )


def _label(axes: Axes, chosen: tuple[int, int]) -> None:
    style.tidy(axes, *(f"{NAMES[n]} [{'mm' if n < 2 else 'slope'}]" for n in chosen))


def _set_limits(axes: Axes, pictures: list[PhaseSpacePicture], chosen: tuple[int, int]) -> None:
    """Show all images, in the viewing direction: v downwards, rays from the right (s < 0) on the right."""
    limits = []
    for n, name in zip(chosen, ("first", "second"), strict=True):
        borders = np.concatenate([getattr(each, name)[[0, -1]] for each in pictures]) / (mm if n < 2 else 1.0)
        margin = 0.03 * np.ptp(borders)
        limits.append((float(borders.min() - margin), float(borders.max() + margin)))
    axes.set_xlim(limits[0][::-1] if chosen == (2, 3) else limits[0])
    axes.set_ylim(limits[1][::-1] if chosen == (0, 1) else limits[1])


def cell_corners(light_field: InMemory, across: str = "u") -> tuple[Array, Array]:
    """Corners of the cells of a light field's middle slice in phase space.

    Returns:
        Positions in metres and slopes, each of shape (views + 1, pixels + 1): corner (a, b) is the
        frame at i = a − ½, k = b − ½, with j and l in the middle (for ``"u"``).
    """
    nv, nu, nt, ns = light_field.shape[:4]
    middle = [(nu - 1) / 2, (nv - 1) / 2, (ns - 1) / 2, (nt - 1) / 2]
    view, pixel = (0, 2) if across == "u" else (1, 3)
    views, pixels = (nu, ns) if across == "u" else (nv, nt)
    index = np.empty((views + 1, pixels + 1, 4))
    index[...] = middle
    index[..., view] = np.arange(views + 1)[:, None] - 0.5
    index[..., pixel] = np.arange(pixels + 1)[None, :] - 0.5
    rays = light_field.frame(index)
    return rays[..., view], rays[..., pixel]


def _slice(light_field: InMemory, row: int | None, pixel_row: int | None, across: str) -> InMemory:
    """The light field reduced to one row of views and one row of pixels, at its place."""
    nv, nu, nt, ns = light_field.shape[:4]
    counts = {"row": nv, "pixel_row": nt} if across == "u" else {"row": nu, "pixel_row": ns}
    chosen = []
    for (name, count), given in zip(counts.items(), (row, pixel_row), strict=True):
        place = count // 2 if given is None else given
        if not -count <= place < count:
            raise InputError(f"{name} is {place}, but there are {count}, counted from 0")
        chosen.append(slice(place % count, place % count + 1))
    if across == "u":
        return light_field[chosen[0], :, chosen[1], :]
    return light_field[:, chosen[0], :, chosen[1]]


def _radiance(piece: InMemory, across: str) -> Array:
    """Radiance of a slice, (views, pixels) or (views, pixels, 3)."""
    values = to_numpy(piece.values)
    return radiance_of(values[0, :, 0] if across == "u" else values[:, 0, :, 0], piece)


def _for_display(values: Array) -> Any:
    """Linear light converted for display, 0 to 1."""
    return np.clip(from_linear(np.clip(values, 0, 1)), 0, 1)


def _planes(camera: Train) -> list[tuple[float, str]]:
    """The planes behind elements and the sensor's plane, each with a title."""
    behind: dict[float, str] = {}
    for element in camera.elements:
        name = element.called
        z = element.z + element.length
        behind[z] = f"{behind[z]} and {name}" if z in behind else name
    planes = [(z, f"behind {names}, z = {z / mm:g} mm") for z, names in behind.items()]
    if camera.sensor.z in behind:
        return planes
    return [*planes, (camera.sensor.z, f"on the sensor, z = {camera.sensor.z / mm:g} mm")]
