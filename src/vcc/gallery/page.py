"""The page of an entry, as HTML or Markdown: pictures, and measurements with the claims."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path, PurePath

import numpy as np

from vcc.base.errors import InputError
from vcc.files.atomic import atomic_path
from vcc.gallery.entry import Entry, Finding, Picture, Result
from vcc.showcase.figures import write_figure
from vcc.showcase.words import write_page

JPEG_QUALITY = 88
"""Quality of photographs on Markdown pages: below it, noise and fine print begin to suffer."""
PHOTOGRAPHS = 0.5
"""A figure counts as a photograph if its JPEG is smaller than this share of its PNG."""


def write_entry(entry: Entry, result: Result, folder: Path) -> Path:
    """Write an entry's pictures and its page ``index.html``.

    Args:
        entry: the camera.
        result: of its run.
        folder: where to write; created if missing.

    Returns:
        The page.

    Raises:
        InputError: the folder cannot be created.
    """
    folder = _made(folder)
    for row in result.pictures:
        for picture in row:
            _write_png(picture, folder)
    page = folder / "index.html"
    write_page(page, "gallery/page.html", title=entry.title, entry=entry, result=result)
    return page


def write_entry_markdown(
    entry: Entry, result: Result, folder: Path, *, pictures: Path | None = None, note: str = ""
) -> Path:
    """Write an entry's page as Markdown, ``NAME.md``, for a site or a repository.

    Photographs and figures that contain them are JPEG, other figures PNG.

    Args:
        entry: the camera.
        result: of its run.
        folder: where to write the page; created if missing.
        pictures: folder for the pictures, to which the page has relative links; None for ``folder/NAME``.
        note: Markdown at the end of the page, such as how it was made.

    Returns:
        The page.

    Raises:
        InputError: a folder cannot be created.
    """
    folder = _made(folder)
    pictures = _made(folder / entry.name if pictures is None else pictures)
    parts = [f"# {plain(entry.title)}", f"*{plain(entry.citation)}*", plain(entry.claim)]
    if result.assumed:
        parts.append(f"{plain(result.assumed)}.")
    if result.numbers:
        parts += ["## Measured in this run", numbers_markdown(result.numbers)]
    parts += ["## How", result.text]
    parts.append(pictures_markdown(result.pictures, folder, pictures))
    if note:
        parts.append(note)
    page = folder / f"{entry.name}.md"
    with atomic_path(page) as temporary:
        temporary.write_text("\n\n".join(part.strip() for part in parts) + "\n", encoding="utf-8")
    return page


def pictures_markdown(rows: Sequence[Sequence[Picture]], folder: Path, pictures: Path) -> str:
    """Write pictures, and return the Markdown that displays them.

    Args:
        rows: pictures side by side.
        folder: of the page.
        pictures: folder for the pictures, which must exist.
    """
    there = PurePath(os.path.relpath(pictures, folder)).as_posix()
    return "\n\n".join(
        _row_markdown([(picture, _compact(picture, pictures)) for picture in row], there) for row in rows
    )


def numbers_markdown(numbers: Sequence[Finding]) -> str:
    """The numbers as a table in Markdown."""
    lines = ["| what | claim | measured | verdict | why |", "|---|---|---|---|---|"]
    for number in numbers:
        cells = (number.what, number.claim or "–", number.measured, number.verdict, number.why)
        lines.append("| " + " | ".join(plain(cell) for cell in cells) + " |")
    return "\n".join(lines)


def plain(text: str) -> str:
    """Text escaped for Markdown, also between the bars of a table."""
    return re.sub(r"([\\`*_\[\]|])", r"\\\1", escape(" ".join(text.split()), quote=False))


def _made(folder: Path) -> Path:
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the gallery cannot write to {folder}: {error.strerror or error}") from error
    return folder


def _row_markdown(row: Sequence[tuple[Picture, str]], there: str) -> str:
    """Pictures side by side; one below the other if ``div`` is not supported."""
    figures = [
        f"<figure markdown>\n\n![{plain(picture.title)}]({there}/{file})\n\n"
        f"<figcaption><b>{escape(picture.title)}.</b> {picture.caption}</figcaption>\n\n</figure>"
        for picture, file in row
    ]
    return "\n\n".join(['<div class="pictures" markdown>', *figures, "</div>"])


def _compact(picture: Picture, folder: Path) -> str:
    """Write a picture in a compact format for a site; return the name of its file.

    Lines and uniform areas stay sharp as PNG. A picture that is far smaller as JPEG is a photograph, or a
    figure with some.
    """
    from imagecodecs import jpeg8_encode, png_decode

    png = _write_png(picture, folder, level=9)
    share = 1.0 if isinstance(picture.content, np.ndarray) else PHOTOGRAPHS
    codes = np.ascontiguousarray(png_decode(png.read_bytes())[..., :3])
    encoded = jpeg8_encode(codes, level=JPEG_QUALITY, subsampling="444")
    if len(encoded) > share * png.stat().st_size:
        return png.name
    with atomic_path(folder / f"{picture.name}.jpg") as temporary:
        temporary.write_bytes(encoded)
    png.unlink()
    return f"{picture.name}.jpg"


def _write_png(picture: Picture, folder: Path, level: int | None = None) -> Path:
    """Write a picture as PNG; the level of compression applies to arrays only."""
    path = folder / f"{picture.name}.png"
    if not isinstance(picture.content, np.ndarray):
        write_figure(picture.content, path)
        return path
    from imagecodecs import png_encode

    codes = np.rint(255 * np.clip(picture.content, 0, 1)).astype(np.uint8)
    with atomic_path(path) as temporary:
        temporary.write_bytes(png_encode(np.ascontiguousarray(codes), level=level))
    return path
