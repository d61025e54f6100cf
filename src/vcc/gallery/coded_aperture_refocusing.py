"""Coded-aperture refocusing: a broadband mask in the aperture keeps what blur would lose (Veeraraghavan 2007)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import psf
from vcc.camera import Camera
from vcc.showcase.words import away, length
from vcc.gallery import flat_target
from vcc.gallery.closeness import psnr
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result
from vcc.gallery.flat_target import OPENING
from vcc.gallery.published_codes import VEERARAGHAVAN
from vcc.optics import Lens, Mask
from vcc.optics.sensor import Sensor
from vcc.recover import sparse_gradients, wiener
from vcc.shapes.patterns import Open
from vcc.showcase import figures
from vcc.showcase.bench import APERTURE, Bench
from vcc.showcase.scene import MIDDLE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

CELLS = 7
BLUR = 3 * CELLS
"""Pixels across the opening in the flat target's blur."""
NOISE = 0.002
"""Standard deviation of the additive noise of all recordings, as a share of white through the open aperture."""
NOISES = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02)
"""Those that gains are drawn for."""
FULL_WELL, READ_NOISE = 10_000.0, 2.5
"""Electrons at white through the open aperture, and of reading a pixel: `vcc.optics.electronics`' defaults."""
TARGET = 300
"""Largest side of the flat target, pixels."""
STEPS = 60
"""Of the iterative solver, at most."""
CHART_PART = (-60e-3, -100e-3, 160e-3, 100e-3)
"""A part of the built-in scene's chart that nothing stands before: left, top, right, bottom from its middle, m."""
LOST = 0.01
"""Contrast below which detail counts as lost, in a figure's title."""
MISFIT = 0.05
"""In the scene, what other distances add to a filter's noise: a share of the recording's contrast."""
SMALLEST_BLUR = 4.0
"""Pixels; of the scene, for it to be shown."""


@dataclass(frozen=True, eq=False)
class Deblurred:
    """A recording and what filters make of it, in white.

    Args:
        recording: divided by the light that passes.
        linear: by the Wiener filter.
        sparse: by the solver with sparse gradients.
    """

    recording: Array
    linear: Array
    sparse: Array


def run(bench: Bench, progress: Progress) -> Result:
    """The flat target through both apertures, the gain over noise, and the scene refocused."""
    masks = {"open": Mask(Open(), width=OPENING), "coded": Mask(VEERARAGHAVAN, width=OPENING)}
    target = flat_target.grey_view(bench, TARGET)
    steps = 2 * STEPS + 20
    kernels = {name: flat_target.kernel(mask, BLUR) for name, mask in masks.items()}
    clean = {name: flat_target.recorded(mask, target, BLUR) for name, mask in masks.items()}
    deblurred = {
        name: _deblurred(
            _noisy(clean[name], NOISE),
            kernels[name],
            NOISE,
            _after(progress, part * STEPS, steps),
        )
        for part, name in enumerate(masks)
    }
    progress(2 * STEPS, steps)
    gains = [_linear_gain(clean, kernels, target, noise) for noise in NOISES]
    photons = _photon_gain(clean, kernels, target)
    progress(2 * STEPS + 5, steps)
    rows, findings, words = _scene(bench)
    progress(steps, steps)
    numbers = (*_findings(deblurred, target), *findings, _photon_finding(photons))
    pictures = (
        (
            Picture(
                "psf",
                "The blur of a point and its spectrum",
                "The open aperture’s MTF has lines of zeros, where detail is lost; the mask’s has few of them.",
                _spectra_figure(masks),
            ),
        ),
        (
            Picture(
                "target",
                "A flat target out of focus, recorded and deblurred",
                "Decibels are those of the whole target. Exposure time and noise are the same for both.",
                _target_figure(deblurred, target),
            ),
        ),
        *rows,
        (
            Picture(
                "noise",
                "Gain over noise",
                "By the Wiener filter, which knows the noise; the open aperture’s picture is the recording where "
                "that is better.",
                _noise_figure(gains),
            ),
        ),
    )
    return Result(paragraphs([*_words(), words]), pictures, numbers, bench.assumed)


def _after(progress: Progress, before: int, steps: int) -> Progress:
    """A solver's progress among all steps."""
    return lambda done, total: progress(before + done, steps)


def _noisy(recording: Array, noise: float) -> Array:
    return np.asarray(recording + noise * np.random.default_rng(0).standard_normal(recording.shape))


def _deblurred(recording: Array, kernel: Array, noise: float, progress: Progress) -> Deblurred:
    passed = float(kernel.sum())
    white, spread, uncertain = recording / passed, kernel / passed, noise / passed
    linear = wiener(white, spread, uncertain, borders="periodic").picture
    sparse = sparse_gradients(
        white, spread, uncertain, borders="periodic", iterations=STEPS, progress=progress
    ).picture
    return Deblurred(white, linear, sparse)


def _linear_gain(clean: dict[str, Array], kernels: dict[str, Array], target: Array, noise: float) -> float:
    """The coded aperture's decibels by the Wiener filter over the open one's, by the filter or without."""
    found = {}
    for name, kernel in kernels.items():
        passed = float(kernel.sum())
        white = _noisy(clean[name], noise) / passed
        found[name] = psnr(wiener(white, kernel / passed, noise / passed, borders="periodic").picture, target)
        if name == "open":
            found[name] = max(found[name], psnr(white, target))
    return found["coded"] - found["open"]


def _photon_gain(clean: dict[str, Array], kernels: dict[str, Array], target: Array) -> float:
    """The same with the noise of photons and of reading, instead of noise that is the same for both."""
    found = {}
    for name, kernel in kernels.items():
        passed = float(kernel.sum())
        random = np.random.default_rng(0)
        charge = random.poisson(FULL_WELL * np.maximum(clean[name], 0)) + READ_NOISE * random.standard_normal(
            clean[name].shape
        )
        noise = math.sqrt(max(float(charge.mean()), 0.0) + READ_NOISE**2) / FULL_WELL  # its mean over the picture
        white = charge / FULL_WELL / passed
        found[name] = psnr(wiener(white, kernel / passed, noise / passed, borders="periodic").picture, target)
        if name == "open":
            found[name] = max(found[name], psnr(white, target))
    return found["coded"] - found["open"]


def _findings(deblurred: dict[str, Deblurred], target: Array) -> list[Finding]:
    opened, coded = deblurred["open"], deblurred["coded"]
    without = psnr(opened.recording, target)
    numbers = []
    for what, name, rivals in (
        ("Wiener filter", "linear", ("linear",)),
        ("sparse gradients; the open aperture by whichever is best", "sparse", ("linear", "sparse")),
    ):
        ours = psnr(getattr(coded, name), target)
        best = max(without, *(psnr(getattr(opened, rival), target) for rival in rivals))
        numbers.append(
            Finding(
                f"flat target, blur of {BLUR} pixels, deblurred ({what}): gain of the mask over the open aperture",
                "2 dB or more at the same noise",
                ours - best,
                "dB",
                ours - best >= 2,
                f"{ours:.1f} dB against {best:.1f} dB ({without:.1f} dB as recorded)",
            )
        )
    return numbers


def _photon_finding(gain: float) -> Finding:
    return Finding(
        f"the flat target by the Wiener filter, with the noise of photons instead ({FULL_WELL:.0f} electrons at "
        "white through the open aperture)",
        "",
        gain,
        "dB",
        None,
        "no claim; dimmer light has less of this noise, but more of it for its signal",
    )


def _words() -> list[str]:
    return [
        f"A lens of f = {length(flat_target.FOCAL_LENGTH)} with a square opening of "
        f"{length(OPENING)}, and in it, for one of two cameras, the mask of 7×7 cells, 20 of which are "
        "open. A point out of focus becomes a picture of the aperture. That of an open square has a spectrum with "
        "zeros: detail there is lost. The authors chose the code for a broad spectrum, so that what blur weakens "
        "can be given back.",
        "A flat target, the middle of the middle view, stands "
        f"{away(flat_target.DISTANCE)} before cameras focused {away(flat_target.FOCUS)}: its blur is "
        f"{BLUR} pixels wide, {BLUR // CELLS} for each cell. The exposure time is the same, and so is the noise, "
        f"in the sensor’s own units: additive, Gaussian, with a standard deviation of {100 * NOISE:g} % of white "
        "through the open aperture. The mask lets 20/49 of the light through: brightened to the same white, its "
        "picture has 2.45 times the noise.",
        "The point-spread function is what each simulated camera makes of one point of the target, whose "
        "distance is known. Two decoders, both told the noise: the Wiener filter with a 1/f² prior, and the "
        "solver for sparse gradients (total variation) of <code>vcc.recover</code>. The target repeats beyond its "
        "borders, so that borders play no part.",
    ]


def _scene(bench: Bench) -> tuple[list[tuple[Picture, ...]], list[Finding], str]:
    """The light field, focused nearer, recorded through both apertures and refocused on its middle distance."""
    slope = abs(float(bench.light_field.frame.linear[2, 2]))
    # Views that differ by more than a pixel hold no such blur: then the camera is focused less near.
    most = min(bench.light_field.shape[:2])
    blur = min(APERTURE * (1 / bench.near - 1 / bench.middle) / slope, most)
    focus = 1 / (1 / bench.middle + blur * slope / APERTURE)
    if blur < SMALLEST_BLUR:
        words = f"Out of focus, this light field has a blur of {blur:.1f} pixels only: it is not refocused here."
        return [], [], words
    sharp_camera = _scene_camera(bench, Mask(Open(), width=APERTURE), bench.middle)
    truth = sharp_camera.capture(bench.light_field, interpolation="cubic")
    scale = sharp_camera.sensor.z**2 / APERTURE**2
    sharp = truth.to_numpy().astype(np.float64) * scale
    white = float(np.percentile(sharp, 99.5)) if bench.scene is None else 1.0
    pictures = {"sharp": sharp}
    for name, mask in (("open", Mask(Open(), width=APERTURE)), ("coded", Mask(VEERARAGHAVAN, width=APERTURE))):
        camera = _scene_camera(bench, mask, focus)
        recording = camera.capture(bench.light_field, interpolation="cubic").to_numpy().astype(np.float64)
        point = psf(camera, bench.middle)
        passed = point.collecting_area / APERTURE**2
        noisy = _noisy(recording * camera.sensor.z**2 / APERTURE**2, NOISE * white) / passed
        spread = point.values / point.values.sum()
        pictures[f"{name}-recorded"] = noisy
        noise = math.hypot(NOISE * white / passed, MISFIT * float(noisy.std()))
        pictures[name] = wiener(noisy, spread, noise).picture
    titles = {
        "open-recorded": f"Open aperture, focused {away(focus)}, as recorded",
        "open": f"Refocused {away(bench.middle)}: open aperture",
        "coded": f"Refocused {away(bench.middle)}: coded aperture",
        "coded-recorded": f"Coded aperture, focused {away(focus)}, as recorded",
    }
    shown = {name: figures.values_shown(picture[::-1, ::-1], white) for name, picture in pictures.items()}
    rows = [
        tuple(Picture(f"scene-{name}", titles[name], "", shown[name]) for name in pair)
        for pair in (("open-recorded", "coded-recorded"), ("open", "coded"))
    ]
    rows.append(
        (
            Picture(
                "scene-close-up",
                f"The middle of the scene, what is {away(bench.middle)}",
                "Pixels as they are, not smoothed.",
                figures.close_ups(
                    [
                        ("focused there", shown["sharp"]),
                        ("open, as recorded", shown["open-recorded"]),
                        ("open, refocused", shown["open"]),
                        ("coded, refocused", shown["coded"]),
                    ],
                    [_middle(shown["sharp"])],
                    ["middle"],
                ),
            ),
        )
    )
    words = (
        f"Below, the light field itself through both apertures, {length(APERTURE)} wide and focused "
        f"{away(focus)}, with the same noise. The Wiener filter takes away the blur of what is "
        f"{away(bench.middle)}, {blur:.1f} pixels, by the camera’s point-spread function for that distance "
        "(<code>vcc.analysis.psf</code>). To this filter, things at other distances are wrong, as errors of "
        f"{100 * MISFIT:g} % of the contrast beside the noise; they come out wrong, too, as out of focus in any "
        "refocused picture."
    )
    if bench.scene is None:
        return rows, [], words
    part = _chart(sharp_camera)
    found = {name: psnr(pictures[name][part], sharp[part]) for name in pictures if name != "sharp"}
    best = max(found["open"], found["open-recorded"])
    finding = Finding(
        f"the scene’s chart, blur of {blur:.1f} pixels, refocused by the Wiener filter: gain of the mask",
        "2 dB or more at the same noise",
        found["coded"] - best,
        "dB",
        found["coded"] - best >= 2,
        f"{found['coded']:.1f} dB against {best:.1f} dB ({found['open-recorded']:.1f} dB as recorded)",
    )
    return rows, [finding], words


def _scene_camera(bench: Bench, mask: Mask, focus: float) -> Camera:
    """Pixels of all these cameras see the same angles, so that their pictures lie pixel on pixel."""
    distance = bench.image_distance(focus)
    angles = [pitch / bench.image_distance(bench.middle) for pitch in bench.pitch]
    rows, columns = bench.light_field.shape[2:4]
    sensor = Sensor(distance, (rows, columns), (angles[0] * distance, angles[1] * distance))
    return Camera([Lens(bench.focal_length), mask], sensor)


def _chart(camera: Camera) -> tuple[slice, slice]:
    """Rows and columns, as light lands on the sensor, of `CHART_PART`."""
    rows, columns = camera.sensor.shape
    sides = []
    for count, pitch, ends, middle in (
        (rows, camera.sensor.pitches[0], CHART_PART[1::2], 4e-3),
        (columns, camera.sensor.pitches[1], CHART_PART[0::2], 18e-3),
    ):
        places = [(count - 1) / 2 - (end + middle) / MIDDLE * camera.sensor.z / pitch for end in ends]
        sides.append(slice(max(math.ceil(min(places)), 0), math.floor(max(places)) + 1))
    return sides[0], sides[1]


def _middle(picture: figures.Shown) -> figures.Crop:
    side = min(*picture.shape[:2], 140)
    return figures.Crop((picture.shape[0] - side) // 2, (picture.shape[1] - side) // 2, side)


def _spectra_figure(masks: dict[str, Mask]) -> Figure:
    figure = figures.new_figure(11.0, 3.1)
    grid = figure.subplots(1, 4)
    for place, (name, mask) in enumerate(masks.items()):
        camera = flat_target.focal_camera(mask, (1, 1), BLUR)
        spread = psf(camera, flat_target.DISTANCE)
        side = (BLUR + 1) / 2
        axes = grid[2 * place]
        wide = np.pad(spread.values[::-1, ::-1], BLUR)  # dark around it, cut to one pixel
        start = (wide.shape[0] - (BLUR + 2)) // 2
        part = wide[start : start + BLUR + 2, start : start + BLUR + 2]
        ends = (-side - 0.5, side + 0.5, side + 0.5, -side - 0.5)
        axes.imshow(part, cmap="gray", vmin=0, interpolation="nearest", extent=ends)
        axes.set_title(f"{name}: point out of focus", fontsize=figures.LABEL)
        axes.set_xlabel("pixels", fontsize=figures.LABEL)
        contrast = np.fft.fftshift(np.abs(np.fft.fft2(spread.values, s=(256, 256))))
        lost = float((contrast < LOST).mean())
        axes = grid[2 * place + 1]
        shown = axes.imshow(
            np.log10(np.maximum(contrast, 1e-4)), cmap="magma", vmin=-3, vmax=0, extent=(-0.5, 0.5, 0.5, -0.5)
        )
        axes.set_title(f"{name}: MTF, below {LOST:g} on {100 * lost:.0f} %", fontsize=figures.LABEL)
        axes.set_xlabel("cycles per pixel", fontsize=figures.LABEL)
    for axes in grid:
        axes.tick_params(labelsize=figures.LABEL - 1)
    bar = figure.colorbar(shown, ax=grid[3], ticks=(-3, -2, -1, 0))
    bar.ax.set_yticklabels(["0.001", "0.01", "0.1", "1"], fontsize=figures.LABEL - 1)
    return figure


def _target_figure(deblurred: dict[str, Deblurred], target: Array) -> Figure:
    figure = figures.new_figure(10.5, 5.8)
    side = min(*target.shape, 160)
    top, left = ((n - side) // 2 for n in target.shape)
    kinds = (("recording", "as recorded"), ("linear", "Wiener"), ("sparse", "sparse gradients"))
    grid = figure.subplots(2, 4)
    for row, (name, found) in zip(grid, deblurred.items(), strict=True):
        columns = [(f"{name}, {words}", getattr(found, kind)) for kind, words in kinds]
        if name == "open":
            columns.append(("true", target))
        for axes, (words, picture) in zip(row, columns, strict=False):
            part = np.clip(picture[top : top + side, left : left + side], 0, 1).astype(np.float32)
            value = "" if words == "true" else f": {psnr(picture, target):.1f} dB"
            figures.put(axes, part ** np.float32(1 / 2.2), words + value, cmap="gray", vmin=0, vmax=1)
    grid[1, 3].set_axis_off()
    return figure


def _noise_figure(gains: list[float]) -> Figure:
    figure = figures.new_figure(6.5, 3.4)
    axes = figure.subplots()
    axes.semilogx(100 * np.array(NOISES), gains, "o-", color=figures.ACCENT, linewidth=1.4)
    axes.axhline(2, color=figures.QUIET, linewidth=0.9, linestyle=(0, (6, 4)))
    axes.axhline(0, color=figures.INK, linewidth=0.9)
    axes.set_xlabel("noise [% of white through the open aperture]", fontsize=figures.LABEL)
    axes.set_ylabel("gain of the mask [dB]", fontsize=figures.LABEL)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.tick_params(labelsize=figures.LABEL)
    axes.grid(True, linewidth=0.4)
    return figure


ENTRY = Entry(
    "coded-aperture-refocusing",
    "Coded-aperture refocusing",
    "A. Veeraraghavan, R. Raskar, A. Agrawal, A. Mohan and J. Tumblin, Dappled photography: mask enhanced cameras "
    "for heterodyned light fields and coded aperture refocusing, ACM Transactions on Graphics 26 (SIGGRAPH 2007), "
    "section 4",
    "A broadband mask in the aperture keeps the detail that defocus loses, so that a picture can be refocused at "
    "full resolution.",
    run,
)
