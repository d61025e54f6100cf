"""A browser, a bench that it shows and a page of it, for the tests that drive the bench in a browser."""

import pytest

from tests.bench.browser import Page, Served, chromium


@pytest.fixture(scope="module")
def browser():
    with chromium() as running:
        yield running


@pytest.fixture(scope="module")
def served(browser):  # no server where there is no browser
    bench = Served()
    bench.start()
    yield bench
    bench.stop()


@pytest.fixture
def page(browser, served):
    opened = Page(browser, served.address)
    yield opened
    opened.close()
