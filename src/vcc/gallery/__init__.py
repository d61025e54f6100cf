"""Published computational cameras, each rebuilt from the optics to the decoded result and compared with its claim.

``entry("biprism-stereo").run()`` runs one of them on the built-in scene, or on a light field of your own.
`write_entry` writes a page of the result, `write_entry_markdown` one for a site. Each camera is a module;
`ENTRIES` lists them.
"""

from vcc.gallery.entry import Entry, Finding, Picture, Result
from vcc.gallery.listing import ENTRIES, entries, entry
from vcc.gallery.page import write_entry, write_entry_markdown

__all__ = [
    "ENTRIES",
    "Entry",
    "Finding",
    "Picture",
    "Result",
    "entries",
    "entry",
    "write_entry",
    "write_entry_markdown",
]
