"""`vcc.kernels`: each is a density that integrates to 1, sampled truly, and laid on a lattice without loss.

Oracles: moments in closed form, Riemann sums over the density, and counting.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pytest

import vcc
from vcc.shapes.kernels import CUT, Gaussian, Kernel, Radial, Samples, TopHat

SHARES = np.array([[0.0, 0.1, 0.0, 0.05], [0.2, 0.0, 0.3, 0.0], [0.05, 0.0, 0.0, 0.3]])
PITCH = 2e-3


@dataclass(frozen=True)
class Moments:
    """Means of δs, δt, δs², δt², δs⁴, δt⁴."""

    mean: tuple[float, float]
    second: tuple[float, float]
    fourth: tuple[float, float]


def gaussian_moments(s: float, t: float) -> Moments:
    """Of the normal distribution cut at ±c: E z² = 1 − 2c·φ(c)/Z, E z⁴ = 3 − 2(c³ + 3c)·φ(c)/Z, by parts."""
    edge = math.exp(-(CUT**2) / 2) / math.sqrt(2 * math.pi) / math.erf(CUT / math.sqrt(2))
    second, fourth = 1 - 2 * CUT * edge, 3 - 2 * (CUT**3 + 3 * CUT) * edge
    return Moments((0, 0), (second * s**2, second * t**2), (fourth * s**4, fourth * t**4))


def samples_moments() -> Moments:
    """Each cell a box around its middle c of width p: E x² = c² + p²/12, E x⁴ = c⁴ + c²p²/2 + p⁴/80."""
    moments = []
    for shares in (SHARES.sum(axis=0), SHARES.sum(axis=1)):
        c = (np.arange(shares.size) - (shares.size - 1) / 2) * PITCH
        moments.append(
            (
                shares @ c,
                shares @ (c**2 + PITCH**2 / 12),
                shares @ (c**4 + c**2 * PITCH**2 / 2 + PITCH**4 / 80),
            )
        )
    return Moments(*((float(s), float(t)) for s, t in zip(*moments, strict=True)))


# A cone D = 3/(πR²)·(1 − r/R): E rᵖ = 6·(1/(p+2) − 1/(p+3))·Rᵖ, E δs² = E r²/2, E δs⁴ = 3/8·E r⁴.
R = 0.02
CASES: dict[str, tuple[Kernel, Moments]] = {
    "gaussian": (Gaussian(0.01), gaussian_moments(0.01, 0.01)),
    "gaussian of two widths": (Gaussian((0.01, 0.003)), gaussian_moments(0.01, 0.003)),
    "disc": (TopHat(0.04), Moments((0, 0), (R**2 / 4,) * 2, (R**4 / 8,) * 2)),
    "square": (TopHat(0.04, "square"), Moments((0, 0), (R**2 / 3,) * 2, (R**4 / 5,) * 2)),
    "cone": (
        Radial((0, R), (3 / (math.pi * R**2), 0)),
        Moments((0, 0), (0.15 * R**2,) * 2, (3 / 8 / 7 * R**4,) * 2),
    ),
    # A ring between R/2 and R, even: E r² = R²·(1 − 1/16)/2/(1 − 1/4), E r⁴ = R⁴·(1 − 1/64)/3/(1 − 1/4).
    "ring": (
        Radial((0, R / 2, R / 2 + 1e-12, R), (0, 0, 1, 1), normalise=True),
        Moments((0, 0), (R**2 * 0.9375 / 1.5 / 2,) * 2, (3 / 8 * R**4 * 0.984375 / 2.25,) * 2),
    ),
    "samples": (Samples(SHARES, PITCH), samples_moments()),
}
KERNELS = {name: kernel for name, (kernel, _) in CASES.items()}
each_kernel = pytest.mark.parametrize("kernel", KERNELS.values(), ids=KERNELS)


def riemann(kernel: Kernel, points: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Middles (s, t) of a fine grid over the kernel and the light in each of its cells, by the density alone."""
    s, t = (reach * (2 * (np.arange(points) + 0.5) / points - 1) for reach in kernel.reach)
    cell = 4 * kernel.reach[0] * kernel.reach[1] / points**2
    return s, t, kernel.density(s[None, :], t[:, None]) * cell


@each_kernel
def test_the_density_integrates_to_one_and_ends_at_the_reach(kernel):
    # 1200 cells a side: at an edge of a disc, up to 4·1200 of 1200² cells are cut, each wrong by half of itself at
    # random: √4800/2/1200² = 2e-5 of the square. Smooth kernels and squares: far less.
    assert riemann(kernel, 1200)[2].sum() == pytest.approx(1, abs=1e-4)
    s, t = kernel.reach
    assert not kernel.density([s * 1.001, -s * 1.001, 0, 0], [0, 0, t * 1.001, -t * 1.001]).any()


@pytest.mark.parametrize(("kernel", "moments"), CASES.values(), ids=CASES)
def test_even_points_become_deflections_with_the_moments_of_the_density(kernel, moments):
    # A point stands for a cell 1/n wide. Along each axis the map is monotone over the reach, so that a moment's
    # error is below its variation over the reach, 2·reachᵖ at most, times 1/2n for each axis of the square.
    n = 1024
    middle = (np.arange(n) + 0.5) / n
    s, t = kernel.deflections(middle[None, :], middle[:, None])
    for axis, slopes in enumerate((s, t)):
        reach = kernel.reach[axis]
        for power, truth in ((1, moments.mean), (2, moments.second), (4, moments.fourth)):
            assert np.mean(slopes**power) == pytest.approx(truth[axis], abs=2 * reach**power / n)


@pytest.mark.parametrize(("kernel", "moments"), CASES.values(), ids=CASES)
def test_the_quadrature_has_the_moments_of_the_density(kernel, moments):
    slopes, shares = kernel.quadrature(256)
    assert (shares >= 0).all()
    assert shares.sum() == pytest.approx(1, abs=1e-12)
    # Points in the middles of 256 even pieces miss their own spread, (2·reach/256)²/12 = 5e-6·reach² in squares
    # and 6·E[δ²] times that in fourth powers; where the Gaussian is cut, half of that again.
    reach = np.array(kernel.reach)
    assert shares @ slopes == pytest.approx(np.array(moments.mean), abs=1e-12)
    assert shares @ slopes**2 == pytest.approx(np.array(moments.second), abs=8e-6 * reach.max() ** 2)
    assert shares @ slopes**4 == pytest.approx(np.array(moments.fourth), abs=5e-5 * reach.max() ** 4)


@each_kernel
def test_even_points_become_deflections_with_the_shares_of_the_density(kernel):
    # The light to the left of and above a place: along each line of points the deflection is monotone, so that a
    # line misjudges a boundary by at most one of its n points; for `Samples` each row of cells adds one line.
    n = 1024
    middle = (np.arange(n) + 0.5) / n
    s, t = np.broadcast_arrays(*kernel.deflections(middle[None, :], middle[:, None]))
    at_s, at_t, light = riemann(kernel, 1200)
    for a, b in ((-0.7, 0.2), (-0.25, -0.3), (0.1, 0.05), (0.4, 0.8), (0.66, -0.5)):
        x, y = a * kernel.reach[0], b * kernel.reach[1]
        truth = light[np.ix_(at_t <= y, at_s <= x)].sum()
        # 1/n for either boundary. Those fall between cells of the oracle, which is right to 1e-4 (see above).
        assert np.mean((s <= x) & (t <= y)) == pytest.approx(truth, abs=2 / n + 1e-4)


@each_kernel
def test_deflections_stay_within_the_reach_even_at_the_corners_of_the_square(kernel):
    edge = np.array([0.0, 1e-16, 0.5, 1 - 1e-16, 1.0])
    s, t = np.broadcast_arrays(*kernel.deflections(edge[None, :], edge[:, None]))
    assert np.isfinite(s).all()
    assert np.isfinite(t).all()
    assert (np.abs(s) <= kernel.reach[0] * (1 + 1e-12)).all()
    assert (np.abs(t) <= kernel.reach[1] * (1 + 1e-12)).all()
    assert (kernel.density(s * (1 - 1e-9), t * (1 - 1e-9)) >= 0).all()


@pytest.mark.parametrize("name", [name for name in KERNELS if name != "samples"])
def test_deflections_rise_with_the_place_on_the_square(name):
    places = (np.arange(301) + 0.5) / 301
    s, t = np.broadcast_arrays(*KERNELS[name].deflections(places[None, :], places[:, None]))
    assert (np.diff(s, axis=1) >= 0).all()
    assert (np.diff(t, axis=0) >= 0).all()


def test_samples_send_no_light_into_empty_cells():
    kernel = KERNELS["samples"]
    points = np.random.default_rng(0).random((2, 100_000))
    points[:, :4] = [[0, 1, 0, 1], [0, 0, 1, 1]]
    s, t = kernel.deflections(*points)
    inside = 1 - 1e-9  # cells include their edges here, not in the density
    column, row = np.rint(s * inside / PITCH + 1.5).astype(int), np.rint(t * inside / PITCH + 1).astype(int)
    found = np.zeros(SHARES.shape)
    np.add.at(found, (row, column), 1 / s.size)
    assert (found[SHARES == 0] == 0).all()
    # 4 standard deviations of counting 100 000 random points
    assert np.abs(found - SHARES).max() < 4 * math.sqrt(0.25 / s.size)


# --- weights ---

MATRICES = {
    "a few steps": np.diag([400.0, 300.0]),
    "mirrored": np.diag([-400.0, 900.0]),
    "axes changed": np.array([[0.0, 500.0], [-700.0, 0.0]]),
    "turned and sheared": np.array([[600.0, 250.0], [-300.0, 400.0]]),
    "within a step": np.diag([15.0, 11.0]),
}


def tents(matrix: np.ndarray, kernel: Kernel, shape: tuple[int, int], points: int) -> np.ndarray:
    """∫ D(δ) tent(dx − x) tent(dy − y) dδ by a Riemann sum over the density."""
    s, t, light = riemann(kernel, points)
    x = matrix[0, 0] * s[None, :] + matrix[0, 1] * t[:, None]
    y = matrix[1, 0] * s[None, :] + matrix[1, 1] * t[:, None]
    total = np.zeros(shape)
    for row in range(shape[0]):
        in_row = light * np.maximum(1 - np.abs(row - shape[0] // 2 - y), 0)
        for column in range(shape[1]):
            total[row, column] = (in_row * np.maximum(1 - np.abs(column - shape[1] // 2 - x), 0)).sum()
    return total / light.sum()


@pytest.mark.parametrize("name", ["a few steps", "axes changed", "turned and sheared", "within a step"])
@pytest.mark.parametrize(
    "kernel", [Gaussian((0.003, 0.001)), TopHat(0.012), TopHat(0.01, "square"), Samples(SHARES, PITCH)]
)
def test_weights_are_the_integrals_of_the_density_times_tents(kernel, name):
    weights = kernel.weights(MATRICES[name])
    # 600 points a side, in the middles of even cells: 1/600² of the curvature, and at the edge of the disc the
    # √2400/2/600² = 7e-5 of the above, spread over all entries.
    assert weights == pytest.approx(tents(MATRICES[name], kernel, weights.shape, 600), abs=3e-5)


@pytest.mark.parametrize("matrix", MATRICES.values(), ids=MATRICES)
@pytest.mark.parametrize(("kernel", "moments"), CASES.values(), ids=CASES)
def test_weights_keep_all_light_and_its_mean_and_widen_by_the_tent(kernel, moments, matrix):
    weights = kernel.weights(matrix)
    assert weights.shape[0] % 2 == weights.shape[1] % 2 == 1
    assert (weights >= 0).all()
    assert weights.sum() == pytest.approx(1, abs=1e-9)
    y, x = (axis - size // 2 for axis, size in zip(np.indices(weights.shape), weights.shape, strict=True))
    mean = np.array([(weights * x).sum(), (weights * y).sum()])
    assert mean == pytest.approx(matrix @ moments.mean, abs=1e-9)
    # A light share at x steps between two lattice points, a after one: shared so, its square grows by a(1 − a), 0
    # to 1/4. The quadrature misses up to 8e-6 of the square of the reach (see above).
    second = matrix**2 @ np.array(moments.second)
    if name_of(kernel) == "samples":  # its axes are not independent
        c = [(np.arange(n) - (n - 1) / 2) * PITCH for n in SHARES.shape]
        second = second + 2 * matrix[:, 0] * matrix[:, 1] * (c[0] @ SHARES @ c[1])
    grown = np.array([(weights * x * x).sum(), (weights * y * y).sum()]) - second
    slack = 8e-6 * (np.abs(matrix) @ np.array(kernel.reach)) ** 2 + 1e-9
    assert (grown >= -slack).all()
    assert (grown <= 0.25 + slack).all()
    half = np.abs(matrix) @ np.array(kernel.reach)
    assert weights.shape == (2 * math.ceil(half[1] - 1e-9) + 1, 2 * math.ceil(half[0] - 1e-9) + 1)


def name_of(kernel: Kernel) -> str:
    return next(name for name, one in KERNELS.items() if one is kernel)


@pytest.mark.parametrize(
    ("kernel", "second"), [(Gaussian(1.0), gaussian_moments(1, 1).second[0]), (TopHat(2.0), 0.25)]
)
def test_weights_over_many_steps_have_the_variance_of_the_kernel_and_of_the_tent(kernel, second):
    for steps in (3.0, 30.0, 120.3):
        weights = kernel.weights(np.diag([steps, 2 * steps]))
        y, x = (axis - size // 2 for axis, size in zip(np.indices(weights.shape), weights.shape, strict=True))
        # a(1 − a) of the test above is 1/6 on average. Its first harmonic, 1/π², meets the kernel's spectrum at
        # one cycle a step, J₁(2πr)/πr < 0.1/r^1.5 for a disc of r steps, φ(4)/4πσ for the cut of the Gaussian;
        # the quadrature adds up to 8e-6 of the square of the reach (see above).
        tolerance = 0.1 / math.pi**2 / steps**1.5 + 1e-5 * steps**2
        assert (weights * x * x).sum() == pytest.approx(second * steps**2 + 1 / 6, abs=tolerance)
        assert (weights * y * y).sum() == pytest.approx(second * 4 * steps**2 + 1 / 6, abs=4 * tolerance)


def test_very_wide_kernels_are_made_coarsely_and_interpolated_without_loss():
    weights = TopHat(1.0).weights(np.diag([1300.0, 1300.0]))
    assert weights.sum() == pytest.approx(1, abs=1e-9)
    x = np.arange(weights.shape[1]) - weights.shape[1] // 2
    across = weights.sum(axis=0)
    assert across @ x == pytest.approx(0, abs=1e-9)
    # made on a lattice of 3 steps and interpolated: each adds the variance of a tent of 3 steps, 9/6
    assert across @ x**2 == pytest.approx(1300**2 / 16 + 2 * 9 / 6, abs=0.5)


@each_kernel
def test_a_kernel_far_within_a_step_stays_where_it_is(kernel):
    assert kernel.weights(np.zeros((2, 2))) == pytest.approx(np.ones((1, 1)), abs=1e-12)
    tiny = kernel.weights(np.diag([1e-6, -1e-6]))
    # what is moved by at most 0.04 · 1e-6 steps moves that share of itself
    assert tiny[tiny.shape[0] // 2, tiny.shape[1] // 2] == pytest.approx(1, abs=1e-7)


@pytest.mark.parametrize(
    ("matrix", "words"),
    [
        (np.diag([1e4, 1.0]), r"gaussian \(sigma 1\).* covers 80001 steps.* 8192 are the most.*narrower"),
        (np.eye(3), "steps_from_slopes must be a 2×2 matrix of numbers"),
        (np.full((2, 2), np.nan), "steps_from_slopes must be finite numbers"),
    ],
)
def test_a_lattice_that_no_kernel_can_be_laid_on_is_refused(matrix, words):
    with pytest.raises(vcc.InputError, match=words):
        Gaussian(1.0).weights(matrix)


# --- parameters ---


@pytest.mark.parametrize("sigma", [0, -0.1, math.nan, math.inf, (0.1, 0), (0.1,), (0.1, 0.1, 0.1)])
def test_a_gaussian_refuses_a_sigma_that_is_no_width(sigma):
    with pytest.raises(vcc.InputError, match="sigma of a Gaussian is a slope greater than 0"):
        Gaussian(sigma)


@pytest.mark.parametrize("width", [0, -1, math.nan, math.inf])
def test_a_top_hat_refuses_a_width_that_is_none(width):
    with pytest.raises(vcc.InputError, match="width of a top hat is a slope, greater than 0"):
        TopHat(width)


def test_a_top_hat_refuses_another_shape():
    with pytest.raises(vcc.InputError, match="'disc' or 'square', not 'round'"):
        TopHat(0.1, "round")


@pytest.mark.parametrize(
    ("radii", "profile", "message"),
    [
        ((0,), (1,), "two radii or more"),
        ((0, 1), (1, 1, 1), r"not shapes \(2,\) and \(3,\)"),
        ((0.1, 1), (1, 0), "rise from 0"),
        ((0, 1, 1), (1, 1, 0), "rise from 0"),
        ((0, math.nan), (1, 0), "rise from 0"),
        ((0, 1, 2), (1, -2, 0), r"profile of a radial kernel must be 0 or more; at index \(1,\) there is -2"),
        ((0, 1), (math.nan, 0), r"finite numbers; at index \(0,\)"),
        ((0, 1), (0, 0), "0 throughout"),
        ((0, 1), (1, 0), r"integrates to .* = 1\.04719755, and must to 1.*normalise=True"),
    ],
)
def test_a_radial_kernel_refuses_what_is_no_density(radii, profile, message):
    with pytest.raises(vcc.InputError, match=message):
        Radial(radii, profile)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ([[0.5, 0.4]], r"sums to 0\.9, and must to 1.*normalise=True"),
        ([[0.5, 0.500002]], r"sums to 1\.000002, and must to 1"),
        ([[1.5, -0.5]], r"kernel's array must be 0 or more; at index \(0, 1\) there is -0\.5"),
        ([[0.5], [math.nan]], r"finite numbers; at index \(1, 0\) there is nan"),
        ([[0.0, 0.0]], "0 throughout"),
        ([0.5, 0.5], r"not of shape \(2,\)"),
        (np.zeros((0, 3)), r"not of shape \(0, 3\)"),
    ],
)
def test_samples_refuse_what_is_no_density(values, message):
    with pytest.raises(vcc.InputError, match=message):
        Samples(values, 1e-3)


@pytest.mark.parametrize("pitch", [0, -1e-3, math.nan, math.inf, None])
def test_samples_need_a_pitch(pitch):
    with pytest.raises(vcc.InputError, match="slope_pitch of a kernel's array must be greater than 0"):
        Samples([[1.0]], pitch)


def test_samples_are_normalised_only_when_asked():
    kernel = Samples([[1, 3]], 1e-3, normalise=True)
    assert kernel.values.tolist() == [[0.25, 0.75]]
    assert kernel == Samples([[0.25, 0.75]], 1e-3)
    float32 = np.full((50, 50), 1 / 2500, np.float32)  # rounding is not refused
    assert Samples(float32, 1e-3).weights(np.diag([1e3, 1e3])).sum() == pytest.approx(1, abs=1e-12)


def test_equal_kernels_are_equal_and_cannot_be_changed():
    values = SHARES.copy()
    kernel = Samples(values, PITCH)
    values[0, 0] = 1
    assert kernel == Samples(SHARES, PITCH)
    assert hash(kernel) == hash(Samples(SHARES, PITCH))
    assert kernel != Samples(SHARES, 1e-3)
    assert kernel != Samples(SHARES[::-1], PITCH)
    with pytest.raises(ValueError, match="read-only"):
        kernel.values[0, 0] = 1
    assert len({*KERNELS.values(), Gaussian(0.01), Radial([0, R], [3 / (math.pi * R**2), 0])}) == len(KERNELS)


def test_kernels_say_what_they_are():
    words = [kernel.described() for kernel in KERNELS.values()]
    assert words == [
        "gaussian (sigma 0.01)",
        "gaussian (sigma (0.01, 0.003))",
        "top hat (width 0.04)",
        "top hat (width 0.04, shape square)",
        "radial (2 radii up to 0.02)",
        "radial (4 radii up to 0.02)",
        "3×4 samples (slope pitch 0.002)",
    ]
    assert "3×4" in repr(KERNELS["samples"])


def test_a_kernel_of_ones_own_needs_three_methods():
    """A line of light along δs: the rest follows."""

    @dataclass(frozen=True)
    class EvenLine(Kernel):
        length: float

        @property
        def reach(self):
            return self.length / 2, 1e-9

        def deflections(self, xi, eta):
            return self.length * (xi - 0.5), 2e-9 * (eta - 0.5)

        def density(self, s, t):
            inside = (np.abs(s) <= self.length / 2) & (np.abs(t) <= 1e-9)
            return inside / (2e-9 * self.length)

    line = EvenLine(0.01)
    assert line.described() == "even line (length 0.01)"
    # Even over ±2 steps: 1/4 a step, and of that the tents at the ends have one half.
    assert line.weights(np.diag([400.0, 400.0]))[1] == pytest.approx([0.125, 0.25, 0.25, 0.25, 0.125], abs=1e-5)
