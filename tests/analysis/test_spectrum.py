"""4-D spectra against closed forms: Gaussians of rays, Gaussians in frequency, and what optics makes of them.

L(r) = exp(−π (r − r₀)ᵀQ(r − r₀)) has F(f) = det(Q)^(−½) exp(−π fᵀQ⁻¹f) exp(−2πi f·r₀) exactly. Along an axis of n
samples it falls as exp(−π q²/n) in samples and exp(−π n κ²) in frequency: at its borders, q = n/2 and κ = ½, to
exp(−πn/4), 7e-7 for the smallest n here, 18. Cut ends and aliases add up to a few times that, single precision to
about 1e-6 of the largest value: 1e-5 is asked for.
"""

import dataclasses
import re

import numpy as np
import pytest
from scipy.special import j1

import vcc
from vcc.analysis import (
    PlaneSpectrum,
    Spectrum,
    fft4,
    ifft4,
    kernel_spectrum,
    mask_spectrum,
    picture_spectrum,
    plot_plane_spectrum,
    plot_spectrum,
    samples_of,
)
from vcc.base.units import mm
from vcc.shapes.kernels import Gaussian, TopHat
from vcc.shapes.patterns import Circle, CosineSum

SIZES = np.array([20, 18, 21, 19])
"""Along (u, v, s, t)."""
DU, DS = 0.5 * mm, 2e-3
CENTRE = np.array([0.21 * mm, -0.13 * mm, 0.7e-3, 0.4e-3])
CLOSE = 1e-5


def frame_of(linear):
    """Samples about a place a little off the axis."""
    matrix = np.eye(5)
    matrix[:4, :4] = linear
    matrix[:4, 4] = -linear @ ((SIZES - 1) / 2)
    return vcc.Affine(matrix)


PLAIN = np.diag([DU, DU, -DS, -DS])
MIXED = np.diag([DU, DU, DS, DS]) @ (
    np.eye(4) + np.array([[0, 0.2, 0.3, -0.1], [-0.15, 0, 0.1, 0.2], [0.25, 0.1, 0, 0.3], [0.1, -0.2, -0.25, 0]])
)


class Blob:
    """A Gaussian of rays that suits a grid of samples, and what is known of it."""

    def __init__(self, linear, tilted=0.0):
        lean = np.eye(4) + tilted * np.array([[0, 1, 0, 1], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0, 0, 0]])
        inverse = np.linalg.inv(linear)
        self.q = inverse.T @ np.diag(SIZES**-0.5) @ lean @ lean.T @ np.diag(SIZES**-0.5) @ inverse
        self.frame = frame_of(linear)
        index = np.stack(np.meshgrid(*(np.arange(n) for n in SIZES[[1, 0, 3, 2]]), indexing="ij"), axis=-1)
        rays = self.frame(index[..., [1, 0, 3, 2]]) - CENTRE
        self.light_field = vcc.LightField(
            np.exp(-np.pi * ((rays @ self.q) * rays).sum(axis=-1)), self.frame, sample="point"
        )

    def spectrum(self, f):
        power = ((f @ np.linalg.inv(self.q)) * f).sum(axis=-1)
        return np.linalg.det(self.q) ** -0.5 * np.exp(-np.pi * power - 2j * np.pi * (f @ CENTRE))


def frequencies_of(spectrum):
    counts = np.array(spectrum.shape[:4])
    index = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1)
    return spectrum.frame(index[..., [1, 0, 3, 2]])


def about_zero(spectrum):
    """The values with phases about the ray 0."""
    return spectrum.values * np.exp(-2j * np.pi * (frequencies_of(spectrum) @ spectrum.origin))


def close(found, expected, tolerance=CLOSE):
    assert np.abs(found - expected).max() <= tolerance * np.abs(expected).max()


@pytest.mark.parametrize(("linear", "tilted"), [(PLAIN, 0.0), (MIXED, 0.1)])
def test_a_gaussian_has_the_spectrum_of_its_closed_form_on_any_frame(linear, tilted):
    blob = Blob(linear, tilted)
    spectrum = fft4(blob.light_field)
    assert spectrum.values.dtype == np.complex64
    close(about_zero(spectrum), blob.spectrum(frequencies_of(spectrum)))


def test_frequencies_along_axes_are_in_cycles_per_metre_and_per_slope():
    spectrum = fft4(Blob(PLAIN).light_field)
    np.testing.assert_allclose(spectrum.frequencies("u"), np.fft.fftshift(np.fft.fftfreq(20, DU)), atol=1e-9)
    np.testing.assert_allclose(spectrum.frequencies("t"), -np.fft.fftshift(np.fft.fftfreq(19, DS)), atol=1e-9)
    assert spectrum.sizes == tuple(SIZES)


OPTICS = {
    "lens": vcc.Affine.lens(50 * mm),
    "flight": vcc.Affine.propagation(80 * mm),
    "lens, flight, prism": vcc.Affine.prism((3e-3, -2e-3)) @ vcc.Affine.propagation(0.03) @ vcc.Affine.lens(0.05),
}


@pytest.mark.parametrize("optics", OPTICS)
def test_linear_optics_shears_the_spectrum(optics):
    """L'(r) = L(M⁻¹(r − c)), hence F'(f) = F(Mᵀf)·exp(−2πi f·c)."""
    blob, affine = Blob(PLAIN), OPTICS[optics]
    sheared = fft4(blob.light_field).transformed(affine)
    f = frequencies_of(sheared)
    expected = blob.spectrum(f @ affine.linear) * np.exp(-2j * np.pi * (f @ affine.offset))
    close(about_zero(sheared), expected)
    again = fft4(blob.light_field.transformed(affine))
    assert again.frame.isclose(sheared.frame)
    close(again.values, sheared.values, 1e-6)


def test_a_mask_convolves_the_spectrum():
    """½ + ½cos at its own plane: copies at ±f₀ along fu, each ¼, by the mean over cells: sinc(f₀·du)."""
    blob = Blob(PLAIN)
    f0 = 1 / (20 * DU)  # copies stay as far from ½ cycle a sample as their aliases need to be small
    mask = vcc.Mask(CosineSum((1 / f0, np.inf)))
    spectrum = fft4(blob.light_field.masked(mask))
    f, step = frequencies_of(spectrum), np.array([f0, 0, 0, 0])
    copies = 0.25 * (blob.spectrum(f - step) + blob.spectrum(f + step)) * np.sinc(f0 * DU)
    close(about_zero(spectrum), 0.5 * blob.spectrum(f) + copies)


def test_a_mask_in_mid_path_convolves_along_a_slanted_line():
    """m(u + d·s) has its spectrum on the line (f, 0, d·f, 0): flight shears it as it does the light field's."""
    blob, d = Blob(PLAIN), 0.1
    f0 = 1 / (20 * DU)
    rays = blob.frame(
        np.stack(np.meshgrid(*(np.arange(n) for n in SIZES[[1, 0, 3, 2]]), indexing="ij"), -1)[..., [1, 0, 3, 2]]
    )
    passed = 0.5 + 0.5 * np.cos(2 * np.pi * f0 * (rays[..., 0] + d * rays[..., 2]))
    there = fft4(blob.light_field.replaced(blob.light_field.values * passed)).transformed(
        vcc.Affine.propagation(d)
    )
    f, step = frequencies_of(there), np.array([f0, 0, 0, 0])  # at the mask's plane the copies lie along fu alone
    back = vcc.Affine.propagation(d).linear

    def arriving(f):
        return blob.spectrum(f @ back)

    close(about_zero(there), 0.5 * arriving(f) + 0.25 * (arriving(f - step) + arriving(f + step)))


def test_a_diffuser_multiplies_the_spectrum():
    blob, sigma = Blob(PLAIN), 1.7e-3
    spectrum = fft4(blob.light_field.scattered(vcc.Diffuser(kernel=Gaussian(sigma))))
    f = frequencies_of(spectrum)
    kernel = kernel_spectrum(Gaussian(sigma), f[0, 0, :, :, 2], f[0, 0, :, :, 3])
    # Samples are interpolated linearly along the slopes: a tent, sinc² on either axis.
    tent = (np.sinc(f[..., 2] * DS) * np.sinc(f[..., 3] * DS)) ** 2
    # More samples along s and t: their Gaussian is the same, its ends are cut further out.
    close(about_zero(spectrum), blob.spectrum(f) * kernel * tent, 2e-5)


@pytest.mark.parametrize("distance", [0.0, 40 * mm, 0.25, 2.0])
def test_a_sensor_slices_the_spectrum(distance):
    """The picture ∫∫ L ds dt of a Gaussian is a Gaussian; its spectrum is F(fx, fy, 0, 0) of what arrives."""
    blob = Blob(PLAIN)
    flight = vcc.Affine.propagation(distance)
    section = fft4(blob.light_field).transformed(flight).sensor_slice()
    rows, columns = section.shape
    place = section.frame(np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1))
    f = np.concatenate([place, np.zeros_like(place)], axis=-1)
    close(section.about_zero(), blob.spectrum(f @ flight.linear))
    assert (rows, columns) == ((18, 20) if distance < 0.2 else (19, 21))


def test_the_slice_has_channels_and_refuses_frames_that_mix_x_and_y():
    blob = Blob(PLAIN)
    coloured = blob.light_field.replaced(blob.light_field.values[..., None] * np.array([1.0, 0.5]))
    section = fft4(coloured).sensor_slice()
    close(section.values[..., 1], 0.5 * section.values[..., 0], 1e-6)
    with pytest.raises(vcc.InputError, match="mixes x and y"):
        fft4(Blob(MIXED).light_field).sensor_slice()


@pytest.mark.filterwarnings("ignore:the samples are float:vcc.errors.ResultWarning")  # whole numbers, as codes are
@pytest.mark.parametrize("dtype", [np.float32, np.uint8])
def test_there_and_back(dtype):
    rng = np.random.default_rng(1)
    samples = rng.integers(0, 256, (3, 4, 9, 8, 2)).astype(dtype)
    light_field = vcc.LightField.from_views(samples, 1 * mm, 2e-3, sample="point")
    back = ifft4(fft4(light_field))
    assert back.frame == light_field.frame
    assert back.sample == ifft4(fft4(light_field).transformed(vcc.Affine.lens(0.05))).sample == "point"
    assert ifft4(fft4(dataclasses.replace(light_field, sample="mean"))).sample == "mean"
    # Single precision: rounding of 2⁻²⁴ in about four levels of butterflies on each of eight ways.
    np.testing.assert_allclose(back.values, samples / light_field.full_scale, atol=1e-6 * samples.max())


def test_a_window_weighs_the_samples():
    light_field = vcc.LightField.from_views(np.ones((4, 5, 8, 7)), 1 * mm, 2e-3)
    back = samples_of(fft4(light_field, [None, None, "hann", ("tukey", 0.5)]))
    expected = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(8) / 7)
    np.testing.assert_allclose(back[1, 2, :, 3], expected, atol=1e-6)
    np.testing.assert_allclose(back[:, :, 3, 3], expected[3], atol=1e-6)
    assert back[0, 0, 3, 0] == pytest.approx(0, abs=1e-6)  # of the Tukey window


def test_power_is_conserved():
    """Parseval: Σ|F|² df = Σ|L|² dr."""
    blob = Blob(MIXED, 0.1)
    spectrum = fft4(blob.light_field)
    power = spectrum.power(("u", "s")).sum() * abs(spectrum.frame.determinant)
    energy = (blob.light_field.values**2).sum() * blob.light_field.sample_volume
    assert power == pytest.approx(energy, rel=1e-5)
    assert spectrum.power(("u", "s")).shape == (20, 21)
    np.testing.assert_allclose(spectrum.power(("s", "u")), spectrum.power(("u", "s")).T)
    np.testing.assert_array_equal(spectrum.section(("s", "u")), spectrum.values[9, :, 9, :].T)


# -- what is flat


def test_kernels_have_the_spectra_of_their_closed_forms():
    fs = np.array([0.0, 10.0, 35.0, 60.0])
    # The cut at 4 σ leaves out 1.3e-4 of the light, which is shared out over the rest.
    gaussian = kernel_spectrum(Gaussian((5e-3, 2e-3)), fs, 20.0)
    np.testing.assert_allclose(gaussian, np.exp(-2 * np.pi**2 * ((5e-3 * fs) ** 2 + (2e-3 * 20) ** 2)), atol=5e-4)
    square = kernel_spectrum(TopHat(20e-3, "square"), fs, 7.0)
    # A midpoint rule of 256 points: (π·1.2/256)²/6 = 4e-5.
    np.testing.assert_allclose(square, np.sinc(20e-3 * fs) * np.sinc(20e-3 * 7), atol=5e-5)
    x = np.pi * 20e-3 * fs[1:]
    disc = kernel_spectrum(TopHat(20e-3), fs[1:], 0.0)
    np.testing.assert_allclose(disc, 2 * j1(x) / x, atol=2e-4)
    assert kernel_spectrum(TopHat(20e-3), 0.0, 0.0) == pytest.approx(1)


def test_a_round_hole_has_an_airy_spectrum():
    spectrum = mask_spectrum(vcc.Mask(Circle(4 * mm)), 8 * mm, samples=256)
    fx, values = spectrum.along("x")
    x = np.pi * 4 * mm * fx[1:40]
    expected = np.pi * (4 * mm) ** 2 / 4 * 2 * j1(x) / x * np.sinc(fx[1:40] * 8 * mm / 256)
    # Aliases of a spectrum that falls as f^(−3/2): those from 216 to 256 steps on, signs alternating, below 1e-3.
    np.testing.assert_allclose(values[1:40], expected, atol=1e-3 * np.pi * (4 * mm) ** 2 / 4)
    assert values[0] == pytest.approx(np.pi * (4 * mm) ** 2 / 4, rel=1e-9)
    assert fx[1] == pytest.approx(1 / (8 * mm))


def test_a_cosine_picture_has_two_lines():
    """On a turned frame, so that frequencies turn with it."""
    angle, pitch = 0.3, 10e-6
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    frame = vcc.Affine.from_parts(turn * pitch, [1 * mm, -2 * mm])
    wanted = turn @ np.array([3, -2]) / (24 * pitch)
    x, y = np.moveaxis(frame(np.stack(np.meshgrid(np.arange(24), np.arange(24)), axis=-1)), -1, 0)
    image = vcc.Image(1 + 0.5 * np.cos(2 * np.pi * (wanted[0] * x + wanted[1] * y)), frame)
    spectrum = picture_spectrum(image)
    power = np.abs(spectrum.values)
    power[12, 12] = 0
    row, column = np.unravel_index(power.argmax(), power.shape)
    found = spectrum.frame([column, row])
    np.testing.assert_allclose(np.abs(found), np.abs(wanted), rtol=1e-9)
    area = (24 * pitch) ** 2
    np.testing.assert_allclose(spectrum.about_zero()[row, column], 0.25 * area, rtol=1e-9)


def test_pictures_of_spectra_show_the_shear():
    blob = Blob(PLAIN)
    sheared = fft4(blob.light_field).transformed(vcc.Affine.propagation(1.0))
    axes = plot_spectrum(sheared, ("u", "s"))
    assert "cycles/mm" in axes.get_xlabel()
    corners = axes.collections[0].get_coordinates()
    np.testing.assert_allclose(np.abs(corners[..., 0]).max(), 1e-3 / DU / 2, rtol=0.1)
    # What was at (fu, fs) is at (fu, fs − d·fu) after flight over d: 1 m here, fu drawn in cycles/mm.
    run = corners[-1, 5] - corners[0, 5]
    assert run[1] / (run[0] * 1e3) == pytest.approx(-1.0, rel=1e-6)
    assert plot_spectrum(sheared, ("t", "v"), of="section").get_ylabel().startswith("fv")
    assert plot_plane_spectrum(sheared.transformed(vcc.Affine.propagation(-1.0)).sensor_slice()).yaxis_inverted()


# -- what is refused

LIGHT_FIELD = vcc.LightField.from_views(np.ones((2, 2, 4, 4)), 1 * mm, 2e-3)


def refused(words):
    return pytest.raises(vcc.InputError, match=re.escape(words))


def test_what_is_refused():
    with refused("of shape 2×2×4×4 needs 512 bytes"):
        fft4(LIGHT_FIELD, memory_limit=100)
    with refused("window 'hat' is unknown"):
        fft4(LIGHT_FIELD, "hat")
    with refused("a list of four"):
        fft4(LIGHT_FIELD, ["hann"])
    with refused("pass stored.read()"):
        fft4(np.ones((2, 2, 4, 4)))
    spectrum = fft4(LIGHT_FIELD)
    with refused("memory_limit"):
        ifft4(spectrum, memory_limit=100)
    with refused("do not fit"):
        spectrum.replaced(np.ones(3))
    with refused("not 'x'"):
        spectrum.frequencies("x")
    with refused("two coordinates"):
        spectrum.power(("u", "u"))
    with refused("complex samples"):
        ifft4(spectrum.replaced(spectrum.values + 1j * np.abs(spectrum.values).max()))
    with refused("negative samples"):
        ifft4(spectrum.replaced(-spectrum.values))
    with refused('of is "power"'):
        plot_spectrum(spectrum, of="phase")
    with refused("decades"):
        plot_spectrum(spectrum, decades=0)
    with refused("finite values; at index (1, 0)"):
        picture_spectrum(vcc.Image(np.array([[0.0], [np.nan]]), vcc.Affine.identity(2)))
    with refused("width of the rectangle whose spectrum is taken must be greater than 0 m"):
        mask_spectrum(CosineSum((1 * mm, 1 * mm), 1, 0.5), 0.0)
    with refused("axis is 'x' or 'y'"):
        PlaneSpectrum(np.ones((2, 2)), vcc.Affine.identity(2)).along("u")
    assert repr(spectrum) == "Spectrum(2×2×4×4 complex64)"
    assert isinstance(spectrum, Spectrum)
