"""Data sets as a Zarr group, ``pairs.zarr`` in the folder: an array of each kind and of each number, by pair.

Images are in chunks of one pair, numbers in chunks of one shard. The array ``pair`` is written last: a shard is
complete if its chunk is there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.reading import check_file, reading
from vcc.base.workers import uninterrupted
from vcc.dataset.destination import Destination
from vcc.dataset.recording_pairs import Pair
from vcc.files.atomic import refusal
from vcc.store.zarr_chunks import chunk_file, opened_array

GROUP, KEY = "pairs.zarr", "dataset"
LAST = "pair"
"""The number whose chunk is written last."""
LETTERS = 256
"""Bytes of a text among the numbers of a pair: UTF-8, padded with zeros."""
MOST_IN_NUMBER = 4096
"""Most entries of what is called a number of a pair, such as a 5×5 matrix."""
CHECKSUM = 4
"""Bytes that CRC-32C adds to a chunk."""
AXES = {
    "recording": ("y", "x", "channel"),
    "sharp": ("y", "x", "channel"),
    "depth": ("y", "x"),
    "views": ("v", "u", "t", "s", "channel"),
    "psf": ("psf_distance", "psf_y", "psf_x"),
}


@dataclass(frozen=True, eq=False, repr=False)
class ZarrGroup(Destination):
    """A data set in a Zarr group; see `Destination`."""

    kind: ClassVar[str] = "zarr"
    how_to_read: ClassVar[str] = (
        f"{GROUP} is a Zarr group of version 3 with one array per kind and per number: `zarr.open_group(path)` or "
        "`xarray.open_zarr(path, consolidated=False)`; texts are UTF-8, padded with zeros."
    )

    @property
    def group(self) -> Path:
        """The folder of the group."""
        return self.path / GROUP

    def mark(self, shard: int) -> Path:
        """See `Destination`."""
        return self.group / LAST / "c" / str(shard)

    def prepare(self, part: Path, first: Pair) -> None:
        """See `Destination`."""
        import zarr

        def make() -> None:
            group = zarr.create_group(zarr.storage.LocalStore(part / GROUP), attributes={KEY: self.card})
            for name, stated in self.card["arrays"].items():
                about = {"units": stated["unit"], "long_name": stated["meaning"]}
                layout = self._layout(stated["shape"], stated["dtype"], 1)
                axes = AXES[name][: len(stated["shape"])]
                group.create_array(name, **layout, dimension_names=("pair", *axes), attributes=about)
            for name, value in first.numbers.items():
                entry = _encoded(name, value)
                axes = tuple(f"{name}_{axis}" for axis in range(entry.ndim))
                layout = self._layout(entry.shape, entry.dtype.name, self.card["pairs_per_shard"])
                about = {"long_name": self.card["numbers"][name]}
                group.create_array(name, **layout, dimension_names=("pair", *axes), attributes=about)

        uninterrupted(make)

    def _layout(self, shape: Iterable[int], kind: str, pairs: int) -> dict[str, Any]:
        """Of an array by pair, in chunks of so many pairs: arguments of ``zarr.create_array``."""
        from zarr.codecs import Crc32cCodec

        return {
            "shape": (self.card["pairs"], *shape),
            "dtype": kind,
            "chunks": (pairs, *shape),
            "compressors": [Crc32cCodec()],
            "fill_value": np.nan if kind.startswith("float") else 0,
        }

    def write(self, shard: int, pairs: Iterable[Pair]) -> None:
        """See `Destination`."""
        numbers: dict[str, list[NDArray[Any]]] = {}
        try:
            for pair in pairs:
                for name, values in pair.arrays.items():
                    self._put(name, pair.numbers[LAST], values)
                for name, value in pair.numbers.items():
                    numbers.setdefault(name, []).append(_encoded(name, value))
            of_shard = self.pairs_of(shard)
            for name in sorted(numbers, key=LAST.__eq__):
                self._put(name, slice(of_shard.start, of_shard.stop), np.stack(numbers[name]))
        except OSError as error:
            raise InputError(f"{self.group} could not be written: {refusal(error, self.group)}") from error

    def _put(self, name: str, index: Any, values: NDArray[Any]) -> None:
        # Chunks of zeros are written as well: an absent chunk means a missing pair.
        array = self._array(name, "r+").with_config({"write_empty_chunks": True})
        uninterrupted(array.__setitem__, index, values)

    def read(self, pair: int) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
        """See `Destination`."""
        arrays = {name: self._chunk(name, pair, 1)[0] for name in self.card["arrays"]}
        count = self.card["pairs_per_shard"]
        shard, place = divmod(pair, count)
        if shard not in self._opened:
            self._opened[shard] = {name: self._chunk(name, shard, count) for name in self.card["numbers"]}
        return arrays, {name: _decoded(values[place]) for name, values in self._opened[shard].items()}

    def _chunk(self, name: str, place: int, pairs: int) -> NDArray[Any]:
        """A chunk of so many pairs, checked before it is read."""
        array = self._array(name, "r")
        file = chunk_file(self.group / name, array, (place,))
        check_file(file, "chunk of pairs")
        with reading(file, "a chunk of pairs"):
            size = math.prod(array.chunks) * array.dtype.itemsize + CHECKSUM
            if file.stat().st_size != size:
                raise InputError(
                    f"{file} is damaged: it has {file.stat().st_size} bytes instead of {size}. Remove its shard's "
                    f"chunk in {self.mark(0).parent}, and make the set again"
                )
            return np.asarray(array[place * pairs : (place + 1) * pairs])

    def _array(self, name: str, mode: Any) -> Any:
        """An array that has exactly the layout that the card states: other codecs or chunks are never used.

        Raises:
            InputError: it is missing, damaged, or has another layout.
        """
        if (name, mode) in self._opened:
            return self._opened[name, mode]
        import zarr

        where = self.group / name / "zarr.json"
        array = opened_array(self.group, name, "array of pairs", mode)
        with reading(where, "an array of pairs"):
            stated = self.card["arrays"].get(name)
            if stated is not None:
                layout = self._layout(stated["shape"], stated["dtype"], 1)
            else:
                rest = array.shape[1:]
                if math.prod(rest) > MOST_IN_NUMBER or array.dtype.name not in ("int64", "float64", "uint8"):
                    raise InputError(f"{where}: a number of a pair is not {array.dtype} of shape {rest}")
                layout = self._layout(rest, array.dtype.name, self.card["pairs_per_shard"])
            wanted = zarr.create_array(zarr.storage.MemoryStore(), **layout).metadata.to_dict()
            found = array.metadata.to_dict()
            for key in ("shape", "data_type", "chunk_grid", "chunk_key_encoding", "codecs"):
                if found.get(key) != wanted[key]:
                    raise InputError(f"{where}: {key} is {found.get(key)}, and the card states {wanted[key]}")
        self._opened[name, mode] = array
        return array

    def clear(self, patience: float) -> None:
        """See `Destination`."""
        super().clear(patience)
        for left in self.group.rglob("*.partial"):  # of Zarr
            left.unlink(missing_ok=True)


def _encoded(name: str, value: Any) -> NDArray[Any]:
    """A number of a pair, several, or a text, as an array."""
    if not isinstance(value, str):
        return np.asarray(value)
    letters = value.encode()
    if len(letters) > LETTERS or letters.endswith(b"\0"):
        raise InputError(f"{name} has {len(letters)} bytes, and a Zarr group keeps {LETTERS}: {value}")
    return np.frombuffer(letters.ljust(LETTERS, b"\0"), np.uint8)


def _decoded(value: NDArray[Any]) -> Any:
    return value.tobytes().rstrip(b"\0").decode() if value.dtype == np.uint8 else value.tolist()
