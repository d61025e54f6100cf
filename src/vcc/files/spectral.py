"""Wavelengths that pictures state for their channels: spectral OpenEXR, OME-TIFF, ENVI.

OpenEXR: channels ``S0.550,000000nm`` of the layout of Fichet et al. 2021 (An OpenEXR layout for spectral images,
JCGT 10 (3)): the radiance of a band, with the wavelength in metres with a prefix. OME-TIFF: ``EmissionWavelength``
of the channels (OME-XML, openmicroscopy.org).
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree

from vcc.base.errors import InputError, ResultWarning
from vcc.base.reading import number
from vcc.base.wavelengths import wavelength
from vcc.files.envi import ENDINGS as ENVI
from vcc.files.envi import wavelengths_of

_BAND = re.compile(r"S0\.(\d+(?:[.,]\d+)?(?:[eE][+-]?\d+)?)([num]?)m")
_PREFIXES = {"": 1.0, "m": 1e-3, "u": 1e-6, "n": 1e-9}
_UNITS = {"nm": 1e-9, "µm": 1e-6, "μm": 1e-6, "um": 1e-6, "mm": 1e-3, "m": 1.0, "Å": 1e-10}


def bands_of(channels: Iterable[str]) -> dict[str, float]:
    """The channels of a spectral OpenEXR file that are bands of radiance, and their wavelengths; shortest first.

    Args:
        channels: all names; those of other layouts, of polarisation and of previews are left out.

    Raises:
        InputError: a wavelength that is not from 100 nm to 50 µm, or two bands of one wavelength.
    """
    named = {name: found for name in channels if (found := _BAND.fullmatch(name))}
    stated = {
        name: wavelength(
            f'the wavelength of channel "{name}"', float(number.replace(",", ".")) * _PREFIXES[prefix]
        )
        for name, (number, prefix) in ((name, found.groups()) for name, found in named.items())
    }
    if len(set(stated.values())) < len(stated):
        raise InputError(f"two of the channels {', '.join(sorted(stated))[:200]} have the same wavelength")
    return dict(sorted(stated.items(), key=lambda item: item[1]))


def ome(text: str, kind: str) -> list[ElementTree.Element]:
    """All elements of a kind in OME-XML.

    Raises:
        InputError: text that is no XML.
    """
    try:
        return [one for one in ElementTree.fromstring(text).iter() if one.tag.rpartition("}")[2] == kind]
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"its OME-XML is damaged ({str(error)[:100]})") from None


def emission_wavelengths(text: str) -> tuple[float, ...] | None:
    """The emission wavelengths in the OME-XML of a picture, metres; None unless all channels state one.

    Raises:
        InputError: text that is no XML, an unknown unit, or a wavelength that is not from 100 nm to 50 µm.
    """
    channels = ome(text, "Channel")
    stated = [one.get("EmissionWavelength") for one in channels]
    if not channels or None in stated:
        some = len(stated) - stated.count(None)
        if some:
            warnings.warn(
                f"{some} of {len(stated)} channels of an OME-TIFF state an EmissionWavelength: none is used, as "
                "all bands of a light field have one. Pass light_field.with_wavelengths(...)",
                ResultWarning,
                stacklevel=2,
            )
        return None
    found = []
    for one, given in zip(channels, stated, strict=True):
        unit = one.get("EmissionWavelengthUnit", "nm")
        if unit not in _UNITS:
            known = ", ".join(_UNITS)
            raise InputError(
                f"the unit of an emission wavelength in its OME-XML is {unit[:20]!r}, not one of {known}"
            )
        name = f"EmissionWavelength {str(given)[:20]!r} of its OME-XML"
        found.append(wavelength(name, number(given) * _UNITS[unit]))
    return tuple(found)


def wavelengths_in(path: Path) -> tuple[float, ...] | None:
    """The wavelengths that a picture states for its channels, metres, in the order of the channels; else None.

    Args:
        path: a picture that can be read.

    Raises:
        InputError: a damaged file, or damaged metadata.
    """
    ending = path.suffix.lower()
    try:
        if ending == ".exr":
            import OpenEXR

            with OpenEXR.File(str(path), separate_channels=True, header_only=True) as file:
                return tuple(bands_of(one.name for one in file.parts[0].header["channels"]).values()) or None
        if ending in (".tif", ".tiff"):
            import tifffile

            with tifffile.TiffFile(path) as tiff:
                text = tiff.ome_metadata
            return None if text is None else emission_wavelengths(text)
        if ending in ENVI:
            return wavelengths_of(path)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except Exception as error:  # each library has its own exceptions for damaged files
        raise InputError(f"{path} cannot be read as a picture ({str(error)[:200]})") from error
    return None
