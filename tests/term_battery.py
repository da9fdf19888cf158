"""Battery over the catalogue of friction terms: what is missing for a term to be whole, in words; nothing if all are.

It runs on the installed package and on copies of it in which a term is half added.
"""

from types import SimpleNamespace

import numpy as np

from pellucid import _core
from pellucid.controllers.control_law import LAWS, ControlLaw
from pellucid.controllers.supervised import body_of, body_resistance
from pellucid.joint.study.joint_findings import report_weak_parameter
from pellucid.models.estimates import Parameter
from pellucid.models.fields import largest_friction
from pellucid.models.friction_terms import CORE_FIELDS, FRICTION_FAMILIES, TERMS, TERMS_BY_NAME, is_friction
from pellucid.models.joint import FAMILIES, NAMES, PARAMETER_INDEX, SYMBOLS_BY_NAME, joint_model
from pellucid.study.drawing.style import COLOURS
from pellucid.study.pages.quantities import FAMILIES as WORDS_OF_FAMILIES
from pellucid.study.pages.quantities import PARAMETER_LABELS
from pellucid.study.study_file import parameter_units

COEFFICIENT, SPEEDS, LOAD = 0.2, (1e-6, 0.5, 1.7, 10.0), 1.2
NO_FRICTION = {"inertia", "gravity_sine", "gravity_cosine", "offset"}
UNITS = {"<scaled_effort>": "N*m", "<coordinate>": "rad"}


def friction_of(target: str, value: float, speed: float, load: float) -> float:
    """Return the most that one coefficient resists by at a speed and a load, in any direction, as the core has it."""
    vector = np.zeros(len(NAMES))
    vector[PARAMETER_INDEX["inertia"]], vector[PARAMETER_INDEX["stribeck_velocity"]] = 1.0, 0.1
    vector[PARAMETER_INDEX[target]] = value
    v, y = np.array([speed, speed, -speed, -speed]), np.array([load, -load, load, -load])
    return float(np.max(np.abs(_core.inverse_dynamics(vector, np.zeros(4), v, y) - y)))


def law_with(**values: float) -> ControlLaw:
    """Return a joint's law whose body has these coefficients."""
    known = {
        "inertia": 0.05, "gravity_sine": LOAD, "stribeck_velocity": 0.1, "velocity_width": 0.1, "effort_limit": 5.0,
        "rate_limit": 500.0, "velocity_limit": 10.0, "position_min": -2.0, "position_max": 2.0, "period": 0.001,
        "max_age": 0.005,
    }  # fmt: skip
    return ControlLaw("joint", LAWS["joint"].defaults | known | values)


def faults() -> list[str]:
    """Return what is missing, a sentence for each fault."""
    found = []
    for name in NAMES:
        rubs = any(friction_of(name, COEFFICIENT, speed, LOAD) for speed in SPEEDS)
        if rubs and name not in NO_FRICTION and CORE_FIELDS[name].resists is None:
            found.append(f"{name}: friction.hpp does not say what it resists by")
        if CORE_FIELDS[name].resists is not None:
            found += [f"{name}: {fault}" for fault in _faults_of_coefficient(name)]
    freed = {name for family in FAMILIES for name in _names(family)}
    for term in TERMS:
        found += [f"{term.name}: {fault}" for fault in _faults_of_term(term)]
        if term.name not in freed:
            found.append(f"{term.name}: no family frees it")
    for family in FRICTION_FAMILIES:
        if not WORDS_OF_FAMILIES.get(family.name):
            found.append(f"family {family.name}: has no words")
        if family.colour not in COLOURS:
            found.append(f"family {family.name}: has no colour")
    return found


def _names(family: str) -> set[str]:
    """Return the names that a family frees, with one load coefficient or with two."""
    made = (
        joint_model(family, motion="rotary", effort_unit="N*m", gravity="sine", separate_load=separate)
        for separate in (False, True)
    )
    return {name for model in made for name in model.names}


def _faults_of_coefficient(name: str) -> list[str]:
    """Return what is missing for a coefficient of the core that resists."""
    found, body = [], body_of(law_with(**{name: COEFFICIENT}))
    if not any(name in term.targets for term in TERMS):
        found.append("the catalogue has no term for it")
    if CORE_FIELDS[name].lower < 0.0:
        found.append("may be negative, so that it would drive the joint")
    for speed in SPEEDS:
        resists = friction_of(name, COEFFICIENT, speed, LOAD)
        if largest_friction(LAWS["joint"].fields, {name: COEFFICIENT}, speed, LOAD) < 0.999 * resists:
            found.append(f"the limits do not count it at {speed:g} rad/s")
        if body_resistance(body, speed, LOAD) < 0.999 * resists:
            found.append(f"the supervisor does not count it at {speed:g} rad/s")
    return found


def _faults_of_term(term) -> list[str]:
    """Return what is missing for a term of the catalogue."""
    found = []
    if term.shapes not in TERMS_BY_NAME and not (is_friction(term.name) and term.resists):
        found.append("neither resists nor shapes a term that does")
    if not term.words or PARAMETER_LABELS.get(term.name) != term.words:
        found.append("the page has no words for it")
    if SYMBOLS_BY_NAME[term.name].lower != 0.0:
        found.append("a negative prior is not refused")
    if parameter_units(term.name, UNITS) not in (term.unit(), (term.unit(),)):
        found.append("study.toml does not know its unit")
    if not term.weak_because or not term.advice.endswith("."):
        found.append("has no advice")
    verdicts = list(report_weak_parameter(_case_with(term.name)))
    if [verdict.do for verdict in verdicts] != [term.advice] or "{" in verdicts[0].text:
        found.append("its advice cannot be reached")
    return found


def _case_with(name: str) -> SimpleNamespace:
    """Return a case in which one parameter is not identifiable, and nothing but the motion is to blame."""
    parameter = Parameter(name, "1", 0.1, 1.0, identifiable=False)
    estimate = SimpleNamespace(parameters=(parameter,), covariance=np.eye(1))
    family = SimpleNamespace(estimate=estimate)
    return SimpleNamespace(
        data=SimpleNamespace(motions=[SimpleNamespace(velocity=np.array([0.0, 1.0]))]),
        rotary=True, level=0.95, fit=SimpleNamespace(headline=family, fitted_effort_error=1.0),
    )  # fmt: skip
