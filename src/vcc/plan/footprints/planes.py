"""Absorbing elements as the samples of a light field meet them: where, over what footprint, with what weight."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.plan.footprints.model import MaskLookup
from vcc.plan.sharpening import TENT, gain, symmetric
from vcc.shapes.patterns import Cells, Pattern
from vcc.shapes.sheets import in_one_plane

Array = NDArray[np.float64]

TEXTURE_POINTS_PER_FOOTPRINT = 3
"""Weights are looked up linearly between texture points this fine; what that takes is given back beforehand."""
LARGEST_TEXTURE = 4096
"""Points a side of a mask texture: 64 MiB."""
POINTS_AT_ONCE = 2**20
"""Points of a texture that are averaged at once, in float64: 8 MiB."""
PARTS_OF_A_CELL = 6
"""Parts each way by which the open part of a view's cell is found."""
DIVIDED = 4
"""Samples before the first and after the last at which finer ones may stand."""
TEXTURE_FILTER = 5
"""Weights on each side of a texture's filter, beside those that the box of a sample takes."""


@dataclass(frozen=True, eq=False)
class Plane:
    """An absorbing element as the samples meet it: place = at_index · (i, j, k, l) + offset, metres.

    Places are counted from the element's middle, which stands at ``decentre`` on the axis' plane.
    """

    pattern: Pattern
    label: str
    decentre: tuple[float, float]
    at_index: Array
    offset: Array

    @classmethod
    def at(cls, place: Array, patterns: list[tuple[Pattern, tuple[float, float]]], label: str) -> Plane:
        """The plane of all patterns that samples meet in one place.

        Args:
            place: (x, y) in metres from index (i, j, k, l, 1), 2×5.
            patterns: each with the place of its middle, metres.
            label: what they are called.
        """
        # About their common middle where they have one, as each of them would be by itself.
        decentre = patterns[0][1] if len({middle for _, middle in patterns}) == 1 else (0.0, 0.0)
        pattern = in_one_plane([(one, (x - decentre[0], y - decentre[1])) for one, (x, y) in patterns])
        return cls(pattern, label, decentre, place[:, :4], place[:, 4] - np.array(decentre))

    @classmethod
    def met_by(
        cls, frame: Affine, rays: Affine, pattern: Pattern, decentre: tuple[float, float], label: str
    ) -> Plane:
        """The plane of a pattern as samples of this frame meet it, ``rays`` leading from them to the plane."""
        return cls.at((rays @ frame).matrix[:2], [(pattern, decentre)], label)

    def middle_of_view(self, samples: tuple[int, int]) -> Array:
        """Where the middle of view (0, 0) falls, (x, y) in metres; views have (rows, columns) of samples."""
        rows, columns = samples
        return np.asarray(self.offset + self.sample_step @ np.array([(columns - 1) / 2, (rows - 1) / 2]))

    def view_weights(
        self, index: Array, shift: Array, motion: Array, samples: tuple[int, int], divide: int = 1
    ) -> Array:
        """The open share of each tap's cell, for a plane that tells views apart only; see `tap_origin`."""
        place = tap_origin(self.at_index, self.middle_of_view(samples), index, shift, motion)
        width, height = np.abs(self.view_step(motion)).sum(axis=1) / divide
        return self.pattern.mean(place[..., 0], place[..., 1], float(width), float(height))

    def view_step(self, motion: Array) -> Array:
        """2×2: metres moved here per view, a point of the scene being followed."""
        return np.asarray(self.at_index[:, :2] - self.at_index[:, 2:] @ motion)

    @property
    def sample_step(self) -> Array:
        """2×2: metres moved here per sample within a view."""
        return np.asarray(self.at_index[:, 2:])


def depends_on_view_only(plane: Plane, samples: tuple[int, int], motion: Array) -> bool:
    """Whether all samples of a view meet the plane in one place, but for rounding."""
    cell = np.abs(plane.view_step(motion)).sum(axis=1)
    travel = np.abs(plane.sample_step) @ np.array([samples[1], samples[0]])
    return bool((travel <= 1e-6 * cell).all())


def tap_origin(at_index: Array, offset: Array, index: Array, shift: Array, motion: Array) -> Array:
    """Where sample (0, 0) of each tap falls, (rows, columns, 2); shifts follow the scene's parallax."""
    view_step = at_index[:, :2] - at_index[:, 2:] @ motion
    return np.asarray(index @ at_index[:, :2].T + shift @ view_step.T + offset)


@dataclass(frozen=True, eq=False)
class OpenParts:
    """What of each tap's cell of the aperture is open.

    Args:
        weights: the open share of each tap's cell, (rows of taps, columns of taps).
        middle: the middle of the open part, in views from the middle of the cell, (rows, columns, 2) as (i, j).
    """

    weights: Array
    middle: Array


def open_parts(
    planes: list[Plane], index: Array, shift: Array, motion: Array, samples: tuple[int, int], divide: int
) -> OpenParts:
    """What of each tap's cell is open behind planes that tell views apart only; see `tap_origin`.

    A cell that a rim cuts is lit through a part of it, and what other masks do to that light they do around the
    middle of that part.
    """
    weights = np.ones(index.shape[:2])
    middle = np.zeros((*index.shape[:2], 2))
    if not planes:
        return OpenParts(weights, middle)
    for plane in planes:
        weights = weights * plane.view_weights(index, shift, motion, samples, divide)
    part = ((np.arange(PARTS_OF_A_CELL) + 0.5) / PARTS_OF_A_CELL - 0.5) / divide
    inside = np.stack(np.meshgrid(part, part), axis=-1)
    shape = (*index.shape[:2], PARTS_OF_A_CELL, PARTS_OF_A_CELL, 2)
    index_of_parts = np.broadcast_to(index[:, :, None, None], shape)
    shift_of_parts = shift[:, :, None, None] + inside
    shares = np.ones(shape[:4])
    for plane in planes:
        shares = shares * plane.view_weights(
            index_of_parts, shift_of_parts, motion, samples, divide * PARTS_OF_A_CELL
        )
    light = shares.sum(axis=(2, 3))
    lit = light > 0
    middle[lit] = (shares[..., None] * inside).sum(axis=(2, 3))[lit] / light[lit][:, None]
    if (
        len(planes) > 1
    ):  # planes apart from each other: what both leave of a cell is not the product of their shares
        weights = shares.mean(axis=(2, 3))
    return OpenParts(weights, middle)


def mask_lookup(
    plane: Plane,
    index: Array,
    shift: Array,
    motion: Array,
    samples: tuple[int, int],
    divide: int,
    fine: int,
    over_samples: bool = True,
) -> MaskLookup:
    """The mask averaged over a sample's footprint, as a texture, and where each sample reads it.

    Args:
        plane: the mask.
        index: of the views, (rows of taps, columns of taps, 2).
        shift: of the taps from them, in views.
        motion: see `tap_origin`.
        samples: (rows, columns) of a view.
        divide: parts of a view's cell, each way.
        fine: parts of a sample, each way.
        over_samples: whether to average over the sample's cell besides that of the view: samples that are points
            meet the mask in a point.
    """
    place = tap_origin(plane.at_index, plane.offset, index, shift, motion)
    step = plane.sample_step
    view_part = np.abs(plane.view_step(motion)).sum(axis=1) / divide
    sample_part = np.abs(step).sum(axis=1) / fine * over_samples
    footprint = np.hypot(view_part, sample_part)
    # The wider of the two boxes is taken by the pattern's own means, the other by a filter of the texture.
    wide, narrow = np.maximum(view_part, sample_part), np.minimum(view_part, sample_part)
    rows, columns = samples
    ends = [[k, l] for k in (-DIVIDED, columns - 1 + DIVIDED) for l in (-DIVIDED, rows - 1 + DIVIDED)]
    corners = np.array(ends) @ step.T
    low = (place.reshape(-1, 2)[:, None] + corners).min(axis=(0, 1))
    high = (place.reshape(-1, 2)[:, None] + corners).max(axis=(0, 1))
    bound = np.array(plane.pattern.size) / 2 + footprint
    low, high = np.maximum(low, -bound), np.minimum(high, bound)
    spacing = _texture_spacing(footprint, np.minimum(2 * bound, high - low))
    # Points lie on one lattice, whatever part of the mask is needed: pieces of a light field read the same.
    first, last = np.floor(low / spacing) - 1, np.ceil(high / spacing) + 1
    last = np.maximum(last, first + 2)
    start = first * spacing
    filters = [_texture_filter(float(narrow[n] / spacing[n])) for n in (0, 1)]
    margin = [len(weights) // 2 for weights in filters]
    grid_x = np.arange(first[0] - margin[0], last[0] + margin[0] + 1) * spacing[0]
    grid_y = np.arange(first[1] - margin[1], last[1] + margin[1] + 1) * spacing[1]
    means = np.empty((grid_y.size, grid_x.size), dtype=np.float32)
    for some in np.array_split(np.arange(grid_y.size), -(-means.size // POINTS_AT_ONCE)):
        means[some] = plane.pattern.mean(grid_x[None, :], grid_y[some, None], float(wide[0]), float(wide[1]))
    texture = _filtered(means, filters)
    return MaskLookup(
        texture=texture,
        column=(place[..., 0] - start[0]) / spacing[0],
        row=(place[..., 1] - start[1]) / spacing[1],
        step=_cleaned_lookup(step / spacing[:, None], samples),
        label=plane.label,
    )


def _texture_filter(box: float) -> Array:
    """The filter of a texture along one axis: a mean over a box, and what looking it up linearly takes.

    Args:
        box: its width in points of the texture.
    """
    return symmetric(
        lambda frequency: np.sinc(box * frequency) * gain(TENT, frequency), TEXTURE_FILTER + math.ceil(box / 2)
    )


def _filtered(means: NDArray[np.float32], filters: list[Array]) -> NDArray[np.float32]:
    """Means (rows, columns) filtered along columns and rows, without the margin that this takes."""
    from scipy.ndimage import convolve1d

    (across, down) = filters
    down_done = convolve1d(means, down, axis=0, mode="constant")[len(down) // 2 : len(means) - len(down) // 2]
    wide = convolve1d(down_done, across, axis=1, mode="constant")
    return np.ascontiguousarray(wide[:, len(across) // 2 : wide.shape[1] - len(across) // 2])


def texture_error(texture: NDArray[np.float32]) -> float:
    """By how much what is looked up between points of a texture errs, root mean square over all places.

    Textures make up for what linear interpolation takes, on average over places: of a curvature c, in points, what
    is looked up a of the way between two points errs by c/12 − c·a(1 − a)/2, whose root mean square is c/√720. The
    curvature is taken where the truth is known, at every second point between its neighbours.

    Args:
        texture: (rows, columns).

    Returns:
        A share of the largest value.
    """
    largest = float(texture.max(initial=0.0))
    if largest == 0:
        return 0.0
    squares = 0.0
    for along in (texture, texture.T):
        inner = along[:, : 1 + (along.shape[1] - 1) // 2 * 2]
        if inner.shape[1] >= 3:
            off = inner[:, 1:-1:2] - (inner[:, :-2:2] + inner[:, 2::2]) / 2  # half of the curvature
            squares += float(np.mean(np.square(off, dtype=np.float64)))
    return math.sqrt(squares) * 2 / math.sqrt(720) / largest


def _cleaned_lookup(step: Array, samples: tuple[int, int]) -> Array:
    return np.where(np.abs(step) * max(samples) < 1e-6, 0.0, step)


def detail_lost(plane: Plane, known: Array, added: Array) -> float:
    """The share of a pattern's variance that averaging over ``added`` takes away after ``known``, metres."""
    size = np.minimum(np.array(plane.pattern.size), 1.0)
    if not np.isfinite(plane.pattern.size).all():
        size = np.full(2, 64 * max(*known, *added))
    if (added <= 0).all():
        return 0.0
    fine = np.maximum(np.maximum(known, added) / 8, size / 512)
    counts = np.maximum(np.ceil(size / fine).astype(int), 8)
    x = ((np.arange(counts[0]) + 0.5) / counts[0] - 0.5) * size[0]
    y = ((np.arange(counts[1]) + 0.5) / counts[1] - 0.5) * size[1]
    # Averaged once as finely as it is looked at, and these means averaged further.
    values = np.broadcast_to(plane.pattern.mean(x[None, :], y[:, None], *(size / counts)), counts[::-1])
    whole = values.var()
    if whole < 1e-12:
        return 0.0
    means = Cells(np.clip(values, 0.0, 1.0), float(size[0]), float(size[1]))
    # A pattern without bounds goes on beyond what is looked at: only what lies within is compared.
    across, down = (
        slice(None) if np.isfinite(bound) else slice(reach, max(count - reach, reach + 1))
        for bound, count, reach in zip(
            plane.pattern.size,
            counts,
            np.ceil(np.hypot(known, added) / 2 / (size / counts)).astype(int),
            strict=True,
        )
    )

    def variance(box: Array) -> float:
        wide, high = np.maximum(box, size / counts)
        return float(means.mean(x[None, across], y[down, None], float(wide), float(high)).var())

    return (variance(known) - variance(np.hypot(known, added))) / float(whole)


def _texture_spacing(footprint: Array, extent: Array) -> Array:
    """Distance between texture points along (x, y): a share of the footprint, doubled until the texture fits."""
    spacing = np.where(footprint > 0, footprint / TEXTURE_POINTS_PER_FOOTPRINT, np.maximum(extent, 1e-9) / 1024)
    too_many = np.maximum(extent / spacing / (LARGEST_TEXTURE - 4), 1.0)
    return np.asarray(spacing * 2 ** np.ceil(np.log2(too_many)))
