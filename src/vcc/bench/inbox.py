"""Messages of a client that wait: validated, bounded, and a newer value in place of an older one."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Sequence
from typing import Any

from vcc.bench import decoded
from vcc.bench.document import shown

Json = dict[str, Any]

MOST_WAITING = 200
"""Messages that may wait; a client that sends more is disconnected."""
MOST_BYTES = 2**26
"""Bytes of their buffers."""

CHANGES = (
    "hello",
    "set",
    "upload",
    "add",
    "remove",
    "duplicate",
    "reorder",
    "undo",
    "redo",
    "load",
    "focus",
    "return",
)
"""Messages that change the image."""
QUESTIONS = ("pin", "unpin", "compare", "look", "value", "ask", "export")
"""Messages that leave the image as it is."""


class Broken(Exception):
    """A message that the front end never sends; the client is disconnected."""


class Inbox:
    """Messages in their order."""

    def __init__(self) -> None:
        self._waiting: deque[tuple[Json, list[bytes]]] = deque()

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def put(self, message: object, buffers: Sequence[bytes]) -> None:
        """Add a message.

        Raises:
            Broken: not a message of a bench, or too many messages wait.
        """
        checked = _checked(message)
        if self._waiting and _replaces(checked, self._waiting[-1][0]):
            self._waiting.pop()
        if len(self._waiting) >= MOST_WAITING:
            raise Broken(f"more than {MOST_WAITING} messages wait")
        held = sum(len(each) for _, several in self._waiting for each in several)
        if held and held + sum(map(len, buffers)) > MOST_BYTES:
            raise Broken(f"files of more than {MOST_BYTES // 2**20} MiB wait")
        self._waiting.append((checked, list(buffers)))

    def take(self) -> tuple[Json, list[bytes]]:
        """Remove and return the first one."""
        return self._waiting.popleft()

    def clear(self) -> None:
        """Remove all."""
        self._waiting.clear()

    def supersedes(self, moving: bool) -> bool:
        """Whether a waiting message makes an image obsolete.

        During a drag, each image is finished before the next starts: images made during a drag are quick, and
        if each new message stopped the work, a fast drag would show no image at all.
        """
        changes = [message for message, _ in list(self._waiting) if message["do"] in CHANGES]
        return any(not (moving and message.get("moving")) for message in changes)

    def asks_about_next_image(self) -> bool:
        """Whether the first message asks about the image to be made, and that image is still needed."""
        waiting = [message for message, _ in self._waiting]
        if not waiting:
            return False
        changed = any(message["do"] in CHANGES for message in waiting)
        return not changed and waiting[0].get("what") in decoded.QUESTIONS


def turn_of(message: Json) -> int:
    """The client's number of a message."""
    return int(message.get("turn", 0))


def _checked(message: object) -> Json:
    """The message, validated."""
    if not isinstance(message, dict) or message.get("do") not in (*CHANGES, *QUESTIONS):
        raise Broken(f"no message of a bench: {shown(message)}")
    if type(message.get("turn", 0)) is not int or not -(2**53) < message.get("turn", 0) < 2**53:
        raise Broken("turn is a whole number")
    return message


def _replaces(newer: Json, older: Json) -> bool:
    """Whether a message makes the one before it obsolete: a newer value of the same parameter or question."""
    same = newer["do"] == older["do"]
    if same and newer["do"] == "set":
        return bool(older.get("moving")) and json.dumps(newer.get("where")) == json.dumps(older.get("where"))
    if same and newer.get("what") in decoded.QUESTIONS:
        return bool(newer["what"] == older.get("what"))
    return bool(same and newer["do"] in ("value", "look"))
