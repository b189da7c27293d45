"""Sections of docs/performance.md that commands write: between markers, everything else is left as it is."""

from __future__ import annotations

import os
import platform
import re
import time
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "performance.md"


def machine() -> str:
    """Return one line: processor, cores, how busy it was, versions, day."""
    model = "unknown processor"
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            model = line.partition(":")[2].strip()
            break
    load = os.getloadavg()
    return (
        f"{model}, {os.cpu_count()} cores, {platform.machine()}, Linux {platform.release().split('-')[0]}, "
        f"Python {platform.python_version()}, {time.strftime('%Y-%m-%d')}; load average {load[0]:.1f} (1 min), "
        f"{load[1]:.1f} (5 min) at the end"
    )


def write(section: str, text: str) -> None:
    """Put ``text`` between the markers of ``section``, which the page must have."""
    page = PAGE.read_text(encoding="utf-8")
    begin, end = f"<!-- {section}: begin -->", f"<!-- {section}: end -->"
    pattern = re.compile(re.escape(begin) + ".*?" + re.escape(end), re.DOTALL)
    if not pattern.search(page):
        raise SystemExit(f"{PAGE}: no section {begin}")
    PAGE.write_text(pattern.sub(lambda _: f"{begin}\n{text.strip()}\n{end}", page), encoding="utf-8")
    print(f"{PAGE.relative_to(ROOT)}: {section}")
