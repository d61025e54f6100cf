"""Lenses of other Python packages: Optiland's JSON (.json) and RayOptics' JSON (.roa).

Both store the attributes of their objects. Lenses of spheres, conics and even aspheres are read as Optiland 0.6
and RayOptics 0.9 write them. Lengths are millimetres in Optiland, and in RayOptics the unit that the file states.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

from vcc.base.errors import InputError
from vcc.base.reading import read_json, value_at
from vcc.base.units import cm, m, mm, nm, um
from vcc.optics.catalogues import makers
from vcc.optics.glass import Table
from vcc.optics.prescription import Prescription, Surface
from vcc.prescriptions.assembly import (
    FAR,
    assembled,
    no_configuration,
    not_round,
    not_supported,
    radius_of,
    real,
    to_axis,
    without_r2,
)
from vcc.prescriptions.media import AIR, Media, Medium

_UNITS = {"mm": mm, "cm": cm, "m": m, "inches": 25.4 * mm, "um": um, "nm": nm, "feet": 304.8 * mm}


def _number(tree: Any, place: str, *keys: str) -> float:
    number = real(value_at(tree, *keys))
    if number is None:
        raise InputError(f"{place}: {'.'.join(keys)} is {value_at(tree, *keys)!r}, which is not a number")
    return number


def _list(tree: Any, *keys: str) -> list[Any]:
    found = value_at(tree, *keys)
    return found if isinstance(found, list) else []


def _numbers(tree: Any, place: str, *keys: str) -> list[float]:
    found = [real(number) for number in _list(tree, *keys)]
    if None in found:
        raise InputError(f"{place}: {'.'.join(keys)} are not all numbers")
    return [number or 0.0 for number in found]


def _points(listed: list[Any]) -> list[tuple[float, float]]:
    return [(real(value_at(each, "x")) or 0.0, real(value_at(each, "y")) or 0.0) for each in listed]


def _main_first(waves: list[float], main: int) -> tuple[float, ...]:
    main = main if 0 <= main < len(waves) else 0
    return tuple(waves[main : main + 1] + waves[:main] + waves[main + 1 :])


# --- Optiland ---


def read_optiland(content: bytes, file: Path, media: Media, configuration: int | None) -> Prescription:
    """Read the prescription in a file of Optiland (``save_optiland_file``).

    Raises:
        InputError: another JSON file, a surface that is not supported, an unknown glass, a value that is not a
            number. The message names the file and the surface.
    """
    no_configuration(configuration, file)
    tree = read_json(content, str(file))
    surfaces = _list(tree, "surface_group", "surfaces")
    if len(surfaces) < 3:
        raise InputError(
            f"{file} lists {len(surfaces)} surfaces (surface_group): a lens of Optiland has 3 or more"
        )
    places = [f"{file}: surface {number}" for number in range(len(surfaces))]
    heights = [_number(each, place, "geometry", "cs", "z") for each, place in zip(surfaces, places, strict=True)]
    listed = [
        _of_optiland(each, number, after - before, media, places[number])
        for number, (each, before, after) in enumerate(zip(surfaces, heights, heights[1:], strict=False))
    ]
    aperture, size = value_at(tree, "aperture", "type"), real(value_at(tree, "aperture", "value"))
    if aperture == "float_by_stop_size" and size:
        listed = [dataclasses.replace(each, diameter=size * mm) if each.stop else each for each in listed]
    waves = _list(tree, "wavelengths", "wavelengths")
    scale = [_UNITS.get(str(value_at(each, "unit")), um) for each in waves]
    angles = value_at(tree, "fields", "field_definition", "field_type") == "AngleField"
    return assembled(
        listed,
        file,
        name=str(tree.get("name") or ""),
        f_number=size if aperture == "imageFNO" and size and size > 0 else None,
        entrance_pupil_diameter=size * mm if aperture == "EPD" and size and size > 0 else None,
        wavelengths=_main_first(
            [(real(value_at(each, "value")) or 0.0) * unit for each, unit in zip(waves, scale, strict=True)],
            next((place for place, each in enumerate(waves) if value_at(each, "is_primary")), 0),
        ),
        fields=to_axis(_points(_list(tree, "fields", "fields"))) if angles else (),
    )


def _of_optiland(each: Any, number: int, gap: float, media: Media, place: str) -> Surface:
    geometry = value_at(each, "geometry")
    tilts = [real(value_at(geometry, "cs", axis)) for axis in ("x", "y", "rx", "ry", "rz")]
    if any(tilts) or None in tilts or value_at(geometry, "cs", "reference_cs") is not None:
        raise not_supported(place, "a decentred or tilted surface")
    kind = value_at(geometry, "type")
    if kind not in ("Plane", "StandardGeometry", "EvenAsphere"):
        raise not_supported(place, f"of another shape ({kind})")
    interaction = value_at(each, "interaction_model", "type")
    if value_at(each, "interaction_model", "is_reflective") or value_at(each, "material_post", "type") == "Mirror":
        raise not_supported(place, "a mirror")
    if interaction not in (None, "RefractiveReflectiveModel"):
        raise not_supported(place, f"of another kind ({interaction})")
    opening, outer = value_at(each, "aperture", "type"), 0.0
    if opening is not None:
        outer = real(value_at(each, "aperture", "r_max")) or 0.0
        if opening != "RadialAperture" or real(value_at(each, "aperture", "r_min")) != 0:
            raise not_round(place, f"the opening {opening}")
    radius = _number(geometry, place, "radius")
    medium = _medium_of_optiland(value_at(each, "material_post"), media, place)
    terms = _numbers(geometry, place, "coefficients") if kind == "EvenAsphere" else []
    return Surface(
        radius=math.inf if math.isinf(radius) else radius * mm,
        thickness=math.inf if gap >= FAR else gap * mm,
        index=medium.index,
        diameter=2 * outer * mm if 0 < outer < math.inf else None,
        stop=value_at(each, "is_stop") is True,
        glass=medium.glass,
        number=number,
        conic=_number(geometry, place, "conic") if kind != "Plane" else 0.0,
        aspheres=without_r2(terms, mm, place),
        material=medium.material,
    )


def _maker(material: Any) -> str:
    """The maker of a glass: its file in Optiland's database is …/glass/<maker>/<name>.yml."""
    parts = str(value_at(material, "filename") or "").replace("\\", "/").split("/")
    return parts[-2] if len(parts) > 1 else str(value_at(material, "reference") or "")


def _medium_of_optiland(material: Any, media: Media, place: str) -> Medium:
    kind, name = value_at(material, "type"), str(value_at(material, "name") or "")
    if kind == "IdealMaterial":
        index = _number(material, place, "index")
        return AIR if index == 1 else Medium(index)
    if kind == "AbbeMaterial":
        return media.of_numbers(_number(material, place, "index"), _number(material, place, "abbe"), place)
    if kind == "Material" and name:
        maker = _maker(material)
        if name.upper() not in media.given and maker and makers() and maker.upper() not in makers():
            raise InputError(
                f"{place} is of {name} by {maker}, which is not one of {', '.join(makers())}: pass its index, "
                f'glasses={{"{name}": 1.4338}}, say'
            )
        return media.of_name(name, [maker] if maker else [], place)
    raise InputError(
        f"{place} is of a material of the kind {kind}, which is not supported: IdealMaterial, Material and "
        "AbbeMaterial are"
    )


# --- RayOptics ---


def read_rayoptics(content: bytes, file: Path, media: Media, configuration: int | None) -> Prescription:
    """Read the prescription in a file of RayOptics (``save_model``).

    Raises:
        InputError: another JSON file, a surface that is not supported, an unknown glass, a value that is not a
            number. The message names the file and the surface.
    """
    no_configuration(configuration, file)
    model = value_at(read_json(content, str(file)), "optical_model", "attributes")
    sequence = value_at(model, "seq_model", "attributes")
    interfaces, gaps = _list(sequence, "ifcs"), _list(sequence, "gaps")
    if len(interfaces) < 3 or len(gaps) != len(interfaces) - 1:
        raise InputError(
            f"{file} lists {len(interfaces)} surfaces and {len(gaps)} gaps: a lens of RayOptics has 3 or more "
            "surfaces, with a gap behind each but the last"
        )
    dimension = value_at(model, "system_spec", "attributes", "_dimensions")
    dimension = str(dimension or value_at(model, "system_spec", "attributes", "dimensions")).lower()
    if dimension not in _UNITS:
        raise InputError(f"{file}: its unit of length {dimension} is not known; known are {', '.join(_UNITS)}")
    unit = _UNITS[dimension]
    profiles = value_at(model, "profile_dict")
    stop = value_at(sequence, "stop_surface")
    listed = []
    for number, (each, gap) in enumerate(zip(interfaces, gaps, strict=False)):
        own = value_at(each, "attributes")
        profile = value_at(own, "profile") or value_at(profiles, str(value_at(own, "profile_id")))
        behind = value_at(gap, "attributes")
        listed.append(_of_rayoptics(each, profile, behind, number, unit, media, f"{file}: surface {number}"))
    if isinstance(stop, int) and 0 <= stop < len(listed):
        listed[stop] = dataclasses.replace(listed[stop], stop=True)
    specs = value_at(model, "optical_spec", "attributes")
    shift = real(value_at(specs, "defocus", "attributes", "focus_shift")) or 0.0
    waves = value_at(specs, "spectral_region", "attributes")
    return assembled(
        [*listed[:-1], dataclasses.replace(listed[-1], thickness=listed[-1].thickness + shift * unit)],
        file,
        name=str(value_at(model, "system_spec", "attributes", "title") or ""),
        wavelengths=_main_first(
            [wave * nm for wave in _numbers(waves, str(file), "wavelengths")],
            int(real(value_at(waves, "reference_wvl")) or 0),
        ),
        **_pupil(value_at(specs, "pupil", "attributes"), unit, far=math.isinf(listed[0].thickness)),
        fields=_fields(value_at(specs, "field_of_view", "attributes")),
    )


def _kind(each: Any) -> str:
    """The class of an object that RayOptics stored."""
    names = value_at(each, "__instance_type__")
    return str(names[-1]) if isinstance(names, list) and names else ""


def _pupil(pupil: Any, unit: float, *, far: bool) -> dict[str, float]:
    key, value = (
        [str(each) for each in _list(pupil, "_key") or _list(pupil, "key")],
        real(value_at(pupil, "value")),
    )
    if not value or value <= 0 or not far:
        return {}
    if "image" in key and "f/#" in key:
        return {"f_number": value}
    return {"entrance_pupil_diameter": value * unit} if key[-1:] in (["epd"], ["pupil"]) else {}


def _fields(view: Any) -> tuple[float, ...]:
    if [str(each) for each in _list(view, "key")[-2:]] != ["object", "angle"]:
        return ()
    scale = (real(value_at(view, "value")) or 0.0) if value_at(view, "is_relative") else 1.0
    points = _points([value_at(each, "attributes") for each in _list(view, "fields")])
    return to_axis([(x * scale, y * scale) for x, y in points])


def _of_rayoptics(
    interface: Any, profile: Any, gap: Any, number: int, unit: float, media: Media, place: str
) -> Surface:
    kind, each = _kind(interface), value_at(interface, "attributes")
    mode = value_at(each, "interact_mode")
    if kind != "Surface" or value_at(each, "phase_element") is not None:
        raise not_supported(place, f"of another kind ({'a diffractive surface' if kind == 'Surface' else kind})")
    if mode == "reflect":
        raise not_supported(place, "a mirror")
    if value_at(each, "decenter") is not None:
        raise not_supported(place, "a decentred or tilted surface")
    widths = [real(value_at(each, "max_aperture")) or 0.0]
    for opening in _list(each, "clear_apertures"):
        own = value_at(opening, "attributes")
        if _kind(opening) != "Circular" or value_at(own, "x_offset") or value_at(own, "y_offset"):
            raise not_round(place, f"the opening {_kind(opening)}")
        widths = [real(value_at(own, "radius")) or 0.0]
    shape, own = _kind(profile), value_at(profile, "attributes")
    conic, terms = 0.0, list[float]()
    if shape == "Conic":
        conic = _number(own, place, "cc")
    elif shape == "EvenPolynomial":
        conic, terms = real(value_at(own, "cc")) or 0.0, _numbers(own, place, "coefs")
    elif shape == "RadialPolynomial":
        conic, terms = _number(own, place, "ec") - 1, _numbers(own, place, "coefs")
        if any(terms[0::2]):
            raise not_supported(place, "an odd asphere (RadialPolynomial)")
        terms = terms[1::2]
    elif shape != "Spherical":
        raise not_supported(place, f"of another shape ({shape})")
    thickness = _number(gap, place, "thi")
    medium = _medium_of_rayoptics(value_at(gap, "medium"), media, place)
    return Surface(
        radius=radius_of(_number(own, place, "cv"), unit),
        thickness=math.inf if thickness >= FAR else thickness * unit,
        index=medium.index,
        diameter=2 * max(widths) * unit if max(widths) > 0 else None,
        glass=medium.glass,
        number=number,
        conic=conic,
        aspheres=without_r2(terms, unit, place),
        material=medium.material,
    )


def _medium_of_rayoptics(medium: Any, media: Media, place: str) -> Medium:
    kind, own = _kind(medium), value_at(medium, "attributes")
    name = str(value_at(own, "gname") or value_at(own, "label") or "")
    if kind == "Air":
        return AIR
    if name and name.upper() in media.given:
        return media.of_name(name, [], place)
    if kind == "ConstantIndex":
        return Medium(_number(own, place, "n"), name)
    if kind == "ModelGlass":
        return media.of_numbers(_number(own, place, "n"), _number(own, place, "v"), place, name)
    if kind == "InterpolatedMedium":
        waves, indices = _numbers(own, place, "wvls"), _numbers(own, place, "rndx")
        pairs = sorted(zip((wave * nm for wave in waves), indices, strict=True))
        table = Table(tuple(wave for wave, _ in pairs), tuple(index for _, index in pairs))
        return media.of_glass(name, table, place)
    if name and kind.endswith("Glass"):
        return media.of_name(name, [kind.removesuffix("Glass")], place)
    raise InputError(
        f"{place} is of a medium of the kind {kind}, which is not supported: pass it by its name, "
        f'glasses={{"{name}": 1.5168}}, say'
    )
