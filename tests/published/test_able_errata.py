"""Every erratum of docs/errata.md for the paper `able`, proved by computing it again from what the paper prints."""

from itertools import product

import moving_average
import numpy as np
import pytest
from parameter_count import chain_parameters, coupled_parameters, listed_sets
from scipy import signal, stats
from sd_bounds import sd_bounds

from pellucid._errors import PellucidError, StudyError
from pellucid.models.joint import GRAVITY
from pellucid.numerics.protocols.excitation import swept_sine
from pellucid.people.comparison import friedman, friedman_from_rank_sums, nemenyi_from_rank_sums
from pellucid.units import to_si_factor
from pellucid_lab.papers.able.coherence import implied_friction, inconsistencies, positive_inertia_range
from pellucid_lab.papers.able.elbow import able_elbow
from pellucid_lab.papers.paired_test import paired_test
from pellucid_lab.papers.printed import printed

ABLE = printed("able")
PRINTED = ABLE.values
ELBOW = able_elbow()
RAIL = np.linspace(0.0, 0.5, 501)  # m; the rail's length is not printed


def least_mass(elbow, direction: str, sliders: np.ndarray) -> np.ndarray:
    """How heavy the forearm must be at least for its first moment not to be too large for its inertia.

    sliders (n,) [m]; gives (n,) [kg].
    """
    inertia = elbow.inertia(direction, sliders)
    moment = elbow.first_moment(direction, sliders) ** 2 + elbow.direction(direction).m_y ** 2
    return np.where(inertia > 0.0, moment / np.where(inertia > 0.0, inertia, 1.0), np.inf)


def minimum_jerk(time: np.ndarray, duration: float, amplitude: float) -> np.ndarray:
    s = np.clip(time / duration, 0.0, 1.0)
    return amplitude * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)


def between_thresholds(time: np.ndarray, velocity: np.ndarray) -> float:
    """Duration by the paper's rule: first to last sample above 5 % of the largest velocity."""
    above = time[velocity >= 0.05 * velocity.max()]
    return float(above[-1] - above[0])


# ------------------------------------------------------------------------------------------------------ statistics


def test_a1_the_velocity_p_is_ten_times_smaller():
    result = friedman_from_rank_sums((23, 19, 10, 8), int(ABLE["participants"]), exact=True)
    assert PRINTED["velocity_chi2"].agrees(result.statistic)
    assert result.p_value == pytest.approx(0.0015048, rel=1e-4)
    assert not PRINTED["velocity_p"].agrees(result.p_value)
    assert PRINTED["velocity_p"].agrees(10.0 * result.p_value)
    # No chi-squared that rounds to the printed one gives the printed p.
    assert stats.chi2.sf(PRINTED["velocity_chi2"].interval[0], 3) < PRINTED["velocity_p"].interval[0]
    assert stats.chi2.isf(ABLE["velocity_p"], 3) == pytest.approx(10.5, abs=0.05)
    assert result.exact_p_value == pytest.approx(4.6467e-5, rel=1e-4)
    # The other two are printed right, and the counted p of all three are a tenth of them and less.
    for sums, name, exact in (((9, 9, 21, 21), "duration", 2.3723e-4), ((6, 12, 18), "emg_acc", 1.2860e-4)):
        other = friedman_from_rank_sums(sums, 6, exact=True)
        assert PRINTED[f"{name}_chi2"].agrees(other.statistic)
        assert PRINTED[f"{name}_p"].agrees(other.p_value)
        assert other.exact_p_value == pytest.approx(exact, rel=1e-4)


def rank_sums_that_give(chi2: str, pairs: dict[str, tuple[int, int]]) -> list[tuple[int, ...]]:
    """All rank sums of 6 participants and 4 conditions, without ties, that agree with what is printed."""
    by_distance = {d: nemenyi_from_rank_sums((15 - d / 2, 15, 15, 15 + d / 2), 6)[0, 3] for d in range(19)}
    found = []
    for sums in product(range(6, 25), repeat=4):
        if sum(sums) == 60 and PRINTED[chi2].agrees(12.0 / 120.0 * sum(r * r for r in sums) - 90.0):
            apart = {name: abs(sums[i] - sums[j]) for name, (i, j) in pairs.items()}
            if all(PRINTED[name].agrees(by_distance[d]) for name, d in apart.items()):
                found.append(sums)
    return found


def test_a2_the_duration_p_is_0_037_and_the_rank_sums_are_known():
    # Printed 0.37: no two rank sums of six participants are apart by what gives it.
    every = [nemenyi_from_rank_sums((15 - d / 2, 15, 15, 15 + d / 2), 6)[0, 3] for d in range(19)]
    assert not any(PRINTED["duration_p_fc_others"].agrees(p) for p in every)
    sums = rank_sums_that_give("duration_chi2", {"duration_p_ctrl_pcfr": (0, 2), "duration_p_ctrl_clpc": (0, 3)})
    assert sums == [(9, 9, 21, 21), (21, 21, 9, 9)]  # the same, ranked from the other end
    p = nemenyi_from_rank_sums(sums[0], 6)
    assert p[1, 2] == p[1, 3] == p[0, 2] == pytest.approx(0.036648, rel=1e-4)
    assert PRINTED["duration_p_ctrl_pcfr"].agrees(p[1, 2])
    # Two conditions together cannot have less than 6 * (1 + 2): everyone was faster with both than with either other.
    assert sums[0][0] + sums[0][1] == 6 * 3

    pairs = {
        "velocity_p_ctrl_fc": (0, 1),
        "velocity_p_ctrl_pcfr": (0, 2),
        "velocity_p_ctrl_clpc": (0, 3),
        "velocity_p_fc_pcfr": (1, 2),
        "velocity_p_fc_clpc": (1, 3),
    }
    assert rank_sums_that_give("velocity_chi2", pairs) == [(7, 11, 20, 22), (23, 19, 10, 8)]
    # With three conditions 12 is the most there is: all six agree. The p printed is cut off, not rounded.
    emg = friedman(np.tile([1.0, 2.0, 3.0], (6, 1)))
    assert emg.statistic == PRINTED["emg_acc_chi2"].value
    p = nemenyi_from_rank_sums(emg.rank_sums, 6)
    assert p[0, 2] == pytest.approx(0.0015429, rel=1e-4)
    assert int(p[0, 2] * 1000.0) / 1000.0 == PRINTED["emg_acc_p_fc_clpc"].value
    assert not PRINTED["emg_acc_p_fc_clpc"].agrees(p[0, 2])
    assert p[0, 1] == p[1, 2] == pytest.approx(0.19323, rel=1e-4)


def test_a3_the_paired_test_is_right_and_says_little():
    rows = ABLE.tables["error"]
    cells = [(r["mean"], r["sd"]) for r in (rows["without_dissociation"], rows["with_dissociation"])]
    n = int(ABLE["trials_compared"])
    found = paired_test(
        ABLE["paired_t"], n, means=tuple(m.value for m, _ in cells), sds=tuple(s.value for _, s in cells)
    )
    ends = [2.0 * stats.t.sf(t, n - 1) for t in PRINTED["paired_t"].interval]
    assert ends[1] <= PRINTED["paired_p"].interval[1]
    assert ends[0] >= PRINTED["paired_p"].interval[0]
    assert PRINTED["error_ratio"].agrees(cells[0][0].value / cells[1][0].value)
    assert found.sd_of_differences == pytest.approx(0.0874, abs=5e-5)
    assert found.effect_size == pytest.approx(1.278, abs=5e-4)
    assert found.unpaired_t == pytest.approx(6.27, abs=0.01)  # pairing made the test weaker
    correlations = [
        paired_test(t, n, means=(a, b), sds=(c, d)).correlation
        for a, b, c, d, t in product(
            *(x.interval for x in (cells[0][0], cells[1][0], cells[0][1], cells[1][1], PRINTED["paired_t"]))
        )
    ]
    assert min(correlations) == pytest.approx(-0.565, abs=5e-4)
    assert max(correlations) == pytest.approx(-0.514, abs=5e-4)
    # Two of three kinds of trials were identified from.
    assert 2 * ABLE["trials_per_kind"] / n == pytest.approx(2.0 / 3.0)


def _sd_fits(cells, ddof: int) -> bool:
    least, most = sd_bounds(
        int(ABLE["participants"]),
        mean=cells["mean"].value,
        low=cells["min"].value,
        median=cells["median"].value,
        high=cells["max"].value,
        half_unit=cells["mean"].half_unit,
        ddof=ddof,
    )
    low, high = cells["sd"].interval
    return least <= high and low <= most


def test_a4_some_standard_deviations_cannot_be():
    impossible = {
        (table, row): [d for d in (0, 1) if not _sd_fits(cells, d)]
        for table in ("duration", "velocity", "isochrony")
        for row, cells in ABLE.tables[table].rows.items()
    }
    assert {where: how for where, how in impossible.items() if how} == {
        ("velocity", "clpc"): [0, 1],
        ("isochrony", "ctrl_up"): [1],
        ("isochrony", "fc_up"): [0],
        ("isochrony", "clpc_down"): [0],
    }
    cells = ABLE.tables["velocity"]["clpc"]
    known = {"mean": cells["mean"].value, "low": cells["min"].value, "median": cells["median"].value}
    least = [sd_bounds(6, **known, high=cells["max"].value, half_unit=0.0005, ddof=d)[0] for d in (1, 0)]
    assert least == pytest.approx([0.2359, 0.2153], abs=5e-5)
    # By hand: with both ends where they are, even four values at one point leave more than is printed.
    by_hand = np.sqrt(((1.116 - 0.776) ** 2 + (1.518 - 1.116) ** 2) / 6.0)
    assert by_hand > cells["sd"].interval[1]


# -------------------------------------------------------------------------------------------------------- Table II


def test_a5_the_inertia_is_negative_and_the_slider_has_five_masses():
    for direction, at, span, most, mass in (
        ("down", (-0.0070, -0.0137, -0.0221), (-0.4822, -0.0486), 0.0038, 125.5),
        ("up", (-0.0066, -0.0145, -0.0243), (-0.5079, -0.0129), 0.0059, 169.1),
    ):
        assert ELBOW.inertia(direction, RAIL).max() < 0.0
        assert ELBOW.inertia(direction, np.array([0.1, 0.2, 0.3])) == pytest.approx(at, abs=5e-5)
        positive = positive_inertia_range(ELBOW, direction)
        assert positive == pytest.approx(span, abs=5e-5)
        inside = np.linspace(*positive, 4001)[1:-1]
        assert ELBOW.inertia(direction, inside).min() > 0.0
        assert ELBOW.inertia(direction, inside).max() == pytest.approx(most, abs=5e-5)
        # Even there, a forearm's first moment wants a mass that no forearm has.
        assert least_mass(ELBOW, direction, inside).min() == pytest.approx(mass, abs=0.1)
    # Rounding is not to blame: with every digit moved its half unit towards a positive inertia it stays negative.
    for direction in ("down", "up"):
        row = ABLE.tables["elbow"][direction]
        a0, a1, a2 = (row[a].interval[1] for a in ("a0", "a1", "a2"))
        assert np.max(a0 + a1 * RAIL + a2 * RAIL**2) < 0.0
    ratios = [ELBOW.sets[d].m_x_slope / ELBOW.sets[d].inertia[2] for d in ("down", "up")]
    assert ratios == pytest.approx([-12.1, -17.5], abs=0.01)
    # The law itself, by adding up a forearm and a slider point by point.
    masses, places = np.array([0.7, 0.4, 0.5]), np.array([0.05, 0.2, 0.12])
    s = np.linspace(-0.2, 0.2, 9)
    r = places[:, None] + np.outer([0.0, 0.0, 1.0], s)
    moment, inertia = np.polyfit(s, masses @ r, 1), np.polyfit(s, masses @ r**2, 2)
    assert moment[0] == pytest.approx(inertia[0], rel=1e-9)
    assert inertia[0] == pytest.approx(0.5, rel=1e-9)


def test_a6_gravity_at_rest_lies_outside_that_in_motion():
    down, rest, up = (ELBOW.gravity(d, RAIL, 0.0) for d in ("down", "static", "up"))
    between = (rest >= np.minimum(down, up)) & (rest <= np.maximum(down, up))
    inside = RAIL[between]
    assert inside.min() == pytest.approx(0.38 / 1.22, abs=1e-3)
    assert inside.max() == pytest.approx(0.5, abs=1e-3)
    assert ELBOW.inertia("up", inside).max() < -0.02  # and there the inertia is at its worst
    # The only reading with an inertia: the slider counted backwards.
    back = ELBOW.gravity("static", -0.2, 0.0), ELBOW.gravity("down", -0.2, 0.0), ELBOW.gravity("up", -0.2, 0.0)
    assert back == pytest.approx((-2.765, -6.335, -8.885), abs=5e-4)
    assert back[0] / back[1] == pytest.approx(0.4365, abs=5e-4)
    short = abs(back[0] - back[1])
    assert short == pytest.approx(3.57, abs=5e-3)
    assert short > 29.0 * abs(ELBOW.sets["static"].adherence)  # what friction at rest could make up for
    behind = np.linspace(-0.5, 0.0, 501)
    down, rest, up = (ELBOW.gravity(d, behind, 0.0) for d in ("down", "static", "up"))
    assert np.all(rest > np.maximum(down, up))
    assert ELBOW.sets["static"].adherence < 0.0


def test_a7_the_friction_it_amounts_to_drives_the_motion():
    degrees = np.array([-30.0, 0.0, 30.0, 60.0])
    friction = implied_friction(ELBOW, np.array([0.2]), np.radians(degrees))[0]
    assert friction == pytest.approx([0.686, 0.136, -0.441, -0.890], abs=5e-4)
    # Up and down again between 20 and 60 degrees, as slowly as one likes: the motor gets work out of a passive joint.
    q = np.radians(np.linspace(20.0, 60.0, 2001))
    up = ELBOW.torque("up", 0.2, q, 1e-9, 0.0)
    down = ELBOW.torque("down", 0.2, q, -1e-9, 0.0)
    work = np.trapezoid(up - down, q)
    assert work == pytest.approx(-0.837, abs=1e-3)
    # Read as in A6, with the slider backwards and angles growing downward, it brakes but for the lowest angles.
    behind, angles = np.linspace(-0.3, -0.2, 11), np.radians(np.linspace(-30.0, 60.0, 91))
    friction = implied_friction(ELBOW, behind, angles, positive="down")
    assert friction.min() == pytest.approx(0.578, abs=5e-4)
    assert friction.max() == pytest.approx(2.01, abs=0.01)
    lowest = implied_friction(ELBOW, np.array([-0.2, -0.3]), np.radians([-60.0]), positive="down")[:, 0]
    assert lowest == pytest.approx([-0.302, -0.130], abs=5e-4)
    fine = np.radians(np.linspace(-60.0, 60.0, 1201))
    turning = fine[implied_friction(ELBOW, np.array([-0.2]), fine, positive="down")[0] < 0.0].max()
    assert np.degrees(turning) == pytest.approx(-49.8, abs=0.1)
    # However it is read, gravity changes by newton metres where the velocity passes zero.
    angles = np.radians(np.linspace(-60.0, 60.0, 121))
    jumps = {s: np.abs(ELBOW.gravity("up", s, angles) - ELBOW.gravity("down", s, angles)).max() for s in (0.2, -0.3)}
    assert list(jumps.values()) == pytest.approx([2.05, 3.94], abs=0.01)
    assert min(jumps.values()) > 27.0 * (ELBOW.sets["up"].coulomb + ELBOW.sets["down"].coulomb)


def test_a8_the_sine_has_the_wrong_sign():
    """The torque of a weight is its weight times how fast it rises: the derivative of eq. 2's height."""
    x, d, q, h = 0.13, 0.04, np.linspace(-1.0, 1.0, 21), 1e-5

    def height(q):
        return x * np.sin(q) + d * np.cos(q)

    rise = (height(q + h) - height(q - h)) / (2.0 * h)
    assert rise == pytest.approx(x * np.cos(q) - d * np.sin(q), abs=1e-9)
    as_printed = x * np.cos(q) + d * np.sin(q)
    assert np.abs(as_printed - rise).max() == pytest.approx(2.0 * d * np.sin(1.0), rel=1e-6)
    # What that would change in Table II, 30 degrees from the horizontal.
    assert 2.0 * GRAVITY * abs(ELBOW.sets["up"].m_y) * np.sin(np.radians(30.0)) == pytest.approx(3.53, abs=5e-3)


# -------------------------------------------------------------------------------------------------------- protocol


def test_a9_the_sweep_ends_at_7_rad_per_s():
    sweep = {"amplitude": ABLE["sweep_amplitude"], "start": ABLE["sweep_start"], "growth": ABLE["sweep_growth"]}
    end, fs = ABLE["sweep_duration"], 1000.0
    peaks = {}
    for literal, slope, turns in ((True, 6.0, 31), (False, 3.0, 19)):
        q, v, a = swept_sine(end, fs, **sweep, literal=literal)
        peaks[literal] = np.abs(v).max(), np.abs(a).max()
        # From the sine alone: how often it passes zero, and how soon it did the last time.
        zeros = np.flatnonzero(np.diff(np.sign(q))) / fs
        zeros = zeros[zeros > 0.01]
        assert len(zeros) == turns
        assert np.pi / (zeros[-1] - zeros[-2]) == pytest.approx(1.0 + slope * zeros[-2:].mean() / end, rel=5e-3)
    assert peaks[True] == pytest.approx((3.455, 24.25), rel=1e-3)
    assert peaks[False] == pytest.approx((2.0, 8.0), rel=0.03)
    intended = ABLE["sweep_start"] + ABLE["sweep_growth"]
    assert peaks[True][0] > 1.7 * sweep["amplitude"] * intended
    assert peaks[True][1] > 3.0 * sweep["amplitude"] * intended**2
    time = np.arange(25_000) / fs
    printed_as = sweep["amplitude"] * np.sin((sweep["start"] + sweep["growth"] * time / end) * time)
    assert swept_sine(end, fs, **sweep, literal=True)[0] == pytest.approx(printed_as, abs=1e-12)


def test_a10_the_inertia_law_is_no_torque():
    up, down = ABLE["inertia_exponent_up"], ABLE["inertia_exponent_down"]
    # J qd^k is in kg m^2 s^-k: a torque only for k = 2. The paper's -1, in units; a plain s passes as little.
    for unit in ("kg*m^2*s/rad", "kg*m^2*s"):
        assert to_si_factor(unit, None) == (1.0, 0.0)
        with pytest.raises(StudyError, match='expected "N\\*m"'):
            to_si_factor(unit, "N*m")
    assert to_si_factor("kg*m^2/s^2", "N*m") == (1.0, 0.0)
    # It grows without bound where the arm stops.
    slow = np.array([1.0, 0.1, 0.01])
    assert slow**up == pytest.approx([1.0, 10.0, 100.0])
    assert slow[-1] ** down == pytest.approx(6310.0, rel=1e-3)
    # A fractional power of a negative velocity is not a real number: going down would have to be positive.
    assert isinstance((-0.5) ** down, complex)
    assert abs(((-0.5) ** down).imag) > 1.0
    # It has nothing to do with acceleration: over one bell-shaped movement they are uncorrelated.
    time = np.linspace(0.0, 1.0, 20_001)
    q = minimum_jerk(time, 1.0, np.radians(36.0))
    v = np.gradient(q, time)
    a = np.gradient(v, time)
    moving = v >= 0.05 * v.max()
    for k in (up, down):
        assert abs(np.corrcoef(v[moving] ** k, a[moving])[0, 1]) < 1e-3
    # And with Table II's inertia it brakes, in both directions of the slider's printed coordinate.
    assert np.all(ELBOW.inertia("up", RAIL) * 0.5**up < 0.0)
    # The position-controlled law is said to have this term at 1 where it has none at all: of 1 N*m, against what the
    # arm's own inertia takes at most over 36 degrees in the mean duration.
    duration = ABLE.tables["duration"]["ctrl"]["mean"].value
    assert 0.0059 * 10.0 / np.sqrt(3.0) * np.radians(36.0) / duration**2 == pytest.approx(0.0234, abs=2e-4)


def test_a11_units_and_sides():
    with pytest.raises(StudyError):
        to_si_factor(ABLE.tables["elbow"]["up"]["viscous"].unit, "N*m*s/rad")
    assert to_si_factor("N*m*s/rad", "N*m*s/rad") == (1.0, 0.0)
    fastest = ABLE["highest_velocity"] * to_si_factor(PRINTED["highest_velocity"].unit, "rad/s")[0]
    assert fastest == pytest.approx(69.1, abs=0.05)
    # At the joint a whole turn would pass within one window of the filter on the current.
    window = ABLE["current_average"] / (1000.0 * ABLE["control_rate"])
    assert 1.0 / ABLE["highest_velocity"] < window
    assert fastest / (ABLE["sweep_start"] + ABLE["sweep_growth"]) > 17.0
    with pytest.raises(TypeError, match="torque_constant"):
        ELBOW.current(1.0)


def test_a12_two_filters_bias_what_is_identified():
    current = int(ABLE["current_average"]), 1000.0
    optics = int(ABLE["optical_average"]), ABLE["optical_rate"]
    assert moving_average.cutoff(*current) == pytest.approx(4.43, abs=5e-3)
    assert moving_average.cutoff(*optics) == pytest.approx(1.98, abs=5e-3)
    assert moving_average.delay(*current) == pytest.approx(0.0495, abs=1e-6)
    assert moving_average.delay(*optics) == pytest.approx(0.109, abs=5e-4)
    top = 7.0 / (2.0 * np.pi)
    assert 1.0 - moving_average.gain(*current, top) == pytest.approx(0.020, abs=5e-4)
    assert 1.0 - moving_average.gain(*optics, top) == pytest.approx(0.099, abs=5e-4)

    inertia, viscous = 0.1, 0.2
    sweep = swept_sine(25.0, 1000.0, amplitude=0.5, start=1.0, growth=3.0, literal=True)
    torque = inertia * sweep[2] + viscous * sweep[1]

    def identified(torque, velocity, acceleration):
        return np.linalg.lstsq(np.c_[acceleration, velocity], torque, rcond=None)[0]

    def average(x):
        return np.convolve(x, np.full(current[0], 1.0 / current[0]), mode="valid")

    same = identified(average(torque), average(sweep[1]), average(sweep[2]))
    assert same == pytest.approx([inertia, viscous], rel=1e-9)
    late = current[0] - 1
    causal = identified(average(torque), sweep[1][late:], sweep[2][late:])
    assert causal == pytest.approx([0.0842, 0.331], rel=1e-3)  # delayed current on undelayed motion
    centred = identified(average(torque), sweep[1][50:-49], sweep[2][50:-49])
    assert centred == pytest.approx([0.0985, 0.1988], rel=1e-3)  # without the delay, only what averaging takes away


# ---------------------------------------------------------------------------------------------------- participants


def test_a13_movements_are_more_peaked_than_minimum_jerk():
    time = np.linspace(0.0, 1.0, 200_001)
    velocity = np.gradient(minimum_jerk(time, 1.0, 1.0), time)
    lasting = between_thresholds(time, velocity)
    assert lasting == pytest.approx(0.8811, abs=1e-4)
    ideal = velocity.max() * lasting
    assert ideal == pytest.approx(1.652, abs=5e-4)
    amplitude = np.radians(np.mean([a.value for a in PRINTED["amplitudes"]]))
    found = {}
    for condition in ("ctrl", "fc", "pcfr", "clpc"):
        v, d = ABLE.tables["velocity"][condition], ABLE.tables["duration"][condition]
        found[condition] = v["mean"].value * d["mean"].value / amplitude
        # Means of a product differ from products of means by a covariance, which the deviations bound.
        if condition != "clpc":  # its deviation is A4's
            assert found[condition] - v["sd"].value * d["sd"].value / amplitude > 1.15 * ideal
    assert list(found.values()) == pytest.approx([2.157, 2.098, 2.096, 2.016], abs=1e-3)


def _filtered(duration: float, order: int) -> tuple[float, float]:
    """What the angle filter does to peak acceleration and to duration, as relative changes."""
    fs, amplitude = 1000.0, np.radians(36.0)
    time = np.arange(-3.0, 3.0 + duration, 1.0 / fs)
    angle = minimum_jerk(time, duration, amplitude)
    sos = signal.butter(order, ABLE["angle_filter_cutoff"], fs=fs, output="sos")
    velocity, smooth = (np.gradient(x, 1.0 / fs) for x in (angle, signal.sosfiltfilt(sos, angle)))
    peak = np.gradient(smooth, 1.0 / fs).max() / np.gradient(velocity, 1.0 / fs).max()
    return peak - 1.0, between_thresholds(time, smooth) / between_thresholds(time, velocity) - 1.0


def test_a14_the_angle_filter_favours_slow_movements():
    fast, slow = _filtered(0.6, 4), _filtered(1.09, 4)
    assert fast == pytest.approx((-0.060, 0.064), abs=2e-3)
    assert slow == pytest.approx((0.017, 0.015), abs=2e-3)
    # The index divides by peak acceleration: the same muscles and arm, and 8 % apart, for speed alone.
    assert (1.0 + slow[0]) / (1.0 + fast[0]) - 1.0 == pytest.approx(0.082, abs=3e-3)
    # The paper does not say whether the order counts both passes; if it does, more is lost.
    assert _filtered(0.6, 2) == pytest.approx((-0.111, 0.102), abs=2e-3)


def test_a15_full_coupling_takes_more_parameters():
    joints = 7
    chain = [set(range(i)) for i in range(joints)]
    full = [set(range(joints)) - {i} for i in range(joints)]
    assert chain_parameters(joints, 1) == listed_sets(chain) == 127
    assert coupled_parameters(joints, 1) == listed_sets(full) == 448
    assert chain_parameters(1, 9) == coupled_parameters(1, 9) == 9


def index(rms: np.ndarray, control: np.ndarray, largest: np.ndarray, acceleration: float = 1.0) -> float:
    """The paper's eq. 9 with both muscles normalised to their largest, accelerations relative to the control's."""
    return float(np.mean(rms / largest) / acceleration / np.mean(control / largest) - 1.0)


def test_a16_the_index_depends_on_how_muscles_were_normalised():
    control, law = np.array([1.0, 0.4]), np.array([1.1, 0.8])
    # One muscle: whatever it is normalised to cancels, whichever condition that came from.
    assert index(law[:1], control[:1], np.array([3.0])) == pytest.approx(index(law[:1], control[:1], np.array([9.0])))
    # Two: their largest values are weights. A burst under another law moves this law's index, its own data unchanged.
    before, after = (index(law, control, m) for m in (np.array([3.0, 3.0]), np.array([6.0, 3.0])))
    assert before == pytest.approx(0.357, abs=1e-3)
    assert after == pytest.approx(0.5, abs=1e-3)
    # The control's index is 0 for everyone, so only three conditions are ranked: two degrees of freedom, as printed.
    assert index(control, control, np.array([3.0, 5.0])) == 0.0
    assert PRINTED["emg_acc_p"].agrees(stats.chi2.sf(PRINTED["emg_acc_chi2"].value, 2))
    assert not PRINTED["emg_acc_p"].agrees(stats.chi2.sf(PRINTED["emg_acc_chi2"].value, 3))
    with pytest.raises(PellucidError):
        friedman(np.zeros((6, 2)))  # a condition against itself ranks nothing


# ---------------------------------------------------------------------------------------------------- the document


def test_the_published_model_points_to_these_errata():
    assert {i.erratum for i in inconsistencies(ELBOW)} == {"A5", "A6", "A7"}
