"""Depth of field as the contrast of fringes on a plane that approaches: measurements and closed forms."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.gallery.entry import Finding
from vcc.gallery.flat_target import flat
from vcc.light_field import LightField
from vcc.showcase import figures
from vcc.showcase.words import length

Array = NDArray[np.float64]

PERIOD = 4
"""Period of the fringes, in lenslets: twice the finest that lenslets resolve."""
HALF_OF_SQUARE, HALF_OF_DISC = 0.60335, 0.70460
"""The x at which sin(πx)/(πx), and 2·J₁(πx)/(πx), equal ½."""


@dataclass(frozen=True)
class Sharpness:
    """Contrast of fringes over depth; it is 1 in the scene.

    Args:
        distances: metres, from the one in focus towards the camera.
        blurs: a point's blur disc on the lenslets, D·d·|1/Z − 1/F|, in lenslets.
        refocused: measured in images refocused there.
        conventional: measured with pixels in place of the lenslets.
        each: N, pixels across a lenslet.
        f_number: of the whole lens.
    """

    distances: tuple[float, ...]
    blurs: Array
    refocused: Array
    conventional: Array
    each: int
    f_number: float

    @property
    def reach(self) -> float:
        """The blur at which refocused fringes have half their contrast in focus, in lenslets."""
        half = self.refocused[0] / 2
        after = max(int(np.argmax(self.refocused < half)), 2)
        near = np.s_[after - 2 : after + 1]  # a parabola through three points
        return float(np.polyval(np.polyfit(self.refocused[near], self.blurs[near], 2), half))

    def findings(self) -> list[Finding]:
        """The extension of the depth of field, and the contrast against its closed form."""
        extension = self.reach / (HALF_OF_DISC * PERIOD)
        by_windows = self.each * HALF_OF_SQUARE / HALF_OF_DISC
        best = np.sinc(1 / PERIOD)
        errors = [
            float(np.abs(measured - best * expected).max())
            for measured, expected in (
                (self.refocused, window_mtf(self.blurs, self.each)),
                (self.conventional, disc_mtf(self.blurs)),
            )
        ]
        return [
            Finding(
                "depth of field, to half the contrast: refocused over the same lens without lenslets",
                f"{self.each}, as of f/(A·{self.each}) (Ng); {by_windows:.1f} in closed form for square pixels, "
                "within 3 %",
                extension,
                "times",
                abs(extension / by_windows - 1) < 0.03,
                f"a pixel sees a square 1/{self.each} as wide as the lens, which blurs a little more than a disc",
            ),
            Finding(
                "contrast of refocused fringes against that closed form: largest difference",
                "below 0.02",
                errors[0],
                "",
                errors[0] < 0.02,
                f"that of the lens without lenslets follows its own to {errors[1]:.3f}",
            ),
        ]

    def figure(self) -> figures.Figure:
        """Measured points on closed forms."""
        figure = figures.new_figure(10.0, 3.8)
        axes = figure.subplots()
        fine = np.linspace(0, self.blurs[-1] * 1.04, 400)
        best, number = np.sinc(1 / PERIOD), self.f_number
        for curve, colour, dashes in (
            (disc_mtf(fine), figures.QUIET, "-"),
            (window_mtf(fine, self.each), figures.ACCENT, "-"),
            (disc_mtf(fine / self.each), figures.QUIET, "--"),
        ):
            axes.plot(fine, best * curve, dashes, color=colour)
        axes.plot([], [], "-", color=figures.INK, label="closed forms")
        axes.plot(
            self.blurs, self.conventional, "o", color=figures.QUIET, label=f"no lenslets, f/{number:.2g}, measured"
        )
        axes.plot(self.blurs, self.refocused, "o", color=figures.ACCENT, label="refocused there, measured")
        axes.plot([], [], "--", color=figures.QUIET, label=f"a lens at f/{number * self.each:.2g}, closed form")
        axes.set_xlabel("blur of the whole lens, in lenslets; above, the distance of the plane")
        axes.set_ylabel("contrast")
        axes.set_ylim(-0.15, 1)
        axes.axhline(0, color=figures.QUIET, linewidth=0.6)
        places = ["∞" if math.isinf(distance) else length(distance) for distance in self.distances]
        axes.secondary_xaxis("top").set_xticks(self.blurs, places)
        figure.legend(loc="outside right center", frameon=False)
        return figure


def window_mtf(blurs: Array, each: int) -> Array:
    """Contrast of the fringes, out of focus, by a square window 1/each as wide as the lens."""
    return np.asarray(np.sinc(blurs / each / PERIOD))


def disc_mtf(blurs: Array) -> Array:
    """Contrast of the fringes, out of focus, by the whole round lens."""
    from scipy.special import j1

    x = np.maximum(np.pi * blurs / PERIOD, 1e-9)
    return np.asarray(2 * j1(x) / x)


def fringes(slope: float, width: float, distance: float, lenslets: int) -> LightField:
    """Fringes (1 + cos)/2 along rows, on a plane; the period is PERIOD lenslets seen from the middle of the lens.

    Args:
        slope: between neighbouring lenslets, seen from the middle of the lens.
        width: of the lens, metres.
        distance: of the plane, metres.
        lenslets: number that the plane covers.
    """
    finer = 8
    places = (np.arange(lenslets * finer) - (lenslets * finer - 1) / 2) / finer / PERIOD
    row = 0.5 + 0.5 * np.cos(2 * np.pi * places)
    return flat(np.broadcast_to(row, (len(row), len(row))), width, slope / finer, distance, sample="point")


def contrast(row: Array) -> float:
    """Amplitude over mean of fringes bright in the middle of a row, over whole periods; negative if reversed."""
    places = np.arange(len(row)) - (len(row) - 1) / 2
    inner = np.abs(places) < 4 * PERIOD - 0.5
    turn = 2 * np.pi * places[inner] / PERIOD
    design = np.stack([np.cos(turn), np.sin(turn), np.ones_like(turn)], axis=1)
    even, _, mean = np.linalg.lstsq(design, row[inner], rcond=None)[0]
    return float(even / mean)
