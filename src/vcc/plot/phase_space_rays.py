"""Trace a 2-D slice of a light field through any camera, and image it in phase space.

Behind lenslets, plates and prisms, the cells of a light field are no longer parallelograms of one frame.
Radiance is constant along each ray. Therefore the slice is divided into many rays, each with the radiance of
its cell. They are traced through the same stages as captures, and at each plane they are collected in a
raster of two of the four coordinates. A diffuser splits each ray into many: there the raster is convolved
with the kernel along the slope and converted back to rays.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.sampled import LIGHT_FIELD_AXES, to_numpy
from vcc.fields.samples import InMemory
from vcc.optics import Scatter
from vcc.optics.aberrations import Aberrations
from vcc.optics.train import Stage, Train, about, met_in_order
from vcc.plot.tracing import marginals

Array = NDArray[np.float64]

NAMES = "uvst"
"""The coordinates of a ray, in order."""
RAYS = 1_000_000
"""Approximate number of traced rays: some tens per filled cell of the raster."""
RASTER = (400, 320)
"""(columns, rows) of the images, and of the rasters convolved with a diffuser's kernel."""
FULL = 0.75
"""Cells of the raster with at least this share of their rays count as filled: the rays' lattice beats with
the raster, with a smaller amplitude than the rest."""
NEXT_TO_NOTHING = 1e-7
"""Share of a cell filled by a diffuser's tails below which it counts as empty: just above rounding."""
IN_ONE_PLANE = ((0, 2), (1, 3))
"""Slices of a position and its own slope: optics preserve their areas, and diffusers can be drawn."""
LARGEST_GRID = 2000
"""Largest number of cells per side for a slice whose coordinates are not those of the samples' grid."""


@dataclass(frozen=True, eq=False, repr=False)
class PhaseSpacePicture(Brief):
    """A slice of a light field in two of its coordinates, at one plane.

    Args:
        title: description of the plane.
        z: of the plane, metres.
        radiance: shape (rows, columns) or (rows, columns, 3): row 0 at the smallest value of the second
            coordinate, column 0 at that of the first; 0 where there is no light field.
        filled: the share of each cell that rays fill, (rows, columns). Rays are on a lattice, so that within
            the slice it is only approximately 1. For slices other than of a position and its slope, whose
            areas optics do not preserve, it is 1 where there are rays, otherwise 0.
        first: borders of the columns, (columns + 1,): metres for u and v, slopes for s and t.
        second: borders of the rows, (rows + 1,).
    """

    title: str
    z: float
    radiance: Array
    filled: Array
    first: Array
    second: Array

    @property
    def light(self) -> float:
        """∫∫ radiance over both coordinates, the mean of the channels."""
        cell = (self.first[1] - self.first[0]) * (self.second[1] - self.second[0])
        values = self.radiance if self.radiance.ndim == 2 else self.radiance.mean(axis=2)
        return float((values * self.filled).sum() * cell)


@dataclass(frozen=True, eq=False, repr=False)
class Sheet(Brief):
    """A 2-D slice at the entrance plane, in cells: the ray at (a, b) is origin + a·first + b·second.

    Cell (n, m) reaches from (n, m) to (n + 1, m + 1).

    Args:
        values: radiance of the cells, (n, m) or (n, m, 3); NaN where there is no light field.
        origin: the ray (u, v, s, t) of the corner of cell (0, 0).
        first: change of the ray from cell to cell along axis 0.
        second: change of the ray from cell to cell along axis 1.
        across: the two drawn coordinates, as indices of (u, v, s, t).
    """

    values: Array
    origin: Array
    first: Array
    second: Array
    across: tuple[int, int]

    def moved(self, affine: Affine) -> Sheet:
        """The same cells after a map of rays."""
        turned = affine.linear
        return replace(self, origin=affine(self.origin), first=turned @ self.first, second=turned @ self.second)


def slice_of(across: str) -> tuple[int, int]:
    """Parse two coordinates into indices of (u, v, s, t); ``"u"`` is short for "us", ``"v"`` for "vt".

    Raises:
        InputError: invalid coordinates, or one twice.
    """
    names = {"u": "us", "v": "vt"}.get(across, across)
    if not isinstance(names, str) or len(names) != 2 or names[0] == names[1] or set(names) - set(NAMES):  # type: ignore[redundant-expr]
        raise InputError(
            f'across is "u" or "v", or two of u, v, s and t, such as "uv" (horizontal first), not {across!r}'
        )
    return NAMES.index(names[0]), NAMES.index(names[1])


def sheet_of_samples(piece: InMemory, across: tuple[int, int]) -> Sheet:
    """The sheet of a light field reduced to one row of views and one row of pixels: its own cells.

    Args:
        piece: shape (1, views, 1, pixels) for u and s, (views, 1, pixels, 1) for v and t.
        across: as in `Sheet`.
    """
    values = to_numpy(piece.values)
    values = values[0, :, 0] if across == (0, 2) else values[:, 0, :, 0]
    values = radiance_of(values, piece)
    first, second = (piece.frame.linear[:, index] for index in across)
    return Sheet(values, piece.frame.offset - first / 2 - second / 2, first, second, across)


def sheet_of_rays(light_field: InMemory, across: tuple[int, int], fixed: tuple[float, float] | None) -> Sheet:
    """The sheet of all rays with two fixed coordinates, interpolated linearly between samples.

    Args:
        light_field: at the entrance plane.
        across: as in `Sheet`.
        fixed: the other two coordinates, in the order u, v, s, t: metres and slopes; None uses the middle of the
            light field.

    Raises:
        InputError: not two finite numbers, or a slice outside the light field.
    """
    from scipy.ndimage import map_coordinates

    shape = light_field.shape
    counts = np.array([shape[axis] for axis in LIGHT_FIELD_AXES])
    corners = np.stack(np.meshgrid(*[(-0.5, count - 0.5) for count in counts], indexing="ij"), axis=-1)
    rays = light_field.frame(corners.reshape(-1, 4))
    others = [n for n in range(4) if n not in across]
    middle = light_field.frame((counts - 1) / 2)
    held = middle[others] if fixed is None else np.asarray(fixed, dtype=np.float64)
    if held.shape != (2,) or not np.isfinite(held).all():
        raise InputError(f"fixed must be two numbers, {NAMES[others[0]]} and {NAMES[others[1]]}, not {fixed}")
    origin, steps, sizes = middle.copy(), np.zeros((2, 4)), []
    origin[others] = held
    for n, axis in enumerate(across):
        low, high = rays[:, axis].min(), rays[:, axis].max()
        step = abs(light_field.frame.linear[axis, axis]) or (high - low) / counts[axis]
        size = int(min(max(round((high - low) / step), 1), LARGEST_GRID))
        origin[axis], steps[n, axis] = low, (high - low) / size
        sizes.append(size)
    places = np.indices(sizes).reshape(2, -1).T + 0.5
    index = light_field.frame.inverse()(origin + places @ steps)
    held_samples = ((index > -0.5 - 1e-9) & (index < counts - 0.5 + 1e-9)).all(axis=1)
    if not held_samples.any():
        bounds = ", ".join(
            f"{NAMES[n]} {rays[:, n].min():.4g} to {rays[:, n].max():.4g}{' m' if n < 2 else ''}" for n in others
        )
        raise InputError(
            f"the light field holds no rays of {NAMES[others[0]]} = {held[0]:g} and {NAMES[others[1]]} = "
            f"{held[1]:g} at the entrance plane: it reaches over {bounds}"
        )
    order = index[:, list(LIGHT_FIELD_AXES)].T  # (v, u, t, s), as values are stored
    samples = to_numpy(light_field.values)
    channels = samples[..., None] if samples.ndim == 4 else samples
    picked = np.stack(
        [
            map_coordinates(channels[..., n], order, output=np.float64, order=1, mode="nearest")
            for n in range(channels.shape[4])
        ],
        axis=-1,
    )
    picked[~held_samples] = np.nan
    picked = picked.reshape(*sizes, -1)
    values = radiance_of(picked if samples.ndim == 5 else picked[..., 0], light_field)
    return Sheet(values, origin, steps[0], steps[1], across)


def radiance_of(values: NDArray[Any], light_field: InMemory) -> Array:
    """Radiance of samples of a light field; the mean over channels unless there are three (colour)."""
    radiance: Array = values.astype(np.float64) / light_field.grid.full_scale
    return radiance.mean(axis=-1) if light_field.grid.channels not in (None, 3) else radiance


@dataclass
class _Bundle:
    """Traced rays of a sheet: (n, 4), their radiance (n,) or (n, 3), and the sheet's area per ray."""

    rays: Array
    radiance: Array
    area: float
    across: tuple[int, int]

    @classmethod
    def of(cls, sheet: Sheet, count: int) -> _Bundle:
        """Rays evenly over the sheet, without cells outside the light field."""
        sizes = sheet.values.shape[:2]
        total = [max(1, round(math.sqrt(count) / size)) * size for size in sizes]
        place = [(np.arange(n) + 0.5) / n * size for n, size in zip(total, sizes, strict=True)]
        a, b = (axis.ravel() for axis in np.meshgrid(*place, indexing="ij"))
        radiance = sheet.values[a.astype(np.int64), b.astype(np.int64)]
        known = ~np.isnan(radiance if radiance.ndim == 1 else radiance[:, 0])
        a, b, radiance = a[known], b[known], radiance[known]
        rays = sheet.origin + a[:, None] * sheet.first + b[:, None] * sheet.second
        chosen = list(sheet.across)
        turned = np.linalg.det(np.stack([sheet.first[chosen], sheet.second[chosen]]))
        area = abs(float(turned)) * sizes[0] * sizes[1] / (total[0] * total[1])
        return cls(rays, radiance, area, sheet.across)

    def move(self, affine: Affine) -> None:
        """Move the rays to another plane."""
        self.rays = affine(self.rays)

    def meet(self, stage: Stage, count: int) -> None:
        """Absorb, bend and scatter the rays at a stage."""
        share = stage.share(self.rays)
        self.radiance = self.radiance * (share if self.radiance.ndim == 1 else share[:, None])
        if isinstance(stage.faces.bending, Aberrations):
            self._refract(stage)
        else:
            self.rays = stage.deflected(self.rays)
        if stage.faces.spread is not None:
            self._scatter(stage, stage.faces.spread, count)

    def _refract(self, stage: Stage) -> None:
        """Leave out rays that the surfaces of a real lens stop."""
        bending = stage.faces.bending
        assert isinstance(bending, Aberrations)
        share = bending.shares(self.rays - [*stage.element.decentre, 0.0, 0.0])
        kept = share > 0
        if not kept.any():
            raise InputError(f"no ray of this slice passes {stage.element.label}")
        share = share[kept] if self.radiance.ndim == 1 else share[kept, None]
        self.radiance = self.radiance[kept] * share
        self.rays = stage.deflected(self.rays[kept])

    def laid_out(self, columns: int, rows: int, grow: float = 0.0) -> tuple[Array, Array, Array, Array]:
        """(radiance, filled, borders of columns, borders of rows), the second coordinate extended by ``grow``."""
        places = self.rays[:, list(self.across)]
        low, high = places.min(axis=0), places.max(axis=0)
        # If all rays coincide along an axis, use a cell of finite width.
        least = 1e-9 * np.maximum(np.abs(low), np.abs(high)) + 1e-12
        low, high = low - least - np.array([0, grow]), high + least + np.array([0, grow])
        cell = (high - low) / (columns, rows)
        index = np.minimum(((places - low) / cell).astype(np.int64), (columns - 1, rows - 1))
        flat = index[:, 1] * columns + index[:, 0]
        count = np.bincount(flat, minlength=columns * rows)
        channels = self.radiance.reshape(len(flat), -1).T
        sums = [np.bincount(flat, channel, columns * rows) for channel in channels]
        mean = np.stack(sums, axis=-1) / np.maximum(count, 1)[:, None]
        filled = np.asarray(count * (self.area / float(np.prod(cell))), dtype=np.float64)
        if self.across not in IN_ONE_PLANE:  # areas are not preserved
            filled = (count > 0).astype(np.float64)
        radiance = mean.reshape(rows, columns, -1)
        return (
            radiance[..., 0] if self.radiance.ndim == 1 else radiance,
            np.asarray(filled.reshape(rows, columns)),
            low[0] + cell[0] * np.arange(columns + 1),
            low[1] + cell[1] * np.arange(rows + 1),
        )

    def _scatter(self, stage: Stage, scatter: Scatter, count: int) -> None:
        """Convolve the raster along the slope, and convert it to a sheet of cells again.

        The kernel along the other slope moves light out of the slice. Neighbouring slices are assumed to be
        equal, so that the same amount comes in.
        """
        if self.across not in IN_ONE_PLANE:
            names = "".join(NAMES[n] for n in self.across)
            raise InputError(
                f'{stage.element.label} scatters light out of the slice "{names}": draw "us" or "vt", which hold '
                "a place and its slope"
            )
        position, slope = self.across
        columns, rows = RASTER
        values, filled, first, second = self.laid_out(columns, rows, scatter.reach[position])
        beside = [n for n in range(4) if n not in self.across]
        column = np.clip(((self.rays[:, position] - first[0]) / (first[1] - first[0])).astype(int), 0, columns - 1)
        hits = np.maximum(np.bincount(column, minlength=columns), 1)
        held = np.stack([np.bincount(column, self.rays[:, n], columns) / hits for n in beside], axis=-1)
        at = np.zeros((columns, 2))
        at[:, position], at[:, 1 - position] = (first[1:] + first[:-1]) / 2, held[:, 0]
        at -= stage.element.decentre
        # Removes the beat of the rays' lattice with the raster, and preserves the total.
        even = np.minimum(filled / FULL, 1.0)
        dim = values if values.ndim == 2 else values.mean(axis=2)
        weight = dim if dim.any() else np.ones_like(dim)
        even *= float((weight * filled).sum() / (weight * even).sum())
        light = values.reshape(rows, columns, -1) * even[..., None]
        with stage.named():
            blurred = _along_slope(
                np.concatenate([light, even[..., None]], axis=-1), scatter, position, at, second[1] - second[0]
            )
        lit = blurred[..., -1] > NEXT_TO_NOTHING
        n, m = np.nonzero(lit.T)
        finer = max(1, round(math.sqrt(count / max(len(n), 1))))
        offsets = (np.arange(finer) + 0.5) / finer
        du, ds = (axis.ravel() for axis in np.meshgrid(offsets, offsets))
        rays = np.empty((len(n), len(du), 4))
        rays[..., position] = first[0] + (n[:, None] + du) * (first[1] - first[0])
        rays[..., slope] = second[0] + (m[:, None] + ds) * (second[1] - second[0])
        rays[..., beside] = held[n][:, None]
        radiance = np.repeat(blurred[m, n, :-1], len(du), axis=0)
        self.rays = rays.reshape(-1, 4)
        self.radiance = radiance[:, 0] if self.radiance.ndim == 1 else radiance
        self.area = float((first[1] - first[0]) * (second[1] - second[0])) / len(du)


def _along_slope(light: Array, scatter: Scatter, axis: int, places: Array, step: float) -> Array:
    """A raster (slopes, places, channels) convolved along its slopes by the kernels at positions (n, 2).

    The light of each kernel point is shared by the two cells around it, so that its mean is exact.
    """
    slopes, shares, widths = marginals(scatter, axis, places[:, 0], places[:, 1])
    reach = math.ceil(scatter.reach[axis] / step) + 1
    half = np.arange(len(places))
    taps = np.zeros((len(places), 2 * reach + 1))
    for slope, share in zip(slopes, shares.T, strict=True):
        shift = slope * widths / step
        whole = np.floor(shift).astype(np.int64)
        taps[half, whole + reach] += share * (1 - (shift - whole))
        taps[half, np.minimum(whole + 1 + reach, 2 * reach)] += share * (shift - whole)
    taps /= taps.sum(axis=1, keepdims=True)
    padded = 1 << (len(light) + 2 * reach).bit_length()
    spectrum = np.fft.rfft(light, padded, axis=0) * np.fft.rfft(taps, padded, axis=1).T[:, :, None]
    found = np.fft.irfft(spectrum, padded, axis=0)[reach : reach + len(light)]
    return np.maximum(found, 0.0)  # rounding of the transform


def traced(
    camera: Train, sheet: Sheet, titles: dict[float, str], *, rays: int = RAYS, raster: tuple[int, int] = RASTER
) -> Iterator[PhaseSpacePicture]:
    """The images of a sheet at the entrance, behind each plane of elements and on the sensor.

    Args:
        camera: any.
        sheet: at the entrance plane.
        titles: of the wanted planes, by z in metres: the ends of elements, and the sensor's; −1 for the
            entrance, before all elements.
        rays: approximate number of traced rays.
        raster: (columns, rows) of the images.

    Raises:
        InputError: a diffuser for a slice that is not of a position and its slope, or an error of an element.
    """
    bundle = _Bundle.of(sheet, rays)

    def picture(title: str, z: float) -> PhaseSpacePicture:
        radiance, filled, first, second = bundle.laid_out(*raster)
        return PhaseSpacePicture(title, z, radiance, filled, first, second)

    yield picture(titles[-1.0], 0.0)
    here = 0.0
    met = list(met_in_order(camera.elements))
    elements = [element for element, _ in met]
    for n, (element, parts) in enumerate(met):
        bundle.move(Affine.propagation(element.z - here))
        here = element.z + element.length
        for part in parts:
            if isinstance(part, Affine):
                bundle.move(about(element.decentre, part))
            else:
                bundle.meet(Stage(element, element.z, Affine.identity(), part), rays)
        last = n + 1 == len(elements) or elements[n + 1].z + elements[n + 1].length != here
        if last and here in titles:
            yield picture(titles[here], here)
    if camera.sensor.z in titles and (not elements or here != camera.sensor.z):
        bundle.move(Affine.propagation(camera.sensor.z - here))
        yield picture(titles[camera.sensor.z], camera.sensor.z)
