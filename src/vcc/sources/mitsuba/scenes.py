"""Small demo scenes for Mitsuba: its shapes and materials with procedural textures, at several depths each.

Lengths are metres. The camera is near the origin, y points up, and the scene lies at z < 0.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.units import deg, mm
from vcc.sources.views import CameraArray

Plugin = dict[str, Any]
Colour = tuple[float, float, float]
Place = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class DemoScene:
    """A scene and a suitable camera array.

    Args:
        name: name of the scene.
        summary: content and distances, in one line.
        scene: scene dict for `MitsubaRenderer`.
        aperture: side of the square that the views fill, metres.
        field_of_view: angle spanned by the width of an image, radians.
        focus_distance: distance at which the views converge, metres.
        distances: distances of the nearest and the farthest object, metres.
    """

    name: str
    summary: str
    scene: Plugin
    aperture: float
    field_of_view: float
    focus_distance: float
    distances: tuple[float, float]

    def cameras(self, views: tuple[int, int] = (20, 20), pixels: tuple[int, int] = (500, 500)) -> CameraArray:
        """The array of cameras for which the scene was designed.

        Args:
            views: (rows, columns) of views.
            pixels: (rows, columns) of pixels of a view.
        """
        return CameraArray.over_aperture(
            self.aperture, self.field_of_view, views=views, pixels=pixels, focus_distance=self.focus_distance
        )


def demo_scene(name: str) -> DemoScene:
    """A demo scene: ``"still-life"``, ``"columns"`` or ``"lamps"``.

    Raises:
        InputError: an unknown name.
    """
    if name not in SCENES:
        raise InputError(f'there is no scene "{name}"; there are {", ".join(SCENES)}')
    return SCENES[name]()


def still_life() -> DemoScene:
    """Glass, gold, glossy paint and a chequered globe on a wooden table under a soft lamp."""
    things = {
        "table": _floor(_wood(), 2.6, 0.0, reflectance=0.04, middle=-1.5),
        "wall": _thing("rectangle", (0, 0.9, -2.6), (2.4, 1.4, 1), _matt(_picture(_damask(), smooth=True))),
        "glass": _ball((-0.15, 0.085, -0.98), 0.085, {"type": "dielectric", "int_ior": 1.5}),
        "gold": _ball((0.13, 0.12, -1.42), 0.12, {"type": "roughconductor", "material": "Au", "alpha": 0.12}),
        "die": _thing("cube", (0.33, 0.07, -1.16), (0.07,) * 3, _gloss((0.55, 0.03, 0.03)), turn=28),
        "bead": _ball((0.06, 0.04, -0.82), 0.04, _gloss((0.02, 0.3, 0.32))),
        "globe": _ball((-0.42, 0.2, -1.85), 0.2, _gloss(_checks((0.85, 0.8, 0.65), (0.1, 0.16, 0.35), 12, 8))),
        "cup": _column((0.52, 0.0, -1.9), 0.11, 0.3, _rough((0.3, 0.42, 0.12))),
        "rim": _thing("disk", (0.52, 0.3, -1.9), (0.11,) * 3, _rough((0.3, 0.42, 0.12)), tip=-90),
        "lamp": _lamp((-0.9, 1.9, -0.6), (0.2, 0.0, -1.4), (0.8, 0.8), (7.0, 6.4, 5.5)),
        "room": {"type": "constant", "radiance": _rgb((0.42, 0.47, 0.56))},
    }
    return DemoScene(
        "still-life",
        "a table with glass, gold, glossy paint and a globe, 0.7 to 2.6 m away",
        _scene(things, eye=(0, 0.38, 0), target=(0, 0.12, -1.4)),
        aperture=30 * mm,
        field_of_view=40 * deg,
        focus_distance=1.3,
        distances=(0.6, 2.7),
    )


def columns() -> DemoScene:
    """Two rows of stone columns on a polished chequered floor, each with a ball of another material."""
    balls: list[Plugin] = [
        {"type": "roughconductor", "material": "Cu", "alpha": 0.1},
        {"type": "dielectric", "int_ior": 1.5},
        _gloss((0.05, 0.12, 0.5)),
        {"type": "roughconductor", "material": "Au", "alpha": 0.15},
        _gloss((0.6, 0.25, 0.02)),
        _gloss((0.03, 0.35, 0.12)),
        {"type": "roughconductor", "material": "Ag", "alpha": 0.08},
        _gloss((0.5, 0.02, 0.12)),
    ]
    stone = _matt(_picture(_marble(), smooth=True))
    tiles = _checks((0.7, 0.68, 0.62), (0.09, 0.09, 0.1), 18, 18)
    things: dict[str, Plugin] = {"floor": _floor(tiles, 5.4, 0.0, reflectance=0.04, middle=-4.5)}
    for n, ball in enumerate(balls):
        side, depth = (-1 if n % 2 else 1), 1.15 * 1.3**n
        place = (side * (0.24 + 0.1 * depth), 0.0, -depth)
        things[f"shaft{n}"] = _column(place, 0.075, 0.5, stone)
        things[f"slab{n}"] = _thing("cube", (place[0], 0.515, place[2]), (0.1, 0.015, 0.1), stone)
        things[f"base{n}"] = _thing("cube", (place[0], 0.02, place[2]), (0.1, 0.02, 0.1), stone)
        things[f"ball{n}"] = _ball((place[0], 0.62, place[2]), 0.09, ball)
    things["sky"] = _thing("rectangle", (0, 2.5, -9.8), (12, 5, 1), _matt(_picture(_dusk(), smooth=True)))
    things["sun"] = _lamp((3.2, 4.2, -1.0), (0, 0, -3.0), (0.9, 0.9), (22.0, 18.0, 13.0))
    things["room"] = {"type": "constant", "radiance": _rgb((0.35, 0.4, 0.5))}
    return DemoScene(
        "columns",
        "columns with balls of metal, glass and paint on a polished floor, 1.1 to 9.8 m away",
        _scene(things, eye=(0, 0.62, 0), target=(0, 0.42, -3.0)),
        aperture=40 * mm,
        field_of_view=45 * deg,
        focus_distance=2.5,
        distances=(1.0, 9.8),
    )


def lamps() -> DemoScene:
    """Small lamps in the dark over a glossy floor: out of focus, each lamp is an image of the aperture."""
    random = np.random.default_rng(5)
    hues = [(1.0, 0.55, 0.18), (1.0, 0.75, 0.4), (0.95, 0.25, 0.12), (0.25, 0.55, 1.0), (0.4, 1.0, 0.55)]
    things: dict[str, Plugin] = {
        "floor": _floor(_rgb((0.05, 0.05, 0.06)), 4.0, 0.0, reflectance=0.06, middle=-3.5),
        "wall": _thing("rectangle", (0, 1.2, -6.0), (5, 2.4, 1), _matt(_rgb((0.06, 0.07, 0.11)))),
        "glass": _ball((-0.16, 0.11, -1.3), 0.11, {"type": "dielectric", "int_ior": 1.5}),
        "card": _thing(
            "rectangle",
            (0.16, 0.13, -1.36),
            (0.13, 0.13, 1),
            {"type": "twosided", "bsdf": _matt(_checks((0.8, 0.78, 0.7), (0.05, 0.05, 0.07), 10, 10))},
            turn=-18,
        ),
        "silver": _ball((0.5, 0.09, -1.62), 0.09, {"type": "roughconductor", "material": "Ag", "alpha": 0.1}),
        "room": {"type": "constant", "radiance": _rgb((0.03, 0.036, 0.05))},
        "key": _lamp((-0.9, 1.5, -0.3), (0.0, 0.1, -1.4), (0.25, 0.25), (60.0, 54.0, 45.0)),
    }
    # The key lamp gives most of the light: sampling it more often reduces noise.
    things["key"]["emitter"]["sampling_weight"] = 40.0
    for n in range(22):
        depth = 2.0 + 3.6 * random.random()
        place = (random.uniform(-0.36, 0.36) * depth, random.uniform(0.12, 0.36) * depth, -depth)
        hue = np.array(hues[n % len(hues)])
        things[f"lamp{n}"] = {
            "type": "sphere",
            "to_world": _at(place, (0.003 * depth,) * 3),
            "emitter": {"type": "area", "radiance": _rgb(tuple(60.0 * hue))},
        }
    return DemoScene(
        "lamps",
        "a glass ball and a card before small lamps in the dark, 1.2 to 6 m away",
        _scene(things, eye=(0, 0.3, 0), target=(0, 0.3, -1.4)),
        aperture=40 * mm,
        field_of_view=40 * deg,
        focus_distance=1.35,
        distances=(1.1, 6.0),
    )


SCENES: dict[str, Callable[[], DemoScene]] = {
    "still-life": still_life,
    "columns": columns,
    "lamps": lamps,
}
"""The demo scenes by name."""


def _scene(things: dict[str, Plugin], eye: Place, target: Place) -> Plugin:
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 9},
        "sensor": {"type": "perspective", "to_world": looking(eye, target), "sampler": {"type": "multijitter"}},
        **things,
    }


def _rgb(colour: Sequence[float]) -> Plugin:
    return {"type": "rgb", "value": [float(part) for part in colour]}


def _texture(colour: Colour | Plugin) -> Plugin:
    return colour if isinstance(colour, dict) else _rgb(colour)


def _matt(colour: Colour | Plugin) -> Plugin:
    return {"type": "diffuse", "reflectance": _texture(colour)}


def _gloss(colour: Colour | Plugin) -> Plugin:
    return {"type": "plastic", "diffuse_reflectance": _texture(colour), "nonlinear": True}


def _rough(colour: Colour | Plugin) -> Plugin:
    return {"type": "roughplastic", "diffuse_reflectance": _texture(colour), "alpha": 0.15}


def _floor(colour: Colour | Plugin, size: float, height: float, reflectance: float, middle: float) -> Plugin:
    """A polished square of the given half side, facing up."""
    material = {
        "type": "principled",
        "base_color": _texture(colour),
        "roughness": 0.18,
        "specular": 10 * reflectance,
    }
    return _thing("rectangle", (0, height, middle), (size, size, 1), material, tip=-90)


def _thing(
    shape: str, middle: Place, size: Place, material: Plugin, *, turn: float = 0.0, tip: float = 0.0
) -> Plugin:
    return {"type": shape, "to_world": _at(middle, size, turn=turn, tip=tip), "bsdf": material}


def _ball(middle: Place, radius: float, material: Plugin) -> Plugin:
    return _thing("sphere", middle, (radius,) * 3, material, turn=20, tip=-90)


def _column(foot: Place, radius: float, height: float, material: Plugin) -> Plugin:
    return _thing("cylinder", foot, (radius, radius, height), material, tip=-90)


def _lamp(place: Place, target: Place, size: tuple[float, float], colour: Colour) -> Plugin:
    """A rectangular lamp that faces a target; a rectangle's normal is its z axis, as a camera's direction is."""
    scale = np.diag([*size, 1.0, 1.0])
    return {
        "type": "rectangle",
        "to_world": looking(place, target) @ scale,
        "emitter": {"type": "area", "radiance": _rgb(colour)},
    }


def _checks(one: Colour, other: Colour, across: float, down: float) -> Plugin:
    return {
        "type": "checkerboard",
        "color0": _rgb(one),
        "color1": _rgb(other),
        "to_uv": np.diag([across / 2, down / 2, 1.0, 1.0]),
    }


def _picture(values: NDArray[np.float32], smooth: bool) -> Plugin:
    """A bitmap of linear reflectance ("raw": not decoded as sRGB)."""
    return {
        "type": "bitmap",
        "bitmap": values,
        "raw": True,
        "filter_type": "bilinear" if smooth else "nearest",
    }


def _at(place: Place, size: Place, *, turn: float = 0.0, tip: float = 0.0) -> NDArray[np.float64]:
    """Transform that scales, then tips about x, then turns about y (degrees), then translates."""
    a, b = math.radians(turn), math.radians(tip)
    about_y = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    about_x = np.array([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]])
    matrix = np.eye(4)
    matrix[:3, :3] = about_y @ about_x @ np.diag(size)
    matrix[:3, 3] = place
    return matrix


def looking(eye: Place, target: Place) -> NDArray[np.float64]:
    """Pose of a Mitsuba camera at ``eye`` that looks at ``target``: z ahead, y up, x to the left."""
    ahead = np.subtract(target, eye)
    ahead = ahead / np.linalg.norm(ahead)
    left = np.cross((0.0, 1.0, 0.0), ahead)
    left /= np.linalg.norm(left)
    matrix = np.eye(4)
    matrix[:3, :4] = np.stack([left, np.cross(ahead, left), ahead, np.asarray(eye, dtype=float)], axis=1)
    return matrix


def _grid(rows: int, columns: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """(x, y) of a texture's points, 0 to 1."""
    y, x = np.mgrid[:rows, :columns]
    return (x + 0.5) / columns, (y + 0.5) / rows


def _mixed(share: NDArray[Any], low: Colour, high: Colour) -> NDArray[np.float32]:
    return np.asarray(np.array(low) + share[..., None] * (np.array(high) - np.array(low)), dtype=np.float32)


def _noise(x: NDArray[Any], y: NDArray[Any], seed: int) -> NDArray[Any]:
    """Waves in random directions with amplitude falling with frequency, about −1 to 1."""
    random = np.random.default_rng(seed)
    total = np.zeros_like(x)
    for octave in range(5):
        for _ in range(4):
            angle, phase = random.uniform(0, 2 * math.pi, 2)
            along = x * math.cos(angle) + y * math.sin(angle)
            total += np.sin(2 * math.pi * 2**octave * 1.5 * along + phase) / 2**octave
    return np.asarray(total / 4)


def _wood() -> Plugin:
    """Planks, with grain along them."""
    x, y = _grid(1024, 1024)
    plank = np.floor(x * 16)
    tone = np.random.default_rng(2).uniform(0.55, 1.0, 16)[plank.astype(int)]
    grain = 0.5 + 0.5 * np.sin(2 * math.pi * (x * 90 + 2.2 * _noise(x * 10 + 7 * plank, y * 1.5, 3)))
    values = _mixed(0.25 + 0.5 * grain, (0.2, 0.09, 0.035), (0.46, 0.26, 0.12)) * tone[..., None]
    seam = np.abs(x * 16 - np.round(x * 16)) < 0.02
    values[seam] *= 0.35
    return _picture(values.astype(np.float32), smooth=True)


def _damask() -> NDArray[np.float32]:
    """A wall's pattern: rows of soft diamonds."""
    x, y = _grid(512, 896)
    wave = np.cos(2 * math.pi * x * 14) * np.cos(2 * math.pi * y * 8)
    return _mixed(0.5 + 0.5 * np.tanh(4 * (wave - 0.25)), (0.3, 0.36, 0.33), (0.5, 0.53, 0.46))


def _marble() -> NDArray[np.float32]:
    x, y = _grid(512, 512)
    veins = np.abs(np.sin(2 * math.pi * (1.5 * x + y + 0.45 * _noise(x, y, 11)))) ** 0.35
    return _mixed(veins, (0.32, 0.3, 0.3), (0.78, 0.75, 0.7))


def _dusk() -> NDArray[np.float32]:
    """A painted sky, warm at the horizon and blue above, with streaks of cloud; row 0 is the bottom."""
    x, y = _grid(512, 1024)
    cloud = np.clip(_noise(x * 2, y * 7, 8), 0, 1)
    sky = _mixed(np.clip(2.6 * (y - 0.28), 0, 1), (0.95, 0.55, 0.3), (0.15, 0.3, 0.65))
    streaks = 0.25 * cloud[..., None] * np.array([1.0, 0.75, 0.6])
    return np.asarray((sky + streaks).clip(0, 1), dtype=np.float32)
