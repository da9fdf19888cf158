"""Errata C6 to C12 of docs/errata.md for the paper `hill`, on its muscles, proved from what it prints."""

import math

import hill_as_published as published
import numpy as np
import pytest
from scipy import signal

from pellucid.emg.models.hill import HillData, HillModel, HillMuscle
from pellucid.emg.models.muscle_geometry import muscle_table
from pellucid_lab.papers.printed import printed

HILL = printed("hill")
MUSCLES = HILL.tables["muscles"]
TABLE = muscle_table()
SEATED = {"hip": math.radians(85.0)}
PARAMETERS = [
    published.PublishedParameters(*(MUSCLES[f"subject_{s}"][k].value for k in ("A", "k_r", "lambda", "k_s", "k_v")))
    for s in range(1, 9)
]


def line(name, others=SEATED):
    return published.fibre_line(
        TABLE.constants[name], TABLE.geometry[name], others=others, low=math.radians(-110), high=math.radians(-30)
    )


QUADRICEPS = [line(name) for name in ("rectus_femoris", "vastus_lateralis", "vastus_medialis")]


def torque_at(parameters, neural, degrees):
    """Isometric, of all three muscles, at the same share of their largest neural activation."""
    u = np.full((3, 1), neural)
    return float(published.torque(QUADRICEPS, parameters, u, np.ones(3), np.radians([degrees]), np.zeros(1))[0])


def corner(b, a, fs):
    """Where a filter's gain falls below -3 dB [Hz]; nan where it never does."""
    w, h = signal.freqz(b, a, worN=200_000, fs=fs)
    below = np.abs(h) < 2**-0.5
    return w[np.argmax(below)] if below.any() else math.nan


def test_c6_the_twitch_is_an_amplifier(rng):
    b, a = published.recursion([g.value for g in HILL.values["gammas"]])
    gain = {fs: np.abs(signal.freqz(b, a, worN=[0.0, 5.0, 30.0, 50.0], fs=fs)[1]) for fs in (1000.0, 100.0)}
    assert gain[1000.0] == pytest.approx([1.0, 1.0002, 1.0079, 1.0222], abs=1e-4)
    assert gain[100.0] == pytest.approx([1.0, 1.0222, 2.3911, 9.0], abs=1e-4)
    assert math.isnan(corner(b, a, 1000.0))
    _, delay = signal.group_delay((b, a), w=[1e-6])
    assert delay[0] == pytest.approx(-2.0 / 3.0)
    impulse = published.neural_activation(np.r_[1.0, np.zeros(500)])
    assert impulse[:4] == pytest.approx([2.25, -2.25, 1.6875, -1.125])
    assert np.sum(impulse**2) == pytest.approx(15.0)
    # A step of excitation from 1 to 0 makes the activation negative; the corrected recursion never does.
    step = np.r_[np.ones(50), np.zeros(50)]
    assert published.neural_activation(step).min() < -1.0
    assert np.std(published.neural_activation(rng.standard_normal(5000))) == pytest.approx(math.sqrt(15.0), rel=0.05)
    muscle = HillMuscle("m", 0.09, 0.1, 1000.0, shape=-1e-9)
    made = HillModel([muscle]).states(
        HillData(step[None], np.full((1, 100), 0.19), np.zeros((1, 100)), np.ones((1, 100)), 1e-3)
    )["activation"]
    assert made.min() >= 0.0
    # With the sign that its constraint needs it is a low-pass: how slow, and how late.
    assert corner(*published.recursion((-0.5, -0.5)), 1000.0) == pytest.approx(73.0, abs=0.5)
    for twitch, hertz, late in ((0.02, 5.1, 39.0), (0.04, 2.6, 79.0), (0.05, 2.1, 99.0)):
        slow = published.recursion([-math.exp(-0.001 / twitch)] * 2)
        assert corner(*slow, 1000.0) == pytest.approx(hertz, abs=0.06)
        assert signal.group_delay(slow, w=[1e-6])[1][0] == pytest.approx(late, abs=0.1)
        same = HillMuscle("m", 0.09, 0.1, 1000.0, time_constant_1=twitch, time_constant_2=twitch, delay=0.0)
        assert 1e3 * HillModel([same]).estimator(1e-3).delays[0] == pytest.approx(late, abs=0.1)


def test_c8_the_muscles_cannot_be_those_identified():
    seated = [torque_at(p, 0.3, -85) for p in PARAMETERS]
    lifted = [torque_at(p, 0.3, -30) for p in PARAMETERS]
    hardly = [torque_at(p, 0.02, -30) for p in PARAMETERS]
    assert (min(map(abs, seated)), max(map(abs, seated))) == (pytest.approx(204, abs=1), pytest.approx(1983, abs=1))
    assert (min(map(abs, lifted)), max(map(abs, lifted))) == (pytest.approx(861, abs=1), pytest.approx(17475, abs=2))
    assert (min(map(abs, hardly)), max(map(abs, hardly))) == (pytest.approx(410, abs=1), pytest.approx(4020, abs=2))
    # What the leg needs: nothing where it hangs, and at -30 degrees about what its weight is.
    assert min(map(abs, lifted)) > 50 * 13.0
    longest = [
        max(p.k_s * (m.intercept + m.slope * math.radians(-110)) / m.optimal_fibre_length for m in QUADRICEPS)
        for p in PARAMETERS
    ]
    assert min(longest) > 2.3
    assert math.exp(-((max(longest) - 1.0) ** 2) / HILL["length_width"]) < 1e-55
    stretched = [p.lambda_ * (float(published.activation(1.0, p.A, p.k_r)) - 1.0) + 1.0 for p in PARAMETERS]
    assert sorted(round(x, 1) for x in stretched)[-3:] == [2.6, 2.7, 3.0]
    assert {i + 1 for i, x in enumerate(stretched) if x > 2.0} == {3, 5, 7}
    assert {i + 1 for i, p in enumerate(PARAMETERS) if p.k_s > 6.0} == {3, 5, 7}
    speeds = sorted(p.k_v for p in PARAMETERS)
    assert speeds[1] < 1.51
    assert speeds[2] > 8.2


def test_c9_the_optimal_length_shifts_the_other_way():
    lambda_ = 0.15
    for activation in (0.0, 0.5, 1.0):
        printed_length = lambda_ * (activation - 1.0) + 1.0
        usual = lambda_ * (1.0 - activation) + 1.0
        assert printed_length + usual == pytest.approx(2.0)
    assert lambda_ * (1.0 - 1.0) + 1.0 == 1.0, "l_o is the length at full activation, not at none"
    # The core: at little activation a longer fibre is the strongest.
    muscle = HillMuscle("m", 0.09, 0.1, 1000.0, shape=-1e-9, passive_scale=0.0, optimal_length_shift=lambda_)
    lengths = 0.1 + 0.09 * np.linspace(0.8, 1.4, 601)
    for u in (0.05, 1.0):
        force = HillModel([muscle]).states(
            HillData(np.full((1, 601), u), lengths[None], np.zeros((1, 601)), np.ones((1, 601)), 1e-3)
        )["force"][0]
        best = (lengths[np.argmax(force)] - 0.1) / 0.09
        assert best == pytest.approx(1.0 + lambda_ * (1.0 - u), abs=0.002)


def test_c10_shortening_makes_it_stronger():
    shortening, lengthening, fast = published.force_velocity(np.array([0.1, -0.5, -1.2]))
    assert shortening == pytest.approx(1.25)
    assert lengthening == pytest.approx(1.0 / 6.0)
    assert fast == pytest.approx(-0.0345, abs=1e-4)
    h = 1e-7
    below, here, above = published.force_velocity(np.array([-h, 0.0, h]))
    assert (here - below) / h == pytest.approx(5.0, rel=1e-5)
    assert (above - here) / h == pytest.approx(5.0, rel=1e-5)
    # The core takes lengthening for positive: the same curve, the other way round, and never below 0.
    muscle = HillMuscle("m", 0.09, 0.1, 1000.0, passive_scale=0.0)
    rates = 0.9 * np.array([-0.1, 0.5, -1.2, 0.0])
    force = HillModel([muscle]).states(
        HillData(np.ones((1, 4)), np.full((1, 4), 0.19), rates[None], np.ones((1, 4)), 1e-3)
    )["force"][0]
    assert force[0] < force[3] < force[1]
    assert force[2] == 0.0


def test_c11_the_knee_bends_instead():
    for muscle in QUADRICEPS:
        assert -0.0355 < muscle.slope < -0.0325
    assert all(torque_at(p, 0.3, -60) < 0.0 for p in PARAMETERS), "a quadriceps that flexes"
    geometry = TABLE.geometry["vastus_lateralis"]
    knee = {"knee": np.radians(np.linspace(-110, -30, 9))}
    assert (geometry.moment_arm("knee", knee) > 0.02).all()


def test_c12_pennation_cancels_and_the_arm_is_scaled():
    muscle = QUADRICEPS[1]
    angle = np.radians(np.linspace(-110, -30, 9))
    fibre = muscle.intercept + muscle.slope * angle
    cosine = np.sqrt(1.0 - (muscle.optimal_fibre_length * math.sin(muscle.pennation) / fibre) ** 2)
    assert published.moment_arm(muscle, fibre, 1.0) * cosine == pytest.approx(np.full(9, muscle.slope))
    # So the angle of the fibres is nowhere in the torque; with k_s the arm grows as the fibre does.
    flat = published.PublishedMuscle(
        muscle.name, muscle.max_isometric_force, muscle.optimal_fibre_length, 0.0, muscle.intercept, muscle.slope
    )
    u, most, still = np.full((1, 9), 0.3), np.ones(1), np.zeros(9)
    pair = [published.torque([m], PARAMETERS[0], u, most, angle, still) for m in (muscle, flat)]
    assert pair[0] == pytest.approx(pair[1], rel=1e-12)
    assert max(p.k_s for p in PARAMETERS) * abs(muscle.slope) == pytest.approx(0.235, abs=0.001)
    # The arm that a straight line gives is one number; the model's own changes 1.8-fold.
    rectus = TABLE.geometry["rectus_femoris"]
    arms = rectus.moment_arm("knee", {"hip": np.full(3, SEATED["hip"]), "knee": np.radians([-90.0, -60.0, -30.0])})
    assert arms == pytest.approx([0.027, 0.040, 0.049], abs=6e-4)
    assert arms[2] / arms[0] == pytest.approx(1.8, abs=0.05)


def test_the_fibre_lines_are_those_of_the_anatomical_model():
    """What the paper took from OpenSim: lengths over the knee's angle, the hip bent as one sits, or straight."""
    for name, others, intercept, slope in (
        ("rectus_femoris", SEATED, 0.0395, -0.0348),
        ("rectus_femoris", {"hip": 0.0}, 0.1118, -0.0352),
        ("vastus_medialis", SEATED, 0.0550, -0.0335),
        ("vastus_intermedius", SEATED, 0.0551, -0.0338),
        ("vastus_lateralis", SEATED, 0.0526, -0.0330),
    ):
        made = line(name, others)
        assert (made.intercept, made.slope) == (pytest.approx(intercept, abs=1.5e-4), pytest.approx(slope, abs=1e-4))
