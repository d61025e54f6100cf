"""Depth from one image through a biprism, by matching its two halves (Lee, Kweon and Cipolla 1999).

Through either half of a biprism that deflects light towards its ridge, a point appears shifted sideways by
δ·Z. The lens behind it forms two images of the point on the two halves of the sensor, Δ = 2·δ·Z·d/(Z + a)
apart. Z is the distance before the biprism, a the distance from the biprism to the lens, and d from the lens
to the sensor. Unlike blur, Δ is monotonic in Z: each separation corresponds to one distance.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError, warn_of_result
from vcc.base.showing import Shown
from vcc.camera import Camera
from vcc.image import Image
from vcc.optics import Biprism, Lens
from vcc.recover.recorded import grey, numbers_of

Array = NDArray[np.float64]

MANY_ENDED = 0.01
"""The share of blocks whose search ended at an end of the range from which on a warning is given."""
_FLOOR = 2e-3  # of the brightest pixel: lower contrast is not texture
_REFINEMENTS = 6
_AHEAD = 0.05  # lead in correlation of the best match that gives full confidence


@dataclass(frozen=True, eq=False, repr=False)
class StereoDepth(Brief, Shown):
    """The distances of blocks of the right half of the image on the sensor (x > 0, inverted as light lands).

    Args:
        separation: of the block's two images, pixels, shape (block rows, block columns); NaN if a block has
            no match inside the image.
        distance: metres before the entrance plane, same shape; infinite for separations at or beyond that of
            infinity; NaN if a block has no match, or the best match is at an end of the range.
        confidence: 0 (no texture, no match, or several equal ones) to 1, same shape.
        rows: the row of each block's centre, pixels, shape (block rows,).
        columns: the column, shape (block columns,).
    """

    separation: Array
    distance: Array
    confidence: Array
    rows: Array
    columns: Array


@dataclass(frozen=True)
class BiprismStereo:
    """A biprism before a lens as a stereo camera: analytic separations and distances.

    Args:
        deflection: δ of each half, a slope, greater than 0 (towards the ridge).
        place: z of the biprism behind the entrance plane, metres.
        ahead: a, from the biprism to the lens, metres.
        behind: d, from the lens to the sensor, metres.

    Raises:
        InputError: a deflection that is not positive, or a biprism that is not before the lens.
    """

    deflection: float
    place: float
    ahead: float
    behind: float

    def __post_init__(self) -> None:
        if not self.deflection > 0:
            raise InputError(
                f"the biprism bends by {self.deflection:g}: only with a deflection greater than 0, towards the "
                "ridge, do both halves see the same objects"
            )
        if not (self.ahead > 0 and self.behind > 0):
            raise InputError(
                f"the biprism stands {self.ahead * 1e3:g} mm before the lens, and the sensor "
                f"{self.behind * 1e3:g} mm behind it: both must be greater than 0. "
                "Without a distance between biprism and lens there is no baseline"
            )

    @classmethod
    def of(cls, camera: Camera) -> BiprismStereo:
        """The stereo camera formed by a biprism and a lens.

        Raises:
            InputError: elements other than one biprism and one lens behind it, a rotated biprism, elements
                off the axis, or an error of `BiprismStereo`.
        """
        return _parts(camera)[0]

    @property
    def baseline(self) -> float:
        """2·δ·a, metres: the distance between the two equivalent cameras."""
        return 2 * self.deflection * self.ahead

    def separation_of(self, distance: float) -> float:
        """Δ on the sensor, metres, for a distance before the entrance plane, metres (infinity allowed)."""
        away = distance + self.place
        return 2 * self.deflection * self.behind / (1 + self.ahead / away)

    def distance_of(self, separation: float) -> float:
        """The distance before the entrance plane, metres: the inverse of `separation_of`.

        Infinite for separations of 2·δ·d, that of infinity, and more.
        """
        rest = 2 * self.deflection * self.behind - separation
        return math.inf if rest <= 0 else self.ahead * separation / rest - self.place


def depth_by_biprism(
    image: Image, camera: Camera, distance_range: tuple[float, float], *, block: int = 21, step: int | None = None
) -> StereoDepth:
    """Depth from a recording through a biprism and a lens.

    Blocks of the right half are matched in the left half by normalised correlation over the range of
    separations, then refined to a fraction of a pixel by least squares over separation, gain and offset
    (Lucas and Kanade 1981, with cubic splines between pixels). The strip in the middle of the sensor that
    receives light of both halves is ignored.

    Args:
        image: as the camera captured it (not upright).
        camera: one `vcc.Biprism` at rotation 0 and one `vcc.Lens` with a diameter, on the axis.
        distance_range: (nearest, farthest) before the entrance plane, metres; infinity is allowed.
        block: side of the blocks, pixels, an odd number.
        step: from block to block, pixels; None uses half a block.

    Raises:
        InputError: a camera that is not such a stereo camera, an image that is upright, has NaNs or does not
            fit the sensor, an invalid range, or an image too small for a block and its partner.

    Warns:
        ResultWarning: at least 1 % of the blocks match best at an end of the range.
    """
    stereo, lens = _parts(camera)
    values = _checked(image, camera)
    near, far = distance_range
    if not 0 < near <= far:
        raise InputError(f"distance_range is (nearest, farthest) in metres, greater than 0, not {distance_range}")
    if not (block >= 5 and block % 2 == 1):
        raise InputError(f"block is an odd number of pixels, 5 or more, not {block}")
    step = max(1, block // 2) if step is None else step
    pitch = camera.sensor.pitches[1]
    # One more pixel on either side, so that the best match has neighbours.
    lowest = math.floor(stereo.separation_of(near) / pitch) - 1
    highest = math.ceil(stereo.separation_of(far) / pitch) + 1
    rows, columns, half = _blocks(camera, stereo, lens, block, step, lowest)
    shifts = np.arange(lowest, highest + 1)
    correlation = _correlations(values, rows, columns, shifts, half, _mixed(stereo, lens), camera)
    best = correlation.argmax(axis=0)
    found = np.isfinite(correlation.max(axis=0))
    separation, confidence = _refined(values, rows, columns, shifts[best].astype(np.float64), half)
    at_end = (best == 0) | (best == len(shifts) - 1)
    lost = ~found | at_end | (np.abs(separation - shifts[best]) > 1.5)
    confidence *= _distinct(correlation)
    confidence[lost] = 0
    separation[~found] = np.nan
    separation[found & lost] = shifts[best][found & lost]
    ended = (found & at_end).mean(dtype=np.float64)
    if ended >= MANY_ENDED:
        warn_of_result(
            f"{ended:.1%} of the blocks match best at an end of distance_range: they are outside it, or have no "
            "texture, and their distance is NaN. Try a wider range"
        )
    distance = np.array(
        [
            math.nan if is_lost else stereo.distance_of(each * pitch)
            for each, is_lost in zip(separation.ravel(), lost.ravel(), strict=True)
        ]
    )
    return StereoDepth(
        separation, distance.reshape(separation.shape), confidence, rows.astype(float), columns.astype(float)
    )


def _parts(camera: Camera) -> tuple[BiprismStereo, Lens]:
    elements = camera.elements
    prism, lens = (*elements, None, None)[:2]
    if len(elements) != 2 or not isinstance(prism, Biprism) or not isinstance(lens, Lens):
        names = ", ".join(element.label for element in elements) or "none"
        raise InputError(
            f"biprism stereo needs one biprism and one lens behind it; this camera's elements: {names}"
        )
    for element in (prism, lens):
        if element.decentre != (0.0, 0.0):
            raise InputError(f"{element.label} is off the axis: biprism stereo needs it at (0, 0)")
    if prism.rotation != 0:
        raise InputError(
            f"{prism.label} is turned by {prism.rotation:g} rad: biprism stereo needs its ridge upright, "
            "rotation 0"
        )
    stereo = BiprismStereo(prism.deflection, prism.z, lens.z - prism.z, camera.sensor.z - lens.z)
    return stereo, lens


def _checked(image: Image, camera: Camera) -> Array:
    if image.shape[:2] != camera.sensor.shape:
        raise InputError(
            f"the picture has {image.shape[0]}×{image.shape[1]} pixels, and the camera's sensor "
            f"{camera.sensor.shape[0]}×{camera.sensor.shape[1]}: give what this camera captured"
        )
    if not image.inverted:
        raise InputError("the picture is turned upright: give it as the camera captured it")
    return grey(numbers_of(image, "the picture"))


def _mixed(stereo: BiprismStereo, lens: Lens) -> float:
    """Half the width of the strip on the sensor that receives light of both halves, metres.

    A ray from x on the sensor through p on the lens meets the biprism at p·(1 + a/d − a/f) − x·a/d: both
    signs occur if |x| is less than the result.
    """
    if lens.diameter is None:
        raise InputError(
            f"{lens.label} has no diameter, so that light of both halves mixes everywhere: give it one"
        )
    a, d = stereo.ahead, stereo.behind
    return abs(1 + a / d - a / lens.focal_length) * lens.diameter / 2 * d / a


def _blocks(
    camera: Camera, stereo: BiprismStereo, lens: Lens, block: int, step: int, lowest: int
) -> tuple[NDArray[np.intp], NDArray[np.intp], int]:
    """Centres of blocks in the right half of the image whose partner can be in the left half."""
    half = block // 2
    places = camera.sensor.column_places
    pitch = camera.sensor.pitches[1]
    mixed = _mixed(stereo, lens) + (half + 1) * pitch
    widest = 2 * stereo.deflection * stereo.behind
    columns = np.flatnonzero((places > mixed) & (places < widest - mixed))
    columns = columns[(columns >= half) & (columns < len(places) - half) & (columns - lowest - half >= 0)]
    rows = np.arange(half, camera.sensor.shape[0] - half)
    if not (rows.size and columns.size):
        raise InputError(
            f"no block of {block} pixels and its partner lie on the sensor: the two pictures are up to "
            f"{widest / pitch:.0f} pixels apart, the strip between them where both mix is "
            f"{2 * _mixed(stereo, lens) / pitch:.0f} pixels wide, and the sensor has {camera.sensor.shape[0]}×"
            f"{camera.sensor.shape[1]}. A narrower lens, a larger sensor or a stronger biprism would do"
        )
    return rows[::step], columns[::step], half


def _correlations(
    values: Array,
    rows: NDArray[np.intp],
    columns: NDArray[np.intp],
    shifts: NDArray[np.intp],
    half: int,
    mixed: float,
    camera: Camera,
) -> Array:
    """Normalised correlation of each block with its partner at each separation; −∞ if there is no partner."""
    windows = np.lib.stride_tricks.sliding_window_view(values, (2 * half + 1, 2 * half + 1))
    floor = (_FLOOR * values.max()) ** 2
    own = _standard(windows[np.ix_(rows - half, columns - half)], floor)
    places = camera.sensor.column_places
    reach = (half + 1) * camera.sensor.pitches[1]
    result = np.full((len(shifts), len(rows), len(columns)), -np.inf)
    for n, shift in enumerate(shifts):
        partner = columns - shift
        # Space for cubic interpolation on the left; the other half is on the right.
        there = partner - half >= 2
        there &= places[np.clip(partner, 0, len(places) - 1)] < -(mixed + reach)
        if there.any():
            other = _standard(windows[np.ix_(rows - half, partner[there] - half)], floor)
            result[n][:, there] = np.einsum("rcij,rcij->rc", own[:, there], other)
    return result


def _distinct(correlation: Array) -> Array:
    """0 if another separation matches as well as the best one (repeated patterns), up to 1 if none does."""
    padded = np.pad(correlation, ((1, 1), (0, 0), (0, 0)), constant_values=-np.inf)
    peaks = (correlation >= padded[:-2]) & (correlation >= padded[2:]) & np.isfinite(correlation)
    heights = np.sort(np.where(peaks, correlation, 0.0), axis=0)
    ahead = heights[-1] - heights[-2]
    return np.asarray(np.clip(ahead / _AHEAD, 0, 1))


def _standard(blocks: Array, floor: float) -> Array:
    """Blocks minus their mean, with norm 1 if textured and less without texture."""
    centred = blocks - blocks.mean(axis=(2, 3), keepdims=True)
    return np.asarray(centred / np.sqrt((centred**2).sum(axis=(2, 3), keepdims=True) + floor * centred[0, 0].size))


def _refined(
    values: Array, rows: NDArray[np.intp], columns: NDArray[np.intp], separation: Array, half: int
) -> tuple[Array, Array]:
    """Separations to a fraction of a pixel, and the share of the blocks that they explain."""
    from scipy.ndimage import map_coordinates, spline_filter

    window = np.arange(-half, half + 1)
    down = (rows[:, None, None, None] + window[:, None]).astype(np.float64)
    across = (columns[:, None, None] + window).astype(np.float64)
    shape = (len(rows), len(columns), window.size, window.size)
    down, across = np.broadcast_to(down, shape), np.broadcast_to(across, shape)
    own = map_coordinates(values, [down, across], order=0).reshape(*shape[:2], -1)
    own = own - own.mean(axis=2, keepdims=True)
    spline = spline_filter(values, order=3, mode="mirror")

    def partner(shift: Array) -> Array:
        places = [down, across - shift[..., None, None]]
        read = map_coordinates(spline, places, order=3, prefilter=False, mode="mirror").reshape(*shape[:2], -1)
        return np.asarray(read - read.mean(axis=2, keepdims=True))

    shift = separation.copy()
    variance = (own**2).mean(axis=2) + (_FLOOR * values.max()) ** 2
    explained = np.zeros_like(shift)
    for _ in range(_REFINEMENTS):
        other = partner(shift)
        change = (partner(shift + 0.25) - partner(shift - 0.25)) / 0.5
        # own ≈ gain·(other + ε·change): least squares in gain and gain·ε.
        oo, cc, oc = (other**2).sum(2), (change**2).sum(2), (other * change).sum(2)
        yo, yc = (own * other).sum(2), (own * change).sum(2)
        determinant = oo * cc - oc**2
        solvable = determinant > 1e-9 * np.maximum(oo * cc, 1e-300)
        gain, gain_step = (
            np.divide(each, determinant, out=np.zeros_like(determinant), where=solvable)
            for each in (yo * cc - yc * oc, yc * oo - yo * oc)
        )
        move = np.divide(gain_step, gain, out=np.zeros_like(gain), where=gain > 0)
        left = ((own - gain[..., None] * other - gain_step[..., None] * change) ** 2).mean(2)
        explained = np.where(gain > 0, 1 - (left + variance - (own**2).mean(2)) / variance, 0)
        shift = shift + np.clip(move, -0.5, 0.5)
    return shift, np.clip(explained, 0, 1)
