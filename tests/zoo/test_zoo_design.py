"""Joint design: images and noise against cameras and EMVA 1288, resuming, and decoders as the zoo runs them."""

from __future__ import annotations

import shutil
from dataclasses import replace

import numpy as np
import pytest

import vcc
from tests.command_line import run as command
from tests.zoo.few_views import few_views
from vcc.zoo import Recorded, Report, run, scenes
from vcc.zoo.bench import LEVELS, Kernels
from vcc.zoo.entrants import FromFile, codes
from vcc.zoo.tasks import EDOF

torch = pytest.importorskip("torch", reason="needs PyTorch")
from vcc.torch import CameraModule  # noqa: E402
from vcc.zoo import torch_design  # noqa: E402
from vcc.zoo.torch_decoder import Decoders  # noqa: E402
from vcc.zoo.torch_design import ARMS, Training, designed  # noqa: E402
from vcc.zoo.torch_parts import Design, Parts, read  # noqa: E402

pytestmark = pytest.mark.filterwarnings("ignore:ghosting")  # 9×9 views are few

SMALL = Design(light=20 / 49, cells=7, feature=2, steps=4, seeds=1, batch=1, scenes=1, validation=1)


@pytest.fixture(autouse=True, scope="module")
def small_work():
    """Scenes of 9×9 views, and a checkpoint after every two steps."""
    with few_views() as patched:
        patched.setattr(torch_design, "KEEPING", 2)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("design") / "made"
    few = ["--cells", "7", "--steps", "4", "--seeds", "1", "--batch", "1", "--scenes", "1", "--validation", "1"]
    done = command("zoo", "design", "--task", "edof", "-o", str(path), "--light", str(20 / 49), *few)
    assert done.exit_code == 0, done.stderr
    assert "| learned | 40.8% |" in done.stdout
    assert f"vcc zoo run --task edof -o {path}/zoo.zarr --camera {path}/learned-0.toml" in done.stdout
    return path


@pytest.fixture(scope="module")
def parts(folder):
    return Parts.of(SMALL, folder / "scenes")


@pytest.mark.parametrize("arm", ARMS)
def test_images_kernels_and_noise_are_those_of_the_camera(parts, arm):
    """Oracles: the camera's own image and traced kernels, and the variance of EMVA 1288."""
    training = Training(SMALL, parts, arm, seed=3)
    camera, shares = training.camera(), training.parts().detach()
    kernels = Kernels.of(camera, np.array(EDOF.blurs))
    image = np.asarray(camera.capture(scenes.scene("leaves-1001").field).values)[::-1, ::-1]
    summed = np.einsum("p,pyx->yx", shares.numpy(), parts.images[0].numpy())
    assert np.abs(summed - image).max() < 5e-6 * image.max()  # single precision
    random = torch.Generator().manual_seed(0)
    for electrons in LEVELS.values():
        level = torch.tensor([electrons])
        one, found, deviation = parts.recorded(parts.images[:1], shares, level, random)
        other, _, _ = parts.recorded(parts.images[:1], shares, level, random)
        off = (found.shape[-1] - kernels.values.shape[-1]) // 2
        inside = np.s_[:, off : found.shape[-1] - off, off : found.shape[-1] - off]
        # Rays on the border of two pixels fall on either one by rounding: at most 2 of the 91 across a pixel.
        assert np.abs(found.numpy()[inside] - kernels.values).max() < 4 * 92 / 364**2 / kernels.light
        assert found.sum((1, 2)) == pytest.approx(1, abs=1e-6)
        # White is 1; N electrons have the variance N, plus read noise and rounding.
        white = electrons * kernels.light
        variance = float(one.double().mean()) / white + (2.5**2 + 1 / 12) / white**2
        assert float(deviation[0]) ** 2 == pytest.approx(variance, rel=1e-3)
        # Half the variance of the difference of two recordings; the error of a variance of n numbers is √(2/n).
        apart = (one - other).double().numpy()
        assert apart.var() / 2 == pytest.approx(variance, rel=4 * (2 / apart.size) ** 0.5)


def test_two_steps_lower_the_loss(parts):
    """On the scene that is trained with, validation scenes being the same."""
    same = replace(parts, images=parts.images[[0, 0]], sharp=parts.sharp[[0, 0]])
    training = Training(SMALL, same, "learned", seed=0)
    before, code = training.validated(), training.scores.detach().clone()
    training.advance()
    training.advance()
    assert all(after > first for after, first in zip(training.validated(), before, strict=True))
    assert not torch.equal(training.scores.detach(), code)
    training.advance()  # after 60 % of the steps the code stays
    code = training.scores.detach().clone()
    training.advance()
    assert torch.equal(training.scores.detach(), code)


def test_an_interrupted_design_goes_on_with_the_same_numbers(folder, tmp_path):
    again = tmp_path / "again"
    shutil.copytree(folder / "scenes", again / "scenes")
    told = []

    def ended(done, total):
        told.append(done)
        if len(told) == 3:  # two scenes, then a checkpoint of the first camera
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        designed(again, SMALL, ended)
    assert read(again / "checkpoints" / "learned-0.pt", "checkpoint")["step"] == 2
    assert [each.arm for each in designed(again, SMALL)] == list(ARMS)
    for arm in ARMS:
        one, other = (read(at / "checkpoints" / f"{arm}-0.pt", "checkpoint") for at in (folder, again))
        assert torch.equal(one["scores"], other["scores"])
        for name, weights in one["network"].items():
            assert torch.equal(weights, other["network"][name]), name
        assert one["history"] == other["history"]
        assert one["step"] == 4


def test_a_checkpoint_has_the_camera_its_constraints_and_its_plans(folder, tmp_path):
    state = read(folder / "checkpoints" / "learned-0.pt", "checkpoint")
    assert state["plan"]["steps"] == 4
    assert state["plan"]["arm"] == "learned"
    assert state["constraints"] == {
        "cells": 7, "share": 20 / 49, "feature": 2, "symmetry": "both", "open_cells": 20
    }  # fmt: skip
    assert "one weight a view" in state["explained"]
    (tmp_path / "camera.toml").write_text(state["camera"])
    np.save(tmp_path / "camera_code.npy", state["code"].numpy().astype(float))
    camera = vcc.load_camera(tmp_path / "camera.toml")
    assert camera == vcc.load_camera(folder / "learned-0.toml")
    assert np.array_equal(camera.elements[0].pattern.values, state["code"].numpy())
    # The state of the planner makes the same plan, and is refused by a module of another camera.
    field = scenes.scene("leaves-1001").field
    CameraModule(SMALL.camera("", np.ones((7, 7))), field, ["code.pattern"], threads=1).set_extra_state(
        state["planned"]
    )
    with pytest.raises(vcc.InputError, match="another"):
        CameraModule(
            SMALL.camera("", np.ones((7, 7))), field[::2, ::2], ["code.pattern"], threads=1
        ).set_extra_state(state["planned"])


def test_other_plans_and_damaged_files_are_refused(folder, tmp_path):
    with pytest.raises(vcc.InputError, match=r"made with steps 4 \(now 6\)"):
        designed(folder, replace(SMALL, steps=6))
    shutil.copytree(folder / "scenes", tmp_path / "scenes")
    (tmp_path / "checkpoints").mkdir()
    (tmp_path / "checkpoints" / "learned-0.pt").write_bytes(b"nothing")
    with pytest.raises(vcc.InputError, match="cannot be read as checkpoint"):
        designed(tmp_path, SMALL)
    for change, message in (({"task": "depth"}, "edof"), ({"cells": 9}, "13, 14"), ({"light": 0.9}, "79 %")):
        with pytest.raises(vcc.InputError, match=message):
            replace(SMALL, **change)


def test_its_decoders_run_in_the_zoo_with_their_own_cameras(folder, tmp_path):
    slow = ("plug-and-play", "denoised", "total variation", "cubic plate", "random-phase plate", "radial plate")
    fewer = ("Wiener", "Veeraraghavan code", "Levin code", "Zhou–Nayar code", "round 10 %", "round 4 %")
    times = ("open, 78.5 % of the time", "open, 25.4 % of the time", "round 78.5 %", "round 25.4 %")
    cameras = [folder / "learned-0.toml", folder / "random-0.toml"]
    decoder = [f"{folder}/decoder.py:decode_0"]
    made = run("edof", tmp_path / "z.zarr", scenes=("leaves-3",), seeds=1, cameras=cameras, own_decoders=decoder,
               without=(*slow, *fewer, *times))  # fmt: skip
    report = Report.of(tmp_path / "z.zarr", "edof")
    learned = {name for name in report.names("camera") if "decoder:decode_0" in report.decoders(name)}
    assert learned == {"learned-0", "random-0", "open", "open, 40.8 % of the time", "round 40.8 %"}
    assert made == 2 * len(learned) + 1  # and round 1 % as recorded
    assert next(row for row in report.rows(0) if row[0] == "round 1 %")[3] == ""
    decode = Decoders(folder / "weights.pt", 0, "0" * 64)
    with pytest.raises(vcc.InputError, match="has changed"):
        decode.takes(codes(1.0)[0].camera)
    (function,) = [FromFile.of(each).load() for each in decoder]
    other = Recorded(np.ones((96, 128)), 0.1, Kernels.of(codes(1.0)[0].camera, np.zeros(1)), codes(1.0)[0].camera)
    with pytest.raises(vcc.InputError, match="other cameras"):
        function(other)


def test_a_decoder_keeps_what_is_sharp_and_even(folder):
    """A white wall is white through any kernel."""
    camera = vcc.load_camera(folder / "learned-0.toml")
    function = FromFile.of(f"{folder}/decoder.py:decode_0").load()
    found = function(Recorded(np.ones((96, 128)), 1e-3, Kernels.of(camera, np.array(EDOF.blurs)), camera))
    assert found == pytest.approx(1, abs=0.1)  # a network of four steps
