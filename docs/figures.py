"""The figures of docs/filters/: python docs/figures.py [PAGE ...], all pages if none is named.

A page's script stands beside it. It offers ``FIGURES``, functions that draw by the name of the figure, and where a page
wants matplotlib set otherwise, ``STYLE``. Each runs in a process of its own, so that no script sees another's settings.
Pictures are SVG, compact and without a date. ``beliefd textbook`` makes those of the textbook.
"""

from __future__ import annotations

import argparse
import multiprocessing
import runpy
from concurrent.futures import ProcessPoolExecutor
from io import StringIO
from pathlib import Path

import matplotlib as mpl

from service.textbook.style import LOOK, compact

PAGES = Path(__file__).parent / "filters"


def draw(page: str) -> None:
    """Draw the figures of one page, beside it."""
    mpl.use("Agg")
    script = runpy.run_path(str(PAGES / f"{page}.py"))
    for name, figure in script["FIGURES"].items():
        with mpl.rc_context(LOOK | {"savefig.bbox": "tight"} | script.get("STYLE", {})):
            text = StringIO()
            figure().savefig(text, format="svg", metadata={"Date": None})
        picture = PAGES / f"{page.replace('_', '-')}-{name}.svg"
        picture.write_text(compact(text.getvalue()), encoding="utf-8")


def main(names: list[str]) -> None:
    """Draw the figures of the named pages."""
    fresh = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, fresh, max_tasks_per_child=1) as pages:
        for name in names or sorted(script.stem for script in PAGES.glob("*.py")):
            print(f"docs/filters/{name}.py", flush=True)
            pages.submit(draw, name).result()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Draw the figures of docs/filters/.")
    parser.add_argument("page", nargs="*", help="without any: all")
    main(parser.parse_args().page)
