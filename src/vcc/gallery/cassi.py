"""CASSI: a coded aperture, a prism and one grey recording give the spectrum of each pixel.

Wagadarikar et al. 2008, with a single disperser. The spectral scene is made of the middle view of a light field.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from vcc.base.measures import psnr
from vcc.base.units import nm
from vcc.gallery import cassi_camera, flat_target
from vcc.gallery.cassi_camera import (
    BANDS,
    EVEN,
    SHEAR,
    WAVELENGTHS,
    Array,
    Imager,
    spectral_scene,
)
from vcc.gallery.cassi_figures import NAMES, pictures
from vcc.gallery.cassi_recovery import Floats, Model, Recovered
from vcc.gallery.entry import Entry, Finding, Progress, Result, Steps, prose
from vcc.image import Image
from vcc.recording import expose_image
from vcc.showcase.bench import Bench

WEIGHT = 0.03
"""Of total variation."""
ROUNDING = 1e-5
"""Single precision, 2⁻²⁴ = 6e-8 of white for each of 26 bands and of the code, three times over."""
LEAST_GAIN = 3.0
"""Least gain, dB."""


@dataclass(frozen=True)
class Run:
    """Record a spectral scene once, and recover all bands; without the code, without the prism, by other shears.

    Args:
        size: pixels of the scene along its longer side.
        steps: number of iterations.
        refine: parts of a pixel by which edges of the code are computed.
    """

    size: int = 128
    steps: int = 300
    refine: int = 8

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Make a scene with the middle view of a light field as its texture, and measure."""
        advance = Steps(progress, 10)
        progress(0, advance.total)
        grey = flat_target.grey_view(bench, self.size)
        scene, places = spectral_scene(grey)
        shape = (grey.shape[0], grey.shape[1])
        even_error = whole_pixel_error(scene, shape)
        advance()
        imager = Imager(shape, refine=self.refine)
        code, shears = imager.recorded_code.astype(np.float32), imager.measured_shears
        truth = imager.values(scene, coded=False, dispersed=False, mono=False)
        clean = imager.image(scene)
        advance()
        noisy = self._with_noise(imager, clean)
        open_image = self._with_noise(imager, imager.image(scene, coded=False), coded=False)
        straight = self._with_noise(imager, imager.image(scene, dispersed=False), dispersed=False)
        advance()
        model = Model(code, shears)
        white = clean.to_numpy().astype(np.float64) / imager.white
        model_error = psnr(model(_bands_first(truth)) / BANDS, white, 1.0)
        cubes = {}
        for name, recorded, by in (
            ("clean", white, model),
            ("noise", noisy, model),
            ("no code", open_image, Model(np.ones_like(code), shears)),
            ("no prism", straight, Model(code, np.zeros(BANDS))),
            ("rounded", noisy, Model(code, np.round(shears))),
            ("straight line", noisy, Model(code, np.arange(BANDS, dtype=np.float64))),
        ):
            cubes[name] = by.cube(recorded, WEIGHT, self.steps)
            advance()
        found = Recovered(imager, truth, noisy, cubes, places, even_error, model_error)
        advance()
        return Result(
            prose(__name__, optics=cassi_camera, found=found, nm=nm, steps=self.steps),
            pictures(found),
            _findings(found),
            bench.assumed,
        )

    @staticmethod
    def _with_noise(imager: Imager, image: Image, **parts: bool) -> Array:
        recording = expose_image(image, imager.camera(**parts).sensor, "auto")
        return np.asarray(recording.image().to_numpy(), dtype=np.float64) / imager.white


def whole_pixel_error(scene: Array, shape: tuple[int, int]) -> float:
    """Largest difference between our image by a glass of even dispersion and shift and sum, as a share of white.

    Args:
        scene: (rows, columns, bands).
        shape: of it, rows and columns.
    """
    even = Imager(shape, EVEN, "nearest", refine=1)
    image = even.values(scene)
    columns = shape[1]
    for band in range(BANDS):
        image[:, band : band + columns] -= even.recorded_code * scene[..., band] / BANDS
    return float(np.abs(image).max())


def _bands_first(cube: Array) -> Floats:
    return np.ascontiguousarray(np.moveaxis(cube, -1, 0), dtype=np.float32)


def _findings(found: Recovered) -> tuple[Finding, ...]:
    imager = found.imager
    shear_error = float(np.abs(imager.measured_shears - imager.shears).max())
    bent = float(np.abs(imager.measured_shears - np.arange(BANDS)).max())
    decibels = {name: found.decibels(name) for name in found.cubes}
    noisy = decibels["noise"]
    peaks = [
        float(WAVELENGTHS[int(np.argmax(found.spectrum(cube, "lamp")))] / nm)
        for cube in (found.cubes["noise"], found.truth)
    ]
    step = (WAVELENGTHS[1] - WAVELENGTHS[0]) / nm
    errors = [f"{place} {found.spectral_error(place):.3f}" for place in NAMES]
    return (
        Finding(
            "whole-pixel shears: image against shift and sum, largest error as a share of white",
            f"equal to rounding, below {ROUNDING:g}",
            found.even_error,
            "",
            found.even_error < ROUNDING,
            "a made-up glass whose index is linear in the wavelength; the code as recorded",
        ),
        Finding(
            "prism of F2: measured shears against Δn/(n(λ₀) − 1) · δ · distance, largest difference",
            "the closed form, within 0.001 pixels",
            shear_error,
            "pixels",
            shear_error < 1e-3,
        ),
        Finding(
            "largest distance of these shears from a straight line",
            "",
            bent,
            "pixels",
            why=f"both have {SHEAR} pixels between the outermost bands",
        ),
        Finding("cube from one recording without noise, PSNR", "", decibels["clean"], "dB"),
        Finding("cube from one recording with noise, PSNR", "", noisy, "dB", why=f"{BANDS} bands from one image"),
        *(
            Finding.gain(
                f"the same: gain over a camera without {part}",
                noisy,
                decibels[f"no {part}"],
                LEAST_GAIN,
                why,
                "both are needed",
            )
            for part, why in (
                ("code", "bands differ by a shift alone, which smooth places do not show"),
                ("prism", "all bands fall on the same pixels, and only their sum is known"),
            )
        ),
        Finding(
            "spectrum of the lamp: distance of its peak from the true one",
            f"within one band, {step:g} nm",
            abs(peaks[0] - peaks[1]),
            "nm",
            abs(peaks[0] - peaks[1]) <= step * 1.001,
            f"root mean square errors of spectra: {', '.join(errors)}",
        ),
        Finding(
            "recovered by shears on a straight line, one pixel a band: loss",
            "",
            noisy - decibels["straight line"],
            "dB",
            why="models with one pixel a band do not fit a prism of glass",
        ),
        Finding("recovered by true shears, rounded to whole pixels: loss", "", noisy - decibels["rounded"], "dB"),
    )


ENTRY = Entry(
    "cassi",
    "CASSI: coded aperture snapshot spectral imager",
    "A. Wagadarikar, R. John, R. Willett and D. Brady, Single disperser design for coded aperture snapshot "
    "spectral imaging, Applied Optics 47, B44, 2008; M. E. Gehm, R. John, D. J. Brady, R. M. Willett and T. J. "
    "Schulz, Single-shot compressive spectral imaging with a dual-disperser architecture, Optics Express 15, "
    "14013, 2007",
    "A coded aperture and a prism put all bands of a scene into one grey recording, from which the spectrum of "
    "each pixel can be estimated.",
    Run(),
)
