"""``vcc plot``: a camera from the side, or a light field's path through it."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from vcc.base.errors import InputError
from vcc.camera_file import load_camera
from vcc.cli.console import DRAWINGS, check_output, save_figure
from vcc.cli.options import CameraFile, Output, Reading, ShownLightField, length, quantity
from vcc.plot import plot_camera, plot_phase_space_stages


def plot(
    camera: CameraFile,
    /,
    *,
    output: Output | None = None,
    object_distance: Annotated[tuple[float, ...] | None, quantity("LENGTH", length, repeated=True)] = None,
    across: Literal["x", "y"] = "x",
    light_field: ShownLightField | None = None,
    phase_space: bool = False,
    slice: Annotated[str | None, Parameter(metavar="NAMES")] = None,
    reading: Reading = Reading(),
) -> None:
    """Draw a camera from the side with rays, or the path of a light field through it in phase space.

    Examples:
        vcc plot camera.toml -o camera.svg
        vcc plot camera.toml --phase-space --light-field views/

    Args:
        output: The drawing, .png, .svg or .pdf. Default: the camera file's name with .png, in the current
            folder.
        object_distance: Distance of a point to draw rays from, "1.2 m", or inf; may be repeated. Default: the
            distance in focus and a nearer one.
        across: The axis drawn upwards.
        light_field: A folder of views: rays fill its width; --phase-space draws it.
        phase_space: Draw the u–s diagram of the light field instead: at the entrance, behind each element, on
            the sensor.
        slice: With --phase-space: two of u, v, s and t to draw, such as uv; the other two are fixed at the
            light field's middle. Default: us, or vt with --across y.
    """
    if phase_space and light_field is None:
        raise InputError("--phase-space draws a light field: give it with --light-field FOLDER")
    if slice is not None and not phase_space:
        raise InputError("--slice chooses what --phase-space draws: give --phase-space too")
    target = check_output(output or Path(f"{camera.stem}.png"), DRAWINGS)
    optics = load_camera(camera)
    field = None if light_field is None else reading.in_memory(light_field)
    if phase_space and field is not None:
        save_figure(
            plot_phase_space_stages(optics, field, across=slice or ("us" if across == "x" else "vt")), target
        )
    else:
        axes = plot_camera(optics, light_field=field, object_distances=object_distance, across=across)
        save_figure(axes.figure, target)
