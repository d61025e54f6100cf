"""Blur by known point-spread functions: the forward model of deblurring, and its adjoint.

A recording is y = K x + noise: each point of the image x is spread over the pixels by its point-spread function
(PSF). If depth, and so the PSF, varies over the image, masks assign its parts to layers, and
K x = Σ_l k_l ∗ (m_l · x). This model conserves light; it ignores occlusion.

PSFs are arrays of floating-point numbers that sum to 1, rows before columns, in the orientation of the recording.
Element (rows // 2, columns // 2) is the share of light that stays at its pixel; the other elements are the shares
that move to the neighbouring pixels.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.checks import one_of
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.memory import check_memory
from vcc.recover.recorded import numbers_of

Array = NDArray[np.float64]
Borders = Literal["unknown", "periodic"]

SUM_TOLERANCE = 1e-6
"""Largest deviation from 1 of the sum of a PSF, or of the masks of a pixel."""


@dataclass(frozen=True, eq=False, repr=False)
class Blur(Brief):
    """K and its adjoint by FFT, on a domain that contains all light that can reach the recording.

    With periodic borders, the domain is the recording itself. With unknown borders, it is larger by the PSF,
    and only the recording's part of K x is observed: light from outside is estimated, not ignored.

    Args:
        psfs: of the layers, (layers, rows, columns).
        masks: of the layers over the domain, (layers, rows, columns), or None for a single layer.
        shape: (rows, columns) of the recording.
        domain: (rows, columns).
        start: (row, column) of the domain where the recording begins.
        transfer: of the layers, `scipy.fft.rfft2` of the PSFs on the domain.
    """

    psfs: Array
    masks: Array | None
    shape: tuple[int, int]
    domain: tuple[int, int]
    start: tuple[int, int]
    transfer: NDArray[np.complex128]

    @classmethod
    def of(
        cls,
        psf: ArrayLike,
        masks: ArrayLike | None,
        shape: tuple[int, int],
        borders: str,
        several: bool = False,
    ) -> Blur:
        """The blur of a recording.

        Args:
            psf: (rows, columns), or (layers, rows, columns).
            masks: see `blurred`.
            shape: (rows, columns) of the recording.
            borders: see `blurred`.
            several: whether there are several PSFs without masks.

        Raises:
            InputError: as for `blurred`.
        """
        from scipy import fft

        one_of("borders", borders, ("unknown", "periodic"))
        psfs = _checked_psf(psf, shape, several or masks is not None)
        size = psfs.shape[1:]
        middle = size[0] // 2, size[1] // 2
        if borders == "periodic":
            domain, start = shape, (0, 0)
        else:
            whole = [fft.next_fast_len(n + k - 1, real=True) for n, k in zip(shape, size, strict=True)]
            domain, start = (whole[0], whole[1]), (size[0] - 1 - middle[0], size[1] - 1 - middle[1])
        padded = np.zeros((len(psfs), *domain))
        padded[:, : size[0], : size[1]] = psfs
        padded = np.roll(padded, (-middle[0], -middle[1]), axis=(1, 2))
        layers = None if masks is None else _checked_masks(masks, len(psfs), shape)
        blur = cls(psfs, None, shape, domain, start, fft.rfft2(padded))
        if layers is not None:
            blur = replace(blur, masks=np.stack([blur.extended(each, "edge") for each in layers]))
        return blur

    def extended(self, picture: Array, how: Literal["edge", "wrap"]) -> Array:
        """An image (rows, columns) on the whole domain; its edges are repeated, or blended with opposite ones."""
        after = [whole - n - s for whole, n, s in zip(self.domain, self.shape, self.start, strict=True)]
        if how == "edge":
            return np.pad(picture, [(s, a) for s, a in zip(self.start, after, strict=True)], mode="edge")
        for axis in (0, 1):
            gap = self.start[axis] + after[axis]
            if gap == 0:
                continue
            last, first = picture.take([-1], axis), picture.take([0], axis)
            share = (np.arange(gap) + 1) / (gap + 1)
            bridge = last + (first - last) * (share[:, None] if axis == 0 else share)
            picture = np.roll(np.concatenate([picture, bridge], axis), self.start[axis], axis)
        return picture

    def seen(self, whole: Array) -> Array:
        """The recording's part of the domain."""
        (top, left), (rows, columns) = self.start, self.shape
        return whole[top : top + rows, left : left + columns]

    def unseen(self, part: Array) -> Array:
        """The adjoint of `seen`: zeros outside the recording."""
        whole = np.zeros(self.domain)
        self.seen(whole)[...] = part
        return whole

    def apply(self, whole: Array) -> Array:
        """K x, (rows, columns) of the recording, for x on the domain."""
        return self.seen(self.convolved(whole))

    def convolved(self, whole: Array) -> Array:
        """K x on the whole domain."""
        from scipy import fft

        layers = whole[None] if self.masks is None else self.masks * whole
        return np.asarray(fft.irfft2((self.transfer * fft.rfft2(layers)).sum(axis=0), s=self.domain))

    def adjoint(self, part: Array) -> Array:
        """Kᵀ y on the domain, for y of the recording's shape."""
        from scipy import fft

        spectrum = np.conj(self.transfer) * fft.rfft2(self.unseen(part))
        layers = np.asarray(fft.irfft2(spectrum, s=self.domain))
        return np.asarray(layers.sum(axis=0) if self.masks is None else (self.masks * layers).sum(axis=0))

    def check_memory(self, channels: int, copies: int, memory_limit: int | None) -> None:
        """Check the memory that the work needs.

        Args:
            channels: how many are deblurred together.
            copies: of the domain, per channel.
            memory_limit: bytes; None uses `vcc.base.memory.MEMORY_LIMIT`.

        Raises:
            InputError: more memory needed than allowed.
        """
        rows, columns = self.domain
        needed = 8 * rows * columns * (copies * channels + 5 * len(self.psfs))
        what = f"deblurring {channels} channels of {rows}×{columns} samples"
        check_memory(needed, memory_limit, what, "deblur channel by channel")


def blurred(
    picture: ArrayLike, psf: ArrayLike, *, masks: ArrayLike | None = None, borders: Borders = "unknown"
) -> Array:
    """The blurred image Σ_l k_l ∗ (m_l · x): the forward model of deblurring.

    Args:
        picture: (rows, columns[, channels]), any unit.
        psf: (rows, columns); with masks (layers, rows, columns).
        masks: (layers, rows, columns), the share of each pixel in each layer; None for a single layer.
        borders: "periodic" wraps light around: light that leaves on one side enters on the other; "unknown"
            repeats the image's edges, since the outside is unknown.

    Raises:
        InputError: a PSF that is larger than the image, not finite, negative or not of sum 1; masks of a
            wrong shape or sum; an image that is not finite.
    """
    values = numbers_of(picture, "the picture")
    blur = Blur.of(psf, masks, values.shape[:2], borders)
    channels = [blur.apply(blur.extended(each, "edge")) for each in channels_first(values)]
    return channels_last(np.stack(channels), values.shape)


def channels_first(values: Array) -> Array:
    """(rows, columns[, channels]) as (channels, rows, columns)."""
    return np.moveaxis(values.reshape(*values.shape[:2], -1), 2, 0)


def channels_last(channels: Array, shape: tuple[int, ...]) -> Array:
    """(channels, rows, columns) in the shape before `channels_first`."""
    return np.ascontiguousarray(np.moveaxis(channels, 0, 2)).reshape(shape)


def _checked_psf(psf: ArrayLike, shape: tuple[int, int], layered: bool) -> Array:
    psfs = np.asarray(psf)
    if psfs.dtype.kind not in "fiu":
        raise InputError(f"a PSF is an array of floating-point numbers, not of {psfs.dtype}")
    if psfs.ndim != (3 if layered else 2) or 0 in psfs.shape:
        axes = "(layers, rows, columns), one for each layer" if layered else "(rows, columns)"
        raise InputError(
            f"the PSF has the axes {axes}; this one has the shape {psfs.shape}"
            + ("" if layered or psfs.ndim != 3 else ". A PSF for each depth goes with masks=")
        )
    psfs = psfs.astype(np.float64).reshape(-1, *psfs.shape[-2:])
    for number, each in enumerate(psfs):
        name = f"PSF {number}" if layered else "the PSF"
        if not np.isfinite(each).all():
            bad = tuple(int(n) for n in np.argwhere(~np.isfinite(each))[0])
            raise InputError(f"{name} has {each[bad]} at index {bad}: it must be finite")
        if each.min() < -SUM_TOLERANCE:
            raise InputError(f"{name} is negative ({each.min():.6g}), but light is not: clip and normalise it")
        if abs(each.sum() - 1) > SUM_TOLERANCE:
            raise InputError(
                f"{name} sums to {each.sum():.9g}, not to 1: divide it by its sum (or, where light is lost, "
                "divide the recording by that share too)"
            )
        if each.shape[0] > shape[0] or each.shape[1] > shape[1]:
            raise InputError(
                f"{name} of {each.shape[0]}×{each.shape[1]} pixels is larger than the picture of "
                f"{shape[0]}×{shape[1]}: cut off its dark borders, or take a larger picture"
            )
    return psfs


def _checked_masks(masks: ArrayLike, layers: int, shape: tuple[int, int]) -> Array:
    values = np.asarray(masks, dtype=np.float64)
    if values.shape != (layers, *shape):
        raise InputError(
            f"{layers} PSFs and a picture of {shape[0]}×{shape[1]} need masks of shape {(layers, *shape)}, not "
            f"{values.shape}"
        )
    if not np.isfinite(values).all() or values.min() < 0:
        raise InputError("masks hold the share of each pixel in each layer: finite numbers, none negative")
    wrong = np.abs(values.sum(axis=0) - 1) > SUM_TOLERANCE
    if wrong.any():
        bad = (int(np.argwhere(wrong)[0][0]), int(np.argwhere(wrong)[0][1]))
        raise InputError(
            f"the masks of pixel {bad} sum to {values[:, bad[0], bad[1]].sum():.6g}, not to 1: each pixel is "
            "divided among the layers"
        )
    return values
