"""All views in one picture: ESLF, in which the block of views behind each lenslet is tiled over the image, and
mosaics of whole views.
"""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.fields.samples import Samples
from vcc.fields.view_arrays import all_samples
from vcc.files import transfer as curves
from vcc.files.atomic import atomic_path
from vcc.files.image_metadata import ImageMetadata
from vcc.files.images_with_metadata import check_usual
from vcc.files.pictures import read_picture, read_stored, write_codes
from vcc.formats import orders
from vcc.formats.grid import Decoded, weights_apart
from vcc.formats.orders import Order, counted_from, running_numbers
from vcc.formats.tiles import Layout, check, mosaic_evidence, put_together, taken_apart

ENDINGS = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".ppm")

_CLEARLY = 1.4  # the pictures of five light fields, whole and in parts, gave 1.95 or more either way
_KNOWN = {(5264, 7574): (14, 14), (6510, 9375): (15, 15)}  # Stanford's archive, and the Light Field Toolbox


def recognised(path: Path) -> bool:
    """Whether the path is a single picture, which can only be one of all views."""
    return path.suffix.lower() in ENDINGS and path.is_file()


def read(
    path: Path,
    *,
    views: tuple[int, int] | None = None,
    layout: Layout | None = None,
    order: Order | None = None,
) -> Decoded:
    """Read the views of a picture that contains all of them.

    In an ESLF, pixel (l·rows + j, k·columns + i) is pixel (l, k) of view (j, i); in a mosaic, view (j, i) is
    the tile at row j and column i.

    Args:
        path: the picture. The alpha channel of a PNG is the weight of its samples.
        views: (rows, columns) of views. Known for the sizes of Stanford's archive (14×14, 7574×5264 pixels) and
            of the Light Field Toolbox (15×15, 9375×6510).
        layout: "eslf" or "mosaic"; detected by default, see `vcc.formats.tiles.mosaic_evidence`.
        order: order of the views in blocks or tiles, see `vcc.formats.orders`; row by row by default.

    Raises:
        InputError: an unreadable picture, views that are unknown or impossible, or a layout that cannot be
            detected.
    """
    orders.check(views, order)
    check(layout)
    check_usual(path)
    samples, weights = _samples(path)
    height, width = samples.shape[:2]
    known = _KNOWN.get((height, width))
    views = views or known
    if views is None:
        raise InputError(
            f"{path} is one picture of {width}×{height} pixels. If it holds all views, as a mosaic of them or as "
            "an ESLF (the block of views behind each lenslet tiled), pass views=(rows, columns), e.g. "
            "views=(9, 9); else open the folder with one picture for each view"
        )
    rows, columns = views
    if rows > height or columns > width:
        raise InputError(f"{path}: {rows}×{columns} views do not fit into {height}×{width} pixels")
    order = order or "row-major"
    written = counted_from(views, order)
    layout = layout or _layout(samples, written, known, path)
    remarks = _cut_off(height, width, written, layout, path)

    def ordered(picture: NDArray[Any]) -> NDArray[Any]:
        whole = picture[: height - height % written[0], : width - width % written[1]]
        return _in_order(taken_apart(whole, written, layout), views, order)

    name = "ESLF" if layout == "eslf" else "mosaic"
    counted = "" if order == "row-major" else f", {order}"
    return Decoded(
        format=f"{name}, {rows}×{columns} views in one picture{counted}",
        values=ordered(samples),
        transfer="srgb",
        weights=None if weights is None else ordered(weights),
        notices=remarks,
    )


def save(
    light_field: Samples,
    path: str | PathLike[str],
    *,
    bits: int = 16,
    kind: Literal["eslf", "mosaic"] = "eslf",
) -> Path:
    """Write a light field as one sRGB-encoded PNG.

    Reading returns samples that differ by at most half a code of the sRGB curve; the geometry is not stored.

    Args:
        light_field: the light field, grey or of 3 channels, values 0 to 1 (or unsigned integers).
        path: path to write to; ends in .png.
        bits: bits per sample, 8 or 16.
        kind: "eslf" (each lenslet's block of views tiled) or "mosaic" (whole views side by side).

    Raises:
        InputError: another extension, other channels, values above 1, or a path that is not writable.
    """
    path = Path(path).expanduser()
    check(kind)
    what = "an ESLF" if kind == "eslf" else "a mosaic of views"
    checks.ending(what, path, ".png")
    grid = light_field.grid
    if grid.channels not in (None, 1, 3):
        raise InputError(f"a PNG has 1 or 3 channels, and this light field has {grid.channels}")
    values = all_samples(light_field).astype(np.float32) / np.float32(grid.full_scale)
    if values.max() > 1:
        raise InputError(
            f"{what} holds values up to 1, and this light field reaches {values.max():g}: scale it, "
            "lf.replaced(lf.values / lf.values.max())"
        )
    codes = curves.encode(values, bits)
    tiled = put_together(codes, kind)
    with atomic_path(path) as temporary:
        write_codes(tiled, temporary, ".png", ImageMetadata("radiance", transfer="srgb"))
    return path


def _layout(samples: NDArray[Any], views: tuple[int, int], known: tuple[int, int] | None, path: Path) -> Layout:
    """The layout of a picture; unclear pictures of a size known for ESLFs count as ESLF."""
    if samples.shape[0] % views[0] or samples.shape[1] % views[1]:
        return "eslf"  # its last blocks may be cut off
    evidence = mosaic_evidence(samples, views)
    if max(evidence, 1 / evidence) > _CLEARLY:
        return "mosaic" if evidence > 1 else "eslf"
    if known == views:
        return "eslf"
    raise InputError(
        f"{path} does not show whether it is a mosaic of {views[0]}×{views[1]} views or an ESLF (the block of "
        'views behind each lenslet tiled): pass layout="mosaic" or layout="eslf"'
    )


def _cut_off(height: int, width: int, views: tuple[int, int], layout: Layout, path: Path) -> tuple[str, ...]:
    """Notice on blocks that are cut off; raises for tiles of a mosaic."""
    rows, columns = views
    if height % rows == width % columns == 0:
        return ()
    if layout == "mosaic":
        raise InputError(
            f"{path}: {height}×{width} pixels (rows × columns) are not a multiple of {rows}×{columns} "
            "tiles. Correct views=, or crop the picture to the views"
        )
    return (
        f"{height}×{width} pixels (rows × columns) are not a multiple of blocks of {rows}×{columns} views; "
        f"the last {height % rows} rows and {width % columns} columns were left out. Is it a "
        "mosaic, or is views= wrong?",
    )


def _in_order(tiles: NDArray[Any], views: tuple[int, int], order: Order) -> NDArray[Any]:
    """Move views from their counted order to their rows and columns."""
    if order == "row-major":
        return np.ascontiguousarray(tiles)
    flat = tiles.reshape(-1, *tiles.shape[2:])
    return flat[running_numbers(views, order)]


def _samples(path: Path) -> tuple[NDArray[Any], NDArray[np.float32] | None]:
    """The picture, and its alpha channel as weights if it is not opaque."""
    if path.suffix.lower() != ".png":
        return read_picture(path)[0], None
    samples = read_stored(path)
    if samples.ndim == 3 and samples.shape[2] in (2, 4):
        samples, weights = weights_apart(samples)
        return samples if samples.shape[2] == 3 else samples[..., 0], weights
    return samples, None
