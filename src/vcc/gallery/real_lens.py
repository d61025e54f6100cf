"""A real double Gauss, wide open and stopped down, beside the thin lens (Tronnier 1954; Kolb et al. 1995)."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.analysis import distortion, field_curvature, psf, relative_illumination
from vcc.base.cached import cached
from vcc.base.errors import without_result_warnings
from vcc.base.measures import psnr
from vcc.base.units import mm, nm, um
from vcc.camera import Camera
from vcc.gallery.entry import Entry, Finding, Picture, Progress, Result, Steps, below, prose
from vcc.gallery.flat_target import flat
from vcc.image import Image
from vcc.light_field import LightField
from vcc.optics import Lens, RealLens
from vcc.optics.prescription import Prescription
from vcc.optics.sensor import Sensor
from vcc.prescriptions import load_lens
from vcc.showcase import figures
from vcc.showcase.bench import APERTURE, Bench
from vcc.showcase.words import away

Array = NDArray[np.float64]

LENS = "double-gauss-50mm"
WAVELENGTH = 587.56 * nm
OPEN, STOPPED = 2.0, 5.6
"""F-numbers."""
WIDTH = 26 * mm
"""Of the grid of views: the entrance pupil at f/2 is 25 mm wide, and 0.7 mm wider with its aberration."""
FIELDS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Of measured illumination, fractions of the sensor's half diagonal."""
NEAR_AXIS = 0.05
"""Field at which curvature is compared with its third order, a fraction of the half diagonal."""
POINT_VIEWS, POINT_WIDTH = 60, 2 * um
"""Views a side of the light field of a point, and its width on the sensor."""
PUPIL = 0.06
"""Error of the part of the pupil that first order leaves open.

By its own aberration, the pupil on the axis has a diameter of 25.7 mm, and 5.6 % more area than by first order.
"""
ALIKE = 30.0
"""Least agreement of the stopped-down lens with the thin one in the middle third, dB."""


@dataclass(frozen=True, eq=False)
class Setup:
    """A light field over the entrance pupil, and the cameras before it.

    Args:
        field: at the plane z = 0, where the first-order entrance pupil of all lenses stands.
        focus: distance, metres.
        far: distance of the farthest objects, metres.
        shape: of the sensor, pixels.
        pitch: of its pixels, (vertical, horizontal), metres.
    """

    field: LightField
    focus: float
    far: float
    shape: tuple[int, int]
    pitch: tuple[float, float]

    @classmethod
    def of(cls, bench: Bench, width: float = WIDTH) -> Setup:
        """For a bench's light field, scaled so that its views are ``width`` metres wide."""
        scale, (rows, columns) = width / APERTURE, bench.light_field.shape[2:4]
        made = cls(
            bench.light_field.scaled(scale), scale * bench.near, scale * bench.far, (rows, columns), bench.pitch
        )
        # The same field of view as on the bench.
        larger = made.image_distance / bench.image_distance(bench.near)
        return replace(made, pitch=(larger * bench.pitch[0], larger * bench.pitch[1]))

    @property
    def _sensor(self) -> Sensor:
        return Sensor(z=0, shape=self.shape, pitch=self.pitch)

    @property
    @cached
    def real(self) -> dict[float, Camera]:
        """By f-number: the lens with its aberrations, focused by the smallest spot on the axis."""
        return {
            f_number: self.paraxial(f_number).focused_at(self.focus, by="spot") for f_number in (OPEN, STOPPED)
        }

    def paraxial(self, f_number: float) -> Camera:
        """The same, focused by first order."""
        return Camera.focused([_lens(f_number, "real")], self._sensor, self.focus)

    def first_order(self, f_number: float) -> Camera:
        """The same lens without aberrations and rims."""
        return Camera.focused([_lens(f_number, "first order")], self._sensor, self.focus)

    def thin(self, f_number: float) -> Camera:
        """The thin lens in the entrance pupil whose images have the same scale.

        An object in focus at F is imaged by x = B·(s + u/F) through both; the thin lens at a distance B from its
        sensor has 1/f = 1/F + 1/B.
        """
        distance = self.image_distance
        lens = Lens(1 / (1 / self.focus + 1 / distance), diameter=_pupil(f_number))
        return Camera([lens], replace(self._sensor, z=distance))

    @property
    @cached
    def image_distance(self) -> float:
        """B: metres on the sensor for each unit of slope, by first order."""
        return float(self.first_order(OPEN).rays_at(self.first_order(OPEN).sensor.z).linear[0, 2])

    @property
    def corner(self) -> float:
        """Half the sensor's diagonal as a slope."""
        return math.hypot(*(count * pitch / 2 for count, pitch in zip(self.shape, self.pitch, strict=True))) / (
            self.image_distance
        )

    def exposure(self, f_number: float) -> float:
        """The factor that shows radiance 1 as white on the axis."""
        return self.image_distance**2 / (math.pi / 4 * _pupil(f_number) ** 2)


def camera_of(bench: Bench) -> Camera:
    """The real lens at f/2.8, before a bench's light field as it is, focused near by first order."""
    lens = _lens(2.8, "real")
    return Camera.focused([lens], replace(bench.sensor(bench.near), z=0), bench.near)


def _lens(f_number: float, model: Any) -> Any:
    return load_lens(LENS, model=model, f_number=f_number, z_of="entrance pupil", wavelength=WAVELENGTH)


def _pupil(f_number: float) -> float:
    return float(_lens(f_number, "first order").focal_length) / f_number


@dataclass(frozen=True)
class Run:
    """Images of a scene, of points and of an even scene through three models of a lens.

    Args:
        rays: of a pixel of scenes.
        point_rays: of a pixel of captured points and even scenes.
        detail: pixels across the drawn images of points.
    """

    rays: int = 256
    point_rays: int = 1024
    detail: int = 121

    def __call__(self, bench: Bench, progress: Progress) -> Result:
        """Capture a light field, and measure."""
        setup, step = Setup.of(bench), Steps(progress, 6)
        cameras = {
            f"thin lens, f/{OPEN:g}": setup.thin(OPEN),
            f"real lens, f/{OPEN:g}": setup.real[OPEN],
            f"thin lens, f/{STOPPED:g}": setup.thin(STOPPED),
            f"real lens, f/{STOPPED:g}": setup.real[STOPPED],
        }
        images: dict[str, Image] = {}
        for name, camera in cameras.items():
            how: dict[str, Any] = {"samples": self.rays} if isinstance(camera.elements[0], RealLens) else {}
            images[name] = camera.capture(setup.field, **how)
            step()
        thin, real, thin_stopped, real_stopped = images.values()
        first = setup.first_order(OPEN).capture(setup.field)
        even = {f_number: _even(setup, f_number, self.point_rays) for f_number in (OPEN, STOPPED)}
        step()
        numbers = [
            _same(thin, first),
            _agreement(setup, real_stopped, thin_stopped, STOPPED),
            _agreement(setup, real, thin, OPEN),
            _spot(setup, self.point_rays),
            _petzval(setup),
            *_illumination(setup, even),
        ]
        step()
        text = prose(
            __name__,
            setup=setup,
            pupil=_pupil(OPEN),
            views=setup.field.shape[0],
            focal_length=_lens(OPEN, "real").focal_length,
        )
        return Result(text, _pictures(setup, images, even, self.detail), tuple(numbers), bench.assumed)


# -- findings: images


def _same(thin: Image, first: Image) -> Finding:
    one, other = thin.to_numpy(), first.to_numpy()
    largest = float(np.abs(one - other).max() / one.max())
    return Finding(
        "the lens in first order against the thin lens in its entrance pupil: largest difference",
        "the same image, to 1e-4 of the brightest pixel",
        largest,
        "of the brightest pixel",
        largest <= 1e-4,
        "matrices: x = B·(s + u/F) for both",
    )


def _agreement(setup: Setup, real: Image, thin: Image, f_number: float) -> Finding:
    """In the middle third, where distortion and vignetting are small."""
    one, other = real.to_numpy(), thin.to_numpy()
    middle = tuple(slice(count // 3, count - count // 3) for count in one.shape[:2])
    within = psnr(one[middle], other[middle], peak=float(other.max()))
    everywhere = psnr(one, other, peak=float(other.max()))
    bent = float(distortion(setup.real[f_number], setup.focus, fields=[1.0]).share[0])
    why = f"of the whole image {everywhere:.1f} dB, by illumination and distortion, {bent:+.1%} in the corner"
    what = f"real against thin lens at f/{f_number:g}, middle third of the image: PSNR"
    if f_number < STOPPED:
        return Finding(what, "", within, "dB", None, why)
    return Finding(what, f"{ALIKE:g} dB or more", within, "dB", within >= ALIKE, why)


# -- findings: spherical aberration


def meridional(lens: RealLens, height: float, distance: float) -> tuple[float, float]:
    """A ray of a point on the axis through spheres: where it crosses the axis, and its angle there.

    By angles (R. Kingslake and R. B. Johnson, *Lens Design Fundamentals*, 2010, section 2.2): at a surface of
    radius r that a ray at angle U would cross the axis L behind, sin I = (1 − L/r)·sin U, n'·sin I' = n·sin I,
    U' = U − I + I' and L' = r·(1 − sin I'/sin U').

    Args:
        lens: of spheres and planes.
        height: in the entrance plane, metres.
        distance: of the point before it, metres.

    Returns:
        Metres behind the last surface; radians.
    """
    angle, crossing, index = math.atan(height / distance), -distance - lens.front, 1.0
    for surface in lens.prescription.surfaces:
        if math.isfinite(surface.radius):
            arriving = math.asin((1 - crossing / surface.radius) * math.sin(angle))
            leaving = math.asin(index / surface.index * math.sin(arriving))
            angle += leaving - arriving
            crossing = surface.radius * (1 - math.sin(leaving) / math.sin(angle))
        crossing -= surface.thickness
        index = surface.index
    return crossing + lens.prescription.surfaces[-1].thickness, angle


def _longitudinal(lens: RealLens, distance: float, heights: Array) -> tuple[Array, Array]:
    """Where rays of these heights cross the axis behind the paraxial focus, and their slopes; metres."""
    paraxial = meridional(lens, 1e-6, distance)[0]
    found = np.array([meridional(lens, float(height), distance) for height in heights])
    return found[:, 0] - paraxial, np.tan(found[:, 1])


def _spot(setup: Setup, rays: int) -> Finding:
    lens = _lens(OPEN, "real")
    heights = (np.arange(400) + 0.5) / 400 * _pupil(OPEN) / 2
    behind, slopes = _longitudinal(lens, setup.focus, heights)
    expected = math.sqrt(float((heights * (behind * slopes) ** 2).sum() / heights.sum()))
    pitch = expected / 12
    sensor = Sensor(setup.paraxial(OPEN).sensor.z, (73, 73), pitch)
    spacing, slope = 1.05 * _pupil(OPEN) / POINT_VIEWS, POINT_WIDTH / setup.image_distance
    point = flat(np.ones((1, 1, 1)), spacing, slope, setup.focus, POINT_VIEWS)
    with without_result_warnings():
        # The light field holds only the point: most of the sensor's rays are missing.
        values = Camera([lens], sensor).capture(point, between_views="none", samples=rays).to_numpy()[..., 0]
    squared = sensor.column_places[None, :] ** 2 + sensor.row_places[:, None] ** 2
    # A square of width w adds w²/6 to the mean square: the pixel, and the point's own width.
    own = (pitch**2 + POINT_WIDTH**2) / 6
    measured = math.sqrt(float((values * squared).sum() / values.sum()) - own)
    marginal = float(behind[-1])
    zone = float(behind.min())
    return Finding(
        f"captured point at the paraxial focus, f/{OPEN:g}: root mean square radius",
        f"{expected / um:.1f} µm by meridional rays traced by angles, within 3 %",
        measured / um,
        "µm",
        abs(measured / expected - 1) <= 0.03,
        f"spherical aberration: the marginal ray crosses the axis {marginal / um:+.0f} µm from the paraxial "
        f"focus, the zone {zone / um:+.0f} µm",
    )


# -- findings: curvature and light over the field


def _petzval(setup: Setup) -> Finding:
    """Third order: the tangential focus lies three times as far from Petzval's surface as the sagittal one."""
    camera, lens = setup.paraxial(OPEN), _lens(OPEN, "real")
    found = field_curvature(camera, setup.focus, fields=[NEAR_AXIS])
    height = NEAR_AXIS * setup.corner * setup.image_distance
    surface = float(3 * found.sagittal[0, 0] - found.tangential[0, 0]) / 2
    expected = -(height**2) / 2 * petzval_sum(lens.prescription)
    return Finding(
        "radius of Petzval’s surface, from tangential and sagittal foci near the axis",
        f"−1/Σ (n′ − n)/(n·n′·r) = {-1 / petzval_sum(lens.prescription) / mm:.0f} mm, within 2 %",
        height**2 / 2 / surface / mm,
        "mm",
        abs(surface / expected - 1) <= 0.02,
        f"in the corner the foci lie {_corner_foci(setup)} from the best focus of the axis",
    )


def petzval_sum(prescription: Prescription) -> float:
    """Σ (n′ − n)/(n·n′·r), 1/m."""
    total, index = 0.0, 1.0
    for surface in prescription.surfaces:
        total += (surface.index - index) / (surface.index * index * surface.radius)
        index = surface.index
    return total


def _corner_foci(setup: Setup) -> str:
    found = field_curvature(setup.real[OPEN], setup.focus, fields=[1.0])
    return f"{found.sagittal[0, 0] / um:+.0f} µm (sagittal) and {found.tangential[0, 0] / um:+.0f} µm (tangential)"


def _even(setup: Setup, f_number: float, rays: int) -> Array:
    """Captured irradiance of an even scene at `FIELDS` along the diagonal, over that on the axis."""
    slope, views, pixels = 1.6 * setup.corner, setup.field.shape[0], 8
    even = flat(np.ones((pixels, pixels, 1)), WIDTH / views, slope * 2 / pixels, setup.focus, views)
    camera = setup.real[f_number]
    height = setup.corner * setup.image_distance
    values = []
    for field in FIELDS:
        at = field * height / math.sqrt(2)
        small = Sensor(camera.sensor.z, (4, 4), height / 400, decentre=(at, at))
        image = Camera(camera.elements, small).capture(even, samples=4 * rays)
        values.append(float(image.to_numpy().mean(dtype=np.float64)))
    return np.array(values) / values[0]


def discs(lens: RealLens, slope: float, distance: float) -> tuple[Array, Array]:
    """Middles and radii of the stop and the rims as a point sees them in the entrance plane, metres.

    By first order, each rim where the edge of its surface is.

    Args:
        lens: of spheres and planes.
        slope: of the ray from the point through the middle of the entrance plane.
        distance: of the point before it, metres.
    """
    ray, index = np.array([[1.0, lens.front], [0.0, 1.0]]), 1.0
    centres, radii = [], []
    for surface in lens.prescription.surfaces:
        diameter = lens.prescription.opening(lens.stop_diameter) if surface.stop else surface.diameter
        assert diameter is not None
        power = 1 / surface.radius
        sag = power * diameter**2 / 4 / (1 + math.sqrt(1 - power**2 * diameter**2 / 4))
        from_place, from_slope = ray[0] + sag * ray[1]
        from_place += from_slope / distance  # rays (u, slope + u/distance) of the point
        centres.append(-from_slope / from_place * slope)
        radii.append(abs(diameter / 2 / from_place))
        refraction = np.array([[1, 0], [-(1 - index / surface.index) * power, index / surface.index]])
        ray, index = np.array([[1, surface.thickness], [0, 1]]) @ refraction @ ray, surface.index
    return np.array(centres), np.array(radii)


def overlap(centres: Array, radii: Array) -> float:
    """The area common to discs whose centres lie on a line, m², by the lengths of chords across it."""
    reach = float(radii.min())
    across = (np.arange(2000) + 0.5) / 2000 * 2 * reach - reach
    half = np.sqrt(np.maximum(radii[:, None] ** 2 - across**2, 0))
    chords = (centres[:, None] + half).min(axis=0) - (centres[:, None] - half).max(axis=0)
    return float(np.maximum(chords, 0).mean() * 2 * reach)


def _illumination(setup: Setup, even: dict[float, Array]) -> Iterator[Finding]:
    lens = _lens(OPEN, "real")
    open_share = even[OPEN] / even[STOPPED]
    expected = [overlap(*discs(lens, field * setup.corner, setup.focus)) for field in FIELDS]
    for n, where in ((2, "half-way to the corner"), (4, "in the corner")):
        share = expected[n] / expected[0]
        yield Finding(
            f"open part of the pupil {where} (cat’s eye), f/{OPEN:g}, by captured irradiance",
            f"overlap of the discs of stop and rims by first order, {share:.2f}, within {PUPIL:g}",
            float(open_share[n]),
            "",
            abs(float(open_share[n]) - share) <= PUPIL,
            f"irradiance f/{OPEN:g} over f/{STOPPED:g}, where no rim stops light",
        )
    behind = setup.first_order(STOPPED).rays_at(setup.first_order(STOPPED).sensor.z).linear[2, 2] * setup.corner
    fourth = 1 / (1 + behind**2) ** 2
    corner = float(even[STOPPED][-1])
    yield Finding(
        f"captured irradiance in the corner over the axis, f/{STOPPED:g}",
        f"cos⁴ of the chief ray behind the lens by first order, {fourth:.3f}, within 0.04",
        corner,
        "",
        abs(corner - fourth) <= 0.04,
        f"pupil aberration and distortion are the rest; at f/{OPEN:g} it is {even[OPEN][-1]:.2f}",
    )


# -- pictures


def _pictures(
    setup: Setup, images: dict[str, Image], even: dict[float, Array], detail: int
) -> tuple[tuple[Picture, ...], ...]:
    shown = {
        name: figures.shown(image, setup.exposure(STOPPED if name.endswith(f"{STOPPED:g}") else OPEN))
        for name, image in images.items()
    }
    thin, real, _, stopped = (
        Picture(f"scene-{n}", name.capitalize(), caption, shown[name])
        for n, (name, caption) in enumerate(zip(images, _CAPTIONS, strict=True))
    )
    columns = list(shown.items())
    return (
        (thin, real, stopped),
        *below(
            Picture("close-ups", "Close-ups", _CLOSE_UPS, _close_ups(setup, columns)),
            Picture("points", "Points over the field", _POINTS, _point_figure(setup, detail)),
            Picture("curves", "Aberrations and light", _CURVES, _curve_figure(setup, even)),
        ),
    )


_CAPTIONS = (
    "Lamps out of focus are round everywhere.",
    "Dark corners, cat’s eyes towards them, and a little barrel distortion.",
    "",
    "Almost the thin lens again.",
)
_CLOSE_UPS = "Lamps at the edge, leaves in focus in the corner, and the chart. The grain is that of the rays."
_POINTS = (
    "As light lands. Above: far behind the focus. Towards the corner, the front and the rear rims cut the disc; "
    "its edge is bright, as the outermost zone of the lens focuses farther back than the next. Below: in focus."
)
_CURVES = (
    "Where rays cross the axis, by their height in the pupil; the surfaces on which a flat object is sharp; and "
    "the irradiance of an even scene, captured (dots) and by the analysis (lines)."
)


def _close_ups(setup: Setup, columns: list[tuple[str, figures.Shown]]) -> figures.Figure:
    rows, count = setup.shape
    size = max(min(rows, count) // 5, 8)
    wide = [
        ("edge", figures.Crop(round(0.16 * rows), count - size - round(0.02 * count), size)),
        ("corner", figures.Crop(rows - size - round(0.02 * rows), count - size - round(0.02 * count), size)),
        ("middle", figures.Crop((rows - size) // 2, (count - size) // 2, size)),
    ]
    return figures.close_ups(columns, [crop for _, crop in wide], [name for name, _ in wide])


def _point_figure(setup: Setup, detail: int) -> figures.Figure:
    cameras = ((f"f/{OPEN:g}", setup.real[OPEN]), (f"f/{STOPPED:g}", setup.real[STOPPED]))
    blur = _pupil(OPEN) * setup.image_distance * abs(1 / setup.far - 1 / setup.focus)
    figure = figures.new_figure(8.6, 6.8)
    grid = figure.subplots(4, 5)
    for half, (distance, width, words) in enumerate(
        ((setup.far, 1.2 * blur, away(setup.far)), (setup.focus, 320 * um, "in focus"))
    ):
        for row, (name, camera) in enumerate(cameras):
            for axes, field in zip(grid[2 * half + row], FIELDS, strict=True):
                slope = field * setup.corner / math.sqrt(2)
                spread = psf(
                    camera,
                    distance,
                    (slope, slope),
                    pitch=width / detail,
                    shape=(detail, detail),
                    cells=4 * detail,
                ).values
                brightest = np.quantile(spread[spread > 0], 0.995)
                grey = figures.grey_shown(spread / brightest)
                title = {0.0: "axis", 1.0: "corner"}.get(field, f"{field:g} of the way")
                figures.put(axes, grey, "" if half or row else title)
            grid[2 * half + row][0].set_ylabel(
                f"{name}, {words}\n{width / um:.0f} µm", fontsize=figures.LABEL, color=figures.INK
            )
    return figure


def _curve_figure(setup: Setup, even: dict[float, Array]) -> figures.Figure:
    figure = figures.new_figure(10, 3.4)
    spherical, curved, light = figure.subplots(1, 3)
    lens = _lens(OPEN, "real")
    heights = np.linspace(0.02, 1, 60) * _pupil(OPEN) / 2
    spherical.plot(_longitudinal(lens, setup.focus, heights)[0] / um, heights / mm, color=figures.ACCENT)
    spherical.axhline(_pupil(STOPPED) / 2 / mm, color=figures.QUIET, linewidth=0.8, linestyle="--")
    spherical.axvline(0, color=figures.QUIET, linewidth=0.6)
    found = field_curvature(setup.paraxial(OPEN), setup.focus)
    heights = found.at.fields.heights / mm
    curved.plot(found.sagittal[:, 0] / um, heights, color=figures.ACCENT, label="sagittal")
    curved.plot(found.tangential[:, 0] / um, heights, color=figures.INK, label="tangential")
    curved.axvline(0, color=figures.QUIET, linewidth=0.6)
    corner = setup.corner * setup.image_distance / mm
    for f_number, tint in ((OPEN, figures.ACCENT), (STOPPED, figures.INK)):
        curve = relative_illumination(setup.real[f_number], fields=np.linspace(0, 1, 13).tolist())
        light.plot(np.array(curve.heights) / mm, curve.share, color=tint, label=f"f/{f_number:g}")
        light.plot(np.array(FIELDS) * corner, even[f_number], "o", color=tint, markersize=4)
    light.set_ylim(0, 1.05)
    for axes, across, up in (
        (spherical, "crosses the axis [µm behind the focus]", f"height in the pupil [mm] (dashed: f/{STOPPED:g})"),
        (curved, "focus [µm behind the paraxial one]", "height on the sensor [mm]"),
        (light, "height on the sensor [mm]", "irradiance over that on the axis"),
    ):
        figures.label(axes, across, up)
        if axes is not spherical:
            axes.legend(fontsize=figures.LABEL, frameon=False)
    return figure


ENTRY = Entry(
    "real-lens",
    "A real double Gauss",
    "A. W. Tronnier, US patent 2,673,491 (1954); C. Kolb, D. Mitchell and P. Hanrahan, A realistic camera model "
    "for computer graphics, SIGGRAPH 1995",
    "Rays through the surfaces of a prescription show what the thin lens lacks: aberrations, cat’s eyes and dark "
    "corners wide open, and hardly any of them stopped down.",
    Run(),
)
