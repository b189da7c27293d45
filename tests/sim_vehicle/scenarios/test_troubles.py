"""Every scenario's trouble is on the wire as declared: when it begins, how large it is, when it ends."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from sim_vehicle import scenarios
from sim_vehicle.course import CourseDriver
from sim_vehicle.scenario import Scenario
from sim_vehicle.world import World
from tests.sim_vehicle.scenarios.heard import Heard


def times(scenario: Scenario, name: str) -> list[float]:
    return [event.time for event in scenario.events if event.name == name]


def bare(scenario: Scenario) -> Scenario:
    """Return the scenario without what a test of one sensor need not simulate."""
    return replace(scenario, inertial=None)


@pytest.mark.parametrize("seed", range(4))
def test_mirror_is_a_minute_along_the_baseline_and_then_a_right_angle(seed: int) -> None:
    drawn = scenarios.draw("mirror", seed)
    assert drawn.ranger is not None
    first, second = drawn.ranger.beacons
    along = math.atan2(second.east - first.east, second.north - first.north)
    world = World(drawn.rover, CourseDriver(drawn.course), drawn.start)
    (turn,), (turned,) = times(drawn, "turn"), times(drawn, "turned")
    drive = [world.at(count / 10.0) for count in range(round(10.0 * turned) + 1)]

    def aside(north: float, east: float) -> float:
        return (east - first.east) * math.cos(along) - (north - first.north) * math.sin(along)

    straight = [truth for truth in drive if truth.time < turn - 1.0]
    sides = [aside(truth.north, truth.east) for truth in straight]
    assert turn == pytest.approx(60.0, abs=3.0)
    assert 5.5 < abs(sides[0]) < 12.5
    assert np.ptp(sides) < 0.2
    assert abs(math.remainder(straight[-1].heading - along, math.tau)) < 0.03
    assert abs(drive[-1].heading - drawn.start.heading) == pytest.approx(math.radians(80.0), abs=0.08)
    assert turned - turn < 8.0
    told = aside(drawn.belief.position[0], drawn.belief.position[1])
    assert abs(told) < 0.1, "the start that is told says nothing of the side"


def test_mirror_has_a_tenth_of_long_ranges() -> None:
    """About 580 ranges: share beyond four sigma, 10 % x exp(-1.2/4) = 7.4 %, within five sigma."""
    drawn = scenarios.draw("mirror", 2)
    assert drawn.ranger is not None
    heard = Heard(bare(drawn), 2, 30.0)
    sites = {site.id: site for site in drawn.ranger.beacons}
    long = 0
    for message in heard.messages["RANGING_BEACON"]:
        truth, site = heard.at(heard.time(message)), sites[message.beacon_id]
        distance = math.dist((truth.north, truth.east, truth.down), (site.north, site.east, site.down))
        long += message.range / 1e3 - distance > 4.0 * 0.3
    count = len(heard.messages["RANGING_BEACON"])
    assert count > 500
    assert abs(long / count - 0.074) < 5.0 * math.sqrt(0.074 * 0.926 / count)


@pytest.mark.parametrize("seed", [0, 1])
def test_kidnap_tells_a_start_two_kilometres_off(seed: int) -> None:
    drawn = scenarios.draw("kidnap", seed)
    off = math.dist(drawn.belief.position[:2], (drawn.start.north, drawn.start.east))
    assert off == pytest.approx(2000.0, abs=5.0)
    assert max(drawn.belief.sigma) <= 0.5, "and is sure of it"
    assert (drawn.ranger is None) == (seed == 0)


def test_kidnap_gives_fixes_from_its_evidence_on_and_strays_by_300_metres() -> None:
    drawn = scenarios.draw("kidnap", 0)
    (evidence,), strays = times(drawn, "evidence"), times(drawn, "outlier")
    fixes = Heard(bare(drawn), 0, strays[0] + 3.0).fixes()
    off = [(time, math.hypot(north, east)) for time, north, east in fixes]
    assert off[0][0] == pytest.approx(evidence, abs=0.25)
    far = [(time, error) for time, error in off if error > 10.0]
    assert len(far) == 1
    assert far[0][0] == pytest.approx(strays[0], abs=0.25)
    assert far[0][1] == pytest.approx(300.0, abs=4.0)


def test_kidnap_by_ranges_begins_at_its_evidence() -> None:
    drawn = scenarios.draw("kidnap", 1)
    (evidence,), strays = times(drawn, "evidence"), times(drawn, "outlier")
    heard = Heard(bare(drawn), 1, strays[0] + 2.0)
    ranges = heard.messages["RANGING_BEACON"]
    assert heard.time(ranges[0]) == pytest.approx(evidence, abs=0.06)
    far = [heard.time(message) for message in ranges if message.range > 200_000]
    assert far == pytest.approx(strays[:1], abs=0.06)


def test_late_fix_has_no_fix_for_five_minutes() -> None:
    drawn = scenarios.draw("late_fix", 1)
    assert times(drawn, "evidence") == [300.0]
    assert drawn.gnss is not None
    assert [(window.start, window.stop) for window in drawn.gnss.outages] == [(0.0, 300.0)]
    assert drawn.seconds > 330.0
    assert drawn.ranger is None


@pytest.mark.parametrize("seed", [0, 1])
def test_spoof_leads_the_fixes_away_at_its_rate_and_they_claim_as_ever(seed: int) -> None:
    drawn = scenarios.draw("spoof", seed)
    (begin,), (honest,) = times(drawn, "spoof"), times(drawn, "honest")
    assert honest - begin == 300.0
    heard = Heard(replace(bare(drawn), wheels=None), seed, 75.0)
    fixes = np.array(heard.fixes())
    before, last = fixes[fixes[:, 0] < begin], fixes[-1]
    assert np.hypot(before[:, 1], before[:, 2]).max() < 3.0
    rate = math.hypot(last[1], last[2]) / (last[0] - begin)
    assert 0.5 - 0.15 < rate < 2.0 + 0.15
    answering = {message.beacon_id for message in heard.messages["RANGING_BEACON"]}
    assert answering == (set() if seed == 0 else {1, 3})
    fixed = [m for m in heard.messages["GPS_RAW_INT"] if m.fix_type >= 3]
    claims = np.array([(heard.time(m), m.h_acc / 1e3) for m in fixed])
    honest_claims, spoofed = claims[claims[:, 0] < begin, 1], claims[claims[:, 0] > begin + 0.5, 1]
    assert 0.5 * honest_claims.min() < spoofed.min() <= spoofed.max() < 2.0 * honest_claims.max()


def test_multipath_wanders_by_metres_and_slowly() -> None:
    """One minute: the error moves by little from fix to fix beside what it is over seconds."""
    drawn = scenarios.draw("multipath", 3)
    assert not drawn.events
    fixes = np.array(Heard(bare(drawn), 3, 60.0).fixes())[:, 1:]
    assert np.hypot(*fixes.T).max() > 3.0
    assert np.std(np.diff(fixes, axis=0)) < 1.5
    sizes = []
    for seed in range(40):
        gnss = scenarios.draw("multipath", seed).gnss
        assert gnss is not None
        sizes.append(gnss.claim * gnss.sigma)
    assert 3.0 <= min(sizes) < 3.5
    assert 4.5 < max(sizes) <= 5.01


def test_slip_lengthens_the_wheels_and_silences_two_beacons() -> None:
    seed = 1
    drawn = scenarios.draw("slip", seed)
    (begin,), (end,) = times(drawn, "slip"), times(drawn, "grip")
    assert end - begin == pytest.approx(20.0)
    heard = Heard(bare(drawn), seed, end + 3.0)
    counted = [
        (heard.time(m), 0.5 * (m.distance[0] + m.distance[1])) for m in heard.messages["WHEEL_DISTANCE"]
    ]
    first = next(row for row in counted if row[0] >= begin)
    last = [row for row in counted if row[0] < end][-1]
    true = [0.5 * (heard.at(row[0]).left + heard.at(row[0]).right) for row in (first, last)]
    assert drawn.wheels is not None
    share = (last[1] - first[1]) / (true[1] - true[0]) / drawn.wheels.scale - 1.0
    assert share == pytest.approx(0.3, abs=0.06), "with the spin that the yard always has"
    during = {m.beacon_id for m in heard.messages["RANGING_BEACON"] if begin < heard.time(m) < end}
    before = {m.beacon_id for m in heard.messages["RANGING_BEACON"] if heard.time(m) < begin}
    assert (len(before), len(during)) == (4, 2)
    speeds = [truth.speed for truth in heard.truth if begin < truth.time < end]
    assert min(speeds) > 0.2, "never at a stand"


def test_jam_goes_wild_at_its_time_and_is_honest_again() -> None:
    drawn = scenarios.draw("jam", 0)
    (begin,), (honest,) = times(drawn, "jam"), times(drawn, "honest")
    assert honest - begin == pytest.approx(50.0)
    fixes = np.array(Heard(replace(bare(drawn), wheels=None), 0, honest + 2.0).fixes())
    off = np.hypot(fixes[:, 1], fixes[:, 2])
    wrong = (fixes[:, 0] > begin + 5.0) & (fixes[:, 0] < honest)
    assert off[(fixes[:, 0] < begin) | (fixes[:, 0] > honest)].max() < 3.0
    assert np.quantile(off[wrong], 0.1) > 5.0
    assert off[wrong].max() > 100.0


def test_jams_differ_over_the_seeds() -> None:
    drawn = [scenarios.draw("jam", seed).gnss for seed in range(30)]
    manners = [gnss.interference[0] for gnss in drawn if gnss is not None]
    assert len({(manner.bold, manner.jump) for manner in manners}) == 3  # type: ignore[attr-defined]


def test_outage_troubles_each_link_in_each_way_once() -> None:
    drawn = scenarios.draw("outage", 1)
    names = [event.name for event in drawn.events if event.name != "calm"]
    assert sorted(names) == sorted(
        f"{link} {kind}"
        for link, kind in itertools.product(
            ("mavlink", "can"), ("drop", "repeat", "reorder", "delay", "corrupt")
        )
    )
    assert len(times(drawn, "calm")) == 10
    for fault, event in zip(drawn.faults, drawn.events[::2], strict=True):
        assert (fault.window.start, f"{fault.target} {fault.kind}") == (event.time, event.name)
        assert fault.share == (0.1 if fault.kind == "corrupt" else 1.0)


def test_outage_silences_a_link_in_its_window() -> None:
    drawn = scenarios.draw("outage", 1)
    fault = next(fault for fault in drawn.faults if fault.kind == "drop")
    early = replace(fault, window=replace(fault.window, start=2.0, stop=6.0))
    frames = Heard(replace(drawn, faults=(early,)), 1, 7.0).frames
    cut, whole = (frames.mavlink, frames.can) if fault.target == "mavlink" else (frames.can, frames.mavlink)
    assert not [arrival for arrival in cut if 2.1 < arrival.time < 6.0]
    assert len([arrival for arrival in whole if 2.1 < arrival.time < 6.0]) > 400
