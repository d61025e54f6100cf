"""The table and the picture of docs/zoo-design.md: python tools/docs/zoo_design_images.py DESIGN STORE.

DESIGN is the folder of ``vcc zoo design``, and STORE that of the ``vcc zoo run`` that it prints. Means are over
scenes and seeds; differences are those of the same scene and seed. The first standard error is over scenes,
of means over seeds; the second one is over seeds, of means over scenes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from vcc import load_camera
from vcc.showcase import figures
from vcc.zoo.bench import LEVELS
from vcc.zoo.report import Report, Score

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "images" / "zoo" / "design.png"
SCENE = "leaves-1"
SHOWN = 1
"""The light level that is drawn: dim."""


def values(report: Report, camera: str, decoder: str) -> np.ndarray:
    """PSNR, (seeds, scenes, levels); names with {} are of a seed."""
    seeds = sum(name.startswith("learned-") for name in report.names("camera"))
    return np.array(
        [
            [report.by_scene(camera.format(n), decoder.format(n), level) for level in range(len(LEVELS))]
            for n in range(seeds)
        ]
    ).transpose(0, 2, 1)


def both(found: np.ndarray, sign: str = "") -> str:
    """A mean, with its standard errors over scenes and over seeds; of (seeds, scenes)."""
    scenes, seeds = Score.of(found.mean(axis=0)), Score.of(found.mean(axis=1))
    return f"{scenes.mean:{sign}.2f} ± {scenes.error:.2f} ± {seeds.error:.2f}"


def main() -> None:
    """Print the table, draw the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("design", type=Path)
    parser.add_argument("store", type=Path)
    asked = parser.parse_args()
    report = Report.of(asked.store, "edof")
    stop, short = report.controls("learned-0")
    cameras = [("learned-{}", "learned code"), ("random-{}", "random code"), (stop, stop), ("open", "open square"),
               (short, short)]  # fmt: skip
    learned = "decoder:decode_{}"
    against = values(report, stop, learned)
    print(f"{len(report.names('scene'))} scenes: {', '.join(report.names('scene'))}")
    print(
        "| camera | light | " + " | ".join(LEVELS) + " | " + " | ".join(f"gain, {name}" for name in LEVELS) + " |"
    )
    print("|---|---|" + "---|" * 2 * len(LEVELS))
    for camera, name in cameras:
        found = values(report, camera, learned)
        cells = [both(found[..., level]) for level in range(len(LEVELS))]
        gains = [
            both((found - against)[..., level], "+") if camera != stop else "" for level in range(len(LEVELS))
        ]
        print(f"| {name} | {report.light(camera.format(0)):.1%} | {' | '.join([*cells, *gains])} |")
    for decoder in report.names("decoder"):
        if not decoder.startswith("decoder:"):
            found = [Score.of(report.by_scene(stop, decoder, level)) for level in range(len(LEVELS))]
            print(f"{stop}, {decoder}: " + ", ".join(each.text(2) for each in found))
    for n in range(len(against)):
        apart = values(report, "learned-{}", learned)[n] - against[n]
        print(f"seed {n}: " + ", ".join(Score.of(apart[:, level]).text(2, "+") for level in range(len(LEVELS))))
    draw(report, asked.design, stop, len(against))


def draw(report: Report, design: Path, stop: str, seeds: int) -> None:
    """Apertures, recordings and decoded pictures of a scene."""
    shown = [*((f"learned-{n}", n) for n in range(seeds)), ("random-0", 0), (stop, 0), ("open", 0)]
    shown = [(camera, n) for camera, n in shown if f"decoder:decode_{n}" in report.decoders(camera)]
    apertures, recorded, decoded = [], [], []
    for camera, seed in shown:
        (one,) = [
            each
            for each in report.found
            if (each.about["camera"], each.about["scene"], each.about["decoder"])
            == (camera, SCENE, f"decoder:decode_{seed}")
        ]
        apertures.append((camera, aperture(design, camera, report.light(camera))))
        recorded.append(("", one.recording))
        decoded.append((f"{one.scores[SHOWN, 0, 0]:.1f} dB", one.picture))
    recorded.append(("truth", one.truth))
    figure = figures.new_figure(2.1 * (len(shown) + 1), 5.2)
    grid = figure.subplots(3, len(shown) + 1)
    labels = ["aperture", "recorded", "decoded"]
    figures.fill(grid, [apertures, recorded, decoded], labels, cmap="gray", vmin=0, vmax=255)
    figures.write_figure(figure, PICTURE)


def aperture(design: Path, camera: str, light: float) -> np.ndarray:
    """The open part of the square, 255, a pixel for 1/280 of its side; it keeps the width of pictures."""
    places = (np.arange(280) + 0.5) / 280 - 0.5
    if (design / f"{camera}.toml").exists():
        cells = load_camera(design / f"{camera}.toml").elements[0].pattern.values
        found = np.kron(cells, np.ones((280 // len(cells),) * 2))
    elif camera == "open":
        found = np.ones((280, 280))
    else:
        found = np.hypot(places, places[:, None]) < np.sqrt(light / np.pi)
    framed = np.full((300, 400), 90.0)
    framed[10:290, 60:340] = 255 * found
    return framed


if __name__ == "__main__":
    main()
