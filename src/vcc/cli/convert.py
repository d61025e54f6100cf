"""``vcc convert``: a light field to a store, or to files of another format."""

from __future__ import annotations

import dataclasses
import re
import warnings
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter

from vcc import __version__
from vcc.base.errors import InputError, ResultWarning
from vcc.base.reading import check_path, expanded
from vcc.base.words import first_few
from vcc.cli.console import free_output, progress, show
from vcc.cli.options import (
    Arrangement,
    Counts,
    FileKind,
    Length,
    Lengths,
    LightFieldFile,
    Number,
    OutputFile,
    Overwrite,
    Reading,
    ViewExposure,
    Whole,
    exposed,
    given_options,
)
from vcc.cli.store_words import video_written, written
from vcc.formats import open_unstructured, read_geometry
from vcc.formats.unstructured import recognised as has_poses
from vcc.formats.writing import kind_of, save_light_field
from vcc.light_field import LightField
from vcc.store import Lossless, Lossy, StoredLightField, create_video, is_store, is_video, open_video
from vcc.store import convert as convert_to_store
from vcc.store.attributes import difference


@Parameter(name="*", group=Group("Making a store", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class Storing:
    """How a store keeps samples.

    Args:
        dtype: Type of the stored samples: uint8 and uint16 hold sRGB codes if the samples were not integers
            before, float16 and float32 hold linear light. Default: as they are, bit for bit.
        compression: Lossless: zstd (the default) compresses more, lz4 is faster.
        level: Of lossless compression, 0 (fast) to 9 (small). Default: 3.
        lossy: Store each view as a compressed picture, smaller but changed; the change is measured and
            reported.
        quality: With --lossy, 1 (small) to 99 (fine). Default: 90.
        chunks: Rows of pixels compressed together: with fewer, reading part of a view costs less. Default:
            128 kB.
    """

    dtype: Literal["uint8", "uint16", "float16", "float32"] | None = None
    compression: Literal["zstd", "lz4"] | None = None
    level: Whole | None = None
    lossy: Literal["jpegxl", "avif"] | None = None
    quality: Whole | None = None
    chunks: Annotated[Whole | None, Parameter(metavar="ROWS")] = None

    def packing(self) -> Lossless | Lossy:
        """The compression of the samples.

        Raises:
            InputError: options of both kinds, or a level or quality out of range.
        """
        if self.lossy and (self.compression or self.level is not None):
            raise InputError("--compression and --level are for lossless packing: leave them out with --lossy")
        if self.quality is not None and not self.lossy:
            raise InputError("--quality is for --lossy: say jpegxl or avif")
        if self.lossy:
            return Lossy(self.lossy, 90 if self.quality is None else self.quality)
        return Lossless(self.compression or "zstd", 3 if self.level is None else self.level)


@Parameter(name="*", group=Group("Photographs with poses", sort_key=4))
@dataclass(frozen=True, kw_only=True)
class Posing:
    """The grid onto which photographs with poses are resampled, with --views and --spacing.

    Args:
        unit: Length of a unit of the poses, "10 cm", which COLMAP does not state. Default: 1 m, with a note.
        distances: Of the nearest and the farthest object from the cameras, "1.4 m, 3 m". Default: by the points of
            the scene in the file.
        pixels: Rows and columns of a view's pixels. Default: those of the photographs.
        images: Folder of the photographs. Default: images of the project, or the folder of transforms.json.
        off_plane: Largest error at the borders of views by cameras that are off their plane, pixels. Default: 1.
    """

    unit: Length | None = None
    distances: Lengths | None = None
    pixels: Counts | None = None
    images: Annotated[Path | None, Parameter(metavar="FOLDER")] = None
    off_plane: Number | None = None

    def on_grid(self, path: Path, reading: Reading) -> LightField:
        """The photographs at a path as a light field; their share of missing pixels is a warning.

        Raises:
            InputError: options that do not apply; see also `vcc.formats.open_unstructured` and its ``on_grid``.
        """
        ours = ("views", "spacing", "focus_distance", "files_outside")
        if wrong := given_options(reading, but=ours):
            raise InputError(
                f"{path} is photographs with poses, which state their cameras: leave out {', '.join(wrong)}"
            )
        if self.distances is not None and not isinstance(self.distances, tuple):
            raise InputError(
                '--distances is one length: write those of the nearest and the farthest object, "1 m, 3 m"'
            )
        photographs = open_unstructured(
            path, images=self.images, metres_per_unit=self.unit, files_outside=reading.files_outside
        )
        asked = {
            "distances": self.distances,
            "pixels": self.pixels,
            "off_plane": self.off_plane,
            **{name: getattr(reading, name) for name in ours[:3]},
        }
        with progress("Rendering views") as advance:
            return photographs.on_grid(
                **{name: value for name, value in asked.items() if value is not None}, progress=advance
            )


def convert(
    light_field: LightFieldFile,
    output: OutputFile,
    /,
    *,
    kind: FileKind | None = None,
    exposure: ViewExposure = 1.0,
    overwrite: Overwrite = False,
    frame_rate: Number | None = None,
    storing: Storing = Storing(),
    reading: Reading = Reading(),
    posing: Posing = Posing(),
) -> None:
    """Convert a light field to a store (Zarr), or to files of another format.

    A store keeps samples bit for bit, with their cameras. It opens at once and is read in parts, so that a
    capture fits in any memory (--memory-limit). It appears when it is complete.

    Photographs with poses (COLMAP, transforms.json) are resampled onto a grid of views.

    Examples:
        vcc convert views/ scene.zarr --spacing "1 mm"
        vcc convert views/ small.zarr --lossy jpegxl --quality 90
        vcc convert scene.zarr half.zarr --dtype float16
        vcc convert scene.zarr flight.mp4
        vcc convert my_photographs/ field.zarr --unit "10 cm" --distances "1.4 m, 3 m"
        vcc convert take/ video.zarr --frame-rate 24 --spacing "1 mm"

    Args:
        frame_rate: Frames per second: make a video from LIGHT_FIELD, a folder with one light field per frame
            (frame_0001, frame_0002, …). The same command appends frames that were added since.

    Raises:
        InputError: the output exists, or reading or writing fails.
    """
    posed = frame_rate is None and has_poses(expanded(light_field)) is not None
    if not posed and (wrong := given_options(posing)):
        raise InputError(f"{', '.join(wrong)}: for photographs with poses (COLMAP, transforms.json)")
    if frame_rate is not None:
        if output.suffix.lower() != ".zarr" or kind or overwrite:
            raise InputError(
                "--frame-rate makes a video, or appends to an existing one: end OUT in .zarr, and leave out "
                "--kind and --overwrite"
            )
        exposed(exposure, "zarr")
        show(_to_video(light_field, output.expanduser(), storing, reading, frame_rate))
    elif output.suffix.lower() == ".zarr":
        if kind:
            raise InputError("--kind is for folders and pictures of views: OUT is a store")
        exposed(exposure, "zarr")
        packing = storing.packing()
        output = free_output(output, overwrite)
        source = _posed(light_field, posing, reading) if posed else _with_its_codes(light_field, reading)
        show(_to_store(light_field, source, output, storing, packing, overwrite))
    else:
        if wrong := given_options(storing):
            raise InputError(
                f"{', '.join(wrong)} {'is' if len(wrong) == 1 else 'are'} for stores: end OUT in .zarr"
            )
        output = free_output(output, overwrite)
        options = exposed(exposure, kind_of(output, kind))
        field = posing.on_grid(light_field, reading) if posed else reading.light_field(light_field)
        with progress("Writing views") as advance:
            show(save_light_field(field, output, kind=kind, progress=advance, **options).description)


Codes = tuple[LightField | StoredLightField, Literal["srgb", "linear"], list[str] | None]
"""A light field, the encoding of its samples, its assumed parameters (None for stores, which record them)."""


def _to_store(
    path: Path, source: Codes, output: Path, storing: Storing, packing: Lossless | Lossy, overwrite: bool
) -> str:
    """Convert a light field from a path to a store; return a summary as text."""
    field, transfer, assumed = source
    with progress("Writing views") as advance:
        made = convert_to_store(
            field,
            output,
            transfer=transfer,
            dtype=storing.dtype,
            provenance=None if assumed is None else _provenance(path, assumed),
            chunks=storing.chunks,
            compression=packing,
            overwrite=overwrite,
            progress=advance,
        )
    return written(made, packing.words)


def _to_video(source: Path, output: Path, storing: Storing, reading: Reading, rate: float) -> str:
    """Append the light fields of a folder that a video lacks to the video; return a summary as text."""
    frames, packing = numbered_frames(source), storing.packing()
    made = {
        "converted_from": source.expanduser().resolve().name,
        "first_frame": frames[0].name,
        "frame_rate": rate,
    }
    before = _frames_of(output, made)
    with warnings.catch_warnings():
        for number, path in enumerate(frames[before:], start=before):
            field, transfer, assumed = _with_its_codes(path, reading)
            kept = create_video(
                output,
                transfer=transfer,
                dtype=storing.dtype,
                provenance=_provenance(source, assumed or []) | made,
                chunks=storing.chunks,
                compression=packing,
            )
            with kept as video, progress(f"Writing frame {number + 1} of {len(frames)}") as advance:
                video.append(field, number / rate, progress=advance)
            # The assumptions hold for all frames, and are reported once.
            warnings.filterwarnings("ignore", ".* do not state ", ResultWarning)
    return video_written(open_video(output), before)


def _frames_of(output: Path, made: dict[str, Any]) -> int:
    """The number of frames of an existing video with this provenance; 0 if there is no video.

    Raises:
        InputError: the existing video has another provenance.
    """
    if not is_video(output):
        return 0
    there = open_video(output)
    other = {name: there.provenance.get(name) for name in made}
    if other != made:
        words = difference(other, made)
        raise InputError(f"{output} is there already, a video of other frames: {words}. Choose another name")
    return len(there)


def _posed(source: Path, posing: Posing, reading: Reading) -> Codes:
    """Photographs with poses on a grid, in linear light."""
    return posing.on_grid(source, reading), "linear", [] if posing.unit else ["metres_per_unit"]


def _with_its_codes(source: Path, reading: Reading) -> Codes:
    """A light field with samples as stored in the files, their encoding, and the assumed parameters."""
    if is_store(source):
        return reading.light_field(source), "linear", None
    facts = read_geometry(source, sparse=reading.missing != "refuse", **reading.given(Arrangement))
    assumed = [name for name in facts.unknown if getattr(reading, name) is None]
    facts.metadata.check(reading.transfer)
    if facts.missing and reading.missing == "fill":  # views are rendered, and their errors stated, in linear light
        return reading.in_memory(source), "linear", assumed
    as_stored, transfer = facts.codes
    field = dataclasses.replace(reading, transfer=as_stored).in_memory(source)
    if field.values.dtype.kind != "u" or reading.transfer == "as-is":
        return field, "linear", assumed
    return field, transfer if reading.transfer == "auto" else reading.transfer, assumed


def _provenance(source: Path, assumed: list[str]) -> dict[str, Any]:
    return {
        "converted_from": source.expanduser().resolve().name,
        "converted_by": f"vcc {__version__}, vcc convert",
        "converted_at": datetime.now(UTC).isoformat(timespec="seconds"),
        "assumed": assumed,
    }


# --- the light fields of a folder as frames of a video, ordered by the numbers in their names ---


_NUMBERED = re.compile(r"(.*?)([0-9]+)((?:\.[A-Za-z]\w*)*)")


def numbered_frames(folder: Path) -> list[Path]:
    """The folders and files whose names differ only in a number, ``frame_0001``, ordered by it.

    Args:
        folder: their parent; entries without a number in their name are skipped.

    Raises:
        InputError: not a folder, no numbered entry, several kinds of names, or numbers that are missing or
            repeated.
    """
    folder = expanded(folder)
    if not check_path(folder, "folder of frames"):
        raise InputError(
            f"{folder} is a file: --frame-rate is for a folder that holds a light field for each frame"
        )
    kinds: dict[tuple[str, str], dict[int, Path]] = {}
    for path in sorted(folder.iterdir()):
        match = None if path.name.startswith(".") else _NUMBERED.fullmatch(path.name)
        if match is None:
            continue
        same = kinds.setdefault((match[1], match[3]), {})
        other = same.setdefault(int(match[2]), path)
        if other is not path:
            raise InputError(f"{other} and {path.name} are both frame {int(match[2])}: take one of them away")
    if len(kinds) != 1:
        named = [next(iter(same.values())).name for same in kinds.values()]
        found = (
            f"several kinds of numbered names, {first_few(named, len(named), 4)}" if named else "nothing numbered"
        )
        raise InputError(
            f"{folder} holds {found}: the frames of a video are folders or files of one kind, frame_0001, "
            "frame_0002, …"
        )
    frames = next(iter(kinds.values()))
    for before, after in pairwise(sorted(frames)):
        if after != before + 1:
            raise InputError(
                f"{folder}: frame {before + 1} is missing between {frames[before].name} and {frames[after].name}. "
                "To append frames at arbitrary times, use vcc.store.create_video in Python"
            )
    return [frames[number] for number in sorted(frames)]
