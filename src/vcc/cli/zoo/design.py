"""``vcc zoo design``: learn a code and a decoder together, and decoders for its controls."""

from typing import Literal

from vcc.base import lazy_import
from vcc.cli.console import progress, show
from vcc.cli.options import OutputFolder, Whole


def design(
    *,
    task: str,
    output: OutputFolder,
    light: float = 0.25,
    cells: Whole = 14,
    feature: Whole = 2,
    symmetry: Literal["none", "left-right", "both"] = "both",
    seeds: Whole = 3,
    steps: Whole = 500,
    batch: Whole = 3,
    scenes: Whole = 32,
    validation: Whole = 4,
) -> None:
    """Learn an aperture code and its decoder together, and decoders of its controls: the round stop of its
    light, a random code, and the open square.

    The code can be made: it is binary and symmetric, and has an exact number of open cells and no smaller
    hole or bar than stated. The same command resumes an interrupted design. vcc zoo run scores it.

    Examples:
        vcc zoo design --task edof -o design
        vcc zoo design --task edof -o design --light 0.1 --symmetry left-right --seeds 5

    Args:
        task: edof: a picture all in focus.
        output: A folder. The same command resumes an interrupted design.
        light: Of the open square, that the code and its round stop pass: 0.25 is 25 %.
        cells: Of the code, across and down: 7, 13, 14, 26 or 28.
        feature: Side of the smallest hole and of the smallest bar, cells.
        symmetry: Of the code: none, left-right, or both left-right and up-down.
        seeds: Repetitions with other first codes, weights, orders of scenes and noise.
        steps: Of training, for each camera and seed.
        batch: Scenes in a step.
        scenes: To train with: leaves-1001 and so on.
        validation: Scenes that are only scored: leaves-2001 and so on.
    """
    learned = lazy_import.module("vcc.zoo.torch_design")
    plan = learned.Design(task, light, cells, feature, symmetry, seeds, steps, batch, scenes, validation)
    with progress("Learning") as advance:
        found = learned.designed(output, plan, advance)
    seconds = sum(each.seconds for each in found)
    show(f"PSNR [dB] on {validation} validation scenes, mean of {seeds} seeds ± standard error:\n")
    show(learned.table(found))
    cameras = " ".join(
        f"--camera {output}/learned-{n}.toml --camera {output}/random-{n}.toml" for n in range(seeds)
    )
    decoders = " ".join(f"--decoder {output}/decoder.py:decode_{n}" for n in range(seeds))
    show(f"\n{seconds / 60:.1f} processor minutes of training. On test scenes:\n")
    show(f"vcc zoo run --task {task} -o {output}/zoo.zarr {cameras} {decoders}")
