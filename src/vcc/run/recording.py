"""Names that moved: recordings to `vcc.recording`, the rest to `vcc.run.demosaic` and `vcc.run.expose`."""

from vcc.recording import Recording, expose_image
from vcc.run.demosaic import Demosaicing, demosaic
from vcc.run.expose import electronics_of

__all__ = ["Demosaicing", "Recording", "demosaic", "electronics_of", "expose_image"]
