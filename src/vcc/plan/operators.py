"""What is done before and after a plan's core: small linear operators, each with its transpose beside it.

Operators before the core act on samples (v, u, t, s[, channels]) of some views, those after it on the raster
(rows, columns, channels). All are linear, and ``transpose`` is the adjoint of ``apply``:
⟨apply(a), b⟩ = ⟨a, transpose(b)⟩. They take arrays of NumPy and of other array libraries. ``pull`` is the
derivative of ⟨apply(a), b⟩ to the operator's own numbers.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from array_api_compat import array_namespace, device
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.values import Value
from vcc.fields.grid import Block, Sample
from vcc.fields.sampled import to_dtype
from vcc.plan.correlation import correlated
from vcc.plan.sharpening import MEAN, TENT, along_axis

Array = NDArray[np.float64]

LONG = 64
"""Weights from which on a filter is quicker through Fourier transforms."""
ROUNDING = 1e-13
"""Of the largest number: below it lies what Fourier transforms in double precision round to."""
RANK_TOLERANCE = 1e-8
SOFTENED: dict[Sample, int] = {"point": TENT, "mean": TENT + MEAN}
"""How many times the averaging over a sample, sinc(f), stands in what is looked up: twice by interpolation, once
more in samples that are means over their pixels."""


class Before(Protocol):
    """What is done to samples before they are cast on the sensor or looked up."""

    reach: int
    """Rows of pixels on each side of a block that are read with it."""
    copies: bool
    """Whether new samples are made, which take memory: then a column of views is taken at a time, if it can be."""

    def apply(self, values: Any) -> Any:
        """Samples (v, u, t, s[, channels]) as the core takes them."""
        ...

    def transpose(self, values: Any) -> Any:
        """The adjoint of `apply`."""
        ...

    def pull(self, values: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative of ⟨weights, apply(values)⟩ to the operator's own numbers that are wanted, by name."""
        ...

    def block(self, block: Block) -> Block:
        """Which of the samples that the core takes come from a block of those that there are."""
        ...

    def made_of(self, pixels: Any) -> Any:
        """Of which pixels those are made that the core takes: what goes beyond a view is cut off by who asks.

        Args:
            pixels: first and stop of rows and of columns of pixels, (…, 2, 2).
        """
        ...

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """The shape that samples of a shape get."""
        ...

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """The type that samples of a NumPy type get, and what one of its numbers stands for in those given."""
        ...


class After(Protocol):
    """What is done to the raster (rows, columns, channels) after the core."""

    def apply(self, raster: Any) -> Any:
        """The raster as the next operator, or the picture, takes it."""
        ...

    def transpose(self, raster: Any) -> Any:
        """The adjoint of `apply`."""
        ...

    def pull(self, raster: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative of ⟨weights, apply(raster)⟩ to the operator's own numbers that are wanted, by name."""
        ...


# --- before ---


@dataclass(frozen=True, eq=False)
class SwapPixelAxes(Value):
    """Rows and columns of pixels change places: a frame that turns views leads rows to columns of the sensor."""

    reach = 0
    copies = False

    def apply(self, values: Any) -> Any:
        """Samples (v, u, t, s[, channels]) as (v, u, s, t[, channels]), not copied where the library allows it."""
        if isinstance(values, np.ndarray):
            return values.swapaxes(2, 3)
        return array_namespace(values).permute_dims(values, (0, 1, 3, 2, *range(4, values.ndim)))

    transpose = apply

    def pull(self, values: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """There are no numbers."""
        return {}

    def block(self, block: Block) -> Block:
        """The same samples, their axes in the other order."""
        return replace(block, pixel_rows=block.pixel_columns, pixel_columns=block.pixel_rows)

    def made_of(self, pixels: Any) -> Any:
        """The same, in the other order."""
        return pixels[..., ::-1, :]

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """With rows and columns of pixels in the other order."""
        return (*shape[:2], shape[3], shape[2], *shape[4:])

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """As they were."""
        return kind, 1.0


@dataclass(frozen=True, eq=False, repr=False)
class BlurViews(Brief, Value):
    """Each view convolved with a kernel, a diffuser at the views; it grows by half the kernel on each side.

    Args:
        kernel: in samples, odd rows × odd columns of sum 1.
    """

    kernel: Array

    reach = 0
    copies = True

    def apply(self, values: Any) -> Any:
        """Samples (v, u, t, s[, channels]) convolved, in float32; float64 stays."""
        if not isinstance(values, np.ndarray):
            return self._in_library(values)
        from scipy.signal import oaconvolve

        result = np.empty(self.shape(values.shape), dtype=self.kept_as(values.dtype)[0])
        weights = self.kernel if values.ndim == 4 else self.kernel[:, :, None]
        for view in np.ndindex(values.shape[:2]):
            # In double precision: what Fourier transforms round to in the dark would else add up.
            result[view] = without_rounding(oaconvolve(values[view].astype(np.float64), weights, axes=(0, 1)))
        return result

    def transpose(self, values: Any) -> Any:
        """Samples of the grown views correlated with the kernel, cut to what the views were: float64 of NumPy."""
        from scipy.signal import oaconvolve

        turned = self.kernel[::-1, ::-1]
        weights = turned if values.ndim == 4 else turned[:, :, None]
        high, wide = (n - 1 for n in self.kernel.shape)
        views = [
            oaconvolve(np.asarray(values[view], np.float64), weights, axes=(0, 1), mode="valid")
            for view in np.ndindex(values.shape[:2])
        ]
        nv, nu, nt, ns = values.shape[:4]
        return np.reshape(np.stack(views), (nv, nu, nt - high, ns - wide, *values.shape[4:]))

    def block(self, block: Block) -> Block:
        """What a block's light reaches: as many more rows and columns as the kernel has beside its middle."""
        (first, stop), (left, right) = block.pixel_rows, block.pixel_columns
        high, wide = (n - 1 for n in self.kernel.shape)
        return replace(block, pixel_rows=(first, stop + high), pixel_columns=(left, right + wide))

    def made_of(self, pixels: Any) -> Any:
        """Those under the kernel, which stands before them in the grown view."""
        return pixels - np.stack([np.array(self.kernel.shape) - 1, [0, 0]], axis=-1)

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """With the rows and columns by which views grow."""
        rows, columns = self.kernel.shape
        return (*shape[:2], shape[2] + rows - 1, shape[3] + columns - 1, *shape[4:])

    def pull(self, values: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative to the kernel: how samples (v, u, t, s[, channels]) agree with weights of grown views."""
        if "kernel" not in wanted:
            return {}
        rows, columns = self.kernel.shape
        total = np.zeros(self.kernel.shape)
        for view in np.ndindex(values.shape[:2]):
            grown, own = (np.asarray(array[view]).reshape(*array.shape[2:4], -1) for array in (weights, values))
            total += correlated(grown, own, range(rows), range(columns))
        return {"kernel": total}

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """In single precision; double where it was."""
        return (kind if kind == np.float64 else np.dtype(np.float32)), 1.0

    def _in_library(self, values: Any) -> Any:
        xp = array_namespace(values)
        working = xp.float64 if values.dtype == xp.float64 else xp.float32
        channels = (*values.shape, 1) if values.ndim == 4 else tuple(values.shape)
        # (t, s, all the others)
        block = xp.permute_dims(xp.reshape(xp.astype(values, working), channels), (2, 3, 0, 1, 4))
        total = None
        for down, across in separable_terms(self.kernel):
            rows = xp.asarray(spreading_matrix(down, channels[2]), dtype=working, device=device(values))
            columns = xp.asarray(spreading_matrix(across, channels[3]), dtype=working, device=device(values))
            mixed = xp.tensordot(columns, xp.tensordot(rows, block, axes=((1,), (0,))), axes=((1,), (1,)))
            total = mixed if total is None else total + mixed
        grown = xp.permute_dims(total, (2, 3, 1, 0, 4))
        return grown if values.ndim == 5 else grown[..., 0]


@dataclass(frozen=True, eq=False)
class DarkBorder(Value):
    """Dark samples around a piece of a light field, where the light field has others that are not in the piece.

    What is done afterwards spreads the piece's light among them as it does in the whole, so that the pictures of
    the pieces add up to the picture of the whole.

    Args:
        halo: (before, after) along (v, u, t, s): how many samples.
    """

    halo: tuple[tuple[int, int], ...]

    reach = 0
    copies = True

    def apply(self, values: Any) -> Any:
        """Samples (v, u, t, s[, channels]) with the border, of their type."""
        if isinstance(values, np.ndarray):
            return np.pad(values, [*self.halo, *[(0, 0)] * (values.ndim - 4)])
        xp = array_namespace(values)
        for axis, beside in enumerate(self.halo):
            dark = [
                xp.zeros(
                    (*values.shape[:axis], n, *values.shape[axis + 1 :]), dtype=values.dtype, device=device(values)
                )
                for n in beside
            ]
            if any(beside):
                values = xp.concat([dark[0], values, dark[1]], axis=axis)
        return values

    def transpose(self, values: Any) -> Any:
        """Samples with the border cut off."""
        cut = (slice(a, n - b) for (a, b), n in zip(self.halo, values.shape[:4], strict=True))
        return values[(*cut, ...)]

    def pull(self, values: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """There are no numbers."""
        return {}

    def block(self, block: Block) -> Block:
        """What a block's light reaches: itself and as much of a border on each side as the piece has."""
        grown = ((first, stop + a + b) for (first, stop), (a, b) in zip(block.ranges, self.halo, strict=True))
        return Block(*grown)

    def made_of(self, pixels: Any) -> Any:
        """The same, where they stand without the border."""
        return pixels - np.array(self.halo)[2:, :1]

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """With the border."""
        grown = (n + a + b for n, (a, b) in zip(shape[:4], self.halo, strict=True))
        return (*grown, *shape[4:])

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """As they were."""
        return kind, 1.0


@dataclass(frozen=True, eq=False)
class SharpenViews(Value):
    """Each view filtered along k and along l, to compensate beforehand for linear look-ups.

    A ray interpolates linearly between the samples of a view. Seen from places all over a sample, that averages
    the view with a tent, which takes 1 − sinc²(f) of a cosine of f cycles a sample: 3 % at 0.1, 7 % at 0.15. Where
    a sample is itself a mean over its pixel, light that is averaged over a sensor's pixel is averaged a second
    time, and loses 1 − sinc(f) more. Beyond a view's border its last samples go on, so that what is even stays
    even.

    Args:
        weights: of a sample, of each of its neighbours and of those beyond, in 2⁻¹⁰ (`WEIGHT_DIGITS`), as
            `of` gives them.
    """

    weights: tuple[int, int, int]

    reach = 2  # `REACH`
    copies = True

    @classmethod
    def of(cls, sample: Sample) -> SharpenViews:
        """The filter of a picture whose samples are as large as its pixels (`vcc.plan.sharpening`), rounded.

        Args:
            sample: "mean" or "point": what samples are by themselves.
        """
        outer, inner = (
            round(float(weight) * 2**WEIGHT_DIGITS) for weight in along_axis(SOFTENED[sample], 1.0)[:2]
        )
        return cls((2**WEIGHT_DIGITS - 2 * inner - 2 * outer, inner, outer))

    def apply(self, values: Any) -> Any:
        """Samples (v, u, t, s[, channels]) sharpened: 8 bits as whole numbers of 16 bits, exactly; else floats."""
        xp = array_namespace(values)
        kind = to_dtype(values)
        if kind == np.uint8:
            filtered = self._filtered(xp, xp.astype(values, xp.int32), self.weights)
            left = 2 * WEIGHT_DIGITS - KEPT_DIGITS
            rounded = xp.bitwise_right_shift(filtered + 2 ** (left - 1), xp.asarray(left, dtype=xp.int32))
            return xp.astype(rounded, xp.int16)
        working = xp.float64 if kind == np.float64 else xp.float32
        return self._filtered(xp, xp.astype(values, working), [n * 2.0**-WEIGHT_DIGITS for n in self.weights])

    def transpose(self, values: Any) -> Any:
        """What each sample adds to a weighted sum of sharpened ones: float64 of NumPy, rounding left out."""
        values = np.asarray(values, dtype=np.float64)
        for axis in (2, 3):
            matrix = np.zeros((values.shape[axis],) * 2)
            here = np.arange(values.shape[axis])
            for n, weight in zip(range(-2, 3), (*self.weights[:0:-1], *self.weights), strict=True):
                np.add.at(matrix, (here, np.clip(here + n, 0, len(here) - 1)), weight * 2.0**-WEIGHT_DIGITS)
            values = np.moveaxis(np.tensordot(matrix.T, values, axes=(1, axis)), 0, axis)
        return values

    def pull(self, values: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """Weights are whole numbers, which are decided and not learned."""
        return {}

    def block(self, block: Block) -> Block:
        """The same samples: those read beside them are cut off again."""
        return block

    def made_of(self, pixels: Any) -> Any:
        """With those that the filter looks at beside them."""
        return pixels + np.array([-self.reach, self.reach])

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """As it was."""
        return shape

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """8 bits in 16, with digits after the point; else single precision, or double where it was."""
        if kind == np.uint8:
            return np.dtype(np.int16), 2.0**-KEPT_DIGITS
        return (kind if kind == np.float64 else np.dtype(np.float32)), 1.0

    def _filtered(self, xp: Any, values: Any, weights: Sequence[float]) -> Any:
        for axis in (3, 2):
            here = np.arange(values.shape[axis])
            total = values * weights[0]
            for n in range(1, self.reach + 1):
                for moved in (-n, n):
                    place = xp.asarray(np.clip(here + moved, 0, len(here) - 1), device=device(values))
                    total = total + weights[n] * xp.take(values, place, axis=axis)
            values = total
        return values


REACH = 2
"""Samples on each side that a sharpened sample takes in."""
WEIGHT_DIGITS = 10
"""Weights are whole numbers of 2⁻¹⁰: what is even stays so to the bit, and 8-bit samples are filtered exactly."""
KEPT_DIGITS = 5
"""Binary digits after the point with which 8-bit samples are kept in 16 bits: 2⁻⁵ of a level, sixteen times finer
than they were rounded, with room for values 4 times the range (the filter's are at most 3.4 times)."""


# --- after ---


@dataclass(frozen=True, eq=False, repr=False)
class AlongAxes(Brief, Value):
    """The raster filtered along its columns and along its rows, dark beyond its border.

    Args:
        down: an odd number of weights along columns.
        across: likewise along rows.
        words: what it is for.
        half_widths: (vertical, horizontal) in pixels, where the weights are those of tents; see `tents`.
    """

    down: Array
    across: Array
    words: str
    half_widths: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def tents(
        cls, vertical: float, horizontal: float, beside: tuple[int | None, int | None] = (None, None)
    ) -> AlongAxes:
        """What fills the gaps between the pictures of neighbouring views.

        Args:
            vertical: half width of the tent along columns, pixels; 0 for none.
            horizontal: likewise along rows.
            beside: weights on each side of the middle of both; None: as many as it takes.
        """
        down, across = (tent(*each) for each in zip((vertical, horizontal), beside, strict=True))
        return cls(down, across, "gaps between views filled by tents", (vertical, horizontal))

    def apply(self, raster: Any) -> Any:
        """The raster (rows, columns, channels) filtered."""
        return self._filtered(raster, self.down, self.across)

    def transpose(self, raster: Any) -> Any:
        """Filtered by the weights in the other order."""
        return self._filtered(raster, self.down[::-1], self.across[::-1])

    def pull(self, raster: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative to the weights along either axis; half widths are told, and nothing follows from them."""
        pulled = {}
        if "down" in wanted:
            back = _along(np.asarray(weights, np.float64), self.across[::-1], 1)
            pulled["down"] = correlated(back, raster, _lags(len(self.down)), range(1))[:, 0]
        if "across" in wanted:
            ahead = _along(np.asarray(raster, np.float64), self.down, 0)
            pulled["across"] = correlated(weights, ahead, range(1), _lags(len(self.across)))[0]
        if "half_widths" in wanted:
            pulled["half_widths"] = np.zeros(2)
        return pulled

    def _filtered(self, raster: Any, down: Array, across: Array) -> Any:
        if isinstance(raster, np.ndarray):
            return _along(_along(raster, down, 0), across, 1)
        return _mixed(raster, [(down, across)])

    def before(self, other: AlongAxes) -> AlongAxes:
        """This filter and then another, as one."""
        words = f"{self.words}, {other.words}"
        return AlongAxes(np.convolve(self.down, other.down), np.convolve(self.across, other.across), words)


@dataclass(frozen=True, eq=False, repr=False)
class Blur(Brief, Value):
    """The raster convolved with a kernel, dark beyond its border.

    Args:
        kernel: in pixels, odd rows × odd columns.
        words: what it is for.
        scatters: whether it is what a diffuser does.
    """

    kernel: Array
    words: str
    scatters: bool = False

    def apply(self, raster: Any) -> Any:
        """The raster (rows, columns, channels) convolved, as large as it was."""
        return self._convolved(raster, self.kernel)

    def transpose(self, raster: Any) -> Any:
        """Convolved with the kernel turned by 180°."""
        return self._convolved(raster, self.kernel[::-1, ::-1])

    def pull(self, raster: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative to the kernel."""
        if "kernel" not in wanted:
            return {}
        return {"kernel": correlated(weights, raster, *(_lags(length) for length in self.kernel.shape))}

    def _convolved(self, raster: Any, kernel: Array) -> Any:
        if not isinstance(raster, np.ndarray):
            return _mixed(raster, separable_terms(kernel))
        from scipy.signal import oaconvolve

        # In double precision: what Fourier transforms round to in the dark would else show.
        wide = oaconvolve(raster.astype(np.float64), kernel[:, :, None], mode="same", axes=(0, 1))
        return without_rounding(wide)


@dataclass(frozen=True, eq=False, repr=False)
class OnSensor(Brief, Value):
    """The sensor's part of the raster, through what lies against the sensor.

    Args:
        guard: pixels of the raster on each side of the sensor.
        transmission: mean over each pixel of what lies against the sensor, (rows, columns), or None.
        detail: what its variation within pixels adds, from the light of each pixel's 3×3 neighbours, (3, 3, rows,
            columns): [dy, dx] is the share of the pixel dy − 1 rows down and dx − 1 columns on; or None.
    """

    guard: int
    transmission: Array | None = None
    detail: Array | None = None

    def apply(self, raster: Any) -> Any:
        """The picture (rows, columns, channels) of a raster with ``guard`` pixels around it."""
        picture = self._part(raster, 0, 0)
        if self.transmission is not None:
            picture = picture * _like(raster, self.transmission)[..., None]
        for dy, dx in np.ndindex(3, 3) if self.detail is not None else ():
            share = _like(raster, self.detail[dy, dx])[..., None]  # type: ignore[index]
            picture = picture + share * self._part(raster, dy - 1, dx - 1)
        return picture

    def transpose(self, raster: Any) -> Any:
        """What each pixel of the raster adds to a weighted sum of the picture: an array of NumPy."""
        rows, columns, channels = raster.shape
        wide = np.zeros((rows + 2 * self.guard, columns + 2 * self.guard, channels))
        shares = [(0, 0, np.ones((rows, columns)) if self.transmission is None else self.transmission)]
        if self.detail is not None:
            shares += [(dy - 1, dx - 1, self.detail[dy, dx]) for dy, dx in np.ndindex(3, 3)]
        for down, across, share in shares:
            self._part(wide, down, across)[:] += share[..., None] * raster
        return wide

    def pull(self, raster: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative to the transmission, and to what its variation within pixels adds."""
        pulled = {}
        if "transmission" in wanted:
            pulled["transmission"] = self._agreeing(raster, weights, 0, 0)
        if "detail" in wanted:
            parts = [self._agreeing(raster, weights, dy - 1, dx - 1) for dy, dx in np.ndindex(3, 3)]
            pulled["detail"] = np.reshape(parts, (3, 3, *parts[0].shape))
        return pulled

    def _agreeing(self, raster: Any, weights: Any, down: int, across: int) -> Array:
        """The weights times the light of the pixels so far away, summed over the channels."""
        part = self._part(raster, down, across)
        return np.asarray(np.einsum("rck,rck->rc", np.asarray(weights, np.float64), part))

    def _part(self, raster: Any, down: int, across: int) -> Any:
        """The sensor's part of the raster, or what lies so many pixels further."""
        high, wide = raster.shape[0] - 2 * self.guard, raster.shape[1] - 2 * self.guard
        top, left = self.guard + down, self.guard + across
        return raster[top : top + high, left : left + wide, ...]


def finished(after: Sequence[After], raster: Any) -> Any:
    """The raster after all operators, in their order."""
    for operator in after:
        raster = operator.apply(raster)
    return raster


def merged(after: Sequence[After]) -> Iterator[After]:
    """The same with neighbouring filters along the axes made one."""
    last: After | None = None
    for operator in after:
        if isinstance(last, AlongAxes) and isinstance(operator, AlongAxes):
            last = last.before(operator)
            continue
        if last is not None:
            yield last
        last = operator
    if last is not None:
        yield last


# --- weights ---


def tent(half_width: float, beside: int | None = None) -> Array:
    """A tent of this half width in pixels, averaged over each pixel: an odd number of weights of sum 1.

    Args:
        half_width: pixels; 0 for none.
        beside: weights on each side of the middle; None: as many as it takes.
    """
    if half_width == 0:
        return np.ones(1)
    reach = math.ceil(half_width + 0.5) if beside is None else beside
    edges = np.clip((np.arange(-reach, reach + 2) - 0.5) / half_width, -1, 1)
    return np.diff(edges - np.sign(edges) * edges**2 / 2)


def spreading_matrix(weights: Array, samples: int) -> Array:
    """An odd number of weights as a matrix from samples to as many more as they reach, along one axis."""
    matrix = np.zeros((samples + len(weights) - 1, samples))
    for shift, weight in enumerate(weights):
        matrix[np.arange(samples) + shift, np.arange(samples)] = weight
    return matrix


def separable_terms(kernel: Array) -> list[tuple[Array, Array]]:
    """A kernel (rows, columns) as a sum of products of a column and a row, right to `RANK_TOLERANCE`."""
    down, strength, across = np.linalg.svd(kernel)
    return [
        (down[:, n] * strength[n], across[n])
        for n in range(len(strength))
        if strength[n] > RANK_TOLERANCE * strength[0]
    ]


def without_rounding(wide: Array) -> Array:
    """What Fourier transforms leave of no light, set to none."""
    return np.where(np.abs(wide) < ROUNDING * np.abs(wide).max(initial=0), 0.0, wide)


def _lags(weights: int) -> range:
    """How far each of an odd number of weights moves what it weighs."""
    return range(-(weights // 2), weights // 2 + 1)


def _along(raster: NDArray[Any], weights: Array, axis: int) -> NDArray[Any]:
    """The raster (rows, columns, channels) filtered along one axis, dark beyond its border."""
    if len(weights) == 1 and weights[0] == 1:
        return raster
    if len(weights) < LONG:
        from scipy.ndimage import convolve1d

        return np.asarray(convolve1d(raster, weights, axis=axis, mode="constant"))
    from scipy.signal import oaconvolve

    kernel = np.expand_dims(weights, [other for other in range(3) if other != axis])
    return without_rounding(oaconvolve(raster.astype(np.float64), kernel, mode="same", axes=axis))


def _mixed(raster: Any, terms: list[tuple[Array, Array]]) -> Any:
    """The raster of any library filtered by a sum of products of a column and a row."""
    xp = array_namespace(raster)
    rows, columns = raster.shape[:2]
    total = None
    for down, across in terms:
        vertical = _like(raster, _band(down, rows))
        horizontal = _like(raster, _band(across, columns))
        once = xp.tensordot(vertical, raster, axes=((1,), (0,)))
        mixed = xp.permute_dims(xp.tensordot(horizontal, once, axes=((1,), (1,))), (1, 0, 2))
        total = mixed if total is None else total + mixed
    return total


def _band(weights: Array, pixels: int) -> Array:
    """An odd number of weights as a matrix that filters so many pixels, dark beyond them."""
    reach = len(weights) // 2
    matrix = np.zeros((pixels, pixels))
    for shift, weight in zip(range(-reach, reach + 1), weights, strict=True):
        here = np.arange(max(shift, 0), min(pixels, pixels + shift))
        matrix[here, here - shift] += weight
    return matrix


def _like(raster: Any, numbers: Array) -> Any:
    """NumPy numbers as an array of the library, type and device of another."""
    if isinstance(raster, np.ndarray):
        return numbers
    xp = array_namespace(raster)
    return xp.asarray(np.ascontiguousarray(numbers), dtype=raster.dtype, device=device(raster))
