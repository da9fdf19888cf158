"""Finding: one model fits the recordings of a robot unequally well."""

from collections.abc import Iterator

import numpy as np

from ....models.parameter import Verdict
from ..tree_result import TreeResult

MIN_ERROR_RATIO = 1.5
"""A recording disagrees only if its error exceeds this multiple of the best recording's."""

MIN_ERROR_DIFFERENCE_PERCENT = 2.0
"""A recording disagrees only if its error exceeds the best recording's by more than this [% of the effort]."""


def find(case: TreeResult) -> Iterator[Verdict]:
    """Report the joints at which fitted recordings disagree."""
    fitted = [t for t in case.traces if t.use == "fit"]
    names = list(dict.fromkeys(t.recording for t in fitted))
    if len(names) < 2:
        return
    for k, joint in enumerate(case.names):
        errors = {}
        for name in names:
            parts = [t for t in fitted if t.recording == name]
            effort, off = (
                np.concatenate([x(t)[t.moving[:, k], k] for t in parts])
                for x in (lambda t: t.effort, lambda t: t.effort - t.predicted)
            )
            if len(off):
                errors[name] = 100.0 * float(np.sqrt(np.mean(off**2) / np.mean(effort**2)))
        worst, best = max(errors, key=errors.get), min(errors, key=errors.get)
        if errors[worst] > max(MIN_ERROR_RATIO * errors[best], errors[best] + MIN_ERROR_DIFFERENCE_PERCENT):
            yield Verdict(
                "warning",
                f"One model for all recordings misses {errors[worst]:.2g} % of {joint}'s effort in {worst} and "
                f"{errors[best]:.2g} % in {best}: something has changed between them, warmth or a payload perhaps.",
                "Identify each alone and compare, or say in study.toml what was different.",
                weight=errors[worst] / errors[best],
            )
