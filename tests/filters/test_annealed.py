"""The annealed sampler against closed forms: a Gaussian needle, two humps, an angle, and the evidence of each."""

import math

import numpy as np
import pytest

from filters.annealed import AnnealedSampler

N = 4000


def _log_normal(x, mean, sigma):
    return -0.5 * (((x - mean) / sigma) ** 2).sum(axis=1) - np.log(sigma * math.sqrt(2 * math.pi)).sum()


def _box(half, dimension=2):
    """A uniform density over a cube about zero: its logarithm, and draws of it."""
    volume = (2 * half) ** dimension

    def log(x):
        return np.where((np.abs(x) <= half).all(axis=1), -math.log(volume), -math.inf)

    return log, lambda rng, n: rng.uniform(-half, half, (n, dimension))


def test_a_needle_in_a_field_is_found_with_its_moments_and_its_evidence():
    """Prior uniform over 200 m square, likelihood of sigma 0.1 m: 1 of 640,000 of the area.

    Means and variances within 5 standard errors (2,000 effective points), evidence within 0.15 of log(1 / area).
    """
    rng = np.random.default_rng(5)
    log_start, draw = _box(100.0)
    mean, sigma = np.array([31.0, -57.0]), np.array([0.1, 0.1])
    sampler = AnnealedSampler(
        draw(rng, N), log_start, lambda x: log_start(x) + _log_normal(x, mean, sigma), rng
    )
    sampler.finish()
    effective = N / 2
    assert np.abs(sampler.points.mean(axis=0) - mean).max() < 5 * 0.1 / math.sqrt(effective)
    assert sampler.points.var(axis=0) == pytest.approx(sigma**2, rel=5 * math.sqrt(2 / effective))
    assert sampler.log_evidence == pytest.approx(-math.log(200.0**2), abs=0.15)


def test_two_humps_keep_their_weights():
    """Humps of 0.3 and 0.7, 80 m apart: the share within 0.08, more than 4 standard deviations over seeds."""
    log_start, draw = _box(60.0)
    rng = np.random.default_rng(6)

    def log_target(x):
        one = math.log(0.3) + _log_normal(x, np.array([-40.0, 0.0]), np.array([0.5, 0.5]))
        other = math.log(0.7) + _log_normal(x, np.array([40.0, 0.0]), np.array([0.5, 2.0]))
        return log_start(x) + np.logaddexp(one, other)

    sampler = AnnealedSampler(draw(rng, N), log_start, log_target, rng)
    sampler.finish()
    right = sampler.points[:, 0] > 0
    assert right.mean() == pytest.approx(0.7, abs=0.08)
    assert sampler.points[right, 1].std() == pytest.approx(2.0, rel=0.1)
    assert sampler.log_evidence == pytest.approx(-2 * math.log(120.0), abs=0.15)


def test_an_angle_is_closed_on_itself():
    """A von Mises target about pi: points on both sides of the cut, circular variance as the Bessel functions say."""
    rng = np.random.default_rng(7)
    start = rng.uniform(-math.pi, math.pi, (N, 1))
    kappa = 20.0
    sampler = AnnealedSampler(
        start,
        lambda x: np.full(len(x), -math.log(2 * math.pi)),
        lambda x: kappa * np.cos(x[:, 0] - math.pi),
        rng,
        wraps=(0,),
    )
    sampler.finish()
    assert (np.abs(sampler.points) <= math.pi).all()
    mean = np.exp(1j * sampler.points[:, 0]).mean()
    i0, i1 = (float(np.trapezoid(np.exp(kappa * np.cos(t)) * f, t)) for t, f in _bessel())
    assert abs(mean) == pytest.approx(i1 / i0, abs=0.003)
    assert abs(math.remainder(np.angle(mean) - math.pi, 2 * math.pi)) < 0.03
    assert sampler.log_evidence == pytest.approx(math.log(i0), abs=0.1)


def _bessel():
    t = np.linspace(-math.pi, math.pi, 20001)
    return (t, np.ones_like(t)), (t, np.cos(t))


def test_the_work_comes_in_pieces_and_the_same_seed_gives_the_same_bytes():
    log_start, draw = _box(10.0)
    asked = []

    def log_target(x):
        asked.append(len(x))
        return _log_normal(x, np.zeros(2), np.ones(2))

    def run():
        rng = np.random.default_rng(8)
        sampler = AnnealedSampler(draw(rng, 500), log_start, log_target, rng, piece=64)
        before = len(asked)
        while not sampler.advance():
            assert len(asked) - before <= 1
            before = len(asked)
        return sampler.points.tobytes(), sampler.log_evidence

    assert run() == run()
    assert max(asked) <= 64


def test_a_target_that_is_nowhere_has_no_evidence():
    log_start, draw = _box(1.0)
    rng = np.random.default_rng(9)
    sampler = AnnealedSampler(draw(rng, 50), log_start, lambda x: np.full(len(x), -math.inf), rng)
    sampler.finish()
    assert sampler.log_evidence == -math.inf
    assert sampler.done


@pytest.mark.parametrize("points", [np.zeros((7, 2)), np.zeros(20), np.full((20, 2), np.nan)])
def test_points_that_are_none_are_refused(points):
    with pytest.raises(ValueError, match="at least 8 finite points"):
        AnnealedSampler(points, lambda x: x[:, 0], lambda x: x[:, 0], np.random.default_rng(0))


def test_a_piece_has_at_least_one_point():
    with pytest.raises(ValueError, match="piece"):
        AnnealedSampler(
            np.zeros((20, 2)), lambda x: x[:, 0], lambda x: x[:, 0], np.random.default_rng(0), piece=0
        )
