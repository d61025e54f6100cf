"""``vcc zoo run``: score cameras, scenes and decoders."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vcc.cli.console import progress, show
from vcc.cli.executing import Who, opened
from vcc.cli.options import Output, Whole
from vcc.zoo import run as run_zoo
from vcc.zoo.scenes import BUILT_IN

Many = Parameter(negative=(), consume_multiple=False)


def run(
    *,
    task: str,
    output: Output,
    scene: Annotated[tuple[str, ...], Parameter(metavar="NAME|PATH"), Many] = (),
    seeds: Whole = 2,
    camera: Annotated[tuple[Path, ...], Parameter(metavar="FILE"), Many] = (),
    decoder: Annotated[tuple[str, ...], Parameter(metavar="FILE.py:FUNCTION"), Many] = (),
    without: Annotated[tuple[str, ...], Parameter(metavar="NAME"), Many] = (),
    executor: Who = None,
) -> None:
    """Score cameras, scenes and decoders for a task, with controls of the same light.

    Results are kept by content: the same command resumes an interrupted run, and a new camera or decoder adds
    only its own results.

    Examples:
        vcc zoo run --task edof -o zoo.zarr
        vcc zoo run --task edof -o zoo.zarr --camera my.toml --decoder my.py:decode
        vcc zoo run --task light-field -o zoo.zarr --seeds 3
        vcc zoo run --task depth -o zoo.zarr --scene leaves-7 --scene views.zarr --executor processes

    Args:
        task: edof: a picture all in focus. depth: the distance of each pixel. light-field: 5×5 views. refocusing:
            pictures focused at 5 distances. spectrum: 26 bands of each pixel.
        output: A folder, .zarr. The same command resumes an interrupted run; another one adds to it.
        scene: drawn, leaves-N (N is a seed), or the path of a light field, a store or splats. May be repeated.
            Default: drawn, leaves-1, leaves-2.
        seeds: Recordings of each scene at each light level.
        camera: Your camera file, compared with the controls of the task. May be repeated.
        decoder: Your function of a recording. May be repeated.
        without: A decoder or a camera to leave out. May be repeated.
        executor: What runs the trials: `processes` or `threads`, one per core of this machine, or a Dask cluster
            by its scheduler, "dask://host:8786". Default: one after the other.
    """
    with opened(executor) as running, progress("Scoring") as advance:
        made = run_zoo(
            task,
            output,
            scenes=scene or BUILT_IN,
            seeds=seeds,
            cameras=camera,
            own_decoders=decoder,
            without=without,
            executor=running,
            progress=advance,
        )
    show(f"{output}: {made} new results of the task {task}; vcc zoo table {output} --task {task} shows them all")
