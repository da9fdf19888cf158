"""Causes that verdicts name: each spoilt study gets its own, first; sound ones, virtual and real, get none."""

import re
import shutil

import numpy as np
import pytest

from pellucid.joint.fit.friction_family import fit_family
from pellucid.joint.fit.headline_choice import HeadlineChoice
from pellucid.joint.fit.joint_estimate import measure_excitation
from pellucid.joint.fit.replay import Machine
from pellucid.joint.study import joint_findings
from pellucid.joint.study.joint_case import JointCase
from pellucid.models.joint import joint_model
from pellucid.numerics.motion import Filtering, motion_of
from pellucid.numerics.regression import stack
from pellucid.study.datasets import init
from pellucid.study.procedures.registry import open_study
from pellucid.study.procedures.run import check, identify
from pellucid_lab.bench.rig import bench_joint
from pellucid_lab.study import write_study

CAUSES = {"contradicting_recordings", "wrong_unit", "angle_zero", "drive_constant"}
RIG = bench_joint()


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    return write_study(tmp_path_factory.mktemp("lab") / "sound", RIG, name="sound", seed=1)


@pytest.fixture
def spoilt(sound, tmp_path):
    """Copies the sound study; its recordings may be changed by column."""

    class Copy:
        folder = tmp_path / "spoilt"

        def toml(self, old, new):
            path = self.folder / "study.toml"
            text = path.read_text(encoding="utf-8")
            assert old in text
            path.write_text(text.replace(old, new), encoding="utf-8")

        def column(self, recording, name, change):
            path = self.folder / "recordings" / f"{recording}.csv"
            units, head, *rows = path.read_text(encoding="utf-8").splitlines()
            at = head.split(",").index(name)
            values = np.array([row.split(",") for row in rows], float)
            values[:, at] = change(values[:, at])
            np.savetxt(path, values, delimiter=",", header=f"{units}\n{head}", comments="", fmt="%.17g")

        def verdicts(self):
            return identify(open_study(self.folder), families=["symmetric", "load"], thorough=False).verdicts

    copy = Copy()
    shutil.copytree(sound.folder, copy.folder)
    return copy


def causes(verdicts):
    return [v.finding for v in verdicts if v.finding in CAUSES and v.kind == "wrong"]


def test_a_sound_study_gets_no_cause(spoilt):
    assert causes(spoilt.verdicts()) == []


def test_a_zero_that_is_off_is_told_with_what_to_write(spoilt):
    spoilt.toml('column = "position", unit = "rad"', 'column = "position", unit = "rad", offset = 0.2618')
    first, *_ = spoilt.verdicts()
    assert first.finding == "angle_zero"
    angle, half = map(float, re.search(r"angle of ([-\d.]+) ± ([\d.]+) deg", first.text).groups())
    assert angle == pytest.approx(15.0, abs=1.5)
    assert half < 2.0
    # What to write takes nearly all of it back.
    assert float(re.search(r"offset = ([-\d.]+) ", first.do).group(1)) == pytest.approx(0.0, abs=np.radians(1.5))


def test_degrees_and_radians_declared_as_each_other_are_named(sound, rng):
    t = np.arange(0.0, 30.0, 0.005)
    q = 0.8 * np.sin(0.9 * t) + 0.4 * np.sin(3.1 * t) + 0.1 * np.sin(8.0 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    effort = 0.05 * a + 1.5 * np.sin(q) + 0.2 * np.sign(v) + 0.05 * v + 0.01 * rng.standard_normal(len(t))
    cases = (
        (q, []),
        (np.degrees(q), ["The position is probably in degrees, not in radians as stated"]),
        (np.radians(q), ["The position is probably in radians, not in degrees as stated"]),
        (0.02 * q, []),
    )
    for i, (angle, expected) in enumerate(cases):
        if i == 3:
            effort = 0.05 * 0.02 * a + 1.5 * np.sin(angle) + 0.02 * np.sign(v) + 0.001 * v
        motion = motion_of(t, angle, effort, Filtering(10.0, 4, 10, 0.0, 100))
        model = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="sine")
        data = stack([motion])
        fit = fit_family(model, data, [motion], Machine(), level=0.95, thorough=False).fit
        case = JointCase(sound, (motion,), data, (motion,), {"symmetric": fit}, HeadlineChoice("symmetric", "ls"))
        told = joint_findings.report_wrong_unit(case)
        assert [v.text.partition(":")[0] for v in told] == expected


def test_a_recording_with_another_drive_contradicts_the_others(spoilt):
    spoilt.column("multisine", "current", lambda x: 2.0 * x)
    first, *_ = spoilt.verdicts()
    assert first.finding == "contradicting_recordings"
    # Of two fitted recordings neither is known to be the wrong one; held-out recordings must not decide it.
    assert "'multisine'" in first.text
    assert "contradicts" in first.text
    ratio = float(re.search(r"effort is ([\d.]+) times", first.text).group(1))
    assert max(ratio, 1.0 / ratio) == pytest.approx(2.0, rel=0.05)


def test_a_recording_with_another_zero_contradicts_the_others(spoilt):
    spoilt.column("multisine", "position", lambda x: x + 0.2618)
    first, *_ = spoilt.verdicts()
    assert first.finding == "contradicting_recordings"
    assert abs(float(re.search(r"reads ([-+\d.]+) deg", first.text).group(1))) == pytest.approx(15.0, abs=2.0)


def test_a_payload_that_is_not_stated_contradicts_in_inertia_and_gravity(spoilt, tmp_path):
    joint = RIG["joint"]
    heavy = {"joint.inertia": 2.5 * joint["inertia"], "joint.gravity_sine": 1.5 * joint["gravity_sine"]}
    other = write_study(tmp_path / "heavy", RIG.changed(heavy), name="heavy", seed=1)
    shutil.copy(other.folder / "recordings" / "multisine.csv", spoilt.folder / "recordings")
    first, *_ = spoilt.verdicts()
    assert first.finding == "contradicting_recordings"
    assert "Inertia is" in first.text
    assert "Gravity" in first.text
    assert "payload" in first.do


@pytest.mark.parametrize("name", ["emps", "sydney_pendulum", pytest.param("bam_xl330", marks=pytest.mark.nightly)])
def test_real_recordings_as_they_are_get_no_cause(name, data_folder, tmp_path):
    found = identify(init(tmp_path / name, dataset=name), families=["symmetric", "load"], thorough=False)
    assert causes(found.verdicts) == []


def test_what_a_motion_cannot_show_is_told_before_anything_is_fitted(sound):
    t = np.arange(0.0, 20.0, 0.01)
    model = joint_model("symmetric", motion="rotary", effort_unit="N*m", gravity="sine")

    def shown(position):
        return measure_excitation(
            model, stack([motion_of(t, position, np.zeros(len(t)), Filtering(5.0, 4, 5, 0.0, 100))])
        )

    narrow = shown(0.05 * np.sin(2.0 * t))  # one frequency over a few degrees: acceleration is proportional to sin q
    assert min(narrow.own["inertia"], narrow.own["gravity"]) < 0.02
    assert narrow.condition > 100.0
    wide = shown(1.0 * np.sin(0.7 * t) + 0.4 * np.sin(3.1 * t) + 0.1 * np.sin(9.0 * t))
    assert min(wide.own.values()) > 0.15
    (fault,) = [f for f in check(sound) if f.kind == "excitation"]
    assert fault.severity == "note"
    assert "every parameter is excited" in fault.message


def case_of(sound, rng, *, scale=1.0, load=0.0, families=("symmetric",)):
    t = np.arange(0.0, 40.0, 0.005)
    q = 0.8 * np.sin(0.9 * t) + 0.4 * np.sin(3.1 * t) + 0.1 * np.sin(8.0 * t)
    v, a = np.gradient(q, t), np.gradient(np.gradient(q, t), t)
    base = 0.05 * a + 4.0 * np.sin(q) + 0.3 * np.sign(v) + 0.05 * v
    effort = scale * (base / (1.0 - load * np.sign(v) * np.sign(base)) + 0.01 * rng.standard_normal(len(t)))
    motion = motion_of(t, q, effort, Filtering(10.0, 4, 10, 0.0, 100))
    data = stack([motion])
    models = [joint_model(f, motion="rotary", effort_unit="N*m", gravity="sine") for f in families]
    fits = {m.family: fit_family(m, data, [motion], Machine(), level=0.95, thorough=False).fit for m in models}
    return JointCase(sound, (motion,), data, (motion,), fits, HeadlineChoice(families[0], "ls"))


def test_friction_that_grows_with_the_load_is_told_where_no_fitted_family_has_it(sound, rng):
    """It biased gravity by several percent, and nothing warned of it."""
    for load, families, expected in ((0.0, ("symmetric",), 0), (0.1, ("symmetric",), 1), (0.1, ("load",), 0)):
        told = list(joint_findings.report_missing_load_friction(case_of(sound, rng, load=load, families=families)))
        assert len(told) == expected
    case = case_of(sound, rng, load=0.1, families=("symmetric",))
    assert case.fit.estimate["gravity"].value > 1.02 * 4.0
    (told,) = joint_findings.report_missing_load_friction(case)
    assert (told.kind, told.do) == ("warning", "Add 'load' to families in [model].")


def test_torques_in_a_wrong_unit_are_doubted(sound, rng):
    """N*mm that were read as N*m gave bounds of 10 kJ without a remark."""
    assert list(joint_findings.report_implausible_effort(case_of(sound, rng))) == []
    (told,) = joint_findings.report_implausible_effort(case_of(sound, rng, scale=1000.0))
    assert "require a mass of at least" in told.text
    assert "Check the unit of the effort" in told.do
