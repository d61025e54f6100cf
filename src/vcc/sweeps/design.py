"""The cameras of a sweep: all combinations of values, a list, or drawn at random or from a Sobol' sequence."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.files.camera_reading import Beside
from vcc.learn.parameters import Parameter, check_apart, place, takes_fractions, with_values
from vcc.optics.sensor import Sensor
from vcc.sweeps.values import Varied, range_of, taking, varied

Kind = Literal["grid", "list", "random", "sobol"]
CAMERA = "camera"
"""The axis of cameras that are given one by one, or that differ in several parameters at once."""
MOST_CAMERAS = 10**6
DRAWN = 64
"""Default number of cameras to draw: a power of two, which suits Sobol' points."""
KEPT = 4096
"""Sweeps of up to this many cameras keep the cameras in memory."""


@dataclass(frozen=True, eq=False, repr=False)
class Design(Brief):
    """Parameters with their values, and how the values are combined; see `grid`, `listed`, `random` and `sobol`.

    Args:
        parameters: names (``"sensor.z"``, ``"code.pattern"``) and values: a list or an array as the camera
            accepts them (SI units), or text as in a camera file: ``"50mm:54mm:40"``, ``"mura, circle"``. For
            ``"random"`` and ``"sobol"`` also an interval, ``(50 * mm, 54 * mm)`` or ``"50mm:54mm"``.
        kind: ``"grid"``: every combination, one axis per parameter; ``"list"``: the first values of all, then
            the second; ``"random"``: independent, uniform draws; ``"sobol"``: scrambled Sobol' points, which
            fill the parameter space more evenly.
        count: number of cameras to draw; None for 64.
        seed: of the draw. The same seed gives the same cameras.
        folder: of the files that text may name, such as those of a mask; default: the current folder.

    Raises:
        InputError: unknown kind; a count or a seed if nothing is drawn; a count that is not a whole number of
            1 or more.
    """

    parameters: Mapping[str, Any]
    kind: Kind = "grid"
    count: int | None = None
    seed: int = 0
    folder: Path = Path()

    def __post_init__(self) -> None:
        checks.one_of("a sweep's design", self.kind, get_args(Kind))
        if not isinstance(self.parameters, Mapping):
            raise InputError(
                'the parameters of a sweep are names and values, {"sensor.z": [50 * mm, 52 * mm]}, not a '
                f"{type(self.parameters).__name__}"
            )
        if not self.parameters and self.kind != "grid":
            raise InputError(f"a {self.kind} design needs parameters: give names and values")
        if not self.drawn:
            for name, default in (("count", None), ("seed", 0)):
                if getattr(self, name) != default:
                    raise InputError(f"{name} applies to random and Sobol' designs only, not to a {self.kind}")
        if self.count is not None:
            checks.whole_number_between("count", self.count, 1, MOST_CAMERAS, of="cameras")
        checks.seed(self.seed)

    @property
    def drawn(self) -> bool:
        """Whether values are drawn."""
        return self.kind in ("random", "sobol")

    def of(self, camera: Camera) -> tuple[Varied, ...]:
        """The parameters and their values; except in a grid, all have the same number of values.

        Args:
            camera: the camera that has the parameters.

        Raises:
            InputError: unknown parameter (the message lists the available ones), invalid values, or lists of
                different lengths.
        """
        if self.drawn:
            points = self._points(len(self.parameters))
            pairs = zip(self.parameters.items(), points.T, strict=True)
            return tuple(self._drawn(camera, name, given, shares) for (name, given), shares in pairs)
        check_apart(self.parameters)
        found = tuple(varied(camera, name, given, Beside(self.folder)) for name, given in self.parameters.items())
        if self.kind == "list" and len({len(each) for each in found}) > 1:
            counts = ", ".join(f"{each.name} {len(each)}" for each in found)
            raise InputError(f"a list needs equally many values of each parameter, and there are {counts}")
        return found

    def _points(self, dimensions: int) -> NDArray[np.float64]:
        """Points in the unit cube, (count, dimensions), below 1."""
        count = DRAWN if self.count is None else self.count
        if self.kind == "random":
            return np.random.default_rng(self.seed).random((count, dimensions))
        from scipy.stats import qmc

        points = qmc.Sobol(dimensions, rng=np.random.default_rng(self.seed))
        return np.asarray(points.random_base2(math.ceil(math.log2(count))))[:count]

    def _drawn(self, camera: Camera, name: str, given: Any, shares: NDArray[np.float64]) -> Varied:
        """Values of a parameter from numbers between 0 and 1: within an interval, or out of a list."""
        ends = range_of(camera, name, given)
        if ends is None:
            choices = varied(camera, name, given, Beside(self.folder))
            return choices.taken((shares * len(choices)).astype(int))
        low, high = ends
        found = place(camera, name)
        if isinstance(found.value, int) and not takes_fractions(found):
            return taking(camera, name, [int(n) for n in np.floor(low + shares * (high - low + 1))])
        return taking(camera, name, [float(n) for n in low + shares * (high - low)])


def grid(parameters: Mapping[str, Any]) -> Design:
    """Every combination of values, one axis per parameter; see `Design`."""
    return Design(parameters)


def listed(parameters: Mapping[str, Any]) -> Design:
    """The first values of all parameters, then the second, and so on; see `Design`."""
    return Design(parameters, "list")


def random(parameters: Mapping[str, Any], count: int = DRAWN, seed: int = 0) -> Design:
    """Cameras with independently drawn parameters; see `Design`."""
    return Design(parameters, "random", count, seed)


def sobol(parameters: Mapping[str, Any], count: int = DRAWN, seed: int = 0) -> Design:
    """Cameras at scrambled Sobol' points, best a power of two of them; see `Design`."""
    return Design(parameters, "sobol", count, seed)


@dataclass(frozen=True, eq=False, repr=False)
class Cameras(Brief, Sequence[Camera]):
    """The cameras of a sweep, numbered; with several axes the last one varies fastest.

    Args:
        base: the camera whose parameters change; of several cameras, the first.
        varied: the parameters and values; `CAMERA` for cameras that are given one by one.
        together: whether all parameters change along one axis.
    """

    base: Camera
    varied: tuple[Varied, ...]
    together: bool = False

    @property
    def axes(self) -> tuple[str, ...]:
        """The names of the axes."""
        return (CAMERA,) if self.together else tuple(each.name for each in self.varied)

    @property
    def shape(self) -> tuple[int, ...]:
        """The number of cameras along each axis."""
        return (len(self.varied[0]),) if self.together else tuple(len(each) for each in self.varied)

    def __len__(self) -> int:
        return math.prod(self.shape)

    def places(self, number: int) -> tuple[int, ...]:
        """The index of a camera's value for each parameter."""
        if self.together:
            return (number,) * len(self.varied)
        return tuple(int(n) for n in np.unravel_index(number, self.shape))

    def said(self, number: int) -> str:
        """The values of a camera as text: ``"sensor.z 50 mm, code.pattern mura"``."""
        pairs = zip(self.varied, self.places(number), strict=True)
        return ", ".join(f"{each.name} {each.labels[place]}" for each, place in pairs) or "as given"

    def __getitem__(self, number: Any) -> Any:
        if isinstance(number, slice):
            return [self[n] for n in range(*number.indices(len(self)))]
        if not -len(self) <= number < len(self):
            raise IndexError(f"there are {len(self)} cameras, and no number {number}")
        number = int(number) % len(self)
        return self._kept(number) if len(self) <= KEPT else self._made(number)

    def __iter__(self) -> Iterator[Camera]:
        return (self[number] for number in range(len(self)))

    def check(self) -> None:
        """Create all cameras once, before long work.

        Raises:
            InputError: a camera rejects its values, which the message contains.
        """
        _ = self.sensors

    @property
    @cached
    def sensors(self) -> tuple[Sensor, ...]:
        """The sensors of all cameras; unchanged sensors are the same object."""
        found = []
        for number in range(len(self)):
            with checks.within(self.said(number)):
                found.append(self[number].sensor)
        return tuple(found)

    def frames(self) -> NDArray[np.float64]:
        """Maps from (column, row, 1) to (x, y, 1) on the sensors: (3, 3), or (…, 3, 3) if they differ."""
        different = {id(sensor): sensor.frame.matrix for sensor in self.sensors}
        first = different[id(self.sensors[0])]
        if all(np.array_equal(frame, first) for frame in different.values()):
            return np.array(first)
        return np.stack([different[id(sensor)] for sensor in self.sensors]).reshape(*self.shape, 3, 3)

    def alike(self) -> list[int]:
        """The numbers of all cameras, sorted so that cameras which differ only in patterns are neighbours."""
        kept = [n for n, each in enumerate(self.varied) if not each.name.endswith(".pattern")]

        def others(number: int) -> tuple[int, ...]:
            places = self.places(number)
            return tuple(places[n] for n in kept)

        return sorted(range(len(self)), key=others)

    @property
    @cached
    def _cameras(self) -> dict[int, Camera]:
        return {}

    def _kept(self, number: int) -> Camera:
        if number not in self._cameras:
            self._cameras[number] = self._made(number)
        return self._cameras[number]

    def _made(self, number: int) -> Camera:
        pairs = zip(self.varied, self.places(number), strict=True)
        values = {each.name: each.values[place] for each, place in pairs}
        base: Camera = values.pop(CAMERA, self.base)
        found = [(self._found(base, name, value), value) for name, value in values.items()]
        return with_values(base, found) if found else base

    def _found(self, base: Camera, name: str, value: Any) -> Parameter:
        """The parameter that receives a value; an array of cells may belong to another field than a pattern."""
        key = id(base), name, type(value)
        if key not in self._parameters:
            self._parameters[key] = place(base, name, value)
        return self._parameters[key]

    @property
    @cached
    def _parameters(self) -> dict[Any, Parameter]:
        return {}


def cameras_of(cameras: Camera | Sequence[Camera], parameters: Mapping[str, Any] | Design | None) -> Cameras:
    """The cameras of a sweep.

    Args:
        cameras: one, or several.
        parameters: the values that vary, applied to each of several cameras. None: nothing.

    Raises:
        InputError: not a camera, no camera, several cameras with a design other than a grid, too many
            cameras; see also `Design.of`, and the checks of the cameras.
    """
    design = parameters if isinstance(parameters, Design) else Design({} if parameters is None else parameters)
    several = [cameras] if isinstance(cameras, Camera) else list(cameras)
    for each in several:
        if not isinstance(each, Camera):
            raise InputError(f"a sweep needs vcc.Camera objects, not a {type(each).__name__}")
    if not several:
        raise InputError("a sweep needs at least one camera, and there is none")
    found = design.of(several[0])
    together = design.kind != "grid"
    if not isinstance(cameras, Camera):
        if together:
            raise InputError(f"several cameras support a grid of parameters only, not a {design.kind}")
        names = [each.name for each in several]
        told_apart = all(names) and len(set(names)) == len(names)
        labels = names if told_apart else [str(n) for n in range(len(several))]
        found = (Varied(CAMERA, tuple(several), tuple(labels)), *found)
    made = Cameras(several[0], found, together)
    if not found:
        made = Cameras(several[0], (Varied(CAMERA, tuple(several), (several[0].name or "0",)),))
    if len(made) > MOST_CAMERAS:
        sizes = " × ".join(map(str, made.shape))
        raise InputError(f"{sizes} are {len(made)} cameras, and a sweep supports up to {MOST_CAMERAS}")
    return made
