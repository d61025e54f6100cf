"""Rendering of views by Mitsuba 3: any Mitsuba scene, seen by shifted perspective cameras."""

from __future__ import annotations

import functools
import hashlib
import json
import math
import subprocess
import sys
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vcc.base import checks
from vcc.base.errors import InputError, ResultWarning
from vcc.base.reading import expanded, is_file, read_bytes, reading
from vcc.sources.views import ViewCamera

FAST, PLAIN = "llvm_ad_rgb", "scalar_rgb"
"""The variant that is several times faster and needs LLVM 16 or newer, and the variant that runs everywhere."""

_PROBE_SECONDS = 180
_PROBE = """
import sys
import mitsuba as mi
mi.set_variant(sys.argv[1])
to_world = mi.ScalarTransform4f().translate([0, 0, 4])
picture = mi.render(mi.load_dict({
    "type": "scene", "integrator": {"type": "path"}, "light": {"type": "constant"},
    "sensor": {"type": "perspective", "film": {"type": "hdrfilm", "width": 8, "height": 8}},
    "glass": {"type": "sphere", "to_world": to_world, "bsdf": {"type": "roughdielectric"}},
    "metal": {"type": "cube", "to_world": to_world, "bsdf": {"type": "roughconductor"}},
    "paint": {"type": "disk", "to_world": to_world, "bsdf": {"type": "plastic", "diffuse_reflectance": {
        "type": "checkerboard"}}},
}), spp=4)
sum(float(value) for value in picture.array)
"""


def mitsuba_library() -> Any:
    """Import the package mitsuba.

    Raises:
        InputError: the package is not installed or does not load.
    """
    with checks.package("rendering by Mitsuba", "mitsuba", "mitsuba"):
        import mitsuba
    return mitsuba


@functools.cache
def variant_fault(variant: str) -> str | None:
    """The reason why a variant of Mitsuba does not work on this machine; None if it works.

    Variants with a just-in-time compiler (LLVM, CUDA) terminate the process if a library is too old, so a child
    process tries the variant with an image of a few pixels. The result is cached per process.

    Args:
        variant: name of the variant, like ``"llvm_ad_rgb"``.

    Raises:
        InputError: Mitsuba is not installed, or has no such variant.
    """
    known = mitsuba_library().variants()
    if variant not in known:
        raise InputError(f'Mitsuba has no variant "{variant}"; it has {", ".join(known)}')
    if variant.startswith("scalar"):
        return None
    try:
        tried = subprocess.run(
            [sys.executable, "-c", _PROBE, variant], capture_output=True, text=True, timeout=_PROBE_SECONDS
        )
    except subprocess.TimeoutExpired:
        return f"a picture of 8×8 pixels was not done in {_PROBE_SECONDS} s"
    if tried.returncode == 0:
        return None
    said = [line for line in tried.stderr.splitlines() if line.strip()]
    telling = [line.strip() for line in said if "error" in line.lower() or "could not" in line.lower()]
    words = (telling or [line.strip() for line in said[-1:]] or ["it said nothing"])[0]
    words = words.split(": 0x")[0][:160]  # LLVM appends addresses
    return f"a trial of it ended with code {tried.returncode}: {words}"


def _chosen(wanted: str) -> str:
    """Select a variant that works.

    Raises:
        InputError: the requested variant does not work.
    """
    mitsuba = mitsuba_library()
    if wanted == "auto":
        current: str | None = mitsuba.variant()
        if current is not None:
            return current
        fault = variant_fault(FAST)
        if fault is None:
            return FAST
        warnings.warn(
            ResultWarning(
                f"Mitsuba renders with {PLAIN}, several times slower than {FAST}, which does not work here: "
                f"{fault}. It needs LLVM 16 or newer; DRJIT_LIBLLVM_PATH names the library to take"
            ),
            stacklevel=3,
        )
        return PLAIN
    fault = variant_fault(wanted)
    if fault is not None:
        raise InputError(f'Mitsuba\'s variant "{wanted}" does not work here: {fault}. variant="{PLAIN}" does')
    return wanted


@contextmanager
def _variant(name: str) -> Iterator[Any]:
    """Context with a Mitsuba variant set; restores the previous variant, if there was one."""
    mitsuba = mitsuba_library()
    before = mitsuba.variant()
    if before == name:
        yield mitsuba
        return
    mitsuba.set_variant(name)
    try:
        yield mitsuba
    finally:
        if before is not None:
            mitsuba.set_variant(before)


class MitsubaRenderer:
    """Renders a scene of Mitsuba 3 with shifted perspective cameras in place of its own.

    The scene is loaded once. Its own sensor defines the centre and direction of the array, the sampler, the
    clipping distances and the medium; field of view and film are those of the views. The pixel filter is a box,
    so a sample is the mean over its pixel; each view has its own seed. A scene without an integrator is
    rendered by path tracing.

    Args:
        scene: an XML file, or a dict for `mitsuba.load_dict`, in which NumPy arrays may be used for transforms
            (``"to_world"``, ``"to_uv"``: 4×4) and for pictures (``"bitmap"``).
        samples: paths per pixel; some samplers round the number up (see the attribute `samples`).
        variant: variant of Mitsuba. ``"auto"`` uses the one set in this process, else ``"llvm_ad_rgb"`` if it
            works, else ``"scalar_rgb"`` with a warning.
        seed: seed of the random numbers: equal seeds give equal images.
        metres_per_unit: length of the scene's unit, metres.
        to_world: 4×4 pose of the array's centre in the scene, in Mitsuba's convention (the camera looks along
            its +z, y points up and x to the left). None uses the pose of the scene's sensor.
        sensor: index of the scene's sensor to use.
        parameters: values for the ``$names`` of an XML file.

    Raises:
        InputError: Mitsuba is not installed, the variant does not work, the scene does not load or has no such
            sensor, or a number that is not above 0.
    """

    def __init__(
        self,
        scene: str | PathLike[str] | Mapping[str, Any],
        *,
        samples: int = 64,
        variant: str = "auto",
        seed: int = 0,
        metres_per_unit: float = 1.0,
        to_world: ArrayLike | None = None,
        sensor: int = 0,
        parameters: Mapping[str, str] | None = None,
    ) -> None:
        checks.whole_number_between("samples", samples, 1, of="paths a pixel")
        self._metres_per_unit = checks.above_zero("metres_per_unit", metres_per_unit)
        self.variant = _chosen(variant)
        self._seed = int(seed)
        self._contents = _contents(scene, dict(parameters or {}))
        with _variant(self.variant) as mitsuba:
            self._scene = _loaded(mitsuba, scene, dict(parameters or {}))
            self._own = self._sensor(sensor, to_world is not None)
            self._sampler = (
                self._own.sampler() if self._own is not None else mitsuba.load_dict({"type": "independent"})
            )
            self._integrator = self._scene.integrator() or mitsuba.load_dict({"type": "path"})
            self.samples = _settled(mitsuba, self._sampler, samples)
            if to_world is None:
                self._to_world = np.array(self._own.world_transform().matrix, dtype=np.float64).reshape(-1, 4)[:4]
            else:
                self._to_world = _pose(to_world)

    def _sensor(self, number: int, optional: bool) -> Any:
        """The scene's own sensor; None if it has none and none is needed."""
        sensors = self._scene.sensors()
        if number < len(sensors):
            return sensors[number]
        if not sensors and optional:
            return None
        raise InputError(
            f"the scene has {len(sensors) or 'no'} sensor{'s' * (len(sensors) != 1)}, and number {number} "
            "(counted from 0) should define the position of the views: give to_world=… or an existing sensor"
        )

    def description(self) -> dict[str, Any]:
        """Everything that an image depends on except the camera; the scene's files by their SHA-256."""
        return {
            "name": "mitsuba",
            "version": mitsuba_library().__version__,
            "variant": self.variant,
            "scene": self._contents,
            "samples": self.samples,
            "seed": self._seed,
            "metres_per_unit": self._metres_per_unit,
            "to_world": self._to_world.tolist(),
        }

    def render(self, camera: ViewCamera) -> NDArray[np.float32]:
        """Render the image of a camera: linear radiance, shape (rows, columns, 3).

        Raises:
            InputError: pixels that are not square, or a failure of Mitsuba.
        """
        # A view has the same noise whatever else is rendered; 2^32 seeds, spread by a prime.
        seed = (self._seed * 1_000_003 + camera.row * 65_537 + camera.column) % 2**32
        with _variant(self.variant) as mitsuba:
            sensor = mitsuba.load_dict(self.sensor_for(camera))
            try:
                picture = mitsuba.render(
                    self._scene, sensor=sensor, integrator=self._integrator, spp=self.samples, seed=seed
                )
                return np.array(picture, dtype=np.float32)
            except RuntimeError as error:
                raise InputError(f"Mitsuba: {error}") from error

    def sensor_for(self, camera: ViewCamera) -> dict[str, Any]:
        """The sensor of a view, as a dict for `mitsuba.load_dict`.

        Mitsuba shifts an image by its principal point, in widths to the right and in heights downwards.

        Raises:
            InputError: pixels that are not square, which Mitsuba does not support.
        """
        rows, columns = camera.pixels
        wide, high = camera.right - camera.left, camera.bottom - camera.top
        if not math.isclose(wide / columns, high / rows, rel_tol=1e-6):
            raise InputError(
                f"Mitsuba's pixels are square, and these span {wide / columns:g} across and {high / rows:g} down: "
                "give one slope_per_pixel for both"
            )
        # Mitsuba's x axis points left and its y axis up.
        move = np.eye(4)
        move[:2, 3] = -camera.x / self._metres_per_unit, -camera.y / self._metres_per_unit
        mitsuba = mitsuba_library()
        given: dict[str, Any] = {
            "type": "perspective",
            "fov": math.degrees(2 * math.atan(wide / 2)),
            "fov_axis": "x",
            "principal_point_offset_x": (camera.left + camera.right) / 2 / wide,
            "principal_point_offset_y": (camera.top + camera.bottom) / 2 / high,
            "to_world": mitsuba.ScalarTransform4f(self._to_world @ move),
            "sampler": self._sampler,
            "film": {
                "type": "hdrfilm",
                "width": columns,
                "height": rows,
                "pixel_format": "rgb",
                "component_format": "float32",
                "rfilter": {"type": "box"},
            },
        }
        if self._own is not None:
            given["near_clip"], given["far_clip"] = self._own.near_clip(), self._own.far_clip()
            medium = self._own.get_medium()
            if medium is not None:
                given["medium"] = medium
        return given


def _settled(mitsuba: Any, sampler: Any, samples: int) -> int:
    """The number of samples that a sampler uses if this number is requested."""
    level = mitsuba.log_level()
    mitsuba.set_log_level(mitsuba.LogLevel.Error)  # it would warn about rounding at every view
    try:
        sampler.set_sample_count(samples)
        return int(sampler.sample_count())
    finally:
        mitsuba.set_log_level(level)


def _pose(to_world: ArrayLike) -> NDArray[np.float64]:
    matrix = checks.array("to_world", to_world, "a 4×4 matrix of numbers", 4, 4)
    turn = matrix[:3, :3]
    # Mitsuba stores matrices in single precision.
    if not np.allclose(turn.T @ turn, np.eye(3), atol=1e-5) or not np.allclose(matrix[3], (0, 0, 0, 1)):
        raise InputError("to_world may move and rotate, but must not scale: set the unit with metres_per_unit")
    return matrix


def _loaded(mitsuba: Any, scene: Any, parameters: dict[str, str]) -> Any:
    """Load the scene.

    Raises:
        InputError: Mitsuba cannot load the scene.
    """
    try:
        if isinstance(scene, Mapping):
            return mitsuba.load_dict(for_mitsuba(mitsuba, scene))
        return mitsuba.load_file(str(Path(fspath(scene)).expanduser()), **parameters)
    except (RuntimeError, TypeError, ValueError) as error:
        name = "the dict" if isinstance(scene, Mapping) else str(scene)
        raise InputError(f"Mitsuba cannot load {name}: {error}") from error


def for_mitsuba(mitsuba: Any, plugin: Mapping[str, Any]) -> dict[str, Any]:
    """Replace NumPy arrays in a scene by objects of Mitsuba: matrices of transforms, and pictures."""
    made: dict[str, Any] = {}
    for name, value in plugin.items():
        if isinstance(value, Mapping):
            made[name] = for_mitsuba(mitsuba, value)
        elif isinstance(value, np.ndarray) and name in ("to_world", "to_uv"):
            made[name] = mitsuba.ScalarTransform4f(value)
        elif isinstance(value, np.ndarray) and name == "bitmap":
            made[name] = mitsuba.Bitmap(np.ascontiguousarray(value))
        else:
            made[name] = value
    return made


def _contents(scene: Any, parameters: dict[str, str]) -> dict[str, Any]:
    """Identity of a scene: the SHA-256 of a dict, or of an XML file and of all files that it names.

    Raises:
        InputError: no such file, or not XML.
    """
    if isinstance(scene, Mapping):
        if parameters:
            raise InputError("parameters are values for the $names of an XML file; this scene is a dict")
        text = json.dumps(scene, default=_plain, sort_keys=True)
        return {"dict_sha256": hashlib.sha256(text.encode()).hexdigest()}
    path = expanded(scene)
    files: dict[str, str] = {}
    with reading(path, "a scene of Mitsuba"):
        _collect(path, path.parent, dict(parameters), files)
    return {"file": path.name, "files_sha256": files, "parameters": parameters}


def _collect(
    path: Path, folder: Path, names: dict[str, str], files: dict[str, str], including: tuple[Path, ...] = ()
) -> None:
    """Add the SHA-256 of a scene file and of all files that it names, by paths relative to the scene's folder.

    Args:
        path: path of the scene file.
        folder: folder of the scene.
        names: values of $names; values defined in the file are added.
        files: the dict to extend.
        including: the chain of files that include this one.
    """
    if path in including:
        raise InputError(f"{path} includes itself")
    name = str(path.relative_to(folder) if path.is_relative_to(folder) else path)
    if name in files:
        return
    data = read_bytes(path, "scene file")
    files[name] = hashlib.sha256(data).hexdigest()
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError as error:
        raise InputError(f"{path} is no XML: {error}") from None
    for element in root.iter():
        if element.tag == "default":
            names.setdefault(element.get("name", ""), element.get("value", ""))
        named = element.get("filename") if element.tag == "include" else element.get("value")
        if element.tag not in ("include", "string") or named is None:
            continue
        # Longest first: $name2 is not $name followed by a 2.
        for name in sorted(names, key=len, reverse=True):
            named = named.replace(f"${name}", names[name])
        file = folder / named
        if element.tag == "string" and element.get("name") != "filename":
            continue
        if not is_file(file):  # Mitsuba may find it in another folder, or else reports it
            files[named] = "not found beside the scene"
        elif element.tag == "include":
            _collect(file, folder, names, files, (*including, path))
        else:
            files[named] = hashlib.sha256(file.read_bytes()).hexdigest()


def _plain(value: Any) -> Any:
    """JSON form of an object in a scene dict: a hash of its numbers if it has any, else its ``repr``."""
    if isinstance(value, Mapping):
        return dict(value)
    try:
        numbers = np.asarray(getattr(value, "matrix", value))
    except (TypeError, ValueError):
        return repr(value)
    if numbers.dtype.kind in "fiub":
        data = np.ascontiguousarray(numbers)
        return [str(data.dtype), list(data.shape), hashlib.sha256(data.tobytes()).hexdigest()]
    return repr(value)
