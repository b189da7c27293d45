"""The sections about running: loop, budget, publish, state."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from service.config.section import Positive, Section, Whole


class Loop(Section):
    """The rhythm of the real-time loop."""

    rate: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=1, le=1000)] = 50.0
    """Ticks per second."""
    horizon_ms: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=5000)] = 250.0
    """How far the filter stays behind now, ms, so that late samples come in order: the slowest sensor."""
    late_s: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=600)] = 30.0
    """How much later than the horizon a measurement may come and still be fused, by where every particle was then, s.

    It needs odometry. 0: what is late is only counted."""
    priority: Annotated[Whole, Field(ge=0, le=99)] = 0
    """SCHED_FIFO priority; 0: ordinary scheduling."""
    cpus: tuple[Annotated[Whole, Field(ge=0, le=1023)], ...] = ()
    """Processors that the loop may use; empty: all."""


class Budget(Section):
    """What the loop may spend."""

    cpu_ms: Positive = 4.0
    """Milliseconds per tick for everything the loop does."""
    particles_min: Annotated[Whole, Field(ge=10, le=10_000_000)] = 200
    """Never fewer particles than this."""
    particles_max: Annotated[Whole, Field(ge=10, le=10_000_000)] = 100_000
    """Never more than this; memory is allocated for this many, once."""
    threads: Annotated[Whole, Field(ge=1, le=64)] = 1
    """Threads that share the blocks of particles."""

    @model_validator(mode="after")
    def _ordered(self) -> Budget:
        if self.particles_min > self.particles_max:
            raise PydanticCustomError(
                "budget",
                "needs particles_min <= particles_max, got {low} and {high}",
                {"low": self.particles_min, "high": self.particles_max},
            )
        return self


class Publish(Section):
    """What goes out, and where."""

    prefix: Annotated[str, Field(pattern=r"^[^/#?$*\s]+(/[^/#?$*\s]+)*$")] = "beliefd/v1"
    """Start of every key: PREFIX/VEHICLE/estimate."""
    zenoh: str = ""
    """A Zenoh JSON5 configuration file.

    Default: a peer on tcp/127.0.0.1:7447, or connected to whoever listens there already."""
    ros2_domain: Annotated[Whole, Field(ge=-1, le=232)] = -1
    """From 0: mirror as ROS 2 topics in that domain; -1: not."""
    particles: Annotated[Whole, Field(ge=0, le=3000)] = 1000
    """How many particles go out in the cloud (16 bytes each, 48 KB at most)."""


class State(Section):
    """What survives a restart."""

    directory: Annotated[str, Field(min_length=1)] = "/var/lib/beliefd"
    """Folder for the checkpoint, from which a restart goes on; where there is none, a restart is a new start."""
