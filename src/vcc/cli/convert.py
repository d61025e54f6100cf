"""``vcc convert``: a light field into a store, or into files of another format."""

import dataclasses
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Group, Parameter

from vcc import __version__
from vcc.base.errors import InputError
from vcc.cli.console import free_output, progress, show
from vcc.cli.options import (
    Arrangement,
    FileKind,
    LightFieldFile,
    OutputFile,
    Overwrite,
    Reading,
    ViewExposure,
    Whole,
    exposed,
    told,
)
from vcc.cli.store_words import written
from vcc.formats import read_geometry
from vcc.formats.writing import kind_of, save_light_field
from vcc.light_field import LightField
from vcc.store import Lossless, Lossy, StoredLightField, is_store
from vcc.store import convert as convert_to_store


@Parameter(name="*", group=Group("Making a store", sort_key=2))
@dataclass(frozen=True, kw_only=True)
class Storing:
    """How a store keeps samples.

    Args:
        dtype: What samples are stored as: uint8 and uint16 as sRGB codes where they were not integers before,
            float16 and float32 as linear light. Default: as they are, bit for bit.
        compression: Lossless: zstd (the default) packs more, lz4 is faster.
        level: Of lossless packing, 0 (fast) to 9 (small). Default: 3.
        lossy: Keep each view as a picture, changed and smaller; how much it is changed is measured and said.
        quality: With --lossy, 1 (small) to 99 (fine). Default: 90.
        chunks: Rows of pixels packed together: with fewer, parts of a view cost less to read. Default: 128 kB.
    """

    dtype: Literal["uint8", "uint16", "float16", "float32"] | None = None
    compression: Literal["zstd", "lz4"] | None = None
    level: Whole | None = None
    lossy: Literal["jpegxl", "avif"] | None = None
    quality: Whole | None = None
    chunks: Annotated[Whole | None, Parameter(metavar="ROWS")] = None

    def packing(self) -> Lossless | Lossy:
        """What packs the samples.

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


def convert(
    light_field: LightFieldFile,
    output: OutputFile,
    /,
    *,
    kind: FileKind | None = None,
    exposure: ViewExposure = 1.0,
    overwrite: Overwrite = False,
    storing: Storing = Storing(),
    reading: Reading = Reading(),
) -> None:
    """Put a light field into a store (Zarr), or into files of another format.

    Raises:
        InputError: an output that is there, or what reading and writing refuse.
    """
    if output.suffix.lower() == ".zarr":
        if kind:
            raise InputError("--kind is for folders and pictures of views: OUT is a store")
        exposed(exposure, "zarr")
        packing = storing.packing()
        output = free_output(output, overwrite)
        show(_to_store(light_field, output, storing, packing, overwrite, reading))
    else:
        if wrong := told(storing):
            raise InputError(
                f"{', '.join(wrong)} {'is' if len(wrong) == 1 else 'are'} for stores: end OUT in .zarr"
            )
        output = free_output(output, overwrite)
        options = exposed(exposure, kind_of(output, kind))
        field = reading.light_field(light_field)
        with progress("Writing views") as advance:
            show(save_light_field(field, output, kind=kind, progress=advance, **options).description)


def _to_store(
    source: Path, output: Path, storing: Storing, packing: Lossless | Lossy, overwrite: bool, reading: Reading
) -> str:
    """Convert a light field to a store; what came of it, in words."""
    field, transfer, assumed = _with_its_codes(source, reading)
    with progress("Writing views") as advance:
        made = convert_to_store(
            field,
            output,
            transfer=transfer,
            dtype=storing.dtype,
            provenance=None if assumed is None else _provenance(source, assumed),
            chunks=storing.chunks,
            compression=packing,
            overwrite=overwrite,
            progress=advance,
        )
    return written(made, packing.words)


def _with_its_codes(
    source: Path, reading: Reading
) -> tuple[LightField | StoredLightField, Literal["srgb", "linear"], list[str] | None]:
    """A light field with its samples as the files have them, how they stand for light, and what was assumed.

    Of a store, which knows where it comes from, nothing is assumed: None.
    """
    if is_store(source):
        return reading.light_field(source), "linear", None
    facts = read_geometry(source, **reading.given(Arrangement))
    assumed = [name for name in facts.unknown if getattr(reading, name) is None]
    facts.stated.check(reading.transfer)
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
