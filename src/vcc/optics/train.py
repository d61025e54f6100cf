"""The optical train: elements along an axis and a sensor, validated once, and the stages that light meets."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cmp_to_key
from os import PathLike
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.affine import Affine
from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.base.units import short
from vcc.base.values import Value
from vcc.optics.aberrations import Aberrations
from vcc.optics.deflections import Deflection
from vcc.optics.faces import Element, Faces, Part
from vcc.optics.pixels import Microlens, PixelTransmission, SlopesOfChief, photodiode_term
from vcc.optics.real_lens import Seen, TracedLens
from vcc.optics.sensor import Sensor
from vcc.optics.terms import Term
from vcc.shapes.patterns import owned

RESPONSE = "response of the pixels"
"""Name of the sensor's angular response among the stages of a train."""


@dataclass(frozen=True, eq=False, repr=False)
class Stage(Brief):
    """One stage that light meets on its way through a camera.

    Args:
        element: the element, or the thick element of which this is a part.
        z: place, metres (for an inner part of a thick element, the place where that element begins).
        approach: rays from just behind the stage before (at first: from the entrance plane) to just before
            this one, including elements' own affine steps, but not lenses and prisms, which are faces.
        faces: effect of the stage, in coordinates centred on the element.
        arriving: rays from the entrance plane to just before this stage, with all affine optics on the way folded;
            other bending (lens arrays, phase plates) and scattering are ignored.
        term: for a factor of the transmission that depends on direction: the stage is in the term's own plane
            (`Term.to_plane`), ``approach`` leads there, and the next stage's leads back.
    """

    element: Element
    z: float
    approach: Affine
    faces: Faces
    arriving: Affine = field(default_factory=Affine.identity)
    term: Term | None = None

    def __post_init__(self) -> None:
        if self.faces.pattern is not None:
            named = owned(self.faces.pattern, self.element.label)
            object.__setattr__(self, "faces", replace(self.faces, transmission=named))
        if self.faces.by_ray is not None:
            by_ray = replace(self.faces.by_ray, owner=self.element.label)
            object.__setattr__(self, "faces", replace(self.faces, by_ray=by_ray))

    @property
    @cached
    def centred(self) -> Affine | None:
        """The affine deflection about the element's own middle, on rays in the camera's coordinates."""
        return None if self.faces.affine is None else about(self.element.decentre, self.faces.affine)

    @property
    @cached
    def leaving(self) -> Affine:
        """Rays from the entrance plane to just behind this stage, folded as in ``arriving``."""
        return self.arriving if self.centred is None else self.centred @ self.arriving

    @property
    def opening(self) -> tuple[float, float]:
        """(width, height) in metres outside which nothing passes at z; infinite if unbounded, and for terms."""
        pattern = self.faces.pattern
        return (math.inf, math.inf) if pattern is None or self.term is not None else pattern.size

    def bent(self, x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[Any, Any]:
        """(Δs, Δt) of the deflection that is not affine, at camera places x, y; errors name the element."""
        bending = self.faces.bending
        assert isinstance(bending, Deflection)
        with self.named():
            return bending(x - self.element.decentre[0], y - self.element.decentre[1])

    def deflected(self, rays: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rays (..., 4) of the camera just behind the deflection, affine or not; errors name the element.

        Rays that the surfaces of a real lens stop become NaN.
        """
        if self.centred is not None:
            return np.asarray(self.centred(rays))
        if isinstance(self.faces.bending, Aberrations):
            middle = [*self.element.decentre, 0.0, 0.0]
            return self.faces.bending.deflected(rays - middle) + middle
        if self.faces.bending is None:
            return rays
        slopes = self.bent(rays[..., 0], rays[..., 1])
        still = np.zeros_like(slopes[0])
        return np.asarray(rays + np.stack([still, still, *slopes], axis=-1))

    def share(self, rays: NDArray[np.float64]) -> NDArray[np.float64]:
        """The share of light (...) that the transmission passes, of rays (..., 4) of the camera just before it."""
        rays = rays - [*self.element.decentre, 0.0, 0.0]
        share = np.ones(rays.shape[:-1])
        with self.named():
            if self.faces.pattern is not None:
                share = share * self.faces.pattern(rays[..., 0], rays[..., 1])
        for term in self.faces.terms:
            share = share * term.share(rays)
        return share if self.faces.by_ray is None else share * self.faces.by_ray.share(rays)

    def crossed(self, rays: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rays (..., 4) behind the deflection, and their light (...), as in `Aberrations.crossed`."""
        if not isinstance(self.faces.bending, Aberrations):
            return self.deflected(rays), np.ones(rays.shape[:-1])
        middle = [*self.element.decentre, 0.0, 0.0]
        found, light = self.faces.bending.crossed(rays - middle)
        return found + middle, light

    @contextmanager
    def named(self) -> Iterator[None]:
        """Add the element's name to errors raised within."""
        try:
            yield
        except InputError as error:
            raise InputError(f"{self.element.label}: {error}") from None


def touch(one: float, other: float) -> bool:
    """Whether two places on the axis, metres, are equal except for rounding: to a billionth, or a picometre."""
    return math.isclose(one, other, rel_tol=1e-9, abs_tol=1e-12)


def _place(z: float) -> str:
    """The beginning of an element's line."""
    return f"  z = {z * 1e3:9.6g} mm  "


def _order(one: Element, other: Element) -> int:
    """−1 if light meets ``one`` first, 1 if ``other``: by z; in one plane thin elements first, pixels last."""
    if not touch(one.z, other.z):
        return int(np.sign(one.z - other.z))
    pixels = isinstance(one, PixelTransmission) - isinstance(other, PixelTransmission)
    return pixels or int(np.sign(one.length - other.length))


NOTHING = Faces()
"""Of an element without an effect."""


def met_in_order(elements: Sequence[Element]) -> Iterator[tuple[Element, tuple[Part, ...]]]:
    """Elements with the parts that light meets in turn; in each plane, terms first.

    Terms depend on the direction of light, so they do not commute with what bends it in their plane. They act on
    the light that arrives at the plane, in whichever order elements are listed. Pixels come last in theirs.
    """
    listed = [(element, element.parts()) for element in elements]
    first = 0
    while first < len(listed):
        last = first + 1
        while last < len(listed) and _in_one_plane(listed[last - 1], listed[last]):
            last += 1
        plane, first = listed[first:last], last
        if len(plane) == 1:
            yield plane[0]
            continue
        directed = [(element, part.directed) for element, (part,) in plane if isinstance(part, Faces)]
        yield from ((element, (faces,)) for element, faces in directed if faces != NOTHING)
        for element, (part,) in plane:
            rest = _undirected(part) if isinstance(part, Faces) else part
            if rest is part or rest != NOTHING:
                yield element, (rest,)


def _undirected(faces: Faces) -> Faces:
    """The faces without those that act on the arriving ray; the same object if there are none."""
    return faces if faces.directed == NOTHING else replace(faces, terms=(), by_ray=None)


def _in_one_plane(one: tuple[Element, tuple[Part, ...]], other: tuple[Element, tuple[Part, ...]]) -> bool:
    thin = all(element.length == 0 and len(parts) == 1 for element, parts in (one, other))
    return thin and touch(one[0].z, other[0].z) and not isinstance(other[0], PixelTransmission)


def _check_sensor(sensor: object, elements: Any) -> None:
    """Raise an error if the sensor is not one; the message corrects common mistakes."""
    if isinstance(elements, str | PathLike):
        raise InputError(f"a camera in a file is opened with vcc.load_camera({str(elements)!r})")
    inside = [each for each in elements if isinstance(each, Sensor)] if isinstance(elements, tuple | list) else []
    if sensor is None and inside:
        raise InputError(
            "the sensor stands in the list of elements: it comes behind the list, vcc.Camera([lens, …], sensor)"
        )
    if isinstance(elements, Sensor) and isinstance(sensor, Element | tuple | list):
        raise InputError("elements and sensor are exchanged: write vcc.Camera([lens, …], sensor)")
    if not isinstance(sensor, Sensor):
        given = "nothing" if sensor is None else _called(sensor)
        raise InputError(
            f"a camera needs a vcc.Sensor, and {given} is given: vcc.Camera([lens, …], vcc.Sensor(z=52 * mm, "
            "shape=(rows, columns), pitch=5 * um))"
        )


def _listed(elements: Any) -> tuple[Element, ...]:
    """The elements as a tuple, with their types checked."""
    if isinstance(elements, Element):
        raise InputError(f"elements are a list, for one too: write vcc.Camera([{_name(elements)}], sensor)")
    try:
        listed = tuple(elements)
    except TypeError:
        raise InputError(f"elements are a list of vcc.Element objects, not {_called(elements)}") from None
    for element in listed:
        if not isinstance(element, Element):
            raise InputError(f"a camera's elements are vcc.Element objects, not {_called(element)}")
    return listed


def _name(element: Element) -> str:
    return element.kind.replace(" ", "_")


def _called(thing: object) -> str:
    """Name an object in an error: an instance by its class, a class by its name."""
    return f"the class {thing.__name__} itself" if isinstance(thing, type) else f"a {type(thing).__name__}"


def _distance(start: float, end: float) -> float:
    """Distance along the axis, metres; 0 if it is only rounding."""
    return 0.0 if touch(start, end) else end - start


def about(middle: tuple[float, float], ray_map: Affine) -> Affine:
    """A map of rays in coordinates centred on ``middle``, converted to the camera's coordinates."""
    x, y = middle
    if x == 0 == y:
        return ray_map
    return Affine.translation(x, y, 0, 0) @ ray_map @ Affine.translation(-x, -y, 0, 0)


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Train(Value, Shown):
    """Elements along an axis and a sensor behind them: a camera without the methods that compute images.

    A light field is given at the entrance plane, z = 0. Trains of equal elements and sensors
    are equal, and can be keys of a cache.

    Args:
        elements: in any order; kept sorted by z. Elements at the same z commute.
        sensor: records the image; required.
        name: recorded in images as their source, the name of the camera's file if there is one; not compared.

    Raises:
        InputError: no sensor, or an object that is not an element; an element before the entrance plane or behind
            the sensor; two elements with the same name.
    """

    elements: tuple[Element, ...]
    sensor: Sensor
    name: str = field(default="", compare=False)

    def __init__(self, elements: Iterable[Element], sensor: Sensor | None = None, *, name: str = "") -> None:
        _check_sensor(sensor, elements)
        assert sensor is not None
        listed = _listed(elements)
        object.__setattr__(self, "name", name)
        for element in listed:
            if element.z < 0:
                raise InputError(
                    f"{element.label} stands before the entrance plane z = 0, where the light field is given: "
                    "move the whole camera towards +z"
                )
            if element.z > sensor.z and not touch(element.z, sensor.z):
                raise InputError(
                    f"{element.label} (z = {element.z * 1e3:g} mm) stands behind the sensor "
                    f"(z = {sensor.z * 1e3:g} mm): light never reaches it"
                )
            end = element.z + element.occupied_length
            if end > sensor.z and not touch(end, sensor.z):
                raise InputError(
                    f"{element.label} ends at z = {end * 1e3:g} mm, behind the sensor at z = {sensor.z * 1e3:g} mm"
                )
        if sensor.z < 0:
            raise InputError(f"the sensor stands before the entrance plane: z = {sensor.z * 1e3:g} mm")
        names = [element.name for element in listed if element.name]
        for name in names:
            if names.count(name) > 1:
                raise InputError(f'{names.count(name)} elements are named "{name}": names must differ')
        ordered = tuple(sorted(listed, key=cmp_to_key(_order)))
        for before, after in itertools.pairwise(ordered):
            if after.z < before.z + before.length and not touch(after.z, before.z + before.length):
                raise InputError(
                    f"{after.label} stands inside {before.label}, which reaches from z = {before.z * 1e3:g} mm to "
                    f"{(before.z + before.length) * 1e3:g} mm"
                )
        object.__setattr__(self, "elements", ordered)
        object.__setattr__(self, "sensor", sensor)

    @property
    @cached
    def met(self) -> tuple[tuple[Element, tuple[Part, ...]], ...]:
        """Elements with the parts that light meets in turn; see `met_in_order`."""
        return tuple(met_in_order(self.elements))

    @property
    @cached
    def _path(self) -> tuple[tuple[Stage, ...], Affine]:
        stages: list[Stage] = []
        approach, here, leaving = Affine.identity(), 0.0, Affine.identity()
        for element, parts in (*self.met, *met_in_order(self._pixels)):
            if isinstance(element, TracedLens):
                behind = self._behind(element)
                if any(isinstance(later, TracedLens) for later in behind):
                    # the last lens weighs light by angle
                    parts = replace(element, radiometry="paraxial").parts()  # type: ignore[call-arg]
                parts = (*parts, *element.window(self.seen_from_sensor(element)))
            approach = Affine.propagation(_distance(here, element.z)) @ approach
            here = element.z
            for part in parts:
                if isinstance(part, Affine):
                    approach = about(element.decentre, part) @ approach
                    continue
                for term in part.terms:
                    to_plane = about(element.decentre, term.to_plane)
                    approach = to_plane @ approach
                    faces = Faces(transmission=term.pattern)
                    stages.append(Stage(element, here, approach, faces, approach @ leaving, term))
                    approach, leaving = to_plane.inverse(), stages[-1].leaving
                if part.by_ray is not None:
                    faces = Faces(by_ray=part.by_ray)
                    stages.append(Stage(element, here, approach, faces, approach @ leaving))
                    approach, leaving = Affine.identity(), stages[-1].leaving
                rest = _undirected(part)
                if rest is not part and rest == NOTHING:
                    continue
                part = rest
                stages.append(Stage(element, here, approach, part, approach @ leaving))
                approach, leaving = Affine.identity(), stages[-1].leaving
            here += element.length
        return tuple(stages), Affine.propagation(_distance(here, self.sensor.z)) @ approach

    def _behind(self, element: Element) -> tuple[Element, ...]:
        """The elements that light meets behind one of them."""
        number = next(n for n, each in enumerate(self.elements) if each is element)
        return self.elements[number + 1 :]

    def seen_from_sensor(self, lens: TracedLens) -> Seen | None:
        """How the sensor sees the end of a real lens; None behind elements that are not affine or round."""
        behind = self._behind(lens)
        faces = [part for element in behind for part in element.parts() if isinstance(part, Faces)]
        if any(each.bending is not None or each.spread is not None for each in faces):
            return None
        to_end = Affine.propagation(lens.z + lens.length)
        ray = Train(behind, self.sensor).rays_at(self.sensor.z) @ to_end.inverse()
        from_place, from_slope = ray.linear[:2, :2], ray.linear[:2, 2:]
        if not all(np.allclose(each, each[0, 0] * np.eye(2), atol=1e-12) for each in (from_place, from_slope)):
            return None
        axis = ray(np.array([*lens.decentre, 0.0, 0.0]))[:2]
        half = np.array(self.sensor.size[::-1]) / 2
        corner = np.abs(np.array(self.sensor.decentre) - axis) + half
        x, y = axis.tolist()
        return Seen(float(from_place[0, 0]), float(from_slope[0, 0]), (x, y), float(np.hypot(*corner)))

    @property
    def _pixels(self) -> tuple[Element, ...]:
        """The response of pixels to slopes, as an element at the sensor, where all pixels respond alike."""
        response = self.sensor.angular_response
        if response is None or isinstance(response, tuple):
            return ()
        return (PixelTransmission(z=self.sensor.z, name=RESPONSE, terms=(Term.of_slopes(response),)),)

    def photodiode(self, row: int, column: int) -> Self:
        """The same with one of the sensor's photodiodes in place of the whole pixels.

        Args:
            row: 0 for the top one (smaller y).
            column: 0 for the left one (smaller x), which records light from the right half of the exit pupil.

        Raises:
            InputError: no such photodiode, no stop whose exit pupil the microlenses are shifted for, or a
                microlens without the height that its photodiodes need.
        """
        sensor = self.sensor
        rows, columns = sensor.photodiodes
        if not (0 <= row < rows and 0 <= column < columns):
            raise InputError(
                f"there is no photodiode ({row}, {column}): the sensor has {rows}×{columns} (rows, columns) in a "
                "pixel"
            )
        microlens = sensor.microlens or Microlens()
        term = photodiode_term(sensor.photodiodes, (row, column), sensor.pitches, microlens, self.chief_rays())
        named = f"photodiode ({row}, {column})"
        pixels = PixelTransmission(z=sensor.z, name=named, terms=(term,))
        plain = replace(sensor, photodiodes=(1, 1), microlens=None)
        return type(self)((*self.elements, pixels), plain, name=self.name)

    def pixel_kind(self, row: int, column: int) -> Self:
        """The same with all pixels like one of the tile that `Sensor.angular_response` repeats over the sensor.

        Args:
            row: of the tile.
            column: likewise.

        Raises:
            InputError: no such pixel of the tile.
        """
        kinds = self.sensor.pixel_kinds
        if not (0 <= row < len(kinds) and 0 <= column < len(kinds[0])):
            raise InputError(
                f"there is no pixel ({row}, {column}) in a tile of {len(kinds)}×{len(kinds[0])} angular responses"
            )
        sensor = replace(self.sensor, angular_response=kinds[row][column])
        return type(self)(self.elements, sensor, name=self.name)

    def chief_rays(self) -> SlopesOfChief:
        """The rays from the middle of the exit pupil: that of the sensor's microlens, or of the camera's stop.

        The stop is the opening of known size that lets the smallest range of slopes through to a place on the
        sensor.

        Raises:
            InputError: neither is known.
        """
        given = None if self.sensor.microlens is None else self.sensor.microlens.pupil_distance
        if given is not None:
            return SlopesOfChief.from_distance(given)
        from_sensor = self.arriving_at_sensor.inverse()
        best: tuple[float, SlopesOfChief] | None = None
        for stage in reversed(self.stages):
            if stage.faces.bending is not None:
                break  # what lies before it is not imaged as a whole
            stop_from_sensor = stage.leaving @ from_sensor
            by_slope = stop_from_sensor.linear[:2, 2:]
            half = min(stage.opening) / 2
            if (
                math.isfinite(half)
                and abs(np.linalg.det(by_slope)) > 1e-12 * max(np.abs(by_slope).max(), 1e-12) ** 2
            ):
                bound = half / float(np.linalg.norm(by_slope, 2))
                if best is None or bound < best[0]:
                    middle = stage.element.decentre
                    best = bound, SlopesOfChief.from_stop(stop_from_sensor, middle, stage.element.label)
        if best is None:
            raise InputError(
                "photodiodes need an exit pupil, and no stop of known size lies before the sensor (behind plates "
                "and arrays): give the lens a diameter, or Sensor(microlens=vcc.Microlens(pupil_distance=…))"
            )
        return best[1]

    def listed(self) -> list[str]:
        """The elements in order and the sensor, a line each: place, kind, name and parameters."""
        lines = []
        for element in self.elements:
            called, parameters = element.label if element.name else element.kind, element.described()
            lines.append(f"{_place(element.z)}{called}" + (f", {parameters}" if parameters else ""))
        rows, columns = self.sensor.shape
        vertical, horizontal = self.sensor.pitches
        pitch = short(vertical) if vertical == horizontal else f"{short(vertical)} × {short(horizontal)}"
        within = "×".join(map(str, self.sensor.photodiodes))
        parts = "" if within == "1×1" else f", {within} photodiodes each"
        response = "" if self.sensor.angular_response is None else ", with an angular response"
        return [*lines, f"{_place(self.sensor.z)}sensor, {rows}×{columns} pixels of {pitch}{parts}{response}"]

    def __repr__(self) -> str:
        count = len(self.elements)
        head = f"{type(self).__name__} of {count} element{'s' if count != 1 else ''} and a sensor"
        return "\n".join([head, *self.listed()])

    @property
    @cached
    def depends_on_bands(self) -> bool:
        """Whether bands of light meet different elements, or the sensor mixes them: see `vcc.optics.bands`."""
        return self.sensor.response is not None or any(element.depends_on_band for element in self.elements)

    @property
    def stages(self) -> tuple[Stage, ...]:
        """All stages that light meets on its way to the sensor, in order."""
        return self._path[0]

    @property
    def approach_to_sensor(self) -> Affine:
        """Rays from just behind the last stage (or from the entrance plane) to the sensor."""
        return self._path[1]

    @property
    def arriving_at_sensor(self) -> Affine:
        """Rays from the entrance plane to the sensor, folded as in `Stage.arriving`."""
        behind = self.stages[-1].leaving if self.stages else Affine.identity()
        return self.approach_to_sensor @ behind

    def rays_at(self, z: float, *, before: bool = False) -> Affine:
        """The map of rays from the entrance plane to the plane at z, with all affine optics on the way folded.

        Other bending (lens arrays, phase plates) and scattering are ignored.

        Args:
            z: place on the axis, metres, 0 or more.
            before: whether to stop before the elements exactly at z, rather than behind them.

        Raises:
            InputError: z is before the entrance plane, or inside a thick element.
        """
        if checks.finite("z", z, "metres") < 0:
            raise InputError(f"z = {z * 1e3:g} mm lies before the entrance plane of the camera")
        ray, here = Affine.identity(), 0.0
        for element, parts in self.met:
            here_too = touch(element.z, z)
            if (here_too and before) or (element.z > z and not here_too):
                break
            if z < element.z + element.length and not touch(z, element.z + element.length):
                raise InputError(
                    f"z = {z * 1e3:g} mm lies inside {element.label}, which is known by its two ends only"
                )
            ray = Affine.propagation(_distance(here, element.z)) @ ray
            here = element.z + element.length
            for part in parts:
                step = part if isinstance(part, Affine) else part.affine
                if step is not None:
                    ray = about(element.decentre, step) @ ray
        return Affine.propagation(_distance(here, z)) @ ray
