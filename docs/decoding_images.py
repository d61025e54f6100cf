"""Draw the pictures of docs/decoding.md: python docs/decoding_images.py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from panels import new_figure

import vcc
from vcc.base.measures import psnr
from vcc.files.transfer import from_linear
from vcc.gallery.entry import bench_for
from vcc.gallery.heterodyne import designed, recorded
from vcc.recover.heterodyne import decode_heterodyne, heterodyne_calibration
from vcc.recover.heterodyne_band import band_limited, true_views
from vcc.recover.plenoptic import decode_plenoptic, find_lenslets
from vcc.showcase.scene import demo_scene
from vcc.units import m, mm

HERE = Path(__file__).parent / "images" / "decoding"
F = 50 * mm


def shown(values: np.ndarray) -> np.ndarray:
    """Linear light as a screen shows it, its brightest hundredth white."""
    return from_linear(np.clip(values / np.quantile(values, 0.99), 0, 1))


def panel(axes: Axes, values: np.ndarray, title: str, **options: Any) -> None:
    """A picture with a frame, below its title."""
    axes.imshow(values, **options)
    axes.set_title(title, fontsize=9)
    axes.set(xticks=[], yticks=[])


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
    figure = new_figure(12, 3.2, dpi=80)
    axes = figure.subplots(1, 5)
    cut = slice(300, 370)
    panel(axes[0], shown(raw.values[::-1, ::-1][cut, cut]), "raw recording, 70×70 pixels of it")
    for place, column in zip(axes[1:4], (0, 2, 4), strict=True):
        panel(place, shown(decoded.values[2, column]), f"view (2, {column})")
    row = decoded.shape[2] // 2
    slices = shown(decoded.values[2, :, row])
    panel(axes[4], slices, f"row {row} of views (2, 0) to (2, 4)", aspect="auto", interpolation="nearest")
    figure.savefig(HERE / "plenoptic.png")


def heterodyne() -> None:
    """The demo's scene, low-passed to what 9×9 tiles hold, through the gallery's camera, and back."""
    views, pixels = 16, 320
    scene = demo_scene().light_field(
        (views, views),
        (pixels, pixels),
        spacing=20 * mm / views,
        slope_per_pixel=25 / 52 / pixels,
        focus_distance=1.3 * m,
    )
    camera = designed(bench_for(scene), scene)
    image = recorded(camera, band_limited(scene, camera))
    calibration = heterodyne_calibration(camera, samples=64)
    decoded = decode_heterodyne(image, camera, calibration=calibration, border=0.08)
    truth = true_views(scene, camera, decoded)
    inner = np.s_[1:-1, 1:-1]
    reached = psnr(decoded.values[inner], truth.values[inner], float(truth.values.max()))
    print(f"inner views {reached:.1f} dB")

    figure = new_figure(15, 3.5, dpi=80)
    axes = figure.subplots(1, 5)
    recording = image.upright().to_numpy()
    panel(axes[0], shown(recording), f"recording, {recording.shape[1]}×{recording.shape[0]} pixels")
    fade = np.multiply.outer(*(np.hanning(n) for n in recording.shape[:2]))
    spectrum = np.abs(np.fft.fftshift(np.fft.fft2(recording.mean(axis=2) * fade)))
    power = np.log10(spectrum / spectrum.max())
    panel(axes[1], power, "its spectrum: 9×9 tiles", cmap="inferno", vmin=-7.5, vmax=0)
    for place, column in zip(axes[2:4], (1, 7), strict=True):
        panel(place, shown(decoded.values[4, column]), f"view {column + 1} of 9, decoded")
    panel(axes[4], shown(truth.values[4, 7]), f"view 8 of 9, true; inner views {reached:.1f} dB")
    figure.savefig(HERE / "heterodyne.png")


if __name__ == "__main__":
    heterodyne()
    plenoptic()
