"""Kernels are compiled once, then linked from one file; and whatever is wrong with that, they are there."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SOURCE = """
from filters.kernels import kernel

@kernel("float64(float64[::1])")
def mean(values):
    if len(values) == 0:
        raise ValueError("no values")
    total = 0.0
    for value in values:
        total += value
    return total / len(values)
"""
CODE = """
import logging, sys
import numpy as np
from service import kernels, machine_code
logging.basicConfig()
{before}
kernels._warm(lambda: ['own'], lambda name, done, count: None)
from filters.kernels import gather
import own
loaded = own.mean.stats.cache_hits or own.mean.stats.cache_misses
print('loaded' if loaded else 'linked', own.mean(np.array([1.0, 2.0, 6.0])))
try:
    own.mean(np.zeros(0))
except ValueError as error:
    print(error)
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "own.py").write_text(SOURCE)
    return tmp_path


def started(folder: Path, before: str = "") -> tuple[str, str]:
    """Start a process that needs the kernel; return how it came, and what was complained about."""
    done = subprocess.run(
        [sys.executable, "-c", CODE.format(before=before)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder / "cache"), "PYTHONPATH": f"{folder}:{ROOT}"},
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    how, mean, *error = done.stdout.split(maxsplit=2)
    assert (float(mean), error) == (3.0, ["no values\n"])
    return how, done.stderr


def files(folder: Path) -> list[Path]:
    return list((folder / "cache").glob("linked-*"))


def test_the_second_start_links(folder: Path) -> None:
    assert started(folder) == ("loaded", "")
    assert [path.suffix for path in files(folder)] == [".pickle"]
    assert started(folder) == ("linked", "")


def test_a_damaged_file_is_said_and_made_anew(folder: Path) -> None:
    started(folder)
    (path,) = files(folder)
    path.write_bytes(path.read_bytes()[:-100])
    how, said = started(folder)
    assert how == "loaded"
    assert str(path) in said
    assert started(folder) == ("linked", "")


def test_a_source_that_has_changed_is_compiled(folder: Path) -> None:
    started(folder)
    (folder / "own.py").write_text(SOURCE.replace("total / len(values)", "total / len(values) * 1.0"))
    assert started(folder) == ("loaded", "")
    assert started(folder) == ("linked", "")


def test_what_ends_the_linker_is_not_kept(folder: Path) -> None:
    before = """
from filters.kernels import linking
library = linking.library
def spoilt(kernels):
    made = library(kernels)
    (code,) = made.codes
    missing = code._replace(text=code.text.replace(b"PyFloat_FromDouble", b"PyFloat_FromNothin"))
    return made._replace(codes=(missing,))
linking.library = spoilt
"""
    how, said = started(folder, before)
    assert how == "loaded"
    assert "they cannot be linked" in said
    assert not files(folder)


def test_a_folder_that_cannot_be_written_to_costs_a_warning(folder: Path) -> None:
    how, said = started(folder, "machine_code._file = lambda folder: folder / 'gone' / 'linked'")
    assert how == "loaded"
    assert "not kept" in said
