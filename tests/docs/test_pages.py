"""The pages lead somewhere, show code that runs, and name commands and states that exist."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from typer.core import TyperGroup
from typer.main import get_command

from service import health
from service.cli.application import application
from service.estimate import HealthState
from service.publish.reference import VALUES
from service.textbook.catalogue import CATALOGUE
from service.timeline import CAPACITY, Timeline

ROOT = Path(__file__).parents[2]
FILTERS = ROOT / "docs" / "filters"
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *FILTERS.glob("*.md")])
OPERATING = (ROOT / "docs" / "operating.md").read_text(encoding="utf-8")
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")


def targets(page: Path) -> list[str]:
    prose = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    return LINK.findall(prose)


def anchors(page: Path) -> set[str]:
    headings = re.findall(r"^#+ (.*)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_to_a_file(page: Path) -> None:
    for target in targets(page):
        path, _, anchor = target.partition("#")
        there = (page.parent / path).resolve() if path else page
        assert there.is_relative_to(ROOT), f"{page.name}: {target} leads out of the repository"
        assert there.exists(), f"{page.name}: {target}"
        assert not anchor or anchor in anchors(there), f"{page.name}: {target}"


def test_every_page_can_be_reached_from_the_readme() -> None:
    reached: set[Path] = set()
    ahead = [ROOT / "README.md"]
    while ahead:
        page = ahead.pop()
        if page not in reached:
            reached.add(page)
            local = ((page.parent / target.partition("#")[0]).resolve() for target in targets(page))
            ahead.extend(path for path in local if path.suffix == ".md")
    assert set(PAGES) <= reached


PICTURES = sorted([*FILTERS.glob("*.svg"), *FILTERS.glob("*.png"), *FILTERS.glob("textbook/*")])


def test_every_figure_is_shown() -> None:
    shown = {
        (page.parent / target).resolve()
        for page in FILTERS.glob("*.md")
        for target in targets(page)
        if Path(target).suffix in {".svg", ".png"}
    }
    assert shown == set(PICTURES)


def test_every_figure_is_made_by_the_program() -> None:
    """By the script that is named as the page is, or by ``beliefd textbook``."""
    scripts = {script.stem.replace("_", "-") for script in FILTERS.glob("*.py")}
    for picture in PICTURES:
        if picture.parent.name == "textbook":
            assert picture.stem in CATALOGUE, picture.name
        else:
            assert any(picture.name.startswith(f"{script}-") for script in scripts), picture.name
    assert {picture.stem for picture in PICTURES if picture.parent.name == "textbook"} == set(CATALOGUE)


def test_the_figures_are_small() -> None:
    """Everyone who clones the repository gets all of them."""
    assert sum(picture.stat().st_size for picture in PICTURES) < 4_000_000


def test_every_page_of_the_filters_is_in_their_index() -> None:
    linked = set(targets(FILTERS / "README.md"))
    assert {page.name for page in FILTERS.glob("*.md")} - {"README.md"} <= linked


def code(page: Path) -> list[str]:
    return re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


@pytest.mark.parametrize(
    "page", [page for page in PAGES if page.parent == FILTERS], ids=lambda page: page.stem
)
def test_the_code_of_a_filters_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All blocks of a page, one after the other."""
    monkeypatch.chdir(tmp_path)
    exec(compile("\n".join(code(page)), str(page), "exec"), {"__name__": page.stem})


def test_the_readme_shows_the_subscriber_that_runs() -> None:
    example = (ROOT / "examples" / "subscribe.py").read_text(encoding="utf-8")
    _, _, body = example.partition('"""\n\n')
    assert code(ROOT / "README.md") == [body]


def test_the_sensor_page_shows_the_example_that_runs() -> None:
    example = (ROOT / "docs" / "examples" / "bearing.py").read_text(encoding="utf-8")
    blocks = code(ROOT / "docs" / "sensor-model.md")
    assert len(blocks) > 5
    for block in blocks:
        assert block in example


def commands() -> TyperGroup:
    group = get_command(application)
    assert isinstance(group, TyperGroup)
    return group


def named_commands() -> set[tuple[str, ...]]:
    """Return the words after ``beliefd`` in code, up to the first that is no lower-case word."""
    found: set[tuple[str, ...]] = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        shells = "\n".join(re.findall(r"^```sh\n(.*?)^```", text, re.MULTILINE | re.DOTALL))
        inline = "\n".join(re.findall(r"`([^`\n]+)`", text))
        for words in re.findall(r"(?:^|[\s/])beliefd((?: [a-z|-]+)*)", shells + "\n" + inline):
            found.add(tuple(words.split()))
    return found


def test_every_command_named_exists() -> None:
    """``beliefd service reload`` in a page would fail here; units' names (``-u beliefd``) pass as no command."""
    named = named_commands()
    assert ("demo",) in named
    assert ("service", "install") in named
    group = commands()
    for words in named:
        place: object = group
        for word in words:
            if word.startswith("-") or not isinstance(place, TyperGroup):
                break
            assert word in place.commands, f"beliefd {' '.join(words)}"
            place = place.commands[word]


def test_every_command_is_named() -> None:
    """Each command that ``beliefd --help`` lists occurs in some page."""
    first_words = {words[0] for words in named_commands() if words}
    group = commands()
    visible = {name for name, command in group.commands.items() if not command.hidden}
    assert visible <= first_words


def test_every_option_named_exists() -> None:
    done = [
        subprocess.run(
            [sys.executable, "-c", "from service.cli import main; main()", *words, "--help"],
            capture_output=True,
            text=True,
            check=True,
            env={"TERM": "dumb", "COLUMNS": "200"},
        ).stdout
        for words in (
            [],
            ["run"],
            ["send"],
            ["replay"],
            ["scenario"],
            ["textbook"],
            ["service", "install"],
            ["service", "uninstall"],
        )
    ]
    others = [
        subprocess.run(
            [sys.executable, *words, "--help"], capture_output=True, text=True, check=True, cwd=ROOT
        ).stdout
        for words in (["-m", "sim_vehicle"], ["benchmarks/deadline.py"])
    ]
    helps = "\n".join([*done, *others]) + " --seeds --constraint"  # pip's
    for page in PAGES:
        for option in set(re.findall(r"(?<![\w-])--[a-z]+(?:-[a-z]+)*", page.read_text(encoding="utf-8"))):
            assert option in helps, f"{page.name}: {option}"


def test_every_target_named_exists() -> None:
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        named = set(re.findall(r"`make (\w+)`", text)) | set(re.findall(r"^make (\w+) ", text, re.MULTILINE))
        assert named <= targets, page.name


def test_the_table_of_states_is_the_code() -> None:
    """Every state has a row or a sentence, and the figures are those of service/health.py."""
    for state in HealthState:
        assert f"`{state.value}`" in OPERATING, state
    section = OPERATING.partition("## Health")[2].partition("\n## ")[0]
    rows = dict(re.findall(r"^\| `(\w+)` \| ([^|]+) \|", section, re.MULTILINE))
    assert f"{health.CONVERGED_RADIUS:g} m" in rows["converging"]
    assert f"{health.LOST_RADIUS:g} m" in rows["converging"]
    assert f"{health.SILENCE / health.SECOND:g} s" in rows["dead_reckoning"]
    assert f"{health.DISAGREEMENT:.0%}".replace("%", " %") in rows["lost"]
    assert f"about {health.MEMORY:g} s" in rows["lost"]
    assert f"at least {health.LEAST_READINGS} " in rows["lost"]


def test_the_reasons_of_the_timeline_are_explained() -> None:
    timeline: Timeline[int] = Timeline(capacity=1)
    timeline.release(0)
    for time, now in ((-1, 0), (10**12, 0), (1, 10), (2, 10)):
        timeline.insert(0, time, now)
    assert set(timeline.refused) == {"late", "future", "overflow"}
    for reason in timeline.refused:
        assert f"`drops.{reason}`" in OPERATING
    assert f"{CAPACITY:,}" in OPERATING


def test_the_counts_of_the_budget_are_fields() -> None:
    fields = {field for value in VALUES if value.__name__ == "Budget" for field in value.__struct_fields__}
    table = OPERATING.partition("In `budget`")[2].partition("In `sensors`")[0]
    named = {name.split(".")[0] for name in re.findall(r"^\| `([^`]+)`", table, re.MULTILINE)}
    assert named
    assert named <= fields
