"""Lenses without a prescription: tables of rays (.csv), and ray transfer functions of ISET (.json).

A ray transfer function (Goossens et al. 2022, Optics Express 30, 24031) is a set of polynomials in the place and
the direction of a ray in a plane between film and lens, and for each distance from the axis an ellipse, or some
circles, that rays pass. Lengths are millimetres, directions unit vectors towards the scene, and the ray is rotated
about the axis so that it begins on +y. The file is read by evaluating it for many rays that pass.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import units
from vcc.base.errors import InputError, warn_of_result
from vcc.base.reading import read_bytes, read_json, read_text
from vcc.base.units import mm, nm
from vcc.optics.ray_table import RayTable

Array = NDArray[np.float64]

RAYS = 20000
"""Rays for which a ray transfer function is evaluated."""
BORDER = 0.3
"""Share of these rays that is on the border of the opening."""
STEEPEST = 80.0
"""Largest angle of rays to the axis, degrees: slopes describe rays here."""
_COLUMNS = ("x", "y", "s", "t", "x_out", "y_out", "s_out", "t_out")
_UNITS = {"m": 1.0, "mm": 1e-3, "um": 1e-6}
_OUTPUTS = {"outx", "outy", "outz", "outdx", "outdy", "outdz"}
_OLDER = {"outu": "outdx", "outv": "outdy", "outw": "outdz", "termu": "termdx", "termv": "termdy"}
"""Names in files for pbrt-v3, and in newer ones."""


def read(file: Path, wavelength: float | None, accuracy: float | None) -> RayTable:
    """Read the rays of a lens.

    Args:
        file: a table (.csv) or a ray transfer function (.json).
        wavelength: metres; needed if a ray transfer function has several.
        accuracy: see `vcc.RayTable`.

    Raises:
        InputError: an invalid header, line, polynomial or opening, or no such wavelength; as in `vcc.RayTable`.

    Warns:
        ResultWarning: a ray transfer function has rays at more than `STEEPEST` degrees, which are left out.
    """
    if file.suffix.lower() == ".csv":
        return _of_table(file, accuracy)
    if file.suffix.lower() != ".json":
        raise InputError(
            f"{file} is no table of rays: .csv, or .json of ISET's ray transfer functions, can be read"
        )
    tree = read_json(read_bytes(file, "ray transfer function"), str(file))
    return _of_polynomials(tree, file, wavelength, accuracy)


def _of_table(file: Path, accuracy: float | None) -> RayTable:
    thickness, header, rows = 0.0, None, []
    for number, line in enumerate(read_text(file, "table of rays").splitlines(), start=1):
        words, place = line.strip(), f"{file}, line {number}"
        if words.startswith("#"):
            stated = re.match(r"#\s*thickness\s*=\s*(.+)", words)
            thickness = units.parse(stated[1], "length", f"{place}: thickness") if stated else thickness
        elif header is None and words:
            header = _header(words, place)
        elif words:
            try:
                row = [float(word) for word in words.split(",")]
            except ValueError:
                row = []
            if len(row) != len(_COLUMNS):
                raise InputError(f"{place} should have {len(_COLUMNS)} numbers, with commas between them")
            rows.append(row)
    if header is None or not rows:
        raise InputError(f"{file} lists no rays: it needs a line {_example()}, and a line for each ray")
    rays = np.array(rows) * header
    return RayTable(rays[np.isfinite(rays).all(axis=1)], thickness, accuracy)


def _header(words: str, place: str) -> Array:
    """The factor to SI of each column."""
    factors = []
    for column, wanted in zip([*words.split(","), *[""] * 8], _COLUMNS, strict=False):
        name, factor = column.strip(), 1.0
        if wanted[0] in "xy":
            name, _, unit = name.rpartition("_")
            factor = _UNITS.get(unit, 0.0)
        if name != wanted or not factor:
            raise InputError(f"{place}: the columns of a table of rays are {_example()}, not {words[:80]!r}")
        factors.append(factor)
    return np.array(factors)


def _example() -> str:
    return ",".join(name + "_mm" if name[0] in "xy" else name for name in _COLUMNS) + " (_m, _mm or _um)"


def _of_polynomials(
    tree: Mapping[str, Any], file: Path, wavelength: float | None, accuracy: float | None
) -> RayTable:
    entry = _entry(tree, file, wavelength)
    before, behind = (_number(tree, f"planeoffset{end}", file, "planeoffset") for end in ("output", "input"))
    place, direction = _passing(entry, tree, file)
    known = {name: _polynomial(entry, name, file) for name in sorted(_OUTPUTS)}
    for name in ("outx", "outy", "outdx", "outdy"):
        if known[name] is None:
            raise InputError(f"{file} has no polynomial {name}")
    arguments = np.column_stack([place[:, 1], direction[:, :2]])
    value = {name: _evaluated(poly, arguments) for name, poly in known.items() if poly is not None}
    onward = np.stack([value["outdx"], value["outdy"]], axis=1)
    rest = np.maximum(1 - (onward**2).sum(axis=1), 0.0)
    cosine = value["outdz"] if tree.get("useDZpolynomial") is True and "outdz" in value else np.sqrt(rest)
    kept = cosine > np.cos(np.radians(STEEPEST))
    if not kept.any():
        raise InputError(f"{file}: all rays leave at more than {STEEPEST:g}° from the axis, where slopes end")
    if not kept.all():
        warn_of_result(
            f"{file}: {1 - kept.mean():.1%} of its rays are at more than {STEEPEST:g}° from the axis towards the "
            "scene: they are left out, and dark"
        )
    slope = -onward[kept] / cosine[kept, None]  # z along the light, which comes from the scene
    at = np.stack([value["outx"], value["outy"]], axis=1)[kept]
    if known["outz"] is not None and len(known["outz"][0]) > 1:  # rays end on a curved surface before the lens
        at = at + slope * (value["outz"][kept, None] - before)
    film = np.column_stack([place[kept], -direction[kept, :2] / direction[kept, 2:]])
    film[:, :2] *= mm
    thickness = (_number(tree, "thickness", file) + before + behind) * mm
    return RayTable(np.column_stack([at * mm, slope, film]), thickness, accuracy)


def _entry(tree: Mapping[str, Any], file: Path, wavelength: float | None) -> Mapping[str, Any]:
    """The polynomials of a wavelength."""
    listed = tree.get("polynomials", [tree])
    entries: Any = [listed] if isinstance(listed, Mapping) else listed
    if not isinstance(entries, list) or not entries or not all(isinstance(each, Mapping) for each in entries):
        raise InputError(f'{file}: its "polynomials" are not a list with an entry for each wavelength')
    lengths = [each.get("wavelength_nm") for each in entries]
    if wavelength is None and len(entries) == 1:
        return dict(entries[0])
    for each, length in zip(entries, lengths, strict=True):
        if wavelength is not None and isinstance(length, int | float) and abs(length - wavelength / nm) < 0.5:
            return dict(each)
    raise InputError(
        f"{file} has polynomials for {', '.join(f'{length} nm' for length in lengths)}: name one of them, "
        f"wavelength={lengths[0]} * nm"
    )


def _number(tree: Mapping[str, Any], name: str, file: Path, older: str = "") -> float:
    value = tree.get(name, tree.get(older))
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise InputError(f'{file} has no number "{name}" (mm)')
    return float(value)


def _numbers(tree: Mapping[str, Any], name: str, place: str) -> Array:
    try:
        found = np.atleast_1d(np.array(tree.get(name), dtype=np.float64))
    except (TypeError, ValueError):
        found = np.array([np.nan])
    if found.ndim != 1 or not np.isfinite(found).all():
        raise InputError(f'{place}: "{name}" is not a list of numbers')
    return found


def _polynomial(entry: Mapping[str, Any], name: str, file: Path) -> tuple[Array, Array] | None:
    """Coefficients, and powers of r, dx and dy, (terms, 3); None if there is no such polynomial."""
    for poly in entry.get("poly") or []:
        if isinstance(poly, Mapping) and _OLDER.get(str(poly.get("outputname")), poly.get("outputname")) == name:
            newer = {_OLDER.get(str(key), str(key)): value for key, value in poly.items()}
            place = f"{file}: polynomial {name}"
            lists = [_numbers(newer, each, place) for each in ("coeff", "termr", "termdx", "termdy")]
            if len({len(each) for each in lists}) != 1:
                raise InputError(
                    f"{place} has {'/'.join(str(len(each)) for each in lists)} coefficients and powers"
                )
            powers = np.stack(lists[1:], axis=1)
            if not ((powers >= 0) & (powers <= 50) & (powers % 1 == 0)).all():
                raise InputError(f"{place} has powers that are not whole numbers from 0 to 50")
            return lists[0], powers
    return None


def _evaluated(poly: tuple[Array, Array], arguments: Array) -> Array:
    coefficients, powers = poly
    found = np.zeros(len(arguments))
    for coefficient, power in zip(coefficients, powers, strict=True):
        found += coefficient * np.prod(arguments**power, axis=1)
    return found


def _passing(entry: Mapping[str, Any], tree: Mapping[str, Any], file: Path) -> tuple[Array, Array]:
    """Rays that pass, in the plane on the side of the film: places (n, 2), mm, and unit vectors (n, 3)."""
    given = entry.get("passnopass", entry.get("raypass", {}))
    passes: dict[str, Any] = {**tree, **entry, **(given if isinstance(given, Mapping) else {})}
    rng = np.random.default_rng(0)
    share, angle, border = rng.uniform(0, 1, (3, RAYS))
    on_disc = np.sqrt(np.where(border < BORDER, 1.0, share))
    disc = on_disc[:, None] * np.stack([np.cos(2 * np.pi * angle), np.sin(2 * np.pi * angle)], axis=1)
    place = f"{file}: the rays that pass"
    if passes.get("method") == "minimalellipse":
        at = _numbers(passes, "positions", place)
        columns = [_numbers(passes, name, place) for name in ("centersX", "centersY", "radiiX", "radiiY")]
        if {len(each) for each in columns} != {len(at)} or not (np.diff(at) > 0).all():
            raise InputError(f"{place}: positions must rise, with as many centres and radii")
        away = at[-1] * np.sqrt(rng.uniform(0, 1, RAYS))
        centres, radii = (
            np.stack([np.interp(away, at, each) for each in pair], axis=1) for pair in (columns[:2], columns[2:])
        )
        met, plane = centres + radii * disc, _number(passes, "intersectPlaneDistance", file)
    elif "circleRadii" in passes:
        circles, shifts = (_numbers(passes, name, place) for name in ("circleRadii", "circleSensitivities"))
        if len(circles) != len(shifts) or not (circles > 0).all():
            raise InputError(f"{place}: circleRadii are above 0, with as many circleSensitivities")
        apart = np.abs(shifts[:, None] - shifts)
        ends = (circles[:, None] + circles)[apart > 0] / apart[apart > 0]
        if not len(ends):
            raise InputError(f"{place}: circles that do not part bound no field; ellipses do")
        first = int(np.argmin(circles))
        away = ends.min() * np.sqrt(rng.uniform(0, 1, RAYS))
        met = circles[first] * disc + np.outer(away * shifts[first], [0, 1])
        off = met[:, None] - np.stack([0 * np.outer(away, shifts), np.outer(away, shifts)], axis=-1)
        within = (np.hypot(off[..., 0], off[..., 1]) <= circles * (1 + 1e-9)).all(axis=1)
        met, away, plane = met[within], away[within], _number(passes, "circlePlaneZ", file)
    else:
        raise InputError(
            f'{place} are described by {passes.get("method")!r}: "minimalellipse" and circles are read'
        )
    if plane == 0:
        raise InputError(f"{place}: the plane of their ellipses or circles is that of the polynomials")
    start = np.stack([0 * away, away], axis=1)
    ahead = np.column_stack([(met - start) / plane, np.ones(len(away))])
    return start, ahead / np.linalg.norm(ahead, axis=1, keepdims=True)
