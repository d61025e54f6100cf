"""Lenses that other programs trace too, and what these say of them. Prescriptions are facts, in millimetres.

`figures_of_optiland` and `figures_of_rayoptics` compute the figures, where these packages are installed. As a
program, this file prints lenses_compared.json. All indices are plain numbers, so that only the optics is compared.
"""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np

INF = math.inf
Row = tuple[float, ...]

LENSES: dict[str, dict[str, Any]] = {
    # (radius, thickness, index behind, conic, r⁴, r⁶), the stop's number, the entrance pupil's diameter, a field
    "singlet": {  # stop on its second surface; figures of OpticStudio: Optiland, validation report 710
        "rows": [(63.73364157, 10.0, 1.69099596), (653.2939232, 92.7383463, 1.0)],
        "stop": 1, "pupil": 25.0, "angle": 5.0,
    },
    "Cooke triplet": {
        "rows": [
            (22.01359, 3.25896, 1.62041), (-435.76044, 6.00755, 1.0), (-22.21328, 0.99997, 1.62004),
            (20.29192, 4.75041, 1.0), (79.6836, 2.95208, 1.62041), (-18.39533, 42.20778, 1.0),
        ],
        "stop": 3, "pupil": 10.0, "angle": 20.0,
    },
    "double Gauss": {
        "rows": [
            (56.20238, 8.75, 1.62229), (152.2858, 0.5, 1.0), (37.68262, 12.5, 1.60738), (INF, 3.8, 1.60342),
            (24.2313, 16.369445, 1.0), (INF, 13.747957, 1.0), (-28.37731, 3.8, 1.60342), (INF, 11.0, 1.62041),
            (-37.92546, 0.5, 1.0), (177.41176, 7.0, 1.62041), (-79.41143, 61.487536, 1.0),
        ],
        "stop": 5, "pupil": 33.0, "angle": 14.0,
    },
    "Tessar": {  # Laikin, Lens Design, 4th ed., p. 63, inches times 25.4
        "rows": [
            (33.85566, 7.08914, 1.62296), (-253.37516, 5.21716, 1.0), (-53.12918, 2.286, 1.62004),
            (30.79242, 1.80086, 1.0), (INF, 3.89636, 1.0), (-191.0207, 2.286, 1.50137),
            (33.0454, 8.60806, 1.62296), (-38.65372, 86.4235, 1.0),
        ],
        "stop": 4, "pupil": 22.0, "angle": 20.5,
    },
    "telephoto": {  # Laikin, p. 91, inches times 25.4
        "rows": [
            (21.81606, 6.07314, 1.5168), (-68.33108, 2.286, 1.66446), (77.00772, 1.22174, 1.0),
            (INF, 26.28138, 1.0), (-14.5161, 2.286, 1.50847), (-18.85442, 2.5527, 1.78582),
            (-29.03982, 0.39624, 1.0),
            (-432.78552, 2.01422, 1.71736), (-70.3453, 62.98184, 1.0),
        ],
        "stop": 3, "pupil": 13.0, "angle": 10.0,
    },
    "wide angle": {  # 100° across; Laikin, p. 108, inches times 25.4
        "rows": [
            (203.47178, 6.35, 1.61272), (30.11424, 24.41702, 1.0), (42.53738, 9.08812, 1.71736),
            (-190.89878, 5.42544, 1.61272), (23.90394, 10.53084, 1.0), (-44.92752, 8.46582, 1.71736),
            (-39.44874, 9.81202, 1.61272), (-56.59374, 24.99868, 1.0), (INF, 2.54, 1.0),
            (347.47962, 3.556, 1.61272), (-87.06866, 1.5367, 1.0), (508.65278, 8.46328, 1.61272),
            (-23.51532, 11.10996, 1.71736),
            (-81.87182, 6.80466, 1.0), (263.77138, 3.556, 1.71736), (61.65088, 6.62686, 1.61272),
            (-98.62312, 0.381, 1.0), (85.471, 8.04418, 1.61272), (-374.76938, 39.63416, 1.0),
        ],
        "stop": 8, "pupil": 6.0, "angle": 40.0,
    },
    "asphere": {
        "rows": [(28.0, 9.0, 1.5168, -0.7, 2e-6, -3e-9), (-400.0, 46.0, 1.0, 5.0, 1e-6, 0.0)],
        "stop": 0, "pupil": 24.0, "angle": 3.0,
    },
}  # fmt: skip

PLACES = [(0.0, 0.0), (0.0, 0.9), (0.0, -0.9), (0.7, 0.0), (0.5, -0.6), (0.0, 0.4)]
"""Rays: (x, y) in the first-order entrance pupil, in units of its radius; the field lies along y."""


SHARES = (0.0, 0.8)
"""Places on the image for which illumination is compared, in units of the chief ray's height."""


def rms(points: Any) -> float:
    """Root mean square distance from the mean."""
    points = np.asarray(points)
    return float(np.sqrt(((points - points.mean(axis=0)) ** 2).sum(axis=1).mean()))


def figures_of_optiland(lens: dict[str, Any]) -> dict[str, Any]:
    """First order, rays of a field, the height of the chief ray aimed at the stop, and the spot on the axis."""
    from optiland import materials, optic

    one = optic.Optic()
    one.surfaces.add(index=0, radius=INF, thickness=INF)
    for number, (radius, thickness, index, *rest) in enumerate(lens["rows"], start=1):
        more: dict[str, Any] = {}
        if rest:
            more = {"surface_type": "even_asphere", "conic": rest[0], "coefficients": [0.0, *rest[1:]]}
        one.surfaces.add(
            index=number, radius=radius, thickness=thickness, material=materials.IdealMaterial(index),
            is_stop=number - 1 == lens["stop"], **more,
        )  # fmt: skip
    one.surfaces.add(index=len(lens["rows"]) + 1)
    one.set_aperture("EPD", lens["pupil"])
    one.fields.set_type("angle")
    one.fields.add(y=0)
    one.fields.add(y=lens["angle"])
    one.wavelengths.add(value=0.5876, is_primary=True)
    first = one.paraxial
    image = sum(row[1] for row in lens["rows"])
    found = {
        "focal length": float(first.f2()),
        "back focus": float(first.F2()) + lens["rows"][-1][1],
        "entrance pupil": float(first.EPL()),
        "exit pupil": float(first.XPL()) + image,
        "exit pupil diameter": float(first.XPD()),
    }
    rays = [one.trace_generic(0.0, 1.0, np.array([x]), np.array([y]), 0.5876) for x, y in PLACES]
    found["rays"] = [[float(ray.x[0]), float(ray.y[0])] for ray in rays]
    on_axis = one.trace(0.0, 0.0, 0.5876, 64, "uniform")
    found["spot on the axis"] = rms(np.column_stack([on_axis.x, on_axis.y]))
    one.ray_tracer.set_aiming("iterative", max_iter=50, tol=1e-12)
    chief = one.trace_generic(0.0, 1.0, np.array([0.0]), np.array([0.0]), 0.5876)
    found["chief"] = float(chief.y[0])
    return found


def figures_of_rayoptics(lens: dict[str, Any]) -> dict[str, Any]:
    """The same, without the exit pupil's place."""
    from rayoptics.raytr import trace

    model, _ = _model_of_rayoptics(lens)
    sequence = model.seq_model
    first = model["analysis_results"]["parax_data"].fod
    found = {
        "focal length": float(first.efl),
        "back focus": float(first.bfl),
        "entrance pupil": float(first.enp_dist),
        "exit pupil diameter": 2 * abs(float(first.exp_radius)),
    }
    before, slope = 10.0, math.tan(math.radians(lens["angle"]))
    sequence.gaps[0].thi = before  # rays start here, before the first surface
    sequence.update_model()

    def traced(x: float, y: float) -> Any:
        start = np.array([x, y - (found["entrance pupil"] + before) * slope, 0.0])
        return trace.trace(sequence, start, np.array([0.0, slope, 1.0]) / math.hypot(1, slope), 587.5618)[0]

    half = lens["pupil"] / 2
    found["rays"] = [[float(place) for place in traced(x * half, y * half)[-1][0][:2]] for x, y in PLACES]
    one, other = 0.0, 0.01 * half
    for _ in range(20):  # the chief ray by secants
        heights = [float(traced(0.0, y)[lens["stop"] + 1][0][1]) for y in (one, other)]
        if heights[0] == heights[1]:
            break
        one, other = other, other - heights[1] * (other - one) / (heights[1] - heights[0])
    found["chief"] = float(traced(0.0, other)[-1][0][1])
    return found


def slopes_at(height: float, exit_pupil: float, diameter: float, image: float, count: int = 41) -> np.ndarray:
    """Slopes (n, 2) at a place (0, height) of the image of rays through a grid twice as wide as the exit pupil."""
    pupil = (np.arange(count) + 0.5) / count * 2 * diameter - diameter
    x, y = np.meshgrid(pupil, pupil)
    return np.column_stack([x.ravel(), y.ravel() - height]) / (exit_pupil - image)


def illumination_of_rayoptics(lens: dict[str, Any], height: float, exit_pupil: float, diameter: float) -> float:
    """The sum of cos⁴θ over rays of `slopes_at` that pass the stop, traced through the reversed lens."""
    rows = lens["rows"]
    _, radius = _model_of_rayoptics(lens)
    image = sum(row[1] for row in rows)
    sequence = _empty_model_of_rayoptics(1.0)[0].seq_model
    gaps = [row[1:3] for row in rows[:-1]]
    for number, (curve, _, _, *rest) in enumerate(reversed(rows)):
        thickness, index = gaps[-1 - number] if number < len(gaps) else (1.0, 1.0)
        _add_to_rayoptics(sequence, -curve, thickness, index, rest and [rest[0], *(-a for a in rest[1:])])
    sequence.gaps[0].thi = rows[-1][1]
    sequence.opt_model.update_model()
    from rayoptics.raytr import trace, traceerror

    total = 0.0
    for s, t in slopes_at(height, exit_pupil, diameter, image):
        direction = np.array([-s, -t, 1.0]) / math.sqrt(1 + s * s + t * t)
        try:
            ray = trace.trace(sequence, np.array([0.0, height, 0.0]), direction, 587.5618)[0]
        except traceerror.TraceError:
            continue
        if np.hypot(*ray[len(rows) - lens["stop"]][0][:2]) <= radius:
            total += direction[2] ** 4
    return total


def _empty_model_of_rayoptics(pupil: float, angle: float = 1.0) -> tuple[Any, Any]:
    from rayoptics.environment import FieldSpec, OpticalModel, PupilSpec, WvlSpec

    model = OpticalModel()
    spec = model.optical_spec
    spec["pupil"] = PupilSpec(spec, key=["object", "epd"], value=pupil)
    spec["fov"] = FieldSpec(spec, key=["object", "angle"], value=angle, flds=[0.0, 1.0], is_relative=True)
    spec["wvls"] = WvlSpec([(587.5618, 1.0)], ref_wl=0)
    model.radius_mode = True
    return model, spec


def _add_to_rayoptics(sequence: Any, radius: float, thickness: float, index: float, rest: Any) -> None:
    from rayoptics.elem.profiles import EvenPolynomial

    given = [0.0 if math.isinf(radius) else radius, thickness]
    sequence.add_surface([*given, index, 1e12] if index != 1 else given)
    if rest:
        sequence.ifcs[sequence.cur_surface].profile = EvenPolynomial(r=radius, cc=rest[0], coefs=[0.0, *rest[1:]])


def _model_of_rayoptics(lens: dict[str, Any]) -> tuple[Any, float]:
    """The model, and the radius of the stop."""
    model, _ = _empty_model_of_rayoptics(lens["pupil"], lens["angle"])
    model.seq_model.gaps[0].thi = 1e8
    for number, (radius, thickness, index, *rest) in enumerate(lens["rows"]):
        _add_to_rayoptics(model.seq_model, radius, thickness, index, rest)
        if number == lens["stop"]:
            model.seq_model.set_stop()
    model.update_model()
    axial = model["analysis_results"]["parax_data"].ax_ray
    return model, abs(float(axial[lens["stop"] + 1][0]))


if __name__ == "__main__":
    import importlib.metadata
    import json

    warnings.simplefilter("ignore")
    versions = {program: importlib.metadata.version(program) for program in ("optiland", "rayoptics")}
    known: dict[str, Any] = {"versions": versions}
    for name, lens in LENSES.items():
        known[name] = figures_of_optiland(lens)
        pupil = known[name]["exit pupil"], abs(known[name]["exit pupil diameter"])
        sums = [illumination_of_rayoptics(lens, share * known[name]["chief"], *pupil) for share in SHARES]
        known[name]["illumination"] = sums
    print(json.dumps(known, indent=1))
