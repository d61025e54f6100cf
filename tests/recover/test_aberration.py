"""Known aberrations taken out: views moved by whole pixels, and by fractions of them against a closed form."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.recover import without_aberration
from vcc.shapes.surfaces import Cubic, Tilt
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Waves

FOCUS = 1.2
TURNED = vcc.Affine.from_parts(
    np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0.6, 0.8], [0, 0, -0.8, 0.6]]) * 1e-3, np.zeros(4)
)


def test_views_are_moved_back_by_whole_pixels() -> None:
    values = np.random.default_rng(0).random((3, 3, 20, 24, 2), np.float32)
    field = vcc.LightField.from_views(values, 1 * mm, 0.01, FOCUS)
    # A plate that adds +0.03 along s: what came at s is found at s + 0.03. In pictures, s falls with the column.
    found = np.asarray(without_aberration(field, Tilt((0.03, -0.02))).values)
    np.testing.assert_allclose(found[:, :, 2:18, 3:21], values[:, :, 4:, :-6][:, :, :16, :18], atol=1e-5)


def test_each_view_is_moved_by_the_slope_at_its_place() -> None:
    """What a cubic plate adds, 3a·u² and 3a·v², is added to the light field in closed form, then taken out."""
    scene = PlanesScene([TexturedPlane(Waves(0.2, waves=6), 2.0)])
    plain = scene.light_field((5, 5), (60, 60), spacing=3 * mm, slope_per_pixel=4e-3, dtype="float32")
    plate = Cubic(100.0)  # 2.7 pixels at the outermost views
    slopes = (29.5 - np.arange(60)) * 4e-3
    spoilt = np.empty(plain.shape, np.float32)
    for row, column in np.ndindex(5, 5):
        u, v = (column - 2) * 3 * mm, (row - 2) * 3 * mm
        # Found at s is what came at s − Δs.
        came_t, came_s = np.meshgrid(
            slopes - 3 * plate.strength * v**2, slopes - 3 * plate.strength * u**2, indexing="ij"
        )
        places = np.full_like(came_s, u), np.full_like(came_s, v)
        spoilt[row, column] = scene.radiance_along(*places, came_s, came_t)[..., :3]
    found = np.asarray(without_aberration(plain.replaced(spoilt), plate).values)
    inner = np.s_[:, :, 8:-8, 8:-8]
    # 0.2 m at 2 m are waves of 25 pixels and more: cubic splines follow them to (2π/25)⁴/700 = 6·10⁻⁶ of them;
    # the rest is that a stored view is the mean over its pixels, and the closed form their middles: (π/25)²/6 of
    # amplitudes of 0.25 = 7·10⁻⁴.
    truth = np.asarray(plain.values)
    assert np.abs(found - truth)[inner].max() < 2e-3
    assert np.abs(spoilt - truth)[inner].max() > 0.1


@pytest.mark.parametrize(
    ("field", "plate", "message"),
    [
        (
            vcc.LightField.from_views(np.ones((2, 2, 8, 8)), 1 * mm, 0.01, FOCUS).transformed(
                vcc.Affine.lens(0.05)
            ),
            Tilt((0.2, 0.0)),
            "more than its width",
        ),
        (vcc.LightField(np.ones((2, 2, 8, 8)), TURNED), Tilt((0.01, 0.0)), "along the slopes"),
    ],
)
def test_what_cannot_be_is_refused(field: vcc.LightField, plate: Tilt, message: str) -> None:
    with pytest.raises(vcc.InputError, match=message):
        without_aberration(field, plate)


def test_a_store_is_refused() -> None:
    with pytest.raises(vcc.InputError, match="samples in memory"):
        without_aberration("store", Tilt((0.01, 0.0)))  # type: ignore[arg-type]
