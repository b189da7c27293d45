"""Queries for a density: each is made of the newest cloud by a process of its own, and answered when that is done.

Nobody waits for it: the publishing process looks after its other work meanwhile, and the loop is not asked at all.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from typing import NamedTuple

import msgspec

from service.estimate import Cloud
from service.publish.inbox import Value
from service.publish.outlet import RefusedError

EXTRACTORS = ("gaussian", "kmeans", "histogram", "tree", "kernel")
"""By their names in the selector; :mod:`service.density` has them, and is not loaded here: it needs a compiler."""

AT_ONCE = 2
"""More than so many are refused."""

PATIENCE = 9.0
"""Seconds until one that is not done is given up: a query's own patience is ten."""

Reply = Callable[[bytes], None]
Refuse = Callable[[str], None]


class Job(NamedTuple):
    """A density in the making."""

    process: subprocess.Popen[bytes]
    output: int
    errors: int
    until: float
    reply: Reply
    refuse: Refuse


class Densities:
    """The densities in the making.

    Parameters
    ----------
    cloud : callable
        Returns the newest cloud, if there is one.
    """

    def __init__(self, cloud: Callable[[], Value | None]) -> None:
        self._cloud = cloud
        self._jobs: list[Job] = []

    def ask(self, parameters: Mapping[str, str], reply: Reply, refuse: Refuse) -> None:
        """Begin one; ``reply`` gets its JSON, or ``refuse`` the reason.

        Raises
        ------
        RefusedError
            It cannot be begun.
        """
        extractor = _chosen(parameters)
        value = self._cloud()
        if value is None or value.attachment is None:
            raise RefusedError(
                "no particles yet: a density is made of the cloud, which needs publish.particles above 0 and a belief"
            )
        if len(self._jobs) >= AT_ONCE:
            raise RefusedError(f"{AT_ONCE} densities are being made; ask again")
        described = msgspec.json.decode(value.attachment, type=Cloud)
        output, errors = os.memfd_create("density"), os.memfd_create("reason")
        cloud = os.memfd_create("cloud")
        os.write(cloud, value.payload)
        os.lseek(cloud, 0, os.SEEK_SET)
        process = subprocess.Popen(
            (sys.executable, "-m", "service.publish.extraction", extractor, repr(described.time)),
            stdin=cloud,
            stdout=output,
            stderr=errors,
        )
        os.close(cloud)
        self._jobs.append(Job(process, output, errors, time.monotonic() + PATIENCE, reply, refuse))

    def look_after(self) -> None:
        """Answer what is done, and give up what takes too long.

        Raises
        ------
        zenoh.ZError
            The session does not take an answer.
        """
        for job in list(self._jobs):
            code = job.process.poll()
            if code is None and time.monotonic() < job.until:
                continue
            self._jobs.remove(job)
            self._end(job, code)

    def close(self) -> None:
        """End all that are in the making."""
        for job in self._jobs:
            job.process.kill()
            job.process.wait()
            os.close(job.output)
            os.close(job.errors)
        self._jobs.clear()

    @staticmethod
    def _end(job: Job, code: int | None) -> None:
        if code is None:
            job.process.kill()
            job.process.wait()
        output, errors = _content(job.output), _content(job.errors)
        if code == 0:
            job.reply(output)
        elif code is None:
            job.refuse(f"not done within {PATIENCE:.0f} s: this computer is too busy, or gaussian is enough")
        else:
            lines = errors.decode(errors="replace").strip().splitlines()
            job.refuse(lines[-1] if lines else f"the extraction ended with {code}")


def _chosen(parameters: Mapping[str, str]) -> str:
    extractor = parameters.get("extractor", "")
    if extractor not in EXTRACTORS:
        said = f"no extractor {extractor!r}" if extractor else "no extractor named"
        raise RefusedError(f"{said}: ask @rpc/density?extractor= with one of {', '.join(EXTRACTORS)}")
    return extractor


def _content(descriptor: int) -> bytes:
    """Read a file in memory whole, and close it."""
    try:
        return os.pread(descriptor, os.fstat(descriptor).st_size, 0)
    finally:
        os.close(descriptor)
