"""Orders in which the views of a grid are counted, and detection of the order from the pictures.

The numbers of 3×4 views::

    row-major    column-major   serpentine   serpentine-columns   chess
    0  1  2  3   0 3 6  9       0 1  2  3    0 5 6 11             0 6  1  7
    4  5  6  7   1 4 7 10       7 6  5  4    1 4 7 10             8 2  9  3
    8  9 10 11   2 5 8 11       8 9 10 11    2 3 8  9             4 10 5 11

The raster and serpentine orders are those in which JPEG Pleno's tools make videos of views; gantries use
serpentine. Chess has all fields of one colour before the other, for transmissions in which half of the views
come first.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.files.pictures import averaged

Order = Literal["row-major", "column-major", "serpentine", "serpentine-columns", "chess"]
"""Order of counting: row by row from the left; column by column from the top; every other row, or column,
reversed; all fields of a chessboard with the colour of the upper left one, row by row, then the others.
"""
ORDERS: tuple[Order, ...] = get_args(Order)

_THUMBNAIL = 24  # pixels: parallax is then small against a feature, and differences grow with it
_CLEARLY = 1.1  # minimum ratio between the second-best and the best arrangement
_LINE = 1.5  # and between the best grid and a single row of views
_MOST = 4096  # maximum number of views for pairwise comparison within seconds


def check(views: object, order: object) -> None:
    """Raise unless views are None or (rows, columns), and order is None or an order.

    Raises:
        InputError: an invalid value.
    """
    if order is not None:
        checks.one_of("order", order, ORDERS)
    if views is not None:
        checks.counts("views", views, "rows", "columns")


def running_numbers(views: tuple[int, int], order: Order) -> NDArray[np.intp]:
    """The running number, from 0, of the view at each (row, column).

    Args:
        views: (rows, columns).
        order: see `Order`.
    """
    rows, columns = views
    if order in ("column-major", "serpentine-columns"):
        turned: Order = "row-major" if order == "column-major" else "serpentine"
        return running_numbers((columns, rows), turned).T
    numbers = np.arange(rows * columns).reshape(rows, columns)
    if order == "serpentine":
        numbers[1::2] = numbers[1::2, ::-1]
    if order == "chess":
        colours = np.indices(views).sum(axis=0) % 2
        numbers.flat[np.argsort(colours, axis=None, kind="stable")] = np.arange(rows * columns)
    return numbers


def counted_from(views: tuple[int, int], order: Order) -> tuple[int, int]:
    """The (rows, columns) of the row-wise order that an order corresponds to: transposed for orders by column."""
    return views[::-1] if order in ("column-major", "serpentine-columns") else views


@dataclass(frozen=True)
class _Candidate:
    views: tuple[int, int]
    order: Order
    difference: float


def arrangement(
    thumbnails: Sequence[NDArray[np.float32]], views: tuple[int, int] | None, order: Order | None, what: str
) -> tuple[tuple[int, int], Order]:
    """The arrangement, (rows, columns) and order, in which neighbouring views differ least.

    Args:
        thumbnails: thumbnails of all views, from `thumbnail`, as counted.
        views: (rows, columns), if known.
        order: order, if known.
        what: subject for an error message: "folder has 81 numbered pictures".

    Raises:
        InputError: no arrangement is clearly better than the next.
    """
    count = len(thumbnails)
    if views is not None and 1 in views:
        return views, order or "row-major"
    if len({small.shape for small in thumbnails}) > 1:
        raise InputError(f"{what}, and they are not all of one size. Move away files that are not views")
    if count > _MOST:
        raise InputError(
            f"{what}, too many to be compared with one another: pass views=(rows, columns) and order="
        )
    differences = _differences(thumbnails)
    # A square grid has the same neighbours by rows and by columns: parallax decides later.
    orders: tuple[Order, ...] = (order,) if order else ("row-major", "serpentine", "chess")
    if views is None:
        shapes = [(n, count // n) for n in range(2, count // 2 + 1) if count % n == 0]
    else:
        shapes = [views]
        if order is None and views[0] != views[1]:
            orders = ORDERS
    found = sorted(
        (
            _Candidate(shape, way, float(np.mean(list(_neighbours(differences, running_numbers(shape, way))))))
            for shape in shapes
            for way in orders
        ),
        key=lambda candidate: candidate.difference,
    )
    if views is None:
        line = float(np.mean(np.diagonal(differences, 1)))
        if not found or line * _LINE < found[0].difference:
            return (1, count), "row-major"
    if len(found) > 1 and not found[1].difference > _CLEARLY * found[0].difference:
        likely = " or ".join(f'views={c.views}, order="{c.order}"' for c in found[:2])
        raise InputError(f"{what}, but their arrangement is not clear. Pass {likely}, or the correct arrangement")
    return found[0].views, found[0].order


def thumbnail(picture: NDArray[Any]) -> NDArray[np.float32]:
    """Block means of a picture's grey values, about 24 pixels across.

    Args:
        picture: shape (t, s) or (t, s, channel).
    """
    grey = picture.mean(axis=2, dtype=np.float32) if picture.ndim == 3 else picture.astype(np.float32)
    return averaged(grey, max(1, min(grey.shape) // _THUMBNAIL))


def _differences(thumbnails: Sequence[NDArray[np.float32]]) -> NDArray[np.float64]:
    """Mean absolute difference of each pair of pictures."""
    count = len(thumbnails)
    small = np.stack(thumbnails).reshape(count, -1)
    differences = np.zeros((count, count))
    for number in range(count):
        differences[number, number + 1 :] = np.abs(small[number + 1 :] - small[number]).mean(axis=1)
    return differences + differences.T


def _neighbours(differences: NDArray[np.float64], places: NDArray[np.intp]) -> Iterator[float]:
    """Differences of all adjacent views."""
    yield from differences[places[:, :-1], places[:, 1:]].ravel()
    yield from differences[places[:-1], places[1:]].ravel()
