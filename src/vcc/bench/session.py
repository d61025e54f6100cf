"""The session of one client of a bench: receives its messages, does the work and sends the replies.

This module is independent of the transport. Messages arrive from any thread. The session's own thread handles
them in order; of the messages of a drag, only the newest counts. Making an image stops if the image is no
longer needed. The thread exists only while there is work, because a notebook keeps each bench that a cell
ever created.
"""

from __future__ import annotations

import json
import logging
import math
import threading
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from vcc.advice.limits import sampling_limits
from vcc.advice.of_images import Cautions
from vcc.base import units
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.bench import additions, answers, decoded, export
from vcc.bench.aperture import drawn_aperture
from vcc.bench.document import Document, History, shown
from vcc.bench.focusing import distance_at
from vcc.bench.offered import Offered
from vcc.bench.picture import (
    COARSER,
    WHOLE,
    Fineness,
    Pace,
    Picture,
    Taken,
    codes,
    jpeg,
    out_of_focus,
    pixel_at,
    psnr,
    take,
    white_of,
)
from vcc.bench.side import AXIS, scene_distances, side
from vcc.bench.sweep import Sweep, sweep_of
from vcc.fields.grid import Grid
from vcc.files.camera_reading import TrainAsWritten, tables_of_text
from vcc.light_field import LightField
from vcc.optics.focusing import focused_train
from vcc.optics.train import touch
from vcc.plan.parallax_rule import vergences
from vcc.plot.fans import focused_distance

Json = dict[str, Any]
Send = Callable[[Json, Sequence[bytes]], None]
"""Sends the client a message with its buffers; called from any thread."""

MOST_WAITING = 200
"""Messages that may wait; a client that sends more is disconnected."""
LINGER = 2.0
"""Seconds that the thread waits for more work before it ends."""
PAUSE = 0.1
"""Seconds of idleness after which images are rehearsed."""
SLOW = 0.4
"""Expected time, seconds, above which a coarse image is shown before the whole one."""

CHANGES = ("hello", "set", "upload", "add", "remove", "duplicate", "reorder", "undo", "redo", "load", "focus")
"""Messages that change the image."""
QUESTIONS = ("pin", "value", "ask", "export")
"""Messages that leave the image as it is."""

log = logging.getLogger("vcc.bench")


class Broken(Exception):
    """A message that the front end never sends; the client is disconnected."""


class Superseded(Exception):
    """Raised to stop work whose result is no longer needed."""


@dataclass(frozen=True)
class Wanted:
    """An image to be made.

    Args:
        turn: the client's number of the message that requested it.
        moving: whether it belongs to a drag.
        coarse_shown: whether its coarse version was shown already.
    """

    turn: int
    moving: bool
    coarse_shown: bool = False


class Session:
    """The session of one client of a bench.

    Args:
        offered: the light fields, cameras and files that the bench was started with.
        send: sends a message to the client.

    Attributes:
        offered: as given.
    """

    def __init__(self, offered: Offered, send: Send) -> None:
        self.offered = offered
        self._send: Send | None = send
        self._greeted = False
        self._history = History(offered.start)
        self._described = offered.start.train(offered.beside)
        self._inbox: deque[tuple[Json, list[bytes]]] = deque()
        self._changed = threading.Condition()
        self._closed = False
        self._wanted: Wanted | None = None
        self._pace = Pace()
        self._rehearsed: set[Hashable] = set()
        self._taken: Taken | None = None
        self._shown_white = 1.0
        self._pinned: tuple[Picture, float] | None = None
        self._decoding = decoded.Decoding()
        self._thread: threading.Thread | None = None

    @property
    def document(self) -> Document:
        """The document shown now."""
        return self._history.present

    def receive(self, message: object, buffers: Sequence[bytes] = ()) -> None:
        """Queue a message; replies come through ``send``.

        Args:
            message: decoded JSON.
            buffers: the binary buffers of the message.

        Raises:
            Broken: not a message of a bench, or too many messages wait.
        """
        checked = _checked(message)
        with self._changed:
            if self._closed:
                return
            if self._inbox and _replaces(checked, self._inbox[-1][0]):
                self._inbox.pop()
            if len(self._inbox) >= MOST_WAITING:
                raise Broken(f"more than {MOST_WAITING} messages wait")
            self._inbox.append((checked, list(buffers)))
            self._wake()

    def pause(self) -> None:
        """Suspend: the client is unreachable. Work stops; the state is kept."""
        with self._changed:
            self._send = None
            self._inbox.clear()
            self._changed.notify()

    def go_on(self, send: Send) -> None:
        """Resume: the client is reachable again. Messages go through this ``send`` from now on."""
        with self._changed:
            self._send = send
            self._wake()

    def close(self) -> None:
        """End the session: work stops, and nothing more is sent."""
        with self._changed:
            self._closed = True
            self._inbox.clear()
            self._changed.notify()

    def join(self, timeout: float | None = None) -> bool:
        """Wait until the session's thread has ended; return whether it has."""
        thread = self._thread
        if thread is None:
            return True
        thread.join(timeout)
        return not thread.is_alive()

    # --- the thread ---

    def _wake(self) -> None:
        """Notify the thread, and start it if needed; call with the lock held."""
        self._changed.notify()
        if self._thread is None and self._has_to_do():
            self._thread = threading.Thread(target=self._work, name="vcc bench", daemon=True)
            self._thread.start()

    def _work(self) -> None:
        while True:
            with self._changed:
                idle = not self._changed.wait_for(self._has_to_do, PAUSE)
                if idle and self._is_rehearsed() and not self._changed.wait_for(self._has_to_do, LINGER):
                    self._thread = None
                    return
                if self._closed:
                    self._thread = None
                    return
                message, buffers = self._next()
            try:
                if message is None and self._wanted is None:
                    self._rehearse()
                elif message is None:
                    self._make_picture()
                else:
                    self._answer(message, buffers)
            except Superseded:
                continue
            except Exception as error:  # a bug: the client is notified, and the bench goes on
                log.exception("a fault on the bench")
                self._wanted = None
                self._tell({"is": "failed", "words": f"a bug in the program: {type(error).__name__}: {error}"})

    def _has_to_do(self) -> bool:
        return self._closed or bool(self._inbox) or (self._wanted is not None and self._send is not None)

    def _next(self) -> tuple[Json | None, list[bytes]]:
        """Pop the next message; None if an image must be made first."""
        if not self._inbox or (self._wanted and _after_picture([message for message, _ in self._inbox])):
            return None, []
        return self._inbox.popleft()

    def _tell(self, message: Json, buffers: Sequence[bytes] = ()) -> None:
        send = self._send
        if send is not None and not self._closed:
            send(message, buffers)

    def _answer(self, message: Json, buffers: list[bytes]) -> None:
        doing = message["do"]
        try:
            if doing == "upload":
                self._do_upload(message, buffers)
            else:
                getattr(self, f"_do_{doing}")(message)
        except (InputError, MemoryError) as error:
            self._refuse(message, _in_words(error))
        except Superseded:
            if message.get("what") in decoded.QUESTIONS:
                return  # the client asks again, about the state at that time
            self._refuse(message, InputError(f"{doing} was cancelled by a newer request"))

    def _refuse(self, message: Json, error: InputError) -> None:
        where, turn = message.get("where"), _turn(message)
        self._tell({"is": "refused", "do": message["do"], "words": str(error), "where": where, "turn": turn})

    def _check_wanted(self) -> None:
        """Raise `Superseded` if another image is requested meanwhile, or the client is gone.

        During a drag, each image is finished before the next starts: images made during a drag are quick, and
        if each new message stopped the work, a fast drag would show no image at all.
        """
        moving = self._wanted is not None and self._wanted.moving
        waiting = [message for message, _ in list(self._inbox) if message["do"] in CHANGES]
        gone = self._closed or self._send is None
        if gone or any(not (moving and message.get("moving")) for message in waiting):
            raise Superseded

    # --- what changes the picture ---

    def _do_hello(self, message: Json) -> None:
        self._tell(
            {
                "is": "parts",
                "light_fields": list(self.offered.fields),
                "kinds": additions.kinds(),
                "sensor": additions.sensor_parameters(),
                "families": additions.families(),
                "gallery": list(self.offered.gallery),
            }
        )
        self._greet_with(message)
        self._greeted = True
        self._tell_state(_turn(message))
        self._tell_pinned()
        self._wanted = Wanted(_turn(message), moving=False)

    def _greet_with(self, message: Json) -> None:
        """Start with the document that the client sends; a client that reconnects adds it to its history."""
        given = message.get("document")
        if given is None:
            return
        try:
            document, self._described = self._checked(Document.of_json(given))
        except InputError as error:
            self._refuse(message, error)
            return
        if self._greeted:
            self._history.put(document)
        else:
            self._history = History(document)

    def _do_set(self, message: Json) -> None:
        self._put(message, message.get("value"), bool(message.get("moving", False)))

    def _do_upload(self, message: Json, buffers: Sequence[bytes]) -> None:
        self._put(message, additions.cells_of(message.get("name"), buffers))

    def _put(self, message: Json, value: Any, moving: bool = False) -> None:
        changed = self._history.present
        for where, each in additions.made_whole(message.get("where"), value, changed.camera, self._described):
            changed = changed.changed(where, each)
        self._show(changed, message, moving)

    def _do_add(self, message: Json) -> None:
        present = self._history.present
        entry = additions.new_element(message.get("kind"), message.get("z"), self._described.train, self._names())
        elements = [*present.camera.get("elements", []), entry]
        self._show(replace(present, camera={**present.camera, "elements": elements}), message)

    def _do_remove(self, message: Json) -> None:
        number = self._element(message)
        self._show(self._history.present.changed(["elements", number], None), message)

    def _do_duplicate(self, message: Json) -> None:
        present, number = self._history.present, self._element(message)
        elements = list(present.camera["elements"])
        copy, original = dict(elements[number]), self._described.elements[number]
        wanted = str(copy.get("name") or original.kind)
        copy["name"] = additions.free_name(wanted, self._names())
        step = max(original.length, self._described.train.sensor.z / 50)
        z = min(original.z + step, self._described.train.sensor.z)
        copy["z"] = units.text(float(f"{z:.4g}"), "length")
        elements.insert(number + 1, copy)
        self._show(replace(present, camera={**present.camera, "elements": elements}), message)

    def _do_reorder(self, message: Json) -> None:
        """Swap positions along the axis with the neighbour before (−1) or behind (1)."""
        number, by = self._element(message), message.get("by")
        elements = self._described.elements
        if by not in (-1, 1):
            raise InputError(f"by is -1 or 1, towards the scene or the sensor, not {shown(by)}")
        order = sorted(range(len(elements)), key=lambda each: elements[each].z)
        place = order.index(number) + by
        if not 0 <= place < len(order):
            raise InputError(f"there is no element {'before' if by < 0 else 'behind'} {elements[number].label}")
        other = order[place]
        if touch(elements[number].z, elements[other].z):
            raise InputError(
                f"{elements[number].label} and {elements[other].label} stand in one plane, where their order "
                "makes no difference: move one of them along the axis"
            )
        changed, tables = self._history.present, self._history.present.camera["elements"]
        for one, another in ((number, other), (other, number)):
            changed = changed.changed(["elements", one, "z"], tables[another].get("z", "0 mm"))
        self._show(changed, message)

    def _do_undo(self, message: Json) -> None:
        self._history.undo()
        self._show_again(message)

    def _do_redo(self, message: Json) -> None:
        self._history.redo()
        self._show_again(message)

    def _do_load(self, message: Json) -> None:
        if "toml" in message:
            if not isinstance(message["toml"], str):
                raise InputError("a camera file is text")
            document = replace(self._history.present, camera=tables_of_text(message["toml"]))
        elif "gallery" in message:
            title = message["gallery"]
            if not isinstance(title, str) or title not in self.offered.gallery:
                raise InputError(f"there is no camera {shown(title)}: there are {', '.join(self.offered.gallery)}")
            document = self.offered.gallery[title]
        else:
            document = Document.of_json(message.get("document"))
        self._show(document, message)

    def _do_focus(self, message: Json) -> None:
        taken = self._picture_there()
        pixel = pixel_at(taken.values.shape, message.get("x"), message.get("y"))
        train = self._described.train
        share = (pixel[0] + 0.5) / taken.values.shape[0], (pixel[1] + 0.5) / taken.values.shape[1]
        distance = distance_at(train, self._light_field(), share)
        z = focused_train(train.elements, train.sensor, distance).sensor.z
        value = units.text(float(f"{z:.8g}"), "length")
        self._show(self._history.present.changed(["sensor", "z"], value), message)

    def _show(self, document: Document, message: Json, moving: bool = False) -> None:
        """Validate another document and show it."""
        document, self._described = self._checked(document)
        self._history.put(document, moving)
        self._tell_state(_turn(message))
        self._wanted = Wanted(_turn(message), moving)

    def _show_again(self, message: Json) -> None:
        """Show the document that the history points to, which is valid already."""
        self._described = self._history.present.train(self.offered.beside)
        self._tell_state(_turn(message))
        self._wanted = Wanted(_turn(message), moving=False)

    def _checked(self, document: Document) -> tuple[Document, TrainAsWritten]:
        document = document.settled(self.offered.beside)
        described = document.train(self.offered.beside)
        field = self.offered.field(document.light_field)
        if document.views is not None and field.is_open:
            document.views.check(field.whole().shape)
        if document.aperture.is_moved and field.is_open:
            document.aperture.check(field.whole().grid)
        if document.noise and described.train.sensor.electronics is None:
            raise InputError("noise requires sensor electronics, and this sensor has none: add them first")
        return document, described

    def _element(self, message: Json) -> int:
        number = message.get("element")
        count = len(self._described.elements)
        if type(number) is not int or not 0 <= number < count:
            raise InputError(f"there is no element {shown(number)}: there are {count}, counted from 0")
        return number

    def _names(self) -> set[str]:
        return {element.name for element in self._described.elements}

    def _light_field(self) -> LightField:
        document = self._history.present
        whole = self.offered.field(document.light_field).whole(self._progress)
        return document.aperture.placed(whole if document.views is None else whole[document.views.slices])

    @property
    def _grid(self) -> Grid | None:
        """The grid of the whole light field in its place before the camera; None until it is open."""
        document = self._history.present
        field = self.offered.field(document.light_field)
        return field.whole().grid.moved(document.aperture.rays) if field.is_open else None

    # --- messages to the client ---

    def _tell_state(self, turn: int) -> None:
        document = self._history.present
        field = self.offered.field(document.light_field)
        grid, seen, aperture, train = self._grid, None, None, self._described.train
        if field.is_open:
            whole = field.whole()
            views = whole if document.views is None else whole[document.views.slices]
            seen = views.transformed(document.aperture.rays)
            aperture = drawn_aperture(document.aperture, views, train, AXIS)
        self._tell(
            {
                "is": "state",
                "turn": turn,
                "document": document.as_json(),
                "undo": self._history.can_undo,
                "redo": self._history.can_redo,
                "grid": None if grid is None else list(grid.shape),
                "side": side(self._described.elements, train, seen, grid, aperture),
            }
        )

    def _progress(self, done: int, total: int) -> None:
        self._tell({"is": "progress", "done": done, "total": total, "words": "Opening the light field"})
        if self._closed:
            raise Superseded

    def _make_picture(self) -> None:
        wanted, document = self._wanted, self._history.present
        assert wanted is not None
        field = self.offered.field(document.light_field)
        if not field.is_open:
            self._tell({"is": "progress", "done": 0, "total": 1, "words": "Opening the light field"})
            try:
                field.whole(self._progress)
            except (InputError, MemoryError) as error:
                self._no_picture(wanted, _in_words(error))
                return
            self._tell_state(wanted.turn)
        fineness = WHOLE
        kinds = self._kinds()
        if wanted.moving or (not wanted.coarse_shown and (self._pace.seconds(kinds) or math.inf) > SLOW):
            fineness = self._pace.fineness(kinds)
        try:
            taken = self._take(fineness)
        except (InputError, MemoryError) as error:
            self._no_picture(wanted, _in_words(error))
            return
        self._pace.noted(kinds, fineness, taken)
        self._taken = taken
        self._tell_picture(taken, wanted)
        whole = fineness == WHOLE
        self._wanted = None if whole or wanted.moving else replace(wanted, coarse_shown=True)
        if whole and not wanted.moving:
            self._tell({"is": "notes", "turn": wanted.turn, "notes": self._notes(taken)})

    def _kinds(self, described: TrainAsWritten | None = None) -> Hashable:
        """The key under which image times are remembered; None uses the present camera.

        Cameras with equal keys take about the same time. Whether part of the scene is in focus is in the key:
        otherwise views are interpolated, which takes several times as long.
        """
        described, grid = described or self._described, self._grid
        scene = () if grid is None else scene_distances(grid).values()
        focus = focused_distance(described.train)
        sharp = not scene or (focus is not None and min(scene) <= focus <= max(scene))
        return self._history.present.light_field, sharp, *(element.kind for element in described.elements)

    def _is_rehearsed(self) -> bool:
        """Whether nothing is left to rehearse, or rehearsing is useless because no whole image is shown."""
        return self._send is None or self._taken is None or self._taken.coarse or self._kinds() in self._rehearsed

    def _rehearse(self) -> None:
        """Prepare the first frames of a drag: coarser light fields, compiled code, timings.

        If the image is made by rays, the whole image has compiled all code already, and images out of focus
        are made in the same way.
        """
        self._rehearsed.add(self._kinds())
        by_rays = self._taken is not None and self._taken.plan.by_rays
        quick = not by_rays and (self._pace.seconds(self._kinds()) or math.inf) <= SLOW
        present = self._described.train
        for train in (present,) if by_rays else (out_of_focus(present), present):
            described = replace(self._described, train=train)
            for fineness in (WHOLE, *COARSER) if quick else COARSER:
                try:
                    taken = self._take(fineness, described=described)
                except (InputError, MemoryError):
                    break
                self._pace.noted(self._kinds(described), fineness, taken)

    def _take(
        self, fineness: Fineness, document: Document | None = None, described: TrainAsWritten | None = None
    ) -> Taken:
        """The image of a document; None uses the present one."""
        document, described = document or self._history.present, described or self._described
        field = self.offered.field(document.light_field)
        waited = 0.0
        with self.offered.turn.held(self._check_wanted) as let_pass:

            def progress(done: int, total: int) -> None:
                nonlocal waited
                self._check_wanted()
                waited += let_pass()

            taken = take(described.train, field, document, fineness, progress)
        seconds = taken.seconds - waited
        return replace(taken, seconds=seconds, planning=min(taken.planning, seconds))

    @contextmanager
    def _all_cores(self) -> Iterator[Progress]:
        """Hold the turn for work that uses all cores; yield its progress callback."""
        with self.offered.turn.held(self._check_wanted) as let_pass:

            def progress(done: int, total: int) -> None:
                self._check_wanted()
                let_pass()

            yield progress

    def _no_picture(self, wanted: Wanted, error: InputError) -> None:
        self._wanted, self._taken = None, None
        self._tell({"is": "no picture", "turn": wanted.turn, "words": str(error)})

    def _tell_picture(self, taken: Taken, wanted: Wanted) -> None:
        exposure = self._history.present.exposure
        white = white_of(taken.values) if exposure is None else exposure
        self._shown_white = white
        compared = None
        if self._pinned is not None and not taken.coarse:
            compared = psnr(taken.values, *self._pinned)
        message = {
            "is": "picture",
            "turn": wanted.turn,
            "coarse": taken.coarse,
            "moving": wanted.moving,
            "shape": list(taken.values.shape[:2]),
            "white": white,
            "missing": taken.found.missing_rays,
            "by_rays": taken.plan.by_rays,
            "took": round(1000 * taken.seconds, 1),
            "psnr": None if compared is None or math.isinf(compared) else compared,
            "same": compared is not None and bool(math.isinf(compared)),
        }
        self._tell(message, [jpeg(taken.values, white, taken.coarse or wanted.moving)])

    def _notes(self, taken: Taken) -> list[Json]:
        """The warnings to show, each with the element that its text names."""
        train, field = self._described.train, self._light_field()
        said = [*taken.plan.cautions, *Cautions(train, field.grid).of(taken.plan, field, taken.found)]
        far_near = vergences(field.grid, None)
        scene = None if far_near is None else (float(far_near.min()), float(far_near.max()))
        told = {item.advice: item for item in sampling_limits(train, field.grid, scene).to_watch}
        said += [f"{item.finding}. {item.advice}" for item in told.values()]
        return [{"element": self._element_named_in(words), "words": words} for words in said]

    def _element_named_in(self, words: str) -> int | None:
        labels = [element.label for element in self._described.elements]
        return next((number for number, label in enumerate(labels) if label in words), None)

    # --- questions ---

    def _picture_there(self) -> Taken:
        if self._taken is None:
            raise InputError("there is no image yet")
        return self._taken

    def _whole_picture(self) -> Taken:
        """The whole image of the document; made now if only a coarse one exists."""
        taken = self._picture_there()
        if taken.coarse:
            taken = self._take(WHOLE)
            self._taken = taken
        return taken

    def _do_pin(self, message: Json) -> None:
        if not message.get("on", True):
            self._pinned = None
        else:
            self._pinned = (self._whole_picture().values, self._shown_white)
        self._tell_pinned()

    def _tell_pinned(self) -> None:
        if self._pinned is None:
            self._tell({"is": "pinned", "on": False})
            return
        values, white = self._pinned
        message = {"is": "pinned", "on": True, "white": white, "shape": list(values.shape[:2])}
        self._tell(message, [jpeg(values, white)])

    def _do_value(self, message: Json) -> None:
        taken = self._picture_there()
        pixel = pixel_at(taken.values.shape, message.get("x"), message.get("y"))
        numbers = None if taken.recording is None else taken.recording.values
        recorded = None if numbers is None else np.atleast_1d(numbers[pixel]).tolist()
        self._tell(
            {
                "is": "value",
                "x": message["x"],
                "y": message["y"],
                "irradiance": np.atleast_1d(taken.values[pixel]).tolist(),
                "recorded": recorded,
            }
        )

    def _do_ask(self, message: Json) -> None:
        what = message.get("what")
        if what in decoded.QUESTIONS:
            answer, buffers = self._decoding.answer(message, self._asked())
            self._tell({"is": "answer", "what": what, **answer}, buffers)
            return
        answer, buffers = answers.answer(what, message, self._described.train, self._light_field())
        self._tell({"is": "answer", "what": what, **answer}, buffers)

    def _asked(self) -> decoded.Asked:
        """The input of decoding."""
        document, train = self._history.present, self._described.train
        return decoded.Asked(
            train,
            self._light_field(),
            (train, document.light_field, document.views, document.aperture),
            document.noise,
            self._whole_picture,
            self._all_cores,
        )

    def _do_export(self, message: Json) -> None:
        document = self._history.present
        if message.get("what") == "film":
            self._export_film(sweep_of(message, document), message)
            return
        field = self.offered.field(document.light_field)
        bench = export.OnBench(document, self._described.train, field.source, self.offered.beside)
        taken = self._whole_picture() if message.get("what") in ("png", "exr") else None
        name, kind, data = export.exported(message.get("what"), bench, taken, self._shown_white)
        self._tell({"is": "file", "name": name, "type": kind}, [data])

    def _export_film(self, sweep: Sweep, message: Json) -> None:
        """Make a film of a sweep: whole images, all with the white level of the present one."""
        self._whole_picture()
        frames, words = [], "Making the film"
        for number, document in enumerate(sweep.documents):
            self._tell({"is": "progress", "done": number, "total": sweep.frames, "words": words})
            checked, described = self._checked(document)
            taken = self._take(WHOLE, checked, described)
            frames.append(codes(taken.values, self._shown_white))
        self._tell({"is": "progress", "done": sweep.frames, "total": sweep.frames, "words": words})
        name, kind, data = sweep.film(frames)
        self._tell({"is": "file", "name": name, "type": kind}, [data])


def _checked(message: object) -> Json:
    """The message, validated."""
    if not isinstance(message, dict) or message.get("do") not in (*CHANGES, *QUESTIONS):
        raise Broken(f"no message of a bench: {shown(message)}")
    if type(message.get("turn", 0)) is not int or not -(2**53) < message.get("turn", 0) < 2**53:
        raise Broken("turn is a whole number")
    return message


def _in_words(error: InputError | MemoryError) -> InputError:
    """The error to show; lack of memory is reported as an input error, not as a bug."""
    if isinstance(error, InputError):
        return error
    return InputError(
        "this machine has too little memory for this: undo it, or use fewer pixels, or elements that spread light "
        "less"
    )


def _turn(message: Json) -> int:
    return int(message.get("turn", 0))


def _replaces(newer: Json, older: Json) -> bool:
    """Whether a message makes the one before it obsolete: a newer value of the same parameter or question."""
    same = newer["do"] == older["do"]
    if same and newer["do"] == "set":
        return bool(older.get("moving")) and json.dumps(newer.get("where")) == json.dumps(older.get("where"))
    if same and newer.get("what") in decoded.QUESTIONS:
        return bool(newer["what"] == older.get("what"))
    return bool(same and newer["do"] == "value")


def _after_picture(waiting: Sequence[Json]) -> bool:
    """Whether the first waiting message asks about the image to be made, and that image is still needed."""
    superseded = any(message["do"] in CHANGES for message in waiting)
    return not superseded and waiting[0].get("what") in decoded.QUESTIONS
