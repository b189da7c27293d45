"""Sessions: what cannot be opened says why and what would be right."""

from __future__ import annotations

from pathlib import Path

import pytest

from service.publish.session import SessionError, close, open_client, open_embedded, open_from_file


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(SessionError, match=r"publish\.zenoh: .*none\.json5 is not a file"):
        open_from_file(str(tmp_path / "none.json5"))


@pytest.mark.parametrize(
    ("content", "said"), [('{mode: "peer", listn: {}}', "unknown field `listn`"), ("{mode:", "expected")]
)
def test_a_wrong_file_is_explained(tmp_path: Path, content: str, said: str) -> None:
    path = tmp_path / "zenoh.json5"
    path.write_text(content)
    with pytest.raises(SessionError, match=said) as refusal:
        open_from_file(str(path))
    assert "zenoh.json5" in str(refusal.value)
    assert ".rs:" not in str(refusal.value)


def test_a_busy_port_in_a_file_is_said(tmp_path: Path, endpoint: str) -> None:
    path = tmp_path / "zenoh.json5"
    path.write_text(f'{{listen: {{endpoints: ["{endpoint}"]}}, scouting: {{multicast: {{enabled: false}}}}}}')
    first = open_from_file(str(path))
    with pytest.raises(SessionError, match="Address already in use"):
        open_from_file(str(path))
    assert close(first.session, 10.0)


def test_a_client_of_nobody_is_told_so(endpoint: str) -> None:
    with pytest.raises(SessionError, match="Unable to connect"):
        open_client(endpoint)


def test_what_is_no_endpoint_is_told_so() -> None:
    with pytest.raises(SessionError, match="<protocol>/<address>"):
        open_client("127.0.0.1:7447")


def test_only_a_guest_whose_hub_has_gone_is_orphaned(endpoint: str) -> None:
    hub = open_embedded(endpoint)
    guest = open_embedded(endpoint)
    assert guest.hub == endpoint
    assert not hub.orphaned()
    assert not guest.orphaned()
    assert close(hub.session, 10.0)
    assert guest.orphaned()
    assert close(guest.session, 10.0)
