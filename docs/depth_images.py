"""Draw the pictures of docs/depth.md: python docs/depth_images.py. Prints the figures that the page states."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
from panels import new_figure

import vcc
from vcc.files.transfer import from_linear
from vcc.recover.defocus_depth import defocus_kernels, depth_from_defocus
from vcc.recover.depth import depth_by_plane_sweep, depth_by_structure_tensor, disparity_error
from vcc.recover.stereo import depth_by_biprism
from vcc.sources import CameraArray, PlanesScene, TexturedPlane
from vcc.sources.textures import Picture
from vcc.units import deg, mm, um

HERE = Path(__file__).parent / "images" / "depth"
CODE = [
    [1, 0, 1, 1, 0, 0, 1],
    [0, 0, 1, 0, 1, 1, 0],
    [1, 1, 0, 1, 1, 0, 1],
    [1, 0, 0, 1, 0, 1, 1],
    [0, 1, 1, 0, 1, 1, 0],
    [1, 1, 0, 0, 1, 0, 1],
    [0, 1, 0, 1, 1, 1, 0],
]


def main(folder: Path = HERE) -> None:
    """Draw all of them into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    from_light_field(folder / "light-field.png")
    from_defocus(folder / "coded-aperture.png")
    from_biprism(folder / "biprism.png")


def natural(seed: int, width: float, size: int = 512) -> Picture:
    """A texture of amplitudes 1/f, as natural pictures have."""
    frequency = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size))
    frequency[0, 0] = np.inf
    noise = np.fft.rfft2(np.random.default_rng(seed).standard_normal((size, size)))
    texture = np.fft.irfft2(noise / frequency, (size, size))
    return Picture(np.clip(0.5 + 0.16 * texture / texture.std(), 0, 1), width)


def from_light_field(path: Path) -> None:
    """Two leaning boards before a wall: the scene, the true disparity, both maps, and a confidence."""
    planes = [
        TexturedPlane(natural(1, 0.5), 1.1, width=0.24, height=0.3, middle=(-0.12, 0.02), yaw=35 * deg),
        TexturedPlane(natural(2, 0.6), 1.4, width=0.3, height=0.36, middle=(0.18, -0.01), yaw=-30 * deg),
        TexturedPlane(natural(3, 2.5), 2.4),
    ]
    scene = PlanesScene(planes)
    cameras = CameraArray((7, 7), (180, 240), 3 * mm, 2.6e-3, 1.5)
    views = np.stack(
        [np.stack([scene.render(cameras.camera(row, column)) for column in range(7)]) for row in range(7)]
    )
    field = vcc.LightField(views, cameras.light_field(views).frame, disparity_range=(-0.35, 0.6))
    s = -2.6e-3 * (np.arange(240) - 119.5)[None, :]
    t = -2.6e-3 * (np.arange(180) - 89.5)[:, None]
    nearest = np.full((180, 240), np.inf)
    for plane in planes:
        distance, shown = plane.along(np.zeros(1), np.zeros(1), s, t)
        nearest = np.minimum(nearest, np.where(shown[..., 3] > 0, distance, np.inf))
    truth = 3 * mm * (1 / nearest - 1 / 1.5) / 2.6e-3
    maps = [depth_by_structure_tensor(field), depth_by_plane_sweep(field)]
    for name, found in zip(("structure tensor", "plane sweep"), maps, strict=True):
        print(name, disparity_error(found.disparity, truth))
    panels = [("middle view", from_linear(views[3, 3]), None)]
    panels += [("true distance, m", nearest, (1, 2.6))]
    for name, found in zip(("structure tensor", "plane sweep"), maps, strict=True):
        panels.append((f"{name}, m", found.distance, (1, 2.6)))
    panels += [("confidence (sweep)", maps[1].confidence, (0, 1))]
    _draw(panels, path)


def from_defocus(path: Path) -> None:
    """Three planes, one recording through a coded aperture, and the distances of its blocks."""
    focus, width, pitch = 2.0, 10 * mm, 20 * um
    behind = 1 / (1 / (50 * mm) - 1 / focus)
    camera = vcc.Camera(
        [vcc.Mask(pattern=np.array(CODE), width=width), vcc.Lens(focal_length=50 * mm)],
        vcc.Sensor(z=behind, shape=(144, 260), pitch=pitch),
    )
    planes = []
    for n, distance in enumerate((1.4, 1.1, 0.9)):
        third = 260 / 3 * pitch / behind * distance
        middle, wide = ((n - 1) * third * 1.5, 2 * third) if n != 1 else (0.0, third)
        texture = natural(n, 512 * pitch / behind * distance)
        planes.append(TexturedPlane(texture, distance, width=wide, height=1, middle=(middle, 0)))
    field = PlanesScene(planes).light_field(
        (28, 28), (176, 292), spacing=width / 28, slope_per_pixel=pitch / behind, focus_distance=focus
    )
    values = camera.capture(field.replaced(field.values[..., :1]), between_views="none").to_numpy()[..., 0]
    values = values / values.mean() + np.random.default_rng(1).normal(0, 0.005, values.shape)
    candidates = [1.6, 1.4, 1.25, 1.1, 1.0, 0.9]
    kernels = defocus_kernels(camera, candidates)
    found = depth_from_defocus(values, kernels, candidates, noise=0.005, step=12)
    panels = [
        ("recording, upright", values[::-1, ::-1] / values.max(), (0, 1)),
        ("the kernels", np.concatenate([k / k.max() for k in kernels], axis=1), (0, 1)),
        ("distance of blocks, m", found.distance[::-1, ::-1], (0.8, 1.7)),
        ("confidence: 1 is white", found.confidence[::-1, ::-1], (0, 1)),
        ("smoothed, m", found.smoothed().distance[::-1, ::-1], (0.8, 1.7)),
    ]
    _draw(panels, path)


def from_biprism(path: Path) -> None:
    """A board before a wall through a biprism, and the distances of blocks."""
    pitch, ahead, behind = 20 * um, 100 * mm, 52.6 * mm
    camera = vcc.Camera(
        [vcc.Biprism(deflection=0.05), vcc.Lens(focal_length=50 * mm, diameter=2 * mm, z=ahead)],
        vcc.Sensor(z=ahead + behind, shape=(121, 540), pitch=pitch),
    )
    # A sample of the textures is two pixels of the sensor.
    near, far = (natural(n, 1024 * pitch / behind * (z + ahead)) for n, z in ((5, 0.7), (6, 1.5)))
    planes = [TexturedPlane(near, 0.7, width=0.2, height=1, middle=(-0.1, 0)), TexturedPlane(far, 1.5)]
    field = PlanesScene(planes).light_field(
        (7, 21), (190, 560), spacing=1.2 * mm, slope_per_pixel=3e-4, focus_distance=1.0
    )
    image = camera.capture(field.replaced(field.values[..., :1]), scene_distance=1.0)
    found = depth_by_biprism(image, camera, (0.5, 3), step=5)
    found_distance = np.where(found.confidence > 0.6, found.distance, np.nan)
    print("biprism", np.nanpercentile(found_distance, (5, 25, 50, 75, 95)))
    values = image.to_numpy()[..., 0]
    panels = [
        ("recording, upright: two half pictures", values[::-1, ::-1] / values.max(), (0, 1)),
        ("distance of blocks of the left one, m", found_distance[::-1, ::-1], (0.5, 1.7)),
    ]
    _draw(panels, path, columns=1)


def _draw(panels: list[Any], path: Path, columns: int = 3) -> None:
    rows = math.ceil(len(panels) / columns)
    figure = new_figure(3.2 * columns if columns > 1 else 6.4, 2.3 * rows)
    for n, (title, values, limits) in enumerate(panels):
        axes = figure.add_subplot(rows, columns, n + 1)
        low, high = limits if limits else (None, None)
        metric = title.endswith(", m")
        shown = axes.imshow(values, vmin=low, vmax=high, cmap="viridis_r" if metric else "gray")
        if metric:
            figure.colorbar(shown, ax=axes, shrink=0.8)
        axes.set_title(title, fontsize=9)
        axes.set(xticks=[], yticks=[])  # the frame stays: a map may be white throughout
    figure.savefig(path)


if __name__ == "__main__":
    main()
