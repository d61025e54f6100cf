"""Sheets of lenslets: where they stand, and how large their openings can be."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.base.errors import InputError
from vcc.base.units import mm, um
from vcc.optics.plenoptic import Plenoptic


@pytest.mark.parametrize(("layout", "covered"), [("square", np.pi / 4), ("hexagonal", np.pi / 12**0.5)])
def test_discs_cover_so_much_of_their_cells_at_most(layout, covered):
    """Of diameter 1 in cells of area 1 and √3/2."""
    options = {"layout": layout, "circular": True}
    vcc.LensArray(1 * mm, 5 * mm, fill_factor=covered, **options)
    with pytest.raises(InputError, match=f"discs cover at most {covered:.4f}"):
        vcc.LensArray(1 * mm, 5 * mm, fill_factor=covered + 1e-4, **options)


@pytest.mark.parametrize("lenslets", [(5, 8), (6, 7)])
def test_the_axis_goes_through_the_middle_of_the_lenslets(lenslets):
    """Of an odd number the middle one stands on the axis; of an even number two stand half a pitch off it."""
    optics = Plenoptic(
        focal_length=50 * mm, f_number=4, lenslet_pitch=100 * um, pixels_per_lenslet=5, lenslets=lenslets,
        focus_distance=1.0,
    )  # fmt: skip
    _, array = optics.elements
    assert array.offset == tuple(0.0 if count % 2 else 50 * um for count in lenslets[::-1])
    assert optics.sensor(None).shape == (5 * lenslets[0], 5 * lenslets[1])
