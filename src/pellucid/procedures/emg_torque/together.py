"""Muscles of all joints of a study calibrated at once, and judged on what was not fitted.

Twice: with every muscle's time from envelope to force between 10 and 100 ms, and with an offset of the EMG's stream
found beside the muscles, which is the recording's own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..._errors import IdentificationError
from ...estimators.cross_validation import Score, score
from ...estimators.hill_together import HillTogether, fit_together
from ...estimators.torque_trial import TorqueTrial
from .evaluated import Calibrated, TorqueTrace

WORDS = {"hill": "muscles together", "hill.offset": "together, offset of the EMG found"}
"""Both ways, by the part of their figures' ids."""


@dataclass(frozen=True)
class TogetherScore:
    """One joint on one recording, predicted by muscles calibrated over all joints."""

    how: str  # In `WORDS`
    joint: str
    recording: str  # ``""`` for all trials, each left out in turn
    score: Score
    coverage: float  # Share of samples within the 95 % band


@dataclass(frozen=True, eq=False)
class Together:
    """What one calibration over all joints found."""

    fits: Mapping[str, HillTogether] = field(repr=False)  # By way, in `WORDS`; fitted to all that may be fitted
    scores: tuple[TogetherScore, ...]
    traces: tuple[TorqueTrace, ...] = field(repr=False)  # Of one recording, a joint each; predicted by way

    @property
    def what(self) -> str:
        """The joints in words."""
        return _words(self.fits["hill"].joints)

    @property
    def offset_carries_over(self) -> bool:
        """Whether the EMG stream's offset makes R² larger on what was not fitted, in the mean over joints."""
        r2 = {how: np.mean([s.score.r2 for s in self.scores if s.how == how]) for how in WORDS}
        return bool(r2["hill.offset"] > r2["hill"])


def muscles_together(found: Calibrated, tell: Callable[[str, float], None]) -> Together | None:
    """Calibrate over all joints that a study found trials of; None where there is one joint, or muscles were passed
    over, which is then said why."""
    across = found.across
    if len(across) < 2 or any(joint in found.passed_over for joint in across):
        return None
    what = _words(tuple(across))
    tell(f"muscles of {what} together", 1.0)
    try:
        return _judged(across)
    except IdentificationError as error:
        found.passed_over[f"{what} together"] = str(error)
        return None


def _judged(across: Mapping[str, Sequence[TorqueTrial]]) -> Together:
    fitted = {joint: [t for t in own if not t.heldout] for joint, own in across.items()}
    held = {joint: [t for t in own if t.heldout] for joint, own in across.items()}
    names = [t.name for t in next(iter(held.values()))]
    fits = {how: fit_together(fitted, offset=how != "hill") for how in WORDS}
    scores, shown = [], {}
    for how, fit in fits.items():
        if names:
            made = {name: (fit, _trial(held, name)) for name in names}
        else:
            # No recording is held out: each is predicted by what was fitted to the others.
            made = {
                t.name: (
                    fit_together(
                        {joint: [o for o in own if o.group != t.group] for joint, own in fitted.items()},
                        offset=how != "hill",
                    ),
                    _trial(fitted, t.name),
                )
                for t in next(iter(fitted.values()))
            }
        each = []
        for name, (by, trial) in made.items():
            torque, half = by.predict(trial), by.half_width(trial)
            for joint in fit.joints:
                reference = trial[joint].torque
                inside = float(np.mean(np.abs(reference - torque[joint]) <= half[joint]))
                each.append(TogetherScore(how, joint, name, score(reference, torque[joint]), inside))
                trace = TorqueTrace(joint, name, trial[joint].time, reference, {}, {})
                trace = shown.setdefault((joint, name), trace)
                trace.predicted[how], trace.half_width[how] = torque[joint], half[joint]
        scores += each if names else [_mean(how, joint, each) for joint in fit.joints]
    first = names[0] if names else next(name for _, name in shown)
    return Together(fits, tuple(scores), tuple(t for (_, name), t in shown.items() if name == first))


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
