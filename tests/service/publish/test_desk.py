"""What is asked of the belief: checked at the desk, taken by the loop."""

from __future__ import annotations

import json

import pytest

from service.channels import Outlet, pair
from service.config import Configuration, Start, validated
from service.orders import LARGEST, Orders
from service.publish.desk import Desk
from service.publish.outlet import RefusedError

AREA = {"north": [-10.0, 10.0], "east": [-20.0, 20.0]}


def configuration(**sections: object) -> Configuration:
    file = {
        "vehicle": {"name": "mower"},
        "link": [{"name": "l", "kind": "mavlink", "url": "udpin:127.0.0.1:0"}],
        **sections,
    }
    return validated(file, Configuration, "test.toml")


def test_a_start_that_is_right_reaches_the_loop_whole() -> None:
    queue = pair(65536)
    told: list[Start] = []
    orders = Orders(queue.inlet, told.append)
    orders.take()
    assert told == []
    desk = Desk(configuration(area=AREA), Outlet(queue.outlet))
    for asked in ({"position": [1.0, 2.0, 3.0], "heading": -0.5}, {"mode": "global"}, {"mode": "first_fix"}):
        assert json.loads(desk.reinitialize(json.dumps(asked).encode())) == {"accepted": True}
        orders.take()
    assert [start.mode for start in told] == ["given", "global", "first_fix"]
    assert told[0].position == (1.0, 2.0, 3.0)
    assert (told[0].heading, told[0].sigma_heading) == (-0.5, 0.1)
    queue.close()


@pytest.mark.parametrize(
    ("asked", "reason"),
    [
        (b"", "has 0 bytes"),
        (b"{" + b" " * LARGEST + b"}", "bytes"),
        (b"{", "should be JSON"),
        (b"[" * 4000, "should be JSON"),
        (b"[]", "needs a table"),
        (b'{"position": [1, 2]}', "needs 3 numbers"),
        (b'{"position": [1, 2, 3], "headin": 0}', 'did you mean "heading"'),
        (b'{"position": [1, 2, 3], "heading": NaN}', "finite"),
        (b'{"mode": "global"}', "[area]"),
        (b'{"mode": "given"}', "needs a position"),
    ],
)
def test_what_is_no_start_is_refused_with_the_reason(asked: bytes, reason: str) -> None:
    queue = pair(65536)
    with pytest.raises(RefusedError) as refused:
        Desk(configuration(), Outlet(queue.outlet)).reinitialize(asked)
    assert reason in str(refused.value)
    queue.close()


def test_without_a_loop_that_takes_orders_it_is_refused() -> None:
    with pytest.raises(RefusedError, match="takes no orders"):
        Desk(configuration(), None).reinitialize(b'{"position": [1.0, 2.0, 3.0]}')


def test_a_datagram_that_is_no_order_is_counted() -> None:
    queue = pair(65536)
    told: list[Start] = []
    orders = Orders(queue.inlet, told.append)
    queue.outlet.send(b"nonsense")
    orders.take()
    assert (told, orders.malformed) == ([], 1)
    queue.close()
