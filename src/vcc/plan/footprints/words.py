"""Notes and warnings of a footprint plan, as text."""

from __future__ import annotations

import numpy as np

from vcc.base.affine import Affine
from vcc.optics.train import Train
from vcc.plan.footprints.cells import ERROR, SampleDivision
from vcc.plan.footprints.mask_textures import texture_error
from vcc.plan.footprints.model import MaskLookup
from vcc.plan.footprints.planes import Plane
from vcc.plan.footprints.taps import CellDivision
from vcc.plan.how import LARGEST_REFINEMENT
from vcc.plan.parallax_rule import BetweenViews

TOO_MUCH = 5e-3
"""Error, as a share of the light, above which an image carries a warning; estimates are about twice it."""
GHOSTS = 1.5
"""Distance between views' images of one object above which they are visible as separate, in pixels or samples."""
COARSE_TEXTURE = 5e-3
"""Error of a mask's texture between its points, as a share of its largest value, above which a plan warns."""


WIDE_SHADOW = 2.0
"""Width of a shadow's edge, pixels, from which on neighbouring pixels show how light varies within one."""


def notes_of(
    train: Train,
    view_planes: list[Plane],
    path_planes: list[Plane],
    against_sensor: list[Plane],
    between: BetweenViews,
    division: CellDivision,
    samples: SampleDivision,
    why_divided: str,
    swapped: bool,
) -> tuple[str, ...]:
    """Notes on the folded elements, the masks at the views, in mid-path and against the sensor, and the divisions.

    ``why_divided``: the reason for dividing samples, as text.
    """
    linear = [
        element.label
        for element in train.elements
        if any(isinstance(part, Affine) or part.affine is not None for part in element.parts())
    ]
    notes = [
        f"folded into one matrix: {', '.join(linear) or 'no linear element'}, and the flight to the sensor at "
        f"z = {train.sensor.z * 1e3:g} mm"
    ]
    if view_planes:
        notes.append(
            f"one weight a view, the open share of its cell: {', '.join(plane.label for plane in view_planes)}"
        )
    if path_planes:
        notes.append(
            f"one weight a sample, its mean over the sample's footprint, pulled from mid-path: "
            f"{', '.join(plane.label for plane in path_planes)}"
        )
    if against_sensor:
        notes.append(f"multiplied into the picture: {', '.join(plane.label for plane in against_sensor)}")
    if swapped:
        notes.append("pixel rows and columns of the views change places: the frame turns them")
    notes.append(between.reason)
    parts, finer = division.parts, division.finer
    if parts > 1:
        notes.append(f"cells of views divided {parts}×{parts}: a mask is finer than a view's cell")
    if finer > parts and division.where.any():
        some, all_views = np.count_nonzero(division.where), division.where.size
        which = "all views" if some == all_views else f"{some} of {all_views} views"
        notes.append(f"cells of {which} divided {finer}×{finer}: elements in different planes vary together there")
    if division.error > ERROR:
        notes.append(
            "masks still vary within these parts of cells, where they are taken for their means: an error of up "
            f"to {division.error:.1%} of the light. More views would make it smaller"
        )
    fine, spilt, _ = samples
    if fine > 1:
        notes.append(f"samples divided {fine}×{fine}: {why_divided}")
    if spilt > ERROR:
        notes.append(
            f"masks near the sensor are finer than these samples: an error of about {spilt:.1%} of the light "
            "beside their edges"
        )
    return tuple(notes)


def cautions_of(division: CellDivision, samples: SampleDivision, ghosts: float, pixel: float) -> tuple[str, ...]:
    """Warnings for errors that are large enough to be reported with the image.

    Args:
        division: of the views' cells.
        samples: how samples are divided.
        ghosts: remaining distance between views' images of some depths, pixels; 0 if gaps are not to be filled.
        pixel: distance between views' images that stays invisible: a pixel, or a sample if it is wider.
    """
    found = []
    if ghosts > GHOSTS * pixel:
        found.append(
            f"ghosting: views' images of some depths stay {ghosts:.2g} pixels apart; the light field has too "
            'few views for this defocus. Pass between_views="depth", or more views'
        )
    if division.error > TOO_MUCH:
        found.append(
            "masks vary within parts of views' cells, where they are taken for their means: an error of up to "
            f"{division.error:.1%} of the light. Pass {_finer(max(division.finer, division.parts))}more views"
        )
    fine, spilt, _ = samples
    if spilt > TOO_MUCH:
        found.append(
            f"a mask near the sensor is finer than the samples: an error of about {spilt:.1%} of the light beside "
            f"its edges. Pass {_finer(fine)}finer samples"
        )
    return tuple(found)


def edges_in_one_pixel(widths: dict[str, float], against: list[str], moment: float) -> tuple[str, ...]:
    """Warning for edges of light within pixels in which masks against the sensor vary.

    Args:
        widths: of the shadows of the edges of each mask in mid-path, pixels; wider ones are smooth light.
        against: labels of the masks against the sensor.
        moment: `vcc.plan.footprints.against_sensor.error_of_edges`, for a shadow of no width.
    """
    sharp = {label: width for label, width in widths.items() if width < WIDE_SHADOW}
    error = moment / max(1.0, min(sharp.values())) if sharp else 0.0
    if error <= TOO_MUCH:
        return ()
    return (
        f"edges of {', '.join(sharp)} are sharp on the sensor, and {', '.join(against)} varies within pixels: "
        f"pixels in which both do are wrong by up to {error:.1%} of the light there. Pass method='rays', or "
        "smaller pixels",
    )


def _finer(parts: int) -> str:
    return f"refine={2 * parts}, or " if 2 * parts <= LARGEST_REFINEMENT else ""


def coarse_textures(lookups: tuple[MaskLookup, ...]) -> tuple[str, ...]:
    """Warnings for masks that are finer than their textures can show, with the error of each."""
    found = [(lookup, texture_error(lookup.texture)) for lookup in lookups]
    return tuple(
        f"{lookup.label} is finer than its texture of {'×'.join(map(str, lookup.texture.shape))} points shows: "
        f"{error:.1%} root mean square of its largest value"
        for lookup, error in found
        if error > COARSE_TEXTURE
    )
