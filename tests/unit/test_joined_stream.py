"""Drive and position from two files on two clocks: brought together by what the drive does to the joint."""

import numpy as np
import pytest

from pellucid._errors import RecordingError, StudyError
from pellucid.joint.study.aligned_motions import align_recordings, aligned_motions, find_clocks
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, identify

STUDY = """name = "bench"
[rig]
motion = "rotary"
[rig.drive]
kind = "current"
torque_constant = "1.68 N*m/A"
[channels]
time = {{ column = "time", unit = "s" }}
{own}
[streams.beside]
join = true
{clock}
[streams.beside.channels]
time = {{ column = "time", unit = "s" }}
{theirs}
[processing]
lowpass = "30 Hz"
decimate = 10
dead_band = "0.2 rad/s"
trim = 100
[[recordings]]
name = "a"
file = "a.csv"
streams = {{ beside = "b.csv" }}
{entry}
"""
POSITION, CURRENT = 'position = { column = "q", unit = "rad" }', 'current = { column = "i", unit = "A" }'


@pytest.fixture
def study(bench_samples, tmp_path):
    """The recording in two files: `b.csv` at half the rate, its clock `offset` [s] later and faster by `drift`."""

    def made(own="q", offset=0.0, drift=0.0, gap=(), clock="", entry=""):
        other = {"q": "i", "i": "q"}[own]
        time = bench_samples["time"]
        here = np.column_stack([time, bench_samples[own]])
        there = np.column_stack([time * (1.0 + drift) + offset, bench_samples[other]])[::2]
        if gap:
            there = there[(time[::2] < gap[0]) | (time[::2] > gap[1])]
        for name, table, column in (("a.csv", here, own), ("b.csv", there, other)):
            np.savetxt(tmp_path / name, table, "%.9f", ",", header=f"time,{column}", comments="")
        text = {"q": POSITION, "i": CURRENT}
        (tmp_path / "study.toml").write_text(
            STUDY.format(own=text[own], theirs=text[other], clock=clock, entry=entry), encoding="utf-8"
        )
        return open_study(tmp_path)

    return made


@pytest.mark.parametrize(("own", "offset"), [("q", 0.237), ("i", -3.4), ("q", 1.7e9)])
def test_an_offset_is_found_from_the_motion(study, own, offset):
    """The bench reads its current half a sample early."""
    (clock,) = find_clocks(study(own, offset))
    assert clock.why == ""
    assert clock.offset == pytest.approx(offset, abs=2.5e-3)
    assert clock.low < offset < clock.high


def test_a_drift_is_found_where_it_shows(study):
    (clock,) = find_clocks(study(offset=0.5, drift=2e-3))
    assert clock.drift == pytest.approx(2e-3, abs=3 * clock.drift_error)
    assert clock.drift > 1e-3
    (still,) = find_clocks(study(offset=0.5))
    assert still.drift == 0.0
    assert "would not be detected" in still.said


def test_of_a_motion_that_repeats_itself_the_nearest_offset_is_taken(study, tmp_path):
    study()
    time, w = np.arange(20_000) / 1000.0, 2.0 * np.pi / 5.0
    q = 0.7 * np.sin(w * time) + 0.3 * np.sin(3.0 * w * time)
    v = np.gradient(q, time)
    effort = 0.08 * np.gradient(v, time) + 3.0 * np.sin(q) + 0.2 * v + 0.4 * np.sign(v)
    current = effort / 1.68 + 0.02 * np.random.default_rng(1).standard_normal(len(time))
    for name, column, values, late in (("a.csv", "q", q, 0.0), ("b.csv", "i", current, 0.2)):
        rows = np.column_stack([time + late, values])
        np.savetxt(tmp_path / name, rows, "%.9f", ",", header=f"time,{column}", comments="")
    (clock,) = find_clocks(open_study(tmp_path))
    assert clock.offset == pytest.approx(0.2, abs=3e-3)
    assert min(abs(abs(x - clock.offset) - 5.0) for x in clock.others) < 0.02
    assert "is periodic" in clock.said


def test_it_is_told_and_the_parameters_are_those_of_one_file(study):
    together = study(offset=0.237)
    found = identify(together, families=["symmetric"], thorough=False)
    assert found["inertia"].value == pytest.approx(
        identify(study(), families=["symmetric"], thorough=False)["inertia"].value, rel=0.01
    )
    assert [v.kind for v in found.verdicts if v.finding == "joined_clock"] == ["note"]
    (fault,) = (f for f in check(together) if f.kind == "clock")
    assert 'offsets = { beside = "0.23' in fault.message


def test_an_offset_by_hand_is_taken(study, bench_samples):
    given = study(offset=0.4, clock="drift = 0", entry='offsets = { beside = "0.4 s" }')
    assert find_clocks(given) == ()
    (recording,) = given.recordings()
    same = np.isin(bench_samples["time"].round(6), recording.time.round(6))
    assert recording["current"][::2] == pytest.approx(bench_samples["i"][same][::2], abs=1e-6)


def test_no_sample_is_taken_from_a_gap(study):
    (recording,) = align_recordings(study(clock='offset = "0 s"\ndrift = 0', gap=(3.0, 3.5)))
    (cut,) = recording.cuts
    assert (cut.kind, cut.found) == ("gap", "no sample of current in b.csv")
    assert recording.time[cut.first] == pytest.approx(3.0, abs=5e-3)
    assert recording.time[cut.last] == pytest.approx(3.5, abs=5e-3)
    assert len(aligned_motions(study(clock='offset = "0 s"\ndrift = 0', gap=(3.0, 3.5)))) == 2


def test_files_of_two_trials_are_refused(study, bench_samples, tmp_path):
    made = study()
    noise = np.random.default_rng(4).standard_normal(len(bench_samples["time"]))
    np.savetxt(
        tmp_path / "b.csv", np.column_stack([bench_samples["time"], noise]), "%.9f", ",", header="time,i", comments=""
    )
    made = open_study(tmp_path)
    (fault,) = (f for f in check(made) if f.kind == "clock")
    assert fault.severity == "refuse"
    with pytest.raises(RecordingError, match="offsets ="):
        identify(made)


def test_what_cannot_be_told_must_be_given(study, tmp_path):
    study()
    text = (
        (tmp_path / "study.toml")
        .read_text()
        .replace('current = { column = "i", unit = "A" }', 'torque = { column = "i", unit = "N*m" }')
    )
    (tmp_path / "study.toml").write_text(text.replace("torque = {", "temperature = {").replace('"N*m"', '"K"'))
    with pytest.raises(StudyError, match="which this stream does not identify"):
        open_study(tmp_path)
    study(own="q")
    (tmp_path / "study.toml").write_text((tmp_path / "study.toml").read_text().replace("join = true", 'offset = "1 s"'))
    with pytest.raises(StudyError, match="join = true"):
        open_study(tmp_path)
