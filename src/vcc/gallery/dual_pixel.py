"""Depth from the two images of a dual-pixel sensor (Garg et al. 2019; Punnappurath et al. 2020)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import PointSpread, psf
from vcc.base.errors import without_result_warnings
from vcc.base.units import um
from vcc.camera import Camera
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.gallery.flat_target import flat
from vcc.image import Image, PhotodiodeImage
from vcc.optics.electronics import Electronics
from vcc.optics.pixels import Microlens
from vcc.optics.sensor import Sensor
from vcc.recording import expose_image
from vcc.recover import PhotodiodeDepth, PhotodiodeDisparity, depth_by_photodiodes
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import away

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

MICROLENS = 1.2
"""F-number of the microlenses."""
POINT_VIEWS, POINT_PITCH = 60, 4 * um
"""Views a side of the light field of a point, and pixels of its images."""
VERGENCES = 9
"""Distances of points on the axis."""
PSF_PIXELS = 30
"""Width of the point spread functions that are compared, pixels."""
CONFIDENT = 0.8
"""Least confidence of blocks that count."""
FEWEST = 20
"""Blocks of which an error is stated."""
GAIN = 1.5
"""Of the difference of both images, over the radiance."""


@dataclass(frozen=True, eq=False)
class Found:
    """Depth by one camera.

    Args:
        line: its disparity by distance.
        pitch: of its pixels, horizontal, metres.
        depth: of blocks.
        trusted: which of them count.
    """

    line: PhotodiodeDisparity
    pitch: float
    depth: PhotodiodeDepth
    trusted: Flags


@dataclass(frozen=True)
class Run:
    """One exposure of dual pixels: both images, point spread functions, disparity and depth.

    Args:
        block: side of the blocks that are matched, pixels.
        step: from block to block, pixels.
    """

    block: int = 15
    step: int = 8

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Capture a light field by dual pixels, and measure."""
        camera, step = designed(bench), Steps(progress, 7)
        image = camera.capture(bench.light_field)
        assert isinstance(image, PhotodiodeImage)
        step()
        plain = replace(camera.sensor, photodiodes=(1, 1), microlens=None)
        whole = Camera(camera.elements, plain).capture(bench.light_field)
        step()
        points = _disparities(bench)
        step()
        spreads = _spreads(bench)
        step()
        electronic = replace(camera.sensor, electronics=Electronics())
        far = designed(bench, bench.far)
        found = {
            "without noise": self._found(bench, camera, image),
            "with noise": self._found(bench, camera, expose_image(image, electronic, seed=1).image()),
            f"focused {away(bench.far)}": self._found(bench, far, far.capture(bench.light_field)),
        }
        step()
        truth = None if bench.scene is None else _planes(bench, camera)
        numbers = [_sum_finding(image, whole), *_line_findings(bench, points), *_mirror_findings(spreads)]
        for words, each in found.items():
            numbers += _depth_findings(bench, words, each, truth, self.block)
        text = prose(__name__, bench=bench, camera=camera, block=self.block)
        return Result(text, _pictures(bench, image, spreads, points, found, truth), tuple(numbers), bench.assumed)

    def _found(self, bench: Bench, camera: Camera, image: Image) -> Found:
        nearest = min(bench.near, *bench.scene.distances) if bench.scene else bench.near
        with without_result_warnings():  # blocks without texture: they are left grey
            depth = depth_by_photodiodes(
                image, camera, (0.7 * nearest, math.inf), block=self.block, step=self.step
            )
        trusted = (depth.confidence > CONFIDENT) & np.isfinite(depth.disparity)
        return Found(PhotodiodeDisparity.of(camera), camera.sensor.pitches[1], depth, trusted)


def designed(bench: Bench, focus: float | None = None) -> Camera:
    """The conventional camera with two photodiodes in each pixel; focused in the middle by default."""
    camera = bench.conventional(bench.middle if focus is None else focus)
    sensor = replace(camera.sensor, photodiodes=(1, 2), microlens=Microlens(f_number=MICROLENS))
    return Camera(camera.elements, sensor)


def slope(bench: Bench) -> float:
    """Of disparity over 1/Z, round opening of radius R halved by the photodiodes: 8R/(3π)·d, metres²."""
    return 4 * bench.diameter / (3 * math.pi) * bench.image_distance(bench.middle)


# -- points


def _vergences(bench: Bench) -> Array:
    """From the near to the far distance, 1/m."""
    return np.linspace(1 / bench.far, 1 / bench.near, VERGENCES)


def _disparities(bench: Bench) -> Array:
    """The disparity of captured images of points on the axis at `_vergences`, metres."""
    z = bench.image_distance(bench.middle)
    found = []
    for vergence in _vergences(bench):
        blur = bench.diameter * z * abs(vergence - 1 / bench.middle)
        pixels = 2 * math.ceil(0.6 * blur / POINT_PITCH) + 9
        sensor = Sensor(
            z, (pixels, pixels), POINT_PITCH, photodiodes=(1, 2), microlens=Microlens(f_number=MICROLENS)
        )
        point = flat(np.ones((1, 1)), bench.diameter / POINT_VIEWS, POINT_PITCH / 0.05, 1 / vergence, POINT_VIEWS)
        with without_result_warnings():
            # The light field holds only the point: most of the sensor's rays are missing.
            image = Camera([bench.lens], sensor).capture(point, between_views="none")
        assert isinstance(image, PhotodiodeImage)
        light = [each.to_numpy().sum(axis=0, dtype=np.float64) for each in image.photodiodes[0]]
        left, right = (float(each @ sensor.column_places / each.sum()) for each in light)
        found.append(left - right)
    return np.array(found)


def _spreads(bench: Bench) -> dict[tuple[str, str], PointSpread]:
    """Point spread functions of both photodiodes, equally far in front of the focus and behind."""
    camera = designed(bench)
    off = 0.8 * min(1 / bench.near - 1 / bench.middle, 1 / bench.middle - 1 / bench.far)
    pitch = bench.diameter * camera.sensor.z * off / PSF_PIXELS
    side = PSF_PIXELS + 5
    return {
        (place, name): psf(
            camera.photodiode(0, column), 1 / (1 / bench.middle + sign * off), pitch=pitch, shape=(side, side)
        )
        for place, sign in (("in front of the focus", 1), ("behind the focus", -1))
        for column, name in enumerate(("left", "right"))
    }


# -- findings


def _sum_finding(image: PhotodiodeImage, whole: Image) -> Finding:
    ordinary = whole.to_numpy()
    largest = float(np.abs(image.to_numpy() - ordinary).max() / ordinary.max())
    return Finding(
        "left + right against the ordinary image: largest difference",
        "the same image, to 1e-5 of the brightest pixel",
        largest,
        "of the brightest pixel",
        largest <= 1e-5,
        "float32",
    )


def _line_findings(bench: Bench, points: Array) -> Iterator[Finding]:
    vergences, expected = _vergences(bench), slope(bench)
    steep, start = np.polyfit(vergences, points, 1)
    off = float(np.abs(points - start - steep * vergences).max() / np.ptp(points))
    focus = -start / steep
    what = f"disparity of captured points from {away(bench.near)} to {away(bench.far)}"
    yield Finding(
        f"{what}: slope over 1/Z",
        f"8R/(3π)·d = {expected / um:.1f} µm per 1/m, within 1 %",
        float(steep) / um,
        "µm per 1/m",
        bool(abs(steep / expected - 1) <= 0.01),
        f"the opening is {POINT_VIEWS} views wide",
    )
    yield Finding(
        "the same: largest distance from the line", "within 1 % of the range", 100 * off, "%", off <= 0.01
    )
    claim = f"in focus, {away(bench.middle)}, within 1 %"
    right = abs(focus * bench.middle - 1) <= 0.01
    yield Finding("the same: distance of disparity 0", claim, float(1 / focus), "m", bool(right))


def _mirror_findings(spreads: dict[tuple[str, str], PointSpread]) -> Iterator[Finding]:
    front, behind = ({name: spreads[place, name].values for name in ("left", "right")} for place in _PLACES)
    for words, one, other in (
        ("left behind the focus against right in front", behind["left"], front["right"]),
        ("left in front of the focus, mirrored, against right", front["left"][:, ::-1], front["right"]),
    ):
        largest = 100 * float(np.abs(one - other).max() / one.max())
        yield Finding(
            f"point spread functions: {words}", "the same, within 1 % of the peak", largest, "%", largest <= 1
        )


_PLACES = ("in front of the focus", "behind the focus")


def _depth_findings(bench: Bench, words: str, found: Found, truth: Array | None, block: int) -> Iterator[Finding]:
    depth = found.depth
    if bench.scene is None or truth is None:
        if found.trusted.any():
            median = float(np.median(depth.distance[found.trusted]))
            yield Finding(f"median distance, {words}", "", median, "m", None, "the truth is unknown")
        return
    for plane, share in zip(bench.scene.planes, truth, strict=True):
        expected = found.line.disparity_of(plane.distance) / found.pitch
        alone = found.trusted & _whole(share, depth, expected, block)
        if np.count_nonzero(alone) < FEWEST:
            continue
        off = float(np.median(np.abs(depth.distance[alone] / plane.distance - 1)))
        median = float(np.median(np.abs(depth.disparity[alone] - expected)))
        bias = float(np.median(depth.disparity[alone])) - expected
        where = f"{away(plane.distance)}, {words}: median error"
        in_focus = "; in focus both images are the same" if abs(expected) < 0.01 else ""
        yield Finding(
            f"disparity {where}",
            f"{expected:.2f} pixels, within 0.15",
            median,
            "pixels",
            median <= 0.15,
            f"{np.count_nonzero(alone):,} blocks; their median is off by {bias:+.3f}{in_focus}",
        )
        yield Finding(f"distance {where}", "within 5 %", 100 * off, "%", off <= 0.05)


def _planes(bench: Bench, camera: Camera) -> Array:
    """The share of each pixel in which a pinhole sees each plane, as light lands, (planes, rows, columns)."""
    assert bench.scene is not None
    sensor = camera.sensor
    s, t = sensor.column_places[None, :] / sensor.z, sensor.row_places[:, None] / sensor.z
    pixel = (sensor.pitches[1] / sensor.z, sensor.pitches[0] / sensor.z)
    shares, through = [], np.ones(sensor.shape)
    for plane in bench.scene.planes:
        opacity = plane.along(np.zeros(()), np.zeros(()), s, t, pixel)[1][..., 3]
        shares.append(through * opacity)
        through = through * (1 - opacity)
    return np.stack(shares)


def _at_blocks(depth: PhotodiodeDepth, values: Array, disparity: float = 0.0) -> Array:
    """Values of pixels at the middles of blocks, where these lie in the sum of both images."""
    columns = np.clip(np.rint(depth.columns - disparity / 2), 0, values.shape[1] - 1)
    return np.asarray(values[np.ix_(depth.rows.astype(int), columns.astype(int))])


def _whole(share: Array, depth: PhotodiodeDepth, disparity: float, block: int) -> Flags:
    """Which blocks, with the blur around them, show one plane alone."""
    from scipy.ndimage import minimum_filter

    blur = math.ceil(abs(disparity) * 3 * math.pi / 4)  # disparity is 4/(3π) of the width of the disc
    lowest = minimum_filter(share, size=block + 2 * blur + 2)
    return np.asarray(_at_blocks(depth, lowest, disparity) > 0.99)


# -- pictures


def _pictures(
    bench: Bench,
    image: PhotodiodeImage,
    spreads: dict[tuple[str, str], PointSpread],
    points: Array,
    found: dict[str, Found],
    truth: Array | None,
) -> tuple[tuple[Picture, ...], ...]:
    exposure = bench.exposure(designed(bench), bench.diameter)
    left, right = (each.upright().to_numpy().mean(axis=2) for each in image.photodiodes[0])
    apart = np.clip(0.5 + GAIN * (left - right) * exposure, 0, 1).astype(np.float32)
    difference = np.repeat(apart[..., None], 3, axis=2)
    return (
        (
            Picture("recording", "Both photodiodes", "The ordinary image.", figures.shown(image.sum(), exposure)),
            Picture(
                "difference",
                "Left minus right",
                "Grey is 0: what is in focus. Edges nearer and farther than the focus have opposite signs.",
                difference,
            ),
        ),
        *below(
            Picture(
                "points",
                "Points",
                "As light lands: half discs, which change sides at the focus, and the disparity of centroids.",
                _point_figure(bench, spreads, points),
            ),
            Picture(
                "depth",
                "Distance from disparity",
                "Where blocks of both images match; grey elsewhere.",
                _depth_figure(bench, found, truth),
            ),
        ),
    )


def _point_figure(bench: Bench, spreads: dict[tuple[str, str], PointSpread], points: Array) -> figures.Figure:
    figure = figures.new_figure(8.4, 3.6)
    grid = figure.add_gridspec(2, 4, width_ratios=(1, 1, 0.12, 2.4))
    for row, place in enumerate(_PLACES):
        for column, name in enumerate(("left", "right")):
            values = spreads[place, name].values.astype(np.float32)
            axes = figure.add_subplot(grid[row, column])
            figures.put(axes, values / values.max(), f"{name} photodiode" if row == 0 else "")
            if column == 0:
                axes.set_ylabel(
                    place.replace(" the focus", "\nthe focus"), fontsize=figures.LABEL, color=figures.INK
                )
    axes = figure.add_subplot(grid[:, 3])
    vergences = _vergences(bench)
    line = slope(bench) * (vergences - 1 / bench.middle)
    axes.plot(vergences, line / um, color=figures.INK, linewidth=1, label="8R/(3π) · d · (1/Z − 1/F)")
    axes.plot(vergences, points / um, "o", color=figures.ACCENT, markersize=5, label="captured points")
    axes.axhline(0, color=figures.QUIET, linewidth=0.6)
    figures.label(axes, "1/Z [1/m]", "disparity, left − right [µm]")
    axes.legend(fontsize=figures.LABEL, frameon=False)
    return figure


def _depth_figure(bench: Bench, found: dict[str, Found], truth: Array | None) -> figures.Figure:
    maps = []
    if bench.scene is not None and truth is not None:
        nearest = 1 / np.array(bench.scene.distances)[truth.argmax(axis=0)]
        maps.append(("truth", _at_blocks(next(iter(found.values())).depth, nearest)))
    for words, each in found.items():
        maps.append((words, np.where(each.trusted, 1 / each.depth.distance, np.nan)))
    figure = figures.new_figure(3.1 * len(maps) + 0.8, 3.3)
    grid = figure.subplots(1, len(maps))
    far, near = 1 / bench.far, 1 / bench.near
    margin = 0.1 * (near - far)
    for axes, (title, vergence) in zip(grid, maps, strict=True):
        axes.set_facecolor("#bbbbbb")
        upright = vergence[::-1, ::-1].astype(np.float32)
        shown = figures.put(axes, upright, title, vmin=max(far - margin, 0), vmax=near + margin, cmap="viridis")
    bar = figure.colorbar(shown, ax=grid, shrink=0.8)
    bar.set_label("1/distance [1/m]", fontsize=figures.LABEL)
    return figure


ENTRY = Entry(
    "dual-pixel",
    "Dual pixels",
    "R. Garg, N. Wadhwa, S. Ansari and J. T. Barron, Learning single camera depth estimation using dual-pixels, "
    "ICCV 2019; A. Punnappurath, A. Abuolaim, M. Afifi and M. S. Brown, Modeling defocus-disparity in dual-pixel "
    "sensors, ICCP 2020",
    "The two photodiodes of a pixel see the scene through the two halves of the lens: their disparity is linear "
    "in the inverse distance and 0 in focus.",
    Run(),
)
