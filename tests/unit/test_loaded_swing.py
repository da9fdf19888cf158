"""p and q of an exoskeleton empty and loaded: closed form, Adam, bounds, intervals, the wearer's torque."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from pellucid._errors import IdentificationError
from pellucid.models.joint import GRAVITY
from pellucid.orthosis.swing.loaded_swing import (
    adam_swings,
    bare_leg_torque,
    corrected_form,
    fit_swings,
    leg_alone,
    published_form,
    swing,
    worn_exoskeleton_torque,
)
from pellucid_lab.seated import swing_design
from pellucid_lab.seated.swing_design import optimise_swing, swing_information, two_sines

FS = 200.0
EMPTY = {"inertia": 0.05, "weight_moment": 0.30, "viscous": 0.05, "coulomb": 0.15, "offset": 0.1}
LOADED = {"inertia": 0.45, "weight_moment": 1.34, "viscous": 0.25, "coulomb": 0.20, "offset": 0.1}
REACH = np.radians(35.0)


@pytest.fixture(scope="module")
def rich():
    with pytest.MonkeyPatch.context() as patch:
        # Fewer limits of the acceleration are tried, which takes most of the time.
        patch.setattr(swing_design, "_ACCELERATION_LIMIT_COUNT", 4)
        return optimise_swing(0.45, 1.34, reach=REACH, peak_torque=8.0, rng=np.random.default_rng(8))


def balance(body, position, velocity, acceleration, hanging=0.0):
    return (
        body["inertia"] * acceleration
        + body["weight_moment"] * GRAVITY * np.sin(position - hanging)
        + body["viscous"] * velocity
        + body["coulomb"] * np.tanh(velocity / 0.01)
        + body["offset"]
    )


def recorded(series, body, *, rng=None, noise=0.3, duration=60.0, hanging=0.0, human=None):
    """A swing through encoder and torque sensor: 1e-4 rad, and torque noise up to 2 Hz."""
    time = np.arange(round(duration * FS)) / FS
    position, velocity, acceleration = series.motion(time)
    torque = balance(body, position, velocity, acceleration, hanging)
    if human is not None:
        torque = torque - human(time)
    if rng is not None:
        slow = sosfiltfilt(butter(4, 2.0, fs=FS, output="sos"), rng.standard_normal(len(time)))
        torque = torque + noise * slow / slow.std()
        position = position + 1e-4 * rng.standard_normal(len(time))
    return swing(time, position, torque, lowpass=6.0, every=4)


def test_the_corrected_form_finds_the_body(rich, rng):
    fit = fit_swings([recorded(rich, LOADED, rng=rng)], corrected_form())
    for found in fit.parameters:
        assert abs(found.value - LOADED[found.name]) < 3.0 * found.standard_error, found
    assert fit.inertia.standard_error < 0.1 * 0.45
    assert fit.weight_moment.standard_error < 0.02 * 1.34
    assert fit.inertia.identifiable
    assert fit.mass == pytest.approx(fit.weight_moment.value**2 / fit.inertia.value)
    assert fit.distance * fit.mass == pytest.approx(fit.weight_moment.value)


def test_difference_with_the_better_swing_is_the_leg(rich, rng):
    empty = fit_swings([recorded(rich, EMPTY, rng=rng)], corrected_form())
    loaded = fit_swings([recorded(rich, LOADED, rng=rng)], corrected_form())
    inertia, moment = leg_alone(empty, loaded)
    assert inertia.value == pytest.approx(0.40, rel=0.10)
    assert moment.value == pytest.approx(1.04, rel=0.02)
    assert abs(inertia.value - 0.40) < 3.0 * inertia.standard_error
    assert inertia.standard_error == pytest.approx(
        np.hypot(empty.inertia.standard_error, loaded.inertia.standard_error)
    )
    assert inertia.identifiable
    assert not inertia.at_bound


def test_the_angle_of_rest_is_found_where_it_is_not_known(rich, rng):
    # A wide swing, for a cosine is nearly an offset in a narrow one.
    wide = replace(rich, a=1.2 / REACH * rich.a, b=1.2 / REACH * rich.b)
    fit = fit_swings([recorded(wide, LOADED, rng=rng, hanging=0.1)], corrected_form(None))
    found = {p.name: p for p in fit.parameters}
    assert list(found) == ["inertia", "weight_moment", "hanging", "viscous", "coulomb", "offset"]
    assert abs(found["hanging"].value - 0.1) < 3.0 * found["hanging"].standard_error
    assert abs(found["weight_moment"].value - 1.34) < 3.0 * found["weight_moment"].standard_error
    assert fit_swings([recorded(wide, LOADED, hanging=0.1)], corrected_form(0.1)).weight_moment.value == pytest.approx(
        1.34, rel=1e-3
    )


def test_intervals_cover(rich):
    inside = 0
    for seed in range(40):
        draw = np.random.default_rng(seed)
        fit = fit_swings([recorded(rich, LOADED, rng=draw, duration=30.0)], corrected_form())
        low, high = fit.inertia.interval()
        inside += low <= LOADED["inertia"] <= high
    # 95 % of 40 is 38; fewer than 33 has a chance below 1 in 100.
    assert inside >= 33


def test_friction_is_never_negative():
    frictionless = {**LOADED, "viscous": -0.05, "coulomb": -0.1}
    fit = fit_swings([recorded(two_sines(np.radians(20.0)), frictionless)], corrected_form())
    found = {p.name: p for p in fit.others}
    assert found["coulomb"].value == pytest.approx(0.0, abs=1e-9)
    assert found["coulomb"].at_bound
    assert not found["coulomb"].identifiable


@pytest.mark.parametrize("form", [published_form(np.pi), corrected_form()])
def test_adam_with_a_falling_rate_ends_where_the_closed_form_does(rich, rng, form):
    data = [recorded(rich, LOADED, rng=rng)]
    exact = fit_swings(data, form).coefficients
    path = adam_swings(data, form, rate=0.02, final_rate=0.0, iterations=10_000)
    assert np.abs(path.last - exact).max() < 1e-3


def test_a_fixed_rate_wanders_only_where_gradients_are_of_parts(rng):
    data, form = [recorded(two_sines(np.radians(20.0)), LOADED, rng=rng)], published_form(np.pi)
    exact = fit_swings(data, form).coefficients
    settings = {"rate": 0.05, "iterations": 6000}
    whole = adam_swings(data, form, **settings)
    # All samples in each gradient: nothing oscillates, whatever the rate does.
    assert whole.last == pytest.approx(exact, abs=1e-6)
    fixed = adam_swings(data, form, **settings, batch=50)
    falling = adam_swings(data, form, **settings, batch=50, final_rate=0.0)
    assert np.all(fixed.spread() > 10.0 * falling.spread())


def test_the_better_swing_shows_more_with_less_torque(rich, monkeypatch):
    about = {"noise": 0.3, "bandwidth": 2.0, "duration": 60.0}
    printed = swing_information(two_sines(np.radians(20.0)), 0.45, 1.34, **about)
    better = swing_information(rich, 0.45, 1.34, **about)
    assert better.inertia_sd < printed.inertia_sd / 10.0
    assert better.peak_torque <= 8.0
    low, high, _, _ = rich.peaks()
    assert max(-low, high) <= REACH * 1.0001
    monkeypatch.setattr(swing_design, "_ACCELERATION_LIMIT_COUNT", 1)
    with pytest.raises(IdentificationError, match="expected at most 1 N"):
        optimise_swing(0.45, 1.34, reach=REACH, peak_torque=1.0, rng=np.random.default_rng(1))


def test_expected_spread_is_the_observed_one():
    # p and q alone, so that the formula's terms are the fit's.
    series, form = two_sines(np.radians(20.0)), corrected_form(friction=False, viscous=False, offset=False)
    plain = {**LOADED, "viscous": 0.0, "coulomb": 0.0, "offset": 0.0}
    found = [
        fit_swings([recorded(series, plain, rng=np.random.default_rng(seed), duration=64.0)], form).inertia.value
        for seed in range(60)
    ]
    expected = swing_information(series, 0.45, 1.34, noise=0.3, bandwidth=2.0, duration=62.0).inertia_sd
    assert np.std(found) == pytest.approx(expected, rel=0.3)


def test_the_wearer_s_torque_depends_on_what_the_exoskeleton_does(rich):
    empty, loaded = (fit_swings([recorded(rich, body)], corrected_form()) for body in (EMPTY, LOADED))
    leg = {name: LOADED[name] - EMPTY[name] for name in LOADED}
    time = np.arange(round(20 * FS)) / FS
    position, velocity, acceleration = two_sines(0.3, frequency=0.3).motion(time)
    bare = swing(time, position, balance(leg, position, velocity, acceleration), lowpass=6.0, every=4)
    by_difference = bare_leg_torque(empty, loaded, bare)
    assert np.abs(by_difference.torque - bare.torque).max() < 0.08  # where friction turns over
    # Worn passive: the wearer moves the exoskeleton too, and the motor gives nothing.
    worn = balance(LOADED, position, velocity, acceleration) - LOADED["offset"]
    motion = swing(time, position, np.full(len(time), LOADED["offset"]), lowpass=6.0, every=4)
    truth = swing(time, position, worn, lowpass=6.0, every=4).torque
    by_balance = worn_exoskeleton_torque(loaded, motion)
    assert np.abs(by_balance.torque - truth).max() < 0.08
    wrong = bare_leg_torque(empty, loaded, motion)
    assert np.abs(wrong.torque - truth).max() > 0.5
    assert np.all(by_balance.standard_error >= 0.0)
    other = replace(empty, form=corrected_form(0.1))
    with pytest.raises(IdentificationError, match="expected one form for both"):
        bare_leg_torque(other, loaded, motion)


def test_what_cannot_be_fitted_is_told():
    time = np.arange(2000) / FS
    still = swing(time, np.zeros(2000), np.ones(2000), lowpass=6.0, recording="rest")
    with pytest.raises(
        IdentificationError, match="rest: inertia and weight_moment and viscous and coulomb cannot be identified"
    ):
        fit_swings([still], corrected_form())
    with pytest.raises(IdentificationError, match="short: found 60 samples, expected more than"):
        swing(time[:60], time[:60], time[:60], lowpass=6.0, recording="short")
