"""Driving against the host's clock: frames leave when they are due, and what companions say is answered.

A drive begins when it is started; its time is the host's monotonic clock since then, and the truth is written
with the host's Unix clock as it was at the start.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import IO

from sim_vehicle.ports import CanPort, MavlinkPort
from sim_vehicle.recording import TRUTH_HEADER, TRUTH_RATE, truth_row
from sim_vehicle.vehicle import Vehicle
from sim_vehicle.world import Truth

_LONGEST_WAIT = 0.05


@dataclass(frozen=True, slots=True)
class Start:
    """When the drive began: seconds on the monotonic clock, Unix seconds."""

    monotonic: float
    unix: float


@dataclass(frozen=True, slots=True)
class Driven:
    """What was sent, and what had nobody to take it."""

    seconds: float
    mavlink_frames: int
    mavlink_dropped: int
    can_frames: int
    can_dropped: int


def now() -> Start:
    """Read both clocks."""
    return Start(time.monotonic(), time.time())


class RealTime:
    """A vehicle on its links.

    Parameters
    ----------
    vehicle : Vehicle
        Which drives.
    start : Start
        When its drive began.
    mavlink, can : MavlinkPort, CanPort or None
        Where its frames go.
    truth : IO[str] or None
        Where the truth goes, line by line.
    """

    def __init__(
        self, vehicle: Vehicle, start: Start, mavlink: MavlinkPort, can: CanPort | None, truth: IO[str] | None
    ) -> None:
        self._vehicle = vehicle
        self._start = start
        self._mavlink = mavlink
        self._can = can
        self._truth = truth
        self._sent = [0, 0]
        if truth is not None:
            truth.write(TRUTH_HEADER)
            vehicle.watch(TRUTH_RATE, self._note)

    def run(self, seconds: float, stopped: Callable[[], bool]) -> Driven:
        """Drive until ``seconds`` have passed or ``stopped`` says so."""
        elapsed = 0.0
        while elapsed < seconds and not stopped():
            elapsed = time.monotonic() - self._start.monotonic
            self.turn(elapsed)
            until = min(seconds, self._vehicle.next_event, elapsed + _LONGEST_WAIT)
            self._wait(until - (time.monotonic() - self._start.monotonic))
        return Driven(
            elapsed,
            self._sent[0],
            self._mavlink.dropped,
            self._sent[1],
            self._can.dropped if self._can else 0,
        )

    def turn(self, elapsed: float) -> None:
        """Bring the drive to ``elapsed`` seconds: send what is due, answer what has arrived."""
        frames = self._vehicle.advance(elapsed)
        for arrival in frames.mavlink:
            self._mavlink.send(arrival.frame)
        for data in self._mavlink.receive():
            self._vehicle.autopilot.receive(data, elapsed)
        self._sent[0] += len(frames.mavlink)
        if self._can is not None:
            self._can.serve()
            for arrival in frames.can:
                self._can.send(arrival.frame)
            self._sent[1] += len(frames.can)

    def _note(self, truth: Truth) -> None:
        if self._truth is not None:
            self._truth.write(truth_row(truth, self._start.unix))
            self._truth.flush()

    def _wait(self, seconds: float) -> None:
        if seconds <= 0.0:
            return
        waiting = [*self._mavlink.filenos(), *(self._can.filenos() if self._can else [])]
        select.select(waiting, [], [], seconds)
