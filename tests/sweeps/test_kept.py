"""Sweeps on disk: what another program reads, what a stop leaves, and what is refused."""

from __future__ import annotations

import errno
import json
import os
import random
import re
import shutil
import subprocess
import sys

import numpy as np
import pytest
import xarray
import zarr

import vcc
from tests.lock_holder import LOCKS
from vcc.patterns import Circle, mura
from vcc.sweeps import PSNR, DeblurringError, listed, open_sweep, save_sweep, sweeping
from vcc.units import mm

pytestmark = pytest.mark.filterwarnings("ignore::vcc.ResultWarning")

CAMERA = vcc.Camera(
    [vcc.Lens(50 * mm, name="main"), vcc.Mask(mura(5), width=8 * mm, name="code")],
    vcc.Sensor(52 * mm, (12, 16), 0.5 * mm),
)
VALUES = {"sensor.z": "51mm:53mm:3", "code.pattern": "mura, circle"}


def light_field(seed=2):
    values = np.random.default_rng(seed).random((3, 3, 14, 18, 3), dtype=np.float32)
    return vcc.LightField.from_views(values, spacing=2.4 * mm, slope_per_pixel=0.01)


FIELD = light_field()


def content_of_table(swept):
    return {name: column.tolist() for name, column in swept.table.columns.items()}


def content(swept):
    return np.asarray(swept.pictures[...]), content_of_table(swept)


def assert_same(one, other):
    np.testing.assert_array_equal(content(one)[0], content(other)[0])
    assert content(one)[1] == content(other)[1]
    assert (one.axes, one.shape, repr(one)) == (other.axes, other.shape, repr(other))


def test_what_is_kept_is_what_is_made_in_memory(tmp_path):
    swept = vcc.sweep(CAMERA, FIELD, VALUES, metrics=["sharpness"], output=tmp_path / "sweep.zarr")
    alone = vcc.sweep(CAMERA, FIELD, VALUES, metrics=["sharpness"])
    assert_same(swept, alone)
    opened = open_sweep(tmp_path / "sweep.zarr")
    assert_same(opened, alone)
    np.testing.assert_array_equal(opened[2, 1].values, alone[2, 1].values)
    assert opened[2, 1].frame == CAMERA.sensor.frame
    save_sweep(alone, tmp_path / "saved.zarr")
    assert_same(open_sweep(tmp_path / "saved.zarr"), alone)


def test_xarray_opens_it_with_coordinates_and_units(tmp_path):
    swept = vcc.sweep(CAMERA, FIELD, VALUES, metrics={"bright": lambda image: image.values.max()})
    save_sweep(swept, tmp_path / "sweep.zarr")
    with xarray.open_dataset(tmp_path / "sweep.zarr", engine="zarr", consolidated=False) as data:
        assert data.pictures.dims == ("sensor.z", "code.pattern", "row", "column", "channel")
        np.testing.assert_allclose(data["sensor.z"], [51 * mm, 52 * mm, 53 * mm])
        assert data["sensor.z"].attrs["units"] == data.x.attrs["units"] == "m"
        assert data["code.pattern"].values.tolist() == ["mura", "circle"]
        found = data.pictures.sel({"code.pattern": "circle"}).isel({"sensor.z": 2})
        np.testing.assert_array_equal(found, swept[2, 1].values)
        np.testing.assert_array_equal(data.bright, np.asarray(swept.pictures).max(axis=(2, 3, 4)))
        # Of a pixel's place, the oracle is the frame.
        corner = CAMERA.sensor.frame([15, 11])
        np.testing.assert_allclose([data.x[15], data.y[11]], corner)


def test_a_list_has_its_parameters_along_one_axis(tmp_path):
    values = listed({"sensor.z": "51mm, 52mm", "sensor.pitch": [(0.5 * mm, 0.4 * mm), (0.5 * mm, 0.5 * mm)]})
    path = tmp_path / "sweep.zarr"
    swept = vcc.sweep(CAMERA, FIELD, values, output=path)
    assert open_sweep(path)[0].frame != swept[1].frame
    with xarray.open_dataset(path, engine="zarr", consolidated=False) as data:
        assert data.pictures.dims[0] == "camera"
        assert set(data["mean"].coords) == {"sensor.z", "sensor.pitch"} == set(data.pictures.coords)
        assert data["sensor.pitch"].values.tolist() == ["(500 um, 400 um)", "(500 um, 500 um)"]


class Stopped(Exception):
    pass


def stopped_after(pictures):
    def progress(done, total):
        if done >= pictures:
            raise Stopped

    return progress


def counted(monkeypatch):
    """How many cameras are captured from now on."""
    captured, made = sweeping.each_captured, []

    def counting(cameras, *rest, **named):
        made.extend(cameras)
        return captured(cameras, *rest, **named)

    monkeypatch.setattr(sweeping, "each_captured", counting)
    return made


def test_it_goes_on_where_it_was_stopped(tmp_path, monkeypatch):
    monkeypatch.setattr(sweeping, "MOST_TOGETHER", 2)
    path = tmp_path / "sweep.zarr"
    with pytest.raises(Stopped):
        vcc.sweep(CAMERA, FIELD, VALUES, output=path, progress=stopped_after(4))
    left = open_sweep(path)
    assert (int(left.done.sum()), left.complete, np.isnan(left.table["mean"]).sum()) == (4, False, 2)
    assert "2 to be done" in repr(left)
    with pytest.raises(vcc.InputError, match="is not done yet"):
        left[tuple(np.argwhere(~left.done)[0])]
    made = counted(monkeypatch)
    assert_same(vcc.sweep(CAMERA, FIELD, VALUES, output=path), vcc.sweep(CAMERA, FIELD, VALUES))
    assert len(made) == 2 + 6
    assert_same(vcc.sweep(CAMERA, FIELD, VALUES, output=path), open_sweep(path))
    assert len(made) == 2 + 6  # nothing was left to do


def test_a_full_disk_loses_nothing_that_was_done(tmp_path, monkeypatch):
    monkeypatch.setattr(sweeping, "MOST_TOGETHER", 2)
    path = tmp_path / "sweep.zarr"
    put, full = zarr.storage._local._put, []

    def put_or_not(target, *rest, **options):
        if (
            "pictures" in str(target)
            and "/c/" in str(target)
            and len(list((path / "pictures").rglob("c/*/*/*"))) >= 3
        ):
            full.append(target)
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return put(target, *rest, **options)

    monkeypatch.setattr(zarr.storage._local, "_put", put_or_not)
    said = (
        r"picture of sensor.z .*, code.pattern .* could not be written to .*sweep.zarr: No space left.*MB are free"
    )
    with pytest.raises(vcc.InputError, match=said + r".*\. 3 of 6 pictures are kept in .*sweep.zarr: run"):
        vcc.sweep(CAMERA, FIELD, VALUES, output=path)
    assert full
    monkeypatch.setattr(zarr.storage._local, "_put", put)
    made = counted(monkeypatch)
    whole = vcc.sweep(CAMERA, FIELD, VALUES, output=path)
    assert len(made) == 4  # two batches: with others a picture would be another in the last digit
    assert_same(whole, vcc.sweep(CAMERA, FIELD, VALUES))


OTHERS = {
    "parameters": (
        {"parameters": {**VALUES, "sensor.z": "51mm:53mm:4"}},
        r"parameters.sensor.z is '51 mm … 53 mm, 3",
    ),
    "camera": (
        {"cameras": vcc.Camera([vcc.Lens(51 * mm, name="main"), *CAMERA.elements[1:]], CAMERA.sensor)},
        "camera is",
    ),
    "light field": ({"light_field": light_field(3)}, r"light field is '3×3×14×18×3"),
    "how": ({"interpolation": "linear"}, r"how.interpolation is None there and 'linear' now"),
    "pictures": ({"pictures": False}, r"pictures is \[12, 16, 3\] there and None now"),
}


@pytest.mark.parametrize("what", OTHERS)
def test_another_sweep_is_not_mixed_with_it(tmp_path, what):
    given = {"cameras": CAMERA, "light_field": FIELD, "parameters": VALUES, "output": tmp_path / "sweep.zarr"}
    vcc.sweep(**given)
    changed, said = OTHERS[what]
    with pytest.raises(vcc.InputError, match=rf"sweep.zarr is another sweep.*never mixed\. {said}.*Remove it"):
        vcc.sweep(**{**given, **changed})


def test_a_sweep_of_another_version_is_not_gone_on_with(tmp_path):
    path = tmp_path / "sweep.zarr"
    vcc.sweep(CAMERA, FIELD, VALUES, output=path)
    group = zarr.open_group(path, mode="r+")
    stated = group.attrs["sweep"]
    group.attrs["sweep"] = {**stated, "description": {**stated["description"], "version": "0.0.1"}}
    with pytest.raises(vcc.InputError, match=r"version is '0.0.1' there and '.*' now"):
        vcc.sweep(CAMERA, FIELD, VALUES, output=path)
    group.attrs["sweep"] = {**stated, "format_version": 99}
    with pytest.raises(vcc.InputError, match=r"format_version 99.*use a newer vcc"):
        open_sweep(path)


def test_functions_of_python_are_not_gone_on_with(tmp_path):
    mask = vcc.Mask(lambda x, y: 1.0 * (x > 0), width=8 * mm, name="code")
    camera = vcc.Camera([vcc.Lens(50 * mm), mask], CAMERA.sensor)
    values = {"sensor.z": "52mm, 53mm"}
    vcc.sweep(camera, FIELD, values, output=tmp_path / "sweep.zarr")
    with pytest.raises(vcc.InputError, match="functions cannot be compared"):
        vcc.sweep(camera, FIELD, values, output=tmp_path / "sweep.zarr")


def test_metrics_are_told_of_pictures_that_are_kept(tmp_path, monkeypatch):
    path = tmp_path / "sweep.zarr"
    target = vcc.sweep(CAMERA, FIELD, VALUES)[0, 0]
    first = {"bright": lambda image: image.values.max(), "psnr": PSNR(target)}
    vcc.sweep(CAMERA, FIELD, VALUES, output=path, metrics=first)
    made = counted(monkeypatch)
    then = {"psnr": PSNR(target, peak=2.0), "R": DeblurringError(2.0), "sharpness": "sharpness"}
    calls = []
    found = vcc.sweep(CAMERA, FIELD, VALUES, output=path, metrics=then, progress=lambda *call: calls.append(call))
    assert (made, calls) == ([], [(n, 6) for n in range(1, 7)])
    assert_same(open_sweep(path), found)
    # The column of a metric that is no longer asked for stays; one that is another under the same name is new.
    alone = vcc.sweep(CAMERA, FIELD, VALUES, metrics={**first, **then}).table
    assert list(found.table.columns) == list(alone.columns)
    assert content_of_table(found) == {name: alone[name].tolist() for name in alone.columns}
    with xarray.open_dataset(path, engine="zarr", consolidated=False) as data:
        np.testing.assert_array_equal(data.R, found.numbers["R"])


def test_telling_goes_on_where_it_was_stopped(tmp_path):
    path, asked = tmp_path / "sweep.zarr", []
    vcc.sweep(CAMERA, FIELD, VALUES, output=path)

    def mean(image):
        asked.append(image.camera)
        return image.values.mean() if len(asked) != 4 else "nothing"

    with pytest.raises(vcc.InputError, match=r"metric mean_too gives 'nothing'.*\. 6 of 6 pictures are kept"):
        vcc.sweep(CAMERA, FIELD, VALUES, output=path, metrics={"mean_too": mean})
    assert np.isnan(open_sweep(path).table["mean_too"]).tolist() == [False] * 3 + [True] * 3
    found = vcc.sweep(CAMERA, FIELD, VALUES, output=path, metrics={"mean_too": mean})
    np.testing.assert_allclose(found.table["mean_too"], found.table["mean"], rtol=1e-6)
    assert asked == [*list(found.cameras)[:4], *list(found.cameras)[3:]]


def test_no_metric_is_told_of_pictures_that_were_not_kept(tmp_path):
    given = {"pictures": False, "output": tmp_path / "sweep.zarr"}
    kept = vcc.sweep(CAMERA, FIELD, VALUES, metrics=["sharpness"], **given)
    with pytest.raises(vcc.InputError, match=r"keeps no pictures, which R would need: leave that out"):
        vcc.sweep(CAMERA, FIELD, VALUES, metrics={"R": DeblurringError(2.0)}, **given)
    assert content_of_table(vcc.sweep(CAMERA, FIELD, VALUES, **given)) == content_of_table(kept)


def test_what_is_no_sweep_is_left_alone(tmp_path):
    (tmp_path / "file.zarr").write_text("precious")
    (tmp_path / "folder.zarr").mkdir()
    vcc.store.save_store(FIELD, tmp_path / "field.zarr")
    for name, said in (("file", "it is a file"), ("folder", "holds no zarr.json"), ("field", 'no "sweep"')):
        for refused in (lambda path: vcc.sweep(CAMERA, FIELD, VALUES, output=path), open_sweep):
            with pytest.raises(vcc.InputError, match=said):
                refused(tmp_path / f"{name}.zarr")
    with pytest.raises(vcc.InputError, match=r"there is no folder .*nowhere; make it first"):
        vcc.sweep(CAMERA, FIELD, VALUES, output=tmp_path / "nowhere" / "sweep.zarr")
    assert sorted(each.name for each in tmp_path.iterdir()) == ["field.zarr", "file.zarr", "folder.zarr"]


def test_a_damaged_sweep_is_named(tmp_path):
    path = tmp_path / "sweep.zarr"
    vcc.sweep(CAMERA, FIELD, VALUES, output=path)
    stated = json.loads((path / "done" / "zarr.json").read_text())
    (path / "done" / "zarr.json").write_text(json.dumps({**stated, "data_type": "nonsense"}))
    with pytest.raises(vcc.InputError, match=r"sweep.zarr/done/zarr.json cannot be read as an array of a sweep"):
        open_sweep(path)


def test_two_do_not_write_one_sweep(tmp_path):
    path = tmp_path / "sweep.zarr"
    holder = subprocess.Popen(
        [sys.executable, "-c", LOCKS, str(path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    try:
        assert holder.stdout.readline() == b"held\n"
        with pytest.raises(vcc.InputError, match=rf"is being written by process {holder.pid}"):
            vcc.sweep(CAMERA, FIELD, VALUES, output=path)
    finally:
        holder.communicate(b"")


def test_patterns_as_things_are_told_apart(tmp_path):
    values = {"code.pattern": [Circle(8 * mm), Circle(6 * mm)]}
    vcc.sweep(CAMERA, FIELD, values, output=tmp_path / "sweep.zarr")
    with pytest.raises(vcc.InputError, match="another sweep"):
        vcc.sweep(
            CAMERA, FIELD, {"code.pattern": [Circle(8 * mm), Circle(5 * mm)]}, output=tmp_path / "sweep.zarr"
        )


def _damaged(data, rnd):
    """Bits turned, the end cut off, nothing left, or a number of JSON that is another."""
    numbers = list(re.finditer(rb"\d+", data)) if data.startswith(b"{") else []
    how = rnd.choice(["bits", "cut", "empty", *["number"] * 2 * bool(numbers)])
    if how == "bits":
        turned = bytearray(data)
        for _ in range(rnd.choice([1, 4])):
            turned[rnd.randrange(len(turned))] ^= 1 << rnd.randrange(8)
        return bytes(turned)
    if how == "number":
        found = rnd.choice(numbers)
        other = rnd.choice([b"0", b"-1", b"100000000000", b"null", b'"a"'])
        return data[: found.start()] + other + data[found.end() :]
    return data[: rnd.randrange(len(data))] if how == "cut" else b""


def test_damaged_sweeps_are_refused_or_read(tmp_path):
    """No error of a library comes out, whatever is damaged; what is refused is named."""
    whole, damaged, rnd, refused = tmp_path / "sweep.zarr", tmp_path / "damaged.zarr", random.Random(1), []
    vcc.sweep(CAMERA, FIELD, {"sensor.z": "51mm:53mm:3"}, metrics=["sharpness"], output=whole)
    files = sorted(path.relative_to(whole) for path in whole.rglob("*") if path.is_file())
    for _ in range(100):
        shutil.rmtree(damaged, ignore_errors=True)
        shutil.copytree(whole, damaged)
        file = damaged / rnd.choice(files)
        file.write_bytes(_damaged(file.read_bytes(), rnd))
        try:
            swept = open_sweep(damaged)
            for n in range(3):
                if swept.done[n]:
                    assert swept[n].values.shape == (12, 16, 3)
        except vcc.InputError as error:
            refused.append(str(error))
    assert len(refused) > 50
    assert all("damaged.zarr" in said for said in refused)


@pytest.mark.parametrize("name", ["done", "pictures"])
def test_a_chunk_larger_than_it_can_be_is_not_read(tmp_path, name):
    vcc.sweep(CAMERA, FIELD, {"sensor.z": "51mm:53mm:3"}, output=tmp_path / "sweep.zarr")
    with (tmp_path / "large").open("wb") as large:
        large.truncate(1_300_000_000)
    chunk = next(path for path in sorted((tmp_path / "sweep.zarr" / name / "c").rglob("0")) if path.is_file())
    chunk.unlink()
    chunk.symlink_to(tmp_path / "large")
    with pytest.raises(vcc.InputError, match="1,300,000,000 bytes"):
        np.asarray(open_sweep(tmp_path / "sweep.zarr").pictures)
    chunk.unlink()
    os.mkfifo(chunk)
    with pytest.raises(vcc.InputError, match="named pipe"):
        np.asarray(open_sweep(tmp_path / "sweep.zarr").pictures)


def test_a_picture_whose_file_is_missing_is_refused(tmp_path):
    """Zarr would give NaN for it."""
    vcc.sweep(CAMERA, FIELD, {"sensor.z": "51mm:53mm:3"}, output=tmp_path / "sweep.zarr")
    (tmp_path / "sweep.zarr" / "pictures" / "c" / "1" / "0" / "0" / "0").unlink()
    swept = open_sweep(tmp_path / "sweep.zarr")
    assert np.isfinite(swept[0].values).all()
    with pytest.raises(vcc.InputError, match="missing"):
        swept[1]
