"""What a joint with a carriage is judged on: trials held out, or else the fitted ones."""

from dataclasses import replace

import numpy as np
import pytest

from pellucid.joint.slider.slider_fit import SliderFit, TrialError
from pellucid.joint.slider.study.slider_answer import slider_answer


def fit_of(*trials):
    errors = tuple(
        TrialError(f"trial_{i}", "slow", split, 0.2, a, 2.0 * a, a, a) for i, (split, a) in enumerate(trials)
    )
    return SliderFit(
        study="elbow",
        lifts="",
        gain=2.0,
        rail=(0.1, 0.3),
        geometry=None,
        static=(),
        estimates={},
        errors={"pooled": errors},
        motions=(),
        verdicts=(),
        filter_note="",
    )


@pytest.mark.parametrize(
    ("trials", "split", "names", "error"),
    [
        ([("fitted", 1.0), ("heldout", 2.0), ("heldout", 4.0)], "heldout", ["trial_1", "trial_2"], 3.0),
        ([("fitted", 1.0), ("fitted", 2.0)], "fitted", ["trial_0", "trial_1"], 1.5),
        ([("fitted", 1.0), ("heldout", 2.0), ("heldout", np.nan)], "heldout", ["trial_1"], 2.0),
        ([("fitted", 1.0), ("heldout", np.nan)], "fitted", ["trial_0"], 1.0),
    ],
)
def test_held_out_trials_or_else_fitted_ones(trials, split, names, error):
    fit = fit_of(*trials)
    assert fit.evaluated_split == split
    assert [e.recording for e in fit.evaluated("pooled")] == names
    assert fit.evaluated_error("pooled") == error


def test_nothing_to_judge_by():
    fit = fit_of(("fitted", np.nan))
    assert fit.evaluated("pooled") == ()
    assert np.isnan(fit.evaluated_error("pooled"))


def test_the_verdict_on_one_body_gives_the_number_that_it_rests_on():
    """Two errors stood there, and nowhere by how many per cent they differ, which decides."""
    errors = {
        method: tuple(
            TrialError(f"trial_{i}", "slow", "heldout", 0.2, a, a, a, a) for i, a in enumerate(currents)
        )
        for method, currents in {"pooled": (3.0, 3.0), "load": (1.0, 1.1), "dissociated": (1.0, 1.0)}.items()
    }  # fmt: skip
    answer = slider_answer(replace(fit_of(("heldout", 1.0)), errors=errors))
    assert answer.verdict == "yes"
    assert "is 5.0 % larger (+0.0 to +10.0 % by trial) than with separate parameters" in answer.sentence
    assert (answer.numbers[0].value, answer.numbers[0].unit) == (pytest.approx(5.0), "%")
