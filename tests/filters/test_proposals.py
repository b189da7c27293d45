"""Where particles are drawn anew: against numerical integrals of the posterior that each claims to draw from."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import integrate, stats

from filters.proposals import Fix, Heading, Posterior, Proposal, Ring, Rings, Unknown

COUNT = 20_000
RNG_SEED = 5
RINGS = [Ring(0.0, 0.0, 10.0, 0.5), Ring(0.0, 12.0, 9.0, 0.8), Ring(-15.0, 3.0, 17.0, 0.5)]


def drawn(proposal: Proposal, count: int = COUNT) -> dict[str, NDArray[np.float64]]:
    return proposal.draw(count, np.random.default_rng(RNG_SEED))


@pytest.mark.parametrize(
    ("distance", "sigma", "down"), [(20.0, 0.5, 0.0), (3.0, 2.0, 0.0), (0.0, 1.0, 0.0), (5.0, 0.6, 4.5)]
)
def test_a_ring_is_the_posterior_of_a_range(distance: float, sigma: float, down: float) -> None:
    """Kolmogorov and Smirnov against the integral of r N(r; z, sigma²) over slant distances r: 8 tests of 1e-6."""
    pose = drawn(Ring(7.0, -3.0, distance, sigma, down))
    n, e = pose["north"] - 7.0, pose["east"] + 3.0
    slant = np.sqrt(n * n + e * e + down * down)
    grid = np.linspace(down, distance + 10 * sigma, 20_001)
    density = grid * np.exp(-0.5 * ((grid - distance) / sigma) ** 2)
    cumulative = integrate.cumulative_simpson(density, x=grid, initial=0)
    assert stats.kstest(slant, lambda r: np.interp(r, grid, cumulative / cumulative[-1])).pvalue > 1e-6
    angle = (np.arctan2(e, n) + math.pi) / (2 * math.pi)
    assert stats.kstest(angle, "uniform").pvalue > 1e-6
    integral = 2 * math.pi * cumulative[-1]
    assert Ring(7.0, -3.0, distance, sigma, down).density.log_integral == pytest.approx(
        math.log(integral), abs=1e-6
    )


@pytest.mark.parametrize("number", [1, 2, 3])
def test_rings_together_are_the_joint_posterior(number: int) -> None:
    """Counts in a 12 x 12 grid against the product of the likelihoods: half the sum of differences below 4 %.

    20,000 draws in so few cells alone would give 2 %, and copies of a candidate some more.
    """
    rings = RINGS[:number]
    pose = drawn(Rings(rings))
    axis = np.linspace(-14.0, 14.0, 701)
    n, e = np.meshgrid(axis, axis, indexing="ij")
    log = sum(-0.5 * ((np.hypot(n - r.north, e - r.east) - r.distance) / r.sigma) ** 2 for r in rings)
    exact, *_ = np.histogram2d(n.ravel(), e.ravel(), 12, [[-14, 14], [-14, 14]], weights=np.exp(log).ravel())
    seen, *_ = np.histogram2d(pose["north"], pose["east"], 12, [[-14, 14], [-14, 14]])
    assert 0.5 * np.abs(exact / exact.sum() - seen / seen.sum()).sum() < 0.04
    assert seen.sum() > 0.999 * COUNT


@pytest.mark.parametrize("apart", [19.9, 20.0, 21.0, 1.0, 0.0])
def test_rings_that_touch_miss_or_share_a_centre(apart: float) -> None:
    """Two ranges, 10 m each (or 10 and 9 where one lies inside the other): mean of |x| along the line of beacons."""
    other = 10.0 if apart > 5.0 else 9.0
    pose = drawn(Rings([Ring(0.0, 0.0, 10.0, 0.5), Ring(0.0, apart, other, 0.5)]))
    axis = np.linspace(-16.0, 16.0, 801)
    n, e = np.meshgrid(axis, axis, indexing="ij")
    log = (np.hypot(n, e) - 10.0) ** 2 + (np.hypot(n, e - apart) - other) ** 2
    weight = np.exp(-0.5 * (log - log.min()) / 0.25)
    for value, exact in ((pose["east"], e), (np.abs(pose["north"]), np.abs(n))):
        mean = float(np.average(exact, weights=weight))
        sigma = math.sqrt(np.average((exact - mean) ** 2, weights=weight))
        assert value.mean() == pytest.approx(mean, abs=6 * sigma / math.sqrt(COUNT / 8) + 0.01)


def test_a_fix_is_a_gaussian() -> None:
    covariance = np.array([[4.0, 1.5], [1.5, 1.0]])
    pose = drawn(Fix(3.0, -2.0, covariance, Heading(3.1, 0.2)))
    sample = np.stack([pose["north"], pose["east"]])
    assert np.abs(sample.mean(axis=1) - (3.0, -2.0)).max() < 5 * 2.0 / math.sqrt(COUNT)
    np.testing.assert_allclose(np.cov(sample), covariance, atol=5 * 4.0 * math.sqrt(2 / COUNT))
    assert np.abs(pose["heading"]).max() <= math.pi
    assert math.remainder(float(np.angle(np.exp(1j * pose["heading"]).mean())) - 3.1, 2 * math.pi) == (
        pytest.approx(0.0, abs=5 * 0.2 / math.sqrt(COUNT))
    )
    assert drawn(Fix(0.0, 0.0, 9.0))["north"].std() == pytest.approx(3.0, rel=0.03)
    assert drawn(Fix(1.0, 0.0, 0.0))["north"].tolist() == [1.0] * COUNT


def test_an_unknown_heading_is_uniform() -> None:
    heading = drawn(Ring(0.0, 0.0, 5.0, 1.0))["heading"]
    assert stats.kstest((heading + math.pi) / (2 * math.pi), "uniform").pvalue > 1e-6


class Two:
    """A histogram's posterior, as little of it as there can be."""

    def draw(self, count: int, generator: np.random.Generator) -> NDArray[np.float64]:
        return generator.choice([[1.0, 2.0, 0.5], [-1.0, 5.0, 3.0]], count)


def test_anything_that_can_be_drawn_from_is_a_proposal() -> None:
    pose = drawn(Posterior(Two(), ("north", "east", "heading")))
    assert set(zip(*(pose[name] for name in ("north", "east", "heading")), strict=True)) == {
        (1.0, 2.0, 0.5),
        (-1.0, 5.0, 3.0),
    }
    assert set(drawn(Posterior(Two(), ("north", "east", "range_bias"), Unknown()))) == {
        "north",
        "east",
        "range_bias",
        "heading",
    }
    with pytest.raises(ValueError, match="named"):
        drawn(Posterior(Two()))


@pytest.mark.parametrize(
    ("make", "what"),
    [
        (lambda: Ring(0.0, math.nan, 1.0, 1.0).density, "finite"),
        (lambda: Ring(0.0, 0.0, -1.0, 1.0).density, "negative"),
        (lambda: Ring(0.0, 0.0, 1.0, 0.0).density, "sigma"),
        (lambda: Ring(0.0, 0.0, 1.0, 0.1, down=5.0).density, "no place"),
        (lambda: Rings([]), "at least one"),
        (lambda: drawn(Rings([Ring(0.0, 0.0, 1.0, 0.1), Ring(0.0, 90.0, 1.0, 0.1)])), "no place explains"),
        (lambda: Fix(0.0, 0.0, [[1.0, 2.0], [2.0, 1.0]]), "semidefinite"),
        (lambda: Fix(0.0, 0.0, -1.0), "semidefinite"),
        (lambda: Fix(0.0, 0.0, [[1.0, 0.5], [0.0, 1.0]]), "symmetric"),
        (lambda: Fix(0.0, math.inf, 1.0), "finite"),
        (lambda: Posterior(Two(), ()), "named"),
        (lambda: Posterior(Two(), ("north", "north")), "once"),
        (lambda: Posterior(Two(), ("north", "heading"), Unknown()), "no other"),
    ],
)
def test_what_makes_no_sense_is_refused(make: Any, what: str) -> None:
    with pytest.raises(ValueError, match=what):
        make()


def test_the_same_generator_draws_the_same() -> None:
    for proposal in (Ring(0, 0, 9, 1), Rings(RINGS), Fix(0, 0, 1.0)):
        one, other = drawn(proposal, 50), drawn(proposal, 50)
        assert all(np.array_equal(one[name], other[name]) for name in one)
    assert drawn(Ring(0, 0, 9, 1), 0)["north"].size == 0
