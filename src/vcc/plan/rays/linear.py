"""Parameters of a ray plan that are linear in parameters of elements, and the transposes of these maps."""

from __future__ import annotations

from typing import Any

import numpy as np

from vcc.optics.diffuser import CodedDiffuser
from vcc.optics.train import Stage
from vcc.plan.following import Linear
from vcc.plan.rays.steps import CellShares, Step, Texture, TextureUnbend
from vcc.shapes.mean_back import is_values
from vcc.shapes.patterns import Cells
from vcc.shapes.surface import Surface


def by_cells(cells: Cells, step: CellShares) -> Linear:
    """A mask of cells that rays meet one by one: the parameters are the cells' values."""
    return Linear(
        lambda thing, field: is_values(thing, field) and thing is cells,
        lambda plan: _of_step(plan, step, "values"),
        lambda thing, weights: weights[0],
    )


def by_surface(stage: Stage, step: TextureUnbend) -> Linear:
    """A plate whose slopes are linear in a field of its surface: heights of a spline, Zernike coefficients."""
    surface = getattr(stage.faces.bending, "surface", None)
    x, y = (
        start - middle + apart * np.arange(count)
        for start, middle, apart, count in zip(
            step.texture.start,
            stage.element.decentre,
            step.texture.spacing,
            step.texture.values.shape[1::-1],
            strict=True,
        )
    )

    def back(sheet: Any, weights: list[Any]) -> Any:
        return sheet.slopes_back(x[None, :], y[:, None], (weights[0][..., 0], weights[0][..., 1]))

    return Linear(
        lambda thing, field: thing is surface and isinstance(thing, Surface) and field == thing.linear_in,
        lambda plan: _of_step(plan, step, "texture.values"),
        back,
    )


def by_widths(stage: Stage, step: Step, width: Texture) -> Linear:
    """A diffuser whose kernel is stretched over its surface: the texture is the map of widths."""
    return Linear(
        lambda thing, field: (
            thing is stage.element
            and isinstance(thing, CodedDiffuser)
            and field == "widths"
            and thing.widths is not None
            and thing.widths.shape == width.values.shape[:2]
        ),
        lambda plan: _of_step(plan, step, "width.values"),
        lambda thing, weights: weights[0][..., 0],
    )


def _of_step(plan: Any, step: Any, name: str) -> tuple[str, ...]:
    """The full names of a parameter of a step, if the plan contains the step."""
    return tuple(f"core.steps[{n}].{name}" for n, one in enumerate(plan.core.steps) if one is step)
