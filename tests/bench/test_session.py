"""Sessions of the bench: what a client says and is told; without sockets."""

import dataclasses
import io
import json
import runpy
import tempfile
import threading
import time
import warnings
import zipfile

import imagecodecs
import numpy as np
import PIL.Image
import pytest
import scipy.special
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as some

import vcc
from tests.bench.hostile import ASKED
from tests.bench.on_bench import CAMERA, NOWHERE, PIXELS, START, Client, noise, offered
from vcc.bench import imaging as imaging_there
from vcc.bench import offered as offered_there
from vcc.bench import picture as picture_there
from vcc.bench import session as session_there
from vcc.bench.additions import FROM_FILES, families
from vcc.bench.document import Document
from vcc.bench.inbox import CHANGES, MOST_WAITING, QUESTIONS, Broken
from vcc.bench.offered import Field
from vcc.bench.picture import COARSER, FULL, WHOLE, take
from vcc.bench.screen import codes
from vcc.camera_file import ELEMENT_KINDS
from vcc.fields.filling import filling_of
from vcc.files.pictures import auto_exposure
from vcc.plan.choice import compile_best
from vcc.prescriptions import built_in_lenses


@pytest.fixture
def client():
    made = Client()
    yield made
    made.close()


def test_hello_brings_parts_state_and_picture(client):
    client.do("hello", turn=7)
    parts, _ = client.until("parts")
    assert {kind["kind"] for kind in parts["kinds"]} == {*ELEMENT_KINDS, *built_in_lenses()}
    lens = next(kind for kind in parts["kinds"] if kind["kind"] == "lens")
    focal_length = next(each for each in lens["parameters"] if each["name"] == "focal_length")
    assert (focal_length["unit"], focal_length["needed"]) == ("length", True)
    assert "f" in focal_length["words"]
    state, _ = client.until("state")
    assert state["document"] == json.loads(json.dumps(START.as_json()))
    message = client.at_rest()
    assert (message["turn"], message["shape"]) == (7, (PIXELS, PIXELS))
    client.until("notes")


def test_the_picture_is_that_of_capture_upright(client):
    client.do("hello")
    while True:
        message, (data,) = client.until("picture")
        if not message["coarse"]:
            break
    image = camera_of(START).capture(noise())
    shown = imagecodecs.jpeg_decode(data).astype(float)
    white = message["white"]
    exact = np.clip(image.upright().to_numpy() / white, 0, 1)
    coded = np.where(exact <= 0.0031308, 12.92 * exact, 1.055 * exact ** (1 / 2.4) - 0.055) * 255
    # JPEG errs by some codes, and a picture upside down is another one.
    upright, turned = (np.abs(each.mean(axis=2) - coded.mean(axis=2)).mean() for each in (shown, shown[::-1]))
    assert upright < 8
    assert turned > 2 * upright


def camera_of(document):
    train = document.train(NOWHERE).train
    return vcc.Camera(train.elements, train.sensor)


def test_a_value_is_that_of_the_pixel(client):
    client.do("hello")
    client.until("notes")
    client.do("value", x=2, y=5)
    message, _ = client.until("value")
    values = camera_of(START).capture(noise()).upright().to_numpy()
    assert message["irradiance"] == pytest.approx(values[5, 2].tolist(), rel=1e-6)
    client.do("value", x=2, y=PIXELS)
    assert "has no pixel" in client.until("refused")[0]["words"]


def test_what_is_refused_leaves_the_state(client):
    client.do("hello")
    client.at_rest()
    client.do("set", where=["sensor", "z"], value="0.5")
    refused, _ = client.until("refused")
    assert refused["where"] == ["sensor", "z"]
    assert "a length needs a unit" in refused["words"]
    assert client.session.document == START


def test_a_picture_that_cannot_be_made_is_said(client):
    client.do("hello")
    client.at_rest()
    client.do("set", where=["sensor", "electronics"], value={"quantum_efficiency": [0.5, 0.5]})
    client.until("state")
    client.do("set", where=["noise"], value=True, turn=3)
    message = client.at_rest()
    assert message["is"] == "no picture"
    assert message["turn"] == 3
    client.do("undo")
    assert client.at_rest()["is"] == "picture"


def test_noise_is_recorded_and_told_and_brings_electronics(client):
    client.do("hello")
    client.do("set", where=["noise"], value=True, turn=5)
    remark, _ = client.until("refused")
    assert remark["done"]
    assert "electronics" in remark["words"]
    while client.at_rest()["turn"] != 5:
        pass
    client.do("value", x=0, y=0)
    recorded = client.until("value")[0]["recorded"]
    assert len(recorded) == 3
    assert all(isinstance(number, int) and number >= 0 for number in recorded)
    client.do("set", where=["sensor", "electronics"], value=None)
    assert client.until("state")[0]["document"]["noise"] is False
    client.do("undo")
    client.do("undo")
    client.until("state")
    assert client.until("state")[0]["document"] == json.loads(json.dumps(START.as_json()))  # each was one step


def test_elements_are_added_copied_and_removed(client):
    client.do("hello")
    client.at_rest()
    client.do("duplicate", element=1)
    client.until("state")
    client.do("remove", element=0)
    client.until("state")
    client.at_rest()
    names = [element.get("name") for element in client.session.document.camera["elements"]]
    assert len(names) == 2
    assert names[1] == "mask"
    client.do("remove", element=5)
    assert "there is no element 5" in client.until("refused")[0]["words"]


def test_kind_that_comes_from_a_file_is_not_added_and_the_way_out_is_named(client):
    client.do("add", kind="real_lens", z="13 mm")
    assert "comes from a lens file: add one of achromat-100mm" in client.until("refused")[0]["words"]


def test_a_real_lens_is_added_by_name_with_its_surfaces(client):
    client.do("add", kind="aspheric-14mm")
    words = client.until("refused")[0]["words"]
    assert "is 105.1 mm long, and the widest gap of this camera is 26 mm" in words
    assert "move the sensor to z = 132 mm or further" in words  # 26 mm, where the mask stands, and 105.1 mm
    client.until("state")
    client.do("add", kind="phone-4mm", z=None)
    state, _ = client.until("state", "refused")
    assert state["is"] == "state", state
    (table,) = (each for each in state["document"]["camera"]["elements"] if each["kind"] == "real_lens")
    assert (table["name"], len(table["prescription"]["surfaces"]) > 5) == ("phone-4mm", True)


@pytest.mark.parametrize("kind", [kind for kind in ELEMENT_KINDS if kind not in FROM_FILES])
def test_each_kind_can_be_added_and_drawn(client, kind):
    client.do("add", kind=kind, z="13 mm")
    state, _ = client.until("state", "refused")
    assert state["is"] == "state", state
    drawn = state["side"]["elements"][2]
    assert (drawn["element"], drawn["kind"]) == (2, kind.replace("_", " "))
    assert state["document"]["camera"]["elements"][2]["name"]
    client.do("add", kind=kind)  # where it makes sense: there, too, it is accepted
    state = answered(client)
    assert len(state["document"]["camera"]["elements"]) == 4, state


def answered(client):
    """What is told of a change: its state, or why it is refused; not what was done besides."""
    answer, _ = client.until("state", "refused")
    return answered(client) if answer.get("done") else answer


@pytest.mark.parametrize("where", [["sensor", "angular_response"], ["elements", 2, "pattern", "pattern"]])
def test_a_pattern_chosen_by_name_gets_what_it_needs_wherever_it_is(client, where):
    client.do("add", kind="mask", z="13 mm")
    client.do("set", where=["elements", 2, "pattern"], value={"name": "bounded"})
    assert answered(client)["is"] == answered(client)["is"] == "state"
    patterns = [each["kind"] for each in families()["pattern"] if not each.get("cells")]
    assert "circle" in patterns
    for name in patterns:
        client.do("set", where=where, value={"name": name})
        answer = answered(client)
        assert answer["is"] == "state", answer


def test_pictures_are_compared_with_the_pinned_one(client):
    client.do("hello")
    client.until("notes")
    client.do("pin")
    _, (_, pinned) = client.until("pins")
    assert imagecodecs.jpeg_decode(pinned).shape == (PIXELS, PIXELS, 3)
    client.do("set", where=["sensor", "z"], value="54 mm")
    changed = client.at_rest()
    values = [camera_of(each).capture(noise()).to_numpy() for each in (START, client.session.document)]
    difference = float(np.mean(np.square(values[0] - values[1], dtype=np.float64)))
    white = 1 / auto_exposure(values[0])
    assert changed["psnr"] == pytest.approx(10 * np.log10(white**2 / difference), abs=1e-3)
    client.do("undo")
    same = client.at_rest()
    assert (same["psnr"], same["same"]) == (None, True)


def test_a_click_focuses_on_what_is_there():
    field = noise(5, 48)
    client = Client(offered(fields={"noise": Field(field)}))
    client.do("hello")
    client.at_rest()
    client.do("focus", x=12, y=12)
    client.at_rest()
    z = client.session.document.train(NOWHERE).train.sensor.z
    distance = field.distance_of(1.0)
    assert z == pytest.approx(1 / (1 / 0.05 - 1 / distance), rel=2e-3)
    client.close()


def test_of_what_moves_only_the_newest_counts(client):
    client.do("hello")
    client.at_rest()
    for number in range(500):
        client.do("set", where=["sensor", "z"], value=f"{52 + number / 250:.3f} mm", moving=True, turn=number + 1)
    client.do("set", where=["sensor", "z"], value="53.998 mm", turn=1000)
    assert client.at_rest()["turn"] == 1000
    client.do("undo")
    client.at_rest()
    assert client.session.document == START


def wait_until_taken(client, value):
    """Until the session has taken a place of the sensor: during a drag, the state follows the picture."""
    end = time.monotonic() + 300
    while client.session.document.camera["sensor"]["z"] != value:
        assert time.monotonic() < end
        time.sleep(0.001)


def test_of_a_hundred_moves_the_one_under_way_and_the_last_become_pictures(client):
    """A picture under way is not broken off by what moves on; what is passed over meanwhile is never made."""
    client.do("hello")
    client.at_rest()
    moves = [
        {"where": ["sensor", "z"], "value": f"{52 + number / 50:.2f} mm", "moving": True, "turn": number}
        for number in range(1, 101)
    ]
    with client.session.offered.turn.held():
        client.do("set", **moves[0])
        wait_until_taken(client, moves[0]["value"])
        for move in moves[1:]:
            client.do("set", **move)
        client.do("value", x=0, y=0)
    turns = []
    while not turns or turns[-1] != 100:
        turns.append(client.until("picture")[0]["turn"])
    assert turns == [1, 100]
    assert client.session.document.train(NOWHERE).train.sensor.z == pytest.approx(54e-3)


def test_letting_go_breaks_off_the_picture_of_a_place_on_the_way(client):
    client.do("hello")
    client.at_rest()
    with client.session.offered.turn.held():
        client.do("set", where=["sensor", "z"], value="52.5 mm", moving=True, turn=1)
        wait_until_taken(client, "52.5 mm")
        client.do("set", where=["sensor", "z"], value="53 mm", turn=2)
        client.until("state")
    message, _ = client.until("picture")
    assert (message["turn"], message["moving"]) == (2, False)


def test_who_sends_too_much_is_not_listened_to(client):
    client.do("hello")
    client.at_rest()

    def flood():
        for number in range(MOST_WAITING + 50):
            client.do("set", where=["sensor", "z"], value=f"{52 + number % 2} mm")

    with client.session.offered.turn.held(), pytest.raises(Broken, match="messages wait"):
        flood()


@pytest.mark.parametrize("message", [None, [], {}, {"do": "jump"}, {"do": "set", "turn": "1"}, {"do": ["set"]}, 5])
def test_what_is_no_message_is_broken(client, message):
    with pytest.raises(Broken):
        client.session.receive(message)


def test_cameras_come_from_text_and_from_the_gallery():
    client = Client(offered(gallery={"other": START.changed(["sensor", "z"], "55 mm")}))
    client.do("load", toml='[sensor]\nz = "30 mm"\nshape = [4, 4]\npitch = "1 mm"\n')
    client.until("state")
    assert client.session.document.camera["sensor"]["z"] == "30 mm"
    client.do("load", toml="[sensor")
    assert "not valid TOML" in client.until("refused")[0]["words"]
    assert client.until("state")[0]["document"]["camera"]["sensor"]["z"] == "30 mm"  # what is so is said again
    client.do("load", toml='[sensor]\nz = 1979-05-27\nshape = [4, 4]\npitch = "1 mm"\n')
    assert client.until("refused", "state")[0]["is"] == "refused"
    client.until("state")
    client.do("load", gallery="other")
    client.until("state")
    assert client.session.document.camera["sensor"]["z"] == "55 mm"
    client.do("load", gallery="none")
    assert "there is no camera" in client.until("refused")[0]["words"]
    client.do("load", document={"camera": CAMERA, "light_field": "sunset"})
    assert "there is no light field" in client.until("refused")[0]["words"]
    client.close()


def test_a_document_of_a_link_is_taken_or_refused(client):
    moved = START.changed(["sensor", "z"], "54 mm")
    client.do("hello", document=moved.as_json())
    client.until("state")
    assert client.session.document == moved
    other = Client()
    other.do("hello", document={"camera": 5})
    assert "document" in other.until("refused")[0]["words"]
    other.until("state")
    other.do("hello", changes=[5])
    assert "changes is a list" in other.until("refused")[0]["words"]
    other.close()


def test_answers(client):
    client.do("hello")
    client.at_rest()
    client.do("ask", what="explain")
    assert "folded into one matrix" in client.until("answer")[0]["words"]
    client.do("ask", what="point spread", distance="1 m")
    told, (picture,) = client.until("answer")
    assert list(imagecodecs.jpeg_decode(picture).shape[:2]) == told["shape"]
    client.do("ask", what="mtf", distance="0.6 m")
    curve = np.array(client.until("answer")[0]["across"])
    # a disc of light w wide, by similar triangles of the cone behind the lens: |2·J₁(π·w·f)/(π·w·f)|
    width = 18 * 52 * abs(1 / 600 + 1 / 52 - 1 / 50)
    argument = np.pi * width * np.maximum(curve[:, 0], 1e-9)
    # pixels an eighth as wide take up to 1 − sinc(1/8) = 2.6 % of what is left
    assert np.abs(curve[:, 1] - np.abs(2 * scipy.special.j1(argument) / argument)).max() < 0.026
    client.do("ask", what="phase space")
    planes, pictures = client.until("answer")
    assert len(planes["planes"]) == len(pictures) == 4
    assert planes["frame"] is None
    client.do("ask", what="phase space", z="30 mm")
    chosen, (picture,) = client.until("answer")
    (plane,) = chosen["planes"]
    assert (plane["title"], plane["z"]) == ("z = 30 mm", 0.03)
    for name, ends in chosen["frame"].items():  # it holds all planes, so that it stays while one is moved
        wanted = [pick(each[name][n] for each in planes["planes"]) for n, pick in ((0, min), (1, max))]
        assert ends == pytest.approx(wanted, abs=0.02 * (wanted[1] - wanted[0]))
        assert ends[0] <= plane[name][0] < plane[name][1] <= ends[1]
    client.do("ask", what="phase space", z="60 mm")
    assert "behind the sensor" in client.until("refused")[0]["words"]
    client.do("ask", what="why")
    assert "unknown question" in client.until("refused")[0]["words"]


# --- exports ---


def exported(client, what):
    client.do("export", what=what)
    message, (data,) = client.until("file")
    return message["name"], data


DOCUMENTS = {
    "lens and mask": START,
    "views and exposure": Document.of_json(
        START.as_json() | {"views": {"rows": [0, 1], "columns": [1, 2]}, "exposure": 0.2}
    ),
    "a light field elsewhere": Document.of_json(
        START.as_json() | {"aperture": {"z": "-12.5 mm", "decentre": ["1 mm", "-0.3 mm"]}}
    ),
    "an array": START.changed(["elements", 1, "pattern"], {"name": "mura", "prime": 13}).changed(
        ["elements", 1, "width"], "14.7 mm"
    ),
    "noise behind a filter": START.changed(["sensor", "electronics"], {"color_filter": "RGGB"}).changed(
        ["noise"], True
    ),
}


@pytest.mark.parametrize("name", DOCUMENTS)
def test_the_program_makes_the_identical_picture(name, tmp_path, monkeypatch):
    client = Client()
    client.do("hello", document=DOCUMENTS[name].as_json())
    assert client.at_rest()["is"] == "picture"
    stated, program = exported(client, "python")
    _, picture = exported(client, "png")
    client.close()
    if stated.endswith(".zip"):
        zipfile.ZipFile(io.BytesIO(program)).extractall(tmp_path)
    else:
        (tmp_path / "picture.py").write_bytes(program)
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # of rays that are missing
        runpy.run_path("picture.py")
    assert (tmp_path / "picture.png").read_bytes() == picture


def test_the_camera_file_gives_the_same_camera(client, tmp_path):
    client.do("hello")
    client.at_rest()
    name, data = exported(client, "toml")
    (tmp_path / name).write_bytes(data)
    assert vcc.load_camera(tmp_path / name) == camera_of(START)
    name, data = exported(client, "exr")
    (tmp_path / name).write_bytes(data)
    exact = camera_of(START).capture(noise()).to_numpy()
    assert np.array_equal(vcc.load_image(tmp_path / name).upright().to_numpy(), exact[::-1, ::-1])
    client.do("export", what="docx")
    assert "a bench exports" in client.until("refused")[0]["words"]


# --- pictures ---


def test_at_rest_a_camera_is_rehearsed_for_a_drag_and_nobody_sees_it(monkeypatch):
    made = []

    def noted(train, field, document, fineness, progress, kept):
        made.append((fineness, train.sensor.z))
        return take(train, field, document, fineness, progress, kept)

    monkeypatch.setattr(imaging_there, "take", noted)
    monkeypatch.setattr(imaging_there, "SLOW", np.inf)
    monkeypatch.setattr(session_there, "LINGER", 0.01)
    client = Client()
    client.do("hello", turn=1)
    client.at_rest()
    client.until("notes")
    assert client.session.join(300)
    levels = [FULL, WHOLE, *(each for each in COARSER if each.rays != 4 or each.pixels != 2)]  # a plan has no rays
    away = 0.052 * 13 / 12
    assert made[-2 * len(levels) :] == [(each, pytest.approx(z)) for z in (away, 0.052) for each in levels]
    assert not client.told
    # with its mask elsewhere it is the same kind of camera
    del made[:]
    client.do("set", where=["elements", 1, "z"], value="30 mm", moving=False, turn=2)
    client.at_rest()
    assert client.session.join(300)
    assert made == [(WHOLE, pytest.approx(0.052))]
    # by rays what is out of focus is made as all else is, and a whole picture has compiled all
    del made[:]
    lenslets = {"kind": "lens_array", "z": "50 mm", "pitch": "2 mm", "focal_length": "20 mm"}
    client.do("set", where=["elements", 1], value=lenslets, turn=3)
    client.at_rest()
    assert client.session.join(300)
    assert made == [(each, pytest.approx(0.052)) for each in (WHOLE, FULL, *COARSER)]
    client.close()


@pytest.mark.parametrize("soon", [False, True])  # whether all pixels come much sooner than the whole picture
def test_a_hand_that_rests_gets_the_whole_picture_and_letting_go_shows_it_again_without_work(monkeypatch, soon):
    made, between = [], [FULL] if soon else []

    def coarse_while_moving(train, field, document, fineness, progress, kept):
        made.append(fineness)
        return take(train, field, document, fineness, progress, kept)

    monkeypatch.setattr(imaging_there.Pace, "fineness", lambda pace, of: COARSER[0])
    monkeypatch.setattr(imaging_there.Pace, "is_soon", lambda *given: soon)
    client = Client()
    client.do("hello")
    client.at_rest()
    assert client.session.join(300)
    monkeypatch.setattr(imaging_there, "take", coarse_while_moving)
    client.do("set", where=["sensor", "z"], value="53 mm", moving=True, turn=1)
    coarse, _ = client.until("picture")
    client.do("set", where=["sensor", "z"], value="53 mm", moving=True, rests=True, turn=2)
    finer = [client.until("picture")[0] for _ in (*between, WHOLE)]
    assert [(each["turn"], each["coarse"]) for each in (coarse, *finer)] == [
        (1, True),
        *((2, True) for _ in between),
        (2, False),
    ]
    assert all(each["shape"] == (PIXELS, PIXELS) for each in finer)
    client.do("set", where=["sensor", "z"], value="53 mm", turn=3)
    assert client.at_rest()["turn"] == 3
    assert made[: 2 + soon] == [COARSER[0], *between, WHOLE]
    assert WHOLE not in made[2 + soon :]  # of what is the same again none is made
    # at a place of which nothing is shown yet, the quick picture comes first
    client.do("set", where=["sensor", "z"], value="54 mm", moving=True, rests=True, turn=4)
    pictures = [client.until("picture")[0] for _ in range(2 + soon)]
    assert [(each["turn"], each["coarse"]) for each in pictures] == [
        (4, True),
        *((4, True) for _ in between),
        (4, False),
    ]
    client.close()


@pytest.mark.parametrize("fineness", [FULL, *COARSER])
def test_a_coarse_picture_is_the_picture_with_fewer_pixels(fineness):
    # light as even as it gets: each pixel's irradiance is that of the whole picture there, whatever the pixels
    values = np.full((8, 8, 48, 48), 0.5, np.float32)
    field = Field(noise(8, 48).replaced(values))
    document = START.changed(["elements"], [{"kind": "lens", "z": "0 mm", "focal_length": "50 mm"}])
    train = document.train(NOWHERE).train
    whole, coarse = (take(train, field, document, each).values for each in (WHOLE, fineness))
    assert coarse.shape[0] == PIXELS // fineness.pixels
    middle = coarse.shape[0] // 2
    assert coarse[middle, middle] == pytest.approx(whole[PIXELS // 2, PIXELS // 2], rel=0.02)


@pytest.mark.parametrize("fineness", [FULL, *COARSER])
def test_a_coarse_picture_by_few_rays_is_as_bright(fineness):
    field = Field(noise(8, 48).replaced(np.full((8, 8, 48, 48), 0.5, np.float32)))
    lens = {"kind": "lens", "z": "0 mm", "focal_length": "50 mm", "diameter": "18 mm"}
    lenslets = {"kind": "lens_array", "z": "50 mm", "pitch": "3 mm", "focal_length": "20 mm"}
    document = START.changed(["elements"], [lens, lenslets])
    document = document.changed(["sensor"], {"z": "52 mm", "shape": [96, 96], "pitch": "0.25 mm"})
    whole, coarse = (take(document.train(NOWHERE).train, field, START, each) for each in (WHOLE, fineness))
    assert coarse.plan.by_rays
    assert coarse.plan.core.samples < whole.plan.core.samples
    # of the rays more than half pass: three times the error of a share of them
    rays = coarse.values[..., 0].size * coarse.plan.core.samples
    assert coarse.values.mean() == pytest.approx(whole.values.mean(), rel=3 / rays**0.5)


def test_few_rays_through_lenslets_look_at_views_with_pixels_twice_as_coarse():
    # as a plan does that is made for such views; odd numbers of pixels, so that a border is left out
    field = Field(noise(4, 51))
    lens = {"kind": "lens", "z": "0 mm", "focal_length": "50 mm", "diameter": "18 mm"}
    lenslets = {"kind": "lens_array", "z": "50 mm", "pitch": "3 mm", "focal_length": "20 mm"}
    document = START.changed(["elements"], [lens, lenslets])
    train = (
        document.changed(["sensor"], {"z": "52 mm", "shape": [96, 96], "pitch": "0.25 mm"}).train(NOWHERE).train
    )
    made = take(train, field, START, COARSER[0]).plan
    views = field.with_pixels_of(2 * COARSER[0].pixels)
    wanted = compile_best(train, views.grid)
    assert made.core.views == wanted.core.views == (4, 4, 12, 12)
    assert made.core.index_from_ray.isclose(wanted.core.index_from_ray)
    np.testing.assert_allclose(made.core.motion, wanted.core.motion, atol=1e-9)


def test_views_that_were_not_recorded_are_known_in_coarse_images_and_named():
    there = np.ones((3, 3), bool)
    there[0, 2] = False
    filled = filling_of(there, [0.01], [0.02])
    recorded = noise()
    made = vcc.LightField(recorded.values, recorded.frame, recorded.disparity_range, filling=filled)
    field = Field(made, "")
    assert field.with_pixels_of(4).filling == filled
    client = Client(offered(fields={"noise": field}))
    client.do("hello", turn=1)
    notes, _ = client.until("notes")
    client.close()
    assert any(
        "rendered from the others" in note["words"] and "(0, 2)" in note["words"] for note in notes["notes"]
    )


def test_a_camera_that_begins_with_glass_gets_wavelengths_and_says_so():
    client = Client(
        offered(start=START.changed(["elements", 0, "glass"], {"name": "catalogue", "glass": "N-BK7"}))
    )
    client.do("hello", turn=1)
    remark, _ = client.until("refused")
    assert remark["done"]
    assert "540 nm" in remark["words"]
    client.until("picture")
    assert client.session.document.wavelengths == ("610 nm", "540 nm", "465 nm")
    client.close()


def test_a_plan_is_given_up_where_its_picture_is_no_longer_wanted(monkeypatch):
    def progress(done, total):
        raise session_there.Superseded

    monkeypatch.setattr(picture_there, "drive", None)  # is never reached
    with pytest.raises(session_there.Superseded):
        take(START.train(NOWHERE).train, Field(noise()), START, WHOLE, progress)


# --- photodiodes and bands ---


def test_photodiodes_are_shown_side_by_side_as_capture_makes_them(client):
    client.do("hello")
    client.at_rest()
    client.do("look", look={"photodiodes": "apart"})
    client.do("set", where=["sensor", "photodiodes"], value=[1, 2], turn=2)
    while True:
        message, (data,) = client.until("picture", "no picture")
        if message["turn"] == 2 and not message["coarse"]:
            break
    assert (message["shape"], message["photodiodes"]) == ((PIXELS, 2 * PIXELS), (1, 2))
    assert imagecodecs.jpeg_decode(data).shape[:2] == (PIXELS, 2 * PIXELS)
    image = camera_of(client.session.document).capture(noise())
    (row,) = image.upright().photodiodes
    for column, photodiode in enumerate(row):  # in their order as people see the image
        client.do("value", x=column * PIXELS + 7, y=9)
        told = client.until("value")[0]["irradiance"]
        assert told == pytest.approx(photodiode.values[9, 7].tolist(), rel=1e-5)
    client.do("look", look={})
    assert client.until("picture")[0]["shape"] == (PIXELS, PIXELS)
    client.do("value", x=7, y=9)
    told = client.until("value")[0]["irradiance"]
    assert told == pytest.approx(image.upright().values[9, 7].tolist(), rel=1e-5)


def test_glass_gets_wavelengths_by_itself_and_each_band_its_own_picture(client):
    client.do("hello")
    client.at_rest()
    glass = {"kind": "lens", "glass": "N-BK7", "focal_length": "50 mm", "diameter": "18 mm", "z": "0 mm"}
    client.do("set", where=["elements", 0], value=glass, turn=2)
    state, _ = client.until("state", "refused")
    assert state["document"]["wavelengths"] == ["610 nm", "540 nm", "465 nm"]
    assert state["bands"] == pytest.approx([610e-9, 540e-9, 465e-9])
    remark = client.until("refused", "picture")[0]
    assert remark["done"]
    assert "wavelengths 610 nm, 540 nm, 465 nm, because" in remark["words"]
    message = client.at_rest()
    assert (message["is"], message["turn"]) == ("picture", 2), message
    field = noise().with_wavelengths([610e-9, 540e-9, 465e-9])
    expected = camera_of(client.session.document).capture(field).upright().to_numpy()[4, 3]
    client.do("value", x=3, y=4)
    assert client.until("value")[0]["irradiance"] == pytest.approx(expected.tolist(), rel=1e-6)
    client.do("ask", what="explain")
    assert "610 nm" in client.until("answer")[0]["words"]
    client.do("ask", what="mtf")
    assert "for the design wavelength" in client.until("answer")[0]["remark"]
    client.do("set", where=["wavelengths"], value=["610 nm"], turn=3)
    assert "wavelengths" in client.until("refused")[0]["words"]


def test_a_program_asked_for_while_a_coarse_picture_is_shown_has_the_white_of_the_whole_one(monkeypatch):
    client, asked = Client(), []

    def noted(train, field, document, fineness, progress, kept):
        if not asked:
            asked.append(client.do("export", what="python"))
        return take(train, field, document, fineness, progress, kept)

    monkeypatch.setattr(imaging_there, "take", noted)
    monkeypatch.setattr(imaging_there.Pace, "fineness", lambda pace, of: COARSER[0])
    client.do("hello")
    coarse, _ = client.until("picture")
    _, (program,) = client.until("file")
    whole = client.at_rest()
    assert coarse["coarse"]
    assert coarse["white"] != whole["white"]
    assert f"exposure=1 / {whole['white']!r})" in program.decode()
    client.close()


@pytest.mark.parametrize("name", ["glass", "photodiodes"])
def test_program_of_bands_and_photodiodes_makes_the_identical_picture(name, tmp_path, monkeypatch):
    changes = {
        "glass": {"where": ["elements", 0, "glass"], "value": "N-BK7"},
        "photodiodes": {"where": ["sensor", "photodiodes"], "value": [1, 2]},
    }
    client = Client()
    client.do("hello")
    client.at_rest()
    client.do("set", **changes[name])
    client.at_rest()
    stated, program = exported(client, "python")
    _, picture = exported(client, "png")
    client.close()
    assert stated == "picture.py"
    (tmp_path / "picture.py").write_bytes(program)
    monkeypatch.chdir(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # of rays that are missing
        runpy.run_path("picture.py")
    assert (tmp_path / "picture.png").read_bytes() == picture


def test_a_profile_is_that_of_the_image_and_as_long_as_on_the_sensor(client):
    client.do("hello")
    client.at_rest()
    values = camera_of(START).capture(noise()).upright().to_numpy()
    client.do("ask", what="profile", ends=[3, 5, 13, 5])
    told, _ = client.until("answer")
    assert pytest.approx(values[5, 3:14], rel=1e-5) == np.array(told["values"]).T
    assert told["places"] == pytest.approx(np.arange(11) * 1e-3)  # pixels of 1 mm
    client.do("ask", what="profile", ends=[2, 2, 6, 6])
    diagonal, _ = client.until("answer")
    assert diagonal["places"][-1] == pytest.approx(4e-3 * 2**0.5)
    client.do("ask", what="profile", ends=[2, 2, 2, 2])
    assert "one pixel" in client.until("refused")[0]["words"]


def test_a_look_shows_a_channel_with_other_levels_and_leaves_the_numbers(client):
    client.do("hello")
    message = client.at_rest()
    histogram = message["histogram"]
    values = camera_of(START).capture(noise()).to_numpy()
    assert [sum(counts) for counts in histogram["counts"]] == [PIXELS**2] * 3
    assert histogram["above"] == pytest.approx(np.mean(values > message["white"]))
    client.until("notes")
    client.do("look", look={"black": 0.25, "linear": True, "channel": 1}, turn=4)
    message, (data,) = client.until("picture")
    shown = imagecodecs.jpeg_decode(data).astype(float)
    black, white = 0.25 * message["white"], message["white"]
    exact = 255 * np.clip((values[::-1, ::-1, 1] - black) / (white - black), 0, 1)
    assert shown.ndim == 2
    assert np.abs(shown - exact).max() < 8  # JPEG at its best quality
    assert message["histogram"]["below"] == pytest.approx(np.mean(values <= black), abs=1e-6)
    for look in ({"black": 1}, {"channel": -1}, {"linear": 1}, {"photodiodes": "all"}, {"axis": "z"}, 5, {"x": 1}):
        client.do("look", look=look)
        assert len(client.until("refused")[0]["words"]) > 20


# --- sequences ---

ACTIONS = some.one_of(
    some.tuples(some.just("set"), some.integers(40, 60), some.booleans()),
    some.tuples(some.sampled_from(["undo", "redo", "add", "remove", "duplicate", "bad", "views"])),
)


@given(some.lists(ACTIONS, min_size=1, max_size=12))
@settings(max_examples=8, deadline=None, suppress_health_check=list(HealthCheck))
def test_document_and_picture_stay_consistent(actions):
    """After any sequence of messages the last picture is that of the document that was told last."""
    client = Client(offered())
    for turn, (what, *more) in enumerate(actions, start=1):
        if what == "set":
            client.do("set", where=["sensor", "z"], value=f"{more[0]} mm", moving=more[1], turn=turn)
        elif what == "add":
            client.do("add", kind="mask", z="10 mm", turn=turn)
        elif what in ("remove", "duplicate"):
            client.do(what, element=0, turn=turn)
        elif what == "bad":
            client.do("set", where=["sensor", "z"], value="far", turn=turn)
        elif what == "views":
            client.do("set", where=["views"], value={"rows": [0, 0], "columns": [0, 2]}, turn=turn)
        else:
            client.do(what, turn=turn)
    client.do("set", where=["exposure"], value=0.25, turn=99)
    while client.at_rest()["turn"] != 99:
        pass
    client.until("notes")
    document = client.session.document
    client.do("value", x=3, y=4)
    told = client.until("value")[0]["irradiance"]
    field = noise() if document.views is None else noise()[document.views.slices]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # of rays that are missing
        expected = camera_of(document).capture(field).upright().to_numpy()[4, 3]
    assert told == pytest.approx(expected.tolist(), rel=1e-6)
    client.do("undo")
    client.do("redo")
    client.do("value", x=3, y=4)
    client.until("value")
    assert client.session.document == document
    client.close()


@pytest.mark.parametrize(
    ("kind", "field", "noun"),
    [("mask", "pattern", "pattern"), ("diffuser", "kernel", "kernel"), ("phase_plate", "surface", "surface")],
)
def test_what_is_chosen_by_name_alone_gets_what_it_needs(client, kind, field, noun):
    client.do("hello")
    parts, _ = client.until("parts")
    client.until("state")
    client.do("add", kind=kind, z="30 mm")
    client.until("state")
    for one in parts["families"][noun]:
        client.do("set", where=["elements", 2, field], value={"name": one["kind"]})
        message, _ = client.until("state")  # none is refused
        given = message["document"]["camera"]["elements"][2][field]
        assert set(given) >= {each["name"] for each in one["parameters"] if each["needed"]}


def test_a_mask_that_becomes_cells_gets_a_width(client):
    client.do("hello")
    client.until("state")
    client.do("set", where=["elements", 1, "pattern"], value=[[0, 1], [1, 1]])
    table = client.until("state")[0]["document"]["camera"]["elements"][1]
    assert table["pattern"] == [[0, 1], [1, 1]]
    assert 18 < float(table["width"].removesuffix(" mm")) < 24  # between the lens and the sensor
    client.do("undo")
    assert client.until("state")[0]["document"] == json.loads(json.dumps(START.as_json()))  # one step


def test_a_picture_is_brought_as_a_pattern(client):
    client.do("hello")
    client.until("state")
    grey = np.array([[0, 51, 255], [255, 102, 0]], np.uint8)
    where = ["elements", 1, "pattern"]
    client.session.receive({"do": "upload", "where": where, "name": "a.png"}, [imagecodecs.png_encode(grey)])
    table = client.until("state")[0]["document"]["camera"]["elements"][1]
    assert table["pattern"] == [[0.0, 0.2, 1.0], [1.0, 0.4, 0.0]]


def npy(values):
    """The bytes of an array's file."""
    stored = io.BytesIO()
    np.save(stored, values)
    return stored.getvalue()


def test_a_photograph_as_pattern_is_reduced_by_means_in_linear_light_and_that_is_said(client):
    client.do("hello")
    client.until("state")
    random = np.random.default_rng(3)
    shown = random.uniform(0, 1, (600, 800)).astype(np.float32)
    data = npy(shown)
    assert len(data) > 2**20
    where = ["elements", 1, "pattern"]
    client.session.receive({"do": "upload", "where": where, "name": "leaf.npy", "turn": 3}, [data])
    cells = np.array(client.until("state")[0]["document"]["camera"]["elements"][1]["pattern"])
    remark, _ = client.until("refused")
    assert remark["done"]
    assert "from 600×800 to 110×147 cells" in remark["words"]
    assert cells.shape == (110, 147)
    assert cells.size <= 2**14
    # each cell is the mean over its area: by repeating each pixel until cells are whole numbers of them
    fine = np.repeat(np.repeat(shown[:, :16].astype(np.float64), 11, axis=0), 147, axis=1)
    wanted = fine.reshape(110, 60, -1)[:, :, :800].mean(axis=(1, 2))
    assert cells[:, 0] == pytest.approx(wanted, abs=6e-5)  # four digits are kept


@pytest.mark.parametrize(
    ("name", "data", "words"),
    [
        ("a.png", b"no picture", "a.png"),
        ("a.npy", npy(np.ones((2, 3, 4, 5))), "2×3×4×5"),
        ("../a.toml", b"", "a.toml"),
        (None, b"", "a file name and one buffer"),
    ],
)
def test_what_is_no_pattern_is_refused(client, name, data, words):
    client.do("hello")
    client.session.receive({"do": "upload", "where": ["elements", 1, "pattern"], "name": name, "turn": 4}, [data])
    refused, _ = client.until("refused")
    assert words in refused["words"]
    assert refused["turn"] == 4


def test_neighbours_trade_places(client):
    client.do("hello")
    client.until("state")
    client.do("reorder", element=0, by=1, turn=3)
    message, _ = client.until("state")
    assert message["turn"] == 3
    assert [element["z"] for element in message["document"]["camera"]["elements"]] == ["26 mm", "0 mm"]
    client.do("reorder", element=0, by=1)
    assert "no element behind" in client.until("refused")[0]["words"]
    client.do("set", where=["elements", 1, "z"], value="26 mm")
    client.do("reorder", element=0, by=1)
    assert "one plane" in client.until("refused")[0]["words"]


# --- films ---


def test_a_film_of_a_sweep(client):
    client.do("hello")
    client.at_rest()
    client.do("export", what="film", where=["sensor", "z"], **{"from": "50 mm", "to": "54 mm"}, frames=5)
    message, (data,) = client.until("file", "refused")
    assert (message["name"], message["type"]) == ("film.gif", "image/gif")
    with PIL.Image.open(io.BytesIO(data)) as film:
        assert (film.n_frames, film.size) == (8, (PIXELS, PIXELS))  # five there, three back
        film.seek(4)
        last = np.asarray(film.convert("RGB")).astype(float)
    ended = START.changed(["sensor", "z"], "54 mm")
    white = 1 / auto_exposure(camera_of(START).capture(noise()).to_numpy())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # of rays that are missing
        values = camera_of(ended).capture(noise()).to_numpy()
    # 256 colours are dithered: the mean is that of the picture
    assert last.mean() == pytest.approx(codes(values, white).mean(), abs=2)
    assert client.session.document == START


@pytest.mark.parametrize("shape", [(24, 26), (23, 25)])
def test_a_film_as_mp4_tells_how_far_it_is_and_leaves_no_file(client, shape, tmp_path, monkeypatch):
    av = pytest.importorskip("av", reason="the extra video is not installed")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    client.do("set", where=["sensor", "shape"], value=list(shape))
    client.at_rest()
    sweep = {"where": ["sensor", "z"], "from": "50 mm", "to": "54 mm", "frames": 4, "there_and_back": False}
    client.do("export", what="film", format="mp4", frames_per_second=10, **sweep)
    told = []
    while (told and told[-1][0]["is"]) != "file":
        told.append(client.until("progress", "file"))
        assert told[-1][0]["is"] != "refused"
    assert [message["done"] for message, _ in told[:-1]] == [0, 1, 2, 3, 4]
    message, (data,) = told[-1]
    assert (message["name"], message["type"]) == ("film.mp4", "video/mp4")
    with av.open(io.BytesIO(data)) as film:
        frames = [frame.to_ndarray(format="rgb24") for frame in film.decode(video=0)]
        assert film.streams.video[0].average_rate == 10
    assert len(frames) == 4
    assert frames[0].shape[:2] == (24, 26)  # H.264 has pairs of rows and columns: the last is there twice
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # of rays that are missing
        values = [
            camera_of(client.session.document.changed(["sensor", "z"], z)).capture(noise()).to_numpy()
            for z in ("50 mm", "54 mm")
        ]
    white = client.session._white
    for frame, each in zip((frames[0], frames[-1]), values, strict=True):
        # H.264 at this quality, with a colour for four pixels: means within some codes
        assert frame[: shape[0], : shape[1]].mean() == pytest.approx(codes(each, white).mean(), abs=4)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("ending", ["gif", "mp4"])
def test_a_film_that_is_broken_off_leaves_nothing(client, ending, tmp_path, monkeypatch):
    if ending == "mp4":
        pytest.importorskip("av", reason="the extra video is not installed")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    client.do("hello")
    client.at_rest()
    sweep = {"where": ["sensor", "z"], "from": "50 mm", "to": "54 mm", "frames": 200}
    client.do("export", what="film", format=ending, **sweep)
    while client.until("progress")[0]["done"] < 2:
        pass
    client.do("set", where=["sensor", "z"], value="53 mm", turn=9)
    assert "cancelled" in client.until("refused", "file")[0]["words"]
    assert client.at_rest()["turn"] == 9
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"to": "1 deg"}, "two quantities of one kind"),
        ({"frames": 1}, "frames is a whole number from 2 to 200"),
        ({"format": "avi"}, "a film is a gif or an mp4"),
        ({"frames_per_second": 100}, "up to 50"),
        ({"where": ["elements", 9, "z"]}, "there is no number 9"),
        ({"to": "5 mm"}, "stands behind the sensor"),
    ],
)
def test_films_that_cannot_be_made_are_refused(client, changes, words):
    client.do("hello")
    client.at_rest()
    asked = {"what": "film", "where": ["sensor", "z"], "from": "50 mm", "to": "54 mm", "frames": 3} | changes
    client.do("export", **asked)
    assert words in client.until("refused", "file")[0]["words"]


@pytest.mark.parametrize(
    "asked",
    [
        {"what": "film", "where": ["sensor", "z"], "from": "50 mm", "to": "54 mm", "frames": 100},
        {"what": "png"},
    ],
)
def test_what_takes_long_is_broken_off_by_a_change(client, asked):
    client.do("hello")
    client.at_rest()
    imaging = client.session._imaging
    imaging.taken = dataclasses.replace(imaging.taken, fineness=COARSER[0])  # a whole one is to be made
    with client.session.offered.turn.held():
        client.do("export", **asked)
        client.do("set", where=["sensor", "z"], value="53 mm", turn=9)
    assert "cancelled" in client.until("refused", "file")[0]["words"]
    assert client.at_rest()["turn"] == 9


def test_those_who_wait_for_a_picture_pass_one_that_takes_long(monkeypatch):
    """A film of a hundred frames is under way while another client's picture is made, and then goes on."""
    monkeypatch.setattr(offered_there, "LONG", 0.0)
    there = offered()
    turn, passed = there.turn, []

    def small(number):
        with turn.held():
            passed.append(number)

    waiting = [threading.Thread(target=small, args=(number,)) for number in range(3)]
    with turn.held() as let_pass:
        assert let_pass() == 0.0  # nobody waits
        for count, each in enumerate(waiting, start=2):
            each.start()
            while len(turn._order) < count:
                time.sleep(0.001)
        assert passed == []
        assert let_pass() > 0
        assert passed == [0, 1, 2]  # in the order of coming
    with pytest.raises(ZeroDivisionError), turn.held(), turn.held(lambda: 1 / 0):
        pass
    with turn.held():  # who gave up waiting is forgotten
        assert len(turn._order) == 1


def test_a_small_picture_does_not_wait_for_all_of_a_large_one(monkeypatch):
    monkeypatch.setattr(offered_there, "LONG", 0.0)
    there = offered()
    large, small = Client(there), Client(there)
    for each in (large, small):
        each.do("hello")
        each.at_rest()
    done, made = threading.Event(), imaging_there.take

    def slow(train, field, document, fineness, progress, kept):
        if document.exposure == 0.5:  # the large one: as long as the small one is not there
            while not done.wait(0.001):
                progress(0, 1)
        return made(train, field, document, fineness, progress, kept)

    monkeypatch.setattr(imaging_there, "take", slow)
    large.do("set", where=["exposure"], value=0.5, turn=2)
    while not there.turn._order:
        time.sleep(0.001)
    small.do("set", where=["sensor", "z"], value="53 mm", turn=2)
    assert small.at_rest()["turn"] == 2
    done.set()
    assert large.at_rest()["turn"] == 2
    large.close()
    small.close()


# --- whatever comes ---

JUNK = some.recursive(
    some.none()
    | some.booleans()
    | some.integers(-3, 30)
    | some.sampled_from([1e300, -1e-300, 10**400, "", "5 mm", "lens", "mask.png", "1 deg", "elements"])
    | some.sampled_from([["elements", 1, "pattern"], ["sensor", "z"], ["elements", 0], {"name": "mura"}]),
    lambda inner: some.lists(inner, max_size=3) | some.dictionaries(some.sampled_from(["name", "kind"]), inner),
    max_leaves=5,
)


@given(
    some.lists(
        some.tuples(
            some.sampled_from(CHANGES + QUESTIONS), some.dictionaries(some.sampled_from(ASKED), JUNK, max_size=4)
        ),
        min_size=1,
        max_size=8,
    )
)
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
def test_whatever_comes_is_done_or_refused_in_words(messages):
    """No message ends in a fault of the program, and the bench goes on after each."""
    client = Client()
    for what, fields in messages:
        client.session.receive({"do": what} | fields, [b"junk"])
    client.do("hello", turn=77)
    while True:
        message, _ = client.until("picture", "no picture", "failed", "state")
        assert message["is"] != "failed", message
        if message.get("turn") == 77 and message["is"] != "state":
            break
    client.close()


def test_thread_is_there_while_there_is_work(monkeypatch):
    monkeypatch.setattr(session_there, "LINGER", 0.01)
    client = Client()
    assert client.session.join(0)
    for turn in (1, 2):
        client.do("hello", turn=turn)
        assert client.at_rest()["turn"] == turn
        assert client.session.join(300)
    client.close()
