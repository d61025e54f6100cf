"""Real rays of points of the scene through all stages of a train to its sensor, and back.

Rays of a point are searched for where the camera takes light in, which aberrations of pupils move and rims cut:
no first-order pupil is assumed. The chief ray passes the middle of the stop.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.wavelengths import wavelength as checked_wavelength
from vcc.optics.aberrations import Aberrations
from vcc.optics.band import Band
from vcc.optics.bands import single_way
from vcc.optics.faces import Faces
from vcc.optics.ray_map import RayMap
from vcc.optics.ray_table import RayTableLens
from vcc.optics.real_lens import RealLens, TracedLens
from vcc.optics.refraction import Refraction, traced
from vcc.optics.train import Stage, Train

Array = NDArray[np.float64]
Box = tuple[Array, Array]
"""(low, high), each (x, y)."""

SIDE = 48
"""Rays per side of the box around a point's light; about π/4 of their square pass a round pupil."""
SEARCHED = 65
"""Rays per side in the search for the light of a point; odd, so that one is in the middle."""
ROUNDS = 12
"""Most rounds of this search: the box grows, or shrinks onto the light."""
NEAR_AXIS = 1e-4
"""Slope from the axis of the points that measure the scale of the image."""
STEPS, ITERATIONS = 12, 5
"""Steps from the axis to a field on which chief rays are followed, and Newton's iterations in each."""
SPECTRUM = (486.1327e-9, 587.5618e-9, 656.2725e-9)
"""The lines F, d and C, metres: the wavelengths of a camera that disperses, unless others are given."""


@dataclass(frozen=True, eq=False, repr=False)
class Bundle(Brief):
    """The light of one point of the scene at the sensor.

    Args:
        places: (n, 2) on the sensor, metres.
        slopes: (n, 2) there.
        light: (n,): the area of the entrance plane that each ray stands for, times its share of light, m².
        stop: (n, 2): places in the stop, in units of its radius.
    """

    places: Array
    slopes: Array
    light: Array
    stop: Array

    @property
    def centroid(self) -> Array:
        """Of the light, (x, y), metres."""
        return np.asarray(self.light @ self.places / self.light.sum())

    def rms(self, shift: float = 0.0) -> float:
        """Root mean square distance from the centroid, metres, on a sensor ``shift`` metres farther behind."""
        places = self.places + shift * self.slopes
        share = self.light / self.light.sum()
        return float(np.sqrt(share @ ((places - share @ places) ** 2).sum(axis=1)))

    def contrast(self, frequencies: Any, shift: float = 0.0) -> Array:
        """The geometric MTF along x and along y: (…, 2), for frequencies (…) in cycles per metre."""
        places = self.places - self.centroid + shift * self.slopes
        waves = np.exp(-2j * np.pi * np.asarray(frequencies)[..., None, None] * places)
        return np.asarray(np.abs(np.einsum("n,...nc->...c", self.light / self.light.sum(), waves)))


def bands_of(
    train: Train, wavelengths: Sequence[float] | None
) -> tuple[tuple[float | None, ...], tuple[Train, ...]]:
    """Wavelengths, and the train that light of each meets.

    Args:
        train: the camera.
        wavelengths: metres; None: `SPECTRUM` for a camera that depends on the wavelength, or a single one, None.

    Raises:
        InputError: a wavelength outside the range of a glass; filters, which make no single train.
    """
    if wavelengths is None:
        if not train.depends_on_bands:
            return (None,), (train,)
        wavelengths = SPECTRUM
    listed = tuple(checked_wavelength("a wavelength", each) for each in wavelengths)
    if not listed:
        raise InputError("wavelengths is empty: name at least one, in metres, such as 550 * nm")
    return listed, tuple(_at_wavelength(train, each) for each in listed)


@lru_cache(maxsize=32)
def _at_wavelength(train: Train, wavelength: float) -> Train:
    """The train that light of a wavelength meets; kept, since its lenses find their windows by many rays."""
    return single_way(train, Band(wavelength=wavelength))


def rays_from(distance: float, field: Any, places: Array) -> Array:
    """The rays (..., 4) of a point through places (..., 2) of the entrance plane.

    Args:
        distance: of the point before that plane, metres; may be infinite.
        field: its direction as slopes (X/Z, Y/Z), (..., 2).
        places: metres.
    """
    return np.concatenate([places, places / distance - field], axis=-1)


# --- through the camera


def light_stages(train: Train) -> list[Stage]:
    """The stages that light meets, with the windows of real lenses open.

    A window is a disc behind a lens that rays are aimed at. Light that passes beside it misses the sensor, but
    points may be analysed whose image is outside the sensor.

    Args:
        train: the camera.
    """
    found = list(train.stages)
    for number, stage in enumerate(found):
        last = number + 1 == len(found) or found[number + 1].element is not stage.element
        if isinstance(stage.element, TracedLens) and stage.faces.bending is None and last:
            found[number] = replace(stage, faces=Faces())
    return found


def to_sensor(train: Train, rays: Array, rims: bool = True) -> tuple[Array, Array]:
    """Rays (..., 4) of the entrance plane at the sensor, and their light (...), 0 where they are stopped.

    Args:
        train: the camera; scattering is ignored.
        rays: metres and slopes.
        rims: False: by real lenses without clear diameters and by first-order optics alone, without any mask: the
            geometry of chief rays. Rays that miss a surface become NaN.
    """
    light = np.ones(rays.shape[:-1])
    for stage in light_stages(train):
        rays = stage.approach(rays)
        if rims:
            light = light * stage.share(rays)
        rays, passed = _crossed(stage, rays, rims)
        light = light * passed
    return np.asarray(train.approach_to_sensor(rays)), light


def _crossed(stage: Stage, rays: Array, rims: bool) -> tuple[Array, Array]:
    if rims:
        return stage.crossed(rays)
    bending = stage.faces.bending
    if isinstance(bending, Aberrations):
        free = replace(stage, faces=replace(stage.faces, deflection=bending.without_rims))
        return free.deflected(rays), np.ones(rays.shape[:-1])
    return (rays if bending is not None else stage.deflected(rays)), np.ones(rays.shape[:-1])


def from_sensor(train: Train, rays: Array, rims: bool = True) -> tuple[Array, Array]:
    """Rays (..., 4) of the sensor at the entrance plane, and the share of light that passes.

    The irradiance of uniform light at a place of the sensor is the sum of shares times ds·dt. With the exact
    radiometry of real lenses, shares contain cos⁴θ.

    Args:
        train: the camera; scattering is ignored.
        rays: metres and slopes at the sensor.
        rims: False: without clear diameters and masks, as in `to_sensor`; rays that miss a surface become NaN.
    """
    share, onward = np.ones(rays.shape[:-1]), train.approach_to_sensor
    for stage in reversed(light_stages(train)):
        rays = onward.inverse()(rays)
        onward, bending = stage.approach, stage.faces.bending
        middle = [*stage.element.decentre, 0.0, 0.0]
        if isinstance(bending, Aberrations):
            behind = bending.first_order(rays - middle)
            rays, passed = (bending if rims else bending.without_rims).back_through(behind)
            rays = rays if rims else np.where(passed[..., None] > 0, rays, np.nan)
            if bending.cosine_fourth:
                passed = passed / (1 + (behind[..., 2:] ** 2).sum(axis=-1)) ** 2
            rays, share = rays + middle, share * passed
        elif stage.centred is not None:
            rays = stage.centred.inverse()(rays)
        elif bending is not None:
            s, t = stage.bent(rays[..., 0], rays[..., 1])
            rays = rays - np.stack([0 * s, 0 * s, s, t], axis=-1)
        share = share * stage.share(rays) if rims else share
    return np.asarray(onward.inverse()(rays)), share


# --- the stop, and chief rays


@dataclass(frozen=True, eq=False, repr=False)
class Stop(Brief):
    """Where a camera's stop is on the way of rays.

    Args:
        stages: that rays cross before it.
        surfaces: of the real lens that the next stage is, up to and with the stop; 0: the stop is where that stage
            begins.
        radius: metres; infinite if unknown.
    """

    stages: int
    surfaces: int
    radius: float

    @classmethod
    def of(cls, train: Train) -> Stop:
        """The stop of the first real lens, else the opening that limits slopes most, else the entrance plane.

        The stop of a lens known by a table of rays is where its light is narrowest, from the middle of its
        opening.
        """
        for number, stage in enumerate(train.stages):
            lens = stage.element
            if isinstance(lens, RayTableLens) and isinstance(stage.faces.bending, Aberrations):
                return cls(number, 1, lens.table.maps[0].map.radius)
            if isinstance(lens, RealLens) and isinstance(stage.faces.bending, Aberrations):
                if lens.mask is not None:
                    return cls(number + 1, 0, _stop_radius(lens))
                assert lens.stop_number is not None
                return cls(number, lens.stop_number + 1, _stop_radius(lens))
        best, found = math.inf, cls(0, 0, math.inf)
        for number, stage in enumerate(train.stages):
            if stage.faces.bending is not None:
                break
            half, size = min(stage.opening) / 2, float(np.linalg.norm(stage.arriving.linear[:2, :2], 2))
            if math.isfinite(half) and size > 0 and half / size < best:
                best, found = half / size, cls(number, 0, half)
        return found

    def places(self, train: Train, rays: Array) -> Array:
        """Where rays (..., 4) of the entrance plane meet the stop, from its middle, (..., 2), without rims.

        Args:
            train: the camera.
            rays: metres and slopes.
        """
        for stage in train.stages[: self.stages]:
            rays, _ = _crossed(stage, stage.approach(rays), rims=False)
        if self.stages == len(train.stages):
            return np.asarray(rays[..., :2])
        stage = train.stages[self.stages]
        rays = stage.approach(rays) - [*stage.element.decentre, 0.0, 0.0]
        if not self.surfaces:
            return np.asarray(rays[..., :2])
        assert isinstance(stage.faces.bending, Aberrations)
        if isinstance(entry := stage.faces.bending.onward[0], RayMap):
            return entry.widest * entry.aside(*entry.variables(*np.moveaxis(rays, -1, 0)))
        *before, surface = stage.faces.bending.without_rims.onward[: self.surfaces]
        assert isinstance(surface, Refraction)
        found, share = traced(tuple(before), rays)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            met = surface.met(*np.moveaxis(found, -1, 0))
        return np.where(share[..., None] > 0, np.stack([met.x, met.y], axis=-1), np.nan)


def chief_rays(train: Train, distance: float, *, slopes: Any = None, places: Any = None) -> Array:
    """The rays (n, 4) at the entrance plane that pass the middle of the stop, by Newton's method from the axis on.

    Args:
        train: the camera.
        distance: of the points before the entrance plane, metres; may be infinite.
        slopes: (n, 2), directions (X/Z, Y/Z) of points; or
        places: (n, 2), where chief rays meet the sensor, metres.

    Returns:
        NaN for rays that no lens lets pass: beyond the edge of a surface, or totally reflected.
    """
    stop = Stop.of(train)
    wanted = np.asarray(places if slopes is None else slopes, dtype=np.float64)
    guess = np.zeros((len(wanted), 4))  # (u, v, X/Z, Y/Z)

    def missed(unknown: Array, target: Array) -> Array:
        rays = rays_from(distance, unknown[..., 2:], unknown[..., :2])
        reached = unknown[..., 2:] if slopes is not None else to_sensor(train, rays, rims=False)[0][..., :2]
        return np.concatenate([stop.places(train, rays), reached - target], axis=-1)

    steps = np.diag([1e-7, 1e-7, 1e-6, 1e-6])
    before = guess
    for step in range(STEPS + 1):
        guess, before = guess + (guess - before), guess
        target = wanted * step / STEPS
        for _ in range(ITERATIONS):
            tried = guess[:, None, :] + np.concatenate([np.zeros((1, 4)), steps, -steps])
            off = missed(tried, target[:, None, :])
            slope = (off[:, 1:5] - off[:, 5:]) / (2 * np.diag(steps)[:, None])
            known = np.isfinite(slope).all(axis=(1, 2)) & np.isfinite(off).all(axis=(1, 2))
            change = np.full_like(guess, np.nan)
            change[known] = np.linalg.solve(slope[known].swapaxes(1, 2), -off[known, 0, :, None])[..., 0]
            guess = guess + change
    left = np.abs(missed(guess, wanted))
    guess[~(left < 1e-9).all(axis=1)] = np.nan
    return rays_from(distance, guess[:, 2:], guess[:, :2])


# --- where a point's light enters


def entrance_box(train: Train, distance: float, field: Any) -> Box:
    """The part of the entrance plane through which the light of a point enters, a rectangle of (low, high).

    Openings before the first element that is not affine bound it exactly. Where a real lens follows, it is found
    by tracing rays; masks count with their sizes. Where a lens has surfaces without clear diameters, rays
    far off the axis may reach its stop too: only the region around the entrance pupil counts.

    Args:
        train: the camera.
        distance: of the point, metres.
        field: its direction, (X/Z, Y/Z).

    Raises:
        InputError: nothing bounds the rays, or none passes.
    """
    low, high = np.full(2, -np.inf), np.full(2, np.inf)
    lens: Stage | None = None
    disturbed = False
    for stage in train.stages:
        if disturbed and np.abs(stage.approach.linear[:2, 2:]).max() > 0:
            break
        corners = seen_from_entrance(stage, distance, field)
        if corners is not None:
            low, high = np.maximum(low, corners.min(axis=0)), np.minimum(high, corners.max(axis=0))
        if isinstance(stage.faces.bending, Aberrations):
            lens = stage
            break
        disturbed = disturbed or stage.faces.bending is not None or stage.faces.spread is not None
    if (high <= low).any():
        raise InputError("no light of this point passes the camera's stops: it lies outside the field of view")
    if lens is not None:
        bending = lens.faces.bending
        assert isinstance(bending, Aberrations)
        box = searched(
            lambda places: _passes(train, rays_from(distance, field, places)),
            _into_lens(lens, distance, field, (low, high)),
            bounded=math.isfinite(bending.onward[0].radius),
            connected=_lacks_rims(bending),
        )
        if box is None:
            raise InputError(
                f"no light of this point passes {lens.element.label} and the camera's stops: it lies outside the "
                "field of view"
            )
        return box
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise InputError(
            "nothing bounds the light that this camera takes in (no stop of known size stands before the "
            "first plate, array or diffuser): give the lens a diameter, or pass aperture=(width, height) in "
            "metres"
        )
    return low, high


def seen_from_entrance(stage: Stage, distance: float, field: Any) -> Array | None:
    """The corners of a stage's opening, (4, 2), projected to the entrance plane along a point's first-order rays.

    Args:
        stage: with an opening, else None is returned.
        distance: of the point, metres.
        field: its direction.
    """
    size = (math.inf, math.inf) if stage.faces.pattern is None else stage.faces.pattern.size
    back = _entrance_from(stage.arriving, distance, field)
    if back is None or not all(map(math.isfinite, size)):
        return None
    corners = np.array([[x, y] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * size
    return np.asarray(back(corners + stage.element.decentre))


def _entrance_from(arriving: Affine, distance: float, field: Any) -> Affine | None:
    """From places on a plane to those on the entrance plane, along a point's rays; None if all meet in a point."""
    at = arriving(rays_from(distance, field, np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])))[:, :2]
    there = Affine.from_parts(np.stack([at[1] - at[0], at[2] - at[0]], axis=1), at[0])
    return there.inverse() if there.is_invertible() else None


def _stop_radius(lens: RealLens) -> float:
    """Half the size of a real lens's stop, metres."""
    assert lens.stop_number is not None
    return max(lens.mask.size) / 2 if lens.mask is not None else lens.onward[lens.stop_number].radius


def _into_lens(stage: Stage, distance: float, field: Any, box: Box) -> Box:
    """Where to search for light through a real lens: its first rim, else four times its entrance pupil."""
    low, high = box
    lens, bending = stage.element, stage.faces.bending
    assert isinstance(bending, Aberrations)
    first = bending.onward[0]
    vertex = Affine.propagation(first.distance) @ stage.arriving
    if math.isfinite(first.radius):
        chief = vertex(rays_from(distance, field, np.zeros(2)))
        sag = float(first.sag(np.array(first.radius**2))[0])
        aside = abs(sag if math.isfinite(sag) else first.radius) * np.abs(chief[2:])
        back, reach = _entrance_from(vertex, distance, field), first.radius + aside
    else:
        assert isinstance(lens, RealLens)
        matrix = lens.prescription.stop_from_entrance
        pupil = (
            lens.prescription.opened(lens.stop_diameter).first_order().entrance_pupil
            if matrix is not None
            else None
        )
        if pupil is None or math.isinf(pupil.distance):
            back, reach = _entrance_from(vertex, distance, field), np.full(2, 4 * _stop_radius(lens))
        else:
            back = _entrance_from(Affine.propagation(pupil.distance) @ vertex, distance, field)
            reach = np.full(2, 2 * pupil.diameter)
    if back is None:
        raise InputError(f"the point stands in the plane of {lens.label}: move it away from the lens")
    corners = back(np.array([[x, y] for x in (-1, 1) for y in (-1, 1)]) * reach + lens.decentre)
    return np.maximum(low, corners.min(axis=0)), np.minimum(high, corners.max(axis=0))


def _lacks_rims(lens: Aberrations) -> bool:
    """Whether a surface of glass has no clear diameter."""
    return any(each.radius == math.inf and each.ratio != 1 for each in lens.onward)


def searched(passes: Any, box: Box, bounded: bool = False, connected: bool = False) -> Box | None:
    """The box of points of a plane that pass, plus a cell of the last search on each side; None if none does.

    Args:
        passes: of points (n, 2): a mask (n,).
        box: in which to begin.
        bounded: whether nothing outside this box can pass.
        connected: whether only the region counts that is nearest to the middle of the box.
    """
    low, high = box
    found = False
    for _ in range(ROUNDS):
        if (high <= low).any():
            break
        size = high - low
        cell = size / SEARCHED
        lit = passes(midpoints(low, high, (SEARCHED, SEARCHED))).reshape(SEARCHED, SEARCHED)
        if not lit.any():
            if found:
                break
            low, high = low + size / 4, high - size / 4  # an opening smaller than a cell is in the middle
            continue
        found = True
        lit = _nearest_region(lit) if connected else lit
        inside = [np.flatnonzero(lit.any(axis=axis)) for axis in (0, 1)]
        first, last = (np.array([float(each[end]) for each in inside]) for end in (0, -1))
        low, high = (
            np.where(first == 0, low - 0.25 * size, low + (first - 1) * cell),
            np.where(last == SEARCHED - 1, high + 0.25 * size, low + (last + 2) * cell),
        )
        if bounded:
            low, high = np.maximum(low, box[0]), np.minimum(high, box[1])
        if (high - low <= size).all() and (high - low > 0.8 * size).all():
            break
    return (low, high) if found else None


def _nearest_region(lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The connected region of a mask that is nearest to its middle."""
    from scipy.ndimage import label

    regions, _ = label(lit, structure=np.ones((3, 3)))
    rows, columns = np.nonzero(lit)
    middle = (np.array(lit.shape) - 1) / 2
    nearest = int(np.argmin((rows - middle[0]) ** 2 + (columns - middle[1]) ** 2))
    return np.asarray(regions == regions[rows[nearest], columns[nearest]])


def midpoints(low: Array, high: Array, counts: tuple[int, int]) -> Array:
    """Midpoints (n, 2) of the cells of a rectangle, rows of x."""
    x, y = (a + (np.arange(n) + 0.5) / n * (b - a) for a, b, n in zip(low, high, counts, strict=True))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def _passes(train: Train, rays: Array) -> NDArray[np.bool_]:
    """Whether rays pass the rims of real lenses, and the outlines of openings up to what scatters or bends."""
    kept = np.ones(len(rays), dtype=bool)
    for stage in light_stages(train):
        rays = stage.approach(rays)
        half = np.array(stage.opening) / 2 * (1 + 1e-12)
        kept &= (np.abs(rays[:, :2] - stage.element.decentre) <= half).all(axis=1)
        bending = stage.faces.bending
        if stage.faces.spread is not None or not isinstance(bending, Aberrations | None):
            break
        rays, light = stage.crossed(rays)
        kept &= light > 0
    return kept


def bundle(train: Train, distance: float, field: Any, side: int = SIDE) -> Bundle:
    """The light of a point at the sensor, by rays on a regular grid over the light that enters.

    Args:
        train: the camera at one wavelength, without diffusers.
        distance: of the point before the entrance plane, metres; may be infinite.
        field: its direction, (X/Z, Y/Z).
        side: rays along each side of the box around the light.

    Raises:
        InputError: a camera with a diffuser, no bound for the light, or no light.
    """
    for stage in train.stages:
        if stage.faces.spread is not None:
            raise InputError(
                f"{stage.element.label} scatters light, so that a point has no rays of its own: "
                "vcc.analysis.psf and mtf include diffusers"
            )
    low, high = entrance_box(train, distance, field)
    rays = rays_from(distance, field, midpoints(low, high, (side, side)))
    at_sensor, light = to_sensor(train, rays)
    lit = light > 0
    if not lit.any():
        raise InputError(
            f"no light of the point at ({', '.join(f'{each:.4g}' for each in field)}) reaches the sensor"
        )
    stop = Stop.of(train)
    places = stop.places(train, rays[lit])
    radius = stop.radius if math.isfinite(stop.radius) else float(np.abs(places).max()) or 1.0
    area = float(np.prod(high - low)) / side**2
    return Bundle(at_sensor[lit, :2], at_sensor[lit, 2:], light[lit] * area, places / radius)


# --- fields


@dataclass(frozen=True, eq=False, repr=False)
class Fields(Brief):
    """Points of the scene, along a line from the axis.

    Args:
        slopes: (n, 2): directions (X/Z, Y/Z).
        heights: (n,): how far from the sensor's middle their chief rays meet it, metres.
        shares: (n,): these as fractions of the sensor's half diagonal.
        angles: (n,): from the axis, radians.
        chiefs: (n, 4): their chief rays at the entrance plane.
    """

    slopes: Array
    heights: Array
    shares: Array
    angles: Array
    chiefs: Array


def fields_of(
    train: Train, distance: float, shares: Sequence[float] | None, angles: Sequence[float] | None, axis: int = 0
) -> Fields:
    """Points by their image's place, or by their direction. Images lie on the positive side of the axis.

    Args:
        train: the camera, at the reference wavelength.
        distance: of the points before the entrance plane, metres; may be infinite.
        shares: fractions of the sensor's half diagonal at which chief rays meet it; or
        angles: of the points from the axis, seen from the middle of the entrance plane, radians.
        axis: 0: along x; 1: along y.

    Raises:
        InputError: values that are no fields, or points whose chief ray does not reach the sensor.
    """
    given = shares if angles is None else angles
    if given is None or (shares is not None and angles is not None):
        raise InputError("fields are fractions of the sensor's half diagonal, or angles: give one of them")
    numbers = np.atleast_1d(np.asarray(given, dtype=np.float64))
    if numbers.ndim != 1 or not len(numbers) or not np.isfinite(numbers).all():
        raise InputError(f"fields and angles are lists of finite numbers, not {given!r}")
    if angles is not None and (np.abs(numbers) >= math.pi / 2).any():
        raise InputError("angles lie between −90° and 90° from the axis, in radians: write 20 * deg")
    half = half_diagonal(train)
    middle = np.array(train.sensor.decentre)
    along = np.eye(2)[axis]
    if angles is None:
        wanted = middle + half * numbers[:, None] * along
        chiefs = chief_rays(train, distance, places=wanted)
    else:
        chiefs = chief_rays(train, distance, slopes=-np.tan(numbers)[:, None] * along)
    lost = ~np.isfinite(chiefs).all(axis=1)
    if lost.any():
        first = float(numbers[lost][0])
        where = f"{first:.3g} of the half diagonal" if angles is None else f"{math.degrees(first):.3g}°"
        raise InputError(
            f"no chief ray reaches the sensor for the field at {where}: a lens's surfaces end there, or reflect "
            "all light. Give smaller fields"
        )
    slopes = chiefs[:, :2] / distance - chiefs[:, 2:]
    ends = to_sensor(train, chiefs, rims=False)[0][:, :2] - middle
    heights = ends @ along
    seen = np.arctan(slopes @ -along)
    return Fields(slopes, heights, heights / half, seen, chiefs)


def image_scale(train: Train, distance: float, along: Array) -> tuple[float, float]:
    """Heights of chief rays near the axis on the sensor, metres: per slope of the field, and of the axis.

    Args:
        train: the camera at one wavelength.
        distance: of the points, metres.
        along: direction of fields and heights, a unit vector.
    """
    chiefs = chief_rays(train, distance, slopes=np.outer([-NEAR_AXIS, NEAR_AXIS], along))
    ends = (to_sensor(train, chiefs, rims=False)[0][:, :2] - train.sensor.decentre) @ along
    return float(ends[1] - ends[0]) / (2 * NEAR_AXIS), float(ends.mean())


def half_diagonal(train: Train) -> float:
    """Of the sensor, metres."""
    return math.hypot(*train.sensor.size) / 2


# --- illumination


def irradiance(train: Train, place: Any, side: int = 129) -> tuple[float, float]:
    """The irradiance at a place of the sensor under uniform light of radiance 1, by the camera's radiometry.

    Behind a real lens ∫ cosθ dω over the rays that pass; behind thin lenses, and with ``radiometry="paraxial"``,
    ∫ ds dt.

    Args:
        train: the camera at one wavelength; scattering is ignored.
        place: (x, y), metres.
        side: rays along each side of the box of slopes around the light.

    Returns:
        The irradiance, and the area of the stop through which light arrives, m²; both 0 where none does.

    Raises:
        InputError: nothing bounds the slopes of light.
    """
    place = np.asarray(place, dtype=np.float64)

    def rays(slopes: Array) -> Array:
        return np.concatenate([np.broadcast_to(place, slopes.shape), slopes], axis=-1)

    low, high = np.full(2, -np.inf), np.full(2, np.inf)
    onward = train.approach_to_sensor
    for stage in reversed(train.stages):
        by_slope = onward.inverse().linear[:2, 2:]
        if all(map(math.isfinite, stage.opening)) and abs(np.linalg.det(by_slope)) > 0:
            middle = onward.inverse()(rays(np.zeros(2)))[:2]
            corners = np.array([[x, y] for x in (-0.5, 0.5) for y in (-0.5, 0.5)]) * stage.opening
            slopes = (corners + stage.element.decentre - middle) @ np.linalg.inv(by_slope).T
            low, high = np.maximum(low, slopes.min(axis=0)), np.minimum(high, slopes.max(axis=0))
        if stage.faces.bending is not None:
            break
        onward = onward @ (stage.approach if stage.centred is None else stage.centred @ stage.approach)
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        raise InputError("nothing bounds the light that reaches the sensor: give the lens a diameter")
    # A window bounds the light for places on the sensor; others are analysed as well.
    rimless = any(
        isinstance(stage.faces.bending, Aberrations) and _lacks_rims(stage.faces.bending) for stage in train.stages
    )
    box = searched(lambda slopes: from_sensor(train, rays(slopes))[1] > 0, (low, high), connected=rimless)
    if box is None:
        return 0.0, 0.0
    slopes = midpoints(*box, (side, side))
    _, share = from_sensor(train, rays(slopes))
    stop = Stop.of(train).places(train, from_sensor(train, rays(slopes), rims=False)[0]).reshape(side, side, 2)
    by_t, by_s = (np.asarray(np.gradient(stop, axis=axis)) for axis in (0, 1))
    covered = np.abs(by_s[..., 0] * by_t[..., 1] - by_s[..., 1] * by_t[..., 0]).ravel()
    area = float(np.nansum(np.where(share > 0, covered, 0.0)))
    return float(share.sum() * np.prod(box[1] - box[0])) / side**2, area


# --- focus


def sharpest_shift(bundles: Sequence[Bundle], by: str, frequency: float | None = None) -> float:
    """How far behind the sensor the images of points are sharpest together, metres.

    Args:
        bundles: of the points.
        by: ``"spot"``: the smallest mean square radius, each bundle counted alike; ``"mtf"``: the largest mean
            contrast at a frequency, along x and y.
        frequency: cycles per metre.
    """
    spread = turned = 0.0
    for one in bundles:
        share = one.light / one.light.sum()
        slopes = one.slopes - share @ one.slopes
        spread += float(share @ (slopes**2).sum(axis=1))
        turned += float(share @ (slopes * (one.places - share @ one.places)).sum(axis=1))
    shift = -turned / spread
    if by == "spot":
        return shift
    assert frequency is not None
    from scipy.optimize import minimize_scalar

    def loss(at: float) -> float:
        return -float(np.mean([one.contrast(frequency, at) for one in bundles]))

    # The first zero of a disc's contrast is at a defocus of 0.61/(frequency · slope).
    steepest = max(math.sqrt(float((one.slopes**2).sum(axis=1).max())) for one in bundles)
    places = shift + np.linspace(-1.5, 1.5, 61) / (frequency * steepest)
    best = int(np.argmin([loss(float(at)) for at in places]))
    step = float(places[1] - places[0])
    found = minimize_scalar(loss, bounds=(places[best] - step, places[best] + step), method="bounded")
    return float(found.x)
