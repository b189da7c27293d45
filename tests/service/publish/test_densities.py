"""A density of the cloud, over a real Zenoh session, from a process of its own."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import numpy as np
import pytest
import zenoh
from numpy.typing import NDArray

from service.estimate import Density
from service.publish.densities import AT_ONCE, Densities
from service.publish.inbox import parse
from service.publish.outlet import RefusedError
from tests.service.publish.conftest import Daemon
from tests.service.publish.spoken import cloud, wait_for

KEY = "beliefd/v1/mower/@rpc/density"


def rows() -> NDArray[np.float32]:
    """600 particles about (0, 0), 400 about (0, 14), each half a metre wide."""
    rng = np.random.default_rng(1)
    east = np.repeat([0.0, 14.0], [600, 400])
    return np.stack(
        [
            rng.normal(0.0, 0.5, 1000),
            rng.normal(east, 0.5),
            rng.normal(1.0, 0.1, 1000),
            np.full(1000, 1e-3),
        ],
        axis=1,
    ).astype(np.float32)


def test_a_density_is_made_of_the_newest_cloud(
    start: Callable[..., Daemon], client: Callable[[], zenoh.Session], endpoint: str
) -> None:
    """k-means finds the two places; what cannot be asked for is refused with what could be."""
    daemon = start(endpoint)
    session = client()

    def asked(selector: str) -> zenoh.Reply | None:
        replies = list(session.get(KEY + selector, timeout=10.0))
        return replies[0] if replies else None

    def refused(selector: str, word: str) -> bool:
        reply = asked(selector)
        return reply is not None and reply.err is not None and word in reply.err.payload.to_string()

    assert wait_for(lambda: refused("?extractor=gaussian", "publish.particles"))
    assert refused("?extractor=magic", "gaussian, kmeans, histogram, tree, kernel")
    assert refused("", "extractor=")
    daemon.send(cloud(rows(), time=1_700_000_007.0))

    def made() -> Density | None:
        reply = asked("?extractor=kmeans")
        if reply is None or reply.ok is None:
            return None
        return msgspec.json.decode(reply.ok.payload.to_bytes(), type=Density)

    found = wait_for(made, 60.0)
    assert isinstance(found, Density)
    assert (found.extractor, found.time, found.particles) == ("kmeans", 1_700_000_007.0, 1000)
    assert found.components is not None
    assert [round(each.weight, 2) for each in found.components] == [0.6, 0.4]
    assert [round(each.mean[1]) for each in found.components] == [0, 14]


def test_only_so_many_are_made_at_once() -> None:
    """Each process is ended with the one that started it."""
    value = parse(cloud(rows()))
    densities = Densities(lambda: value)
    told: list[object] = []
    for _ in range(AT_ONCE):
        densities.ask({"extractor": "gaussian"}, told.append, told.append)
    with pytest.raises(RefusedError, match="ask again"):
        densities.ask({"extractor": "gaussian"}, told.append, told.append)
    densities.close()
    densities.look_after()
    assert not told


def test_a_cloud_that_does_not_do_is_refused_with_the_reason() -> None:
    """Particles without weight have no density, and the extractor says so."""
    value = parse(cloud(np.zeros((10, 4), np.float32)))
    densities, reasons, replies = Densities(lambda: value), list[str](), list[bytes]()
    densities.ask({"extractor": "gaussian"}, replies.append, reasons.append)

    def done() -> list[str]:
        densities.look_after()
        return reasons

    wait_for(done, 60.0)
    assert "positive finite sum" in reasons[0] or "not done" in reasons[0]
    assert not replies
    densities.close()
