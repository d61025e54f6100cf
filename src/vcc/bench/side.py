"""The side view of a bench as data: elements in their places, rays through them, distances as text.

The content is that of `vcc.plot.plot_camera`, traced and measured by the same functions. Lengths are metres.
Upwards in the drawing is to the right in the scene. Infinity becomes None, because JSON has no infinity.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from vcc.advice.words import distance_in_words
from vcc.base import units
from vcc.bench.handles import handles_of, handles_of_sensor
from vcc.bench.messages import Rays, Side, SideAperture, SideElement, Snap
from vcc.bench.snapping import snaps_of_elements, snaps_of_sensor, without_repeats
from vcc.fields.grid import Grid
from vcc.fields.samples import InMemory
from vcc.files.camera_reading import TrainAsWritten
from vcc.optics import CellDeflection, Element, FirstOrder, Lens, Prism
from vcc.optics.train import Train
from vcc.plot.elements import (
    Span,
    along,
    drawn_range,
    glass_profile,
    half_opening,
    half_size,
    magnification,
    mask_bar,
)
from vcc.plot.fans import (
    OFF_AXIS_RAYS,
    RAYS,
    RAYS_THAT_SPLIT,
    Point,
    beam_at,
    focused_distance,
    half_height,
    points_to_show,
    scene_length,
    trace_points,
)
from vcc.plot.labels import label_of
from vcc.plot.tracing import Paths, crossings, openings, spread_along

Array = NDArray[np.float64]
Json = dict[str, Any]

AXIS = 0
"""x points upwards in the drawing, unless y is chosen."""
DIGITS = 5
"""Significant digits of lengths: a thousandth of a pixel."""
FARTHEST_DRAWN = 4
"""How far before the camera, in camera lengths, the drawing still includes the light field's aperture."""
PROFILE_POINTS = 160
MOST_PIECES = 400
"""Pieces of a mask's pattern; the pieces of a finer pattern are averaged."""
DRAWN = 64
"""Shapes of elements that are kept: while one element moves, the others look the same."""
SHARP = 0.02
"""Share of a beam: rays that come closer than this meet."""
FARTHEST_IMAGE = 0.12
"""Images of points are shown up to this behind the sensor, as a share of the camera's length."""
_ORDER = ("off axis", "near", "far", "given", "focused")
"""Fans in the order in which they are drawn: the one in focus on top."""
AS_SHARP = 0.01
"""Relative tolerance in 1/Z: a scene end this near to the distance in focus gets no rays of its own."""


def side(
    described: TrainAsWritten,
    light_field: InMemory | None,
    grid: Grid | None,
    aperture: SideAperture | None = None,
    axis: int = AXIS,
    moving: bool = False,
) -> Side:
    """The side view of a camera.

    Args:
        described: the camera, with its elements in the order of the document.
        light_field: the rays fill its width within the first rim; None fills the first lens.
        grid: its scene gives the distances to show; None for no scene.
        aperture: of the light field, from `vcc.bench.aperture.drawn_aperture`.
        axis: 0 if x points upwards in the drawing, 1 for y.
        moving: during a drag there are no snaps: those from before it count.
    """
    elements, train = described.elements, described.train
    points = _points(train, grid, axis)
    start = -scene_length(train, points)
    if aperture is not None and 0 < -aperture["z"] < FARTHEST_DRAWN * train.sensor.z:
        start = min(start, 1.1 * aperture["z"])
    scattering = any(stage.faces.spread is not None for stage in train.stages)
    rays = RAYS_THAT_SPLIT if scattering else RAYS
    fans = [(point, OFF_AXIS_RAYS if point.offset else rays) for point in points]
    paths = trace_points(train, fans, light_field, axis, start, within_rim=True)
    half = half_height(train, paths, axis)
    span = Span(axis, -half, half)
    focus = focused_distance(train)
    scene = {} if grid is None else {f"{name} of the scene": z for name, z in scene_distances(grid).items()}
    places = without_repeats(scene | ({} if focus is None else {"what is sharp now": focus}))
    pulled = [[] for _ in elements] if moving else snaps_of_elements(elements, train, places)
    drawn = [_rays(point, path, axis) for point, path in zip(points, paths, strict=True)]
    meeting = [fan["meet"][0] for fan in drawn if fan["meet"] is not None]
    return {
        "axis": "x" if axis == 0 else "y",
        "start": _short(start),
        "end": _short(max([train.sensor.z, *meeting])),
        "half": _short(half),
        "elements": [
            _element(number, one, span, paths, snaps)
            for number, (one, snaps) in enumerate(zip(elements, pulled, strict=True))
        ],
        "sensor": {
            "z": train.sensor.z,
            "half": train.sensor.size[1 - axis] / 2,
            "decentre": train.sensor.decentre[axis],
            "label": _sensor_label(train, axis),
            "handles": handles_of_sensor(train.sensor, axis),
        },
        "rays": sorted(drawn, key=lambda fan: _ORDER.index(fan["role"])),
        "aperture": aperture,
        "snaps": [] if moving else snaps_of_sensor(train, scene),
        "words": _words(train, focus, grid, axis),
    }


# --- elements ---


def _element(number: int, element: Element, span: Span, paths: Sequence[Paths], snaps: list[Snap]) -> SideElement:
    """The shape of an element in the drawing, its size, its openings and its handles."""
    planes, axis = crossings(element), span.axis
    size = half_size(element, axis)
    centre = element.decentre[axis]
    drawn: dict[str, Any] = {
        "snaps": snaps,
        "handles": handles_of(element, axis),
        "element": number,
        "kind": element.kind,
        "name": element.name,
        "label": label_of(element, span).split("\n"),
        "z": element.z,
        "length": element.length,
        "decentre": centre,
        "half": None if math.isinf(size) else size,
    }
    if len(planes) > 1 or element.length > 0:
        rims = [(plane.z, half_opening(plane.faces, axis)) for plane in planes]
        block = {
            "drawn": "block",
            "beam": _short(max(beam_at(element, paths, axis), 0.0)),
            "openings": [[z, centre - half, centre + half] for z, half in rims if math.isfinite(half)],
        }
        return cast(SideElement, drawn | block)
    if isinstance(element, Lens):
        return cast(
            SideElement,
            drawn | {"drawn": "lens", "converging": element.focal_length > 0} | _opening(element, size, axis),
        )
    if isinstance(element, Prism):
        prism = {"drawn": "prism", "towards": float(np.sign(element.deflection[axis]))}
        return cast(SideElement, drawn | prism)
    return cast(SideElement, drawn | _by_faces(element, span))


def _opening(element: Element, half: float, axis: int) -> Json:
    """The opening of an element with a rim: its ends on the drawing."""
    centre = element.decentre[axis]
    return {"openings": [[element.z, centre - half, centre + half]] if math.isfinite(half) else []}


@functools.lru_cache(DRAWN)
def _by_faces(element: Element, span: Span) -> Json:
    """Any thin element by its function: glass that deflects, frosted if it scatters, grey levels of a mask."""
    axis, faces = span.axis, crossings(element)[0].faces
    found: Json = {"drawn": "sheet"} | _opening(element, half_opening(faces, axis), axis)
    if faces.pattern is not None:
        scale = magnification(element, faces, axis, span.low, span.high)
        bar = mask_bar(span, element, faces.pattern, scale)
        found |= {"drawn": "mask", "shades": [] if bar is None else _pieces(*bar)}
    if faces.spread is not None:
        low, high = drawn_range(span, element, half_opening(faces, axis))
        places = np.linspace(low, high, 33)
        spread = spread_along(faces.spread, axis, *along(axis, places))
        strongest = float(spread.max())
        strength = spread / strongest if strongest > 0 else spread
        found |= {"drawn": "frosted", "roughness": _pairs(places + element.decentre[axis], strength)}
    if faces.deflection is not None:
        profile = glass_profile(span, element, faces)
        if profile is not None:
            height, depth = profile
            cells = isinstance(faces.bending, CellDeflection)  # keep the borders of cells sharp
            every = 1 if cells else max(len(height) // PROFILE_POINTS, 1)
            points = _pairs(height[::every] + element.decentre[axis], depth[::every])
            found |= {"drawn": "glass", "profile": points}
    return found


def _pieces(edges: Array, values: Array) -> list[list[float]]:
    """[from, to, transmission] of each piece of a mask, at most `MOST_PIECES`."""
    if len(values) > MOST_PIECES:
        wanted = np.linspace(edges[0], edges[-1], MOST_PIECES + 1)
        through = np.concatenate([[0.0], np.cumsum(values * np.diff(edges))])
        passed = np.interp(wanted, edges, through)
        edges, values = wanted, np.diff(passed) / np.diff(wanted)
    return [
        [_short(low), _short(high), round(float(value), 3)]
        for low, high, value in zip(edges[:-1], edges[1:], values, strict=True)
    ]


def _pairs(heights: Array, values: Array) -> list[list[float]]:
    return [[_short(height), round(float(value), 3)] for height, value in zip(heights, values, strict=True)]


def _sensor_label(train: Train, axis: int) -> list[str]:
    rows, columns = train.sensor.shape
    return ["sensor", f"{rows} × {columns}, {_in_words(train.sensor.pitches[1 - axis])}"]


# --- rays ---


def _points(train: Train, grid: Grid | None, axis: int) -> list[Point]:
    """The points whose rays are drawn: in focus, also off the axis, and the scene's ends if known."""
    found = points_to_show(train, None, axis)
    scene = {} if grid is None else scene_distances(grid)
    apart = {
        role: distance
        for role, distance in zip(("near", "far"), scene.values(), strict=False)
        if distance > 0 and abs(1 / distance - 1 / found[0].distance) > AS_SHARP / found[0].distance
    }
    if not apart:
        return found
    ends = [Point(distance, 0.0, role, f"{role}: {_away(distance)}") for role, distance in apart.items()]
    return [point for point in found if point.role != "near"] + ends


def _away(distance: float) -> str:
    return "at infinity" if math.isinf(distance) else f"{distance_in_words(distance)} away"


def _rays(point: Point, paths: Paths, axis: int) -> Rays:
    """The fan of rays from a point: each ray as a list of (z, height, share of light left)."""
    listed = []
    for z, height, share, first in zip(
        paths.depths, paths.positions[..., axis], paths.shares, paths.starts, strict=True
    ):
        ray = []
        for plane in range(first, len(paths.z)):
            if plane > first and share[plane] <= 0:
                break
            ray.append((_short(z[plane]), _short(height[plane]), round(float(share[plane]), 3)))
        listed.append(ray)
    role: Any = point.role
    return {
        "role": role,
        "distance": _distance(point.distance),
        "words": point.label,
        "paths": listed,
        "meet": _meeting(paths, axis),
    }


def _meeting(paths: Paths, axis: int) -> tuple[float, float] | None:
    """(z, height) where the rays of a fan meet; None if they do not, or far behind the sensor."""
    arrived = paths.shares[:, -1] > 0
    if len(paths.z) < 2 or paths.starts.any() or arrived.sum() < 2:
        return None
    from_z, to_z = paths.depths[arrived, -2], paths.z[-1]
    before, after = (paths.positions[arrived, plane, axis] for plane in (-2, -1))
    if not (to_z > from_z).all():
        return None
    slopes = (after - before) / (to_z - from_z)
    spread = slopes - slopes.mean()
    if not (spread**2).sum() > 0:
        return None
    beyond = -float((spread * (after - after.mean())).sum() / (spread**2).sum())
    left = after + beyond * slopes
    z = to_z + beyond
    unsharp = np.ptp(left) > SHARP * max(np.ptp(after), np.ptp(before))
    if unsharp or not paths.z[-2] < z < (1 + FARTHEST_IMAGE) * to_z:
        return None
    return _short(z), _short(float(left.mean()))


def _distance(distance: float | None) -> float | None:
    return None if distance is None or math.isinf(distance) else distance


def _in_words(length: float) -> str:
    """A length for people, to four digits; micrometres as they write them."""
    return units.short(length, digits=4).replace(" um", " µm")


def _short(length: float) -> float:
    """A length rounded to what a drawing can show, so that its JSON is short."""
    return float(f"{length:.{DIGITS}g}")


# --- words ---


def scene_distances(grid: Grid) -> dict[str, float]:
    """Distances of the nearest and farthest parts of the scene, metres, by name; empty if unknown."""
    found = grid.measured_disparity_range()
    if found is None:
        return {}
    far, near = (grid.distance_of(disparity) for disparity in found)
    return {"nearest": near, "farthest": far if far > 0 else math.inf}


def _words(train: Train, focus: float | None, grid: Grid | None, axis: int) -> list[str]:
    """Sentences on what is in focus, the scene, the sensor's distance and the f-number of the first lens."""
    sharp = "No real distance is in focus" if focus is None else f"In focus: {distance_in_words(focus)}"
    said = [f"{sharp}."]
    if grid is not None and (scene := scene_distances(grid)):
        said.append(f"The scene: {' to '.join(map(distance_in_words, scene.values()))}.")
    lens = next((one for one in train.elements if isinstance(one, Lens | FirstOrder)), None)
    if lens is None:
        return said
    behind = train.sensor.z - lens.z - lens.length
    said.append(f"The sensor stands {_in_words(behind)} behind {lens.label}.")
    rims = [half for element, _, half in openings(train, axis) if element is lens]
    if isinstance(lens, Lens) and rims:
        said.append(f"{lens.label.capitalize()}: f/{abs(lens.focal_length) / (2 * rims[0]):.3g}.")
    return said
