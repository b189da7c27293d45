from __future__ import annotations

from pathlib import Path

import pytest

from service.config import CanLink, Configuration, ConfigurationError, MavlinkLink, Start, load, site

ROOT = Path(__file__).parents[3]
LEAST = """
[vehicle]
name = "mower"
[[link]]
name = "autopilot"
kind = "mavlink"
url = "udpin:127.0.0.1:14550"
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return path


def errors(folder: Path, text: str) -> list[str]:
    with pytest.raises(ConfigurationError) as raised:
        load(written(folder, text))
    return raised.value.errors


def test_vehicle_and_one_link_are_enough(tmp_path: Path) -> None:
    read = load(written(tmp_path, LEAST))
    assert read.vehicle.name == "mower"
    assert read.vehicle.motion == "unicycle"
    assert isinstance(read.link[0], MavlinkLink)
    assert read.start == Start(mode="first_fix")
    assert (read.loop.rate, read.loop.horizon_ms, read.budget.cpu_ms) == (50.0, 250.0, 4.0)
    assert (read.budget.particles_min, read.budget.particles_max) == (200, 100_000)
    assert (read.motion.speed_noise, read.motion.yaw_rate_noise) == (0.1, 0.02)
    assert read.sensor == read.beacon == ()
    assert read.origin is read.area is None


def test_the_example_of_the_repository_is_usable() -> None:
    read = load(ROOT / "beliefd.example.toml")
    assert [link.name for link in read.link] == ["autopilot", "bus"]
    assert isinstance(read.link[1], CanLink)
    assert read.beacon[3].latitude == 40.4439
    assert read.sensor[0].estimate == ("scale",)


def test_a_configuration_is_frozen(tmp_path: Path) -> None:
    read = load(written(tmp_path, LEAST))
    with pytest.raises(ValueError, match="frozen"):
        read.loop.rate = 3.0


@pytest.mark.parametrize(
    ("start", "mode", "sigma_heading"),
    [
        ("position = [1, 2, 3]", "given", None),
        ("position = [1, 2, 3]\nheading = 0.3", "given", 0.1),
        ("position = [1, 2, 3]\nheading = 0.3\nsigma_heading = 0.4", "given", 0.4),
        ("heading = 0.3", "first_fix", 0.1),
        ('mode = "global"', "global", None),
        ("", "first_fix", None),
    ],
)
def test_start_fills_in_its_mode_and_the_spread_of_the_heading(
    tmp_path: Path, start: str, mode: str, sigma_heading: float | None
) -> None:
    area = "[area]\nnorth = [0, 1]\neast = [0, 1]\n"
    read = load(written(tmp_path, f"{LEAST}{area}[start]\n{start}\n"))
    assert (read.start.mode, read.start.sigma_heading) == (mode, sigma_heading)


def test_paths_are_relative_to_the_file(tmp_path: Path) -> None:
    (tmp_path / "signing.key").write_text("0" * 64)
    link = load(written(tmp_path, LEAST + 'signing_key_file = "signing.key"\n')).link[0]
    assert isinstance(link, MavlinkLink)
    assert link.signing_key_file == str(tmp_path / "signing.key")


def test_a_site_needs_neither_vehicle_nor_link(tmp_path: Path) -> None:
    read = site(
        written(tmp_path, "[start]\nposition = [1.5, 2, 0]\n[[beacon]]\nid = 3\nposition = [0, 1, 2]\n")
    )
    assert read.start.position == (1.5, 2.0, 0.0)
    assert read.beacon[0].id == 3
    assert read.vehicle is None
    assert read.link == ()


def test_a_site_becomes_a_configuration_and_what_it_says_goes_first(tmp_path: Path) -> None:
    least = load(written(tmp_path, LEAST))
    place = site(written(tmp_path, "[start]\nposition = [1, 2, 3]\n[loop]\nrate = 10.0\n"))
    made = place.configuration(least.vehicle, least.link, least.sensor)
    assert isinstance(made, Configuration)
    assert made.start.position == (1.0, 2.0, 3.0)
    assert made.loop.rate == 10.0
    assert made.vehicle == least.vehicle
    whole = site(written(tmp_path, LEAST.replace("mower", "other")))
    assert whole.configuration(least.vehicle, least.link, ()).vehicle.name == "other"


@pytest.mark.recordings
@pytest.mark.parametrize("name", ["plaza2", "sitl_rover", "sitl_jam", "uwb_los_a1", "uwb_nlos_b3"])
def test_the_sites_of_the_recordings_are_readable(name: str) -> None:
    path = ROOT.parent / "shared" / "data" / f"{name}.toml"
    if not path.exists():
        pytest.skip(f"the recordings are not here: {path.parent}")
    read = site(path)
    assert read.start.mode == "given"
    assert read.origin is not None


def test_what_is_not_toml_says_where(tmp_path: Path) -> None:
    assert errors(tmp_path, "[vehicle]\nname = mower\n") == [
        "robot.toml: not TOML: Invalid value (at line 2, column 8)"
    ]


def test_what_is_not_text_says_where(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(b"[vehicle]\nname = \xff")
    with pytest.raises(
        ConfigurationError, match=r"robot\.toml: not UTF-8 text: invalid start byte at byte 17"
    ):
        load(path)


def test_what_is_nested_too_deeply_is_refused(tmp_path: Path) -> None:
    assert errors(tmp_path, "a = " + "[" * 20_000) == ["robot.toml: not a configuration: nested too deeply"]


def test_an_absent_file_says_its_path(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationError, match=r"absent\.toml: cannot be read: No such file or directory"):
        load(tmp_path / "absent.toml")
    with pytest.raises(ConfigurationError, match="cannot be read: Is a directory"):
        load(tmp_path)


def test_a_number_with_too_many_digits_is_refused(tmp_path: Path) -> None:
    (line,) = errors(tmp_path, "a = " + "9" * 5000)
    assert line.startswith("robot.toml: not a configuration: Exceeds the limit")
