"""Every page is a script: its Python, camera files and commands run in the order in which they stand, as written.

What a page takes for given, a reader's own light field, camera and files, is made small beside it. Renderers are
stood in for: their command lines are read, and a quick pattern is rendered in place of their scenes. Pages of
notebooks hold what notebooks hold, which `tests/test_notebooks.py` runs.
"""

import contextlib
import json
import re
import shlex
import shutil
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import imagecodecs
import numpy as np
import OpenEXR
import pytest
import scipy.io
import tifffile
import torch

import vcc
from tests.command_line import CAMERA, run
from vcc.camera_file import ELEMENT_KINDS
from vcc.cli.synth.rendering import ViewsAndPixels
from vcc.engines import array_api
from vcc.gallery.entry import Entry, Result
from vcc.motion import load_moving_camera
from vcc.sources import CameraArray
from vcc.zoo import run as run_zoo
from vcc.zoo import scenes
from vcc.zoo.running import _entrants
from vcc.zoo.torch_design import ARMS, Outcome

ROOT = Path(__file__).parents[1]
NOTEBOOKS = ROOT / "docs" / "notebooks"
PAGES = [ROOT / "README.md", *sorted(set((ROOT / "docs").rglob("*.md")) - set(NOTEBOOKS.glob("*.md")))]
NOT_RUN = {
    "pip": "the test command has installed the package",
    "pytest": "this is run by it",
    "mkdocs": "the site is built beside the tests",
    "blender": "a program of the reader's",
}
"""What commands of other programs begin with, and why they are not run here."""
LANGUAGES = ("python", "toml", "sh")
BLOCK = re.compile(r"^```(\S*)[^\n]*\n(.*?)^```", re.M | re.S)


def name_of(page):
    return str(page.relative_to(ROOT))


def steps(page):
    """What a page has to be run: (language, text, the prose before it)."""
    text, end = page.read_text(encoding="utf-8"), 0
    for found in BLOCK.finditer(text):
        language, block = found[1], found[2]
        if language in LANGUAGES:
            yield language, block, text[end : found.start()]
        end = found.end()


RUN = [page for page in PAGES if any(True for _ in steps(page))]


class StandIn:
    """A renderer of another program's scenes that renders a scene of ours."""

    distances = (0.8, 3.0)

    def __init__(self, *arguments, **options):
        pass

    @classmethod
    def fitted(cls, *arguments, **options):
        return cls()

    def description(self):
        return {"renderer": "stand-in"}

    def render(self, camera):
        rows, columns = camera.pixels
        v, u = np.mgrid[:rows, :columns]
        grey = 0.5 + 0.4 * np.sin(u / 3) * np.sin(v / 4)
        return np.repeat(grey[..., None], 3, axis=2).astype(np.float32)


# --- what pages take for given ---

LENS = """# a doublet with a stop: radius, thickness, index, diameter in mm
40 6 1.5168 20
-35 2 1.62 20
-120 5 1 20
0 10 1 12
60 4 1.5168 16
-90 40 1 16
"""
PIXELS = (72, 96)


class Trials:
    """A stand-in for Optuna, which tries one number."""

    samplers = SimpleNamespace(TPESampler=lambda seed: None)

    @staticmethod
    def create_study(direction, sampler):
        trial = SimpleNamespace(suggest_float=lambda name, low, high: (low + high) / 2)
        return SimpleNamespace(optimize=lambda objective, n_trials: objective(trial))


def write_views(folder, shape=(5, 5)):
    """A texture in front of another, of parallax ½ and 2 pixels a view, as PNGs named by row and column."""
    folder.mkdir()
    random = np.random.default_rng(1)
    far, near = (random.random((PIXELS[0] // 4 + 8, PIXELS[1] // 4 + 8, 3)) for _ in range(2))
    far, near = (np.kron(smooth, np.ones((4, 4, 1))) for smooth in (far, near))
    for row, column in np.ndindex(*shape):
        view = far[8 - row // 2 :, 8 - column // 2 :][: PIXELS[0], : PIXELS[1]].copy()
        top, left = 24 - 2 * (row - 2), 30 - 2 * (column - 2)
        view[top : top + 28, left : left + 36] = near[:28, :36]
        codes = np.rint(255 * (0.1 + 0.8 * view)).astype(np.uint8)
        (folder / f"view_{row}_{column}.png").write_bytes(imagecodecs.png_encode(codes))


def micro_images(pixels, pitch):
    """What is recorded through lenslets, of something and of white; and the centres (column, row) of the discs.

    Args:
        pixels: of the recording, each way.
        pitch: pixels from one disc to the next.
    """
    places = np.arange(pixels) / pitch - 0.5
    nearest = np.clip(np.rint(places), 0, pixels // pitch - 1).astype(int)
    off = (places - nearest) * pitch
    disc = np.hypot(off[:, None], off) < 0.45 * pitch
    each = 0.3 + 0.6 * np.random.default_rng(5).random((nearest.max() + 1,) * 2)
    middles = (np.arange(nearest.max() + 1) + 0.5) * pitch
    return (
        each[np.ix_(nearest, nearest)] * disc,
        0.9 * disc,
        np.stack(np.meshgrid(middles, middles), -1).reshape(-1, 2),
    )


def png(path, values, full=255):
    kind = np.uint8 if full == 255 else np.uint16
    Path(path).write_bytes(imagecodecs.png_encode(np.rint(full * values).astype(kind)))


def exr(path, values):
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, {"Y": values}) as file:
        file.write(path)


@pytest.fixture(scope="session")
def given(tmp_path_factory):
    """A folder with the files that the pages name."""
    folder = tmp_path_factory.mktemp("given")
    with contextlib.chdir(folder):
        write_given()
    return folder


@pytest.fixture
def folder(given, tmp_path, monkeypatch):
    """A folder of a page's own."""
    shutil.copytree(given, tmp_path, dirs_exist_ok=True)
    (tmp_path / "docs").symlink_to(ROOT / "docs")  # of the repository, with the light field that it keeps
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write_given():
    write_views(Path("my_views"))
    shutil.copytree("my_views", "views")
    for number in (1, 2):
        shutil.copytree("my_views", f"take/frame_000{number}")
    Path("dgauss.50mm.dat").write_text(LENS)
    places = np.linspace(-1, 1, 16) * 5e-3
    np.save("cap.npy", -(places[:, None] ** 2 + places**2) / 0.1)
    np.savetxt("wavefront.csv", 1e-6 * np.outer(places, places), delimiter=",")
    np.save("slopes.npy", np.zeros((3, 3, 2)))
    np.save("widths.npy", np.full((4, 4), 0.01))
    np.save("code.npy", np.eye(4))
    write_photographs(Path("my_photographs"))
    write_views(Path("cotton"))
    for row, column in [(0, 1), (1, 0), (3, 4)]:
        Path(f"cotton/view_{row}_{column}.png").unlink()
    Path("my.py").write_text("def decode(recorded):\n    return recorded.values\n")
    for name in ("camera.toml", "other.toml"):
        Path(name).write_text(CAMERA)
    pose = {
        "img_name": "front",
        "width": 480,
        "fx": 963,
        "position": [0, 0, 0],
        "rotation": np.diag([1, -1, -1]).tolist(),
    }
    Path("cameras.json").write_text(json.dumps([pose]))
    write_depths()
    write_raw()


def write_photographs(folder):
    """A row of photographs with poses."""
    (folder / "images").mkdir(parents=True)
    y, x = np.mgrid[:40, :60]
    frames = []
    for n in range(4):
        wave = 0.5 + 0.2 * np.sin((x + 2 * n) / 2.5) + 0.2 * np.cos(y / 3 + (x + 2 * n) / 7)
        png(folder / "images" / f"{n}.png", np.stack([wave, wave, wave], axis=-1))
        matrix = [[1, 0, 0, n / 2], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
        frames.append({"file_path": f"images/{n}.png", "transform_matrix": matrix})
    said = {"fl_x": 80, "w": 60, "h": 40, "frames": frames}
    (folder / "transforms.json").write_text(json.dumps(said))


def write_depths():
    """Pictures and what is known of their depth."""
    random = np.random.default_rng(4)
    for name in ("room", "picture", "kinect", "view"):
        png(f"{name}.png", np.kron(random.random((6, 8, 3)), np.ones((4, 4, 1))))
    metres = np.where(np.arange(32) < 16, 1.0, 2.5) * np.ones((24, 1))
    for name in ("room-depth", "depth"):
        exr(f"{name}.exr", metres.astype(np.float32))
    png("kinect-depth.png", metres * 1000 / 65535, full=65535)
    disparities = np.where(np.arange(32) < 16, 1.5, 0.5) * np.ones((24, 1))
    Path("disparity.pfm").write_bytes(b"Pf\n32 24\n-1\n" + disparities[::-1].astype("<f4").tobytes())


def write_raw():
    """What plenoptic cameras record, what they record of white, and where their micro-images are."""
    raw, white, centres = micro_images(216, 9)
    png("raw.png", raw)
    png("white.png", white)
    for name, values in (("real", raw), ("white", white), ("dark", np.zeros_like(white))):
        tifffile.imwrite(f"{name}.tif", np.rint(60000 * values).astype(np.uint16), photometric="minisblack")
    np.savetxt("centres.csv", centres, delimiter=",")
    Path("IMG_3.jpg").write_bytes(imagecodecs.jpeg8_encode(np.rint(10 + 230 * raw).astype(np.uint8), level=98))
    scipy.io.savemat("image_cords.mat", {"centres": centres[:, ::-1] + 1})
    raw, white, _ = micro_images(436, 100 / 6.5)
    for name, values in (("Lightfield", raw), ("Radiometry", white), ("DarkFrame", np.zeros_like(raw))):
        codes = np.rint(1000 + 50000 * values).astype(np.uint16)
        tifffile.imwrite(f"{name}_GUVExperim1.tif", codes, photometric="minisblack")


@pytest.fixture
def names(folder):
    """What the pages' Python takes for given."""
    light_field = vcc.LightField.from_views(
        np.random.default_rng(2).random((3, 3, 24, 28, 3), np.float32), spacing=2e-3, slope_per_pixel=0.01
    )
    counts = np.ones((3, 5))
    kinds = dict(ELEMENT_KINDS)
    yield {
        "light_field": light_field,
        "counts": counts,
        "shares": counts / counts.sum(),
        "sigma_map": np.full((4, 4), 0.01),
    }
    ELEMENT_KINDS.clear()  # a page may have added its own
    ELEMENT_KINDS.update(kinds)


def designed(output, plan, progress):
    """What `vcc zoo design` reports; tests/zoo has it."""
    return [Outcome(arm, seed, plan.share, (20.0, 20.0, 20.0), 1.0) for arm in ARMS for seed in range(plan.seeds)]


def few_results(task, output, **given):
    """What `vcc zoo run` does, for one scene of few views, the open square and the reader's camera and decoder."""
    chosen = vcc.zoo.TASKS[task]
    names = {each.name for each in _entrants(chosen, ())} - {"open"}
    fewer = {"scenes": ("leaves-1",), "seeds": 1, "without": (*names, *set(chosen.decoders) - {"as recorded"})}
    return run_zoo(task, output, **{**given, **fewer, "executor": None})


@pytest.fixture
def quick(monkeypatch):
    """Stand-ins for renderers of other programs and for the gallery's minutes of work."""
    for module, renderer in (
        ("demo", "MitsubaRenderer"),
        ("mitsuba", "MitsubaRenderer"),
        ("opengl", "OpenGLRenderer"),
        ("pbrt", "PbrtRenderer"),
    ):
        monkeypatch.setattr(f"vcc.cli.synth.{module}.{renderer}", StandIn)
    for place in ("vcc.sources", "vcc.sources.opengl"):
        monkeypatch.setattr(f"{place}.OpenGLRenderer", StandIn)
    smaller = CameraArray(views=(3, 3), pixels=(20, 24), spacing=1e-3, slope_per_pixel=0.02, focus_distance=1.3)
    monkeypatch.setattr(ViewsAndPixels, "cameras", lambda *_, **__: smaller)
    monkeypatch.setattr(Entry, "run", lambda *_: Result("", (), ()))
    monkeypatch.setattr(scenes, "VIEWS", 3)
    scenes.scene.cache_clear()
    monkeypatch.setattr("vcc.cli.zoo.run.run_zoo", few_results)
    monkeypatch.setattr("vcc.zoo.torch_design.designed", designed)
    # Processes and clusters take seconds to begin, and tests/run has them.
    for executor in ("concurrent.futures.ProcessPoolExecutor", "distributed.Client"):
        monkeypatch.setattr(executor, lambda *_, **__: ThreadPoolExecutor(1))
    monkeypatch.setattr("vcc.cli.executing._processes", lambda: ThreadPoolExecutor(1))
    loader = torch.utils.data.DataLoader  # its workers are forked, which JAX of another page does not allow
    monkeypatch.setattr(
        "torch.utils.data.DataLoader", lambda *data, **how: loader(*data, **{**how, "num_workers": 0})
    )
    monkeypatch.setitem(sys.modules, "optuna", Trials)
    # What a GPU does is tested in a simulator, at a few samples: here any array's engine stands in for its own.
    monkeypatch.setitem(sys.modules, "vcc.engines.cuda", array_api)
    monkeypatch.setattr(vcc.LightField, "on_gpu", lambda self: self)
    monkeypatch.setattr(torch.Tensor, "cuda", lambda self: self)
    yield
    scenes.scene.cache_clear()


# --- the run ---


def file_named(prose):
    """The camera file that a page's words before its block speak of."""
    named = re.findall(r"`(\w[\w.-]*\.toml)`", prose)
    return named[-1] if named else "camera.toml"


def run_commands(text, place):
    for line in text.replace("\\\n", " ").splitlines():
        for command in line.split("&&"):
            words = shlex.split(command, comments=True)
            if words and words[0] == "vcc" and words[1:] != ["demo"]:  # tests/demo has what that does
                done = run(*words[1:])
                assert done.exit_code == 0, f"{place}: {command.strip()}\n{done.output}"
            else:
                assert not words or words[0] in {"vcc", *NOT_RUN}, f"{place}: {command}"


A_SENSOR = '[sensor]\nz = "150 mm"\nshape = [8, 8]\npitch = "1 mm"\n'
HOLDERS = {"surface": "phase_plate", "kernel": "diffuser", "pattern": "mask"}
"""What kind of element has each of the fields that a page may list alternatives of, a line each."""


def camera_files(text):
    """The camera files of a block; fragments with what they lack."""
    field = text.split(" = ")[0]
    if field in HOLDERS:
        width = 'width = "30 mm"\n' if field == "pattern" else ""
        lines = [f'[[elements]]\nkind = "{HOLDERS[field]}"\n{width}{line}\n' for line in text.splitlines()]
    else:
        lines = [text]
    for file in lines:
        if "[sensor]" in file:
            yield file
        else:
            yield A_SENSOR + file if file.startswith("[sensor.") else file + A_SENSOR


def load(text):
    """A camera file is read, and as it was when it is written and read again."""
    for file in camera_files(text):
        Path("shown.toml").write_text(file, encoding="utf-8")
        camera = load_moving_camera("shown.toml")
        camera.save("again.toml")
        again = load_moving_camera("again.toml")
        assert (again.camera, again.courses, again.shutter) == (camera.camera, camera.courses, camera.shutter)
        if "[moving]" not in file:
            assert vcc.load_camera("again.toml") == vcc.load_camera("shown.toml")


@pytest.mark.parametrize("page", RUN, ids=name_of)
def test_runs_from_top_to_bottom(page, names, quick):
    with warnings.catch_warnings():
        # The light fields are far smaller than those that the pages speak of.
        warnings.simplefilter("ignore", vcc.ResultWarning)
        for language, text, prose in steps(page):
            if language == "python":
                exec(compile(text, name_of(page), "exec"), names)
            elif language == "sh":
                run_commands(text, name_of(page))
            elif text.startswith("views = "):
                Path("views.toml").write_text(text, encoding="utf-8")
            else:
                load(text)
                if "[sensor]" in text:
                    shutil.copy("shown.toml", file_named(prose))


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_nothing_that_could_be_run_is_shown_as_text(page):
    for found in BLOCK.finditer(page.read_text(encoding="utf-8")):
        if found[1] not in LANGUAGES:
            assert not re.search(r"^(vcc |import |from [\w.]+ import |\w+ = )", found[2], re.M), found[2]
