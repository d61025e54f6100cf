"""Footprints: how a sample's light falls on the pixels, along one axis.

A sample at pixel coordinate x (pixel m covers m − ½ … m + ½) spreads its light over a footprint φ((·−x)/b)/|b|,
where b is the step from one sample to the next, in pixels. Pixel m receives the share

    F(m) = Φ((m + ½ − x)/b) − Φ((m − ½ − x)/b),        Φ(a) = ∫₋∞ᵃ φ,

exactly, for any b. (If only a share a of a pixel's width is sensitive, ½ becomes a/2, and F is divided by a:
the mean over the sensitive area.) Over the pixels the shares sum to one, so no light is lost; over equally
spaced samples they sum to 1/|b|, so uniform light stays uniform. Nothing is singular at b = 0, where a whole
view falls into one point. Seen from the sample this is forward evaluation (splatting), seen from the pixel it
is backward evaluation (interpolating, then averaging over the pixel); the shares are the same.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief

Array = NDArray[np.float64]

REACH = {"nearest": 0.5, "linear": 1.0, "cubic": 2.0, "spline": 2.0, "box": 0.5}
"""Half the width of each interpolation's footprint, in samples. ``"spline"`` is a cubic B-spline: it interpolates
only together with the filter of the image that inverts it at the samples (`vcc.plan.sharpening`).
``"box"`` is for divided samples: they are interpolated linearly, and each finer sample fills its own cell
uniformly, so that behind a hard edge of a mask no light leaves the cell that transmitted it."""

SMALLEST_STEP = 1e-7
"""Plans keep steps from sample to sample at this or above, in pixels, to avoid division by zero: a view that falls
into a point becomes a ten-millionth of a pixel times its samples wide."""

TIE = 1e-9
"""Pixels by which ``"nearest"`` moves its borders, so that a sample exactly between two pixels always goes to the
same one despite rounding."""


def cumulative(interpolation: str, a: Any, xp: Any = np) -> Any:
    """Φ(a), the integral of the footprint from −∞ to a, for arrays of any library.

    Args:
        interpolation: ``"linear"`` (a tent), ``"cubic"`` (Catmull-Rom, Keys 1981 with a = −½), ``"spline"`` (a
            cubic B-spline) or ``"box"``.
        a: positions in samples from the footprint's middle.
        xp: the array namespace of ``a``.
    """
    r = xp.clip(xp.abs(a), 0.0, REACH[interpolation])
    if interpolation == "box":
        half = r
    elif interpolation == "linear":
        half = r - r * r / 2
    elif interpolation == "spline":
        inner = xp.clip(r, 0.0, 1.0)
        # ∫₀ʳ ⅔ − x² + x³/2, and from 1 on the rest of a half, ∫ (2 − x)³/6
        near = inner * (2.0 / 3.0 + inner * inner * (inner / 8 - 1.0 / 3.0))
        left = (2 - r) * (2 - r)
        half = xp.where(r < 1, near, 0.5 - left * left / 24)
    else:
        inner = xp.clip(r, 0.0, 1.0)
        outer = xp.clip(r, 1.0, 2.0)
        # ∫₀ʳ 1.5x³ − 2.5x² + 1, then ∫₁ʳ −0.5x³ + 2.5x² − 4x + 2
        half = inner * (1 + inner * inner * (inner * (3.0 / 8.0) - 5.0 / 6.0))
        half = half + (_outer(outer) - _outer(1.0))
    return 0.5 + xp.sign(a) * half


def _outer(r: Any) -> Any:
    return r * (2 + r * (r * (5.0 / 6.0 - r / 8) - 2))  # powers by ** take many times as long


def weight(interpolation: str, distance: Any) -> Any:
    """φ at a distance in samples: how values between samples are interpolated."""
    r = np.abs(distance)
    if interpolation in ("nearest", "box"):
        return np.astype((distance >= -0.5) & (distance < 0.5), np.float64)
    if interpolation == "linear":
        return np.clip(1 - r, 0.0, 1.0)
    if interpolation == "spline":
        inner = np.clip(r, 0.0, 1.0)
        left = np.clip(2 - r, 0.0, 1.0)
        return np.where(r < 1, 2.0 / 3.0 + inner * inner * (inner / 2 - 1), left * left * left / 6)
    near = (1.5 * r - 2.5) * r * r + 1
    far = ((-0.5 * r + 2.5) * r - 4) * r + 2
    return np.where(r < 1, near, np.where(r < 2, far, np.zeros_like(r)))


def shares(interpolation: str, pixel: Any, position: Any, step: float, opening: float = 1.0, xp: Any = np) -> Any:
    """F: the share of a sample's light that each pixel receives, for arrays that broadcast.

    ``"nearest"`` follows the paper: if samples are closer than pixels, each falls into the pixel that contains
    it (forward); if they are further apart, each pixel takes the sample nearest to its middle (backward).

    Args:
        interpolation: a key of `REACH`.
        pixel: pixel indices, as floating point.
        position: the samples' pixel coordinates.
        step: pixels from one sample to the next, of any sign, not 0.
        opening: the share of a pixel's width that is sensitive, around its middle.
        xp: the array namespace of the arrays.
    """
    size = abs(step)
    offset = pixel - position
    if interpolation == "nearest":
        reach = max(size, 1.0) / 2
        inside = (offset >= -reach - TIE) & (offset < reach - TIE)
        return xp.astype(inside, offset.dtype) / max(size, 1.0)
    upper = cumulative(interpolation, (offset + opening / 2) / size, xp)
    return (upper - cumulative(interpolation, (offset - opening / 2) / size, xp)) / opening


def share_slopes(
    interpolation: str, pixel: Any, position: Any, step: float, opening: float = 1.0
) -> tuple[Array, Array, Array]:
    """The derivatives of F to a sample's pixel coordinate, to the size |step| and to the opening.

    With a = (m + h − x)/|b| and c = (m − h − x)/|b|, h half the opening, F = (Φ(a) − Φ(c))/2h. Its derivatives are
    (φ(c) − φ(a))/2h|b| to x, (c·φ(c) − a·φ(a))/2h|b| to |b|, and (φ(a) + φ(c))/4h|b| − F/2h to 2h.

    Args:
        interpolation: all but ``"nearest"``, whose borders have no slope.
        pixel: see `shares`.
        position: see `shares`.
        step: see `shares`.
        opening: see `shares`.
    """
    size = abs(step)
    upper, lower = ((pixel - position + side * opening / 2) / size for side in (1, -1))
    at_upper, at_lower = weight(interpolation, upper), weight(interpolation, lower)
    share = (cumulative(interpolation, upper) - cumulative(interpolation, lower)) / opening
    return (
        (at_lower - at_upper) / (opening * size),
        (lower * at_lower - upper * at_upper) / (opening * size),
        (at_upper + at_lower) / (2 * opening * size) - share / opening,
    )


def reach_in_pixels(interpolation: str, size: float) -> float:
    """The largest distance in pixels between a sample and the middle of a pixel that receives a share.

    Args:
        interpolation: a key of `REACH`.
        size: pixels from one sample to the next, greater than 0.
    """
    reach = max(size, 1.0) / 2 if interpolation == "nearest" else REACH[interpolation] * size + 0.5
    return reach + 1e-6  # pixels reached only by rounding are included


@dataclass(frozen=True, repr=False)
class Taps(Brief):
    """Shares as a table by pixel: pixel m gathers ``weights[..., m, n]`` of sample ``first[..., m] + n``.

    Args:
        first: index of the first sample that reaches each pixel, within the existing samples.
        weights: the shares of the samples from there on, zero beyond the last.
    """

    first: NDArray[np.int64]
    weights: NDArray[Any]

    def mirrored(self) -> Taps:
        """The table for pixels counted from the other end."""
        return Taps(
            np.ascontiguousarray(self.first[..., ::-1]),
            np.ascontiguousarray(self.weights[..., ::-1, :]),
        )

    def by_sample(self, samples: int) -> Taps:
        """The table by sample: sample n gives ``weights[..., n, m]`` of its light to pixel ``first[..., n] + m``.

        Args:
            samples: number of samples.
        """
        *tables, pixels, width = self.weights.shape
        shares = self.weights.reshape(-1, pixels, width)
        table, pixel, tap = np.nonzero(shares)
        which = table * samples + self.first.reshape(-1, pixels)[table, pixel] + tap
        first = np.full(len(shares) * samples, pixels)
        last = np.full(len(shares) * samples, -1)
        np.minimum.at(first, which, pixel)
        np.maximum.at(last, which, pixel)
        weights = np.zeros((len(first), max(int((last - first).max(initial=0)) + 1, 1)), dtype=np.float32)
        weights[which, pixel - first[which]] = shares[table, pixel, tap]
        shape = (*tables, samples)
        return Taps(np.minimum(first, pixels - 1).reshape(shape), weights.reshape(*shape, -1))


PIXELS_AT_ONCE = 2**14
"""Pixels whose shares are computed in one piece."""


def taps(
    interpolation: str,
    origin: Array,
    step: float,
    samples: int,
    pixels: int,
    opening: float = 1.0,
    kind: type[np.floating] = np.float32,
) -> Taps:
    """The table of shares for rows of samples at ``origin + step · index``, in pixels.

    Args:
        interpolation: a key of `REACH`.
        origin: pixel coordinate of sample 0, any shape; the table has one row for each.
        step: pixels from one sample to the next.
        samples: number of samples.
        pixels: number of pixels.
        opening: the share of a pixel's width that is sensitive.
        kind: type of the shares.
    """
    size = abs(step)
    reach = reach_in_pixels(interpolation, size)
    origin = np.asarray(origin, dtype=np.float64)
    # In pieces, so that temporary arrays take no more memory than the table.
    pieces = [slice(start, min(start + PIXELS_AT_ONCE, pixels)) for start in range(0, pixels, PIXELS_AT_ONCE)]
    first, count = (np.empty((*origin.shape, pixels), dtype=np.int64) for _ in range(2))
    for piece in pieces:
        middle = (np.arange(piece.start, piece.stop, dtype=np.float64) - origin[..., None]) / step
        first[..., piece] = np.clip(np.ceil(middle - reach / size), 0, samples)
        high = np.clip(np.floor(middle + reach / size), -1, samples - 1)
        count[..., piece] = np.maximum(high.astype(np.int64) - first[..., piece] + 1, 0)
    width = max(int(count.max(initial=0)), 1)
    table = np.empty((*origin.shape, pixels, width), dtype=kind)
    for piece in pieces:
        pixel = np.arange(piece.start, piece.stop, dtype=np.float64)
        position = origin[..., None, None] + step * (first[..., piece, None] + np.arange(width))
        found = shares(interpolation, pixel[:, None], position, step, opening)
        table[..., piece, :] = np.where(np.arange(width) < count[..., piece, None], found, 0.0)
    return Taps(np.minimum(first, samples - 1), table)


@dataclass(frozen=True, repr=False)
class Division(Brief):
    """Samples along one axis divided into finer ones: fine sample n takes shares of a few samples.

    Fine samples are ``1/refine`` apart, from half a footprint before the first sample to half a footprint
    after the last; each takes φ(distance)/refine of a sample. So a sample's light is only redistributed, and
    pieces of a light field are divided as the whole is.

    Args:
        start: index, in samples, of fine sample 0.
        first: for each fine sample, the first sample that it takes from, 0 or more.
        shares: (fine samples, width), zero beyond the last sample.
    """

    start: float
    first: NDArray[np.int64]
    shares: Array

    @classmethod
    def of(cls, interpolation: str, samples: int, refine: int, sharpen: Array | None = None) -> Division:
        """Divide ``samples`` samples into ``refine`` parts each, with the given interpolation.

        Args:
            interpolation: ``"nearest"``, ``"linear"`` or ``"cubic"``; ``"box"`` interpolates linearly.
            samples: number of samples.
            refine: parts of each.
            sharpen: an odd number of weights of a filter that is applied to samples before they are
                interpolated; a fine sample is then the mean of the interpolation over its own cell, not the
                value in its middle.
        """
        interpolation = "linear" if interpolation == "box" else interpolation
        weights = np.ones(1) if sharpen is None else sharpen
        reach = REACH[interpolation] + len(weights) // 2
        fine = round((samples - 1 + 2 * reach) * refine)
        start = -reach + 0.5 / refine
        place = start + np.arange(fine) / refine
        first = np.clip(np.ceil(place - reach), 0, samples - 1).astype(np.int64)
        index = first[:, None] + np.arange(math.ceil(2 * reach))
        distance = place[:, None] - index
        if sharpen is None:
            shares = weight(interpolation, distance) / refine
        else:
            middle, half = len(weights) // 2, 0.5 / refine
            shares = np.zeros(distance.shape)
            for n, one in enumerate(weights):
                upper = cumulative(interpolation, distance - (n - middle) + half)
                shares += one * (upper - cumulative(interpolation, distance - (n - middle) - half))
        return cls(start, first, np.where(index < samples, shares, 0.0))

    def matrix(self, samples: int) -> Array:
        """The shares as a matrix (fine samples, samples)."""
        dense = np.zeros((len(self.first), samples + self.shares.shape[1]))
        rows = np.arange(len(self.first))[:, None]
        dense[rows, self.first[:, None] + np.arange(self.shares.shape[1])] = self.shares
        return dense[:, :samples]
