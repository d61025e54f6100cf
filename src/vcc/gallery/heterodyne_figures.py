"""Figures of the heterodyne camera's recordings, their spectra and the decoded views."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import picture_spectrum, plot_plane_spectrum
from vcc.base.units import mm
from vcc.camera import Camera
from vcc.image import Image
from vcc.light_field import LightField
from vcc.recover.heterodyne import HeterodyneGeometry
from vcc.showcase import figures

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

TRANSMITTED = 0.25
"""The mean of the cosines: ½ along each axis."""
PERIODS = 8
"""Periods of the mask's shadow in the magnified part of the recording."""
DECADES = 15.0
"""Decades of power shown in spectra, from the strongest down."""


def recording_figure(camera: Camera, image: Image, white: float) -> figures.Figure:
    """The recording, its part with the strongest shadow of the mask, and a corresponding part of the mask.

    Args:
        camera: with its mask of cosines last.
        image: irradiance on its sensor.
        white: radiance.
    """
    from matplotlib.patches import Rectangle
    from scipy.ndimage import uniform_filter

    geometry, sensor = HeterodyneGeometry.of(camera), camera.sensor
    cosines = camera.elements[-1].faces().pattern
    assert cosines is not None
    figure = figures.new_figure(12.0, 11.0)
    (whole, plain), (dots, pattern) = figure.subplots(2, 2)
    pixels = PERIODS * geometry.views
    half = pixels * sensor.pitches[1] / 2
    corners = np.array([-half, half, half, -half]) / mm
    upright = image.upright().to_numpy()
    share = sensor.z**2 / math.prod(geometry.aperture_period) / TRANSMITTED / white
    grey = 100 * share * (upright if upright.ndim == 2 else upright.mean(axis=2))
    modulation = grey - uniform_filter(grey, geometry.views)
    energy = uniform_filter(modulation**2, pixels)[pixels:-pixels, pixels:-pixels]
    row, column = (int(n) + pixels // 2 for n in np.unravel_index(np.argmax(energy), energy.shape))
    square = np.s_[row : row + pixels, column : column + pixels]
    figures.put(
        whole,
        figures.values_shown(upright * share, 1.0),
        f"the recording, {sensor.shape[1]}×{sensor.shape[0]} pixels",
    )
    whole.add_patch(Rectangle((column, row), pixels, pixels, fill=False, color=figures.ACCENT, linewidth=2))
    most = float(np.abs(modulation[square]).max())
    for axes, values, title, low, high in (
        (plain, grey[square], "the orange square, magnified", None, None),
        (dots, modulation[square], "the same less its mean over a period of the mask", -most, most),
    ):
        drawn = axes.imshow(values, cmap="gray", vmin=low, vmax=high, extent=corners)
        figure.colorbar(drawn, ax=axes, shrink=0.8).set_label("% of white", fontsize=figures.LABEL)
        axes.set_title(title)
    places = (np.arange(400) / 200 - 1) * half
    drawn = pattern.imshow(cosines(places[None, :], places[:, None]), cmap="gray", vmin=0, vmax=1, extent=corners)
    figure.colorbar(drawn, ax=pattern, shrink=0.8).set_label("transmission", fontsize=figures.LABEL)
    pattern.set_title("the mask, as large a part")
    for axes in (whole, plain, dots, pattern):
        axes.title.set_fontsize(figures.LABEL + 2)
    for axes in (plain, dots, pattern):
        figures.label(axes, "x [mm]" if axes is pattern else "x from the middle of the square [mm]", "y [mm]")
    return figure


def spectra_figure(camera: Camera, images: dict[str, Image]) -> figures.Figure:
    """Power spectra of recordings side by side, with the outlines of tiles; the names are the titles."""
    geometry = HeterodyneGeometry.of(camera)
    harmonics = geometry.harmonics
    f_x, f_y = (carrier * mm for carrier in geometry.carrier)
    figure = figures.new_figure(14.0, 6.8)
    panels = figure.subplots(1, len(images), sharey=True)
    # Faded out at the edges as in decoding, otherwise the edges would cause a cross over all tiles.
    fade = np.multiply.outer(*(np.hanning(n) for n in camera.sensor.shape)).astype(np.float32)
    for axes, (title, image) in zip(panels, images.items(), strict=True):
        values = image.to_numpy()
        grey = values if values.ndim == 2 else values.mean(axis=2)
        plot_plane_spectrum(picture_spectrum(replace(image, values=grey * fade)), decades=DECADES, axes=axes)
        axes.collections[0].set_cmap("inferno")
        for n in np.arange(-harmonics, harmonics + 2) - 0.5:
            axes.axvline(n * f_x, color="white", linewidth=0.4, alpha=0.5)
            axes.axhline(n * f_y, color="white", linewidth=0.4, alpha=0.5)
        axes.set_xlim(-(harmonics + 0.5) * f_x, (harmonics + 0.5) * f_x)
        axes.set_ylim((harmonics + 0.5) * f_y, -(harmonics + 0.5) * f_y)
        axes.set_aspect("equal")
        axes.set_title(title, fontsize=figures.LABEL + 2)
        above = axes.secondary_xaxis("top", functions=(lambda x, f=f_x: x / f, lambda n, f=f_x: n * f))
        beside = axes.secondary_yaxis("right", functions=(lambda y, f=f_y: y / f, lambda n, f=f_y: n * f))
        for tiles, which in ((above, "set_xticks"), (beside, "set_yticks")):
            getattr(tiles, which)(np.arange(-harmonics, harmonics + 1))
        above.set_xlabel("tile $n_x$", fontsize=figures.LABEL)
        beside.set_ylabel("tile $n_y$", fontsize=figures.LABEL)
    bar = figure.colorbar(panels[0].collections[0], ax=panels, shrink=0.8, pad=0.01)
    bar.set_label("log10 of power, the strongest 0", fontsize=figures.LABEL)
    return figure


def views_figure(columns: dict[str, tuple[LightField, Array | None]], white: float) -> figures.Figure:
    """Two views of the middle row, near both ends of the aperture.

    Args:
        columns: titles, with views and their decibels, (v, u), if there are any.
        white: radiance.
    """
    some = next(iter(columns.values()))[0]
    count, (nt, ns) = some.shape[0], some.shape[2:4]
    numbers, middle = (1, count - 2), count // 2
    rows = [
        [
            (
                title if decibels is None else f"{title}: {decibels[middle, number]:.1f} dB",
                figures.values_shown(np.asarray(field.values[middle, number]), white),
            )
            for title, (field, decibels) in columns.items()
        ]
        for number in numbers
    ]
    labels = [f"view {number + 1} of {count}" for number in numbers]
    return figures.table((4 * 3.6, 2 * (3.6 * nt / ns + 0.3)), rows, labels)


def refocus_figure(rows: dict[str, dict[str, Floats]], white: float) -> figures.Figure:
    """Pictures by the name of a row and that of a place."""
    height, width = next(iter(next(iter(rows.values())).values())).shape[:2]
    shown = [
        [(place, figures.values_shown(picture, white)) for place, picture in pictures.items()]
        for pictures in rows.values()
    ]
    return figures.table((3 * 4.4, len(rows) * (4.4 * height / width + 0.3)), shown, list(rows))
