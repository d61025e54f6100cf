"""The demo's page: plain HTML, its pictures beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vcc.demo.report import Timing, duration, speed_up
from vcc.files.atomic import atomic_path


@dataclass(frozen=True)
class Panel:
    """A picture on the page.

    Args:
        file: name in the page's folder.
        title: in bold.
        caption: HTML.
    """

    file: str
    title: str
    caption: str


@dataclass(frozen=True)
class Section:
    """A part of the page.

    Args:
        title: its heading.
        text: HTML below it.
        panels: rows of pictures.
        after: HTML below the pictures.
    """

    title: str
    text: str
    panels: Sequence[Sequence[Panel]] = ()
    after: str = ""


def write_page(path: Path, title: str, introduction: str, sections: Sequence[Section]) -> None:
    """Write the page, whole or not at all.

    Args:
        path: of the HTML file.
        title: in plain text.
        introduction: HTML.
        sections: in order.
    """
    body = "\n".join(_section(section) for section in sections)
    page = _PAGE.format(title=title, style=_STYLE, introduction=introduction, body=body)
    with atomic_path(path) as temporary:
        temporary.write_text(page, encoding="utf-8")


def timings_table(timings: Sequence[Timing]) -> str:
    """The timings as an HTML table, next to the paper's 8 minutes."""
    rows = "\n".join(
        f"<tr><td>{timing.step}</td><td>{duration(timing.first)}</td><td>{duration(timing.again)}</td>"
        f"<td>{speed_up(timing)}</td><td class=note>{timing.note}</td></tr>"
        for timing in timings
    )
    return (
        '<div class="wide"><table><thead><tr><th>step</th><th>first</th><th>again</th>'
        f"<th>faster than the paper’s 8 min</th><th></th></tr></thead><tbody>{rows}</tbody></table></div>"
    )


def psnr_table(psnr: dict[str, float], comments: dict[str, str]) -> str:
    """Decibels by interpolation as an HTML table."""
    rows = "".join(
        f"<tr><td>{name}</td><td>{value:.1f} dB</td><td class=note>{comments.get(name, '')}</td></tr>"
        for name, value in psnr.items()
    )
    return (
        f"<table><thead><tr><th>interpolation</th><th>PSNR</th><th></th></tr></thead><tbody>{rows}</tbody></table>"
    )


def _section(section: Section) -> str:
    rows = "\n".join(_row(panels) for panels in section.panels)
    return f"<section><h2>{section.title}</h2>\n{section.text}\n{rows}\n{section.after}</section>"


def _row(panels: Sequence[Panel]) -> str:
    figures = "\n".join(
        f'<figure><a href="{panel.file}"><img src="{panel.file}" alt="{panel.title}" loading="lazy"></a>'
        f"<figcaption><b>{panel.title}.</b> {panel.caption}</figcaption></figure>"
        for panel in panels
    )
    return f'<div class="row n{len(panels)}">{figures}</div>'


_PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<main>
<h1>{title}</h1>
{introduction}
{body}
</main>
</body>
</html>
"""

_STYLE = """
:root { color-scheme: light dark; --ink: #222; --quiet: #666; --paper: #fbfaf8; --line: #ddd; }
@media (prefers-color-scheme: dark) {
  :root { --ink: #ddd; --quiet: #999; --paper: #1b1b1d; --line: #3a3a3d; }
}
body { margin: 0; background: var(--paper); color: var(--ink); font: 17px/1.55 Georgia, "Times New Roman", serif; }
main { max-width: 1080px; margin: 0 auto; padding: 2.5rem 1.25rem 4rem; }
h1 { font-size: 2.1rem; line-height: 1.2; margin: 0 0 1rem; font-weight: normal; }
h2 { font-size: 1.4rem; margin: 3.2rem 0 .6rem; padding-top: 1rem; border-top: 1px solid var(--line);
     font-weight: normal; }
p { max-width: 46em; margin: .6em 0; }
.formula { text-align: center; font-style: italic; margin: 1em 0; max-width: none; }
.formula sub, .formula sup { font-size: .72em; }
.row { display: grid; gap: 1.1rem; margin: 1.2rem 0; }
.n2 { grid-template-columns: repeat(2, 1fr); } .n3 { grid-template-columns: repeat(3, 1fr); }
.n4 { grid-template-columns: repeat(4, 1fr); }
@media (max-width: 720px) { .n2, .n3, .n4 { grid-template-columns: 1fr 1fr; } }
figure { margin: 0; }
img { width: 100%; height: auto; display: block; border-radius: 3px; background: #fff; }
.n1 img { width: auto; max-width: 100%; margin: 0 auto; }
.n1 figcaption { max-width: 50em; margin: .45rem auto 0; }
figcaption { font-size: .84rem; line-height: 1.45; color: var(--quiet); margin-top: .45rem; }
figcaption b { color: var(--ink); font-weight: normal; }
table { border-collapse: collapse; font-size: .92rem; margin: 1rem 0; font-variant-numeric: tabular-nums; }
th { text-align: left; font-weight: normal; color: var(--quiet); }
th, td { padding: .3rem 1.1rem .3rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td.note { color: var(--quiet); font-size: .85rem; }
.wide { overflow-x: auto; }
"""
