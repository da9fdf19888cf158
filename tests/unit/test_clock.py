"""Stamps that are not the times at which samples were taken: identified with the truth clock's values, and told."""

import numpy as np
import pytest

import pellucid as pl

RATE = 200.0
TRUTH = {"inertia": 0.05, "gravity": 1.5, "viscous": 0.1, "coulomb": 0.2}


def sampled(time, rng):
    """Position and current of a pendulum at any times, with an encoder's steps and noise, shape (n,)."""
    q, v, a = np.zeros(len(time)), np.zeros(len(time)), np.zeros(len(time))
    for amplitude, frequency, phase in ((0.5, 0.4, 0.0), (0.3, 1.1, 0.7), (0.1, 2.3, 1.9)):
        w = 2 * np.pi * frequency
        q += amplitude * np.sin(w * time + phase)
        v += amplitude * w * np.cos(w * time + phase)
        a -= amplitude * w**2 * np.sin(w * time + phase)
    torque = 0.05 * a + 1.5 * np.sin(q) + 0.1 * v + 0.2 * np.tanh(v / 0.05)
    noisy = q + 1e-4 * rng.standard_normal(len(time))
    return np.round(noisy / 2e-4) * 2e-4, torque / 2.0 + 0.01 * rng.standard_normal(len(time))


def in_order(stamps):
    """Stamps, each at least 10 us after the one before: a queue hands packets on one after the other."""
    made = np.array(stamps)
    for k in range(1, len(made)):
        made[k] = max(made[k], made[k - 1] + 1e-5)
    return made


def usb_batches(rng, time):
    """A host that reads at irregular times all that has been sampled since."""
    polls = np.cumsum(rng.uniform(0.008, 0.025, int(time[-1] / 0.008) + 10))
    return in_order(polls[np.searchsorted(polls, time)])


def late_by_chance(rng, time):
    return in_order(time + rng.exponential(0.001, len(time)))


def stalled(rng, time):
    """A host that stops for up to 30 ms now and then, and reads the rest at once."""
    late = rng.exponential(2e-4, len(time))
    for start in rng.integers(0, len(time) - 10, 8):
        late[start : start + 6] = np.maximum(late[start : start + 6], time[start + 6] - time[start : start + 6])
    return in_order(time + late)


def even(n=4000):
    return np.arange(n) / RATE


def other_rate(n=4000):
    """The rate falls to five eighths in the middle."""
    return np.cumsum(np.where(np.arange(n) < n // 2, 1.0, 1.6)) / RATE


def paused(n=4000):
    return even(n) + np.where(np.arange(n) > n // 2, 1.2, 0.0)


def study_of(make_study, time, stamps, rng):
    q, i = sampled(time, rng)
    return make_study({"t": stamps, "q": q, "i": i})


def error(study):
    """Largest relative error of the parameters."""
    found = pl.identify(study, families=["symmetric"], thorough=False)
    return max(abs(found[name].value / value - 1.0) for name, value in TRUTH.items()), found


@pytest.mark.parametrize(
    ("taken", "stamp"),
    [
        (even, usb_batches),
        (even, stalled),
        (other_rate, late_by_chance),
        (paused, late_by_chance),
        (paused, usb_batches),
    ],
)
def test_stamps_that_say_when_samples_arrived(make_study, rng, taken, stamp):
    time = taken()
    study = study_of(make_study, time, stamp(rng, time), rng)
    assert study.recording("sweep").stamped_evenly
    off, found = error(study)
    assert off < 0.04
    (fault,) = [f for f in pl.check(study) if f.kind == "sampling_jitter"]
    assert fault.severity == "warn"
    assert "ms RMS" in fault.message
    (told,) = [v for v in found.verdicts if "stamps smoothed" in v.text]
    assert told.kind == "warning"


def delivered_twice(rng, n, share=0.12):
    """Row that each delivery carries: some come again, most of them in the first half."""
    again = rng.random(n) < np.where(np.arange(n) < n // 2, share, 0.2 * share)
    return np.sort(np.concatenate([np.arange(n), np.flatnonzero(again)]))


@pytest.mark.parametrize(("late", "jitter"), [(0.0, 0.0), (4e-4, 6e-4), (1.2e-3, 6e-4)])
def test_packets_delivered_twice(make_study, rng, late, jitter):
    time = even()
    rows = delivered_twice(rng, len(time))
    again = np.append(False, rows[1:] == rows[:-1])
    stamps = (time + np.clip(jitter * rng.standard_normal(len(time)), -1.2e-3, 1.2e-3))[rows] + late * again
    q, i = sampled(time, rng)
    study = make_study({"t": stamps, "q": q[rows], "i": i[rows]})
    assert study.recording("sweep").repeats == again.sum()
    assert len(study.recording("sweep")) == len(time)
    off, found = error(study)
    assert off < 0.04
    (fault,) = [f for f in pl.check(study) if f.kind == "repeated_packets"]
    assert fault.severity == "warn"
    assert f"{again.sum()} of {len(rows)} rows" in fault.found
    assert [v.kind for v in found.verdicts if "repeat the samples" in v.text] == ["warning"]


def test_samples_that_were_taken_unevenly_keep_their_stamps(make_study, rng):
    time = np.cumsum(rng.uniform(0.6, 1.4, 4000)) / RATE
    study = study_of(make_study, time, time, rng)
    assert not study.recording("sweep").stamped_evenly
    assert error(study)[0] < 0.04


@pytest.mark.parametrize("taken", [other_rate, paused])
def test_a_clock_without_jitter_is_left_alone(make_study, rng, taken):
    study = study_of(make_study, taken(), taken(), rng)
    assert study.recording("sweep").clock.moved == 0.0
    assert [f for f in pl.check(study) if f.severity == "warn"] == []
    assert error(study)[0] < 0.04


def test_a_machine_that_rests_repeats_no_packet(make_study, rng):
    columns = make_study.swing()
    rests = columns["t"] > 5.0
    columns["q"] = np.where(rests, columns["q"][1000], columns["q"])
    columns["i"] = np.where(rests, 0.0, columns["i"])
    assert make_study(columns).recording("sweep").repeats == 0
    jittered = columns | {"t": columns["t"] + rng.uniform(-0.2, 0.2, 2000) / RATE}
    assert make_study(jittered).recording("sweep").repeats == 0


def test_a_time_that_repeats_with_other_samples_is_still_refused(make_study):
    columns = make_study.swing()
    columns["t"][700] = columns["t"][699]
    assert [f.kind for f in pl.check(make_study(columns)) if f.severity == "refuse"] == ["time_order"]
