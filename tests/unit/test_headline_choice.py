"""One decision names the headline: the simplest model that predicts as well as the best one, for its purpose."""

from dataclasses import fields, replace

import numpy as np
import pytest

from pellucid.joint.fit import friction_family
from pellucid.joint.fit.friction_family import fit_family
from pellucid.joint.fit.headline_choice import choose_headline, decide, make_cuts
from pellucid.joint.fit.joint_estimate import DISAGREEMENT_CAUSE, widen_for_others
from pellucid.joint.fit.replay import Machine
from pellucid.models.joint import joint_model
from pellucid.numerics.motion import Filtering, JudgedDataInFitError, JudgedMotion, motion_of
from pellucid.numerics.regression import stack

COUNTS = np.array([400, 400])
"""Samples of effort and position."""


def chosen(purpose="torque", positions=None, **efforts):
    """The choice among methods of one family by RMS errors of effort and position, alike in all of 20 stretches."""
    named = [("symmetric", method, 5) for method in efforts]
    rms = [list(efforts.values())] + ([] if positions is None else [positions])
    losses = np.repeat(np.square(rms)[:, :, None] * 20.0, 20, axis=2)
    return decide(named, losses, COUNTS, purpose)


def test_the_plainest_of_equals_is_taken():
    assert chosen(ls=1.01, irls=1.0, output_error=1.0).method == "ls"


def test_a_worse_estimator_is_passed_over():
    assert chosen(ls=1.2, wls=1.1, irls=1.0, output_error=1.001).method == "irls"


@pytest.mark.parametrize(("error", "method"), [(1.05, "ls"), (1.06, "output_error")])
def test_what_errs_hardly_more_stays_the_plainest(error, method):
    assert chosen(ls=error, output_error=1.0).method == method


def test_a_simulation_that_is_far_better_outweighs_an_effort_that_is_hardly_worse():
    assert chosen(ls=1.0, output_error=1.01, positions=[3.0, 1.0]).method == "output_error"
    assert chosen(ls=1.0, output_error=1.01, positions=[1.1, 1.0]).method == "ls"
    assert chosen(ls=1.0, output_error=1.5, positions=[3.0, 1.0]).method == "ls"


def test_the_purpose_weighs_effort_and_simulation():
    errors = {"ls": 1.0, "output_error": 1.5, "positions": [1.2, 1.0]}
    assert chosen("torque", **errors).method == "ls"
    found = chosen("simulation", **errors)
    assert found.method == "output_error"
    assert found.of("symmetric", "ls").excess == pytest.approx(np.log(1.2))
    assert found.chosen.simulation_error == pytest.approx(1.0)


def test_without_a_simulation_the_effort_alone_decides():
    assert chosen("simulation", ls=1.0, output_error=2.0).method == "ls"


def test_a_family_with_fewer_parameters_is_simpler_whatever_its_estimator():
    named = [("combined", "ls", 9), ("symmetric", "irls", 5)]
    losses = np.full((1, 2, 20), 20.0) * np.array([1.0, 1.02])[None, :, None]
    assert decide(named, losses, COUNTS, "torque").family == "symmetric"


def test_an_excess_that_one_stretch_makes_has_a_large_standard_error():
    losses = np.ones((1, 2, 20))
    losses[0, 0, 7] = 30.0
    found = decide([("symmetric", "ls", 5), ("directional", "ls", 6)], losses, COUNTS, "torque")
    worse = found.of("symmetric", "ls")
    assert worse.standard_error > 0.3
    # It predicts better, and that decides.
    assert found.family == "directional"


def test_cuts_do_not_share_their_edges():
    first, second = ([np.flatnonzero(np.diff(x)) for x in cut] for cut in make_cuts([200, 100], 10))
    assert len(make_cuts([200, 100], 10)[0]) == 2
    for one, other in zip(first, second, strict=True):
        assert not set(one) & set(other)


@pytest.fixture(scope="module")
def joint():
    """A motion of a joint whose friction differs by direction by a tenth of it, with a command to simulate."""
    t = np.arange(0.0, 30.0, 0.005)
    q = 0.6 * np.sin(0.8 * t) + 0.3 * np.sin(3.1 * t) + 0.1 * np.sin(7.0 * t)
    v = np.gradient(q, t)
    a = np.gradient(v, t)
    friction = np.where(v > 0.0, 0.55, -0.45)
    noise = 0.02 * np.random.default_rng(4).standard_normal(len(t))
    return motion_of(t, q, 0.05 * a + 1.5 * np.sin(q) + friction + 0.08 * v + noise, Filtering(10.0, 4, 5, 0.05, 100))


def solved_by(joint, *families):
    data = stack([joint])
    models = [joint_model(f, motion="rotary", effort_unit="N*m", gravity="sine") for f in families]
    return data, {m.family: fit_family(m, data, [joint], Machine(), level=0.95, thorough=True) for m in models}


def test_families_and_estimators_are_one_choice(joint):
    data, solved = solved_by(joint, "symmetric", "directional")
    found = choose_headline({n: s.candidates for n, s in solved.items()}, data, Machine(), "torque")
    # The offset of the symmetric family already stands for a difference of the directions.
    assert (found.family, found.method) == ("symmetric", "ls")
    assert len(found.candidates) == sum(len(s.candidates) for s in solved.values()) > 6
    assert found.candidates[0].excess == 0.0
    assert all(c.simulation_error is not None for c in found.candidates)


def test_an_estimator_without_a_finite_covariance_is_no_candidate(joint, monkeypatch):
    solve = friction_family.solve_output_error

    def solve_alike(*given):
        found = solve(*given)
        return replace(found, jacobian=found.jacobian[:, [0, 0, *range(2, found.jacobian.shape[1])]])

    monkeypatch.setattr(friction_family, "solve_output_error", solve_alike)
    solved = solved_by(joint, "symmetric")[1]["symmetric"]
    assert "output_error" not in solved.fit.others
    assert "does not identify separately" in solved.fit.failures["output_error"]
    assert "output_error" not in solved.candidates


def test_held_out_motions_are_refused(joint):
    data, solved = solved_by(joint, "symmetric")
    held = JudgedMotion(**{each.name: getattr(joint, each.name) for each in fields(joint)})
    candidates = {n: s.candidates for n, s in solved.items()}
    with pytest.raises(JudgedDataInFitError):
        choose_headline(candidates, replace(data, motions=[held]), Machine(), "torque")


def test_an_interval_contains_an_estimate_that_predicts_as_well(joint):
    _, solved = solved_by(joint, "symmetric")
    own = solved["symmetric"].fit.estimate
    apart = own["inertia"].value + 20.0 * own["inertia"].standard_error
    moved = tuple(replace(p, value=apart) if p.name == "inertia" else p for p in own.parameters)
    wide = widen_for_others(own, [replace(own, parameters=moved, method="irls")])
    low, high = wide["inertia"].interval(0.95)
    assert low <= apart <= high * (1.0 + 1e-9)
    assert wide["gravity"] == own["gravity"]
    assert np.sqrt(np.diag(wide.covariance)) == pytest.approx([p.standard_error for p in wide.parameters])
    assert wide.discrepancy.of(["inertia"])[1] == (DISAGREEMENT_CAUSE,)
    assert wide.statistical == pytest.approx(own.statistical)
    assert widen_for_others(own, [own]) is own
