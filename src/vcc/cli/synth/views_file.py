"""Files of views: the options "Where the views are" of all renderers, written down once (``views.toml``).

::

    views = [9, 9]
    pixels = [512, 512]
    aperture = "20 mm"            # or "10 mm, 20 mm"
    field_of_view = "40 deg"
    focus_distance = "1.3 m"

Names and values are those of the options, with underscores. A path counts from the folder of the file.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.reading import expanded, read_text

ENDING = ".toml"
_COUNTS, _PATH = ("views", "pixels"), "camera_from"
NAMES = (
    *_COUNTS,
    "aperture",
    "field_of_view",
    "focus_distance",
    "parallax",
    "unit",
    "eye",
    "target",
    "up",
    "direction",
    "camera",
    _PATH,
)
"""The entries of a file; a renderer without such an option does not accept it."""
_WRITTEN = {
    **dict.fromkeys(_COUNTS, "two whole numbers, such as [9, 9]"),
    _PATH: "the name of a file",
    "": "a number, a quantity as text, or a list of them",
}


def with_views(arguments: Sequence[str]) -> list[str]:
    """The arguments of a command, with the options of a file of views in its place.

    Args:
        arguments: as typed after ``vcc``; those after ``synth RENDERER`` may name one file .toml. Options next
            to it have precedence.

    Raises:
        InputError: several files, or a file that cannot be read or has other entries.
    """
    given = list(arguments)
    files = [each for each in given[2:] if each.endswith(ENDING) and "=" not in each]
    if given[:1] != ["synth"] or not files:
        return given
    if len(files) > 1:
        raise InputError(f"{files[0]} and {files[1]}: one file of views states where the views are")
    rest = [each for each in given[2:] if each != files[0]]
    return [*given[:2], *_options(expanded(files[0])), *rest]


def _options(path: Path) -> list[str]:
    try:
        tree = tomllib.loads(read_text(path, "file of views"))
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{path} is not TOML: {error}") from None
    options = []
    for name, value in tree.items():
        if name not in NAMES:
            raise InputError(f"{path}: {name} does not describe views: the entries are {', '.join(NAMES)}")
        listed = value if isinstance(value, list) else [value]
        kinds = {_PATH: (str,)}.get(name, (int,) if name in _COUNTS else (str, int, float))
        if not listed or not all(type(each) in kinds for each in listed) or (name == _PATH and len(listed) > 1):
            raise InputError(f"{path}: {name} is {value!r:.60}: write {_WRITTEN.get(name, _WRITTEN[''])}")
        texts = [str(each) for each in listed]
        if name == _PATH:
            texts = [str(path.parent / texts[0])]
        option = f"--{name.replace('_', '-')}"
        options += [option, *texts] if name in _COUNTS else [f"{option}={', '.join(texts)}"]
    return options
