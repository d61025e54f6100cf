"""Documents of the bench: changed by path, undone, read by the readers of camera files."""

import json
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from tests.bench.on_bench import CAMERA, NOWHERE, START
from vcc import Camera, InputError, load_camera
from vcc.bench.document import MOST_HISTORY, MOST_STEPS, Document, History, Views
from vcc.files.camera_reading import Beside, train_of_tables
from vcc.files.camera_writing import tables_of_train


def test_a_document_is_json_and_comes_back():
    document = Document(CAMERA, "noise", Views((0, 1), (1, 2)), 0.5, True)
    assert Document.of_json(json.loads(json.dumps(document.as_json()))) == document


def test_what_is_changed_is_what_was_named():
    moved = START.changed(["sensor", "z"], "53 mm")
    assert moved.camera["sensor"]["z"] == "53 mm"
    assert START.camera["sensor"]["z"] == "52 mm"
    deeper = START.changed(["elements", 1, "pattern", "diameter"], "5 mm")
    assert deeper.train(NOWHERE).train.elements[1].pattern.diameter == pytest.approx(5e-3)
    assert START.changed(["elements", 0, "diameter"], None).train(NOWHERE).elements[0].diameter is None
    assert len(START.changed(["elements", 1], None).camera["elements"]) == 1
    assert START.changed(["exposure"], 2).exposure == 2
    assert START.changed(["exposure"], 2).changed(["exposure"], None) == START
    assert START.changed(["sensor", "electronics", "full_well"], 500).train(NOWHERE).train.sensor.electronics


def test_a_focus_becomes_a_place():
    focused = START.changed(["sensor", "focus"], "1.3 m").settled(NOWHERE)
    assert "focus" not in focused.camera["sensor"]
    assert focused.train(NOWHERE).train.sensor.z == pytest.approx(1 / (1 / 0.05 - 1 / 1.3), rel=1e-12)


def test_elements_keep_the_order_in_which_they_are_listed():
    turned = START.changed(["elements"], CAMERA["elements"][::-1]).train(NOWHERE)
    assert [element.kind for element in turned.elements] == ["mask", "lens"]
    assert [element.kind for element in turned.train.elements] == ["lens", "mask"]


@pytest.mark.parametrize(
    ("where", "value", "words"),
    [
        (["sensor", "z"], "53", 'the camera: sensor: z is "53": a length needs a unit'),
        (["sensor", "shape"], [10**4, 10**4], "a bench supports up to"),
        (["sensor", "z"], float("inf"), "not a valid value"),
        (
            ["elements", 1, "pattern"],
            {"name": "mura", "prime": 10007},
            "prime is 10007; on a bench it is up to 1024",
        ),
        (
            ["elements", 1],
            {"kind": "phase_plate", "surface": {"name": "zernike", "coefficients": ["1 nm"] * 121}},
            "coefficients has 121 entries, and on a bench there are up to 120",
        ),
        (["elements", 7, "z"], "1 mm", "the bench: camera: elements has 2 entries: there is no number 7"),
        (["elements", 1, "pattern"], "secret.npy", "not among the files that may be read here"),
        (["elements", 0, "kind"], "lense", 'did you mean "lens"?'),
        (["elements", 0, "name"], {"a": None}, "not a valid value"),
        (["camera"], {}, "a bench has no"),
        (["light_field"], None, "a bench needs a light field"),
        (["exposure"], -1, "exposure"),
        (["exposure"], "bright", "exposure is a number"),
        (["noise"], 1, "noise is true or false"),
        (["views"], {"rows": [0, 1]}, "views are rows and columns"),
        (["views"], {"rows": [0, 1.5], "columns": [0, 1]}, "rows of views are [first, last]"),
        ([], 1, "is a path"),
        ("z", 1, "is a path"),
        ([0], 1, "is a path"),
        (["elements", "z"], 1, "which has no"),
    ],
)
def test_what_is_refused_is_said_in_words(where, value, words):
    with pytest.raises(InputError, match=re.escape(words)):
        START.changed(where, value).settled(NOWHERE).train(NOWHERE)


def test_views_that_are_not_there_are_refused():
    with pytest.raises(InputError, match=re.escape("rows of views are [0, 3], and there are 3")):
        Views((0, 3), (0, 2)).check((3, 3))


def test_only_files_that_were_named_are_read(tmp_path):
    np.save(tmp_path / "code.npy", np.eye(3))
    np.save(tmp_path / "other.npy", np.eye(3))
    tables = {
        "elements": [{"kind": "mask", "z": "1 mm", "pattern": "code.npy", "width": "5 mm"}],
        "sensor": CAMERA["sensor"],
    }
    seen = Beside(tmp_path)
    train_of_tables(tables, seen)
    assert seen.opened == {"code.npy"}
    document, beside = Document(tables, "noise"), Beside(tmp_path, frozenset(seen.opened))
    assert document.train(beside).train.elements[0].pattern.values.tolist() == np.eye(3).tolist()
    for name in ("other.npy", "../code.npy", f"{tmp_path}/other.npy", "./code.npy"):
        with pytest.raises(InputError, match="not among the files that may be read here"):
            document.changed(["elements", 0, "pattern"], name).train(beside)


def test_arrays_in_memory_are_read_by_their_names(tmp_path):
    tables = {
        "elements": [{"kind": "mask", "z": "1 mm", "pattern": "made.npy", "width": "5 mm"}],
        "sensor": CAMERA["sensor"],
    }
    beside = Beside(tmp_path, frozenset(), {"made.npy": np.eye(4)})
    assert train_of_tables(tables, beside).train.elements[0].pattern.values.shape == (4, 4)


def test_tables_of_a_camera_make_the_same_camera(tmp_path):
    camera = Camera(START.train(NOWHERE).train.elements, START.train(NOWHERE).train.sensor)
    camera.save(tmp_path / "camera.toml")
    tables, arrays = tables_of_train(camera, tmp_path / "camera.toml")
    assert not arrays
    made = train_of_tables(tables, NOWHERE).train
    assert Camera(made.elements, made.sensor) == load_camera(tmp_path / "camera.toml")


# --- history ---


def place(number):
    return START.changed(["sensor", "z"], f"{52 + number} mm")


def test_a_drag_is_one_step():
    history = History(START)
    for number in (1, 2, 3):
        history.put(place(number), moving=True)
    history.put(place(4))
    history.undo()
    assert history.present == START
    history.redo()
    assert history.present == place(4)


def test_undo_amid_a_drag_goes_back_to_where_it_began():
    history = History(START)
    history.put(place(1))
    history.put(place(2), moving=True)
    history.undo()
    assert history.present == place(1)


def test_history_forgets_the_oldest_steps():
    history = History(START)
    for number in range(MOST_STEPS + 50):
        history.put(place(number + 1))
    for _ in range(MOST_STEPS + 60):
        history.undo()
    assert history.present == place(50)
    large = History(START)
    long = "x" * (MOST_HISTORY // 8)
    for number in range(30):
        large.put(START.changed(["elements", 0, "name"], f"{number}{long}"))
    for _ in range(40):
        large.undo()
    assert large.present != START


@given(some.lists(some.one_of(some.integers(0, 5), some.sampled_from(["undo", "redo"])), max_size=40))
@settings(max_examples=60, deadline=None)
def test_history_is_a_list_and_a_place_in_it(steps):
    history, listed, here = History(START), [START], 0
    for step in steps:
        if step == "undo":
            history.undo()
            here = max(here - 1, 0)
        elif step == "redo":
            history.redo()
            here = min(here + 1, len(listed) - 1)
        else:
            history.put(place(step))
            if place(step) != listed[here]:
                listed[here + 1 :] = [place(step)]
                here += 1
        assert history.present == listed[here]
        assert (history.can_undo, history.can_redo) == (here > 0, here < len(listed) - 1)


JSON = some.recursive(
    some.none()
    | some.booleans()
    | some.integers(-3, 3)
    | some.floats()
    | some.sampled_from(["z", "5 mm", "lens"]),
    lambda inner: (
        some.lists(inner, max_size=3) | some.dictionaries(some.sampled_from(["name", "z", "kind"]), inner)
    ),
    max_leaves=8,
)
PLACES = some.lists(
    some.sampled_from(["elements", "sensor", "views", "z", "pattern", "shape", "name", 0, 1, 2]), max_size=4
)


@given(PLACES, JSON)
@settings(max_examples=300, deadline=None)
def test_whatever_is_set_is_taken_or_refused(where, value):
    try:
        changed = START.changed(where, value).settled(NOWHERE)
        changed.train(NOWHERE)
    except InputError:
        return
    assert Document.of_json(json.loads(json.dumps(changed.as_json(), allow_nan=False))) == changed
