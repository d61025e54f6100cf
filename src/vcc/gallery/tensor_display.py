"""Tensor display: products of attenuating layers show a light field (Wetzstein et al. 2012)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError, without_result_warnings
from vcc.base.measures import psnr
from vcc.base.units import mm, nm
from vcc.camera import Camera
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.light_field import LightField
from vcc.optics import Mask, Prism
from vcc.optics.sensor import Sensor
from vcc.showcase import figures
from vcc.showcase.bench import Bench

Array = NDArray[np.float32]

VIEWS = 5
"""Directions each way."""
PITCH, GAP = 0.25 * mm, 5 * mm
"""Of the cells of the layers, and between layers: from view to view a layer moves by one cell against the next."""
STEP = PITCH / GAP
"""Slope from one direction to the next."""
WAVELENGTH = 550 * nm
BRIGHTNESS = 0.3
"""Radiance of white in the target, as a share of the backlight."""
FRAMES = 6
SMALLEST = 32
"""Least side of a target, pixels."""
LEAST_GAIN = 3.0
"""Least gain, dB: the same as for the other cameras of the gallery."""
NARROW = 1e-3
"""Width of a traced direction, as a share of a step."""
SAMPLES = 64
"""Rays per cell of a traced direction, 8 along a side."""
SEED = 12


@dataclass(frozen=True, eq=False)
class Display:
    """Layers, and the light that leaves them: L = mean over frames of the product over layers.

    Args:
        layers: transmissions, 0 to 1, (frames, layers, rows, columns); `margin` cells wider than the target.
    """

    layers: Array

    @property
    def margin(self) -> int:
        """Cells beyond the target on each side."""
        return margin(self.layers.shape[1])

    def through(self, row: int, column: int, leave_out: int | None = None) -> Array:
        """The products in a direction, (frames, rows, columns of the target).

        Args:
            row: of the view, 0 to VIEWS − 1.
            column: likewise.
            leave_out: a layer that counts as clear.
        """
        made: Array = np.ones(self.layers[:, 0][self.seen(0, row, column)].shape, np.float32)
        for layer in range(self.layers.shape[1]):
            if layer != leave_out:
                made *= self.layers[:, layer][self.seen(layer, row, column)]
        return made

    def seen(self, layer: int, row: int, column: int) -> tuple[slice, slice, slice]:
        """The part of a layer that a direction sees."""
        down, right = (self.margin + moved(layer, self.layers.shape[1], view) for view in (row, column))
        rows, columns = (side - 2 * self.margin for side in self.layers.shape[2:])
        return slice(None), slice(down, down + rows), slice(right, right + columns)

    def views(self) -> Array:
        """The light field, (VIEWS, VIEWS, rows, columns)."""
        return np.stack(
            [np.stack([self.through(row, column).mean(axis=0) for column in range(VIEWS)]) for row in range(VIEWS)]
        )


def moved(layer: int, layers: int, view: int) -> int:
    """Cells by which a direction sees a layer moved; the middle layer of an odd number stays."""
    return (layer - layers // 2) * (view - VIEWS // 2)


def margin(layers: int) -> int:
    """Cells that layers need beyond the target."""
    return layers // 2 * (VIEWS // 2)


def factorised(target: Array, layers: int, frames: int, steps: int) -> Display:
    """The layers that show a light field best, by multiplicative updates.

    Minimises Σ (L − target)² over transmissions of 0 to 1: each layer in turn is multiplied by the ratio of
    back-projections Aᵀ target / Aᵀ L (Lee and Seung 2001, Wetzstein et al. 2012), and clipped at 1.

    Args:
        target: (VIEWS, VIEWS, rows, columns), at most 1.
        layers: their number.
        frames: shown in turn, faster than the eye follows.
        steps: number of updates of each layer.
    """
    rows, columns = (side + 2 * margin(layers) for side in target.shape[2:])
    start = np.random.default_rng(SEED).uniform(0.3, 0.9, (frames, layers, rows, columns))
    display = Display(start.astype(np.float32))
    for _ in range(steps):
        for layer in range(layers):
            wanted, shown = np.zeros((2, frames, rows, columns), np.float32)
            for row in range(VIEWS):
                for column in range(VIEWS):
                    others = display.through(row, column, leave_out=layer)
                    place = display.seen(layer, row, column)
                    wanted[place] += target[row, column] * others
                    shown[place] += (display.layers[:, layer][place] * others).mean(axis=0) * others
            display.layers[:, layer] *= wanted / np.maximum(shown, np.float32(1e-6))
            np.clip(display.layers[:, layer], 1e-4, 1, out=display.layers[:, layer])
    return display


def traced(layers: Array, row: int, column: int) -> Array:
    """One frame in a direction, (rows, columns of the target): rays through masks, as a camera without a lens.

    Args:
        layers: of the frame, (layers, rows, columns).
        row: of the view.
        column: likewise.
    """
    count, rows, columns = layers.shape
    width, height = columns * PITCH, rows * PITCH
    tilt = (STEP * (column - VIEWS // 2), STEP * (row - VIEWS // 2))
    # A parallel backlight, tilted; the sensor touches the last layer.
    wide = 4 * max(width, height)
    light = LightField.from_views(np.ones((1, 1, 1, 1), np.float32), wide, NARROW * STEP, math.inf)
    masks = [Mask(each, width, height, z=GAP * place) for place, each in enumerate(layers)]
    sensor = Sensor(GAP * (count - 1) + GAP * 1e-6, (rows, columns), PITCH)
    with without_result_warnings():
        # A bare sensor asks for rays of all directions, and the backlight is parallel on purpose.
        images = [
            Camera([Prism(tilt), *stack], sensor).capture(light, method="rays", samples=SAMPLES).to_numpy()
            for stack in (masks, [])
        ]
    ratio = images[0] / np.maximum(images[1], images[1].max() * 1e-3)
    around = margin(count)
    down, right = (around + moved(count - 1, count, view) for view in (row, column))
    return np.asarray(
        ratio[down : down + rows - 2 * around, right : right + columns - 2 * around], dtype=np.float32
    )


@dataclass(frozen=True, eq=False)
class Measured:
    """What a run found.

    Args:
        target: the light field, (VIEWS, VIEWS, rows, columns), white `BRIGHTNESS`.
        shown: light fields of displays, by number of layers and frames.
        barrier: that of a parallax barrier, raised to the same brightness.
        display: the one with all layers and frames.
        error: root mean square difference of traced views from products of layers.
    """

    target: Array
    shown: dict[tuple[int, int], Array]
    barrier: Array
    display: Display
    error: float

    def decibels(self, shown: Array) -> float:
        """PSNR over all views; the target's white is the peak."""
        return psnr(shown, self.target, BRIGHTNESS)


@dataclass(frozen=True)
class Run:
    """Factorise a light field into layers, and look at them from all directions.

    Args:
        side: largest side of the views, pixels.
        steps: updates of each layer.
    """

    side: int = 250
    steps: int = 40

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Show the light field on displays with different layers and frames, and measure."""
        target = target_of(bench, self.side)
        kinds = ((1, 1), (2, 1), (3, 1), (2, FRAMES), (3, FRAMES))
        advance = Steps(progress, len(kinds) + 1)
        progress(0, advance.total)
        shown, display = {}, Display(np.ones((1, 1, 1, 1), np.float32))
        for layers, frames in kinds:
            display = factorised(target, layers, frames, self.steps)
            shown[layers, frames] = display.views()
            advance()
        differences = [
            traced(display.layers[0], row, column) - display.through(row, column)[0]
            for row, column in ((0, 0), (VIEWS // 2, VIEWS // 2), (VIEWS - 1, 1))
        ]
        error = float(np.sqrt(np.mean(np.square(differences))))
        advance()
        measured = Measured(target, shown, barrier(target), display, error)
        return Result(
            prose(__name__, run=self, shape=target.shape[2:]),
            _pictures(measured),
            tuple(_findings(measured)),
            bench.assumed,
        )


def target_of(bench: Bench, side: int) -> Array:
    """VIEWS×VIEWS views of a light field, grey, averaged to at most ``side`` pixels, white `BRIGHTNESS`.

    Raises:
        InputError: too few or too small views, or dark ones.
    """
    field = bench.light_field
    rows, columns, nt, ns = field.shape[:4]
    if min(rows, columns) < VIEWS or min(nt, ns) < SMALLEST:
        raise InputError(
            f"this light field has {rows}×{columns} views of {nt}×{ns} pixels: the display shows {VIEWS}×{VIEWS} "
            f"views, and needs {SMALLEST}×{SMALLEST} pixels or more"
        )
    chosen = [
        np.arange(VIEWS) * (count // VIEWS) + (count - 1 - (VIEWS - 1) * (count // VIEWS)) // 2
        for count in (rows, columns)
    ]
    views = np.asarray(field.values)[np.ix_(*chosen)].astype(np.float32)
    grey = views if views.ndim == 4 else views.mean(axis=4)
    part = math.ceil(max(nt, ns) / side)
    nt, ns = nt // part, ns // part
    small = grey[:, :, : nt * part, : ns * part].reshape(VIEWS, VIEWS, nt, part, ns, part).mean(axis=(3, 5))
    white = float(np.percentile(small, 99.5))
    if not white > 0:
        raise InputError("the views of this light field are dark: there is nothing to show")
    return np.asarray(BRIGHTNESS * np.clip(small / white, 0, 1), dtype=np.float32)


def barrier(target: Array) -> Array:
    """Views of a parallax barrier: behind each hole are VIEWS×VIEWS cells, one for each direction.

    A view so has a cell for every VIEWS×VIEWS, its mean over these; brightness is not scored.
    """
    made = target.copy()
    for top in range(0, target.shape[2], VIEWS):
        for left in range(0, target.shape[3], VIEWS):
            block = np.s_[:, :, top : top + VIEWS, left : left + VIEWS]
            made[block] = target[block].mean(axis=(2, 3), keepdims=True)
    return made


def _findings(measured: Measured) -> Iterator[Finding]:
    decibels = {kind: measured.decibels(shown) for kind, shown in measured.shown.items()}
    best = decibels[3, FRAMES]
    yield Finding(
        "views through the layers, rays traced through masks, against products of layers: root mean square "
        "difference, share of the backlight",
        f"equal, within 1/(2·{SAMPLES}), half a ray of a cell",
        measured.error,
        "",
        measured.error <= 1 / (2 * SAMPLES),
        "one frame, three directions",
    )
    yield Finding(f"three layers, {FRAMES} frames: PSNR over all views", "", best, "dB")
    for words, kind, least, why in (
        ("one layer, a flat picture", (1, 1), LEAST_GAIN, "the mean of all views"),
        ("three layers in one frame", (3, 1), LEAST_GAIN, "a product of layers has rank 1 for each frame"),
        (f"two layers in {FRAMES} frames", (2, FRAMES), 0.0, "more layers reach more depth"),
    ):
        yield Finding.gain(f"the same: gain over {words}", best, decibels[kind], least, why)
    yield Finding.gain(
        "the same: gain over a parallax barrier of the same cells",
        best,
        measured.decibels(measured.barrier),
        LEAST_GAIN,
        f"the barrier has one cell in {VIEWS**2} for each view",
    )
    light = float(measured.shown[3, FRAMES].mean() / measured.target.mean())
    yield Finding(
        "brightness against that of the barrier",
        "brighter: above 1",
        light * BRIGHTNESS * VIEWS**2,
        "",
        light * BRIGHTNESS * VIEWS**2 > 1,
        f"white is {BRIGHTNESS:.0%} of the backlight; the barrier passes 1/{VIEWS**2}",
    )


def _pictures(measured: Measured) -> tuple[tuple[Picture, ...], ...]:
    corner = (0, VIEWS - 1)
    rows: list[list[tuple[str, figures.Shown]]] = []
    named = (
        ("target", measured.target),
        (f"3 layers, {FRAMES} frames", measured.shown[3, FRAMES]),
        ("3 layers, 1 frame", measured.shown[3, 1]),
        ("1 layer", measured.shown[1, 1]),
        ("parallax barrier", measured.barrier),
    )
    kept = [named[0], named[1], named[2]], [named[3], named[4]]
    for row in kept:
        line = [(_titled(words, shown, measured), _shown(shown[corner])) for words, shown in row]
        if len(line) < 3:
            error = np.abs(measured.shown[3, FRAMES][corner] - measured.target[corner])
            line.append((f"3 layers, {FRAMES} frames: error × 5", _shown(5 * error)))
        rows.append(line)
    return below(
        Picture(
            "views",
            "The view from the upper right corner",
            "PSNR is over all views. The barrier is shown at the brightness of the others.",
            figures.table((9.0, 6.4), rows),
        ),
        Picture("layers", "The layers in two frames", "From back to front.", _layers(measured.display)),
    )


def _titled(words: str, shown: Array, measured: Measured) -> str:
    return words if shown is measured.target else f"{words}: {measured.decibels(shown):.1f} dB"


def _layers(display: Display) -> figures.Figure:
    frames: Sequence[int] = (0, 1)
    rows = [
        [
            (f"layer {place + 1}" if frame == 0 else "", figures.grey_shown(each))
            for place, each in enumerate(display.layers[frame])
        ]
        for frame in frames
    ]
    labels = [f"frame {frame + 1}" for frame in frames]
    return figures.table((9.0, 6.4), rows, labels)


def _shown(view: Array) -> figures.Shown:
    return figures.grey_shown(np.clip(view / BRIGHTNESS, 0, 1))


ENTRY = Entry(
    "tensor-display",
    "Tensor display: layers and frames that show a light field",
    "G. Wetzstein, D. Lanman, M. Hirsch and R. Raskar, Tensor displays: compressive light field synthesis using "
    "multilayer displays with directional backlighting, ACM Transactions on Graphics 31 (SIGGRAPH 2012)",
    "Stacked attenuating layers show a light field by products of their pixels; several frames in quick "
    "succession raise the rank, and with it quality, at full resolution and brighter than a barrier.",
    Run(),
)
