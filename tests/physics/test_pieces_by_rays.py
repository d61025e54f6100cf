"""By rays, too, the images of pieces of a light field add up to the image of the whole, however it is cut.

The oracle is linearity: an image is linear in the samples, so what a piece adds is the image of the whole with all
other samples dark. Tolerance 1e-5 of the brightest pixel, as in `test_chunks`: float32 sums in another order.
"""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.store import save_store

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

SHAPE = (4, 5, 9, 10)
FOCUS = 1 / (1 / 50e-3 - 1)
SENSOR = vcc.Sensor(FOCUS, (20, 22), FOCUS * 2e-3)
LENS = vcc.Lens(focal_length=50 * mm, diameter=9 * mm)
WIDTHS = np.random.default_rng(1).random((6, 6))

CAMERAS = {
    "no stop": vcc.Camera([vcc.Lens(focal_length=50 * mm)], SENSOR),
    "coded diffuser": vcc.Camera(
        [LENS, vcc.CodedDiffuser(vcc.kernels.Gaussian(0.01), 12 * mm, widths=WIDTHS, z=20 * mm)], SENSOR
    ),
    "lenslets": vcc.Camera([LENS, vcc.LensArray(1 * mm, 5 * mm, z=FOCUS - 5 * mm)], SENSOR),
}


def light_field(kind: type = np.float32) -> vcc.LightField:
    samples = np.random.default_rng(0).random(SHAPE).astype(np.float32)
    if kind == np.uint8:
        samples = np.round(255 * samples).astype(np.uint8)
    return vcc.LightField.from_views(samples, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))


def blocks(seed: int) -> list[tuple[slice, ...]]:
    """A grid cut at random places along all four axes."""
    generator = np.random.default_rng(seed)
    axes = []
    for size in SHAPE:
        places = sorted(set(generator.integers(1, size, generator.integers(0, 3)).tolist()))
        axes.append([slice(a, b) for a, b in itertools.pairwise([0, *places, size])])
    return list(itertools.product(*axes))


def image(camera: vcc.Camera, lf: vcc.LightField, **options) -> np.ndarray:
    return camera.capture(lf, method="rays", samples=16, **options).values.astype(float)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("no stop", {}),
        ("no stop", {"interpolation": "linear"}),
        ("coded diffuser", {"between_views": "none"}),
        ("lenslets", {}),
        ("lenslets", {"interpolation": "linear"}),
    ],
)
def test_pieces_cut_along_all_axes_add_up(name, options):
    camera, lf = CAMERAS[name], light_field()
    whole = image(camera, lf, **options)
    total = sum(image(camera, lf[piece], **options) for piece in blocks(1))
    assert np.abs(total - whole).max() < 1e-5 * whole.max()


@pytest.mark.parametrize("axis", range(4), ids=["v", "u", "t", "s"])
def test_single_slices_and_pieces_of_pieces_add_up(axis):
    camera, lf = CAMERAS["coded diffuser"], light_field()
    whole = image(camera, lf)
    first = (slice(None),) * axis
    singles = [lf[(*first, slice(n, n + 1))] for n in range(SHAPE[axis])]
    assert np.abs(sum(image(camera, one) for one in singles) - whole).max() < 1e-5 * whole.max()
    left, right = lf[(*first, slice(0, 3))], lf[(*first, slice(3, None))]
    parts = [left[(*first, slice(0, 1))], left[(*first, slice(1, None))], right]
    assert np.abs(sum(image(camera, one) for one in parts) - whole).max() < 1e-5 * whole.max()


def test_a_piece_adds_what_the_whole_is_with_all_else_dark():
    camera, lf = CAMERAS["coded diffuser"], light_field()
    piece = (slice(1, 3), slice(2, 4), slice(3, 9), slice(0, 7))
    dark = np.zeros(SHAPE, np.float32)
    dark[piece] = lf.values[piece]
    whole = image(camera, lf.replaced(dark))
    np.testing.assert_allclose(image(camera, lf[piece]), whole, rtol=0, atol=1e-6 * whole.max())
    by_reference = image(camera, lf[piece], engine="reference")
    np.testing.assert_allclose(by_reference, whole, rtol=0, atol=1e-5 * whole.max())


def test_bytes_add_up_to_what_they_are_rounded_to():
    """8 bits are sharpened to 2⁻⁵ of a level and rounded: the two parts and the whole to ½ of that each."""
    camera, lf = CAMERAS["coded diffuser"], light_field(np.uint8)
    whole = image(camera, lf)
    for axis, size in enumerate(SHAPE):
        first = (slice(None),) * axis
        total = image(camera, lf[(*first, slice(0, size // 2))]) + image(
            camera, lf[(*first, slice(size // 2, None))]
        )
        light = image(camera, lf.replaced(np.full(SHAPE, 255, np.uint8)))
        assert (np.abs(total - whole) <= 1.5 * 2.0**-5 / 255 * light + 1e-5 * whole.max()).all()


def test_pieces_that_others_run_are_the_same(tmp_path):
    camera, lf = CAMERAS["coded diffuser"], light_field()
    piece = lf[1:3, 2:, 2:9, 1:]
    here = image(camera, piece)
    with ThreadPoolExecutor(2) as pool:
        there = image(camera, piece, executor=pool)
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-6 * here.max())
    stored = save_store(lf, tmp_path / "field.zarr", chunks=4)
    np.testing.assert_array_equal(image(camera, stored[1:3, 2:, 2:9, 1:]), here)
    np.testing.assert_allclose(image(camera, stored, memory_limit=2**22), image(camera, lf), rtol=0, atol=1e-6)


@pytest.mark.parametrize("rows_each", [1, 3])
def test_blocks_of_rows_of_a_piece_add_up(monkeypatch, rows_each):
    """Blocks of some rows of pixels, each with a border of its own: ahead and, as adjoint, back."""
    from vcc.run import drive
    from vcc.run.blocks import Blocks

    camera, piece = CAMERAS["coded diffuser"], light_field()[1:3, 2:, 2:9, 1:]
    here = image(camera, piece)
    weights = np.random.default_rng(2).random(SENSOR.shape)
    back = camera.operator(piece, method="rays", samples=16).T(weights.astype(np.float32))

    def cut(used, grid, need, limit):
        nv, nu, nt, ns = grid.shape[:4]
        return Blocks((0, nv), (0, nu), nt, ns, 1, 2, rows_each)

    monkeypatch.setattr(drive, "cut_evenly", cut)
    monkeypatch.setattr("vcc.run.backwards.cut_evenly", cut)
    with ThreadPoolExecutor(2) as pool:
        there = image(camera, piece, executor=pool)
        other = camera.operator(piece, method="rays", samples=16).T(weights.astype(np.float32), executor=pool)
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-6 * here.max())
    np.testing.assert_allclose(other, back, rtol=0, atol=1e-6 * np.abs(back).max())


def test_the_adjoint_of_a_piece_is_the_adjoint_of_the_whole_there():
    camera, lf = CAMERAS["coded diffuser"], light_field()
    index = (slice(1, 3), slice(2, 4), slice(3, 9), slice(0, 7))
    weights = np.random.default_rng(2).random(SENSOR.shape).astype(np.float32)
    whole = camera.operator(lf, method="rays", samples=16).T(weights)
    piece = camera.operator(lf[index], method="rays", samples=16).T(weights)
    np.testing.assert_allclose(piece, whole[index], rtol=0, atol=1e-6 * np.abs(whole).max())


def test_gradients_of_pieces_by_torch_are_those_of_the_whole():
    torch = pytest.importorskip("torch")
    camera, lf = CAMERAS["coded diffuser"], light_field()
    index = (slice(1, 3), slice(2, 4), slice(3, 9), slice(0, 7))
    values = torch.tensor(lf.values, requires_grad=True)
    weights = torch.tensor(np.random.default_rng(2).random(SENSOR.shape), dtype=torch.float32)
    whole = camera.capture(lf.replaced(values), method="rays", samples=16).values
    part = camera.capture(lf.replaced(values)[index], method="rays", samples=16).values
    (of_whole,) = torch.autograd.grad((whole * weights).sum(), values)
    (of_part,) = torch.autograd.grad((part * weights).sum(), values)
    np.testing.assert_allclose(of_part[index], of_whole[index], rtol=0, atol=1e-5 * float(of_whole.abs().max()))
