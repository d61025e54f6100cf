"""Plenoptic decoding: from the raw recording of a camera with lenslets to a light field.

Each lenslet images the main lens: a pixel at δ from the centre of its micro-image sees position −δ·d/b of the main
lens, through the position of the lenslet (d from main lens to lenslets, b from lenslets to sensor; Ng et al.
2005). The pixels at the same δ from all centres form one view. The centres must be known: from the camera, as
a given grid, or from a recording of a white scene.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base.affine import Affine
from vcc.base.checks import above_zero, whole_number
from vcc.base.errors import InputError, warn_of_result
from vcc.base.memory import check_samples
from vcc.base.progress import Progress, tell
from vcc.camera import Camera
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics.electronics import Electronics
from vcc.recording import Recording
from vcc.recover.lenslet_grid import LensletGrid
from vcc.recover.lenslet_optics import LensletOptics
from vcc.recover.lenslet_views import LensletViews
from vcc.recover.recorded import grey, numbers_of, set_to_zero
from vcc.recover.white_image import DARK_SHARE, brightness_of, evened_out, find_lenslets, numbers_like
from vcc.run.demosaic import Demosaicing, demosaic
from vcc.shapes.lattice import ROW_HEIGHT

__all__ = ["LensletGrid", "decode_plenoptic", "find_lenslets"]

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
ColorFilter = str | tuple[str, ...]

_UNKNOWN_SPACING = 1e-3
"""Spacing of views if the camera is unknown, metres."""


def decode_plenoptic(
    recording: Image | Recording | ArrayLike,
    grid: LensletGrid | None = None,
    *,
    camera: Camera | None = None,
    white: Image | Recording | ArrayLike | None = None,
    dark: ArrayLike | None = None,
    color_filter: str | None = None,
    demosaicing: Demosaicing = "bilinear",
    views: int | tuple[int, int] | None = None,
    view_step: float = 1.0,
    step: float | None = None,
    inverted: bool = True,
    memory_limit: int | None = None,
    progress: Progress | None = None,
) -> LightField:
    """The light field that a plenoptic camera recorded: one view per position in the micro-images.

    The steps: subtract the dark frame; divide by the white image (devignetting); demosaic; read each view at its
    position in all micro-images, linearly between pixels; resample it to a square grid along the sensor's
    rows, linearly between lenslets (between the three surrounding lenslets on a hexagonal lattice). An
    unrotated square lattice is such a grid already and is not interpolated.

    Args:
        recording: numbers proportional to light, shape (rows, columns[, channels]), or (rows, columns) behind a
            colour filter; as returned by `vcc.Camera.capture` or `expose`.
        grid: of the micro-images; None finds it in ``white``, or else uses the camera's.
        camera: affine optics, then a `vcc.LensArray`, then the sensor. The frame is then metric, at the camera's
            entrance plane. Without a camera, views are 1 mm apart, converge at infinity, and an image is as
            wide as its distance: disparities are correct, distances are not.
        white: a recording of a uniform white scene; if its radiance is 1, the result is radiance.
        dark: a recording without light, subtracted from both.
        color_filter: of an array's mosaic, such as "RGGB" (`vcc.Electronics`).
        demosaicing: see `vcc.Recording.demosaiced`.
        views: how many, one number or (rows, columns); None uses all within the inner circle of micro-images.
        view_step: between views, pixels within a micro-image.
        step: between pixels of a view, pixels of the recording; None uses the lenslets' pitch, for hexagonal
            lattices times √(√3/2), which preserves the number of samples.
        inverted: whether the recording is upside down, as light lands on the sensor. Views are upright in either
            case.
        memory_limit: bytes for the light field; None uses `vcc.base.memory.MEMORY_LIMIT`.
        progress: called with (views done, views).

    Returns:
        float32, shape (v, u, t, s[, channels]), upright; 0 where the white image is dark. Negative noise is set
        to 0.

    Warns:
        ResultWarning: more than 1 % of the samples are where the white image is dark, or the negative noise that
            is set to 0 adds more than 0.5 % to the light.

    Raises:
        InputError: neither grid nor white image nor camera; images whose sizes differ from each other or from the
            sensor's; a dark white image; a grid whose pitch differs from the camera's; views that do not fit in a
            micro-image; NaNs; more memory needed than allowed.
    """
    prepared = _Prepared.of(recording, camera, white, dark, color_filter)
    grid = _chosen_grid(grid, camera, white, dark, prepared.color_filter is not None, inverted)
    counts = _view_counts(views, grid, view_step)
    step = grid.pitch * math.sqrt(ROW_HEIGHT[grid.layout]) if step is None else float(step)
    above_zero("step", step, unit="pixels of the recording")
    raw = prepared.demosaiced(demosaicing)
    lenslets = LensletViews.of(grid, prepared.shape, (max(counts) - 1) / 2 * view_step, step)
    channels = raw.shape[2] if raw.ndim == 3 else None
    check_samples((*counts, *lenslets.shape, channels or 1), memory_limit, "the decoded light field")
    planes = np.moveaxis(np.atleast_3d(raw), 2, 0).astype(np.float32)
    values = _read(lenslets, planes, prepared.told, counts, view_step, -1 if inverted else 1, progress)
    if channels is None:
        values = values[..., 0]
    if camera is None:
        return LightField.from_views(values, _UNKNOWN_SPACING, 1 / max(lenslets.shape))
    return LightField(values, _frame(camera, lenslets, counts, view_step, inverted))


def _read(
    lenslets: LensletViews,
    planes: Floats,
    told: Floats | None,
    counts: tuple[int, int],
    view_step: float,
    turn: int,
    progress: Progress | None,
) -> Floats:
    """All views, (v, u, rows, columns, channels), 0 or more, rotated by 180° if ``turn`` is −1."""
    values = np.zeros((*counts, *lenslets.shape, len(planes)), np.float32)
    missing = 0
    for row, column in np.ndindex(*counts):
        right, down = (view_step * (n - (count - 1) / 2) for n, count in ((column, counts[1]), (row, counts[0])))
        picture, dark = lenslets.view(planes, told, (turn * right, turn * down))
        values[row, column] = picture[::turn, ::turn]
        missing += dark
        tell(progress, row * counts[1] + column + 1, math.prod(counts))
    share = missing / math.prod((*counts, *lenslets.shape))
    if share > 0.01:
        warn_of_result(
            f"{share:.1%} of the samples lie where the white image is dark (below {DARK_SHARE:.0%} of its bright "
            "part), and are 0: take fewer views"
        )
    return set_to_zero(values)


@dataclass(frozen=True, eq=False)
class _Prepared:
    """A recording without dark charge and vignetting.

    Args:
        raw: shape (rows, columns[, channels]).
        told: 1 where the white image is bright, otherwise 0, (rows, columns); None without a white image.
        color_filter: of the recording's mosaic, or None.
    """

    raw: Array
    told: Floats | None
    color_filter: ColorFilter | None

    @property
    def shape(self) -> tuple[int, int]:
        return self.raw.shape[0], self.raw.shape[1]

    @classmethod
    def of(
        cls, recording: Any, camera: Camera | None, white: Any, dark: Any, color_filter: ColorFilter | None
    ) -> _Prepared:
        raw = numbers_of(recording, "the recording")
        if camera is not None and raw.shape[:2] != camera.sensor.shape:
            rows, columns = camera.sensor.shape
            raise InputError(
                f"the recording is {raw.shape[0]}×{raw.shape[1]} pixels and the camera's sensor {rows}×{columns}: "
                "give the whole recording, or a camera whose sensor is the part that was kept"
            )
        kept = recording.electronics.color_filter if isinstance(recording, Recording) else color_filter
        if kept is not None and raw.ndim != 2:
            raise InputError(
                f"behind a colour filter a pixel has one number; the recording's shape is {raw.shape}"
            )
        darkness = 0.0 if dark is None else numbers_like(dark, raw, "the dark frame")
        raw = raw - darkness
        if white is None:
            return cls(raw, None, kept)
        light = numbers_like(white, raw, "the white image") - darkness
        faintest = DARK_SHARE * brightness_of(white, light)
        shown = grey(light) if kept is None else evened_out(grey(light))
        return cls(raw / np.maximum(light, faintest), (shown >= faintest).astype(np.float32), kept)

    def demosaiced(self, method: Demosaicing) -> Array:
        """Demosaic the devignetted recording."""
        if self.color_filter is None:
            return self.raw
        electronics = Electronics(color_filter=self.color_filter)
        return demosaic(self.raw.astype(np.float32), electronics, method).astype(np.float64)


def _chosen_grid(
    grid: LensletGrid | None, camera: Camera | None, white: Any, dark: Any, mosaic: bool, inverted: bool
) -> LensletGrid:
    if grid is None:
        if white is not None:
            grid = find_lenslets(white, dark=dark, color_filter=mosaic)
        elif camera is not None:
            own = LensletGrid.of_camera(camera)
            return own if inverted else own.turned(camera.sensor.shape)
        else:
            raise InputError(
                "the positions of the micro-images are unknown: pass white= (a recording of a white scene), "
                "camera= or a LensletGrid"
            )
    if camera is not None:
        expected = LensletGrid.of_camera(camera)
        if grid.layout != expected.layout or abs(grid.pitch / expected.pitch - 1) > 0.02:
            raise InputError(
                f"the micro-images stand on a {grid.layout} lattice of pitch {grid.pitch:.3f} pixels, and the "
                f"camera's own on a {expected.layout} one of {expected.pitch:.3f}: they are not of this camera"
            )
    return grid


def _view_counts(views: Any, grid: LensletGrid, view_step: float) -> tuple[int, int]:
    above_zero("view_step", view_step, unit="pixels")
    pitches = grid.pitches[::-1]  # (rows, columns)
    most = tuple(1 + 2 * math.floor((pitch / 2 - 0.5) / view_step + 1e-9) for pitch in pitches)
    if views is None:
        if min(most) < 3:
            raise InputError(
                f"micro-images of {min(pitches):.2f} pixels hold no 3 views {view_step} pixels apart: "
                "take a smaller view_step, or views=1"
            )
        return most[0], most[1]
    counts = tuple(views) if isinstance(views, tuple | list) else (views, views)
    if len(counts) != 2:
        raise InputError(f"views is {views!r}: give how many, one whole number or (rows, columns)")
    for count, pitch, fitting in zip(counts, pitches, most, strict=True):
        if (whole_number(count) or 0) < 1:
            raise InputError(f"views is {views!r}: give how many, one whole number or (rows, columns)")
        if (count - 1) / 2 * view_step > pitch / 2:
            raise InputError(
                f"{count} views {view_step} pixels apart do not fit into micro-images of {pitch:.2f} pixels: "
                f"take {fitting} at most"
            )
    return int(counts[0]), int(counts[1])


def _frame(
    camera: Camera, lenslets: LensletViews, counts: tuple[int, int], view_step: float, inverted: bool
) -> Affine:
    """From indices of the decoded light field to rays at the camera's entrance plane."""
    optics = LensletOptics.of(camera)
    sign = -1.0 if inverted else 1.0
    rows, columns = lenslets.shape
    sensor_from_pixel = camera.sensor.frame
    if not inverted:  # the recording was rotated by 180°
        height, width = camera.sensor.shape
        turned = Affine(np.array([[-1.0, 0, width - 1], [0, -1.0, height - 1], [0, 0, 1]]))
        sensor_from_pixel = sensor_from_pixel @ turned
    lenslet_from_sensor = optics.sensor_from_array.inverse()
    last = np.array(lenslets.start) + lenslets.step * np.array([columns - 1, rows - 1])
    first = last if inverted else np.array(lenslets.start)

    def ray(index: Array) -> Array:
        centre = sensor_from_pixel(first + sign * lenslets.step * index[2:])
        middle = np.array([(counts[1] - 1) / 2, (counts[0] - 1) / 2])
        offset = sensor_from_pixel.linear @ (sign * view_step * (index[:2] - middle))
        lenslet = lenslet_from_sensor(centre)
        return np.concatenate([lenslet, (centre + offset - lenslet) / optics.gap])

    origin = ray(np.zeros(4))
    linear = np.stack([ray(unit) - origin for unit in np.eye(4)], axis=1)
    return optics.rays_at_array.inverse() @ Affine.from_parts(linear, origin)
