"""What is published of several places becomes the density that is scored, row by row."""

from __future__ import annotations

import math

import numpy as np
import pytest

from service.estimate import Hypotheses, Hypothesis
from service.replay.tally import Path2D, mixture_of
from service.score import Truth

COVARIANCE = (4.0, 0.5, 0.0, 1.0, 0.0, 9.0)


def place(name: int, weight: float, north: float, east: float) -> Hypothesis:
    return Hypothesis(name, weight, (north, east, 0.0), COVARIANCE, 0.0, 0.1)


def test_two_places_are_a_mixture_and_one_is_none() -> None:
    mixture = mixture_of(Hypotheses(1.0, [place(1, 0.6, 3.0, -2.0), place(4, 0.3, 40.0, 5.0)], 0.1))
    assert mixture is not None
    assert mixture.weights.tolist() == [0.6, 0.3]
    assert mixture.means.tolist() == [[3.0, -2.0], [40.0, 5.0]]
    assert mixture.covariances.tolist() == [[4.0, 0.5, 1.0]] * 2
    assert mixture_of(Hypotheses(1.0, [place(1, 1.0, 3.0, -2.0)])) is None


def test_the_mixture_stands_in_the_row_of_its_tick() -> None:
    """Two ticks at the truth of the lesser place; only the second one published it: its density is the mixture's."""
    path = Path2D()
    mixture = mixture_of(Hypotheses(2.0, [place(1, 0.7, 60.0, 0.0), place(2, 0.3, 0.0, 0.0)]))
    path.add(1.0, 60.0, 0.0, (4.0, 0.5, 1.0))
    path.add(2.0, 60.0, 0.0, (4.0, 0.5, 1.0), mixture)
    compared = path.compared(Truth(np.array([0.0, 3.0]), np.zeros(2), np.zeros(2)))
    assert compared is not None
    peak = -math.log(2.0 * math.pi * math.sqrt(4.0 - 0.25))
    assert compared.log_score[1] == pytest.approx(peak + math.log(0.3), abs=1e-9)
    assert compared.log_score[0] < -100.0
    assert compared.error == pytest.approx([60.0, 60.0])
