"""Trust: who lies is flagged in time, who does not is not, and what a liar did is taken back.

Every drive is simulated with the seed that is written there. How often an honest receiver would be flagged: see
``test_ten_minutes_of_multipath_flags_nobody``.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from drivers.sample import SECOND
from filters import error_level
from filters.kalman import Matrix
from service.estimator import witnesses
from service.estimator.groups import group_of
from service.estimator.lie import Lie
from service.estimator.measuring import Measurement
from service.estimator.trust import Trust
from tests.service.estimator.driving import STEP, Drive

Flags = list[tuple[float, str, bool]]


def judged(
    drive: Drive,
    seconds: float,
    measure: Callable[[Drive], list[Measurement]],
    trust: Trust | None = None,
) -> tuple[Trust, Flags]:
    """Drive on, judge what is measured, and note when who was flagged and trusted again."""
    if trust is None:
        trust = Trust(drive.motion, [], drive.belief, drive.control, seed=drive.seed)
    trust.started(drive.now)
    flags: Flags = []
    believed: dict[str, bool] = {}
    while drive.time < seconds:
        start, end = drive.step()
        drive.belief.predict(drive.control(start, end), STEP)
        trust.moved(start, end)
        for measured in measure(drive):
            admitted = trust.admits(end, drive.sample(), measured)
            particles = trust.take_back()
            if particles is not None:
                drive.belief.inject(particles)
            if admitted != believed.get(measured.name, True):
                flags.append((drive.time, measured.name, not admitted))
            believed[measured.name] = admitted
            if admitted:
                trust.weighed(end, measured, drive.weigh(measured), False)
        drive.settle()
    return trust, flags


def test_a_jump_is_flagged_within_three_seconds_and_forgiven_in_ten_to_fifteen() -> None:
    def measure(drive: Drive) -> list[Measurement]:
        return [drive.position((120.0, -40.0) if 40.0 <= drive.time < 70.0 else (0.0, 0.0))]

    drive = Drive()
    trust, flags = judged(drive, 100.0, measure)
    assert [flagged for _, _, flagged in flags] == [True, False]
    assert flags[0][0] - 40.0 <= 3.0
    assert 10.0 <= flags[1][0] - 70.0 <= 15.0
    assert trust.log_odds("position/bus") == 6.0
    assert drive.error < 1.0


@pytest.mark.parametrize("rate", [0.5, 2.0])
def test_a_slow_drag_is_flagged_before_thirty_metres_and_taken_back(rate: float) -> None:
    worst = 0.0

    def measure(drive: Drive) -> list[Measurement]:
        nonlocal worst
        worst = max(worst, drive.error)
        dragged = max(0.0, drive.time - 80.0)
        moving = rate if dragged else 0.0
        return [
            drive.position((0.6 * rate * dragged, 0.8 * rate * dragged)),
            drive.velocity((0.6 * moving, 0.8 * moving)),
        ]

    drive = Drive(seed=2)
    _, flags = judged(drive, 80.0 + 60.0 / rate, measure)
    caught = [time for time, name, flagged in flags if flagged and name.startswith("position")]
    assert rate * (caught[0] - 80.0) < 30.0
    assert worst < 30.0
    assert drive.error < 8.0


def test_a_velocity_that_goes_with_the_drag_has_it_flagged_sooner() -> None:
    """And one that is wrong alone accuses no position."""

    def flagged(lies: bool, drags: bool) -> float:
        def measure(drive: Drive) -> list[Measurement]:
            away = max(0.0, drive.time - 40.0)
            rate = 2.0 if lies and away else 0.0
            far = 2.0 * away if drags else 0.0
            return [drive.position((0.0, far)), drive.velocity((0.0, rate))]

        _, flags = judged(Drive(seed=13), 60.0, measure)
        return min(
            (time for time, name, caught in flags if caught and name == "position/bus"), default=math.inf
        )

    assert flagged(lies=True, drags=True) <= flagged(lies=False, drags=True) - 1.0
    assert flagged(lies=True, drags=False) == math.inf


def test_ten_minutes_of_multipath_flags_nobody() -> None:
    """Errors of 5 m per axis that last a minute, claimed as 3 m."""
    wander = np.zeros(2)
    memory = math.exp(-STEP / 60.0)

    def measure(drive: Drive) -> list[Measurement]:
        wander[:] = memory * wander + 5.0 * math.sqrt(1.0 - memory**2) * drive.chance.standard_normal(2)
        return [drive.position((float(wander[0]), float(wander[1])), sigma=3.0)]

    _, flags = judged(Drive(seed=3), 600.0, measure)
    assert flags == []


def test_one_wild_fix_flags_nobody() -> None:
    def measure(drive: Drive) -> list[Measurement]:
        return [drive.position((300.0, 0.0) if abs(drive.time - 30.0) < 0.05 else (0.0, 0.0))]

    trust, flags = judged(Drive(seed=4), 45.0, measure)
    assert flags == []
    assert trust.log_odds("position/bus") == 6.0


def test_of_four_beacons_and_a_receiver_only_the_liar_is_flagged() -> None:
    def beacon_lies(drive: Drive) -> list[Measurement]:
        ranges = [drive.range(k, 12.0 if k == 2 and drive.time > 30.0 else 0.0) for k in range(4)]
        return [drive.position(), *ranges]

    _, flags = judged(Drive(seed=5), 50.0, beacon_lies)
    assert [name for _, name, _ in flags] == ["range/bus/2"]

    def receiver_lies(drive: Drive) -> list[Measurement]:
        away = max(0.0, drive.time - 40.0)
        return [drive.position((1.0 * away, 0.0)), *(drive.range(k) for k in range(2))]

    _, flags = judged(Drive(seed=6), 90.0, receiver_lies)
    assert [name for _, name, _ in flags] == ["position/bus"]


def test_who_never_agreed_with_the_belief_is_not_judged() -> None:
    """The belief may be the one that is wrong: a start that was told wrong, a receiver that comes late."""
    trust, flags = judged(Drive(seed=7), 30.0, lambda drive: [drive.position((2000.0, 0.0))])
    assert flags == []
    assert trust.log_odds("position/bus") is None
    assert trust.log_odds("range/bus/9") is None


def test_no_search_follows_one_who_is_alone_against_the_rest() -> None:
    """A receiver led away beside two beacons is judged; where all disagree at once, the vehicle was carried away."""

    def decided(measure: Callable[[Drive], list[Measurement]], seed: int) -> list[float]:
        asked: list[tuple[float, bool]] = []

        def watched(drive: Drive) -> list[Measurement]:
            if drive.time > STEP:
                asked.append((drive.time, trust.decides))
            return measure(drive)

        drive = Drive(seed=seed)
        trust = Trust(drive.motion, [], drive.belief, drive.control, seed=seed)
        judged(drive, 60.0, watched, trust)
        return [time for time, decides in asked if decides]

    def led_away(drive: Drive) -> list[Measurement]:
        away = max(0.0, drive.time - 40.0)
        return [drive.position((1.5 * away, 0.0)), *(drive.range(k) for k in range(2))]

    times = decided(led_away, 10)
    assert 40.0 < times[0] < 45.0
    assert any(time > 50.0 for time in times)

    def carried(drive: Drive) -> list[Measurement]:
        moved = drive.time > 40.0
        excess = (60.0, -25.0, 45.0)
        ranges = [drive.range(k, excess[k] if moved else 0.0) for k in range(3)]
        return [drive.position((200.0, 90.0) if moved else (0.0, 0.0)), *ranges]

    assert [time for time in decided(carried, 11) if time > 45.0] == []


def test_a_young_belief_has_its_witnesses_begin_anew_soon_and_then_ever_later(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """While the gyro's bias is being learned, a witness that knows nothing of it soon knows little of the place."""
    began: list[float] = []
    begin = witnesses.Witnesses.begin

    def noted(
        self: witnesses.Witnesses, groups: list[int], time: int, mean: Matrix, covariance: Matrix
    ) -> None:
        began.append(time / SECOND)
        begin(self, groups, time, mean, covariance)

    monkeypatch.setattr(witnesses.Witnesses, "begin", noted)
    judged(Drive(seed=12), 230.0, lambda drive: [drive.position()])
    assert began == pytest.approx([0.2, 5.2, 10.4, 20.8, 41.6, 83.2, 143.2, 203.2], abs=0.5)


def test_who_jumps_about_has_not_agreed_however_often_it_stays_for_a_while() -> None:
    """Every four seconds elsewhere from the first fix on; each stay agrees with a belief that has followed it."""

    def measure(drive: Drive) -> list[Measurement]:
        place = int(drive.time / 4.0) % 8
        away = (90.0 * (place % 3), 70.0 * (place % 5)) if place % 2 else (0.0, 0.0)
        return [drive.position(away)]

    trust, flags = judged(Drive(seed=14), 60.0, measure)
    assert flags == []
    assert trust.log_odds("position/bus") is None
    assert not trust.suspects
    assert not trust.decides


def test_no_search_turns_a_vehicle_about_whose_heading_a_witness_knows() -> None:
    drive = Drive(seed=16)
    trust, _ = judged(drive, 40.0, lambda drive: [drive.position()])
    heading = float(drive.truth[2])
    chance = np.random.default_rng(16)
    assert trust.decides
    assert not trust.refutes(heading + 0.05 * chance.standard_normal(500))
    assert trust.refutes(heading + 2.0 + 0.05 * chance.standard_normal(500))
    stranger, _ = judged(Drive(seed=17), 40.0, lambda drive: [drive.position((2000.0, 0.0))])
    assert not stranger.refutes(heading + 2.0 + 0.05 * chance.standard_normal(500))


def test_a_belief_that_way_and_receiver_refute_begins_anew_as_the_way_has_it() -> None:
    """Something has put the belief 12 m away; the receiver is honest and the witness knows better."""
    drive = Drive(seed=18)
    trust, _ = judged(drive, 60.0, lambda drive: [drive.position()])
    with trust.unmoved():
        trust.started(drive.now)
    names = drive.belief.names
    columns = {name: drive.belief.columns[row, :400].copy() for row, name in enumerate(names)}
    columns["north"] += 12.0
    drive.belief.inject(columns)
    taken = 0
    while drive.time < 90.0 and not taken:
        start, end = drive.step()
        drive.belief.predict(drive.control(start, end), STEP)
        trust.moved(start, end)
        assert trust.admits(end, drive.sample(), drive.position())
        particles = trust.take_back()
        if particles is not None:
            drive.belief.inject(particles)
            taken += 1
    assert 70.0 <= drive.time <= 75.0
    assert drive.error < 4.0
    assert not trust.dispute.held.any()


def test_same_seed_same_particles() -> None:
    def measure(drive: Drive) -> list[Measurement]:
        return [drive.position((max(0.0, drive.time - 70.0), 0.0))]

    columns = []
    for _ in range(2):
        drive = Drive(seed=8)
        judged(drive, 110.0, measure)
        columns.append(drive.belief.columns[:, :400].tobytes())
    assert columns[0] == columns[1]


def test_a_receiver_is_one_group_and_each_beacon_its_own() -> None:
    sample = Drive().sample()
    assert group_of("position/bus", sample) == group_of("velocity/bus", sample)
    assert group_of("range/bus/1", sample) != group_of("range/bus/2", sample)


@pytest.mark.parametrize(
    ("rate", "velocity", "alone"), [(150.0, 0.0, True), (1.0, 1.0, False), (0.0, 0.0, False)]
)
def test_a_velocity_is_left_alone_only_if_it_does_not_go_with_the_lie(
    rate: float, velocity: float, alone: bool
) -> None:
    lie, chance = Lie(), np.random.default_rng(9)
    lie.begin()
    for k in range(100):
        time = round(k * STEP * SECOND)
        position = np.array([rate * k * STEP, 0.0]) + 0.4 * chance.standard_normal(2)
        heard = np.array([velocity, 0.0]) + 0.1 * chance.standard_normal(2)
        lie.hear(time, error_level.Testimony(position, np.eye(2), np.full(2, 0.16)), STEP, True)
        lie.hear(time, error_level.Testimony(heard, 0.02 * np.eye(2), np.full(2, 0.01)), STEP, False)
    assert lie.leaves_alone is alone
