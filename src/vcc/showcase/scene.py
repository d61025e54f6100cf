"""The demo's own scene: leaves before a test chart before a town at dusk, fully procedural.

It has three planes at three distances, so that one image shows depth of field (leaves, chart and town are
never sharp together), occlusion (leaves over chart over town), detail down to a pixel (the chart's star, bars
and letters) and the shape of the aperture (each lamp of the town, out of focus, is an image of it).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from vcc.base.units import mm
from vcc.sources import PlanesScene, TexturedPlane
from vcc.sources.textures import Array, Colour, Painting, soft

NEAR, MIDDLE, FAR = 0.8, 1.3, 3.0
"""Distances of the leaves, the chart and the town, metres."""

PLACES = {
    "leaves before the chart": (-0.128, -0.085, MIDDLE),
    "the chart's star": (-0.046, 0.030, MIDDLE),
    "lamps of the town": (0.48, -0.335, FAR),
}
"""Places for close-ups: (X, Y, distance), metres."""
CHECK_PLACES = {
    "star": (-0.054, 0.026, MIDDLE),
    "letters": (0.068, 0.120, MIDDLE),
    "leaf": (-0.150, -0.020, NEAR),
}
"""Further places, with fine print and fine edges."""


def demo_scene() -> PlanesScene:
    """Leaves at 0.8 m, a test chart at 1.3 m and a town at dusk at 3 m; about 23° wide.

    Returns:
        A `PlanesScene` whose radiance lies between 0 and 1, linear, three channels.
    """
    return PlanesScene(
        [
            TexturedPlane(Foliage(), NEAR),
            TexturedPlane(Chart(), MIDDLE, middle=(18 * mm, 4 * mm)),
            TexturedPlane(Town(), FAR),
        ]
    )


@dataclass(frozen=True)
class Foliage:
    """Two twigs with leaves, transparent between them; made for a distance of 0.8 m."""

    edge: float = 0.5 * mm

    def __call__(self, x: Array, y: Array) -> Array:
        """Colour times opacity and opacity at positions in metres, (..., 4)."""
        painting = Painting(x, y)
        random = np.random.default_rng(7)
        self._twig(painting, random, (-205.0, 120.0), (-150.0, -20.0), (-60.0, -150.0), 17)
        self._twig(painting, random, (215.0, 95.0), (140.0, 128.0), (60.0, 178.0), 9)
        self._twig(painting, random, (-190.0, 205.0), (-130.0, 150.0), (-70.0, 158.0), 6)
        return painting.values

    def _twig(
        self,
        painting: Painting,
        random: np.random.Generator,
        start: tuple[float, float],
        bend: tuple[float, float],
        end: tuple[float, float],
        leaves: int,
    ) -> None:
        """A twig along a parabola through three points in millimetres, with leaves on both sides."""
        a, b, c = (np.array(point) * mm for point in (start, bend, end))
        along = np.linspace(0, 1, 90)[:, None]
        points = (1 - along) ** 2 * a + 2 * along * (1 - along) * b + along**2 * c
        for n, (x, y) in enumerate(points):
            painting.disc((float(x), float(y)), (2.6 - 0.018 * n) * mm, (0.16, 0.085, 0.035), self.edge)
        for n in range(leaves):
            place = (n + 0.7) / leaves
            here = (1 - place) ** 2 * a + 2 * place * (1 - place) * b + place**2 * c
            heading = 2 * (1 - place) * (b - a) + 2 * place * (c - b)
            side = 1 if n % 2 else -1
            angle = math.atan2(heading[1], heading[0]) + side * random.uniform(0.6, 1.15)
            length = random.uniform(46, 66) * mm * (1.1 - 0.35 * place)
            self._leaf(painting, (float(here[0]), float(here[1])), angle, length, _leaf_colour(random))

    def _leaf(
        self, painting: Painting, base: tuple[float, float], angle: float, length: float, colour: Array
    ) -> None:
        cosine, sine = math.cos(angle), math.sin(angle)

        def shape(x: Array, y: Array) -> tuple[Array, Colour]:
            x, y = x - base[0], y - base[1]
            a, b = (x * cosine + y * sine) / length, (y * cosine - x * sine) / length
            inside = np.clip(a, 0, 1)
            half = 0.62 * inside**0.75 * (1 - inside) ** 0.95
            opacity = soft((half - np.abs(b)) * length, self.edge)
            opacity = opacity * soft(
                np.minimum(a, 1 - a) * length - self.edge, self.edge
            )  # no thin line beyond the tip
            vein = np.exp(-((b / 0.012) ** 2)) + 0.45 * np.exp(
                -((np.sin(26 * (a - 0.75 * np.abs(b))) / 0.16) ** 2)
            )
            light = 0.72 + 0.35 * a + np.where(b > 0, 0.16, -0.12)
            return opacity, colour * light[..., None] + 0.11 * vein[..., None] * np.array([1.0, 1.0, 0.45])

        tip = (base[0] + length * cosine, base[1] + length * sine)
        side = 0.36 * length
        painting.paint(
            (
                min(base[0], tip[0]) - side,
                min(base[1], tip[1]) - side,
                max(base[0], tip[0]) + side,
                max(base[1], tip[1]) + side,
            ),
            shape,
        )


def _leaf_colour(random: np.random.Generator) -> Array:
    green, autumn = np.array([0.10, 0.26, 0.045]), np.array([0.50, 0.19, 0.03])
    return np.asarray(green + (autumn - green) * random.random() ** 3 * 0.9)


@dataclass(frozen=True)
class Chart:
    """A board with a Siemens star, bars, colours and letters; made for a distance of 1.3 m."""

    edge: float = 0.6 * mm

    def __call__(self, x: Array, y: Array) -> Array:
        """Colour times opacity and opacity at positions in metres, (..., 4)."""
        painting = Painting(x, y)
        for leg in (-118.0, 118.0):
            self._box(painting, (leg - 6, 120.0, leg + 6, 400.0), (0.12, 0.075, 0.045))
        self._box(painting, (-168.0, -140.0, 168.0, 140.0), (0.055, 0.04, 0.035))
        self._box(painting, (-162.0, -134.0, 162.0, 134.0), (0.60, 0.57, 0.50))
        ink = (0.035, 0.035, 0.04)
        painting.text("VIRTUAL COMPUTATIONAL", (-150 * mm, -122 * mm), 2.4 * mm, ink)
        painting.text("CAMERA", (-150 * mm, -99 * mm), 2.4 * mm, (0.55, 0.05, 0.03))
        painting.text("500 X 500 X 20 X 20", (4 * mm, -94 * mm), 1.2 * mm, ink)
        painting.star((-72 * mm, 22 * mm), 76 * mm, 36, ink, self.edge)
        self._bars(painting, ink)
        self._colours(painting)
        painting.text("THE QUICK BROWN FOX", (18 * mm, 112 * mm), 1.2 * mm, ink)
        return painting.values

    def _box(self, painting: Painting, bounds: tuple[float, ...], colour: Colour) -> None:
        left, top, right, bottom = (side * mm for side in bounds)
        painting.rectangle((left, top, right, bottom), colour, self.edge)

    def _bars(self, painting: Painting, ink: Colour) -> None:
        """Groups of five bars, each finer than the one before."""
        left = 18.0
        for width in (5.0, 3.6, 2.6, 1.8):
            for n in range(5):
                start = left + 2 * n * width
                if start + width > 152:
                    break
                self._box(painting, (start, -66.0, start + width, -36.0), ink)
            for n in range(5):
                top = -30 + 2 * n * width * 0.6
                self._box(painting, (left, top, left + 9 * width, top + width * 0.6), ink)
            left += 10 * width + 3

    def _colours(self, painting: Painting) -> None:
        for row, colours in enumerate(_PATCHES):
            for column, colour in enumerate(colours):
                left, top = 18 + 34 * column, 10 + 25 * row
                self._box(painting, (left, top, left + 30, top + 21), colour)


_PATCHES = (
    ((0.66, 0.05, 0.04), (0.80, 0.35, 0.02), (0.85, 0.70, 0.05), (0.10, 0.42, 0.08)),
    ((0.02, 0.36, 0.42), (0.03, 0.09, 0.50), (0.25, 0.05, 0.38), (0.68, 0.16, 0.32)),
    ((0.05, 0.05, 0.05), (0.12, 0.12, 0.12), (0.28, 0.28, 0.28), (0.86, 0.86, 0.86)),
)


@dataclass(frozen=True)
class Town:
    """Houses with lit windows below an evening sky, and strings of lamps; made for a distance of 3 m."""

    edge: float = 1.5 * mm

    def __call__(self, x: Array, y: Array) -> Array:
        """Colour and opacity 1 at positions in metres, (..., 4)."""
        painting = Painting(x, y)
        painting.paint((-math.inf, -math.inf, math.inf, math.inf), _sky)
        painting.disc((-0.47, -0.50), 0.055, (0.92, 0.86, 0.70), self.edge)
        random = np.random.default_rng(3)
        for base, tint, lit in ((0.30, 1.7, 0.0), (0.42, 1.0, 0.55)):
            self._houses(painting, random, base, tint, lit)
        self._lamps(painting, random, (-1.0, -0.62), (1.0, -0.40), 0.16)
        self._lamps(painting, random, (-1.1, -0.30), (-0.1, -0.62), 0.10)
        return painting.values

    def _houses(
        self, painting: Painting, random: np.random.Generator, base: float, tint: float, lit: float
    ) -> None:
        left = -1.2
        while left < 1.2:
            width, height = random.uniform(0.11, 0.24), random.uniform(0.12, 0.62)
            colour = tint * np.array([0.035, 0.032, 0.050]) * random.uniform(0.8, 1.3)
            painting.rectangle((left, base - height, left + width, 2.0), colour, self.edge)
            if lit:
                self._windows(painting, random, (left, base - height, width), lit)
            left += width + random.uniform(-0.01, 0.05)

    def _windows(
        self, painting: Painting, random: np.random.Generator, house: tuple[float, float, float], lit: float
    ) -> None:
        left, top, width = house
        columns = int(width / 0.036)
        first = left + (width - columns * 0.036) / 2 + 0.010
        for y in np.arange(top + 0.024, 0.95, 0.046):
            for x in first + 0.036 * np.arange(columns):
                warmth, bright = random.random(), random.random() ** 1.5
                colour = np.array([1.0, 0.52 + 0.36 * warmth, 0.14 + 0.50 * warmth]) * (0.15 + 0.8 * bright)
                if random.random() > lit:
                    colour = np.array([0.03, 0.035, 0.06])
                painting.rectangle((x, y, x + 0.017, y + 0.024), colour, self.edge)

    def _lamps(
        self,
        painting: Painting,
        random: np.random.Generator,
        start: tuple[float, float],
        end: tuple[float, float],
        sag: float,
    ) -> None:
        """A string of coloured lamps that hangs in a parabola between two points."""
        for n in range(19):
            a = n / 18
            x = start[0] + a * (end[0] - start[0]) + random.uniform(-0.006, 0.006)
            y = start[1] + a * (end[1] - start[1]) + 4 * sag * a * (1 - a)
            painting.disc((x, y), 11 * mm, _LAMPS[n % len(_LAMPS)], self.edge)


_LAMPS = ((1.0, 0.80, 0.42), (1.0, 0.25, 0.12), (0.35, 0.85, 1.0), (1.0, 0.62, 0.15), (0.55, 1.0, 0.45))


def _sky(x: Array, y: Array) -> tuple[float, Colour]:
    """From blue above to orange at the horizon, with faint clouds."""
    height = np.clip((y + 0.75) / 1.15, 0, 1)[..., None]  # 0 at the top
    clouds = 0.06 * (np.sin(9 * x + 4 * np.sin(5 * y)) * np.sin(31 * y + 3 * np.sin(4 * x)))[..., None]
    high, low = np.array([0.045, 0.075, 0.19]), np.array([0.62, 0.27, 0.11])
    blend = np.clip(height**1.7 + clouds, 0, 1)
    return 1.0, high + (low - high) * blend
