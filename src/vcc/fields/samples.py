"""Methods of all light fields with samples, wherever the samples are; and samples in memory."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import partial
from os import PathLike
from typing import Any, Protocol, Self, get_args

import numpy as np
from array_api_compat import array_namespace, is_array_api_obj
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.base.showing import Shown
from vcc.fields.disparity import Disparities, DisparityMaps
from vcc.fields.filling import Filling
from vcc.fields.grid import (
    ALL,
    SAMPLES_IN_WORDS,
    Beyond,
    Block,
    Grid,
    Sample,
    along_u,
    check_frame,
    check_shape,
)
from vcc.fields.parallax import disparity_range
from vcc.fields.plane_sweep import disparity_maps
from vcc.fields.sampled import Index, has_values, taken, to_dtype, to_numpy


class Samples(Protocol):
    """Interface of light fields with samples: in memory, stored on disk, or made on request."""

    @property
    def grid(self) -> Grid:
        """The rays of the samples, and the meaning of their values."""
        ...

    @property
    def stored_bytes(self) -> int:
        """Bytes of the samples where they are stored; 0 in memory."""
        ...

    def whole(self) -> Any | None:
        """All samples, an array (v, u, t, s[, channels]) of any library, if they are in memory; else None."""
        ...

    def check_complete(self) -> None:
        """Raise an error if views are missing, before long work on the light field."""
        ...

    def read(self, block: Block) -> Any:
        """The samples of a block, (v, u, t, s[, channels])."""
        ...


class OnGrid(Shown, ABC):
    """Properties of a light field that follow from its grid, wherever its samples are."""

    @property
    @abstractmethod
    def grid(self) -> Grid:
        """The light field without its samples."""

    @property
    def channels(self) -> int | None:
        """Number of colour channels; None for a light field without a channel axis."""
        return self.grid.channels

    @property
    def full_scale(self) -> float:
        """The stored value that stands for radiance 1: the largest integer, or 1 for floating point."""
        return self.grid.full_scale

    @property
    def given(self) -> NDArray[np.bool_]:
        """Whether each view was recorded, (rows, columns); False for views that were filled or left dark."""
        return self.grid.given

    @property
    def filling(self) -> Filling | None:
        """Estimated errors of views that were not recorded; None if all views were."""
        return self.grid.filling

    @property
    def sample_volume(self) -> float:
        """The phase-space volume du·dv·ds·dt of one sample's cell, m² (slopes have no unit)."""
        return self.grid.sample_volume

    def measured_disparity_range(self) -> tuple[float, float] | None:
        """(lowest, highest) disparity in pixels per view along u, given or else measured from the views.

        None if it cannot be measured: with one view, or without texture. Measured once and then cached, in a
        stored light field from up to seven views in the middle; pieces of a light field return the range of the
        whole.
        """
        return self.grid.measured_disparity_range()

    def disparity_of(self, distance: float) -> float:
        """The disparity, pixels per view along u, of a point ``distance`` metres before this plane (paper's Z).

        The point is seen at pixel k − disparity·i in view i. For an array of cameras this is
        du·(1/Z − 1/F)/ps, the formula of the HCI benchmark (Honauer et al. 2016).
        """
        return self.grid.disparity_of(distance)

    def distance_of(self, disparity: float) -> float:
        """The distance in metres of a point with this disparity (pixels per view along u); see `disparity_of`."""
        return self.grid.distance_of(disparity)


@dataclass(frozen=True, eq=False, repr=False)
class InMemory(OnGrid):
    """Radiance samples in memory and the frame that maps each of them to a ray.

    See `vcc.LightField`, which adds methods, for the arguments and errors.
    """

    values: Any
    frame: Affine
    disparity_range: tuple[float, float] | None = None
    sample: Sample = "mean"
    disparity: Any = None
    extent: tuple[float, float] | None = None
    beyond: Beyond = ALL
    wavelengths: tuple[float, ...] | None = None
    filling: Filling | None = None

    def __post_init__(self) -> None:
        check_shape(shape_of(self.values))
        check_frame(self.frame)
        if self.disparity_range is not None and not self.disparity_range[0] <= self.disparity_range[1]:
            raise InputError(f"disparity_range is (lowest, highest), not {self.disparity_range}")
        if self.sample not in get_args(Sample):
            raise InputError(
                f"sample is 'mean' (over a pixel, as of cameras and renderers) or 'point', not {self.sample!r}"
            )
        check_samples(self.values)
        self._complete()
        if self.wavelengths is not None:
            object.__setattr__(self, "wavelengths", self.grid.wavelengths)  # checked there

    def __reduce__(self) -> tuple[Any, ...]:
        """Its samples and its grid: other processes do not validate them again."""
        return type(self).of, (self.values, self.grid)

    def _complete(self) -> None:
        """Fill in missing arguments."""
        if self.extent is None:
            object.__setattr__(self, "extent", (float(self.values.shape[0]), float(self.values.shape[1])))
        shown = self.disparity
        if not isinstance(shown, Disparities):
            shown = Disparities(None if shown is None else DisparityMaps.given(shown, self.values.shape))
        shown = shown.completed(partial(maps_of, self), partial(_range_of, self.values, self.frame))
        object.__setattr__(self, "disparity", shown)

    @classmethod
    def of(cls, values: Any, grid: Grid) -> Self:
        """Samples of a grid that are known to be valid, such as a part of others: they are not validated again.

        Args:
            values: (v, u, t, s[, channels]).
            grid: of the same shape.
        """
        made = object.__new__(cls)
        parts = {
            "values": values,
            "frame": grid.frame,
            "disparity_range": grid.disparity_range,
            "sample": grid.sample,
            "disparity": grid.disparities,
            "extent": grid.extent,
            "beyond": grid.beyond,
            "wavelengths": grid.wavelengths,
            "filling": grid.filling,
        }
        for name, part in parts.items():
            object.__setattr__(made, name, part)
        made._complete()
        return made

    @property
    @cached
    def grid(self) -> Grid:
        """The light field without its samples."""
        return Grid(
            self.shape,
            self.frame,
            to_dtype(self.values),
            self.sample,
            self.disparity_range,
            self.disparity,
            self.extent or (0.0, 0.0),
            self.beyond,
            self.wavelengths,
            self.filling,
        )

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the values: (v, u, t, s) or (v, u, t, s, channels)."""
        return tuple(self.values.shape)

    @property
    def stored_bytes(self) -> int:
        """Bytes of the samples where they are stored: 0."""
        return 0

    def whole(self) -> Any:
        """All samples."""
        return self.values

    def check_complete(self) -> None:
        """All views exist."""

    def read(self, block: Block) -> Any:
        """The samples of a block, not copied."""
        return self.values[(*block.slices, ...)]

    def __getitem__(self, index: Index | tuple[Index, ...]) -> Self:
        """A piece of the light field, in its place: slices along (v, u, t, s[, channel]).

        Images of the pieces add up to the image of the whole. So a piece fades, at its cuts, towards
        neighbours that it no longer has. For an independent light field, which ends there:
        ``vcc.LightField(piece.values, piece.frame)``.

        If only every n-th pixel (n ≥ 2) is kept along s and along t, means become ``"point"``: each sample
        covers 1/n of a cell n pixels wide, and its loss of sharpness is 1/n² of that of a mean over the cell.
        """
        grid, ranges = self.grid.piece(index)
        return self.of(taken(self.values, ranges), grid)

    def replaced(self, values: Any) -> Self:
        """The same frame and scene with other samples, for instance of another array library.

        Wavelengths are kept where the number of channels is.

        Raises:
            InputError: another grid of samples, or samples that `vcc.LightField` does not accept.
        """
        if tuple(values.shape)[:4] != self.shape[:4]:
            raise InputError(
                f"samples of shape {tuple(values.shape)} do not fit a light field of shape {self.shape}"
            )
        same = tuple(values.shape)[4:] == self.shape[4:]
        return replace(self, values=values, wavelengths=self.wavelengths if same else None)

    def __repr__(self) -> str:
        sizes = "×".join(map(str, self.shape))
        samples = f"{to_dtype(self.values)} {SAMPLES_IN_WORDS[self.sample]}"
        return f"{type(self).__name__}({sizes} {samples}, {self.grid.geometry}{self.grid.bands})"


def shape_of(values: Any) -> tuple[int, ...]:
    """The shape of an array of any library.

    Raises:
        InputError: no array.
    """
    if isinstance(values, str | PathLike):
        raise InputError(
            f"values of a light field are an array: vcc.open_light_field({str(values)!r}) opens files"
        )
    if not hasattr(values, "shape"):
        raise InputError(
            f"values of a light field are an array, not a {type(values).__name__}: numpy.asarray(values, "
            "dtype='float32') makes one of lists"
        )
    return tuple(values.shape)


def check_is_light_field(given: Any) -> None:
    """Check that an object is a light field; the error shows how to make one from an array or a file name.

    Raises:
        InputError: it has no grid of samples to read.
    """
    if hasattr(given, "grid") and hasattr(given, "read"):
        return
    name = type(given).__name__
    if hasattr(given, "times"):
        raise InputError(
            f"light_field is a vcc.LightField, not a {name}: take one of its frames, or "
            "vcc.MovingCamera(camera).capture(video, exposure, start=…)"
        )
    if isinstance(given, str | PathLike):
        store = str(given).endswith(".zarr")
        opened = f"vcc.{'store.open_store' if store else 'open_light_field'}({str(given)!r})"
        raise InputError(f"light_field is a vcc.LightField, not a {name}: open files with {opened}")
    if hasattr(given, "__array__") or isinstance(given, tuple | list):
        raise InputError(
            f"light_field is a vcc.LightField, not a {name}: numbers alone do not say which rays they are. "
            "vcc.LightField.from_views(values, spacing=…, slope_per_pixel=…) does, of an array (rows of views, "
            "columns of views, rows, columns[, channels])"
        )
    raise InputError(
        f"light_field is a vcc.LightField, not a {name}: vcc.open_light_field(path) opens files, and "
        "vcc.LightField.from_views(values, …) makes one of an array"
    )


def check_samples(values: Any) -> None:
    """Check that samples are valid radiance; arrays under a tracer are not checked.

    Raises:
        InputError: another type than unsigned integer or floating point; NaN, infinite or negative samples.
    """
    kind = to_dtype(values)
    if kind.kind not in "uf":
        raise InputError(
            f"light-field samples are floating point or unsigned integers, not {kind}: "
            "convert them, e.g. with values.astype('float32')"
        )
    if kind.kind == "u" or not has_values(values):
        return  # integers are neither negative nor NaN by construction
    lowest, highest = _extremes(values)
    if not (np.isfinite(lowest) and np.isfinite(highest)):
        samples = to_numpy(values)
        bad = tuple(int(n) for n in np.argwhere(~np.isfinite(samples))[0])
        raise InputError(
            f"a light field needs finite samples; at index {bad} (v, u, t, s, …) it has {samples[bad]}"
        )
    if lowest < 0:
        samples = to_numpy(values)
        bad = tuple(int(n) for n in np.unravel_index(samples.argmin(), samples.shape))
        raise InputError(f"radiance is not negative; at index {bad} (v, u, t, s, …) it is {lowest}")


def _extremes(values: Any) -> tuple[float, float]:
    """The smallest and the largest of an array's numbers, computed on its device; NaN anywhere makes both NaN."""
    if isinstance(values, np.ndarray) or not is_array_api_obj(values):
        samples = to_numpy(values)
        return float(samples.min()), float(samples.max())
    xp, plain = array_namespace(values), values.detach() if hasattr(values, "detach") else values
    return float(xp.min(plain)), float(xp.max(plain))


def _range_of(values: Any, frame: Affine) -> tuple[float, float] | None:
    """The range of disparities, measured from the views near the middle; None under a tracer."""
    # Only views near the middle are used: the others need not be copied from another device.
    rows, columns = (slice(max(n // 2 - 4, 0), n // 2 + 5) for n in values.shape[:2])
    if not has_values(values):
        return None
    views = to_numpy(values[rows, columns, ...])
    return along_u(
        frame,
        disparity_range(views, "u") if views.shape[1] > 1 else None,
        disparity_range(views, "v") if views.shape[0] > 1 else None,
    )


def maps_of(samples: InMemory, progress: Progress | None) -> DisparityMaps:
    """The maps of disparities of the samples, computed now."""
    return disparity_maps(samples, progress=progress)
