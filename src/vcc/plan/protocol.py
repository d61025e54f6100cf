"""What plans and engines owe one another: cores say what is computed, engines compute it, parts add up."""

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
"""Gives the memory (cameras, rows, columns[, channels]) in which pictures of some cameras, by their numbers, are
made, if there is any; new memory takes long."""


@dataclass(frozen=True, eq=False)
class Partial:
    """A raster of part of the light: sums that add up.

    Args:
        values: irradiance, (rows, columns, channels), an array of the library of the samples.
        difference: what the two halves of a pixel's rays found, one minus the other, like ``values``; None where
            nothing is sampled.
        rays: how many were traced; 0 for footprints.
        samples: rays a pixel; 0 for footprints.
    """

    values: Any
    difference: Any = None
    rays: int = 0
    samples: int = 0

    def __add__(self, other: Partial) -> Partial:
        """The raster of more of the samples, by the same rays."""
        return replace(
            self,
            values=self.values + other.values,
            difference=None if self.difference is None else self.difference + other.difference,
        )

    def with_rays(self, other: Partial) -> Partial:
        """The raster of the same samples by as many other rays, beside those there are."""
        return Partial(
            values=(self.values + other.values) / 2,
            difference=self.values - other.values,
            rays=self.rays + other.rays,
            samples=self.samples + other.samples,
        )


@dataclass(frozen=True, eq=False, repr=False)
class Gradient(Brief):
    """What a raster's weights say of all that it was made from: sums that add up, like `Partial`.

    With weights G of the raster I, every change obeys
    ⟨G, dI⟩ = ⟨samples, d(samples)⟩ + Σ ⟨numbers[name], d(number of this name)⟩.

    Args:
        samples: like the samples that the core took, (v, u, t, s[, channels]); None where nobody asked.
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
        """What is said of samples, and then what is said of numbers; None for what nobody asked.

        Args:
            samples: finds it, and calls the progress that it is given.
            numbers: likewise.
            progress: of both together.
        """
        parts = (samples is not None) + (numbers is not None)
        return cls(
            None if samples is None else samples(part_of(progress, 0, parts)),
            {} if numbers is None else numbers(part_of(progress, parts - 1, parts)),
        )

    def __add__(self, other: Gradient) -> Gradient:
        """What two rasters, or two parts of one, say of the same samples and numbers."""
        names = dict.fromkeys([*self.gradients, *other.gradients])
        none = self.samples is None or other.samples is None
        return Gradient(
            (self.samples if other.samples is None else other.samples) if none else self.samples + other.samples,
            {
                name: sum(each.gradients[name] for each in (self, other) if name in each.gradients)  # type: ignore[misc]
                for name in names
            },
        )


class Runner(Protocol):
    """How a core is run on samples."""

    def __call__(
        self, core: Any, values: Any, *, beside: int = 0, threads: int, progress: Progress | None = None
    ) -> Partial:
        """See `Engine.run`."""
        ...


@dataclass(frozen=True)
class Abilities:
    """What an engine can do, known before it is loaded.

    Args:
        double: it computes floating-point samples in double precision, and gives pictures in it.
        copies: it converts all samples that it is given first, which takes memory.
        parallel: it takes NumPy arrays, uses several threads, and has several cores share work (`Engine.batch`).
        bands: its rays look at bands of rows of pixels, so that a store need not be read as a whole.
        no_derivatives: why it does not go backwards, in words; "" where it does.
        no_learning: why it does not go backwards to all numbers of a plan; "" where it does.
    """

    double: bool = False
    copies: bool = False
    parallel: bool = False
    bands: bool = False
    no_derivatives: str = ""
    no_learning: str = ""


class Engine(Protocol):
    """What computes: a module with these functions. docs/how-it-works.md shows one of thirty lines."""

    def run(
        self, core: Any, values: Any, *, beside: int = 0, threads: int, progress: Progress | None = None
    ) -> Partial:
        """The raster of samples.

        Args:
            core: what is computed: footprints or rays.
            values: the samples, (v, u, t, s[, channels]), as `prepared` gives them.
            beside: 0, or 1 for as many other rays, of the neighbouring block of points.
            threads: how many work at once.
            progress: called with (done, total).
        """
        ...

    def batch(
        self, cores: Sequence[Any], values: Any, *, pool: Workers, then: Callable[[int, Partial], Any]
    ) -> list[Any]:
        """What follows from rasters of the same samples by several cores, which share what they can of the work.

        Asked of engines that are `Abilities.parallel`; others run one core after the other.

        Args:
            cores: what is computed.
            values: the samples.
            pool: whose threads work. Those that are there keep their memory; new memory takes long.
            then: called with the number of a core and its raster, in one of the threads, as soon as that is made.

        Returns:
            What ``then`` gives for each core.
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
        """The derivative of ⟨raster, what `run` makes of the same⟩.

        The same bytes from run to run, whatever the number of threads.

        Args:
            core: what is computed.
            values: the samples, (v, u, t, s[, channels]). A core is linear in them: of an array without content
                (``np.broadcast_to(np.float32(0), shape)``) only the shape is looked at where no number is wanted.
            raster: weights of the raster's values, (rows, columns, channels).
            samples: whether the derivative to the samples is wanted: an array of their shape, float32 (float64
                where the engine is `Abilities.double`).
            wanted: names of the core's numbers to which it is wanted (`vcc.plan.parameters.numbers` of the core).
            beside: see `run`.
            threads: how many work at once.
            progress: called with (done, total).

        Raises:
            InputError: a number to which there is no derivative, named.
        """
        ...

    def prepared(self, before: Sequence[Any], values: Any, threads: int, core: Any = None) -> Any:
        """Samples (v, u, t, s[, channels]) as a core takes them, after all operators before it.

        Args:
            before: the operators.
            values: the samples.
            threads: how many work at once.
            core: given, what comes out is for `run` of this core alone, which may prepare samples where it looks
                at them; ``shape`` is then all that may be asked of it.
        """
        ...

    def prepared_back(
        self, before: Sequence[Any], values: Any, threads: int, *, written_over: bool = False
    ) -> Any:
        """The transpose of `prepared`: of weights of the samples that a core takes, those of the samples given.

        The operators' ``transpose``, the last one first. Each is the adjoint of its operator on real numbers: what
        whole numbers are rounded to is left out, and so is what one of them stands for. Where samples of 8 bits
        are kept as whole numbers of 16, each of which stands for ``kept_as(kind)[1]`` of a sample's, who calls
        divides by this: a step of one in a sample is so many of theirs.

        Args:
            before: the operators, in the order in which they are applied.
            values: weights (v, u, t, s[, channels]) of what comes out of the last one.
            threads: how many work at once.
            written_over: whether ``values`` may be, as nobody needs them any more: new memory takes long.

        Returns:
            Of the shape of the samples that the first one takes: float32 (float64 where the engine is
            `Abilities.double`).
        """
        ...

    def finished(self, after: Sequence[Any], raster: Any, threads: int) -> Any:
        """The picture (rows, columns, channels) of a raster after all operators, in the engine's precision."""
        ...

    def memory(self, core: Any, channels: int, threads: int) -> int:
        """Bytes that a run takes beside the samples and the raster, estimated."""
        ...


class Core(Protocol):
    """The middle of a plan: what turns samples into a raster."""

    @property
    def method(self) -> str:
        """``"footprints"`` or ``"rays"``."""
        ...

    @property
    def border(self) -> int:
        """Views around a block that are looked at with it."""
        ...

    @property
    def scale(self) -> float:
        """Turns samples, which are radiance, into it or into irradiance times shares; see `scaled`."""
        ...

    @property
    def raster_shape(self) -> tuple[int, int]:
        """(rows, columns) of what it makes."""
        ...

    def part(self, block: Block) -> Any:
        """What runs on a block of samples; the parts' rasters add up."""
        ...

    def required(self, wanted: Collection[str]) -> Collection[str]:
        """The numbers of a part to which derivatives make up those to some of the core's numbers."""
        ...

    def full_gradients(
        self, block: Block, numbers: Mapping[str, NDArray[np.float64]]
    ) -> dict[str, NDArray[np.float64]]:
        """Derivatives to the numbers of a `part`, by name, as those to the core's own; the parts' add up."""
        ...

    def scaled(self, factor: float) -> Any:
        """For samples whose numbers stand for ``factor`` times as much."""
        ...

    def more(self, samples: int) -> Any:
        """With so many rays a pixel, to be taken beside as many that there are; the same where none are traced."""
        ...

    def used_views(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """Which of the views of a light field of this shape are looked at, (v, u)."""
        ...

    def used_pixels(self, shape: tuple[int, ...]) -> NDArray[np.intp]:
        """Which pixels of each view may be looked at.

        Args:
            shape: (v, u, t, s[, channels]) of the samples that the core takes.

        Returns:
            The first, and the one after the last, of rows and of columns: (v, u, 2, 2). They may go beyond a view.
        """
        ...

    @property
    def samples_touched(self) -> int:
        """How many samples an engine goes through, those that it goes through twice counted twice."""
        ...
