"""Mutation score: of random faults put into the code one at a time, how many the tests find.

    pip install ".[test]" cosmic-ray pytest-cov
    python benchmarks/mutation.py                          # 300 faults in five rooms: about an hour on two cores
    python benchmarks/mutation.py --rooms recover --faults 60 --seed 1
    python benchmarks/mutation.py --only optics/lens.py:120    # the faults of one line, with their tests' output

Faults are those of Cosmic Ray: another operator, comparison, number, a condition turned round, a loop left out. A
fault of a room is looked for by the tests of that room which run its line (as coverage.py sees it), and once more
by all tests with ``--all-tests``. Messages, annotations, representations, and code compiled by Numba are left out.
Nothing is written into this checkout: faults are put into copies.
"""

from __future__ import annotations

import argparse
import ast
import os
import queue
import random
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from tqdm import tqdm

ROOT = Path(__file__).resolve().parents[1]
ROOMS = {
    "optics": ("optics",),
    "plan": ("plan",),
    "engines": ("engines/reference.py", "engines/reference_back.py", "engines/reference_ray_gradients.py"),
    "run": ("run",),
    "recover": ("recover",),
}
"""Folders and files of each, under src/vcc; its tests stand in tests/ under the same name."""
LONGEST = 300.0
"""Seconds for the tests of one fault: a fault that takes longer (an endless loop) is found."""
UNTOLD = ("VariableReplacer", "VariableInserter", "ExceptionReplacer", "RemoveDecorator")
"""Cosmic Ray's faults that are left out: the first two need arguments, the others hit refusals and caches."""


@dataclass(frozen=True)
class Fault:
    """One fault: where, and what becomes of the line.

    Args:
        room: to which the file belongs.
        file: under src/vcc.
        operator: Cosmic Ray's.
        number: how many times the operator applies in the file before.
        line: where it begins.
        column: likewise.
    """

    room: str
    file: str
    operator: str
    number: int
    line: int
    column: int

    def code(self, source: str) -> str:
        """The file's text with this fault in it."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        return str(mutate_code(source, get_operator(self.operator)(), self.number))


@dataclass
class Found:
    """What came out for a fault: by which tests it was found, "" where by none."""

    fault: Fault
    was: str
    became: str
    by: str = ""
    tests: int = 0
    output: str = field(default="", repr=False)


def drawn(faults: list[Fault], number: int, seed: int) -> list[Fault]:
    """Some faults at random, one a place: an operator can be replaced by twelve others, a number by two."""
    choice = random.Random(seed)
    places: dict[tuple[str, int, int], list[Fault]] = {}
    for fault in faults:
        places.setdefault((fault.file, fault.line, fault.column), []).append(fault)
    return choice.sample([choice.choice(each) for each in places.values()], min(number, len(places)))


def files_of(room: str) -> list[Path]:
    """The files of a room, sorted."""
    base = ROOT / "src" / "vcc"
    found: list[Path] = []
    for each in ROOMS[room]:
        found += sorted((base / each).rglob("*.py")) if (base / each).is_dir() else [base / each]
    return found


def faults_of(room: str) -> Iterator[Fault]:
    """All faults that can be put into a room."""
    from cosmic_ray.ast import ast_nodes, get_ast
    from cosmic_ray.plugins import get_operator, operator_names

    operators = [(n, get_operator(n)()) for n in sorted(operator_names()) if not n.endswith(UNTOLD)]
    for path in files_of(room):
        source = path.read_text(encoding="utf-8")
        excluded, nodes = _excluded(source), list(ast_nodes(get_ast(source)))
        file = str(path.relative_to(ROOT / "src" / "vcc"))
        for name, operator in operators:
            places = [place for node in nodes for place in operator.mutation_positions(node)]
            for number, ((line, column), _) in enumerate(places):
                if not any(first <= (line, column) < last for first, last in excluded):
                    yield Fault(room, file, name, number, line, column)


def _excluded(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """From where to where messages, annotations, representations and imports stand, and what Numba compiles."""
    found: list[ast.AST] = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Import | ast.ImportFrom | ast.Assert):
            found.append(node)
        elif isinstance(node, ast.ClassDef):
            found += node.decorator_list
        elif isinstance(node, ast.FunctionDef):
            compiled = any("compiled" in ast.unparse(d) or "njit" in ast.unparse(d) for d in node.decorator_list)
            if compiled or node.name in ("__repr__", "__str__"):
                found.append(node)
            found += [*node.decorator_list, *([node.returns] if node.returns else [])]
        elif isinstance(node, ast.arg | ast.AnnAssign) and node.annotation is not None:
            found.append(node.annotation)
        elif isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            found.append(node)
    return [((n.lineno, n.col_offset), (n.end_lineno, n.end_col_offset)) for n in found]  # type: ignore[attr-defined]


def copied(to: Path) -> Path:
    """A copy of the checkout's tracked files, and of what is new in it."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=ROOT, capture_output=True, check=True,
    ).stdout.decode()  # fmt: skip
    for name in filter(None, listed.split("\0")):
        if (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, to / name)
    return to


def run_tests(copy: Path, tests: list[str], *options: str, seconds: float) -> tuple[int, str]:
    """Exit code and output of some tests in a copy; 1 where they take too long."""
    listed = copy / "tests-to-run.txt"
    listed.write_text("\n".join(tests))
    command = [sys.executable, "-m", "pytest", "-q", "-x", "--no-header", "-p", "no:cacheprovider", *options]
    environment = os.environ | {"PYTHONPATH": str(copy / "src"), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(
            [*command, f"@{listed}"],
            cwd=copy,
            env=environment,
            capture_output=True,
            text=True,
            timeout=None if seconds == float("inf") else seconds,
        )
    except subprocess.TimeoutExpired:
        return 1, "took too long"
    return done.returncode, done.stdout + done.stderr


def tests_by_line(copy: Path, room: str, cores: int) -> dict[str, dict[int, list[str]]]:
    """By file and line of a room the tests that run it, the quickest to say so first; "" for imports."""
    from coverage import CoverageData

    data = copy / f".coverage.{room}"
    settings = copy / "coverage-settings.ini"
    settings.write_text(f"[run]\ndata_file = {data}\n")
    code, output = run_tests(
        copy, [f"tests/{room}"], f"--cov={copy / 'src' / 'vcc'}", f"--cov-config={settings}", "--cov-context=test",
        "--cov-report=", "-n", str(cores), seconds=float("inf"),
    )  # fmt: skip
    if code != 0:
        sys.exit(f"the tests of {room} fail without any fault:\n{output[-3000:]}")
    read = CoverageData(str(data))
    read.read()
    found: dict[str, dict[int, list[str]]] = {}
    for path in files_of(room):
        file = str(path.relative_to(ROOT / "src" / "vcc"))
        lines = read.contexts_by_lineno(str(copy / "src" / "vcc" / file))
        found[file] = {
            line: sorted({c.split("|")[0] for c in contexts}, key=lambda c: (c == "", c))
            for line, contexts in lines.items()
        }
    return found


def lines_of_statement(source: str, line: int) -> range:
    """The lines of the innermost statement at a line: coverage counts its first line only."""
    inner = range(line, line + 1)
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or node.lineno):
            last = node.body[0].lineno if hasattr(node, "body") else (node.end_lineno or node.lineno) + 1
            if line < last:
                inner = range(node.lineno, last)
    return inner


def looked_for(fault: Fault, copy: Path, lines: dict[int, list[str]], all_tests: bool) -> Found:
    """Put a fault in, run the tests, and take it out again."""
    path = copy / "src" / "vcc" / fault.file
    source = path.read_text(encoding="utf-8")
    faulty = fault.code(source)
    changed = [
        (old, new) for old, new in zip(source.splitlines(), faulty.splitlines(), strict=False) if old != new
    ]
    was, became = changed[0] if changed else ("", "")
    found = Found(fault, was.strip(), became.strip())
    tests = {test for line in lines_of_statement(source, fault.line) for test in lines.get(line, [])}
    # What runs while modules are imported may be met by any test of the room.
    chosen = [f"tests/{fault.room}"] if "" in tests else sorted(tests)
    found.tests = len(tests - {""})
    path.write_text(faulty, encoding="utf-8")
    try:
        if chosen:
            code, found.output = run_tests(copy, chosen, seconds=LONGEST)
            found.by = "its room" if code else ""
        if all_tests and not found.by:
            code, found.output = run_tests(copy, ["tests"], "-n", "2", seconds=4 * LONGEST)
            found.by = "other tests" if code else ""
    finally:
        path.write_text(source, encoding="utf-8")
    return found


def table(found: list[Found]) -> str:
    """Markdown: faults by room and how many are found."""
    lines = ["| room | faults | found by its tests | by other tests | by none |", "|---|---|---|---|---|"]
    rooms = [room for room in ROOMS if any(each.fault.room == room for each in found)]
    for room in [*rooms, "all"]:
        by = Counter(each.by for each in found if room in (each.fault.room, "all"))
        number = sum(by.values())
        share = f"{by['its room']} ({100 * by['its room'] / max(number, 1):.0f} %)"
        lines.append(f"| {room} | {number} | {share} | {by['other tests']} | {by['']} |")
    return "\n".join(lines)


def main() -> int:
    """Draw, look, and print; exit code 1 below nine of ten."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS), help="which (all five)")
    parser.add_argument("--faults", type=int, default=300, help="how many, over all rooms (300)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (0)")
    parser.add_argument("--cores", type=int, default=2, help="copies in which faults are looked for (2)")
    parser.add_argument("--all-tests", action="store_true", help="look for what is left by all tests, too")
    parser.add_argument("--only", metavar="FILE:LINE", help="all faults of one line under src/vcc")
    given = parser.parse_args()
    every = [fault for room in given.rooms for fault in faults_of(room)]
    if given.only:
        file, _, line = given.only.rpartition(":")
        faults = [fault for fault in every if (fault.file, str(fault.line)) == (file, line)]
    else:
        faults = drawn(every, given.faults, given.seed)
    print(f"{len(faults)} of {len(every)} faults", flush=True)

    began = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="faults-") as folder:
        copies: queue.Queue[Path] = queue.Queue()
        for n in range(given.cores):
            copies.put(copied(Path(folder) / str(n)))
        first = Path(folder) / "0"
        rooms = sorted({fault.room for fault in faults})
        lines: dict[str, dict[int, list[str]]] = {}
        for room in tqdm(rooms, desc="which tests run which lines"):
            lines |= tests_by_line(first, room, given.cores)
        waiting: queue.Queue[Fault] = queue.Queue()
        for fault in faults:
            waiting.put(fault)
        found: list[Found] = []
        bar = tqdm(total=len(faults), desc="faults")

        def work() -> None:
            copy = copies.get()
            while True:
                try:
                    fault = waiting.get_nowait()
                except queue.Empty:
                    return
                each = looked_for(fault, copy, lines[fault.file], given.all_tests)
                found.append(each)
                if not each.by or given.only:
                    tqdm.write(
                        f"{'found by ' + each.by if each.by else 'NOT FOUND'}: {fault.file}:{fault.line} "
                        f"({each.tests} tests)\n    {each.was}\n    {each.became}"
                    )
                bar.update()

        threads = [threading.Thread(target=work) for _ in range(given.cores)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        bar.close()
    print(f"\n{table(found)}\n\n{time.perf_counter() - began:.0f} s")
    return 0 if sum(each.by == "its room" for each in found) >= 0.9 * len(found) else 1


if __name__ == "__main__":
    sys.exit(main())
