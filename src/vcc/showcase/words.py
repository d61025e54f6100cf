"""Prose with numbers: Jinja2 templates, and readable lengths and times.

Templates are stored next to the code that uses them, and named from the package's folder:
``gallery/plenoptic.txt``. In them ``{{ length(metres) }}`` and ``{{ away(distance) }}`` are the functions of
this module, and ``{{ number | fmt(".1%") }}`` is Python's ``format``. Values are escaped for HTML.
"""

from __future__ import annotations

import math
import re
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vcc.base.units import mm, short, um
from vcc.files.atomic import atomic_path

if TYPE_CHECKING:
    from jinja2 import Environment

PACKAGE = Path(__file__).parents[1]


def length(metres: float) -> str:
    """A length as readable text, three digits."""
    return short(metres, digits=3).replace("um", "µm")


def away(distance: float) -> str:
    """A distance of the scene as readable text."""
    if math.isinf(distance):
        return "at infinity"
    return f"{distance:.3g} m away" if distance >= 0.1 else f"{length(distance)} away"


def duration(seconds: float | None) -> str:
    """A time as readable text: 35 ms, 1.8 s; a dash for None."""
    if seconds is None:
        return "–"
    if seconds < 0.9995:
        return f"{seconds * 1e3:.2g} ms" if seconds < 0.0995 else f"{seconds * 1e3:.0f} ms"
    return f"{seconds:.1f} s"


def filled(template: str, **values: Any) -> str:
    """A template filled with values, as HTML.

    Args:
        template: its file, named from the package's folder.
        values: for the names in the template; a missing one is an error.
    """
    return _environment().get_template(template).render(**values)


def write_page(path: Path, template: str, **values: Any) -> None:
    """Write a template filled with values, completely or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_text(filled(template, **values), encoding="utf-8")


def paragraphs(template: str, **values: Any) -> str:
    """A template of paragraphs separated by empty lines, as HTML: each in ``<p>`` and on one line."""
    texts = re.split(r"\n\s*\n", filled(template, **values).strip())
    return "\n".join(f"<p>{' '.join(text.split())}</p>" for text in texts)


@lru_cache(maxsize=1)
def _environment() -> Environment:
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(
        loader=FileSystemLoader(PACKAGE),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {"length": length, "away": away, "mm": mm, "um": um}
    environment.filters |= {"fmt": format, "duration": duration}
    return environment
