"""Joint design: an aperture code and a decoder learned together, next to controls whose decoders learn likewise.

The code is binary in each step, with straight-through gradients to the scores of its cells (Bengio et al. 2013;
`vcc.torch.fabricable`). The loss is the score of the zoo: minus the mean PSNR over light levels, without borders.
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from vcc.base import checks

with checks.package("vcc zoo design", "torch", "torch"):
    import torch

from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.reading import expanded, reading
from vcc.base.values import fingerprint
from vcc.base.version import VERSION
from vcc.camera import Camera
from vcc.camera_file import load_camera
from vcc.files.atomic import atomic_path
from vcc.files.camera_writing import tables_of_train
from vcc.files.writer_lock import WriterLock
from vcc.learn.fabrication import MIRRORS
from vcc.learn.torch_constraints import fabricable
from vcc.learn.torch_threads import one_thread
from vcc.zoo.bench import BORDER, LEVELS
from vcc.zoo.report import Score
from vcc.zoo.torch_decoder import Network
from vcc.zoo.torch_parts import Design, Parts, read, write

ARMS = ("learned", "random", "round", "open")
"""A learned code; the random code that it began with; the round stop of the same light; the open square."""
RATE, CODE_RATE, WARM_UP = 3e-3, 0.03, 40
"""Learning rates of Adam, of the decoder and of the scores of cells, and steps of their rise."""
LEARNING = 0.6
"""Share of the steps after which the code stays: the decoder then learns for it alone."""
DIMMEST = 0.3
"""Scenes are scaled by random factors from this one to 1."""
KEEPING = 50
"""Steps between checkpoints."""


class Training:
    """One arm and seed: a camera, its decoder and the state of the optimiser.

    Args:
        design: the plan.
        sums: of which images and kernels are made.
        arm: one of `ARMS`.
        seed: number of the seed.
    """

    def __init__(self, design: Design, sums: Parts, arm: str, seed: int) -> None:
        self.design, self.sums, self.arm, self.seed = design, sums, arm, seed
        self.step, self.seconds = 0, 0.0
        self.history: list[list[float]] = []
        self.generator = torch.Generator().manual_seed(seed)
        begin = torch.Generator().manual_seed(seed)  # the same code and weights for all arms
        self.scores = torch.randn(design.cells, design.cells, generator=begin, dtype=torch.float64) / 2
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.network = Network(len(design.zoo_task.blurs))
        groups: list[dict[str, Any]] = [{"params": self.network.parameters(), "lr": RATE}]
        if arm == "learned":
            self.scores.requires_grad_()
            groups.append({"params": [self.scores], "lr": CODE_RATE})
        self.optimiser = torch.optim.Adam(groups)
        self.rates = [each["lr"] for each in groups]

    def code(self) -> torch.Tensor | None:
        """The code (rows, columns) of 0 and 1, with straight-through gradients; None for stops."""
        kept = self.design
        if self.arm not in ("learned", "random"):
            return None
        return fabricable(self.scores, kept.light, kept.feature, kept.symmetry)

    def parts(self) -> torch.Tensor:
        """The transmissions of the parts of the aperture."""
        orbits = torch.from_numpy(self.design.fabrication.orbits).flatten()
        found = torch.zeros(int(orbits.max()) + 2)
        code = self.code()
        if code is not None:
            sums = torch.zeros_like(found).index_add(0, orbits, code.flatten().float())
            return sums / torch.bincount(orbits, minlength=len(found)).clamp(min=1)
        if self.arm == "round":
            found[-1] = 1
        else:
            found[:-1] = 1
        return found

    def camera(self) -> Camera:
        """The camera as it is now."""
        code = self.code()
        return self.design.camera(self.arm, None if code is None else code.detach().numpy())

    def advance(self) -> float:
        """One step.

        Returns:
            The loss before it: minus the mean PSNR, dB.
        """
        design, draw = self.design, self.generator
        if self.step >= LEARNING * design.steps:
            self.scores.requires_grad_(False)
        chosen = torch.randint(design.scenes, (design.batch,), generator=draw)
        levels = torch.tensor(list(LEVELS.values()))
        levels = levels[torch.randint(len(levels), (design.batch,), generator=draw)]
        factors = DIMMEST ** torch.rand(design.batch, generator=draw)
        axes = [axis - 2 for axis in MIRRORS[design.symmetry] if torch.rand(1, generator=draw) < 0.5]
        images = self.sums.images[chosen].flip(axes) * factors[:, None, None, None]
        sharp = self.sums.sharp[chosen].flip(axes) * factors[:, None, None]
        for group, rate in zip(self.optimiser.param_groups, self.rates, strict=True):
            falling = (1 + math.cos(math.pi * self.step / design.steps)) / 2
            group["lr"] = rate * min(1.0, (self.step + 1) / WARM_UP) * falling
        loss = -_psnr(self.network(*self.sums.recorded(images, self.parts(), levels, draw)), sharp).mean()
        self.optimiser.zero_grad()
        loss.backward()
        self.optimiser.step()
        self.step += 1
        return float(loss.detach())

    def validated(self) -> list[float]:
        """PSNR by light level, dB, mean over the validation scenes, each with the same noise."""
        images, sharp = (each[self.design.scenes :] for each in (self.sums.images, self.sums.sharp))
        noise, found = torch.Generator().manual_seed(0), []
        with torch.no_grad():
            for electrons in LEVELS.values():
                levels = torch.full((len(images),), electrons)
                recorded = self.sums.recorded(images, self.parts(), levels, noise)
                found.append(float(_psnr(self.network(*recorded), sharp).mean()))
        return found

    def run(self, path: Path, progress: Progress | None = None) -> None:
        """Train to the end, from the checkpoint if there is one, and write checkpoints.

        Raises:
            InputError: a checkpoint of another plan, or one that is damaged.
        """
        if path.exists():
            self.restore(read(path, "checkpoint of a design"), path)
        while self.step < self.design.steps:
            begun = time.process_time()
            while True:
                self.advance()
                if self.step % KEEPING == 0 or self.step == self.design.steps:
                    break
            self.history.append([self.step, *self.validated()])
            self.seconds += time.process_time() - begun
            write(path, self.state())
            tell(progress, self.step, self.design.steps)

    def state(self) -> dict[str, Any]:
        """All that a run needs to go on, and the camera and the plans that it was made by."""
        code = self.code()
        return {
            "plan": {**asdict(self.design), "arm": self.arm, "seed": self.seed, "version": VERSION},
            "constraints": {**asdict(self.design.fabrication), "open_cells": self.design.fabrication.opened},
            "planned": dict(self.sums.planned),
            "explained": self.sums.explained,
            "camera": self.camera_file(),
            "code": None if code is None else code.detach().to(torch.uint8),
            "scores": self.scores.detach(),
            "network": self.network.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "generator": self.generator.get_state(),
            "step": self.step,
            "seconds": self.seconds,
            "history": self.history,
        }

    def restore(self, state: Mapping[str, Any], path: Path) -> None:
        """Go on from a state.

        Raises:
            InputError: it is of another plan, version or planner, or damaged.
        """
        with reading(path, "checkpoint of a design"):
            theirs, ours = state["plan"], self.state()["plan"]
            other = [
                f"{name} {theirs.get(name)} (now {mine})"
                for name, mine in ours.items()
                if mine != theirs.get(name)
            ]
            if other:
                raise InputError(f"{path} was made with {', '.join(other)}: use another folder, or the same plan")
            if state["planned"]["planned for"] != self.sums.planned["planned for"]:
                raise InputError(f"{path} was made by another plan of images: use another folder")
            with torch.no_grad():
                self.scores.copy_(state["scores"])
            self.network.load_state_dict(state["network"])
            self.optimiser.load_state_dict(state["optimiser"])
            self.generator.set_state(state["generator"])
            self.step, self.seconds, self.history = state["step"], state["seconds"], state["history"]

    def camera_file(self) -> str:
        """The camera as the text of a camera file; its array is the entry ``code`` of the state."""
        import tomli_w

        return str(tomli_w.dumps(tables_of_train(self.camera(), Path("camera.toml"))[0]))


def _psnr(found: torch.Tensor, sharp: torch.Tensor) -> torch.Tensor:
    """PSNR of pictures, white 1, without the borders of the zoo, dB."""
    inside = (..., slice(BORDER, -BORDER), slice(BORDER, -BORDER))
    return -10 * torch.log10((found - sharp)[inside].square().mean((-2, -1)))


# --- all of it ---


@dataclass(frozen=True)
class Outcome:
    """A camera and its decoder after training.

    Args:
        arm: one of `ARMS`.
        seed: number of the seed.
        light: share of the light of the open square.
        psnr: of the validation scenes by light level, dB.
        seconds: of a processor, for training.
    """

    arm: str
    seed: int
    light: float
    psnr: tuple[float, ...]
    seconds: float


def designed(output: str | PathLike[str], design: Design, progress: Progress | None = None) -> list[Outcome]:
    """Learn codes and decoders, and decoders of the controls, or go on with a design that was interrupted.

    The folder has, for seed N, the camera files learned-N.toml and random-N.toml; decoder.py with functions
    decode_N for these cameras, the round stop of the same light and the open square; weights.pt, which it reads;
    checkpoints; and scenes, a cache of the scenes' images, which may be deleted afterwards. The test scenes are
    those of `vcc.zoo.run`, which reads none of these.

    Args:
        output: folder; made if missing.
        design: the plan.
        progress: called with (done, total) in steps.

    Returns:
        All arms of all seeds.

    Raises:
        InputError: a folder of another plan; a code that cannot be found; an error of the disk. Checkpoints that
            were written stay.
    """
    folder = expanded(output)
    try:
        for each in (folder / "scenes", folder / "checkpoints"):
            each.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be made: {error.strerror}") from error
    lock = WriterLock(folder)
    try:
        with one_thread():
            return _designed(folder, design, progress)
    finally:
        lock.give_back()


def _designed(folder: Path, design: Design, progress: Progress | None) -> list[Outcome]:
    count = design.scenes + design.validation
    total = count * KEEPING + design.seeds * len(ARMS) * design.steps
    sums = Parts.of(design, folder / "scenes", lambda done, _: tell(progress, done * KEEPING, total))
    found, weights = [], []
    for number, (seed, arm) in enumerate((seed, arm) for seed in range(design.seeds) for arm in ARMS):
        training = Training(design, sums, arm, seed)
        done = count * KEEPING + number * design.steps
        training.run(
            folder / "checkpoints" / f"{arm}-{seed}.pt",
            lambda step, _, done=done: tell(progress, done + step, total),  # type: ignore[misc]
        )
        camera = training.camera()
        if training.code() is not None:
            path = folder / f"{arm}-{seed}.toml"
            camera.save(path)
            camera = load_camera(path)
        state = training.network.state_dict()
        weights.append({"camera": fingerprint(camera), "arm": arm, "seed": seed, "network": state})
        light = float(training.parts().detach() @ sums.lights)
        found.append(Outcome(arm, seed, light, tuple(training.history[-1][1:]), training.seconds))
    digest = write(folder / "weights.pt", weights)
    with atomic_path(folder / "decoder.py") as temporary:
        temporary.write_text(_decoder_file(design.seeds, digest), encoding="utf-8")
    return found


def _decoder_file(seeds: int, digest: str) -> str:
    lines = [
        '"""Decoders of a joint design, for vcc zoo run: one for each seed."""',
        "",
        "from pathlib import Path",
        "",
        "from vcc.zoo.torch_decoder import Decoders",
        "",
        'WEIGHTS = Path(__file__).with_name("weights.pt")',
        f'DIGEST = "{digest}"',
        *(f"decode_{seed} = Decoders(WEIGHTS, {seed}, DIGEST)" for seed in range(seeds)),
    ]
    return "\n".join(lines) + "\n"


def table(found: Sequence[Outcome]) -> str:
    """Validation PSNR in Markdown: a row for each arm, mean over seeds ± its standard error."""
    lines = [f"| camera | light | {' | '.join(LEVELS)} |", "|---|---|" + "---|" * len(LEVELS)]
    for arm in ARMS:
        of_arm = [each for each in found if each.arm == arm]
        cells = [Score.of(np.array(level)).text(2) for level in zip(*(each.psnr for each in of_arm), strict=True)]
        lines.append(f"| {arm} | {of_arm[0].light:.1%} | {' | '.join(cells)} |")
    return "\n".join(lines)
