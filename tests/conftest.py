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
