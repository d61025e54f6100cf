"""What a video of light fields states, and how its frames are called; see docs/store.md.

A frame is a store of its own, and its name says its number and its time: one rename puts both there.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import read_bytes, read_json, shown, value_at
from vcc.fields.grid import Grid, Sample, check_shape
from vcc.store.attributes import DTYPES, Attributes, Transfer, plain
from vcc.store.held import IDENTITY

VIDEO_VERSION = 1
"""Of the attributes and the layout below; a reader refuses what is newer than it knows."""
VIDEO = "light_field_video"
"""The attribute of the group under which all others stand."""
UNFINISHED = ".unfinished"
"""The folder in which frames are written before they have their names."""

Between = Literal["linear", "held"]
"""What there is between two frames: light mixed of them by time, or the first of them until the second."""

_NAME = re.compile(r"([0-9]{6,})_(-?[0-9]+(?:\.[0-9]+)?(?:e[-+]?[0-9]+)?)")


@dataclass(frozen=True, eq=False, repr=False)
class Common(Brief):
    """What all frames of a video have in common.

    Args:
        shape: (v, u, t, s) or (v, u, t, s, channels).
        kind: the NumPy type of the samples as stored.
        frame: see `vcc.LightField`.
        transfer: how stored numbers stand for light.
        sample: what a sample says of the scene.
        channel_names: one for each channel, or None.
    """

    shape: tuple[int, ...]
    kind: np.dtype[Any]
    frame: Affine
    transfer: Transfer
    sample: Sample
    channel_names: tuple[str, ...] | None

    @property
    def grid(self) -> Grid:
        """A frame without its samples, as it is stored."""
        return Grid(self.shape, self.frame, self.kind, self.sample)

    def difference(self, other: Common) -> str:
        """What is here instead of what another has, in words; empty for the same."""
        told = {
            "shape": ("×".join(map(str, one.shape)) for one in (self, other)),
            "type": (one.kind.name for one in (self, other)),
            "transfer": (one.transfer for one in (self, other)),
            "sample": (one.sample for one in (self, other)),
            "channel_names": (one.channel_names for one in (self, other)),
        }
        words = [f"{name} {here} instead of {there}" for name, (here, there) in told.items() if here != there]
        if self.frame != other.frame:
            here, there = self.grid.geometry, other.grid.geometry
            most = np.abs(self.frame.matrix - other.frame.matrix).max()
            words.append(
                f"{here} instead of {there}" if here != there else f"a frame that differs by up to {most:.3g}"
            )
        return "; ".join(words)

    def as_json(self) -> dict[str, Any]:
        """This as it is written."""
        return {
            "shape": list(self.shape),
            "dtype": self.kind.name,
            "frame": self.frame.matrix.tolist(),
            "transfer": self.transfer,
            "sample": self.sample,
            "channel_names": None if self.channel_names is None else list(self.channel_names),
        }

    @classmethod
    def from_json(cls, stated: Any, path: Path) -> Common:
        """What the video at ``path`` states of its frames.

        Raises:
            InputError: something missing or impossible (named).
        """
        if not isinstance(stated, dict):
            raise InputError(f"{path}: grid is an object or null, not {type(stated).__name__}")
        missing = [name for name in ("shape", "dtype", "frame", "transfer") if name not in stated]
        if missing:
            raise InputError(f"{path}: its grid does not state {', '.join(missing)} (see docs/store.md)")
        checks.one_of(f"{path}: dtype", stated["dtype"], DTYPES)
        try:
            names = stated.get("channel_names")
            made = cls(
                tuple(checks.whole_number_between("a size of shape", size, 1) for size in stated["shape"]),
                np.dtype(stated["dtype"]),
                Affine(np.array(stated["frame"], dtype=np.float64)),
                stated["transfer"],
                stated.get("sample", "mean"),
                None if names is None else tuple(names),
            )
            check_shape(made.shape)
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{path}: its grid cannot be used: {error}") from None
        attributes = Attributes(made.frame, made.transfer, made.channel_names, sample=made.sample)
        attributes.check(str(path), made.shape[4] if len(made.shape) == 5 else None)
        return made


@dataclass(frozen=True, eq=False, repr=False)
class VideoAttributes(Brief):
    """The attributes of a video.

    Args:
        between: what there is between two frames.
        common: what all frames have in common; None before the first.
        provenance: where the video comes from, as JSON can hold it.
        identity: drawn when the video was made (`vcc.store.held`); None of those that are older.
    """

    between: Between = "linear"
    common: Common | None = None
    provenance: dict[str, Any] = field(default_factory=dict)
    identity: str | None = None

    def as_json(self) -> dict[str, Any]:
        """The attributes as they are written."""
        return {
            "format_version": VIDEO_VERSION,
            IDENTITY: self.identity,
            "between": self.between,
            "grid": None if self.common is None else self.common.as_json(),
            "provenance": plain(self.provenance, "provenance"),
        }

    @classmethod
    def read(cls, path: Path) -> VideoAttributes:
        """The attributes of the video at ``path``.

        Raises:
            InputError: no video, a newer version, or something missing or impossible (named).
        """
        stated = video_attributes(path)
        if stated is None:
            raise InputError(f"{path} is no video of light fields: vcc.store.open_store opens a store of one")
        version = checks.whole_number_between(f"{path}: format_version", stated.get("format_version"), 1)
        if version > VIDEO_VERSION:
            raise InputError(
                f"{path} has format_version {version}, and this vcc reads videos up to {VIDEO_VERSION}: use a "
                "newer vcc"
            )
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
    """The attributes of a video as they are written; None where a folder is none.

    Raises:
        InputError: a file that cannot be read, or is not JSON.
    """
    file = folder / "zarr.json"
    if not file.is_file():
        return None
    stated = value_at(read_json(read_bytes(file), f"{file}"), "attributes", VIDEO)
    return stated if isinstance(stated, dict) else None


@dataclass(frozen=True)
class Place:
    """Where a frame stands.

    Args:
        number: counted from 0.
        time: seconds.
        name: of its folder; numbers and times of other programs may be written otherwise than here.
    """

    number: int
    time: float
    name: str

    @classmethod
    def of(cls, number: int, time: float) -> Place:
        """A frame that is to be written: its time is the shortest text that gives the same number again."""
        return cls(number, time, f"{number:06d}_{time!r}")

    @property
    def words(self) -> str:
        """For messages."""
        return f"frame {self.number}, {self.time:g} s"


def places(folder: Path) -> list[Place]:
    """The frames of a video, in their order.

    Raises:
        InputError: one is missing, two have the same number, or times do not ascend.
    """
    found = _listed(folder)
    if _first_gap(found) is not None:
        # A frame that came while names were listed may be passed over where the next one is not. All that this
        # list is about stood there before the second one is begun.
        last = found[-1].number
        found = [place for place in _listed(folder) if place.number <= last]
    gap = _first_gap(found)
    if gap is not None:
        raise InputError(f"{folder} {gap}")
    return found


def _listed(folder: Path) -> list[Place]:
    found = []
    for name in os.listdir(folder):  # noqa: PTH208  (of thousands of names, paths are made of few)
        match = _NAME.fullmatch(name)
        if match:
            found.append(Place(int(match[1]), float(match[2]), name))
    return sorted(found, key=lambda place: place.number)


def _first_gap(found: list[Place]) -> str | None:
    """Where frames do not follow one another, in words."""
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
