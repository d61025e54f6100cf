"""The images of a session: in time during a drag, whole at rest, rehearsed while idle."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from vcc.advice.limits import sampling_limits
from vcc.advice.of_images import Cautions
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.bench import messages
from vcc.bench.document import Document
from vcc.bench.editing import Editing
from vcc.bench.offered import Field
from vcc.bench.pace import MOST_KINDS, Pace
from vcc.bench.picture import COARSER, FULL, WHOLE, Fineness, Taken, out_of_focus, take
from vcc.bench.side import scene_distances
from vcc.files.camera_reading import TrainAsWritten
from vcc.plan.following import Draft, Parts
from vcc.plan.parallax_rule import vergences
from vcc.plot.fans import focused_distance

DRAFT = Draft(lasting=20, error=0.01)
"""Of the plans of coarse images: a hundredth of white is not seen in an image that moves."""
SLOW = 0.4
"""Expected time, seconds, above which a coarse image is shown before the whole one."""


@dataclass(frozen=True)
class Wanted:
    """An image to be made.

    Args:
        turn: the client's number of the message that requested it.
        moving: whether it belongs to a drag.
        shown: the fineness of the image that is shown of it already, if any.
        rests: of a drag, whether the hand holds still: the whole image follows.
    """

    turn: int
    moving: bool
    shown: Fineness | None = None
    rests: bool = False

    def then(self, shown: Fineness) -> Wanted | None:
        """What is wanted once an image of this fineness is shown."""
        finer = shown != WHOLE and (self.rests or not self.moving)
        return Wanted(self.turn, moving=False, shown=shown) if finer else None


class Imaging:
    """Makes the images of a document.

    Args:
        editing: the document.
        check: raises an exception if the work is no longer needed.

    Attributes:
        taken: the newest image; None if there is none.
    """

    def __init__(self, editing: Editing, check: Callable[[], None]) -> None:
        self._editing, self._check = editing, check
        self._turn = editing.offered.turn
        self._pace = Pace()
        self._parts: dict[Fineness, Parts] = {}
        self._rehearsals: dict[Hashable, list[tuple[bool, Fineness]]] = {}
        self._of: tuple[Document, Field] | None = None
        self._moving = False
        self.taken: Taken | None = None

    # --- the image of the document ---

    def make(self, wanted: Wanted) -> Taken:
        """The image that is wanted, whole if there is time; an image of the same document is not made again.

        Raises:
            InputError: see `vcc.bench.picture.take`.
        """
        if self.fineness_shown() == WHOLE:
            return self.there()
        if wanted.moving and not self._moving:
            self._parts.clear()  # what was decided for the place at which an earlier drag ended
        self._moving = wanted.moving
        kind = self._kind()
        fineness = self._fineness(wanted, kind)
        if fineness == FULL:
            self._parts.pop(FULL, None)  # likewise, for the place of the one before
        taken = self.take(fineness)
        self._pace.noted(kind, fineness, taken)
        self.taken, self._of = taken, self._lit()
        return taken

    def _fineness(self, wanted: Wanted, kind: Hashable) -> Fineness:
        """The fineness of the next image."""
        slow = wanted.shown is None and (self._pace.seconds(kind) or math.inf) > SLOW
        if wanted.moving or slow:
            return self._pace.fineness(kind)
        return FULL if wanted.shown in COARSER and self._pace.is_soon(kind, FULL) else WHOLE

    def whole(self) -> Taken:
        """The whole image of the document; made now if only a coarse one exists.

        Raises:
            InputError: there is no image yet.
        """
        taken = self.there()
        if taken.coarse or self._of != self._lit():
            self.taken, self._of = self.take(WHOLE), self._lit()
        assert self.taken is not None
        return self.taken

    def there(self) -> Taken:
        """The newest image.

        Raises:
            InputError: there is none.
        """
        if self.taken is None:
            raise InputError("there is no image yet")
        return self.taken

    def fineness_shown(self) -> Fineness | None:
        """Of the newest image, if it is of the present document."""
        return self.taken.fineness if self.taken is not None and self._of == self._lit() else None

    def _lit(self) -> tuple[Document, Field]:
        """The document without what changes only how its image is shown, and its light field."""
        return replace(self._editing.document, exposure=None), self._field

    @property
    def _field(self) -> Field:
        return self._editing.offered.field(self._editing.document.light_field)

    def none(self) -> None:
        """There is no image any more."""
        self.taken = self._of = None

    def take(
        self, fineness: Fineness, document: Document | None = None, described: TrainAsWritten | None = None
    ) -> Taken:
        """The image of a document; None uses the present one."""
        document, described = document or self._editing.document, described or self._editing.described
        field = self._editing.offered.field(document.light_field)
        kept = self._parts.setdefault(fineness, Parts(self._check, None if fineness == WHOLE else DRAFT))
        waited = 0.0
        with self._turn.held(self._check) as let_pass:

            def progress(done: int, total: int) -> None:
                nonlocal waited
                self._check()
                waited += let_pass()

            taken = take(described.train, field, document, fineness, progress, kept)
        seconds = taken.seconds - waited
        return replace(taken, seconds=seconds, planning=min(taken.planning, seconds))

    @contextmanager
    def all_cores(self) -> Iterator[Progress]:
        """Hold the turn for work that uses all cores; yield its progress callback."""
        with self._turn.held(self._check) as let_pass:

            def progress(done: int, total: int) -> None:
                self._check()
                let_pass()

            yield progress

    # --- while idle ---

    def _kind(self, described: TrainAsWritten | None = None) -> Hashable:
        """The key under which image times are remembered; None uses the present camera.

        Cameras with equal keys take about the same time. Whether part of the scene is in focus is in the key:
        otherwise views are interpolated, which takes several times as long.
        """
        described, grid, document = (
            described or self._editing.described,
            self._editing.grid,
            self._editing.document,
        )
        scene = () if grid is None else scene_distances(grid).values()
        focus = focused_distance(described.train)
        sharp = not scene or (focus is not None and min(scene) <= focus <= max(scene))
        sensor = described.train.sensor
        kinds = (element.kind for element in described.elements)
        return self._field, document.views, sensor.shape, sensor.photodiodes, sharp, *kinds

    @property
    def shown(self) -> Field | None:
        """The light field from which the newest image was made."""
        return None if self._of is None else self._of[1]

    def is_best(self) -> bool:
        """Whether the whole image is shown, made from the best light field; also if there is no whole image."""
        whole = self.taken is not None and not self.taken.coarse
        return not whole or (self.shown is self._field and self._field.better is None)

    def is_rehearsed(self) -> bool:
        """Whether nothing is left to rehearse, or rehearsing is useless because no whole image is shown."""
        if self.taken is None or self.taken.coarse:
            return True
        kind = self._kind()
        if kind not in self._rehearsals:
            self._rehearsals[kind] = self._steps()
            while len(self._rehearsals) > MOST_KINDS:
                del self._rehearsals[next(iter(self._rehearsals))]
        return not self._rehearsals[kind]

    def _steps(self) -> list[tuple[bool, Fineness]]:
        """The images to rehearse: whether out of focus, and how fine.

        If the image is made by rays, the whole image has compiled all code already, and images out of focus
        are made in the same way. Without rays, images with fewer rays are the same.
        """
        by_rays = self.taken is not None and self.taken.by_rays
        quick = (self._pace.seconds(self._kind()) or math.inf) <= SLOW
        every = [each for each in COARSER if by_rays or each.pixels != 2 or each.rays == COARSER[0].rays]
        levels = [FULL, *([] if by_rays else [WHOLE]), *every] if quick else every
        return [(away, each) for away in ((False,) if by_rays else (True, False)) for each in levels]

    def rehearse(self) -> None:
        """Prepare the first images of a drag by one more image: coarser light fields, compiled code, times.

        An image that is interrupted is made at the next call.
        """
        steps = self._rehearsals.get(self._kind(), [])
        if self.is_rehearsed() or not steps:
            return
        away, fineness = steps[0]
        present = self._editing.described
        described = replace(present, train=out_of_focus(present.train)) if away else present
        try:
            self._pace.noted(self._kind(described), fineness, self.take(fineness, described=described))
        except (InputError, MemoryError):
            steps[:] = [each for each in steps if each[0] is not away]
            return
        del steps[0]

    # --- warnings ---

    def notes(self, taken: Taken) -> list[messages.Note]:
        """The warnings to show, each with the element that its text names."""
        train, field = self._editing.train, self._editing.light_field()
        said: dict[str, str] = {}  # of several photodiodes or bands, sentences that differ only in numbers are one
        for run in taken.runs:
            cautions = Cautions(run.train, run.samples.grid).of(run.plan, run.samples, run.found)
            for words in (*run.plan.cautions, *cautions):
                said.setdefault(re.sub(r"[\d.,]+", "0", words), words)
        far_near = vergences(field.grid, None)
        scene = None if far_near is None else (float(far_near.min()), float(far_near.max()))
        told = {item.advice: item for item in sampling_limits(train, field.grid, scene).to_watch}
        filled = "" if field.filling is None else field.filling.words
        every = [filled[:1].upper() + filled[1:]] if filled else []
        every += [*said.values(), *(f"{item.finding}. {item.advice}" for item in told.values())]
        return [{"element": self._element_named_in(each), "words": each.replace(" um", " µm")} for each in every]

    def _element_named_in(self, words: str) -> int | None:
        labels = [element.label for element in self._editing.described.elements]
        return next((number for number, label in enumerate(labels) if label in words), None)
