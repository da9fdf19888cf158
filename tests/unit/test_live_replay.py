"""A recorded session is computed again bit for bit, and a single wrong bit is found."""

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS, ControlLaw
from pellucid.controllers.supervisor_faults import FAULT_NAMES
from pellucid.live import layout
from pellucid.live.replay import conditions_of, replay_records, replay_session
from pellucid.live.setup import Condition, DeviceNumbers, EngineSetup, settings_text


def joint_law():
    numbers = LAWS["joint"].defaults | {
        "inertia": 0.05, "gravity_sine": 1.5, "velocity_width": 0.1, "effort_limit": 5.0, "rate_limit": 500.0,
        "velocity_limit": 10.0, "position_min": -2.0, "position_max": 2.0, "max_age": 0.005, "period": 0.001,
    }  # fmt: skip
    return pl.supervised(ControlLaw("joint", numbers), start_up=False)


CONDITIONS = [Condition("carried", joint_law()), Condition("free", worn=False)]


def played(count=300, spoil=None):
    """Records of a session whose law the core's module stepped: a stop, a reset and a change of a number among them."""
    law = CONDITIONS[0].law
    running, numbers = law.start(), law.parameters
    records = np.zeros(count, layout.RECORD_TYPE)
    for k, record in enumerate(records):
        record["number"] = k + 1
        record["flags"] = layout.FLAG_STEPPED | (layout.FLAG_BEGAN if k == 0 else 0)
        now = 1000 * (k + 1) + 37
        record["now_us"], record["valid"] = now, 0b110011
        record["value"] = 0.5 + 0.2 * np.sin(0.01 * k)
        record["value"][4] = running.effort if hasattr(running, "effort") else 0.0
        record["stamp_us"], record["sequence"] = 1000 * (k + 1), k + 1
        if spoil is not None:
            spoil(k, record)
        if k == 150:
            numbers[list(law.values).index("offset")] = 0.75
            running.adjust(numbers)
            record["flags"] |= layout.FLAG_ADJUSTED
            record["adjusted_field"], record["adjusted_value"] = list(law.values).index("offset"), 0.75
        if k == 250:
            running.stop()
            record["flags"] |= layout.FLAG_STOP_ASKED
        sample = [(float(record["value"][i]), int(record["sequence"][i]), int(record["stamp_us"][i]),
                   bool(int(record["valid"]) >> i & 1)) for i in (0, 4, 5)]  # fmt: skip
        record["effort"] = running.step_samples(now, sample, 0)
        record["mode"], record["fault"] = layout.MODES.index(running.mode), FAULT_NAMES.index(running.fault)
    return records


def test_every_command_is_computed_again():
    found = replay_records(CONDITIONS, played())
    assert (found.compared, found.wrong_bits, found.first_wrong, found.unknown) == (300, 0, None, 0)
    assert found.is_equal


def test_faults_are_computed_again():
    def spoil(k, record):
        if k == 100:
            record["value"][0] = np.nan
        if k > 120:
            record["stamp_us"] += 500_000

    records = played(spoil=spoil)
    assert FAULT_NAMES[records["fault"][-1]] == "not_finite"
    assert replay_records(CONDITIONS, records).is_equal


@pytest.mark.parametrize("field", ["effort", "value"])
def test_a_single_bit_is_found(field):
    records = played()
    place = records[field][200:201] if field == "effort" else records[field][200, :1]
    place[0] = np.nextafter(place[0], 1e9)
    found = replay_records(CONDITIONS, records)
    assert found.wrong_bits >= 1
    assert found.first_wrong >= 201
    assert not found.is_equal


def test_a_stop_or_a_change_that_is_not_recorded_is_found():
    for flag in (layout.FLAG_STOP_ASKED, layout.FLAG_ADJUSTED):
        records = played()
        records["flags"] &= ~np.uint32(flag)
        assert not replay_records(CONDITIONS, records).is_equal


def test_a_law_whose_beginning_is_missing_is_not_judged():
    found = replay_records(CONDITIONS, played()[10:])
    assert (found.compared, found.unknown) == (0, 290)
    assert not found.is_equal


def test_a_gap_ends_what_is_known():
    found = replay_records(CONDITIONS, np.delete(played(), 100))
    assert (found.compared, found.unknown, found.gaps, found.wrong_bits) == (100, 199, 1, 0)


def test_conditions_come_back_from_the_engines_numbers_bit_for_bit():
    text = settings_text(EngineSetup(tuple(CONDITIONS), DeviceNumbers("virtual-elbow")))
    back = conditions_of(text)
    assert [c.name for c in back] == ["carried", "free"]
    assert back[0].law.parameters.tobytes() == CONDITIONS[0].law.parameters.tobytes()
    assert back[0].law.supervisor.tobytes() == CONDITIONS[0].law.supervisor.tobytes()
    assert (back[1].law, back[1].worn) == (None, False)
    with pytest.raises(PellucidError, match="pellucid-engine 1"):
        conditions_of("period_ns 1")


def test_a_file_without_an_engine_is_refused(tmp_path):
    with pytest.raises(PellucidError, match="No such file"):
        replay_session(tmp_path / "none.xdf")
    (tmp_path / "empty.xdf").write_bytes(b"XDF:")
    with pytest.raises(PellucidError, match="found no stream"):
        replay_session(tmp_path / "empty.xdf")
