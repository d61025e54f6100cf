"""What a camera makes of a point: its point spread function, and from it OTF and MTF.

A point's rays fill a 2-D sheet of the 4-D light field: traced backwards from a pixel, a ray hits it with
probability 0. So rays are sent forwards, through the same stages and faces that captures are made with. Without
diffusers the entrance opening is divided into cells; each carries its mean transmission and falls on the sensor
as the box that its own rays span (a ray differential: Igehy, "Tracing ray differentials", 1999), shared among
pixels by exact overlap: nothing is random, and nothing singular in focus. With diffusers rays are drawn from a
scrambled Sobol' sequence over the opening and each diffuser's kernel, and the sampling error is told.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.analysis.plane_spectrum import PlaneSpectrum, plane_spectrum
from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.camera import Camera
from vcc.optics import Scatter
from vcc.optics.train import Stage

Array = NDArray[np.float64]

CELLS_PER_PIXEL = 16
"""Of the opening, along a pixel of the picture: borders are right to 1/64 of a pixel's light, while there are no
more than `ENOUGH_CELLS` for that."""
FEWEST_CELLS, ENOUGH_CELLS, MOST_CELLS = 128, 512, 4096
"""Across the longer side of the opening: in any case; where pixels ask for more; where each needs at least one."""
FIRST_CELLS = 64
"""For a look at how large the picture will be."""
RAYS = 2**18
"""Where diffusers scatter."""
LARGEST = 4096
"""Pixels a side of a point's picture whose size was not given."""
NO_LIGHT = 1e-6
"""Means of patterns are differences of integrals, whose rounding is below this."""
ROUNDING = 1e-9
"""Of shares of pixels that are summed."""
NEARBY = 1e-3
"""Of a cell: how far from its middle the rays go that measure its box on the sensor."""


@dataclass(frozen=True, eq=False, repr=False)
class PointSpread:
    """The picture of a point of light.

    Args:
        values: the share of the light arriving at the sensor's plane that falls into each pixel, shape (rows,
            columns), as light lands on the sensor; they sum to 1 − ``outside``.
        frame: maps (column, row, 1) to (x, y, 1) on the sensor, metres.
        distance: of the point before the entrance plane, metres.
        field: where it stands, as slopes (X/Z, Y/Z).
        collecting_area: the part of the entrance plane whose light arrives, transmissions counted, m². A point of
            radiant intensity I (W/sr) at distance Z brings I · collecting_area / Z² watts to the sensor's plane.
        outside: the share of the light that falls beside ``values``.
        sampling_error: estimated, root mean square over the pixels, in units of the values; 0 without diffusers.
    """

    values: Array
    frame: Affine
    distance: float
    field: tuple[float, float]
    collecting_area: float
    outside: float = 0.0
    sampling_error: float = 0.0

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
        rows, columns = self.values.shape
        return rows, columns

    @property
    def centroid(self) -> tuple[float, float]:
        """The mean place (x, y) of the light within ``values``, metres on the sensor."""
        rows, columns = self.shape
        share = self.values / self.values.sum()
        x, y = self.frame([share.sum(axis=0) @ np.arange(columns), share.sum(axis=1) @ np.arange(rows)])
        return float(x), float(y)

    def __repr__(self) -> str:
        rows, columns = self.shape
        pitch = short(abs(self.frame.determinant) ** 0.5)
        return f"PointSpread({rows}×{columns}, pixel {pitch}, point at {short(self.distance)})"


@dataclass(frozen=True, eq=False)
class _Spot:
    """Where light falls: places on the sensor (n, 2), widths of boxes (n, 2), weights (n,)."""

    places: Array
    widths: Array
    weights: Array


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
) -> PointSpread:
    """The picture of a point of light, by tracing its rays through the camera.

    Args:
        camera: any; only the sensor's place, pitch and lattice matter, not its size. Paraxial and geometric.
        distance: of the point before the entrance plane, metres, above 0; may be infinite.
        field: where the point stands as slopes (X/Z, Y/Z): the tangents of its field angles, right and down.
        pitch: of the square pixels that the light is counted in, metres; None takes the sensor's.
        shape: (rows, columns) of pixels; None takes an odd number each way that holds all light.
        on_pixels: False centres the middle pixel (index n // 2) on where the middle of the opening images the
            point through the camera's affine optics; True takes the sensor's own pixels (then no ``pitch``).
        aperture: (width, height) of the entrance plane through which light comes, metres; None finds it from the
            camera's stops.
        cells: without diffusers: how many the opening's longer side is divided into; None takes 16 for each pixel
            of the picture, from 128 to 512. There are more where a cell would otherwise cover more than a pixel.
        rays: with diffusers: how many are traced, rounded up to a power of two.
        seed: of their choice.

    Raises:
        InputError: a distance of zero or less, a camera without a stop before its first plate, array or diffuser
            (then give ``aperture``), no light on the sensor, a picture of more than 4096 pixels a side, pixels
            finer than cells can fill, or what elements refuse.
    """
    _check(camera, distance, field, pitch, on_pixels, cells, rays)
    middle, size = _opening(camera, distance, field) if aperture is None else ((0.0, 0.0), _sizes(aperture))
    vertical, horizontal = camera.sensor.pitches if pitch is None else (pitch, pitch)
    steps = np.array([horizontal, vertical])
    start = Affine.translation(*middle, 0.0, 0.0)
    image = camera.rays_at(camera.sensor.z)(_point_rays(start(np.zeros(4))[None, :2], distance, field))[0, :2]

    scatters = any(stage.faces.spread is not None for stage in camera.stages)
    if scatters:
        halves = _scattered(camera, distance, field, middle, size, rays, seed)
    else:
        halves = [_in_cells(camera, distance, field, middle, size, cells, steps)]
    total = sum(float(spot.weights.sum()) for spot in halves)
    if total <= 0:
        raise InputError(
            "no light of this point reaches the sensor: the camera's stops block it all (look at camera.plot())"
        )
    frame, counts = _lattice(camera, halves, image, steps, shape, on_pixels)
    pictures = [_deposited(spot, frame, counts) for spot in halves]
    values = np.sum(pictures, axis=0) / total
    error = 0.0
    if scatters:  # two even halves of the rays: half their difference estimates the error of their mean
        error = float(np.sqrt(np.mean((pictures[0] - pictures[1]) ** 2))) / total
    area = total * size[0] * size[1]
    outside = 1 - float(values.sum())
    outside = outside if outside > ROUNDING else 0.0
    return PointSpread(values, frame, float(distance), (float(field[0]), float(field[1])), area, outside, error)


def otf(point_spread: PointSpread, *, shape: tuple[int, int] | None = None, pixel: bool = True) -> PlaneSpectrum:
    """The optical transfer function: the spectrum of a point's picture, 1 at zero frequency.

    Args:
        point_spread: of any camera.
        shape: (rows, columns) to fill up with darkness to, which brings frequencies closer; None adds none.
        pixel: whether the pixels that light was counted in, sinc(fx·pitch)·sinc(fy·pitch), are part of it: the
            system's OTF; False divides them out: the optics' alone, right where pixels are fine.

    Returns:
        Complex values; frequencies in cycles per metre on the sensor; phases about the middle pixel (index n //
        2).

    Raises:
        InputError: a shape smaller than the picture's, or no light in it.
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
    values = found.values / abs(frame.determinant)
    if not pixel:
        horizontal, vertical = np.abs(np.diag(frame.linear))
        values = values / np.outer(
            np.sinc(found.frequencies("y") * vertical), np.sinc(found.frequencies("x") * horizontal)
        )
    return PlaneSpectrum(values, found.frame, found.origin)


def mtf(point_spread: PointSpread, *, shape: tuple[int, int] | None = None, pixel: bool = True) -> PlaneSpectrum:
    """The modulation transfer function: the magnitude of the `otf`, real, 1 at zero frequency.

    Args: see `otf`.
    """
    found = otf(point_spread, shape=shape, pixel=pixel)
    return PlaneSpectrum(np.abs(found.values), found.frame, found.origin)


# -- what is traced


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
    if not distance > 0:
        raise InputError(f"the distance of a point must be greater than 0 m, not {distance}")
    if len(field) != 2 or not all(math.isfinite(slope) for slope in field):
        raise InputError(f"field is a pair of finite slopes (X/Z, Y/Z), not {field}")
    if pitch is not None and not (pitch > 0 and math.isfinite(pitch)):
        raise InputError(f"pitch must be greater than 0 m, not {pitch}")
    if pitch is not None and on_pixels:
        raise InputError("on_pixels counts light in the sensor's own pixels: leave out pitch")
    if cells is not None and not (int(cells) == cells and 2 <= cells <= MOST_CELLS):
        raise InputError(f"cells is a whole number from 2 to {MOST_CELLS}, not {cells}")
    if not (int(rays) == rays and 16 <= rays <= 2**26):
        raise InputError(f"rays is a whole number from 16 to 2^26, not {rays}")


def _sizes(aperture: tuple[float, float]) -> tuple[float, float]:
    if len(aperture) != 2 or not all(side > 0 and math.isfinite(side) for side in aperture):
        raise InputError(f"aperture is (width, height), each above 0 m, not {aperture}")
    return float(aperture[0]), float(aperture[1])


def _point_rays(places: Array, distance: float, field: tuple[float, float]) -> Array:
    """The rays (u, v, s, t) of the point through places (..., 2) of the entrance plane."""
    slopes = places / distance - np.asarray(field)  # s = (u − X)/Z; parallel for an infinite distance
    return np.concatenate([places, slopes], axis=-1)


def _opening(
    camera: Camera, distance: float, field: tuple[float, float]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """(middle, size) of the rectangle of the entrance plane through which the point's light comes.

    Stops behind what bends or scatters rays tell nothing about where they came from, and are passed over.
    """
    low, high = np.full(2, -np.inf), np.full(2, np.inf)
    ray, disturbed = Affine.identity(), False
    ends = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    for stage in camera.stages:
        if disturbed and np.abs(stage.approach.linear[:2, 2:]).max() > 0:
            break
        ray = stage.approach @ ray
        size = (math.inf, math.inf) if stage.faces.pattern is None else stage.faces.pattern.size
        at = ray(_point_rays(ends, distance, field))[:, :2]
        from_entrance = Affine.from_parts(np.stack([at[1] - at[0], at[2] - at[0]], axis=1), at[0])
        if all(map(math.isfinite, size)) and from_entrance.is_invertible():
            corners = np.array([[x, y] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * size
            back = from_entrance.inverse()(corners + stage.element.decentre)
            low, high = np.maximum(low, back.min(axis=0)), np.minimum(high, back.max(axis=0))
        if stage.centred is not None:
            ray = stage.centred @ ray
        disturbed = disturbed or stage.faces.bending is not None or stage.faces.spread is not None
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise InputError(
            "nothing bounds the light that this camera takes in (no stop of known size stands before the first "
            "plate, array or diffuser): give the lens a diameter, or pass aperture=(width, height) in metres"
        )
    if (high <= low).any():
        raise InputError("no light of this point passes the camera's stops: it lies outside the field of view")
    middle, size_found = (low + high) / 2, high - low
    return (float(middle[0]), float(middle[1])), (float(size_found[0]), float(size_found[1]))


def _in_cells(
    camera: Camera,
    distance: float,
    field: tuple[float, float],
    middle: tuple[float, float],
    size: tuple[float, float],
    cells: int | None,
    steps: Array,
) -> _Spot:
    """The light of each cell of the opening, as many as asked for or as the picture's size asks for."""
    first = _traced_cells(camera, distance, field, middle, size, FIRST_CELLS if cells is None else cells)
    lit = first.weights > 0
    if not lit.any():  # what passes may be smaller than the first cells' middles show
        return _traced_cells(camera, distance, field, middle, size, ENOUGH_CELLS)
    # A few boxes may be large where optics are strongly curved: the bulk decides.
    widest = float(np.quantile((first.widths[lit] / steps).max(axis=1), 0.99))
    least = math.ceil(widest * (FIRST_CELLS if cells is None else cells))  # one cell for each pixel
    if least > MOST_CELLS:
        raise InputError(
            f"this point's picture is about {least} pixels wide, and {MOST_CELLS} cells of the opening are the "
            "most: count its light in larger pixels (pitch=)"
        )
    if cells is None:
        wanted = min(max(CELLS_PER_PIXEL * least, FEWEST_CELLS), ENOUGH_CELLS)
        return _traced_cells(camera, distance, field, middle, size, max(wanted, least))
    return first if least <= cells else _traced_cells(camera, distance, field, middle, size, least)


def _traced_cells(
    camera: Camera,
    distance: float,
    field: tuple[float, float],
    middle: tuple[float, float],
    size: tuple[float, float],
    cells: int,
) -> _Spot:
    across, down = (max(2, math.ceil(cells * side / max(size))) for side in size)
    cell = np.array([size[0] / across, size[1] / down])
    x = (np.arange(across) - (across - 1) / 2) * cell[0] + middle[0]
    y = (np.arange(down) - (down - 1) / 2) * cell[1] + middle[1]
    places = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    near = NEARBY * cell
    # Three rays a cell: its middle, and one beside it along each axis.
    rays = np.stack([_point_rays(places + near * beside, distance, field) for beside in ((0, 0), (1, 0), (0, 1))])
    share = np.full(len(places), 1.0 / len(places))
    for stage in camera.stages:
        rays = stage.approach(rays)
        if stage.faces.pattern is not None:
            share = share * _mean_transmission(stage, rays)
        rays = stage.deflected(rays)
    rays = camera.approach_to_sensor(rays)
    return _Spot(rays[0, :, :2], _box(rays), share)


def _box(rays: Array) -> Array:
    """Widths (n, 2) of boxes of the same variance as the parallelograms that cells' rays span."""
    along = (rays[1:, :, :2] - rays[0, :, :2]) / NEARBY
    return np.asarray(np.sqrt((along**2).sum(axis=0)))


def _mean_transmission(stage: Stage, rays: Array) -> Array:
    """What a pattern lets pass of each cell: its mean over the cell's box where all boxes are alike."""
    pattern = stage.faces.pattern
    assert pattern is not None
    x, y = (rays[0, :, :2] - stage.element.decentre).T
    widths = _box(rays)
    alike = np.ptp(widths, axis=0) <= 1e-6 * widths.max()
    with stage.named():
        if alike.all() and widths[0].min() > 0:
            mean = np.asarray(pattern.mean(x, y, float(widths[0, 0]), float(widths[0, 1])), dtype=np.float64)
            return np.where(mean > NO_LIGHT, mean, 0.0)
        return np.asarray(pattern(x, y), dtype=np.float64)


def _scattered(
    camera: Camera,
    distance: float,
    field: tuple[float, float],
    middle: tuple[float, float],
    size: tuple[float, float],
    rays: int,
    seed: int,
) -> list[_Spot]:
    """Rays over the opening and the kernels, in two halves that are even sets themselves."""
    from scipy.stats import qmc

    spreads = [stage.faces.spread for stage in camera.stages if stage.faces.spread is not None]
    dimensions = 2 + sum(2 + (len(spread.kernels) > 1) for spread in spreads)
    power = math.ceil(math.log2(rays))
    points = np.asarray(qmc.Sobol(dimensions, scramble=True, seed=seed).random_base2(power))
    column = itertools.count()
    places = np.stack([(points[:, next(column)] - 0.5) * size[n] + middle[n] for n in (0, 1)], axis=-1)
    bundle = _point_rays(places, distance, field)
    share = np.full(len(points), 1.0 / len(points))
    for stage in camera.stages:
        bundle = stage.approach(bundle)
        x, y = (bundle[:, :2] - stage.element.decentre).T
        if stage.faces.pattern is not None:
            with stage.named():
                share = share * np.asarray(stage.faces.pattern(x, y), dtype=np.float64)
        bundle = stage.deflected(bundle)
        if stage.faces.spread is not None:
            spread = stage.faces.spread
            numbers = [points[:, next(column)] for _ in range(2 + (len(spread.kernels) > 1))]
            with stage.named():
                bundle[:, 2:] += _deflections(spread, x, y, numbers)
    ends = camera.approach_to_sensor(bundle)[:, :2]
    half = len(points) // 2
    return [_Spot(ends[part], np.zeros((half, 2)), share[part]) for part in (slice(None, half), slice(half, None))]


def _deflections(spread: Scatter, x: Array, y: Array, numbers: list[Array]) -> Array:
    """Changes of slope (n, 2) by the kernels at places x, y, drawn by evenly spread numbers."""
    shares, widths = spread.at(x, y)
    chosen = np.zeros(len(x), dtype=np.int64)
    if len(spread.kernels) > 1:
        running = np.cumsum(shares, axis=1)
        chosen = np.minimum((numbers[2][:, None] >= running).sum(axis=1), len(spread.kernels) - 1)
    found = np.zeros((len(x), 2))
    for n, kernel in enumerate(spread.kernels):
        here = chosen == n
        if here.any():
            found[here] = np.stack(kernel.deflections(numbers[0][here], numbers[1][here]), axis=-1)
    return found * widths[:, None]


# -- where it is counted


def _lattice(
    camera: Camera,
    spots: list[_Spot],
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
        if len(shape) != 2 or any(int(n) != n or n < 1 for n in shape):
            raise InputError(f"shape is (rows, columns), each at least 1, not {shape}")
        rows, columns = int(shape[0]), int(shape[1])
    frame = (
        Affine.translation(float(image[0]), float(image[1]))
        @ Affine.scaling(float(steps[0]), float(steps[1]))
        @ Affine.translation(-(columns // 2), -(rows // 2))
    )
    return frame, (rows, columns)


def _deposited(spot: _Spot, frame: Affine, counts: tuple[int, int]) -> Array:
    """Weights shared among pixels by the overlap of each box with them: shape (rows, columns)."""
    rows, columns = counts
    lit = spot.weights > 0
    index = frame.inverse()(spot.places[lit]) + 0.5  # pixel n reaches from n to n + 1
    widths = np.maximum(spot.widths[lit] / np.abs(np.diag(frame.linear)), 1e-6)
    weights = spot.weights[lit]
    first = np.floor(index - widths / 2).astype(np.int64)
    spans = (np.floor(index + widths / 2).astype(np.int64) - first).max(axis=0, initial=0) + 1
    picture = np.zeros(rows * columns)
    for b in range(int(spans[1])):
        row = first[:, 1] + b
        share_y = _overlap(row, index[:, 1], widths[:, 1])
        for a in range(int(spans[0])):
            column = first[:, 0] + a
            share = weights * share_y * _overlap(column, index[:, 0], widths[:, 0])
            kept = (share > 0) & (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
            picture += np.bincount(row[kept] * columns + column[kept], share[kept], rows * columns)
    return picture.reshape(rows, columns)


def _overlap(pixel: NDArray[np.int64], middle: Array, width: Array) -> Any:
    """The share of an interval that lies in a pixel."""
    low, high = np.maximum(pixel, middle - width / 2), np.minimum(pixel + 1, middle + width / 2)
    return np.maximum(high - low, 0) / width
