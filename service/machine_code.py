"""The kernels' machine code in one file, beside numba's cache: a start links it in a tenth of the time.

It is written when the kernels were not linked from such a file, and only once a process of its own has linked it, for a
linker that misses a symbol ends its process. Whatever is wrong with it, the kernels come from numba's cache, as they
would without it.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from filters.kernels.compile import Pending

_TRIAL = 120.0
"""Seconds that linking may take on trial."""

_log = logging.getLogger(__name__)


def link(folder: Path, kernels: Sequence[Pending]) -> bool:
    """Link kernels that are not compiled yet from the file in ``folder``; say whether they are, all of them."""
    return _linked(_file(folder), kernels)


def keep(folder: Path, kernels: Sequence[Pending]) -> None:
    """Write the machine code of kernels that are compiled, for the next start; without it that one takes longer."""
    path = _file(folder)
    part = path.with_suffix(f".{os.getpid()}")
    try:
        from filters.kernels.linking import library

        part.write_bytes(pickle.dumps(library(kernels)))
        modules = dict.fromkeys(kernel.name.rpartition(".")[0] for kernel in kernels)
        if _on_trial(part, list(modules)):
            part.replace(path)
    except Exception as error:  # noqa: BLE001  another numba may raise anything, and it is only about time
        _log.warning("kernels: their machine code is not kept in one file: %s", error)
    finally:
        part.unlink(missing_ok=True)


def _file(folder: Path) -> Path:
    """Return where the machine code of this tree's kernels is: another tree may use the same folder."""
    return folder / f"linked-{hashlib.sha256(__file__.encode()).hexdigest()[:8]}.pickle"


def _linked(path: Path, kernels: Sequence[Pending]) -> bool:
    try:
        from filters.kernels.linking import link

        content = path.read_bytes()
        return link(kernels, pickle.loads(content))  # as trustworthy as numba's cache: that is pickled, too
    except FileNotFoundError:
        return False
    except Exception as error:  # noqa: BLE001  what a damaged pickle or another numba raises is anybody's guess
        _log.warning("kernels: %s: %s", path, error)
        return False


def _on_trial(path: Path, modules: Sequence[str]) -> bool:
    done = subprocess.run(
        [sys.executable, "-m", "service.machine_code", str(path), *modules],
        capture_output=True,
        text=True,
        check=False,
        timeout=_TRIAL,
    )
    if done.returncode:
        _log.warning("kernels: they cannot be linked: %s", done.stderr.strip()[-300:])
    return done.returncode == 0


def main() -> None:
    """Link a file's kernels, those of the modules named after it; exit 0 if that goes well."""
    from filters.kernels import gather

    path, *modules = sys.argv[1:]
    sys.exit(0 if _linked(Path(path), gather(modules)) else "no")


if __name__ == "__main__":
    main()
