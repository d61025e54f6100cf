"""Fuzz every reader: ``python -m tests.fuzz --seconds 240 --seed 7``, in the project's folder.

Needs what the project's test extra installs. Each case is a copy of a small valid seed with one to three
mutations, drawn from the seed, the format and a number alone, and is opened in a child of its own. Counted are

    opened    samples were read
    refused   by vcc.InputError; of these are "caught" those which only the boundary refused (vcc.base.reading)
    crash     the child died of a signal
    hang      no answer within --timeout seconds
    leak      any other exception
    silent    opened, and the samples are not those of the seed although the damage can be noticed (bytes cut
              off, a flipped bit under a checksum, a view that is gone), or they are NaN, infinite or negative;
              or a bomb was opened
    bloat     more than 1 GiB of memory for less than 1 MB of files
    long      a refusal of more than vcc.base.reading.LONGEST_MESSAGE characters

The last line counts the faults; the exit code is 1 if there are any. ``--case "png views:12" --seed 7`` runs a
case again, with its traceback; ``--case "pbrt gz bomb"`` a bomb.
"""

from __future__ import annotations

import argparse
import gc
import importlib
import itertools
import sys
from pathlib import Path

from tests.fuzz.bombs import BOMBS
from tests.fuzz.child import limited
from tests.fuzz.formats import FORMATS
from tests.fuzz.run import Run, rooms

LATE = (
    "imagecodecs",
    "tifffile",
    "h5py",
    "OpenEXR",
    "av",
    "zarr",
    "zarr.storage",
    "tomllib",
    "scipy.io",
    "trimesh",
)
"""What children would else load one by one."""


def main() -> int:
    """Run what the command line says; returns the exit code."""
    about = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    about.add_argument("--seconds", type=float, default=float("inf"), help="how long mutated seeds are opened")
    about.add_argument("--rounds", type=int, help="how many of them for each format; without end if not given")
    about.add_argument("--seed", type=int, default=0)
    about.add_argument("--jobs", type=int, default=1)
    about.add_argument("--timeout", type=float, default=20)
    about.add_argument("--only", default="", help="parts of names of formats or bombs, separated by commas")
    about.add_argument("--no-bombs", action="store_true")
    about.add_argument("--report", type=Path, help="folder that keeps the first input of each fault")
    about.add_argument("--case", help="run this one alone")
    asked = about.parse_args()
    for name in (*LATE, "vcc.store.picture_codec"):
        importlib.import_module(name)
    gc.freeze()  # children look for garbage among what they make: else each would write to, and copy, all pages
    with rooms() as room:
        run = Run(asked.seed, room, asked.timeout, asked.jobs, asked.report)
        if asked.case:
            return again(run, asked.case)
        parts = asked.only.split(",")
        names = run.make_seeds(name for name in FORMATS if any(part in name for part in parts))
        bombs = [] if asked.no_bombs else [name for name in BOMBS if any(part in name for part in parts)]
        run.go(run.bombs(bombs), float("inf"))
        most = None if asked.rounds is None else asked.rounds * len(names)
        run.go(itertools.islice(run.mutants(names), most), asked.seconds)
        print(run)
        return 1 if run.findings else 0


def again(run: Run, name: str) -> int:
    """One case in this process, so that its traceback is seen."""
    if name in BOMBS:
        (case,) = run.bombs([name])
    else:
        kind, _, number = name.rpartition(":")
        run.make_seeds([kind])
        case = run.mutant(kind, int(number))
    limited()
    print(case.what)
    print(case.work())
    return 0


if __name__ == "__main__":
    sys.exit(main())
