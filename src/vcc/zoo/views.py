"""Light fields in the zoo: cameras, decoders, and the tasks light-field and refocusing.

The square at the lens is divided into `CELLS` × `CELLS` cells. A view is the mean over a cell, as a sample of a
light field is. Cameras with fine pixels have `CELLS` × `CELLS` pixels for one of the rules, on the same area.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vcc.base.errors import InputError
from vcc.base.measures import decibels
from vcc.camera import Camera
from vcc.gallery.published_codes import LEVIN
from vcc.light_field import LightField
from vcc.optics.lens import Lens
from vcc.optics.lens_array import LensArray
from vcc.optics.mask import Mask
from vcc.optics.sensor import Sensor
from vcc.recover import LensletGrid, decode_heterodyne, decode_plenoptic, heterodyne_calibration, refocused, wiener
from vcc.shapes.patterns import Cells, CosineSum, Open
from vcc.zoo.bench import (
    ALL_BLURS,
    BEYOND,
    BLUR,
    BORDER,
    ELECTRONICS,
    FOCAL_LENGTH,
    FOCUS,
    PITCH,
    SHAPE,
    SIDE,
    SLOPE,
    check_area,
    distance_of,
    image_distance,
    inner,
    of_lens,
)
from vcc.zoo.decoders import Decoder, Recorded, as_recorded, by_defocus, denoised
from vcc.zoo.entrants import OWN, Entrant, Exposure, coded, open_square, round_stop
from vcc.zoo.scenes import Scene, cropped
from vcc.zoo.task import PSNR, SSIM, Measure, Task, picture_scores

Array = NDArray[np.float64]

CELLS = 5
CELL = SIDE / CELLS
PLACES = np.arange(CELLS) - (CELLS - 1) / 2
"""Of cells, in cells from the axis."""
COARSE = 5
"""Pixels of the picture across a lenslet of the plenoptic camera with the pixels of the rules."""
RAYS = 16
"""Rays per pixel of plenoptic cameras."""
OPEN_CELLS, DRAWN = 13, 4000
"""Open cells of a multiplexed aperture, and patterns of which the best one is taken."""
ITS_VIEWS = ("its views", "its views, denoised")
PEDESTAL = 300.0
"""Added to recordings, white 1, and subtracted from their views: decoders set negative noise to 0."""
REFOCUSED = tuple(float(blur) for blur in np.linspace(BLUR, -BLUR, 5))
"""Distances of refocused pictures, see `vcc.zoo.bench.distance_of`."""


# --- cameras ---


def plenoptic(lenslet: int) -> Camera:
    """Lenslets in the image of `FOCUS`, with `CELLS` pixels each way behind each (Ng et al. 2005).

    Args:
        lenslet: its width, pixels of the rules.
    """
    d, pitch = image_distance(FOCUS), PITCH * lenslet
    gap = pitch / (SIDE - pitch) * d  # micro-images touch: SIDE·gap/d = pitch·(1 + gap/d)
    rows, columns = (n // lenslet for n in SHAPE)
    offset = tuple(pitch / 2 if n % 2 == 0 else 0.0 for n in (columns, rows))
    array = LensArray(pitch, 1 / (1 / gap + 1 / d), offset=(offset[0], offset[1]), z=d, name="lenslets")
    sensor = Sensor(
        d + gap, (rows * CELLS, columns * CELLS), pitch * (1 + gap / d) / CELLS, electronics=ELECTRONICS
    )
    return Camera([Mask(Open(), width=SIDE), Lens(FOCAL_LENGTH), array], sensor)


def heterodyne() -> Camera:
    """Cosines before fine pixels; their shadow has the period of a view's pixel (Veeraraghavan et al. 2007)."""
    d, share = image_distance(FOCUS), PITCH / (SIDE + PITCH)
    mask = Mask(CosineSum(share * SIDE, (CELLS - 1) // 2), z=d * (1 - share), name="cosines")
    shape = (SHAPE[0] * CELLS, SHAPE[1] * CELLS)
    return Camera(
        [Mask(Open(), width=SIDE), Lens(FOCAL_LENGTH), mask],
        Sensor(d, shape, PITCH / CELLS, electronics=ELECTRONICS),
    )


def small_camera(row: int, column: int) -> Camera:
    """A camera of an array: its lens fills a cell, and its pixels are fine."""
    u, v = (float(PLACES[n]) * CELL for n in (column, row))
    z = 1 / (CELLS / FOCAL_LENGTH - 1 / FOCUS)
    grown = 1 + z / FOCUS  # points at FOCUS fall on the same pixel of all sensors
    return Camera(
        [Mask(Open(), width=CELL, decentre=(u, v)), Lens(FOCAL_LENGTH / CELLS, decentre=(u, v))],
        Sensor(z, SHAPE, SLOPE * z, decentre=(u * grown, v * grown), electronics=ELECTRONICS),
    )


@lru_cache(maxsize=1)
def multiplexed() -> Array:
    """All cyclic shifts of one aperture with `OPEN_CELLS` open cells: (codes, rows, columns) of 0 and 1.

    Of `DRAWN` random patterns, that with the least noise after demultiplexing: Σ 1/|F|² over its spectrum F.
    """
    random = np.random.default_rng(25)
    drawn = random.permuted(np.tile(np.arange(CELLS**2) < OPEN_CELLS, (DRAWN, 1)), axis=1).astype(np.float64)
    drawn = drawn.reshape(-1, CELLS, CELLS)
    best = drawn[np.argmin(np.sum(1 / np.maximum(np.abs(np.fft.fft2(drawn)), 1e-9) ** 2, axis=(1, 2)))]
    return np.stack([np.roll(best, place, (0, 1)) for place in np.ndindex(CELLS, CELLS)])


def _apertures(codes: Array) -> tuple[Exposure, ...]:
    """One after the other, the time shared equally."""
    return tuple(Exposure(of_lens(Mask(code, width=SIDE)), 1 / len(codes)) for code in codes)


def recorders() -> list[Entrant]:
    """Cameras that record views."""
    single = np.eye(CELLS**2).reshape(-1, CELLS, CELLS)
    array = tuple(Exposure(small_camera(*place)) for place in np.ndindex(CELLS, CELLS))
    rays = {"method": "rays", "samples": RAYS}
    listed = [
        ("plenoptic", (Exposure(plenoptic(COARSE)),), "Ng et al. 2005", rays),
        ("plenoptic, fine pixels", (Exposure(plenoptic(1)),), "Ng et al. 2005", rays),
        ("heterodyne, fine pixels", (Exposure(heterodyne()),), "Veeraraghavan et al. 2007", {}),
        ("camera array, fine pixels", array, "Wilburn et al. 2005", {}),
        ("programmable aperture", _apertures(single), "Liang et al. 2008", {}),
        ("multiplexed aperture", _apertures(multiplexed()), "Liang et al. 2008", {}),
    ]
    return [
        Entrant(name, exposures, source=source, decoders=ITS_VIEWS, traced=False, options=options)
        for name, exposures, source, options in listed
    ]


def photographs() -> list[Entrant]:
    """Controls: one photograph, open or sharp, and two whose blur shows the depth."""
    plain = [Entrant.single("open", open_square(FOCUS)), round_stop(0.1, FOCUS), round_stop(0.04, FOCUS)]
    beyond = [
        coded("Levin code, focused beyond", LEVIN, "Levin et al. 2007", BEYOND),
        replace(round_stop(0.1, BEYOND), name="round 10 %, focused beyond"),
    ]
    return [
        *(replace(each, decoders=("one picture", "one picture, denoised")) for each in plain),
        *(replace(each, decoders=("moved by depth",)) for each in beyond),
    ]


# --- decoders ---


def its_views(recorded: Recorded) -> Array:
    """The views of the camera, by the decoder of its kind: (cells, cells, rows, columns).

    Raises:
        InputError: a camera that records no views.
    """
    if len(recorded.exposures) > 1:
        return _of_apertures(recorded)
    views_in = _decoder_of(recorded.camera)
    if views_in is None:
        raise InputError("the camera has neither lenslets nor a mask of cosines: its picture holds no views")
    return _on_pixels(views_in(recorded.values + PEDESTAL, recorded.camera)) - _zero(recorded.camera)


def _decoder_of(camera: Camera) -> Callable[[Array, Camera], LightField] | None:
    if any(isinstance(each, LensArray) for each in camera.elements):
        return _of_lenslets
    cosines = any(isinstance(each, Mask) and isinstance(each.pattern, CosineSum) for each in camera.elements)
    return _of_carriers if cosines else None


def _of_apertures(recorded: Recorded) -> Array:
    """Cells out of the means over open cells, by least squares; or the pictures of an array as they are."""
    patterns = [stop.pattern for each in recorded.exposures if isinstance(stop := each.camera.elements[0], Mask)]
    if all(isinstance(each, Open) for each in patterns):
        return recorded.values.reshape(CELLS, CELLS, *SHAPE)
    cells = [np.asarray(each.values, np.float64) for each in patterns if isinstance(each, Cells)]
    opened = np.stack(cells).reshape(len(cells), -1)
    means = opened / opened.sum(axis=1, keepdims=True)
    found = np.linalg.pinv(means) @ recorded.values.reshape(len(means), -1)
    return np.asarray(found).reshape(CELLS, CELLS, *SHAPE)


def _of_lenslets(values: Array, camera: Camera) -> LightField:
    step = LensletGrid.of_camera(camera).pitch / CELLS
    return decode_plenoptic(values, camera=camera, views=CELLS, view_step=step, inverted=False)


@lru_cache(maxsize=2)
def _calibration(camera: Camera) -> Array:
    """Of a heterodyne camera, with views as fine as those of drawn scenes."""
    count, pixels = 25, tuple(n + 60 for n in SHAPE)
    white = np.ones((count, count, *pixels), np.float32)
    field = LightField.from_views(white, SIDE / count, SLOPE, FOCUS, disparity_range=(0.0, 0.0))
    return np.asarray(heterodyne_calibration(camera, light_field=field).to_numpy(), np.float64)


def _of_carriers(values: Array, camera: Camera) -> LightField:
    # The cosines pass a quarter of the light; white is 1 in the values, and irradiance in the decoder.
    irradiance = 0.25 * (SIDE / camera.sensor.z) ** 2 * values[::-1, ::-1]
    return decode_heterodyne(irradiance, camera, calibration=_calibration(camera))


@lru_cache(maxsize=4)
def _zero(camera: Camera) -> Array:
    """The views of `PEDESTAL` alone: decoders are linear."""
    views_in = _decoder_of(camera)
    assert views_in is not None
    return _on_pixels(views_in(np.full(camera.sensor.shape, PEDESTAL), camera))


def _on_pixels(field: LightField) -> Array:
    """The views, with the directions of the pixels of the rules, by cubic splines.

    Raises:
        InputError: views that do not cover the scored part of the picture.
    """
    middle, frame = (CELLS - 1) / 2, field.frame
    first = frame([middle, middle, 0, 0])[2:]
    at = [
        (-SLOPE * (np.arange(n) - (n - 1) / 2) - first[axis]) / frame.linear[axis + 2, axis + 2]
        for axis, n in ((1, SHAPE[0]), (0, SHAPE[1]))
    ]
    for index, count in zip(at, field.shape[2:], strict=True):
        ends = sorted((index[BORDER], index[-1 - BORDER]))
        if ends[0] < -0.5 or ends[1] > count - 0.5:
            raise InputError(
                f"the views of the camera have {field.shape[2]}×{field.shape[3]} pixels, which do not cover the "
                f"scored part of the picture: focus on {FOCUS:g} m, with a sensor of the zoo's area"
            )
    places = np.stack(np.meshgrid(*at, indexing="ij"))
    flat = np.asarray(field.values, np.float64).reshape(-1, *field.shape[2:])
    views = [ndimage.map_coordinates(each, places, order=3, mode="nearest") for each in flat]
    return np.stack(views).reshape(CELLS, CELLS, *SHAPE)


def with_denoiser(decode: Decoder) -> Decoder:
    """A decoder, and the learned denoiser on each picture that it returns.

    The noise of the pictures is that of an even grey recording with the noise of the given one, decoded.
    """

    def both(recorded: Recorded) -> Array:
        grey = np.full(recorded.values.shape, 0.5)
        noise = recorded.noise * np.random.default_rng(0).standard_normal(grey.shape)
        noisy, clean = (decode(replace(recorded, values=values)) for values in (grey + noise, grey))
        level = float((noisy - clean).std())
        found = decode(recorded)
        pictures = [denoised(replace(recorded, values=each, noise=level)) for each in found.reshape(-1, *SHAPE)]
        return np.stack(pictures).reshape(found.shape)

    return both


def repeated(picture: Array, *counts: int) -> Array:
    """One picture as all views, or as all of a stack."""
    return np.broadcast_to(picture, (*counts, *SHAPE)).copy()


def moved_by_depth(recorded: Recorded) -> Array:
    """Depth from defocus, each depth deblurred by its kernel (Levin et al. 2007), and moved by its parallax.

    Near objects cover far ones; what becomes visible behind an object shows the picture of the middle view.
    """
    kernels, distance = recorded.traced, by_defocus(recorded)
    vergence = 1 / np.array(kernels.distances)
    layer = np.abs(1 / distance[..., None] - vergence).argmin(axis=-1)
    sharp = np.stack([wiener(recorded.values, each, recorded.noise).picture for each in kernels.values])
    picture = np.take_along_axis(sharp, layer[None], axis=0)[0]
    views = repeated(picture, CELLS, CELLS)
    blurs = (vergence - 1 / FOCUS) * SIDE / SLOPE
    for number in np.argsort(vergence):  # the farthest first
        inside = (layer == number).astype(np.float64)
        if inside.any():
            for row, column in np.ndindex(CELLS, CELLS):
                by = -blurs[number] / CELLS * PLACES[[row, column]]
                alpha, light = (ndimage.shift(each, by, order=1) for each in (inside, inside * picture))
                views[row, column] = views[row, column] * (1 - alpha) + light
    return views


def refocus(views: Array) -> Array:
    """The pictures of the whole square focused at the distances, (distances, rows, columns)."""
    above = max(-float(views.min()), 0.0)  # light fields are not negative, but noise is
    values, reach = np.ascontiguousarray(views + above, np.float32), 1.3 * BLUR / CELLS
    field = LightField.from_views(values, CELL, SLOPE, FOCUS, disparity_range=(-reach, reach))
    found = [refocused(field, distance_of(blur)).to_numpy() for blur in REFOCUSED]
    return np.stack(found).astype(np.float64) - above


# --- the tasks ---


def cells_of(scene: Scene) -> Array:
    """The mean over each cell of the square, upright, white 1: (cells, cells, rows, columns).

    Raises:
        InputError: views that do not divide into cells.
    """
    values = np.asarray(scene.field.values, np.float64)
    rows, columns = values.shape[:2]
    if rows % CELLS or columns % CELLS:
        raise InputError(
            f"the scene {scene.name} has {rows}×{columns} views, which do not divide into the {CELLS}×{CELLS} "
            f"views of the tasks light-field and refocusing: give {CELLS}×{CELLS}, 15×15 or 25×25"
        )
    means = values.reshape(CELLS, rows // CELLS, CELLS, columns // CELLS, *values.shape[2:]).mean(axis=(1, 3))
    return np.stack([[cropped(view, SHAPE) for view in row] for row in means])


def focused(scene: Scene) -> Array:
    """What the open square shows, focused at each of the distances, without noise."""
    found = []
    for blur in REFOCUSED:
        camera = open_square(distance_of(blur))
        image = camera.capture(scene.field, threads=1).upright().to_numpy()
        found.append(np.asarray(image, np.float64) * (camera.sensor.z / SIDE) ** 2)
    return np.stack(found)


def _scores(decoded: Array, truth: Array, ends: tuple[tuple[int, ...], tuple[int, ...]]) -> tuple[float, ...]:
    """PSNR over all pictures; of two of them; the mean of SSIM."""
    apart = inner(decoded - truth) ** 2
    pairs = zip(decoded.reshape(-1, *SHAPE), truth.reshape(-1, *SHAPE), strict=True)
    similar = float(np.mean([picture_scores(*pair)[1] for pair in pairs]))
    first, second = (decibels(float(apart[end].mean())) for end in ends)
    return decibels(float(apart.mean())), first, second, similar


MIDDLE, CORNER = (CELLS // 2, CELLS // 2), (0, 0)
NEAREST, FARTHEST = (0,), (len(REFOCUSED) - 1,)


def _compared(own: list[Entrant], controls: tuple[str, ...]) -> list[Entrant]:
    """The cameras that record views, and those of the user, whose own decoders suit cameras of another kind."""
    given = [
        replace(each, decoders=ITS_VIEWS if _decoder_of(each.camera) else (OWN,), traced=False) for each in own
    ]
    return [replace(each, controls=controls) for each in (*recorders(), *given)]


def _light_field_entrants(own: list[Entrant]) -> list[Entrant]:
    return [*_compared(own, ("open", "round 4 %")), *photographs()]


def _refocusing_entrants(own: list[Entrant]) -> list[Entrant]:
    times = 1 / len(REFOCUSED)
    stack = tuple(Exposure(open_square(distance_of(blur)), times) for blur in REFOCUSED)
    return [
        *_compared(own, ("focal stack", "open")),
        Entrant("focal stack", stack, decoders=("its stack", "its stack, denoised"), traced=False),
        *photographs(),
    ]


def _refocused_views(recorded: Recorded) -> Array:
    return refocus(its_views(recorded))


LIGHT_FIELD = Task(
    "light-field",
    f"The light field, {CELLS}×{CELLS} views, out of what a camera records in one exposure time",
    ALL_BLURS,
    _light_field_entrants,
    {
        "its views": its_views,
        "its views, denoised": with_denoiser(its_views),
        "one picture": lambda recorded: repeated(recorded.values, CELLS, CELLS),
        "one picture, denoised": lambda recorded: repeated(denoised(recorded), CELLS, CELLS),
        "moved by depth": moved_by_depth,
    },
    (PSNR, Measure("PSNR, middle view", "dB", True, 1), Measure("PSNR, corner view", "dB", True, 1), SSIM),
    cells_of,
    lambda decoded, truth: _scores(decoded, truth, (MIDDLE, CORNER)),
    (CELLS, CELLS, *SHAPE),
    ("one open picture as all views", "one picture of a round stop of 4 % as all views"),
    lambda views: np.asarray(views[CORNER]),
    check=check_area,
)

REFOCUSING = Task(
    "refocusing",
    f"The pictures of the open square focused at {len(REFOCUSED)} distances, out of one exposure time",
    ALL_BLURS,
    _refocusing_entrants,
    {
        "its views": _refocused_views,
        "its views, denoised": with_denoiser(_refocused_views),
        "its stack": as_recorded,
        "its stack, denoised": with_denoiser(as_recorded),
        "one picture": lambda recorded: repeated(recorded.values, len(REFOCUSED)),
        "one picture, denoised": lambda recorded: repeated(denoised(recorded), len(REFOCUSED)),
        "moved by depth": lambda recorded: refocus(moved_by_depth(recorded)),
    },
    (PSNR, Measure("PSNR, nearest", "dB", True, 1), Measure("PSNR, farthest", "dB", True, 1), SSIM),
    focused,
    lambda decoded, truth: _scores(decoded, truth, (NEAREST, FARTHEST)),
    (len(REFOCUSED), *SHAPE),
    ("a focal stack in the same time", "one open picture"),
    lambda pictures: np.asarray(pictures[0]),
    check=check_area,
)
