"""What this machine affords, by ``beliefd bench``, into its section of docs/performance.md with its picture."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

from report import ROOT, machine, write

PICTURE = "performance-bench.svg"


def main() -> None:
    command = [sys.executable, "-c", "from service.cli import main; main()", "bench", "--json"]
    command += ["--plot", str(ROOT / "docs" / PICTURE)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    write("bench", table(json.loads(done.stdout)))


def table(found: dict[str, Any]) -> str:
    lines = [f"![Processor time per tick against the particle count, with the budgets]({PICTURE})", ""]
    lines += ["| particles | tick µs, median (least to greatest of 3) | ns per particle |", "|---|---|---|"]
    lines += [
        f"| {row['particles']:,} | {row['tick_us']:,.0f} ({row['least_us']:,.0f} to {row['most_us']:,.0f}) "
        f"| {1e3 * row['tick_us'] / row['particles']:.1f} |"
        for row in found["counts"]
    ]
    lines += ["", "| stage, every tick | overhead µs | ns per particle |", "|---|---|---|"]
    lines += [
        f"| {stage} | {line['overhead_us']:.0f} | {line['ns_per_particle']:.1f} |"
        for stage, line in found["stages"].items()
    ]
    lines += ["", "| rate, Hz | budget at 40 % of a processor, ms | particles inside it |", "|---|---|---|"]
    lines += [
        f"| {row['rate']:g} | {row['budget_ms']:g} | {row['particles']:,} |" for row in found["affords"]
    ]
    return "\n".join([*lines, "", f"Machine: {machine()}. By `python benchmarks/afford.py`."])


if __name__ == "__main__":
    main()
