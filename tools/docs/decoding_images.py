"""Draw the pictures of docs/decoding.md: python tools/docs/decoding_images.py."""

from __future__ import annotations

import numpy as np
from matplotlib.patches import Rectangle
from panels import DOCS, epipolar, framed, new_figure, parallax

import vcc
from vcc.base.measures import psnr
from vcc.files.transfer import from_linear
from vcc.gallery.entry import bench_for
from vcc.gallery.heterodyne import designed, recorded
from vcc.plot import style
from vcc.recover.heterodyne import decode_heterodyne, heterodyne_calibration
from vcc.recover.heterodyne_band import band_limited, true_views
from vcc.recover.plenoptic import decode_plenoptic, find_lenslets
from vcc.showcase.scene import demo_scene
from vcc.units import m, mm

HERE = DOCS / "images" / "decoding"
F = 50 * mm


def shown(values: np.ndarray) -> np.ndarray:
    """Linear light as a screen shows it, its brightest hundredth white."""
    return from_linear(np.clip(values / np.quantile(values, 0.99), 0, 1))


def plenoptic() -> None:
    """The demo's scene through a sheet of lenslets, and back."""
    focus, pitch, each, lenslets, stop = 1.3 * m, 0.1 * mm, 7, 200, 20 * mm
    d = 1 / (1 / F - 1 / focus)
    b = pitch * d / stop
    growth = 1 + b / d
    side = each * lenslets
    sensor = vcc.Sensor(z=d + b, shape=(side, side), pitch=pitch * growth / each)
    array = vcc.LensArray(pitch=pitch, focal_length=1 / (1 / b + 1 / d), z=d, layout="hexagonal")
    camera = vcc.Camera([vcc.Lens(focal_length=F, diameter=stop), array], sensor)
    scene = demo_scene().light_field(
        (20, 20), (300, 300), spacing=1 * mm, slope_per_pixel=0.44 / 300, focus_distance=focus
    )
    white = vcc.LightField.from_views(np.ones((4, 4, 8, 8), np.float32), 6 * mm, 0.1, focus)
    raw, flat = camera.capture(scene, samples=64), camera.capture(white, samples=64)
    decoded = decode_plenoptic(raw, find_lenslets(flat), camera=camera, white=flat, views=5)
    print(decoded)
    draw_plenoptic(shown(raw.upright().to_numpy()), shown(decoded.values[2]))


def draw_plenoptic(raw: np.ndarray, views: np.ndarray) -> None:
    """The recording, a piece of it, and the parallax of a row of views, all as screens want them."""
    figure = new_figure(12, 4.7)
    grid = figure.add_gridspec(2, 3, height_ratios=(2.4, 1), width_ratios=(1.2, 1.45, 1.45))
    whole, part = (figure.add_subplot(place) for place in grid[:, 0].subgridspec(2, 1))
    framed(whole, raw, f"raw recording, {raw.shape[1]}×{raw.shape[0]} pixels", interpolation="antialiased")
    top, left, size = len(raw) * 25 // 100, len(raw) * 21 // 100, 100
    whole.add_patch(Rectangle((left, top), size, size, fill=False, ec=style.ORANGE, lw=1.2))
    framed(part, raw[top : top + size, left : left + size], f"the marked piece, {size}×{size} pixels")
    places = (grid[0, 1], grid[0, 2], grid[1, 1:])
    parallax([figure.add_subplot(place) for place in places], views[:, 148:210, :110], 47, (62.5,))
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
    row = np.s_[4, 1:-1]
    draw_heterodyne(image.upright().to_numpy(), decoded.values[row], truth.values[row])


def draw_heterodyne(recording: np.ndarray, decoded: np.ndarray, truth: np.ndarray) -> None:
    """The recording, its spectrum, and the parallax of the inner views of a row; below, that of the true ones."""
    figure = new_figure(12, 5.4)
    grid = figure.add_gridspec(3, 3, height_ratios=(2.2, 1, 1), width_ratios=(1.2, 1.5, 1.5))
    whole, tiles = (figure.add_subplot(place) for place in grid[:, 0].subgridspec(2, 1))
    framed(
        whole,
        shown(recording),
        f"recording, {recording.shape[1]}×{recording.shape[0]} pixels",
        interpolation="antialiased",
    )
    fade = np.multiply.outer(*(np.hanning(n) for n in recording.shape[:2]))
    spectrum = np.abs(np.fft.fftshift(np.fft.fft2(recording.mean(axis=2) * fade)))
    power = np.log10(spectrum / spectrum.max())
    framed(
        tiles,
        power,
        "its spectrum: 9×9 tiles, log scale",
        cmap="inferno",
        vmin=-7.5,
        vmax=0,
        interpolation="antialiased",
    )
    views, true_ones = shown(decoded), shown(truth)
    cut, row, guides = np.s_[:, 58:, :46], 17, (23.5,)
    places = [figure.add_subplot(place) for place in (grid[0, 1], grid[0, 2], grid[1, 1:])]
    parallax(places, views[cut], row, guides, ("view 2 of 9, decoded", "view 8 of 9, decoded"))
    epipolar(figure.add_subplot(grid[2, 1:]), true_ones[cut][:, row], guides, "the same of the true views")
    figure.savefig(HERE / "heterodyne.png")


if __name__ == "__main__":
    heterodyne()
    plenoptic()
