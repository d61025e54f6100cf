"""Light fields on disk: a Zarr v3 group that is written view by view and read in pieces (docs/store.md)."""

from vcc.store.compression import Lossless, Lossy
from vcc.store.converting import convert
from vcc.store.reading import StoredLightField, is_store, open_store
from vcc.store.writing import StoreWriter, create_store, save_store

__all__ = [
    "Lossless",
    "Lossy",
    "StoreWriter",
    "StoredLightField",
    "convert",
    "create_store",
    "is_store",
    "open_store",
    "save_store",
]
