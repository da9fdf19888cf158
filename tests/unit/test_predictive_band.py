"""A predictive band holds what had no part in it, and says where it does not."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import lfilter

from pellucid.joint.fit.replay import conformal_half_width, make_predictive_band


def prediction(rng, name, split="fitted", sd=1.0, n=1500, fast=1.0):
    velocity = rng.uniform(-1.0, 1.0, n)
    noise = lfilter([1.0], [1.0, -0.6], rng.standard_normal(n)) * sd * np.where(np.abs(velocity) > 2 / 3, fast, 1.0)
    return SimpleNamespace(
        recording=name, split=split, velocity=velocity, position=rng.uniform(0.0, 1.0, n), effort=noise, residual=noise
    )


def test_a_band_holds_recordings_it_has_not_seen():
    rng = np.random.default_rng(1)
    held = []
    for _ in range(40):
        seen = [prediction(rng, str(i), n=300) for i in range(3)]
        band = make_predictive_band(seen, [p.residual for p in seen], 0.95)
        held.append(np.mean(np.abs(prediction(rng, "new").residual) <= band.half_width))
    assert 0.94 <= np.mean(held) <= 0.98


def test_held_out_recordings_have_no_part_in_the_band():
    rng = np.random.default_rng(2)
    fitted, held = prediction(rng, "a", sd=0.1), prediction(rng, "b", "heldout")
    alone = make_predictive_band([fitted], (fitted.residual,), 0.95)
    assert make_predictive_band([fitted, held], (fitted.residual,), 0.95) == alone


def test_the_band_is_made_of_blocks_that_are_predicted_from_the_others():
    rng = np.random.default_rng(3)
    fitted = prediction(rng, "a")
    band = make_predictive_band([fitted], (3.0 * fitted.residual,), 0.95)
    alone = make_predictive_band([fitted], (fitted.residual,), 0.95)
    assert band.half_width == pytest.approx(3.0 * alone.half_width)


def test_the_condition_that_a_band_misses_is_told():
    rng = np.random.default_rng(4)
    seen = [prediction(rng, "a", fast=4.0), prediction(rng, "b", fast=4.0)]
    band = make_predictive_band(seen, [p.residual for p in seen], 0.95)
    shares = {c.condition: c.coverage for c in band.conditions if c.kind == "speed"}
    assert shares["fast"] < 0.9 < shares["slow"]
    assert {c.kind for c in band.conditions} == {"direction", "speed", "position", "recording"}


def test_few_samples_make_a_wide_band():
    errors = np.linspace(0.0, 1.0, 101)
    assert conformal_half_width(errors, 0.9, 1000.0) < conformal_half_width(errors, 0.9, 20.0)
    assert conformal_half_width(errors, 0.95, 3.0) == 1.0
