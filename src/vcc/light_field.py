"""The light field class: samples in memory, with methods that transform them and make images."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.engines import on_gpu
from vcc.fields.filling import Filling
from vcc.fields.grid import ALL, Beyond, Sample, camera_array_frame
from vcc.fields.sampled import to_numpy
from vcc.fields.samples import InMemory, shape_of
from vcc.fields.view_arrays import in_grid, warn_of_codes
from vcc.image import Image
from vcc.run import operators

if TYPE_CHECKING:
    from vcc.optics import Element, Mask
    from vcc.optics.sensor import Sensor


class LightField(InMemory):
    """The 4-D light field: radiance samples, and the frame that maps each sample to a ray.

    Args:
        values: radiance, shape (v, u, t, s) or (v, u, t, s, channels): rows of views, columns of views,
            rows of pixels, columns of pixels. A NumPy array, or one of PyTorch, JAX or another array-API
            library. Floating-point values are radiance in any unit; unsigned integers are fractions of
            their largest value (8-bit 255 is radiance 1). Linear in light, not display-referred.
        frame: maps (i, j, k, l, 1) to the ray (u, v, s, t, 1) in metres and slopes at the plane of the light
            field; i counts along u (axis 1), j along v (axis 0), k along s (axis 3), l along t (axis 2). A
            camera uses this plane as its entrance plane z = 0.
        disparity_range: (lowest, highest) disparity of the scene in pixels per view along u, positive =
            nearer than the plane on which the views converge; None if unknown. It determines the
            interpolation between views under strong defocus; if unknown, it is estimated from the views when
            needed.
        sample: the meaning of a sample: ``"mean"``, the mean radiance over the cell of its pixel, as from cameras
            and renderers; ``"point"``, the radiance of the ray at the centre of the cell, as from a formula. A
            camera compensates for the loss of sharpness by the averaging.
        disparity: disparity of each pixel, pixels per view along u, (v, u, t, s) for all views or (t, s) for the
            middle one, ((rows − 1) // 2, (columns − 1) // 2); used for ``between_views="depth"`` of
            `vcc.Camera.capture`. None estimates it when it is needed. The attribute is a
            `vcc.fields.disparity.Disparities`.
        extent: for a piece, (rows, columns) of views of the whole light field, in steps of the piece; None
            for a whole light field.
        beyond: for a piece, (before, after) along (v, u, t, s): the number of samples of the whole light
            field beyond the piece, in steps of the piece. Slicing sets it; none for a whole light field.
        wavelengths: see `with_wavelengths`.
        filling: which views were not recorded but rendered from the others or left dark, with their estimated
            errors, see `vcc.fields.filling.Filling`; None if all were recorded. ``given`` is its (rows, columns)
            of recorded views.

    Raises:
        InputError: not 4-D or 5-D, an empty axis, a dtype that is not unsigned integer or floating point,
            samples that are NaN, infinite or negative, a frame that is not 5×5 and invertible, an invalid
            ``sample``, or a disparity of a wrong shape or that is not finite.
    """

    def __init__(
        self,
        values: Any = None,
        frame: Affine | None = None,
        disparity_range: tuple[float, float] | None = None,
        sample: Sample = "mean",
        disparity: Any = None,
        extent: tuple[float, float] | None = None,
        beyond: Beyond = ALL,
        wavelengths: Sequence[float] | None = None,
        filling: Filling | None = None,
    ) -> None:
        if values is None or frame is None:
            raise InputError(
                f"LightField needs {'values and a frame' if values is None else 'a frame'}: "
                "LightField.from_views(values, spacing, slope_per_pixel, focus_distance) makes it for views of "
                "parallel cameras, and vcc.open_light_field reads files"
            )
        scene = (disparity_range, sample, disparity, extent, beyond, wavelengths)
        super().__init__(values, frame, *scene, filling)  # type: ignore[arg-type]

    @classmethod
    def from_views(
        cls,
        values: Any,
        spacing: float | tuple[float, float],
        slope_per_pixel: float | tuple[float, float],
        focus_distance: float = math.inf,
        disparity_range: tuple[float, float] | None = None,
        sample: Sample = "mean",
        disparity: Any = None,
        *,
        grid: tuple[int, int] | None = None,
        channels: bool | None = None,
    ) -> LightField:
        """A light field from images of a planar array of parallel cameras, upright, row 0 at the top.

        View (j, i) and pixel (l, k) are counted from the centre of their grids (i₀, j₀, k₀, l₀):
        u = (i − i₀)·du, s = u/F − (k − k₀)·ps; v and t likewise. A point at distance Z then moves by
        −du·(1/Z − 1/F)/ps pixels per view.

        Args:
            values: the images, shape (rows of views, columns of views, rows, columns[, channels]); with
                ``grid``, (views, rows, columns[, channels]).
            spacing: distance between neighbouring views, metres: one number or (dv, du).
            slope_per_pixel: pixel pitch over focal length of the cameras: one number or (pt, ps).
            focus_distance: of the plane on which the views converge, metres (shifted, not rotated, cameras);
                infinite if their axes are parallel.
            disparity_range: see `LightField`.
            sample: see `LightField`.
            disparity: see `LightField`.
            grid: (rows, columns) of views, if all views are along one axis of ``values``, row by row from the
                top left.
            channels: whether the last axis of ``values`` contains channels; None derives it from the shape.

        Raises:
            InputError: a spacing, slope or focus distance that is not positive, or an error of `LightField`;
                a grid or channels that do not fit; an ambiguous shape such as (25, 64, 64, 3), either 25
                colour images or 25×64 views 3 pixels wide: pass ``grid``, or ``channels=False``.

        Warns:
            ResultWarning: floating-point samples look like 8-bit codes, 0 to 255.
        """
        values = in_grid(values, shape_of(values), grid, channels)
        warn_of_codes(values)
        frame = camera_array_frame(shape_of(values), spacing, slope_per_pixel, focus_distance)
        return cls(values, frame, disparity_range, sample, disparity)

    @property
    def flux(self) -> float:
        """The total light of the samples, per channel: Σ radiance × cell, m² × radiance."""
        total = float(np.sum(to_numpy(self.values), dtype=np.float64)) / self.full_scale
        return total * self.sample_volume / (self.channels or 1)

    def view(self, row: int, column: int) -> Image:
        """One view as an image; its frame is in metres on the plane 1 m before the light field.

        Args:
            row: row of views, 0 at the top; negative values count from the end.
            column: column of views, 0 at the left.

        Raises:
            InputError: no such view.
        """
        j, i = self.grid.place_of(row, column)
        at_view = self.frame @ Affine.translation(i, j, 0, 0)
        # A ray through this view with slope s comes from −s on the plane 1 m before it.
        looks_at = Affine.from_parts(-at_view.linear[2:, 2:], -at_view.offset[2:])
        values = to_numpy(self.values[j, i]) / np.float32(self.full_scale)
        return Image(values.astype(np.float32), looks_at, inverted=False)

    def on_gpu(self) -> LightField:
        """The light field with its samples on the GPU, copied once, for many images with ``engine="cuda"``.

        That engine is then the default, and images are NumPy arrays. Arrays of PyTorch or CuPy on a GPU do
        not need this: they are used without a copy.

        Raises:
            InputError: numba-cuda is not installed (extra ``gpu``), there is no GPU, or the samples are in
                main memory in an array of another library than NumPy.
        """
        return self.of(on_gpu(self.values), self.grid)

    def with_wavelengths(self, wavelengths: Sequence[float] | None) -> LightField:
        """The same light field with the wavelengths of its channels: ``with_wavelengths([610 * nm, 540 * nm])``.

        Args:
            wavelengths: in the middle of each channel's band, metres, in the order of the channels; for a light
                field without an axis of channels, one. None removes them.

        Raises:
            InputError: not as many as channels, or one that is not from 100 nm to 50 µm.
        """
        return self.of(self.values, replace(self.grid, wavelengths=wavelengths))  # type: ignore[arg-type]

    def scaled(self, factor: float) -> LightField:
        """The light field of a scene enlarged by ``factor`` (slopes stay the same).

        ``lf.scaled(0.05)`` reduces a gantry's 40 cm aperture to that of a lens; all distances to the scene
        are scaled as well.

        Raises:
            InputError: a factor that is not positive.
        """
        return self.of(self.values, self.grid.scaled(factor))

    def transformed(self, affine: Affine) -> LightField:
        """The light field after a linear element or free propagation: 𝕋 of the paper (section 3.2.1), exact, lazy.

        Only the frame changes: samples are not modified, no light is lost. Example:
        ``lf.transformed(Affine.lens(f))``.

        Args:
            affine: an invertible 5×5 map of rays.
        """
        return self.of(self.values, self.grid.moved(affine))

    def masked(self, mask: Mask, *, memory_limit: int | None = None) -> LightField:
        """The light field just behind a mask in its plane: the paper's dot product (section 3.2.3).

        Each sample is multiplied by the mask's mean over the sample's cell. This computes new float32
        samples; to get only an image, use a camera instead.

        Args:
            mask: its z is ignored: it is at the plane of the light field.
            memory_limit: bytes for the new samples; None uses `vcc.base.memory.MEMORY_LIMIT`.

        Raises:
            InputError: more memory needed than allowed.
        """
        return operators.masked(self, mask, memory_limit)

    def scattered(self, diffuser: Element, *, memory_limit: int | None = None) -> LightField:
        """The light field just behind a diffuser in its plane: the paper’s convolution (equation 6).

        L'(u, v, s, t) = ∫ D(δs, δt | u, v) L(u, v, s − δs, t − δt) dδ, within each view, with linear
        interpolation of samples along the slopes. Each view is extended on all sides by the reach of the
        kernel, so that no light is lost; outside the given views it is dark. If the kernel varies over the
        diffuser, each view uses the kernel at the centre of its cell of the aperture. This computes new
        float32 samples; to get only an image, use a camera instead.

        Args:
            diffuser: a `vcc.Diffuser`, a `vcc.CodedDiffuser` or any element that scatters and does not bend.
                Its z is ignored: it is at the plane of the light field. Its rim absorbs.
            memory_limit: bytes for the new samples; None uses `vcc.base.memory.MEMORY_LIMIT`.

        Raises:
            InputError: an element that does not scatter or that bends rays, a frame in which positions depend
                on the pixel and not on the view alone (after free propagation), a kernel over more than 8192
                samples, more memory needed than allowed.
        """
        return operators.scattered(self, diffuser, memory_limit)

    def resampled(
        self,
        frame: Affine,
        shape: tuple[int, int, int, int],
        *,
        interpolation: str = "linear",
        memory_limit: int | None = None,
    ) -> LightField:
        """The light field interpolated on another grid, 0 outside this one.

        The paper does this after each element (section 4.2, "the resolution issue"); it loses detail, while a
        frame does not. Means remain means over cells of the original size.

        Args:
            frame: 5×5, from the new grid's indices to rays at this plane.
            shape: (v, u, t, s) of the new grid.
            interpolation: ``"nearest"``, ``"linear"`` (4-D) or ``"cubic"`` (4-D cubic spline, cut at zero).
            memory_limit: bytes for the new samples; None uses `vcc.base.memory.MEMORY_LIMIT`.

        Raises:
            InputError: more memory needed than allowed, an unknown interpolation or a wrong shape.
        """
        return operators.resampled(self, frame, shape, interpolation, memory_limit)

    def projected(self, sensor: Sensor) -> Image:
        """The image on a sensor in this light field's plane: S of the paper, I(u, v) = ∫∫ L ds dt (eq. 5).

        Args:
            sensor: its z is ignored: it is at the plane of the light field.
        """
        return Camera([], replace(sensor, z=0.0)).capture(self)
