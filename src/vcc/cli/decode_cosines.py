"""``vcc decode`` of recordings through a mask of cosines."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from cyclopts import Group, Parameter
from numpy.typing import NDArray

from vcc.camera import Camera
from vcc.cli.console import progress
from vcc.cli.options import File
from vcc.cli.raw_recordings import Recorded, check_camera, read_raw
from vcc.light_field import LightField
from vcc.optics.electronics import Electronics
from vcc.recover import decode_heterodyne
from vcc.run.demosaic import demosaic


@Parameter(name="*", group=Group("A camera with a mask of cosines", sort_key=3))
@dataclass(frozen=True, kw_only=True)
class Cosines:
    """Options for a camera with a mask of cosines.

    Args:
        calibration: A recording of a white surface through a pinhole in the middle of the aperture. Default:
            simulated.
        border: Share of the sensor, 0 to 0.25, that is faded out at each edge and cut off the views.
    """

    calibration: File | None = None
    border: Annotated[float, Parameter(metavar="SHARE")] = 0.1


def through_a_mask(path: Path, camera: Camera, recorded: Recorded, given: Cosines) -> tuple[LightField, str]:
    """The light field of a camera with a mask of cosines, and a description of the calibration.

    Args:
        path: of the recording.
        camera: the optics.
        recorded: options of the recording.
        given: options of the mask; without a calibration, one is simulated.

    Raises:
        InputError: see `vcc.recover.decode_heterodyne`.
    """
    raw = read_raw(path, camera, None, recorded)
    check_camera(raw, camera, recorded.camera)
    # Recorded by the same camera with a pinhole: its hash differs, so `check_camera` does not apply.
    shadow = None if given.calibration is None else read_raw(given.calibration, camera, None, recorded).light()
    light: NDArray[Any] = raw.light()
    with progress("Decoding"):
        if raw.color_filter is not None:
            light = demosaic(light.astype(np.float32), Electronics(color_filter=raw.color_filter), "bilinear")
        field = decode_heterodyne(
            light, camera, calibration=shadow, border=given.border, memory_limit=recorded.memory_limit
        )
    words = f"spectral tiles rearranged, calibration {'simulated' if shadow is None else 'given'}"
    return field, "; ".join(filter(None, (words, raw.in_words)))
