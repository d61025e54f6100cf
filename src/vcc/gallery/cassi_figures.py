"""Pictures of `vcc.gallery.cassi`."""

from __future__ import annotations

import numpy as np

from vcc.base.units import nm
from vcc.gallery.cassi_camera import BANDS, SHEAR, WAVELENGTHS, Array
from vcc.gallery.cassi_recovery import Recovered
from vcc.gallery.entry import Picture, below
from vcc.showcase import figures

NAMES = {"lamp": "lamp: a line of 24 nm", "paint": "paint: an edge at 595 nm", "wall": "wall: a slope"}
COLOURS = ((610, 28), (545, 28), (465, 22))
"""Middle and width, nm, of the red, green and blue by which cubes are shown."""


def _in_colour(cube: Array) -> figures.Shown:
    wavelengths = np.array(WAVELENGTHS) / nm
    curves = np.array([np.exp(-(((wavelengths - middle) / width) ** 2) / 2) for middle, width in COLOURS])
    return figures.values_shown(cube @ (curves / curves.sum(axis=1, keepdims=True)).T)


def pictures(found: Recovered) -> tuple[tuple[Picture, ...], ...]:
    """The rows of pictures on the page."""
    cubes = found.cubes
    recording = figures.grey_shown(found.recording / found.recording.max())
    rows = [
        [
            ("truth", _in_colour(found.truth)),
            (f"code and prism: {found.decibels('noise'):.1f} dB", _in_colour(cubes["noise"])),
            ("the recording", recording),
        ],
        [
            (f"{words}: {found.decibels(name):.1f} dB", _in_colour(cubes[name]))
            for name, words in (
                ("no code", "prism, no code"),
                ("no prism", "code, no prism"),
                ("straight line", "straight-line shears"),
            )
        ],
    ]
    return below(
        Picture(
            "scene",
            "One grey recording, and the cubes recovered",
            f"The {BANDS} bands are shown as red, green and blue. The recording is {SHEAR} pixels wider than "
            "the scene. All recordings have the noise of the same sensor; the bottom row shows controls.",
            figures.table((9.0, 6.3), rows),
        ),
        Picture(
            "bands",
            "Four of the bands",
            "Top: truth. Bottom: recovered from the recording with noise. Edges of patches survive, the "
            "fine texture of the wall is lost.",
            _bands_figure(found),
        ),
        Picture(
            "spectra",
            "Spectra at three places",
            "Means of 5×5 pixels, recovered from the recording with noise. The dotted model moves "
            "each band by one pixel more than the band before it.",
            _spectra_figure(found),
        ),
        Picture(
            "shears",
            "The shear of real glass is not linear in the wavelength",
            "From images of a bright line through the prism of F2.",
            _shears_figure(found),
        ),
    )


def _bands_figure(found: Recovered) -> figures.Figure:
    chosen = [2, 11, 16, 22]
    rows = [
        [
            (f"{WAVELENGTHS[band] / nm:.0f} nm" if top else "", figures.grey_shown(cube[..., band]))
            for band in chosen
        ]
        for top, cube in ((True, found.truth), (False, found.cubes["noise"]))
    ]
    return figures.table((9.0, 4.9), rows, ("truth", "recovered"))


def _spectra_figure(found: Recovered) -> figures.Figure:
    figure = figures.new_figure(9.0, 3.3)
    wavelengths = np.array(WAVELENGTHS) / nm
    for axes, (place, title) in zip(figure.subplots(1, 3, sharey=True), NAMES.items(), strict=True):
        for cube, name, style in (
            (found.truth, "truth", {"color": figures.QUIET, "linewidth": 3.0, "alpha": 0.6}),
            (found.cubes["noise"], "recovered", {"color": "#1b6ca8", "marker": "o", "markersize": 3}),
            (found.cubes["straight line"], "by straight-line shears", {"color": figures.ACCENT, "linestyle": ":"}),
        ):
            axes.plot(wavelengths, found.spectrum(cube, place), label=name if place == "wall" else None, **style)
        axes.set_title(title, fontsize=figures.LABEL)
        figures.label(axes, "wavelength [nm]", "radiance" if axes is figure.axes[0] else "")
    figure.axes[0].set_ylim(0, 1.45)
    figure.legend(frameon=False, fontsize=figures.LABEL, loc="outside upper center", ncols=3)
    return figure


def _shears_figure(found: Recovered) -> figures.Figure:
    figure = figures.new_figure(9.0, 3.3)
    axes = figure.subplots()
    wavelengths = np.array(WAVELENGTHS) / nm
    axes.plot(wavelengths, found.imager.shears, color="#1b6ca8", label="closed form")
    axes.plot(wavelengths, found.imager.measured_shears, "o", color=figures.INK, markersize=3.5, label="measured")
    axes.plot(wavelengths, np.arange(BANDS), ":", color=figures.ACCENT, label="straight line")
    figures.label(axes, "wavelength [nm]", "shear [pixels]")
    figure.legend(frameon=False, fontsize=figures.LABEL, loc="outside upper center", ncols=3)
    return figure
