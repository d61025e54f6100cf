"""Camera files: a camera as TOML, with units in every length, written and read without loss.

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
``polygon``, ``cells``, ``cosine_sum``, ``bounded`` …, and ``mura``), of `vcc.kernels` (``gaussian``,
``top_hat``, ``radial``, ``samples``) and of `vcc.surfaces` (``cubic``, ``zernike``, ``height_map`` …). Arrays
are the name of a file or rows of numbers (``[[0, 1], [1, 0]]``). A field that is a dataclass of its own, such
as a sensor's electronics, is a table: ``[sensor.electronics]``. A real lens is a ``first_order`` with
``lens_file = "dgauss.50mm.dat"`` instead of a matrix. A sensor has a z, or ``focus = "1.2 m"``: the distance
that is to be sharp (`vcc.Camera.focused`).
"""

from __future__ import annotations

from os import PathLike

from vcc.camera import Camera
from vcc.files.camera_families import ELEMENT_KINDS as ELEMENT_KINDS
from vcc.files.camera_families import KERNEL_NAMES as KERNEL_NAMES
from vcc.files.camera_families import PATTERN_NAMES as PATTERN_NAMES
from vcc.files.camera_families import SURFACE_NAMES as SURFACE_NAMES
from vcc.files.camera_reading import read_train
from vcc.files.camera_writing import write_train


def load_camera(path: str | PathLike[str]) -> Camera:
    """The camera that a TOML file describes; see this module for its form.

    Args:
        path: the file. Arrays, pictures of masks and lens files are found relative to its folder.

    Raises:
        InputError: no such file, not TOML, or anything in it that is unknown, missing, of a wrong
            type, without a unit or refused by the element itself. The message names the file, the
            element (counted from 1) and the field.
    """
    train = read_train(path)
    return Camera(train.elements, train.sensor, name=train.name)


def save_camera(camera: Camera, path: str | PathLike[str]) -> None:
    """Write a camera as TOML, so that `load_camera` returns an equal one.

    Arrays are written beside the file, as .npy named after it and the element, in SI; a mask's not if the
    file that it came from is there already. A real lens keeps its lens file if that is beside the camera
    file and still gives the same lens; otherwise its matrix is written. Files appear whole or not at all.

    Args:
        camera: what to write.
        path: where to; an older file of that name is replaced.

    Raises:
        InputError: an element, pattern, kernel or surface that a file cannot hold (any Python function), or a
            folder that cannot be written to.
    """
    write_train(camera, path)
