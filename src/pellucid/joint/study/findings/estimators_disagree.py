"""Finding: estimators of the same parameters disagree by more than their intervals allow."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import ndtri

from ....models.parameter import Parameter, Verdict
from ....numerics.block_test import HeldOutComparison
from ....study.pages.quantities import METHODS, interval_text, number, parameter_label, unit_text
from ...fit.estimator_choice import DECISIVE_ERROR_RATIO
from ...fit.joint_estimate import JointEstimate
from ..joint_case import JointCase

MIN_EFFORT_SHARE = 0.02
"""A difference between two values is reported only if it changes the effort by more than this share (RMS)."""

MAX_ERROR_RATIO = 1.2
"""An estimator is the wrong choice if its error on left-out blocks exceeds this multiple of the best one's, and a
paired test finds it worse."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the disagreeing estimators, their parameters and errors on left-out blocks, and which one is used."""
    fit, choice = case.fit, case.fit.choice
    estimates = {fit.estimate.method: fit.estimate, **{n: e for n, e in fit.others.items() if e.converged}}
    apart = {p.name: _disagreeing_methods(p, estimates, case.level) for p in fit.estimate.parameters}
    apart = {name: methods for name, methods in apart.items() if methods}
    worse = {what: found for what, found in _contests(case).items() if _is_wrong_choice(found, choice.method)}
    winners = {found.winner for found in _contests(case).values()}
    shown = {"ls", choice.method, *winners, *(m for methods in apart.values() for m in methods)}
    involved = [m for m in estimates if m in shown]
    if apart:
        differences_text = "; ".join(
            f"{parameter_label(name)} is "
            + ", ".join(f"{interval_text(estimates[m][name], 0.95)} by {METHODS[m]}" for m in ("ls", *methods))
            for name, methods in apart.items()
        )
        text = (
            f"Estimators disagree by more than their intervals: {differences_text}. The model is not the whole truth, "
        )
        text += "and each weighs what it misses differently."
        yield Verdict("warning", f"{text} {_used(case, involved)}", _advice(case), weight=10.0)
    elif worse:
        text = f"The headline's values are the better ones for {choice.purpose}, but not for {' and '.join(worse)}."
        yield Verdict("warning", f"{text} {_used(case, involved)}", _advice(case), weight=5.0)
    elif choice.method != "ls":
        text = f"Ordinary least squares does worse than {METHODS[choice.method]} on left-out blocks."
        yield Verdict("note", f"{text} {_used(case, involved)}", weight=5.0)


def _disagreeing_methods(parameter: Parameter, estimates: dict[str, JointEstimate], level: float) -> list[str]:
    """Return the methods whose interval of a parameter does not overlap that of least squares.

    The level holds for all comparisons together.
    """
    if parameter.at_bound:
        return []
    count = max(1, sum(len(e.parameters) for m, e in estimates.items() if m != "ls"))
    times = float(ndtri(1.0 - 0.5 * (1.0 - level) / count))
    found = []
    for method, estimate in estimates.items():
        other = estimate.get(parameter.name)
        if method == "ls" or other is None or other.at_bound:
            continue
        difference = abs(other.value - parameter.value)
        sure = difference > times * np.hypot(other.standard_error, parameter.standard_error)
        if sure and difference * parameter.influence > MIN_EFFORT_SHARE:
            found.append(method)
    return found


def _contests(case: JointCase) -> dict[str, HeldOutComparison]:
    found = {"torque": case.fit.choice.torque, "simulation": case.fit.choice.simulation}
    return {what: contest for what, contest in found.items() if contest is not None}


def _is_wrong_choice(found: HeldOutComparison, method: str) -> bool:
    """Return whether a method's errors are far larger than the best one's, or larger and significantly so."""
    if method not in found.errors:
        return False
    ratio = found.errors[method] / found.errors[found.winner] if found.errors[found.winner] else np.inf
    return ratio > DECISIVE_ERROR_RATIO or (ratio > MAX_ERROR_RATIO and found.worse(method))


def _used(case: JointCase, involved: list[str]) -> str:
    """Return in words the errors of the methods, and which one's values are used."""
    choice = case.fit.choice
    if choice.torque is None:
        return f"Nothing was compared: the headline is by {METHODS[choice.method]}."
    clauses = []
    if choice.simulation is not None:
        scale, unit = (float(np.degrees(1.0)), "deg") if case.rotary else (1e3, "mm")
        clauses.append(f"the motion is simulated to {_errors(choice.simulation, involved, unit, scale)}")
    clauses.append(f"effort is predicted to {_errors(choice.torque, involved, case.fit.model.effort_unit)}")
    return (
        f"On blocks of the fitted recordings, each left out in turn, {' and '.join(clauses)}. "
        f"The headline is by {METHODS[choice.method]}."
    )


def _errors(found: HeldOutComparison, involved: list[str], unit: str, scale: float = 1.0) -> str:
    each = [f"{number(scale * found.errors[m], digits=3)} by {METHODS[m]}" for m in involved if m in found.errors]
    return f"{', '.join(each)} ({unit_text(unit)}, RMS)"


def _advice(case: JointCase) -> str:
    other = "simulation" if case.fit.choice.purpose == "torque" else "torque"
    return f'It is chosen for {case.fit.choice.purpose}; write [model] purpose = "{other}" to have it for {other}.'
