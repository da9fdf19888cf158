"""What used to be answered wrongly: rows of garbage, joints at rest, tumbling pendulums, worn robots."""

import numpy as np
import pytest

import pellucid as pl
from pellucid.files.defects.clipped import flat_tops
from pellucid.files.defects.magnitude import find_implausible
from pellucid.files.defects.rest import comes_to_rest
from pellucid.files.defects.worn import find_worn
from pellucid.files.recording import Channel
from pellucid.joint.fit.recording_agreement import find_friction_drift
from pellucid.joint.study.joint_faults import velocity_faults
from pellucid.joint.study.static_postures import posture_page
from pellucid.study.quality import inspect
from pellucid.units import parse_quantity

WITH_VELOCITY = ("[processing]", 'velocity = { column = "v", unit = "rad/s" }\n\n[processing]')


def said(study, *kinds):
    found = inspect(study.recording("sweep"), study)
    return [fault for fault in found if not kinds or fault.kind in kinds]


def test_nine_rows_of_garbage_are_one_line(make_study):
    columns = make_study.swing()
    clean = columns["q"].copy()
    for name, scale in (("t", 1e282), ("q", 1.125e282), ("i", -3e97)):
        columns[name] = np.concatenate([scale * np.linspace(1.0, -1.0, 9), columns[name]])
    study = make_study(columns)
    (fault,) = said(study)
    assert (fault.severity, fault.kind) == ("cut", "garbage")
    assert "the first 9 of 2009 rows of garbage: numbers up to 1.13e+282" in fault.found
    assert np.array_equal(study.recording("sweep")["position"], clean)


def test_time_that_runs_back_at_the_tail_is_one_line(make_study):
    columns = make_study.swing()
    columns = {name: np.append(x, x[:3]) for name, x in columns.items()}
    (fault,) = said(make_study(columns))
    assert (fault.severity, fault.kind) == ("cut", "garbage")
    assert "the last 3 of 2003 rows of garbage: time that does not advance" in fault.found


@pytest.mark.parametrize(("largest", "guessed"), [(90.0, "deg"), (2e4, ""), (1.125e282, "")])
def test_a_unit_is_not_guessed_beyond_ten_thousand(largest, guessed):
    found = find_implausible(Channel("position", np.linspace(0.0, largest, 50), "rad", "q"))
    assert found.probable_unit == guessed


def resting(columns: dict[str, np.ndarray], first: int = 700, last: int = 1100) -> dict[str, np.ndarray]:
    """The swing with a rest, during which the effort swings at a brake."""
    t = columns["t"]
    speed = np.gradient(columns["q"], t)
    inside = (np.arange(len(t)) >= first) & (np.arange(len(t)) < last)
    speed = np.where(inside, 0.0, speed)
    q = columns["q"].copy()
    q[inside] = q[first]
    q[last:] += q[first] - q[last - 1 + 1]
    effort = np.where(inside, 0.95 * np.abs(columns["i"]).max() * np.sin(9.0 * t), columns["i"])
    return columns | {"q": q, "i": effort, "v": speed}


def test_a_joint_that_rests_is_no_frozen_encoder(make_study):
    columns = resting(make_study.swing())
    assert said(make_study(columns), "frozen_encoder"), "without a velocity, nothing tells it from a frozen encoder"
    assert not said(make_study(columns, WITH_VELOCITY), "frozen_encoder")


def test_a_dwell_at_the_largest_angle_is_not_clipped(make_study):
    columns = make_study.swing()
    top = 0.7 * columns["q"].max()
    dwells = columns["q"] > top
    speed = np.where(dwells, 0.0, np.gradient(columns["q"], columns["t"]))
    columns |= {"q": np.minimum(columns["q"], top), "v": speed}
    assert said(make_study(columns), "clipped")
    assert not said(make_study(columns, WITH_VELOCITY), "clipped")


def test_the_last_digit_of_a_joint_at_rest_does_not_roll_over(make_study, rng):
    columns = make_study.swing()
    columns["q"] = 0.3 + 1e-4 * (rng.random(2000) < 0.01)
    columns["i"] = 0.3 + 0.01 * rng.standard_normal(2000)
    assert not said(make_study(columns), "wrap")


def test_a_static_posture_is_no_frozen_encoder(make_study, rng):
    columns = make_study.swing()
    columns |= {"q": np.full(2000, 0.4), "i": 0.29 + 0.004 * rng.standard_normal(2000)}
    assert not said(make_study(columns), "frozen_encoder")


def tumbling(fs: float = 500.0, seconds: float = 12.0, speed: float = 17.0) -> dict[str, np.ndarray]:
    """A pendulum that was thrown and turns over several times before it swings."""
    n, substeps = int(fs * seconds), 10
    q, v, made = 0.0, speed, []
    for k in range(n):
        drive = 0.05 * np.sin(3.0 * k / fs)
        made.append((k / fs, q, drive / 2.0))
        for _ in range(substeps):
            v += (drive - 0.9 * np.sin(q) - 0.006 * v - 0.01 * np.tanh(v / 0.02)) / 0.03 / (fs * substeps)
            q += v / (fs * substeps)
    return dict(zip(("t", "q", "i"), np.array(made).T, strict=True))


def test_a_tumbling_pendulum_is_not_in_degrees(make_study):
    columns = tumbling()
    assert columns["q"].max() > 25.0
    assert not said(make_study(columns), "magnitude")
    degrees = make_study.swing()
    degrees["q"] = np.degrees(degrees["q"])
    (fault,) = said(make_study(degrees), "magnitude")
    assert (fault.severity, "deg" in fault.found) == ("refuse", True)


def test_a_constant_speed_is_not_clipped(make_study):
    t = np.arange(4000) / 200.0
    speed = np.clip(1.6 * np.sin(0.9 * t), -0.8, 0.8)
    columns = {"t": t, "q": np.cumsum(speed) / 200.0, "i": 0.2 * np.tanh(speed / 0.05) + 0.1 * speed, "v": speed}
    change = ("[processing]", '[processing]\nvelocity = "recorded"')
    study = make_study(columns, WITH_VELOCITY, change)
    assert not [fault for fault in said(study, "clipped") if fault.channel == "velocity"]
    columns["q"] = np.cumsum(1.6 * np.sin(0.9 * t)) / 200.0
    assert [f for f in said(make_study(columns, WITH_VELOCITY, change), "clipped") if f.channel == "velocity"]


def test_a_velocity_without_a_position_is_integrated(make_study):
    columns = make_study.swing()
    speed = np.gradient(columns["q"], columns["t"])
    study = make_study(
        {"t": columns["t"], "i": columns["i"], "q": speed},
        ('position = { column = "q", unit = "rad" }', 'velocity = { column = "q", unit = "rad/s" }'),
    )
    recording = study.recording("sweep")
    assert not said(study, "missing_channel")
    moved = columns["q"] - columns["q"][0]
    assert np.abs(recording["position"] - moved).max() < 2e-3


@pytest.mark.parametrize(
    ("unit", "effort", "gravity"),
    [("rpm", "torque [Nm]", 'gravity = "sine+cosine"'), ("mm/s", "current [A]", 'motion = "prismatic"')],
)
def test_init_check_and_identify_agree_on_a_velocity_without_a_position(tmp_path, make_study, unit, effort, gravity):
    columns, files = make_study.swing(), []
    speed = np.gradient(columns["q"], columns["t"]) * {"rpm": 30.0 / np.pi, "mm/s": 1000.0}[unit]
    for name, half in (("a", slice(0, 1200)), ("b", slice(1200, None))):
        path = tmp_path / f"{name}.csv"
        rows = np.column_stack([columns["t"], speed, columns["i"]])[half]
        np.savetxt(path, rows, "%.9g", ",", header=f"time [s],speed [{unit}],{effort}", comments="")
        files.append(path)
    study = pl.open(pl.init(tmp_path / "study", files=files).folder)
    assert gravity in (study.folder / "study.toml").read_text(encoding="utf-8")
    notes = [fault for fault in pl.check(study) if fault.kind == "integrated"]
    said = "integrated from 0, expected recordings that all start at the same angle"
    assert [said in n.message for n in notes] == [True] * (unit == "rpm")
    assert {"inertia", "mass"} & set(pl.identify(study, families=["symmetric"]).estimates)


def test_the_zero_of_an_integrated_velocity_is_corrected_by_a_free_zero(make_study):
    """A study that says sine has no position to write an offset at."""
    columns = make_study.swing()
    gravity = np.sin(columns["q"] + 0.6) * 3.0
    columns["i"] = columns["i"] + gravity
    speed = np.gradient(columns["q"], columns["t"])
    changes = ('position = { column = "q", unit = "rad" }', 'velocity = { column = "q", unit = "rad/s" }')
    study = make_study({**columns, "q": speed}, changes)
    verdicts = pl.identify(study, families=["symmetric"]).verdicts
    (zero,) = [v for v in verdicts if "zero of the angle" in v.text]
    assert zero.do == 'Write gravity = "sine+cosine" in [model].'


def at_speeds(speeds, rng, fs: float = 200.0, seconds: float = 6.0) -> dict[str, np.ndarray]:
    """A joint that turns at one speed after another, as for a map of its friction."""
    ramp = 0.5 - 0.5 * np.cos(np.pi * np.arange(60) / 60.0)
    shape = np.concatenate([ramp, np.ones(round(seconds * fs) - 120), ramp[::-1]])
    v = np.concatenate([speed * shape for speed in speeds])
    friction = 0.2 * np.tanh(v / 0.01) + 0.1 * v + 0.05 * np.gradient(v) * fs
    return {
        "t": np.arange(len(v)) / fs, "q": np.cumsum(v) / fs, "v": v,
        "i": friction + 0.002 * rng.standard_normal(len(v)),
    }  # fmt: skip


NO_GRAVITY = ("[processing]", '[model]\ngravity = "none"\n\n[processing]\ndead_band = "0.05 rad/s"')


def test_a_map_at_constant_speeds_is_not_refused(make_study, rng):
    columns = at_speeds((0.5, -0.5, 2.0, -2.0, 5.0, -5.0), rng)
    (fault,) = said(make_study(columns, NO_GRAVITY), "magnitude")
    assert (fault.severity, "turns at constant speeds, which looks like deg" in fault.found) == ("warn", True)
    result = pl.identify(make_study(columns, NO_GRAVITY), families=["symmetric"], thorough=False)
    assert result["coulomb"].value == pytest.approx(0.4, rel=0.02)  # 2 N*m/A
    assert result["viscous"].value == pytest.approx(0.2, rel=0.02)


def test_a_map_whose_speed_alone_is_recorded_has_nothing_to_doubt(make_study, rng):
    columns = at_speeds((0.5, -0.5, 2.0, -2.0, 5.0, -5.0), rng)
    only = ('position = { column = "q", unit = "rad" }', 'velocity = { column = "v", unit = "rad/s" }')
    assert not said(make_study(columns, only, NO_GRAVITY), "magnitude")
    columns["v"] = np.full(len(columns["t"]), 3.0) + 1e-3 * rng.standard_normal(len(columns["t"]))
    assert not velocity_faults(make_study(columns, only, NO_GRAVITY))


def test_a_length_that_a_program_rounded_is_zero():
    assert parse_quantity("1.9e-17 m", "m", "d") == 0.0
    with pytest.raises(pl.PellucidError, match="expected 0 or from"):
        parse_quantity("5e-324 N*m/A", "N*m/A", "torque_constant")


def worn(seed: int, seconds: float = 24.0, fs: float = 200.0) -> dict[str, np.ndarray]:
    """A hip that walks, and an assistance that the gait's phase decides: no equation of a machine made this."""
    rng = np.random.default_rng(seed)
    t = np.arange(int(seconds * fs)) / fs
    cadence = 0.9 + 0.1 * np.interp(t, np.linspace(0.0, seconds, 12), rng.standard_normal(12))
    phase = 2.0 * np.pi * np.cumsum(cadence) / fs
    q = 0.35 * np.sin(phase) + 0.08 * np.sin(2.0 * phase + 0.7) + 0.02 * np.sin(3.0 * phase)
    asked = 3.0 * np.exp(2.5 * (np.cos(phase - 2.6) - 1.0)) - 4.0 * np.exp(3.0 * (np.cos(phase + 0.9) - 1.0))
    late = np.interp(t - 0.072, t, asked)
    return {"t": t, "q": q, "i": late / 2.0 + 0.01 * rng.standard_normal(len(t)), "d": asked / 2.0}


@pytest.mark.parametrize("seed", range(3))
def test_a_worn_hip_is_found_and_a_machine_is_not(make_study, seed):
    columns = worn(seed)
    found = find_worn(columns["t"], columns["q"], columns["i"])
    assert found is not None
    assert any("no bearing has" in reason or "as people do" in reason for reason in found.reasons)
    swing = make_study.swing(4800)
    assert find_worn(swing["t"], swing["q"], swing["i"]) is None
    assert find_worn(swing["t"], swing["q"], -swing["i"]) is None, "a wrong sign is no wearer"


def test_a_worn_robot_is_said_first_and_nothing_is_moved(make_study):
    from pellucid.joint.study.aligned_motions import find_alignments

    columns = worn(0)
    study = make_study(columns, ("[processing]", 'desired_current = { column = "d", unit = "A" }\n\n[processing]'))
    faults = pl.check(study)
    warned = [fault for fault in faults if fault.severity == "warn"]
    assert warned[0].kind == "worn"
    assert "it was probably worn" in warned[0].message
    (echo,) = [fault for fault in faults if fault.kind == "echoed"]
    assert "a copy of the command desired_current, delayed by 7" in echo.found
    assert find_alignments(study) == ()


def test_static_postures_give_the_weight(make_study, rng):
    """A study of postures passes check, and identify finds the weight that was put in: 1.5 N m over 2 N m/A."""
    n, entries, tables = 400, "", []
    for k, angle in enumerate((-0.9, -0.4, 0.1, 0.5, 1.0)):
        effort = (1.5 * np.sin(angle) + 0.05) / 2.0 + 0.004 * rng.standard_normal(n)
        tables.append({"t": np.arange(n) / 200.0, "q": angle + 1e-4 * (rng.random(n) < 0.05), "i": effort})
        use = "validate" if k == 3 else "fit"
        entries += f'\n[[recordings]]\nname = "p{k}"\nfile = "recordings/p{k}.csv"\nuse = "{use}"\n' if k else ""
    study = make_study(tables[0], append=entries)
    for k, columns in enumerate(tables[1:], 1):
        path = study.folder / "recordings" / f"p{k}.csv"
        np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header="t,q,i", comments="")
    faults = pl.check(study)
    assert not [fault for fault in faults if fault.severity in ("refuse", "cut")], faults
    found = pl.identify(study)
    assert abs(found["gravity"].value - 1.5) < 0.02
    assert "weight" in found.headline
    assert [row.split for row in found.rows if ".rms." in row.id] == ["fitted", "heldout"]
    assert found.judged[0][1] == pytest.approx(1.5 * np.sin(0.5) + 0.05, abs=0.01)
    page = posture_page(study, found)
    assert page.figure is not None
    assert page.figure.name == "postures"
    assert page.answer is not None
    assert page.answer.verdict == "yes"
    assert page.answer.sentence.startswith("weight 1.5")
    assert "between -52 and 57 deg" in page.answer.sentence


def test_an_effort_that_falls_silent_is_cut_out(make_study, rng):
    columns = make_study.swing()
    columns["i"] = columns["i"] + 0.002 * rng.standard_normal(2000)
    columns["i"][1850:] = 0.0
    (fault,) = said(make_study(columns), "dead_effort")
    assert fault.severity == "cut"
    assert "while the joint moves" in fault.found


def test_friction_that_drifts_is_measured(rng):
    time = np.arange(4000) / 200.0
    velocity = np.sin(3.0 * time)
    warm = 0.4 * np.exp(-time / 6.0)
    drift = find_friction_drift(time, velocity, (warm - warm.mean()) * np.sign(velocity))
    assert drift.z_value < -4.0
    assert drift.change == pytest.approx(-0.4, abs=0.15)
    steady = find_friction_drift(time, velocity, 0.05 * rng.standard_normal(4000))
    assert abs(steady.z_value) < 4.0
    assert find_friction_drift(time[:50], velocity[:50], velocity[:50]) is None


def test_a_joint_that_brakes_at_its_end_rests_there_and_a_sensor_that_ends_does_not():
    t = np.arange(0.0, 20.0, 0.005)
    trapezoid = 0.2 * np.maximum(np.abs((t % 8.0) - 4.0) - 0.15, 0.0)  # 0.2 rad/s, and 0.3 s of rest
    kernel = np.hanning(31) / np.hanning(31).sum()
    quantum = 2.0 * np.pi / 16384
    braked = np.round(np.convolve(np.pad(trapezoid, 15, mode="edge"), kernel, "valid") / quantum) * quantum
    peak = np.minimum(np.round(-np.cos(2.0 * np.pi * 0.5 * t) / quantum) * quantum, 0.8)
    for x, expected in ((-braked, True), (peak, False)):
        firsts, lengths = flat_tops(x)
        assert len(firsts) > 0
        for first, length in zip(firsts, lengths, strict=True):
            assert comes_to_rest(x, first, first + length - 1) == expected
