"""A camera as a JAX function: images with gradients to samples and to the camera's parameters."""

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
"""Key of the samples among the parameters; parameter names have a dot."""
KINDS = ("float32", "float64", "float16", "uint8", "uint16")
"""Supported types of samples."""

Given = dict[str, Any]


class CameraFunction:
    """A camera with learned parameters as a JAX function, for a light field or others on the same grid.

    ``function(function.values)`` returns the camera's image of the light field. It works under ``jax.jit``,
    ``jax.grad`` and ``jax.vmap`` (one image after another), with callbacks on the CPU. Only first derivatives in
    reverse mode are supported: forward mode (``jax.jvp``, ``jax.jacfwd``, ``jax.hessian``) and derivatives of a
    gradient raise an error.

    Each parameter is a multiple of its own scale (`vcc.learn.scales`, rounded to a power of two, so that
    scaling is exact): one learning rate then suits all. In single precision, JAX's default without
    ``jax_enable_x64``, parameters are rounded to a relative 6e-8: for a focal length or a position along the
    axis, this moves light by less than 1e-4 pixels.

    Choices that depend on the initial camera (footprints or rays, mask sampling, interpolation between views) stay
    fixed during learning; `explain` reports whether planning again would change them.

    Args:
        camera: the initial camera.
        light_field: at the camera's entrance plane, in memory or on disk.
        learn: names of parameters (`vcc.learn.parameters`), such as ``["code.pattern", "main.focal_length",
            "sensor.z"]``; empty if only gradients to samples are wanted. Parameters of the electronics, which do
            not affect images, are learned with PyTorch.
        how: as in `vcc.Camera.capture`. The engine is ``"numba"``, or ``"reference"``, whose images are float64
            if JAX supports it.
        options: as in `vcc.Camera.capture`.

    Raises:
        InputError: a parameter that does not exist or cannot be learned here (the message gives the reason), an
            engine or a tolerance without derivatives.
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
                    f"{name} affects recordings, but not the images of this function: learn it with "
                    "PyTorch, vcc.torch.CameraModule(…).expose"
                )
        self._work = Work.of(camera, light_field, by_an_engine(How.of(how, options)), names)
        self._scales = {name: kept_in(camera, name) for name in names}
        self._shapes = {name: read(camera, name).shape for name in names}
        # Callbacks come from several threads, and plans share their parts.
        self._alone = threading.Lock()
        self._pictures = jax.custom_vjp(self._ahead)
        self._pictures.defvjp(self._kept, self._back, symbolic_zeros=True)
        self._gradient = jax.custom_vjp(self._weighed)
        self._gradient.defvjp(lambda *given: (self._gradient(*given), None), _refuse_second)

    @property
    def values(self) -> dict[str, jax.Array]:
        """The initial values of the parameters, in multiples of `scales`, by name: start the optimisation here."""
        return {name: jnp.asarray(read(self._work.camera, name) / scale) for name, scale in self._scales.items()}

    @property
    def scales(self) -> dict[str, float]:
        """The scale of each parameter, SI units: ``values[name] * scales[name]`` is in metres, for example."""
        return dict(self._scales)

    def __call__(self, values: Mapping[str, Any], samples: Any = None) -> jax.Array:
        """The image of the light field, or of others on its grid.

        Args:
            values: all learned parameters, in multiples of `scales`, floating point: each in the parameter's
                shape, or with one leading axis for several images, such as (n, rows, columns) for n masks on
                one light field.
            samples: of other light fields of the same shape and geometry: (…, v, u, t, s[, channels]), floating
                point (radiance) or unsigned integers (shares of their largest value); None uses the samples of the
                light field.

        Returns:
            Irradiance on the sensor, inverted as it lands, (…, rows, columns[, channels]), float32 (float64 with
            ``"reference"`` if JAX supports it), as `vcc.Camera.capture` returns it. The axes of ``values`` precede
            those of ``samples``.

        Raises:
            InputError: wrong names, shapes or types of values or samples. Errors found only when the image is
                computed (a parameter that is not finite or invalid for its element; samples that are not
                finite) are in the last line of an error of JAX.
        """
        given = _as_values(values, self._shapes)
        if samples is not None:
            given[SAMPLES] = _as_samples(samples)
            check_samples(given[SAMPLES].shape, self._work.light_field.grid)
        return self._pictures(given)

    def camera(self, values: Mapping[str, Any]) -> Train:
        """The camera with learned values; it saves to TOML: ``function.camera(values).save("learned.toml")``.

        Args:
            values: as for an image, one of each.

        Raises:
            InputError: wrong names or shapes of values; a parameter that is not finite or invalid for its element;
                values traced by JAX.
        """
        return put(self._work.camera, self._known(values))

    def explain(self, values: Mapping[str, Any]) -> str:
        """The plan as text, and the choices that planning again with the learned values would change.

        Args:
            values: as for an image, one of each.

        Raises:
            InputError: as for `camera`.
        """
        again = "CameraFunction(function.camera(values), …)"
        return explained_while_learning(self._work, self._known(values), self._scales, again)

    def __repr__(self) -> str:
        rows, columns = self._work.camera.sensor.shape
        return f"CameraFunction(learns {', '.join(self._scales) or 'nothing'}; pictures of {rows}×{columns})"

    def __reduce__(self) -> tuple[Any, ...]:
        work = self._work
        return CameraFunction, (work.camera, work.light_field, work.names, work.how)  # same choices

    # --- traced by JAX ---

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
        """An image, and the data for the reverse pass: all inputs, and the names of those with derivatives."""
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

    # --- callbacks ---

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
                call.refuse()  # for a loss linear in it no image was made
        found = {name: pulled[name] * self._scales[name] for name in parameters}
        if SAMPLES in wanted:
            found[SAMPLES] = of_samples
        return {
            name: np.asarray(each).reshape(given[name].shape).astype(given[name].dtype, copy=False)
            for name, each in found.items()
        }

    def _parted(self, given: Given) -> tuple[NDArray[Any] | None, dict[str, NDArray[np.float64]]]:
        """Samples, and parameters in SI units."""
        samples = np.asarray(given[SAMPLES]) if SAMPLES in given else None
        return samples, {
            name: np.asarray(given[name], dtype=np.float64) * scale for name, scale in self._scales.items()
        }

    def _known(self, values: Mapping[str, Any]) -> dict[str, NDArray[np.float64]]:
        """Parameters in SI units, from values that are not traced."""
        given = _as_values(values, self._shapes)
        for name, value in given.items():
            if isinstance(value, jax.core.Tracer):
                raise InputError(
                    f"values for {name} are traced by JAX, but a camera needs concrete numbers: call this "
                    "outside jax.jit, jax.grad and jax.vmap"
                )
        return self._parted(given)[1]


def _refuse_second(kept: Any, weights: Any) -> Any:
    raise InputError(
        "images have first derivatives only: derivatives of their gradient (jax.grad of jax.grad, a penalty on "
        "a gradient) are not supported"
    )


# --- inputs ---


def _as_values(values: Any, shapes: Mapping[str, tuple[int, ...]]) -> Given:
    """Values of all parameters by name, as JAX arrays."""
    if not isinstance(values, Mapping):
        raise InputError(
            f"values must be a dict of arrays by parameter name (function.values), not {type(values).__name__}"
        )
    for name in values:
        if name not in shapes:
            raise InputError(
                f"values have {name}, which is not learned; learned are {', '.join(shapes) or 'none'}"
            )
    for name in shapes:
        if name not in values:
            raise InputError(f"values have no {name}: pass all learned parameters, {{**function.values, …}}")
    return {name: _as_array(f"values for {name}", values[name]) for name in shapes}


def _as_array(what: str, value: Any) -> Any:
    """A floating-point value as a JAX array."""
    try:
        array = jnp.asarray(value)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what} must be a floating-point array, not {type(value).__name__}") from error
    if not jnp.issubdtype(array.dtype, jnp.floating):
        raise InputError(f"{what} must be floating point, not {array.dtype}")
    return array


def _as_samples(samples: Any) -> Any:
    """Samples of a supported type, as a JAX array."""
    try:
        array = jnp.asarray(samples)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"samples must be an array, not {type(samples).__name__}: pass jax.numpy.asarray(light_field.values)"
        ) from error
    if str(array.dtype) not in KINDS:
        raise InputError(
            f"samples must be {', '.join(KINDS)}, not {array.dtype}: pass samples.astype(jax.numpy.float32)"
        )
    return array
