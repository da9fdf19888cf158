"""Clocks: markers against an encoder, EMG against the motion; labels that were rounded or random."""

from dataclasses import replace
from pathlib import Path

import made_pointing
import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.files.optical import OpticalRecording
from pellucid.files.recording import Channel, Recording
from pellucid.people.emg_index import emg_and_motion, emg_lead
from pellucid.people.movements import MovementRule, kinematics
from pellucid.people.study.assessment_table import AssessmentTable as Assessment
from pellucid.people.study.measured_study import measure
from pellucid.people.study.pointing import (
    drop_mistaken,
    labelled_amplitudes,
    pointing_faults,
    pointing_record,
    recordings_with_condition,
    with_rule,
)

SPEC = Assessment(control="Ctrl", segment=("elbow", "wrist"))


def made(seed=1, late=0.0, encoder=True, fast=0.0, repetitions=1, **channels):
    """One recording with markers whose clock is `late` [s] and runs `fast` [s/s], and an encoder."""
    rng = np.random.default_rng(seed)
    time, angle, target, truth = made_pointing.angle_and_target(rng, 200.0, "Ctrl", 1.0, repetitions)
    given = {"time": time, "target": target, **({"position": angle} if encoder else {}), **channels}
    seen = np.arange(0.0, time[-1], 1.0 / 179.0)
    q = np.interp(seen / (1.0 + fast) - late, time, angle)
    elbow = np.zeros((len(seen), 3))
    wrist = 0.25 * np.c_[np.sin(q), 0.0 * q, -np.cos(q)] + 2e-4 * rng.standard_normal((len(seen), 3))
    optical = OpticalRecording(Path("m.csv"), "0", seen, {"elbow": elbow, "wrist": wrist}, np.array([0.0, 0.0, -1.0]))
    made = {name: Channel(name, samples, "1", name) for name, samples in given.items()}
    return Recording(
        "r", Path("r.csv"), "0", "fit", made, participant="P1", condition="Ctrl", optical=optical
    ), truth  # fmt: skip


@pytest.mark.parametrize("late", [-0.2, 0.0, 0.13])
def test_a_late_motion_capture_is_found_and_taken_back(late):
    recording, truth = made(late=late)
    record = pointing_record(recording, SPEC)
    assert record.delay == pytest.approx(late, abs=0.004)
    # At 12 Hz the markers' noise of 0.2 mm passes 5 % of the slowest movement's peak speed.
    _, found, none = record.movements(with_rule(SPEC, lowpass=6.0))
    assert none == []
    starts = [m.start for m in found]
    assert starts == pytest.approx([start for start, _, _ in truth], abs=0.08)


@pytest.mark.parametrize("fast", [1e-3, -4e-4])
def test_a_motion_captures_drift_is_found_and_taken_back(fast):
    recording, truth = made(fast=fast, repetitions=4)
    record = pointing_record(recording, SPEC)
    assert record.drift == pytest.approx(fast, abs=0.1 * abs(fast))
    _, found, none = record.movements(with_rule(SPEC, lowpass=12.0))
    assert none == []
    late = np.array([m.start for m in found]) - [start for start, _, _ in truth]
    assert abs(np.median(late[-13:]) - np.median(late[:13])) < 0.01
    (said,) = [f for f in pointing_faults(record, SPEC, labelled_amplitudes([record])) if f.kind == "drift"]
    assert f"{1e6 * record.drift:+.0f} ppm" in said.message


def test_clocks_that_keep_time_are_left_alone():
    assert pointing_record(made(repetitions=4)[0], SPEC).drift == 0.0


def test_markers_of_another_motion_are_refused():
    recording, _ = made(1)
    other, _ = made(2)
    mixed = Recording(
        "r", Path("r.csv"), "0", "fit", dict(recording.channels), participant="P1", condition="Ctrl",
        optical=other.optical,
    )  # fmt: skip
    with pytest.raises(RecordingError, match=r"r\.csv .*markers against position"):
        pointing_record(mixed, SPEC)


def test_without_an_encoder_both_start_together():
    recording, _ = made(encoder=False)
    assert pointing_record(recording, SPEC).delay is None


def test_a_recording_without_angle_or_participant_is_refused():
    recording, _ = made(encoder=False)
    with pytest.raises(RecordingError, match="expected a channel position with the angle"):
        pointing_record(recording, Assessment(control="Ctrl"))
    nameless = Recording("r", Path("r.csv"), "0", "fit", dict(recording.channels), condition="Ctrl")
    with pytest.raises(RecordingError, match="expected a participant too"):
        recordings_with_condition([nameless])
    still = Recording(
        "r", Path("r.csv"), "0", "fit",
        {**recording.channels, "target": Channel("target", np.zeros(len(recording)), "rad", 0)},
        participant="P1", condition="Ctrl", optical=recording.optical,
    )  # fmt: skip
    with pytest.raises(RecordingError, match="no step of the channel target"):
        pointing_record(still, SPEC)


def test_rounded_labels_are_one_and_random_ones_are_pooled():
    recording, _ = made()
    target = recording["target"] + 0.0
    target[len(target) // 2 :] += 1e-4
    rounded = Recording(
        "r", Path("r.csv"), "0", "fit",
        {**recording.channels, "target": Channel("target", target, "rad", 0)},
        participant="P1", condition="Ctrl", optical=recording.optical,
    )  # fmt: skip
    record = pointing_record(recording, SPEC)
    assert len(labelled_amplitudes([record])) == 5
    assert len([x for x in labelled_amplitudes([pointing_record(rounded, SPEC)]) if x > 0.01]) == 5
    session = measure([record], SPEC, with_rule(SPEC), {}, {})
    assert {m.cell for m in session.movements} == {(a, d) for a in made_pointing.AMPLITUDES for d in ("up", "down")}


def test_a_movement_to_another_target_is_dropped():
    recording, _ = made()
    record = pointing_record(recording, SPEC)
    _, found, _ = record.movements(with_rule(SPEC))
    kept, dropped = drop_mistaken(found, labelled_amplitudes([record]))
    assert (len(kept), dropped) == (10, 0)
    wrong = replace(found[0], amplitude=next(a for a in labelled_amplitudes([record]) if abs(a - found[0].reach) > 0.1))
    kept, dropped = drop_mistaken([wrong, *found[1:]], labelled_amplitudes([record]))
    assert (len(kept), dropped) == (9, 1)


@pytest.mark.parametrize("late", [-1.2, 0.0, 0.9, 2.0])
def test_the_clocks_of_emg_and_motion_are_compared(late):
    rng = np.random.default_rng(5)
    time, angle, _, truth = made_pointing.angle_and_target(rng, 200.0, "Ctrl", 1.0, 1)
    motion = kinematics(time, angle, MovementRule())
    raw = made_pointing.emg(rng, 1000.0, truth, time[-1], "Ctrl")
    at = np.arange(len(raw)) / 1000.0 + late
    found = emg_lead(*emg_and_motion(at, np.abs(raw).sum(axis=1), motion))
    assert found.lead == pytest.approx(0.1 - late, abs=0.1)
    assert found.plausible == (late == 0.0)


def test_emg_that_says_nothing_is_not_accused():
    rng = np.random.default_rng(6)
    time, angle, _, _ = made_pointing.angle_and_target(rng, 200.0, "Ctrl", 1.0, 1)
    at = np.arange(int(time[-1] * 1000.0)) / 1000.0
    noise = np.abs(rng.standard_normal(len(at)))
    motion = kinematics(time, angle, MovementRule())
    assert emg_lead(*emg_and_motion(at, noise, motion)).plausible
    assert emg_and_motion(at + 1000.0, noise, motion) is None
