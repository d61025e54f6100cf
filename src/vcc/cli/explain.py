"""``vcc explain``: how an image would be made."""

from vcc.cli.console import show
from vcc.cli.executing import Executing
from vcc.cli.options import CameraFile, LightFieldFile, Making, Reading
from vcc.motion import load_moving_camera


def explain(
    camera: CameraFile,
    light_field: LightFieldFile,
    /,
    *,
    how: Making = Making(),
    executing: Executing = Executing(),
    reading: Reading = Reading(),
) -> None:
    """Report how an image is made, what it costs, and which limits apply."""
    moving = load_moving_camera(camera)
    executing.check(light_field)
    field = reading.light_field(light_field)
    with executing.opened() as executor:
        show(str(moving.explain(field, how, executor=executor)))
