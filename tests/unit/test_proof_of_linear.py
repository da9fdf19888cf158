"""The proof that noise and distortion are told apart, in small, and that it could fail."""

from dataclasses import replace

import numpy as np
from research.evidence.linear import judged, truth, wiener_hammerstein, worst_median


def test_a_small_proof_has_ratios_near_one_and_its_rival_does_not():
    system = wiener_hammerstein()
    noise, distortion = truth(system, 60)
    found = np.array([judged(system, seed, noise, distortion) for seed in (1, 2, 3)])
    assert 0.8 < worst_median(found[:, 0]) < 1.25
    assert 1 / 1.5 < worst_median(found[:, 1]) < 1.5
    assert worst_median(found[:, 2]) > 1.8
    # Told a truth that is none, it says so.
    assert worst_median(np.array([judged(system, 1, 3.0 * noise, distortion)[0]])) < 0.5


def test_truth_without_a_curve_is_noise_alone():
    system = wiener_hammerstein()

    def straight(reference, repetitions, noisy, rng):
        u, y = system.play(reference, repetitions, noisy, rng)
        return u, u + y - system.play(reference, repetitions, False, rng)[1]

    _, distortion = truth(replace(system, play=straight), 20)
    noise, _ = truth(system, 20)
    assert distortion.max() < 1e-20 * noise.min()
