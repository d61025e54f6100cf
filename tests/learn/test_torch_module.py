"""Cameras as modules of PyTorch: pictures are `capture`'s, gradients are the adjoint's, and cameras learn."""

from __future__ import annotations

import copy
import math
import pickle
import subprocess
import sys
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import torch
from torch.func import functional_call

import vcc
import vcc.torch
from vcc.torch import CameraModule, binary, raw_of, sigmoid_mask, total_light
from vcc.units import mm, ms

RANDOM = np.random.default_rng(0)
SHAPE = (5, 4, 9, 10)
FIELD = vcc.LightField.from_views(
    RANDOM.random(SHAPE).astype(np.float32), 1.5 * mm, 5e-3, 1.0, disparity_range=(-0.3, 0.4), sample="point"
)
CELLS = RANDOM.uniform(0.3, 0.7, (3, 4))
LENS = vcc.Lens(50 * mm, diameter=5 * mm, name="main")
CODE = vcc.Mask(CELLS, 4.5 * mm, z=2 * mm, name="code")
SENSOR = vcc.Sensor(54 * mm, (7, 8), (0.31 * mm, 0.29 * mm), electronics=vcc.Electronics())
CAMERA = vcc.Camera([LENS, CODE], SENSOR, name="mine")
LEARN = ["code.pattern", "main.focal_length", "sensor.z"]


def module(learn=LEARN, camera=CAMERA, field=FIELD, **options):
    return CameraModule(camera, field, learn, **options)


def exact(learn=LEARN, camera=CAMERA, field=FIELD, **options):
    return module(learn, camera, field, engine="reference", **options)


def samples_of(*lead, seed=1):
    return torch.rand(*lead, *SHAPE, generator=torch.Generator().manual_seed(seed))


# --- pictures ---


@pytest.mark.parametrize("options", [{}, {"method": "rays", "samples": 16}, {"interpolation": "cubic"}])
def test_the_picture_is_what_capture_records(options):
    model = module(["code.pattern"], **options)
    picture = model()
    assert picture.dtype == torch.float32
    expected = CAMERA.capture(FIELD, **options).values
    # Learning looks masks up in double precision: 1e-6 of the largest, and single precision in the sums.
    np.testing.assert_allclose(picture.detach().numpy(), expected, rtol=0, atol=3e-6 * expected.max())
    assert model.camera() == CAMERA
    assert type(model.camera()) is vcc.Camera
    double = exact([], **options)()
    assert double.dtype == torch.float64
    np.testing.assert_allclose(double.detach().numpy(), expected, rtol=0, atol=3e-6 * expected.max())


def test_samples_with_axes_in_front_are_as_many_light_fields():
    model, samples = module(), samples_of(2, 3)
    pictures = model(samples)
    assert pictures.shape == (2, 3, 7, 8)
    for place in np.ndindex(2, 3):
        assert torch.equal(pictures[place], model(samples[place]))
    of_arrays = CAMERA.capture(FIELD.replaced(samples[1, 2].numpy())).values
    torch.testing.assert_close(pictures[1, 2], torch.as_tensor(of_arrays), rtol=0, atol=3e-6 * of_arrays.max())


def test_whole_numbers_are_shares_of_their_largest():
    model = module()
    codes = torch.randint(0, 256, SHAPE, dtype=torch.uint8, generator=torch.Generator().manual_seed(2))
    torch.testing.assert_close(model(codes), model(codes.float() / 255), rtol=1e-5, atol=1e-9)


def test_colours():
    field = vcc.LightField.from_views(RANDOM.random((*SHAPE, 3), np.float32), 1.5 * mm, 5e-3, 1.0, (0, 0))
    model = module(field=field)
    assert model().shape == (7, 8, 3)
    assert model(torch.rand(2, *SHAPE, 3)).shape == (2, 7, 8, 3)
    model().sum().backward()
    assert model.code.pattern.grad.shape == CELLS.shape


def test_many_masks_on_one_light_field():
    model = exact()
    masks = torch.rand(2, 3, 4, dtype=torch.float64).requires_grad_()
    pictures = model(values={"code.pattern": masks})
    assert pictures.shape == (2, 7, 8)
    weights = torch.randn(2, 7, 8, dtype=torch.float64)
    (together,) = torch.autograd.grad((weights * pictures).sum(), masks)
    for n in range(2):
        one = masks[n].detach().requires_grad_()
        picture = model(values={"code.pattern": one})
        torch.testing.assert_close(picture, pictures[n], rtol=1e-6, atol=0)
        (alone,) = torch.autograd.grad((weights[n] * picture).sum(), one)
        torch.testing.assert_close(together[n], alone, rtol=1e-5, atol=1e-5 * alone.abs().max().item())
    assert model(samples_of(3), values={"code.pattern": masks}).shape == (2, 3, 7, 8)


@pytest.mark.parametrize("z", [0.0, 2 * mm])
def test_many_masks_are_the_pictures_of_each(z):
    model = module(["code.pattern"], vcc.Camera([LENS, replace(CODE, z=z)], SENSOR))
    masks = torch.rand(5, 3, 4, dtype=torch.float64)
    pictures = model(values={"code.pattern": masks})
    for picture, mask in zip(pictures, masks, strict=True):
        alone = model(values={"code.pattern": mask})
        # Single precision, added up in another order.
        torch.testing.assert_close(picture, alone, rtol=0, atol=1e-6 * alone.max().item())


# --- gradients ---


def test_the_gradient_to_samples_is_the_adjoint():
    model = exact()
    samples = samples_of(2).double().requires_grad_()
    weights = torch.randn(2, 7, 8, dtype=torch.float64)
    picture = model(samples)
    (gradient,) = torch.autograd.grad(picture, samples, weights)
    # ⟨w, A x⟩ = ⟨Aᵀ w, x⟩
    torch.testing.assert_close((gradient * samples).sum(), (weights * picture).sum(), rtol=1e-12, atol=0)


def test_batches_add_up_in_the_gradient_to_parameters():
    model, samples = exact(), samples_of(2).double()
    parameters = list(model.parameters())
    weights = torch.randn(2, 7, 8, dtype=torch.float64)
    together = torch.autograd.grad((weights * model(samples)).sum(), parameters)
    alone = [torch.autograd.grad((weights[n] * model(samples[n])).sum(), parameters) for n in range(2)]
    for n, found in enumerate(together):
        torch.testing.assert_close(found, sum(each[n] for each in alone), rtol=1e-9, atol=1e-15)


def test_only_what_needs_a_gradient_gets_one():
    model = exact()
    model.main.focal_length.requires_grad_(False)
    model().sum().backward()
    assert model.main.focal_length.grad is None
    assert model.sensor.z.grad is not None
    with torch.no_grad():
        assert not model().requires_grad


def test_the_second_derivative_is_refused():
    model = exact()
    (gradient,) = torch.autograd.grad(model().square().sum(), model.sensor.z, create_graph=True)
    with pytest.raises(vcc.InputError, match="images have first derivatives only"):
        gradient.backward()


@pytest.mark.parametrize(
    ("learn", "options"),
    [
        ([*LEARN, "main.diameter", "code.z", "code.width", "sensor.pitch"], {}),
        (["code.pattern"], {"method": "rays", "samples": 16}),
    ],
)
def test_compiled_gradients_are_the_references(learn, options):
    fast, plain = module(learn, **options), exact(learn, **options)
    weights = torch.randn(2, 7, 8, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    samples = samples_of(2)
    found = torch.autograd.grad((weights * fast(samples)).sum(), list(fast.parameters()))
    expected = torch.autograd.grad((weights * plain(samples.double())).sum(), list(plain.parameters()))
    for one, other in zip(found, expected, strict=True):
        # Single precision, in sums of weights of both signs
        torch.testing.assert_close(one, other, rtol=1e-4, atol=1e-5 * other.abs().max().item())


# --- a module among modules ---


def test_the_state_has_the_parameters_by_their_names(tmp_path):
    model = module([*LEARN, "sensor.electronics.gain"])
    assert set(model.state_dict()) == {*LEARN, "sensor.electronics.gain", "_extra_state"}
    with torch.no_grad():
        model.main.focal_length += 0.5
    torch.save(model.state_dict(), tmp_path / "state.pt")
    other = module([*LEARN, "sensor.electronics.gain"])
    other.load_state_dict(torch.load(tmp_path / "state.pt"))
    assert torch.equal(other(), model())
    assert other.camera() == model.camera() != CAMERA
    longer = vcc.Camera([vcc.Lens(150 * mm, 5 * mm, name="main"), CODE], SENSOR)
    with pytest.raises(
        vcc.InputError, match=r"main.focal_length is stored in multiples of .* continue from model.camera"
    ):
        module([*LEARN, "sensor.electronics.gain"], longer).load_state_dict(model.state_dict())


def test_a_state_brings_the_planning_with_it(tmp_path):
    """Planned anew out of focus: a module that was planned in focus makes the same picture, and learns on so."""
    learn = ["sensor.z", "sensor.electronics.gain"]
    model, other = module(learn), module(learn)
    with torch.no_grad():
        for one in (model, other):
            one.sensor.z += 24
            one.sensor.electronics.gain += 0.1
        model.replan()
        expected = model()
        assert (other() - expected).abs().max() > 0.02 * expected.max()  # what was decided in focus
        torch.save(model.state_dict(), tmp_path / "state.pt")
        other.load_state_dict(torch.load(tmp_path / "state.pt"))
        assert torch.equal(other(), expected)
        assert other.get_extra_state() == model.get_extra_state()
        model.sensor.z -= 24
        other.sensor.z -= 24
        assert torch.equal(other(), model())
        rays, fresh = (module(["code.pattern"], method="rays", samples=16) for _ in range(2))
        rays.replan(seed=7)
        assert not torch.equal(fresh(), rays())
        fresh.load_state_dict(rays.state_dict())
        assert torch.equal(fresh(), rays())


def test_a_state_that_was_planned_for_something_else_is_refused():
    state = module().state_dict()
    wider = vcc.LightField.from_views(
        FIELD.values, 1.6 * mm, 5e-3, 1.0, disparity_range=(-0.3, 0.4), sample="point"
    )
    prism = vcc.Camera([LENS, CODE, vcc.Prism((0.001, 0), z=1 * mm)], SENSOR)
    for other, what in (
        (module(field=wider), "another light field,"),
        (module(interpolation="linear"), "another options,"),
        (module(camera=prism), "another camera,"),
    ):
        with pytest.raises(
            vcc.InputError, match=f"planned for {what} so that the same plan cannot be made"
        ) as told:
            other.load_state_dict(state)
        alone = dict(state)
        assert 'state.pop("_extra_state")' in str(told.value)
        alone.pop("_extra_state")
        other.load_state_dict(alone, strict=False)
        other.replan()
    with pytest.raises(vcc.InputError, match="of an earlier version, has no record of the planning"):
        module().load_state_dict(state | {"_extra_state": {"sensor.z": 1.0}})
    earlier = {**state["_extra_state"], "version": "0.0.1"}
    with pytest.warns(vcc.base.errors.ResultWarning, match="planned by version 0.0.1"):
        module().load_state_dict(state | {"_extra_state": earlier})


def test_cells_that_were_placed_have_a_name_of_their_own():
    placed = vcc.Mask(vcc.patterns.Cells(CELLS, 4.5 * mm), z=2 * mm, name="code")
    model = module(["code.pattern", "code.pattern.width"], vcc.Camera([LENS, placed], SENSOR))
    assert {name for name, _ in model.named_parameters()} == {"code.pattern.values", "code.pattern.width"}
    assert model.camera().elements[1] == placed


def test_functional_calls_and_their_gradients():
    model = module()
    longer = {"main.focal_length": model.main.focal_length.detach() + 1}
    with torch.no_grad():
        expected = model()
        moved = functional_call(model, longer, ())
        assert torch.equal(model(), expected)
        model.main.focal_length += 1
        assert torch.equal(model(), moved)

    def loss(z):
        return functional_call(model, {"sensor.z": z}, ()).square().sum()

    model().square().sum().backward()
    torch.testing.assert_close(torch.func.grad(loss)(model.sensor.z.detach()), model.sensor.z.grad)


def test_copies_share_the_light_field_and_nothing_else():
    model = module()
    twin = copy.deepcopy(model)
    with torch.no_grad():
        twin.sensor.z += 1
    assert not torch.equal(twin(), model())
    assert model.camera() == CAMERA
    assert torch.equal(pickle.loads(pickle.dumps(model))(), model())


class Pictures(torch.utils.data.Dataset):
    """Pictures that are made when they are asked for."""

    def __init__(self, model):
        self.model = model

    def __len__(self):
        return 4

    def __getitem__(self, place):
        with torch.no_grad():
            return self.model(samples_of(seed=place))


@pytest.mark.filterwarnings("ignore:os.fork.. was called:RuntimeWarning")  # by JAX, where other tests loaded it
def test_workers_of_a_loader_make_pictures():
    pictures = Pictures(module())
    loader = torch.utils.data.DataLoader(pictures, batch_size=2, num_workers=1, multiprocessing_context="fork")
    found = torch.cat(list(loader))
    for n in range(4):
        assert torch.equal(found[n], pictures[n])


@pytest.mark.filterwarnings("ignore:The .grad attribute of a Tensor that is not a leaf")  # by the compiler itself
def test_compiled_functions_around_it_give_the_same():
    model = module()
    around = torch.compile(lambda samples: (2 * model(samples)).square().sum(), backend="eager")
    samples = samples_of().requires_grad_()
    values = []
    for function in (around, lambda samples: (2 * model(samples)).square().sum()):
        value = function(samples)
        values.append((value, *torch.autograd.grad(value, [samples, *model.parameters()])))
    for one, other in zip(*values, strict=True):
        assert torch.equal(one, other)


class Softer(torch.nn.Module):
    def forward(self, cells):
        return cells / 2


def test_parametrizations_of_torch_are_constraints_too():
    model = exact(["code.pattern"])
    torch.nn.utils.parametrize.register_parametrization(model.code, "pattern", Softer())
    torch.testing.assert_close(model.values()["code.pattern"], torch.as_tensor(CELLS / 2))
    model().sum().backward()
    assert model.code.parametrizations.pattern.original.grad is not None


# --- learning ---


def test_a_mask_moves_towards_its_target():
    start, code = CELLS[:2, :3], np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 1.0]])
    # At the aperture and out of focus, where each cell has a picture of its own on the sensor
    away = replace(SENSOR, z=70 * mm, pitch=0.5 * mm)
    camera, target = (
        vcc.Camera([vcc.Lens(50 * mm), vcc.Mask(cells, 6 * mm, 7.5 * mm, name="code")], away)
        for cells in (start, code)
    )
    with torch.no_grad():
        wanted = module([], target)(samples_of(4))
    model = module(["code.pattern"], camera, constraints={"code.pattern": sigmoid_mask})
    torch.testing.assert_close(model.values()["code.pattern"].detach(), torch.as_tensor(start))
    optimiser = torch.optim.Adam(model.parameters(), lr=0.5)
    losses = []
    for _ in range(20):
        optimiser.zero_grad()
        loss = (model(samples_of(4)) - wanted).square().mean() / wanted.var()
        loss.backward()
        optimiser.step()
        losses.append(loss.item())
    assert losses[-1] < losses[0] / 8
    learned = model.camera().elements[1].pattern.values
    assert np.abs(learned - code).mean() < 0.75 * np.abs(start - code).mean()


def test_focus_is_found_again_by_the_same_learning_rate():
    with torch.no_grad():
        wanted = module([])()
    away = vcc.Camera([vcc.Lens(50.6 * mm, 5 * mm, name="main"), CODE], SENSOR)
    model = module(["main.focal_length"], away)
    optimiser = torch.optim.Adam(model.parameters(), lr=0.2)
    for _ in range(40):
        optimiser.zero_grad()
        ((model() - wanted).square().sum() / wanted.square().sum()).backward()
        optimiser.step()
    assert model.camera().elements[0].focal_length == pytest.approx(50 * mm, abs=0.15 * mm)


def test_constraints_are_applied_in_order():
    model = module(constraints={"code.pattern": (sigmoid_mask, partial(total_light, share=0.5), binary)})
    cells = model.values()["code.pattern"]
    assert cells.unique().tolist() == [0.0, 1.0]
    assert cells.mean() == 0.5
    model().sum().backward()
    assert model.code.pattern.grad.abs().max() > 0
    torch.testing.assert_close(model.code.pattern.detach(), raw_of(torch.as_tensor(CELLS)))


def test_electronics_learn_their_gain():
    model = module(["main.focal_length", "sensor.electronics.gain", "sensor.pitch"])
    exposure = torch.tensor(2 * ms, dtype=torch.float64, requires_grad=True)
    # As much light as fills half of the well where it is brightest
    brightest = CAMERA.capture(FIELD).values.max() * SENSOR.sensitive_area
    radiance = 5000 / (brightest * SENSOR.electronics.electrons_per_joule() * 2 * ms)
    numbers = model.expose(exposure, radiance=radiance, noise=False)
    recording = CAMERA.expose(FIELD, 2 * ms, radiance=radiance)
    # 56 pixels of noise of at most √5000 electrons
    assert np.abs(numbers.detach().numpy() - recording.values).max() < 0.4 * 4.5 * math.sqrt(5000)
    numbers.sum().backward()
    light = (numbers - 64).sum().item()
    assert exposure.grad.item() == pytest.approx(light / (2 * ms), rel=1e-3)
    # In multiples of its scale, a power of two
    gain = model.sensor.electronics.gain
    assert gain.grad.item() == pytest.approx(light / gain.item(), rel=1e-3)
    assert model.main.focal_length.grad is not None
    assert model.sensor.pitch.grad.shape == (2,)
    assert model.camera() == CAMERA


# --- the camera again ---


def test_what_was_learned_is_a_camera_that_saves(tmp_path):
    model = module()
    with torch.no_grad():
        model.sensor.z += 0.1
        model.code.pattern *= 0.5
    learned = model.camera()
    np.testing.assert_allclose(learned.elements[1].pattern.values, CELLS / 2)
    assert learned.name == "mine"
    learned.save(tmp_path / "learned.toml")
    assert vcc.load_camera(tmp_path / "learned.toml") == learned
    picture = learned.capture(FIELD).values
    # Planned anew, points of textures stand elsewhere: a border of a mask in mid-path, which is hard, then differs
    # by up to a hundredth within a part of a cell, and some 3 of 30 parts that a pixel sees have one.
    np.testing.assert_allclose(model().detach().numpy(), picture, rtol=0, atol=3e-3 * picture.max())


def test_it_explains_itself_and_says_when_it_would_decide_otherwise():
    model = module(["sensor.z"])
    said = str(model.explain())
    assert "sensor.z: a number" in said
    assert "Planning again would decide as it was decided." in said
    with torch.no_grad():
        model.sensor.z += 12  # far out of focus
    assert "Planning again (model.replan()) would decide otherwise: " in str(model.explain())
    scale = model.get_extra_state()["scales"]
    model.replan()
    assert "would decide as it was decided" in str(model.explain())
    assert model.get_extra_state()["scales"] == scale
    picture = model.camera().capture(FIELD).values
    np.testing.assert_allclose(model().detach().numpy(), picture, rtol=0, atol=3e-6 * picture.max())


def test_other_rays_are_sent_where_it_is_asked_for():
    model = module(["code.pattern"], method="rays", samples=16)
    first = model().detach()
    model.replan(seed=1)
    other = model().detach()
    assert not torch.equal(other, first)
    again = vcc.How(method="rays", samples=16, seed=1)
    np.testing.assert_allclose(other.numpy(), model.camera().capture(FIELD, again).values, rtol=1e-5)
    model.replan()
    assert torch.equal(model(), other)
    with pytest.raises(vcc.InputError, match="there is no option sead: did you mean seed"):
        model.replan(sead=2)
    with pytest.raises(vcc.InputError, match="array_api"):
        model.replan(engine="array_api")
    model.replan(seed=0)
    assert torch.equal(model(), first)


def test_what_it_is_is_told():
    assert "learns code.pattern, main.focal_length, sensor.z; pictures of 7×8" in repr(module())
    assert "learns nothing" in repr(module([]))


# --- what is refused ---


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"learn": "sensor.z"}, r'learn is a list of names: write learn=\["sensor.z"\]'),
        ({"learn": ["sensor.zz"]}, r"no parameter 'sensor.zz'; did you mean sensor.z"),
        ({"learn": ["sensor.z", "sensor.z"]}, "sensor.z is listed 2 times in learn"),
        ({"learn": [SENSOR]}, "learn must be a list of parameter names, but contains a Sensor"),
        ({"learn": ["sensor.shape"]}, "sensor.shape .* cannot be learned"),
        ({"field": torch.ones(SHAPE)}, "light_field is a vcc.LightField, not a Tensor"),
        ({"constraints": {"main.z": binary}}, "main.z has constraints but is not learned"),
        ({"constraints": {"sensor.z": 3.0}}, "constraints of sensor.z must be functions of tensors, not float"),
        ({"engine": "array_api"}, "engine='array_api' carries gradients to samples only"),
        (
            {"learn": [], "method": "rays", "tolerance": 0.01},
            "tolerance adds rays until an image is",
        ),
        ({"method": "rays"}, "no derivative to main.focal_length .* across a border between cells of mask"),
        ({"metod": "rays"}, "there is no option metod: did you mean method"),
        (
            {"camera": vcc.Camera([vcc.Lens(0.05, name="forward")], SENSOR), "learn": ["forward.z"]},
            "a torch.nn.Module has another attribute 'forward'",
        ),
    ],
)
def test_a_module_that_cannot_be_made(given, said):
    with pytest.raises(vcc.InputError, match=said):
        module(**given)


META = torch.empty(SHAPE, device="meta")


@pytest.mark.parametrize(
    ("samples", "values", "said"),
    [
        (np.ones(SHAPE), None, "samples must be a tensor, not ndarray"),
        (torch.ones(5, 4, 9, 9), None, r"samples have the shape \(5, 4, 9, 9\), .* has \(5, 4, 9, 10\)"),
        (torch.ones(0, *SHAPE), None, "are empty"),
        (torch.ones(SHAPE, dtype=torch.bfloat16), None, r"not torch.bfloat16: pass samples.float\(\)"),
        (META, None, r"samples are on meta, but learning runs on the CPU: pass tensor.cpu\(\)"),
        (
            torch.full(SHAPE, math.nan),
            None,
            r"samples must be finite numbers; at index \(0, 0, 0, 0\) there is nan",
        ),
        (
            None,
            {"main.z": torch.tensor(0.0)},
            "values has main.z, which is not learned; learned are code.pattern",
        ),
        (None, {"sensor.z": 0.05}, "values for sensor.z must be a floating-point tensor, not float"),
        (None, {"code.pattern": torch.ones(4, 4)}, r"have the shape \(3, 4\), .* not \(4, 4\)"),
        (None, {"code.pattern": torch.ones(2, 2, 3, 4)}, r"not \(2, 2, 3, 4\)"),
        (None, {"sensor.z": torch.empty((), device="meta")}, "values for sensor.z are on meta"),
        (None, {"sensor.z": torch.tensor(math.nan)}, r"sensor.z \(z of the sensor\) is nan"),
        (
            None,
            {"code.pattern": torch.full((3, 4), 1.5)},
            r'code.pattern \(pattern of mask "code"\) goes from 1.5 to 1.5, but transmission .* 0 and 1. '
            "Learn free numbers with a constraint .*, or clamp it to 0 and 1 after each step",
        ),
        (
            None,
            {"code.pattern": torch.ones(2, 3, 4), "sensor.z": torch.tensor([0.054, 0.055, 0.056])},
            "values for code.pattern, sensor.z have different numbers of images",
        ),
    ],
)
def test_what_a_module_does_not_take(samples, values, said):
    with pytest.raises(vcc.InputError, match=said):
        module()(samples, values=values)


def test_a_parameter_that_is_no_number_any_more_is_named():
    model = module()
    with torch.no_grad():
        model.main.focal_length.fill_(math.nan)
    for call in (model, model.camera, model.explain):
        with pytest.raises(vcc.InputError, match=r'main.focal_length \(focal_length of lens "main"\) is nan'):
            call()


def test_a_loss_that_is_no_number_ends_on_its_way_back():
    with pytest.raises(vcc.InputError, match=r"weights of an image must be finite; at \(0, 0\) there is nan"):
        (exact()() * math.nan).sum().backward()


def test_a_module_elsewhere_is_told_that_there_is_no_engine():
    with pytest.raises(
        vcc.InputError, match=r"code.pattern is on meta, but learning runs on the CPU.*model.cpu\(\)"
    ):
        module().to("meta")()


def test_constraints_that_change_the_shape_are_named():
    with pytest.raises(
        vcc.InputError, match=r"constraints of code.pattern return \(3,\), but it has the shape \(3, 4\)"
    ):
        module(constraints={"code.pattern": lambda cells: cells[:, 0]})()


def test_without_torch_all_else_works_and_the_extra_is_named():
    code = (
        "import sys; sys.modules['torch'] = None\n"
        "import numpy as np, vcc\n"
        "lf = vcc.LightField.from_views(np.ones((2, 2, 4, 4), np.float32), 1e-3, 1e-2, disparity_range=(0, 0))\n"
        "vcc.Camera([vcc.Lens(0.05)], vcc.Sensor(0.05, (2, 2), 1e-4)).compile(lf)\n"
        "try:\n    vcc.torch\n"
        "except vcc.InputError as error:\n    print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "vcc.torch needs the package torch" in done.stdout
    assert 'pip install "virtual-computational-camera[torch]"' in done.stdout
