"""Convert the pictures that the programs in this folder draw to WebP: python tools/docs/webp.py.

Run it after any of them. It replaces each PNG and JPEG below docs/images by a WebP file, lossless or lossy,
whichever is smaller, and renames it in the pages. A picture that looks the same as the one stored already is
dropped, so that drawing again does not add to the size of the repository.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from PIL import Image, ImageSequence  # a dependency of Matplotlib

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "images"
QUALITY = 88
SAME = 3.0
"""Root mean square difference, of 255 levels, below which two pictures look the same."""


def main() -> None:
    """Convert all pictures and rename them in README and pages."""
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    texts = {page: page.read_text(encoding="utf-8") for page in pages}
    for drawn in sorted([*PICTURES.rglob("*.png"), *PICTURES.rglob("*.jpg")]):
        stored = drawn.with_suffix(".webp")
        if not (stored.exists() and looks_the_same(drawn, stored)):
            stored.write_bytes(encoded(drawn))
        # Pages are in different folders: folder and name of a picture are enough to identify it.
        old, new = (f"{path.parent.name}/{path.name}" for path in (drawn, stored))
        texts = {page: text.replace(old, new) for page, text in texts.items()}
        drawn.unlink()
    for page, text in texts.items():
        if page.read_text(encoding="utf-8") != text:
            page.write_text(text, encoding="utf-8")


def encoded(path: Path) -> bytes:
    """A picture as WebP, the smaller of lossless and lossy; a JPEG always lossy."""
    with Image.open(path) as picture:
        pixels = picture.convert("RGBA" if "A" in picture.getbands() else "RGB")
    # Matplotlib writes an alpha channel also where all pixels are opaque.
    if pixels.mode == "RGBA" and pixels.getchannel("A").getextrema()[0] == 255:
        pixels = pixels.convert("RGB")
    found = [_webp(pixels, quality=QUALITY)]
    if path.suffix == ".png":
        found.append(_webp(pixels, lossless=True))
    return min(found, key=len)


def looks_the_same(one: Path, other: Path) -> bool:
    """Whether two pictures have the same size and nearly the same pixels."""
    with Image.open(one) as first, Image.open(other) as second:
        if first.size != second.size or sum(1 for _ in ImageSequence.Iterator(second)) > 1:
            return False
        a, b = (np.asarray(picture.convert("RGB"), float) for picture in (first, second))
    return bool(np.sqrt(np.mean((a - b) ** 2)) < SAME)


def _webp(picture: Image.Image, **options: int) -> bytes:
    stream = io.BytesIO()
    picture.save(stream, "WEBP", method=6, **options)
    return stream.getvalue()


if __name__ == "__main__":
    main()
