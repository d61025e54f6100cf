"""Scenes of the zoo: drawn ones, and light fields or splats of the user by path."""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import check_path
from vcc.formats import open_light_field
from vcc.light_field import LightField
from vcc.showcase.scene import demo_scene
from vcc.sources import CameraArray, PlanesScene, TexturedPlane
from vcc.sources.splats import SplatScene
from vcc.sources.textures import Painting, soft
from vcc.store import is_store, open_store
from vcc.zoo.bench import BLUR, FOCUS, SHAPE, SIDE, SLOPE, distance_of

Array = NDArray[Any]

VIEWS = 25
"""Views across the square of scenes that can be rendered: less than half a pixel from view to view."""
MARGIN = 30
"""Pixels of views beyond the sensor's at each side, for objects out of focus."""
LEAST_MARGIN = 12
PIXELS = (SHAPE[0] + 2 * MARGIN, SHAPE[1] + 2 * MARGIN)
LEAVES = r"leaves-(\d{1,9})"
WIDE = 0.5
"""Field of view of views of splats, as a slope."""
BUILT_IN = ("drawn", "leaves-1", "leaves-2")
"""Scenes of a run without ``--scene``."""
ESTIMATED = "found "
"""How the source of disparities begins that were estimated from the views: no ground truth."""
SPLATS = (".spz", ".splat", ".ply", ".glb")


@dataclass(frozen=True, eq=False, repr=False)
class Scene(Brief):
    """A scene through the square at the lens.

    Args:
        name: as the user gave it.
        field: grey, white 1, in the geometry of `vcc.zoo.bench`.
        blur: of the object in the middle of each pixel through the whole square, pixels, upright, of `SHAPE`:
            positive before the focus (the ground truth of depth). None if unknown.
        note: what differs from the rules; empty if nothing does.
    """

    name: str
    field: LightField
    blur: Array | None
    note: str = ""

    @property
    def sharp(self) -> Array:
        """What a pinhole in the middle of the lens sees, upright, white 1: the truth, of `SHAPE`."""
        view = self.field.view(*(n // 2 for n in self.field.shape[:2])).to_numpy()
        return np.asarray(cropped(view, SHAPE), np.float64)


@dataclass(frozen=True)
class Leaves:
    """Discs of all sizes over one another, "dead leaves", whose statistics are those of photographs.

    Radii are distributed as 1/r³ (Lee, Mumford and Huang, Occlusion models for natural images, 2001).

    Args:
        seed: of places, sizes, shades and stripes.
        width: of the square in which they lie, metres.
        count: their number.
        ground: shade behind them; None leaves the gaps clear.
    """

    seed: int
    width: float
    count: int
    ground: float | None = None

    def __call__(self, x: Array, y: Array) -> Array:
        """Colour times opacity, and opacity, at positions in metres, (..., 4)."""
        painting, random, half = Painting(x, y), np.random.default_rng(self.seed), self.width / 2
        if self.ground is not None:
            painting.rectangle((-2 * half, -2 * half, 2 * half, 2 * half), [self.ground] * 3, half / 50)
        for _ in range(self.count):
            cx, cy = random.uniform(-half, half, 2)
            radius = self.width * min(0.015 / math.sqrt(1 - 0.99 * random.random()), 0.2)
            shade, depth, turn = random.random() ** 1.5, random.uniform(0, 0.9), random.uniform(0, math.pi)
            waves = 2 * math.pi / (self.width * random.uniform(0.02, 0.1))
            striped = random.random() < 0.5

            def disc(x: Array, y: Array, at: tuple[float, ...] = (cx, cy, radius, shade, depth, turn, waves),
                     striped: bool = striped) -> tuple[Array, Array]:  # fmt: skip
                cx, cy, radius, shade, depth, turn, waves = at
                along = (x - cx) * math.cos(turn) + (y - cy) * math.sin(turn)
                light = shade * (1 - depth * (0.5 + 0.5 * np.cos(waves * along)) * striped)
                opacity = soft(radius - np.hypot(x - cx, y - cy), radius / 10)
                return opacity, np.repeat(np.asarray(light)[..., None], 3, axis=-1)

            reach = 1.1 * radius
            painting.paint((cx - reach, cy - reach, cx + reach, cy + reach), disc)
        return painting.values


def leaves(seed: int) -> PlanesScene:
    """Four sheets of leaves: the nearest and the farthest distance of the rules, and two drawn between them."""
    random = np.random.default_rng([29, seed])
    planes: list[TexturedPlane] = []
    for blur in (-BLUR, *np.sort(random.uniform(-0.7 * BLUR, 0.7 * BLUR, 2)), BLUR):
        distance = distance_of(float(blur))
        width = 1.3 * max(PIXELS) * SLOPE * distance + SIDE
        last, number = not planes, int(random.integers(2**31))
        ground = random.uniform(0.2, 0.8) if last else None
        planes.append(TexturedPlane(Leaves(number, width, 250 if last else 14, ground), distance))
    return PlanesScene(planes)


def identity(name: str) -> str:
    """What the content of a scene depends on: its name and size, or the bytes of its files.

    Raises:
        InputError: no scene of this name, and no such path.
    """
    if name == "drawn" or re.fullmatch(LEAVES, name):
        return f"{name}, {VIEWS} views of {PIXELS}"
    path, digest = Path(name).expanduser(), hashlib.sha256()
    check_path(path, f"scene (by name there are {', '.join(BUILT_IN)}, and leaves-N)")
    for file in sorted(path.rglob("*")) if path.is_dir() else [path]:
        if file.is_file():
            digest.update(str(file.relative_to(path)).encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    return f"files {digest.hexdigest()[:16]}, {VIEWS} views of {PIXELS}"


@lru_cache(maxsize=2)
def scene(name: str) -> Scene:
    """A scene by name, "drawn" or "leaves-N" with a seed N, or by the path of a light field or of splats.

    Raises:
        InputError: neither, views that are too small or too few, or no parallax.
    """
    if name == "drawn":
        planes = demo_scene()
        near, far = 1 / planes.distances[0], 1 / planes.distances[-1]
        slope = 0.407 / (PIXELS[1] - 2 * MARGIN)
        cameras = _array((near + far) / 2, (near - far) / 2, slope)
        return _of_planes(name, planes, cameras)
    if match := re.fullmatch(LEAVES, name):
        cameras = CameraArray((VIEWS, VIEWS), PIXELS, SIDE / VIEWS, SLOPE, FOCUS)
        return _of_planes(name, leaves(int(match[1])), cameras)
    path = Path(name).expanduser()
    check_path(path, f"scene (by name there are {', '.join(BUILT_IN)}, and leaves-N)")
    return _of_splats(name, path) if path.suffix.lower() in SPLATS else _of_views(name, path)


def _array(vergence: float, reach: float, slope: float) -> CameraArray:
    """Views of a scene whose 1/Z spans vergence ± reach, such that its ends are blurred by `BLUR` pixels."""
    return CameraArray((VIEWS, VIEWS), PIXELS, BLUR * slope / reach / VIEWS, slope, 1 / vergence)


def _of_planes(name: str, planes: PlanesScene, cameras: CameraArray) -> Scene:
    made = planes.light_field(
        cameras.views,
        cameras.pixels,
        spacing=cameras.spacings[1],
        slope_per_pixel=cameras.slopes_per_pixel[1],
        focus_distance=cameras.focus_distance,
        dtype="float32",
    )
    s, t = (
        (np.arange(n) - (n - 1) / 2) * cameras.slopes_per_pixel[1] for n in (cameras.pixels[1], cameras.pixels[0])
    )
    cell = (cameras.slopes_per_pixel[1],) * 2
    blur, most = np.zeros(cameras.pixels), np.zeros(cameras.pixels)
    through = np.ones(cameras.pixels)
    for plane in planes.planes:
        opacity = plane.along(np.zeros(()), np.zeros(()), s[None, :], t[:, None], cell)[1][..., 3]
        share = through * opacity
        through = through * (1 - opacity)
        blur = np.where(share > most, VIEWS * cameras.disparity(plane.distance), blur)
        most = np.maximum(most, share)
    values = np.asarray(made.values).mean(axis=-1)
    return Scene(name, _declared(values, 0.0), cropped(blur[::-1, ::-1], SHAPE))  # s runs to the left


def _of_splats(name: str, path: Path) -> Scene:
    """Views of splats from the file's own viewpoint, about 28° wide."""
    splats = SplatScene(path)
    slope = WIDE / PIXELS[1]
    _, depth, _ = splats.render_with_depth(CameraArray((1, 1), PIXELS, 1.0, slope, 1.0).camera(0, 0))
    seen = depth[np.isfinite(depth)]
    if seen.size < depth.size / 10:
        raise InputError(f"{name} shows hardly anything from its viewpoint: give a light field (vcc synth splats)")
    near, far = (float(n) for n in 1 / np.percentile(seen, (0.5, 99.5)))
    cameras = _array((near + far) / 2, (near - far) / 2, slope)
    views = np.empty(cameras.shape, np.float32)
    for row, column in np.ndindex(VIEWS, VIEWS):
        views[row, column] = splats.render(cameras.camera(row, column)).mean(axis=-1)
    white = float(np.percentile(views[VIEWS // 2, VIEWS // 2], 99.5))
    disparity = cameras.spacings[1] / slope * (1 / depth.astype(np.float64) - 1 / cameras.focus_distance)
    values = np.minimum(views / white, 1)
    return Scene(name, _declared(values, 0.0), cropped(VIEWS * disparity, SHAPE))


def _of_views(name: str, path: Path) -> Scene:
    """A light field of the user: pixels summed such that its ends are blurred by about `BLUR` pixels."""
    field = open_store(path).read() if is_store(path) else open_light_field(path)
    nv, nu = field.shape[:2]
    if min(nv, nu) < 3 or nv % 2 == 0 or nu % 2 == 0:
        raise InputError(f"{name} has {nv}×{nu} views: the zoo takes odd numbers of 3 or more, for a middle view")
    maps = field.grid.disparities.maps()
    views = [] if maps.source.startswith(ESTIMATED) else [tuple(map(int, view)) for view in maps.views]
    exact = maps.values[views.index((nv // 2, nu // 2))] if (nv // 2, nu // 2) in views else None
    ends = field.measured_disparity_range() if exact is None else (float(exact.min()), float(exact.max()))
    if ends is None or ends[0] == ends[1]:
        raise InputError(f"{name} shows no parallax: there is no blur to remove")
    bins = max(1, round(nu * (ends[1] - ends[0]) / 2 / BLUR))
    values = np.asarray(field.values, np.float32)
    values = values.mean(axis=-1) if values.ndim == 5 else values
    rows, columns = (n // bins for n in values.shape[2:])
    values = values[:, :, : rows * bins, : columns * bins].reshape(nv, nu, rows, bins, columns, bins).mean((3, 5))
    if rows < SHAPE[0] + 2 * LEAST_MARGIN or columns < SHAPE[1] + 2 * LEAST_MARGIN:
        raise InputError(
            f"{name} has views of {rows}×{columns} pixels after {bins}×{bins} are summed, and the zoo takes "
            f"{SHAPE[0] + 2 * LEAST_MARGIN}×{SHAPE[1] + 2 * LEAST_MARGIN} or more: give views of more pixels"
        )
    white = float(np.percentile(values[nv // 2, nu // 2], 99.5))
    if not white > 0:
        raise InputError(f"{name} is dark in its middle view")
    middle = (ends[0] + ends[1]) / 2
    blur = None
    if exact is not None:
        one_of_each = exact[: rows * bins : bins, : columns * bins : bins]
        blur = cropped(nu * (one_of_each - middle) / bins, SHAPE)
    reached = nu * (ends[1] - ends[0]) / 2 / bins
    note = f"{nu} views across, {(ends[1] - ends[0]) / 2 / bins:.2g} pixels apart at the ends; blur {reached:.3g}"
    return Scene(name, _declared(np.minimum(values / white, 1), middle / bins), blur, note)


def _declared(values: Array, disparity: float) -> LightField:
    """Views in the geometry of the rules: through `SIDE`, with objects of this disparity at `FOCUS`."""
    spacing = SIDE / values.shape[1]
    focus = 1 / (1 / FOCUS - disparity * SLOPE / spacing)
    reach = BLUR / values.shape[1]
    ends = (disparity - 1.3 * reach, disparity + 1.3 * reach)
    return LightField.from_views(
        np.ascontiguousarray(values, np.float32), spacing, SLOPE, focus, disparity_range=ends
    )


def cropped(picture: Array, shape: tuple[int, int]) -> Array:
    """The middle of a picture."""
    top, left = ((n - m) // 2 for n, m in zip(picture.shape, shape, strict=True))
    return picture[top : top + shape[0], left : left + shape[1]]
