"""Zips of the Stanford viewer, written here: views in their places, whatever the order of the list."""

import zipfile
from pathlib import Path

import imagecodecs
import numpy as np
import pytest

from vcc.base.errors import InputError
from vcc.formats import viewer_zip


@pytest.fixture(scope="module")
def small():
    return np.random.default_rng(1).integers(0, 256, (3, 4, 8, 10, 3), np.uint8)


def png(samples):
    return imagecodecs.png_encode(np.ascontiguousarray(samples))


def listed(entries):
    lines = [f'<subaperture src="{source}" u="{u}" v="{v}" />' for source, u, v in entries]
    return '<?xml version="1.0"?>\n<lightfield>\n' + "\n".join(lines) + "\n</lightfield>\n"


def entries_of(views, *, jitter=0.0):
    """(file, u, v) of each view in no order, and its picture: rows 20 apart, columns 15."""
    rng = np.random.default_rng(1)
    found = []
    for j, i in np.ndindex(views.shape[:2]):
        u, v = np.array([i * 15 - 700, j * 20 + 33]) + rng.uniform(-jitter, jitter, 2)
        found.append((f"ansicht ä {j * 4 + i}.png", u, v, png(views[j, i])))
    return [found[n] for n in rng.permutation(len(found))]


def zipped(path, entries, *, text=None, below="", more=()):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(f"{below}views.xml", text or listed([entry[:3] for entry in entries]))
        for source, _, _, picture in entries:
            archive.writestr(below + source, picture)
        for name, data in more:
            archive.writestr(name, data)
    return path


@pytest.mark.parametrize("below", ["", "my views/"])
def test_a_zip(tmp_path, small, below):
    calls = []
    path = zipped(tmp_path / "a.zip", entries_of(small, jitter=1.0), below=below)
    assert viewer_zip.recognised(path)
    back = viewer_zip.read(path, progress=lambda *n: calls.append(n))
    assert np.array_equal(back.values, small)
    assert back.transfer == "srgb"
    # Jitter of ±1 moves the mean step over three rows, four columns by less than 1.
    assert back.geometry.spacing == pytest.approx((20e-3, 15e-3), abs=1e-3)
    assert back.geometry.spacing_unit == "mm"  # a unit that nobody stated
    assert back.geometry.directions == (1, 1)
    assert calls[-1] == (12, 12)


def test_a_list_beside_its_pictures(tmp_path, small):
    entries = entries_of(small)
    for source, _, _, picture in entries:
        (tmp_path / source).write_bytes(picture)
    path = tmp_path / "list.xml"
    path.write_text(listed([entry[:3] for entry in entries]), encoding="utf-8")
    (tmp_path / "other.xml").write_text("<notes/>")
    (tmp_path / "broken.xml").write_text("<")
    for given in (tmp_path, path):
        assert viewer_zip.recognised(given)
        back = viewer_zip.read(given)
        assert np.array_equal(back.values, small)
        assert back.geometry.spacing == pytest.approx((20e-3, 15e-3), rel=1e-12)
    assert not viewer_zip.recognised(tmp_path / "other.xml")
    (tmp_path / "second.xml").write_text(path.read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(InputError, match=r"2 lists \(list\.xml, second\.xml\)"):
        viewer_zip.read(tmp_path)


def test_depth_and_what_file_managers_add_are_left_alone(tmp_path, small):
    more = [("depth.png", png(small[0, 0])), ("__MACOSX/._views.xml", b"\0"), (".views.xml", b"")]
    back = viewer_zip.read(zipped(tmp_path / "a.zip", entries_of(small), more=more))
    assert np.array_equal(back.values, small)
    assert back.notices == ("its depth.png is not read: what its numbers mean is not documented",)


def test_a_line_and_a_single_view(tmp_path, small):
    line = [(f"{i}.png", 5 * i, 0, png(small[0, i])) for i in range(4)]
    back = viewer_zip.read(zipped(tmp_path / "a.zip", line))
    assert np.array_equal(back.values, small[:1])
    assert back.geometry.spacing == pytest.approx((5e-3, 5e-3))
    back = viewer_zip.read(zipped(tmp_path / "a.zip", line[:1]))
    assert (back.values.shape[:2], back.geometry.spacing) == ((1, 1), None)


def refused(path):
    with pytest.raises(InputError) as caught:
        viewer_zip.read(path)
    assert Path(path).name in str(caught.value)
    return str(caught.value)


def one_changed(entries, **change):
    """The entries with another fourth one."""
    source, u, v, picture = entries[3]
    entry = {"source": source, "u": u, "v": v, "picture": picture} | change
    return [*entries[:3], tuple(entry.values()), *entries[4:]]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda given: given[:7] + given[8:], "11 of the 12 views of its 3×4 grid"),
        (lambda given: [*given[:-1], (given[-1][0], *given[0][1:3], given[-1][3])], "two files for the view"),
        (lambda given: one_changed(given, u=given[3][1] + 6), "no regular grid along u"),
        (
            lambda given: one_changed(given, picture=png(np.zeros((4, 10, 3), np.uint8))),
            "All views have the same size",
        ),
        (
            lambda given: one_changed(given, picture=given[3][3][:-20]),
            "a.zip: {source} cannot be read as a picture",
        ),
    ],
)
def test_views_that_make_no_grid_are_refused(tmp_path, small, change, words):
    entries = entries_of(small)
    assert words.format(source=entries[3][0]) in refused(zipped(tmp_path / "a.zip", change(entries)))


def renamed(name):
    return lambda given: listed([*(entry[:3] for entry in given[:-1]), (name, *given[-1][1:3])])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (renamed("lost.png"), '"lost.png", and holds no such picture'),
        (renamed("../lost.png"), "not beside the list"),
        (lambda given: listed([("a.png", "left", 0)]), "u and v being numbers"),
        (lambda given: listed([("a.png", "nan", 0)]), "u and v being numbers"),
        (lambda given: "<lightfield/>", "lists no views"),
        (lambda given: "<views/>", "begins with <views>"),
        (lambda given: "<lightfield>", "is not XML"),
    ],
)
def test_lists_that_cannot_be_understood_are_refused(tmp_path, small, text, words):
    entries = entries_of(small)
    assert words in refused(zipped(tmp_path / "a.zip", entries, text=text(entries)))


def test_a_zip_without_a_list_is_refused(tmp_path):
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.txt", "")
    assert "holds no list of views" in refused(path)


def test_damaged_zips_are_refused(tmp_path, small):
    path = zipped(tmp_path / "a.zip", entries_of(small))
    whole = path.read_bytes()
    place = whole.index(b"PNG") - 4
    for data in (b"", b"nonsense", whole[: len(whole) // 2], whole[:place] + bytes(60) + whole[place + 60 :]):
        path.write_bytes(data)
        refused(path)
