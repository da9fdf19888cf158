"""Finding: held-out prediction error of the chosen model, and the number of independent samples behind it."""

from __future__ import annotations

from collections.abc import Iterator

from ....models.parameter import Verdict
from ....numerics.block_test import count_independent_samples
from ....study.procedures.badge_bounds import MAX_GOOD_ERROR, SOUND_R2
from ..joint_case import JointCase

FAILED_R2 = 0.5
"""A model does not explain the effort if its R2 is below this."""

MIN_INDEPENDENT_SAMPLES = 20.0
"""Below this number of independent samples the error is stated with a reservation."""


def find(case: JointCase) -> Iterator[Verdict]:
    """Report the held-out error of the best family, its failure, or the lack of held-out recordings."""
    fit = case.fit.headline
    held = [p.residual for p in fit.predictions if p.split == "heldout"]
    if fit.fitted_r2 < FAILED_R2:
        yield Verdict(
            "wrong",
            "The fit failed: even of what was fitted, the model explains no more than "
            f"{100 * max(fit.fitted_r2, 0.0):.0f} % of the variance "
            f"(error {fit.fitted_effort_error:.3g} %). Nothing below is this machine's.",
            "Check units, signs and offsets of the channels, and the drive's constant.",
            weight=10.0,
        )
    if not held:
        yield Verdict(
            "warning",
            'No recording is held out (use = "validate"): nothing here says how the model predicts new data.',
        )
        return
    count = count_independent_samples(held)
    error = f"an error of {fit.heldout_effort_error:.2g} % (R2 {fit.heldout_r2:.3f}, {count:.0f} independent samples)"
    if fit.heldout_r2 < FAILED_R2:
        yield Verdict(
            "wrong",
            f"The '{case.best}' family fails on recordings it has never seen: {error}; on the fitted recordings "
            f"{fit.fitted_effort_error:.2g} %.",
            "Check that held-out recordings are of the same machine, in the same units, and move in the same range.",
            weight=9.0,
        )
        return
    yield from _better_on_held_out(case)
    few, large = count < MIN_INDEPENDENT_SAMPLES, fit.heldout_effort_error > MAX_GOOD_ERROR
    good = fit.heldout_r2 > SOUND_R2 and fit.fitted_r2 > FAILED_R2 and not large
    do = f"More than {MAX_GOOD_ERROR:g} % is no good prediction: look for what the model misses." if large else ""
    yield Verdict(
        "warning" if large else "note" if few else "good" if good else "warning",
        f"The '{case.best}' family predicts effort it has never seen with {error}; on the fitted recordings "
        f"{fit.fitted_effort_error:.2g} %.",
        f"{do} {'So few samples say little: hold out more.' * few}".strip(),
        weight=1.0,
    )


def _better_on_held_out(case: JointCase) -> Iterator[Verdict]:
    """Report a family that predicts held-out recordings better than the chosen one, which they may not choose."""
    errors = {name: fit.heldout_effort_error for name, fit in case.fits.items()}
    name = min(errors, key=errors.__getitem__)
    gain = 1.0 - errors[name] / errors[case.best]
    if gain >= case.study.model.min_improvement:
        yield Verdict(
            "note",
            f"On held-out recordings the '{name}' family errs by {errors[name]:.3g} %, '{case.best}' by "
            f"{errors[case.best]:.3g} %. What is held out may not choose, and the fitted recordings do not show it.",
            'Mark recordings of that kind use = "fit", and hold others out.',
        )
