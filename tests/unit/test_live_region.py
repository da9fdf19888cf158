"""The region of a live session: one layout in two languages, and no torn word is ever taken for a whole one."""

import json
import subprocess

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.live import layout
from pellucid.live.engine import engine_program
from pellucid.live.shared_memory import Region


@pytest.fixture
def region(tmp_path):
    return Region.create(tmp_path / "region", 1_000_000)


def write_records(region, count):
    """Write records as an engine does, after those that are there."""
    for _ in range(count):
        number = region.record_count + 1
        slot = region._records[(number - 1) % layout.RECORD_CAPACITY : (number - 1) % layout.RECORD_CAPACITY + 1]
        slot["number"] = slot["number_again"] = slot["cycle"] = number
        slot["deadline"] = slot["time"] = region.epoch_ns + number * region.period_ns
        region._header["records"] = number


def test_both_languages_have_one_layout():
    said = json.loads(subprocess.run([engine_program(), "--layout"], check=True, capture_output=True, text=True).stdout)
    blocks = {"Header": "HEADER", "Record": "RECORD", "Event": "EVENT", "Status": "STATUS", "Command": "COMMAND"}
    blocks["RecorderStatus"] = "RECORDER"
    kinds = {name: getattr(layout, f"{kind}_TYPE") for name, kind in blocks.items()}
    places = {key: place for key, place in said.items() if "." in key}
    assert len(places) > 80
    for key, place in places.items():
        kind, field = key.split(".")
        assert kinds[kind].fields[field][1] == place, key
    assert said["sizes"] == {kind.lower(): getattr(layout, f"{kind}_TYPE").itemsize for kind in blocks.values()}
    assert said["region_bytes"] == layout.REGION_BYTES
    assert said["blocks"]["records"] == layout.RECORD_OFFSET
    assert said["version"] == layout.REGION_VERSION


def test_a_command_carries_its_checksum_and_a_sign_of_life(region):
    first = region.last_command()
    number = region.command(run=1, target=0.7)
    last = region.last_command()
    assert number == int(first["sequence"]) + 1
    assert (int(last["run"]), float(last["target"])) == (1, 0.7)
    assert int(last["heartbeat"]) > int(first["heartbeat"])
    words = np.frombuffer(last.tobytes(), "<u8")
    assert layout.checksum(words[:-1]) == int(last["checksum"])
    assert layout.checksum(words[:-1] ^ np.uint64(1)) != int(last["checksum"])


def test_records_are_read_once_and_in_order(region):
    write_records(region, 10)
    cursor, records, lost = region.records_since(0)
    assert (cursor, records["number"].tolist(), lost) == (10, list(range(1, 11)), 0)
    cursor, records, lost = region.records_since(cursor)
    assert (cursor, len(records), lost) == (10, 0, 0)
    write_records(region, 5)
    cursor, records, _ = region.records_since(10, limit=2)
    assert (cursor, records["number"].tolist()) == (12, [11, 12])


def test_a_torn_record_is_left_out_and_counted(region):
    write_records(region, 5)
    region._records["number_again"][2] = 0
    _, records, lost = region.records_since(0)
    assert (records["number"].tolist(), lost) == ([1, 2, 4, 5], 1)


def test_what_was_overwritten_is_counted(region):
    region._header["records"] = layout.RECORD_CAPACITY + 1000
    write_records(region, 1)
    _, records, lost = region.records_since(0)
    assert len(records) == 1
    assert lost == layout.RECORD_CAPACITY + 1000


def test_events_come_back_with_their_time_and_data(region):
    region.write_event("cue", {"target": 0.5, "word": "jetzt — los"}, time_s=12.25)
    region.write_event("rest")
    cursor, events = region.events_since(0)
    assert cursor == 2
    assert (events[0].kind, events[0].time, events[0].data) == ("cue", 12.25, {"target": 0.5, "word": "jetzt — los"})
    assert region.events_since(cursor) == (2, [])
    for i in range(layout.EVENT_CAPACITY + 10):
        region.write_event("many", {"i": i})
    _, events = region.events_since(cursor)
    assert len(events) == layout.EVENT_CAPACITY - 1
    assert events[-1].data["i"] == layout.EVENT_CAPACITY + 9


def test_an_event_that_is_too_long_or_no_number_is_refused(region):
    with pytest.raises(PellucidError, match="expected at most"):
        region.write_event("cue", {"text": "x" * layout.TEXT_BYTES})
    with pytest.raises(ValueError, match="JSON"):
        region.write_event("cue", {"angle": float("nan")})
    assert region.event_count == 0


def test_a_file_that_is_no_region_is_refused(tmp_path):
    with pytest.raises(PellucidError, match="No such file"):
        Region(tmp_path / "none")
    (tmp_path / "short").write_bytes(b"PELLLIVE")
    with pytest.raises(PellucidError, match="found 8 bytes"):
        Region(tmp_path / "short")
    with (tmp_path / "zeros").open("wb") as file:
        file.truncate(layout.REGION_BYTES)
    with pytest.raises(PellucidError, match="found no region"):
        Region(tmp_path / "zeros")


def test_edges_of_lateness_are_those_of_the_engine():
    edges = layout.lateness_edges()
    assert len(edges) == layout.LATENESS_BIN_COUNT + 1
    assert edges[:3].tolist() == [0.0, 1.024e-6, 1.28e-6]
    assert np.all(np.diff(edges) > 0.0)
    assert edges[5] == pytest.approx(2.048e-6)
