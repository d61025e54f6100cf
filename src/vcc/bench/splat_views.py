"""Splat scenes on a bench: few coarse views at first, then as many and as fine ones as a camera can use."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.progress import Progress
from vcc.base.units import mm
from vcc.bench.offered import Field
from vcc.light_field import LightField
from vcc.optics.train import Train
from vcc.plot.tracing import openings
from vcc.sources import CameraArray, ViewCamera, synthesize
from vcc.sources.splats import SplatScene
from vcc.sources.splats.looking import seen

LEVELS = ((5, 160), (9, 320))
"""Views along each side, and pixels along the longer side of a view: at first, and then."""
UNBOUNDED = 20 * mm
"""Side of the array before a camera without a rim."""
WIDER, MARGIN = 10 / 9, 1.05
"""Factors by which the views exceed the rim that bounds the light, and each view the sensor's field of view."""
_STEEPEST = 2.0  # tangent of half the field of view


@dataclass(frozen=True)
class SplatViews:
    """Where the views of a scene of splats are for a camera.

    Args:
        scene: the scene.
        aperture: (height, width) of the array, metres.
        field_of_view: angle that the width of a view spans, radians.
        proportions: (rows, columns), relative to the longer side.
        focus_distance: where the views converge, metres.
    """

    scene: SplatScene
    aperture: tuple[float, float]
    field_of_view: float
    proportions: tuple[float, float]
    focus_distance: float

    @classmethod
    def before(cls, train: Train, scene: SplatScene) -> SplatViews:
        """Views that fill the opening of a camera and show what its sensor sees, converging inside the scene.

        Raises:
            NothingSeen: the middle view shows no object.
        """
        to_sensor = train.arriving_at_sensor.linear
        sides, slopes = [], []
        for axis in (1, 0):
            reach = [(half, abs(rays.linear[axis, axis])) for _, rays, half in openings(train, axis)]
            sides.append(float(min((WIDER * 2 * half / by for half, by in reach if by > 1e-6), default=UNBOUNDED)))
            half, by = train.sensor.size[1 - axis] / 2, abs(to_sensor[axis, 2 + axis])
            slopes.append(float(min(MARGIN * half / max(by, half / _STEEPEST), _STEEPEST)))
        longer = max(slopes)
        proportions = (slopes[0] / longer, slopes[1] / longer)
        angle = 2 * math.atan(slopes[1])
        found = seen(scene, angle, _pixels(proportions, LEVELS[-1][1]))
        focus = 2 / (1 / found.nearest + 1 / found.farthest)
        return cls(scene, (sides[0], sides[1]), angle, proportions, focus)

    def cameras(self, views: int, pixels: int) -> CameraArray:
        """The array with this many views along each side, and pixels along the longer side of a view."""
        return CameraArray.over_aperture(
            self.aperture,
            self.field_of_view,
            views=(views, views),
            pixels=_pixels(self.proportions, pixels),
            focus_distance=self.focus_distance,
        )

    def field(self, file: str | None = None) -> Field:
        """The light field for a bench, rendered at first use, with the better one that follows.

        Args:
            file: of the splats, for programs that render the same views.
        """
        source, found = "" if file is None else self._program(file), None
        for level in reversed(LEVELS):
            found = Field(_Rendered(self.scene, self.cameras(*level)), source, found)
        assert found is not None
        return found

    def _program(self, file: str) -> str:
        scene = self.scene
        options = "".join(f", {name}={getattr(scene, name)!r}" for name in ("low_pass", "transfer", "near"))
        return (
            "from vcc.sources import CameraArray, Viewpoint, synthesize\n"
            "from vcc.sources.splats import SplatScene\n\n"
            f"scene = SplatScene(\n    {file!r},\n    {scene.viewpoint!r}{options},\n)\n"
            f"light_field = synthesize(scene, {self.cameras(*LEVELS[-1])!r})"
        )


class _Rendered:
    """Opens a light field of splats; views that were rendered before an interruption are kept."""

    def __init__(self, scene: SplatScene, cameras: CameraArray) -> None:
        self._scene, self._cameras = scene, cameras
        self._done: dict[ViewCamera, NDArray[np.float32]] = {}

    def __call__(self, progress: Progress | None) -> LightField:
        found = synthesize(self, self._cameras, progress=progress)
        self._done.clear()
        assert isinstance(found, LightField)
        return found

    def description(self) -> dict[str, Any]:
        return self._scene.description()

    def render(self, camera: ViewCamera) -> NDArray[np.float32]:
        if camera not in self._done:
            self._done[camera] = self._scene.render(camera)
        return self._done[camera]

    def disparity_maps(self, cameras: CameraArray) -> Any:
        return self._scene.disparity_maps(cameras)


def _pixels(proportions: tuple[float, float], longer: int) -> tuple[int, int]:
    rows, columns = (max(round(longer * share), 1) for share in proportions)
    return rows, columns
