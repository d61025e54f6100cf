"""The lattice of micro-images on a recording, in pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.affine import Affine
from vcc.base.checks import one_of
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.optics.sensor import Sensor
from vcc.recover.lenslet_optics import LensletOptics
from vcc.shapes.lattice import LAYOUTS, ROW_HEIGHT, Lattice

Array = NDArray[np.float64]
Pair = tuple[float, float]

_ROUNDING = 1e-6  # of a pixel


@dataclass(frozen=True)
class LensletGrid:
    """The positions of micro-images on a recording: an affine image of a `vcc.shapes.lattice.Lattice`, in pixels.

    Micro-image (a, b) is centred at origin + a·steps[0] + b·steps[1]; pixel (row, column) is centred at
    x = column, y = row. The steps may differ in length and need no exact angle: pixels and lenslets of real
    cameras are not exactly square.

    Args:
        layout: ``"square"`` or ``"hexagonal"``.
        origin: (x, y) of micro-image (0, 0), pixels.
        steps: ((x, y), (x, y)), to the neighbours along the rows and along the next lattice direction, rotated by
            90° or 60°, pixels.
        residual: root mean square distance of the centres from the fitted lattice, pixels; 0 if it was not fitted.

    Raises:
        InputError: an unknown layout, numbers that are not finite, parallel steps.
    """

    layout: str
    origin: Pair
    steps: tuple[Pair, Pair]
    residual: float = 0.0

    def __post_init__(self) -> None:
        one_of("layout", self.layout, LAYOUTS)
        origin, steps = np.asarray(self.origin, dtype=np.float64), np.asarray(self.steps, dtype=np.float64)
        shaped = origin.shape == (2,) and steps.shape == (2, 2)
        if not (shaped and np.isfinite(origin).all() and np.isfinite(steps).all()):
            raise InputError(
                f"origin and steps of a lenslet grid are finite pixels, not {self.origin}, {self.steps}"
            )
        if abs(np.linalg.det(steps)) < 0.1 * np.prod(np.linalg.norm(steps, axis=1)):
            raise InputError(f"the steps {self.steps} of a lenslet grid lie along one line")
        object.__setattr__(self, "origin", tuple(origin.tolist()))
        object.__setattr__(self, "steps", tuple(map(tuple, steps.tolist())))

    @property
    def pixel_from_steps(self) -> Affine:
        """Map from steps (a, b) along the lattice to (x, y), pixels."""
        return Affine.from_parts(np.transpose(self.steps), self.origin)

    @property
    def pitch(self) -> float:
        """Mean distance between neighbouring micro-images, pixels: √(cell area / cell area for pitch 1)."""
        return math.sqrt(abs(self.pixel_from_steps.determinant) / ROW_HEIGHT[self.layout])

    @property
    def pitches(self) -> tuple[float, float]:
        """The pitch in columns and in rows of pixels, (x, y): different if pixels are not square."""
        even = np.array([[1.0, 0.5], [0.0, ROW_HEIGHT[self.layout]]])
        if self.layout == "square":
            even[0, 1] = 0.0
        across, down = np.linalg.norm(self.pixel_from_steps.linear @ np.linalg.inv(even), axis=1)
        return float(across), float(down)

    @property
    def rotation(self) -> float:
        """Angle of the rows of micro-images to the rows of pixels, radians, from x towards y."""
        return math.atan2(self.steps[0][1], self.steps[0][0])

    def centre_of(self, a: ArrayLike, b: ArrayLike) -> Array:
        """(x, y) of micro-images (a, b), pixels, shape (..., 2)."""
        return self.pixel_from_steps(np.stack(np.broadcast_arrays(a, b), axis=-1))

    def index_of(self, centres: ArrayLike) -> Array:
        """(a, b), not rounded, of positions (x, y) in pixels, shape (..., 2)."""
        return self.pixel_from_steps.inverse()(centres)

    def nearest_to(self, place: ArrayLike) -> Array:
        """(x, y) of the micro-image centre nearest to a position (x, y), pixels."""
        return self.pixel_from_steps(np.rint(self.index_of(place)))

    def turned(self, shape: tuple[int, int]) -> LensletGrid:
        """The grid for a recording of ``shape`` (rows, columns), rotated by 180°; the steps stay the same."""
        (x, y), (rows, columns) = self.origin, shape
        return replace(self, origin=(columns - 1 - x, rows - 1 - y))

    @classmethod
    def from_lattice(cls, lattice: Lattice, sensor: Sensor) -> LensletGrid:
        """The grid of a lattice of micro-images in metres, such as `vcc.LensArray.micro_images` returns.

        Args:
            lattice: centres of micro-images on the sensor.
            sensor: defines the pixels.
        """
        return grid_of(lattice.layout, sensor.frame.inverse() @ lattice.place_from_steps)

    @classmethod
    def of_camera(cls, camera: Camera) -> LensletGrid:
        """The grid from a camera's geometry: where its lenslets image the centre of the entrance plane.

        Args:
            camera: with a `vcc.LensArray` as its last element and affine optics before it.

        Raises:
            InputError: no lens array, elements behind it, or a lens array at the sensor.
        """
        optics = LensletOptics.of(camera)
        return grid_of(optics.array.layout, camera.sensor.frame.inverse() @ optics.micro_image_from_steps)

    @classmethod
    def from_centres(cls, centres: ArrayLike) -> LensletGrid:
        """The least-squares lattice for a list of micro-image centres.

        Args:
            centres: (x, y) of each, pixels counted from 0, in any order, shape (..., 2). Values rounded to
                whole pixels suffice: the fit averages them.

        Raises:
            InputError: fewer than 16 centres, numbers that are not finite, or centres that are not on a lattice.
        """
        points = np.asarray(centres, dtype=np.float64)
        if points.ndim < 2 or points.shape[-1] != 2 or points.size < 32:
            raise InputError(
                f"centres are (x, y) of 16 micro-images or more, not an array of shape {points.shape}"
            )
        points = points.reshape(-1, 2)
        if not np.isfinite(points).all():
            raise InputError("centres of micro-images must be finite numbers of pixels")
        lattice = _lattice_near(points)
        grid, used = _fitted_outwards(grid_of(lattice.layout, lattice.place_from_steps), points)
        if used < 0.9 * len(points):
            raise InputError(
                f"only {used} of {len(points)} centres fit one {lattice.layout} lattice of pitch "
                f"{grid.pitch:.2f} pixels"
            )
        return grid

    def within(self, shape: tuple[int, int], margin: float) -> NDArray[np.int64]:
        """(a, b) of all micro-images centred at least ``margin`` pixels inside a recording, shape (n, 2).

        Args:
            shape: (rows, columns) of the recording.
            margin: distance in pixels from the centres of the outermost pixels.
        """
        last = np.array([shape[1] - 1, shape[0] - 1])
        corners = self.index_of([(x, y) for x in (0, last[0]) for y in (0, last[1])])
        low, high = np.floor(corners.min(axis=0)).astype(int), np.ceil(corners.max(axis=0)).astype(int)
        index = np.stack(np.meshgrid(*(np.arange(low[n], high[n] + 1) for n in (0, 1)), indexing="ij"), axis=-1)
        index = index.reshape(-1, 2)
        centres = self.pixel_from_steps(index)
        inside = (centres >= margin - _ROUNDING) & (centres <= last - margin + _ROUNDING)
        return np.asarray(index[inside.all(axis=1)], dtype=np.int64)


def grid_of(layout: str, pixel_from_steps: Affine, residual: float = 0.0) -> LensletGrid:
    """The grid for a map from lattice steps to pixels.

    Args:
        layout: ``"square"`` or ``"hexagonal"``.
        pixel_from_steps: from (a, b) to (x, y), pixels.
        residual: of the fitted centres, pixels.
    """
    across, down = map(_pair, pixel_from_steps.linear.T)
    return LensletGrid(layout, _pair(pixel_from_steps.offset), (across, down), residual)


def fitted(layout: str, labels: Array, points: Array) -> LensletGrid:
    """The least-squares grid for labelled centres.

    Args:
        layout: ``"square"`` or ``"hexagonal"``.
        labels: (a, b) of the micro-images, shape (n, 2).
        points: (x, y) of their centres, pixels, shape (n, 2).

    Raises:
        InputError: the centres are on one line.
    """
    design = np.column_stack([labels, np.ones(len(labels))])
    solution, _, rank, _ = np.linalg.lstsq(design, points, rcond=None)
    if rank < 3:
        raise InputError("the centres of micro-images stand along one line: no lattice follows from them")
    residual = float(np.sqrt(np.mean(np.sum((points - design @ solution) ** 2, axis=1))))
    return grid_of(layout, Affine.from_parts(solution[:2].T, solution[2]), residual)


def _fitted_outwards(grid: LensletGrid, points: Array) -> tuple[LensletGrid, int]:
    """Fit a grid to points near its origin, then farther out: errors of the steps grow with the distance."""
    away = np.linalg.norm(points - grid.origin, axis=1)
    radius, used = 3 * grid.pitch, 0
    while True:
        radius = min(2 * radius, float(away.max()) + 1)
        near = points[away <= radius]
        for _ in range(2):
            index = grid.index_of(near)
            label = np.rint(index)
            good = np.abs(index - label).max(axis=1) < 0.25
            if good.sum() < 6:
                raise InputError(f"the centres do not stand on a {grid.layout} lattice")
            grid = fitted(grid.layout, label[good], near[good])
            used = int(good.sum())
        if radius > away.max():
            return grid, used


def _pair(numbers: Array) -> Pair:
    return float(numbers[0]), float(numbers[1])


def _lattice_near(points: Array) -> Lattice:
    """The lattice estimated from nearest neighbours of points, with cell (0, 0) at the central point.

    Raises:
        InputError: points that coincide, or that are not on a lattice.
    """
    from scipy.spatial import KDTree

    distance, neighbour = KDTree(points).query(points, k=7)
    pitch = float(np.median(distance[:, 1]))
    if not pitch > 0:
        raise InputError("centres of micro-images stand on top of one another: give each once")
    near = distance[:, 1:] < 1.2 * pitch  # on a square lattice the diagonal neighbour is 1.41 away
    vectors = (points[neighbour[:, 1:]] - points[:, None])[near]
    turns = np.exp(1j * np.arctan2(vectors[:, 1], vectors[:, 0]))
    folds = {"square": 4, "hexagonal": 6}  # rotational symmetry
    order = {layout: np.mean(turns**fold) for layout, fold in folds.items()}
    layout = max(order, key=lambda name: abs(order[name]))
    if abs(order[layout]) < 0.5:
        raise InputError("the centres do not stand on a square or hexagonal lattice")
    middle = points[np.argmin(np.linalg.norm(points - points.mean(axis=0), axis=1))]
    return Lattice(
        layout,
        pitch=float(np.linalg.norm(vectors, axis=1).mean()),
        rotation=float(np.angle(order[layout])) / folds[layout],
        offset=_pair(middle),
    )
