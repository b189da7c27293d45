"""Witnesses: a Kalman filter whose heading is gone is wrong and sure of it, so he is dismissed."""

from __future__ import annotations

import numpy as np
import pytest

from drivers.sample import SECOND
from filters.motion.unicycle import UnicycleControl
from service.estimator.measuring import Measurement
from service.estimator.witnesses import Witnesses
from tests.service.estimator.driving import STEP, Drive
from tests.service.estimator.test_trust import judged

GAP = (30.0, 38.0)


class Cut(Drive):
    """Neither wheels nor gyro nor beacons for eight seconds, as when a link is cut; the receiver goes on."""

    def control(self, start: int, end: int) -> UnicycleControl:
        if GAP[0] <= start / SECOND < GAP[1]:
            return UnicycleControl(0.0, 0.0, 0.4, 0.4)
        return super().control(start, end)

    def heard(self) -> list[Measurement]:
        fixes = [self.position(), self.velocity()]
        if GAP[0] <= self.time < GAP[1]:
            return fixes
        return [*fixes, self.range(round(self.time / STEP) % 4)]


@pytest.fixture
def banks(monkeypatch: pytest.MonkeyPatch) -> list[Witnesses]:
    """Every bank of witnesses that is made."""
    made: list[Witnesses] = []
    begin = Witnesses.__init__

    def noted(self: Witnesses, *arguments: object) -> None:
        made.append(self)
        begin(self, *arguments)  # type: ignore[arg-type]

    monkeypatch.setattr(Witnesses, "__init__", noted)
    return made


@pytest.mark.parametrize("seed", [20, 22, 23])
def test_after_a_gap_every_witness_is_as_near_the_truth_as_he_says(seed: int, banks: list[Witnesses]) -> None:
    """Of all that are asked for 12 s none is beyond 30, which one in two million is; kept, they came to 100 to 9000."""
    squares: list[float] = []

    def measure(_: Drive) -> list[Measurement]:
        if drive.time > GAP[1] + 0.6:
            bank = banks[0].bank
            for member in np.flatnonzero(bank.live):
                away = bank.mean[member, :2] - np.asarray(drive.truth[:2], np.float64)
                squares.append(float(away @ np.linalg.solve(bank.covariance[member, :2, :2], away)))
        return drive.heard()

    drive = Cut(seed=seed)
    _, flags = judged(drive, 50.0, measure)
    assert len(squares) > 500
    assert max(squares) < 30.0
    assert flags == []


def test_who_knows_his_heading_stays() -> None:
    """And who does not is gone at once, his group's other witness with him only if he does not know his either."""
    witnesses = Witnesses(Drive().motion, [], 1)
    covariance = np.diag([0.1, 0.1, 0.01, 1e-6, 1e-4])
    witnesses.begin([0], SECOND, np.zeros(5), covariance)
    witnesses.move(UnicycleControl(0.0, 0.0, 0.0, 0.3), STEP)
    witnesses.begin([0], 2 * SECOND, np.zeros(5), covariance)
    assert witnesses.judging(0) == 0
    witnesses.move(UnicycleControl(0.0, 0.0, 0.0, 0.4), STEP)
    assert witnesses.judging(0) == 1
    witnesses.move(UnicycleControl(0.0, 0.0, 0.0, 0.4), STEP)
    assert witnesses.judging(0) is None


def test_whose_group_was_caught_stays_for_he_alone_can_forgive() -> None:
    witnesses = Witnesses(Drive().motion, [], 1)
    witnesses.begin([0], SECOND, np.zeros(5), np.diag([0.1, 0.1, 0.01, 1e-6, 1e-4]))
    witnesses.keep(0, True)
    witnesses.move(UnicycleControl(0.0, 0.0, 0.0, 0.9), STEP)
    assert witnesses.judging(0) == 0
    witnesses.keep(0, False)
    witnesses.move(UnicycleControl(0.0, 0.0, 0.0, 0.0), STEP)
    assert witnesses.judging(0) is None
