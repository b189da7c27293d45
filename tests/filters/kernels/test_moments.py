"""Sums about a reference, and the moments made of them, against float64 numpy."""

from __future__ import annotations

import numpy as np
import pytest

from filters.kernels import moments

pytestmark = pytest.mark.interpreted


def test_sums_of_displaced_particles() -> None:
    rng = np.random.default_rng(5)
    count = 3000
    columns = np.stack(
        [rng.normal(100, 3, count), rng.normal(-50, 2, count), rng.uniform(-np.pi, np.pi, count)]
    ).astype(np.float32)
    w = rng.exponential(size=count).astype(np.float32)
    forward, right, turn, north, east, heading = 1.5, -0.5, 0.7, 99.0, -49.0, 0.3
    reference = np.array([north, east, heading, turn, 0.0])
    sums = np.zeros((2, moments.SUMS))
    centre = np.zeros((3, 1), np.float32)
    bounds = np.array([0, 1000, count])
    moments.sum_blocks(columns, w, bounds, 0, 2, forward, right, centre, reference, sums)
    a, b, c = columns.astype(np.float64)
    n = a + forward * np.cos(c) - right * np.sin(c) - north
    e = b + forward * np.sin(c) + right * np.cos(c) - east
    h = (c + turn - heading + np.pi) % (2 * np.pi) - np.pi
    terms = (np.ones(count), n, e, h, np.sin(c), np.cos(c), n * n, n * e, e * e, n * h, e * h, h * h)
    exact = np.array([np.sum(w.astype(float) * term) for term in terms])
    scale = np.array([np.sum(w.astype(float) * np.abs(term)) for term in terms])
    assert (np.abs(sums.sum(0)[:12] - exact) < 1e-5 * scale).all()
    assert sums[:, 12].max() == pytest.approx(np.abs(h).max(), abs=1e-5)


def test_sums_of_slow_columns() -> None:
    rng = np.random.default_rng(6)
    columns = rng.normal(0, 1, (5, 700)).astype(np.float32)
    w = rng.exponential(size=700).astype(np.float32)
    references = np.arange(5, dtype=np.float32)[:, None]
    sums = np.zeros(moments.SUMS + 4)
    moments.sum_slow(columns, w, 100, 700, references, sums)
    offsets = (columns.astype(float) - references)[:, 100:]
    np.testing.assert_allclose(sums[-4::2], (w[100:] * offsets).sum(1)[3:], rtol=1e-5)
    np.testing.assert_allclose(sums[-3::2], (w[100:] * offsets**2).sum(1)[3:], rtol=1e-5)
    assert (sums[: moments.SUMS] == 0.0).all()


@pytest.mark.parametrize("turn", [0.0, 2.5])
@pytest.mark.parametrize("heading", [0.0, 3.1, -2.0])
@pytest.mark.parametrize("far", [0.0, 5000.0])
def test_moments_from_any_reference(turn: float, heading: float, far: float) -> None:
    """However wrong the centre was, the moments are those of the displaced particles."""
    rng = np.random.default_rng(7)
    count, blocks = 2000, 3
    columns = rng.normal([[far], [5.0], [heading], [1.0]], 0.4, (count, 4, 1))[..., 0].T
    columns = np.ascontiguousarray(columns, np.float32)
    w = rng.exponential(size=count).astype(np.float32)
    centre = np.zeros((4, 1), np.float32)
    found, variance, covariance = np.zeros(4), np.zeros(4), np.zeros((3, 3))
    given = found, variance, covariance
    bounds = np.linspace(0, count, blocks + 1).astype(np.int64)
    sums = np.zeros((blocks, moments.SUMS + 2))
    for _ in range(2):  # the second time from the centre that the first has found
        reference = np.zeros(moments.REFERENCE)
        moments.displace_reference(centre, 2.0, -1.0, turn, reference)
        done = False
        while not done:
            moments.sum_blocks(columns, w, bounds, 0, blocks, 2.0, -1.0, centre, reference, sums)
            done = moments.finish(blocks, 2.0, -1.0, centre, reference, sums, *given)
        n, e, h, slow = columns.astype(np.float64)
        north = n + 2.0 * np.cos(h) + np.sin(h)
        east = e + 2.0 * np.sin(h) - np.cos(h)
        p = w / w.astype(np.float64).sum()
        mean = np.arctan2(p @ np.sin(h + turn), p @ np.cos(h + turn))
        turned = (h + turn - mean + np.pi) % (2 * np.pi) - np.pi
        offsets = np.stack([north - p @ north, east - p @ east, turned])
        np.testing.assert_allclose(found[:2], [p @ north, p @ east], atol=5e-4)
        assert (found[2] - mean + np.pi) % (2 * np.pi) - np.pi == pytest.approx(0.0, abs=1e-5)
        assert found[3] == pytest.approx(p @ slow, abs=1e-5)
        np.testing.assert_allclose(covariance, (offsets * p) @ offsets.T, atol=3e-4)
        assert variance[3] == pytest.approx(p @ slow**2 - (p @ slow) ** 2, rel=1e-4)


def test_one_call_is_the_same_as_its_parts() -> None:
    """To the bit, at a heading that wraps: the sums are taken anew. A crew calls the parts, one thread the whole."""
    rng = np.random.default_rng(8)
    columns = np.ascontiguousarray(rng.normal([[9.0], [5.0], [3.1], [1.0]], 0.4, (4, 2000)), np.float32)
    w = rng.exponential(size=2000).astype(np.float32)
    bounds = np.array([0, 700, 1403, 2000])
    said: list[bytes] = []
    for whole in (True, False):
        centre, reference = np.zeros((4, 1), np.float32), np.zeros(moments.REFERENCE)
        sums = np.zeros((3, moments.SUMS + 2))
        given = np.zeros(4), np.zeros(4), np.zeros((3, 3))
        if whole:
            moments.summarize(columns, w, bounds, 2.0, -1.0, 0.1, centre, reference, sums, *given)
        else:
            moments.displace_reference(centre, 2.0, -1.0, 0.1, reference)
            done = False
            while not done:
                for block in range(3):
                    moments.sum_blocks(
                        columns, w, bounds, block, block + 1, 2.0, -1.0, centre, reference, sums
                    )
                done = moments.finish(3, 2.0, -1.0, centre, reference, sums, *given)
        said.append(b"".join(array.tobytes() for array in (*given, centre)))
    assert said[0] == said[1]
