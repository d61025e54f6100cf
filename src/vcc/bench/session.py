"""The session of one client of a bench: receives its messages, does the work and sends the replies.

This module is independent of the transport. Messages arrive from any thread. The session's own thread handles
them in order; of the messages of a drag, only the newest counts. Making an image stops if the image is no
longer needed. The thread exists only while there is work, because a notebook keeps each bench that a cell
ever created.
"""

from __future__ import annotations

import contextlib
import logging
import os
import threading
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any, cast

import numpy as np

from vcc.base import units
from vcc.base.errors import InputError
from vcc.base.workers import program_ends
from vcc.bench import additions, answers, decoded, export, screen
from vcc.bench.aperture import drawn_aperture
from vcc.bench.document import Document
from vcc.bench.editing import Editing
from vcc.bench.focusing import distance_at
from vcc.bench.imaging import Imaging, Wanted
from vcc.bench.inbox import CHANGES, MOST_WAITING, Inbox, turn_of
from vcc.bench.messages import BenchDocument, PictureMessage, Side, StateMessage
from vcc.bench.offered import Offered
from vcc.bench.page_words import page_words
from vcc.bench.picture import WHOLE, Taken
from vcc.bench.pins import Pins
from vcc.bench.screen import Look
from vcc.bench.side import side
from vcc.bench.sweep import sweep_of
from vcc.optics.focusing import focused_train

Json = dict[str, Any]
Send = Callable[[Json, Sequence[bytes]], None]
"""Sends the client a message with its buffers; called from any thread."""

LINGER = 2.0
"""Seconds that the thread waits for more work before it ends."""
EDITS = ("add", "remove", "duplicate", "reorder", "undo", "redo", "load")
"""Messages that are methods of `Editing`, and need nothing else."""
PAUSE = 0.05
"""Seconds of idleness after which images are rehearsed."""

log = logging.getLogger("vcc.bench")


class Superseded(Exception):
    """Raised to stop work whose result is no longer needed."""


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
        self._editing = Editing(offered)
        self._imaging = Imaging(self._editing, self._check_wanted)
        self._pins = Pins()
        self._decoding = decoded.Decoding(self._editing, self._imaging)
        self._inbox = Inbox()
        self._changed = threading.Condition()
        self._closed = False
        self._wanted: Wanted | None = None
        self._late = False
        self._turn = 0
        self._look = screen.PLAIN
        self._white = 1.0
        self._drawn: tuple[Document, Hashable, Side] | None = None
        self._thread: threading.Thread | None = None

    @property
    def document(self) -> Document:
        """The document shown now."""
        return self._editing.document

    def receive(self, message: object, buffers: Sequence[bytes] = ()) -> None:
        """Queue a message; replies come through ``send``.

        Args:
            message: decoded JSON.
            buffers: the binary buffers of the message.

        Raises:
            Broken: not a message of a bench, or too many messages wait.
        """
        with self._changed:
            if self._closed:
                return
            self._inbox.put(message, buffers)
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
        with contextlib.suppress(AttributeError, OSError):  # Linux only
            # This thread computes, and does not interrupt the browser of the same machine whenever it wakes.
            os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
        while True:
            with self._changed:
                if self._is_idle() and not self._changed.wait_for(self._has_to_do, LINGER):
                    self._thread = None
                    return
                if self._closed:
                    self._thread = None
                    return
                message, buffers = self._next()
            try:
                if message is not None:
                    self._answer(message, buffers)
                elif self._wanted is not None:
                    self._make_picture()
                elif not self._imaging.is_best():
                    self._improve()
                else:
                    self._imaging.rehearse()
            except Superseded:
                continue
            except Exception as error:  # a bug: the client is notified, and the bench goes on
                if program_ends():
                    return
                log.exception("a fault on the bench")
                self._wanted = None
                self._tell("failed", {"words": f"a bug in the program: {type(error).__name__}: {error}"})

    def _is_idle(self) -> bool:
        """Wait a moment for work; return whether there is none, and nothing to rehearse."""
        return not self._changed.wait_for(self._has_to_do, PAUSE) and (
            self._send is None or (self._imaging.is_best() and self._imaging.is_rehearsed())
        )

    def _has_to_do(self) -> bool:
        return self._closed or bool(self._inbox) or (self._wanted is not None and self._send is not None)

    def _next(self) -> tuple[Json | None, list[bytes]]:
        """Take the next message; None if an image must be made first.

        During a drag, the image of each value that was taken is made before the next value is taken: otherwise a
        client that always has another one would see none.
        """
        wanted = self._wanted
        first = (
            wanted is not None
            and self._send is not None
            and ((wanted.moving and not self._inbox.supersedes(True)) or self._inbox.asks_about_next_image())
        )
        if not self._inbox or first:
            return None, []
        return self._inbox.take()

    def _tell(self, kind: str, message: Mapping[str, Any], buffers: Sequence[bytes] = ()) -> None:
        if kind in ("refused", "no picture"):
            message = {**message, "words": page_words(message["words"])}
        send = self._send
        if send is not None and not self._closed:
            send({"is": kind, **message}, buffers)

    def _answer(self, message: Json, buffers: list[bytes]) -> None:
        doing = message["do"]
        try:
            if doing == "upload":
                self._changed_by(message, self._editing.upload(message, buffers))
            elif doing in EDITS:
                self._changed_by(message, getattr(self._editing, doing)(message))
            else:
                getattr(self, f"_do_{doing}")(message)
        except (InputError, MemoryError) as error:
            self._refuse(message, _in_words(error))
        except Superseded:
            if message.get("what") in decoded.QUESTIONS:
                return  # the client asks again, about the state at that time
            self._refuse(message, InputError(f"{doing} was cancelled by a newer request"))

    def _refuse(self, message: Json, error: InputError) -> None:
        where, turn, doing = message.get("where"), turn_of(message), message["do"]
        self._tell("refused", {"do": doing, "words": str(error), "where": where, "turn": turn})
        if doing in CHANGES and doing != "hello":  # what the client shows already is not so
            self._tell_state(turn)

    def _check_wanted(self) -> None:
        """Raise `Superseded` if another image is requested meanwhile, or the client is gone."""
        gone = self._closed or self._send is None
        if gone or self._inbox.supersedes(self._wanted is not None and self._wanted.moving):
            raise Superseded

    # --- what changes the picture ---

    def _do_hello(self, message: Json) -> None:
        presets = self.offered.presets
        self._tell(
            "parts",
            {
                "light_fields": list(self.offered.fields),
                "kinds": additions.kinds(),
                "sensor": additions.sensor_parameters(),
                "families": additions.families(),
                "gallery": [title for title in self.offered.gallery if title not in presets],
                "presets": [
                    {"title": title, "label": label, "words": words}
                    for title, (label, words, _) in presets.items()
                ],
            },
            [thumbnail for *_, thumbnail in presets.values()],
        )
        try:
            if message.get("document") is not None and not self._greeted:
                self._editing.greet(message["document"])
            self._catch_up(message)
        except InputError as error:
            self._refuse(message, error)
        self._greeted = True
        self._tell_state(turn_of(message))
        self._tell_pins()
        self._wanted = Wanted(turn_of(message), moving=False)

    def _catch_up(self, message: Json) -> None:
        """Make the changes of values during a lost connection; what is refused of them leaves the others."""
        changes = message.get("changes", [])
        tables = isinstance(changes, list) and all(isinstance(each, dict) for each in changes)
        if not tables or len(changes) > MOST_WAITING:
            raise InputError(f"changes is a list of at most {MOST_WAITING} tables of where and value")
        for each in changes:
            try:
                remark = self._editing.set({"where": each.get("where"), "value": each.get("value")})
            except InputError as error:
                self._refuse(message | {"where": each.get("where")}, error)
                continue
            if remark is not None:
                self._remark("set", remark, turn_of(message))

    def _do_set(self, message: Json) -> None:
        moving, rests = bool(message.get("moving", False)), bool(message.get("rests", False))
        self._changed_by(message, self._editing.set(message), moving, late=moving and not rests)
        if moving and rests:  # a hand that holds still sees the whole image, until it moves on
            shown = self._imaging.fineness_shown()
            self._wanted = Wanted(turn_of(message), moving=shown is None, shown=shown, rests=shown is None)

    def _do_return(self, message: Json) -> None:
        self._editing.put(self._pins.of(message.get("number")).document)
        self._changed_by(message)

    def _do_focus(self, message: Json) -> None:
        taken, train = self._imaging.there(), self._editing.train
        pixel = screen.pixel_at(taken.values.shape, message.get("x"), message.get("y"))
        share = (pixel[0] + 0.5) / taken.values.shape[0], (pixel[1] + 0.5) / taken.values.shape[1]
        distance = distance_at(train, self._editing.light_field(), share)
        z = focused_train(train.elements, train.sensor, distance).sensor.z
        value = units.text(float(f"{z:.8g}"), "length")
        self._editing.put(self.document.changed(["sensor", "z"], value))
        self._changed_by(message)

    def _changed_by(
        self, message: Json, remark: str | None = None, moving: bool = False, late: bool = False
    ) -> None:
        """Show the document, which a message has changed, and say what was done besides.

        Args:
            message: that changed it.
            remark: what was done besides.
            moving: whether it belongs to a drag.
            late: whether the state follows the image, which is awaited more; the page draws it with the next one.
        """
        self._late = late
        if not late:
            self._tell_state(turn_of(message), moving)
        self._wanted = Wanted(turn_of(message), moving, self._imaging.fineness_shown())
        if remark is not None:
            self._remark(message["do"], remark, turn_of(message))

    def _remark(self, doing: str, words: str, turn: int) -> None:
        """Say what was done besides."""
        self._tell("refused", {"do": doing, "words": words, "where": None, "turn": turn, "done": True})

    def _tell_late(self, turn: int) -> None:
        """Tell the state that was to follow the image."""
        if self._late:
            self._late = False
            self._tell_state(turn, moving=True)

    def _tell_state(self, turn: int, moving: bool = False) -> None:
        document, history = self.document, self._editing.history
        grid = self._editing.grid
        told: StateMessage = {
            "turn": turn,
            "document": None if moving else cast(BenchDocument, document.as_json()),
            "undo": history.can_undo,
            "redo": history.can_redo,
            "grid": None if grid is None else list(grid.shape),
            "bands": None if grid is None or grid.wavelengths is None else list(grid.wavelengths),
            "side": self._side(moving),
        }
        self._tell("state", told)

    def _side(self, moving: bool) -> Side:
        """The side view of the document; drawn again if it has changed."""
        document, train, axis = self.document, self._editing.train, self._look.axis
        field = self.offered.field(document.light_field)
        of = field, field.is_open, axis, moving
        if self._drawn is None or self._drawn[0] is not document or self._drawn[1] != of:
            seen, aperture = None, None
            if field.is_open:
                whole = field.whole()
                views = whole if document.views is None else whole[document.views.slices]
                seen = views.transformed(document.aperture.rays)
                aperture = drawn_aperture(document.aperture, views, train, axis)
            found = side(self._editing.described, seen, self._editing.grid, aperture, axis, moving)
            self._drawn = document, of, found
        return self._drawn[2]

    def _opening(self, done: int, total: int) -> None:
        self._tell("progress", {"done": done, "total": total, "words": "Opening the light field"})
        if self._closed:
            raise Superseded

    def _improve(self) -> None:
        """Put better light fields in the place of a coarse one, and show the image that they make."""

        def progress(done: int, total: int) -> None:
            self._tell("progress", {"done": done, "total": total, "words": "Rendering more and finer views"})
            self._check_wanted()

        document, shown = self.document, self._imaging.shown
        try:
            while self.offered.improve(document.light_field, progress):
                pass
        except (InputError, MemoryError) as error:
            told = {"do": "load", "words": str(_in_words(error)), "where": None, "turn": self._turn}
            self._tell("refused", told)
        now = self.offered.field(document.light_field)
        if document.views is not None and shown is not None and shown.whole().shape[:2] != now.whole().shape[:2]:
            self._editing.put(replace(document, views=None))  # they were counted among fewer views
        self._tell_state(self._turn)
        self._wanted = Wanted(self._turn, moving=False, shown=WHOLE)

    def _finish(self) -> None:
        """Put better light fields in the place of a coarse one, before a result that lasts."""
        if self.offered.field(self.document.light_field).better is not None:
            self._improve()

    def _make_picture(self) -> None:
        wanted = self._wanted
        assert wanted is not None
        self._turn = wanted.turn
        field = self.offered.field(self.document.light_field)
        try:
            if not field.is_open:
                self._opening(0, 1)
                field.whole(self._opening)
                self._tell_state(wanted.turn)
            if remark := self._editing.add_colours():
                self._tell_state(wanted.turn)
                self._remark("set", remark, wanted.turn)
            taken = self._imaging.make(wanted)
        except (InputError, MemoryError) as error:
            self._wanted = None
            self._imaging.none()
            self._tell("no picture", {"turn": wanted.turn, "words": str(_in_words(error))})
            self._tell_late(wanted.turn)
            return
        self._tell_picture(taken, wanted)
        self._tell_late(wanted.turn)
        self._wanted = wanted.then(taken.fineness)
        if not taken.coarse and not wanted.moving and not self._inbox.supersedes(False):
            self._tell("notes", {"turn": wanted.turn, "notes": self._imaging.notes(taken)})

    def _tell_picture(self, taken: Taken, wanted: Wanted) -> None:
        exposure, look = self.document.exposure, self._look
        parts, values = taken.photodiodes, self._displayed(taken)
        self._white = white = screen.white_of(values) if exposure is None else exposure
        found, same = (None, False) if taken.coarse else self._pins.against_reference(taken.values)
        channels = taken.values.shape[2] if taken.values.ndim == 3 else 0
        told: PictureMessage = {
            "turn": wanted.turn,
            "coarse": taken.coarse,
            "moving": wanted.moving,
            "shape": (values.shape[0], values.shape[1]),
            "white": white,
            "look": look.as_json,
            "channels": channels,
            "photodiodes": (len(parts), len(parts[0])),
            "missing": taken.image.missing_rays,
            "took": round(1000 * taken.seconds, 1),
            "psnr": found,
            "same": same,
            "histogram": None if taken.coarse or wanted.moving else screen.histogram(values, white, look),
        }
        self._tell("picture", told, [screen.jpeg(values, white, taken.coarse or wanted.moving, look)])

    def _displayed(self, taken: Taken) -> screen.Picture:
        """The image, or those of photodiodes in their order on the sensor: `codes` turns both order and images."""
        parts = taken.photodiodes
        if not self._look.apart or len(parts) * len(parts[0]) == 1:
            return taken.values
        found: screen.Picture = np.concatenate([np.concatenate(row, axis=1) for row in parts], axis=0)
        return found

    # --- questions ---

    def _do_look(self, message: Json) -> None:
        before, self._look = self._look, Look.of_json(message.get("look"))
        if self._look.axis != before.axis:
            self._tell_state(turn_of(message))
        if replace(self._look, axis=before.axis) == before:
            return
        self._tell_pins()
        if self._imaging.taken is not None and self._wanted is None:
            self._tell_picture(self._imaging.taken, Wanted(turn_of(message), moving=False))

    def _do_pin(self, _: Json) -> None:
        self._finish()
        self._pins.add(self.document, self._whole().values, self._white)
        self._tell_pins()

    def _do_unpin(self, message: Json) -> None:
        if "number" in message:
            self._pins.remove(message["number"])
        else:
            self._pins.clear()
        self._tell_pins()

    def _do_compare(self, message: Json) -> None:
        self._pins.compare(message.get("number"))
        self._tell_pins()

    def _tell_pins(self) -> None:
        taken = self._imaging.taken
        shown = None if taken is None or taken.coarse else taken.values
        self._tell("pins", *self._pins.message(self._look, shown))

    def _do_value(self, message: Json) -> None:
        taken = self._imaging.there()
        values = self._displayed(taken)
        rows, columns = taken.values.shape[:2]
        pixel = screen.pixel_at(values.shape, message.get("x"), message.get("y"))
        inside = pixel[0] % rows, pixel[1] % columns
        numbers = None if taken.recording is None else taken.recording.values
        recorded = None if numbers is None else np.atleast_1d(numbers[inside]).tolist()
        self._tell(
            "value",
            {
                "x": message["x"],
                "y": message["y"],
                "place": screen.place_of(self._editing.train.sensor, inside),
                "irradiance": np.atleast_1d(values[pixel]).tolist(),
                "recorded": recorded,
            },
        )

    def _do_ask(self, message: Json) -> None:
        what, train = message.get("what"), self._editing.train
        found: Mapping[str, Any]
        buffers: Sequence[bytes] = []
        if what in (*decoded.QUESTIONS, "scrub"):
            self._finish()
        if what in decoded.QUESTIONS:
            found, buffers = self._decoding.answer(message)
        elif what == "profile":
            found = screen.profile(self._imaging.whole().values, train.sensor, message.get("ends"))
        elif what == "scrub":
            found, buffers = self._frames(message)
        else:
            found, buffers = answers.answer(what, message, train, self._editing.light_field())
        self._tell("answer", {"what": what, **found}, buffers)

    def _frames(self, message: Json) -> tuple[Json, list[bytes]]:
        """The frames of a sweep, to be looked at one by one."""
        sweep = sweep_of(message, self.document)
        pictures = [screen.jpeg(values, self._white, look=self._look) for values in self._swept(sweep.documents)]
        return {"values": list(sweep.values), "label": sweep.label}, pictures

    def _do_export(self, message: Json) -> None:
        if message.get("what") != "toml":
            self._finish()
        what = message.get("what")
        if what == "film":
            sweep = sweep_of(message, self.document)
            frames = [screen.codes(each, self._white) for each in self._swept(sweep.documents)]
            name, kind, data = sweep.film(frames)
        else:
            taken = None if what == "toml" or self._imaging.taken is None else self._whole()
            name, kind, data = export.exported(what, self._editing, taken, self._white)
        self._tell("file", {"name": name, "type": kind}, [data])

    def _whole(self) -> Taken:
        """The whole image of the document; unless the exposure is stated, its own level is white from now on."""
        taken = self._imaging.whole()
        if self.document.exposure is None:
            self._white = screen.white_of(self._displayed(taken))
        return taken

    def _swept(self, documents: Sequence[Document]) -> Any:
        """Whole images of documents, one at a time, with progress; all with the white level of the present one."""
        self._whole()
        for number, document in enumerate(documents):
            self._tell("progress", {"done": number, "total": len(documents), "words": "Making the film"})
            checked, described = self._editing.checked(document)
            yield self._imaging.take(WHOLE, checked, described).values
        self._tell("progress", {"done": len(documents), "total": len(documents), "words": "Making the film"})


def _in_words(error: InputError | MemoryError) -> InputError:
    """The error to show; lack of memory is reported as an input error, not as a bug."""
    if isinstance(error, InputError):
        return error
    return InputError(
        "this machine has too little memory for this: undo it, or use fewer pixels, or elements that spread light "
        "less"
    )
