"""The light fields of a folder that are frames of a video, in the order of the numbers in their names."""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.reading import check_path, expanded
from vcc.base.words import first_few

_NUMBERED = re.compile(r"(.*?)([0-9]+)((?:\.[A-Za-z]\w*)*)")


def numbered_frames(folder: Path) -> list[Path]:
    """The folders and files whose names differ in a number alone, ``frame_0001``, by that number.

    Args:
        folder: that holds them; what has no number in its name is passed over.

    Raises:
        InputError: no folder, nothing numbered in it, several kinds of names, or numbers that are missing or there
            twice.
    """
    folder = expanded(folder)
    if not check_path(folder, "folder of frames"):
        raise InputError(
            f"{folder} is a file: --frame-rate is for a folder that holds a light field for each frame"
        )
    kinds: dict[tuple[str, str], dict[int, Path]] = {}
    for path in sorted(folder.iterdir()):
        match = None if path.name.startswith(".") else _NUMBERED.fullmatch(path.name)
        if match is None:
            continue
        same = kinds.setdefault((match[1], match[3]), {})
        other = same.setdefault(int(match[2]), path)
        if other is not path:
            raise InputError(f"{other} and {path.name} are both frame {int(match[2])}: take one of them away")
    if len(kinds) != 1:
        named = [next(iter(same.values())).name for same in kinds.values()]
        found = (
            f"several kinds of numbered names, {first_few(named, len(named), 4)}" if named else "nothing numbered"
        )
        raise InputError(
            f"{folder} holds {found}: the frames of a video are folders or files of one kind, frame_0001, "
            "frame_0002, …"
        )
    frames = next(iter(kinds.values()))
    for before, after in pairwise(sorted(frames)):
        if after != before + 1:
            raise InputError(
                f"{folder}: frame {before + 1} is missing between {frames[before].name} and {frames[after].name}. "
                "Frames at times of their own are appended from Python, by vcc.store.create_video"
            )
    return [frames[number] for number in sorted(frames)]
