"""The commands of ``vcc``: their help texts and modules; how a command runs and ends."""

from __future__ import annotations

import difflib
import os
import sys
import threading
from collections.abc import Sequence

from cyclopts import App, CycloptsError, Group, Parameter
from cyclopts.exceptions import MissingArgumentError, UnknownCommandError, UnusedCliTokensError

from vcc import __version__
from vcc.base.errors import InputError
from vcc.cli.console import notes, say
from vcc.cli.synth.views_file import with_views

COMMANDS = {
    "capture": (
        "Capture the image that a camera records of a light field.\n\n"
        "For a sensor with photodiodes, the image of each is written next to the output, as NAME_ROW_COLUMN.",
        'vcc capture camera.toml views/ -o picture.png --spacing "1 mm"',
        "vcc capture camera.toml views/ -o picture.exr --interpolation cubic",
        "vcc capture camera.toml scene.zarr -o picture.exr --executor processes",
        'vcc capture camera.toml video.zarr -o picture.png --start "0.2 s" --exposure-time "20 ms"',
        'vcc capture moving.toml views/ -o picture.png --exposure-time "90 ms"',
    ),
    "expose": (
        "Record a light field as a real sensor would: photons, electrons, noise, raw numbers.\n\n"
        "The camera file describes the sensor in a table sensor.electronics. For a sensor with photodiodes, the "
        "recording of each is written next to the output, as NAME_ROW_COLUMN.",
        'vcc expose camera.toml views/ -o raw.tif --exposure "10 ms" --seed 1',
        "vcc expose camera.toml views/ -o raw.npy --picture picture.png",
    ),
    "explain": (
        "Report how an image is made, what it costs, and which limits apply.",
        "vcc explain camera.toml views/",
    ),
    "info": (
        "Report views, geometry, disparities and brightness of a light field, and what is unknown.",
        "vcc info views/",
        "vcc info views/ --quick",
        "vcc info views/ --picture grid.png",
        "vcc info mosaic.png --views 9 9",
        'vcc info views/ --keep --spacing "2 mm" --slope-per-pixel 0.0012 --focus-distance "1.3 m"',
    ),
    "plot": (
        "Draw a camera from the side with rays, or the path of a light field through it in phase space.",
        "vcc plot camera.toml -o camera.svg",
        "vcc plot camera.toml --phase-space --light-field views/",
    ),
    "sweep": (
        "Capture the images of many cameras: a camera file with varied parameters.\n\n"
        "Images and a table are saved in a Zarr group for xarray; the same command resumes an interrupted sweep.",
        'vcc sweep camera.toml views/ --set "sensor.z=50mm:54mm:9" --set "code.pattern=mura,circle" -o all.zarr',
        'vcc sweep camera.toml views/ --set "sensor.z=50mm:54mm" --design sobol -o table.csv --sharpness',
        'vcc sweep camera.toml views/ --set "sensor.z=50mm:54mm:9" -o all.zarr --sheet all.png --table all.csv',
    ),
    "dataset": (
        "Make pairs of recordings and ground truth, for training.\n\n"
        "Each pair has a camera of the design, a window of its sensor, an exposure and noise of its own. The "
        "card, README.md, says how the set was made.",
        'vcc dataset camera.toml scene.zarr -o pairs --set "code.pattern=mura,circle" --count 400 --crop 256 256',
        'vcc dataset camera.toml one.zarr two.zarr -o pairs --set "sensor.z=50mm:54mm" --design sobol '
        '--cameras 512 --sharp --depth --flips --exposure "1ms:20ms"',
    ),
    "bench": (
        "Open the optical bench in the browser: move elements and see the image change.\n\n"
        "Without a camera and a light field it opens a lens before the demo's scene.",
        "vcc bench",
        "vcc bench --gallery plenoptic",
        "vcc bench camera.toml views/",
        "vcc bench room.ply",
    ),
    "demo": (
        "Run the paper's examples and its own check, and explain them on a page of pictures.\n\n"
        "It takes about 20 seconds on two cores, and about 10 with --small.",
        "vcc demo --small",
        "vcc demo --light-field views/",
    ),
    "convert": (
        "Convert a light field to a store (Zarr), or to files of another format.\n\n"
        "A store keeps samples bit for bit, with their cameras. It opens at once and is read in parts, so that a "
        "capture fits in any memory (--memory-limit). It appears when it is complete.",
        'vcc convert views/ scene.zarr --spacing "1 mm"',
        "vcc convert views/ small.zarr --lossy jpegxl --quality 90",
        "vcc convert scene.zarr half.zarr --dtype float16",
        "vcc convert scene.zarr flight.mp4",
        'vcc convert my_photographs/ field.zarr --unit "10 cm" --distances "1.4 m, 3 m"',
        'vcc convert take/ video.zarr --frame-rate 24 --spacing "1 mm"',
    ),
    "decode": (
        "Turn the raw recording of a plenoptic or mask-modulated camera into a light field.\n\n"
        "The positions of lenslets' micro-images come from --centres, --white or --camera. For a mask of cosines, "
        "the carriers come from --camera.",
        "vcc decode raw.tif --camera camera.toml -o field.zarr",
        "vcc decode raw.tif --white white.tif --dark dark.tif --views 9 -o views",
        "vcc decode photo.lfp --white white.lfp -o field.zarr",
        "vcc decode raw.png --centres centres.csv --color-filter BGGR -o field.zarr",
    ),
    "refocus": (
        "Refocus a light field at one distance, at many, or at all.",
        'vcc refocus views/ --distance "1.2 m" -o picture.png',
        'vcc refocus views/ --stack "0.8 m" "3 m" 12 -o stack.mp4',
        "vcc refocus views/ --all-in-focus -o sharp.png",
    ),
    "spectrum": (
        "Draw the spectrum of a light field: where its detail lies in frequency, and how optics would shear it.",
        "vcc spectrum views/ -o spectrum.png",
        "vcc spectrum scene.zarr -o section.svg --across vt --of section",
    ),
    "gallery": (
        "Rebuild a published camera, from optics to decoded result, and compare it with its claims.",
        "vcc gallery",
        "vcc gallery wavefront-coding",
        "vcc gallery biprism-stereo --light-field views/ -o stereo",
    ),
}
"""Help text and examples by name. ``vcc NAME`` is the function NAME in ``vcc.cli.NAME``."""

RENDERERS = {
    "mitsuba": (
        "Render any scene of Mitsuba 3. Its own sensor defines the position and direction of the middle view.",
        'vcc synth mitsuba scene.xml -o out.zarr --views 20 20 --pixels 500 500 --aperture "20 mm" '
        '--field-of-view "40 deg" --focus-distance "1.3 m" --samples 64',
    ),
    "demo": (
        "Render a built-in scene with Mitsuba: glass, gold and gloss, at several depths.\n\n"
        "The example takes about two minutes on two cores, and three times as long without LLVM 16 or newer.",
        "vcc synth demo still-life -o still-life.zarr --views 9 9 --pixels 200 300",
    ),
    "planes": (
        "Render pictures on planes, the nearer ones before the others.",
        "vcc synth planes -o leaves.zarr",
        'vcc synth planes -o two.zarr --plane "leaf.png, 0.8 m, 30 cm" --plane "town.jpg, 3 m, 2 m"',
    ),
    "pbrt": (
        "Render a scene of PBRT by the program pbrt (on the PATH, or named by PBRT in the environment).",
        "vcc synth pbrt scene.pbrt -o out.zarr --views 9 9 --pixels 400 600 --samples 128",
    ),
    "blender-script": (
        "Write a script that renders the views in your own Blender, 3.6 to 5.x, and states their geometry.",
        'vcc synth blender-script -o views.py --views 9 9 --aperture "40 mm"',
        "blender scene.blend --background --python views.py",
    ),
    "depth": (
        "Make the views around a picture from its depth; hidden parts behind edges are filled in.",
        'vcc synth depth room.png room-depth.exr -o room.zarr --field-of-view "60 deg"',
        'vcc synth depth kinect.png kinect-depth.png -o out.zarr --depth-unit "1 mm"',
        'vcc synth depth view.png disparity.pfm -o out.zarr --meaning disparity --focus-distance "4 m"',
    ),
    "opengl": (
        "Draw meshes with OpenGL, textured and simply lit: fast, without shadows, mirrors and glass.",
        'vcc synth opengl teapot.glb -o teapot.zarr --field-of-view "40 deg"',
        'vcc synth opengl room.obj -o room.zarr --unit "1 cm" --eye "0, 160, 300" --target "0, 100, 0"',
    ),
    "splats": (
        "Render Gaussian splats: true views with occlusion, and the disparities of the middle one.\n\n"
        "--look lists cameras of the scene and draws a contact sheet of what they see.",
        "vcc synth splats room.ply --look",
        "vcc synth splats room.ply -o room.zarr --camera 3 --parallax 1",
        "vcc synth splats garden.ply -o garden.zarr --camera-from cameras.json --camera 12 --views 9 9",
        "vcc synth splats garden.ply views.toml -o garden.zarr --executor processes",
    ),
}
"""Likewise: ``vcc synth NAME`` is the function NAME in ``vcc.cli.synth.NAME``."""

ZOO = {
    "run": (
        "Score cameras, scenes and decoders for a task, with controls of the same light.\n\n"
        "Results are kept by content: the same command resumes an interrupted run, and a new camera or decoder "
        "adds only its own results.",
        "vcc zoo run --task edof -o zoo.zarr",
        "vcc zoo run --task edof -o zoo.zarr --camera my.toml --decoder my.py:decode",
        "vcc zoo run --task light-field -o zoo.zarr --seeds 3",
        "vcc zoo run --task depth -o zoo.zarr --scene leaves-7 --scene views.zarr --executor processes",
    ),
    "table": (
        "Print the table of a run, with standard errors over scenes and the gains over controls.",
        "vcc zoo table zoo.zarr",
        "vcc zoo table zoo.zarr --task depth -o scores.csv",
    ),
    "page": (
        "Write a page of a run: tables, quality over light, and a strip of pictures.",
        "vcc zoo page zoo.zarr -o page",
    ),
    "design": (
        "Learn an aperture code and its decoder together, and decoders of its controls: the round stop of its "
        "light, a random code, and the open square.\n\n"
        "The code can be made: it is binary and symmetric, and has an exact number of open cells and no smaller "
        "hole or bar than stated. The same command resumes an interrupted design. vcc zoo run scores it.",
        "vcc zoo design --task edof -o design",
        "vcc zoo design --task edof -o design --light 0.1 --symmetry left-right --seeds 5",
    ),
}
"""Likewise: ``vcc zoo NAME`` is the function NAME in ``vcc.cli.zoo.NAME``."""


def _commands(
    name: str, package: str, commands: dict[str, tuple[str, ...]], help: str, epilogue: str, place: int = 0
) -> App:
    """An app whose commands are loaded on demand and listed in the order given."""
    made = App(
        name=name,
        help=help,
        help_epilogue=epilogue,
        version=f"vcc {__version__}",
        group_parameters=Group("Options", sort_key=1),
        version_flags=["--version"] if name == "vcc" else [],
        default_parameter=Parameter(negative=(), show_default=_worth_showing, allow_repeating=True),
        suppress_keyboard_interrupt=False,
        sort_key=place,
    )
    for flag in (*made.help_flags, *made.version_flags):
        made[flag].group = "Options"
    for number, (command, (words, *examples)) in enumerate(commands.items()):
        function = command.replace("-", "_")
        made.command(
            f"{package}.{function}:{function}",
            name=command,
            help=words,
            help_epilogue="\n\n".join(f"Example:  {example}" for example in examples),
            sort_key=number,
        )
    return made


def _worth_showing(default: object) -> str | None:
    """A default as help shows it; None and False are not shown."""
    return None if default is None or default is False else str(default)


app = _commands(
    "vcc",
    "vcc.cli",
    COMMANDS,
    "Virtual Computational Camera: what would a camera with unconventional optics record? "
    "Give it a light field and a camera file, and get the image on its sensor.",
    "Try:  vcc demo  ·  Help on a command:  vcc capture --help",
)
app.command(
    _commands(
        "synth",
        "vcc.cli.synth",
        RENDERERS,
        "Render a light field of a scene with one of these renderers. Views are written as they are done, and the "
        "same command resumes an interrupted run.\n\n"
        "A file .toml among the arguments states where the views are: the options of that group by name, as in "
        'views = [9, 9] and aperture = "20 mm". Options next to it have precedence.',
        "Help on a renderer:  vcc synth planes --help",
        place=len(COMMANDS),
    )
)
app.command(
    _commands(
        "zoo",
        "vcc.cli.zoo",
        ZOO,
        "Compare computational cameras by common rules: the same scenes, exposures, noise and decoders, and "
        "controls of the same light. A camera and a decoder of yours can take part.",
        "Help on a command:  vcc zoo run --help",
        place=len(COMMANDS) + 1,
    )
)
app.register_install_completion_command(
    help="Install completion of commands, options and files for this shell: bash, zsh or fish.",
    group="Options",
)


INTERRUPTED = 130
"""The exit code that shells expect after Ctrl-C."""


def main() -> None:
    """Run the command line with the arguments of this process, and end it with an exit code.

    0: done. 1: a bug, with a traceback. 2: invalid input, with a message on standard error. 130: interrupted
    by Ctrl-C; a server that Ctrl-C ends, as it should, exits with 0.
    """
    stopped = True
    try:
        code = run(sys.argv[1:])
        stopped = code == INTERRUPTED
    except KeyboardInterrupt:  # a second Ctrl-C while the first was handled
        code = INTERRUPTED
    except SystemExit as ended:  # a server, by Ctrl-C
        code = ended.code if isinstance(ended.code, int) else 0
    if stopped and threading.active_count() > 1:
        # The work of other threads is no longer needed, and Python would wait for it.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Run a command; print errors in the input and warnings about the result as lines on standard error.

    Args:
        arguments: as typed after ``vcc``.

    Returns:
        The exit code, see `main`.
    """
    with notes():
        try:
            app(with_views(arguments), exit_on_error=False, print_error=False, result_action="return_value")
        except InputError as error:
            return _refuse(str(error))
        except CycloptsError as error:
            return _refuse(_in_words(error), _help_on(error))
        except KeyboardInterrupt as interrupt:
            say("Aborted.", "bold red", str(interrupt))
            return INTERRUPTED
        except BrokenPipeError:  # the reader closed the pipe; Python must not flush at exit
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return 1
    return 0


def _refuse(message: str, way_out: str = "") -> int:
    say("Error:", "bold red", message)
    if way_out:
        say("Help: ", "bold", way_out)
    return 2


def _in_words(error: CycloptsError) -> str:
    """The message for an error in the arguments; messages of our converters are used unchanged."""
    if isinstance(error.__cause__, InputError):
        return str(error.__cause__)
    if isinstance(error, MissingArgumentError) and error.argument is not None and error.keyword is None:
        kind = "argument" if error.argument.index is not None else "option"
        return f"Missing {kind} {' / '.join(error.argument.names)}"
    if isinstance(error, UnknownCommandError) and error.app is not None:  # its message loads all commands
        return _no_such_command((error.unused_tokens or [""])[0], [each for each in error.app if each[0] != "-"])
    if isinstance(error, UnusedCliTokensError):
        return f"Unexpected {' '.join(error.unused_tokens or [])}"
    return str(error)


def _no_such_command(asked: str, names: list[str]) -> str:
    near = difflib.get_close_matches(asked, names, 1)
    return f'There is no command "{asked}": ' + (
        f"did you mean {near[0]}?" if near else f"there are {', '.join(names)}"
    )


def _help_on(error: CycloptsError) -> str:
    return " ".join(("vcc", *(error.command_chain or ()), "--help"))
