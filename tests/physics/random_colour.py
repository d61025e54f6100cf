"""Random cameras that see direction and colour, against brute force band by band.

A camera of `random_cameras`, of any kind, off axis and out of focus, becomes coloured: lenses, prisms and plates
of glass or a diffractive lens, masks of channels, filters, terms of direction anywhere, an angular response, a
response of the sensor, photodiodes. The oracle has no colour: for each band it traces a camera whose numbers are
set here by hand, and sums the images with weights that are written here too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vcc
from tests.physics.laws import RAYS, TARGETS, capture, granted
from tests.physics.random_cameras import BENT, KINDS, Case, Drawing, disparity_along
from tests.physics.random_tracer import Bench, decibels
from tests.physics.traced_pixels import Pixels
from vcc.base.units import mm, nm, um
from vcc.shapes import surfaces

Array = NDArray[np.float64]

D = 587.5618 * nm
WIDE = (455 * nm, 540 * nm, 660 * nm)
FACTORS = (1.0, 0.7, 0.45)
"""Radiance of the scene in each band."""


@dataclass(frozen=True, eq=False)
class Coloured:
    """A coloured camera, and the same for each band by hand.

    Args:
        case: with a camera that sees colour; its scene in one band.
        bands: wavelengths, metres.
        by_hand: for each band a weight, and a camera without colour.
        matrix: (channels of the image, bands).
    """

    case: Case
    bands: tuple[float, ...]
    by_hand: list[tuple[float, vcc.Camera]]
    matrix: Array

    @cached_property
    def light_field(self) -> vcc.LightField:
        """The scene in all bands."""
        one = self.case.light_field
        values = one.values[..., None] * np.array(FACTORS, np.float32)
        made = vcc.LightField(values, one.frame, self.case.disparities, self.case.sample)
        return made.with_wavelengths(self.bands)

    @property
    def mark(self) -> float:
        """Required agreement, dB: of the camera's family, and 55 at most with terms of direction."""
        kind = TARGETS[self.case.kind]
        return min(kind, 55.0) if self.directed else kind

    @property
    def dark(self) -> bool:
        """Whether masks leave next to no light in the brightest band, of which errors are shares."""
        light = []
        for masked in (True, False):
            cameras = [
                vcc.Camera([each for each in one.elements if masked or not isinstance(each, vcc.Mask)], one.sensor)
                for _, one in self.by_hand
            ]
            light.append(max(capture(one, self.case.light_field).values.max() for one in cameras))
        return bool(light[0] < 0.05 * light[1])

    @property
    def directed(self) -> bool:
        """Whether anything sees direction."""
        sensor = self.case.camera.sensor
        named = any(isinstance(each, vcc.AngleFilter | vcc.Louvre) for each in self.case.camera.elements)
        return named or sensor.photodiodes != (1, 1) or sensor.angular_response is not None

    def truths(self) -> list[tuple[Array, float]]:
        """The image of each photodiode, (rows, columns, channels), and its error, root mean square."""
        bands, errors = zip(*(self._of_band(camera) for _, camera in self.by_hand), strict=True)
        share = np.array([w * factor for (w, _), factor in zip(self.by_hand, FACTORS, strict=True)])
        images = np.einsum("bprc,b,kb->prck", np.array(bands), share, self.matrix)
        doubts = np.sqrt(np.mean((self.matrix @ (np.array(errors) * share[:, None])) ** 2, axis=0))
        return list(zip(images, doubts.tolist(), strict=True))

    def _of_band(self, camera: vcc.Camera) -> tuple[Array, Array]:
        """The image of each photodiode in a band, (photodiodes, rows, columns), and their errors."""
        case, scene = self.case, self.case.scene
        if case.camera.sensor.photodiodes != (1, 1):
            pupil = (0.0, 0.0, case.camera.sensor.microlens.pupil_distance)
            return Pixels(camera, case, pupil).by_rays(scene, 1e-3, 4096)
        bench = Bench(camera, case.frame, case.shape[:2], case.flown)
        wanted = 10 ** (-(self.mark + 15) / 20)
        truth, error = bench.by_means(scene, wanted) if bench.affine else bench.by_rays(scene)
        return truth[None], np.array([error])

    def reached(self) -> tuple[float, float, str]:
        """Agreement of the worst photodiode in dB, the dB that are required there, and notes."""
        truths = self.truths()
        rays = capture(self.case.camera, self.light_field).error > 0
        options = {"samples": RAYS} if rays else {}
        shot = capture(self.case.camera, self.light_field, **options)
        if self.case.camera.sensor.photodiodes == (1, 1):
            images = [(shot.values, shot.error)]
        else:
            made = self.case.camera.capture(self.light_field, **options)
            listed = [one for row in made.photodiodes for one in row]
            images = [(one.to_numpy().astype(np.float64), one.sampling_error) for one in listed]
        peak = max(truth.max() for truth, _ in truths)
        worst = (np.inf, 0.0, "")
        for (truth, doubt), (found, stated) in zip(truths, images, strict=True):
            difference = found.reshape(truth.shape) - truth
            error = float(np.sqrt(np.mean(difference**2)))
            allowed = max(10 ** (-self.mark / 20) * peak, shot.said * peak)
            uncertain = float(np.hypot(stated, doubt))
            if rays or self.case.camera.sensor.photodiodes != (1, 1):
                allowed = max(allowed, granted(difference, uncertain))
            note = (
                f"{self.case.kind} {self.case.seed}: {decibels(error, peak):.1f} dB of "
                f"{decibels(allowed, peak):.1f}, truth known to {decibels(doubt, peak):.0f}, light "
                f"{found.mean() / truth.mean() - 1:+.2%}{', by rays' if rays else ''}"
            )
            here = (decibels(error, peak), decibels(allowed, peak), note)
            worst = here if here[0] - here[1] < worst[0] - worst[1] or not worst[2] else worst
        return worst


def coloured(kind: str, seed: int, pixels: int = 12, views: int = 17) -> Coloured:
    """A random coloured camera of a kind; see `tests.physics.random_cameras.drawn`."""
    return _Colouring(kind, seed, pixels, views).coloured()


class _Colouring(Drawing):
    def coloured(self) -> Coloured:
        self._views()
        self._optics()
        self._sensor()
        elements = [*self.optics, *self._extras()]
        self.rng.shuffle(elements)  # type: ignore[arg-type]
        self._thin = self.chance(0.2) and [type(each) for each in self.optics][:1] == [vcc.Lens]
        self.bands = tuple(D * k for k in (0.985, 1.0, 1.012)) if self._thin else WIDE
        # Focal lengths change by 1 % or so, so that bands are not more out of focus than views resolve.
        self.A, self.B = self.between(1.45, 1.7), self.spread(0.0004, 0.0015) * um**2
        with_colour: list[Any] = []
        by_band: list[list[Any]] = [[] for _ in self.bands]
        weights = np.ones(len(self.bands))
        for element in elements:
            seeing, by_hand, shares = self._element(element)
            with_colour.append(seeing)
            weights = weights * shares
            for of_band, one in zip(by_band, by_hand, strict=True):
                of_band.append(one)
        if self.kind not in ("louvre", "angle filter", "two terms") and self.chance(0.4):
            fringes = self._fringes()
            with_colour.append(fringes)
            for of_band in by_band:
                of_band.append(fringes)
        sensor, plain, matrix = self._coloured_sensor(by_band)
        cameras = [vcc.Camera(each, plain) for each in by_band]
        frame, shape = self._cover(cameras)
        disparities = sorted(disparity_along(frame, w / (1 + w * self.flown), 0) for w in self.depths)
        case = Case(
            kind=self.kind,
            seed=self.seed,
            camera=vcc.Camera(with_colour, sensor),
            scene=self._scene(),
            frame=frame,
            shape=shape,
            flown=self.flown,
            sample=self.one_of("mean", "point"),
            bytes=False,
            channels=None,
            disparities=(disparities[0], disparities[-1]),
        )
        return Coloured(case, self.bands, list(zip(weights.tolist(), cameras, strict=True)), matrix)

    def _strength(self, band: float) -> float:
        """(n − 1)/(n₀ − 1), the index written again."""
        return (self.A + self.B / band**2 - 1) / (self.A + self.B / D**2 - 1)

    def _element(self, element: Any) -> tuple[Any, list[Any], Array]:
        """The element with colour, the same by hand for each band, and its weights."""
        alike = [element] * len(self.bands), np.ones(len(self.bands))
        if isinstance(element, vcc.Mask) and not callable(getattr(element, "spectrum", None)):
            return self._mask_of_bands(element)
        if isinstance(element, vcc.Lens) and self._thin and element is self.optics[0]:
            x = [D / band - 1 for band in self.bands]
            made = vcc.DiffractiveLens(
                element.focal_length,
                element.diameter,
                D,
                (1,),
                z=element.z,
                decentre=element.decentre,
            )
            lenses = [replace(element, focal_length=element.focal_length * D / band) for band in self.bands]
            return made, lenses, np.sinc(np.array(x)) ** 2
        strengths = [self._strength(band) for band in self.bands]
        stronger = [_stronger(element, k) for k in strengths]
        if None in stronger or self.chance(0.25):
            return element, *alike
        glass = {"glass": vcc.glasses.Cauchy(self.A, self.B), "design_wavelength": D}
        return replace(element, **glass), stronger, alike[1]

    def _mask_of_bands(self, mask: Any) -> tuple[Any, list[Any], Array]:
        count = len(self.bands)
        patterns, shares = [mask.pattern] * count, np.ones(count)
        if self.chance(0.6):
            patterns = [self._like(mask.pattern, n) for n in range(count)]
        spectrum = None
        if self.chance(0.4):
            shares = np.array([self.between(0.3, 1) for _ in self.bands])
            spectrum = vcc.Spectrum(self.bands, tuple(shares.tolist()))
        pattern = vcc.patterns.ByChannel(tuple(patterns)) if patterns[0] is not patterns[-1] else mask.pattern
        seeing = replace(mask, pattern=pattern, spectrum=spectrum)
        return seeing, [replace(mask, pattern=each) for each in patterns], shares

    def _like(self, pattern: Any, channel: int) -> Any:
        """A pattern of the same kind for another channel."""
        if channel == 0:
            return pattern
        match type(pattern).__name__:
            case "Cells":
                values = pattern.values.copy()
                self.rng.shuffle(values.ravel())
                values = self.rng.permutation(values.ravel()).reshape(values.shape)
                return replace(pattern, values=values)
            case "CosineSum":
                return replace(pattern, phase=pattern.phase + 1.3 * channel)
            case "Circle":
                return replace(pattern, diameter=pattern.diameter * (1 - 0.12 * channel))
            case "Polygon":
                return replace(pattern, rotation=pattern.rotation + 0.3 * channel)
        return vcc.patterns.Circle(2 * min(self.half) * 0.8)

    def _fringes(self) -> Any:
        half, _ = self._directions()
        pattern = vcc.patterns.AngularFringes(
            self.between(1, 5) / half, self.between(0, 6), self.between(0.4, 1), self.between(0, 3)
        )
        behind = max(each.z + each.length for each in self.optics)
        return vcc.AngleFilter(pattern, z=self.between(behind, self.sensor.z))

    def _coloured_sensor(self, by_band: list[list[Any]]) -> tuple[vcc.Sensor, vcc.Sensor, Array]:
        """With colour and directions; the same for the oracle; and (channels, bands)."""
        plain, matrix, response = self.sensor, np.eye(3), None
        form = self.one_of("none", "matrix", "mono")
        if form == "matrix":
            matrix = self.rng.uniform(0.1, 1, (2, 3))
            response = matrix
        elif form == "mono":
            widths = np.array([self.bands[1] - self.bands[0], 0.0, self.bands[2] - self.bands[1]])
            widths[1] = (widths[0] + widths[2]) / 2
            matrix, response = widths[None] / widths.sum(), "mono"
        parts: dict[str, Any] = {}
        if self.chance(0.2) and self.kind != "louvre":
            pattern = replace(self._fringes()).pattern
            parts["angular_response"] = pattern
            for of_band in by_band:
                of_band.append(vcc.AngleFilter(pattern, z=plain.z))
        if self.chance(0.25):
            microlens = vcc.Microlens(
                f_number=self.between(2, 6),
                pupil_distance=self.between(35, 60) * mm,
                crosstalk=self.one_of(0.0, 0.2 * self.pitch[0]),
            )
            parts |= {"photodiodes": self.one_of((1, 2), (2, 1), (2, 2)), "microlens": microlens}
        seeing = replace(plain, response=response, **parts)
        parts.pop("angular_response", None)
        return seeing, replace(plain, **parts), matrix


def _stronger(element: Any, k: float) -> Any:
    """An element that deflects k times as much; None for one that has no glass."""
    match element:
        case vcc.Lens():
            return replace(element, focal_length=element.focal_length / k)
        case vcc.Prism():
            return replace(element, deflection=(element.deflection[0] * k, element.deflection[1] * k))
        case vcc.Biprism() | vcc.Pyramid():
            return replace(element, deflection=element.deflection * k)
        case vcc.LensArray():
            return replace(element, focal_length=float(np.ravel(element.focal_length)[0]) / k)
        case vcc.PrismArray():
            return replace(element, slopes=np.asarray(element.slopes) * k)
        case vcc.PhasePlate(surface=surfaces.Cubic() as cubic):
            return replace(element, surface=surfaces.Cubic(cubic.strength * k))
        case vcc.PhasePlate(surface=surfaces.Axicon() as cone):
            return replace(element, surface=surfaces.Axicon(cone.slope * k))
    return None


def at_random(number: int) -> Coloured:
    """Camera of a number: kinds in turn; small where rays are traced."""
    kind = KINDS[number % len(KINDS)]
    return coloured(kind, number, 8 if kind in BENT else 10)
