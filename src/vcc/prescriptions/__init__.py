"""Real lenses from prescriptions: files that list a lens's surfaces, reduced to first order.

`load_lens` reads a file into an element for a camera; `read_prescription` returns the surfaces.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike

from vcc.base.errors import InputError
from vcc.base.reading import expanded, read_bytes, reading
from vcc.base.wavelengths import D_LINE
from vcc.optics.first_order import FirstOrder
from vcc.optics.glass import Glass
from vcc.prescriptions import codev, json_files, pbrt, zemax
from vcc.prescriptions.media import Media
from vcc.prescriptions.model import Prescription, Reference, Surface

__all__ = ["Prescription", "Surface", "load_lens", "read_prescription"]

_READERS = {
    ".dat": pbrt.read,
    ".json": json_files.read_optiland,
    ".roa": json_files.read_rayoptics,
    ".seq": codev.read,
    ".zmx": zemax.read,
}


def read_prescription(
    path: str | PathLike[str],
    *,
    wavelength: float = D_LINE,
    glasses: Mapping[str, float | Glass] | None = None,
    configuration: int | None = None,
) -> Prescription:
    """Read the surfaces of a lens from a file, in the order in which light passes them.

    Args:
        path: a PBRT lens table (``.dat``) or a sequential Zemax file (``.zmx``).
        wavelength: wavelength for catalogue glasses, metres; a ``.dat`` states indices at one wavelength only.
        glasses: refractive indices, or glasses of `vcc.glasses`, by name, which override catalogues:
            ``{"N-BK7": 1.5168}``.

    Raises:
        InputError: no such file, another file format, an invalid line, a surface that is not supported (mirror,
            coordinate break, grating …), or an unknown glass. The message names the file and the
            surface or line.
    """
    file = expanded(path)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise InputError(
            f"{file} is not a lens prescription that can be read: known are .dat (PBRT) and .zmx (Zemax)"
        )
    content = read_bytes(file, "lens prescription")
    media = Media(wavelength, dict(glasses or {}))
    with reading(file, "a lens prescription"):
        return reader(content, file, media, configuration)


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
        path: a PBRT lens table (``.dat``) or a sequential Zemax file (``.zmx``).
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
