"""``vcc synth demo``: built-in scenes."""

from dataclasses import dataclass
from typing import Literal

from vcc.cli.console import show
from vcc.cli.options import Length, Lengths
from vcc.cli.synth.rendering import (
    Angle,
    Samples,
    SampleType,
    Seed,
    Store,
    Variant,
    ViewsAndPixels,
    check_store,
    make,
)
from vcc.sources.mitsuba import MitsubaRenderer, demo_scene


@dataclass(frozen=True, kw_only=True)
class ViewsOfScene(ViewsAndPixels):
    """Where the views are.

    Args:
        aperture: Side of the square that the views fill. Default: set by the scene.
        field_of_view: Angle that the width of a view spans. Default: set by the scene.
        focus_distance: Where the views converge, or inf for parallel. Default: set by the scene.
    """

    aperture: Lengths | None = None
    field_of_view: Angle | None = None
    focus_distance: Length | None = None


def demo(
    name: Literal["still-life", "columns", "lamps"],
    /,
    *,
    output: Store,
    where: ViewsOfScene = ViewsOfScene(),
    samples: Samples = 64,
    seed: Seed = 0,
    variant: Variant = "auto",
    dtype: SampleType = "float16",
) -> None:
    """Render a built-in scene with Mitsuba: glass, gold and gloss, at several depths.

    The example takes about two minutes on two cores, and three times as long without LLVM 16 or newer.

    Examples:
        vcc synth demo still-life -o still-life.zarr --views 9 9 --pixels 200 300

    Args:
        name: The scene.
    """
    output, scene = check_store(output), demo_scene(name)
    cameras = where.cameras(
        aperture=scene.aperture, field_of_view=scene.field_of_view, focus_distance=scene.focus_distance
    )
    renderer = MitsubaRenderer(scene.scene, samples=samples, variant=variant, seed=seed)
    show(f"{scene.name}: {scene.summary}")
    make(renderer, cameras, output, dtype)
