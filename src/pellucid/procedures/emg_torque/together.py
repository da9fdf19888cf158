"""Muscles of all joints of a study calibrated at once, and judged on what was not fitted.

Twice: with every muscle's time from envelope to force between 10 and 100 ms, and with an offset of the EMG's stream
found beside the muscles, which is the recording's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._errors import IdentificationError
from ..._processes import among_helpers
from ...estimators.condition_choice import ERROR_BAND_SHARE
from ...estimators.cross_validation import Score, score
from ...estimators.hill_together import HillTogether, TrialByJoint, fit_together
from ...estimators.never_recorded import UnrecordedMuscles, fit_unrecorded_muscles
from ...estimators.torque_trial import TorqueTrial
from ...fit.posterior.calibration_posterior import CalibrationPosterior, calibration_posterior
from .evaluated import Calibrated, TorqueTrace

WORDS = {"hill": "muscles together", "hill.offset": "together, offset of the EMG found"}
"""Both ways, by the part of their figures' ids."""


DRAWN, NEVER = "posterior", "never_recorded"
BESIDE = {DRAWN: "together, mean of the posterior's draws", NEVER: "together, with muscles that had no electrode"}
"""What stands beside both ways, likewise."""


@dataclass(frozen=True)
class TogetherScore:
    """One joint on one recording, predicted by muscles calibrated over all joints."""

    how: str  # In `WORDS` or `BESIDE`
    joint: str
    recording: str  # ``""`` for all trials, each left out in turn
    score: Score
    coverage: float  # Share of samples within the band of `ERROR_BAND_SHARE`


@dataclass(frozen=True, eq=False)
class Together:
    """What one calibration over all joints found."""

    fits: Mapping[str, HillTogether] = field(repr=False)  # By way, in `WORDS`; fitted to all that may be fitted
    scores: tuple[TogetherScore, ...]
    traces: tuple[TorqueTrace, ...] = field(repr=False)  # Of one recording, a joint each; predicted by way
    posterior: CalibrationPosterior | None = field(default=None, repr=False)  # Of the first way, if it was asked for
    never: UnrecordedMuscles | None = field(default=None, repr=False)  # Beside the first way
    beside: tuple[TogetherScore, ...] = ()  # By these, on recordings of their own

    @property
    def what(self) -> str:
        """The joints in words."""
        return _words(self.fits["hill"].joints)

    @property
    def offset_carries_over(self) -> bool:
        """Whether the EMG stream's offset makes R² larger on what was not fitted, in the mean over joints."""
        r2 = {how: np.mean([s.score.r2 for s in self.scores if s.how == how]) for how in WORDS}
        return bool(r2["hill.offset"] > r2["hill"])


def muscles_together(found: Calibrated, tell: Callable[[str, float], None], posterior: bool = False) -> Together | None:
    """Calibrate over all joints that a study found trials of, and draw a `posterior`; None where there is one joint, or
    muscles were passed over, which is then said why."""
    across = found.across
    if len(across) < 2 or any(joint in found.passed_over for joint in across):
        return None
    what = _words(tuple(across))
    try:
        made = _judged(across, lambda i, share: tell(f"muscles of {what} together", 1.0))
        if posterior:
            tell(f"drawing a posterior of the muscles of {what}", 1.0)
            made = _drawn(made, across)
        return made
    except IdentificationError as error:
        found.passed_over[f"{what} together"] = str(error)
        return None


def _judged(across: Mapping[str, Sequence[TorqueTrial]], begun: Callable[[int, float], None]) -> Together:
    fitted = {joint: [t for t in own if not t.heldout] for joint, own in across.items()}
    held = {joint: [t for t in own if t.heldout] for joint, own in across.items()}
    names = [t.name for t in next(iter(held.values()))]
    # Where no recording is held out, each is predicted by what was fitted to the others.
    left_out = () if names else next(iter(fitted.values()))
    runs = [(how, out) for how in WORDS for out in (None, *dict.fromkeys(t.group for t in left_out))]
    found = among_helpers([(_fitted, fitted, how, out) for how, out in runs], begun=begun)
    by_run = dict(zip(runs, found, strict=True))
    fits = {how: by_run[how, None] for how in WORDS}
    scores, shown = [], {}
    for how, fit in fits.items():
        if names:
            made = {name: (fit, _trial(held, name)) for name in names}
        else:
            made = {t.name: (by_run[how, t.group], _trial(fitted, t.name)) for t in left_out}
        each = []
        for name, (by, trial) in made.items():
            torque, half = by.predict(trial), by.half_width(trial, ERROR_BAND_SHARE)
            for joint in fit.joints:
                reference = trial[joint].torque
                each.append(_scored(how, joint, trial, torque, half))
                trace = TorqueTrace(joint, name, trial[joint].time, reference, {}, {}, ERROR_BAND_SHARE)
                trace = shown.setdefault((joint, name), trace)
                trace.predicted[how], trace.half_width[how] = torque[joint], half[joint]
        scores += each if names else [_mean(how, joint, each) for joint in fit.joints]
    first = names[0] if names else next(name for _, name in shown)
    made = Together(fits, tuple(scores), tuple(t for (_, name), t in shown.items() if name == first))
    return _with_never_recorded(made, fitted, held) if names else made


def _with_never_recorded(
    found: Together, fitted: Mapping[str, Sequence[TorqueTrial]], held: Mapping[str, Sequence[TorqueTrial]]
) -> Together:
    """With muscles that no electrode drives, on recordings of their own."""
    fit, scores = found.fits["hill"], []
    never = fit_unrecorded_muscles(fit, fitted)
    for name in [] if never is None else [t.name for t in next(iter(held.values()))]:
        trial = _trial(held, name)
        torque, half = never.predict(trial), fit.half_width(trial, ERROR_BAND_SHARE)
        scores += [_scored(NEVER, joint, trial, torque, half) for joint in fit.joints]
    return replace(found, never=never, beside=tuple(scores))


def _scored(how: str, joint: str, trial: TrialByJoint, torque: Mapping, half: Mapping) -> TogetherScore:
    reference = trial[joint].torque
    inside = float(np.mean(np.abs(reference - torque[joint]) <= half[joint]))
    return TogetherScore(how, joint, trial[joint].name, score(reference, torque[joint]), inside)


def _drawn(found: Together, across: Mapping[str, Sequence[TorqueTrial]]) -> Together:
    """With draws, and what they tell of recordings that were not fitted; of trials left out in turn they tell
    nothing, which they were fitted to."""
    fit = found.fits["hill"]
    posterior = calibration_posterior(fit.fit, title=f"Posterior of the muscles of {found.what}")
    scores = []
    for name in () if posterior.unsettled else [t.name for t in next(iter(across.values())) if t.heldout]:
        trial = _trial(across, name)
        torque, half = fit.predict_with_posterior(posterior, trial, ERROR_BAND_SHARE)
        scores += [_scored(DRAWN, joint, trial, torque, half) for joint in fit.joints]
    return replace(found, posterior=posterior, beside=(*found.beside, *scores))


def _fitted(fitted: Mapping[str, Sequence[TorqueTrial]], how: str, out: str | None) -> HillTogether:
    """Muscles of all joints, fitted to all trials but those of the group that is left out."""
    others = {joint: [t for t in own if t.group != out] for joint, own in fitted.items()}
    return fit_together(others, offset=how != "hill")


def _words(joints: Sequence[str]) -> str:
    return f"{', '.join(joints[:-1])} and {joints[-1]}"


def _trial(across: Mapping[str, Sequence[TorqueTrial]], name: str) -> dict[str, TorqueTrial]:
    return {joint: next(t for t in own if t.name == name) for joint, own in across.items()}


def _mean(how: str, joint: str, each: Sequence[TogetherScore]) -> TogetherScore:
    """Over trials left out, which count the same however long they are."""
    own = [s for s in each if s.joint == joint]
    rmse, r2, inside = (
        float(np.mean(x)) for x in zip(*((s.score.rmse, s.score.r2, s.coverage) for s in own), strict=True)
    )
    return TogetherScore(how, joint, "", Score(rmse, r2), inside)
