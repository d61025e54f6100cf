"""The commands of ``vcc``: each reads its input, calls the library and says what came of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from vcc.base.errors import InputError
from vcc.cli import decode as decoding
from vcc.cli import options as given
from vcc.cli import refocus as refocusing
from vcc.cli import synth_blender, synth_depth, synth_opengl  # noqa: F401
from vcc.cli.console import Commands, check_output, make_folder, progress, show
from vcc.cli.gallery import EPILOG as GALLERY_EPILOG
from vcc.cli.gallery import gallery
from vcc.cli.spectrum import EPILOG as SPECTRUM_EPILOG
from vcc.cli.spectrum import spectrum
from vcc.cli.synth import synth

if TYPE_CHECKING:
    from matplotlib.figure import Figure, SubFigure


_STORING = "Making a store"
SAMPLES_WORTH_A_BAR = 3e8
"""Below this, a picture takes less than a second, and asking for progress would only slow it down."""

app = typer.Typer(
    cls=Commands,
    name="vcc",
    help="Virtual Computational Camera: what would a camera with unconventional optics record? "
    "Give it a light field and a camera file, get the picture on its sensor.",
    epilog="Try:  vcc demo  ·  Help on a command:  vcc capture --help",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


def _show_version(wanted: bool) -> None:
    if wanted:
        from vcc import __version__

        show(f"vcc {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit."),
    ] = False,
) -> None:
    pass


@app.command(
    epilog='Example:  vcc capture camera.toml views/ -o picture.png --spacing "1 mm"\n\n'
    "Example:  vcc capture camera.toml views/ -o picture.exr --interpolation cubic"
)
def capture(
    camera: given.CameraFile,
    light_field: given.LightFieldFolder,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The picture: .png and .tif are for people (sRGB); .exr and .npy hold linear values untouched.",
            show_default=False,
        ),
    ],
    exposure: Annotated[
        str,
        typer.Option(
            metavar="NUMBER",
            help="Factor from irradiance to the brightness of a .png or .tif. auto shows the "
            "brightest parts white and says which factor that took.",
        ),
    ] = "auto",
    as_recorded: Annotated[
        bool,
        typer.Option("--as-recorded", help="Leave the picture upside down, as it lies on the sensor."),
    ] = False,
    method: given.Method = "auto",
    interpolation: given.Interpolation = "sharp",
    between_views: given.BetweenViews = "auto",
    scene_distance: given.SceneDistance = None,
    refine: given.Refine = "auto",
    samples: given.Samples = None,
    tolerance: given.Tolerance = None,
    ray_seed: given.RaySeed = 0,
    engine: given.Engine = "numba",
    memory_limit: given.MemoryLimit = None,
    transfer: given.Transfer = "auto",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
) -> None:
    """Make the picture that a camera records of a light field."""
    factor, limit = given.exposure_of(exposure), given.memory_size(memory_limit)
    how = given.how_made(
        method=method,
        interpolation=interpolation,
        between_views=between_views,
        scene_distance=scene_distance,
        refine=refine,
        samples=samples,
        ray_seed=ray_seed,
    )
    from vcc.files.camera_file import load_camera
    from vcc.files.pictures import WRITE_ENDINGS

    output = check_output(output, WRITE_ENDINGS)
    optics = load_camera(camera)
    field = given.read_light_field(light_field, transfer, spacing, slope_per_pixel, focus_distance, orientation)
    plan = optics.compile(field, **how)
    from vcc.light_field import LightField

    in_memory = isinstance(field, LightField)
    expensive = not in_memory or plan.samples_touched * (field.channels or 1) > SAMPLES_WORTH_A_BAR
    with progress("Capturing") as advance:
        image = optics.capture(
            field,
            **how,
            tolerance=tolerance,
            engine=engine,
            memory_limit=limit,
            progress=advance if expensive else None,
        )
    show(image.save(output, exposure=factor, upright=not as_recorded).description)


@app.command(
    epilog='Example:  vcc expose camera.toml views/ -o raw.tif --exposure "10 ms" --seed 1\n\n'
    "Example:  vcc expose camera.toml views/ -o raw.npy --picture picture.png"
)
def expose(
    camera: given.CameraFile,
    light_field: given.LightFieldFolder,
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The raw numbers, .tif, .png or .npy: linear, not scaled, upside down as recorded.",
            show_default=False,
        ),
    ],
    exposure: Annotated[
        str,
        typer.Option(
            metavar="TIME",
            help='Exposure time, "10 ms". auto brings the brightest 0.1 % of the pixels to 90 % of saturation.',
        ),
    ] = "auto",
    seed: Annotated[int, typer.Option(metavar="NUMBER", help="Of the sensor's noise, 0 or more.")] = 0,
    radiance: Annotated[
        float,
        typer.Option(
            metavar="NUMBER", help="What the light field's white (a value of 1) stands for, in W/(m² sr)."
        ),
    ] = 1.0,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write also a picture of it for people, demosaiced and upright; or linear, .exr and .npy.",
            show_default=False,
        ),
    ] = None,
    method: given.Method = "auto",
    interpolation: given.Interpolation = "sharp",
    between_views: given.BetweenViews = "auto",
    scene_distance: given.SceneDistance = None,
    refine: given.Refine = "auto",
    samples: given.Samples = None,
    tolerance: given.Tolerance = None,
    ray_seed: given.RaySeed = 0,
    engine: given.Engine = "numba",
    memory_limit: given.MemoryLimit = None,
    transfer: given.Transfer = "auto",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
) -> None:
    """Record a light field as a real sensor would: photons, electrons, noise, raw numbers.

    The camera file says how the sensor does so, in a table sensor.electronics.
    """
    time, limit = given.exposure_time(exposure), given.memory_size(memory_limit)
    how = given.how_made(
        method=method,
        interpolation=interpolation,
        between_views=between_views,
        scene_distance=scene_distance,
        refine=refine,
        samples=samples,
        ray_seed=ray_seed,
    )
    from vcc.files.camera_file import load_camera
    from vcc.files.pictures import RAW_ENDINGS, WRITE_ENDINGS
    from vcc.run.recording import electronics_of

    output = check_output(output, RAW_ENDINGS)
    if picture is not None:
        picture = check_output(picture, WRITE_ENDINGS)
    optics = load_camera(camera)
    electronics_of(optics.sensor)  # refused before the light field is read
    field = given.read_light_field(light_field, transfer, spacing, slope_per_pixel, focus_distance, orientation)
    recording = optics.expose(
        field,
        time,
        seed=seed,
        radiance=radiance,
        ray_seed=how.pop("seed"),
        **how,
        tolerance=tolerance,
        engine=engine,
        memory_limit=limit,
    )
    show(recording.save(output).description)
    if picture is not None:
        mosaic = recording.electronics.color_filter is not None
        show((recording.demosaiced() if mosaic else recording.image()).save(picture).description)


@app.command(epilog="Example:  vcc explain camera.toml views/")
def explain(
    camera: given.CameraFile,
    light_field: given.LightFieldFolder,
    method: given.Method = "auto",
    interpolation: given.Interpolation = "sharp",
    between_views: given.BetweenViews = "auto",
    scene_distance: given.SceneDistance = None,
    refine: given.Refine = "auto",
    samples: given.Samples = None,
    tolerance: given.Tolerance = None,
    ray_seed: given.RaySeed = 0,
    engine: given.Engine = "numba",
    memory_limit: given.MemoryLimit = None,
    transfer: given.Transfer = "auto",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
) -> None:
    """Say how a picture would be made, what it costs and what to beware of."""
    how = given.how_made(
        method=method,
        interpolation=interpolation,
        between_views=between_views,
        scene_distance=scene_distance,
        refine=refine,
        samples=samples,
        ray_seed=ray_seed,
    )
    from vcc.files.camera_file import load_camera

    optics = load_camera(camera)
    field = given.read_light_field(light_field, transfer, spacing, slope_per_pixel, focus_distance, orientation)
    limit = given.memory_size(memory_limit)
    words = optics.explain(field, **how, tolerance=tolerance, engine=engine, memory_limit=limit)
    show(str(words))


@app.command(
    epilog="Example:  vcc info views/\n\nExample:  vcc info views/ --quick\n\n"
    "Example:  vcc info views/ --picture grid.png"
)
def info(
    light_field: given.LightFieldFolder,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="Read one view only: nothing is measured, and no view compared."),
    ] = False,
    picture: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Draw all views where their cameras stand, .png, .svg or .pdf.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Say what a light field is: views, cameras, disparities, brightness, and what its files leave open."""
    from vcc.cli.info import describe

    if picture is not None:
        picture = check_output(picture, (".png", ".svg", ".pdf"))
    show(describe(light_field, quick, picture))


@app.command(
    epilog="Example:  vcc plot camera.toml -o camera.svg\n\n"
    "Example:  vcc plot camera.toml --phase-space --light-field views/"
)
def plot(
    camera: given.CameraFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="The drawing, .png, .svg or .pdf. Default: the camera file's name with .png, here.",
            show_default=False,
        ),
    ] = None,
    object_distance: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LENGTH",
            help='Distance of a point to draw rays from, "1.2 m", or inf; may be repeated. Default: '
            "the distance in focus and a nearer one.",
            show_default=False,
        ),
    ] = None,
    across: Annotated[Literal["x", "y"], typer.Option(help="The axis drawn upwards.")] = "x",
    light_field: Annotated[
        Path | None,
        typer.Option(
            metavar="LIGHTFIELD",
            help="A folder of views: rays fill its width; --phase-space draws it.",
            show_default=False,
        ),
    ] = None,
    phase_space: Annotated[
        bool,
        typer.Option(
            "--phase-space",
            help="Draw the u–s diagram of the light field instead: at the entrance, behind each "
            "element, on the sensor.",
        ),
    ] = False,
    slice_across: Annotated[
        str | None,
        typer.Option(
            "--slice",
            metavar="NAMES",
            help="With --phase-space: two of u, v, s and t to draw, such as uv; the other two are held at the "
            "light field's middle. Default: us, or vt with --across y.",
            show_default=False,
        ),
    ] = None,
    transfer: given.Transfer = "auto",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
) -> None:
    """Draw a camera from the side with rays, or a light field's way through it in phase space."""
    if phase_space and light_field is None:
        raise InputError("--phase-space draws a light field: give it with --light-field FOLDER")
    if slice_across is not None and not phase_space:
        raise InputError("--slice chooses what --phase-space draws: give --phase-space too")
    target = check_output(output or Path(f"{camera.stem}.png"), (".png", ".svg", ".pdf"))
    distances = [given.length(each, "--object-distance") or 0.0 for each in object_distance or []]
    from vcc.files.atomic import atomic_path
    from vcc.files.camera_file import load_camera
    from vcc.plot import plot_camera, plot_phase_space_stages

    optics = load_camera(camera)
    field = None
    if light_field is not None:
        found = given.read_light_field(
            light_field, transfer, spacing, slope_per_pixel, focus_distance, orientation
        )
        from vcc.light_field import LightField

        field = found if isinstance(found, LightField) else found.read()
    if phase_space and field is not None:
        names = slice_across or ("us" if across == "x" else "vt")
        stages = plot_phase_space_stages(optics, field, across=names)
        figure: Figure | SubFigure = stages
    else:
        axes = plot_camera(optics, light_field=field, object_distances=distances or None, across=across)
        figure = axes.figure
    with atomic_path(target) as temporary:
        figure.savefig(temporary)  # type: ignore[union-attr]  # a new figure is no part of another
    show(f"{target}: written")


@app.command(epilog="Example:  vcc demo --small\n\nExample:  vcc demo --light-field views/")
def demo(
    output: Annotated[
        Path,
        typer.Option("--output", "-o", metavar="FOLDER", help="Where the pictures go."),
    ] = Path("vcc-demo"),
    light_field: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER",
            help="A light field of your own: a folder with a picture for each view. Default: a scene "
            "that the demo makes.",
            show_default=False,
        ),
    ] = None,
    small: Annotated[bool, typer.Option("--small", help="Fewer views and pixels: a look in seconds.")] = False,
) -> None:
    """Run the paper's examples and its own check, and explain them on a page of pictures."""
    folder = make_folder(output)
    from rich.console import Console

    from vcc.demo import run_demo

    run_demo(folder, light_field, small, Console())


@app.command(
    epilog='Example:  vcc convert views/ scene.zarr --spacing "1 mm"\n\n'
    "Example:  vcc convert views/ small.zarr --lossy jpegxl --quality 90\n\n"
    "Example:  vcc convert scene.zarr half.zarr --dtype float16\n\n"
    "Example:  vcc convert scene.zarr flight.mp4"
)
def convert(
    light_field: given.LightFieldFolder,
    output: Annotated[
        Path,
        typer.Argument(
            metavar="OUT",
            help="What to make: a store (.zarr); or .npz, .mat, .png (ESLF), .mp4 (a flight through the views), a "
            "folder (no ending).",
            show_default=False,
        ),
    ],
    dtype: Annotated[
        Literal["uint8", "uint16", "float16", "float32"] | None,
        typer.Option(
            help="What samples are stored as: uint8 and uint16 as sRGB codes where they were not integers before, "
            "float16 and float32 as linear light. Default: as they are, bit for bit.",
            show_default=False,
            rich_help_panel=_STORING,
        ),
    ] = None,
    compression: Annotated[
        Literal["zstd", "lz4"] | None,
        typer.Option(
            help="Lossless: zstd (the default) packs more, lz4 is faster.",
            show_default=False,
            rich_help_panel=_STORING,
        ),
    ] = None,
    level: Annotated[
        int | None,
        typer.Option(
            metavar="NUMBER",
            help="Of lossless packing, 0 (fast) to 9 (small). Default: 3.",
            show_default=False,
            rich_help_panel=_STORING,
        ),
    ] = None,
    lossy: Annotated[
        Literal["jpegxl", "avif"] | None,
        typer.Option(
            help="Keep each view as a picture, changed and smaller; how much it is changed is measured and said.",
            show_default=False,
            rich_help_panel=_STORING,
        ),
    ] = None,
    quality: Annotated[
        int | None,
        typer.Option(
            metavar="NUMBER",
            help="With --lossy, 1 (small) to 99 (fine). Default: 90.",
            show_default=False,
            rich_help_panel=_STORING,
        ),
    ] = None,
    chunks: Annotated[
        int | None,
        typer.Option(
            metavar="ROWS",
            help="Rows of pixels packed together: with fewer, parts of a view cost less to read. Default: 128 kB.",
            show_default=False,
            rich_help_panel=_STORING,
        ),
    ] = None,
    kind: Annotated[
        Literal["hci", "views"] | None,
        typer.Option(
            help="Names of views in a folder: as the HCI benchmark has them (the default), or row and column.",
            show_default=False,
        ),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what has that name.")] = False,
    transfer: Annotated[
        Literal["auto", "srgb", "linear"],
        typer.Option(
            help="How pixel values of the views stand for light: srgb, as pictures for people do, or linear. "
            "auto takes what the format has. A store keeps it, and is read as linear light.",
            rich_help_panel="Reading the light field",
        ),
    ] = "auto",
    spacing: given.Spacing = None,
    slope_per_pixel: given.SlopePerPixel = None,
    focus_distance: given.FocusDistance = None,
    orientation: given.Orientation = "auto",
    views: Annotated[
        tuple[int, int] | None,
        typer.Option(
            metavar="ROWS COLUMNS",
            help="Of views, where file names only count on, or one picture holds all views. Default: found out.",
            show_default=False,
            rich_help_panel="Reading the light field",
        ),
    ] = None,
    order: Annotated[
        Literal["row-major", "column-major", "serpentine", "serpentine-columns"] | None,
        typer.Option(
            help="In which names that only count on go through the views. Default: found out by parallax.",
            show_default=False,
            rich_help_panel="Reading the light field",
        ),
    ] = None,
    every: Annotated[
        int | None,
        typer.Option(
            metavar="NUMBER",
            help="Of a video, take each so-many-th frame as a view. Default: all.",
            show_default=False,
            rich_help_panel="Reading the light field",
        ),
    ] = None,
) -> None:
    """Put a light field into a store (Zarr), or into files of another format.

    A store keeps samples bit for bit, with their cameras, opens at once and is read in parts: a camera takes a
    picture of it in whatever memory there is (--memory-limit). It appears when it is whole.
    """
    from vcc.cli.convert import Reading, to_file, to_store

    layout = {"views": views, "order": order, "every": every}
    layout = {name: value for name, value in layout.items() if value is not None}
    reading = Reading(transfer, spacing, slope_per_pixel, focus_distance, orientation, layout)
    storing = {"--dtype": dtype, "--compression": compression, "--level": level, "--lossy": lossy}
    storing |= {"--quality": quality, "--chunks": chunks}
    if output.suffix.lower() != ".zarr":
        if wrong := [name for name, value in storing.items() if value is not None]:
            raise InputError(
                f"{', '.join(wrong)} {'is' if len(wrong) == 1 else 'are'} for stores: end OUT in .zarr"
            )
        show(to_file(light_field, output, kind=kind, overwrite=overwrite, reading=reading))
        return
    if lossy and (compression or level is not None):
        raise InputError("--compression and --level are for lossless packing: leave them out with --lossy")
    if quality is not None and not lossy:
        raise InputError("--quality is for --lossy: say jpegxl or avif")
    if kind:
        raise InputError("--kind is for folders of views: OUT is a store")
    packing = (
        (lossy, 90 if quality is None else quality)
        if lossy
        else (compression or "zstd", 3 if level is None else level)
    )
    show(
        to_store(
            light_field,
            output,
            dtype=dtype,
            packing=packing,
            chunks=chunks,
            overwrite=overwrite,
            reading=reading,
        )
    )


# In the order in which --help shows them.
app.command(epilog=decoding.EPILOG)(decoding.decode)
app.command(epilog=refocusing.EPILOG)(refocusing.refocus)
app.command(epilog=SPECTRUM_EPILOG)(spectrum)
app.command(epilog=GALLERY_EPILOG)(gallery)
app.add_typer(synth)
