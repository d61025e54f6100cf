"""The views of a cloud of Gaussian splats, drawn on the processor."""

from __future__ import annotations

import math
from dataclasses import asdict
from os import PathLike
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks, lazy_import
from vcc.base.errors import InputError
from vcc.base.workers import Workers
from vcc.fields.disparity import DisparityMaps
from vcc.files.transfer import from_linear, to_linear
from vcc.plan.how import cores
from vcc.sources.opengl import Vector, Viewpoint, check_light
from vcc.sources.splats.cloud import Splats, Transfer
from vcc.sources.splats.reading import read_splats
from vcc.sources.views import CameraArray, ViewCamera

LowPass = Literal["auto", "3dgs", "mip", "none"]

_LOW_PASSES = {"3dgs": (0.3, False), "mip": (0.1, True), "none": (0.0, False)}
"""Variance added along both axes, square pixels, and whether opacities are lowered to compensate."""
_SPLATS_AT_ONCE = 2**15
_ROWS_AT_ONCE = 3


class NothingSeen(InputError):
    """An array sees no splats."""


class SplatScene:
    """The views of 3D Gaussian splats; a renderer for `vcc.sources.synthesize`.

    Each view is a perspective image of its own pinhole, with occlusion and the view-dependent colours of the
    splats: splats are projected by Σ' = J W Σ Wᵀ Jᵀ plus a low-pass, sorted by depth and blended front to back
    (Kerbl et al. 2023). Splats are drawn where their opacity is at least 1/255, with at most 0.99, until the
    transmittance of a whole tile is below 1e-4. The result does not depend on the number of threads.

    Args:
        splats: a file (.ply, .splat, .spz, .glb), or `Splats`.
        viewpoint: position and orientation of the array in the scene's axes. Default: at the origin, along +z of
            PLY and .splat (y down), or along −z of .spz and .glb (y up).
        low_pass: ``"3dgs"`` adds 0.3 px² to the variance of a projected splat, which makes small splats wider and
            brighter, as files are usually fitted. ``"mip"`` adds 0.1 px², close to the mean over a pixel (1/12
            px²), and lowers the opacity by the root of the ratio of areas (Yu et al. 2024). ``"none"`` adds
            nothing: splats smaller than a pixel then alias. ``"auto"`` is ``"mip"`` if the file states it (.spz),
            otherwise ``"3dgs"``.
        transfer: ``"srgb"`` if colours are display-referred: they are blended as they are, and the finished pixels
            are decoded to linear light. ``"linear"`` if they are linear. ``"auto"``: as the file states; PLY,
            .splat and .spz state nothing and are taken as ``"srgb"``.
        background: linear radiance (red, green, blue) behind all splats, infinitely far away.
        degree: maximum degree of the spherical harmonics, 0 to 3; None uses all.
        near: splats whose centre is nearer to the entrance plane are not drawn, scene units.
        threads: number of threads; None uses all cores.

    Attributes:
        left_out: number of splats in front of the array that are nearer than ``near``, wherever they are.

    Raises:
        InputError: a file that cannot be read, an invalid option, or no splat in front of the array.
    """

    def __init__(
        self,
        splats: str | PathLike[str] | Splats,
        viewpoint: Viewpoint | None = None,
        *,
        low_pass: LowPass = "auto",
        transfer: Transfer | Literal["auto"] = "auto",
        background: Vector = (0.0, 0.0, 0.0),
        degree: int | None = None,
        near: float = 0.2,
        threads: int | None = None,
    ) -> None:
        checks.one_of("low_pass", low_pass, get_args(LowPass))
        checks.one_of("transfer", transfer, ("auto", "srgb", "linear"))
        cloud = splats if isinstance(splats, Splats) else read_splats(splats)
        self.splats = cloud if degree is None else cloud.of_degree(degree)
        self.background = check_light("background", background)
        self.near = checks.above_zero("near", near, "a distance in scene units")
        self.threads = None if threads is None else checks.whole_number_between("threads", threads, 1)
        self.low_pass = ("mip" if cloud.antialiased else "3dgs") if low_pass == "auto" else low_pass
        self.transfer = cloud.transfer if transfer == "auto" else transfer
        if viewpoint is None:
            viewpoint = Viewpoint(target=(0.0, 0.0, -math.copysign(1, cloud.up[1])), up=cloud.up)
        self.viewpoint = viewpoint
        self._digest: str | None = None
        kernels = lazy_import.module("vcc.sources.splats.kernels")
        matrix = viewpoint.array_from_scene()
        depth = -(cloud.positions @ matrix[2, :3] + matrix[2, 3])
        if not (depth > self._near).any():
            raise NothingSeen(
                f"all {len(depth)} splats are behind the array or nearer than {near:g} scene units: move the "
                "viewpoint's eye or target, or pass a smaller near"
            )
        self.left_out = int(((depth > 0) & (depth <= self._near)).sum())
        self._order = np.argsort(depth, kind="stable").astype(np.int32)
        self._placed = np.empty((len(depth), 9))
        kernels.placed(cloud.positions, cloud.sizes, cloud.rotations, self._order, matrix, self._placed)
        self._turn = np.ascontiguousarray(matrix[:3, :3].T / viewpoint.unit)

    @property
    def _near(self) -> float:
        return self.near * self.viewpoint.unit

    def description(self) -> dict[str, Any]:
        """Everything that the images depend on except the cameras; splats by the SHA-256 of their numbers."""
        if self._digest is None:
            self._digest = self.splats.digest()
        return {
            "renderer": "splats",
            "sha256": self._digest,
            "splats": len(self.splats.positions),
            "degree": self.splats.degree,
            "viewpoint": asdict(self.viewpoint),
            "low_pass": self.low_pass,
            "transfer": self.transfer,
            "background": list(self.background),
            "near": self.near,
        }

    def render(self, camera: ViewCamera) -> NDArray[np.float32]:
        """Render the image of one view.

        Args:
            camera: position and viewing direction of the view.

        Returns:
            Linear radiance, (rows, columns, 3), row 0 at the top.
        """
        return self.render_with_depth(camera, with_depth=False)[0]

    def render_with_depth(
        self, camera: ViewCamera, *, with_depth: bool = True
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Render the image of one view, its depth and its transmittance.

        Args:
            camera: position and viewing direction of the view.
            with_depth: whether the depth is computed.

        Returns:
            The image as from `render`; the distance from the entrance plane along the axis at which half of the
            light is absorbed, metres, (rows, columns), infinite where it is not (without depth: of shape (0, 0));
            and the share of light of the background, 0 to 1, (rows, columns).
        """
        kernels = lazy_import.module("vcc.sources.splats.kernels")
        rows, columns = camera.pixels
        fx, fy = columns / (camera.right - camera.left), rows / (camera.bottom - camera.top)
        view = (camera.x, camera.y, camera.left, camera.top, fx, fy, columns, rows)
        cloud, count = self.splats, len(self._order)
        scene = (self._placed, self._order, cloud.opacities, cloud.harmonics, self._turn, self._near)
        records = np.empty((count, kernels.RECORD), np.float32)
        bounds = np.empty((count, 4), np.int16)
        display = self.transfer == "srgb"
        behind = np.asarray(from_linear(self.background) if display else self.background, np.float32)
        image = np.empty((rows, columns, 4), np.float32)
        depths = np.empty((rows, columns) if with_depth else (0, 0), np.float32)
        with Workers(self.threads or cores()) as workers:

            def shared(work: Any, total: int, step: int) -> None:
                parts = [workers.submit(work, first, min(first + step, total)) for first in range(0, total, step)]
                for part in parts:
                    part.result()

            def projected(first: int, last: int) -> None:
                kernels.project(first, last, scene, view, _LOW_PASSES[self.low_pass], records, bounds)

            def drawn(first: int, last: int) -> None:
                kernels.blend(
                    first, last, records, bounds, behind, image, depths, with_depth, workers.ended
                )  # fmt: skip

            shared(projected, count, _SPLATS_AT_ONCE)
            shared(drawn, -(-rows // kernels.TILE), _ROWS_AT_ONCE)
        light = to_linear(image[..., :3]) if display else np.ascontiguousarray(image[..., :3])
        return light, depths, image[..., 3]

    def disparity_maps(self, cameras: CameraArray) -> DisparityMaps:
        """Disparities of the middle view, computed from its depth.

        Args:
            cameras: the array.

        Returns:
            The map of view ((rows − 1) // 2, (columns − 1) // 2), pixels per view along u. Pixels through which
            more than half of the background is visible have the disparity of infinitely far objects.
        """
        row, column = ((n - 1) // 2 for n in cameras.views)
        _, depth, _ = self.render_with_depth(cameras.camera(row, column))
        slope = cameras.spacings[1] / cameras.slopes_per_pixel[1]
        disparity = slope * (1 / depth.astype(np.float64) - 1 / cameras.focus_distance)
        return DisparityMaps(
            disparity[None].astype(np.float32), ((row, column),), "depth of the splats in the middle view"
        )
