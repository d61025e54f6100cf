"""``vcc capture``: the image that a camera records."""

from vcc.cli.console import by_photodiode, check_output, progress, show
from vcc.cli.executing import OfBlocks, check_blocks, opened
from vcc.cli.options import CameraFile, Factor, LightFieldFile, Making, Output, Reading
from vcc.cli.timing import Timing
from vcc.files.pictures import WRITE_ENDINGS
from vcc.image import PhotodiodeImage
from vcc.motion import load_moving_camera
from vcc.store import StoredVideo

WORTH_A_BAR = 3e8
"""Samples below which an image takes less than a second, so that progress calls would only slow it down."""


def capture(
    camera: CameraFile,
    light_field: LightFieldFile,
    /,
    *,
    output: Output,
    exposure: Factor = "auto",
    as_recorded: bool = False,
    timing: Timing = Timing(),
    how: Making = Making(),
    executor: OfBlocks = None,
    reading: Reading = Reading(),
) -> None:
    """Capture the image that a camera records of a light field.

    For a sensor with photodiodes, the image of each is written next to the output, as NAME_ROW_COLUMN.

    Examples:
        vcc capture camera.toml views/ -o picture.png --spacing "1 mm"
        vcc capture camera.toml views/ -o picture.exr --interpolation cubic
        vcc capture camera.toml scene.zarr -o picture.exr --executor processes
        vcc capture camera.toml video.zarr -o picture.png --start "0.2 s" --exposure-time "20 ms"
        vcc capture moving.toml views/ -o picture.png --exposure-time "90 ms"

    Args:
        output: The image: .png, .tif and .jpg are for viewing (sRGB); .exr and .npy contain linear values.
        exposure: Factor from irradiance to the brightness of a .png or .tif. auto shows the brightest parts
            white and prints the factor.
        as_recorded: Leave the image upside down, as on the sensor.
    """
    output = check_output(output, WRITE_ENDINGS)
    moving = load_moving_camera(camera)
    moves = bool(moving.listed())
    check_blocks(executor, light_field)
    timing.check(light_field, camera, moves)
    field = reading.light(light_field)
    with opened(executor) as running, progress("Capturing") as advance:
        if moves or isinstance(field, StoredVideo):
            start, length = timing.of(field)
            tolerance = timing.time_tolerance
            image = moving.capture(
                field, length, how, start=start, time_tolerance=tolerance, progress=advance, executor=running
            )
        elif moving.camera.sensor.has_parts:
            image = moving.camera.capture(field, how, executor=running, progress=advance)
        else:
            plan = moving.camera.compile(field, how, progress=advance)
            long = field.whole() is None or plan.samples_touched * (field.grid.channels or 1) > WORTH_A_BAR
            bar = advance if long else None
            image = moving.camera.capture(field, how, plan=plan, executor=running, progress=bar)
    saved = image.save(output, exposure=exposure, upright=not as_recorded)
    show(saved.description)
    if isinstance(image, PhotodiodeImage):
        shown = image if as_recorded else image.upright()
        for path, one in by_photodiode(output, shown.photodiodes):
            show(one.save(path, exposure=saved.exposure, upright=not as_recorded).description)
