"""Laws that hold for every camera and every light field, each as a function of a random case.

Laws are independent of how an image is made. The two sides of an equation may differ only by one of three
errors:

- `ROUNDING`, if both sides are the same sum. Images are float32 sums of some 10⁵ terms in different orders; the
  project requires 1e-5 of the brightest pixel everywhere (tests/physics/test_chunks.py).
- the sampling error that images by rays report, root mean square: for a difference of two images, the hypotenuse
  of both. Its square and the square of the difference are means over pixels, each known to its standard error,
  which follows from the squared differences (a few pixels may carry most of it). Five times the hypotenuse of
  both standard errors is allowed, as some thousand such checks are made and none may fail by chance, and no more
  than twice the reported error.
- a loss of sharpness in closed form, if two interpolations differ (`rays = footprints`).
"""

from __future__ import annotations

import re
import tempfile
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import vcc
from tests.physics.random_cameras import BENT, Case, disparity_along
from tests.physics.random_tracer import Bench, decibels
from vcc.shapes import kernels, patterns, surfaces
from vcc.store import save_store

Array = NDArray[np.float64]

ROUNDING = 1e-5
"""Fraction of the brightest pixel by which two equal sums may differ."""
TARGETS = {
    "lenses": 60.0,
    "prisms": 60.0,
    "turned lenses": 60.0,
    "one mask": 55.0,
    "turned mask": 55.0,
    "two masks": 50.0,
    "three masks": 50.0,
    "stop, mask and prism": 50.0,
    "blur": 55.0,
    "angle filter": 55.0,
    "two terms": 50.0,
} | dict.fromkeys(BENT, 50.0)
"""Required agreement with brute force by default options, dB; by rays of 256 samples, or their reported error."""
RAYS = 256
ERROR_SAID = re.compile(r"an error of (?:about|up to) ([\d.]+)% of the light")
"""Largest error that footprints report in a warning."""


@dataclass(frozen=True)
class Check:
    """One law on one camera.

    Args:
        law: its name.
        kind: of the camera.
        seed: of the camera.
        error: root mean square or largest, as a fraction of the brightest pixel.
        allowed: likewise.
        note: the measured quantity, as text.
    """

    law: str
    kind: str
    seed: int
    error: float
    allowed: float
    note: str = ""

    @property
    def holds(self) -> bool:
        """Also False for NaN."""
        return bool(self.error <= self.allowed)

    @property
    def margin(self) -> float:
        """dB between the allowed and the measured error; negative if the law fails."""
        if not np.isfinite(self.error) or (self.allowed == 0 < self.error):
            return -np.inf
        return np.inf if self.error == 0 else decibels(self.error, self.allowed)


@dataclass(frozen=True)
class Shot:
    """An image as numbers, its reported sampling error, and the error in warnings, as a share of the light."""

    values: Array
    error: float
    said: float = 0.0


def capture(camera: vcc.Camera, light_field: Any, **options: Any) -> Shot:
    """The image by default options, without warnings: laws also hold for rays missing from a light field."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", vcc.ResultWarning)
        image = camera.capture(light_field, **options)
    shares = [float(found) / 100 for each in caught for found in ERROR_SAID.findall(str(each.message))]
    return Shot(np.asarray(image.values, dtype=np.float64), image.sampling_error, max(shares, default=0.0))


@lru_cache(maxsize=2)
def default(case: Case) -> Shot:
    """The case's own image, computed once."""
    return capture(case.camera, case.light_field)


# -- brute force


def brute_force(case: Case) -> Iterator[Check]:
    """The image by default options against rays integrated in float64."""
    wanted = 10 ** (-(TARGETS[case.kind] + 15) / 20)
    truth, doubt = case.bench.by_means(case.scene, wanted) if case.bench.affine else case.bench.by_rays(case.scene)
    rays = case.kind in BENT and default(case).error  # a diffuser at the views may need none
    shot = capture(case.camera, case.light_field, **({"samples": RAYS} if rays else {}))
    picture = shot.values[..., 0] if case.channels else shot.values
    peak = truth.max()
    if peak == 0:
        yield Check("brute force", case.kind, case.seed, float(np.abs(picture).max()), 0.0, "all dark")
        return
    error = float(np.sqrt(np.mean((picture - truth) ** 2)) / peak)
    reached, known = decibels(error, 1.0), decibels(doubt / peak, 1.0)
    allowed = 10 ** (-TARGETS[case.kind] / 20)
    if case.kind in BENT:
        allowed = max(allowed, granted(picture - truth, float(np.hypot(shot.error, doubt))) / peak)
    allowed = max(allowed, shot.said)
    note = f"{reached:.1f} dB, truth known to {known:.0f} dB, light {picture.mean() / truth.mean() - 1:+.3%}"
    if shot.error:
        note += f", stated {decibels(shot.error, peak):.1f} dB"
    if shot.said:
        note += f", said {decibels(shot.said, 1.0):.1f} dB"
    yield Check("brute force", case.kind, case.seed, error, allowed, note)


def refined(case: Case) -> Iterator[Check]:
    """Asking for more never gives less: with ``refine=8`` pictures are as near to the truth, or near enough."""
    if case.kind in BENT:
        return
    truth, doubt = case.bench.by_means(case.scene, 10 ** (-(TARGETS[case.kind] + 15) / 20))
    peak = truth.max()
    if peak == 0:
        return
    errors = []
    for options in ({}, {"refine": 8}):
        shot = capture(case.camera, case.light_field, **options)
        picture = shot.values[..., 0] if case.channels else shot.values
        errors.append(float(np.sqrt(np.mean((picture - truth) ** 2)) / peak))
    allowed = max(1.05 * errors[0] + doubt / peak, 10 ** (-TARGETS[case.kind] / 20))
    yield Check(
        "refine", case.kind, case.seed, errors[1], allowed, f"{decibels(errors[0], 1.0):.1f} dB by default"
    )


# -- equal pictures


def equal(case: Case, law: str, one: Shot, other: Shot, same_points: bool = False, note: str = "") -> Check:
    """Two images of one scene: equal sums up to rounding, images by rays up to their reported errors.

    Args:
        case: the case.
        law: its name.
        one: an image.
        other: likewise, of the same shape.
        same_points: whether both sides use the very same rays, so that only rounding may differ.
        note: the compared quantity.
    """
    peak = max(float(np.abs(one.values).max()), float(np.abs(other.values).max()), 1e-300)
    difference = one.values - other.values
    note = note or "largest difference"
    if same_points or (one.error <= ROUNDING * peak and other.error <= ROUNDING * peak):
        return Check(law, case.kind, case.seed, float(np.abs(difference).max() / peak), ROUNDING, note)
    # Between rays and footprints, what these say that they err by.
    allowed = granted(difference, float(np.hypot(one.error, other.error))) / peak + max(one.said, other.said)
    error = float(np.sqrt(np.mean(difference**2))) / peak
    return Check(law, case.kind, case.seed, error, allowed + ROUNDING, f"{note}, root mean square")


def dark(case: Case) -> bool:
    """Whether masks leave next to no light on the sensor: what errors are shares of is then missing."""
    open_elements = [each for each in case.camera.elements if not isinstance(each, vcc.Mask)]
    without = capture(vcc.Camera(open_elements, case.camera.sensor), case.light_field)
    return float(default(case).values.max()) < 0.05 * float(without.values.max())


def alike(case: Case, law: str, one: Shot, other: Shot, note: str = "", other_means: bool = False) -> Check:
    """Two pictures whose cells of views are divided otherwise: a tenth of what they may err, else `equal`.

    Turned cells are taken as tiles, which their mirror images have elsewhere. ``other_means``: means over a cell
    may be found otherwise, such as from a texture in place of a closed form.
    """
    check = equal(case, law, one, other, note=note)
    if case.kind.startswith("turned") or other_means:
        return replace(check, allowed=max(check.allowed, 0.1 * 10 ** (-TARGETS[case.kind] / 20)))
    return check


def granted(difference: Array, stated: float) -> float:
    """How large the root mean square of a difference may be found where its expectation is stated."""
    squares = difference**2
    return min(2 * stated, float(np.sqrt(stated**2 + 5 * np.sqrt(2) * squares.std() / np.sqrt(squares.size))))


def noise(case: Case, seed: int, shape: tuple[int, ...] | None = None) -> vcc.LightField:
    """Random samples on the case's grid: no law of sums depends on what light comes in."""
    shape = case.light_field.values.shape if shape is None else shape
    values = np.random.default_rng([case.seed, seed]).random(shape, dtype=np.float32)
    return case.light_field.replaced(values)


def linearity(case: Case) -> Iterator[Check]:
    """capture(a + 2b) = capture(a) + 2·capture(b)."""
    one, other = noise(case, 1), noise(case, 2)
    both = one.replaced(one.values + 2 * other.values)
    a, b, c = (capture(case.camera, each) for each in (one, other, both))
    yield equal(case, "linearity", Shot(a.values + 2 * b.values, 0.0), c, same_points=True)


def repeatable(case: Case) -> Iterator[Check]:
    """The same camera, light and seed give the same picture, bit by bit."""
    again = capture(case.camera, case.light_field)
    difference = float(np.abs(default(case).values - again.values).max())
    yield Check("repeatability", case.kind, case.seed, difference, 0.0, "largest difference")


def order(case: Case) -> Iterator[Check]:
    """It does not matter in which order elements are listed, nor which of those in one plane comes first."""
    backwards = vcc.Camera(case.camera.elements[::-1], case.camera.sensor)
    yield equal(case, "order", default(case), capture(backwards, case.light_field))


def pieces(case: Case) -> Iterator[Check]:
    """Pictures of a light field's slices, along any axis, add up to the picture of the whole."""
    whole, axis = default(case), case.seed % 4
    size = case.shape[axis]
    total, error = np.zeros_like(whole.values), 0.0
    for start in range(0, size, -(-size // 3)):
        cut = (slice(None),) * axis + (slice(start, start + -(-size // 3)),)
        piece = capture(case.camera, case.light_field[cut])
        total, error = total + piece.values, float(np.hypot(error, piece.error))
    yield equal(case, "pieces", whole, Shot(total, error), note=f"along {'vuts'[axis]}")


def stores(case: Case) -> Iterator[Check]:
    """A light field on disk, read in pieces, gives the picture of the one in memory."""
    whole = default(case)
    with tempfile.TemporaryDirectory() as folder:
        stored = save_store(case.light_field, Path(folder) / "field.zarr", chunks=8)
        try:
            other = capture(case.camera, stored, memory_limit=2**24)
        except vcc.InputError as refused:
            if "memory" not in str(refused):
                raise
            other = capture(case.camera, stored)
    yield equal(case, "stores", whole, other, same_points=True)


# -- the same camera, seen otherwise


def reference_plane(case: Case) -> Iterator[Check]:
    """A light field flown by d before a camera d nearer is the same light: planes of reference are our choice."""
    first = min(each.z for each in case.camera.elements)
    for distance in {-7e-3, first} - {0.0}:
        moved = vcc.Camera(
            [replace(each, z=each.z - distance) for each in case.camera.elements],
            replace(case.camera.sensor, z=case.camera.sensor.z - distance),
        )
        light_field = case.light_field.transformed(vcc.Affine.propagation(distance))
        yield equal(
            case, "reference plane", default(case), capture(moved, light_field), note=f"by {distance * 1e3:.3g} mm"
        )


SWAPPED, FLIPPED = np.array([[0.0, 1], [1, 0]]), np.diag([-1.0, 1.0])


class NotAsAnElement(Exception):
    """The mirror image of an element is none that can be written with the same class."""


def mirrored(element: Any, turn: Array) -> Any:
    """The mirror image of an element, for x and y exchanged (`SWAPPED`) or x reversed (`FLIPPED`)."""
    swap = bool(turn[0, 1])

    def vector(given: Any) -> tuple[float, float]:
        a, b = turn @ np.asarray(given, dtype=float)
        return float(a), float(b)

    def angle(given: float) -> float:
        """Of a line from the middle outwards."""
        return (np.pi / 2 - given) if swap else (np.pi - given)

    def table(values: Any) -> Array:
        """Of cells (..., rows, columns)."""
        values = np.asarray(values)
        return np.ascontiguousarray(np.swapaxes(values, -1, -2) if swap else values[..., ::-1])

    changes: dict[str, Any] = {"decentre": vector(element.decentre)}
    sized = getattr(element, "width", None) is not None
    if sized and swap:
        height = element.width if element.height is None else element.height
        changes |= {"width": height, "height": element.width}
    match element.kind:
        case "lens" | "first order":
            pass
        case "real lens":
            if element.mask is not None:
                changes["mask"] = _mirrored_pattern(element.mask, turn, table, vector, angle)
        case "prism":
            changes["deflection"] = vector(element.deflection)
        case "mask":
            changes["pattern"] = _mirrored_pattern(element.pattern, turn, table, vector, angle)
            if isinstance(element.pattern, patterns.Cells):
                changes |= {"width": None, "height": None}
        case "diffuser":
            changes["kernel"] = _mirrored_kernel(element.kernel, swap)
        case "coded diffuser":
            changes["kernels"] = tuple(_mirrored_kernel(each, swap) for each in element.kernels)
            for name in ("weights", "widths"):
                if getattr(element, name) is not None:
                    changes[name] = table(getattr(element, name))
        case "biprism" | "pyramid":
            changes["rotation"] = angle(element.rotation)
        case "phase plate":
            changes["surface"] = _mirrored_surface(element.surface, turn, swap)
        case "lens array":
            # Rows of a square lattice are again rows or columns; of a hexagonal one a row stays a row of another
            # direction, since a sixth of a turn maps it onto itself.
            changes |= {"rotation": angle(element.rotation), "offset": vector(element.offset)}
        case "prism array":
            if element.layout == "hexagonal":
                raise NotAsAnElement
            moved = np.swapaxes(element.slopes, 0, 1) if swap else element.slopes[:, ::-1]
            changes |= {"slopes": moved @ turn.T, "rotation": -element.rotation}
        case _:
            raise NotAsAnElement
    return replace(element, **changes)


def _mirrored_pattern(pattern: Any, turn: Array, table: Any, vector: Any, angle: Any) -> Any:
    swap = bool(turn[0, 1])
    match type(pattern).__name__:
        case "Open" | "Circle":
            return pattern
        case "Cells":
            size = (pattern.height, pattern.width) if swap else (pattern.width, pattern.height)
            return patterns.Cells(table(pattern.values), *size, middle=vector(pattern.middle))
        case "Polygon":
            return replace(pattern, rotation=angle(pattern.rotation))
        case "CosineSum":
            if swap:
                return replace(pattern, period=pattern.periods[::-1])
            if not np.isinf(pattern.periods[1]) and pattern.phase:
                raise NotAsAnElement  # one phase for both axes
            return replace(pattern, phase=-pattern.phase)
        case "FunctionPattern":
            back = np.linalg.inv(turn)
            return lambda x, y: pattern.function(back[0, 0] * x + back[0, 1] * y, back[1, 0] * x + back[1, 1] * y)
    raise NotAsAnElement


def _mirrored_kernel(kernel: Any, swap: bool) -> Any:
    if swap and isinstance(kernel, kernels.Gaussian) and isinstance(kernel.sigma, tuple):
        return kernels.Gaussian(kernel.sigma[::-1])
    return kernel  # others that are drawn are round, square or even along both axes


def _mirrored_surface(surface: Any, turn: Array, swap: bool) -> Any:
    if isinstance(surface, surfaces.Quadratic | surfaces.Axicon) or (swap and isinstance(surface, surfaces.Cubic)):
        return surface
    given = surface.slopes if isinstance(surface, surfaces.Surface) else surface
    back = np.linalg.inv(turn)

    def bend(x: Array, y: Array) -> tuple[Array, Array]:
        s, t = given(back[0, 0] * x + back[0, 1] * y, back[1, 0] * x + back[1, 1] * y)
        return turn[0, 0] * s + turn[0, 1] * t, turn[1, 0] * s + turn[1, 1] * t

    return bend


def mirrors(case: Case) -> Iterator[Check]:
    """The mirror image of a camera makes the mirror image of the picture, with x and y exchanged or x reversed."""
    picture = default(case)
    for law, turn in (("transposition", SWAPPED), ("mirror", FLIPPED)):
        try:
            elements = [mirrored(each, turn) for each in case.camera.elements]
        except NotAsAnElement:
            continue
        swap, sensor, field = bool(turn[0, 1]), case.camera.sensor, case.light_field
        shape, (vertical, horizontal) = sensor.shape, sensor.pitches
        off = turn @ np.array(sensor.decentre)
        camera = vcc.Camera(
            elements,
            replace(
                sensor,
                shape=shape[::-1] if swap else shape,
                pitch=(horizontal, vertical) if swap else (vertical, horizontal),
                decentre=(float(off[0]), float(off[1])),
            ),
        )
        places = np.eye(5)
        if swap:
            values = np.ascontiguousarray(np.swapaxes(np.swapaxes(field.values, 0, 1), 2, 3))
            places[:4, :4] = np.kron(np.eye(2), SWAPPED)
        else:
            values = np.ascontiguousarray(field.values[:, ::-1, :, ::-1])
            for axis, number in ((0, case.shape[1]), (2, case.shape[3])):
                places[axis, axis], places[axis, 4] = -1.0, number - 1.0
        seen = np.eye(5)
        seen[:4, :4] = np.kron(np.eye(2), turn)
        frame = vcc.Affine(seen @ field.frame.matrix @ places)
        other = vcc.LightField(values, frame, _disparities_along(case, 1 if swap else 0), field.sample)
        taken = capture(camera, other)
        back = np.swapaxes(taken.values, 0, 1) if swap else taken.values[:, ::-1]
        turned = swap and case.kind.startswith("turned") and bool(case.light_field.frame.matrix[2, 3])
        if turned:  # samples lie sheared on the sensor: rows and columns are summed otherwise, and both are right
            error = float(np.sqrt(np.mean((picture.values - back) ** 2)) / picture.values.max())
            yield Check(law, case.kind, case.seed, error, 2 * 10 ** (-TARGETS[case.kind] / 20), "root mean square")
            continue
        yield alike(case, law, picture, Shot(back, taken.error))


def _disparities_along(case: Case, axis: int) -> tuple[float, float]:
    """Of the scene along u (0) or v (1), pixels a view, from the vergences of its planes."""
    matrix = case.light_field.frame.matrix
    planes = [case.scene.far] if case.scene.near is None else [case.scene.far, case.scene.near]
    found = sorted(disparity_along(matrix, plane.vergence, axis) for plane in planes)
    return found[0], found[-1]


# -- elements that say the same


def _with(case: Case, *added: Any, without: Any = None) -> Shot:
    elements = [each for each in case.camera.elements if each is not without]
    return capture(vcc.Camera([*elements, *added], case.camera.sensor), case.light_field)


def null_elements(case: Case) -> Iterator[Check]:
    """What neither bends, absorbs nor scatters changes nothing, wherever it stands."""
    rng = np.random.default_rng([case.seed, 7])
    end = case.camera.sensor.z
    free = [z for z in (0.0, end, *rng.uniform(0, end, 3), case.camera.elements[0].z) if _stands(case, z)]
    z = float(free[int(rng.integers(len(free)))])
    huge = 10.0
    nothing: dict[str, Callable[[], Any]] = {
        "clear mask": lambda: vcc.Mask(patterns.Open(), z=z),
        "clear function": lambda: vcc.Mask(lambda x, y: np.ones_like(x), z=z),
        "clear cells": lambda: vcc.Mask(np.ones((3, 2)), width=huge, z=z),
        "clear stop": lambda: vcc.Mask(patterns.Circle(huge), z=z),
        "no lens": lambda: vcc.Lens(focal_length=np.inf, z=z),
        "no prism": lambda: vcc.Prism((0.0, 0.0), z=z),
        "no biprism": lambda: vcc.Biprism(0.0, z=z),
        "no pyramid": lambda: vcc.Pyramid(4, 0.0, z=z),
        "no matrix": lambda: vcc.FirstOrder(((1, 0), (0, 1)), z=z),
        "flat plate": lambda: vcc.PhasePlate(surfaces.Tilt((0.0, 0.0)), z=z),
        # Moves light by less than 1e-9 · 4 · 0.1 m: 1e-5 of a pixel and less.
        "no diffuser": lambda: vcc.Diffuser(kernels.Gaussian(1e-9), z=z),
    }
    picture = default(case)
    # Two a camera, so that a run over many cameras meets each many times.
    for name in rng.choice(list(nothing), 2, replace=False):
        law, other, note = f"null: {name}", _with(case, nothing[name]()), f"at z = {z * 1e3:.4g} mm"
        if name == "clear function":  # not known to be clear: with a stop in its plane it is averaged on a raster
            yield alike(case, law, picture, other, note, other_means=True)
        else:
            yield equal(case, law, picture, other, note=note)


def _stands(case: Case, z: float) -> bool:
    return (
        not any(each.z < z < each.z + each.length for each in case.camera.elements) and z <= case.camera.sensor.z
    )


def halves(case: Case) -> Iterator[Check]:
    """Two lenses of half the power, two prisms of half the deflection, √T twice, in one plane, are one of all.

    A root that is a function is averaged on a raster, where the pattern itself may be in closed form: it is held
    against the pattern as a function.
    """
    picture = default(case)
    for element in case.camera.elements:
        whole = picture
        if isinstance(element, vcc.Lens):
            half = replace(element, focal_length=2 * element.focal_length)
            law = "half lenses"
        elif isinstance(element, vcc.Prism):
            half = replace(element, deflection=tuple(slope / 2 for slope in element.deflection))
            law = "half prisms"
        elif isinstance(element, vcc.Mask):
            half, law = replace(element, pattern=_root(element.pattern)), "roots of masks"
            if isinstance(half.pattern, patterns.FunctionPattern):
                plain = replace(element, pattern=element.pattern.__call__)
                whole = _with(case, plain, without=element)
        else:
            continue
        yield equal(case, law, whole, _with(case, half, half, without=element), note=element.label)


def _root(pattern: Any) -> Any:
    if isinstance(pattern, patterns.Cells):
        return patterns.Cells(np.sqrt(pattern.values), pattern.width, pattern.height, pattern.middle)
    if isinstance(pattern, patterns.Circle | patterns.Polygon):
        return pattern
    return lambda x, y: np.sqrt(pattern(x, y))


def checkerboards(case: Case) -> Iterator[Check]:
    """A checkerboard and its negative in one plane pass nothing; twice the checkerboard is the checkerboard."""
    rng = np.random.default_rng([case.seed, 11])
    places = [z for z in rng.uniform(0, case.camera.sensor.z, 4) if _stands(case, z)] + [case.camera.sensor.z]
    z = float(places[0])
    cells = np.indices((8, 8)).sum(axis=0) % 2 * 1.0
    width = 1.2 * max(max(case.camera.sensor.size), case.shape[1] * abs(case.frame[0, 0]))
    board = vcc.Mask(cells, width=width, z=z)
    negative = vcc.Mask(1 - cells, width=width, z=z)
    one, both, twice = (_with(case, *boards) for boards in ((board,), (board, negative), (board, board)))
    note = f"at z = {z * 1e3:.4g} mm"
    peak = max(one.values.max(), 1e-300)
    yield Check("complementary masks", case.kind, case.seed, float(both.values.max() / peak), ROUNDING, note)
    yield equal(case, "one mask twice", one, twice, note=note)


def engines(case: Case) -> Iterator[Check]:
    """All engines make one picture of one plan."""
    numba = capture(case.camera, case.light_field, engine="numba", **_few(case))
    for name in ("reference", "array_api"):
        other = capture(case.camera, case.light_field, engine=name, **_few(case))
        yield equal(case, f"engines: {name}", numba, other, same_points=True)


def _few(case: Case) -> dict[str, Any]:
    return {"samples": 8} if default(case).error else {}


# -- light


def even_light(case: Case) -> Iterator[Check]:
    """Under a sky of radiance 1 a sensor sees the open aperture: L·A/d², where a stop is the last that absorbs.

    Through lenses and prisms radiance stays what it is, so that the irradiance is the solid angle of the stop that
    bounds the light, here in the plane of the last optics, seen from the sensor. A grid of views that is larger
    than the stop must leave it alone.
    """
    if not all(isinstance(each, vcc.Lens | vcc.Prism) for each in case.camera.elements):
        return
    z, rng = max(each.z for each in case.camera.elements), np.random.default_rng([case.seed, 13])
    size = 2e-3 + 2e-3 * rng.random()
    stop = vcc.Mask(patterns.Circle(size), z=z)
    camera = vcc.Camera([*map(_without_rim, case.camera.elements), stop], case.camera.sensor)
    low, high, within = Bench(camera, case.frame, case.shape[:2], case.flown).asked(case.frame)
    if within < 1 or low.min() < 1 or (high > np.array(case.shape[:1:-1]) - 2).any():
        return  # the light field does not hold all that this stop lets through
    expected = np.pi * size**2 / 4 / (camera.sensor.z - z) ** 2
    ones = case.light_field.replaced(np.ones(case.shape, dtype=np.float32))
    # What cells of views do at the rim is a mask's business: 55 dB, as for one mask anywhere.
    allowed = 10 ** (-TARGETS["one mask"] / 20)
    for method in ("footprints", "rays"):
        shot = capture(camera, ones, method=method)
        error = float(np.sqrt(np.mean((shot.values / expected - 1) ** 2)))
        yield Check(
            f"even light by {method}", case.kind, case.seed, error, allowed + shot.error / expected, "of L·A/d²"
        )


def flux(case: Case) -> Iterator[Check]:
    """What absorbs nothing loses nothing: a sensor that catches everything counts all the light there is."""
    by_position = vcc.Mask | vcc.PrismArray | vcc.CodedDiffuser
    absorbing = [e for e in case.camera.elements if isinstance(e, by_position) or _terms_of(e)]
    kept = [_without_rim(each) for each in case.camera.elements if each not in absorbing]
    field = case.light_field[::3, ::3, ::4, ::4]
    field = field.replaced(np.asarray(field.values, dtype=np.float32) / np.float32(case.light_field.full_scale))
    camera = vcc.Camera(kept, case.camera.sensor)
    if any(e.kind in ("phase plate", "lens array", "biprism", "pyramid") for e in kept):
        return  # bent by cells and functions: rays have no bound without a stop
    if any(e.kind == "real lens" for e in kept):
        return  # its rims absorb
    reach = _reach(camera, field)
    pitch = float(reach.max()) / 24  # what sharpening rings beyond the light's own edge finds room too
    sensor = replace(
        camera.sensor, shape=(101, 101), pitch=pitch, decentre=_middle(camera, field), fill_factor=1.0
    )
    shot = capture(vcc.Camera(kept, sensor), field)
    total = shot.values.sum() * pitch**2 / (field.channels or 1)
    yield Check("flux", case.kind, case.seed, abs(float(total / field.flux) - 1), ROUNDING, "all light caught")


def _terms_of(element: Any) -> list[Any]:
    return [term for part in element.parts() if isinstance(part, vcc.Faces) for term in part.terms]


def _without_rim(element: Any) -> Any:
    if isinstance(element, vcc.Lens) or element.kind in ("diffuser", "biprism", "pyramid"):
        return replace(element, diameter=None)
    if isinstance(element, vcc.FirstOrder):
        return replace(element, stop_from_entrance=None, stop_diameter=None)
    return element


def _corners(camera: vcc.Camera, field: vcc.LightField) -> Array:
    v, u, t, s = field.shape[:4]
    index = np.array(np.meshgrid(*((-1.0, n) for n in (u, v, s, t)), indexing="ij")).reshape(4, -1).T
    return np.asarray((camera.rays_at(camera.sensor.z) @ field.frame)(index))[:, :2]


def _middle(camera: vcc.Camera, field: vcc.LightField) -> tuple[float, float]:
    x, y = _corners(camera, field).T
    return float(x.max() + x.min()) / 2, float(y.max() + y.min()) / 2


def _reach(camera: vcc.Camera, field: vcc.LightField) -> Array:
    """Half of what all samples' cells cover on the sensor, and what a diffuser adds."""
    added = sum(
        max(each.kernel.reach) * abs(camera.sensor.z - each.z)
        for each in camera.elements
        if each.kind == "diffuser"
    )
    return np.asarray(np.ptp(_corners(camera, field), axis=0) / 2 + added)


def rays_are_footprints(case: Case) -> Iterator[Check]:
    """Both methods make one picture, within what rays state and what the tents of a linear look-up may take.

    A look-up that is linear along an axis of samples passes sinc² of a cosine's cycles a sample, and where samples
    are means over pixels sinc once more along s and t. Between views it goes along the parallax of the middle
    depth, and what is left of the cycles is what other depths have. Footprints take as much or less. So each
    cosine may differ by its amplitude times 1 − Π sinc, and the picture by the root mean square of them all.
    """
    by_footprints = _taken(case, "footprints")
    if by_footprints is None:
        return
    by_rays = _taken(case, "rays")
    assert by_rays is not None
    amplitude, vectors, _ = case.scene.waves()
    between, within = np.hsplit(vectors @ case.frame[:4, :4] / 2 / np.pi, 2)
    middle = [np.mean(_disparities_along(case, axis)) for axis in (0, 1)]
    # A point is seen at pixel k − disparity·i: along that way a cosine has these cycles a view.
    between = between - within * middle
    passed = np.sinc(between) ** 2 * np.sinc(within) ** (3 if case.sample == "mean" else 2)
    lost = amplitude * (1 - np.prod(passed, axis=1))
    if not by_footprints.values.any():
        lit = float(np.abs(by_rays.values).max())
        yield Check("rays = footprints", case.kind, case.seed, lit, 0.0, "all dark")
        return
    light = float(by_footprints.values.mean()) / 0.5  # irradiance of a scene of radiance 1
    bound = float(np.sqrt((lost**2).sum() / 2)) * light
    peak = by_footprints.values.max()
    difference = by_rays.values - by_footprints.values
    error = float(np.sqrt(np.mean(difference**2))) / peak
    allowed = granted(difference, float(np.hypot(by_rays.error, bound))) / peak
    light_lost = by_rays.values.mean() / by_footprints.values.mean() - 1
    note = f"light {light_lost:+.3%}, tents may take {bound / peak:.2%}, rays state {by_rays.error / peak:.2%}"
    yield Check("rays = footprints", case.kind, case.seed, error, allowed, note)


def _taken(case: Case, method: str) -> Shot | None:
    try:
        return capture(case.camera, case.light_field, method=method)
    except vcc.InputError:
        if method == "rays":
            raise
        return None  # footprints cannot be had, and say so


LAWS: dict[str, Callable[[Case], Iterator[Check]]] = {
    "linearity": linearity,
    "repeatability": repeatable,
    "order": order,
    "pieces": pieces,
    "refine": refined,
    "stores": stores,
    "reference plane": reference_plane,
    "mirrors": mirrors,
    "null elements": null_elements,
    "halves": halves,
    "checkerboards": checkerboards,
    "engines": engines,
    "even light": even_light,
    "flux": flux,
    "rays = footprints": rays_are_footprints,
}
"""By name; each yields the checks that a case has."""
