"""The image class: irradiance on a grid of pixels, and the frame that places it on the sensor."""

from __future__ import annotations

import math
import operator
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from numbers import Real
from os import PathLike
from typing import Any

import numpy as np
from array_api_compat import array_namespace
from numpy.typing import DTypeLike, NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError, ResultWarning
from vcc.base.showing import Shown
from vcc.base.units import short
from vcc.fields.sampled import IMAGE_AXES, Index, as_array, indices, taken, to_numpy
from vcc.files.destination import Target
from vcc.files.image_metadata import CameraMark, ImageMetadata, Quantity
from vcc.files.images_with_metadata import clipping, light_of, read_with_metadata, unknown
from vcc.files.pictures import Exposure, SavedPicture, coded_picture, save_picture
from vcc.optics.train import Train


@dataclass(frozen=True, eq=False, repr=False)
class Image(Shown):
    """Mean irradiance over each pixel, as light lands on the sensor.

    Args:
        values: irradiance, shape (rows, columns) or (rows, columns, channels), radiance × steradian. A
            captured image has an array of the light field's library (NumPy: float32).
        frame: maps (column, row, 1) to (x, y, 1) on the sensor, metres; x points right, y down, for a viewer
            who faces the scene.
        missing_rays: share of the camera's required rays that are outside the light field, 0 to 1.
        sampling_error: of an image by rays: the estimated sampling error, root mean square over the pixels,
            in units of the values; 0 without sampling.
        inverted: whether this is a real, upside-down image (as a camera records it), which `upright` rotates.
        camera: that made the image, or its description in a file; None if unknown. It is written to files.
    """

    values: Any
    frame: Affine
    missing_rays: float = 0.0
    sampling_error: float = 0.0
    inverted: bool = True
    camera: Train | CameraMark | None = None

    def __post_init__(self) -> None:
        if len(self.values.shape) not in (2, 3):
            raise InputError(
                f"an image has the axes (rows, columns[, channels]), not shape {tuple(self.values.shape)}"
            )
        if self.frame.dimensions != 2:
            raise InputError("an image needs a 3×3 frame, from (column, row, 1) to (x, y, 1)")

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the values: (rows, columns) or (rows, columns, channels)."""
        return tuple(self.values.shape)

    @property
    def pixel_area(self) -> float:
        """The area of a pixel, m²."""
        return abs(self.frame.determinant)

    def __getitem__(self, index: Index | tuple[Index, ...]) -> Image:
        """A part of the image, with its frame: slices along (rows, columns[, channel])."""
        frame, ranges = indices(self.shape, self.frame, index, IMAGE_AXES, "an image")
        return replace(self, values=taken(self.values, ranges), frame=frame)

    def upright(self) -> Image:
        """The image for viewing: rotated by 180° if it is inverted, otherwise unchanged."""
        if not self.inverted:
            return self
        rows, columns = self.shape[:2]
        turned = self.frame @ Affine(np.array([[-1.0, 0, columns - 1], [0, -1.0, rows - 1], [0, 0, 1]]))
        values = self.values
        if isinstance(values, np.ndarray):
            values = values[::-1, ::-1]
        else:
            values = array_namespace(values).flip(values, axis=(0, 1))
        return replace(self, values=values, frame=turned, inverted=False)

    def to_numpy(self) -> NDArray[np.float32]:
        """The values as a float32 NumPy array in main memory."""
        return to_numpy(self.values).astype(np.float32, copy=False)

    def __add__(self, other: Any) -> Image:
        """The sum of two images with the same frame, or of an image and a number.

        The sum has the missing rays of the worse image; sampling errors add up. Different frames raise
        `InputError`.
        """
        return self._combined(other, operator.add, "added to")

    def __sub__(self, other: Any) -> Image:
        """The difference of two images with the same frame, or of an image and a number; see the sum."""
        return self._combined(other, operator.sub, "subtracted from")

    def __mul__(self, factor: Any) -> Image:
        """The image times a number."""
        return self._scaled(factor, operator.mul)

    def __truediv__(self, divisor: Any) -> Image:
        """The image divided by a number."""
        return self._scaled(divisor, operator.truediv)

    __radd__, __rmul__ = __add__, __mul__

    def _combined(self, other: Any, operation: Callable[[Any, Any], Any], what: str) -> Image:
        """Sum or difference.

        Raises:
            InputError: images of different shapes, frames or orientations.
        """
        if isinstance(other, Real):
            return replace(self, values=operation(self.values, float(other)))
        if not isinstance(other, Image):
            raise TypeError(
                f"a {type(other).__name__} cannot be {what} an image: calculate with np.asarray(image)"
            )
        if (self.shape, self.frame, self.inverted) != (other.shape, other.frame, other.inverted):
            raise InputError(
                f"{other!r} cannot be {what} {self!r}: shape, frame and inverted must agree. Without frames, "
                "calculate with np.asarray(image)"
            )
        return replace(
            self,
            values=operation(self.values, other.values),
            missing_rays=max(self.missing_rays, other.missing_rays),
            sampling_error=self.sampling_error + other.sampling_error,
            camera=self.camera if self.camera == other.camera else None,
        )

    def _scaled(self, factor: Any, operation: Callable[[Any, Any], Any]) -> Image:
        if not isinstance(factor, Real):
            raise TypeError(
                f"an image is multiplied or divided by a number, not by a {type(factor).__name__}: use "
                "np.asarray(image)"
            )
        values = operation(self.values, float(factor))
        return replace(self, values=values, sampling_error=abs(operation(self.sampling_error, float(factor))))

    def to_xarray(self) -> Any:
        """The image as an `xarray.DataArray` with the positions of its pixels; needs the package xarray.

        Returns:
            Dimensions (y, x[, channel]). Coordinates x, y: centres of the pixels on the sensor, metres, x
            to the right and y down. Attributes: missing_rays, sampling_error, inverted.

        Raises:
            InputError: xarray is not installed, or the pixels are rotated or sheared.
        """
        linear, offset = self.frame.linear, self.frame.offset
        if linear[0, 1] or linear[1, 0]:
            raise InputError("pixels of this image are rotated or sheared: they have no coordinates along x and y")
        try:
            import xarray
        except ImportError:
            raise InputError("to_xarray needs the package xarray: pip install xarray") from None
        rows, columns = self.shape[:2]
        places = {
            "y": ("y", offset[1] + linear[1, 1] * np.arange(rows), {"units": "m"}),
            "x": ("x", offset[0] + linear[0, 0] * np.arange(columns), {"units": "m"}),
        }
        about = {
            "long_name": "irradiance",
            "missing_rays": self.missing_rays,
            "sampling_error": self.sampling_error,
            "inverted": int(self.inverted),  # netCDF has no booleans
        }
        axes = ("y", "x", "channel")[: len(self.shape)]
        return xarray.DataArray(self.to_numpy(), coords=places, dims=axes, name="image", attrs=about)

    def __array__(self, dtype: DTypeLike | None = None, copy: bool | None = None) -> NDArray[Any]:
        """The values for ``numpy.asarray(image)``: inverted as on the sensor, without a copy if possible."""
        return as_array(self.values, dtype, copy)

    def to_srgb(self, exposure: Exposure = "auto", *, upright: bool = True, bits: int = 8) -> NDArray[Any]:
        """The image as sRGB codes, as `save` writes it to a PNG.

        Args:
            exposure: as in `save`.
            upright: as in `save`.
            bits: 8 or 16.

        Returns:
            uint8 or uint16, shape (rows, columns) for one channel, otherwise (rows, columns, 3).

        Raises:
            InputError: an exposure that is not a positive finite number, an invalid number of bits, values
                that are not finite, or neither 1 nor 3 channels.
        """
        values = (self.upright() if upright else self).to_numpy()
        return coded_picture(values, exposure, bits, "in sRGB, which").codes

    def save(
        self,
        path: Target,
        *,
        exposure: Exposure = "auto",
        upright: bool = True,
        bits: int | None = None,
        format: str | None = None,
    ) -> SavedPicture:
        """Write the image; the ending of ``path`` selects the format.

        - ``.png``: sRGB, 8 bits (or 16), for viewing
        - ``.tif``, ``.tiff``: sRGB, 16 bits (or 8)
        - ``.jpg``, ``.jpeg``: sRGB, 8 bits, lossy, for slides; `load_image` does not read it
        - ``.exr``: linear float32, values unchanged; channels R, G, B or Y
        - ``.npy``: linear float32, values unchanged

        Each file contains metadata about its numbers (`vcc.files.image_metadata`), so that `load_image`
        restores the image.

        Args:
            path: of the file; or a buffer, such as ``io.BytesIO()``, or a file opened with "wb".
            exposure: the factor that maps the values to the range 0…1 of an sRGB file. "auto" uses 1 over the
                99.5th percentile of the pixels' brightest channels: at most 0.5 % of the pixels clip. The
                factor is returned, so that another image can be written with the same one.
            upright: whether to rotate a real image (upside down on the sensor) for viewing.
            bits: bits per sample for PNG and TIFF.
            format: of a buffer: "png", "tif", "jpg", "exr" or "npy".

        Returns:
            The path, the exposure, the share of clipped pixels, and all of this as text. The file is written
            completely or not at all.

        Raises:
            InputError: an unknown ending or format, a buffer without a format, a folder that does not exist
                or is not writable, an exposure that is not a positive finite number (or not 1, for .exr and
                .npy), bits or a number of channels that the format does not support, or values that are not
                finite.
        """
        shown = self.upright() if upright else self
        values, said = shown.to_numpy(), shown._metadata()
        return save_picture(values, path, statement=said, exposure=exposure, bits=bits, format=format)

    def _metadata(self) -> ImageMetadata:
        """Metadata of the values, for a file."""
        mark = CameraMark.of(self.camera) if isinstance(self.camera, Train) else self.camera
        quantity: Quantity = "light" if mark is None else "irradiance"
        return ImageMetadata(quantity, upright=not self.inverted, frame=self.frame, camera=mark)

    def __repr__(self) -> str:
        pitch = short(self.pixel_area**0.5)
        missing = f", {self.missing_rays:.1%} of the rays missing" if self.missing_rays > 0 else ""
        return f"Image({'×'.join(map(str, self.shape))}, pixel {pitch}{missing})"


def interleaved(kinds: Sequence[Sequence[Image]], camera: Train | CameraMark | None) -> Image:
    """The image whose pixels alternate between images of one frame, in a tile that begins at the top left pixel.

    Args:
        kinds: rows of columns of the tile.
        camera: that made it.
    """
    listed = [image for row in kinds for image in row]
    first = listed[0]
    if isinstance(first, PhotodiodeImage):
        grid = [[(r, c) for c in range(len(row))] for r, row in enumerate(first.photodiodes)]
        return PhotodiodeImage.of(
            [
                [interleaved([[one.photodiodes[r][c] for one in row] for row in kinds], camera) for r, c in places]  # type: ignore[attr-defined]
                for places in grid
            ],
            camera,
        )
    space = array_namespace(first.values)
    values = first.values * 0
    for r, row in enumerate(kinds):
        for c, image in enumerate(row):
            own = np.zeros((*first.shape[:2], *(1,) * (len(first.shape) - 2)), dtype=np.float32)
            own[r :: len(kinds), c :: len(row)] = 1
            values = values + image.values * space.asarray(own)
    return replace(
        first,
        values=values,
        missing_rays=max(image.missing_rays for image in listed),
        sampling_error=math.sqrt(sum(image.sampling_error**2 for image in listed) / len(listed)),
        camera=camera,
    )


@dataclass(frozen=True, eq=False, repr=False)
class PhotodiodeImage(Image):
    """The image of pixels with several photodiodes: the ordinary image, their sum, and the image of each
    photodiode.

    ``image.photodiodes[row][column]`` is an `Image` as the sensor of `vcc.Sensor.photodiodes` defines it: column 0
    lies on the left of the pixel, at smaller x, and records light from the right half of the exit pupil. `upright`
    turns images and order, so that column 0 stays the one on the left. Slices, factors and divisors apply to each
    photodiode.

    Args:
        photodiodes: images of one frame, rows of columns.
    """

    photodiodes: tuple[tuple[Image, ...], ...] = ()

    @classmethod
    def of(cls, photodiodes: Sequence[Sequence[Image]], camera: Train | CameraMark | None) -> PhotodiodeImage:
        """From the images of photodiodes, rows of columns."""
        listed = [image for row in photodiodes for image in row]
        values = listed[0].values
        for image in listed[1:]:
            values = values + image.values
        return cls(
            values,
            listed[0].frame,
            missing_rays=max(image.missing_rays for image in listed),
            sampling_error=math.hypot(*(image.sampling_error for image in listed)),
            inverted=listed[0].inverted,
            camera=camera,
            photodiodes=tuple(map(tuple, photodiodes)),
        )

    def sum(self) -> Image:
        """The ordinary image: all photodiodes together."""
        own = {each.name: getattr(self, each.name) for each in fields(Image)}
        return Image(**own)

    def _mapped(self, function: Callable[[Image], Image], *, turned: bool = False) -> PhotodiodeImage:
        found = [[function(image) for image in row] for row in self.photodiodes]
        return PhotodiodeImage.of([row[::-1] for row in found[::-1]] if turned else found, self.camera)

    def __getitem__(self, index: Index | tuple[Index, ...]) -> PhotodiodeImage:
        """A piece of the images, in its place: slices along (rows, columns[, channel])."""
        return self._mapped(lambda image: image[index])

    def upright(self) -> PhotodiodeImage:
        """The images as a person wants to see them, and the photodiodes in the order in which they then lie."""
        return self._mapped(Image.upright, turned=True) if self.inverted else self

    def _combined(self, other: Any, operation: Callable[[Any, Any], Any], what: str) -> Image:
        return self.sum()._combined(other.sum() if isinstance(other, PhotodiodeImage) else other, operation, what)

    def _scaled(self, factor: Any, operation: Callable[[Any, Any], Any]) -> Image:
        return self._mapped(lambda image: image._scaled(factor, operation))

    def to_xarray(self) -> Any:
        """The images of the photodiodes as one `xarray.DataArray`, as in `Image.to_xarray`.

        Returns:
            Dimensions (photodiode_y, photodiode_x, y, x[, channel]).
        """
        rows = [[image.to_xarray() for image in row] for row in self.photodiodes]
        import xarray

        # Coordinates and attributes of each are the same but for what is missing and sampled.
        joined = [xarray.concat(row, "photodiode_x", combine_attrs="override") for row in rows]
        found = xarray.concat(joined, "photodiode_y", combine_attrs="override")
        return found.assign_attrs(missing_rays=self.missing_rays, sampling_error=self.sampling_error)

    def __repr__(self) -> str:
        grid = f"{len(self.photodiodes)}×{len(self.photodiodes[0])}"
        return f"Photodiode{super().__repr__()[:-1]}, photodiodes {grid})"


def load_image(path: str | PathLike[str]) -> Image:
    """Read an image that `Image.save` or `vcc.Recording.save` wrote, using the metadata in the file.

    The sRGB curve and the exposure are inverted; raw numbers are converted to irradiance, as in
    `vcc.Recording.image`. The orientation is that of the file: see ``inverted``.

    Args:
        path: a PNG, TIFF, OpenEXR or .npy file.

    Returns:
        float32; for sRGB files within half a code, divided by the exposure.

    Raises:
        InputError: a file that cannot be read, without metadata about its numbers or its pixel size, or with
            numbers that were changed after it was written.

    Warns:
        ResultWarning: pixels were clipped when the file was written: their values are lower bounds.
    """
    stated = read_with_metadata(path)
    said = stated.metadata
    if said is None:
        raise InputError(
            f"{unknown(stated)}: vcc.formats.pictures.read_picture gives its numbers as they are, for an "
            "Image(values, frame) of your own"
        )
    if said.frame is None:
        raise InputError(
            f"{stated.path} does not contain the size of its pixels; it may be a view of a light field: open the "
            "folder with vcc.open_light_field"
        )
    if said.clipped and said.recording is None:
        warnings.warn(clipping(stated), ResultWarning, stacklevel=2)
    return Image(light_of(stated), said.frame, inverted=not said.upright, camera=said.camera)
