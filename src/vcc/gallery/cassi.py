"""CASSI: a coded aperture, a prism and one grey recording give the spectrum of each pixel.

Wagadarikar et al. 2008, with a single disperser. The spectral scene is made of the middle view of a light field.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import ResultWarning
from vcc.base.measures import psnr
from vcc.base.units import mm, nm, um
from vcc.camera import Camera
from vcc.gallery import flat_target
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, Mask, Prism
from vcc.optics.electronics import Electronics
from vcc.optics.glass import Glass, Sellmeier, Table
from vcc.optics.sensor import Sensor
from vcc.recording import expose_image
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import paragraphs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

BANDS = 26
WAVELENGTHS = tuple(float(each) * nm for each in np.linspace(450, 650, BANDS))
SHEAR = BANDS - 1
"""Pixels between the images of the first and the last band: one pixel a band on average, as in published models."""
PITCH = 10 * um
OBJECTIVE, RELAY = 50 * mm, 50 * mm
"""Focal lengths."""
PUPIL = 8 * mm
DISTANCE = 2.0
"""Distance of the scene, metres; the objective images it on the code."""
F2 = Sellmeier(
    (1.34533359, 0.209073176, 0.937357162),
    (0.00997743871 * um**2, 0.0470450767 * um**2, 111.886764 * um**2),
)
"""The flint glass F2: coefficients of the data sheet of Schott."""
MIDDLE = 550 * nm
"""Design wavelength of the prism."""
EVEN = Table((WAVELENGTHS[0], WAVELENGTHS[-1]), (1.65, 1.60))
"""A glass that does not exist: its index is linear in the wavelength, so that all shears are whole pixels."""
ELECTRONICS = Electronics(full_well=20_000, gain=3.0, bit_depth=16, read_noise=5.0)
SEED = 8
"""Of the code."""
MARGIN = 2
"""Pixels of the scene beyond the code."""
STEP = 1.8
"""Of iterations; below 2."""
WEIGHT = 0.03
"""Of total variation."""
ROUNDING = 1e-5
"""Single precision, 2⁻²⁴ = 6e-8 of white for each of 26 bands and of the code, three times over."""
LEAST_GAIN = 3.0
"""Least gain, dB."""


@dataclass(frozen=True)
class Imager:
    """The camera, for scenes of some rows and columns: a pixel of the scene, a cell of the code and a pixel of
    the sensor have the same size.

    Args:
        shape: (rows, columns) of the scene.
        glass: of the prism.
        interpolation: of the scene between its pixels; "nearest" sends the light of each to a single pixel.
        refine: parts of a pixel, each way, by which edges of the code are computed.
    """

    shape: tuple[int, int]
    glass: Glass = F2
    interpolation: Literal["linear", "nearest"] = "linear"
    refine: int = 8

    @property
    def to_code(self) -> float:
        """Distance from the objective to the code, metres: 1/d = 1/f − 1/Z."""
        return 1 / (1 / OBJECTIVE - 1 / DISTANCE)

    @property
    def to_sensor(self) -> float:
        """Distance from the relay lens, and from the prism in it, to the sensor, metres: the relay has 1:1."""
        return 2 * RELAY

    def strength(self, wavelength: float) -> float:
        """(n(λ) − 1)/(n(λ₀) − 1)."""
        return (self.glass.index(wavelength) - 1) / (self.glass.index(MIDDLE) - 1)

    @property
    def deflection(self) -> float:
        """δ at the design wavelength, a slope: the one that shears the outermost bands by `SHEAR` pixels."""
        spread = self.strength(WAVELENGTHS[0]) - self.strength(WAVELENGTHS[-1])
        return SHEAR * PITCH / (spread * self.to_sensor)

    @property
    def shears(self) -> Array:
        """The shear of each band against the first one, pixels: Δ strength · δ · distance (closed form)."""
        strengths = np.array([self.strength(each) for each in WAVELENGTHS])
        return (strengths[0] - strengths) * self.deflection * self.to_sensor / PITCH

    @cached_property
    def code(self) -> Array:
        """Cells of the code, open or opaque with equal odds, as the sensor shows them: (rows, columns)."""
        return np.random.default_rng(SEED).integers(0, 2, self.shape).astype(np.float64)

    def camera(self, *, coded: bool = True, dispersed: bool = True, mono: bool = True) -> Camera:
        """Objective, code, relay lens with a prism, sensor.

        Args:
            coded: with the code; without one the aperture between objective and relay is open.
            dispersed: with the prism.
            mono: with a grey sensor; otherwise the image has a channel for each band.
        """
        rows, columns = self.shape
        size = {"width": columns * PITCH, "height": rows * PITCH}
        at_relay = self.to_code + 2 * RELAY
        elements = [Lens(OBJECTIVE, diameter=PUPIL, name="objective"), Lens(RELAY, z=at_relay, name="relay")]
        if coded:
            elements.append(Mask(self.code[::-1, ::-1], **size, z=self.to_code, name="code"))
        moved = 0.0
        if dispersed:
            # Short waves are deflected most, to the left; the sensor stands where the bands arrive.
            slope = self.deflection
            elements.append(
                Prism((-slope, 0.0), z=at_relay, glass=self.glass, design_wavelength=MIDDLE, name="prism")
            )
            ends = self.strength(WAVELENGTHS[0]) + self.strength(WAVELENGTHS[-1])
            moved = -ends / 2 * slope * self.to_sensor
        sensor = Sensor(
            at_relay + self.to_sensor,
            (rows, columns + SHEAR * dispersed),
            PITCH,
            decentre=(moved, 0.0),
            electronics=ELECTRONICS if mono else None,
            response="mono" if mono else None,
        )
        return Camera(elements, sensor, name="CASSI")

    def field(self, cube: NDArray[np.floating]) -> LightField:
        """The light of a flat scene, (rows, columns, bands), at the objective, a little wider than the code."""
        around = (MARGIN, MARGIN) if self.interpolation == "linear" else (0, 0)
        wide = np.pad(cube, (around, around, (0, 0)), mode="edge")
        views = np.ascontiguousarray(wide[None, None], dtype=np.float32)
        slope = PITCH / self.to_code
        made = LightField.from_views(views, PUPIL, slope, DISTANCE, disparity_range=(0.0, 0.0))
        return made.with_wavelengths(WAVELENGTHS)

    def image(self, cube: NDArray[np.floating], **parts: bool) -> Image:
        """The irradiance of a scene; upright, since the relay inverts the image of the objective once more."""
        with warnings.catch_warnings():
            # Cells of the code end where samples end: `recorded_code` shows what is lost at their edges.
            warnings.simplefilter("ignore", ResultWarning)
            return self.camera(**parts).capture(
                self.field(cube), interpolation=self.interpolation, refine=self.refine
            )

    def values(self, cube: NDArray[np.floating], **parts: bool) -> Array:
        """The image, relative to that of white without code and prism."""
        return np.asarray(self.image(cube, **parts).to_numpy(), dtype=np.float64) / self.white

    @cached_property
    def white(self) -> float:
        """The irradiance of white, radiance 1 in all bands, without code and prism."""
        cube = np.ones((*self.shape, BANDS))
        return float(np.median(self.image(cube, coded=False, dispersed=False).to_numpy()))

    @cached_property
    def recorded_code(self) -> Array:
        """Transmission of the code as a white scene shows it without the prism, as laboratories calibrate it."""
        return self.values(np.ones((*self.shape, BANDS)), dispersed=False)

    @cached_property
    def measured_shears(self) -> Array:
        """The shear of each band against the first one, pixels: centres of the images of a line in each band."""
        line = np.zeros((*self.shape, BANDS))
        line[:, self.shape[1] // 2] = 1
        row = self.values(line, coded=False, mono=False)[self.shape[0] // 2]
        centres = np.arange(len(row)) @ row / row.sum(axis=0)
        return np.asarray(centres - centres[0])


@dataclass(frozen=True, eq=False)
class Model:
    """The imager as a matrix: each band passes the code, is moved along the rows, and all are summed.

    Args:
        code: transmission, (rows, columns).
        shears: of the bands, pixels to the right, 0 to `SHEAR`; a fraction is shared by two pixels.
    """

    code: Floats
    shears: Array

    @cached_property
    def _shares(self) -> list[tuple[int, int, np.float32]]:
        """(band, whole pixels, share) of the light."""
        whole = np.floor(self.shears + 1e-6).astype(int)
        part = np.maximum(self.shears - whole, 0)
        both = [
            (band, whole[band] + step, np.float32(share[band]))
            for step, share in ((0, 1 - part), (1, part))
            for band in range(len(self.shears))
        ]
        return [(band, move, share) for band, move, share in both if share > 1e-6]

    def __call__(self, cube: Floats) -> Floats:
        """The image of a cube, (bands, rows, columns): the sum over its bands."""
        rows, columns = self.code.shape
        made = np.zeros((rows, columns + SHEAR + 1), np.float32)
        coded = self.code * cube
        for band, move, share in self._shares:
            made[:, move : move + columns] += share * coded[band]
        return made[:, : columns + round(float(self.shears.max()))]

    def transpose(self, image: Floats) -> Floats:
        """The adjoint: an image to a cube."""
        rows, columns = self.code.shape
        wide = np.pad(image, ((0, 0), (0, columns + SHEAR + 1 - image.shape[1])))
        made = np.zeros((len(self.shears), rows, columns), np.float32)
        for band, move, share in self._shares:
            made[band] += share * wide[:, move : move + columns]
        return self.code * made

    def cube(self, image: Array, weight: float, steps: int) -> Array:
        """The cube of 0 or more that explains an image, and whose total variation is small.

        Minimises Σ (A x − y)²/(2 A Aᵀ1) + weight · Σ |∇x|, where |∇x| is over rows, columns and bands of a pixel:
        bands share their edges (Blomgren and Chan 1998). Solved by the primal-dual steps of Condat (2013) and Vũ
        (2013), all sums over bands rather than means.

        Args:
            image: (rows, columns of the sensor), the mean over the bands.
            weight: of total variation.
            steps: number of iterations.

        Returns:
            (rows, columns, bands).
        """
        wanted = (image * len(self.shears)).astype(np.float32)
        # A Aᵀ has no negative entry: divided by its row sums, its norm is 1 at most. Pixels without light count 0.
        shared = np.maximum(self(self.transpose(np.ones_like(wanted))), np.float32(0.1))
        step = np.float32(STEP)
        dual_step = np.float32((1 / STEP - 0.5) / 8)  # 8 bounds the squared norm of the gradient
        cube = self.transpose(wanted / shared)
        slopes = np.zeros((2, *cube.shape), np.float32)
        for _ in range(steps):
            new = cube - step * (self.transpose((self(cube) - wanted) / shared) + _gradient_adjoint(slopes))
            np.maximum(new, 0, out=new)
            slopes += dual_step * _gradient(2 * new - cube)
            slopes /= np.maximum(1, np.sqrt(np.einsum("abrc,abrc->rc", slopes, slopes)) / np.float32(weight))
            cube = new
        return np.asarray(np.moveaxis(cube, 0, -1), dtype=np.float64)


def _gradient(cube: Floats) -> Floats:
    """Differences along rows and along columns of (bands, rows, columns): (2, bands, rows, columns)."""
    made = np.zeros((2, *cube.shape), np.float32)
    made[0, :, :-1] = cube[:, 1:] - cube[:, :-1]
    made[1, :, :, :-1] = cube[:, :, 1:] - cube[:, :, :-1]
    return made


def _gradient_adjoint(slopes: Floats) -> Floats:
    made = np.zeros(slopes.shape[1:], np.float32)
    made[:, 1:] += slopes[0, :, :-1]
    made[:, :-1] -= slopes[0, :, :-1]
    made[:, :, 1:] += slopes[1, :, :, :-1]
    made[:, :, :-1] -= slopes[1, :, :, :-1]
    return made


# --- the scene ---


def spectral_scene(grey: Array) -> tuple[Array, dict[str, tuple[int, int]]]:
    """A textured wall with four patches before it, and pixels within some of them.

    Args:
        grey: the texture, 0 to 1, (rows, columns).

    Returns:
        The cube, (rows, columns, bands), 0 to 1; the pixels by name.
    """
    rows, columns = grey.shape
    y, x = np.mgrid[:rows, :columns]
    down, right = (y + 0.5) / rows, (x + 0.5) / columns
    wavelengths = np.array(WAVELENGTHS) / nm
    wall = 0.5 + 0.4 * (wavelengths - 450) / 200
    cube = (0.45 + 0.3 * grey[..., None]) * wall
    found = {"wall": (round(0.9 * rows), round(0.5 * columns))}
    for name, (row, column), spectrum in (
        ("lamp", (0.3, 0.28), np.exp(-((wavelengths - 538) ** 2) / (2 * 10**2))),
        ("leaf", (0.3, 0.72), 0.08 + 0.7 * np.exp(-((wavelengths - 555) ** 2) / (2 * 35**2))),
        ("paint", (0.68, 0.28), 0.06 + 0.9 / (1 + np.exp(-(wavelengths - 595) / 8))),
        ("glass", (0.68, 0.72), 0.05 + 0.85 * np.exp(-((wavelengths - 480) ** 2) / (2 * 18**2))),
    ):
        away = (
            np.hypot(down - row, right - column)
            if name in ("lamp", "leaf")
            else np.maximum(abs(down - row), abs(right - column))
        )
        inside = away < 0.15
        shade = 1.0 if name == "lamp" else 0.85 + 0.15 * grey[inside][:, None]
        cube[inside] = shade * spectrum
        found[name] = (int(row * rows), int(column * columns))
    return cube, found


@dataclass(frozen=True, eq=False)
class Recovered:
    """What a run found.

    Args:
        imager: with the prism of glass.
        truth: the cube as the imager shows it without code and prism, band by band: (rows, columns, bands).
        recording: with code, prism and noise, relative to white.
        cubes: recovered, by name.
        places: pixels by name.
        even_error: of the image with whole-pixel shears, against shift and sum.
        model_error: of the model against the image with the prism of glass, dB.
    """

    imager: Imager
    truth: Array
    recording: Array
    cubes: dict[str, Array]
    places: dict[str, tuple[int, int]]
    even_error: float
    model_error: float

    def decibels(self, name: str) -> float:
        """PSNR of a cube, white 1."""
        return psnr(self.cubes[name], self.truth, 1.0)

    def spectrum(self, cube: Array, place: str) -> Array:
        """The mean spectrum of 5×5 pixels."""
        row, column = self.places[place]
        return np.asarray(cube[row - 2 : row + 3, column - 2 : column + 3].mean(axis=(0, 1)))

    def spectral_error(self, place: str) -> float:
        """Root mean square over the bands, of the spectrum recovered with noise."""
        found, truth = (self.spectrum(cube, place) for cube in (self.cubes["noise"], self.truth))
        return float(np.sqrt(np.mean((found - truth) ** 2)))


@dataclass(frozen=True)
class Run:
    """Record a spectral scene once, and recover all bands; without the code, without the prism, by other shears.

    Args:
        size: pixels of the scene along its longer side.
        steps: number of iterations.
        refine: parts of a pixel by which edges of the code are computed.
    """

    size: int = 128
    steps: int = 300
    refine: int = 8

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Make a scene with the middle view of a light field as its texture, and measure."""
        advance = Steps(progress, 10)
        progress(0, advance.total)
        grey = flat_target.grey_view(bench, self.size)
        scene, places = spectral_scene(grey)
        shape = (grey.shape[0], grey.shape[1])
        even_error = whole_pixel_error(scene, shape)
        advance()
        imager = Imager(shape, refine=self.refine)
        code, shears = imager.recorded_code.astype(np.float32), imager.measured_shears
        truth = imager.values(scene, coded=False, dispersed=False, mono=False)
        clean = imager.image(scene)
        advance()
        noisy = self._with_noise(imager, clean)
        open_image = self._with_noise(imager, imager.image(scene, coded=False), coded=False)
        straight = self._with_noise(imager, imager.image(scene, dispersed=False), dispersed=False)
        advance()
        model = Model(code, shears)
        white = clean.to_numpy().astype(np.float64) / imager.white
        model_error = psnr(model(_bands_first(truth)) / BANDS, white, 1.0)
        cubes = {}
        for name, recorded, by in (
            ("clean", white, model),
            ("noise", noisy, model),
            ("no code", open_image, Model(np.ones_like(code), shears)),
            ("no prism", straight, Model(code, np.zeros(BANDS))),
            ("rounded", noisy, Model(code, np.round(shears))),
            ("straight line", noisy, Model(code, np.arange(BANDS, dtype=np.float64))),
        ):
            cubes[name] = by.cube(recorded, WEIGHT, self.steps)
            advance()
        found = Recovered(imager, truth, noisy, cubes, places, even_error, model_error)
        advance()
        return Result(_text(found, self.steps), _pictures(found), _findings(found), bench.assumed)

    @staticmethod
    def _with_noise(imager: Imager, image: Image, **parts: bool) -> Array:
        recording = expose_image(image, imager.camera(**parts).sensor, "auto")
        return np.asarray(recording.image().to_numpy(), dtype=np.float64) / imager.white


def whole_pixel_error(scene: Array, shape: tuple[int, int]) -> float:
    """Largest difference between our image by a glass of even dispersion and shift and sum, as a share of white.

    Args:
        scene: (rows, columns, bands).
        shape: of it, rows and columns.
    """
    even = Imager(shape, EVEN, "nearest", refine=1)
    image = even.values(scene)
    columns = shape[1]
    for band in range(BANDS):
        image[:, band : band + columns] -= even.recorded_code * scene[..., band] / BANDS
    return float(np.abs(image).max())


def _bands_first(cube: Array) -> Floats:
    return np.ascontiguousarray(np.moveaxis(cube, -1, 0), dtype=np.float32)


# --- the page ---


def _text(found: Recovered, steps: int) -> str:
    return paragraphs(
        "gallery/prose/cassi.txt",
        imager=found.imager,
        objective=OBJECTIVE,
        relay=RELAY,
        distance=DISTANCE,
        pitch=PITCH,
        bands=BANDS,
        shear=SHEAR,
        nm=nm,
        wavelengths=WAVELENGTHS,
        middle=MIDDLE,
        electronics=ELECTRONICS,
        open=float(found.imager.code.mean()),
        model=found.model_error,
        weight=WEIGHT,
        steps=steps,
    )


NAMES = {"lamp": "lamp: a line of 24 nm", "paint": "paint: an edge at 595 nm", "wall": "wall: a slope"}
COLOURS = ((610, 28), (545, 28), (465, 22))
"""Middle and width, nm, of the red, green and blue by which cubes are shown."""


def _in_colour(cube: Array) -> figures.Shown:
    wavelengths = np.array(WAVELENGTHS) / nm
    curves = np.array([np.exp(-(((wavelengths - middle) / width) ** 2) / 2) for middle, width in COLOURS])
    return figures.values_shown(cube @ (curves / curves.sum(axis=1, keepdims=True)).T)


def _pictures(found: Recovered) -> tuple[tuple[Picture, ...], ...]:
    cubes = found.cubes
    overview = figures.new_figure(9.0, 6.3)
    recording = figures.grey_shown(found.recording / found.recording.max())
    rows = [
        [
            ("truth", _in_colour(found.truth)),
            (f"code and prism: {found.decibels('noise'):.1f} dB", _in_colour(cubes["noise"])),
            ("the recording", recording),
        ],
        [
            (f"{words}: {found.decibels(name):.1f} dB", _in_colour(cubes[name]))
            for name, words in (
                ("no code", "prism, no code"),
                ("no prism", "code, no prism"),
                ("straight line", "straight-line shears"),
            )
        ],
    ]
    figures.fill(overview.subplots(2, 3, squeeze=False), rows, cmap="gray", vmin=0, vmax=1)
    return (
        (
            Picture(
                "scene",
                "One grey recording, and the cubes recovered",
                f"The {BANDS} bands are shown as red, green and blue. The recording is {SHEAR} pixels wider than "
                "the scene. Each control has the same noise of the sensor.",
                overview,
            ),
        ),
        (
            Picture(
                "bands",
                "Four of the bands",
                "Above the truth, below what is recovered from the recording with noise.",
                _bands_figure(found),
            ),
        ),
        (
            Picture(
                "spectra",
                "Spectra at three places",
                "Means of 5×5 pixels, recovered from the recording with noise. The dotted model moves each band by "
                "one pixel more than the last.",
                _spectra_figure(found),
            ),
        ),
        (
            Picture(
                "shears",
                "The shear of real glass is not linear in the wavelength",
                "From images of a bright line through the prism of F2.",
                _shears_figure(found),
            ),
        ),
    )


def _bands_figure(found: Recovered) -> Figure:
    figure = figures.new_figure(9.0, 4.9)
    chosen = [2, 11, 16, 22]
    rows = [
        [
            (f"{WAVELENGTHS[band] / nm:.0f} nm" if top else "", figures.grey_shown(cube[..., band]))
            for band in chosen
        ]
        for top, cube in ((True, found.truth), (False, found.cubes["noise"]))
    ]
    figures.fill(
        figure.subplots(2, len(chosen), squeeze=False), rows, ("truth", "recovered"), cmap="gray", vmin=0, vmax=1
    )
    return figure


def _spectra_figure(found: Recovered) -> Figure:
    figure = figures.new_figure(9.0, 3.3)
    wavelengths = np.array(WAVELENGTHS) / nm
    for axes, (place, title) in zip(figure.subplots(1, 3, sharey=True), NAMES.items(), strict=True):
        for cube, name, style in (
            (found.truth, "truth", {"color": figures.QUIET, "linewidth": 3.0, "alpha": 0.6}),
            (found.cubes["noise"], "recovered", {"color": "#1b6ca8", "marker": "o", "markersize": 3}),
            (found.cubes["straight line"], "by straight-line shears", {"color": figures.ACCENT, "linestyle": ":"}),
        ):
            axes.plot(wavelengths, found.spectrum(cube, place), label=name if place == "wall" else None, **style)
        axes.set_title(title, fontsize=figures.LABEL)
        axes.set_xlabel("wavelength [nm]", fontsize=figures.LABEL)
        axes.tick_params(labelsize=figures.LABEL - 1)
    figure.axes[0].set_ylabel("radiance", fontsize=figures.LABEL)
    figure.axes[0].set_ylim(0, 1.15)
    figure.legend(frameon=False, fontsize=figures.LABEL, loc="outside upper center", ncols=3)
    return figure


def _shears_figure(found: Recovered) -> Figure:
    figure = figures.new_figure(9.0, 3.3)
    axes = figure.subplots()
    wavelengths = np.array(WAVELENGTHS) / nm
    axes.plot(wavelengths, found.imager.shears, color="#1b6ca8", label="closed form")
    axes.plot(wavelengths, found.imager.measured_shears, "o", color=figures.INK, markersize=3.5, label="measured")
    axes.plot(wavelengths, np.arange(BANDS), ":", color=figures.ACCENT, label="straight line")
    axes.set_xlabel("wavelength [nm]", fontsize=figures.LABEL)
    axes.set_ylabel("shear [pixels]", fontsize=figures.LABEL)
    axes.tick_params(labelsize=figures.LABEL - 1)
    figure.legend(frameon=False, fontsize=figures.LABEL, loc="outside upper center", ncols=3)
    return figure


def _findings(found: Recovered) -> tuple[Finding, ...]:
    imager = found.imager
    shear_error = float(np.abs(imager.measured_shears - imager.shears).max())
    bent = float(np.abs(imager.measured_shears - np.arange(BANDS)).max())
    decibels = {name: found.decibels(name) for name in found.cubes}
    noisy = decibels["noise"]
    peaks = [
        float(WAVELENGTHS[int(np.argmax(found.spectrum(cube, "lamp")))] / nm)
        for cube in (found.cubes["noise"], found.truth)
    ]
    step = (WAVELENGTHS[1] - WAVELENGTHS[0]) / nm
    errors = [f"{place} {found.spectral_error(place):.3f}" for place in NAMES]
    return (
        Finding(
            "whole-pixel shears: image against shift and sum, largest error as a share of white",
            f"equal to rounding, below {ROUNDING:g}",
            found.even_error,
            "",
            found.even_error < ROUNDING,
            "a made-up glass whose index is linear in the wavelength; the code as recorded",
        ),
        Finding(
            "prism of F2: measured shears against Δn/(n(λ₀) − 1) · δ · distance, largest difference",
            "the closed form, within 0.001 pixels",
            shear_error,
            "pixels",
            shear_error < 1e-3,
        ),
        Finding(
            "largest distance of these shears from a straight line",
            "",
            bent,
            "pixels",
            why=f"both have {SHEAR} pixels between the outermost bands",
        ),
        Finding("cube from one recording without noise, PSNR", "", decibels["clean"], "dB"),
        Finding("cube from one recording with noise, PSNR", "", noisy, "dB", why=f"{BANDS} bands from one image"),
        *(
            Finding(
                f"the same: gain over a camera without {part}",
                f"both are needed: {LEAST_GAIN:g} dB or more",
                noisy - decibels[f"no {part}"],
                "dB",
                noisy - decibels[f"no {part}"] >= LEAST_GAIN,
                f"{noisy:.1f} dB against {decibels[f'no {part}']:.1f} dB: {why}",
            )
            for part, why in (
                ("code", "bands differ by a shift alone, which smooth places do not show"),
                ("prism", "all bands fall on the same pixels, and only their sum is known"),
            )
        ),
        Finding(
            "spectrum of the lamp: distance of its peak from the true one",
            f"within one band, {step:g} nm",
            abs(peaks[0] - peaks[1]),
            "nm",
            abs(peaks[0] - peaks[1]) <= step * 1.001,
            f"root mean square errors of spectra: {', '.join(errors)}",
        ),
        Finding(
            "recovered by shears on a straight line, one pixel a band: loss",
            "",
            noisy - decibels["straight line"],
            "dB",
            why="the common model does not hold for a prism",
        ),
        Finding(
            "recovered by true shears, rounded to whole pixels: loss",
            "",
            noisy - decibels["rounded"],
            "dB",
        ),
    )


ENTRY = Entry(
    "cassi",
    "CASSI: coded aperture snapshot spectral imager",
    "A. Wagadarikar, R. John, R. Willett and D. Brady, Single disperser design for coded aperture snapshot spectral "
    "imaging, Applied Optics 47, B44, 2008; M. E. Gehm, R. John, D. J. Brady, R. M. Willett and T. J. Schulz, "
    "Single-shot compressive spectral imaging with a dual-disperser architecture, Optics Express 15, 14013, 2007",
    "A coded aperture and a prism put all bands of a scene into one grey recording, from which the spectrum of each "
    "pixel can be estimated.",
    Run(),
)
