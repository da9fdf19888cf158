"""Laws of transfer-function identification: any stable system comes back, and intervals hold the truth as they say."""

import numpy as np
import pytest

from pellucid.orthosis.input_output import InputOutput
from pellucid.orthosis.transfer.fit_transfer_function import evaluate_transfer_function, fit_records
from pellucid.orthosis.transfer_function import TransferFunction


def random_system(rng: np.random.Generator) -> tuple[TransferFunction, int, int]:
    """One to four stable poles between 0.5 and 12 rad/s, and up to two zeros."""
    poles = int(rng.integers(1, 5))
    zeros = int(rng.integers(0, min(poles, 3)))
    found: list[complex] = []
    while len(found) < poles:
        rate, damping = rng.uniform(0.5, 12.0), rng.uniform(0.15, 1.0)
        pole = rate * complex(-damping, np.sqrt(1.0 - damping**2))
        found += [pole, pole.conjugate()] if poles - len(found) >= 2 else [complex(-rate)]
    denominator = np.poly(found).real
    numerator = np.poly(-rng.uniform(0.5, 10.0, zeros)) if zeros else np.ones(1)
    gain = denominator[-1] / numerator[-1]
    return TransferFunction(gain * numerator, denominator), poles, zeros


def uneven_record(
    rng: np.random.Generator,
    system: TransferFunction,
    hold: str,
    *,
    n: int = 1500,
    noise: float = 0.01,
    memory: float = 0.0,
) -> InputOutput:
    """About 30 Hz with jitter, on a clock of 5 ms, and an initial state; noise is white, or remembers."""
    time = 0.005 * np.cumsum(rng.integers(4, 10, n))
    u = np.repeat(rng.normal(size=n // 15), 15)
    clean = system.simulate(time, u, hold=hold, initial=rng.normal(size=system.order))
    white = rng.normal(size=n)
    coloured = np.empty(n)
    last = 0.0
    for k in range(n):
        last = coloured[k] = memory * last + np.sqrt(1.0 - memory**2) * white[k]
    return InputOutput("r", "fitted", time, u, clean + noise * clean.std() * coloured)


@pytest.mark.parametrize("seed", range(20))
def test_random_stable_systems_come_back(seed):
    rng = np.random.default_rng(seed)
    system, poles, zeros = random_system(rng)
    hold = ("zero", "first")[seed % 2]
    found = fit_records([uneven_record(rng, system, hold)], poles, zeros, hold=hold)
    assert found.responses[0].fit > 98.0
    assert found.transfer_function.stable
    # Coefficients trade off against each other; the response over what was excited does not.
    frequency = np.geomspace(0.05, 2.0, 30)
    expected = system.frequency_response(frequency)
    off = np.abs(found.transfer_function.frequency_response(frequency) - expected)
    assert off.max() < 0.05 * np.abs(expected).max()


@pytest.mark.parametrize("seed", range(6))
def test_without_noise_coefficients_are_found_to_the_last_digits(seed):
    rng = np.random.default_rng(100 + seed)
    system, poles, zeros = random_system(rng)
    found = fit_records([uneven_record(rng, system, "first", noise=0.0)], poles, zeros, hold="first")
    values = [p.value for p in found.parameters]
    assert values == pytest.approx([*system.denominator[1:], *system.numerator], rel=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("memory", [pytest.param(0.0, marks=pytest.mark.nightly), 0.8])
def test_intervals_hold_the_truth_as_often_as_they_say(memory):
    """Of 120 seeds by 3 coefficients, each interval should hold the truth in 114 of 120 on average (SD 2.4)."""
    system = TransferFunction([20.0], [1.0, 2.0, 25.0])
    truth = np.array([2.0, 25.0, 20.0])
    held = np.zeros(3)
    seeds = 120
    for seed in range(seeds):
        rng = np.random.default_rng(1000 + seed)
        record = uneven_record(rng, system, "zero", n=900, noise=0.1, memory=memory)
        found = fit_records([record], 2, hold="zero")
        for i, p in enumerate(found.parameters):
            low, high = p.interval()
            held[i] += low <= truth[i] <= high
    # Four standard deviations of the count: 104 to 120.
    assert np.all(held >= 104), held.tolist()
    assert np.mean(held) / seeds > 0.9


def test_held_out_fits_are_no_better_than_the_noise_allows():
    system = TransferFunction([20.0], [1.0, 2.0, 25.0])
    inside, outside = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        whole = uneven_record(rng, system, "zero", noise=0.2)
        found = fit_records([whole.part(0, 750, "fitted")], 2, hold="zero")
        inside.append(found.responses[0].fit)
        outside.append(
            evaluate_transfer_function(found.transfer_function, whole.part(750, 1500, "heldout"), hold="zero").fit
        )
    # Noise of a fifth of the response leaves about 80 % at best, fitted or not.
    assert np.mean(inside) == pytest.approx(80.4, abs=1.5)
    assert np.mean(outside) == pytest.approx(80.0, abs=2.0)
