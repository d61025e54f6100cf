"""``vcc synth mitsuba``: any scene of Mitsuba 3."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from vcc.base.errors import InputError
from vcc.cli.synth.rendering import (
    HOW,
    Samples,
    SampleType,
    Seed,
    Store,
    Unit,
    Variant,
    ViewsAndPixels,
    check_store,
    make,
)
from vcc.sources.mitsuba import MitsubaRenderer


def mitsuba(
    scene: Path,
    /,
    *,
    output: Store,
    where: ViewsAndPixels = ViewsAndPixels(),
    unit: Unit = 1.0,
    set: Annotated[list[str] | None, Parameter(metavar="NAME=VALUE", group=HOW)] = None,
    samples: Samples = 64,
    seed: Seed = 0,
    variant: Variant = "auto",
    dtype: SampleType = "float16",
) -> None:
    """Render any scene of Mitsuba 3. Its own sensor defines the position and direction of the middle view.

    Examples:
        vcc synth mitsuba scene.xml -o out.zarr --views 20 20 --pixels 500 500 --aperture "20 mm" --field-of-view
            "40 deg" --focus-distance "1.3 m" --samples 64

    Args:
        scene: A scene of Mitsuba 3, .xml.
        set: A value for $NAME in the scene's file. May be given more than once.
    """
    parameters = _parameters(set or [])
    output, cameras = check_store(output), where.cameras()
    renderer = MitsubaRenderer(
        scene, samples=samples, variant=variant, seed=seed, metres_per_unit=unit, parameters=parameters
    )
    make(renderer, cameras, output, dtype)


def _parameters(settings: list[str]) -> dict[str, str]:
    """Names and values of --set."""
    for setting in settings:
        if "=" not in setting:
            raise InputError(f'--set is "{setting}": write NAME=VALUE')
    return dict(setting.split("=", 1) for setting in settings)
