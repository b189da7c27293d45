"""Signals beside their DBC file: what is not in it, what its units say, what `beliefd check` makes of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.cli.plan import notes
from service.config import CanLink, ConfigurationError, load
from service.config.signals import notes_on_signals

DBC = """VERSION ""
NS_ :
BS_:
BU_: XXX
BO_ 180 SPEED: 8 XXX
 SG_ ENCODER : 39|8@0+ (1,0) [0|255] "" XXX
 SG_ SPEED : 47|16@0+ (0.01,0) [0|250] "km/h" XXX
 SG_ ODD : 7|8@0+ (1,0) [0|250] "furlong" XXX
BO_ 170 WHEELS: 8 XXX
 SG_ LEFT : 7|16@0+ (0.01,0) [0|250] "km/h" XXX
 SG_ RIGHT : 23|16@0+ (0.01,0) [0|250] "km/h" XXX
"""
HEAD = """
[vehicle]
name = "car"
[[link]]
name = "bus"
kind = "can"
channel = "vcan0"
protocol = "dbc"
dbc = "car.dbc"
"""


def written(folder: Path, *signals: str, dbc: str = DBC) -> Path:
    (folder / "car.dbc").write_text(dbc)
    path = folder / "car.toml"
    path.write_text(HEAD + "".join(f"[[link.signal]]\n{signal}\n" for signal in signals))
    return path


def complaints(path: Path) -> list[str]:
    with pytest.raises(ConfigurationError) as raised:
        load(path)
    return raised.value.errors


def test_a_file_relative_to_the_configuration(tmp_path: Path) -> None:
    link = load(written(tmp_path, 'signal = "SPEED.SPEED"\nmeasures = "speed"')).link[0]
    assert isinstance(link, CanLink)
    assert link.dbc == str(tmp_path / "car.dbc")


def test_every_signal_that_is_not_in_the_file_is_said_at_once(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        'signal = "SPED.SPEED"\nmeasures = "speed"',
        'signal = "SPEED.SPEEDD"\nmeasures = "speed"',
        'signal = "SPEED.TORQUE"\nmeasures = "speed"',
        'signal = "SPEED.ODD"\nmeasures = "distance"',
        'signal = "WHEELS.LEFT"\nmeasures = "wheel_speed"',
        'signal = "WHEELS.RIGHT"\nmeasures = "wheel_speed"',
    )
    bus = 'car.toml: link "bus" (link 1), signal'
    assert complaints(path) == [
        f'{bus} 1, signal: no message "SPED" in car.dbc; did you mean "SPEED"?',
        f'{bus} 2, signal: message SPEED in car.dbc has no signal "SPEEDD"; did you mean "SPEED"?',
        f'{bus} 3, signal: message SPEED in car.dbc has no signal "TORQUE"; it has ENCODER, ODD, SPEED',
        f'{bus} 4, scale: is missing: the DBC file gives "furlong", no known unit of distance (to m)',
        f"{bus} 6, index: 0 is taken by signal 5; each wheel of a message needs its own",
    ]


def test_a_file_that_is_absent_or_none(tmp_path: Path) -> None:
    path = written(tmp_path, 'signal = "SPEED.SPEED"\nmeasures = "speed"', dbc="VERSION oops")
    (line,) = complaints(path)
    assert line.startswith(f'car.toml: link "bus" (link 1), dbc: {tmp_path / "car.dbc"}: not a DBC file')
    (tmp_path / "car.dbc").unlink()
    (line,) = complaints(path)
    assert line == (
        f'car.toml: link "bus" (link 1), dbc: needs a file that exists, there is no {tmp_path / "car.dbc"}'
    )


@pytest.mark.parametrize(
    ("keys", "error"),
    [
        ('measures = "range"', 'measures = "range" needs beacon, the id of a [[beacon]]'),
        ('measures = "speed"\nbeacon = 1', 'beacon belongs to measures = "range", and this is "speed"'),
        ('measures = "speed"\nscale = 0.0', "scale: needs a number that is not 0"),
        ('measures = "speed"\nsigma = 0.0', "sigma: needs more than 0, got 0"),
    ],
)
def test_a_signal_that_contradicts_itself(tmp_path: Path, keys: str, error: str) -> None:
    lines = complaints(written(tmp_path, f'signal = "SPEED.SPEED"\n{keys}'))
    assert any(error in line for line in lines)


def test_a_scale_that_the_files_unit_contradicts_is_said(tmp_path: Path) -> None:
    path = written(
        tmp_path,
        'signal = "SPEED.SPEED"\nmeasures = "speed"\nscale = 1.0',
        'signal = "SPEED.ENCODER"\nmeasures = "speed"',
        'signal = "WHEELS.LEFT"\nmeasures = "speed"\nscale = -0.2778',
    )
    link = load(path).link[0]
    assert isinstance(link, CanLink)
    expected = [
        'link "bus", signal SPEED.SPEED: the DBC file gives "km/h", for which scale would be 0.277778; it is 1',
        'link "bus", signal SPEED.ENCODER: neither a scale nor a unit in the DBC file; taken as m/s',
    ]
    assert list(notes_on_signals(link)) == expected
    assert set(expected) <= set(notes(load(path)))
