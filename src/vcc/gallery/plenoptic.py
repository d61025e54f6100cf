"""The hand-held plenoptic camera: refocused after capture, its lens corrected by computation (Ng et al. 2005)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import Refocuser
from vcc.base import measures
from vcc.base.errors import InputError, ResultWarning, without_result_warnings
from vcc.base.units import um
from vcc.camera import Camera
from vcc.gallery import fringes
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, LensArray, PhasePlate
from vcc.optics.electronics import Electronics
from vcc.optics.sensor import Sensor
from vcc.recording import expose_image
from vcc.recover import LensletGrid, decode_plenoptic, without_aberration
from vcc.shapes.patterns import Circle
from vcc.shapes.surfaces import Surface, Zernike
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import away, length

Array = NDArray[np.float64]

PITCH = 125 * um
"""Pitch of the lenslets, their f-number, and the pixels of 9 µm behind each: the prototype (Ng et al. 2005)."""
F_NUMBER = 4.0
EACH = 14
"""Pixels across a lenslet."""
COARSEST, MOST = 2.0, 192
"""Least light-field pixels per lenslet, and most lenslets across; lenslets are made wider if needed."""
RAYS = 16
"""Rays per pixel: few are enough, because each pixel of a refocused image sums 150 pixels."""
SPHERICAL, COMA = 1.8 * um, 1.2 * um
"""Root mean square optical path of the aberrations (Zernike terms 11 and 8)."""
MARGIN = 8
"""Lenslets at each border that comparisons exclude: refocusing there requires light from beyond it."""
NEEDED = 35.0
"""Required decibels of refocused images."""


@dataclass(frozen=True)
class Plenoptic:
    """The camera with its parameters.

    Args:
        bench: its lens, and the distances of its scene.
        camera: main lens, lenslets, sensor.
        pitch: of the lenslets, metres.
        to_lenslets: d, from the main lens to the lenslets, metres.
        diameter: of the main lens, metres.
        lenslets: (rows, columns).
        each: pixels across a lenslet.
    """

    bench: Bench
    camera: Camera
    pitch: float
    to_lenslets: float
    diameter: float
    lenslets: tuple[int, int]
    each: int

    @classmethod
    def built(cls, bench: Bench, pitch: float, gap: float, lenslets: tuple[int, int], each: int) -> Plenoptic:
        """Lenslets in the image of the middle distance, the sensor a gap behind, micro-images that touch."""
        d = bench.image_distance(bench.middle)
        # A micro-image of the lens is D·b/d wide; the spacing is p·(1 + b/d).
        growth = 1 + gap / d
        diameter = pitch * growth * d / gap
        # An even number of lenslets has its middle between two.
        down, across = (pitch / 2 if count % 2 == 0 else 0.0 for count in lenslets)
        array = LensArray(pitch, 1 / (1 / gap + 1 / d), offset=(across, down), z=d, name="lenslets")
        shape = lenslets[0] * each, lenslets[1] * each
        sensor = Sensor(d + gap, shape, pitch * growth / each, electronics=Electronics())
        camera = Camera([Lens(bench.focal_length, diameter), array], sensor)
        return cls(bench, camera, pitch, d, diameter, lenslets, each)

    @property
    def gap(self) -> float:
        """b, from the lenslets to the sensor, metres."""
        return self.camera.sensor.z - self.to_lenslets

    @property
    def window(self) -> float:
        """The width of the part of the main lens that one pixel sees, metres."""
        return self.camera.sensor.pitches[1] * self.to_lenslets / self.gap

    def recorded(self, light_field: LightField, aberrations: Surface | None = None) -> Image:
        """A recording with the sensor's noise, as irradiance, in the orientation of the sensor."""
        plates = [] if aberrations is None else [PhasePlate(aberrations, name="aberrations")]
        camera = Camera([*plates, *self.camera.elements], self.camera.sensor)
        return expose_image(_captured(camera, light_field, RAYS), camera.sensor, "auto").image()

    def white(self) -> Image:
        """A recording of radiance 1 everywhere."""
        return self.recorded(LightField.from_views(np.ones((2, 2, 8, 8), np.float32), 2 * self.diameter, 0.2))

    def decoded(self, raw: Image, white: Image) -> LightField:
        """The light field at the lens, one view per pixel of a micro-image."""
        grid = LensletGrid.of_camera(self.camera)
        with warnings.catch_warnings():
            # The corners of micro-images lie outside the round lens: their views are dark, and have no weight.
            warnings.filterwarnings("ignore", message=".*white image is dark.*", category=ResultWarning)
            return decode_plenoptic(raw, grid, camera=self.camera, white=white, views=self.each)

    def refocuser(self, decoded: LightField) -> Refocuser:
        """Sums of views, weighted by the share of their windows within the round lens."""
        each = self.each
        places = (np.arange(each) - (each - 1) / 2) * self.window
        open_shares = Circle(self.diameter).mean(places[None, :], places[:, None], self.window, self.window)
        bright = np.asarray(decoded.values).reshape(each, each, -1).any(axis=2)
        return Refocuser(decoded, np.where(bright, open_shares, 0.0))

    def ideal(self, light_field: LightField, distance: float, samples: int = 256) -> Array:
        """The image of the same lens focused at a distance, one pixel per lenslet; upright radiance.

        It is made by rays, like the raw recording: both cameras then sample the same continuous light field.
        """
        to_sensor = self.bench.image_distance(distance)
        sensor = Sensor(to_sensor, self.lenslets, self.pitch * to_sensor / self.to_lenslets)
        image = _captured(Camera([self.camera.elements[0]], sensor), light_field, samples)
        solid_angle = math.pi / 4 * (self.diameter / to_sensor) ** 2
        return np.asarray(image.upright().to_numpy(), dtype=np.float64) / solid_angle


def _captured(camera: Camera, light_field: LightField, samples: int) -> Image:
    with without_result_warnings():
        # A few rays miss the views at the image's borders, which comparisons exclude.
        return camera.capture(light_field, method="rays", samples=samples)


@dataclass(frozen=True)
class Run:
    """One exposure, refocused near, in the middle and far; depth of field; aberrations corrected.

    Args:
        each: pixels across a lenslet.
        depths: number of depths for the depth of field.
    """

    each: int = EACH
    depths: int = 7

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Record a light field once, and measure."""
        steps = Steps(progress, 5)
        plenoptic = designed(bench, self.each)
        raw, white = plenoptic.recorded(bench.light_field), plenoptic.white()
        steps()
        decoded = plenoptic.decoded(raw, white)
        steps()
        refocused = Refocused.of(plenoptic, decoded)
        steps()
        sharpness = depth_of_field(plenoptic, self.depths)
        steps()
        aberrated = Aberrated.of(plenoptic, white, refocused)
        numbers = (*refocused.findings(), *sharpness.findings(), *aberrated.findings(plenoptic))
        pictures = _pictures(plenoptic, raw, decoded, refocused, sharpness, aberrated)
        return Result(_text(plenoptic), pictures, numbers, bench.assumed)


@dataclass(frozen=True, eq=False)
class Refocused:
    """Images refocused from one recording, with those of ideal cameras focused there.

    Args:
        distances: by name, metres.
        pictures: radiance, upright, in the same order.
        ideal: likewise.
        peak: the radiance that counts as white.
    """

    distances: dict[str, float]
    pictures: tuple[Array, ...]
    ideal: tuple[Array, ...]
    peak: float

    @classmethod
    def of(cls, plenoptic: Plenoptic, decoded: LightField) -> Refocused:
        """At the three distances of the bench."""
        bench, refocuser = plenoptic.bench, plenoptic.refocuser(decoded)
        pictures = tuple(_values(refocuser.at(distance)) for distance in bench.distances.values())
        ideal = tuple(plenoptic.ideal(bench.light_field, distance) for distance in bench.distances.values())
        peak = 1.0 if bench.scene is not None else float(np.percentile(ideal[1], 99.5))
        return cls(bench.distances, pictures, ideal, peak)

    @property
    def decibels(self) -> list[float]:
        """PSNR of the images against the ideal ones."""
        return [psnr(one, other, self.peak) for one, other in zip(self.pictures, self.ideal, strict=True)]

    def findings(self) -> Iterator[Finding]:
        """One for each distance."""
        for distance, value in zip(self.distances.values(), self.decibels, strict=True):
            yield Finding(
                f"refocused {away(distance)}, against the ideal camera focused there: PSNR",
                f"{NEEDED:g} dB or more",
                value,
                "dB",
                value >= NEEDED,
                "the ideal picture is a lens’s of the same opening, averaged over what a lenslet shows",
            )

    def rows(self) -> list[list[tuple[str, figures.Shown]]]:
        """Titles and pictures, the ideal ones below."""
        titles = [
            f"refocused {name}, {away(at)}: {reached:.1f} dB"
            for (name, at), reached in zip(self.distances.items(), self.decibels, strict=True)
        ]
        ideal = [f"ideal camera, {away(at)}" for at in self.distances.values()]
        return [
            [(title, self.shown(each)) for title, each in zip(titles, self.pictures, strict=True)],
            [(title, self.shown(each)) for title, each in zip(ideal, self.ideal, strict=True)],
        ]

    def shown(self, picture: Array) -> figures.Shown:
        """An image for display."""
        return figures.values_shown(picture, self.peak)


@dataclass(frozen=True, eq=False)
class Aberrated:
    """The lens with aberrations, refocused in the middle, against the ideal camera.

    Args:
        before: the refocused image of its recording, upright radiance.
        after: the same with rays corrected by the known deflection.
        ideal: the ideal camera's image.
        decibels: of the first two against it.
    """

    before: Array
    after: Array
    ideal: Array
    decibels: tuple[float, float]

    @classmethod
    def of(cls, plenoptic: Plenoptic, white: Image, without: Refocused) -> Aberrated:
        """A new recording, through a plate at the lens.

        A plate at the lens does not deflect light away from the lens: the micro-images of white, and so the
        white image, do not change.
        """
        bench = plenoptic.bench
        surface = Zernike.from_terms({11: SPHERICAL, 8: COMA}, plenoptic.diameter)
        spoilt = plenoptic.decoded(plenoptic.recorded(bench.light_field, surface), white)
        before, after = (
            _values(plenoptic.refocuser(each).at(bench.middle))
            for each in (spoilt, without_aberration(spoilt, surface))
        )
        ideal, peak = without.ideal[1], without.peak
        return cls(before, after, ideal, (psnr(before, ideal, peak), psnr(after, ideal, peak)))

    def findings(self, plenoptic: Plenoptic) -> Iterator[Finding]:
        """How far the aberrations are corrected."""
        before, after = self.decibels
        yield Finding("lens with aberrations, against the same without: PSNR", "", before, "dB")
        yield Finding(
            "the same recording with rays resorted by the known deflection: PSNR",
            "better than without",
            after,
            "dB",
            after > before,
            f"what is left is how the deflection differs within the {length(plenoptic.window)} of the lens that a "
            "pixel sees, and stripes of two lenslets, which interpolation cannot move",
        )


def designed(bench: Bench, each: int = EACH) -> Plenoptic:
    """The published lenslets behind the bench's lens, focused in the middle, stopped down to their f-number.

    Raises:
        InputError: too few pixels for 32 lenslets.
    """
    sensor = bench.sensor(bench.middle)
    pitch = max(PITCH, COARSEST * max(sensor.pitches), max(sensor.size) / MOST)
    rows, columns = (int(size / pitch + 1e-6) - 1 for size in sensor.size)
    if min(rows, columns) < 32:
        needed = math.ceil(33 * pitch / min(sensor.pitches))
        raise InputError(
            f"views of {sensor.shape[0]}×{sensor.shape[1]} pixels have detail for {rows}×{columns} lenslets, and "
            f"the plenoptic camera needs 32 each way: give views of {needed} pixels or more"
        )
    d = bench.image_distance(bench.middle)
    # No wider than the light field's lens, whatever the f-number.
    gap = max(F_NUMBER * pitch, pitch * d / (bench.diameter - pitch))
    return Plenoptic.built(bench, pitch, gap, (rows, columns), each)


def depth_of_field(plenoptic: Plenoptic, depths: int = 7) -> fringes.Sharpness:
    """Fringes along rows on ``depths`` planes, increasingly nearer than the focus, recorded by both cameras."""
    each = plenoptic.each
    blurs = np.linspace(0, 1.2 * fringes.HALF_OF_SQUARE * each * fringes.PERIOD, depths)
    per_blur = plenoptic.pitch / (plenoptic.diameter * plenoptic.to_lenslets)
    vergences = 1 / plenoptic.bench.middle + blurs * per_blur
    distances = tuple(1 / float(vergence) if vergence > 0 else math.inf for vergence in vergences)
    # The outermost views shift by half the blur; keep whole periods, and the fade to the opposite border.
    columns = 2 * math.ceil(blurs[-1] / 2) + 8 * fringes.PERIOD + 1
    small = Plenoptic.built(plenoptic.bench, plenoptic.pitch, plenoptic.gap, (9, columns), each)
    white, slope = small.white(), small.pitch / small.to_lenslets
    refocused, conventional = [], []
    for distance in distances:
        plane = fringes.fringes(slope, small.diameter, distance, 2 * columns)
        image = small.refocuser(small.decoded(small.recorded(plane), white)).at(distance)
        refocused.append(fringes.contrast(_values(image)[4]))
        conventional.append(fringes.contrast(small.ideal(plane, small.bench.middle, 4096)[4]))
    number = small.to_lenslets / small.diameter
    return fringes.Sharpness(distances, blurs, np.array(refocused), np.array(conventional), each, number)


# --- pictures ---


def psnr(picture: Array, truth: Array, peak: float) -> float:
    """Decibels, without `MARGIN` lenslets at each border."""
    inner = np.s_[MARGIN:-MARGIN, MARGIN:-MARGIN]
    return measures.psnr(picture[inner], truth[inner], peak)


def _pictures(
    plenoptic: Plenoptic,
    raw: Image,
    decoded: LightField,
    refocused: Refocused,
    sharpness: fringes.Sharpness,
    aberrated: Aberrated,
) -> tuple[tuple[Picture, ...], ...]:
    size = max(min(plenoptic.lenslets) // 12, 12)
    near, chart, _ = figures.detailed_crops([refocused.shown(each) for each in refocused.pictures], size)
    wide = min(4 * size, min(plenoptic.lenslets))
    closer = figures.Crop(chart.row + size // 2 - wide // 2, chart.column + size // 2 - wide // 2, wide)
    before, after = aberrated.decibels
    lens = [
        (f"aberrated: {before:.1f} dB", refocused.shown(aberrated.before)),
        (f"corrected: {after:.1f} dB", refocused.shown(aberrated.after)),
        ("ideal camera", refocused.shown(aberrated.ideal)),
    ]
    return below(
        Picture(
            "raw",
            "The raw recording, and a piece of it",
            "Turned upright as a whole. Each lenslet shows the round main lens; where things are out of focus, "
            "its parts differ.",
            _raw_figure(plenoptic, raw, near, refocused.peak),
        ),
        Picture(
            "views",
            "Decoded views",
            "The pixels at one place of all micro-images are the view from one place in the lens.",
            figures.views_figure(decoded[1:-1, 1:-1].replaced(_inner(decoded) / np.float32(refocused.peak))),
        ),
        Picture(
            "refocused",
            "Refocused from that one recording",
            "Below, ideal cameras of the same opening, focused there, at the resolution of the lenslets.",
            _table(refocused.rows()),
        ),
        Picture(
            "depth-of-field",
            "Sharpness over depth",
            f"Contrast of fringes of {fringes.PERIOD} lenslets, on a plane that comes nearer. Lines: closed form.",
            sharpness.figure(),
        ),
        Picture(
            "aberration",
            "An aberrated lens, corrected",
            "Spherical aberration and coma, focused in the middle; whole, and a piece.",
            _table([lens, [("", closer.of(picture)) for _, picture in lens]]),
        ),
    )


def _values(image: Image) -> Array:
    return np.asarray(image.to_numpy(), dtype=np.float64)


def _inner(decoded: LightField) -> NDArray[np.float32]:
    return np.asarray(decoded.values[1:-1, 1:-1], dtype=np.float32)


def _table(rows: Sequence[Sequence[tuple[str, figures.Shown]]]) -> figures.Figure:
    """Pictures in rows, each below its title."""
    ratios = [row[0][1].shape[0] / row[0][1].shape[1] for row in rows]
    figure = figures.new_figure(11.5, 0.7 + 3.8 * sum(ratios))
    figures.fill(figure.subplots(len(rows), len(rows[0]), height_ratios=ratios), rows)
    return figure


def _raw_figure(plenoptic: Plenoptic, raw: Image, near: figures.Crop, peak: float) -> figures.Figure:
    """The whole, and an enlarged part that is sharp when focused near."""
    upright = _values(raw.upright()) / (math.pi / 4 * (plenoptic.pitch / plenoptic.gap) ** 2)
    each = plenoptic.each
    piece = figures.Crop(near.row * each, near.column * each, near.size * each)
    rows, columns = plenoptic.lenslets
    title = f"whole: {rows}×{columns} lenslets, {each}×{each} pixels behind each"
    of_piece = f"the marked piece: {near.size}×{near.size} lenslets"
    return figures.enlarged(figures.values_shown(upright, peak), piece, (title, of_piece))


def _text(plenoptic: Plenoptic) -> str:
    published = math.isclose(plenoptic.pitch, PITCH) and math.isclose(plenoptic.gap, F_NUMBER * PITCH)
    return prose(__name__, camera=plenoptic, published=published)


ENTRY = Entry(
    "plenoptic",
    "Hand-held plenoptic camera",
    "R. Ng, M. Levoy, M. Brédif, G. Duval, M. Horowitz and P. Hanrahan, Light field photography with a hand-held "
    "plenoptic camera, Stanford CTSR 2005-02",
    "Lenslets before the sensor record from where in the lens light came: one exposure is refocused afterwards, "
    "as sharply as a lens stopped down by the number of pixels behind a lenslet, and aberrations are undone.",
    Run(),
)
