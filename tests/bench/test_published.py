"""The gallery's cameras on the bench: all of them or why not, the gallery's own, looking at the bench's scene."""

from pathlib import Path

import pytest

import vcc
from vcc.base.errors import InputError
from vcc.bench import published
from vcc.bench.cameras import SCENE, scenes
from vcc.bench.document import Document
from vcc.bench.picture import COARSER, take
from vcc.bench.published import Gallery, title_of
from vcc.files.camera_reading import Beside
from vcc.gallery import ENTRIES, entry

NOWHERE = Beside(Path(), frozenset())


@pytest.fixture(scope="module")
def field():
    return scenes()[SCENE]


def test_every_entry_is_on_the_bench_or_it_is_said_why_not():
    assert sorted([*published.CAMERAS, *published.LEFT_OUT]) == sorted(ENTRIES)
    first = Document({}, SCENE)
    gallery = Gallery({"A lens": first}, SCENE)
    assert next(iter(gallery)) == "A lens"
    assert gallery["A lens"] is first
    assert len(gallery) == len(list(gallery)) == 1 + len(published.CAMERAS)
    assert title_of("biprism-stereo") == f"Gallery: {entry('biprism-stereo').title}" in gallery
    for name, why in published.LEFT_OUT.items():
        with pytest.raises(InputError, match="is not on the bench") as error:
            title_of(name)
        assert why in str(error.value)


@pytest.mark.parametrize("name", published.CAMERAS)
def test_it_is_the_gallery_s_own_camera_and_sees_the_scene(name, field):
    document = Gallery({}, SCENE)[title_of(name)]
    train = document.train(NOWHERE).train
    made = published.CAMERAS[name][1](published.without_samples())
    assert vcc.Camera(train.elements, train.sensor) == made
    assert published.without_samples().light_field.frame == field.whole().frame
    taken = take(train, field, document, COARSER[-1])
    assert taken.image.missing_rays < 1e-3
    assert taken.values.std() > 0.1 * taken.values.mean()
