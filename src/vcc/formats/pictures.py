"""Former module of `vcc.files.pictures`, kept for compatibility."""

from vcc.files.pictures import read_grey as read_grey
from vcc.files.pictures import read_picture as read_picture
