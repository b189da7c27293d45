"""The byte code that is kept is the one that Python takes."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from service import bytecode


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A package of two modules, one of them in a package of its own."""
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("__init__", "deep/__init__", "deep/module"):
        file = tmp_path / "package" / f"{name}.py"
        file.parent.mkdir(exist_ok=True)
        file.write_text("VALUE = 1\n")
    return tmp_path / "package"


def translated(package: Path) -> int:
    """Return how many of the package's modules an import has to translate."""
    said = subprocess.run(
        [sys.executable, "-v", "-c", "import package.deep.module"],
        cwd=package.parent,
        env=os.environ | {"PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=True,
        timeout=60,
    ).stderr
    return len(re.findall(rf"# code object from {re.escape(str(package))}/.*\.py\n", said))


def test_what_is_kept_is_not_translated_again(package: Path) -> None:
    assert translated(package) == 3
    assert translated(package) == 3
    assert bytecode.keep(["package"])
    assert translated(package) == 0


def test_a_module_that_has_changed_is_translated_again(package: Path) -> None:
    bytecode.keep(["package"])
    file = package / "deep" / "module.py"
    file.write_text("VALUE = 1 + 1\n")
    os.utime(file, (2e9, 2e9))  # the time is kept in whole seconds
    assert translated(package) == 1
    bytecode.keep(["package"])
    assert translated(package) == 0


def _wrong(package: Path) -> None:
    (package / "deep" / "module.py").write_text("def\n")


def _closed(package: Path) -> None:
    (package / "deep" / "__pycache__").write_text("no folder")


@pytest.mark.parametrize("spoil", [_wrong, _closed])
def test_what_cannot_be_kept_is_no_error(package: Path, spoil: Callable[[Path], None]) -> None:
    spoil(package)
    assert not bytecode.keep(["package"])
    assert (package / "__pycache__").is_dir()


def test_a_package_that_is_not_there_is_passed_over() -> None:
    assert bytecode.keep(["no_such_package"])
