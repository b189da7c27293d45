"""What a replay writes: one CSV row per tick, the same bytes for the same samples, seed and counts."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

from drivers.sample import SECOND
from service.estimate import Estimate

HEADER = (
    "time_s,north_m,east_m,down_m,heading_rad,vn,ve,vd,cov_nn,cov_ne,cov_ee,cov_dd,var_heading,radius95_m,"
    "health,reason,level,hypotheses,particles,demanded,afforded,ess,reset_counter"
)


def _cell(value: float | None, digits: int) -> str:
    return "" if value is None else f"{value:.{digits}f}"


def row(estimate: Estimate, unix: int) -> str:
    """Return ``estimate`` as one line of CSV; what is unknown is empty. ``unix``: its time, nanoseconds."""
    e = estimate
    covariance = e.position_covariance
    cells = (
        f"{unix // SECOND}.{unix % SECOND // 1000:06d}",
        *(_cell(value, 4) for value in e.position),
        _cell(e.heading, 6),
        *(_cell(value, 4) for value in e.velocity),
        *(_cell(covariance[i], 6) for i in (0, 1, 3, 5)),
        _cell(e.heading_variance, 8),
        _cell(e.radius95, 4),
        e.health.value,
        '"' + e.reason.replace('"', "'") + '"',
        str(e.level),
        str(e.hypotheses),
        str(e.particles),
        str(e.demanded),
        str(e.afforded),
        _cell(e.effective_sample_size, 1),
        str(e.reset_counter),
    )
    return ",".join(cells)


class EstimateFile:
    """A CSV file of estimates, one row per tick; a context manager."""

    def __init__(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self._file = path.open("w", newline="\n")
        self._file.write(HEADER + "\n")

    def write(self, estimate: Estimate, unix: int) -> None:
        """Append one tick."""
        self._file.write(row(estimate, unix) + "\n")

    def __enter__(self) -> EstimateFile:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._file.close()
