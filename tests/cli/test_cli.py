"""The command line: what it writes and says, its exit codes, and that asking for help is quick."""

import dataclasses
import shutil
import subprocess
import sys
import warnings

import imagecodecs
import numpy as np
import pytest

import vcc
from tests.command_line import CAMERA, KNOWN, refused, run, write_views
from vcc.cli.app import COMMANDS, RENDERERS
from vcc.cli.console import _Estimate, as_options
from vcc.plan.how import How


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to work in, with a camera file and a light field of 3 × 3 views."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "camera.toml").write_text(CAMERA)
    write_views(tmp_path / "views")
    return tmp_path


def test_capture_writes_a_picture_and_says_how(folder):
    result = run("capture", "camera.toml", "views", "-o", "picture.png", *KNOWN)
    assert result.exit_code == 0, result.output
    assert "picture.png: 16×12 pixels" in result.stdout
    assert "exposure" in result.stdout
    assert "Note: 28.9% of the rays" in result.stderr  # a circle of 4 mm, 3 × 3 views of 1 mm
    assert imagecodecs.png_decode((folder / "picture.png").read_bytes()).shape == (12, 16, 3)


def test_capture_gives_what_the_library_gives(folder):
    run("capture", "camera.toml", "views", "-o", "upright.npy", "--engine", "reference", *KNOWN)
    run("capture", "camera.toml", "views", "-o", "lying.npy", "--as-recorded", *KNOWN)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)
        geometry = {"spacing": 1e-3, "slope_per_pixel": 0.02, "focus_distance": 1.3}
        light_field = vcc.open_light_field("views", **geometry)
        image = vcc.load_camera("camera.toml").capture(light_field)
    lying = np.load("lying.npy")
    assert np.array_equal(lying, image.values)
    assert np.allclose(np.load("upright.npy"), lying[::-1, ::-1], rtol=1e-4, atol=1e-9)


def test_photodiodes_are_written_next_to_the_output(folder):
    (folder / "dual.toml").write_text(CAMERA + "photodiodes = [1, 2]\n[sensor.electronics]\n")
    for command, output in (("capture", "image.npy"), ("expose", "raw.npy")):
        result = run(command, "dual.toml", "views", "-o", output, *KNOWN)
        assert result.exit_code == 0, result.output
        stem = output.removesuffix(".npy")
        parts = [np.load(f"{stem}_0_{column}.npy").astype(float) for column in (0, 1)]
        assert np.allclose(sum(parts), np.load(output), rtol=1e-5)
        assert not np.allclose(*parts, rtol=1e-2)


def test_capture_takes_all_options(folder):
    result = run(
        *("capture", "camera.toml", "views", "-o", "picture.tif", "--interpolation", "cubic"),
        *("--between-views", "none", "--scene-distance", "1 m", "--exposure", "2.5"),
        *("--transfer", "linear", "--spacing", "1 mm, 2 mm", "--slope-per-pixel", "0.02"),
        *("--focus-distance", "inf", "--orientation", "as-is"),
    )
    assert result.exit_code == 0, result.output
    assert "exposure 2.5" in result.stdout


def test_capture_takes_views_that_are_only_numbered(folder):
    """In serpentine rows, the picture is that of the views with rows and columns in their names."""
    (folder / "numbered").mkdir()
    for number, place in enumerate(["0_0", "0_1", "0_2", "1_2", "1_1", "1_0", "2_0", "2_1", "2_2"]):
        shutil.copy(folder / "views" / f"view_{place}.png", folder / "numbered" / f"{number}.png")
    told = ("--views", 3, 3, "--order", "serpentine")
    run("capture", "camera.toml", "views", "-o", "a.npy", *KNOWN)
    result = run("capture", "camera.toml", "numbered", "-o", "b.npy", *told, *KNOWN)
    assert result.exit_code == 0, result.output
    assert np.array_equal(np.load("a.npy"), np.load("b.npy"))


def test_progress_is_asked_for_where_work_is_long(folder, monkeypatch):
    from vcc.cli import capture

    monkeypatch.setattr(capture, "WORTH_A_BAR", 0)
    assert run("capture", "camera.toml", "views", "-o", "picture.npy", *KNOWN).exit_code == 0


def test_long_work_that_nobody_watches_says_once_how_long_it_takes(capsys):
    now = [0.0]
    foretold = _Estimate("Rendering views", lambda: now[0])
    for second in range(60):
        now[0] = float(second)
        foretold(second, 400)
    assert capsys.readouterr().err == "Rendering views: about 7 min to go\n"  # after 5 s, 5 of 400: 395 s
    begun_before = _Estimate("Rendering views", lambda: now[0])
    begun_before(390, 400)
    now[0] += 10
    begun_before(392, 400)
    assert capsys.readouterr().err == "Rendering views: about 40 s to go\n"
    short = _Estimate("Rendering views", lambda: now[0])
    now[0] += 6
    short(390, 400)
    assert capsys.readouterr().err == ""


def test_the_shell_completes_commands_and_options():
    code = "from vcc.cli.app import app; print(app.generate_completion(prog_name='vcc', shell='bash'))"
    script = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    asked = 'COMP_WORDS=({}); COMP_CWORD=$(( ${{#COMP_WORDS[@]}} - 1 )); _vcc; echo "${{COMPREPLY[@]}}"\n'
    lines = script + asked.format("vcc cap") + asked.format("vcc capture --interp")
    shown = subprocess.run(["bash", "-c", lines], capture_output=True, text=True, check=True).stdout
    assert shown == "capture\n--interpolation\n"


def test_explain_prints_the_plan(folder):
    result = run("explain", "camera.toml", "views", *KNOWN)
    assert result.exit_code == 0, result.output
    assert "3×3 views of 20×24 pixels" in result.stdout
    assert "focal length 50 mm" in result.stdout
    assert "Cost" in result.stdout


def test_info_says_what_is_known_and_what_is_assumed(folder):
    result = run("info", "views")
    assert result.exit_code == 0, result.output
    assert "3 × 3 (rows × columns)" in result.stdout
    assert "24 × 20 pixels, 3 channels, 8-bit" in result.stdout
    assert "1 mm  (not stated: assumed)" in result.stdout
    assert "pixels per view (measured)" in result.stdout
    assert "Note:" in result.stderr
    assert "--spacing" in result.stdout
    quick = run("info", "views", "--quick")
    assert "pixels per view" not in quick.stdout
    assert not quick.stderr


@pytest.mark.parametrize(
    ("arguments", "file"),
    [
        ([], "camera.png"),
        (["-o", "side.svg", "--object-distance", "1.2 m", "--object-distance", "inf"], "side.svg"),
        (["-o", "side.pdf", "--across", "y", "--light-field", "views"], "side.pdf"),
        (["-o", "stages.png", "--phase-space", "--light-field", "views"], "stages.png"),
        (["-o", "uv.png", "--phase-space", "--slice", "uv", "--light-field", "views"], "uv.png"),
    ],
)
def test_plot_writes_a_drawing(folder, arguments, file):
    result = run("plot", "camera.toml", *arguments)
    assert result.exit_code == 0, result.output
    assert file in result.stdout
    assert (folder / file).stat().st_size > 1000


def test_demo_is_called_with_a_folder_that_is_there(folder, monkeypatch):
    import types

    calls = []
    stand_in = types.ModuleType("vcc.demo")
    stand_in.run_demo = lambda *arguments: calls.append(arguments)
    monkeypatch.setitem(sys.modules, "vcc.demo", stand_in)
    result = run("demo", "--output", "a/b", "--light-field", "views", "--small")
    assert result.exit_code == 0, result.output
    ((output, light_field, small, console),) = calls
    assert output.is_dir()
    assert (str(light_field), small) == ("views", True)
    assert hasattr(console, "print")
    (folder / "file").write_text("")
    assert "cannot be used as a folder" in refused("demo", "--output", "file")


CAPTURE = "capture", "camera.toml", "views"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((*CAPTURE, "-o", "p.gif"), 'Error: the output cannot be written as "p.gif"'),
        ((*CAPTURE, "-o", "lost/p.png"), "there is no folder lost"),
        ((*CAPTURE, "-o", "folder.png"), "is a folder"),
        (("capture", "lost.toml", "views", "-o", "p.npy"), "there is no camera file"),
        (("capture", "camera.toml", "lost", "-o", "p.npy"), "there is no folder"),
        ((*CAPTURE, "-o", "a.png", "--exposure", "bright"), "--exposure is"),
        ((*CAPTURE, "-o", "a.png", "--exposure", "0"), "--exposure is"),
        ((*CAPTURE, "-o", "a.png", "--scene-distance", "1.2"), '--scene-distance is "1.2": a length needs a unit'),
        ((*CAPTURE, "-o", "a.png", "--scene-distance", "-1 m"), "greater than 0 m, not -1"),
        ((*CAPTURE, "-o", "a.png", "--spacing", "1 mm, 1 mm, 1 mm"), "--spacing is"),
        ((*CAPTURE, "-o", "a.png", "--spacing", "1"), "--spacing is"),
        ((*CAPTURE, "-o", "a.png", "--refine", "2.5"), '--refine is "2.5": it is a whole number, like 3, or auto'),
        ((*CAPTURE, "-o", "a.png", "--samples", "1"), "samples is a whole number of rays a pixel from 2"),
        ((*CAPTURE, "-o", "a.png", "--threads", "0"), "threads is a whole number, 1 or more"),
        ((*CAPTURE, "-o", "a.png", "--memory-limit", "much"), "a size has a number and a unit"),
        (("plot", "camera.toml", "--phase-space"), "--phase-space"),
        (("plot", "camera.toml", "--slice", "uv"), "--slice"),
        (("plot", "camera.toml", "--object-distance", "0 m"), "object distance"),
        (("plot", "camera.toml", "--object-distance", "1"), '--object-distance is "1": a length needs a unit'),
        (("plot", "unitless.toml"), "unitless.toml: sensor: pitch is 1: a length needs a unit"),
        (CAPTURE, "Missing option --output / -o"),
        (("capture",), "Missing argument CAMERA"),
        ((*CAPTURE, "and", "more", "-o", "a.png"), "Unexpected and more"),
        ((*CAPTURE, "-o", "a.png", "--interpolation", "shrap"), 'Did you mean "sharp"?'),
        ((*CAPTURE, "-o", "a.png", "--interpolaton", "sharp"), "Did you mean --interpolation?"),
        (("captur",), 'There is no command "captur": did you mean capture?'),
        (("nonsense",), "there are capture, expose, explain, info, plot"),
        (("synth", "nonsense"), "there are mitsuba, demo, planes"),
    ],
)
def test_errors_name_what_is_wrong(folder, arguments, words):
    (folder / "folder.png").mkdir()
    (folder / "unitless.toml").write_text(CAMERA.replace('"1 mm"', "1"))
    assert words in refused(*arguments)


def test_the_way_to_help_is_named():
    assert refused("capture").endswith("Help:  vcc capture --help\n")
    assert refused("synth", "planes").endswith("Help:  vcc synth planes --help\n")


def test_options_given_twice(folder):
    """The last one counts; distances to draw are all drawn: a ray's colour for each."""
    result = run("plot", "camera.toml", "-o", "one.svg", "-o", "other.svg", "--object-distance", "1.2 m")
    assert result.stdout == "other.svg: written\n"
    run("plot", "camera.toml", "-o", "two.svg", "--object-distance", "1.2 m", "--object-distance", "3 m")
    one, two = ((folder / name).read_text() for name in ("other.svg", "two.svg"))
    assert two.count("stroke:") > one.count("stroke:")


def test_a_reader_who_has_seen_enough_is_no_fault(folder):
    command = [sys.executable, "-m", "vcc", "plot", "camera.toml", "-o", "side.svg"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as running:
        running.stdout.close()
        assert running.wait() == 1
        assert not running.stderr.read()
    assert (folder / "side.svg").exists()


def test_faults_of_the_program_exit_with_1_and_a_traceback(tmp_path):
    code = (
        "import sys, types; stand_in = types.ModuleType('vcc.demo'); sys.modules['vcc.demo'] = "
        "stand_in; stand_in.run_demo = lambda *arguments: 1 / 0; "
        "sys.argv = ['vcc', 'demo', '-o', sys.argv[1]]; "
        "from vcc.cli import main; main()"
    )
    command = [sys.executable, "-c", code, str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 1
    assert "ZeroDivisionError" in result.stderr


def test_interrupted_commands_exit_with_130_and_one_line_without_waiting_for_threads(tmp_path):
    code = (
        "import sys, threading, types\n"
        "stand_in = sys.modules['vcc.demo'] = types.ModuleType('vcc.demo')\n"
        "def at_work(*arguments):\n"
        "    threading.Thread(target=threading.Event().wait).start()\n"
        "    raise KeyboardInterrupt\n"
        "stand_in.run_demo = at_work\n"
        "sys.argv = ['vcc', 'demo', '-o', sys.argv[1]]; "
        "from vcc.cli import main; main()"
    )
    command = [sys.executable, "-c", code, str(tmp_path)]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)  # the thread never ends
    assert result.returncode == 130
    assert result.stderr.strip() == "Aborted."


def test_as_a_module():
    for module in ("vcc", "vcc.cli"):
        command = [sys.executable, "-m", module, "--version"]
        result = subprocess.run(command, capture_output=True, text=True, check=True)
        assert result.stdout.strip() == f"vcc {vcc.__version__}"


LISTED = [("", COMMANDS), ("synth ", RENDERERS)]
EVERY = [f"{group}{name}" for group, commands in LISTED for name in commands]


@pytest.mark.parametrize("command", EVERY)
def test_help_teaches(command):
    result = run(*command.split(), "--help")
    assert result.exit_code == 0
    assert "Example:" in result.stdout
    if command == "capture":
        assert "1.2 m" in result.stdout


def test_help_on_making_a_picture_is_that_of_the_record_in_words_for_people():
    said = " ".join(run("capture", "--help").stdout.replace("│", "").split())
    for field in dataclasses.fields(How):
        option = "--ray-seed" if field.name == "seed" else f"--{field.name.replace('_', '-')}"
        assert f"{option} " in said
    assert "--samples NUMBER Rays a pixel, rounded up to a power of two" in said
    assert "Default: 64, whose error" in said
    assert "None" not in said
    assert "``" not in said


def loaded_by(*commands):
    """What packages commands load, one after another in one process: after each of them."""
    code = (
        "import sys; from vcc.cli.app import run\n"
        "for command in sys.argv[1:]:\n"
        "    run(command.split())\n"
        "    print('\\nloaded:', *{name.partition('.')[0] for name in sys.modules})"
    )
    command = [sys.executable, "-c", code, *commands]
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    return [set(line.split()[1:]) for line in result.stdout.splitlines() if line.startswith("loaded:")]


HEAVY = {
    "numba",
    "scipy",
    "matplotlib",
    "pint",
    "imagecodecs",
    "zarr",
    "tifffile",
    "mitsuba",
    "moderngl",
    "trimesh",
}


def test_help_loads_nothing_heavy():
    loaded = loaded_by("--help", "capture --help", "decode --help", "synth mitsuba --help")
    assert len(loaded) == 4
    assert "numpy" not in loaded[0]
    assert not any(after & HEAVY for after in loaded), loaded


def test_messages_speak_of_options():
    said = 'pass spacing=…, focus_distance=… (lengths in metres) or orientation="as-is"'
    assert as_options(said) == (
        'pass --spacing …, --focus-distance … (lengths with a unit: "50 mm") or --orientation "as-is"'
    )
    said = (
        'pass views=(rows, columns), e.g. views=(9, 9), and order="chess"; every= means nothing here, nor views='
    )
    assert as_options(said) == (
        'pass --views rows columns, e.g. --views 9 9, and --order "chess"; --every means nothing here, nor --views'
    )
