"""How many particles a belief begins with, and what a collapse leaves of it."""

from __future__ import annotations

import numpy as np
import pytest

from filters.sensing import Position, PositionMeasurement
from service.estimator.population import Population
from service.estimator.stopwatch import Silent
from tests.service.estimator.images import Images, images
from tests.service.estimator.test_estimator import configuration


def population(belief: Images) -> Population:
    return Population(configuration(), belief, Silent())


def test_a_beginning_is_reckoned_before_it_is_first_worn() -> None:
    """A measurement in the very tick of the start must not cut a wide belief to the fewest particles there may be."""
    belief = images()
    belief.initialize({name: 10.0 * np.random.default_rng(2).normal(size=4000) for name in belief.names})
    plan = population(belief)
    least = plan.demand
    plan.begun(0)
    assert plan.demand > 2000 > least
    belief.weigh(Position(4.0, outliers=0.0), PositionMeasurement(0.0, 0.0))
    plan.resample_if_worn(4000)
    assert belief.count == min(plan.demand, 4000)


@pytest.mark.parametrize(("sigma", "tempered"), [(0.01, 1), (0.13, 0)])
def test_only_a_collapse_is_tempered_and_its_copies_differ(sigma: float, tempered: int) -> None:
    belief = images(share=0.0)
    plan = population(belief)
    plan.begun(0)
    belief.weigh(Position(sigma, outliers=0.0), PositionMeasurement(0.1, 0.1))
    worn = belief.effective_sample_size
    assert worn < 0.5 * 4000
    plan.resample_if_worn(4000)
    assert belief.tempered == tempered
    assert (worn < 0.1 * 4000) == bool(tempered)
    different = np.unique(belief.column("north")).size
    if tempered:
        assert different > 0.95 * belief.count
    else:
        assert different < 0.8 * belief.count
