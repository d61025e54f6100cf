"""When a shutter is open, as one says it on the command line."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vcc.base.errors import InputError
from vcc.base.reading import expanded
from vcc.cli.options import MAKING, Given, duration, quantity, told
from vcc.store import StoredVideo, is_video

Duration = Annotated[float, quantity("TIME", duration)]


@Parameter(name="*", group=MAKING)
@dataclass(frozen=True, kw_only=True)
class Timing(Given):
    """When the shutter is open before a video.

    Args:
        start: Of a video, when the shutter opens: "0.2 s". Default: with the first frame.
        exposure_time: Of a video, how long it stays open: "20 ms". Default: for the moment --start.
    """

    start: Duration | None = None
    exposure_time: Duration | None = None

    def check(self, light_field: Path) -> None:
        """Refuse what does not go together, before anything is read.

        Raises:
            InputError: times for light that stays as it is.
        """
        given = told(self)
        if given and expanded(light_field).exists() and not is_video(light_field):
            raise InputError(f"{light_field} is no video, and stays as it is: leave out {', '.join(given)}")

    def of(self, video: StoredVideo) -> tuple[float, float]:
        """(start, length) of the exposure, seconds.

        Raises:
            InputError: nothing is said of it, or the video has no frame.
        """
        if not video:
            raise InputError(f"{video.path} is a video that has no frame yet")
        first, last = video.times[0], video.times[-1]
        if not told(self):
            raise InputError(
                f'{video.path} is a video from {first:g} s to {last:g} s: say when, --start "{first:g} s" for a '
                'moment, and --exposure-time "10 ms" for longer; or take one of its frames, '
                f"{video.path / video.places[0].name}"
            )
        return first if self.start is None else self.start, self.exposure_time or 0.0
