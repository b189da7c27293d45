"""Who is believed, and that nothing that a peer can say raises."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.mavlink.decode import Decoder
from drivers.mavlink.frames import Frame, frame_at
from drivers.mavlink.settings import MavlinkSettings, ServoCalibration
from drivers.plausibility import implausible
from drivers.sample import SampleBatch, decode, encode
from tests.drivers.mavlink.conftest import Ear
from tests.drivers.mavlink.wire import LAYOUTS, attitude, heartbeat, payload, raw_frame, struct

EVERYTHING = MavlinkSettings(
    url="",
    servos=(ServoCalibration(1), ServoCalibration(20)),
    hud=frozenset({"groundspeed", "altitude", "heading"}),
    geoid_height=10.0,
)


def test_samples_carry_link_and_source(ear: Ear) -> None:
    (sample,) = ear.hear(attitude(5_000))
    assert (sample.link, sample.source) == ("autopilot", "ATTITUDE")


def test_the_first_autopilot_is_the_vehicle(listen: Callable[..., Ear]) -> None:
    ear = listen()
    assert ear.decoder.vehicle == 1
    assert ear.hear(heartbeat(system=2), attitude(5_000, system=2)) == []
    assert dict(ear.decoder.ignored) == {"HEARTBEAT": 1, "ATTITUDE": 1}


def test_ground_stations_and_gimbals_are_not_the_vehicle() -> None:
    decoder = Decoder("autopilot", MavlinkSettings(url=""))

    def hear(data: bytes) -> int:
        found = frame_at(data, 0)
        assert isinstance(found, Frame)
        return len(decoder.decode(found.message(), 10**9))

    assert hear(heartbeat(system=255, component=190, kind=6, autopilot=8)) == 0  # ground station
    assert hear(heartbeat(system=1, component=154, kind=26, autopilot=8)) == 0  # gimbal
    assert hear(heartbeat(system=1, component=191, kind=18, autopilot=8)) == 0  # companion
    assert decoder.vehicle is None
    assert hear(attitude(5_000, component=154)) == 0  # the gimbal's attitude is not the vehicle's
    assert hear(heartbeat(system=4)) == 1
    assert decoder.vehicle == 4
    assert decoder.autopilot_address == (4, 1)
    assert decoder.ignored.total() == 4


def test_a_named_system_and_named_components(listen: Callable[..., Ear]) -> None:
    ear = listen(system=7, components=frozenset({1, 158}))
    assert ear.decoder.vehicle == 7  # and not 1, whose heartbeat came first
    assert len(ear.hear(attitude(5_000, system=7))) == 1
    assert len(ear.hear(attitude(5_000, system=7, component=158))) == 1
    assert ear.hear(attitude(5_000, system=7, component=2)) == []
    assert ear.hear(attitude(5_000, system=1)) == []


def test_each_component_has_its_own_clock(ear: Ear) -> None:
    ear.hear(attitude(1_000), at=50 * 10**9)
    (other,) = ear.hear(attitude(900_000, component=2), at=50 * 10**9 + 1)
    assert other.time == 50 * 10**9 + 1
    assert ear.decoder.clocks(1, 1).boot.offset != ear.decoder.clocks(1, 2).boot.offset


def test_an_unwanted_message_is_counted(ear: Ear) -> None:
    found = frame_at(raw_frame(111, 34, payload("TIMESYNC", 1, 2)), 0)
    assert isinstance(found, Frame)
    assert ear.decoder.decode(found.message(), 10**9) == []
    assert ear.decoder.ignored["TIMESYNC"] == 1


@settings(max_examples=400)
@given(st.sampled_from(sorted(LAYOUTS)), st.data())
def test_no_payload_raises_and_every_sample_can_be_true(name: str, data: st.DataObject) -> None:
    """Any bytes with a right checksum: decoded, refused or ignored; what comes out survives the socket."""
    decoder = Decoder("autopilot", EVERYTHING)
    identifier, extra, layout = LAYOUTS[name]
    for _ in range(3):
        body = data.draw(st.binary(max_size=struct.calcsize(layout)))
        found = frame_at(raw_frame(identifier, extra, body), 0)
        assert isinstance(found, Frame)
        samples = decoder.decode(found.message(), 10**15)
        assert all(implausible(s.reading) is None for s in samples)
        assert all(s.time <= s.received for s in samples)
        assert decode(encode(SampleBatch(samples))) == SampleBatch(samples)
