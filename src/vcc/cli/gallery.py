"""``vcc gallery``: published cameras, listed or rebuilt."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from vcc.cli.console import make_folder, progress, show

EPILOG = (
    "Example:  vcc gallery\n\nExample:  vcc gallery wavefront-coding\n\n"
    "Example:  vcc gallery biprism-stereo --light-field views/ -o stereo"
)


def gallery(
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="Of a camera. Without it, all are listed.", show_default=False),
    ] = None,
    light_field: Annotated[
        Path | None,
        typer.Option(
            metavar="LIGHTFIELD",
            help="A light field of your own: a folder of views, a file or a store. Default: the built-in scene.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FOLDER",
            help="Where the page and its pictures go. Default: vcc-gallery/NAME.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Rebuild a published camera, from optics to decoded result, beside what was claimed of it."""
    from vcc.gallery import entries, entry, write_entry

    if name is None:
        for each in entries():
            show(f"{each.name}\n    {each.title}. {each.citation}")
        return
    chosen = entry(name)
    folder = make_folder(Path("vcc-gallery") / name if output is None else output)
    with progress(chosen.title) as advance:
        result = chosen.run(light_field, advance)
    for number in result.numbers:
        claim = f" (claim: {number.claim}; {number.verdict})" if number.claim else ""
        show(f"{number.what}: {number.measured}{claim}")
    show(f"{write_entry(chosen, result, folder)}: written")
