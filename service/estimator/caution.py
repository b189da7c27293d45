"""How much of its stated noise vehicle and sensors show: the belief is as wide as they deserve, not as was feared.

A companion that follows the belief with a bank of Gaussians (:mod:`filters.linearised.noise_shares`), and says which
share of the stated process noise the particles are to be moved with, and of a sensor's variance its readings are to be
weighed with. The judges of sensors and of slipping wheels go by what was stated: they are to be cautious.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from drivers.sample import SECOND
from filters.belief import Evidence
from filters.kalman import Matrix
from filters.linearised.bank import BATCHED
from filters.linearised.noise_shares import NoiseShares, SensorShare
from filters.particle import ParticleFilter
from filters.sensing import PositionMeasurement, RangeMeasurement
from service.config import Configuration
from service.estimator.gaussian import gaussian_of, is_one_place
from service.estimator.ground import GroundVehicle
from service.estimator.measuring import Measurement
from service.estimator.receivers import Receivers
from service.estimator.vehicle import Vehicle

NARROW = 3.0
"""Metres: the spread of a belief that Gaussians can stand for."""

FAR = 16.0
"""Squared distance from the belief, in standard deviations, at which they begin anew as it is."""

SPAN = 10 * SECOND
"""What was stated holds until so many nanoseconds after a sensor was heard that says where the vehicle is, with errors
that wander: they pass for the vehicle's own."""

PRUDENCE = 0.5
"""What a measurement teaches of the noise, as a share of what it would if the models were right (Grünwald, "The safe
Bayesian", 2012): real ranges and real wheels are not as Gaussian as they are taken to be."""

INDEPENDENT = 1.0
"""Seconds in which a sensor's readings teach of it as much as one: not all that repeats is known to repeat."""


class Caution:
    """Learns how large the noises are; a :class:`~service.estimator.companion.Companion`.

    Parameters
    ----------
    vehicle : GroundVehicle
        Whose stated noise is shared out, and who heeds what was learned.
    belief : ParticleFilter
        What the Gaussians begin as.
    """

    def __init__(self, vehicle: GroundVehicle, belief: ParticleFilter[Any]) -> None:
        self._vehicle = vehicle
        self._belief = belief
        self._shares = NoiseShares(vehicle.motion, vehicle.slow_states)
        self._sensors: dict[str, tuple[SensorShare, int]] = {}
        self._checked = 0
        self._wandering = self._steady = -(2**62)
        self.receivers: Receivers | None = None

    def shown(self, name: str) -> float:
        """Return the share of its stated variance that the sensor ``name`` has shown; 1 where nothing was learned."""
        known = self._sensors.get(name)
        return 1.0 if known is None else known[0].expected

    def sized(self, measured: Measurement) -> Measurement:
        """Return a measurement with the variance that its sensor has shown.

        Readings that come late by a time that is not known well are all off alike: that part does not show.
        """
        share = self.shown(measured.name)
        value: object = measured.value
        if share == 1.0:
            return measured
        factor = math.sqrt(share)
        if isinstance(value, PositionMeasurement) and value.sigma_north and measured.timing > 0.0:
            late = min(1.0, abs(measured.timing * value.speed) / value.sigma_north)
            factor = math.sqrt(share + max(0.0, 1.0 - share) * late * late)
        if isinstance(value, RangeMeasurement) and value.sigma is not None:
            return measured._replace(value=value._replace(sigma=factor * value.sigma))
        if isinstance(value, PositionMeasurement) and value.sigma_north is not None:
            east = None if value.sigma_east is None else factor * value.sigma_east
            return measured._replace(
                value=value._replace(sigma_north=factor * value.sigma_north, sigma_east=east)
            )
        return measured

    # --- a companion of the belief --------------------------------------------------------------------------------

    def started(self, time: int) -> None:
        """Have the Gaussians wait for the belief to be one; the vehicle and its sensors are the same."""
        self._shares.stop()
        self._checked = time - SECOND // 2  # others look at the belief on the whole second

    def moved(self, start: int, end: int) -> None:
        """Move the Gaussians, unless the vehicle stands, and see once a second whether they still are of the belief."""
        if not self._vehicle.stands:
            self._shares.predict(self._vehicle.control(start, end), (end - start) / SECOND)
        if end - self._checked >= SECOND:
            self._checked = end
            self._check()
        motion = self._vehicle.motion
        motion.turn_share, motion.distance_share = self._shown_by_motion(end)

    def _shown_by_motion(self, time: int) -> tuple[float, float]:
        """Return the shares of turn and distance, by whoever can tell them from what a receiver's errors do."""
        apart = None if self.receivers is None else self.receivers.motion_shares
        if apart is not None and self._steady <= self._wandering + SPAN:
            return apart
        return self._shares.reckon() if time - self._wandering > SPAN else (1.0, 1.0)

    def weighed(self, time: int, measured: Measurement, evidence: Evidence, outlier: bool) -> None:
        """Learn from a measurement, which is handed over as it was stated."""
        if type(measured.model) not in BATCHED or not self._shares.live:
            return
        own, weight = None, 0.0
        if measured.absolute and not measured.independent:
            self._wandering = time
        if measured.independent:
            if measured.absolute:
                self._steady = time
            own, heard = self._sensors.get(measured.name, (None, time - SECOND))
            own = SensorShare() if own is None else own
            weight = min(1.0, max(0.0, (time - heard) / SECOND / INDEPENDENT))
            self._sensors[measured.name] = (own, time)
            if self._vehicle.stands:
                weight = 0.0
        worth = PRUDENCE / measured.repeats
        self._shares.hear(measured.model, measured.value, measured.log_outlier, worth, own, weight)

    def _check(self) -> None:
        moments = self._belief.moments()
        if not is_one_place(moments, NARROW):
            self._shares.stop()
            return
        self._shares.pass_second()
        if self._shares.live:
            away = moments.mean[:2] - self._shares.mean()
            own: Matrix = self._shares.bank.covariance[:, :2, :2].mean(axis=0)
            plane = moments.pose_covariance[:2, :2]
            if float(away @ np.linalg.solve(own + plane + 0.01 * np.eye(2), away)) < FAR:
                return
        self._shares.begin(*gaussian_of(self._belief, self._vehicle.motion.conditional_variances))


def caution_of(configuration: Configuration, vehicle: Vehicle, belief: ParticleFilter[Any]) -> Caution | None:
    """Return who learns how large the noises of a vehicle are; ``None`` where that is switched off or not known how."""
    if not (configuration.honesty.noise_learning and isinstance(vehicle, GroundVehicle)):
        return None
    return Caution(vehicle, belief)
