"""Images by cameras with variable parameters: one plan or several, forward and backward, on NumPy arrays.

The modules for PyTorch and JAX build on this one; it does not depend on them.
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
    """The fixed part of a learning task; copies of a module share it.

    Args:
        camera: at the last planning, or when learning began.
        light_field: used if no other samples are given.
        how: the settings.
        chain: from parameters to plans and back.
        followed: the numbers of the plan that depend on each parameter.
    """

    camera: Train
    light_field: Samples
    how: How
    chain: Chain
    followed: Mapping[str, Collection[str]]

    @classmethod
    def of(cls, camera: Train, light_field: Samples, how: How, names: Sequence[str]) -> Work:
        """Make all choices, once, for the camera as it is.

        Raises:
            InputError: a light field in another library's arrays, a parameter that cannot be learned, a plan
                without derivatives.
        """
        whole = light_field.whole()
        if whole is not None and not isinstance(whole, np.ndarray):
            raise InputError(
                f"the light field is a {type(whole).__module__}.{type(whole).__name__}, but must be a NumPy "
                "array: pass light_field.replaced(numpy.asarray(values)), and these values as samples"
            )
        chain = Chain(camera, light_field.grid, how, names)
        Drive.of_linear(chain.plan(), light_field, how)
        return cls(camera, light_field, how, chain, {name: following(chain, name) for name in names})

    def planned_for(self) -> dict[str, str]:
        """Short hashes of the planner's inputs: equal hashes give equal plans, except for the seed of rays.

        Empty text stands for an input without a comparable content, such as a Python function.
        """
        grid, how = self.light_field.grid, self.how
        disparities = None if how.scene_distance is not None else grid.measured_disparity_range()
        # Rounded: estimates of disparity differ in the last digits between machines.
        seen = disparities and [round(float(each), 3) for each in disparities]
        decisive = [field.name for field in fields(How) if field.name not in (*OF_THE_RUN, "seed")]
        return {
            "camera": _reported(self.camera),
            "light field": _reported(grid.shape[:4], grid.frame.matrix, grid.sample, grid.extent, seen),
            "options": _reported({name: getattr(how, name) for name in decisive}),
        }

    @property
    def picture_shape(self) -> tuple[int, ...]:
        """(rows, columns[, channels]) of an image."""
        return *self.camera.sensor.shape, *self.light_field.grid.shape[4:]

    def __deepcopy__(self, memo: dict[int, Any]) -> Work:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return Work.of, (self.camera, self.light_field, self.how, self.chain.names)  # makes the same choices


def _reported(*parts: Any) -> str:
    try:
        return fingerprint(*parts)
    except Unhashable:
        return ""


def listed(learn: Any) -> tuple[str, ...]:
    """Check the names of the parameters to learn, and return them as a tuple.

    Raises:
        InputError: a single text, an item that is not text, a repeated name.
    """
    if isinstance(learn, str):
        raise InputError(f'learn is a list of names: write learn=["{learn}"]')
    names = tuple(learn)
    for name in names:
        if not isinstance(name, str):
            raise InputError(f"learn must be a list of parameter names, but contains a {type(name).__name__}")
        if names.count(name) > 1:
            raise InputError(f"{name} is listed {names.count(name)} times in learn: list it once")
    return names


def several_of(given: Mapping[str, tuple[int, ...]], own: Mapping[str, tuple[int, ...]]) -> set[str]:
    """The parameters with values for several images, which have one leading axis more than the parameter.

    Args:
        given: shapes of values, by parameter.
        own: shapes of the parameters.

    Raises:
        InputError: a wrong shape, or different numbers of images.
    """
    for name, shape in given.items():
        lead = len(shape) - len(own[name])
        if lead not in (0, 1) or shape[lead:] != own[name] or shape[:lead] == (0,):
            raise InputError(
                f"values for {name} must have the shape {own[name]}, or one more leading axis for several images, "
                f"not {shape}"
            )
    several = {name for name, shape in given.items() if len(shape) > len(own[name])}
    counts = {given[name][0] for name in several}
    if len(counts) > 1:
        raise InputError(f"values for {', '.join(sorted(several))} have different numbers of images: {counts}")
    return several


def check_samples(shape: tuple[int, ...], grid: Grid) -> None:
    """Check that samples have the shape of a grid, with any number of leading axes.

    Raises:
        InputError: a wrong shape, or no samples.
    """
    if shape[-len(grid.shape) :] != grid.shape:
        raise InputError(
            f"samples have the shape {shape}, but the light field has {grid.shape}; samples of several light "
            "fields have leading axes"
        )
    if 0 in shape:
        raise InputError(f"samples of shape {shape} are empty")


def by_an_engine(how: How) -> How:
    """The settings with an engine that supports gradients to parameters: ``"numba"`` if none was set.

    Raises:
        InputError: the engine is ``"array_api"`` or ``"cuda"``.
    """
    name = how.engine or chosen(None, None)
    if why := abilities(name).no_learning:
        raise InputError(f"engine={name!r} {why}: leave it out (numba), or pass 'reference', here")
    return replace(how, engine=name)


def kept_in(train: Train, name: str) -> float:
    """The unit in which a parameter is stored during learning: its scale, rounded to a power of two.

    A power of two makes scaling exact.
    """
    return float(2.0 ** round(math.log2(scale(train, name))))


def explained_while_learning(work: Work, arrays: Numbers, scales: Mapping[str, float], plan_again: str) -> str:
    """The plan as text, the learned parameters, and the choices that planning again would change.

    Args:
        work: camera and light field.
        arrays: all learned parameters, SI units.
        scales: their units of storage, by name.
        plan_again: the code with which a user plans again.
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
    """Images by one plan or several, and the data for their reverse pass.

    Args:
        work: camera and light field.
        names: of the parameters, in the order of their numbers.
        several: the parameters whose numbers have a leading axis of cameras.
    """

    def __init__(self, work: Work, names: tuple[str, ...], several: Collection[str]) -> None:
        self.work, self.names, self.several = work, names, several
        self.ahead: list[list[tuple[Drive, Partial | None]]] = []  # by light field and camera

    def made(self, samples: NDArray[Any] | None, numbers: Numbers) -> NDArray[np.floating]:
        """The images of one or several light fields by one or several cameras.

        Args:
            samples: (…, v, u, t, s[, channels]); None for the samples of the light field.
            numbers: of all parameters.

        Returns:
            (…, rows, columns[, channels]), the axis of cameras before those of the light fields.

        Raises:
            InputError: numbers that are invalid for an element, samples that are not finite.
        """
        self.begin(samples, numbers)
        found = np.stack([self._pictures(n) for n in range(len(self.ahead))], axis=1)
        cameras = (found.shape[0],) if self.several else ()
        lead = () if samples is None else samples.shape[: samples.ndim - len(self.work.light_field.grid.shape)]
        return found.reshape(*cameras, *lead, *found.shape[2:])

    def begin(self, samples: NDArray[Any] | None, numbers: Numbers) -> None:
        """Make the plans; this suffices for the reverse pass if another call made the images.

        Args:
            samples: as for `made`.
            numbers: as for `made`.

        Raises:
            InputError: numbers that are invalid for an element.
        """
        work = self.work
        plans = [work.chain.plan(one) for one in self._cameras(numbers)]
        fields = [work.light_field]
        if samples is not None:
            kept = replace(work.light_field.grid, kind=samples.dtype)
            fields = [InMemory.of(one, kept) for one in samples.reshape(-1, *kept.shape)]
        self.ahead = [[(Drive.of_linear(plan, one, work.how), None) for plan in plans] for one in fields]

    def _cameras(self, numbers: Numbers) -> list[dict[str, NDArray[np.float64]]]:
        """The numbers of each camera; of a single camera if no number has an axis of cameras."""
        count = len(numbers[next(iter(self.several))]) if self.several else 1
        return [
            {name: value[n] if name in self.several else value for name, value in numbers.items()}
            for n in range(count)
        ]

    def _pictures(self, n: int) -> NDArray[np.floating]:
        """The images of a light field by several plans, which share the reading of samples if possible."""
        drives = [drive for drive, _ in self.ahead[n]]
        found = rasters_each(drives)
        self.ahead[n] = list(zip(drives, found, strict=True))
        pictures = np.stack([drive.picture(each) for drive, each in zip(drives, found, strict=True)])
        if not np.isfinite(pictures).all():
            self.refuse()
        return pictures

    def refuse(self) -> NoReturn:
        """Raise an error that names the samples that are not finite, after a result that is not finite.

        Raises:
            InputError: always.
        """
        for ahead in self.ahead:
            values = ahead[0][0].given.whole()
            if values is not None:
                checks.all_finite("samples", np.asarray(values))
        raise InputError("the image has values that are not finite: samples or parameters are too large")

    def back(
        self, weights: NDArray[np.floating], samples: bool, wanted: Collection[str], numbers: Mapping[str, Any]
    ) -> tuple[Any, dict[str, Any]]:
        """Gradients of weighted images with respect to samples and parameters.

        Args:
            weights: of the images.
            samples: whether the gradient with respect to the samples is wanted.
            wanted: names of parameters.
            numbers: of all parameters, as for the plans.
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
    """Arrays stacked along a new leading axis; a single array, which may be large, is not copied."""
    return arrays[0][None] if len(arrays) == 1 else np.stack(arrays)
