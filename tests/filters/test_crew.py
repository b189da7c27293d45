"""A crew changes no bit, and every part of the work is done once."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.belief import Displacement
from filters.crew import ALIGNMENT, Blocks
from filters.motion import RandomWalk, Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import (
    Heading,
    HeadingMeasurement,
    Position,
    PositionMeasurement,
    Range,
    RangeMeasurement,
    Velocity,
    VelocityMeasurement,
)

TWO_RANGES = (RangeMeasurement(4.9, 3.0, 4.0), RangeMeasurement(5.2, -4.0, 3.0))


class Backwards:
    """A crew whose last member is always the first."""

    def __init__(self, threads: int) -> None:
        self.threads = threads
        self.fewest = 0
        self.calls = 0

    def run(self, task: Callable[[int], None]) -> None:
        self.calls += 1
        for part in reversed(range(self.threads)):
            task(part)


def history(crew: Backwards | None, counts: tuple[int, ...], block: int) -> bytes:
    belief = ParticleFilter(
        Unicycle(0.5, 0.2, 1e-3, 1e-3, gyro_bias_sigma=0.01, odometry_scale_sigma=0.01),
        capacity=max(counts),
        seed=3,
        block=block,
        crew=crew,
        slow=[RandomWalk("range_bias", 0.01)],
    )
    rng = np.random.default_rng(1)
    belief.initialize({name: rng.normal(0.1, 0.5, counts[0]) for name in belief.names})
    said: list[bytes] = []
    for count in counts:
        belief.predict(UnicycleControl(0.1, 0.05), 0.2)
        evidence = [
            belief.weigh(Range(0.4, outliers=0.0), RangeMeasurement(5.0, 3.0, 4.0)),
            belief.weigh(Range(0.4, bias="range_bias"), RangeMeasurement(5.0, -3.0, 4.0)),
            belief.weigh(Position(2.0), PositionMeasurement(0.1, 0.1)),
            belief.weigh(Velocity(1.0), VelocityMeasurement(0.5, 0.1, 0.5)),
            belief.weigh(Heading(0.5), HeadingMeasurement(0.3)),
            *belief.weigh_all(Range(0.4, outliers=0.0), TWO_RANGES),
            *belief.weigh_all(Range(0.4, bias="range_bias"), TWO_RANGES),
        ]
        moments = belief.moments(Displacement(0.1, 0.0, 0.02))
        said += [np.array(evidence).tobytes(), moments.mean.tobytes(), moments.pose_covariance.tobytes()]
        said += [moments.variance.tobytes(), belief.weights.tobytes()]
        belief.resample(count)
        said.append(belief.columns[:, :count].tobytes())
    return b"".join(said)


@pytest.mark.parametrize("block", [1000, 16384])
@pytest.mark.parametrize("threads", [2, 3, 5])
def test_the_same_bytes_for_any_number_of_threads(threads: int, block: int) -> None:
    """Counts and blocks that no vector's width divides."""
    counts = (20_011, 20_011, 7_777, 300, 19_999)
    crew = Backwards(threads)
    assert history(crew, counts, block) == history(None, counts, block)
    assert crew.calls > 20


def test_a_collapse_is_the_same() -> None:
    belief = ParticleFilter(Unicycle(0.1, 0.1, 0.0, 0.0), capacity=5000, seed=1, crew=Backwards(2))
    belief.initialize({name: np.zeros(5000) for name in belief.names})
    belief.weigh(Position(1e-30, outliers=0.0), PositionMeasurement(1e30, 0.0))
    belief.normalize()
    assert belief.collapses == 1
    assert belief.effective_sample_size == pytest.approx(5000.0)


@pytest.mark.parametrize("crew", [None, Backwards(2)], ids=["alone", "two"])
def test_the_largest_weight_is_not_taken_twice(crew: Backwards | None) -> None:
    """Normalising once more changes nothing, and nor does it after a resampling that nothing was weighed since."""
    belief = ParticleFilter(Unicycle(0.1, 0.1, 0.0, 0.0), capacity=5000, seed=1, crew=crew, block=1000)
    belief.initialize({name: np.linspace(-1.0, 1.0, 5000) for name in belief.names})
    belief.weigh_all(Range(0.05, outliers=0.0), TWO_RANGES)
    belief.normalize()
    weights, size = belief.weights.copy(), belief.effective_sample_size
    assert weights.max() == pytest.approx(1.0)
    belief.normalize()
    assert np.array_equal(belief.weights, weights)
    assert belief.effective_sample_size == size
    belief.weigh_all(Range(0.05, outliers=0.0), TWO_RANGES)
    belief.resample()
    belief.normalize()
    assert np.all(belief.weights == 1.0)


def test_a_crew_is_left_alone_when_it_would_not_help() -> None:
    crew = Backwards(2)
    crew.fewest = 1001
    history(crew, (1000, 900), 100)
    assert crew.calls == 0


@given(st.integers(1, 5000), st.integers(1, 6), st.sampled_from([1, 16, ALIGNMENT]), st.integers(50, 900))
@settings(deadline=None)
def test_parts_follow_on_each_other(count: int, threads: int, grain: int, largest: int) -> None:
    blocks = Blocks(largest, Backwards(threads))
    blocks.divide(count)
    parts: list[tuple[int, int, int]] = []
    blocks.split(count, grain, lambda part, first, last: parts.append((part, first, last)))
    parts.sort()
    assert parts[0][1] == 0
    assert parts[-1][2] == count
    for (_, _, end), (_, start, _) in pairwise(parts):
        assert end == start
        assert start % grain == 0
    assert blocks.pairs[-1][1] == count
    assert len(blocks.pairs) == blocks.number


@given(st.integers(1, 5000), st.integers(1, 6), st.integers(50, 900))
@settings(deadline=None)
def test_pieces_are_the_blocks_cut_where_no_vector_is(count: int, threads: int, largest: int) -> None:
    """Together they are the particles in order; each begins a multiple of the alignment into its block."""
    blocks = Blocks(largest, Backwards(threads))
    blocks.divide(count)
    if not blocks.shared:
        assert [piece.tolist() for piece in blocks.pieces] == [[list(pair) for pair in blocks.pairs]]
        return
    assert len(blocks.pieces) == threads
    everything = sorted(tuple(piece) for part in blocks.pieces for piece in part.tolist())
    assert [start for start, _ in everything] == [0, *(end for _, end in everything[:-1])]
    assert everything[-1][1] == count
    for start, end in everything:
        first, last = next((a, b) for a, b in blocks.pairs if a <= start < b)
        assert end <= last
        assert (start - first) % ALIGNMENT == 0
