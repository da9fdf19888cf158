"""Calibrate the muscles of all joints of a study at once, and score them on held-out recordings.

There are two fits. In both, every muscle's force follows its envelope by 10 to 100 ms. The second also estimates an
offset of the recording's EMG stream.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...._errors import IdentificationError
from ...._processes import results_with_helpers
from ...estimators.condition_choice import BAND
from ...estimators.cross_validation import Score, score
from ...estimators.hill import HillTogether, fit_together
from ...estimators.torque_trial import TorqueTrial, group_pieces
from ...estimators.unrecorded import UnrecordedMuscles, fit_unrecorded_muscles
from ...fit.calibration_posterior import CalibrationPosterior, calibration_posterior
from .evaluation import TorqueTrace
from .torque_findings import CalibrationFindings

PLAIN_FIT = "hill"
"""Part of row ids that names the fit in which EMG and moments have one clock."""

OFFSET_FIT = "hill.offset"
"""Part of row ids that names the fit that also finds the offset of the EMG stream's clock."""

FIT_WORDS = {PLAIN_FIT: "muscles together", OFFSET_FIT: "together, offset of the EMG found"}
"""Description of both fits, by the part of row ids that names each."""

POSTERIOR_VARIANT = "posterior"
"""Part of row ids that names the mean of the posterior's draws."""

UNRECORDED_VARIANT = "never_recorded"
"""Part of row ids that names the fit with muscles that had no electrode."""

VARIANT_WORDS = {
    POSTERIOR_VARIANT: "together, mean of the posterior's draws",
    UNRECORDED_VARIANT: "together, with muscles that had no electrode",
}
"""Description of the variants of the first fit, by the part of row ids that names each."""


@dataclass(frozen=True)
class TogetherScore:
    """Score of one joint on one recording, predicted by muscles calibrated over all joints."""

    how: str  # Fit or variant, a key of `FIT_WORDS` or `VARIANT_WORDS`
    joint: str
    recording: str  # Test recording; ``""`` for all trials, each left out in turn
    score: Score
    coverage: float  # Share of samples within the band at the level `BAND.share`


@dataclass(frozen=True, eq=False)
class TogetherFindings:
    """Result of calibrating muscles over all joints."""

    fits: Mapping[str, HillTogether] = field(repr=False)  # Fits to all fitted trials, by the keys of `FIT_WORDS`
    scores: tuple[TogetherScore, ...]  # Scores of both fits
    traces: tuple[TorqueTrace, ...] = field(repr=False)  # Torque of each joint in one recording, predicted by fit
    posterior: CalibrationPosterior | None = field(default=None, repr=False)  # Posterior of the first fit, if requested
    # Muscles without electrodes, beside the first fit
    never: UnrecordedMuscles | None = field(default=None, repr=False)
    beside: tuple[TogetherScore, ...] = ()  # Scores of the variants in `VARIANT_WORDS`, on held-out recordings

    @property
    def fit(self) -> HillTogether:
        """The first fit, in which EMG and moments have one clock."""
        return self.fits[PLAIN_FIT]

    @property
    def what(self) -> str:
        """Names of the joints in words."""
        return _joint_words(self.fit.joints)

    @property
    def offset_carries_over(self) -> bool:
        """Whether the EMG stream's offset makes R² larger on parts of the fitted trials left out in turn, in the mean
        over joints. Held-out recordings have no part in it."""
        r2 = {how: np.mean([s.r2 for s in self.fits[how].choice.scores.values()]) for how in FIT_WORDS}
        return bool(r2[OFFSET_FIT] > r2[PLAIN_FIT])


def calibrate_together(
    found: CalibrationFindings, tell: Callable[[str, float], None], posterior: bool = False
) -> TogetherFindings | None:
    """Calibrate muscles over all joints of an evaluation, with a `posterior` if requested.

    Return None for a single joint, or if muscles cannot be fitted. The reason is then noted in `found`.
    """
    across = found.across
    if len(across) < 2 or any(joint in found.passed_over for joint in across):
        return None
    what = _joint_words(tuple(across))
    try:
        made = _evaluate_fits(across, lambda i, share: tell(f"muscles of {what} together", 1.0))
        if posterior:
            tell(f"drawing a posterior of the muscles of {what}", 1.0)
            made = _add_posterior(made, across)
        return made
    except IdentificationError as error:
        found.passed_over[f"{what} together"] = str(error)
        return None


def _evaluate_fits(
    across: Mapping[str, Sequence[TorqueTrial]], begun: Callable[[int, float], None]
) -> TogetherFindings:
    """Fit both ways and score them on held-out recordings, or on groups of trials left out in turn."""
    fitted = {joint: [t for t in own if not t.heldout] for joint, own in across.items()}
    held = {joint: [t for t in own if t.heldout] for joint, own in across.items()}
    names = list(group_pieces(next(iter(held.values()))))
    # Without held-out recordings, each group of trials is predicted by muscles fitted to the others.
    left_out = () if names else next(iter(fitted.values()))
    runs = [(how, out) for how in FIT_WORDS for out in (None, *dict.fromkeys(t.group for t in left_out))]
    found = results_with_helpers([(_fit_without_group, fitted, how, out) for how, out in runs], begun=begun)
    by_run = dict(zip(runs, found, strict=True))
    fits = {how: by_run[how, None] for how in FIT_WORDS}
    scores, shown = [], {}
    for how, fit in fits.items():
        if names:
            made = {name: (fit, _pieces_by_joint(held, name)) for name in names}
        else:
            groups = {name: pieces[0].group for name, pieces in group_pieces(left_out).items()}
            made = {name: (by_run[how, group], _pieces_by_joint(fitted, name)) for name, group in groups.items()}
        each = []
        for name, (by, pieces) in made.items():
            torque = _over_pieces([by.predict(trial) for trial in pieces])
            half = _over_pieces([by.half_width(trial, BAND.share) for trial in pieces])
            for joint in fit.joints:
                reference = np.concatenate([trial[joint].torque for trial in pieces])
                each.append(_score_joint(how, joint, name, reference, torque, half))
                time = np.concatenate([trial[joint].time for trial in pieces])
                trace = TorqueTrace(joint, name, time, reference, {}, {}, BAND.share)
                trace = shown.setdefault((joint, name), trace)
                trace.predicted[how], trace.half_width[how] = torque[joint], half[joint]
        scores += each if names else [_mean_score(how, joint, each) for joint in fit.joints]
    first = names[0] if names else next(name for _, name in shown)
    made = TogetherFindings(fits, tuple(scores), tuple(t for (_, name), t in shown.items() if name == first))
    return _add_unrecorded_muscles(made, fitted, held) if names else made


def _add_unrecorded_muscles(
    found: TogetherFindings, fitted: Mapping[str, Sequence[TorqueTrial]], held: Mapping[str, Sequence[TorqueTrial]]
) -> TogetherFindings:
    """Return the result with muscles that no electrode drives, and their scores on held-out recordings."""
    fit, scores = found.fit, []
    never = fit_unrecorded_muscles(fit, fitted)
    for name in [] if never is None else group_pieces(next(iter(held.values()))):
        pieces = _pieces_by_joint(held, name)
        torque = _over_pieces([never.predict(trial) for trial in pieces])
        half = _over_pieces([fit.half_width(trial, BAND.share) for trial in pieces])
        for joint in fit.joints:
            reference = np.concatenate([trial[joint].torque for trial in pieces])
            scores.append(_score_joint(UNRECORDED_VARIANT, joint, name, reference, torque, half))
    return replace(found, never=never, beside=tuple(scores))


def _score_joint(
    how: str, joint: str, name: str, reference: np.ndarray, torque: Mapping, half: Mapping
) -> TogetherScore:
    """Score a joint's predicted torque over a recording, and the coverage of its band."""
    inside = float(np.mean(np.abs(reference - torque[joint]) <= half[joint]))
    return TogetherScore(how, joint, name, score(reference, torque[joint]), inside)


def _add_posterior(found: TogetherFindings, across: Mapping[str, Sequence[TorqueTrial]]) -> TogetherFindings:
    """Return the result with a posterior, and the scores of its mean prediction on held-out recordings.

    Trials left out in turn have no such scores, since the posterior was computed from all of them.
    """
    fit = found.fit
    posterior = calibration_posterior(fit.fit, title=f"Posterior of the muscles of {found.what}")
    scores = []
    held = [t for t in next(iter(across.values())) if t.heldout]
    for name in () if posterior.unsettled else group_pieces(held):
        pieces = _pieces_by_joint(across, name)
        made = [fit.predict_with_posterior(posterior, trial, BAND.share) for trial in pieces]
        torque, half = (_over_pieces([each[i] for each in made]) for i in (0, 1))
        for joint in fit.joints:
            reference = np.concatenate([trial[joint].torque for trial in pieces])
            scores.append(_score_joint(POSTERIOR_VARIANT, joint, name, reference, torque, half))
    return replace(found, posterior=posterior, beside=(*found.beside, *scores))


def _fit_without_group(fitted: Mapping[str, Sequence[TorqueTrial]], how: str, out: str | None) -> HillTogether:
    """Fit the muscles of all joints to all trials except those of the group `out`."""
    others = {joint: [t for t in own if t.group != out] for joint, own in fitted.items()}
    return fit_together(others, offset=how == OFFSET_FIT)


def _joint_words(joints: Sequence[str]) -> str:
    """Return the names of the joints in words."""
    return f"{', '.join(joints[:-1])} and {joints[-1]}"


def _pieces_by_joint(across: Mapping[str, Sequence[TorqueTrial]], name: str) -> list[dict[str, TorqueTrial]]:
    """Return the pieces of one recording, each as its trials by joint."""
    own = {joint: [t for t in trials if t.recording == name] for joint, trials in across.items()}
    return [dict(zip(own, pieces, strict=True)) for pieces in zip(*own.values(), strict=True)]


def _over_pieces(parts: Sequence[Mapping[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Return what was predicted by joint for a recording's pieces, one after another."""
    return {joint: np.concatenate([np.asarray(part[joint]) for part in parts]) for joint in parts[0]}


def _mean_score(how: str, joint: str, each: Sequence[TogetherScore]) -> TogetherScore:
    """Return the mean score over trials left out, which have equal weight however long they are."""
    own = [s for s in each if s.joint == joint]
    rmse, r2, inside = (
        float(np.mean(x)) for x in zip(*((s.score.rmse, s.score.r2, s.coverage) for s in own), strict=True)
    )
    return TogetherScore(how, joint, "", Score(rmse, r2), inside)
