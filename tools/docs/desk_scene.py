"""A desk at dusk, for Mitsuba: glass, brass, lacquer, paper, cloth and leaves, small lamps and a town far away.

All of it is made here by code. Lengths are metres; the camera stands near the origin, y points up, and the scene
lies at z < 0, from twigs 0.4 m away to the town 60 m behind the window. What one would photograph stands at 0.8 to
1.1 m.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from desk_meshes import Mesh, box, leaf, sheet, together, tube, turned
from numpy.typing import NDArray

from vcc.showcase.scene import Town
from vcc.sources import CameraArray
from vcc.sources.mitsuba.scenes import looking
from vcc.sources.textures import Painting
from vcc.units import deg, mm

Array = NDArray[Any]
Plugin = dict[str, Any]
Colour = Sequence[float]

EYE, TARGET = (0.0, 0.175, 0.0), (0.0, 0.118, -0.9)
FOCUS = 0.9
"""Where the views converge: the glass ball and what stands beside it, metres."""
FIELD_OF_VIEW = 28 * deg
SPACING = 2 * mm


def cameras(views: tuple[int, int] = (9, 9), pixels: tuple[int, int] = (320, 480)) -> CameraArray:
    """Views 2 mm apart, 28° wide, that converge at 0.9 m."""
    slope = 2 * math.tan(FIELD_OF_VIEW / 2) / pixels[1]
    return CameraArray(views, pixels, SPACING, slope, FOCUS)


@dataclass(frozen=True)
class Workshop:
    """Makes Mitsuba's plugins; meshes are written into a folder."""

    folder: Path

    def mesh(self, mesh: Mesh, material: Plugin) -> Plugin:
        """A mesh of a material."""
        flat = {"face_normals": True} if mesh.normals is None else {}
        return {"type": "ply", "filename": str(mesh.write(self.folder)), "bsdf": material, **flat}


@functools.cache
def scene(folder: Path) -> Plugin:
    """The scene as `vcc.sources.mitsuba.MitsubaRenderer` takes it.

    Args:
        folder: there, for the meshes.
    """
    workshop = Workshop(folder)
    return {
        "type": "scene",
        "integrator": {"type": "path", "max_depth": 10},
        "sensor": {"type": "perspective", "to_world": looking(EYE, TARGET), "sampler": {"type": "multijitter"}},
        **_table(workshop),
        **_middle(workshop),
        **_behind(workshop),
        **_before(workshop),
        **_room(workshop),
        **_lights(),
    }


def _table(workshop: Workshop) -> dict[str, Plugin]:
    top = {
        "type": "principled",
        "base_color": _bitmap(_wood()),
        "roughness": 0.28,
        "specular": 0.45,
    }
    return {
        "table": {"type": "rectangle", "to_world": _placed((0, 0, -0.85), (1.0, 0.75, 1), tip=-90), "bsdf": top},
        "table_edge": _block(workshop, (0, -0.02, -1.6), (2.0, 0.038, 0.01), _matt((0.09, 0.045, 0.02))),
        "cloth": workshop.mesh(_cloth(), {"type": "twosided", "bsdf": _matt(_bitmap(_linen()))}),
    }


def _middle(workshop: Workshop) -> dict[str, Plugin]:
    """What is in focus: a glass ball on a ring, turned men, dice, a card, a jug, a tumbler."""
    glass = {"type": "dielectric", "int_ior": 1.5}
    red, black, ivory = _gloss((0.5, 0.012, 0.01)), _gloss((0.012, 0.012, 0.014)), _gloss((0.62, 0.52, 0.36))
    brass = {"type": "roughconductor", "material": "Cu", "alpha": 0.13, "distribution": "ggx"}
    gold = {"type": "roughconductor", "material": "Au", "alpha": 0.16, "distribution": "ggx"}
    things = {
        "ring": workshop.mesh(turned(_RING).moved(_placed((0.02, 0.012, -0.9))), gold),
        "ball": {"type": "sphere", "center": [0.02, 0.069, -0.9], "radius": 0.05, "bsdf": glass},
        "pawn": workshop.mesh(turned(_PAWN).moved(_placed((0.092, 0.003, -0.85))), red),
        "pawn2": workshop.mesh(turned(_PAWN).moved(_placed((-0.088, 0.003, -0.83), 0.92)), ivory),
        "king": workshop.mesh(turned(_KING).moved(_placed((0.082, 0.003, -1.10))), black),
        "jug": workshop.mesh(turned(_JUG).moved(_placed((-0.165, 0.002, -1.08))), brass),
        "handle": workshop.mesh(_handle().moved(_placed((-0.165, 0.002, -1.08), turn=205)), brass),
        "tumbler": workshop.mesh(turned(_TUMBLER).moved(_placed((-0.05, 0.003, -1.07))), glass),
        "card": workshop.mesh(
            sheet(lambda a, b: np.stack([0.12 * (a - 0.5), 0.08 * b, 0 * a - 0.012 * b], axis=-1), 2, 2).moved(
                _placed((0.17, 0.003, -0.99), turn=-12)
            ),
            {"type": "twosided", "bsdf": _matt(_bitmap(_card()))},
        ),
    }
    for n, (place, turn) in enumerate((((-0.036, 0.0, -0.83), 24), ((-0.006, 0.0, -0.80), -38))):
        die = box((0.019,) * 3, 0.22).moved(_placed((place[0], 0.012, place[2]), turn=turn))
        things[f"die{n}"] = workshop.mesh(die, _gloss(_bitmap(_pips())))
    return things


def _behind(workshop: Workshop) -> dict[str, Plugin]:
    """Books with an apple on them, and a plant in a pot."""
    books, height = {}, 0.0
    for n, (size, colour, turn) in enumerate(_BOOKS):
        middle = (0.23, height + size[1] / 2, -1.36)
        material = _satin(_bitmap(_spine(colour, n)))
        books[f"book{n}"] = workshop.mesh(box(size, 0.03).moved(_placed(middle, turn=turn)), material)
        height += size[1]
    apple = turned(_APPLE).moved(_placed((0.21, height, -1.34), 1.0, turn=215))
    pot = turned(_POT).moved(_placed((-0.37, 0, -1.42)))
    return {
        **books,
        "apple": workshop.mesh(apple, _gloss(_bitmap(_peel()))),
        "stalk": workshop.mesh(
            tube(
                [(0.21, height + 0.062, -1.34), (0.212, height + 0.075, -1.34), (0.218, height + 0.09, -1.338)],
                0.0018,
            ),
            _matt((0.08, 0.04, 0.02)),
        ),
        "pot": workshop.mesh(pot, _satin((0.45, 0.16, 0.07))),
        **_plant(workshop, (-0.37, 0.13, -1.42), 26, 5),
    }


def _before(workshop: Workshop) -> dict[str, Plugin]:
    """Twigs of ivy close to the camera, at the picture's left border and in its upper right corner."""
    twigs = (
        ([(-0.155, 0.02, -0.44), (-0.105, 0.10, -0.43), (-0.09, 0.17, -0.42), (-0.10, 0.235, -0.41)], 9, 3),
        ([(0.17, 0.26, -0.5), (0.12, 0.245, -0.47), (0.08, 0.222, -0.45)], 5, 11),
    )
    things: dict[str, Plugin] = {}
    for n, (path, count, seed) in enumerate(twigs):
        things |= _twig(workshop, f"twig{n}", path, count, seed)
    return things


def _room(workshop: Workshop) -> dict[str, Plugin]:
    """A wall with a window and a picture, 4.5 m away, and the town behind the window."""
    paper, wood = _matt(_bitmap(_wallpaper())), _matt((0.16, 0.12, 0.09))
    left, right, low, high, z = 0.2, 1.02, -0.12, 1.5, -4.5
    walls = {
        "wall_left": (-2.2, left, -1.2, 2.4),
        "wall_right": (right, 2.6, -1.2, 2.4),
        "wall_below": (left, right, -1.2, low),
    }
    things = {name: workshop.mesh(_panel(bounds, z), paper) for name, bounds in walls.items()}
    bars = {
        "sill": ((left + right) / 2, low, right - left + 0.16, 0.05),
        "bar_across": ((left + right) / 2, 0.5, right - left, 0.03),
    }
    posts = {"post0": left, "post1": (left + right) / 2, "post2": right}
    for name, (x, y, wide, high_) in bars.items():
        things[name] = _block(workshop, (x, y, z + 0.03), (wide, high_, 0.08), wood)
    for name, x in posts.items():
        things[name] = _block(workshop, (x, (low + high) / 2, z + 0.03), (0.035, high - low, 0.07), wood)
    y, x = np.mgrid[-0.95:0.55:600j, -1.0:1.0:800j]
    town = Town()(x[:1], y[:, :1])[..., :3]
    things["town"] = {
        "type": "rectangle",
        "to_world": _placed((7.5, 4.6, -60.0), (11.0, 8.25, 1)),
        "bsdf": _matt((0, 0, 0)),
        "emitter": {
            "type": "area",
            "radiance": _bitmap((1.6 * town[::-1]).astype(np.float32)),
            "sampling_weight": 0.3,
        },
    }
    things["frame"] = _block(workshop, (-0.62, 0.36, z + 0.02), (0.56, 0.44, 0.04), _satin((0.3, 0.2, 0.06)))
    things["painting"] = workshop.mesh(_panel((-0.86, -0.38, 0.18, 0.54), z + 0.045), _matt(_bitmap(_landscape())))
    return {**things, **_garlands(workshop)}


def _garlands(workshop: Workshop) -> dict[str, Plugin]:
    """Strings of small lamps that hang across the room."""
    things: dict[str, Plugin] = {}
    wire = _matt((0.02, 0.02, 0.02))
    strings = (
        ((-0.75, 0.50, -2.6), (0.85, 0.42, -2.9), 0.22, 15, 0.0055),
        ((-1.2, 0.42, -3.9), (1.2, 0.72, -3.6), 0.30, 17, 0.0075),
        ((-0.5, 0.36, -1.95), (0.7, 0.40, -2.1), 0.10, 10, 0.0042),
    )
    hues = (
        (1.0, 0.56, 0.2),
        (1.0, 0.62, 0.26),
        (1.0, 0.28, 0.1),
        (1.0, 0.66, 0.32),
        (0.3, 0.62, 1.0),
        (1.0, 0.6, 0.22),
    )
    for n, (start, end, sag, count, radius) in enumerate(strings):
        a = np.linspace(0, 1, 60)[:, None]
        path = np.array(start) + a * np.subtract(end, start) - 4 * sag * a * (1 - a) * np.array([0, 1, 0])
        things[f"wire{n}"] = workshop.mesh(tube(path, 0.0012, 6), wire)
        random = np.random.default_rng(n)
        for k in range(count):
            place = path[int((k + 0.5) / count * 60)] - (0, 1.6 * radius, 0) + random.uniform(-1, 1, 3) * 0.01
            hue = np.array(hues[(k + n) % len(hues)])
            things[f"lamp{n}_{k}"] = {
                "type": "sphere",
                "center": [float(value) for value in place],
                "radius": radius,
                "emitter": {"type": "area", "radiance": _rgb(9.0 * hue), "sampling_weight": 0.15},
            }
    return things


def _lights() -> dict[str, Plugin]:
    """A large warm lamp at the left, a smaller cold one behind at the right, and a dim room."""
    return {
        "key": _lamp((-0.75, 0.8, -0.35), (0.05, 0.05, -0.95), (0.26, 0.26), (19.0, 15.0, 10.5), 12.0),
        "rim": _lamp((0.95, 0.75, -1.75), (0.05, 0.05, -0.95), (0.2, 0.3), (5.0, 7.0, 10.0), 6.0),
        "room": {"type": "constant", "radiance": _rgb((0.07, 0.085, 0.12)), "sampling_weight": 3.0},
    }


_MM = 1e-3
_RING = np.array([(21, 0), (26, 0), (28, 4), (25, 8), (24, 12), (21, 8), (20, 4), (21, 0)]) * _MM
_PAWN = np.array(
    [(0, 0), (22, 0), (22, 0), (22.5, 5), (20, 9), (20, 9), (17, 11), (13, 16), (9, 30), (8, 42), (9, 47), (9, 47),
     (14, 49), (14, 52), (8.5, 54), (8.5, 54), (12, 58), (14.5, 66), (12.5, 74), (7, 79), (0, 81)]
) * _MM  # fmt: skip
_KING = np.array(
    [(0, 0), (27, 0), (27, 0), (27.5, 7), (25, 12), (25, 12), (20, 15), (14, 26), (10.5, 50), (10, 78), (11, 88),
     (11, 88), (17, 91), (17, 95), (11, 98), (11, 98), (12, 104), (18, 122), (19, 127), (19, 127), (15, 130),
     (6, 136), (6, 136), (4, 138), (6, 142), (5, 147), (0, 149)]
) * _MM  # fmt: skip
_JUG = np.array(
    [(0, 0), (44, 0), (44, 0), (46, 4), (44, 8), (56, 30), (62, 62), (54, 98), (36, 128), (28, 150), (30, 170),
     (38, 184), (40, 187), (38.5, 188), (36.5, 185), (29, 171), (27, 150), (34, 127), (52, 98), (60, 62), (54, 30),
     (40, 12), (0, 10)]
) * _MM  # fmt: skip
_TUMBLER = np.array(
    [(0, 0), (30, 0), (32, 2), (33, 8), (37, 60), (39.5, 112), (39.8, 114), (39, 115), (38, 114), (35.3, 60),
     (31.5, 18), (29, 13), (0, 11)]
) * _MM  # fmt: skip
_APPLE = np.array(
    [(0, 5), (8, 1), (18, 3), (32, 20), (38, 42), (34, 60), (22, 70), (10, 69), (4, 63), (0, 60)]
) * _MM  # fmt: skip
_POT = np.array(
    [(0, 0), (50, 0), (50, 0), (64, 108), (64, 108), (70, 108), (70, 108), (72, 130), (72, 130), (66, 130),
     (64, 118), (0, 118)]
) * _MM  # fmt: skip
_BOOKS = (
    ((0.25, 0.042, 0.17), (0.05, 0.10, 0.17), 6),
    ((0.23, 0.030, 0.16), (0.42, 0.09, 0.04), -4),
    ((0.20, 0.036, 0.14), (0.36, 0.29, 0.14), 11),
)


def _handle() -> Mesh:
    """Of the jug, along +x."""
    a = np.linspace(0, 1, 40)
    x = 0.034 + 0.062 * np.sin(math.pi * a) ** 0.8 + 0.018 * (1 - a)
    return tube(np.stack([x, 0.055 + 0.115 * a + 0.02 * np.sin(math.pi * a), 0 * a], axis=1), 0.0055, 16)


def _cloth() -> Mesh:
    """A runner that lies across the table with folds, its near edge wavy."""

    def surface(a: Array, b: Array) -> Array:
        x, y = 0.62 * (a - 0.5), 0.52 * (b - 0.5)
        fold = 0.019 * np.exp(-(((x + 0.19 + 0.25 * y) / 0.022) ** 2)) * (0.6 + 0.4 * np.sin(7 * y + 1))
        fold = fold + 0.021 * np.exp(-(((x - 0.24 - 0.3 * y) / 0.02) ** 2))
        fold = fold + 0.013 * np.exp(-(((y + 0.235 + 0.03 * np.sin(9 * x)) / 0.018) ** 2)) * (
            0.5 + 0.5 * np.sin(16 * x)
        )
        ripple = 0.0006 * np.sin(38 * x + 9 * y) * np.sin(23 * y)
        return np.stack([x, 0.0016 + fold + ripple, -y], axis=-1)

    return sheet(surface, 140, 160).moved(_placed((0.07, 0.0, -0.92), turn=-17))


def _twig(
    workshop: Workshop, name: str, path: list[tuple[float, float, float]], count: int, seed: int
) -> dict[str, Plugin]:
    """A stem through points, with leaves on both sides that look at the camera and hang a little."""
    random = np.random.default_rng(seed)
    corners = np.array(path)
    line = np.stack(
        [np.interp(np.linspace(0, 1, 50), np.linspace(0, 1, len(path)), corners[:, k]) for k in range(3)], 1
    )
    for _ in range(6):
        line[1:-1] = (line[:-2] + 2 * line[1:-1] + line[2:]) / 4
    leaves: list[list[Mesh]] = [[], []]
    for n in range(count):
        at = int((n + 0.6) / count * 48)
        heading = line[at + 1] - line[at]
        angle = math.degrees(math.atan2(heading[1], heading[0])) + (1 if n % 2 else -1) * random.uniform(35, 70)
        size = random.uniform(0.026, 0.038)
        blade = leaf(size, 0.62 * size, random.uniform(-0.1, 0.25), random.uniform(0.1, 0.4), 0.0012)
        pose = _rolled(angle) @ _placed((0, 0, 0), turn=random.uniform(-35, 35), tip=random.uniform(40, 100))
        pose[:3, 3] = line[at]
        leaves[n % 2].append(blade.moved(pose))
    things = {f"{name}_stem": workshop.mesh(tube(line, 0.0011), _matt((0.10, 0.07, 0.03)))}
    for k, blades in enumerate(leaves):
        material = {"type": "twosided", "bsdf": _satin(_bitmap(_blade(0.5 + 0.5 * k)))}
        things[f"{name}_leaves{k}"] = workshop.mesh(together(blades), material)
    return things


def _plant(workshop: Workshop, middle: tuple[float, float, float], count: int, seed: int) -> dict[str, Plugin]:
    """Long leaves that rise from a pot and bow."""
    random = np.random.default_rng(seed)
    blades = []
    for n in range(count):
        size = random.uniform(0.14, 0.26)
        blade = leaf(size, random.uniform(0.05, 0.075), random.uniform(0.25, 0.6), 0.35, 0.003)
        pose = _placed(middle, turn=n * 137.5) @ _rolled(random.uniform(28, 80))
        blades.append(blade.moved(pose))
    material = {"type": "twosided", "bsdf": _satin(_bitmap(_blade(0.2)))}
    return {"plant": workshop.mesh(together(blades), material)}


def _panel(bounds: tuple[float, float, float, float], z: float) -> Mesh:
    """An upright rectangle (left, right, low, high) that faces the camera."""
    left, right, low, high = bounds
    return sheet(
        lambda a, b: np.stack([left + a * (right - left), low + b * (high - low), 0 * a + z], axis=-1), 2, 2
    )


def _block(workshop: Workshop, middle: Sequence[float], size: Sequence[float], material: Plugin) -> Plugin:
    return workshop.mesh(box(size).moved(_placed(middle)), material)


def _grid(rows: int, columns: int) -> tuple[Array, Array]:
    """(x, y) of a texture's points, 0 to 1, shapes (1, columns) and (rows, 1); row 0 is the bottom."""
    return (np.arange(columns)[None] + 0.5) / columns, (np.arange(rows)[:, None] + 0.5) / rows


def _mixed(share: Array, low: Colour, high: Colour) -> Array:
    return np.asarray(np.array(low) + np.clip(share, 0, 1)[..., None] * (np.array(high) - np.array(low)))


def _waves(x: Array, y: Array, seed: int, octaves: int = 5) -> Array:
    """Waves in random directions, finer ones weaker, about −1 to 1.

    Args:
        x: shape (1, columns).
        y: shape (rows, 1).
        seed: of directions and phases.
        octaves: four waves each.
    """
    angle, phase = np.random.default_rng(seed).uniform(0, 2 * math.pi, (octaves, 4, 2)).reshape(-1, 2).T
    finer = np.repeat(2.0 ** np.arange(octaves), 4)
    turns = 2j * math.pi * 1.5 * finer
    across, up = np.exp(turns * np.cos(angle) * x.T), np.exp(turns * np.sin(angle) * y + 1j * phase) / finer
    return np.asarray((up @ across.T).imag / 4)


def _wood() -> Array:
    x, y = _grid(768, 1536)
    board = np.floor(y * 9)
    random = np.random.default_rng(4)
    tone = random.uniform(0.7, 1.05, 9)[board.astype(int)]
    grain = 0.5 + 0.5 * np.sin(2 * math.pi * (y * 70 + 2.0 * _waves(x * 1.6, y * 9 + 3 * board, 3)))
    fine = 0.5 + 0.5 * _waves(x * 5, y * 160, 9, 3)
    values = _mixed(0.2 + 0.5 * grain + 0.3 * fine, (0.075, 0.032, 0.014), (0.25, 0.12, 0.055)) * tone[..., None]
    seam = np.abs(y * 9 - np.round(y * 9)) < 0.012
    return values * np.where(seam, 0.3, 1.0)[..., None]


def _linen() -> Array:
    """Threads over and under one another, with blue stripes along one edge and the other."""
    rows, columns = 1280, 1280
    x, y = _grid(rows, columns)
    over, under = np.sin(2 * math.pi * 210 * x), np.sin(2 * math.pi * 180 * y)
    weave = 0.82 + 0.1 * over * under + 0.05 * _waves(x * 30, y * 4, 6, 3) + 0.05 * _waves(x * 4, y * 30, 7, 3)
    stripe = np.zeros((rows, columns))
    for place, width in ((0.1, 0.012), (0.13, 0.004), (0.155, 0.004), (0.9, 0.012), (0.87, 0.004), (0.845, 0.004)):
        stripe = np.maximum(stripe, (np.abs(x - place) < width) * 1.0)
        stripe = np.maximum(stripe, (np.abs(y - place) < width) * 0.9)
    colour = _mixed(stripe, (0.56, 0.51, 0.42), (0.05, 0.10, 0.24))
    return colour * weave[..., None]


def _wallpaper() -> Array:
    x, y = _grid(512, 512)
    diamonds = np.cos(2 * math.pi * x * 10) * np.cos(2 * math.pi * y * 14)
    return _mixed(0.5 + 0.5 * np.tanh(4 * (diamonds - 0.2)), (0.05, 0.10, 0.11), (0.085, 0.15, 0.155))


def _landscape() -> Array:
    """Hills in the haze."""
    x, y = _grid(240, 320)
    values = _mixed(y, (0.75, 0.5, 0.28), (0.2, 0.32, 0.5))
    for n, base in enumerate((0.62, 0.45, 0.27)):
        hill = base + 0.09 * _waves(x * 0.8, 0 * y + 0.3 * n, 20 + n, 3)
        shade = np.array([(0.32, 0.36, 0.36), (0.16, 0.24, 0.16), (0.05, 0.10, 0.05)][n])
        values = np.where((y < hill)[..., None], shade, values)
    return values


def _blade(warmth: float) -> Array:
    """Of a leaf: x along it, y across."""
    x, y = _grid(128, 256)
    across = np.abs(2 * y - 1)
    rib = np.exp(-((across / 0.035) ** 2))
    veins = np.exp(-((np.sin(2 * math.pi * (5.5 * (x - 0.28 * across))) / 0.2) ** 2)) * (1 - 0.6 * across)
    patches = 0.5 + 0.5 * _waves(x * 3, y * 2, 12, 4)
    green = _mixed(patches, (0.035, 0.12, 0.02), (0.09, 0.23, 0.03)) + warmth * np.array([0.07, 0.035, 0.0])
    return green + (0.16 * rib + 0.07 * veins)[..., None] * np.array([0.8, 1.0, 0.35])


def _peel() -> Array:
    x, y = _grid(256, 512)
    blush = 0.5 + 0.6 * np.sin(2 * math.pi * x) + 0.3 * _waves(x * 14, y * 2, 4, 3)
    values = _mixed(blush, (0.48, 0.36, 0.05), (0.48, 0.02, 0.015))
    dots = np.random.default_rng(1).random(blush.shape) > 0.996
    values[dots] += 0.12
    return np.clip(values, 0, 0.9)


def _pips() -> Array:
    """Six faces side by side: 1, 6, 2, 5, 3, 4."""
    size = 96
    faces = []
    far, spots = 0.26, {}
    diagonal, other = [(-far, -far), (far, far)], [(-far, far), (far, -far)]
    spots[1] = [(0.0, 0.0)]
    spots[2], spots[3] = diagonal, [*diagonal, (0.0, 0.0)]
    spots[4] = diagonal + other
    spots[5] = [*spots[4], (0.0, 0.0)]
    spots[6] = [*spots[4], (-far, 0.0), (far, 0.0)]
    x, y = _grid(size, size)
    for count in (1, 6, 2, 5, 3, 4):
        face = np.full((size, size, 3), (0.66, 0.6, 0.48))
        for a, b in spots[count]:
            radius = 0.15 if count == 1 else 0.1
            spot = np.hypot(x - 0.5 - a, y - 0.5 - b) < radius
            face[spot] = (0.45, 0.02, 0.02) if count == 1 else (0.02, 0.02, 0.02)
        faces.append(face)
    return np.concatenate(faces, axis=1)


def _card() -> Array:
    """A test card: a Siemens star, bars and letters."""
    y, x = np.mgrid[-50:50:800j, -75:75:1200j] * mm
    painting = Painting(x[:1], y[:, :1])
    painting.rectangle((-1.0, -1.0, 1.0, 1.0), (0.66, 0.63, 0.56), 0.1 * mm)
    ink, red = (0.02, 0.02, 0.022), (0.5, 0.03, 0.02)
    painting.star((-34 * mm, 8 * mm), 32 * mm, 24, ink, 0.2 * mm)
    painting.text("DESK AT DUSK", (-68 * mm, -44 * mm), 1.3 * mm, ink)
    painting.text("900 MM", (36 * mm, -41 * mm), 0.8 * mm, red)
    left = 2.0
    for width in (2.8, 2.0, 1.4, 1.0, 0.7):
        for n in range(4):
            start = left + 2 * n * width
            painting.rectangle((start * mm, -22 * mm, (start + width) * mm, -4 * mm), ink, 0.1 * mm)
        left += 8 * width + 1
    for n, colour in enumerate(((0.55, 0.03, 0.03), (0.7, 0.33, 0.02), (0.09, 0.32, 0.08), (0.02, 0.1, 0.42))):
        painting.rectangle(((5 + 16.5 * n) * mm, 2 * mm, (19.5 + 16.5 * n) * mm, 18 * mm), colour, 0.1 * mm)
    for n in range(4):
        grey = (0.03, 0.12, 0.3, 0.72)[n]
        painting.rectangle(((5 + 16.5 * n) * mm, 22 * mm, (19.5 + 16.5 * n) * mm, 38 * mm), (grey,) * 3, 0.1 * mm)
    return np.asarray(painting.values[::-1, :, :3])


def _spine(colour: Colour, number: int) -> Array:
    """A book's six faces side by side: cloth on top, below and on the spine (+z), pages on the others."""
    size = 256
    x, y = _grid(size, size)
    cloth = np.array(colour) * (0.9 + 0.12 * _waves(x * 40, y * 40, number, 2))[..., None]
    pages = np.array((0.6, 0.54, 0.42)) * (0.75 + 0.25 * np.sin(2 * math.pi * 24 * y))[..., None]
    pages = np.broadcast_to(np.where(((y < 0.1) | (y > 0.9))[..., None], np.array(colour), pages), cloth.shape)
    gold = (0.6, 0.42, 0.13)
    words = ("LIGHT FIELDS", "OPTICS", "APERTURES")[number % 3]
    dot = min(0.62 / (6 * len(words)), 0.014)
    print_ = Painting(x, (1 - y) / 6)  # a spine is some six times as long as it is high
    for place in (0.08, 0.11, 0.89, 0.92):
        print_.rectangle((place - 0.008, -1.0, place + 0.008, 1.0), gold, 1e-3)
    print_.text(words, (0.5 - 3 * dot * len(words), 1 / 12 - 3.5 * dot), dot, gold)
    spine = cloth * (1 - print_.values[..., 3:]) + print_.values[..., :3]
    return np.concatenate([pages, pages, cloth, cloth, spine, pages], axis=1)


def _rgb(colour: Colour) -> Plugin:
    return {"type": "rgb", "value": [float(part) for part in colour]}


def _bitmap(values: Array) -> Plugin:
    """Linear reflectance as it is; row 0 is the bottom of what it lies on."""
    bitmap = np.ascontiguousarray(np.clip(values, 0, None), dtype=np.float32)
    return {"type": "bitmap", "bitmap": bitmap, "raw": True, "filter_type": "bilinear"}


def _texture(colour: Colour | Plugin) -> Plugin:
    return colour if isinstance(colour, dict) else _rgb(colour)


def _matt(colour: Colour | Plugin) -> Plugin:
    return {"type": "diffuse", "reflectance": _texture(colour)}


def _gloss(colour: Colour | Plugin) -> Plugin:
    return {"type": "roughplastic", "diffuse_reflectance": _texture(colour), "alpha": 0.04, "nonlinear": True}


def _satin(colour: Colour | Plugin) -> Plugin:
    return {"type": "roughplastic", "diffuse_reflectance": _texture(colour), "alpha": 0.2}


def _lamp(place: Colour, target: Colour, half: tuple[float, float], radiance: Colour, weight: float) -> Plugin:
    """A rectangle that shines on a target."""
    return {
        "type": "rectangle",
        "to_world": looking(place, target) @ np.diag([*half, 1.0, 1.0]),
        "emitter": {"type": "area", "radiance": _rgb(radiance), "sampling_weight": weight},
    }


def _placed(
    place: Sequence[float], size: float | Sequence[float] = 1.0, *, turn: float = 0.0, tip: float = 0.0
) -> Array:
    """Scaled, then tipped about x, then turned about y (degrees), then moved."""
    a, b = math.radians(turn), math.radians(tip)
    about_y = np.array([[math.cos(a), 0, math.sin(a)], [0, 1, 0], [-math.sin(a), 0, math.cos(a)]])
    about_x = np.array([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]])
    matrix = np.eye(4)
    matrix[:3, :3] = about_y @ about_x @ np.diag(np.broadcast_to(size, 3))
    matrix[:3, 3] = place
    return matrix


def _rolled(angle: float) -> Array:
    """Turned about z, degrees."""
    a = math.radians(angle)
    matrix = np.eye(4)
    matrix[:2, :2] = [[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]]
    return matrix
