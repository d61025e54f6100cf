"""Coded exposure: a shutter that flutters by a code keeps detail of moving objects that an open shutter loses.

Raskar et al. 2006. The target moves sideways by one pixel in each part of the code.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.units import mm, ms
from vcc.camera import Camera
from vcc.gallery import flat_target
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.gallery.extended_depth import BORDER, inner, psnr
from vcc.light_field import LightField
from vcc.motion import MovingCamera, coded
from vcc.optics import Lens, Mask
from vcc.optics.sensor import Sensor
from vcc.recover import wiener
from vcc.shapes.patterns import Circle
from vcc.showcase import figures
from vcc.showcase.bench import Bench

Array = NDArray[np.float64]

CODE = "1010000111000001010000110011110111010111001001100111"
"""The paper's code, of 52 parts, half of them open."""
LIGHT = CODE.count("1") / len(CODE)
"""Share of the light that it passes."""
CHOP = 1 * ms
"""Duration of each part, seconds."""
PUPIL = 2 * mm
DISTANCE = 2.0
"""Distance of the target, metres, which is in focus."""
NOISE = 0.005
"""Standard deviation of the electronics' noise, as a share of white with the open shutter."""
TIME_TOLERANCE = 0.01
MARGIN = 8
"""Pixels of the target beyond the field of view, at either end of the motion."""
LOST = 0.01
"""Share of contrast below which a frequency counts as lost."""
LEAST_GAIN = 3.0
"""Least gain, dB."""

SHUTTERS = {"short": "1", "open": "1" * len(CODE), "coded": CODE}
"""Exposures by name: of one part, of all, and by the code."""
NAMES = {"short": "short exposure", "open": "shutter open", "coded": "shutter fluttering"}


@dataclass(frozen=True, eq=False)
class Taken:
    """The result for one shutter.

    Args:
        recorded: the target with noise, white 1, upright.
        kernel: the motion blur, of sum 1, measured with a bright line that moves likewise.
        restored: the target by a Wiener filter.
        decibels: its PSNR.
    """

    recorded: Array
    kernel: Array
    restored: Array
    decibels: float

    @property
    def contrast(self) -> Array:
        """The modulation transfer along the motion, from 0 to half a cycle per pixel."""
        return np.asarray(np.abs(np.fft.rfft(self.kernel, 1024)))


@dataclass(frozen=True)
class Moving:
    """A camera before a flat object that moves sideways.

    Args:
        slope: angular size of a pixel, as a slope.
        focal_length: of the lens, metres.
    """

    slope: float
    focal_length: float

    def camera(self, code: str, shape: tuple[int, int]) -> MovingCamera:
        """A lens focused on the target, with a shutter."""
        z = 1 / (1 / self.focal_length - 1 / DISTANCE)
        sensor = Sensor(z, shape, self.slope * z)
        still = Camera([Lens(self.focal_length), Mask(Circle(PUPIL))], sensor)
        return MovingCamera(still, shutter=coded(code, len(code) * CHOP))

    def scene(self, flat: Array) -> Callable[[float], LightField]:
        """A flat object that moves by a pixel per `CHOP`, at whole pixels in the middle of each part."""
        field = flat_target.flat(flat, 2 * PUPIL, self.slope, DISTANCE)

        def at(time: float) -> LightField:
            moved = (time / CHOP - 0.5 - len(CODE) // 2) * self.slope
            return field.transformed(Affine.prism((-moved, 0.0)))

        return at

    def photographed(self, flat: Array, code: str, shape: tuple[int, int]) -> Array:
        """The object through a shutter, upright; radiance 1 during the whole open time gives 1."""
        camera = self.camera(code, shape)
        start = (len(CODE) - len(code)) // 2 * CHOP
        image = camera.capture(
            self.scene(flat), len(code) * CHOP, start=start, time_tolerance=TIME_TOLERANCE, interpolation="linear"
        )
        white = np.pi / 4 * PUPIL**2 / camera.camera.sensor.z**2 * code.count("1") / len(code)
        return np.asarray(image.upright().to_numpy().astype(np.float64) / white)

    def taken(self, flat: Array, code: str) -> Taken:
        """A flat target through a shutter, with noise, and restored."""
        margin = len(CODE) // 2 + MARGIN
        wide = np.pad(flat, ((MARGIN, MARGIN), (margin, margin)), mode="symmetric")
        clean = self.photographed(wide, code, (flat.shape[0], flat.shape[1]))
        noise = NOISE * len(CODE) / code.count("1")
        recorded = clean + noise * np.random.default_rng(0).standard_normal(clean.shape)
        kernel = self.kernel(code)
        restored = wiener(recorded, kernel[None, :], noise).picture
        return Taken(recorded, kernel, restored, psnr(restored, flat))

    def kernel(self, code: str) -> Array:
        """The motion blur of a bright upright line, of sum 1, centred."""
        columns = len(CODE) + 2 * MARGIN + 1
        line = np.zeros((2 * MARGIN + 1, 2 * columns + 1))
        line[:, columns] = 1
        row = self.photographed(line, code, (1, columns))[0]
        return np.asarray(row / row.sum())


@dataclass(frozen=True)
class Run:
    """A moving target through a short exposure, an open shutter and a coded one, each deblurred.

    Args:
        target: its largest side, pixels.
    """

    target: int = 240

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Use the middle view of a light field as a target, and measure."""
        advance = Steps(progress, len(SHUTTERS))
        progress(0, advance.total)
        flat = flat_target.grey_view(bench, self.target)
        moving = Moving(abs(float(bench.light_field.frame.linear[2, 2])), bench.focal_length)
        found = {}
        for name, code in SHUTTERS.items():
            found[name] = moving.taken(flat, code)
            advance()
        return Result(prose(__name__, moving=moving), _pictures(found), _findings(found), bench.assumed)


def _pictures(found: dict[str, Taken]) -> tuple[tuple[Picture, ...], ...]:
    rows = [
        [
            (NAMES[name], figures.grey_shown(inner(each.recorded, 0.5 * BORDER, math.floor)))
            for name, each in found.items()
        ],
        [
            (f"{each.decibels:.1f} dB", figures.grey_shown(inner(each.restored, 0.5 * BORDER, math.floor)))
            for each in found.values()
        ],
    ]
    return below(
        Picture(
            "target",
            "A target that moves by 52 pixels",
            "All in the same light with the same noise of the electronics; brightness is made alike.",
            figures.table((9.0, 6.4), rows, ("as recorded", "deblurred")),
        ),
        Picture(
            "contrast",
            "What is left of waves along the way",
            "From the picture of a bright line that moves. Each zero of the open shutter is a frequency that "
            "no filter brings back.",
            _contrast_figure(found),
        ),
    )


def _contrast_figure(found: dict[str, Taken]) -> figures.Figure:
    figure = figures.new_figure(9.0, 3.4)
    axes = figure.subplots()
    for (name, each), colour in zip(found.items(), ("#9aa0a6", "#d95f02", "#1b6ca8"), strict=True):
        contrast = np.maximum(each.contrast, 1e-4)
        axes.semilogy(np.linspace(0, 0.5, len(contrast)), contrast, label=NAMES[name], color=colour, linewidth=1.3)
    figures.label(axes, "cycles per pixel", "contrast")
    axes.set_xlim(0, 0.5)
    axes.set_ylim(1e-3, 1.2)
    figure.legend(frameon=False, fontsize=figures.LABEL, loc="outside upper center", ncols=len(found))
    return figure


def _findings(found: dict[str, Taken]) -> tuple[Finding, ...]:
    # Relative to a short exposure, to exclude the losses by sampling and by the motion within a part.
    lowest = {name: float((found[name].contrast / found["short"].contrast).min()) for name in ("coded", "open")}
    decibels = {name: each.decibels for name, each in found.items()}
    return (
        Finding(
            "lowest contrast over all frequencies, shutter fluttering",
            f"no frequency is lost: above {LOST}",
            lowest["coded"],
            "",
            lowest["coded"] > LOST,
            "the code was searched for by the authors for this",
        ),
        Finding(
            "the same, shutter open",
            f"frequencies are lost: below {LOST}",
            lowest["open"],
            "",
            lowest["open"] < LOST,
            "a box has zeros",
        ),
        Finding.gain(
            "deblurred target: gain over the open shutter",
            decibels["coded"],
            decibels["open"],
            LEAST_GAIN,
            "with half of the light",
            "deblurring becomes well-posed",
        ),
        Finding.gain(
            "deblurred target: gain over a short exposure",
            decibels["coded"],
            decibels["short"],
            LEAST_GAIN,
            f"with {CODE.count('1')} times the light",
            "less noise than a short exposure",
        ),
    )


ENTRY = Entry(
    "coded-exposure",
    "Coded exposure: the fluttered shutter",
    "R. Raskar, A. Agrawal and J. Tumblin, Coded exposure photography: motion deblurring using fluttered shutter, "
    "ACM Transactions on Graphics 25 (SIGGRAPH 2006)",
    "A shutter that opens and shuts by a code while things move keeps all spatial frequencies, so that motion "
    "blur can be undone.",
    Run(),
)
