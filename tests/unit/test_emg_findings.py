"""Findings of EMG: each spoiling is named with its channel and time, and clean EMG has none.

Clean EMG is noise of 25 to 350 Hz whose size follows bursts; spoilings are made without the code that finds them.
"""

import numpy as np
import pytest
from scipy import signal

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.emg.signals.emg_findings import FINDING_KINDS
from pellucid.files.defects.magnitude import find_implausible
from pellucid.files.recording import Channel

RATES = (1000.0, 1926.0, 2148.0)


def clean(rate=2000.0, seconds=12.0, channels=3, seed=0):
    """Return EMG of muscles that work once a stride, (n, channels) [V]."""
    rng = np.random.default_rng([11, seed])
    t = np.arange(round(seconds * rate)) / rate
    sos = signal.butter(2, [25.0, 350.0], "bandpass", fs=rate, output="sos")
    columns = []
    for _ in range(channels):
        phase = (t / rng.uniform(0.9, 1.4) + rng.uniform()) % 1.0
        burst = np.exp(-(((phase - 0.5) / rng.uniform(0.06, 0.15)) ** 2))
        noise = signal.sosfiltfilt(sos, rng.standard_normal(len(t)))
        columns.append(
            1e-6 * (rng.uniform(60.0, 250.0) * burst * noise / noise.std() + 3.0 * rng.standard_normal(len(t)))
        )
    return t, np.column_stack(columns)


def beats(t, rng, size=3e-4):
    """Return complexes of a heart: a sharp wave and a slower one, at 66 to 80 beats a minute that vary by 4 %."""
    found, at = np.zeros_like(t), 0.3
    while at < t[-1]:
        found += size * (np.exp(-(((t - at) / 0.011) ** 2)) - 0.35 * np.exp(-(((t - at - 0.03) / 0.012) ** 2)))
        found += 0.15 * size * np.exp(-(((t - at - 0.2) / 0.04) ** 2))
        at += 0.82 * (1.0 + 0.04 * rng.standard_normal())
    return found


def cables(t, size=1.5e-3):
    """Return swings of cables at each stride."""
    return sum(
        size * np.exp(-(((t - at) / 0.06) ** 2)) * np.sin(2 * np.pi * 5.0 * (t - at))
        for at in np.arange(0.8, t[-1], 1.07)
    )


def kinds(emg, rate=2000.0, **more):
    return [(one.channel, one.kind) for one in pl.emg_quality(emg, rate=rate, **more)]


@pytest.mark.parametrize("seed", range(12))
def test_clean_emg_has_no_finding(seed):
    rate = RATES[seed % 3]
    assert kinds(clean(rate, seconds=4.0 + 2.0 * seed, seed=seed)[1], rate) == []


@pytest.mark.parametrize("step", [0.3e-6, 2e-6, 6e-6])
def test_a_coarse_converter_is_no_dropout(step):
    emg = clean(seed=3)[1]
    assert kinds(np.round(emg / step) * step) == []


@pytest.mark.parametrize("value", ["held", 0.0, np.nan])
def test_a_dropout_is_named_with_its_time(value):
    _, emg = clean(seed=1)
    emg[6000:7200, 1] = emg[6000, 1] if value == "held" else value
    (one,) = pl.emg_quality(emg, rate=2000.0, channels=["VL", "BF", "TA"])
    assert (one.channel, one.kind) == ("BF", "dropout")
    assert (one.start, one.end) == pytest.approx((3.0, 3.6), abs=2e-3)
    assert "600 ms" in one.found


def test_a_dropout_of_all_channels_is_one_of_each():
    _, emg = clean(seed=2)
    emg[8000:9000] = 0.0
    assert kinds(emg) == [(0, "dropout"), (1, "dropout"), (2, "dropout")]


@pytest.mark.parametrize("volts", [0.0, 8e-8])
def test_a_dead_channel_is_named_and_the_others_are_not(volts):
    _, emg = clean(seed=4)
    emg[:, 2] = volts * np.random.default_rng(0).standard_normal(len(emg))
    assert kinds(emg) == [(2, "dead")]


@pytest.mark.parametrize("mains", [50.0, 60.0])
@pytest.mark.parametrize("seed", range(3))
def test_hum_is_named_with_its_frequency(mains, seed):
    t, emg = clean(seconds=6.0, seed=seed)
    emg[:, 0] += 4e-5 * np.sin(2 * np.pi * mains * t) + 1e-5 * np.sin(2 * np.pi * 3 * mains * t)
    (one,) = pl.emg_quality(emg, rate=2000.0)
    assert (one.channel, one.kind) == (0, "mains")
    assert f"{mains:g} Hz" in one.found
    assert one.size == pytest.approx(4e-5 / np.sqrt(2.0), rel=0.15)


@pytest.mark.parametrize("seed", range(6))
def test_a_heartbeat_is_no_burst_of_a_muscle(seed):
    t, emg = clean(RATES[seed % 3], seconds=20.0, seed=seed)
    emg[:, 1] += beats(t, np.random.default_rng(seed))
    assert kinds(emg, RATES[seed % 3]) == [(1, "heartbeat")]


@pytest.mark.parametrize("seed", range(4))
def test_moving_cables_are_named(seed):
    t, emg = clean(seed=seed)
    emg[:, 2] += cables(t)
    assert kinds(emg) == [(2, "motion")]


def test_saturation_short_peaks_and_units_are_named():
    _, emg = clean(seed=5)
    assert {kind for _, kind in kinds(np.clip(emg, -1e-4, 1e-4))} == {"saturation"}
    peaked = emg.copy()
    peaked[9000:9016, 0] += 6e-3
    (one,) = pl.emg_quality(peaked, rate=2000.0)
    assert (one.channel, one.kind, one.start) == (0, "mvc_artefact", 4.5)
    assert {kind for _, kind in kinds(1e6 * emg)} == {"unit"}
    assert kinds(1e6 * emg, unit="µV") == kinds(1e6 * emg, unit="") == []


def test_envelopes_are_held_to_other_limits():
    _, emg = clean(seed=6)
    sos = signal.butter(2, 6.0, fs=2000.0, output="sos")
    envelope = np.maximum(signal.sosfiltfilt(sos, np.abs(emg), axis=0), 0.0)
    assert kinds(envelope) == []
    assert kinds(0.8 * envelope / envelope.max(axis=0), unit="1") == []
    assert {kind for _, kind in kinds(envelope / envelope.max(axis=0), unit="1")} == {"normalised_per_trial"}


@pytest.mark.parametrize("floor", [0.0, 0.4])
def test_an_envelope_beside_raw_emg_is_found_as_by_onset(floor):
    """Quality called a channel sound of which onset said that it is an envelope."""
    _t, emg = clean(seed=6)
    emg[:, 1] = np.abs(emg[:, 1]) + floor * np.abs(emg[:, 1]).mean()
    assert kinds(emg) == [(1, "envelope")] == kinds(emg, unit="")
    with pytest.raises(PellucidError, match="as in an envelope"):
        pl.onset(emg[:, 1], fs=2000.0)
    # Counts of a converter have an offset in every channel.
    assert kinds(1e3 + 1e6 * clean(seed=6)[1], unit="") == []


def test_every_finding_says_what_it_does():
    t, emg = clean(seed=7)
    emg[:, 0] += beats(t, np.random.default_rng(1))
    (one,) = pl.emg_quality(emg, rate=2000.0)
    assert one.kind in FINDING_KINDS
    assert one.consequence.endswith(".")
    assert str(one).startswith("0, ")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (([],), "found EMG of shape"),
        ((["loud"],), "found text, expected an array of real numbers"),
        ((np.ones((4, 2, 2)),), "found EMG of shape"),
    ],
)
def test_what_is_no_emg_is_refused(arguments, said):
    with pytest.raises(PellucidError, match=said):
        pl.emg_quality(*arguments, rate=1000.0)


@pytest.mark.parametrize(
    ("more", "said"),
    [({"rate": 0.0}, "rate"), ({"rate": 1000.0, "unit": "kg"}, "unit"), ({"rate": 1000.0, "channels": ["a"]}, "names")],
)
def test_wrong_arguments_are_named(more, said):
    with pytest.raises(PellucidError, match=said):
        pl.emg_quality(np.ones((2000, 2)), **more)


def test_a_file_and_an_array_have_the_same_findings(tmp_path):
    t, emg = clean(seed=8)
    emg[:, 1] *= 0.0
    emg[5000:6000, 2] = emg[5000, 2]
    rows = "".join(
        f"{a:.4f},{b:.9f},{c:.9f},{d:.9f},{np.sin(a):.6f}\n" for a, (b, c, d) in zip(t, 1e3 * emg, strict=True)
    )
    path = tmp_path / "walk.csv"
    path.write_text("time [s],EMG VL [mV],EMG BF [mV],EMG TA [mV],knee angle [rad]\n" + rows, encoding="utf-8")
    found = [(v.channel, f.kind) for v in pl.audit(path).verdicts for _, f in v.findings]
    names = ("EMG VL [mV]", "EMG BF [mV]", "EMG TA [mV]")
    assert found == [(names[channel], kind) for channel, kind in kinds(emg)]


RAW = 1e-4 * np.random.default_rng(3).standard_normal(4000) * np.repeat([0.02, 1.0, 0.02, 1.0], 1000)


@pytest.mark.parametrize("call", [pl.envelope, pl.onset, pl.emg_quality])
def test_functions_of_emg_take_rate_and_fs(call):
    assert repr(call(RAW, rate=2000.0)) == repr(call(RAW, fs=2000.0))
    with pytest.raises(pl.PellucidError, match="both are the sampling rate"):
        call(RAW, rate=2000.0, fs=2000.0)


@pytest.mark.parametrize("samples", [[], np.zeros((0, 3)), ["a", "b"]])
@pytest.mark.parametrize("call", [pl.envelope, pl.onset, pl.emg_quality, pl.synergies])
def test_functions_of_emg_refuse_empty_arrays_and_text(call, samples):
    with pytest.raises(pl.PellucidError, match="expected"):
        call(samples, rate=2000.0)


def test_microvolts_that_are_taken_for_volts_are_named_so():
    (one,) = {f.found for f in pl.emg_quality(1e6 * RAW, rate=2000.0) if f.kind == "unit"}
    assert "as µV" in one
    wrong = find_implausible(Channel("emg.biceps", 1e6 * RAW, "V", ""))
    assert wrong is not None
    assert wrong.probable_unit == "uV"


def walking(seed, rate=1000.0, pace=1.1, session=3):
    """Return EMG of four muscles of one person, each with its own size, spectrum and time in a stride."""
    rng, body = np.random.default_rng([seed, 5]), np.random.default_rng(session)
    t = np.arange(round(12.0 * rate)) / rate
    columns = []
    for k in range(4):
        phase = (t / pace + 0.27 * k + 0.01 * rng.standard_normal()) % 1.0
        low = body.uniform(25.0, 60.0)
        sos = signal.butter(2, [low, low * body.uniform(2.0, 5.0)], "bandpass", fs=rate, output="sos")
        noise = signal.sosfiltfilt(sos, rng.standard_normal(len(t)))
        burst = np.exp(-(((phase - 0.5) / 0.12) ** 2))
        columns.append(1e-6 * (body.uniform(60, 250) * burst * noise / noise.std() + 3.0 * rng.standard_normal(len(t))))
    return np.column_stack(columns)


def test_exchanged_channels_are_named_against_another_recording_of_the_electrodes():
    reference, own = walking(1), walking(2, pace=1.2)
    assert kinds(own, rate=1000.0, reference=reference) == []
    swapped = own[:, [0, 3, 2, 1]]
    assert kinds(swapped, rate=1000.0, reference=reference) == [(1, "exchanged"), (3, "exchanged")]
    assert kinds(swapped, rate=1000.0) == []


def test_another_movement_is_no_exchange():
    reference = walking(1)
    other = np.roll(walking(2), 300, axis=0)[:, :4] * np.array([0.1, 5.0, 0.2, 4.0])
    assert kinds(other[::-1], rate=1000.0, reference=reference) == []
    # Two channels fit each other's place; where the others fit no place of theirs, that is no evidence.
    swapped, unlike = walking(2)[:, [1, 0, 2, 3]], walking(2, session=8)
    assert kinds(swapped, rate=1000.0, reference=reference) == [(0, "exchanged"), (1, "exchanged")]
    assert kinds(np.hstack([swapped[:, :2], unlike[:, 2:]]), rate=1000.0, reference=reference) == []


def test_times_tell_lost_samples_and_another_rate():
    t, emg = clean(seed=3)
    kept = np.ones(len(t), bool)
    kept[5000:5600] = False
    assert kinds(emg[kept], time=t[kept]) == [("time", "clock")]
    assert kinds(emg, time=1.05 * t) == [("time", "clock")]
    assert kinds(emg, time=t) == []
    with pytest.raises(PellucidError, match="times of shape"):
        pl.emg_quality(emg, rate=2000.0, time=t[:5])


def test_short_bursts_of_a_muscle_are_no_artefact():
    """A burst that is short beside its pause has samples far above nearly all others, and several such ones."""
    rng = np.random.default_rng(8)
    t = np.arange(24000) / 2000.0
    size = 2.5e-4 * np.exp(-((((t % 3.0) - 1.5) / 0.012) ** 2)) + 3e-6
    assert kinds((size * rng.standard_normal(len(t)))[:, None]) == []
    sparse = 3e-6 * rng.standard_normal(len(t))
    for k, at in enumerate(rng.choice(len(t) - 100, 12, replace=False)):
        sparse[at : at + 12] += (1.0 + 0.07 * k) * 4e-5 * np.sin(np.arange(12) / 2.0)
    assert kinds(sparse[:, None]) == []
    # Potentials on either side of the threshold: the smaller ones show that the larger ones are the muscle's.
    apart = 3e-6 * rng.standard_normal(len(t))
    for k, at in enumerate(range(1000, len(t) - 100, 1900)):
        apart[at : at + 12] += (0.5 + 0.05 * k) * 4e-5 * np.sin(np.arange(12) / 2.0)
    assert kinds(apart[:, None]) == []


def test_a_maximum_that_a_converter_rounded_is_still_its_own():
    _, emg = clean(seed=6)
    sos = signal.butter(2, 6.0, fs=2000.0, output="sos")
    envelope = np.clip(signal.sosfiltfilt(sos, np.abs(emg), axis=0), 0.0, None)
    step = 2.2 / 65535
    stored = np.round(envelope / envelope.max(axis=0) / step) * step
    assert not (stored == 1.0).any()
    assert {kind for _, kind in kinds(stored, unit="1")} == {"normalised_per_trial"}


def walked_envelopes(rate=100.0, seconds=40.0):
    """Return relative envelopes of two muscles, (n, 2), which a zero-phase filter lets fall slightly below 0."""
    t = np.arange(round(rate * seconds)) / rate
    rng = np.random.default_rng(4)
    strides = [np.exp(-((((t + at) % 1.1 - 0.5) / 0.1) ** 2)) for at in (0.0, 0.4)]
    return 0.5 * np.column_stack(strides) + 2e-3 * rng.standard_normal((len(t), 2))


@pytest.mark.parametrize("unit", ["1", "%", ""])
def test_an_envelope_that_is_held_is_a_dropout_in_every_unit(unit):
    """Of relative envelopes a silent channel had no finding, and `check` called the recording sound."""
    emg = walked_envelopes()
    assert [kind for _, kind in kinds(emg, 100.0, unit=unit)] == []
    emg[500:1500, 1] = 0.0
    (one,) = [one for one in pl.emg_quality(emg, rate=100.0, unit=unit) if one.kind != "envelope"]
    assert (one.channel, one.kind, one.start, one.end, one.found) == (1, "dropout", 5.0, 15.0, "10000 ms held at 0")


def test_an_envelope_that_rests_again_and_again_is_no_dropout():
    t = np.arange(4000) / 100.0
    emg = np.maximum(np.sin(2.0 * np.pi * t / 5.0), 0.0) * 0.9
    assert kinds(emg, 100.0, unit="1") == []
    assert kinds(np.full(400, 0.4), 100.0, unit="1") == []


def test_a_share_of_the_power_is_at_most_the_whole():
    """A band-pass passed more than the high-pass with which it was compared: 106 % of the power."""
    t = np.arange(1500) / 100.0
    emg = 0.02 * np.exp(-(((t % 1.1 - 0.5) / 0.1) ** 2)) - 2e-3
    emg[500:] = 0.0
    shares = [float(one.found.split()[0]) for one in pl.emg_quality(emg, rate=100.0, unit="") if one.kind == "motion"]
    assert shares
    assert max(shares) <= 100.0
