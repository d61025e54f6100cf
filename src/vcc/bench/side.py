"""The side view of a bench as data: elements in their places, rays through them, distances as text.

The content is that of `vcc.plot.plot_camera`, traced and measured by the same functions. Lengths are metres.
Upwards in the drawing is to the right in the scene. Infinity becomes None, because JSON has no infinity.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.advice.words import distance_in_words
from vcc.base.units import short
from vcc.bench.snapping import snaps_of_elements, snaps_of_sensor, without_repeats
from vcc.fields.grid import Grid
from vcc.fields.samples import InMemory
from vcc.optics import CellDeflection, Element, Faces, FirstOrder, Lens, Prism
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
    trace_point,
)
from vcc.plot.labels import label_of
from vcc.plot.tracing import Paths, crossings, openings, spread_along

Array = NDArray[np.float64]
Json = dict[str, Any]

AXIS = 0
"""x points upwards in the drawing."""
DIGITS = 5
"""Significant digits of lengths: a thousandth of a pixel."""
FARTHEST_DRAWN = 4
"""How far before the camera, in camera lengths, the drawing still includes the light field's aperture."""
PROFILE_POINTS = 160
MOST_PIECES = 400
"""Pieces of a mask's pattern; the pieces of a finer pattern are averaged."""
AS_SHARP = 0.01
"""Relative tolerance in 1/Z: a scene end this near to the distance in focus gets no rays of its own."""


def side(
    elements: Sequence[Element],
    train: Train,
    light_field: InMemory | None,
    grid: Grid | None,
    aperture: Json | None = None,
) -> Json:
    """The side view of a camera.

    Args:
        elements: of the camera, in the order of the document.
        train: of these elements.
        light_field: the rays fill its width; None fills the first lens.
        grid: its scene gives the distances to show; None for no scene.
        aperture: of the light field, from `vcc.bench.aperture.drawn_aperture`.
    """
    points = _points(train, grid)
    start = -scene_length(train, points)
    if aperture is not None and 0 < -aperture["z"] < FARTHEST_DRAWN * train.sensor.z:
        start = min(start, 1.1 * aperture["z"])
    scattering = any(stage.faces.spread is not None for stage in train.stages)
    rays = RAYS_THAT_SPLIT if scattering else RAYS
    paths = [
        trace_point(train, point, light_field, AXIS, OFF_AXIS_RAYS if point.offset else rays, start)
        for point in points
    ]
    half = half_height(train, paths, AXIS)
    span = Span(AXIS, -half, half)
    focus = focused_distance(train)
    scene = {} if grid is None else {f"{name} of the scene": z for name, z in scene_distances(grid).items()}
    places = without_repeats(scene | ({} if focus is None else {"what is sharp now": focus}))
    pulled = snaps_of_elements(elements, train, places)
    return {
        "from": _short(start),
        "to": _short(train.sensor.z),
        "half": _short(half),
        "elements": [
            _element(number, one, span, paths) | {"snaps": snaps}
            for number, (one, snaps) in enumerate(zip(elements, pulled, strict=True))
        ],
        "sensor": {
            "z": train.sensor.z,
            "half": train.sensor.size[1 - AXIS] / 2,
            "decentre": train.sensor.decentre[AXIS],
            "label": _sensor_label(train),
        },
        "rays": [_rays(point, path) for point, path in zip(points, paths, strict=True)],
        "aperture": aperture,
        "focus": _distance(focus),
        "snaps": snaps_of_sensor(train, scene),
        "words": _words(train, focus, grid),
    }


# --- elements ---


def _element(number: int, element: Element, span: Span, paths: Sequence[Paths]) -> Json:
    """The shape of an element in the drawing, its size and its openings."""
    planes = crossings(element)
    size = half_size(element, AXIS)
    centre = element.decentre[AXIS]
    drawn: Json = {
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
        rims = [(plane.z, half_opening(plane.faces, AXIS)) for plane in planes]
        return drawn | {
            "drawn": "block",
            "beam": _short(max(beam_at(element, paths, AXIS), 0.0)),
            "openings": [[z, centre - half, centre + half] for z, half in rims if math.isfinite(half)],
        }
    if isinstance(element, Lens):
        return drawn | {"drawn": "lens", "converging": element.focal_length > 0} | _opening(element, size)
    if isinstance(element, Prism):
        return drawn | {"drawn": "prism", "towards": float(np.sign(element.deflection[AXIS]))}
    return drawn | _by_faces(element, planes[0].faces, span)


def _opening(element: Element, half: float) -> Json:
    """The opening of an element with a rim: its ends on the drawing."""
    centre = element.decentre[AXIS]
    return {"openings": [[element.z, centre - half, centre + half]] if math.isfinite(half) else []}


def _by_faces(element: Element, faces: Faces, span: Span) -> Json:
    """Any thin element by its function: glass that deflects, frosted if it scatters, grey levels of a mask."""
    found: Json = {"drawn": "sheet"} | _opening(element, half_opening(faces, AXIS))
    if faces.pattern is not None:
        scale = magnification(element, faces, AXIS, span.low, span.high)
        bar = mask_bar(span, element, faces.pattern, scale)
        found |= {"drawn": "mask", "shades": [] if bar is None else _pieces(*bar)}
    if faces.spread is not None:
        low, high = drawn_range(span, element, half_opening(faces, AXIS))
        places = np.linspace(low, high, 33)
        spread = spread_along(faces.spread, AXIS, *along(AXIS, places))
        strongest = float(spread.max())
        strength = spread / strongest if strongest > 0 else spread
        found |= {"drawn": "frosted", "roughness": _pairs(places + element.decentre[AXIS], strength)}
    if faces.deflection is not None:
        profile = glass_profile(span, element, faces)
        if profile is not None:
            height, depth = profile
            cells = isinstance(faces.bending, CellDeflection)  # keep the borders of cells sharp
            every = 1 if cells else max(len(height) // PROFILE_POINTS, 1)
            points = _pairs(height[::every] + element.decentre[AXIS], depth[::every])
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


def _sensor_label(train: Train) -> list[str]:
    rows, columns = train.sensor.shape
    return ["sensor", f"{rows} × {columns}, {short(train.sensor.pitches[1 - AXIS], digits=4)}"]


# --- rays ---


def _points(train: Train, grid: Grid | None) -> list[Point]:
    """The points whose rays are drawn: in focus, also off the axis, and the scene's ends if known."""
    found = points_to_show(train, None, AXIS)
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


def _rays(point: Point, paths: Paths) -> Json:
    """The fan of rays from a point: each ray as a list of [z, height, share of light left]."""
    listed = []
    for z, height, share, first in zip(
        paths.depths, paths.positions[..., AXIS], paths.shares, paths.starts, strict=True
    ):
        ray = []
        for plane in range(first, len(paths.z)):
            if plane > first and share[plane] <= 0:
                break
            ray.append([_short(z[plane]), _short(height[plane]), round(float(share[plane]), 3)])
        listed.append(ray)
    return {"colour": point.role, "distance": _distance(point.distance), "words": point.label, "paths": listed}


def _distance(distance: float | None) -> float | None:
    return None if distance is None or math.isinf(distance) else distance


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


def _words(train: Train, focus: float | None, grid: Grid | None) -> list[str]:
    """Sentences on what is in focus, the scene, the sensor's distance and the f-number of the first lens."""
    sharp = "No real distance is in focus" if focus is None else f"In focus: {distance_in_words(focus)}"
    said = [f"{sharp}."]
    if grid is not None and (scene := scene_distances(grid)):
        said.append(f"The scene: {' to '.join(map(distance_in_words, scene.values()))}.")
    lens = next((one for one in train.elements if isinstance(one, Lens | FirstOrder)), None)
    if lens is None:
        return said
    behind = train.sensor.z - lens.z - lens.length
    said.append(f"The sensor stands {short(behind, digits=4)} behind {lens.label}.")
    rims = [half for element, _, half in openings(train, AXIS) if element is lens]
    if isinstance(lens, Lens) and rims:
        said.append(f"{lens.label.capitalize()}: f/{abs(lens.focal_length) / (2 * rims[0]):.3g}.")
    return said
