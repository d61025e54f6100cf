"""A short run of the fuzzer in tests/fuzz: all bombs, and a mutant of each format."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_no_file_crashes_hangs_or_raises_anything_but_a_refusal(tmp_path: Path) -> None:
    # A process of its own: it forks, which what has threads (this one, perhaps) must not.
    run = subprocess.run(
        [sys.executable, "-m", "tests.fuzz", "--seed", "12", "--rounds", "1", "--timeout", "100", "--jobs", "2"],
        cwd=ROOT,
        env={**os.environ, "TMPDIR": str(tmp_path)},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.endswith("0 crash, 0 hang, 0 leak, 0 silent, 0 bloat, 0 long\n")
