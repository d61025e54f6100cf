"""``vcc demo``: the paper's examples."""

from pathlib import Path

from vcc.cli.console import make_folder
from vcc.cli.options import OutputFolder, ShownLightField
from vcc.demo import run_demo


def demo(
    *,
    output: OutputFolder = Path("vcc-demo"),
    light_field: ShownLightField | None = None,
    small: bool = False,
) -> None:
    """Run the paper's examples and its own check, and explain them on a page of pictures.

    It takes about 20 seconds on two cores, and about 10 with --small.

    Examples:
        vcc demo --small
        vcc demo --light-field views/

    Args:
        output: Folder for the pictures.
        light_field: Your own light field: a folder of views, a file or a store. Default: a scene that the
            demo makes.
        small: Fewer views and pixels, for a quick look.
    """
    from rich.console import Console

    run_demo(make_folder(output), light_field, small, Console())
