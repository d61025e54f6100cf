"""A camera as a function that JAX takes derivatives of: pictures of samples and of the camera's parameters."""

from __future__ import annotations

import threading
from collections.abc import Iterable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.custom_derivatives import SymbolicZero
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.fields.samples import Samples, check_is_light_field
from vcc.learn.parameters import put, read
from vcc.learn.pictures import (
    Call,
    Work,
    by_an_engine,
    check_samples,
    explained_while_learning,
    kept_in,
    listed,
    several_of,
)
from vcc.learn.verdicts import ELECTRONICS
from vcc.optics.train import Train
from vcc.plan.how import How

SAMPLES = "samples"
"""Under which samples stand among the parameters; names of these have a dot."""
KINDS = ("float32", "float64", "float16", "uint8", "uint16")
"""Types that samples may have."""

Given = dict[str, Any]


class CameraFunction:
    """A camera that learns, on a light field or on others of the same grid: a function for JAX.

    ``function(function.values)`` is the picture that the camera makes of the light field. It works under
    ``jax.jit``, ``jax.grad`` and ``jax.vmap`` (one picture after the other), by callbacks on the CPU. It has first
    derivatives only, and those backwards: forward mode (``jax.jvp``, ``jax.jacfwd``, ``jax.hessian``) and
    derivatives of a gradient are refused.

    Each parameter is in multiples of a scale of its own (`vcc.learn.scales`, to the nearest power of two, so that
    nothing is rounded by it): one learning rate then serves all. In single precision, as JAX has them unless
    ``jax_enable_x64`` is set, what is learned is rounded to 6e-8 of itself: a focal length or a place along the
    axis to less than what moves light by a ten-thousandth of a pixel.

    What is decided by the camera with which learning begins (footprints or rays, how finely masks are sampled,
    what fills gaps between views) stays so while it learns; `explain` says when planning again would decide
    otherwise.

    Args:
        camera: as it is when learning begins.
        light_field: at its entrance plane, in memory or on disk.
        learn: names of parameters (`vcc.learn.parameters`), such as ``["code.pattern", "main.focal_length",
            "sensor.z"]``; none where gradients to samples are all that is wanted. Electronics, which pictures do
            not depend on, are learned with PyTorch.
        how: as in `vcc.Camera.capture`. The engine is ``"numba"``, or ``"reference"``, whose pictures are float64
            where JAX has it.
        options: as in `vcc.Camera.capture`.

    Raises:
        InputError: a parameter that does not exist or cannot be learned here (named, with the reason), an engine
            or a tolerance that cannot be gone through backwards.
    """

    def __init__(
        self,
        camera: Train,
        light_field: Samples,
        learn: Iterable[str] = (),
        how: How | None = None,
        **options: Any,
    ) -> None:
        check_is_light_field(light_field)
        names = listed(learn)
        for name in names:
            if name.startswith(ELECTRONICS):
                raise InputError(
                    f"{name} is learned of what is recorded, and this makes pictures on the sensor: learn it with "
                    "PyTorch, vcc.torch.CameraModule(…).expose"
                )
        self._work = Work.of(camera, light_field, by_an_engine(How.of(how, options)), names)
        self._scales = {name: kept_in(camera, name) for name in names}
        self._shapes = {name: read(camera, name).shape for name in names}
        # Callbacks come from several threads, and plans share what they are made of.
        self._alone = threading.Lock()
        self._pictures = jax.custom_vjp(self._ahead)
        self._pictures.defvjp(self._kept, self._back, symbolic_zeros=True)
        self._gradient = jax.custom_vjp(self._weighed)
        self._gradient.defvjp(lambda *given: (self._gradient(*given), None), _refuse_second)

    @property
    def values(self) -> dict[str, jax.Array]:
        """The camera's own parameters as learning begins, in multiples of `scales`, by name: what is optimised."""
        return {name: jnp.asarray(read(self._work.camera, name) / scale) for name, scale in self._scales.items()}

    @property
    def scales(self) -> dict[str, float]:
        """What each parameter is in multiples of, SI units: ``values[name] * scales[name]`` is in metres."""
        return dict(self._scales)

    def __call__(self, values: Mapping[str, Any], samples: Any = None) -> jax.Array:
        """The picture of the light field, or of others on its grid.

        Args:
            values: of all parameters that are learned, in multiples of `scales`, floating point: each of its
                parameter's shape, or with one axis in front for as many pictures, such as (n, rows, columns) for n
                masks on one light field.
            samples: of other light fields of the same shape and geometry: (…, v, u, t, s[, channels]), floating
                point (radiance) or unsigned integers (shares of their largest value); None takes the light field's
                own.

        Returns:
            Irradiance as light lands on the sensor, (…, rows, columns[, channels]), float32 (float64 by
            ``"reference"`` where JAX has it), as `vcc.Camera.capture` gives it. The axes of ``values`` stand
            before those of ``samples``.

        Raises:
            InputError: names, shapes or types of values or samples. What is found when the picture is made (a
                parameter that is not finite or that its element does not take, named; samples that are not
                finite) is within an error of JAX's, its last line.
        """
        given = _as_values(values, self._shapes)
        if samples is not None:
            given[SAMPLES] = _as_samples(samples)
            check_samples(given[SAMPLES].shape, self._work.light_field.grid)
        return self._pictures(given)

    def camera(self, values: Mapping[str, Any]) -> Train:
        """The camera with what was learned, which saves to TOML: ``function.camera(values).save("learned.toml")``.

        Args:
            values: as for a picture, one of each.

        Raises:
            InputError: names or shapes of values; a parameter that is not finite or that its element does not
                take, named; values that JAX traces.
        """
        return put(self._work.camera, self._known(values))

    def explain(self, values: Mapping[str, Any]) -> str:
        """The plan in words, and what planning again with what was learned would decide otherwise.

        Args:
            values: as for a picture, one of each.

        Raises:
            InputError: as `camera`.
        """
        again = "CameraFunction(function.camera(values), …)"
        return explained_while_learning(self._work, self._known(values), self._scales, again)

    def __repr__(self) -> str:
        rows, columns = self._work.camera.sensor.shape
        return f"CameraFunction(learns {', '.join(self._scales) or 'nothing'}; pictures of {rows}×{columns})"

    def __reduce__(self) -> tuple[Any, ...]:
        work = self._work
        return CameraFunction, (work.camera, work.light_field, work.chain.names, work.how)  # decided alike there

    # --- what JAX traces ---

    def _ahead(self, given: Given) -> Any:
        several = self._several(given)
        cameras = given[min(several)].shape[:1] if several else ()
        grid = self._work.light_field.grid
        lead = given[SAMPLES].shape[: -len(grid.shape)] if SAMPLES in given else ()
        kind = np.float64 if self._work.how.engine == "reference" else np.float32
        picture = jax.ShapeDtypeStruct(
            (*cameras, *lead, *self._work.picture_shape), jax.dtypes.canonicalize_dtype(kind)
        )
        return jax.pure_callback(self._made, picture, given, vmap_method="sequential")

    def _kept(self, perturbed: Given) -> tuple[Any, Any]:
        """A picture, and what the way back needs: all that is given, and the names of that with derivatives."""
        given = {name: each.value for name, each in perturbed.items()}
        wanted = [name for name, each in perturbed.items() if each.perturbed]
        return self._pictures(given), (given, dict.fromkeys(wanted))

    def _back(self, kept: Any, weights: Any) -> tuple[Given]:
        given, wanted = kept
        found = {} if isinstance(weights, SymbolicZero) else self._gradient(given, wanted, weights)
        return ({name: found.get(name) for name in given},)

    def _weighed(self, given: Given, wanted: Given, weights: Any) -> Given:
        like = {name: jax.ShapeDtypeStruct(given[name].shape, given[name].dtype) for name in wanted}
        return jax.pure_callback(self._pulled, like, given, wanted, weights, vmap_method="sequential")  # type: ignore[no-any-return]

    def _several(self, given: Given) -> set[str]:
        return several_of({name: given[name].shape for name in self._shapes}, self._shapes)

    # --- what is called back ---

    def _made(self, given: Given) -> NDArray[np.floating]:
        samples, numbers = self._parted(given)
        with self._alone:
            return Call(self._work, tuple(numbers), self._several(given)).made(samples, numbers)

    def _pulled(self, given: Given, wanted: Given, weights: Any) -> Given:
        samples, numbers = self._parted(given)
        weights, parameters = np.asarray(weights), [name for name in wanted if name != SAMPLES]
        with self._alone:
            call = Call(self._work, tuple(numbers), self._several(given))
            call.begin(samples, numbers)
            of_samples, pulled = call.back(weights, SAMPLES in wanted, parameters, numbers)
            if not all(np.isfinite(each).all() for each in pulled.values()):
                call.refuse()  # no picture was made that would have told, where a loss is linear in it
        found = {name: pulled[name] * self._scales[name] for name in parameters}
        if SAMPLES in wanted:
            found[SAMPLES] = of_samples
        return {
            name: np.asarray(each).reshape(given[name].shape).astype(given[name].dtype, copy=False)
            for name, each in found.items()
        }

    def _parted(self, given: Given) -> tuple[NDArray[Any] | None, dict[str, NDArray[np.float64]]]:
        """Samples, and numbers of parameters in SI units."""
        samples = np.asarray(given[SAMPLES]) if SAMPLES in given else None
        return samples, {
            name: np.asarray(given[name], dtype=np.float64) * scale for name, scale in self._scales.items()
        }

    def _known(self, values: Mapping[str, Any]) -> dict[str, NDArray[np.float64]]:
        """Numbers in SI units of values that are not traced."""
        given = _as_values(values, self._shapes)
        for name, value in given.items():
            if isinstance(value, jax.core.Tracer):
                raise InputError(
                    f"values for {name} are traced by JAX, and a camera is made of known numbers: ask for "
                    "it outside jax.jit, jax.grad and jax.vmap"
                )
        return self._parted(given)[1]


def _refuse_second(kept: Any, weights: Any) -> Any:
    raise InputError(
        "pictures have first derivatives only: a derivative of their gradient (jax.grad of jax.grad, a penalty on "
        "a gradient) is not to be had"
    )


# --- what is given ---


def _as_values(values: Any, shapes: Mapping[str, tuple[int, ...]]) -> Given:
    """Values of all parameters by name, as arrays of JAX."""
    if not isinstance(values, Mapping):
        raise InputError(
            f"values are a dict of arrays by the names of parameters, function.values, not {type(values).__name__}"
        )
    for name in values:
        if name not in shapes:
            raise InputError(
                f"values have {name}, which is not learned here: there are {', '.join(shapes) or 'none'}"
            )
    for name in shapes:
        if name not in values:
            raise InputError(f"values have no {name}: give all that is learned, {{**function.values, …}}")
    return {name: _as_array(f"values for {name}", values[name]) for name in shapes}


def _as_array(what: str, value: Any) -> Any:
    """Floating point as an array of JAX."""
    try:
        array = jnp.asarray(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} are an array of floating point, not {type(value).__name__}") from error
    if not jnp.issubdtype(array.dtype, jnp.floating):
        raise InputError(f"{what} are floating point, not {array.dtype}")
    return array


def _as_samples(samples: Any) -> Any:
    """Samples of a type that light fields have, as an array of JAX."""
    try:
        array = jnp.asarray(samples)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"samples are an array, not {type(samples).__name__}: jax.numpy.asarray(light_field.values) makes one"
        ) from error
    if str(array.dtype) not in KINDS:
        raise InputError(
            f"samples are {', '.join(KINDS)}, not {array.dtype}: convert them, samples.astype(jax.numpy.float32)"
        )
    return array
