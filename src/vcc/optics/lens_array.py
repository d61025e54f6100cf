"""Arrays of lenslets and of prisms, for plenoptic cameras."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief, parameters_in_words
from vcc.base.errors import InputError
from vcc.base.values import Value
from vcc.optics.deflections import CellDeflection
from vcc.optics.dispersion import Dispersive
from vcc.optics.faces import Faces
from vcc.shapes.lattice import CellApertures, CellBlock, Lattice, interleaved
from vcc.shapes.patterns import Bounded, Open, Pattern

LARGEST_DISC = {"square": math.pi / 4, "hexagonal": math.pi / (2 * math.sqrt(3))}
"""The share of a cell's area that the largest disc in it covers."""


@dataclass(frozen=True, repr=False)
class LensArray(Brief, Dispersive):
    """A sheet of equal lenslets side by side, on a square or hexagonal lattice, of one or several focal lengths.

    Within a cell centred at c the deflection is that of a thin lens: Δs = −(x − c)/f. With the sensor f behind,
    each lenslet images the main lens (Ng et al. 2005: plenoptic 1.0); with the sensor at another distance b it
    relays an image formed at a before it, 1/a + 1/b = 1/f (Lumsdaine and Georgiev 2009: focused plenoptic, 2.0).
    With ``focal_length=math.inf``, circular openings and a small fill factor it is an array of pinholes.

    Args:
        pitch: distance between the centres of neighbouring lenslets, metres.
        focal_length: of the lenslets, metres, negative for diverging ones, infinite for none; several are
            interleaved so that neighbours differ (`vcc.shapes.lattice.interleaved`), the first at ``offset``.
        layout: ``"square"`` or ``"hexagonal"`` (every second row shifted by half a pitch).
        rotation: of the rows against x, radians, from x towards y.
        offset: place (x, y) of the centre of a lenslet relative to the element's middle, metres; (0, 0) centres
            one there.
        fill_factor: share of a cell's area that is clear, greater than 0, up to 1, in the middle of an opaque
            border; None makes the openings as large as their shape allows.
        circular: whether openings are discs, which cover at most π/4 of a square cell and π/(2√3) of a hexagonal
            one; otherwise they have the shape of the cells.
        width: of the whole sheet, metres, opaque outside; None is unbounded.
        height: metres; None makes the sheet square.
        glass: None, or what it is made of: f ∝ 1/(n(λ) − 1); see `vcc.optics.dispersion.Dispersive`.
        design_wavelength: metres, at which ``focal_length`` holds.

    Raises:
        InputError: a pitch of 0 or less, a focal length of 0 or NaN, an unknown layout, a fill factor
            that is impossible for openings of this shape, a size of 0 or less, or a height without a width.
    """

    pitch: float = field(metadata={"unit": "length"})
    focal_length: float | tuple[float, ...] = field(metadata={"unit": "length"})
    layout: str = "square"
    rotation: float = field(default=0.0, metadata={"unit": "angle"})
    offset: tuple[float, float] = field(default=(0.0, 0.0), metadata={"unit": "length"})
    fill_factor: float | None = None
    circular: bool = False
    width: float | None = field(default=None, metadata={"unit": "length"})
    height: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        super().__post_init__()
        given: Any = self.focal_length
        several = isinstance(given, tuple | list | np.ndarray)
        focal_lengths = tuple(given) if several else (given,)
        if not focal_lengths:
            raise InputError(f"focal_length of {self.label} is an empty list: give one or more, in metres")
        checked = tuple(checks.not_zero(f"focal_length of {self.label}", each) for each in focal_lengths)
        if several:
            object.__setattr__(self, "focal_length", checked)
        object.__setattr__(self, "offset", _lattice(self, self.offset).offset)
        self._check_fill_factor()
        checks.opening(self.label, self.width, self.height)

    def _check_fill_factor(self) -> None:
        if self.fill_factor is None:
            return
        way_out = "leave it out for openings as large as can be"
        checks.above_zero(f"fill_factor of {self.label}", self.fill_factor, most=1, way_out=way_out)
        # A limit computed by hand may differ from ours in its last digits.
        if self.circular and self.fill_factor > LARGEST_DISC[self.layout] * (1 + 1e-9):
            raise InputError(
                f"fill_factor of {self.label} is {self.fill_factor}, and discs cover at most "
                f"{LARGEST_DISC[self.layout]:.4f} of {self.layout} cells: leave it out for the largest discs, or "
                "circular out for openings in the shape of the cells"
            )

    @property
    def focal_lengths(self) -> tuple[float, ...]:
        """The focal length of each kind of lenslet, metres."""
        return self.focal_length if isinstance(self.focal_length, tuple) else (float(self.focal_length),)

    @property
    def f_numbers(self) -> tuple[float, ...]:
        """The f-number of each kind of lenslet: focal length over pitch."""
        return tuple(focal_length / self.pitch for focal_length in self.focal_lengths)

    @property
    def lattice(self) -> Lattice:
        """The cells, in coordinates centred on the element."""
        return _lattice(self, self.offset)

    @property
    def kinds(self) -> NDArray[np.int64]:
        """The number of the focal length of each cell, a table (rows, columns) that repeats over the lattice."""
        return interleaved(self.layout, len(self.focal_lengths))

    def micro_images(self, distance_to_main_lens: float, distance_to_sensor: float) -> Lattice:
        """Places on the sensor where lenslets image the middle of the main lens, as a lattice in camera x, y.

        The ray from the middle of the main lens through the middle of a lenslet is straight: the lenslets'
        places and their pitch are scaled by 1 + b/d about the axis (Dansereau, Pizarro and Williams 2013).

        Args:
            distance_to_main_lens: d, from the main lens, which is centred on the axis, to the array, metres.
            distance_to_sensor: b, from the array to the sensor, metres.
        """
        if not distance_to_main_lens > 0 or not distance_to_sensor >= 0:
            raise InputError(
                f"the main lens stands before {self.label} and the sensor behind it, not "
                f"{distance_to_main_lens} m and {distance_to_sensor} m away"
            )
        growth = 1 + distance_to_sensor / distance_to_main_lens
        centre = tuple(growth * (a + b) for a, b in zip(self.decentre, self.offset, strict=True))
        return Lattice(self.layout, growth * self.pitch, self.rotation, (centre[0], centre[1]))

    def faces(self) -> Faces:
        """A lens in each cell, and the openings if they do not cover everything."""
        powers = (1 / np.array(self.focal_lengths))[self.kinds]
        deflection = CellDeflection(self.lattice, powers, np.zeros((*powers.shape, 2)))
        return Faces(deflection=deflection, transmission=self._transmission())

    def _stronger(self, factor: float) -> dict[str, Any]:
        weaker = tuple(focal_length / factor for focal_length in self.focal_lengths)
        return {"focal_length": weaker if isinstance(self.focal_length, tuple) else weaker[0]}

    def _transmission(self) -> Pattern | None:
        opening: Pattern = Open()
        if self.circular or self.fill_factor not in (None, 1):
            opening = CellApertures(self.lattice, self._opening_scale(), self.circular)
        if self.width is None:
            return None if isinstance(opening, Open) else opening
        return Bounded(opening, self.width, self.width if self.height is None else self.height)

    def _opening_scale(self) -> float:
        """The openings' size as a share of the cells' size: for discs, diameter over pitch."""
        largest = LARGEST_DISC[self.layout] if self.circular else 1.0
        return 1.0 if self.fill_factor is None else min(math.sqrt(self.fill_factor / largest), 1.0)


@dataclass(frozen=True, eq=False, repr=False)
class PrismArray(Brief, Value, Dispersive):
    """Rows and columns of prisms side by side, each with its own deflection, opaque around them.

    With a focal length, each cell is also a lens: the lens-prism array of Georgiev and Intwala (2006), which
    records a light field in one image; a lens moved by −f·δ within its cell is equivalent to a prism of
    deflection δ.

    Args:
        slopes: (δs, δt) that each cell adds to rays, (rows, columns, 2), row 0 at the top, column 0 at the left.
        pitch: distance between the centres of neighbouring cells, metres.
        layout: ``"square"``, or ``"hexagonal"``: every second row, from the second on, is shifted by half a
            pitch to the right. The middle of the rectangle around all cells is the element's middle.
        focal_length: of all cells, metres; None for prisms alone.
        rotation: of the array around the element's middle, radians, from x towards y. It does not rotate slopes.
        glass: None, or what it is made of: δ and 1/f ∝ n(λ) − 1; see `vcc.optics.dispersion.Dispersive`.
        design_wavelength: metres, at which ``slopes`` and ``focal_length`` hold.

    Raises:
        InputError: slopes of another shape or not finite, a pitch of 0 or less, an unknown layout, a focal length
            of 0 or NaN.
    """

    slopes: NDArray[np.float64]
    pitch: float = field(metadata={"unit": "length"})
    layout: str = "square"
    focal_length: float | None = field(default=None, metadata={"unit": "length"})
    rotation: float = field(default=0.0, metadata={"unit": "angle"})

    def __post_init__(self) -> None:
        super().__post_init__()
        needed = "numbers (rows, columns, 2), (δs, δt) of each cell"
        slopes = checks.array(f"slopes of {self.label}", self.slopes, needed, None, None, 2)
        object.__setattr__(self, "slopes", slopes)
        if self.focal_length is not None:
            way_out = "leave it out for prisms alone"
            checks.not_zero(f"focal_length of {self.label}", self.focal_length, way_out=way_out)
        _lattice(self, (0.0, 0.0))

    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of cells."""
        return self.slopes.shape[0], self.slopes.shape[1]

    @property
    def lattice(self) -> Lattice:
        """The cells, in coordinates centred on the element; (0, 0) is the upper left cell."""
        rows, columns = self.shape
        around_first = _lattice(self, (0.0, 0.0))
        # A shifted row is a quarter of a pitch to the right of the middle, as the others are to the left.
        shifted = 0.25 if self.layout == "hexagonal" and rows > 1 else 0.0
        across = ((columns - 1) / 2 + shifted) * self.pitch
        down = (rows - 1) / 2 * around_first.row_height
        cosine, sine = math.cos(self.rotation), math.sin(self.rotation)
        return _lattice(self, (sine * down - cosine * across, -sine * across - cosine * down))

    def faces(self) -> Faces:
        """A prism in each cell, also a lens if there is a focal length, and the clear block of cells."""
        rows, columns = self.shape
        power = 0.0 if self.focal_length is None else 1 / self.focal_length
        deflection = CellDeflection(self.lattice, np.full((rows, columns), power), self.slopes)
        if self.layout == "square" and self.rotation == 0:
            return Faces(deflection, Bounded(Open(), columns * self.pitch, rows * self.pitch))
        return Faces(deflection, CellBlock(self.lattice, rows, columns))

    def _stronger(self, factor: float) -> dict[str, Any]:
        focal_length = None if self.focal_length is None else self.focal_length / factor
        return {"slopes": self.slopes * factor, "focal_length": focal_length}

    def described(self) -> str:
        """The number of cells and the parameters as text."""
        steepest = float(np.abs(self.slopes).max())
        words = parameters_in_words(self, leave_out=("z", "name", "slopes"))
        return f"{self.shape[0]}×{self.shape[1]} prisms of up to {steepest:g}, {words}"


def _lattice(array: LensArray | PrismArray, offset: tuple[float, float]) -> Lattice:
    """The cells of an array; errors name the array."""
    with checks.within(array.label):
        return Lattice(array.layout, array.pitch, array.rotation, offset)
