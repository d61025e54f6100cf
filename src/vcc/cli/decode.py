"""``vcc decode``: from the raw recording of a computational camera to its light field.

The camera selects the method: lenslets (`decode_lenslets`), or a mask of cosines (`decode_cosines`).
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from cyclopts import Group, Parameter

from vcc import __version__
from vcc.base.errors import InputError
from vcc.camera import Camera
from vcc.camera_file import load_camera
from vcc.cli.console import free_output, progress, show
from vcc.cli.decode_cosines import Cosines, through_a_mask
from vcc.cli.decode_lenslets import Lenslets, through_lenslets
from vcc.cli.options import FolderNames, OutputFile, Overwrite, ViewExposure, exposed, given_options
from vcc.cli.raw_recordings import Recorded
from vcc.formats.writing import kind_of, save_light_field
from vcc.light_field import LightField
from vcc.recover.decoding import way_of


@Parameter(name="*", group=Group("The light field", sort_key=4))
@dataclass(frozen=True, kw_only=True)
class Written:
    """How the light field is written."""

    kind: FolderNames | None = None
    exposure: ViewExposure = 1.0
    overwrite: Overwrite = False


def decode(
    raw: Annotated[
        Path,
        Parameter(
            help="The recording: a picture that states its encoding, as written by vcc expose and vcc capture; "
            "a real camera's, with --transfer and --upside-down or --upright; or a Lytro file, .lfp or .lfr."
        ),
    ],
    /,
    *,
    output: Annotated[OutputFile, Parameter(alias="-o", metavar="OUT")],
    recorded: Recorded = Recorded(),
    lenslets: Lenslets = Lenslets(),
    cosines: Cosines = Cosines(),
    written: Written = Written(),
) -> None:
    """Turn the raw recording of a plenoptic or mask-modulated camera into a light field.

    The positions of lenslets' micro-images come from --centres, --white or --camera. For a mask of cosines,
    the carriers come from --camera.

    Examples:
        vcc decode raw.tif --camera camera.toml -o field.zarr
        vcc decode raw.tif --white white.tif --dark dark.tif --views 9 -o views
        vcc decode photo.lfp --white white.lfp -o field.zarr
        vcc decode raw.png --centres centres.csv --color-filter BGGR -o field.zarr
    """
    output = free_output(output, written.overwrite)
    exposed(written.exposure, kind_of(output, written.kind))  # check the output before the work
    camera = None if recorded.camera is None else load_camera(recorded.camera)
    if camera is not None and way_of(camera) == "cosines":
        _refuse(given_options(lenslets), "for lenslets, and this camera has a mask of cosines")
        field, way = through_a_mask(raw, camera, recorded, cosines)
    else:
        _refuse(given_options(cosines), "for a mask of cosines, and there is none")
        field, way = through_lenslets(raw, camera, recorded, lenslets)
    write(field, output, written, raw)
    show(f"  made of {raw}: {way}")
    show("\n".join(described(field, camera, output)))


def _refuse(options: list[str], why: str) -> None:
    """Raise `InputError` if options were given that do not apply to this camera."""
    if options:
        raise InputError(f"{', '.join(options)} {'is' if len(options) == 1 else 'are'} {why}: leave it out")


def write(field: LightField, output: Path, written: Written, source: Path) -> None:
    """Write a light field and print a summary.

    Args:
        field: the light field.
        output: the path; its ending selects the format.
        written: the options.
        source: the recording.

    Raises:
        InputError: see `vcc.formats.writing.save_light_field`.
    """
    ending = output.suffix.lower()
    options = exposed(written.exposure, kind_of(output, written.kind))
    if ending == ".zarr":
        made = {"decoded_from": source.name, "decoded_by": f"vcc {__version__}, vcc decode"}
        options |= {"provenance": made, "overwrite": written.overwrite}
    with progress("Writing views") as advance:
        show(save_light_field(field, output, kind=written.kind, progress=advance, **options).description)


def described(field: LightField, camera: Camera | None, output: Path) -> list[str]:
    """A summary of a decoded light field, and next steps, in lines."""
    nv, nu, nt, ns = field.shape[:4]
    colour = "grey" if field.channels is None else f"{field.channels} channels"
    metric = "" if camera else "; not metric without --camera: disparities are right, distances are not"
    return [
        f"  views    {nv}×{nu} of {ns}×{nt} pixels, {colour}",
        f"  cameras  {field.grid.geometry}{metric}",
        f"  next     vcc info {output}  ·  vcc refocus {output} --all-in-focus -o sharp.png",
    ]
