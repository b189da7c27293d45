"""Which processes a configuration asks for, and how they are connected.

The supervisor's plan of the real daemon: the publisher, the loop, and one process for each link, with a queue
from each link to the loop, one from the loop to the publisher, and a heart for all that beat. All who need it read
the same configuration, the one that was found right, from a sealed file in memory: what happens to the file
on disk in the meantime harms nobody.
"""

from __future__ import annotations

import fcntl
import logging
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from service.channels import Outlet, Pair, pair
from service.child import Program
from service.config import Configuration, load
from service.keeper import path_of

PUBLISHER = "publisher"
LOOP = "loop"
RECORDER = "recorder"
KEEPER = "keeper"

LINK_QUEUE = 2 * 1024 * 1024
"""Bytes: about a second of a busy link. What is older than that is of no use to a loop that was away."""

PUBLISHER_QUEUE = 1024 * 1024
RECORDER_QUEUE = 1024 * 1024
KEEPER_QUEUE = 512 * 1024
ORDER_QUEUE = 64 * 1024

LOOP_START = 180.0
"""Seconds until the first tick: on a slow computer without a cache the kernels are compiled first."""

LOOP_PATIENCE = 1.0
LOOP_PATIENCE_TICKS = 20
"""A loop with a low rate is one on a slow computer, which may be held up for longer."""
LINK_PATIENCE = 5.0
LINK_START = 30.0

_HEART_QUEUE = 16 * 1024
_log = logging.getLogger(__name__)
_F_SEALS = fcntl.F_SEAL_SHRINK | fcntl.F_SEAL_GROW | fcntl.F_SEAL_WRITE | fcntl.F_SEAL_SEAL


class Wiring:
    """The plan of the daemon that a configuration file describes.

    Parameters
    ----------
    path : Path
        The configuration file.
    decisions : Path, optional
        Where the decision log goes, at the end of what is there.
    recording : Path, optional
        Where the recording of the run goes (.mcap).

    Raises
    ------
    ConfigurationError
        The file is wrong.
    """

    def __init__(self, path: Path, decisions: Path | None = None, recording: Path | None = None) -> None:
        self._path = path
        self._configuration = load(path)
        self._file = _sealed(self._configuration)
        self._links: dict[str, Pair] = {}
        self._hearts: dict[str, Pair] = {}
        self._estimates = pair(PUBLISHER_QUEUE)
        self._recording = recording
        files = {"--decisions": decisions, "--recording": recording}
        self._recorded = [
            word
            for option, file in files.items()
            if file is not None
            for word in (option, str(file.absolute()))
        ]
        self._records = pair(RECORDER_QUEUE) if self._recorded else None
        self._checkpoints = pair(KEEPER_QUEUE)
        self._orders = pair(ORDER_QUEUE)
        self._keeping = False
        self._look_for_state()
        self.publisher = PUBLISHER
        """Name of the program that publishes."""
        self.statuses = Outlet(self._estimates.outlet)
        """Its queue."""

    def reload(self) -> None:
        """Read the file again.

        Raises
        ------
        ConfigurationError
            It is wrong; nothing has changed.
        """
        configuration = load(self._path)
        before, self._file = self._file, _sealed(configuration)
        os.close(before)
        self._configuration = configuration
        self._disconnect(self._links, {link.name for link in configuration.link})
        self._look_for_state()

    def programs(self) -> list[Program]:
        """Return the loop, which takes longest to start, publisher, links, recorder and keeper (where they are needed).

        Whatever one of them says before another listens waits in its queue.
        """
        names = [link.name for link in self._configuration.link]
        return [
            self._loop(names),
            self._publisher(),
            *(self._link(name) for name in names),
            *self._recorder(names),
            *self._keeper(),
        ]

    def call(self) -> None:
        """Have the loop say again what it says only on change."""
        Outlet(self._heart(LOOP).inlet).send(b"!")

    def close(self) -> None:
        """Close everything."""
        self._disconnect(self._links, set())
        self._disconnect(self._hearts, set())
        for queue in (self._estimates, self._checkpoints, self._orders):
            queue.close()
        if self._records is not None:
            self._records.close()
        os.close(self._file)

    def _publisher(self) -> Program:
        inlet, orders = self._estimates.inlet.fileno(), self._orders.outlet.fileno()
        return Program(
            PUBLISHER,
            self._command(
                "publisher", "--configuration", self._file, "--estimates", inlet, "--orders", orders
            ),
            (self._file, inlet, orders),
            self._configuration.model_dump_json(),
            environment=_single_threaded(1),
        )

    def _recorder(self, names: list[str]) -> Iterator[Program]:
        if self._records is None:
            return
        inlet = self._records.inlet.fileno()
        yield Program(
            RECORDER,
            self._command("recorder", "--configuration", self._file, "--records", inlet, *self._recorded),
            (self._file, inlet),
            "\n".join(names) if "--decisions" in self._recorded else "",
            environment=_single_threaded(1),
        )

    def _look_for_state(self) -> None:
        """See whether there is a folder for checkpoints; it is not made here: whoever installs decides on it."""
        directory = self._configuration.state.directory
        self._keeping = Path(directory).is_dir()
        if not self._keeping:
            _log.info("state: there is no directory %s: a restart begins as [start] says", directory)

    def _keeper(self) -> Iterator[Program]:
        if self._keeping:
            inlet, path = self._checkpoints.inlet.fileno(), path_of(self._configuration)
            yield Program(
                KEEPER,
                self._command("keeper", "--checkpoints", inlet, "--file", path),
                (inlet,),
                str(path),
                environment=_single_threaded(1),
            )

    def _loop(self, names: list[str]) -> Program:
        heart = self._heart(LOOP)
        ends = [self._connection(name).inlet.fileno() for name in names]
        outlet = self._estimates.outlet.fileno()
        named = [word for name, end in zip(names, ends, strict=True) for word in ("--link", f"{name}={end}")]
        orders = self._orders.inlet.fileno()
        queues: list[int] = [orders]
        named += ["--orders", str(orders)]
        if self._records is not None:
            queues.append(self._records.outlet.fileno())
            named += ["--records", str(queues[-1])]
            named += ["--recorded"] if self._recording is not None else []
        if self._keeping:
            queues.append(self._checkpoints.outlet.fileno())
            named += ["--checkpoints", str(queues[-1])]
        return Program(
            LOOP,
            self._command(
                "loop",
                "--configuration",
                self._file,
                "--heart",
                heart.outlet.fileno(),
                "--publisher",
                outlet,
                *named,
            ),
            (self._file, heart.outlet.fileno(), outlet, *ends, *queues),
            self._configuration.model_dump_json(exclude={"state"}),
            heart.inlet,
            max(LOOP_PATIENCE, LOOP_PATIENCE_TICKS / self._configuration.loop.rate),
            LOOP_START,
            vital=True,
            environment=_single_threaded(self._configuration.budget.threads),
        )

    def _link(self, name: str) -> Program:
        settings = next(link for link in self._configuration.link if link.name == name)
        heart = self._heart(f"link {name}").outlet.fileno()
        outlet = self._connection(name).outlet.fileno()
        return Program(
            f"link {name}",
            self._command(
                "link", "--configuration", self._file, "--name", name, "--heart", heart, "--samples", outlet
            ),
            (self._file, heart, outlet),
            "\n".join(
                section.model_dump_json()
                for section in (settings, self._configuration.vehicle, self._configuration.publish)
            ),
            self._heart(f"link {name}").inlet,
            LINK_PATIENCE,
            LINK_START,
            environment=_single_threaded(1),
        )

    @staticmethod
    def _command(role: str, *arguments: str | int | Path) -> tuple[str, ...]:
        words = (role, "--parent", os.getpid(), *arguments)
        return (sys.executable, "-m", "service.process", *map(str, words))

    def _connection(self, name: str) -> Pair:
        if name not in self._links:
            self._links[name] = pair(LINK_QUEUE)
        return self._links[name]

    def _heart(self, name: str) -> Pair:
        if name not in self._hearts:
            self._hearts[name] = pair(_HEART_QUEUE)
        return self._hearts[name]

    @staticmethod
    def _disconnect(pairs: dict[str, Pair], kept: set[str]) -> None:
        for name in set(pairs) - kept:
            pairs.pop(name).close()


def _sealed(configuration: Configuration) -> int:
    """Return a descriptor of a file in memory that holds the configuration and cannot change any more."""
    descriptor = os.memfd_create("beliefd-configuration", os.MFD_CLOEXEC | os.MFD_ALLOW_SEALING)
    os.write(descriptor, configuration.model_dump_json().encode())
    fcntl.fcntl(descriptor, fcntl.F_ADD_SEALS, _F_SEALS)
    return descriptor


def configuration_from(descriptor: int) -> Configuration:
    """Return the configuration that the supervisor passed on."""
    content = os.pread(descriptor, os.fstat(descriptor).st_size, 0)
    return Configuration.model_validate_json(content)


def _single_threaded(threads: int) -> dict[str, str]:
    """Keep linear algebra from starting a thread for each processor; numba may have as many as configured."""
    return {
        "OPENBLAS_NUM_THREADS": "1",
        "OMP_NUM_THREADS": "1",
        "MKL_NUM_THREADS": "1",
        "NUMBA_NUM_THREADS": str(threads),
    }
