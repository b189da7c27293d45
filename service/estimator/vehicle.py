"""The vehicle as the estimator sees it: its motion model with its controls, its height, and how it is carried to now.

Which one it is says ``[vehicle] motion``. A new motion model is a new file beside :mod:`service.estimator.ground` and a
line in :func:`vehicle_of`.
"""

from __future__ import annotations

from typing import Any, Protocol

from drivers.sample import AnyReading
from filters.belief import Belief, Moments
from filters.motion.learned import SlowState
from filters.motion.model import Motion
from filters.particle import ParticleFilter
from filters.sensing import Sensor as SensorModel
from service.config import Configuration
from service.estimator.carrier import Carrier
from service.estimator.controls import Controls
from service.estimator.free import FreeVehicle
from service.estimator.ground import GroundVehicle
from service.estimator.height import Height
from service.estimator.start import Anchor
from service.geodesy import LocalFrame


class Vehicle(Protocol):
    """What the estimator wants of a vehicle. Times are nanoseconds on its clock."""

    slow_states: list[SlowState]
    """Slow states beside those of the motion: what the sensors ask for."""

    guided: bool
    """Whether controls tell the way from the horizon to now; else every measurement is wanted as soon as it may be."""

    @property
    def motion(self) -> Motion[Any, Any]:
        """What moves the particles."""
        ...

    @property
    def controls(self) -> Controls:
        """What was rolled and turned, and when; fed with every sample, whether or not the motion wants it."""
        ...

    @property
    def missing(self) -> list[str]:
        """What of the motion is wanted and was never heard, in the user's words."""
        ...

    def predict(self, belief: ParticleFilter[Any], start: int, end: int) -> None:
        """Move the particles, and the height, from ``start`` to ``end``."""
        ...

    def control(self, start: int, end: int) -> Any:
        """Return the motion's control for ``start`` to ``end``."""
        ...

    def carrier(self, belief: Belief) -> Carrier:
        """Return what carries ``belief`` from the horizon to now: an output predictor of its own for each belief."""
        ...

    def linearisable(self, moments: Moments) -> bool:
        """Say whether a belief of these moments is narrow enough for an extended Kalman filter to start from."""
        ...

    # --- height, where the particles do not have it ---------------------------------------------------------------

    def stand_at(self, anchor: Anchor | None) -> None:
        """Begin the height anew where ``anchor`` has it, if it does."""
        ...

    @property
    def height(self) -> tuple[float, float] | None:
        """Down (m) and its variance (m²), or ``None`` while unknown or a state of the particles."""
        ...

    @property
    def down(self) -> float:
        """Down, or 0 while unknown or a state of the particles."""
        ...

    @property
    def height_biases(self) -> dict[str, tuple[float, float]]:
        """Biases of the altitudes that correct that height, each with its standard deviation, metres."""
        ...

    def height_for(self, model: SensorModel[Any]) -> Height | None:
        """Return who takes a measurement of ``model``, if that is of the height and the particles do not have it."""
        ...

    def level(
        self, belief: ParticleFilter[Any], reading: AnyReading, frame: LocalFrame | None, repeats: float
    ) -> None:
        """Correct the height by a position that brings one; ``repeats`` of them share one independent error."""
        ...


def vehicle_of(configuration: Configuration) -> Vehicle:
    """Return the vehicle that ``[vehicle] motion`` asks for."""
    if configuration.vehicle.motion == "constant_velocity":
        return FreeVehicle(configuration)
    return GroundVehicle(configuration)
