"""Analysis of designs: 4-D Fourier transforms, Fourier slice refocusing, point spread functions, sampling advice,
real lenses.

Built on cameras and light fields; no other package depends on it.
"""

from vcc.analysis.aperture_search import OptimisedAperture, optimised_aperture
from vcc.analysis.deblurring import expected_deblurring_error, natural_image_power
from vcc.analysis.field_curves import (
    AxialColour,
    Distortion,
    FieldCurvature,
    LateralColour,
    RelativeIllumination,
    axial_colour,
    distortion,
    field_curvature,
    lateral_colour,
    relative_illumination,
)
from vcc.analysis.lens_sharpness import (
    BestFocus,
    FieldContrast,
    FieldSpread,
    best_focus,
    mtf_over_field,
    psf_over_field,
)
from vcc.analysis.lens_spots import RayFans, Spots, ray_fans, spots
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
    "AxialColour",
    "BestFocus",
    "Distortion",
    "FieldContrast",
    "FieldCurvature",
    "FieldSpread",
    "LateralColour",
    "OptimisedAperture",
    "PlaneSpectrum",
    "PointSpread",
    "RayFans",
    "Refocuser",
    "RelativeIllumination",
    "SamplingAdvice",
    "Spectrum",
    "Spots",
    "axial_colour",
    "best_focus",
    "distortion",
    "expected_deblurring_error",
    "fft4",
    "field_curvature",
    "ifft4",
    "kernel_spectrum",
    "lateral_colour",
    "mask_spectrum",
    "mtf",
    "mtf_over_field",
    "natural_image_power",
    "optimised_aperture",
    "otf",
    "picture_spectrum",
    "plane_spectrum",
    "plot_plane_spectrum",
    "plot_spectrum",
    "psf",
    "psf_over_field",
    "ray_fans",
    "relative_illumination",
    "samples_of",
    "sampling_advice",
    "spots",
]
