"""What a rehearsal measured is kept for the next start, and only what can be believed."""

from __future__ import annotations

from pathlib import Path

import msgspec
import pytest

from service.config import Configuration, validated
from service.shapes import shapes_of
from service.tick_costs import Line

KEPT = {"motion": Line(1e-5, 2e-9), "kalman": Line(1e-4, 3e-5)}


def configuration(sigma: float = 0.3, port: int = 0, name: str = "test") -> Configuration:
    file = {
        "vehicle": {"name": name},
        "budget": {"particles_min": 50, "particles_max": 100},
        "link": [{"name": "l", "kind": "mavlink", "url": f"udpin:127.0.0.1:{port}"}],
        "sensor": [{"kind": "range", "sigma": sigma}],
        "beacon": [{"id": 1, "position": [5.0, 5.0, 0.0]}],
    }
    return validated(file, Configuration, "test.toml")


def test_what_was_measured_is_what_the_next_start_has(tmp_path: Path) -> None:
    measured = shapes_of(configuration(), tmp_path)
    assert {"motion", "sensing", "extraction", "kalman"} <= set(measured)
    assert shapes_of(configuration(), tmp_path) == measured
    assert len(list(tmp_path.iterdir())) == 1


def test_another_configuration_is_measured_by_itself(tmp_path: Path) -> None:
    shapes_of(configuration(0.3), tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(msgspec.json.encode(KEPT))
    assert shapes_of(configuration(0.3), tmp_path) == KEPT
    assert shapes_of(configuration(0.4), tmp_path) != KEPT


def test_what_costs_nothing_may_change(tmp_path: Path) -> None:
    shapes_of(configuration(), tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(msgspec.json.encode(KEPT))
    assert shapes_of(configuration(port=14550, name="another"), tmp_path) == KEPT


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"{}",
        b'{"motion": 3}',
        b'{"motion": [-1.0, 1e-9]}',
        b'{"motion": {"overhead": 1e-5, "per_particle": 1e-9}}',  # as an older version wrote it
    ],
)
def test_a_file_that_cannot_be_believed_is_measured_anew(tmp_path: Path, content: bytes) -> None:
    shapes_of(configuration(), tmp_path)
    (path,) = tmp_path.iterdir()
    path.write_bytes(content)
    assert "motion" in shapes_of(configuration(), tmp_path)
    assert path.read_bytes() != content


def test_a_folder_that_cannot_be_written_to_costs_a_warning(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert "motion" in shapes_of(configuration(), tmp_path / "gone")
    assert "is not kept" in caplog.text
