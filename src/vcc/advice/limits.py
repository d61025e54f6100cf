"""How well a light field's samples, a camera's pixels and light's wavelength carry what a camera asks of them.

All of it is first-order geometry of the frame and of the camera's matrices: numbers in closed form, no rays and
no samples. Where light is bent otherwise than by lenses, prisms and plane facets, matrices end; what would need
them is left out there, and `SamplingLimits.notes` says so."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError
from vcc.base.units import short
from vcc.optics.deflections import CellDeflection, FacetDeflection
from vcc.optics.train import Train
from vcc.plan.parallax_rule import index_motions
from vcc.plan.view_gaps import ROUNDING, ViewGaps
from vcc.shapes.lattice import CellApertures
from vcc.shapes.patterns import Bounded, Cells, CosineSum, FunctionPattern, Pattern

if TYPE_CHECKING:
    from vcc.optics.train import Stage

Array = NDArray[np.float64]

GREEN_LIGHT = 550e-9
"""The wavelength taken where none is given, metres: where eyes and sensors see best."""
LARGEST_SLOPE = 0.3
"""Beyond this slope (17°) tangent and sine, which paraxial optics takes as one, differ by more than 4.4 %."""
AIRY = 0.61
"""First zero of the Airy pattern: radius = 0.61 λ·distance / half the opening (Born and Wolf, section 8.5.2)."""


@dataclass(frozen=True)
class SamplingItem:
    """One thing that sampling, paraxial optics or diffraction limits.

    Args:
        name: what it is, in words.
        value: in SI units, or in ``unit``.
        unit: ``"m"`` (metres), ``"pixels"``, ``"views"`` or ``"slope"``.
        limit: what the value may be at most, or must be at least; in the same unit.
        advice: what to do, or why nothing is to be done, one sentence.
        at_least: whether the limit is the least value rather than the most.
    """

    name: str
    value: float
    unit: str
    limit: float
    advice: str
    at_least: bool = False

    @property
    def fine(self) -> bool:
        """Whether the value keeps to the limit."""
        if self.at_least:
            return self.value >= self.limit * (1 - ROUNDING)
        return self.value <= self.limit * (1 + ROUNDING)

    @property
    def verdict(self) -> str:
        """``"fine"`` or ``"watch out"``."""
        return "fine" if self.fine else "watch out"

    @property
    def stated(self) -> str:
        """Name, value and limit in words."""
        bound = "at least" if self.at_least else "at most"
        return f"{self.name}: {_quantity(self.value, self.unit)} ({bound} {_quantity(self.limit, self.unit)})"

    def __str__(self) -> str:
        return f"{self.stated}: {self.verdict}. {self.advice}"


@dataclass(frozen=True, eq=False)
class SamplingLimits:
    """What a camera asks of a light field, what it gets, and where paraxial ray optics ends.

    Args:
        items: by key: ``"disparity near"``, ``"disparity focus"``, ``"disparity far"`` (pixels per view on the
            sensor), ``"views across"``, ``"views down"`` (had, within the stop; the limit is what is needed),
            ``"samples"`` (footprint of a light field's sample), ``"slope"``, ``"airy"``, for a lens array
            ``"view behind lenslet"`` and ``"lenslet airy"``, and for each mask with detail ``"LABEL views"``,
            ``"LABEL samples"``, ``"LABEL shadow"`` and ``"LABEL diffraction"``, where LABEL is how messages call
            the element, such as ``mask "code"``. What is not given is not there.
        wavelength: metres.
        focus_distance: of what is in focus before the entrance plane, metres: infinite or above 0; None where
            nothing before the camera is.
        depths: (near, far) of the scene, metres; None where unknown. A negative one is light that converges so far
            behind the entrance plane, as behind a lens.
        free_of_ghosts: (near, far) between which no ghost copies are seen, metres; None where there is no such
            depth, or it is not given.
        notes: what is not given and why, and what diffusers hide.
        gaps: between views, as a function of distance; None where they are not given.
    """

    items: dict[str, SamplingItem]
    wavelength: float = field(metadata={"unit": "length"})
    focus_distance: float | None = field(metadata={"unit": "length"})
    depths: tuple[float, float] | None = field(metadata={"unit": "length"})
    free_of_ghosts: tuple[float, float] | None = field(metadata={"unit": "length"})
    notes: tuple[str, ...]
    gaps: ViewGaps | None

    def __getitem__(self, key: str) -> SamplingItem:
        """An item by its key.

        Raises:
            InputError: there is none; the message lists those that there are.
        """
        if key not in self.items:
            why = f" Notes: {'; '.join(self.notes)}." if self.notes else ""
            raise InputError(f"no sampling item is named {key!r}; there are {', '.join(self.items)}.{why}")
        return self.items[key]

    @property
    def to_watch(self) -> tuple[SamplingItem, ...]:
        """The items that do not keep to their limits."""
        return tuple(item for item in self.items.values() if not item.fine)

    def range_in_words(self) -> str:
        """Depths, focus and the range free of ghosts, one line."""
        parts = []
        if self.depths is not None:
            near, far = (distance_in_words(each) for each in self.depths)
            parts.append(f"scene at {near}" if near == far else f"scene from {near} to {far}")
        if self.gaps is None:
            return "; ".join(parts)
        if self.focus_distance is None:
            parts.append("nothing before the camera is in focus" if self.gaps.focus is not None else "")
        else:
            parts.append(f"in focus at {distance_in_words(self.focus_distance)}")
        if self.free_of_ghosts is not None:
            near, far = (distance_in_words(each) for each in self.free_of_ghosts)
            everywhere = self.free_of_ghosts == (0.0, math.inf)
            parts.append(
                "free of ghosts at all distances" if everywhere else f"free of ghosts from {near} to {far}"
            )
        else:
            parts.append("ghosts at all distances")
        return "; ".join(part for part in parts if part)


def distance_in_words(distance: float) -> str:
    """A distance with its unit, or infinity; a negative one is that of light that converges, as from no scene."""
    if distance < 0:
        return f"beyond infinity (light converging {short(-distance, digits=3)} behind z = 0)"
    return "infinity" if math.isinf(distance) else short(distance, digits=3)


def tangent_over_sine(slope: float) -> float:
    """By how much the tangent of a ray's angle, its slope, exceeds the sine, as a share: √(1 + slope²) − 1."""
    return math.hypot(1.0, slope) - 1


def finest_detail(pattern: Pattern) -> float | None:
    """The width of the finest bright or dark part of a pattern, metres.

    Of cells their smaller side, of cosines half the finest period, of openings in a lattice their size. None for
    stops and other plain openings, which have no detail.

    Raises:
        InputError: a function of position, of which this cannot be known.
    """
    if isinstance(pattern, Bounded):
        return finest_detail(pattern.pattern)
    if isinstance(pattern, Cells):
        if pattern.values.min() == pattern.values.max():
            return None
        rows, columns = pattern.values.shape
        assert pattern.height is not None
        return float(min(pattern.width / columns, pattern.height / rows))
    if isinstance(pattern, CosineSum):
        period = min(pattern.periods)
        return None if math.isinf(period) else float(period / pattern.harmonics / 2)
    if isinstance(pattern, CellApertures):
        return float(pattern.scale * pattern.lattice.pitch)
    if isinstance(pattern, FunctionPattern):
        raise InputError("how fine a function of position is cannot be known")
    return None


def sampling_limits(
    camera: Train,
    frame: Affine,
    shape: tuple[int, int, int, int],
    vergences: tuple[float, float] | None,
    wavelength: float = GREEN_LIGHT,
) -> SamplingLimits:
    """The limits for a light field of this frame and shape before a camera.

    Args:
        camera: any.
        frame: of the light field, at the entrance plane: 5×5.
        shape: (v, u, t, s) of the light field.
        vergences: 1/Z of the (farthest, nearest) part of the scene, 1/m, 0 for infinity; None where unknown.
        wavelength: metres.

    Raises:
        InputError: a wavelength of 0 or less.
    """
    if not (wavelength > 0 and math.isfinite(wavelength)):
        raise InputError(f"wavelength is a length above 0, such as 550 * nm, not {wavelength} m")
    return _Limits(camera, frame, shape, vergences, wavelength).found()


@dataclass(frozen=True, eq=False)
class _Met:
    """A stage, the map of rays from the entrance plane to just before it, and whether that is exact."""

    stage: Stage
    to: Affine
    exact: bool


@dataclass(frozen=True, eq=False)
class _Limits:
    """The arguments of `sampling_limits`, and each item worked out from them."""

    camera: Train
    frame: Affine
    shape: tuple[int, int, int, int]
    vergences: tuple[float, float] | None
    wavelength: float

    def found(self) -> SamplingLimits:
        met, notes = self._met(), self._notes()
        blocking = self._blocking()
        gaps = None
        items: dict[str, SamplingItem] = {}
        if blocking is None:
            gaps = ViewGaps(self.frame, self._per_pixel() @ self._to_sensor.linear[:2], self._views_let_in())
            items |= self._disparities(gaps) | self._views(gaps) | self._samples(gaps)
            items |= self._airy()
        elif isinstance(blocking.stage.faces.bending, CellDeflection):
            items |= self._behind_lenslets(blocking, blocking.stage.faces.bending)
        for each in met:
            items |= self._mask(each, notes)
        items |= self._slope(met)
        focus = None if gaps is None else gaps.focus
        free = None if gaps is None else gaps.free_of_ghosts()
        return SamplingLimits(
            items=items,
            wavelength=self.wavelength,
            focus_distance=None if focus is None or focus < -ROUNDING else _distance(focus),
            depths=None
            if self.vergences is None
            else (_distance(self.vergences[1]), _distance(self.vergences[0])),
            free_of_ghosts=None if free is None or free[1] <= 0 else _before_camera(free),
            notes=tuple(notes),
            gaps=gaps,
        )

    # -- the way through the camera

    @property
    def _to_sensor(self) -> Affine:
        return self.camera.rays_at(self.camera.sensor.z)

    def _met(self) -> list[_Met]:
        """All stages, in order."""
        found, ray, exact = [], Affine.identity(), True
        for stage in self.camera.stages:
            ray = stage.approach @ ray
            found.append(_Met(stage, ray, exact))
            if stage.centred is not None:
                ray = stage.centred @ ray
            exact = exact and not _ends_matrices(stage)
        return found

    def _blocking(self) -> _Met | None:
        """The first stage behind which matrices do not hold."""
        return next((met for met in self._met() if _ends_matrices(met.stage)), None)

    def _onwards(self, met: _Met) -> Affine | None:
        """Rays from just before a stage to the sensor, itself as if at its middle; None where not affine."""
        stages = self.camera.stages
        behind = stages[stages.index(met.stage) + 1 :]
        if not met.exact or any(_ends_matrices(stage) for stage in behind):
            return None
        return self._to_sensor @ met.to.inverse()

    def _per_pixel(self) -> Array:
        vertical, horizontal = self.camera.sensor.pitches
        return np.diag([1 / horizontal, 1 / vertical])

    @property
    def _pixel(self) -> float:
        return min(self.camera.sensor.pitches)

    @property
    def _looked_at(self) -> float:
        """1/Z of what is followed from view to view: what is in focus, or as near to that as the scene is."""
        by_place, by_slope = self._to_sensor.linear[:2, :2], self._to_sensor.linear[:2, 2:]
        square = float((by_slope**2).sum())
        focus = -float((by_place * by_slope).sum()) / square if square > 0 else 0.0
        low, high = (0.0, math.inf) if self.vergences is None else self.vergences
        return min(max(focus, low), high)

    def _notes(self) -> list[str]:
        notes = []
        blocking = self._blocking()
        if blocking is not None:
            label = blocking.stage.element.label
            notes.append(
                f"disparity, ghosts and footprints on the sensor are not given behind {label}, which bends rays "
                "otherwise than a lens or a prism"
            )
        for met in self._met():
            spread, onwards = met.stage.faces.spread, self._onwards(met)
            if spread is None:
                continue
            if onwards is None:
                notes.append(f"how far {met.stage.element.label} spreads light on the sensor is not given")
                continue
            reach = np.abs(onwards.linear[:2, 2:]) @ np.array(spread.reach)
            notes.append(
                f"{met.stage.element.label} spreads light by up to {short(float(reach.max()), digits=3)} on the "
                "sensor: what is finer, ghosts and detail, is blurred by it, and no item counts that"
            )
        notes += [
            f"{met.stage.element.label} bends by plane facets: items hold within each, not across their edges"
            for met in self._met()
            if isinstance(met.stage.faces.bending, FacetDeflection)
        ]
        return notes

    # -- light field and sensor

    def _disparities(self, gaps: ViewGaps) -> dict[str, SamplingItem]:
        if max(gaps.views) < 2:
            return {}
        places: dict[str, float] = {}
        if self.vergences is not None:
            places["near"], places["far"] = self.vergences[1], self.vergences[0]
        if gaps.focus is not None and gaps.focus > -ROUNDING:
            places["focus"] = max(gaps.focus, 0.0)
        found = {}
        for place in ("near", "focus", "far"):
            if place not in places:
                continue
            gap = float(gaps.at(np.array([places[place]]))[0])
            where = distance_in_words(_distance(places[place]))
            where = f"in focus, {where}" if place == "focus" else where
            if gap <= gaps.limit:
                advice = "Neighbouring views' pictures overlap: their sum is a smooth blur."
            else:
                advice = (
                    f"Out-of-focus points show as {max(gaps.views)} separate copies a side at most: take views "
                    f"{gap / gaps.limit:.2g} times as dense, or stay within {_free_in_words(gaps)}."
                )
            found[f"disparity {place}"] = SamplingItem(
                f"disparity per view on the sensor ({where})", gap, "pixels", gaps.limit, advice
            )
        return found

    def _views(self, gaps: ViewGaps) -> dict[str, SamplingItem]:
        if self.vergences is None:
            return {}
        largest = gaps.along_axes(np.array(self.vergences)).max(axis=0)
        found = {}
        for key, count, gap in (("across", gaps.views[1], largest[0]), ("down", gaps.views[0], largest[1])):
            if count < 2:
                continue
            needed = math.ceil(count * float(gap) / gaps.limit - ROUNDING) if gap > 0 else 1
            advice = (
                "As many as the scene's depths need, or more."
                if count >= needed
                else f"{needed} views over the same width leave no ghosts at any depth of the scene."
            )
            found[f"views {key}"] = SamplingItem(f"views {key}", count, "views", max(needed, 1), advice, True)
        return found

    def _samples(self, gaps: ViewGaps) -> dict[str, SamplingItem]:
        per_index = (gaps.on_sensor @ gaps.frame.linear)[:, 2:]
        pitches = 1 / np.diag(self._per_pixel())
        width = float(np.linalg.norm(per_index * pitches[:, None], axis=0).max())
        rows, columns = (math.ceil(count * gaps.footprint - ROUNDING) for count in self.shape[2:])
        if gaps.footprint > 1 + ROUNDING:
            advice = (
                f"The picture is no sharper than its samples: {rows}×{columns} pixels a view would fill the "
                f"sensor's, or pixels of {short(width, digits=3)} do as well."
            )
        else:
            finer = 1 / gaps.footprint if gaps.footprint > ROUNDING else math.inf
            advice = (
                "All of a view falls into one place of the sensor."
                if math.isinf(finer)
                else f"Pixels are {finer:.2g} times as coarse as samples."
                if finer > 1.05
                else "Samples are as fine as pixels."
            )
        # In units of the pixel along the axis that decides, for pixels that are not square.
        limit = width / gaps.footprint if gaps.footprint > 0 else self._pixel
        return {"samples": SamplingItem("a sample of a view on the sensor", width, "m", limit, advice)}

    def _behind_lenslets(self, array: _Met, deflection: CellDeflection) -> dict[str, SamplingItem]:
        """A lenslet is the pixel of a plenoptic camera's picture; the pixels behind it tell views apart."""
        label, pitch = array.stage.element.label, deflection.lattice.pitch
        per_index = array.to.linear[:2] @ self.frame.linear
        width = float(np.linalg.norm(per_index[:, 2:], axis=0).max())
        advice = (
            f"Lenslets see detail that samples do not hold: {math.ceil(max(self.shape[2:]) * width / pitch)} "
            "pixels along a view's longer side would do."
            if width > pitch * (1 + ROUNDING)
            else "Samples are no coarser than lenslets."
        )
        found = {"samples": SamplingItem(f"a sample of a view at {label}", width, "m", pitch, advice)}
        onwards = self._onwards(array)
        by_slope = array.to.linear[:2, 2:]
        if onwards is None or abs(np.linalg.det(by_slope)) <= ROUNDING * np.abs(by_slope).max() ** 2:
            return found
        # At a lenslet's middle (x = A·u + B·s fixed) the slope s' = C·u + D·s changes by (C − D·B⁻¹·A)·du.
        blocks = array.to.linear
        slopes = blocks[2:, :2] - blocks[2:, 2:] @ np.linalg.solve(by_slope, blocks[:2, :2])
        lever = onwards.linear[:2, 2:]
        step = lever @ slopes @ self.frame.linear[:2, :2]
        apart = float(np.linalg.norm(step, axis=0).max())
        if max(self.shape[:2]) > 1:
            needed = math.ceil(max(self.shape[:2]) * apart / self._pixel - ROUNDING)
            found["view behind lenslet"] = SamplingItem(
                f"neighbouring views behind a lenslet of {label}",
                apart,
                "m",
                self._pixel,
                "Each pixel behind a lenslet sees views of its own."
                if apart <= self._pixel * (1 + ROUNDING)
                else f"Pixels between views' pictures repeat or blend them: {needed} views a side would not.",
            )
        radius = 2 * AIRY * self.wavelength * float(np.linalg.norm(lever, 2)) / pitch
        found["lenslet airy"] = self._airy_item(f"Airy radius behind a lenslet of {label}", radius)
        return found

    # -- light itself

    def _stop(self) -> float | None:
        """Half the width at the entrance plane of what stops let in of a point in focus, metres; None for all."""
        widths = []
        for met in self._met():
            if not met.exact or met.stage.faces.pattern is None:
                continue
            size = min(met.stage.faces.pattern.size)
            grown = float(np.linalg.norm(met.to.linear[:2, :2] + met.to.linear[:2, 2:] * self._looked_at, 2))
            if math.isfinite(size) and grown > 0:
                widths.append(size / 2 / grown)
        return min(widths, default=None)

    def _views_let_in(self) -> tuple[int, int]:
        """(rows, columns) of views of which stops let in some light of a point in focus."""
        stop = self._stop()
        cells = np.linalg.norm(self.frame.linear[:2, :2], axis=0)
        columns, rows = (
            count if stop is None else min(count, math.ceil(2 * stop / cell - ROUNDING))
            for count, cell in zip((self.shape[1], self.shape[0]), cells, strict=True)
        )
        return rows, columns

    def _half_width(self) -> float | None:
        """Half the width at the entrance plane of the light of a point in focus, metres: of stops or views."""
        widths = [] if (stop := self._stop()) is None else [stop]
        if min(self.shape[:2]) > 1:
            extent = np.abs(self.frame.linear[:2, :2]).sum(axis=0) * np.array([self.shape[1], self.shape[0]])
            widths.append(float(extent.min()) / 2)
        return min(widths, default=None)

    def _airy(self) -> dict[str, SamplingItem]:
        half = self._half_width()
        if half is None:
            return {}
        # A change of slope λ/width at the entrance moves light by B times as much on the sensor, in focus or not.
        lever = float(np.linalg.norm(self._to_sensor.linear[:2, 2:], 2))
        if lever <= ROUNDING * half:
            return {}
        return {"airy": self._airy_item("Airy radius on the sensor", AIRY * self.wavelength * lever / half)}

    def _airy_item(self, name: str, radius: float) -> SamplingItem:
        pixel = self._pixel
        advice = (
            "Diffraction is finer than the pixels."
            if radius <= pixel * (1 + ROUNDING)
            else f"Light itself blurs over more than a pixel, and the simulation does not show it: open the stop "
            f"{radius / pixel:.2g} times as wide, or take pixels of {short(radius, digits=2)}."
        )
        return SamplingItem(name, radius, "m", pixel, advice)

    def _slope(self, met: list[_Met]) -> dict[str, SamplingItem]:
        planes = [Affine.identity()]
        for each in met:
            if each.exact:
                planes += [each.to, each.to if each.stage.centred is None else each.stage.centred @ each.to]
        blocking = self._blocking()
        if blocking is None:
            planes.append(self._to_sensor)
        largest = min(self._largest_slope(rays, planes) for rays in self._outermost(blocking is None))
        until = "" if blocking is None else f", as far as {blocking.stage.element.label}"
        error = tangent_over_sine(largest)
        advice = (
            f"Paraxial optics takes tangent and sine as one; here they differ by up to {error:.2%}, "
            f"and a real camera's corners get {1 - (1 + largest**2) ** -2:.0%} less light (cos⁴)."
        )
        return {"slope": SamplingItem(f"largest slope{until}", largest, "slope", LARGEST_SLOPE, advice)}

    def _outermost(self, to_sensor: bool) -> Iterator[Array]:
        """Rays (n, 4) at the entrance plane that bound what there is; each set bounds it by itself."""
        nv, nu, nt, ns = self.shape
        corners = np.array(
            [
                [i, j, k, l]
                for i in (-0.5, nu - 0.5)
                for j in (-0.5, nv - 0.5)
                for k in (-0.5, ns - 0.5)
                for l in (-0.5, nt - 0.5)
            ]
        )
        rays = self.frame(corners)
        yield rays
        linear = self._to_sensor.linear
        by_place, by_slope = linear[:2, :2], linear[:2, 2:]
        half = self._half_width()
        if half is None or not to_sensor or abs(np.linalg.det(by_slope)) <= ROUNDING * np.abs(by_slope).max() ** 2:
            return
        height, width = self.camera.sensor.size
        at_sensor = np.array([[x, y] for x in (-width / 2, width / 2) for y in (-height / 2, height / 2)])
        at_sensor = at_sensor + self.camera.sensor.decentre - self._to_sensor.offset[:2]
        angles = np.arange(8) * math.pi / 4
        places = half * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        place, end = np.repeat(places, len(at_sensor), axis=0), np.tile(at_sensor, (len(places), 1))
        yield np.concatenate([place, np.linalg.solve(by_slope, (end - place @ by_place.T).T).T], axis=1)

    @staticmethod
    def _largest_slope(rays: Array, planes: list[Affine]) -> float:
        return max(float(np.linalg.norm(plane(rays)[:, 2:], axis=1).max()) for plane in planes)

    # -- masks

    def _mask(self, met: _Met, notes: list[str]) -> dict[str, SamplingItem]:
        pattern, label = met.stage.faces.pattern, met.stage.element.label
        if pattern is None:
            return {}
        try:
            detail = finest_detail(pattern)
        except InputError as error:
            notes.append(f"detail of {label} is not given: {error}")
            return {}
        if detail is None:
            return {}
        if not met.exact:
            notes.append(f"the footprints of samples at {label} are not given")
            return self._diffraction_of(met, label, detail, in_aperture=False)
        at_mask = met.to.linear[:2] @ self.frame.linear
        motion = index_motions(self.frame, np.array([self._looked_at]))[0]
        nv, nu, nt, ns = self.shape
        view = self._largest(at_mask[:, :2] - at_mask[:, 2:] @ motion, (nu, nv))
        sample = self._largest(at_mask[:, 2:], (ns, nt))
        travel = float((np.abs(at_mask[:, 2:]) @ np.array([ns, nt])).max())
        found = {}
        for key, width, counts, what in (
            ("views", view, (nv, nu), "views"),
            ("samples", sample, (nt, ns), "pixels a view"),
        ):
            rows, columns = (
                count if count < 2 else math.ceil(count * width / detail - ROUNDING) for count in counts
            )
            found[f"{label} {key}"] = SamplingItem(
                f"{'the cell of a view' if key == 'views' else 'a sample'} at {label}",
                width,
                "m",
                detail,
                "Finer than the mask's detail."
                if width <= detail * (1 + ROUNDING)
                else f"The mask's detail of {short(detail, digits=3)} is averaged within it, and the light field "
                f"holds nothing finer: {rows}×{columns} {what} would carry it.",
            )
        in_aperture = travel <= detail
        if not in_aperture:
            found |= self._shadow(met, label, detail)
        return found | self._diffraction_of(met, label, detail, in_aperture)

    def _shadow(self, met: _Met, label: str, detail: float) -> dict[str, SamplingItem]:
        """The mask's shadow by light of one place of the entrance plane: x = B·s there, B_mask·s at the mask."""
        by_slope = met.to.linear[:2, 2:]
        if self._onwards(met) is None or abs(np.linalg.det(by_slope)) <= ROUNDING * np.abs(by_slope).max() ** 2:
            return {}
        grown = self._to_sensor.linear[:2, 2:] @ np.linalg.inv(by_slope)
        shadow = detail * float(np.linalg.norm(grown, -2))
        pixel = max(self.camera.sensor.pitches)
        advice = (
            f"A bright and a dark part take {2 * shadow / pixel:.2g} pixels."
            if shadow >= pixel * (1 - ROUNDING)
            else f"Pixels average or alias it: detail of {short(detail * pixel / shadow, digits=3)}, or pixels of "
            f"{short(shadow, digits=3)}, are the limit."
            if shadow > 0
            else "It falls into one place."
        )
        name = f"shadow of the detail of {label} on the sensor"
        return {f"{label} shadow": SamplingItem(name, shadow, "m", pixel, advice, True)}

    def _diffraction_of(self, met: _Met, label: str, detail: float, in_aperture: bool) -> dict[str, SamplingItem]:
        onwards = self._onwards(met)
        if onwards is None:
            return {}
        lever = float(np.linalg.norm(onwards.linear[:2, 2:], 2))  # metres on the sensor per change of slope here
        key = f"{label} diffraction"
        if not in_aperture:
            blur = math.sqrt(self.wavelength * lever)
            nearer = detail**2 / self.wavelength
            return {
                key: SamplingItem(
                    f"Fresnel blur √(λ·d) of the shadow of {label}",
                    blur,
                    "m",
                    detail,
                    "Shadows are as sharp as rays make them."
                    if blur <= detail * (1 + ROUNDING)
                    else f"Diffraction washes out its detail of {short(detail, digits=3)}: bring it to "
                    f"{short(nearer, digits=3)} before the sensor, or make its detail {short(blur, digits=3)}.",
                )
            }
        if self.vergences is None:
            return {}
        blur = max(detail * self._growth(met, vergence) for vergence in self.vergences)
        spread = self.wavelength * lever / detail
        return {
            key: SamplingItem(
                f"diffraction λ·d/a by the holes of {label}",
                spread,
                "m",
                blur,
                f"Less than the {short(blur, digits=3)} that a hole takes in the most blurred point's picture."
                if spread <= blur * (1 + ROUNDING)
                else f"A hole's picture in the most blurred point is {short(blur, digits=3)} wide: diffraction "
                "hides the code at all depths of the scene; larger holes or more defocus would show it.",
            )
        }

    def _growth(self, met: _Met, vergence: float) -> float:
        """Size on the sensor over size at a mask of the light of a point: (A + B/Z) over that at the mask."""
        here = met.to.linear[:2, :2] + met.to.linear[:2, 2:] * vergence
        there = self._to_sensor.linear[:2, :2] + self._to_sensor.linear[:2, 2:] * vergence
        size = float(np.linalg.norm(here, 2))
        return float(np.linalg.norm(there, 2)) / size if size > 0 else math.inf

    @staticmethod
    def _largest(steps: Array, counts: tuple[int, int]) -> float:
        """Of the steps along two indices the longer, of those that are counted at all."""
        lengths = np.linalg.norm(steps, axis=0)
        return float(
            max((length for length, count in zip(lengths, counts, strict=True) if count > 1), default=0.0)
        )


def in_words(limits: SamplingLimits) -> str:
    """The main numbers and what to watch out for, a line each, indented: a section of `vcc.Camera.explain`."""
    items = limits.items
    lines = [limits.range_in_words()]
    if "disparity near" in items:
        near, far = items["disparity near"].value, items["disparity far"].value
        lines.append(
            f"neighbouring views' pictures lie {near:.2g} pixels apart on the sensor for the nearest, {far:.2g} "
            "for the farthest"
        )
    if "samples" in items:
        sample = items["samples"]
        lines.append(f"{sample.name} is {_quantity(sample.value, 'm')} wide, of {_quantity(sample.limit, 'm')}")
    slope = items["slope"].value
    ends = [f"largest slope {slope:.2g} (tangent {tangent_over_sine(slope):.1%} over sine)"]
    ends += [
        f"{items[key].name} {_quantity(items[key].value, 'm')}" for key in ("airy", "lenslet airy") if key in items
    ]
    lines += ["; ".join(ends), *limits.notes]
    # The number of views says for all depths what disparities say for each, and often for both axes.
    told = {item.advice: item for key, item in reversed(items.items()) if not key.startswith("disparity")}
    if limits.depths is None:
        told |= {item.advice: item for key, item in items.items() if key.startswith("disparity")}
    lines += [f"watch out: {item.stated}. {item.advice}" for item in reversed(told.values()) if not item.fine]
    return "\n".join(f"  {line}" for line in lines if line)


def _ends_matrices(stage: Stage) -> bool:
    """Whether a stage's deflection has another derivative than the matrices of rays say."""
    bending = stage.faces.bending
    if bending is None or isinstance(bending, FacetDeflection):
        return False
    return not (isinstance(bending, CellDeflection) and not bending.powers.any())


def _distance(vergence: float) -> float:
    return 1 / vergence if abs(vergence) > ROUNDING else math.inf


def _before_camera(vergences: tuple[float, float]) -> tuple[float, float]:
    """(near, far) of a range of 1/Z that reaches before the camera, of what lies there."""
    return 1 / vergences[1], _distance(max(vergences[0], 0.0))


def _free_in_words(gaps: ViewGaps) -> str:
    free = gaps.free_of_ghosts()
    if free is None or free[1] <= 0:
        return "no depth at all"
    near, far = _before_camera(free)
    return f"{distance_in_words(near)} to {distance_in_words(far)}"


def _quantity(value: float, unit: str) -> str:
    if unit == "m":
        return short(value, digits=3)
    if unit != "pixels":
        return f"{value:.3g}"
    number = f"{value:.3g}"
    return f"{number} pixel" if number == "1" else f"{number} pixels"
