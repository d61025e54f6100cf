"""Silly and hostile values for a bench: in every place of a document, and in messages that no front end sends.

``python -m tests.bench.hostile --seconds 600 --seed 7`` says what ended in a fault of the program or in a warning
that is not about a picture, and what took long; `tests/bench/test_hostile.py` runs some. A seed is
a run.

"""

from __future__ import annotations

import argparse
import copy
import logging
import random
import sys
import time
import warnings
from collections.abc import Iterator
from itertools import islice
from typing import Any

import vcc
from tests.bench.on_bench import CAMERA, START, Client, offered
from vcc.bench import additions
from vcc.bench.document import Document
from vcc.bench.inbox import CHANGES, QUESTIONS

Json = Any
LONG = 5.0
"""Seconds, from which on it is told how long an answer took."""

LENGTHS = [
    *("1e300 m", "-1e300 m", "nan m", "inf m", "-inf m", "0 mm", "-0 mm", "-5 mm", "1e-300 m", "5e-324 m", "1 km"),
    *("1e9 km", "1e308 km", "1e-9 m", "53 mm", "26 mm", "25.999999999999 mm", "5 kg", "5", "mm", "5 mm; 3"),
    "5 mm " * 20_000,
]
NUMBERS = [0, -0.0, -1, 0.5, 1, 2, 3, 7, 100, 1000, 10**6, 1e9, 1e30, -1e30, 1e-30, 1e300, -1e300, 1e-300, 5e-324]
NUMBERS += [2**31, 2**63, 2**64, 10**400]
WORDS = [
    "",
    " ",
    "x" * 100_000,
    "\0",
    "é",
    "../../etc/passwd",
    "/dev/zero",
    "nan",
    "inf",
    "circle",
    "mura",
    "RGGB",
]
LISTS: list[Json] = [
    [],
    [[]],
    [0],
    [1, 2],
    [1, 2, 3],
    [0] * 5000,
    [[0, 1], [1]],
    [[0] * 300] * 300,
    [["1 um"]],
    [{}],
]
LISTS += [[None], ["1 mm", "-1 mm"], ["1 mm"] * 119, [[[1, 0], [0, 1]]] * 3, [[-1, 2], [1e300, 5e-324]], [[True]]]
OTHERS: list[Json] = [
    None,
    True,
    False,
    {},
    {"name": "circle"},
    {"name": "x"},
    {"name": {}},
    {"kind": "lens"},
    {"": {}},
]


def deep(levels: int) -> Json:
    """Lists in lists."""
    leaf: Json = 0
    for _ in range(levels):
        leaf = [leaf]
    return leaf


VALUES = [*LENGTHS, *NUMBERS, *WORDS, *LISTS, *OTHERS, deep(90), deep(900)]


def cameras() -> list[Json]:
    """Tables of cameras that a bench takes: each kind of element, pattern, kernel and surface; electronics."""
    described = START.train(offered().beside)
    elements = [
        additions.new_element(kind["kind"], z, described.train, set())
        for kind in additions.kinds()
        if kind["addable"] and kind["parameters"]  # lenses by name do not fit everywhere
        for z in ("26 mm", "0 mm")
    ]
    found = [{**CAMERA, "elements": [*CAMERA["elements"], each]} for each in elements]  # type: ignore[misc]
    for noun, kind in (("pattern", "mask"), ("kernel", "diffuser"), ("surface", "phase_plate")):
        entry = additions.new_element(kind, "26 mm", described.train, set())
        tables = {**CAMERA, "elements": [*CAMERA["elements"], entry]}  # type: ignore[misc]
        as_written = Document(tables, "noise").train(offered().beside)
        for member in additions.families()[noun]:
            changed, where = Document(tables, "noise"), ["elements", 2, noun]
            for place, value in additions.made_whole(where, {"name": member["kind"]}, tables, as_written):
                changed = changed.changed(place, value)
            found.append(dict(changed.camera))
    electronics = {"quantum_efficiency": 0.6, "color_filter": "RGGB", "read_noise": 2.0}
    return [*found, {**CAMERA, "sensor": {**CAMERA["sensor"], "electronics": electronics}}]  # type: ignore[dict-item]


Place = tuple[str | int, ...]


def places(tree: Json, path: Place = ()) -> Iterator[tuple[Place, Json]]:
    """All places in a tree, not too deep, and what stands there."""
    if path:
        yield path, tree
    entries = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, each in entries if len(path) < 12 else ():
        yield from places(each, (*path, key))


def with_value(tree: Json, path: Place, value: Json) -> Json:
    """The tree with another value in a place."""
    step, rest = path[0], path[1:]
    changed = dict(tree) if isinstance(tree, dict) else list(tree)
    changed[step] = with_value(tree[step], rest, value) if rest else value  # type: ignore[index,call-overload]
    return changed


def documents(chance: random.Random) -> Iterator[Json]:
    """Documents with one or two values that make no sense, for ever."""
    known = cameras()
    fields = {entry["kind"]: [each["name"] for each in entry["parameters"]] for entry in additions.kinds()}
    of_sensor = [each["name"] for each in additions.sensor_parameters()]
    while True:
        camera = copy.deepcopy(chance.choice(known))
        last, sensor = camera["elements"][-1], camera["sensor"]
        if chance.random() < 0.2:
            last[chance.choice(fields[last["kind"]])] = chance.choice(VALUES)
        if chance.random() < 0.1:
            sensor[chance.choice(of_sensor)] = chance.choice(VALUES)
        given = {**START.as_json(), "camera": camera, "noise": "electronics" in sensor and chance.random() < 0.5}
        for _ in range(chance.choice([1, 1, 1, 2])):
            path, there = chance.choice(
                [each for each in places(given) if chance.random() < 0.05 or len(each[0]) > 1]
            )
            pool = VALUES
            if isinstance(there, str) and " " in there and chance.random() < 0.6:
                pool = LENGTHS
            elif type(there) in (int, float) and chance.random() < 0.6:
                pool = NUMBERS
            given = with_value(given, path, chance.choice(pool))
        yield {"do": "load", "document": given}


ASKED = [
    "where",
    "value",
    "kind",
    "z",
    "element",
    "by",
    "what",
    "x",
    "y",
    "on",
    "document",
    "toml",
    "gallery",
    "name",
]
ASKED += ["number", "look", "ends", "from", "to", "frames", "format", "frames_per_second", "distance", "moving"]
PATHS: list[Json] = [
    ["elements", 1, "pattern"],
    ["sensor", "z"],
    ["elements", 0],
    ["elements"],
    ["sensor", "pitch"],
]
PATHS += [
    ["sensor", "shape"],
    ["elements", 0, "focal_length"],
    ["exposure"],
    ["noise"],
    ["views"],
    ["sensor", "focus"],
]
WHATS = [
    "explain",
    "point spread",
    "mtf",
    "phase space",
    "film",
    "toml",
    "python",
    "png",
    "exr",
    "gif",
    "lens",
    "mask",
]


def messages(chance: random.Random) -> Iterator[Json]:
    """Messages whose fields hold anything, for ever."""
    while True:
        message: Json = {"do": chance.choice(CHANGES + QUESTIONS)}
        if message["do"] in ("set", "upload"):
            message["where"] = chance.choice(PATHS)
        if message["do"] in ("ask", "export", "add"):
            message["kind" if message["do"] == "add" else "what"] = chance.choice(WHATS)
        for name in chance.sample(ASKED, chance.choice([0, 1, 2, 3])):
            message[name] = chance.choice([*VALUES, *PATHS, *WHATS, 0, 1, 2, 5])
        yield message


class Watched:
    """A client that notices faults: what it is told, what the log has, warnings that are not about results."""

    def __init__(self) -> None:
        self.client = Client()
        self.words: list[str] = []
        self._logged = logging.Handler()
        self._faults: list[str] = []
        self._logged.emit = lambda record: self._faults.append(  # type: ignore[method-assign]
            logging.Formatter("%(message)s").format(record)
        )
        self._log = logging.getLogger("vcc.bench")
        self._log.addHandler(self._logged)
        self.client.do("hello")
        self._answered(0)

    def fault(self, message: Json) -> str | None:
        """What went wrong with a message; None where it was done, or refused in words, which are kept."""
        self._faults.clear()
        self.words.clear()
        self.client.told.clear()
        self.client.session.receive(message, [b"junk"] if message["do"] == "upload" else [])
        self._answered(1)
        told = [each for each, _ in self.client.told]
        self.words = [each["words"] for each in told if each["is"] in ("refused", "no picture")]
        failed = [each["words"] for each in told if each["is"] == "failed"]
        empty = [f"no words: {each}" for each in self.words if len(each) > 1500 or len(each) < 10]
        return next(iter([*self._faults, *failed, *empty]), None)

    def _answered(self, number: int) -> None:
        """Wait until all that was asked has been answered, a picture included."""
        session = self.client.session
        while session._inbox or session._wanted is not None:
            time.sleep(0.001)
        with self.client._changed:
            before = len(self.client.told)
        self.client.do("value", x=-1 - number, y=-1)  # which is refused after all that was before
        while not any(each.get("do") == "value" for each, _ in self.client.told[before:]):
            time.sleep(0.001)
        if session._inbox or session._wanted is not None:
            self._answered(number + 1)

    def close(self) -> None:
        """Go."""
        self._log.removeHandler(self._logged)
        self.client.close()


def faults(
    given: Iterator[Json], most: int, say: Any = None, until: float = float("inf")
) -> list[tuple[str, Json]]:
    """What goes wrong with so many messages: words, and the message."""
    found: list[tuple[str, Json]] = []
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", vcc.ResultWarning)  # of rays that are missing
        watched = Watched()
        for message in islice(given, most):
            began = time.perf_counter()
            fault = watched.fault(message)
            if fault is not None:
                found.append((fault, message))
            if say is not None:
                say(fault, watched.words, time.perf_counter() - began, message)
            if time.perf_counter() > until:
                break
        watched.close()
    return found


def main() -> None:
    """Try for so long, and say what was found."""
    asked = argparse.ArgumentParser(description=main.__doc__)
    asked.add_argument("--seconds", type=float, default=60)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--what", choices=("documents", "messages"), default="documents")
    asked.add_argument("--words", action="store_true", help="also what is refused, once each")
    given = asked.parse_args()
    said: set[str] = set()
    count = 0

    def say(fault: str | None, words: list[str], seconds: float, message: Json) -> None:
        nonlocal count
        count += 1
        for each in words if given.words else ():
            if each[:60] not in said:
                said.add(each[:60])
                print("-", each)
        if fault is not None and fault[-300:] not in said:
            said.add(fault[-300:])
            print(f"{'=' * 20} {fault}\n{str(message)[:1500]}", flush=True)
        if seconds > LONG:
            print(f"{seconds:.0f} s: {str(message)[:1500]}", flush=True)

    tried = {"documents": documents, "messages": messages}[given.what](random.Random(given.seed))
    found = faults(tried, sys.maxsize, say, time.perf_counter() + given.seconds)
    print(f"{count} tried, {len(found)} faults")


if __name__ == "__main__":
    main()
