"""Maps of ROS against files packed by hand, the rules of nav2's map server, and whatever a disk may hold."""

from __future__ import annotations

import io
import struct
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from drivers.maps.ros_map import LARGEST_YAML, MapError, Mode, OccupancyMap, read_map, write_map

NAN = float("nan")
WORDS = """image: yard.pgm
resolution: 0.05
origin: [-12.5, 3.0, 0.0]
negate: 0
occupied_thresh: 0.65
free_thresh: 0.196
"""
# two rows of three: the first row is the north
PIXELS = bytes([0, 254, 205, 254, 254, 0])
IMAGE = b"P5\n# made by hand\n3 2\n255\n" + PIXELS


def packed(folder: Path, words: str = WORDS, image: bytes = IMAGE, name: str = "yard.pgm") -> Path:
    path = folder / "yard.yaml"
    path.write_text(words, encoding="utf-8")
    (folder / name).write_bytes(image)
    return path


def grey(*shades: int) -> bytes:
    return b"P5\n%d 1\n255\n" % len(shades) + bytes(shades)


def png(colour_type: int, *pixels: bytes) -> bytes:
    """Pack one row of a PNG of eight bits by hand."""

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    header = struct.pack(">IIBBBBB", len(pixels), 1, 8, colour_type, 0, 0, 0)
    row = zlib.compress(b"\0" + b"".join(pixels))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", row) + chunk(b"IEND", b"")


def test_a_file_packed_by_hand_comes_out_north_up_and_east_along(tmp_path: Path) -> None:
    read = read_map(packed(tmp_path))
    assert (read.resolution, read.north, read.east) == (0.05, 3.0, -12.5)
    np.testing.assert_array_equal(read.occupancy, [[0.0, 0.0, 1.0], [1.0, 0.0, NAN]])
    assert read.occupancy.flags.c_contiguous


@pytest.mark.parametrize(
    ("image", "name"),
    [
        (b"P2\n3 2\n255\n0 254 205\n254 254 0\n", "yard.pgm"),
        (b"P5 3 2 65535\n" + b"".join(struct.pack(">H", 257 * p) for p in PIXELS), "yard.pgm"),
        (b"P6 3 2 255\n" + bytes(value for p in PIXELS for value in (p, p, p)), "yard.ppm"),
    ],
)
def test_other_encodings_of_the_same_image(tmp_path: Path, image: bytes, name: str) -> None:
    expected = read_map(packed(tmp_path)).occupancy
    read = read_map(packed(tmp_path, WORDS.replace("yard.pgm", name), image, name))
    np.testing.assert_array_equal(read.occupancy, expected)


def test_two_colours(tmp_path: Path) -> None:
    read = read_map(packed(tmp_path, image=b"P4\n3 1\n" + bytes([0b01000000])))
    np.testing.assert_array_equal(read.occupancy, [[0.0, 1.0, 0.0]])


@pytest.mark.parametrize(
    ("mode", "negate", "expected"),
    [
        ("trinary", 0, [1.0, 1.0, NAN, NAN, 0.0]),
        ("trinary", 1, [0.0, 0.0, NAN, NAN, 1.0]),
        ("scale", 0, [1.0, 1.0, (125 / 255 - 0.25) / 0.5, (80 / 255 - 0.25) / 0.5, 0.0]),
        ("scale", 1, [0.0, 0.0, (130 / 255 - 0.25) / 0.5, (175 / 255 - 0.25) / 0.5, 1.0]),
        ("raw", 0, [0.0, 0.6, NAN, NAN, NAN]),
        ("raw", 1, [0.0, 0.6, NAN, NAN, NAN]),
    ],
)
def test_modes_as_nav2_reads_them(tmp_path: Path, mode: Mode, negate: int, expected: list[float]) -> None:
    words = WORDS.replace("negate: 0", f"negate: {negate}\nmode: {mode}").replace("0.65", "0.75")
    read = read_map(packed(tmp_path, words.replace("0.196", "0.25"), grey(0, 60, 130, 175, 255)))
    np.testing.assert_allclose(read.occupancy, [expected], atol=1e-12)


def test_raw_keeps_per_cents_up_to_a_hundred(tmp_path: Path) -> None:
    words = WORDS + "mode: raw\n"
    read = read_map(packed(tmp_path, words, grey(0, 1, 50, 100, 101, 255)))
    np.testing.assert_allclose(read.occupancy, [[0.0, 0.01, 0.5, 1.0, NAN, NAN]])


@pytest.mark.parametrize(
    ("mode", "expected"), [("scale", [1.0, NAN]), ("trinary", [1.0, 0.0]), ("raw", [0.0, 0.0])]
)
def test_transparency(tmp_path: Path, mode: str, expected: list[float]) -> None:
    """Transparent is unknown in scale; in trinary it is one of four bands: (0 + 0 + 0 + 255) / 4 is dark."""
    words = WORDS.replace("yard.pgm", "yard.png") + f"mode: {mode}\n"
    white = bytes([255, 255, 255, 254]) if mode != "raw" else bytes([0, 0, 0, 0])
    image = png(6, bytes([0, 0, 0, 255]), white)
    np.testing.assert_array_equal(read_map(packed(tmp_path, words, image, "yard.png")).occupancy, [expected])


def test_grey_with_transparency_and_a_palette(tmp_path: Path) -> None:
    words = WORDS.replace("yard.pgm", "yard.png") + "mode: scale\n"
    read = read_map(packed(tmp_path, words, png(4, bytes([0, 255]), bytes([0, 9])), "yard.png"))
    np.testing.assert_array_equal(read.occupancy, [[1.0, NAN]])
    file = io.BytesIO()
    Image.fromarray(np.array([[0, 255]], np.uint8)).convert("P").save(file, "PNG")
    read = read_map(packed(tmp_path, words, file.getvalue(), "yard.png"))
    np.testing.assert_array_equal(read.occupancy, [[1.0, 0.0]])


def field(rows: int, columns: int, unknown: float) -> np.ndarray:
    rng = np.random.default_rng(5)
    return np.where(rng.random((rows, columns)) < unknown, NAN, rng.random((rows, columns)))


@pytest.mark.parametrize(("mode", "unknown", "error"), [("raw", 0.2, 0.005), ("scale", 0.0, 0.5 / 255)])
def test_what_is_written_is_read_again(tmp_path: Path, mode: Mode, unknown: float, error: float) -> None:
    given = OccupancyMap(0.1, -7.25, 1e3 / 3, field(13, 7, unknown))
    path = tmp_path / "map.yaml"
    assert write_map(path, given, mode) == tmp_path / "map.pgm"
    read = read_map(path)
    assert read[:3] == given[:3]
    np.testing.assert_allclose(read.occupancy, given.occupancy, atol=error + 1e-12)
    assert sorted(file.name for file in tmp_path.iterdir()) == ["map.pgm", "map.yaml"]


def test_trinary_is_written_as_every_map_saver_does(tmp_path: Path) -> None:
    given = OccupancyMap(0.1, 2.0, 1.0, np.array([[0.0, 0.1, NAN], [0.5, 0.9, 1.0]]))
    image = write_map(tmp_path / "map.yaml", given)
    assert image.read_bytes() == b"P5\n3 2\n255\n" + bytes([205, 0, 0, 254, 254, 205])
    read = read_map(tmp_path / "map.yaml")
    np.testing.assert_array_equal(read.occupancy, [[0.0, 0.0, NAN], [NAN, 1.0, 1.0]])


@pytest.mark.parametrize(
    ("change", "what"),
    [
        (("0.05", "0.0"), "resolution"),
        (("0.05", ".nan"), "resolution"),
        (("0.05", "wide"), "resolution"),
        (("resolution: 0.05\n", ""), "resolution"),
        (("3.0, 0.0]", "3.0, 0.1]"), "yaw of 0.1 rad"),
        (("3.0, 0.0]", "3.0]"), "origin"),
        (("-12.5", "-.inf"), "origin"),
        (("0.196", "0.7"), "free_thresh"),
        (("0.65", "1.5"), "free_thresh"),
        (("negate: 0", "negate: 2"), "negate"),
        (("negate: 0", "mode: ternary"), "mode"),
        (("yard.pgm", "''"), "no name"),
        (("image", "- image"), "no description"),
        (("0.05", "!!bool perhaps"), "no description"),
    ],
)
def test_a_description_that_makes_no_sense(tmp_path: Path, change: tuple[str, str], what: str) -> None:
    path = packed(tmp_path, WORDS.replace(*change))
    with pytest.raises(MapError, match=what) as caught:
        read_map(path)
    assert str(caught.value).startswith(f"{path}: ")


@pytest.mark.parametrize(
    "image",
    [
        b"",
        b"P5\n3 2\n255\n" + PIXELS[:-1],
        b"P5\n0 2\n255\n",
        b"GIF89a",
        b"P5\n99999 99999\n255\n",
        png(6, b"ab"),
    ],
)
def test_an_image_that_is_damaged(tmp_path: Path, image: bytes) -> None:
    path = packed(tmp_path, image=image)
    with pytest.raises(MapError) as caught:
        read_map(path)
    assert str(caught.value).startswith(f"{tmp_path / 'yard.pgm'}: ")


def test_files_that_are_missing_or_too_large(tmp_path: Path) -> None:
    with pytest.raises(MapError, match=r"yard\.yaml: cannot be read: No such file"):
        read_map(tmp_path / "yard.yaml")
    path = packed(tmp_path, WORDS.replace("yard.pgm", "other.pgm"))
    with pytest.raises(MapError, match=r"other\.pgm: cannot be read: No such file"):
        read_map(path)
    path = packed(tmp_path, WORDS.replace("yard.pgm", '"a\\0b"'))
    with pytest.raises(MapError, match="cannot be read"):
        read_map(path)
    path = packed(tmp_path, WORDS + "#" * LARGEST_YAML)
    with pytest.raises(MapError, match="larger than 65536 bytes"):
        read_map(path)


def test_more_pixels_than_a_map_has(tmp_path: Path) -> None:
    with pytest.raises(MapError, match="too many"):
        read_map(packed(tmp_path, image=b"P5\n9000 9000\n255\n"))


@pytest.mark.parametrize(
    ("given", "mode", "what"),
    [
        (OccupancyMap(0.1, 0.0, 0.0, np.array([[NAN, 0.5]])), "scale", "1 unknown cells; use raw"),
        (OccupancyMap(0.1, 0.0, 0.0, np.array([[1.1]])), "raw", "occupancy"),
        (OccupancyMap(0.1, 0.0, 0.0, np.zeros(3)), "raw", "rows and columns"),
        (OccupancyMap(0.0, 0.0, 0.0, np.zeros((1, 1))), "raw", "resolution"),
        (OccupancyMap(0.1, NAN, 0.0, np.zeros((1, 1))), "raw", "corner"),
    ],
)
def test_a_map_that_cannot_be_written(tmp_path: Path, given: OccupancyMap, mode: Mode, what: str) -> None:
    with pytest.raises(MapError, match=what):
        write_map(tmp_path / "map.yaml", given, mode)
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    given = OccupancyMap(0.1, 0.0, 0.0, np.zeros((1, 1)))
    with pytest.raises(MapError, match=r"ends in \.yaml"):
        write_map(tmp_path / "map.pgm", given)
    with pytest.raises(MapError, match="cannot be written"):
        write_map(tmp_path / "nowhere" / "map.yaml", given)


@pytest.mark.parametrize(("module", "package"), [("yaml", "yaml"), ("PIL.Image", "PIL")])
def test_without_the_extra(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, package: str
) -> None:
    path = packed(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ModuleNotFoundError, match=rf"{package}: pip install 'beliefd\[maps\]'"):
        read_map(path)


FUZZ = settings(max_examples=80, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def mutations(original: bytes) -> st.SearchStrategy[bytes]:
    """Bytes of any kind, and the original with some of it replaced."""

    def spoil(cut: tuple[int, int, bytes]) -> bytes:
        start, length, put = cut
        return original[:start] + put + original[start + length :]

    places = st.integers(0, len(original))
    return st.one_of(
        st.binary(max_size=200), st.tuples(places, st.integers(0, 9), st.binary(max_size=9)).map(spoil)
    )


def read_or_refuse(path: Path) -> None:
    refused = str(path.parent)
    try:
        read = read_map(path)
    except MapError as error:
        refused = str(error)
    else:
        known = read.occupancy[~np.isnan(read.occupancy)]
        assert read.occupancy.ndim == 2
        assert read.resolution > 0.0
        assert ((known >= 0.0) & (known <= 1.0)).all()
    assert refused.startswith(str(path.parent))


@FUZZ
@given(words=mutations(WORDS.encode()))
def test_any_description_is_read_or_refused_by_name(tmp_path: Path, words: bytes) -> None:
    path = packed(tmp_path)
    path.write_bytes(words)
    read_or_refuse(path)


@FUZZ
@given(
    image=st.one_of(mutations(IMAGE), mutations(png(6, b"abcd", b"efgh")), mutations(b"P2 2 1 9 3 4")),
    mode=st.sampled_from(["trinary", "scale", "raw"]),
)
def test_any_image_is_read_or_refused_by_name(tmp_path: Path, image: bytes, mode: str) -> None:
    read_or_refuse(packed(tmp_path, WORDS + f"mode: {mode}\n", image))


@FUZZ
@given(
    fields=st.fixed_dictionaries(
        {},
        optional={
            name: st.one_of(
                st.none(),
                st.booleans(),
                st.integers(),
                st.floats(),
                st.text(max_size=5),
                st.lists(st.floats(), max_size=4),
            )
            for name in ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode")
        },
    )
)
def test_any_values_are_read_or_refused_by_name(tmp_path: Path, fields: dict[str, Any]) -> None:
    import yaml

    path = packed(tmp_path)
    path.write_text(yaml.safe_dump(yaml.safe_load(WORDS) | fields), encoding="utf-8")
    read_or_refuse(path)
