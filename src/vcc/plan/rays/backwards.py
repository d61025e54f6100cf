"""Backward pass through steps of rays: gradients of the rays before a step and of its parameters.

Each function here is the transpose of a derivative. The cotangent of a number is the derivative of a weighted
sum of an image with respect to it. With the cotangents of the rays behind a step, every small change obeys
⟨cotangent behind, d(behind)⟩ = ⟨cotangent before, d(before)⟩ + Σ ⟨cotangent of a parameter, d(parameter)⟩. The
cell or facet that a ray meets, whether it passes an edge and the selected kernel do not depend on small changes
(`vcc.plan.rays.edges`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.plan.rays import steps
from vcc.plan.rays.refraction_backwards import refraction_back
from vcc.plan.rays.steps import Bundle, Step, Texture
from vcc.shapes.lattice import Lattice

Array = NDArray[np.float64]
Numbers = dict[str, Array]


def back(step: Step, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    """Propagate cotangents from the rays behind a step to the rays before it.

    Args:
        step: any of `vcc.plan.rays.steps`.
        before: the rays before it.
        behind: cotangents of the rays behind it.

    Returns:
        Cotangents of the rays before it, and of the step's parameters by their names in the step; parameters
        that are missing there have the derivative zero.
    """
    return _BACK[type(step)](step, before, behind)


def moved_back(matrix: Array, before: Bundle, behind: Array) -> tuple[Bundle, Array]:
    """The same for an affine map of rays.

    Args:
        matrix: 5×5.
        before: rays.
        behind: cotangents of the result (x, y, s, t) of the map, (…, 4).

    Returns:
        Cotangents of the rays' places and slopes, and of the matrix.
    """
    x, y, s, t = np.moveaxis(behind @ matrix[:4, :4], -1, 0)
    rays = np.stack([before.x, before.y, before.s, before.t, np.ones_like(before.x)], axis=-1)
    own = np.zeros((5, 5))
    own[:4] = behind.reshape(-1, 4).T @ rays.reshape(-1, 5)
    return replace(before, x=x, y=y, s=s, t=t, share=np.zeros_like(x), points=np.zeros(())), own


def lattice_back(lattice: Lattice, centre: tuple[Array, Array], behind: tuple[Array, Array]) -> Numbers:
    """Cotangents of a lattice from cotangents of centres of its cells.

    A centre is offset + pitch · (rotated steps of the lattice).

    Args:
        lattice: the cells.
        centre: (x, y) of cells.
        behind: cotangents of the centres.
    """
    (x, y), (gx, gy) = (centre[0] - lattice.offset[0], centre[1] - lattice.offset[1]), behind
    return {
        "pitch": np.asarray(np.sum(gx * x + gy * y) / lattice.pitch),
        "rotation": np.asarray(np.sum(gy * x - gx * y)),
        "offset": _pair(gx, gy),
    }


def texture_back(texture: Texture, x: Array, y: Array, behind: Array) -> tuple[Array, Array, Numbers]:
    """Cotangents of the places and of a texture from cotangents of values looked up in it.

    Args:
        texture: for the look-up.
        x: places.
        y: likewise.
        behind: cotangents of the values, (…, numbers).
    """
    size = texture.values.shape[1::-1]
    place = [(at - texture.start[n]) / texture.spacing[n] for n, at in enumerate((x, y))]
    inside = [(at >= 0) & (at <= points - 1) for at, points in zip(place, size, strict=True)]
    held = [np.clip(at, 0, points - 1) for at, points in zip(place, size, strict=True)]
    first = [np.minimum(at.astype(np.int64), max(n - 2, 0)) for at, n in zip(held, size, strict=True)]
    part = [at - whole for at, whole in zip(held, first, strict=True)]
    values = np.zeros(texture.values.shape)
    along = [np.zeros(x.shape), np.zeros(x.shape)]
    for dc in range(min(size[0], 2)):
        for dr in range(min(size[1], 2)):
            at = first[1] + dr, first[0] + dc
            across, down = part[0] if dc else 1 - part[0], part[1] if dr else 1 - part[1]
            np.add.at(values, at, (across * down)[..., None] * behind)
            found = np.sum(behind * texture.values[at], axis=-1)
            along[0] += (2 * dc - 1) * down * found * (size[0] > 1)
            along[1] += (2 * dr - 1) * across * found * (size[1] > 1)
    gx, gy = (along[n] * inside[n] / texture.spacing[n] for n in range(2))
    return gx, gy, {"values": values, "start": -_pair(gx, gy), "spacing": -_pair(gx * place[0], gy * place[1])}


def _pair(x: Array, y: Array) -> Array:
    return np.array([np.sum(x), np.sum(y)])


def _under(name: str, numbers: Numbers) -> Numbers:
    return {f"{name}.{own}": value for own, value in numbers.items()}


# --- the steps ---


def _move(step: steps.Move, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    together = np.stack([behind.x, behind.y, behind.s, behind.t], axis=-1)
    moved, own = moved_back(step.before_from_behind.matrix, before, together)
    return replace(moved, share=behind.share, points=behind.points), {"before_from_behind": own}


def _cells(step: steps.CellsUnbend, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    """Slopes gain P·(x − decentre − centre) − σ."""
    row, column = step.cell_of(before.x, before.y)
    centre = step.lattice.centre_of(row, column)
    kind = row % step.powers.shape[0], column % step.powers.shape[1]
    powers, slopes = np.zeros(step.powers.shape), np.zeros(step.slopes.shape)
    away = before.x - step.decentre[0] - centre[0], before.y - step.decentre[1] - centre[1]
    np.add.at(powers, kind, behind.s * away[0] + behind.t * away[1])
    np.add.at(slopes, kind, -np.stack([behind.s, behind.t], axis=-1))
    gx, gy = step.powers[kind] * behind.s, step.powers[kind] * behind.t
    own = {"powers": powers, "slopes": slopes, "decentre": -_pair(gx, gy)}
    own |= _under("lattice", lattice_back(step.lattice, centre, (-gx, -gy)))
    return replace(behind, x=behind.x + gx, y=behind.y + gy), own


def _facets(step: steps.FacetsUnbend, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    slopes = np.zeros(step.slopes.shape)
    np.add.at(slopes, step.facet_of(before.x, before.y), -np.stack([behind.s, behind.t], axis=-1))
    return behind, {"slopes": slopes}


def _plate(step: steps.TextureUnbend, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    slopes = -np.stack([behind.s, behind.t], axis=-1)
    gx, gy, own = texture_back(step.texture, before.x, before.y, slopes)
    return replace(behind, x=behind.x + gx, y=behind.y + gy), _under("texture", own)


def _hole(step: Step, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    """Each ray passes or is stopped."""
    weighed = replace(before, share=np.ones_like(before.share))
    step(weighed)
    return replace(behind, share=behind.share * weighed.share), {}


def _mask_of_cells(step: steps.CellShares, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    row, column, inside = step.cell_of(before.x, before.y)
    values = np.zeros(step.values.shape)
    np.add.at(values, (row, column), behind.share * before.share * inside)
    return _hole(step, before, behind)[0], {"values": values}


def _cosines(step: steps.Cosines, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    """Shares are times f(θx)·f(θy), with f = ½ + Σ cos(nθ)/2h and θ = frequency·(place − middle) + phase."""
    orders = np.arange(1, step.harmonics + 1)
    away = [at - middle for at, middle in zip((before.x, before.y), step.middle, strict=True)]
    angles = [(f * at + step.phase)[..., None] * orders for f, at in zip(step.frequency, away, strict=True)]
    there = [float(f > 0) for f in step.frequency]
    weights = [
        1 + on * (np.cos(a).sum(-1) / (2 * step.harmonics) - 0.5) for on, a in zip(there, angles, strict=True)
    ]
    steep = [
        -on * (orders * np.sin(a)).sum(-1) / (2 * step.harmonics) for on, a in zip(there, angles, strict=True)
    ]
    carried = behind.share * before.share
    turned = carried * steep[0] * weights[1], carried * weights[0] * steep[1]  # cotangents of the angles
    gx, gy = (f * g for f, g in zip(step.frequency, turned, strict=True))
    own = {
        "middle": -_pair(gx, gy),
        "frequency": _pair(turned[0] * away[0], turned[1] * away[1]),
        "phase": np.asarray(np.sum(turned[0] + turned[1])),
    }
    share = behind.share * weights[0] * weights[1]
    return replace(behind, x=behind.x + gx, y=behind.y + gy, share=share), own


def _mask(step: steps.TextureShares, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    carried = (behind.share * before.share)[..., None]
    gx, gy, own = texture_back(step.texture, before.x, before.y, carried)
    share = behind.share * step.texture(before.x, before.y)[..., 0]
    return replace(behind, x=behind.x + gx, y=behind.y + gy, share=share), _under("texture", own)


def _by_ray(step: steps.SharesByRay, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    there, towards = step.by_place(before.x, before.y), step.by_slope(before.s, before.t)
    total = np.maximum((there * towards).sum(axis=-1), 0.0)
    carried = (behind.share * before.share * (total > 0))[..., None]
    gx, gy, by_place = texture_back(step.by_place, before.x, before.y, carried * towards)
    gs, gt, by_slope = texture_back(step.by_slope, before.s, before.t, carried * there)
    moved = replace(behind, x=behind.x + gx, y=behind.y + gy, s=behind.s + gs, t=behind.t + gt)
    return replace(moved, share=behind.share * total), _under("by_place", by_place) | _under("by_slope", by_slope)


def _diffuser(step: steps.Unscatter, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    """Slopes lose width · (random deflection of the selected kernel)."""
    place = (step.column + 2 * step.kernel_of(before))[..., None]
    drawn = [np.take_along_axis(before.points, place + n, -1)[..., 0] for n in range(2)]
    stretch = np.ones_like(before.x) if step.width is None else step.width(before.x, before.y)[..., 0]
    points = np.zeros(before.points.shape)
    for n, slope in enumerate((behind.s, behind.t)):
        np.put_along_axis(points, place + n, (-stretch * slope)[..., None], -1)
    moved = replace(behind, points=behind.points + points)
    if step.width is None:
        return moved, {}
    wider = -(behind.s * drawn[0] + behind.t * drawn[1])[..., None]
    gx, gy, own = texture_back(step.width, before.x, before.y, wider)
    return replace(moved, x=behind.x + gx, y=behind.y + gy), _under("width", own)


def _cosine_fourth(step: steps.CosineFourth, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    """Shares are times (1 + s² + t²)⁻²."""
    per_square = 1 / (1 + before.s**2 + before.t**2)
    steep = -4 * behind.share * before.share * per_square**3
    s, t = behind.s + steep * before.s, behind.t + steep * before.t
    return replace(behind, s=s, t=t, share=behind.share * per_square**2), {}


def _refract(step: steps.Refract, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    arriving = before.x, before.y, before.s, before.t
    cotangents = behind.x, behind.y, behind.s, behind.t, behind.share * before.share
    (x, y, s, t), share, own = refraction_back(step, arriving, cotangents)
    return replace(behind, x=x, y=y, s=s, t=t, share=behind.share * share), own


def _mapped(step: steps.MapRays, before: Bundle, behind: Bundle) -> tuple[Bundle, Numbers]:
    arriving = before.x, before.y, before.s, before.t
    x, y, s, t = step.pulled(arriving, (behind.x, behind.y, behind.s, behind.t))
    lit = step.passes(*step.variables(*arriving))
    return replace(behind, x=x, y=y, s=s, t=t, share=behind.share * lit), {}


_BACK: dict[type, Callable[[Any, Bundle, Bundle], tuple[Bundle, Numbers]]] = {
    steps.Move: _move,
    steps.CellsUnbend: _cells,
    steps.CellGaps: _hole,
    steps.BlockOfCells: _hole,
    steps.FacetsUnbend: _facets,
    steps.TextureUnbend: _plate,
    steps.Disc: _hole,
    steps.Rectangle: _hole,
    steps.CellShares: _mask_of_cells,
    steps.Cosines: _cosines,
    steps.TextureShares: _mask,
    steps.SharesByRay: _by_ray,
    steps.Unscatter: _diffuser,
    steps.Refract: _refract,
    steps.MapRays: _mapped,
    steps.CosineFourth: _cosine_fourth,
}
