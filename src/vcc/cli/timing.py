"""Exposure times as options of the command line."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from vcc.base.errors import InputError
from vcc.base.reading import expanded
from vcc.cli.options import MAKING, Number, duration, given_options, quantity
from vcc.motion.moving_camera import TOLERANCE
from vcc.store import StoredVideo, is_video

Duration = Annotated[float, quantity("TIME", duration)]


@Parameter(name="*", group=MAKING)
@dataclass(frozen=True, kw_only=True)
class Timing:
    """When the shutter is open, for a video or a time-varying camera.

    Args:
        start: For a video, when the shutter opens: "0.2 s". Default: with the first frame.
        exposure_time: For a video, or a camera file with a table [moving], how long it stays open: "20 ms".
            Default: for a video, the instant --start.
        time_tolerance: Tolerance of the mean over that time, as a share of the image's mean.
    """

    start: Duration | None = None
    exposure_time: Duration | None = None
    time_tolerance: Number = TOLERANCE

    def check(self, light_field: Path, camera: Path, moves: bool) -> None:
        """Check the combination of options before anything is read.

        Args:
            light_field: of the capture.
            camera: its file.
            moves: whether the camera is time-varying.

        Raises:
            InputError: times for static light and a static camera, or none for a time-varying camera.
        """
        given, stays = given_options(self), expanded(light_field).exists() and not is_video(light_field)
        if moves and self.exposure_time is None:
            raise InputError(
                f"{camera} changes over time (table [moving]): say how long its shutter is open, "
                '--exposure-time "20 ms"'
            )
        if stays and self.start is not None:
            raise InputError(f"{light_field} is no video, and does not change over time: leave out --start")
        if given and stays and not moves:
            raise InputError(
                f"{light_field} is no video, and {camera} has no table [moving]: nothing changes over time, leave "
                f"out {', '.join(given)}"
            )

    def of(self, light: Any) -> tuple[float, float]:
        """(start, length) of the exposure, seconds.

        Args:
            light: a light field, or a video.

        Raises:
            InputError: a video without times given, or without frames.
        """
        length = self.exposure_time or 0.0
        if not isinstance(light, StoredVideo):
            return 0.0, length
        if not light:
            raise InputError(f"{light.path} is a video that has no frame yet")
        first, last = light.times[0], light.times[-1]
        if self.start is None and self.exposure_time is None:
            raise InputError(
                f'{light.path} is a video from {first:g} s to {last:g} s: say when, --start "{first:g} s" for a '
                'moment, and --exposure-time "10 ms" for longer; or take one of its frames, '
                f"{light.path / light.places[0].name}"
            )
        return first if self.start is None else self.start, length
