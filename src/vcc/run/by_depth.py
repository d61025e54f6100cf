"""What the diffraction of each depth changes in an image that one convolution has diffracted.

The scene is divided into layers by the disparities of its middle view. Of each, the sharp image is convolved with
the difference of two images of a point at its depth: by waves, and by rays and one convolution
(`vcc.optics.waves`). For a plane the sum is its sharp image convolved with that by waves. The differences have the
sum 0: rays decide how much light of partly hidden layers arrives; only the shape of its blur follows the middle
view.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.disparity import Disparities
from vcc.fields.grid import ALL, Block, Grid
from vcc.fields.sampled import to_numpy
from vcc.fields.samples import InMemory, Samples
from vcc.optics.train import Train
from vcc.optics.waves import Pupil, point_spreads
from vcc.plan.choice import compile_best
from vcc.plan.how import How
from vcc.plan.stop_diffraction import ESTIMATED, HALO, LARGEST_ESTIMATE, StopDiffraction
from vcc.run.drive import drive

Array = NDArray[np.float64]

PINHOLE = 1e-4
"""Size of the pinhole of the sharp image, as a share of the spacing of views: its blur is as much smaller."""
WAVES_APART = 0.25
"""Defocus between neighbouring layers, waves; between them, kernels are interpolated linearly."""
MOST_LAYERS = ESTIMATED / 16 / WAVES_APART
"""Layers on each side of the focus: the defocus that the points of the pupil resolve."""


def through_pinhole(grid: Grid) -> Grid:
    """The grid of the middle view alone, (1, 1, t, s), through a pinhole in its middle: all is sharp behind it."""
    j, i = grid.middle_view
    return replace(
        grid,
        shape=(1, 1, *grid.shape[2:]),
        frame=grid.frame @ Affine.translation(i, j, 0, 0) @ Affine.scaling(PINHOLE, PINHOLE, 1, 1),
        extent=(1.0, 1.0),
        beyond=ALL,
        disparity_range=None,
        disparities=Disparities(),
        filling=None,
    )


@dataclass(frozen=True, eq=False, repr=False)
class DepthChange(Brief):
    """What is added to an image with ``diffraction=True``.

    Args:
        values: of the shape of the image.
        uncorrected: share of the middle view's pixels whose blur is too large for a kernel by waves.
        unmatched: share of its pixels whose disparity is not reliable.
    """

    values: NDArray[np.float32]
    uncorrected: float
    unmatched: float

    @classmethod
    def of(cls, train: Train, light_field: Samples, how: How) -> DepthChange:
        """Compute it.

        Args:
            train: the camera, which meets all bands alike.
            light_field: with disparities, or else they are estimated; or ``how.scene_distance`` for all.
            how: as for the image.

        Raises:
            InputError: as for `StopDiffraction.of`; disparities of other views only; tensors.
        """
        whole = light_field.whole()
        if whole is not None and not isinstance(whole, np.ndarray):
            raise InputError(
                f"diffraction='depth' needs samples in NumPy, not {type(whole).__module__} arrays: it passes no "
                "gradients. Use diffraction=True"
            )
        grid = light_field.grid
        stop = StopDiffraction.of(train, grid)
        vergence, unmatched = _vergences(light_field, how)
        pupil = Pupil.of(train, points=ESTIMATED)
        made = _Kernels(stop, pupil)
        at = vergence / made.apart
        around = np.floor(at), np.ceil(at)
        kernels = {float(n): made.of(n) for n in np.unique(around) if abs(n - made.in_focus) <= MOST_LAYERS}
        kept = {n: kernel for n, kernel in kernels.items() if kernel is not None}
        missing = ~np.isin(around, list(kept)).all(axis=0)
        margin = max((len(kernel) // 2 for kernel in kept.values()), default=0)
        rows, columns = train.sensor.shape
        shape = rows + 2 * margin, columns + 2 * margin
        total: NDArray[np.complex128] | float = 0.0
        sharp = _Sharp(train, light_field, pupil, shape, how)
        for n, kernel in kept.items():
            weight = np.maximum(1 - np.abs(at - n), 0) * ~missing
            if weight.any():
                spectrum = _transform(kernel, shape, made.shift(n, sharp.seen_from))
                total = total + np.fft.rfft2(sharp.of(weight), axes=(0, 1)) * spectrum
        added = np.fft.irfft2(total, shape, axes=(0, 1)) if not np.isscalar(total) else np.zeros((*shape, 1))
        cut = added[margin : margin + rows, margin : margin + columns]
        channels = grid.shape[4:]
        values = np.broadcast_to(cut, (rows, columns, *channels)) if channels else cut[..., 0]
        return cls(np.asarray(values, np.float32), float(missing.mean()), unmatched)

    @property
    def cautions(self) -> tuple[str, ...]:
        """What is not as well known as the rest, as text."""
        found = []
        if self.uncorrected > 0.01:
            found.append(
                f"diffraction='depth': {self.uncorrected:.0%} of the scene is blurred by more than some 16 waves "
                f"or {LARGEST_ESTIMATE} pixels, and diffracted as by diffraction=True"
            )
        if self.unmatched > 0.05:
            found.append(
                f"diffraction='depth': {self.unmatched:.0%} of the pixels have a disparity at which views differ: "
                "their blur is of another depth"
            )
        return tuple(found)


def _vergences(light_field: Samples, how: How) -> tuple[Array, float]:
    """1/Z of the pixels of the middle view, (t, s), and the share that is not reliable."""
    grid = light_field.grid
    if how.scene_distance is not None:
        return np.full(grid.shape[2:4], 1 / how.scene_distance), 0.0
    maps = grid.disparities.maps()
    middle = tuple(map(float, grid.middle_view))
    places = [tuple(map(float, view)) for view in maps.views]
    if middle not in places:
        raise InputError(
            f"diffraction='depth' needs the disparities of the middle view {middle}, and there are those of "
            f"{places[:3]}: use diffraction=True"
        )
    z, one = grid.homogeneous_distances(maps.values[places.index(middle)])
    return np.asarray(one / np.where(z == 0, np.inf, z)), maps.unmatched


@dataclass(frozen=True, eq=False, repr=False)
class _Kernels(Brief):
    """Differences of images of a point: by waves, less by rays and one convolution.

    Args:
        stop: with the bands.
        pupil: of `ESTIMATED` points.
    """

    stop: StopDiffraction
    pupil: Pupil

    @property
    def apart(self) -> float:
        """Of neighbouring layers, 1/m; layer n is at n times this."""
        width = max(self.pupil.steps) * self.pupil.points
        return 8 * min(self.stop.wavelengths) * WAVES_APART / width**2

    @property
    def in_focus(self) -> float:
        """The number of the layer in focus, between whole ones."""
        return float(np.trace(self.pupil.focus)) / 2 / self.apart

    def shift(self, layer: float, seen_from: Array) -> Array:
        """(x, y), pixels, from what the middle view shows to rays through the middle of the pupil."""
        defocus = layer * self.apart * np.eye(2) - self.pupil.focus
        frame = self.stop.train.sensor.frame.inverse().linear
        return np.asarray(frame @ self.pupil.sensor_from_slope @ defocus @ (self.pupil.middle - seen_from))

    def of(self, layer: float) -> Array | None:
        """(rows, columns, bands) of a layer; None if the defocus is not resolved, or the image too large."""
        frame, pupil = self.stop.train.sensor.frame.inverse().linear, self.pupil
        vergence = layer * self.apart
        lit = pupil.slopes(vergence)[pupil.amplitude > 0] @ (frame @ pupil.sensor_from_slope).T
        size = 2 * math.ceil(np.abs(lit).max() + min(self.stop.half_width, HALO)) + 1
        bands = self.stop.wavelengths
        if size > LARGEST_ESTIMATE or not pupil.resolved(vergence, min(bands)):
            return None
        pairs = [point_spreads(pupil, vergence, each, frame, size)[:2] for each in bands]
        return np.stack([by_waves - by_both for by_waves, by_both in pairs], axis=-1)


class _Sharp:
    """Irradiance of the scene's layers if all light of a pixel of the middle view fell on one place.

    Args:
        train: the camera.
        light_field: the scene.
        pupil: of the middle of the sensor.
        shape: (rows, columns) of the sensor with its margins.
        how: as for the image.
    """

    def __init__(self, train: Train, light_field: Samples, pupil: Pupil, shape: tuple[int, int], how: How) -> None:
        grid = through_pinhole(light_field.grid)
        self.seen_from = grid.frame([0.0, 0.0, (grid.shape[3] - 1) / 2, (grid.shape[2] - 1) / 2])[:2]
        j, i = light_field.grid.middle_view
        nt, ns = light_field.grid.shape[2:4]
        whole = to_numpy(light_field.read(Block((j, j + 1), (i, i + 1), (0, nt), (0, ns))))
        self.values = np.asarray(whole, np.float32) / np.float32(grid.full_scale)
        to_sensor = train.arriving_at_sensor
        self.grid = replace(grid, frame=to_sensor @ grid.frame, kind=np.dtype(np.float32))
        sensor = replace(train.sensor, z=0.0, shape=shape, electronics=None, angular_response=None)
        self.how = replace(
            how,
            method="footprints",
            diffraction=False,
            scene_distance=None,
            between_views="none",
            samples=None,
            tolerance=None,
        )
        self.plan = compile_best(Train([], sensor), self.grid, self.how)
        cell = abs(np.linalg.det(self.grid.frame.linear[:2, 2:]))
        by_slope = abs(np.linalg.det(pupil.sensor_from_slope))
        # A pixel gets radiance × volume of the sample / its area there; by the camera, × slopes of its pupil.
        slopes = (pupil.amplitude**2).sum() * math.prod(pupil.steps) / by_slope
        self.scale = cell / self.grid.sample_volume * slopes

    def of(self, weight: Array) -> Array:
        """(rows, columns, channels) of the middle view's pixels times weights (t, s)."""
        weights = weight.astype(np.float32).reshape(1, 1, *weight.shape, *[1] * (self.values.ndim - 4))
        found = drive(self.plan, InMemory.of(self.values * weights, self.grid), self.how).values
        irradiance = np.asarray(found, np.float64).reshape(*found.shape[:2], -1)
        return np.asarray(irradiance * self.scale)


def _transform(kernel: Array, shape: tuple[int, int], shift: Array) -> NDArray[np.complex128]:
    """The spectrum of a kernel about its middle, moved by (x, y) pixels, on a raster that is larger."""
    size = len(kernel)
    padded = np.zeros((*shape, kernel.shape[2]))
    padded[:size, :size] = kernel
    found = np.fft.rfft2(np.roll(padded, (-(size // 2),) * 2, (0, 1)), axes=(0, 1))
    cycles = np.fft.fftfreq(shape[0])[:, None] * shift[1] + np.fft.rfftfreq(shape[1]) * shift[0]
    return np.asarray(found * np.exp(-2j * math.pi * cycles)[..., None])
