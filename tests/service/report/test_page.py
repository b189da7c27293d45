"""The page as text: self-contained, small, escaped, with the figures that the table in the terminal has."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from service import report

from .traces import plan_of, run_of, trace

VOID = {"meta", "link", "br", "img", "input", "hr"}


class Nesting(HTMLParser):
    """Notes elements that were not closed in order, and everything that would be fetched."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.fetched: list[str] = []
        self.ids: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.fetched += [v for k in ("src", "href") if (v := given.get(k)) and not v.startswith("data:")]
        if identifier := given.get("id"):
            self.ids.append(identifier)
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_the_page_is_whole_and_fetches_nothing() -> None:
    traced, truth = trace(60.0)
    nesting = Nesting()
    nesting.feed(report.page(plan_of(truth), [run_of(traced, truth)]))
    nesting.close()
    assert nesting.open == []
    assert nesting.fetched == []
    wanted = {"track", "health", "error", "nees", "innovations-range", "innovations-position", "particles"}
    assert wanted | {"slow-gyro_bias"} <= set(nesting.ids)
    assert len(nesting.ids) == len(set(nesting.ids))


def test_twenty_minutes_stay_below_five_megabytes() -> None:
    traced, truth = trace(1200.0, sensors=8)
    assert len(report.page(plan_of(truth), [run_of(traced, truth)]).encode()) < 5_000_000


def test_the_table_holds_both_filters_and_the_spread_over_seeds() -> None:
    traced, truth = trace(60.0)
    runs = [run_of(traced, truth), replace(run_of(traced, truth, 1), trace=None)]
    table = report.page(plan_of(truth), runs).split("<table>")[1].split("</table>")[0]
    rmse = next(row for row in table.split("<tr>") if "RMSE" in row)
    assert re.findall(r"<td>([\d.]+)", rmse) == ["0.300", "0.600"]
    assert "± 0.000" in rmse
    assert "13" in next(row for row in table.split("<tr>") if "gate" in row)


def test_names_from_outside_are_escaped() -> None:
    traced, truth = trace(10.0)
    page = report.page(plan_of(truth, "<img src=x>&.tlog"), [run_of(traced, truth)])
    assert "<img src=x>" not in page
    assert "&lt;img src=x&gt;&amp;.tlog" in page


def test_without_a_truth_the_radius_is_drawn_alone() -> None:
    traced, _ = trace(10.0)
    page = report.page(plan_of(None), [run_of(traced, None)])
    assert 'id="radius"' in page
    assert 'id="nees"' not in page


def test_a_run_that_was_not_traced_has_no_page() -> None:
    traced, truth = trace(10.0)
    with pytest.raises(ValueError, match="traced"):
        report.page(plan_of(truth), [replace(run_of(traced, truth), trace=None)])
