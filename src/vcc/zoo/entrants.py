"""Cameras of the zoo: published ones, controls of the same light, and the user's own."""

from __future__ import annotations

import hashlib
import importlib.util
import math
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.reading import read_text
from vcc.base.units import nm
from vcc.camera import Camera
from vcc.camera_file import load_camera
from vcc.gallery.diffuser_depth_of_field import MARGIN, RandomRings
from vcc.gallery.published_codes import LEVIN, VEERARAGHAVAN, ZHOU_NAYAR
from vcc.gallery.wavefront_coding import RATIO
from vcc.optics.mask import Mask
from vcc.optics.phase_plate import PhasePlate
from vcc.shapes.patterns import Circle, Open
from vcc.shapes.surfaces import Cubic
from vcc.zoo.bench import REACH, SIDE, check_camera, of_lens

WAVELENGTH = 550 * nm
OWN = "the user's"
"""Of `Entrant.decoders`: those of the user alone, which suit all cameras."""
MOST_ROUND = math.pi / 4 + 1e-3
"""Light of the largest circle in the square, and the error of traced rays."""


@dataclass(frozen=True, eq=False, repr=False)
class Exposure(Brief):
    """One of the pictures that an entrant takes.

    Args:
        camera: its optics and sensor.
        time: exposure time relative to that of the rules.
        filters: of the pixels, transmission 0 to 1 by band: (rows, columns, bands), or that broadcasts to it, as
            the sensor shows the scene. None for none.
    """

    camera: Camera
    time: float = 1.0
    filters: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Entrant(Brief):
    """A camera of a comparison.

    Args:
        name: of the camera.
        exposures: the pictures that it takes, one after the other or at once.
        controls: names of the entrants that it is compared with, in the order of `vcc.zoo.Task.against`; empty
            strings for none, and nothing at all for controls.
        source: publication.
        decoders: names of the task's decoders that suit it; empty for all.
        traced: whether it is calibrated by images of points (`vcc.zoo.bench.Kernels`).
        options: of `vcc.Camera.capture`; empty lets the camera choose, with many rays if it chooses rays.
    """

    name: str
    exposures: tuple[Exposure, ...]
    controls: tuple[str, ...] = ()
    source: str = ""
    decoders: tuple[str, ...] = ()
    traced: bool = True
    options: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def single(cls, name: str, camera: Camera, time: float = 1.0, **more: Any) -> Entrant:
        """Of one exposure."""
        return cls(name, (Exposure(camera, time),), **more)

    @property
    def camera(self) -> Camera:
        """The camera of the first exposure."""
        return self.exposures[0].camera


def open_square(focus: float) -> Camera:
    """The whole square."""
    return of_lens(Mask(Open(), width=SIDE), focus=focus)


def round_stop(light: float, focus: float) -> Entrant:
    """A round stop of a share of the square's light.

    Raises:
        InputError: more light than the largest circle in the square, π/4.
    """
    if light > MOST_ROUND:
        raise InputError(f"no round stop in the square passes {light:.0%} of its light: π/4 = 79 % is the most")
    stop = Mask(Circle(SIDE * math.sqrt(min(light * 4 / math.pi, 1))))
    return Entrant.single(round_name(light), of_lens(stop, focus=focus))


def round_name(light: float) -> str:
    """The name of a round stop, by its light."""
    return f"round {100 * light:.3g} %"


def coded(name: str, code: Any, source: str, focus: float) -> Entrant:
    """A code of opaque cells that fills the square."""
    return Entrant.single(name, of_lens(Mask(code, width=SIDE), focus=focus), source=source)


def codes(focus: float) -> list[Entrant]:
    """The published codes of the gallery."""
    return [
        coded("Veeraraghavan code", VEERARAGHAVAN, "Veeraraghavan et al. 2007", focus),
        coded("Levin code", LEVIN, "Levin et al. 2007", focus),
        coded("Zhou–Nayar code", ZHOU_NAYAR, "Zhou and Nayar 2009", focus),
    ]


def plates(focus: float) -> list[Entrant]:
    """The published plates that extend the depth of field, designed for the range of depths of the rules."""
    alpha = RATIO * math.pi * (SIDE / 2) ** 2 / WAVELENGTH * REACH
    cubic = PhasePlate(Cubic.from_alpha(alpha, SIDE / 2, WAVELENGTH), width=SIDE)
    rim = Mask(Circle(SIDE))
    random, radial = (
        PhasePlate(RandomRings(SIDE / 2, MARGIN * REACH * SIDE / 2, power), diameter=SIDE) for power in (1, 0)
    )
    return [
        Entrant.single("cubic plate", of_lens(cubic, focus=focus), source="Dowski and Cathey 1995"),
        Entrant.single(
            "random-phase plate", of_lens(rim, random, focus=focus), source="García-Guerrero et al. 2007"
        ),
        Entrant.single("radial plate", of_lens(rim, radial, focus=focus), source="Cossairt et al. 2010"),
    ]


AGAINST = ("a round stop of its light", "a shorter exposure of the open square")
"""What `with_controls` compares with."""


def with_controls(
    entrants: list[Entrant], lights: dict[str, float], focus: float, curve: tuple[float, ...]
) -> list[Entrant]:
    """Entrants and their controls: the open square, round stops and shorter exposures of the same light.

    A camera with more light than the largest circle, 79 %, is compared with the open square.

    Args:
        entrants: cameras to compare.
        lights: share of the light of each, by name.
        focus: distance in focus, metres.
        curve: light of further round stops.
    """
    wide = open_square(focus)
    controls = {"open": Entrant.single("open", wide)}
    shares = {each.name: round(lights[each.name], 4) for each in entrants}
    for light in sorted({*shares.values(), *curve}, reverse=True):
        if light <= MOST_ROUND:
            stop = round_stop(light, focus)
            controls[stop.name] = stop
        if light in shares.values() and light < 0.999:
            controls[_short(light)] = Entrant.single(_short(light), wide, light)
    return [
        *(
            replace(
                each,
                controls=("open" if light > MOST_ROUND else round_name(light), _short(light) * (light < 0.999)),
            )
            for each, light in ((each, shares[each.name]) for each in entrants)
        ),
        *controls.values(),
    ]


def _short(light: float) -> str:
    return f"open, {100 * light:.3g} % of the time"


def loaded(path: Path, check: Callable[[Camera, str], None] = check_camera) -> Camera:
    """A camera file of the user, checked.

    Args:
        path: of the file.
        check: raises InputError for a camera, with its name, that the task does not support.

    Raises:
        InputError: it cannot be read, or it does not follow the rules.
    """
    camera = load_camera(path)
    check(camera, path.name)
    return camera


# --- functions of the user ---


@dataclass(frozen=True)
class FromFile:
    """A function in a Python file of the user, for decoders.

    Args:
        path: of the file.
        function: its name.
        digest: of the file's text, so that results of another version are computed again.
    """

    path: str
    function: str
    digest: str

    @classmethod
    def of(cls, text: str) -> FromFile:
        """From "my.py:decode".

        Raises:
            InputError: another form, no such file, or no such function.
        """
        name, colon, function = text.rpartition(":")
        path = Path(name).expanduser()
        if not (colon and path.suffix == ".py" and function.isidentifier()):
            raise InputError(f'--decoder is "{text}": it is a file and a function in it, like "my.py:decode"')
        found = cls(str(path.resolve()), function, hashlib.sha256(read_text(path).encode()).hexdigest()[:16])
        found.load()
        return found

    def load(self) -> Any:
        """The function.

        Raises:
            InputError: the file fails, or has no such function.
        """
        return _function(self)

    def takes(self, camera: Camera) -> bool:
        """Whether the function is one for this camera: if it has an attribute ``takes``, the value of that."""
        takes = getattr(self.load(), "takes", None)
        return takes is None or bool(takes(camera))


@lru_cache(maxsize=32)
def _function(of: FromFile) -> Any:
    name = f"_vcc_zoo_{of.digest}"
    spec = importlib.util.spec_from_file_location(name, of.path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise InputError(f"{of.path} cannot be run: {type(error).__name__}: {error}") from error
    function = getattr(module, of.function, None)
    if not callable(function):
        raise InputError(f"{of.path} has no function {of.function}")
    return function
