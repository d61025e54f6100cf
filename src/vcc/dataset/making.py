"""Making a data set: shards by executors, resumed after a stop."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from typing import Any, Literal, get_args

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.notices import Notices, worked_elsewhere
from vcc.base.progress import Progress, tell
from vcc.base.reading import expanded
from vcc.camera import Camera
from vcc.dataset.card import as_text, card_of
from vcc.dataset.destination import Destination
from vcc.dataset.loading import Pairs, destination_at, open_dataset
from vcc.dataset.recipe import PIECES, Recipe
from vcc.dataset.recording_pairs import Opened, Pair, Recorder
from vcc.dataset.scenes import scenes_of
from vcc.dataset.shards import Shards
from vcc.dataset.zarr_group import ZarrGroup
from vcc.fields.samples import InMemory
from vcc.files.atomic import check_parent
from vcc.files.parts import check_name, clear_leftovers
from vcc.files.writer_lock import WriterLock
from vcc.plan.how import How
from vcc.run.executors import Work, worker_pool
from vcc.run.serialization import check_portable
from vcc.store.attributes import difference, same
from vcc.sweeps.design import Design, cameras_of

MOST_PER_SHARD = 10**5
Kind = Literal["webdataset", "zarr"]
KINDS: dict[Kind, type[Destination]] = {"webdataset": Shards, "zarr": ZarrGroup}


def make_dataset(
    path: str | PathLike[str],
    cameras: Camera | Sequence[Camera],
    scenes: Any,
    parameters: Mapping[str, Any] | Design | None = None,
    how: How | None = None,
    *,
    count: int = 1000,
    truth: Sequence[str] = ("sharp",),
    crop: tuple[int, int] | None = None,
    flips: bool = False,
    gain: tuple[float, float] | None = None,
    color_gain: tuple[float, float] | None = None,
    exposure: float | tuple[float, float] | Literal["auto"] = "auto",
    radiance: float = 1.0,
    psf_distances: Sequence[float] = (),
    psf_size: int = 31,
    seed: int = 0,
    per_shard: int = 100,
    kind: Kind = "webdataset",
    licence: str = "",
    executor: Any = None,
    progress: Progress | None = None,
    **options: Any,
) -> Pairs:
    """Make pairs of recordings and ground truth on disk, for training.

    Each pair has a scene, a camera of the design, a window of its sensor, flips, gains, an exposure and noise of
    its own, which follow from the seed and the number of the pair: the files have the same bytes with any
    executor. The same call resumes what was stopped.

    Args:
        path: a new folder for the pairs and the card; or the same data set, unfinished.
        cameras: one whose parameters vary, or several.
        scenes: one or several: stores and videos (paths, or open), whose frames are scenes; light fields in
            memory; renderers with cameras, ``(renderer, vcc.sources.CameraArray(...))``, which workers render.
        parameters: the distribution of the cameras, as in `vcc.sweep`: every combination of values, or a
            `vcc.sweeps.Design`, ``vcc.sweeps.sobol({"code.pattern": codes, "sensor.z": (50 * mm, 54 * mm)})``.
            Parameters of the noise are the sensor's, ``"sensor.electronics.read_noise"``.
        how: as in `vcc.Camera.capture`.
        count: number of pairs.
        truth: any of ``"sharp"``, the all-in-focus image; ``"depth"``, metres; ``"views"``, the light field over
            the window; ``"psf"``, point spreads. `vcc.dataset.card.ARRAYS` defines them.
        crop: (rows, columns) of a window at a random place of the sensor: its own pixels, so that off-axis effects
            of the camera are kept. None: the whole sensor.
        flips: mirror along each axis with probability 1/2: the scene and the camera (code, point spreads). The
            noise, the colour filter and the fixed pattern are not mirrored.
        gain: (low, high) of a factor of the light, before the noise, uniform in its logarithm.
        color_gain: likewise, another factor for each channel.
        exposure: seconds, (low, high) of a draw uniform in the logarithm, or ``"auto"``, see `vcc.Camera.expose`.
        radiance: of a sample value of 1, W/(m²·sr).
        psf_distances: of the points of ``"psf"``, metres.
        psf_size: pixels along a side of a point spread, odd.
        seed: of everything that is drawn.
        per_shard: number of pairs in a shard, the unit of work of executors.
        kind: ``"webdataset"``: shards are tar files; ``"zarr"``: a Zarr group ``pairs.zarr`` in the folder, images
            in chunks of one pair, numbers in chunks of one shard, and the card in its attributes.
        licence: of the data set, for its card.
        executor: makes shards: any `concurrent.futures.Executor`, or a ``dask.distributed.Client`` whose workers
            see the same disk; it stays open. Scenes in memory must take at most 64 MiB then. None makes one pair
            after the other in this process.
        progress: called with (done, total) in pairs.
        options: as in `vcc.Camera.capture`. Each task of an executor uses one thread, unless ``threads`` is given.

    Returns:
        The finished data set, as from `open_dataset`.

    Warns:
        ResultWarning: as for `vcc.Camera.capture` and `vcc.expose_image`, once for each kind, with the number of
            pairs.

    Raises:
        InputError: invalid settings; another data set, or something else, at the path (the message names the
            difference); an error of a pair, a scene or the disk. All settings are tried on one pair before
            anything is written, and complete shards are kept.
    """
    path = expanded(path)
    checks.whole_number_between("per_shard", per_shard, 1, MOST_PER_SHARD, of="pairs")
    checks.one_of("kind", kind, get_args(Kind))
    if not isinstance(licence, str):
        raise InputError(f'licence is text, such as "CC BY 4.0", not a {type(licence).__name__}')
    chosen = How.of(how, options)
    chosen = replace(chosen, memory_limit=chosen.memory_limit or PIECES)
    recipe = Recipe(
        cameras_of(cameras, parameters),
        scenes_of(scenes),
        count,
        _several("truth", truth, str),
        None if crop is None else checks.counts("crop", crop, "rows", "columns"),  # type: ignore[arg-type]
        flips,
        gain,
        color_gain,
        exposure,
        radiance,
        _several("psf_distances", psf_distances, (int, float)),
        psf_size,
        seed,
        chosen,
    )
    if executor is not None:
        worker_pool(executor)  # checked before anything is written
        for scene in recipe.scenes:
            if isinstance(scene.source, InMemory):
                check_portable(scene.source)
    with Notices().gathered():  # pair 0 is made again with its shard
        first = Shard(recipe, None).pairs([0])
        example = next(first)
    card = card_of(recipe, per_shard, licence, example)
    if executor is not None:
        vars(_local).clear()  # the scene: workers open their own
    check_name(path)
    check_parent(path)
    disk, remarks = KINDS[kind](path, card), Notices()
    lock = WriterLock(path)
    try:
        clear_leftovers(path, lock.patience)
        if os.path.lexists(path):
            _check_same(destination_at(path), disk)
            disk.clear(lock.patience)
        else:
            disk.create(as_text(card, recipe, disk.how_to_read), recipe.cameras[0], example)
        _run(Shard(recipe, disk), executor, remarks, progress)
    except (InputError, KeyboardInterrupt) as error:
        if not os.path.lexists(path):
            raise
        kept = f"complete shards are kept in {path}: the same call resumes"
        if isinstance(error, KeyboardInterrupt):
            raise KeyboardInterrupt(kept) from None
        raise InputError(str(error) if str(path) in str(error) else f"{error}. {kept}") from error.__cause__
    finally:
        vars(_local).clear()
        lock.give_back()
    remarks.say(count, "pairs")
    return open_dataset(path)


def _several(name: str, given: Any, kind: Any) -> tuple[Any, ...]:
    """One value, or several, as a tuple."""
    if isinstance(given, kind):
        return (given,)
    if not isinstance(given, Iterable):
        raise InputError(f"{name} is a list of values, not {given!r}")
    return tuple(given)


def _check_same(there: Destination, wanted: Destination) -> None:
    """Raise `InputError` unless a data set has the same card and kind of files."""
    card = wanted.card
    if card["description"] is None:
        raise InputError(
            f"{there.path} is there already, and a data set of cameras with Python functions cannot be resumed, "
            "because functions cannot be compared: remove it, or choose another name"
        )
    if there.kind != wanted.kind:
        raise InputError(
            f"{there.path} is a data set of kind {there.kind!r}, not {wanted.kind!r}: give kind={there.kind!r}, "
            "or choose another name"
        )
    if not same(there.card, card):
        raise InputError(
            f"{there.path} is another data set, which is never mixed with this one. "
            f"{difference(there.card, card)}. Remove it, or choose another name"
        )


def _run(work: Shard, executor: Any, remarks: Notices, progress: Progress | None) -> None:
    """Make the missing shards."""
    disk = work.disk
    assert disk is not None
    left = disk.left()
    total = disk.card["pairs"]
    done = total - sum(len(disk.pairs_of(shard)) for shard in left)
    tell(progress, done, total)
    if executor is None:
        for shard in left:
            with remarks.gathered():
                work.write(shard, lambda more, before=done: tell(progress, before + more, total))
            done += len(disk.pairs_of(shard))
        return
    how = work.recipe.how
    alone = replace(work, recipe=replace(work.recipe, how=replace(how, threads=how.threads or 1)))
    with remarks.gathered():
        for number, said in worker_pool(executor).each(Work(_written_elsewhere, (alone, os.getpid())), left):
            remarks.add(said)
            done += len(disk.pairs_of(left[number]))
            tell(progress, done, total)


_local = threading.local()
"""The scene that a thread has opened last: its next shard mostly has the same."""


@dataclass(frozen=True, eq=False, repr=False)
class Shard(Brief):
    """The work on shards.

    Args:
        recipe: of the pairs.
        disk: where they are written; None for pairs alone.
    """

    recipe: Recipe
    disk: Destination | None

    def pairs(self, numbers: Sequence[int]) -> Iterator[Pair]:
        """Pairs with these numbers, in order; a scene is opened once for neighbours."""
        recorder, opened, last = Recorder(self.recipe, self._kept()), None, None
        for number in numbers:
            scene = self.recipe.scenes[self.recipe.drawn(number).scene]
            if opened is None or scene is not last:
                opened, last = _opened(scene), scene
            yield recorder.pair(number, opened)

    def _kept(self) -> dict[Any, Any]:
        """What this thread keeps of the cameras of this data set from shard to shard."""
        description = None if self.disk is None else self.disk.card["description"]
        if description is None or getattr(_local, "description", None) != description:
            _local.description, _local.kept = description, {}
        found: dict[Any, Any] = _local.kept
        return found

    def write(self, shard: int, told: Any = lambda done: None) -> None:
        """Write a shard."""
        assert self.disk is not None
        self.disk.write(shard, self._checked(shard, told))

    def _checked(self, shard: int, told: Any) -> Iterator[Pair]:
        """The pairs of a shard, which must have the shapes that the card states."""
        assert self.disk is not None
        stated = {name: tuple(each["shape"]) for name, each in self.disk.card["arrays"].items()}
        for done, pair in enumerate(self.pairs(self.disk.pairs_of(shard)), 1):
            for name, values in pair.arrays.items():
                if values.shape != stated[name]:
                    raise InputError(
                        f"all pairs have arrays of one shape: {name} is {values.shape} for pair "
                        f"{pair.numbers['pair']}, and {stated[name]} for pair 0. Choose scenes and cameras of "
                        "equal sizes"
                    )
            yield pair
            told(done)


def _opened(scene: Any) -> Opened:
    key = scene.name, scene.identity()
    if getattr(_local, "key", None) != key:
        _local.key = None
        _local.scene = Opened(scene.name, scene.opened())
        _local.key = key
    found: Opened = _local.scene
    return found


def _written_elsewhere(shared: tuple[Shard, int], shard: int) -> Notices:
    """A shard as a task; returns its warnings, unless it runs in a thread of the process that asks."""
    work, asking = shared
    return worked_elsewhere(lambda: work.write(shard), asking)[1]
