"""A real lens: rays refracted exactly by each surface of a prescription."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.optics.aberrations import Aberrations
from vcc.optics.band import Band
from vcc.optics.faces import Element, Faces, Part, Way
from vcc.optics.first_order import FirstOrder
from vcc.optics.prescription import Prescription, Reference, Surface
from vcc.optics.refraction import Refraction, traced, traced_on
from vcc.optics.visible_pupil import Passes, tables_of
from vcc.shapes.patterns import Circle, Pattern

Array = NDArray[np.float64]

RADIOMETRIES = ("exact", "paraxial")
"""How the irradiance behind a lens counts: by angles (cos⁴θ), or by slopes."""
PUPIL_STEP = 0.01
"""Radii of exit windows are rounded up to powers of 1 plus this, and stay while a lens changes a little."""
NO_GAIN = 1e-9
"""Metres by which a slope moves light on the sensor; below it, a plane behind the lens is imaged there."""
FARTHEST = 100.0
"""An exit pupil farther away than this many lengths of the lens is replaced by the plane behind the lens."""


class TracedLens(Element):
    """A lens with all its aberrations: rays through it are traced, and its first order is a part of it."""

    radiometry: str
    source: str

    @property
    @abstractmethod
    def first_order(self) -> FirstOrder:
        """The lens without aberrations: focal length, principal planes, image distance."""

    @abstractmethod
    def window(self, seen: Seen | None) -> tuple[Part, ...]:
        """A disc behind the lens that all light passes on its way to the sensor: rays are aimed at it.

        Args:
            seen: how the sensor sees the end of the lens; None if this is not known in first order.
        """

    @property
    def focal_length(self) -> float:
        """By the first order, metres."""
        return self.first_order.focal_length

    def image_distance(self, object_distance: float) -> float:
        """From the end of the element to the first-order image; see `vcc.FirstOrder.image_distance`."""
        return self.first_order.image_distance(object_distance)

    @property
    def focus_z(self) -> float:
        """Place on the axis of the first-order image of a distant scene, metres."""
        return self.z + self.length + self.image_distance(math.inf)

    def faces(self) -> Faces:
        """No faces: the effect of a thick element is between its planes; see `parts`."""
        return Faces()

    def _in_words(self, *words: str) -> str:
        """What describes the lens, its radiometry and its source, as text."""
        listed = [*words, f"{self.radiometry} radiometry"]
        return ", ".join([*listed, f"from {self.source}"] if self.source else listed)


@dataclass(frozen=True)
class RealLens(TracedLens):
    """A lens with all its aberrations, vignetting and colour: each ray is refracted by each surface.

    Refraction follows Snell's law without approximation, so the lens is exact within geometric optics; light
    reflected between surfaces (flare) and diffraction are not simulated. Rays pass if they are within the clear
    diameter of every surface that has one. A light field on either side is described by slopes, as everywhere.

    Args:
        prescription: the surfaces; `vcc.load_lens` reads them from a file.
        stop_diameter: of the round aperture stop, metres; None: that of the prescription.
        mask: transmission in the plane of the stop, in place of the round opening; the stop must be a flat surface
            in air.
        front: distance from z to the vertex of the first surface, metres; negative if glass stands before z.
        dispersion: whether each band of light has its own indices, where the prescription names glasses.
        radiometry: ``"exact"``: the irradiance behind the lens is ∫ L cosθ dω; ``"paraxial"``: ∫ L ds dt, as
            behind thin lenses, without the fall-off cos⁴θ.
        transmission: share of light that each surface transmits: a number for all, or one for each surface.
        fresnel: whether surfaces are without coatings: each then transmits what Fresnel's formulas state for
            unpolarised light, from indices and angle.
        softness: width over which the edges of stop and rims fall off, metres; 0 is hard. Gradients with
            respect to what moves an edge against rays need soft edges.
        source: where the lens comes from, as text.

    Raises:
        InputError: nothing bounds the light (no stop and no diameters), a mask but no flat stop in air, a
            transmission that is not a share, or another value out of range.
    """

    prescription: Prescription
    stop_diameter: float | None = field(default=None, metadata={"unit": "length"})
    mask: Pattern | None = None
    front: float = field(default=0.0, metadata={"unit": "length"})
    dispersion: bool = True
    radiometry: str = "exact"
    transmission: float | tuple[float, ...] = 1.0
    fresnel: bool = False
    softness: float = field(default=0.0, metadata={"unit": "length"})
    source: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not isinstance(self.prescription, Prescription):
            raise InputError(
                f"{self.label} needs a prescription, not {type(self.prescription).__name__}: vcc.load_lens(file, "
                'model="real") reads one'
            )
        checks.sizes(self.label, stop_diameter=self.stop_diameter, way_out="leave it out for that of the file")
        checks.finite(f"front of {self.label}", self.front, "metres")
        checks.one_of(f"radiometry of {self.label}", self.radiometry, RADIOMETRIES)
        checks.zero_or_more(f"softness of {self.label}", self.softness, unit="m")
        self._check_transmission()
        if self.mask is not None and self._split is None:
            raise InputError(
                f"{self.label} has no plane for a mask: the stop of "
                f"{self.prescription.source or 'its prescription'} must be a flat surface in air, between others"
            )
        if self.stop_number is None:
            raise InputError(
                f"nothing bounds the light through {self.label}: its prescription marks no stop and states no "
                "diameters. Give the surfaces diameters"
            )

    def _check_transmission(self) -> None:
        given = self.transmission
        count = len(self.prescription.surfaces)
        shares = tuple(given) if isinstance(given, Sequence) else (given,) * count
        if len(shares) != count:
            raise InputError(
                f"transmission of {self.label} has {len(shares)} shares, and the lens has {count} surfaces: give "
                "one for each, or one number for all"
            )
        for share in shares:
            checks.above_zero(f"transmission of {self.label}", share)
            if share > 1:
                raise InputError(f"transmission of {self.label} is a share above 0 and up to 1, not {share:g}")

    @classmethod
    def of(
        cls,
        prescription: Prescription,
        *,
        z: float = 0.0,
        z_of: Reference = "first surface",
        stop_diameter: float | None = None,
        f_number: float | None = None,
        **options: Any,
    ) -> RealLens:
        """A real lens placed by its first surface or by its entrance pupil, opened to an f-number.

        Args:
            prescription: the surfaces.
            z: position of the first surface, or of the reference ``z_of``, metres.
            z_of: ``"first surface"``, or ``"entrance pupil"``, by first order.
            stop_diameter: metres; None for the stop of the prescription.
            f_number: focal length / entrance pupil for a distant scene, as an alternative to ``stop_diameter``.
            options: the other parameters of a `RealLens`.

        Raises:
            InputError: as in `vcc.RealLens` and `Prescription.opening`; an entrance pupil at infinity.
        """
        checks.one_of("z_of", z_of, get_args(Reference))
        opening, front = prescription.opening(stop_diameter, f_number), 0.0
        if z_of == "entrance pupil":
            pupil = prescription.opened(opening).first_order().entrance_pupil.distance
            if math.isinf(pupil):
                raise InputError("the entrance pupil lies at infinity: place the lens by its first surface")
            front = -pupil
        return cls(prescription, opening, z=z, front=front, **options)

    # --- the lens in first order

    @property
    @cached
    def first_order(self) -> FirstOrder:
        """The lens without aberrations: focal length, principal planes, pupils, image distance."""
        lens = self.prescription.opened(self.stop_diameter).first_order(z=self.z, decentre=self.decentre)
        to_first, behind = Affine.propagation(self.front), Affine.propagation(self._behind)
        matrix = (behind @ lens.affine @ to_first).linear[0:4:2, 0:4:2]
        stop = lens.stop_from_entrance
        if stop is not None:
            stop = np.array(stop) @ to_first.linear[0:4:2, 0:4:2]
        return replace(lens, matrix=matrix, length=self.length, stop_from_entrance=stop, name=self.name)

    @property
    def length(self) -> float:
        """From z to the vertex of the last surface, or 0 if that stands before z, metres."""
        return max(self.front + self.prescription.length, 0.0)

    @property
    def _behind(self) -> float:
        """From the vertex of the last surface to the end of the element, metres."""
        return self.length - (self.front + self.prescription.length)

    @property
    def f_number(self) -> float:
        """By the first order, for a distant scene."""
        return self.first_order.f_number

    # --- surfaces

    @property
    def stop_number(self) -> int | None:
        """The position of the surface that limits the light: the marked stop, or the smallest diameter."""
        surfaces = self.prescription.surfaces
        for n, surface in enumerate(surfaces):
            if surface.stop:
                return n
        known = [(surface.diameter, n) for n, surface in enumerate(surfaces) if surface.diameter is not None]
        return min(known)[1] if known else None

    @property
    def _split(self) -> int | None:
        """The position of the stop if a mask can stand in its plane: flat, in air on both sides."""
        number, surfaces = self.stop_number, self.prescription.surfaces
        if number is None or not surfaces[number].stop:
            return None
        stop = surfaces[number]
        before = surfaces[number - 1].index if number else 1.0
        flat = math.isinf(stop.radius) and not stop.aspheres
        return number if flat and before == 1.0 == stop.index and 0 < number < len(surfaces) - 1 else None

    @property
    @cached
    def onward(self) -> tuple[Refraction, ...]:
        """All surfaces as light meets them from the plane z on."""
        surfaces, opening = self.prescription.surfaces, self.prescription.opening(self.stop_diameter)
        found: list[Refraction] = []
        before = 1.0
        for n, surface in enumerate(surfaces):
            diameter = opening if surface.stop else surface.diameter
            if surface.stop and self.mask is not None:
                diameter = None
            given = self.transmission
            share = given[n] if isinstance(given, Sequence) else given
            found.append(
                Refraction(
                    distance=self.front if n == 0 else surfaces[n - 1].thickness,
                    curvature=1 / surface.radius,
                    conic=float(surface.conic),
                    aspheres=np.array(surface.aspheres, dtype=np.float64),
                    ratio=before / surface.index,
                    radius=math.inf if diameter is None else diameter / 2,
                    softness=self.softness if diameter is not None else 0.0,
                    transmission=1.0 if _is_empty(surface, before) else float(share),
                    fresnel=self.fresnel and not _is_empty(surface, before),
                )
            )
            before = surface.index
        return tuple(found)

    def parts(self) -> tuple[Part, ...]:
        """The surfaces' deviation from first order, then the first order; twice, around a mask at the stop."""
        onward, split = self.onward, self._split if self.mask is not None else None
        weighted = self.radiometry == "exact"
        if split is None:
            whole = _between(onward, self._behind, weighted)
            return (Faces(deflection=whole), whole.first_order)
        front = _between(onward[:split], onward[split].distance, False)
        rear = _between(onward[split + 1 :], self._behind, weighted)
        middle: list[Part] = [Faces(deflection=front), front.first_order, Faces(transmission=self.mask)]
        return (*middle, Faces(deflection=rear), rear.first_order)

    def window(self, seen: Seen | None) -> tuple[Part, ...]:
        """A disc behind the lens that all light passes on its way to the sensor: rays are aimed at it.

        It stands in the first-order exit pupil, or at the end of the lens if that is far away.

        Args:
            seen: how the sensor sees the end of the lens; None if this is not known in first order.
        """
        distance = self._pupil_distance
        widest = None if seen is None else self._widest_seen(distance, seen)
        radius = self._exit_radius if widest is None else _rounded_up(widest)
        disc = Faces(transmission=Circle(2 * radius))
        flight = Affine.propagation(distance)
        return (flight, disc, flight.inverse())

    @property
    @cached
    def _exit_radius(self) -> float:
        """Radius of a disc in the exit pupil that all light leaving the lens passes, metres."""
        return _rounded_up(self._widest(self._pupil_distance))

    @property
    @cached
    def _pupil_distance(self) -> float:
        """From the end of the element to the first-order exit pupil, metres; 0 if that is far away."""
        number, length = self.stop_number, max(self.prescription.length, 1e-3)
        assert number is not None
        behind = Affine.propagation(self._behind) @ _first_order(self.onward[number + 1 :])
        exit_from_slope, slope_from_slope = behind.linear[0, 2], behind.linear[2, 2]
        # The image of the stop: where rays from its middle meet the axis again.
        far = abs(exit_from_slope) >= FARTHEST * length * abs(slope_from_slope)
        return 0.0 if far else float(-exit_from_slope / slope_from_slope)

    def _widest_seen(self, distance: float, seen: Seen) -> float | None:
        """A bound of the distance from the axis at which light for the sensor meets a plane behind the lens, m.

        It is the largest distance for all sensors that are up to `PUPIL_STEP` larger or farther away than one of
        them, and is computed once for these.

        None if the plane is imaged on the sensor, or if no light reaches it.

        Args:
            distance: of the plane, from the end of the element, metres.
            seen: how the sensor sees the end.
        """
        gain = seen.gain(distance)
        if abs(gain) < NO_GAIN:
            return None
        nearest = math.copysign(_power_of_step(abs(gain), math.floor), gain)
        radius = _power_of_step(seen.radius, math.ceil)
        return _widest_through(self._alone, distance, seen.from_place, nearest, radius)

    @property
    def _alone(self) -> RealLens:
        """The lens without all that does not change which rays pass: equal for lenses that pass the same rays."""
        mask = None if self.mask is None else Circle(max(self._mask_size()))
        return replace(self, z=0.0, decentre=(0.0, 0.0), name="", mask=mask, transmission=1.0)

    def _passes(self, distance: float, from_place: float, gain: float) -> Passes:
        """Whether light for places p on the sensor passes places (a, b) in a plane, all in metres; see `Passes`.

        ``a`` is along the direction of p. A ray (q, s) in the plane meets the sensor at from_place·q + gain·s.
        """
        back = list(_reversed(self.onward))
        back[0] = replace(back[0], distance=-self._behind)
        if self.mask is not None:  # no farther out than its corners
            number = len(back) - 1 - (self.stop_number or 0)
            back[number] = replace(back[number], radius=self._stop_radius)
        surfaces = tuple(back)

        def passes(points: Array) -> NDArray[np.bool_]:
            place = points[:, 1:]
            image = np.stack([points[:, 0], np.zeros(len(points))], axis=-1)
            slope = (image - from_place * place) / gain
            rays = np.concatenate([place - distance * slope, slope], axis=-1)
            passed = np.zeros(len(rays), dtype=np.bool_)
            passed[traced_on(surfaces, rays)[1]] = True
            return passed

        return passes

    def visible_pupil(self, seen: Seen, radius: float, check: Callable[[], None] = lambda: None) -> Array | None:
        """The part of the disc of `window` that places on the sensor see, as `vcc.optics.visible_pupil.tables_of`.

        None for soft edges, which gradients need: then the part changes with the lens, and tables of it would too.

        Args:
            seen: how the sensor sees the end of the lens.
            radius: of the disc, metres.
            check: called every few milliseconds; an exception that it raises ends the computation.
        """
        distance = self._pupil_distance
        gain = seen.gain(distance)
        if self.softness > 0 or abs(gain) < NO_GAIN:
            return None
        passes = self._passes(distance, seen.from_place, gain)
        unit = np.array([1.0, radius, radius])

        def seen_from(points: Array) -> NDArray[np.bool_]:
            check()
            return passes(points * unit)

        return tables_of(seen_from, seen.radius)

    def visible_nearby(self, seen: Seen, radius: float) -> Array | None:
        """As `visible_pupil`, for all sensors of which `Seen.rounded` is the same: computed once for them."""
        return _visible_through(self._alone, seen.rounded(), radius)

    def _widest(self, distance: float) -> float:
        """As `_widest_seen`, for light that goes anywhere: rays from all over the stop in all directions."""
        number, onward = self.stop_number, self.onward
        assert number is not None
        to_stop, behind = onward[: number + 1], onward[number:]
        back = tuple(_reversed(to_stop)[1:])
        ahead = (replace(behind[0], distance=0.0), *behind[1:])
        wide = 1.2 * self._stop_radius  # on a curved stop, its edge is met off the plane of its vertex
        flight = self._behind + distance

        def met(rays: Array) -> Array:
            """How far out rays (r, s, t) from the stop meet the plane; -1 for rays that do not pass."""
            rays = np.insert(rays, 1, 0.0, axis=1)
            found, share = traced(ahead, rays)
            _, before = traced(back, rays)
            away = np.hypot(*(found[..., :2] + flight * found[..., 2:]).T)
            return np.where((share > 0) & (before > 0), away, -1.0)

        r, s, t = np.meshgrid(
            np.linspace(0, wide, 13), np.linspace(-2, 2, 81), np.linspace(0, 2, 25), indexing="ij"
        )
        rays = np.stack([r.ravel(), s.ravel(), t.ravel()], axis=-1)
        away = met(rays)
        if away.max() <= 0:
            raise InputError(f"no light passes {self.label}: its rims stop all rays from its stop")
        return _refined(rays, away, met, np.array([wide / 12, 0.05, 0.083]))

    @property
    def _stop_radius(self) -> float:
        """Half the size of the stop, with its soft edge, metres."""
        number = self.stop_number
        assert number is not None
        stop = self.onward[number]
        radius = stop.radius if math.isfinite(stop.radius) else max(self._mask_size()) / math.sqrt(2)
        return radius + stop.softness

    def _mask_size(self) -> tuple[float, float]:
        assert self.mask is not None
        if not all(map(math.isfinite, self.mask.size)):
            raise InputError(f"the mask of {self.label} has no edge, so nothing bounds the light: give it a size")
        return self.mask.size

    # --- colour

    @property
    def depends_on_band(self) -> bool:
        """Whether bands have indices of their own."""
        return self.dispersion and self.prescription.disperses

    def ways(self, band: Band) -> tuple[Way, ...]:
        """The lens with the indices of a band.

        Raises:
            InputError: a band without a wavelength, or outside the range of a glass.
        """
        if not self.depends_on_band:
            return super().ways(band)
        there = self.prescription.at_wavelength(band.stated(self.label))
        opening = self.prescription.opening(self.stop_diameter)
        return ((1.0, replace(self, prescription=there, dispersion=False, stop_diameter=opening)),)

    def described(self) -> str:
        """Focal length, aperture, surfaces and what counts as loss, as text."""
        lens, count = self.first_order, len(self.prescription.surfaces)
        words = [f"{count} surfaces"]
        if math.isfinite(lens.focal_length):
            words.append(f"focal length {short(lens.focal_length)}")
        if lens.stop_diameter is not None:
            words.append(f"stop {short(lens.stop_diameter)}")
            if math.isfinite(lens.f_number):
                words.append(f"f/{lens.f_number:.3g}")
        open_ones = sum(each.diameter is None and not each.stop for each in self.prescription.surfaces)
        words += [f"{open_ones} surfaces without a clear diameter"] if open_ones else []
        words += ["a mask at its stop"] if self.mask is not None else []
        words += ["dispersion"] if self.depends_on_band else []
        return self._in_words(*words)


@dataclass(frozen=True)
class Seen:
    """How a sensor sees the end of a lens: a ray (x, s) there meets the sensor at from_place·x + from_slope·s.

    Args:
        from_place: likewise along y; both are relative to the ray along the lens's axis.
        from_slope: metres.
        axis: that ray's place (x, y), metres.
        radius: of the disc around that place that the sensor is within, metres.
    """

    from_place: float
    from_slope: float
    axis: tuple[float, float]
    radius: float

    def gain(self, distance: float) -> float:
        """From slopes to places on the sensor, for rays from a place ``distance`` behind the end, metres."""
        return self.from_slope - distance * self.from_place

    def rounded(self) -> Seen:
        """From the nearest of distances 1 % apart: at half of this, a double Gauss loses 0.05 % of its light."""
        steps = round(100 * math.log(max(abs(self.from_slope), 1e-9)))
        return replace(self, from_slope=math.copysign(math.exp(steps / 100), self.from_slope))


@lru_cache(maxsize=64)
def _widest_through(
    lens: RealLens, distance: float, from_place: float, gain: float, radius: float
) -> float | None:
    """See `RealLens._widest_seen`: for sensors of up to this radius, from this gain to `PUPIL_STEP` above it."""
    passes = lens._passes(distance, from_place, gain)
    # A ray that meets a sensor of the class at p meets the sensor with the least gain at most so far beside p.
    beside = PUPIL_STEP * abs(from_place)

    def met(points: Array) -> Array:
        """How far out points (share of the way to the farthest p, q, angle) are; -1 if light does not pass."""
        share, q, angle = points.T
        p = share * (radius + beside * q)
        return np.where(passes(np.stack([p, q * np.cos(angle), q * np.sin(angle)], axis=-1)), q, -1.0)

    reach = 2 * lens._stop_radius
    for _ in range(6):
        share, q, angle = np.meshgrid(
            np.linspace(0, 1, 7), np.linspace(0, reach, 41), np.linspace(0, np.pi, 13), indexing="ij"
        )
        points = np.stack([share.ravel(), q.ravel(), angle.ravel()], axis=-1)
        away = met(points)
        widest = float(away.max())
        if widest < 0.8 * reach:
            break
        reach *= 2
    if widest <= 0:
        return None
    return _refined(points, away, met, np.array([1 / 6, reach / 40, np.pi / 12]))


@lru_cache(maxsize=64)
def _visible_through(lens: RealLens, seen: Seen, radius: float) -> Array | None:
    """See `RealLens.visible_nearby`."""
    return lens.visible_pupil(seen, radius)


def _refined(points: Array, away: Array, met: Callable[[Array], Array], step: Array) -> float:
    """The largest value of a function around the points of a grid where it is large, by repeated random steps.

    Args:
        points: of the grid.
        away: the function's values there.
        met: the function.
        step: largest first steps.
    """
    draw = np.random.default_rng(0)
    for _ in range(7):
        best = np.argsort(away)[-24:]
        points, away = points[best], away[best]
        near = (points + draw.uniform(-1, 1, (32, *points.shape)) * step).reshape(-1, points.shape[1])
        points, away, step = np.concatenate([points, near]), np.concatenate([away, met(near)]), step / 2
    return float(away.max())


def _rounded_up(radius: float) -> float:
    """A power of 1 + PUPIL_STEP, one to two steps above a radius that random rays found, metres."""
    return _power_of_step(radius, math.ceil) * (1 + PUPIL_STEP)


def _power_of_step(number: float, rounded: Callable[[float], int]) -> float:
    """The power of 1 + PUPIL_STEP next to a number above 0, below it or above it."""
    return float((1 + PUPIL_STEP) ** rounded(math.log(number) / math.log1p(PUPIL_STEP)))


def _is_empty(surface: Surface, before: float) -> bool:
    """Whether a surface is only a hole: the same medium on both sides."""
    return surface.index == before


def _reversed(onward: Sequence[Refraction]) -> tuple[Refraction, ...]:
    """Surfaces as rays traced against the light meet them, from the vertex of the last one on."""
    found, distance = [], 0.0
    for surface in reversed(onward):
        found.append(replace(surface, distance=distance, ratio=1 / surface.ratio))
        distance = -surface.distance
    return tuple(found)


def _between(onward: tuple[Refraction, ...], ending: float, weighted: bool) -> Aberrations:
    """The surfaces from the plane where the first one's distance begins to ``ending`` metres behind the last."""
    back = list(_reversed(onward))
    back[0] = replace(back[0], distance=-ending)
    return Aberrations(
        onward=onward,
        ending=ending,
        back=tuple(back),
        beginning=-onward[0].distance,
        first_order=Affine.propagation(ending) @ _first_order(onward),
        cosine_fourth=weighted,
    )


def _first_order(onward: Sequence[Refraction]) -> Affine:
    """The first-order map of rays through surfaces, from the plane where the first one's distance begins."""
    found = Affine.identity()
    for surface in onward:
        # (n' − n)/R and the slopes' factor n/n' of a surface between media: Hecht, Optics, section 6.2.
        refraction = np.array([[1.0, 0.0], [-(1 - surface.ratio) * surface.curvature, surface.ratio]])
        flight = np.array([[1.0, surface.distance], [0.0, 1.0]])
        found = Affine.abcd(refraction @ flight) @ found
    return found
