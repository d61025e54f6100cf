"""Images of light in several bands: each train's image of the channels that meet it, put together.

`vcc.optics.bands` finds the trains. Each runs on its channels alone, so that bands cost one image of one channel
each.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from array_api_compat import array_namespace, is_array_api_obj
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.memory import MEMORY_LIMIT
from vcc.base.workers import Workers
from vcc.engines import on_gpu
from vcc.fields.grid import Block, Grid
from vcc.fields.sampled import to_numpy
from vcc.fields.samples import InMemory, Samples
from vcc.optics.bands import SameWay
from vcc.optics.response import matrix_of
from vcc.optics.sensor import Sensor
from vcc.plan.how import How, cores
from vcc.run.drive import Recorded


@dataclass(frozen=True, eq=False, repr=False)
class SomeChannels(Brief):
    """Some channels of a light field: of samples in memory a copy, of others what is read.

    Args:
        samples: with an axis of channels.
        channels: which.
    """

    samples: Samples
    channels: tuple[int, ...]

    @classmethod
    def of(cls, samples: Samples, channels: tuple[int, ...]) -> Samples:
        """The channels of a light field; itself where these are all, or where there is no axis of channels."""
        if samples.grid.channels is None or channels == tuple(range(samples.grid.channels)):
            return samples
        return cls(samples, channels)

    @property
    @cached
    def grid(self) -> Grid:
        """The grid of these channels."""
        return self.samples.grid.of_channels(self.channels)

    @property
    def stored_bytes(self) -> int:
        """Bytes of all channels, which are read together."""
        return self.samples.stored_bytes

    def whole(self) -> Any | None:
        """The samples of these channels where all are in memory, side by side as an engine takes them fastest."""
        return self._whole

    @property
    @cached
    def _whole(self) -> Any | None:
        values = self.samples.whole()
        if values is None:
            return None
        if isinstance(values, np.ndarray):
            return _copied(values, self.channels)
        if not is_array_api_obj(values):
            return on_gpu(np.ascontiguousarray(to_numpy(values)[..., list(self.channels)]))
        return array_namespace(values).stack([values[..., n] for n in self.channels], axis=-1)

    def check_complete(self) -> None:
        """Refuse a light field of which views are missing."""
        self.samples.check_complete()

    def read(self, block: Block) -> Any:
        """The samples of a block, (v, u, t, s, channels)."""
        if self.samples.whole() is not None:
            return self._whole[(*block.slices, ...)]  # type: ignore[index]
        return self.samples.read(block)[..., list(self.channels)]


@dataclass(frozen=True, eq=False, repr=False)
class BandImages(Brief):
    """What is made of a light field's bands, and how it becomes one image.

    Args:
        sensor: with or without a response.
        grid: of the light field.
        parts: the trains, the channels that meet each, and the image of these channels.
    """

    sensor: Sensor
    grid: Grid
    parts: Sequence[tuple[SameWay, Recorded]]

    @property
    def recorded(self) -> Recorded:
        """The image of the sensor, (rows, columns[, channels]).

        Missing rays are those of the worst band. Sampling errors of several orders or filters in one band, and of
        bands in one channel of the sensor, add up, since all take the same rays; over channels it is their root
        mean square.
        """
        values, errors, missing = self._by_band()
        worst = int(np.argmax(missing))
        reasons = [found.missing_reason for same, found in self.parts if worst in same.channels]
        values, errors = self._mixed(values, errors)
        grey = self.sensor.channels_of(self.grid.channels) is None
        return Recorded(
            values[0] if grey else _stacked(values),
            float(missing[worst]),
            next(filter(None, reasons), ""),
            math.sqrt(float(np.mean(np.square(errors)))),
            sum(found.rays for _, found in self.parts),
            max((found.samples for _, found in self.parts), default=0),
        )

    def _by_band(self) -> tuple[list[Any], NDArray[np.float64], NDArray[np.float64]]:
        """The image of each band, its sampling error, and the share of its rays that is missing."""
        count = self.grid.channels or 1
        values: list[Any] = [None] * count
        errors, missing = np.zeros(count), np.zeros(count)
        for (same, found), shares in zip(self.parts, shares_of([same for same, _ in self.parts]), strict=True):
            for place, (channel, weight) in enumerate(zip(same.channels, same.weights.tolist(), strict=True)):
                one = found.values if self.grid.channels is None else found.values[..., place]
                one = one if weight == 1 else one * weight
                values[channel] = one if values[channel] is None else values[channel] + one
                errors[channel] += weight * found.sampling_error
                missing[channel] += shares[place] * found.missing_rays
        some = next((each for each in values if each is not None), np.zeros(self.sensor.shape, np.float32))
        return [some * 0 if each is None else each for each in values], errors, missing

    def _mixed(self, values: list[Any], errors: NDArray[np.float64]) -> tuple[list[Any], NDArray[np.float64]]:
        """Bands to channels of the sensor by its response."""
        if self.sensor.response is None:
            return values, errors
        matrix = matrix_of(self.sensor.response, len(values), self.grid.wavelengths)
        mixed = [sum(band * weight for band, weight in zip(values, row, strict=True)) for row in matrix.tolist()]
        return mixed, matrix @ errors


def read_once(samples: Samples, how: How) -> Samples:
    """Stored samples in memory, where they take a quarter of the memory limit at most; else as they are.

    Args:
        samples: of which several trains make images.
        how: its memory limit.
    """
    grid = samples.grid
    size = math.prod(grid.shape) * grid.kind.itemsize
    if samples.whole() is not None or size > (how.memory_limit or MEMORY_LIMIT) / 4:
        return samples
    samples.check_complete()
    return InMemory.of(samples.read(Block.all_of(grid.shape)), grid)


def _copied(values: NDArray[Any], channels: Sequence[int]) -> NDArray[Any]:
    """Some channels of samples; view by view, which stays in a core's cache, and on all cores."""
    made = np.empty((*values.shape[:4], len(channels)), values.dtype)

    def copy_row(row: int) -> None:
        for column in range(values.shape[1]):
            for place, channel in enumerate(channels):
                made[row, column, ..., place] = values[row, column, ..., channel]

    with Workers(cores()) as pool:
        for _ in pool.map(copy_row, range(values.shape[0])):
            pass
    return made


def shares_of(trains: Sequence[SameWay]) -> list[NDArray[np.float64]]:
    """Of each train, the share that it has in all light of its bands that passes the camera."""
    totals: dict[int, float] = {}
    for same in trains:
        for channel, weight in zip(same.channels, same.weights.tolist(), strict=True):
            totals[channel] = totals.get(channel, 0.0) + weight
    return [same.weights / np.array([totals[channel] for channel in same.channels]) for same in trains]


def _stacked(values: list[Any]) -> Any:
    if isinstance(values[0], np.ndarray):
        return np.stack(values, axis=-1)
    return array_namespace(values[0]).stack(values, axis=-1)


def largest_shares(trains: Sequence[SameWay]) -> list[float]:
    """Of each train, the largest share that it has in a band whose light meets no other train more; else 0."""
    shares = shares_of(trains)
    most: dict[int, float] = {}
    for same, of_train in zip(trains, shares, strict=True):
        for channel, share in zip(same.channels, of_train.tolist(), strict=True):
            most[channel] = max(most.get(channel, 0.0), share)
    return [
        max((s for c, s in zip(same.channels, of_train.tolist(), strict=True) if s == most[c]), default=0.0)
        for same, of_train in zip(trains, shares, strict=True)
    ]


def as_share(found: Recorded, share: float) -> Recorded:
    """An image that is a share of its band's light: as much counts of the rays that it lacks."""
    if share == 1:
        return found
    reason = f"{found.missing_reason}, of {share:.0%} of the light"
    return replace(found, missing_rays=found.missing_rays * share, missing_reason=reason)


def once_each(cautions: Iterable[tuple[str, str]]) -> list[str]:
    """The warnings of several bands, once each: sentences that differ only in numbers are one.

    Args:
        cautions: a sentence, and of which bands; what counts most first.
    """
    kept: dict[str, str] = {}
    for sentence, bands in cautions:
        kept.setdefault(re.sub(r"[\d.,]+", "0", sentence), f"{sentence} ({bands})")
    return list(kept.values())


def bands_as_text(channels: Sequence[int], wavelengths: tuple[float, ...] | None) -> str:
    """Channels for people: ``"channel 2, 465 nm"``, ``"channels 0, 1"``."""
    listed = ", ".join(map(str, channels[:6])) + (", …" if len(channels) > 6 else "")
    if len(channels) > 1:
        return f"channels {listed}"
    return f"channel {listed}" + ("" if wavelengths is None else f", {wavelengths[channels[0]] * 1e9:g} nm")
