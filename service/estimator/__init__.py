"""The estimator: binds samples to the models of :mod:`filters`; no clock, no process."""

from service.estimator.course import Cause, Course, Level
from service.estimator.estimator import Estimator
from service.estimator.stopwatch import Silent, Stopwatch

__all__ = ["Cause", "Course", "Estimator", "Level", "Silent", "Stopwatch"]
