"""Published computational cameras, each rebuilt from its optics to the decoded result, beside its claim.

``entry("biprism-stereo").run()`` takes the built-in scene, or a light field of your own, through one of them;
`write_entry` makes a page of what came of it, `write_entry_markdown` one for a site. One file a camera; `ENTRIES`
lists them.
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
