"""Wavefront coding: a cubic phase plate makes the blur alike at all depths (Dowski and Cathey 1995)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.camera import Camera
from vcc.demo import figures, story
from vcc.demo.bench import Bench
from vcc.errors import InputError
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, paragraphs
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, Mask, PhasePlate
from vcc.patterns import Open
from vcc.plot.tracing import trace
from vcc.sensor import Sensor
from vcc.surfaces import Cubic
from vcc.units import mm, nm

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

PUPIL = 10 * mm
"""Width of the square opening."""
WAVELENGTH = 550 * nm
RATIO = 3.0
"""α over the largest misfocus ψ: the paper's example has α = 90, and ψ up to 30."""
DEPTHS = 7
NOISE = 0.005
"""Standard deviation of the noise of all recordings, as a share of white."""
TARGET = 240
"""Largest side of the flat target, pixels."""
RAYS = 800
"""Rays across the opening of which a point-spread function is made."""


@dataclass(frozen=True)
class Pair:
    """The camera with the plate and the one without, alike otherwise.

    Args:
        focus: distance on which both are focused, metres.
        depths: distances over which they are compared, metres, nearest first.
        alpha: of the plate, radians.
        misfocus: ψ at the ends of the range, radians.
        coded: the elements with the plate.
        plain: those without.
    """

    focus: float
    depths: tuple[float, ...]
    alpha: float
    misfocus: float
    coded: tuple[Lens | PhasePlate, ...]
    plain: tuple[Lens | Mask, ...]


def run(bench: Bench, progress: Progress) -> Result:
    """Point-spread functions over depth, a flat target restored by one filter at each depth, and the scene."""
    pair = designed(bench)
    flat = _target(bench)
    steps = 2 * DEPTHS + 3
    decibels: dict[str, list[float]] = {}
    spreads: dict[str, list[Array]] = {}
    restored: dict[str, list[Array]] = {}
    sharp, _ = _recorded(bench, pair.plain, pair.focus, pair.focus, flat, noise=0)
    border = 0.14
    for part, (name, elements) in enumerate((("plain", pair.plain), ("coded", pair.coded))):
        spreads[name] = [_spread(bench, elements, pair.focus, depth) for depth in pair.depths]
        for depth in pair.depths:
            progress(part * DEPTHS + len(decibels.get(name, [])), steps)
            taken, noise = _recorded(bench, elements, pair.focus, depth, flat)
            picture = wiener(taken, spreads[name], noise)
            # Without a plate no filter may be better than one: it is credited with the better of the two.
            candidates = [picture, taken] if name == "plain" else [picture]
            best = max(candidates, key=lambda each: _psnr(each, sharp, border))
            restored.setdefault(name, []).append(best)
            decibels.setdefault(name, []).append(_psnr(best, sharp, border))
    progress(2 * DEPTHS, steps)
    middle = DEPTHS // 2
    alike = {
        name: min(float(np.corrcoef(each.ravel(), some[middle].ravel())[0, 1]) for each in some)
        for name, some in spreads.items()
    }
    gains = [decibels["coded"][end] - decibels["plain"][end] for end in (0, -1)]
    numbers = [
        Finding(
            "PSF over all depths against the focused one, with the plate: lowest correlation",
            "alike: 0.95 or more",
            alike["coded"],
            "",
            alike["coded"] >= 0.95,
            f"defocus takes another part of the parabola, ψ/(3α) = {1 / (3 * RATIO):.2f} of the half width away",
        ),
        Finding("the same without the plate", "not alike: below 0.95", alike["plain"], "", alike["plain"] < 0.95),
    ]
    for end, gain in zip((0, -1), gains, strict=True):
        numbers.append(
            Finding(
                f"flat target {story.away(pair.depths[end])}, one filter for all depths: gain over no plate",
                "5 dB or more",
                gain,
                "dB",
                gain >= 5,
                f"{decibels['coded'][end]:.1f} dB against {decibels['plain'][end]:.1f} dB; noise limits",
            )
        )
    cost = decibels["plain"][middle] - decibels["coded"][middle]
    numbers.append(Finding("what the plate costs in focus", "", cost, "dB", None, "the filter amplifies noise"))
    pictures = (
        (
            Picture(
                "psf",
                "Point-spread functions",
                "From near to far, rays traced; above without the plate, below with it.",
                _psf_figure(spreads, pair),
            ),
        ),
        (
            Picture(
                "target",
                "A flat target near, in focus and far",
                "Restored by one filter each.",
                _target_figure(restored, decibels, pair, border),
            ),
        ),
        _scene(bench, pair, spreads, progress, steps),
    )
    text = paragraphs(
        [
            f"A lens of f = {story.length(bench.focal_length)} with a square opening of "
            f"{story.length(PUPIL)}, focused "
            f"{story.away(pair.focus)}, and a plate of phase α·((x/R)³ + (y/R)³) in it. Over the range "
            "of depths the "
            f"misfocus is ψ = ±{pair.misfocus:.0f} rad, and α = {RATIO:g}·ψ = {pair.alpha:.0f} rad, the "
            "ratio of the "
            "paper’s example (α = 90, ψ up to 30).",
            f"A flat target, the middle view of the light field, is recorded at {DEPTHS} depths with noise of "
            f"{NOISE:.1%} of white. One Wiener filter for all depths, made of all PSFs and a 1/f² "
            "prior, restores each. "
            "The camera without the plate has a filter made likewise, or none where that is better. Decibels are "
            "against the sharp lens’s picture without noise. Rays, no diffraction: the fringes of the "
            "true PSF are "
            "averaged by pixels as large as these.",
        ]
    )
    return Result(text, pictures, tuple(numbers), bench.assumed)


def designed(bench: Bench) -> Pair:
    """Focused in the middle of the range of 1/Z, with a plate for its ends."""
    near, far = 1 / bench.near, 1 / bench.far
    reach = (near - far) / 2
    misfocus = math.pi * (PUPIL / 2) ** 2 / WAVELENGTH * reach
    if RATIO * misfocus < 20:
        raise InputError(
            f"the scene's depths reach from {bench.near:.3g} to {bench.far:.3g} m, a misfocus of "
            f"{misfocus:.2g} rad "
            "only: nothing is out of focus. Give a light field with more parallax"
        )
    alpha = RATIO * misfocus
    lens = Lens(bench.focal_length)
    plate = PhasePlate(Cubic.from_alpha(alpha, PUPIL / 2, WAVELENGTH), width=PUPIL)
    vergences = np.linspace(near, far, DEPTHS)
    depths = tuple(1 / float(v) if v > 1e-9 else math.inf for v in vergences)
    return Pair(2 / (near + far), depths, alpha, misfocus, (lens, plate), (lens, Mask(Open(), width=PUPIL)))


def wiener(picture: Array, spreads: Sequence[Array], noise: float) -> Array:
    """The linear filter of least mean squared error over several PSFs, one for all: Σ H*/(Σ|H|² + n·N/S).

    Args:
        picture: (rows, columns[, channels]), white 1.
        spreads: PSFs of an odd side, each of sum 1 and centred on its middle pixel.
        noise: standard deviation.
    """
    reach = spreads[0].shape[0]
    pad = [(reach, reach), (reach, reach)] + [(0, 0)] * (picture.ndim - 2)
    padded = np.pad(picture, pad, mode="symmetric")
    shape = padded.shape[:2]
    transfers = []
    for spread in spreads:
        kernel = np.zeros(shape)
        kernel[:reach, :reach] = spread
        transfers.append(np.fft.fft2(np.roll(kernel, (-(reach // 2), -(reach // 2)), (0, 1))))
    fy, fx = np.fft.fftfreq(shape[0])[:, None], np.fft.fftfreq(shape[1])[None, :]
    # Natural pictures: power 1/f², of the variance that this one has (Field 1987).
    prior = 1 / (fy**2 + fx**2 + (2 / min(shape)) ** 2)
    prior *= float(np.var(picture)) / prior.mean()
    power = sum(np.abs(transfer) ** 2 for transfer in transfers)
    numerator = sum(np.conj(transfer) for transfer in transfers)
    response = numerator / (power + len(spreads) * noise**2 / prior)
    if picture.ndim == 3:
        response = response[..., None]
    result = np.fft.ifft2(np.fft.fft2(padded, axes=(0, 1)) * response, axes=(0, 1)).real
    return np.asarray(result[reach:-reach, reach:-reach])


def _sensor(bench: Bench, focus: float, shape: tuple[int, int]) -> Sensor:
    distance = bench.image_distance(focus)
    slope = abs(float(bench.light_field.frame.linear[2, 2]))
    return Sensor(distance, shape, slope * distance)


def _spread(bench: Bench, elements: Sequence[Lens | PhasePlate | Mask], focus: float, depth: float) -> Array:
    """The point-spread function of a point on the axis, on the sensor's pixels: rays traced, counted."""
    sensor = _sensor(bench, focus, (1, 1))
    places = ((np.arange(RAYS) + 0.5) / RAYS - 0.5) * PUPIL
    u, v = (axis.ravel() for axis in np.meshgrid(places, places))
    rays = np.stack([u, v, u / depth, v / depth], axis=-1)
    landed = trace(Camera(elements, sensor), rays).positions[:, -1]
    slope = abs(float(bench.light_field.frame.linear[2, 2]))
    widest = PUPIL / 2 * sensor.z * abs(1 / bench.near - 1 / bench.far) / 2
    # The plate's own spot, 3·d·k·R² wide from the axis on, and the blur on top of it.
    cubic = next((e.surface for e in elements if isinstance(e, PhasePlate)), None)
    if isinstance(cubic, Cubic):
        widest += 3 * sensor.z * cubic.strength * (PUPIL / 2) ** 2
    reach = math.ceil(widest / (slope * sensor.z)) + 2
    edges = (np.arange(2 * reach + 2) - reach - 0.5) * slope * sensor.z
    counts, _, _ = np.histogram2d(landed[:, 1], landed[:, 0], bins=(edges, edges))
    return np.asarray(counts[::-1, ::-1] / counts.sum())  # upright, as the pictures are


def _target(bench: Bench) -> Array:
    """A flat target: the middle of the middle view, grey, 0 to 1."""
    nv, nu, nt, ns = bench.light_field.shape[:4]
    view = bench.light_field.view(nv // 2, nu // 2).to_numpy().astype(np.float64)
    grey = view if view.ndim == 2 else view.mean(axis=2)
    rows, columns = min(nt, TARGET), min(ns, TARGET)
    top, left = (nt - rows) // 2, (ns - columns) // 2
    grey = grey[top : top + rows, left : left + columns]
    return np.asarray(grey / np.percentile(grey, 99.5))


def _recorded(
    bench: Bench,
    elements: Sequence[Lens | PhasePlate | Mask],
    focus: float,
    depth: float,
    flat: Array,
    noise: float = NOISE,
) -> tuple[Array, float]:
    """The flat target at a depth, through a camera; upright, white 1, with noise; and how much of it.

    Beyond its border it goes on mirrored, so that the border of the recording holds no dark.
    """
    margin = min(64, *(side - 1 for side in flat.shape))
    wide = np.pad(flat, margin, mode="symmetric").astype(np.float32)
    slope = abs(float(bench.light_field.frame.linear[2, 2]))
    # All views of a flat thing are the same picture where they converge on it.
    views = np.ascontiguousarray(np.broadcast_to(wide, (2, 2, *wide.shape)))
    field = LightField.from_views(views, PUPIL, slope, depth, disparity_range=(0.0, 0.0))
    camera = Camera(elements, _sensor(bench, focus, (flat.shape[0], flat.shape[1])))
    image = camera.capture(field, method="rays", samples=128)
    return _noisy(image, camera, noise)


def _noisy(image: Image, camera: Camera, noise: float) -> tuple[Array, float]:
    """Upright values, 1 for radiance 1 through the whole opening, with noise; and that of the rays with it."""
    scale = camera.sensor.z**2 / PUPIL**2
    values = image.upright().to_numpy().astype(np.float64) * scale
    noisy = values + noise * np.random.default_rng(0).standard_normal(values.shape)
    return noisy, math.hypot(noise, image.sampling_error * scale)


def _psnr(picture: Array, truth: Array, border: float) -> float:
    rows, columns = (round(border * n) for n in truth.shape[:2])
    inner = np.s_[rows : truth.shape[0] - rows, columns : truth.shape[1] - columns]
    return -10 * math.log10(max(float(np.mean((picture[inner] - truth[inner]) ** 2)), 1e-20))


def _psf_figure(spreads: dict[str, list[Array]], pair: Pair) -> Figure:
    side = min(max(some[0].shape[0] for some in spreads.values()), 61)
    figure = figures.new_figure(1.5 * DEPTHS, 3.4)
    grid = figure.subplots(2, DEPTHS)
    for row, (name, words) in enumerate((("plain", "no plate"), ("coded", "cubic plate"))):
        for axes, spread, depth in zip(grid[row], spreads[name], pair.depths, strict=True):
            wide = np.pad(spread, max((side - spread.shape[0]) // 2, 0))
            shown = np.sqrt(wide / wide.max()).astype(np.float32)
            figures.put(axes, shown, story.away(depth) if row == 0 else "", cmap="gray", vmin=0, vmax=1)
        grid[row, 0].set_ylabel(words, fontsize=figures.LABEL)
    return figure


def _target_figure(
    restored: dict[str, list[Array]], decibels: dict[str, list[float]], pair: Pair, border: float
) -> Figure:
    figure = figures.new_figure(9.0, 6.4)
    grid = figure.subplots(2, 3)
    for row, (name, words) in enumerate((("plain", "no plate"), ("coded", "cubic plate, one filter"))):
        for axes, place in zip(grid[row], (0, DEPTHS // 2, -1), strict=True):
            picture = restored[name][place]
            rows, columns = (int(border / 2 * n) for n in picture.shape)
            inner = picture[rows : picture.shape[0] - rows, columns : picture.shape[1] - columns]
            title = f"{words}, {story.away(pair.depths[place])}: {decibels[name][place]:.1f} dB"
            shown = np.clip(inner, 0, 1).astype(np.float32) ** np.float32(1 / 2.2)
            figures.put(axes, shown, title, cmap="gray", vmin=0, vmax=1)
    return figure


def _scene(
    bench: Bench, pair: Pair, spreads: dict[str, list[Array]], progress: Progress, steps: int
) -> tuple[Picture, ...]:
    """The light field itself through both cameras, and the coded recording restored."""
    shape = tuple(int(0.94 * n) for n in bench.light_field.shape[2:4])
    sensor = _sensor(bench, pair.focus, (shape[0], shape[1]))
    recordings, noise = {}, NOISE
    for done, (name, elements) in enumerate((("plain", pair.plain), ("coded", pair.coded))):
        progress(2 * DEPTHS + 1 + done, steps)
        camera = Camera(elements, sensor)
        recordings[name], noise = _noisy(
            camera.capture(bench.light_field, method="rays", samples=128), camera, NOISE
        )
    white = float(np.percentile(recordings["plain"], 99.5)) if bench.scene is None else 1.0
    whole = {
        "plain": ("No plate", recordings["plain"]),
        "coded": ("With the plate, as recorded", recordings["coded"]),
        "restored": ("Restored by the one filter", wiener(recordings["coded"], spreads["coded"], noise)),
    }
    return tuple(
        Picture(f"scene-{name}", title, "", _shown(picture / white)) for name, (title, picture) in whole.items()
    )


def _shown(picture: Array) -> figures.Shown:
    from vcc.affine import Affine

    return figures.shown(Image(picture.astype(np.float32), Affine.scaling(1, 1), inverted=False), 1.0)


ENTRY = Entry(
    "wavefront-coding",
    "Wavefront coding",
    "E. R. Dowski and W. T. Cathey, Extended depth of field through wave-front coding, Applied Optics 34, 1995",
    "A cubic phase plate makes the blur alike at all depths, so that one filter restores them all.",
    run,
)
