"""Light fields and light field videos on disk: Zarr v3 groups, written per view, read in parts (docs/store.md)."""

from vcc.store.compression import Lossless, Lossy
from vcc.store.converting import convert
from vcc.store.reading import StoredLightField, is_store, open_store
from vcc.store.video_reading import StoredVideo, is_video, open_video
from vcc.store.video_writing import VideoWriter, create_video
from vcc.store.writing import StoreWriter, create_store, save_store

__all__ = [
    "Lossless",
    "Lossy",
    "StoreWriter",
    "StoredLightField",
    "StoredVideo",
    "VideoWriter",
    "convert",
    "create_store",
    "create_video",
    "is_store",
    "is_video",
    "open_store",
    "open_video",
    "save_store",
]
