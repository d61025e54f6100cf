"""``vcc explain``: how an image would be made."""

from vcc.cli.console import show
from vcc.cli.executing import OfBlocks, check_blocks, opened
from vcc.cli.options import CameraFile, LightFieldFile, Making, Reading
from vcc.motion import load_moving_camera


def explain(
    camera: CameraFile,
    light_field: LightFieldFile,
    /,
    *,
    how: Making = Making(),
    executor: OfBlocks = None,
    reading: Reading = Reading(),
) -> None:
    """Report how an image is made, what it costs, and which limits apply.

    Examples:
        vcc explain camera.toml views/
    """
    moving = load_moving_camera(camera)
    check_blocks(executor, light_field)
    field = reading.light_field(light_field)
    with opened(executor) as running:
        show(str(moving.explain(field, how, executor=running)))
