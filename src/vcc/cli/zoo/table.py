"""``vcc zoo table``: the table of a run."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vcc.cli.console import check_output, show
from vcc.cli.options import Output
from vcc.sweeps.table import ENDINGS
from vcc.zoo import Report


def table(
    store: Annotated[Path, Parameter(metavar="STORE")],
    /,
    *,
    task: str = "edof",
    output: Output | None = None,
) -> None:
    """Print the table of a run, with standard errors over scenes and the gains over controls.

    Examples:
        vcc zoo table zoo.zarr
        vcc zoo table zoo.zarr --task depth -o scores.csv

    Args:
        task: Of the run.
        output: Write all scores here instead, .csv or .parquet: a row for each recording.
    """
    report = Report.of(store, task)
    if output is None:
        show(report.markdown())
        return
    path, rows = check_output(output, ENDINGS), report.table()
    rows.save(path)
    show(f"{path}: {len(rows)} rows of {len(rows.columns)} columns")
