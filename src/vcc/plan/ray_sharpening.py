"""By how much views are made sharper before rays look them up; see `vcc.engines.sharpening`."""

from __future__ import annotations

from vcc.light_field import Sample

DIGITS = 10
"""Weights are whole numbers of 2⁻¹⁰: what is even stays so to the bit, and 8-bit samples are filtered exactly."""
REACH = 2
"""Samples on each side that a filtered sample takes in."""
SOFTENED: dict[Sample, int] = {"point": 2, "mean": 3}
"""How many times the averaging over a sample, sinc(f), stands in what is looked up: twice by interpolation, once
more in samples that are means over their pixels."""


def sharpening(sample: Sample) -> tuple[int, int, int]:
    """Weights of a sample, of each of its neighbours and of those beyond, along k and along l, in 2⁻¹⁰.

    1 − (p/24) Δ + (p(p + 1)/1152 − p/1920 + p/288) Δ², the expansion of 1/sincᵖ(f), with p = 2 or 3.
    """
    p = SOFTENED[sample]
    second = p / 24
    fourth = p * (p + 1) / 1152 - p / 1920 + p / 288
    outer, inner = round(fourth * 2**DIGITS), round((-second - 4 * fourth) * 2**DIGITS)
    return 2**DIGITS - 2 * inner - 2 * outer, inner, outer
