"""Draw the pictures of docs/decoding.md: python docs/decoding_images.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

import vcc
from vcc.demo.scene import demo_scene
from vcc.formats.transfer import from_linear
from vcc.patterns import CosineSum
from vcc.recover.heterodyne import decode_heterodyne, heterodyne_calibration
from vcc.recover.plenoptic import decode_plenoptic, find_lenslets
from vcc.units import m, mm

HERE = Path(__file__).parent / "images" / "decoding"
F = 50 * mm


def shown(values: np.ndarray) -> np.ndarray:
    """Linear light as a screen shows it, its brightest hundredth white."""
    return from_linear(np.clip(values / np.quantile(values, 0.99), 0, 1))


def save(figure: Figure, name: str) -> None:
    """Without axes, tightly packed."""
    FigureCanvasAgg(figure)
    for axes in figure.axes:
        axes.set_xticks([])
        axes.set_yticks([])
        axes.title.set_fontsize(9)
    figure.savefig(HERE / name, dpi=80)


def _dilated(values: np.ndarray) -> np.ndarray:
    """Points of a spectrum, large enough to be seen."""
    from scipy.ndimage import maximum_filter

    return maximum_filter(values, 3)


def plenoptic() -> None:
    """The demo's scene through a sheet of lenslets, and back."""
    focus, pitch, each, lenslets, stop = 1.3 * m, 0.15 * mm, 7, 130, 9.6 * mm
    d = 1 / (1 / F - 1 / focus)
    b = pitch * d / stop
    growth = 1 + b / d
    side = each * lenslets
    sensor = vcc.Sensor(z=d + b, shape=(side, side), pitch=pitch * growth / each)
    array = vcc.LensArray(pitch=pitch, focal_length=1 / (1 / b + 1 / d), z=d, layout="hexagonal")
    camera = vcc.Camera([vcc.Lens(focal_length=F, diameter=stop), array], sensor)
    scene = demo_scene().light_field(
        (13, 13), (220, 220), spacing=0.8 * mm, slope_per_pixel=1.9e-3, focus_distance=focus
    )
    white = vcc.LightField.from_views(np.ones((4, 4, 8, 8), np.float32), 4 * mm, 0.1, focus)
    raw, flat = camera.capture(scene, samples=64), camera.capture(white, samples=64)
    decoded = decode_plenoptic(raw, find_lenslets(flat), camera=camera, white=flat, views=5)
    figure = Figure(figsize=(12, 3.2), layout="constrained")
    axes = figure.subplots(1, 5)
    cut = slice(300, 370)
    axes[0].imshow(shown(raw.values[::-1, ::-1][cut, cut]))
    axes[0].set_title("raw recording, 70×70 pixels of it")
    for place, column in zip(axes[1:4], (0, 2, 4), strict=True):
        place.imshow(shown(decoded.values[2, column]))
        place.set_title(f"view (2, {column})")
    row = decoded.shape[2] // 2
    axes[4].imshow(shown(decoded.values[2, :, row]), aspect="auto", interpolation="nearest")
    axes[4].set_title(f"row {row} of views (2, 0) to (2, 4)")
    save(figure, "plenoptic.png")


def heterodyne() -> None:
    """A wall in focus behind a pane of glass near by, both within what 5×5 tiles hold."""
    focus, stop, harmonics, tile = 1 * m, 10 * mm, 2, 40
    d = 1 / (1 / F - 1 / focus)
    tiles, size = 2 * harmonics + 1, 8 * mm
    side = tiles * tile
    pixel = size / side
    gamma = 1 / (1 + tiles * pixel / stop)
    period = gamma * tiles * pixel
    stop_sheet = vcc.Mask(pattern=np.ones((1, 1)), width=stop, name="stop")
    mask = vcc.Mask(pattern=CosineSum(period, harmonics=harmonics), z=d * (1 - period / stop), name="carrier")
    camera = vcc.Camera(
        [vcc.Lens(focal_length=F), stop_sheet, mask], vcc.Sensor(z=d, shape=(side, side), pitch=pixel)
    )
    count = 15
    u = (np.arange(count) - (count - 1) / 2) * stop / count
    x = (np.arange(side + 8) - (side + 7) / 2) * pixel
    across, up = x[None, None, None, :], x[None, None, :, None]
    right, down = u[None, :, None, None], u[:, None, None, None]
    turn = 2 * np.pi / size
    wall = np.cos(turn * 9 * across) * np.cos(turn * 7 * up) + np.cos(turn * (4 * across + 11 * up))
    # The pane's cosines go through one period across the stop: one harmonic of the aperture.
    moved, lowered = 5 * turn * across + 2 * np.pi / stop * right, 5 * turn * up + 2 * np.pi / stop * down
    pane = np.cos(moved) + np.cos(lowered + 1) + np.cos(moved + lowered)
    values = (0.5 + 0.07 * wall + 0.07 * pane).astype(np.float32)
    light_field = vcc.LightField.from_views(values, stop / count, pixel / d, focus, disparity_range=(0, 0))
    options = {"interpolation": "cubic", "refine": 4}
    image = camera.capture(light_field, between_views="none", **options)
    calibration = heterodyne_calibration(camera, light_field=light_field, **options)
    decoded = decode_heterodyne(image, camera, calibration=calibration)

    frame = decoded.frame.matrix
    j, i, row, column = np.ogrid[tuple(slice(n) for n in decoded.shape)]
    u2, v2 = frame[0, 0] * i + frame[0, 4], frame[1, 1] * j + frame[1, 4]
    # As `from_views` counts places in a picture: d·(u/focus − s).
    x2 = d * (u2 / focus - frame[2, 0] * i - frame[2, 2] * column - frame[2, 4])
    y2 = d * (v2 / focus - frame[3, 1] * j - frame[3, 3] * row - frame[3, 4])
    wall2 = np.cos(turn * 9 * x2) * np.cos(turn * 7 * y2) + np.cos(turn * (4 * x2 + 11 * y2))
    moved2, lowered2 = 5 * turn * x2 + 2 * np.pi / stop * u2, 5 * turn * y2 + 2 * np.pi / stop * v2
    truth = 0.5 + 0.07 * wall2 + 0.07 * (np.cos(moved2) + np.cos(lowered2 + 1) + np.cos(moved2 + lowered2))
    inner = np.s_[1:-1, 1:-1]
    error = np.sqrt(np.mean((decoded.values[inner] - truth[inner]) ** 2))
    reached = -20 * np.log10(error / truth.max())
    print(f"inner views {reached:.1f} dB")

    figure = Figure(figsize=(12, 3.2), layout="constrained")
    axes = figure.subplots(1, 5)
    axes[0].imshow(image.values[:60, :60], cmap="gray")
    axes[0].set_title("recording, 60×60 pixels of it")
    spectrum = np.abs(np.fft.fftshift(np.fft.fft2(image.values)))
    axes[1].imshow(_dilated(np.log10(spectrum + 1e-4 * spectrum.max())), cmap="magma")
    axes[1].set_title("its spectrum: tiles around 0 and ±1")
    for place, column in zip(axes[2:4], (1, 3), strict=True):
        place.imshow(decoded.values[2, column], cmap="gray", vmin=0, vmax=1)
        place.set_title(f"view (2, {column}), decoded")
    axes[4].imshow(truth[2, 3], cmap="gray", vmin=0, vmax=1)
    axes[4].set_title(f"view (2, 3), true; inner views {reached:.1f} dB")
    save(figure, "heterodyne.png")


if __name__ == "__main__":
    heterodyne()
    plenoptic()
