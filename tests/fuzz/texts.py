"""Texts of seeds: camera files, lenses, scenes."""

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
