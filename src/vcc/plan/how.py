"""How an image is made: all options of a computation, in one record."""

from __future__ import annotations

import dataclasses
import difflib
import math
import os
from dataclasses import dataclass
from typing import Any, Literal, TypedDict, get_args

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.base.values import Value

Method = Literal["auto", "footprints", "rays"]
Interpolation = Literal["sharp", "nearest", "linear", "cubic"]
BetweenViews = Literal["auto", "none", "depth"]
EngineName = Literal["reference", "array_api", "numba", "cuda"]

LARGEST_REFINEMENT = 8
LARGEST_SAMPLES = 2**16
"""Largest number of rays a pixel: the number of points in the table that all pixels share."""


OF_THE_RUN = ("tolerance", "engine", "threads", "memory_limit")
"""Options of a run, not of the plan; all other options affect how the plan is made."""


class Options(TypedDict, total=False):
    """The fields of `How`, to pass them as keywords: ``camera.capture(lf, method="rays")``."""

    method: Method
    interpolation: Interpolation
    between_views: BetweenViews
    scene_distance: float | None
    refine: int | Literal["auto"]
    samples: int | None
    tolerance: float | None
    seed: int
    engine: EngineName | None
    threads: int | None
    memory_limit: int | None
    diffraction: bool | Literal["depth"]


@dataclass(frozen=True, kw_only=True, eq=False)
class How(Value, Shown):
    """All options for how an image is made.

    Args:
        method: ``"footprints"`` spreads each sample of the light field over the sensor, exactly, if the optics
            fold into one matrix; ``"rays"`` traces rays back from the sensor through any optics; ``"auto"`` uses
            footprints if possible.
        interpolation: within a view: ``"sharp"``, linear with the loss of sharpness compensated (rings by a few
            per cent beside hard edges, and may go below 0 there), or ``"linear"``; for footprints also
            ``"nearest"`` (the paper's, for comparison) or ``"cubic"`` (Catmull-Rom).
        between_views: ``"auto"`` interpolates between views along the scene's parallax (footprints: only if
            neighbouring views differ by more than about a pixel on the sensor); ``"depth"`` (footprints)
            synthesizes as many views in between as the sensor can resolve, up to 16×16 for each one, from the
            light field's ``disparity``, which is estimated first if not given: no ghosts at any depth, at the
            cost that `vcc.Camera.explain` reports, for NumPy arrays; ``"none"`` never interpolates.
        scene_distance: the distance in metres of the scene before the entrance plane, used for the interpolation
            between views; None takes the range of distances given with or measured in the light field.
        refine: footprints: ``"auto"`` divides cells and samples if a mask is finer than they are, at a cost
            that `vcc.Camera.explain` reports; a number from 2 to 8 sets the largest number of parts each way of
            samples and of cells of views, but divides at least as far as "auto"; 1 divides nothing, and the error
            is then not reported.
        samples: rays a pixel, rounded up to a power of two (behind a main lens and lenslets: for each lenslet that
            the pixel sees); None takes 64, whose error causes a warning above 1 % of the brightest pixel.
        tolerance: double the samples until the estimated sampling error of the image, root mean square, is at
            most this share of its mean; None does not.
        seed: of the points of the rays. The same seed gives the same image, on any number of threads.
        engine: ``"numba"`` (default for NumPy arrays), ``"array_api"`` (default for PyTorch, JAX and other arrays:
            carries gradients), ``"cuda"`` (on an NVIDIA GPU; extra ``gpu``; default for samples that
            `vcc.LightField.on_gpu` keeps there) or ``"reference"`` (slow; defines what is correct).
        threads: number of concurrent threads; None takes as many as there are cores for this process. The image
            does not depend on it.
        memory_limit: for a stored light field, bytes for its pieces, the image and the engine together; None
            takes a quarter of `vcc.base.memory.MEMORY_LIMIT`, 1 GiB. Smaller pieces take more time with rays,
            because all rays are traced for each piece.
        diffraction: convolve the image of each band with the spread of a point in focus by the camera's stop, by
            waves; needs a light field with wavelengths. See "Waves" in the docs for its error out of focus.
            ``"depth"``, for images only (not operators, plans and learning): then add what waves change at the
            depth of each part, by the disparities of the middle view (estimated if the light field has none) or
            ``scene_distance``.

    Raises:
        InputError: an unsupported value, named together with the supported ones.
    """

    method: Method = "auto"
    interpolation: Interpolation = "sharp"
    between_views: BetweenViews = "auto"
    scene_distance: float | None = None
    refine: int | Literal["auto"] = "auto"
    samples: int | None = None
    tolerance: float | None = None
    seed: int = 0
    engine: EngineName | None = None
    threads: int | None = None
    memory_limit: int | None = None
    diffraction: bool | Literal["depth"] = False

    def __post_init__(self) -> None:
        checks.one_of("method", self.method, get_args(Method))
        checks.one_of("interpolation", self.interpolation, get_args(Interpolation))
        checks.one_of("between_views", self.between_views, get_args(BetweenViews))
        if self.scene_distance is not None:
            if self.between_views == "depth":
                raise InputError(
                    "scene_distance is for between_views='auto'; by 'depth' each pixel has a distance of its own: "
                    "leave it out"
                )
            checks.above_zero("scene_distance", self.scene_distance, unit="m", infinite=True)
        if self.refine != "auto" and not 1 <= (checks.whole_number(self.refine) or 0) <= LARGEST_REFINEMENT:
            raise InputError(
                f"refine is 'auto' or a whole number from 1 to {LARGEST_REFINEMENT}, not {self.refine!r}"
            )
        if self.samples is not None:
            checks.whole_number_between("samples", self.samples, 2, LARGEST_SAMPLES, of="rays a pixel")
        if self.tolerance is not None:
            checks.above_zero("tolerance", self.tolerance, "a share of the picture's mean")
        checks.seed(self.seed)
        if self.engine is not None:
            checks.one_of("engine", self.engine, get_args(EngineName))
        if self.threads is not None:
            checks.whole_number_between("threads", self.threads, 1)
        if not isinstance(self.diffraction, bool) and self.diffraction != "depth":
            raise InputError(f"diffraction is True, False or 'depth', not {self.diffraction!r}")
        if self.diffraction and self.between_views == "depth":
            raise InputError(
                "diffraction=True and between_views='depth' do not go together: the image is then a mixture of "
                "two, and no one convolution adds the diffraction. Leave one of them out"
            )
        if self.memory_limit is not None:
            checks.above_zero("memory_limit", self.memory_limit, "a number of bytes", infinite=True)

    @classmethod
    def of(cls, how: How | None, options: Any) -> How:
        """A record with some options changed.

        Args:
            how: None uses the defaults.
            options: names and values.

        Raises:
            InputError: an unknown name, or an unsupported value.
        """
        if how is not None and not isinstance(how, How):
            raise InputError(f"how is a vcc.How, such as vcc.How(method='rays'), not {type(how).__name__}")
        known = [field.name for field in dataclasses.fields(cls)]
        for name in options:
            if name not in known:
                near = difflib.get_close_matches(name, known, 1)
                hint = f": did you mean {near[0]}?" if near else f": there are {', '.join(known)}"
                raise InputError(f"there is no option {name}{hint}")
        return dataclasses.replace(how or cls(), **options)

    @property
    def rays_a_pixel(self) -> int | None:
        """``samples`` rounded up to a power of two."""
        return None if self.samples is None else int(2 ** math.ceil(math.log2(self.samples)))

    @property
    def workers(self) -> int:
        """``threads``, or the number of cores that this process may use."""
        return self.threads or cores()


def cores() -> int:
    """The number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
