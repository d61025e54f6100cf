"""Displays as HTML for light and dark notebooks, written with a few small functions.

Colours follow the notebook: text inherits its colour, and lines are half transparent. Drawings, which are
dark on white, have a white background of their own. Styles are inline, because some hosts drop style sheets
from outputs.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

from vcc.base.cached import cached

LONGEST = 16_000
"""Characters of text in a display; longer text is truncated with a note."""
MOST_ROWS = 60
"""Rows of a table, likewise."""

_LINE = "1px solid rgba(128,128,128,0.35)"
_QUIET = "opacity:0.7"
_CELL = f"padding:2px 14px 2px 0;text-align:left;vertical-align:top;border:0;border-bottom:{_LINE};background:none"


@dataclass(frozen=True)
class Panel:
    """A picture with its caption.

    Args:
        png: the file.
        width: its preferred width, CSS pixels.
        caption: below it.
        pixelated: whether its pixels appear as squares when magnified.
        paper: whether it is dark and transparent, and needs a white background.
        framed: whether it has a frame, to stand out on a white page.
    """

    png: bytes
    width: int
    caption: str = ""
    pixelated: bool = False
    paper: bool = False
    framed: bool = False


@dataclass(frozen=True)
class Table:
    """Rows of text below a heading for each column."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True, eq=False)
class Exhibit:
    """The display of an object, from top to bottom.

    Args:
        title: the kind of object.
        words: a description in one line.
        panels: side by side, if there is enough space.
        table: of its parameters.
        text: preformatted; lines without an indent are headings.
    """

    title: str
    words: str = ""
    panels: Sequence[Panel] = ()
    table: Table | None = None
    text: str = ""

    @property
    @cached
    def html(self) -> str:
        """The whole display."""
        panels = "".join(_panel(each) for each in self.panels)
        parts = [
            f'<div style="margin-bottom:4px"><b>{_words(self.title)}</b> {_words(self.words)}</div>',
            f'<div style="display:flex;flex-wrap:wrap;gap:4px 16px">{panels}</div>' if panels else "",
            _table(self.table) if self.table is not None else "",
            _text(self.text) if self.text else "",
        ]
        return f'<div style="max-width:860px;overflow-x:auto;padding:2px 0">{"".join(parts)}</div>'

    @property
    def png(self) -> bytes | None:
        """The first picture; None if there is none."""
        return self.panels[0].png if self.panels else None


def _words(text: str) -> str:
    """Escaped text, with units in their usual notation."""
    return escape(text).replace(" um", " µm")


def _panel(panel: Panel) -> str:
    looks = f"width:{panel.width}px;max-width:100%;height:auto;display:block;margin:0"
    if panel.pixelated:
        looks += ";image-rendering:pixelated"
    if panel.paper:
        looks += ";background:#fff;border-radius:4px"
    if panel.framed:
        looks += f";outline:{_LINE}"
    caption = f'<figcaption style="font-size:90%;{_QUIET}">{_words(panel.caption)}</figcaption>'
    source = b64encode(panel.png).decode("ascii")
    image = f'<img alt="{_words(panel.caption)}" style="{looks}" src="data:image/png;base64,{source}"/>'
    return (
        f'<figure style="margin:0 0 4px;max-width:{max(panel.width, 240)}px">'
        f"{image}{caption if panel.caption else ''}</figure>"
    )


def _table(table: Table) -> str:
    headings = _row("th", table.headings, "font-weight:600") if any(table.headings) else ""
    rows = "".join(_row("td", row) for row in table.rows[:MOST_ROWS])
    more = len(table.rows) - MOST_ROWS
    left_out = f'<div style="{_QUIET}">… and {more} more</div>' if more > 0 else ""
    looks = "border-collapse:collapse;margin:4px 0;table-layout:auto;width:auto;font-size:inherit;color:inherit"
    return f'<table style="{looks}">{headings}{rows}</table>{left_out}'


def _row(kind: str, cells: Iterable[str], looks: str = "") -> str:
    made = "".join(f'<{kind} style="{_CELL};{looks}">{_words(cell)}</{kind}>' for cell in cells)
    return f'<tr style="background:none">{made}</tr>'


def _text(text: str) -> str:
    """Preformatted text; lines at the left are bold if the line below is indented."""
    if len(text) > LONGEST:
        text = f"{text[:LONGEST]}\n… and {len(text) - LONGEST} letters more: print() shows them"
    lines = text.split("\n")
    made = []
    for line, below in zip(lines, [*lines[1:], ""], strict=True):
        heading = bool(line) and not line.startswith(" ") and below.startswith(" ")
        made.append(f"<b>{_words(line)}</b>" if heading else _words(line))
    return (
        '<pre style="margin:4px 0;white-space:pre-wrap;background:none;border:0;padding:0;color:inherit;'
        f'line-height:1.4;font-family:ui-monospace,Menlo,Consolas,monospace">{chr(10).join(made)}</pre>'
    )
