"""Angle-sensitive pixels: a light field from sinusoidal angular responses (Wang, Gill and Molnar 2009)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vcc.base.measures import decibels, psnr
from vcc.camera import Camera
from vcc.gallery import angle_sensitive_camera
from vcc.gallery import angle_sensitive_figures as drawn
from vcc.gallery.angle_sensitive_camera import (
    LENSLET,
    PHASES,
    STEEPEST,
    TILE,
    VIEWS,
    AngleSensitive,
    captured,
    designed,
    lenslet_views,
    measured_responses,
    photograph,
    through_lenslets,
)
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.image import Image
from vcc.light_field import LightField
from vcc.recording import expose_image
from vcc.recover import refocused
from vcc.showcase import figures
from vcc.showcase.bench import Bench
from vcc.showcase.words import away

Array = NDArray[np.float64]

BORDER = 3
"""Tiles at each border that are not compared."""
NEAR_ENOUGH = 0.25
"""Pixels between measured and expected disparities."""


@dataclass(frozen=True)
class Run:
    """Measure the pixels' response, record a light field once, decode and refocus it, and compare.

    Args:
        most: tiles along the longer side of the sensor.
        rays: for each pixel of the plenoptic camera.
    """

    most: int = 200
    rays: int = 64

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Take a light field through both cameras, and measure."""
        steps = Steps(progress, 4)
        progress(0, steps.total)
        camera = designed(bench, self.most)
        response = measured_responses(camera)
        steps()
        recording = captured(camera.camera, bench.light_field)
        steps()
        compared = Compared.of(camera, recording, captured(camera.plenoptic, bench.light_field, self.rays))
        steps()
        numbers = (*_pixel_findings(compared, response), *compared.findings())
        result = Result(
            prose(__name__, camera=camera, pixels=angle_sensitive_camera),
            _pictures(compared, response),
            numbers,
            bench.assumed,
        )
        steps()
        return result


@dataclass(frozen=True, eq=False)
class Compared:
    """What came of the recording, beside the truth and other cameras.

    Args:
        camera: with its pixels.
        recording: irradiance.
        views: by the name of the camera: "angular", "sharp" (decoded without smoothing), "even" (pixels without a
            response), "plenoptic".
        noisy: views of recordings with noise, "angular" and "plenoptic"; also negative, so that noise has no mean.
        truth: true views by the number across.
        distances: to focus on, metres, by name.
        refocused: pictures, by the name of the camera and of the distance; "ideal" for a lens focused there.
        photograph: what ordinary pixels half as wide as tiles record, as light lands.
        white: radiance.
    """

    camera: AngleSensitive
    recording: Image
    views: dict[str, LightField]
    noisy: dict[str, Array]
    truth: dict[int, Array]
    distances: dict[str, float]
    refocused: dict[str, dict[str, Array]]
    photograph: Array
    white: float

    @classmethod
    def of(cls, camera: AngleSensitive, recording: Image, lenslets: Image) -> Compared:
        """Decode, refocus, and make the pictures to compare with."""
        field, plenoptic = camera.bench.light_field, camera.plenoptic
        even = replace(camera, modulation=0.0)
        plain = captured(Camera(camera.elements(camera.stop), camera.sensor(TILE)), field)
        bright = expose_image(lenslets, plenoptic.sensor, "auto")
        lit = replace(recording, values=np.maximum(recording.to_numpy(), 0))  # sharp samples ring below 0
        dim = expose_image(lit, camera.sensor(TILE), bright.exposure)
        views = {
            "angular": camera.decoded(recording),
            "sharp": replace(camera, smoothing=0.0).decoded(recording),
            "even": even.decoded(plain * 0.5),
            "plenoptic": through_lenslets(camera, lenslets),
        }
        noisy = {"angular": camera.views(dim.image()), "plenoptic": lenslet_views(camera, bright.image())}
        truth = {count: camera.true_views(field, count) for count in (VIEWS, LENSLET)}
        distances = camera.bench.distances
        pictures = {
            name: {place: _focused(views[name], distance) for place, distance in distances.items()}
            for name in ("angular", "even", "plenoptic")
        }
        pictures["ideal"] = {place: camera.ideal(field, distance) for place, distance in distances.items()}
        white = 1.0 if camera.bench.scene is not None else float(np.percentile(truth[VIEWS], 99.5))
        return cls(camera, recording, views, noisy, truth, distances, pictures, camera.photograph(field, 2), white)

    def decibels(self, name: str, noisy: bool = False) -> Array:
        """Of each view against the true one, (v, u); ``noisy``: of the recording with noise."""
        values = self.noisy[name] if noisy else np.asarray(self.views[name].values, np.float64)
        error = inner(np.moveaxis(values - self.truth[values.shape[0]], (0, 1), (2, 3)))
        power = np.mean(error**2, axis=(0, 1, 4))
        return np.array([[decibels(float(each), self.white) for each in row] for row in power])

    def of_refocused(self, name: str, place: str) -> float:
        """Decibels of a refocused picture against that of the lens focused there."""
        return psnr(inner(self.refocused[name][place]), inner(self.refocused["ideal"][place]), self.white)

    @property
    def doubled(self) -> Array:
        """The photograph in the recording, as light lands: complementary neighbours summed, two rows averaged."""
        pairs = photograph(self.camera.radiance(self.recording))
        return np.asarray((pairs[::2] + pairs[1::2]) / 2)

    def findings(self) -> Iterator[Finding]:
        """How close views and refocused pictures come, beside other cameras."""
        mean = {name: float(self.decibels(name).mean()) for name in self.views}
        yield Finding(
            f"{VIEWS}×{VIEWS} decoded views against the true ones, mean PSNR",
            "better than without an angular response",
            mean["angular"],
            "dB",
            mean["angular"] > mean["even"],
            f"worst view {self.decibels('angular').min():.1f} dB. Pixels of one kind are a tile apart, so that "
            f"sharp detail aliases; {mean['sharp']:.1f} dB without smoothing differences between directions",
        )
        yield Finding("the same without an angular response: all views are equal", "", mean["even"], "dB")
        yield Finding(
            f"{LENSLET}×{LENSLET} views of a plenoptic camera with as many pixels against true ones, mean PSNR",
            "",
            mean["plenoptic"],
            "dB",
            why="its views have as many pixels; a lenslet averages over the whole tile, and does not alias",
        )
        yield from self._disparities()
        for place, distance in self.distances.items():
            found, even, plenoptic = (self.of_refocused(name, place) for name in ("angular", "even", "plenoptic"))
            out_of_focus = place != "middle"
            yield Finding(
                f"refocused {place} ({away(distance)}) against the lens focused there, PSNR",
                "better than without an angular response" if out_of_focus else "",
                found,
                "dB",
                found > even if out_of_focus else None,
                f"without an angular response {even:.1f} dB; plenoptic camera {plenoptic:.1f} dB",
            )
        plenoptic = float(self.decibels("plenoptic", noisy=True).mean())
        yield Finding(
            "views with noise, mean PSNR",
            "",
            float(self.decibels("angular", noisy=True).mean()),
            "dB",
            why=f"plenoptic camera at the same exposure time {plenoptic:.1f} dB: its pixels receive "
            "twice the light, and decoding does not amplify noise. Here least squares amplify it "
            f"{self.camera.noise_gain():.1f} times before smoothing",
        )
        mean_view = np.asarray(self.views["angular"].values, np.float64).mean(axis=(0, 1))
        found = psnr(inner(self.doubled), inner(self.photograph), self.white)
        coarse = np.repeat(np.repeat(mean_view[::-1, ::-1], 2, axis=0), 2, axis=1)
        views = psnr(inner(coarse), inner(self.photograph), self.white)
        yield Finding(
            "photograph with two pixels a tile each way, against ordinary pixels, PSNR",
            "the same recording holds a photograph of higher resolution than the views",
            found,
            "dB",
            found > views,
            f"sums of complementary neighbours; the mean of the views, enlarged, {views:.1f} dB",
        )

    def _disparities(self) -> Iterator[Finding]:
        """Of the nearest and the farthest objects, in pixels of a view."""
        scene, decoded = self.camera.bench.scene, self.views["angular"]
        measured = decoded.measured_disparity_range()
        if scene is None or measured is None:
            return
        even = self.views["even"].measured_disparity_range() or (0.0, 0.0)
        for name, got, without, distance in zip(
            ("farthest", "nearest"), measured, even, (max(scene.distances), min(scene.distances)), strict=True
        ):
            wanted = decoded.disparity_of(distance)
            yield Finding(
                f"disparity of the {name} objects in the decoded views",
                f"{wanted:.2f} pixels by the closed form ({away(distance)}), within {NEAR_ENOUGH}",
                got,
                "pixels a view",
                abs(got - wanted) <= NEAR_ENOUGH,
                f"without an angular response {without:.2f}",
            )


def inner(picture: Array) -> Array:
    """A picture without its borders."""
    return picture[BORDER:-BORDER, BORDER:-BORDER]


def _focused(views: LightField, distance: float) -> Array:
    return np.asarray(refocused(views, distance, between_views="none").to_numpy(), np.float64)


def _pixel_findings(compared: Compared, response: tuple[Array, Array, Array]) -> Iterator[Finding]:
    _, measured, formula = response
    off = float(np.abs(measured - formula).max())
    yield Finding(
        f"response of {len(PHASES)} phases over ±{math.degrees(math.atan(STEEPEST)):.0f}°: largest difference",
        "½(1 + m·cos(β·θ + α)), within 0.01",
        off,
        "",
        off < 0.01,
        f"a white scene through a pinhole, β = {compared.camera.frequency:.1f}",
    )
    camera = compared.camera
    full = camera.photograph(camera.bench.light_field, TILE)
    passed = float(inner(camera.radiance(compared.recording)).mean() / inner(full).mean())
    yield Finding(
        "light that the pixels record of what ordinary pixels would",
        "½, within 1 %",
        passed,
        "",
        abs(passed / 0.5 - 1) < 0.01,
        "the phases of a tile add up to an even response",
    )


def _pictures(compared: Compared, response: tuple[Array, Array, Array]) -> tuple[tuple[Picture, ...], ...]:
    camera, white = compared.camera, compared.white
    rows, columns = camera.tiles
    return below(
        Picture(
            "response",
            "Responses of the pixels",
            "Left, measured from a recording (dots) and by the formula (lines). Right, the responses of the "
            f"tile’s {TILE}×{TILE} pixels over the aperture, seen from the middle of the sensor: a grating a "
            "row, a phase a column.",
            drawn.response_figure(response, camera.tile, camera.stop / camera.to_sensor),
        ),
        Picture(
            "recording",
            "The recording, and a piece of it",
            f"{rows * TILE}×{columns * TILE} pixels, upright, brightened twofold. Where the scene is out of "
            "focus, light from different parts of the lens differs, and so do the pixels of a tile.",
            drawn.recording_figure(
                camera.radiance(compared.recording)[::-1, ::-1] * 2 / white, compared.truth[VIEWS], TILE
            ),
        ),
        Picture(
            "views",
            "Views, true and decoded",
            f"Left and right end of the middle row; {rows}×{columns} pixels. Where the scene is in focus, sharp "
            "detail aliases. Without an angular response all views are equal.",
            drawn.views_figure(
                {
                    "true": (compared.truth[VIEWS], None),
                    "decoded": (np.asarray(compared.views["angular"].values), compared.decibels("angular")),
                    "no angular response": (np.asarray(compared.views["even"].values), compared.decibels("even")),
                },
                white,
            ),
        ),
        Picture(
            "refocused",
            "Refocused from that one recording",
            "In the last row, the same lens focused there, with pixels as wide as tiles.",
            drawn.table(
                _refocused_rows(compared), ("angle-sensitive", "no angular response", "lens focused there")
            ),
        ),
    )


def _refocused_rows(compared: Compared) -> list[list[tuple[str, figures.Shown]]]:
    """Titles and pictures: decoded, without an angular response, and those of the lens focused there."""
    rows = []
    for name in ("angular", "even", "ideal"):
        row = []
        for place, distance in compared.distances.items():
            reached = "" if name == "ideal" else f": {compared.of_refocused(name, place):.1f} dB"
            title = f"{place}, {away(distance)}{reached}"
            row.append((title, figures.values_shown(compared.refocused[name][place], compared.white)))
        rows.append(row)
    return rows


ENTRY = Entry(
    "angle-sensitive-pixels",
    "Angle-sensitive pixels",
    "A. Wang, P. Gill and A. Molnar, Light field image sensors based on the Talbot effect, Applied Optics 48, "
    "2009; M. Hirsch, S. Sivaramakrishnan, S. Jayasuriya, A. Wang, A. Molnar, R. Raskar and G. Wetzstein, "
    "A switchable light field camera architecture with angle sensitive pixels and dictionary-based sparse coding, "
    "ICCP 2014",
    "Pixels under pairs of gratings respond sinusoidally to the angle of incidence. A tile of them records a "
    "light field of low resolution, decoded by linear processing, and a photograph of higher resolution.",
    Run(),
)
