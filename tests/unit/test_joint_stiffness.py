"""Stiffness of a joint by calibrated muscles: its limits, its interval, and what is said of it."""

from dataclasses import replace
from types import SimpleNamespace

import made_muscles as made
import numpy as np
import pytest

from pellucid.emg.estimators.joint_stiffness import STIFFNESS_KINDS, joint_stiffness
from pellucid.emg.estimators.torque_map import fit_torque_map
from pellucid.emg.study.emg_torque import estimator_cards
from pellucid.emg.study.emg_torque import torque_findings as stiffness_findings
from pellucid.emg.study.emg_torque.emg_torque_table import EmgTorqueTable
from pellucid.emg.study.emg_torque.torque_findings import CalibrationFindings


@pytest.fixture(scope="module")
def found():
    """A causal map of made movement with its card, and the fitted trial along which its stiffness is stated."""
    fitted, judged = (
        [made.trial("a", seed=1, seconds=6.0), made.trial("b", seed=2, seconds=6.0)],
        made.trial("c", seed=3),
    )
    calibrated = CalibrationFindings()
    calibrated.causal["knee", "hill"] = fit_torque_map(fitted, "hill", causal=True)
    calibrated.shown["knee"], calibrated.stiffness_trials["knee"] = judged, fitted[0]
    own = EmgTorqueTable(chain="none", emg="emg", joints=("knee",), normalise="none")
    study = SimpleNamespace(name="made", table=lambda kind: own, recordings=lambda use=None: [])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(estimator_cards, "moment_trials", lambda study, joint, causal: fitted)
        return study, calibrated, estimator_cards.estimator_cards(study, calibrated), fitted[0]


@pytest.fixture(scope="module")
def stiffness(found):
    _, calibrated, cards, _ = found
    return stiffness_findings.find_stiffness(calibrated, cards)


def test_it_is_what_the_card_steps(found, stiffness):
    _, _, cards, along = found
    (one,), card = stiffness, cards["emg_knee_hill"]
    emg, angle = ([of[n] for n in names] for of, names in
                  ((along.envelopes, [c.name for c in card.channels]), (along.angles, card.angles)))  # fmt: skip
    torque, _, short_range, slope = card.build().run(1e4 * np.arange(len(along)), emg, angle)
    assert np.array_equal(one.torque, torque[0])
    assert np.array_equal(one.value["short_range"], short_range[0, 0])
    assert np.array_equal(one.value["slope"], slope[0, 0])
    assert (one.joint, one.recording, len(one.postures)) == ("knee", "a", 4)
    parts = [p.value["short_range"] for p in one.postures]
    assert np.mean(parts) == pytest.approx(one.whole.value["short_range"], rel=1e-9)
    assert one.postures[0].high <= one.postures[1].low


def test_muscles_at_rest_give_the_tissue_alone(found):
    _, calibrated, cards, along = found
    card, fit = cards["emg_knee_hill"], calibrated.causal["knee", "hill"].fit
    limp = tuple(replace(m, numbers={**m.numbers, "passive_scale": 0.0, "damping": 0.0}) for m in card.muscles)
    quiet = replace(along, envelopes={c: np.zeros(len(along)) for c in along.envelopes})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pellucid.emg.estimators.joint_stiffness._move_parameter", lambda card, fit, i, by: card)
        # The watch would take channels without a signal for dead ones.
        one = joint_stiffness(replace(card, muscles=limp, watch=None), fit, quiet)
    assert np.allclose(one.value["short_range"], card.joints[0].stiffness, rtol=0, atol=1e-9)
    assert np.allclose(one.value["slope"], card.joints[0].stiffness, rtol=0, atol=1e-9)
    assert np.all(one.error["short_range"] == 0.0)


def test_it_grows_with_effort_and_what_is_not_known_with_it(found, stiffness):
    _, calibrated, cards, along = found
    card, fit = cards["emg_knee_hill"], calibrated.causal["knee", "hill"].fit
    weak = joint_stiffness(card, fit, replace(along, envelopes={c: 0.3 * x for c, x in along.envelopes.items()}))
    assert weak.whole.value["short_range"] < stiffness[0].whole.value["short_range"]
    assert 0.0 < weak.whole.error["short_range"] < stiffness[0].whole.error["short_range"]
    for kind in STIFFNESS_KINDS:
        assert np.all(np.isfinite(stiffness[0].error[kind]))
        assert stiffness[0].whole.error[kind] <= np.max(stiffness[0].error[kind])


def test_what_is_known_well_leaves_what_muscles_differ_by(found, stiffness):
    """Without a calibration's errors, the interval is that of gamma and the tendon."""
    _, calibrated, cards, along = found
    fit = calibrated.causal["knee", "hill"].fit
    known = SimpleNamespace(z=fit.z, problem=fit.problem, at_bound=np.zeros(len(fit.z), bool))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pellucid.emg.estimators.joint_stiffness.covariance", lambda fit: np.zeros((len(fit.z),) * 2))
        sure = joint_stiffness(cards["emg_knee_hill"], known, along)
    share = sure.whole.error["short_range"] / sure.whole.value["short_range"]
    assert 0.02 < share < 0.3
    assert sure.whole.error["slope"] == pytest.approx(0.0, abs=1e-9)
    assert sure.whole.error["short_range"] < stiffness[0].whole.error["short_range"]


def test_tables_rows_and_cards(found, stiffness):
    study = found[0]
    (table,) = stiffness_findings.stiffness_tables(stiffness)
    assert table.title == "Stiffness by calibrated muscles: knee, a"
    assert len(table.rows) == 5
    rows = {row.id: row for row in stiffness_findings.stiffness_rows("made", stiffness, {"a": "0" * 64})}
    assert rows["made.knee.stiffness.short_range.mean"].value == stiffness[0].whole.value["short_range"]
    assert {row.unit for row in rows.values()} == {"N*m/rad"}
    card = stiffness_findings.stiffness_cards(study, stiffness)["stiffness_knee"]
    assert card["slope.posture_4"].value == stiffness[0].postures[3].value["slope"]
    assert card.settings["posture_1.low"] == stiffness[0].postures[0].low
    (verdict,) = stiffness_findings.stiffness_verdicts(stiffness)
    assert "No perturbation was applied" in verdict.said
