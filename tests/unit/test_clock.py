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


FAST = 1000.0
"""Rate of a clock that loses samples [Hz]."""


def lossy_rows(rng, n, share, gaps=4):
    """Rows of an even clock that arrive: single ones are lost, and `gaps` times seven in a row."""
    lost = rng.random(n) < share
    lost[1:] &= ~lost[:-1]
    for first in rng.integers(n // 20, n - n // 20, gaps):
        lost[first - 2 : first + 9] = False
        lost[first : first + 7] = True
    return np.flatnonzero(~lost)


def lossy_columns(rng, share, packets, *, jitter=0.0, seconds=30.0):
    """Columns with true times of which samples are lost. The position is a mean over `packets` that arrived.

    The velocity is the true one, with noise; `jitter` moves stamps [s]."""
    time = np.arange(int(seconds * FAST)) / FAST
    rows = lossy_rows(rng, len(time), share)
    q, i = sampled(time, rng)
    v = np.zeros(len(time))
    for amplitude, frequency, phase in ((0.5, 0.4, 0.0), (0.3, 1.1, 0.7), (0.1, 2.3, 1.9)):
        v += amplitude * 2 * np.pi * frequency * np.cos(2 * np.pi * frequency * time + phase)
    half = packets // 2
    mean = np.convolve(np.pad(q[rows], half, "edge"), np.full(packets, 1.0 / packets), "valid")
    stamps = time[rows] + jitter * np.clip(rng.standard_normal(len(rows)), -3.0, 3.0)
    return {"t": stamps, "q": mean, "v": (v + 0.01 * rng.standard_normal(len(v)))[rows], "i": i[rows]}


FASTER = ("decimate = 5\ntrim = 20", "decimate = 25\ntrim = 100")
VELOCITY = ('position = { column = "q", unit = "rad" }',
            'position = { column = "q", unit = "rad" }\nvelocity = { column = "v", unit = "rad/s" }')  # fmt: skip


@pytest.mark.parametrize("share", [0.03, 0.15])
@pytest.mark.parametrize("packets", [1, 3, 21])
@pytest.mark.parametrize("recorded", [(), (VELOCITY,)], ids=["position", "velocity"])
def test_a_clock_that_loses_samples_keeps_its_stamps(make_study, rng, share, packets, recorded):
    study = make_study(lossy_columns(rng, share, packets), FASTER, *recorded)
    recording = study.recording("sweep")
    assert recording.loses_samples
    assert recording.clock.moved == 0.0
    assert error(study)[0] < 0.04
    (fault,) = [f for f in pl.check(study) if f.kind == "sampling_jitter"]
    assert (fault.severity, fault.found) == ("note", "steps of several times 0.001 s, because samples are lost")


@pytest.mark.parametrize("packets", [3, 21])
def test_a_recorded_velocity_judges_the_stamps(make_study, rng, packets):
    columns = lossy_columns(rng, 0.03, packets, jitter=1e-4)
    by_position = make_study(columns, FASTER).recording("sweep")
    assert not by_position.loses_samples  # its steps are no whole periods
    assert by_position.clock.moved > 0.8e-3
    assert make_study(columns, FASTER, VELOCITY).recording("sweep").clock.moved < 0.25e-3


@pytest.mark.parametrize(("taken", "stamp"), [(even, usb_batches), (even, stalled), (paused, late_by_chance)])
@pytest.mark.parametrize(("gain", "late"), [(1.0, 0), (0.97, 3)])
def test_a_recorded_velocity_shows_that_stamps_jitter(make_study, rng, taken, stamp, gain, late):
    time = taken()
    stamps = stamp(rng, time)
    q, i = sampled(time, rng)
    v = gain * np.roll(np.gradient(sampled(time, np.random.default_rng(0))[0], time), late)
    recording = make_study({"t": stamps, "q": q, "v": v, "i": i}, VELOCITY).recording("sweep")
    assert recording.stamped_evenly
    assert np.std(recording.clock.time - time) < 0.6 * np.std(stamps - time)


@pytest.mark.parametrize("size", [1e-3, 20.0])
def test_a_velocity_that_does_not_follow_the_position_judges_nothing(make_study, rng, size):
    time = even()
    stamps = usb_batches(rng, time)
    q, i = sampled(time, rng)
    columns = {"t": stamps, "q": q, "v": size * rng.standard_normal(len(time)), "i": i}
    windows = [make_study(columns, *change).recording("sweep").clock.window for change in ((VELOCITY,), ())]
    assert windows[0] == windows[1] > 0


def test_rounded_stamps_of_an_even_clock_are_smoothed(make_study, rng):
    time = np.arange(16000) / 900.0
    study = study_of(make_study, time, np.round(time, 3), rng)
    recording = study.recording("sweep")
    assert not recording.loses_samples
    assert recording.stamped_evenly
    assert np.abs(recording.clock.time - time).max() < 2e-4


def test_no_stamp_is_smoothed_across_a_gap(make_study, rng):
    """Three samples are missing in a gap that `resample` bridges."""
    time = np.delete(even(), slice(2000, 2003))
    stamps = in_order(time + rng.exponential(0.001, len(time)))
    q, i = sampled(time, rng)
    change = ("[processing]", '[processing]\nresample = "200 Hz"\nsmooth_stamps = "always"')
    recording = make_study({"t": stamps, "q": q, "i": i}, change).recording("sweep")
    assert recording.cuts == ()
    assert recording.stamped_evenly
    # A line across the gap would close it.
    assert recording.clock.time[2000] - recording.clock.time[1999] == pytest.approx(0.02, abs=0.0015)
    assert np.std(recording.clock.time - time) < 3e-4


def test_the_study_decides_whether_stamps_are_smoothed(make_study, rng):
    time = even()
    stamps = usb_batches(rng, time)
    q, i = sampled(time, rng)
    columns = {"t": stamps, "q": q, "i": i}

    def clock(*lines):
        return make_study(columns, ("[processing]", "\n".join(["[processing]", *lines]))).recording("sweep").clock

    assert clock().window > 0
    assert clock('smooth_stamps = "never"').window == 0
    assert clock('resample = "200 Hz"').window == 0
    assert clock('resample = "200 Hz"', 'smooth_stamps = "always"').window > 0
    truth = make_study(columns | {"t": time}, ("[processing]", '[processing]\nsmooth_stamps = "always"'))
    assert truth.recording("sweep").stamped_evenly
    assert error(truth)[0] < 0.04
