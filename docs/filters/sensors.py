"""The figure of sensors.md, drawn from the project's own code: python docs/figures.py sensors."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from filters.particle_set import ParticleSet
from filters.sensing import Range, RangeBearing, RangeBearingMeasurement, RangeMeasurement
from service.textbook.style import BLUE, GREY, ORANGE

RANGE_SIGMA = 0.5


def outlier() -> Figure:
    """Log likelihood of a range, with and without the outlier part, by the sensor model itself."""
    innovation = np.linspace(-5.0, 5.0, 1001)
    figure, axis = plt.subplots(figsize=(5.2, 3.2), layout="constrained")
    lines = ((0.0, GREY, "Gaussian"), (0.05, BLUE, "5 % outliers"), (0.3, ORANGE, "30 % outliers"))
    for outliers, colour, label in lines:
        particles = ParticleSet(("north", "east", "heading"), innovation.size)
        particles.count = innovation.size
        particles.columns[0] = 20.0 - innovation
        sensor = Range(RANGE_SIGMA, outliers=outliers)
        constant = sensor.weigh(particles, 0, particles.count, RangeMeasurement(20.0, 0.0, 0.0))
        axis.plot(innovation, constant + particles.log_weights, color=colour, label=label)
    axis.set_ylim(-16, 0.5)
    axis.set_xlabel("measured minus expected range, m (sigma 0.5 m)")
    axis.set_ylabel("log likelihood, log(1/m)")
    axis.legend(loc="lower center")
    return figure


def landmarks() -> Figure:
    """Likelihood of the place by one sight without a name, the heading being known."""
    places = np.array([(6.0, 6.0), (-6.0, 2.0), (2.0, -8.0)])
    axis_values = np.linspace(-16.0, 16.0, 61)
    east, north = np.meshgrid(axis_values, axis_values)
    particles = ParticleSet(("north", "east", "heading"), north.size)
    particles.count = north.size
    particles.columns[0], particles.columns[1] = north.ravel(), east.ravel()
    sensor = RangeBearing(0.5, 0.15, landmarks=places)
    sensor.weigh(particles, 0, particles.count, RangeBearingMeasurement(8.0, 0.4))
    figure, axis = plt.subplots(figsize=(4.6, 4.2), layout="constrained")
    shown = np.exp(particles.log_weights[: north.size].reshape(north.shape))
    axis.contourf(east, north, shown / shown.max(), levels=[0.1, 0.4, 1.0], cmap="Blues")
    axis.plot(places[:, 1], places[:, 0], "*", color=ORANGE, markersize=11)
    axis.set(aspect="equal", xticks=(-10, 0, 10), yticks=(-10, 0, 10))
    axis.set_xlabel("east, m")
    axis.set_ylabel("north, m")
    return figure


FIGURES = {"outlier": outlier, "landmarks": landmarks}
