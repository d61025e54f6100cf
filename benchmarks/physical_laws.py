"""Physical laws and brute force on random cameras of all elements: a table, and exit code 1 where one fails.

    pip install .
    python benchmarks/physical_laws.py                                      # 330 cameras; 66 by brute force
    python benchmarks/physical_laws.py --kind "one mask" --seed 5 --cameras 1   # one camera again, with words
    python benchmarks/physical_laws.py --colour 100                         # cameras that see colour, instead

Cameras, laws and the tracer are those of tests/physics (`random_cameras.py`, `laws.py`, `random_tracer.py`), of
which a part runs in the tests. The laws are held on pictures of about 16 pixels a side, brute force on 32 (20
where rays are traced). All by default options, but for 256 rays a pixel where brute force is held against rays.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
import warnings
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

import vcc
from tests.physics.laws import LAWS, Check, brute_force, dark
from tests.physics.random_cameras import BENT, KINDS, drawn
from tests.physics.random_colour import at_random


def checks(kind: str, seed: int, laws: list[str], by_force: bool) -> Iterator[Check]:
    """All checks of one camera; what raises is a check that fails."""
    try:
        case = drawn(kind, seed, 16, 9)
    except RuntimeError:  # asks for views that are too large to be held
        return
    if dark(case):
        return
    for law in laws:
        try:
            yield from LAWS[law](case)
        except Exception as error:
            yield Check(law, kind, seed, float("nan"), 0.0, f"raises {type(error).__name__}: {error}")
            if not isinstance(error, vcc.InputError):
                traceback.print_exc()
    if by_force:
        try:
            yield from brute_force(drawn(kind, seed, 20 if kind in BENT else 32))
        except Exception as error:
            yield Check("brute force", kind, seed, float("nan"), 0.0, f"raises {type(error).__name__}: {error}")
            traceback.print_exc()


def table(found: list[Check]) -> str:
    """Markdown: per law and kind the number of checks and failures, and the worst margin with its seed."""
    groups: dict[tuple[str, str], list[Check]] = defaultdict(list)
    for check in found:
        groups[check.law, check.kind].append(check)
    lines = ["| law | camera | checks | failures | worst margin | seed | there |", "|---|---|---|---|---|---|---|"]
    for (law, kind), group in sorted(groups.items()):
        worst = min(group, key=lambda check: check.margin)
        failed = sum(not check.holds for check in group)
        margin = "equal" if worst.error == 0 else f"{worst.margin:+.1f} dB"
        note = worst.note if len(worst.note) < 90 else worst.note[:87] + "…"
        lines.append(f"| {law} | {kind} | {len(group)} | {failed or ''} | {margin} | {worst.seed} | {note} |")
    return "\n".join(lines)


def coloured(first: int, count: int) -> int:
    """Brute force on cameras that see direction and colour; the exit code."""
    reached, failed, number = [], 0, first
    while len(reached) < count:
        try:
            camera = at_random(number)
            if camera.dark:
                continue
        except RuntimeError:  # asks for views that are too large to be held
            continue
        finally:
            number += 1
        here, required, note = camera.reached()
        failed += here < required
        reached.append(here)
        print(f"{'FAILS' if here < required else 'holds'} {note}", flush=True)
    quarters = np.percentile(reached, [0, 25, 50, 75, 100]).round(1).tolist()
    print(f"{count} cameras, {failed} failures; dB, quartiles: {quarters}")
    return 1 if failed else 0


def main() -> int:
    """Run, print, and say by the exit code whether all holds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cameras", type=int, default=330, help="how many, over all kinds (330)")
    parser.add_argument("--brute-force", type=int, default=66, help="of how many of them by brute force, too (66)")
    parser.add_argument("--seed", type=int, default=0, help="the first (0)")
    parser.add_argument("--kind", choices=KINDS, help="one kind of camera only")
    parser.add_argument("--law", choices=[*LAWS, "brute force"], help="one law only")
    parser.add_argument("--colour", type=int, default=0, help="so many cameras that see colour, instead (0)")
    given = parser.parse_args()
    kinds = [given.kind] if given.kind else list(KINDS)
    each, forced = -(-given.cameras // len(kinds)), -(-given.brute_force // len(kinds))
    laws = [law for law in LAWS if given.law in (None, law)]
    by_force = given.law in (None, "brute force")
    # What a light field lacks is stated in warnings, and is no matter of laws.
    warnings.simplefilter("ignore", vcc.ResultWarning)
    if given.colour:
        return coloured(given.seed, given.colour)
    found: list[Check] = []
    started = time.perf_counter()
    for number in range(each):
        for kind in kinds:
            if number == 0 and each == 1:
                print(drawn(kind, given.seed, 16, 9).described())
            for check in checks(kind, given.seed + number, laws, by_force and number < forced):
                found.append(check)
                if not check.holds or each == 1 or check.law == "brute force":
                    verdict = "holds" if check.holds else "FAILS"
                    print(
                        f"{verdict} {check.law}, {check.kind} {check.seed}: {check.error:.2e}, allowed "
                        f"{check.allowed:.2e} ({check.margin:+.1f} dB); {check.note}"
                    )
        seconds = time.perf_counter() - started
        print(f"-- {(number + 1) * len(kinds)} cameras, {len(found)} checks, {seconds:.0f} s", flush=True)
    failed = sum(not check.holds for check in found)
    print(f"\n{table(found)}\n\n{len(found)} checks on {each * len(kinds)} cameras, {failed} failures")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
