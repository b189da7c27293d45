"""The newest line of a truth file that is still being written."""

from __future__ import annotations

from pathlib import Path

from service.view.plot import Point


class TruthTail:
    """Follows a truth file (``time_s, north_m, east_m, …``) from the outside.

    Parameters
    ----------
    path : Path
        The file; it need not exist yet.
    """

    _WINDOW = 512

    def __init__(self, path: Path) -> None:
        self._path = path

    def latest(self) -> Point | None:
        """Return north and east of the last whole line, or ``None`` while there is none."""
        try:
            with self._path.open("rb") as file:
                size = file.seek(0, 2)
                file.seek(max(0, size - self._WINDOW))
                lines = file.read().split(b"\n")[:-1]
        except FileNotFoundError:
            return None
        fields = lines[-1].split(b",") if lines else []
        try:
            return float(fields[1]), float(fields[2])
        except (IndexError, ValueError):
            return None
