"""The plan of a joint design, and parts of the aperture: all of its cameras are sums of them.

The image of a scene is linear in the transmissions of the cells of a code. `CameraModule` computes the images of
all groups of mirrored cells once for each scene; the image through any code is a sum of them, with occlusion.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.describe import Brief
from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.reading import read_bytes, reading
from vcc.base.values import fingerprint
from vcc.base.version import VERSION
from vcc.camera import Camera
from vcc.files.atomic import atomic_path
from vcc.learn.fabrication import Fabrication
from vcc.learn.torch_electronics import expose
from vcc.learn.torch_module import CameraModule
from vcc.optics.mask import Mask
from vcc.plot.tracing import trace
from vcc.zoo.bench import (
    ELECTRONICS,
    FOCUS,
    RAYS,
    SIDE,
    Kernels,
    distance_of,
    exposure_time,
    noise_variance,
    of_lens,
    sensor,
)
from vcc.zoo.entrants import open_square, round_stop
from vcc.zoo.scenes import identity, scene
from vcc.zoo.task import Task
from vcc.zoo.tasks import EDOF, task_named

Array = NDArray[np.float64]

CODE = "code.pattern"
TRAINING, VALIDATION = 1001, 2001
"""Scenes are leaves-N from these numbers on."""


@dataclass(frozen=True)
class Design:
    """The plan of a joint design, part of all its checkpoints.

    Args:
        task: of the zoo; "edof" only.
        light: share of the open square's light for the code and for its round stop.
        cells: of the code, across and down.
        feature: side of its smallest hole and bar, cells.
        symmetry: "none", "left-right" or "both" (`vcc.torch.fabricable`).
        seeds: repetitions, each with its own first code, first weights, scenes' order and noise.
        steps: of training, the same for all arms.
        batch: scenes in a step, each at a light level of its own.
        scenes: to train with.
        validation: scenes that are only scored.

    Raises:
        InputError: numbers out of range; another task; a share above that of the largest round stop.
    """

    task: str = "edof"
    light: float = 0.25
    cells: int = 14
    feature: int = 2
    symmetry: str = "both"
    seeds: int = 3
    steps: int = 500
    batch: int = 3
    scenes: int = 32
    validation: int = 4

    def __post_init__(self) -> None:
        if task_named(self.task) is not EDOF:
            raise InputError(f"--task {self.task} has no decoder that learns: codes can be designed for edof")
        for name, least in (("seeds", 1), ("steps", 2), ("batch", 1), ("scenes", 1), ("validation", 1)):
            checks.whole_number_between(name, getattr(self, name), least)
        if RAYS % checks.whole_number_between("cells", self.cells, 2, RAYS):
            raise InputError(
                f"cells is {self.cells}: the calibration traces {RAYS} rays across, so take 7, 13, 14, 26 or 28"
            )
        round_stop(self.share, FOCUS)

    @property
    def zoo_task(self) -> Task:
        """The task."""
        return task_named(self.task)

    @property
    def fabrication(self) -> Fabrication:
        """What the code keeps."""
        return Fabrication(self.cells, self.light, self.feature, self.symmetry)

    @property
    def share(self) -> float:
        """The share of the light that the code passes: that of its open cells."""
        return self.fabrication.opened / self.cells**2

    def camera(self, arm: str, code: Array | None) -> Camera:
        """The camera of an arm."""
        focus = FOCUS
        if code is not None:
            return of_lens(Mask(code, width=SIDE, name="code"), focus=focus)
        return round_stop(round(self.share, 4), focus).camera if arm == "round" else open_square(focus)


@dataclass(frozen=True, eq=False, repr=False)
class Parts(Brief):
    """What the images of all arms are sums of: the parts of the aperture.

    The parts are the groups of cells (`Fabrication.orbits`) and, last, the round stop. A camera is the vector of
    the transmissions of its parts.

    Args:
        lights: of the parts, shares of the square, (parts).
        kernels: of the parts by distance, times their light, (parts, distances, rows, columns).
        images: of training and validation scenes, upright irradiance, (scenes, parts, rows, columns).
        sharp: what a pinhole sees of them, (scenes, rows, columns).
        planned: the state of the module that made them: what its plan depends on.
        explained: the plan as text.
    """

    lights: torch.Tensor
    kernels: torch.Tensor
    images: torch.Tensor
    sharp: torch.Tensor
    planned: Mapping[str, Any]
    explained: str

    @classmethod
    def of(cls, design: Design, folder: Path, progress: Progress | None = None) -> Parts:
        """Render scenes and image them through all parts; those in the folder are read from it."""
        orbits = design.fabrication.orbits
        masks = torch.tensor(np.stack([orbits == number for number in range(orbits.max() + 1)]).astype(float))
        coded, stop = design.camera("learned", np.ones(orbits.shape)), design.camera("round", None)
        names = [f"leaves-{TRAINING + n}" for n in range(design.scenes)]
        names += [f"leaves-{VALIDATION + n}" for n in range(design.validation)]
        module: CameraModule | None = None
        found, planned, explained = [], {}, ""
        for number, name in enumerate(names):
            path = folder / f"{name}.pt"
            key = fingerprint(VERSION, identity(name), coded, stop, design.symmetry)
            kept = read(path, f"images of {name}") if path.exists() else {}
            if kept.get("key") != key:
                made = scene(name)
                if module is None:
                    module = CameraModule(coded, made.field, [CODE], threads=1)
                    planned, explained = module.get_extra_state(), module.explain()
                samples = torch.from_numpy(np.asarray(made.field.values))
                with torch.no_grad():
                    parts = module(samples, values={CODE: masks})
                through = torch.from_numpy(np.asarray(stop.capture(made.field, threads=1).values, np.float32))
                kept = {
                    "key": key,
                    "images": torch.cat([parts, through[None]]).flip(-1, -2),
                    "sharp": torch.from_numpy(made.sharp).float(),
                    "planned": planned,
                    "explained": explained,
                }
                write(path, kept)
            found.append(kept)
            tell(progress, number + 1, len(names))
        lights, kernels = _parts(design, masks, stop)
        images, sharp = (torch.stack([each[what] for each in found]) for what in ("images", "sharp"))
        return cls(lights, kernels, images, sharp, found[0]["planned"], found[0]["explained"])

    def recorded(
        self, chosen: torch.Tensor, parts: torch.Tensor, levels: torch.Tensor, generator: torch.Generator
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Recordings of images of scenes, with the zoo's exposure and noise, as `Recorded` has them.

        Args:
            chosen: images of the parts, (scenes, parts, rows, columns).
            parts: transmissions of the camera's parts.
            levels: electrons of white through the open square, (scenes).
            generator: of the noise.

        Returns:
            Values (scenes, rows, columns), kernels (distances, rows, columns) and noise (scenes).
        """
        light = parts @ self.lights
        image = torch.einsum("p,spyx->syx", parts, chosen)
        numbers = expose(image * levels[:, None, None], sensor(), exposure_time(1.0), generator=generator)
        charge = (numbers - ELECTRONICS.black_level) / ELECTRONICS.gain
        white = levels * light
        mean = charge.mean((-2, -1)).clamp(min=0)
        noise = torch.sqrt(noise_variance(mean)) / white
        kernels = torch.einsum("p,pdyx->dyx", parts, self.kernels) / light
        return charge / white[:, None, None], kernels, noise


def _parts(design: Design, masks: torch.Tensor, stop: Camera) -> tuple[torch.Tensor, torch.Tensor]:
    """The light and the kernels of all parts. The kernel of a cell is that of its column times that of its row.

    Rays on the border of two pixels may count for the other one than in `Kernels`: 2 of 364 across at most.
    """
    camera, blurs = design.camera("open", None), np.array(design.zoo_task.blurs)
    u = ((np.arange(RAYS) + 0.5) / RAYS - 0.5) * SIDE
    lines = []
    for blur in blurs:
        rays = np.stack([u, 0 * u, u / distance_of(float(blur)), 0 * u], axis=-1)
        x = trace(camera, rays).positions[:, -1, 0] / camera.sensor.pitches[1]
        lines.append(-((np.floor(2 * x).astype(int) + 1) // 2))  # upright
    round_one = Kernels.of(stop, blurs)
    reach = max(int(np.abs(lines).max()), round_one.values.shape[-1] // 2)
    across = np.zeros((design.cells, len(blurs), 2 * reach + 1))
    columns = np.arange(RAYS) * design.cells // RAYS
    for number, pixels in enumerate(lines):
        np.add.at(across[:, number], (columns, pixels + reach), design.cells / RAYS)
    cell = torch.tensor(across)
    of_parts = torch.einsum("prc,rdy,cdx->pdyx", masks, cell, cell) / design.cells**2
    beside = reach - round_one.values.shape[-1] // 2
    last = np.pad(round_one.values * round_one.light, ((0, 0), *[(beside, beside)] * 2))
    lights = torch.cat([masks.mean((1, 2)), torch.tensor([round_one.light])])
    return lights.float(), torch.cat([of_parts, torch.tensor(last)[None]]).float()


# --- files ---


def read(path: Path, what: str) -> dict[str, Any]:
    """A dictionary of tensors and plain values from a file.

    Raises:
        InputError: it is damaged, or something else.
    """
    with reading(path, what):
        found = torch.load(io.BytesIO(read_bytes(path)), weights_only=True)
        if not isinstance(found, dict):
            raise InputError(f"it is no {what}")
        return found


def write(path: Path, content: Any) -> str:
    """Write a file, complete or not at all.

    Returns:
        SHA-256 of its bytes.
    """
    stream = io.BytesIO()
    torch.save(content, stream)
    with atomic_path(path) as temporary:
        temporary.write_bytes(stream.getvalue())
    return hashlib.sha256(stream.getvalue()).hexdigest()
