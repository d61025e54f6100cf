"""The page of an entry: pictures, and a table of what was measured beside what was claimed."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from pathlib import Path

import numpy as np

from vcc.demo.figures import write_figure
from vcc.demo.page import Panel, Section, write_page
from vcc.errors import InputError
from vcc.formats.atomic import atomic_path
from vcc.gallery.entry import Entry, Finding, Picture, Result

VERDICTS = {True: "reached", False: "not reached", None: "–"}


def write_entry(entry: Entry, result: Result, folder: Path) -> Path:
    """Write an entry's pictures and its page ``index.html``.

    Args:
        entry: whose run it was.
        result: what came of it.
        folder: where to write; made if missing.

    Returns:
        The page.

    Raises:
        InputError: the folder cannot be made.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"the gallery cannot write to {folder}: {error.strerror or error}") from error
    rows = [[_written(picture, folder) for picture in row] for row in result.pictures]
    introduction = f"<p><i>{escape(entry.citation)}</i></p><p>{escape(entry.claim)}</p>"
    if result.assumed:
        introduction += f"<p>{escape(result.assumed)}.</p>"
    sections = [
        Section("Measured in this run", numbers_table(result.numbers)),
        Section("How", result.text, rows),
    ]
    page = folder / "index.html"
    write_page(page, entry.title, introduction, sections)
    return page


def numbers_table(numbers: Sequence[Finding]) -> str:
    """The numbers as an HTML table."""
    rows = "\n".join(
        f"<tr><td>{escape(number.what)}</td><td>{escape(number.claim) or '–'}</td>"
        f"<td>{escape(number.measured)}</td>"
        f"<td>{VERDICTS[number.reached]}</td><td class=note>{escape(number.why)}</td></tr>"
        for number in numbers
    )
    return (
        '<div class="wide"><table><thead><tr><th></th><th>claim</th><th>measured</th><th></th><th></th></tr>'
        "</thead>"
        f"<tbody>{rows}</tbody></table></div>"
    )


def _written(picture: Picture, folder: Path) -> Panel:
    path = folder / f"{picture.name}.png"
    if isinstance(picture.content, np.ndarray):
        from imagecodecs import png_encode

        codes = np.ascontiguousarray(np.rint(255 * np.clip(picture.content, 0, 1)).astype(np.uint8))
        with atomic_path(path) as temporary:
            temporary.write_bytes(png_encode(codes))
    else:
        write_figure(picture.content, path)
    return Panel(path.name, picture.title, picture.caption)
