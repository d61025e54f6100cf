"""A lens that is known by rays: a table of rays before and behind it, without its surfaces."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError, warn_of_result
from vcc.base.units import short
from vcc.base.values import Value
from vcc.optics.aberrations import Aberrations
from vcc.optics.faces import Faces, Part
from vcc.optics.first_order import FirstOrder
from vcc.optics.ray_map import Fit, fits
from vcc.optics.real_lens import RADIOMETRIES, Seen, TracedLens
from vcc.shapes.patterns import Circle

Array = NDArray[np.float64]

FEWEST = 200
"""Fewest rays of a table."""
FINE = 1e-7
"""Metres in the image: without an accuracy asked for, a map need not be better; a tenth of the smallest pixels."""
ETENDUE, WRONG = 0.02, 0.3
"""Deviations of the determinant of rays near the axis from 1, that of any lens in air: warned about; refused."""
EMPTY = 0.02
"""Share of a lens's opening without rays near by that is warned about."""


@dataclass(frozen=True, eq=False, repr=False)
class RayTable(Brief, Value):
    """Rays before and behind a lens of rotational symmetry in air.

    Args:
        rays: (rays, 8): x, y, s, t in the plane before the lens and x, y, s, t in the plane behind it, of rays
            that pass. Places are metres from the axis, slopes dx/dz and dy/dz, with z along the light; planes may
            lie anywhere, also inside the glass or beyond each other. Rays should fill the light that the lens
            transmits to the sensor evenly: the opening is their convex hull, rotated about the axis.
        thickness: distance from the plane before the lens to that behind it, metres.
        accuracy: root mean square error in the image of a distant scene, metres: the degree of the map is the
            lowest that reaches it for rays that were not fitted. None: 0.1 µm, or the smallest error that is
            reached.

    Raises:
        InputError: fewer than `FEWEST` rays, rays of one direction only, rays behind that are no lens's in air
            (wrong units or signs), or an accuracy that no degree reaches.

    Warns:
        ResultWarning: parts of the opening have no rays near by, or rays near the axis contradict each other.
    """

    rays: Array
    thickness: float = field(default=0.0, metadata={"unit": "length"})
    accuracy: float | None = field(default=None, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        what = "numbers (rays, 8): x, y, s, t before the lens, and behind it"
        given = checks.array("rays of a ray table", self.rays, what, None, 8)
        object.__setattr__(self, "rays", given)
        checks.zero_or_more("thickness of a ray table", self.thickness, unit="m")
        checks.sizes("a ray table", accuracy=self.accuracy, way_out="leave it out for the smallest error")
        if len(given) < FEWEST:
            raise InputError(f"a ray table has {len(given)} rays: give {FEWEST} or more")
        for name, slopes in (("before", given[:, 2:4]), ("behind", given[:, 6:])):
            if not np.abs(slopes).max() > 0:
                raise InputError(f"all rays of a ray table are parallel to the axis {name} the lens")

    @property
    @cached
    def maps(self) -> tuple[Fit, Fit]:
        """The map along the light, and the map back."""
        before, behind = self.rays[:, :4], self.rays[:, 4:]
        back = fits(behind, before)
        onward = fits(before, behind)
        matrix = onward[-1].map.matrix
        off = abs(float(np.linalg.det(matrix)) - 1)
        if not off <= WRONG:
            raise InputError(
                f"rays next to the axis change étendue by the factor {np.linalg.det(matrix):.4g}, and by 1 "
                "through any lens in air: check units and signs of the table (places in metres, slopes dx/dz "
                "along the light)"
            )
        scale = abs(1 / matrix[1, 0]) if abs(matrix[1, 0]) > 1e-9 else 1.0
        errors = [scale * fit.slope for fit in back]
        best = int(np.argmin(errors))
        wanted = max(FINE, errors[best]) if self.accuracy is None else self.accuracy
        if errors[best] > wanted:
            raise InputError(
                f"no map reaches an accuracy of {short(wanted)} for the {len(self.rays)} rays of the table: "
                f"degree {2 * best + 1} is off by {short(errors[best], digits=2)}. Ask for less, or give more rays"
            )
        chosen = next(n for n, error in enumerate(errors) if error <= wanted)
        if off > ETENDUE:
            warn_of_result(
                f"rays of a table contradict each other: next to the axis, étendue changes by {off:.1%}"
            )
        if back[0].empty > EMPTY:
            warn_of_result(
                f"{back[0].empty:.0%} of the opening that a ray table is taken to have is far from all of its "
                "rays: the light is not convex there, or the rays are not evenly spread; the lens transmits "
                "light there"
            )
        return onward[min(chosen, len(onward) - 1)], back[chosen]

    @property
    def matrix(self) -> Array:
        """((A, B), (C, D)) of rays next to the axis, (2, 2), SI, with determinant 1."""
        found = self.maps[0].map.matrix
        return np.asarray(found / math.sqrt(np.linalg.det(found)))

    @property
    def image_error(self) -> float:
        """Root mean square error in the image of a distant scene, of rays that were not fitted, metres."""
        power = abs(float(self.matrix[1, 0]))
        return self.maps[1].slope / power if power > 1e-9 else self.maps[1].place

    def described(self) -> str:
        """Rays, degree and errors, as text."""
        back = self.maps[1]
        return (
            f"{len(self.rays)} rays, map of degree {2 * back.map.order + 1}, off by "
            f"{short(self.image_error, digits=2)} in the image of a distant scene (root mean square of rays that "
            f"were not fitted), light known to {max(back.edge, 1e-4):.1%}"
        )


@dataclass(frozen=True, eq=False, repr=False)
class RayTableLens(Brief, Value, TracedLens):
    """A lens known by a table of rays, without its surfaces (Goossens et al. 2022, Optics Express 30, 24031).

    Its map of rays is a polynomial with rotational symmetry; see `RayTable`. Aberrations, distortion, vignetting
    and the irradiance are those of the rays. No light passes outside the opening that the rays of the table fill:
    the map is never extrapolated. The table holds for one wavelength and one opening of the stop.

    Args:
        table: the rays; its first plane stands at z.
        radiometry: as in `vcc.RealLens`.
        source: where the table comes from, as text.
    """

    table: RayTable
    radiometry: str = "exact"
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.table, RayTable):
            raise InputError(f"{self.label} needs a vcc.RayTable, not {type(self.table).__name__}")
        checks.one_of(f"radiometry of {self.label}", self.radiometry, RADIOMETRIES)

    @property
    def length(self) -> float:
        """From the table's first plane to the second, metres."""
        return self.table.thickness

    @property
    def front(self) -> float:
        """The element begins at z."""
        return 0.0

    @property
    def first_order(self) -> FirstOrder:
        """The lens by its rays next to the axis: focal length, principal planes, image distance."""
        return FirstOrder(self.table.matrix, self.length, z=self.z, decentre=self.decentre, name=self.name)

    @property
    def half_size(self) -> float:
        """Largest distance of the table's rays from the axis in its two planes, metres."""
        return float(np.hypot(self.table.rays[:, [0, 4]], self.table.rays[:, [1, 5]]).max())

    def parts(self) -> tuple[Part, ...]:
        """The map's deviation from first order, then the first order."""
        onward, back = self.table.maps
        matrix = Affine.abcd(self.table.matrix)
        exact = self.radiometry == "exact"
        return (Faces(deflection=Aberrations((onward.map,), 0.0, (back.map,), 0.0, matrix, exact)), matrix)

    def window(self, seen: Seen | None) -> tuple[Part, ...]:
        """A disc where the light behind the lens is narrowest: rays are aimed at it.

        Args:
            seen: not used; all light of the table passes the disc.
        """
        back = self.table.maps[1].map
        flight = Affine.propagation(back.distance)
        return (flight, Faces(transmission=Circle(2 * back.radius)), flight.inverse())

    def described(self) -> str:
        """Focal length, and the map and how well it is known, as text."""
        words = [f"focal length {short(self.focal_length)}"] if math.isfinite(self.focal_length) else []
        return self._in_words(*words, self.table.described())
