"""What ``vcc decode`` does: recordings and lists of centres read, decoded, written as light fields."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError, ResultWarning
from vcc.cli.console import progress, show

if TYPE_CHECKING:
    from vcc.camera import Camera
    from vcc.light_field import LightField
    from vcc.recover import LensletGrid

_ORDERS = {"x y": "x-y", "row column": "row-column", "row col": "row-column"}
"""What a CSV's first line may say."""
_LYTRO = (".lfp", ".lfr")


@dataclass(frozen=True, eq=False)
class RawRecording:
    """A recording read: its numbers as they are, and what they stand for.

    Args:
        path: the file.
        numbers: (rows, columns[, channels]).
        black: what stands for no light, (rows, columns), or None for 0.
        largest: what stands for the most light; 1 where nothing is known.
        color_filter: of a mosaic.
    """

    path: Path
    numbers: NDArray[Any]
    black: NDArray[np.float32] | None
    largest: float
    color_filter: str | tuple[str, ...] | None

    def light(self) -> NDArray[np.float64]:
        """0 for none, 1 for the most."""
        numbers = self.numbers.astype(np.float64)
        if self.black is not None:
            numbers -= self.black if numbers.ndim == 2 else self.black[..., None]
        return numbers / self.scale

    @property
    def scale(self) -> float:
        """From no light to the most, in numbers."""
        return self.largest - (0.0 if self.black is None else float(self.black.mean()))


def read_raw(path: Path, camera: Camera | None, color_filter: str | None, black: float | None) -> RawRecording:
    """A picture or a Lytro file; black level and colour filter as told, or as the camera or the file say.

    Args:
        path: the file.
        camera: whose electronics tell, if it has any.
        color_filter: of a mosaic.
        black: the number that stands for no light.

    Raises:
        InputError: a file that cannot be read, or a colour filter other than the camera's or the file's.
    """
    from vcc.files.pictures import READ_ENDINGS, read_picture

    path = path.expanduser()
    if path.suffix.lower() in _LYTRO:
        from vcc.formats.lytro_lfp import read_lytro

        lytro = read_lytro(path)
        if color_filter not in (None, lytro.color_filter):
            raise InputError(f"{path} says that its mosaic is {lytro.color_filter}: leave out --color-filter")
        levels = lytro.black or (0.0,) * 4 if black is None else (black,) * 4
        dark = np.empty(lytro.mosaic.shape, np.float32)
        for place, number in enumerate(levels):
            dark[place // 2 :: 2, place % 2 :: 2] = number
        most = 2.0**lytro.bits - 1 if lytro.white is None else float(np.mean(lytro.white))
        return RawRecording(path, lytro.mosaic, dark, most, lytro.color_filter)
    if path.suffix.lower() not in READ_ENDINGS:
        known = ", ".join((*READ_ENDINGS, *_LYTRO))
        raise InputError(f"{path} is no recording that can be read: its name must end in {known}")
    numbers, _ = read_picture(path)
    if numbers.ndim == 3 and numbers.shape[2] == 1:
        numbers = numbers[..., 0]
    whole = numbers.dtype.kind == "u"
    largest = float(np.iinfo(numbers.dtype).max) if whole else 1.0
    electronics = None if camera is None else camera.sensor.electronics
    if electronics is None or not whole:
        level = None if black is None else np.full(numbers.shape[:2], black, np.float32)
        return RawRecording(path, numbers, level, largest, color_filter)
    if color_filter is not None and electronics.color_filter not in (None, color_filter):
        raise InputError(
            f"the camera file says that the colour filter is {electronics.color_filter}: leave out --color-filter"
        )
    even = np.full(numbers.shape[:2], electronics.black_level if black is None else black, np.float32)
    largest = min(electronics.black_level + electronics.gain * electronics.full_well, electronics.largest_number)
    return RawRecording(path, numbers, even, largest, electronics.color_filter or color_filter)


def through_lenslets(
    raw: RawRecording,
    grid: LensletGrid | None,
    camera: Camera | None,
    white: RawRecording | None,
    dark: NDArray[Any] | None,
    views: tuple[int | None, float],
    upright: bool,
    limit: int | None,
) -> tuple[LightField, str]:
    """The light field of a plenoptic camera, and how its micro-images were found, in words.

    Args:
        raw: the recording.
        grid: of the micro-images; None finds it in ``white``, or takes the camera's own.
        camera: the optics, for a metric frame.
        white: a recording of something evenly white.
        dark: numbers of a recording without light, (rows, columns[, channels]).
        views: how many each way, None for all; and pixels between them.
        upright: whether the recording was turned.
        limit: bytes that the light field may take.

    Raises:
        InputError: micro-images whose place nothing tells, or what `vcc.recover.decode_plenoptic` refuses.
    """
    from vcc.recover import LensletGrid, decode_plenoptic, find_lenslets

    if grid is None and white is None and camera is None:
        raise InputError(
            f"where the micro-images of {raw.path.name} are is not known: give --white (a recording of something "
            "evenly white by the same camera), --centres or --camera"
        )
    if dark is not None and dark.ndim < raw.numbers.ndim:
        dark = np.broadcast_to(dark[..., None], raw.numbers.shape)
    source = "given centres"
    if grid is None and white is not None:
        grid = find_lenslets(white.numbers, dark=dark, color_filter=raw.color_filter is not None)
        source = f"found in {white.path.name}"
    elif grid is None and camera is not None:
        grid, source = LensletGrid.of_camera(camera), "by the camera file"
    assert grid is not None
    tile: Any = raw.color_filter
    field = decode_plenoptic(
        raw.numbers,
        grid,
        camera=camera,
        white=None if white is None else white.numbers,
        dark=dark,
        color_filter=tile,
        views=views[0],
        view_step=views[1],
        inverted=not upright,
        memory_limit=limit,
    )
    if white is None and raw.scale != 1:
        field = field.replaced(np.asarray(field.values) / np.float32(raw.scale))
    off = f", {grid.residual:.2f} pixels off it (rms)" if grid.residual else ""
    words = (
        f"micro-images {source}, a {grid.layout} lattice of {grid.pitch:.3f} pixels turned by "
        f"{np.degrees(grid.rotation):.2f}°{off}"
    )
    return field, words if white is None else f"{words}; divided by {white.path.name}"


def through_a_mask(
    raw: RawRecording, camera: Camera, shadow: NDArray[Any] | None, border: float, upright: bool, limit: int | None
) -> LightField:
    """The light field of a camera with a mask of cosines.

    Args:
        raw: the recording.
        camera: the optics.
        shadow: a recorded calibration, (rows, columns[, channels]); None simulates it.
        border: share of the sensor that is faded out and cut off.
        upright: whether recording and calibration were turned.
        limit: bytes that the work may take.

    Raises:
        InputError: what `vcc.recover.decode_heterodyne` refuses.
    """
    from vcc.recover import decode_heterodyne

    light: NDArray[Any] = raw.light()
    if raw.color_filter is not None:
        from vcc.optics.electronics import Electronics
        from vcc.run.recording import demosaic

        light = demosaic(light.astype(np.float32), Electronics(color_filter=raw.color_filter), "bilinear")
    if upright:
        light, shadow = light[::-1, ::-1], None if shadow is None else shadow[::-1, ::-1]
    return decode_heterodyne(light, camera, calibration=shadow, border=border, memory_limit=limit)


def has_carrier(camera: Camera) -> bool:
    """Whether a camera has a mask of cosines rather than lenslets.

    Raises:
        InputError: it has neither.
    """
    from vcc.optics import LensArray, Mask
    from vcc.shapes.patterns import CosineSum

    carrier = any(isinstance(each, Mask) and isinstance(each.pattern, CosineSum) for each in camera.elements)
    if not carrier and not any(isinstance(each, LensArray) for each in camera.elements):
        raise InputError(
            "this camera has neither an array of lenslets nor a mask of cosines (pattern cosine_sum): its "
            f"recording holds no views. Its elements: {', '.join(e.label for e in camera.elements)}"
        )
    return carrier


# --- centres of micro-images ---


def grid_of(path: Path, order: str | None, first: int, bright: RawRecording) -> LensletGrid:
    """The lattice through listed centres.

    Args:
        path: of the list, .csv, .txt, .npy or .mat.
        order: "x-y" or "row-column"; None takes what the list's first line says, or x-y.
        first: the number of the first pixel, 0 or 1.
        bright: a recording that should be brighter at the centres than between them.

    Warns:
        ResultWarning: it is not.

    Raises:
        InputError: no such list, one that cannot be read, that lies outside of the recording, or is no lattice.
    """
    from vcc.recover import LensletGrid

    listed, said = _listed(path.expanduser())
    if order is not None and said not in (None, order):
        raise InputError(f'the first line of {path} says "{said}": leave out --centres-order')
    places = listed - first
    if (order or said or "x-y") == "row-column":
        places = places[:, ::-1]
    rows, columns = bright.numbers.shape[:2]
    outside = float(np.mean((places < -0.5).any(axis=1) | (places > (columns - 0.5, rows - 0.5)).any(axis=1)))
    if outside > 0.5:
        raise InputError(
            f"{outside:.0%} of the centres in {path} lie outside of the recording of {rows}×{columns} pixels: "
            "they belong to another one, or are row-column (--centres-order)"
        )
    grid = LensletGrid.from_centres(places)
    light = bright.light() if bright.numbers.ndim == 2 else bright.light().mean(axis=2)
    between = [(0.5, 0.5)] if grid.layout == "square" else [(1 / 3, 1 / 3), (2 / 3, 2 / 3)]
    index = grid.within((rows, columns), 2 * grid.pitch)
    at_centres, *gaps = (
        _mean_light(light, grid.centre_of(*(index + shift).T)) for shift in [(0.0, 0.0), *between]
    )
    if at_centres < 1.05 * max(gaps):  # of a sound list it is about twice that
        warnings.warn(
            f"{bright.path.name} is not brighter at the centres in {path.name} than between them: are they in the "
            "order x-y (--centres-order), counted from 0 (--centres-from), and of this camera?",
            ResultWarning,
            stacklevel=2,
        )
    return grid


def _mean_light(light: NDArray[np.float64], places: NDArray[np.float64]) -> float:
    """Over 2×2 pixels each, so that a mosaic's filters count alike."""
    x, y = np.floor(places).astype(int).T
    return float(np.mean([light[y + down, x + across] for down in (0, 1) for across in (0, 1)]))


def _listed(path: Path) -> tuple[NDArray[np.float64], str | None]:
    """(n, 2) numbers, and the order that a first line of names states."""
    if not path.is_file():
        raise InputError(f"there is no list of centres {path}")
    said = None
    try:
        if path.suffix.lower() == ".npy":
            found = np.load(path, allow_pickle=False)
        elif path.suffix.lower() == ".mat":
            from scipy.io import loadmat

            arrays = {name: each for name, each in loadmat(path).items() if not name.startswith("__")}
            lists = {n: a for n, a in arrays.items() if np.ndim(a) >= 2 and a.shape[-1] == 2 and a.size >= 32}
            if len(lists) != 1:
                raise InputError(
                    f"{path} must hold one array of centres, of shape (…, 2); its arrays: "
                    + ", ".join(f"{name} {np.shape(each)}" for name, each in arrays.items())
                )
            found = next(iter(lists.values()))
        elif path.suffix.lower() in (".csv", ".txt"):
            lines = path.read_text(encoding="utf-8").replace(",", " ").replace(";", " ").strip().splitlines()
            names = tuple(lines[0].lower().split()) if lines else ()
            header = bool(names) and not any(character.isdigit() for character in lines[0])
            said = _ORDERS.get(" ".join(names))
            found = np.array([[float(each) for each in line.split()] for line in lines[header:]])
        else:
            raise InputError(f"{path} is no list of centres: its name must end in .csv, .txt, .npy or .mat")
    except InputError:
        raise
    except Exception as error:  # each library has its own types for a damaged file
        raise InputError(f"{path} cannot be read as a list of centres, two numbers each: {error}") from None
    if found.ndim < 2 or found.shape[-1] != 2 or found.dtype.kind not in "uif":
        raise InputError(
            f"{path} must hold two numbers for each centre, and holds an array of shape {found.shape}"
        )
    return found.reshape(-1, 2).astype(np.float64), said


# --- what comes of it ---


def write_light_field(
    field: LightField, output: Path, kind: str | None, exposure: Any, overwrite: bool, source: Path
) -> None:
    """Write a light field and say what was written.

    Args:
        field: the light field.
        output: whose ending says the format.
        kind: "hci" or "views" for a folder, or None.
        exposure: of what people look at, a number or "auto".
        overwrite: whether a store of that name is replaced.
        source: the recording.

    Raises:
        InputError: what `vcc.formats.writing.save_light_field` refuses.
    """
    from vcc import __version__
    from vcc.formats.writing import save_light_field

    ending = output.suffix.lower()
    options: dict[str, Any] = {}
    if ending == ".zarr":
        made = {"decoded_from": source.name, "decoded_by": f"vcc {__version__}, vcc decode"}
        options = {"provenance": made, "overwrite": overwrite}
    elif ending in ("", ".mp4") or kind is not None:
        options = {"exposure": exposure}
    told: Any = kind
    with progress("Writing views") as advance:
        show(save_light_field(field, output, kind=told, progress=advance, **options).description)


def described(field: LightField, camera: Camera | None, output: Path) -> list[str]:
    """What a decoded light field is, and what to do next, in lines."""

    lines = []
    nv, nu, nt, ns = field.shape[:4]
    colour = "grey" if field.channels is None else f"{field.channels} channels"
    lines.append(f"  views    {nv}×{nu} of {ns}×{nt} pixels, {colour}")
    metric = "" if camera else "; not metric without --camera: disparities are right, distances are not"
    lines.append(f"  cameras  {field.grid.geometry}{metric}")
    lines.append(f"  next     vcc info {output}  ·  vcc refocus {output} --all-in-focus -o sharp.png")
    return lines
