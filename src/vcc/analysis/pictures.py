"""Plots of spectra: planes through a 4-D spectrum, placed by its frame, and 2-D spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.analysis.plane_spectrum import PlaneSpectrum
from vcc.analysis.spectrum import Spectrum
from vcc.base.errors import InputError
from vcc.fields.sampled import LIGHT_FIELD_AXES
from vcc.plot import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

DECADES = 5.0
"""Range of power shown, from the strongest down, in decades."""


def plot_spectrum(
    spectrum: Spectrum,
    across: tuple[str, str] = ("u", "s"),
    *,
    of: str = "power",
    decades: float = DECADES,
    axes: Axes | None = None,
) -> Axes:
    """Draw a light field's spectrum over two coordinates, each frequency's cell placed by the frame.

    Nothing is resampled: free propagation is visible as a shear along fs, a lens as a shear along fu.

    Args:
        spectrum: see `fft4`.
        across: the horizontal and the vertical coordinate, two of ``"u"``, ``"v"``, ``"s"``, ``"t"``.
        of: ``"power"`` sums |F|² over the other two axes, ``"section"`` shows the plane through their zero.
        decades: range of power shown, from the strongest down; weaker power is black.
        axes: where to draw; None makes a new figure.

    Raises:
        InputError: invalid coordinates or ``of``, or decades that are not positive.
    """
    _check_decades(decades)
    if of == "power":
        power = spectrum.power(across)
    elif of == "section":
        section = spectrum.section(across)
        power = np.abs(section).astype(np.float64) ** 2
        power = power.sum(axis=2) if power.ndim == 3 else power
    else:
        raise InputError(f'of is "power" or "section", not {of!r}')
    order = "uvst"
    first, second = (order.index(name) for name in across)
    sizes = [spectrum.shape[axis] for axis in LIGHT_FIELD_AXES]
    index = np.empty((sizes[first] + 1, sizes[second] + 1, 4))
    index[...] = np.array(sizes) // 2
    index[..., first] = np.arange(sizes[first] + 1)[:, None] - 0.5
    index[..., second] = np.arange(sizes[second] + 1)[None, :] - 0.5
    corners = spectrum.frame(index)
    axes = style.new_axes(5.2, 4.2) if axes is None else axes
    _draw(
        axes, corners[..., first] * _unit(across[0])[0], corners[..., second] * _unit(across[1])[0], power, decades
    )
    style.tidy(axes, *(f"f{name} [{_unit(name)[1]}]" for name in across))
    return axes


def plot_plane_spectrum(spectrum: PlaneSpectrum, *, decades: float = DECADES, axes: Axes | None = None) -> Axes:
    """Draw the power of a 2-D spectrum: of an image, a mask, or a transfer function.

    Args:
        spectrum: channels are summed.
        decades: range of power shown, from the strongest down; weaker power is black.
        axes: where to draw; None makes a new figure.

    Raises:
        InputError: decades that are not positive.
    """
    _check_decades(decades)
    power = np.abs(spectrum.values).astype(np.float64) ** 2
    power = power.sum(axis=2) if power.ndim == 3 else power
    rows, columns = power.shape
    corners = spectrum.frame(
        np.stack(np.meshgrid(np.arange(columns + 1) - 0.5, np.arange(rows + 1) - 0.5), axis=-1)
    )
    axes = style.new_axes(5.2, 4.2) if axes is None else axes
    _draw(axes, corners[..., 0] * 1e-3, corners[..., 1] * 1e-3, power, decades)
    axes.invert_yaxis()  # y points down, as in images
    style.tidy(axes, "fx [cycles/mm]", "fy [cycles/mm]")
    return axes


def _unit(coordinate: str) -> tuple[float, str]:
    return (1e-3, "cycles/mm") if coordinate in "uv" else (1.0, "cycles per slope")


def _check_decades(decades: float) -> None:
    if not decades > 0:
        raise InputError(f"decades of power shown are a number above 0, not {decades}")


def _draw(axes: Axes, x: Array, y: Array, power: Array, decades: float) -> Any:
    strongest = float(power.max()) or 1.0
    shown = np.log10(np.maximum(power / strongest, 10.0**-decades))
    axes.set_facecolor(style.NOTHING)
    return axes.pcolormesh(x, y, shown, cmap="gray", vmin=-decades, vmax=0, rasterized=True)
