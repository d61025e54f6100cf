"""Threads let go of their work when somebody interrupts."""

import subprocess
import sys
import threading

import pytest

from vcc.base.workers import Workers


def test_an_interrupt_does_not_wait_for_what_is_at_work_and_begins_nothing_more() -> None:
    begun, release, done = threading.Event(), threading.Event(), []

    def piece(number: int) -> None:
        begun.set()
        release.wait(60)
        done.append(number)

    with pytest.raises(KeyboardInterrupt), Workers(1) as pool:  # noqa: PT012
        for number in range(3):
            pool.submit(piece, number)
        begun.wait(60)
        raise KeyboardInterrupt
    assert not done
    assert pool.ended[0]
    release.set()
    pool.shutdown()
    assert done == [0]


def test_after_a_fault_what_is_at_work_is_done_and_the_rest_is_not() -> None:
    begun, release, done = threading.Event(), threading.Event(), []

    def piece(number: int) -> None:
        begun.set()
        release.wait(60)
        done.append(number)

    with pytest.raises(ValueError, match="fault"), Workers(1) as pool:  # noqa: PT012
        for number in range(3):
            pool.submit(piece, number)
        begun.wait(60)
        threading.Timer(0.05, release.set).start()
        raise ValueError("fault")
    assert done == [0]
    assert pool.ended[0]


def test_without_either_all_is_done() -> None:
    with Workers(2) as pool:
        assert list(pool.map(abs, [-1, -2, -3])) == [1, 2, 3]
    assert not pool.ended[0]


ENDING = """
import threading, time
from concurrent.futures import ThreadPoolExecutor
from vcc.base.workers import program_ends
assert not program_ends()
def wait():
    while not program_ends():
        time.sleep(0.01)
    print("told", flush=True)
ThreadPoolExecutor(1).submit(wait)
"""


def test_a_thread_is_told_that_the_program_ends() -> None:
    """Python waits for what pools have at work, while its main thread is alive, and takes nothing new."""
    done = subprocess.run([sys.executable, "-c", ENDING], capture_output=True, text=True, check=True)
    assert done.stdout == "told\n"
