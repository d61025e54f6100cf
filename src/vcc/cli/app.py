"""The commands of ``vcc``: their help texts and modules; how a command runs and ends."""

from __future__ import annotations

import difflib
import inspect
import os
import re
import sys
import threading
from collections.abc import Sequence
from importlib.util import find_spec

from cyclopts import App, CycloptsError, Group, Parameter
from cyclopts.exceptions import MissingArgumentError, UnknownCommandError, UnusedCliTokensError

from vcc import __version__
from vcc.base.errors import InputError
from vcc.cli.console import notes, say
from vcc.cli.synth.views_file import with_views

COMMANDS = (
    "capture",
    "expose",
    "explain",
    "info",
    "plot",
    "sweep",
    "dataset",
    "bench",
    "demo",
    "convert",
    "decode",
    "refocus",
    "spectrum",
    "gallery",
)
"""``vcc NAME`` is the function NAME in ``vcc.cli.NAME``; its docstring is its help."""
RENDERERS = (
    "mitsuba",
    "demo",
    "planes",
    "pbrt",
    "blender-script",
    "depth",
    "opengl",
    "splats",
)
"""Likewise ``vcc synth NAME`` in ``vcc.cli.synth.NAME``."""
ZOO = (
    "run",
    "table",
    "page",
    "design",
)
"""Likewise ``vcc zoo NAME`` in ``vcc.cli.zoo.NAME``."""


def documented(package: str, command: str) -> tuple[str, list[str]]:
    """The help text and the examples of a command: its docstring, without an import, which takes a second."""
    name = command.replace("-", "_")
    spec = find_spec(f"{package}.{name}")
    source = spec.loader.get_source(spec.name) if spec is not None else None  # type: ignore[union-attr]
    found = re.search(rf'^def {name}\(.*?"""(.*?)"""', source or "", re.DOTALL | re.MULTILINE)
    assert found is not None, f"{package}.{name} has no function {name} with a docstring"
    about, _, rest = inspect.cleandoc(found[1]).partition("\n\nExamples:\n")
    listed = rest.partition("\n\n")[0].replace("\n        ", " ")  # lines that go on are indented further
    return about, [line.strip() for line in listed.splitlines()]


def _commands(name: str, package: str, commands: Sequence[str], help: str, epilogue: str, place: int = 0) -> App:
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
    for number, command in enumerate(commands):
        function, (words, examples) = command.replace("-", "_"), documented(package, command)
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
