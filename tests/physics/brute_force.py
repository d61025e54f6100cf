"""An independent, slow, plain tracer: closed-form scenes, thin-lens formulas by hand, quadrature.

Nothing here comes from `vcc`. A pixel's value is the mean over its area of

    I(x) = ∫∫ L(ray from aperture point a to sensor point x) · ∏ masks on the way  dA / d²

with the thin lens at z = 0. The aperture integral is a Gauss-Legendre rule in the stop's own coordinates (polar
for a round stop, Cartesian for a square one), so that the rim cuts no node. The mean over a pixel is a 2 × 2
Gauss-Legendre rule. Tests that rely on it check that halving the rule over the stop changes its images by less
than 60 dB below the peak.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Function = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class Texture:
    """mean + Σ amplitude · cos(2π (fx·x + fy·y) + phase); frequencies in cycles per metre."""

    mean: float
    waves: tuple[tuple[float, float, float, float], ...] = ()
    """(amplitude, fx, fy, phase) of each cosine."""

    def __call__(self, x: Array, y: Array) -> Array:
        shape = np.broadcast_shapes(np.shape(x), np.shape(y))
        if np.ndim(x) == np.ndim(y) == 2 and np.shape(x)[0] == np.shape(y)[1] == 1:
            return self._along_axes(x, y)
        total = np.full(shape, self.mean)
        crossed = np.size(x) + np.size(y) < total.size
        for amplitude, fx, fy, phase in self.waves:
            along, down = 2 * np.pi * fx * x + phase, 2 * np.pi * fy * y
            if crossed:  # cos(a + b) = cos a·cos b − sin a·sin b: few cosines where x and y lie along axes
                total += (amplitude * np.cos(along)) * np.cos(down)
                total -= (amplitude * np.sin(along)) * np.sin(down)
            else:
                total += amplitude * np.cos(along + down)
        return total

    def _along_axes(self, x: Array, y: Array) -> Array:
        """The same for a row of x and a column of y: all waves together, as a matrix product."""
        amplitude, fx, fy, phase = np.array(self.waves).reshape(-1, 4).T
        along, down = 2 * np.pi * fx[:, None] * x + phase[:, None], 2 * np.pi * y * fy
        of_rows = np.concatenate([np.cos(down), -np.sin(down)], axis=1)
        return self.mean + of_rows @ np.concatenate(
            [amplitude[:, None] * np.cos(along), amplitude[:, None] * np.sin(along)]
        )


def cosines(seed: int, periods: Sequence[float], amplitude: float = 0.1, mean: float = 0.5) -> Texture:
    """One cosine for each period (metres), in directions and phases drawn from ``seed``."""
    rng = np.random.default_rng(seed)
    waves = []
    for period in periods:
        angle, phase = rng.uniform(0, np.pi), rng.uniform(0, 2 * np.pi)
        waves.append((amplitude, np.cos(angle) / period, np.sin(angle) / period, phase))
    return Texture(mean, tuple(waves))


@dataclass(frozen=True)
class Layer:
    """A plane across the axis ``distance`` metres before the lens, with its radiance and its opacity."""

    distance: float
    texture: Function
    opacity: Function | None = None


@dataclass(frozen=True)
class Scene:
    """Layers, the nearest first; the last one is opaque."""

    layers: Sequence[Layer]

    def radiance(self, u: Array, v: Array, s: Array, t: Array) -> Array:
        """Radiance of rays with position (u, v) and slope (s, t) just before the lens."""
        light, through = 0.0, 1.0
        for layer in self.layers:
            # A ray that travels towards +z with slope s was at u − Z·s when it left the layer.
            x, y = u - layer.distance * s, v - layer.distance * t
            seen = through if layer.opacity is None else through * layer.opacity(x, y)
            light = light + seen * layer.texture(x, y)
            if layer.opacity is None:
                return np.asarray(light)
            through = through - seen
        return np.asarray(light)


def views(
    scene: Scene, shape: tuple[int, int, int, int], spacing: float, slope: float, focus: float = np.inf
) -> Array:
    """The light field of a planar array of parallel pinhole cameras: samples (v, u, t, s) at single rays."""
    nv, nu, nt, ns = shape
    u = ((np.arange(nu) - (nu - 1) / 2) * spacing)[None, :, None, None]
    v = ((np.arange(nv) - (nv - 1) / 2) * spacing)[:, None, None, None]
    s = u / focus - ((np.arange(ns) - (ns - 1) / 2) * slope)[None, None, None, :]
    t = v / focus - ((np.arange(nt) - (nt - 1) / 2) * slope)[None, None, :, None]
    return scene.radiance(u, v, s, t)


def round_stop(diameter: float, rings: int, spokes: int) -> tuple[Array, Array, Array]:
    """Nodes (x, y) and areas of a quadrature over a disc: Gauss in r², equal angles. Exact area."""
    nodes, weights = np.polynomial.legendre.leggauss(rings)
    radius = diameter / 2 * np.sqrt((nodes + 1) / 2)
    angle = 2 * np.pi * (np.arange(spokes) + 0.5) / spokes
    x, y = radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    area = np.pi * diameter**2 / 4 * np.repeat(weights / 2 / spokes, spokes)
    return x.ravel(), y.ravel(), area


def square_stop(side: float, points: int) -> tuple[Array, Array, Array]:
    """Nodes (x, y) and areas of a Gauss-Legendre rule over a square."""
    nodes, weights = np.polynomial.legendre.leggauss(points)
    x, y = np.meshgrid(nodes * side / 2, nodes * side / 2)
    return x.ravel(), y.ravel(), np.outer(weights, weights).ravel() * side**2 / 4


@dataclass(frozen=True)
class ThinLensCamera:
    """A thin lens at z = 0, sheets (z, transmission) behind it, and a sensor at z = distance.

    Args:
        focal_length: metres.
        stop: nodes and areas of the quadrature over the open aperture.
        distance: of the sensor.
        shape: (rows, columns) of pixels.
        pitch: of the pixels.
        masks: (z, transmission as a function of x and y in metres).
        points: Gauss-Legendre points per pixel, along each axis.
    """

    focal_length: float
    stop: tuple[Array, Array, Array]
    distance: float
    shape: tuple[int, int]
    pitch: float
    masks: Sequence[tuple[float, Function]] = field(default=())
    points: int = 2

    def picture(self, scene: Scene) -> Array:
        """Mean irradiance of each pixel."""
        nodes, weights = np.polynomial.legendre.leggauss(self.points)
        rows, columns = self.shape
        x = ((np.arange(columns) - (columns - 1) / 2)[:, None] + nodes / 2).ravel() * self.pitch
        y = ((np.arange(rows) - (rows - 1) / 2)[:, None] + nodes / 2).ravel() * self.pitch
        x, y = x[None, :], y[:, None]
        total = np.zeros((y.size, x.size))
        for a, b, area in zip(*self.stop, strict=True):
            s_behind, t_behind = (x - a) / self.distance, (y - b) / self.distance
            s, t = s_behind + a / self.focal_length, t_behind + b / self.focal_length
            light = scene.radiance(np.asarray(a), np.asarray(b), s, t) * area
            for z, transmission in self.masks:
                light = light * transmission(a + s_behind * z, b + t_behind * z)
            total += light
        total /= self.distance**2
        total = total.reshape(rows, self.points, columns, self.points)
        return np.einsum("rpcq,p,q->rc", total, weights / 2, weights / 2)


def psnr(image: Array, truth: Array) -> float:
    """Peak signal-to-noise ratio in dB; the peak is the truth's largest value."""
    error = np.asarray(image, dtype=np.float64) - truth
    return float(10 * np.log10(truth.max() ** 2 / np.mean(error**2)))
