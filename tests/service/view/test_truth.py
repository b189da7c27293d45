"""The truth is followed while it is written."""

from __future__ import annotations

from pathlib import Path

from service.view.truth import TruthTail


def test_the_last_whole_line_counts(tmp_path: Path) -> None:
    path = tmp_path / "truth.csv"
    tail = TruthTail(path)
    assert tail.latest() is None
    with path.open("a", buffering=1) as file:
        file.write("time_s,north_m,east_m,down_m,heading_rad\n")
        assert tail.latest() is None
        file.write("1700000000.0,1.5,-2.5,0.0,0.1\n")
        assert tail.latest() == (1.5, -2.5)
        file.write("1700000000.02,1.6,-2.")
        file.flush()
        assert tail.latest() == (1.5, -2.5)
        file.write("4,0.0,0.1\n")
        assert tail.latest() == (1.6, -2.4)
        file.writelines(f"{number}.0,{number}.0,7.0,0.0,0.0\n" for number in range(5000))
    assert tail.latest() == (4999.0, 7.0)
