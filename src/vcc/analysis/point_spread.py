"""The point spread function of a camera, with OTF and MTF.

A point's rays form a 2-D sheet of the 4-D light field: a ray traced backwards from a pixel hits it with
probability 0. Therefore rays are traced forwards (`vcc.analysis.point_rays`), and their light is distributed
to pixels by exact overlap. If diffusers scatter them, the sampling error is reported.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.analysis.plane_spectrum import PlaneSpectrum, plane_spectrum
from vcc.analysis.point_rays import MOST_CELLS, PointRays, Spot
from vcc.analysis.point_waves import WavesOfPoint
from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.base.units import short
from vcc.camera import Camera

Array = NDArray[np.float64]

RAYS = 2**18
"""Default number of rays with diffusers."""
LARGEST = 4096
"""Largest number of pixels per side of a point's image, unless its size is given."""
ROUNDING = 1e-9
"""Tolerance for sums of shares of pixels."""
FINE_SIDE, MOST_PARTS = 512, 32
"""For spectra, pixels are divided into parts, as many per side as fit in `FINE_SIDE`. With whole pixels,
aliasing in the spectrum of a disc 1.3 pixels wide is 0.37, of 40 pixels 0.002; with 1/32 of a pixel, aliasing
even of a point's spectrum is below (π/2/32)²/6 = 4e-4 along an axis."""


@dataclass(frozen=True, eq=False, repr=False)
class PointSpread(Shown):
    """The image of a point of light.

    Args:
        values: the share of the light at the sensor's plane in each pixel, shape (rows, columns), inverted as
            on the sensor; the sum is 1 − ``outside``.
        frame: maps (column, row, 1) to (x, y, 1) on the sensor, metres.
        distance: of the point before the entrance plane, metres.
        field: direction of the point, as slopes (X/Z, Y/Z).
        collecting_area: the part of the entrance plane whose light arrives, weighted by transmission, m². A
            point of radiant intensity I (W/sr) at distance Z gives I · collecting_area / Z² watts at the
            sensor's plane. Behind a real lens, I is that along the axis of a small Lambertian surface (I·cosθ).
        outside: the share of the light outside ``values``.
        sampling_error: estimate, root mean square over the pixels, in units of the values; 0 without diffusers.
        finer: the same light in parts of the pixels, used for spectra; None if the pixels are fine enough.

    Raises:
        InputError: the light in ``finer`` differs from ``values``.
    """

    values: Array
    frame: Affine
    distance: float
    field: tuple[float, float]
    collecting_area: float
    outside: float = 0.0
    sampling_error: float = 0.0
    finer: PointSpread | None = None

    def __post_init__(self) -> None:
        if self.finer is None:
            return
        light = _in_pixels(self.finer.values, self.finer.frame, self.frame, self.shape)
        if not np.allclose(light, self.values, rtol=0, atol=ROUNDING):
            raise InputError("the light in finer differs from values: replace both, or pass finer=None")

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        rows, columns = self.values.shape
        return rows, columns

    @property
    def centroid(self) -> tuple[float, float]:
        """The centroid (x, y) of the light within ``values``, metres on the sensor."""
        rows, columns = self.shape
        share = self.values / self.values.sum()
        x, y = self.frame([share.sum(axis=0) @ np.arange(columns), share.sum(axis=1) @ np.arange(rows)])
        return float(x), float(y)

    def __repr__(self) -> str:
        rows, columns = self.shape
        pitch = short(abs(self.frame.determinant) ** 0.5)
        return f"PointSpread({rows}×{columns}, pixel {pitch}, point at {short(self.distance)})"


def psf(
    camera: Camera,
    distance: float,
    field: tuple[float, float] = (0.0, 0.0),
    *,
    pitch: float | None = None,
    shape: tuple[int, int] | None = None,
    on_pixels: bool = False,
    aperture: tuple[float, float] | None = None,
    cells: int | None = None,
    rays: int = RAYS,
    seed: int = 0,
    wavelength: float | None = None,
) -> PointSpread:
    """The image of a point of light, by tracing its rays through the camera, or by waves.

    Args:
        camera: any; of the sensor only position, pitch and lattice matter, not the size. Geometric; paraxial but
            for real lenses, which refract exactly. For each wavelength: ``camera.at_wavelength(550 * nm)``.
        distance: of the point before the entrance plane, metres, positive; may be infinite.
        field: direction of the point, as slopes (X/Z, Y/Z): the tangents of its field angles, right and down.
        pitch: of the square pixels that collect the light, metres; None uses the sensor's.
        shape: (rows, columns) of pixels; None uses odd numbers that contain all light.
        on_pixels: False centres the middle pixel (index n // 2) on the image of the point through the centre
            of the opening, by affine optics and real lenses; True uses the sensor's own pixels (then
            without ``pitch``).
        aperture: (width, height) of the opening in the entrance plane, metres; None determines it from the
            camera's stops.
        cells: without diffusers: how many divide the opening's longer side; None uses 16 per pixel of the image,
            from 128 to 512. More are used if a cell would cover more than a pixel.
        rays: with diffusers: how many are traced, rounded up to a power of two.
        seed: of the random numbers.
        wavelength: metres; None traces rays. With a wavelength, the image is that of waves through the camera's
            stop with its codes, with the defocus of the point and the wavefront of real lenses: |FFT|² of the
            pupil. The camera is taken at this wavelength. Without a shape, some 0.5 % of the light is outside.

    Raises:
        InputError: a distance that is not positive, a camera without a stop before its first plate, array or
            diffuser (then pass ``aperture``), no light on the sensor, an image of more than 4096 pixels per
            side, pixels too fine for the number of cells, or an error of an element.
    """
    _check(camera, distance, field, pitch, on_pixels, cells, rays)
    if aperture is None:
        point = PointRays.through_stops(camera, distance, field)
    else:
        point = PointRays(camera, distance, field, size=_sizes(aperture))
    if wavelength is not None:
        checks.above_zero("wavelength", wavelength, unit="m")
        if aperture is not None:
            raise InputError(
                "aperture= is for rays: waves need the camera's stops, such as a lens with a diameter"
            )
        camera = camera.at_wavelength(wavelength)
        point = replace(point, camera=camera)
    vertical, horizontal = camera.sensor.pitches if pitch is None else (pitch, pitch)
    steps = np.array([horizontal, vertical])
    scatters = any(stage.faces.spread is not None for stage in camera.stages)
    if scatters and wavelength is not None:
        raise InputError("diffusers scatter rays, not waves, here: leave the wavelength out, or the diffuser")
    halves = point.drawn(rays, seed) if scatters else [point.in_cells(cells, steps)]
    total = sum(float(spot.weights.sum()) for spot in halves)
    if total <= 0:
        raise InputError(
            "no light of this point reaches the sensor: the camera's stops block it all (look at camera.plot())"
        )
    frame, counts = _lattice(camera, halves, point.image, steps, shape, on_pixels)
    area = total * point.size[0] * point.size[1]
    if wavelength is not None:
        margin = 0 if shape is not None else None
        return _by_waves(WavesOfPoint.of(camera, distance, field, wavelength), frame, counts, margin, area)
    parts, fine_frame, fine_counts = _divided(halves, frame, counts)
    fine = [_deposited(spot, fine_frame, fine_counts) / total for spot in halves]
    pictures = [_in_pixels(each, fine_frame, frame, counts) for each in fine]
    values = np.sum(pictures, axis=0)
    error = 0.0
    if scatters:  # half the difference of two even halves estimates the error of their mean
        error = float(np.sqrt(np.mean((pictures[0] - pictures[1]) ** 2)))
    outside = 1 - float(values.sum())
    outside = outside if outside > ROUNDING else 0.0
    place = float(distance), (float(field[0]), float(field[1])), area, outside
    finer = PointSpread(np.sum(fine, axis=0), fine_frame, *place) if parts > 1 else None
    return PointSpread(values, frame, *place, error, finer)


def _by_waves(
    waves: WavesOfPoint, frame: Affine, counts: tuple[int, int], margin: int | None, area: float
) -> PointSpread:
    """The image by waves on a lattice, widened by a margin; None: that of `WavesOfPoint.margin`."""
    sides = np.abs(np.diag(frame.linear))
    pitch = float(sides.min())
    if margin is None:
        margin = waves.margin(pitch)
        frame = frame @ Affine.translation(-margin, -margin)
        counts = counts[0] + 2 * margin, counts[1] + 2 * margin
    parts = waves.parts(float(sides.max()), counts)
    fine_frame = frame @ Affine.translation(*[(1 / parts - 1) / 2] * 2) @ Affine.scaling(1 / parts, 1 / parts)
    light = waves.light(fine_frame, (parts * counts[0], parts * counts[1]))
    values = _in_pixels(light, fine_frame, frame, counts)
    place = waves.distance, waves.field, area, 1 - float(values.sum())
    finer = PointSpread(light, fine_frame, *place) if parts > 1 else None
    return PointSpread(values, frame, *place, finer=finer)


def otf(point_spread: PointSpread, *, shape: tuple[int, int] | None = None, pixel: bool = True) -> PlaneSpectrum:
    """The optical transfer function: the spectrum of a point's image, 1 at zero frequency.

    For a point spread from `psf`, it is the spectrum of the light before sampling by pixels, and so not
    aliased for any size of pixels. For values without ``finer`` parts it is the discrete transform, which is
    aliased.

    Args:
        point_spread: of any camera.
        shape: (rows, columns) after zero padding, for finer frequencies; None does not pad.
        pixel: whether to include the pixels that collected the light, sinc(fx·pitch)·sinc(fy·pitch): the OTF of
            the system; False divides by it: the OTF of the optics.

    Returns:
        Complex values; frequencies in cycles per metre on the sensor; phases relative to the middle pixel (index
        n // 2).

    Raises:
        InputError: a shape smaller than the image, or no light in it.
    """
    rows, columns = point_spread.shape
    wanted = (rows, columns) if shape is None else (int(shape[0]), int(shape[1]))
    if wanted[0] < rows or wanted[1] < columns:
        raise InputError(
            f"a spectrum of shape {wanted} does not hold a point's picture of {rows}×{columns} pixels"
        )
    light = float(point_spread.values.sum())
    if light <= 0:
        raise InputError("a point's picture without light has no transfer function: make its shape larger")
    padded = np.zeros(wanted)
    top, left = wanted[0] // 2 - rows // 2, wanted[1] // 2 - columns // 2
    padded[top : top + rows, left : left + columns] = point_spread.values / light
    frame = point_spread.frame @ Affine.translation(-left, -top)
    found = plane_spectrum(padded, frame)
    values: NDArray[Any] = found.values / abs(frame.determinant)
    counted = frame
    if point_spread.finer is not None:
        counted = point_spread.finer.frame
        values = _transformed(point_spread.finer.values / light, counted, found)
    values = values / _through_pixels(counted, found)
    return PlaneSpectrum(values * _through_pixels(frame, found) if pixel else values, found.frame, found.origin)


def mtf(point_spread: PointSpread, *, shape: tuple[int, int] | None = None, pixel: bool = True) -> PlaneSpectrum:
    """The modulation transfer function: the magnitude of the `otf`, real, 1 at zero frequency.

    Args: see `otf`.
    """
    found = otf(point_spread, shape=shape, pixel=pixel)
    return PlaneSpectrum(np.abs(found.values), found.frame, found.origin)


def _transformed(light: Array, frame: Affine, like: PlaneSpectrum) -> NDArray[np.complex128]:
    """The spectrum of light in the pixels of a frame, at the frequencies and about the origin of ``like``."""
    rows, columns = light.shape
    (left, top), (right, bottom) = frame([[0, 0], [columns - 1, rows - 1]]) - like.origin
    along_x = np.exp(-2j * np.pi * np.outer(np.linspace(left, right, columns), like.frequencies("x")))
    along_y = np.exp(-2j * np.pi * np.outer(like.frequencies("y"), np.linspace(top, bottom, rows)))
    return np.asarray(along_y @ (light @ along_x))


def _through_pixels(frame: Affine, at: PlaneSpectrum) -> Array:
    """The transfer function of the pixels of a frame along x and y, at the frequencies of a spectrum."""
    horizontal, vertical = np.abs(np.diag(frame.linear))
    return np.outer(np.sinc(at.frequencies("y") * vertical), np.sinc(at.frequencies("x") * horizontal))


def _check(
    camera: Camera,
    distance: float,
    field: tuple[float, float],
    pitch: float | None,
    on_pixels: bool,
    cells: int | None,
    rays: int,
) -> None:
    if not isinstance(camera, Camera):
        raise InputError(f"a point spread function is that of a vcc.Camera, not of a {type(camera).__name__}")
    checks.above_zero("the distance of a point", distance, unit="m", infinite=True)
    checks.pair("field", field, "a pair of finite slopes (X/Z, Y/Z)")
    if pitch is not None:
        checks.above_zero("pitch", pitch, unit="m")
    if pitch is not None and on_pixels:
        raise InputError("on_pixels counts light in the sensor's own pixels: leave out pitch")
    if cells is not None and not (int(cells) == cells and 2 <= cells <= MOST_CELLS):
        raise InputError(f"cells is a whole number from 2 to {MOST_CELLS}, not {cells}")
    if not (int(rays) == rays and 16 <= rays <= 2**26):
        raise InputError(f"rays is a whole number from 16 to 2^26, not {rays}")


def _sizes(aperture: Sequence[float]) -> tuple[float, float]:
    if len(aperture) != 2 or not all(side > 0 and math.isfinite(side) for side in aperture):
        raise InputError(f"aperture is (width, height), each above 0 m, not {aperture}")
    return float(aperture[0]), float(aperture[1])


# -- the pixels that collect the light


def _lattice(
    camera: Camera,
    spots: list[Spot],
    image: Array,
    steps: Array,
    shape: tuple[int, int] | None,
    on_pixels: bool,
) -> tuple[Affine, tuple[int, int]]:
    """The frame of the pixels, and (rows, columns) of them."""
    if on_pixels:
        frame = camera.sensor.frame
        nearest = np.round(frame.inverse()(image))
        image = frame(nearest)
    if shape is None:
        reach = np.zeros(2)
        for spot in spots:
            lit = spot.weights > 0
            outermost = np.abs(spot.places[lit] - image) + spot.widths[lit] / 2
            reach = np.maximum(reach, outermost.max(axis=0, initial=0.0))
        half = np.maximum(np.ceil(reach / steps - 0.5 - 1e-9), 0)
        if (2 * half + 1 > LARGEST).any():
            raise InputError(
                f"this point's picture would take {2 * half[1] + 1:.0f}×{2 * half[0] + 1:.0f} pixels, and "
                f"{LARGEST} a side are the most: pass a shape= for a part of it, or a larger pitch="
            )
        rows, columns = int(2 * half[1] + 1), int(2 * half[0] + 1)
    else:
        rows, columns = checks.counts("shape", shape, "rows", "columns")
    frame = (
        Affine.translation(float(image[0]), float(image[1]))
        @ Affine.scaling(float(steps[0]), float(steps[1]))
        @ Affine.translation(-(columns // 2), -(rows // 2))
    )
    return frame, (rows, columns)


def _divided(spots: list[Spot], frame: Affine, counts: tuple[int, int]) -> tuple[int, Affine, tuple[int, int]]:
    """The number of parts per side of a pixel, and the lattice of the illuminated parts."""
    places, widths = (
        np.concatenate([each[spot.weights > 0] for spot, each in both])
        for both in ([(spot, spot.places) for spot in spots], [(spot, spot.widths) for spot in spots])
    )
    middle, half, last = frame.inverse()(places), widths / 2 / np.diag(frame.linear), np.array(counts[::-1]) - 1
    first = np.clip(np.floor((middle - half).min(axis=0) + 0.5), 0, last).astype(int)
    sizes = np.clip(np.floor((middle + half).max(axis=0) + 0.5), first, last).astype(int) - first + 1
    parts = min(max(FINE_SIDE // int(sizes.max()), 1), MOST_PARTS)
    if parts == 1:
        return 1, frame, counts
    middle_of_first = first - 0.5 + 0.5 / parts
    fine = frame @ Affine.translation(*middle_of_first.tolist()) @ Affine.scaling(1 / parts, 1 / parts)
    return parts, fine, (parts * int(sizes[1]), parts * int(sizes[0]))


def _in_pixels(light: Array, fine: Affine, frame: Affine, counts: tuple[int, int]) -> Array:
    """Light collected in parts of pixels, of one frame, summed to the pixels of another."""
    rows, columns = light.shape
    pixels_from_fine = frame.inverse() @ fine
    parts = round(1 / float(pixels_from_fine.linear[0, 0]))
    first = np.rint(pixels_from_fine([0, 0])).astype(int)
    lit = light.reshape(rows // parts, parts, columns // parts, parts).sum(axis=(1, 3))
    picture = np.zeros(counts)
    picture[first[1] : first[1] + lit.shape[0], first[0] : first[0] + lit.shape[1]] = lit
    return picture


def _deposited(spot: Spot, frame: Affine, counts: tuple[int, int]) -> Array:
    """Weights distributed to pixels by the overlap of each box with them: shape (rows, columns)."""
    rows, columns = counts
    lit = spot.weights > 0
    index = frame.inverse()(spot.places[lit]) + 0.5  # pixel n reaches from n to n + 1
    widths = np.maximum(spot.widths[lit] / np.abs(np.diag(frame.linear)), 1e-6)
    weights = spot.weights[lit]
    first = np.floor(index - widths / 2).astype(np.int64)
    spans = np.floor(index + widths / 2).astype(np.int64) - first + 1
    # Boxes of about equal size in one loop: a few may be much larger than most.
    sizes = np.ceil(np.log2(spans.max(axis=1, initial=1))).astype(int)
    picture = np.zeros(rows * columns)
    for size in np.unique(sizes):
        (own,) = np.nonzero(sizes == size)
        across, down = spans[own].max(axis=0)
        for b in range(down):
            row = first[own, 1] + b
            share_y = weights[own] * _overlap(row, index[own, 1], widths[own, 1])
            for a in range(across):
                column = first[own, 0] + a
                share = share_y * _overlap(column, index[own, 0], widths[own, 0])
                kept = (share > 0) & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
                np.add.at(picture, row[kept] * columns + column[kept], share[kept])
    return picture.reshape(rows, columns)


def _overlap(pixel: NDArray[np.int64], middle: Array, width: Array) -> Any:
    """The share of an interval that lies in a pixel."""
    low, high = np.maximum(pixel, middle - width / 2), np.minimum(pixel + 1, middle + width / 2)
    return np.maximum(high - low, 0) / width
