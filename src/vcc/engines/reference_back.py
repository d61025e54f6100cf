"""The backward pass of the reference engine through footprints, plainly, in float64. It defines the derivative.

    I(x, y) = scale · Σ_q L(q) · w(view) · Π T(m(q)) · F(x; x(q)) · F(y; y(q))

Weights G of the raster have the value H(q) = Σ G(x, y) · F(x; x(q)) · F(y; y(q)) at sample q. For all factors in
which I is linear, ⟨G, dI⟩ = Σ_q H(q) · d(scale · L(q) · w(view) · Π T(m(q))). If samples move, dF replaces F,
along one axis after the other. If the frame shears the pixel grid, a sample's column is x(q) + shear · (y −
y(q)).
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.lookup import smooth_back
from vcc.base.progress import Progress, tell
from vcc.plan.footprints.model import Footprints
from vcc.plan.footprints.shares import share_slopes, shares
from vcc.plan.parameters import parameters
from vcc.plan.protocol import Gradient

Array = NDArray[np.float64]

MOVING = frozenset(("x", "y", "step", "opening"))
"""Parameters that set where samples fall and the width of their footprints."""


def footprints_back(
    core: Footprints,
    values: NDArray[Any],
    raster: NDArray[np.floating],
    samples: bool,
    wanted: Collection[str],
    progress: Progress | None,
) -> Gradient:
    """The derivative of ⟨raster, raster of the samples⟩, float64; see `vcc.plan.protocol.Engine.back`.

    Parameters are independent: ``x`` of each tap, ``weights`` also of taps whose weight is zero. All have a
    derivative, except ``sharpen_samples`` and, if samples fall on the nearest pixel, the parameters that move
    them.

    Raises:
        InputError: a parameter that has no derivative.
    """
    core.check_wanted(wanted)
    channels = values.shape[4] if values.ndim == 5 else 1
    weights = np.asarray(raster, dtype=np.float64).reshape(*core.raster_shape, channels)
    into = np.zeros(values.shape) if samples else None
    found = {name: np.zeros(one.shape) for name, one in parameters(core).items() if name in wanted}
    total = core.weights.size
    for done, (b, a) in enumerate(np.ndindex(core.weights.shape)):
        tell(progress, done, total)
        if core.weights[b, a] == 0 and "weights" not in wanted:
            continue
        tap = _Tap(core, b, a, *indices(core))
        here = core.view_rows[b], core.view_columns[a]
        met = tap.gathered(weights)
        if into is not None:
            gradients = met * (core.scale * core.weights[b, a] * tap.passed)[..., None]
            into[here] += _divided_back(core, gradients).reshape(into[here].shape)
        if wanted:
            view = values[here].astype(np.float64).reshape(*core.samples, channels)
            for name, gradients in tap.gradients(weights, met, divided(core, view), wanted).items():
                found[name] += gradients
    tell(progress, total, total)
    return Gradient(into, found)


def indices(core: Footprints) -> tuple[Array, Array]:
    """Column and row indices k, l of the samples of a view, or of finer samples if the plan subdivides them."""
    (rows, columns), refine = core.samples, core.refine
    if refine == 1:
        return np.arange(columns, dtype=float), np.arange(rows, dtype=float)
    down, across = core.division(rows), core.division(columns)
    return tuple(one.start + np.arange(len(one.first)) / refine for one in (across, down))  # type: ignore[return-value]


def divided(core: Footprints, view: Array) -> Array:
    """The samples of a view (l, k, channels), subdivided if the plan does so."""
    if core.refine == 1:
        return view
    return np.asarray(np.einsum("al,bk,lkc->abc", *_divisions(core), view, optimize=True))


def _divided_back(core: Footprints, fine: Array) -> Array:
    """The transpose of `divided`."""
    if core.refine == 1:
        return fine
    return np.asarray(np.einsum("al,bk,abc->lkc", *_divisions(core), fine, optimize=True))


def _divisions(core: Footprints) -> tuple[Array, Array]:
    """The subdivision of rows and columns of samples, as matrices (finer samples, samples)."""
    rows, columns = core.samples
    return core.division(rows).matrix(rows), core.division(columns).matrix(columns)


@dataclass(frozen=True, eq=False, repr=False)
class _Tap(Brief):
    """One view tap of a core: arrays are (rows of samples l, columns of samples k[, channels])."""

    core: Footprints
    b: int
    a: int
    k: Array
    l: Array

    @property
    @cached
    def transmissions(self) -> list[Array]:
        """The transmission of each mask at the samples."""
        return [mask.weights(self.b, self.a, self.k, self.l) for mask in self.core.masks]

    @property
    def passed(self) -> Array:
        """The product of all masks' transmissions."""
        return self.passed_but(-1)

    def passed_but(self, left_out: int) -> Array:
        """The product of the transmissions of all masks but one."""
        rest = [one for n, one in enumerate(self.transmissions) if n != left_out]
        return np.asarray(math.prod(rest, start=np.ones((len(self.l), len(self.k)))))

    def down(self, row: int) -> tuple[str, float, Array, float, float]:
        """Arguments of `shares` for the samples on a raster row, (l, k) or (l, 1)."""
        core = self.core
        k = self.k if core.step[1, 0] else np.zeros(1)  # equal for all columns of samples: (l, 1)
        y = core.y[self.b, self.a] + core.step[1, 0] * k[None, :] + core.step[1, 1] * self.l[:, None]
        return core.interpolation, float(row), y, core.row_step / core.refine, core.opening

    def across(self, row: int) -> tuple[str, Array, Array, float, float]:
        """Arguments of `shares` for the columns of samples on the pixels of a raster row, (pixels, k)."""
        core, pixel = self.core, np.arange(self.core.raster_shape[1], dtype=float)
        x = core.x[self.b, self.a] + core.shear * (row - core.y[self.b, self.a]) + core.column_step * self.k
        return core.interpolation, pixel[:, None], x[None, :], core.column_step / core.refine, core.opening

    def gathered(self, weights: Array) -> Array:
        """H: the raster's weights, summed over the footprint of each sample."""
        met = np.zeros((len(self.l), len(self.k), weights.shape[2]))
        for row, line in enumerate(weights):
            down = shares(*self.down(row))
            if down.any():
                met += down[..., None] * (self.across_shares(row).T @ line)
        return met

    def across_shares(self, row: int) -> Array:
        """F along a raster row, (pixels, k): the same in all rows without shear."""
        return shares(*self.across(row)) if self.core.shear else self._shares_of_any_row

    def across_slopes(self, row: int) -> tuple[Array, Array, Array]:
        """`share_slopes` along a raster row."""
        return share_slopes(*self.across(row)) if self.core.shear else self._slopes_of_any_row

    @property
    @cached
    def _shares_of_any_row(self) -> Array:
        return np.asarray(shares(*self.across(0)))

    @property
    @cached
    def _slopes_of_any_row(self) -> tuple[Array, Array, Array]:
        return share_slopes(*self.across(0))

    def gradients(self, weights: Array, met: Array, light: Array, wanted: Collection[str]) -> dict[str, Array]:
        """Gradients to parameters from this tap alone; light: L, met: H."""
        core, b, a = self.core, self.b, self.a
        gradients: dict[str, Array] = {}
        whole = (met * light).sum(axis=2)
        of_taps = np.zeros(core.weights.shape)
        of_taps[b, a] = (whole * self.passed).sum()
        gradients["weights"] = core.scale * of_taps
        gradients["scale"] = np.asarray(core.weights[b, a] * of_taps[b, a])
        for n in range(len(core.masks)):
            if any(name.startswith(f"masks[{n}].") for name in wanted):
                gradients |= self.mask_back(n, core.scale * core.weights[b, a] * whole * self.passed_but(n))
        if not MOVING.isdisjoint(wanted):
            through = light * self.passed[..., None]
            gradients |= self.places_back(core.scale * core.weights[b, a] * weights, through)
        return {name: gradients[name] for name in wanted}

    def mask_back(self, n: int, weights: Array) -> dict[str, Array]:
        """Gradients to the mask from weights of its transmission at the samples."""
        mask = self.core.masks[n]
        texture, of_row, of_column = smooth_back(
            mask.texture, *mask.places(self.b, self.a, self.k, self.l), weights
        )
        row, column = np.zeros(mask.row.shape), np.zeros(mask.column.shape)
        row[self.b, self.a], column[self.b, self.a] = of_row.sum(), of_column.sum()
        step = np.array(
            [[(gradients * self.k).sum(), (gradients.T * self.l).sum()] for gradients in (of_column, of_row)]
        )
        return {
            f"masks[{n}].{name}": one
            for name, one in {"texture": texture, "column": column, "row": row, "step": step}.items()
        }

    def places_back(self, weights: Array, flux: Array) -> dict[str, Array]:
        """Gradients to the positions and footprints of samples from the raster's weights; flux: L · Π T."""
        core, b, a = self.core, self.b, self.a
        x = y = opening = column_step = shear = 0.0
        step = np.zeros((2, 2))
        for row, line in enumerate(weights):
            down = shares(*self.down(row))
            if not down.any():
                continue
            mixed = self.across_shares(row).T @ line
            by_y, by_height, by_opening = (
                slope * (flux * mixed).sum(axis=2) for slope in share_slopes(*self.down(row))
            )
            y += by_y.sum()
            opening += by_opening.sum()
            step[1, 0] += (by_y * self.k).sum()
            step[1, 1] += (by_y.T * self.l).sum() + np.sign(core.row_step) / core.refine * by_height.sum()
            fallen = (down[..., None] * flux).sum(axis=0)
            by_x, by_width, by_opening = (slope * (line @ fallen.T) for slope in self.across_slopes(row))
            x += by_x.sum()
            y -= core.shear * by_x.sum()
            opening += by_opening.sum()
            shear += (row - core.y[b, a]) * by_x.sum()
            column_step += (by_x * self.k).sum() + np.sign(core.column_step) / core.refine * by_width.sum()
        # column_step = x/k − shear · y/k, and shear = x/l : y/l
        shear -= core.step[1, 0] * column_step
        step += [
            [column_step, shear / core.step[1, 1]],
            [-core.shear * column_step, -core.shear / core.step[1, 1] * shear],
        ]
        of_x, of_y = np.zeros(core.x.shape), np.zeros(core.y.shape)
        of_x[b, a], of_y[b, a] = x, y
        return {"x": of_x, "y": of_y, "step": step, "opening": np.asarray(opening)}
