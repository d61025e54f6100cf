"""Draw the pictures of docs/sources.md: python tools/docs/sources_images.py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import panels
from numpy.typing import NDArray

from vcc.files.transfer import encode
from vcc.sources import CameraArray, DepthMapScene, Lighting, OpenGLRenderer, PlanesScene, TexturedPlane
from vcc.sources.textures import Painting, Picture, Waves
from vcc.units import deg, mm

HERE = panels.DOCS / "images" / "sources"
PIXELS = (240, 320)


def main(folder: Path = HERE) -> None:
    """Draw all of them into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    cameras = CameraArray.over_aperture(60 * mm, 40 * deg, views=(5, 5), pixels=PIXELS, focus_distance=1.3)
    draw_views(planes(), cameras, 140, (128, 225), folder / "planes.png")
    draw_views(meshes(), cameras, 165, (94, 203), folder / "opengl.png")
    draw_depth(folder / "depth-map.png", cameras)


def planes() -> PlanesScene:
    """A table, a leaning chart and a wall."""
    board = np.kron(np.indices((16, 16)).sum(0) % 2, np.ones((8, 8)))
    wood = np.stack([0.25 + 0.5 * board, 0.2 + 0.35 * board, 0.15 + 0.2 * board], axis=-1)
    return PlanesScene(
        [
            TexturedPlane(Picture(wood, 2.4), 1.9, middle=(0, 0.3), pitch=88 * deg),
            TexturedPlane(chart, 1.2, width=0.4, middle=(-0.12, 0.02), yaw=35 * deg),
            TexturedPlane(chart, 1.7, width=0.4, middle=(0.28, 0.05), yaw=-30 * deg, pitch=12 * deg),
            TexturedPlane(Waves(0.12, seed=3, contrast=0.6), 3.2),
        ]
    )


def chart(x: NDArray[Any], y: NDArray[Any]) -> NDArray[Any]:
    """A sheet with a star."""
    painting = Painting(x, y)
    painting.rectangle((-0.2, -0.2, 0.2, 0.2), (0.85, 0.85, 0.8), 0.002)
    painting.star((0.0, 0.02), 0.13, 18, (0.1, 0.12, 0.3), 0.002)
    painting.text("TILT", (-0.16, -0.18), 0.008, (0.7, 0.1, 0.1))
    return painting.values


def meshes() -> OpenGLRenderer:
    """A table with a ball, a ring and a box, made here."""
    import trimesh
    from PIL import Image

    def placed(mesh: Any, place: tuple[float, float, float], colour: tuple[int, int, int]) -> Any:
        mesh.apply_translation(place)
        mesh.visual.face_colors = (*colour, 255)
        return mesh

    ball = trimesh.creation.uv_sphere(0.13, count=[48, 96])
    x, y, z = ball.vertices.T
    stripes = np.indices((64, 64)).sum(0) // 8 % 2 * 150 + 90
    ball.visual = trimesh.visual.TextureVisuals(
        uv=np.stack([4 * np.arctan2(y, x) / np.pi, 3 * np.arccos(z / 0.13) / np.pi], axis=-1),
        image=Image.fromarray(np.stack([stripes, stripes * 0.8, stripes * 0.4], axis=-1).astype(np.uint8)),
    )
    ball.apply_transform(trimesh.transformations.rotation_matrix(1.2, (1, 0.3, 0)))
    ball.apply_translation((-0.18, -0.12, -1.15))
    ring = trimesh.creation.torus(0.13, 0.045, major_sections=96, minor_sections=48)
    ring.apply_transform(trimesh.transformations.rotation_matrix(1.1, (1, 0.4, 0)))
    box = trimesh.creation.box((0.2, 0.3, 0.2))
    box.apply_transform(trimesh.transformations.rotation_matrix(0.6, (0, 1, 0)))
    table = trimesh.creation.box((3, 0.04, 2.4))
    return OpenGLRenderer(
        [
            ball,
            placed(ring, (0.16, -0.08, -1.45), (90, 140, 220)),
            placed(box, (-0.05, -0.12, -1.95), (200, 90, 80)),
            placed(table, (0, -0.29, -1.9), (150, 160, 130)),
        ],
        lighting=Lighting(),
        background=(0.3, 0.4, 0.55),
        supersampling=2,
    )


def draw_views(renderer: Any, cameras: CameraArray, line: int, guides: tuple[float, ...], path: Path) -> None:
    """The outer views of a row, and how one line of pixels looks in all of them: slopes are distances."""
    rows, columns = cameras.views
    views = [encode(renderer.render(cameras.camera(rows // 2, column)), 8) for column in range(columns)]
    figure = panels.new_figure(10.8, 5.2)
    grid = figure.add_gridspec(2, 2, height_ratios=(3.6, 1))
    places = [figure.add_subplot(place) for place in (grid[0, 0], grid[0, 1], grid[1, :])]
    panels.parallax(places, np.stack(views), line, guides)
    figure.savefig(path)


def draw_depth(path: Path, cameras: CameraArray) -> None:
    """The middle view and its depth, the view in a corner made of them, the true one, and what was made up."""
    truth = planes()
    middle = CameraArray((1, 1), PIXELS, 1 * mm, cameras.slopes_per_pixel).camera(0, 0)
    picture = truth.render(middle)
    rows, columns = PIXELS
    s = -(middle.left + (np.arange(columns) + 0.5) / columns * (middle.right - middle.left))[None, :]
    t = -(middle.top + (np.arange(rows) + 0.5) / rows * (middle.bottom - middle.top))[:, None]
    zero = np.zeros(())
    depth = np.full(PIXELS, np.inf)
    for plane in truth.planes:
        distance, seen = plane.along(zero, zero, s, t)
        depth = np.where(seen[..., 3] > 0.5, np.minimum(depth, distance), depth)
    scene = DepthMapScene.for_cameras(picture, depth, cameras)
    corner = cameras.camera(0, 0)
    shown = [
        (encode(picture, 8), "the picture"),
        (1 / depth, "its depth (1/Z)"),
        (encode(scene.render(corner), 8), "the view in the corner, made of these"),
        (encode(truth.render(corner), 8), "the true one"),
        (scene.uncovered(corner), "what was made up"),
    ]
    figure = panels.new_figure(10.8, 5.6)
    for axes, entry in zip(figure.subplots(2, 3).flat, [*shown[:2], None, *shown[2:]], strict=True):
        if entry is None:
            axes.set_axis_off()
        else:
            panels.picture(axes, *entry, cmap="gray")
    figure.savefig(path)


if __name__ == "__main__":
    main()
