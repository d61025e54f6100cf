"""The card of a data set: its contents, units and origin; for programs as JSON, for people as text."""

from __future__ import annotations

import math
import platform
from typing import Any

import numpy as np

from vcc.base.version import VERSION
from vcc.dataset.recipe import Recipe
from vcc.dataset.recording_pairs import Pair
from vcc.store.attributes import plain

FORMAT_VERSION = 1
CAMERA = "camera.toml"
ON_SENSOR = "oriented as on the sensor: inverted, row 0 at the sensor's top"

ARRAYS = {
    "recording": (
        "DN",
        f"digital numbers, linear, with noise by EMVA 1288; {ON_SENSOR}. (DN − dark_dn) / dn_per_radiance is the "
        "radiance",
    ),
    "irradiance": ("radiance × sr", f"irradiance without noise; {ON_SENSOR}"),
    "sharp": (
        "radiance",
        "all-in-focus image, linear, without noise: through a pinhole in the middle of the middle view, by the "
        f"camera's first-order optics; on the pixels of the recording. 0 where the views end; {ON_SENSOR}",
    ),
    "depth": (
        "m",
        "distance along the axis from the entrance plane, of the pixel of the middle view that is nearest to each "
        f"pixel of the sharp image; NaN where the views end; {ON_SENSOR}",
    ),
    "views": (
        "radiance",
        "the views (v, u, t, s[, channel]) over the window, upright, in pixels of the light field; views_frame "
        "maps (i, j, k, l, 1) to the ray (u, v, s, t, 1)",
    ),
    "psf": (
        "share of the light",
        "images of points on the axis at psf_distances, (distance, row, column), in pixels of the sensor, "
        f"centred; {ON_SENSOR}",
    ),
}
"""Unit and meaning of each array."""

NUMBERS = {
    "pair": "number of the pair",
    "scene": "number of the scene in this card",
    "camera": "number of the camera in this card",
    "row": "first row of the window on the camera's sensor, before a flip",
    "column": "first column of the window, before a flip",
    "flip_y": "1 if scene and camera are mirrored, so that rows are reversed; the noise is not",
    "flip_x": "1 if scene and camera are mirrored, so that columns are reversed; the noise is not",
    "gain": "factors of the light in each channel, before the noise; included in sharp and views",
    "exposure_seconds": "exposure time",
    "noise_seed": "seed of the noise (and of the fixed pattern, if there is one)",
    "saturated": "share of saturated pixels",
    "dark_dn": "mean digital number without light",
    "dn_per_radiance": "digital numbers above dark_dn of a uniform scene of radiance 1, in each channel",
    "irradiance_of_white": "irradiance of a uniform scene of radiance 1, in each channel",
    "missing_rays": "share of the camera's rays that are outside the light field",
    "depth_source": "where the disparities of the scene come from",
    "depth_unmatched": "share of its pixels at which views differ at the estimated disparity; 0 if given",
    "views_frame": "5×5, see views",
}
"""Meaning of each number of a pair."""


def card_of(recipe: Recipe, per_shard: int, licence: str, first: Pair) -> dict[str, Any]:
    """Everything about a data set, as JSON.

    Args:
        recipe: of the pairs.
        per_shard: number of pairs in each shard.
        licence: as given by the user.
        first: a pair, whose arrays have the shapes of all.
    """
    sensor = recipe.cameras.sensors[0]
    cameras = [recipe.cameras.said(number) for number in range(len(recipe.cameras))]
    listed = {}
    for name, values in first.arrays.items():
        known = "irradiance" if name == "recording" and sensor.electronics is None else name
        unit, meaning = ARRAYS[known]
        listed[name] = {"shape": values.shape, "dtype": values.dtype.name, "unit": unit, "meaning": meaning}
    found = {
        "format_version": FORMAT_VERSION,
        "written_by": f"vcc {VERSION}",
        "libraries": {"python": platform.python_version(), "numpy": np.__version__},
        "pairs": recipe.count,
        "pairs_per_shard": per_shard,
        "shards": math.ceil(recipe.count / per_shard),
        "arrays": listed,
        "numbers": {name: NUMBERS[name] for name in first.numbers},
        "color_filter": None if sensor.electronics is None else sensor.electronics.color_filter,
        "filter_tile": ((0,),) if sensor.electronics is None else sensor.electronics.tile,
        "wavelengths_m": recipe.scenes[0].grid.wavelengths,
        "scenes": [scene.name for scene in recipe.scenes],
        "cameras": cameras,
        "seed": recipe.seed,
        "licence": licence,
        "description": recipe.described(),
    }
    stated: dict[str, Any] = plain(found, "dataset")
    return stated


def as_text(card: dict[str, Any], recipe: Recipe, how_to_read: str) -> str:
    """The card for people, Markdown.

    Args:
        card: from `card_of`.
        recipe: of the pairs.
        how_to_read: a sentence about the files.
    """
    rows = [
        f"| {name} | {'×'.join(map(str, each['shape']))} {each['dtype']} | {each['unit']} | {each['meaning']} |"
        for name, each in card["arrays"].items()
    ]
    exposure = recipe.exposure if isinstance(recipe.exposure, str) else f"{recipe.exposure} s"
    settings = [
        ("cameras", f"{len(card['cameras'])}, drawn uniformly for each pair; the first one is in {CAMERA}"),
        *((each.name, each.values_in_words) for each in recipe.cameras.varied),
        ("window", "the whole sensor" if recipe.crop is None else f"{recipe.crop} pixels, at a random place"),
        ("flips", "each axis with probability 1/2; the camera is mirrored too" if recipe.flips else "none"),
        ("gain", recipe.gain or "1"),
        ("gain of each channel", recipe.color_gain or "1"),
        ("exposure", exposure),
        ("radiance of a sample value of 1", f"{recipe.radiance:g} W/(m²·sr)"),
        ("psf_distances", f"{recipe.psf_distances} m" if recipe.psf_distances else "none"),
        ("colour filter", card["color_filter"] or "none"),
        ("transfer function", "linear in light, all arrays"),
        ("seed", card["seed"]),
    ]
    lines = [
        "# A data set of recordings and their ground truth",
        "",
        f"{card['pairs']} pairs in {card['shards']} shards, simulated by {card['written_by']}.",
        f"Licence: {card['licence'] or 'not stated; those of the scenes apply'}.",
        "",
        "| array | shape, type | unit | meaning |",
        "|---|---|---|---|",
        *rows,
        "",
        "Intervals (low, high) are drawn uniformly in their logarithm. Neighbouring pairs have the same scene: "
        "shuffle.",
        "",
        *(f"- {name}: {value}" for name, value in settings),
        "",
        "Numbers of each pair:",
        "",
        *(f"- `{name}`: {meaning}" for name, meaning in card["numbers"].items()),
        "",
        *_reference(recipe),
        *(f"- scene {number}: {name}" for number, name in enumerate(card["scenes"])),
        "",
        f"{how_to_read} Or `vcc.dataset.open_dataset(path)`, with either kind of files.",
        "",
    ]
    return "\n".join(lines)


def _reference(recipe: Recipe) -> list[str]:
    """Where the middle view is, if not on the axis: sharp and depth are seen from there."""
    grid = recipe.scenes[0].grid
    j, i = grid.middle_view
    u, v = grid.frame([i, j, (grid.shape[3] - 1) / 2, (grid.shape[2] - 1) / 2])[:2]
    if not {"sharp", "depth"} & set(recipe.truth) or (abs(u) < 1e-9 and abs(v) < 1e-9):
        return []
    return [
        f"`sharp` and `depth` are seen from the middle view, {u * 1e3:.3g} mm beside and {v * 1e3:.3g} mm below "
        "the axis (scene 0): out of focus they are displaced against the recording by that share of the blur.",
        "",
    ]
