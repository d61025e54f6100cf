"""Pictures read, where it was before: the face of `vcc.files.pictures`."""

from vcc.files.pictures import read_grey as read_grey
from vcc.files.pictures import read_picture as read_picture
