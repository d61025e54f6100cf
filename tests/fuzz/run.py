"""A run: seeds, bombs and mutated seeds one after the other, and what is found."""

from __future__ import annotations

import contextlib
import itertools
import re
import selectors
import shutil
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from typing import Any

from tests.fuzz import mutations
from tests.fuzz.bombs import BOMBS
from tests.fuzz.child import Child, Outcome, alone
from tests.fuzz.formats import FORMATS
from tests.fuzz.readers import Read
from tests.fuzz.seeds import Maker
from vcc.base.reading import LONGEST_MESSAGE

BLOAT = 2**30
"""Bytes of memory that an input of less than `SMALL` bytes may take."""
SMALL = 10**6
BOMBS_AT_ONCE = 24
"""Bombs whose files are there at once."""
FAULTS = ("crash", "hang", "leak", "silent", "bloat", "long")
MUTATE: dict[str, Callable[[Path, bool, Random], tuple[str, bool]]] = {"lytro resigned": mutations.resigned}
"""Formats whose files are not changed blindly."""


@dataclass(frozen=True)
class Case:
    """Something to open.

    Args:
        name: the format and its number, by which the case is run again, or the bomb.
        row: of the table in which it is counted.
        folder: with its files.
        target: what is opened of it.
        read: opens it.
        options: for that.
        what: was done to it.
        refused: whether it must be.
        whole: the digest that it must have if it is read; empty where any will do.
    """

    name: str
    row: str
    folder: Path
    target: str
    read: Callable[..., Read]
    options: dict[str, Any]
    what: str
    refused: bool = False
    whole: str = ""

    def work(self) -> Outcome:
        path = Path(self.target) if self.target.startswith("~") else self.folder / self.target
        return self.read(path, **self.options)

    @property
    def size(self) -> int:
        """Bytes of its files."""
        return sum(f.stat().st_size for f in self.folder.rglob("*") if f.is_file() and not f.is_symlink())

    def fault(self, outcome: Outcome) -> str:
        """Which of `FAULTS` it shows; empty for none."""
        kind = outcome["kind"]
        if kind == "opened" and (self.refused or not outcome["sane"] or self.whole not in ("", outcome["digest"])):
            return "silent"
        if kind in FAULTS:
            return str(kind)
        if outcome["peak"] > BLOAT and self.size < SMALL:
            return "bloat"
        return "long" if outcome.get("length", 0) > LONGEST_MESSAGE else ""


@dataclass
class Finding:
    """A fault, and how often it was met; the first input that shows it is kept."""

    fault: str
    case: Case
    outcome: Outcome
    kept: str = ""
    times: int = 1

    def __str__(self) -> str:
        told = " ".join(str(self.outcome.get(key, "")) for key in ("type", "where"))
        used = f"{self.outcome['peak'] / 1e9:.2f} GB, {self.outcome['seconds']:.1f} s"
        said = repr(str(self.outcome.get("message", ""))[:140])
        name = f"{self.fault:7}×{self.times:<5}{self.case.name:28}"
        return f"{name} {told} {said} [{self.case.what[:100]}] {used} {self.kept}"


@dataclass
class Run:
    """A run.

    Args:
        seed: what cases are drawn from.
        room: folder for their files, made by `rooms`.
        timeout: seconds until a case hangs.
        jobs: how many at once.
        report: folder that keeps the first input of each fault; None for none.
    """

    seed: int
    room: Path
    timeout: float = 20
    jobs: int = 1
    report: Path | None = None
    counts: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    findings: dict[tuple[str, ...], Finding] = field(default_factory=dict)
    caught: Counter[str] = field(default_factory=Counter)
    wholes: dict[str, str] = field(default_factory=dict)

    def make_seeds(self, names: Iterable[str]) -> list[str]:
        """Make the seeds of formats, and open them.

        Returns:
            The formats whose seeds are read; others are faults of their own.
        """
        folders = {name: self._folder("seeds", name) for name in names}
        _make((FORMATS[name].seed, folder) for name, folder in folders.items())
        for name, folder in folders.items():
            made = FORMATS[name]
            case = Case(name, name, folder, made.target, made.read, made.options, "the seed itself")
            outcome = alone(case.work)
            if outcome["kind"] == "opened":
                self.wholes[name] = outcome["digest"]
            else:
                self._note("leak", case, outcome)
        return list(self.wholes)

    def bombs(self, names: list[str]) -> Iterator[Case]:
        """Bombs, the files of some made at once."""
        for start in range(0, len(names), BOMBS_AT_ONCE):
            some = {name: self._folder("bombs", name) for name in names[start : start + BOMBS_AT_ONCE]}
            _make((BOMBS[name].make, folder) for name, folder in some.items())
            for name, folder in some.items():
                made = BOMBS[name]
                yield Case(name, "bombs", folder, made.target, made.read, made.options, name, made.refused)

    def mutant(self, name: str, number: int) -> Case:
        """A seed changed, from the run's seed, the format and the number alone."""
        made, rng = FORMATS[name], Random(f"{self.seed}/{name}/{number}")
        folder = self._folder("cases", f"{name} {number}")
        shutil.rmtree(folder)
        shutil.copytree(self._folder("seeds", name), folder, symlinks=True)
        what, must = MUTATE.get(name, mutations.mutated)(folder, made.checked, rng)
        whole = self.wholes[name] if must else ""
        return Case(f"{name}:{number}", name, folder, made.target, made.read, made.options, what, whole=whole)

    def mutants(self, names: list[str]) -> Iterator[Case]:
        """Mutants of all formats in turn, without end."""
        if names:
            yield from (self.mutant(name, number) for number in itertools.count() for name in names)

    def go(self, cases: Iterator[Case], seconds: float) -> None:
        """Open cases until there are no more, or the time is up."""
        began, running = time.monotonic(), dict[Child, Case]()
        with selectors.DefaultSelector() as picker:

            def ended(child: Child, kill: bool) -> None:
                picker.unregister(child.pipe)
                self._judge(running.pop(child), child.end(kill))

            more = True
            while more or running:
                while more and len(running) < self.jobs:
                    case = next(cases, None) if time.monotonic() - began < seconds else None
                    if case is None:
                        more = False
                        break
                    child = Child(case.work)
                    running[child] = case
                    picker.register(child.pipe, selectors.EVENT_READ, child)
                for key, _ in picker.select(0.2):
                    if not key.data.hear():
                        ended(key.data, kill=False)
                for child in [each for each in running if time.monotonic() - each.began > self.timeout]:
                    ended(child, kill=True)

    def _folder(self, *names: str) -> Path:
        folder = self.room.joinpath(*(re.sub(r"\W", "_", name) for name in names))
        folder.mkdir(parents=True, exist_ok=True)
        return folder

    def _judge(self, case: Case, outcome: Outcome) -> None:
        fault = case.fault(outcome)
        self.counts[case.row].update(["inputs", fault or outcome["kind"]])
        if fault:
            self._note(fault, case, outcome)
        elif "where" in outcome:
            self.counts[case.row]["caught"] += 1
            self.caught[f"{outcome['type']} {outcome['where']}"] += 1
        shutil.rmtree(case.folder, ignore_errors=True)

    def _note(self, fault: str, case: Case, outcome: Outcome) -> None:
        """Count a fault; the first of a kind keeps its files."""
        format_of = "" if fault == "leak" else case.name.partition(":")[0]
        key = (fault, format_of, outcome.get("type", ""), outcome.get("where", ""))
        if key in self.findings:
            self.findings[key].times += 1
            return
        finding = self.findings[key] = Finding(fault, case, outcome)
        if self.report is not None and case.size < 20e6:
            kept = self.report / f"{len(self.findings):04d}-{fault}-{re.sub(r'[^a-zA-Z0-9]', '_', case.name)}"
            shutil.rmtree(kept, ignore_errors=True)
            with contextlib.suppress(OSError, shutil.Error):  # pipes are not copied
                shutil.copytree(case.folder, kept, symlinks=True)
            finding.kept = str(kept)

    @property
    def total(self) -> Counter[str]:
        """Counts of all formats together."""
        return sum(self.counts.values(), Counter())

    def __str__(self) -> str:
        names = ("inputs", "opened", "refused", "caught", *FAULTS)
        lines = [f"{'format':16}" + "".join(f"{name:>8}" for name in names)]
        for row, counts in self.counts.items():
            lines.append(f"{row:16}" + "".join(f"{counts[name]:8}" for name in names))
        lines += [
            "",
            *map(str, sorted(self.findings.values(), key=lambda one: (FAULTS.index(one.fault), -one.times))),
        ]
        if self.caught:
            lines += ["", "refused at the boundary, not by a reader:"]
            lines += [f"{times:6} {what}" for what, times in self.caught.most_common(25)]
        total = self.total
        return "\n".join([*lines, f"{total['inputs']} inputs: " + ", ".join(f"{total[f]} {f}" for f in FAULTS)])


@contextlib.contextmanager
def rooms() -> Iterator[Path]:
    """A folder in memory if there is room, that is taken away again."""
    shared = Path("/dev/shm")
    base = shared if shared.is_dir() and shutil.disk_usage(shared).free > 2**30 else None
    with tempfile.TemporaryDirectory(prefix="vcc-fuzz-", dir=base, ignore_cleanup_errors=True) as room:
        yield Path(room)


def _make(makers: Iterable[tuple[Maker, Path]]) -> None:
    """Fill folders in a child: threads that libraries start would be in the way of forks."""

    def work() -> Outcome:
        for maker, folder in makers:
            maker(folder)
        return {}

    outcome = alone(work, limit=False)
    if outcome["kind"] != "opened":
        raise RuntimeError(f"files for the fuzzer could not be made: {outcome}")
