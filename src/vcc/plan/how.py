"""How a picture is made: all that a user may choose about a computation, in one record."""

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
"""Rays a pixel: as many points as the table that all pixels share has."""


OF_THE_RUN = ("tolerance", "engine", "threads", "memory_limit")
"""What is chosen anew for each run of a plan; all else decides how the plan is made."""


class Options(TypedDict, total=False):
    """The fields of `How`, for those who pass them one by one: ``camera.capture(lf, method="rays")``."""

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


@dataclass(frozen=True, kw_only=True, eq=False)
class How(Value, Shown):
    """All that may be chosen about how a picture is made.

    Args:
        method: ``"footprints"`` spreads each sample of the light field over the sensor, exactly, where the optics
            fold into one matrix; ``"rays"`` traces rays back from the sensor through anything; ``"auto"`` takes
            footprints where they can be had.
        interpolation: within a view: ``"sharp"``, linear with what that takes from sharpness given back (rings by
            some per cent beside hard edges, and may go below 0 there), or ``"linear"``; by footprints also
            ``"nearest"`` (the paper's, for comparison) or ``"cubic"`` (Catmull-Rom).
        between_views: ``"auto"`` interpolates between views along the scene's parallax (footprints: only where
            neighbouring views differ by more than about a pixel on the sensor); ``"depth"`` (footprints) makes as
            many views in between as the sensor can tell apart, up to 16×16 for each one, from the light field's
            ``disparity``, which is found first where it is not given: no ghosts at any depth, at the cost that
            `vcc.Camera.explain` states, for NumPy arrays; ``"none"`` never does.
        scene_distance: the distance in metres of the scene before the entrance plane, by which that
            interpolation goes; None takes the range of distances that the light field states or shows.
        refine: footprints: ``"auto"`` divides cells and samples where a mask is finer than they are, at a cost
            that `vcc.Camera.explain` states; a number from 2 to 8 divides the same, samples up to so many parts
            each way and cells of views up to as many, but at least as far as "auto" does; 1 divides nothing, and
            nothing is then said of what that costs.
        samples: rays a pixel, rounded up to a power of two (behind a main lens and lenslets: for each lenslet that
            the pixel sees); None takes 64, whose error is warned of where it exceeds 1 % of the brightest pixel.
        tolerance: double the samples until the estimated sampling error of the picture, root mean square, is at
            most this share of its mean; None does not.
        seed: of the rays' choice of points. The same seed gives the same picture, on any number of threads.
        engine: ``"numba"`` (default for NumPy arrays), ``"array_api"`` (default for PyTorch, JAX and other arrays:
            carries gradients), ``"cuda"`` (on an NVIDIA GPU; extra ``gpu``; default for samples that
            `vcc.LightField.on_gpu` keeps there) or ``"reference"`` (slow; defines what is correct).
        threads: how many work at once; None takes as many as this process may use cores. The picture is the same.
        memory_limit: of a light field on disk, bytes that its pieces, the picture and the engine may take
            together; None takes a quarter of `vcc.base.memory.MEMORY_LIMIT`, 1 GiB. Smaller pieces take more time
            by rays, all of which are traced for each piece.

    Raises:
        InputError: a value that does not exist (named, with those that do).
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
        if self.memory_limit is not None:
            checks.above_zero("memory_limit", self.memory_limit, "a number of bytes", infinite=True)

    @classmethod
    def of(cls, how: How | None, options: Any) -> How:
        """A record, and what is to be changed in it.

        Args:
            how: None takes the defaults.
            options: names and values.

        Raises:
            InputError: a name that does not exist, or a value that does not.
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
        """``samples`` as they are taken: rounded up to a power of two."""
        return None if self.samples is None else int(2 ** math.ceil(math.log2(self.samples)))

    @property
    def workers(self) -> int:
        """``threads``, or as many as this process may use cores."""
        return self.threads or cores()


def cores() -> int:
    """How many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
