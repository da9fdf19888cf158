"""A channel that was recorded late is found and moved; what is not late stays as it is."""

from dataclasses import replace
from pathlib import Path
from shutil import copytree

import numpy as np
import pytest

from pellucid._errors import StudyError
from pellucid.files.cut import Cut
from pellucid.files.delay import interpolate_at, shift_channels, undo_lags
from pellucid.files.recording import Channel, Recording
from pellucid.joint.study.aligned_motions import aligned_motions, find_alignments
from pellucid.numerics.delay import DelayFit, combine_models
from pellucid.start.log_proposal import propose
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, identify
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.study import write_study


def recording(cuts=(), **channels) -> Recording:
    made = {name: Channel(name, samples, "1", name) for name, samples in channels.items()}
    return Recording("a", Path("a.csv"), "", "fit", made, cuts=cuts)


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A virtual joint's study: its friction is richer than any family."""
    rig = bench_joint()
    return write_study(tmp_path_factory.mktemp("late") / "bench", rig, name="bench", seed=5, trials=rig.trials(5)[:2])


def alignment(study):
    """What is found of all recordings together."""
    (found,) = find_alignments(study)
    return found


def late(study, channel: str, samples: int, which=None, use="fit"):
    """The study as if `channel` had been recorded so many samples late, in all recordings or in one, which has a
    `use`."""
    loaded = {}
    for r in study.recordings():
        if which not in (None, r.name):
            loaded[r.name] = r
            continue
        column = r.channels[channel]
        shifted = column.samples[np.clip(np.arange(len(r)) - samples, 0, len(r) - 1)]
        loaded[r.name] = replace(r, use=use, channels={**r.channels, channel: replace(column, samples=shifted)})
    return replace(study, kept=replace(study.kept, recordings=loaded), found={})


def test_whole_samples_are_moved_exactly():
    n = np.arange(50.0)
    found = shift_channels(recording(time=0.01 * n, position=n, current=n - 3.0), {"current": 0.03})
    assert len(found) == 47
    assert np.array_equal(found["current"], found["position"])


def test_parts_of_a_sample_are_moved_by_a_smooth_curve():
    time = np.arange(400) / 100.0
    early = interpolate_at(time, np.sin(6.0 * time), time - 0.0043)
    inside = np.isfinite(early)
    assert inside.sum() == 399
    assert early[2:-1] == pytest.approx(np.sin(6.0 * (time[2:-1] - 0.0043)), abs=2e-5)


def test_nothing_is_taken_from_beyond_a_cut():
    n = np.arange(60.0)
    cut = Cut("spike", "current", 0.30, 0.32, 30, 31, "a spike")
    found = shift_channels(recording(cuts=(cut,), time=0.01 * n, current=n), {"current": 0.05})
    assert [(s.start, s.stop) for s in found.spans] == [(0, 25), (32, 55)]
    assert np.array_equal(found["current"][0:25], n[5:30])


@pytest.mark.parametrize("samples", [20, -20])
def test_a_late_drive_is_moved_on_a_joint_richer_than_the_model(bench, samples):
    """The bench reads its current half a sample early."""
    found = alignment(late(bench, "current", samples))
    assert found.moved == pytest.approx(1e-3 * (samples - 0.5), abs=2.5e-3)
    assert found.delay.low < 1e-3 * (samples - 0.5) < found.delay.high


def test_a_late_encoder_is_an_early_drive(bench):
    found = alignment(late(bench, "position", 20))
    assert found.moved == pytest.approx(-0.0205, abs=2.5e-3)
    assert found.said.startswith("position is delayed by 2")


def test_of_a_drive_in_time_nothing_is_said_or_moved(bench):
    assert alignment(bench).moved == 0.0
    assert alignment(bench).said == ""
    assert not [fault for fault in check(bench) if fault.kind == "delay"]
    raw = [r["current"][0] for r in bench.recordings()]
    assert [m.command[0] for m in aligned_motions(bench)] == raw


def test_of_recordings_that_contradict_each_other_the_late_one_is_moved(bench):
    study = late(bench, "current", 25, "point_to_point")
    (found,) = find_alignments(study)
    assert found.recording == "point_to_point"
    assert found.moved == pytest.approx(0.0245, abs=3e-3)
    assert "channels.current = { delay = " in found.do
    assert len(aligned_motions(study)[0].time) < len(aligned_motions(bench)[0].time)
    assert np.array_equal(aligned_motions(study)[1].time, aligned_motions(bench)[1].time)


def test_one_that_is_held_out_is_told_and_stays(bench):
    study = late(bench, "current", 25, "point_to_point", use="validate")
    (together, apart) = find_alignments(study)
    assert together.said == ""
    assert (apart.recording, apart.moved) == ("point_to_point", 0.0)
    assert "not corrected in held-out recordings" in apart.said


def test_a_lag_is_told_from_a_delay_and_undone(bench):
    loaded, slow = {}, 0.05
    for r in bench.recordings():
        column, filtered = r.channels["current"], r["current"].copy()
        share = 1.0 - np.exp(-1.0 / (slow * r.fs))
        for i in range(1, len(filtered)):
            filtered[i] = filtered[i - 1] + share * (column.samples[i] - filtered[i - 1])
        loaded[r.name] = replace(r, channels={**r.channels, "current": replace(column, samples=filtered)})
    study = replace(bench, kept=replace(bench.kept, recordings=loaded), found={})
    found = alignment(study)
    assert found.delay.lag
    assert found.delay.low < slow - 0.0005 < found.delay.high  # read half a sample early
    assert 'current = { lag = "' in found.do
    plain = identify(bench, families=["symmetric"], thorough=False)["inertia"]
    assert identify(study, families=["symmetric"], thorough=False)["inertia"].value == pytest.approx(
        plain.value, rel=0.02
    )


def test_a_time_that_is_missing_stops_nothing():
    n = np.arange(60.0)
    time = np.where(n == 30, np.nan, 0.01 * n)
    cut = Cut("missing_samples", "time", np.nan, 0.31, 30, 30, "1 missing sample")
    found = shift_channels(recording(cuts=(cut,), time=time, current=n), {"current": 0.05})
    assert [(s.start, s.stop) for s in found.spans] == [(0, 25), (31, 55)]
    assert np.array_equal(found["current"][31:55], n[36:60])


def test_what_lagged_is_undone_by_its_slope():
    time = np.arange(300) / 100.0
    found = undo_lags(recording(time=time, current=np.sin(3.0 * time)), {"current": 0.2})
    assert found["current"][1:-1] == pytest.approx((np.sin(3.0 * time) + 0.6 * np.cos(3.0 * time))[1:-1], abs=2e-4)


def test_it_is_told_with_what_to_write(bench):
    study = late(bench, "current", 20)
    fault = next(fault for fault in check(study) if fault.kind == "delay")
    assert fault.severity == "note"
    assert "current is delayed" in fault.message
    assert 'delay = "0 s"' in fault.message
    verdict = next(
        v for v in identify(study, families=["symmetric"], thorough=False).verdicts if v.finding == "late_drive"
    )
    assert verdict.kind == "warning"


def test_a_delay_by_hand_is_taken_and_none_is_estimated(bench, tmp_path):
    text = (bench.folder / "study.toml").read_text()
    before, after = text.split('current = { column = "current", unit = "A" }')
    copytree(bench.folder / "recordings", tmp_path / "recordings")

    def said(delay: str):
        key = f'current = {{ column = "current", unit = "A", delay = "{delay}" }}'
        (tmp_path / "study.toml").write_text(before + key + after)
        return open_study(tmp_path)

    study = said("4 ms")
    assert find_alignments(study) == ()
    assert np.array_equal(study.recordings()[0]["current"], bench.recordings()[0]["current"][4:])
    assert find_alignments(said("0 s")) == ()
    asked = alignment(said("auto"))
    assert asked.asked
    assert "do not prove a delay of current" in asked.said
    (tmp_path / "study.toml").write_text(text.replace('unit = "rad" }', 'unit = "rad", delay = "auto" }'))
    with pytest.raises(StudyError, match="expected a time"):
        open_study(tmp_path)


def held_effort(seconds=24.0, rate=100, fine=40):
    """Time, position and effort of a joint whose effort is held between samples: half a period late on average."""
    h, n = 1.0 / (rate * fine), round(seconds * rate)
    q = v = 0.0
    rows = []
    for k in range(n):
        t = k / rate
        wanted = 0.6 * np.sin(1.3 * t) + 0.3 * np.sin(4.1 * t + 1.0)
        effort = 60.0 * (wanted - q) - 6.0 * v
        rows.append((t, q, effort))
        for _ in range(fine):
            v += h * (effort - 3.0 * np.sin(q) - 0.3 * v - 0.4 * np.tanh(v / 1e-3)) / 0.2
            q += h * v
    return np.array(rows)


def test_an_effort_that_is_held_between_samples_is_half_a_period_late(tmp_path):
    """Its inertia was 1.3 % off, and the reversals looked like backlash."""
    table = held_effort()
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="time_s,q_rad,tau_Nm", comments="", fmt="%.6f")
    study = propose({"time_s": table[:, 0], "q_rad": table[:, 1], "tau_Nm": table[:, 2]}).study(tmp_path / "held")
    found = alignment(study)
    assert found.moved == pytest.approx(-0.005, abs=1.5e-3)
    assert found.is_within_period
    fit = identify(study, families=["symmetric"], thorough=False)
    assert fit["inertia"].value == pytest.approx(0.2, rel=0.012)
    (verdict,) = [v for v in fit.verdicts if v.finding == "late_drive"]
    assert verdict.kind == "note"
    assert "backlash" not in [cause.name for cause in fit.causes]


@pytest.mark.parametrize(("richest", "expected"), [(0.98, 4e-3), (0.80, 5e-3)])
def test_a_delay_is_that_of_a_model_that_explains_the_effort_about_as_well(richest, expected):
    """What a plain model takes for a delay of its own is friction that it lacks, if a richer one explains far more."""
    fits = [DelayFit(4e-3, 1e-4, np.zeros(1), 3.0, 1.0), DelayFit(5e-3, 1e-4, np.zeros(1), 3.0, richest)]
    found = combine_models(fits, 2.0, 2e-3)
    assert found.value == expected
    assert found.low < 4e-3 < 5e-3 < found.high
