"""What `pellucid incident` says of a record: the acting watch, the distances of the others, what was then done."""

import json

import numpy as np
import pytest

import pellucid as pl
from pellucid.cli import app
from pellucid.controllers.control_law import LAWS, ControlLaw
from pellucid.controllers.incident import CHECKSUM_FACTOR, CHECKSUM_START, parse_incident
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.study.incident import IncidentAccount
from pellucid.controllers.study.incident_page import write_incident_page

PERIOD = 1e-3
FAULT_AT = 400


def joint() -> ControlLaw:
    """A law that carries a forearm."""
    stated = {"inertia": 0.05, "gravity_sine": 1.5, "velocity_width": 0.1, "effort_limit": 5.0, "rate_limit": 500.0}
    stated |= {"velocity_limit": 14.0, "position_min": -2.0, "position_max": 2.0, "max_age": 0.005, "period": PERIOD}
    return ControlLaw("joint", LAWS["joint"].defaults | stated)


def played(kind: str, decimation: int = 1) -> bytes:
    """The record of 0.9 s of motion with a fault after 0.4 s."""
    safe = pl.supervised(joint(), instruments=Instruments(drive=True), start_up=False)
    safe.record(600 // decimation, decimation, 80 // decimation)
    last = 0.0
    for k in range(900):
        t = k * PERIOD
        position, drive = 0.5 + 0.3 * np.sin(6.0 * t), last
        if k >= FAULT_AT:
            position += {"jump": 1.0, "silent encoder": np.nan}.get(kind, 0.0)
            drive *= 3.0 if kind == "gain of drive" else 1.0
            if kind == "driven":
                position = 0.5 + 0.3 * np.sin(2.4) + 2.8 * (1.0 - np.cos(6.2 * (t - 0.4)))
        if kind == "by hand" and k == FAULT_AT:
            safe.stop()
        last = safe.step(t, position, drive=drive)
    return safe.incident()


def account(kind: str, **options: int) -> IncidentAccount:
    return IncidentAccount(parse_incident(played(kind, **options)))


@pytest.mark.parametrize(
    ("kind", "fault", "watch"),
    [
        ("jump", "jump", "raw_acceleration"),
        ("gain of drive", "drive_stuck", "drive_outside"),
        ("driven", "unexplained", "residual_lasting"),
        ("silent encoder", "not_finite", None),
        ("by hand", "stopped", None),
    ],
)
def test_the_watch_that_acted_is_named(kind, fault, watch):
    found = account(kind)
    assert found.fault == fault
    assert (found.acting.name if found.acting else None) == watch
    assert f'"{fault}"' in str(found)
    if watch:
        assert found.acting.share >= 1.0
        assert f'The check "{watch}" (' in str(found)
        assert found.acting.name in {one.name for one in found.watches}
    else:
        assert "in a single period" in str(found)


def test_what_the_law_asked_for_is_told_with_its_power():
    found = account("driven")
    record, stop = found.record, found.record.stop
    speed = (record.samples["position"][stop - 1] - record.samples["position"][stop - 2]) / PERIOD
    assert found.effort_before == record.effort[stop - 1]
    assert found.power_before == pytest.approx(found.effort_before * speed, rel=1e-2)
    assert f"commanded {found.effort_before:.2f} N·m, which gave {found.power_before:.1f} W to the joint" in str(found)
    assert found.seconds_until_powerless == 0.0
    assert "in the period in which the fault was detected" in str(found)


def test_a_damped_stop_that_outlasts_the_record_is_told():
    found = account("by hand")
    assert np.isnan(found.seconds_until_powerless)
    assert "the record ends 0.08 s later, while the drive still had power" in str(found)


def test_a_record_without_a_stop_says_so():
    found = account("nothing")
    assert found.acting is None
    assert "did not stop" in str(found)
    assert '"range" came nearest to its threshold: 37 % of it' in str(found)


def test_a_decimated_record_still_shows_the_largest_value():
    """The jump lasts one period of a record of ten."""
    whole, coarse = account("jump"), account("jump", decimation=10)
    assert coarse.acting.name == whole.acting.name
    assert coarse.acting.share == whole.acting.share
    assert coarse.fault == "jump"


def test_a_value_of_the_wrong_sign_is_beyond_a_lower_threshold():
    watch = account("jump").record.watches["test_return"]
    wrong = type(watch)("below", "polarity", "J", "work", np.array([-1.0, 2.0, 1.0]), np.array([0.5, 0.5, np.inf]))
    assert watch.bound == "below"
    np.testing.assert_array_equal(wrong.share, [np.inf, 0.25, np.nan])


def test_units_are_si():
    watches = account("jump").record.watches
    units = {name: watches[name].unit for name in ("raw_speed", "raw_acceleration", "power", "drive_surplus", "push")}
    assert units == {
        "raw_speed": "rad/s", "raw_acceleration": "rad/s^2", "power": "W", "drive_surplus": "J", "push": "N*m",
    }  # fmt: skip
    slid = pl.supervised(joint(), start_up=False)
    slid.record(10)
    slid.step(0.0, 0.5)
    found = parse_incident(slid.incident(slides=True))
    assert found.prismatic
    assert found.watches["push"].unit == "N"


def test_records_become_a_data_frame():
    found = account("jump")
    rows = found.to_frame()
    assert len(rows) == len(found.record.time)
    assert rows["fault"][found.record.stop] == "jump"
    assert rows["raw_acceleration_share"][found.record.stop] == found.acting.share


def test_the_command_prints_and_writes_a_page(tmp_path):
    from typer.testing import CliRunner

    path = tmp_path / "incident.bin"
    path.write_bytes(played("gain of drive"))
    run = CliRunner().invoke(app, ["incident", str(path)])
    assert run.exit_code == 0, run.output
    assert 'The check "drive_outside" (' in run.output
    text = (tmp_path / "incident-page" / "index.html").read_text(encoding="utf-8")
    assert "drive_difference" in text
    assert "<svg" in text
    assert "http" not in text.replace("http://www.w3.org", "")
    run = CliRunner().invoke(app, ["incident", str(path), "--json", "--out", str(tmp_path / "page")])
    found = json.loads(run.stdout)
    assert found["acting_watch"]["name"] == "drive_outside"
    assert found["watches"][0]["name"] == "drive_difference"
    assert (tmp_path / "page" / "index.html").is_file()


def test_a_page_is_written_whatever_the_record_holds(tmp_path):
    """Records without samples, without a stop, and with values that are not finite."""
    rng = np.random.default_rng(20261113)
    words = np.frombuffer(played("jump"), "<u4")
    for k in range(12):
        changed = words.copy()
        places = rng.integers(len(words) // 10, len(words) - 1, 200)
        changed[places] = rng.integers(0, 2**32, 200)
        checksum = CHECKSUM_START
        for word in changed[:-1].tolist():
            checksum = ((checksum ^ word) * CHECKSUM_FACTOR) & 0xFFFFFFFF
        data = np.append(changed[:-1], np.uint32(checksum)).astype("<u4").tobytes()
        found = IncidentAccount(parse_incident(data))
        assert str(found)
        write_incident_page(found, tmp_path / str(k))
    empty = pl.supervised(joint(), start_up=False)
    empty.record(10)
    found = IncidentAccount(parse_incident(empty.incident()))
    assert "did not stop" in str(found)
    write_incident_page(found, tmp_path / "empty")
