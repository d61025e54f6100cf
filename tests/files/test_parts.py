"""What killed writers leave is removed by the next one of the same target, and what is at work stays."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.lock_holder import LOCKS
from vcc.errors import InputError
from vcc.files import parts
from vcc.files.atomic import atomic_path
from vcc.files.writer_lock import WriterLock


def dead_process() -> int:
    """The number of a process that has ended."""
    return int(subprocess.run(["sh", "-c", "echo $$"], capture_output=True, check=True).stdout)


def part_by(monkeypatch: pytest.MonkeyPatch, target: Path, process: int) -> Path:
    """A part of a target as another process of this machine would leave it."""
    with monkeypatch.context() as other:
        other.setattr(os, "getpid", lambda: process)
        return parts.part_of(target)


def write(path: Path) -> None:
    with atomic_path(path) as temporary:
        temporary.write_text("new")


def test_the_next_writer_removes_what_dead_ones_left_and_nothing_else(tmp_path, monkeypatch):
    target, other = tmp_path / "a.png", tmp_path / "b.png"
    left = part_by(monkeypatch, target, dead_process())
    others = [
        part_by(monkeypatch, target, os.getppid()),  # at work
        part_by(monkeypatch, other, dead_process()),
        tmp_path / ".a.mine.part.png",
        tmp_path / "a.0-0-0.part.png",
    ]
    for file in (left, *others):
        file.write_text("half")
    write(target)
    assert not left.exists()
    assert all(file.read_text() == "half" for file in others)
    assert target.read_text() == "new"


def test_parts_of_other_machines_are_let_be_for_a_day(tmp_path, monkeypatch):
    target = tmp_path / "a.png"
    with monkeypatch.context() as other:
        other.setattr(parts, "_machine", lambda: "00000000")
        part = parts.part_of(target)
    part.write_text("half")
    write(target)
    assert part.exists()
    now = time.time()
    monkeypatch.setattr(time, "time", lambda: now + parts.DAY + 60)
    write(target)
    assert not part.exists()


@pytest.mark.parametrize("exchanges", [True, False], ids=["exchanged in one step", "in two renames"])
def test_a_folder_takes_the_place_of_another(tmp_path, monkeypatch, exchanges):
    if not exchanges:
        monkeypatch.setattr(parts, "_exchanged", lambda one, other: False)
    for name in ("old", "new"):
        (tmp_path / name).mkdir()
        (tmp_path / name / name).touch()
    with pytest.raises(OSError, match="not empty"):
        parts.put_in_place(tmp_path / "new", tmp_path / "old", replace=False)
    parts.put_in_place(tmp_path / "new", tmp_path / "old", replace=True)
    assert [path.name for path in tmp_path.rglob("*")] == ["old", "new"]


REPLACED = """
import os, sys
from pathlib import Path
from vcc.files import parts
target, how, step = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
if how == "in two renames":
    parts._exchanged = lambda one, other: False
part = parts.part_of(target)
part.mkdir()
(part / "new").touch()
steps = [0]
def dies(event, arguments):
    if event in ("os.rename", "shutil.rmtree"):
        steps[0] += 1
        if steps[0] == step:
            os._exit(9)
sys.addaudithook(dies)
parts.put_in_place(part, target, replace=True)
"""


@pytest.mark.parametrize(
    ("how", "step", "there"),
    [
        ("exchanged", 1, "new"),  # before the old one is removed: exchanging names is no rename to Python
        ("in two renames", 1, "old"),
        ("in two renames", 2, None),
        ("in two renames", 3, "new"),
    ],
)
def test_a_kill_while_a_folder_is_replaced_leaves_the_old_or_the_new(tmp_path, how, step, there):
    target = tmp_path / "a.zarr"
    target.mkdir()
    (target / "old").touch()
    command = [sys.executable, "-c", REPLACED, str(target), how, str(step)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 9, done.stderr
    assert [file.name for file in target.glob("*")] == ([there] if there else [])
    assert parts.put_back(target) == (there is None)
    assert [file.name for file in target.glob("*")] == [there or "old"]
    parts.clear_leftovers(target)
    assert [file.name for file in tmp_path.iterdir()] == ["a.zarr"]


def test_a_lock_holds_until_its_process_ends_however_that_happens(tmp_path):
    target = tmp_path / "a.zarr"
    command = [sys.executable, "-c", LOCKS, str(target)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "held\n"
        with pytest.raises(InputError, match=rf"a\.zarr is being written by process {other.pid} on .* since 20"):
            WriterLock(target)
        other.kill()
        other.wait()
    lock = WriterLock(target)
    assert lock.held
    lock.give_back()
    assert not lock.held
    assert not list(tmp_path.iterdir())


def test_a_later_lock_of_the_same_process_takes_the_earlier_ones_place(tmp_path):
    first = WriterLock(tmp_path / "a")
    second = WriterLock(tmp_path / "a")
    assert (first.held, second.held) == (False, True)
    del second
    assert not list(tmp_path.iterdir())
