"""Triangles made by code: what a lathe turns, bent leaves, cloth, tubes and boxes, written as PLY files."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with a place on a texture and a normal for each vertex.

    Args:
        points: (vertices, 3), metres.
        places: (vertices, 2), 0 to 1 on the texture.
        triangles: (triangles, 3) indices of vertices, anticlockwise seen from outside.
        normals: (vertices, 3), of the surface that the triangles stand for.
    """

    points: Array
    places: Array
    triangles: Array
    normals: Array

    def moved(self, matrix: Array) -> Mesh:
        """In another place: a 4×4 matrix that turns, moves and scales alike in all directions."""
        turn = matrix[:3, :3]
        return Mesh(
            self.points @ turn.T + matrix[:3, 3], self.places, self.triangles, _unit(self.normals @ turn.T)
        )

    def write(self, folder: Path) -> Path:
        """A binary PLY file whose name is the hash of what it holds."""
        vertices = np.concatenate([self.points, self.normals, self.places], axis=1).astype("<f4")
        faces = np.empty(len(self.triangles), dtype=[("n", "u1"), ("corners", "<i4", 3)])
        faces["n"], faces["corners"] = 3, self.triangles
        head = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
        head += [f"property float {name}" for name in ("x", "y", "z", "nx", "ny", "nz", "u", "v")]
        head += [f"element face {len(faces)}", "property list uchar int vertex_indices", "end_header"]
        data = "\n".join([*head, ""]).encode() + vertices.tobytes() + faces.tobytes()
        path = folder / f"{hashlib.sha256(data).hexdigest()[:16]}.ply"
        if not path.exists():
            path.write_bytes(data)
        return path


def together(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one."""
    starts = np.cumsum([0, *(len(mesh.points) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.points for mesh in meshes]),
        np.concatenate([mesh.places for mesh in meshes]),
        np.concatenate([mesh.triangles + start for mesh, start in zip(meshes, starts, strict=False)]),
        np.concatenate([mesh.normals for mesh in meshes]),
    )


def sheet(surface: Callable[[Array, Array], Array], rows: int, columns: int) -> Mesh:
    """A surface given by a function of (a, b), each 0 to 1, that returns (..., 3) metres.

    Its outside is where the direction of a, that of b and the normal are as x, y and z are.
    """
    a, b = np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows))
    points = surface(a, b)
    step = 1e-4
    along_a = surface(a + step, b) - surface(a - step, b)
    along_b = surface(a, b + step) - surface(a, b - step)
    normals = _unit(np.cross(along_a, along_b))
    return _grid_of(points, np.stack([a, b], axis=-1), normals)


def turned(profile: ArrayLike, around: int = 96, fineness: int = 12) -> Mesh:
    """What a lathe makes of a profile: (radius, height) from the foot to the top, rounded between by splines.

    A radius of 0 at both ends closes it. A point that is given twice is a sharp edge.
    """
    points = np.asarray(profile, dtype=float)
    sharp = np.nonzero((np.diff(points, axis=0) == 0).all(axis=1))[0] + 1
    pieces = [_rounded(piece, fineness) for piece in np.split(points, sharp)]
    radii, heights = np.concatenate(pieces).T
    out, up = np.concatenate([np.gradient(piece, axis=0) for piece in pieces]).T
    angle = np.linspace(0, 2 * math.pi, around + 1)

    def about_axis(out: Array, up: Array) -> Array:
        parts = np.broadcast_arrays(out[:, None] * np.sin(angle), up[:, None], out[:, None] * np.cos(angle))
        return np.stack(parts, axis=-1)

    along = np.linspace(0, 1, len(radii))[:, None]
    places = np.stack(np.broadcast_arrays(angle / (2 * math.pi), along), axis=-1)
    return _grid_of(about_axis(radii, heights), places, _unit(about_axis(up, -out)))


def _rounded(points: Array, fineness: int) -> Array:
    """Points on Catmull-Rom splines through those given, none left of the axis; two points stay straight."""
    if len(points) < 3:
        return points
    ends = np.concatenate([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    t = np.linspace(0, 1, fineness, endpoint=False)[:, None]
    curve = [
        b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)))
        for a, b, c, d in zip(ends, ends[1:], ends[2:], ends[3:], strict=False)
    ]
    found = np.concatenate([*curve, points[-1:]])
    found[:, 0] = np.maximum(found[:, 0], 0)
    return found


def tube(path: ArrayLike, radius: float, around: int = 10) -> Mesh:
    """A round tube along points in space, open at its ends."""
    points = np.asarray(path, dtype=float)
    ahead = _unit(np.gradient(points, axis=0))
    aside = _unit(np.cross(ahead, (0.12, 0.9, 0.41)))
    other = np.cross(ahead, aside)
    angle = np.linspace(0, 2 * math.pi, around + 1)
    normals = aside[:, None] * np.cos(angle)[:, None] + other[:, None] * np.sin(angle)[:, None]
    along = np.linspace(0, 1, len(points))[:, None]
    places = np.stack(np.broadcast_arrays(angle / (2 * math.pi), along), axis=-1)
    return _grid_of(points[:, None] + radius * normals, places, normals)


def leaf(length: float, width: float, bend: float, fold: float, curl: float = 0.0) -> Mesh:
    """A leaf along +x from its stalk at the origin, its upper side towards +y.

    Args:
        length: metres.
        width: metres, at its widest.
        bend: how far its tip hangs down, as a share of its length.
        fold: how far its halves rise beside the midrib, as a share of their width.
        curl: how much its border waves, metres.
    """

    def surface(a: Array, b: Array) -> Array:
        inside = np.clip(a, 1e-6, 1 - 1e-6)
        half = width / 2 * 2.62 * inside**0.7 * (1 - inside) ** 0.85
        across = 2 * b - 1
        y = fold * half * np.abs(across) ** 1.3 - bend * length * inside**2
        y = y + curl * np.sin(9 * inside + 4 * across) * across**2
        return np.stack([length * a, y, -half * across], axis=-1)

    return sheet(surface, 15, 29)


def box(size: Sequence[float], roundness: float = 0.0) -> Mesh:
    """A box around the origin; its six faces lie side by side on the texture: +x, −x, +y, −y, +z, −z.

    Args:
        size: along x, y and z, metres.
        roundness: of its edges, 0 to 1, as a share of half its size.
    """
    half = np.asarray(size) / 2
    count = 13 if roundness else 2
    faces = []
    for n, turn in enumerate(_FACES):

        def face(a: Array, b: Array, turn: Array = turn) -> Array:
            place = np.stack([2 * a - 1, 2 * b - 1, np.ones_like(a)], axis=-1) @ turn
            core = np.clip(place, roundness - 1, 1 - roundness)
            return (core + roundness * _unit(place - core)) * half

        flat = sheet(face, count, count)
        faces.append(Mesh(flat.points, flat.places * (1 / 6, 1) + (n / 6, 0), flat.triangles, flat.normals))
    return together(faces)


_FACES = [
    np.array(rows)
    for rows in (
        [(0, 0, -1), (0, 1, 0), (1, 0, 0)],
        [(0, 0, 1), (0, 1, 0), (-1, 0, 0)],
        [(1, 0, 0), (0, 0, -1), (0, 1, 0)],
        [(1, 0, 0), (0, 0, 1), (0, -1, 0)],
        [(1, 0, 0), (0, 1, 0), (0, 0, 1)],
        [(-1, 0, 0), (0, 1, 0), (0, 0, -1)],
    )
]
"""Where right, up and outwards of each face point."""


def _grid_of(points: Array, places: Array, normals: Array) -> Mesh:
    """Two triangles between each four neighbours of a grid of points, (rows, columns, 3)."""
    rows, columns = points.shape[:2]
    corner = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).reshape(-1)
    quads = np.stack([corner, corner + 1, corner + columns + 1, corner + columns], axis=1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    return Mesh(points.reshape(-1, 3), places.reshape(-1, 2), triangles, normals.reshape(-1, 3))


def _unit(vectors: Array) -> Array:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))
