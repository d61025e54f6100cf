"""Light fields from 3D Gaussian splats."""

from vcc.sources.splats.cloud import Splats
from vcc.sources.splats.ply import write_ply
from vcc.sources.splats.reading import read_splats
from vcc.sources.splats.scene import SplatScene

__all__ = ["SplatScene", "Splats", "read_splats", "write_ply"]
