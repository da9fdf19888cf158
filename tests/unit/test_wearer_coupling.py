"""One wearer's strap: judged on swings that were not fitted, from both sides, and slips noticed."""

from dataclasses import replace

import numpy as np
import pytest
from two_bodies import Pair, record, swing

from pellucid._errors import IdentificationError
from pellucid.orthosis.strap.strap_model import CORE_NAMES, find_slip
from pellucid.orthosis.strap.wearer_coupling import coupling_verdicts, identify_wearer
from pellucid.orthosis.transfer.fit_transfer_function import fit_percent

PAIR = Pair()


@pytest.fixture(scope="module")
def truths():
    return swing(PAIR, seconds=16.0, count=3, substeps=2)


@pytest.fixture(scope="module")
def swings(truths):
    rng = np.random.default_rng(3)
    return [
        record(t, rng, name=f"swing_{i}", split="fitted" if i < 2 else "heldout", knee_noise=1.0)
        for i, t in enumerate(truths)
    ]


@pytest.fixture(scope="module")
def found(swings):
    return identify_wearer("S1", swings, PAIR.orthosis, limb=PAIR.limb, imu_sd=0.01)


def test_the_strap_explains_swings_it_was_not_fitted_on(found, truths):
    held = [j for j in found.evaluated if j.split == "heldout"]
    assert [j.recording for j in held] == ["swing_2"]
    assert fit_percent(truths[2].mismatch, held[0].predicted) > 90.0
    # Against the IMU no model does better than its error allows, but by chance.
    assert abs(found.mean_fit() - found.mean_ceiling()) < 5.0
    assert found.mean_fit() > found.mean_fit("published") + 10.0
    assert held[0].rmse == pytest.approx(0.01, rel=0.3)


def test_the_limb_s_side_is_worse_and_the_verdict_says_so(found):
    assert found.mean_fit("limb") < found.mean_fit()
    assert any("prefer the orthosis's torque balance" in v.text for v in found.verdicts)
    assert any("shows no inertia" in v.text for v in found.verdicts)
    # Two short swings and no torque held: what the strap's stiffness is in the end is not claimed.
    assert [v.text for v in found.verdicts if v.kind == "warning"] == [
        f"S1: the stiffness has no interval: {found.strap.stiffness.refused}."
    ]
    assert found.parameter("stiffness") is found.strap.stiffness
    assert found.parameter("inertia") is found.orthosis_side.inertia


def test_the_core_is_given_the_strap_as_it_is_else_the_spring_and_the_damper(found):
    named = dict(zip(CORE_NAMES, found.core, strict=True))
    assert named["strap_stiffness"] == found.strap.stiffness.value
    assert named["strap_damping"] == found.strap.damping.value
    alone = dict(zip(CORE_NAMES, replace(found, strap=None).core, strict=True))
    assert alone["strap_stiffness"] == found.orthosis_side.stiffness.value != named["strap_stiffness"]
    assert sum(value != 0.0 for value in alone.values()) == 2


def test_without_the_muscles_only_one_side_is_fitted(swings):
    one = identify_wearer("S1", [replace(s, knee_torque=None) for s in swings], PAIR.orthosis, limb=PAIR.limb)
    assert one.limb_side is None
    assert one.published == {}
    assert np.isnan(one.mean_ceiling())
    assert any("no torque of the muscles is known" in v.text for v in one.verdicts)


def slipped(swing):
    return replace(swing, imu_angle=swing.imu_angle + np.where(swing.imu_time > 9.0, np.radians(5.0), 0.0))


def test_a_strap_that_slips_is_noticed_and_its_trial_not_fitted(swings, found):
    made = identify_wearer("S1", [slipped(swings[0]), *swings[1:]], PAIR.orthosis, limb=PAIR.limb, imu_sd=0.01)
    assert [s.recording for s in made.slips] == ["swing_0"]
    assert made.slips[0].time == pytest.approx(9.08, abs=0.3)
    assert made.slips[0].step == pytest.approx(np.radians(5.0), rel=0.2)
    assert made.orthosis_side.stiffness.value == pytest.approx(PAIR.stiffness, rel=0.2)
    assert any(v.kind == "warning" and "the strap slipped by +" in v.text for v in made.verdicts)
    assert found.slips == ()


def test_a_slip_in_a_held_out_swing_is_told(swings):
    made = identify_wearer("S1", [*swings[:2], slipped(swings[2])], PAIR.orthosis)
    assert [s.recording for s in made.slips] == ["swing_2"]


def test_straps_that_all_slip_are_refused(swings):
    with pytest.raises(IdentificationError, match=r"S1: the strap slipped in every fitted swing \(swing_"):
        identify_wearer("S1", [slipped(s) for s in swings[:2]], PAIR.orthosis)


def test_no_slip_is_seen_in_coloured_noise():
    rng = np.random.default_rng(11)
    time = np.arange(400) * 0.05
    wrong = 0
    for _ in range(100):
        error = np.empty(400)
        state = 0.0
        for i in range(400):
            state = 0.8 * state + 0.6 * rng.standard_normal()
            error[i] = 0.02 * state
        wrong += find_slip("swing", time, error) is not None
    assert wrong <= 1


def test_nothing_to_fit_is_refused(swings):
    with pytest.raises(IdentificationError, match="S1: found no swing to fit"):
        identify_wearer("S1", [replace(s, split="heldout") for s in swings], PAIR.orthosis)


@pytest.mark.parametrize("holds", [0.5, 0.001])
@pytest.mark.parametrize("rejected", [False, True])
@pytest.mark.parametrize("limb_factor", [1.0, 3.0])
def test_verdicts_on_one_strap_never_contradict_each_other(found, holds, rejected, limb_factor):
    fit, other = found.orthosis_side, found.limb_side
    stiffness = replace(fit.stiffness, at_bound=rejected)
    limb = replace(other, stiffness=replace(fit.stiffness, value=limb_factor * fit.stiffness.value))
    strap = replace(found.strap, holds=holds)
    changed = replace(found, orthosis_side=replace(fit, stiffness=stiffness), limb_side=limb, strap=strap)
    said, decision = tuple(coupling_verdicts(changed)), changed.decision
    no_model = any("no strap model is accepted" in v.text for v in said)
    stopped = any("is rejected" in v.text for v in said)
    praised = [v.text for v in said if v.kind == "good"]
    assert (no_model, stopped) == (not decision.holds, bool(decision.rejected)) == (holds < 0.05, rejected)
    assert bool(praised) == (not no_model and not stopped)
    (sides,) = [v.text for v in said if "stiffnesses" in v.text]
    assert ("stiffnesses agree" in sides) == (limb_factor == 1.0)
    # Numbers that are said to agree are those that stand in the sentence.
    assert f"{limb.stiffness.value:.3g} ±" in sides
    assert f"{stiffness.value:.3g} ±" in sides
