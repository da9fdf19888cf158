"""People who point with the shank, free and in the knee orthosis."""

import numpy as np
import pytest

from pellucid._errors import StudyError
from pellucid.controllers.residual_compensator import design
from pellucid_lab.knee.worn_compensator import WornCompensator
from pellucid_lab.knee_pointing.conditions import LEG_CONDITIONS, leg_conditions
from pellucid_lab.knee_pointing.rig import KneePointingRig
from pellucid_lab.knee_pointing.session import CONTROL_CONDITION, LegSession
from pellucid_lab.known_rigs import load_rig
from pellucid_lab.safety.worn_knee import draw_worn_knee
from pellucid_lab.study import write_study

FEW = {"people.count": 1, "pointing.repetitions": 1, "pointing.amplitudes": (30.0,)}
"""One person and one movement each way."""


def one_person() -> KneePointingRig:
    return load_rig("knee-participants").changed(FEW).prepared(["zero_impedance", "no_power"])


def session(rig: KneePointingRig, condition: str, controller=None) -> LegSession:
    trial = next(trial for trial in rig.trials(1) if trial.condition == condition)
    return rig.session(trial, np.random.default_rng(3), controller)


def test_a_free_shank_meets_nothing_and_holds_its_targets():
    free = session(one_person(), CONTROL_CONDITION)
    assert np.all(free.signals["interaction"] == 0.0)
    assert all(movement.held for movement in free.movements)
    assert len(free.movements) == 2
    end = free.movements[0].end - 1
    assert abs(free.signals["position"][end] - free.movements[0].target) < 0.045


def test_an_orthosis_without_power_resists_more_than_its_torque_loop_and_no_orthosis():
    rig = one_person()
    torque = {
        name: float(np.sqrt(np.mean(session(rig, name).signals["interaction"] ** 2)))
        for name in (CONTROL_CONDITION, "zero_impedance", "no_power")
    }
    assert torque[CONTROL_CONDITION] == 0.0 < torque["zero_impedance"] < torque["no_power"]


def test_the_same_seed_gives_the_same_session_and_a_law_is_called():
    rig, worn = one_person(), draw_worn_knee(901)
    first, again = session(rig, "zero_impedance"), session(rig, "zero_impedance")
    assert np.array_equal(first.signals["position"], again.signals["position"])
    law = WornCompensator(design(worn.known.coupling, worn.rig.period), instruments=rig.robot.instruments)
    assert np.any(session(rig, "zero_impedance", law).signals["command"] != 0.0)


def test_the_study_states_its_margins_its_periods_and_reads_back(tmp_path):
    study = write_study(tmp_path / "knee", one_person(), name="knee", seed=1)
    entries = study.config.recordings
    assert sorted(entry.period for entry in entries) == [1, 2, 3]
    assert study.config.assessment.margins["estimand"] == "mean"
    assert {entry.condition for entry in entries} == {CONTROL_CONDITION, "zero_impedance", "no_power"}
    assert next(r for r in study.recordings() if r.condition == "no_power").optical is not None


def test_an_unknown_condition_is_refused_with_those_that_are_known():
    with pytest.raises(StudyError, match=f'no controller "springy", expected some of {", ".join(LEG_CONDITIONS)}'):
        leg_conditions(["springy"])
