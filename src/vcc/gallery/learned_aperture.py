"""A learned aperture: a code for depth from one recording, trained with its network (Shedligeri et al. 2017)."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import lazy_import
from vcc.base.errors import InputError
from vcc.base.units import mm, um
from vcc.camera import Camera
from vcc.gallery import flat_target
from vcc.gallery.diffusercam import drawn
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.gallery.published_codes import VEERARAGHAVAN
from vcc.light_field import LightField
from vcc.optics import Lens, Mask
from vcc.optics.electronics import Electronics
from vcc.optics.sensor import Sensor
from vcc.recording import expose_image
from vcc.showcase import figures
from vcc.showcase.bench import Bench

Array = NDArray[Any]

VIEWS = 7
"""Cells of the code each way; a view of the light field for each."""
OPENING, FOCAL_LENGTH, FOCUS, PITCH = 14 * mm, 50 * mm, 2.0, 20 * um
BLURS = tuple(float(width) for width in range(2, 10))
"""Widths of the blur through the whole opening, pixels: one for each distance, all nearer than the focus."""
PATCH, MARGIN = 32, 8
"""Pixels of a patch along a side, and of its sharp surroundings that blur into it."""
CONTRAST = 0.08
"""Least standard deviation of a sharp patch, white 1: others show no blur."""
ELECTRONICS = Electronics(full_well=10_000, gain=0.4, bit_depth=12, read_noise=2.5)
FULL = 0.9 * ELECTRONICS.full_well
"""Electrons of white through the whole opening."""
TRAINING_SEEDS, TEST_SEED, CODE_SEEDS = (31, 32, 33, 34), 41, (1, 2)
BETTER = 0.8
"""Ratio of errors from which a code counts as better: rounding alone changes errors of one start by a fifth."""
SHARE = 0.5
"""Of the cells, open: the light of all codes but the open and the published one."""


def distance_of(blur: float) -> float:
    """The distance, nearer than the focus, whose blur is so wide: w·slope = A·(1/Z − 1/F)."""
    return 1 / (1 / FOCUS + blur * slope() / OPENING)


def slope() -> float:
    """From pixel to pixel."""
    return PITCH * (1 / FOCAL_LENGTH - 1 / FOCUS)


def camera_of(code: Array, side: int) -> Camera:
    """A lens with a code at its stop, and a sensor focused on `FOCUS`."""
    behind = 1 / (1 / FOCAL_LENGTH - 1 / FOCUS)
    mask = Mask(code, width=OPENING, name="code")
    return Camera([Lens(FOCAL_LENGTH), mask], Sensor(behind, (side, side), PITCH, electronics=ELECTRONICS))


def flat(target: Array, distance: float) -> LightField:
    """A flat target at a distance."""
    return flat_target.flat(target, OPENING / VIEWS, slope(), distance, VIEWS)


def point() -> Array:
    """One bright pixel, with room for the widest blur."""
    made = np.zeros((2 * MARGIN + 1, 2 * MARGIN + 1))
    made[MARGIN, MARGIN] = 1
    return made


def round_stop(share: float) -> Array:
    """The open share of each cell behind a round stop of a share of the square's light, in its middle."""
    fine = (np.arange(VIEWS * 40) + 0.5) / (VIEWS * 40) - 0.5
    inside = np.hypot(fine[:, None], fine) < math.sqrt(share / math.pi)
    return np.asarray(inside.reshape(VIEWS, 40, VIEWS, 40).mean(axis=(1, 3)))


def random_code(seed: int, share: float) -> Array:
    """Cells that are open at random, as many as come nearest to a share."""
    cells = np.zeros(VIEWS**2)
    cells[: round(share * VIEWS**2)] = 1
    return np.random.default_rng(seed).permutation(cells).reshape(VIEWS, VIEWS)


class Crops:
    """Draws sharp patches with contrast from pictures, mirrored and turned at random.

    Args:
        pictures: sharp, white 1.
        seed: of the places.
    """

    def __init__(self, pictures: list[Array], seed: int) -> None:
        self.pictures, self.random = pictures, np.random.default_rng(seed)

    def __call__(self, count: int) -> Array:
        """(count, PATCH + 2·MARGIN, the same)."""
        side, found = PATCH + 2 * MARGIN, []
        for _ in range(100 * count):
            picture = self.pictures[self.random.integers(len(self.pictures))]
            row, column = (self.random.integers(n - side + 1) for n in picture.shape)
            patch = picture[row : row + side, column : column + side]
            if patch.std() >= CONTRAST:
                turned = np.rot90(patch, int(self.random.integers(4)))
                found.append(turned.T if self.random.random() < 0.5 else turned)
            if len(found) == count:
                return np.stack(found)
        raise InputError(
            f"patches of {side}×{side} pixels of this picture have no contrast (standard deviation below "
            f"{CONTRAST:g} of white): nothing shows the blur"
        )


@dataclass(frozen=True, eq=False)
class Judged:
    """A code, and how its network estimates blur.

    Args:
        code: transmissions of the cells.
        errors: by the name of the target, mean absolute error of the width of the blur, pixels.
        kernels: images of a point at all distances, upright.
        patches: number of patches of each target.
    """

    code: Array
    errors: Mapping[str, float]
    kernels: Array
    patches: int


@dataclass(frozen=True)
class Run:
    """Learn a code with its network, train the same network for other codes, and measure all on new targets.

    Args:
        steps: of training for each code.
        batch: patches per step.
        picture: pixels of a training picture along a side.
        target: pixels of a test target along a side.
    """

    steps: int = 400
    batch: int = 32
    picture: int = 256
    target: int = 160

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Train on drawn pictures; measure on another one and on the middle view of a light field."""
        view = middle_view(bench, self.target)
        targets = {"drawn": drawn("dense", self.target, TEST_SEED), "view": view}
        pictures = [drawn("dense", self.picture, seed) for seed in TRAINING_SEEDS]
        training = lazy_import.module("vcc.gallery.torch_aperture")
        points = [flat(point(), distance_of(blur)) for blur in BLURS]
        spreads = training.PointSpreads(camera_of(np.ones((VIEWS, VIEWS)), 2 * MARGIN + 1), points)
        codes = {
            "learned": np.full((VIEWS, VIEWS), 0.5)
            + 0.1 * (np.random.default_rng(0).random((VIEWS, VIEWS)) - 0.5),
            "round": round_stop(SHARE),
            "Veeraraghavan": VEERARAGHAVAN,
            **{f"random {seed}": random_code(seed, SHARE) for seed in CODE_SEEDS},
            "open": np.ones((VIEWS, VIEWS)),
        }
        advance = Steps(progress, len(codes))
        progress(0, advance.total)
        judged = {}
        for name, start in codes.items():
            code, estimated = training.trained(
                spreads,
                start,
                Crops(pictures, seed=5),
                (FULL, ELECTRONICS.read_noise),
                SHARE if name == "learned" else None,
                self.steps,
                self.batch,
            )
            kernels = spreads(training.torch.as_tensor(code)).detach().numpy()
            judged[name] = measured(code, estimated, targets, kernels)
            advance()
        return Result(_text(self, judged), _pictures(judged), tuple(_findings(judged)), bench.assumed)


def middle_view(bench: Bench, most: int) -> Array:
    """The middle of the middle view, grey, white 1, averaged to at most ``most`` pixels along a side.

    Raises:
        InputError: it is too small, or dark.
    """
    field = bench.light_field
    view = np.asarray(field.view(field.shape[0] // 2, field.shape[1] // 2).to_numpy(), np.float64)
    grey = view if view.ndim == 2 else view.mean(axis=2)
    side, least = min(grey.shape), PATCH + 2 * MARGIN
    if side < least:
        raise InputError(
            f"views of {grey.shape[0]}×{grey.shape[1]} pixels are too small: {least}×{least} are needed"
        )
    part = max(1, side // most)
    kept = min(side // part, most) * part
    top, left = ((n - kept) // 2 for n in grey.shape)
    square = grey[top : top + kept, left : left + kept]
    small = square.reshape(kept // part, part, kept // part, part).mean(axis=(1, 3))
    white = float(np.percentile(small, 99.5))
    if not white > 0:
        raise InputError("the middle view of this light field is dark: there is nothing to record")
    return np.asarray(np.clip(small / white, 0, 1))


def measured(
    code: Array, estimated: Callable[[Array], Array], targets: Mapping[str, Array], kernels: Array
) -> Judged:
    """Record flat targets at all distances with a sensor's noise, and compare the estimated blur of patches."""
    errors, count = {}, 0
    for name, target in targets.items():
        side = len(target) - 2 * MARGIN  # what is out of focus needs light from beyond the sensor
        camera, wall = camera_of(code, side), np.ones_like(target)
        white = camera_of(np.ones((VIEWS, VIEWS)), side).capture(flat(wall, FOCUS), between_views="none")
        exposure = expose_image(white, camera.sensor, "auto").exposure
        inside = [
            (row, column)
            for row in range(0, side - PATCH + 1, PATCH // 2)
            for column in range(0, side - PATCH + 1, PATCH // 2)
            if target[row : row + PATCH + 2 * MARGIN, column : column + PATCH + 2 * MARGIN].std() >= CONTRAST
        ]
        if not inside:
            raise InputError("the middle view of this light field has no contrast: nothing shows the blur")
        missed = []
        for number, blur in enumerate(BLURS):
            image = camera.capture(flat(target, distance_of(blur)), between_views="none")
            taken = expose_image(image, camera.sensor, exposure, seed=number).image().upright().to_numpy()
            shares = np.asarray(taken, np.float64) / float(white.to_numpy().max())
            patches = np.stack([shares[r : r + PATCH, c : c + PATCH] for r, c in inside])
            found = np.array(BLURS)[estimated(patches).argmax(axis=1)]
            missed.append(np.abs(found - blur).mean())
        errors[name], count = float(np.mean(missed)), len(inside)
    return Judged(code, errors, kernels, count)


def _text(run: Run, judged: Mapping[str, Judged]) -> str:
    return prose(
        __name__,
        run=run,
        near=distance_of(BLURS[-1]),
        far=distance_of(BLURS[0]),
        every=lazy_import.module("vcc.gallery.torch_aperture").EVERY,
        pictures=len(TRAINING_SEEDS),
        patches=judged["learned"].patches,
        spread=550e-9 * FOCAL_LENGTH / (OPENING / VIEWS),
    )


def _findings(judged: Mapping[str, Judged]) -> Iterator[Finding]:
    learned, targets = judged["learned"], {"drawn": "another drawn picture", "view": "the middle view"}
    randoms = [f"random {seed}" for seed in CODE_SEEDS]
    for target, words in targets.items():
        mine = learned.errors[target]
        constant = float(np.mean([abs(np.array(BLURS) - np.median(BLURS))]))
        yield Finding(
            f"{words}: mean error of the width of the blur",
            "better than a constant guess",
            mine,
            "pixels",
            mine < constant,
            f"the middle of all widths errs by {constant:g} pixels",
        )
        best = min(randoms, key=lambda name: judged[name].errors[target])
        for name, other, why in (
            ("round", "a round stop of the same light", "compact, and its blur is a disc at all distances"),
            (best, f"the best of {len(randoms)} random codes of the same light", "same network and training"),
            ("Veeraraghavan", "the code of Veeraraghavan et al. 2007", f"{VEERARAGHAVAN.mean():.0%} of the light"),
            ("open", "the open aperture", "all of the light"),
        ):
            its = judged[name].errors[target]
            yield Finding(
                f"{words}: error relative to {other}",
                f"{BETTER:g} or less",
                mine / its,
                "",
                mine <= BETTER * its,
                f"{mine:.2f} against {its:.2f} pixels: {why}",
            )


def _pictures(judged: Mapping[str, Judged]) -> tuple[tuple[Picture, ...], ...]:
    names = list(judged)
    codes = [
        (
            f"{name}\n{judged[name].errors['drawn']:.2f}, {judged[name].errors['view']:.2f}",
            np.pad(np.kron(judged[name].code, np.ones((8, 8))), 2, constant_values=0.5),  # a white page
        )
        for name in names
    ]
    shown = (0, len(BLURS) // 2, len(BLURS) - 1)
    rows = [
        codes,
        *(
            [("", figures.grey_shown(judged[name].kernels[n] / judged[name].kernels[n].max())) for name in names]
            for n in shown
        ),
    ]
    labels = ["code", *(f"{BLURS[n]:g} pixels" for n in shown)]
    return below(
        Picture(
            "codes",
            "The codes, and their images of a point",
            "Below the name: the mean error on the drawn picture and on the view, pixels of blur. All "
            "networks have the same size, training and start.",
            figures.table((9.0, 4.6), rows, labels),
        ),
    )


ENTRY = Entry(
    "learned-aperture",
    "A learned aperture: a code for depth, trained with its network",
    "P. A. Shedligeri, S. Mohan and K. Mitra, Data driven coded aperture design for depth recovery, IEEE "
    "International Conference on Image Processing 2017",
    "A code of the aperture that is learned together with the network for depth from one recording is better than "
    "codes that are designed by hand.",
    Run(),
)
