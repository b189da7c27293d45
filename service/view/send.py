"""``beliefd send``: one query to a daemon, and its answer on standard output."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence

import zenoh

from service.cli.failure import DONE, FAILED, WRONG_USE, say
from service.config import ConfigurationError, Site, validated
from service.config.complaints import did_you_mean
from service.publish.session import LOOPBACK, SessionError, close, open_client
from service.publish.topics import DENSITY, PREFIX, QUERIES, REINITIALIZE, REQUESTS, Keys
from service.view.feed import vehicles

_PREFIX = "@rpc/"
NAMES = tuple(key.removeprefix(_PREFIX) for key in (*REQUESTS, *QUERIES))
"""What can be asked."""

_CLOSING = 1.0
_ANYWHERE = {"north": [0.0, 1.0], "east": [0.0, 1.0]}


class WrongUseError(ValueError):
    """What is asked for cannot be sent; the text says why and what would be right."""


def run(
    vehicle: str,
    request: str,
    facts: Mapping[str, object],
    router: str | None,
    timeout: float,
    prefix: str = PREFIX,
) -> int:
    """Ask a vehicle's daemon, and write its answer down; return the exit status.

    Parameters
    ----------
    vehicle : str
        Its name.
    request : str
        One of :data:`NAMES`.
    facts : mapping
        What it needs: of ``reinitialize`` the start, as ``[start]`` has it; of ``density`` the extractor.
    router : str or None
        Zenoh endpoint to connect to; without it the daemon on this machine.
    timeout : float
        Seconds to wait for the answer.
    prefix : str
        As ``publish.prefix`` of the daemon.
    """
    endpoint = router or LOOPBACK
    try:
        keys = _checked(vehicle, request, facts, endpoint, prefix)
        session = open_client(endpoint)
    except WrongUseError as error:
        return _failed(str(error), WRONG_USE)
    except ConfigurationError as error:
        return _failed("; ".join(error.errors), WRONG_USE)
    except SessionError:
        return _failed(
            f"nobody answers at {endpoint}: is `beliefd run` started there? "
            "Another place is named with --router tcp/HOST:PORT",
            FAILED,
        )
    try:
        return _ask(session, keys, request, facts, timeout, endpoint)
    except zenoh.ZError as error:
        return _failed(f"{endpoint}: {error}", FAILED)
    finally:
        close(session, _CLOSING)


def facts_of(words: Sequence[str]) -> dict[str, object]:
    """Return what ``name=value`` words and JSON objects say; a list may be written with commas alone.

    Raises
    ------
    WrongUseError
        A word is neither.
    """
    facts: dict[str, object] = {}
    for word in words:
        name, sign, value = word.partition("=")
        if word.lstrip().startswith("{"):
            facts |= _object(word)
        elif sign and name:
            facts[name] = value_of(value)
        else:
            raise WrongUseError(f"{word}: needs NAME=VALUE, such as heading=0.45, or a JSON object")
    return facts


def value_of(text: str) -> object:
    """Return a value as it is written on a command line: JSON, numbers with commas between them, or else text."""
    for written in (text, f"[{text}]") if "," in text else (text,):
        try:
            return json.loads(written)
        except ValueError:
            continue
    return text


def _object(word: str) -> dict[str, object]:
    try:
        return dict(json.loads(word))
    except (ValueError, TypeError, RecursionError) as error:
        raise WrongUseError(f"{word}: is no JSON object: {error}") from error


def _checked(vehicle: str, request: str, facts: Mapping[str, object], endpoint: str, prefix: str) -> Keys:
    """Return the vehicle's keys, having found nothing wrong that can be found without asking it."""
    if request not in NAMES:
        raise WrongUseError(f"no query {request}, there is {', '.join(NAMES)}{did_you_mean(request, NAMES)}")
    if "/" not in endpoint:
        raise WrongUseError(
            f"--router {endpoint}: an endpoint is written protocol/host:port, as tcp/192.168.1.7:7447"
        )
    key = _PREFIX + request
    if key == REINITIALIZE:
        if not facts:
            raise WrongUseError(
                "reinitialize needs to know where: --position NORTH,EAST,DOWN, or mode=global or mode=first_fix"
            )
        validated({"start": dict(facts), "area": _ANYWHERE}, Site, "reinitialize")
    elif facts.keys() - ({"extractor"} if key == DENSITY else set()):
        raise WrongUseError(f"{request} takes no {', '.join(facts)}")
    try:
        return Keys(prefix, vehicle)
    except ValueError as error:
        raise WrongUseError(str(error)) from error


def _ask(
    session: zenoh.Session,
    keys: Keys,
    request: str,
    facts: Mapping[str, object],
    timeout: float,
    endpoint: str,
) -> int:
    key = _PREFIX + request
    selector = keys.of(key) + (f"?extractor={facts['extractor']}" if "extractor" in facts else "")
    start = json.dumps(dict(facts)).encode() if key == REINITIALIZE else None
    for reply in session.get(selector, payload=start, timeout=timeout):
        if reply.ok is not None:
            sys.stdout.write(reply.ok.payload.to_string() + "\n")
            sys.stdout.flush()
            return DONE
        if reply.err is not None:
            reason = _reason(reply.err.payload.to_bytes())
            if reason is not None:
                return _failed(f"{keys.vehicle} refuses: {reason}", FAILED)
    return _failed(_silence(session, keys, timeout, endpoint), FAILED)


def _reason(payload: bytes) -> str | None:
    """Return the reason of a refusal; ``None`` for Zenoh's own word that time is up."""
    try:
        return str(json.loads(payload)["reason"])
    except (ValueError, TypeError, KeyError):
        return None


def _silence(session: zenoh.Session, keys: Keys, timeout: float, endpoint: str) -> str:
    """Return why nobody answered: because there is no such vehicle, or because it does not."""
    alive = vehicles(session, keys.prefix)
    if keys.vehicle in alive:
        return f"{keys.vehicle} is alive at {endpoint} and did not answer within {timeout:g} s"
    if not alive:
        return (
            f"connected to {endpoint}, but no vehicle is alive under {keys.prefix}/: "
            "its daemon may be starting, or publish under another prefix (--prefix)"
        )
    return f"no vehicle {keys.vehicle} at {endpoint}; alive there: {', '.join(alive)}" + did_you_mean(
        keys.vehicle, alive
    )


def _failed(text: str, status: int) -> int:
    say(f"beliefd send: {text}")
    return status
