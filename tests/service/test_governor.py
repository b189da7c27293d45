"""The governor on synthetic cost processes whose answer is known in closed form."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from service.estimator import Cause, Level
from service.governor import COLD, COLD_MEASUREMENTS, GROWTH, SETTLE, Decision, Governor
from service.tick_costs import WINDOW, Line

BUDGET = 4e-3
SMALLEST, LARGEST = 200, 1_000_000
FIXED = 0.4e-3
STAGES = {"motion": 3e-9, "sensing": 6e-9, "resampling": 5e-9, "extraction": 2e-9}
OVERHEAD = 20e-6
PER_PARTICLE = sum(STAGES.values())
SHAPES = {stage: Line(OVERHEAD, slope) for stage, slope in STAGES.items()}
AFFORDABLE = (BUDGET - FIXED - len(STAGES) * OVERHEAD) / PER_PARTICLE


class Machine:
    """A computer whose every stage costs overhead + slope * count, times seeded log-normal noise."""

    def __init__(self, noise: float, seed: int = 1) -> None:
        self.random = np.random.default_rng(seed)
        self.noise = noise
        self.slower = 1.0
        self.resampling_every = 1
        self.measuring_every = 1

    def run(self, governor: Governor, ticks: int, demand: int = LARGEST) -> tuple[np.ndarray, np.ndarray]:
        """Return count and total cost of every tick."""
        counts, costs = np.zeros(ticks), np.zeros(ticks)
        for tick in range(ticks):
            decision = governor.decide(demand)
            counts[tick] = decision.count
            costs[tick] = self._tick(governor, decision.count, tick)
        return counts, costs

    def _tick(self, governor: Governor, count: int, tick: int) -> float:
        costs = {"ingest": self.slower * FIXED * self._jitter()}
        for stage, slope in STAGES.items():
            if stage == "resampling" and tick % self.resampling_every:
                continue
            costs[stage] = self.slower * (OVERHEAD + slope * count) * self._jitter()
        measurements = 0 if tick % self.measuring_every else 1
        governor.observe(costs, count, measurements, measurements)
        return sum(costs.values())

    def _jitter(self) -> float:
        return float(self.random.lognormal(0.0, self.noise))


def fresh() -> Governor:
    return Governor(BUDGET, SMALLEST, LARGEST, SHAPES)


def observe(governor: Governor, costs: dict[str, float], count: int = SMALLEST) -> None:
    """Tell of a tick with one measurement, which was weighed."""
    governor.observe(costs, count, 1, 1)


def test_converges_to_what_the_budget_affords() -> None:
    """Without noise the count ends between the growth mark (0.9 of the supply) and the exact answer."""
    counts, costs = Machine(noise=0.0).run(fresh(), 600)
    assert 0.88 * AFFORDABLE <= counts[-1] <= 1.0001 * AFFORDABLE
    assert costs[4:].max() <= 1.0001 * BUDGET  # the fixed cost is learnt from the first four


@pytest.mark.parametrize("noise", [0.05, 0.1, 0.2])
def test_seldom_exceeds_the_budget(noise: float) -> None:
    """At most 2 % of 5,000 ticks, for independent log-normal noise of 5, 10 and 20 % on every stage. Seeded."""
    counts, costs = Machine(noise).run(fresh(), 5_000)
    assert np.mean(costs > BUDGET) <= 0.02
    assert counts[1_000:].mean() >= 0.6 * AFFORDABLE


def test_reacts_to_doubled_cost_within_eight_ticks() -> None:
    """The 98 % quantile of 100 values moves with the third slow one; then the count drops at once."""
    machine, governor = Machine(noise=0.02), fresh()
    machine.run(governor, 1_000)
    machine.slower = 2.0
    _, costs = machine.run(governor, 200)
    assert costs[0] > 1.5 * BUDGET
    assert costs[8:].max() < 1.03 * BUDGET
    # of k slow ticks the third largest is what fits, and one more exceeds it with probability 3 / (k + 1): together
    # 5 % of 192, and over 30 seeds 7.8 % at most; once only slow ones are remembered, 2.4 %
    assert np.mean(costs[8:] > BUDGET) <= 0.08
    assert np.mean(costs[WINDOW:] > BUDGET) <= 0.05


def test_recovers_when_the_machine_is_fast_again() -> None:
    machine, governor = Machine(noise=0.02), fresh()
    machine.slower = 2.0
    slow, _ = machine.run(governor, 500)
    machine.slower = 1.0
    fast, costs = machine.run(governor, 4 * WINDOW)
    assert fast[-1] > 1.8 * slow[-1]
    assert np.mean(costs > BUDGET) <= 0.02


def test_does_not_hunt() -> None:
    """Once settled, the count changes in few ticks, and stays within a tenth of its median."""
    counts, _ = Machine(noise=0.1).run(fresh(), 4_000)
    settled = counts[1_000:]
    assert np.mean(np.diff(settled) != 0) <= 0.05
    assert np.abs(settled / np.median(settled) - 1.0).max() <= 0.1


def test_pays_for_a_stage_that_runs_seldom() -> None:
    """Resampling in one tick of ten: that tick must fit, too."""
    machine = Machine(noise=0.05)
    machine.resampling_every = 10
    _, costs = machine.run(fresh(), 4_000)
    assert np.mean(costs[::10] > BUDGET) <= 0.05


def test_grows_slowly_and_shrinks_at_once() -> None:
    machine, governor = Machine(noise=0.0), fresh()
    counts, _ = machine.run(governor, 300)
    grown = counts[1:] / counts[:-1]
    assert GROWTH == 1.1
    assert 1.05 < grown.max() <= 1.1001, "counts are whole, and the first guess is low"
    for _ in range(3):
        observe(governor, {"sensing": 100.0}, int(counts[-1]))
    assert governor.decide(LARGEST).count == SMALLEST


def test_stages_that_peak_apart_are_not_paid_for_together() -> None:
    """Three stages, of which one costs 2 ms in each tick and the others next to nothing: all fits into 4 ms.

    The sum of the stages' own high quantiles would be 6 ms, and starve it. Closed form.
    """
    shapes = SHAPES | {"witnesses": Line(2e-4, 2e-9)}
    governor = Governor(BUDGET, SMALLEST, LARGEST, shapes)
    for tick in range(2 * WINDOW):
        dear = ("ingest", "witnesses", "publishing")[tick % 3]
        observe(
            governor, {"ingest": 1e-5, "witnesses": 1e-5, "publishing": 1e-5, "sensing": 1e-4} | {dear: 2e-3}
        )
    decision = governor.decide(5_000)
    assert (decision.count, decision.level) == (5_000, Level.FULL)


def test_the_first_measurement_is_not_the_price_of_each() -> None:
    """What 4 measurements share costs 2 ms, and each of them 0.1: once thinned to one, it is not so for ever."""
    governor = fresh()
    for _ in range(WINDOW):
        observe(governor, {"sensing": 5e-3})
    assert governor.decide(SMALLEST).level >= Level.THINNED
    for _ in range(6 * WINDOW):
        weighed = min(governor.decide(SMALLEST).most, 4)
        governor.observe({"sensing": 2e-3 + weighed * 1e-4} if weighed else {}, SMALLEST, 4, weighed)
    assert governor.decide(SMALLEST).level is Level.FULL


def test_a_tick_that_was_cut_had_too_many_particles() -> None:
    """Every second tick is cut after 2 of 4 measurements: the count falls to what all four of them leave room for."""
    governor = Governor(BUDGET, SMALLEST, LARGEST, {"sensing": Line(1e-5, 5e-9)})
    counts: list[int] = []
    for _ in range(4 * WINDOW):
        count = governor.decide(LARGEST).count
        weighed = max(1, min(4, int((BUDGET - 1e-3) / (1e-5 + 5e-9 * count))))
        governor.observe({"ingest": 1e-3, "sensing": weighed * (1e-5 + 5e-9 * count)}, count, 4, weighed)
        counts.append(count)
    affordable = (BUDGET - 1e-3 - 4e-5) / (4 * 5e-9)
    assert 0.85 * affordable <= counts[-1] <= affordable
    assert max(counts[WINDOW:]) <= affordable


def test_demand_within_the_supply_is_met_in_full() -> None:
    governor = fresh()
    Machine(noise=0.1).run(governor, 300)
    decision = governor.decide(5_000)
    assert decision.count == 5_000
    assert decision.level is Level.FULL
    assert decision.afforded > 5_000


def test_demand_beyond_the_supply_lowers_the_level() -> None:
    governor = fresh()
    Machine(noise=0.1).run(governor, 300)
    decision = governor.decide(LARGEST)
    assert decision.count == decision.afforded < LARGEST
    assert decision.level is Level.FEWER_PARTICLES


def test_starved_says_less_than_the_minimum_but_uses_it() -> None:
    governor = fresh()
    for _ in range(WINDOW):
        observe(governor, {"motion": 1.0})
    assert governor.decide(5_000) == Decision(SMALLEST, 0, Level.PREDICTION_ONLY, Cause.BUDGET, 0)


def test_fixed_cost_alone_can_eat_the_budget() -> None:
    governor = fresh()
    for _ in range(WINDOW):
        observe(governor, {"ingest": 2 * BUDGET})
    assert governor.decide(5_000).afforded == 0


def test_never_more_than_the_capacity() -> None:
    governor = Governor(1.0, 10, 500, {})
    Machine(noise=0.1).run(governor, 300, demand=500)
    assert governor.decide(5_000).afforded == 500


def test_starts_from_what_the_rehearsal_measured() -> None:
    """Closed form, before any tick: the rehearsal's lines, twice as dear, and two measurements."""
    times = {stage: 1 if stage == "extraction" else COLD_MEASUREMENTS for stage in STAGES}
    overhead = COLD * sum(times.values()) * OVERHEAD
    expected = (BUDGET - overhead) / (COLD * sum(times[stage] * slope for stage, slope in STAGES.items()))
    assert fresh().decide(LARGEST).count == int(expected)


def test_one_early_exception_does_not_rule() -> None:
    """A first tick of 3 ms at 200 particles says nothing of 100,000."""
    governor = fresh()
    before = governor.decide(LARGEST)
    observe(governor, {"motion": 3e-3, "ingest": 3e-3})
    assert governor.decide(LARGEST) == before


@pytest.mark.parametrize("wrong", [Line(0.0, 1.0), Line(5e-5, 1e-9), Line(1e-6, 1e-6)])
def test_a_wrong_shape_still_leads_to_the_right_count(wrong: Line) -> None:
    """From shapes that are off by orders of magnitude, the count ends where the budget does."""
    governor = Governor(BUDGET, SMALLEST, LARGEST, dict.fromkeys(STAGES, wrong))
    counts, costs = Machine(noise=0.02).run(governor, 2_000)
    assert 0.8 * AFFORDABLE <= counts[-1] <= 1.05 * AFFORDABLE
    assert np.mean(costs[500:] > BUDGET) <= 0.02


def test_small_counts_do_not_hide_what_large_ones_would_cost() -> None:
    """At 200 particles nearly everything is overhead; the supply is still that of the slope."""
    governor = fresh()
    Machine(noise=0.0).run(governor, 300, demand=SMALLEST)
    assert governor.decide(SMALLEST).afforded == pytest.approx(AFFORDABLE, rel=0.11)


def test_without_shapes_the_whole_cost_counts_per_particle() -> None:
    governor = Governor(BUDGET, SMALLEST, LARGEST, {})
    counts, costs = Machine(noise=0.02).run(governor, 2_000)
    assert 0.8 * AFFORDABLE <= counts[-1] <= AFFORDABLE
    assert np.mean(costs[500:] > BUDGET) <= 0.02


@pytest.mark.parametrize(
    ("budget", "smallest", "largest"), [(0.0, 1, 2), (-1.0, 1, 2), (1.0, 0, 2), (1.0, 3, 2)]
)
def test_refuses_what_cannot_be_governed(budget: float, smallest: int, largest: int) -> None:
    with pytest.raises(ValueError, match=r"budget|particles"):
        Governor(budget, smallest, largest, {})


class Vehicle:
    """A computer on which a tick costs ``fixed``, ``cloud`` when it is sent, and ``each`` per measurement."""

    def __init__(self, fixed: float, cloud: float, each: float) -> None:
        self.fixed, self.cloud, self.each = fixed, cloud, each
        self.offered = 20

    def tick(self, governor: Governor) -> tuple[Decision, float]:
        decision = governor.decide(5_000)
        weighed = min(decision.most, self.offered)
        costs = {"ingest": self.fixed, "sensing": weighed * self.each}
        if decision.level < Level.NO_CLOUD:
            costs["cloud"] = self.cloud
        count = 0 if decision.level is Level.KALMAN else decision.count
        governor.observe(costs, count, self.offered, weighed)
        return decision, sum(costs.values())

    def run(self, governor: Governor, ticks: int) -> list[tuple[Decision, float]]:
        return [self.tick(governor) for _ in range(ticks)]


def only_sensing(period: float = 1.0) -> Governor:
    return Governor(BUDGET, SMALLEST, LARGEST, {"sensing": Line(1e-4, 1e-7)}, period)


@pytest.mark.parametrize(
    ("fixed", "cloud", "each", "level", "most"),
    [
        (1e-3, 0.1e-3, 0.01e-3, Level.FULL, 64),  # 20 measurements of 10 µs: nothing is given up
        (1e-3, 1.1e-3, 0.25e-3, Level.THINNED, 7),  # 4 ms less 2.1 ms: seven of 0.25 ms
        (1e-3, 2.9e-3, 0.25e-3, Level.NO_CLOUD, 12),  # not even one beside the cloud, twelve without it
        (1e-3, 0.1e-3, 3.5e-3, Level.PREDICTION_ONLY, 0),  # 3 ms are left, and one costs 3.5
    ],
)
def test_gives_up_in_the_declared_order(
    fixed: float, cloud: float, each: float, level: Level, most: int
) -> None:
    """Closed form: what is left of 4 ms, in measurements. No tick costs more than the budget once it is learnt."""
    run = Vehicle(fixed, cloud, each).run(only_sensing(), 70)
    decision, _ = run[-1]
    assert (decision.level, decision.most) == (level, most)
    assert decision.cause is (Cause.BUDGET if level else Cause.NONE)
    assert max(cost for _, cost in run[30:70]) <= BUDGET + 1e-9
    if level >= Level.THINNED:
        assert decision.count == SMALLEST
        first = next(found for found, _ in run if found.level is level)
        assert first.afforded < SMALLEST  # later, what is left out fades in memory until it is tried again


def test_what_is_not_measured_any_more_is_tried_again() -> None:
    """At prediction only nothing tells that measurements have become cheap; within 300 ticks one is tried."""
    vehicle, governor = Vehicle(1e-3, 0.1e-3, 3.5e-3), only_sensing()
    vehicle.run(governor, 70)
    vehicle.each = 0.01e-3
    levels = [decision.level for decision, _ in vehicle.run(governor, 500)]
    assert Level.PREDICTION_ONLY in levels
    assert levels[300] < Level.PREDICTION_ONLY
    assert levels[-1] <= Level.FEWER_PARTICLES


@pytest.mark.parametrize(
    ("cost", "level", "most"),
    [
        (Line(0.4e-3, 0.2e-3), Level.KALMAN, 5),  # twice its shape until it is known: (3 ms - 0.8) / 0.4
        (Line(0.4e-3, 1.2e-3), Level.PREDICTION_ONLY, 0),  # 0.8 + 2.4 ms do not go into 3
    ],
)
def test_a_kalman_filter_takes_over_where_it_fits_and_particles_do_not(
    cost: Line, level: Level, most: int
) -> None:
    """Closed form: 4 ms less 1 ms fixed; with the fewest particles one measurement costs 3.5."""
    shapes = {"sensing": Line(1e-4, 1e-7), "kalman": cost}
    governor, vehicle = Governor(BUDGET, SMALLEST, LARGEST, shapes, 1.0), Vehicle(1e-3, 0.1e-3, 3.5e-3)
    decisions = [vehicle.tick(governor)[0] for _ in range(6)]
    assert (decisions[-1].level, decisions[-1].most) == (level, most)


def test_a_kalman_filter_hands_back_when_particles_have_become_cheap() -> None:
    """While it speaks nothing tells what particles cost: what is remembered fades, and within 500 ticks they are back.

    It takes 10 µs and what it measures of itself is twice its shape, so it always fits.
    """
    cost = Line(5e-6, 5e-6)
    governor = Governor(BUDGET, SMALLEST, LARGEST, {"sensing": Line(1e-4, 1e-7), "kalman": cost}, 1.0)
    vehicle = Vehicle(1e-3, 0.1e-3, 3.5e-3)
    vehicle.run(governor, 10)
    levels: list[Level] = []
    for _ in range(500):
        decision = governor.decide(5_000)
        levels.append(decision.level)
        if decision.level is Level.KALMAN:
            governor.observe_deputy(2.0 * cost.at(20), 20)
        weighed = 0 if decision.level is Level.KALMAN else min(20, decision.most)
        count = decision.count if weighed else 0
        governor.observe({"sensing": weighed * 0.01e-3}, count, 20, weighed)
    assert levels[0] is Level.KALMAN
    assert levels[-1] <= Level.FEWER_PARTICLES
    assert sum(a != b for a, b in pairwise(levels)) <= 4  # it does not hunt


def test_tries_in_vain_seldom() -> None:
    """A measurement that costs ten budgets: at most one tick in fifty overruns for the sake of trying."""
    vehicle, governor = Vehicle(1e-3, 0.1e-3, 10 * BUDGET), only_sensing()
    vehicle.run(governor, 100)
    costs = [cost for _, cost in vehicle.run(governor, 2_000)]
    assert 1 <= sum(cost > BUDGET for cost in costs) <= 40


def test_a_better_level_is_taken_after_a_while_only() -> None:
    """The need for thinning comes and goes in every tick; the level does not follow."""
    governor = only_sensing()
    vehicle = Vehicle(1e-3, 1.1e-3, 0.25e-3)
    vehicle.run(governor, 70)
    levels: list[Level] = []
    for tick in range(640):
        vehicle.each = 0.25e-3 if tick % 40 == 0 else 0.02e-3
        levels.append(vehicle.tick(governor)[0].level)
    changes = sum(before != after for before, after in pairwise(levels))
    assert changes <= 640 / 64 + 1


def test_the_count_turns_no_more_often_than_it_may() -> None:
    """Constant cost with 10 % noise: between two growths that a shrinking separates lie at least 32 ticks."""
    counts, _ = Machine(noise=0.1).run(fresh(), 4_000)
    steps = np.sign(np.diff(counts[500:]))
    shrunk = -SETTLE
    for tick, step in enumerate(steps):
        if step < 0:
            shrunk = tick
        assert step <= 0 or tick - shrunk >= SETTLE
    assert np.count_nonzero(steps) <= len(steps) / 20


def test_others_on_the_processor_cost_particles() -> None:
    """Ticks that wait 8 ms of a period of 10 have 1 ms left; with 20 ms of waiting a quarter of the budget stays."""
    shapes = {"sensing": Line(0.0, 1e-7)}
    for wait, room in ((8e-3, 1e-3), (20e-3, 0.25 * BUDGET), (1e-3, BUDGET)):
        governor = Governor(BUDGET, SMALLEST, LARGEST, shapes, 10e-3)
        for _ in range(WINDOW):
            governor.observe_wait(wait)
        assert governor.room == pytest.approx(room)
        decision = governor.decide(LARGEST)
        assert decision.count == pytest.approx(room / (COLD * COLD_MEASUREMENTS * 1e-7), abs=1)
        assert decision.cause is (Cause.BUDGET if room == BUDGET else Cause.PROCESSOR)


def test_others_alone_never_starve_it() -> None:
    """A count whose expected measurements take three quarters of the budget stays, however long ticks wait."""
    count = int(0.75 * BUDGET / (COLD * COLD_MEASUREMENTS * 1e-7))
    governor = Governor(BUDGET, count, LARGEST, {"sensing": Line(0.0, 1e-7)}, 10e-3)
    for _ in range(WINDOW):
        governor.observe_wait(1.0)
    decision = governor.decide(LARGEST)
    assert decision.count == decision.afforded == count
    assert decision.level is Level.FEWER_PARTICLES


def test_the_reserve_is_what_comes_after_the_weighing() -> None:
    governor = fresh()
    for _ in range(WINDOW):
        observe(governor, {"ingest": 1e-3, "publishing": 2e-4, "cloud": 1e-4})
    later = sum(SHAPES[stage].at(1_000) for stage in ("resampling", "extraction"))
    assert governor.reserve(1_000) == pytest.approx(COLD * later + 3e-4)
