"""Rendering by PBRT version 4: a user's scene is rewritten for each view and passed to the program ``pbrt``.

Format: https://pbrt.org/fileformat-v4. The transformation at the ``Camera`` directive maps the world to the
    camera, with x right, y up and z ahead; ``screenwindow`` is (left, right, bottom, top) in units of the
    tangent of half the field of view, which is 1 for 90°.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.reading import expanded, is_file, read_bytes, reading, unpacked_gzip
from vcc.files.parts import part_of
from vcc.files.picture_decoders import read_exr_channels
from vcc.sources.views import ViewCamera

Matrix = NDArray[Any]

_TOKEN = re.compile(r'"(?:[^"\\]|\\.)*"|\[|\]|#[^\n]*|[^\s\[\]"#]+')
_STRING = re.compile(r'"((?:[^"\\]|\\.)*)"')
_KEPT_OF_CAMERA = ("shutteropen", "shutterclose")
_GONE_FROM_FILM = ("xresolution", "yresolution", "cropwindow", "pixelbounds", "filename")
_NUMBERS = {"Translate": 3, "Scale": 3, "Rotate": 4, "LookAt": 9, "Transform": 16, "ConcatTransform": 16}
_DEEPEST_INCLUDE = 32
_MOST_INCLUDES = 10_000


def pbrt_program() -> Path | None:
    """Path of ``pbrt``: from the environment variable PBRT, else from the PATH; None if there is none."""
    named = os.environ.get("PBRT")
    found = shutil.which(named or "pbrt")
    return Path(found).absolute() if found else None


@dataclass(frozen=True)
class Directive:
    """A directive in the head of a scene, before ``WorldBegin``.

    Args:
        name: name, like ``Film``.
        words: the following tokens, quotes included.
    """

    name: str
    words: tuple[str, ...]

    @property
    def kind(self) -> str:
        """The first word without quotes: ``perspective`` for a camera."""
        return self.words[0].strip('"') if self.words else ""

    def parameters(self) -> dict[str, tuple[str, ...]]:
        """The values of each parameter by its declaration without quotes, like ``float fov``.

        Raises:
            InputError: a parameter without a value, or a value without a parameter.
        """
        found: dict[str, tuple[str, ...]] = {}
        words = list(self.words[1:])
        while words:
            name = words.pop(0)
            if not name.startswith('"') or not words:
                raise InputError(f"{self.name} {self.words[0]}: {name} is not a parameter with a value")
            values = [words.pop(0)]
            if values == ["["]:
                if "]" not in words:
                    raise InputError(f"{self.name} {self.words[0]}: the values of {name} have no closing bracket")
                end = words.index("]")
                values, words = words[:end], words[end + 1 :]
            found[" ".join(name.strip('"').split())] = tuple(values)
        return found

    def __str__(self) -> str:
        return " ".join((self.name, *self.words))


@dataclass(frozen=True, eq=False)
class PbrtScene:
    """A scene of PBRT with a parsed head; its world is kept as text.

    Args:
        path: path of the file.
        head: the directives before ``WorldBegin``, with included files expanded.
        world: the text from ``WorldBegin`` on.
    """

    path: Path
    head: tuple[Directive, ...]
    world: str

    @classmethod
    def read(cls, path: str | PathLike[str]) -> PbrtScene:
        """Read a scene from a file.

        Raises:
            InputError: no such file, no ``WorldBegin``, no ``Camera`` or several, an animated camera, or a head
                that is not PBRT.
        """
        path = expanded(path).absolute()
        with reading(path, "a scene of PBRT"):
            head, world = _split(_text(path), path)
            directives = tuple(_directives(head, path, path.parent, 0, []))
            cameras = sum(directive.name == "Camera" for directive in directives)
            if cameras != 1:
                raise InputError(
                    f"{path} has {cameras or 'no'} Camera before WorldBegin: exactly one must define the views"
                )
            scene = cls(path, directives, world)
            scene.camera_from_world()  # raises for an animated camera
            return scene

    def camera_from_world(self) -> Matrix:
        """The transformation at the ``Camera`` directive, 4×4.

        Raises:
            InputError: an animated camera, or a transformation that is unsupported or scales unevenly.
        """
        current, named = np.eye(4), dict[str, Matrix]()
        for directive in self.head:
            name = directive.name
            if name == "Camera":
                break
            if name in ("ActiveTransform", "TransformTimes"):
                raise InputError(f"{self.path}: {directive} makes the camera move during exposure; take it out")
            if name == "Identity":
                current = np.eye(4)
            elif name == "CoordinateSystem":
                named[directive.kind] = current
            elif name == "CoordSysTransform":
                if directive.kind not in named:
                    raise InputError(f"{self.path}: {directive} names a coordinate system that is not there yet")
                current = named[directive.kind]
            elif name in _NUMBERS:
                matrix = _matrix(directive, self.path)
                current = matrix if name == "Transform" else current @ matrix
        _scale_of(current, self.path)
        return current

    def wrapped(self, camera: ViewCamera, metres_per_unit: float = 1.0, samples: int | None = None) -> str:
        """The text of the scene with the camera of a view.

        The camera moves in its own coordinates; lights in the coordinate system "camera" stay at the centre of
        the array. Sampler, integrator, film and media are kept except for the film's size.

        Args:
            camera: camera of the view.
            metres_per_unit: length of the world's unit, metres.
            samples: paths per pixel, replacing the sampler's own number.

        Raises:
            InputError: samples for a stratified sampler, which has separate numbers across and down.
        """
        middle = self.camera_from_world()
        unit = _scale_of(middle, self.path) / metres_per_unit
        move = np.eye(4)
        move[:2, 3] = -camera.x * unit, camera.y * unit  # PBRT's y points up; the world moves against the camera
        lines = []
        seen = set()
        for directive in self.head:
            seen.add(directive.name)
            if directive.name == "Camera":
                lines += [
                    f"Transform {_columns(move @ middle)}",
                    str(_camera(directive, camera)),
                    f"Transform {_columns(np.linalg.inv(middle))}",
                    'CoordinateSystem "camera"',
                    f"Transform {_columns(middle)}",
                ]
            elif directive.name == "Film":
                lines.append(str(_film(directive, camera.pixels)))
            elif directive.name == "Sampler" and samples is not None:
                lines.append(str(_sampler(directive, samples, self.path)))
            elif directive.name != "PixelFilter":
                lines.append(str(directive))
        if "Film" not in seen:
            lines.append(str(_film(Directive("Film", ('"rgb"',)), camera.pixels)))
        if "Sampler" not in seen and samples is not None:
            lines.append(f'Sampler "zsobol" "integer pixelsamples" [ {samples} ]')
        # A sample of a light field is the mean over its pixel.
        lines.append('PixelFilter "box" "float xradius" [ 0.5 ] "float yradius" [ 0.5 ]')
        return "\n".join([*lines, self.world])

    def files(self) -> dict[str, str]:
        """The SHA-256 of the scene's file and of all files named by it or by its includes."""
        found: dict[str, str] = {}
        waiting = [self.path]
        while waiting:
            path = waiting.pop()
            name = os.path.relpath(path, self.path.parent)
            if name in found:
                continue
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
            if path.name.endswith((".pbrt", ".pbrt.gz")):
                named = (self.path.parent / match[1] for match in _STRING.finditer(_text(path)))
                waiting += [file for file in named if is_file(file)]
        return dict(sorted(found.items()))


class PbrtRenderer:
    """Renders a scene of PBRT version 4 view by view with the program ``pbrt``.

    The scene's own camera defines the centre and direction of the array. The camera is replaced by a
    perspective camera without a lens, the film gets the size of the views, and the pixel filter is a box;
    everything else is kept. For each view, a temporary file is written next to the scene, so that relative
    paths stay valid.

    Args:
        scene: the ``.pbrt`` file.
        samples: paths per pixel; None keeps the number of the scene's sampler.
        seed: seed of the random numbers; each view derives its own.
        metres_per_unit: length of the scene's unit, metres.
        program: path of ``pbrt``; None uses `pbrt_program`.

    Raises:
        InputError: no such program or scene, or as in `PbrtScene.read`.
    """

    def __init__(
        self,
        scene: str | PathLike[str],
        *,
        samples: int | None = None,
        seed: int = 0,
        metres_per_unit: float = 1.0,
        program: str | PathLike[str] | None = None,
    ) -> None:
        found = pbrt_program() if program is None else Path(fspath(program)).expanduser().absolute()
        if found is None or not found.is_file():
            raise InputError(
                f"there is no program {found or 'pbrt'}: build PBRT version 4, and put it on the PATH or name it "
                "by the environment variable PBRT"
            )
        if samples is not None:
            checks.whole_number_between("samples", samples, 1, of="paths a pixel")
        self._program = found
        self._scene = PbrtScene.read(scene)
        self._samples = samples
        self._seed = int(seed)
        self._metres_per_unit = checks.above_zero("metres_per_unit", metres_per_unit)

    def description(self) -> dict[str, Any]:
        """Everything that an image depends on except the camera; files and the program by their SHA-256."""
        return {
            "name": "pbrt",
            "program_sha256": hashlib.sha256(self._program.read_bytes()).hexdigest(),
            "scene": self._scene.path.name,
            "files_sha256": self._scene.files(),
            "samples": self._samples,
            "seed": self._seed,
            "metres_per_unit": self._metres_per_unit,
        }

    def render(self, camera: ViewCamera) -> NDArray[np.float32]:
        """Render the image of a camera: linear radiance, shape (rows, columns, 3).

        Raises:
            InputError: the scene's folder is not writable, ``pbrt`` fails (its message is included), or its
                output is not RGB.
        """
        seed = (self._seed * 1_000_003 + camera.row * 65_537 + camera.column) % 2**31
        path = self._scene.path
        wrapper = part_of(path.with_suffix(".pbrt"))
        with tempfile.TemporaryDirectory() as folder:
            picture = Path(folder) / "view.exr"
            try:
                wrapper.write_text(
                    self._scene.wrapped(camera, self._metres_per_unit, self._samples), encoding="utf-8"
                )
                done = subprocess.run(
                    [self._program, "--quiet", "--seed", str(seed), "--outfile", picture, wrapper],
                    capture_output=True,
                    text=True,
                    errors="replace",
                    cwd=path.parent,
                    stdin=subprocess.DEVNULL,
                )
            except OSError as error:
                raise InputError(
                    f"{error.filename or self._program}: {error.strerror or error}. PBRT needs a writable "
                    "folder, because a temporary file for each view is written next to the scene"
                ) from error
            finally:
                wrapper.unlink(missing_ok=True)
            if done.returncode != 0 or not picture.is_file():
                said = (done.stderr.strip() or done.stdout.strip() or "it said nothing").splitlines()
                raise InputError(f"pbrt ended with code {done.returncode}: " + "\n".join(said[-12:]))
            return _read_exr(picture)


def _read_exr(path: Path) -> NDArray[np.float32]:
    """R, G and B of an OpenEXR file, shape (rows, columns, 3).

    Raises:
        InputError: a channel is missing.
    """
    channels = read_exr_channels(path)
    if not {"R", "G", "B"} <= set(channels):
        raise InputError(f"pbrt wrote the channels {', '.join(channels)}: take a film that writes R, G and B")
    return np.stack([np.asarray(channels[name], np.float32) for name in "RGB"], axis=-1)


def _text(path: Path) -> str:
    data = unpacked_gzip(path, "scene file") if path.suffix == ".gz" else read_bytes(path, "scene file")
    return data.decode("utf-8", errors="surrogateescape")


def _split(text: str, path: Path) -> tuple[str, str]:
    """Split a scene into its head and the text from ``WorldBegin`` on."""
    for match in _TOKEN.finditer(text):
        if match[0] == "WorldBegin":
            return text[: match.start()], text[match.start() :]
    raise InputError(f"{path} has no WorldBegin: give the scene's main file, as PBRT version 4 has it")


def _directives(text: str, path: Path, folder: Path, depth: int, included: list[Path]) -> Iterator[Directive]:
    """The directives of a text with included files expanded; the included files are added to ``included``."""
    if depth > _DEEPEST_INCLUDE or len(included) > _MOST_INCLUDES:
        raise InputError(f"{path} includes itself, or is included {len(included)} times and more")
    words: list[str] = []
    for match in [*_TOKEN.finditer(text), None]:
        token = match[0] if match is not None else ""
        if token.startswith("#"):
            continue
        starts = match is None or (token[0].isalpha() and token not in ("true", "false"))
        if starts and words:
            if not words[0][0].isalpha():
                raise InputError(f"{path}: {words[0]} is not a directive; is this a file of PBRT?")
            directive = Directive(words[0], tuple(words[1:]))
            words = []
            if directive.name != "Include":
                yield directive
            else:
                file = folder / directive.kind
                if not is_file(file):
                    raise InputError(f"{path} includes {directive.kind}, and {file} is not there")
                included.append(file)
                yield from _directives(_text(file), file, folder, depth + 1, included)
        if match is not None:
            words.append(token)


def _matrix(directive: Directive, path: Path) -> Matrix:
    """The matrix of a directive that transforms.

    Raises:
        InputError: a wrong number of values, or values that are not numbers.
    """
    try:
        numbers = np.array([float(word) for word in directive.words if word not in "[]"])
    except ValueError:
        raise InputError(f"{path}: {directive} holds something else than numbers") from None
    if len(numbers) != _NUMBERS[directive.name]:
        raise InputError(f"{path}: {directive} needs {_NUMBERS[directive.name]} numbers, not {len(numbers)}")
    matrix = np.eye(4)
    if directive.name in ("Transform", "ConcatTransform"):
        return numbers.reshape(4, 4).T  # stored column by column
    if directive.name == "Translate":
        matrix[:3, 3] = numbers
    elif directive.name == "Scale":
        matrix[:3, :3] = np.diag(numbers)
    elif directive.name == "Rotate":
        matrix[:3, :3] = _rotation(math.radians(numbers[0]), numbers[1:])
    else:
        eye, target, up = numbers.reshape(3, 3)
        ahead = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(up, ahead)
        if not np.linalg.norm(right) > 0:
            raise InputError(f"{path}: {directive} looks along its own upward direction")
        right /= np.linalg.norm(right)
        matrix[:3] = np.stack([right, np.cross(ahead, right), ahead, eye], axis=1)
        return np.asarray(np.linalg.inv(matrix))
    return matrix


def _rotation(angle: float, axis: Matrix) -> Matrix:
    """Rodrigues' formula: anticlockwise about an axis that points at the viewer, in right-handed coordinates."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross)


def _scale_of(matrix: Matrix, path: Path) -> float:
    """The factor by which a transformation scales lengths.

    Raises:
        InputError: the factor depends on the direction.
    """
    square = matrix[:3, :3].T @ matrix[:3, :3]
    scale = float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))
    # Numbers in files have about six digits.
    if not (scale > 0 and np.allclose(square, scale**2 * np.eye(3), atol=1e-4 * scale**2)):
        raise InputError(f"{path}: the transformation of its camera scales unevenly or shears; take that out")
    return scale


def _columns(matrix: Matrix) -> str:
    return "[ " + " ".join(f"{number + 0.0:.9g}" for number in matrix.T.ravel()) + " ]"


def _camera(own: Directive, camera: ViewCamera) -> Directive:
    kept = {name: list(values) for name, values in own.parameters().items() if name.split()[-1] in _KEPT_OF_CAMERA}
    window = (camera.left, camera.right, -camera.bottom, -camera.top)
    return _directive(
        "Camera",
        '"perspective"',
        {**kept, "float fov": ["90"], "float screenwindow": [f"{number + 0.0:.9g}" for number in window]},
    )


def _film(own: Directive, pixels: tuple[int, int]) -> Directive:
    size = {"integer xresolution": [str(pixels[1])], "integer yresolution": [str(pixels[0])]}
    # The default, half precision, would be rounded a second time.
    return _changed(own, (*_GONE_FROM_FILM, "savefp16"), {**size, "bool savefp16": ["false"]})


def _sampler(own: Directive, samples: int, path: Path) -> Directive:
    if own.kind == "stratified":
        raise InputError(
            f"{path}: its stratified sampler has xsamples and ysamples; change them there, and leave samples away"
        )
    return _changed(own, ("pixelsamples",), {"integer pixelsamples": [str(samples)]})


def _changed(own: Directive, gone: tuple[str, ...], new: dict[str, list[str]]) -> Directive:
    kept = {name: list(values) for name, values in own.parameters().items() if name.split()[-1] not in gone}
    return _directive(own.name, own.words[0], {**kept, **new})


def _directive(name: str, kind: str, parameters: dict[str, list[str]]) -> Directive:
    words = [kind]
    for declared, values in parameters.items():
        words += [f'"{declared}"', "[", *values, "]"]
    return Directive(name, tuple(words))
