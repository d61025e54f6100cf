"""Real lenses from prescriptions: the files that list a lens's surfaces, reduced to first order.

`load_lens` reads a file into an element for a camera; `read_prescription` gives the surfaces themselves.
"""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike

from vcc.base.errors import InputError
from vcc.base.reading import expanded, read_bytes, reading
from vcc.optics.first_order import FirstOrder
from vcc.prescriptions import pbrt, zemax
from vcc.prescriptions.glasses import D_LINE, Glasses
from vcc.prescriptions.model import Prescription, Reference, Surface

__all__ = ["Prescription", "Surface", "load_lens", "read_prescription"]

_READERS = {".dat": pbrt.read, ".zmx": zemax.read}


def read_prescription(
    path: str | PathLike[str], *, wavelength: float = D_LINE, glasses: Mapping[str, float] | None = None
) -> Prescription:
    """The surfaces of a lens as a file lists them, light travelling from the first to the last.

    Args:
        path: a PBRT lens table (``.dat``) or a sequential Zemax file (``.zmx``).
        wavelength: metres, at which catalogue glasses are taken; a ``.dat`` gives indices at one only.
        glasses: refractive indices by name, taken before any catalogue: ``{"N-BK7": 1.5168}``.

    Raises:
        InputError: no such file, another kind of file, a line that cannot be read, a surface that has no
            paraxial reduction here (asphere, mirror, coordinate break …) or whose glass is not known. The
            message names the file and the surface or line.
    """
    file = expanded(path)
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise InputError(
            f"{file} is not a lens prescription that can be read: known are .dat (PBRT) and .zmx (Zemax)"
        )
    content = read_bytes(file, "lens prescription")
    named = Glasses(wavelength, dict(glasses or {}))
    with reading(file, "a lens prescription"):
        return reader(content, file, named)


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
    """A real lens, reduced to first order: light travels through its surfaces as the file lists them.

    Paraxial: principal planes, focal length, stop and pupils are the lens's own, aberrations are not, and of
    the rims only the stop (and with ``rims`` the first and the last surface) cuts light off.
    To focus: ``vcc.Sensor(z=lens.z + lens.length + lens.image_distance(2.0), …)``.

    Args:
        path: a PBRT lens table (``.dat``) or a sequential Zemax file (``.zmx``).
        z: place of the first surface, or of what ``z_of`` says, metres.
        z_of: ``"first surface"``, or ``"entrance pupil"``: with z = 0 the lens then looks from where the views of
            the light field stand, its glass before them; see `vcc.FirstOrder.from_entrance_pupil`.
        stop_diameter: metres; None for the file's own stop.
        f_number: focal length / entrance pupil, for a distant scene, by which to open the stop instead.
        wavelength: metres, at which catalogue glasses are taken.
        glasses: refractive indices by name, taken before any catalogue: ``{"N-BK7": 1.5168}``.
        rims: whether the rims of the first and the last surface cut light off too.
        decentre: place (x, y) of the lens's axis, metres.
        name: how to call it in messages and plots.

    Warns:
        ResultWarning: the stop is opened wider than in the file.

    Raises:
        InputError: see `read_prescription` and `Prescription.first_order`.
    """
    prescription = read_prescription(path, wavelength=wavelength, glasses=glasses)
    with reading(path, "a lens"):
        return prescription.first_order(
            z=z, z_of=z_of, stop_diameter=stop_diameter, f_number=f_number, rims=rims, decentre=decentre, name=name
        )
