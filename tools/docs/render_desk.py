"""Render the desk (desk_scene.py) as a light field into docs/data/desk.zarr.

The light field that is kept was made so, with Mitsuba 3.9.1 (llvm_ad_rgb, LLVM 19.1) and pyoidn 2.5.1:

    apt-get install libllvm19
    export DRJIT_LIBLLVM_PATH=/usr/lib/x86_64-linux-gnu/libLLVM.so.19.1
    pip install pyoidn
    python tools/docs/render_desk.py

pyoidn is Intel's Open Image Denoise; without it views stay as noisy as Mitsuba makes them, and a word says so.
`--quick` renders 3×3 small views into a store of its own. After a stop, the same call goes on.

36 paths per pixel took 2414 s on two cores of an Intel Xeon that others used too.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import desk_scene
import numpy as np
from numpy.typing import NDArray

import vcc
from vcc.files.transfer import encode
from vcc.sources import CameraArray, ViewCamera
from vcc.sources.mitsuba import MitsubaRenderer
from vcc.sources.mitsuba.renderer import mitsuba_library
from vcc.sources.synthesis import synthesize
from vcc.store import Lossy, StoredLightField, save_store

KEPT = Path(__file__).parents[2] / "docs" / "data" / "desk.zarr"
QUALITY = 99
GUIDES = {"type": "aov", "aovs": "albedo:albedo,normal:sh_normal"}
"""What Mitsuba renders besides radiance, to tell the denoiser what is an edge and what is noise."""

Array = NDArray[Any]


@dataclass(frozen=True)
class Quiet:
    """A renderer whose noise a denoiser takes out of each view by itself.

    Args:
        radiance: renders it.
        guides: renders albedo and normals, (rows, columns, 6); None leaves the noise.
        denoise: called with radiance, albedo and normals; likewise.
    """

    radiance: MitsubaRenderer
    guides: MitsubaRenderer | None = None
    denoise: Callable[[Array, Array, Array], Array] | None = None

    def description(self) -> dict[str, Any]:
        """The renderer's, and the denoiser."""
        denoiser = f"Open Image Denoise, pyoidn {version('pyoidn')}, each view by itself" if self.denoise else None
        return {**self.radiance.description(), "denoiser": denoiser}

    def render(self, camera: ViewCamera) -> NDArray[np.float32]:
        """The radiance of a view."""
        noisy = self.radiance.render(camera)
        if self.guides is None or self.denoise is None:
            return noisy
        guides = self.guides.render(camera)
        albedo, normals = (np.ascontiguousarray(part) for part in np.split(guides, 2, axis=-1))
        return np.maximum(self.denoise(noisy, albedo, normals), 0)


def desk(folder: Path, samples: int, variant: str = "auto", quiet: bool = True, seed: int = 0) -> Quiet:
    """The renderer of the desk.

    Args:
        folder: there, for the meshes.
        samples: paths per pixel.
        variant: of Mitsuba.
        quiet: whether noise is taken out, where pyoidn is installed.
        seed: of the noise.
    """
    scene = desk_scene.scene(folder)
    radiance = MitsubaRenderer(scene, samples=samples, variant=variant, seed=seed)
    denoise = denoiser() if quiet else None
    if denoise is None:
        return Quiet(radiance)
    guides = MitsubaRenderer({**scene, "integrator": GUIDES}, samples=samples, variant=variant, seed=seed)
    return Quiet(radiance, guides, denoise)


def denoiser() -> Callable[[Array, Array, Array], Array] | None:
    """Open Image Denoise for linear radiance, or None where it is not installed."""
    try:
        import pyoidn
    except ImportError:
        print("pyoidn is not installed: the views keep their noise")
        return None
    return lambda radiance, albedo, normal: pyoidn.denoise(
        radiance, albedo=np.clip(albedo, 0, 1), normal=normal, hdr=True
    )


def distances(renderer: MitsubaRenderer, camera: ViewCamera) -> Array:
    """How far before the entrance plane the rays through the middles of a view's pixels meet something, metres.

    Of glass that is its surface, not what shows through it.
    """
    mitsuba = mitsuba_library()
    mitsuba.set_variant(renderer.variant)
    scene = renderer._scene
    sensor = mitsuba.load_dict(renderer.sensor_for(camera))
    rows, columns = camera.pixels
    y, x = np.mgrid[:rows, :columns].reshape(2, -1) + 0.5
    if renderer.variant.startswith("scalar"):
        points = [_met(mitsuba, scene, sensor, *place) for place in zip(x / columns, y / rows, strict=True)]
    else:
        points = _met(mitsuba, scene, sensor, x / columns, y / rows).T
    ahead = np.subtract(desk_scene.TARGET, desk_scene.EYE)
    found = (np.array(points) - desk_scene.EYE) @ (ahead / np.linalg.norm(ahead))
    return np.asarray(found.reshape(rows, columns))


def _met(mitsuba: Any, scene: Any, sensor: Any, x: Any, y: Any) -> Array:
    """The points that the rays through places of a picture, 0 to 1, meet."""
    ray, _ = sensor.sample_ray(0.0, 0.5, mitsuba.Point2f(x, y), mitsuba.Point2f(0.5, 0.5))
    return np.array(scene.ray_intersect(ray).p)


def keep(rendered: StoredLightField, cameras: CameraArray, depth: Array, path: Path) -> StoredLightField:
    """Write what was rendered as 16-bit sRGB codes, each view packed as a picture, with the true disparities.

    Full scale is the brightest sample, rounded up, so that nothing is cut off.

    Args:
        rendered: linear radiance.
        cameras: of it.
        depth: of the middle view, metres.
        path: of the store; one that is there is replaced.
    """
    radiance = rendered.read().values
    full_scale = math.ceil(radiance.max())
    codes = encode(radiance / np.float32(full_scale), 16)
    made = cameras.light_field(codes)
    disparity = cameras.disparity(depth)
    light_field = vcc.LightField(
        made.values, made.frame, (float(disparity.min()), float(disparity.max())), disparity=disparity
    )
    return save_store(
        light_field,
        path,
        provenance={**rendered.provenance, "scene": "tools/docs/render_desk.py", "full_scale": full_scale},
        transfer="srgb",
        channel_names=("R", "G", "B"),
        compression=Lossy("jpegxl", QUALITY),
        overwrite=True,
    )


def main() -> None:
    """Render, say how it goes, keep."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--views", type=int, nargs=2, default=(9, 9))
    options.add_argument("--pixels", type=int, nargs=2, default=(320, 480))
    options.add_argument("--samples", type=int, default=36, help="paths per pixel")
    options.add_argument("--rendered", type=Path, default=Path("desk-rendered.zarr"), help="views as rendered")
    options.add_argument("-o", "--output", type=Path, default=KEPT)
    options.add_argument("--quick", action="store_true", help="3×3 views of 80×120 pixels in desk-quick.zarr")
    given = options.parse_args()
    if given.quick:
        given.views, given.pixels, given.samples = (3, 3), (80, 120), 16
        given.rendered, given.output = Path("desk-quick-rendered.zarr"), Path("desk-quick.zarr")
    cameras = desk_scene.cameras(tuple(given.views), tuple(given.pixels))
    folder = given.rendered.with_suffix(".meshes")
    folder.mkdir(exist_ok=True)
    renderer = desk(folder, given.samples)
    start = time.monotonic()

    def tell(done: int, total: int) -> None:
        print(f"{done} of {total} views, {time.monotonic() - start:.0f} s", flush=True)

    rendered = synthesize(renderer, cameras, given.rendered, dtype="float32", progress=tell)
    assert isinstance(rendered, StoredLightField)
    middle = cameras.camera((given.views[0] - 1) // 2, (given.views[1] - 1) // 2)
    print(keep(rendered, cameras, distances(renderer.radiance, middle), given.output))


if __name__ == "__main__":
    main()
