"""The papers' chains: gains, delays, streaming, and what they refuse."""

import numpy as np
import pytest
from made_emg import FS, raw_emg
from scipy import signal

from pellucid._errors import RecordingError
from pellucid.emg.signals.emg_chain import EMG_CHAINS, FILTER_STAGES, EmgChain, Stage, emg_chain, group_delay


def bursts(seconds: float = 4.0, seed: int = 3) -> tuple[np.ndarray, np.ndarray]:
    t = np.arange(int(seconds * FS)) / FS
    amplitude = 1e-4 * (0.05 + np.sin(np.pi * t) ** 2)
    return amplitude, raw_emg(amplitude, np.random.default_rng(seed))


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("able", ["bandpass", "centre", "rectify", "normalise", "advance"]),
        ("knee", ["bandpass", "rectify", "lowpass"]),
        ("hill", ["notch", "highpass", "rectify", "lowpass", "normalise"]),
    ],
)
def test_chains_have_the_published_stages(name, kinds):
    assert [stage.kind for stage in emg_chain(name).stages] == kinds


@pytest.mark.parametrize("name", EMG_CHAINS)
def test_every_filter_has_its_gain_at_its_edges(name):
    for stage in EMG_CHAINS[name].stages:
        if stage.kind in FILTER_STAGES:
            _, h = signal.freqz_sos(stage.sections(FS), np.array(stage.cutoff), fs=FS)
            expected = 0.0 if stage.kind == "notch" else np.sqrt(0.5)
            assert np.abs(h) == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(("order", "late"), [(1, 0.080), (2, 0.113), (4, 0.208)])
def test_a_causal_2_hz_lowpass_removes_the_lead_of_emg(order, late):
    """The thesis's low-pass is later than force follows EMG (10 to 100 ms), or nearly."""
    delay = emg_chain("knee").with_lowpass(order=order).delay(FS)
    assert delay.envelope == pytest.approx(late, abs=5e-4)
    assert delay.filters == delay.carrier + delay.envelope


@pytest.mark.parametrize("frequency", [0.0, 1.0, 60.0, 300.0])
@pytest.mark.parametrize("name", ["knee", "hill"])
def test_group_delay_is_scipys(name, frequency):
    sos = EMG_CHAINS[name].stages[-2 if name == "hill" else -1].sections(FS)
    _, expected = signal.group_delay(signal.sos2tf(sos), w=[frequency], fs=FS)
    assert group_delay(sos, frequency, FS) == pytest.approx(expected[0] / FS, abs=2e-6)


def aligning_lag(chain: EmgChain, seconds: float) -> float:
    """The lag [s] at which a causal envelope follows the slow amplitude of the noise that stands for EMG best."""
    rng, n = np.random.default_rng(0), int(seconds * FS)
    slow = signal.sosfiltfilt(signal.butter(2, 1.0, fs=FS, output="sos"), rng.standard_normal(n))
    amplitude = np.exp(slow / slow.std())
    envelope = chain.causal(amplitude * rng.standard_normal(n), FS, maximum=1.0)
    a, e = amplitude - amplitude.mean(), envelope - envelope.mean()
    likeness = signal.correlate(e, a, method="fft")[n - 1 : n - 1 + int(FS)]
    return int(np.argmax(likeness)) / FS


@pytest.mark.parametrize("name", ["knee", "hill"])
def test_the_aligning_lag_is_near_the_delay(name):
    """A low-pass delays what it still passes somewhat less or more than at DC."""
    delay = EMG_CHAINS[name].delay(FS).filters
    assert aligning_lag(EMG_CHAINS[name], 60.0) == pytest.approx(delay, rel=0.3)


def test_an_advance_is_the_lag_it_says():
    assert aligning_lag(emg_chain("able"), 30.0) == pytest.approx(0.1, abs=0.004)


@pytest.mark.parametrize("name", EMG_CHAINS)
def test_a_stream_equals_the_array(name):
    _, raw = bursts()
    whole = EMG_CHAINS[name].causal(raw, FS, maximum=2e-4)
    stream = EMG_CHAINS[name].stream(FS, maximum=2e-4)
    cuts = np.array([5, 5, 9, 1000, 4096])
    parts = [stream.filter(part) for part in np.split(raw[:-50], cuts)]
    last = [stream.step(x) for x in raw[-50:]]
    assert np.concatenate([*parts, last]) == pytest.approx(whole, abs=1e-12 * np.abs(whole).max())
    stream.reset()
    assert stream.filter(raw[:100]) == pytest.approx(whole[:100], abs=1e-12 * np.abs(whole).max())


@pytest.mark.parametrize("name", ["knee", "hill"])
def test_without_delay_the_envelope_lies_on_the_amplitude(name):
    amplitude, raw = bursts(8.0)
    envelope = EMG_CHAINS[name].zero_phase(raw, FS)
    a, e = amplitude - amplitude.mean(), envelope - envelope.mean()
    lag = np.argmax(signal.correlate(e, a, method="fft")) - (len(a) - 1)
    assert abs(lag) / FS < 0.02
    assert np.corrcoef(a, e)[0, 1] > 0.97


def test_relative_to_its_own_largest_value():
    _, raw = bursts()
    assert emg_chain("hill").zero_phase(raw, FS).max() == 1.0
    assert emg_chain("hill").zero_phase(raw, FS, maximum=1.0).max() < 1e-3


def test_order_4_at_a_thousandth_of_the_rate_stays_exact():
    chain = EmgChain("slow", (Stage("lowpass", (2.0,), order=4),))
    assert chain.causal(np.ones(8 * 2048), FS)[-1] == pytest.approx(1.0, abs=1e-9)


def test_a_rate_the_cutoffs_do_not_fit_is_refused():
    with pytest.raises(RecordingError, match=r"found a rate of 1000 Hz, expected more than 1000 Hz.*knee"):
        emg_chain("knee").causal(np.zeros(1000), 1000.0)
    with pytest.raises(RecordingError, match="found a rate of 500 Hz"):
        emg_chain("able").stream(500.0, maximum=1.0)


def test_missing_and_too_few_samples_are_refused():
    x = np.ones(500)
    x[123] = np.nan
    with pytest.raises(RecordingError, match=r"1 missing samples .* index 123"):
        emg_chain("knee").zero_phase(x, FS)
    with pytest.raises(RecordingError, match=r"found 10 samples, expected more than"):
        emg_chain("knee").zero_phase(np.ones(10), FS)
    with pytest.raises(RecordingError, match="expected \\(n,\\)"):
        emg_chain("knee").causal(np.ones((5, 2)), FS)


def test_a_causal_chain_needs_to_know_the_maximum():
    with pytest.raises(RecordingError, match="found no maximum"):
        emg_chain("hill").causal(np.ones(100), FS)
    with pytest.raises(RecordingError, match="found the maximum 0"):
        emg_chain("hill").causal(np.ones(100), FS, maximum=0.0)
    with pytest.raises(RecordingError, match="no sample above 0"):
        emg_chain("hill").zero_phase(np.zeros(1000), FS)


def test_an_impossible_chain_is_refused():
    with pytest.raises(RecordingError, match="'average'"):
        Stage("average")
    with pytest.raises(RecordingError, match="expected 2, above 0, rising"):
        Stage("bandpass", (500.0, 10.0))
    with pytest.raises(RecordingError, match="expected at least 0 and 1"):
        Stage("lowpass", (5.0,), order=0)
    with pytest.raises(RecordingError, match="found no low-pass"):
        emg_chain("able").with_lowpass(order=4)
    with pytest.raises(RecordingError, match="expected one of able, knee, hill"):
        emg_chain("elbow")


def broken_effort(seconds: float, seed: int = 5) -> np.ndarray:
    """EMG of a muscle that is switched on and off, at intervals that never repeat, with some mains in it [V]."""
    t = np.arange(int(seconds * FS)) / FS
    on = (t * 0.9 + 0.25 * np.sin(0.7 * t)) % 1.0 < 0.4
    return raw_emg(1e-4 * (0.02 + on), np.random.default_rng(seed)) + 1e-5 * np.sin(2.0 * np.pi * 50.0 * t)


@pytest.mark.parametrize("name", EMG_CHAINS)
def test_an_envelope_is_never_negative(name):
    raw, chain = broken_effort(8.0), EMG_CHAINS[name]
    for x in (raw, raw[3000:7000], raw[: 40 + round(0.1 * FS)]):
        assert chain.zero_phase(x, FS, maximum=1.0).min() >= 0.0
        assert chain.causal(x, FS, maximum=1.0).min() >= 0.0
        assert chain.stream(FS, maximum=1.0).filter(x).min() >= 0.0


@pytest.mark.parametrize("name", EMG_CHAINS)
@pytest.mark.parametrize("causal", [False, True])
def test_a_part_is_filtered_with_what_lies_around_it(name, causal):
    raw, chain = broken_effort(12.0), EMG_CHAINS[name]
    run = chain.causal if causal else chain.zero_phase
    whole = run(raw, FS, maximum=1.0)
    for start, stop in ((9000, 13000), (0, 3000), (len(raw) - 3000, len(raw)), (7000, 7400)):
        part = run(raw, FS, maximum=1.0, inside=slice(start, stop))
        assert part.shape == (stop - start,)
        # The mean that "able" takes off is that of the part and its surroundings.
        assert np.max(np.abs(part - whole[start:stop])) < (3e-3 if name == "able" else 1e-4) * whole.max()


def test_what_lies_beyond_a_missing_sample_is_not_seen_by_a_part():
    raw, chain = broken_effort(8.0), emg_chain("hill")
    holed = raw.copy()
    holed[[5900, 12100]] = np.nan
    part = chain.zero_phase(holed, FS, maximum=1.0, inside=slice(6000, 12000))
    alone = chain.zero_phase(raw[5901:12100], FS, maximum=1.0)[99:-100]
    np.testing.assert_array_equal(part, alone)
    with pytest.raises(RecordingError, match="1 missing samples"):
        chain.zero_phase(holed, FS, inside=slice(5000, 8000))
    assert chain.zero_phase(raw, FS, inside=slice(6000, 12000)).max() == 1.0


@pytest.mark.parametrize("name", EMG_CHAINS)
def test_several_muscles_are_filtered_as_one(name):
    raw, chain, inside = broken_effort(8.0), EMG_CHAINS[name], slice(6000, 12000)
    holed = raw[::-1].copy()
    holed[5900] = np.nan
    muscles = {"emg.biceps": raw, "emg.triceps": holed, "emg.brachialis": np.roll(raw, 500)}
    made = chain.zero_phase_each(muscles, FS, inside)
    assert [*made] == [*muscles]
    for muscle, x in muscles.items():
        alone = chain.zero_phase(x, FS, inside=inside)
        np.testing.assert_allclose(made[muscle], alone, rtol=0.0, atol=1e-12 * alone.max())
    with pytest.raises(RecordingError, match=r"emg.triceps: .* found 1 missing samples"):
        chain.zero_phase_each(muscles, FS, slice(5000, 8000))


@pytest.mark.parametrize("name", ["knee", "hill"])
def test_where_a_file_ends_envelopes_err_by_little(name):
    """Files of two seconds against the same seconds of a recording that goes on."""
    chain, length, shown = EMG_CHAINS[name], round(2.0 * FS), round(0.25 * FS)
    t = np.arange(int(60.0 * FS)) / FS
    effort = 0.05 + np.clip(np.sin(5.0 * t) + 0.3 * np.sin(10.7 * t + 1.0), 0.0, None)
    raw = raw_emg(1e-4 * effort, np.random.default_rng(2))
    whole = chain.zero_phase(raw, FS, maximum=1.0)
    typical, worst = [], []
    for start in np.random.default_rng(3).integers(int(FS), len(raw) - 2 * length, 24):
        own = slice(start, start + length)
        error = np.abs(chain.zero_phase(raw[own], FS, maximum=1.0) - whole[own]) / whole.max()
        for end in (error[:shown], error[-shown:]):
            typical.append(np.median(end))
            worst.append(np.max(end))
    assert np.median(typical) < 0.02
    assert np.median(worst) < 0.08


def test_padding_follows_from_how_long_a_filter_rings():
    for name, seconds in (("hill", 2.7), ("knee", 1.2)):
        assert EMG_CHAINS[name].settling(FS) / FS == pytest.approx(seconds, rel=0.15)
    for stage in EMG_CHAINS["hill"].stages:
        if stage.kind in FILTER_STAGES:
            impulse = signal.sosfilt(stage.sections(FS), np.eye(1, 40 * stage.settling(FS))[0])
            left = np.sqrt(np.sum(impulse[2 * stage.settling(FS) :] ** 2) / np.sum(impulse**2))
            assert left < 1e-4


@pytest.mark.parametrize("name", ["able", "knee", "hill"])
def test_every_chain_takes_band_notch_lowpass_and_window(name):
    made = emg_chain(name, 60.0, band=(25.0, 300.0), lowpass=4.0)
    cutoffs = {stage.kind: stage.cutoff for stage in made.stages if stage.cutoff}
    assert cutoffs == {"notch": (60.0,), "bandpass": (25.0, 300.0), "lowpass": (4.0,)}
    assert "rms" in [stage.kind for stage in emg_chain(name, rms_window=0.1).stages]
    assert emg_chain(name) == EMG_CHAINS[name]
    with pytest.raises(RecordingError, match="found both lowpass and rms_window"):
        emg_chain(name, lowpass=4.0, rms_window=0.1)


def test_a_window_gives_the_amplitude_s_root_mean_square_and_is_late_by_half_of_it():
    time = np.arange(0.0, 4.0, 1.0 / FS)
    raw = np.where(time >= 2.0, np.sqrt(2.0), 0.0) * np.sin(2.0 * np.pi * 100.0 * time)
    chain = emg_chain("knee", rms_window=0.2)
    steady, causal = chain.zero_phase(raw, FS), chain.causal(raw, FS)
    assert steady[round(3.0 * FS)] == pytest.approx(1.0, rel=0.02)
    assert causal[round(3.0 * FS)] == pytest.approx(1.0, rel=0.02)
    apart = time[np.searchsorted(causal, 0.7)] - time[np.searchsorted(steady, 0.7)]
    assert apart == pytest.approx(0.1, abs=0.01)
    assert chain.delay(FS).filters == pytest.approx(0.1 + emg_chain("knee").delay(FS).carrier, abs=0.01)


def test_a_window_sample_by_sample_is_the_causal_chain():
    raw = np.random.default_rng(3).standard_normal(3000)
    chain = emg_chain("hill", 60.0, band=(20.0, 200.0), rms_window=0.05)
    stream = chain.stream(FS, maximum=2.0)
    parts = [stream.filter(part) for part in np.array_split(raw, 17)]
    np.testing.assert_allclose(np.concatenate(parts), chain.causal(raw, FS, maximum=2.0), atol=1e-9)
