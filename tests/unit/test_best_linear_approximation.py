"""Noise and non-linear distortion apart: what must hold exactly, and tests of the size that they state."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pellucid._errors import IdentificationError, PellucidError
from pellucid.numerics.protocols.excitation import random_phase_multisine
from pellucid.orthosis.transfer.best_linear_approximation import (
    best_linear_approximation,
    excited_lines,
    local_response,
)

RATE = 200.0
B, A = [0.05, 0.1], [1.0, -1.6, 0.75]


def true_response(frequency: np.ndarray) -> np.ndarray:
    z = np.exp(-2j * np.pi * frequency / RATE)
    return np.polyval(B[::-1], z) / np.polyval(A[::-1], z)


def motion(seed: int, **options):
    said = {"low": 0.5, "high": 20.0, "resolution": 0.5, "rms": 1.0, "realisations": 4, "periods": 3, "settle": 0}
    return random_phase_multisine(RATE, seed=seed, **said | options)


def played(made) -> np.ndarray:
    return np.array([made.reference(i) for i in range(made.realisations)])


def coloured(rng: np.random.Generator, shape) -> np.ndarray:
    return 0.2 * lfilter([1.0], [1.0, -0.9], rng.standard_normal(shape), axis=1)


# --- the motion -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("lines", ["full", "odd", "odd_random"])
def test_a_multisine_has_its_lines_its_rms_and_nothing_else(lines):
    made = motion(3, lines=lines, high=40.0)
    spectra = np.fft.rfft([made.one_period(i) for i in range(4)]) / made.samples
    every = np.arange(1, 81)
    wanted = every if lines == "full" else every[every % 2 == 1]
    assert set(made.lines) <= set(wanted)
    assert len(made.lines) == {"full": 80, "odd": 40, "odd_random": 30}[lines]
    assert np.allclose(np.abs(spectra[:, made.lines]), np.abs(spectra[0, made.lines[0]]))
    others = np.setdiff1d(np.arange(spectra.shape[1]), made.lines)
    assert np.abs(spectra[:, others]).max() < 1e-15
    assert np.std([made.one_period(i) for i in range(4)], axis=1) == pytest.approx(1.0)
    if lines == "odd_random":
        # One of each four odd lines, and every even one.
        assert [int(np.isin(wanted[i : i + 4], made.left_out).sum()) for i in range(0, 40, 4)] == [1] * 10


def test_a_peak_lowers_all_realisations_alike_and_holds_between_samples():
    free, held = motion(5), motion(5, peak=1.5)
    assert free.peak > 1.5
    assert held.peak == pytest.approx(1.5)
    assert np.allclose(held.amplitude / free.amplitude, 1.5 / free.peak)
    assert np.abs(played(held)).max() <= 1.5


def test_it_is_eased_in_and_periodic_from_then_on():
    made = motion(1, settle=1, fall=1.0)
    wave = made.reference(2, centre=0.4)
    assert len(wave) == 4 * made.samples
    assert wave[0] == 0.4
    assert np.abs(np.diff(wave[:3])).max() < 1e-4
    last = wave[made.samples :].reshape(3, -1)
    assert np.array_equal(last[0], last[1])
    assert np.allclose(last[0], 0.4 + made.one_period(2))
    assert made.amplitude[-1] / made.amplitude[0] == pytest.approx(made.lines[0] / made.lines[-1])
    assert np.array_equal(wave, motion(1, settle=1, fall=1.0).reference(2, centre=0.4))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"high": 100.0}, "expected it below half"),
        ({"lines": "some"}, "expected one of full, odd, odd_random"),
        ({"periods": 1}, "noise shows from period to period"),
        ({"rms": 0.0}, "found rms 0.0"),
        ({"low": 10.1, "high": 10.4}, "found 0 lines"),
    ],
)
def test_what_is_no_multisine_is_refused(change, said):
    with pytest.raises(PellucidError, match=said):
        motion(1, **change)


# --- the approximation ----------------------------------------------------------------------------------------------


def test_a_linear_system_without_noise_is_found_to_rounding_once_it_has_settled():
    made = motion(2, settle=2)
    u = played(made)
    y = lfilter(B, A, u, axis=1)
    found = best_linear_approximation(u[:, 400:], y[:, 400:], RATE, samples=made.samples)
    assert np.array_equal(found.line, made.lines)
    assert found.response == pytest.approx(true_response(found.frequency), rel=1e-9)
    assert found.highest_fit > 99.999
    # The transient at once, instead of two periods later: what is left of it is what a parabola is not.
    early = best_linear_approximation(u[:, 400:], lfilter(B, A, u[:, 400:], axis=1), RATE, samples=made.samples)
    assert np.abs(early.response / true_response(early.frequency) - 1.0).max() < 2e-4
    assert np.median(np.abs(early.response / true_response(early.frequency) - 1.0)) < 1e-5


def linear_with_noise(seed: int, realisations: int = 4):
    made = motion(seed, realisations=realisations)
    u = played(made)
    y = lfilter(B, A, u, axis=1) + coloured(np.random.default_rng([9, seed]), u.shape)
    return u, best_linear_approximation(u, y, RATE, samples=made.samples)


def test_noise_is_not_taken_for_distortion_more_often_than_the_test_says_and_disks_hold():
    found = [linear_with_noise(seed)[1] for seed in range(200)]
    p = np.array([f.p_value for f in found])
    # 200 draws: the binomial's 0.1 and 99.9 % points of 5 % and of 50 %.
    assert 0.01 <= np.mean(p < 0.05) <= 0.105
    assert 0.39 <= np.mean(p < 0.5) <= 0.61
    held = np.mean([np.abs(f.response - true_response(f.frequency)) < f.radius(0.95) for f in found])
    assert held == pytest.approx(0.95, abs=0.01)
    frequency = found[0].frequency
    true = 0.04 / np.abs(1.0 - 0.9 * np.exp(-2j * np.pi * frequency / RATE)) ** 2 / 400.0
    every = np.array([np.interp(frequency, f.frequency, f.noise_variance) for f in found])
    level = np.mean(every, axis=0) / true
    # The lowest line has its bins above it alone, where this noise is weaker already.
    assert level[1:] == pytest.approx(1.0, abs=0.06)
    assert level[0] == pytest.approx(0.85, abs=0.1)
    assert np.mean(every / true) == pytest.approx(1.0, abs=0.03)
    # Signed, the distortion that is none is none on average.
    every = np.array([np.interp(frequency, f.frequency, f.nonlinear_variance) for f in found])
    assert np.abs(np.mean(every / true)) < 0.03


def test_one_realisation_tells_distortion_by_the_lines_left_out():
    p = [linear_with_noise(seed, 1)[1].p_value for seed in range(100)]
    assert np.mean(np.array(p) < 0.05) <= 0.13
    made = motion(4, realisations=1, high=60.0, resolution=0.25)
    u = played(made)
    y = u + 0.1 * u**3 + 0.002 * np.random.default_rng(4).standard_normal(u.shape)
    found = best_linear_approximation(u, y, RATE, samples=made.samples)
    assert found.p_value < 1e-6
    assert found.even_share < 0.02
    assert found.nonlinear_to_noise > 10.0
    many = motion(4, realisations=60, high=60.0, resolution=0.25)
    u = played(many)
    truth = best_linear_approximation(u, u + 0.1 * u**3, RATE, samples=many.samples)
    assert 0.5 < np.mean(found.nonlinear_variance) / np.mean(truth.nonlinear_variance) < 2.0


def test_the_gain_of_a_cubic_is_that_of_a_gaussian_input():
    """Bussgang: of x + 0.1 x^3 under a Gaussian x of variance 1 it is 1 + 0.3, of x^2 nothing is linear."""
    made = motion(1, high=50.0, resolution=0.25, realisations=40, periods=2)
    u = played(made)
    y = u + 0.1 * u**3 + 0.05 * u**2
    found = best_linear_approximation(
        u, y + 1e-6 * np.random.default_rng(1).standard_normal(u.shape), RATE, samples=made.samples
    )
    lines = len(made.lines)
    # Of so many sines it is smaller by half a line's share: a sine does not mix with itself as with others.
    assert np.mean(found.response) == pytest.approx(1.3 - 0.15 / lines, abs=0.006)
    assert found.p_value < 1e-12
    even = 100.0 * (1.0 - np.sqrt(1.0 - np.var(found_linear(found, u)) / np.var(y)))
    assert found.highest_fit == pytest.approx(even, abs=1.0)
    assert found.highest_fit_noise > 99.99


def found_linear(found, u: np.ndarray) -> np.ndarray:
    return np.mean(found.response.real) * u


def test_feedback_of_noise_biases_the_direct_estimate_and_not_the_one_through_the_reference():
    made = motion(6, realisations=8, periods=4, high=40.0)
    r = played(made)
    rng = np.random.default_rng(8)
    u, y = np.zeros_like(r), np.zeros_like(r)
    noise = 0.8 * rng.standard_normal(r.shape)
    state = np.zeros((2, len(r)))
    plant = np.zeros(len(r))
    for k in range(r.shape[1]):
        y[:, k] = plant + noise[:, k]
        u[:, k] = 2.0 * (r[:, k] - y[:, k])
        state = np.stack([u[:, k], state[0]])
        plant = 0.8 * plant + 0.2 * state[0]
    z = np.exp(-2j * np.pi * made.frequency / RATE)
    true = 0.2 * z / (1.0 - 0.8 * z)
    indirect = best_linear_approximation(u, y, RATE, samples=made.samples, references=r)
    assert indirect.closed_loop
    assert np.mean(np.abs(indirect.response - true) < indirect.radius(0.95)) > 0.85
    assert indirect.p_value > 0.01
    # What is seen at the output is the noise itself, not what the loop makes of it.
    assert np.mean(indirect.noise_variance) == pytest.approx(0.64 / made.samples, rel=0.1)
    # Without periods: any excitation, here white.
    with pytest.raises(IdentificationError, match="state the reference"):
        best_linear_approximation(u, y, RATE, samples=made.samples)


def test_lines_are_told_from_what_is_between_them_or_refused():
    spectrum = np.array([5.0, 1.0, 1e-3, 0.9, 1e-4, 0.5, 2e-4])
    assert excited_lines(spectrum).tolist() == [1, 3, 5]
    with pytest.raises(IdentificationError, match="state the reference"):
        excited_lines(np.r_[0.0, np.geomspace(1.0, 0.3, 20)])


def test_what_is_not_periodic_is_refused():
    x = np.random.default_rng(1).standard_normal((2, 300))
    with pytest.raises(IdentificationError, match=r"found 1\.5 periods of 200 samples"):
        best_linear_approximation(x, x, RATE, samples=200)


# --- any recording --------------------------------------------------------------------------------------------------


def test_any_excitation_gives_the_response_and_one_level_for_noise_and_distortion():
    rng = np.random.default_rng(11)
    u = lfilter([1.0], [1.0, -0.5], rng.standard_normal(20_000))
    noise = 0.3 * rng.standard_normal(len(u))
    found = local_response(u, lfilter(B, A, u) + noise, RATE)
    true = true_response(found.frequency)
    # Neighbouring bins share samples: the share that is held varies more than a binomial's.
    assert 0.88 < np.mean(np.abs(found.response - true) < found.radius(0.95)) <= 1.0
    assert np.mean(found.missed_power) == pytest.approx(0.09 / len(u), rel=0.1)
    bent = lfilter(B, A, u)
    bent = bent + 0.05 * bent**3
    distorted = local_response(u, bent, RATE)
    assert distorted.fit < 95.0
    with pytest.raises(IdentificationError, match="expected complete signals that change"):
        local_response(np.ones(1000), np.ones(1000), RATE)


def test_no_model_holds_better_than_is_said_and_a_good_one_nearly_as_well():
    """A linear path with a cubic beside it: the best gain at every line against what is said to be left."""
    made = motion(2, high=40.0, realisations=12, resolution=0.25, settle=1)
    u = played(made)
    linear = lfilter(B, A, u, axis=1)
    y = linear + 0.02 * linear**3 + 0.05 * np.random.default_rng(2).standard_normal(u.shape)
    u, y = u[:, made.samples :], y[:, made.samples :]
    found = best_linear_approximation(u, y, RATE, samples=made.samples)
    best = lfilter(B, A, played(made), axis=1)[:, made.samples :]
    gain = np.sum(best * y) / np.sum(best * best)
    reached = 100.0 * (1.0 - np.sqrt(np.mean((y - gain * best) ** 2) / np.mean(y**2)))
    # The cubic's own linear part has a response of another shape: one gain holds a little less than the best.
    assert reached - 0.3 < found.highest_fit < reached + 4.0
    assert found.highest_fit < found.highest_fit_limit < found.highest_fit + 3.0
    alone = 100.0 * (1.0 - 0.05 / np.sqrt(np.mean(y**2)))
    assert found.highest_fit_noise == pytest.approx(alone, abs=0.5)
