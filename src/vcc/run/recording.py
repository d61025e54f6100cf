"""Names that moved: recordings to `vcc.recording`, the rest to `vcc.run.demosaic` and `vcc.run.expose`."""

from vcc.recording import Recording as Recording
from vcc.recording import expose_image as expose_image
from vcc.run.demosaic import Demosaicing as Demosaicing
from vcc.run.demosaic import demosaic as demosaic
from vcc.run.expose import electronics_of as electronics_of
