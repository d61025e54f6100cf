"""Settings shared by all tests."""

import ctypes
import gc
import os
import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

# Tests run side by side: libraries that start a thread for each core in each of them (OpenMP, BLAS) wait for one
# another most of the time, and busily. Read when they are loaded; workers of pytest-xdist and commands inherit it.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# Modules and collected tests, a million objects, stay to the end: garbage is among what comes after them.
gc.disable()

# What arrays leave is kept for the next ones. By default the C library of Linux gives memory of large arrays back
# and asks for it again, each time filled with zeros page by page, which took a tenth of the time of all tests.
if sys.platform == "linux" and hasattr(ctypes.CDLL(None), "mallopt"):
    M_TRIM_THRESHOLD, M_MMAP_THRESHOLD = -1, -3
    ctypes.CDLL(None).mallopt(M_MMAP_THRESHOLD, 1 << 30)
    ctypes.CDLL(None).mallopt(M_TRIM_THRESHOLD, 1 << 30)


LONGEST = (
    "tests/test_pages.py",
    "tests/test_fuzz.py",
    "tests/engines/test_cuda.py",
    "tests/run/test_cluster.py",
    "tests/bench/test_in_browser.py",
    "tests/engines/test_plans_by_engines.py",
    "tests/physics/test_random_cameras.py",
    "tests/engines/test_agreement.py",
    "tests/bench/test_viewer_in_browser.py",
    "tests/bench/test_drawing_in_browser.py",
    "tests/physics/test_diffusers_in_cameras.py",
    "tests/physics/test_plenoptic.py",
    "tests/physics/test_random_colour.py",
    "tests/cli/test_sweep_command.py",
    "tests/sweeps/test_kept.py",
    "tests/demo/test_demo.py",
    "tests/test_notebooks.py",
)
"""Files that take longest, or begin processes: the first to be handed out, so that no worker is left with one.

Pages and plans compile the same kernels: while a worker compiles those of the pages, others begin with what
compiles none, and find them in the cache.
"""


def pytest_configure(config: pytest.Config) -> None:
    """Files are handed out as they are collected, not (as pytest-xdist does) those with most tests first."""
    if getattr(config.option, "loadscopereorder", False):
        config.option.loadscopereorder = False


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the tests of the longest files first."""
    place = {name: number for number, name in enumerate(LONGEST)}
    items.sort(key=lambda item: place.get(item.nodeid.partition("::")[0], len(LONGEST)))


def pytest_collection_finish() -> None:
    """Look for garbage from now on, among what the tests make; not after every 700 objects, as is usual."""
    gc.freeze()
    gc.set_threshold(50_000)
    gc.enable()


# The same examples on every run, and no time limit for any of them: these machines can be slow.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture(autouse=True)
def _figures_closed() -> Iterator[None]:
    """Close the figures of a test: once anything has loaded pyplot (demosaicing does), it keeps them all."""
    yield
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")
