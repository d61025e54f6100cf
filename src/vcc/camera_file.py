"""Camera files: lossless TOML files of cameras, with units for all lengths.

::

    [[elements]]
    kind = "lens"
    z = "0 mm"
    focal_length = "50 mm"
    diameter = "20 mm"

    [[elements]]
    kind = "mask"
    z = "40 mm"
    pattern = "mask.png"       # .png, .tif, .npy, .csv …, found beside the camera file
    width = "30 mm"

    [[elements]]
    kind = "diffuser"
    z = "41 mm"
    kernel = { name = "gaussian", sigma = 0.01 }

    [sensor]
    z = "52 mm"
    shape = [500, 500]
    pitch = "48 um"

Patterns, kernels and surfaces are written by name: the classes of `vcc.patterns` (``open``, ``circle``,
``polygon``, ``cells``, ``cosine_sum``, ``bounded`` …, and ``mura``), of `vcc.kernels` (``gaussian``, ``top_hat``,
``radial``, ``samples``) and of `vcc.surfaces` (``cubic``, ``zernike``, ``height_map`` …). A glass is text,
``glass = "N-BK7"``, or one of `vcc.glasses`, ``{ name = "abbe", nd = 1.5168, V = 64.17 }``. Arrays are file names
or rows of numbers (``[[0, 1], [1, 0]]``). A field that is a dataclass, such as a sensor's electronics, is a table:
``[sensor.electronics]``. A real lens is a ``first_order`` with ``lens_file = "dgauss.50mm.dat"`` instead of a
matrix. A sensor has a z, or ``focus = "1.2 m"``: the distance in focus (`vcc.Camera.focused`).
"""

from __future__ import annotations

from os import PathLike

from vcc.camera import Camera
from vcc.files.camera_families import ELEMENT_KINDS as ELEMENT_KINDS
from vcc.files.camera_families import GLASS_NAMES as GLASS_NAMES
from vcc.files.camera_families import KERNEL_NAMES as KERNEL_NAMES
from vcc.files.camera_families import PATTERN_NAMES as PATTERN_NAMES
from vcc.files.camera_families import SURFACE_NAMES as SURFACE_NAMES
from vcc.files.camera_reading import read_train
from vcc.files.camera_writing import write_train


def load_camera(path: str | PathLike[str]) -> Camera:
    """Read a camera from a TOML file; see this module for the format.

    Args:
        path: the file. Paths of arrays, pictures of masks and lens files are relative to its folder.

    Raises:
        InputError: no such file, not TOML, or an entry that is unknown, missing, of a wrong type, without a
            unit or invalid for its element. The message names the file, the element (counted from 1) and the
            field.
    """
    train = read_train(path)
    return Camera(train.elements, train.sensor, name=train.name)


def save_camera(camera: Camera, path: str | PathLike[str]) -> None:
    """Write a camera to a TOML file, from which `load_camera` reads an equal camera.

    Arrays are written next to the file, as .npy files named after it and the element, in SI units. The array
    of a mask is not written if the file that it came from is in this folder already. A real lens keeps its
    lens file if that is next to the camera file and still gives the same lens; otherwise its matrix is
    written. Files are written completely or not at all.

    Args:
        camera: what to write.
        path: of the file; an existing file is replaced.

    Raises:
        InputError: an element, pattern, kernel or surface that cannot be stored in a file (any Python
            function), or a folder that is not writable.
    """
    write_train(camera, path)
