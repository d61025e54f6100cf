"""Dot tests of operators and their adjoints on random cameras: a table, and exit code 1 where one fails.

    pip install .
    python benchmarks/dot_test.py                                        # 16 cameras of each of 11 kinds
    python benchmarks/dot_test.py --kind "one mask" --seed 5 --cameras 1   # one camera again

⟨A x, y⟩ and ⟨x, Aᵀ y⟩ of random x and y are the same number. The table has the largest share of it by which they
differ: at most 1e-6 in single precision (`numba`), 1e-12 in double (`reference`). Cameras are those of
tests/physics/random_cameras.py, by default options; what folds into one matrix is made by footprints and by rays.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import vcc
from tests.physics.random_cameras import AFFINE, KINDS, drawn
from tests.run.dots import dot_error

LARGEST = {"numba": 1e-6, "reference": 1e-12}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", choices=KINDS)
    parser.add_argument("--seed", type=int, default=0, help="of the first camera")
    parser.add_argument("--cameras", type=int, default=16, help="of each kind")
    parser.add_argument("--pixels", type=int, default=12)
    parser.add_argument("--views", type=int, default=5)
    given = parser.parse_args()
    warnings.simplefilter("ignore", vcc.ResultWarning)
    print("| camera | by | cameras | numba | seed | reference | seed |\n|---|---|---|---|---|---|---|")
    failed = False
    for kind in [given.kind] if given.kind else KINDS:
        cases = [drawn(kind, given.seed + n, given.pixels, given.views) for n in range(given.cameras)]
        for method in ("footprints", "rays") if kind in AFFINE else ("rays",):
            line = f"| {kind} | {method} | {len(cases)} |"
            for engine, largest in LARGEST.items():
                operators = (
                    each.camera.operator(each.light_field, method=method, engine=engine) for each in cases
                )
                worst, seed = max((dot_error(op), each.seed) for op, each in zip(operators, cases, strict=True))
                failed |= not worst <= largest
                line += f" {worst:.1e} | {seed} |"
            print(line, flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
