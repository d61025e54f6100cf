"""``vcc sweep``: what it writes, what it says, and that it goes on."""

from __future__ import annotations

import csv
import random
import signal
import subprocess
import sys
import time

import imagecodecs
import numpy as np
import pytest
import xarray

import vcc
from tests.command_line import CAMERA, KNOWN, refused, run, write_views
from vcc.run import serialization
from vcc.sweeps import open_sweep, sweeping

MASK = """
[[elements]]
kind = "mask"
name = "code"
pattern = { name = "mura", prime = 5 }
width = "4 mm"
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "camera.toml").write_text(CAMERA.replace("[sensor]", f"{MASK}\n[sensor]"))
    np.save(tmp_path / "files" / "code.npy", np.eye(5))
    write_views(tmp_path / "views")
    return tmp_path


def sweep(*arguments):
    return "sweep", "files/camera.toml", "views", *arguments, *KNOWN


def test_pictures_table_and_sheet_are_written(folder):
    values = ["--set", "sensor.z=51mm:53mm:3", "--set", "code.pattern=mura, circle, code.npy"]
    result = run(*sweep(*values, "-o", "all.zarr", "--table", "all.csv", "--sheet", "all.png", "--sharpness"))
    assert result.exit_code == 0, result.output
    assert "all.zarr: 9 pictures of 12×16×3, sensor.z × code.pattern" in result.stdout
    assert "all.csv: 9 rows of 6 columns" in result.stdout
    assert " of 9 cameras, one of them: " in result.stderr
    swept = open_sweep("all.zarr")
    camera = vcc.load_camera("files/camera.toml")
    mask = vcc.Mask(np.eye(5), width=4e-3, name="code")
    other = vcc.Camera([camera.elements[0], mask], vcc.Sensor(53e-3, (12, 16), 1e-3))
    with pytest.warns(vcc.ResultWarning):
        alone = other.capture(
            vcc.open_light_field("views", spacing=1e-3, slope_per_pixel=0.02, focus_distance=1.3)
        )
    np.testing.assert_allclose(swept.pictures[2, 2], alone.values, atol=1e-6 * alone.values.max())
    with (folder / "all.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["code.pattern"] for row in rows[:3]] == ["mura", "circle", "code.npy"]
    assert [float(row["mean"]) for row in rows] == swept.table["mean"].tolist()
    assert imagecodecs.png_decode((folder / "all.png").read_bytes()).std() > 10
    again = run(*sweep(*values, "-o", "all.zarr", "--sharpness"))
    assert (again.exit_code, again.stderr) == (0, "")  # nothing was left to do, and nothing to remark


def test_a_table_alone_of_a_drawn_design_against_a_target(folder):
    run("capture", "files/camera.toml", "views", "-o", "target.npy", *KNOWN)
    drawn = ["--design", "sobol", "--count", "4", "--set", "sensor.z=51mm:53mm", "--set", "lens.diameter=3mm:4mm"]
    result = run(*sweep(*drawn, "-o", "some.csv", "--target", "target.npy", "--deblurring", "2 m"))
    assert result.exit_code == 0, result.output
    heads = "sensor.z [m],lens.diameter [m],mean,missing_rays,sampling_error,psnr,deblurring_error"
    assert (folder / "some.csv").read_text().splitlines()[0] == heads
    assert not (folder / "some.zarr").exists()


def test_an_executor_makes_the_same_pictures(folder, monkeypatch):
    values = ["--set", "sensor.z=51mm:53mm:3", "--set", "code.pattern=mura, circle"]
    assert run(*sweep(*values, "-o", "here.zarr")).exit_code == 0
    result = run(*sweep(*values, "-o", "there.zarr", "--executor", "threads"))
    assert result.exit_code == 0, result.output
    assert " of 6 cameras, one of them: " in result.stderr
    here, there = (np.asarray(open_sweep(name).pictures) for name in ("here.zarr", "there.zarr"))
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-6 * here.max())
    monkeypatch.setattr(serialization, "SENT", 1000)
    said = refused(*sweep(*values, "-o", "more.zarr", "--executor", "threads"))
    assert "views is too large to be sent" in said
    assert "convert it with vcc convert views scene.zarr" in said


def test_a_metric_is_added_to_a_finished_sweep(folder):
    values = ["--set", "sensor.z=51mm:53mm:3", "-o", "all.zarr"]
    run(*sweep(*values))
    result = run(*sweep(*values, "--sharpness", "--table", "all.csv"))
    assert (result.exit_code, result.stderr) == (0, "")
    assert (folder / "all.csv").read_text().splitlines()[0].endswith("sampling_error,sharpness")
    assert open_sweep("all.zarr").table["sharpness"].min() > 0


KILLED = """
import sys, time
from vcc.cli import app
from vcc.sweeps import keeping, sweeping
sweeping.MOST_TOGETHER, keeping.NOTED_EVERY = 3, 0.0
sweeping.tell = lambda progress, done, total: time.sleep(600 if done > 21 else 0)  # who kills it is in time
app.run(sys.argv[1:])
"""


def test_a_sweep_that_is_killed_goes_on(folder, monkeypatch):
    monkeypatch.setattr(sweeping, "MOST_TOGETHER", 3)
    (folder / "files" / "camera.toml").write_text(CAMERA)
    values = ["--set", "sensor.z=51mm:53mm:30", "--sharpness"]
    assert run(*sweep(*values, "-o", "whole.zarr")).exit_code == 0
    whole, kept, some = open_sweep("whole.zarr"), folder / "all.zarr", random.Random(time.time_ns()).randint(1, 20)
    process = subprocess.Popen([sys.executable, "-c", KILLED, *sweep(*values, "-o", "all.zarr")])
    while len(list(kept.glob("pictures/c/*/*/*/*"))) < some and process.poll() is None:
        time.sleep(0.003)
    process.kill()
    assert process.wait() == -signal.SIGKILL
    with xarray.open_dataset(kept, engine="zarr", consolidated=False) as data:
        assert int(data.done.sum()) >= some - 3 - 3  # but for those at work, and those not yet noted
        np.testing.assert_array_equal(data.pictures.values[data.done], np.asarray(whole.pictures)[data.done])
    assert run(*sweep(*values, "-o", "all.zarr")).exit_code == 0
    again = open_sweep(kept)
    assert np.asarray(again.pictures).tobytes() == np.asarray(whole.pictures).tobytes()
    assert {name: each.tolist() for name, each in again.table.columns.items()} == {
        name: each.tolist() for name, each in whole.table.columns.items()
    }
    assert not [each for each in kept.rglob("*") if "partial" in each.name]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--set", "sensr.z=1mm:2mm:3", "-o", "a.zarr"], "no parameter 'sensr.z'; did you mean sensor.z"),
        (["--set", "sensor.z:3", "-o", "a.zarr"], 'it is a name and values, like "sensor.z=50mm:54mm:40"'),
        (
            ["--set", "sensor.z=50:54:3", "-o", "a.zarr"],
            'to another, in so many values, like "50mm:54mm:40"',
        ),
        (["--set", "sensor.z=50mm:nan mm:3", "-o", "a.zarr"], "a range goes from one length to another"),
        (["--set", "sensor.z=50mm:54mm:2.5", "-o", "a.zarr"], 'from 1 to 1000000, not "2.5"'),
        (["--set", "sensor.z=,", "-o", "a.zarr"], "sensor.z has no values"),
        (["--set", "sensor.z=51mm", "--set", "sensor.z=52mm", "-o", "a.zarr"], "sensor.z is given more than once"),
        (["--set", "sensor.z=51mm", "-o", "a.png"], "end its name in .zarr, .csv, .parquet"),
        (["--set", "sensor.z=51mm", "-o", "a.csv", "--sheet", "a.png"], "a table alone keeps none"),
        (["--set", "sensor.z=51mm", "--count", "3", "-o", "a.zarr"], "count applies to random and Sobol' designs"),
        (["--set", "code.pattern=hexagon", "-o", "a.zarr"], '"hexagon", which is no file in '),
        (
            ["--set", "sensor.z=51mm", "-o", "a.zarr", "--executor", "cluster"],
            "--executor is processes, threads or",
        ),
    ],
)
def test_what_cannot_be_done_is_named_before_the_work(folder, arguments, said):
    assert said in refused(*sweep(*arguments))
    assert not (folder / "a.zarr").exists()
