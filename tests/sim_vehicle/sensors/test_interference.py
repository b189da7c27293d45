"""What strikes a receiver from outside does so by as much as it is declared, and then no more."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_vehicle.chance import stream
from sim_vehicle.faults import Window
from sim_vehicle.sensors import Cadence, Drag, Gnss, GnssReading, GnssSettings, Interference, Jamming, Stray
from tests.sim_vehicle.sensors.truths import straight

EXACT = GnssSettings(Cadence(5.0), wander=0.0, noise=0.0, velocity_noise=0.0, dilution_spread=0.0)


def readings(*interference: Interference, seconds: float = 40.0, seed: int = 1) -> list[GnssReading]:
    """Return five fixes a second of a receiver without errors of its own on a straight drive."""
    receiver = Gnss(replace(EXACT, interference=interference), stream(seed, "g"))
    return [receiver.measure(straight(count / 5.0)) for count in range(round(5.0 * seconds))]


def errors(heard: list[GnssReading]) -> np.ndarray:
    """Return north and east errors, a row a fix."""
    return np.array([(r.position[0] - 1.5 * i / 5.0, r.position[1]) for i, r in enumerate(heard)])


def test_a_drag_leads_away_at_its_rate_with_the_velocity_and_lets_go_at_once() -> None:
    heard = readings(Drag(Window(10.0, 30.0), 0.8, math.radians(60.0)))
    off = errors(heard)
    assert np.abs(off[:50]).max() < 1e-9
    assert off[100] == pytest.approx((8.0 * 0.5, 8.0 * math.sin(math.radians(60.0))))
    assert heard[100].velocity == pytest.approx((1.5 + 0.4, 0.8 * math.sin(math.radians(60.0)), 0.0))
    assert math.hypot(*off[149]) == pytest.approx(0.8 * 19.8)
    assert np.abs(off[150:]).max() < 1e-9
    assert len({reading.accuracy_horizontal for reading in heard}) == 1


def test_a_stray_spoils_one_fix() -> None:
    off = errors(readings(Stray(10.1, (300.0, -4.0))))
    assert off[51] == pytest.approx((300.0, -4.0))
    assert np.abs(np.delete(off, 51, axis=0)).max() < 1e-9


def test_jamming_walks_jumps_and_claims_as_its_figures_say() -> None:
    """25 receivers of 150 fixes: sigma of the last walk, of the jumps, share of bold claims, within five sigma."""
    window = Window(5.0, 35.0)
    ends, jumps, bold, fixes = [], [], 0, 0
    for seed in range(25):
        jamming = Jamming(window, 20.0, (0.0, 0.0), 0.0, 0.0, 5.0, bold=0.3)
        heard = readings(jamming, seed=seed)
        ends += list(errors(heard)[174] / (20.0 * math.sqrt(29.8)))
        bold += sum(reading.accuracy_horizontal == 0.3 for reading in heard[25:175])
        fixes += 150
        jumping = Jamming(window, 0.0, (0.0, 0.0), 150.0, 0.0, 5.0)
        jumps += list((errors(readings(jumping, seed=seed))[25:175] / 150.0).ravel())
    assert np.var(ends) == pytest.approx(1.0, abs=5.0 * math.sqrt(2.0 / len(ends)))
    assert np.var(jumps) == pytest.approx(1.0, abs=5.0 * math.sqrt(2.0 / len(jumps)))
    assert abs(bold / fixes - 0.3) < 5.0 * math.sqrt(0.21 / fixes)


def test_a_held_jump_stays_where_it_is() -> None:
    off = errors(readings(Jamming(Window(5.0, 35.0), 0.0, (0.0, 0.0), 300.0, 6.0, 0.0)))
    places = {(round(float(north), 6), round(float(east), 6)) for north, east in off[25:175]}
    assert len(places) == 5


def test_a_jammed_receiver_falls_silent_and_comes_back_honest() -> None:
    jamming = Jamming(Window(5.0, 35.0), 50.0, (3.0, 0.0), 10.0, 0.0, 5.0, silences=(Window(10.0, 12.0),))
    heard = readings(jamming)
    assert [reading.fix for reading in heard[50:60]] == [False] * 10
    assert all(reading.fix for reading in (*heard[:50], *heard[60:]))
    assert np.abs(errors(heard)[175:]).max() < 1e-9


def test_interference_leaves_the_receivers_own_noise_as_it_was() -> None:
    noisy = GnssSettings(Cadence(5.0))
    spoofed = replace(noisy, interference=(Jamming(Window(2.0, 4.0), 9.0, (0.0, 0.0), 9.0, 0.0, 1.0),))
    first, second = (Gnss(settings, stream(3, "g")) for settings in (noisy, spoofed))
    pairs = [(first.measure(straight(i / 5.0)), second.measure(straight(i / 5.0))) for i in range(40)]
    assert all(one == other for one, other in (*pairs[:10], *pairs[20:]))
    assert all(one != other for one, other in pairs[10:20])


def test_a_receiver_may_flatter_itself() -> None:
    honest, flattering = (
        Gnss(GnssSettings(Cadence(5.0), claim=claim), stream(3, "g")).measure(straight(1.0))
        for claim in (1.0, 0.6)
    )
    assert flattering.position == honest.position
    assert flattering.accuracy_horizontal == pytest.approx(0.6 * honest.accuracy_horizontal)
