"""Depth from the images of the photodiodes of dual and quad pixels (Garg et al. 2019).

The photodiodes of a pixel see different parts of the exit pupil. Through affine optics a point at the distance Z
on the axis sends the ray through the place p of the stop to x = p·(A + B/Z)/(1 + e/Z) on the sensor, where e is
the place of the entrance pupil. The light that a photodiode records has its centroid where p is the mean place p̄
that the photodiode sees. So the disparity of two photodiodes is linear in 1/(Z + e), and 0 in focus. For a thin
lens with a round opening of radius R at the entrance plane, and photodiodes that halve it, the disparity is
8R/(3π) · (1 − d·(1/f − 1/Z)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.analysis.point_rays import PointRays
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.camera import Camera
from vcc.image import Image, PhotodiodeImage
from vcc.recording import PhotodiodeRecording
from vcc.recover.matching import Blocks, checked_blocks, checked_range, matched, whole_shifts
from vcc.recover.recorded import grey, has_mosaic, numbers_of

Array = NDArray[np.float64]

CELLS = 256
"""Of the entrance opening, across: the centroid of half a disc is right to 1e-5 of its radius."""
NEAREST = 10
"""Distance of the nearest point that the line is taken from, over the length of the camera."""
SMOOTHING = 1.0
"""Standard deviation of the Gaussian that images are blurred by before they are matched, pixels. Noise is
smoothest half-way between pixels, so that least squares would prefer disparities there."""
ALONG = 1e-3
"""Share of a disparity that may point along the other axis."""


@dataclass(frozen=True, eq=False, repr=False)
class PhotodiodeDepth(Brief, Shown):
    """The distances of blocks of the image of the left photodiodes (of the top ones in pixels of one column).

    Args:
        disparity: place of the block in the image of the left (top) photodiodes minus that in the image of the
            right (bottom) ones, pixels to the right (down) as light lands, shape (block rows, block columns); NaN
            if a block has no match inside the image.
        distance: metres before the entrance plane, same shape; infinite for disparities at or beyond that of
            infinity; NaN if a block has no match, or the best match is at an end of the range.
        confidence: 0 (no texture, no match, or several equal ones) to 1, same shape.
        rows: the row of each block's centre, pixels, shape (block rows,).
        columns: the column, shape (block columns,). In the sum of the photodiodes a block lies half of its
            disparity further to the left (up).
    """

    disparity: Array
    distance: Array
    confidence: Array
    rows: Array
    columns: Array


@dataclass(frozen=True)
class PhotodiodeDisparity:
    """The disparity of the photodiodes of a camera by distance: at_infinity + factor/(Z + pupil).

    Args:
        at_infinity: disparity of points at infinity, metres on the sensor.
        factor: metres². Positive if nearer points have larger disparities, as behind a single lens.
        pupil: e, z of the entrance pupil, metres behind the entrance plane.
        axis: 0 for the top minus the bottom photodiodes, 1 for the left minus the right ones.
    """

    at_infinity: float
    factor: float
    pupil: float = 0.0
    axis: int = 1

    @classmethod
    def of(cls, camera: Camera) -> PhotodiodeDisparity:
        """From the centroids of the light of points on the axis at three distances, which each photodiode records.

        Args:
            camera: of lenses, prisms, masks and first-order systems, with two or more photodiodes in a pixel.
                Left and right are the halves of the columns (of an odd number, without the middle one); pixels
                with one column have the halves of the rows.

        Raises:
            InputError: one photodiode; elements that bend light otherwise or scatter it; optics that turn the
                disparity away from its axis; no stop; or photodiodes that see no part of the pupil, or the same
                one.
        """
        halves = _halves(camera.sensor.photodiodes)
        axis = int(camera.sensor.photodiodes[1] > 1)
        for stage in camera.stages:
            if stage.faces.bending is not None or stage.faces.spread is not None:
                raise InputError(
                    f"behind {stage.element.label} the disparity of photodiodes is not a function of distance "
                    "alone: depth needs a camera of lenses, prisms, masks and first-order systems"
                )
        vergences = np.array([1 / 3, 1.0]) / (NEAREST * camera.sensor.z)
        distances = (math.inf, *(1 / vergences))
        centroids = [[_centroid(camera, half, distance) for distance in distances] for half in halves]
        apart = np.array(centroids[0]) - np.array(centroids[1])
        largest = np.abs(apart[:, axis]).max()
        if np.abs(apart[:, 1 - axis]).max() > ALONG * largest:
            raise InputError(
                f"the disparity of the photodiodes does not point along {'yx'[axis]} alone: optics without "
                "rotational symmetry must stand along the rows and columns of the pixels"
            )
        far, middle, near = apart[:, axis].tolist()
        # (Δ − Δ∞)·(1 + e/Z) = factor/Z at both distances.
        steep = (np.array([middle, near]) - far) / vergences
        if not abs(near - middle) > 1e-9 * camera.sensor.z:
            raise InputError("the photodiodes see the same part of the pupil: their images have no disparity")
        pupil = float((steep[0] - steep[1]) / (near - middle))
        return cls(far, float(steep[1] + pupil * (near - far)), pupil, axis)

    def disparity_of(self, distance: float) -> float:
        """The disparity of a distance before the entrance plane, metres on the sensor (infinity allowed)."""
        return self.at_infinity + self.factor / (distance + self.pupil)

    def distance_of(self, disparity: float) -> float:
        """The distance before the entrance plane, metres: the inverse of `disparity_of`.

        Infinite for the disparity of infinity and beyond.
        """
        rest = (disparity - self.at_infinity) / self.factor
        return math.inf if rest <= 0 else 1 / rest - self.pupil


def depth_by_photodiodes(
    image: Image | PhotodiodeRecording,
    camera: Camera,
    distance_range: tuple[float, float],
    *,
    block: int = 21,
    step: int | None = None,
) -> PhotodiodeDepth:
    """Depth from the images of the photodiodes of one exposure.

    Blocks of the image of the left photodiodes are matched in that of the right ones, as in
    `vcc.recover.depth_by_biprism`; their disparities become distances by `PhotodiodeDisparity`.

    Args:
        image: a `vcc.image.PhotodiodeImage` as the camera captured it (not upright), a
            `vcc.recording.PhotodiodeRecording` or its ``image()``; or a piece.
        camera: see `PhotodiodeDisparity.of`.
        distance_range: (nearest, farthest) before the entrance plane, metres; infinity is allowed.
        block: side of the blocks, pixels, an odd number.
        step: from block to block, pixels; None uses half a block.

    Raises:
        InputError: an image without photodiodes, of other photodiodes or pixels than the camera's, upright or
            with NaNs; a recording through a colour filter; an invalid range; an image too small for a block and
            its partner; or an error of `PhotodiodeDisparity.of`.

    Warns:
        ResultWarning: at least 1 % of the blocks match best at an end of the range.
    """
    images = _checked(image, camera)
    near, far = checked_range(distance_range)
    half, step = checked_blocks(block, step)
    line = PhotodiodeDisparity.of(camera)
    pitch = camera.sensor.pitches[line.axis]
    shifts = whole_shifts(line.disparity_of(near) / pitch, line.disparity_of(far) / pitch)
    pair = [each if line.axis else each.T for each in images]  # the disparity along rows
    count = np.array(pair[0].shape)
    least = 2 * half + 1 + np.array([0, 4 + min(abs(int(shifts[0])), abs(int(shifts[-1])))])
    if (count < least).any():
        needed = least if line.axis else least[::-1]
        raise InputError(
            f"an image of {images[0].shape[0]}×{images[0].shape[1]} pixels is too small for a block of {block} "
            f"and its partner: {needed[0]}×{needed[1]} are the least. Use a smaller block"
        )
    rows, columns = (np.arange(half, n - half)[::step] for n in count)
    found = matched((pair[0], pair[1]), Blocks(rows, columns, half), shifts)
    distance = found.distances(lambda shift: line.distance_of(shift * pitch))
    depth = PhotodiodeDepth(found.shift, distance, found.confidence, rows.astype(float), columns.astype(float))
    if line.axis == 1:
        return depth
    return PhotodiodeDepth(depth.disparity.T, depth.distance.T, depth.confidence.T, depth.columns, depth.rows)


Places = tuple[tuple[int, int], ...]


def _halves(photodiodes: tuple[int, int]) -> tuple[Places, Places]:
    """(row, column) of the photodiodes of the left and right half of a pixel; one column: of top and bottom."""
    rows, columns = photodiodes
    if rows * columns == 1:
        raise InputError(
            "the sensor has one photodiode in a pixel, which has no disparity: give Sensor(photodiodes=(1, 2)), "
            "and a vcc.Microlens if the camera has no stop"
        )
    number = columns // 2 if columns > 1 else rows // 2
    places = [(row, column) for row in range(rows) for column in range(columns)]
    axis, last = (1, columns - number) if columns > 1 else (0, rows - number)
    first_half = tuple(place for place in places if place[axis] < number)
    return first_half, tuple(place for place in places if place[axis] >= last)


def _centroid(camera: Camera, photodiodes: Places, distance: float) -> Array:
    """The mean place (y, x) on the sensor of the light of a point on the axis that photodiodes record, metres."""
    light, moment = 0.0, np.zeros(2)
    for row, column in photodiodes:
        rays = PointRays.through_stops(camera.photodiode(row, column), distance, (0.0, 0.0))
        spot = rays.in_cells(CELLS, np.full(2, np.inf))
        light += float(spot.weights.sum())
        moment += spot.weights @ spot.places
    if not light > 0:
        raise InputError(
            f"photodiodes {', '.join(map(str, photodiodes))} record no light of a point on the axis: check the "
            "pupil_distance and the height of the sensor's microlens"
        )
    return np.asarray(moment[::-1] / light)


def _checked(image: Image | PhotodiodeRecording, camera: Camera) -> tuple[Array, Array]:
    """The sums over the photodiodes of both halves, grey and smoothed."""
    from scipy.ndimage import gaussian_filter

    halves = _halves(camera.sensor.photodiodes)
    if isinstance(image, PhotodiodeRecording):
        if has_mosaic(image.photodiodes[0][0]):
            raise InputError(
                "the recording has a colour filter: give vcc.image.PhotodiodeImage.of([[each.demosaiced() for "
                "each in row] for row in recording.photodiodes], camera)"
            )
        image = image.image()
    if not isinstance(image, PhotodiodeImage):
        raise InputError(
            f"depth needs the image of each photodiode, not {type(image).__name__}: give what camera.capture or "
            "recording.image() returns, not their sum"
        )
    if not image.inverted:
        raise InputError("the image is upright: give it as the camera captured it")
    given, wanted = (len(image.photodiodes), len(image.photodiodes[0])), camera.sensor.photodiodes
    pitches = tuple(np.abs(np.diag(image.frame.linear))[::-1])
    if given != wanted or not np.allclose(pitches, camera.sensor.pitches, rtol=1e-6, atol=0):
        raise InputError(
            f"the image has {given[0]}×{given[1]} photodiodes in pixels of {pitches[0]:g}×{pitches[1]:g} m, and "
            f"the camera's sensor {wanted[0]}×{wanted[1]} in "
            f"{camera.sensor.pitches[0]:g}×{camera.sensor.pitches[1]:g} m: give what this camera captured"
        )
    numbers = [
        sum(grey(numbers_of(image.photodiodes[row][column], "the image of a photodiode")) for row, column in half)
        for half in halves
    ]
    left, right = (np.asarray(gaussian_filter(each, SMOOTHING)) for each in numbers)
    return left, right
