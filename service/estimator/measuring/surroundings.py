"""What is known of the place that a configuration describes."""

from __future__ import annotations

from pathlib import Path

from drivers.maps import landmarks
from service.config import Configuration
from service.estimator.height import height_state
from service.estimator.measuring.kind import Surroundings


def surroundings_of(configuration: Configuration) -> Surroundings:
    """Return the beacons of a configuration, the landmarks of its map, and how its vehicle moves.

    Raises
    ------
    drivers.maps.landmarks.LandmarkError
        The map of landmarks has become unreadable since the configuration was checked.
    """
    path = configuration.map.landmarks
    return Surroundings(
        {beacon.id: beacon for beacon in configuration.beacon},
        landmarks.read(Path(path)) if path else {},
        height_state(configuration),
        configuration.vehicle.motion != "constant_velocity",
        configuration.motion.speed_noise,
        configuration.motion.wheel_radius,
    )
