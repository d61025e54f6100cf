"""Triangle meshes from files (glTF, OBJ and PLY, read by trimesh), prepared for OpenGL."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import check_file, expanded, is_file, read_bytes, reading
from vcc.files.transfer import to_linear

MESH_ENDINGS = (".glb", ".gltf", ".obj", ".ply")
"""Supported file extensions."""

_COSINE_OF_CREASE = math.cos(math.radians(30))


@dataclass(frozen=True, eq=False, repr=False)
class Part(Brief):
    """Triangles that share a material, in the array's coordinates."""

    corners: NDArray[np.float32]
    """(3 · triangles, 12): position, normal, texture coordinates (0 to 1, v up), linear colour with opacity."""
    texture: NDArray[np.float16] | None
    """(rows, columns, 4), linear, bottom row first."""
    cutoff: float
    """Opacity below which a fragment is discarded."""
    two_sided: bool


def loaded(meshes: Any) -> tuple[list[str], list[Any]]:
    """Return names and trimesh scenes; the scenes' metadata contain the file extension."""
    with checks.package("reading meshes", "trimesh", "opengl"):
        import trimesh
    given = list(meshes) if isinstance(meshes, list | tuple) else [meshes]
    if not given:
        raise InputError("there are no meshes to draw: give at least one file")
    names, scenes = [], []
    for each in given:
        if isinstance(each, trimesh.Scene):
            scene = each
        elif isinstance(each, trimesh.Trimesh):
            scene = trimesh.Scene(each)
        elif isinstance(each, str | Path):
            scene = _read(Path(each))
        else:
            raise InputError(f"a mesh is a file or an object of trimesh, not {type(each).__name__}")
        if not any(isinstance(part, trimesh.Trimesh) and len(part.faces) for part in scene.geometry.values()):
            raise InputError(f"{each} holds no triangles: point clouds and lines are not drawn")
        scenes.append(scene)
        names.append(Path(each).name if isinstance(each, str | Path) else type(each).__name__)
    return names, scenes


def _read(path: Path) -> Any:
    import trimesh

    path = expanded(path)
    if path.suffix.lower() not in MESH_ENDINGS:
        raise InputError(f'{path} has the ending "{path.suffix}"; meshes are read from {", ".join(MESH_ENDINGS)}')
    check_file(path, "mesh file")
    with reading(path, "a mesh"):
        if path.suffix.lower() == ".obj":
            _check_materials(path)
        scene = trimesh.load_scene(path)
    scene.metadata["ending"] = path.suffix.lower()
    return scene


def _check_materials(path: Path) -> None:
    """Raise for an OBJ with missing material files or pictures: trimesh would silently load it as grey."""
    for library in _named_in(path, "mtllib"):
        if not is_file(library):
            raise InputError(f"{path} names the material file {library.name}, which is not in the same folder")
        for picture in _named_in(library, "map_Kd"):
            if not is_file(picture):
                raise InputError(f"{library} names the picture {picture.name}, and there is no {picture}")


def _text(path: Path) -> str:
    """The text of an OBJ or material file in UTF-8; for other encodings trimesh guesses or needs a package."""
    try:
        return read_bytes(path).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not text in UTF-8 (byte {error.start:,} is 0x{error.object[error.start]:02x}): save it in "
            f'UTF-8, such as by iconv -f latin1 -t utf-8 "{path.name}"'
        ) from None


def _named_in(path: Path, word: str) -> list[Path]:
    lines = _text(path).splitlines()
    rests = [
        line.split(maxsplit=1)[1].strip() for line in lines if line.split()[:1] == [word] and len(line.split()) > 1
    ]
    # options of a map ("-s 1 1 1 wood.png") come before its name
    return [
        path.parent / (rest.split()[-1] if rest.startswith("-") else rest).replace("\\", "/") for rest in rests
    ]


def parts_of(scenes: Sequence[Any], array_from_scene: NDArray[np.float64]) -> list[Part]:
    """The triangles of scenes, one part per mesh, in the array's coordinates."""
    import trimesh

    parts = []
    for scene in scenes:
        linear_colours = scene.metadata.get("ending") in (".glb", ".gltf")
        for node in scene.graph.nodes_geometry:
            placed, name = scene.graph[node]
            mesh = scene.geometry[name]
            if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
                parts.append(_part(mesh, array_from_scene @ placed, linear_colours))
    return parts


def _part(mesh: Any, to_array: NDArray[np.float64], linear_colours: bool) -> Part:
    faces = np.asarray(mesh.faces)
    positions = np.asarray(mesh.vertices) @ to_array[:3, :3].T + to_array[:3, 3]
    if "vertex_normals" in mesh._cache:  # the file states normals
        normals = np.asarray(mesh.vertex_normals) @ np.linalg.inv(to_array[:3, :3])
        normals = (normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30))[faces]
    else:
        normals = _normals_of_corners(positions, faces)
    if np.linalg.det(to_array[:3, :3]) > 0:  # the array's axes are left-handed: usually below 0
        faces, normals = faces[:, ::-1], normals[:, ::-1]
    corner, normals = faces.ravel(), normals.reshape(-1, 3)
    places = np.zeros((len(positions), 2))
    colours, texture, cutoff, two_sided = np.ones((len(positions), 4)), None, 0.5, True
    visual = mesh.visual
    if visual.kind == "texture":
        if visual.uv is not None:
            places = np.asarray(visual.uv, dtype=np.float64)
        colours[:], texture, cutoff, two_sided = _material(visual.material, linear_colours)
    elif visual.kind == "face":
        by_face = _linear(np.asarray(visual.face_colors), linear_colours)
        return Part(
            _interleaved(positions[corner], normals, places[corner], np.repeat(by_face, 3, axis=0)),
            None,
            cutoff,
            two_sided,
        )
    else:
        colours = _linear(np.asarray(visual.vertex_colors), linear_colours)
    return Part(
        _interleaved(positions[corner], normals, places[corner], colours[corner]),
        texture,
        cutoff,
        two_sided,
    )


def _normals_of_corners(positions: NDArray[np.float64], faces: NDArray[Any]) -> NDArray[np.float64]:
    """Normals (triangles, 3, 3) for a surface without normals: smooth, but sharp at creases of 30° and more.

    A corner gets the area-weighted mean normal of the triangles at its position that are within 30° of its own.
    """
    first, second, third = (positions[faces[:, n]] for n in range(3))
    by_area = np.cross(second - first, third - first)
    unit = by_area / np.maximum(np.linalg.norm(by_area, axis=1, keepdims=True), 1e-30)
    # Vertices are duplicated along texture seams: compare positions.
    place = np.unique(positions, axis=0, return_inverse=True)[1].ravel()[faces].ravel()
    order = np.argsort(place, kind="stable")
    counts = np.bincount(place)
    starts = np.cumsum(counts) - counts
    total = np.zeros((len(place), 3))
    for turn in range(int(counts.max())):
        there = order[counts[place[order]] > turn]  # pair each corner with the turn-th corner at its position
        other = order[starts[place[there]] + turn]
        close = np.einsum("ij,ij->i", unit[there // 3], unit[other // 3]) > _COSINE_OF_CREASE
        total[there[close]] += by_area[other[close] // 3]
    total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-30)
    return total.reshape(-1, 3, 3)


def _interleaved(*columns: NDArray[np.float64]) -> NDArray[np.float32]:
    return np.ascontiguousarray(np.concatenate(columns, axis=1), dtype=np.float32)


def _linear(colours: NDArray[Any], already: bool) -> NDArray[np.float64]:
    """Linear colour and opacity, 0 to 1, from 8-bit values."""
    shares = colours.astype(np.float64) / 255
    if not already:
        shares[..., :3] = to_linear(shares[..., :3])
    return shares


def _material(
    material: Any, linear_colours: bool
) -> tuple[NDArray[np.float64], NDArray[np.float16] | None, float, bool]:
    """(colour and opacity, texture, minimum opacity, two-sided) of a trimesh material."""
    pbr = hasattr(material, "baseColorTexture")
    image = material.baseColorTexture if pbr else getattr(material, "image", None)
    colour = np.ones(4)
    if pbr and material.baseColorFactor is not None:
        colour = _linear(np.asarray(material.baseColorFactor), True)  # linear by glTF's definition
    elif not pbr and image is None:
        colour = _linear(np.asarray(material.main_color), linear_colours)
    cutoff, two_sided = 0.5, True
    if pbr:
        two_sided = not linear_colours or bool(material.doubleSided)
        if (material.alphaMode or "OPAQUE") == "OPAQUE":
            cutoff = 0.0
        elif material.alphaMode == "MASK" and material.alphaCutoff is not None:
            cutoff = float(material.alphaCutoff)
    if image is None:
        return colour, None, cutoff, two_sided
    samples = _linear(np.asarray(image.convert("RGBA")), False)
    return colour, samples[::-1].astype(np.float16), cutoff, two_sided
