"""Splats on the bench: few coarse views at first, then better ones, as if these had been there from the start."""

import math

import numpy as np
import pytest

import vcc
from tests.bench.on_bench import NOWHERE, Client, offered
from tests.command_line import refused, run
from tests.sources.splat_clouds import spheres
from vcc.bench import splat_views, widget
from vcc.bench.document import Document
from vcc.bench.offered import Field
from vcc.bench.splat_views import SplatViews
from vcc.cli import bench as command
from vcc.sources import Viewpoint
from vcc.sources.splats import SplatScene, write_ply
from vcc.units import mm

LENS = {"kind": "lens", "name": "main", "z": "0 mm", "focal_length": "50 mm", "diameter": "18 mm"}
CAMERA = {"elements": [LENS], "sensor": {"z": "51 mm", "shape": [16, 24], "pitch": "1 mm"}}
CLOUD = spheres([((-0.3, 0.0, 2.0), 0.4), ((0.5, 0.2, 4.0), 0.7)], 800)
AHEAD = Viewpoint(target=(0, 0, 1), up=(0, -1, 0))


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(splat_views, "LEVELS", ((2, 12), (3, 24)))


def train():
    return Document(CAMERA, "balls").train(NOWHERE).train


def views():
    return SplatViews.before(train(), SplatScene(CLOUD, AHEAD, threads=1))


def test_views_fill_the_camera():
    cameras = views().cameras(3, 24)
    assert cameras.shape == (3, 3, 16, 24)
    assert np.multiply(cameras.spacings, 3) == pytest.approx([20 * mm, 20 * mm])  # 10/9 of the lens
    # seen from the middle of the lens, the sensor of 24 mm at 51 mm, with a margin
    assert 24 * cameras.slopes_per_pixel[1] == pytest.approx(1.05 * 24 / 51)
    # of an opening behind the lens, what it lets pass of distant light
    stopped = {"kind": "mask", "z": "25 mm", "pattern": {"name": "circle", "diameter": "4 mm"}}
    behind = Document(CAMERA | {"elements": [LENS, stopped]}, "balls").train(NOWHERE).train
    assert SplatViews.before(behind, SplatScene(CLOUD, AHEAD)).aperture == pytest.approx([80 / 9 * mm] * 2)
    # 2 − 0.4 m and, but for its rim, 4 − 0.7 m: the middle of the disparities
    assert cameras.focus_distance == pytest.approx(2 / (1 / 1.6 + 1 / 3.6), rel=0.1)


@pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")
def test_the_bench_shows_few_views_first_and_then_the_best():
    there = offered(fields={"balls": views().field()}, start=Document(CAMERA, "balls"))
    client = Client(there)
    client.do("hello", turn=3)
    assert client.until("state")[0]["grid"] is None
    shapes = []
    while len(shapes) < 2:
        message, _ = client.until("picture", "state", "failed", "refused")
        assert message["is"] not in ("failed", "refused"), message
        if message["is"] == "picture" and not message["coarse"]:
            shapes.append(there.field("balls").whole().shape[:4])
            assert message["turn"] == 3
    assert shapes == [(2, 2, 8, 12), (3, 3, 16, 24)]
    client.do("export", what="exr")
    _, (improved,) = client.until("file")
    client.close()
    best = Client(offered(fields={"balls": Field(there.field("balls").whole())}, start=there.start))
    best.do("hello")
    assert best.at_rest()["is"] == "picture"
    best.do("export", what="exr")
    assert best.until("file")[1] == [improved]
    best.close()


def test_an_interruption_keeps_views():
    class Counted(SplatScene):
        rendered = 0

        def render(self, camera):
            self.rendered += 1
            return super().render(camera)

    def stop(done, total):
        if done == 3:
            raise KeyboardInterrupt

    scene = Counted(CLOUD, AHEAD)
    field = SplatViews.before(train(), scene).field()
    scene.rendered = 0
    with pytest.raises(KeyboardInterrupt):
        field.whole(stop)
    assert not field.is_open
    whole = field.whole()
    assert scene.rendered == 4
    assert (whole.shape, field.better.is_open) == ((2, 2, 8, 12, 3), False)


def test_better_views_that_cannot_be_made_leave_the_coarse_ones():
    def fails(progress):
        raise vcc.InputError("no more memory")

    coarse = Field(views().field().whole(), "", Field(fails))
    client = Client(offered(fields={"balls": coarse}, start=Document(CAMERA, "balls")))
    client.do("hello")
    assert client.at_rest()["is"] == "picture"
    assert "no more memory" in client.until("refused")[0]["words"]
    assert client.at_rest()["is"] == "picture"
    client.close()


def test_the_command_opens_a_file_of_splats(tmp_path, monkeypatch):
    found = {}
    monkeypatch.setattr(command, "run", lambda there, **how: found.update(there=there))
    monkeypatch.setattr(command, "_prepared", lambda offered: None)
    monkeypatch.chdir(tmp_path)
    write_ply(CLOUD, tmp_path / "balls.ply")
    done = run("bench", "balls.ply", "--eye", "0, 0, 0", "--target", "0, 0, 1", "--unit", "50 cm")
    assert done.exit_code == 0, done.output
    there = found["there"]
    assert there.start.light_field == "balls.ply"
    field = there.field("balls.ply")
    focus = field.better.whole().grid.distance_of(0)
    # the lens is focused where the views converge: 1/z = 1/f - 1/distance
    sensor = there.start.train(there.beside).train.sensor.z
    assert sensor == pytest.approx(1 / (1 / 0.05 - 1 / focus), rel=1e-3)
    assert math.isclose(focus, 0.5 * views().focus_distance, rel_tol=0.1)
    made = {}
    exec(field.source, made)
    assert np.array_equal(made["light_field"].values, field.better.whole().values)
    assert "for a scene of Gaussian splats" in refused("bench", "--unit", "50 cm")
    assert "leave out --missing" in refused("bench", "balls.ply", "--missing", "fill")
    assert "are behind the array" in refused("bench", "balls.ply", "--eye", "0, 0, 9", "--target", "0, 0, 99")


def test_a_scene_is_on_the_bench_of_a_notebook():
    camera = vcc.Camera(train().elements, train().sensor)
    there = widget._offered(camera, SplatScene(CLOUD, AHEAD))
    assert there.field(widget.NAME).whole().shape[:2] == (2, 2)
    assert there.field(widget.NAME).better is not None
