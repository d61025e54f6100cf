"""What things show of themselves at the end of a notebook's cell: pictures, drawings, tables, words.

`exhibit` makes it of a thing; things ask for it by `vcc.base.showing.Shown`. One exhibit takes at most
`vcc.notebook.pictures.MOST_BYTES` of PNG and `vcc.notebook.html.LONGEST` letters, so that a notebook's file stays
small: HTML and the PNG beside it take at most 1.4 MB together, and mostly two or three tenths of one.
"""

from vcc.notebook.exhibits import exhibit as exhibit
