"""Contact sheets: each picture stands where its labels say, upright, at one exposure."""

from __future__ import annotations

import numpy as np
import pytest

import vcc
from vcc.files.transfer import encode
from vcc.sweeps import Sweep, contact_sheet
from vcc.sweeps.values import Varied


def swept(shape=(2, 3), done=True):
    """Pictures of one value each, brightest in the last, with a black corner as light lands on the sensor."""
    count = int(np.prod(shape))
    pictures = np.broadcast_to(
        np.arange(1, count + 1, dtype=np.float32).reshape(*shape, 1, 1), (*shape, 8, 10)
    ).copy()
    pictures[..., 0, 0] = 0
    axes = tuple(Varied(f"part.{n}", tuple(range(n)), tuple(f"{i} of {n}" for i in range(n))) for n in shape)
    told = {name: np.zeros(shape) for name in ("mean", "missing_rays", "sampling_error")}
    names = tuple(each.name for each in axes)
    return Sweep(names, axes, told, pictures, np.eye(3), np.full(shape, done))


def shown(axes):
    return np.asarray(axes.images[0].get_array())


def test_rows_and_columns_stand_where_their_labels_say():
    figure = contact_sheet(swept())
    axes = np.array(figure.axes).reshape(2, 3)
    assert [each.get_title() for each in axes[0]] == ["0 of 3", "1 of 3", "2 of 3"]
    assert [each.get_ylabel() for each in axes[:, 0]] == ["0 of 2", "1 of 2"]
    for n, each in enumerate(axes.ravel()):
        assert shown(each)[0, 0] == encode(np.float32([(n + 1) / 6]), 8)[0]  # the brightest is white
        assert shown(each)[-1, -1] == 0  # turned upright
    assert "part.3 →, part.2 ↓" in figure.get_suptitle()


def test_one_axis_goes_on_in_the_next_row_and_of_many_some_are_shown():
    figure = contact_sheet(swept((8,)))
    assert [each.get_title() for each in figure.axes if each.images] == [f"{n} of 8" for n in range(8)]
    figure = contact_sheet(swept((3, 20)))
    titles = [each.get_title() for each in figure.axes[:8]]
    assert (titles[0], titles[-1], len(figure.axes)) == ("0 of 20", "19 of 20", 24)
    assert "24 of 60 pictures" in figure.get_suptitle()


def test_what_is_not_there_is_left_out():
    half = swept()
    half.done[1] = False
    assert [bool(each.images) for each in contact_sheet(half).axes] == [True] * 3 + [False] * 3
    with pytest.raises(vcc.InputError, match="none of this sweep's pictures is done"):
        contact_sheet(swept(done=False))


def test_a_notebook_shows_the_sheet_and_the_table():
    html = swept()._repr_html_()
    assert html.count("<img") == 1
    assert "2×3 cameras" in html
    assert "2 of 3" in html
    assert swept((2, 20))._repr_html_().count("<tr") == 13
    assert "28 more rows" in swept((2, 20))._repr_html_()
