"""What ``vcc convert`` does, and what ``vcc info`` says of a store."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vcc.base.errors import InputError
from vcc.cli import options as given
from vcc.cli.console import progress

if TYPE_CHECKING:
    from vcc.light_field import LightField
    from vcc.store import StoredLightField


@dataclass(frozen=True)
class Reading:
    """How to read a light field, as on the command line.

    Args:
        transfer: "auto", "srgb" or "linear".
        spacing: with its unit, or None.
        slope_per_pixel: or None.
        focus_distance: with its unit, or None.
        orientation: see `vcc.open_light_field`.
        layout: what some formats need besides: views, order, every.
    """

    transfer: str
    spacing: str | None
    slope_per_pixel: float | None
    focus_distance: str | None
    orientation: str
    layout: dict[str, Any]

    def light_field(self, source: Path, transfer: str) -> LightField | StoredLightField:
        """The light field, read or (a store) opened, its numbers taken by ``transfer``."""
        return given.read_light_field(
            source,
            transfer,
            self.spacing,
            self.slope_per_pixel,
            self.focus_distance,
            self.orientation,
            **self.layout,
        )


def to_file(source: Path, output: Path, *, kind: str | None, overwrite: bool, reading: Reading) -> str:
    """Convert a light field to a file or folder that is no store, and say what came of it.

    Args:
        source: a folder of views, a file or a store.
        output: whose ending says the format.
        kind: "hci" or "views" for a folder, or None.
        overwrite: whether a file of that name is replaced.
        reading: see `Reading`.

    Raises:
        InputError: an output that is there, or what reading and writing refuse.
    """
    from vcc.formats.writing import save_light_field

    output = free_output(output, overwrite)
    told: Any = kind
    field = reading.light_field(source, reading.transfer)
    with progress("Writing views") as advance:
        return save_light_field(field, output, kind=told, progress=advance).description


def to_store(
    source: Path,
    output: Path,
    *,
    dtype: str | None,
    packing: tuple[str, int],
    chunks: int | None,
    overwrite: bool,
    reading: Reading,
) -> str:
    """Convert a light field to a store and say what came of it.

    Args:
        source: a folder of views, a file or a store.
        output: the store.
        dtype: of its samples, or None.
        packing: codec and its level or quality.
        chunks: rows of pixels, or None.
        overwrite: whether a store of that name is replaced.
        reading: see `Reading`.

    Raises:
        InputError: an output that is there, or what reading and writing refuse.
    """
    from vcc.store import Lossless, Lossy, convert, is_store

    output = free_output(output, overwrite)
    codec: Any = packing[0]
    compression = (Lossy if codec in ("jpegxl", "avif") else Lossless)(codec, packing[1])
    transfer: Any
    if is_store(source):
        transfer, provenance = "linear", None
        field = reading.light_field(source, reading.transfer)
    else:
        field, transfer, assumed = _with_its_codes(source, reading)
        provenance = _provenance(source, assumed)
    with progress("Writing views") as advance:
        made = convert(
            field,
            output,
            transfer=transfer,
            dtype=dtype,
            provenance=provenance,
            chunks=chunks,
            compression=compression,
            overwrite=overwrite,
            progress=advance,
        )
    return _written(made, compression.words)


def store_facts(path: Path, quick: bool) -> str:
    """What a store states, line by line.

    Args:
        path: of the store.
        quick: leave out what takes reading views.

    Raises:
        InputError: what `vcc.store.open_store` refuses.
    """
    from vcc.base.units import short
    from vcc.fields.grid import SAMPLES_IN_WORDS
    from vcc.store import open_store

    stored = open_store(path)
    nv, nu, nt, ns = stored.shape[:4]
    missing = stored.missing()
    colour = "grey" if stored.channels is None else f"{stored.channels} channels"
    names = "" if stored.channel_names is None else f" ({', '.join(stored.channel_names)})"
    packed = stored.stored_bytes
    lines = {
        "format": "Zarr store of vcc",
        "views": f"{nv} × {nu} (rows × columns)" + (f", {len(missing)} missing" if missing else ""),
        "state": "complete" if stored.complete else "not finished",
        "pictures": f"{ns} × {nt} pixels, {colour}{names}, {stored.dtype} {stored.transfer}",
        "samples": SAMPLES_IN_WORDS[stored.sample],
        "size": f"{packed / 1e6:,.1f} MB on disk, {stored.view_bytes * nv * nu / 1e6:,.1f} MB in memory, linear",
        "cameras": stored.grid.geometry,
    }
    if assumed := stored.provenance.get("assumed"):
        lines["assumed"] = f"{', '.join(map(str, assumed))}: the files it was made from did not state them"
    if stored.lossy is not None:
        lines["lossy"] = _loss(stored.lossy)
    known = stored.disparity_range
    if known is None and not quick and stored.complete and not missing:
        known = stored.measured_disparity_range()
    if known is not None:
        source = "measured" if stored.disparity_range is None else "stated"
        lines["disparities"] = f"{known[0]:.3g} to {known[1]:.3g} pixels per view ({source})"
        near, far = stored.distance_of(known[1]), stored.distance_of(known[0])
        if 0 < near < far:
            lines["disparities"] += f": things {short(near, digits=3)} to {short(far, digits=3)} away"
    for name, value in stored.provenance.items():
        if not isinstance(value, dict | list):
            lines[str(name).replace("_", " ")] = str(value)
    width = max(map(len, lines)) + 2
    return "\n".join(f"{name:<{width}}{value}" for name, value in lines.items())


def free_output(output: Path, overwrite: bool) -> Path:
    """A path that may be written to, before the work that it is for."""
    output = output.expanduser()
    if not output.parent.is_dir():
        raise InputError(f"{output} cannot be written: there is no folder {output.parent}; make it first")
    if output.exists() and not overwrite:
        raise InputError(f"{output} is there already: choose another name, or replace it with --overwrite")
    return output


def _with_its_codes(source: Path, reading: Reading) -> tuple[Any, str, list[str]]:
    """A light field with its samples as the files have them, how they stand for light, and what was assumed."""
    from vcc.formats import read_geometry

    facts = read_geometry(source, **reading.layout)
    assumed = [name for name in facts.unknown if getattr(reading, name) is None]
    field: Any = reading.light_field(source, "linear")
    if field.values.dtype.kind != "u":
        return field, "linear", assumed
    return field, facts.transfer if reading.transfer == "auto" else reading.transfer, assumed


def _provenance(source: Path, assumed: list[str]) -> dict[str, Any]:
    from datetime import UTC, datetime

    from vcc import __version__

    return {
        "converted_from": source.expanduser().resolve().name,
        "converted_by": f"vcc {__version__}, vcc convert",
        "converted_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "assumed": assumed,
    }


def _written(made: StoredLightField, packing: str) -> str:
    """What was written, in a line or two."""
    nv, nu, nt, ns = made.shape[:4]
    samples = math.prod(made.shape) * made.dtype.itemsize
    packed = made.stored_bytes
    words = (
        f"{made.path}: {nv}×{nu} views of {ns}×{nt} pixels, {made.dtype} {made.transfer}, {packing}: "
        f"{packed / 1e6:,.1f} MB, {samples / packed:.1f} times smaller"
    )
    return words if made.lossy is None else f"{words}\n{_loss(made.lossy)}"


def _loss(lossy: dict[str, Any]) -> str:
    """What lossy compression did, in words."""
    words = f"{lossy.get('codec')}, quality {lossy.get('quality')}"
    if not isinstance(lossy.get("psnr"), int | float):
        return f"{words}: no view was changed" if lossy.get("psnr") == "Infinity" else words
    row, column = lossy["worst_view"]
    worst = lossy["worst_psnr"]
    return f"{words}: PSNR {lossy['psnr']:.1f} dB, at worst {worst:.1f} dB in view ({row}, {column})"
