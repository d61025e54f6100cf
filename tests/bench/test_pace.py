"""How fine an image is during a drag: the finest in time, and soon again after the machine was busy."""

import types

import pytest

from vcc.bench.pace import CLOSE, IN_TIME, LEFT, SOON, TRIALS, Pace
from vcc.bench.picture import COARSER, FULL, WHOLE

HALF, HALF_FEW, QUARTER, QUARTER_FEW = COARSER


class Machine:
    """Takes given seconds for images of a fineness, and counts the time.

    Args:
        took: seconds by fineness, when nothing else runs.

    Attributes:
        busy: what else runs makes each image take so many times as long,
        slower: and its processor time, too.
    """

    def __init__(self, took):
        self.took, self.now, self.busy, self.slower = took, 0.0, 1.0, False
        self.pace = Pace(lambda: self.now)
        for each in took:
            self.make(each)

    def make(self, fineness):
        seconds = self.busy * self.took[fineness]
        self.now += seconds
        used = seconds if self.slower else self.took[fineness]
        taken = types.SimpleNamespace(seconds=seconds, processor=used, planning=0.004, by_rays=False)
        self.pace.noted("lens", fineness, taken)

    def drag(self, seconds):
        """What is made in a drag of so long."""
        made, end = [], self.now + seconds
        while self.now < end:
            made.append(self.pace.fineness("lens"))
            self.make(made[-1])
        return made


QUICK = {WHOLE: 0.015, HALF: 0.008, HALF_FEW: 0.008, QUARTER: 0.006, QUARTER_FEW: 0.006}
SLOW = {WHOLE: 0.3, HALF: 0.015, HALF_FEW: 0.015, QUARTER: 0.008, QUARTER_FEW: 0.008}
NEVER_IN_TIME = {WHOLE: 2.0, HALF: 0.090, HALF_FEW: 0.085, QUARTER: 0.072, QUARTER_FEW: 0.070}


@pytest.mark.parametrize(("took", "finest"), [(QUICK, WHOLE), (SLOW, HALF), (NEVER_IN_TIME, HALF)])
def test_finest_in_time_or_close_to_the_quickest_is_made(took, finest):
    assert took[finest] <= max(IN_TIME, CLOSE * min(took.values()))
    assert set(Machine(took).drag(1)) == {finest}


def test_all_pixels_come_before_a_whole_image_where_they_come_much_sooner():
    for took, soon in (
        (SLOW | {FULL: 0.2}, True),
        (SLOW, True),
        ({FULL: 0.6} | SLOW, True),  # it was first, and code was loaded
        (SLOW | {FULL: 1.1 * SOON * SLOW[WHOLE]}, False),
        (QUICK, False),
    ):
        assert Machine(took).pace.is_soon("lens", FULL) is soon
    assert not Pace().is_soon("lens", FULL)  # nothing is known yet


def test_first_image_of_another_kind_is_as_coarse_as_those_before():
    machine = Machine(SLOW | {HALF: 0.1, HALF_FEW: 0.1})
    assert machine.drag(0.5)[-1] == QUARTER
    assert machine.pace.fineness("lens out of focus") == QUARTER
    assert Machine(QUICK).pace.fineness("lens out of focus") == HALF


def test_nothing_is_coarser_than_a_quarter_a_side_however_long_it_takes():
    assert max(each.pixels for each in COARSER) == 4
    assert Machine({each: 10.0 * each.share(False) for each in QUICK}).drag(20)[-1].pixels == 4


@pytest.mark.parametrize("took", [QUICK, SLOW])
@pytest.mark.parametrize("busy", [0.2, 2.0, 20.0])
def test_half_a_second_after_a_busy_time_images_are_as_fine_as_before(took, busy):
    machine = Machine(took)
    before = machine.drag(0.5)[-1]
    machine.busy = 4.0
    machine.drag(busy)
    machine.busy = 1.0
    machine.drag(0.5)
    after = machine.drag(0.5)
    assert after[0] == before
    assert after.count(before) >= len(after) - 1


def test_images_get_finer_again_also_if_the_browser_slows_all_of_them():
    machine = Machine(SLOW | {HALF: 0.014, HALF_FEW: 0.014, QUARTER: 0.0055, QUARTER_FEW: 0.0055})
    machine.took[HALF] = 0.0095  # less than when it was rehearsed: nothing is compiled any more
    machine.busy, machine.slower = 6.0, True  # two threads of one core
    machine.drag(0.2)
    machine.busy = 1.9
    machine.drag(0.5)
    assert set(machine.drag(0.5)) == {HALF}


def test_of_two_that_take_about_as_long_the_finer_is_made_whichever_a_busy_machine_delays():
    machine = Machine(NEVER_IN_TIME)
    machine.busy = 3.0
    for _ in range(5):
        machine.make(HALF)
    machine.busy = 1.0
    machine.make(QUARTER)
    assert machine.drag(1)[0] == HALF


def test_single_late_image_changes_nothing():
    machine = Machine(QUICK | {WHOLE: 0.010})
    machine.busy = 1.8
    machine.drag(0.001)
    machine.busy = 1.0
    assert set(machine.drag(0.3)) == {WHOLE}


def test_what_is_too_slow_costs_a_tenth_of_the_time_at_most():
    machine = Machine(SLOW | {WHOLE: 0.014})
    machine.took[WHOLE] = 0.040  # from now on: it was in time once, and is worth trials
    made = machine.drag(30)
    spent = made.count(WHOLE) * (0.040 - IN_TIME)
    assert 0 < spent <= TRIALS * 30
    assert 30 / made.count(WHOLE) >= LEFT


def test_delay_of_a_first_image_by_compilation_is_forgotten_when_a_finer_one_is_quicker():
    machine = Machine({HALF: 5.0})
    machine.took = QUICK
    machine.make(WHOLE)
    assert machine.pace.fineness("lens") == WHOLE
    assert machine.pace.fineness("another") == HALF
