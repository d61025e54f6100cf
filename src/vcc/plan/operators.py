"""Linear operators before and after a plan's core, each with its transpose.

Operators before the core act on samples (v, u, t, s[, channels]) of some views, operators after it on the raster
(rows, columns, channels). All are linear, and ``transpose`` is the adjoint of ``apply``:
⟨apply(a), b⟩ = ⟨a, transpose(b)⟩. They accept arrays of NumPy and of other array libraries. ``pull`` is the
derivative of ⟨apply(a), b⟩ to the operator's own parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Sequence
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
"""Number of weights above which a filter is faster by Fourier transforms."""
ROUNDING = 1e-13
"""Share of the largest number: smaller results of Fourier transforms in double precision are rounding errors."""
RANK_TOLERANCE = 1e-8
SOFTENED: dict[Sample, int] = {"point": TENT, "mean": TENT + MEAN}
"""Number of times that the averaging over a sample, sinc(f), acts on looked-up values: twice by interpolation,
once more if samples are means over their pixels."""


class Before(Protocol):
    """An operator on samples before the core."""

    reach: int
    """Rows of pixels on each side of a block that are read with it."""
    copies: bool
    """Whether new samples are made, which take memory: columns of views are then processed one by one."""

    def apply(self, values: Any) -> Any:
        """Samples (v, u, t, s[, channels]) for the next operator, or the core."""
        ...

    def transpose(self, values: Any) -> Any:
        """The adjoint of `apply`."""
        ...

    def pull(self, values: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative of ⟨weights, apply(values)⟩ to the operator's parameters that are wanted, by name."""
        ...

    def block(self, block: Block) -> Block:
        """The block of the result's samples that a block of the given samples affects."""
        ...

    def made_of(self, pixels: Any) -> Any:
        """The pixels from which given pixels of the result are made; the caller clips those beyond a view.

        Args:
            pixels: first and stop of rows and of columns of pixels, (…, 2, 2).
        """
        ...

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """The shape of the result for samples of a shape."""
        ...

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """The type of the result for samples of a NumPy type, and the factor from its numbers to theirs."""
        ...


class After(Protocol):
    """An operator on the raster (rows, columns, channels) after the core."""

    def apply(self, raster: Any) -> Any:
        """The raster for the next operator, or the image."""
        ...

    def transpose(self, raster: Any) -> Any:
        """The adjoint of `apply`."""
        ...

    def pull(self, raster: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative of ⟨weights, apply(raster)⟩ to the operator's parameters that are wanted, by name."""
        ...


# --- before ---


@dataclass(frozen=True, eq=False)
class SwapPixelAxes(Value):
    """Swap rows and columns of pixels, for a frame that maps rows of views to columns of the sensor."""

    reach = 0
    copies = False

    def apply(self, values: Any) -> Any:
        """Samples (v, u, t, s[, channels]) as (v, u, s, t[, channels]), not copied if the library allows it."""
        if isinstance(values, np.ndarray):
            return values.swapaxes(2, 3)
        return array_namespace(values).permute_dims(values, (0, 1, 3, 2, *range(4, values.ndim)))

    transpose = apply

    def pull(self, values: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """There are no parameters."""
        return {}

    def block(self, block: Block) -> Block:
        """The same samples, with swapped axes."""
        return replace(block, pixel_rows=block.pixel_columns, pixel_columns=block.pixel_rows)

    def made_of(self, pixels: Any) -> Any:
        """The same pixels, with swapped axes."""
        return pixels[..., ::-1, :]

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """With rows and columns of pixels swapped."""
        return (*shape[:2], shape[3], shape[2], *shape[4:])

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """Unchanged."""
        return kind, 1.0


@dataclass(frozen=True, eq=False, repr=False)
class BlurViews(Brief, Value):
    """Each view convolved with a kernel, for a diffuser at the views; it grows by half the kernel on each side.

    Args:
        kernel: in samples, odd rows × odd columns of sum 1.
    """

    kernel: Array

    reach = 0
    copies = True

    def apply(self, values: Any) -> Any:
        """Samples (v, u, t, s[, channels]) convolved, in float32; float64 is kept."""
        if not isinstance(values, np.ndarray):
            return self._in_library(values)
        from scipy.signal import oaconvolve

        result = np.empty(self.shape(values.shape), dtype=self.kept_as(values.dtype)[0])
        weights = self.kernel if values.ndim == 4 else self.kernel[:, :, None]
        for view in np.ndindex(values.shape[:2]):
            # In double precision: otherwise rounding errors of the Fourier transforms would add up in dark
            # regions.
            result[view] = without_rounding(oaconvolve(values[view].astype(np.float64), weights, axes=(0, 1)))
        return result

    def transpose(self, values: Any) -> Any:
        """Samples of the grown views correlated with the kernel, cropped to the views: float64 of NumPy."""
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
        """The block grown by the kernel's size less one."""
        (first, stop), (left, right) = block.pixel_rows, block.pixel_columns
        high, wide = (n - 1 for n in self.kernel.shape)
        return replace(block, pixel_rows=(first, stop + high), pixel_columns=(left, right + wide))

    def made_of(self, pixels: Any) -> Any:
        """The pixels under the kernel, which extends before them in the grown view."""
        return pixels - np.stack([np.array(self.kernel.shape) - 1, [0, 0]], axis=-1)

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """With the rows and columns by which views grow."""
        rows, columns = self.kernel.shape
        return (*shape[:2], shape[2] + rows - 1, shape[3] + columns - 1, *shape[4:])

    def pull(self, values: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative to the kernel: the correlation of samples with weights of the grown views."""
        if "kernel" not in wanted:
            return {}
        rows, columns = self.kernel.shape
        total = np.zeros(self.kernel.shape)
        for view in np.ndindex(values.shape[:2]):
            grown, own = (np.asarray(array[view]).reshape(*array.shape[2:4], -1) for array in (weights, values))
            total += correlated(grown, own, range(rows), range(columns))
        return {"kernel": total}

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """Single precision; float64 is kept."""
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
    """Dark samples around a piece of a light field where the light field has samples that are not in the piece.

    Later operators spread the piece's light into the border as they do in the whole, so that the images of
    the pieces add up to the image of the whole.

    Args:
        halo: number of samples (before, after) along (v, u, t, s).
    """

    halo: tuple[tuple[int, int], ...]

    reach = 0
    copies = True

    def apply(self, values: Any) -> Any:
        """Samples (v, u, t, s[, channels]) with the border, of the same type."""
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
        """Samples without the border."""
        cut = (slice(a, n - b) for (a, b), n in zip(self.halo, values.shape[:4], strict=True))
        return values[(*cut, ...)]

    def pull(self, values: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """There are no parameters."""
        return {}

    def block(self, block: Block) -> Block:
        """The block grown by the border on each side."""
        grown = ((first, stop + a + b) for (first, stop), (a, b) in zip(block.ranges, self.halo, strict=True))
        return Block(*grown)

    def made_of(self, pixels: Any) -> Any:
        """The same pixels, counted without the border."""
        return pixels - np.array(self.halo)[2:, :1]

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """With the border."""
        grown = (n + a + b for n, (a, b) in zip(shape[:4], self.halo, strict=True))
        return (*grown, *shape[4:])

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """Unchanged."""
        return kind, 1.0


@dataclass(frozen=True, eq=False)
class SharpenViews(Value):
    """Each view filtered along k and along l, to compensate beforehand for linear look-ups.

    A ray interpolates linearly between the samples of a view. Averaged over all places within a sample, this
    filters the view with a tent, which removes 1 − sinc²(f) of a cosine of f cycles a sample: 3 % at 0.1, 7 % at
    0.15. If a sample is itself a mean over its pixel, light that is averaged over a sensor's pixel is averaged a
    second time, and loses 1 − sinc(f) more. Beyond a view's border its last samples are repeated, so that
    uniform views stay uniform.

    Args:
        weights: of a sample, of its neighbours and of the samples beyond, in 2⁻¹⁰ (`WEIGHT_DIGITS`), as
            returned by `of`.
    """

    weights: tuple[int, int, int]

    reach = 2  # `REACH`
    copies = True

    @classmethod
    def of(cls, sample: Sample) -> SharpenViews:
        """The filter of an image whose samples are as large as its pixels (`vcc.plan.sharpening`), rounded.

        Args:
            sample: "mean" or "point".
        """
        outer, inner = (
            round(float(weight) * 2**WEIGHT_DIGITS) for weight in along_axis(SOFTENED[sample], 1.0)[:2]
        )
        return cls((2**WEIGHT_DIGITS - 2 * inner - 2 * outer, inner, outer))

    def apply(self, values: Any) -> Any:
        """Samples (v, u, t, s[, channels]) sharpened: 8 bits as 16-bit integers, exactly; else floats."""
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
        """The transpose of the filter: float64 of NumPy, without rounding."""
        values = np.asarray(values, dtype=np.float64)
        for axis in (2, 3):
            matrix = np.zeros((values.shape[axis],) * 2)
            here = np.arange(values.shape[axis])
            for n, weight in zip(range(-2, 3), (*self.weights[:0:-1], *self.weights), strict=True):
                np.add.at(matrix, (here, np.clip(here + n, 0, len(here) - 1)), weight * 2.0**-WEIGHT_DIGITS)
            values = np.moveaxis(np.tensordot(matrix.T, values, axes=(1, axis)), 0, axis)
        return values

    def pull(self, values: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """Weights are integers, which are chosen and not learned."""
        return {}

    def block(self, block: Block) -> Block:
        """The same samples: the neighbours that are read with them are cut off again."""
        return block

    def made_of(self, pixels: Any) -> Any:
        """With the neighbours that the filter reads."""
        return pixels + np.array([-self.reach, self.reach])

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """Unchanged."""
        return shape

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """8 bits as fixed-point numbers of 16 bits; else single precision, or float64 if given."""
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
"""Samples on each side that affect a sharpened sample."""
WEIGHT_DIGITS = 10
"""Weights are integers in units of 2⁻¹⁰: uniform views stay exactly uniform, and 8-bit samples are exact."""
KEPT_DIGITS = 5
"""Binary digits after the point of 8-bit samples in 16 bits: 2⁻⁵ of a level, sixteen times finer than their
rounding, with room for values 4 times the range (the filter's are at most 3.4 times)."""


# --- after ---


@dataclass(frozen=True, eq=False, repr=False)
class AlongAxes(Brief, Value):
    """The raster filtered along its columns and along its rows, dark beyond its border.

    Args:
        down: an odd number of weights along columns.
        across: likewise along rows.
        words: purpose.
        half_widths: (vertical, horizontal) in pixels, if the weights are tents; see `tents`.
    """

    down: Array
    across: Array
    words: str
    half_widths: tuple[float, float] = (0.0, 0.0)

    @classmethod
    def tents(
        cls, vertical: float, horizontal: float, beside: tuple[int | None, int | None] = (None, None)
    ) -> AlongAxes:
        """The filter that fills the gaps between neighbouring views' images.

        Args:
            vertical: half width of the tent along columns, pixels; 0 for none.
            horizontal: likewise along rows.
            beside: weights on each side of the middle of both; None: as many as needed.
        """
        down, across = (tent(*each) for each in zip((vertical, horizontal), beside, strict=True))
        return cls(down, across, "gaps between views filled by tents", (vertical, horizontal))

    def apply(self, raster: Any) -> Any:
        """The raster (rows, columns, channels) filtered."""
        return self._filtered(raster, self.down, self.across)

    def transpose(self, raster: Any) -> Any:
        """Filtered by the reversed weights."""
        return self._filtered(raster, self.down[::-1], self.across[::-1])

    def pull(self, raster: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative to the weights along either axis; half widths are informative, with derivative zero."""
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
        """This filter followed by another, as one filter."""
        words = f"{self.words}, {other.words}"
        return AlongAxes(np.convolve(self.down, other.down), np.convolve(self.across, other.across), words)


@dataclass(frozen=True, eq=False, repr=False)
class Blur(Brief, Value):
    """The raster convolved with a kernel, dark beyond its border.

    Args:
        kernel: in pixels, odd rows × odd columns.
        words: purpose.
        scatters: whether it stands for a diffuser.
    """

    kernel: Array
    words: str
    scatters: bool = False

    def apply(self, raster: Any) -> Any:
        """The raster (rows, columns, channels) convolved, of the same size."""
        return self._convolved(raster, self.kernel)

    def transpose(self, raster: Any) -> Any:
        """Convolved with the kernel rotated by 180°."""
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

        # In double precision: otherwise rounding errors of the Fourier transforms would be visible in dark
        # regions.
        wide = oaconvolve(raster.astype(np.float64), kernel[:, :, None], mode="same", axes=(0, 1))
        return without_rounding(wide)


@dataclass(frozen=True, eq=False, repr=False)
class BlurByChannel(Brief, Value):
    """Each channel of the raster convolved with a kernel of its own, dark beyond its border.

    Args:
        kernel: in pixels, odd rows × odd columns × channels.
        words: purpose.
    """

    kernel: Array
    words: str

    def apply(self, raster: Any) -> Any:
        """The raster (rows, columns, channels) convolved, of the same size."""
        return self._each(raster, lambda one, blur: blur.apply(one))

    def transpose(self, raster: Any) -> Any:
        """Convolved with the kernels rotated by 180°."""
        return self._each(raster, lambda one, blur: blur.transpose(one))

    def pull(self, raster: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative to the kernels."""
        if "kernel" not in wanted:
            return {}
        lags = [_lags(length) for length in self.kernel.shape[:2]]
        each = range(self.kernel.shape[2])
        return {
            "kernel": np.stack(
                [correlated(weights[..., n : n + 1], raster[..., n : n + 1], *lags) for n in each], -1
            )
        }

    def _each(self, raster: Any, verb: Callable[[Any, Blur], Any]) -> Any:
        made = [
            verb(raster[..., n : n + 1], Blur(self.kernel[..., n], self.words))
            for n in range(self.kernel.shape[2])
        ]
        return (
            np.concatenate(made, -1)
            if isinstance(raster, np.ndarray)
            else array_namespace(raster).concat(made, axis=-1)
        )


@dataclass(frozen=True, eq=False, repr=False)
class OnSensor(Brief, Value):
    """The sensor's part of the raster, times the transmission of masks against the sensor.

    Args:
        guard: pixels of the raster on each side of the sensor.
        transmission: mean transmission of each pixel, (rows, columns), or None.
        detail: effect of the mask's variation within pixels, from the light of each pixel's 3×3 neighbours, (3, 3,
            rows, columns): [dy, dx] is the share of the pixel dy − 1 rows down and dx − 1 columns on; or None.
    """

    guard: int
    transmission: Array | None = None
    detail: Array | None = None

    def apply(self, raster: Any) -> Any:
        """The image (rows, columns, channels) of a raster with ``guard`` pixels around it."""
        picture = self._part(raster, 0, 0)
        if self.transmission is not None:
            picture = picture * _like(raster, self.transmission)[..., None]
        for dy, dx in np.ndindex(3, 3) if self.detail is not None else ():
            share = _like(raster, self.detail[dy, dx])[..., None]  # type: ignore[index]
            picture = picture + share * self._part(raster, dy - 1, dx - 1)
        return picture

    def transpose(self, raster: Any) -> Any:
        """The contribution of each pixel of the raster to a weighted sum of the image: an array of NumPy."""
        rows, columns, channels = raster.shape
        wide = np.zeros((rows + 2 * self.guard, columns + 2 * self.guard, channels))
        shares = [(0, 0, np.ones((rows, columns)) if self.transmission is None else self.transmission)]
        if self.detail is not None:
            shares += [(dy - 1, dx - 1, self.detail[dy, dx]) for dy, dx in np.ndindex(3, 3)]
        for down, across, share in shares:
            self._part(wide, down, across)[:] += share[..., None] * raster
        return wide

    def pull(self, raster: Any, weights: Any, wanted: Collection[str]) -> dict[str, Array]:
        """The derivative to the transmission, and to its variation within pixels."""
        pulled = {}
        if "transmission" in wanted:
            pulled["transmission"] = self._agreeing(raster, weights, 0, 0)
        if "detail" in wanted:
            parts = [self._agreeing(raster, weights, dy - 1, dx - 1) for dy, dx in np.ndindex(3, 3)]
            pulled["detail"] = np.reshape(parts, (3, 3, *parts[0].shape))
        return pulled

    def _agreeing(self, raster: Any, weights: Any, down: int, across: int) -> Array:
        """The weights times the light of the pixels displaced by (down, across), summed over the channels."""
        part = self._part(raster, down, across)
        return np.asarray(np.einsum("rck,rck->rc", np.asarray(weights, np.float64), part))

    def _part(self, raster: Any, down: int, across: int) -> Any:
        """The sensor's part of the raster, displaced by so many pixels."""
        high, wide = raster.shape[0] - 2 * self.guard, raster.shape[1] - 2 * self.guard
        top, left = self.guard + down, self.guard + across
        return raster[top : top + high, left : left + wide, ...]


def finished(after: Sequence[After], raster: Any) -> Any:
    """The raster after all operators, in order."""
    for operator in after:
        raster = operator.apply(raster)
    return raster


def merged(after: Sequence[After]) -> Iterator[After]:
    """The same operators, with neighbouring filters along the axes merged into one."""
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
        beside: weights on each side of the middle; None: as many as needed.
    """
    if half_width == 0:
        return np.ones(1)
    reach = math.ceil(half_width + 0.5) if beside is None else beside
    edges = np.clip((np.arange(-reach, reach + 2) - 0.5) / half_width, -1, 1)
    return np.diff(edges - np.sign(edges) * edges**2 / 2)


def spreading_matrix(weights: Array, samples: int) -> Array:
    """The matrix from samples along one axis to their full convolution with an odd number of weights."""
    matrix = np.zeros((samples + len(weights) - 1, samples))
    for shift, weight in enumerate(weights):
        matrix[np.arange(samples) + shift, np.arange(samples)] = weight
    return matrix


def separable_terms(kernel: Array) -> list[tuple[Array, Array]]:
    """A kernel (rows, columns) as a sum of products of a column and a row, accurate to `RANK_TOLERANCE`."""
    down, strength, across = np.linalg.svd(kernel)
    return [
        (down[:, n] * strength[n], across[n])
        for n in range(len(strength))
        if strength[n] > RANK_TOLERANCE * strength[0]
    ]


def without_rounding(wide: Array) -> Array:
    """Set the rounding errors of Fourier transforms in dark regions to zero."""
    return np.where(np.abs(wide) < ROUNDING * np.abs(wide).max(initial=0), 0.0, wide)


def _lags(weights: int) -> range:
    """The displacements of an odd number of weights."""
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
    """The raster of any library, filtered by a sum of products of a column and a row."""
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
    """The matrix of a filter with an odd number of weights on so many pixels, dark beyond them."""
    reach = len(weights) // 2
    matrix = np.zeros((pixels, pixels))
    for shift, weight in zip(range(-reach, reach + 1), weights, strict=True):
        here = np.arange(max(shift, 0), min(pixels, pixels + shift))
        matrix[here, here - shift] += weight
    return matrix


def _like(raster: Any, numbers: Array) -> Any:
    """NumPy numbers as an array of the library, type and device of another array."""
    if isinstance(raster, np.ndarray):
        return numbers
    xp = array_namespace(raster)
    return xp.asarray(np.ascontiguousarray(numbers), dtype=raster.dtype, device=device(raster))
