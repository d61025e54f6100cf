"""Real lenses from prescriptions: files that list a lens's surfaces, reduced to first order.

`load_lens` reads a file into an element for a camera; `read_prescription` returns the surfaces.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args, overload

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.reading import expanded, is_file, read_bytes, reading
from vcc.base.wavelengths import D_LINE
from vcc.optics.first_order import FirstOrder
from vcc.optics.glass import Glass
from vcc.optics.prescription import Prescription, Reference, Surface, qcon
from vcc.optics.ray_table import RayTableLens
from vcc.optics.real_lens import RealLens
from vcc.prescriptions import codev, json_files, pbrt, ray_tables, zemax
from vcc.prescriptions.media import Media

__all__ = ["Prescription", "Surface", "built_in_lenses", "load_lens", "qcon", "read_prescription"]

Model = Literal["first order", "real", "ray table"]
"""What a lens is made of: its first order, its surfaces, or rays."""
_READERS = {
    ".dat": pbrt.read,
    ".json": json_files.read_optiland,
    ".roa": json_files.read_rayoptics,
    ".seq": codev.read,
    ".zmx": zemax.read,
}
_FORMATS = (".dat (PBRT)", ".json (Optiland)", ".roa (RayOptics)", ".seq (CODE V)", ".zmx (Zemax)")
_BUILT_IN = Path(__file__).parent / "data"


def read_prescription(
    path: str | PathLike[str],
    *,
    wavelength: float = D_LINE,
    glasses: Mapping[str, float | Glass] | None = None,
    configuration: int | None = None,
) -> Prescription:
    """Read the surfaces of a lens from a file, in the order in which light passes them.

    Args:
        path: a PBRT lens table (``.dat``), a sequential file of Zemax (``.zmx``) or CODE V (``.seq``), a lens of
            Optiland (``.json``) or RayOptics (``.roa``); or one of `built_in_lenses`, if there is no such file.
        wavelength: wavelength of the indices, metres; a ``.dat`` states them at one wavelength only.
        glasses: refractive indices, or glasses of `vcc.glasses`, by name, which override catalogues:
            ``{"N-BK7": 1.5168}``.
        configuration: number of the configuration (Zemax) or zoom position (CODE V), from 1; None for the one
            that was active when the file was saved.

    Raises:
        InputError: no such file, another file format, an invalid line, a surface that is not supported (mirror,
            coordinate break, grating …), an unknown glass, or a configuration that does not exist or changes what
            cannot be changed here. The message names the file and the surface or line.
    """
    file = expanded(path)
    own = file.name in built_in_lenses() and not is_file(file)
    reader = codev.read if own else _READERS.get(file.suffix.lower())
    if reader is None:
        raise InputError(
            f"{file} is not a lens prescription that can be read: known are {', '.join(_FORMATS)}, and the names "
            f'{", ".join(built_in_lenses())}; tables of rays (.csv) with model="ray table"'
        )
    if own:
        file = _BUILT_IN / f"{file.name}.seq"
    content = read_bytes(file, "lens prescription")
    media = Media(wavelength, dict(glasses or {}))
    with reading(file, "a lens prescription"):
        read = reader(content, file, media, configuration)
    return dataclasses.replace(read, source=file.stem) if own else read


def built_in_lenses() -> tuple[str, ...]:
    """The names of the lenses that come with the package, which `read_prescription` and `vcc.load_lens` accept.

    Each is a file of CODE V in ``vcc/prescriptions/data``, with its source: a patent or a table in a book.
    """
    return tuple(sorted(file.stem for file in _BUILT_IN.glob("*.seq")))


@overload
def load_lens(path: str | PathLike[str], *, model: Literal["first order"] = ..., **options: Any) -> FirstOrder: ...


@overload
def load_lens(path: str | PathLike[str], *, model: Literal["real"], **options: Any) -> RealLens: ...


@overload
def load_lens(path: str | PathLike[str], *, model: Literal["ray table"], **options: Any) -> RayTableLens: ...


def load_lens(
    path: str | PathLike[str],
    *,
    model: Model = "first order",
    z: float = 0.0,
    z_of: Reference = "first surface",
    stop_diameter: float | None = None,
    f_number: float | None = None,
    wavelength: float | None = None,
    glasses: Mapping[str, float | Glass] | None = None,
    rims: bool | None = None,
    configuration: int | None = None,
    decentre: tuple[float, float] = (0.0, 0.0),
    name: str = "",
    **real: Any,
) -> FirstOrder | RealLens | RayTableLens:
    """Read a lens; light passes its surfaces in the order of the file.

    ``model="first order"``: paraxial. Principal planes, focal length, stop and pupils are those of the lens;
    aberrations are not modelled. Of the rims, only the stop (and with ``rims`` the first and the last surface)
    limits the light.

    ``model="real"``: each ray is refracted by each surface, see `vcc.RealLens`: aberrations, vignetting by all
    rims, exact irradiance, and colour where the file names its glasses.

    ``model="ray table"``: a lens without a prescription, from a table of its rays (``.csv``) or a ray transfer
    function of ISET (``.json``), see `vcc.RayTable` and the page on real lenses. Its first plane stands at ``z``.

    To focus by first order: ``vcc.Sensor(z=lens.z + lens.length + lens.image_distance(2.0), …)``.

    Args:
        path: a file or a name, as in `read_prescription`.
        model: ``"first order"``, ``"real"`` or ``"ray table"``.
        z: position of the first surface, or of the reference ``z_of``, metres.
        z_of: ``"first surface"``, or ``"entrance pupil"``: with z = 0, the entrance pupil is in the plane of
            the light field's views, with the lens's glass in front of it; see
            `vcc.FirstOrder.from_entrance_pupil`.
        stop_diameter: diameter of the stop, metres; None for the stop of the file.
        f_number: focal length / entrance pupil for a distant scene, as an alternative to ``stop_diameter``.
        wavelength: for the indices of glasses, metres. None: the d line, 587.56 nm, for a first-order lens; in a
            real lens each band of light has its own indices where the file names glasses.
        glasses: refractive indices, or glasses of `vcc.glasses`, by name, which override catalogues:
            ``{"N-BK7": 1.5168}``.
        rims: of a first-order lens, whether the rims of the first and the last surface limit the light too.
        configuration: as in `read_prescription`.
        decentre: position (x, y) of the lens's axis, metres.
        name: name in messages and plots.
        real: of a real lens: ``mask``, ``radiometry``, ``transmission``, ``fresnel`` and ``softness`` of
            `vcc.RealLens`. Of a ray table: ``accuracy`` of `vcc.RayTable` and ``radiometry``; of the other options
            it has ``z``, ``wavelength``, ``decentre`` and ``name``.

    Warns:
        ResultWarning: the stop is opened wider than in the file.

    Raises:
        InputError: as in `read_prescription`, `Prescription.first_order` and `vcc.RealLens`.
    """
    checks.one_of("model", model, get_args(Model))
    if "focus" in real:
        raise InputError(
            "a lens alone has no focus: put it in a camera, and move it before the sensor, camera.focused_at(2.0, "
            'moves="real_lens"), or the sensor behind it, camera.focused_at(2.0)'
        )
    if model == "ray table":
        options: dict[str, Any] = {"z_of": None if z_of == "first surface" else z_of}
        options |= {"stop_diameter": stop_diameter, "f_number": f_number, "glasses": glasses, "rims": rims}
        options |= {"configuration": configuration, **real}
        return _ray_table_lens(path, wavelength, options, {"z": z, "decentre": decentre, "name": name})
    given = D_LINE if wavelength is None else wavelength
    prescription = read_prescription(path, wavelength=given, glasses=glasses, configuration=configuration)
    placed: dict[str, Any] = {"z": z, "z_of": z_of, "stop_diameter": stop_diameter, "f_number": f_number}
    placed |= {"decentre": decentre, "name": name}
    with reading(path, "a lens"):
        if model == "first order":
            unknown = next(iter(real), None)
            if unknown is not None:
                raise InputError(f'{unknown} belongs to real lenses: pass model="real" with it')
            return prescription.first_order(**placed, rims=bool(rims))
        if rims is not None:
            raise InputError("rims belongs to first-order lenses: in a real lens all rims limit the light")
        return RealLens.of(prescription, **placed, dispersion=wavelength is None, **real)


def _ray_table_lens(
    path: str | PathLike[str], wavelength: float | None, given: dict[str, Any], placed: dict[str, Any]
) -> RayTableLens:
    """A lens from a table of rays."""
    given = {option: value for option, value in given.items() if value is not None}
    accuracy, radiometry = given.pop("accuracy", None), given.pop("radiometry", "exact")
    if given:
        raise InputError(
            f"{next(iter(given))} is no option of a lens known by its rays: they hold for one stop, one "
            "configuration and one wavelength"
        )
    file = expanded(path)
    with reading(path, "a table of rays"):
        table = ray_tables.read(file, wavelength, accuracy)
        return RayTableLens(table, radiometry, source=file.name, **placed)
