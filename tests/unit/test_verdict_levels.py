"""A verdict says good only of a good prediction, and a family wins by what it predicts."""

from types import SimpleNamespace

import numpy as np
import pytest

from pellucid.arm.study import tree_findings
from pellucid.joint.fit.headline_choice import decide
from pellucid.joint.study import joint_findings
from pellucid.models.estimates import Parameter
from pellucid.numerics.block_test import MIN_IMPROVEMENT


def predicted(error, count=4000):
    """A case whose model misses a share of the effort [%] in so many independent samples."""
    r2 = 1.0 - (error / 100.0) ** 2
    residual = np.random.default_rng(3).standard_normal(count)
    headline = SimpleNamespace(
        predictions=[SimpleNamespace(split="heldout", residual=residual)],
        fitted_r2=r2,
        heldout_r2=r2,
        fitted_effort_error=error,
        heldout_effort_error=error,
    )
    fits = {"symmetric": SimpleNamespace(headline=headline, heldout_effort_error=error)}
    study = SimpleNamespace(model=SimpleNamespace(min_improvement=MIN_IMPROVEMENT))
    return SimpleNamespace(fits=fits, fit=fits["symmetric"], best="symmetric", study=study)


@pytest.mark.parametrize(("error", "kind"), [(5.0, "good"), (19.0, "good"), (21.0, "warning"), (44.0, "warning")])
def test_a_joint_is_good_up_to_an_error_of_20_percent(error, kind):
    assert [v.kind for v in joint_findings.report_prediction(predicted(error))] == [kind]


@pytest.mark.parametrize(("error", "kinds"), [(5.0, ["good"]), (44.0, ["warning"])])
def test_a_joint_of_a_robot_is_good_up_to_an_error_of_20_percent(error, kinds):
    errors = SimpleNamespace(each=(4.0, error), mean=error)
    case = SimpleNamespace(judged="heldout", names=("a", "b"), errors_of=lambda model, judged: errors)
    assert [v.kind for v in tree_findings.report_heldout_worse(case)] == kinds


def chosen(rich, plain, values, errors, *, gain=0.1):
    """A case that chooses between two families, of which the one with parameters `rich` errs by a share `gain` less."""
    sd = np.array(errors)
    parameters = tuple(
        Parameter(n, "N*m", v, s, identifiable=abs(v) > 1.96 * s) for n, v, s in zip(rich, values, errors, strict=True)
    )
    estimate = SimpleNamespace(parameters=parameters, covariance=np.diag(sd**2), between_recordings=None)
    headline = SimpleNamespace(estimate=estimate, heldout_effort_error=5.0, fitted_effort_error=5.0)
    fits = {
        name: SimpleNamespace(
            model=SimpleNamespace(symbols=own, names=tuple(own)), estimate=estimate, headline=headline
        )
        for name, own in (("rich", rich), ("plain", plain))
    }
    losses = np.ones((1, 2, 20)) * np.array([(1.0 - gain) ** 2, 1.0])[None, :, None]
    named = [("rich", "ls", len(rich) + 1), ("plain", "ls", len(plain))]
    choice = decide(named, losses, np.array([20]), "torque")
    return SimpleNamespace(
        fits=fits, fit=fits[choice.family], best=choice.family, choice=choice, level=0.95, judged_on_held_out=True
    )


@pytest.mark.parametrize(
    ("rich", "plain", "values", "errors", "kind"),
    [
        (["inertia", "stribeck"], ["inertia"], [1.0, 0.5], [0.1, 0.1], "good"),
        (["inertia", "stribeck"], ["inertia"], [1.0, 0.1], [0.1, 0.1], "note"),
        (["coulomb_positive", "coulomb_negative"], ["coulomb"], [1.0, 1.6], [0.1, 0.1], "good"),
        (["coulomb_positive", "coulomb_negative"], ["coulomb"], [1.0, 1.1], [0.1, 0.1], "note"),
        (["load_motoring", "load_generating"], ["load_friction"], [0.1, 0.11], [0.02, 0.02], "note"),
        (["inertia", "load_friction"], ["inertia"], [1.0, 0.18], [0.1, 0.1], "good"),
        (["inertia", "load_friction"], ["inertia"], [1.0, 0.16], [0.1, 0.1], "note"),
        (["inertia", "offset"], ["inertia"], [1.0, 0.18], [0.1, 0.1], "note"),
        (["inertia", "stribeck", "stribeck_velocity"], ["inertia"], [1.0, 0.1, 0.2], [0.1, 0.1, 0.01], "note"),
    ],
)
def test_a_family_that_predicts_better_is_used_and_its_term_is_told_if_it_is_not_identified(
    rich, plain, values, errors, kind
):
    case = chosen(rich, plain, values, errors)
    (told,) = joint_findings.report_family_choice(case)
    assert case.best == "rich"
    assert told.kind == kind
    assert "10 % smaller than that of 'plain'" in told.text
    assert ("cannot be identified: use its predictions, not its value." in told.text) == (kind == "note")


def test_a_family_that_predicts_hardly_better_is_told_and_not_used():
    case = chosen(["inertia", "stribeck"], ["inertia"], [1.0, 0.5], [0.1, 0.1], gain=0.04)
    (told,) = joint_findings.report_family_choice(case)
    assert (case.best, told.kind) == ("plain", "note")
    assert "better than 'plain', but only by 4 %" in told.text


def test_a_family_that_is_better_on_held_out_recordings_only_is_told_and_not_used():
    case = predicted(10.0)
    case.fits["stribeck"] = SimpleNamespace(heldout_effort_error=8.0)
    better, usual = joint_findings.report_prediction(case)
    assert (better.kind, usual.kind) == ("note", "good")
    assert "not used to choose" in better.text
    case.fits["stribeck"] = SimpleNamespace(heldout_effort_error=9.9)
    assert [v.kind for v in joint_findings.report_prediction(case)] == ["good"]
