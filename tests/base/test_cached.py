"""Properties that are computed once for each object."""

import threading

from vcc.base.cached import cached, is_computed, preset


class Thing:
    def __init__(self, compute):
        self.compute, self.times = compute, 0

    @property
    @cached
    def value(self):
        self.times += 1
        return self.compute()


def test_computed_once_for_each_object_or_preset():
    one, other = Thing(lambda: 3), Thing(lambda: 4)
    assert not is_computed(one, "value")
    assert (one.value, one.value, one.times) == (3, 3, 1)
    assert is_computed(one, "value")
    assert not is_computed(other, "value")
    preset(other, value=5)
    assert (other.value, other.times) == (5, 0)


def test_one_object_is_computed_while_another_waits_for_it():
    # As two benches that take turns do: with a lock for all objects neither would ever go on.
    done = threading.Event()
    waiting = Thing(lambda: done.wait(60))
    thread = threading.Thread(target=lambda: waiting.value)
    thread.start()
    assert Thing(lambda: done.set() or 1).value == 1
    thread.join()
    assert waiting.value is True
