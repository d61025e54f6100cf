"""The bench in a notebook: the same front end as an anywidget (Jupyter, VS Code, marimo)."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from importlib import resources
from typing import Any
from weakref import WeakValueDictionary

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.bench.document import Document
from vcc.bench.inbox import Broken
from vcc.bench.offered import Field, Offered
from vcc.bench.session import Session
from vcc.bench.splat_views import SplatViews
from vcc.camera import Camera
from vcc.fields.samples import check_is_light_field
from vcc.files.camera_reading import Beside
from vcc.files.camera_writing import NOWHERE, tables_of_train
from vcc.light_field import LightField
from vcc.optics.train import Train
from vcc.sources.splats import SplatScene

NAME = "light field"
"""Name of a notebook's light field on a bench."""


def bench_of(camera: Train, light_field: LightField | SplatScene) -> Any:
    """A camera on the bench, as a widget; see `vcc.Camera.bench`."""
    if not isinstance(light_field, SplatScene):
        check_is_light_field(light_field)
    if not isinstance(light_field, LightField | SplatScene):
        raise InputError(
            "the bench needs a light field in memory: pass stored.read(), or a part, stored[a:b, c:d]"
        )
    return _kind()(_offered(camera, light_field))


def _offered(camera: Train, light_field: LightField | SplatScene) -> Offered:
    tables, arrays = tables_of_train(camera, NOWHERE / "camera.toml")
    document = Document({"elements": [], **tables}, NAME)
    return Offered({NAME: _field(light_field, camera)}, document, Beside(NOWHERE, frozenset(), arrays))


_fields: WeakValueDictionary[int, Field] = WeakValueDictionary()


def _field(light_field: LightField | SplatScene, camera: Train) -> Field:
    """The `Field` of a light field, reused with its coarser copies if a cell runs again."""
    if isinstance(light_field, SplatScene):
        return SplatViews.before(camera, light_field).field()
    found = _fields.get(id(light_field))  # a Field keeps its light field alive, so the id stays unique
    if found is None:
        found = _fields[id(light_field)] = Field(light_field)
    return found


@functools.cache
def _kind() -> Any:
    """The class of the widget, created on demand because it requires anywidget."""
    with checks.package("the bench in a notebook", "anywidget", "notebook"):
        import anywidget

    class Bench(anywidget.AnyWidget):  # type: ignore[misc]
        """A camera on the optical bench, in a cell.

        Args:
            offered: the inputs of the bench.
        """

        _esm = (resources.files("vcc.bench") / "static" / "bench.js").read_text(encoding="utf-8")

        def __init__(self, offered: Offered) -> None:
            super().__init__()
            self._session = Session(offered, self._tell)
            self.on_msg(self._hear)

        @property
        def camera(self) -> Camera:
            """The camera as it is on the bench now."""
            train = self._session.document.train(self._session.offered.beside).train
            return Camera(train.elements, train.sensor)

        def __repr__(self) -> str:
            return "The optical bench of a camera. It is drawn where Python runs: run this cell again."

        def close(self) -> None:
            """End the session, and remove the bench from the notebook."""
            self._session.close()
            super().close()

        def _tell(self, message: dict[str, Any], buffers: Sequence[bytes]) -> None:
            self.send(message, list(buffers) or None)

        def _hear(self, _: Any, message: Any, buffers: Sequence[Any] | None) -> None:
            self._tell({"is": "heard"}, ())
            try:
                self._session.receive(message, [bytes(each) for each in buffers or ()])
            except Broken:
                self.close()

    return Bench
