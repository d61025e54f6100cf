"""Reports on stores as text."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from vcc.advice.words import distance_in_words
from vcc.base.showing import spread
from vcc.base.units import short
from vcc.base.wavelengths import as_text
from vcc.fields.grid import SAMPLES_IN_WORDS, Grid
from vcc.store import StoredLightField, StoredVideo
from vcc.store.video_layout import Between

LOOKED_AT = 3
"""Frames from which a video's size on disk and its brightness are estimated."""
BEYOND = 0.3
"""Pixels per view beyond infinity that count as noise of the measurement far away."""
WRONG = "The spacing, focus distance or orientation of the views is wrong"
EVENLY = 1e-6
"""Relative difference of gaps between frames that still counts as evenly spaced."""
BETWEEN_IN_WORDS: dict[Between, str] = {
    "linear": "light of both, mixed by time (linear)",
    "held": "light of the first, until the second (held)",
}
"""The interpolation between two frames, as text."""


def store_facts(stored: StoredLightField, quick: bool) -> dict[str, str]:
    """Facts of a store, by name.

    Args:
        stored: the store.
        quick: omit everything that requires reading views.
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
    if stored.wavelengths is not None:
        lines["bands"] = as_text(stored.wavelengths).partition(" ")[2]
    if stored.filling is not None and stored.filling.words:
        lines["filled"] = stored.filling.words
    lines |= _assumed(stored.provenance)
    if stored.lossy is not None:
        lines["lossy"] = loss(stored.lossy)
    known = stored.disparity_range
    if known is None and not quick and stored.complete and not missing:
        known = stored.measured_disparity_range()
    if known is not None:
        source = "measured" if stored.disparity_range is None else "stated"
        lines["disparities"] = f"{known[0]:.3g} to {known[1]:.3g} pixels per view ({source})"
        lines["disparities"] += f": {places_of(stored.grid, *known)}"
    for name, value in stored.provenance.items():
        if not isinstance(value, dict | list):
            lines[str(name).replace("_", " ")] = str(value)
    return lines


def places_of(grid: Grid, low: float, high: float) -> str:
    """Distances of objects with these disparities, pixels per view along u, as text; also beyond infinity."""
    near, far = grid.distance_of(high), grid.distance_of(low)
    if 0 < near < far:
        return f"objects {short(near, digits=3)} to {distance_in_words(far)} away"
    if near > 0:
        words, beyond = f"objects {short(near, digits=3)} to infinity away", abs(grid.disparity_of(math.inf) - low)
        return words if beyond <= BEYOND else f"{words}, and {beyond:.2g} pixels per view beyond. {WRONG}"
    return f"all beyond infinity: light that a lens has gathered; or {WRONG[0].lower()}{WRONG[1:]}"


def _assumed(provenance: dict[str, Any]) -> dict[str, str]:
    """The camera parameters that were assumed, by name."""
    assumed = provenance.get("assumed")
    if not assumed:
        return {}
    return {"assumed": f"{', '.join(map(str, assumed))}: the files it was made from did not state them"}


def video_facts(video: StoredVideo, quick: bool) -> dict[str, str]:
    """Facts of a video, by name.

    Args:
        video: the video.
        quick: omit everything that requires reading views.
    """
    lines = {"format": "Zarr store of vcc, a video"}
    if not video:
        return lines | {"frames": "none yet"}
    first, last = video[0], video.times[-1]
    of_each = store_facts(first, quick=True)
    nv, nu = first.shape[:2]
    in_memory = len(video) * nv * nu * first.view_bytes
    size = f"{in_memory / 1e6:,.1f} MB in memory, linear"
    if not quick:
        some = looked_at(video)
        packed = sum(video[number].stored_bytes for number in some) / len(some) * len(video)
        size = f"{'about ' if len(video) > LOOKED_AT else ''}{packed / 1e6:,.1f} MB on disk, {size}"
    lines |= {
        "frames": f"{len(video)}, {short(video.times[0], 'time')} to {short(last, 'time')}{_apart(video.times)}",
        "between frames": BETWEEN_IN_WORDS[video.between],
        **{name: of_each[name] for name in ("views", "pictures", "samples")},
        "size": size,
        "cameras": of_each["cameras"],
    }
    lines |= _assumed(video.provenance)
    for name, value in video.provenance.items():
        if not isinstance(value, dict | list):
            lines[str(name).replace("_", " ")] = str(value)
    return lines


def looked_at(video: StoredVideo) -> list[int]:
    """The frames that are examined: all, or a few of many."""
    return spread(len(video), LOOKED_AT)


def _apart(times: tuple[float, ...]) -> str:
    """The gaps between frames, as the end of a sentence."""
    if len(times) < 2:
        return ""
    gaps = [after - before for before, after in pairwise(times)]
    least, most = min(gaps), max(gaps)
    if most - least <= EVENLY * most:
        return f", every {short((times[-1] - times[0]) / len(gaps), 'time')}"
    return f", {short(least, 'time')} to {short(most, 'time')} apart"


def written(made: StoredLightField, packing: str) -> str:
    """A summary of a written store, in a line or two."""
    nv, nu, nt, ns = made.shape[:4]
    samples = math.prod(made.shape) * made.dtype.itemsize
    packed = made.stored_bytes
    words = (
        f"{made.path}: {nv}×{nu} views of {ns}×{nt} pixels, {made.dtype} {made.transfer}, {packing}: "
        f"{packed / 1e6:,.1f} MB, {samples / packed:.1f} times smaller"
    )
    return words if made.lossy is None else f"{words}\n{loss(made.lossy)}"


def video_written(made: StoredVideo, before: int) -> str:
    """A summary of the frames appended to a video, in a line.

    Args:
        made: the video.
        before: number of frames before.
    """
    new = "none of them new" if before == len(made) else f"{len(made) - before} of them new" if before else ""
    nv, nu, nt, ns = made.shape[:4]
    first, frames = made[0], ", ".join(filter(None, (f"{len(made)} frames", new)))
    return (
        f"{made.path}: {frames}, {made.times[0]:g} s to {made.times[-1]:g} s, each {nv}×{nu} views of {ns}×{nt} "
        f"pixels, {first.dtype} {first.transfer}"
    )


def loss(lossy: dict[str, Any]) -> str:
    """The effect of lossy compression, as text."""
    words = f"{lossy.get('codec')}, quality {lossy.get('quality')}"
    if not isinstance(lossy.get("psnr"), int | float):
        return f"{words}: no view was changed" if lossy.get("psnr") == "Infinity" else words
    row, column = lossy["worst_view"]
    worst = lossy["worst_psnr"]
    return f"{words}: PSNR {lossy['psnr']:.1f} dB, at worst {worst:.1f} dB in view ({row}, {column})"
