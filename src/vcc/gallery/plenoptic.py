"""The hand-held plenoptic camera: refocused after the fact, its lens corrected by arithmetic (Ng et al. 2005)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import Refocuser
from vcc.base.errors import InputError, ResultWarning
from vcc.base.units import um
from vcc.camera import Camera
from vcc.showcase.words import away, length
from vcc.gallery import closeness, fringes
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, LensArray, PhasePlate
from vcc.optics.electronics import Electronics
from vcc.optics.sensor import Sensor
from vcc.recover import LensletGrid, decode_plenoptic, without_aberration
from vcc.run.recording import expose_image
from vcc.shapes.patterns import Circle
from vcc.shapes.surfaces import Surface, Zernike
from vcc.showcase import figures
from vcc.showcase.bench import Bench

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

PITCH = 125 * um
"""Of the lenslets, their f-number, and the pixels of 9 µm behind each: the prototype (Ng et al. 2005)."""
F_NUMBER = 4.0
EACH = 14
COARSEST, MOST = 2.0, 192
"""Where lenslets of that pitch hold fewer pixels of the light field, or are more across, they are made wider."""
RAYS = 16
"""For each pixel: 150 pixels make one of a refocused picture, so that few will do."""
DEPTHS = 7
"""Over which depth of field is measured."""
SPHERICAL, COMA = 1.8 * um, 1.2 * um
"""Root mean square optical path of the aberrations (Zernike terms 11 and 8)."""
MARGIN = 8
"""Lenslets at each border that are not compared: refocusing there asks for light from beyond it."""
NEEDED = 35.0
PLACES = ("near", "middle", "far")


@dataclass(frozen=True)
class Plenoptic:
    """The camera, and what belongs to it.

    Args:
        bench: its lens, and the distances of its scene.
        camera: main lens, lenslets, sensor.
        pitch: of the lenslets, metres.
        to_lenslets: d, from the main lens to the lenslets, metres.
        diameter: of the main lens, metres.
        lenslets: (rows, columns).
    """

    bench: Bench
    camera: Camera
    pitch: float
    to_lenslets: float
    diameter: float
    lenslets: tuple[int, int]

    @classmethod
    def built(cls, bench: Bench, pitch: float, gap: float, lenslets: tuple[int, int]) -> Plenoptic:
        """Lenslets where the lens images the middle distance, the sensor a gap behind, micro-images that touch."""
        d = bench.image_distance(bench.middle)
        # A micro-image of the lens is D·b/d wide, and they stand p·(1 + b/d) apart.
        growth = 1 + gap / d
        diameter = pitch * growth * d / gap
        # An even number of lenslets has its middle between two.
        down, across = (pitch / 2 if count % 2 == 0 else 0.0 for count in lenslets)
        array = LensArray(pitch, 1 / (1 / gap + 1 / d), offset=(across, down), z=d, name="lenslets")
        shape = lenslets[0] * EACH, lenslets[1] * EACH
        sensor = Sensor(d + gap, shape, pitch * growth / EACH, electronics=Electronics())
        camera = Camera([Lens(bench.focal_length, diameter), array], sensor)
        return cls(bench, camera, pitch, d, diameter, lenslets)

    @property
    def gap(self) -> float:
        """b, from the lenslets to the sensor, metres."""
        return self.camera.sensor.z - self.to_lenslets

    @property
    def window(self) -> float:
        """The width of the part of the main lens that one pixel sees, metres."""
        return self.camera.sensor.pitches[1] * self.to_lenslets / self.gap

    def recorded(self, light_field: LightField, aberrations: Surface | None = None) -> Image:
        """A recording with the sensor's noise, as irradiance, as light lands."""
        plates = [] if aberrations is None else [PhasePlate(aberrations, name="aberrations")]
        camera = Camera([*plates, *self.camera.elements], self.camera.sensor)
        return expose_image(_captured(camera, light_field, RAYS), camera.sensor, "auto").image()

    def white(self) -> Image:
        """A recording of radiance 1 everywhere."""
        return self.recorded(LightField.from_views(np.ones((2, 2, 8, 8), np.float32), 2 * self.diameter, 0.2))

    def decoded(self, raw: Image, white: Image) -> LightField:
        """The light field at the lens, a view for each pixel of a micro-image."""
        grid = LensletGrid.of_camera(self.camera)
        with warnings.catch_warnings():
            # The corners of micro-images lie outside of the round lens: their views are dark, and weigh nothing.
            warnings.filterwarnings("ignore", message=".*white image is dark.*", category=ResultWarning)
            return decode_plenoptic(raw, grid, camera=self.camera, white=white, views=EACH)

    def refocuser(self, decoded: LightField) -> Refocuser:
        """Sums of views, weighted by how much of their windows lies within the round lens."""
        places = (np.arange(EACH) - (EACH - 1) / 2) * self.window
        open_shares = Circle(self.diameter).mean(places[None, :], places[:, None], self.window, self.window)
        bright = np.asarray(decoded.values).reshape(EACH, EACH, -1).any(axis=2)
        return Refocuser(decoded, np.where(bright, open_shares, 0.0))

    def ideal(self, light_field: LightField, distance: float, samples: int = 256) -> Array:
        """The picture of the same lens focused on a distance, a pixel for what a lenslet shows; upright radiance.

        By rays, as the raw recording: both cameras then look at the same continuous light field.
        """
        to_sensor = self.bench.image_distance(distance)
        sensor = Sensor(to_sensor, self.lenslets, self.pitch * to_sensor / self.to_lenslets)
        image = _captured(Camera([self.camera.elements[0]], sensor), light_field, samples)
        solid_angle = math.pi / 4 * (self.diameter / to_sensor) ** 2
        return np.asarray(image.upright().to_numpy(), dtype=np.float64) / solid_angle


def _captured(camera: Camera, light_field: LightField, samples: int) -> Image:
    with warnings.catch_warnings():
        # A few rays look past the views at the picture's borders, which are not compared.
        warnings.simplefilter("ignore", ResultWarning)
        return camera.capture(light_field, method="rays", samples=samples)


def run(bench: Bench, progress: Progress) -> Result:
    """One exposure, refocused near, in the middle and far; depth of field; aberrations undone."""
    steps = 5
    plenoptic = designed(bench)
    raw, white = plenoptic.recorded(bench.light_field), plenoptic.white()
    progress(1, steps)
    decoded = plenoptic.decoded(raw, white)
    refocuser = plenoptic.refocuser(decoded)
    progress(2, steps)
    distances = [float(getattr(bench, name)) for name in PLACES]
    refocused = [_values(refocuser.at(distance)) for distance in distances]
    ideal = [plenoptic.ideal(bench.light_field, distance) for distance in distances]
    peak = 1.0 if bench.scene is not None else float(np.percentile(ideal[1], 99.5))
    decibels = [psnr(one, other, peak) for one, other in zip(refocused, ideal, strict=True)]
    progress(3, steps)
    sharpness = depth_of_field(plenoptic)
    progress(4, steps)
    surface = Zernike.from_terms({11: SPHERICAL, 8: COMA}, plenoptic.diameter)
    # What stands at the lens bends no light away from it: micro-images of white, and so the white image, stay.
    spoilt = plenoptic.decoded(plenoptic.recorded(bench.light_field, surface), white)
    put_right = without_aberration(spoilt, surface)
    lens = [_values(plenoptic.refocuser(each).at(bench.middle)) for each in (spoilt, put_right)]
    before, after = (psnr(picture, ideal[1], peak) for picture in lens)
    numbers = [
        Finding(
            f"refocused {away(distance)}, against the ideal camera focused there: PSNR",
            f"{NEEDED:g} dB or more",
            value,
            "dB",
            value >= NEEDED,
            "the ideal picture is a lens’s of the same opening, averaged over what a lenslet shows",
        )
        for distance, value in zip(distances, decibels, strict=True)
    ]
    numbers += sharpness.findings()
    numbers += [
        Finding("lens with aberrations, against the same without: PSNR", "", before, "dB"),
        Finding(
            "the same recording with rays resorted by the known deflection: PSNR",
            "better than without",
            after,
            "dB",
            after > before,
            "what is left is how the deflection differs within the "
            f"{length(plenoptic.window)} of the lens that a pixel sees, and stripes of two lenslets, which "
            "interpolation cannot move",
        ),
    ]
    size = max(min(plenoptic.lenslets) // 12, 12)
    near, chart, _ = figures.detailed_crops([figures.values_shown(picture, peak) for picture in refocused], size)
    wide = min(4 * size, min(plenoptic.lenslets))
    closer = figures.Crop(chart.row + size // 2 - wide // 2, chart.column + size // 2 - wide // 2, wide)
    lens_shown = {
        f"aberrated: {before:.1f} dB": lens[0],
        f"corrected: {after:.1f} dB": lens[1],
        "ideal camera": ideal[1],
    }
    whole = [(title, figures.values_shown(picture, peak)) for title, picture in lens_shown.items()]
    titles = [f"refocused {name}, {away(at)}" for name, at in zip(PLACES, distances, strict=True)]
    pairs = [
        [
            (f"{t}: {c:.1f} dB", figures.values_shown(p, peak))
            for t, p, c in zip(titles, refocused, decibels, strict=True)
        ],
        [
            (f"ideal camera, {away(at)}", figures.values_shown(p, peak))
            for at, p in zip(distances, ideal, strict=True)
        ],
    ]
    drawn = (
        Picture(
            "raw",
            "The raw recording, and a piece of it",
            "Turned upright as a whole. Each lenslet shows the round main lens; where things are out of focus, "
            "its parts differ.",
            _raw_figure(plenoptic, raw, near, peak),
        ),
        Picture(
            "views",
            "Decoded views",
            "The pixels at one place of all micro-images are the view from one place in the lens.",
            figures.views_figure(decoded[1:-1, 1:-1].replaced(_inner(decoded) / np.float32(peak))),
        ),
        Picture(
            "refocused",
            "Refocused from that one recording",
            "Below, ideal cameras of the same opening, focused there, at the resolution of the lenslets.",
            _table(pairs),
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
            _table([whole, [("", closer.of(picture)) for _, picture in whole]]),
        ),
    )
    return Result(_text(plenoptic), tuple((picture,) for picture in drawn), tuple(numbers), bench.assumed)


def designed(bench: Bench) -> Plenoptic:
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
    return Plenoptic.built(bench, pitch, gap, (rows, columns))


def depth_of_field(plenoptic: Plenoptic) -> fringes.Sharpness:
    """Fringes across, on planes ever nearer than the focus, recorded by both cameras."""
    blurs = np.linspace(0, 1.2 * fringes.HALF_OF_SQUARE * EACH * fringes.PERIOD, DEPTHS)
    per_blur = plenoptic.pitch / (plenoptic.diameter * plenoptic.to_lenslets)
    vergences = 1 / plenoptic.bench.middle + blurs * per_blur
    distances = tuple(1 / float(vergence) if vergence > 0 else math.inf for vergence in vergences)
    # The outermost views are moved by half the blur; whole periods are left, and the fade to the opposite border.
    columns = 2 * math.ceil(blurs[-1] / 2) + 8 * fringes.PERIOD + 1
    small = Plenoptic.built(plenoptic.bench, plenoptic.pitch, plenoptic.gap, (9, columns))
    white, slope = small.white(), small.pitch / small.to_lenslets
    refocused, conventional = [], []
    for distance in distances:
        plane = fringes.fringes(slope, small.diameter, distance, 2 * columns)
        image = small.refocuser(small.decoded(small.recorded(plane), white)).at(distance)
        refocused.append(fringes.contrast(_values(image)[4]))
        conventional.append(fringes.contrast(small.ideal(plane, small.bench.middle, 4096)[4]))
    number = small.to_lenslets / small.diameter
    return fringes.Sharpness(distances, blurs, np.array(refocused), np.array(conventional), EACH, number)


# --- aberrations ---


# --- what is shown ---


def psnr(picture: Array, truth: Array, peak: float) -> float:
    """In decibels, `MARGIN` lenslets at each border left out."""
    inner = np.s_[MARGIN:-MARGIN, MARGIN:-MARGIN]
    return closeness.psnr(picture[inner], truth[inner], peak)


def _values(image: Image) -> Array:
    return np.asarray(image.to_numpy(), dtype=np.float64)


def _inner(decoded: LightField) -> NDArray[np.float32]:
    return np.asarray(decoded.values[1:-1, 1:-1], dtype=np.float32)


def _table(rows: Sequence[Sequence[tuple[str, figures.Shown]]]) -> Figure:
    """Pictures in rows, each below its title."""
    ratios = [row[0][1].shape[0] / row[0][1].shape[1] for row in rows]
    figure = figures.new_figure(11.5, 0.7 + 3.8 * sum(ratios))
    grid = figure.subplots(len(rows), len(rows[0]), height_ratios=ratios)
    for axes, (title, picture) in zip(grid.ravel(), (each for row in rows for each in row), strict=True):
        figures.put(axes, picture, title)
    return figure


def _raw_figure(plenoptic: Plenoptic, raw: Image, near: figures.Crop, peak: float) -> Figure:
    """The whole, and enlarged a piece of what is sharp when focused near."""
    from matplotlib.patches import Rectangle

    upright = _values(raw.upright()) / (math.pi / 4 * (plenoptic.pitch / plenoptic.gap) ** 2)
    piece = figures.Crop(near.row * EACH, near.column * EACH, near.size * EACH)
    figure = figures.new_figure(11.5, 0.4 + 5.6 * upright.shape[0] / upright.shape[1])
    whole, part = figure.subplots(1, 2, width_ratios=(upright.shape[1] / upright.shape[0], 1))
    rows, columns = plenoptic.lenslets
    title = f"whole: {rows}×{columns} lenslets, {EACH}×{EACH} pixels behind each"
    all_shown = figures.values_shown(upright, peak)
    figures.put(whole, all_shown, title).set_interpolation("antialiased")
    whole.add_patch(
        Rectangle((piece.column, piece.row), piece.size, piece.size, fill=False, color=figures.ACCENT, linewidth=2)
    )
    figures.put(part, piece.of(all_shown), f"the marked piece: {near.size}×{near.size} lenslets")
    return figure


def _text(plenoptic: Plenoptic) -> str:
    length = story.length
    focal_length = 1 / (1 / plenoptic.gap + 1 / plenoptic.to_lenslets)
    published = (
        "Lenslets, pixels and f-number are the paper’s; its lens had 140 mm, and its pictures 292×292 pixels."
        if math.isclose(plenoptic.pitch, PITCH) and math.isclose(plenoptic.gap, F_NUMBER * PITCH)
        else "The paper’s lenslets, 125 µm wide and f/4, do not suit this light field."
    )
    return paragraphs(
        [
            f"A lens of f = {length(plenoptic.bench.focal_length)} and {length(plenoptic.diameter)} opening is "
            f"focused {away(plenoptic.bench.middle)}. Where a sensor would stand is a sheet of "
            f"{plenoptic.lenslets[0]}×{plenoptic.lenslets[1]} lenslets, {length(plenoptic.pitch)} wide, of "
            f"f = {length(focal_length)}; {length(plenoptic.gap)} behind it the sensor, {EACH}×{EACH} pixels of "
            f"{length(plenoptic.camera.sensor.pitches[1])} for each. Lens and lenslets have one f-number, so that "
            f"micro-images of the lens touch and do not overlap. {published}",
            "The sensor has the noise of photons, reading and 12 bits (full well 10 000 e⁻). Its recording is "
            "divided by one of something white; the pixels at one place of all micro-images, side by side, are a "
            "view. Refocused pictures are sums of views, each moved by its parallax at the new distance, taken as "
            "slices of the 4-D spectrum (Ng, Fourier slice photography, 2005): sharp, with faint ripples beside "
            "hard edges.",
            "They are compared with the same lens perfectly focused there, without noise, each pixel averaging "
            "over what one lenslet shows. Rays through both cameras look at the same continuous light field. "
            f"{MARGIN} lenslets at each border are left out.",
            "For depth of field, fringes stand on a plane that comes nearer. A pixel’s window on the lens, "
            f"1/{EACH} as wide, blurs {EACH} times less than the lens; refocusing undoes the rest.",
            f"The aberrations are {SPHERICAL / um:g} µm (spherical) and {COMA / um:g} µm (coma) of optical path, "
            "root mean square. They bend a ray by an amount that depends on its place in the lens alone, which "
            "each view knows: it is moved back before summation (R. Ng and P. Hanrahan, Digital correction of "
            "lens aberrations in light field photography, 2006).",
        ]
    )


ENTRY = Entry(
    "plenoptic",
    "Hand-held plenoptic camera",
    "R. Ng, M. Levoy, M. Brédif, G. Duval, M. Horowitz and P. Hanrahan, Light field photography with a hand-held "
    "plenoptic camera, Stanford CTSR 2005-02",
    "Lenslets before the sensor record from where in the lens light came: one exposure is refocused afterwards, "
    "as sharply as a lens stopped down by the number of pixels behind a lenslet, and aberrations are undone.",
    run,
)
