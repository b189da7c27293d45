"""``send`` as its user has it: a process beside a publisher on loopback, its answer, its errors, its exit status."""

from __future__ import annotations

import contextlib
import json
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Callable, Generator
from pathlib import Path

import pytest

from service.channels import pair
from service.config import Start, load
from service.orders import Orders
from service.publish.session import open_from_file
from service.publish.zenoh import Publisher
from service.view.send import WrongUseError, facts_of
from tests.service.publish.conftest import Daemon
from tests.service.publish.spoken import wait_for

Begin = Callable[..., Daemon]


def beliefd(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", "from service.cli import main; main()", "send", *arguments],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
        env={**os.environ, "NO_COLOR": "1", "TERM": "dumb"},
    )


@contextlib.contextmanager
def publisher(folder: Path, endpoint: str, area: str = "") -> Generator[list[Start]]:
    """Answer queries in a thread, and take the orders as the loop does; yield what was told."""
    session, file = folder / "session.json5", folder / "mower.toml"
    settings = {"mode": "peer", "listen": {"endpoints": [endpoint]}}
    session.write_text(json.dumps(settings | {"scouting": {"multicast": {"enabled": False}}}))
    file.write_text(
        '[vehicle]\nname = "mower"\n[[link]]\nname = "l"\nkind = "mavlink"\nurl = "udpin:127.0.0.1:0"\n'
        f'[publish]\nzenoh = "{session}"\n{area}'
    )
    estimates, _loop = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    queue = pair(65536)
    told: list[Start] = []
    orders = Orders(queue.inlet, told.append)
    answering = Publisher(load(file), estimates, lambda: open_from_file(str(session)), queue.outlet)
    stop = threading.Event()

    def _serve() -> None:
        while not stop.is_set():
            answering.step(10)
            orders.take()

    thread = threading.Thread(target=_serve)
    thread.start()
    try:
        yield told
    finally:
        stop.set()
        thread.join()
        assert answering.close(5.0)
        queue.close()
        estimates.close()


def test_a_start_reaches_the_loop(tmp_path: Path, endpoint: str) -> None:
    """By options, by words and as JSON: three ways to say one thing."""
    ways = (
        ("--position", "-1.5,2,0", "--heading", "0.45"),
        ("position=[-1.5, 2, 0]", "heading=0.45"),
        ('{"position": [-1.5, 2, 0], "heading": 0.45}',),
    )
    with publisher(tmp_path, endpoint) as told:
        for way in ways:
            done = beliefd("mower", "reinitialize", *way, "--router", endpoint)
            assert (done.returncode, done.stderr) == (0, "")
            assert json.loads(done.stdout) == {"accepted": True}
        assert wait_for(lambda: len(told) == len(ways) or None)
    assert told[0].position == (-1.5, 2.0, 0.0)
    assert (told[0].heading, told[0].sigma_heading) == (0.45, 0.1)
    assert told == [told[0]] * len(ways)


def test_what_the_daemon_refuses_it_says_why(tmp_path: Path, endpoint: str) -> None:
    with publisher(tmp_path, endpoint):
        done = beliefd("mower", "reinitialize", "mode=global", "--router", endpoint)
    assert done.returncode == 1
    assert done.stdout == ""
    assert "mower refuses: " in done.stderr
    assert "[area]" in done.stderr


def test_a_vehicle_that_is_not_there_is_told_from_those_that_are(start: Begin, endpoint: str) -> None:
    start(endpoint, "mower")
    assert wait_for(lambda: beliefd("mower", "config", "--router", endpoint).returncode == 0 or None)
    done = beliefd("mowre", "reinitialize", "--position", "1,2,3", "--router", endpoint, "--timeout", "2")
    assert done.returncode == 1
    assert f"no vehicle mowre at {endpoint}; alive there: mower" in done.stderr
    assert 'did you mean "mower"?' in done.stderr


def test_nobody_at_all_is_said_with_what_to_do() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))  # bound, and not listening
        router = f"tcp/127.0.0.1:{taken.getsockname()[1]}"
        done = beliefd("mower", "status", "--router", router)
    assert done.returncode == 1
    assert f"nobody answers at {router}" in done.stderr
    assert "--router" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("mower", "reinitialise"), 'did you mean "reinitialize"?'),
        (("mower", "reinitialize"), "--position NORTH,EAST,DOWN"),
        (("mower", "reinitialize", "position=1,2"), "position: needs 3 numbers (north, east, down), got 2"),
        (("mower", "reinitialize", "headin=1", "--position", "1,2,3"), 'did you mean "heading"?'),
        (("mower", "reinitialize", "--position", "1,2,here"), "position"),
        (("mower", "reinitialize", "somewhere"), "NAME=VALUE"),
        (("mower", "reinitialize", "{position}"), "is no JSON object"),
        (("mower", "status", "now=1"), "status takes no now"),
        (("a/b", "status"), "one chunk of a key"),
        (("mower", "status", "--router", "localhost"), "protocol/host:port"),
        (("mower", "status", "--timeout", "0"), "--timeout"),
    ],
)
def test_wrong_use_is_told_from_failure(arguments: tuple[str, ...], said: str) -> None:
    """Exit 2, before anybody is asked: no endpoint of these tests answers."""
    done = beliefd(*arguments)
    assert done.returncode == 2, done.stderr
    assert said in done.stderr
    assert "Traceback" not in done.stderr


def test_facts_are_json_or_numbers_with_commas_or_text() -> None:
    words = ["mode=given", "position=1,-2.5,3", "heading=0.5", '{"sigma": [1, 1, 1]}']
    assert facts_of(words) == {
        "mode": "given",
        "position": [1, -2.5, 3],
        "heading": 0.5,
        "sigma": [1, 1, 1],
    }
    with pytest.raises(WrongUseError, match="NAME=VALUE"):
        facts_of(["=3"])
