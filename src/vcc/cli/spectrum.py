"""``vcc spectrum``: the 4-D spectrum of a light field, drawn over two of its coordinates."""

from typing import Literal

from vcc.analysis import fft4, plot_spectrum
from vcc.analysis.spectrum import check_size
from vcc.cli.console import DRAWINGS, check_output, save_figure
from vcc.cli.options import LightFieldFile, Output, Reading, Size
from vcc.light_field import LightField


def spectrum(
    light_field: LightFieldFile,
    /,
    *,
    output: Output,
    across: Literal["us", "vt", "uv", "st", "ut", "vs"] = "us",
    of: Literal["power", "section"] = "power",
    window: Literal["hann", "none"] = "hann",
    memory_limit: Size | None = None,
    reading: Reading = Reading(),
) -> None:
    """Draw the spectrum of a light field: where its detail lies in frequency, and how optics would shear it.

    Examples:
        vcc spectrum views/ -o spectrum.png
        vcc spectrum scene.zarr -o section.svg --across vt --of section

    Args:
        output: The drawing, .png, .svg or .pdf.
        across: The two coordinates; the frequency of the first is horizontal.
        of: power sums over the other two frequencies; section is the plane through their zero.
        window: hann fades views towards their borders, which otherwise appear as a cross.
        memory_limit: Memory for the spectrum, "1.5 GB", at 8 bytes a sample. Default: 4 GiB.
    """
    output = check_output(output, DRAWINGS)
    field = reading.light_field(light_field)
    if not isinstance(field, LightField):
        check_size(field.grid.shape, memory_limit, "the spectrum")  # before reading
        field = field.read()
    pictures_only = [None, None, "hann", "hann"]  # there are too few views to fade across them
    found = fft4(field, pictures_only if window == "hann" else None, memory_limit=memory_limit)
    save_figure(plot_spectrum(found, (across[0], across[1]), of=of).figure, output)
