"""Reading a data set: a sequence of pairs, which `torch.utils.data.DataLoader` takes as it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import check_path, expanded, read_bytes, read_json, reading
from vcc.dataset.card import FORMAT_VERSION
from vcc.dataset.destination import CARD, Destination
from vcc.dataset.recipe import MOST_PAIRS
from vcc.dataset.shards import Shards
from vcc.dataset.zarr_group import GROUP, ZarrGroup
from vcc.store.attributes import check_version

Numbers = Literal["radiance", "digital"]


@dataclass(frozen=True, eq=False, repr=False)
class Pairs(Brief, Sequence[dict[str, Any]]):
    """The pairs of a data set, read on access: a map-style data set for ``torch.utils.data.DataLoader``.

    ``pairs[3]`` is a dictionary: arrays by name, ``"recording"`` and the ground truth, and ``"numbers"``, another
    dictionary; ``pairs.card`` defines all of them. Workers of a loader, which may be started by
    any method, open files of their own.

    Args:
        disk: of the data set.
        numbers: ``"radiance"``: the recording as float32, dark level subtracted, in units of the sharp image: a
            uniform scene of radiance 1 has mean 1; behind a colour filter, each pixel in its own channel.
            ``"digital"``: the digital numbers, as stored.
    """

    disk: Destination
    numbers: Numbers = "radiance"

    @property
    def path(self) -> Path:
        """Folder of the data set."""
        return self.disk.path

    @property
    def card(self) -> dict[str, Any]:
        """How the data set was made, and what its arrays and numbers are."""
        return self.disk.card

    def __len__(self) -> int:
        return int(self.card["pairs"])

    def __getitem__(self, number: Any) -> Any:
        """One pair, or a list of several for a slice.

        Raises:
            InputError: a missing or damaged file.
            IndexError: there is no such pair.
        """
        if isinstance(number, slice):
            return [self[each] for each in range(*number.indices(len(self)))]
        if not -len(self) <= number < len(self):
            raise IndexError(f"there are {len(self)} pairs, and no number {number}")
        arrays, numbers = self.disk.read(int(number) % len(self))
        if self.numbers == "radiance":
            with reading(self.path, "a data set"):
                arrays["recording"] = self._radiance(arrays["recording"], numbers)
        return {**arrays, "numbers": numbers}

    def _radiance(self, recording: NDArray[Any], numbers: dict[str, Any]) -> NDArray[np.float32]:
        light = recording.astype(np.float32)
        light -= np.float32(numbers.get("dark_dn", 0))
        name = "dn_per_radiance" if "dn_per_radiance" in numbers else "irradiance_of_white"
        light /= self._by_channel(numbers[name], light)
        return light

    def _by_channel(self, scale: Sequence[float], light: NDArray[np.float32]) -> Any:
        if light.ndim == 3 or len(scale) == 1:
            return np.asarray(scale, np.float32)
        return np.asarray(scale, np.float32)[self._channel_of_pixels]

    @property
    @cached
    def _channel_of_pixels(self) -> NDArray[np.int64]:
        """The channel of each pixel behind a colour filter."""
        rows, columns = self.card["arrays"]["recording"]["shape"]
        tile = np.array(self.card["filter_tile"])
        down, across = -(-rows // len(tile)), -(-columns // len(tile[0]))
        return np.tile(tile, (down, across))[:rows, :columns]

    def __repr__(self) -> str:
        arrays = ", ".join(f"{name} {'×'.join(map(str, e['shape']))}" for name, e in self.card["arrays"].items())
        return f"Pairs({self.path}: {len(self)} pairs of {arrays}; {len(self.card['scenes'])} scenes)"


def open_dataset(path: str | PathLike[str], numbers: Numbers = "radiance") -> Pairs:
    """Open a data set that `make_dataset` has finished.

    Args:
        path: its folder.
        numbers: units of recordings, see `Pairs`.

    Raises:
        InputError: no data set, an unfinished one, a damaged card, or one of a newer version.
    """
    checks.one_of("numbers", numbers, get_args(Numbers))
    disk = destination_at(expanded(path))
    left = disk.left()
    if left:
        raise InputError(
            f"{path} is unfinished: {len(left)} of {disk.card['shards']} shards are missing. The same call of "
            "make_dataset resumes"
        )
    return Pairs(disk, numbers)


def destination_at(path: Path) -> Destination:
    """The data set in a folder.

    Raises:
        InputError: none is there, or its card is damaged or of a newer version.
    """
    check_path(path, "data set")
    file = path / CARD
    if not file.is_file():
        raise InputError(
            f"{path} is no data set of vcc: it contains no {CARD}. Give the folder of one, or a new name"
        )
    card = read_json(read_bytes(file), str(file))
    counts = [card.get(name) for name in ("format_version", "pairs", "pairs_per_shard", "shards")]
    if not all(type(each) is int and each > 0 for each in counts):
        raise InputError(f"{file} is not the card of a data set, or is damaged: its counts are {counts}")
    version, pairs, per_shard, shards = (each or 0 for each in counts)
    check_version(file, version, FORMAT_VERSION)
    arrays = card.get("arrays")
    stated = isinstance(arrays, dict) and all(
        isinstance(each, dict) and "shape" in each for each in arrays.values()
    )
    stated = stated and "recording" in arrays and isinstance(card.get("numbers"), dict)  # type: ignore[operator]
    if shards != -(-pairs // per_shard) or pairs > MOST_PAIRS or not stated:
        raise InputError(f"{file} is damaged: pairs, shards and arrays do not fit together")
    made: Destination = (ZarrGroup if (path / GROUP).is_dir() else Shards)(path, card)
    return made
