"""The plan: a camera seen from a light field, reduced to pure numbers for an engine.

    image = after ∘ core ∘ before (samples)

Every step is linear in the samples, so the image is the sum of the images of parts of the samples.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.affine import Affine
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.showing import Shown
from vcc.base.values import Value
from vcc.fields.grid import Block, Grid
from vcc.optics.train import Train
from vcc.plan.depth_rule import ViewsBetween
from vcc.plan.operators import After, AlongAxes, Before, Blur, BlurByChannel, BlurViews, DarkBorder
from vcc.plan.parameters import parameters, with_parameters
from vcc.plan.protocol import Core

NUMBERED = ("core", "before", "after")
"""Fields of a plan that hold the parameters of its image."""


@dataclass(frozen=True, eq=False)
class MadeFor:
    """The camera and the light field that a plan was made for.

    Args:
        train: the optics.
        frame: of the light field.
    """

    train: Train
    frame: Affine


@dataclass(frozen=True, eq=False, repr=False)
class InFocus(Value, Brief):
    """Correction for objects in focus if views are interpolated: the original views show them better.

    Args:
        plan: of the image from the original views.
        share: share of each pixel of the sensor that is taken from this image, (rows, columns), 0 to 1.
    """

    plan: Plan
    share: NDArray[np.float32]


@dataclass(frozen=True, eq=False, repr=False)
class Plan(Value, Shown):
    """Instructions for making the image of a light field.

    Plans of equal content are equal, and can be keys of a cache.

    Args:
        sensor_shape: (rows, columns) of the image.
        grid_shape: (v, u, t, s) of the light field's samples.
        core: turns samples into a raster: `vcc.plan.footprints.model.Footprints` or
            `vcc.plan.rays.model.Rays`.
        before: operators on samples before the core, in order.
        after: operators on the raster, in order.
        views_between: how views in between are synthesized first, or None; the rest of the plan applies to the
            result.
        in_focus: what is taken from the original views if views in between are synthesized, or None.
        missing_rays: share of the requested rays that the light field lacks.
        missing_reason: as text.
        expected_ghosting: largest remaining gap in pixels between neighbouring views' images of the same object.
        cautions: warnings to show to the user before a run, as text.
        notes: decisions and reasons, as text.
        made_for: camera and frame of the light field, for `check_fits`; ignored by comparisons.
    """

    sensor_shape: tuple[int, int]
    grid_shape: tuple[int, ...]
    core: Core
    before: tuple[Before, ...] = ()
    after: tuple[After, ...] = ()
    views_between: ViewsBetween | None = None
    in_focus: InFocus | None = None
    missing_rays: float = 0.0
    missing_reason: str = ""
    expected_ghosting: float = 0.0
    cautions: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    made_for: MadeFor | None = field(default=None, compare=False)

    @property
    def by_rays(self) -> bool:
        """Whether rays are traced, instead of footprints summed."""
        return self.core.method == "rays"

    @property
    def samples_touched(self) -> int:
        """Number of samples that an engine processes, refined samples and repeated reads included."""
        return self.core.samples_touched

    @property
    def reach(self) -> int:
        """Rows of pixels on each side of a block that are read with it."""
        return max((operator.reach for operator in self.before), default=0)

    @property
    def halo(self) -> tuple[tuple[int, int], ...]:
        """Dark samples that are added (before, after) the samples of a piece along (v, u, t, s)."""
        return next((o.halo for o in self.before if isinstance(o, DarkBorder)), ((0, 0),) * 4)

    @property
    def smear(self) -> tuple[float, float]:
        """(vertical, horizontal) half width in pixels of the tent that fills gaps between views; 0 for none."""
        return next((o.half_widths for o in self.after if isinstance(o, AlongAxes)), (0.0, 0.0))

    def shape(self, shape: tuple[int, ...]) -> tuple[int, ...]:
        """The shape of the samples that the core reads, for given samples of a shape (v, u, t, s[, channels])."""
        for operator in self.before:
            shape = operator.shape(shape)
        return shape

    def block(self, block: Block) -> Block:
        """The block of the core's samples that a block of the given samples affects."""
        for operator in self.before:
            block = operator.block(block)
        return block

    def used_views(self, shape: tuple[int, ...]) -> NDArray[np.bool_]:
        """The views of a light field with samples of this shape that are used, (v, u); all if none is used."""
        used = self._of_views(self.core.used_views(self.shape(shape)))
        return used if used.any() else np.ones(shape[:2], dtype=bool)

    def used_pixels(self, shape: tuple[int, ...]) -> NDArray[np.intp]:
        """The pixels of each view of a light field that may be used.

        Args:
            shape: of its samples, (v, u, t, s[, channels]).

        Returns:
            First and stop of rows and of columns: (v, u, 2, 2).
        """
        found = self._of_views(self.core.used_pixels(self.shape(shape)))
        for operator in reversed(self.before):
            found = operator.made_of(found)
        return np.asarray(np.clip(found, 0, np.array(shape[2:4])[:, None]))

    def _of_views(self, found: Any) -> Any:
        """Values for views, (v, u, …), without the dark views that are added around them."""
        (top, bottom), (left, right), *_ = self.halo
        return found[top : found.shape[0] - bottom, left : found.shape[1] - right]

    def kept_as(self, kind: np.dtype[Any]) -> tuple[np.dtype[Any], float]:
        """The type in memory of samples of a NumPy type, and the factor that converts its numbers to samples."""
        factor = 1.0
        for operator in self.before:
            kind, one = operator.kept_as(kind)
            factor *= one
        return (np.dtype(np.float32) if kind == np.float16 else kind), factor  # no float16 in compiled code

    def parameters(self) -> dict[str, NDArray[np.float64]]:
        """The parameters of the core and of the operators around it: ``"core.x"``, ``"after[0].down"``."""
        return {
            name + rest if rest.startswith("[") else f"{name}.{rest}": value
            for name in NUMBERED
            for rest, value in parameters(getattr(self, name)).items()
        }

    def with_parameters(self, changed: Mapping[str, Any]) -> Plan:
        """The same plan with the given parameters changed, by the names of `parameters`."""
        parts: dict[str, dict[str, Any]] = {name: {} for name in NUMBERED}
        for full, value in changed.items():
            name = next(name for name in NUMBERED if full.startswith((f"{name}.", f"{name}[")))
            parts[name][full.removeprefix(name).lstrip(".")] = value
        return replace(
            self, **{name: with_parameters(getattr(self, name), part) for name, part in parts.items() if part}
        )

    def check_fits(self, train: Train, grid: Grid) -> None:
        """Raise an error if the plan was made for something else.

        Raises:
            InputError: another camera, or another shape or frame of light field.
        """
        sensor_shape = train.sensor.shape
        if self.sensor_shape != sensor_shape or self.grid_shape != grid.shape[:4]:
            raise InputError(
                f"this plan is for a sensor of {_sizes(self.sensor_shape)} pixels and a light field of "
                f"{_sizes(self.grid_shape)} samples, not {_sizes(sensor_shape)} and {_sizes(grid.shape[:4])}: "
                "make it anew with camera.compile(light_field)"
            )
        if self.made_for is not None and (
            self.made_for.train != train or not self.made_for.frame.isclose(grid.frame)
        ):
            other = "frame of light field" if self.made_for.train == train else "camera"
            raise InputError(f"this plan is for another {other}: make it anew with camera.compile(light_field)")

    def __repr__(self) -> str:
        rows, columns = self.sensor_shape
        lines = [f"Plan for a picture of {rows}×{columns} pixels by {self.core.method}: {self.core!r}"]
        lines += [f"  {words}" for words in self._filters()]
        lines.append(f"  missing rays: {self.missing_rays:.2%}")
        return "\n".join(lines + [f"  - {note}" for note in self.notes])

    def _filters(self) -> list[str]:
        found = []
        for operator in (*self.before, *self.after):
            match operator:
                case BlurViews(kernel):
                    found.append(f"views blurred by a kernel of {kernel.shape[0]}×{kernel.shape[1]} samples")
                case Blur(kernel, words) | BlurByChannel(kernel, words):
                    found.append(f"{words}: a kernel of {kernel.shape[0]}×{kernel.shape[1]} pixels")
                case AlongAxes(down, across, words):
                    found.append(f"{words}: {len(down)}×{len(across)} pixels")
                case _:
                    pass
        return found


def _sizes(shape: tuple[int, ...]) -> str:
    return "×".join(map(str, shape))
