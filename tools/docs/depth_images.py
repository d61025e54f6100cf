"""Draw the pictures of docs/depth.md and print the figures of the page: python tools/docs/depth_images.py."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from panels import DOCS, framed, new_figure

import vcc
from vcc.files.transfer import from_linear
from vcc.plot import style
from vcc.recover.defocus_depth import defocus_kernels, depth_from_defocus
from vcc.recover.depth import depth_by_plane_sweep, depth_by_structure_tensor, disparity_error
from vcc.recover.stereo import depth_by_biprism
from vcc.sources import CameraArray, PlanesScene, TexturedPlane
from vcc.sources.textures import Picture
from vcc.units import deg, mm, um

HERE = DOCS / "images" / "depth"
METRES: dict[str, Any] = {"cmap": "viridis_r"}
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
    tensor, sweep = maps
    figure = new_figure(10.6, 5)
    axes = figure.subplots(2, 3)
    framed(axes[0, 0], from_linear(views[3, 3]), "middle view", cmap="gray")
    framed(axes[0, 1], sweep.confidence, "confidence of the sweep: white is 1", cmap="gray", vmin=0, vmax=1)
    framed(axes[0, 2], tensor.confidence, "confidence of the tensor: white is 1", cmap="gray", vmin=0, vmax=1)
    below = [("true", nearest), ("plane sweep", sweep.distance), ("structure tensor", tensor.distance)]
    for place, (name, distance) in zip(axes[1], below, strict=True):
        shown = framed(place, distance, f"distance, {name}", **METRES, vmin=1, vmax=2.6)
    figure.colorbar(shown, ax=axes, label="distance [m]", shrink=0.46, anchor=(0, 0.02))
    figure.savefig(path)


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
    figure = new_figure(10.6, 4.6)
    axes = figure.subplots(2, 3)
    picture = values[::-1, ::-1] / values.max()
    framed(axes[0, 0], picture, "recording, upright", cmap="gray", vmin=0, vmax=1)
    _draw_kernels(axes[0, 1], kernels, candidates)
    place = _upright_extent(found.rows, found.columns, picture.shape)
    framed(axes[0, 2], found.confidence[::-1, ::-1], "confidence: white is 1", cmap="gray", vmax=1, extent=place)
    truth = np.repeat([[1.4, 1.1, 0.9]], 2, axis=0)
    below = [
        ("true distance", truth, (0, 260, 144, 0)),
        ("blocks by themselves", found.distance[::-1, ::-1], place),
    ]
    below += [("smoothed", found.smoothed().distance[::-1, ::-1], place)]
    for where, (name, distance, extent) in zip(axes[1], below, strict=True):
        shown = framed(where, distance, name, **METRES, vmin=0.8, vmax=1.7, extent=extent)
    for where in (axes[0, 0], axes[0, 2], *axes[1]):
        _same_place(where, picture.shape)
    figure.colorbar(shown, ax=axes, label="distance [m]", shrink=0.46, anchor=(0, 0.02))
    figure.savefig(path)


def _draw_kernels(axes: Axes, kernels: Sequence[np.ndarray], distances: Sequence[float]) -> None:
    """What a point makes at each distance, three in a row, each as bright as it gets."""
    side = max(kernel.shape[0] for kernel in kernels) + 4
    sheet = np.zeros((2 * side + 12, round((2 * side + 12) * 260 / 144)))
    for n, (kernel, distance) in enumerate(zip(kernels, distances, strict=True)):
        top, left = n // 3 * (side + 6), round((n % 3 + 0.5) * sheet.shape[1] / 3 - side / 2)
        size = kernel.shape[0]
        start = (side - size) // 2
        sheet[top + start : top + start + size, left + start : left + start + size] = kernel / kernel.max()
        axes.text(left + side / 2, top + side + 1, f"{distance:g} m", color="white", ha="center", va="center")
    framed(axes, sheet, "the kernels of six distances", cmap="gray")


def _upright_extent(rows: np.ndarray, columns: np.ndarray, shape: tuple[int, ...]) -> tuple[float, ...]:
    """Where blocks lie in the picture once it is turned upright: left, right, bottom, top, pixels."""
    (top, bottom), (left, right) = (
        (count - 1 - places[-1] - step / 2, count - 1 - places[0] + step / 2)
        for places, count in ((rows, shape[0]), (columns, shape[1]))
        for step in (places[1] - places[0],)
    )
    return left, right, bottom, top


def _same_place(axes: Axes, shape: tuple[int, ...]) -> None:
    """Show just the picture's area, so that maps stand where their blocks are; grey where there are none."""
    axes.set(xlim=(-0.5, shape[1] - 0.5), ylim=(shape[0] - 0.5, -0.5), facecolor=style.NOTHING)


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
    picture = image.upright().to_numpy()[..., 0]
    figure = new_figure(8.4, 4.2)
    above, below = figure.subplots(2, 1)
    framed(above, picture / picture.max(), "recording, upright: two half pictures of one scene", cmap="gray")
    place = _upright_extent(found.rows, found.columns, picture.shape)
    title = "distance of blocks of the left half picture, where they are; grey: none"
    shown = framed(below, found_distance[::-1, ::-1], title, **METRES, vmin=0.5, vmax=1.7, extent=place)
    for axes in (above, below):
        _same_place(axes, picture.shape)
    figure.colorbar(shown, ax=[above, below], label="distance [m]", shrink=0.8)
    figure.savefig(path)


if __name__ == "__main__":
    main()
