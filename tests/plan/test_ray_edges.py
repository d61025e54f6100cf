"""Which hard edges rays meet, and which changes of parameters move rays across them."""

import numpy as np
import pytest

import vcc
from vcc.base.errors import InputError
from vcc.base.units import mm
from vcc.plan.rays.edges import check_no_edge, edges_that_cut
from vcc.shapes import kernels, patterns

LENS = vcc.Lens(focal_length=50 * mm, diameter=3 * mm, name="main")
SENSOR = vcc.Sensor(52 * mm, (6, 8), 0.1 * mm)
FIELD = vcc.LightField.from_views(np.ones((9, 9, 24, 24), np.float32), 1 * mm, 2e-3)


def core(*elements, lens=LENS, samples=16, **options):
    return vcc.Camera([lens, *elements], SENSOR).compile(FIELD, method="rays", samples=samples, **options).core


def test_a_stop_that_is_aimed_at_cuts_nothing():
    assert edges_that_cut(core()) == ()


@pytest.mark.parametrize(
    ("pattern", "cuts"),
    [
        (patterns.Circle(1.95 * mm), True),
        (patterns.Circle(30 * mm), False),
        (patterns.Cells(np.eye(5), 3 * mm), True),
        (patterns.Cells(np.ones((1, 2)), 30 * mm), False),
        (patterns.CosineSum(1 * mm), False),
    ],
)
def test_masks_cut_where_rays_meet_their_edges(pattern, cuts):
    found = edges_that_cut(core(vcc.Mask(pattern, z=20 * mm, name="mask")))
    assert bool(found) == cuts
    assert all("mask" in words for words in found)


def test_views_cut_where_they_end_within_the_aim():
    assert edges_that_cut(core(lens=vcc.Lens(50 * mm, 12 * mm))) == ("the border of the views",)
    assert edges_that_cut(core(between_views="none")) == ("the borders between the views",)


def test_cells_that_are_aimed_at_one_by_one_have_no_border():
    camera = vcc.Camera.plenoptic(
        50 * mm, lenslet_pitch=0.1 * mm, f_number=5, pixels_per_lenslet=5, lenslets=(6, 6)
    )
    field = vcc.LightField.from_views(np.ones((11, 11, 20, 20), np.float32), 1 * mm, 1e-3)
    assert edges_that_cut(camera.compile(field, samples=64).core) == ()
    array = vcc.LensArray(pitch=1 * mm, focal_length=400 * mm, z=1 * mm, name="array")
    assert edges_that_cut(core(array, samples=2)) == ('a border between cells of lens array "array"',)


def test_kernels_that_are_picked_by_position_have_a_border():
    """Shares that vary along rows only, along columns only, and not at all."""
    rows, columns = np.array([[0.2], [0.7]]), np.array([[0.3, 0.6]])
    for shares, cuts in ((rows, True), (columns, True), (np.array([[0.4, 0.4]]), False)):
        mixed = vcc.CodedDiffuser(
            (kernels.Gaussian(0.001), kernels.Gaussian(0.002)), 30 * mm, weights=np.stack([shares, 1 - shares]),
            height=30 * mm, z=20 * mm, name="mixed",
        )  # fmt: skip
        found = edges_that_cut(core(mixed))
        assert bool([words for words in found if "is picked" in words]) == cuts


def test_a_stop_that_cells_image_within_a_pixel_is_an_edge():
    # Parallel light comes from the stop, 200 mm before the relay lens, and lenslets gather it in their focus.
    elements = [
        vcc.Lens(1e9, diameter=8 * mm, name="main"),
        vcc.Lens(200 * mm, z=200 * mm, name="relay"),
        vcc.LensArray(1 * mm, 2.5 * mm, z=400 * mm, name="array", rotation=1e-4),
    ]
    light_field = vcc.LightField.from_views(np.ones((9, 9, 20, 20), np.float32), 1.2 * mm, 4e-3)
    sharp = vcc.Camera(elements, vcc.Sensor(402.5 * mm, (36, 36), 0.1 * mm)).compile(light_field, method="rays")
    assert [words for words in edges_that_cut(sharp.core) if "image sharply" in words]
    assert not [words for words in edges_that_cut(sharp.core, ["scale"]) if "image sharply" in words]
    assert [words for words in edges_that_cut(sharp.core, ["aim.stop.half"]) if "image sharply" in words]
    # With f-numbers that match, a micro-image is blurred by a good part of a pixel.
    plenoptic = vcc.Camera.plenoptic(
        50 * mm, lenslet_pitch=0.1 * mm, f_number=4, pixels_per_lenslet=9, lenslets=(10, 10)
    )
    assert not [words for words in edges_that_cut(plenoptic.compile(light_field).core) if "sharply" in words]


def test_only_what_is_met_later_is_moved_against_an_edge():
    """From the sensor on: the diffuser, the mask with an edge, the biprism with another, the lens's rim."""
    met = core(
        vcc.Diffuser(kernels.Gaussian(0.002), z=30 * mm),
        vcc.Mask(patterns.Circle(2.0 * mm), z=20 * mm, name="mask"),
        vcc.Biprism(0.01, z=10 * mm, name="prism"),
    )
    names = [type(step).__name__ for step in met.steps]
    assert names[:6] == ["Move", "Unscatter", "Move", "Disc", "Move", "FacetsUnbend"]
    all_three = ('"mask"', 'a border between facets of biprism "prism"', 'lens "main"')
    assert edges_that_cut(met) == all_three
    for changed, expected in {
        "first_pixel": all_three,
        "aim.offset": all_three,
        "steps[0].before_from_behind": all_three,
        "steps[2].before_from_behind": all_three,
        "steps[3].radius": all_three[:1],
        "steps[4].before_from_behind": all_three[1:],
        "steps[5].decentre": all_three[1:],
        "steps[5].slopes": all_three[2:],
        "steps[7].radius": all_three[2:],
        "index_from_ray": (),
        "scale": (),
    }.items():
        assert edges_that_cut(met, [changed]) == expected, changed
    assert edges_that_cut(met, ["scale", "steps[4].before_from_behind"]) == all_three[1:]


def test_numbers_of_edges_that_cut_are_refused():
    met = core(vcc.Mask(patterns.Circle(1.95 * mm), z=20 * mm, name="mask"))
    with pytest.raises(InputError, match=r'steps\[1\].radius: "mask" is a hard edge inside the path of'):
        check_no_edge(met, ["scale", "steps[1].radius"])
    check_no_edge(met, ["scale", "steps[0].before_from_behind"])
    check_no_edge(core(vcc.Mask(patterns.Circle(30 * mm), z=20 * mm)), ["steps[1].radius"])
