"""Sampling limits as text, from the numbers of `vcc.advice.limits` and `vcc.advice.mask_limits`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

from vcc.advice.view_gaps import ROUNDING, ViewGaps
from vcc.base.errors import InputError
from vcc.base.units import short

Range = tuple[float, float]
"""(near, far), metres."""


@dataclass(frozen=True)
class SamplingItem:
    """One quantity that sampling, paraxial optics or diffraction limits.

    Args:
        name: description as text.
        value: in SI units, or in ``unit``.
        unit: ``"m"`` (metres), ``"pixels"``, ``"views"`` or ``"slope"``.
        limit: largest or smallest allowed value, in the same unit.
        advice: what to do, or why nothing is to be done, one sentence.
        at_least: whether the limit is the smallest value rather than the largest.
    """

    name: str
    value: float
    unit: str
    limit: float
    advice: str
    at_least: bool = False

    @property
    def fine(self) -> bool:
        """Whether the value is within the limit."""
        if self.at_least:
            return self.value >= self.limit * (1 - ROUNDING)
        return self.value <= self.limit * (1 + ROUNDING)

    @property
    def verdict(self) -> str:
        """``"fine"`` or ``"watch out"``."""
        return "fine" if self.fine else "watch out"

    @property
    def finding(self) -> str:
        """Name, value and limit as text."""
        bound = "at least" if self.at_least else "at most"
        return f"{self.name}: {_quantity(self.value, self.unit)} ({bound} {_quantity(self.limit, self.unit)})"

    def __str__(self) -> str:
        return f"{self.finding}: {self.verdict}. {self.advice}"


# --- quantities ---


def distance_in_words(distance: float) -> str:
    """A distance with its unit, or infinity; a negative one means converging light, which no scene emits."""
    if distance < 0:
        return f"beyond infinity (light converging {_short(-distance)} behind z = 0)"
    return "infinity" if math.isinf(distance) else _short(distance)


def tangent_over_sine(slope: float) -> float:
    """The relative excess of the tangent of a ray's angle, its slope, over the sine: √(1 + slope²) − 1."""
    return math.hypot(1.0, slope) - 1


def _quantity(value: float, unit: str) -> str:
    if unit == "m":
        return _short(value)
    number = f"{value:.3g}"
    return number if unit != "pixels" else f"{number} pixel" if number == "1" else f"{number} pixels"


def _short(length: float) -> str:
    return short(length, digits=3)


def _sizes(counts: tuple[int, int]) -> str:
    return "×".join(map(str, counts))


# --- one function per limit ---


def _item(
    name: str, value: float, limit: float, fine: str, otherwise: str, unit: str = "m", at_least: bool = False
) -> SamplingItem:
    """An item with one of two texts of advice, depending on whether the value is within its limit."""
    item = SamplingItem(name, value, unit, limit, fine, at_least)
    return item if item.fine else replace(item, advice=otherwise)


def disparity(where: str, gap: float, limit: float, views: int, free: Range | None) -> SamplingItem:
    """Distance in pixels between images of a point by neighbouring views, with ``views`` views per side."""
    within = "no depth at all" if free is None else " to ".join(map(distance_in_words, free))
    return _item(
        f"disparity per view on the sensor ({where})",
        gap,
        limit,
        "Neighbouring views' pictures overlap: their sum is a smooth blur.",
        f"Out-of-focus points show as {views} separate copies a side at most: take views {gap / limit:.2g} times "
        f"as dense, or stay within {within}.",
        "pixels",
    )


def view_count(along: str, had: int, needed: int) -> SamplingItem:
    """The number of views across or down within the stop, and the number that the scene's depths need."""
    return _item(
        f"views {along}",
        had,
        needed,
        "As many as the scene's depths need, or more.",
        f"{needed} views over the same width leave no ghosts at any depth of the scene.",
        "views",
        at_least=True,
    )


def sample_on_sensor(width: float, pixel: float, needed: tuple[int, int]) -> SamplingItem:
    """The footprint of a light field's sample; (rows, columns) of a view that would match the sensor."""
    finer = pixel / width if width > ROUNDING * pixel else math.inf
    return _item(
        "a sample of a view on the sensor",
        width,
        pixel,
        "All of a view falls into one place of the sensor."
        if math.isinf(finer)
        else f"Pixels are {finer:.2g} times as coarse as samples."
        if finer > 1.05
        else "Samples are as fine as pixels.",
        f"The picture is no sharper than its samples: {_sizes(needed)} pixels a view would fill the sensor's, or "
        f"pixels of {_short(width)} do as well.",
    )


def sample_at_lenslets(label: str, width: float, pitch: float, needed: int) -> SamplingItem:
    """The footprint of a light field's sample at a lens array, and the pixels per view that would be as fine."""
    return _item(
        f"a sample of a view at {label}",
        width,
        pitch,
        "Samples are no coarser than lenslets.",
        f"Lenslets see detail that samples do not hold: {needed} pixels along a view's longer side would do.",
    )


def views_behind_lenslet(label: str, apart: float, pixel: float, needed: int) -> SamplingItem:
    """Distance between neighbouring views' images behind a lenslet, and the views per side that pixels resolve."""
    return _item(
        f"neighbouring views behind a lenslet of {label}",
        apart,
        pixel,
        "Each pixel behind a lenslet sees views of its own.",
        f"Pixels between views' pictures repeat or blend them: {needed} views a side would not.",
    )


def airy(where: str, radius: float, pixel: float, shown: str = "does not show it") -> SamplingItem:
    """Blur by diffraction; ``shown``: what an image has of it."""
    return _item(
        f"Airy radius {where}",
        radius,
        pixel,
        "Diffraction is finer than the pixels.",
        f"Light itself blurs over more than a pixel, and the simulation {shown}: open the stop "
        f"{radius / pixel:.2g} times as wide, or take pixels of {short(radius, digits=2)}.",
    )


def largest_slope(slope: float, limit: float, until: str | None) -> SamplingItem:
    """The largest slope of a ray, up to the named element."""
    advice = (
        f"Paraxial optics takes tangent and sine as one; here they differ by up to {tangent_over_sine(slope):.2%}"
        f", and a real camera's corners get {1 - (1 + slope**2) ** -2:.0%} less light (cos⁴)."
    )
    name = "largest slope" if until is None else f"largest slope, as far as {until}"
    return SamplingItem(name, slope, "slope", limit, advice)


def cell_at_mask(label: str, of_view: bool, width: float, detail: float, needed: tuple[int, int]) -> SamplingItem:
    """Width of a view's cell or a sample at a mask; (rows, columns) that would match the mask's detail."""
    return _item(
        f"{'the cell of a view' if of_view else 'a sample'} at {label}",
        width,
        detail,
        "Finer than the mask's detail.",
        f"The mask's detail of {_short(detail)} is averaged within it, and the light field holds nothing finer: "
        f"{_sizes(needed)} {'views' if of_view else 'pixels a view'} would carry it.",
    )


def shadow(label: str, width: float, pixel: float, detail: float) -> SamplingItem:
    """Width of a mask's detail in its shadow on the sensor."""
    return _item(
        f"shadow of the detail of {label} on the sensor",
        width,
        pixel,
        f"A bright and a dark part take {2 * width / pixel:.2g} pixels.",
        f"Pixels average or alias it: detail of {_short(detail * pixel / width)}, or pixels of {_short(width)}, "
        "are the limit."
        if width > 0
        else "It falls into one place.",
        at_least=True,
    )


def fresnel_blur(label: str, blur: float, detail: float, nearer: float) -> SamplingItem:
    """Diffraction blur of a mask's shadow, and the distance to the sensor that avoids it."""
    return _item(
        f"Fresnel blur √(λ·d) of the shadow of {label}",
        blur,
        detail,
        "Shadows are as sharp as rays make them.",
        f"Diffraction washes out its detail of {_short(detail)}: bring it to {_short(nearer)} before the sensor, "
        f"or make its detail {_short(blur)}.",
    )


def hole_diffraction(label: str, spread: float, picture: float) -> SamplingItem:
    """Diffraction by a hole of a mask in the aperture, and the hole's size in the most blurred image."""
    return _item(
        f"diffraction λ·d/a by the holes of {label}",
        spread,
        picture,
        f"Less than the {_short(picture)} that a hole takes in the most blurred point's picture.",
        f"A hole's picture in the most blurred point is {_short(picture)} wide: diffraction hides the code at all "
        "depths of the scene; larger holes or more defocus would show it.",
    )


def feature_spread(
    label: str, spread: float, pixel: float, detail: float, fresnel: float, way_out: str
) -> SamplingItem:
    """Spread of a feature on the sensor by waves; its Fresnel number w²/(λ·d), and what can be done."""
    rule = f"Fresnel number w²/(λ·d) of features of {_short(detail)}: {fresnel:.2g}"
    return _item(
        f"spread of the features of {label} by waves",
        spread,
        pixel,
        f"Less than a pixel; {rule}.",
        f"That is {spread / pixel:.2g} pixels ({rule}; rays hold far above 1): {way_out}.",
    )


# --- numbers that are not available ---


def blocked(label: str) -> str:
    """Note about an element behind which matrices are not exact."""
    return (
        f"disparity, ghosts and footprints on the sensor are not given behind {label}, which bends rays otherwise "
        "than a lens or a prism"
    )


def spreads(label: str, reach: float | None) -> str:
    """Note about a diffuser's spread on the sensor, metres; None if unknown."""
    if reach is None:
        return f"how far {label} spreads light on the sensor is not given"
    return (
        f"{label} spreads light by up to {_short(reach)} on the sensor: what is finer, ghosts and detail, "
        "is blurred by it, and no item counts that"
    )


def within_facets(label: str) -> str:
    """Note about plane facets."""
    return f"{label} bends by plane facets: items hold within each, not across their edges"


def detail_unknown(label: str, why: Exception) -> str:
    """Note about a mask of unknown detail."""
    return f"detail of {label} is not given: {why}"


def footprints_unknown(label: str) -> str:
    """Note about a mask behind an element without exact matrices."""
    return f"the footprints of samples at {label} are not given"


# --- all limits ---


@dataclass(frozen=True, eq=False)
class SamplingLimits:
    """The sampling limits of a camera and a light field, and the limits of paraxial optics.

    Args:
        items: by key: ``"disparity near"``, ``"disparity focus"``, ``"disparity far"`` (pixels per view on the
            sensor), ``"views across"``, ``"views down"`` (available within the stop; the limit is the number
            needed), ``"samples"`` (footprint of a light field's sample), ``"slope"``, ``"airy"``, for a lens
            array ``"view behind lenslet"`` and ``"lenslet airy"``, and for each mask with detail ``"LABEL
            views"``, ``"LABEL samples"``, ``"LABEL shadow"``, ``"LABEL diffraction"`` and ``"LABEL waves"``.
            LABEL is the element's name in messages, such as ``mask "code"``. Items that are not available are
            missing.
        wavelength: metres.
        focus_distance: distance in focus before the entrance plane, metres: positive or infinite; None if nothing
            before the camera is in focus.
        depths: (near, far) of the scene, metres; None if unknown. A negative value means light that converges
            at this distance behind the entrance plane, as behind a lens.
        free_of_ghosts: (near, far) of the range without ghost copies, metres; None if there is none, or if it
            is not available.
        notes: which numbers are not available and why, why nothing is in focus, and what diffusers hide.
        gaps: between views, as a function of distance; None if not available.
        pixel: the smaller pitch of the sensor, metres.
        views: (rows, columns) of views.
    """

    items: dict[str, SamplingItem]
    wavelength: float = field(metadata={"unit": "length"})
    focus_distance: float | None = field(metadata={"unit": "length"})
    depths: Range | None = field(metadata={"unit": "length"})
    free_of_ghosts: Range | None = field(metadata={"unit": "length"})
    notes: tuple[str, ...]
    gaps: ViewGaps | None
    pixel: float = field(metadata={"unit": "length"})
    views: tuple[int, int]

    def __getitem__(self, key: str) -> SamplingItem:
        """An item by its key.

        Raises:
            InputError: an unknown key; the message lists the known ones.
        """
        if key not in self.items:
            why = f" Notes: {'; '.join(self.notes)}." if self.notes else ""
            raise InputError(f"no sampling item is named {key!r}; there are {', '.join(self.items)}.{why}")
        return self.items[key]

    @property
    def to_watch(self) -> tuple[SamplingItem, ...]:
        """The items that exceed their limits."""
        return tuple(item for item in self.items.values() if not item.fine)

    def range_in_words(self) -> str:
        """Depths, focus and the range free of ghosts, in one line."""
        parts = [self._scene()] if self.gaps is None else [self._scene(), self._focus(self.gaps), self._free()]
        return "; ".join(part for part in parts if part)

    def _scene(self) -> str:
        if self.depths is None:
            return ""
        near, far = map(distance_in_words, self.depths)
        return f"scene at {near}" if near == far else f"scene from {near} to {far}"

    def _focus(self, gaps: ViewGaps) -> str:
        if self.focus_distance is not None:
            return f"in focus at {distance_in_words(self.focus_distance)}"
        return "" if gaps.focus is None else "nothing before the camera is in focus"

    def _free(self) -> str:
        if self.free_of_ghosts is None:
            return "ghosts at all distances"
        if self.free_of_ghosts == (0.0, math.inf):
            return "free of ghosts at all distances"
        return f"free of ghosts from {' to '.join(map(distance_in_words, self.free_of_ghosts))}"


def in_words(limits: SamplingLimits) -> str:
    """The main numbers and the warnings, one per line, indented: a section of `vcc.Camera.explain`."""
    lines = [limits.range_in_words(), *_main_numbers(limits), *limits.notes]
    lines += [f"watch out: {item.finding}. {item.advice}" for item in _without_repeats(limits) if not item.fine]
    return "\n".join(f"  {line}" for line in lines if line)


def _main_numbers(limits: SamplingLimits) -> list[str]:
    items, lines = limits.items, []
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
    airy = [items[key] for key in ("airy", "lenslet airy") if key in items]
    return [*lines, "; ".join(ends + [f"{item.name} {_quantity(item.value, 'm')}" for item in airy])]


def _without_repeats(limits: SamplingLimits) -> list[SamplingItem]:
    """The items without repetitions: the view count covers the disparities, and often both axes are equal."""
    told = {item.advice: item for key, item in reversed(limits.items.items()) if not key.startswith("disparity")}
    if limits.depths is None:
        told |= {item.advice: item for key, item in limits.items.items() if key.startswith("disparity")}
    return list(reversed(told.values()))
