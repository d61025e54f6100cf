"""Draw the desk for docs/synthesis.md, tutorial.md and depth.md: python tools/docs/desk_images.py."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import panels
from numpy.typing import NDArray

import vcc
from vcc import patterns
from vcc.files.transfer import encode
from vcc.plot import style
from vcc.recover import ideal_camera, refocused
from vcc.recover.depth import depth_by_plane_sweep, disparity_error
from vcc.units import mm

HERE = panels.DOCS / "images" / "desk"
LENS = 18 * mm
NEAR, MIDDLE, FAR = 0.43, 0.9, 60.0
"""Distances of the leaves, the glass ball and the town, metres."""


def main(folder: Path = HERE) -> None:
    """Draw all of them into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    stored = panels.desk()
    white = panels.white(stored)
    light_field = stored.read()
    draw_view(folder / "view.png", light_field, white)
    draw_focus(folder / "focus.png", light_field, white)
    draw_mask(folder / "mask.png", light_field, white)
    draw_depth(folder / "depth.png", light_field)


def draw_view(path: Path, light_field: vcc.LightField, white: float) -> None:
    """The middle view, and how far away what it shows is."""
    figure = panels.new_figure(11, 3.9)
    left, right = figure.subplots(1, 2)
    view = light_field.view(*light_field.grid.middle_view)
    show(left, view.upright().values * white, "the view in the middle")
    distance = light_field.grid.distances(light_field.grid.disparities.maps().values[0])
    drawn = right.imshow(1 / distance, cmap="viridis")
    right.set_axis_off()
    right.set_title("its true distance", fontsize=style.TITLE, color=style.INK)
    bar = figure.colorbar(drawn, ax=right, shrink=0.9, aspect=30)
    marks = (0.42, 0.5, 0.7, 1.0, 1.5, 4.5, 60.0)
    bar.set_ticks([1 / mark for mark in marks], labels=[f"{mark:g} m" for mark in marks], fontsize=style.SMALL)
    figure.savefig(path)


def draw_focus(path: Path, light_field: vcc.LightField, white: float) -> None:
    """Photographs by a lens of 18 mm, focused on leaves, glass ball and town."""
    figure = panels.new_figure(11, 2.75)
    for axes, distance in zip(figure.subplots(1, 3), (NEAR, MIDDLE, FAR), strict=True):
        picture = refocused(light_field, distance, diameter=LENS, between_views="depth")
        show(axes, picture.upright().values * white, f"focused at {distance:g} m")
    figure.savefig(path)


def draw_mask(path: Path, light_field: vcc.LightField, white: float) -> None:
    """Lamps out of focus through an open lens, and through a mask in it."""
    camera = ideal_camera(light_field, NEAR, diameter=LENS)
    mask = vcc.Mask(patterns.mura(5), width=14 * mm)
    coded = vcc.Camera([*camera.elements, mask], camera.sensor)
    pictures = [each.capture(light_field, between_views="depth").upright().values for each in (camera, coded)]
    part = np.s_[0:130, 30:225]
    figure = panels.new_figure(11, 3)
    axes = figure.subplots(1, 3, width_ratios=(1.5, 1.5, 1))
    for place, values, title in zip(axes, pictures, ("open lens", "with the mask"), strict=False):
        show(place, values[part] * (0.6 / np.percentile(values[part], 97)), title)
    cells = np.kron(mask.faces().pattern.values, np.ones((18, 18)))
    panels.picture(axes[2], cells, "the mask", style.TITLE, style.INK, cmap="gray", interpolation="nearest")
    figure.savefig(path)


def draw_depth(path: Path, light_field: vcc.LightField) -> None:
    """Disparities that a plane sweep finds, the true ones, and how sure it is."""
    found = depth_by_plane_sweep(light_field)
    true = light_field.grid.disparities.maps().values[0]
    low, high = true.min(), true.max()
    figure = panels.new_figure(11, 2.75)
    maps = (("what a plane sweep finds", found.disparity), ("the truth", true))
    places = figure.subplots(1, 3)
    for axes, (title, values) in zip(places, maps, strict=False):
        panels.picture(axes, values, title, style.TITLE, style.INK, cmap="viridis", vmin=low, vmax=high)
    panels.picture(places[2], found.confidence, "confidence", style.TITLE, style.INK, cmap="gray", vmin=0, vmax=1)
    figure.savefig(path)
    for words, where in (("all", None), ("confidence above 0.3", found.confidence > 0.3)):
        print(words, disparity_error(found.disparity, true, where=where))


def show(axes: Any, radiance: NDArray[Any], title: str) -> None:
    """A linear picture as people see it."""
    panels.picture(axes, encode(radiance, 8), title, style.TITLE, style.INK)


if __name__ == "__main__":
    main()
