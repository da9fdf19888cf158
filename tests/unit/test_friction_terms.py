"""Every friction term of the core: limits and supervisor count it, less than was found is carried, none is negative."""

import math
from dataclasses import replace

import numpy as np
import pytest
from simulated_joint import BODY, FRICTION, SimulatedJoint, identified, live
from term_battery import LOAD, friction_of, law_with

import pellucid as pl
from pellucid import _core
from pellucid._errors import IdentificationError, StudyError
from pellucid.controllers.control_law import LAWS
from pellucid.controllers.joint_compensation import carried, suggested_limits
from pellucid.controllers.supervised import body_of, body_resistance
from pellucid.joint.fit.unknown_payload import SteadyStates
from pellucid.models.fields import largest_friction, model_fields
from pellucid.models.friction_terms import is_friction
from pellucid.models.joint import NAMES, PARAMETER_INDEX, SYMBOLS_BY_NAME

TERMS = tuple(field.name for field in model_fields("joint") if field.resists is not None)
SPEED = 1.7

BODIES = {
    "usual": {},
    "horizontal": {"gravity_sine": 0.0},
    "viscous": {"viscous_positive": 1.0, "viscous_negative": 1.0},
}


def test_every_number_that_takes_energy_is_a_term():
    rising = {name for name in NAMES if friction_of(name, 0.5, SPEED, LOAD) or friction_of(name, 0.5, 1e-9, LOAD)}
    assert rising - {"inertia", "gravity_sine", "gravity_cosine", "offset"} == set(TERMS)


@pytest.mark.parametrize("term", TERMS)
def test_limits_count_it(term):
    card = identified(BODY, "symmetric").card()
    plain = suggested_limits(card).effort
    more = suggested_limits(_with(card, term)).effort
    speed, weight = card.velocity_range, next(p.value for p in card.parameters if p.name == "gravity")
    counted = (more - plain) / LAWS["joint"].defaults["friction_share"]
    assert counted >= 0.999 * friction_of(term, 0.2, speed, weight) > 0.0 or term == "stribeck"
    assert counted == pytest.approx(largest_friction(LAWS["joint"].fields, {term: 0.2}, speed, weight), rel=1e-6)


def _with(card, term):
    """The card with 0.2 more of a term."""
    known = {
        target: carried(p) for p in card.parameters for target in SYMBOLS_BY_NAME[p.name].targets if is_friction(p.name)
    }
    free = tuple(p for p in card.parameters if not is_friction(p.name))
    return replace(card, parameters=free, known={**known, term: known.get(term, 0.0) + 0.2})


@pytest.mark.parametrize("term", TERMS)
def test_the_supervisor_counts_it(term):
    body = body_of(law_with(**{term: 0.2}))
    for speed in (1e-6, 0.5, SPEED, 10.0):
        assert body_resistance(body, speed, LOAD) >= 0.999 * friction_of(term, 0.2, speed, LOAD)
    assert sum(body_of(law_with())[name] for name in ("coulomb", "load", "viscous", "square_root")) == 0.0


@pytest.mark.parametrize("term", TERMS)
def test_steady_states_know_what_one_unit_of_it_is(term):
    """As the core has it: the sum of a friction's columns times its coefficients is the friction."""
    steady = SteadyStates(np.array([0.02, -0.02, SPEED, -SPEED]), np.array([LOAD, LOAD, -LOAD, LOAD]))
    vector = np.zeros(len(NAMES))
    vector[PARAMETER_INDEX["inertia"]], vector[PARAMETER_INDEX["stribeck_velocity"]], vector[PARAMETER_INDEX[term]] = (
        1.0,
        0.1,
        0.3,
    )
    friction = _core.inverse_dynamics(vector, np.zeros(4), steady.velocity, steady.load) - steady.load
    made = 0.3 * steady.terms([term], 0.1)[:, 0] * np.sign(steady.velocity)
    assert made == pytest.approx(friction, abs=1e-12)
    assert np.any(made != 0.0)


@pytest.mark.parametrize("family", FRICTION)
def test_less_than_was_found_is_carried(family):
    card = identified(BODY | FRICTION[family], family).card()
    friction = [p for p in card.parameters if is_friction(p.name)]
    assert {target for p in friction for target in SYMBOLS_BY_NAME[p.name].targets} <= set(TERMS)
    assert len(friction) >= 2
    assert all(p.carried is not None and 0.0 <= carried(p) <= p.value for p in friction)
    assert sum(carried(p) for p in friction) < sum(p.value for p in friction)


@pytest.mark.parametrize("name", [name for name in SYMBOLS_BY_NAME if is_friction(name)])
def test_a_negative_prior_is_refused(name, make_study):
    t = np.linspace(0.0, 10.0, 2000)
    with pytest.raises(IdentificationError, match=f"known: found {name} = -1, expected 0 to"):
        pl.fit_joint(t, np.sin(t), np.sin(t), lowpass=None, known={name: -1.0})
    said = f"-1 {SYMBOLS_BY_NAME[name].unit()}"
    with pytest.raises(StudyError) as error:
        make_study(None, ("trim = 20", f'trim = 20\n[model]\nknown = {{ {name} = "{said}" }}'))
    assert f'{name}: found "{said}", expected 0 or more: friction takes energy' in str(error.value)


@pytest.mark.parametrize("base", BODIES)
@pytest.mark.parametrize("family", FRICTION)
def test_a_healthy_joint_is_let_alone(family, base):
    """Twenty seconds to and fro by hand, up to nine tenths of the speed that was recorded, on its default limits."""
    body = BODY | FRICTION[family] | BODIES[base]
    law = pl.supervised(pl.controller(identified(body, family)))
    fastest, w = 0.9 * law.values["velocity_limit"] / 1.5, 2.0 * math.pi * 0.4
    joint = SimulatedJoint(body, 0.0, hold=20.0)
    found = live(law, joint, 20.0, lambda t: min(fastest, w) * math.sin(w * t) * min(0.5 * t, 1.0))
    assert found == ("none", "running", 20.0)
    assert joint.reached > 0.5
