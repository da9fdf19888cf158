"""What a channel may be made of: differences, values that roll over, a recorded velocity, processing of its own."""

import numpy as np
import pytest

from pellucid._errors import RecordingError, StudyError
from pellucid.joint.study.aligned_motions import aligned_motions
from pellucid.joint.study.joint_faults import velocity_faults
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, identify
from pellucid.study.rollover import find_rollover
from pellucid.study.study import Study

STUDY = """name = "bench"
[rig]
motion = "rotary"
[rig.drive]
kind = "current"
torque_constant = "1.68 N*m/A"
[channels]
time = {{ column = "time", unit = "s" }}
position = {{ {position} }}
current = {{ {current} }}
{channels}
[processing]
lowpass = "30 Hz"
decimate = 10
dead_band = "0.2 rad/s"
trim = 100
{processing}
[[recordings]]
name = "a"
file = "a.csv"
{entry}
"""
PLAIN = {
    "position": 'column = "q", unit = "rad"',
    "current": 'column = "i", unit = "A"',
    "channels": "",
    "processing": "",
    "entry": "",
}


@pytest.fixture
def study(bench_samples, tmp_path):
    def made(columns=None, **said):
        table = bench_samples | (columns or {})
        np.savetxt(
            tmp_path / "a.csv", np.column_stack([*table.values()]), "%.9f", ",", header=",".join(table), comments=""
        )
        (tmp_path / "study.toml").write_text(STUDY.format(**PLAIN | said))
        return open_study(tmp_path)

    return made


def inertia(study) -> float:
    return identify(study, families=["symmetric"], thorough=False)["inertia"].value


def test_an_effort_may_be_a_difference_of_columns(study, bench_samples):
    """Two cables, each under tension, of which one's sensor counts twice as much."""
    tension = 3.0 + np.sin(bench_samples["time"])
    both = {"one": tension + bench_samples["i"], "two": 2.0 * tension}
    made = study(both, current='column = "one", minus = { column = "two", scale = 0.5 }, unit = "A"')
    assert made.recordings()[0]["current"] == pytest.approx(bench_samples["i"], abs=1e-8)
    equal = {"one": tension + bench_samples["i"], "two": tension}
    turned = study(equal, current='column = "one", minus = "two", unit = "A", sign = -1, offset = 0.5')
    assert turned.recordings()[0]["current"] == pytest.approx(0.5 - bench_samples["i"], abs=1e-8)


def test_what_is_taken_off_must_be_there(study):
    with pytest.raises(RecordingError, match="idle"):
        study(current='column = "i", minus = "idle", unit = "A"').recordings()
    with pytest.raises(StudyError, match=r"minus\.column: missing"):
        study(current='column = "i", minus = { scale = 2.0 }, unit = "A"')


@pytest.mark.parametrize("period", [30.0, 360.0])
def test_a_value_may_roll_over_at_any_period(study, bench_samples, period):
    turns = np.degrees(bench_samples["q"]) % period
    made = study({"q": turns}, position=f'column = "q", unit = "deg", wrap = "{period} deg"')
    assert np.ptp(made.recordings()[0]["position"] - bench_samples["q"]) < 1e-8


@pytest.mark.parametrize(
    ("stored", "said", "write"),
    [
        (lambda q: np.degrees(q) % 30.0, 'unit = "deg"', 'wrap = "30 deg"'),
        (lambda q: (8.0 * np.degrees(q) + 180.0) % 360.0 - 180.0, 'unit = "deg"', 'wrap = "360 deg"'),
        (
            lambda q: np.round(np.degrees(q) / 0.02197265625) % 4096,
            'unit = "deg", scale = 0.02197265625',
            "wrap_bits = 12",
        ),
    ],
)
def test_a_value_that_rolls_over_is_refused_with_its_period(study, bench_samples, stored, said, write):
    made = study({"q": stored(bench_samples["q"])}, position=f'column = "q", {said}')
    (fault,) = (f for f in check(made) if f.kind == "wrap")
    assert fault.severity == "refuse"
    assert write in fault.message
    healed = study({"q": stored(bench_samples["q"])}, position=f'column = "q", {said}, {write}')
    assert not [f for f in check(healed) if f.kind == "wrap"]


def test_what_only_jumps_does_not_roll_over(study, bench_samples):
    n = np.arange(3000)
    spike = np.sin(n / 200.0) + np.where(n == 700, 40.0, 0.0)
    assert find_rollover(spike) is None
    assert find_rollover(bench_samples["q"]) is None
    assert find_rollover(np.sin(n / 200.0)) is None
    assert find_rollover(n % 7.0) is None
    assert find_rollover(np.cumsum(np.sin(n / 500.0)) % 90.0).period == pytest.approx(90.0, abs=0.02)
    step = bench_samples["q"] + np.where(bench_samples["time"] < 9.0, 0.0, 9.0)
    (fault,) = (f for f in check(study({"q": step})) if f.kind == "wrap")
    assert "from -0.3582 to 8.64" in fault.message


def test_a_period_has_the_channel_s_dimension(study):
    with pytest.raises(StudyError, match="mm"):
        study(position='column = "q", unit = "deg", wrap = "30 mm"')
    with pytest.raises(StudyError, match="expected one of them"):
        study(position='column = "q", unit = "deg", wrap = "360 deg", wrap_bits = 12')


VELOCITY = {"channels": 'velocity = { column = "v", unit = "rad/s" }', "processing": 'velocity = "recorded"'}


def velocity(bench_samples) -> np.ndarray:
    return np.gradient(bench_samples["q"], bench_samples["time"])


def test_a_recorded_velocity_takes_the_position_s_place(study, bench_samples):
    plain, v = inertia(study()), 1.02 * velocity(bench_samples)
    assert inertia(study({"v": v}, channels=VELOCITY["channels"])) == pytest.approx(plain, rel=1e-6)
    assert inertia(study({"v": v}, **VELOCITY)) == pytest.approx(plain / 1.02, rel=3e-3)
    assert not [fault for fault in check(study({"v": v}, **VELOCITY)) if fault.severity == "refuse"]


@pytest.mark.parametrize(
    ("factor", "kind", "said"),
    [(-1.0, "velocity_sign", "sign = -1"), (57.29578, "velocity_scale", "looks like deg/s given as rad/s")],
)
def test_a_velocity_that_contradicts_the_position_is_refused_where_it_is_used(study, bench_samples, factor, kind, said):
    v = factor * velocity(bench_samples)
    fault = next(f for f in check(study({"v": v}, **VELOCITY)) if f.kind == kind)
    assert fault.severity == "refuse"
    assert said in fault.message
    with pytest.raises(RecordingError, match="channel velocity"):
        inertia(study({"v": v}, **VELOCITY))
    unused = study({"v": v}, channels=VELOCITY["channels"])
    assert [f.severity for f in check(unused) if f.kind == kind] == ["note"]


def test_a_velocity_that_contradicts_the_position_is_told_where_it_is_held_out(study, bench_samples):
    made = study({"v": -velocity(bench_samples)}, **VELOCITY)
    entry = made.config.recordings[0].model_copy(update={"use": "validate"})
    config = made.config.model_copy(update={"recordings": (entry,)})
    held_out = Study(made.folder, config)
    assert [f.severity for f in velocity_faults(held_out) if f.kind == "velocity_sign"] == ["warn"]


def test_a_late_velocity_is_told_with_what_to_write(study, bench_samples):
    v = np.interp(bench_samples["time"] - 0.012, bench_samples["time"], velocity(bench_samples))
    (fault,) = (f for f in check(study({"v": v}, **VELOCITY)) if f.kind.startswith("velocity"))
    assert fault.kind == "velocity_delay"
    assert 'velocity = { delay = "12' in fault.message


def test_a_recorded_velocity_needs_its_channel(study):
    with pytest.raises(StudyError, match="no channel velocity"):
        study(processing='velocity = "recorded"')


def test_a_recording_may_have_processing_of_its_own(study):
    made = study(entry='processing = { lowpass = "10 Hz", trim = 200 }')
    (motion,) = aligned_motions(made)
    assert (motion.filtering.lowpass, motion.filtering.trim, motion.filtering.decimate) == (10.0, 200, 10)
    assert made.processing.lowpass == 30.0
    found = identify(made, families=["symmetric"], thorough=False)
    assert "of a: zero-phase Butterworth low-pass, order 4, 10 Hz" in found.filter_note
    with pytest.raises(StudyError, match="lowpas"):
        study(entry='processing = { lowpas = "10 Hz" }')
