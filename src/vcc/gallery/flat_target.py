"""A flat target out of focus, recorded through coded apertures.

The target is a grid of points of light, one per pixel, and repeats periodically, which avoids border effects.
Recording it is a convolution with one kernel, the camera's image of a single point. If a code's cells are
whole pixels wide, the kernel is the code itself, as papers on apertures assume.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.camera import Camera
from vcc.fields.grid import Sample
from vcc.light_field import LightField
from vcc.optics import Lens, Mask
from vcc.optics.sensor import Sensor
from vcc.showcase.bench import Bench

Array = NDArray[np.float64]

FOCAL_LENGTH = 50 * mm
OPENING = 20 * mm
"""Width of the apertures' square."""
FOCUS, DISTANCE = 0.8, 2.0
"""Distance in focus, and distance of the target, metres."""
VIEWS_PER_PIXEL = 4
"""Views per pixel of blur, along a side: sets the number of rays per pixel."""
SMALLEST = 64
"""Least side of a target, pixels."""


def flat(
    picture: NDArray[np.floating],
    spacing: float,
    slope: float,
    distance: float,
    views: int = 2,
    sample: Sample = "mean",
) -> LightField:
    """The light of a flat object: all views are the same picture, without copies, and converge on it.

    Args:
        picture: radiance, (rows, columns[, channels]).
        spacing: of the views, metres.
        slope: from pixel to pixel.
        distance: of the object, metres.
        views: each way.
        sample: see `vcc.LightField`.
    """
    values = np.broadcast_to(picture.astype(np.float32), (views, views, *picture.shape))
    return LightField.from_views(values, spacing, slope, distance, disparity_range=(0.0, 0.0), sample=sample)


def grey_view(bench: Bench, most: int) -> Array:
    """The middle of the middle view as a target: grey, 0 to 1, shape (rows, columns) of ``most`` or less.

    Raises:
        InputError: views that are too small for a target, or dark.
    """
    nv, nu, nt, ns = bench.light_field.shape[:4]
    if min(nt, ns) < SMALLEST:
        raise InputError(
            f"the views of this light field have {nt}×{ns} pixels: a flat target is made of one, and needs "
            f"{SMALLEST}×{SMALLEST} or more"
        )
    view = bench.light_field.view(nv // 2, nu // 2).to_numpy().astype(np.float64)
    grey = view if view.ndim == 2 else view.mean(axis=2)
    rows, columns = min(nt, most), min(ns, most)
    top, left = (nt - rows) // 2, (ns - columns) // 2
    grey = grey[top : top + rows, left : left + columns]
    white = float(np.percentile(grey, 99.5))
    if not white > 0:
        raise InputError("the middle view of this light field is dark: there is nothing to deblur")
    return np.asarray(np.clip(grey / white, 0, 1))


def focal_camera(mask: Mask, shape: tuple[int, int], blur: int, focus: float = FOCUS) -> Camera:
    """A lens with a mask in it; the opening is ``blur`` pixels wide in the image of a point of the target."""
    distance = 1 / (1 / FOCAL_LENGTH - 1 / focus)
    return Camera([Lens(FOCAL_LENGTH), mask], Sensor(distance, shape, _slope(blur) * distance))


def recorded(mask: Mask, target: Array, blur: int) -> Array:
    """The target through the camera, without noise.

    Args:
        mask: no wider than `OPENING`.
        target: radiances, (rows, columns).
        blur: pixels across the opening.

    Returns:
        Upright, shape of the target; 1 is radiance 1 through the whole square opening.
    """
    around = [(blur, blur), (blur, blur)]
    return _through(mask, np.pad(target, around, mode="wrap"), target.shape, blur)


def kernel(mask: Mask, blur: int) -> Array:
    """The image of one point of the target, upright, of an odd side; its sum is the transmission."""
    side = blur + 5 - blur % 2
    dot = np.zeros((side + 2 * blur, side + 2 * blur))
    dot[dot.shape[0] // 2, dot.shape[1] // 2] = 1
    return np.maximum(_through(mask, dot, (side, side), blur), 0)


def _through(mask: Mask, wide: Array, shape: tuple[int, ...], blur: int) -> Array:
    views = VIEWS_PER_PIXEL * blur
    field = flat(wide, OPENING / views, _slope(blur), DISTANCE, views)
    camera = focal_camera(mask, (shape[0], shape[1]), blur)
    # With "nearest", each ray of a point contributes all of its light to one pixel.
    image = camera.capture(field, method="footprints", between_views="none", interpolation="nearest")
    return np.asarray(image.upright().to_numpy(), dtype=np.float64) * camera.sensor.z**2 / OPENING**2


def _slope(blur: int) -> float:
    """Slope per pixel: the opening's blur is OPENING·d·|1/FOCUS − 1/DISTANCE| wide, at d behind the lens."""
    return OPENING * abs(1 / FOCUS - 1 / DISTANCE) / blur
