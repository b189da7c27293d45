"""The map of landmarks: what is read, and what is said of a file that is none."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.maps import landmarks


def written(folder: Path, text: str) -> Path:
    path = folder / "landmarks.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_columns_are_found_by_their_names(tmp_path: Path) -> None:
    path = written(tmp_path, "\ufeffnorth,id,height,east\n1.5,7,2,-3\n-2e1,0,,4.25\n")
    assert landmarks.read(path) == {7: (1.5, -3.0), 0: (-20.0, 4.25)}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "id,north,east, got nothing"),
        ("7,1.0,2.0\n", "first line id,north,east"),
        ("id,north,east\n", "at least one landmark"),
        ("id,north,east\n7,1.0\n", "line 2: needs a whole number"),
        ("id,north,east\n7.5,1.0,2.0\n", "line 2"),
        ("id,north,east\n7,nan,2.0\n", "line 2: needs an id of 0 or more"),
        ("id,north,east\n-7,1.0,2.0\n", "line 2"),
        ("id,north,east\n7,1.0,2e7\n", "within 1000 km"),
        ("id,north,east\n7,1.0,2.0\n7,1.0,2.0\n", "line 3: landmark 7 is there already"),
    ],
)
def test_what_is_wrong_is_said_with_its_place(text: str, said: str, tmp_path: Path) -> None:
    path = written(tmp_path, text)
    with pytest.raises(landmarks.LandmarkError, match=said) as error:
        landmarks.read(path)
    assert str(path) in str(error.value)


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "landmarks.csv"
    path.write_bytes(b"\xff\xfe\x00\x80" * 10)
    with pytest.raises(landmarks.LandmarkError):
        landmarks.read(path)
    with pytest.raises(landmarks.LandmarkError, match="cannot be read"):
        landmarks.read(tmp_path / "none.csv")
