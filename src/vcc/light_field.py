"""The 4-D light field: radiance along rays, sampled on a grid that an affine frame places in space."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.fields.disparity import Disparities, DisparityMaps
from vcc.fields.plane_sweep import disparity_maps
from vcc.fields.sampled import LIGHT_FIELD_AXES, Index, known, sliced, to_dtype, to_numpy

if TYPE_CHECKING:
    from vcc.image import Image
    from vcc.optics import Element, Mask
    from vcc.optics.sensor import Sensor

Sample = Literal["mean", "point"]
"""What a sample says of the scene: its mean over the cell of a pixel, or its value in the middle of the cell."""

SAMPLES_IN_WORDS: dict[Sample, str] = {"mean": "means over pixels", "point": "values at points"}
"""What samples are, for people."""


class DisparityRange:
    """The disparities that a light field shows, measured when first asked for and then kept.

    Shared by a light field and all pieces of it, so that each piece is treated like the whole.
    """

    def __init__(self, measure: Callable[[], tuple[float, float] | None]) -> None:
        self._measure = measure
        self._known = False
        self._value: tuple[float, float] | None = None

    def get(self) -> tuple[float, float] | None:
        """(lowest, highest) in pixels per view, or None where the pictures show no parallax to measure."""
        if not self._known:
            self._value = self._measure()
            self._known = True
        return self._value


@dataclass(frozen=True, eq=False, repr=False)
class LightField:
    """Radiance samples and the frame that says which ray each of them is.

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

    Raises:
        InputError: not 4-D or 5-D, an empty axis, a dtype that is not unsigned integer or floating point,
            samples that are NaN, infinite or negative, a frame that is not 5×5 and invertible, another word for
            ``sample``, or a disparity of another shape or that is not finite.
    """

    values: Any
    frame: Affine
    disparity_range: tuple[float, float] | None = None
    sample: Sample = "mean"
    disparity: Any = None
    _shared_disparity: DisparityRange | None = field(default=None, repr=False)
    _disparity_factor: float = field(default=1.0, repr=False)
    _whole_views: tuple[float, float] | None = field(default=None, repr=False)
    _checked: bool = field(default=False, repr=False)

    def __post_init__(self) -> None:
        shape = tuple(self.values.shape)
        if len(shape) not in (4, 5):
            raise InputError(
                f"a light field has the axes (v, u, t, s) or (v, u, t, s, channel); this array has {len(shape)}: "
                f"shape {shape}. For one view, use values[None, None]"
            )
        if 0 in shape:
            raise InputError(f"a light field of shape {shape} holds no samples")
        if self.frame.dimensions != 4:
            raise InputError("a light field needs a 5×5 frame, from (i, j, k, l, 1) to (u, v, s, t, 1)")
        if not self.frame.is_invertible():
            raise InputError(
                "the frame of a light field must be invertible: each sample is another ray. This one is not:\n"
                f"{self.frame!r}"
            )
        if self.disparity_range is not None and not self.disparity_range[0] <= self.disparity_range[1]:
            raise InputError(f"disparity_range is (lowest, highest), not {self.disparity_range}")
        if self.sample not in get_args(Sample):
            raise InputError(
                f"sample is 'mean' (over a pixel, as of cameras and renderers) or 'point', not {self.sample!r}"
            )
        if not self._checked:
            _check_samples(self.values)
            object.__setattr__(self, "_checked", True)
        if self._whole_views is None:
            object.__setattr__(self, "_whole_views", (float(shape[0]), float(shape[1])))
        if self._shared_disparity is None:
            object.__setattr__(self, "_shared_disparity", DisparityRange(self._measure_disparity))
        if not isinstance(self.disparity, Disparities):
            shared = (
                Disparities(find=self._find_disparities)
                if self.disparity is None
                else Disparities(DisparityMaps.given(self.disparity, shape))
            )
            object.__setattr__(self, "disparity", shared)

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
    ) -> LightField:
        """A light field from pictures taken by a planar array of parallel cameras, upright, row 0 at the top.

        With view (j, i) and pixel (l, k) counted from the middle of their grids (i₀, j₀, k₀, l₀):
        u = (i − i₀)·du, s = u/F − (k − k₀)·ps, likewise v, t. A point at distance Z then moves by
        −du·(1/Z − 1/F)/ps pixels per view.

        Args:
            values: the pictures, shape (rows of views, columns of views, rows, columns[, channels]).
            spacing: distance between neighbouring views, metres: one number or (dv, du).
            slope_per_pixel: pixel pitch over focal length of the cameras: one number or (pt, ps).
            focus_distance: where the views converge, metres (shifted, not rotated, cameras); infinite if
                their axes are parallel.
            disparity_range: see `LightField`.
            sample: see `LightField`.
            disparity: see `LightField`.

        Raises:
            InputError: a spacing, slope or focus distance of zero or less, or what `LightField` refuses.
        """
        dv, du = spacing if isinstance(spacing, tuple) else (spacing, spacing)
        pt, ps = slope_per_pixel if isinstance(slope_per_pixel, tuple) else (slope_per_pixel, slope_per_pixel)
        for name, value in (
            ("spacing", du),
            ("spacing", dv),
            ("slope_per_pixel", ps),
            ("slope_per_pixel", pt),
            ("focus_distance", focus_distance),
        ):
            if not value > 0:
                raise InputError(f"{name} must be greater than 0, not {value}")
        if len(values.shape) not in (4, 5):
            return cls(values, Affine.identity())  # its own check names the fault
        nv, nu, nt, ns = values.shape[:4]
        matrix = np.zeros((5, 5))
        matrix[4, 4] = 1.0
        matrix[0, 0], matrix[1, 1] = du, dv
        matrix[2, 0], matrix[3, 1] = du / focus_distance, dv / focus_distance
        matrix[2, 2], matrix[3, 3] = -ps, -pt
        centre = np.array([(nu - 1) / 2, (nv - 1) / 2, (ns - 1) / 2, (nt - 1) / 2])
        return cls(values, Affine(matrix) @ Affine.translation(*-centre), disparity_range, sample, disparity)

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the values: (v, u, t, s) or (v, u, t, s, channels)."""
        return tuple(self.values.shape)

    @property
    def channels(self) -> int | None:
        """How many colour channels there are; None for a light field without a channel axis."""
        return self.shape[4] if len(self.shape) == 5 else None

    @property
    def full_scale(self) -> float:
        """The stored value that stands for radiance 1: the largest integer, or 1 for floating point."""
        kind = to_dtype(self.values)
        return float(np.iinfo(kind).max) if kind.kind == "u" else 1.0

    @property
    def whole_views(self) -> tuple[float, float]:
        """(rows, columns) of views of the light field that this is a piece of, counted in this piece's steps.

        What a camera decides by the extent of the views it decides for all pieces alike, so that the pictures
        of the pieces add up to the picture of the whole.
        """
        assert self._whole_views is not None
        return self._whole_views

    @property
    def sample_volume(self) -> float:
        """The phase-space volume du·dv·ds·dt of one sample's cell, m² (slopes have no unit)."""
        return abs(self.frame.determinant)

    @property
    def flux(self) -> float:
        """All the light that the samples stand for, per channel: Σ radiance × cell, m² × radiance."""
        total = float(np.sum(to_numpy(self.values), dtype=np.float64)) / self.full_scale
        return total * self.sample_volume / (self.channels or 1)

    def __getitem__(self, index: Index | tuple[Index, ...]) -> LightField:
        """A piece of the light field, in its place: slices along (v, u, t, s[, channel]).

        Where only every second pixel (or fewer) is kept along s and along t, means become ``"point"``: of a cell
        n pixels wide each sample covers 1/n, and what that took from sharpness is 1/n² of what a mean over the
        cell takes.
        """
        values, frame, ranges = sliced(self.values, self.frame, index, LIGHT_FIELD_AXES, "a light field")
        v, u, t, s = (part.step for part in ranges[:4])
        rows, columns = self.whole_views
        return replace(
            self._with(values, frame, u / s),
            sample="point" if min(abs(t), abs(s)) > 1 else self.sample,
            disparity=self.disparity.piece(ranges),
            _whole_views=(rows / abs(v), columns / abs(u)),
        )

    def view(self, row: int, column: int) -> Image:
        """One view as a picture, placed where its pixels look: on the plane 1 m before the light field, in metres.

        Args:
            row: which row of views, 0 at the top; negative counts from the end.
            column: which column of views, 0 at the left.

        Raises:
            InputError: there is no such view.
        """
        from vcc.image import Image

        nv, nu = self.shape[:2]
        if not (-nv <= row < nv and -nu <= column < nu):
            raise InputError(f"there is no view ({row}, {column}) in a grid of {nv}×{nu} views")
        j, i = row % nv, column % nu
        at_view = self.frame @ Affine.translation(i, j, 0, 0)
        # A ray through this view at slope s comes from −s on the plane 1 m before it.
        looks_at = Affine.from_parts(-at_view.linear[2:, 2:], -at_view.offset[2:])
        values = to_numpy(self.values[j, i]) / np.float32(self.full_scale)
        return Image(values.astype(np.float32), looks_at, inverted=False)

    def scaled(self, factor: float) -> LightField:
        """The light field of the same scene in a world ``factor`` times as large (slopes stay).

        A gantry's 40 cm aperture becomes a lens-sized one with ``lf.scaled(0.05)``; all distances to the
        scene shrink with it.

        Raises:
            InputError: a factor of zero or less.
        """
        if not (factor > 0 and math.isfinite(factor)):
            raise InputError(f"a world is scaled by a finite factor greater than 0, not {factor}")
        return self._with(self.values, Affine.scaling(factor, factor, 1, 1) @ self.frame)

    def transformed(self, affine: Affine) -> LightField:
        """The light field after a linear element or flight: 𝕋 of the paper (section 3.2.1), exact, lazy.

        Only the frame changes: no sample is touched, no light lost. ``lf.transformed(Affine.lens(f))``.

        Args:
            affine: an invertible 5×5 map of rays.
        """
        return self._with(self.values, affine @ self.frame)

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
        from vcc.run.operators import masked

        return masked(self, mask, memory_limit)

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
        from vcc.run.operators import scattered

        return scattered(self, diffuser, memory_limit)

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
        from vcc.run.operators import resampled

        return resampled(self, frame, shape, interpolation, memory_limit)

    def projected(self, sensor: Sensor) -> Image:
        """The picture on a sensor in this light field's plane: S of the paper, I(u, v) = ∫∫ L ds dt (eq. 5).

        Args:
            sensor: its z is not looked at: it lies where the light field is.
        """
        from vcc.run.operators import projected

        return projected(self, sensor)

    def measured_disparity_range(self) -> tuple[float, float] | None:
        """(lowest, highest) disparity in pixels per view along u, given or else measured from the pictures.

        None where there is nothing to measure it from: one view, or pictures without texture.
        Measured once and kept; pieces of a light field answer as the whole does.
        """
        known = self.disparity_range
        if known is None and self._shared_disparity is not None:
            known = self._shared_disparity.get()
        if known is None:
            return None
        low, high = sorted((known[0] * self._disparity_factor, known[1] * self._disparity_factor))
        return low, high

    def disparity_of(self, distance: float) -> float:
        """The disparity, pixels per view along u, of a point ``distance`` metres before this plane (paper's Z).

        The point is seen at pixel k − disparity·i in view i. For an array of cameras this is
        du·(1/Z − 1/F)/ps, the formula of the HCI benchmark (Honauer et al. 2016).
        """
        position, slope = self.frame.linear[0], self.frame.linear[2]
        vergence = 1.0 / distance
        # A point at z = −Z sends rays with s − u/Z constant; follow that along i and k.
        return float((slope[0] - position[0] * vergence) / (slope[2] - position[2] * vergence))

    def distance_of(self, disparity: float) -> float:
        """The distance in metres of what shows ``disparity`` pixels per view along u: `disparity_of` undone."""
        position, slope = self.frame.linear[0], self.frame.linear[2]
        numerator = position[0] - disparity * position[2]
        denominator = slope[0] - disparity * slope[2]
        return math.inf if denominator == 0 else float(numerator / denominator)

    def replaced(self, values: Any) -> LightField:
        """The same frame and scene with other samples, for instance on another array library.

        Raises:
            InputError: another grid of samples, or what `LightField` refuses.
        """
        if tuple(values.shape)[:4] != self.shape[:4]:
            raise InputError(
                f"samples of shape {tuple(values.shape)} do not fit a light field of shape {self.shape}"
            )
        return replace(self, values=values, _checked=False)

    def _with(self, values: Any, frame: Affine, disparity_factor: float = 1.0) -> LightField:
        return replace(
            self,
            values=values,
            frame=frame,
            _disparity_factor=self._disparity_factor * disparity_factor,
        )

    def _measure_disparity(self) -> tuple[float, float] | None:
        from vcc.fields.parallax import (
            disparity_range,
        )  # late: light fields come before what looks at them

        # Views near the middle are all that is looked at: no need to bring the others from another device.
        rows, columns = (slice(max(n // 2 - 4, 0), n // 2 + 5) for n in self.shape[:2])
        views = known(self.values[rows, columns, ...])
        if views is None:
            return None
        return told_along_u(
            self.frame,
            disparity_range(views, "u") if views.shape[1] > 1 else None,
            disparity_range(views, "v") if views.shape[0] > 1 else None,
        )

    def _find_disparities(self, progress: Callable[[int, int], None] | None) -> DisparityMaps:
        return disparity_maps(self, progress=progress)

    def __repr__(self) -> str:
        sizes = "×".join(map(str, self.shape))
        samples = f"{to_dtype(self.values)} {SAMPLES_IN_WORDS[self.sample]}"
        return f"LightField({sizes} {samples}, {describe_geometry(self)})"


def told_along_u(
    frame: Affine, across: tuple[float, float] | None, down: tuple[float, float] | None
) -> tuple[float, float] | None:
    """(lowest, highest) disparity along u of what views show along both axes: turned by 90°, the same scene.

    Args:
        frame: of the light field.
        across: what is shown along u, pixels per view, or None.
        down: what is shown along v, or None.
    """
    position, slope = frame.linear[1], frame.linear[3]
    place, angle = frame.linear[0], frame.linear[2]
    found = list(across or ())
    for disparity in down or ():
        numerator, denominator = slope[1] - disparity * slope[3], position[1] - disparity * position[3]
        # 1/Z = numerator / denominator; as `LightField.disparity_of`, without the quotient, which may be infinite
        moved = angle[2] * denominator - place[2] * numerator
        if moved != 0:
            found.append(float((angle[0] * denominator - place[0] * numerator) / moved))
    return (min(found), max(found)) if found else None


def describe_geometry(light_field: LightField) -> str:
    """The geometry of a light field in words, for people: spacing, slope per pixel, convergence."""
    linear = light_field.frame.linear
    separable = np.allclose(linear[[0, 0, 0, 1, 1, 1], [1, 2, 3, 0, 2, 3]], 0)
    if not separable:
        return "general frame"
    from vcc.base.units import short

    # What turns the outermost views by less than a millionth of a pixel is rounding.
    parallel = abs(linear[2, 0]) * light_field.shape[1] < 1e-6 * abs(linear[2, 2])
    converging = "parallel views" if parallel else f"converging at {short(linear[0, 0] / linear[2, 0])}"
    return f"spacing {short(abs(linear[0, 0]))}, slope per pixel {abs(linear[2, 2]):.6g}, {converging}"


def _check_samples(values: Any) -> None:
    kind = to_dtype(values)
    if kind.kind not in "uf":
        raise InputError(
            f"light-field samples are floating point or unsigned integers, not {kind}: "
            "convert them, e.g. with values.astype('float32')"
        )
    if kind.kind == "u":
        return  # neither negative nor NaN by construction
    samples = known(values)
    if samples is None:
        return
    lowest, highest = samples.min(), samples.max()  # a NaN anywhere makes both NaN
    if not (np.isfinite(lowest) and np.isfinite(highest)):
        bad = tuple(int(n) for n in np.argwhere(~np.isfinite(samples))[0])
        raise InputError(
            f"a light field needs finite samples; at index {bad} (v, u, t, s, …) it has {samples[bad]}"
        )
    if lowest < 0:
        bad = tuple(int(n) for n in np.unravel_index(samples.argmin(), samples.shape))
        raise InputError(f"radiance is not negative; at index {bad} (v, u, t, s, …) it is {lowest}")
