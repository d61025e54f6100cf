"""A camera: an optical train, and the verbs that users call."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

from vcc.base.errors import InputError
from vcc.light_field import LightField
from vcc.optics.train import Train

if TYPE_CHECKING:
    from os import PathLike

    from vcc.advice.explain import Explanation
    from vcc.engines import EngineName
    from vcc.image import Image
    from vcc.plan.footprints.model import Plan
    from vcc.plan.rays.model import RayPlan
    from vcc.recording import Recording
    from vcc.store import StoredLightField


def _outline(light_field: LightField | StoredLightField) -> LightField:
    """What a plan is made from: of a light field on disk nothing is read, and nothing may be missing."""
    if isinstance(light_field, LightField):
        return light_field
    light_field.check_complete()
    return light_field.outline


class Camera(Train):
    """Elements along an axis and a sensor behind them.

    A light field given to the camera is taken to lie at the entrance plane, z = 0. Cameras of equal elements and
    sensors are equal.

    Args:
        elements: in any order; kept sorted by z. Elements at the same z commute.
        sensor: where the picture is recorded.

    Raises:
        InputError: an element before the entrance plane or behind the sensor, two elements of one name.
    """

    def compile(
        self,
        light_field: LightField | StoredLightField,
        *,
        method: str = "auto",
        interpolation: str = "sharp",
        between_views: str = "auto",
        scene_distance: float | None = None,
        refine: int | str = "auto",
        samples: int | None = None,
        seed: int = 0,
    ) -> Plan | RayPlan:
        """The plan by which an engine makes the picture; `capture` does this for you.

        Args: see `capture`.
        """
        from vcc.plan.choice import compile_best

        return compile_best(
            self,
            _outline(light_field),
            method=method,
            interpolation=interpolation,
            between_views=between_views,
            scene_distance=scene_distance,
            refine=refine,
            samples=samples,
            seed=seed,
        )

    def capture(
        self,
        light_field: LightField | StoredLightField,
        *,
        method: str = "auto",
        interpolation: str = "sharp",
        between_views: str = "auto",
        scene_distance: float | None = None,
        refine: int | str = "auto",
        samples: int | None = None,
        tolerance: float | None = None,
        seed: int = 0,
        engine: EngineName | None = None,
        memory_limit: int | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> Image:
        """The picture that the sensor records of a light field.

        Args:
            light_field: given at the entrance plane z = 0; in memory, or on disk (`vcc.store.open_store`) and then
                read in pieces whose pictures are summed.
            method: ``"footprints"`` spreads each sample of the light field over the sensor, exactly, where the
                optics fold into one matrix; ``"rays"`` traces rays back from the sensor through anything;
                ``"auto"`` takes footprints where they can be had.
            interpolation: within a view: ``"sharp"``, linear with what that takes from sharpness given back (rings
                by some per cent beside hard edges, and may go below 0 there), or ``"linear"``; by footprints also
                ``"nearest"`` (the paper's, for comparison) or ``"cubic"`` (Catmull-Rom).
            between_views: ``"auto"`` interpolates between views along the scene's parallax (footprints: only
                where neighbouring views differ by more than about a pixel on the sensor); ``"depth"`` (footprints)
                makes as many views in between as the sensor can tell apart, up to 16×16 for each one, from the
                light field's ``disparity``, which is found first where it is not given: no ghosts at any depth, at
                the cost that `explain` states, for NumPy arrays; ``"none"`` never does.
            scene_distance: the distance in metres of the scene before the entrance plane, by which that
                interpolation goes; None takes the range of distances that the light field states or shows.
            refine: footprints: ``"auto"`` divides cells and samples where a mask is finer than they are, at a
                cost that `explain` states; a number divides samples by it each way, and 1 divides nothing.
            samples: rays a pixel, rounded up to a power of two (behind a main lens and lenslets: for each lenslet
                that the pixel sees); None takes 64.
            tolerance: double the samples until the estimated sampling error of the picture, root mean square, is
                at most this share of its mean; None does not.
            seed: of the rays' choice of points. The same seed gives the same picture, on any number of threads.
            engine: ``"numba"`` (default for NumPy arrays), ``"array_api"`` (default for PyTorch, JAX and
                other arrays: carries gradients) or ``"reference"`` (slow; defines what is correct).
            memory_limit: for a light field on disk, bytes that its pieces, the picture and the engine may take
                together; None takes `vcc.run.pieces.MEMORY_LIMIT`, 1 GiB. Smaller pieces take more time by
                rays, all of which are traced for each piece.
            progress: called with (done, total) as the work advances.

        Returns:
            Irradiance on the sensor, radiance × steradian (paper, eq. 5), as light lands on it (inverted).

        Warns:
            ResultWarning: more than 1 % of the rays that the camera asks for are not in the light field, the
                tolerance was not reached, the cells of an array are smaller than a pixel, or the picture is 0
                everywhere although the light field is not dark (by footprints, and no mask closes the camera).

        Raises:
            InputError: an option that does not exist or does not go with the method, an element that returns
                what it must not; of a light field on disk, views that are missing or damaged, or a memory limit
                that is too small.
        """
        import warnings

        from vcc.advice.darkness import why_dark
        from vcc.base.errors import ResultWarning
        from vcc.engines import record
        from vcc.image import Image

        if between_views == "depth" and max(light_field.shape[:2]) > 1:
            light_field.disparity.maps(progress)  # found now, so that progress is seen
        plan = self.compile(
            light_field,
            method=method,
            interpolation=interpolation,
            between_views=between_views,
            scene_distance=scene_distance,
            refine=refine,
            samples=samples,
            seed=seed,
        )
        for caution in plan.cautions:
            warnings.warn(caution, ResultWarning, stacklevel=2)
        if isinstance(light_field, LightField):
            recorded = record(plan, light_field.values, engine=engine, tolerance=tolerance, progress=progress)
        else:
            from vcc.run.pieces import record_pieces

            recorded = record_pieces(
                plan, light_field, engine=engine, tolerance=tolerance, memory_limit=memory_limit, progress=progress
            )
        dark = why_dark(
            plan,
            light_field,
            recorded.values,
            recorded.rays,
            recorded.missing_rays,
            recorded.missing_reason,
        )
        if dark is not None:
            warnings.warn(dark, ResultWarning, stacklevel=2)
        elif recorded.missing_rays > 0.01:
            warnings.warn(
                f"{recorded.missing_rays:.1%} of the rays that this camera asks for are not in the light field "
                f"({recorded.missing_reason}); the picture is darker there",
                ResultWarning,
                stacklevel=2,
            )
        return Image(
            recorded.values,
            self.sensor.frame,
            missing_rays=recorded.missing_rays,
            sampling_error=recorded.sampling_error,
        )

    def expose(
        self,
        light_field: LightField | StoredLightField,
        exposure: float | Literal["auto"],
        *,
        seed: int = 0,
        radiance: float = 1.0,
        ray_seed: int = 0,
        **options: Any,
    ) -> Recording:
        """What the sensor records of a light field, as its electronics number it, noise included (EMVA 1288).

        Args:
            light_field: given at the entrance plane z = 0.
            exposure: exposure time, seconds, or ``"auto"``: the time after which the brightest 0.1 % of the
                pixels are at 90 % or more of their full well or of the largest number, whichever comes first.
            seed: of the sensor's noise, a whole number. Recordings with different seeds are independent; the
                same seed gives the same numbers, on any number of threads.
            radiance: what a sample value of 1 stands for, W/(m²·sr), in each channel's band.
            ray_seed: of the choice of rays, where rays are traced: the seed of `capture`.
            options: as in `capture`.

        Raises:
            InputError: a sensor without electronics, channels that they cannot record, an unusable exposure,
                seed or radiance, "auto" without light, or what `capture` refuses.

        Warns:
            ResultWarning: as `capture` and `vcc.expose_image`.
        """
        from vcc.recording import recorded
        from vcc.run.expose import Exposure

        asked = Exposure(self.sensor, exposure, seed, radiance, options.get("threads"))
        asked.check_channels(light_field.channels)  # before the work begins
        return recorded(self.capture(light_field, seed=ray_seed, **options), asked)

    def explain(self, light_field: LightField | StoredLightField, **options: Any) -> Explanation:
        """The plan for a light field in words: what was folded, pulled to the sensor, chosen, and its cost.

        Args:
            light_field: given at the entrance plane; in memory or on disk.
            options: as in `capture`.
        """
        if not isinstance(light_field, LightField):
            from vcc.run.pieces import explain_pieces

            return explain_pieces(self, light_field, **options)
        options.pop("memory_limit", None)
        from vcc.advice.explain import explain

        return explain(self, light_field, **options)

    def light_field_at(
        self,
        light_field: LightField,
        z: float,
        *,
        before: bool = False,
        memory_limit: int | None = None,
    ) -> LightField:
        """The light field at a plane inside the camera: affine optics folded, masks and diffusers applied.

        Args:
            light_field: given at the entrance plane.
            z: the plane, metres behind the entrance plane.
            before: whether to stop before the elements that stand exactly at z.
            memory_limit: bytes that new samples may take; None takes `vcc.base.memory.MEMORY_LIMIT`.
                Without a mask or a diffuser on the way nothing is allocated.

        Raises:
            InputError: a light field on disk, z outside the camera, an element on the way that bends rays not as a
                lens or a prism does, or more memory needed than allowed.
        """
        if not isinstance(light_field, LightField):
            raise InputError(
                "the light field inside a camera is made from samples in memory: pass stored.read(), or a part of "
                "it, stored[a:b, c:d]"
            )
        if z > self.sensor.z:
            raise InputError(f"z = {z * 1e3:g} mm lies behind the sensor at {self.sensor.z * 1e3:g} mm")
        for stage in self.stages:
            if stage.element.z > z or (before and stage.element.z == z):
                break
            if stage.faces.bending is not None:
                raise InputError(
                    f"{stage.element.label} is not affine: behind it the light field has no frame. Choose a z "
                    "before it, or look at the picture (camera.capture)"
                )
        from vcc.run.operators import carried_to

        return carried_to(self, light_field, z, before, memory_limit)

    def plot(self, **options: Any) -> Any:
        """Draw the axis, the elements, the sensor and fans of rays. See `vcc.plot.plot_camera`."""
        from vcc.plot import plot_camera

        return plot_camera(self, **options)

    def save(self, path: str | PathLike[str]) -> None:
        """Write this camera as a TOML file that `vcc.load_camera` reads back. See `vcc.camera_file`."""
        from vcc.files.camera_file import save_camera

        save_camera(self, path)
