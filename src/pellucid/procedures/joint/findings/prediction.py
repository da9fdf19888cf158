"""How the best family predicts effort that it has never seen."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....fit.parameter import Verdict
from ..joint_case import JointCase


def find(case: JointCase) -> Iterator[Verdict]:
    """The held-out error of the best family, or that nothing is held out."""
    fit = case.fit
    if not np.isfinite(fit.heldout_effort_error):
        yield Verdict(
            "warning",
            'No recording is held out (use = "validate"): nothing here says how the model predicts new data.',
        )
        return
    yield Verdict(
        "good" if fit.heldout_r2 > 0.8 else "warning",
        f"The '{case.best}' family predicts effort it has never seen with an error of "
        f"{fit.heldout_effort_error:.2g} % (R2 {fit.heldout_r2:.3f}); on the fitted recordings "
        f"{fit.fitted_effort_error:.2g} %.",
        weight=1.0,
    )
