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
from vcc.learn.parameters import put
from vcc.learn.paths import Paths
from vcc.learn.scales import scale
from vcc.optics.train import Train
from vcc.plan.how import OF_THE_RUN, How
from vcc.plan.protocol import Gradient, Partial
from vcc.run.backwards import Backwards
from vcc.run.bands import Mixing, SomeChannels, bands_as_text, read_once
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
        paths: from parameters to plans and back, and to the weights of the plans' images.
        fields: the light field, or the channels of it that take each path.
    """

    camera: Train
    light_field: Samples
    how: How
    paths: Paths
    fields: Sequence[Samples]

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
        paths = Paths.of(camera, light_field.grid, how, names)
        fields = parted(paths, light_field if len(paths.each) == 1 else read_once(light_field, how))
        for path, field in zip(paths.each, fields, strict=True):
            Drive.of_linear(path.chain.plan(), field, how)
        return cls(camera, light_field, how, paths, fields)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the parameters."""
        return self.paths.names

    def planned_for(self) -> dict[str, str]:
        """Short hashes of the planner's inputs: equal hashes give equal plans, except for the seed of rays.

        Empty text stands for an input without a comparable content, such as a Python function.
        """
        grid, how = self.light_field.grid, self.how
        disparities = None if how.scene_distance is not None else grid.measured_disparity_range()
        # Rounded: estimates of disparity differ in the last digits between machines.
        seen = disparities and [round(float(each), 3) for each in disparities]
        bands = [grid.wavelengths] if self.camera.depends_on_bands else []
        left_out = (*OF_THE_RUN, "seed", *([] if how.diffraction else ["diffraction"]))
        decisive = [field.name for field in fields(How) if field.name not in left_out]
        return {
            "camera": _reported(self.camera),
            "light field": _reported(grid.shape[:4], grid.frame.matrix, grid.sample, grid.extent, seen, *bands),
            "options": _reported({name: getattr(how, name) for name in decisive}),
        }

    @property
    def picture_shape(self) -> tuple[int, ...]:
        """(rows, columns[, channels]) of an image."""
        channels = self.camera.sensor.channels_of(self.light_field.grid.channels)
        return *self.camera.sensor.shape, *(() if channels is None else (channels,))

    def __deepcopy__(self, memo: dict[int, Any]) -> Work:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        return Work.of, (self.camera, self.light_field, self.how, self.names)  # makes the same choices


def parted(paths: Paths, light_field: Samples) -> list[Samples]:
    """The channels of a light field that take each path."""
    return [
        light_field if path.channels is None else SomeChannels.of(light_field, path.channels)
        for path in paths.each
    ]


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
    learned = "\n".join(
        f"  {name}: {'×'.join(map(str, arrays[name].shape)) or 'a number'}, in steps of {step:.3g}"
        for name, step in scales.items()
    )
    said_of: list[str] = []
    otherwise: dict[str, None] = {}
    for path, field in zip(work.paths.each, work.fields, strict=True):
        values = path.values(arrays)
        otherwise |= dict.fromkeys(path.chain.replanned(values))
        if not said_of:
            train = path.chain.seen(put(work.camera, values))
            said_of = [str(explained(train, field, path.chain.plan(values), work.how))]
    if len(work.paths.each) > 1:
        bands = bands_as_text(work.paths.each[0].channels or (), work.light_field.grid.wavelengths)
        said_of.append(f"This is one of {len(work.paths.each)} plans: {bands}.")
    said = (
        "Planning again would decide as it was decided."
        if not otherwise
        else f"Planning again ({plan_again}) would decide otherwise: {', '.join(otherwise)}."
    )
    return "\n\n".join([*said_of, f"What is learned\n{learned or '  nothing'}", said])


class Call:
    """Images by one plan or several, and the data for their reverse pass.

    Args:
        work: camera and light field.
        names: of the parameters, in the order of their numbers.
        several: the parameters whose numbers have a leading axis of cameras.
    """

    def __init__(self, work: Work, names: tuple[str, ...], several: Collection[str]) -> None:
        self.work, self.names, self.several = work, names, several
        self.ahead: list[list[list[tuple[Drive, Partial | None]]]] = []  # by light field, path and camera

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
        mixings = [self.work.paths.mixing(one) for one in self._cameras(numbers)]
        found = np.stack([self._pictures(n, mixings) for n in range(len(self.ahead))], axis=1)
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
        cameras = self._cameras(numbers)
        plans = [[path.chain.plan(path.values(one)) for one in cameras] for path in work.paths.each]
        fields = [work.fields]
        if samples is not None:
            kept = replace(work.light_field.grid, kind=samples.dtype)
            fields = [parted(work.paths, InMemory.of(one, kept)) for one in samples.reshape(-1, *kept.shape)]
        self.ahead = [
            [
                [(Drive.of_linear(plan, field, work.how), None) for plan in of_path]
                for of_path, field in zip(plans, of_field, strict=True)
            ]
            for of_field in fields
        ]

    def _cameras(self, numbers: Numbers) -> list[dict[str, NDArray[np.float64]]]:
        """The numbers of each camera; of a single camera if no number has an axis of cameras."""
        count = len(numbers[next(iter(self.several))]) if self.several else 1
        return [
            {name: value[n] if name in self.several else value for name, value in numbers.items()}
            for n in range(count)
        ]

    def _pictures(self, n: int, mixings: Sequence[Mixing | None]) -> NDArray[np.floating]:
        """The images of a light field by several cameras, which share the reading of samples if possible."""
        of_paths: list[list[Any]] = []
        for number, ahead in enumerate(self.ahead[n]):
            drives = [drive for drive, _ in ahead]
            found = rasters_each(drives)
            self.ahead[n][number] = list(zip(drives, found, strict=True))
            of_paths.append([drive.picture(each) for drive, each in zip(drives, found, strict=True)])
        by_camera = zip(mixings, zip(*of_paths, strict=True), strict=True)
        pictures = np.stack([images[0] if mixing is None else mixing(images) for mixing, images in by_camera])
        if not np.isfinite(pictures).all():
            self.refuse()
        return pictures

    def refuse(self) -> NoReturn:
        """Raise an error that names the samples that are not finite, after a result that is not finite.

        Raises:
            InputError: always.
        """
        for drive in (ahead[0][0] for of_field in self.ahead for ahead in of_field):
            values = drive.given.whole()
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
        cameras = self._cameras(numbers)
        lead = weights.ndim - len(self.work.picture_shape)
        each = weights.reshape(len(cameras), len(self.ahead), *weights.shape[lead:])
        of_fields: list[Any] = [None] * len(self.ahead)
        pulled: list[dict[str, Any]] = []
        for n, one in enumerate(cameras):
            mixing = self.work.paths.mixing(one)
            gradients: dict[str, Any] = dict.fromkeys(wanted, 0.0)
            mixed_by = [name for name in wanted if name in self.work.paths.mixed_by]
            slopes: list[Any] = [0.0] * len(self.work.paths.each)
            for number, path in enumerate(self.work.paths.each):
                names = [name for name in wanted if name in path.followed]
                of_plan = {followed for name in names for followed in path.followed[name]}
                total = Gradient()
                for m, ahead in enumerate(self.ahead):
                    drive, found = ahead[number][n]
                    given = each[n, m] if mixing is None else mixing.transposed(each[n, m], number)
                    part = Backwards(drive, of_plan).gradient(given, samples_wanted=samples, found=found)
                    if samples:
                        of_fields[m] = self._added(of_fields[m], part.samples, path.channels)
                    total = total + replace(part, samples=None)
                    if mixing is not None and mixed_by:
                        image = drive.picture(drive.rounds() if found is None else found)
                        slopes[number] = slopes[number] + mixing.slopes(image, each[n, m], number)
                for name, gradient in path.chain.pull(path.values(one), total.gradients, names).items():
                    gradients[name] = gradients[name] + gradient
            for name in mixed_by:
                gradients[name] = gradients[name] + self.work.paths.pull(one, name, slopes)
            pulled.append({name: gradients[name] + np.zeros(np.shape(one[name])) for name in wanted})
        return _stacked(of_fields) if samples else None, {
            name: np.stack([one[name] for one in pulled])
            if name in self.several
            else sum(one[name] for one in pulled)
            for name in wanted
        }

    def _added(self, total: Any, part: Any, channels: tuple[int, ...] | None) -> Any:
        """The gradient to all samples, with that of some channels added; a sum of one is not copied."""
        grid = self.work.light_field.grid
        if channels is None or grid.channels is None or channels == tuple(range(grid.channels)):
            return part if total is None else total + part
        total = np.zeros(grid.shape, part.dtype) if total is None else total
        for place, channel in enumerate(channels or ()):
            total[..., channel] += part[..., place]
        return total


def _stacked(arrays: list[Any]) -> Any:
    """Arrays stacked along a new leading axis; a single array, which may be large, is not copied."""
    return arrays[0][None] if len(arrays) == 1 else np.stack(arrays)
