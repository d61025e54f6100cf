"""By how much views are made sharper before rays look them up; see `vcc.plan.operators.SharpenViews`."""

from __future__ import annotations

from vcc.fields.grid import Sample
from vcc.plan.operators import WEIGHT_DIGITS
from vcc.plan.sharpening import MEAN, TENT, along_axis

SOFTENED: dict[Sample, int] = {"point": TENT, "mean": TENT + MEAN}
"""How many times the averaging over a sample, sinc(f), stands in what is looked up: twice by interpolation, once
more in samples that are means over their pixels."""


def sharpening(sample: Sample) -> tuple[int, int, int]:
    """Weights of a sample, of each of its neighbours and of those beyond, along k and along l, in 2⁻¹⁰.

    Those of a picture whose samples are as large as its pixels (`vcc.plan.sharpening`), rounded.
    """
    outer, inner = (round(float(weight) * 2**WEIGHT_DIGITS) for weight in along_axis(SOFTENED[sample], 1.0)[:2])
    return 2**WEIGHT_DIGITS - 2 * inner - 2 * outer, inner, outer
