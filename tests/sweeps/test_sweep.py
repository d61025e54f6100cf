"""Sweeps in memory: what they go through, and that each picture is the one that its camera makes by itself.

The oracle is `Camera.capture` of cameras written down as a user writes them.
"""

from __future__ import annotations

import csv
import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import vcc
from tests.sweeps.rounding import gain
from vcc.patterns import Circle, mura
from vcc.sweeps import PSNR, DeblurringError, listed, random, sharpness, sobol, sweeping
from vcc.units import mm

SENSOR = vcc.Sensor(z=52 * mm, shape=(20, 24), pitch=0.4 * mm)
CELLS = np.random.default_rng(5).random((5, 5))


def camera(cells=CELLS, z=52 * mm, at=0.0, focal_length=50 * mm):
    mask = vcc.Mask(cells, width=8 * mm, z=at, name="code")
    return vcc.Camera([vcc.Lens(focal_length, name="main"), mask], vcc.Sensor(z, SENSOR.shape, SENSOR.pitch))


@pytest.fixture(scope="module")
def field():
    values = np.random.default_rng(2).random((5, 5, 24, 26, 3), dtype=np.float32)
    return vcc.LightField.from_views(values, spacing=2.4 * mm, slope_per_pixel=0.01)


def same_picture(image, other, plan=None):
    """Sums of the same samples in single precision, in another order; a plan may sharpen what is rounded."""
    assert image.shape == other.shape
    least = 1e-6 * max(1.0 if plan is None else gain(plan), 1.0)
    np.testing.assert_allclose(image.values, other.values, atol=least * float(other.values.max()))
    assert (image.frame, image.missing_rays, image.camera) == (other.frame, other.missing_rays, other.camera)


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
@pytest.mark.parametrize("at", [0.0, 30 * mm])
def test_a_grid_holds_what_each_camera_makes_by_itself(field, at):
    codes = [CELLS, mura(5), 1 - CELLS, CELLS[::-1]]
    places = [51 * mm, 53 * mm]
    swept = vcc.sweep(camera(at=at), field, {"code.pattern": codes, "sensor.z": places}, metrics=["sharpness"])
    assert (swept.axes, swept.shape) == (("code.pattern", "sensor.z"), (4, 2))
    assert swept.pictures.shape == (4, 2, 20, 24, 3)
    for m, code in enumerate(codes):
        for n, z in enumerate(places):
            alone = camera(code, z, at).capture(field)
            same_picture(swept[m, n], alone, camera(code, z, at).compile(field))
            assert swept.numbers["sharpness"][m, n] == pytest.approx(sharpness(alone), rel=1e-4)
            assert swept.numbers["mean"][m, n] == pytest.approx(alone.values.mean(), rel=1e-5)
    table = swept.table
    assert table["sensor.z"].tolist() == places * 4
    assert table["code.pattern"].tolist() == ["0", "0", "1", "1", "2", "2", "3", "3"]
    assert swept.best("mean") == np.unravel_index(table["mean"].argmax(), (4, 2))


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
def test_rays_and_stored_light_fields_are_swept_too(field, tmp_path):
    values = {"sensor.z": ["51 mm", "53 mm"], "code.pattern": [CELLS, 1 - CELLS]}
    stored = vcc.store.save_store(field, tmp_path / "field.zarr")
    swept = vcc.sweep(camera(at=30 * mm), stored, values, memory_limit=10**7)
    by_rays = vcc.sweep(camera(), field, values, method="rays", samples=4)
    alone = camera(z=53 * mm, at=30 * mm)
    same_picture(swept[1, 0], alone.capture(stored, memory_limit=10**7), alone.compile(field))
    same_picture(by_rays[0, 1], camera(1 - CELLS, z=51 * mm).capture(field, method="rays", samples=4))
    assert by_rays.numbers["sampling_error"].min() > 0


def test_words_are_those_of_camera_files(field):
    values = {"code.pattern": "mura, circle, { name = 'circle', diameter = '4 mm' }", "sensor.z": "52mm:54mm:3"}
    swept = vcc.sweep(camera(), field, values)
    assert swept[0, 0].camera == camera(mura(5))
    assert swept[1, 2].camera.elements[1].pattern == Circle(8 * mm)
    assert swept[2, 0].camera.elements[1].pattern == Circle(4 * mm)
    np.testing.assert_allclose(swept.table["sensor.z"][:3], [52 * mm, 53 * mm, 54 * mm], rtol=1e-12)
    assert swept.table["code.pattern"][-1] == "circle (diameter 4 mm)"


def test_a_list_takes_the_first_of_all_then_the_second(field):
    swept = vcc.sweep(camera(), field, listed({"sensor.z": "52mm, 53mm", "main.focal_length": [50 * mm, 51 * mm]}))
    assert (swept.axes, swept.shape, swept.table["sensor.z"].tolist()) == (("camera",), (2,), [52 * mm, 53 * mm])
    same_picture(swept[1], camera(z=53 * mm, focal_length=51 * mm).capture(field))
    with pytest.raises(vcc.InputError, match=r"equally many values of each.*sensor.z 2, main.z 1"):
        vcc.sweep(camera(), field, listed({"sensor.z": "52mm, 53mm", "main.z": [0.0]}))


def test_cameras_are_swept_one_by_one(field):
    one, other = camera(), vcc.Camera([vcc.Lens(50 * mm, diameter=6 * mm)], SENSOR)
    swept = vcc.sweep([one, other], field, {"sensor.z": "52mm, 53mm"})
    assert (swept.axes, swept.shape) == (("camera", "sensor.z"), (2, 2))
    same_picture(swept[1, 0], other.capture(field))
    same_picture(vcc.sweep(one, field)[0], one.capture(field))


@pytest.mark.parametrize("design", [random, sobol])
def test_what_is_drawn_lies_within_and_comes_again(design):
    drawn = design({"sensor.z": "52mm:54mm", "main.focal_length": (49 * mm, 51 * mm)}, 32, seed=4)
    z, focal = (np.array(each.values) for each in drawn.of(camera()))
    assert z.min() >= 52 * mm
    assert z.max() <= 54 * mm
    again = design(drawn.parameters, 32, seed=4).of(camera())[1]
    other = design(drawn.parameters, 32, seed=5).of(camera())[1]
    assert tuple(focal) == again.values != other.values
    if design is sobol:  # a net in base 2: one point in each of 32 slices, whichever way they are cut
        for down in range(6):
            cells = (
                np.floor((z - 52 * mm) / (2 * mm) * 2**down),
                np.floor((focal - 49 * mm) / (2 * mm) * 32 / 2**down),
            )
            assert len(set(zip(*cells, strict=True))) == 32


def test_whole_numbers_and_choices_are_drawn():
    hexagon = vcc.Mask(vcc.patterns.Polygon(6, 4 * mm), width=8 * mm, name="stop")
    sides, kinds = random({"stop.pattern.sides": (3, 5), "sensor.fill_factor": [0.5, 1.0]}, 64).of(
        vcc.Camera([vcc.Lens(50 * mm), hexagon], SENSOR)
    )
    assert (set(sides.values), set(kinds.values)) == ({3, 4, 5}, {0.5, 1.0})
    assert all(type(each) is int for each in sides.values)


def test_the_table_is_written_and_read(field, tmp_path):
    swept = vcc.sweep(camera(), field, {"sensor.z": "52mm:54mm:3", "code.pattern": "mura, circle"})
    swept.table.save(tmp_path / "table.csv")
    with (tmp_path / "table.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["code.pattern"] for row in rows] == ["mura", "circle"] * 3
    assert [float(row["sensor.z [m]"]) for row in rows] == swept.table["sensor.z"].tolist()
    assert [float(row["mean"]) for row in rows] == swept.table["mean"].tolist()
    lines = repr(swept.table).splitlines()
    assert lines[0].split() == ["sensor.z", "[m]", "code.pattern", "mean", "missing_rays", "sampling_error"]
    assert lines[3].split()[:2] == ["0.053", "mura"]
    assert len(lines) == 7
    arro3 = pytest.importorskip("arro3.io")
    swept.table.save(tmp_path / "table.parquet")
    read = arro3.read_parquet(tmp_path / "table.parquet").read_all()
    assert read.column("mean").to_pylist() == swept.table["mean"].tolist()
    assert read.column("code.pattern").to_pylist() == ["mura", "circle"] * 3


def test_metrics_are_functions_of_the_picture(field):
    truth = camera().capture(field)
    metrics = {"psnr": PSNR(truth), "brightest": lambda image: image.values.max(), "R": DeblurringError(2.0)}
    swept = vcc.sweep(camera(), field, {"sensor.z": [52 * mm, 53 * mm]}, metrics=metrics)
    other = swept.pictures[1].astype(float)
    decibels = 10 * math.log10(float(truth.values.max()) ** 2 / ((other - truth.values) ** 2).mean())
    assert swept.table["psnr"][1] == pytest.approx(decibels, rel=1e-6)
    assert swept.table["psnr"][0] > 100  # the same picture, to rounding
    assert swept.table["brightest"][1] == swept.pictures[1].max()
    kernel = vcc.analysis.psf(camera(), 2.0).values
    power = vcc.analysis.natural_image_power((128, 128))
    error = vcc.analysis.expected_deblurring_error(kernel, 0.01, power) / 128**2
    assert swept.table["R"][0] == pytest.approx(error, rel=1e-12)
    upright = swept[0].upright()
    assert PSNR(upright)(swept[0]) == PSNR(swept[0])(swept[0])


def test_sharpness_is_the_relative_energy_of_the_gradient():
    values = np.array([[1.0, 2.0, 1.0], [3.0, 2.0, 1.0], [0.0, 0.0, 0.0]])
    by_hand = sum(
        (values[r + 1, c] - values[r, c]) ** 2 + (values[r, c + 1] - values[r, c]) ** 2
        for r in range(2)
        for c in range(2)
    )
    image = vcc.Image(values, SENSOR.frame)
    assert sharpness(image) == pytest.approx(by_hand / 4 / values.mean() ** 2)
    assert sharpness(vcc.Image(7 * values, SENSOR.frame)) == pytest.approx(sharpness(image))


def test_a_table_alone_takes_pictures_of_any_shape(field):
    values = {"sensor.shape": [(20, 24), (10, 12)]}
    swept = vcc.sweep(camera(), field, values, pictures=False)
    assert swept.table["sensor.shape"].tolist() == ["(20, 24)", "(10, 12)"]
    with pytest.raises(vcc.InputError, match="kept no pictures"):
        swept[0]
    with pytest.raises(vcc.InputError, match=r"one shape, and there are \(20, 24\).*pictures=False"):
        vcc.sweep(camera(), field, values)


def test_remarks_are_made_once_for_each_kind(field):
    stopped = vcc.Camera([vcc.Lens(50 * mm, diameter=20 * mm, name="main")], SENSOR)
    with pytest.warns(vcc.ResultWarning, match=r"3 of 3 cameras, one of them: .*% of the rays") as caught:
        vcc.sweep(stopped, field, {"main.diameter": "18mm:20mm:3"})
    assert len(caught) == 1
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (
            {"sensr.z": [1]},
            r"no parameter 'sensr.z'; did you mean sensor.z.*this camera has main.z, .*code.pattern,",
        ),
        ({"sensor.x": [1]}, r"no parameter 'sensor.x'.* the sensor has sensor.z, sensor.shape, sensor.pitch"),
        ({"sensor.z": "50mm:54mm"}, "does not say how many values there are"),
        ({"sensor.z": "50mm:54mm:0"}, r"how many values .* has is a whole number"),
        ({"sensor.z": "50"}, "sensor.z is 50: a length needs a unit"),
        ({"sensor.z": []}, "sensor.z has no values"),
        ({"sensor.z": 0.5}, r"the values of sensor.z are a list.*write \[0.5\]"),
        ({"main.z": "1mm, 60mm"}, r"main.z 60 mm: .*stands behind the sensor"),
        (
            {"code.pattern": "hexagon"},
            r'"hexagon", which is no file in .*no pattern by name: there are mura, open,',
        ),
        ({"code": [1]}, "no parameter 'code'"),
        ([1], "names and values"),
    ],
)
def test_what_cannot_be_swept_is_named_before_the_work(values, said):
    views = np.ones((2, 2, 4, 4), np.float32)
    unread = vcc.LightField.from_views(views, spacing=1 * mm, slope_per_pixel=0.01)
    with pytest.raises(vcc.InputError, match=said):
        vcc.sweep(camera(), unread, values)


def test_a_part_and_the_whole_cannot_both_change(field):
    open_mask = vcc.Camera([vcc.Lens(50 * mm), vcc.Mask(Circle(4 * mm), width=8 * mm, name="stop")], SENSOR)
    values = {"stop.pattern": "circle", "stop.pattern.diameter": "4mm, 5mm"}
    with pytest.raises(vcc.InputError, match=r"stop.pattern.diameter is a part of stop.pattern"):
        vcc.sweep(open_mask, field, values)


@pytest.mark.parametrize(
    ("metrics", "said"),
    [
        (["sharpnes"], "no metric 'sharpnes': there is sharpness"),
        ([lambda image: 1], "a lambda has no name"),
        ({"mean": sharpness}, "two columns of a table cannot both be 'mean'"),
        ({"sensor.z": sharpness}, "two columns of a table cannot both be 'sensor.z'"),
        ({"pair": lambda image: (1, 2)}, r"sensor.z 52 mm: the metric pair gives \(1, 2\)"),
        ({"psnr": PSNR(np.ones((2, 2)))}, r"target has the shape \(2, 2\), and the picture \(20, 24, 3\)"),
        ("sharpness", r"write \['sharpness'\]"),
    ],
)
def test_what_is_no_metric_is_named(field, metrics, said):
    with pytest.raises(vcc.InputError, match=said):
        vcc.sweep(camera(), field, {"sensor.z": [52 * mm]}, metrics=metrics)


def test_progress_is_told_and_memory_asked_for(field):
    told = []
    vcc.sweep(
        camera(), field, {"sensor.z": "52mm:53mm:3"}, progress=lambda done, total: told.append((done, total))
    )
    assert told == [(1, 3), (2, 3), (3, 3)]
    large = vcc.Camera([vcc.Lens(50 * mm)], vcc.Sensor(52 * mm, (4000, 4000), 2e-6))
    with pytest.raises(vcc.InputError, match=r"50 pictures of 4000×4000×3 needs .*pictures=False"):
        vcc.sweep(large, field, {"sensor.z": "52mm:53mm:50"})


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
@pytest.mark.parametrize("interpolation", ["sharp", "linear"])
def test_more_masks_at_the_views_than_views_are_made_of_their_pictures(field, interpolation):
    codes = [np.random.default_rng(n).random((5, 5)) for n in range(30)]  # of 25 views
    codes[7][:, :2] = 0
    swept = vcc.sweep(camera(), field, {"code.pattern": codes}, interpolation=interpolation)
    for n in (0, 7, 29):
        # In double precision: sharpening makes more of the rounding of single precision, 1.6e-6 in `capture`.
        same_picture(swept[n], camera(codes[n]).capture(field, interpolation=interpolation, engine="reference"))


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
def test_a_light_field_on_disk_is_read_once_for_sixteen_cameras(field, tmp_path, monkeypatch):
    stored, read = vcc.store.save_store(field, tmp_path / "field.zarr"), []
    reading = vcc.store.StoredLightField.read
    monkeypatch.setattr(vcc.store.StoredLightField, "read", lambda *given: read.append(given) or reading(*given))
    monkeypatch.setattr(sweeping, "BATCH_SAMPLES", 1)  # larger than can be gone through in some seconds
    vcc.sweep(camera(), stored, {"sensor.z": "51mm:53mm:17"})
    assert len(read) == 2 * 25


@pytest.mark.filterwarnings("ignore::vcc.ResultWarning")
def test_executors_make_the_same_pictures(field, tmp_path):
    values = {"sensor.z": "51mm:53mm:3", "code.pattern": "mura, circle"}
    alone = vcc.sweep(camera(), field, values, metrics=["sharpness"])
    stored = vcc.store.save_store(field, tmp_path / "field.zarr")
    with ThreadPoolExecutor(2) as pool:
        kept = {"metrics": ["sharpness"], "output": tmp_path / "a.zarr"}
        swept = vcc.sweep(camera(), stored, values, executor=pool, **kept)
        np.testing.assert_allclose(swept.pictures, alone.pictures, atol=1e-6 * float(alone.pictures.max()))
        np.testing.assert_allclose(swept.table["sharpness"], alone.table["sharpness"], rtol=1e-4)
        piece = field[1:, :-1]  # in memory, and sent; of disparities measured in the whole
        sent = vcc.sweep(camera(), piece, values, executor=pool)
        here = vcc.sweep(camera(), piece, values)
        np.testing.assert_allclose(sent.pictures, here.pictures, atol=1e-6 * float(alone.pictures.max()))
        large = vcc.LightField.of(np.broadcast_to(np.float32(0), (5, 5, 900, 1000, 1)), field.grid)
        with pytest.raises(vcc.InputError, match=r"takes 90 MB of memory.* at most 67 MB are sent\. Save it with"):
            vcc.sweep(camera(), large, values, executor=pool)
