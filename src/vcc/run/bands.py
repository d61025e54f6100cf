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
from array_api_compat import array_namespace
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
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
from vcc.plan.model import Plan
from vcc.run.drive import Recorded

Array = NDArray[np.float64]


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
        if type(values).__module__.startswith("numba"):  # on the GPU, by `on_gpu`
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
class Mixing(Brief):
    """Images of trains to one image of the sensor: a linear map, the same for all pixels.

    Channel k of the image is Σ shares[n][k, p] · image n[…, p], over all trains n and the p-th channel that takes
    each.

    Args:
        shares: of each train, (channels of the image, channels of the light field that take it).
        without_channels: whether light fields have no axis of channels, and whether images have none.
    """

    shares: Sequence[Array]
    without_channels: tuple[bool, bool]

    @classmethod
    def of(cls, trains: Sequence[SameWay], sensor: Sensor, grid: Grid) -> Mixing:
        """The weights of ways, and the sensor's response.

        Raises:
            InputError: as `vcc.optics.response.matrix_of`.
        """
        matrix = response_matrix(sensor, grid)
        shares = [matrix[:, list(same.channels)] * same.weights for same in trains]
        return cls(shares, (grid.channels is None, sensor.channels_of(grid.channels) is None))

    def __call__(self, images: Sequence[Any]) -> Any:
        """The image of the sensor, (…, rows, columns[, channels]).

        Args:
            images: of each train, (…, rows, columns[, channels]), in arrays of any library.
        """
        mixed: list[Any] = [None] * len(self.shares[0])
        for image, shares in zip(images, self.shares, strict=True):
            for k, p in np.argwhere(shares).tolist():
                one, share = self._channel(image, p), float(shares[k, p])
                one = one if share == 1 else one * share
                mixed[k] = one if mixed[k] is None else mixed[k] + one
        dark = self._channel(images[0], 0) * 0
        mixed = [dark if each is None else each for each in mixed]
        return mixed[0] if self.without_channels[1] else _stacked(mixed)

    def transposed(self, image: NDArray[Any], n: int) -> NDArray[Any]:
        """The adjoint: weights of an image of the sensor to weights of the image of train n."""
        image = image[..., None] if self.without_channels[1] else image
        of_train: NDArray[Any] = image @ self.shares[n].astype(image.dtype)
        return of_train[..., 0] if self.without_channels[0] else of_train

    def slopes(self, image: NDArray[Any], weights: NDArray[Any], n: int) -> Array:
        """The gradient to ``shares[n]`` of the image of the sensor, weighted.

        Args:
            image: of train n, (rows, columns[, channels]).
            weights: of the image of the sensor, likewise.
            n: the train.
        """
        image = image[..., None] if self.without_channels[0] else image
        weights = weights[..., None] if self.without_channels[1] else weights
        return np.asarray(np.tensordot(weights.astype(np.float64), image.astype(np.float64), ((0, 1), (0, 1))))

    def _channel(self, image: Any, p: int) -> Any:
        return image if self.without_channels[0] else image[..., p]


def response_matrix(sensor: Sensor, grid: Grid) -> Array:
    """(channels of the image, bands): by the sensor's response, or one for each band without one.

    Raises:
        InputError: as `vcc.optics.response.matrix_of`.
    """
    bands = grid.channels or 1
    return np.eye(bands) if sensor.response is None else matrix_of(sensor.response, bands, grid.wavelengths)


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
        if not self.parts:
            channels = self.sensor.channels_of(self.grid.channels)
            return Recorded(
                np.zeros((*self.sensor.shape, *(() if channels is None else (channels,))), np.float32), 0.0, ""
            )
        trains, found = [same for same, _ in self.parts], [found for _, found in self.parts]
        mixing = Mixing.of(trains, self.sensor, self.grid)
        missing = np.zeros(self.grid.channels or 1)
        for same, shares, one in zip(trains, shares_of(trains), found, strict=True):
            missing[list(same.channels)] += shares * one.missing_rays
        worst = int(np.argmax(missing))
        errors = sum(
            shares.sum(axis=1) * one.sampling_error for shares, one in zip(mixing.shares, found, strict=True)
        )
        reasons = [one.missing_reason for same, one in self.parts if worst in same.channels]
        return Recorded(
            mixing([one.values for one in found]),
            float(missing[worst]),
            next(filter(None, reasons), ""),
            math.sqrt(float(np.mean(np.square(errors)))),
            sum(one.rays for one in found),
            max(one.samples for one in found),
        )


@dataclass(frozen=True, eq=False, repr=False)
class BandPlans:
    """The plans of a camera that depends on the wavelength or the channel, one for each different train.

    Made by `vcc.Camera.compile`; `vcc.Camera.capture` accepts it as ``plan`` for other light fields of the same
    shape, frame and wavelengths.

    Args:
        trains: the trains, and the channels that take each.
        plans: of each, for its channels alone.
    """

    trains: Sequence[SameWay]
    plans: Sequence[Plan]

    @property
    def cautions(self) -> tuple[str, ...]:
        """Warnings of all plans, once each."""
        return tuple(dict.fromkeys(caution for plan in self.plans for caution in plan.cautions))

    @property
    def samples_touched(self) -> int:
        """Number of samples that an engine processes, for one channel of each plan."""
        return sum(plan.samples_touched for plan in self.plans)

    def check_fits(self, trains: Sequence[SameWay], grid: Grid) -> None:
        """Raise an error if the plans were made for something else.

        Args:
            trains: of the camera and the bands of the light field.
            grid: of the light field.

        Raises:
            InputError: another camera, other bands, or another shape or frame of light field.
        """
        if [same.channels for same in trains] != [same.channels for same in self.trains]:
            raise InputError(
                "these plans are for another camera or for other bands: make them anew with "
                "camera.compile(light_field)"
            )
        for same, plan in zip(trains, self.plans, strict=True):
            plan.check_fits(same.train, grid.of_channels(same.channels) if grid.channels else grid)

    def __repr__(self) -> str:
        lines = [f"{len(self.plans)} plans for bands"]
        for same, plan in zip(self.trains, self.plans, strict=True):
            lines += [f"{bands_as_text(same.channels, None)}: {plan!r}"]
        return "\n".join(lines)


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
