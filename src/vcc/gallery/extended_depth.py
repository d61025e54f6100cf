"""Measurements of cameras with depth-invariant blur: PSFs, a flat target and the scene.

Each camera is compared with the same lens without its element: similarity of the PSFs over a range of depths,
restoration by one filter for all depths, and the cost in focus.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.base import measures
from vcc.base.errors import InputError
from vcc.base.units import mm, nm
from vcc.camera import Camera
from vcc.gallery import flat_target
from vcc.gallery.entry import Picture
from vcc.light_field import LightField
from vcc.optics import Lens, Mask, PhasePlate
from vcc.optics.sensor import Sensor
from vcc.plot.tracing import trace
from vcc.recover import wiener
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import away

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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

    def target(self) -> Array:
        """A flat target: the middle of the middle view, grey, 0 to 1; see `vcc.gallery.flat_target.grey_view`."""
        return flat_target.grey_view(self.bench, self.sizes.target)

    def recorded(self, elements: Elements, depth: float, noise: float = NOISE) -> tuple[Array, float]:
        """The flat target at a depth, through a camera; upright, white 1, with noise; and the noise level.

        The target is mirrored beyond its border, so that the recording has no dark border.
        """
        flat = self.target()
        margin = min(64, *(side - 1 for side in flat.shape))
        wide = np.pad(flat, margin, mode="symmetric").astype(np.float32)
        # For a flat object, all views are the same picture if they converge on it.
        views = np.ascontiguousarray(np.broadcast_to(wide, (2, 2, *wide.shape)))
        field = LightField.from_views(views, PUPIL, self.slope, depth, disparity_range=(0.0, 0.0))
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

    def measured(self, elements: Elements, plain: Elements, advance: Callable[[], None]) -> Measured:
        """The PSFs of a camera, and the flat target restored by one Wiener filter for all depths.

        Args:
            elements: of the camera.
            plain: elements of the reference; its noiseless image in focus is the truth. If it is the camera
                itself, the recording is kept if it is better than the filtered one.
            advance: called after each depth.
        """
        sharp, _ = self.recorded(plain, self.focus, noise=0)
        return self.restored(elements, sharp, advance, or_as_recorded=elements is plain)

    def restored(
        self, elements: Elements, sharp: Array, advance: Callable[[], None], or_as_recorded: bool = False
    ) -> Measured:
        """The same with a given truth.

        Args:
            elements: of the camera.
            sharp: the truth.
            advance: called after each depth.
            or_as_recorded: whether the recording is kept if it is better than the filtered one.
        """
        spreads = self.spreads(elements)
        restored, decibels = [], []
        for depth in self.depths:
            taken, noise = self.recorded(elements, depth)
            candidates = [wiener(taken, spreads, noise).picture]
            if or_as_recorded:
                candidates.append(taken)
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


def spreads_figure(found: Mapping[str, Measured], depths: Sequence[float]) -> Figure:
    """PSFs side by side over depth, a row per camera.

    Args:
        found: by the label of the row.
        depths: metres.
    """
    side = min(max(each.spreads.shape[1] for each in found.values()), 61)
    figure = figures.new_figure(1.5 * len(depths), 1.6 * len(found) + 0.2)
    grid = figure.subplots(len(found), len(depths), squeeze=False)
    rows = [
        [
            (away(depth) if row == 0 else "", _middle(np.sqrt(spread / spread.max()), side))
            for spread, depth in zip(each.spreads, depths, strict=True)
        ]
        for row, each in enumerate(found.values())
    ]
    figures.fill(grid, rows, list(found), cmap="gray", vmin=0, vmax=1)
    return figure


def _middle(picture: Array, side: int) -> figures.Shown:
    """The middle square of a PSF, padded with zeros if it is too small; both sides are odd."""
    wide = np.pad(picture, max((side - len(picture)) // 2, 0)).astype(np.float32)
    cut = (len(wide) - side) // 2
    return wide[cut : cut + side, cut : cut + side]


def target_figure(found: Mapping[str, Measured], depths: Sequence[float]) -> Figure:
    """The flat target restored near, in focus and far, a row per camera."""
    figure = figures.new_figure(9.0, 3.2 * len(found))
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
    figures.fill(figure.subplots(len(found), 3, squeeze=False), rows, cmap="gray", vmin=0, vmax=1)
    return figure


@dataclass(frozen=True, eq=False)
class Seen:
    """A camera that records the scene.

    Args:
        name: of the pictures' files.
        words: title.
        comparison: its settings.
        elements: of the camera.
    """

    name: str
    words: str
    comparison: Comparison
    elements: Elements


def scene_pictures(plain: Seen, coded: Seen, spreads: Array, advance: Callable[[], None]) -> tuple[Picture, ...]:
    """The light field through both cameras, and the coded recording restored by the one filter.

    Args:
        plain: the camera without an element.
        coded: the one with it.
        spreads: PSFs of the coded camera.
        advance: called after each picture.
    """
    bench = plain.comparison.bench
    field = bench.light_field
    rows, columns = (int(0.94 * n) for n in field.shape[2:4])
    without, _ = plain.comparison.photographed(plain.elements, field, (rows, columns))
    advance()
    recorded, noise = coded.comparison.photographed(coded.elements, field, (rows, columns))
    advance()
    white = float(np.percentile(without, 99.5)) if bench.scene is None else 1.0
    whole = {
        plain.name: (plain.words, without),
        coded.name: (f"{coded.words}, as recorded", recorded),
        "restored": ("Restored by the one filter", wiener(recorded, spreads, noise).picture),
    }
    return tuple(
        Picture(f"scene-{name}", title, "", figures.values_shown(picture, white))
        for name, (title, picture) in whole.items()
    )
