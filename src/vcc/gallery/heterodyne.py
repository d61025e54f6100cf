"""The heterodyne light-field camera: a mask of cosines close before the sensor (Veeraraghavan et al. 2007)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError, without_result_warnings
from vcc.base.measures import decibels, psnr
from vcc.base.units import um
from vcc.camera import Camera
from vcc.gallery import heterodyne_figures
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.gallery.heterodyne_figures import TRANSMITTED
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, Mask
from vcc.optics.electronics import Electronics
from vcc.optics.sensor import Sensor
from vcc.recording import expose_image
from vcc.recover import decode_heterodyne, heterodyne_calibration, refocused
from vcc.recover.heterodyne import HeterodyneGeometry
from vcc.recover.heterodyne_band import band_limited, places_on_sensor, true_views
from vcc.recover.heterodyne_geometry import PINHOLE_SHARE
from vcc.shapes.patterns import CosineSum, Open
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import away

Floats = NDArray[np.float32]

HARMONICS = 4
"""Cosines along each axis of the published mask: four, for 9×9 tiles and views."""
VIEWS = 2 * HARMONICS + 1
SMALLEST_TILE = 24
BORDER = 0.08
"""Share of the sensor that is faded out at each edge, and cut off the views."""
INSIDE = 0.96
"""Share of the area visible in all views that the sensor covers, so that all pixels lie within the views."""
SAMPLES = 5
"""Samples of the recorded light field per pixel of a view: see `vcc.recover.band_limited`."""
SHARPER = SAMPLES - 1.0
"""Resolution of the sharper scene relative to the tiles: nearly the limit of these samples."""
WELL = 1000 / um**2
"""Electrons per area of a pixel, as is common for sensors: 1/m²."""
READ_NOISE = 5.0
"""Electrons."""
ENOUGH = 30.0
"""Decibels that inner views should reach if the scene fits the tiles."""


@dataclass(frozen=True, eq=False)
class Decoded:
    """The result of one recording.

    Args:
        image: irradiance on the sensor.
        views: decoded.
        decibels: of each view against the true one, (v, u).
    """

    image: Image
    views: LightField
    decibels: NDArray[np.float64]

    @property
    def inner(self) -> float:
        """The mean over all but the outermost ring, decibels."""
        return float(self.decibels[1:-1, 1:-1].mean())


@dataclass(frozen=True)
class Run:
    """Record a scene that fits the tiles and a sharper one, decode, compare with the true views, refocus.

    Args:
        tile: pixels of a view along the longer side; the published views, 237×191, had sensors of 2133×1719
            pixels.
        parts: number of parts in which light fields are recorded: a whole band-limited one would take more
            than a gigabyte.
        calibration_rays: per pixel of the calibration recording.
    """

    tile: int = 96
    parts: int = 4
    calibration_rays: int = 64

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Record a light field, decode it, and measure."""
        light_field = on_axis(bench.light_field)
        camera = designed(bench, light_field, self.tile)
        steps = Steps(progress, 2 * self.parts + 4)
        progress(0, steps.total)
        calibration = heterodyne_calibration(camera, samples=self.calibration_rays)
        steps()
        sharper = min(SHARPER, _own_fineness(light_field, camera))
        images = {
            name: recorded(
                camera,
                _counted(
                    band_limited(light_field, camera, fineness=fineness, samples=SAMPLES, parts=self.parts), steps
                ),
            )
            for name, fineness in (("fitting", 1.0), ("sharper", sharper))
        }
        images["noisy"] = expose_image(images["fitting"], camera.sensor, "auto").image()
        views = {
            name: decode_heterodyne(image, camera, calibration=calibration, border=BORDER)
            for name, image in images.items()
        }
        steps()
        truth = true_views(equally_sampled(bench, light_field, camera), camera, views["fitting"])
        steps()
        compared = Compared.of(bench, camera, images, views, truth, sharper)
        steps()
        numbers = (*compared.findings(), _light_finding(transmission(camera, calibration)))
        return Result(
            prose(__name__, bench=bench, camera=camera, geometry=HeterodyneGeometry.of(camera), sharper=sharper),
            _pictures(compared),
            numbers,
            bench.assumed,
        )


def _counted(parts: Iterable[LightField], steps: Steps) -> Iterator[LightField]:
    for part in parts:
        yield part
        steps()


@dataclass(frozen=True, eq=False)
class Compared:
    """The decoded views, compared with the true ones.

    Args:
        bench: lens and distances.
        camera: with its mask of cosines last.
        taken: by name: "fitting" the tiles, "sharper", and "noisy".
        truth: the views from which the fitting scene was made.
        white: radiance.
        sharper: resolution of the sharper scene relative to the tiles.
        refocused: images by the name of views ("decoded", "true", "noisy") and that of a distance.
    """

    bench: Bench
    camera: Camera
    taken: dict[str, Decoded]
    truth: LightField
    white: float
    sharper: float
    refocused: dict[str, dict[str, Floats]]

    @classmethod
    def of(
        cls,
        bench: Bench,
        camera: Camera,
        images: dict[str, Image],
        views: dict[str, LightField],
        truth: LightField,
        sharper: float,
    ) -> Compared:
        """Measure each set of views, and refocus the fitting scene."""
        white = float(np.asarray(truth.values).max())
        taken = {
            name: Decoded(images[name], views[name], view_decibels(views[name], truth, white)) for name in images
        }
        pictures = {
            name: {
                place: refocused(field, distance, between_views="none").to_numpy()
                for place, distance in bench.distances.items()
            }
            for name, field in (("decoded", views["fitting"]), ("true", truth), ("noisy", views["noisy"]))
        }
        return cls(bench, camera, taken, truth, white, sharper, pictures)

    def findings(self) -> Iterator[Finding]:
        """The errors of views and refocused images."""
        fitting, sharper = self.taken["fitting"], self.taken["sharper"]
        inner = f"inner {VIEWS - 2}×{VIEWS - 2} views against the true ones, mean PSNR"
        yield Finding(
            f"scene that fits the tiles: {inner}",
            f"{ENOUGH:g} dB or more",
            fitting.inner,
            "dB",
            fitting.inner >= ENOUGH,
            f"without the outermost ring; worst of them {fitting.decibels[1:-1, 1:-1].min():.1f} dB, mean of all "
            f"{VIEWS**2} {fitting.decibels.mean():.1f} dB",
        )
        yield Finding(
            f"scene {self.sharper:.2g} times as fine as tiles hold: {inner}",
            "",
            sharper.inner,
            "dB",
            why=f"its aliasing costs {fitting.inner - sharper.inner:.1f} dB, focused "
            f"{away(self.bench.masked_focus)}: strong tiles spill into weak ones",
        )
        yield Finding(
            f"scene that fits, with photon noise: {inner}",
            "",
            self.taken["noisy"].inner,
            "dB",
            why="weak tiles are raised to the strength of the others, their noise with them",
        )
        for place, distance in self.bench.distances.items():
            clean, noisy = (
                psnr(self.refocused[name][place], self.refocused["true"][place], self.white)
                for name in ("decoded", "noisy")
            )
            yield Finding(
                f"refocused {place} ({away(distance)}) against the true views refocused, PSNR",
                "",
                clean,
                "dB",
                why=f"with noise {noisy:.1f} dB: all views average it",
            )


def _light_finding(passed: float) -> Finding:
    return Finding(
        "light that the mask lets through, by the calibration recording",
        f"½·½ = {TRANSMITTED}, the mean of the cosines, within 1 %",
        passed,
        "",
        abs(passed / TRANSMITTED - 1) < 0.01,
        "two stops are lost",
    )


# --- the camera ---


def designed(bench: Bench, light_field: LightField, most: int = 96) -> Camera:
    """A lens behind a square stop as wide as the grid of views, cosines, and a sensor.

    A ray from u to x on the sensor, d behind the lens, crosses the mask, g before the sensor, at x_m = (1 −
    r)·x + r·u with r = g/d. Over the stop A the first cosine has one period, P = r·A. Its shadow on the
    sensor has the period P/(1 − r), which is one pixel of a view and 9 pixels of the sensor, so that 9 tiles
    fill the spectrum.

    Args:
        bench: lens and focus.
        light_field: at the lens, centred on the axis.
        most: pixels of a view along the longer side; fewer if the light field has few.

    Raises:
        InputError: fewer views than the camera separates, or too few pixels.
    """
    nv, nu = light_field.shape[:2]
    if min(nv, nu) < VIEWS:
        raise InputError(
            f"the heterodyne camera tells {VIEWS}×{VIEWS} views apart, and this light field has {nv}×{nu}: give "
            f"one of {VIEWS}×{VIEWS} views or more"
        )
    d = bench.image_distance(bench.masked_focus)
    linear = light_field.frame.linear
    stop = nu * abs(float(linear[0, 0])), nv * abs(float(linear[1, 1]))
    sizes, steps = _seen_by_all(bench, light_field)
    longer = int(np.argmax(sizes))
    of_a_view = sizes[longer] / _tile(sizes[longer], steps[longer], most)
    share = of_a_view / (stop[longer] + of_a_view)
    shadow = [each * share / (1 - share) for each in stop]
    tiles = [max(int(size / each + 1e-6), 2) for size, each in zip(sizes, shadow, strict=True)]
    pitch = shadow[1] / VIEWS, shadow[0] / VIEWS
    return Camera(
        [
            Lens(bench.focal_length),
            Mask(Open(), width=stop[0], height=stop[1], name="stop"),
            Mask(CosineSum((share * stop[0], share * stop[1]), HARMONICS), z=d * (1 - share), name="cosines"),
        ],
        Sensor(d, (VIEWS * tiles[1], VIEWS * tiles[0]), pitch, electronics=_electronics(pitch)),
    )


def _seen_by_all(bench: Bench, light_field: LightField) -> tuple[list[float], list[float]]:
    """Across and down, metres: width on the sensor that all views cover, and spacing of their pixels there."""
    sensor = Sensor(bench.image_distance(bench.masked_focus), (2, 2), 1 * um)
    lens_alone = Camera([Lens(bench.focal_length)], sensor)
    sizes, steps = [], []
    for axis in (0, 1):
        landed = places_on_sensor(light_field, lens_alone, axis)
        half = min(landed.max(axis=1).min(), -landed.min(axis=1).max())
        sizes.append(2 * INSIDE * float(half))
        steps.append(float(np.ptp(landed[0])) / (landed.shape[1] - 1))
    if min(sizes) <= 0:
        raise InputError(
            "the views do not share what they look at around the axis when focused "
            f"{away(bench.masked_focus)}: give a light field whose views converge, or with less parallax"
        )
    return sizes, steps


def _tile(size: float, step: float, most: int) -> int:
    """Pixels of a view; each covers at least two of the light field's, otherwise there is nothing to filter."""
    tile = min(most, int(size / step / 2))
    if tile < SMALLEST_TILE:
        raise InputError(
            f"the views are too small: what all of them see is {tile} pixels wide if two of theirs make one, and "
            f"a tile needs {SMALLEST_TILE} or more. Give views of more pixels, or with less parallax"
        )
    return tile


def _electronics(pitch: tuple[float, float]) -> Electronics:
    well = WELL * pitch[0] * pitch[1]
    return Electronics(full_well=well, gain=60_000 / well, black_level=1000.0, bit_depth=16, read_noise=READ_NOISE)


def on_axis(light_field: LightField) -> LightField:
    """The light field centred on the axis, its views from left to right and from top to bottom as decoded ones."""
    nv, nu = light_field.shape[:2]
    linear = light_field.frame.linear
    ordered = light_field[:: 1 if linear[1, 1] > 0 else -1, :: 1 if linear[0, 0] > 0 else -1]
    u, v, _, _ = ordered.frame([(nu - 1) / 2, (nv - 1) / 2, 0, 0])
    return ordered.transformed(Affine.translation(-u, -v, 0, 0))


def recorded(camera: Camera, parts: Iterable[LightField]) -> Image:
    """The recording of a light field given in parts: the sum of their recordings."""
    total: Image | None = None
    found = 0.0  # share of the requested rays
    with without_result_warnings():
        # A part of the views leaves the rest of the sensor dark, but their sum covers it.
        for part in parts:
            # Each view fills its cell of the aperture: no interpolation between views.
            image = camera.capture(part, between_views="none", interpolation="cubic")
            found += 1 - image.missing_rays
            total = image if total is None else replace(image, values=total.to_numpy() + image.to_numpy())
    assert total is not None  # there is at least one part
    return replace(total, missing_rays=max(1 - found, 0.0))


def transmission(camera: Camera, calibration: Image) -> float:
    """The transmission of the cosines, from the calibration recording."""
    width, height = (PINHOLE_SHARE * period for period in HeterodyneGeometry.of(camera).aperture_period)
    return float(calibration.to_numpy().mean(dtype=np.float64)) / (width * height / camera.sensor.z**2)


def _own_fineness(light_field: LightField, camera: Camera) -> float:
    """Resolution of the light field's own views relative to decoded views, at the sensor."""
    carrier = HeterodyneGeometry.of(camera).carrier
    landed = [places_on_sensor(light_field, camera, axis)[0, :2] for axis in (0, 1)]
    return min(1 / (carrier[axis] * float(abs(np.diff(landed[axis])[0]))) for axis in (0, 1))


# --- results ---


def equally_sampled(bench: Bench, light_field: LightField, camera: Camera) -> LightField:
    """The images of pinholes at the positions of the decoded views if the scene is known; else the given views."""
    if bench.scene is None:
        return light_field
    linear = light_field.frame.linear
    vergence = float(linear[2, 0] / linear[0, 0])
    return bench.scene.light_field(
        (VIEWS, VIEWS),
        (light_field.shape[2], light_field.shape[3]),
        spacing=HeterodyneGeometry.of(camera).aperture_period[0] / VIEWS,
        slope_per_pixel=abs(float(linear[2, 2])),
        focus_distance=1 / vergence if vergence > 0 else math.inf,
    )


def view_decibels(views: LightField, truth: LightField, white: float) -> NDArray[np.float64]:
    """PSNR of each view against the true one, (v, u)."""
    error = np.asarray(views.values, np.float64) - np.asarray(truth.values)
    power = np.mean(error**2, axis=tuple(range(2, error.ndim)))
    return np.array([[decibels(float(each), white) for each in row] for row in power])


def _pictures(compared: Compared) -> tuple[tuple[Picture, ...], ...]:
    camera, taken, truth, white = compared.camera, compared.taken, compared.truth, compared.white
    sharper = f"{compared.sharper:.2g} times as fine"
    columns = {
        "true": (truth, None),
        "decoded": (taken["fitting"].views, taken["fitting"].decibels),
        f"decoded, scene {sharper}": (taken["sharper"].views, taken["sharper"].decibels),
        "decoded, photon noise": (taken["noisy"].views, taken["noisy"].decibels),
    }
    spectra = {
        "scene that fits the tiles": taken["fitting"].image,
        f"scene {sharper} as tiles hold": taken["sharper"].image,
    }
    rows = {
        "from decoded views": compared.refocused["decoded"],
        "from the true views": compared.refocused["true"],
    }
    return below(
        Picture(
            "recording",
            "Mask and recording",
            "The orange square shows what the mask wrote most into, magnified, and what a mean over one "
            "period of the mask takes away there: the mask’s dots, where things are out of focus. What is "
            "in focus passes the mask over a whole period, and shows none.",
            heterodyne_figures.recording_figure(camera, taken["fitting"].image, white),
        ),
        Picture(
            "spectrum",
            "Spectra of the recordings",
            "Tiles around each whole multiple (n<sub>x</sub>, n<sub>y</sub>) of the carrier: "
            f"{VIEWS}×{VIEWS} slices of the light field’s spectrum. Left, the scene that fits: tiles stand "
            f"apart. Right, one {sharper}: strong tiles cover their neighbours.",
            heterodyne_figures.spectra_figure(camera, spectra),
        ),
        Picture(
            "views",
            "All decoded views",
            f"{VIEWS}×{VIEWS} views of {truth.shape[3]}×{truth.shape[2]} pixels of the scene that fits, as they "
            "lie in the aperture.",
            figures.values_shown(_mosaic(taken["fitting"].views), white),
        ),
        Picture(
            "compared",
            "Views, true and decoded",
            "Two views of the middle row, from both ends of the aperture.",
            heterodyne_figures.views_figure(columns, white),
        ),
        Picture(
            "refocused",
            "Refocused",
            "From the decoded views of the scene that fits, and from the true ones.",
            heterodyne_figures.refocus_figure(rows, white),
        ),
    )


def _mosaic(views: LightField) -> NDArray[np.generic]:
    """All views side by side."""
    nv, nu, nt, ns = views.shape[:4]
    values = np.moveaxis(np.asarray(views.values), 1, 2)
    return values.reshape(nv * nt, nu * ns, *values.shape[4:])


ENTRY = Entry(
    "heterodyne",
    "Dappled photography: the heterodyne light-field camera",
    "A. Veeraraghavan, R. Raskar, A. Agrawal, A. Mohan and J. Tumblin, Dappled photography: mask enhanced "
    "cameras for heterodyned light fields and coded aperture refocusing, SIGGRAPH 2007; C. Zhou, Virtual "
    "Computational Camera, 2009, Example 2",
    "A mask of cosines near the sensor lays slices of the light field’s spectrum side by side as tiles of the "
    "recording’s; rearranged, they are the light field.",
    Run(),
)
