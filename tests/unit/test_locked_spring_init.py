"""A series-elastic bench: `init --from` proposes its protocol by evidence, and `identify` finds the spring."""

import numpy as np
import pytest
from locked_bench import RATE_HZ, bench, write_bench

import pellucid as pl
from pellucid.joint.fit.spring_fit import fit_spring
from pellucid.numerics.motion import Filtering, motion_of
from pellucid.start.given_files import read_given
from pellucid.start.inference.locked_spring import find_locked_spring
from pellucid.start.inference.processing_choice import choose_processing
from pellucid.start.propose_study import propose_study

TWO = {"time [s]": "time", "motor_angle [rad]": "motor", "output_angle [rad]": "output", "torque [N*m]": "torque"}
ONE = {"time [s]": "time", "position [rad]": "motor", "torque [N*m]": "torque"}
NUMBERED = {"time [s]": "time", "q1 [rad]": "motor", "q2 [rad]": "output", "torque [N*m]": "torque"}
BARE = {"time": "time", "theta_m": "motor", "theta_l": "output", "tau": "torque"}


def assert_covers(parameter, true):
    low, high = parameter.interval()
    assert low < true < high


def fitted(**options):
    """Return the spring that is fitted to the deflections of two recordings, processed as `init` proposes."""
    motions = []
    for seed in (1, 2):
        time, motor, output, torque = bench(seed, **options)
        choice = choose_processing(motor - output, RATE_HZ)
        filtering = Filtering(choice.lowpass, decimate=choice.decimate, trim=choice.trim)
        more = {"gain": 1.0, "back_emf": 0.0, "fs": RATE_HZ, "start": "measured", "split": "fitted"}
        motions.append(motion_of(time, motor - output, torque, filtering, recording=str(seed), **more))
    return fit_spring(motions, coordinate="rad", effort="N*m")


@pytest.mark.parametrize("columns", [TWO, ONE], ids=["two angles", "one angle"])
def test_a_bench_becomes_a_study_of_a_locked_spring(tmp_path, columns):
    made = pl.init(tmp_path / "study", files=write_bench(tmp_path, columns), answers={})
    text = made.study_file.read_text()
    assert text.count('protocol = "locked_spring"') == 3
    assert "GUESS" in next(line for line in text.splitlines() if line.startswith("protocol"))
    study = pl.open(made.folder)
    assert not [fault for fault in pl.check(study) if fault.severity == "refuse"]
    found = pl.identify(study)
    assert_covers(found["stiffness"], 2500.0)
    assert found["stiffness"].value == pytest.approx(2500.0, rel=0.01)
    assert found.traces[-1].split == "heldout"
    assert found.traces[-1].error < 1.0


@pytest.mark.parametrize(
    "options",
    [
        {"stiffness": 50.0},
        {"stiffness": 50.0, "hysteresis": 4.0},
        {"stiffness": 500.0},
        {"stiffness": 20000.0},
        {"stiffness": 20000.0, "hysteresis": 2.0},
        {"stiffness": 20000.0, "quantum": 2.0 * np.pi / 2**14},
        {"hysteresis": 4.0},
        {"lock_stiffness": 5e4},
        {"torque_offset": -3.0, "largest": 15.0},
    ],
    ids=str,
)
def test_intervals_cover_springs_of_any_stiffness(options):
    found = fitted(**options)
    parameters = {p.name: p for p in found.parameters}
    true = options.get("stiffness", 2500.0)
    assert found.shape == "linear"
    assert_covers(parameters["stiffness"], true)
    assert parameters["stiffness"].value == pytest.approx(true, rel=0.03)
    if "hysteresis" in options:
        assert_covers(parameters["hysteresis"], options["hysteresis"])


@pytest.mark.parametrize("backlash", [0.002, 0.005, 0.01])
def test_backlash_is_found_and_the_stiffness_is_that_beyond_it(backlash):
    found = fitted(backlash=backlash)
    parameters = {p.name: p for p in found.parameters}
    assert found.shape == "backlash"
    assert_covers(parameters["stiffness"], 2500.0)
    assert_covers(parameters["backlash"], backlash)
    assert parameters["stiffness"].value == pytest.approx(2500.0, rel=0.03)
    assert found.effort_error < 0.7 * found.linear_error


def test_backlash_stands_among_the_verdicts(tmp_path):
    files = write_bench(tmp_path, TWO, seeds=(1, 2), backlash=0.005)
    found = pl.identify(pl.init(tmp_path / "study", files=files, answers={}).folder)
    (said,) = [v.text for v in found.verdicts if "backlash" in v.text]
    assert said.startswith("The spring has 0.28")
    assert found.traces[-1].error < 5.0


@pytest.mark.parametrize("columns", [TWO, ONE], ids=["two angles", "one angle"])
@pytest.mark.parametrize(
    "options",
    [{"stiffness": 50.0}, {"stiffness": 20000.0, "hysteresis": 2.0}, {"backlash": 0.005}, {"torque_offset": -3.0}],
    ids=str,
)
def test_springs_of_any_kind_are_proposed(tmp_path, columns, options):
    proposal = propose_study(read_given(write_bench(tmp_path, columns, seeds=(1, 2), **options)), "made")
    assert proposal.spring is not None
    assert {r.protocol for r in proposal.recordings} == {"locked_spring"}


@pytest.mark.parametrize("columns", [NUMBERED, BARE], ids=["numbered", "bare"])
def test_other_names_of_the_two_angles(tmp_path, columns):
    proposal = propose_study(read_given(write_bench(tmp_path, columns)), "made")
    assert proposal.spring is not None
    driven, locked, sign = proposal.spring.columns
    assert (columns[driven], columns[locked], sign) == ("motor", "output", 1)
    assert not proposal.main.roles.joints
    assert {r.protocol for r in proposal.recordings} == {"locked_spring"}


def test_a_torque_of_the_other_sign_turns_the_deflection_round():
    _, motor, output, torque = bench(4)
    angles = {"motor": motor, "output": output}
    found = find_locked_spring(angles, -torque, RATE_HZ, radians_per_unit=1.0, is_torque=True)
    assert found.columns == ("motor", "output", -1)


def swing(rng, *, reach, seconds=24.0, inertia=0.05, gravity=2.0, quantum=2.0 * np.pi / 2**14):
    """Angle and torque of a joint that swings about where it hangs."""
    t = np.arange(0.0, seconds, 1.0 / RATE_HZ)
    waves = ((1.0, 0.13), (0.6, 0.47), (0.3, 1.1))
    q = reach * sum(a * np.sin(2.0 * np.pi * f * t + rng.uniform(0.0, 6.28)) for a, f in waves)
    v = np.gradient(q, t)
    torque = inertia * np.gradient(v, t) + gravity * np.sin(q) + 0.02 * v + 0.03 * np.tanh(v / 0.01)
    return np.round(q / quantum) * quantum, torque + 0.005 * rng.standard_normal(len(t))


@pytest.mark.parametrize("reach", [0.03, 0.1, 0.5])
def test_a_pendulum_is_no_spring(rng, reach):
    for _ in range(4):
        q, torque = swing(rng, reach=reach)
        still = 0.4 + 1e-4 * rng.standard_normal(len(q))
        found = find_locked_spring({"q": q}, torque, RATE_HZ, radians_per_unit=1.0, is_torque=True)
        assert found is None
        # Of a series-elastic joint that moves, the output turns with the motor.
        both = {"motor": q + torque / 200.0, "output": q + 0.0 * still}
        assert find_locked_spring(both, torque, RATE_HZ, radians_per_unit=1.0, is_torque=True) is None


def test_a_slow_heavy_joint_is_no_spring(rng):
    """Its inertia hardly shows; its weight is one that robots have."""
    t = np.arange(0.0, 40.0, 1.0 / RATE_HZ)
    q = 0.04 * np.sin(2.0 * np.pi * 0.05 * t) + 2e-5 * rng.standard_normal(len(t))
    torque = 120.0 * q + 0.3 * rng.standard_normal(len(t))
    assert find_locked_spring({"q": q}, torque, RATE_HZ, radians_per_unit=1.0, is_torque=True) is None


@pytest.mark.parametrize("options", [{"largest": 8.0}, {"largest": 40.0}], ids=str)
def test_a_refusal_names_the_protocol(tmp_path, options):
    """Small deflections are held postures at one angle, large ones a motion that shows no friction or inertia."""
    (path,) = write_bench(tmp_path, ONE, seeds=(1,), **options)
    (tmp_path / "study.toml").write_text(
        f"""name = "bench"
[rig]
joint = "joint"
motion = "rotary"
[rig.drive]
kind = "torque"
[channels]
time = {{ column = "time [s]", unit = "s" }}
position = {{ column = "position [rad]", unit = "rad" }}
torque = {{ column = "torque [N*m]", unit = "N*m" }}
[processing]
lowpass = "10 Hz"
[[recordings]]
name = "only"
file = "{path.name}"
"""
    )
    study = pl.open(tmp_path)
    refused = [fault for fault in pl.check(study) if fault.severity == "refuse"]
    if not refused:
        found = pl.identify(study, families=["symmetric"], thorough=False)
        assert any('protocol = "locked_spring"' in v.do for v in found.verdicts)
        return
    assert any('protocol = "locked_spring"' in fault.message for fault in refused)
    with pytest.raises(pl.PellucidError, match='protocol = "locked_spring"'):
        pl.identify(study, families=["symmetric"], thorough=False)
