"""Where an array can stand in a scene of splats: cameras from a file or around the cloud, and what they see."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.showing import spread
from vcc.files.transfer import encode
from vcc.formats.poses import PosedCamera
from vcc.plot.style import INK, SMALL, new_axes
from vcc.sources.opengl import Viewpoint
from vcc.sources.splats.cloud import Splats
from vcc.sources.splats.scene import NothingSeen, SplatScene
from vcc.sources.views import CameraArray

MOST_SEEN = 24
"""Cameras on a contact sheet; of more, an even selection."""
_AROUND, _INSIDE = 8, 4
_ELEVATION = math.radians(15)
_FIELD_OF_VIEW = math.radians(50)
_THUMBNAIL = 192
_ENDS = (2.0, 98.0)
"""Per cent of the pixels between which depth counts: floating splats near the camera are left out."""
_INCHES = 2.6


@dataclass(frozen=True, eq=False, repr=False)
class Seen(Brief):
    """What a camera sees of a scene.

    Args:
        image: linear radiance, (rows, columns, 3).
        nearest: distance of the nearest objects, metres, without the nearest 2 % of the pixels.
        farthest: likewise of the farthest.
        covered: share of the light that comes from splats, not from the background.
    """

    image: NDArray[np.float32]
    nearest: float
    farthest: float
    covered: float


def viewpoint_of(camera: PosedCamera, unit: float = 1.0) -> Viewpoint:
    """The viewpoint of an array that stands where a camera of a file stood.

    Args:
        camera: of a file.
        unit: length of the scene's unit, metres.
    """
    x, y, z = (float(a + b) for a, b in zip(camera.eye, camera.forward, strict=True))
    return Viewpoint(camera.eye, (x, y, z), camera.up, unit)


def cameras_around(splats: Splats) -> list[PosedCamera]:
    """Cameras for a scene without poses: eight around its middle, and four from its middle outwards.

    The middle is the median of the splats, and the circle around it shows 70 % of them.

    Args:
        splats: the scene; its ``up`` is the axis of the circle.
    """
    some = splats.positions[:: max(len(splats.positions) // 100_000, 1)].astype(np.float64)
    middle = np.median(some, axis=0)
    radius = max(float(np.percentile(np.linalg.norm(some - middle, axis=1), 70)), 1e-6)
    up = np.asarray(splats.up, dtype=np.float64)
    first = np.cross((1.0, 0.0, 0.0), up)  # towards a viewer at the origin, who looks as the format has it
    second = np.cross(up, first)
    found = []
    for number in range(_AROUND):
        angle = 2 * math.pi * number / _AROUND
        away = math.cos(_ELEVATION) * (math.cos(angle) * first + math.sin(angle) * second)
        away += math.sin(_ELEVATION) * up
        eye = middle + away * radius / math.sin(_FIELD_OF_VIEW / 2)
        found.append(_camera(f"around, {math.degrees(angle):.0f}°", eye, -away, up))
    for number in range(_INSIDE):
        angle = 2 * math.pi * number / _INSIDE
        ahead = -math.cos(angle) * first - math.sin(angle) * second
        found.append(_camera(f"inside, {math.degrees(angle):.0f}°", middle, ahead, up))
    return found


def _camera(name: str, eye: Any, forward: Any, up: Any) -> PosedCamera:
    three: Any = [tuple(float(part) for part in vector) for vector in (eye, forward, up)]
    return PosedCamera(name, three[0], three[1], three[2], _FIELD_OF_VIEW)


def seen(scene: SplatScene, field_of_view: float, pixels: tuple[int, int] = (_THUMBNAIL, _THUMBNAIL)) -> Seen:
    """What the middle view of an array sees, at a low resolution.

    Args:
        scene: the scene and its viewpoint.
        field_of_view: angle that the width of the view spans, radians.
        pixels: (rows, columns) of the array's views, for their proportions.

    Raises:
        NothingSeen: no object is opaque enough to have a depth.
    """
    factor = max(max(pixels) / _THUMBNAIL, 1)
    small = (max(round(pixels[0] / factor), 1), max(round(pixels[1] / factor), 1))
    view = CameraArray.over_aperture(1.0, field_of_view, views=(1, 1), pixels=small).camera(0, 0)
    image, depth, transmittance = scene.render_with_depth(view)
    solid = depth[np.isfinite(depth)]
    if not solid.size:
        eye = ", ".join(f"{part:.4g}" for part in scene.viewpoint.eye)
        raise NothingSeen(
            f"the view from ({eye}) shows no object: nothing in it absorbs half of the light. Choose another "
            "camera (--look lists some), or move the eye"
        )
    nearest, farthest = np.percentile(solid, _ENDS)
    return Seen(image, float(nearest), float(farthest), 1 - float(transmittance.mean()))


def arranged(
    found: Seen, slope_per_pixel: float, parallax: float = 1.0, focus_distance: float | None = None
) -> tuple[float, float]:
    """Spacing and focus distance of views between which the scene moves by a parallax.

    Args:
        found: what the middle view sees.
        slope_per_pixel: pixel pitch over focal length.
        parallax: largest displacement of an object from one view to the next, pixels.
        focus_distance: where the views converge, metres; None: between the nearest and the farthest object, so
            that both move alike.

    Returns:
        (spacing, focus distance), metres.

    Raises:
        InputError: a parallax or distance that is not above 0; a scene that is a plane at the focus distance.
    """
    checks.above_zero("parallax", parallax, "a displacement in pixels")
    ends = 1 / found.nearest, 1 / found.farthest
    focus = 2 / sum(ends) if focus_distance is None else focus_distance
    spread_of = max(abs(end - 1 / focus) for end in ends)
    if spread_of <= 1e-9 * ends[0]:
        if focus_distance is not None:
            raise InputError(f"all objects are at the focus distance, {focus:g} m: no spacing gives them parallax")
        spread_of = ends[0]  # a plane that faces the array
    return parallax * slope_per_pixel / spread_of, focus


def contact_sheet(
    splats: Splats,
    cameras: Sequence[PosedCamera],
    pixels: tuple[int, int],
    *,
    unit: float = 1.0,
    progress: Progress | None = None,
    **options: Any,
) -> tuple[Any, list[tuple[int, PosedCamera, Seen | None]]]:
    """Draw what cameras see, on one sheet.

    Args:
        splats: the scene.
        cameras: cameras; of more than `MOST_SEEN` an even selection is drawn.
        pixels: (rows, columns) of the views to come, for their proportions.
        unit: length of the scene's unit, metres.
        progress: called with (done, total) in cameras.
        options: further arguments of `SplatScene`.

    Returns:
        A Matplotlib figure; and for each camera of the sheet its number in ``cameras``, the camera, and what it
        sees, or None if it shows no object.
    """
    numbers = list(spread(len(cameras), MOST_SEEN))
    rows: list[tuple[int, PosedCamera, Seen | None]] = []
    for done, number in enumerate(numbers):
        tell(progress, done, len(numbers))
        try:
            scene = SplatScene(splats, viewpoint_of(cameras[number], unit), **options)
            rows.append((number, cameras[number], seen(scene, cameras[number].field_of_view, pixels)))
        except NothingSeen:
            rows.append((number, cameras[number], None))
    tell(progress, len(numbers), len(numbers))
    across = min(4, len(rows))
    down = -(-len(rows) // across)
    axes = new_axes(across * _INCHES, down * (_INCHES * pixels[0] / pixels[1] + 0.3), down, across, squeeze=False)
    for place in axes.flat:
        place.axis("off")
    for place, (number, camera, found) in zip(axes.flat, rows, strict=False):
        place.set_title(f"{number}: {camera.name[-28:]}", fontsize=SMALL, color=INK)
        if found is not None:
            place.imshow(encode(np.minimum(found.image, 1), 8))
    return axes[0, 0].figure, rows
