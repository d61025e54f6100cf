"""The electronics of a sensor as a function with gradients: from an image to digital numbers.

The model is that of `vcc.run.expose` (EMVA 1288); steps without a derivative are replaced:

- The number of electrons is the mean plus √mean times a normal random number (drawn independently, so that the
  gradient includes both), instead of a Poisson number as in `vcc.Camera.expose`. Mean and variance are exact for
  any number of electrons; the distribution from about 20 electrons on (its skewness, 1/√n, is then at most 0.2).
- Rounding to integers has straight-through gradients.
- Clipping has its own derivative: 0 below black and above the full well or the largest number.
"""

from __future__ import annotations

import dataclasses
import difflib
from typing import Any

import torch

from vcc.base import checks
from vcc.base.errors import InputError, warn_of_result
from vcc.base.units import short
from vcc.optics.electronics import LIGHT_SPEED, PLANCK, Electronics
from vcc.optics.sensor import Sensor
from vcc.run.expose import AUTO_LEVEL, electronics_of, fixed_pattern

MUCH_SATURATED = 0.1
"""The share of saturated values, which have no gradients, from which on a warning is given."""
FEWEST = 1.0
"""Electrons below which √n uses the derivative at this number: at 0 it would be infinite."""
NUMBERS = tuple(field.name for field in dataclasses.fields(Electronics) if str(field.type).startswith("float"))
"""Parameters of the electronics that may be tensors."""


def expose(
    picture: torch.Tensor,
    sensor: Sensor,
    exposure: float | torch.Tensor,
    *,
    radiance: float = 1.0,
    noise: bool = True,
    generator: torch.Generator | None = None,
    **numbers: float | torch.Tensor,
) -> torch.Tensor:
    """The digital numbers that a sensor records of an image, with gradients with respect to all tensors.

    Args:
        picture: irradiance, radiance × steradian, (..., rows, columns) or (..., rows, columns, channels), as
            `CameraModule` returns it. Negative values count as 0.
        sensor: with electronics.
        exposure: seconds.
        radiance: the radiance of a light field's sample value of 1, W/(m²·sr), in each channel's band.
        noise: whether shot noise and read noise are added; PRNU and DSNU, fixed for the sensor, always are.
        generator: of the noise; None uses PyTorch's default.
        numbers: replacements for parameters of the electronics, by name, tensors or numbers: ``gain``,
            ``black_level``, ``read_noise``, ``dark_current``, ``full_well``, ``quantum_efficiency``,
            ``wavelength``, ``prnu``, ``dsnu``; in the units of `vcc.Electronics`.

    Returns:
        Digital numbers with integer values, of the image's type and shape, without channels if there is a
        colour filter.

    Raises:
        InputError: an image that does not fit the sensor or is not finite, unsupported channels, a sensor without
            electronics, an exposure that is not positive, unknown parameters.

    Warns:
        ResultWarning: gradients are wanted, and at least a tenth of the values is saturated and has none.
    """
    return exposed(picture, sensor, exposure, numbers, radiance, sensor.sensitive_area, generator, noise)


def exposed(
    picture: torch.Tensor,
    sensor: Sensor,
    exposure: float | torch.Tensor,
    numbers: dict[str, Any],
    radiance: float,
    area: float | torch.Tensor,
    generator: torch.Generator | None,
    noise: bool,
) -> torch.Tensor:
    """Like `expose`, with any sensitive area of the pixels, m², a tensor or a number."""
    electronics = electronics_of(sensor)
    if sensor.photodiodes != (1, 1):
        raise InputError(
            f"this sensor has {'×'.join(map(str, sensor.photodiodes))} photodiodes in a pixel, each with its own "
            "electronics: expose the image of each by camera.photodiode(row, column).sensor"
        )
    seconds = _above_zero("exposure", exposure)
    radiance = checks.above_zero("radiance", radiance, unit="W/(m²·sr)")
    light, channel = _filtered(picture, sensor, electronics)
    known = {name: _tensor(getattr(electronics, name), light) for name in NUMBERS}
    known |= {name: _tensor(value, light) for name, value in _checked(numbers).items()}
    per_joule = (
        _of(known["quantum_efficiency"], channel) * _of(known["wavelength"], channel) / (PLANCK * LIGHT_SPEED)
    )
    mean = torch.clamp(light, min=0.0) * per_joule * (radiance * area * seconds)
    offset: Any = 0.0
    if any(getattr(electronics, name) or name in numbers for name in ("prnu", "dsnu")):
        # Fixed for the sensor, and so the same in all images of a batch.
        shape = (*sensor.shape, *light.shape[light.ndim - channel.axes :])
        sensitivity, unlike = (_tensor(part, light) for part in fixed_pattern(shape, electronics))
        mean = mean * torch.clamp(1 + known["prnu"] * sensitivity, min=0.0)
        offset = known["dsnu"] * unlike
    charge = _charge(mean + known["dark_current"] * seconds, known, generator, noise)
    found = _numbers(charge + offset, known, electronics)
    if found.requires_grad:
        with torch.no_grad():
            _warn_of_saturation(
                mean + known["dark_current"] * seconds, known, electronics, torch.as_tensor(seconds)
            )
    return found


def _warn_of_saturation(
    mean: torch.Tensor, known: dict[str, Any], electronics: Electronics, seconds: torch.Tensor
) -> None:
    """Warn if many values are saturated and have no gradient."""
    most = (electronics.largest_number - known["black_level"]) / known["gain"]
    full = torch.minimum(most, known["full_well"])
    share = float((mean >= full).double().mean())
    if share >= MUCH_SATURATED:
        time, shorter = (
            short(float(each), "time", 3) for each in (seconds.detach(), seconds * AUTO_LEVEL * full / mean.max())
        )
        warn_of_result(
            f"{share:.1%} of the values recorded in {time} are saturated and have gradients of 0. "
            f"An exposure of {shorter} saturates no pixel"
        )


def _charge(mean: Any, known: dict[str, Any], generator: torch.Generator | None, noise: bool) -> Any:
    """Electrons for a mean, at most the full well, plus read noise."""
    if not noise:
        return torch.minimum(mean, known["full_well"])
    shot, read = (torch.randn(mean.shape, generator=generator, dtype=mean.dtype) for _ in range(2))
    # Its value is √mean; its derivative below FEWEST is that at FEWEST.
    root = torch.sqrt(torch.clamp(mean, min=FEWEST)) + torch.clamp(mean - FEWEST, max=0.0) / (2 * FEWEST**0.5)
    root = root + (torch.sqrt(mean) - root).detach()
    return torch.minimum(mean + root * shot, known["full_well"]) + known["read_noise"] * read


def _numbers(charge: Any, known: dict[str, Any], electronics: Electronics) -> Any:
    """Digital numbers of electrons: rounded with straight-through gradients, and clipped."""
    numbers = known["black_level"] + known["gain"] * charge
    rounded = numbers + (torch.round(numbers) - numbers).detach()
    return torch.clamp(rounded, 0.0, float(electronics.largest_number))


@dataclasses.dataclass(frozen=True)
class _Channel:
    """The channel of each pixel's light.

    Args:
        index: of the channel, a tensor that broadcasts against an image's last axes; None for grey.
        axes: number of channel axes behind the filters, 0 or 1.
    """

    index: torch.Tensor | None
    axes: int


def _filtered(picture: torch.Tensor, sensor: Sensor, electronics: Electronics) -> tuple[torch.Tensor, _Channel]:
    """The light of each pixel behind its colour filter, (..., rows, columns[, channels])."""
    _check_picture(picture, sensor)
    channels = picture.shape[-1] if picture.shape[-3:-1] == sensor.shape else None
    electronics.check_channels(channels)
    if channels is None:
        return picture, _Channel(None, 0)
    if electronics.color_filter is None:
        return picture, _Channel(torch.arange(channels), 1)
    tile = torch.tensor(electronics.tile)
    (rows, columns), (high, wide) = sensor.shape, tile.shape
    index = tile.repeat(-(-rows // high), -(-columns // wide))[:rows, :columns]
    chosen = index.expand(picture.shape[:-1])[..., None]
    return torch.gather(picture, -1, chosen)[..., 0], _Channel(index, 0)


def _check_picture(picture: Any, sensor: Sensor) -> None:
    if not isinstance(picture, torch.Tensor) or not picture.is_floating_point():
        kind = picture.dtype if isinstance(picture, torch.Tensor) else type(picture).__name__
        raise InputError(f"picture must be a floating-point tensor, as CameraModule returns it, not {kind}")
    if sensor.shape not in (tuple(picture.shape[-2:]), tuple(picture.shape[-3:-1])):
        raise InputError(
            f"the sensor has {sensor.shape} pixels (rows, columns), and the picture the shape "
            f"{tuple(picture.shape)}: it is (..., rows, columns) or (..., rows, columns, channels)"
        )
    if not torch.isfinite(picture).all():
        raise InputError("the picture on the sensor has values that are not finite: no exposure can record them")


def _checked(numbers: dict[str, Any]) -> dict[str, Any]:
    """Check the names of parameters of the electronics."""
    for name in numbers:
        if name not in NUMBERS:
            near = difflib.get_close_matches(name, NUMBERS, 1)
            hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(NUMBERS)}"
            raise InputError(f"electronics have no number {name}: {hint}")
    return numbers


def _above_zero(name: str, value: float | torch.Tensor) -> float | torch.Tensor:
    """Check that a number is positive; a tensor stays a tensor."""
    plain = value.detach().item() if isinstance(value, torch.Tensor) and value.ndim == 0 else value
    checks.above_zero(name, plain, unit="s", way_out="give a time such as 10 * vcc.units.ms, or a tensor of one")
    return value


def _tensor(value: Any, like: torch.Tensor) -> torch.Tensor:
    return torch.as_tensor(value, dtype=like.dtype)


def _of(number: torch.Tensor, channel: _Channel) -> torch.Tensor:
    """A parameter of the electronics for each pixel's channel."""
    return number[channel.index] if number.ndim and channel.index is not None else number
