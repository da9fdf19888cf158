"""Errata C1 to C5 and C13 to C15 of docs/errata.md for the paper `hill`, proved from what it prints.

C6 to C12, on the muscles, stand in test_hill_muscle_errata.py.
"""

import math

import numpy as np
import pytest
from scipy import signal

from pellucid.numerics.searches.adam import adam
from pellucid.orthosis.swing.loaded_swing import (
    bare_leg_torque,
    corrected_form,
    fit_swings,
    published_form,
    swing,
)
from pellucid_lab.papers.hill.recomputed import (
    GRAVITY_M_S2,
    SUBJECT_KEYS,
    half_activation,
    inertia_error,
    largest_activation,
    mean_shank,
    point_mass,
    recomputed,
    swing_frequency,
)
from pellucid_lab.papers.printed import printed
from pellucid_lab.seated.swing_design import optimise_swing, swing_information, two_sines

HILL = printed("hill")
SWINGS, MUSCLES, ERRORS, METHODS = (HILL.tables[name] for name in ("swings", "muscles", "errors", "methods"))
ROWS = {row.id.removeprefix("hill.recomputed."): row for row in recomputed(HILL)}
FS = 200.0
LEG = {"p": mean_shank(HILL).inertia, "q": mean_shank(HILL).mass * mean_shank(HILL).centre}
EMPTY = {name: SWINGS["empty"][name].value for name in ("p", "q")}
BOTH = {name: LEG[name] + EMPTY[name] for name in LEG}


def swung(body, series, *, human=0.0, duration=40.0, fs=FS, hanging=0.0):
    """A frictionless pendulum that hangs, moved along a series; the motor gives what a human does not."""
    time = np.arange(round(duration * fs)) / fs
    position, _, acceleration = series.motion(time)
    torque = body["p"] * acceleration + body["q"] * GRAVITY_M_S2 * np.sin(position)
    return swing(time, position + hanging, torque - human, lowpass=20.0, trim=50)


def test_c1_the_pendulum_stands_on_its_head():
    p, q = (SWINGS["empty"][n].value for n in ("p", "q"))
    # No torque, small angles: p ddtheta = q g theta runs away, at a rate the paper's own numbers give.
    state = np.array([[0.0, 1.0], [q * GRAVITY_M_S2 / p, 0.0]])
    eigenvalues = np.sort(np.linalg.eigvals(state).real)
    assert eigenvalues == pytest.approx((-9.79, 9.79), abs=0.01)
    hangs = np.linalg.eigvals(np.array([[0.0, 1.0], [-q * GRAVITY_M_S2 / p, 0.0]]))
    assert np.abs(hangs.real).max() == pytest.approx(0.0, abs=1e-12)
    # Three zeros of theta are named. Fitted to a leg that hangs, only counting from above gives a weight.
    data = [swung(BOTH, two_sines(0.3))]
    down, up, straight = (fit_swings(data, published_form(z)) for z in (0.0, np.pi, np.radians(85.0)))
    assert down.weight_moment.value == pytest.approx(-BOTH["q"], rel=2e-3)
    assert up.weight_moment.value == pytest.approx(BOTH["q"], rel=2e-3)
    assert up.inertia.value == pytest.approx(BOTH["p"], rel=2e-2)
    assert abs(straight.weight_moment.value) < 0.2 * BOTH["q"]
    assert straight.residual_rms > 100.0 * up.residual_rms


def test_c2_legs_of_no_inertia():
    empty, shank = SWINGS["empty"], mean_shank(HILL)
    alone = point_mass(empty["p"].value, empty["q"].value)
    assert (alone.mass, alone.distance) == (pytest.approx(2.33, abs=0.01), pytest.approx(0.102, abs=0.001))
    assert alone.distance < HILL["empty_distance"]
    bodies = [point_mass(SWINGS[s]["p"].value, SWINGS[s]["q"].value) for s in SUBJECT_KEYS]
    masses, distances = [b.mass for b in bodies], [b.distance for b in bodies]
    assert (min(masses), max(masses)) == (pytest.approx(16.4, abs=0.05), pytest.approx(321.6, abs=0.05))
    assert (min(distances), max(distances)) == (pytest.approx(0.0053, abs=1e-4), pytest.approx(0.108, abs=1e-3))
    # The leg's own, by difference, beside Winter's for the mean subject.
    p = np.array([SWINGS[s]["p"].value for s in SUBJECT_KEYS]) - empty["p"].value
    q = np.array([SWINGS[s]["q"].value for s in SUBJECT_KEYS]) - empty["q"].value
    assert p[1] == pytest.approx(-0.0155)
    assert p.mean() == pytest.approx(0.0837, abs=1e-4)
    assert shank.inertia == pytest.approx(0.395, abs=5e-4)
    assert shank.mass * shank.centre == pytest.approx(1.036, abs=5e-4)
    ratio = q / (shank.mass * shank.centre)
    assert (ratio.min(), ratio.max()) == (pytest.approx(1.20, abs=0.01), pytest.approx(1.54, abs=0.01))
    # A shank of that mass with that q has at least this p; none has.
    least = q**2 / shank.mass
    assert (least.min(), least.max()) == (pytest.approx(0.389, abs=1e-3), pytest.approx(0.638, abs=1e-3))
    assert np.all(p < 0.5 * least)
    # Held level, three of them need more torque than the motor has.
    level = {s: SWINGS[s]["q"].value * GRAVITY_M_S2 for s in SUBJECT_KEYS}
    assert [s for s in SUBJECT_KEYS if level[s] > HILL["motor_torque"]] == ["subject_3", "subject_6", "subject_8"]
    # In any body with mass, centre and extent p / q exceeds the centre's distance, and a mean shank's is 0.38 m.
    assert shank.inertia / (shank.mass * shank.centre) == pytest.approx(0.381, abs=1e-3)


def test_c3_the_swing_cannot_show_p():
    slow = [f.value for f in HILL.values["swing_factors"]]
    series = two_sines(np.radians(20.0), frequency=slow[0])
    assert slow[1] == 2.0 * slow[0]
    about = {"noise": 0.3, "bandwidth": 2.0, "duration": 60.0}
    shown = swing_information(series, BOTH["p"], BOTH["q"], **about)
    low, high, _, _ = series.peaks()
    assert np.degrees(max(-low, high)) == pytest.approx(35.2, abs=0.1)
    assert shown.inertia_share == pytest.approx(0.04, abs=0.005)
    assert shown.correlation == pytest.approx(-0.857, abs=0.002)
    assert shown.condition == pytest.approx(16.0, abs=0.2)
    # The interval of the leg's p is as wide as any value printed for it: 0.06 to 0.2, and one below 0.
    leg = np.hypot(shown.inertia_sd, swing_information(series, EMPTY["p"], EMPTY["q"], **about).inertia_sd)
    assert 1.96 * leg > 0.19
    # Other frequencies within the same angles and with less torque.
    better = optimise_swing(
        BOTH["p"], BOTH["q"], reach=max(-low, high), peak_torque=shown.peak_torque, rng=np.random.default_rng(3)
    )
    richer = swing_information(better, BOTH["p"], BOTH["q"], **about)
    assert richer.peak_torque <= shown.peak_torque
    assert richer.inertia_sd < shown.inertia_sd / 14.0


def test_c4_the_reference_of_step_three_is_off_by_more_than_the_errors():
    assert swing_frequency(HILL, 2) == pytest.approx(0.667, abs=1e-3)
    assert swing_frequency(HILL, 4) == pytest.approx(0.4)
    error = inertia_error(HILL, 0.67, np.radians(30.0), "subject_2")
    assert error == pytest.approx(3.8, abs=0.05)
    # Three times the printed RMSE; a sine's RMS is its peak over sqrt 2.
    assert error / math.sqrt(2.0) > 2.0 * ERRORS["subject_2"]["rmse"].value
    # Even a third of that amplitude leaves as much as the printed error.
    assert inertia_error(HILL, 0.67, np.radians(10.0), "subject_2") > 0.99 * ERRORS["subject_2"]["rmse"].value


def test_c5_the_difference_is_of_a_bare_leg():
    series = two_sines(0.3)
    empty, loaded = (
        fit_swings([swung(body, series)], corrected_form(viscous=False, friction=False, offset=False))
        for body in (EMPTY, BOTH)
    )
    fast = two_sines(0.2, frequency=0.4)
    time = np.arange(round(40.0 * FS)) / FS
    position, _, acceleration = fast.motion(time)
    # Worn, with a motor that gives nothing, the human moves leg and exoskeleton.
    human = BOTH["p"] * acceleration + BOTH["q"] * GRAVITY_M_S2 * np.sin(position)
    motion = swung(BOTH, fast, human=human)
    assert np.abs(motion.torque).max() < 1e-9
    truth = swing(time, position, human, lowpass=20.0, trim=50).torque
    literal = bare_leg_torque(empty, loaded, motion).torque
    missing = swing(
        time, position, EMPTY["p"] * acceleration + EMPTY["q"] * GRAVITY_M_S2 * np.sin(position), lowpass=20.0, trim=50
    ).torque
    # Eq. 12 misses what the exoskeleton takes, all of it.
    assert truth - literal == pytest.approx(missing, abs=0.03)
    assert np.abs(missing).max() > 0.4
    assert loaded.torque(motion) - motion.torque == pytest.approx(truth, abs=0.03)


def test_c7_largest_activations():
    most = [largest_activation(MUSCLES[s]["A"].value, MUSCLES[s]["k_r"].value) for s in SUBJECT_KEYS]
    assert most == pytest.approx((6.2, 16.6, 27.2, 8.8, 21.4, 36.9, 73.5, 27.0), abs=0.05)
    half = [half_activation(MUSCLES[s]["A"].value, MUSCLES[s]["k_r"].value) for s in SUBJECT_KEYS]
    assert (min(half), max(half)) == (pytest.approx(0.011, abs=5e-4), pytest.approx(0.030, abs=5e-4))
    assert half_activation(-1e-6, 1.0) == pytest.approx(0.5, abs=1e-6)


def test_c13_a_mean_and_what_is_said_of_the_errors():
    for name, off in (("rmse", False), ("maxe", False), ("mae", True)):
        mean = np.mean([ERRORS[s][name].value for s in SUBJECT_KEYS])
        # A mean of eight numbers, each within half a unit of its last digit, is within half a unit too.
        assert (abs(mean - ERRORS["mean"][name].value) > 1e-4) == off
        assert (ROWS[f"mean.{name}"].verdict == "cannot be") == off
    assert np.mean([ERRORS[s]["mae"].value for s in SUBJECT_KEYS]) == pytest.approx(1.1105, abs=5e-5)
    assert ERRORS["mean"]["mae"].value == 1.2445
    above = [s for s in SUBJECT_KEYS if ERRORS[s]["maxe"].value >= HILL["others_below"]]
    assert above == ["subject_3", "subject_5"]
    ratio = {n: METHODS["ours"][n].value / METHODS["nm_coa"][n].value for n in ("rmse", "maxe")}
    assert ratio == pytest.approx({"rmse": 1.61, "maxe": 1.53}, abs=0.005)


def test_c14_truncation_and_filters_flatter(rng):
    # A reference that is below 0 half of the time, and errors of one size all the time.
    time = np.arange(0.0, 40.0, 1.0 / FS)
    reference = 10.0 * np.sin(2.0 * np.pi * 0.4 * time)
    estimate = reference + rng.standard_normal(len(time))
    full = np.sqrt(np.mean((estimate - reference) ** 2))
    cut = np.sqrt(np.mean((np.maximum(estimate, 0.0) - np.maximum(reference, 0.0)) ** 2))
    assert full / cut == pytest.approx(math.sqrt(2.0), rel=0.06)
    # With the positive half of a torque alone, where a muscle is to blame, nothing is lost.
    positive = reference > 0.0
    assert np.sqrt(np.mean((estimate - reference)[positive] ** 2)) == pytest.approx(full, rel=0.05)
    # The envelope's zero-phase filter answers a twitch before it comes; the causal one cannot.
    sos = signal.butter(2, HILL["lowpass"], fs=1000.0, output="sos")
    twitch = np.zeros(2001)
    twitch[1000] = 1.0
    both, causal = signal.sosfiltfilt(sos, twitch), signal.sosfilt(sos, twitch)
    assert np.sum(both[:1000]) == pytest.approx(0.5, abs=0.02)
    assert np.abs(causal[:1000]).max() == 0.0


def test_c15_the_cost_grows_with_the_recording_and_adam_does_not_mind(rng):
    def cost(samples, *, mean):
        draw = np.random.default_rng(7)
        matrix = np.tile(draw.standard_normal((200, 2)), (samples // 200, 1))
        target = matrix @ (1.0, -0.5)

        def evaluate(x):
            error = matrix @ x - target
            share = len(error) if mean else 1.0
            return float(error @ error) / share, 2.0 * matrix.T @ error / share

        return evaluate

    start = np.zeros(2)
    # Eq. 13 is a sum over time: twice the recording, twice the cost and its gradient.
    short, long = cost(200, mean=False), cost(2000, mean=False)
    assert long(start)[1] == pytest.approx(10.0 * short(start)[1])
    # Plain gradient descent with a rate that suits the short one runs away on the long one,
    x = {"short": start, "long": start}
    for _ in range(40):
        x = {name: x[name] - 0.002 * f(x[name])[1] for name, f in (("short", short), ("long", long))}
    assert np.abs(short(x["short"])[0]) < 1.0
    assert np.abs(x["long"]).max() > 1e3
    # and Adam's steps, which are relative to the gradient, stay what they were.
    paths = [adam(f, start, rate=0.01, iterations=100).values for f in (short, long, cost(2000, mean=True))]
    assert paths[1] == pytest.approx(paths[0], abs=1e-7)
    assert paths[2] == pytest.approx(paths[0], abs=1e-7)
    # gamma stands for a pole of eq. 17 and for a width in eq. 23, with different values.
    assert [g.value for g in HILL.values["gammas"]] == [0.5, 0.5]
    assert HILL["length_width"] == 0.45
