"""From the configuration to drivers that were told everything it says."""

from __future__ import annotations

from pathlib import Path

import pytest

from drivers.can import CanLink, CanSettings
from drivers.link import LinkError
from drivers.mavlink import DEFAULT_RATES
from drivers.mavlink.link import MavlinkLink
from drivers.zenoh import ZenohLink
from service.config import CanLink as CanSection
from service.config import Configuration, load
from service.config import MavlinkLink as MavlinkSection
from service.links import can_settings, link_named, mavlink_settings

TOML = """
[vehicle]
name = "rover"
[[link]]
name = "autopilot"
kind = "mavlink"
url = "udpin:127.0.0.1:0"
system = 7
components = [1]
rates = { RAW_IMU = 50.0 }
[[link.servo]]
channel = 3
low = 1100
high = 1900
[[link]]
name = "bus"
kind = "can"
interface = "socketcan"
channel = "nosuchbus"
[[link]]
name = "uwb"
kind = "zenoh"
"""


@pytest.fixture
def configuration(tmp_path: Path) -> Configuration:
    path = tmp_path / "rover.toml"
    path.write_text(TOML)
    return load(path)


def test_each_kind_has_its_driver(configuration: Configuration) -> None:
    kinds = {"autopilot": MavlinkLink, "bus": CanLink, "uwb": ZenohLink}
    for name, kind in kinds.items():
        link = link_named(configuration, name)
        assert isinstance(link, kind)
        assert link.report().link == name


def test_a_mavlink_link_opens_where_it_was_told(configuration: Configuration) -> None:
    link = link_named(configuration, "autopilot")
    link.open()
    assert link.poll(0.0) == []
    link.close()


def test_a_bus_that_is_not_there_is_named(configuration: Configuration) -> None:
    with pytest.raises(LinkError, match="nosuchbus"):
        link_named(configuration, "bus").open()


def test_the_drivers_settings_are_what_the_configuration_says(tmp_path: Path) -> None:
    path = tmp_path / "rover.toml"
    told = TOML.replace(
        "system = 7",
        'system = 7\nhud = ["altitude", "heading"]\ngeoid_height = -33.5\naltitudes = ["ALTITUDE"]',
    )
    path.write_text(told.replace('channel = "nosuchbus"', 'channel = "can0"\nrange_orientation = 0'))
    autopilot, bus, _ = load(path).link
    assert isinstance(autopilot, MavlinkSection)
    settings = mavlink_settings(autopilot)
    assert (settings.system, settings.components) == (7, {1})
    assert settings.hud == {"altitude", "heading"}
    assert settings.geoid_height == -33.5
    assert settings.altitudes == {"ALTITUDE"}
    assert settings.rates == DEFAULT_RATES | {"RAW_IMU": 50.0, "VFR_HUD": 10.0, "ALTITUDE": 10.0}
    assert isinstance(bus, CanSection)
    assert can_settings(bus) == CanSettings(channel="can0", range_orientation=0)


def test_what_is_not_configured_is_the_drivers_default(configuration: Configuration) -> None:
    autopilot, bus, _ = configuration.link
    assert isinstance(autopilot, MavlinkSection)
    settings = mavlink_settings(autopilot)
    assert (settings.hud, settings.geoid_height) == (frozenset(), None)
    assert "VFR_HUD" not in settings.rates
    assert isinstance(bus, CanSection)
    assert can_settings(bus).range_orientation == CanSettings().range_orientation


def test_an_unknown_name_is_said(configuration: Configuration) -> None:
    with pytest.raises(KeyError, match="sonar"):
        link_named(configuration, "sonar")
