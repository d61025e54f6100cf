"""The recording class: the digital numbers of a sensor, with methods that convert and save them."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from os import PathLike
from typing import Any, Literal

import numpy as np
from numpy.typing import DTypeLike, NDArray

from vcc.base.errors import InputError, warn_of_result
from vcc.base.showing import Shown
from vcc.base.units import short
from vcc.fields.sampled import as_array
from vcc.files.destination import Target
from vcc.files.image_metadata import CameraMark, ImageMetadata, RawNumbers
from vcc.files.images_with_metadata import read_with_metadata, unknown
from vcc.files.pictures import SavedPicture, save_numbers
from vcc.image import Image, PhotodiodeImage
from vcc.optics.sensor import Sensor
from vcc.optics.train import Train
from vcc.run.demosaic import Demosaicing, demosaic
from vcc.run.expose import Exposure, RawPicture, below_zero, cut_off
from vcc.run.photon_transfer import PhotonTransfer as PhotonTransfer
from vcc.run.photon_transfer import photon_transfer as photon_transfer


@dataclass(frozen=True, eq=False, repr=False)
class Recording(RawPicture, Shown):
    """The digital numbers of a sensor, as they are read out, with the data to interpret them.

    Made by `vcc.Camera.expose` and `expose_image`; or read from a file with the camera's sensor
    (`load_recording`).

    Args:
        values: digital numbers, uint8 (up to 8 bits) or uint16. (rows, columns) with a colour filter or for
            grey light, otherwise (rows, columns, channels): one sensor per channel, behind a prism that
            separates colours. Inverted as on the sensor, upside down.
        sensor: that recorded them, with electronics.
        exposure: exposure time, seconds.
        radiance: the radiance of a light field's sample value of 1, W/(m²·sr).
        seed: of the noise.
        saturated: share of the pixels, 0 to 1, at full well or at the largest number (in any channel).
        missing_rays: share of the camera's required rays that are outside the light field, 0 to 1.
        camera: that made the recording, or its description in a file; None if unknown. It is written to files.

    Raises:
        InputError: a sensor without electronics, or values of a wrong shape or type.
    """

    camera: Train | CameraMark | None = None

    def image(self) -> Image:
        """The irradiance estimated from the numbers: as from `vcc.Camera.capture`, with noise.

        The mean dark charge is subtracted; PRNU and DSNU stay, as without a calibration. For saturated pixels the
        irradiance is a lower bound.

        Returns:
            float32 irradiance, shape of the values (with a colour filter: each pixel in its own channel).
        """
        return Image(self.irradiance(), self.frame, missing_rays=self.missing_rays, camera=self.camera)

    def demosaiced(self, method: Demosaicing | None = None) -> Image:
        """The image in all channels, for a recording with a colour filter, in the unit of `image`.

        - ``"menon"``: Menon et al. (2007), interpolates along edges; Bayer tiles. The default for these.
        - ``"malvar"``: Malvar et al. (2004), linear with gradients of the other channels; Bayer tiles.
        - ``"bilinear"``: each channel separately, the nearest samples weighted by distance (normalised
          convolution, Knutsson & Westin 1993); any tile. The default for other tiles.

        The first two use the optional package colour-demosaicing; all methods work on linear irradiance, in
        which grey light has the same value in every channel.

        Returns:
            float32 irradiance, shape (rows, columns, channels); inverted as on the sensor, upside down.

        Raises:
            InputError: no colour filter, an unknown method, a method that does not support the tile, a sensor
                smaller than its tile, or a missing package.
        """
        electronics = self.electronics
        if electronics.color_filter is None:
            raise InputError("the sensor has no colour filter, so that there is nothing to demosaic: use image()")
        values = demosaic(self.irradiance(), electronics, method)
        return Image(values, self.frame, missing_rays=self.missing_rays, camera=self.camera)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """The digital numbers for ``numpy.asarray(recording)``, without a copy if possible."""
        return as_array(self.values, dtype, copy)

    def save(self, path: Target, *, format: str | None = None) -> SavedPicture:
        """Write the numbers unchanged to a .tif, .png or .npy file: linear, not scaled, upside down as recorded.

        The file also contains JSON metadata about the numbers (exposure, gain, black level, filter, …; see
        `vcc.files.image_metadata`), so that `load_recording` restores the recording.

        Args:
            path: of the file; or a buffer, such as ``io.BytesIO()``, or a file opened with "wb".
            format: of a buffer: "tif", "png" or "npy".

        Raises:
            InputError: an unsupported ending or format, a buffer without a format, channels that the format
                does not support, or a file that cannot be written.
        """
        words = f"{self.electronics.bit_depth}-bit raw, {self.electronics.filter_in_words}, {self._in_words()}"
        return save_numbers(self.values, path, self._metadata(), words, format)

    def _metadata(self) -> ImageMetadata:
        """Metadata of the numbers, for a file."""
        return ImageMetadata(
            "digital numbers",
            upright=False,
            clipped=self.saturated,
            full_scale=float(self.electronics.largest_number),
            frame=self.frame,
            camera=CameraMark.of(self.camera) if isinstance(self.camera, Train) else self.camera,
            recording=self._raw_numbers(),
        )

    def _raw_numbers(self) -> RawNumbers:
        """The parameters that interpret the numbers."""
        electronics = self.electronics
        return RawNumbers(
            exposure_seconds=self.exposure,
            gain_dn_per_electron=electronics.gain,
            black_level_dn=electronics.black_level,
            dark_level_dn=electronics.black_level + electronics.gain * electronics.dark_current * self.exposure,
            dn_per_irradiance=tuple(electronics.gain * freed for freed in self._electrons_per_light()),
            bit_depth=electronics.bit_depth,
            full_well_electrons=electronics.full_well,
            color_filter=electronics.color_filter,
            radiance_of_1_in_w_per_m2_sr=self.radiance,
            seed=self.seed,
        )

    def _in_words(self) -> str:
        return f"exposed {short(self.exposure, 'time', 4)}, {self.saturated:.2%} of the pixels saturated"

    def __repr__(self) -> str:
        electronics = self.electronics
        size = "×".join(map(str, self.values.shape))
        pitch = short(abs(self.frame.determinant) ** 0.5)
        charge = (float(self.values.mean(dtype=np.float64)) - electronics.black_level) / electronics.gain
        missing = f", {self.missing_rays:.1%} of the rays missing" if self.missing_rays > 0 else ""
        ways = ".image()" if electronics.color_filter is None else ".image() · .demosaiced()"
        return (
            f"Recording({size}, pixel {pitch}, {electronics.filter_in_words}, {self._in_words()}, "
            f"seed {self.seed}{missing})\n"
            f"  numbers    {self.values.min()} to {self.values.max()}, of 0 to {electronics.largest_number}; "
            f"black is {electronics.black_level:g}, an electron {electronics.gain:g}\n"
            f"  electrons  {charge:.4g} on average, {charge / electronics.saturation:.1%} of saturation\n"
            f"  next       {ways} · .electrons() · .save('raw.tif')"
        )


@dataclass(frozen=True, eq=False, repr=False)
class PhotodiodeRecording(Recording):
    """The recording of pixels with several photodiodes: the sum of their numbers, and the recording of each.

    ``recording.photodiodes[row][column]`` is a `Recording` with noise of its own, in the order of
    `vcc.image.PhotodiodeImage`. The sum is a recording, too: of electronics whose full well, black level, dark
    current and noise are those of all photodiodes together (`vcc.Electronics.binned`).

    Args:
        photodiodes: one exposure, rows of columns.
    """

    photodiodes: tuple[tuple[Recording, ...], ...] = ()

    def image(self) -> PhotodiodeImage:
        """The irradiance from the numbers of each photodiode; see `Recording.image`."""
        return PhotodiodeImage.of([[each.image() for each in row] for row in self.photodiodes], self.camera)


def expose_image(
    image: Image,
    sensor: Sensor,
    exposure: float | Literal["auto"] = "auto",
    *,
    seed: int = 0,
    radiance: float = 1.0,
    threads: int | None = None,
) -> Recording:
    """The recording of an image on a sensor; cheaper than `vcc.Camera.expose` for many exposures.

    Args:
        image: irradiance on that sensor, from `vcc.Camera.capture`: radiance × steradian.
        sensor: with electronics.
        exposure: exposure time, seconds, or ``"auto"``: the time after which the brightest 0.1 % of the
            pixels, each in its brightest channel, reach at least 90 % of the full well or of the largest
            number, whichever comes first.
        seed: of the noise, an integer; recordings with different seeds are independent.
        radiance: the radiance of a light field's sample value of 1, W/(m²·sr), in each channel's band.
        threads: how many run at once; None uses all cores available to this process. The numbers do not
            depend on it.

    Raises:
        InputError: a sensor without electronics or of another shape, an upright image, channels that the
            electronics cannot record, values that are not finite, an invalid exposure, seed or radiance; or
            "auto" without light.

    Warns:
        ResultWarning: the image is negative by more than `vcc.run.expose.UNDERSHOOT` of its largest value.
            Negative light does not exist, so it is set to 0. Smaller undershoots, from sharp interpolation at
            hard edges, are also set to 0, without a warning. Or noise of dark pixels is cut off at the digital
            number 0, because the black level is too low.
    """
    return recorded(image, Exposure(sensor, exposure, seed, radiance, threads))


def recorded(image: Image, exposure: Exposure) -> Recording:
    """The recording of an image on a sensor; see `expose_image`, and `vcc.Camera.expose`.

    Args:
        image: irradiance, not upright.
        exposure: the settings of the recording.
    """
    rows = image.photodiodes if isinstance(image, PhotodiodeImage) else ((image,),)
    if (len(rows), len(rows[0])) != exposure.sensor.photodiodes:
        of_image, of_sensor = (
            "×".join(map(str, grid)) for grid in ((len(rows), len(rows[0])), exposure.sensor.photodiodes)
        )
        raise InputError(
            f"this is the image of {of_image} photodiodes in a pixel, and the sensor has {of_sensor}, each with "
            "its own electronics: use camera.expose, or the image that camera.capture returns for this sensor"
        )
    if isinstance(image, PhotodiodeImage):
        return _recorded_by_photodiodes(image, exposure)
    if not image.inverted:
        raise InputError("the image is upright, but a sensor records the inverted one: pass the image as captured")
    light = image.to_numpy()
    raw = exposure.recorded(light, image.missing_rays)
    for caution in (below_zero(light), cut_off(raw.values, raw.electronics)):
        if caution is not None:
            warn_of_result(caution)
    return Recording(**{each.name: getattr(raw, each.name) for each in fields(raw)}, camera=image.camera)


def _recorded_by_photodiodes(image: PhotodiodeImage, exposure: Exposure) -> PhotodiodeRecording:
    """One exposure of all photodiodes: "auto" goes by the brightest photodiode of each pixel."""
    sensor = exposure.sensor
    lights = [[each.to_numpy() for each in row] for row in image.photodiodes]
    timed = exposure.timed(np.maximum.reduce([light for row in lights for light in row]))
    plain = replace(timed, sensor=replace(sensor, photodiodes=(1, 1), microlens=None))
    columns = len(image.photodiodes[0])
    parts = [
        [recorded(each, replace(plain, photodiode=row * columns + column)) for column, each in enumerate(images)]
        for row, images in enumerate(image.photodiodes)
    ]
    listed = [each for row in parts for each in row]
    electronics = listed[0].electronics.binned(len(listed))
    total = np.stack([each.values for each in listed]).sum(axis=0, dtype=np.uint32)
    return PhotodiodeRecording(
        total.astype(np.uint8 if electronics.bit_depth <= 8 else np.uint16),
        replace(plain.sensor, electronics=electronics),
        listed[0].exposure,
        exposure.radiance,
        exposure.seed,
        max(each.saturated for each in listed),
        image.missing_rays,
        image.camera,
        photodiodes=tuple(map(tuple, parts)),
    )


def load_recording(path: str | PathLike[str], sensor: Sensor) -> Recording:
    """Read a recording from a file that `Recording.save` wrote.

    Args:
        path: a TIFF, PNG or .npy file.
        sensor: that recorded it, with electronics; the file contains only the parameters that interpret the
            numbers.

    Raises:
        InputError: a file that cannot be read, without metadata of such a recording, or with numbers that
            were changed after it was written; a sensor that contradicts the file.
    """
    stated = read_with_metadata(path)
    said = stated.metadata
    if said is None or said.recording is None:
        is_none = unknown(stated) if said is None else f"{path} contains {said.in_words}"
        raise InputError(
            f"{is_none}, not those of a recording: vcc.load_image reads pictures, and vcc.Recording takes "
            "numbers, a sensor and an exposure time"
        )
    numbers = said.recording
    found = Recording(
        stated.samples,
        sensor,
        numbers.exposure_seconds,
        numbers.radiance_of_1_in_w_per_m2_sr,
        numbers.seed,
        said.clipped or 0.0,
        camera=said.camera,
    )
    own = found._raw_numbers()
    wrong = numbers.unlike(own)
    if wrong is not None:
        raise InputError(
            f"{wrong} is {getattr(numbers, wrong)} in {path}, but {getattr(own, wrong)} for this sensor: "
            "pass the sensor that recorded it"
        )
    return found
