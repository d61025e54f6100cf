"""Analysis of designs: 4-D Fourier transforms, Fourier slice refocusing, point spread functions, sampling advice.

Built on cameras and light fields; no other package depends on it.
"""

from vcc.analysis.aperture_search import OptimisedAperture, optimised_aperture
from vcc.analysis.deblurring import expected_deblurring_error, natural_image_power
from vcc.analysis.pictures import plot_plane_spectrum, plot_spectrum
from vcc.analysis.plane_spectrum import (
    PlaneSpectrum,
    kernel_spectrum,
    mask_spectrum,
    picture_spectrum,
    plane_spectrum,
)
from vcc.analysis.point_spread import PointSpread, mtf, otf, psf
from vcc.analysis.refocus import Refocuser
from vcc.analysis.sampling import SamplingAdvice, sampling_advice
from vcc.analysis.spectrum import Spectrum, fft4, ifft4, samples_of

__all__ = [
    "OptimisedAperture",
    "PlaneSpectrum",
    "PointSpread",
    "Refocuser",
    "SamplingAdvice",
    "Spectrum",
    "expected_deblurring_error",
    "fft4",
    "ifft4",
    "kernel_spectrum",
    "mask_spectrum",
    "mtf",
    "natural_image_power",
    "optimised_aperture",
    "otf",
    "picture_spectrum",
    "plane_spectrum",
    "plot_plane_spectrum",
    "plot_spectrum",
    "psf",
    "samples_of",
    "sampling_advice",
]
