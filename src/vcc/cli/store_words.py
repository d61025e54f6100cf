"""What stores are, in words."""

from __future__ import annotations

import math
from typing import Any

from vcc.base.units import short
from vcc.fields.grid import SAMPLES_IN_WORDS
from vcc.store import StoredLightField


def store_facts(stored: StoredLightField, quick: bool) -> dict[str, str]:
    """What a store states, by names.

    Args:
        stored: the store.
        quick: leave out what takes reading views.
    """
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
        lines["lossy"] = loss(stored.lossy)
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
    return lines


def written(made: StoredLightField, packing: str) -> str:
    """What was written, in a line or two."""
    nv, nu, nt, ns = made.shape[:4]
    samples = math.prod(made.shape) * made.dtype.itemsize
    packed = made.stored_bytes
    words = (
        f"{made.path}: {nv}×{nu} views of {ns}×{nt} pixels, {made.dtype} {made.transfer}, {packing}: "
        f"{packed / 1e6:,.1f} MB, {samples / packed:.1f} times smaller"
    )
    return words if made.lossy is None else f"{words}\n{loss(made.lossy)}"


def loss(lossy: dict[str, Any]) -> str:
    """What lossy compression did, in words."""
    words = f"{lossy.get('codec')}, quality {lossy.get('quality')}"
    if not isinstance(lossy.get("psnr"), int | float):
        return f"{words}: no view was changed" if lossy.get("psnr") == "Infinity" else words
    row, column = lossy["worst_view"]
    worst = lossy["worst_psnr"]
    return f"{words}: PSNR {lossy['psnr']:.1f} dB, at worst {worst:.1f} dB in view ({row}, {column})"
