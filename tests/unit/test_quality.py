"""Each fault of a recording is found, and what only looks like one is not."""

import re

import numpy as np
import pytest

from pellucid._errors import RecordingError
from pellucid.files.defects.magnitude import find_implausible
from pellucid.files.recording import Channel
from pellucid.study.quality import inspect, require_sound


def faults(study, severity=None):
    return [f for f in inspect(study.recording("sweep"), study) if severity in (None, f.severity)]


def one(study):
    (fault,) = faults(study)
    assert fault.file == "sweep.csv"
    assert "sweep.csv (recording sweep), channel " in fault.message
    assert f"found {fault.found}, expected {fault.expected}" in fault.message
    return fault


def one_cut(study):
    (fault,) = faults(study)
    assert f"channel {fault.channel}: found {fault.found}, cut out" in fault.message
    return fault


def changed(make_study, name, change, *changes):
    columns = make_study.swing()
    column = columns[name].copy()
    change(column)
    return make_study(columns | {name: column}, *changes)


def test_a_sound_recording_has_no_fault(make_study):
    study = make_study()
    assert faults(study) == []
    assert require_sound(study.recording("sweep"), study) is None


def test_a_run_of_missing_samples(make_study):
    def lose(i):
        i[[10, 500, 501, 502]] = np.nan

    study = changed(make_study, "i", lose, ("[processing]", '[processing]\ncut = "none"'))
    found = faults(study)
    assert {(f.severity, f.kind, f.channel) for f in found} == {("refuse", "missing_samples", "current")}
    assert [f.found for f in found] == [
        "1 missing sample (NaN) at 0.05 s (sample 10)",
        "3 missing samples (NaN) at 2.5 s (samples 500 to 502)",
    ]
    with pytest.raises(RecordingError, match=r"channel current: found 1 missing sample"):
        require_sound(study.recording("sweep"), study)


def test_missing_samples_elsewhere_are_noted(make_study):
    columns = make_study.swing()
    study = make_study(
        columns | {"e": np.where(columns["t"] < 1, np.nan, 1e-3 * np.sin(columns["i"]))},
        ("[processing]", 'emg.biceps = { column = "e", unit = "V" }\n[processing]'),
    )
    assert (one(study).severity, one(study).channel) == ("note", "emg.biceps")


def pushed(columns):
    """Columns in which another effort acts on the joint, so that the motion does not tell what the drive did."""
    return columns | {"i": columns["i"] + 2.0 * np.sin(11.0 * columns["t"])}


@pytest.mark.parametrize("share", [0.8, 0.5])
@pytest.mark.parametrize(("name", "channel"), [("i", "current"), ("q", "position")])
def test_a_clipped_channel(make_study, name, channel, share):
    columns = pushed(make_study.swing())
    limit = share * columns[name].max()
    study = make_study(columns | {name: np.minimum(columns[name], limit)})
    found = [f for f in faults(study) if f.kind == "clipped"]
    assert [(f.severity, f.channel) for f in found] == [("refuse", channel)]
    assert "flat run" in found[0].found
    assert "at the largest value" in found[0].found
    assert 'clip = "accept"' in found[0].expected


def test_a_current_that_the_motion_exceeds_is_cut_out_whatever_its_share(make_study):
    columns = make_study.swing()
    study = make_study(columns | {"i": np.minimum(columns["i"], 0.6 * columns["i"].max())})
    assert {(f.severity, f.kind, f.channel) for f in faults(study)} == {("cut", "sensor_range", "current")}
    assert sum(cut.samples for cut in study.recording("sweep").cuts) > 0.1 * len(study.recording("sweep"))


def test_a_few_clipped_samples_are_cut_out(make_study):
    columns = pushed(make_study.swing())
    columns["i"] = np.minimum(columns["i"], 0.95 * columns["i"].max())
    found = faults(make_study(columns))
    assert {(f.severity, f.kind, f.channel) for f in found} == {("cut", "clipped", "current")}
    assert "samples clipped at" in found[0].found


def test_a_known_limit_or_an_accepted_one_is_a_note(make_study):
    columns = pushed(make_study.swing())
    limit = 0.7 * columns["i"].max()
    columns["i"] = np.clip(columns["i"], -limit, limit)
    known = make_study(columns, ("[channels]", f'limit = "{limit} A"\n[channels]'))
    assert {(f.severity, f.kind) for f in faults(known)} == {("note", "clipped")}
    accepted = make_study(columns, ('unit = "A"', 'unit = "A", clip = "accept"'))
    assert {(f.severity, f.kind) for f in faults(accepted)} == {("note", "clipped")}
    assert {f.severity for f in faults(make_study(columns))} == {"refuse"}


def test_a_quantised_peak_is_not_clipped(make_study):
    for bits in (0.05, 0.005, 0.0005):
        columns = make_study.swing()
        study = make_study({name: x if name == "t" else np.round(x / bits) * bits for name, x in columns.items()})
        assert faults(study) == [], bits


def test_a_joint_at_rest_is_neither_clipped_nor_frozen(make_study):
    """Minimum-jerk movements with pauses, and friction that lets the effort fall during them."""
    t = np.arange(4000) / 200.0
    phase = np.clip((t % 4.0) / 1.5, 0.0, 1.0)
    shape = 10 * phase**3 - 15 * phase**4 + 6 * phase**5
    q = np.where((t // 4.0) % 2 == 0, shape, 1.0 - shape)
    q = np.round(q / 0.0015) * 0.0015
    v = np.gradient(np.where((t // 4.0) % 2 == 0, shape, 1.0 - shape), t)
    i = 0.8 * np.sin(q) + 0.2 * np.tanh(v / 0.05) + 0.05 * np.cos(0.5 * t)
    study = make_study({"t": t, "q": q, "i": i})
    assert faults(study) == []


def test_commanded_steps_are_not_clipped(make_study):
    columns = make_study.swing()
    columns["i"] = np.sign(np.sin(2 * np.pi * 0.7 * columns["t"])) * 1.5
    assert not [f for f in faults(make_study(columns)) if f.kind == "clipped"]


@pytest.mark.parametrize(("unit", "ratio"), [("rad", None), ("deg", 0.017), ("mrad", 0.001)])
def test_a_position_in_another_unit_than_its_reference_is_found(make_study, unit, ratio):
    """Such a unit gave a confident model whose inertia was wrong by the factor."""
    columns = make_study.swing()
    columns["want"] = columns["q"] + 0.01 * np.sin(9.0 * columns["t"])
    channels = 'reference = { column = "want", unit = "rad" }\n'
    study = make_study(columns, ('unit = "rad"', f'unit = "{unit}"'), ("[channels]\n", f"[channels]\n{channels}"))
    found = [f for f in faults(study) if f.kind == "magnitude" and f.channel == "position"]
    assert len(found) == (ratio is not None)
    for fault in found:
        assert fault.severity == "refuse"
        assert fault.found == f"a motion of {ratio:.2g} times that of its reference, which it follows"


def test_an_encoder_that_freezes(make_study):
    for first, last in ((400, 605), (400, 2000), (0, 600)):

        def freeze(q, first=first, last=last):
            q[first:last] = q[first]

        refused, cut = faults(changed(make_study, "q", freeze))
        assert (refused.severity, refused.kind) == ("refuse", "too_much_cut")
        assert (cut.severity, cut.kind, cut.channel) == ("cut", "frozen_encoder", "position")
        assert f"(samples {first} to {last - 1})" in cut.found


def test_an_encoder_that_never_moves(make_study):
    def freeze(q):
        q[:] = 0.3

    assert "the one value 0.3 in every sample" in faults(changed(make_study, "q", freeze), "refuse")[0].found


def test_an_encoder_that_freezes_under_a_loop_that_follows(make_study):
    columns = make_study.swing()
    columns["r"] = columns["q"] + 0.001
    columns["q"] = columns["q"].copy()
    # It stops at a turning point, where no speed gives it away, and returns where it froze.
    start = 300 + int(np.argmax(columns["q"][300:500]))
    end = start + int(np.flatnonzero(columns["q"][start + 50 :] >= columns["q"][start])[0]) + 50
    columns["q"][start:end] = columns["q"][start]
    study = make_study(columns, ("[processing]", 'reference = { column = "r", unit = "rad" }\n[processing]'))
    assert [f.kind for f in faults(study) if f.severity != "note"] == ["frozen_encoder"]


def test_a_breakaway_ramp_is_not_a_frozen_encoder(make_study):
    t = np.arange(2000) / 200.0
    i = np.minimum(t / 5.0, 1.0) * 1.2
    # It sticks for 4.5 s under a rising current, then slides off smoothly.
    q = np.where(t > 4.5, 0.05 * np.clip(t - 4.5, 0, None) ** 2, 0.0)
    assert faults(make_study({"t": t, "q": np.round(q / 0.001) * 0.001, "i": i}), "refuse") == []


def test_time_that_runs_back_or_repeats(make_study):
    def back(t):
        t[700] = t[690]

    fault = one(changed(make_study, "t", back))
    assert (fault.severity, fault.kind, fault.channel) == ("refuse", "time_order", "time")
    assert "running back at index 700 (3.495 s, then 3.45 s), 1 times" in fault.found

    def repeat(t):
        t[700] = t[699]

    assert "repeated at index 700" in one(changed(make_study, "t", repeat)).found


def test_jitter_that_moves_little_is_no_warning(make_study, rng):
    """Whole milliseconds of a clock made "Cannot say" of a right model."""
    columns = make_study.swing()
    columns["t"] = columns["t"] + np.where(rng.random(2000) < 0.02, 1.1e-3, 0.0)
    fault = one(make_study(columns))
    assert (fault.severity, fault.kind) == ("note", "sampling_jitter")


def test_sampling_jitter_is_told_and_resampled(make_study, rng):
    columns = make_study.swing()
    columns["t"] = columns["t"] + rng.uniform(-0.2, 0.2, 2000) / 200.0
    fault = one(make_study(columns))
    assert (fault.severity, fault.kind) == ("warn", "sampling_jitter")
    assert "irregular steps" in fault.found
    assert "of 0.005 s in 1 of 100 samples" in fault.found
    assert re.fullmatch(
        r"an even clock; stamps smoothed over \d+ samples, which fit the motion better: they moved by "
        r"0\.5\d+ ms RMS, 1\.\d+ ms at most; then interpolated to (199\.\d+|200\.?\d*) Hz",
        fault.expected,
    )
    resampled = make_study(columns, ("[processing]", '[processing]\nresample = "150 Hz"'))
    # A stated rate leaves the stamps as they were recorded, unless the study decides it.
    assert one(resampled).expected == "an even clock; interpolated to 150 Hz"
    both = ("[processing]", '[processing]\nresample = "150 Hz"\nsmooth_stamps = "always"')
    assert one(make_study(columns, both)).expected.endswith("then interpolated to 150 Hz")


def test_the_last_digit_of_a_clock_is_no_jitter(make_study):
    columns = make_study.swing()
    columns["t"] = np.round(columns["t"], 4)
    assert faults(make_study(columns)) == []


@pytest.mark.parametrize("lost", [3, 60])
def test_a_gap(make_study, lost):
    columns = {name: np.delete(x, slice(800, 800 + lost)) for name, x in make_study.swing().items()}
    fault = one_cut(make_study(columns))
    assert (fault.severity, fault.kind) == ("cut", "gap")
    assert fault.found == f"a gap of {(lost + 1) / 200:.4g} s instead of 0.005 s at 3.995 s (after sample 799)"
    # Who asks for another rate has what the filter would not keep interpolated.
    resampled = make_study(columns, ("[processing]", '[processing]\nresample = "200 Hz"'))
    assert [f.severity for f in faults(resampled)] == ["note" if lost == 3 else "cut"]


def test_too_few_samples(make_study):
    fault = one(make_study(make_study.swing(200)))
    assert (fault.severity, fault.kind) == ("refuse", "too_few_samples")
    assert fault.found == "200 samples (1 s)"
    assert fault.expected == "at least 290: 50 are to be left after trim = 20 and decimate = 5"
    assert [f.kind for f in faults(make_study(make_study.swing(1)), "refuse")] == ["too_few_samples"]


def test_a_low_pass_beyond_half_the_rate(make_study):
    fault = one(make_study(None, ('"20 Hz"', '"100 Hz"')))
    assert (fault.severity, fault.kind) == ("refuse", "rate")
    assert fault.expected.startswith("more than twice the low-pass of 100 Hz")


def test_degrees_that_pass_for_radians(make_study):
    columns = make_study.swing()
    study = make_study(columns | {"q": np.degrees(columns["q"])})
    fault = one(study)
    assert (fault.severity, fault.kind) == ("refuse", "magnitude")
    assert "rad, which looks like deg" in fault.found
    assert 'write unit = "deg", or [rig.limits]' in fault.expected
    turns = make_study(None, ("[channels]", '[rig.limits]\nposition_max = "50 rad"\n[channels]'))
    assert require_sound(turns.recording("sweep"), turns) is None


def test_milliseconds_that_pass_for_seconds(make_study):
    columns = make_study.swing()
    study = make_study(columns | {"t": 1000 * columns["t"]}, ('"20 Hz"', '"0.05 Hz"'))
    assert "looks like ms" in one(study).found


def test_an_encoder_that_rolls_over(make_study):
    columns = make_study.swing()
    turn = columns["q"] + 0.9 * np.pi
    columns["q"] = (turn + 2 * np.pi * columns["t"] / 10) % (2 * np.pi)
    fault = one(make_study(columns))
    assert (fault.severity, fault.kind) == ("refuse", "wrap")
    assert 'wrap = "360 deg"' in fault.expected


def test_a_missing_channel(make_study):
    study = make_study(None, ('kind = "current"\ntorque_constant = "2 N*m/A"', 'kind = "torque"'))
    fault = one(study)
    assert (fault.severity, fault.kind) == ("refuse", "missing_channel")
    assert "a channel torque or force" in fault.expected
    assert "only time, position, current" in fault.found


def test_a_duty_needs_a_supply(make_study):
    duty = [
        ('kind = "current"\ntorque_constant = "2 N*m/A"', 'kind = "voltage"'),
        ('current = { column = "i", unit = "A"', 'duty = { column = "i", unit = "1"'),
    ]
    assert one(make_study(None, *duty)).channel == "supply"
    assert faults(make_study(None, *duty, ("[channels]", 'supply = "7.4 V"\n[channels]'))) == []


def test_every_fault_is_told_at_once(make_study):
    columns = make_study.swing()
    columns["q"] = np.minimum(columns["q"], 0.5)
    columns["i"] = columns["i"].copy()
    columns["i"][5] = np.nan
    study = make_study(columns, ("[processing]", '[processing]\ncut = "none"'))
    with pytest.raises(RecordingError) as error:
        require_sound(study.recording("sweep"), study)
    assert len(str(error.value).splitlines()) == 2


def test_an_envelope_relative_to_a_maximum_is_in_no_millivolts():
    """A study of a joint called it "a magnitude of 0.2 1, which looks like mV taken for 1"."""
    x = np.linspace(0.0, 0.4, 200)
    assert find_implausible(Channel("emg.biceps", x, "1", 0)) is None
    assert find_implausible(Channel("emg.biceps", x, "V", 0)).probable_unit == "mV"
    assert [Channel("duty", x, unit, 0).unit_words for unit in ("1", "%")] == ["", " %"]
