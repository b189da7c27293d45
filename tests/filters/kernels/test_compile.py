"""The doorway to numba: explicit signatures, and an installation step that shows its progress."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from filters.kernels import weights
from filters.kernels.compile import compile_all, every_module


def test_progress_counts_every_kernel() -> None:
    told: list[tuple[str, int, int]] = []
    total = compile_all(every_module(), lambda name, index, total: told.append((name, index, total)))
    assert [index for _, index, _ in told] == list(range(total + 1))
    assert {count for _, _, count in told} == {total}
    assert told[-1] == ("", total, total)
    names = {name for name, _, _ in told[:-1]}
    assert len(names) == total
    assert {
        "filters.motion.unicycle.roll",
        "filters.sensing.range.robust",
        "filters.kernels.weights.peak",
    } <= names


def test_a_kernel_refuses_other_types() -> None:
    with pytest.raises(TypeError):
        weights.peak(np.zeros(3, np.float64), 0, 3)  # pyright: ignore[reportArgumentType]


def test_a_direct_call_is_the_same_kernel() -> None:
    """Also where the kernel was only noted at its import and compiled by ``compile_all``, as in the daemon."""
    logs = np.array([1.0, 7.0, -3.0], np.float32)
    assert weights.peak.direct(logs, 0, 3) == weights.peak(logs, 0, 3) == 7.0
    code = (
        "from filters.kernels.compile import compile_all\n"
        "compile_all(['filters.sensing.range'])\n"
        "from filters.sensing import range\n"
        "assert 'Dispatcher' not in type(range.gaussian.direct).__name__, type(range.gaussian.direct)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, cwd=Path(__file__).parents[3])


STEP = """
import numpy as np
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import *
from filters.kld import Demand
n = 60
rng = np.random.default_rng(1)
belief = ParticleFilter(Unicycle(.5, .2, 1e-2, 1e-2), capacity=100, seed=1, block=25)
belief.initialize(dict(north=rng.normal(size=n), east=rng.normal(size=n), heading=rng.normal(size=n),
                       gyro_bias=np.zeros(n), odometry_scale=np.ones(n)))
for count in (50, 70):
    belief.predict(UnicycleControl(.5, .1), .1)
    belief.weigh(Range(.5), RangeMeasurement(3., 2., 2.))
    belief.weigh(Range(.5, outliers=0.), RangeMeasurement(3., 2., 2.))
    belief.weigh(Position(.5), PositionMeasurement(.5, 0.))
    belief.weigh(Velocity(.5), VelocityMeasurement(5., 0., 5.))
    belief.weigh(Heading(.5), HeadingMeasurement(.1))
    moments = belief.moments()
    belief.resample(count)
    belief.cloud(10)
print(Demand(.5, .5).bins(belief), *moments.mean, *moments.pose_covariance.ravel())
"""


def test_kernels_are_plain_python_too() -> None:
    """Every kernel, interpreted and compiled, says the same to the rounding of fused operations."""
    said: list[list[float]] = []
    for setting in ("0", "1"):
        done = subprocess.run(
            [sys.executable, "-W", "ignore::RuntimeWarning", "-c", STEP],
            env={**os.environ, "NUMBA_DISABLE_JIT": setting, "PYTHONPATH": str(Path(__file__).parents[3])},
            capture_output=True,
            text=True,
            check=True,
            timeout=120,
        )
        said.append([float(word) for word in done.stdout.split()])
    np.testing.assert_allclose(said[1], said[0], rtol=1e-3, atol=1e-5)
