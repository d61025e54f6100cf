"""Compressive light-field photography: a mask near the sensor, and light-field atoms (Marwah et al. 2013)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.errors import InputError, without_result_warnings
from vcc.base.measures import psnr
from vcc.base.units import mm
from vcc.camera import Camera
from vcc.gallery.diffusercam import drawn
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.gallery.light_field_atoms import FINE, VIEWS, Effort, atoms, reconstructed, sparsely_coded
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, Mask
from vcc.optics.electronics import Electronics
from vcc.optics.sensor import Sensor
from vcc.recording import expose_image
from vcc.shapes.patterns import Open
from vcc.showcase import figures
from vcc.showcase.bench import Bench

Array = NDArray[Any]

SPACING = 2 * mm
"""Between the parts of the lens that views stand for, on the built-in scene: a lens of 10 mm at f/5."""
FINER = 2
"""Views each way of the recorded light field for each view that is reconstructed, on the built-in scene."""
WIDE = 0.32
"""Field of view on the built-in scene, as a slope."""
MOST_PARALLAX = 1.5
"""Largest range of disparities, pixels per view; finer views are averaged."""
FARTHEST = 3
"""Largest disparity, pixels per view, likewise."""
ELECTRONICS = Electronics(full_well=10_000, gain=0.4, bit_depth=12, read_noise=2.5)
SHIFTS = (0.25, 0.5, 1.0, 2.0)
"""Pixels by which the mask's shadow moves from view to view: these distances are tried."""
PENALTIES = (0.01, 0.03, 0.1, 0.3)
"""Of the sparse coding: these are tried."""
SEED, PICTURE_SEED, TRAINING_SEED = 0, 7, 8
SMALLEST = 40
"""Least pixels of a view along a side."""
BORDER = 4
"""Pixels at the border of views that are not scored."""
LEAST_GAIN = 3.0
"""Least gain, dB: the same as for the other cameras of the gallery."""
BY_RAYS = 1024
"""Rays per pixel of the check of the model."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A light field before a camera that is focused where its views converge.

    Args:
        field: grey, white 1; at least as many views as are reconstructed.
        focal_length: of the lens, metres.
        disparities: least and largest, pixels from one reconstructed view to the next.
    """

    field: LightField
    focal_length: float
    disparities: tuple[float, float]

    @property
    @cached
    def truth(self) -> Array:
        """The light through VIEWS×VIEWS squares of the lens, (VIEWS, VIEWS, rows, columns)."""
        values = np.asarray(self.field.values, np.float32)
        part = values.shape[0] // VIEWS
        return np.asarray(values.reshape(VIEWS, part, VIEWS, part, *values.shape[2:]).mean(axis=(1, 3)))

    @property
    def spacing(self) -> float:
        """From square to square, metres."""
        return abs(float(self.field.frame.linear[0, 0])) * self.field.shape[0] / VIEWS

    @property
    def distance(self) -> float:
        """Where the views converge, metres."""
        frame = self.field.frame.linear
        vergence = float(frame[2, 0] / frame[0, 0])
        return 1 / vergence if vergence > 0 else math.inf

    @property
    def slope(self) -> float:
        """From pixel to pixel."""
        return abs(float(self.field.frame.linear[2, 2]))

    def showing(self, views: Array) -> Scene:
        """The same geometry with other views, (VIEWS, VIEWS, rows, columns)."""
        return replace(self, field=LightField.from_views(views, self.spacing, self.slope, self.distance))

    @property
    def coarse(self) -> LightField:
        """The light field with one view for each square: that of the model."""
        return self.showing(self.truth).field

    @property
    def lens(self) -> Camera:
        """The camera without a mask: one pixel for each pixel of a view."""
        behind = 1 / (1 / self.focal_length - 1 / self.distance)
        rows, columns = self.field.shape[2:4]
        sensor = Sensor(behind, (rows, columns), self.slope * behind, electronics=ELECTRONICS)
        return Camera([Lens(self.focal_length), Mask(Open(), VIEWS * self.spacing, name="stop")], sensor)

    def masked(self, cells: Array, shift: float) -> Camera:
        """The camera with a mask of cells as wide as pixels, near the sensor.

        A ray from u on the lens to x on the sensor, b behind it, crosses a mask d before the sensor at x + (u −
        x)·d/b. From view to view, that moves by spacing·d/b. Seen from the lens, cells look larger on the sensor
        by b/(b − d), so that they are made smaller.

        Args:
            cells: transmissions, wider than the sensor.
            shift: of the shadow from view to view, pixels.
        """
        plain = self.lens
        pitch, behind = plain.sensor.pitches[1], plain.sensor.z
        away = behind * pitch * shift / (self.spacing + pitch * shift)
        width = cells.shape[1] * pitch * (1 - away / behind)
        return Camera([*plain.elements, Mask(cells, width=width, z=behind - away, name="code")], plain.sensor)

    def white(self, image: Image) -> Array:
        """An image in shares of white through the open lens: radiance 1 within (VIEWS·spacing)²/b²."""
        return np.asarray(image.to_numpy()) * self.lens.sensor.z**2 / (VIEWS * self.spacing) ** 2

    def captured(self, camera: Camera) -> Image:
        """The irradiance through all views that there are."""
        with without_result_warnings():  # on masks finer than samples: a run measures that error
            return camera.capture(self.field, between_views="none", interpolation="nearest", refine=8)

    def weights(self, camera: Camera) -> Array:
        """The share of each sample that reaches its pixel, white through the open lens 1, as `truth`."""
        with without_result_warnings():  # on masks finer than samples: a run measures that error
            op = camera.operator(self.coarse, between_views="none", interpolation="nearest", refine=1)
        weights = op.T(np.ones(op.picture_shape)).reshape(self.truth.shape)
        return np.asarray(weights * self.lens.sensor.z**2 / (VIEWS * self.spacing) ** 2)

    def recorded(self, image: Image, exposure: float) -> tuple[Array, float]:
        """A recording with noise as it lies on the sensor, white 1, and the standard deviation of its noise."""
        taken = self.white(expose_image(image, self.lens.sensor, exposure, seed=SEED).image())
        full = 0.9 * ELECTRONICS.full_well
        noise = math.sqrt(max(float(taken.mean()), 0) * full + ELECTRONICS.read_noise**2) / full
        return taken, noise

    @property
    @cached
    def exposure(self) -> float:
        """Seconds, for all cameras: white nearly fills the pixels behind the open lens."""
        wall = replace(self, field=self.field.replaced(np.ones(self.field.shape, np.float32)))
        return expose_image(wall.captured(self.lens), self.lens.sensor, "auto").exposure

    @property
    def effort(self) -> Effort:
        """Sizes of the bases: parallaxes that cover the disparities, and one step more."""
        low, high = self.disparities
        return Effort(parallaxes=tuple(range(-math.ceil(FINE * high) - 1, -math.floor(FINE * low) + 2)))


def codes(shape: tuple[int, int]) -> dict[str, Array]:
    """A random mask, half of which is open, and pinholes, one in VIEWS×VIEWS cells; wider than the sensor."""
    random = np.random.default_rng(SEED).random([n + 4 * VIEWS for n in shape]) < 0.5
    rows, columns = np.indices(random.shape) % VIEWS
    return {"random": random.astype(float), "pinholes": ((rows == 0) & (columns == 0)).astype(float)}


def scene_of(bench: Bench, side: int) -> Scene:
    """The built-in scene, converging at the far distance; or the middle of other light fields.

    Raises:
        InputError: too few views, or too small ones.
    """
    if bench.scene is not None:
        finer = bench.scene.light_field(
            (VIEWS * FINER, VIEWS * FINER),
            (side, side),
            spacing=SPACING / FINER,
            slope_per_pixel=WIDE / side,
            focus_distance=bench.far,
            dtype="float32",
        )
        views, part, pixels = np.asarray(finer.values), 1, 1
        spacing, slope, vergence = SPACING / FINER, WIDE / side, 1 / bench.far
    else:
        frame = bench.light_field.frame.linear
        rows, columns, nt, ns = bench.light_field.shape[:4]
        part = min(rows, columns) // VIEWS
        if part == 0 or min(nt, ns) < SMALLEST:
            raise InputError(
                f"this light field has {rows}×{columns} views of {nt}×{ns} pixels: {VIEWS}×{VIEWS} views of "
                f"{SMALLEST}×{SMALLEST} pixels or more are needed"
            )
        signs = [1 if frame[n, n] > 0 else -1 for n in (1, 0)]
        views = np.asarray(bench.light_field.values)[:: signs[0], :: signs[1]]
        views = views[(rows - VIEWS * part) // 2 :, (columns - VIEWS * part) // 2 :]
        views = views[: VIEWS * part, : VIEWS * part]
        spacing, slope = abs(float(frame[0, 0])), abs(float(frame[2, 2]))
        vergence = max(float(frame[2, 0] / frame[0, 0]), 0.0)
        parallax = part * spacing * (1 / bench.near - 1 / bench.far) / slope
        largest = max(abs(part * spacing * (1 / z - vergence) / slope) for z in (bench.near, bench.far))
        pixels = max(1, math.ceil(parallax / MOST_PARALLAX), math.ceil(largest / FARTHEST))
        size = min(nt // pixels, side), min(ns // pixels, side)
        if min(size) < SMALLEST:
            raise InputError(
                f"disparities of this light field span {parallax:.2g} pixels between {VIEWS}×{VIEWS} views, and "
                f"reach {largest:.2g}; averaged to {MOST_PARALLAX:g} and {FARTHEST}, views of {nt}×{ns} pixels "
                f"are below {SMALLEST}×{SMALLEST}: give larger ones, or with less parallax"
            )
        top, left = ((n - pixels * kept) // 2 for n, kept in zip((nt, ns), size, strict=True))
        views = views[:, :, top : top + pixels * size[0], left : left + pixels * size[1]]
        views = views.reshape(*views.shape[:2], size[0], pixels, size[1], pixels, *views.shape[4:]).mean(
            axis=(3, 5)
        )
    grey = views if views.ndim == 4 else views.mean(axis=4)
    white = float(np.percentile(grey, 99.5))
    if not white > 0:
        raise InputError("the views of this light field are dark: there is nothing to record")
    values = np.clip(grey / white, 0, 1).astype(np.float32)
    distance = 1 / vergence if vergence > 0 else math.inf
    field = LightField.from_views(values, spacing, slope * pixels, distance)
    whole = spacing * len(views) / VIEWS / (slope * pixels)
    low, high = (whole * (1 / z - vergence) for z in (bench.far, bench.near))
    return Scene(field, bench.focal_length, (low, high))


def training_scene(like: Scene, side: int) -> Scene:
    """Three drawn sheets, one behind the other, with the disparities of another scene: to tune on.

    Args:
        like: gives geometry and disparities.
        side: pixels of a view along a side.
    """
    low, high = like.disparities
    views, across = np.arange(VIEWS) - VIEWS // 2, FINE * np.arange(side)
    sheets = [drawn("dense", FINE * (side + 4 * FARTHEST + 1), TRAINING_SEED + n) for n in range(3)]
    shapes = [sheet.T for sheet in sheets]
    made = np.zeros((VIEWS, VIEWS, side, side), np.float32)
    for n, disparity in enumerate(np.linspace(low, high, 3)):
        # A near object moves towards smaller columns from one view to the next.
        steps = [np.rint(FINE * (2 * FARTHEST + disparity * view)).astype(int) + across for view in views]
        cut = [np.lib.stride_tricks.sliding_window_view(each, (FINE, FINE)) for each in (sheets[n], shapes[n])]
        for row, column in np.ndindex(VIEWS, VIEWS):
            place = np.ix_(steps[row], steps[column])
            light, opaque = cut[0][place], cut[1][place] < (0.35 if n else 2.0)
            cover = opaque.mean(axis=(2, 3))
            made[row, column] = made[row, column] * (1 - cover) + (light * opaque).mean(axis=(2, 3))
    return like.showing(made)


@dataclass(frozen=True, eq=False)
class Measured:
    """What a run found.

    Args:
        scene: before the camera.
        images: recordings, upright, white 1, by the name of the camera.
        views: reconstructed, by name.
        error: of the model, and the sampling error of the rays it is compared with; white 1.
        shift: chosen, of the mask's shadow, pixels per view.
        penalty: chosen, of the sparse coding.
        away: the mask's distance from the sensor, metres.
    """

    scene: Scene
    images: Mapping[str, Array]
    views: Mapping[str, Array]
    error: tuple[float, float]
    shift: float
    penalty: float
    away: float

    def decibels(self, name: str) -> float:
        """PSNR over all views without their borders."""
        return scored(self.views[name], self.scene.truth)


def scored(views: Array, truth: Array) -> float:
    """PSNR over all views without their borders, white 1."""
    inside = np.s_[..., BORDER:-BORDER, BORDER:-BORDER]
    return psnr(views[inside], truth[inside], 1.0)


@dataclass(frozen=True)
class Run:
    """Record a light field through a random mask and the controls, and reconstruct its views.

    Args:
        side: pixels of a view along a side.
        training: pixels of the views of the scene that is tuned on.
        rank: atoms per parallax.
        learned_from: training patches per parallax.
        picture: points of the picture that they come from, along a side.
        rays: per pixel of the check of the model.
    """

    side: int = 160
    training: int = 60
    rank: int = 96
    learned_from: int = 1200
    picture: int = 600
    rays: int = BY_RAYS

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Tune on a drawn scene, record, and measure."""
        advance = Steps(progress, 7)
        progress(0, advance.total)
        scene = scene_of(bench, self.side)
        effort = replace(scene.effort, rank=self.rank, learned_from=self.learned_from)
        bases = atoms(drawn("dense", self.picture, PICTURE_SEED), effort)
        advance()
        shift, penalty = tuned(training_scene(scene, self.training), bases, effort)
        advance()
        made = codes(scene.lens.sensor.shape)
        coded = scene.masked(made["random"], shift)
        cameras = {"coded": coded, "open": scene.lens, "pinholes": scene.masked(made["pinholes"], 1.0)}
        images, views = {}, {}
        for name, camera in cameras.items():
            recording, noise = scene.recorded(scene.captured(camera), scene.exposure)
            weights = scene.weights(camera)
            views[name] = reconstructed(weights, recording, bases, effort, noise)
            images[name] = recording[::-1, ::-1]
            if name == "coded":
                views["sparse"] = sparsely_coded(weights, recording, bases, effort, penalty)
                advance()
            advance()
        error = model_error(scene, shift, SMALLEST, self.rays)
        views["repeated"] = np.broadcast_to(images["open"], scene.truth.shape)
        views["lenslets"] = fewer_pixels(scene.truth)
        away = coded.sensor.z - coded.elements[-1].z
        measured = Measured(scene, images, views, error, shift, penalty, away)
        advance()
        return Result(
            prose(__name__, run=self, measured=measured, scene=scene, effort=effort),
            _pictures(measured),
            tuple(_findings(measured)),
            bench.assumed,
        )


def model_error(scene: Scene, shift: float, side: int, rays: int) -> tuple[float, float]:
    """Root mean square difference of an image by rays from weighted views, and its sampling error, white 1.

    The object is a wall that shines differently in each part of the lens, so that every view's weight counts, and
    no sample is interpolated.

    Args:
        scene: gives the geometry.
        shift: of the mask's shadow from view to view, pixels.
        side: pixels of the sensor along a side.
        rays: per pixel.
    """
    shades = np.random.default_rng(SEED).random((VIEWS, VIEWS)).astype(np.float32)
    wall = np.ascontiguousarray(np.broadcast_to(shades[..., None, None], (VIEWS, VIEWS, side, side)))
    lit = scene.showing(wall)
    camera = lit.masked(codes(lit.lens.sensor.shape)["random"], shift)
    image = camera.capture(lit.field, method="rays", between_views="none", samples=rays)
    model = (lit.weights(camera) * lit.truth).sum(axis=(0, 1))
    difference = (lit.white(image)[::-1, ::-1] - model)[BORDER:-BORDER, BORDER:-BORDER]
    scale = lit.lens.sensor.z**2 / (VIEWS * lit.spacing) ** 2
    return float(np.sqrt(np.mean(difference**2))), float(image.sampling_error or 0.0) * scale


def tuned(scene: Scene, bases: list[Array], effort: Effort) -> tuple[float, float]:
    """The shift of the mask's shadow, and the penalty of the sparse coding, that are best on a scene."""
    scores: dict[float, float] = {}
    kept: dict[float, tuple[Array, Array]] = {}
    for shift in SHIFTS:
        camera = scene.masked(codes(scene.lens.sensor.shape)["random"], shift)
        recording, noise = scene.recorded(scene.captured(camera), scene.exposure)
        kept[shift] = scene.weights(camera), recording
        scores[shift] = scored(reconstructed(*kept[shift], bases, effort, noise), scene.truth)
    best = max(scores, key=lambda shift: scores[shift])
    coded = {each: sparsely_coded(*kept[best], bases, effort, each) for each in PENALTIES}
    return best, max(coded, key=lambda each: scored(coded[each], scene.truth))


def fewer_pixels(truth: Array) -> Array:
    """Views of one pixel in VIEWS×VIEWS, as behind lenslets on the same sensor; without noise, interpolated."""
    from scipy.ndimage import map_coordinates

    rows, columns = (math.ceil(n / VIEWS) * VIEWS for n in truth.shape[2:])
    wide = np.pad(truth, ((0, 0), (0, 0), (0, rows - truth.shape[2]), (0, columns - truth.shape[3])), mode="edge")
    small = wide.reshape(VIEWS, VIEWS, rows // VIEWS, VIEWS, columns // VIEWS, VIEWS).mean(axis=(3, 5))
    places = np.meshgrid(*((np.arange(n) - VIEWS // 2) / VIEWS for n in truth.shape[2:]), indexing="ij")
    return np.stack(
        [np.stack([map_coordinates(view, places, order=3, mode="nearest") for view in row]) for row in small]
    )


def _findings(measured: Measured) -> Iterator[Finding]:
    difference, sampling = measured.error
    yield Finding(
        "image by rays against the sum of views times weights: root mean square difference, share of white",
        f"equal: within twice the sampling error of the rays, {2 * sampling:.2%}",
        difference,
        "",
        difference < 2 * sampling,
        "a wall that shines differently in each part of the lens",
    )
    coded = measured.decibels("coded")
    yield Finding(f"{VIEWS}×{VIEWS} views from one recording: PSNR over all views", "", coded, "dB")
    for name, words, why in (
        ("repeated", "the photograph without a mask as every view", "the same lens, twice the light"),
        ("open", "the same decoder without the mask", "the prior alone finds some parallax from blur"),
        ("pinholes", "the same decoder behind pinholes", f"one cell in {VIEWS**2} is open, in the same time"),
        ("lenslets", f"views of one pixel in {VIEWS}×{VIEWS}, without noise", "the resolution behind lenslets"),
        ("sparse", "sparse coding with the same atoms (ℓ1, FISTA)", "atoms of all parallaxes may mix in a patch"),
    ):
        gain = Finding.gain(f"the same: gain over {words}", coded, measured.decibels(name), LEAST_GAIN, why)
        yield replace(gain, claim="", reached=None) if name == "sparse" else gain
    yield Finding.gain(
        "sparse coding (ℓ1) with these atoms: gain over the photograph as every view",
        measured.decibels("sparse"),
        measured.decibels("repeated"),
        LEAST_GAIN,
        "with principal components as atoms; the paper learns its dictionary for sparse coding",
    )


def _pictures(measured: Measured) -> tuple[tuple[Picture, ...], ...]:
    truth, images = measured.scene.truth, measured.images
    third = tuple(slice(n // 3, 2 * n // 3) for n in truth.shape[2:])
    first: list[tuple[str, figures.Shown]] = [
        ("without the mask", figures.grey_shown(images["open"])),
        ("through the mask, × 2", figures.grey_shown(2 * images["coded"])),
        ("a part of it", figures.grey_shown(2 * images["coded"][third])),
    ]
    corner = (0, 0)
    named = (
        ("mask", "coded"),
        ("no mask", "open"),
        ("photograph", "repeated"),
        ("1 pixel in 25", "lenslets"),
        ("mask, sparse coding", "sparse"),
    )
    every = [("truth", figures.grey_shown(truth[corner]))] + [
        (f"{words}: {measured.decibels(name):.1f} dB", figures.grey_shown(measured.views[name][corner]))
        for words, name in named
    ]
    row = truth.shape[2] // 2
    slices = [("truth", truth), *((words, measured.views[name]) for words, name in named[:3])]
    lines = [
        [(words, figures.grey_shown(np.repeat(each[VIEWS // 2, :, row], 4, axis=0)))] for words, each in slices
    ]
    return below(
        Picture(
            "recordings",
            "The recordings",
            "One exposure each, in the same time. Each pixel sees the lens through its own code.",
            figures.table((9.0, 3.3), [first]),
        ),
        Picture(
            "views",
            "The view from a corner of the lens",
            "PSNR is over all views.",
            figures.table((9.0, 6.4), [every[:3], every[3:]]),
        ),
        Picture(
            "slices",
            f"Row {row} of the middle row of views",
            f"{VIEWS} views, from top to bottom: what is out of focus moves from view to view.",
            figures.table((9.0, 4.6), lines),
        ),
    )


ENTRY = Entry(
    "compressive-light-field",
    "Compressive light-field photography: a mask near the sensor, and light-field atoms",
    "K. Marwah, G. Wetzstein, Y. Bando and R. Raskar, Compressive light field photography using overcomplete "
    "dictionaries and optimized projections, ACM Transactions on Graphics 32(4), SIGGRAPH 2013",
    "A light field with the resolution of the sensor is recovered from one recording behind a coded attenuation "
    "mask, because patches of light fields are sums of few atoms.",
    Run(),
)
