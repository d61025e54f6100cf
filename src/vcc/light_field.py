"""The light field that users meet: samples in memory, and the verbs that make pictures of them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.engines import on_gpu
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
    """The 4-D light field: radiance samples and the frame that says which ray each of them is.

    Args:
        values: radiance, shape (v, u, t, s) or (v, u, t, s, channels): rows of views, columns of views,
            rows of pixels, columns of pixels. A NumPy array, or one of PyTorch, JAX or another array-API
            library. Floating-point values are radiance in any unit; unsigned integers are fractions of
            their largest value (8-bit 255 is radiance 1). Linear in light, not display-referred.
        frame: maps (i, j, k, l, 1) to the ray (u, v, s, t, 1) in metres and slopes at the plane where the
            light field is given; i counts along u (axis 1), j along v (axis 0), k along s (axis 3), l along
            t (axis 2). A camera takes this plane to be its entrance plane z = 0.
        disparity_range: (lowest, highest) disparity of the scene in pixels per view along u, positive =
            nearer than the plane on which the views converge, where known. It decides how views are
            interpolated under strong defocus; unknown, it is measured from the pictures when needed.
        sample: what a sample says of the scene: ``"mean"``, the mean radiance over the cell of its pixel, as
            cameras and renderers give it; ``"point"``, the radiance of the ray in the middle of the cell, as a
            formula evaluated there gives it. A camera undoes what the samples' own averaging took from sharpness.
        disparity: pixels per view along u of each pixel, (v, u, t, s) for all views or (t, s) for the middle one,
            which is ((rows − 1) // 2, (columns − 1) // 2), where known: what ``between_views="depth"`` of
            `vcc.Camera.capture` goes by. None finds it when it is first asked for. The attribute is a
            `vcc.fields.disparity.Disparities`.
        extent: (rows, columns) of views of the light field that this is a piece of, counted in this piece's steps;
            None for a whole one.
        beyond: of a piece, (before, after) along (v, u, t, s): how many more samples, in this piece's steps, the
            light field has there that this is a piece of. Pieces that slicing makes have it; none for a whole one.

    Raises:
        InputError: not 4-D or 5-D, an empty axis, a dtype that is not unsigned integer or floating point,
            samples that are NaN, infinite or negative, a frame that is not 5×5 and invertible, another word for
            ``sample``, or a disparity of another shape or that is not finite.
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
    ) -> None:
        if values is None or frame is None:
            raise InputError(
                f"LightField needs {'values and a frame' if values is None else 'a frame'}: "
                "LightField.from_views(values, spacing, slope_per_pixel, focus_distance) makes it for views of "
                "parallel cameras, and vcc.open_light_field reads files"
            )
        super().__init__(values, frame, disparity_range, sample, disparity, extent, beyond)

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
        """A light field from pictures taken by a planar array of parallel cameras, upright, row 0 at the top.

        With view (j, i) and pixel (l, k) counted from the middle of their grids (i₀, j₀, k₀, l₀):
        u = (i − i₀)·du, s = u/F − (k − k₀)·ps, likewise v, t. A point at distance Z then moves by
        −du·(1/Z − 1/F)/ps pixels per view.

        Args:
            values: the pictures, shape (rows of views, columns of views, rows, columns[, channels]); with
                ``grid``, (views, rows, columns[, channels]).
            spacing: distance between neighbouring views, metres: one number or (dv, du).
            slope_per_pixel: pixel pitch over focal length of the cameras: one number or (pt, ps).
            focus_distance: where the views converge, metres (shifted, not rotated, cameras); infinite if
                their axes are parallel.
            disparity_range: see `LightField`.
            sample: see `LightField`.
            disparity: see `LightField`.
            grid: (rows, columns) of views that lie along one axis of ``values``, row by row from the top left.
            channels: whether the last axis of ``values`` is one of channels; None where the shape says so.

        Raises:
            InputError: a spacing, slope or focus distance of zero or less, or what `LightField` refuses; a grid or
                channels that do not fit; a shape such as (25, 64, 64, 3), which may be 25 pictures in colour or
                25×64 views 3 pixels wide: give ``grid``, or ``channels=False``.

        Warns:
            ResultWarning: floating-point samples look like 8-bit codes, 0 to 255.
        """
        values = in_grid(values, shape_of(values), grid, channels)
        warn_of_codes(values)
        frame = camera_array_frame(shape_of(values), spacing, slope_per_pixel, focus_distance)
        return cls(values, frame, disparity_range, sample, disparity)

    @property
    def flux(self) -> float:
        """All the light that the samples stand for, per channel: Σ radiance × cell, m² × radiance."""
        total = float(np.sum(to_numpy(self.values), dtype=np.float64)) / self.full_scale
        return total * self.sample_volume / (self.channels or 1)

    def view(self, row: int, column: int) -> Image:
        """One view as a picture, placed where its pixels look: on the plane 1 m before the light field, in metres.

        Args:
            row: which row of views, 0 at the top; negative counts from the end.
            column: which column of views, 0 at the left.

        Raises:
            InputError: there is no such view.
        """
        j, i = self.grid.place_of(row, column)
        at_view = self.frame @ Affine.translation(i, j, 0, 0)
        # A ray through this view at slope s comes from −s on the plane 1 m before it.
        looks_at = Affine.from_parts(-at_view.linear[2:, 2:], -at_view.offset[2:])
        values = to_numpy(self.values[j, i]) / np.float32(self.full_scale)
        return Image(values.astype(np.float32), looks_at, inverted=False)

    def on_gpu(self) -> LightField:
        """The light field with its samples on the GPU, copied there once, for many pictures by ``engine="cuda"``.

        That engine is then the default, and pictures are NumPy arrays. Samples in arrays of PyTorch or CuPy that
        are
        on a GPU need none of this: they are taken where they are.

        Raises:
            InputError: numba-cuda is not installed (extra ``gpu``), there is no GPU, or samples in arrays of
                another library than NumPy in main memory.
        """
        return self.of(on_gpu(self.values), self.grid)

    def scaled(self, factor: float) -> LightField:
        """The light field of the same scene in a world ``factor`` times as large (slopes stay).

        A gantry's 40 cm aperture becomes a lens-sized one with ``lf.scaled(0.05)``; all distances to the
        scene shrink with it.

        Raises:
            InputError: a factor of zero or less.
        """
        return self.of(self.values, self.grid.scaled(factor))

    def transformed(self, affine: Affine) -> LightField:
        """The light field after a linear element or flight: 𝕋 of the paper (section 3.2.1), exact, lazy.

        Only the frame changes: no sample is touched, no light lost. ``lf.transformed(Affine.lens(f))``.

        Args:
            affine: an invertible 5×5 map of rays.
        """
        return self.of(self.values, self.grid.moved(affine))

    def masked(self, mask: Mask, *, memory_limit: int | None = None) -> LightField:
        """The light field just behind a mask that lies in its plane: the paper's dot product (section 3.2.3).

        Each sample is weighted by the mask's mean over the sample's cell. New float32 samples are made; a
        camera that only wants the picture needs none of this.

        Args:
            mask: its z is not looked at: it lies where the light field is.
            memory_limit: bytes that the new samples may take; None takes `vcc.base.memory.MEMORY_LIMIT`.

        Raises:
            InputError: more memory needed than allowed.
        """
        return operators.masked(self, mask, memory_limit)

    def scattered(self, diffuser: Element, *, memory_limit: int | None = None) -> LightField:
        """The light field just behind a diffuser that lies in its plane: the paper’s convolution (equation 6).

        L'(u, v, s, t) = ∫ D(δs, δt | u, v) L(u, v, s − δs, t − δt) dδ, within each view, with samples interpolated
        linearly along the slopes. Each view gets as many more samples on each side as the kernel reaches, so that
        no light is lost; what lies beyond the given pictures is dark. Where the kernel varies over the diffuser,
        each view takes the one in the middle of its cell of the aperture. New float32 samples are made; a camera
        that only wants the picture needs none of this.

        Args:
            diffuser: a `vcc.Diffuser`, a `vcc.CodedDiffuser` or any element that scatters and does not bend. Its z
                is not looked at: it lies where the light field is. Its rim absorbs.
            memory_limit: bytes that the new samples may take; None takes `vcc.base.memory.MEMORY_LIMIT`.

        Raises:
            InputError: an element that does not scatter or that bends rays, a frame in which places depend on the
                pixel and not on the view alone (a field that flew some distance), a kernel over more than 8192
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
        """The light field interpolated on another grid, zero where this one holds nothing.

        This is what the paper does after every element (section 4.2, "the resolution issue"); it loses
        detail, which a frame does not. What samples are stays: means are means over cells as large as they were.

        Args:
            frame: 5×5, from the new grid's indices to rays at this plane.
            shape: (v, u, t, s) of the new grid.
            interpolation: ``"nearest"``, ``"linear"`` (4-D) or ``"cubic"`` (4-D cubic spline, cut at zero).
            memory_limit: bytes that the new samples may take; None takes `vcc.base.memory.MEMORY_LIMIT`.

        Raises:
            InputError: more memory needed than allowed, an unknown interpolation or a wrong shape.
        """
        return operators.resampled(self, frame, shape, interpolation, memory_limit)

    def projected(self, sensor: Sensor) -> Image:
        """The picture on a sensor in this light field's plane: S of the paper, I(u, v) = ∫∫ L ds dt (eq. 5).

        Args:
            sensor: its z is not looked at: it lies where the light field is.
        """
        return Camera([], replace(sensor, z=0.0)).capture(self)
