"""Light fields for the Stanford archive's viewer: a ``.zip`` of pictures and an XML list of their positions.

::

    <lightfield>
      <subaperture src="view_1.jpg" u="123.4" v="567.8" />
      …
    </lightfield>

Source: http://lightfield.stanford.edu/aperture.html. A folder with such a list next to its pictures, and the
    list itself, are supported too. The positions have no unit and may jitter: each view is assigned to the
    nearest place of a regular grid.
"""

from __future__ import annotations

import math
import tempfile
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from vcc.base.errors import InputError
from vcc.base.progress import Progress, tell
from vcc.base.reading import most_unpacked, read_bytes
from vcc.base.units import mm
from vcc.files.images_with_metadata import check_usual
from vcc.files.pictures import read_picture
from vcc.formats.grid import Decoded, Geometry, Place, arrange

ENDINGS = (".zip", ".xml")

_LARGEST_JITTER = 0.25  # of a step of the grid: with more jitter, a view has no place
_SAME_STEP = 0.3  # of the largest gap: views closer than this belong to one row
_DEPTH = "depth.png"


def recognised(path: Path) -> bool:
    """Whether the path is a ``.zip``, or a list of views or a folder with one, by its root element."""
    if path.is_dir():
        return bool(_lists_in(path))
    if not path.is_file():
        return False
    return path.suffix.lower() == ".zip" or (path.suffix.lower() == ".xml" and _is_list(path))


def read(path: Path, *, progress: Progress | None = None) -> Decoded:
    """Read the light field described by a viewer's list.

    Args:
        path: the ``.zip``, the ``.xml`` or the folder.
        progress: called as progress(done, total) after each picture.

    Returns:
        Samples as stored; rows and columns of views in ascending order of v and u.

    Raises:
        InputError: a damaged zip, no list or several, invalid XML, a picture that is missing or damaged,
            pictures that differ, positions that are not on a regular grid, missing views or two for one place.
    """
    path = Path(path)
    with _opened(path) as store:
        listed = _listed(store)
        rows, down = _grid([place[2] for place in listed], "v", path)
        columns, right = _grid([place[1] for place in listed], "u", path)
        places = [
            Place(row, column, Path(name[0])) for row, column, name in zip(rows, columns, listed, strict=True)
        ]
        files = arrange(places, path, (range(max(rows) + 1), range(max(columns) + 1)))
        values = _pictures(store, files, progress)
        has_depth = any(PurePosixPath(name).name == _DEPTH for name in store.names())
    spacing = None
    if down or right:
        spacing = ((down or right) * mm, (right or down) * mm)
    remark = f"its {_DEPTH} is not read: what its numbers mean is not documented"
    return Decoded(
        format="Stanford viewer",
        values=values,
        transfer="linear" if values.dtype.kind == "f" else "srgb",
        geometry=Geometry(spacing=spacing, spacing_unit="mm" if spacing else "", directions=(1, 1)),
        notices=(remark,) if has_depth else (),
    )


class _Folder:
    def __init__(self, path: Path) -> None:
        self.path = path
        self._root = path if path.is_dir() else path.parent

    def names(self) -> list[str]:
        return [file.name for file in self._root.iterdir()]

    def list_text(self) -> tuple[str, bytes]:
        lists = _lists_in(self.path) if self.path.is_dir() else [self.path]
        _check_one([file.name for file in lists], self.path)
        return lists[0].name, read_bytes(lists[0], "list of views")

    def picture(self, name: str) -> NDArray[Any]:
        file = self._root / _inside(name, self.path)
        check_usual(file)
        return read_picture(file)[0]


class _Zip:
    def __init__(self, path: Path, archive: zipfile.ZipFile, room: Path) -> None:
        self.path, self._archive, self._room = path, archive, room

    def names(self) -> list[str]:
        return self._archive.namelist()

    def list_text(self) -> tuple[str, bytes]:
        lists = [name for name in self.names() if name.lower().endswith(".xml") and not _is_hidden(name)]
        _check_one(lists, self.path)
        self._root = PurePosixPath(lists[0]).parent
        return lists[0], self._bytes(lists[0])

    def picture(self, name: str) -> NDArray[Any]:
        member = str(self._root / _inside(name, self.path))
        if member not in self.names():
            raise InputError(
                f'{self.path} lists "{name}", and holds no such picture. Copy it again or correct the list'
            )
        unpacked = self._room / f"view{PurePosixPath(member).suffix}"
        unpacked.write_bytes(self._bytes(member))
        try:
            check_usual(unpacked)
            return read_picture(unpacked)[0]
        except InputError as error:
            raise InputError(str(error).replace(str(unpacked), f"{self.path}: {member}")) from None

    def _bytes(self, member: str) -> bytes:
        found = self._archive.getinfo(member)
        most = most_unpacked(found.compress_size)
        if found.file_size > most:
            raise InputError(
                f"{self.path}: {member} unpacks to {found.file_size / 1e6:,.0f} MB from "
                f"{found.compress_size / 1e6:.3g} MB, and no list or picture is packed so well. If it is sound, "
                "unpack the archive and open its folder"
            )
        try:
            return self._archive.read(member)
        except (zipfile.BadZipFile, zlib.error, OSError, EOFError, RuntimeError, ValueError) as error:
            raise InputError(
                f"{self.path}: {member} is damaged or cannot be unpacked ({error}). Copy it again from where it "
                "came from"
            ) from None


_Store = _Folder | _Zip
"""Access to the list (its name and its bytes) and to the pictures."""


@contextmanager
def _opened(path: Path) -> Iterator[_Store]:
    if path.is_dir() or path.suffix.lower() == ".xml":
        yield _Folder(path)
        return
    try:
        archive = zipfile.ZipFile(path)
    except (zipfile.BadZipFile, OSError) as error:
        raise InputError(
            f"{path} is truncated or no zip file ({error}). Copy it again from where it came from"
        ) from None
    with archive, tempfile.TemporaryDirectory() as room:
        yield _Zip(path, archive, Path(room))


def _is_hidden(name: str) -> bool:
    """Whether this is a file that file managers add (__MACOSX/…, .name)."""
    return any(part.startswith((".", "__MACOSX")) for part in PurePosixPath(name).parts)


def _lists_in(folder: Path) -> list[Path]:
    return [file for file in sorted(folder.glob("*.xml")) if not _is_hidden(file.name) and _is_list(file)]


def _is_list(file: Path) -> bool:
    """Whether the root element of an XML file is that of a list."""
    try:
        if not file.is_file():
            return False
        with file.open("rb") as text:
            for _, element in ElementTree.iterparse(text, events=("start",)):
                return bool(element.tag == "lightfield")
    except (ElementTree.ParseError, OSError, ValueError):
        pass
    return False


def _check_one(lists: list[str], path: Path) -> None:
    if not lists:
        raise InputError(
            f"{path} holds no list of views: an .xml file with <lightfield><subaperture src= u= v=/>… in it"
        )
    if len(lists) > 1:
        raise InputError(f"{path} holds {len(lists)} lists ({', '.join(lists)}): leave one")


def _inside(name: str, path: Path) -> PurePosixPath:
    """Check that the path of a picture is next to the list or below it."""
    place = PurePosixPath(name.replace("\\", "/"))
    if "://" in name or place.is_absolute() or ".." in place.parts:
        raise InputError(f'{path} lists "{name}", which is not beside the list. Put it there and correct the list')
    return place


def _listed(store: _Store) -> list[tuple[str, float, float]]:
    """(picture, u, v) of each view."""
    name, text = store.list_text()
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"{store.path}: {name} is not XML: {error}") from None
    if root.tag != "lightfield":
        raise InputError(f"{store.path}: {name} begins with <{root.tag}>, not with <lightfield>")
    listed: list[tuple[str, float, float]] = []
    for number, element in enumerate(root.iter("subaperture"), 1):
        try:
            source, u, v = element.attrib["src"], float(element.attrib["u"]), float(element.attrib["v"])
        except (KeyError, ValueError):
            source, u, v = "", math.nan, math.nan
        if not (math.isfinite(u) and math.isfinite(v)):
            raise InputError(
                f"{store.path}: view {number} of {name} is {dict(element.attrib)}; it needs src, u and v, u and v "
                "being numbers"
            )
        listed.append((source, u, v))
    if not listed:
        raise InputError(f"{store.path}: {name} lists no views")
    return listed


def _grid(positions: list[float], axis: str, path: Path) -> tuple[list[int], float]:
    """The row (or column) of each position on a regular grid, and the step of the grid (0 for a single row)."""
    at = np.array(positions)
    sorted_ = np.sort(at)
    with np.errstate(over="ignore"):
        gaps = np.diff(sorted_)
    if not np.isfinite(gaps).all():
        raise InputError(f"{path}: the views lie from {sorted_[0]:g} to {sorted_[-1]:g} along {axis}, on no grid")
    if not gaps.size or gaps.max() <= 1e-9 * max(1.0, float(np.abs(at).max())):
        return [0] * len(at), 0.0
    breaks = np.flatnonzero(gaps > _SAME_STEP * gaps.max())
    means = np.array([part.mean() for part in np.split(sorted_, breaks + 1)])
    step = float(np.diff(means).min())
    numbers = np.rint((at - means[0]) / step)
    # Refine the step with all views, then check the position of each view.
    step, first = (float(n) for n in np.polyfit(numbers, at, 1))
    off = np.abs(at - first - step * numbers).max()
    if off > _LARGEST_JITTER * step:
        raise InputError(
            f"{path}: the views lie on no regular grid along {axis}: steps of {step:.4g} leave one {off:.4g} "
            "beside its place. List them in a views.csv with row and column of each"
        )
    return [int(n) for n in numbers], step


def _pictures(
    store: _Store, files: tuple[tuple[Path | None, ...], ...], progress: Progress | None
) -> NDArray[Any]:
    """Read all views into one array, shape (v, u, t, s[, channel])."""
    names = [file.as_posix() for row in files for file in row if file is not None]
    values: NDArray[Any] | None = None
    for number, name in enumerate(names):
        row, column = divmod(number, len(files[0]))
        samples = store.picture(name)
        if values is None:
            values = np.empty((len(files), len(files[0]), *samples.shape), samples.dtype)
        elif samples.shape != values.shape[2:] or samples.dtype != values.dtype:
            raise InputError(
                f"{store.path}: {name} has {samples.dtype} samples of shape {samples.shape}, and "
                f"{names[0]} {values.dtype} samples of shape {values.shape[2:]}. All views have the same size and "
                "type"
            )
        values[row, column] = samples
        tell(progress, number + 1, len(names))
    assert values is not None
    return values
