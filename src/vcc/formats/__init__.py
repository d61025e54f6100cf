"""Light fields and pictures in files. `open_light_field` finds out which format a folder has."""

from vcc.formats.reading import FolderInfo, open_light_field, read_geometry

__all__ = ["FolderInfo", "open_light_field", "read_geometry"]
