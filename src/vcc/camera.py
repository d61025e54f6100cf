"""The camera class: an optical train with methods that capture, expose, explain and draw."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Iterator, Sequence
from os import PathLike
from typing import Any, Literal, Self, TypeVar, Unpack

from vcc.advice.colour import colour_section, middle_of
from vcc.advice.explain import Explanation, explained
from vcc.advice.of_images import Cautions
from vcc.advice.real_lens import lens_section
from vcc.base import checks, lazy_import
from vcc.base.errors import InputError, warn_of_result
from vcc.base.progress import Progress, part_of
from vcc.base.wavelengths import wavelength as checked_wavelength
from vcc.fields.grid import Grid
from vcc.fields.samples import InMemory, Samples, check_is_light_field
from vcc.files.camera_writing import write_train
from vcc.image import Image, PhotodiodeImage, interleaved
from vcc.optics.band import Band
from vcc.optics.bands import SameWay, single_way, trains_of
from vcc.optics.electronics import Electronics
from vcc.optics.faces import Element
from vcc.optics.focusing import By, focused_train, moved_train, refocused_train
from vcc.optics.plenoptic import Plenoptic
from vcc.optics.sensor import Sensor
from vcc.optics.train import Train
from vcc.plan.choice import compile_best, compiled_each, mixture_of
from vcc.plan.how import OF_THE_RUN, How, Options
from vcc.plan.model import Plan
from vcc.plan.protocol import OutputBuffers
from vcc.plan.stop_diffraction import IN_FOCUS_ONLY
from vcc.plot.camera_plot import plot_camera
from vcc.recording import Recording, recorded
from vcc.run.bands import (
    BandImages,
    BandPlans,
    SomeChannels,
    as_share,
    bands_as_text,
    largest_shares,
    once_each,
    read_once,
    response_matrix,
)
from vcc.run.batches import may_be_mixed, recorded_each, recorded_mixed
from vcc.run.by_depth import DepthChange
from vcc.run.drive import Recorded, drive
from vcc.run.expose import Exposure
from vcc.run.operator import BandOperator, LinearMap, Operator
from vcc.run.operators import carried_to

Field = TypeVar("Field", bound=InMemory)


def _warn_of(cautions: Iterable[str]) -> None:
    for caution in cautions:
        warn_of_result(caution)


def _plan_of(train: Train, light_field: Samples, how: How, progress: Progress | None = None) -> Plan:
    """The plan of a train that all channels of a light field take."""
    light_field.check_complete()
    if how.between_views == "depth" and max(light_field.grid.shape[:2]) > 1:
        light_field.grid.disparities.maps(progress)  # now, so that progress is reported
    return compile_best(train, light_field.grid, how)


def _check_of_the_run(options: Options) -> None:
    """Raise an error for options that are fixed when a plan is made."""
    for name in options:
        if name not in OF_THE_RUN:
            raise InputError(
                f"{name} is fixed when a plan is made: leave it out, or pass it to camera.compile and pass "
                "that plan here"
            )


def _place_of(name: str, elements: Sequence[Element]) -> int:
    """The index of the element with a name, or of a kind."""
    called = [element.name or element.kind.replace(" ", "_") for element in elements]
    if called.count(name) == 1:
        return called.index(name)
    found = "several elements are" if name in called else "no element is"
    raise InputError(f"{found} called {name!r}: this camera has {', '.join(called) or 'no elements'}")


class Camera(Train):
    """Elements along an axis and a sensor behind them.

    A light field given to the camera is at the entrance plane, z = 0. Cameras with equal elements and sensors are
    equal, and can be keys of a cache.

    Args:
        elements: in any order; sorted by z. The order of elements at the same z does not matter.
        sensor: records the image; required.
        name: stored in images as their camera; the name of the camera's file if there is one; not compared.

    Raises:
        InputError: no sensor, an invalid element, an element before the entrance plane or behind the sensor,
            or two elements with the same name.
    """

    @classmethod
    def focused(cls, elements: Iterable[Element], sensor: Sensor, distance: float, *, name: str = "") -> Self:
        """A camera with its sensor at the plane where a point is sharp, by first-order optics.

        Lenses, first-order systems and quadratic plates count: 1/f = 1/Z + 1/d for one thin lens. Lens
        arrays, other plates, masks and diffusers are ignored, since they do not focus as a lens does.

        Args:
            elements: as for the camera itself.
            sensor: its z is ignored (0 will do) and computed.
            distance: Z, from the point to the entrance plane, metres, positive; ``math.inf`` for a distant scene.
            name: as for the camera itself.

        Raises:
            InputError: no real image of the point, or one before the last element; an image that is sharp
                along one axis only; or an error of the camera itself.
        """
        train = focused_train(elements, sensor, distance)
        return cls(train.elements, train.sensor, name=name)

    def focused_at(
        self,
        distance: float,
        *,
        by: By = "first order",
        frequency: float | None = None,
        fields: Sequence[float] = (0.0,),
        moves: str = "sensor",
    ) -> Self:
        """The same camera with its sensor at the plane where a point is sharp, or with a lens moved instead.

        Args:
            distance: Z, from the point to the entrance plane, metres, positive; ``math.inf`` for a distant scene.
            by: ``"first order"``: as `Camera.focused`; ``"spot"``: by real rays, where the mean square radius of
                spots is smallest; ``"mtf"``: where their contrast at a frequency is largest on average along x and
                y. `vcc.analysis.best_focus` returns the sizes of the spots as well.
            frequency: of ``"mtf"``, cycles per metre on the sensor.
            fields: of ``"spot"`` and ``"mtf"``: which points count, alike: their images' distances from the middle
                of the sensor, as fractions of its half diagonal. The default is the axis alone. The lines F, d
                and C count alike where the camera disperses.
            moves: ``"sensor"``, or the name of an element as in `Camera.replace`: it moves along the axis, and the
                sensor and the entrance plane, from which ``distance`` counts, stay.

        Raises:
            InputError: as for `Camera.focused`; by real rays: nothing bounds the light, a diffuser, or a field
                without light; no such element, or no place of it that focuses the point.
        """
        if moves != "sensor":
            place = _place_of(moves, self.elements)
            moved = moved_train(self.elements, self.sensor, distance, by, frequency, fields, moves=place)
            return type(self)(moved.elements, moved.sensor, name=self.name)
        train = refocused_train(self.elements, self.sensor, distance, by, frequency, fields)
        return type(self)(train.elements, train.sensor, name=self.name)

    def replace(
        self,
        *,
        elements: Iterable[Element] | None = None,
        sensor: Sensor | None = None,
        name: str | None = None,
        **by_name: Element,
    ) -> Self:
        """The same camera with some of its parts replaced.

        ``camera.replace(code=dataclasses.replace(mask, z=30 * mm))`` replaces the element named "code".

        Args:
            elements: all elements; None keeps them.
            sensor: None keeps it.
            name: None keeps it.
            by_name: new elements by the name of the element to replace; an element without a name has the
                name of its kind, such as ``lens`` or ``lens_array``, if it is the only one of that kind.

        Raises:
            InputError: no element, or several, with this name; or as for the camera itself.
        """
        listed = list(self.elements if elements is None else elements)
        for wanted, new in by_name.items():
            place = _place_of(wanted, listed)
            listed[place] = new if new.name else dataclasses.replace(new, name=listed[place].name)
        return type(self)(listed, sensor or self.sensor, name=self.name if name is None else name)

    @classmethod
    def plenoptic(
        cls,
        focal_length: float,
        *,
        lenslet_pitch: float,
        f_number: float,
        pixels_per_lenslet: int | None = None,
        lenslets: tuple[int, int] | None = None,
        sensor_size: tuple[float, float] | None = None,
        pixel_pitch: float | None = None,
        focus_distance: float = math.inf,
        electronics: Electronics | None = None,
        name: str = "",
    ) -> Self:
        """A main lens, lenslets at its image of a given distance, and a sensor behind them at their focus.

        F-numbers match, so that micro-images touch and do not overlap (Ng et al. 2005): with b from lenslets
        to sensor, d from main lens to lenslets and the pitch p, b = f_number · p, and the main lens has the
        diameter D = d·p·(1 + b/d)/b. The width of a micro-image is p·(1 + b/d).

        Specify the sensor by ``pixels_per_lenslet`` and ``lenslets``, or by ``sensor_size`` and ``pixel_pitch``.

        Decoding uses views one pixel apart, counted from the middle of a micro-image, and no pixel that two
        micro-images share: n pixels across give 1 + 2·floor((n − 1)/2) views along each axis. 9 pixels give 9×9
        views, 4 pixels give 3×3. `vcc.recover.Decoder.of(camera).views` returns their number.

        Args:
            focal_length: of the main lens, metres.
            lenslet_pitch: p, metres.
            f_number: of the lenslets, b/p, and of the main lens as the sensor sees it, (d + b)/D.
            pixels_per_lenslet: pixels across one micro-image.
            lenslets: (rows, columns): the pixels of a view.
            sensor_size: (height, width) of the sensor, metres; it is filled with whole pixels.
            pixel_pitch: metres; micro-images need not be whole numbers of pixels wide.
            focus_distance: of the plane that the main lens images on the lenslets, metres; may be infinite.
            electronics: of the sensor.
            name: as for the camera itself.

        Raises:
            InputError: a length or f-number that is not positive, numbers of pixels or lenslets that are not
                integers, a sensor specified in neither or both ways, or a distance within the focal length.
        """
        design = Plenoptic(
            focal_length,
            lenslet_pitch,
            f_number,
            pixels_per_lenslet,
            lenslets,
            focus_distance,
            sensor_size,
            pixel_pitch,
        )
        return cls(design.elements, design.sensor(electronics), name=name)

    def compile(
        self,
        light_field: Samples,
        how: How | None = None,
        *,
        progress: Progress | None = None,
        **options: Unpack[Options],
    ) -> Plan | BandPlans:
        """Make the plan by which an engine computes the image; `capture` does this automatically.

        Args:
            light_field: as in `capture`; its samples are read only to estimate disparities.
            how: as in `capture`.
            progress: called with (done, total) while disparities are estimated, if they are needed.
            options: as in `capture`.

        Returns:
            A plan; for elements that depend on the wavelength or the channel, and a sensor with a response, a plan
            for each group of bands (`vcc.run.bands.BandPlans`).

        Raises:
            InputError: as for `capture`; or pixels that have several photodiodes or angular responses.
        """
        check_is_light_field(light_field)
        light_field.check_complete()
        chosen = How.of(how, options)
        if not self.depends_on_bands:
            return _plan_of(self, light_field, chosen, progress)
        trains = self._trains_of(light_field.grid)
        plans = [
            _plan_of(
                same.train,
                SomeChannels.of(light_field, same.channels),
                chosen,
                part_of(progress, number, len(trains)),
            )
            for number, same in enumerate(trains)
        ]
        return BandPlans(trains, plans)

    def _trains_of(self, grid: Grid) -> list[SameWay]:
        """The trains that the bands of a light field take, after checks of the sensor's response."""
        response_matrix(self.sensor, grid)
        return trains_of(self, grid.channels, grid.wavelengths)

    def capture(
        self,
        light_field: Samples,
        how: How | None = None,
        *,
        plan: Plan | BandPlans | None = None,
        executor: Any = None,
        progress: Progress | None = None,
        **options: Unpack[Options],
    ) -> Image:
        """The image that the sensor records of a light field.

        Elements that depend on the wavelength or the channel, and a sensor with a response, make an image of each
        band, by one plan for all bands that meet equal elements.

        Args:
            light_field: at the entrance plane z = 0; in memory, or on disk (`vcc.store.open_store`). A light
                field on disk is read in pieces whose images are summed.
            how: all settings in one record; None uses the defaults.
            plan: made by `compile` for this light field, or for another of the same shape and frame; None
                makes one. With a plan, options that it fixes must not be passed.
            executor: runs the blocks of a stored light field: any `concurrent.futures.Executor`, or a
                ``dask.distributed.Client``; it stays open. Each task is one block, with one thread unless
                ``threads`` is set, and with its own ``memory_limit``. The image is the same to rounding, and
                identical to the byte between runs. None runs all blocks in this process, one after the other.
            progress: called with (done, total) during the work.
            options: settings that override ``how``, by name: ``method``, ``interpolation``, ``between_views``,
                ``scene_distance``, ``refine``, ``samples``, ``tolerance``, ``seed``, ``engine``, ``threads``,
                ``memory_limit``; `vcc.How` documents each of them.

        Returns:
            Irradiance on the sensor, radiance × steradian (paper, eq. 5), inverted as on the sensor. For a sensor
            with several photodiodes in a pixel, a `vcc.image.PhotodiodeImage`: their sum, with the image of each
            in ``photodiodes[row][column]``.

        Warns:
            ResultWarning: more than 1 % of the required rays are outside the light field; the tolerance was not
                reached; the sampling error of rays exceeds 1 % of the brightest pixel (40 dB), and neither
                samples nor a tolerance were given (the warning reports how many rays suffice); the cells of
                an array are smaller than a pixel; the lenses diverge, so that no point can be sharp; masks
                are finer than parts of cells and samples resolve; images of views are separate (ghosting); or
                the image is 0 everywhere although the light field is not dark (with footprints only if no
                mask closes the camera). If the image is 0 or nearly black, or at least a quarter of the rays
                is missing, and a length is at least 1 m, a pitch 2 cm or a pixel 1 mm, the warning asks
                whether a thousandth was meant.

        Raises:
            InputError: an option that does not exist or does not fit the method; an element with an invalid
                result; missing or damaged views in a light field on disk, or a memory limit that is too
                small; a plan for another camera, or for another shape or frame of light field; an executor
                that fails, that cannot reach the store or runs another version; or a light field in memory
                that is too large to be sent to it.
        """
        check_is_light_field(light_field)
        chosen = How.of(how, options)
        if self.sensor.has_parts:
            if plan is not None:
                raise InputError(
                    "a plan is for one image, and this sensor's pixels have several photodiodes or angular "
                    "responses: leave it out, or use camera.photodiode(row, column) or camera.pixel_kind(row, "
                    "column)"
                )
            return self._of_parts(light_field, chosen, executor, progress)
        if chosen.diffraction == "depth":
            return self._by_depth(light_field, chosen, plan, executor, progress)
        if self.depends_on_bands:
            return self._captured_by_bands(light_field, chosen, plan, options, executor, progress)
        cautions = Cautions(self, light_field.grid)
        _warn_of(cautions.before())
        plan = self._planned(light_field, chosen, plan, options, progress)
        assert isinstance(plan, Plan)
        found = drive(plan, light_field, chosen, progress, executor)
        _warn_of(cautions.of(plan, light_field, found, chosen))
        return self._image(found)

    def _by_depth(
        self, light_field: Samples, how: How, plan: Any, executor: Any, progress: Progress | None
    ) -> Image:
        """The image with the diffraction of each depth."""
        if plan is not None or self.depends_on_bands:
            raise InputError(
                "diffraction='depth' makes its own plan, of a camera that all bands meet alike: leave plan out, "
                "and capture one band with camera.at_wavelength"
            )
        stop = dataclasses.replace(how, diffraction=True)
        change = DepthChange.of(self, light_field, how)
        plan = self.compile(light_field, stop)
        assert isinstance(plan, Plan)
        cautions = (each for each in plan.cautions if not each.startswith(IN_FOCUS_ONLY))
        plan = dataclasses.replace(plan, cautions=(*cautions, *change.cautions))
        image = self.capture(light_field, stop, plan=plan, executor=executor, progress=progress)
        return dataclasses.replace(image, values=image.values + change.values)

    def _of_parts(self, light_field: Samples, how: How, executor: Any, progress: Progress | None) -> Image:
        """The image of pixels that alternate, or that have several photodiodes, made of an image of each."""
        kinds = self.sensor.pixel_kinds
        alternate = len(kinds) * len(kinds[0]) > 1
        rows, columns = (len(kinds), len(kinds[0])) if alternate else self.sensor.photodiodes
        part = self.pixel_kind if alternate else self.photodiode
        cameras = [part(row, column) for row in range(rows) for column in range(columns)]
        if executor is None and progress is None and cameras[0].sensor.photodiodes == (1, 1):
            images = captured_in_batches(cameras, light_field, how)
        else:
            images = [
                camera.capture(
                    light_field, how, executor=executor, progress=part_of(progress, number, len(cameras))
                )
                for number, camera in enumerate(cameras)
            ]
        tile = [images[row * columns : (row + 1) * columns] for row in range(rows)]
        return interleaved(tile, self) if alternate else PhotodiodeImage.of(tile, self)

    def _captured_by_bands(
        self,
        light_field: Samples,
        how: How,
        plans: Plan | BandPlans | None,
        options: Options,
        executor: Any,
        progress: Progress | None,
    ) -> Image:
        """The image where bands of light meet different elements, or the sensor mixes them."""
        grid = light_field.grid
        trains = self._trains_of(grid)
        made = None if plans is None else self._fitting(plans, trains, grid, options).plans
        if executor is None and len(trains) > 1:
            light_field = read_once(light_field, how)
        parts, said = [], []
        for number, (same, share) in enumerate(zip(trains, largest_shares(trains), strict=True)):
            part = SomeChannels.of(light_field, same.channels)
            one = type(self)(same.train.elements, same.train.sensor, name=self.name)
            cautions, advance = Cautions(one, part.grid), part_of(progress, number, len(trains))
            plan = _plan_of(one, part, how, advance) if made is None else made[number]
            found = drive(plan, part, how, advance, executor)
            parts.append((same, found))
            found = as_share(found, share)
            sentences = (*cautions.before(), *plan.cautions, *cautions.of(plan, part, found, how))
            bands = bands_as_text(same.channels, grid.wavelengths)
            if share:  # faint orders give no warnings
                said.append((found.missing_rays, [(sentence, bands) for sentence in sentences]))
        worst_first = sorted(said, key=lambda each: -each[0])
        _warn_of(once_each(each for _, sentences in worst_first for each in sentences))
        return self._image(BandImages(self.sensor, grid, parts).recorded)

    def at_wavelength(self, wavelength: float) -> Self:
        """The camera as light of one wavelength meets it, with elements that depend on it no more.

        Args:
            wavelength: metres.

        Returns:
            A camera for every use: ``camera.at_wavelength(486 * nm).compile(light_field)``. Its sensor has no
            response.

        Raises:
            InputError: a wavelength outside the range of a glass; a mask of several channels, a filter or several
                orders, of which no single camera makes the image.
        """
        train = single_way(self, Band(wavelength=checked_wavelength("wavelength", wavelength)))
        return type(self)(train.elements, train.sensor, name=self.name)

    def _image(self, found: Recorded) -> Image:
        return Image(
            found.values,
            self.sensor.frame,
            missing_rays=found.missing_rays,
            sampling_error=found.sampling_error,
            camera=self,
        )

    def operator(
        self,
        light_field: Samples,
        how: How | None = None,
        *,
        plan: Plan | BandPlans | None = None,
        progress: Progress | None = None,
        **options: Unpack[Options],
    ) -> LinearMap:
        """The linear map from samples of a light field to the image, with its adjoint, for inverse problems.

        ``op(samples)`` returns the image of any samples on the light field's grid, ``op.T(picture)`` applies
        the adjoint. A camera that depends on the wavelength or the channel has one plan for each group of bands,
        and the sensor's response is part of the map.

        Args:
            light_field: defines the grid; in memory, or on disk and then read in pieces.
            how: as in `capture`.
            plan: as in `capture`.
            progress: called with (done, total) while disparities are estimated, if they are needed.
            options: as in `capture`.

        Raises:
            InputError: as for `capture`; also for a tolerance, intermediate views interpolated by depth, and
                arrays of other libraries than NumPy; the message names the alternative.

        Warns:
            ResultWarning: the cautions of the plan.
        """
        check_is_light_field(light_field)
        chosen = How.of(how, options)
        made = self._planned(light_field, chosen, plan, options, progress)
        if isinstance(made, BandPlans):
            return BandOperator.of(made, self.sensor, light_field, chosen)
        return Operator(made, light_field, chosen)

    def _planned(
        self,
        light_field: Samples,
        how: How,
        plan: Plan | BandPlans | None,
        options: Options,
        progress: Progress | None,
    ) -> Plan | BandPlans:
        """The given plan, if it fits, or a new one; warns of the plan's cautions."""
        if plan is None:
            plan = self.compile(light_field, how, progress=progress)
        elif self.depends_on_bands:
            plan = self._fitting(plan, self._trains_of(light_field.grid), light_field.grid, options)
        elif isinstance(plan, BandPlans):
            raise InputError("these plans are for another camera: make them anew with camera.compile(light_field)")
        else:
            plan.check_fits(self, light_field.grid)
            _check_of_the_run(options)
        _warn_of(plan.cautions)
        return plan

    def _fitting(
        self, plans: Plan | BandPlans, trains: Sequence[SameWay], grid: Grid, options: Options
    ) -> BandPlans:
        """Plans made before, if they fit this camera and a light field."""
        if not isinstance(plans, BandPlans):
            raise InputError(
                "plan= is one plan, and this camera depends on the wavelength or the channel, so that it has one "
                "for each group of bands: make them with camera.compile(light_field)"
            )
        plans.check_fits(trains, grid)
        _check_of_the_run(options)
        return plans

    def expose(
        self,
        light_field: Samples,
        exposure: float | Literal["auto"] = "auto",
        *,
        seed: int = 0,
        radiance: float = 1.0,
        ray_seed: int = 0,
        how: How | None = None,
        plan: Plan | BandPlans | None = None,
        executor: Any = None,
        progress: Progress | None = None,
        **options: Any,
    ) -> Recording:
        """The digital numbers that the sensor records of a light field, including noise (EMVA 1288).

        Args:
            light_field: at the entrance plane z = 0.
            exposure: exposure time, seconds, or ``"auto"``: the time after which the brightest 0.1 % of the
                pixels, each in its brightest channel, reach at least 90 % of the full well or of the largest
                number, whichever comes first.
            seed: of the sensor's noise, an integer. Recordings with different seeds are independent; the same seed
                gives the same numbers, with any number of threads.
            radiance: the radiance of a sample value of 1, W/(m²·sr), in each channel's band.
            ray_seed: of the rays, if rays are traced: the seed of `capture`.
            how: as in `capture`.
            plan: as in `capture`.
            executor: as in `capture`.
            progress: as in `capture`.
            options: as in `capture`.

        Raises:
            InputError: a sensor without electronics, channels that they cannot record, an invalid exposure,
                seed or radiance, "auto" without light, or an error of `capture`.

        Warns:
            ResultWarning: as for `capture` and `vcc.expose_image`.
        """
        check_is_light_field(light_field)
        chosen = How.of(how, {**options, "seed": ray_seed})
        asked = Exposure(self.sensor, exposure, seed, radiance, chosen.threads)
        asked.check_channels(self.sensor.channels_of(light_field.grid.channels))  # before the work begins
        captured = self.capture(light_field, chosen, plan=plan, executor=executor, progress=progress)
        return recorded(captured, asked)

    def explain(
        self,
        light_field: Samples,
        how: How | None = None,
        *,
        executor: Any = None,
        progress: Progress | None = None,
        **options: Unpack[Options],
    ) -> Explanation:
        """The plan for a light field as text: how optics are folded and moved to the sensor, all choices, and
        the cost.

        Args:
            light_field: at the entrance plane; in memory or on disk.
            how: as in `capture`.
            executor: as in `capture`; it runs some views to estimate the times with and without it.
            progress: called with (done, total) while disparities are estimated, if they are needed.
            options: as in `capture`.
        """
        check_is_light_field(light_field)
        text = self._explained(light_field, How.of(how, options), executor, progress)
        section = lens_section(self, light_field.grid.wavelengths)
        return text.with_section(section) if section else text

    def _explained(self, light_field: Samples, how: How, executor: Any, progress: Progress | None) -> Explanation:
        if self.depends_on_bands:
            return self._explained_by_bands(light_field, how, executor, progress)
        plan = _plan_of(self, light_field, how, progress)
        return explained(self, light_field, plan, how, executor)

    def _explained_by_bands(
        self, light_field: Samples, how: How, executor: Any, progress: Progress | None
    ) -> Explanation:
        """The plan of the band in the middle, and what colour adds."""
        grid = light_field.grid
        trains = trains_of(self, grid.channels, grid.wavelengths)
        if not trains:
            raise InputError("nothing passes this camera in any channel: there is no plan to explain")
        shown = middle_of(trains, grid.wavelengths)
        one = type(self)(trains[shown].train.elements, trains[shown].train.sensor, name=self.name)
        text = one._explained(SomeChannels.of(light_field, trains[shown].channels), how, executor, progress)
        return text.with_section(colour_section(self, trains, grid, shown))

    def light_field_at(
        self,
        light_field: Field,
        z: float,
        *,
        before: bool = False,
        memory_limit: int | None = None,
    ) -> Field:
        """The light field at a plane inside the camera: affine optics folded, masks and diffusers applied.

        Args:
            light_field: at the entrance plane.
            z: of the plane, metres behind the entrance plane.
            before: whether to stop before the elements that are exactly at z.
            memory_limit: bytes for new samples; None uses `vcc.base.memory.MEMORY_LIMIT`. Without a mask or a
                diffuser before the plane, nothing is allocated.

        Raises:
            InputError: a light field on disk, z outside the camera, an element before z that is not affine,
                unlike a lens or a prism, or more memory needed than allowed.
        """
        check_is_light_field(light_field)
        checks.finite("z", z, "metres")
        if light_field.whole() is None:
            raise InputError(
                "the light field inside a camera is made from samples in memory: pass stored.read(), or a part of "
                "it, stored[a:b, c:d]"
            )
        return carried_to(self, light_field, z, before, memory_limit)

    def plot(self, **options: Any) -> Any:
        """Draw the axis, the elements, the sensor and fans of rays. See `vcc.plot.plot_camera`."""
        return plot_camera(self, **options)

    def bench(self, light_field: Any) -> Any:
        """Open this camera on the optical bench, in a notebook: move its elements and see the image change.

        The widget's ``camera`` is the current camera on the bench; this camera is not changed.

        Args:
            light_field: at the entrance plane, in memory; or a `vcc.sources.splats.SplatScene`, which is rendered
                in few coarse views at first, and then in 9×9 views of 320 pixels along the longer side.

        Returns:
            A widget; show it as the last line of a cell (Jupyter, VS Code, marimo).

        Raises:
            InputError: the package anywidget is not installed (extra ``notebook``), the light field is not in
                memory, or the camera cannot be stored in a file: Python functions, user-defined elements.
        """
        return lazy_import.module("vcc.bench.widget").bench_of(self, light_field)

    def save(self, path: str | PathLike[str]) -> None:
        """Write this camera to a TOML file that `vcc.load_camera` reads. See `vcc.camera_file`."""
        write_train(self, path)


def captured_in_batches(
    cameras: Sequence[Camera], light_field: Samples, how: How, *, seeds: Sequence[int] | None = None
) -> list[Image]:
    """The results of `Camera.capture` for several cameras on one light field, in order; see `each_captured`."""
    images = dict(each_captured(cameras, light_field, how, seeds=seeds))
    return [images[number] for number in range(len(cameras))]


def each_captured(
    cameras: Sequence[Camera],
    light_field: Samples,
    how: How,
    *,
    seeds: Sequence[int] | None = None,
    output_buffers: OutputBuffers | None = None,
) -> Iterator[tuple[int, Image]]:
    """The results of `Camera.capture` for several cameras on one light field; the cameras share work if possible.

    Many cameras that differ only in the cells of one mask are computed from a few images
    (`vcc.plan.footprints.mixtures`). Other cameras have separate plans, and share work as in
    `vcc.run.batches.recorded_each`.

    Args:
        cameras: some hundred bytes of memory each; images are made on demand.
        light_field: as in `Camera.capture`.
        how: as in `Camera.capture`.
        seeds: of rays, one per camera; None uses that of ``how`` for all.
        output_buffers: where some of the images may be written.

    Returns:
        Each camera's number and image, as soon as they are made.

    Warns:
        ResultWarning: as for `Camera.capture`, for each camera.

    Raises:
        InputError: as for `Camera.capture`.
    """
    check_is_light_field(light_field)
    light_field.check_complete()
    if "depth" in (how.between_views, how.diffraction) or any(camera.depends_on_bands for camera in cameras):
        hows = [how] * len(cameras) if seeds is None else [dataclasses.replace(how, seed=seed) for seed in seeds]
        yield from enumerate(camera.capture(light_field, one) for camera, one in zip(cameras, hows, strict=True))
        return
    mixture = mixture_of(cameras, light_field.grid, how) if may_be_mixed(light_field, how) else None
    if mixture is not None:
        cautions = Cautions(cameras[0], light_field.grid)  # the same for all: they differ in cells only
        _warn_of(cautions.before())
        found = zip(mixture.members, recorded_mixed(mixture, light_field, how, output_buffers), strict=True)
        for number, one in found:
            camera = cameras[number]
            # The camera's own plan explains a dark image.
            plan = mixture.plans[0] if one.values.any() else _plan_of(camera, light_field, how)
            _warn_of(cautions.of(plan, light_field, one))
            yield number, camera._image(one)
    done = set() if mixture is None else set(mixture.members)
    left = [number for number in range(len(cameras)) if number not in done]
    plans = compiled_each(
        [cameras[number] for number in left],
        light_field.grid,
        how,
        None if seeds is None else [seeds[number] for number in left],
    )
    buffers_of = output_buffers and (lambda places: output_buffers([left[place] for place in places]))
    for number, (plan, one) in zip(left, recorded_each(plans, light_field, how, buffers_of), strict=True):
        camera = cameras[number]
        cautions = Cautions(camera, light_field.grid)
        _warn_of((*plan.cautions, *cautions.before(), *cautions.of(plan, light_field, one)))
        yield number, camera._image(one)
