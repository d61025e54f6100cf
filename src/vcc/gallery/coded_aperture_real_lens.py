"""A coded aperture in the stop of a real lens: what is left of the code off the axis (Zhou and Nayar 2009)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import PointSpread, mtf, psf
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.measures import psnr
from vcc.base.units import um
from vcc.camera import Camera
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.gallery.flat_target import flat, grey_view
from vcc.gallery.published_codes import ZHOU_NAYAR
from vcc.gallery.real_lens import LENS, PUPIL, WAVELENGTH, WIDTH, discs
from vcc.optics import Lens, Mask, RealLens
from vcc.optics.sensor import Sensor
from vcc.prescriptions import load_lens
from vcc.recover import wiener
from vcc.shapes.patterns import Cells, Circle, Pattern
from vcc.showcase import figures
from vcc.showcase.bench import Bench

Array = NDArray[np.float64]

FOCUS, DISTANCE = 1.0, 1.5
"""Distance in focus, and distance of the target, metres."""
BLUR, SIDE, BORDER = 20, 33, 16
"""Pixels: of the code in the image of a point by first order, of this image, of borders that do not count."""
LEAST = 2 * BLUR + 2 * BORDER + 16
"""Fewest pixels of a target along a side."""
OPENINGS, TARGETS = ("code", "round"), ("axis", "corner")
BAND, FAINT, FINE, SEEDS, ALIKE = 0.25, 0.02, 780, 3, 35.0
FIELDS = {"axis": 0.0, "half-way": 0.5, "corner": 1.0}
CORNER = 0.34
"""Slope of the corner: that of the gallery's scene, 18.8 degrees from the axis."""
NOISE = 0.005
"""Standard deviation of the noise, of white through the whole opening."""
PINHOLE = 1 / 60
"""Diameter of the stop for the truth, of the code's width: its blur is a third of a pixel."""
VIEWS = 52


@dataclass(frozen=True)
class Apertures:
    """A code in the stop, and a round opening of equal area.

    Args:
        f_number: of the round stop that the code fits into: that of the lens or more.
    """

    f_number: float

    @property
    def width(self) -> float:
        """Of the code's square in the stop, metres: no open cell reaches beyond the round stop."""
        rows, columns = (np.abs(each - 6) + 0.5 for each in np.nonzero(ZHOU_NAYAR))
        lens = load_lens(LENS, f_number=self.f_number, wavelength=WAVELENGTH)
        assert lens.stop_diameter is not None
        return float(lens.stop_diameter / 2 * ZHOU_NAYAR.shape[1] / np.hypot(rows, columns).max())

    def pattern(self, name: str, scale: float = 1.0) -> Pattern:
        """The "code", the "round" opening of its area or a "pinhole", ``scale`` times as large."""
        width = scale * self.width
        if name == "code":
            return Cells(ZHOU_NAYAR, width)
        return Circle(width * (PINHOLE if name == "pinhole" else 2 * math.sqrt(ZHOU_NAYAR.mean() / math.pi)))

    def real(self, name: str) -> RealLens:
        """The lens with one of them in its stop."""
        lens: RealLens = load_lens(
            LENS, model="real", mask=self.pattern(name), z_of="entrance pupil", wavelength=WAVELENGTH
        )
        return lens

    @property
    def _pupil(self) -> tuple[float, float]:
        """Width of the entrance pupil over that of the stop; metres on the sensor for each unit of slope."""
        lens = load_lens(LENS, f_number=self.f_number, z_of="entrance pupil", wavelength=WAVELENGTH)
        camera = Camera.focused([lens], Sensor(0, (1, 1), 1 * um), FOCUS)
        assert lens.stop_diameter is not None
        return lens.focal_length / self.f_number / lens.stop_diameter, float(
            camera.rays_at(camera.sensor.z).linear[0, 2]
        )

    @property
    def pitch(self) -> float:
        """Of pixels, `BLUR` of which the code's image is wide, metres."""
        scale, distance = self._pupil
        return scale * self.width * distance * abs(1 / FOCUS - 1 / DISTANCE) / BLUR

    def camera(
        self, name: str, shape: tuple[int, int] = (1, 1), place: tuple[float, float] = (0.0, 0.0)
    ) -> Camera:
        """The real camera with a sensor around a place."""
        focused = Camera.focused([self.real("pinhole")], Sensor(0, shape, self.pitch), FOCUS)
        return Camera([self.real(name)], Sensor(focused.sensor.z, shape, self.pitch, decentre=place))

    def thin(self, name: str) -> Camera:
        """The thin lens with the same entrance pupil and scale of images."""
        scale, distance = self._pupil
        lens = Lens(1 / (1 / FOCUS + 1 / distance))
        return Camera([lens, Mask(self.pattern(name, scale))], Sensor(distance, (1, 1), self.pitch))

    def spread(self, name: str, field: float) -> PointSpread:
        """Of a point of the target on the diagonal, around its chief ray."""
        return _spread(self.camera(name), field, self.pitch)

    def captured(self, name: str, spread: PointSpread, target: Array, rays: int) -> Array:
        """The target around the point of a spread, over the light of an even white one, (rows, columns)."""
        middle = spread.frame([SIDE // 2, SIDE // 2])
        rows, columns = (side - 2 * BLUR for side in target.shape)
        camera = self.camera(name, (rows, columns), (float(middle[0]), float(middle[1])))
        slope, (right, down) = self.pitch / self._pupil[1], spread.field
        found = []
        for values, count in ((target, rays), (np.ones_like(target), max(rays // 16, 16))):
            light = flat(values, WIDTH / VIEWS, slope, DISTANCE, VIEWS)
            moved = light.transformed(Affine.translation(0, 0, -right, -down))
            image = camera.capture(moved, between_views="none", samples=count)
            found.append(image.to_numpy().astype(np.float64).reshape(rows, columns))
        return np.asarray(found[0] / found[1].mean())

    def open_share(self, field: float) -> float:
        """The part of the code inside all rims, as they seem to stand in the entrance pupil by first order."""
        lens, scale = self.real("code"), self._pupil[0]
        cells = (np.arange(FINE) + 0.5) / FINE - 0.5
        places = cells * scale * self.width
        centres, radii = discs(lens, field * CORNER, DISTANCE)
        along = (places[None, :] + places[:, None]) / math.sqrt(2)
        across = (places[None, :] - places[:, None]) / math.sqrt(2)
        inside = np.all(
            [(along - c) ** 2 + across**2 <= r**2 for c, r in zip(-centres, radii, strict=True)], axis=0
        )
        code = self.pattern("code", scale)(places[None, :], places[:, None])
        return float((code * inside).sum() / code.sum())


@dataclass(frozen=True, eq=False)
class Seen:
    """A target at one place of the field through one aperture.

    Args:
        spread: of its middle, in pixels around the chief ray.
        recording: over that of an even white target, without noise.
        truth: through a pinhole in the stop of the same lens.
    """

    spread: Array
    recording: Array
    truth: Array

    def restored(self, kernel: Array, seed: int) -> Array:
        """By a Wiener filter with some kernel, from a recording with noise."""
        noise = NOISE / float(ZHOU_NAYAR.mean())
        noisy = self.recording + noise * np.random.default_rng(seed).standard_normal(self.recording.shape)
        return wiener(noisy, kernel / kernel.sum(), noise).picture

    def quality(self, picture: Array) -> float:
        """PSNR of a picture against the truth away from borders, dB."""
        return psnr(_inner(picture), _inner(self.truth), peak=1.0)


@dataclass(frozen=True)
class Run:
    """A code and a round opening in the stop, wide open and stopped down, on the axis and in the corner.

    Args:
        most: largest side of the target, pixels.
        rays: of a pixel.
        f_numbers: of the round stops that the code fits into.
    """

    most: int = 136
    rays: int = 1024
    f_numbers: tuple[float, ...] = (2.0, 4.0)

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Capture targets, and deblur them with the kernels of both lenses."""
        target = grey_view(bench, self.most)
        if min(target.shape) < LEAST:
            raise InputError(
                f"the target has {target.shape[0]}×{target.shape[1]} pixels, and {LEAST}×{LEAST} are the fewest: "
                "give views of more pixels"
            )
        step = Steps(progress, 4 * len(self.f_numbers))
        numbers: list[Finding] = []
        shown: dict[float, dict[tuple[str, str], Seen]] = {}
        spreads: dict[float, dict[tuple[str, str], PointSpread]] = {}
        for f_number in self.f_numbers:
            lens = Apertures(f_number)
            spreads[f_number] = {
                (name, place): lens.spread(name, field)
                for name in ("code", "round", "pinhole")
                for place, field in FIELDS.items()
            }
            spreads[f_number] |= {(name, "thin"): _spread(lens.thin(name), 0.0, lens.pitch) for name in OPENINGS}
            shown[f_number] = {}
            for place in TARGETS:
                truth = lens.captured("pinhole", spreads[f_number]["pinhole", place], target, self.rays)
                for name in OPENINGS:
                    spread = spreads[f_number][name, place]
                    recording = lens.captured(name, spread, target, self.rays)
                    shown[f_number][name, place] = Seen(spread.values, recording, truth)
                    step()
            numbers += _findings(lens, spreads[f_number], shown[f_number])
        text = prose(__name__, light=float(ZHOU_NAYAR.mean()))
        pictures = below(
            Picture("psf", "Images of a point", _PSF, _psf_figure(spreads)),
            Picture("deblurred", "Deblurred targets", _DEBLURRED, _deblurred_figure(spreads, shown)),
        )
        return Result(text, pictures, tuple(numbers), bench.assumed)


def _inner(picture: Array) -> Array:
    return picture[BORDER:-BORDER, BORDER:-BORDER]


def _spread(camera: Camera, field: float, pitch: float) -> PointSpread:
    return psf(camera, DISTANCE, _slopes(field), pitch=pitch, shape=(SIDE, SIDE), cells=8 * SIDE)


def _slopes(field: float) -> tuple[float, float]:
    """Of a point on the diagonal of the field."""
    return field * CORNER / math.sqrt(2), field * CORNER / math.sqrt(2)


# -- findings


def _findings(
    lens: Apertures, spreads: dict[tuple[str, str], PointSpread], seen: dict[tuple[str, str], Seen]
) -> Iterator[Finding]:
    at = f"f/{lens.f_number:g}"
    like = {place: _likeness(spreads["code", place].values, spreads["code", "thin"].values) for place in FIELDS}
    yield Finding(
        f"{at}: correlation of the code’s image in the corner with that of the thin lens",
        "",
        like["corner"],
        "",
        None,
        f"on the axis {like['axis']:.2f}, half-way {like['half-way']:.2f}",
    )
    expected, share = lens.open_share(FIELDS["corner"]), _light(spreads, "corner")
    yield Finding(
        f"{at}: light through the code in the corner, over that through a pinhole, over the same on the axis",
        f"part of the code inside the discs of all rims by first order, {expected:.2f}, within {PUPIL:g}",
        share,
        "",
        abs(share - expected) <= PUPIL,
    )
    lost = {key: _lost(each) for key, each in spreads.items() if key[0] != "pinhole"}
    yield Finding(
        f"{at}: frequencies up to {BAND:g} cycles/pixel of which less than {FAINT:.0%} is left, code, corner",
        "",
        100 * lost["code", "corner"],
        "%",
        None,
        f"axis {lost['code', 'axis']:.0%}, thin lens {lost['code', 'thin']:.0%}; round opening: corner "
        f"{lost['round', 'corner']:.0%}, axis {lost['round', 'axis']:.0%}, thin lens {lost['round', 'thin']:.0%}",
    )
    agree = _agreement(seen["code", "axis"])
    yield Finding(
        f"{at}: captured target on the axis against the target convolved with the image of a point: PSNR",
        f"{ALIKE:g} dB or more",
        agree,
        "dB",
        agree >= ALIKE,
        "rays traced back from pixels against rays of a point; in the corner, where the image of a point changes "
        f"within the target, {_agreement(seen['code', 'corner']):.1f} dB",
    )
    for place in TARGETS:
        best = {name: _mean_quality(seen[name, place], seen[name, place].spread) for name in OPENINGS}
        yield Finding(
            f"{at}, {place}: deblurred with the kernel of the real lens, code",
            f"better than a round opening of its area, {best['round']:.1f} dB",
            best["code"],
            "dB",
            best["code"] > best["round"],
            f"recorded {seen['code', place].quality(seen['code', place].recording):.1f} dB; the rims let "
            f"{_light(spreads, place):.0%} of the code’s light pass",
        )
        others = {
            name: _mean_quality(seen["code", place], spreads["code", name].values) for name in ("thin", "axis")
        }
        round_thin = _mean_quality(seen["round", place], spreads["round", "thin"].values)
        yield Finding(
            f"{at}, {place}: the same with the kernel of the thin lens",
            "",
            others["thin"],
            "dB",
            None,
            f"ignoring the lens costs {best['code'] - others['thin']:.1f} dB; with a round opening "
            f"{best['round'] - round_thin:.1f} dB"
            + (f"; the axis’ kernel of the real lens has {others['axis']:.1f} dB" if place != "axis" else ""),
        )


def _likeness(one: Array, other: Array) -> float:
    return float((one * other).sum() / math.sqrt((one**2).sum() * (other**2).sum()))


def _light(spreads: dict[tuple[str, str], PointSpread], place: str) -> float:
    """Of the code's light on the axis, without what a pinhole loses likewise."""
    code, hole = (
        spreads[name, place].collecting_area / spreads[name, "axis"].collecting_area
        for name in ("code", "pinhole")
    )
    return code / hole


def _lost(spread: PointSpread) -> float:
    """The share of frequencies with next to no contrast."""
    found = mtf(spread, shape=(128, 128), pixel=False)
    pitch = abs(float(spread.frame.linear[0, 0]))
    frequency = np.hypot(found.frequencies("x")[None, :], found.frequencies("y")[:, None]) * pitch
    return float((found.values[frequency <= BAND] < FAINT).mean())


def _agreement(seen: Seen) -> float:
    """Of a recording with the truth convolved with the image of a point, dB."""
    from scipy.signal import fftconvolve

    expected = fftconvolve(seen.truth, seen.spread / seen.spread.sum(), mode="same")
    return psnr(_inner(expected), _inner(seen.recording), peak=1.0)


def _mean_quality(seen: Seen, kernel: Array) -> float:
    return float(np.mean([seen.quality(seen.restored(kernel, seed)) for seed in range(SEEDS)]))


# -- pictures

_PSF = (
    "Out of focus, as light lands. The thin lens has the same code everywhere. The real lens at f/2 bends the "
    "outer cells away, and its rims cut the code off the axis; stopped down to f/4, the code stays. "
    "Round openings have the area of the code."
)
_DEBLURRED = "As light lands, in linear light: the code’s recordings, deblurred with the kernels of both lenses."


def _psf_figure(spreads: dict[float, dict[tuple[str, str], PointSpread]]) -> figures.Figure:
    places = ("thin", *FIELDS)
    titles = ("thin lens", "real lens: axis", "half-way", "corner")
    rows = [
        [
            (title if not row else "", figures.grey_shown(_brightest(found[name, place].values)))
            for place, title in zip(places, titles, strict=True)
        ]
        for row, (found, name) in enumerate((found, name) for found in spreads.values() for name in OPENINGS)
    ]
    labels = [f"f/{f_number:g}, {name}" for f_number in spreads for name in OPENINGS]
    return figures.table((8.6, 4.3 * len(spreads)), rows, labels)


def _brightest(values: Array) -> Array:
    return values / np.quantile(values[values > 0], 0.98)


def _deblurred_figure(
    spreads: dict[float, dict[tuple[str, str], PointSpread]], shown: dict[float, dict[tuple[str, str], Seen]]
) -> figures.Figure:
    rows: list[list[tuple[str, figures.Shown]]] = []
    labels = []
    for f_number, found in shown.items():
        for place in TARGETS:
            seen = found["code", place]
            kernels = (seen.spread, spreads[f_number]["code", "thin"].values)
            pictures = [seen.recording, *(seen.restored(kernel, 0) for kernel in kernels), seen.truth]
            titles = ["recorded", "kernel of the real lens", "kernel of the thin lens", "truth"]
            rows.append(
                [
                    ("" if rows else title, figures.grey_shown(_inner(picture)))
                    for title, picture in zip(titles, pictures, strict=True)
                ]
            )
            labels.append(f"f/{f_number:g}, {place}")
    return figures.table((8.6, 4.4 * len(shown)), rows, labels)


ENTRY = Entry(
    "coded-aperture-real-lens",
    "Coded aperture in a real lens",
    "C. Zhou and S. Nayar, What are good apertures for defocus deblurring?, IEEE International Conference on "
    "Computational Photography 2009; lens: A. W. Tronnier, US patent 2,673,491 (1954)",
    "A code in the aperture deblurs better than a round opening of its area. The paper has one kernel for all of "
    "the image; a real lens has another one at each place.",
    Run(),
)
