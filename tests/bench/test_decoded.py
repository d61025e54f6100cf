"""Decoded views on the bench: what a session answers, in which order, and what breaks it off."""

import dataclasses

import imagecodecs
import numpy as np
import pytest

import vcc
from tests.bench.on_bench import NOWHERE, START, Client, offered
from vcc.bench.cameras import HETERODYNE, PLENOPTIC, SCENE, cameras
from vcc.bench.document import Document
from vcc.bench.offered import Field
from vcc.fields.grid import camera_array_frame
from vcc.recover import Decoder
from vcc.units import mm

FOCUS, AWAY = 1.3, 0.9
PIXELS, LENSLETS = 3, 40
LENS = {"kind": "lens", "name": "main", "z": "0 mm", "focal_length": "50 mm", "diameter": "18 mm"}
ARRAY = {
    "kind": "lens_array",
    "name": "lenslets",
    "z": "52 mm",
    "pitch": "0.59 mm",
    "focal_length": "1.73 mm",
    "offset": ["0.295 mm", "0.295 mm"],
}
SENSOR = {"z": "53.73 mm", "shape": [LENSLETS * PIXELS] * 2, "pitch": "0.2 mm"}
PLENOPTIC_CAMERA = Document({"elements": [LENS, ARRAY], "sensor": SENSOR}, "plane")


# Decoding is tested, not the noise of 64 rays a pixel.
pytestmark = pytest.mark.filterwarnings("ignore:the sampling error of:vcc.ResultWarning")


def plane() -> vcc.LightField:
    """Views of noise on a plane `AWAY`, some pixels of a decoded view fine; brighter at the top than below."""
    shape = (7, 7, 90, 90)
    frame = camera_array_frame(shape, 20 * mm / 7, 30 * mm / 90 / (52 * mm), FOCUS)
    index = np.moveaxis(np.indices(shape), 0, -1)[..., [1, 0, 3, 2]].reshape(-1, 4).astype(float)
    rays = frame(index).reshape(*shape, 4)
    x, y = (rays[..., n] - AWAY * rays[..., n + 2] for n in (0, 1))  # places on the plane, metres
    random = np.random.default_rng(3)
    values = 0.5 - 0.8 * y
    for _ in range(40):
        turned, phase = random.uniform(0, np.pi), random.uniform(0, 2 * np.pi)
        values += 0.03 * np.cos(2 * np.pi * 28 * (np.cos(turned) * x + np.sin(turned) * y) + phase)
    lf = vcc.LightField(np.clip(values, 0, 1).astype(np.float32), frame)
    return dataclasses.replace(lf, disparity_range=(lf.disparity_of(2.0), lf.disparity_of(0.5)))


FIELD = Field(plane())


@pytest.fixture
def client():
    made = Client(offered(fields={"plane": FIELD}, start=PLENOPTIC_CAMERA))
    yield made
    made.close()


def asked(client, **options):
    client.do("ask", what="decoded", **options)
    return client.until("answer", "refused", "failed")


def test_views_and_a_picture_come_upright(client):
    client.do("hello")
    client.at_rest()
    told, pictures = asked(client)
    sheet, middle, refocused = (imagecodecs.jpeg_decode(each).astype(float) for each in pictures)
    rows, columns = told["shape"]
    assert told["views"] == [PIXELS, PIXELS]
    assert told["words"].startswith(f"3×3 views of {rows}×{columns} pixels")
    assert (rows, columns) == middle.shape[:2] == refocused.shape[:2]
    assert sheet.shape[:2] == (3 * rows + 4, 3 * columns + 4)  # two lines of two pixels between
    assert told["focus"] == pytest.approx(FOCUS, rel=0.01)
    assert told["distance"] == told["focus"]
    assert (told["nearest"], told["farthest"]) == pytest.approx((0.5, 2.0))
    for picture in (sheet[:rows, :columns], middle, refocused):
        assert picture[: rows // 3].mean() > picture[-rows // 3 :].mean() + 10


def test_it_is_sharpest_at_the_distance_of_what_is_there(client):
    client.do("hello")
    client.at_rest()
    asked(client)
    contrast = {}
    # Elsewhere the plane's waves of 36 mm are blurred over 18 mm·|1 − AWAY/distance|, 8 to 18 mm.
    for distance in (0.45, 0.6, AWAY, 1.6, 3.0):
        client.do("ask", what="refocused", distance=f"{distance} m")
        told, (data,) = client.until("answer")
        assert told["distance"] == distance
        picture = imagecodecs.jpeg_decode(data).astype(float)
        contrast[distance] = np.diff(picture[6:-6, 6:-6], axis=1).std()
    assert max(contrast, key=contrast.get) == AWAY
    client.do("ask", what="refocused", distance="-1 m")
    assert "before the camera" in client.until("refused")[0]["words"]


def test_what_cannot_be_decoded_is_answered_with_the_reason():
    client = Client()
    client.do("hello")
    told, pictures = asked(client)
    assert "neither an array of lenslets nor a mask of cosines" in told["why"]
    assert pictures == []
    client.close()


def test_the_picture_comes_first_and_what_is_decoded_is_kept(client, monkeypatch):
    calibrated = []
    calibration = Decoder.calibration

    def counted(self, *given):
        calibrated.append(self)
        return calibration(self, *given)

    monkeypatch.setattr(Decoder, "calibration", counted)
    client.do("hello")
    client.do("ask", what="decoded")
    first, _ = client.until("picture", "answer")
    assert first["is"] == "picture"
    client.until("answer")
    client.do("set", where=["exposure"], value=0.5)
    asked(client)
    asked(client, distance="0.9 m")
    assert len(calibrated) == 1
    client.do("set", where=["elements", 1, "pitch"], value="0.6 mm")
    asked(client)
    assert len(calibrated) == 2


def test_it_is_broken_off_where_the_camera_changes(client):
    """While it waits for its turn something moves: no answer comes and no refusal, but the new picture."""
    client.do("hello")
    client.at_rest()
    client.until("notes")
    with client.session.offered.turn.held():
        client.do("ask", what="decoded")
        client.do("set", where=["sensor", "z"], value="53.7 mm", turn=7)
        told, _ = client.until("state", "answer", "refused")
        assert (told["is"], told["turn"]) == ("state", 7)
    assert client.at_rest()["turn"] == 7
    assert {message["is"] for message, _ in client.told} <= {"notes"}
    assert asked(client)[0]["is"] == "answer"


def test_with_noise_the_recording_is_decoded(client):
    client.do("set", where=["sensor", "electronics"], value={"full_well": 400})
    client.do("set", where=["noise"], value=True, turn=3)
    while client.at_rest()["turn"] != 3:
        pass
    noisy = imagecodecs.jpeg_decode(asked(client)[1][1]).astype(float)
    client.do("set", where=["noise"], value=False)
    clean = imagecodecs.jpeg_decode(asked(client)[1][1]).astype(float)
    # 200 electrons err by 7 % of the light, 3 % of a code of 200; where there are more, by less.
    assert (noisy - clean).std() > 3


@pytest.mark.parametrize(("title", "views"), [(HETERODYNE, 5), (PLENOPTIC, 5)])
def test_cameras_of_the_gallery_have_the_views_that_they_are_called_by(title, views):
    train = cameras(SCENE)[title].train(NOWHERE).train
    decoder = Decoder.of(vcc.Camera(train.elements, train.sensor))
    assert decoder.views == (views, views)
    assert f"{views}×{views} views of" in title


def test_other_cameras_have_none():
    train = START.train(NOWHERE).train
    with pytest.raises(vcc.InputError, match="holds no views"):
        Decoder.of(vcc.Camera(train.elements, train.sensor))
