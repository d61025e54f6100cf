"""Footprints: a plan's core if the optics fold into one matrix, as plain data for an engine.

The raster is one sum over the samples of the light field,

    I(x, y) = scale · Σ_q L(q) · w(view) · Π T(m(q)) · F(x; x(q)) · F(y; y(q)),

in which every place is an affine function of the sample's index. The engine needs no optics.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from itertools import product
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.lookup import smooth
from vcc.base.values import Value
from vcc.fields.grid import Block
from vcc.plan.footprints.shares import REACH, Division
from vcc.plan.parameters import parameters

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class MaskLookup(Value):
    """A mask in mid-path, averaged over a sample's cell, as a texture in which samples look up their weights.

    Texture coordinates of sample (k, l) in view tap (b, a): (column, row) = (column[b, a], row[b, a])
    + step · (k, l). Weights are quadratic B-splines of the texture's points (`vcc.base.lookup.three_around`) with
    zeros around them, so they depend on places with a continuous slope.

    Args:
        texture: spline coefficients of the mean transmission over a sample's footprint, at regular points, (rows,
            columns), float32 or float64.
        column: texture column of sample (0, 0) in each view tap, (rows of taps, columns of taps).
        row: texture row, likewise.
        step: 2×2, texture points per index step: [[column/k, column/l], [row/k, row/l]].
        label: of the element.
    """

    texture: NDArray[np.floating]
    column: Array
    row: Array
    step: Array
    label: str

    def weights(self, b: int, a: int, k: Array, l: Array) -> Array:
        """T at the samples with column indices k and row indices l of view tap (b, a): shape (l, k)."""
        return np.broadcast_to(smooth(self.texture, *self.places(b, a, k, l)), (len(l), len(k)))

    def places(self, b: int, a: int, k: Array, l: Array) -> tuple[Array, Array]:
        """Texture rows and columns at which samples with these indices are looked up: shapes (l, k).

        The length is 1 along an axis that they do not depend on.
        """

        def place(first: Array, by_k: float, by_l: float) -> Array:
            found = np.full((1, 1), first[b, a])
            found = found + by_k * k[None, :] if by_k else found
            return found + by_l * l[:, None] if by_l else found

        return place(self.row, *self.step[1]), place(self.column, *self.step[0])

    def moved(self, k: int, l: int) -> MaskLookup:
        """The look-up for samples that begin at sample (k, l) of the original ones."""
        return replace(
            self,
            column=self.column + self.step[0] @ (k, l),
            row=self.row + self.step[1] @ (k, l),
        )

    def of_taps(self, taps: tuple[NDArray[np.intp], ...]) -> MaskLookup:
        """The look-up for some of the view taps only; ``taps`` is an open mesh of their (rows, columns)."""
        return replace(self, column=self.column[taps], row=self.row[taps])


@dataclass(frozen=True, eq=False, repr=False)
class Footprints(Value):
    """How samples of a light field add up to a raster of pixels.

    A *view tap* (b, a) is a view, or a place between views if views are interpolated, that contributes to the
    image: it reads view (view_rows[b], view_columns[a]). Places are in pixels of the raster, which is the sensor
    with some more pixels on every side.

    Args:
        raster_shape: (rows, columns) of pixels.
        interpolation: of footprints: ``"nearest"``, ``"linear"``, ``"cubic"``, ``"spline"`` or ``"box"``.
        scale: converts radiance times shares into irradiance.
        view_rows: row of views that each row of taps reads.
        view_columns: column of views that each column of taps reads.
        weights: (rows of taps, columns of taps), the share of each tap's cell that apertures transmit.
        x: raster column of sample (0, 0) in each tap, (rows of taps, columns of taps).
        y: raster row, likewise.
        step: 2×2, pixels per index step: [[x/k, x/l], [y/k, y/l]], |y/l| the larger of its row.
        samples: (rows, columns) of samples of a view.
        masks: masks in mid-path.
        refine: number of finer samples that replace one, along each pixel axis.
        opening: the share of a pixel's width, and of its height, that is sensitive ("nearest" ignores it).
        sharpen_samples: an odd number of weights of the filter along both axes that is applied to samples when
            they are divided (``refine``), or None.
    """

    raster_shape: tuple[int, int]
    interpolation: str
    scale: float
    view_rows: NDArray[np.int64]
    view_columns: NDArray[np.int64]
    weights: Array
    x: Array
    y: Array
    step: Array
    samples: tuple[int, int]
    masks: tuple[MaskLookup, ...] = ()
    refine: int = 1
    opening: float = 1.0
    sharpen_samples: Array | None = None

    method: ClassVar[str] = "footprints"
    border: ClassVar[int] = 0
    """Views around a block that are read with it."""

    def check_wanted(self, wanted: Collection[str]) -> None:
        """Check that derivatives to these parameters exist.

        Args:
            wanted: names of the core's parameters (`vcc.plan.parameters.parameters`).

        Raises:
            InputError: a parameter without a derivative, with the reason.
        """
        known = parameters(self) if wanted else {}
        for name in wanted:
            if name == "sharpen_samples":
                raise InputError("there is no derivative to sharpen_samples: the filter of samples is a decision")
            if name not in known:
                raise InputError(f"footprints have no number {name!r}: {', '.join(known)} are theirs")
            if self.interpolation == "nearest" and name in ("x", "y", "step", "opening"):
                raise InputError(
                    f"there is no derivative to {name!r} where each sample falls on the nearest pixel: use "
                    "interpolation='linear', 'cubic' or 'sharp'"
                )

    def division(self, samples: int) -> Division:
        """How ``samples`` samples along an axis are divided into ``refine`` finer ones each."""
        return Division.of(self.interpolation, samples, self.refine, self.sharpen_samples)

    def part(self, block: Block) -> Footprints:
        """The footprints of a block's samples: the rasters of all blocks sum to the raster of the light field."""
        (l, _), (k, _) = block.pixel_rows, block.pixel_columns
        rows, columns, taps = self._taps(block)
        return replace(
            self,
            view_rows=self.view_rows[rows] - block.rows[0],
            view_columns=self.view_columns[columns] - block.columns[0],
            weights=self.weights[taps],
            x=self.x[taps] + self.step[0] @ (k, l),
            y=self.y[taps] + self.step[1] @ (k, l),
            masks=tuple(mask.of_taps(taps).moved(k, l) for mask in self.masks),
            samples=block.shape[2:],
        )

    def required(self, wanted: Collection[str]) -> set[str]:
        """The parameters of a part whose derivatives are needed for the given parameters of this core."""
        stepped = [where for where in self._stepped if where[2] in wanted]
        return {*wanted, *(name for where in stepped for name in where)}

    def full_gradients(self, block: Block, numbers: Mapping[str, Array]) -> dict[str, Array]:
        """Convert derivatives to the parameters of `part` into derivatives to this core's own.

        The places of a part are counted from its first sample, so that the steps affect all of them.
        """
        whole = dict(numbers)
        first = np.array([block.pixel_columns[0], block.pixel_rows[0]])
        for along_columns, along_rows, step in self._stepped:
            if step in whole:
                moved = [numbers[place].sum() * first for place in (along_columns, along_rows)]
                whole[step] = numbers[step] + moved
        _, _, taps = self._taps(block)
        for name in {"weights", *(place for where in self._stepped for place in where[:2])} & set(whole):
            whole[name] = np.zeros(self.weights.shape)
            whole[name][taps] = numbers[name]
        return whole

    @property
    def _stepped(self) -> list[tuple[str, str, str]]:
        """Names of places along columns and along rows, and of the steps between them: pixels' and masks'."""
        masks = (f"masks[{n}]." for n in range(len(self.masks)))
        return [("x", "y", "step"), *((f"{mask}column", f"{mask}row", f"{mask}step") for mask in masks)]

    def _taps(self, block: Block) -> tuple[NDArray[np.intp], NDArray[np.intp], tuple[NDArray[np.intp], ...]]:
        """The rows and the columns of view taps that read a block, and both as an open mesh."""
        (a, b), (c, d) = block.rows, block.columns
        rows = np.flatnonzero((self.view_rows >= a) & (self.view_rows < b))
        columns = np.flatnonzero((self.view_columns >= c) & (self.view_columns < d))
        return rows, columns, np.ix_(rows, columns)

    def of_columns(self, columns: NDArray[np.intp]) -> Footprints:
        """With the given columns of view taps only."""
        taps = np.ix_(np.arange(len(self.view_rows)), columns)
        return replace(
            self,
            view_columns=self.view_columns[columns],
            weights=self.weights[taps],
            x=self.x[taps],
            y=self.y[taps],
            masks=tuple(mask.of_taps(taps) for mask in self.masks),
        )

    def guarded(self, pixels: int) -> Footprints:
        """With ``pixels`` more pixels around the raster."""
        rows, columns = self.raster_shape
        shape = (rows + 2 * pixels, columns + 2 * pixels)
        return replace(self, raster_shape=shape, x=self.x + pixels, y=self.y + pixels)

    def used_views(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """The views that are used of a light field of this shape, (v, u): one view if none gives light."""
        used = np.zeros(shape[:2], dtype=bool)
        rows, columns = np.nonzero(self.weights) if self.weights.any() else ([0], [0])
        used[self.view_rows[rows], self.view_columns[columns]] = True
        return used

    def used_pixels(self, shape: tuple[int, ...]) -> NDArray[np.intp]:
        """The pixels of each view that may give light to the raster, (v, u, 2, 2); empty for unused views.

        The range is the bounding box of the samples whose footprints reach the raster. It is computed by
        inverting the affine map from indices to places.
        """
        reach = REACH[self.interpolation]
        if self.refine > 1:  # finer samples have footprints of their own around the divided ones
            reach = 2 * reach + (0 if self.sharpen_samples is None else len(self.sharpen_samples) // 2)
        (xk, xl), (yk, yl) = self.step
        # Places are followed along a row of the raster with the shear, so the shear adds to the reach.
        beside = reach * (abs(self.column_step) + abs(xl)) + abs(self.shear) + 1, reach * (abs(yk) + abs(yl)) + 1
        rows, columns = self.raster_shape
        used = np.zeros((*shape[:2], 2, 2), dtype=np.intp)
        seen = self.used_views(shape)
        if abs(xk * yl - xl * yk) <= 1e-12 * np.abs(self.step).max() ** 2:  # a view falls into a line
            used[seen] = [[0, shape[2]], [0, shape[3]]]
            return used
        ends = [(-beside[0], columns - 1 + beside[0]), (-beside[1], rows - 1 + beside[1])]
        corners = np.array(list(product(*ends)))[:, None, None] - np.stack([self.x, self.y], axis=-1)
        index = np.clip(corners @ np.linalg.inv(self.step).T, -1, max(shape[2:4]))[..., ::-1]
        first, stop = np.floor(index.min(axis=0)).astype(np.intp), np.ceil(index.max(axis=0)).astype(np.intp) + 1
        used[seen, :, 0] = max(shape[2:4])
        for b, a in zip(*np.nonzero(self.weights), strict=True):
            one = used[self.view_rows[b], self.view_columns[a]]
            np.minimum(one[:, 0], first[b, a], out=one[:, 0])
            np.maximum(one[:, 1], stop[b, a], out=one[:, 1])
        return used

    def scaled(self, factor: float) -> Footprints:
        """For samples whose numbers stand for ``factor`` times as much."""
        return self if factor == 1 else replace(self, scale=self.scale * factor)

    def more(self, samples: int) -> Footprints:
        """Returns self: no rays are traced."""
        return self

    @property
    def separable(self) -> bool:
        """Whether columns on the sensor depend only on columns of the light field, and rows only on rows.

        Masks are then looked up along rows and columns, too; the place where a tap meets a mask is arbitrary.
        """
        steps = [self.step, *(mask.step for mask in self.masks)]
        return bool(
            np.ptp(self.x, axis=0).max() < 1e-6
            and np.ptp(self.y, axis=1).max() < 1e-6
            and all(
                max(abs(step[0, 1]) * self.samples[0], abs(step[1, 0]) * self.samples[1]) < 1e-6 for step in steps
            )
        )

    @property
    def row_step(self) -> float:
        """Raster rows from one row of samples to the next."""
        return float(self.step[1, 1])

    @property
    def column_step(self) -> float:
        """Raster columns from one column of samples to the next, along a fixed raster row."""
        (xk, _), (yk, _) = self.step
        return float(xk - self.shear * yk)

    @property
    def shear(self) -> float:
        """Raster columns by which a sample's place moves per raster row, at a fixed column index."""
        (_, xl), (_, yl) = self.step
        return float(xl / yl)

    @property
    def direction(self) -> str:
        """Order in which the shares are tabulated: by sample ("forward") or by pixel ("backward")."""
        return "forward" if max(abs(self.row_step), abs(self.column_step)) <= 1 else "backward"

    @property
    def taps_used(self) -> int:
        """Number of view taps that transmit any light."""
        return int(np.count_nonzero(self.weights))

    @property
    def samples_touched(self) -> int:
        """Number of samples that an engine processes, refined samples included."""
        return self.taps_used * self.samples[0] * self.samples[1] * self.refine**2

    def __repr__(self) -> str:
        rows, columns = self.weights.shape
        return (
            f"{rows}×{columns} view taps ({self.taps_used} used) of {self.samples[0]}×{self.samples[1]} samples\n"
            f"  step on the sensor: {self.row_step:.4g} rows, {self.column_step:.4g} columns a sample "
            f"({self.direction}, {self.interpolation}, {'separable' if self.separable else 'sheared'})\n"
            f"  masks in mid-path: {', '.join(mask.label for mask in self.masks) or 'none'}; "
            f"samples refined ×{self.refine}"
        )
