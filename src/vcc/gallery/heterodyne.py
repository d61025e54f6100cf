"""The heterodyne light-field camera: a mask of cosines close before the sensor (Veeraraghavan et al. 2007)."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError, ResultWarning
from vcc.base.units import mm, um
from vcc.camera import Camera
from vcc.showcase.words import away, length
from vcc.gallery import heterodyne_figures
from vcc.gallery.closeness import psnr
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result
from vcc.gallery.heterodyne_figures import TRANSMITTED
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, Mask
from vcc.optics.electronics import Electronics
from vcc.optics.sensor import Sensor
from vcc.recover import decode_heterodyne, heterodyne_calibration, refocused
from vcc.recover.heterodyne import PINHOLE_SHARE, HeterodyneGeometry
from vcc.recover.heterodyne_band import band_limited, places_on_sensor, true_views
from vcc.run.recording import expose_image
from vcc.shapes.patterns import CosineSum, Open
from vcc.showcase import figures
from vcc.showcase.bench import Bench

Floats = NDArray[np.float32]

HARMONICS = 4
"""Of the published mask: four cosines along each axis, 9×9 tiles and views."""
VIEWS = 2 * HARMONICS + 1
TILE = 96
"""Pixels of a view along the longer side; the published ones, 237×191, had sensors of 2133×1719 pixels."""
SMALLEST_TILE = 24
BORDER = 0.08
"""Share of the sensor that recordings fade out over at each edge, and that is cut off the views."""
INSIDE = 0.96
"""How much of what all views see the sensor looks at, so that no pixel looks past them."""
SAMPLES = 5
"""Of the recorded light field for each pixel of a view: see `vcc.recover.band_limited`."""
SHARPER = SAMPLES - 1.0
"""How much finer detail than tiles hold the sharper scene has: nearly what these samples hold."""
PARTS = 4
"""In which light fields are recorded: the whole of a band-limited one would take more than a gigabyte."""
WELL = 1000 / um**2
"""Electrons that a pixel holds for each of its area, as sensors commonly do: 1/m²."""
READ_NOISE = 5.0
"""Electrons."""
ENOUGH = 30.0
"""Decibels that inner views should reach where the scene fits the tiles."""
CALIBRATION_RAYS = 64
"""For each pixel of the calibration recording."""
PLACES = ("near", "middle", "far")


@dataclass(frozen=True, eq=False)
class Decoded:
    """What came of one recording.

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
        """The mean of all but the outermost ring, decibels."""
        return float(self.decibels[1:-1, 1:-1].mean())


def run(bench: Bench, progress: Progress) -> Result:
    """Record a scene that fits the tiles and a sharper one, decode, compare with the true views, refocus."""
    light_field = on_axis(bench.light_field)
    camera = designed(bench, light_field)
    steps = 2 * PARTS + 4
    progress(0, steps)
    calibration = heterodyne_calibration(camera, samples=CALIBRATION_RAYS)
    images: dict[str, Image] = {}
    sharper = min(SHARPER, _own_fineness(light_field, camera))
    for name, fineness in (("fitting", 1.0), ("sharper", sharper)):
        parts = band_limited(light_field, camera, fineness=fineness, samples=SAMPLES, parts=PARTS)
        images[name] = recorded(camera, _counted(parts, progress, 1 + len(images) * PARTS, steps))
    images["noisy"] = expose_image(images["fitting"], camera.sensor, "auto").image()
    progress(steps - 3, steps)
    views = {
        name: decode_heterodyne(image, camera, calibration=calibration, border=BORDER)
        for name, image in images.items()
    }
    progress(steps - 2, steps)
    truth = true_views(_equally_sampled(bench, light_field, camera), camera, views["fitting"])
    white = float(np.asarray(truth.values).max())
    taken = {name: Decoded(images[name], views[name], _psnr(views[name], truth, white)) for name in images}
    progress(steps - 1, steps)
    pictures = {
        name: {
            place: refocused(field, distance, between_views="none").to_numpy()
            for place, distance in _distances(bench).items()
        }
        for name, field in (("decoded", views["fitting"]), ("true", truth), ("noisy", views["noisy"]))
    }
    numbers = tuple(_findings(bench, taken, pictures, white, sharper, transmission(camera, calibration)))
    shown = _pictures(camera, taken, truth, pictures, white, sharper)
    return Result(_text(bench, camera, sharper), shown, numbers, bench.assumed)


def _counted(parts: Iterable[LightField], progress: Progress, before: int, steps: int) -> Iterator[LightField]:
    for done, part in enumerate(parts, before):
        progress(done, steps)
        yield part


# --- the camera ---


def designed(bench: Bench, light_field: LightField) -> Camera:
    """A lens behind a square stop as wide as the grid of views, cosines, and a sensor.

    A ray from u to x on the sensor, d behind the lens, passes the mask, g before it, at x_m = (1 − r)·x + r·u with
    r = g/d. Over the stop A the first cosine has one period, P = r·A; its shadow on the sensor has P/(1 − r),
    which is a pixel of a view, and 9 pixels of the sensor, so that 9 tiles fill the spectrum.

    Args:
        bench: lens and focus.
        light_field: at the lens, in the middle of the axis.

    Raises:
        InputError: fewer views than the camera tells apart, or too few pixels.
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
    lens_alone = Camera([Lens(bench.focal_length)], Sensor(d, (2, 2), 1 * um))
    sizes, steps = [], []
    for axis in (0, 1):
        landed = places_on_sensor(light_field, lens_alone, axis)
        seen_by_all = min(landed.max(axis=1).min(), -landed.min(axis=1).max())
        sizes.append(2 * INSIDE * float(seen_by_all))
        steps.append(float(np.ptp(landed[0])) / (landed.shape[1] - 1))
    if min(sizes) <= 0:
        raise InputError(
            "the views do not share what they look at around the axis when focused "
            f"{away(bench.masked_focus)}: give a light field whose views converge, or with less parallax"
        )
    longer = int(np.argmax(sizes))
    # A view's pixel is to hold two of the light field's or more: there must be something to filter away.
    tile = min(TILE, int(sizes[longer] / steps[longer] / 2))
    if tile < SMALLEST_TILE:
        raise InputError(
            f"the views are too small: what all of them see is {tile} pixels wide if two of theirs make one, and "
            f"a tile needs {SMALLEST_TILE} or more. Give views of more pixels, or with less parallax"
        )
    of_a_view = sizes[longer] / tile
    share = of_a_view / (stop[longer] + of_a_view)
    shadow = [each * share / (1 - share) for each in stop]
    tiles = [max(int(size / each + 1e-6), 2) for size, each in zip(sizes, shadow, strict=True)]
    pitch = shadow[1] / VIEWS, shadow[0] / VIEWS
    well = WELL * pitch[0] * pitch[1]
    electronics = Electronics(
        full_well=well, gain=60_000 / well, black_level=1000.0, bit_depth=16, read_noise=READ_NOISE
    )
    return Camera(
        [
            Lens(bench.focal_length),
            Mask(Open(), width=stop[0], height=stop[1], name="stop"),
            Mask(CosineSum((share * stop[0], share * stop[1]), HARMONICS), z=d * (1 - share), name="cosines"),
        ],
        Sensor(d, (VIEWS * tiles[1], VIEWS * tiles[0]), pitch, electronics=electronics),
    )


def on_axis(light_field: LightField) -> LightField:
    """The light field with its views from left to right and from top to bottom about the axis, as decoded ones."""
    nv, nu = light_field.shape[:2]
    linear = light_field.frame.linear
    ordered = light_field[:: 1 if linear[1, 1] > 0 else -1, :: 1 if linear[0, 0] > 0 else -1]
    u, v, _, _ = ordered.frame([(nu - 1) / 2, (nv - 1) / 2, 0, 0])
    return ordered.transformed(Affine.translation(-u, -v, 0, 0))


def recorded(camera: Camera, parts: Iterable[LightField]) -> Image:
    """The recording of a light field that comes in parts: the sum of theirs."""
    total: Image | None = None
    found = 0.0  # the share of the rays that the camera asks for
    with warnings.catch_warnings():
        # A part of the views leaves the rest of the sensor dark; all of them together do not.
        warnings.simplefilter("ignore", ResultWarning)
        for part in parts:
            # Views fill the aperture as they are, one a cell: nothing is invented between them.
            image = camera.capture(part, between_views="none", interpolation="cubic")
            found += 1 - image.missing_rays
            total = image if total is None else replace(image, values=total.to_numpy() + image.to_numpy())
    assert total is not None  # there are parts
    return replace(total, missing_rays=max(1 - found, 0.0))


def transmission(camera: Camera, calibration: Image) -> float:
    """The share of the light that passes the cosines, by the calibration recording."""
    width, height = (PINHOLE_SHARE * period for period in HeterodyneGeometry.of(camera).aperture_period)
    return float(calibration.to_numpy().mean(dtype=np.float64)) / (width * height / camera.sensor.z**2)


def _own_fineness(light_field: LightField, camera: Camera) -> float:
    """How many times as fine as decoded views the light field's own are, at the sensor."""
    carrier = HeterodyneGeometry.of(camera).carrier
    landed = [places_on_sensor(light_field, camera, axis)[0, :2] for axis in (0, 1)]
    return min(1 / (carrier[axis] * float(abs(np.diff(landed[axis])[0]))) for axis in (0, 1))


# --- what came of it ---


def _equally_sampled(bench: Bench, light_field: LightField, camera: Camera) -> LightField:
    """What pinholes at the decoded views' places see, where the scene is known; else the views that there are."""
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


def _psnr(views: LightField, truth: LightField, white: float) -> NDArray[np.float64]:
    error = np.asarray(views.values, np.float64) - np.asarray(truth.values)
    power = np.mean(error**2, axis=tuple(range(2, error.ndim)))
    return np.asarray(-10 * np.log10(np.maximum(power, 1e-20) / white**2))


def _distances(bench: Bench) -> dict[str, float]:
    return dict(zip(PLACES, (bench.near, bench.middle, bench.far), strict=True))


def _findings(
    bench: Bench,
    taken: dict[str, Decoded],
    pictures: dict[str, dict[str, Floats]],
    white: float,
    sharper: float,
    passed: float,
) -> Iterator[Finding]:
    fitting, inner = taken["fitting"], f"inner {VIEWS - 2}×{VIEWS - 2} views against the true ones, mean PSNR"
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
        f"scene {sharper:.2g} times as fine as tiles hold: {inner}",
        "",
        taken["sharper"].inner,
        "dB",
        None,
        f"its aliasing costs {fitting.inner - taken['sharper'].inner:.1f} dB, focused "
        f"{away(bench.masked_focus)}: strong tiles spill into weak ones",
    )
    yield Finding(
        f"scene that fits, with photon noise: {inner}",
        "",
        taken["noisy"].inner,
        "dB",
        None,
        "weak tiles are raised to the strength of the others, their noise with them",
    )
    for place, distance in _distances(bench).items():
        clean, noisy = (
            psnr(pictures[name][place], pictures["true"][place], white) for name in ("decoded", "noisy")
        )
        yield Finding(
            f"refocused {place} ({away(distance)}) against the true views refocused, PSNR",
            "",
            clean,
            "dB",
            None,
            f"with noise {noisy:.1f} dB: all views average it",
        )
    yield Finding(
        "light that the mask lets through, by the calibration recording",
        f"½·½ = {TRANSMITTED}, the mean of the cosines, within 1 %",
        passed,
        "",
        abs(passed / TRANSMITTED - 1) < 0.01,
        "two stops are lost",
    )


def _pictures(
    camera: Camera,
    taken: dict[str, Decoded],
    truth: LightField,
    pictures: dict[str, dict[str, Floats]],
    white: float,
    sharper: float,
) -> tuple[tuple[Picture, ...], ...]:
    compared = {
        "true": (truth, None),
        "decoded": (taken["fitting"].views, taken["fitting"].decibels),
        f"decoded, scene {sharper:.2g} times as fine": (taken["sharper"].views, taken["sharper"].decibels),
        "decoded, photon noise": (taken["noisy"].views, taken["noisy"].decibels),
    }
    rows, columns = truth.shape[2:4]
    mosaic = np.moveaxis(np.asarray(taken["fitting"].views.values), 1, 2)
    mosaic = mosaic.reshape(VIEWS * rows, VIEWS * columns, *mosaic.shape[4:])
    return (
        (
            Picture(
                "recording",
                "Mask and recording",
                "The orange square shows what the mask wrote most into, magnified, and what a mean over one "
                "period of the mask takes away there: the mask’s dots, where things are out of focus. What is "
                "in focus passes the mask over a whole period, and shows none.",
                heterodyne_figures.recording_figure(camera, taken["fitting"].image, white),
            ),
        ),
        (
            Picture(
                "spectrum",
                "Spectra of the recordings",
                "Tiles around each whole multiple (n<sub>x</sub>, n<sub>y</sub>) of the carrier: "
                f"{VIEWS}×{VIEWS} slices of the light field’s spectrum. Left, the scene that fits: tiles stand "
                f"apart. Right, one {sharper:.2g} times as fine: strong tiles cover their neighbours.",
                heterodyne_figures.spectra_figure(
                    camera,
                    {
                        "scene that fits the tiles": taken["fitting"].image,
                        f"scene {sharper:.2g} times as fine as tiles hold": taken["sharper"].image,
                    },
                ),
            ),
        ),
        (
            Picture(
                "views",
                "All decoded views",
                f"{VIEWS}×{VIEWS} views of {columns}×{rows} pixels of the scene that fits, as they lie in the "
                "aperture.",
                figures.values_shown(mosaic, white),
            ),
        ),
        (
            Picture(
                "compared",
                "Views, true and decoded",
                "Two views of the middle row, from both ends of the aperture.",
                heterodyne_figures.views_figure(compared, white),
            ),
        ),
        (
            Picture(
                "refocused",
                "Refocused",
                "From the decoded views of the scene that fits, and from the true ones.",
                heterodyne_figures.refocus_figure(
                    {"from decoded views": pictures["decoded"], "from the true views": pictures["true"]}, white
                ),
            ),
        ),
    )


def _text(bench: Bench, camera: Camera, sharper: float) -> str:
    geometry, sensor, mask = HeterodyneGeometry.of(camera), camera.sensor, camera.elements[-1]
    assert isinstance(mask, Mask)
    stop, tile = geometry.aperture_period, geometry.carrier[0] * mm
    gap = sensor.z - mask.z
    full_well = WELL * sensor.pitches[0] * sensor.pitches[1]
    truth = (
        "are what pinholes at the places of the decoded views see of the scene"
        if bench.scene is not None
        else f"are the light field’s own views, the first {HARMONICS} harmonics across the aperture summed at the "
        "places of the decoded ones"
    )
    return paragraphs(
        [
            f"<b>The camera.</b> A lens of f = {length(bench.focal_length)} behind a square stop of "
            f"{length(stop[0])}, focused {away(bench.masked_focus)}, and, {length(gap)} before "
            f"the sensor, a transparency with {HARMONICS} cosines each way, as many as the published one has; "
            f"the first has a period of {length(stop[0] * gap / sensor.z)}. Seen from one place on the "
            "sensor, the stop sweeps over just one period: light from the left of the lens has passed another "
            "part of the cosine than light from the right. So the mask writes the direction of light into the "
            "picture, as a radio writes sound on its carrier.",
            "<b>Decoding.</b> In the spectrum of the recording, cosines n<sub>x</sub> and n<sub>y</sub> from "
            f"−{HARMONICS} to {HARMONICS} lay a tile around ({tile:.3g}·n<sub>x</sub>, "
            f"{geometry.carrier[1] * mm:.3g}·n<sub>y</sub>) cycles per mm: the slice of the light field’s 4-D "
            "spectrum at n<sub>x</sub> and n<sub>y</sub> periods across the aperture. Each tile is cut out and "
            "divided by that of a calibration recording (a white scene through a pinhole, which shows the "
            f"mask’s shadow alone); the stack of tiles, transformed back, is {VIEWS}×{VIEWS} views. The sensor "
            f"has {sensor.shape[1]}×{sensor.shape[0]} pixels of {length(sensor.pitches[1])}, a view "
            f"{geometry.shape[1]}×{geometry.shape[0]}, of which {BORDER:.0%} at each edge, where recordings are "
            "faded out, are cut off; the authors’ example has 2133×1719 pixels, and views of 237×191.",
            f"<b>The scene that fits.</b> A tile reaches {tile / 2:.3g} cycles per mm to each side. So the views "
            "were low-passed before the recording: convolved, on the sensor, with sinc², whose transfer "
            "function falls along a straight line to 0 at the end of the tile, and which makes no light "
            f"negative. Across the aperture nothing was filtered. The <i>true views</i> {truth}, low-passed "
            "alike. Decoding knows nothing of them; PSNR counts from the brightest true light.",
            f"<b>A sharper scene</b>, low-passed at {sharper:.2g} times that frequency, nearly as fine as the "
            "light field that is recorded, is compared with the same true views: it does not count that views "
            "have few pixels, only what falls into wrong tiles. The outermost carrier has "
            f"1/{(2 * HARMONICS) ** 2} of the strength of the middle one, so that what the middle tile spills "
            f"there is raised {(2 * HARMONICS) ** 2} times. How much it costs depends on what is in focus. In "
            "the built-in scene it is the leaves in front, which is the kinder case for a sharp scene: the lens "
            "blurs the chart’s fine print, and less is left to alias. It is the unkinder one for the scene that "
            "fits, in which what is far out of focus rings. Copies of the scene by the recorded field’s "
            f"{SAMPLES} samples in a view’s pixel enter the number, too. This camera needs its scene kept within "
            "the tiles: by defocus, by its lens or by a filter.",
            f"<b>Noise</b> is that of photons in wells of {full_well / 1000:.0f} 000 electrons "
            f"({WELL * um**2:.0f} for a µm²), {READ_NOISE:g} electrons of reading, and 90 % exposure; the "
            "calibration has none, since many can be averaged. Even noise comes out "
            f"{geometry.noise_amplification:.0f} times as strong in the views as in the recording, each as a "
            "share of white (closed form), since weak tiles are raised to the strength of the others.",
        ]
    )


ENTRY = Entry(
    "heterodyne",
    "Dappled photography: the heterodyne light-field camera",
    "A. Veeraraghavan, R. Raskar, A. Agrawal, A. Mohan and J. Tumblin, Dappled photography: mask enhanced "
    "cameras for heterodyned light fields and coded aperture refocusing, SIGGRAPH 2007; C. Zhou, Virtual "
    "Computational Camera, 2009, Example 2",
    "A mask of cosines near the sensor lays slices of the light field’s spectrum side by side as tiles of the "
    "recording’s; rearranged, they are the light field.",
    run,
)
