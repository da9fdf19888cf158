"""Units of angles that no file states: each is fitted, physics decides, and any consistent answer is accepted."""

import numpy as np
import pytest
from typer.testing import CliRunner

import pellucid as pl
from pellucid.cli import app
from pellucid.start.given_files import read_given
from pellucid.start.inference.motion_efforts import FULL_TURNS, motion_samples, weigh_turns
from pellucid.start.propose_study import propose_study, require_agreeing_units

TURNS = {"deg": 360.0, "rad": 2.0 * np.pi, "turn": 1.0, "counts": 4096.0}


def joint(amplitude, gravity=2.0, seed=0, seconds=40.0, rate=200.0):
    """Return time [s], angle [rad] and torque [N*m] of a joint that turns by about twice `amplitude` [rad]."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, seconds, 1.0 / rate)
    parts = [(0.5, 0.13), (0.3, 0.47), (0.15, 1.1)]
    phases = rng.uniform(0.0, 2.0 * np.pi, 3)
    q = amplitude * sum(a * np.sin(2 * np.pi * f * t + p) for (a, f), p in zip(parts, phases, strict=True))
    v = np.gradient(q, t)
    tau = 0.05 * np.gradient(v, t) + gravity * np.sin(q) + 0.1 * v + 0.3 * np.tanh(v / 0.01)
    return t, q, tau + 0.01 * rng.standard_normal(t.size)


def written(folder, unit, t, q, tau, speed=None, head="velocity"):
    numbers = q * TURNS[unit] / (2.0 * np.pi)
    columns = [t, np.round(numbers) if unit == "counts" else numbers, tau]
    names = ["time", "position", "torque [Nm]"]
    if speed is not None:
        columns.insert(2, speed)
        names.insert(2, head)
    path = folder / "log.csv"
    rows = "\n".join(",".join(f"{x:.7g}" for x in row) for row in zip(*columns, strict=True))
    path.write_text(",".join(names) + f"\n{rows}\n")
    return path


def proposed(path, **answers):
    proposal = propose_study(read_given([path]), "made", answers)
    (role,) = [r for r in proposal.main.channels if r.quantity == "position"]
    return proposal, role


@pytest.mark.parametrize(
    ("amplitude", "gravity"), [(1.0, 2.0), (5.0, 2.0), (12.0, 2.0), (30.0, 2.0), (6.0, 0.2)], ids=str
)
@pytest.mark.parametrize("unit", TURNS)
def test_gravity_decides_the_unit_of_an_angle(tmp_path, unit, amplitude, gravity):
    proposal, role = proposed(written(tmp_path, unit, *joint(amplitude, gravity)))
    assert (role.unit, role.unit_is_certain or unit == "counts") == (unit, True)
    assert proposal.gravity == "sine+cosine"
    assert "position_unit" not in {question.key for question in (*proposal.asked, *proposal.marked)}


@pytest.mark.parametrize("unit", ["deg", "rad", "turn"])
def test_nothing_is_decided_without_gravity(tmp_path, unit):
    """Inertia and friction are the same in each unit."""
    proposal, _ = proposed(written(tmp_path, unit, *joint(1.5, gravity=0.0)))
    asked = {question.key: question for question in proposal.asked}
    assert {"deg", "rad", "turn", "counts"} <= set(asked["position_unit"].choices)


@pytest.mark.parametrize("unit", ["deg", "rad", "turn"])
def test_a_spring_decides_no_wrong_unit(tmp_path, unit):
    """A sine that hardly bends fits a spring, whatever the unit."""
    t, q, tau = joint(1.5, gravity=0.0)
    _, role = proposed(written(tmp_path, unit, t, q, tau + 1.2 * q))
    assert role.unit == unit or not role.unit_is_certain


@pytest.mark.parametrize(
    ("unit", "speed_unit", "ratio"),
    [
        ("turn", "rpm", 30.0 / np.pi), ("turn", "rad/s", 1.0), ("turn", "turns/s", 0.5 / np.pi),
        ("turn", "deg/s", 180.0 / np.pi), ("rad", "turns/s", 0.5 / np.pi), ("rad", "rad/s", 1.0),
        ("deg", "rad/s", 1.0), ("deg", "turns/s", 0.5 / np.pi),
    ],
)  # fmt: skip
def test_a_speed_with_a_unit_decides_the_unit_of_its_angle(tmp_path, unit, speed_unit, ratio):
    t, q, tau = joint(4.0, gravity=0.0)
    path = written(tmp_path, unit, t, q, tau, ratio * np.gradient(q, t), f"velocity [{speed_unit}]")
    _, role = proposed(path)
    assert (role.unit, role.unit_is_certain) == (unit, True)


@pytest.mark.parametrize(
    ("unit", "amplitude"), [("rad", 6.0), ("rad", 30.0), ("turn", 30.0), ("deg", 30.0), ("counts", 30.0)]
)
@pytest.mark.parametrize("with_speed", [False, True])
def test_check_accepts_an_answer_that_is_consistent(tmp_path, unit, amplitude, with_speed):
    t, q, tau = joint(amplitude, gravity=0.0)
    speed = np.gradient(q, t) * TURNS[unit] / (2.0 * np.pi) if with_speed else None
    path = written(tmp_path, unit, t, q, tau, speed)
    answers = {"counts_per_turn": "4096"} if unit == "counts" else {"position_unit": unit}
    made = pl.init(tmp_path / "study", files=[path], answers=answers)
    done = CliRunner().invoke(app, ["check", str(made.folder)])
    assert done.exit_code == 0, done.output
    study = pl.open(made.folder)
    recorded = np.concatenate([recording["position"] for recording in study.recordings()])
    assert np.ptp(recorded) == pytest.approx(np.ptp(q), rel=0.02)


def test_the_answer_counts_takes_counts_of_a_turn(tmp_path):
    path = written(tmp_path, "rad", *joint(1.0, gravity=0.0))
    _, role = proposed(path, position_unit="counts", counts_per_turn="1000")
    assert (role.unit, role.keys["counts_per_turn"]) == ("counts", 1000)
    with pytest.raises(pl.PellucidError, match='position_unit: found "cubits", expected "deg", "rad"'):
        proposed(path, position_unit="cubits")


@pytest.mark.parametrize(("unit", "motion"), [("um", "prismatic"), ("mm", "prismatic"), ("rad", "rotary")])
def test_an_answer_in_a_unit_of_length_makes_the_joint_prismatic(tmp_path, unit, motion):
    """An answer in micrometres made a rotary joint."""
    path = written(tmp_path, "rad", *joint(1.0, gravity=0.0))
    proposal, role = proposed(path, position_unit=unit)
    assert (proposal.motion, role.unit) == (motion, unit)


def test_a_speed_follows_from_the_answer_by_the_ratio_of_both(tmp_path):
    t, q, tau = joint(1.5, gravity=0.0)
    path = written(tmp_path, "deg", t, q, tau, np.gradient(q, t))
    proposal, _ = proposed(path, position_unit="deg")
    (speed,) = [r for r in proposal.main.channels if r.quantity == "velocity"]
    assert speed.unit == "rad/s"


def test_a_joint_that_hardly_moves_is_not_decided():
    t, q, tau = joint(0.1)
    assert not weigh_turns(tau, motion_samples(q, t), FULL_TURNS).is_decided()


def random_joint(seed, per_turn, is_count):
    """Return time [s], position and torque [N*m] of a joint with random zero, weight, friction, inertia and range."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 40.0, 0.005)
    w = 2.0 * np.pi * np.arange(1, 11) * 0.1
    sizes, phases = rng.normal(size=10) / w, rng.uniform(0.0, 2.0 * np.pi, 10)
    turned = np.outer(t, w) + phases
    q = np.sin(turned) @ sizes
    size = rng.uniform(0.3, 2.0) / np.max(np.abs(q))
    q, v, a = size * q, size * np.cos(turned) @ (sizes * w), -size * np.sin(turned) @ (sizes * w**2)
    weight, inertia, viscous, coulomb = rng.uniform((0.3, 0.02, 0.0, 0.0), (6.0, 0.2, 0.3, 0.6))
    creep = 10.0 ** rng.uniform(-2.5, -0.5)
    tau = weight * np.sin(q + rng.uniform(-np.pi, np.pi)) + inertia * a + viscous * v + coulomb * np.tanh(v / creep)
    tau += rng.uniform(0.005, 0.1) * rng.standard_normal(t.size)
    x = (q + rng.uniform(-3.0, 3.0)) * per_turn / (2.0 * np.pi)
    return t, np.round(x) if is_count else x, tau


def verdict(folder, seed, per_turn, is_count):
    """Return "asked", "right" or "wrong" by what a proposal takes for one turn."""
    path = folder / f"{seed}-{per_turn:.0f}.csv"
    columns = np.column_stack(random_joint(seed, per_turn, is_count))
    np.savetxt(path, columns, delimiter=",", header="time,position,torque", comments="", fmt="%.7g")
    proposal, role = proposed(path)
    if {"position_unit", "counts_per_turn"} & {question.key for question in (*proposal.asked, *proposal.marked)}:
        return "asked"
    return "right" if role.keys.get("counts_per_turn", TURNS[role.unit]) == per_turn else "wrong"


def test_random_joints_decide_their_unit_or_ask(tmp_path):
    """Whatever the zero, weight, friction and range: no unit is wrong, and most are found."""
    found = [
        verdict(tmp_path, seed, turn, is_count=False)
        for turn in (360.0, 2.0 * np.pi, 1.0) for seed in range(200, 204)
    ]  # fmt: skip
    assert "wrong" not in found
    assert found.count("right") >= 0.5 * len(found)
    counts = [verdict(tmp_path, seed, turn, True) for turn in (16384.0, 65536.0) for seed in range(200, 203)]
    assert "wrong" not in counts
    assert "right" in counts


def test_a_turn_that_is_no_candidates_is_asked(tmp_path):
    """Behind a gear, the nearest unit or division is not the true one."""
    turns = [(1080.0, False), (6.0 * np.pi, False), (14000.0, True), (51200.0, True)]
    found = [verdict(tmp_path, seed, turn, is_count) for turn, is_count in turns for seed in range(300, 303)]
    assert set(found) == {"asked"}


def test_stated_units_that_contradict_each_other_are_refused(tmp_path):
    """An angle in rad under the heading of degrees, beside its derivative in rad/s."""
    t, q, tau = joint(1.5)
    columns = np.column_stack((t, q, np.gradient(q, t), tau))
    path = tmp_path / "log.csv"
    for angle, speed, agree in (("deg", "rad/s", False), ("rad", "deg/s", False), ("rad", "rad/s", True)):
        head = f"time [s],angle [{angle}],velocity [{speed}],torque [Nm]"
        np.savetxt(path, columns, delimiter=",", header=head, comments="", fmt="%.7g")
        proposal = propose_study(read_given([path]), "made", {})
        if agree:
            require_agreeing_units(proposal)
            continue
        found = rf'log.csv: columns "angle .{angle}." and "velocity .{speed}.": found .* expected'
        with pytest.raises(pl.PellucidError, match=found):
            require_agreeing_units(proposal)
    path.write_text(path.read_text().replace("angle [rad]", "angle [deg]"))
    done = CliRunner().invoke(app, ["init", str(tmp_path / "study"), "--from", str(path), "--yes"])
    assert done.exit_code != 0
    assert not (tmp_path / "study").exists()
