"""How a light field that is not in memory is cut: into the largest blocks that a memory limit holds.

Oracles: the bytes of a block counted here, at limits that it fills to the last byte and at one byte less; what is
to be covered, view by view.
"""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import vcc
from vcc.base.units import mm
from vcc.fields.grid import Grid, camera_array_frame
from vcc.run.blocks import Blocks, Need, cut, cut_evenly
from vcc.shapes.patterns import CosineSum

pytestmark = pytest.mark.filterwarnings("ignore::vcc.errors.ResultWarning")

FOCUS = 1 / (1 / 50e-3 - 1)
NEED = Need(fixed=1000, view=240.0, times=2.0, border=3, raster=10, by_rays=False)
"""Of views of 12 rows of pixels, 20 bytes each."""
VIEWS, PIXELS = (7, 9), (12, 5)


def grid(shape: tuple[int, ...] = (*VIEWS, *PIXELS)) -> Grid:
    return Grid(shape, camera_array_frame(shape, 2 * mm, 2e-3, 1.0), np.dtype("float32"))


def used() -> np.ndarray:
    """Views of which those in two corners of a rectangle of 5×7 are looked at."""
    found = np.zeros(VIEWS, bool)
    found[1, 2] = found[5, 8] = True
    return found


RECTANGLES = [(1, columns) for columns in range(1, 8)] + [(rows, 7) for rows in range(2, 6)]
"""Rows and columns of views in a block, from the least: first a part of a row, then some rows."""


def taken(need: Need, rows: int, columns: int, border: int) -> float:
    """Bytes that a block of views takes with the dark ones around it, beside what is always there."""
    reading = 3 * need.view * need.readers
    return need.fixed + reading + need.times * need.view * (rows + border) * (columns + border)


@pytest.mark.parametrize("need", [NEED, replace(NEED, border=0, readers=4), replace(NEED, times=1.0, border=1)])
def test_blocks_are_the_largest_that_a_limit_holds(need):
    """As many rows of views as fit, at least one; else as many columns. All at once have no neighbours."""
    sizes = [taken(need, *each, need.border) for each in RECTANGLES]
    whole = taken(need, 5, 7, 0)
    for limit in [each - less for each in (*sizes[1:], whole, whole + 1000) for less in (0, 1)]:
        fitting = [each for each, size in zip(RECTANGLES, sizes, strict=True) if size <= limit]
        made = cut(used(), grid(), need, limit)
        assert (made.rows_each, made.columns_each) == ((5, 7) if limit >= whole else fitting[-1])
        assert made.pixel_rows_each == 12
        assert (made.rows, made.columns) == ((1, 6), (2, 9))
        assert (made.pixel_rows, made.pixel_columns) == (12, 5)
    made = cut(used(), grid(), need, sizes[0])
    assert (made.rows_each, made.columns_each, made.pixel_rows_each) == (1, 1, 12)


@pytest.mark.parametrize("need", [NEED, replace(NEED, times=4.0, border=2)])
def test_rows_of_pixels_of_a_view_where_no_view_fits(need):
    """Each is read, three times itself, and is there with its border of dark views."""
    row = need.view / 12 * (3 + need.times * (1 + need.border) ** 2)
    for rows in (1, 2, 5):
        limit = need.fixed + rows * row
        made = cut(used(), grid(), need, limit)
        assert (made.rows_each, made.columns_each, made.pixel_rows_each) == (1, 1, rows)
        if rows > 1:
            assert cut(used(), grid(), need, limit - 1).pixel_rows_each == rows - 1
    limit = need.fixed + row - 1
    with pytest.raises(vcc.InputError, match=f"memory_limit={math.ceil(limit)} bytes is too little"):
        cut(used(), grid(), need, limit)
    with pytest.raises(vcc.InputError, match="memory_limit=500 bytes"):
        cut(used(), grid(), need, 500)


@pytest.mark.parametrize("sizes", [(5, 7, 12), (2, 7, 12), (1, 3, 12), (1, 1, 5), (5, 7, 5)])
def test_blocks_cover_all_once_and_are_about_as_large(sizes):
    made = Blocks((1, 6), (2, 9), *PIXELS, *sizes)
    blocks, counted = list(made), np.zeros((*VIEWS, *PIXELS), int)
    for block in blocks:
        counted[block.slices] += 1
    expected = np.zeros_like(counted)
    expected[1:6, 2:9] = 1
    np.testing.assert_array_equal(counted, expected)
    numbers = [math.ceil(n / each) for n, each in zip((5, 7, 12), sizes, strict=True)]
    assert len(blocks) == math.prod(numbers)
    for axis, (n, number, each) in enumerate(zip((5, 7, 12), numbers, sizes, strict=True)):
        lengths = {block.shape[axis] for block in blocks}
        assert lengths <= {n // number, -(-n // number)}
        assert max(lengths) <= each
    # In the order in which they are stored.
    firsts = [tuple(first for first, _ in block.ranges) for block in blocks]
    assert firsts == sorted(firsts)


def test_what_blocks_are_in_words():
    assert Blocks.one(grid()).words == "one block of 7×9 views"
    assert Blocks.by_column(grid()).words == "9 blocks of up to 7×1 views"
    assert Blocks((1, 6), (2, 9), *PIXELS, 1, 1, 5).words == "105 blocks of 5 rows of pixels of a view"
    assert Blocks((1, 6), (2, 9), *PIXELS, 5, 7, 5).words == "3 blocks of up to 5 rows of pixels of all views"
    assert Blocks((1, 2), (2, 9), *PIXELS, 1, 7, 5).words == "3 blocks of up to 5 rows of pixels of all views"
    assert [block.ranges for block in Blocks.one(grid())] == [((0, 7), (0, 9), (0, 12), (0, 5))]
    columns = [block.ranges for block in Blocks.by_column(grid())]
    assert columns == [((0, 7), (n, n + 1), (0, 12), (0, 5)) for n in range(9)]


# --- what a block takes ---


def plan_of(given: vcc.LightField, elements: list, **options):
    lens = vcc.Lens(focal_length=50 * mm, diameter=7 * mm)
    return vcc.Camera([lens, *elements], vcc.Sensor(FOCUS, (12, 14), FOCUS * 3e-3)).compile(given, **options)


def test_bytes_that_plans_take_counted():
    """In double precision three sums and a block's raster; by rays each of two halves, and one in single."""
    values = np.random.default_rng(0).random((3, 4, 10, 11, 3)).astype(np.float16)
    given = vcc.LightField.from_views(values, 2 * mm, 2e-3, 1.0, disparity_range=(-0.3, 0.2))
    footprints = plan_of(given, [vcc.Mask(pattern=CosineSum((0.5 * mm, 0.6 * mm)), z=0.96 * FOCUS)], refine=1)
    pixels = math.prod(footprints.core.raster_shape) * 3
    need = Need.of(footprints, given.grid, 12345, False)
    assert need.fixed == 4 * 8 * pixels + 12345
    assert need.raster == 8 * pixels
    assert need.view == math.prod(footprints.shape(given.shape)[2:]) * 4  # half precision is kept in single
    assert (need.times, need.by_rays) == (1, False)
    assert Need.of(footprints, given.grid, 0, True).times == 1 + 16 / 4
    grey = Need.of(footprints, given.replaced(values[..., 0]).grid, 0, False)
    assert (grey.raster, grey.view) == (need.raster / 3, need.view / 3)
    # By rays views have a border of one where they are interpolated between, on both sides.
    by_rays = plan_of(given, [], method="rays", samples=4)
    need = Need.of(by_rays, given.grid, 7, False)
    pixels = 12 * 14 * 3
    assert by_rays.core.border == 1
    assert need.fixed == (4 * 16 + 4) * pixels + 7
    assert (need.raster, need.border, need.by_rays) == (16 * pixels, 2, True)


@pytest.mark.parametrize(("border", "beside", "dark"), [(1, ((1, 2), (2, 2)), 6), (0, ((3, 2), (1, 2)), 5)])
def test_dark_views_around_a_block_count_on_both_sides(border, beside, dark):
    plan = SimpleNamespace(
        core=SimpleNamespace(raster_shape=(4, 5), border=border), halo=(*beside, (8, 9), (8, 9)), by_rays=False,
        kept_as=lambda kind: (kind, 1.0), shape=lambda shape: shape,
    )  # fmt: skip
    assert Need.of(plan, grid(), 0, False).border == dark


def test_more_is_kept_by_those_that_add_and_by_those_that_read():
    assert NEED.with_sums().fixed == 1000 + 8 * 10  # eight results are added at a time
    assert NEED.reading == 3 * 240
    assert replace(NEED, readers=5).reading == 15 * 240
    # An eighth of the memory for readers, of which each has a view three times.
    for limit, readers in ((8 * 720 * 4, 4), (8 * 720 * 4 - 1, 3), (8 * 720, 1), (0, 1), (1e12, 6)):
        assert NEED.with_readers(6, limit).readers == readers
    assert NEED.least_for_views == 1000 + 8 * 240
    assert replace(NEED, view=240.1).least_for_views == 1000 + 1921


# --- blocks to work on ---

LARGE = (16, 16, 100, 5)
"""Shape of a grid whose views are large."""


def large(view: float = 2.0**24, **changes) -> Need:
    return replace(NEED, border=0, view=view, times=1.0, **changes)


def test_by_footprints_there_are_blocks_for_many():
    """A 64th of all views each, where that is 16 MiB at least and eight rasters; no less than a view."""
    every = np.ones(LARGE[:2], bool)

    def sizes(need: Need, limit: float = 1e15) -> tuple[int, int, int]:
        made = cut_evenly(every, grid(LARGE), need, limit)
        return made.rows_each, made.columns_each, made.pixel_rows_each

    assert sizes(large()) == (1, 4, 100)  # 256 views / 64
    assert sizes(replace(large(), times=3.0)) == (1, 4, 100)
    assert sizes(large(2.0**22)) == (1, 4, 100)
    assert sizes(large(2.0**21)) == (1, 8, 100)  # 16 MiB
    assert sizes(large(2.0**18)) == (4, 16, 100)
    assert sizes(large(2.0**18, raster=2**24)) == (16, 16, 100)  # little beside 128 MiB
    assert sizes(large(2.0**19, raster=2**22)) == (4, 16, 100)
    assert sizes(large(), 1000 + 3 * 2**24 + 2 * 2**24) == (1, 2, 100)  # what fits the memory
    some = np.zeros(LARGE[:2], bool)
    some[::2, ::3] = some[-1, -1] = True  # 49 views, of which a 64th is less than one
    made = cut_evenly(some, grid(LARGE), large(), 1e15)
    assert (made.rows_each, made.columns_each, made.pixel_rows_each) == (1, 1, 100)


def test_by_rays_blocks_are_bands_of_rows_of_pixels_where_few_rays_look_at_each():
    every = np.ones(LARGE[:2], bool)
    total = 256 * 2.0**24
    for rows, bands in ((50, 2), (34, 3), (20, 5), (99, 2), (1, 100)):
        need = large(by_rays=True, bands=bands)
        limit = 1000 + 3 * 2.0**24 + total * (rows + 0.5) / 100
        made = cut_evenly(every, grid(LARGE), need, limit)
        assert (made.rows_each, made.columns_each, made.pixel_rows_each) == (16, 16, rows)
        assert [made.rows, made.columns, made.pixel_rows, made.pixel_columns] == [(0, 16), (0, 16), 100, 5]
        # One band fewer: views as a whole, as many as there is memory for.
        whole = cut_evenly(every, grid(LARGE), replace(need, bands=bands - 1), limit)
        assert whole.pixel_rows_each == 100
        if rows > 6:
            assert (whole.rows_each, whole.columns_each) == (int(16 * (rows + 0.5) / 100), 16)
        twice = 1000 + 3 * 2.0**24 + 2 * total * (rows + 0.5) / 100
        assert cut_evenly(every, grid(LARGE), replace(need, times=2.0), twice).pixel_rows_each == rows
    # All at once where it fits; by rows of pixels of a view where there is not even room to read one.
    need = large(by_rays=True, bands=100)
    assert len(list(cut_evenly(every, grid(LARGE), need, 1000 + 3 * 2.0**24 + total))) == 1
    assert cut_evenly(every, grid(LARGE), need, 1000 + 3 * 2.0**24 + total / 101).pixel_rows_each == 100
    small = cut_evenly(every, grid(LARGE), need, 1000 + 1.01 * 2.0**24)
    assert (small.rows_each, small.columns_each, small.pixel_rows_each) == (1, 1, 25)
    part = np.zeros(LARGE[:2], bool)
    part[3, 5] = part[6, 12] = True
    found = list(cut_evenly(part, grid(LARGE), need, 1000 + 3 * 2.0**24 + 32 * 2.0**24 * 0.505))
    assert [block.ranges for block in found] == [((3, 7), (5, 13), rows, (0, 5)) for rows in ((0, 50), (50, 100))]
