"""Real lenses from prescriptions: files that list a lens's surfaces, reduced to first order.

`load_lens` reads a file into an element for a camera; `read_prescription` returns the surfaces.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from os import PathLike
from pathlib import Path

from vcc.base.errors import InputError
from vcc.base.reading import expanded, is_file, read_bytes, reading
from vcc.base.wavelengths import D_LINE
from vcc.optics.first_order import FirstOrder
from vcc.optics.glass import Glass
from vcc.prescriptions import codev, json_files, pbrt, zemax
from vcc.prescriptions.media import Media
from vcc.prescriptions.model import Prescription, Reference, Surface, qcon

__all__ = ["Prescription", "Surface", "built_in_lenses", "load_lens", "qcon", "read_prescription"]

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
            f"{', '.join(built_in_lenses())}"
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


def load_lens(
    path: str | PathLike[str],
    *,
    z: float = 0.0,
    z_of: Reference = "first surface",
    stop_diameter: float | None = None,
    f_number: float | None = None,
    wavelength: float = D_LINE,
    glasses: Mapping[str, float] | None = None,
    rims: bool = False,
    decentre: tuple[float, float] = (0.0, 0.0),
    name: str = "",
) -> FirstOrder:
    """Read a real lens, reduced to first order; light passes its surfaces in the order of the file.

    Paraxial: principal planes, focal length, stop and pupils are those of the lens; aberrations are not
        modelled. Of the rims, only the stop (and with ``rims`` the first and the last surface) limits the
        light. To focus: ``vcc.Sensor(z=lens.z + lens.length + lens.image_distance(2.0), …)``.

    Args:
        path: a file or a name, as in `read_prescription`.
        z: position of the first surface, or of the reference ``z_of``, metres.
        z_of: ``"first surface"``, or ``"entrance pupil"``: with z = 0, the entrance pupil is in the plane of
            the light field's views, with the lens's glass in front of it; see
            `vcc.FirstOrder.from_entrance_pupil`.
        stop_diameter: diameter of the stop, metres; None for the stop of the file.
        f_number: focal length / entrance pupil for a distant scene, as an alternative to ``stop_diameter``.
        wavelength: wavelength for catalogue glasses, metres.
        glasses: refractive indices by name, which override catalogues: ``{"N-BK7": 1.5168}``.
        rims: whether the rims of the first and the last surface limit the light too.
        decentre: position (x, y) of the lens's axis, metres.
        name: name in messages and plots.

    Warns:
        ResultWarning: the stop is opened wider than in the file.

    Raises:
        InputError: as in `read_prescription` and `Prescription.first_order`.
    """
    prescription = read_prescription(path, wavelength=wavelength, glasses=glasses)
    with reading(path, "a lens"):
        return prescription.first_order(
            z=z, z_of=z_of, stop_diameter=stop_diameter, f_number=f_number, rims=rims, decentre=decentre, name=name
        )
