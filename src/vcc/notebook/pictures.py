"""Pictures for notebooks, limited to what a screen shows and a notebook file should contain."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vcc.files.pictures import auto_exposure, averaged
from vcc.files.transfer import encode
from vcc.notebook.html import Panel
from vcc.plot import style

LARGEST_SIDE = 720
"""Largest side of a picture, pixels; a larger one is averaged down by an integer factor."""
MOST_BYTES = 520_000
"""Bytes of all PNG files of one display."""
MAGNIFIED_TO = 320
"""Pictures smaller than half of this, pixels, are magnified by an integer factor, up to this."""
GAP = 4
"""Pixels between the pictures of a sheet."""
COLOURS = 192
"""Colours of a drawing."""
DOTS = 160
"""Dots per inch of drawings, which are displayed at `SHOWN_DOTS`: sharp on high-density screens, too."""
SHOWN_DOTS = 80

Array = NDArray[Any]


def in_colour(values: Array) -> tuple[NDArray[np.float32], str]:
    """Finite values in 1 or 3 channels, and a description of the conversion."""
    words = []
    values = np.asarray(values, dtype=np.float32)
    if values.ndim == 3 and values.shape[2] == 1:
        values = values[..., 0]
    if values.ndim == 3 and values.shape[2] != 3:
        words.append(f"the mean of {values.shape[2]} channels")
        values = values.mean(axis=2)
    wrong = ~np.isfinite(values)
    if wrong.any():
        words.append(f"{wrong.mean():.2%} of the values are not finite, and shown black")
        values = np.where(wrong, np.float32(0), values)
    return values, ", ".join(words)


def light_panel(values: Array, words: str = "", share: int = 1) -> Panel:
    """A panel of linear light, with the exposure that `vcc.Image.save` uses.

    Args:
        values: linear and upright, shape (rows, columns[, channels]).
        words: start of the caption.
        share: number of pictures in the display.
    """
    shown, remark = in_colour(values)
    exposure = auto_exposure(shown)
    said = ", ".join(each for each in (words, remark, f"exposure {exposure:.4g}") if each)
    return codes_panel(shown, lambda part: encode(part * np.float32(exposure), 8), said, share)


def codes_panel(values: Array, code: Callable[[Array], Array], caption: str, share: int = 1) -> Panel:
    """A panel of any numbers.

    Args:
        values: shape (rows, columns[, channels]).
        code: converts values to uint8.
        caption: below it.
        share: number of pictures in the display.
    """
    first = factor = max(-(-max(values.shape[:2]) // LARGEST_SIDE), 1)
    while True:
        codes = code(averaged(values, factor))
        png = encoded(codes)
        if len(png) <= MOST_BYTES // share:
            break
        factor += 1
    if factor > 1:
        caption += f"; {factor}×{factor} pixels as one"
    panel = sized(png, codes.shape, caption)
    # If averaging only saved bytes, keep the displayed size.
    return panel if factor == first else replace(panel, width=codes.shape[1] * factor // first)


def sized(png: bytes, shape: tuple[int, ...], caption: str) -> Panel:
    """A panel of a picture with these rows and columns, magnified if it is small."""
    times = max(MAGNIFIED_TO // max(shape[:2]), 1)
    return Panel(png, shape[1] * times, caption, pixelated=times > 1)


def encoded(codes: Array) -> bytes:
    """A PNG file of uint8 codes, (rows, columns) or (rows, columns, 3 or 4)."""
    import imagecodecs

    return bytes(imagecodecs.png_encode(np.ascontiguousarray(codes), level=6))


def sheet(pictures: Sequence[Sequence[Array | None]], exposure: float) -> Array:
    """Pictures of light in rows and columns, RGBA codes; transparent in gaps and for missing pictures.

    Args:
        pictures: linear and upright, 1 or 3 channels, of one shape; None for a missing one.
        exposure: the factor before the sRGB curve.
    """
    first = next(each for row in pictures for each in row if each is not None)
    rows, columns = first.shape[:2]
    made = np.zeros((len(pictures) * (rows + GAP) - GAP, len(pictures[0]) * (columns + GAP) - GAP, 4), np.uint8)
    for number, row in enumerate(pictures):
        for place, picture in enumerate(row):
            if picture is None:
                continue
            codes = encode(picture * np.float32(exposure), 8)
            down, right = number * (rows + GAP), place * (columns + GAP)
            piece = made[down : down + rows, right : right + columns]
            piece[..., :3] = codes if codes.ndim == 3 else codes[..., None]
            piece[..., 3] = 255
    return made


def drawn(draw: Callable[[], Any], caption: str = "", share: int = 2) -> Panel:
    """A panel of a Matplotlib drawing, which is not displayed elsewhere.

    Args:
        draw: returns axes or a figure, by the functions of `vcc.plot`.
        caption: below it.
        share: number of pictures in the display.
    """
    with style.by_itself():
        made = draw()
    figure = getattr(made, "figure", None) or made
    from PIL import Image

    png = b""
    for dots in (DOTS, SHOWN_DOTS):
        stream, small = BytesIO(), BytesIO()
        figure.savefig(stream, format="png", dpi=dots, facecolor="white")
        # A drawing has few colours, and an indexed PNG takes half the bytes.
        Image.open(stream).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE).save(small, "png")
        png = small.getvalue()
        if len(png) <= MOST_BYTES // share:
            break
    return Panel(png, round(figure.get_size_inches()[0] * SHOWN_DOTS), caption, paper=True)


def map_panel(values: Array, label: str, caption: str = "", *, outliers: bool = True) -> Panel:
    """A colour map of numbers by position, with a scale.

    Args:
        values: shape (rows, columns); values that are not finite stay white.
        label: of the scale, with the unit.
        caption: below it.
        outliers: whether the scale leaves out the lowest and the highest 1 % of the numbers.
    """

    def draw() -> Any:
        factor = max(-(-max(values.shape) // LARGEST_SIDE), 1)
        numbers = np.asarray(values, dtype=np.float64)[::factor, ::factor]
        numbers = np.where(np.isfinite(numbers), numbers, np.nan)
        ends = (1, 99) if outliers else (0, 100)
        low, high = np.nanpercentile(numbers, ends) if np.isfinite(numbers).any() else (0.0, 1.0)
        rows, columns = numbers.shape
        axes = style.new_axes(4.8, min(max(4.0 * rows / columns, 1.2), 4.4))
        image = axes.imshow(numbers, cmap="viridis", vmin=low, vmax=high, interpolation="nearest")
        axes.set_xticks([])
        axes.set_yticks([])
        axes.spines[:].set_visible(False)
        scale = axes.figure.colorbar(image, ax=axes, fraction=0.05, extend="neither")
        scale.set_label(label, color=style.INK)
        scale.outline.set_visible(False)
        return axes

    return drawn(draw, caption)
