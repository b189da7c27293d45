"""From a ``[[link]]`` of the configuration to the driver's link.

Each driver is imported only where it is used: a CAN process carries no MAVLink dialect.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from drivers.link import Link
from service.config import CanLink, Configuration, MavlinkLink, ZenohLink

if TYPE_CHECKING:
    from drivers.can import CanSettings
    from drivers.mavlink import MavlinkSettings

HUD_RATE = (
    10.0  # Hz: what is wanted of VFR_HUD and the autopilot's altitudes has to be asked for, like the rest
)


def link_named(configuration: Configuration, name: str) -> Link:
    """Return the link that the configuration calls ``name``, not yet open.

    Raises
    ------
    KeyError
        There is none of that name.
    ValueError
        The driver refuses its settings; the text says which and why.
    """
    for link in configuration.link:
        if link.name != name:
            continue
        if isinstance(link, MavlinkLink):
            return _mavlink(link)
        if isinstance(link, CanLink):
            return _can(link)
        return _zenoh(link, configuration)
    raise KeyError(f"no [[link]] is named {name}")


def _mavlink(link: MavlinkLink) -> Link:
    from drivers.mavlink.link import MavlinkLink as Driver

    return Driver(link.name, mavlink_settings(link))


def mavlink_settings(link: MavlinkLink) -> MavlinkSettings:
    """Return the driver's settings of a MAVLink link; a log of it is read with the same."""
    from drivers.mavlink import DEFAULT_RATES, MavlinkSettings, ServoCalibration

    asked = ["VFR_HUD"] if link.hud else []
    return MavlinkSettings(
        url=link.url,
        system=link.system,
        components=frozenset(link.components) or None,
        rates=DEFAULT_RATES | dict.fromkeys([*asked, *link.altitudes], HUD_RATE) | link.rates,
        servos=tuple(
            ServoCalibration(servo.channel, servo.low, servo.trim, servo.high, servo.reversed)
            for servo in link.servo
        ),
        hud=frozenset(link.hud),
        altitudes=frozenset(link.altitudes),
        geoid_height=link.geoid_height,
        signing_key_file=link.signing_key_file,
    )


def _can(link: CanLink) -> Link:
    from drivers.can import CanLink as Driver

    return Driver(link.name, can_settings(link))


def can_settings(link: CanLink) -> CanSettings:
    """Return the driver's settings of a CAN link; a log of it is read with the same."""
    from drivers.can import CanSettings, SignalSettings

    return CanSettings(
        interface=link.interface,
        channel=link.channel,
        bitrate=link.bitrate,
        protocol=link.protocol,
        dbc=link.dbc,
        signals=tuple(SignalSettings(**signal.model_dump()) for signal in link.signal),
        options=link.options,
        range_orientation=link.range_orientation,
    )


def _zenoh(link: ZenohLink, configuration: Configuration) -> Link:
    from drivers.zenoh import ZenohLink as Driver
    from drivers.zenoh import ZenohSettings

    publish = configuration.publish
    return Driver(
        link.name,
        ZenohSettings(f"{publish.prefix}/{configuration.vehicle.name}", configuration=publish.zenoh),
    )
