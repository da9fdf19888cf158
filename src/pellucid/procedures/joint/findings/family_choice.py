"""Finding: the reason for the chosen friction family, from errors on the same held-out samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.special import ndtri

from ....fit.block_test import SIGNIFICANCE_LEVEL
from ....fit.joint.joint_estimate import JointEstimate
from ....fit.parameter import Verdict
from ..joint_case import JointCase

SPLIT_SUFFIXES = (("_positive", "_negative", ""), ("_motoring", "_generating", "_friction"))
"""Suffixes of two terms that a simpler family combines into one, and the suffix of that one."""


def added_terms(estimate: JointEstimate, simpler: Sequence[str], level: float) -> dict[str, bool]:
    """Return the terms of an estimate that a simpler family lacks, and whether each is identified.

    `simpler` are the parameters of the simpler family. A term is identified if its interval at `level` excludes 0. If
    the simpler family has one term for both directions, the difference between the directions counts.
    """
    names, added = [p.name for p in estimate.parameters], {}
    times = float(ndtri(0.5 + 0.5 * level))
    for i, parameter in enumerate(estimate.parameters):
        name = parameter.name
        if name in simpler:
            continue
        for one, other, both in SPLIT_SUFFIXES:
            stem = name.removesuffix(one).removesuffix(other)
            if stem == name or f"{stem}{both}" not in simpler or f"{stem}{other}" not in names:
                continue
            if name.endswith(one):
                k = names.index(f"{stem}{other}")
                variance = estimate.covariance[i, i] + estimate.covariance[k, k] - 2.0 * estimate.covariance[i, k]
                apart = abs(parameter.value - estimate.parameters[k].value)
                label = f"the difference of {stem.replace('_', ' ')} between {one[1:]} and {other[1:]}"
                added[label] = bool(apart > times * np.sqrt(max(variance, 0.0)))
            break
        else:
            low, high = parameter.interval(level)
            is_found = parameter.identifiable and not parameter.at_bound and not low <= 0.0 <= high
            added[name.replace("_", " ")] = bool(is_found)
    return added


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the families that predict significantly worse, and those that predict no better."""
    if len(case.fits) == 1 or case.contest is None:
        return
    found, best = case.contest, case.best
    where = (
        "on held-out effort" if np.isfinite(case.fit.heldout_effort_error) else "on blocks predicted from the others"
    )
    simpler = [n for n in case.fits if len(case.fits[n].model.symbols) < len(case.fits[best].model.symbols)]
    if simpler:
        nearest = min(simpler, key=found.errors.__getitem__)
        gain = 100.0 * (1.0 - found.errors[best] / found.errors[nearest])
        better = f"The '{best}' family is {gain:.2g} % better {where} than '{nearest}'"
        added = added_terms(case.fit.headline.estimate, case.fits[nearest].model.names, case.level)
        open_ones = [name for name, is_found in added.items() if not is_found]
        if added and len(open_ones) == len(added):
            yield Verdict(
                "note",
                f"{better}, but these recordings do not identify what it adds to '{nearest}' "
                f"({', '.join(open_ones)}): the better prediction is no evidence of that friction.",
            )
            return
        text = f"{better}, and every simpler family is significantly worse than the best "
        text += f"(p < {SIGNIFICANCE_LEVEL:g}, paired test over {found.blocks} or more blocks)."
        if open_ones:
            text += f" Of what it adds, {', '.join(open_ones)} is not identifiable and did not decide it."
        yield Verdict("good", text)
    elif found.winner != best:
        gain = 100.0 * (1.0 - found.errors[found.winner] / found.errors[best])
        yield Verdict(
            "note",
            f"The '{found.winner}' family is {gain:.2g} % better {where}, which may be chance "
            f"(p = {found.p_values[best]:.2g}): the simplest family that is not significantly worse is used.",
        )
    else:
        yield Verdict("note", f"No richer friction family predicts better {where} than '{best}'.")
