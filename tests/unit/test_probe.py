"""The probe's rules: amplitude, window and noise from body, encoder, period and limit, and what is refused."""

import math

import numpy as np
import pytest

import pellucid as pl
from pellucid._errors import PellucidError
from pellucid.controllers.control_law import LAWS, ControlLaw
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.supervised import (
    MAX_PROBE_SHARE,
    MAX_UNHEARD_ENERGY_J,
    PROBE_ACCELERATION,
    PROBE_ANSWER_ERROR,
    PROBE_ANSWER_NAMES,
    PROBE_CREST,
    PROBE_CYCLES,
    PROBE_WINDOWS_S,
    STUCK_ENERGY_J,
    UNHEARD_S,
    probe_numbers,
    probe_samples,
    probe_signal_to_noise,
    unheard_energies,
)

INERTIA = 0.05


def law(**changes):
    numbers = {
        "inertia": INERTIA, "gravity_sine": 1.5, "velocity_width": 0.1, "effort_limit": 10.0, "rate_limit": 1000.0,
        "velocity_limit": 10.0, "position_min": -2.0, "position_max": 2.0, "max_age": 0.005, "period": 0.001,
    }  # fmt: skip
    return ControlLaw("joint", LAWS["joint"].defaults | numbers | changes)


def probed(given, **instruments):
    return pl.supervised(given, instruments=Instruments(probe=True, **instruments), start_up=False)


def test_off_by_default():
    assert pl.supervised(law()).supervision["probe_effort"] == 0.0


def test_rules_of_amplitude_window_and_noise():
    s = probed(law(), encoder_resolution=1e-5).supervision
    assert s["probe_effort"] == pytest.approx(PROBE_ACCELERATION * INERTIA)
    assert s["probe_samples"] == 120.0
    assert s["probe_inertia"] == INERTIA
    assert s["probe_noise"] == pytest.approx(2.5e-6)
    assert pytest.approx(math.sqrt(5.0)) == PROBE_CREST  # three waves side by side, at their highest
    speed = PROBE_CREST * PROBE_ACCELERATION / (2.0 * math.pi * 5 / 0.12)
    assert s["probe_moving"] == pytest.approx(max(0.1, 2.0 * speed))
    assert s["probe_evidence"] == 25.0
    assert s["probe_energy"] == MAX_UNHEARD_ENERGY_J
    assert probe_numbers(INERTIA, 1e-5, limit=10.0, period=0.001)["probe_travel"] == math.inf


def test_a_drive_may_go_unheard_as_far_as_its_own_effort_allows():
    """A law that needs little effort makes no drive weaker; its limit counts where that of the drive is not known."""
    shortest, longest = (time * 10.0 for time in UNHEARD_S)
    for drive, expected in ((7.0, 2.0 * STUCK_ENERGY_J / 7.0), (20.0, shortest), (1.0, longest)):
        for effort in (5.0, 10.0):
            s = probed(law(effort_limit=effort), drive_limit=drive).supervision
            assert s["probe_travel"] == pytest.approx(expected)
    assert probed(law(effort_limit=8.0)).supervision["probe_travel"] == pytest.approx(2.0 * STUCK_ENERGY_J / 8.0)


def test_a_coarse_encoder_needs_a_larger_wave():
    numbers = probe_numbers(INERTIA, 2e-3, limit=30.0, period=0.001)
    assert numbers["probe_effort"] > PROBE_ACCELERATION * INERTIA
    signal = probe_signal_to_noise(numbers["probe_effort"], INERTIA, 2e-3, 0.001)
    assert signal == pytest.approx(4.0)
    speed = PROBE_CREST * numbers["probe_effort"] / (INERTIA * 2.0 * math.pi * 5 / (1e-3 * numbers["probe_samples"]))
    assert numbers["probe_moving"] == pytest.approx(max(0.1, 2.0 * speed))


@pytest.mark.parametrize(("share", "samples"), [(9.0, 120), (6.2, 140), (3.5, 176), (3.0, 188)])
def test_a_robot_whose_waves_are_small_gets_longer_windows(share, samples):
    """With 120 periods a healthy hip of 0.42 kg m^2 and 13 N m was stopped as unanswered within seconds."""
    limit = share * INERTIA * PROBE_CREST / MAX_PROBE_SHARE
    numbers = probe_numbers(INERTIA, 4e-4, limit=limit, period=1e-3, speed_limit=2.0, drive_limit=100.0)
    assert numbers["probe_samples"] == samples
    assert numbers["probe_travel"] == pytest.approx(min(0.7, 0.16 * 2.0 * samples / 120))
    signal = probe_signal_to_noise(numbers["probe_effort"], INERTIA, 4e-4, 1e-3, samples)
    assert signal >= 39.0


@pytest.mark.parametrize(("drive", "share"), [(100.0, 1.0), (5.0, 0.7 / 1.28), (1.0, 0.5)])
def test_a_robot_that_its_drive_accelerates_less_shakes_less(drive, share):
    """A sine on a leg of 44 N m was found in half as many runs with the travel of an elbow."""
    found = probed(law(velocity_limit=8.0), drive_limit=drive, shaking=True).supervision["shaking_limit"]
    assert found == pytest.approx(share * 0.016 * 8.0)


def test_energies_of_an_unheard_drive_are_those_of_what_the_law_carries():
    """Weight and friction at the velocity limit count, and the weight left to the wearer, up to the law's limit.

    With friction at rest alone, a leg whose friction is viscous gave 116 J for the 91 J that were stated.
    """
    half = law(gravity_sine=4.0, gravity_share=0.5, effort_limit=9.0)
    numbers = half.values | probed(half, encoder_resolution=1e-5).supervision
    travel = numbers["probe_travel"]
    exchanged = numbers["push_limit"] - 9.0
    assert exchanged == pytest.approx(2.0, rel=0.2)
    stuck, wrong, dead = unheard_energies(numbers)
    assert (stuck, wrong) == (pytest.approx(4.5 * travel), 2.0 * dead)
    assert dead == pytest.approx((2.0 + exchanged) * travel, rel=0.02)
    viscous = {"viscous_positive": 0.5, "viscous_negative": 0.5, "friction_share": 1.0, "velocity_limit": 6.0}
    moving = law(gravity_sine=4.0, effort_limit=9.0, **viscous)
    numbers = moving.values | probed(moving, encoder_resolution=1e-5).supervision
    assert unheard_energies(numbers)[2] == pytest.approx((4.0 + 3.0) * numbers["probe_travel"], rel=0.02)
    heavy = law(gravity_sine=20.0, effort_limit=9.0)
    numbers = heavy.values | probed(heavy, encoder_resolution=1e-5).supervision
    assert unheard_energies(numbers)[2] == pytest.approx(9.0 * numbers["probe_travel"])


def test_signal_to_noise_is_that_of_a_simulated_encoder():
    """The power of a lock-in over the variance that noise of the stated size gives it."""
    rng, period, samples, noise = np.random.default_rng(1), 1e-3, 120, 1e-4
    weights = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(samples) / samples)
    total = 0.0
    for cycles in (5, 9, 13):
        wave = weights * np.exp(-2j * np.pi * cycles * np.arange(samples) / samples)
        readings = noise * rng.standard_normal((4000, samples + 2))
        lock_in = INERTIA * np.diff(readings, 2, axis=1) / period**2 @ wave
        asked = 0.2 * np.cos(2.0 * np.pi * cycles * np.arange(samples) / samples) @ wave
        total += abs(asked) ** 2 / np.mean(np.abs(lock_in) ** 2)
    assert probe_signal_to_noise(0.2, INERTIA, 4.0 * noise, period) == pytest.approx(total, rel=0.1)


@pytest.mark.parametrize(("period", "samples"), [(0.002, 60), (0.001, 120), (0.0005, 240), (0.0007, 172)])
def test_windows_have_four_equal_parts(period, samples):
    assert probe_samples(period) == samples


def test_not_below_500_hz():
    assert probed(law(period=0.002), encoder_resolution=1e-4).supervision["probe_samples"] == 60.0
    for rounded in (0.002 * (1.0 - 1e-12), 0.002 * (1.0 + 1e-12)):
        assert probe_samples(rounded) == 60
        assert probe_numbers(INERTIA, 1e-5, limit=10.0, period=rounded)["probe_samples"] == 60.0
    with pytest.raises(PellucidError, match="expected at least 500 Hz"):
        probe_numbers(INERTIA, 1e-5, limit=10.0, period=0.002 * (1.0 + 1e-6))
    with pytest.raises(PellucidError, match=r"probe: found a control rate of 400 Hz, expected at least 500 Hz"):
        probed(law(period=0.0025))


def test_not_above_a_share_of_the_limit():
    limit = PROBE_CREST * PROBE_ACCELERATION * INERTIA / MAX_PROBE_SHARE
    for share in (1.0, 0.8, 0.334):
        given = probed(law(effort_limit=share * limit), encoder_resolution=1e-5).supervision["probe_effort"]
        assert given == pytest.approx(share * PROBE_ACCELERATION * INERTIA)
    assert probed(law(effort_limit=2.0 * limit)).supervision["probe_effort"] == pytest.approx(
        PROBE_ACCELERATION * INERTIA
    )
    with pytest.raises(PellucidError, match=r"probe: found that .* need a wave of .* 0.25 of the effort limit"):
        probed(law(effort_limit=0.332 * limit), encoder_resolution=1e-5)
    with pytest.raises(PellucidError, match=r"that inertia and encoder need"):
        probed(law(), encoder_resolution=1e-2)


def test_not_without_an_inertia():
    with pytest.raises(PellucidError, match="expected a known inertia above 0"):
        probe_numbers(0.0, 1e-4, limit=10.0, period=0.001)
    with pytest.raises(PellucidError, match="expected a known inertia above 0"):
        probe_numbers(math.nan, 1e-4, limit=10.0, period=0.001)


@pytest.mark.parametrize("limit", [3.0, 5.0, 10.0, 40.0, 200.0])
@pytest.mark.parametrize("speed", [0.5, 2.0, 8.0, 20.0, 60.0])
def test_a_stuck_drive_gives_its_energy_on_the_way_that_is_left_to_it(limit, speed):
    """Stuck at half of its effort it gives 4.6 J, unless 0.7 rad, 0.093 s or 0.16 s at its limit are its way."""
    numbers = {"limit": 10.0, "period": 1e-3, "speed_limit": speed, "drive_limit": limit}
    travel = probe_numbers(INERTIA, 1e-5, **numbers)["probe_travel"]
    half = 0.5 * limit
    if 0.16 * speed < max(4.6 / half, 0.7):
        assert travel == pytest.approx(0.16 * speed)
    elif half * max(0.093 * speed, 0.7) > 4.6:
        assert travel == pytest.approx(max(0.093 * speed, 0.7))
    else:
        assert half * travel == pytest.approx(4.6)
    unknown = numbers | {"limit": limit, "drive_limit": math.inf}
    if limit > 3.0:
        assert probe_numbers(INERTIA, 1e-5, **unknown)["probe_travel"] == travel


def test_a_wave_that_nobody_feels_and_every_encoder_shows():
    """Each wave accelerates the robot by 9 rad/s^2; a robot that is not heard may be given 4 J too much."""
    numbers = probe_numbers(INERTIA, 1e-5, limit=40.0, period=1e-3)
    assert numbers["probe_effort"] / INERTIA == pytest.approx(9.0)
    assert numbers["probe_energy"] == 4.0  # a joule less than a wearer may be given
    for inertia in (0.001, 0.01, 0.2):
        numbers = probe_numbers(inertia, 1e-5, limit=40.0, period=1e-3)
        fastest = 9.0 * math.sqrt(5.0) * 0.12 / (2.0 * math.pi * 5)
        assert numbers["probe_moving"] == pytest.approx(max(0.1, 2.0 * fastest))
    slow = probe_numbers(INERTIA, 1e-5, limit=20.0 * INERTIA * 2.3, period=1e-3)
    assert slow["probe_moving"] == pytest.approx(max(0.1, 2.0 * 0.12 * MAX_PROBE_SHARE * 46.0 / (2.0 * math.pi * 5)))


@pytest.mark.parametrize("speed", [4.0, 8.0, math.inf])
def test_a_heavy_robot_carries_itself_over_the_way_that_its_drive_may_go_unheard(speed):
    """Three times the gain adds twice the effort: no wearer is left with a weight before the way is used up."""
    numbers = {"limit": 80.0, "period": 1e-3, "speed_limit": speed}
    made = probe_numbers(INERTIA, 1e-5, steady=50.0, **numbers)
    way = made["probe_travel"] if math.isfinite(speed) else 4.6 / 40.0
    assert made["probe_energy"] == pytest.approx(max(4.0, 2.0 * 50.0 * way))
    assert probe_numbers(INERTIA, 1e-5, steady=1.0, **numbers)["probe_energy"] == 4.0


def test_the_probe_carries_what_the_law_carries_of_weight_and_friction():
    heavy = law().changed(gravity_sine=40.0, effort_limit=80.0, velocity_limit=8.0)
    made = probed(heavy, encoder_resolution=1e-5).supervision
    assert made["probe_energy"] == pytest.approx(2.0 * 40.0 * made["probe_travel"], rel=0.1)


def test_answers_at_commissioning_are_the_supervisors_numbers():
    answer = (1.0, -0.1, 0.9, -0.2, 0.8, -0.3)
    s = probed(law(), probe_answer=answer).supervision
    assert tuple(s[name] for name in PROBE_ANSWER_NAMES) == answer
    assert s["probe_answer_error"] == PROBE_ANSWER_ERROR
    assert probed(law()).supervision["probe_answer_error"] == 0.0


@pytest.mark.parametrize("wrong", [(), (1.0,) * 5, (1.0,) * 7, (math.nan, *(1.0,) * 5), (0.0, 0.0, *(1.0,) * 4)])
def test_an_answer_that_is_none_is_refused(wrong):
    with pytest.raises(PellucidError, match=r"instruments: probe_answer: found .*, expected real and imaginary part"):
        Instruments(probe_answer=wrong)


def moving_joint(gain, onset, seconds=20.0, answer=None):
    """Return the fault that a probed law finds in a joint, when after the onset, and all efforts."""
    watched, after, efforts = moved(gain, onset, seconds, 0.1, answer)
    return watched.fault, after, efforts


def moved(gain, onset, seconds, friction, answer):
    """A joint that is moved to and fro under a probed law; a drive gives `gain` of its effort from the onset on."""
    given = law(gravity_sine=0.0, gravity_cosine=0.0)
    safe = probed(given, encoder_resolution=1e-4, probe_answer=answer)
    watched, rng = safe.start(), np.random.default_rng(3)
    period, speed, place, effort, efforts = 1e-3, 0.0, 0.0, 0.0, []
    for k in range(round(seconds / period)):
        time = period * k
        slow, slow_speed = 0.5 * math.sin(3.0 * time), 1.5 * math.cos(3.0 * time)
        due = effort * (gain if time >= onset else 1.0)
        rubs = friction * (math.tanh((slow_speed + speed) / 0.01) - math.tanh(slow_speed / 0.01))
        speed = 0.999 * (speed + period * (due - rubs) / INERTIA)
        place += period * speed
        reading = 5e-5 * round((slow + place + 1e-5 * rng.standard_normal()) / 5e-5)
        effort = watched.step(time, reading)
        efforts.append(effort)
        if watched.fault != "none":
            return watched, time - onset, np.array(efforts)
    return watched, math.nan, np.array(efforts)


@pytest.mark.parametrize("amplitude", [0.7, 0.02])
def test_a_heavy_robot_is_carried_in_healthy_use(amplitude):
    """A leg of 44 N m lost most of its compensation as soon as it moved, and while its wearer trembled."""
    heavy = law(inertia=1.2, gravity_sine=44.0, effort_limit=80.0, velocity_limit=10.0)
    watched, rng = probed(heavy, encoder_resolution=1e-4).start(), np.random.default_rng(5)
    speed, place, effort, carried = 0.0, 0.0, 0.0, []
    for k in range(12_000):
        time, pace = 1e-3 * k, 2.5 if amplitude > 0.1 else 55.0
        slow = 0.9 + amplitude * math.sin(pace * time)
        speed += 1e-3 * ((effort - 44.0 * math.sin(slow)) / 1.2 - 400.0 * place - 40.0 * speed)
        place += 1e-3 * speed
        reading = 5e-5 * round((slow + place + 1e-5 * rng.standard_normal()) / 5e-5)
        effort = watched.step(time, reading)
        carried.append(effort / (44.0 * math.sin(slow)))
        assert watched.fault == "none"
    shares = np.convolve(carried[2000:], np.ones(120) / 120, "valid")
    assert np.quantile(shares, 0.01) > 0.75
    assert np.median(shares) == pytest.approx(1.0, abs=0.1)


@pytest.fixture(scope="module")
def right():
    """What a joint with a drive and an encoder that are right answers."""
    assert probed(law()).probe_answer is None
    watched = moved(1.0, 0.0, 3.0, 0.1, None)[0]
    answer, windows = watched.probe_answer
    assert windows > 6
    return answer


@pytest.mark.parametrize(
    ("gain", "fault"), [(-1.0, "polarity"), (3.0, "gain"), (2.0, "gain"), (0.0, "unanswered"), (1.0, "none")]
)
def test_verdicts_of_a_supervised_law(gain, fault):
    found, after, efforts = moving_joint(gain, 10.0)
    assert found == fault
    assert np.all(np.abs(efforts) <= 10.0)
    if fault != "none":
        assert 0.1 < after < 1.0


@pytest.mark.parametrize(("gain", "fault"), [(-1.0, "polarity"), (3.0, "gain"), (2.0, "gain"), (0.0, "unanswered")])
def test_a_commissioned_robot_finds_what_is_wrong_from_the_start(right, gain, fault):
    """Without its answers at commissioning the first movement under a wrong drive is taken for right."""
    found, after, _ = moving_joint(gain, 0.0, seconds=3.0, answer=right)
    assert found == fault
    assert after < 1.5
    blind, later, _ = moving_joint(gain, 0.0, seconds=3.0)
    assert blind == "none" or (gain == 0.0 and later > 1.5 * after)


@pytest.mark.parametrize("ratio", [0.75, 1.0, 1.3])
def test_a_healthy_robot_may_answer_otherwise_than_at_its_commissioning(right, ratio):
    answer = [ratio * part for part in right]
    assert moving_joint(1.0, 0.0, seconds=3.0, answer=answer)[0] == "none"


def test_the_rate_of_a_law_takes_no_wave_away():
    """From 0 to its limit in 20 ms, the law of a heavy robot left little of waves that need a ninth of the limit."""
    quiet, loud = (law(effort_limit=2.3, rate_limit=rate, gravity_sine=0.0) for rate in (115.0, 1e6))
    waves = []
    for given in (quiet, loud):
        watched = probed(given, encoder_resolution=1e-4).start()
        waves.append([watched.step(1e-3 * k, 1.0 + 1e-6 * (k % 2)) for k in range(1000)])
    assert np.allclose(waves[0][200:], waves[1][200:], atol=1e-5)
    assert np.std(waves[0][200:]) > 0.2


def test_waves_and_answers_are_as_stated():
    """Waves of 42, 75 and 108 Hz; a healthy robot answers otherwise by a tenth in the mean square."""
    assert [round(cycles / PROBE_WINDOWS_S[0]) for cycles in PROBE_CYCLES] == [42, 75, 108]
    assert pytest.approx(0.1) == PROBE_ANSWER_ERROR
