"""A recorded run replayed: the same again byte for byte, whatever it went through, and what is missing is told."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import jsonschema
import msgspec
import pytest
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader

from drivers.logs.recording import RecordingReader
from drivers.logs.recording import write as write_samples
from drivers.sample import Sample, Speed
from service.estimate import Estimate
from service.estimator import Estimator
from service.replay.comparing import Again
from service.replay.recorded import RecordedRunError, run_in
from service.replay.run import Plan, Run, replay
from service.replay.site import setting_of
from tests.service.recorded import configuration, record, said

TICKS = 300
SECOND = 1_000_000_000


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three seconds in real time."""
    path = tmp_path_factory.mktemp("run") / "drive.mcap"
    record(path, configuration(), TICKS)
    return path


def again(path: Path) -> Run:
    setting = setting_of((path,), None, None)
    return replay(Plan((path,), setting.configuration, 500, recorded=setting.recorded), 0)


def test_the_same_again_byte_for_byte(recording: Path) -> None:
    """With an order in its middle, and whatever this machine could afford; a shadow looks on in the replay."""
    run = again(recording)
    assert run.ticks == TICKS
    assert run.again == Again(TICKS, TICKS)
    assert run.links[0].malformed == {}
    assert run.links[0].samples > TICKS
    assert run.row()["again"] == {"published": TICKS, "same": TICKS}


def test_a_belief_that_went_on_from_a_checkpoint_does_so_again(tmp_path: Path) -> None:
    settings = configuration()
    before = Estimator(settings)
    for now in (SECOND, 2 * SECOND):
        before.ingest(sample for _, samples in said(now, SECOND) for sample in samples)
        began = before.tick(now, now, 500)
    kept = before.kept()
    assert began.particles
    assert kept is not None
    kept = kept._replace(time=time.monotonic_ns(), reset_counter=7)
    record(tmp_path / "drive.mcap", settings, 60, kept)
    run = again(tmp_path / "drive.mcap")
    assert run.again == Again(60, 60)
    (first, *_) = estimates(tmp_path / "drive.mcap")
    assert first.reset_counter == 7


def test_a_machine_that_affords_next_to_nothing_is_replayed_too(tmp_path: Path) -> None:
    """At 0.3 ms a tick most are thinned, cut, or only predicted."""
    record(tmp_path / "drive.mcap", configuration(cpu_ms=0.3), TICKS)
    assert any(estimate.level > 1 for estimate in estimates(tmp_path / "drive.mcap"))
    assert again(tmp_path / "drive.mcap").again == Again(TICKS, TICKS)


def estimates(path: Path) -> list[Estimate]:
    entries = RecordingReader(path).entries()
    return [msgspec.json.decode(entry.data, type=Estimate) for entry in entries if entry.topic == "estimate"]


def test_of_several_runs_the_longest_is_replayed(tmp_path: Path) -> None:
    record(tmp_path / "drive.mcap", configuration(), 60, runs=2)
    found = run_in(tmp_path / "drive.mcap")
    assert found is not None
    assert (found.number, found.of, found.ticks) == (0, 2, 60)
    assert again(tmp_path / "drive.mcap").again == Again(60, 60)


def test_others_read_it(recording: Path) -> None:
    """By the mcap library: compressed chunks; every channel with a JSON schema; Unix time, in the order of ticks."""
    with recording.open("rb") as file:
        assert {
            r.compression for r in StreamReader(file, emit_chunks=True).records if isinstance(r, Chunk)
        } == {"zstd"}
    with recording.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        found = list(reader.iter_messages())
    counts: dict[str, int] = {}
    for schema, channel, message in found:
        assert schema is not None
        assert schema.encoding == "jsonschema"
        assert isinstance(json.loads(schema.data), dict)
        assert isinstance(json.loads(message.data), dict)
        assert abs(message.log_time - time.time_ns()) < 600 * SECOND
        counts[channel.topic] = counts.get(channel.topic, 0) + 1
    assert counts.pop("sample/bus/test") > TICKS
    assert counts.pop("sample/radio/test") > TICKS
    assert counts == {"run": 1, "order": 1, "estimate": TICKS, "decision": TICKS}


def test_messages_are_as_their_schemas_say(recording: Path) -> None:
    """The first and the last on every channel."""
    ends: dict[tuple[str, bool], tuple[bytes, bytes]] = {}
    with recording.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            assert schema is not None
            ends.setdefault((channel.topic, False), (schema.data, message.data))
            ends[channel.topic, True] = schema.data, message.data
    assert len(ends) == 12
    for schema, message in ends.values():
        jsonschema.validate(json.loads(message), json.loads(schema))


def test_what_the_queue_had_no_room_for_is_counted(tmp_path: Path) -> None:
    """A recorder that is away for the whole run, and a queue of 64 KB: the rest of the ticks is lost to it."""
    record(tmp_path / "drive.mcap", configuration(), TICKS, room=1 << 16)
    found = run_in(tmp_path / "drive.mcap")
    assert found is not None
    assert 5 < found.ticks < TICKS
    run = again(tmp_path / "drive.mcap")
    assert run.ticks == found.ticks


def test_a_hole_is_counted_and_the_rest_replayed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A damaged chunk, in the middle: its ticks are missing, and after it nothing need be the same."""
    monkeypatch.setattr("service.run_file.CHUNK", 1 << 15)
    path = tmp_path / "hole.mcap"
    record(path, configuration(), TICKS)
    whole = path.read_bytes()
    places = [at for at in range(len(whole) - 4) if whole[at : at + 4] == b"\x28\xb5\x2f\xfd"]
    assert len(places) > 5
    at = places[len(places) // 2] + 50
    path.write_bytes(whole[:at] + bytes(byte ^ 0x55 for byte in whole[at : at + 8]) + whole[at + 8 :])
    run = again(path)
    assert run.links[0].malformed["broken_chunk"] == 1
    assert run.links[0].malformed["missing_ticks"] > 0
    assert 0 < run.ticks < TICKS


def test_one_cut_off_is_the_same_up_to_the_cut(recording: Path, tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    whole = recording.read_bytes()
    with recording.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    last = max(index.chunk_start_offset for index in summary.chunk_indexes)
    path.write_bytes(whole[: last + 100])
    run = again(path)
    assert run.again is not None
    assert run.again.same == run.again.published > 0
    assert run.links[0].malformed["broken_container"] == 1


def test_another_configuration_or_count_is_for_its_samples_alone(recording: Path, tmp_path: Path) -> None:
    """They are a recording of samples, like any other: ticks by their own clock."""
    setting = setting_of((recording,), None, None)
    run = replay(Plan((recording,), setting.configuration, 300), 0)
    assert run.again is None
    assert run.particles_mean <= 300.0
    assert run.ticks > TICKS // 2
    assert run.links[0].malformed == {}


def test_a_recording_of_samples_holds_no_run(tmp_path: Path) -> None:
    write_samples(tmp_path / "drive.mcap", [Sample(1, 2, "l", "s", Speed(1.0))])
    assert run_in(tmp_path / "drive.mcap") is None


def test_a_configuration_of_another_version_is_refused_in_words(recording: Path) -> None:
    found = run_in(recording)
    assert found is not None
    strange = msgspec.structs.replace(found.begun, configuration={"vehicle": {"name": 3}}, version="9.9")
    with pytest.raises(RecordedRunError, match=r"recorded by beliefd 9\.9.*--config"):
        replace(found, begun=strange).configuration()
