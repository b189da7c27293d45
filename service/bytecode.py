"""Byte code of the daemon's own modules, so that no start translates them: a tenth of a second in each process.

Python keeps it by itself, unless it was told not to (``PYTHONDONTWRITEBYTECODE``) or may not write where the modules
are. pip makes it for an installed wheel.
"""

from __future__ import annotations

import compileall
from collections.abc import Sequence
from importlib.util import find_spec

PACKAGES = ("drivers", "filters", "service")


def keep(packages: Sequence[str] = PACKAGES) -> bool:
    """Translate the modules that have changed since; say whether all have their byte code now."""
    found = [find_spec(package) for package in packages]
    folders = [folder for spec in found if spec for folder in spec.submodule_search_locations or ()]
    done = [bool(compileall.compile_dir(folder, quiet=2)) for folder in folders]
    return all(done)
