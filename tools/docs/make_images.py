"""Make the pictures that README and docs show, the demo's own and those of the elements.

python tools/docs/make_images.py
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import element_images
import matplotlib.image
import numpy as np
from matplotlib.axes import Axes
from panels import DOCS, new_figure, picture

import vcc
from vcc.demo import run_demo
from vcc.files.pictures import auto_exposure
from vcc.files.transfer import encode
from vcc.plot import style
from vcc.showcase import figures
from vcc.showcase.bench import from_someone
from vcc.showcase.scene import demo_scene
from vcc.units import mm

HERE = DOCS / "images"
DESK = DOCS / "data" / "desk.zarr"
BRIGHTER = 2.5
"""Exposure of the desk's pictures over the demo's own, which keeps its lamps from clipping."""
DRAWN = [
    ("example-2-cosine", "drawn scene: cosine mask near the sensor"),
    ("check-sharp", "drawn scene: pinhole at the lens"),
]
"""Pictures of the demo, each as its page exposes it."""


def main() -> None:
    """Run the demo into a temporary folder and keep what the pages need."""
    HERE.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        demo = Path(folder)
        run_demo(demo)
        draw_demo(demo, HERE / "demo.png")
        for name in ("example-1-phase-space-points", "example-2-coded-camera", "check-close-ups"):
            shutil.copyfile(demo / f"{name}.png", HERE / f"{name}.png")
    draw_sensor(HERE / "sensor.png")
    element_images.main(HERE / "elements")


def draw_demo(drawn: Path, path: Path) -> None:
    """README's first picture: the rendered desk through lens and mask, and pictures in the demo's folder."""
    figure = new_figure(12, 5.9)
    places = list(figure.subplots(2, 3).flat)
    for axes, (title, shown) in zip(places, pictures_of_the_desk(), strict=False):
        picture(axes, shown, title)
    for axes, (name, title) in zip(places[4:], DRAWN, strict=True):
        picture(axes, matplotlib.image.imread(drawn / f"{name}.png")[70:403], title)  # two thirds as high as wide
    figure.savefig(path)


def pictures_of_the_desk() -> Iterator[tuple[str, np.ndarray]]:
    """A view, focused near and far, and the demo's coded mask, all but the last with one exposure."""
    bench = from_someone(DESK, small=False)
    field = bench.light_field
    view = field.view(field.shape[0] // 2, field.shape[1] // 2)
    yield "one of 9×9 views, rendered", figures.shown(view, BRIGHTER)
    exposure = BRIGHTER * bench.exposure(bench.conventional(bench.middle), bench.diameter)
    for name, distance in (("near", bench.near), ("far", bench.far)):
        image = bench.conventional(distance).capture(field, between_views="depth")
        yield f"lens, focused {name}", figures.shown(image, exposure)
    coded = bench.coded().capture(field, between_views="depth")
    yield "coded mask half-way, exposure × 2", figures.shown(coded, 2 * exposure)


def draw_sensor(path: Path) -> None:
    """docs/sensor.md: a photon transfer curve, and the demo's scene through a colour filter, well and ill lit."""
    electronics = vcc.Electronics(color_filter="RGGB")
    figure = new_figure(13, 4.1)
    curve, raw, bright, dark = figure.subplots(1, 4, width_ratios=(1.45, 1, 1, 1))
    _draw_photon_transfer(curve, electronics)

    light_field = demo_scene().light_field(
        (7, 7), (500, 500), spacing=1 * mm, slope_per_pixel=0.0008, focus_distance=1.3
    )
    z = 1 / (1 / 0.050 - 1 / 1.3)
    sensor = vcc.Sensor(z=z, shape=(500, 500), pitch=0.0008 * z, electronics=electronics)
    image = vcc.Camera([vcc.Lens(focal_length=50 * mm, diameter=6 * mm)], sensor).capture(light_field)
    well = vcc.expose_image(image, sensor, "auto", seed=1)
    ill = vcc.expose_image(image, sensor, well.exposure / 60, seed=2)
    place = (slice(252, 316), slice(256, 320))  # the chart's star, and beside it its colours
    mosaic = np.zeros((500, 500, 3), np.float32)
    numbers = well.image().values
    for row, column in np.ndindex(2, 2):
        here = (slice(row, None, 2), slice(column, None, 2))
        mosaic[(*here, electronics.tile[row][column])] = numbers[here]
    white = auto_exposure(well.demosaiced().values)
    pictures = [
        (raw, "what each pixel recorded", mosaic),
        (bright, "demosaiced", well.demosaiced().values),
        (dark, "a sixtieth of the light", ill.demosaiced().values),
    ]
    for axes, title, values in pictures:
        shown = encode(values[::-1, ::-1][place] * white, 8)
        picture(axes, shown, title, style.TITLE, style.INK, interpolation="nearest")
    figure.savefig(path)


def _draw_photon_transfer(axes: Axes, electronics: vcc.Electronics) -> None:
    """Noise against signal, both without their dark part but for the read noise, on logarithmic axes."""
    charges = np.geomspace(1, 1.3 * electronics.saturation, 40)
    sensor = vcc.Sensor(z=0, shape=(256, 256), pitch=5e-6, electronics=replace(electronics, color_filter=None))
    time = 1e-3
    per_light = electronics.electrons_per_joule() * sensor.sensitive_area * time
    signal, noise = [], []
    for n, charge in enumerate(charges):
        light = vcc.Image(np.full(sensor.shape, charge / per_light, np.float32), sensor.frame)
        one, two = (vcc.expose_image(light, sensor, time, seed=2 * n + k).values.astype(float) for k in (0, 1))
        signal.append((one.mean() + two.mean()) / 2 - electronics.black_level)
        noise.append(((one - two).var() / 2) ** 0.5)
    gain, read = electronics.gain, electronics.read_noise
    axes.loglog(gain * charges, (gain**2 * charges) ** 0.5, color=style.BLUE, lw=1.2)
    axes.axhline(((gain * read) ** 2 + 1 / 12) ** 0.5, color=style.GREEN, lw=1.2)
    axes.loglog(signal, noise, "o", ms=4, color=style.INK)
    axes.axvline(gain * electronics.full_well, color=style.ORANGE, lw=1.2)
    axes.text(0.5, 7, "shot noise √(K · signal)", color=style.BLUE, fontsize=style.SMALL)
    axes.text(25, 0.72, "read noise and rounding", color=style.GREEN, fontsize=style.SMALL)
    axes.text(3300, 0.4, "full well", color=style.ORANGE, fontsize=style.SMALL, ha="right")
    axes.set_ylim(0.3, 80)
    axes.set_title("photon transfer curve", fontsize=style.TITLE, color=style.INK)
    style.tidy(axes, "signal, numbers above black", "temporal noise, numbers rms")


if __name__ == "__main__":
    main()
