"""``vcc sweep``: many cameras before one light field."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Group, Parameter

from vcc.base.errors import InputError
from vcc.camera_file import load_camera
from vcc.cli.console import DRAWINGS, check_output, progress, save_figure, show
from vcc.cli.executing import Who, opened
from vcc.cli.options import (
    CameraFile,
    File,
    Length,
    LightFieldFile,
    Making,
    Number,
    Output,
    Reading,
    Whole,
    quantity,
)
from vcc.fields.samples import Samples
from vcc.image import load_image
from vcc.run.serialization import check_portable
from vcc.sweeps import PSNR, DeblurringError, Design, contact_sheet, sharpness
from vcc.sweeps import sweep as swept_by
from vcc.sweeps.design import Kind
from vcc.sweeps.table import ENDINGS

TOLD = Group("The table", sort_key=1.5)


def by_name(settings: tuple[tuple[str, str], ...]) -> dict[str, str]:
    """The values of --set by the name of the parameter.

    Raises:
        InputError: a parameter is given twice.
    """
    for name, _ in settings:
        if [each for each, _ in settings].count(name) > 1:
            raise InputError(f"--set {name} is given more than once: give all its values in one")
    return dict(settings)


def setting(text: str, option: str) -> tuple[str, str]:
    """The name of a parameter and its values, from NAME=VALUES."""
    name, equals, values = text.partition("=")
    if not (equals and name.strip() and values.strip()):
        raise InputError(f'{option} is "{text}": it is a name and values, like "sensor.z=50mm:54mm:40"')
    return name.strip(), values.strip()


@Parameter(name="*", group=TOLD)
@dataclass(frozen=True, kw_only=True)
class Told:
    """Columns of the table, in addition to each image's mean, missing rays and sampling error.

    Args:
        sharpness: The energy of the image's gradient over that of its mean.
        target: PSNR against this image, .exr, .npy, .png or .tif that vcc wrote.
        deblurring: R(K), the expected error of deblurring a point at this distance, "2 m" (Zhou and Nayar
            2009).
        noise: For R(K): standard deviation of the noise, for images from 0 to 1.
    """

    sharpness: bool = False
    target: File | None = None
    deblurring: Length | None = None
    noise: Number = 0.01

    @property
    def metrics(self) -> dict[str, Any]:
        """Functions of an image by name."""
        found: dict[str, Any] = {"sharpness": sharpness} if self.sharpness else {}
        if self.target is not None:
            found["psnr"] = PSNR(load_image(self.target))
        if self.deblurring is not None:
            found["deblurring_error"] = DeblurringError(self.deblurring, self.noise)
        return found


def _check_portable(light_field: Samples, path: Path) -> None:
    """Check that a light field in memory is small enough to be sent to tasks.

    Raises:
        InputError: it is too large.
    """
    try:
        check_portable(light_field)
    except InputError as error:
        raise InputError(
            f"{path} is too large to be sent to all tasks: convert it with vcc convert {path} scene.zarr to a "
            "store, which each task reads itself, or leave --executor out"
        ) from error


def sweep(
    camera: CameraFile,
    light_field: LightFieldFile,
    /,
    *,
    set: Annotated[tuple[tuple[str, str], ...], quantity("NAME=VALUES", setting, repeated=True)],
    output: Output,
    design: Kind = "grid",
    count: Whole | None = None,
    seed: Whole = 0,
    table: File | None = None,
    sheet: File | None = None,
    told: Told = Told(),
    how: Making = Making(),
    executor: Who = None,
    reading: Reading = Reading(),
) -> None:
    """Capture the images of many cameras: a camera file with varied parameters.

    Images and a table are saved in a Zarr group for xarray; the same command resumes an interrupted sweep.

    Examples:
        vcc sweep camera.toml views/ --set "sensor.z=50mm:54mm:9" --set "code.pattern=mura,circle" -o all.zarr
        vcc sweep camera.toml views/ --set "sensor.z=50mm:54mm" --design sobol -o table.csv --sharpness
        vcc sweep camera.toml views/ --set "sensor.z=50mm:54mm:9" -o all.zarr --sheet all.png --table all.csv

    Args:
        set: A parameter, named by its element and its own name, and its values: a range
            "sensor.z=50mm:54mm:40" or a list "code.pattern=mura,circle,code.png"; patterns as in a camera
            file, or by name alone, as large as the mask. May be repeated. random and sobol also accept an
            interval, "sensor.z=50mm:54mm".
        output: Images and table, .zarr; the same command resumes an interrupted sweep. Or the table alone,
            .csv or .parquet.
        design: grid: every combination; list: the first values of all, then the second; random, sobol: drawn.
        count: Number of cameras to draw. Default: 64.
        seed: Of the draw.
        table: Also write the table here, .csv or .parquet.
        sheet: Draw the images side by side, .png, .svg or .pdf.
        executor: What makes the images, some cameras per task: `processes` or `threads`, one per core of this
            machine, or a Dask cluster by its scheduler, "dask://host:8786". Each task uses one thread and a
            memory limit of its own. The light field must be in a store, or take at most 64 MiB. Default: one
            camera after the other, on all cores.
    """
    settings = by_name(set)
    output = check_output(output, (".zarr", *ENDINGS)) if output.suffix != ".zarr" else output.expanduser()
    stored = output.suffix.lower() == ".zarr"
    table = None if table is None else check_output(table, ENDINGS)
    sheet = None if sheet is None else check_output(sheet, DRAWINGS)
    if sheet is not None and not stored:
        raise InputError("--sheet shows images, and a table alone keeps none: let --output end in .zarr")
    optics = load_camera(camera)
    asked = Design(settings, design, count, seed, camera.parent)
    asked.of(optics)  # checked before the light field is read
    field, metrics = reading.light_field(light_field), told.metrics
    if executor is not None:
        _check_portable(field, light_field)
    kept = {"output": output} if stored else {"pictures": False}
    with opened(executor) as running, progress("Sweeping") as advance:
        swept = swept_by(optics, field, asked, how, metrics=metrics, executor=running, progress=advance, **kept)
    if stored:
        sizes = "×".join(map(str, swept.pictures.shape[len(swept.shape) :]))
        show(f"{output}: {len(swept)} pictures of {sizes}, {' × '.join(swept.axes)}")
    for path in (None if stored else output, table):
        if path is not None:
            swept.table.save(path)
            show(f"{path}: {len(swept)} rows of {len(swept.table.columns)} columns")
    if sheet is not None:
        save_figure(contact_sheet(swept), sheet)
