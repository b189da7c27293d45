"""The whole file: every section, under the name that the TOML gives it."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator
from pydantic_core import PydanticCustomError

from service.config.belief import Area, Beacon, Honesty, Map, Motion, Origin, Sensor, Start, Vehicle
from service.config.links import Link
from service.config.running import Budget, Loop, Publish, State
from service.config.section import Section


def _not_empty(value: Any) -> Any:
    # before the links themselves: one that is wrong is still one
    if value in ([], ()):
        raise PydanticCustomError("empty", "needs at least one, got none")
    return value


class Sections(Section):
    """What every file may say, whether it describes a vehicle or only a place."""

    origin: Origin | None = None
    """[origin]"""
    start: Start = Start(mode="first_fix")
    """[start]"""
    area: Area | None = None
    """[area]"""
    loop: Loop = Loop()
    """[loop]"""
    budget: Budget = Budget()
    """[budget]"""
    motion: Motion = Motion()
    """[motion]"""
    sensor: tuple[Sensor, ...] = ()
    """[[sensor]]"""
    beacon: tuple[Beacon, ...] = ()
    """[[beacon]]"""
    map: Map = Map()
    """[map]"""
    honesty: Honesty = Honesty()
    """[honesty]"""
    publish: Publish = Publish()
    """[publish]"""
    state: State = State()
    """[state]"""


class Site(Sections):
    """What is known of the place that a recording was made at; the vehicle and its links may be left out."""

    vehicle: Vehicle | None = None
    """[vehicle]"""
    link: tuple[Link, ...] = ()
    """[[link]]"""

    def configuration(
        self, vehicle: Vehicle, link: tuple[Link, ...], sensor: tuple[Sensor, ...]
    ) -> Configuration:
        """Return the configuration of a vehicle at this place; what the file says goes first."""
        return Configuration(
            vehicle=self.vehicle or vehicle,
            link=self.link or link,
            sensor=self.sensor or sensor,
            **{name: getattr(self, name) for name in Sections.model_fields if name != "sensor"},
        )


class Configuration(Sections):
    """A file that says everything the daemon needs."""

    vehicle: Vehicle
    """[vehicle]"""
    link: Annotated[tuple[Link, ...], BeforeValidator(_not_empty)]
    """[[link]], at least one"""
