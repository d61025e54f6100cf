"""Readers: what a case opens with, and what is kept of what it reads."""

from __future__ import annotations

import hashlib
import math
from pathlib import Path
from typing import Any

import numpy as np

import vcc
from vcc.cli.decode_lenslets import _listed
from vcc.cli.info import describe
from vcc.dataset import open_dataset
from vcc.files.pictures import read_grey
from vcc.formats import open_unstructured, read_ground_truth, read_lytro
from vcc.formats.poses import read_poses
from vcc.motion import load_moving_camera
from vcc.prescriptions import read_prescription
from vcc.sources.meshes import loaded
from vcc.sources.mitsuba.renderer import _contents
from vcc.sources.pbrt import PbrtScene
from vcc.sources.splats import read_splats
from vcc.store import open_store, open_video
from vcc.sweeps import open_sweep

Read = dict[str, Any]
"""``digest`` of all that was read, and whether it is ``sane``: no radiance is NaN, infinite or negative."""


def field(path: Path, **options: Any) -> Read:
    lf = vcc.open_light_field(path, **options)
    values = np.asarray(lf.values)
    return _read(values, sane=_is_light(values) and bool(np.isfinite(lf.frame.matrix).all()))


def store(path: Path) -> Read:
    stored = open_store(path)
    stored.check_complete()
    values = np.asarray(stored.read().values)
    return _read(values, sane=_is_light(values))


def store_with_depth(path: Path) -> Read:
    stored = open_store(path)
    stored.check_complete()
    maps = stored.disparity.maps()
    return _read(np.asarray(stored.read().values), maps.values, maps.views, maps.unmatched)


def light_field_video(path: Path) -> Read:
    frames = open_video(path)
    values = [np.asarray(frame.read().values) for frame in frames]
    return _read(frames.times, frames.between, *values, sane=all(map(_is_light, values)))


def sweep(path: Path) -> Read:
    swept = open_sweep(path)
    pictures = [swept[place].values for place in np.ndindex(*swept.shape) if swept.done[place]]
    return _read(swept.table, *pictures)


def dataset(path: Path) -> Read:
    pairs = open_dataset(path)
    return _read(*(pair[name] for pair in pairs for name in pair))


def poses(path: Path) -> Read:
    """Photographs with poses, and the plane of their cameras."""
    views = open_unstructured(path)
    shots = views.photographs.photographs
    facts = views.facts()
    finite = all(np.isfinite(shot.centre).all() and np.isfinite(shot.rotation).all() for shot in shots)
    said = [(shot.lens.model, shot.lens.width, sorted(shot.lens.parameters.items())) for shot in shots]
    return _read(facts, said, *(shot.centre for shot in shots), sane=finite)


def lytro(path: Path) -> Read:
    raw = read_lytro(path)
    return _read(raw.mosaic, sane=bool(np.isfinite(raw.linear()).all()))


def truth(path: Path) -> Read:
    found = read_ground_truth(path)
    return _read(found.disparity, found.depth)


def camera(path: Path) -> Read:
    return _read(vcc.load_camera(path))


def moving_camera(path: Path) -> Read:
    moving = load_moving_camera(path)
    return _read(moving.camera, moving.courses, moving.shutter)


def lens(path: Path) -> Read:
    read = vcc.load_lens(path)
    figures = [read.focal_length, read.length, *np.ravel(read.matrix)]
    return _read(read, sane=not any(math.isnan(figure) for figure in figures))


def lens_2(path: Path) -> Read:
    """The second configuration of a lens."""
    read = read_prescription(path, configuration=2).first_order()
    return _read(read, sane=not math.isnan(read.focal_length))


def mask(path: Path) -> Read:
    values = read_grey(path)
    return _read(values, sane=_is_light(values))


def centres(path: Path) -> Read:
    return _read(*_listed(path))


def pbrt(path: Path) -> Read:
    return _read(PbrtScene.read(path))


def mitsuba(path: Path) -> Read:
    return _read(_contents(path, {}))


def mesh(path: Path) -> Read:
    return _read(loaded(path)[0])


def splats(path: Path) -> Read:
    cloud = read_splats(path)
    values = [cloud.positions, cloud.sizes, cloud.rotations, cloud.opacities, cloud.harmonics]
    return _read(*values, sane=all(bool(np.isfinite(each).all()) for each in values))


def scene_cameras(path: Path) -> Read:
    return _read(read_poses(path))


def info(path: Path) -> Read:
    """What ``vcc info`` says of a path of any kind."""
    return _read(describe(path))


def _read(*things: Any, sane: bool = True) -> Read:
    state = hashlib.sha1()
    for thing in things:
        if isinstance(thing, np.ndarray):
            state.update(f"{thing.shape}{thing.dtype}".encode() + np.ascontiguousarray(thing).tobytes())
        else:
            state.update(repr(thing).encode("utf-8", "surrogatepass"))
    return {"digest": state.hexdigest(), "sane": sane}


def _is_light(values: np.ndarray) -> bool:
    return bool(values.dtype.kind not in "f" or (np.isfinite(values).all() and (values >= 0).all()))
