"""Measurements of cameras with depth-invariant blur: PSFs, a flat target and the scene.

Each camera is compared with the same lens without its element: similarity of the PSFs over a range of depths,
restoration by one filter for all depths, and the cost in focus.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base import measures
from vcc.base.errors import InputError
from vcc.base.units import mm, nm
from vcc.camera import Camera
from vcc.gallery import flat_target
from vcc.gallery.entry import Finding, Picture, Progress, Steps, below
from vcc.light_field import LightField
from vcc.optics import Lens, Mask, PhasePlate
from vcc.optics.sensor import Sensor
from vcc.plot.tracing import trace
from vcc.recover import wiener
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import away

Array = NDArray[np.float64]
Elements = Sequence[Lens | PhasePlate | Mask]

PUPIL = 10 * mm
"""Width of the opening."""
WAVELENGTH = 550 * nm
LEAST_MISFOCUS = 20 / 3
"""Least ψ, radians, at the ends of the range; below, there is no depth of field to extend."""
NOISE = 0.005
"""Standard deviation of the noise of all recordings, as a share of white."""
BORDER = 0.14
"""Share of the flat target at each side that decibels exclude, because filters lack data there."""
ALIKE = 0.95
"""Least correlation of PSFs that count as alike."""


@dataclass(frozen=True)
class Sizes:
    """Sizes that set the computing time of a comparison.

    Args:
        depths: their number.
        target: largest side of the flat target, pixels.
        rays: across the opening, for a point-spread function.
        samples: rays per pixel of a recording; with fewer, the sampling error, not the noise, would limit the
            restoration.
    """

    depths: int = 7
    target: int = 240
    rays: int = 800
    samples: int = 512


FULL = Sizes()
"""The sizes for the gallery's pages."""


@dataclass(frozen=True, eq=False)
class Measured:
    """The result for one camera.

    Args:
        spreads: its PSF at each depth, upright, of sum 1, (depths, rows, columns).
        restored: the flat target at each depth, (rows, columns).
        decibels: PSNR of the restored targets.
    """

    spreads: Array
    restored: tuple[Array, ...]
    decibels: tuple[float, ...]

    @property
    def alike(self) -> float:
        """The lowest correlation of a PSF with the one in focus."""
        middle = self.spreads[len(self.spreads) // 2].ravel()
        return min(float(np.corrcoef(each.ravel(), middle)[0, 1]) for each in self.spreads)


@dataclass(frozen=True)
class Comparison:
    """Cameras compared over a range of depths; all are focused in its middle, in 1/Z.

    Args:
        bench: has the light field, whose middle view is the flat target.
        round: whether the opening is a disc of diameter `PUPIL`; otherwise it is a square.
        sizes: sizes that set the computing time.
    """

    bench: Bench
    round: bool = False
    sizes: Sizes = FULL

    def __post_init__(self) -> None:
        if self.misfocus < LEAST_MISFOCUS:
            raise InputError(
                f"the scene's depths reach from {self.bench.near:.3g} to {self.bench.far:.3g} m, a misfocus of "
                f"{self.misfocus:.2g} rad only: nothing is out of focus. Give a light field with more parallax"
            )

    @property
    def focus(self) -> float:
        """The distance in focus, metres."""
        return 2 / (1 / self.bench.near + 1 / self.bench.far)

    @property
    def reach(self) -> float:
        """|1/Z − 1/focus| at the ends of the range, 1/m."""
        return (1 / self.bench.near - 1 / self.bench.far) / 2

    @property
    def misfocus(self) -> float:
        """ψ = π·R²/λ·|1/Z − 1/focus| at the ends, radians (Dowski and Cathey 1995)."""
        return math.pi * (PUPIL / 2) ** 2 / WAVELENGTH * self.reach

    @property
    def depths(self) -> tuple[float, ...]:
        """Metres, nearest first, in equal steps of 1/Z."""
        vergences = np.linspace(1 / self.bench.near, 1 / self.bench.far, self.sizes.depths)
        return tuple(1 / float(v) if v > 1e-9 else math.inf for v in vergences)

    @property
    def slope(self) -> float:
        """Angular size of a pixel, as a slope."""
        return abs(float(self.bench.light_field.frame.linear[2, 2]))

    def sensor(self, shape: tuple[int, int]) -> Sensor:
        """A sensor in focus, with pixels that match those of the views."""
        distance = self.bench.image_distance(self.focus)
        return Sensor(distance, shape, self.slope * distance)

    def spreads(self, elements: Elements) -> Array:
        """The PSFs of points on the axis at all depths, on the sensor's pixels: histograms of traced rays.

        Returns:
            (depths, rows, columns), upright, each of sum 1.
        """
        sensor = self.sensor((1, 1))
        places = ((np.arange(self.sizes.rays) + 0.5) / self.sizes.rays - 0.5) * PUPIL
        u, v = (axis.ravel() for axis in np.meshgrid(places, places))
        if self.round:
            inside = np.hypot(u, v) <= PUPIL / 2
            u, v = u[inside], v[inside]
        camera = Camera(elements, sensor)
        landed = [
            trace(camera, np.stack([u, v, u / depth, v / depth], axis=-1)).positions[:, -1]
            for depth in self.depths
        ]
        pitch = sensor.pitches[0]
        reach = math.ceil(max(float(np.abs(each).max()) for each in landed) / pitch) + 2
        edges = (np.arange(2 * reach + 2) - reach - 0.5) * pitch
        counts = np.stack([np.histogram2d(each[:, 1], each[:, 0], bins=(edges, edges))[0] for each in landed])
        return np.asarray(counts[:, ::-1, ::-1] / counts.sum(axis=(1, 2), keepdims=True))

    def recorded(self, elements: Elements, depth: float, noise: float = NOISE) -> tuple[Array, float]:
        """The flat target at a depth, through a camera; upright, white 1, with noise; and the noise level.

        The target is mirrored beyond its border, so that the recording has no dark border.
        """
        flat = flat_target.grey_view(self.bench, self.sizes.target)
        margin = min(64, *(side - 1 for side in flat.shape))
        wide = np.pad(flat, margin, mode="symmetric")
        field = flat_target.flat(wide, PUPIL, self.slope, depth)
        return self.photographed(elements, field, (flat.shape[0], flat.shape[1]), noise)

    def photographed(
        self, elements: Elements, field: LightField, shape: tuple[int, int], noise: float = NOISE
    ) -> tuple[Array, float]:
        """A light field through a camera, upright, with noise; and the noise level, including that of the rays.

        Radiance 1 through the whole opening is 1.
        """
        camera = Camera(elements, self.sensor(shape))
        image = camera.capture(field, method="rays", samples=self.sizes.samples)
        scale = camera.sensor.z**2 / (PUPIL**2 * (math.pi / 4 if self.round else 1))
        values = image.upright().to_numpy().astype(np.float64) * scale
        noisy = values + noise * np.random.default_rng(0).standard_normal(values.shape)
        return noisy, math.hypot(noise, image.sampling_error * scale)

    def restored(
        self, elements: Elements, sharp: Array, advance: Callable[[], None], unfiltered: bool
    ) -> Measured:
        """The PSFs of a camera, and the flat target restored by one Wiener filter for all depths.

        Args:
            elements: of the camera.
            sharp: the truth.
            advance: called after each depth.
            unfiltered: whether the recording itself counts where it is better than the filtered one.
        """
        spreads = self.spreads(elements)
        restored, decibels = [], []
        for depth in self.depths:
            taken, noise = self.recorded(elements, depth)
            candidates = [wiener(taken, spreads, noise).picture, *([taken] if unfiltered else [])]
            best = max(candidates, key=lambda each: psnr(each, sharp))
            restored.append(best)
            decibels.append(psnr(best, sharp))
            advance()
        return Measured(spreads, tuple(restored), tuple(decibels))


def psnr(picture: Array, truth: Array) -> float:
    """Decibels, white 1, without the borders."""
    return measures.psnr(inner(picture, BORDER), inner(truth, BORDER), peak=1.0)


def inner(picture: Array, border: float, whole: Callable[[float], int] = round) -> Array:
    """A picture without a share of it at each side, in whole pixels."""
    rows, columns = (whole(border * n) for n in picture.shape)
    return picture[rows : picture.shape[0] - rows, columns : picture.shape[1] - columns]


def spreads_figure(found: Mapping[str, Measured], depths: Sequence[float]) -> figures.Figure:
    """PSFs side by side over depth, a row per camera.

    Args:
        found: by the label of the row.
        depths: metres.
    """
    side = min(max(each.spreads.shape[1] for each in found.values()), 61)
    rows = [
        [
            (away(depth) if row == 0 else "", _middle(np.sqrt(spread / spread.max()), side))
            for spread, depth in zip(each.spreads, depths, strict=True)
        ]
        for row, each in enumerate(found.values())
    ]
    return figures.table((1.5 * len(depths), 1.6 * len(found) + 0.2), rows, list(found))


def _middle(picture: Array, side: int) -> figures.Shown:
    """The middle square of a PSF, padded with zeros if it is too small; both sides are odd."""
    wide = np.pad(picture, max((side - len(picture)) // 2, 0)).astype(np.float32)
    cut = (len(wide) - side) // 2
    return wide[cut : cut + side, cut : cut + side]


def target_figure(found: Mapping[str, Measured], depths: Sequence[float]) -> figures.Figure:
    """The flat target restored near, in focus and far, a row per camera."""
    rows = [
        [
            (
                f"{words}, {away(depths[place])}: {each.decibels[place]:.1f} dB",
                figures.grey_shown(inner(each.restored[place], 0.5 * BORDER, math.floor)),
            )
            for place in (0, len(depths) // 2, -1)
        ]
        for words, each in found.items()
    ]
    return figures.table((9.0, 3.2 * len(found)), rows)


@dataclass(frozen=True, eq=False)
class Seen:
    """A camera of a study.

    Args:
        words: its name in findings and pictures.
        comparison: its settings.
        elements: of the camera.
    """

    words: str
    comparison: Comparison
    elements: Elements


@dataclass(frozen=True, eq=False)
class Study:
    """Cameras side by side; the first one lacks the element that the others have.

    Args:
        depths: metres, nearest first.
        found: by the words of the cameras.
        scene: pictures of the scene through the first and the last camera.
    """

    depths: tuple[float, ...]
    found: dict[str, Measured]
    scene: tuple[Picture, ...]

    @classmethod
    def of(cls, cameras: Sequence[Seen], progress: Progress) -> Study:
        """Measure each camera, and record the scene.

        The first camera's image in focus without noise is the truth of the flat target. Its other recordings count
        without a filter where they are better so.
        """
        plain, coded = cameras[0], cameras[-1]
        depths = plain.comparison.depths
        advance = Steps(progress, len(cameras) * len(depths) + 2)
        progress(0, advance.total)
        sharp, _ = plain.comparison.recorded(plain.elements, plain.comparison.focus, noise=0)
        found = {
            each.words: each.comparison.restored(each.elements, sharp, advance, unfiltered=each is plain)
            for each in cameras
        }
        return cls(depths, found, _scene_pictures(plain, coded, found[coded.words].spreads, advance))

    @property
    def plain(self) -> Measured:
        """The camera without the element."""
        return next(iter(self.found.values()))

    def pictures(self) -> tuple[tuple[Picture, ...], ...]:
        """Rows of pictures: PSFs and restored targets."""
        return below(
            Picture(
                "psf",
                "Point-spread functions",
                "From near to far, rays traced; brightness is the square root of light, each PSF by its own peak.",
                spreads_figure(self.found, self.depths),
            ),
            Picture(
                "target",
                "A flat target near, in focus and far",
                "Restored by one filter for each camera; in focus, the camera of the first row needs none.",
                target_figure(self.found, self.depths),
            ),
        )

    def findings(self, least: float, why: str) -> Iterator[Finding]:
        """How alike the PSFs are, what restored targets gain at both ends of the range, and the cost in focus.

        Args:
            least: claimed gain, dB.
            why: explains how alike the PSFs of the cameras with the element are.
        """
        plain, (without, *others) = self.plain, self.found
        alike = "PSF alike over depth, {}: lowest correlation"
        yield Finding(alike.format(without), f"not alike: below {ALIKE}", plain.alike, "", plain.alike < ALIKE)
        for words in others:
            coded, middle = self.found[words], len(self.depths) // 2
            yield Finding(
                alike.format(words), f"alike: {ALIKE} or more", coded.alike, "", coded.alike >= ALIKE, why
            )
            for end in (0, -1):
                what = f"flat target {away(self.depths[end])}, {words}, one filter for all depths: gain"
                yield Finding.gain(what, coded.decibels[end], plain.decibels[end], least, "noise limits")
            cost = plain.decibels[middle] - coded.decibels[middle]
            yield Finding(f"cost in focus, {words}", "", cost, "dB", None, "the filter amplifies noise")


def _scene_pictures(plain: Seen, coded: Seen, spreads: Array, advance: Callable[[], None]) -> tuple[Picture, ...]:
    """The light field through both cameras, and the coded recording restored by the one filter."""
    bench = plain.comparison.bench
    field = bench.light_field
    rows, columns = (int(0.94 * n) for n in field.shape[2:4])
    without, _ = plain.comparison.photographed(plain.elements, field, (rows, columns))
    advance()
    recorded, noise = coded.comparison.photographed(coded.elements, field, (rows, columns))
    advance()
    white = float(np.percentile(without, 99.5)) if bench.scene is None else 1.0
    return tuple(
        Picture(f"scene-{name}", title.capitalize(), "", figures.values_shown(picture, white))
        for name, title, picture in (
            ("plain", plain.words, without),
            ("coded", f"{coded.words}, as recorded", recorded),
            ("restored", "restored by the one filter", wiener(recorded, spreads, noise).picture),
        )
    )
