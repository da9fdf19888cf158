"""`init --from`: a clock that loses samples changes neither the proposed low-pass nor whether a study is made."""

import tomllib
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import RecordingError, UnfitRecordingError
from pellucid.files.fault import Fault
from pellucid.files.recording import Channel, Recording, make_cut
from pellucid.start.given_files import read_given
from pellucid.start.inference.motion_efforts import find_derivatives
from pellucid.start.inference.processing_choice import bridge_losses, choose_processing, find_lost_periods
from pellucid.start.init_from_files import _draft_of, _require_accepted
from pellucid.start.propose_study import propose_study
from pellucid.start.study_text import study_text
from pellucid.study.recorded_motions import usable_stretches
from pellucid.study.study_file import Processing

RATE_HZ = 200.0


def moved(seed, seconds=40.0):
    """Return time, angle and torque of a joint that moves by ten sines, each (n,)."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    rate = 2.0 * np.pi * 0.1 * np.arange(1, 11)
    size, phase = rng.normal(size=10) / rate, rng.uniform(0.0, 2.0 * np.pi, 10)
    wave = rate * time[:, None] + phase
    angle, speed, pull = np.sin(wave) @ size, np.cos(wave) @ (size * rate), -np.sin(wave) @ (size * rate**2)
    torque = 0.08 * pull + 3.0 * np.sin(angle) + 0.3 * np.tanh(speed / 0.01) + 0.15 * speed
    return time, np.round(angle, 6), torque + 0.02 * rng.normal(size=len(time))


def kept(loss, n, seed):
    """Return a mask of the samples that a clock keeps, (n,) bool."""
    mask = np.random.default_rng(seed).uniform(size=n) >= (loss if isinstance(loss, float) else 0.0)
    if loss == "pauses":
        for first in (n // 8, n // 3, n // 2):
            mask[first : first + 40] = False
    if loss == "one":
        mask[n // 2] = False
    if loss == "bursts":
        for first in range(60, n - 10, 60):
            mask[first : first + 5] = False
    return mask


@pytest.mark.parametrize("loss", [0.01, 0.05, 0.1, "pauses", "one", "bursts"])
def test_lost_samples_leave_the_low_pass_and_enough_samples(tmp_path, loss):
    files = []
    for seed, name in ((1, "a"), (2, "b")):
        rows = np.column_stack(moved(seed))
        rows = rows[kept(loss, len(rows), seed)]
        files.append(tmp_path / f"{name}.csv")
        np.savetxt(files[-1], rows, fmt="%.6f", delimiter=",", header="time [s],angle [rad],torque [Nm]", comments="")
    proposal = propose_study(read_given(files), "lossy")
    whole = choose_processing(moved(1)[1], RATE_HZ)
    processing = tomllib.loads(_text(proposal))["processing"]
    lowpass = float(processing["lowpass"].split()[0])
    assert 0.6 * whole.lowpass <= lowpass <= 1.2 * whole.lowpass or loss == "bursts"
    assert lowpass >= 10.0
    if loss == "pauses":
        assert "resample" not in processing  # none of its gaps is short enough to be bridged
    else:
        assert processing["resample"] == "200 Hz"
    if loss == "bursts":
        assert 0.5 / lowpass >= 6 / RATE_HZ  # the low-pass is low enough for five lost samples to be bridged


def _text(proposal):
    tables = [recording.table for recording in proposal.recordings]
    return study_text(proposal, {id(table): f"recordings/{table.path.name}" for table in tables})


@pytest.mark.parametrize("steps", [[1, 1, 1, 2], [2, 3]])
def test_an_even_clock_that_was_rounded_loses_no_samples(steps):
    time = np.concatenate(([0.0], np.cumsum(np.tile(steps, 500)))) * 1e-3
    position = np.sin(2.0 * np.pi * 3.0 * np.linspace(0.0, time[-1], len(time)))
    short = np.diff(time)
    assert find_lost_periods(time, position, 1.0 / np.mean(short[short < 1.5 * np.median(short)])) is None


def test_lost_samples_at_a_known_place_are_counted():
    time, angle, _ = moved(3)
    mask = kept(0.02, len(time), 3)
    periods = find_lost_periods(time[mask], angle[mask], RATE_HZ)
    np.testing.assert_array_equal(periods, np.diff(np.flatnonzero(mask)))
    choice = choose_processing(angle[mask], RATE_HZ, periods)
    assert bridge_losses(choice, [periods], RATE_HZ).resample == RATE_HZ


def test_a_refusal_for_gaps_names_the_key_that_bridges_them(tmp_path):
    time, angle, _ = moved(4, 10.0)
    mask = kept(0.05, len(time), 4)
    channels = {
        name: Channel(name, x[mask], unit, "") for name, x, unit in (("time", time, "s"), ("position", angle, "rad"))
    }
    recording = Recording("a", tmp_path / "a.csv", "", "fit", channels)
    cuts = tuple(
        make_cut(recording, "gap", "time", first=i + 1, last=i, found="a gap")
        for i in np.flatnonzero(np.diff(recording.time) > 1.5 / RATE_HZ).tolist()
    )
    with pytest.raises(RecordingError, match=r'\[processing\] resample = "200 Hz"'):
        usable_stretches(replace(recording, cuts=cuts), Processing(lowpass="1.6 Hz", decimate=20, trim=63))


def test_a_refusal_never_shows_the_draft_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files = [tmp_path / "a.csv"]
    np.savetxt(
        files[0], np.column_stack(moved(1)), delimiter=",", header="time [s],angle [rad],torque [Nm]", comments=""
    )
    proposal = propose_study(read_given(files), "lossy")
    folder = Path("study")
    with _draft_of(folder) as draft:
        place = f"{draft}/recordings/a.csv: too short"
        fault = Fault("refuse", "unreadable", "a.csv", "time", "", "", place)
        with pytest.raises(UnfitRecordingError) as refused:
            _require_accepted(draft, folder, proposal, lambda _: [fault])
    assert ".draft" not in str(refused.value)


def test_times_that_fall_back_give_no_warning():
    time, angle, _ = moved(5, 10.0)
    stamps = np.round(time + np.random.default_rng(5).uniform(0.0, 0.01, len(time)), 4)
    stamps[501:505] = stamps[500] + np.array([0.01, 0.005, 0.01, 0.012])  # two rows that stay share a time
    columns = {"angle": angle, "speed": np.gradient(angle, time)}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert all(np.isfinite(pair.ratio) for pair in find_derivatives(columns, stamps))


def test_a_recording_whose_time_runs_back_is_refused_without_numpy_warnings(tmp_path):
    files = []
    for seed, name in ((1, "a"), (2, "b")):
        rows = np.column_stack(moved(seed))
        rows[:, 0] = np.round(rows[:, 0] + np.random.default_rng(seed).uniform(0.0, 0.01, len(rows)), 4)
        # Gaps, so that no mean rate takes the place of the stamps.
        rows = np.delete(rows, [i for first in range(900, 7000, 1200) for i in range(first, first + 60)], axis=0)
        files.append(tmp_path / f"{name}.csv")
        np.savetxt(files[-1], rows, fmt="%.6f", delimiter=",", header="time [s],angle [rad],torque [Nm]", comments="")
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        with pytest.raises(UnfitRecordingError, match="time running back"):
            pl.init(tmp_path / "study", files=files)
