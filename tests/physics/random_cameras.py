"""Random cameras with all elements, and closed-form scenes in front of them, for the laws and for brute force.

Everything follows from a kind and a seed. Random are: elements in any order along the axis, decentred and
defocused, at the entrance plane, at the lens, in mid-path, against the sensor and a little in front of it; stops
within the grid of views, or none; views that converge or are parallel, propagated or not, denser along one axis
than along the other; pixels of any aspect ratio, smaller and larger than samples; floating point and bytes, one
channel or three.

Views are so dense that neighbouring views' images of a scene are less than `GAP` pixels (or samples, if these
are larger) apart on the sensor, and periods are so long that samples resolve them (`FINEST`). With larger gaps
or finer periods, the light field would not determine the image, and no comparison with the truth would be
possible.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vcc
from tests.physics.random_tracer import Bench, Plane, Scene
from vcc.base.units import m, mm
from vcc.optics import prescription
from vcc.shapes import kernels, patterns, surfaces

Array = NDArray[np.float64]

GAP = 0.75
"""Pixels (samples, if larger) between neighbouring views' images of the plane that is furthest out of focus."""
FINEST = 5.5
"""Shortest period of a scene in samples and in pixels, whichever are larger."""
MARGIN = 4
"""Samples around those that the camera's rays read: the largest reach of any interpolation or filter."""

AFFINE = (
    "lenses",
    "prisms",
    "one mask",
    "two masks",
    "three masks",
    "stop, mask and prism",
    "turned lenses",
    "turned mask",
    "blur",
    "angle filter",
    "two terms",
)
"""Kinds of cameras that are made of footprints."""
BENT = (
    "facets",
    "plate",
    "lenslets",
    "prism array",
    "coded diffuser",
    "diffuser before a mask",
    "louvre",
    "real lens",
)
"""Kinds that are traced."""
DIRECTED = ("angle filter", "two terms", "louvre")
"""Kinds that transmit by direction."""
KINDS = tuple(kind for kind in AFFINE + BENT if kind not in DIRECTED) + DIRECTED


@dataclass(frozen=True)
class MaskBehind(vcc.Element):
    """An element of a user's: it transmits as a mask does that stands ``ahead`` metres behind it."""

    pattern: Any
    ahead: float

    def faces(self) -> vcc.Faces:
        return vcc.Faces(terms=(vcc.Term.behind(self.pattern, self.ahead),))


@dataclass(frozen=True, eq=False)
class Case:
    """A camera, a scene, and the grid on which a light field of the scene is sampled.

    Args:
        kind: one of `KINDS`.
        seed: kind and seed determine the case.
        camera: any.
        scene: in closed form at z = 0.
        frame: 5×5 at z = 0.
        shape: (v, u, t, s).
        flown: propagation distance from the plane of the views, metres.
        sample: ``"mean"`` or ``"point"``.
        bytes: whether samples are 8-bit.
        channels: None, or their number; each is the scene times a factor.
        disparities: (lowest, highest) of the scene, pixels per view along u.
    """

    kind: str
    seed: int
    camera: vcc.Camera
    scene: Scene
    frame: Array
    shape: tuple[int, int, int, int]
    flown: float
    sample: Any
    bytes: bool
    channels: int | None
    disparities: tuple[float, float]

    @cached_property
    def bench(self) -> Bench:
        """The same camera for the independent tracer."""
        return Bench(self.camera, self.frame, self.shape[:2], self.flown)

    @cached_property
    def light_field(self) -> vcc.LightField:
        """The samples."""
        values = self.scene.sampled(self.frame, self.shape, self.sample == "mean")
        if self.channels is not None:
            values = values[..., None] * np.linspace(1, 0.5, self.channels)
        held = np.rint(values * 255).astype(np.uint8) if self.bytes else values.astype(np.float32)
        return vcc.LightField(held, vcc.Affine(self.frame), self.disparities, self.sample)

    def described(self) -> str:
        """The parameters of the case, in a line."""
        sensor = self.camera.sensor
        parts = [
            f"{each.kind} z={each.z * 1e3:.4g}mm"
            + (
                f" off ({each.decentre[0] * 1e3:.2g}, {each.decentre[1] * 1e3:.2g})mm"
                if any(each.decentre)
                else ""
            )
            + f" [{each.described()}]"
            for each in self.camera.elements
        ]
        views = "×".join(map(str, self.shape))
        return (
            f"{'; '.join(parts)}; sensor z={sensor.z * 1e3:.4g}mm; {views} {self.sample}"
            f"{' bytes' if self.bytes else ''}, flown {self.flown * 1e3:.3g}mm, "
            f"disparities {self.disparities[0]:.2f} to {self.disparities[1]:.2f}"
        )


def disparity_along(frame: Array, vergence: float, axis: int) -> float:
    """Disparity along u (0) or v (1) of points of one vergence, pixels a view."""
    # A point is seen along one place: what a step of a view moves it by, steps of pixels move it back by.
    moved = frame[2:4, :4] - vergence * frame[:2, :4]
    return float(np.linalg.solve(moved[:, 2:], moved[:, :2])[axis, axis])


def drawn(kind: str, seed: int, pixels: int = 32, views: int = 17) -> Case:
    """A random camera of a kind in front of a random scene.

    Args:
        kind: one of `KINDS`.
        seed: determines the case.
        pixels: approximate number per side.
        views: likewise.
    """
    return Drawing(kind, seed, pixels, views).case()


class Drawing:
    def __init__(self, kind: str, seed: int, pixels: int, views: int) -> None:
        self.kind, self.seed, self.pixels, self.views = kind, seed, pixels, views
        self.rng = np.random.default_rng([seed, zlib.crc32(kind.encode())])

    # -- drawing numbers

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def spread(self, low: float, high: float) -> float:
        """Even in the logarithm."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def one_of(self, *given: Any) -> Any:
        return given[int(self.rng.integers(len(given)))]

    def off_axis(self, size: float) -> tuple[float, float]:
        """On the axis or as far as size off it."""
        return (0.0, 0.0) if self.chance(0.5) else (self.between(-size, size), self.between(-size, size))

    # -- a case

    def case(self) -> Case:
        self._views()
        self._optics()
        self._sensor()
        elements = [*self.optics, *self._extras()]
        self.rng.shuffle(elements)  # type: ignore[arg-type]
        camera = vcc.Camera(elements, self.sensor)
        frame, shape = self._cover([camera])
        disparities = sorted(disparity_along(frame, w / (1 + w * self.flown), 0) for w in self.depths)
        return Case(
            kind=self.kind,
            seed=self.seed,
            camera=camera,
            scene=self._scene(),
            frame=frame,
            shape=shape,
            flown=self.flown,
            sample=self.one_of("mean", "point"),
            bytes=self.chance(0.2),
            channels=3 if self.chance(0.15) else None,
            disparities=(disparities[0], disparities[-1]),
        )

    def _views(self) -> None:
        fewest = self.views - self.views // 5
        along_u, along_v = (int(self.rng.integers(fewest, 2 * self.views - fewest + 1)) for _ in range(2))
        self.number = (along_u, along_v)
        du, ps = self.between(0.7, 1.2) * mm, self.between(0.8, 1.4) * 1e-3
        self.spacing = (du, du * (1.0 if self.chance(0.4) else self.between(0.7, 1.4)))
        self.slopes = (ps, ps * (1.0 if self.chance(0.4) else self.between(0.75, 1.3)))
        self.vergence = 0.0 if self.chance(0.35) else 1 / self.between(0.6, 2.5)  # of the views, at their plane
        self.flown = self.between(5, 25) * mm if self.chance(0.3) else 0.0
        self.half = tuple(n * d / 2 for n, d in zip(self.number, self.spacing, strict=True))
        self.grid, self.pixels_turned = np.eye(2), np.eye(2)
        if self.kind.startswith("turned"):
            angle, shear = self.between(-0.6, 0.6), self.one_of(0.0, self.between(-0.3, 0.3))
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            self.grid = turn @ np.array([[1.0, shear], [0.0, 1.0]])
            if self.chance(0.4):  # the whole light field turned, not its grid of views alone
                self.grid = self.pixels_turned = turn
            self.half = (0.65 * self.half[0], 0.65 * self.half[1])  # what fits into the parallelogram

    def _optics(self) -> None:
        """What forms the picture: one lens, two, a thick or a real one; and prisms where the kind says so."""
        if self.kind == "real lens":
            self._real_lens()
            return
        z = 0.0 if self.chance(0.4) else self.between(0, 15) * mm
        chance = {"stop, mask and prism": 0.0, "turned lenses": 1.0, "turned mask": 1.0}.get(self.kind, 0.55)
        rim = 2 * min(self.half) * self.between(0.5, 0.85) if self.chance(chance) else None
        f = self.between(40, 60) * mm
        off = self.off_axis(0.8 * mm)
        form = self.one_of("thin", "thin", "two", "thick") if self.kind in ("lenses", "prisms") else "thin"
        if form == "thin":
            self.optics: list[Any] = [vcc.Lens(focal_length=f, diameter=rim, z=z, decentre=off)]
        elif form == "two":
            gap = self.one_of(0.0, self.between(2, 10) * mm)
            self.optics = [
                vcc.Lens(focal_length=2 * f, diameter=rim, z=z, decentre=off),
                vcc.Lens(focal_length=2 * f, z=z + gap, decentre=self.off_axis(0.5 * mm)),
            ]
        else:
            radii = (f * self.between(0.9, 1.1), -f * self.between(0.9, 1.3))
            self.optics = [
                vcc.FirstOrder.thick_lens(
                    radii, self.between(3, 8) * mm, self.between(1.4, 1.7), diameter=rim, z=z, decentre=off
                )
            ]
        self.rim = rim
        if self.kind == "prisms":
            for _ in range(self.one_of(1, 2)):
                deflection = (self.between(-0.02, 0.02), self.between(-0.02, 0.02))
                # Behind all lenses, or at the lens or before: nothing stands within a thick one.
                self.optics.append(vcc.Prism(deflection, z=self.one_of(0.0, z, 26 * mm, 30 * mm)))
        elif rim is None and self.kind != "stop, mask and prism" and self.chance(0.4):
            self.stop_kind = self.one_of("round", "polygon")
            size = 2 * min(self.half) * self.between(0.5, 0.85)
            pattern: Any = (
                patterns.Circle(size)
                if self.stop_kind == "round"
                else patterns.Polygon(int(self.rng.integers(5, 9)), size, self.between(0, 1))
            )
            self.optics.append(vcc.Mask(pattern, z=self.one_of(0.0, z), decentre=self.off_axis(0.5 * mm)))
        self.lens_z = z

    def _real_lens(self) -> None:
        """One to three elements of one or two glasses each, some aspheric, a stop before, between or behind."""
        open_to = min(self.half) * self.between(0.5, 0.8)
        groups = []
        for _ in range(self.one_of(1, 2, 3)):
            bend, index = self.between(-1.5, 1.5), self.between(1.45, 1.85)
            surfaces = [((1 + bend) / 2, self.between(2, 5), index), ((bend - 1) / 2, self.between(1, 6), 1.0)]
            if self.chance(0.4):  # cemented
                surfaces.insert(1, (self.between(-1.2, 0.2), self.between(1, 3), self.between(1.5, 1.8)))
            groups.append(surfaces)
        at = int(self.rng.integers(len(groups) + 1))
        powers = [self.between(0.4, 1.0) for _ in groups]
        listed: list[prescription.Surface] = []
        for n, (group, power) in enumerate(zip(groups, powers, strict=True)):
            if n == at:
                listed.append(prescription.Surface(np.inf, self.between(0.5, 4) * mm, 1.0, 2 * open_to, True))
            for c, thickness, index in group:
                curved = c * power / (40 * mm)
                odd = self.chance(0.25)
                aspheres = (self.between(-1, 1) * 1e-6 / mm**3, self.between(-1, 1) * 1e-8 / mm**5) if odd else ()
                listed.append(
                    prescription.Surface(
                        1 / curved if curved else np.inf,
                        thickness * mm,
                        index,
                        2 * open_to * self.between(1.0, 1.5),
                        conic=self.between(-1.5, 1) if odd else 0.0,
                        aspheres=aspheres,
                    )
                )
        if at == len(groups):
            listed.append(prescription.Surface(np.inf, 0.0, 1.0, 2 * open_to, True))
        if self.chance(0.2):  # no stop is marked: rims alone
            listed = [replace(each, stop=False) for each in listed]
        lens = prescription.Prescription(tuple(listed), source="a random lens")
        z_of = "entrance pupil" if lens.stop is not None and self.chance(0.4) else "first surface"
        options: dict[str, Any] = {"radiometry": self.one_of("exact", "exact", "paraxial")}
        if lens.stop is not None and 0 < listed.index(lens.stop) < len(listed) - 1 and self.chance(0.4):
            options["mask"] = self.one_of(
                patterns.Polygon(5, 2 * open_to, self.between(0, 1)),
                patterns.Cells(np.rint(self.rng.random((5, 7))), 2 * open_to),
            )
        place = self.between(0, 15) * mm if self.chance(0.6) else 0.0
        off = self.off_axis(0.8 * mm)
        self.optics = [vcc.RealLens.of(lens, z=place, z_of=z_of, decentre=off, **options)]
        self.rim, self.lens_z = 2 * open_to, place + self.optics[0].length

    def _sensor(self) -> None:
        """In focus at a plane near where the views converge, with pixels smaller or larger than samples."""
        w = self.vergence + self.between(-0.5, 0.5) * self.slopes[0] / self.spacing[0]
        w = max(w, 0.15)
        self.focus = w
        # At z = 0, where a field is flown to, a plane of vergence w before the views has this one:
        at_zero = w / (1 + w * self.flown)
        end = max(each.z + each.length for each in self.optics)
        ray = vcc.Camera(self.optics, vcc.Sensor(end + 0.2, (1, 1), 1.0)).rays_at(end).linear
        place, slope = ray[0, 0] + ray[0, 2] * at_zero, ray[2, 0] + ray[2, 2] * at_zero
        z = end - place / slope
        onto = ray[0, 2] + (z - end) * ray[2, 2]  # place from slope at z = 0
        self.onto = abs(onto - self.flown * (ray[0, 0] + (z - end) * ray[2, 0]))  # and from slope at the views
        ratio = self.spread(0.6, 1.8)
        pitch = tuple(self.onto * p * ratio * self.one_of(1.0, self.between(0.8, 1.25)) for p in self.slopes)
        shape = (self.pixels + int(self.rng.integers(-2, 3)), self.pixels + int(self.rng.integers(-2, 3)))
        fill = 1.0 if self.chance(0.7) else self.between(0.4, 1.0)
        self.pitch = pitch
        self.sensor = vcc.Sensor(z, shape, (pitch[1], pitch[0]), self.off_axis(20 * pitch[0]), fill_factor=fill)
        # How far from focus a plane may be for the gap: |w' − w|·du in pixels or samples.
        largest = min(
            max(p / self.onto, own) / d for p, own, d in zip(pitch, self.slopes, self.spacing, strict=True)
        )
        self.depths = [w + self.between(-GAP, GAP) * largest]
        if self.chance(0.5):
            self.depths.append(w + self.between(-GAP, GAP) * largest)
        self.depths = [max(each, 0.02) for each in self.depths]  # a scene is no further than infinity

    def _scene(self) -> Scene:
        """Vergences at z = 0; textures and the opacity of the nearer plane no finer than `FINEST`."""
        step = max(*self.slopes, *(p / self.onto for p in self.pitch))

        def plane(w: float, finest: float) -> Plane:
            # At the views a plane of vergence w is seen at angles (s − w·u); at z = 0 at (s − w₀·u)·(1 + w·flown).
            grown = 1 + w * self.flown
            waves = []
            for _ in range(3):
                angle, period = self.between(0, np.pi), self.spread(finest, 5 * finest) * step
                waves.append(
                    (0.13, grown * np.cos(angle) / period, grown * np.sin(angle) / period, self.between(0, 6))
                )
            return Plane(w / grown, 0.5, waves)

        if len(self.depths) == 1:
            return Scene(plane(self.depths[0], FINEST))
        # A product of cosines has the sum of their frequencies: 1/(FINEST·1.2) + 1/(FINEST·6) = 1/FINEST.
        far, near = sorted(self.depths)
        veil = plane(near, 6 * FINEST)
        return Scene(plane(far, 1.2 * FINEST), plane(near, 1.2 * FINEST), veil.waves[0][1:])

    def _cover(self, cameras: Sequence[vcc.Camera]) -> tuple[Array, tuple[int, int, int, int]]:
        """The frame at z = 0 and the shape of a light field that holds all rays the cameras ask for."""
        frame = np.eye(5)
        frame[:2, :2] = self.grid @ np.diag(self.spacing)
        frame[:2, 4] = -frame[:2, :2] @ (np.array(self.number) - 1) / 2
        frame[2:4, [0, 1, 4]] = frame[:2, [0, 1, 4]] * self.vergence
        frame[2:4, 2:4] = -self.pixels_turned @ np.diag(self.slopes)
        flight = np.eye(5)
        flight[0, 2] = flight[1, 3] = self.flown
        frame = flight @ frame
        views = (self.number[1], self.number[0])
        asked = [Bench(camera, frame, views, self.flown).asked(frame) for camera in cameras]
        first = np.floor(np.min([low for low, _, _ in asked], axis=0)) - MARGIN
        count = (np.ceil(np.max([high for _, high, _ in asked], axis=0)) + MARGIN - first + 1).astype(int)
        shift = np.eye(5)
        shift[2:4, 4] = first
        if count.max() > 400:
            raise RuntimeError(f"{self.kind} {self.seed}: a view of {count} samples")
        return frame @ shift, (self.number[1], self.number[0], int(count[1]), int(count[0]))

    # -- what a kind adds

    def _extras(self) -> list[Any]:
        return {
            "lenses": lambda: [],
            "prisms": lambda: [],
            "one mask": lambda: [self._mask()],
            "two masks": self._two_masks,
            "three masks": lambda: [*self._two_masks(), self._mask()],
            "stop, mask and prism": lambda: [self._stop(), self._mask(), self._prism()],
            "turned lenses": lambda: [],
            "turned mask": lambda: [self._mask()],
            "blur": lambda: [self._diffuser()],
            "angle filter": lambda: [self._angle_filter()],
            "two terms": lambda: [self._angle_filter(), self.one_of(self._mask_behind, self._mask)()],
            "louvre": lambda: [self._louvre()],
            "real lens": lambda: self.one_of(list, list, self._behind_a_lens)(),
            "facets": lambda: [self._facets()],
            "plate": lambda: [self._plate()],
            "lenslets": lambda: [self._lenslets()],
            "prism array": lambda: [self._prisms()],
            "coded diffuser": lambda: [self._coded()],
            "diffuser before a mask": self._diffuser_before_a_mask,
        }[self.kind]()

    def _beam(self, z: float) -> float:
        """About half the width of the light at z."""
        stop = self.rim / 2 if self.rim is not None else min(self.half)
        share = np.clip((z - self.lens_z) / (self.sensor.z - self.lens_z), 0, 1)
        return float(stop * (1 - share) + max(self.sensor.size) / 2 * share)

    def _place(self) -> float:
        """Anywhere from the entrance plane to the sensor, with its ends and the lens as likely as all between."""
        end = self.sensor.z
        return float(
            self.one_of(
                0.0,
                self.lens_z,
                self.between(0.0, 1.0) * end,
                self.between(0.2, 0.8) * end,
                end - self.spread(0.05, 3) * mm,
                end,
            )
        )

    def _pattern(self, half: float, finest: float) -> tuple[Any, float | None, float | None]:
        """(pattern or cells, width, height) for light so wide; details no smaller than finest."""
        width = 2 * half * self.between(0.7, 1.5)
        most = int(np.clip(width / finest, 2, 17))
        form = self.one_of("binary", "grey", "checkerboard", "mura", "cosines", "circle", "polygon", "function")
        if form in ("binary", "grey", "checkerboard"):
            rows, columns = int(self.rng.integers(2, most + 1)), int(self.rng.integers(2, most + 1))
            if form == "checkerboard":
                cells = np.indices((rows, columns)).sum(axis=0) % 2 * 1.0
            else:
                cells = self.rng.random((rows, columns))
                cells = np.rint(cells) if form == "binary" else cells
            cells[rows // 2, columns // 2] = 1.0
            return cells, width, width * self.between(0.8, 1.2)
        if form == "mura":
            return patterns.mura(max(prime for prime in (5, 7, 11, 13, 17) if prime <= max(most, 5))), width, None
        if form == "cosines":
            period = max(width / self.between(1, 5), 2 * finest)
            harmonics = self.one_of(1, 1, 2)
            both = (period, self.one_of(period, 1.3 * period, np.inf))
            return patterns.CosineSum(both, harmonics, self.between(0, 6)), None, None
        if form == "circle":
            return patterns.Circle(width * 0.8), None, None
        if form == "polygon":
            return patterns.Polygon(int(self.rng.integers(3, 9)), width, self.between(0, 1)), None, None
        return _hill(width / 2, self.between(0, 6)), None, None

    def _mask(self, z: float | None = None) -> Any:
        z = self._place() if z is None else z
        # Against the sensor a cell of a pixel or more, at the aperture of a third of a view's or more.
        share = np.clip((z - self.lens_z) / (self.sensor.z - self.lens_z), 0, 1)
        finest = min(self.pitch) * share + 0.4 * min(self.spacing) * (1 - share)
        half = self._beam(z)
        pattern, width, height = self._pattern(half, finest)
        return vcc.Mask(pattern, width=width, height=height, z=z, decentre=self.off_axis(0.2 * half))

    def _directions(self) -> tuple[float, float]:
        """Half the range of slopes behind the lens, and by how much they differ from view to view."""
        away = self.sensor.z - self.lens_z
        return (self._beam(self.lens_z) + max(self.sensor.size) / 2) / away, min(self.spacing) / away

    def _angle_filter(self) -> Any:
        half, step = self._directions()
        pattern, width, height = self._pattern(half, 0.4 * step)
        if isinstance(pattern, np.ndarray):
            pattern = patterns.Cells(pattern, width, height)
        elif self.chance(0.3):
            pattern = vcc.patterns.AngularFringes(
                self.between(2, 6) / half, self.between(0, 6), self.between(0.5, 1), self.between(0, 3)
            )
        z = max(self._place(), self.optics[-1].z, self.lens_z)
        z = max(z, max(each.z + each.length for each in self.optics))
        return vcc.AngleFilter(pattern, z=z, decentre=self.off_axis(1 * mm))

    def _mask_behind(self) -> Any:
        """A mask some way behind the place where it is listed, as one term of an element of the user's."""
        mask = self._mask(self.between(0.2, 0.9) * self.sensor.z)
        ahead = self.between(0.1, 0.9) * (mask.z - max(each.z + each.length for each in self.optics))
        pattern = mask.faces().transmission
        return MaskBehind(pattern, max(ahead, 0.0), z=mask.z - max(ahead, 0.0), decentre=mask.decentre)

    def _louvre(self) -> Any:
        z = self.lens_z + self.between(0.0, 0.9) * (self.sensor.z - self.lens_z)
        pitch = self.between(0.3, 1.5) * self._beam(z)
        height = min(pitch * self.between(0.3, 1.2) / self._directions()[0], self.sensor.z - z)
        wall = pitch * self.one_of(0.0, self.between(0, 0.4))
        turn = self.one_of(0.0, self.between(0, 3))
        return vcc.Louvre(pitch, height, wall, turn, z=z, decentre=self.off_axis(0.5 * pitch))

    def _behind_a_lens(self) -> list[Any]:
        """One more element, somewhere behind a real lens."""
        z = self.lens_z + self.between(0.05, 0.95) * (self.sensor.z - self.lens_z)
        return [
            self.one_of(
                lambda: self._mask(z),
                lambda: vcc.Prism((self.between(-0.02, 0.02), self.between(-0.02, 0.02)), z=z),
                self._lenslets,
                self._louvre,
                self._plate,
                self._diffuser,
            )()
        ]

    def _two_masks(self) -> list[Any]:
        first = self._mask()
        return [first, self._mask(first.z if self.chance(0.3) else None)]

    def _stop(self) -> Any:
        """A hard stop that bounds the light, anywhere: next to the lens, at the views, or deep in the camera."""
        z = self.one_of(self.lens_z + self.spread(0.01, 3) * mm, self.between(0, 20) * mm, 0.6 * self._place())
        size = 2 * self._beam(z) * self.between(0.5, 0.8)
        if self.chance(0.6):
            return vcc.Mask(patterns.Circle(size), z=z, decentre=self.off_axis(0.1 * size))
        return vcc.Mask(patterns.Polygon(int(self.rng.integers(3, 9)), size, self.between(0, 1)), z=z)

    def _prism(self) -> Any:
        return vcc.Prism((self.between(-0.02, 0.02), self.between(-0.02, 0.02)), z=self._place())

    def _kernel(self, onto: float) -> Any:
        """A few pixels wide: onto is metres on the sensor per slope."""
        wide = self.spread(0.4, 4) * min(self.pitch) / onto
        if self.chance(0.6):
            return kernels.Gaussian(self.one_of(wide, (wide, wide * self.between(0.5, 2))))
        return kernels.TopHat(3 * wide, self.one_of("disc", "square"))

    def _diffuser(self) -> Any:
        """With nothing behind it but lenses: at the lens or between it and the sensor."""
        z = self.one_of(self.lens_z, self.lens_z + self.between(0.05, 0.9) * (self.sensor.z - self.lens_z))
        return vcc.Diffuser(self._kernel(self.sensor.z - z), z=z)

    def _diffuser_before_a_mask(self) -> list[Any]:
        z = self.one_of(self.lens_z, self.lens_z + self.between(0.05, 0.5) * (self.sensor.z - self.lens_z))
        behind = z + self.between(0.2, 0.8) * (self.sensor.z - z)
        return [vcc.Diffuser(self._kernel(self.sensor.z - z), z=z), self._mask(behind)]

    def _coded(self) -> Any:
        z = self.one_of(self.lens_z, self.lens_z + self.between(0.05, 0.7) * (self.sensor.z - self.lens_z))
        width, cells = 2.6 * self._beam(z), int(self.rng.integers(2, 6))
        onto = self.sensor.z - z
        if self.chance(0.5):
            wide = self.rng.uniform(0.2, 3, (cells, cells)) * min(self.pitch) / onto
            return vcc.CodedDiffuser(kernels.Gaussian(1.0), width, widths=wide, z=z)
        share = self.rng.random((cells, cells))
        both = (self._kernel(onto), self._kernel(onto))
        return vcc.CodedDiffuser(both, width, weights=np.stack([share, 1 - share]), z=z)

    def _bending_place(self) -> tuple[float, float]:
        """A place at or behind the lens, and metres on the sensor per slope that is added there."""
        z = self.one_of(self.lens_z, self.lens_z + self.between(0.05, 0.8) * (self.sensor.z - self.lens_z))
        return float(z), float(self.sensor.z - z)

    def _facets(self) -> Any:
        z, onto = self._bending_place()
        deflection = self.one_of(-1, 1) * self.between(2, 8) * min(self.pitch) / onto
        off, turn = self.off_axis(0.2 * self._beam(z)), self.between(0, 3)
        if self.chance(0.5):
            return vcc.Biprism(deflection, turn, z=z, decentre=off)
        return vcc.Pyramid(int(self.rng.integers(3, 7)), deflection, turn, z=z, decentre=off)

    def _plate(self) -> Any:
        z, onto = self._bending_place()
        half = 1.5 * self._beam(z)
        bent = self.between(1, 6) * min(self.pitch) / onto  # slope at the edge of the light
        form = self.one_of("cubic", "axicon", "zernike", "function")
        if form == "cubic":
            surface: Any = surfaces.Cubic(bent / 3 / self._beam(z) ** 2)
        elif form == "axicon":
            surface = surfaces.Axicon(bent)
        elif form == "zernike":
            surface = surfaces.Zernike((0, 0, 0, *self.rng.uniform(-1, 1, 5) * bent * half / 25), 2 * half)
        else:
            surface = _ripples(bent, half / self.between(0.5, 2))
        return vcc.PhasePlate(surface, diameter=2 * half, z=z)

    def _lenslets(self) -> Any:
        """A plenoptic camera of either kind, or a few large lenslets."""
        between = self.spread(1.0, 6) * mm
        pitch = self.between(4, 10) * min(self.pitch)
        focal_length = between * self.one_of(1.0, self.between(0.8, 1.5))
        hexagonal, circular = self.chance(0.4), self.chance(0.4)
        return vcc.LensArray(
            pitch,
            focal_length,
            layout="hexagonal" if hexagonal else "square",
            rotation=self.one_of(0.0, self.between(0, 0.5)),
            offset=(self.between(0, 1) * pitch, self.between(0, 1) * pitch),
            circular=circular,
            fill_factor=None if circular or self.chance(0.6) else self.between(0.6, 1.0),
            z=self.sensor.z - between,
        )

    def _prisms(self) -> Any:
        z, onto = self._bending_place()
        beam = self._beam(z)
        rows, columns = int(self.rng.integers(2, 6)), int(self.rng.integers(2, 6))
        slopes = self.rng.uniform(-4, 4, (rows, columns, 2)) * min(self.pitch) / onto
        return vcc.PrismArray(
            slopes,
            2.2 * beam / min(rows, columns),
            layout=self.one_of("square", "square", "hexagonal"),
            rotation=self.one_of(0.0, self.between(0, 0.5)),
            z=z,
        )


def _hill(half: float, phase: float) -> Callable[[Array, Array], Array]:
    """A smooth transmission as a function of position."""

    def each_once(places: Array) -> Array:
        """Places without those that only repeat others along an axis of millions of points."""
        return places[tuple(slice(1) if step == 0 else slice(None) for step in places.strides)]

    def hill(x: Array, y: Array) -> Array:
        x, y = each_once(np.asarray(x)), each_once(np.asarray(y))
        return np.asarray(0.5 + 0.45 * np.cos(np.pi * x / half + phase) * np.exp(-((y / half) ** 2)))

    return hill


def _ripples(bent: float, period: float) -> Callable[[Array, Array], tuple[Array, Array]]:
    """A smooth deflection as a function of position."""

    def ripples(x: Array, y: Array) -> tuple[Array, Array]:
        return bent * np.sin(2 * np.pi * x / period), bent * np.cos(2 * np.pi * y / period)

    return ripples


assert m == 1.0  # lengths above that carry no unit are metres
