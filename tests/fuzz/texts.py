"""Texts of seeds: camera files, lenses, scenes."""

from __future__ import annotations

import json
from typing import Any

HCI_CAMERA = """[intrinsics]
focal_length_mm = 100
image_resolution_x_px = 32
image_resolution_y_px = 24
sensor_size_mm = 35
fstop = 100
[extrinsics]
num_cams_x = 3
num_cams_y = 3
baseline_mm = 90.0
focus_distance_m = 6.0
center_cam_x_m = 0.0
[meta]
scene = t
disp_min = -2.0
disp_max = 2.0
"""
CAMERA = """[[elements]]
kind = "lens"
z = "0 mm"
focal_length = "50 mm"
diameter = "20 mm"

[[elements]]
kind = "phase_plate"
z = "1 mm"
surface = { name = "zernike", coefficients = ["0 nm", "0 nm", "0 nm", "300 nm"], diameter = "20 mm" }

[[elements]]
kind = "mask"
name = "code"
z = "40 mm"
decentre = ["1 mm", "0 mm"]
pattern = { name = "cosine_sum", period = "1.5 mm", harmonics = 2 }
width = "30 mm"

[[elements]]
kind = "mask"
z = "40.5 mm"
pattern = "cells.PATTERN"
width = "20 mm"

[[elements]]
kind = "mask"
z = "40.6 mm"
pattern = [[0, 1], [1, 0.5]]
width = "20 mm"

[[elements]]
kind = "diffuser"
z = "41 mm"
kernel = { name = "gaussian", sigma = 0.01 }

[[elements]]
kind = "first_order"
z = "60 mm"
lens_file = "lens.dat"
f_number = 4

[sensor]
z = "152 mm"
shape = [50, 50]
pitch = "48 um"

[sensor.electronics]
color_filter = "RGGB"
full_well = 10000
"""
MOVING = """
[moving]
sensor.z = { name = "lines", times = ["0 ms", "90 ms"], values = ["151 mm", "153 mm"] }
"code.pattern" = { name = "steps", times = ["0 ms", "5 ms"], values = [[[0, 1], [1, 0.5]], "cells.npy"] }
code.decentre = { name = "lines", times = ["0 ms", "5 ms"], values = [["0 mm", "0 mm"], ["1 mm", "0.5 mm"]] }
shutter = { name = "coded", code = "1101001", exposure = "90 ms" }
"""
LENS = """# D-GAUSS
29.475 3.76 1.67 25.2
84.83 0.12 1 25.2
19.275 4.025 1.67 23
40.77 3.275 1.699 23
12.75 5.705 1 18
0 4.5 0 17.1
-14.495 1.18 1.603 17
40.77 6.065 1.658 20
-20.385 0.19 1 20
437.065 3.22 1.717 20
-39.73 5 1 20
"""
ZEMAX = """VERS 1 2
MODE SEQ
NAME test
UNIT MM X W X CM MR CPMM
ENPD 10
GCAT SCHOTT
SURF 0
  CURV 0.0
  DISZ INFINITY
SURF 1
  STOP
  CURV 0.02
  DISZ 4
  GLAS ___BLANK 1 0 1.5168 64.17 0 0 0 0 0 0
  DIAM 6
SURF 2
  CURV -0.02
  DISZ 48
  DIAM 6
SURF 3
  CURV 0
  DISZ 0
"""
CODEV = """RDM;LEN
TITLE 'test'
FNO 4
DIM M
WL 656.3 587.6 486.1
REF 2
YAN 0.0 10.0
SO 0.0 1e10
S 50.0 4 1.5168:64.17
  STO
  CIR 6.0
  ASP; K -0.5; A 1e-6 ; B &
  2e-9
S -50.0 48 517642
S -60.0 2
SI 0.0 -0.1
ZOO 2
ZOO THI S2 48 49
GO
"""


def _surface(shape: str, radius: float, z: float, medium: str, index: float) -> dict[str, Any]:
    place = {"x": 0.0, "y": 0.0, "z": z, "rx": 0.0, "ry": 0.0, "rz": 0.0, "reference_cs": None}
    return {
        "geometry": {"type": shape, "cs": place, "radius": radius, "conic": -0.5, "coefficients": [0, 1e-6]},
        "material_post": {"type": medium, "index": index, "abbe": 60},
        "is_stop": z == 4.0,
        "aperture": {"type": "RadialAperture", "r_max": 6, "r_min": 0},
    }


OPTILAND = json.dumps(
    {
        "version": 1.0,
        "name": "test",
        "aperture": {"type": "EPD", "value": 10},
        "fields": {"fields": [{"x": 0.0, "y": 14}], "field_definition": {"field_type": "AngleField"}},
        "wavelengths": {"wavelengths": [{"value": 0.55, "is_primary": True, "unit": "um"}]},
        "surface_group": {
            "surfaces": [
                _surface("Plane", float("inf"), float("-inf"), "IdealMaterial", 1.0),
                _surface("EvenAsphere", 50.0, 0.0, "AbbeMaterial", 1.5),
                _surface("StandardGeometry", -50.0, 4.0, "IdealMaterial", 1.0),
                _surface("Plane", float("inf"), 52.0, "IdealMaterial", 1.0),
            ]
        },
    }
)


def _stored(kind: str, **attributes: Any) -> dict[str, Any]:
    return {"__instance_type__": ["module", kind], "attributes": attributes}


def _face(curvature: float) -> dict[str, Any]:
    profile = _stored("EvenPolynomial", cv=curvature, cc=0.0, coefs=[0.0, 1e-6])
    plain: dict[str, Any] = {"interact_mode": "transmit", "decenter": None, "clear_apertures": []}
    return _stored("Surface", max_aperture=6.0, profile=profile, **plain)


RAYOPTICS = json.dumps(
    {
        "optical_model": _stored(
            "OpticalModel",
            system_spec=_stored("SystemSpec", title="test", _dimensions="mm"),
            optical_spec=_stored(
                "OpticalSpecs",
                pupil=_stored("PupilSpec", _key=["aperture", "image", "f/#"], value=4.0),
                spectral_region=_stored("WvlSpec", wavelengths=[486.1, 587.6], reference_wvl=1),
            ),
            seq_model=_stored(
                "SequentialModel",
                stop_surface=1,
                ifcs=[_face(curvature) for curvature in (0.0, 0.02, -0.02, 0.0)],
                gaps=[
                    _stored("Gap", thi=1e10, medium=_stored("Air")),
                    _stored("Gap", thi=4.0, medium=_stored("ModelGlass", n=1.5, v=60.0, label="")),
                    _stored("Gap", thi=48.0, medium=_stored("Air")),
                ],
            ),
        )
    }
)


PBRT_SCENE = """LookAt 0 0 5  0 0 0  0 1 0
Camera "perspective" "float fov" [40]
Film "rgb" "integer xresolution" [32] "integer yresolution" [24] "string filename" "a.exr"
Sampler "halton" "integer pixelsamples" [4]
Include "more.pbrt"
WorldBegin
LightSource "infinite" "rgb L" [1 1 1]
Shape "sphere" "float radius" [1]
"""


MITSUBA_SCENE = """<scene version="3.0.0">
<default name="spp" value="16"/>
<include filename="more.xml"/>
<shape type="obj"><string name="filename" value="a.obj"/></shape>
</scene>
"""
