"""Cameras of the zoo: published ones, controls of the same light, and the user's own."""

from __future__ import annotations

import hashlib
import importlib.util
import math
import sys
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

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
MOST_ROUND = math.pi / 4 + 1e-3
"""Light of the largest circle in the square, and the error of traced rays."""


@dataclass(frozen=True, eq=False, repr=False)
class Entrant(Brief):
    """A camera of a comparison.

    Args:
        name: of the camera.
        camera: focused as the task demands.
        time: exposure time relative to all others: less than 1 for the control of a shorter exposure.
        control: the control of the same light; empty for controls. `with_controls` names it.
        source: publication.
    """

    name: str
    camera: Camera
    time: float = 1.0
    control: str = ""
    source: str = ""


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
    return Entrant(round_name(light), of_lens(stop, focus=focus))


def round_name(light: float) -> str:
    """The name of a round stop, by its light."""
    return f"round {100 * light:.3g} %"


def coded(name: str, code: Any, source: str, focus: float) -> Entrant:
    """A code of opaque cells that fills the square."""
    return Entrant(name, of_lens(Mask(code, width=SIDE), focus=focus), source=source)


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
        Entrant("cubic plate", of_lens(cubic, focus=focus), source="Dowski and Cathey 1995"),
        Entrant("random-phase plate", of_lens(rim, random, focus=focus), source="García-Guerrero et al. 2007"),
        Entrant("radial plate", of_lens(rim, radial, focus=focus), source="Cossairt et al. 2010"),
    ]


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
    controls = {"open": Entrant("open", wide)}
    shares = {round(lights[each.name], 4) for each in entrants}
    for light in sorted(shares | set(curve), reverse=True):
        if light <= MOST_ROUND:
            stop = round_stop(light, focus)
            controls[stop.name] = stop
        if light in shares and light < 0.999:
            short = Entrant(f"open, {100 * light:.3g} % of the time", wide, time=light)
            controls[short.name] = short
    named = [
        replace(each, control="open" if light > MOST_ROUND else round_name(round(light, 4)))
        for each, light in ((each, lights[each.name]) for each in entrants)
    ]
    return [*named, *controls.values()]


def loaded(path: Path) -> Camera:
    """A camera file of the user, checked.

    Raises:
        InputError: it cannot be read, or its pixels differ from those of the rules.
    """
    camera = load_camera(path)
    check_camera(camera, path.name)
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
