"""What the estimator makes of hypotheses: draws, jumps, demand and words."""

from __future__ import annotations

import numpy as np
import pytest

from filters.belief import STILL
from service.estimator.hypotheses import EACH, INTERVAL, Tracker
from tests.service.estimator.images import Images, images, shift, tracked


def looks_on(tracker: Tracker, belief: Images, looks: int = 3, start: int = 100 * INTERVAL) -> None:
    """Look and publish, tick by tick."""
    for index in range(looks):
        tracker.look(start + index * INTERVAL)
        found = tracker.extract(STILL)
        tracker.spoken(found[0].mean if found else belief.moments().mean, 0.4)


def test_ambiguity_is_told_in_words_and_has_two_thresholds() -> None:
    belief = images()
    tracker = tracked(belief)
    tracker.extract(STILL)
    first, second = (round(100 * each.weight) for each in tracker.extract(STILL))
    assert tracker.ambiguity() == f"2 hypotheses, {first} % and {second} %, 14 m apart"
    shift(belief, 0.03 / (second / first))  # 3 %: above what ends it, below what begins it
    tracker.extract(STILL)
    assert tracker.ambiguity()
    shift(belief, 0.3)
    tracker.extract(STILL)
    assert not tracker.ambiguity()
    shift(belief, 4.0)
    tracker.extract(STILL)
    assert not tracker.ambiguity()


def test_headings_are_told_where_the_places_are_one() -> None:
    tracker = tracked(images(apart=0.0, heading=3.0))
    tracker.extract(STILL)
    assert tracker.ambiguity().endswith("headings 172° apart")


def test_one_place_demands_nothing_and_several_demand_enough_for_each() -> None:
    assert tracked(images(share=0.0)).demand == 0
    assert tracked(images()).demand == 2 * EACH


@pytest.mark.parametrize("odds", [0.01, 1.0, 50.0])
def test_drawing_keeps_the_shares_exactly(odds: float) -> None:
    belief = images()
    tracker = tracked(belief)
    shift(belief, odds)
    before = {each.name: each.weight for each in tracker.extract(STILL)}
    for count in (3000, 500, 6000):
        tracker.draw(count)
        assert belief.count == count
        after = {each.name: each.weight for each in tracker.extract(STILL)}
        assert after == pytest.approx(before, rel=1e-5)


def test_labels_are_laid_out_with_the_particles() -> None:
    """After drawing, the particles of a hypothesis still are where it is."""
    belief = images()
    tracker = tracked(belief)
    tracker.draw(7000)
    for each in tracker.extract(STILL):
        assert each.covariance[1, 1] < 0.3
        assert round(float(each.mean[1])) in {0, 14}


def test_another_leader_is_one_jump() -> None:
    belief = images()
    tracker = tracked(belief)
    looks_on(tracker, belief)
    jumps = tracker.jumps
    shift(belief, 100.0)
    looks_on(tracker, belief, 30, 200 * INTERVAL)
    assert tracker.jumps == jumps + 1


def test_a_division_is_a_jump_if_the_position_moves_by_it() -> None:
    """Before it the position was the mean between two places, 5.6 m from the nearer."""
    belief = images()
    tracker = Tracker(belief)
    looks_on(tracker, belief, 6)
    assert tracker.jumps == 1


def test_one_place_never_jumps_and_beginning_anew_forgets() -> None:
    belief = images(share=0.0)
    tracker = Tracker(belief)
    looks_on(tracker, belief, 20)
    assert (tracker.jumps, tracker.count, tracker.divided) == (0, 1, False)
    other = tracked(images())
    other.started(0)
    assert (other.count, other.divided, other.ambiguity()) == (1, False, "")
    assert np.all(other.extract(STILL) == [])
