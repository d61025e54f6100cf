"""Videos whose frames are views, of a camera moving along a line or over a grid; and flights through a light
field as videos for people.
"""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from os import PathLike
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from vcc.base import checks
from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.fields.samples import Samples
from vcc.files.atomic import atomic_path
from vcc.files.declared_sizes import LIGHT_FIELD, check_declared_size
from vcc.files.pictures import Exposure
from vcc.formats.exposing import Codes
from vcc.formats.grid import Decoded
from vcc.formats.orders import Order, arrangement, check, running_numbers, thumbnail

ENDINGS = (".mp4", ".mov", ".mkv", ".avi", ".webm", ".m4v")

Movement = Literal["right", "left", "down", "up"]
"""Direction in which the camera of a video moves, as seen by an observer who faces the scene."""
Flight = Literal["serpentine", "circle", "row"]
"""Paths through the views of a light field; see `save`."""

_BT709, _UNSPECIFIED, _SRGB_CURVE = 1, 2, 13  # ITU-T H.273
_HIGH_DYNAMIC_RANGE = {16: "PQ", 18: "HLG"}
_THIS_FILE_ALONE = {
    "protocol_whitelist": "file",
    "format_whitelist": "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi",  # playlists would open other files
}
_HD = 720  # rows from which players assume BT.709 if nothing is stated


def recognised(path: Path) -> bool:
    """Whether the path is a video, by its extension."""
    return path.suffix.lower() in ENDINGS and path.is_file()


def read(
    path: Path,
    *,
    every: int = 1,
    first: int = 0,
    last: int | None = None,
    moves: Movement = "right",
    views: tuple[int, int] | None = None,
    order: Order | None = None,
    progress: Progress | None = None,
) -> Decoded:
    """Read the frames of a video as views at equal steps along a line, or over a grid.

    Args:
        path: the video.
        every: use every n-th frame.
        first: first frame to use, counted from 0.
        last: last frame that may be used; by default the last of the video.
        moves: direction of a camera on a line: "right" and "left" make one row of views, "down" and "up" one
            column.
        views: (rows, columns) of a grid of views. If either this or the order is given, the frames form a grid
            and the other is detected: in the right arrangement neighbours differ least.
        order: order of the frames in a grid, see `vcc.formats.orders`.
        progress: called as progress(done, total) after each frame; total is 0 if the video does not state it.

    Returns:
        Samples of shape (1, views, t, s, 3) or (views, 1, t, s, 3), for a grid (rows, columns, t, s, 3): uint8,
        or uint16 for videos of more than 8 bits, display-referred. Spacing and field of view are unknown.

    Raises:
        InputError: no PyAV, a damaged or truncated video, fewer than two frames or another number than the grid
            needs, an arrangement that is not clear from the frames, or transfer functions of high dynamic
            range.
    """
    path = Path(path)
    _check_selection(every, first, last, moves)
    check(views, order)
    on_a_line = views is None and order is None
    if not on_a_line and moves != "right":
        raise InputError(f'{path}: moves="{moves}" is of a camera on a line: leave it out with views= and order=')
    av = library()
    frames: list[NDArray[Any]] = []
    remarks: list[str] = []
    try:
        with av.open(str(path), options=_THIS_FILE_ALONE, metadata_errors="replace") as container:
            if not container.streams.video:
                raise InputError(f"{path} holds no video")
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            stream.codec_context.options = {"max_pixels": str(LIGHT_FIELD // 6)}  # two frames of three channels
            decoded, end = 0, 0.0
            for frame in container.decode(stream):
                if last is not None and decoded > last:
                    break
                if decoded >= first and (decoded - first) % every == 0:
                    _check_claim(frame, len(frames) + 1, path)
                    frames.append(_picture(frame, path))
                    if frames[-1].shape != frames[0].shape:
                        raise InputError(f"{path}: the size of the picture changes at frame {decoded}")
                    if len(frames) == 1:
                        remarks = _notices(frame, stream)
                decoded += 1
                end = frame.time or 0.0
                tell(progress, decoded, stream.frames)
            else:
                _check_complete(stream, decoded, end, path)
    except av.error.FFmpegError as error:
        raise InputError(
            f"{path} cannot be read as a video: it is truncated, damaged or in a format that is not "
            f"known ({error}). Copy it again from where it came from"
        ) from error
    if len(frames) < 2:
        raise InputError(
            f"{path} gives {len(frames)} of its {decoded} frames with every={every}, first={first}, last={last}; "
            "a light field needs two or more"
        )
    kind = "video of a camera on a line"
    if on_a_line:
        values = _along_a_line(frames, moves)
    else:
        grid, order = _arranged(frames, views, order, path)
        values = np.stack([frames[number] for number in running_numbers(grid, order).flat])
        values = values.reshape(*grid, *values.shape[1:])
        kind = f"video of a grid, {grid[0]}×{grid[1]} views, {order}"
    return Decoded(
        format=kind,
        values=values,
        transfer="srgb",
        notices=tuple(remarks),
        metadata={"frames": decoded, "frames_per_second": float(stream.average_rate or 0)},
    )


def save(
    light_field: Samples,
    path: str | PathLike[str],
    *,
    flight: Flight = "serpentine",
    frames_per_second: float = 25,
    exposure: Exposure = 1.0,
    quality: int = 18,
    lossless: bool = False,
) -> tuple[int, float, float]:
    """Write a flight through the views as an MP4 (H.264, sRGB): each frame is a view, without interpolation.

    Args:
        light_field: a light field of 1 or 3 channels.
        path: path to write to; ends in ``.mp4``.
        flight: "serpentine" passes all views, every other row reversed; "circle" passes the views nearest to
            the largest ellipse once, for looped playback; "row" passes the middle row, left to right (the
            column, if there is only one).
        frames_per_second: frame rate.
        exposure: factor before the sRGB curve; "auto" uses 1 over the 99.5th percentile of the brightest
            channels in the central view.
        quality: libx264's constant rate factor: 0 (best) to 51.
        lossless: keep each 8-bit sample exactly (H.264 in RGB: large, and few players support it).

    Returns:
        The number of frames, the exposure, and the fraction of the samples, 0 to 1, that were clipped. Without
        ``lossless``, the last row or column of pictures with odd height or width is duplicated.

    Raises:
        InputError: no PyAV, another extension or number of channels, an unknown flight, an invalid rate or
            quality, or a path that is not writable.
    """
    path = Path(path).expanduser()
    checks.ending("a flight", path, ".mp4")
    grid = light_field.grid
    if grid.channels not in (None, 1, 3):
        raise InputError(f"a video has 1 or 3 channels, and this light field has {grid.channels}")
    checks.above_zero("frames_per_second", frames_per_second)
    checks.zero_or_more("quality (libx264's constant rate factor)", quality, most=51)
    rows, columns, height, width = grid.shape[:4]
    way = _way(rows, columns, flight)
    numbers = Codes(light_field, 8, "srgb", exposure)
    library()

    def pictures() -> Iterator[NDArray[np.uint8]]:
        for row, column in way:
            codes = numbers.view(row, column).reshape(height, width, -1)
            codes = np.broadcast_to(codes, (height, width, 3))
            if not lossless:
                codes = np.pad(codes, ((0, height % 2), (0, width % 2), (0, 0)), mode="edge")
            yield np.ascontiguousarray(codes)

    with atomic_path(path) as temporary:
        encode(temporary, pictures(), frames_per_second, quality, lossless, f"{path}")
    return len(way), numbers.exposure, numbers.clipped


def library() -> Any:
    """Import PyAV.

    Raises:
        InputError: PyAV is not installed.
    """
    with checks.package("reading and writing videos", "av", "video"):
        import av

        return av


def _check_selection(every: int, first: int, last: int | None, moves: str) -> None:
    checks.one_of("moves", moves, get_args(Movement))
    for name, value, least in (("every", every, 1), ("first", first, 0), ("last", last, first)):
        if value is not None:
            checks.whole_number_between(name, value, least)


def _along_a_line(frames: list[NDArray[Any]], moves: Movement) -> NDArray[Any]:
    values = np.stack(frames[::-1] if moves in ("left", "up") else frames)
    return values[None] if moves in ("left", "right") else values[:, None]


def _arranged(
    frames: list[NDArray[Any]], views: tuple[int, int] | None, order: Order | None, path: Path
) -> tuple[tuple[int, int], Order]:
    """(rows, columns) and the order of frames over a grid; detected if not given."""
    if views is not None and views[0] * views[1] != len(frames):
        raise InputError(
            f"{path} gives {len(frames)} frames, and views={views} would be {views[0] * views[1]}. every=, first= "
            "and last= choose among them"
        )
    if views is not None and order is not None:
        return views, order
    return arrangement([thumbnail(frame) for frame in frames], views, order, f"{path} gives {len(frames)} frames")


def _check_claim(frame: Any, count: int, path: Path) -> None:
    """Raise if the file is too small for this number of frames: repeated frames need no bytes."""
    width = 1 if _bits(frame) <= 8 else 2
    try:
        check_declared_size(
            3 * frame.height * frame.width * count * width, path.stat().st_size, str(path), LIGHT_FIELD
        )
    except InputError as error:
        raise InputError(f"{error}, or take fewer frames with every=, first= and last=") from None


def _bits(frame: Any) -> int:
    return max(int(component.bits) for component in frame.format.components)


def _picture(frame: Any, path: Path) -> NDArray[Any]:
    """Convert a frame to upright RGB."""
    if frame.is_corrupt:
        raise InputError(f"{path}: the frame at {frame.time} s is damaged. Copy it again from where it came from")
    if frame.color_trc in _HIGH_DYNAMIC_RANGE:
        raise InputError(
            f"{path} has the brightness curve {_HIGH_DYNAMIC_RANGE[frame.color_trc]} (high dynamic range), which "
            "is not sRGB: convert it to a video of standard dynamic range"
        )
    bits = _bits(frame)
    source = "ITU709" if frame.colorspace == _UNSPECIFIED and frame.height >= _HD else None
    samples: NDArray[Any] = frame.to_ndarray(format="rgb24" if bits <= 8 else "rgb48le", src_colorspace=source)
    if frame.rotation % 90:
        raise InputError(f"{path} is to be turned by {frame.rotation}°, which is no multiple of 90°")
    return np.rot90(samples, frame.rotation // 90)


def _notices(frame: Any, stream: Any) -> list[str]:
    said = ["its frames are taken as views from places in equal steps, and its samples as sRGB"]
    if frame.interlaced_frame:
        said.append("it is interlaced: every other row is from another moment. Deinterlace it first")
    aspect = stream.sample_aspect_ratio
    if aspect and aspect != 1:
        said.append(
            f"its pixels are {aspect} as wide as high: give slope_per_pixel=(pt, ps), the second that much larger"
        )
    return said


def _check_complete(stream: Any, decoded: int, end: float, path: Path) -> None:
    """Raise if a video has fewer frames than it states."""
    stated = stream.frames
    hours, _, rest = stream.metadata.get("DURATION", "").partition(":")  # Matroska states no number of frames
    if not stated and rest and stream.average_rate:
        minutes, _, seconds = rest.partition(":")
        step = 1 / float(stream.average_rate)
        lasts = 3600 * float(hours) + 60 * float(minutes) + float(seconds)
        stated = decoded + max(0, round((lasts - end) / step) - 1)
    if decoded < stated:
        raise InputError(
            f"{path} has {decoded} of the {stated} frames that it states: the rest is missing. Copy it again "
            "from where it came from, or take those there are with last="
        )


def _way(rows: int, columns: int, flight: Flight) -> list[tuple[int, int]]:
    """(row, column) of the views of a flight, in order."""
    checks.one_of("flight", flight, get_args(Flight))
    if flight == "serpentine":
        return [(r, c if r % 2 == 0 else columns - 1 - c) for r in range(rows) for c in range(columns)]
    if flight == "row":
        if columns == 1:
            return [(r, 0) for r in range(rows)]
        return [((rows - 1) // 2, c) for c in range(columns)]
    angles = np.linspace(0, 2 * np.pi, 16 * (rows + columns), endpoint=False)
    down = np.rint((rows - 1) / 2 * (1 - np.cos(angles))).astype(int)
    right = np.rint((columns - 1) / 2 * (1 + np.sin(angles))).astype(int)
    way: list[tuple[int, int]] = []
    for place in zip(down.tolist(), right.tolist(), strict=True):
        if not way or place != way[-1]:
            way.append(place)
    return way[:-1] if len(way) > 1 and way[0] == way[-1] else way


def encode(
    path: Path,
    pictures: Iterator[NDArray[np.uint8]],
    frames_per_second: float,
    quality: int,
    lossless: bool,
    words: str,
) -> None:
    """Write sRGB pictures, all of one even size, as an H.264 film.

    Args:
        path: path to write to.
        pictures: pictures of shape (rows, columns, 3).
        frames_per_second: frame rate.
        quality: H.264's constant rate factor, 0 (best) to 51.
        lossless: keep samples exactly, as RGB; few players support it.
        words: name of the file in an error.

    Raises:
        InputError: no PyAV, or pictures that it cannot write.
        OSError: the write fails.
    """
    av = library()
    try:
        with av.open(str(path), "w", options={"movflags": "+faststart"}) as container:
            stream: Any = None
            for picture in pictures:
                if stream is None:
                    codec, options = (
                        ("libx264rgb", {"qp": "0"}) if lossless else ("libx264", {"crf": str(quality)})
                    )
                    rate = Fraction(frames_per_second).limit_denominator(1001)
                    stream = container.add_stream(codec, rate=rate, options=options)
                    stream.height, stream.width = picture.shape[:2]
                    stream.pix_fmt = "rgb24" if lossless else "yuv420p"
                    context = stream.codec_context
                    context.color_primaries, context.color_trc = _BT709, _SRGB_CURVE
                    if not lossless:
                        context.colorspace = context.color_range = _BT709
                frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
                if not lossless:
                    frame = frame.reformat(format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG")
                container.mux(stream.encode(frame))
            container.mux(stream.encode(None))
    except (av.error.FFmpegError, av.codec.codec.UnknownCodecError) as error:
        if isinstance(error, OSError) and error.errno:
            raise
        raise InputError(f"{words} could not be written as a video: {error}") from error
