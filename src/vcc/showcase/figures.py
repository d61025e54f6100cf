"""Figures: close-ups side by side, views, masks, a contact sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.units import mm
from vcc.camera import Camera
from vcc.fields.sampled import to_numpy
from vcc.files import transfer
from vcc.files.atomic import atomic_path
from vcc.files.pictures import read_picture
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics.sensor import Sensor
from vcc.plot import plot_phase_space_stages

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Figure

Shown = NDArray[np.float32]

INK, QUIET, ACCENT = "#222222", "#666666", "#D55E00"
LABEL = 9
"""Size of labels, points."""
GREY = {"cmap": "gray", "vmin": 0, "vmax": 1}
"""How pictures without colours are drawn: 0 is black, 1 is white."""
SHEET_WIDTH, HIGHEST_ROW = 15.0, 6.8
"""Of the contact sheet, inches."""


@dataclass(frozen=True)
class Crop:
    """A square of the upright image.

    Args:
        row: of its first pixel; may lie outside because of rounding, `of` moves it inside.
        column: likewise.
        size: pixels a side.
    """

    row: int
    column: int
    size: int

    def of(self, shown: Shown) -> Shown:
        """The square cut out of an image (rows, columns, ...)."""
        row = min(max(self.row, 0), shown.shape[0] - self.size)
        column = min(max(self.column, 0), shown.shape[1] - self.size)
        return shown[row : row + self.size, column : column + self.size]


def crop_around(sensor: Sensor, place: tuple[float, float, float], size: int) -> Crop:
    """The square around a point of the scene, as seen through the middle of a lens at z = 0.

    Args:
        sensor: behind the lens.
        place: (X, Y, distance) of the point, metres.
        size: pixels a side.
    """
    # The upright image has the orientation of the scene.
    row, column = (
        (count - 1) / 2 + across / place[2] * sensor.z / pitch
        for across, count, pitch in zip(place[1::-1], sensor.shape, sensor.pitches, strict=True)
    )
    return Crop(round(row) - size // 2, round(column) - size // 2, size)


def shown(image: Image, exposure: float) -> Shown:
    """An image for display: upright, exposed, sRGB, (rows, columns, 3), 0 to 1."""
    return values_shown(image.upright().to_numpy(), 1 / exposure)


def values_shown(upright: NDArray[Any], white: float = 1.0) -> Shown:
    """Upright values of linear light for display: (rows, columns, 3), 0 to 1, sRGB.

    Args:
        upright: (rows, columns[, channels]).
        white: the value shown as white.
    """
    values = np.asarray(upright, dtype=np.float32) * np.float32(1 / white)
    coded = np.clip(transfer.from_linear(np.clip(values, 0, 1)), 0, 1)
    if coded.ndim == 2 or coded.shape[2] == 1:
        coded = np.repeat(coded.reshape(*coded.shape[:2], 1), 3, axis=2)
    return np.asarray(coded[..., :3], dtype=np.float32)


def grey_shown(picture: NDArray[Any]) -> Shown:
    """A grey image for display, by a gamma of 2.2: (rows, columns), 0 to 1."""
    return np.asarray(np.clip(picture, 0, 1).astype(np.float32) ** np.float32(1 / 2.2))


def view_shown(light_field: LightField, row: int, column: int) -> Shown:
    """One view for display; radiance 1 is white."""
    return shown(light_field.view(row, column), 1.0)


def slice_shown(light_field: LightField, view_row: int, pixel_row: int) -> Shown:
    """The slice through all views of a row along one row of pixels, for display: (views, columns, 3)."""
    values = to_numpy(light_field.values[view_row, :, pixel_row]).astype(np.float32)
    return values_shown(values, light_field.full_scale)


def detailed_crops(pictures: Sequence[Shown], size: int) -> list[Crop]:
    """For each picture, the square that is sharp in it and not in the others.

    Args:
        pictures: of the same scene at different focus, all of one shape.
        size: of the squares, pixels.
    """
    from scipy.ndimage import uniform_filter

    detail = [_detail(picture, uniform_filter, size) for picture in pictures]
    crops = []
    for number, energy in enumerate(detail):
        others = [other for n, other in enumerate(detail) if n != number] or [np.zeros_like(energy)]
        row, column = np.unravel_index(np.argmax(energy - np.max(others, axis=0)), energy.shape)
        crops.append(Crop(int(row) - size // 2, int(column) - size // 2, size))
    return crops


def _detail(picture: Shown, smooth: Any, size: int) -> Any:
    """The amount of fine detail in the square around each pixel; 0 near the border."""
    grey = picture.mean(axis=2)
    fine = (grey - smooth(grey, 5)) ** 2
    energy = np.sqrt(np.maximum(smooth(fine, size), 0))  # running sums leave small errors of either sign
    half = size // 2 + 1
    inside = np.zeros_like(energy)
    inside[half:-half, half:-half] = energy[half:-half, half:-half]
    return inside


def new_figure(width: float, height: float) -> Figure:
    """A figure, inches, independent of pyplot."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), dpi=110, layout="constrained", facecolor="white")


def write_figure(figure: Figure, path: Path) -> None:
    """Write a figure as PNG, completely or not at all."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary, facecolor="white")


def close_ups(columns: Sequence[tuple[str, Shown]], crops: Sequence[Crop], rows: Sequence[str]) -> Figure:
    """Magnified squares of several pictures without smoothing: a column per picture, a row per place.

    Args:
        columns: title and picture.
        crops: the places.
        rows: labels of the places.
    """
    pictures = [
        [(title if row == 0 else "", crop.of(picture)) for title, picture in columns]
        for row, crop in enumerate(crops)
    ]
    return table((2.3 * len(columns) + 0.3, 2.3 * len(crops) + 0.35), pictures, rows)


def fill(grid: Any, rows: Sequence[Sequence[tuple[str, Any]]], labels: Sequence[str] = (), **options: Any) -> None:
    """Put pictures on a grid of axes, each below its title.

    Args:
        grid: of axes, (rows, columns).
        rows: titles and pictures; places at the end of a shorter row stay empty.
        labels: to the left of the rows.
        options: of `put`.
    """
    for line, row in zip(grid, rows, strict=True):
        for axes, (title, picture) in zip(line, row, strict=False):
            put(axes, picture, title, **options)
        for axes in line[len(row) :]:
            axes.set_axis_off()
    for line, words in zip(grid, labels, strict=False):
        line[0].set_ylabel(words, fontsize=LABEL, color=INK)


def table(
    size: tuple[float, float],
    rows: Sequence[Sequence[tuple[str, Any]]],
    labels: Sequence[str] = (),
    **options: Any,
) -> Figure:
    """Pictures in rows, each below its title.

    Args:
        size: (width, height) of the figure, inches.
        rows: titles and pictures; places at the end of a shorter row stay empty.
        labels: to the left of the rows.
        options: of `put`.
    """
    figure = new_figure(*size)
    fill(figure.subplots(len(rows), max(map(len, rows)), squeeze=False), rows, labels, **options)
    return figure


def enlarged(whole: Shown, piece: Crop, titles: tuple[str, str]) -> Figure:
    """A picture in which a square is marked, and next to it this square, enlarged.

    Args:
        whole: (rows, columns, 3).
        piece: the square.
        titles: of both.
    """
    from matplotlib.patches import Rectangle

    ratio = whole.shape[1] / whole.shape[0]
    figure = new_figure(11.5, 0.4 + 5.6 / ratio)
    left, right = figure.subplots(1, 2, width_ratios=(ratio, 1))
    put(left, whole, titles[0]).set_interpolation("antialiased")
    mark = Rectangle((piece.column, piece.row), piece.size, piece.size, fill=False, color=ACCENT, linewidth=2)
    left.add_patch(mark)
    put(right, piece.of(whole), titles[1])
    return figure


def label(axes: Any, across: str, up: str) -> None:
    """Label the axes of a graph."""
    axes.set_xlabel(across, fontsize=LABEL)
    axes.set_ylabel(up, fontsize=LABEL)
    axes.tick_params(labelsize=LABEL - 1, which="both")


def put(axes: Any, picture: Shown, title: str = "", **options: Any) -> Any:
    """Put a picture on axes without ticks; pixels stay square and sharp.

    Args:
        axes: where to draw.
        picture: (rows, columns, 3), or (rows, columns): by default grey, see `GREY`.
        title: above it.
        options: of ``imshow``, in place of the default.
    """
    image = axes.imshow(picture, interpolation="nearest", **(options or (GREY if picture.ndim == 2 else {})))
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(False)
    if title:
        axes.set_title(title, fontsize=LABEL, color=INK)
    return image


def views_figure(light_field: LightField) -> Figure:
    """The outermost and the middle view of a row, and the slice through all views along one row of pixels."""
    nv, nu, nt, ns = light_field.shape[:4]
    row, pixel_row = nv // 2, round(0.46 * nt)
    height = 3.3 * nt / ns
    figure = new_figure(10, height + 1.7)
    grid = figure.add_gridspec(2, 3, height_ratios=(height, 1.0))
    for place, (column, name) in enumerate(((0, "leftmost"), (nu // 2, "middle"), (nu - 1, "rightmost"))):
        axes = figure.add_subplot(grid[0, place])
        put(axes, view_shown(light_field, row, column), f"{name} view of row {row + 1}")
        axes.axhline(pixel_row, color=ACCENT, linewidth=0.9, linestyle=(0, (6, 4)))
    axes = figure.add_subplot(grid[1, :])
    put(axes, slice_shown(light_field, row, pixel_row), aspect="auto")
    axes.set_ylabel(f"view 1 … {nu}", fontsize=LABEL, color=INK)
    axes.set_xlabel(
        "pixels along the dashed line: each object leaves a straight trace, and its slope shows its distance",
        fontsize=LABEL,
        color=INK,
    )
    return figure


PARALLEL, NEAR_POINT = (0.1, 0.5, 1.0), (1.0, 0.4, 0.05)
"""Colours of light from two points, linear: blue and orange."""


def points_figure(camera: Camera, width: float) -> Figure:
    """The light of two points in phase space through the stages of a camera, with a key.

    Args:
        camera: one lens, focused at infinity.
        width: of the lens, metres.
    """
    focal_length = camera.sensor.z
    figure = plot_phase_space_stages(camera, points_field(focal_length, width))
    words = ("parallel light", f"a point {4 * focal_length / mm:g} mm away")
    lines = [
        figure.axes[0].plot([], [], color=tuple(transfer.from_linear(np.array(colour))), lw=2, label=word)[0]
        for word, colour in zip(words, (PARALLEL, NEAR_POINT), strict=True)
    ]
    figure.legend(handles=lines, loc="outside lower center", ncols=2, frameon=False)
    return figure


def points_field(focal_length: float, width: float) -> LightField:
    """Two points of light in 41 views in a row: one at infinity off the axis, one near on the axis.

    The near point is four focal lengths away and orange, the far one blue: the paper's parallel light.

    Args:
        focal_length: of the lens behind the light field, metres.
        width: of the row of views, metres.
    """
    views, pixels, distance = 41, 301, 4 * focal_length
    slope = 1.15 * width / distance / pixels
    i, k = np.arange(views) - (views - 1) / 2, np.arange(pixels) - (pixels - 1) / 2
    parallel = np.broadcast_to(k + round(0.36 * pixels), (views, pixels))
    near = k + width / views * i[:, None] / distance / slope
    values = np.zeros((1, views, 1, pixels, 3), dtype=np.float32)
    for offset, colour in ((parallel, PARALLEL), (near, NEAR_POINT)):
        values[0, :, 0][np.abs(offset) <= 4] = colour
    return LightField.from_views(values, width / views, slope, disparity_range=(0.0, 0.0))


def mask_figure(masks: Sequence[tuple[str, Any]], width: float) -> Figure:
    """The transmission of masks, on the part that light to the sensor crosses.

    Args:
        masks: title and mask.
        width: of the square shown, metres.
    """
    figure = new_figure(3.4 * len(masks), 3.5)
    for axes, (title, mask) in zip(np.atleast_1d(figure.subplots(1, len(masks))), masks, strict=True):
        places = (np.arange(480) + 0.5) / 480 * width - width / 2
        transmission = mask.faces().pattern.mean(places[None, :], places[:, None], width / 480, width / 480)
        half = width / 2e-3
        axes.imshow(transmission, cmap="gray", vmin=0, vmax=1, extent=(-half, half, half, -half))
        axes.set_title(title, fontsize=LABEL, color=INK)
        axes.set_ylabel("y [mm]", fontsize=LABEL, color=INK)
        axes.set_xlabel("x [mm]", fontsize=LABEL, color=INK)
        axes.tick_params(labelsize=LABEL - 1)
    return figure


def error_shown(image: Image, truth: Image, exposure: float, gain: float = 3.0) -> Shown:
    """The difference from the truth in linear light, times ``gain``, on mid-grey; upright."""
    difference = (image.upright().to_numpy() - truth.upright().to_numpy()) * np.float32(exposure * gain)
    grey = np.clip(0.5 + difference / 2, 0, 1)
    if grey.ndim == 2:
        grey = grey[..., None]
    return np.asarray(np.broadcast_to(grey[..., :3], (*grey.shape[:2], 3)), dtype=np.float32)


@dataclass(frozen=True)
class SheetRow:
    """A row of the contact sheet.

    Args:
        title: a line above it.
        text: a line below that, smaller.
        pictures: title and file of each.
    """

    title: str
    text: str
    pictures: Sequence[tuple[str, Path]]


def contact_sheet(title: str, rows: Sequence[SheetRow]) -> Figure:
    """All pictures on one sheet, read from their files.

    Args:
        title: of the sheet.
        rows: from top to bottom.
    """
    pictures = [[_read(path) for _, path in row.pictures] for row in rows]
    ratios = [[picture.shape[1] / picture.shape[0] for picture in row] for row in pictures]
    heights = [min(SHEET_WIDTH / sum(row), HIGHEST_ROW) + 0.9 for row in ratios]
    figure = new_figure(SHEET_WIDTH, 0.6 + sum(heights))
    figure.suptitle(title, fontsize=17, color=INK, x=0.01, ha="left", fontweight="bold")
    parts = figure.subfigures(len(rows), 1, height_ratios=heights, squeeze=False)[:, 0]
    for part, row, row_pictures, row_ratios in zip(parts, rows, pictures, ratios, strict=True):
        part.suptitle(f"{row.title}\n{row.text}", fontsize=11.5, color=INK, x=0.01, ha="left")
        places = part.subplots(1, len(row_pictures), width_ratios=row_ratios, squeeze=False)[0]
        for axes, (name, _), picture in zip(places, row.pictures, row_pictures, strict=True):
            put(axes, picture, name).set_interpolation("antialiased")
    return figure


def _read(path: Path) -> Any:
    picture = read_picture(path)[0][..., :3]
    return np.repeat(picture[..., None], 3, axis=2) if picture.ndim == 2 else picture
