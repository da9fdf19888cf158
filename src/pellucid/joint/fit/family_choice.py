"""Choose the simplest friction family that predicts blocks of the fitted recordings no worse than the best.

Only fitted recordings take part: each block is predicted from the others. A richer family must save a stated share of
the simpler one's error, and one of two things must show that this is no chance. Either these recordings tell a term of
its own from zero at a confidence level that is corrected for the number of families (Bonferroni), or a paired test over
blocks finds the simpler family worse. The test has little power where few blocks have most of the error although the
term itself is plain. An interval allows for everything that the model misses, so that it may include zero although the
family predicts better throughout; the term's value is then reported as not identified. A term that cannot be negative
is tested on one side: where it is 0, its estimate is 0 in one half of all recordings and as far above as a normal
variable in the other half [1]_.

.. [1] H. Chernoff, "On the distribution of the likelihood ratio", Annals of Mathematical Statistics 25, 1954.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.estimates import Parameter
from ...models.friction_terms import shape_index
from ...models.joint import SYMBOLS_BY_NAME
from ...numerics.block_test import MIN_IMPROVEMENT, HeldOutComparison, compare_held_out
from .estimator_choice import Residuals, is_nearly
from .friction_family import FamilyFit
from .joint_estimate import JointEstimate

SPLIT_SUFFIXES = (("_positive", "_negative", ""), ("_motoring", "_generating", "_friction"))
"""Suffixes of two terms that a simpler family combines into one, and the suffix of that one."""


@dataclass(frozen=True)
class UnprovenFamily:
    """A family that predicts better than a simpler one, but neither significantly nor with an identified term."""

    name: str
    simpler: str  # the family that it was compared with
    improvement: float  # share of that family's error that it saves
    terms: tuple[str, ...]  # what it adds, in words


@dataclass(frozen=True)
class FamilyContest:
    """The chosen family, with the comparison behind the choice."""

    best: str
    comparison: HeldOutComparison  # errors of all families on blocks of the fitted recordings
    unproven: tuple[UnprovenFamily, ...] = ()
    is_simulated: bool = False  # whether the errors are those of the simulated position


def order_by_simplicity(fits: Mapping[str, FamilyFit], found: HeldOutComparison) -> Sequence[str]:
    """Return the families in the order of their number of free parameters, then of their error."""
    return sorted(fits, key=lambda n: (len(fits[n].model.symbols), found.errors[n]))


def choose_family(
    fits: Mapping[str, FamilyFit],
    level: float,
    min_improvement: float = MIN_IMPROVEMENT,
    simulated: Residuals | None = None,
) -> FamilyContest:
    """Return the simplest family that is not worse than the best, and the families that were passed over.

    A family is worse if another saves at least the share `min_improvement` of its error: of the effort, or of the
    `simulated` position of each family that can be simulated, if there are any. A family is passed over if none of its
    own terms is told from zero by intervals at `level` for all families together, and the nearest simpler family is not
    significantly worse.
    """
    residuals = simulated or {name: fit.crossed for name, fit in fits.items()}
    comparison = compare_held_out(residuals, min_improvement)
    each = 1.0 - (1.0 - level) / max(len(fits) - 1, 1)
    left = list(order_by_simplicity({name: fits[name] for name in residuals}, comparison))
    unproven: list[UnprovenFamily] = []
    while True:
        smallest = min(comparison.errors[n] for n in left)
        best = next(n for n in left if is_nearly(comparison.errors[n], smallest, min_improvement))
        simpler = [n for n in left if len(fits[n].model.symbols) < len(fits[best].model.symbols)]
        if not simpler:
            break
        nearest = min(simpler, key=comparison.errors.__getitem__)
        added = added_terms(fits[best].estimate, fits[nearest].model.names, each)
        pair = compare_held_out({name: residuals[name] for name in (nearest, best)}, min_improvement)
        if not added or any(added.values()) or pair.worse(nearest):
            break
        unproven.append(UnprovenFamily(best, nearest, pair.improvement(nearest), tuple(added)))
        left.remove(best)
    return FamilyContest(best, comparison, tuple(unproven), bool(simulated))


def added_terms(estimate: JointEstimate, simpler: Sequence[str], level: float) -> dict[str, bool]:
    """Return the terms of an estimate that a simpler family lacks, and whether each is identified.

    `simpler` are the parameters of the simpler family. A term is identified at `level` if it is told from 0. If the
    simpler family has one term for both directions, the difference between the directions counts. A parameter that
    shapes a friction curve is no term: at 0 and at any other value, the curve may be absent. What a term spreads
    between recordings is no doubt that it is there.
    """
    names, added = [p.name for p in estimate.parameters], {}
    from scipy.special import ndtri  # SciPy takes a third of a second to load, and `check` chooses no family

    between = estimate.between_recordings
    covariance = estimate.covariance - (between.covariance if between is not None else 0.0)
    shape = shape_index(names)
    for i, parameter in enumerate(estimate.parameters):
        name = parameter.name
        if name in simpler or i == shape:
            continue
        for one, other, both in SPLIT_SUFFIXES:
            stem = name.removesuffix(one).removesuffix(other)
            if stem == name or f"{stem}{both}" not in simpler or f"{stem}{other}" not in names:
                continue
            if name.endswith(one):
                k = names.index(f"{stem}{other}")
                variance = covariance[i, i] + covariance[k, k] - 2.0 * covariance[i, k]
                apart = abs(parameter.value - estimate.parameters[k].value)
                label = f"the difference of {stem.replace('_', ' ')} between {one[1:]} and {other[1:]}"
                added[label] = bool(apart > float(ndtri(0.5 + 0.5 * level)) * np.sqrt(max(variance, 0.0)))
            break
        else:
            added[name.replace("_", " ")] = is_told_from_zero(
                replace(parameter, standard_error=float(np.sqrt(max(covariance[i, i], 0.0)))), level
            )
    return added


def is_told_from_zero(parameter: Parameter, level: float) -> bool:
    """Return whether a parameter differs from 0 at a confidence `level`: above 0 alone where it cannot be negative."""
    from scipy.special import ndtri

    if parameter.at_bound or parameter.undetermined or not 0.0 < parameter.standard_error < np.inf:
        return False
    if SYMBOLS_BY_NAME[parameter.name].lower >= 0.0:
        return bool(parameter.value > float(ndtri(level)) * parameter.standard_error)
    return bool(abs(parameter.value) > float(ndtri(0.5 + 0.5 * level)) * parameter.standard_error)
