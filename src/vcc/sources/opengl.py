"""Views of triangle meshes, rendered by OpenGL without a screen: glTF, OBJ and PLY, textured, simply lit.

moderngl renders through EGL, on a graphics card or in software (Mesa's llvmpipe); trimesh reads the files.
Every view is an off-axis projection from a pinhole in the entrance plane, so the geometry matches the frame of
the light field. Radiance is linear: textures are decoded from sRGB before they are filtered.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.sources.meshes import Part, loaded, parts_of
from vcc.sources.views import CameraArray, ViewCamera

_NEAREST_SHARE = 1e-4
"""The near clipping distance is at least this fraction of the far one."""

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Viewpoint:
    """Position and orientation of the camera array in a scene's own coordinates.

    Args:
        eye: centre of the array, in the scene's units.
        target: a point on the array's axis in front of it, likewise.
        up: direction that is upwards in the images.
        unit: length of the scene's unit in metres; glTF uses metres.

    Raises:
        InputError: eye and target coincide, up is along the axis, or the unit is not above 0.
    """

    eye: Vector = (0.0, 0.0, 0.0)
    target: Vector = (0.0, 0.0, -1.0)
    up: Vector = (0.0, 1.0, 0.0)
    unit: float = field(default=1.0, metadata={"unit": "length"})

    def __post_init__(self) -> None:
        checks.above_zero("the unit of a scene", self.unit, "a length in metres")
        back = np.subtract(self.eye, self.target)
        if not np.linalg.norm(back) > 0:
            raise InputError(f"a viewpoint looks from eye to target, and both are {self.eye}")
        if not np.linalg.norm(np.cross(self.up, back)) > 1e-9 * np.linalg.norm(back) * np.linalg.norm(self.up):
            raise InputError(f"up is {self.up}, which must not be parallel to the viewing direction")

    def array_from_scene(self) -> NDArray[np.float64]:
        """4×4 matrix from scene to array coordinates: metres, x right, y down, z against the viewing direction."""
        back = np.subtract(self.eye, self.target)
        back = back / np.linalg.norm(back)
        right = np.cross(self.up, back)
        right /= np.linalg.norm(right)
        axes = np.stack([right, -np.cross(back, right), back])
        matrix = np.eye(4)
        matrix[:3, :3] = self.unit * axes
        matrix[:3, 3] = -self.unit * axes @ np.asarray(self.eye, dtype=np.float64)
        return matrix


@dataclass(frozen=True)
class Lighting:
    """Lighting of a scene of meshes, in the axes of the camera array; without shadows.

    Radiance = albedo · (ambient + fill·(1 − n_y)/2 + sun·max(0, n·l)): n is the unit surface normal on the
    visible side; l points to the sun; y is downwards.

    Args:
        ambient: light from all directions (red, green, blue), linear.
        sun: light from one direction, likewise: the radiance of a surface of albedo 1 that faces the sun.
        sun_from: direction towards the sun (x right, y down, z from the scene to the cameras); any length above 0.
        fill: soft light from above, half of it from the horizon, likewise.

    Raises:
        InputError: light below 0, or a sun direction of zero length.
    """

    ambient: Vector = (0.15, 0.15, 0.17)
    sun: Vector = (0.7, 0.68, 0.62)
    sun_from: Vector = (-0.5, -0.8, 0.7)
    fill: Vector = (0.25, 0.27, 0.3)

    def __post_init__(self) -> None:
        for name in ("ambient", "sun", "fill"):
            check_light(name, getattr(self, name))
        if not 0 < math.hypot(*self.sun_from) < math.inf:
            raise InputError(f"sun_from is a direction of three numbers, not {self.sun_from}")


def check_light(name: str, given: Sequence[float]) -> Vector:
    """Check radiance: three finite numbers, 0 or more."""
    if len(given) != 3 or not all(part >= 0 and math.isfinite(part) for part in given):
        raise InputError(f"{name} is light as (red, green, blue), each 0 or more, not {given}")
    return float(given[0]), float(given[1]), float(given[2])


class OpenGLRenderer:
    """Renders the views of triangle meshes; a renderer for `vcc.sources.synthesize`.

    Meshes are solid: fragments less opaque than half (or than glTF's alphaCutoff) are discarded, all others are
    opaque. There are no shadows, mirrors or glass. A glTF material that is not double-sided is invisible from
    behind, as glTF specifies; all others are two-sided. Textures repeat, with mipmaps and, if the driver
    supports it, anisotropic filtering. Materials contribute only the base colour and its texture. 8-bit colours
    of OBJ and PLY are decoded as sRGB, glTF's factors and vertex colours are linear; an OBJ material with a
    picture uses only the picture's colour.

    All views must be drawn in the thread that draws the first one.

    Args:
        meshes: files (.glb, .gltf, .obj, .ply), or trimesh scenes and meshes; one or several.
        viewpoint: position and orientation of the array in the scene's coordinates.
        lighting: lighting of the scene.
        background: linear radiance (red, green, blue) of the background.
        supersampling: pixels rendered along each axis and averaged for one pixel of a view.
        multisampling: coverage samples per rendered pixel, 1 to the maximum of the driver.

    Raises:
        InputError: a mesh file, or a picture that it names, is missing or invalid; no triangles, or none in
            front of the array; missing packages.
    """

    def __init__(
        self,
        meshes: Any,
        viewpoint: Viewpoint | None = None,
        *,
        lighting: Lighting | None = None,
        background: Vector = (0.0, 0.0, 0.0),
        supersampling: int = 1,
        multisampling: int = 4,
    ) -> None:
        for name, count in (("supersampling", supersampling), ("multisampling", multisampling)):
            checks.whole_number_between(name, count, 1, 16)
        self.viewpoint = viewpoint or Viewpoint()
        self.lighting = lighting or Lighting()
        self.background = check_light("background", background)
        self.supersampling, self.multisampling = supersampling, multisampling
        self._names, scenes = loaded(meshes)
        self._parts = parts_of(scenes, self.viewpoint.array_from_scene())
        far = np.concatenate([-part.corners[:, 2] for part in self._parts])
        if not far.max() > 0:
            raise InputError(
                "all meshes are behind the cameras: move the viewpoint's eye, or let `fitted` choose it"
            )
        self._distances = (float(far[far > 0].min()), float(far.max()))
        self._drawing: _Drawing | None = None

    @classmethod
    def fitted(
        cls,
        meshes: Any,
        cameras: CameraArray,
        *,
        direction: Vector = (0.0, 0.0, 1.0),
        up: Vector = (0.0, 1.0, 0.0),
        unit: float = 1.0,
        **options: Any,
    ) -> OpenGLRenderer:
        """A renderer whose array is placed so that its central view shows all meshes.

        Args:
            meshes: see the class.
            cameras: the array.
            direction: from the centre of the meshes to the array, in the scene's coordinates; glTF's front is +z.
            up: upward direction in the images, likewise.
            unit: length of the scene's unit in metres.
            options: further arguments of the class.

        Raises:
            InputError: as in the class; or views so far apart or so narrow that nothing fits.
        """
        _, scenes = loaded(meshes)
        low = np.min([scene.bounds[0] for scene in scenes], axis=0)
        high = np.max([scene.bounds[1] for scene in scenes], axis=0)
        middle = (low + high) / 2
        away = np.asarray(direction, dtype=np.float64)
        place = Viewpoint(tuple(middle + away), tuple(middle), up, unit)
        corners = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 3) - middle
        x, y, z = (place.array_from_scene()[:3, :3] / unit) @ corners.T
        tangents = [n * slope / 2 for n, slope in zip(cameras.pixels, cameras.slopes_per_pixel, strict=True)]
        # A corner at depth D − z is in the image if |x| ≤ tangent · (D − z); plus a small margin.
        distance = float(np.max([z + np.abs(x) / tangents[1], z + np.abs(y) / tangents[0]])) * 1.02
        eye = middle + away / np.linalg.norm(away) * distance
        return cls(meshes, Viewpoint(tuple(eye.tolist()), tuple(middle.tolist()), up, unit), **options)

    @property
    def distances(self) -> tuple[float, float]:
        """Distances of the nearest and farthest vertex in front of the entrance plane, metres along the axis."""
        return self._distances

    def description(self) -> dict[str, Any]:
        """Everything that the images depend on except the cameras; meshes and textures by their SHA-256."""
        digest = hashlib.sha256()
        for part in self._parts:
            digest.update(part.corners.tobytes())
            digest.update(b"-" if part.texture is None else part.texture.tobytes())
            digest.update(repr((part.cutoff, part.two_sided)).encode())
        return {
            "renderer": "opengl",
            "meshes": self._names,
            "sha256": digest.hexdigest(),
            "viewpoint": asdict(self.viewpoint),
            "lighting": asdict(self.lighting),
            "background": list(self.background),
            "supersampling": self.supersampling,
            "multisampling": self.multisampling,
        }

    def render(self, camera: ViewCamera) -> NDArray[np.float32]:
        """Render the image of one view.

        Args:
            camera: position and viewing direction of the view.

        Returns:
            Linear radiance, (rows, columns, 3), row 0 at the top.

        Raises:
            InputError: no OpenGL on this machine, or an image larger than it supports.
        """
        if self._drawing is None:
            self._drawing = _Drawing(self._parts, self.lighting, self.multisampling)
        far = self._distances[1] * 1.001
        near = max(self._distances[0] * 0.999, far * _NEAREST_SHARE)
        fine = self.supersampling
        rows, columns = camera.pixels
        drawn = self._drawing.draw(
            _projection(camera, near, far), camera, (rows * fine, columns * fine), self.background
        )
        if fine > 1:
            drawn = drawn.reshape(rows, fine, columns, fine, 3).mean(axis=(1, 3))
        return drawn

    def close(self) -> None:
        """Free the graphics memory; the next view allocates it again."""
        if self._drawing is not None:
            self._drawing.release()
            self._drawing = None


def _projection(camera: ViewCamera, near: float, far: float) -> NDArray[np.float64]:
    """4×4 matrix from array to clip coordinates, with row 0 of the image at the bottom in OpenGL."""
    across, down = camera.right - camera.left, camera.bottom - camera.top
    # With depth Z = −z: ndc_x = 2·((x − x₀)/Z − left)/across − 1, times Z; y likewise, which OpenGL stores from
    # −1 upwards, so the top row comes first in memory without a flip.
    return np.array(
        [
            [2 / across, 0, 2 * camera.left / across + 1, -2 * camera.x / across],
            [0, 2 / down, 2 * camera.top / down + 1, -2 * camera.y / down],
            [0, 0, -(far + near) / (far - near), -2 * far * near / (far - near)],
            [0, 0, -1, 0],
        ]
    )


_VERTEX = """
#version 330
uniform mat4 clip_from_array;
in vec3 position; in vec3 normal; in vec2 place; in vec4 colour;
out vec3 at; out vec3 facing; out vec2 uv; out vec4 tint;
void main() {
    gl_Position = clip_from_array * vec4(position, 1.0);
    at = position; facing = normal; uv = place; tint = colour;
}
"""
_FRAGMENT = """
#version 330
uniform sampler2D image; uniform bool textured; uniform float cutoff; uniform bool two_sided; uniform vec3 eye;
uniform vec3 ambient; uniform vec3 sun; uniform vec3 to_sun; uniform vec3 fill;
in vec3 at; in vec3 facing; in vec2 uv; in vec4 tint;
out vec4 radiance;
void main() {
    vec4 albedo = tint;
    if (textured) albedo *= texture(image, uv);
    if (albedo.a < cutoff) discard;
    vec3 n = normalize(facing);
    // the side that is seen, by the triangle itself: shading normals lean over at outlines
    vec3 flat_normal = cross(dFdx(at), dFdy(at));
    if (dot(flat_normal, eye - at) < 0.0) flat_normal = -flat_normal;
    if (dot(flat_normal, n) < 0.0) n = -n;
    vec3 light = ambient + fill * 0.5 * (1.0 - n.y) + sun * max(dot(n, to_sun), 0.0);
    radiance = vec4(albedo.rgb * light, 1.0);
}
"""


class _Drawing:
    """An OpenGL context with the meshes in its memory."""

    def __init__(self, parts: Sequence[Part], lighting: Lighting, multisampling: int) -> None:
        self.context = _context()
        most = self.context.max_samples
        if multisampling > most:
            self.release()
            raise InputError(
                f"multisampling is {multisampling}, and the OpenGL here has up to {most} samples; "
                "supersampling has no such limit"
            )
        self.samples = multisampling if multisampling > 1 else 0
        self.program = self.context.program(vertex_shader=_VERTEX, fragment_shader=_FRAGMENT)
        self._set("ambient", lighting.ambient)
        self._set("sun", lighting.sun)
        self._set("fill", lighting.fill)
        length = math.hypot(*lighting.sun_from)
        self._set("to_sun", tuple(part / length for part in lighting.sun_from))
        self._set("image", 0)
        self.parts = [(part, *self._loaded(part)) for part in parts]
        self.size: tuple[int, int] | None = None
        self.targets: list[Any] = []

    def _set(self, name: str, value: Any) -> None:
        if name in self.program:  # the compiler removes unused uniforms
            self.program[name].value = value

    def _loaded(self, part: Part) -> tuple[Any, Any]:
        buffer = self.context.buffer(part.corners.tobytes())
        layout = (buffer, "3f 3f 2f 4f", "position", "normal", "place", "colour")
        array = self.context.vertex_array(self.program, [layout])
        if part.texture is None:
            return array, None
        rows, columns = part.texture.shape[:2]
        limit = self.context.info["GL_MAX_TEXTURE_SIZE"]
        if max(rows, columns) > limit:
            raise InputError(
                f"a texture of {columns}×{rows} pixels is larger than OpenGL's {limit} here: shrink it"
            )
        texture = self.context.texture((columns, rows), 4, part.texture.tobytes(), dtype="f2")
        texture.build_mipmaps()
        texture.anisotropy = self.context.max_anisotropy
        return array, texture

    def _resize(self, size: tuple[int, int]) -> None:
        if size == self.size:
            return
        limit = self.context.info["GL_MAX_TEXTURE_SIZE"]
        if max(size) > limit:
            raise InputError(
                f"a view is drawn with {size[1]}×{size[0]} pixels, and OpenGL here draws up to {limit} each way: "
                "take less supersampling"
            )
        for target in self.targets:
            target.release()
        wide = size[::-1]
        drawn = self.context.framebuffer(
            self.context.renderbuffer(wide, 4, samples=self.samples, dtype="f4"),
            self.context.depth_renderbuffer(wide, samples=self.samples),
        )
        kept = self.context.simple_framebuffer(wide, 4, dtype="f4") if self.samples else drawn
        self.targets = [drawn, kept] if self.samples else [drawn]
        self.size = size

    def draw(
        self,
        projection: NDArray[np.float64],
        camera: ViewCamera,
        size: tuple[int, int],
        background: Sequence[float],
    ) -> NDArray[np.float32]:
        import moderngl

        self._resize(size)
        target, kept = self.targets[0], self.targets[-1]
        target.use()
        target.viewport = (0, 0, size[1], size[0])
        self.context.enable(moderngl.DEPTH_TEST)
        target.clear(*background, 1.0)
        self.program["clip_from_array"].write(projection.T.astype(np.float32).tobytes())
        self._set("eye", (camera.x, camera.y, 0.0))
        # The array's axes are left-handed (y is down), which mirrors: triangles that are anticlockwise as seen
        # from outside are clockwise in the window.
        self.context.front_face = "cw"
        for part, array, texture in self.parts:
            self._set("textured", texture is not None)
            self._set("cutoff", part.cutoff)
            if part.two_sided:
                self.context.disable(moderngl.CULL_FACE)
            else:
                self.context.enable(moderngl.CULL_FACE)
            if texture is not None:
                texture.use(0)
            array.render(moderngl.TRIANGLES)
        if kept is not target:
            self.context.copy_framebuffer(kept, target)
        pixels = np.frombuffer(kept.read(components=3, dtype="f4", alignment=1), dtype=np.float32)
        return pixels.reshape(*size, 3).copy()

    def release(self) -> None:
        self.context.release()


def _context() -> Any:
    with checks.package("drawing meshes", "moderngl", "opengl"):
        import moderngl
    try:
        create: Any = moderngl.create_context  # its type stubs lack these options
        return create(standalone=True, backend="egl", require=330)
    except Exception as error:  # the loader of libEGL raises plain exceptions
        raise InputError(
            f"OpenGL cannot be opened without a screen, through EGL ({error}). Install EGL and Mesa's drivers, "
            'which also draw without a graphics card: "apt install libegl1 libgl1-mesa-dri" on Debian and Ubuntu'
        ) from None
