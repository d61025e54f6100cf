"""The interfaces of cores and engines: cores define the computation, engines run it, partial results add up."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.progress import Progress, part_of
from vcc.base.workers import Workers
from vcc.fields.grid import Block

OutputBuffers = Callable[[Sequence[int]], NDArray[np.float32] | None]
"""Returns the memory (cameras, rows, columns[, channels]) for the images of the cameras with these numbers, or
None for new memory, whose allocation takes long."""


@dataclass(frozen=True, eq=False)
class Partial:
    """A raster of a part of the light; partial rasters add up.

    Args:
        values: irradiance, (rows, columns, channels), an array of the library of the samples.
        difference: result of one half of a pixel's rays minus that of the other half, like ``values``; None if
            nothing is sampled.
        rays: number of traced rays; 0 for footprints.
        samples: rays a pixel; 0 for footprints.
    """

    values: Any
    difference: Any = None
    rays: int = 0
    samples: int = 0

    def __add__(self, other: Partial) -> Partial:
        """Add the raster of other samples by the same rays."""
        return replace(
            self,
            values=self.values + other.values,
            difference=None if self.difference is None else self.difference + other.difference,
        )

    def with_rays(self, other: Partial) -> Partial:
        """Combine with the raster of the same samples by equally many other rays."""
        return Partial(
            values=(self.values + other.values) / 2,
            difference=self.values - other.values,
            rays=self.rays + other.rays,
            samples=self.samples + other.samples,
        )


@dataclass(frozen=True, eq=False, repr=False)
class Gradient(Brief):
    """The gradient of a raster's weighted sum with respect to its inputs; gradients add up, like `Partial`.

    With weights G of the raster I, every change obeys
    ⟨G, dI⟩ = ⟨samples, d(samples)⟩ + Σ ⟨gradients[name], d(parameter of this name)⟩.

    Args:
        samples: like the samples of the core, (v, u, t, s[, channels]); None if not requested.
        gradients: by parameter (`vcc.plan.parameters`), float64, each of the parameter's shape.
    """

    samples: Any = None
    gradients: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        samples: Callable[[Progress | None], Any] | None,
        numbers: Callable[[Progress | None], Mapping[str, NDArray[np.float64]]] | None,
        progress: Progress | None,
    ) -> Gradient:
        """The gradient of samples, then of parameters; None for what is not requested.

        Args:
            samples: computes it, and calls the progress that it receives.
            numbers: likewise.
            progress: of both together.
        """
        parts = (samples is not None) + (numbers is not None)
        return cls(
            None if samples is None else samples(part_of(progress, 0, parts)),
            {} if numbers is None else numbers(part_of(progress, parts - 1, parts)),
        )

    def __add__(self, other: Gradient) -> Gradient:
        """Sum of the gradients of two rasters, or of two parts of one, for the same samples and parameters."""
        names = dict.fromkeys([*self.gradients, *other.gradients])
        none = self.samples is None or other.samples is None
        return Gradient(
            (self.samples if other.samples is None else other.samples) if none else self.samples + other.samples,
            {
                name: sum(each.gradients[name] for each in (self, other) if name in each.gradients)  # type: ignore[misc]
                for name in names
            },
        )


@dataclass(frozen=True)
class Abilities:
    """Features of an engine, known before it is loaded.

    Args:
        double: it computes floating-point samples, and their images, in double precision.
        copies: it first converts all samples, which takes memory.
        parallel: it accepts NumPy arrays, uses several threads, and shares work between cores (`Engine.batch`).
        bands: its rays read bands of rows of pixels, so that a stored light field need not be read as a whole.
        no_derivatives: why it computes no gradients, as text; "" if it does.
        no_learning: why it does not compute gradients of all parameters of a plan; "" if it does.
    """

    double: bool = False
    copies: bool = False
    parallel: bool = False
    bands: bool = False
    no_derivatives: str = ""
    no_learning: str = ""


class Engine(Protocol):
    """A module with these functions, which computes rasters. docs/how-it-works.md shows one of thirty lines."""

    def run(
        self, core: Any, values: Any, *, beside: int = 0, threads: int, progress: Progress | None = None
    ) -> Partial:
        """The raster of samples.

        Args:
            core: the computation: footprints or rays.
            values: the samples, (v, u, t, s[, channels]), as `prepared` returns them.
            beside: 0, or 1 for equally many other rays, of the neighbouring block of points.
            threads: number of concurrent threads.
            progress: called with (done, total).
        """
        ...

    def batch(
        self, cores: Sequence[Any], values: Any, *, pool: Workers, then: Callable[[int, Partial], Any]
    ) -> list[Any]:
        """Apply a function to the rasters of the same samples by several cores, which share work if possible.

        Called only if `Abilities.parallel`; other engines run one core after the other.

        Args:
            cores: the computations.
            values: the samples.
            pool: provides the threads. Existing threads keep their memory; allocating memory takes long.
            then: called with the number of a core and its raster, in one of the threads, as soon as the raster is
                ready.

        Returns:
            The result of ``then`` for each core.
        """
        ...

    def back(
        self,
        core: Any,
        values: Any,
        raster: NDArray[np.floating],
        *,
        samples: bool = True,
        wanted: Collection[str] = (),
        beside: int = 0,
        threads: int,
        progress: Progress | None = None,
    ) -> Gradient:
        """The gradient of ⟨raster, result of `run`⟩.

        The result is identical for any number of threads.

        Args:
            core: the computation.
            values: the samples, (v, u, t, s[, channels]). A core is linear in them: if no parameter is wanted,
                only the shape is used, and an array without content (``np.broadcast_to(np.float32(0), shape)``)
                is enough.
            raster: weights of the raster's values, (rows, columns, channels).
            samples: whether to compute the gradient of the samples: an array of their shape, float32 (float64
                if the engine is `Abilities.double`).
            wanted: names of the core's parameters to differentiate (`vcc.plan.parameters.parameters` of the core).
            beside: see `run`.
            threads: number of concurrent threads.
            progress: called with (done, total).

        Raises:
            InputError: a parameter without a derivative, named.
        """
        ...

    def prepared(
        self,
        before: Sequence[Any],
        values: Any,
        threads: int,
        core: Any = None,
        check: Callable[[], None] | None = None,
    ) -> Any:
        """Samples (v, u, t, s[, channels]) in the form that a core reads, after all operators before it.

        Args:
            before: the operators.
            values: the samples.
            threads: number of concurrent threads.
            core: if given, the result is for `run` of this core alone, which may prepare samples lazily; then
                only ``shape`` of the result may be read.
            check: may be called between pieces of the work; an exception that it raises ends the work.
        """
        ...

    def prepared_back(
        self, before: Sequence[Any], values: Any, threads: int, *, written_over: bool = False
    ) -> Any:
        """The transpose of `prepared`: from weights of a core's samples to weights of the given samples.

        Applies the operators' ``transpose``, the last operator first. Each is the adjoint of its operator on real
        numbers: rounding to integers and the scale of the integers are ignored. If 8-bit samples are stored as
        16-bit integers, each of which stands for ``kept_as(kind)[1]`` of a sample's step, the caller divides by
        this factor.

        Args:
            before: the operators, in the order in which they are applied.
            values: weights (v, u, t, s[, channels]) of the result of the last operator.
            threads: number of concurrent threads.
            written_over: whether ``values`` may be overwritten, since allocating memory takes long.

        Returns:
            Of the shape of the samples that the first operator reads: float32 (float64 if the engine is
            `Abilities.double`).
        """
        ...

    def finished(self, after: Sequence[Any], raster: Any, threads: int) -> Any:
        """The image (rows, columns, channels) of a raster after all operators, in the engine's precision."""
        ...

    def memory(self, core: Any, channels: int, threads: int) -> int:
        """Estimated bytes that a run needs in addition to the samples and the raster."""
        ...


class Core(Protocol):
    """The middle of a plan: turns samples into a raster."""

    @property
    def method(self) -> str:
        """``"footprints"`` or ``"rays"``."""
        ...

    @property
    def border(self) -> int:
        """Views around a block that are read with it."""
        ...

    @property
    def scale(self) -> float:
        """Factor from samples (radiance) to the raster (radiance, or irradiance times shares); see `scaled`."""
        ...

    @property
    def raster_shape(self) -> tuple[int, int]:
        """(rows, columns) of the raster."""
        ...

    def part(self, block: Block) -> Any:
        """The core for a block of samples; the rasters of all parts add up."""
        ...

    def required(self, wanted: Collection[str]) -> Collection[str]:
        """The parameters of a part whose derivatives are needed for the given parameters of the core."""
        ...

    def full_gradients(
        self, block: Block, numbers: Mapping[str, NDArray[np.float64]]
    ) -> dict[str, NDArray[np.float64]]:
        """Convert derivatives to the parameters of a `part`, by name, to the core's own; all parts add up."""
        ...

    def scaled(self, factor: float) -> Any:
        """The core for samples whose numbers stand for ``factor`` times as much."""
        ...

    def more(self, samples: int) -> Any:
        """The core with ``samples`` more rays a pixel, taken in addition; the same core if no rays are traced."""
        ...

    def used_views(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """The views that are used of a light field of this shape, (v, u)."""
        ...

    def used_pixels(self, shape: tuple[int, ...]) -> NDArray[np.intp]:
        """The pixels of each view that may be used.

        Args:
            shape: (v, u, t, s[, channels]) of the samples that the core reads.

        Returns:
            First and stop of rows and of columns: (v, u, 2, 2). They may extend beyond a view.
        """
        ...

    @property
    def samples_touched(self) -> int:
        """Number of samples that an engine processes, repeated reads counted repeatedly."""
        ...
