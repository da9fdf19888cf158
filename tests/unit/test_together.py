"""What is said of muscles calibrated over knee and ankle at once: scores, verdicts, rows, cards, or why nothing is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from made_muscles import across

from pellucid.emg.estimators.hill import fit_hill
from pellucid.emg.fit.muscle_posterior import calibration_posterior
from pellucid.emg.models.muscle import calibrated_muscles
from pellucid.emg.study.emg_torque import together
from pellucid.emg.study.emg_torque.calibration_page import departures, joints_together
from pellucid.emg.study.emg_torque.together import (
    FIT_WORDS,
    calibrate_together,
    together_cards,
    together_figure_data,
    together_rows,
    together_tables,
    together_verdicts,
)
from pellucid.emg.study.emg_torque.torque_findings import CalibrationFindings
from pellucid.numerics.posterior import ensemble as hamiltonian

TRUE = {"strength.gastrocnemius_medialis": 1.4, "strength.soleus": 1.3, "delay": 0.02, "time_constant": 0.02}


def silent(text, share):
    """No progress."""


@pytest.fixture(scope="module")
def alone():
    """An EMG stream 0.1 s ahead; joint by joint beside it."""
    fitted = across("fitted", seconds=6.0, true=TRUE, early=0.1)
    judged = across("judged", seconds=4.0, seed=5, true=TRUE, early=0.1, heldout=True)
    made = CalibrationFindings(across={joint: [fitted[joint], judged[joint]] for joint in fitted})
    made.muscles.update({joint: fit_hill([trial], weights=(0.02,)) for joint, trial in fitted.items()})
    made.trials.extend(made.across["knee"])
    return made


@pytest.fixture(scope="module")
def found(alone):
    return calibrate_together(alone, silent)


def test_rows_name_both_ways_and_no_bound_is_told_as_an_estimate(found, alone):
    rows = {row.id: row.value for row in together_rows("made", found, alone, [])}
    for joint in ("knee", "ankle"):
        assert rows[f"made.together.{joint}.hill.offset.r2"] > 0.9
        assert rows[f"made.together.{joint}.hill.r2"] < rows[f"made.together.{joint}.hill.offset.r2"]
        assert 0.0 <= rows[f"made.together.{joint}.hill.coverage"] <= 1.0
    assert 0.01 <= rows["made.together.hill.delay.smallest"] <= rows["made.together.hill.delay.largest"] <= 0.1
    assert rows["made.together.hill.offset.emg.low"] < 0.1 < rows["made.together.hill.offset.emg.high"]
    assert rows["made.together.hill.offset.carries_over"] == 1.0
    assert rows["made.together.hill.at_bound"] > 0
    assert rows["made.together.hill.at_bound_unreported"] == 0


def test_the_offset_is_the_recordings_own(found, alone):
    said = [v.said for v in together_verdicts(found, alone)]
    assert any("ahead of the moments" in text and "comes from the recording" in text for text in said)
    assert any("not identifiable" in text and "delay (0.0" in text for text in said)
    gastrocnemius = next(text for text in said if text.startswith("gastrocnemius medialis"))
    assert "by the knee alone" in gastrocnemius
    assert "by both" in gastrocnemius
    assert sum("90 % prediction bands cover" in text for text in said) == 2


def test_muscles_without_an_electrode_are_left_away_where_they_do_not_help(found, alone):
    rows = {row.id: row.value for row in together_rows("made", found, alone, [])}
    assert rows["made.together.never_recorded.helps"] == float(found.never.helps)
    # None of them crosses the ankle.
    assert rows["made.together.ankle.never_recorded.r2"] == pytest.approx(rows["made.together.ankle.hill.r2"], abs=1e-9)
    (said,) = (v.said for v in together_verdicts(found, alone) if "had no electrode" in v.said)
    assert ("are not used" in said) == (not found.never.helps)


def offset_verdicts(found, alone):
    """Return the kind and the text of each verdict on the offset of the EMG stream."""
    return [(v.kind, v.text) for v in together_verdicts(found, alone) if "ahead of the moments" in v.text]


def test_an_offset_that_does_not_carry_over_is_not_the_recordings(found, alone):
    late = found.fits["hill.offset"]
    scores = {joint: replace(score, r2=-1.0) for joint, score in late.choice.scores.items()}
    worse = replace(late, choice=replace(late.choice, scores=scores))
    made = replace(found, fits={**found.fits, "hill.offset": worse})
    ((kind, text),) = offset_verdicts(made, alone)
    assert kind == "note"
    assert "would fit better" in text
    assert "not attributed to the recording" in text
    rows = {row.id: row.value for row in together_rows("made", made, alone, [])}
    assert rows["made.together.hill.offset.carries_over"] == 0.0


def test_held_out_recordings_do_not_decide_on_the_offset(found, alone):
    worse = [replace(s, score=replace(s.score, r2=-1.0)) if s.how == "hill.offset" else s for s in found.scores]
    ((kind, text),) = offset_verdicts(replace(found, scores=tuple(worse)), alone)
    assert kind == "warning"
    assert "comes from the recording" in text


def test_cards_keep_one_set_of_muscles_for_both_joints(found):
    study = SimpleNamespace(name="made")
    cards = together_cards(study, found, [])
    assert set(cards) == {"muscles_together", "muscles_together_offset"}
    for name, how in (("muscles_together", "hill"), ("muscles_together_offset", "hill.offset")):
        kept = calibrated_muscles(cards[name])
        assert kept.joints == ("knee", "ankle")
        assert kept.muscles == found.fits[how].muscles
        assert kept.driven["gastrocnemius_lateralis"] == ("gastrocnemius_medialis",)
        bound = [p for p in cards[name].parameters if p.at_bound]
        assert all(p.refused and not p.identifiable and np.isnan(p.standard_error) for p in bound)
    late = cards["muscles_together_offset"].settings
    assert late["emg_offset.low"] < late["emg_offset"] < late["emg_offset.high"]


def test_tables_and_figures_have_every_joint(found):
    figures, parameters = together_tables(found, [])
    words = [*FIT_WORDS.values(), "muscles of all joints, with muscles that had no electrode"]
    assert [row[:3] for row in figures.rows] == [(j, "judged", w) for j in ("knee", "ankle") for w in words]
    assert len(parameters.parameters) == len(found.fits["hill"].parameters)
    shown = together_figure_data(found)
    assert len(joints_together(shown.traces, FIT_WORDS, "joints", caption="").figure.axes) == 2
    titles = [axis.get_title() for axis in departures(shown.summary, "muscles", caption="").figure.axes]
    assert titles[:4] == ["strength", "tendon slack length", "optimal fibre length", "passive scale"]
    assert not {"knee", "ankle"} & set(titles)


@pytest.fixture(scope="module")
def few(found):
    """Draws too few to settle."""
    pytest.importorskip("emcee")
    with pytest.MonkeyPatch.context() as patch:
        settings = replace(hamiltonian.SAMPLER_SETTINGS, hamiltonian_steps_per_round=15)
        patch.setattr(hamiltonian, "SAMPLER_SETTINGS", settings)
        return calibration_posterior(found.fits["hill"].fit, most=15)


@pytest.mark.parametrize("settled", [True, False])
def test_a_posterior_is_judged_on_what_was_not_fitted(alone, found, few, monkeypatch, settled):
    assert few.unsettled
    drawn = replace(few, unsettled="") if settled else few
    monkeypatch.setattr(together, "calibration_posterior", lambda fit, **asked: drawn)
    made = together._add_posterior(found, alone.across)
    said = [v.said for v in together_verdicts(made, alone)]
    rows = {row.id: row.value for row in together_rows("made", made, alone, [])}
    names = [table.title for table in together_tables(made, [])]
    assert any(name.startswith("Posterior of the muscles of knee and ankle") for name in names)
    assert min(rows["made.together.posterior.told"], 12) == len(together_figure_data(made).told)
    assert any("has not settled" in text for text in said) == (not settled)
    assert any("posterior mean and its" in text for text in said) == settled
    assert ("made.together.ankle.posterior.coverage" in rows) == settled
    if settled:
        assert {(s.joint, s.recording) for s in made.beside if s.how == "posterior"} == {
            ("knee", "judged"),
            ("ankle", "judged"),
        }
        assert rows["made.together.ankle.posterior.r2"] > 0.5


@pytest.mark.nightly
def test_each_trial_is_left_out_where_none_is_held(alone):
    made = [across(f"t{i}", seconds=3.0, seed=i, true=TRUE) for i in range(3)]
    trials = {j: [replace(t[j], group=t[j].name) for t in made] for j in ("knee", "ankle")}
    found = calibrate_together(CalibrationFindings(across=trials), silent)
    assert {(s.joint, s.recording) for s in found.scores} == {("knee", ""), ("ankle", "")}
    assert min(s.score.r2 for s in found.scores) > 0.9
    assert found.traces[0].recording == "t0"


def test_joints_of_different_recordings_are_passed_over_with_the_reason(alone):
    other = {"knee": alone.across["knee"], "ankle": [replace(t, name=f"{t.name}_b") for t in alone.across["ankle"]]}
    made = CalibrationFindings(across=other)
    assert calibrate_together(made, silent) is None
    assert "expected both in the same recordings" in made.passed_over["knee and ankle together"]


def test_one_joint_or_no_muscles_give_nothing(alone):
    assert calibrate_together(CalibrationFindings(across={"knee": alone.across["knee"]}), silent) is None
    refused = CalibrationFindings(across=alone.across, passed_over={"knee": "found envelopes in V"})
    assert calibrate_together(refused, silent) is None
    for made in (together_tables(None, []), tuple(together_verdicts(None, alone)), together_rows("x", None, alone, [])):
        assert made == ()
    assert together_cards(SimpleNamespace(name="x"), None, []) == {}
    assert together_figure_data(None) is None
