"""Folders of bands: a folder for each wavelength, named after it (``450nm``, ``520.5 nm``), each a light field."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.progress import Progress, part_of
from vcc.base.units import nm
from vcc.base.wavelengths import wavelength
from vcc.fields.filling import Filling
from vcc.light_field import LightField

_NAME = re.compile(r"(?:.*[_\s-])?(\d{2,5}(?:\.\d+)?)\s?nm", re.IGNORECASE)


def bands_in(folder: Path) -> dict[Path, float]:
    """The folders of bands in a folder and their wavelengths, metres, shortest first; empty if there are none.

    Args:
        folder: its subfolders are named ``450nm``, ``450 nm`` or ``band_450nm``; two or more of them.

    Raises:
        InputError: two folders of one wavelength, or a wavelength that is not from 100 nm to 50 µm.
    """
    if not folder.is_dir():
        return {}
    named = {
        each: match[1] for each in folder.iterdir() if (match := _NAME.fullmatch(each.name)) and each.is_dir()
    }
    if len(named) < 2:
        return {}
    found = {each: wavelength(f"the wavelength of {each}", float(number) * nm) for each, number in named.items()}
    ordered = dict(sorted(found.items(), key=lambda item: item[1]))
    for one, other in zip(ordered, list(ordered)[1:], strict=False):
        if ordered[one] == ordered[other]:
            raise InputError(f"{one} and {other} have the same wavelength: leave one there")
    return ordered


def stacked(
    folders: dict[Path, float], opened: Callable[[Path, Progress | None], LightField], progress: Progress | None
) -> LightField:
    """The light field whose channels are those of the folders.

    Args:
        folders: as `bands_in` returns them.
        opened: opens one of them.
        progress: called with (done, total).

    Returns:
        Shape (v, u, t, s, bands), in the order of the wavelengths.

    Raises:
        InputError: a folder with several channels, or another shape, type or geometry than the first.
    """
    values, first = [], None
    filling: Filling | None = None
    for number, folder in enumerate(folders):
        one = opened(folder, part_of(progress, number, len(folders)))
        if one.channels not in (None, 1):
            raise InputError(
                f"{folder} has {one.channels} channels, and a folder of a band has one: save its pictures in grey"
            )
        samples = one.values.reshape(*one.shape[:4])
        if first is None:
            first, whole = one, folder
        elif (samples.shape, samples.dtype) != (values[0].shape, values[0].dtype):
            raise InputError(
                f"{folder} has samples of shape {samples.shape} and type {samples.dtype}, and {whole} "
                f"{values[0].shape} and {values[0].dtype}: bands have the same views and pixels"
            )
        elif not np.array_equal(one.given, first.given):
            raise InputError(f"{folder} and {whole} have different views: bands have the same views and pixels")
        elif not one.frame.isclose(first.frame):
            raise InputError(f"{folder} states other cameras than {whole}: bands have the same spacing and slopes")
        values.append(samples)
        if one.filling is not None:  # the largest error of all bands
            worst = one.filling if filling is None else filling
            error = np.maximum(worst.error, one.filling.error)
            filling = Filling(one.given, error, np.maximum(worst.unseen, one.filling.unseen))
    assert first is not None
    with checks.within(str(next(iter(folders)).parent)):
        return LightField(
            np.stack(values, axis=-1),
            first.frame,
            first.disparity_range,
            first.sample,
            wavelengths=list(folders.values()),
            filling=filling,
        )
