"""The speed of a vehicle by several sensors: wheels, motors, a radar, each with its place and its noise.

A wheel at (x, y) of the body goes forward with v - y w, so each sensor says v = z + y w, with w the yaw rate; the speed
is their mean, weighted by the inverse of their variances. Of three and more, one that lies far from what the others
make together (a wheel that slips or is locked) is left out while it does.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from drivers.sample import SECOND, Sample
from service.config import Sensor
from service.estimator.speedometer import Speedometer, matches
from service.estimator.track import GAP

DEFAULT_SIGMA = 0.2
"""m/s; of a sensor of which neither the configuration nor the reading says how good it is."""

CORRELATION = 0.2
"""Seconds over which the errors of a speed stay alike, where the configuration does not say."""

FAR = 5.0
"""Standard deviations from the others, beyond which a speed is left out."""

ENOUGH = 3
"""Speeds of which one can be outvoted."""


class Fused(NamedTuple):
    """When (nanoseconds), the speed of the centre (m/s), and the variance of the distance left open, m² a second."""

    time: int
    speed: float
    density: float


class _Heard(NamedTuple):
    time: int
    speed: float
    variance: float
    duration: float


class Wheels:
    """Fuses the speeds of all sensors of kind ``speed``.

    Parameters
    ----------
    sensors : sequence of Sensor
        All of the configuration; those of other kinds are left alone.
    radius : float or None
        Of the driven wheels, metres; makes motor speeds a speed.

    Attributes
    ----------
    outvoted : int
        How often a speed was left out because the others disagreed with it.
    unusable : int
        Readings that said no speed.
    """

    def __init__(self, sensors: Sequence[Sensor], radius: float | None) -> None:
        self._sensors = [sensor for sensor in sensors if sensor.kind == "speed"]
        self._radius = radius
        self._speedometers: dict[tuple[int, str, str, object], Speedometer] = {}
        self._heard: dict[tuple[int, str, str, object], _Heard] = {}
        self.outvoted = 0
        self.unusable = 0

    def wants(self, sample: Sample) -> bool:
        """Say whether a sensor's reading is in ``sample``."""
        return any(self._matching(sample))

    def take(self, sample: Sample, yaw_rate: Callable[[int], float]) -> Fused | None:
        """Take a reading; return the speed by all that were heard lately, as of that reading.

        Parameters
        ----------
        yaw_rate : callable
            Says it of a time (nanoseconds), rad/s.
        """
        fresh: int | None = None
        for place in self._matching(sample):
            time = self._take(place, sample, yaw_rate)
            fresh = fresh if time is None else time
        return None if fresh is None else self._fused(fresh)

    def _matching(self, sample: Sample) -> list[int]:
        """Return the sensors that a sample is for: the first, or one for each wheel that is told apart."""
        found: dict[int | None, int] = {}
        for place, settings in enumerate(self._sensors):
            if matches(settings, sample.link, sample.source, sample.reading):
                found.setdefault(settings.index, place)
        whole = found.get(None)
        return list(found.values()) if whole is None or whole != min(found.values()) else [whole]

    def _take(self, place: int, sample: Sample, yaw_rate: Callable[[int], float]) -> int | None:
        """Take what a sample says to one sensor; return when that was true, ``None`` if it says nothing."""
        settings = self._sensors[place]
        key = (place, sample.link, sample.source, getattr(sample.reading, "index", None))
        if key not in self._speedometers:
            self._speedometers[key] = Speedometer(settings.index, self._radius)
        time = sample.time - round(settings.delay_ms * 1e6)
        said = self._speedometers[key].read(time, sample.reading)
        if isinstance(said, str):
            self.unusable += 1
            return None
        right = 0.0 if settings.lever is None else settings.lever[1]
        claimed = said.sigma if settings.claims else None
        sigma = max((s for s in (settings.sigma, claimed) if s is not None), default=DEFAULT_SIGMA)
        last = self._heard.get(key)
        interval = (time - last.time) / SECOND if last is not None else 0.0
        alike = CORRELATION if settings.correlation_s is None else settings.correlation_s
        duration = max(alike, min(GAP / SECOND, interval))
        self._heard[key] = _Heard(time, said.speed + right * yaw_rate(time), sigma * sigma, duration)
        return time

    def _fused(self, time: int) -> Fused:
        heard = [one for one in self._heard.values() if abs(time - one.time) <= GAP]
        if len(heard) >= ENOUGH:
            heard = self._agreeing(heard)
        weights = [1.0 / one.variance for one in heard]
        total = math.fsum(weights)
        speed = math.fsum(w * one.speed for w, one in zip(weights, heard, strict=True)) / total
        duration = math.fsum(w * one.duration for w, one in zip(weights, heard, strict=True)) / total
        return Fused(time, speed, duration / total)

    def _agreeing(self, heard: list[_Heard]) -> list[_Heard]:
        """Return those that lie near the median of all."""
        ranked = sorted(one.speed for one in heard)
        middle = 0.5 * (ranked[(len(ranked) - 1) // 2] + ranked[len(ranked) // 2])
        near = [one for one in heard if abs(one.speed - middle) <= FAR * math.sqrt(one.variance)]
        if not near:
            return heard
        self.outvoted += len(heard) - len(near)
        return near
