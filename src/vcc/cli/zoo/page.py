"""``vcc zoo page``: the page of a run."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vcc.cli.console import make_folder, show
from vcc.cli.options import OutputFolder
from vcc.zoo import Report


def page(
    store: Annotated[Path, Parameter(metavar="STORE")],
    /,
    *,
    task: str = "edof",
    output: OutputFolder = Path("vcc-zoo"),
) -> None:
    """Write a page of a run: tables, quality over light, and a strip of pictures.

    Examples:
        vcc zoo page zoo.zarr -o page

    Args:
        task: Of the run.
        output: Folder of the page.
    """
    report = Report.of(store, task)
    show(f"{report.write(make_folder(output))}: written")
