"""DiffuserCam in two dimensions: a smooth diffuser before a bare sensor (Antipa et al. 2018)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.measures import psnr
from vcc.base.units import mm, nm, um
from vcc.camera import Camera
from vcc.gallery import flat_target
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.gallery.total_variation import CroppedBlur
from vcc.image import Image
from vcc.optics import Lens, Mask, PhasePlate
from vcc.optics.electronics import Electronics
from vcc.optics.faces import Element
from vcc.optics.sensor import Sensor
from vcc.plot.tracing import trace
from vcc.recording import expose_image
from vcc.shapes.height_maps import Rough
from vcc.shapes.patterns import Open
from vcc.showcase import figures
from vcc.showcase.bench import Bench

Array = NDArray[np.float64]
Kind = Literal["dense", "sparse"]

PITCH = 26 * um
"""Of the pixels."""
TO_SENSOR = 9 * mm
OPENING = 40 * PITCH
DISTANCE = 0.3
"""Distance of the target, metres."""
CORRELATION = 160 * um
"""Correlation length of the diffuser."""
INDEX = 1.5
SLOPE_RMS = CORRELATION / (math.sqrt(6) * TO_SENSOR)
"""Slopes that focus on the sensor: their curvature is √6 times as much over a correlation length, rms."""
WAVELENGTH = 550 * nm
ELECTRONICS = Electronics(full_well=10_000, gain=0.4, bit_depth=12, read_noise=2.5)
SEED, TRAINING_SEED = 3, 5
PARTS = 9
"""Parts of a pixel, each way, of a point spread function; odd, so that one is in the middle."""
PINHOLES = (2, 3, 4)
"""Widths of the pinholes to choose from, pixels."""
WEIGHTS = (1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 3e-3, 1e-2, 3e-2)
"""Weights of total variation to choose from."""
LEAST_GAIN = 3.0
"""Least gain, dB: the same as for the other cameras of the gallery that recover by total variation."""
MARGIN = 48
"""Pixels of black around the target: at least half the opening and the strongest deflection."""


def diffuser() -> PhasePlate:
    """The diffuser: a smooth random surface as large as the opening."""
    height = SLOPE_RMS * CORRELATION / ((INDEX - 1) * math.sqrt(2))
    return PhasePlate(Rough(height, CORRELATION, OPENING, refractive_index=INDEX, seed=SEED), width=OPENING)


@dataclass(frozen=True)
class Device:
    """What stands before the bare sensor.

    Args:
        elements: at the entrance plane.
        width: of the opening, metres.
    """

    elements: tuple[Element, ...]
    width: float = OPENING

    @property
    def light(self) -> float:
        """Share of the light of the whole opening."""
        return (self.width / OPENING) ** 2

    def kernel(self, rays: int, distance: float = DISTANCE) -> Array:
        """The image of a point one pixel large (a tent), upright, of odd sides and sum 1: traced forwards.

        Args:
            rays: across the opening.
            distance: of the point, metres.
        """
        from scipy.ndimage import convolve1d

        places = ((np.arange(rays) + 0.5) / rays - 0.5) * self.width
        u, v = (axis.ravel() for axis in np.meshgrid(places, places))
        camera = Camera(self.elements, Sensor(TO_SENSOR, (1, 1), PITCH))
        landed = trace(camera, np.stack([u, v, u / distance, v / distance], axis=-1)).positions[:, -1]
        reach = math.ceil(float(np.abs(landed).max()) / PITCH) + 2
        side = 2 * reach + 1
        edges = (np.arange(side * PARTS + 1) / PARTS - side / 2) * PITCH
        counts = np.histogram2d(landed[:, 1], landed[:, 0], bins=(edges, edges))[0]
        tent = np.convolve(np.ones(PARTS), np.ones(PARTS)) / PARTS**2
        for axis in (0, 1):
            counts = convolve1d(counts, tent, axis=axis, mode="constant")
        pixels = counts.reshape(side, PARTS, side, PARTS).sum(axis=(1, 3))
        return np.asarray(pixels[::-1, ::-1] / pixels.sum())


def devices() -> dict[str, Device]:
    """The diffuser and the controls, by name."""
    to_focus = Lens(1 / (1 / DISTANCE + 1 / TO_SENSOR))
    opening = Mask(Open(), OPENING)
    pinholes = {f"pinhole {n}": Device((Mask(Open(), n * PITCH),), n * PITCH) for n in PINHOLES}
    return {
        "diffuser": Device((diffuser(),)),
        "open": Device((opening,)),
        **pinholes,
        "lens": Device((to_focus, opening)),
    }


@dataclass(frozen=True, eq=False)
class Laboratory:
    """Targets, recordings and the tuning of the decoder, for sizes that set the computing time.

    Args:
        side: pixels of the target and of the sensor along a side.
        samples: rays per pixel of a recording.
        rays: across the opening, for point spread functions.
        steps: iterations of the decoder.
    """

    side: int = 128
    samples: int = 2048
    rays: int = 600
    steps: int = 100

    @property
    def sensor(self) -> Sensor:
        """The bare sensor."""
        return Sensor(TO_SENSOR, (self.side, self.side), PITCH, electronics=ELECTRONICS)

    def captured(self, device: Device, target: Array) -> Image:
        """The irradiance of a target on black."""
        field = flat_target.flat(np.pad(target, MARGIN), OPENING, PITCH / TO_SENSOR, DISTANCE)
        camera = Camera(device.elements, self.sensor)
        return camera.capture(field, method="rays", interpolation="linear", samples=self.samples)

    @property
    @cached
    def exposure(self) -> float:
        """Seconds, for all devices: a white wall nearly fills the pixels behind the whole opening."""
        lens = devices()["lens"]
        wall = np.ones((self.side, self.side))
        return expose_image(self.captured(lens, wall), self.sensor, "auto").exposure

    def recorded(self, device: Device, image: Image) -> Array:
        """An upright recording with noise; radiance 1 through this opening, all of it on the sensor, is 1."""
        taken = expose_image(image, self.sensor, self.exposure).image().upright().to_numpy()
        return np.asarray(taken, dtype=np.float64) * TO_SENSOR**2 / OPENING**2 / device.light

    def modelled(self, device: Device, blur: CroppedBlur, target: Array) -> Array:
        """A recording by the model, with noise of the same size, to tune on."""
        random = np.random.default_rng(TRAINING_SEED)
        full = 0.9 * ELECTRONICS.full_well * device.light
        charge = random.poisson(np.maximum(blur(target), 0) * full)
        return np.asarray((charge + ELECTRONICS.read_noise * random.standard_normal(charge.shape)) / full)

    def model_error(self, image: Image, blur: CroppedBlur, target: Array) -> tuple[float, float]:
        """Root mean square difference of an image without noise from the model, and the image's sampling error."""
        scale = TO_SENSOR**2 / OPENING**2
        difference = image.upright().to_numpy() * scale - blur(target)
        return float(np.sqrt(np.mean(difference**2))), image.sampling_error * scale

    def tuned(self, device: Device, blur: CroppedBlur, kind: Kind) -> tuple[float, float]:
        """The weight that is best for the training target, and its PSNR."""
        target = drawn(kind, self.side, TRAINING_SEED)
        recording = self.modelled(device, CroppedBlur(blur.kernel, blur.shape), target)
        scores = [(psnr(blur.recovered(recording, w, self.steps), target, 1.0), w) for w in WEIGHTS]
        best = max(scores)
        return best[1], best[0]


def drawn(kind: Kind, side: int, seed: int) -> Array:
    """A drawn target, 0 to 1: overlapping discs that fill it, or some small discs on black."""
    random = np.random.default_rng(seed)
    y, x = np.mgrid[:side, :side]
    made = np.full((side, side), 0.5 if kind == "dense" else 0.0)
    for _ in range(300 if kind == "dense" else 24):
        row, column = random.uniform(0, side, 2)
        radius = 0.02 * side / random.uniform(0.08, 1) if kind == "dense" else random.uniform(1.5, 3)
        made[np.hypot(y - row, x - column) < radius] = (
            random.random() if kind == "dense" else random.uniform(0.5, 1)
        )
    return made


@dataclass(frozen=True, eq=False)
class Recovered:
    """A recording by one device and what the decoder made of it.

    Args:
        recording: upright.
        target: recovered.
        decibels: PSNR of it, white 1.
        weight: of total variation.
    """

    recording: Array
    target: Array
    decibels: float
    weight: float


@dataclass(frozen=True, eq=False)
class Measured:
    """What a run found.

    Args:
        targets: the truths.
        kernel: the diffuser's point spread function.
        found: by device and kind of target.
        error: of the model, and the sampling error of the image that it is compared with; white 1.
        widths: of the pinholes chosen, pixels.
    """

    targets: Mapping[Kind, Array]
    kernel: Array
    found: Mapping[tuple[str, Kind], Recovered]
    error: tuple[float, float]
    widths: Mapping[Kind, int]

    def gain(self, over: str, kind: Kind) -> float:
        """Decibels of the diffuser's image over that of another device."""
        return self.found["diffuser", kind].decibels - self.found[over, kind].decibels

    def against(self, other: str, kind: Kind) -> str:
        """Both PSNR as text."""
        mine, its = (self.found[name, kind].decibels for name in ("diffuser", other))
        return f"{mine:.1f} dB against {its:.1f} dB"


@dataclass(frozen=True, eq=False)
class Run(Laboratory):
    """Record a dense and a sparse target with the diffuser and with the controls, and recover both."""

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Make the dense target of the middle view of a light field, and measure."""
        shape, every = (self.side, self.side), devices()
        advance = Steps(progress, 2 * 4 + 1)
        progress(0, advance.total)
        targets: dict[Kind, Array] = {"dense": _view(bench, self.side), "sparse": drawn("sparse", self.side, SEED)}
        kernels = {name: device.kernel(self.rays) for name, device in every.items()}
        blurs = {name: CroppedBlur(kernel, shape) for name, kernel in kernels.items()}
        farther = CroppedBlur(every["diffuser"].kernel(self.rays, distance=math.inf), shape)
        found: dict[tuple[str, Kind], Recovered] = {}
        widths: dict[Kind, int] = {}
        error = math.nan, math.nan
        for kind, target in targets.items():
            tuned = {name: self.tuned(device, blurs[name], kind) for name, device in every.items()}
            pinhole = max((f"pinhole {n}" for n in PINHOLES), key=lambda name: tuned[name][1])
            widths[kind] = int(pinhole.split()[1])
            for words, name in (
                ("diffuser", "diffuser"),
                ("open", "open"),
                ("pinhole", pinhole),
                ("lens", "lens"),
            ):
                image = self.captured(every[name], target)
                recording = self.recorded(every[name], image)
                found[words, kind] = self._recovered(recording, blurs[name], tuned[name][0], target)
                if (name, kind) == ("diffuser", "dense"):
                    error = self.model_error(image, blurs[name], target)
                advance()
        diffused, target = found["diffuser", "dense"], targets["dense"]
        uncropped = CroppedBlur(kernels["diffuser"], shape, cropped=False)
        weight, _ = self.tuned(every["diffuser"], uncropped, "dense")
        found["no crop", "dense"] = self._recovered(diffused.recording, uncropped, weight, target)
        found["far", "dense"] = self._recovered(diffused.recording, farther, diffused.weight, target)
        advance()
        measured = Measured(targets, kernels["diffuser"], found, error, widths)
        return Result(prose(__name__, run=self), _pictures(measured), tuple(_findings(measured)), bench.assumed)

    def _recovered(self, recording: Array, blur: CroppedBlur, weight: float, target: Array) -> Recovered:
        made = blur.recovered(recording, weight, self.steps)
        return Recovered(recording, made, psnr(made, target, 1.0), weight)


def _view(bench: Bench, side: int) -> Array:
    """The middle view, grey, averaged to a square of pixels.

    Raises:
        InputError: views that are too small.
    """
    grey = flat_target.grey_view(bench, 4 * side)
    if min(grey.shape) < side:
        raise InputError(
            f"the views of this light field have {grey.shape[0]}×{grey.shape[1]} pixels: a target of "
            f"{side}×{side} is made of one"
        )
    every = min(grey.shape) // side
    top, left = ((length - every * side) // 2 for length in grey.shape)
    square = grey[top : top + every * side, left : left + every * side]
    return np.asarray(square.reshape(side, every, side, every).mean(axis=(1, 3)))


def _findings(measured: Measured) -> Iterator[Finding]:
    difference, sampling = measured.error
    photons = 1 / math.sqrt(ELECTRONICS.full_well)
    yield Finding(
        "recording by rays traced backwards, against the convolution with a PSF traced forwards: root mean square "
        "difference as a share of white",
        f"a convolution, cut off by the sensor: below the photon noise of white, {photons:.1%}",
        difference,
        "",
        difference < photons,
        f"the sampling error of the rays is estimated as {sampling:.2%}",
    )
    pinhole = f"the best pinhole, {measured.widths['sparse']} pixels wide"
    without = "the same opening without a diffuser"
    rivals: tuple[tuple[Kind, str, str, float, str], ...] = (
        ("dense", "open", without, LEAST_GAIN, "same pixels, light and decoder"),
        ("sparse", "open", without, LEAST_GAIN, "same pixels, light and decoder"),
        ("dense", "no crop", "a model without the crop", LEAST_GAIN, "it takes light beyond the sensor as dark"),
        ("dense", "far", "the PSF of a point at infinity", 0.0, "same weight; a PSF scales with distance"),
        ("sparse", "pinhole", pinhole, LEAST_GAIN, "same pixels and exposure time, less light"),
    )
    for kind, over, words, least, why in rivals:
        mine, its = (measured.found[name, kind].decibels for name in ("diffuser", over))
        yield Finding.gain(f"{kind} target: gain over {words}", mine, its, least, why)
    width = measured.widths["dense"]
    yield Finding(
        f"dense target: gain over the best pinhole, {width} pixels wide, in the same time",
        "",
        measured.gain("pinhole", "dense"),
        "dB",
        why=f"{measured.against('pinhole', 'dense')}: the diffuser collects {(OPENING / PITCH / width) ** 2:.0f} "
        "times the light, but each pixel has the photon noise of the whole target",
    )
    for kind in measured.targets:
        yield Finding(
            f"{kind} target: loss against a lens of the same opening",
            "",
            -measured.gain("lens", kind),
            "dB",
            why=f"{measured.against('lens', kind)}: the price of having no lens",
        )


def _pictures(measured: Measured) -> tuple[tuple[Picture, ...], ...]:
    found = measured.found
    shown: tuple[tuple[Kind, tuple[str, ...]], ...] = (
        ("dense", ("diffuser", "no crop", "open", "pinhole", "lens")),
        ("sparse", ("diffuser", "open", "pinhole", "lens")),
    )
    kernel = measured.kernel / measured.kernel.max()
    first = [
        ("PSF", figures.grey_shown(np.pad(kernel, max(0, (len(measured.targets["dense"]) - len(kernel)) // 2)))),
        ("recording, dense", _stretched(found["diffuser", "dense"].recording)),
        ("recording, sparse", _stretched(found["diffuser", "sparse"].recording)),
    ]
    return below(
        Picture(
            "recordings",
            "The image of a point, and two recordings",
            "The diffuser focuses light into caustics. The PSF has the scale of the recordings, which are "
            "stretched from their darkest to their brightest pixel.",
            figures.table((9.0, 3.2), [first]),
        ),
        *(
            Picture(
                kind,
                f"The {kind} target",
                "Recovered from recordings with noise, by one decoder. All devices have the same pixels and "
                "exposure time, all but the pinhole the same light.",
                _row(measured, kind, names),
            )
            for kind, names in shown
        ),
    )


def _row(measured: Measured, kind: Kind, names: Sequence[str]) -> figures.Figure:
    words = {
        "open": "no diffuser",
        "no crop": "diffuser, no crop",
        "pinhole": f"pinhole {measured.widths[kind]} pixels",
    }
    every: list[tuple[str, figures.Shown]] = [("truth", figures.grey_shown(measured.targets[kind]))]
    for name in names:
        one = measured.found[name, kind]
        every.append(
            (f"{words.get(name, name)}: {one.decibels:.1f} dB", figures.grey_shown(np.clip(one.target, 0, 1)))
        )
    rows = [every[start : start + 3] for start in range(0, len(every), 3)]
    return figures.table((9.0, 3.2 * len(rows)), rows)


def _stretched(recording: Array) -> figures.Shown:
    low, high = np.percentile(recording, (0.1, 99.9))
    return figures.grey_shown(np.clip((recording - low) / (high - low), 0, 1))


ENTRY = Entry(
    "diffusercam",
    "DiffuserCam: a diffuser before a bare sensor",
    "N. Antipa, G. Kuo, R. Heckel, B. Mildenhall, E. Bostan, R. Ng and L. Waller, DiffuserCam: lensless "
    "single-exposure 3D imaging, Optica 5, 2018; here its two-dimensional deblurring",
    "A smooth diffuser replaces the lens: its caustics shift with the direction of light, so that an image is "
    "recovered from one recording if the model has the crop by the sensor.",
    Run(),
)
