"""Diffusers: the paper's third category of optics, which scatters light (section 3.2.2)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief, instead_of_name
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.base.values import Value
from vcc.optics.dispersion import Dispersive
from vcc.optics.faces import Faces
from vcc.optics.scatter import Scatter, SheetMap
from vcc.shapes.kernels import SUM_TOLERANCE, Gaussian, Kernel, Radial, Samples, TopHat
from vcc.shapes.patterns import Bounded, Circle, Open, Pattern

Array = NDArray[np.float64]


def _refuse_names(kernel: object, label: str) -> None:
    """Raise an error if a name, a class or a number is given instead of a kernel."""
    if isinstance(kernel, int | float):
        raise InputError(f"{label}: {kernel!r} is no kernel: write vcc.kernels.Gaussian(sigma={kernel!r})")
    if isinstance(kernel, str | type):
        kinds = (Gaussian, TopHat, Radial, Samples)
        raise InputError(f"{label}: {kernel!r} is no kernel: {instead_of_name(kernel, 'vcc.kernels', kinds)}")


@dataclass(frozen=True, repr=False)
class Diffuser(Brief, Dispersive):
    """A diffuser that scatters light in the same way at every place.

    L'(u, v, s, t) = ∫∫ D(δs, δt) L(u, v, s − δs, t − δt) dδs dδt: a ray keeps its place and leaves with its
    slope changed by (δs, δt) with probability density D (paper, section 3.2.2: a convolution of the light field
    along its slopes). Light is lost only outside the rim.

    Args:
        kernel: D: a kernel of `vcc.kernels`, or an array of shares, (rows of δt, columns of δs), its middle δ = 0.
        slope_pitch: width of the array's cells in slope; only for an array.
        normalise: divide an array by its sum; otherwise its sum must be 1.
        diameter: of a round diffuser, metres; opaque outside.
        width: of a rectangular diffuser, metres; opaque outside. Without diameter and width there is no rim.
        height: of a rectangular diffuser, metres; None makes it square.
        glass: None, or what a surface relief is made of: slopes ∝ n(λ) − 1; see
            `vcc.optics.dispersion.Dispersive`.
        design_wavelength: at which the kernel holds.

    Raises:
        InputError: an array that `vcc.kernels.Samples` does not accept (negative, not finite, a sum other than
            1), an array without a pitch, a kernel with one, a size of zero or less, both a diameter and a width.
    """

    kernel: Kernel | NDArray[np.float64]
    slope_pitch: float | None = None
    normalise: bool = False
    diameter: float | None = field(default=None, metadata={"unit": "length"})
    width: float | None = field(default=None, metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.opening(self.label, self.width, self.height, self.diameter)
        object.__setattr__(self, "kernel", self._as_kernel())
        # Options for reading an array are reset, so that equal diffusers have equal parameters.
        object.__setattr__(self, "slope_pitch", None)
        object.__setattr__(self, "normalise", False)

    def _as_kernel(self) -> Kernel:
        if isinstance(self.kernel, Kernel):
            if self.slope_pitch is not None or self.normalise:
                raise InputError(
                    f"slope_pitch and normalise of {self.label} are for an array, "
                    f"not for {self.kernel.described()}"
                )
            return self.kernel
        _refuse_names(self.kernel, self.label)
        if self.slope_pitch is None:
            raise InputError(
                f"the kernel of {self.label} is an array: give the width of its cells in slope, "
                "e.g. slope_pitch=1e-3"
            )
        try:
            return Samples(np.asarray(self.kernel, dtype=np.float64), self.slope_pitch, self.normalise)
        except InputError as error:
            raise InputError(f"{self.label}: {error}") from None
        except (ValueError, TypeError):
            raise InputError(
                f"the kernel of {self.label} is a vcc.kernels.Kernel or rows of equally many numbers, "
                f"not {type(self.kernel).__name__}"
            ) from None

    def faces(self) -> Faces:
        """The kernel, and a rim if there is a size."""
        assert isinstance(self.kernel, Kernel)
        rim: Pattern | None = None
        if self.diameter is not None:
            rim = Circle(self.diameter)
        elif self.width is not None:
            rim = Bounded(Open(), self.width, self.width if self.height is None else self.height)
        return Faces(transmission=rim, scatter=self.kernel)

    def _stronger(self, factor: float) -> dict[str, Any]:
        assert isinstance(self.kernel, Kernel)
        return {"kernel": self.kernel.stretched(factor)}


@dataclass(frozen=True, eq=False, repr=False)
class CodedDiffuser(Brief, Value, Dispersive):
    """A diffuser whose kernel varies over its surface: D(δs, δt | u, v) (paper, eq. 6).

    D(δ | u, v) = Σₙ weightₙ(u, v) · Dₙ(δ / w(u, v)) / w(u, v)²: kernels mixed by weights, stretched by w.

    Args:
        kernels: one kernel or several.
        width: of the sheet, metres; opaque outside.
        weights: the kernels' shares over the sheet, shape (n, rows, columns), row 0 at the top; their sum is 1 at
            each place. Required for several kernels.
        widths: the factor w ≥ 0 by which the kernels are stretched over the sheet, shape (rows, columns). With
            `vcc.kernels.Gaussian(1.0)` this is the map of σ itself. Required for a single kernel. At 0 light
            passes unscattered.
        height: of the sheet, metres; None keeps cells square.
        normalise: divide the weights by their sum at each place.
        glass: as of `Diffuser`.
        design_wavelength: as of `Diffuser`.

    Maps hold values at the middles of the cells and are interpolated bilinearly between them.

    Raises:
        InputError: no kernels or objects of another type, neither weights nor widths, shapes that do not fit,
            numbers that are negative or not finite, weights whose sum is not 1 without ``normalise``, widths that
            are 0 throughout, a size of zero or less.
    """

    kernels: Kernel | tuple[Kernel, ...]
    width: float = field(metadata={"unit": "length"})
    weights: NDArray[np.float64] | None = None
    widths: NDArray[np.float64] | None = None
    height: float | None = field(default=None, metadata={"unit": "length"})
    normalise: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.sizes(self.label, width=self.width, height=self.height)
        given: Any = self.kernels
        kernels = (given,) if isinstance(given, Kernel | str | type) else tuple(given)
        for kernel in kernels:
            _refuse_names(kernel, self.label)
            if not isinstance(kernel, Kernel):
                raise InputError(f"kernels of {self.label} are vcc.kernels.Kernel, not {type(kernel).__name__}")
        object.__setattr__(self, "kernels", kernels)
        object.__setattr__(self, "weights", self._checked_weights(len(kernels)))
        object.__setattr__(self, "normalise", False)
        object.__setattr__(self, "widths", self._checked_widths())
        if self.height is None:
            shapes = {values.shape[-2:] for values in (self.weights, self.widths) if values is not None}
            ratios = {rows / columns for rows, columns in shapes}
            if len(ratios) > 1:
                raise InputError(
                    f"weights and widths of {self.label} have cells of different shapes: give the sheet's height"
                )
            object.__setattr__(self, "height", self.width * ratios.pop())

    def _checked_weights(self, kernels: int) -> Array | None:
        if kernels == 0:
            raise InputError(f"{self.label} has no kernels: give one or more")
        if self.weights is None:
            if kernels > 1:
                raise InputError(
                    f"{self.label} has {kernels} kernels and no weights: give an array ({kernels}, rows, columns)"
                )
            if self.widths is None:
                raise InputError(
                    f"{self.label} has one kernel and no widths: it is alike everywhere, and that is vcc.Diffuser"
                )
            return None
        shape = f"({kernels}, rows, columns), one map a kernel"
        weights = self._checked_map("weights", self.weights, shape, kernels)
        sums = weights.sum(axis=0)
        worst = tuple(int(n) for n in np.unravel_index(np.abs(sums - 1).argmax(), sums.shape))
        if self.normalise:
            if not sums.all():
                dark = tuple(int(n) for n in np.argwhere(sums == 0)[0])
                raise InputError(f"weights of {self.label} are all 0 in cell {dark}: they cannot be normalised")
            weights = weights / sums
        elif abs(sums[worst] - 1) > SUM_TOLERANCE:
            raise InputError(
                f"weights of {self.label} sum to {sums[worst]:.9g} in cell {worst}, and must to 1, or light would "
                "be made or lost: divide them by their sum, or pass normalise=True"
            )
        weights.flags.writeable = False
        return weights

    def _checked_widths(self) -> Array | None:
        if self.widths is None:
            return None
        widths = self._checked_map("widths", self.widths, "(rows, columns)")
        if not widths.any():
            raise InputError(f"widths of {self.label} are 0 throughout: it would scatter nothing")
        return widths

    def _checked_map(self, name: str, given: object, shape: str, *first: int) -> Array:
        label = f"{name} of {self.label}"
        values = checks.array(label, given, f"numbers {shape}", *first, None, None)
        checks.none_negative(label, values)
        return values

    def faces(self) -> Faces:
        """The kernels with their maps over the sheet, opaque outside."""
        assert isinstance(self.kernels, tuple)
        assert self.height is not None
        weights = None if self.weights is None else SheetMap(self.weights, self.width, self.height)
        stretch = None if self.widths is None else SheetMap(self.widths, self.width, self.height)
        largest = 1.0 if self.widths is None else float(self.widths.max())
        return Faces(
            transmission=Bounded(Open(), self.width, self.height),
            scatter=Scatter(self.kernels, weights=weights, width=stretch, largest_width=largest),
        )

    def _stronger(self, factor: float) -> dict[str, Any]:
        assert isinstance(self.kernels, tuple)
        return {"kernels": tuple(kernel.stretched(factor) for kernel in self.kernels)}

    def described(self) -> str:
        """The kernels, the cells of the maps and the sheet's size as text."""
        assert isinstance(self.kernels, tuple)
        assert self.height is not None
        parts = [", ".join(kernel.described() for kernel in self.kernels)]
        for verb, values in (("mixed", self.weights), ("stretched", self.widths)):
            if values is not None:
                rows, columns = values.shape[-2:]
                parts.append(f"{verb} over {rows}×{columns} cells")
        if self.glass is not None:
            parts.append(f"glass {self.glass if isinstance(self.glass, str) else self.glass.described()}")
        return "; ".join([*parts, f"width {short(self.width)}, height {short(self.height)}"])
