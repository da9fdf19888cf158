"""Finding: agreement of a posterior with the intervals, and its result where an interval is refused."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Verdict
from ....study.procedures.posterior_beside import pair_with_posterior, posterior_verdicts
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """Compare a requested posterior with the least-squares intervals of the best family."""
    if case.no_posterior:
        yield Verdict("warning", f"No posterior could be drawn: {case.no_posterior}.")
    if case.posterior is not None:
        compared = pair_with_posterior(case.fit.estimate.parameters, case.posterior)
        yield from posterior_verdicts(compared, case.posterior, case.level)
