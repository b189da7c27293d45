"""The autopilot's own idea of its heading: the gyro integrated, drawn toward the compass where there is one.

A complementary filter with an integral part that learns the gyro's bias (Mahony, Hamel, Pflimlin, 2008, in
one angle).
"""

from __future__ import annotations

import math


class AttitudeFilter:
    """Yaw by gyro and compass.

    Parameters
    ----------
    gain, bias_gain : float
        How fast yaw (1/s) and bias (1/s²) follow the compass.
    """

    def __init__(self, gain: float = 0.4, bias_gain: float = 0.02) -> None:
        self._gain = gain
        self._bias_gain = bias_gain
        self._bias = 0.0
        self._time: float | None = None
        self._compass_time: float | None = None
        self.yaw = 0.0

    def turn(self, time: float, yaw_rate: float) -> None:
        """Take a yaw rate in rad/s measured at ``time`` in seconds."""
        if self._time is not None:
            self.yaw += (yaw_rate - self._bias) * (time - self._time)
        self._time = time

    def align(self, time: float, heading: float) -> None:
        """Take a compass heading in radians, measured at ``time`` in seconds; the first is believed."""
        if self._compass_time is None:
            self.yaw = heading
        else:
            elapsed = time - self._compass_time
            error = math.remainder(heading - self.yaw, math.tau)
            self.yaw += self._gain * elapsed * error
            self._bias -= self._bias_gain * elapsed * error
        self._compass_time = time
