"""Attributes of a store: frame, units, transfer function, names, provenance; see docs/store.md."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.version import VERSION
from vcc.base.wavelengths import wavelengths as all_checked
from vcc.fields.filling import Filling
from vcc.fields.grid import Sample
from vcc.store.held import IDENTITY

FORMAT_VERSION = 1
"""Version of the attributes and the layout below; readers do not support newer versions."""
KEY = "light_field"
"""The attribute of the group that contains all others."""
ARRAY = "samples"
"""The name of the array in the group."""
AXES = ("v", "u", "t", "s", "channel")
UNITS = {"u": "m", "v": "m", "s": "1", "t": "1"}
PICTURES = "vcc.picture"
"""Name of the codec of `vcc.store.picture_codec` in Zarr."""
DTYPES = ("uint8", "uint16", "float16", "float32")

SETTINGS = "settings"
"""Key in a store's description for the settings of the store, next to the description of its maker."""

Transfer = Literal["linear", "srgb"]


@dataclass(frozen=True, eq=False, repr=False)
class Attributes(Brief):
    """The attributes of a store.

    Args:
        frame: 5×5 matrix, from indices (i, j, k, l, 1) to rays (u, v, s, t, 1), metres and slopes.
        transfer: ``"linear"``: samples are proportional to light; ``"srgb"``: samples are codes of IEC 61966-2-1.
        channel_names: a name for each channel, or None.
        disparity_range: (lowest, highest), pixels per view along u; None if unknown.
        provenance: origin of the light field, as JSON data.
        description: everything that the samples depend on, as JSON data, so that views are never mixed; or None.
        lossy: codec, quality and measured PSNR; None for lossless samples.
        complete: whether all views are present.
        sample: ``"mean"`` or ``"point"``, see `vcc.LightField`; ``"mean"`` for stores without this attribute.
        identity: a random text drawn when the store is made (`vcc.store.held`); None for older stores.
        wavelengths: in the middle of each channel's band, metres, or None; stores without the attribute have none.
        filling: views that were not recorded; stores without the attribute have none.
    """

    frame: Affine
    transfer: Transfer = "linear"
    channel_names: tuple[str, ...] | None = None
    disparity_range: tuple[float, float] | None = None
    provenance: dict[str, Any] = field(default_factory=dict)
    description: dict[str, Any] | None = None
    lossy: dict[str, Any] | None = None
    complete: bool = False
    sample: Sample = "mean"
    identity: str | None = None
    wavelengths: tuple[float, ...] | None = None
    filling: Filling | None = None

    def as_json(self) -> dict[str, Any]:
        """The attributes as JSON data."""
        wavelengths = {} if self.wavelengths is None else {"wavelengths": list(self.wavelengths)}
        filling = {} if self.filling is None else {"filling": self.filling.lists()}
        return {
            "format_version": FORMAT_VERSION,
            IDENTITY: self.identity,
            "axes": list(AXES),
            "units": UNITS,
            "frame": self.frame.matrix.tolist(),
            "transfer": self.transfer,
            "sample": self.sample,
            "channel_names": None if self.channel_names is None else list(self.channel_names),
            **wavelengths,
            **filling,
            "disparity_range": None if self.disparity_range is None else list(self.disparity_range),
            "provenance": plain(self.provenance, "provenance"),
            "description": None if self.description is None else plain(self.description, "description"),
            "lossy": None if self.lossy is None else plain(self.lossy, "lossy"),
            "complete": self.complete,
        }

    @classmethod
    def from_json(cls, stated: Any, path: Path) -> Attributes:
        """Read the attributes of the store at ``path``.

        Raises:
            InputError: not a light field, a newer version, or an attribute that is missing or invalid (named).
        """
        if not isinstance(stated, dict):
            raise InputError(
                f'{path} is a Zarr group, but not a light field: its attributes have no "{KEY}". See '
                "docs/store.md for the format of a store"
            )
        check_version(path, stated.get("format_version"), FORMAT_VERSION)
        missing = [name for name in ("frame", "transfer", "complete") if name not in stated]
        if missing:
            raise InputError(f"{path}: its attributes do not state {', '.join(missing)} (see docs/store.md)")
        if tuple(stated.get("axes", AXES)) != AXES or stated.get("units", UNITS) != UNITS:
            raise InputError(
                f"{path}: axes are {list(AXES)} and units {UNITS}, not {stated.get('axes')} and "
                f"{stated.get('units')}"
            )
        filling = stated.get("filling")
        try:
            made = cls(
                frame=Affine(np.array(stated["frame"], dtype=np.float64)),
                transfer=stated["transfer"],
                channel_names=_tuple(stated.get("channel_names")),
                disparity_range=_tuple(stated.get("disparity_range")),
                provenance=stated.get("provenance") or {},
                description=stated.get("description"),
                lossy=stated.get("lossy"),
                complete=stated["complete"],
                sample=stated.get("sample", "mean"),
                identity=stated.get(IDENTITY),
                wavelengths=_tuple(stated.get("wavelengths")),
                filling=None if filling is None else Filling.of_lists(filling, str(path)),
            )
        except (TypeError, ValueError, OverflowError) as error:
            raise InputError(f"{path}: its attributes cannot be used: {error}") from None
        made.check(str(path))
        return made

    def check(self, owner: str, channels: int | Literal["unknown"] | None = "unknown") -> None:
        """Raise for attributes that no light field has.

        Raises:
            InputError: an invalid attribute; the message starts with ``owner``.
        """
        if self.frame.dimensions != 4 or not self.frame.is_invertible():
            raise InputError(f"{owner}: frame is an invertible 5×5 map of indices to rays, not\n{self.frame!r}")
        checks.one_of(f"{owner}: transfer", self.transfer, get_args(Transfer))
        checks.one_of(f"{owner}: sample", self.sample, get_args(Sample))
        if not isinstance(self.identity, str | None):
            raise InputError(f"{owner}: identity is a text, not {self.identity!r}")
        if not isinstance(self.complete, bool):
            raise InputError(f"{owner}: complete is true or false, not {self.complete!r}")
        if self.disparity_range is not None:
            given = self.disparity_range
            numbers = len(given) == 2 and all(isinstance(n, int | float) and math.isfinite(n) for n in given)  # type: ignore[redundant-expr]
            if not (numbers and given[0] <= given[1]):
                raise InputError(f"{owner}: disparity_range is (lowest, highest), not {given}")
        if self.channel_names is not None and channels != "unknown" and len(self.channel_names) != (channels or 0):
            raise InputError(
                f"{owner}: {len(self.channel_names)} channel_names for {channels or 'no'} channels: give one each"
            )
        if self.wavelengths is not None:
            count = None if channels == "unknown" else channels or 1
            all_checked(f"{owner}: wavelengths", self.wavelengths, count)

    def finished(self, lossy: dict[str, Any] | None) -> Attributes:
        """Copy of the attributes for a complete store."""
        return replace(self, complete=True, lossy=lossy)


def check_version(path: Path, stated: Any, newest: int) -> None:
    """Check the version of a format that a file states.

    Raises:
        InputError: it is no version, or newer than ``newest``.
    """
    if checks.whole_number_between(f"{path}: format_version", stated, 1) > newest:
        raise InputError(f"{path} has format_version {stated}, and this vcc reads up to {newest}: use a newer vcc")


def written_here() -> dict[str, Any]:
    """Default provenance."""
    return {"written_by": f"vcc {VERSION}"}


def plain(value: Any, name: str) -> Any:
    """A value as JSON data: tuples become lists, and non-finite numbers the texts that Zarr uses for them.

    Raises:
        InputError: JSON cannot represent the value.
    """
    if isinstance(value, dict):
        return {str(key): plain(item, f"{name}.{key}") for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item, name) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist(), name)
    if isinstance(value, np.generic):
        return plain(value.item(), name)
    if isinstance(value, float) and not math.isfinite(value):
        return "NaN" if math.isnan(value) else ("Infinity" if value > 0 else "-Infinity")
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, Path):
        return str(value)
    raise InputError(
        f"{name} of a store is kept as JSON: words, numbers, lists and dictionaries, not {type(value).__name__}"
    )


def same(one: Any, other: Any) -> bool:
    """Whether two JSON values are equal, regardless of the order of keys."""
    return json.dumps(one, sort_keys=True) == json.dumps(other, sort_keys=True)


def difference(there: Any, wanted: Any, name: str = "") -> str:
    """Text for the first difference between two descriptions."""
    if isinstance(there, dict) and isinstance(wanted, dict):
        for key in [*there, *(key for key in wanted if key not in there)]:
            if not same(there.get(key), wanted.get(key)):
                inner = name if not name and key in ("maker", SETTINGS) else f"{name}.{key}".lstrip(".")
                return difference(there.get(key), wanted.get(key), inner)
    one, other = (text if len(text) < 200 else f"{text[:197]}…" for text in (f"{there!r}", f"{wanted!r}"))
    return f"{name} is {one} there and {other} now"


def _tuple(value: Any) -> Any:
    return None if value is None else tuple(value)
