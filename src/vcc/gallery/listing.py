"""The list of cameras; each module is loaded on demand."""

from __future__ import annotations

import difflib
import importlib

from vcc.base.errors import InputError
from vcc.gallery.entry import Entry

ENTRIES = (
    "conventional",
    "real-lens",
    "heterodyne",
    "coded-aperture-refocusing",
    "coded-aperture-depth",
    "coded-aperture-real-lens",
    "learned-aperture",
    "good-apertures",
    "light-field-rendering",
    "plenoptic",
    "compressive-light-field",
    "angle-sensitive-pixels",
    "integral-lens-prism",
    "biprism-stereo",
    "dual-pixel",
    "wavefront-coding",
    "diffuser-depth-of-field",
    "diffusercam",
    "focal-sweep",
    "coded-exposure",
    "cassi",
    "tensor-display",
)
"""Names, in the gallery's order. ``a-name`` is the module ``vcc.gallery.a_name``, which defines an ``ENTRY``."""


def entry(name: str) -> Entry:
    """The camera of this name.

    Raises:
        InputError: there is none.
    """
    if name not in ENTRIES:
        near = difflib.get_close_matches(name, ENTRIES, n=1)
        hint = f'Did you mean "{near[0]}"? ' if near else ""
        raise InputError(f'the gallery has no camera "{name}". {hint}It has {", ".join(ENTRIES)}')
    module = importlib.import_module(f"vcc.gallery.{name.replace('-', '_')}")
    found: Entry = module.ENTRY
    return found


def entries() -> list[Entry]:
    """All cameras."""
    return [entry(name) for name in ENTRIES]
