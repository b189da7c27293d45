"""Kernels that are linked are those that numba loads: each case in processes of its own, as a kernel is made once."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
MODULES = "['filters.particle', 'filters.motion', 'filters.sensing', 'filters.kernels.kalman']"
COMPILED = f"""
import pickle, sys
from pathlib import Path
from filters.kernels import compile_all, gather
kernels = gather({MODULES})
compile_all(())
"""
KEPT = """
from filters.kernels.linking import library
Path(sys.argv[1]).write_bytes(pickle.dumps(library(kernels)))
"""
LINKED = f"""
import pickle, sys
from pathlib import Path
from filters.kernels import compile_all, gather
from filters.kernels.linking import link
kernels = gather({MODULES})
made = pickle.loads(Path(sys.argv[1]).read_bytes())
"""
ALL_LINKED = """
assert link(kernels, made)
assert not any(kernel.dispatcher.stats.cache_hits or kernel.dispatcher.stats.cache_misses for kernel in kernels)
"""
STEPS = """
import numpy as np
from filters.motion import Unicycle, UnicycleControl
from filters.particle import ParticleFilter
from filters.sensing import Range, RangeMeasurement
belief = ParticleFilter(Unicycle(.5, .2, 1e-2, 1e-2), capacity=500, seed=1)
belief.initialize({name: np.linspace(-1., 1., 400) for name in belief.names})
for _ in range(5):
    belief.predict(UnicycleControl(.5, .1), .1)
    belief.weigh(Range(.5), RangeMeasurement(3., 2., 2.))
    moments = belief.moments()
    belief.resample(450)
print(moments.mean.tobytes().hex(), belief.cloud(450).tobytes().hex())
"""


def python(code: str, path: Path) -> str:
    done = subprocess.run(
        [sys.executable, "-c", code, str(path)],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with the machine code of some kernels."""
    path = tmp_path_factory.mktemp("linking") / "library"
    python(COMPILED + KEPT, path)
    return path


def test_linked_kernels_say_the_same_to_the_bit(path: Path) -> None:
    said = python(LINKED + ALL_LINKED + STEPS, path)
    assert len(said) > 10_000
    assert said == python(COMPILED + STEPS, path)


def test_a_linked_kernel_converts_and_refuses_as_any_other(path: Path) -> None:
    call = """
import numpy as np
from filters.kernels import weights
logs = np.array([1., 7., -3.], np.float32)
print(weights.peak(logs, 0, 3), weights.peak(logs, np.int32(0), True), weights.peak.direct(logs, 2, 3))
for wrong in (logs.astype(float), logs[::2], None):
    try:
        weights.peak(wrong, 0, 1)
    except TypeError:
        print('refused')
"""
    said = python(LINKED + ALL_LINKED + call, path)
    assert said.split() == ["7.0", "1.0", "-3.0", *["refused"] * 3]
    assert said == python(COMPILED + call, path)


def test_what_is_not_valid_is_not_linked_and_numba_loads_all(path: Path) -> None:
    refused = """
first, *others = made.codes
for wrong in (
    made._replace(codes=tuple(others)),
    made._replace(platform=(*made.platform[:-1], 'another processor')),
    made._replace(codes=(first._replace(stamp=(0.0, 1)), *others)),
):
    assert not link(kernels, wrong)
    assert not any(kernel.compiled for kernel in kernels)
compile_all(())
assert all(kernel.dispatcher.stats.cache_hits for kernel in kernels)
"""
    python(LINKED + refused + STEPS, path)


def test_what_is_compiled_is_not_linked_again(path: Path) -> None:
    python(LINKED + "kernels[3].compile()\nassert not link(kernels, made)\n", path)


def test_a_kernel_that_is_not_in_the_cache_has_no_machine_code_to_keep(path: Path) -> None:
    code = """
import pytest
from filters.kernels.linking import library
kernels[0].signature = 'void(float64)'
with pytest.raises(LookupError, match=kernels[0].name):
    library(kernels)
"""
    python(COMPILED + code, path)
