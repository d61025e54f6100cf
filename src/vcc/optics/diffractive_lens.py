"""The diffractive lens: rings that bend light by its wavelength, in one or several orders."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.wavelengths import D_LINE, wavelength
from vcc.optics.band import Band
from vcc.optics.faces import Element, Faces, Way
from vcc.optics.lens import Lens
from vcc.optics.mask import Mask
from vcc.shapes.patterns import Circle, Open

FAINT = 1e-4
"""Efficiency below which an order is left out: less than half a step of an 8-bit image."""


@dataclass(frozen=True)
class DiffractiveLens(Element):
    """A thin kinoform (blazed Fresnel lens): the focal length of order m is f·λ₀/(m·λ), and order 0 goes straight.

    The image of a band is Σₘ ηₘ(λ) · (image by order m). Without ``efficiencies``, ηₘ(λ) = sinc²(λ₀/λ − m), the
    scalar theory of a thin blazed profile whose glass does not disperse; all orders together have 1 (Buralli,
    Morris and Rogers, Optical performance of holographic kinoforms, Applied Optics 1989; Swanson, MIT Lincoln
    Laboratory TR 854, 1989). Drawings, `vcc.Camera.focused` and the analysis use order 1 at λ₀.

    Args:
        focal_length: f of order 1 at the design wavelength, metres; negative for a diverging lens.
        diameter: of the round opening, metres; None lets rays pass at any distance from the axis.
        design_wavelength: λ₀, metres; the d line if left out.
        orders: the orders m that are followed, different whole numbers.
        efficiencies: ηₘ, the share of the light in each order, the same for all bands; None for scalar theory.

    Raises:
        InputError: a focal length of 0 or not a number, a diameter of 0 or less, a wavelength that is not of light
            in metres, no orders or one twice, or efficiencies that are negative, above 1 together, or not one an
            order.
    """

    focal_length: float = field(metadata={"unit": "length"})
    diameter: float | None = field(default=None, metadata={"unit": "length"})
    design_wavelength: float = field(default=D_LINE, metadata={"unit": "length"})
    orders: tuple[int, ...] = (1, 0, 2)
    efficiencies: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.not_zero(f"focal_length of {self.label}", self.focal_length)
        checks.sizes(self.label, diameter=self.diameter, way_out="leave it out for a lens without a rim")
        wavelength(f"design_wavelength of {self.label}", self.design_wavelength)
        orders = checks.array(f"orders of {self.label}", self.orders, "whole numbers", None)
        if (orders % 1).any() or any(one == other for one, other in pairwise(sorted(orders))):
            raise InputError(f"orders of {self.label} are different whole numbers, not {tuple(self.orders)}")
        object.__setattr__(self, "orders", tuple(map(int, orders)))
        if self.efficiencies is None:
            return
        shares = checks.array(
            f"efficiencies of {self.label}", self.efficiencies, "one for each order", len(orders)
        )
        checks.none_negative(f"efficiencies of {self.label}", shares)
        if not 0 < shares.sum() <= 1 + 1e-9:
            raise InputError(
                f"efficiencies of {self.label} are {shares.sum():g} together: they are shares of the light"
            )
        object.__setattr__(self, "efficiencies", tuple(shares.tolist()))

    @property
    def depends_on_band(self) -> bool:
        """It does."""
        return True

    def efficiency(self, order: int, wavelength: float) -> float:
        """ηₘ(λ), the share of the light in an order.

        Args:
            order: m, one of ``orders``.
            wavelength: λ, metres.

        Raises:
            InputError: an order that is not followed.
        """
        if order not in self.orders:
            raise InputError(f"{self.label} follows the orders {self.orders}, not {order}")
        if self.efficiencies is not None:
            return self.efficiencies[self.orders.index(order)]
        return float(np.sinc(self.design_wavelength / wavelength - order) ** 2)

    def ways(self, band: Band) -> tuple[Way, ...]:
        """A lens for each order, weighted by its efficiency; for order 0 the opening.

        Raises:
            InputError: a band without a wavelength.
        """
        there = band.stated(self.label)
        shares = [(order, self.efficiency(order, there)) for order in self.orders]
        return tuple((share, self._of_order(order, there)) for order, share in shares if share >= FAINT)

    def _of_order(self, order: int, wavelength: float) -> Element:
        common = {"z": self.z, "decentre": self.decentre, "name": self.name}
        if order == 0:
            return Mask(Open() if self.diameter is None else Circle(self.diameter), **common)  # type: ignore[arg-type]
        focal_length = self.focal_length * self.design_wavelength / (order * wavelength)
        return Lens(focal_length, self.diameter, **common)  # type: ignore[arg-type]

    def faces(self) -> Faces:
        """The thin lens of order 1 at the design wavelength."""
        return self._of_order(1, self.design_wavelength).faces()
