"""Settings shared by all tests."""

import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

# The same examples on every run, and no time limit for any of them: these machines can be slow.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


@pytest.fixture(autouse=True)
def _figures_closed() -> Iterator[None]:
    """Close the figures of a test: once anything has loaded pyplot (demosaicing does), it keeps them all."""
    yield
    if pyplot := sys.modules.get("matplotlib.pyplot"):
        pyplot.close("all")
