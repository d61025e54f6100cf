"""Clouds of splats for tests."""

from __future__ import annotations

import numpy as np

from vcc.sources.splats import Splats

WHITE = 0.5 / 0.28209479177387814


def cloud(count: int, degree: int = 0, seed: int = 0) -> Splats:
    """Splats of any shape and direction before a camera at the origin that looks along +z."""
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.8, 4, count)
    places = np.stack(
        [rng.uniform(-0.6, 0.6, count) * depth, rng.uniform(-0.3, 0.3, count) * depth, depth], axis=1
    )
    turns = rng.normal(size=(count, 4))
    harmonics = rng.normal(0, 0.15, (count, (degree + 1) ** 2, 3))
    harmonics[:, 0] = rng.normal(0, 1, (count, 3))
    return Splats(
        places.astype(np.float32),
        np.exp(rng.normal(np.log(0.04), 0.7, (count, 3))).astype(np.float32),
        (turns / np.linalg.norm(turns, axis=1)[:, None]).astype(np.float32),
        rng.uniform(0.05, 0.99, count).astype(np.float32),
        harmonics.astype(np.float32),
    )


def rotation_matrices(turns: np.ndarray) -> np.ndarray:
    """By the sandwich product q·e·q*, (splats, 3, 3), one column for each axis."""

    def product(p, q):
        w = p[..., 0] * q[..., 0] - (p[..., 1:] * q[..., 1:]).sum(-1)
        v = p[..., :1] * q[..., 1:] + q[..., :1] * p[..., 1:] + np.cross(p[..., 1:], q[..., 1:])
        return np.concatenate([w[..., None], v], axis=-1)

    back = turns * [1, -1, -1, -1]
    axes = [product(product(turns, np.broadcast_to([0, *axis], turns.shape)), back)[..., 1:] for axis in np.eye(3)]
    return np.stack(axes, axis=-1)


def spheres(balls: list[tuple[tuple[float, float, float], float]], count: int) -> Splats:
    """Flat opaque splats on balls, evenly spread (a Fibonacci lattice): red, green, blue."""
    places, turns, colours, sizes = [], [], [], []
    n = np.arange(count) + 0.5
    z, angle = 1 - 2 * n / count, np.pi * (1 + 5**0.5) * n
    normal = np.stack([np.sqrt(1 - z * z) * np.cos(angle), np.sqrt(1 - z * z) * np.sin(angle), z], axis=1)
    turn = np.stack([1 + z, -normal[:, 1], normal[:, 0], 0 * z], axis=1)  # from z to the normal
    turn /= np.linalg.norm(turn, axis=1)[:, None]
    for number, (middle, radius) in enumerate(balls):
        places.append(np.array(middle) + radius * normal)
        turns.append(turn)
        colours.append(np.broadcast_to(np.eye(3)[number % 3], (count, 3)))
        spacing = radius * (4 * np.pi / count) ** 0.5
        sizes.append(np.broadcast_to([0.6 * spacing, 0.6 * spacing, 1e-5], (count, 3)))
    rest = (np.concatenate(places), np.concatenate(sizes), np.concatenate(turns))
    return Splats(
        *(each.astype(np.float32) for each in rest),
        np.full(count * len(balls), 0.95, np.float32),
        ((np.concatenate(colours)[:, None] - 0.5) * 2 * WHITE).astype(np.float32),
    )
