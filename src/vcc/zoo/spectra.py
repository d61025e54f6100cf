"""Spectra in the zoo: the task spectrum, its scenes, cameras and decoders.

Scenes are flat, in focus, with the bands of the camera of `vcc.gallery.cassi_camera`; all cameras have its lenses
and its sensor, of whose columns the prism needs the last `SHEAR`.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.measures import psnr
from vcc.base.units import nm
from vcc.camera import Camera
from vcc.gallery.cassi_camera import BANDS, PITCH, PUPIL, SHEAR, WAVELENGTHS, Imager, spectral_scene
from vcc.gallery.cassi_recovery import Floats, Model
from vcc.light_field import LightField
from vcc.zoo.bench import SHAPE, inner
from vcc.zoo.decoders import Recorded
from vcc.zoo.entrants import Entrant, Exposure
from vcc.zoo.scenes import LEAVES, Scene, cropped
from vcc.zoo.task import PSNR, Measure, Task

Array = NDArray[np.float64]

ROWS, COLUMNS = SHAPE[0], SHAPE[1] - SHEAR
IMAGER = Imager((ROWS, COLUMNS), refine=4)
LEARNED = ("leaves-101", "leaves-102")
"""Scenes whose spectra are the prior of the linear decoder; they are in no run."""
TV_FACTOR, DENOISE_FACTOR = 0.5, 2.0
"""Factors of the noise, chosen on `LEARNED` out of 0.25, 0.5, 1, 2 and 4, the first one for CASSI."""
STEPS = 300
TRANSMISSION = 0.9
"""Of colour filters, at their peak."""


# --- scenes ---


def cube_of(name: str, sharp: Array) -> Array:
    """The radiance of a scene, white 1: (rows, columns, bands).

    Args:
        name: "drawn": the wall and patches of `vcc.gallery.cassi`, with the texture of the drawn scene.
            "leaves-N": discs in one plane, with the radii of the zoo's leaves, each with a smooth spectrum.
        sharp: the scene as a pinhole sees it.

    Raises:
        InputError: another scene, which has no spectra.
    """
    if name == "drawn":
        return spectral_scene(np.clip(cropped(sharp, (ROWS, COLUMNS)), 0, 1))[0]
    if not (match := re.fullmatch(LEAVES, name)):
        raise InputError(f"the scene {name} has no spectra: the task spectrum takes drawn and leaves-N")
    random = np.random.default_rng([31, int(match[1])])
    y, x = np.mgrid[:ROWS, :COLUMNS]
    cube = np.broadcast_to(_spectrum(random), (ROWS, COLUMNS, BANDS)).copy()
    for _ in range(250):
        radius = COLUMNS * min(0.015 / math.sqrt(1 - 0.99 * random.random()), 0.2)
        away = np.hypot(y - random.uniform(0, ROWS), x - random.uniform(0, COLUMNS))
        opacity = np.clip(radius - away + 0.5, 0, 1)[..., None]
        cube += opacity * (_spectrum(random) - cube)
    return cube


def _spectrum(random: np.random.Generator) -> Array:
    """A smooth reflectance: a grey, and a peak or an edge of any place and width."""
    wavelengths = np.array(WAVELENGTHS) / nm
    centre, width = random.uniform(430, 670), random.uniform(10, 60)
    low, high = random.uniform(0.02, 0.4), random.uniform(0.1, 0.95)
    if random.random() < 0.5:
        shape = np.exp(-((wavelengths - centre) ** 2) / (2 * width**2))
    else:
        shape = 1 / (1 + np.exp(-(wavelengths - centre) / (width / 3) * random.choice([-1, 1])))
    return np.asarray(low + (high - low) * shape)


def truth(scene: Scene) -> Array:
    """The cube of a scene."""
    return cube_of(scene.name, scene.sharp)


# --- cameras ---


def gaussian(centre: Any, width: float) -> Array:
    """The transmission of filters, (..., bands).

    Args:
        centre: nanometres, a number or an array.
        width: standard deviation, nanometres.
    """
    apart = np.array(WAVELENGTHS) / nm - np.asarray(centre, np.float64)[..., None]
    return np.asarray(TRANSMISSION * np.exp(-(apart**2) / (2 * width**2)))


BAYER = gaussian([[610, 540], [540, 470]], 30)
MOSAIC = gaussian(np.linspace(455, 645, 16).reshape(4, 4), 10)
"""Tiles, (rows, columns, bands)."""


def _tiled(tile: Array) -> Array:
    """Filters of all pixels."""
    rows, columns = tile.shape[:2]
    return np.tile(tile, (-(-ROWS // rows), -(-COLUMNS // columns), 1))[:ROWS, :COLUMNS]


def entrants(own: list[Entrant]) -> list[Entrant]:
    """CASSI and a mosaic of 16 bands; controls: a Bayer mosaic, a filter for one band after another, no filter."""
    assert not own  # `refuse` has raised
    plain = IMAGER.camera(coded=False, dispersed=False, mono=False)
    coded = IMAGER.camera(mono=False)
    bands = tuple(Exposure(plain, 1 / BANDS, each[None, None]) for each in np.eye(BANDS))
    both = ("total variation", "linear")
    listed = [
        ("CASSI", (Exposure(coded),), ("total variation",), "Wagadarikar et al. 2008"),
        ("mosaic of 16 bands", (Exposure(plain, 1.0, _tiled(MOSAIC)),), both, "Geelen et al. 2014"),
        ("Bayer mosaic", (Exposure(plain, 1.0, _tiled(BAYER)),), both, ""),
        ("band after band", bands, ("as recorded", "denoised"), ""),
        ("grey", (Exposure(plain),), ("linear",), ""),
    ]
    compared = ("band after band", "Bayer mosaic")
    return [
        Entrant(name, exposures, compared if source else (), source, decoders, False, {"refine": IMAGER.refine})
        for name, exposures, decoders, source in listed
    ]


def refuse(_: Camera, name: str) -> None:
    """Camera files do not take part.

    Raises:
        InputError: always.
    """
    raise InputError(f"{name}: the task spectrum takes no camera files, but decoders (--decoder my.py:decode)")


# --- decoders ---


@dataclass(frozen=True, eq=False, repr=False)
class Filtered(Brief, Model):
    """A sensor behind filters, as a matrix: its code has bands, (bands, rows, columns), and nothing is moved."""

    def __call__(self, cube: NDArray[np.floating]) -> Floats:
        """The sum over bands."""
        return np.asarray((self.code * cube).sum(axis=0), np.float32)

    def transpose(self, image: NDArray[np.floating]) -> Floats:
        """The adjoint."""
        return np.asarray(self.code * image, np.float32)


@lru_cache(maxsize=1)
def _cassi() -> Model:
    return Model(IMAGER.recorded_code.astype(np.float32), IMAGER.measured_shears)


def model_of(recorded: Recorded) -> Model:
    """The camera as a matrix: of the code and shears that a calibration shows, or of filters."""
    filters = recorded.exposures[0].filters
    if filters is None:
        return _cassi()
    upright = np.moveaxis(filters, -1, 0)
    return Filtered(np.ascontiguousarray(upright, np.float32), np.zeros(BANDS))


def by_total_variation(recorded: Recorded, factor: float | None = None) -> Array:
    """The cube with a small total variation (`vcc.gallery.cassi_recovery.Model.cube`)."""
    model = model_of(recorded)
    white = model(np.ones((BANDS, ROWS, COLUMNS), np.float32))
    scale = float(white.mean()) / BANDS  # of white, in the values of the model
    shared = float(model(model.transpose(np.ones_like(white))).mean())
    noise = BANDS * scale * recorded.noise / math.sqrt(shared)
    weight = (TV_FACTOR if factor is None else factor) * noise
    return model.cube(recorded.values * scale, weight, STEPS)


@lru_cache(maxsize=1)
def _known() -> tuple[Array, Array]:
    """The mean and the covariance of the spectra of `LEARNED`."""
    spectra = np.concatenate([cube_of(name, np.empty(0)).reshape(-1, BANDS) for name in LEARNED])
    return spectra.mean(axis=0), np.cov(spectra.T)


def by_linear_estimate(recorded: Recorded) -> Array:
    """Each colour interpolated, then the linear estimate of least mean squared error of each spectrum.

    Its prior is the covariance of spectra of scenes that are in no run (Wiener estimation).
    """
    filters = recorded.exposures[0].filters
    upright = np.ones((ROWS, COLUMNS, BANDS)) if filters is None else filters
    kinds, which = np.unique(upright.reshape(-1, BANDS), axis=0, return_inverse=True)
    which = which.reshape(ROWS, COLUMNS)
    values = recorded.values * upright.mean()  # of white in a pixel without filter
    across = math.sqrt(len(kinds))
    found = []
    for kind in range(len(kinds)):
        inside = (which == kind).astype(np.float64)
        near = [
            ndimage.gaussian_filter(each, across / 2 if across > 1 else 0) for each in (values * inside, inside)
        ]
        found.append(near[0] / np.maximum(near[1], 1e-9))
    mean, covariance = _known()
    seen = kinds / BANDS
    noise = (recorded.noise * upright.mean()) ** 2 * np.eye(len(kinds))
    gain = covariance @ seen.T @ np.linalg.inv(seen @ covariance @ seen.T + noise)
    return np.asarray(mean + (np.stack(found, axis=-1) - seen @ mean) @ gain.T)


def as_recorded(recorded: Recorded) -> Array:
    """A picture of each band."""
    return np.moveaxis(recorded.values, 0, -1)


def denoised(recorded: Recorded, factor: float | None = None) -> Array:
    """The same by total variation, all bands together (Chambolle 2004, of scikit-image)."""
    with checks.package("total variation", "scikit-image", "zoo"):
        from skimage.restoration import denoise_tv_chambolle
    weight = (DENOISE_FACTOR if factor is None else factor) * recorded.noise
    return np.asarray(denoise_tv_chambolle(as_recorded(recorded), weight=weight, channel_axis=-1))


# --- the task ---


def _scores(decoded: Array, true: Array) -> tuple[float, float]:
    """PSNR over all bands, white 1, and the mean angle between spectra, degrees; without borders."""
    found, wanted = (np.moveaxis(inner(np.moveaxis(each, -1, 0)), 0, -1) for each in (decoded, true))
    lengths = np.linalg.norm(found, axis=-1) * np.linalg.norm(wanted, axis=-1)
    cosine = (found * wanted).sum(axis=-1) / np.maximum(lengths, 1e-9)
    return psnr(found, wanted, peak=1.0), float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())


def _colours(cube: Array) -> Array:
    """Red, green and blue: means of thirds of the bands."""
    return np.stack([each.mean(axis=-1) for each in np.array_split(cube, 3, axis=-1)[::-1]], axis=-1)


def _white() -> LightField:
    return IMAGER.field(np.ones((ROWS, COLUMNS, BANDS)))


SPECTRUM = Task(
    "spectrum",
    f"The spectrum of each pixel, {BANDS} bands, out of one exposure time",
    (0.0,),
    entrants,
    {
        "total variation": by_total_variation,
        "linear": by_linear_estimate,
        "as recorded": as_recorded,
        "denoised": denoised,
    },
    (PSNR, Measure("angle", "°", False, 1)),
    truth,
    _scores,
    (ROWS, COLUMNS, BANDS),
    ("a filter for one band after another", "a Bayer mosaic"),
    _colours,
    lambda scene: IMAGER.field(truth(scene)),
    _white,
    math.pi / 4 * (PUPIL / IMAGER.to_code) ** 2 * PITCH**2,
    ROWS * COLUMNS,
    inverted=False,  # the relay lens turns the image once more
    check=refuse,
)
