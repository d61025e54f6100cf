"""Stores whose metadata states what is not there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.fuzz import readers, seeds
from tests.fuzz.bombs.bomb import Bomb, changed
from tests.fuzz.seeds import Maker

SAMPLES = "s.zarr/samples/zarr.json"


def _claims(shape: list[int] | None = None, inner: list[int] | None = None, **stated: Any) -> Maker:
    """Metadata of the array of samples changed."""

    def make(folder: Path) -> None:
        seeds.store()(folder)
        tree = json.loads((folder / SAMPLES).read_text())
        if shape:
            view = [1, 1, *shape[2:]]
            tree["shape"], tree["chunk_grid"]["configuration"]["chunk_shape"] = shape, view
            for codec in tree["codecs"]:
                if codec["name"] == "sharding_indexed":
                    codec["configuration"]["chunk_shape"] = inner or view
        (folder / SAMPLES).write_text(json.dumps(tree | stated))

    return make


def _store(make: Maker) -> Bomb:
    return Bomb(make, "s.zarr", readers.store)


def _states(**grid: Any) -> Maker:
    """What a video states of its frames changed."""

    def make(folder: Path) -> None:
        seeds.light_field_video(folder)
        tree = json.loads((folder / VIDEO).read_text())
        tree["attributes"]["light_field_video"]["grid"] |= grid
        (folder / VIDEO).write_text(json.dumps(tree))

    return make


def _with_frame(name: str) -> Maker:
    """A frame of another name."""

    def make(folder: Path) -> None:
        seeds.light_field_video(folder)
        (folder / "v.zarr" / name).mkdir()

    return make


def _video(make: Maker) -> Bomb:
    return Bomb(make, "v.zarr", readers.light_field_video)


def _dataset(name: str, old: str, new: str, seed: Maker = seeds.dataset) -> Bomb:
    """A data set with something else in a file."""
    change = changed(seed, f"pairs/{name}", lambda data: data.replace(old.encode(), new.encode()))
    return Bomb(change, "pairs", readers.dataset)


VIDEO = "v.zarr/zarr.json"
BILLION = [10**5, 10**4, 24, 32, 3]
UPWARDS = {"name": "default", "configuration": {"separator": "/../"}}
LIST = b'{"zarr_format": 3, "node_type": "group", "attributes": [1]}'

BOMBS = {
    "dataset 10^12 shards": _dataset("dataset.json", '"pairs": 3', f'"pairs": {2 * 10**12}'),
    "dataset shape 1e12": _dataset("pairs-000000.tar", "(6, 8, 3), } ", "(1000000000,)}"),
    "dataset zarr 1e12": _dataset("pairs.zarr/sharp/zarr.json", "8,", f"{10**12},", seeds.zarr_dataset),
    "dataset zarr numbers": _dataset("pairs.zarr/gain/zarr.json", "3\n", f"{10**12}\n", seeds.zarr_dataset),
    "zarr shape 1e12": _store(_claims([10**3, 10**3, 10**3, 10**3, 3])),
    "zarr 10^9 views": _store(_claims(BILLION)),
    "zarr 10^9 views, info": Bomb(_claims(BILLION), "s.zarr", readers.info, refused=False),
    "zarr 250000 views": _store(_claims([500, 500, 24, 32, 3])),
    "zarr view 10^12": _store(_claims([3, 3, 10**6, 10**6, 3])),
    "zarr inner 1": _store(_claims([3, 3, 24000, 32000, 3], inner=[1, 1, 1, 1, 1])),
    "zarr codec pickle": _store(_claims(codecs=[{"name": "numcodecs.pickle", "configuration": {}}])),
    "zarr codecs []": _store(_claims(codecs=[])),
    "zarr key ..": _store(_claims(chunk_key_encoding=UPWARDS)),
    "zarr deep json": _store(changed(seeds.store(), "s.zarr/zarr.json", b"[" * 200000)),
    "zarr deep samples": _store(changed(seeds.store(), SAMPLES, b'{"a":' * 200000)),
    "zarr not utf-8": _store(changed(seeds.store(), SAMPLES, b"\xff\xfe\x00")),
    "zarr attributes list": _store(changed(seeds.store(), "s.zarr/zarr.json", LIST)),
    "video shape 1e12": _video(_states(shape=[10**3, 10**3, 10**3, 10**3, 3])),
    "video shape long": _video(_states(shape=[1] * 10**6)),
    "video frame 1e9": _video(_with_frame("999999999_1.0")),
    "video frame 1e200": _video(_with_frame(f"{'9' * 200}_1.0")),
    "video time 1e999": _video(_with_frame("000003_1e999")),
    "video deep json": _video(changed(seeds.light_field_video, VIDEO, b"[" * 200000)),
    "zarr lossy not utf-8": _store(changed(seeds.store("jpegxl"), SAMPLES, b"\xff\xfe\x00")),
}
