"""Trace single rays through a camera, for drawing: their paths, how they split, and where they end."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.optics import Element, Faces, RealLens, Scatter
from vcc.optics.faces import Part
from vcc.optics.train import Stage, Train, about
from vcc.shapes.kernels import Kernel

Array = NDArray[np.float64]

BRANCHES = (1 / 6, 1 / 2, 5 / 6)
"""A scattered ray splits into three, at these quantiles of the kernel, each with a third of the light. For a
Gaussian they are its centre and ±0.97 σ; for two spots they are the spots, not the dark gap."""
MOST_RAYS = 1500
"""Rays are not split into more than this: beyond it, each ray continues as one of its branches, alternately."""
BINS = 257
"""Number of bins over the reach of a kernel, to find its quantiles."""


@dataclass(frozen=True, eq=False, repr=False)
class Paths(Brief):
    """Positions of rays at planes, and their remaining light.

    Args:
        z: of each plane, metres: (planes,). The last one is the sensor's.
        positions: (x, y) of each ray at each plane, metres: (rays, planes, 2).
        shares: remaining light of each ray on arrival at each plane, 0 to 1: (rays, planes).
        starts: the plane at which each ray begins, (rays,): 0, or that of the diffuser at which it branched off.
            Before that, it coincides with the ray from which it branched off.
        behind: how far behind each plane's z a ray meets a curved surface of a real lens, or begins, metres:
            (rays, planes).
        origins: the number of the given ray from which each one comes, (rays,).
    """

    z: Array
    positions: Array
    shares: Array
    starts: NDArray[np.int64]
    behind: Array
    origins: NDArray[np.int64]

    def coming_from(self, given: range) -> Paths:
        """Those of some of the given rays."""
        some = (self.origins >= given.start) & (self.origins < given.stop)
        positions, shares, starts = self.positions[some], self.shares[some], self.starts[some]
        return Paths(self.z, positions, shares, starts, self.behind[some], self.origins[some])

    @property
    def depths(self) -> Array:
        """Where on the axis each ray meets each plane or surface, metres: (rays, planes)."""
        return self.z + self.behind


@dataclass(frozen=True, eq=False)
class Crossing:
    """A plane of an element that light crosses.

    Args:
        z: of the plane, metres. Inside a thick element only a map of rays is known: z is then where a ray
            through the centre of the entrance would be after free propagation.
        step: map of rays from the crossing before, or from just before the element, to here; centred on the
            element.
        from_entrance: map of rays from just before the element to here; centred on the element.
        faces: of the plane.
    """

    z: float
    step: Affine
    from_entrance: Affine
    faces: Faces


def crossings(element: Element, parts: Sequence[Part] | None = None) -> list[Crossing]:
    """The planes of an element in order: one of a thin element; entrance, all faces and exit of a thick one."""
    parts = element.parts() if parts is None else parts
    steps_ahead = sum(isinstance(part, Affine) for part in parts)
    end = element.z + element.length
    found: list[Crossing] = []
    step = total = Affine.identity()
    for part in parts:
        if isinstance(part, Affine):
            if not found:
                found.append(Crossing(element.z, step, total, Faces()))
            step, total = part @ step, part @ total
            steps_ahead -= 1
            continue
        flown = float(total.matrix[0, 2])
        z = end if steps_ahead == 0 else min(max(element.z + flown, found[-1].z if found else element.z), end)
        found.append(Crossing(z, step, total, part))
        step = Affine.identity()
    if isinstance(parts[-1], Affine):
        found.append(Crossing(end, step, total, Faces()))
    return found


def trace(camera: Train, rays: ArrayLike, start: ArrayLike = 0.0, split_along: int | None = None) -> Paths:
    """Trace rays from a plane before the camera through its elements to the sensor.

    Args:
        camera: with elements that bend, absorb and scatter.
        rays: (u, v, s, t) of each ray at the entrance plane z = 0: (rays, 4), metres and slopes.
        start: where the drawing of the rays begins, metres, 0 or less: of all, or of each (rays,).
        split_along: the axis, 0 for x and 1 for y, along which scattered rays split into three (`BRANCHES`);
            None ignores scattering.

    Raises:
        InputError: an element with an invalid result.
    """
    given = np.asarray(rays, dtype=np.float64)
    count = len(given)
    bundle = _Bundle(given, np.ones(count), np.zeros(count, dtype=np.int64), np.arange(count), [], [], [], [])
    starts = np.broadcast_to(np.asarray(start, dtype=np.float64), (count,))
    first = float(starts.min(initial=0.0))
    bundle.cross(first, given[:, :2] + starts[:, None] * given[:, 2:], starts - first)
    here = 0.0
    for element, parts in camera.met:
        bundle.rays = Affine.propagation(element.z - here)(bundle.rays)
        here = element.z + element.length
        if isinstance(element, RealLens):
            bundle.refract(element)
            continue
        for crossing in crossings(element, parts):
            bundle.rays = about(element.decentre, crossing.step)(bundle.rays)
            bundle.cross(crossing.z, bundle.rays[:, :2])
            bundle.meet(Stage(element, crossing.z, Affine.identity(), crossing.faces), split_along)
    bundle.rays = Affine.propagation(camera.sensor.z - here)(bundle.rays)
    bundle.cross(camera.sensor.z, bundle.rays[:, :2])
    return Paths(
        np.array(bundle.z),
        np.stack(bundle.positions, axis=1),
        np.stack(bundle.shares, axis=1),
        bundle.starts,
        np.stack(bundle.behind, axis=1),
        bundle.origins,
    )


@dataclass
class _Bundle:
    """Rays during tracing; the lists have one entry per plane so far."""

    rays: Array
    share: Array
    starts: NDArray[np.int64]
    origins: NDArray[np.int64]
    z: list[float]
    positions: list[Array]
    shares: list[Array]
    behind: list[Array]

    def cross(self, z: float, positions: Array, behind: Array | None = None) -> None:
        """Record the arrival of the rays at a plane, or so far behind it."""
        self.z.append(z)
        self.positions.append(positions)
        self.shares.append(self.share)
        self.behind.append(np.zeros(len(positions)) if behind is None else behind)

    def refract(self, lens: RealLens) -> None:
        """Refract the rays at each surface of a real lens, from its z to its end. Rays that miss one end."""
        middle, z = [*lens.decentre, 0.0, 0.0], lens.z
        x, y, s, t = (self.rays - middle).T
        for number, surface in enumerate(lens.onward):
            z += surface.distance
            with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
                met = surface.met(x, y, s, t)
            hit = np.isfinite(met.x) & np.isfinite(met.z)
            plane = x + surface.distance * s, y + surface.distance * t
            places = np.column_stack(
                [np.where(hit, on, off) for on, off in zip((met.x, met.y), plane, strict=True)]
            )
            self.share = np.where(hit, self.share, 0.0)
            self.cross(z, places + lens.decentre, np.where(hit, met.z, 0.0))
            self.share = self.share * surface.share(met)
            if lens.mask is not None and number == lens.stop_number:
                self.share = self.share * lens.mask(*places.T)
            going = self.share > 0
            x, y = (
                np.where(going, at - slope * met.z, on)
                for at, slope, on in zip((met.x, met.y), (met.s, met.t), places.T, strict=True)
            )
            s, t = np.where(going, met.s, 0.0), np.where(going, met.t, 0.0)
        ending = lens.z + lens.length - z
        self.rays = np.column_stack([x + ending * s, y + ending * t, s, t]) + middle

    def meet(self, stage: Stage, split_along: int | None) -> None:
        """Absorb, bend and scatter the rays."""
        x, y = (self.rays[:, :2] - stage.element.decentre).T
        self.share = self.share * stage.share(self.rays)
        bent = stage.deflected(self.rays)
        going = np.asarray(np.isfinite(bent).all(axis=1))  # others are outside the opening of a table of rays
        self.rays, self.share = np.where(going[:, None], bent, self.rays), np.where(going, self.share, 0.0)
        if stage.faces.spread is not None and split_along is not None:
            with stage.named():
                scattered = branches(stage.faces.spread, split_along, x, y)
            self.split(scattered, split_along)

    def split(self, slopes: Array, axis: int) -> None:
        """Split each ray by these changes of slope, (rays, branches)."""
        count, branch = slopes.shape
        middle = branch // 2
        if count * branch > MOST_RAYS:
            self.rays = self.rays.copy()
            self.rays[:, 2 + axis] += slopes[np.arange(count), np.arange(count) % branch]
            return
        parent = np.repeat(np.arange(count), branch)
        self.rays, self.share, self.origins = self.rays[parent], self.share[parent] / branch, self.origins[parent]
        self.rays[:, 2 + axis] += slopes.ravel()
        self.positions = [positions[parent] for positions in self.positions]
        self.shares = [shares[parent] for shares in self.shares]
        self.behind = [behind[parent] for behind in self.behind]
        # The middle branch continues the original ray.
        own = np.arange(count * branch) % branch == middle
        self.starts = np.where(own, self.starts[parent], len(self.z) - 1)


def branches(scatter: Scatter, axis: int, x: Array, y: Array) -> Array:
    """Changes of slope along an axis at the quantiles `BRANCHES` of the kernels at positions x, y: (places, 3)."""
    slopes, shares, widths = marginals(scatter, axis, x, y)
    order = np.argsort(slopes)
    running = np.cumsum(shares[:, order], axis=1)
    # The first slope that reaches the share: never between two spots, where there is no light.
    picked = [np.argmax(running >= share * running[:, -1:], axis=1) for share in BRANCHES]
    return np.asarray(slopes[order][np.stack(picked, axis=-1)] * widths[:, None])


def spread_along(scatter: Scatter, axis: int, x: Array, y: Array) -> Array:
    """The standard deviation of the change of slope along an axis at positions x, y: (places,)."""
    slopes, shares, widths = marginals(scatter, axis, x, y)
    mean = shares @ slopes
    return np.asarray(widths * np.sqrt(np.maximum(shares @ slopes**2 - mean**2, 0.0)))


def marginals(scatter: Scatter, axis: int, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Changes of slope (n,) of all kernels, their shares (places, n) at each position, and widths (places,)."""
    mix, widths = scatter.at(x, y)
    single = [_marginal(kernel, axis) for kernel in scatter.kernels]
    shares = np.concatenate([mix[:, n, None] * share for n, (_, share) in enumerate(single)], axis=1)
    return np.concatenate([slopes for slopes, _ in single]), shares, widths


def _marginal(kernel: Kernel, axis: int) -> tuple[Array, Array]:
    """A kernel's distribution along one axis: changes of slope, and the share of light of each."""
    slopes, shares = kernel.quadrature()
    slopes, reach = slopes[:, axis], kernel.reach[axis]
    places = (slopes / reach + 1) / 2 * BINS if reach > 0 else 0 * slopes
    bins = np.clip(places, 0, BINS - 1).astype(np.int64)
    total = np.asarray(np.bincount(bins, shares), dtype=np.float64)
    lit = total > 0
    return np.bincount(bins, shares * slopes)[lit] / total[lit], total[lit]


def openings(camera: Train, axis: int) -> Iterator[tuple[Element, Affine, float]]:
    """The openings of known size with opaque surroundings.

    Yields:
        The element, the map of rays from the entrance plane to the opening (through all that is affine), and
        half of the opening's size along the axis, metres.
    """
    for stage in camera.stages:
        if stage.faces.pattern is not None and math.isfinite(stage.faces.pattern.size[axis]):
            yield stage.element, stage.arriving, stage.faces.pattern.size[axis] / 2


def fan(positions: ArrayLike, distance: float, offset: float, axis: int) -> Array:
    """Rays from a point of the scene through positions on the entrance plane.

    Args:
        positions: along the drawn axis, metres.
        distance: of the point from the entrance plane, metres; infinite for parallel light.
        offset: of the point from the axis as a slope, X/Z.
        axis: 0 for x, 1 for y.

    Returns:
        (u, v, s, t) of each ray at z = 0, (rays, 4).
    """
    positions = np.asarray(positions, dtype=np.float64)
    rays = np.zeros((len(positions), 4))
    rays[:, axis] = positions
    rays[:, 2:] = 0.0 if math.isinf(distance) else rays[:, :2] / distance
    rays[:, 2 + axis] -= offset
    return rays
