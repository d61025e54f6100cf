"""A run of the zoo: trials of cameras, scenes and decoders, kept by content in a Zarr group."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.notices import Notices
from vcc.base.progress import Progress, tell
from vcc.base.reading import check_path, expanded, read_bytes, read_json, reading, value_at
from vcc.base.values import fingerprint
from vcc.base.version import VERSION
from vcc.files.atomic import check_parent, refusal
from vcc.files.parts import check_name, clear_folder, part_of
from vcc.files.writer_lock import WriterLock
from vcc.run.executors import Work, worker_pool
from vcc.zoo.bench import ELECTRONICS, LEVELS
from vcc.zoo.decoders import Decoder, Recorded
from vcc.zoo.entrants import OWN, Entrant, FromFile, loaded
from vcc.zoo.pictures import Pictures
from vcc.zoo.scenes import BUILT_IN, identity, scene
from vcc.zoo.task import Task
from vcc.zoo.tasks import TASKS, task_named

Array = NDArray[np.float64]

KEY = "zoo"
FORMAT_VERSION = 2
SHOWN_LEVEL = 1
"""The light level of pictures in strips: dim."""


@dataclass(frozen=True, eq=False, repr=False)
class Trial(Brief):
    """A camera, a scene and some decoders.

    Args:
        task: its name.
        entrant: the camera.
        scene: its name.
        decoders: names, and functions of the user; None for the task's own.
        keys: of the results, one for each decoder.
        seeds: of the noise.
    """

    task: str
    entrant: Entrant
    scene: str
    decoders: Mapping[str, FromFile | None]
    keys: tuple[str, ...]
    seeds: int


@dataclass(frozen=True, eq=False, repr=False)
class Scored(Brief):
    """The result of one camera, scene and decoder.

    Args:
        key: fingerprint of all that it depends on.
        about: names, light, control and so on, as JSON.
        scores: (levels, seeds, measures).
        picture: what the decoder made of the first seed at `SHOWN_LEVEL`, one picture of it, uint8 of gamma 2.2.
        recording: the recording that it was made of, likewise; the middle one of several exposures.
        truth: likewise.
    """

    key: str
    about: Mapping[str, Any]
    scores: Array
    picture: NDArray[np.uint8]
    recording: NDArray[np.uint8]
    truth: NDArray[np.uint8]


def run(
    task: str,
    output: str | PathLike[str],
    *,
    scenes: Sequence[str] = BUILT_IN,
    seeds: int = 2,
    cameras: Sequence[Path] = (),
    own_decoders: Sequence[str] = (),
    without: Sequence[str] = (),
    executor: Any = None,
    progress: Progress | None = None,
) -> int:
    """Score cameras, scenes and decoders, except those whose results the store has already.

    Args:
        task: a name of `vcc.zoo.TASKS`.
        output: folder of the store, a Zarr group; created, or continued.
        scenes: names of scenes, or paths of light fields and splats (`vcc.zoo.scenes.scene`).
        seeds: number of recordings of each scene at each light level.
        cameras: further camera files, each with all decoders.
        own_decoders: further decoders, "my.py:decode", each with all cameras, or with those for which its
            attribute ``takes``, a function of a camera, is true.
        without: names of decoders or cameras to leave out.
        executor: runs the trials: a `concurrent.futures.Executor` or a ``dask.distributed.Client``; each worker
            makes the scenes itself, and reads files by the same paths. None uses this process.
        progress: called with (done, total) in results.

    Returns:
        The number of results that were computed; the others were in the store.

    Raises:
        InputError: unknown task or scene; a camera or decoder that does not fit; an output that is something
            else; an error of the disk. Results that were finished are kept.
    """
    chosen = task_named(task)
    if seeds < 1:
        raise InputError(f"--seeds is {seeds}: one recording or more")
    entrants = _entrants(chosen, cameras)
    functions: dict[str, FromFile | None] = dict.fromkeys(chosen.decoders)
    functions |= {f"{Path(each.path).stem}:{each.function}": each for each in map(FromFile.of, own_decoders)}
    names = {each.name for each in entrants} | set(functions)
    for name in without:
        if name not in names:
            raise InputError(f"--without {name}: the task {task} has {', '.join(sorted(names))}")
    entrants = [each for each in entrants if each.name not in without]
    functions = {name: function for name, function in functions.items() if name not in without}
    contents = {name: identity(name) for name in scenes}
    trials = [
        _trial(chosen, each, name, content, functions, seeds)
        for name, content in contents.items()
        for each in entrants
    ]
    for trial in trials:
        if OWN in trial.entrant.decoders and not trial.keys:
            raise InputError(
                f"no decoder of the task {task} suits {trial.entrant.name}: give --decoder my.py:decode"
            )
    trials = [trial for trial in trials if trial.keys]
    with Store(output) as store:
        kept = store.keys()
        listed = [key for trial in trials for key in trial.keys]
        done, total, made = sum(key in kept for key in listed), len(listed), 0
        todo = [_lacking(trial, kept) for trial in trials if not kept.issuperset(trial.keys)]
        with Notices().gathered():  # around those of threads
            for results in _performed(todo, executor):
                for result in results:
                    store.put(result)
                made += len(results)
                tell(progress, done + made, total)
        store.list(task, listed)
    return made


def _entrants(task: Task, cameras: Sequence[Path]) -> list[Entrant]:
    listed = task.entrants(
        [Entrant.single(path.stem, loaded(path, task.check), source=str(path)) for path in cameras]
    )
    names = [each.name for each in listed]
    if len(set(names)) < len(names):
        raise InputError(f"two cameras have one name, out of {', '.join(names)}: rename the file")
    return listed


def _trial(
    task: Task,
    entrant: Entrant,
    name: str,
    content: str,
    functions: Mapping[str, FromFile | None],
    seeds: int,
) -> Trial:
    rules = (
        VERSION,
        FORMAT_VERSION,
        task.name,
        task.blurs,
        tuple(LEVELS.values()),
        ELECTRONICS,
        seeds,
    )
    exposures = tuple((each.camera, each.time, each.filters) for each in entrant.exposures)
    options = tuple(sorted(entrant.options.items()))
    known = (*rules, entrant.name, entrant.controls, exposures, options, name, content)
    suited = {
        decoder: function
        for decoder, function in functions.items()
        if (function.takes(entrant.camera) if function else not entrant.decoders or decoder in entrant.decoders)
    }
    keys = tuple(
        fingerprint(*known, decoder, () if function is None else (function.function, function.digest))
        for decoder, function in suited.items()
    )
    return Trial(task.name, entrant, name, suited, keys, seeds)


def _lacking(trial: Trial, kept: set[str]) -> Trial:
    """The trial with the decoders whose results are missing."""
    pairs = [(name, key) for name, key in zip(trial.decoders, trial.keys, strict=True) if key not in kept]
    functions = {name: trial.decoders[name] for name, _ in pairs}
    keys = tuple(key for _, key in pairs)
    return Trial(trial.task, trial.entrant, trial.scene, functions, keys, trial.seeds)


def _performed(trials: Sequence[Trial], executor: Any) -> Iterator[list[Scored]]:
    if executor is None:
        for trial in trials:
            yield _scored(trial)
    elif trials:
        for _, results in worker_pool(executor).each(Work(scored, None), trials):
            yield results


def scored(_: None, trial: Trial) -> list[Scored]:
    """The results of a trial, as a task."""
    return _scored(trial)


def _scored(trial: Trial) -> list[Scored]:
    """The results of a trial.

    Raises:
        InputError: a decoder that fails, or returns something else than its task takes.
    """
    task, made, entrant = TASKS[trial.task], scene(trial.scene), trial.entrant
    truth, notices = task.truth(made), Notices()
    with notices.gathered():
        taken = Pictures.of(task, entrant, made)
    recordings = [
        [taken.recorded(electrons, seed) for seed in range(trial.seeds)] for electrons in LEVELS.values()
    ]
    found = []
    for (name, function), key in zip(trial.decoders.items(), trial.keys, strict=True):
        decode: Decoder = task.decoders[name] if function is None else function.load()
        scores = np.empty((len(LEVELS), trial.seeds, len(task.all_measures)))
        shown = truth
        for level, row in enumerate(recordings):
            for seed, recorded in enumerate(row):
                begun = time.perf_counter()
                with Notices().gathered():  # warnings of decoders, of single recordings, are dropped
                    decoded = task.checked(_decoded(decode, name, recorded), name)
                seconds = time.perf_counter() - begun
                scores[level, seed] = (*task.scored(decoded, truth), seconds)
                if (level, seed) == (SHOWN_LEVEL, 0):
                    shown = decoded
        about = {
            "task": task.name,
            "camera": entrant.name,
            "decoder": name,
            "scene": trial.scene,
            "controls": list(entrant.controls),
            "light": round(taken.light, 6),
            "source": entrant.source,
            "missing_rays": round(taken.missing_rays, 4),
            "sampling_error": max(taken.samplings),
            "note": made.note,
            "warnings": notices.texts,
        }
        first = recordings[SHOWN_LEVEL][0].values
        pictures = (task.shown(shown), first if first.ndim == 2 else first[len(first) // 2], task.shown(truth))
        found.append(Scored(key, about, scores, *(_grey(picture) for picture in pictures)))
    return found


def _decoded(decode: Decoder, name: str, recorded: Recorded) -> Any:
    try:
        return decode(recorded)
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"the decoder {name} fails: {type(error).__name__}: {error}") from error


def _grey(picture: Array) -> NDArray[np.uint8]:
    """8 bits, of gamma 2.2."""
    return np.rint(255 * np.clip(picture, 0, 1) ** (1 / 2.2)).astype(np.uint8)


class Store:
    """Results in a Zarr group, each in a group of its own, named by its key; it appears complete or not at all.

    Args:
        path: the folder.

    Raises:
        InputError: the path is something else, another process writes it, or the disk reports an error.
    """

    def __init__(self, path: str | PathLike[str]) -> None:
        self.path = expanded(path)
        check_name(self.path)
        check_parent(self.path)
        if os.path.lexists(self.path):
            stated(self.path)
        self._lock = WriterLock(self.path)

    def __enter__(self) -> Store:
        import zarr

        try:
            if not self.path.exists():
                attributes = {KEY: {"format_version": FORMAT_VERSION, "listed": {}}}
                zarr.create_group(self.path, zarr_format=3, attributes=attributes)
            clear_folder(self.path, self._lock.patience)
        except BaseException:
            self._lock.give_back()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.give_back()

    def keys(self) -> set[str]:
        """The keys of all results in the store."""
        return {
            each.name for each in self.path.iterdir() if (each / "zarr.json").is_file() and each.name[0] != "."
        }

    def put(self, result: Scored) -> None:
        """Write a result.

        Raises:
            InputError: the disk reports an error.
        """
        import zarr

        target = self.path / result.key
        part = part_of(target)
        try:
            group = zarr.create_group(part, zarr_format=3, attributes={KEY: dict(result.about)})
            for name in ("scores", "picture", "recording", "truth"):
                group.create_array(name, data=getattr(result, name))
            if not target.exists():  # two equal cameras have one result
                part.rename(target)
        except OSError as error:
            raise InputError(f"{target} could not be written: {refusal(error, part)}") from error

    def list(self, task: str, keys: Sequence[str]) -> None:
        """State which results belong to the latest run of a task."""
        import zarr

        group = zarr.open_group(self.path, mode="r+")
        about: Any = group.attrs[KEY]
        group.attrs[KEY] = {**about, "listed": {**about["listed"], task: list(dict.fromkeys(keys))}}


def stated(path: Path) -> dict[str, Any]:
    """The attributes of a store of the zoo.

    Raises:
        InputError: it is something else, or newer than this version supports.
    """
    check_path(path, "store of the zoo")
    if not (path / "zarr.json").is_file():
        raise InputError(f"{path} is no store of the zoo")
    found = value_at(read_json(read_bytes(path / "zarr.json"), str(path)), "attributes", KEY)
    if not isinstance(found, dict) or not isinstance(found.get("listed"), dict):
        raise InputError(f"{path} is no store of the zoo")
    if found.get("format_version") != FORMAT_VERSION:
        raise InputError(
            f"{path} has format_version {found.get('format_version')}: use another vcc, or a new store"
        )
    return found


def results(path: str | PathLike[str], task: str) -> list[Scored]:
    """The results of the latest run of a task.

    Raises:
        InputError: no store, no run of this task, or a damaged result.
    """
    import zarr

    folder = expanded(path)
    listed = stated(folder)["listed"].get(task)
    if not listed:
        raise InputError(f"{folder} has no finished run of the task {task}: vcc zoo run --task {task} -o {folder}")
    found = []
    for key in listed:
        with reading(folder / key, "a result of the zoo"):
            group = zarr.open_group(folder / str(key), mode="r")
            arrays = [np.asarray(group[name]) for name in ("scores", "picture", "recording", "truth")]
            about: Any = group.attrs[KEY]
            found.append(Scored(str(key), dict(about), *arrays))
    return found
