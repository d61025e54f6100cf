"""Depth from one image through a biprism, by matching its two halves (Lee, Kweon and Cipolla 1999).

Through either half of a biprism that deflects light towards its ridge, a point appears shifted sideways by
δ·Z. The lens behind it forms two images of the point on the two halves of the sensor, Δ = 2·δ·Z·d/(Z + a)
apart. Z is the distance before the biprism, a the distance from the biprism to the lens, and d from the lens
to the sensor. Unlike blur, Δ is monotonic in Z: each separation corresponds to one distance.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.camera import Camera
from vcc.image import Image
from vcc.optics import Biprism, Lens
from vcc.recover.matching import Blocks, checked_blocks, checked_range, matched, whole_shifts
from vcc.recover.recorded import grey, numbers_of

Array = NDArray[np.float64]


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
    near, far = checked_range(distance_range)
    half, step = checked_blocks(block, step)
    pitch = camera.sensor.pitches[1]
    shifts = whole_shifts(stereo.separation_of(near) / pitch, stereo.separation_of(far) / pitch)
    rows, columns = _blocks(camera, stereo, lens, half, step, int(shifts[0]))
    usable = _in_left_half(camera, _mixed(stereo, lens), half)
    found = matched((values, values), Blocks(rows, columns, half), shifts, usable)
    distance = found.distances(lambda separation: stereo.distance_of(separation * pitch))
    return StereoDepth(found.shift, distance, found.confidence, rows.astype(float), columns.astype(float))


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


def _in_left_half(camera: Camera, mixed: float, half: int) -> Callable[[NDArray[np.intp]], NDArray[np.bool_]]:
    """Whether blocks at columns lie left of the strip that receives light of both halves of the biprism."""
    places = camera.sensor.column_places
    reach = mixed + (half + 1) * camera.sensor.pitches[1]
    return lambda columns: np.asarray(places[np.clip(columns, 0, len(places) - 1)] < -reach)


def _blocks(
    camera: Camera, stereo: BiprismStereo, lens: Lens, half: int, step: int, lowest: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Centres of blocks in the right half of the image whose partner can be in the left half."""
    places = camera.sensor.column_places
    pitch = camera.sensor.pitches[1]
    mixed = _mixed(stereo, lens) + (half + 1) * pitch
    widest = 2 * stereo.deflection * stereo.behind
    columns = np.flatnonzero((places > mixed) & (places < widest - mixed))
    columns = columns[(columns >= half) & (columns < len(places) - half) & (columns - lowest - half >= 0)]
    rows = np.arange(half, camera.sensor.shape[0] - half)
    if not (rows.size and columns.size):
        raise InputError(
            f"no block of {2 * half + 1} pixels and its partner lie on the sensor: the two pictures are up to "
            f"{widest / pitch:.0f} pixels apart, the strip between them where both mix is "
            f"{2 * _mixed(stereo, lens) / pitch:.0f} pixels wide, and the sensor has {camera.sensor.shape[0]}×"
            f"{camera.sensor.shape[1]}. A narrower lens, a larger sensor or a stronger biprism would do"
        )
    return rows[::step], columns[::step]
