"""A worn orthosis, stage by stage, on the virtual rig: what is found, what is told, and recordings that are wrong."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid._errors import IdentificationError
from pellucid.files.recording import Channel
from pellucid.orthosis.study.coupling.coupling_page import page
from pellucid.orthosis.study.coupling.identify_coupling import faults, identify_coupling, identify_worn
from pellucid.orthosis.transfer.fit_transfer_function import fit_percent
from pellucid.study.pages.page import write_page
from pellucid.study.study import Study
from pellucid_lab.knee.protocol import NO_FAULTS, Faults, bench_trials, imu_trial, mvc_trial, relaxed_trial, swing_trial
from pellucid_lab.knee.protocol import torque_trial as torque
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.strap_options import without_strap_options
from pellucid_lab.study import record_in_memory, write_study

RIG = knee_orthosis().strapped(without_strap_options())
"""Whose straps are what is fitted: springs with dampers. What straps as they are do to it, others test."""
S1 = RIG.subjects["S1"]
BENCH = [t for t in bench_trials(RIG) if t.name in ("gravity", "response_03", "response_10", "response_check_07")]


def swings(first=NO_FAULTS, second=NO_FAULTS, third=NO_FAULTS):
    made = zip((1, 2, 3), ("fit", "fit", "validate"), (first, second, third), strict=True)
    return [swing_trial(RIG, f"S1_swing_{i}", S1, duration=24.0, use=use, faults=faults) for i, use, faults in made]


WORN = [
    imu_trial(RIG, "S1_imu", "S1"),
    relaxed_trial(RIG, "S1_relaxed_1", S1),
    relaxed_trial(RIG, "S1_relaxed_2", S1),
    mvc_trial(RIG, "S1_mvc", S1),
    torque(RIG, "S1_torque_30_1", S1, float(np.radians(30.0))),
    torque(RIG, "S1_torque_60_1", S1, float(np.radians(60.0))),
]


@pytest.fixture(scope="module")
def whole():
    return record_in_memory(RIG, [*BENCH, *WORN, *swings()], seed=5)


@pytest.fixture(scope="module")
def found(whole):
    return identify_worn(*whole[:2])


WRONG = [
    relaxed_trial(RIG, "S1_relaxed_2", S1, helps=True),
    *swings(Faults(imu_dropout=(8.0, 2.5)), NO_FAULTS, Faults(slip=(12.0, 0.10))),
    swing_trial(RIG, "S1_swing_4", S1, duration=24.0, faults=Faults(encoder_turn=2.4)),
]
"""A leg that helps, an IMU that falls silent, a strap that slips, and an encoder whose zero moves and rolls over."""


@pytest.fixture(scope="module")
def wrong(whole):
    """The same recordings, some of them as they should not be."""
    config, recordings, _ = whole
    by_name = {r.name: r for r in recordings} | {r.name: r for r in record_in_memory(RIG, WRONG, seed=5)[1]}
    by_name["response_03"] = rolled(by_name["response_03"])
    return config, list(by_name.values())


def rolled(recording):
    """Its encoder counts from 0 to a whole turn."""
    old = recording.channels["position"]
    position = Channel(old.name, np.mod(old.samples, 2.0 * np.pi), old.unit, old.column)
    return replace(recording, channels={**recording.channels, "position": position})


@pytest.fixture(scope="module")
def found_wrong(wrong):
    return identify_worn(*wrong)


def told(findings):
    return "\n".join(v.text for v in findings.verdicts if v.kind == "warning")


def test_orthosis_and_limb_are_found(found):
    gravity = float(np.hypot(*RIG.orthosis_gravity))
    assert found.orthosis.gravity.gravity.value == pytest.approx(gravity, rel=0.01)
    assert found.orthosis.pendulum["inertia"].value == pytest.approx(RIG["orthosis"]["inertia"], rel=0.05)
    assert found.orthosis.mean_fit() > 95.0
    limb = found.wearers["S1"].limb
    assert limb.gravity.value == pytest.approx(S1.gravity, rel=0.01)
    assert limb.zero.value == pytest.approx(S1.limb["ahead"], abs=0.01)
    assert limb.inertia.value == pytest.approx(S1.inertia, abs=2.0 * limb.inertia.standard_error)


def test_the_strap_is_found_and_judged_against_the_true_mismatch(whole, found):
    coupling = found.wearers["S1"].coupling
    fit = coupling.orthosis_side
    for parameter, true in (
        (fit.stiffness, S1.strap["stiffness"]),
        (fit.damping, S1.strap["damping"]),
        (fit.inertia, 0),
    ):
        low, high = parameter.interval()
        assert low <= true <= high
    held = next(j for j in coupling.evaluated if j.split == "heldout")
    truth = next(t for t in whole[2] if t.trial.name == held.recording).inside.truth
    assert fit_percent(truth.mismatch, held.predicted) > 95.0
    assert coupling.mean_fit() > 85.0
    assert coupling.mean_fit() > coupling.mean_fit("published") + 30.0
    assert coupling.mean_fit() > coupling.mean_fit("limb") + 30.0


def test_every_figure_has_an_id_and_cards_what_a_controller_needs(found):
    ids = [row.id for row in found.rows]
    assert len(ids) == len(set(ids))
    for what in ("orthosis.gravity", "orthosis.fit", "S1.limb.gravity", "S1.coupling.k", "S1.coupling.fit"):
        assert f"knee-orthosis.{what}" in ids
    assert set(found.cards) == {"orthosis", "S1.coupling", "S1.strap", "S1.limb"}
    assert set(found.cards["S1.coupling"].values) == {"stiffness", "damping"}
    assert set(found.cards["S1.limb"].values) == {"inertia", "gravity", "damping"}
    assert set(found.cards["orthosis"].values) == {"inertia", "damping", "gravity", "coulomb"}
    for card in found.cards.values():
        assert np.shape(card.covariance) == (len(card.parameters), len(card.parameters))
    assert told(found) == ""


def test_cards_and_rows_name_their_files_whatever_recordings_are_called(whole, found):
    recordings = whole[1]
    assert all(row.data_checksum for row in found.rows)
    own = {r.checksum for r in recordings if r.participant == "S1"}
    named = found.cards["S1.coupling"].checksums
    assert named
    assert set(named.values()) == own & set(found.checksums.values())
    names = {r.name: r.participant for r in recordings}
    assert {names[name] for name in found.cards["orthosis"].checksums} == {None}


def test_the_report_says_and_draws_it(tmp_path, whole, found):
    made = page(Study(tmp_path, whole[0]), found)
    text = write_page(tmp_path / "report", made).read_text(encoding="utf-8")
    assert "The straps" in text
    assert "m g l sin" in text
    names = {d.name for section in made.sections for d in section.drawings} | {made.figure.name}
    assert names == {"gravity", "response", "limbs", "straps", "strap_S1", "mismatch_S1"}
    assert all((tmp_path / "report" / f"{name}.svg").exists() for name in names)


def test_a_leg_that_helps_is_not_relaxed_and_not_used(found_wrong):
    stages = found_wrong.wearers["S1"]
    assert set(stages.at_work) == {"S1_relaxed_2"}
    assert "S1_relaxed_2 was not relaxed and is not used" in told(found_wrong)
    assert len(stages.limb.trials) == 1
    assert stages.limb.gravity.value == pytest.approx(S1.gravity, rel=0.015)


def test_an_imu_that_falls_silent_takes_its_swing_with_it(found_wrong):
    assert "S1_swing_1 is not used" in told(found_wrong)
    assert "expected dropouts shorter than 2 s" in told(found_wrong)
    assert found_wrong.wearers["S1"].coupling.orthosis_side.stiffness.value == pytest.approx(14.0, rel=0.1)


def test_a_strap_that_slips_in_mid_trial_is_told(found_wrong):
    slips = found_wrong.wearers["S1"].coupling.slips
    assert [s.recording for s in slips] == ["S1_swing_3"]
    assert slips[0].time == pytest.approx(12.0, abs=0.5)
    assert slips[0].step == pytest.approx(0.10, rel=0.3)
    assert "the strap slipped" in told(found_wrong)


def test_an_encoder_that_rolls_over_is_undone_and_told(wrong, found, found_wrong):
    jumps = next(r for r in wrong[1] if r.name == "response_03")["position"]
    assert np.abs(np.diff(jumps)).max() > 6.0
    assert any("response_03: position wraps by a whole turn" in v.text for v in found_wrong.verdicts)
    same = found.orthosis.pendulum["inertia"].value
    assert found_wrong.orthosis.pendulum["inertia"].value == pytest.approx(same, rel=1e-3)


def test_an_encoder_whose_zero_moved_is_refused(found_wrong):
    assert "S1_swing_4 is not used" in told(found_wrong)
    assert "the encoder's zero has moved" in told(found_wrong)


def test_nothing_to_identify_is_refused(whole):
    config, recordings, _ = whole
    with pytest.raises(IdentificationError, match="no participant's strap can be identified"):
        identify_worn(config, [r for r in recordings if r.protocol != "free_swing"])
    with pytest.raises(IdentificationError, match="found 0 recordings of holds"):
        identify_worn(config, [r for r in recordings if r.protocol != "gravity_holds"])
    with pytest.raises(IdentificationError, match=r"found no table \[coupling\]"):
        identify_worn(config.model_copy(update={"coupling": None}), recordings)


@pytest.mark.nightly
@pytest.mark.slow
def test_from_files_the_same_comes_out_and_check_tells_what_is_wrong(tmp_path, found_wrong):
    made = {trial.name: trial for trial in (*BENCH, *WORN, *swings(), *WRONG)}
    study = write_study(tmp_path / "knee", RIG, name="knee-orthosis", seed=5, trials=list(made.values()))
    told_of = {(f.severity, f.kind, f.file) for f in faults(study)}
    assert ("refuse", "not_relaxed", "S1_relaxed_2.csv") in told_of
    assert ("refuse", "gap", "S1_swing_1.csv") in told_of
    assert ("refuse", "magnitude", "S1_swing_4.csv") in told_of
    again = identify_coupling(study)
    a, b = (f.wearers["S1"].coupling.orthosis_side for f in (again, found_wrong))
    assert a.stiffness.value == pytest.approx(b.stiffness.value, rel=1e-3)
