"""Cells of coded apertures from the figures of their papers, seen from the scene; # is open."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def _cells(*rows: str) -> NDArray[np.float64]:
    return np.array([[cell == "#" for cell in row] for row in rows], dtype=np.float64)


LEVIN = _cells(
    ".............",
    "...##.#.##...",
    "......#......",
    ".##.......##.",
    "..#..###..#..",
    ".#....#....#.",
    ".#..#####..#.",
    ".#....#....#.",
    "..#..###..#..",
    ".##.......##.",
    "......#......",
    "...##.#.##...",
    ".............",
)
"""A. Levin, R. Fergus, F. Durand and W. T. Freeman, *Image and depth from a conventional camera with a coded
aperture*, ACM Transactions on Graphics 26 (SIGGRAPH 2007), figure 1: zeros of its spectrum tell the scale."""

VEERARAGHAVAN = _cells(
    ".#....#",
    "..##..#",
    "......#",
    "#.##...",
    ".###...",
    ".##.#.#",
    "#..##.#",
)
"""A. Veeraraghavan, R. Raskar, A. Agrawal, A. Mohan and J. Tumblin, *Dappled photography*, ACM Transactions on
Graphics 26 (SIGGRAPH 2007), section 4: the 7×7 mask with a broad spectrum."""

ZHOU_NAYAR = _cells(
    ".............",
    "....###.##...",
    "....###..##..",
    ".######.####.",
    ".######..###.",
    ".#####...###.",
    ".#####....##.",
    ".#####....##.",
    ".#...#.......",
    ".....#.......",
    "..#########..",
    "....######...",
    ".............",
)
"""C. Zhou and S. Nayar, *What are good apertures for defocus deblurring?*, IEEE International Conference on
Computational Photography 2009, figure 5: found by genetic search for the least expected error R(K)."""
