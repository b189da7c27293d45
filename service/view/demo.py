"""``beliefd demo``: the whole chain on this machine, watched as any Zenoh client would watch it.

A simulated vehicle drives and speaks MAVLink and DroneCAN, the daemon runs as it would on a real one, and
this process subscribes. At the end the estimates that arrived are compared with the truth that the
simulator wrote.
"""

from __future__ import annotations

import contextlib
import io
import math
import os
import re
import signal
import sys
import time
from collections.abc import Callable, Generator
from pathlib import Path

import zenoh
from rich.console import Console
from rich.live import Live

from service.publish.session import SessionError, close, open_client
from service.publish.topics import Keys
from service.view.feed import Feed
from service.view.known import Known
from service.view.panel import Screen, metres
from service.view.stage import Stage, StageError, stage, warm
from service.view.truth import TruthTail
from service.view.verdict import Record, Verdict, judge

FAILED = 1
WRONG_USE = 2
SEED = 1

_START = 60.0
_FRAME = 0.125
_MARGIN = 10.0
_CLOSING = 1.0
_PICTURE = (110, 32)
_FONT_FACES = re.compile(r"@font-face\s*\{.*?\}\s*", re.DOTALL)
"""Rich would have the viewer fetch a font from elsewhere; the reader's own monospace will do."""


class _DemoError(Exception):
    """The demonstration cannot go on; the text says why, and what the program in question said last."""


def run(seconds: float, scenario: str, picture: Path | None = None) -> int:
    """Run the demonstration; return the exit status.

    Parameters
    ----------
    seconds : float
        How long the vehicle drives.
    scenario : str
        Which of the simulator's scenarios.
    picture : Path or None
        Where to write the live view as it was at the end, as SVG.

    Notes
    -----
    Success is that both links brought samples, estimates arrived, and their error is sane. Whatever happens,
    everything that was started is stopped.
    """
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)
    console = Console()
    errors = Console(stderr=True)
    closed = True
    verdict: Verdict | None = None
    try:
        with stage(scenario, SEED) as put_up:
            session = _opened(put_up)
            try:
                verdict = _Watch(put_up, session, console).through(seconds, picture)
            finally:
                closed = close(session, _CLOSING)
    except StageError as error:
        errors.print(f"beliefd demo: {error}", style="red", markup=False, highlight=False)
        return WRONG_USE
    except _DemoError as error:
        errors.print(f"beliefd demo: {error}", style="red", markup=False, highlight=False)
    except KeyboardInterrupt:
        errors.print("beliefd demo: interrupted; everything is stopped")
    if verdict is not None:
        console.print(verdict.table())
    status = 0 if verdict is not None and not verdict.failures else FAILED
    if not closed:
        sys.stdout.flush()
        os._exit(status)  # a stalled session would hang the interpreter's exit
    return status


def _opened(put_up: Stage) -> zenoh.Session:
    if warm():
        raise _DemoError("the kernels could not be compiled")
    put_up.start_daemon()
    deadline = time.monotonic() + _START
    while True:
        try:
            return open_client(put_up.endpoint)
        except SessionError as error:
            if put_up.died() or time.monotonic() > deadline:
                reason = put_up.died() or f"the daemon did not open its session within {_START:g} s: {error}"
                raise _DemoError(f"{reason}\n{put_up.tail('daemon')}") from error
            time.sleep(_FRAME)


class _Watch:
    """A subscriber that shows what arrives and keeps it for the end."""

    def __init__(self, put_up: Stage, session: zenoh.Session, console: Console) -> None:
        configuration = put_up.configuration
        self._stage = put_up
        self._console = console
        self._feed = Feed(session, Keys(configuration.publish.prefix, configuration.vehicle.name))
        self._known = Known(configuration.vehicle.name)
        self._known.configured(configuration.model_dump_json().encode())
        self._record = Record()
        self._truth = TruthTail(put_up.truth)
        self._live: Live | None = None
        self._said = 0

    def through(self, seconds: float, picture: Path | None) -> Verdict:
        """Watch the daemon start and the vehicle drive; stop both, and judge."""
        with self._shown():
            self._wait("the daemon starts", lambda: self._known.estimate is not None)
            self._stage.start_vehicle(seconds + _MARGIN)
            self._wait("the vehicle starts", lambda: self._known.truth is not None)
            start = time.monotonic()
            while (elapsed := time.monotonic() - start) < seconds:
                self._turn(f"{elapsed:.0f} of {seconds:g} s, {self._known.rate():.0f} Hz", elapsed)
        if picture is not None:
            self._draw(picture, f"{seconds:g} s, {self._known.rate():.0f} Hz")
        self._stage.stop()
        verdict = judge(self._record, self._stage.configuration, self._stage.truth)
        if verdict.failures:
            self._console.print(
                f"the daemon said at last:\n{self._stage.tail('daemon')}", markup=False, highlight=False
            )
        return verdict

    @contextlib.contextmanager
    def _shown(self) -> Generator[None]:
        if not self._console.is_terminal:
            yield
            return
        with Live(Screen(self._known), screen=True, auto_refresh=False, console=self._console) as self._live:
            yield
        self._live = None

    def _wait(self, note: str, come: Callable[[], bool]) -> None:
        deadline = time.monotonic() + _START
        while not come():
            self._turn(note, None)
            if time.monotonic() > deadline:
                raise _DemoError(f"{note}, but not within {_START:g} s\n{self._stage.tail('daemon')}")

    def _turn(self, note: str, elapsed: float | None) -> None:
        deadline = time.monotonic() + _FRAME
        for topic, payload in self._feed.poll():
            self._known.take(topic, payload)
            if elapsed is not None:
                self._record.take(topic, payload)
        self._known.truth = self._truth.latest()
        if (ended := self._stage.died()) is not None:
            name = "vehicle" if "vehicle" in ended else "daemon"
            raise _DemoError(f"{ended}\n{self._stage.tail(name)}")
        if self._live is not None:
            self._live.update(Screen(self._known, note), refresh=True)
        elif elapsed is not None and elapsed >= self._said + 1:
            self._said = int(elapsed)
            self._console.print(_line(self._known, self._said), markup=False, highlight=False, soft_wrap=True)
        time.sleep(max(0.0, deadline - time.monotonic()))

    def _draw(self, picture: Path, note: str) -> None:
        columns, rows = _PICTURE
        paper = Console(
            record=True,
            width=columns,
            height=rows,
            file=io.StringIO(),
            force_terminal=True,
            color_system="truecolor",
        )
        paper.print(Screen(self._known, note))
        picture.parent.mkdir(parents=True, exist_ok=True)
        picture.write_text(_FONT_FACES.sub("", paper.export_svg(title="beliefd demo")))


def _line(known: Known, second: int) -> str:
    estimate = known.estimate
    if estimate is None:
        return f"{second:4d} s  nothing has arrived"
    north, east, _ = estimate.position
    error = ""
    if known.truth is not None and north is not None and east is not None:
        error = f"  off {math.hypot(north - known.truth[0], east - known.truth[1]):.2f} m"
    use = "" if known.budget is None else f"  budget {known.budget.use:.0%}"
    return (
        f"{second:4d} s  {estimate.health:14}  north {metres(north):>7}  east {metres(east):>7}"
        f"  radius95 {metres(estimate.radius95):>6} m{error}  {estimate.particles:,} particles{use}"
    )
