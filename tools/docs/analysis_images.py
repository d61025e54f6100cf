"""Draw the pictures of docs/analysis.md: python tools/docs/analysis_images.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from panels import DOCS, new_figure, picture

import vcc
from vcc.analysis import Refocuser, fft4, plot_spectrum, psf, sampling_advice
from vcc.files.transfer import encode
from vcc.kernels import TopHat
from vcc.patterns import CosineSum
from vcc.plot import plot_phase_space_stages
from vcc.showcase.scene import demo_scene
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves
from vcc.surfaces import Cubic
from vcc.units import mm, um

HERE = DOCS / "images" / "analysis"
CODE = np.array([[1, 0, 1, 1, 0], [0, 1, 1, 0, 1], [1, 1, 0, 1, 0], [0, 0, 0, 1, 1], [1, 0, 0, 0, 1]], float)


def main(folder: Path = HERE) -> None:
    """Draw all of them into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    draw_spectra(folder / "spectrum.png")
    draw_refocused(folder / "refocus.png")
    draw_points(folder / "points.png")
    draw_phase_space(folder / "phase_space.png")
    draw_sampling(folder / "sampling.png")


def draw_spectra(path: Path) -> None:
    """Two planes at the entrance, behind the lens, on the sensor: one row of a u–s plane each."""
    near, far, f = 0.4, 1.2, 50 * mm
    scene = PlanesScene(
        [
            TexturedPlane(Waves(3 * mm, seed=3), near, width=60 * mm, height=1.0, middle=(-30 * mm, 0.0)),
            TexturedPlane(Waves(9 * mm, seed=5), far),
        ]
    )
    field = scene.light_field(
        (1, 48), (1, 128), spacing=0.5 * mm, slope_per_pixel=2e-3, focus_distance=0.6, dtype=np.float32
    )
    spectrum = fft4(field, [None, "hann", None, "hann"])
    behind = spectrum.transformed(vcc.Affine.lens(f))
    on_sensor = behind.transformed(vcc.Affine.propagation(1 / (1 / f - 1 / far)))
    figure = new_figure(10, 3.4)
    titles = ("at the entrance", "behind the lens: sheared along fu", "on the sensor: sheared along fs")
    for axes, stage, title in zip(figure.subplots(1, 3), (spectrum, behind, on_sensor), titles, strict=True):
        plot_spectrum(stage, ("u", "s"), axes=axes)
        axes.set_title(title, fontsize=11)
    figure.savefig(path)


def draw_refocused(path: Path) -> None:
    """The scene of the demo, focused near and far."""
    field = demo_scene().light_field(
        (11, 11), (180, 250), spacing=2 * mm, slope_per_pixel=1.6e-3, focus_distance=1.3, dtype=np.float32
    )
    refocuser = Refocuser(field)
    figure = new_figure(9, 3.6)
    for axes, distance in zip(figure.subplots(1, 2), (0.8, 3.0), strict=True):
        picture(axes, encode(refocuser.at(distance).values, 8), f"focused at {distance:.3g} m")
    figure.savefig(path)


def draw_points(path: Path) -> None:
    """Points at three distances through an open lens, a code, a cubic plate and a diffuser."""
    sensor = vcc.Sensor(z=1 / (1 / (50 * mm) - 1), shape=(81, 81), pitch=8 * um)
    lens = vcc.Lens(focal_length=50 * mm, diameter=10 * mm)
    cameras = {
        "open": [lens],
        "coded aperture": [vcc.Lens(focal_length=50 * mm), vcc.Mask(CODE, width=10 * mm)],
        "cubic plate": [lens, vcc.PhasePlate(Cubic(25.0))],
        "diffuser": [lens, vcc.Diffuser(kernel=TopHat(3e-3))],
    }
    figure = new_figure(8, 5.6)
    grid = figure.subplots(3, len(cameras))
    for column, (name, elements) in enumerate(cameras.items()):
        for row, distance in enumerate((0.7, 1.0, 1.8)):
            spread = psf(vcc.Camera(elements, sensor), distance, shape=(81, 81))
            axes = grid[row, column]
            axes.imshow(np.sqrt(spread.values), cmap="gray")
            axes.set_xticks([])
            axes.set_yticks([])
            if row == 0:
                axes.set_title(name, fontsize=11)
            if column == 0:
                axes.set_ylabel(f"{distance:g} m away", fontsize=11)
    figure.savefig(path)


def draw_phase_space(path: Path) -> None:
    """A row of pixels of the demo's scene on its way through a plenoptic camera of few, large lenslets."""
    field = demo_scene().light_field(
        (1, 40), (180, 250), spacing=0.4 * mm, slope_per_pixel=1.2e-3, focus_distance=1.3, dtype=np.float32
    )
    image = 1 / (1 / (50 * mm) - 1 / 1.3)
    lens = vcc.Lens(focal_length=50 * mm, diameter=16 * mm)
    lenslets = vcc.LensArray(pitch=1 * mm, focal_length=3 * mm, z=image)
    camera = vcc.Camera([lens, lenslets], vcc.Sensor(z=image + 3 * mm, shape=(300, 400), pitch=50 * um))
    plot_phase_space_stages(camera, field, pixel_row=110).savefig(path)


def draw_sampling(path: Path) -> None:
    """A coded camera and a light field of too few views for its nearest and farthest depths."""
    image = 1 / (1 / (50 * mm) - 1)
    code = vcc.Mask(CosineSum(period=0.4 * mm, harmonics=4), width=30 * mm, z=image - 2 * mm, name="code")
    lens = vcc.Lens(focal_length=50 * mm, diameter=20 * mm)
    camera = vcc.Camera([lens, code], vcc.Sensor(z=image, shape=(400, 600), pitch=20 * um))
    field = vcc.LightField.from_views(
        np.broadcast_to(np.uint8(0), (20, 20, 400, 600)), spacing=1 * mm, slope_per_pixel=4e-4
    )
    sampling_advice(camera, field, depths=(0.5, 3.0)).plot().savefig(path)


if __name__ == "__main__":
    main()
