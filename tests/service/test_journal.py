"""The log's form: for the journal by priority, for a terminal in words."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
SAY = """
import logging, sys
sys.path.insert(0, sys.argv[1])
from service.journal import write_log
write_log()
logging.getLogger("x").info("fine")
logging.getLogger("x").error("two\\nlines")
"""


def said(**environment: str) -> list[str]:
    result = subprocess.run(
        [sys.executable, "-c", SAY, str(ROOT)], stderr=subprocess.PIPE, text=True, check=True, env=environment
    )
    return result.stderr.splitlines()


def test_every_line_has_its_priority_in_the_journal() -> None:
    assert said(JOURNAL_STREAM="8:1") == ["<6>fine", "<3>two", "<3>lines"]


def test_a_terminal_reads_time_and_level() -> None:
    first = said()[0]
    assert first.endswith(" INFO fine")
    assert first[2] == first[5] == ":"
