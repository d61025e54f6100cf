"""The gallery's cameras on a bench: the gallery's own definitions, scaled to the bench's scene."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from vcc.base.errors import InputError
from vcc.bench.cameras import APERTURE, IMAGE, PIXELS, VIEWS, WIDE
from vcc.bench.document import Document
from vcc.camera import Camera
from vcc.files.camera_writing import NOWHERE, tables_of_train
from vcc.gallery import (
    biprism_stereo,
    blur_by_blocks,
    coded_aperture_depth,
    coded_aperture_refocusing,
    conventional,
    dual_pixel,
    heterodyne,
    integral_lens_prism,
    plenoptic,
    real_lens,
    wavefront_coding,
)
from vcc.gallery.entry import Entry
from vcc.gallery.listing import ENTRIES
from vcc.gallery.published_codes import VEERARAGHAVAN
from vcc.light_field import LightField
from vcc.optics import Mask
from vcc.optics.train import Train
from vcc.showcase.bench import FOCAL_LENGTH, RIM, Bench
from vcc.showcase.scene import FAR, MIDDLE, NEAR

LENSLET_PIXELS = 8
"""Pixels across a lenslet, nearly the number of views of the bench's scene; the prototype had 14."""
INSIDE = 0.94
"""The part of a view that the sensor covers, as in the gallery's images of its scene."""


def _depth(bench: Bench) -> Train:
    """Without the analytic scene, so that its views are not rendered again: only their shape is needed here."""
    return blur_by_blocks.designed(replace(bench, scene=None)).camera("code")


def _refocusing(bench: Bench) -> Train:
    setting = coded_aperture_refocusing.Refocusing.of(bench)
    code = Mask(VEERARAGHAVAN, width=APERTURE, name="code")
    return setting.camera(code, setting.focus)


def _wavefront(bench: Bench) -> Train:
    pair = wavefront_coding.designed(bench)
    rows, columns = (int(INSIDE * count) for count in bench.light_field.shape[2:4])
    return Camera(pair.coded, pair.comparison.sensor((rows, columns)))


def _plenoptic(bench: Bench) -> Train:
    """Lenslets twice as wide as those matched to the scene: a fourth of the pixels, an image in seconds."""
    coarser = replace(
        bench, light_field=bench.light_field[:, :, ::2, ::2], pitch=(2 * bench.pitch[0], 2 * bench.pitch[1])
    )
    return plenoptic.designed(coarser, LENSLET_PIXELS).camera


CAMERAS: Mapping[str, tuple[Entry, Callable[[Bench], Train]]] = {
    each.name: (each, made)
    for each, made in (
        (conventional.ENTRY, lambda bench: bench.conventional(bench.middle)),
        (real_lens.ENTRY, real_lens.camera_of),
        (heterodyne.ENTRY, lambda bench: heterodyne.designed(bench, heterodyne.on_axis(bench.light_field))),
        (coded_aperture_refocusing.ENTRY, _refocusing),
        (coded_aperture_depth.ENTRY, _depth),
        (plenoptic.ENTRY, _plenoptic),
        (integral_lens_prism.ENTRY, lambda bench: integral_lens_prism.designed(bench).camera),
        (biprism_stereo.ENTRY, biprism_stereo.designed),
        (dual_pixel.ENTRY, dual_pixel.designed),
        (wavefront_coding.ENTRY, _wavefront),
    )
}
"""Entries by name, each with a function that designs its camera for a light field before a lens."""

LEFT_OUT: Mapping[str, str] = {
    "angle-sensitive-pixels": "its pixels respond by a tile of angles, so that an image is made of one for each "
    "kind of pixel, and the bench shows one: give the sensor of another camera one angular_response",
    "coded-aperture-real-lens": "its target is flat and far off the axis, and the bench shows one scene: open "
    "real-lens, and give its lens a mask",
    "good-apertures": "it compares many apertures of one lens, and is not a single camera: open "
    "coded-aperture-refocusing, and give its mask other cells",
    "light-field-rendering": "it renders views between those of a light field, and has neither lens nor sensor",
    "diffuser-depth-of-field": "its diffusers are random rings defined in Python, which a camera file cannot "
    "hold: open wavefront-coding, and give its plate another surface",
    "diffusercam": "it has no lens, and its flat target is much nearer than the scene on the bench: put a plate "
    "with a rough surface before a sensor there",
    "focal-sweep": "its sensor moves during the exposure, which the bench does not support: move the sensor on "
    "the bench, or export a film of a sweep of sensor.z",
    "coded-exposure": "its shutter flutters while the scene moves, and the bench shows static scenes only",
    "compressive-light-field": "its mask has thousands of random cells near the sensor, and its views come from a "
    "decoder that takes a minute: put a mask before the sensor of conventional",
    "learned-aperture": "its code is learned in a minute with a network: open coded-aperture-refocusing, and "
    "give its mask the learned cells",
    "tensor-display": "it shows a light field and records none",
    "cassi": "its scene has many bands, and light fields on the bench have no wavelengths",
}
"""Entries that are not on the bench, and why."""


def title_of(name: str) -> str:
    """The title of a gallery entry on a bench.

    Raises:
        InputError: there is no such entry, or its camera is not available on a bench.
    """
    if name in LEFT_OUT:
        raise InputError(f"the gallery's {name} is not on the bench: {LEFT_OUT[name]}")
    if name not in CAMERAS:
        raise InputError(f'the gallery has no camera "{name}". On the bench are {", ".join(CAMERAS)}')
    return f"Gallery: {CAMERAS[name][0].title}"


class Gallery(Mapping[str, Document]):
    """Cameras by title; the published ones are designed on access.

    Args:
        given: the cameras listed first.
        light_field: the name of the light field before the published ones.
    """

    def __init__(self, given: Mapping[str, Document], light_field: str) -> None:
        self._given, self._light_field = dict(given), light_field
        self._names = {title_of(name): name for name in ENTRIES if name not in LEFT_OUT}

    def __getitem__(self, title: str) -> Document:
        if title in self._given:
            return self._given[title]
        return _document(CAMERAS[self._names[title]][1](without_samples()), self._light_field)

    def __iter__(self) -> Iterator[str]:
        yield from (*self._given, *self._names)

    def __len__(self) -> int:
        return len(self._given) + len(self._names)


def without_samples() -> Bench:
    """The bench's scene without samples: the design of cameras depends only on the geometry of the views."""
    nothing = np.broadcast_to(np.uint8(0), (VIEWS, VIEWS, PIXELS, PIXELS, 3))
    views = LightField.from_views(nothing, APERTURE / VIEWS, WIDE / PIXELS / IMAGE, MIDDLE)
    pitch = INSIDE * WIDE / PIXELS
    return Bench(views, None, NEAR, MIDDLE, FAR, FOCAL_LENGTH, RIM * APERTURE, (pitch, pitch))


def _document(camera: Train, light_field: str) -> Document:
    tables, arrays = tables_of_train(camera, NOWHERE / "camera.toml")
    whole = _with_numbers(tables, {name: values.tolist() for name, values in arrays.items()})
    return Document({"elements": [], **whole}, light_field)


def _with_numbers(tree: Any, arrays: Mapping[str, Any]) -> Any:
    """Tables with arrays in place of the names of array files."""
    if isinstance(tree, dict):
        return {key: _with_numbers(each, arrays) for key, each in tree.items()}
    if isinstance(tree, list):
        return [_with_numbers(each, arrays) for each in tree]
    return arrays.get(tree, tree) if isinstance(tree, str) else tree
