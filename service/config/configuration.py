"""The whole file: every section, under the name that the TOML gives it."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from service.config.belief import Area, Beacon, Map, Motion, Origin, Sensor, Start, Vehicle
from service.config.links import Link
from service.config.running import Budget, Loop, Publish, State
from service.config.section import Section


class Site(Section):
    """A file that may leave out the vehicle and its links: what a recording knows of the place it was made at."""

    vehicle: Vehicle | None = None
    """[vehicle]"""
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
    link: tuple[Link, ...] = ()
    """[[link]]"""
    motion: Motion = Motion()
    """[motion]"""
    sensor: tuple[Sensor, ...] = ()
    """[[sensor]]"""
    beacon: tuple[Beacon, ...] = ()
    """[[beacon]]"""
    map: Map = Map()
    """[map]"""
    publish: Publish = Publish()
    """[publish]"""
    state: State = State()
    """[state]"""


class Configuration(Site):
    """A file that says everything the daemon needs."""

    vehicle: Vehicle
    """[vehicle]"""
    link: Annotated[tuple[Link, ...], Field(min_length=1)]
    """[[link]], at least one"""
