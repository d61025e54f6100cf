"""Warnings about results: collected by thread, all others passed on."""

from __future__ import annotations

import threading
import warnings
from concurrent.futures import ThreadPoolExecutor

import pytest

from vcc.base.errors import ResultWarning, warn_of_result
from vcc.base.notices import Notices


def test_each_thread_hears_its_own_and_the_first_hears_threads_without_notices():
    everyone, barrier = Notices(), threading.Barrier(2)

    def heard(name: str) -> list[str]:
        own = Notices()
        with own.gathered():
            barrier.wait()  # both contexts are open
            warn_of_result(f"of {name}")
            barrier.wait()
        return own.texts

    with everyone.gathered(), ThreadPoolExecutor(2) as pool:
        assert list(pool.map(heard, "ab")) == [["of a"], ["of b"]]
        pool.submit(warn_of_result, "of nobody").result()
        warn_of_result("of the caller")
    assert everyone.texts == ["of nobody", "of the caller"]


def test_kinds_are_counted_and_other_warnings_are_shown():
    notices = Notices()
    with warnings.catch_warnings(record=True) as shown:
        warnings.simplefilter("always")
        with notices.gathered():
            warn_of_result("1.5 % missing")
            warn_of_result("2 % missing")
            warnings.warn("something else", UserWarning, stacklevel=1)
    assert [str(each.message) for each in shown] == ["something else"]
    with pytest.warns(ResultWarning, match="^2 of 3 images, one of them: 1.5 % missing$"):
        notices.say(3, "images")
