"""Metadata of the pictures of a folder of views, and conversion to linear light."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.files.image_metadata import ImageMetadata, metadata_of
from vcc.files.images_with_metadata import ImageWithMetadata, check_agrees, light_of, unknown


@dataclass(frozen=True)
class ViewsWithMetadata:
    """The metadata of pictures, checked to be consistent.

    Args:
        said: metadata by file; empty if no picture has any.
        transfer: transfer function of the pictures; None if they have no metadata.
    """

    said: dict[Path, ImageMetadata]
    transfer: Literal["srgb", "linear"] | None

    @classmethod
    def of(cls, files: Iterable[Path]) -> ViewsWithMetadata:
        """Read the metadata of these pictures, without their samples.

        Raises:
            InputError: relevant metadata differ between pictures; raw numbers of a sensor; or damaged metadata.
        """
        every = {file: metadata_of(file) for file in files}
        said = {file: each for file, each in every.items() if each is not None}
        silent = [file for file, each in every.items() if each is None]
        for file, each in said.items():
            if each.recording is not None:
                raise InputError(
                    f"{file} states that it holds {each.in_words}: a raw recording is not a view, decode it"
                )
        first = next(iter(said), None)
        if first is None:
            return cls({}, None)
        for file, each in said.items():
            if (each.transfer, each.upright) != (said[first].transfer, said[first].upright):
                raise InputError(
                    f"{file.name} says that its numbers are {each.in_words}, and {first.name} "
                    f"{said[first].in_words}: views of a light field are stored alike"
                )
            if silent and (each.transfer != "srgb" or not each.is_neutral):
                raise InputError(
                    f"{file.name} says that its numbers are {each.in_words}, and {silent[0].name} has no "
                    "metadata. Write all views again in the same way"
                )
        return cls(said, said[first].transfer)

    @property
    def is_neutral(self) -> bool:
        """Whether the numbers are upright and not exposed, so that they can be used unchanged."""
        return all(each.is_neutral for each in self.said.values())

    @property
    def is_usual(self) -> bool:
        """Whether the metadata equal the assumptions for pictures without metadata."""
        return self.transfer in (None, "srgb") and self.is_neutral

    @property
    def in_words(self) -> str:
        """Short text for people; empty if there are no metadata."""
        differ = len({each.exposure for each in self.said.values()}) > 1
        first = next(iter(self.said.values()), None)
        return "" if first is None else first.in_words + (" and others" if differ else "")

    def check(self, told: str) -> None:
        """Raise if the files contradict a transfer function.

        Raises:
            InputError: it is "srgb" or "linear", and the files state the other.
        """
        for file, each in self.said.items():
            check_agrees(file, each, told)
            return

    def picture(self, file: Path, samples: NDArray[Any]) -> ImageWithMetadata:
        """A picture's samples with its metadata.

        Raises:
            InputError: another program has changed the samples since they were written.
        """
        picture = ImageWithMetadata(file, samples, self.said[file], changed=not self.said[file].fits(samples))
        if picture.changed:
            raise InputError(f"{unknown(picture)}: write all views again, without descriptions")
        return picture

    def light(self, file: Path, samples: NDArray[Any]) -> NDArray[np.float32]:
        """Linear, upright light of a picture's samples; errors as in `picture`."""
        light = light_of(self.picture(file, samples))
        return light if self.said[file].upright else light[::-1, ::-1]
