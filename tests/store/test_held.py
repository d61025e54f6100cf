"""What a reader opened is what it reads: never samples of one store with the frame of another.

Light fields of one constant each, whose frame says which: what is read agrees with its frame, or is refused.
"""

import json
import pickle
import shutil
import threading
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

import vcc
from vcc.base.affine import Affine
from vcc.store import create_store, create_video, open_store, open_video, save_store
from vcc.sweeps import sweep

SHAPE = (3, 3, 8, 10)
ANOTHER = "holds another light field than the one that was opened: it was replaced or changed since. Open it again"
CAMERA = vcc.Camera([vcc.Lens(0.05, diameter=5e-3)], vcc.Sensor(z=0.0526, shape=(6, 8), pitch=1e-4))


def light_field(number: int, spacing: float | None = None) -> vcc.LightField:
    values = np.full(SHAPE, number, np.float32)
    return vcc.LightField.from_views(values, number * 1e-3 if spacing is None else spacing, 1e-3, 1.0)


def put(number, path, spacing=None):
    return save_store(light_field(number, spacing), path, overwrite=True)


def remove_and_put(number, path, spacing=None):
    shutil.rmtree(path)
    return put(number, path, spacing)


READS = {
    "a part": lambda stored: stored[1:2, :, 2:4],
    "all": lambda stored: stored.read(),
    "a view": lambda stored: stored.view(0, 0),
    "a view as stored": lambda stored: stored.stored_view(0, 0, 0, 8),
    "a larger world": lambda stored: stored.scaled(2.0).view(0, 0),
    "a picture": lambda stored: CAMERA.capture(stored),
    "a sweep": lambda stored: sweep(CAMERA, stored, {"sensor.z": [0.0526, 0.053]}),
    "disparities": lambda stored: stored.disparity.maps(),
    "a copy": lambda stored: save_store(stored, stored.path.with_name("b.zarr")),
}


@pytest.mark.parametrize("read", READS)
def test_a_store_that_was_replaced_is_refused(tmp_path, read):
    # Each by one of both ways to replace it, in another frame or with all that is stated alike: all four come.
    number, read = list(READS).index(read), READS[read]
    replaced, spacing = (put, remove_and_put)[number % 2], (None, 1e-3)[number // 2 % 2]
    stored = put(1, tmp_path / "a.zarr")
    new = replaced(2, tmp_path / "a.zarr", spacing)
    for _ in range(2):
        with pytest.raises(vcc.InputError, match=ANOTHER):
            read(stored)
    assert not (tmp_path / "a.zarr/disparity").exists()
    assert (new.read().values == 2).all()


def test_a_store_of_another_shape_is_told_as_what_it_is(tmp_path):
    stored = put(1, tmp_path / "a.zarr")
    save_store(light_field(1)[:2, :2, :4], tmp_path / "a.zarr", overwrite=True)
    with pytest.raises(vcc.InputError, match=ANOTHER):  # and not as views that are missing or damaged
        stored.read()


def test_a_store_that_is_gone_is_told(tmp_path):
    stored = put(1, tmp_path / "a.zarr")
    (tmp_path / "a.zarr").rename(tmp_path / "b.zarr")
    with pytest.raises(vcc.InputError, match=r"a\.zarr is gone: the light field that was opened was removed"):
        stored.view(0, 0)
    (tmp_path / "b.zarr").rename(tmp_path / "a.zarr")
    assert (stored.read().values == 1).all()


def test_what_a_reader_gets_while_others_replace_the_store_is_of_one(tmp_path):
    path, stop = tmp_path / "a.zarr", threading.Event()
    put(1, path)

    def replace():
        number = 1
        while not stop.is_set():
            number = number % 5 + 1
            put(number, path)

    other = threading.Thread(target=replace)
    other.start()
    told = []
    try:
        for _ in range(60):
            try:
                read = open_store(path).read()
                told.append((read.values == round(read.frame.matrix[0, 0] * 1e3)).all())
            except vcc.InputError as error:
                assert "that was opened" in str(error)  # noqa: PT017  (which of the two)
    finally:
        stop.set()
        other.join()
    assert all(told)


def unfinished(path, description=None):
    frame = light_field(1).frame
    return create_store(path, frame, SHAPE, "float32", provenance={}, description=description or {"made": "1"})


def without_identity(path):
    file = path / "zarr.json"
    stated = json.loads(file.read_text())
    del stated["attributes"]["light_field"]["identity"]
    file.write_text(json.dumps(stated))


@pytest.mark.parametrize("older", [False, True], ids=["", "without an identity"])
def test_a_store_that_goes_on_stays_the_same(tmp_path, older):
    path = tmp_path / "a.zarr"
    with unfinished(path) as writer:
        writer.write_view(0, 0, np.ones(SHAPE[2:], np.float32))
    if older:
        without_identity(path)
    stored = open_store(path)
    sent = pickle.dumps(stored)
    with unfinished(path) as writer:  # another process, say
        for row, column in writer.missing():
            writer.write_view(row, column, np.ones(SHAPE[2:], np.float32))
            assert (stored.view(row, column).values == 1).all()
        finished = writer.finish()
    assert (stored.read().values == 1).all()
    assert (pickle.loads(sent).read().values == 1).all()
    assert stored.attributes.identity == finished.attributes.identity
    assert (stored.attributes.identity is None) == older


def test_an_older_store_without_an_identity_is_told_by_what_it_states(tmp_path):
    put(1, tmp_path / "a.zarr")
    without_identity(tmp_path / "a.zarr")
    stored = open_store(tmp_path / "a.zarr")
    assert (stored.read().values == 1).all()
    put(2, tmp_path / "a.zarr")
    without_identity(tmp_path / "a.zarr")
    with pytest.raises(vcc.InputError, match=ANOTHER):
        stored.read()


def test_what_is_stated_changes_and_readers_are_told(tmp_path):
    stored = put(1, tmp_path / "a.zarr")
    file = tmp_path / "a.zarr/zarr.json"
    stated = json.loads(file.read_text())
    stated["attributes"]["light_field"]["frame"] = Affine.identity(4).matrix.tolist()
    file.write_text(json.dumps(stated))
    with pytest.raises(vcc.InputError, match=ANOTHER):
        stored.read()


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
def test_other_processes_hold_on_to_it(tmp_path):
    stored = put(1, tmp_path / "a.zarr")
    sent = pickle.dumps(stored)
    elsewhere = pickle.loads(sent)
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        assert CAMERA.capture(stored, executor=pool).values.max() > 0
        put(2, tmp_path / "a.zarr", 1e-3)
        with pytest.raises(vcc.InputError, match="holds another light field than the one that was opened"):
            CAMERA.capture(stored, executor=pool)
    with pytest.raises(
        vcc.InputError, match="holds another light field than the one that was opened: open it again"
    ):
        pickle.loads(sent)
    with pytest.raises(vcc.InputError, match=ANOTHER):
        elsewhere.read()


# --- videos ---


def video(path, numbers):
    with create_video(path) as writer:
        for time, number in numbers:
            writer.append(light_field(number, 1e-3), time)
    return open_video(path)


def test_a_video_that_was_replaced_is_refused(tmp_path):
    opened = video(tmp_path / "v.zarr", [(0.0, 1), (1.0, 2)])
    sent = pickle.dumps(opened)
    first = opened[0]
    shutil.rmtree(tmp_path / "v.zarr")
    video(tmp_path / "v.zarr", [(0.0, 3), (1.0, 4)])
    with pytest.raises(vcc.InputError, match="holds another light field than the one"):
        first.read()
    for one in (opened, pickle.loads(sent), opened[1:]):
        with pytest.raises(vcc.InputError, match="holds another video than the one that was opened"):
            one[-1].read()


def test_a_video_that_grows_stays_the_same(tmp_path):
    with create_video(tmp_path / "v.zarr"):
        empty = open_video(tmp_path / "v.zarr")
    opened = video(tmp_path / "v.zarr", [(0.0, 1), (1.0, 2)])
    assert len(empty) == 0
    video(tmp_path / "v.zarr", [(2.0, 3)])
    assert [frame.read().values.max() for frame in opened] == [1, 2]
    empty.held.check()


def test_a_frame_that_was_replaced_is_refused_when_it_is_opened_again(tmp_path):
    opened = video(tmp_path / "v.zarr", [(float(n), n + 1) for n in range(10)])
    assert [frame.read().values.max() for frame in opened] == [*range(1, 11)]  # the first is closed again
    put(7, tmp_path / "v.zarr/000000_0.0", 1e-3)
    with pytest.raises(vcc.InputError, match=r"frame 0, 0 s, of .* was replaced"):
        opened[0]
