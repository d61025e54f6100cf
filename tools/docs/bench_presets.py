"""Make the thumbnails of the bench's presets: ``src/vcc/bench/presets/*.webp``.

python tools/docs/bench_presets.py
"""

from __future__ import annotations

from pathlib import Path

import PIL.Image

from vcc.bench.cameras import SCENE, cameras, scenes
from vcc.bench.picture import take
from vcc.bench.published import Gallery
from vcc.bench.screen import codes, white_of
from vcc.bench.starting import PRESETS
from vcc.files.camera_reading import Beside

FOLDER = Path(__file__).parents[2] / "src" / "vcc" / "bench" / "presets"
SIDE, QUALITY = 150, 72


def main() -> None:
    """Make all of them."""
    fields, gallery = scenes(), Gallery(cameras(SCENE), SCENE)
    FOLDER.mkdir(exist_ok=True)
    for title, (name, *_) in PRESETS.items():
        document = gallery[title]
        train = document.train(Beside(Path(), frozenset())).train
        values = take(train, fields[document.light_field], document).values
        picture = PIL.Image.fromarray(codes(values, white_of(values)))
        picture.thumbnail((SIDE, SIDE), PIL.Image.Resampling.BOX)
        picture.save(FOLDER / f"{name}.webp", quality=QUALITY, method=6)


if __name__ == "__main__":
    main()
