"""A verdict says good only of a good prediction, and a family wins by terms that the recordings show."""

from types import SimpleNamespace

import numpy as np
import pytest

from pellucid.fit.parameter import Parameter
from pellucid.procedures.joint.findings import family_choice, prediction
from pellucid.procedures.tree.findings import heldout_worse


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
    return SimpleNamespace(fit=SimpleNamespace(headline=headline), best="symmetric")


@pytest.mark.parametrize(("error", "kind"), [(5.0, "good"), (19.0, "good"), (21.0, "warning"), (44.0, "warning")])
def test_a_joint_is_good_up_to_an_error_of_20_percent(error, kind):
    assert [v.kind for v in prediction.find(predicted(error))] == [kind]


@pytest.mark.parametrize(("error", "kinds"), [(5.0, ["good"]), (44.0, ["warning"])])
def test_a_joint_of_a_robot_is_good_up_to_an_error_of_20_percent(error, kinds):
    errors = SimpleNamespace(each=(4.0, error), mean=error)
    case = SimpleNamespace(judged="heldout", names=("a", "b"), errors_of=lambda model, judged: errors)
    assert [v.kind for v in heldout_worse.find(case)] == kinds


def chosen(best, simpler, values, errors, correlation=0.0):
    """A case in which the family with parameters `best` wins over one with parameters `simpler`."""
    sd = np.array(errors)
    covariance = np.outer(sd, sd) * (np.eye(len(sd)) + correlation * (1.0 - np.eye(len(sd))))
    parameters = tuple(
        Parameter(n, "N*m", v, s, identifiable=abs(v) > 1.96 * s) for n, v, s in zip(best, values, errors, strict=True)
    )
    estimate = SimpleNamespace(parameters=parameters, covariance=covariance)
    models = {n: SimpleNamespace(symbols=p, names=tuple(p)) for n, p in (("rich", best), ("plain", simpler))}
    fits = {n: SimpleNamespace(model=m) for n, m in models.items()}
    contest = SimpleNamespace(errors={"rich": 0.9, "plain": 1.0}, blocks=12, winner="rich", p_values={})
    fit = SimpleNamespace(headline=SimpleNamespace(estimate=estimate), heldout_effort_error=5.0)
    return SimpleNamespace(fits=fits, fit=fit, best="rich", contest=contest, level=0.95)


@pytest.mark.parametrize(
    ("best", "simpler", "values", "errors", "kind"),
    [
        (["inertia", "stribeck"], ["inertia"], [1.0, 0.5], [0.1, 0.1], "good"),
        (["inertia", "stribeck"], ["inertia"], [1.0, 0.1], [0.1, 0.1], "note"),
        (["coulomb_positive", "coulomb_negative"], ["coulomb"], [1.0, 1.6], [0.1, 0.1], "good"),
        (["coulomb_positive", "coulomb_negative"], ["coulomb"], [1.0, 1.1], [0.1, 0.1], "note"),
        (["load_motoring", "load_generating"], ["load_friction"], [0.1, 0.11], [0.02, 0.02], "note"),
    ],
)
def test_a_family_wins_only_by_what_the_recordings_show(best, simpler, values, errors, kind):
    (told,) = family_choice.find(chosen(best, simpler, values, errors))
    assert told.kind == kind
    assert ("significantly worse" in told.text) == (kind == "good")
    assert ("do not identify" in told.text) == (kind == "note")
