"""The page in a real browser, on a laptop and on a phone: every plot drawn, no complaint, nothing sticks out."""

from __future__ import annotations

import io
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from service import report

from .traces import plan_of, run_of, trace

CHROMIUM = next(
    filter(
        None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable"))
    ),
    None,
)
BLUE = (0x00, 0x72, 0xB2)
RED = (0xB5, 0x37, 0x2F)

pytestmark = [
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine (apt-get install chromium)"),
    pytest.mark.timeout(120),
]


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    traced, truth = trace(120.0)
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(report.page(plan_of(truth), [run_of(traced, truth)]), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as library:
        # as root in a container there is no sandbox to be had; the page is our own
        opened = library.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield opened
        opened.close()


def opened(browser: Any, path: Path, width: int, height: int) -> tuple[Any, list[str]]:
    """Return the page once Bokeh is idle, and what went wrong until then."""
    page = browser.new_context(viewport={"width": width, "height": height}, offline=True).new_page()
    wrong: list[str] = []
    page.on("console", lambda said: wrong.append(said.text) if said.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("requestfailed", lambda request: wrong.append(request.url))
    page.goto(path.as_uri())
    page.wait_for_function(
        "window.Bokeh && Bokeh.documents.length > 0 && Bokeh.documents.every(d => d.is_idle)", timeout=60_000
    )
    page.evaluate("() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))")
    return page, wrong


def share_of(picture: bytes, colour: tuple[int, int, int]) -> float:
    """Return the share of a picture's points that have ``colour``."""
    points = np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"), np.int16)
    return float(np.mean(np.abs(points - np.array(colour)).max(axis=2) < 64))


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (390, 844)], ids=["laptop", "phone"])
def test_every_plot_is_drawn_and_nothing_complains(
    browser: Any, page_file: Path, width: int, height: int
) -> None:
    page, wrong = opened(browser, page_file, width, height)
    sections = page.locator("section.plot")
    assert sections.count() == 8
    for index in range(sections.count()):
        section = sections.nth(index)
        name = section.get_attribute("id")
        canvas = section.locator("canvas").first
        box = canvas.bounding_box()
        assert box is not None, name
        assert box["width"] > 0.75 * section.bounding_box()["width"], name
        assert box["height"] >= 70, name
        colour = RED if name == "health" else BLUE
        assert share_of(canvas.screenshot(), colour) > 2e-4, name
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert wrong == []
    page.context.close()


def test_a_phones_letters_can_be_read(browser: Any, page_file: Path) -> None:
    page, _ = opened(browser, page_file, 390, 844)
    sizes = page.evaluate(
        "[...document.querySelectorAll('h1, h2, p, td, th, dt, dd, li')]"
        ".map(e => parseFloat(getComputedStyle(e).fontSize))"
    )
    assert len(sizes) > 40
    assert min(sizes) >= 13.0
    page.context.close()


def test_columns_stand_side_by_side_on_a_laptop_only(browser: Any, page_file: Path) -> None:
    for width, beside in ((1280, True), (390, False)):
        page, _ = opened(browser, page_file, width, 844)
        error, nees = (page.locator(f"#{name}").bounding_box() for name in ("error", "nees"))
        assert (error["y"] == nees["y"]) is beside
        page.context.close()
