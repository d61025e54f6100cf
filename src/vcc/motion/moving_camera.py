"""A camera whose parameters are functions of time, and the image that it records during an exposure."""

from __future__ import annotations

import math
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from typing import Any, Self, Unpack

import numpy as np
from numpy.typing import NDArray

from vcc.advice.explain import Explanation, wrapped
from vcc.base import checks
from vcc.base.cached import cached
from vcc.base.describe import Brief
from vcc.base.errors import InputError, warn_of_result
from vcc.base.notices import Notices
from vcc.base.progress import Progress, tell
from vcc.camera import Camera, captured_in_batches
from vcc.fields.sampled import library_of
from vcc.fields.samples import Samples
from vcc.image import Image
from vcc.learn.parameters import place, replaced
from vcc.motion.courses import Course, course, pieces
from vcc.motion.light import Light, light_of
from vcc.motion.moving_writing import write_moving
from vcc.motion.quadrature import LEAST, MOST, Mean, mean_over
from vcc.motion.video import LightFieldVideo
from vcc.motion.words import course_in_words
from vcc.plan.how import How, Options
from vcc.store.video_reading import StoredVideo

TOLERANCE = 2e-3
"""As a share of the image's mean: half of an 8-bit step relative to white."""
KEPT = 2**28
"""Bytes of images that are kept for repeated states of camera and light; half of it limits a batch."""

State = tuple[Camera, Any]
"""A camera, and the key of the light field before it."""


@dataclass(frozen=True, eq=False, repr=False)
class MovingCamera(Brief):
    """A camera that changes while its sensor gathers light.

    Times count from the start of the exposure.

    Args:
        camera: provides all parameters that do not change.
        courses: names of parameters, as in sweeps and learning (``"sensor.z"``, ``"code.pattern"``,
            ``"code.decentre"``), and their values over time: a function from seconds to a value that the
            camera accepts (SI units), or `Steps` or `Lines`.
        shutter: the transmission of the shutter, 0 to 1, likewise; None for always open.

    Raises:
        InputError: unknown parameter (the message lists the available ones), or not a course; initial values
            that the camera rejects.
    """

    camera: Camera
    courses: Mapping[str, Course | Callable[[float], Any]] = field(default_factory=dict)
    shutter: Course | Callable[[float], float] | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.camera, Camera):
            raise InputError(f"camera must be a vcc.Camera, not a {type(self.camera).__name__}")
        if not isinstance(self.courses, Mapping):
            raise InputError(
                'courses must be a mapping such as {"sensor.z": lambda t: 52 * mm + 0.1 * t}, not a '
                f"{type(self.courses).__name__}"
            )
        object.__setattr__(self, "courses", {name: course(each) for name, each in self.courses.items()})
        if self.shutter is not None:
            object.__setattr__(self, "shutter", course(self.shutter))
        self.at(0.0)

    def at(self, time: float) -> Camera:
        """The camera at a time after the start of the exposure, seconds.

        Raises:
            InputError: the camera rejects its values at that time; the message contains the time.
        """
        if not self.courses:
            return self.camera
        with checks.within(f"at {time:g} s"):
            return replaced(self.camera, {name: each(time) for name, each in self.courses.items()})

    def open_at(self, time: float) -> float:
        """The transmission of the shutter, 0 to 1.

        Raises:
            InputError: the value of the shutter is not such a number.
        """
        if self.shutter is None:
            return 1.0
        return checks.zero_or_more(f"the shutter at {time:g} s", self.shutter(time), most=1)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times at which a parameter or the shutter jumps or bends, seconds."""
        changing: list[Any] = [*self.courses.values(), *([] if self.shutter is None else [self.shutter])]
        return tuple(sorted({time for each in changing for time in each.breaks}))

    def listed(self) -> list[str]:
        """The changing parameters, one per line: ``"sensor.z changes linearly, 51 mm at 0 s, 53 mm at 90 ms"``."""
        found = {name: (each, place(self.camera, name)) for name, each in self.courses.items()}
        lines = [f"{name} {course_in_words(*each)}" for name, each in found.items()]
        return [*lines, *([] if self.shutter is None else [f"shutter {course_in_words(self.shutter)}"])]

    def save(self, path: str | PathLike[str]) -> None:
        """Write this camera as a TOML file for `vcc.motion.load_moving_camera`.

        Loading it returns a camera that is equal at all times. See `vcc.camera_file.save_camera` for further
        files that may be written.

        Args:
            path: the file; an older file of that name is replaced.

        Raises:
            InputError: a function of time or anything else that a file cannot hold (`Lines` and `Steps` are
                supported), or a folder that cannot be written to.
        """
        write_moving(self.camera, self.courses, self.shutter, path)

    def explain(
        self,
        light_field: Samples | LightFieldVideo | StoredVideo | Callable[[float], Samples],
        how: How | None = None,
        *,
        start: float = 0.0,
        executor: Any = None,
        progress: Progress | None = None,
        **options: Unpack[Options],
    ) -> Explanation:
        """The changing parameters as text, followed by `vcc.Camera.explain` for the start of the exposure.

        Args:
            light_field: as in `capture`.
            how: as in `capture`.
            start: as in `capture`.
            executor: as in `capture`.
            progress: as in `vcc.Camera.explain`.
            options: as in `capture`.

        Returns:
            Text; its plan and its estimated seconds apply to the start of the exposure.

        Raises:
            InputError: as `vcc.Camera.explain`; a video that does not contain the start.
        """
        light = light_of(light_field)
        light.check_lasts(start, start)
        samples = light.at(start)[0][1]()
        one = self.at(0.0).explain(samples, how, executor=executor, progress=progress, **options)
        if not self.listed():
            return one
        changing = [
            "What changes over time",
            *self.listed(),
            f"steps need one image for each state, other changes at least {LEAST} moments between breaks; the "
            "rest of this text is about the start of the exposure",
        ]
        found = Explanation(wrapped("\n  ".join(changing)) + f"\n\n{one}")
        found.plan, found.expected_seconds = one.plan, one.expected_seconds
        found.expected_seconds_by_executor = one.expected_seconds_by_executor
        return found

    def capture(
        self,
        light_field: Samples | LightFieldVideo | StoredVideo | Callable[[float], Samples],
        exposure: float,
        how: How | None = None,
        *,
        start: float = 0.0,
        time_tolerance: float = TOLERANCE,
        executor: Any = None,
        progress: Progress | None = None,
        **options: Unpack[Options],
    ) -> Image:
        """The image that the sensor gathers over an exposure.

        It is (1/T)·∫ q(t)·E(t) dt over the exposure T, with the shutter's q and the irradiance E that the
        camera of each moment would record. For a static camera with an open shutter the result is that of
        `vcc.Camera.capture`, and `vcc.expose_image` with the same exposure time records it. Each pixel
        gathers the light that reaches it wherever it moves.

        The integral is split where a value switches or bends and at frames, and each part is refined until
        its estimated error is small enough (`vcc.motion.quadrature.mean_over`). Images of the same camera and
        frame are computed once; steps cost one image per state. Other images of the same light field are made
        in batches that share work, as in a sweep (`vcc.sweep`).

        Args:
            light_field: a static one, a video, or a function from seconds to a light field; all of one shape.
            exposure: T, seconds; 0 for the image at the start of the exposure.
            how: as in `vcc.Camera.capture`.
            start: start of the exposure, in the time of the video or function, seconds.
            time_tolerance: refine until the estimated error of the mean over time, root mean square over the
                pixels, is at most this share of the image's mean, with up to 729 moments in each part.
            executor: as in `vcc.Camera.capture`: runs the blocks of a stored light field, for one moment
                after the other. None makes the images in this process; each block is then read once for all
                moments of a batch.
            progress: called with (done, total) in parts of the exposure.
            options: as in `vcc.Camera.capture`.

        Returns:
            Irradiance, radiance × steradian, in the frame of the camera as it was given. Its
            ``sampling_error`` is the estimated error of rays and moments together. If rays are traced, each
            image uses other rays (``seed``, ``seed`` + 1, …).

        Warns:
            ResultWarning: the tolerance was not reached; also the warnings of `vcc.Camera.capture`, once for
                each kind.

        Raises:
            InputError: an exposure below 0, a video that is too short, a transmission of the shutter below 0
                or above 1; values that the camera rejects at some time; see also `vcc.Camera.capture`.
        """
        length = checks.zero_or_more("exposure", exposure, unit="s")
        begun = checks.finite("start", start, "seconds")
        tolerance = checks.above_zero("time_tolerance", time_tolerance, "a share of the picture's mean")
        light = light_of(light_field)
        light.check_lasts(begun, begun + length)
        work = _Work(self, light, begun, How.of(how, options), executor)
        return work.gathered(length, tolerance, progress) if length > 0 else work.at_once()


@dataclass(frozen=True, eq=False)
class _Gathered:
    """Irradiance with its errors, in double precision, as a term of the sum over time.

    Args:
        values: irradiance.
        missing_rays: share of missing rays.
        errors: sampling errors by the number of the image; errors of different images are independent.
    """

    values: NDArray[np.float64]
    missing_rays: float
    errors: Mapping[int, float]

    def __add__(self, other: Self) -> Self:
        errors = dict(self.errors)
        for number, error in other.errors.items():
            errors[number] = errors.get(number, 0.0) + error
        return replace(
            self,
            values=self.values + other.values,
            missing_rays=self.missing_rays + other.missing_rays,
            errors=errors,
        )

    def __mul__(self, factor: float) -> Self:
        if factor == 1:
            return self
        return replace(
            self,
            values=self.values * factor,
            missing_rays=self.missing_rays * factor,
            errors={number: error * factor for number, error in self.errors.items()},
        )

    @property
    def sampling_error(self) -> float:
        """The root of the sum of squared errors of all images."""
        return math.hypot(*self.errors.values())

    def size(self) -> float:
        return float(self.values.mean())

    def distance(self, other: Self) -> float:
        return math.sqrt(float(np.square(self.values - other.values).mean()))


class _Work:
    """One exposure: images of moments, with a cache of the latest states."""

    def __init__(self, moving: MovingCamera, light: Light, start: float, how: How, executor: Any) -> None:
        self._moving, self._light, self._start, self._how = moving, light, start, how
        self._executor = executor
        self._kept: OrderedDict[State, _Gathered] = OrderedDict()
        self._remarks, self._made, self._at_once = Notices(), 0, 1

    def gathered(self, exposure: float, tolerance: float, progress: Progress | None) -> Image:
        breaks = (*self._moving.breaks, *(time - self._start for time in self._light.breaks))
        parts = pieces(0.0, exposure, breaks)
        for begin, _ in parts:  # fail before long work
            self._parts(begin)
        total, error, reached, passed = None, 0.0, True, 0.0
        for done, (begin, end) in enumerate(parts, start=1):
            share = (end - begin) / exposure
            found: Mean[_Gathered] = mean_over(begin, end, self._moments, tolerance, MOST)
            part = found.value * share
            total = part if total is None else total + part
            error, reached = error + share * found.error, reached and found.reached
            passed += share * self._moving.open_at((begin + end) / 2)
            tell(progress, done, len(parts))
        assert total is not None
        self._remarks.say(self._made, "moments")
        if not reached:
            warn_of_result(
                f"the error of the mean over time is estimated as {error:.2g}, {error / total.size():.2g} of "
                f"the picture's mean, after {MOST} moments of a part of the exposure; the tolerance is "
                f"{tolerance:g}. Give the times of jumps (vcc.motion.Steps, vcc.motion.Function(…, breaks=…))"
            )
        return self._image(total, error, passed)

    def at_once(self) -> Image:
        """The image at the start of the exposure."""
        found = next(self._moments([0.0]))
        self._remarks.say(self._made, "moments")
        return self._image(found, 0.0, self._moving.open_at(0.0))

    def _image(self, total: _Gathered, error: float, passed: float) -> Image:
        camera = self._moving.camera
        return Image(
            total.values.astype(np.float32),
            camera.sensor.frame,
            missing_rays=total.missing_rays / passed if passed > 0 else 0.0,
            sampling_error=total.sampling_error + error,
            camera=camera,
        )

    def _moments(self, times: Sequence[float]) -> Iterator[_Gathered]:
        """The irradiance at times after the start of the exposure, computed in batches."""
        done = 0
        while done < len(times):
            asked = [self._parts(time) for time in times[done : done + self._at_once]]
            done += len(asked)
            wanted = {state: samples for parts in asked for state, samples, _ in parts}
            made = self._pictures(wanted)
            for parts in asked:
                yield _sum([made[state] * share for state, _, share in parts]) if parts else self._dark

    def _parts(self, time: float) -> list[tuple[State, Callable[[], Samples], float]]:
        """The cameras and light fields at a time, and their shares; empty while the shutter is closed."""
        through = self._moving.open_at(time)
        if through == 0:
            return []
        camera, pixels = self._moving.at(time), self._moving.camera.sensor.shape
        if camera.sensor.shape != pixels:
            raise InputError(
                f"the sensor has {camera.sensor.shape} pixels at {time:g} s and {pixels} otherwise: their "
                "number must not change during an exposure"
            )
        frames = self._light.at(self._start + time)
        return [((camera, key), samples, share * through) for key, samples, share in frames]

    @property
    @cached
    def _dark(self) -> _Gathered:
        sensor = self._moving.camera.sensor
        channels = sensor.channels_of(next(iter(self._light.at(self._start)))[1]().grid.channels)
        return _Gathered(np.zeros((*sensor.shape, *([] if channels is None else [channels]))), 0.0, {})

    def _pictures(self, wanted: Mapping[State, Callable[[], Samples]]) -> dict[State, _Gathered]:
        """The images of cameras and light fields, each computed once while it is in the cache."""
        there = {state: self._kept[state] for state in wanted if state in self._kept}
        for state in there:
            self._kept.move_to_end(state)
        # Different rays for each image, so that their errors average out.
        numbers = {state: self._made + n for n, state in enumerate(each for each in wanted if each not in there)}
        for light in dict.fromkeys(light for _, light in numbers):
            states = [state for state in numbers if state[1] == light]
            with self._remarks.gathered():
                images = self._captured(states, wanted[states[0]](), [numbers[state] for state in states])
            for state, image in zip(states, images, strict=True):
                there[state] = self._kept[state] = _gathered(image, numbers[state])
        self._made += len(numbers)
        self._forget()
        return there

    def _captured(self, states: Sequence[State], samples: Samples, numbers: Sequence[int]) -> list[Image]:
        """The images of cameras before one light field, each by rays of its own seed."""
        cameras, seeds = [camera for camera, _ in states], [self._how.seed + number for number in numbers]
        if self._executor is None and len(cameras) > 1:
            return captured_in_batches(cameras, samples, self._how, seeds=seeds)
        return [
            camera.capture(samples, replace(self._how, seed=seed), executor=self._executor)
            for camera, seed in zip(cameras, seeds, strict=True)
        ]

    def _forget(self) -> None:
        """Drop the least recently used images, and update the size of batches."""
        if self._kept:
            most = KEPT // next(iter(self._kept.values())).values.nbytes
            self._at_once = max(most // 2, 1)
            while len(self._kept) > max(most, 2):
                self._kept.popitem(last=False)


def _gathered(image: Image, number: int) -> _Gathered:
    """An image as a term of the sum; its number identifies its error."""
    if not isinstance(image.values, np.ndarray):
        raise InputError(
            f"a moving camera supports samples of NumPy, not of {library_of(image.values)}, "
            "because it does not propagate gradients: sum images of camera.capture yourself"
        )
    return _Gathered(image.values.astype(np.float64), image.missing_rays, {number: image.sampling_error})


def _sum(parts: list[_Gathered]) -> _Gathered:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total
