"""Novel views from two-plane data by matrix optics (Levoy and Hanrahan 1996; Ahrenberg and Magnor 2006)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.errors import InputError, without_result_warnings
from vcc.base.measures import psnr
from vcc.base.units import mm
from vcc.camera import Camera
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, prose
from vcc.light_field import LightField
from vcc.optics import Mask
from vcc.optics.sensor import Sensor
from vcc.shapes.patterns import Circle
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import length

STEP = 20 * mm
"""Distance of new viewpoints before and behind the plane of the views."""
INNER = 0.1
"""Share of an image at each side that comparisons exclude, because the views end there."""
POINTS = 4
"""Points across a pixel at which the closed form is evaluated, each way."""
WORDS = {
    "nearest": "the nearest view",
    "linear": "quadrilinear",
    "along the parallax": "pinhole camera, blended along the parallax of the middle distance",
}
"""The methods that predict an omitted view."""


def run(bench: Bench, progress: Progress) -> Result:
    """Omit every second view and predict it; render from viewpoints without a camera."""
    light_field = bench.light_field
    if min(light_field.shape[:2]) < 3:
        raise InputError(
            f"leaving out every second view takes 3×3 views or more, not {light_field.shape[0]}×"
            f"{light_field.shape[1]}: give a light field with more"
        )
    place = _left_out(light_field.shape[0]), _left_out(light_field.shape[1])
    truth = _linear(light_field.values[place], light_field)
    predicted = _predicted(light_field, place, progress)
    decibels = {name: _psnr(picture, truth) for name, picture in predicted.items()}
    progress(3, 6)
    moved, found = _from_elsewhere(bench, progress)
    pictures = (
        (_left_out_picture(truth, predicted, decibels),),
        tuple(Picture(f"from-{name}", title, caption, content) for name, title, caption, content in moved),
    )
    text = prose(__name__, views=light_field.shape[:2])
    return Result(text, pictures, (*_predictions(decibels), *found), bench.assumed)


def _predicted(
    light_field: LightField, place: tuple[int, int], progress: Progress
) -> dict[str, NDArray[np.float64]]:
    """The view at a place, predicted from every second view each way, by the names of `WORDS`."""
    kept = light_field[::2, ::2]
    predicted = {}
    for done, method in enumerate(("nearest", "linear")):
        progress(done, 6)
        predicted[method] = resampled_view(kept, light_field, place, method)
    progress(2, 6)
    return predicted | {"along the parallax": _through_a_pinhole(kept, light_field, place)}


def _predictions(decibels: dict[str, float]) -> list[Finding]:
    nearest = decibels["nearest"]
    return [
        Finding(
            f"left-out view, {WORDS[name]}: PSNR",
            "" if name == "nearest" else "better than the nearest view",
            value,
            "dB",
            None if name == "nearest" else value > nearest,
        )
        for name, value in decibels.items()
    ]


def _left_out_picture(
    truth: NDArray[np.float64], predicted: dict[str, NDArray[np.float64]], decibels: dict[str, float]
) -> Picture:
    shown = {"left out": figures.values_shown(truth)}
    for name, picture in predicted.items():
        shown[f"{WORDS[name].split(',')[0]}, {decibels[name]:.1f} dB"] = figures.values_shown(picture)
    size = max(min(truth.shape[:2]) * 22 // 100, 8)
    wrong = np.abs(figures.values_shown(predicted["nearest"]) - shown["left out"])
    crops = figures.detailed_crops([wrong], size)
    close = figures.close_ups(list(shown.items()), crops, ["where they differ most"])
    return Picture("left-out", "A view that was left out", "And as the other views predict it.", close)


def _left_out(count: int) -> int:
    """The odd index next to the middle that has kept views on both sides."""
    index = count // 2 if count // 2 % 2 else count // 2 - 1
    return min(max(index, 1), count - 2)


def _linear(values: NDArray[np.generic], light_field: LightField) -> NDArray[np.float64]:
    picture = np.asarray(values, np.float64) / light_field.full_scale
    return picture if picture.ndim == 3 else picture[..., None]


def resampled_view(
    kept: LightField, light_field: LightField, place: tuple[int, int], interpolation: str
) -> NDArray[np.float64]:
    """A view predicted from the samples around it by interpolation in all four dimensions.

    Args:
        kept: every second view each way.
        light_field: the original one.
        place: (row, column) of the view in it.
        interpolation: "nearest" or "linear".
    """
    row, column = place
    frame = light_field.frame @ Affine.translation(column, row, 0, 0)
    # Use the neighbours only, because resampling keeps all four dimensions in memory.
    near = kept[row // 2 : row // 2 + 2, column // 2 : column // 2 + 2]
    # A slight shift: half-way between two views, rounding would decide which one is nearest.
    frame = frame @ Affine.translation(-0.01, -0.01, 0, 0) if interpolation == "nearest" else frame
    view = near.resampled(frame, (1, 1, light_field.shape[2], light_field.shape[3]), interpolation=interpolation)
    return _linear(view.values[0, 0], view)


def _through_a_pinhole(kept: LightField, light_field: LightField, place: tuple[int, int]) -> NDArray[np.float64]:
    """The image of a pinhole camera at a view's position, with the pixels of the view."""
    row, column = place
    nt, ns = light_field.shape[2:4]
    u, v, s, t = light_field.frame([column, row, (ns - 1) / 2, (nt - 1) / 2])
    return pinhole_picture(kept, light_field, (float(u), float(v)), (float(s), float(t)), 0.0)


def pinhole_picture(
    given: LightField, like: LightField, hole: tuple[float, float], middle: tuple[float, float], z: float
) -> NDArray[np.float64]:
    """The image of a pinhole at (u, v), z behind the light field, on a sensor with the slopes of ``like``."""
    linear = like.frame.linear
    pitches = abs(float(linear[3, 3])), abs(float(linear[2, 2]))
    distance = 50 * mm
    diameter = 1e-3 * abs(float(linear[0, 0]))
    sensor = Sensor(
        z + distance,
        (like.shape[2], like.shape[3]),
        (pitches[0] * distance, pitches[1] * distance),
        decentre=(hole[0] + distance * middle[0], hole[1] + distance * middle[1]),
    )
    camera = Camera([Mask(Circle(diameter), z=z, decentre=hole, name="pinhole")], sensor)
    with without_result_warnings():
        # The border of the image lies outside the views; comparisons exclude it.
        image = camera.capture(given, method="rays", samples=64).to_numpy()
    values = image.astype(np.float64) * distance**2 / (math.pi / 4 * diameter**2)
    # On the sensor, slopes grow with rows and columns; the rows and columns of the views may have the
    # opposite order.
    values = values[:: 1 if linear[3, 3] > 0 else -1, :: 1 if linear[2, 2] > 0 else -1]
    return values if values.ndim == 3 else values[..., None]


def _from_elsewhere(
    bench: Bench, progress: Progress
) -> tuple[list[tuple[str, str, str, figures.Shown]], list[Finding]]:
    """Views from before and behind the plane of the cameras, against the closed form if it is known."""
    light_field = bench.light_field
    nv, nu, nt, ns = light_field.shape[:4]
    u, v, s, t = (float(x) for x in light_field.frame([(nu - 1) / 2, (nv - 1) / 2, (ns - 1) / 2, (nt - 1) / 2]))
    pictures, numbers = [], []
    why = "samples interpolated in all four dimensions, what that takes from sharpness given back"
    for done, (name, title, way) in enumerate(
        (("before", "From before the cameras", -STEP), ("behind", "From behind the cameras", STEP))
    ):
        progress(4 + done, 6)
        # Nearer to the scene: propagate the light field back first, with the pinhole in its new plane.
        flown = light_field.transformed(Affine.propagation(way)) if way < 0 else light_field
        picture = pinhole_picture(flown, light_field, (u, v), (s, t), max(way, 0.0))
        caption = f"{length(STEP)} from their plane, where no camera stood."
        if bench.scene is not None:
            closeness = _psnr(picture, _true_view(bench, (u, v), (s, t), way))
            caption += f" {closeness:.1f} dB against the scene’s closed form."
            what = f"view from {length(STEP)} {name} the plane of cameras: PSNR"
            numbers.append(Finding(what, "", closeness, "dB", None, why))
        pictures.append((name, title, caption, figures.values_shown(picture)))
    return pictures, numbers


def _true_view(
    bench: Bench, hole: tuple[float, float], middle: tuple[float, float], z: float
) -> NDArray[np.float64]:
    """The scene's closed form along the rays of that pinhole, averaged over each pixel."""
    assert bench.scene is not None
    linear = bench.light_field.frame.linear
    nt, ns = bench.light_field.shape[2:4]
    inside = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    s = middle[0] + float(linear[2, 2]) * ((np.arange(ns) - (ns - 1) / 2)[:, None] + inside).ravel()
    t = middle[1] + float(linear[3, 3]) * ((np.arange(nt) - (nt - 1) / 2)[:, None] + inside).ravel()
    radiance = bench.scene.radiance_along(
        hole[0] - z * s[None, :], hole[1] - z * t[:, None], s[None, :], t[:, None]
    )
    return np.asarray(radiance.reshape(nt, POINTS, ns, POINTS, 3).mean(axis=(1, 3)))


def _psnr(picture: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    """Peak signal-to-noise ratio in linear light inside the border, with the truth's maximum as the peak."""
    rows, columns = (max(int(INNER * n), 1) for n in truth.shape[:2])
    inner = np.s_[rows:-rows, columns:-columns]
    return psnr(picture[inner], truth[inner])


ENTRY = Entry(
    "light-field-rendering",
    "Light-field rendering by matrix optics",
    "M. Levoy and P. Hanrahan, Light field rendering, SIGGRAPH 1996; L. Ahrenberg and M. Magnor, Light field "
    "rendering using matrix optics, WSCG 2006; T. Georgiev and C. Intwala, Adobe technical report, 2006",
    "New views are slices of two-plane data, without depth or matching; moving through space is a matrix.",
    run,
)
