"""What a tick may do, and how it tells what it left out."""

from __future__ import annotations

from service.estimator import Cause, Course, Level


def test_goes_on_until_it_would_overrun_but_takes_the_first() -> None:
    course = Course(overrunning=lambda: True)
    course.offered = 3
    assert course.goes_on()
    assert not course.goes_on()
    assert not course.goes_on()
    assert (course.weighed, course.cut) == (1, True)
    assert course.reached(100, 100) is Level.THINNED
    assert course.reason(100, 100) == "cut after 1 of 3 measurements"


def test_a_new_tick_forgets_the_one_before() -> None:
    course = Course(overrunning=lambda: True)
    course.goes_on(), course.goes_on()
    course.set(Level.FULL, Cause.NONE, 5)
    assert course.goes_on()
    assert (course.weighed, course.cut, course.offered) == (1, False, 0)


def test_full_says_nothing() -> None:
    course = Course()
    assert course.reached(100, 100) is Level.FULL
    assert course.reason(100, 100) == ""


def test_every_level_says_what_was_given_up_and_for_what() -> None:
    fewer = Course(Level.FEWER_PARTICLES, Cause.PROCESSOR)
    assert fewer.reason(4200, 1500) == "4200 particles needed, 1500 afforded: others use the processor"
    thinned = Course(Level.THINNED, Cause.BUDGET, 4)
    thinned.offered, thinned.weighed = 10, 4
    assert thinned.reason(100, 50) == "100 particles needed, 50 afforded, thinned to 4 of 10 measurements"
    quiet = Course(Level.NO_CLOUD, Cause.BUDGET, 4)
    assert quiet.reason(100, 100) == "no cloud"
    blind = Course(Level.PREDICTION_ONLY, Cause.BUDGET, 0)
    blind.offered, blind.rested = 7, 9
    assert blind.reason(100, 100) == "only predicted, 7 measurements dropped, 9 ticks rested"
    assert blind.reached(100, 0) is Level.PREDICTION_ONLY
