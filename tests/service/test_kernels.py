"""Where the compiled kernels go: each case in a process of its own, for numba reads it once."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from importlib.util import spec_from_file_location
from pathlib import Path

import pytest

from service import kernels

ROOT = Path(__file__).parents[2]
PREPARE = "from service import kernels; print(kernels.prepare())"


def prepared(code: str = PREPARE, **environment: str) -> subprocess.CompletedProcess[str]:
    clean = {
        key: value for key, value in os.environ.items() if key not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")
    }
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=False,
        cwd=ROOT,
        env=clean | environment,
        timeout=120,
    )


def test_systemds_cache_folder_comes_first_then_the_users(tmp_path: Path) -> None:
    service, user, home = tmp_path / "service", tmp_path / "user", tmp_path / "home"
    name = f"kernels-{kernels.digest()}"
    both = prepared(CACHE_DIRECTORY=f"{service}:/other", XDG_CACHE_HOME=str(user), HOME=str(home))
    assert both.stdout.strip() == str(service / name), both.stderr
    assert prepared(XDG_CACHE_HOME=str(user), HOME=str(home)).stdout.strip() == str(user / "beliefd" / name)
    assert prepared(HOME=str(home)).stdout.strip() == str(home / ".cache" / "beliefd" / name)


def test_a_folder_that_cannot_be_made_is_passed_over(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = prepared(CACHE_DIRECTORY=str(tmp_path / "file"), HOME=str(tmp_path))
    assert done.stdout.strip().startswith(str(tmp_path / ".cache"))


def test_without_a_home_it_is_the_temporary_folder(tmp_path: Path) -> None:
    done = prepared(HOME="/proc/nonexistent", TMPDIR=str(tmp_path))
    assert done.stdout.strip().startswith(f"{tmp_path}/beliefd-{os.getuid()}/kernels-")


def test_a_choice_that_is_made_already_stands(tmp_path: Path) -> None:
    assert prepared(NUMBA_CACHE_DIR=str(tmp_path)).stdout.strip() == str(tmp_path)


def test_numba_must_not_have_been_imported() -> None:
    done = prepared(f"import numba; {PREPARE}")
    assert done.returncode == 1
    assert "must run before numba is imported" in done.stderr


def test_preparing_imports_no_kernel(tmp_path: Path) -> None:
    done = prepared(
        f"{PREPARE}; import sys; print('numba' in sys.modules, 'filters' in sys.modules)", HOME=str(tmp_path)
    )
    assert done.stdout.splitlines()[1] == "False False"


def of(folder: Path, monkeypatch: pytest.MonkeyPatch, **sources: str) -> str:
    """Return the digest of a package ``filters`` of these modules."""
    package = folder / "filters"
    package.mkdir(exist_ok=True)
    (package / "__init__.py").touch()
    for name, text in sources.items():
        (package / f"{name}.py").write_text(text)
    monkeypatch.setattr(
        kernels, "find_spec", lambda name: spec_from_file_location(name, package / "__init__.py")
    )
    return kernels.digest()


KERNEL = "from filters.shared import (\n    LIMIT,\n)\n@kernel('f4(f4)')\ndef k(x): return x + LIMIT\n"


def test_the_digest_follows_the_kernels_and_what_they_import(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = of(tmp_path, monkeypatch, a=KERNEL, shared="from filters import deep", deep="LIMIT = 1", free="")
    others = {
        of(tmp_path, monkeypatch, a=KERNEL + " "),
        of(tmp_path, monkeypatch, shared="from filters import deep  # 2"),
        of(tmp_path, monkeypatch, deep="LIMIT = 2"),
    }
    assert len(others | {first}) == 4
    back = of(tmp_path, monkeypatch, a=KERNEL, shared="from filters import deep", deep="LIMIT = 1")
    assert back == first


def test_a_filter_that_holds_no_kernel_may_change(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert of(tmp_path, monkeypatch, a=KERNEL, free="x = 1") == of(tmp_path, monkeypatch, free="x = 2")


def test_the_digest_is_of_this_tree() -> None:
    assert re.fullmatch(r"[0-9a-f]{12}", kernels.digest())
    sources = kernels._sources()
    assert {"kernels/elementary.py", "kernels/compile.py", "motion/unicycle.py"} <= set(sources)
    assert sources["kernels/random.py"] == (ROOT / "filters" / "kernels" / "random.py").read_bytes()


def test_a_cache_of_an_older_version_goes_in_the_end(tmp_path: Path) -> None:
    for age, name in enumerate(["kernels-now", "kernels-b", "kernels-c", "kernels-d", "kernels-e", "other"]):
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (1e9 - age, 1e9 - age))
    kernels._prune(tmp_path / "kernels-now")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "kernels-b",
        "kernels-c",
        "kernels-now",
        "other",
    ]


def test_the_daemon_is_warmed_with_its_own_kernels_only() -> None:
    told = "told = []; kernels.warm(lambda name, done, total: told.append(name)); print(*told)"
    done = prepared(f"from service import kernels; {told}", HOME=os.environ["HOME"])
    names = done.stdout.split()
    assert "filters.sensing.range.robust" in names, done.stderr
    assert not [name for name in names if "raycast" in name or "marginal" in name], names


def test_what_no_kernel_needs_is_not_imported_and_can_be_afterwards(tmp_path: Path) -> None:
    """numba imports SciPy's linear algebra if it is there, which takes a fifth of a start."""
    source = (
        "import sys; from service import kernels; kernels.warm(lambda name, done, count: None)\n"
        "assert 'scipy.linalg' not in sys.modules and 'coverage' not in sys.modules\n"
        "import scipy.linalg; assert scipy.linalg.norm([3.0, 4.0]) == 5.0\n"
    )
    subprocess.run([sys.executable, "-c", source], check=True, timeout=300)
