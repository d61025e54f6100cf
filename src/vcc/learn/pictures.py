"""Pictures by cameras whose parameters change: one plan or several, run ahead and back, in NumPy's arrays.

What libraries that take derivatives are built on, each in modules of its own: nothing here knows of them.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from vcc.advice.explain import explained
from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.values import Unhashable, fingerprint
from vcc.engines import abilities, chosen
from vcc.fields.grid import Grid
from vcc.fields.samples import InMemory, Samples
from vcc.learn.chain import Chain
from vcc.learn.parameters import put
from vcc.learn.scales import scale
from vcc.learn.verdicts import following
from vcc.optics.train import Train
from vcc.plan.how import OF_THE_RUN, How
from vcc.plan.protocol import Gradient, Partial
from vcc.run.backwards import Backwards
from vcc.run.batches import rasters_each
from vcc.run.drive import Drive

Numbers = Mapping[str, NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Work:
    """What pictures are made with that stays as it is while a camera learns; copies of a module share it.

    Args:
        camera: with which learning, or the last planning, began.
        light_field: whose pictures are made where no other samples are given.
        how: as chosen.
        chain: from parameters to plans and back.
        followed: the numbers of the plan that follow each parameter.
    """

    camera: Train
    light_field: Samples
    how: How
    chain: Chain
    followed: Mapping[str, Collection[str]]

    @classmethod
    def of(cls, camera: Train, light_field: Samples, how: How, names: Sequence[str]) -> Work:
        """All is decided, once, for the camera as it is.

        Raises:
            InputError: a light field of another library's arrays, a parameter that cannot be learned, a plan that
                cannot be gone through backwards.
        """
        whole = light_field.whole()
        if whole is not None and not isinstance(whole, np.ndarray):
            raise InputError(
                f"the light field is a {type(whole).__module__}.{type(whole).__name__}, and has to be a NumPy "
                "array here: pass light_field.replaced(numpy.asarray(values)), and these values as samples"
            )
        chain = Chain(camera, light_field.grid, how, names)
        Drive.of_linear(chain.plan(), light_field, how)
        return cls(camera, light_field, how, chain, {name: following(chain, name) for name in names})

    def planned_for(self) -> dict[str, str]:
        """What was planned for, a short hash each: equal ones give equal plans, but for the seed of rays.

        An empty text stands for what tells nothing of its content, such as a function of Python.
        """
        grid, how = self.light_field.grid, self.how
        disparities = None if how.scene_distance is not None else grid.measured_disparity_range()
        # Rounded: other machines may measure disparities otherwise in the last digits.
        seen = disparities and [round(float(each), 3) for each in disparities]
        decisive = [field.name for field in fields(How) if field.name not in (*OF_THE_RUN, "seed")]
        return {
            "camera": _reported(self.camera),
            "light field": _reported(grid.shape[:4], grid.frame.matrix, grid.sample, grid.extent, seen),
            "options": _reported({name: getattr(how, name) for name in decisive}),
        }

    @property
    def picture_shape(self) -> tuple[int, ...]:
        """(rows, columns[, channels]) of a picture."""
        return *self.camera.sensor.shape, *self.light_field.grid.shape[4:]

    def __deepcopy__(self, memo: dict[int, Any]) -> Work:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return Work.of, (self.camera, self.light_field, self.how, self.chain.names)  # all is decided alike there


def _reported(*parts: Any) -> str:
    try:
        return fingerprint(*parts)
    except Unhashable:
        return ""


def listed(learn: Any) -> tuple[str, ...]:
    """Names of parameters, as they are given to be learned.

    Raises:
        InputError: text alone, what is no name, a name twice.
    """
    if isinstance(learn, str):
        raise InputError(f'learn is a list of names: write learn=["{learn}"]')
    names = tuple(learn)
    for name in names:
        if not isinstance(name, str):
            raise InputError(f"learn is a list of names of parameters, not of {type(name).__name__}")
        if names.count(name) > 1:
            raise InputError(f"{name} is listed {names.count(name)} times in learn: once will do")
    return names


def several_of(given: Mapping[str, tuple[int, ...]], own: Mapping[str, tuple[int, ...]]) -> set[str]:
    """Which parameters are given for many pictures, with one axis more in front than their own.

    Args:
        given: shapes of numbers, by parameter.
        own: shapes of the parameters.

    Raises:
        InputError: they have neither shape, or are for different numbers of pictures.
    """
    for name, shape in given.items():
        lead = len(shape) - len(own[name])
        if lead not in (0, 1) or shape[lead:] != own[name] or shape[:lead] == (0,):
            raise InputError(
                f"values for {name} have the shape {own[name]}, or that with an axis of pictures in front, "
                f"not {shape}"
            )
    several = {name for name, shape in given.items() if len(shape) > len(own[name])}
    counts = {given[name][0] for name in several}
    if len(counts) > 1:
        raise InputError(f"values for {', '.join(sorted(several))} have different numbers of pictures: {counts}")
    return several


def check_samples(shape: tuple[int, ...], grid: Grid) -> None:
    """Refuse samples that are not those of light fields on a grid, with any number of axes in front.

    Raises:
        InputError: they have another shape, or there are none.
    """
    if shape[-len(grid.shape) :] != grid.shape:
        raise InputError(
            f"samples have the shape {shape}, and the light field has {grid.shape}, with any number of axes in "
            "front for several of them"
        )
    if 0 in shape:
        raise InputError(f"samples of shape {shape} are none")


def by_an_engine(how: How) -> How:
    """What was chosen, by an engine that goes backwards to parameters: ``"numba"`` where none was.

    Raises:
        InputError: ``"array_api"`` or ``"cuda"`` was.
    """
    name = how.engine or chosen(None, None)
    if why := abilities(name).no_learning:
        raise InputError(f"engine={name!r} {why}: leave it out (numba), or pass 'reference', here")
    return replace(how, engine=name)


def kept_in(train: Train, name: str) -> float:
    """What numbers of a parameter are kept in multiples of while it learns: its scale, to a power of two.

    So that nothing is rounded by it.
    """
    return float(2.0 ** round(math.log2(scale(train, name))))


def explained_while_learning(work: Work, arrays: Numbers, scales: Mapping[str, float], plan_again: str) -> str:
    """The plan in words, what is learned, and what planning again would decide otherwise.

    Args:
        work: camera and light field.
        arrays: numbers of all that is learned, SI units.
        scales: what they are kept in multiples of, by name.
        plan_again: how to do that, in code.
    """
    in_pictures = {name: arrays[name] for name in work.chain.names}
    plan = work.chain.plan(in_pictures)
    learned = "\n".join(
        f"  {name}: {'×'.join(map(str, arrays[name].shape)) or 'a number'}, in steps of {step:.3g}"
        for name, step in scales.items()
    )
    otherwise = work.chain.replanned(in_pictures)
    said = (
        "Planning again would decide as it was decided."
        if not otherwise
        else f"Planning again ({plan_again}) would decide otherwise: {', '.join(otherwise)}."
    )
    parts = str(explained(put(work.camera, dict(arrays)), work.light_field, plan, work.how))
    return "\n\n".join([parts, f"What is learned\n{learned or '  nothing'}", said])


class Call:
    """Pictures by one plan or several, and what the way back needs of them.

    Args:
        work: camera and light field.
        names: of the parameters, in the order in which their numbers are given.
        several: those whose numbers have an axis of cameras in front.
    """

    def __init__(self, work: Work, names: tuple[str, ...], several: Collection[str]) -> None:
        self.work, self.names, self.several = work, names, several
        self.ahead: list[list[tuple[Drive, Partial | None]]] = []  # by light field and camera

    def made(self, samples: NDArray[Any] | None, numbers: Numbers) -> NDArray[np.floating]:
        """The pictures of one or several light fields by one or several cameras.

        Args:
            samples: (…, v, u, t, s[, channels]); None for the light field's own.
            numbers: of all parameters.

        Returns:
            (…, rows, columns[, channels]), the axis of cameras before those of the light fields.

        Raises:
            InputError: numbers that an element does not take, samples that are not finite.
        """
        self.begin(samples, numbers)
        found = np.stack([self._pictures(n) for n in range(len(self.ahead))], axis=1)
        cameras = (found.shape[0],) if self.several else ()
        lead = () if samples is None else samples.shape[: samples.ndim - len(self.work.light_field.grid.shape)]
        return found.reshape(*cameras, *lead, *found.shape[2:])

    def begin(self, samples: NDArray[Any] | None, numbers: Numbers) -> None:
        """Make the plans: enough for the way back where the pictures were made by another call.

        Args:
            samples: as for `made`.
            numbers: likewise.

        Raises:
            InputError: numbers that an element does not take.
        """
        work = self.work
        plans = [work.chain.plan(one) for one in self._cameras(numbers)]
        fields = [work.light_field]
        if samples is not None:
            kept = replace(work.light_field.grid, kind=samples.dtype)
            fields = [InMemory.of(one, kept) for one in samples.reshape(-1, *kept.shape)]
        self.ahead = [[(Drive.of_linear(plan, one, work.how), None) for plan in plans] for one in fields]

    def _cameras(self, numbers: Numbers) -> list[dict[str, NDArray[np.float64]]]:
        """The numbers of each camera; of one where no number has an axis of them."""
        count = len(numbers[next(iter(self.several))]) if self.several else 1
        return [
            {name: value[n] if name in self.several else value for name, value in numbers.items()}
            for n in range(count)
        ]

    def _pictures(self, n: int) -> NDArray[np.floating]:
        """The pictures of a light field by several plans, which read it once where they can."""
        drives = [drive for drive, _ in self.ahead[n]]
        found = rasters_each(drives)
        self.ahead[n] = list(zip(drives, found, strict=True))
        pictures = np.stack([drive.picture(each) for drive, each in zip(drives, found, strict=True)])
        if not np.isfinite(pictures).all():
            self.refuse()
        return pictures

    def refuse(self) -> NoReturn:
        """Say which samples are not finite, where what was made of them is not.

        Raises:
            InputError: always.
        """
        for ahead in self.ahead:
            values = ahead[0][0].given.whole()
            if values is not None:
                checks.all_finite("samples", np.asarray(values))
        raise InputError("the picture has values that are not finite: samples or parameters are too large")

    def back(
        self, weights: NDArray[np.floating], samples: bool, wanted: Collection[str], numbers: Mapping[str, Any]
    ) -> tuple[Any, dict[str, Any]]:
        """Derivatives of weighted pictures to samples and to parameters.

        Args:
            weights: of the pictures.
            samples: whether the derivative to them is wanted.
            wanted: names of parameters.
            numbers: of all parameters, at which the plans were made.
        """
        chain, cameras = self.work.chain, self._cameras(numbers)
        of_plan = {number for name in wanted for number in self.work.followed[name]}
        lead = weights.ndim - len(self.work.picture_shape)
        each = weights.reshape(len(cameras), len(self.ahead), *weights.shape[lead:])
        of_fields: list[Any] = [0] * len(self.ahead)
        pulled: list[dict[str, Any]] = []
        for n, one in enumerate(cameras):
            total = Gradient()
            for m, ahead in enumerate(self.ahead):
                drive, found = ahead[n]
                part = Backwards(drive, of_plan).gradient(each[n, m], samples_wanted=samples, found=found)
                if samples:
                    of_fields[m] = part.samples if n == 0 else of_fields[m] + part.samples
                total = total + replace(part, samples=None)
            pulled.append(chain.pull(one, total.gradients) if wanted else {})
        return _stacked(of_fields) if samples else None, {
            name: np.stack([one[name] for one in pulled])
            if name in self.several
            else sum(one[name] for one in pulled)
            for name in wanted
        }


def _stacked(arrays: list[Any]) -> Any:
    """Arrays with an axis in front; one alone, which may be large, is not copied."""
    return arrays[0][None] if len(arrays) == 1 else np.stack(arrays)
