"""Pinned states of a bench: documents with their images, compared with one of them by PSNR."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.bench import messages
from vcc.bench.document import Document, shown
from vcc.bench.screen import Look, Picture, jpeg, psnr, thumbnail

MOST_PINS = 12
MOST_BYTES = 2**27
"""Bytes of all images that are kept."""
MOST_WORDS = 60


@dataclass(frozen=True, eq=False, repr=False)
class Pinned(Brief):
    """A pinned state.

    Args:
        number: its name.
        document: the state.
        values: its image, in the orientation of the sensor.
        white: the irradiance shown as white.
        thumbnail: a JPEG.
        words: the difference from the pin before, or the camera.
    """

    number: int
    document: Document
    values: Picture
    white: float
    thumbnail: bytes
    words: str


class Pins:
    """The pinned states of a session, in their order; images are compared with the reference."""

    def __init__(self) -> None:
        self._kept: list[Pinned] = []
        self._reference: int | None = None
        self._count = 0

    def add(self, document: Document, values: Picture, white: float) -> None:
        """Pin a state, which becomes the reference.

        Raises:
            InputError: there are `MOST_PINS` pins, or their images would have more than `MOST_BYTES`.
        """
        if len(self._kept) >= MOST_PINS:
            raise InputError(f"there are {MOST_PINS} pinned states, the most: unpin one first")
        held = sum(each.values.nbytes for each in self._kept)
        if self._kept and held + values.nbytes > MOST_BYTES:
            raise InputError(
                f"the pinned images have {held / 2**20:.0f} MiB, and a bench keeps up to "
                f"{MOST_BYTES // 2**20} MiB: unpin one first"
            )
        before = self._kept[-1].document if self._kept else None
        self._count += 1
        words = _difference(before, document)
        self._kept.append(Pinned(self._count, document, values, white, thumbnail(values, white), words))
        self._reference = self._count

    def of(self, number: Any) -> Pinned:
        """A pinned state by its number.

        Raises:
            InputError: there is none.
        """
        for each in self._kept:
            if each.number == number and type(number) is int:
                return each
        there = ", ".join(str(each.number) for each in self._kept) or "none"
        raise InputError(f"there is no pinned state {shown(number)}: there are {there}")

    def remove(self, number: Any) -> None:
        """Forget a state."""
        self._kept.remove(self.of(number))
        if self._reference == number:
            self._reference = self._kept[-1].number if self._kept else None

    def clear(self) -> None:
        """Forget all states."""
        self._kept.clear()
        self._reference = None

    def compare(self, number: Any) -> None:
        """Choose the reference; None for none."""
        self._reference = None if number is None else self.of(number).number

    @property
    def reference(self) -> Pinned | None:
        """The state with which images are compared."""
        return next((each for each in self._kept if each.number == self._reference), None)

    def against_reference(self, values: Picture) -> tuple[float | None, bool]:
        """The PSNR of an image, dB (None if it cannot be compared, or is equal), and whether it is equal."""
        reference = self.reference
        found = None if reference is None else psnr(values, reference.values, reference.white)
        return (None, found is not None) if found is None or math.isinf(found) else (found, False)

    def message(self, look: Look, shown: Picture | None) -> tuple[messages.PinsMessage, list[bytes]]:
        """All pins and the image that is shown, compared; thumbnails, then the image of the reference."""
        reference = self.reference
        now, equal = (None, False) if shown is None else self.against_reference(shown)
        pins: list[messages.Pin] = []
        for each in self._kept:
            found, same = self.against_reference(each.values)
            pins.append(
                {
                    "number": each.number,
                    "words": each.words,
                    "psnr": found,
                    "same": same,
                    "compared": each is reference,
                }
            )
        pictures = [each.thumbnail for each in self._kept]
        if reference is not None:
            pictures.append(jpeg(reference.values, reference.white, look=look))
        return {"pins": pins, "psnr": now, "same": equal}, pictures


def _difference(before: Document | None, after: Document) -> str:
    """The values that changed between two documents, or the elements of the first one."""
    elements = after.camera.get("elements", [])
    named = [str(each.get("name") or each.get("kind")) for each in elements]
    whole = ", ".join([*named, "sensor"])
    if before is None or len(before.camera.get("elements", [])) != len(elements):
        return _cut(whole)
    one, other = dict(_leaves(before.as_json())), dict(_leaves(after.as_json()))
    found = []
    for path, value in other.items():
        if one.get(path) != value:
            of = named[int(path[2])] if path[:2] == ("camera", "elements") else str(path[-2] if path[1:] else "")
            found.append(f"{of} {path[-1]} {shown(value, 16).strip(chr(34))}".replace("_", " ").strip())
    return _cut(", ".join(found) or whole)


def _leaves(tree: Any, path: tuple[Any, ...] = ()) -> Any:
    if isinstance(tree, dict):
        for key, each in tree.items():
            yield from _leaves(each, (*path, key))
    elif isinstance(tree, list) and path[:2] == ("camera", "elements") and len(path) == 2:
        for number, each in enumerate(tree):
            yield from _leaves(each, (*path, number))
    else:
        yield path, tree


def _cut(words: str) -> str:
    return words if len(words) <= MOST_WORDS else f"{words[:MOST_WORDS]}…"
