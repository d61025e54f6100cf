"""``vcc synth pbrt``: scenes of PBRT."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vcc.cli.options import Whole
from vcc.cli.synth.rendering import HOW, SampleType, Seed, Store, Unit, ViewsAndPixels, check_store, make
from vcc.sources.pbrt import PbrtRenderer


def pbrt(
    scene: Path,
    /,
    *,
    output: Store,
    where: ViewsAndPixels = ViewsAndPixels(),
    unit: Unit = 1.0,
    samples: Annotated[Whole | None, Parameter(group=HOW)] = None,
    seed: Seed = 0,
    dtype: SampleType = "float16",
) -> None:
    """Render a scene of PBRT by the program pbrt (on the PATH, or named by PBRT in the environment).

    Examples:
        vcc synth pbrt scene.pbrt -o out.zarr --views 9 9 --pixels 400 600 --samples 128

    Args:
        scene: A scene of PBRT version 4, .pbrt.
        samples: Paths per pixel. Default: from the scene's sampler.
    """
    output, cameras = check_store(output), where.cameras()
    make(PbrtRenderer(scene, samples=samples, seed=seed, metres_per_unit=unit), cameras, output, dtype)
