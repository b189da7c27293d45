"""Entry of every process but the supervisor, and started only by it: ``python -m service.process <role> …``.

The roles are ``loop``, ``publisher``, ``recorder``, ``keeper`` and ``link``. The arguments are numbers of descriptors
that the supervisor passes on; see :mod:`service.wiring`.
"""

from __future__ import annotations

import argparse
import contextlib
import gc
import logging
import os
import signal
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NoReturn

from service.channels import Heart, Outlet, inherited
from service.journal import write_log
from service.realtime import die_with_parent, freeze_garbage, punctual

if TYPE_CHECKING:
    from service.checkpoint import Kept
    from service.config import Budget, Configuration
    from service.crew import Threads
    from service.estimator import Estimator

_log = logging.getLogger(__name__)


def _arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m service.process", description=__doc__)
    roles = parser.add_subparsers(dest="role", required=True)
    publisher = roles.add_parser("publisher")
    publisher.add_argument("--estimates", type=int, required=True)
    publisher.add_argument("--orders", type=int, required=True)
    loop = roles.add_parser("loop")
    loop.add_argument("--heart", type=int, required=True)
    loop.add_argument("--publisher", type=int, required=True)
    loop.add_argument("--orders", type=int, required=True)
    loop.add_argument("--records", type=int)
    loop.add_argument("--recorded", action="store_true")
    loop.add_argument("--checkpoints", type=int)
    loop.add_argument("--link", action="append", default=[], metavar="NAME=DESCRIPTOR")
    link = roles.add_parser("link")
    link.add_argument("--name", required=True)
    link.add_argument("--heart", type=int, required=True)
    link.add_argument("--samples", type=int, required=True)
    recorder = roles.add_parser("recorder")
    recorder.add_argument("--records", type=int, required=True)
    recorder.add_argument("--decisions", type=Path)
    recorder.add_argument("--recording", type=Path)
    keeper = roles.add_parser("keeper")
    keeper.add_argument("--checkpoints", type=int, required=True)
    keeper.add_argument("--file", type=Path, required=True)
    for role in (publisher, loop, link, recorder, keeper):
        role.add_argument("--parent", type=int, required=True)
    for role in (publisher, loop, link, recorder):
        role.add_argument("--configuration", type=int, required=True)
    return parser


def _configuration(arguments: argparse.Namespace) -> Configuration:
    from service.wiring import configuration_from

    return configuration_from(arguments.configuration)


def _publisher(arguments: argparse.Namespace) -> None:
    from service.publish.zenoh import run

    run(_configuration(arguments), inherited(arguments.estimates), inherited(arguments.orders))


def _recorder(arguments: argparse.Namespace) -> None:
    from service.recorder import decision_log, run, run_recording

    sinks = [run_recording(arguments.recording)] if arguments.recording is not None else []
    if arguments.decisions is not None:
        sinks.append(
            decision_log(arguments.decisions, [link.name for link in _configuration(arguments).link])
        )
    run(sinks, inherited(arguments.records))


def _keeper(arguments: argparse.Namespace) -> None:
    from service.keeper import run

    run(arguments.file, inherited(arguments.checkpoints))


def _link(arguments: argparse.Namespace) -> None:
    from service.link_process import LinkProcess
    from service.links import link_named

    signal.signal(signal.SIGTERM, _leave)
    link = link_named(_configuration(arguments), arguments.name)
    LinkProcess(arguments.name, link, inherited(arguments.samples), Heart(inherited(arguments.heart))).run()


class _Stopped(BaseException):
    """SIGTERM, out of whatever a link is waiting in; no driver catches it."""


def _leave(_signal: int, _frame: object) -> None:
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    raise _Stopped


def _loop(arguments: argparse.Namespace) -> None:
    gc.disable()  # until it is frozen: looking for garbage among a compiler's modules is a tenth of the start
    from service import kernels

    configuration = _configuration(arguments)
    heart = Heart(inherited(arguments.heart))
    cache = kernels.warm(
        lambda name, done, count: heart.announce(f"compiling kernels, {done} of {count}: {name}")
    )

    from service.budget import Meters
    from service.checkpoint import Checkpoints
    from service.decisions import DecisionSender
    from service.estimator import Estimator
    from service.inlet import Inlet
    from service.loop import Loop
    from service.orders import Orders
    from service.records import Doubled
    from service.shapes import shapes_of

    heart.announce("rehearsing")
    shapes = shapes_of(configuration, cache)
    meters = Meters(configuration.loop.rate)
    for refusal in punctual(configuration.loop.priority, configuration.loop.cpus):
        _log.warning("loop: %s", refusal)
    crew = _crew(configuration.budget)  # after that: its threads inherit the priority
    links = [argument.rpartition("=") for argument in arguments.link]
    records = None if arguments.records is None else Outlet(inherited(arguments.records))
    recorded = records if arguments.recorded else None
    publisher = Outlet(inherited(arguments.publisher))
    estimator = Estimator(configuration, meters, crew=crew)
    checkpoints = kept = None
    if arguments.checkpoints is not None:
        kept = _resume(estimator, configuration)
        checkpoints = Checkpoints(configuration, Outlet(inherited(arguments.checkpoints)), estimator.kept)
    loop = Loop(
        configuration,
        estimator,
        meters,
        [Inlet(name, inherited(int(descriptor)), recorded) for name, _, descriptor in links],
        publisher if recorded is None else Doubled(publisher, recorded),
        heart,
        shapes,
        None if records is None else DecisionSender(records, len(links)),
        Orders(inherited(arguments.orders), estimator.reinitialize, recorded),
        checkpoints,
    )
    if recorded is not None:
        _tell_beginning(recorded, configuration, kept)
    stopped = _stop_flag()
    freeze_garbage()
    loop.run(stopped)
    _log.info("loop: %s", loop.summary())


def _tell_beginning(records: Outlet, configuration: Configuration, kept: Kept | None) -> None:
    from service.records import begun, tell

    if not tell(records, begun(configuration, kept)):
        _log.warning(
            "loop: the recorder has no room for what this run began with: it will replay as samples only"
        )


def _resume(estimator: Estimator, configuration: Configuration) -> Kept | None:
    """Have the belief go on from a checkpoint that is whole and young enough, and return it; the journal tells it."""
    from service.checkpoint import CheckpointError, read

    now = time.monotonic_ns()
    try:
        kept = read(configuration, now, time.time_ns())
        if kept is not None:
            estimator.resume(kept)
            _log.info("loop: goes on from a checkpoint of %.1f s ago", (now - kept.time) * 1e-9)
            return kept
    except (CheckpointError, ValueError) as error:
        _log.warning("loop: the checkpoint is not used: %s; starting as [start] says", error)
    return None


def _crew(budget: Budget) -> Threads | None:
    """Hire the threads that the configuration allows, if they are worth it; one is no crew, and none is started."""
    if budget.threads == 1:
        return None
    from service.crew import hired

    crew = hired(budget.threads, budget.particles_max)
    if crew is None:
        _log.info("loop: %d threads are no faster than one here; one works", budget.threads)
    else:
        _log.info("loop: %d threads share the work from %d particles", budget.threads, crew.fewest)
    return crew


def _stop_flag() -> Callable[[], bool]:
    """Return what tells whether SIGTERM has come: the tick under way is finished first."""
    stop = False

    def note(_signal: int, _frame: object) -> None:
        nonlocal stop
        stop = True

    signal.signal(signal.SIGTERM, note)
    return lambda: stop


_ROLES = {"publisher": _publisher, "recorder": _recorder, "keeper": _keeper, "loop": _loop, "link": _link}


def main() -> NoReturn:
    """Run one role until SIGTERM."""
    arguments = _arguments().parse_args()
    die_with_parent(arguments.parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    write_log()
    with contextlib.suppress(_Stopped):
        _ROLES[arguments.role](arguments)
    # Everything is closed. Taking the interpreter apart, dialects and kernels and all, would only take
    # time that a stop within two seconds does not have on a busy machine.
    logging.shutdown()
    sys.stderr.flush()
    os._exit(0)


if __name__ == "__main__":
    main()
