"""What the pictures of a folder of views say of their numbers, and light made of these."""

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
    """What pictures say of their numbers, all of them alike.

    Args:
        said: by file; empty where no picture says anything.
        transfer: how their numbers stand for light; None where nothing is said.
    """

    said: dict[Path, ImageMetadata]
    transfer: Literal["srgb", "linear"] | None

    @classmethod
    def of(cls, files: Iterable[Path]) -> ViewsWithMetadata:
        """What these pictures say; their numbers are not read.

        Raises:
            InputError: some say otherwise than others, where that makes a difference; raw numbers of a sensor; or
                a damaged statement.
        """
        every = {file: metadata_of(file) for file in files}
        said = {file: each for file, each in every.items() if each is not None}
        silent = [file for file, each in every.items() if each is None]
        for file, each in said.items():
            if each.recording is not None:
                raise InputError(
                    f"{file} says that it holds {each.in_words}: a raw recording is no view, decode it"
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
                    f"{file.name} says that its numbers are {each.in_words}, and {silent[0].name} does not say "
                    "what its are: it is not of the same make. Write all views anew"
                )
        return cls(said, said[first].transfer)

    @property
    def is_neutral(self) -> bool:
        """Whether the numbers are upright and not exposed, so that they can be kept as they are."""
        return all(each.is_neutral for each in self.said.values())

    @property
    def is_usual(self) -> bool:
        """Whether nothing is said that would not be assumed of pictures that say nothing."""
        return self.transfer in (None, "srgb") and self.is_neutral

    @property
    def in_words(self) -> str:
        """For people, in a few words; empty where nothing is said."""
        differ = len({each.exposure for each in self.said.values()}) > 1
        first = next(iter(self.said.values()), None)
        return "" if first is None else first.in_words + (" and others" if differ else "")

    def check(self, told: str) -> None:
        """Refuse a transfer function that the files contradict.

        Raises:
            InputError: it is "srgb" or "linear", and the files say the other.
        """
        for file, each in self.said.items():
            check_agrees(file, each, told)
            return

    def picture(self, file: Path, samples: NDArray[Any]) -> ImageWithMetadata:
        """A picture's numbers with what it says of them.

        Raises:
            InputError: another program has changed them since they were written.
        """
        picture = ImageWithMetadata(file, samples, self.said[file], changed=not self.said[file].fits(samples))
        if picture.changed:
            raise InputError(f"{unknown(picture)}: write all views anew, without descriptions")
        return picture

    def light(self, file: Path, samples: NDArray[Any]) -> NDArray[np.float32]:
        """Light, linear and upright, of a picture's numbers; errors as in `picture`."""
        light = light_of(self.picture(file, samples))
        return light if self.said[file].upright else light[::-1, ::-1]
