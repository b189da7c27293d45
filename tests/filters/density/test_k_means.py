"""k-means: known mixtures recovered, the law of total covariance, angles, k by evidence, particles as they are."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.density.clusters import Clusters
from filters.density.k_means import KMeans
from filters.motion import Unicycle
from filters.particle import ParticleFilter

SHARES = np.array([0.5, 0.3, 0.2])
MEANS = np.array([[0.0, 0.0, 3.1, 0.0], [30.0, 10.0, -2.8, 1.0], [-20.0, 15.0, 0.0, 0.5]])
SIGMAS = np.array([[1.0, 2.0, 0.2, 0.1], [3.0, 1.0, 0.3, 0.1], [0.5, 0.5, 0.6, 0.2]])
HEADED = (False, False, True, False)


def three_places(count: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    which = rng.choice(3, count, p=SHARES)
    points = MEANS[which] + rng.normal(size=(count, 4)) * SIGMAS[which]
    points[:, 2] = np.remainder(points[:, 2] + math.pi, 2.0 * math.pi) - math.pi
    return points


def columns_of(points: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(points.T, np.float32)


def test_a_known_mixture_is_recovered() -> None:
    """Every weight, mean and deviation within 5 standard errors: 27 numbers, false alarm 2e-5."""
    count = 20_000
    found = KMeans()(three_places(count), None, HEADED)
    assert len(found.weights) == 3
    assert found.left_out == 0.0
    n = count * SHARES
    np.testing.assert_array_less(
        np.abs(found.weights - SHARES), 5.0 * np.sqrt(SHARES * (1.0 - SHARES) / count)
    )
    away = np.remainder(found.means - MEANS + math.pi, 2.0 * math.pi) - math.pi
    assert (np.abs(away) < 5.0 * SIGMAS / np.sqrt(n)[:, None]).all()
    deviation = np.sqrt(np.diagonal(found.covariances, axis1=1, axis2=2))
    assert (np.abs(deviation / SIGMAS - 1.0) < 5.0 / np.sqrt(2.0 * n)[:, None]).all()
    correlation = found.covariances / np.einsum("ki,kj->kij", deviation, deviation)
    off = np.abs(correlation - np.eye(4)).max(axis=(1, 2))
    np.testing.assert_array_less(off, 5.0 / np.sqrt(n))


def test_weighted_particles_are_their_weights() -> None:
    """Half of the particles of one place at a third of the weight: as if they were fewer, within 5 errors."""
    points = three_places(20_000)
    weights = np.where(points[:, 0] > 15.0, 1.0 / 3.0, 1.0)
    found = KMeans()(points, 7.0 * weights, HEADED)
    expected = np.array([0.5, 0.2, 0.1]) / 0.8
    np.testing.assert_allclose(found.weights, expected, atol=0.02)
    np.testing.assert_allclose(found.means[1, 0], -20.0, atol=5.0 * 0.5 / math.sqrt(4000))


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 2**32), places=st.integers(1, 5), count=st.integers(20, 400))
def test_the_law_of_total_covariance(seed: int, places: int, count: int) -> None:
    """What the clusters say together is what the particles say, to rounding, whatever the clustering."""
    rng = np.random.default_rng(seed)
    centres = rng.normal(0.0, 20.0, (places, 2))
    points = (centres[rng.integers(0, places, count)] + rng.normal(size=(count, 2))).astype(np.float32)
    weights = rng.random(count).astype(np.float32)
    found = Clusters([False, False], least_weight=0.0).extract(columns_of(points), weights, count)
    exact, share = points.astype(np.float64), weights.astype(np.float64) / weights.sum(dtype=np.float64)
    mean, covariance = found.moments()
    scale = float(np.abs(exact).max())
    np.testing.assert_allclose(mean, share @ exact, atol=1e-12 * scale)
    away = exact - share @ exact
    expected = (away * share[:, None]).T @ away
    np.testing.assert_allclose(covariance, expected, atol=1e-11 * scale**2)


def test_a_cluster_across_the_turn_is_one() -> None:
    """Headings about pi are one place; its mean and deviation are the unwrapped ones."""
    rng = np.random.default_rng(3)
    near = rng.normal(math.pi, 0.2, 3000)
    other = rng.normal(0.5, 0.1, 1000)
    heading = np.remainder(np.concatenate([near, other]) + math.pi, 2.0 * math.pi) - math.pi
    found = KMeans()(heading[:, None], None, [True])
    np.testing.assert_allclose(found.weights, [0.75, 0.25], atol=1e-3)
    assert abs(math.remainder(found.means[0, 0] - float(near.mean()), 2.0 * math.pi)) < 1e-3
    np.testing.assert_allclose(found.covariances[:, 0, 0], [near.var(), other.var()], rtol=0.02)


def test_long_clusters_side_by_side_come_apart() -> None:
    """Forty times as long as wide, and six apart."""
    rng = np.random.default_rng(4)
    points = rng.normal(size=(4000, 2)) * [20.0, 0.5]
    points[2000:, 1] += 6.0
    found = KMeans()(points)
    assert len(found.weights) == 2
    np.testing.assert_allclose(np.sort(found.means[:, 1]), [0.0, 6.0], atol=0.1)
    np.testing.assert_allclose(np.sqrt(found.covariances[:, 0, 0]), 20.0, rtol=0.1)


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("dimension", [1, 2, 4])
def test_one_gaussian_is_not_split(seed: int, dimension: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(3000, dimension)) * np.geomspace(0.01, 100.0, dimension)
    assert len(KMeans(seed=seed)(points).weights) == 1


def test_the_effective_sample_size_counts_not_the_count() -> None:
    """Two places that 2,000 particles tell apart; with the weight on six of them there is no evidence of two."""
    rng = np.random.default_rng(5)
    points = rng.normal(size=(2000, 2))
    points[1000:, 0] += 8.0
    weights = np.full(2000, 1e-6)
    assert len(KMeans()(points, None).weights) == 2
    weights[[1, 2, 3, 1001, 1002, 1003]] = 1.0
    assert len(KMeans()(points, weights).weights) == 1


def test_copies_of_one_particle_are_one_place() -> None:
    """After resampling a set may be many copies of a few: below the resolution they are one hypothesis."""
    points = np.repeat([[0.0, 0.0], [0.01, 0.0], [50.0, 0.0], [50.0, 0.02]], 500, axis=0)
    found = KMeans(resolution=[0.1, 0.1])(points)
    np.testing.assert_allclose(found.weights, [0.5, 0.5])
    np.testing.assert_allclose(np.sort(found.means[:, 0]), [0.005, 50.0], atol=1e-6)
    alone = KMeans()(np.ones((100, 2)))
    np.testing.assert_allclose(alone.means, [[1.0, 1.0]], atol=1e-6)


def test_a_tiny_place_is_left_out_and_said() -> None:
    rng = np.random.default_rng(6)
    points = rng.normal(size=(10_000, 2))
    points[:60] += 100.0
    kept = KMeans(least_weight=0.0)(points)
    assert len(kept.weights) == 2
    found = KMeans(least_weight=0.01)(points)
    assert len(found.weights) == 1
    assert found.left_out == pytest.approx(0.006, abs=1e-9)
    assert math.sqrt(found.covariances[0, 0, 0]) == pytest.approx(1.0, rel=0.05)


def test_the_heaviest_comes_first_and_the_same_comes_again() -> None:
    points = three_places(3000)
    one, other = KMeans(seed=9)(points, None, HEADED), KMeans(seed=9)(points, None, HEADED)
    assert (np.diff(one.weights) <= 0.0).all()
    assert one.weights.tobytes() == other.weights.tobytes()
    assert one.covariances.tobytes() == other.covariances.tobytes()


def test_no_more_components_than_allowed() -> None:
    points = three_places(3000)
    assert len(KMeans(most=2)(points, None, HEADED).weights) <= 2
    assert len(KMeans(most=1)(points, None, HEADED).weights) == 1


def test_a_particle_filter_is_clustered_as_it_is() -> None:
    """Columns and weights are read where they lie, not copied and not written to."""
    points = three_places(6000, seed=7)
    motion = Unicycle(0.1, 0.02, 1e-4, 1e-4)
    belief = ParticleFilter(motion, capacity=8000, seed=7)
    belief.initialize(
        {
            "north": points[:, 0],
            "east": points[:, 1],
            "heading": points[:, 2],
            "gyro_bias": np.zeros(6000),
            "odometry_scale": np.ones(6000),
        }
    )
    before = belief.columns.copy()
    clusters = Clusters([False, False, True])
    found = clusters.extract(belief.columns[:3], belief.weights, belief.count)
    np.testing.assert_array_equal(belief.columns, before)
    expected = KMeans(sample=2048)(points[:, :3], None, [False, False, True])
    np.testing.assert_allclose(found.weights, expected.weights, atol=1e-3)
    np.testing.assert_allclose(found.means, expected.means, atol=0.02)
    mean, covariance = found.moments()
    whole = belief.moments()
    np.testing.assert_allclose(mean, whole.mean[:3], atol=0.01)
    # a heading that crosses the far side carries 2 pi times 20 m into the covariance: 5 errors of its frequency
    np.testing.assert_allclose(covariance, whole.pose_covariance, rtol=0.02, atol=1.0)
    few = clusters.extract(belief.columns[:3], belief.weights, 300)
    assert len(few.weights) == 3


@pytest.mark.parametrize(
    "parameters",
    [
        {"circular": []},
        {"most": 0},
        {"sample": 0},
        {"least_weight": 1.0},
        {"scales": [1.0]},
        {"scales": [1.0, 0.0]},
        {"resolution": [1.0, math.nan]},
    ],
)
def test_parameters_that_make_no_sense_are_refused(parameters: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="clusters"):
        Clusters(**({"circular": [False, False]} | parameters))  # type: ignore[arg-type]


def test_columns_that_make_no_sense_are_refused() -> None:
    clusters = Clusters([False, False])
    columns, weights = np.zeros((2, 10), np.float32), np.ones(10, np.float32)
    for bad in ((columns[:1], weights, 10), (columns, weights, 11), (columns, weights, 0)):
        with pytest.raises(ValueError, match="columns"):
            clusters.extract(*bad)
    with pytest.raises(ValueError, match="positive"):
        clusters.extract(columns, np.zeros(10, np.float32), 10)
    with pytest.raises(ValueError, match="finite"):
        clusters.extract(np.full((2, 10), np.nan, np.float32), weights, 10)


def test_one_hump_is_one_hypothesis() -> None:
    """Six sets of a thousand particles of one Gaussian: the evidence pays for no second component."""
    for seed in range(6):
        columns = np.random.default_rng(seed).normal(size=(2, 1000)).astype(np.float32)
        found = Clusters((False, False)).extract(columns, np.ones(1000, np.float32), 1000)
        assert len(found.weights) == 1
