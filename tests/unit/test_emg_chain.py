"""The papers' chains: gains, delays, streaming, and what they refuse."""

import numpy as np
import pytest
from made_emg import FS, raw_emg
from scipy import signal

from pellucid._errors import RecordingError
from pellucid.signals.emg_chain import CHAINS, FILTERS, EmgChain, Stage, emg_chain
from pellucid.signals.envelope_delay import group_delay


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


@pytest.mark.parametrize("name", CHAINS)
def test_every_filter_has_its_gain_at_its_edges(name):
    for stage in CHAINS[name].stages:
        if stage.kind in FILTERS:
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
    sos = CHAINS[name].stages[-2 if name == "hill" else -1].sections(FS)
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
    delay = CHAINS[name].delay(FS).filters
    assert aligning_lag(CHAINS[name], 60.0) == pytest.approx(delay, rel=0.3)


def test_an_advance_is_the_lag_it_says():
    assert aligning_lag(emg_chain("able"), 30.0) == pytest.approx(0.1, abs=0.004)


@pytest.mark.parametrize("name", CHAINS)
def test_a_stream_equals_the_array(name):
    _, raw = bursts()
    whole = CHAINS[name].causal(raw, FS, maximum=2e-4)
    stream = CHAINS[name].stream(FS, maximum=2e-4)
    cuts = np.array([5, 5, 9, 1000, 4096])
    parts = [stream.filter(part) for part in np.split(raw[:-50], cuts)]
    last = [stream.step(x) for x in raw[-50:]]
    assert np.concatenate([*parts, last]) == pytest.approx(whole, abs=1e-12 * np.abs(whole).max())
    stream.reset()
    assert stream.filter(raw[:100]) == pytest.approx(whole[:100], abs=1e-12 * np.abs(whole).max())


@pytest.mark.parametrize("name", ["knee", "hill"])
def test_without_delay_the_envelope_lies_on_the_amplitude(name):
    amplitude, raw = bursts(8.0)
    envelope = CHAINS[name].zero_phase(raw, FS)
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
