"""Light fields in phase space: the u–s diagram in which optics is geometry (the paper's Figure 4)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.camera import Camera
from vcc.errors import InputError
from vcc.light_field import LightField
from vcc.optics import Faces
from vcc.plot import style
from vcc.sampled import to_numpy
from vcc.units import mm

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

CELLS_DRAWN_ONE_BY_ONE = 20_000
"""More cells than this are one picture inside a .svg or .pdf, which would grow too large otherwise."""


def plot_phase_space(
    light_field: LightField,
    *,
    row: int | None = None,
    pixel_row: int | None = None,
    across: str = "u",
    white: float | None = None,
    axes: Axes | None = None,
) -> Axes:
    """Draw the u–s diagram of a light field: position across, slope up, as the paper's Figure 4(c).

    One 2-D slice, with one row of views and one row of pixels held. Each sample is drawn as the cell
    that it stands for, placed by the frame: nothing is resampled, so flight shows as a shear along
    u, a lens as one along s. Grey is where the light field holds nothing.

    Args:
        light_field: at any plane.
        row: which row of views (v); None takes the middle one. A column of views for across="v".
        pixel_row: which row of pixels (t); None takes the middle one; a column for across="v".
        across: ``"u"`` draws u and s, ``"v"`` draws v and t.
        white: the radiance drawn white; None takes the brightest of the slice.
        axes: where to draw; None makes a new figure.

    Returns:
        The axes; ``.figure.savefig(path)`` writes them to a file.

    Raises:
        InputError: no such row, or another axis.
    """
    piece = _slice(light_field, row, pixel_row, across)
    u, s = cell_corners(piece, across)
    values = _radiance(piece, across)
    if white is None:
        white = float(values.max()) or 1.0
    if axes is None:
        axes = style.new_axes(5.2, 4.2)
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
    names = ("u", "s") if across == "u" else ("v", "t")
    style.tidy(axes, f"{names[0]} [mm]", f"{names[1]} [slope]")
    return axes


def plot_phase_space_stages(
    camera: Camera,
    light_field: LightField,
    *,
    row: int | None = None,
    pixel_row: int | None = None,
    across: str = "u",
) -> Figure:
    """Draw u–s diagrams on the way through a camera: entrance, behind each element, on the sensor.

    All have the same scales and the same white, so that what each element does can be seen: the
    paper's Figure 4(c) for any camera.

    Args:
        camera: through which the light field goes.
        light_field: at the entrance plane.
        row: as in `plot_phase_space`, likewise the next two.
        pixel_row: which row of pixels.
        across: ``"u"`` or ``"v"``.

    Returns:
        The figure; ``.savefig(path)`` writes it to a file.

    Raises:
        InputError: what `plot_phase_space` refuses; an element that bends rays otherwise than a lens or a prism
            does (behind it no frame holds the cells).
    """
    for element in camera.elements:
        if any(isinstance(part, Faces) and part.bending is not None for part in element.parts()):
            raise InputError(
                f"{element.label} bends rays otherwise than a lens or a prism: behind it cells of phase space are "
                "no longer parallelograms of one frame, and they are what this figure draws. Draw the rays "
                "(camera.plot), or a camera of the elements before it"
            )
    piece = _slice(light_field, row, pixel_row, across)  # first: what follows works on few samples
    stages = [("entrance, z = 0 mm", piece)]
    for z, title in _planes(camera):
        stages.append((title, camera.light_field_at(piece, z)))
    white = float(_radiance(piece, across).max()) or 1.0
    rows = math.ceil(len(stages) / 4)
    columns = math.ceil(len(stages) / rows)
    grid = style.new_axes(
        max(5.2, 3.1 * columns), 3.3 * rows, rows, columns, sharex=True, sharey=True, squeeze=False
    )
    figure: Figure = grid[0, 0].figure
    for place, ((title, stage), axes) in enumerate(zip(stages, grid.flat, strict=False)):
        plot_phase_space(stage, across=across, white=white, axes=axes)
        axes.set_title(title, fontsize=style.TEXT, color=style.INK)
        if place % columns:
            axes.set_ylabel("")
        axes.tick_params(labelbottom=place + columns >= len(stages))
        if place + columns < len(stages):
            axes.set_xlabel("")
    for axes in grid.flat[len(stages) :]:
        axes.set_visible(False)
    return figure


def cell_corners(light_field: LightField, across: str = "u") -> tuple[Array, Array]:
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


def _slice(light_field: LightField, row: int | None, pixel_row: int | None, across: str) -> LightField:
    """The light field with one row of views and one row of pixels left, in its place."""
    if across not in ("u", "v"):
        raise InputError(f'across is "u" or "v", not {across!r}')
    nv, nu, nt, ns = light_field.shape[:4]
    counts = {"row": nv, "pixel_row": nt} if across == "u" else {"row": nu, "pixel_row": ns}
    chosen = []
    for (name, count), given in zip(counts.items(), (row, pixel_row), strict=True):
        place = count // 2 if given is None else given
        if not -count <= place < count:
            raise InputError(f"{name} is {place}, and there are {count} of them, counted from 0")
        chosen.append(slice(place % count, place % count + 1))
    if across == "u":
        return light_field[chosen[0], :, chosen[1], :]
    return light_field[:, chosen[0], :, chosen[1]]


def _radiance(piece: LightField, across: str) -> Array:
    """Radiance of a slice, (views, pixels) or (views, pixels, 3)."""
    values = to_numpy(piece.values)
    values = values[0, :, 0] if across == "u" else values[:, 0, :, 0]
    radiance: Array = values.astype(np.float64) / piece.full_scale
    if radiance.ndim == 3 and radiance.shape[2] != 3:
        radiance = radiance.mean(axis=2)
    return radiance


def _for_display(values: Array) -> Any:
    """Linear light as screens want it, 0 to 1."""
    from vcc.formats.transfer import from_linear

    return np.clip(from_linear(np.clip(values, 0, 1)), 0, 1)


def _planes(camera: Camera) -> list[tuple[float, str]]:
    """The places behind elements and the sensor's, each with a title."""
    behind: dict[float, str] = {}
    for element in camera.elements:
        name = f"{element.kind} {element.name}".strip()
        z = element.z + element.length
        behind[z] = f"{behind[z]} and {name}" if z in behind else name
    planes = [(z, f"behind {names}, z = {z / mm:g} mm") for z, names in behind.items()]
    if camera.sensor.z in behind:
        return planes
    return [*planes, (camera.sensor.z, f"on the sensor, z = {camera.sensor.z / mm:g} mm")]
