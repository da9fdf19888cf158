"""The paired test over blocks: as often wrong as it says where nothing differs, sure where something does."""

import numpy as np
import pytest

from pellucid.numerics.block_test import (
    SIGNIFICANCE_LEVEL,
    compare_held_out,
    count_independent_samples,
    p_value_of_larger_loss,
)


def coloured(rng, n, memory):
    """A first-order autoregression of unit variance."""
    x = rng.standard_normal(n)
    for i in range(1, n):
        x[i] = memory * x[i - 1] + np.sqrt(1.0 - memory**2) * x[i]
    return x


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_models_that_are_alike_are_told_apart_as_rarely_as_stated(rng, memory):
    wrong = 0
    for _ in range(300):
        shared = [coloured(rng, 150, memory) for _ in range(3)]
        one, other = ([x + 0.3 * coloured(rng, 150, memory) for x in shared] for _ in range(2))
        wrong += p_value_of_larger_loss([a**2 for a in one], [b**2 for b in other])[0] < SIGNIFICANCE_LEVEL
    assert wrong / 300 < SIGNIFICANCE_LEVEL + 3.0 * np.sqrt(SIGNIFICANCE_LEVEL * (1.0 - SIGNIFICANCE_LEVEL) / 300)


def test_a_model_that_misses_more_is_found_worse(rng):
    shared = [coloured(rng, 400, 0.8) for _ in range(3)]
    found = compare_held_out({"good": shared, "bad": [x + 0.7 * coloured(rng, 400, 0.8) for x in shared]})
    assert found.winner == "good"
    assert found.worse("bad")
    assert not found.worse("good")
    assert found.first(["bad", "good"]) == "good"


def test_four_blocks_prove_nothing_and_five_of_one_sign_do():
    loss = [np.full(2, 2.0)] * 4
    assert p_value_of_larger_loss(loss, [np.full(2, 1.0)] * 4) == (1.0 / 16.0, 4)
    assert p_value_of_larger_loss([*loss, loss[0]], [np.full(2, 1.0)] * 5) == (1.0 / 32.0, 5)


def test_what_differs_by_rounding_alone_is_alike(rng):
    x = rng.standard_normal(500)
    found = compare_held_out({"one": [x], "other": [x * (1.0 + 1e-12)]})
    assert not found.worse("one")
    assert not found.worse("other")


def test_coloured_residuals_are_fewer_samples(rng):
    white = count_independent_samples([rng.standard_normal(2000)])
    assert white == pytest.approx(2000, rel=0.2)
    # A first-order autoregression of 0.9 remembers (1 + 0.9) / (1 - 0.9) = 19 samples.
    assert count_independent_samples([coloured(rng, 20000, 0.9)]) == pytest.approx(20000 / 19, rel=0.2)
