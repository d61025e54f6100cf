"""Random cameras that see direction and colour against brute force; `benchmarks/physical_laws.py --colour 100` has
more of them.
"""

from __future__ import annotations

import warnings

import pytest

import vcc
from tests.physics.random_colour import at_random

SOME = (0, 1, 9, 15, 16, 17, 19, 35)
"""Glass, facets, terms, louvres, masks of channels, filters, responses, photodiodes; by footprints and by rays."""


@pytest.mark.parametrize("number", SOME)
def test_random_cameras_that_see_colour_match_brute_force(number):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", vcc.ResultWarning)  # what a light field lacks is said there
        reached, required, note = at_random(number).reached()
    print(note)
    assert reached >= required, note
