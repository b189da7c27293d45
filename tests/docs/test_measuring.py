"""Scripts that measure side by side lose nothing of each other's, in the page and in what is kept."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
TIMES = 60
WRITER = """
import sys
from pathlib import Path
import measuring
measuring.PAGE, measuring.KEPT = Path(sys.argv[1]), Path(sys.argv[2])
name = sys.argv[3]
said = {"summary": {"nees_bounds": [0, 0], "checks": {}}, "runs": [{"levels": []}]}
print("ready", flush=True)
sys.stdin.readline()
for turn in range(int(sys.argv[4])):
    with measuring.alone():
        measuring.put((f"<{name}>", f"</{name}>"), f"{name} {turn}")
    measuring.keep(name, str(turn), said, ["replay"])
"""


def writer(page: Path, kept: Path, name: str) -> subprocess.Popen[str]:
    command = [sys.executable, "-c", WRITER, str(page), str(kept), name, str(TIMES)]
    return subprocess.Popen(command, cwd=DOCS, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def test_two_that_write_at_once_keep_each_others_blocks(tmp_path: Path) -> None:
    page, kept = tmp_path / "page.md", tmp_path / "kept.json"
    page.write_text("before\n<one></one>\nbetween\n<two></two>\nafter\n")
    writers = [writer(page, kept, name) for name in ("one", "two")]
    for process in writers:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in writers:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in writers:
        process.communicate(timeout=60)
        assert process.returncode == 0
    last = TIMES - 1
    blocks = [f"<{name}>\n{name} {last}\n</{name}>\n" for name in ("one", "two")]
    assert page.read_text() == f"before\n{blocks[0]}between\n{blocks[1]}after\n"
    turns = [str(turn) for turn in range(TIMES)]
    assert {name: list(of) for name, of in json.loads(kept.read_text()).items()} == {
        "one": turns,
        "two": turns,
    }
    assert {path.name for path in tmp_path.iterdir()} == {"page.md", "kept.json"}
