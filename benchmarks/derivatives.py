"""Derivatives of pictures to all parameters of random cameras, against differences of the pictures: a table.

    pip install .
    python benchmarks/derivatives.py                     # 25 cameras of each kind, by footprints
    python benchmarks/derivatives.py --kind "two masks" --seed 5 --cameras 1

For each number of each element and of the sensor (`vcc.learn.parameters`), the derivative of a weighted sum of the
picture by the chain rule and the way back of the reference, and central differences of the same sum with steps of
1e-6, 1e-5 and 1e-4 of the number's scale: plans whose decisions are kept, pictures in double precision. The table
counts those that agree to 1e-3 at all three steps, those that do at two, the others, and those that are refused.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import Counter
from dataclasses import replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import numpy as np

import vcc
from tests.physics.random_cameras import AFFINE, Case, drawn
from vcc.learn.chain import Chain
from vcc.learn.parameters import names, read
from vcc.learn.scales import scale
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.plan.operators import finished
from vcc.run.backwards import back
from vcc.run.drive import Drive

HOW = How(engine="reference")
STEPS = (1e-6, 1e-5, 1e-4)
AGREE = 1e-3
MOST = 6
"""Numbers of a parameter that are looked at: of masks with many cells some."""


class Compared:
    """A random camera before its light field, and a weighted sum of its picture."""

    def __init__(self, case: Case) -> None:
        named = [replace(element, name=f"e{n}") for n, element in enumerate(case.camera.elements)]
        self.camera = vcc.Camera(named, case.camera.sensor)
        values = case.light_field.values.astype(np.float64)
        self.light_field = vcc.LightField(values, case.light_field.frame, case.disparities, case.sample)
        shape = (*case.camera.sensor.shape, *values.shape[4:])
        self.weights = np.random.default_rng(4).standard_normal(shape)

    def summed(self, plan: Plan) -> tuple[float, float]:
        """The weighted sum of the picture, and what rounding may make of it."""
        drive = Drive(plan, self.light_field, HOW)
        picture = finished(plan.after, drive.summed(drive.blocks).values).reshape(self.weights.shape)
        terms = self.weights * picture
        return float(terms.sum()), 1e-14 * float(np.abs(terms).sum())

    def derivatives(self, name: str) -> Counter[str]:
        """How the numbers of a parameter fare."""
        try:
            chain = Chain(self.camera, self.light_field.grid, HOW, [name])
            plan = chain.plan()
            wanted = [number for number in chain.followed()[name] if not number.endswith("half_widths")]
            given = back(plan, self.light_field, self.weights, HOW, samples_wanted=False, wanted=wanted).gradients
            pulled = chain.pull({}, given)[name]
            here, unit = read(self.camera, name), scale(self.camera, name)
            return Counter(
                self._fares(chain, name, here, index, float(pulled[index]) * unit, unit)
                for index in list(np.ndindex(here.shape))[:MOST]
            )
        except vcc.InputError:
            return Counter(["refused"])

    def _fares(
        self, chain: Chain, name: str, here: np.ndarray, index: tuple[int, ...], found: float, unit: float
    ) -> str:
        agree = 0
        for step in STEPS:
            sides = []
            for side in (1, -1):
                there = here.copy()
                there[index] += side * step * unit
                sides.append(self.summed(chain.plan({name: there})))
            slope = (sides[0][0] - sides[1][0]) / (2 * step)
            agree += abs(found - slope) <= AGREE * abs(slope) + sides[0][1] / step
        return {3: "agree", 2: "at two steps"}.get(agree, "do not")


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kind", choices=AFFINE)
    parser.add_argument("--seed", type=int, default=0, help="of the first camera")
    parser.add_argument("--cameras", type=int, default=25, help="of each kind")
    given = parser.parse_args()
    warnings.simplefilter("ignore", vcc.ResultWarning)
    words = ("agree", "at two steps", "do not", "refused")
    print(
        "| camera | cameras | numbers | " + " | ".join(words) + " | which not |\n|---|---|---|---|---|---|---|---|"
    )
    missed = False
    for kind in [given.kind] if given.kind else AFFINE:
        total: Counter[str] = Counter()
        which: list[str] = []
        for seed in range(given.seed, given.seed + given.cameras):
            compared = Compared(drawn(kind, seed, pixels=8, views=4))
            for name in names(compared.camera):
                found = compared.derivatives(name)
                total += found
                which += [f"{seed}: {name}"] * (found["do not"] > 0)
        missed |= total["do not"] > 0
        counts = " | ".join(str(total[each]) for each in words)
        print(f"| {kind} | {given.cameras} | {total.total()} | {counts} | {', '.join(which)} |", flush=True)
    return int(missed)


if __name__ == "__main__":
    sys.exit(main())
