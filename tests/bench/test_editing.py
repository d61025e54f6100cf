"""Changes of a bench's document, without images: steps back and forth, and the real lenses of the menu."""

import zipfile

import numpy as np
import pytest

import vcc
from tests.bench.on_bench import START, offered
from vcc.bench import additions, export
from vcc.bench.editing import Editing
from vcc.files.camera_families import ELEMENT_KINDS
from vcc.prescriptions import built_in_lenses

KINDS = [kind for kind in ELEMENT_KINDS if kind not in additions.FROM_FILES]


def step(editing, random):
    """One random change, which may be a drag; refusals change nothing."""
    element, number = int(random.integers(4)), float(random.uniform(5, 48))
    change = random.integers(8)
    if change == 0:
        editing.add({"kind": str(random.choice(KINDS)), "z": None})
    elif change < 3:
        for moved in (number + 1, number + 0.5):
            editing.set({"where": ["elements", element, "z"], "value": f"{moved} mm", "moving": True})
        editing.set({"where": ["elements", element, "z"], "value": f"{number} mm"})
    elif change == 3:
        editing.set({"where": ["sensor", "pitch"], "value": f"{number / 20} mm"})
    elif change == 4:
        editing.set({"where": ["exposure"], "value": None if number < 20 else number})
    else:
        getattr(editing, ("remove", "duplicate", "reorder")[change - 5])({"element": element, "by": 1})


@pytest.mark.parametrize("seed", range(3))
def test_forty_random_steps_are_undone_and_redone_to_the_same_documents(seed):
    random, editing = np.random.default_rng(seed), Editing(offered())
    documents = [START.as_json()]
    while len(documents) <= 40:
        try:
            step(editing, random)
        except vcc.InputError:
            if editing.document.as_json() != documents[-1]:  # amid a drag
                editing.undo({})
        if editing.document.as_json() != documents[-1]:
            documents.append(editing.document.as_json())
    for way, expected in ((editing.undo, documents[-2::-1]), (editing.redo, documents[1:])):
        for document in expected:
            way({})
            assert editing.document.as_json() == document
            assert editing.described.elements == editing.document.train(editing.offered.beside).elements
    editing.redo({})
    assert editing.document.as_json() == documents[-1]


@pytest.mark.parametrize("name", [*KINDS, *built_in_lenses()])
def test_each_element_of_the_menu_is_added_and_dragged_and_its_file_and_program_make_the_same_camera(
    name, tmp_path, monkeypatch
):
    editing = Editing(offered(start=START.changed(["sensor", "z"], "400 mm")))
    editing.add({"kind": name})
    editing.set({"where": ["elements", 2, "z"], "value": "150 mm", "moving": True})
    editing.set({"where": ["elements", 2, "z"], "value": "140 mm"})
    camera = vcc.Camera(editing.train.elements, editing.train.sensor)
    added = editing.described.elements[2]
    assert added.z == 0.14
    if name in built_in_lenses():
        assert added.prescription == vcc.load_lens(name, model="real").prescription
    monkeypatch.chdir(tmp_path)
    for what in ("toml", "python"):
        file, _, data = export.exported(what, editing, None, 1.0)
        (tmp_path / file).write_bytes(data)
        if file.endswith(".zip"):
            zipfile.ZipFile(file).extractall()
    assert vcc.load_camera("camera.toml") == camera
    made = {}
    exec((tmp_path / "picture.py").read_text().split("\nimage = ")[0], made)
    assert made["camera"] == camera
