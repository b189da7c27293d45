"""What the stages of a tick cost on this machine, measured once and kept beside the compiled kernels.

A rehearsal takes a good part of a start. So its result is kept, in a file for each configuration (for what a tick can
cost of it), in a folder for each version of the kernels and processor. The next start only touches what a tick needs.
That the machine was busy when it was measured does not matter: the governor learns the costs in operation as multiples
of these.
"""

from __future__ import annotations

import hashlib
import logging
import os
from math import isfinite
from pathlib import Path

import msgspec

from service.config import Configuration
from service.rehearsal import rehearse, touch
from service.tick_costs import Line

_PREFIX = "cost"
"""Changes when the shapes' meaning does: what an older version has kept is not taken for this one's."""

_COSTLESS: dict[str, bool | set[str]] = {
    "vehicle": {"name"},
    "origin": True,
    "start": True,
    "link": True,
    "loop": {"priority", "cpus"},
    "publish": True,
    "state": True,
}
"""What of a configuration a rehearsal does not use: who changes it need not wait for another."""

_KEPT = 16
"""Files that a folder keeps: the newest."""

_log = logging.getLogger(__name__)


def shapes_of(configuration: Configuration, folder: Path) -> dict[str, Line]:
    """Return the shapes that ``folder`` has for ``configuration``, or measure and keep them.

    Either way every kernel, import and page that a tick needs has been used once.
    """
    path = folder / f"{_PREFIX}-{_digest(configuration)}.json"
    touch(configuration)
    kept = _read(path)
    if kept:
        return kept
    shapes = rehearse(configuration)
    _keep(path, shapes)
    return shapes


def _digest(configuration: Configuration) -> str:
    costly = configuration.model_dump_json(exclude=_COSTLESS)
    return hashlib.sha256(costly.encode()).hexdigest()[:12]


def _read(path: Path) -> dict[str, Line]:
    """Return what a file says; nothing if there is none, or none that can be believed."""
    try:
        shapes = msgspec.json.decode(path.read_bytes(), type=dict[str, Line])
    except (OSError, msgspec.DecodeError):
        return {}
    whole = all(
        isfinite(shape.at(1)) and shape.constant >= 0.0 and shape.slope >= 0.0 and shape.at(1) > 0.0
        for shape in shapes.values()
    )
    return shapes if whole else {}


def _keep(path: Path, shapes: dict[str, Line]) -> None:
    """Write a file at once or not at all, and remove the oldest; without it the next start measures again."""
    part = path.with_suffix(f".{os.getpid()}")
    try:
        part.write_bytes(msgspec.json.encode(shapes))
        part.replace(path)
        newest = sorted(
            path.parent.glob(f"{_PREFIX}-*.json"), key=lambda found: found.stat().st_mtime, reverse=True
        )
        for stale in newest[_KEPT:]:
            stale.unlink(missing_ok=True)
    except OSError as error:
        _log.warning("loop: what the rehearsal measured is not kept: %s", error)
