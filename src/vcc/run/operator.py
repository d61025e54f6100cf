"""The linear map from a light field's samples to the picture that a camera makes of them, and its adjoint.

A camera, a grid of rays and a way to compute make a matrix A, too large to be written down: a row for each value
of the picture, a column for each sample. `Operator` multiplies by it, its adjoint by its transpose.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from vcc.base import lazy_import
from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.progress import Progress
from vcc.fields.disparity import Disparities
from vcc.fields.grid import Block, Grid
from vcc.fields.sampled import library_of
from vcc.fields.samples import InMemory, Samples
from vcc.plan.how import How
from vcc.plan.model import Plan
from vcc.run.backwards import Backwards
from vcc.run.drive import Drive
from vcc.run.required_samples import required_samples


class Slots(Protocol):
    """What takes samples piece by piece: an array of NumPy, in memory or mapped from disk, or one of Zarr."""

    @property
    def shape(self) -> tuple[int, ...]:
        """Of all samples."""
        ...

    def __setitem__(self, index: Any, values: Any) -> None:
        """Keep a piece."""
        ...


@dataclass(frozen=True, eq=False, repr=False)
class Operator:
    """A camera as a linear map A from the samples of a light field to a picture; made by `vcc.Camera.operator`.

    ``op(samples)`` is the picture, A · samples; ``op.T(picture)`` is Aᵀ · picture. A sample of 1 is radiance 1,
    whatever the numbers of the light field stand for, and samples may be negative.

    Args:
        plan: by which the picture is made.
        light_field: on whose grid the samples are.
        how: engine, threads and memory.

    Raises:
        InputError: what is no linear map that can be gone through backwards, with the way out: a tolerance, views
            in between by depth, samples that are not NumPy's.
    """

    plan: Plan
    light_field: Samples
    how: How

    def __post_init__(self) -> None:
        self._drive(self.light_field)

    def __call__(
        self, samples: Any = None, *, executor: Any = None, progress: Progress | None = None
    ) -> NDArray[Any]:
        """The picture that the camera makes of samples.

        Args:
            samples: floating-point numbers of `samples_shape`, or several light fields, (n, …); None takes those
                of the light field.
            executor: who runs blocks of them, as in `vcc.Camera.capture`.
            progress: called with (done, total), for each light field anew.

        Returns:
            (rows, columns[, channels]), or (n, …): irradiance, as `vcc.Camera.capture` gives it, of type `dtype`.

        Raises:
            InputError: samples of another shape, of another type than floating point, or not finite; what an
                executor does not take, or one that dies.
        """
        if samples is None:
            return self._picture(self.light_field, executor, progress)
        grid = replace(self.light_field.grid, kind=self.dtype)
        return _each(
            self._checked("samples", samples, self.samples_shape),
            self.samples_shape,
            lambda one: self._picture(InMemory.of(one, grid), executor, progress),
        )

    @property
    def T(self) -> Adjoint:
        """The adjoint: ``op.T(picture)``."""
        return Adjoint(self)

    @property
    def shape(self) -> tuple[int, int]:
        """As of a matrix: (values of the picture, samples)."""
        return math.prod(self.picture_shape), math.prod(self.samples_shape)

    @property
    def picture_shape(self) -> tuple[int, ...]:
        """(rows, columns) or (rows, columns, channels)."""
        return (*self.plan.sensor_shape, *self.samples_shape[4:])

    @property
    def samples_shape(self) -> tuple[int, ...]:
        """(v, u, t, s) or (v, u, t, s, channels)."""
        return self.light_field.grid.shape

    @property
    @cached
    def dtype(self) -> np.dtype[Any]:
        """Of what is given back: float32, or float64 by ``engine="reference"``."""
        return np.dtype(np.float64 if self._drive(self.light_field).able.double else np.float32)

    def as_scipy(self) -> Any:
        """The same for SciPy's solvers, such as ``scipy.sparse.linalg.lsqr``.

        Returns:
            A `scipy.sparse.linalg.LinearOperator` of this shape and type; vectors are samples and pictures, flat.
        """
        from scipy.sparse.linalg import LinearOperator

        def times(verb: Callable[[Any], NDArray[Any]], shape: tuple[int, ...]) -> Callable[[Any], NDArray[Any]]:
            def product(vector: Any) -> NDArray[Any]:
                given = np.asarray(vector)
                given = given if given.dtype.kind in "fc" else given.astype(self.dtype)
                return verb(given.reshape(shape)).reshape(-1)

            return product

        return LinearOperator(
            self.shape,
            matvec=times(self, self.samples_shape),
            rmatvec=times(self.T, self.picture_shape),
            dtype=self.dtype,
        )

    def as_deepinv(self, *, scale: float = 1.0, **options: Any) -> Any:
        """The same for the solvers, priors and networks of `deepinv`; needs the extra of that name.

        Args:
            scale: by which pictures are multiplied, and samples on the way back. The solvers of `deepinv` are made
                for operators of norm 1, and irradiance is far less than radiance: 1/norm serves them.
            options: of `deepinv.physics.LinearPhysics`, such as ``noise_model`` or ``max_iter``.

        Returns:
            A `deepinv.physics.LinearPhysics` between tensors on the CPU: samples (B, channels, v, u, t, s) and
            pictures (B, channels, rows, columns), channels 1 where the light field has none. What it gives has the
            type `dtype` and carries gradients, of any order.

        Raises:
            InputError: deepinv is not there, or does not load; a scale that is not positive.
        """
        physics = lazy_import.module("vcc.run.torch_physics")
        return physics.linear_physics(self, self.samples_shape, self.picture_shape, scale, options)

    def __repr__(self) -> str:
        samples, picture = ("×".join(map(str, shape)) for shape in (self.samples_shape, self.picture_shape))
        name = self._drive(self.light_field).name
        return f"Operator({samples} samples to {picture} pixels by {self.plan.core.method}, {name}, {self.dtype})"

    def _drive(self, samples: Samples, executor: Any = None) -> Drive:
        return Drive.of_linear(self.plan, samples, self.how, executor)

    def _picture(self, samples: Samples, executor: Any, progress: Progress | None) -> NDArray[Any]:
        drive = Drive.of_linear(*required_samples(self.plan, samples), self.how, executor)
        picture: NDArray[Any] = drive.picture(drive.rounds(progress))
        return picture

    def _backwards(self, executor: Any = None) -> Backwards:
        """The way back to samples that nobody looks at: of stored ones, and by others, in blocks."""
        grid = replace(self.light_field.grid, kind=self.dtype, disparities=Disparities())
        if executor is not None or self.light_field.whole() is None:
            return Backwards(self._drive(_Unread(grid), executor))
        return Backwards(self._drive(InMemory.of(np.broadcast_to(np.zeros((), self.dtype), grid.shape), grid)))

    def _checked(self, what: str, given: Any, shape: tuple[int, ...]) -> NDArray[Any]:
        """Numbers of a shape, or several of them, in this type."""
        if (library := library_of(given)) not in ("numpy", "builtins"):
            raise InputError(
                f"an operator takes arrays of NumPy, not of {library}: pass numpy.asarray({what}); "
                "vcc.torch.CameraModule carries gradients"
            )
        numbers = np.asarray(given)
        if numbers.dtype.kind != "f":
            whole = numbers.dtype.kind == "u"
            scaled = f": where {np.iinfo(numbers.dtype).max} is radiance 1, divide by it" if whole else ""
            raise InputError(f"{what} of an operator are floating-point numbers, not {numbers.dtype}{scaled}")
        if numbers.shape != shape and (numbers.shape[1:] != shape or not len(numbers)):
            flat = f": pass {what}.reshape({shape}), or op.as_scipy(), which takes vectors"
            raise InputError(
                f"{what} of this operator have the shape {shape}, or one axis more before it for several, not "
                f"{numbers.shape}{flat if numbers.shape == (math.prod(shape),) else ''}"
            )
        if numbers.size and not (np.isfinite(numbers.min()) and np.isfinite(numbers.max())):
            place = tuple(int(n) for n in np.argwhere(~np.isfinite(numbers))[0])
            raise InputError(f"{what} are finite numbers; at {place} there is {numbers[place]}")
        return numbers.astype(self.dtype, copy=False)


@dataclass(frozen=True, eq=False)
class Adjoint:
    """The adjoint Aᵀ of an `Operator`: what each sample gets of a picture.

    For all samples x and pictures y, ⟨op(x), y⟩ = ⟨x, op.T(y)⟩ to rounding. It is what least squares need, and
    what a display would do whose pixels stand where the sensor's do, with its light going the other way.
    """

    T: Operator

    def __call__(
        self, picture: Any, *, out: Slots | None = None, executor: Any = None, progress: Progress | None = None
    ) -> Any:
        """The samples Aᵀ · picture.

        Args:
            picture: floating-point numbers of ``op.picture_shape``, or several pictures, (n, …).
            out: where to put the samples of one picture, an array of ``op.samples_shape`` (of NumPy, mapped from
                disk, of Zarr), piece by piece: there need be no room for them in memory; None makes an array.
            executor: who goes back to blocks of views, as in `vcc.Camera.capture`. What they find comes here, a
                few blocks at a time, and is put into ``out`` here: others need not reach it.
            progress: called with (done, total), for each picture anew.

        Returns:
            ``out``, or samples of ``op.samples_shape``, or (n, …), of ``op.dtype``.

        Raises:
            InputError: a picture of another shape, of another type than floating point, or not finite; of a light
                field on disk, samples that take more than the memory limit; what an executor does not take, or one
                that dies.
        """
        checked = self.T._checked("pictures", picture, self.T.picture_shape)
        if out is not None:
            return self._into(out, checked, executor, progress)
        return _each(checked, self.T.picture_shape, lambda one: self._samples(one, executor, progress))

    @property
    def shape(self) -> tuple[int, int]:
        """As of a matrix: (samples, values of the picture)."""
        return self.T.shape[::-1]

    def pieces(
        self, picture: Any, *, executor: Any = None, progress: Progress | None = None
    ) -> Iterator[tuple[Block, NDArray[Any]]]:
        """The samples Aᵀ · picture in pieces that are in memory one at a time.

        Args:
            picture: of ``op.picture_shape``.
            executor: see the call.
            progress: called with (done, total).

        Yields:
            (block, samples): ``block.slices`` is where they belong. Views in none of them get nothing.

        Raises:
            InputError: see the call.
        """
        checked = self.T._checked("pictures", picture, self.T.picture_shape)
        return self.T._backwards(executor).pieces(checked, progress)

    def __repr__(self) -> str:
        return f"{self.T!r}.T"

    def _samples(self, picture: NDArray[Any], executor: Any, progress: Progress | None) -> Any:
        if executor is not None and self.T.light_field.whole() is not None:  # where there is room for as many
            made = np.empty(self.T.samples_shape, self.T.dtype)
            return self._into(made, picture, executor, progress)
        return self.T._backwards(executor).gradient(picture, progress=progress).samples

    def _into(self, out: Slots, picture: NDArray[Any], executor: Any, progress: Progress | None) -> Slots:
        if tuple(out.shape) != self.T.samples_shape:
            raise InputError(f"out has the shape {tuple(out.shape)}, and the samples {self.T.samples_shape}")
        unseen = np.ones(out.shape[:2], dtype=bool)
        for block, samples in self.T._backwards(executor).pieces(picture, progress):
            out[block.slices] = samples
            unseen[block.slices[:2]] = False
        for row, column in np.argwhere(unseen):
            out[int(row), int(column)] = 0
        return out


@dataclass(frozen=True, eq=False, repr=False)
class _Unread:
    """The samples of a grid that lie elsewhere and are not looked at."""

    grid: Grid
    stored_bytes = 0

    def whole(self) -> None:
        """They are not in memory."""

    def check_complete(self) -> None:
        """None is needed."""

    def read(self, block: Block) -> Any:
        """Nothing backwards looks at samples where no number is wanted."""
        raise AssertionError("samples are looked at")


def _each(
    given: NDArray[Any], shape: tuple[int, ...], verb: Callable[[NDArray[Any]], NDArray[Any]]
) -> NDArray[Any]:
    """What a verb makes of an array of a shape, or of each of several."""
    return verb(given) if given.shape == shape else np.stack([verb(one) for one in given])
