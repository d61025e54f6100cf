"""Displays of objects at the end of a notebook cell: images, drawings, tables, text.

`exhibit` creates the display of an object, on request of `vcc.base.showing.Shown`. One display has at most
`vcc.notebook.pictures.MOST_BYTES` of PNG and `vcc.notebook.html.LONGEST` characters, to limit the size of
notebook files: HTML and its PNG take at most 1.4 MB together, and mostly 0.2 to 0.3 MB.
"""

from vcc.notebook.exhibits import exhibit as exhibit
