"""``vcc expose``: the recording of a real sensor."""

from vcc.base.errors import InputError
from vcc.camera_file import load_camera
from vcc.cli.console import by_photodiode, check_output, show
from vcc.cli.executing import OfBlocks, check_blocks, opened
from vcc.cli.options import CameraFile, File, LightFieldFile, Making, Output, Reading, Time, Whole
from vcc.files.pictures import RAW_ENDINGS, WRITE_ENDINGS
from vcc.recording import PhotodiodeRecording


def expose(
    camera: CameraFile,
    light_field: LightFieldFile,
    /,
    *,
    output: Output,
    exposure: Time = "auto",
    seed: Whole = 0,
    radiance: float = 1.0,
    picture: File | None = None,
    how: Making = Making(),
    executor: OfBlocks = None,
    reading: Reading = Reading(),
) -> None:
    """Record a light field as a real sensor would: photons, electrons, noise, raw numbers.

    The camera file describes the sensor in a table sensor.electronics. For a sensor with photodiodes, the
    recording of each is written next to the output, as NAME_ROW_COLUMN.

    Examples:
        vcc expose camera.toml views/ -o raw.tif --exposure "10 ms" --seed 1
        vcc expose camera.toml views/ -o raw.npy --picture picture.png

    Args:
        output: The raw numbers, .tif, .png or .npy: linear, not scaled, upside down as recorded.
        exposure: Exposure time, "10 ms". auto brings the brightest 0.1 % of the pixels to 90 % of saturation.
        seed: Of the sensor's noise, 0 or more.
        radiance: Radiance of the light field's white (a value of 1), in W/(m² sr).
        picture: Also write an image for viewing, demosaiced and upright; linear if .exr or .npy.
    """
    output = check_output(output, RAW_ENDINGS)
    if picture is not None:
        picture = check_output(picture, WRITE_ENDINGS)
    optics = load_camera(camera)
    if optics.sensor.electronics is None:  # checked before the light field is read
        raise InputError(
            f"{camera} has no sensor electronics: add a table [sensor.electronics], which may be empty for an "
            "ordinary sensor. vcc capture computes irradiance without it"
        )
    check_blocks(executor, light_field)
    field = reading.light_field(light_field)
    with opened(executor) as running:
        recording = optics.expose(
            field, exposure, seed=seed, radiance=radiance, ray_seed=how.seed, how=how, executor=running
        )
    show(recording.save(output).description)
    if isinstance(recording, PhotodiodeRecording):
        for path, one in by_photodiode(output, recording.photodiodes):
            show(one.save(path).description)
    if picture is not None:
        mosaic = recording.electronics.color_filter is not None
        show((recording.demosaiced() if mosaic else recording.image()).save(picture).description)
