"""The figures of docs/filters/: python docs/figures.py [PAGE ...], all pages if none is named.

A page's script stands beside it and offers ``draw(folder)``. Each runs in a process of its own, so that no script sees
another's settings. Pictures are SVG, and are made compact on the way. ``beliefd textbook`` makes those of the textbook.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

from service.textbook.style import compact

PAGES = Path(__file__).parent / "filters"
DRAW = """
import pathlib, runpy, sys
runpy.run_path(sys.argv[1])["draw"](pathlib.Path(sys.argv[2]))
"""


def main(names: list[str]) -> None:
    """Draw the figures of the named pages."""
    for name in names or sorted(script.stem for script in PAGES.glob("*.py")):
        print(f"docs/filters/{name}.py", flush=True)
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run([sys.executable, "-c", DRAW, PAGES / f"{name}.py", folder], check=True)
            for picture in sorted(Path(folder).iterdir()):
                text = picture.read_text(encoding="utf-8")
                (PAGES / picture.name).write_text(compact(text), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
