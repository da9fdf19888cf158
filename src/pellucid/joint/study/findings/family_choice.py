"""Finding: the reason for the chosen friction family, from errors on blocks of the fitted recordings."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Verdict
from ....study.procedures.badge_bounds import MAX_GOOD_ERROR
from ...fit.family_choice import added_terms
from ..joint_case import JointCase

WHERE_TEXT = "on blocks of the fitted recordings, each predicted from the others"
"""Data that families are chosen by, in words."""

SIMULATED_TEXT = "at simulating the motion, "
"""What families are chosen by if it is not the effort, in words."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report why the chosen family is used, and the richer ones that were passed over."""
    if len(case.fits) == 1 or case.contest is None:
        return
    found, best = case.contest.comparison, case.best
    where = (SIMULATED_TEXT if case.contest.is_simulated else "") + WHERE_TEXT
    for passed in case.contest.unproven:
        yield Verdict(
            "note",
            f"The '{passed.name}' family is {100.0 * passed.improvement:.2g} % better {where}, than "
            f"'{passed.simpler}', but these recordings do not identify what it adds ({', '.join(passed.terms)}): "
            f"the better prediction is no evidence of that friction, and '{best}' is used.",
        )
    simpler = [n for n in found.errors if len(case.fits[n].model.symbols) < len(case.fits[best].model.symbols)]
    if simpler:
        nearest = min(simpler, key=found.errors.__getitem__)
        gain = 100.0 * (1.0 - found.errors[best] / found.errors[nearest])
        added = added_terms(case.fit.estimate, case.fits[nearest].model.names, case.level)
        open_ones = [name for name, is_found in added.items() if not is_found]
        text = f"The '{best}' family is {gain:.2g} % better {where}, than '{nearest}', and every simpler family "
        text += f"is worse than the best by {100.0 * found.min_improvement:.2g} % or more (paired test over "
        text += f"{found.blocks} or more blocks: p = {found.p_values[nearest]:.2g} for '{nearest}')."
        if open_ones:
            is_partly = len(open_ones) < len(added)
            advice = " and did not decide it." if is_partly else ": use its predictions, not its value."
            text += f" Of what it adds, {', '.join(open_ones)} is not identified{advice}"
        chosen = case.fit.headline
        error = chosen.heldout_effort_error if case.judged_on_held_out else chosen.fitted_effort_error
        is_proven = not added or len(open_ones) < len(added)
        yield Verdict("good" if is_proven and error <= MAX_GOOD_ERROR else "note", text)
    elif found.winner != best and not any(passed.name == found.winner for passed in case.contest.unproven):
        gain = 100.0 * found.improvement(best)
        yield Verdict(
            "note",
            f"The '{found.winner}' family is {gain:.2g} % better {where} (p = {found.p_values[best]:.2g}): a "
            f"richer family is used only if it saves {100.0 * found.min_improvement:.2g} % of the error.",
        )
    elif found.winner == best:
        yield Verdict("note", f"No richer friction family predicts better {where} than '{best}'.")
