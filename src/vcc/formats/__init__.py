"""Light fields and pictures in files. `open_light_field` detects the format of a folder or file."""

from vcc.formats.containers import read_container
from vcc.formats.folder_info import FolderInfo
from vcc.formats.ground_truth import GroundTruth, read_ground_truth
from vcc.formats.keeping import keep_geometry
from vcc.formats.lytro_lfp import LytroRaw, read_lytro
from vcc.formats.reading import open_light_field, open_sparse_views, read_geometry
from vcc.formats.sparse import SparseViews
from vcc.formats.unstructured import UnstructuredViews, open_unstructured
from vcc.formats.writing import SavedLightField, save_light_field

__all__ = [
    "FolderInfo",
    "GroundTruth",
    "LytroRaw",
    "SavedLightField",
    "SparseViews",
    "UnstructuredViews",
    "keep_geometry",
    "open_light_field",
    "open_sparse_views",
    "open_unstructured",
    "read_container",
    "read_geometry",
    "read_ground_truth",
    "read_lytro",
    "save_light_field",
]
