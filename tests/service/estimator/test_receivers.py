"""A receiver's lasting error: seated, kept, changed and forgotten with what befalls belief and receiver."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from filters.belief import Evidence
from filters.linearised import error_parts
from filters.particle import ParticleFilter
from filters.sensing import Position, PositionMeasurement
from filters.sensing.biased_position import BiasedPosition
from service.config import Configuration, validated
from service.estimator.ground import GroundVehicle
from service.estimator.measuring import Measurement
from service.estimator.receivers import Receivers, biases_of, learned

SECOND = 1_000_000_000
COUNT = 4000
NAME = "position_bias"
NORTH, EAST = "position_bias/north", "position_bias/east"
LASTING = sum(lasting * p for (lasting, _), p in error_parts.LASTING)
"""The share that is taken to last while nothing was learned."""


def configured(**sections: Any) -> Configuration:
    file: dict[str, Any] = {
        "vehicle": {"name": "test"},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
        "sensor": [{"kind": "position"}, {"kind": "velocity"}],
    }
    return validated(file | sections, Configuration, "test.toml")


def belief_at(sigma: float, placed: bool = False) -> tuple[Receivers, ParticleFilter[Any]]:
    configuration = configured()
    vehicle, biases = GroundVehicle(configuration), biases_of(configuration)
    belief = ParticleFilter(vehicle.motion, capacity=COUNT, seed=1, slow=learned(biases))
    chance = np.random.default_rng(1)
    columns = {name: np.zeros(COUNT) for name in belief.names}
    columns |= {name: chance.normal(0.0, sigma, COUNT) for name in ("north", "east")}
    belief.initialize(columns | {"odometry_scale": np.ones(COUNT)})
    return Receivers(biases, vehicle, belief, placed), belief


def fix(north: float, claim: float = 1.5, receiver: str | None = NAME) -> Measurement:
    value = PositionMeasurement(north, 0.0, claim, claim)
    return Measurement("position/l", Position(claim), value, True, -16.0, 1.0, claim**2, False, 0.0, receiver)


def variance_of_error(belief: ParticleFilter[Any]) -> float:
    return float(np.var(belief.column(NORTH))) + belief.particles.variances[NORTH]


def test_only_receivers_of_a_vehicle_with_odometry_whose_errors_last_have_states() -> None:
    assert biases_of(configured())[NAME] == (NORTH, EAST)
    assert [state.name for state in learned(biases_of(configured()))] == [NORTH, EAST]
    assert not biases_of(configured(honesty={"lasting_errors": False}))
    assert not biases_of(
        configured(vehicle={"name": "tag", "motion": "constant_velocity"}, sensor=[{"kind": "position"}])
    )
    assert not biases_of(configured(sensor=[{"kind": "position", "correlation_s": 0.0}]))
    assert not biases_of(configured(sensor=[{"kind": "position", "estimate": ["delay"]}]))


def test_what_is_not_of_such_a_receiver_is_left_as_it_is() -> None:
    receivers, _ = belief_at(1.0)
    for other in (fix(0.0, receiver=None), fix(0.0)._replace(lasting=0.0)):
        assert not receivers.knows(other)
        assert receivers.split(other) is other


def test_a_belief_that_began_by_a_fix_has_its_error() -> None:
    """Particles drawn about a fix by what it claims: place and error of each must add up to it, as far as it lasts."""
    receivers, belief = belief_at(1.5)
    receivers.started(0)
    measured = receivers.split(fix(0.4))
    assert isinstance(measured.model, BiasedPosition)
    sigma = measured.value.sigma_north
    assert 0.0 < sigma < 1.5
    lasting = 1.5**2 * LASTING
    gain = lasting / (lasting + sigma**2)
    np.testing.assert_allclose(belief.column(NORTH), gain * (0.4 - belief.column("north")), atol=1e-4)
    assert belief.particles.variances[NORTH] == pytest.approx((1.0 - gain) * lasting)
    seated = belief.column(NORTH).copy()
    receivers.split(fix(5.0))
    np.testing.assert_array_equal(belief.column(NORTH), seated)


def test_a_belief_that_was_told_its_place_learns_the_error_by_weighing() -> None:
    receivers, belief = belief_at(0.1, placed=True)
    receivers.started(0)
    measured = receivers.split(fix(2.0))
    assert not belief.column(NORTH).any()
    assert belief.particles.variances[NORTH] == pytest.approx(1.5**2 * LASTING)
    belief.weigh(measured.model, measured.value)
    assert float(np.mean(belief.column(NORTH))) == pytest.approx(1.7, abs=0.25)


def test_with_time_the_error_becomes_another() -> None:
    """After one duration its mean has fallen by e; the variance goes back to that of the receiver."""
    receivers, belief = belief_at(0.3, placed=True)
    receivers.started(0)
    measured = receivers.split(fix(3.0))
    belief.weigh(measured.model, measured.value)
    before = belief.column(NORTH).copy()
    duration = receivers.of(NAME).parts.duration
    for second in range(90):
        receivers.moved(second * SECOND, (second + 1) * SECOND)
    np.testing.assert_allclose(belief.column(NORTH) / before, math.exp(-90.0 / duration), rtol=1e-4)
    for second in range(1000):
        receivers.moved(second * SECOND, (second + 1) * SECOND)
    assert variance_of_error(belief) == pytest.approx(1.5**2 * LASTING)


def test_another_claim_is_another_error_beside_it_or_one_that_has_gone() -> None:
    """Errors of several sources add up, so their variances do; a small change of the claim is none."""
    receivers, belief = belief_at(0.1, placed=True)
    receivers.started(0)
    belief.weigh(*_weighable(receivers.split(fix(1.0))))
    one = belief.particles.variances[NORTH]
    belief.weigh(*_weighable(receivers.split(fix(1.0, 1.7))))
    assert belief.particles.variances[NORTH] < one
    left, mean = belief.particles.variances[NORTH], float(np.mean(belief.column(NORTH)))
    receivers.split(fix(1.0, 6.0))
    assert belief.particles.variances[NORTH] == pytest.approx(left + LASTING * (36.0 - 2.25))
    assert float(np.mean(belief.column(NORTH))) == pytest.approx(mean)
    grown = belief.particles.variances[NORTH]
    receivers.split(fix(1.0, 1.5))
    kept = 1.5**2 / 36.0
    assert float(np.mean(belief.column(NORTH))) == pytest.approx(kept * mean, rel=1e-4)
    assert belief.particles.variances[NORTH] == pytest.approx(kept**2 * grown + 2.25 * LASTING * (1.0 - kept))


def _weighable(measured: Measurement) -> tuple[BiasedPosition, PositionMeasurement]:
    assert isinstance(measured.model, BiasedPosition)
    return measured.model, measured.value


def test_a_receiver_that_was_distrusted_comes_back_with_another_error() -> None:
    receivers, belief = belief_at(0.1, placed=True)
    receivers.started(0)
    belief.weigh(*_weighable(receivers.split(fix(3.0))))
    assert abs(float(np.mean(belief.column(NORTH)))) > 2.0
    receivers.distrusted(fix(3.0))
    assert not belief.column(NORTH).any()
    assert belief.particles.variances[NORTH] == pytest.approx(1.5**2 * LASTING)


def test_particles_that_are_drawn_apart_expect_the_same_fix_as_before() -> None:
    receivers, belief = belief_at(0.5)
    receivers.started(0)
    receivers.split(fix(0.0))
    expected = belief.column("north") + belief.column(NORTH)
    with receivers.kept():
        belief.column("north")[:] += np.random.default_rng(2).normal(0.0, 0.3, COUNT).astype(np.float32)
    np.testing.assert_allclose(belief.column("north") + belief.column(NORTH), expected, atol=1e-5)


def test_those_who_learn_begin_with_a_narrow_belief_and_end_with_it() -> None:
    receivers, belief = belief_at(0.5)
    receivers.started(0)
    learner = receivers.of(NAME).learner
    receivers.moved(0, 2 * SECOND)
    assert not learner.live
    receivers.split(fix(0.0))
    receivers.moved(2 * SECOND, 4 * SECOND)
    assert learner.live
    heard, before = fix(0.4), learner.mean()
    receivers.weighed(4 * SECOND, heard, Evidence(0.0, 0.0, True), False)
    assert learner.mean()[0] + learner.mean()[-2] > before[0] + before[-2]
    belief.column("heading")[:] = np.linspace(-3.0, 3.0, COUNT)
    receivers.moved(4 * SECOND, 6 * SECOND)
    assert not learner.live


def test_what_a_liar_has_taught_is_unlearned() -> None:
    """Ten seconds of fixes that run away: what is known is what was known before, but for what time has taken."""
    receivers, _ = belief_at(0.5)
    assert receivers.motion_shares is None
    receivers.started(0)
    receivers.split(fix(0.0))
    receiver = receivers.of(NAME)
    fresh = receiver.learner.parts
    receivers.moved(0, 2 * SECOND)
    for second in range(2, 12):
        receivers.moved(second * SECOND, (second + 1) * SECOND)
        runaway = fix(4.0 * second)
        receivers.weighed((second + 1) * SECOND, runaway, Evidence(0.0, 0.0, True), False)
    poisoned = receiver.learner.parts
    assert abs(math.log(poisoned.fresh / fresh.fresh)) > 1.0
    receivers.distrusted(fix(48.0))
    assert receiver.parts == receiver.learner.parts
    assert receiver.parts.lasting == pytest.approx(fresh.lasting, rel=0.05)
    assert receiver.parts.fresh == pytest.approx(fresh.fresh, rel=0.05)
    assert not receiver.learner.live
    assert receivers.motion_shares == receiver.learner.motion_shares
