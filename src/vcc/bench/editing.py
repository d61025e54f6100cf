"""Changes of a bench's document that a client requests: of values, of elements, of the whole camera."""

from __future__ import annotations

from collections.abc import Sequence
from collections.abc import Set as AbstractSet
from dataclasses import replace
from typing import Any

from vcc.base import units
from vcc.base.errors import InputError
from vcc.bench import additions
from vcc.bench.document import Document, History, shown
from vcc.bench.offered import Offered
from vcc.bench.picture import light_field_of
from vcc.fields.grid import Grid
from vcc.files.camera_reading import TrainAsWritten, tables_of_text
from vcc.light_field import LightField
from vcc.optics.train import Train, touch

Json = dict[str, Any]

COLOURS = ("610 nm", "540 nm", "465 nm")
"""Wavelengths that red, green and blue get with the first element that depends on them."""
COLOURED = f"The light field has got the wavelengths {', '.join(COLOURS)}, because an element depends on them."


class Editing:
    """The document of a session, with its history and the camera that it describes.

    Each method that takes a message either puts a valid document, or raises `InputError` and changes nothing. Some
    return a remark on what was changed besides.

    Args:
        offered: the inputs of the bench.

    Attributes:
        history: of documents.
        described: the camera that the present one describes.
    """

    def __init__(self, offered: Offered) -> None:
        self.offered = offered
        self.history = History(offered.start)
        self.described = offered.start.train(offered.beside)
        self._read = offered.start, self.described

    @property
    def document(self) -> Document:
        """The document shown now."""
        return self.history.present

    @property
    def train(self) -> Train:
        """Its camera."""
        return self.described.train

    def train_of(self, document: Document) -> TrainAsWritten:
        """The camera that a document describes; the newest is not read again.

        Raises:
            InputError: see `Document.train`.
        """
        if self._read[0] is not document:
            self._read = document, document.train(self.offered.beside)
        return self._read[1]

    def light_field(self, progress: Any = None) -> LightField:
        """The light field before the camera: the selected views, with their wavelengths, in their place."""
        return light_field_of(self.offered.field(self.document.light_field), self.document, 1, progress)

    @property
    def grid(self) -> Grid | None:
        """The grid of the whole light field in its place before the camera; None until it is open."""
        field = self.offered.field(self.document.light_field)
        if not field.is_open:
            return None
        return self.document.coloured(field.whole()).grid.moved(self.document.aperture.rays)

    def greet(self, given: Any) -> None:
        """Start with the document that a client sends."""
        document, self.described = self.checked(Document.of_json(given))
        self.history = History(document)

    def checked(self, document: Document) -> tuple[Document, TrainAsWritten]:
        """The document with its sensor's place as a length, and the camera; both are valid."""
        document = document.settled(self.offered.beside)
        described = self.train_of(document)
        field = self.offered.field(document.light_field)
        if field.is_open:
            if document.views is not None:
                document.views.check(field.whole().shape)
            document.coloured(field.whole())
            if document.aperture.is_moved:
                document.aperture.check(field.whole().grid)
        if document.noise and described.train.sensor.electronics is None:
            raise InputError("noise requires sensor electronics, and this sensor has none: add them first")
        return document, described

    def put(self, document: Document, moving: bool = False) -> None:
        """Validate another document and show it."""
        document, self.described = self.checked(document)
        self.history.put(document, moving)

    # --- messages ---

    def set(self, message: Json) -> str | None:
        """Change a value; return a remark on what was changed with it."""
        where, value = message.get("where"), message.get("value")
        remark = None
        changed = self.document
        if where == ["noise"] and value is True and self.train.sensor.electronics is None:
            changed = changed.changed(["sensor", "electronics"], {})
            remark = "The sensor has got electronics, with the default numbers: see its fields."
        if where == ["sensor", "microlens"] and value == {} and self.train.sensor.photodiodes == (1, 1):
            changed = changed.changed(["sensor", "photodiodes"], [1, 2])
            remark = "A microlens needs several photodiodes: the pixels have got two, side by side."
        if where == ["sensor", "electronics"] and value is None and changed.noise:
            changed = changed.changed(["noise"], False)
            remark = "Noise requires electronics, and is switched off."
        return _both(remark, self._set(changed, where, value, bool(message.get("moving", False))))

    def _set(self, changed: Document, where: Any, value: Any, moving: bool = False) -> str | None:
        for place, each in additions.made_whole(where, value, changed.camera, self.described):
            changed = changed.changed(place, each)
        return self._put_coloured(changed, moving)

    def _put_coloured(self, document: Document, moving: bool = False) -> str | None:
        """Put a document, with wavelengths if it needs them; return a remark on them."""
        coloured = self._with_colours(document)
        self.put(coloured, moving)
        return None if coloured is document else COLOURED

    def add_colours(self) -> str | None:
        """Add wavelengths to a document that needs them, which a file or an address describes; return a remark."""
        coloured = self._with_colours(self.document)
        if coloured is self.document:
            return None
        if self.history.can_undo:
            self.put(coloured)
        else:
            coloured, self.described = self.checked(coloured)
            self.history = History(coloured)
        return COLOURED

    def _with_colours(self, document: Document) -> Document:
        """With wavelengths of red, green and blue if an element depends on them and the light field has none."""
        field = self.offered.field(document.light_field)
        if document.wavelengths is not None or not field.is_open:
            return document
        grid = field.whole().grid
        if grid.wavelengths is not None or grid.channels != len(COLOURS):
            return document
        depends = any(each.depends_on_band for each in self.train_of(document).elements)
        return replace(document, wavelengths=COLOURS) if depends else document

    def upload(self, message: Json, buffers: Sequence[bytes]) -> str | None:
        """Use a file as the cells of a pattern; return a remark if it was reduced."""
        cells, remark = additions.cells_of(message.get("name"), buffers)
        return _both(remark, self._set(self.document, message.get("where"), cells))

    def add(self, message: Json) -> str | None:
        """Add an element, at a given place or at one that suits it."""
        entry = additions.new_element(message.get("kind"), message.get("z"), self.train, self._names())
        elements = [*self.document.camera.get("elements", []), entry]
        return self._put_coloured(replace(self.document, camera={**self.document.camera, "elements": elements}))

    def remove(self, message: Json) -> None:
        """Remove an element."""
        self.put(self.document.changed(["elements", self._element(message)], None))

    def duplicate(self, message: Json) -> None:
        """Put a copy of an element behind it."""
        number = self._element(message)
        elements = list(self.document.camera["elements"])
        copy, original = dict(elements[number]), self.described.elements[number]
        wanted = str(copy.get("name") or original.kind)
        copy["name"] = additions.free_name(wanted, self._names())
        step = max(original.length, self.train.sensor.z / 50)
        z = min(original.z + step, self.train.sensor.z)
        copy["z"] = units.text(float(f"{z:.4g}"), "length")
        elements.insert(number + 1, copy)
        self.put(replace(self.document, camera={**self.document.camera, "elements": elements}))

    def reorder(self, message: Json) -> None:
        """Swap positions along the axis with the neighbour before (−1) or behind (1)."""
        number, by = self._element(message), message.get("by")
        elements = self.described.elements
        if by not in (-1, 1) or isinstance(by, bool):
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
        changed, tables = self.document, self.document.camera["elements"]
        for one, another in ((number, other), (other, number)):
            changed = changed.changed(["elements", one, "z"], tables[another].get("z", "0 mm"))
        self.put(changed)

    def undo(self, _: Json) -> None:
        """Go back one step."""
        self.history.undo()
        self.described = self.document.train(self.offered.beside)

    def redo(self, _: Json) -> None:
        """Go forward one step."""
        self.history.redo()
        self.described = self.document.train(self.offered.beside)

    def load(self, message: Json) -> str | None:
        """Show a camera from text, from the gallery, or from a document."""
        if "toml" in message:
            if not isinstance(message["toml"], str):
                raise InputError("a camera file is text")
            document = replace(self.document, camera=tables_of_text(message["toml"]))
        elif "gallery" in message:
            title = message["gallery"]
            if not isinstance(title, str) or title not in self.offered.gallery:
                raise InputError(f"there is no camera {shown(title)}: there are {', '.join(self.offered.gallery)}")
            document = self.offered.gallery[title]
        else:
            document = Document.of_json(message.get("document"))
        return self._put_coloured(document)

    def _element(self, message: Json) -> int:
        number = message.get("element")
        count = len(self.described.elements)
        if type(number) is not int or not 0 <= number < count:
            raise InputError(f"there is no element {shown(number)}: there are {count}, counted from 0")
        return number

    def _names(self) -> AbstractSet[str]:
        return {element.name for element in self.described.elements}


def _both(one: str | None, other: str | None) -> str | None:
    """Two remarks as one."""
    return " ".join(each for each in (one, other) if each) or None
