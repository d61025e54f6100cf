"""From one recording of `vcc.gallery.cassi` to all bands: the camera as a matrix, and total variation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.cached import cached
from vcc.base.measures import psnr
from vcc.gallery.cassi_camera import SHEAR, Array, Imager
from vcc.recover.deblur import gradient, gradient_adjoint

Floats = NDArray[np.float32]

STEP = 1.8
"""Of iterations; below 2."""


@dataclass(frozen=True, eq=False)
class Model:
    """The imager as a matrix: each band passes the code, is moved along the rows, and all are summed.

    Args:
        code: transmission, (rows, columns).
        shears: of the bands, pixels to the right, 0 to `SHEAR`; a fraction is shared by two pixels.
    """

    code: Floats
    shears: Array

    @property
    @cached
    def _shares(self) -> list[tuple[int, int, np.float32]]:
        """(band, whole pixels, share) of the light."""
        whole = np.floor(self.shears + 1e-6).astype(int)
        part = np.maximum(self.shears - whole, 0)
        both = [
            (band, whole[band] + step, np.float32(share[band]))
            for step, share in ((0, 1 - part), (1, part))
            for band in range(len(self.shears))
        ]
        return [(band, move, share) for band, move, share in both if share > 1e-6]

    def __call__(self, cube: NDArray[np.floating]) -> Floats:
        """The image of a cube, (bands, rows, columns): the sum over its bands."""
        rows, columns = self.code.shape
        made = np.zeros((rows, columns + SHEAR + 1), np.float32)
        coded = self.code * cube
        for band, move, share in self._shares:
            made[:, move : move + columns] += share * coded[band]
        return made[:, : columns + round(float(self.shears.max()))]

    def transpose(self, image: NDArray[np.floating]) -> Floats:
        """The adjoint: an image to a cube."""
        rows, columns = self.code.shape
        wide = np.pad(image, ((0, 0), (0, columns + SHEAR + 1 - image.shape[1])))
        made = np.zeros((len(self.shears), rows, columns), np.float32)
        for band, move, share in self._shares:
            made[band] += share * wide[:, move : move + columns]
        return self.code * made

    def cube(self, image: Array, weight: float, steps: int) -> Array:
        """The cube of 0 or more that explains an image, and whose total variation is small.

        Minimises Σ (A x − y)²/(2 A Aᵀ1) + weight · Σ |∇x|, where |∇x| is over rows, columns and bands of a pixel:
        bands share their edges (Blomgren and Chan 1998). Solved by the primal-dual steps of Condat (2013) and Vũ
        (2013), all sums over bands rather than means.

        Args:
            image: (rows, columns of the sensor), the mean over the bands.
            weight: of total variation.
            steps: number of iterations.

        Returns:
            (rows, columns, bands).
        """
        wanted = (image * len(self.shears)).astype(np.float32)
        # A Aᵀ has no negative entry: divided by its row sums, its norm is 1 at most. Pixels without light count 0.
        shared = np.maximum(self(self.transpose(np.ones_like(wanted))), np.float32(0.1))
        step = np.float32(STEP)
        dual_step = np.float32((1 / STEP - 0.5) / 8)  # 8 bounds the squared norm of the gradient
        cube = self.transpose(wanted / shared)
        slopes = np.zeros((2, *cube.shape), np.float32)
        for _ in range(steps):
            new = cube - step * (self.transpose((self(cube) - wanted) / shared) + gradient_adjoint(slopes))
            np.maximum(new, 0, out=new)
            slopes += dual_step * gradient(2 * new - cube)
            slopes /= np.maximum(1, np.sqrt(np.einsum("abrc,abrc->rc", slopes, slopes)) / np.float32(weight))
            cube = new
        return np.asarray(np.moveaxis(cube, 0, -1), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Recovered:
    """What a run found.

    Args:
        imager: with the prism of glass.
        truth: the cube as the imager shows it without code and prism, band by band: (rows, columns, bands).
        recording: with code, prism and noise, relative to white.
        cubes: recovered, by name.
        places: pixels by name.
        even_error: of the image with whole-pixel shears, against shift and sum.
        model_error: of the model against the image with the prism of glass, dB.
    """

    imager: Imager
    truth: Array
    recording: Array
    cubes: dict[str, Array]
    places: dict[str, tuple[int, int]]
    even_error: float
    model_error: float

    def decibels(self, name: str) -> float:
        """PSNR of a cube, white 1."""
        return psnr(self.cubes[name], self.truth, 1.0)

    def spectrum(self, cube: Array, place: str) -> Array:
        """The mean spectrum of 5×5 pixels."""
        row, column = self.places[place]
        return np.asarray(cube[row - 2 : row + 3, column - 2 : column + 3].mean(axis=(0, 1)))

    def spectral_error(self, place: str) -> float:
        """Root mean square over the bands, of the spectrum recovered with noise."""
        found, truth = (self.spectrum(cube, place) for cube in (self.cubes["noise"], self.truth))
        return float(np.sqrt(np.mean((found - truth) ** 2)))
