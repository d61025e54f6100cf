"""Absorbing elements as the samples of a light field meet them: place, footprint and weight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.plan.following import choice
from vcc.plan.footprints.means import Boxes
from vcc.shapes.patterns import Pattern
from vcc.shapes.stacked_patterns import in_one_plane, not_clear_next_to_others
from vcc.shapes.tilings import Tile, tiles_of

Array = NDArray[np.float64]

ALONG_AXES = 1e-9
"""Share of a cell: sides that deviate from the axes by less count as parallel to them."""


Placed = tuple[Pattern, tuple[float, float]]
"""A pattern, and the place of its middle in metres."""


@dataclass(frozen=True)
class PlaneChoices:
    """Choices for patterns in one plane.

    Args:
        cutting: numbers of the patterns that cut off light that the others transmit.
        about: index in ``cutting`` of the pattern whose middle is the origin.
    """

    cutting: tuple[int, ...] = choice("what cuts light off")
    about: int = choice("about which middle")


def choose_plane(patterns: list[Placed]) -> PlaneChoices:
    """Choose the patterns that count in one plane, and the origin.

    The origin is the middle of the smallest pattern, as if it were alone, independent of the order of the
    patterns.
    """
    cutting = tuple(not_clear_next_to_others(patterns))
    sizes = [(float(np.prod(pattern.size)), *middle) for pattern, middle in (patterns[n] for n in cutting)]
    return PlaneChoices(cutting, sizes.index(min(sizes)))


@dataclass(frozen=True, eq=False, repr=False)
class Plane(Brief):
    """An absorbing element as the samples meet it: place = at_index · (i, j, k, l) + offset, metres.

    Places are relative to the element's middle, which is at ``decentre`` in its plane.
    """

    pattern: Pattern
    label: str
    decentre: tuple[float, float]
    at_index: Array
    offset: Array

    @classmethod
    def at(
        cls,
        place: Array,
        patterns: list[Placed],
        label: str,
        choices: PlaneChoices | None = None,
    ) -> Plane:
        """The plane of all patterns that samples meet in one place.

        Args:
            place: (x, y) in metres from index (i, j, k, l, 1), 2×5.
            patterns: one or several.
            label: of the plane.
            choices: the patterns that count; None chooses now.
        """
        choices = choices or choose_plane(patterns)
        patterns = [patterns[n] for n in choices.cutting]
        decentre = patterns[choices.about][1]
        pattern = in_one_plane([(one, (x - decentre[0], y - decentre[1])) for one, (x, y) in patterns])
        return cls(pattern, label, decentre, place[:, :4], place[:, 4] - np.array(decentre))

    @classmethod
    def met_by(
        cls, frame: Affine, rays: Affine, pattern: Pattern, decentre: tuple[float, float], label: str
    ) -> Plane:
        """The plane of a pattern as samples of this frame meet it; ``rays`` maps from the frame to the plane."""
        return cls.at((rays @ frame).matrix[:2], [(pattern, decentre)], label)

    def middle_of_view(self, samples: tuple[int, int]) -> Array:
        """Place (x, y) of the middle of view (0, 0), metres; ``samples`` are (rows, columns) of a view."""
        rows, columns = samples
        return np.asarray(self.offset + self.sample_step @ np.array([(columns - 1) / 2, (rows - 1) / 2]))

    def boxes(
        self, index: Array, shift: Array, motion: Array, samples: tuple[int, int], parts: int = 1
    ) -> list[tuple[Boxes, float]]:
        """The cells of taps on a plane that each view meets in a point, as rectangles and their shares of a cell.

        Args:
            index: of the views, (rows of taps, columns of taps, 2); see `tap_origin`.
            shift: of the taps from them, in views.
            motion: of the scene.
            samples: (rows, columns) of a view.
            parts: of a view's cell, each way.
        """
        place = tap_origin(self.at_index, self.middle_of_view(samples), index, shift, motion)
        x, y = place[..., 0], place[..., 1]
        if (x == x[:1]).all() and (y == y[:, :1]).all() and x.ndim == 2:
            x, y = x[:1], y[:, :1]  # a row and a column of places are enough
        tiles = cell_tiles(self.view_step(motion) / parts)
        return [(Boxes(x + tile.x, y + tile.y, tile.width, tile.height), tile.share) for tile in tiles]

    def view_step(self, motion: Array) -> Array:
        """2×2: metres moved here per view, following a point of the scene."""
        return np.asarray(self.at_index[:, :2] - self.at_index[:, 2:] @ motion)

    @property
    def sample_step(self) -> Array:
        """2×2: metres moved here per sample within a view."""
        return np.asarray(self.at_index[:, 2:])


def along_axes(sides: Array) -> bool:
    """Whether vectors (2, n) lie along the axes, except for rounding."""
    size = np.abs(sides)
    return bool((size.min(axis=0) <= ALONG_AXES * size.max(axis=0, initial=0.0)).all())


def cell_tiles(step: Array) -> tuple[Tile, ...]:
    """Rectangles that stand for a cell, a parallelogram: the rectangles of all cells tile the plane.

    Args:
        step: 2×2, its sides as columns, metres.
    """
    width, height = np.abs(step).sum(axis=1)
    if along_axes(step) or abs(np.linalg.det(step)) <= ALONG_AXES * width * height:
        return (Tile(0.0, 0.0, float(width), float(height), 1.0),)
    return tiles_of(step)


def depends_on_view_only(plane: Plane, samples: tuple[int, int], motion: Array) -> bool:
    """Whether all samples of a view meet the plane in one place, except for rounding."""
    cell = np.abs(plane.view_step(motion)).sum(axis=1)
    travel = np.abs(plane.sample_step) @ np.array([samples[1], samples[0]])
    return bool((travel <= 1e-6 * cell).all())


def tap_origin(at_index: Array, offset: Array, index: Array, shift: Array, motion: Array) -> Array:
    """Where sample (0, 0) of each tap falls, (rows, columns, 2); shifts follow the scene's parallax."""
    view_step = at_index[:, :2] - at_index[:, 2:] @ motion
    return np.asarray(index @ at_index[:, :2].T + shift @ view_step.T + offset)
