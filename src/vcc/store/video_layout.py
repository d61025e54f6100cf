"""Attributes of a light field video and names of its frames; see docs/store.md.

Each frame is a store, and its name contains its number and time, so a single rename publishes both.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import read_bytes, read_json, shown, value_at
from vcc.fields.grid import Grid, check_shape
from vcc.store.attributes import DTYPES, Attributes, check_version, plain
from vcc.store.held import IDENTITY

VIDEO_VERSION = 1
"""Version of the attributes and the layout below; readers do not support newer versions."""
VIDEO = "light_field_video"
"""The attribute of the group that contains all others."""
UNFINISHED = ".unfinished"
"""The folder for frames that are being written."""

Between = Literal["linear", "held"]
"""Interpolation between two frames: linear in time, or the first frame until the second."""

SHARED = ("frame", "transfer", "sample", "channel_names", "wavelengths")
"""Attributes that all frames of a video share."""

_NAME = re.compile(r"([0-9]{6,})_(-?[0-9]+(?:\.[0-9]+)?(?:e[-+]?[0-9]+)?)")


@dataclass(frozen=True, eq=False, repr=False)
class Common(Brief):
    """Properties that all frames of a video share.

    Args:
        shape: (v, u, t, s) or (v, u, t, s, channels).
        kind: type of the samples as stored.
        attributes: of a frame; those listed in `SHARED` are the same in all.
    """

    shape: tuple[int, ...]
    kind: np.dtype[Any]
    attributes: Attributes

    @property
    def grid(self) -> Grid:
        """A frame without its samples, as stored."""
        known = self.attributes
        return Grid(self.shape, known.frame, self.kind, known.sample, wavelengths=known.wavelengths)

    def difference(self, other: Common) -> str:
        """Text for the differences from ``other``; empty if there are none."""
        told = {
            "shape": ("×".join(map(str, one.shape)) for one in (self, other)),
            "type": (one.kind.name for one in (self, other)),
            **{name: [getattr(one.attributes, name) for one in (self, other)] for name in SHARED[1:]},
        }
        words = [f"{name} {here} instead of {there}" for name, (here, there) in told.items() if here != there]
        if self.attributes.frame != other.attributes.frame:
            here, there = self.grid.geometry, other.grid.geometry
            most = np.abs(self.attributes.frame.matrix - other.attributes.frame.matrix).max()
            words.append(
                f"{here} instead of {there}" if here != there else f"a frame that differs by up to {most:.3g}"
            )
        return "; ".join(words)

    def as_json(self) -> dict[str, Any]:
        """The properties as JSON data."""
        stated = self.attributes.as_json()
        shared = {name: stated[name] for name in SHARED if name in stated}
        return {"shape": list(self.shape), "dtype": self.kind.name, **shared}

    @classmethod
    def from_json(cls, stated: Any, path: Path) -> Common:
        """Read the common properties of the frames of the video at ``path``.

        Raises:
            InputError: they are missing, or those of no light field.
        """
        if not isinstance(stated, dict):
            raise InputError(f"{path}: grid is an object or null, not {type(stated).__name__}")
        missing = [name for name in ("shape", "dtype", "frame", "transfer") if name not in stated]
        if missing:
            raise InputError(f"{path}: its grid does not state {', '.join(missing)} (see docs/store.md)")
        checks.one_of(f"{path}: dtype", stated["dtype"], DTYPES)
        try:
            shape = tuple(checks.whole_number_between("a size of shape", size, 1) for size in stated["shape"])
            check_shape(shape)
        except (TypeError, ValueError) as error:
            raise InputError(f"{path}: its grid cannot be used: {error}") from None
        attributes = Attributes.from_json({**stated, "format_version": 1, "complete": True}, path)
        attributes.check(str(path), shape[4] if len(shape) == 5 else None)
        return cls(shape, np.dtype(stated["dtype"]), attributes)


@dataclass(frozen=True, eq=False, repr=False)
class VideoAttributes(Brief):
    """The attributes of a video.

    Args:
        between: interpolation between two frames.
        common: properties that all frames share; None before the first frame.
        provenance: origin of the video, as JSON data.
        identity: a random text drawn when the video is made (`vcc.store.held`); None for older videos.
    """

    between: Between = "linear"
    common: Common | None = None
    provenance: dict[str, Any] = field(default_factory=dict)
    identity: str | None = None

    def as_json(self) -> dict[str, Any]:
        """The attributes as JSON data."""
        return {
            "format_version": VIDEO_VERSION,
            IDENTITY: self.identity,
            "between": self.between,
            "grid": None if self.common is None else self.common.as_json(),
            "provenance": plain(self.provenance, "provenance"),
        }

    @classmethod
    def read(cls, path: Path) -> VideoAttributes:
        """Read the attributes of the video at ``path``.

        Raises:
            InputError: not a video, a newer version, or an attribute that is missing or invalid (named).
        """
        stated = video_attributes(path)
        if stated is None:
            raise InputError(f"{path} is not a video of light fields: vcc.store.open_store opens a light field")
        check_version(path, stated.get("format_version"), VIDEO_VERSION)
        between = stated.get("between", "linear")
        checks.one_of(f"{path}: between", between, get_args(Between))
        common, provenance = stated.get("grid"), stated.get("provenance") or {}
        if not isinstance(provenance, dict):
            raise InputError(f"{path}: provenance is an object, not {type(provenance).__name__}")
        identity = stated.get(IDENTITY)
        if not isinstance(identity, str | None):
            raise InputError(f"{path}: identity is a text, not {identity!r}")
        return cls(between, None if common is None else Common.from_json(common, path), provenance, identity)


def video_attributes(folder: Path) -> dict[str, Any] | None:
    """The attributes of a video as JSON data; None if the folder is not a video.

    Raises:
        InputError: the file cannot be read or is not JSON.
    """
    file = folder / "zarr.json"
    if not file.is_file():
        return None
    stated = value_at(read_json(read_bytes(file), f"{file}"), "attributes", VIDEO)
    return stated if isinstance(stated, dict) else None


@dataclass(frozen=True)
class Place:
    """Number, time and folder name of a frame.

    Args:
        number: counted from 0.
        time: seconds.
        name: name of the folder; other programs may format number and time differently.
    """

    number: int
    time: float
    name: str

    @classmethod
    def of(cls, number: int, time: float) -> Place:
        """A new frame; its name contains the shortest decimal that represents the time exactly."""
        return cls(number, time, f"{number:06d}_{time!r}")

    @property
    def words(self) -> str:
        """Text for messages."""
        return f"frame {self.number}, {self.time:g} s"


def places(folder: Path) -> list[Place]:
    """The frames of a video in order.

    Raises:
        InputError: a frame is missing, two have the same number, or times do not ascend.
    """
    found = _listed(folder)
    if _first_gap(found) is not None:
        # Listing may miss a frame that appears during the call but include a later one. A second listing contains
        # every frame up to the last one found, because each frame appears before the next is begun.
        last = found[-1].number
        found = [place for place in _listed(folder) if place.number <= last]
    gap = _first_gap(found)
    if gap is not None:
        raise InputError(f"{folder} {gap}")
    return found


def _listed(folder: Path) -> list[Place]:
    found = []
    for name in os.listdir(folder):  # noqa: PTH208  (thousands of names; paths are made for few)
        match = _NAME.fullmatch(name)
        if match:
            found.append(Place(int(match[1]), float(match[2]), name))
    return sorted(found, key=lambda place: place.number)


def _first_gap(found: list[Place]) -> str | None:
    """Text for the first fault in the sequence of frames; None if there is none."""
    for number, place in enumerate(found):
        before = found[number - 1] if number else None
        if place.number > number:
            where = "before" if before is None else f"between {before.name} and"
            return (
                f"is damaged: frame {number} is missing, {where} {place.name}. Copy it again; each that is there "
                "is a store, which vcc.store.open_store opens"
            )
        if before is not None and place.number == before.number:
            return (
                f"is damaged: {before.name} and {place.name} are both frame {place.number}. Take one of them away"
            )
        if not (np.isfinite(place.time) and (before is None or before.time < place.time)):
            follows = "" if before is None else f" after {before.name}"
            return f"is damaged: times of frames ascend, and {shown(place.name)} comes{follows}"
    return None
