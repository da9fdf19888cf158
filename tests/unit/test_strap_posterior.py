"""A strap's posterior holds what it is, and more where bodies are known less well."""

from dataclasses import replace

import numpy as np
import pytest
from two_bodies import Pair, record, swing

from pellucid._errors import IdentificationError
from pellucid.orthosis.strap.coupled_impedance import fit_coupling
from pellucid.orthosis.strap.strap_model import from_orthosis
from pellucid.orthosis.strap.strap_posterior import strap_posterior
from pellucid.orthosis.strap.wearer_coupling import identify_wearer

pytestmark = pytest.mark.slow

PAIR = Pair()


@pytest.fixture(scope="module")
def swings():
    rng = np.random.default_rng(3)
    truths = swing(PAIR, seconds=12.0, count=2, substeps=2)
    return [record(t, rng, name=f"swing_{i}", split="fitted") for i, t in enumerate(truths)]


@pytest.fixture(scope="module")
def found(swings):
    return identify_wearer("S1", [swings[0], replace(swings[1], split="heldout")], PAIR.orthosis, posterior=True)


def test_it_holds_the_strap_and_its_interval_is_no_narrower_than_least_squares(found):
    fitted, drawn = found.orthosis_side, found.posterior
    assert drawn.unsettled == ""
    for name, true in (("stiffness", PAIR.stiffness), ("damping", PAIR.damping), ("gain", 1.0)):
        low, high = drawn.interval(name)
        assert low < true < high
        p = {q.name: q for q in fitted.parameters}[name]
        assert high - low > 0.6 * np.ptp(p.interval())
    assert not drawn["stiffness"].told_by_prior


@pytest.mark.nightly
def test_bodies_that_are_not_exactly_known_widen_it(swings, found):
    unsure = replace(PAIR.orthosis, covariance=np.diag([1e-4, 1.0, 1e-2, 1e-6]))
    torque = [from_orthosis(swings[0], unsure)]
    drawn = strap_posterior(swings[:1], torque, fit_coupling(swings[:1], torque))
    wider = np.ptp(drawn.interval("damping")) / np.ptp(found.posterior.interval("damping"))
    assert wider > 1.25  # 1.5, drawn to a tenth


def test_a_strap_at_its_bound_is_refused(swings):
    torque = [from_orthosis(swings[0], PAIR.orthosis)]
    fit = fit_coupling(swings[:1], torque)
    held = replace(fit, damping=replace(fit.damping, at_bound=True))
    with pytest.raises(IdentificationError, match="is on its bound"):
        strap_posterior(swings[:1], torque, held)
