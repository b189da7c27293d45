"""Every exercise and figure by its name, and where it is made; matplotlib is imported only when one is."""

from __future__ import annotations

import importlib
from typing import NamedTuple, cast

from service.textbook.exhibit import Exhibit, Make


class Entry(NamedTuple):
    """What the list says of an exhibit, and the function that makes it, as ``module:function``."""

    title: str
    place: str


CATALOGUE = {
    "exercise-1": Entry("a car with position and velocity: histogram against Kalman filter", "car:histogram"),
    "exercise-2": Entry("one metre in an unknown direction: histogram, EKF, intuition", "ring:histogram"),
    "exercise-3": Entry("two particles: the bias of resampling", "bias:few"),
    "exercise-4": Entry("exercise 1 with particles, over several counts", "car:particles"),
    "exercise-5": Entry("exercise 2 with particles, over several counts", "ring:particles"),
    "figure-4.1": Entry("a Gaussian through a nonlinear function, as a histogram", "transform:cells"),
    "figure-4.2": Entry("static grid and density tree", "partition:decompositions"),
    "figure-4.3": Entry("the same Gaussian and function, as particles", "transform:samples"),
    "figure-4.4": Entry("importance factors: target and proposal", "sampling:target"),
    "figure-4.5": Entry("densities out of particles", "transform:densities"),
    "figure-4.6": Entry("how much chance is in 25 particles, and in 250", "transform:chance"),
    "figure-4.7": Entry("the comb of low-variance resampling", "sampling:teeth"),
    "landmarks": Entry("a robot among landmarks, by ranges only; the 2 in the Gaussian", "landmarks:robot"),
    "wheel": Entry("the resampling wheel against multinomial draws", "sampling:wheels"),
}


def make(name: str) -> Exhibit:
    """Compute and draw one exhibit.

    Raises
    ------
    KeyError
        There is none of that name.
    """
    module, function = CATALOGUE[name].place.split(":")
    return cast(Make, getattr(importlib.import_module(f"service.textbook.{module}"), function))()
