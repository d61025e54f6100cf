"""The bench in a notebook: the widget's messages are those of any client, its camera is the one on the bench."""

import gc
import sys
import threading
import weakref

import numpy as np
import pytest

import vcc
from tests.bench.on_bench import NOWHERE, START, noise
from vcc import InputError
from vcc.bench import widget
from vcc.units import mm


def camera():
    train = START.train(NOWHERE).train
    code = vcc.Mask(np.random.default_rng(0).uniform(0, 1, (20, 20)), z=13 * mm, width=15 * mm, name="code")
    return vcc.Camera([*train.elements, code], train.sensor)


def test_without_anywidget_it_says_what_to_install(monkeypatch):
    widget._kind.cache_clear()
    monkeypatch.setitem(sys.modules, "anywidget", None)
    with pytest.raises(InputError, match=r'pip install "virtual-computational-camera\[notebook\]"'):
        camera().bench(noise())
    with pytest.raises(InputError, match=r"light_field is a vcc\.LightField"):
        camera().bench(np.zeros((2, 2, 4, 4)))


def test_a_camera_of_arrays_is_on_the_bench_as_it_is():
    offered = widget._offered(camera(), noise())
    train = offered.start.train(offered.beside).train
    assert vcc.Camera(train.elements, train.sensor) == camera()
    empty = widget._offered(vcc.Camera([], camera().sensor), noise())
    assert empty.start.changed(["elements"], []).train(empty.beside).train.elements == ()


def test_a_cell_that_is_run_again_makes_no_coarser_copies_again():
    light_field = noise()
    one, again = widget._offered(camera(), light_field), widget._offered(camera(), light_field)
    assert one.field(widget.NAME) is again.field(widget.NAME)
    assert one.field(widget.NAME) is not widget._offered(camera(), noise()).field(widget.NAME)
    gone = weakref.ref(light_field)
    del light_field, one, again
    gc.collect()
    assert gone() is None


def test_a_camera_that_no_file_can_hold_is_refused():
    own = vcc.Camera([vcc.Mask(lambda x, y: x > 0, width=1 * mm)], camera().sensor)
    with pytest.raises(InputError, match="a piece of Python that a camera file cannot"):
        widget._offered(own, noise())


def test_a_widget_speaks_as_any_client(monkeypatch):
    anywidget = pytest.importorskip("anywidget")
    widget._kind.cache_clear()
    told, there = [], threading.Condition()

    def send(self, message, buffers=None):
        with there:
            told.append((message, buffers))
            there.notify_all()

    monkeypatch.setattr(anywidget.AnyWidget, "send", send)
    shown = camera().bench(noise())
    shown._handle_custom_msg({"do": "set", "where": ["sensor", "z"], "value": "53 mm", "turn": 4}, [])

    def pictures():
        return [buffers for message, buffers in told if message["is"] == "picture" and not message["coarse"]]

    assert told[0] == ({"is": "heard"}, None)  # before anything that takes time
    with there:
        assert there.wait_for(pictures, 60)
    assert pictures()[0][0][:2] == b"\xff\xd8"  # as JPEG begins
    assert shown.camera.sensor.z == pytest.approx(53 * mm)
    assert shown.camera.elements == camera().elements
    assert "render" in shown._esm
    assert (
        "run this cell again" in shown._repr_mimebundle_()[0]["text/plain"]
    )  # where a notebook is read without Python
    shown._handle_custom_msg({"do": "format"}, [])
    assert shown._session.join(300)
