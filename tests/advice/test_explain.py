"""What `explain` says: the choices in words, the cost, and warnings where a picture must be read with care."""

import numpy as np
import pytest

import vcc
from vcc.base.units import mm


def light_field(views: int = 6, disparity_range=(-0.5, 0.5)) -> vcc.LightField:
    values = np.random.default_rng(0).random((views, views, 30, 32)).astype(np.float32)
    return vcc.LightField.from_views(values, 1 * mm, 0.01, 1.3, disparity_range)


def camera(*elements: vcc.Element, z: float = 52 * mm) -> vcc.Camera:
    return vcc.Camera(elements, vcc.Sensor(z=z, shape=(30, 32), pitch=0.52 * mm))


def test_it_names_what_was_folded_and_what_was_pulled_to_the_samples():
    stop = vcc.Mask(vcc.patterns.Circle(4 * mm), name="stop")
    code = vcc.Mask(np.eye(4), width=20 * mm, z=30 * mm, name="code")
    print_ = vcc.Mask(np.ones((2, 2)), width=20 * mm, z=52 * mm, name="print")
    lens = vcc.Lens(50 * mm, name="L1")
    text = " ".join(camera(lens, stop, code, print_).explain(light_field()).split())
    assert 'folded into one matrix: lens "L1"' in text
    assert 'the open share of its cell: mask "stop"' in text
    assert 'pulled from mid-path: mask "code"' in text
    assert 'multiplied into the picture: mask "print"' in text
    assert "circle (diameter 4 mm)" in text


def test_it_shows_itself_plainly_at_the_prompt():
    explanation = camera(vcc.Lens(50 * mm)).explain(light_field())
    assert repr(explanation) == str(explanation)
    assert explanation.expected_seconds is not None
    assert explanation.expected_seconds > 0


def test_it_speaks_of_a_light_field_whose_view_is_a_direction():
    # Places along (s, t) of the samples, slopes along (u, v): parallel rays, as behind a display.
    rays = vcc.Affine.from_parts([[0, 0, 1e-3, 0], [0, 0, 0, 1e-3], [1e-6, 0, 0, 0], [0, 1e-6, 0, 0]], [0.0] * 4)
    field = vcc.LightField(np.ones((1, 1, 9, 9)), rays, disparity_range=(0, 0))
    layers = [vcc.Mask(np.ones((6, 6)), width=5 * mm, z=z) for z in (0.0, 6 * mm)]
    train = vcc.Camera(layers, vcc.Sensor(z=6 * mm, shape=(5, 5), pitch=1 * mm))
    assert "mask" in train.explain(field, method="rays")


def test_its_lines_fit_a_terminal():
    fine = vcc.Mask(np.random.default_rng(1).random((200, 200)).round(), width=17 * mm, z=51.8 * mm)
    lines = camera(vcc.Lens(50 * mm, diameter=12 * mm), fine).explain(light_field()).splitlines()
    assert max(map(len, lines)) <= 80
    (element,) = (n for n, line in enumerate(lines) if line.startswith("  z =      51.8 mm  mask, pattern"))
    assert lines[element + 1].startswith((" " * 20, "  z ="))


@pytest.mark.parametrize(("z", "filled"), [(52 * mm, False), (200 * mm, True)])
def test_it_says_what_happens_between_views(z, filled):
    explanation = camera(vcc.Lens(50 * mm), z=z).explain(light_field(disparity_range=(-0.1, 0.1)))
    assert ("to close the gaps" in explanation) == filled
    assert any(explanation.plan.smear) == filled


def test_it_warns_of_ghosts_where_focus_forbids_filling_the_gaps():
    assert "ghosting" in camera(vcc.Lens(50 * mm)).explain(light_field(disparity_range=(-3.0, 0.0)))
    assert "ghosting" not in camera(vcc.Lens(50 * mm)).explain(light_field(disparity_range=(-0.5, 0.5)))


def test_it_states_the_share_of_missing_rays():
    wide = camera(vcc.Lens(50 * mm, diameter=12 * mm)).explain(light_field())
    # A 6 mm square of views in a circle of 12 mm: 36 of 36π mm² are held.
    assert wide.plan.missing_rays == pytest.approx(1 - 36 / (36 * np.pi), abs=0.02)
    assert f"{wide.plan.missing_rays:.1%} of the rays asked for are missing" in wide


def test_divided_samples_cost_their_number():
    fine = vcc.Mask(np.random.default_rng(1).random((200, 200)).round(), width=17 * mm, z=51.8 * mm)
    plain, divided = (camera(vcc.Lens(50 * mm), fine).compile(light_field(), refine=n) for n in (1, 4))
    assert divided.samples_touched == 16 * plain.samples_touched
    assert camera(vcc.Lens(50 * mm), fine).compile(light_field()).core.refine > 1
    assert "samples divided" in camera(vcc.Lens(50 * mm), fine).explain(light_field())


def test_it_says_what_the_samples_can_carry():
    """In focus at 1.3 m; neighbouring views lie 52 mm · 1 mm · |1/Z − 1/1.3 m| apart, pixels are 0.52 mm."""
    in_focus = camera(vcc.Lens(50 * mm), z=52 * mm)
    text = " ".join(in_focus.explain(light_field(disparity_range=(-0.5, 0.5))).split())
    assert "What the samples can carry scene from 173 mm" in text  # 1/Z = 1/1.3 + 0.5·0.01/0.001
    assert "in focus at 1.3 m; free of ghosts from 92.9 mm to infinity" in text  # 1/Z = 1/1.3 + 10
    assert "watch out" not in text
    far = " ".join(in_focus.explain(light_field(disparity_range=(-3.0, 0.0))).split())
    assert "watch out: views across: 6 (at least 18). 18 views over the same width" in far
    assert far.count("watch out") == 1  # both axes in one line
    array = vcc.LensArray(1 * mm, 2 * mm, z=50 * mm, name="micro")
    behind = " ".join(camera(vcc.Lens(50 * mm), array).explain(light_field(), samples=2).split())
    assert 'are not given behind lens array "micro"' in behind
    assert 'a sample of a view at lens array "micro" is 500 um wide, of 1 mm' in behind


def test_it_times_some_columns_of_views_whichever_they_are(monkeypatch):
    """Behind a round stop the outer columns are left out, as they give least; diffusers are run by column."""
    monkeypatch.setattr("vcc.advice.explain_footprints.TAPS_VALUES", 1000)
    frost = vcc.Diffuser(kernel=vcc.kernels.Gaussian(0.004))
    code = vcc.Mask(np.eye(4), width=20 * mm, z=30 * mm)
    explanation = camera(vcc.Lens(50 * mm, diameter=5 * mm), frost, code).explain(
        light_field(), method="footprints"
    )
    assert "blurs each view, in samples" in explanation
    assert explanation.expected_seconds > 0
