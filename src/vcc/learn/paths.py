"""The plans of a camera while it learns: one for all channels, or one for each group of bands.

Elements of glass, masks of channels, filters and orders send bands of light through different trains
(`vcc.optics.bands`). Each train has a chain from the camera's parameters to its plan. The image is a sum of the
trains' images (`vcc.run.bands.Mixing`), whose weights may depend on parameters too: those of filters and of the
sensor's response.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.fields.grid import Grid
from vcc.learn.chain import STEP, Chain, Values, following
from vcc.learn.parameters import parameter, put, read
from vcc.learn.scales import scale
from vcc.optics.band import Band
from vcc.optics.bands import SameWay, bands_of, ways_of
from vcc.optics.sensor import Sensor
from vcc.optics.train import Train
from vcc.plan.how import How
from vcc.run.bands import Mixing

Array = NDArray[np.float64]

PROBE = 1e-3
"""Step relative to a change of 1 (`vcc.learn.scales`) that shows what depends on a parameter."""


@dataclass(frozen=True, eq=False, repr=False)
class Path(Brief):
    """What some channels of a light field take.

    Args:
        chain: from the camera's parameters to the plan of their train.
        channels: of the light field, in order; None for all, of a camera that does not depend on the band.
        ways: of each of these channels, which of the ways through the camera.
        followed: by parameter, the numbers of the plan that depend on it.
    """

    chain: Chain
    channels: tuple[int, ...] | None
    ways: tuple[int, ...]
    followed: Mapping[str, Collection[str]]

    @classmethod
    def of(cls, chain: Chain, channels: tuple[int, ...] | None = None, ways: tuple[int, ...] = ()) -> Path:
        """With the numbers that depend on each parameter of the chain."""
        return cls(chain, channels, ways, {name: following(chain, name) for name in chain.names})

    def values(self, values: Values) -> dict[str, Array]:
        """Those of the parameters on which this path depends."""
        return {name: np.asarray(values[name], dtype=np.float64) for name in self.chain.names if name in values}


@dataclass(frozen=True, eq=False, repr=False)
class Paths(Brief):
    """All paths of a camera, and how their images become one.

    Args:
        train: the camera when learning begins.
        grid: of the light field.
        names: of the parameters.
        each: the paths.
        counts: of each channel, the number of its ways; empty for a camera that does not depend on the band.
        mixed_by: the parameters on which the weights of images depend.
    """

    train: Train
    grid: Grid
    names: tuple[str, ...]
    each: Sequence[Path]
    counts: tuple[int, ...] = ()
    mixed_by: Collection[str] = ()

    @classmethod
    def of(cls, train: Train, grid: Grid, how: How | None, names: Sequence[str]) -> Paths:
        """Make all choices for the camera as it is.

        Bands share a plan if their trains are equal, and stay equal when all parameters change.

        Raises:
            InputError: a parameter that does not exist or has no derivative; nothing that passes in any channel.
        """
        names = tuple(names)
        if not train.depends_on_bands:
            return cls(train, grid, names, [Path.of(Chain(train, grid, how, names))])
        bands = bands_of(grid.channels, grid.wavelengths)
        counts = tuple(len(ways_of(train, band)) for band in bands)
        moved, fixed = _moved(train, names)
        without = {name: put(moved, {name: read(train, name)}) for name in names if name not in fixed}
        groups: dict[Hashable, list[tuple[int, int]]] = {}
        for channel, band in enumerate(bands):
            for way in range(counts[channel]):
                pair = tuple(_seen(band, way, counts[channel], each) for each in (train, moved))
                groups.setdefault((channel if fixed else None, pair), []).append((channel, way))
        if not groups:
            raise InputError("nothing passes this camera in any channel: there is nothing to learn from")
        paths = []
        for members in groups.values():
            channels, ways = (tuple(each) for each in zip(*members, strict=True))
            seen = partial(_seen, bands[channels[0]], ways[0], counts[channels[0]])
            there = seen(moved)
            own = [name for name in names if name in fixed or seen(without[name]) != there]
            of_band = grid if grid.channels is None else grid.of_channels(channels)
            paths.append(Path.of(Chain(train, of_band, how, own, seen), channels, ways))
        made = cls(train, grid, names, paths, counts)
        shares = made._shares(moved)
        mixed_by = [name for name in names if name in fixed or _differ(made._shares(without[name]), shares)]
        return replace(made, mixed_by=mixed_by)

    def mixing(self, values: Values) -> Mixing | None:
        """How the images of the paths become one, for some values of the parameters; None: the only one is it."""
        if not self.counts:
            return None
        mixed = {name: values[name] for name in self.mixed_by if name in values}
        return self._mixing(put(self.train, mixed), self._weights(put(self.train, mixed)))

    def pull(self, values: Values, name: str, slopes: Sequence[Array]) -> Array:
        """The gradient to a parameter by way of the weights of images.

        Args:
            values: of the parameters.
            name: of ``mixed_by``.
            slopes: of each path, the gradient to its shares in the image.
        """
        here = np.asarray(values[name], dtype=np.float64) if name in values else read(self.train, name)
        kept = {other: values[other] for other in self.mixed_by if other in values}
        train = put(self.train, {**kept, name: here})
        step, found = STEP * scale(self.train, name), np.zeros(here.shape)
        # The response of the sensor is no part of what elements do to a band.
        weights = self._weights(train) if isinstance(parameter(self.train, name).owner, Sensor) else None
        for index in np.ndindex(here.shape):
            sides = []
            for side in (-step, step, 0.0):  # at a limit of what is valid a one-sided difference
                there = here.copy()
                there[index] += side
                try:
                    sides.append((side, self._shares(put(train, {name: there}), weights)))
                except InputError:
                    continue
                if len(sides) == 2:
                    break
            (low, before), (high, behind) = sides
            each = zip(slopes, before, behind, strict=True)
            found[index] = sum(np.vdot(slope, two - one) for slope, one, two in each) / (high - low)
        return found

    def _shares(self, train: Train, weights: Sequence[Array] | None = None) -> Sequence[Array]:
        return self._mixing(train, self._weights(train) if weights is None else weights).shares

    def _mixing(self, train: Train, weights: Sequence[Array]) -> Mixing:
        same = [SameWay(train, path.channels or (0,), w) for path, w in zip(self.each, weights, strict=True)]
        return Mixing.of(same, train.sensor, self.grid)

    def _weights(self, train: Train) -> list[Array]:
        """Of each path, the weights of its channels."""
        bands = bands_of(self.grid.channels, self.grid.wavelengths)
        ways = [_checked_ways(train, band, count) for band, count in zip(bands, self.counts, strict=True)]
        return [
            np.array(
                [ways[channel][way][0] for channel, way in zip(path.channels or (0,), path.ways, strict=True)]
            )
            for path in self.each
        ]


def _checked_ways(train: Train, band: Band, count: int) -> list[tuple[float, Train]]:
    """The ways of a band; an error if there are not as many as at first."""
    ways = ways_of(train, band)
    if len(ways) != count:
        raise InputError(
            f"light of channel {band.channel} takes {len(ways)} ways through filters and orders, and {count} at "
            "the parameters with which learning began: begin with transmissions above 0, and keep them there"
        )
    return ways


def _seen(band: Band, way: int, count: int, train: Train) -> Train:
    """The train of one way of a band."""
    return _checked_ways(train, band, count)[way][1]


def _moved(train: Train, names: Sequence[str]) -> tuple[Train, set[str]]:
    """A nearby camera with all parameters changed, and those that cannot change where they are."""
    fixed, rng = set(), np.random.default_rng(0)
    for name in names:
        here = read(train, name)
        some = PROBE * scale(train, name) * rng.uniform(0.5, 1.0, here.shape)
        for there in (here + np.where(here > 0.5, -some, some), here + some, here - some):
            try:
                train = put(train, {name: there})
            except InputError:
                continue
            break
        else:
            fixed.add(name)
    return train, fixed


def _differ(some: Sequence[Array], others: Sequence[Array]) -> bool:
    return any(not np.array_equal(one, other) for one, other in zip(some, others, strict=True))
