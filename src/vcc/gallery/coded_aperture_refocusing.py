"""Coded-aperture refocusing: a broadband mask keeps detail that blur would lose (Veeraraghavan 2007)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import psf
from vcc.base.measures import psnr
from vcc.camera import Camera
from vcc.gallery import flat_target
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, below, prose
from vcc.gallery.flat_target import OPENING
from vcc.gallery.published_codes import VEERARAGHAVAN
from vcc.optics import Lens, Mask
from vcc.optics.sensor import Sensor
from vcc.recover import sparse_gradients, wiener
from vcc.shapes.patterns import Open
from vcc.showcase import figures
from vcc.showcase.bench import APERTURE, Bench
from vcc.showcase.scene import MIDDLE
from vcc.showcase.words import away

Array = NDArray[np.float64]

CELLS = 7
BLUR = 3 * CELLS
"""Pixels across the opening in the flat target's blur."""
NOISE = 0.002
"""Standard deviation of the additive noise of all recordings, as a share of white through the open aperture."""
NOISES = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02)
"""Noise levels for which gains are plotted."""
FULL_WELL, READ_NOISE = 10_000.0, 2.5
"""Electrons at white through the open aperture, and read noise: the defaults of `vcc.optics.electronics`."""
CHART_PART = (-60e-3, -100e-3, 160e-3, 100e-3)
"""An unoccluded part of the built-in scene's chart: left, top, right, bottom from its middle, m."""
LOST = 0.01
"""Contrast below which detail counts as lost, in a figure's title."""
MISFIT = 0.05
"""Error due to other distances in the scene, added to a filter's noise: a share of the recording's contrast."""
SMALLEST_BLUR = 4.0
"""Least blur of the scene, pixels, for it to be shown."""


@dataclass(frozen=True, eq=False)
class Deblurred:
    """A recording and its deblurred versions; 1 is white.

    Args:
        recording: divided by the transmission.
        linear: by the Wiener filter.
        sparse: by the solver with sparse gradients.
    """

    recording: Array
    linear: Array
    sparse: Array


Noise = Callable[[Array], tuple[Array, float]]
"""Adds noise to a recording; also returns its mean standard deviation, as a share of white."""


def additive(noise: float) -> Noise:
    """Gaussian noise, identical for all recordings with the same number of pixels."""
    return lambda recording: (recording + noise * np.random.default_rng(0).standard_normal(recording.shape), noise)


def of_photons(recording: Array) -> tuple[Array, float]:
    """Photon noise and read noise."""
    random = np.random.default_rng(0)
    charge = random.poisson(FULL_WELL * np.maximum(recording, 0)) + READ_NOISE * random.standard_normal(
        recording.shape
    )
    return charge / FULL_WELL, math.sqrt(max(float(charge.mean()), 0.0) + READ_NOISE**2) / FULL_WELL


@dataclass(frozen=True, eq=False)
class Recordings:
    """The flat target through the open and the coded aperture, without noise.

    Args:
        target: radiances, (rows, columns).
        masks: by name, "open" and "coded".
        clean: recordings; 1 is radiance 1 through the open aperture.
        kernels: images of a point.
    """

    target: Array
    masks: dict[str, Mask]
    clean: dict[str, Array]
    kernels: dict[str, Array]

    @classmethod
    def of(cls, target: Array) -> Recordings:
        """Recordings through both apertures."""
        masks = {"open": Mask(Open(), width=OPENING), "coded": Mask(VEERARAGHAVAN, width=OPENING)}
        clean = {name: flat_target.recorded(mask, target, BLUR) for name, mask in masks.items()}
        return cls(target, masks, clean, {name: flat_target.kernel(mask, BLUR) for name, mask in masks.items()})

    def exposed(self, name: str, noise: Noise) -> tuple[Array, Array, float]:
        """A noisy recording, its kernel and the noise level, all divided by the transmission."""
        passed = float(self.kernels[name].sum())
        noisy, level = noise(self.clean[name])
        return noisy / passed, self.kernels[name] / passed, level / passed

    def gain(self, noise: Noise) -> float:
        """Decibels of the coded aperture by the Wiener filter, minus the best of the open one, filtered or not."""
        return self._reached("coded", noise)[1] - max(self._reached("open", noise))

    def _reached(self, name: str, noise: Noise) -> tuple[float, float]:
        """Decibels as recorded, and after the filter."""
        white, spread, level = self.exposed(name, noise)
        filtered = wiener(white, spread, level, borders="periodic").picture
        return psnr(white, self.target, peak=1.0), psnr(filtered, self.target, peak=1.0)


@dataclass(frozen=True)
class Run:
    """The flat target through both apertures, the gain over noise, and the scene refocused.

    Args:
        target: largest side of the flat target, pixels.
        iterations: of the solver, at most.
        noises: noise levels for which gains are plotted.
    """

    target: int = 300
    iterations: int = 60
    noises: tuple[float, ...] = NOISES

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Record the middle view, and then the light field, through both apertures, and measure."""
        recordings = Recordings.of(flat_target.grey_view(bench, self.target))
        steps = 2 * self.iterations + 20
        deblurred = {
            name: self._deblurred(recordings, name, _after(progress, part * self.iterations, steps))
            for part, name in enumerate(recordings.masks)
        }
        progress(2 * self.iterations, steps)
        gains = {noise: recordings.gain(additive(noise)) for noise in self.noises}
        photons = recordings.gain(of_photons)
        progress(2 * self.iterations + 5, steps)
        refocusing = Refocusing.of(bench)
        scene = refocusing.done() if refocusing.shown else None
        progress(steps, steps)
        numbers = (*_findings(deblurred, recordings.target), *_scene_findings(scene), _photon_finding(photons))
        pictures = _pictures(recordings, deblurred, gains)
        shown = (*pictures[:2], *([] if scene is None else _scene_pictures(scene)), *pictures[2:])
        return Result(
            prose(__name__, bench=bench, refocusing=refocusing, flat_target=flat_target),
            shown,
            numbers,
            bench.assumed,
        )

    def _deblurred(self, recordings: Recordings, name: str, progress: Progress) -> Deblurred:
        white, spread, noise = recordings.exposed(name, additive(NOISE))
        linear = wiener(white, spread, noise, borders="periodic").picture
        sparse = sparse_gradients(
            white, spread, noise, borders="periodic", iterations=self.iterations, progress=progress
        ).picture
        return Deblurred(white, linear, sparse)


def _after(progress: Progress, before: int, steps: int) -> Progress:
    """A solver's progress as part of all steps."""
    return lambda done, total: progress(before + done, steps)


def _findings(deblurred: dict[str, Deblurred], target: Array) -> list[Finding]:
    opened, coded = deblurred["open"], deblurred["coded"]
    without = psnr(opened.recording, target, peak=1.0)
    numbers = []
    for what, name, rivals in (
        ("Wiener filter", "linear", ("linear",)),
        ("sparse gradients; the open aperture by whichever is best", "sparse", ("linear", "sparse")),
    ):
        ours = psnr(getattr(coded, name), target, peak=1.0)
        best = max(without, *(psnr(getattr(opened, rival), target, peak=1.0) for rival in rivals))
        what = f"flat target, blur of {BLUR} pixels, deblurred ({what}): gain of the mask over the open aperture"
        numbers.append(_gain_finding(what, ours, best, without))
    return numbers


def _gain_finding(what: str, ours: float, best: float, without: float) -> Finding:
    """The gain of the mask over the best result of the open aperture, which has ``without`` as recorded."""
    return Finding.gain(what, ours, best, 2, f"{without:.1f} dB as recorded", "at the same noise")


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


def _pictures(
    recordings: Recordings, deblurred: dict[str, Deblurred], gains: dict[float, float]
) -> tuple[tuple[Picture, ...], ...]:
    return below(
        Picture(
            "psf",
            "The blur of a point and its spectrum",
            "The open aperture’s MTF has lines of zeros, where detail is lost; the mask’s has few of them.",
            _spectra_figure(recordings.masks),
        ),
        Picture(
            "target",
            "A flat target out of focus, recorded and deblurred",
            "Decibels are those of the whole target. Exposure time and noise are the same for both.",
            _target_figure(deblurred, recordings.target),
        ),
        Picture(
            "noise",
            "Gain over noise",
            "By the Wiener filter, which knows the noise; the open aperture’s picture is the recording where "
            "that is better.",
            _noise_figure(gains),
        ),
    )


# --- the scene ---


@dataclass(frozen=True)
class Refocusing:
    """The light field, recorded with nearer focus, to be refocused at its middle distance.

    Args:
        bench: has the light field.
        blur: of objects at the middle distance, pixels.
        focus: distance on which the cameras are focused, metres.
    """

    bench: Bench
    blur: float
    focus: float

    @classmethod
    def of(cls, bench: Bench) -> Refocusing:
        """Focused near, or less near: views that differ by more than a pixel cannot represent such a blur."""
        slope = abs(float(bench.light_field.frame.linear[2, 2]))
        most = min(bench.light_field.shape[:2])
        blur = min(APERTURE * (1 / bench.near - 1 / bench.middle) / slope, most)
        return cls(bench, blur, 1 / (1 / bench.middle + blur * slope / APERTURE))

    @property
    def shown(self) -> bool:
        """Whether there is enough blur to remove."""
        return self.blur >= SMALLEST_BLUR

    def camera(self, mask: Mask, focus: float) -> Camera:
        """Pixels of all these cameras see the same angles, so that their images are aligned."""
        distance = self.bench.image_distance(focus)
        angles = [pitch / self.bench.image_distance(self.bench.middle) for pitch in self.bench.pitch]
        rows, columns = self.bench.light_field.shape[2:4]
        sensor = Sensor(distance, (rows, columns), (angles[0] * distance, angles[1] * distance))
        return Camera([Lens(self.bench.focal_length), mask], sensor)

    def done(self) -> Refocused:
        """Recorded through both apertures and refocused."""
        sharp_camera = self.camera(Mask(Open(), width=APERTURE), self.bench.middle)
        sharp = self._recorded(sharp_camera)
        white = float(np.percentile(sharp, 99.5)) if self.bench.scene is None else 1.0
        pictures = {"sharp": sharp}
        for name, mask in (("open", Mask(Open(), width=APERTURE)), ("coded", Mask(VEERARAGHAVAN, width=APERTURE))):
            pictures[f"{name}-recorded"], pictures[name] = self._restored(mask, white)
        return Refocused(self, pictures, white, chart(sharp_camera))

    def _recorded(self, camera: Camera) -> Array:
        """In the orientation of the sensor; 1 is radiance 1 through the whole square opening."""
        image = camera.capture(self.bench.light_field, interpolation="cubic")
        return image.to_numpy().astype(np.float64) * camera.sensor.z**2 / APERTURE**2

    def _restored(self, mask: Mask, white: float) -> tuple[Array, Array]:
        """A noisy recording divided by the transmission, and refocused."""
        camera = self.camera(mask, self.focus)
        point = psf(camera, self.bench.middle)
        passed = point.collecting_area / APERTURE**2
        noisy = additive(NOISE * white)(self._recorded(camera))[0] / passed
        noise = math.hypot(NOISE * white / passed, MISFIT * float(noisy.std()))
        return noisy, wiener(noisy, point.values / point.values.sum(), noise).picture


@dataclass(frozen=True, eq=False)
class Refocused:
    """The result of refocusing.

    Args:
        refocusing: the input.
        pictures: "sharp", "open-recorded", "open", "coded-recorded" and "coded", in the orientation of the
            sensor.
        white: radiance.
        chart: rows and columns of `CHART_PART`; meaningful in the built-in scene only.
    """

    refocusing: Refocusing
    pictures: dict[str, Array]
    white: float
    chart: tuple[slice, slice]

    @property
    def shown(self) -> dict[str, figures.Shown]:
        """Upright images for display."""
        return {name: figures.values_shown(each[::-1, ::-1], self.white) for name, each in self.pictures.items()}


def _scene_pictures(scene: Refocused) -> list[tuple[Picture, ...]]:
    there, focused = away(scene.refocusing.bench.middle), away(scene.refocusing.focus)
    titles = {
        "open-recorded": f"Open aperture, focused {focused}, as recorded",
        "coded-recorded": f"Coded aperture, focused {focused}, as recorded",
        "open": f"Refocused {there}: open aperture",
        "coded": f"Refocused {there}: coded aperture",
    }
    columns = {
        "sharp": "focused there",
        "open-recorded": "open, as recorded",
        "open": "open, refocused",
        "coded": "coded, refocused",
    }
    shown = scene.shown
    close = figures.close_ups(
        [(words, shown[name]) for name, words in columns.items()], [_middle(shown["sharp"])], ["middle"]
    )
    whole = [Picture(f"scene-{name}", title, "", shown[name]) for name, title in titles.items()]
    title = f"The middle of the scene, what is {there}"
    close_up = Picture("scene-close-up", title, "Pixels as they are, not smoothed.", close)
    return [(whole[0], whole[1]), (whole[2], whole[3]), (close_up,)]


def _scene_findings(scene: Refocused | None) -> list[Finding]:
    """The gain in a part of known distance, which only the built-in scene has."""
    if scene is None or scene.refocusing.bench.scene is None:
        return []
    sharp = scene.pictures["sharp"][scene.chart]
    found = {name: psnr(each[scene.chart], sharp, peak=1.0) for name, each in scene.pictures.items()}
    what = (
        f"the scene’s chart, blur of {scene.refocusing.blur:.1f} pixels, refocused by the Wiener filter: gain of "
        "the mask"
    )
    best = max(found["open"], found["open-recorded"])
    return [_gain_finding(what, found["coded"], best, found["open-recorded"])]


def chart(camera: Camera) -> tuple[slice, slice]:
    """Rows and columns, in the orientation of the sensor, of `CHART_PART`."""
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


def _spectra_figure(masks: dict[str, Mask]) -> figures.Figure:
    figure = figures.new_figure(11.0, 3.1)
    grid = figure.subplots(1, 4)
    for place, (name, mask) in enumerate(masks.items()):
        camera = flat_target.focal_camera(mask, (1, 1), BLUR)
        spread = psf(camera, flat_target.DISTANCE)
        side = (BLUR + 1) / 2
        axes = grid[2 * place]
        wide = np.pad(spread.values[::-1, ::-1], BLUR)  # zero padding, cut to one pixel
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


def _target_figure(deblurred: dict[str, Deblurred], target: Array) -> figures.Figure:
    side = min(*target.shape, 160)
    top, left = ((n - side) // 2 for n in target.shape)

    def part(picture: Array) -> figures.Shown:
        return figures.grey_shown(picture[top : top + side, left : left + side])

    kinds = (("recording", "as recorded"), ("linear", "Wiener"), ("sparse", "sparse gradients"))
    rows = []
    for name, found in deblurred.items():
        pictures = [(f"{name}, {words}", getattr(found, kind)) for kind, words in kinds]
        rows.append([(f"{words}: {psnr(each, target, peak=1.0):.1f} dB", part(each)) for words, each in pictures])
    rows[0].append(("true", part(target)))
    return figures.table((10.5, 5.8), rows)


def _noise_figure(gains: dict[float, float]) -> figures.Figure:
    figure = figures.new_figure(6.5, 3.4)
    axes = figure.subplots()
    percent, measured = 100 * np.array(list(gains)), list(gains.values())
    axes.semilogx(percent, measured, "o-", color=figures.ACCENT, linewidth=1.4, label="measured")
    axes.axhline(2, color=figures.QUIET, linewidth=0.9, linestyle=(0, (6, 4)), label="what counts as reached")
    axes.axhline(0, color=figures.INK, linewidth=0.9)
    figures.label(axes, "noise [% of white through the open aperture]", "gain of the mask [dB]")
    axes.xaxis.set_major_formatter("{x:g}")
    axes.grid(True, linewidth=0.4)
    axes.legend(fontsize=figures.LABEL, frameon=False)
    return figure


ENTRY = Entry(
    "coded-aperture-refocusing",
    "Coded-aperture refocusing",
    "A. Veeraraghavan, R. Raskar, A. Agrawal, A. Mohan and J. Tumblin, Dappled photography: mask enhanced cameras "
    "for heterodyned light fields and coded aperture refocusing, ACM Transactions on Graphics 26 (SIGGRAPH 2007), "
    "section 4",
    "A broadband mask in the aperture keeps the detail that defocus loses, so that a picture can be refocused at "
    "full resolution.",
    Run(),
)
