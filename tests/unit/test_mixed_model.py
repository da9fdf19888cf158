"""The mixed model of movements: of balanced data, against statsmodels' formulas, and what it says without an answer."""

import numpy as np
import pytest

from pellucid._errors import PellucidError
from pellucid.people.equivalence import Margin, equivalence
from pellucid.people.mixed_model import mixed_model


def movements(rng, people=8, repeats=12, change=0.1, own=0.05, learning=0.0):
    """Value, participant, condition and trial of movements."""
    who, under = np.repeat(np.arange(people), 2 * repeats), np.tile(np.repeat([False, True], repeats), people)
    trial = np.tile(np.arange(float(repeats)), 2 * people)
    level, slope = rng.normal(0.0, 0.2, people), change + own * rng.standard_normal(people)
    value = level[who] + slope[who] * under + learning * trial * under + rng.normal(0.0, 0.08, len(who))
    return value, who, under, trial


def test_balanced_movements_say_what_participants_means_say(rng):
    """Estimate and standard error of the paired t test, and thus its two one-sided tests."""
    value, who, under, trial = movements(rng)
    found = mixed_model(value, who, under, {"trial": trial})
    d = np.array([value[(who == i) & under].mean() - value[(who == i) & ~under].mean() for i in range(8)])
    assert found.trouble == ""
    assert found.change == pytest.approx(d.mean(), rel=1e-3)
    assert found.error == pytest.approx(d.std(ddof=1) / np.sqrt(8), rel=1e-2)
    ours, theirs = found.equivalence(Margin.either_way(0.2)), equivalence(d, Margin.either_way(0.2), method="t")
    assert (ours.verdict, ours.pairs) == (theirs.verdict, 8)
    assert ours.interval == pytest.approx(theirs.interval, rel=1e-2)


@pytest.mark.filterwarnings("ignore:The MLE may be on the boundary")
def test_it_is_the_formula_of_statsmodels(rng):
    """The same model as a formula, of data that are not balanced."""
    pandas, smf = pytest.importorskip("pandas"), pytest.importorskip("statsmodels.formula.api")
    value, who, under, trial = (each[np.arange(192) % 7 != 3] for each in movements(rng))
    c = under - 0.5
    table = pandas.DataFrame({"y": value, "who": who, "c": c, "trial": trial - trial.mean()})
    theirs = smf.mixedlm("y ~ c + trial", table, groups="who", re_formula="~c").fit(method=["powell"])
    found = mixed_model(value, who, under, {"trial": trial})
    assert found.change == pytest.approx(theirs.fe_params["c"], rel=1e-3)
    assert found.error == pytest.approx(theirs.bse_fe["c"], rel=2e-2)
    assert found.covariates["trial"].value == pytest.approx(theirs.fe_params["trial"], rel=2e-2, abs=1e-4)


def test_a_variance_of_nothing_is_an_answer(rng):
    found = mixed_model(*movements(rng, own=0.0)[:3], {})
    assert found.trouble == ""
    assert found.error > 0.0
    assert found.spread < 0.05


def test_what_others_make_up_is_left_out(rng):
    value, who, under, trial = movements(rng)
    found = mixed_model(value, who, under, {"trial": trial, "again": 2.0 * trial + 1.0, "one": np.ones(len(trial))})
    assert list(found.covariates) == ["trial"]


def test_without_control_the_level_is_the_change(rng):
    value, who, under, trial = movements(rng)
    found = mixed_model(value[under] + 3.0, who[under], None, {"trial": trial[under]})
    means = np.array([value[under & (who == i)].mean() + 3.0 for i in range(8)])
    assert found.change == pytest.approx(means.mean(), rel=1e-3)
    assert found.error == pytest.approx(means.std(ddof=1) / np.sqrt(8), rel=2e-2)


def test_no_answer_is_told_and_decides_nothing(rng, monkeypatch):
    value, who, under, _ = movements(rng)
    monkeypatch.setattr("pellucid.people.mixed_model.OPTIMISER_SEQUENCE", ())
    found = mixed_model(value, who, under, {})
    assert "did not come to rest" in found.trouble
    assert found.equivalence(Margin.either_way(9.0)).verdict == "undecided"
    few = mixed_model(value[who < 2], who[who < 2], under[who < 2], {})
    assert "expected at least 3" in few.trouble


def test_a_standard_error_that_is_no_number_is_no_answer(rng, monkeypatch):
    """It comes with a warning of NumPy's, which is none of the user's."""
    results = pytest.importorskip("statsmodels.regression.mixed_linear_model").MixedLMResults
    monkeypatch.setattr(results, "bse_fe", property(lambda self: np.sqrt(-np.ones(2))))
    found = mixed_model(*movements(rng)[:3], {})
    assert "did not come to rest" in found.trouble
    assert np.isnan(found.change)


def test_what_does_not_fit_is_refused(rng):
    value, who, under, trial = movements(rng)
    with pytest.raises(PellucidError, match="expected equal ones without NaN"):
        mixed_model(value, who, under, {"trial": trial[1:]})
    with pytest.raises(PellucidError, match="without control or condition"):
        mixed_model(value[under], who[under], under[under], {})
