"""The light field behind a diffuser: `lf.scattered`, the paper's convolution ⊗ (section 3.2.2).

Oracles: conservation; the sum over deflections of prisms, which is the definition of a kernel; Gaussians, which
scatter to Gaussians in closed form.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

import vcc
from vcc import Affine
from vcc.base.units import m, mm
from vcc.shapes.kernels import Gaussian, Kernel, Radial, Samples, TopHat

VIEWS, PIXELS, SPACING, SLOPE = (3, 4), (18, 22), (2 * mm, 1.5 * mm), (2e-3, 1e-3)


def random_field(channels: int | None = None, dtype: str = "float32", seed: int = 0) -> vcc.LightField:
    shape = (*VIEWS, *PIXELS) if channels is None else (*VIEWS, *PIXELS, channels)
    samples = np.random.default_rng(seed).random(shape)
    values = (255 * samples).astype(np.uint8) if dtype == "uint8" else samples.astype(dtype)
    return vcc.LightField.from_views(values, SPACING, SLOPE, focus_distance=0.7 * m)


LOPSIDED = Samples([[0.0, 0.1, 0.0, 0.05], [0.2, 0.0, 0.3, 0.0], [0.05, 0.0, 0.0, 0.3]], 2.3e-3)
KERNELS = {
    "gaussian": Gaussian((2e-3, 5e-3)),
    "disc": TopHat(7e-3),
    "square": TopHat(7e-3, "square"),
    "cone": Radial((0, 6e-3), (1, 0), normalise=True),
    "samples": LOPSIDED,
}
FRAMES = {
    "as taken": Affine.identity(),
    "behind a lens": Affine.lens(50 * mm),
    # rows of pixels become columns; pixels at an angle to the views
    "turned": Affine(
        np.array([[1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, 0, -1, 0.1], [0, 0, 1, 0, 0], [0, 0, 0, 0, 1]])
    ),
    "askew": Affine(
        np.array([[1, 0.1, 0, 0, 0], [0, 1, 0, 0, 0], [0, 2, 0.8, 0.5, 0], [0, 0, -0.4, 1.1, 0], [0, 0, 0, 0, 1]])
    ),
}


def inner(scattered: vcc.LightField, before: vcc.LightField) -> vcc.LightField:
    """The samples of a scattered field that the field before it had too."""
    high, wide = ((scattered.shape[axis] - before.shape[axis]) // 2 for axis in (2, 3))
    return scattered[:, :, high : high + before.shape[2], wide : wide + before.shape[3]]


@pytest.mark.parametrize("kernel", KERNELS.values(), ids=KERNELS)
@pytest.mark.parametrize(
    "field", [random_field(), random_field(3), random_field(dtype="uint8")], ids=["", "rgb", "8 bit"]
)
def test_no_light_is_lost(kernel, field):
    scattered = field.scattered(vcc.Diffuser(kernel))
    # float32 samples, each right to 6e-8, summed in float64
    assert scattered.flux == pytest.approx(field.flux, rel=1e-6)
    assert scattered.values.dtype == np.float32
    assert scattered.full_scale == 1


@dataclass(frozen=True)
class Rays(Kernel):
    """A few rays: slopes (n, 2) and their shares."""

    slopes: tuple[tuple[float, float], ...]
    shares: tuple[float, ...]

    @property
    def reach(self):
        return tuple(np.abs(self.slopes).max(axis=0))

    def quadrature(self, points=256):
        return np.array(self.slopes), np.array(self.shares)

    def deflections(self, xi, eta):
        raise NotImplementedError

    def density(self, s, t):
        raise NotImplementedError


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
def test_a_diffuser_is_a_sum_of_prisms(frame):
    """Also that light moves by +δ, in frames of every orientation: a prism of δ is the oracle."""
    rays = Rays(((2.1e-3, 0.0), (-0.4e-3, 7.7e-3), (5.3e-3, -3e-3), (1e-3, 1.5e-3)), (0.1, 0.2, 0.3, 0.4))
    field = random_field().transformed(frame)
    scattered = field.scattered(vcc.Diffuser(rays))
    total = np.zeros(scattered.shape)
    for slopes, share in zip(rays.slopes, rays.shares, strict=True):
        bent = field.transformed(Affine.prism(slopes))
        total += share * bent.resampled(scattered.frame, scattered.shape[:4]).values
    # both interpolate the same samples linearly; float32 of values up to 1
    np.testing.assert_allclose(scattered.values, total, rtol=0, atol=1e-6)


def test_the_diffuser_of_one_ray_is_a_prism():
    # 3 samples across and 5 down, so that samples fall on samples; pixels count against slopes
    slopes = (-3 * SLOPE[1], 5 * SLOPE[0])
    field = random_field()
    scattered = field.scattered(vcc.Diffuser(Rays((slopes,), (1.0,))))
    bent = field.transformed(Affine.prism(slopes))
    into = scattered.frame.inverse() @ bent.frame
    assert into.linear == pytest.approx(np.eye(4), abs=1e-9)
    i, j, k, l = np.rint(into.offset).astype(int)
    assert (i, j) == (0, 0)
    moved = scattered.values[:, :, l : l + PIXELS[0], k : k + PIXELS[1]]
    assert moved == pytest.approx(field.values, abs=1e-6)
    assert scattered.flux == pytest.approx(field.flux, rel=1e-6)


def test_a_kernel_off_its_middle_is_the_centred_one_behind_a_prism():
    # cells of one sample across and half a sample down, the array's middle 2 columns and 2 rows off
    shares = np.random.default_rng(1).dirichlet(np.ones(9)).reshape(3, 3)
    off = np.zeros((7, 7))
    off[:3, 4:] = shares
    pitch = 1e-3
    field = random_field()
    aside = field.scattered(vcc.Diffuser(off, pitch))
    bent = field.scattered(vcc.Diffuser(shares, pitch)).transformed(Affine.prism((2 * pitch, -2 * pitch)))
    np.testing.assert_allclose(
        aside.values, bent.resampled(aside.frame, aside.shape[:4]).values, rtol=0, atol=1e-6
    )


def blob(sigma: float, pixels: int = 161) -> vcc.LightField:
    """A Gaussian of ``sigma`` samples in slope, in two views that differ in brightness."""
    x = np.arange(pixels) - pixels // 2
    line = np.exp(-(x**2) / (2 * sigma**2)) / (math.sqrt(2 * math.pi) * sigma)
    values = np.outer(line, line)[None, None] * np.array([1.0, 0.5])[:, None, None, None]
    return vcc.LightField.from_views(values, 1 * mm, SLOPE)


def test_a_gaussian_scatters_to_a_gaussian_and_two_in_a_row_add_their_variances():
    first, second = Gaussian((6 * SLOPE[1], 4 * SLOPE[0])), Gaussian((3 * SLOPE[1], 5 * SLOPE[0]))
    field = blob(10.0)
    once = field.scattered(vcc.Diffuser(first))
    twice = once.scattered(vcc.Diffuser(second))
    cut = 0.99893  # variance of a Gaussian that ends at 4 σ
    for scattered, across, down in (
        (once, 100 + 36 * cut + 1 / 6, 100 + 16 * cut + 1 / 6),
        (twice, 100 + (36 + 9) * cut + 2 / 6, 100 + (16 + 25) * cut + 2 / 6),  # 1/6: linear between samples
    ):
        y, x = (np.arange(n) - n // 2 for n in scattered.shape[2:4])
        truth = np.outer(
            np.exp(-(y**2) / (2 * down)) / math.sqrt(2 * math.pi * down),
            np.exp(-(x**2) / (2 * across)) / math.sqrt(2 * math.pi * across),
        )
        # The cut leaves the kernel's fourth cumulant at −0.0139 σ⁴ instead of 0: 3/24 of that over the square of
        # the whole variance, 0.0139 · 36² / 8 / 136² = 1.2e-4 of the peak for each axis; the tent's is less.
        assert scattered.values[0, 0] == pytest.approx(truth, abs=3e-4 * truth.max())
        assert scattered.values[1, 0] == pytest.approx(truth / 2, abs=3e-4 * truth.max())


def test_two_gaussians_in_a_row_are_one_of_the_root_of_their_squares():
    a, b = 4 * SLOPE[1], 3 * SLOPE[1]
    field = blob(10.0)
    twice = field.scattered(vcc.Diffuser(Gaussian(a))).scattered(vcc.Diffuser(Gaussian(b)))
    once = field.scattered(vcc.Diffuser(Gaussian(math.hypot(a, b))))
    rows, columns = (np.array(twice.shape[2:4]) - once.shape[2:4]) // 2
    same = twice.values[:, :, rows : rows + once.shape[2], columns : columns + once.shape[3]]
    # interpolated once more: 1/6 of a sample's square on 125 changes the peak by 1/6/125 and all else by less;
    # down, where samples are twice as wide, 1/6 on 106: 3e-3 of the peak together, and the cut 1e-4
    assert same == pytest.approx(once.values, abs=3.2e-3 * float(once.values.max()))


def test_a_kernel_far_below_a_sample_changes_nothing():
    field = random_field(3)
    scattered = field.scattered(vcc.Diffuser([[1.0]], slope_pitch=1e-10))
    # it moves 1e-10/4 of slope, 2.5e-8 of a sample, at most; float32 rounds to 6e-8
    np.testing.assert_allclose(inner(scattered, field).values, field.values, rtol=0, atol=2e-7)
    assert inner(scattered, field).frame.isclose(field.frame)


def test_uniform_light_stays_uniform_but_at_the_border():
    field = vcc.LightField.from_views(np.ones((2, 2, 30, 40), np.float32), SPACING, SLOPE)
    scattered = inner(field.scattered(vcc.Diffuser(TopHat(8e-3))), field)
    np.testing.assert_allclose(scattered.values[:, :, 2:-2, 4:-4], 1, rtol=0, atol=1e-6)
    assert scattered.values[:, :, 0].max() < 0.7  # beyond the given pictures it is dark


def test_the_rim_absorbs_like_a_mask():
    field = random_field(3)
    rim = 5 * mm
    for decentre in ((0, 0), (1 * mm, -0.5 * mm)):
        diffuser = vcc.Diffuser(LOPSIDED, diameter=rim, decentre=decentre)
        stopped = field.masked(vcc.Mask(pattern=vcc.patterns.Circle(rim), decentre=decentre))
        assert field.scattered(diffuser).flux == pytest.approx(stopped.flux, rel=1e-6)
        assert stopped.flux < 0.9 * field.flux
        after = stopped.scattered(vcc.Diffuser(LOPSIDED))
        np.testing.assert_allclose(field.scattered(diffuser).values, after.values, rtol=0, atol=1e-6)


def test_pieces_scatter_as_the_whole_does():
    field, diffuser = (
        random_field(),
        vcc.CodedDiffuser(Gaussian(1.0), width=9 * mm, widths=[[2e-3, 5e-3]], height=9 * mm),
    )
    whole = field.scattered(diffuser)
    # the left view has the narrowest kernel of all, and so fewer samples around it
    piece = field[1:, :1].scattered(diffuser)
    rows, columns = ((whole.shape[axis] - piece.shape[axis]) // 2 for axis in (2, 3))
    assert rows > 0
    same = whole[1:, :1, rows : rows + piece.shape[2], columns : columns + piece.shape[3]]
    np.testing.assert_allclose(same.values, piece.values, rtol=0, atol=1e-6)
    assert same.frame.isclose(piece.frame)


# --- coded diffusers ---


@pytest.mark.parametrize("kernel", KERNELS.values(), ids=KERNELS)
def test_a_coded_diffuser_that_is_alike_everywhere_is_a_diffuser(kernel):
    field = random_field()
    plain = field.scattered(vcc.Diffuser(kernel, width=20 * mm))
    stretched = field.scattered(vcc.CodedDiffuser(kernel, width=20 * mm, widths=np.ones((2, 2))))
    mixed = field.scattered(vcc.CodedDiffuser((kernel, kernel), width=20 * mm, weights=np.full((2, 3, 3), 0.5)))
    for coded in (stretched, mixed):
        assert coded.frame == plain.frame
        np.testing.assert_allclose(coded.values, plain.values, rtol=0, atol=1e-6)


def test_each_view_is_scattered_by_the_kernel_at_its_place():
    field = random_field(3)
    # the map is the plane σ = 3e-3 + 0.5·(x − 1 mm) + 0.2·(y + 0.5 mm), in metres, at the middles of its cells
    middle = (np.arange(4) - 1.5) * 3 * mm
    decentre = (1 * mm, -0.5 * mm)
    sigmas = 3e-3 + 0.5 * middle[None, :] + 0.2 * middle[:, None]
    coded = vcc.CodedDiffuser(Gaussian(1.0), width=12 * mm, widths=np.maximum(sigmas, 0), decentre=decentre)
    scattered = field.scattered(coded)
    assert scattered.flux == pytest.approx(field.flux, rel=1e-6)
    for j, i in np.ndindex(*VIEWS):
        x, y = (
            (n - (size - 1) / 2) * step for n, size, step in zip((i, j), VIEWS[::-1], SPACING[::-1], strict=True)
        )
        sigma = 3e-3 + 0.5 * (x - decentre[0]) + 0.2 * (y - decentre[1])
        alone = field[j : j + 1, i : i + 1].scattered(vcc.Diffuser(Gaussian(sigma)))
        rows, columns = ((scattered.shape[axis] - alone.shape[axis]) // 2 for axis in (2, 3))
        there = scattered.values[j, i, rows : rows + alone.shape[2], columns : columns + alone.shape[3]]
        assert there == pytest.approx(alone.values[0, 0], abs=1e-6)


def test_kernels_mix_by_their_weights_at_each_view():
    field = random_field()
    ramp = np.linspace(0, 1, 5)[None, :]
    kernels = (Gaussian(4e-3), LOPSIDED)
    width = 10 * mm  # cells of 2 mm, whose middles reach to ±4 mm: the ramp is ½ + x/8 mm
    coded = vcc.CodedDiffuser(kernels, width=width, height=20 * mm, weights=np.stack([1 - ramp, ramp]))
    scattered = field.scattered(coded)
    parts = [field.scattered(vcc.Diffuser(kernel)) for kernel in kernels]
    assert parts[0].shape[3] > parts[1].shape[3]
    assert scattered.shape == parts[0].shape
    total = np.zeros(scattered.shape)
    for part, sign in zip(parts, (-1, 1), strict=True):
        share = 0.5 + sign * (np.arange(4) - 1.5) * SPACING[1] / (8 * mm)
        rows, columns = ((scattered.shape[axis] - part.shape[axis]) // 2 for axis in (2, 3))
        inside = total[:, :, rows : rows + part.shape[2], columns : columns + part.shape[3]]
        inside += share[None, :, None, None] * part.values
    np.testing.assert_allclose(scattered.values, total, rtol=0, atol=1e-6)


def test_where_the_width_is_zero_light_passes_unscattered():
    field = random_field()
    coded = vcc.CodedDiffuser(Gaussian(1.0), width=8 * mm, height=8 * mm, widths=[[0.0, 0.0, 0.0, 6e-3]])
    scattered = inner(field.scattered(coded), field)
    # cells' middles at ±1 and ±3 mm, views at ±0.75 and ±2.25 mm
    np.testing.assert_allclose(scattered.values[:, :3], field.values[:, :3], rtol=0, atol=1e-6)
    assert abs(scattered.values[:, 3] - field.values[:, 3]).max() > 0.1


# --- bad input ---


def test_a_field_that_flew_is_refused_with_the_way_out():
    diffuser = vcc.Diffuser(Gaussian(1e-3), name="ground glass")
    with pytest.raises(
        vcc.InputError, match=r'diffuser "ground glass" cannot .* depend on the pixel.*lf\.resampled'
    ):
        random_field().transformed(Affine.propagation(10 * mm)).scattered(diffuser)


def test_what_does_not_scatter_or_bends_is_refused():
    with pytest.raises(vcc.InputError, match="lens at z = 0 mm does not scatter"):
        random_field().scattered(vcc.Lens(focal_length=50 * mm))

    class FrostedLens(vcc.Lens):
        def faces(self):
            return vcc.Faces(deflection=Affine.lens(self.focal_length), scatter=Gaussian(1e-3))

    with pytest.raises(vcc.InputError, match="frosted lens at z = 0 mm also bends rays"):
        random_field().scattered(FrostedLens(focal_length=50 * mm))


def test_too_wide_a_kernel_and_too_much_memory_are_refused():
    with pytest.raises(vcc.InputError, match=r'diffuser "wide": the kernel gaussian .* covers 80001 steps'):
        random_field().scattered(vcc.Diffuser(Gaussian((10.0, 1e-3)), name="wide"))
    with pytest.raises(vcc.InputError, match=r"the light field behind diffuser .* of shape 3×4×38×62 needs 110"):
        random_field().scattered(vcc.Diffuser(TopHat(4e-2)), memory_limit=50_000)
