"""The record of an incident: from the core's recorder to arrays, and files that are no such record."""

import numpy as np
import pytest

from pellucid import _core
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS
from pellucid.controllers.incident import CHECKSUM_FACTOR, CHECKSUM_START, parse_incident, read_incident
from pellucid.models.fields import model_fields

PERIOD = 1e-3
STOP_AT = 300


@pytest.fixture(scope="module")
def recorded() -> bytes:
    """The file of a law that was stopped in its 301st period, by hand."""
    name = next(iter(LAWS))
    law = {f.name: f.default for f in LAWS[name].fields} | {"velocity_width": 0.1, "stribeck_velocity": 0.1}
    law |= {"inertia": 0.05, "effort_limit": 10.0, "rate_limit": 500.0, "velocity_limit": 8.0, "position_min": -2.0}
    law |= {"position_max": 3.0, "stop_margin": 0.1, "max_age": 0.005, "max_repeats": 2, "period": PERIOD}
    watch = {f.name: f.default for f in model_fields("supervisor")} | {"raw_speed_limit": 6.0}
    made = _core.supervised(name, list(law.values()), list(watch.values()))
    made.record(40, 5, 4)
    for k in range(400):
        if k == STOP_AT:
            made.stop()
        made.step(PERIOD * k, 0.3 * np.sin(2.0 * PERIOD * k), drive=made.effort)
    assert made.is_recorded
    return made.incident()


def sealed(words: np.ndarray) -> bytes:
    """Return the bytes of a file with the right checksum."""
    checksum = CHECKSUM_START
    for word in words[:-1].tolist():
        checksum = ((checksum ^ word) * CHECKSUM_FACTOR) & 0xFFFFFFFF
    return np.append(words[:-1], np.uint32(checksum)).astype("<u4").tobytes()


def test_what_was_recorded_is_read(recorded, tmp_path):
    path = tmp_path / "incident.bin"
    path.write_bytes(recorded)
    found = read_incident(path)
    assert (found.law, found.decimation, len(found.time)) == (next(iter(LAWS)), 5, 40)
    assert found.period == pytest.approx(PERIOD)
    assert found.stop == 35
    assert found.step[found.stop] == STOP_AT + 1
    assert found.fault[found.stop] == found.log[0][1] == "stopped"
    assert found.mode[found.stop - 1] == "running"
    np.testing.assert_allclose(found.samples["position"], 0.3 * np.sin(2.0 * found.time), atol=1e-6)
    speed = found.watches["raw_speed"]
    assert speed.fault == "overspeed"
    assert 0.08 < np.max(speed.share) < 0.12
    assert found.thresholds["raw_speed_limit"] == 6.0
    assert repr(found) == f'Incident({found.law}, 40 records of 0.005 s, stopped by "stopped")'


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda b: b"", "first bytes"),
        (lambda b: b[:40], "truncated"),
        (lambda b: b[:-8], "truncated"),
        (lambda b: b[:1001] + bytes([b[1001] ^ 4]) + b[1002:], "damaged"),
        (lambda b: b[:8] + b"\x02" + b[9:], "newer"),
    ],
)
def test_another_file_is_refused(recorded, change, said):
    with pytest.raises(PellucidError, match=said):
        parse_incident(change(recorded), "here.bin")


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(PellucidError, match=r"none\.bin"):
        read_incident(tmp_path / "none.bin")


def test_no_mutated_file_does_worse_than_a_refusal(recorded):
    """Words that are changed and sealed again reach the parts behind the checksum."""
    rng = np.random.default_rng(20261112)
    words = np.frombuffer(recorded, "<u4")
    refused = 0
    for _ in range(150):
        changed = words.copy()
        changed[rng.integers(2, 700)] = rng.integers(0, 2**32)
        try:
            parse_incident(sealed(changed))
        except PellucidError:
            refused += 1
    assert refused > 5
