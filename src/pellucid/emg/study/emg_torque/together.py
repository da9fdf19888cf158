"""Calibrate the muscles of all joints of a study at once, and score them on held-out recordings.

There are two fits. In both, every muscle's force follows its envelope by 10 to 100 ms. The second also estimates an
offset of the recording's EMG stream.

Findings on muscles calibrated over all joints: tables, verdicts, rows, cards, and the data for figures.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from ...._errors import IdentificationError
from ...._processes import results_with_helpers
from ....models.estimates import Verdict
from ....models.parameter_card import ParameterCard
from ....study.procedures.posterior_beside import (
    ComparedPosterior,
    pair_with_posterior,
    posterior_rows,
    posterior_table,
    posterior_verdicts,
)
from ....study.procedures.result import FigureTable, ParameterTable
from ....study.results import ResultRow
from ....study.study import Study
from ...estimators.condition_choice import ERROR_BAND
from ...estimators.cross_validation import Score, covered_share, score
from ...estimators.hill import HillTogether, TrialByJoint, fit_together
from ...estimators.torque_trial import TorqueTrial, group_pieces
from ...estimators.unrecorded import UnrecordedMuscles, fit_unrecorded_muscles
from ...fit.muscle_posterior import (
    CalibrationPosterior,
    calibration_posterior,
    count_bounds_reported_as_estimates,
    muscle_parameters,
    muscle_verdicts,
)
from .torque_findings import (
    CalibrationFindings,
    EstimatorEvaluation,
    MuscleSummary,
    TorqueTrace,
    muscle_card,
    summarise_muscles,
)

PLAIN_FIT = "hill"
"""Part of row ids that names the fit in which EMG and moments have one clock."""

OFFSET_FIT = "hill.offset"
"""Part of row ids that names the fit that also finds the offset of the EMG stream's clock."""

FIT_WORDS = {PLAIN_FIT: "muscles of all joints", OFFSET_FIT: "muscles of all joints, with a time offset of the EMG"}
"""Description of both fits, by the part of row ids that names each."""

POSTERIOR_VARIANT = "posterior"
"""Part of row ids that names the mean of the posterior's draws."""

UNRECORDED_VARIANT = "never_recorded"
"""Part of row ids that names the fit with muscles that had no electrode."""

VARIANT_WORDS = {
    POSTERIOR_VARIANT: "muscles of all joints, posterior mean",
    UNRECORDED_VARIANT: "muscles of all joints, with muscles that had no electrode",
}
"""Description of the variants of the first fit, by the part of row ids that names each."""


@dataclass(frozen=True)
class TogetherScore:
    """Score of one joint on one recording, predicted by muscles calibrated over all joints."""

    how: str  # Fit or variant, a key of `FIT_WORDS` or `VARIANT_WORDS`
    joint: str
    recording: str  # Test recording; ``""`` for all trials, each left out in turn
    score: Score
    coverage: float  # Share of samples within the band at the level `ERROR_BAND.share`


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
        """Whether the time offset of the EMG stream increases the cross-validated R², averaged over joints.

        Held-out recordings are not used.
        """
        r2 = {how: np.mean([s.r2 for s in self.fits[how].choice.scores.values()]) for how in FIT_WORDS}
        return bool(r2[OFFSET_FIT] > r2[PLAIN_FIT])


POSTERIOR_BEGINS_AT = 0.5
"""Share of the muscles' work before the posterior is drawn."""


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
        fits_share = POSTERIOR_BEGINS_AT if posterior else 1.0
        made = _evaluate_fits(across, lambda i, share: tell(f"muscles of {what} together", fits_share * share))
        if posterior:
            tell(f"sampling the posterior of the muscles of {what}", POSTERIOR_BEGINS_AT)
            made = _add_posterior(made, across)
        return made
    except IdentificationError as error:
        found.passed_over[f"{what} together"] = str(error)
        return None


def _evaluate_fits(
    across: Mapping[str, Sequence[TorqueTrial]], begun: Callable[[int, float], None]
) -> TogetherFindings:
    """Fit both variants and score them on held-out recordings, or by cross-validation over groups of trials."""
    fitted = {joint: [t for t in own if not t.heldout] for joint, own in across.items()}
    held = {joint: [t for t in own if t.heldout] for joint, own in across.items()}
    names = list(group_pieces(next(iter(held.values()))))
    # Without held-out recordings, each group of trials is predicted by muscles fitted to the others.
    left_out = () if names else next(iter(fitted.values()))
    runs = [(how, out) for how in FIT_WORDS for out in (None, *dict.fromkeys(t.group for t in left_out))]
    # A process that fits muscles needs nothing of studies, and imports nothing of them.
    jobs = [
        (partial(fit_together, _without_group(fitted, out), offset=how == OFFSET_FIT),) for how, out in runs
    ]
    found = results_with_helpers(jobs, begun=begun)
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
            half = _over_pieces([by.half_width(trial, ERROR_BAND.share) for trial in pieces])
            each += _score_joints(how, name, pieces, torque, half)
            for joint in fit.joints:
                time, reference = (np.concatenate([getattr(t[joint], x) for t in pieces]) for x in ("time", "torque"))
                trace = TorqueTrace(joint, name, time, reference, {}, {}, ERROR_BAND.share)
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
        half = _over_pieces([fit.half_width(trial, ERROR_BAND.share) for trial in pieces])
        scores += _score_joints(UNRECORDED_VARIANT, name, pieces, torque, half)
    return replace(found, never=never, beside=tuple(scores))


def _score_joints(
    how: str, name: str, pieces: Sequence[TrialByJoint], torque: Mapping, half: Mapping
) -> Iterator[TogetherScore]:
    """Yield the score of each joint's predicted torque over a recording's pieces, and the coverage of its band."""
    for joint, predicted in torque.items():
        reference = np.concatenate([trial[joint].torque for trial in pieces])
        inside = covered_share(reference, predicted, half[joint])
        yield TogetherScore(how, joint, name, score(reference, predicted), inside)


def _add_posterior(found: TogetherFindings, across: Mapping[str, Sequence[TorqueTrial]]) -> TogetherFindings:
    """Return the result with a posterior, and the scores of its mean prediction on held-out recordings.

    Cross-validation over trials gives no such scores, because the posterior uses all of them.
    """
    fit = found.fit
    posterior = calibration_posterior(fit.fit, title=f"Posterior of the muscles of {found.what}")
    scores = []
    held = [t for t in next(iter(across.values())) if t.heldout]
    for name in () if posterior.unsettled else group_pieces(held):
        pieces = _pieces_by_joint(across, name)
        made = [fit.predict_with_posterior(posterior, trial, ERROR_BAND.share) for trial in pieces]
        torque, half = (_over_pieces([each[i] for each in made]) for i in (0, 1))
        scores += _score_joints(POSTERIOR_VARIANT, name, pieces, torque, half)
    return replace(found, posterior=posterior, beside=(*found.beside, *scores))


def _without_group(fitted: Mapping[str, Sequence[TorqueTrial]], out: str | None) -> dict[str, list[TorqueTrial]]:
    """Return the trials of all joints except those of the group `out`."""
    return {joint: [t for t in own if t.group != out] for joint, own in fitted.items()}


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
    """Return the mean score over held-out trials, which have equal weight whatever their durations."""
    own = [s for s in each if s.joint == joint]
    rmse, r2, inside = (
        float(np.mean(x)) for x in zip(*((s.score.rmse, s.score.r2, s.coverage) for s in own), strict=True)
    )
    return TogetherScore(how, joint, "", Score(rmse, r2), inside)


@dataclass(frozen=True, eq=False)
class TogetherFigureData:
    """Data for the figures of a calibration over all joints."""

    summary: MuscleSummary
    traces: tuple[TorqueTrace, ...]  # Torque of each joint in one recording, predicted by the fits in `FIT_WORDS`
    told: tuple[ComparedPosterior, ...] = ()  # Posterior parameters that the recording determines best
    posterior: CalibrationPosterior | None = None


VALID_COVERAGE_BOUNDS = (0.8, 0.97)
"""A band at the level `ERROR_BAND.share` is said to hold if its share of held-out torque is between these two.

Chosen by judgement; no measurement is recorded.
"""

MAX_DRAWN_PARAMETERS = 12
"""Largest number of posterior parameters in a figure: those that the recording determines best."""


def together_tables(found: TogetherFindings | None, evaluated: Sequence[EstimatorEvaluation]) -> tuple:
    """Return tables of both fits' errors, with those of each joint alone from `evaluated`, and of parameters."""
    if found is None:
        return ()
    alone = {
        (e.what, e.recording): e.score
        for e in evaluated
        if e.family.shows_muscles and not e.causal
    }
    rows = []
    for joint, recording in dict.fromkeys((s.joint, s.recording) for s in found.scores):
        where = recording.replace("_", " ") or "cross-validation"
        by = alone.get((joint, recording))
        if by is not None:
            rows.append((joint, where, "that joint's muscles alone", by.rmse, by.r2, None))
        rows += [
            (joint, where, (FIT_WORDS | VARIANT_WORDS)[s.how], s.score.rmse, s.score.r2, 100.0 * s.coverage)
            for s in (*found.scores, *found.beside)
            if (s.joint, s.recording) == (joint, recording)
        ]
    heads = (
        "Joint",
        "Recording",
        "Calibrated",
        "RMSE (N*m)",
        "R²",
        f"Within the {100.0 * ERROR_BAND.share:g} % band (%)",
    )
    return (
        FigureTable(f"Muscles of {found.what}, fitted to all joints", heads, tuple(rows), 0),
        ParameterTable(f"Muscles of {found.what}, fitted to all joints", found.fit.parameters, max_brief_rows=0),
        *_posterior_tables(found),
    )


def find_determined_parameters(found: TogetherFindings) -> tuple[ComparedPosterior, ...]:
    """Return parameters that the recording determines better than anatomy does, with the fit's intervals.

    The parameters with the smallest share of the prior come first.
    """
    compared = pair_with_posterior(found.fit.parameters, found.posterior) if found.posterior else ()
    determined = [one for one in compared if not one.drawn.told_by_prior]
    return tuple(sorted(determined, key=lambda one: one.drawn.prior_share))


def _posterior_tables(found: TogetherFindings) -> tuple[FigureTable, ...]:
    """Return the table of the posterior; empty without one."""
    if found.posterior is None:
        return ()
    title = f"Posterior of the muscles of {found.what}: parameters that the recording determines"
    return (posterior_table(title, find_determined_parameters(found), found.posterior.confidence),)


def _unrecorded_verdicts(found: TogetherFindings) -> Iterator[Verdict]:
    """Yield a verdict on muscles without an electrode: their gain in cross-validation and on held-out recordings."""
    if found.never is None:
        return
    by = {(s.joint, s.recording): s.score.r2 for s in found.scores if s.how == PLAIN_FIT}
    words = ", ".join(
        f"{by[s.joint, s.recording]:.3f} to {s.score.r2:.3f} at the {s.joint} on {s.recording.replace('_', ' ')}"
        for s in found.beside
        if s.how == UNRECORDED_VARIANT
    )
    names, k = ", ".join(m.name.replace("_", " ") for m in found.never.muscles), len(found.never.synergies)
    without, with_them = (float(np.mean(x)) for x in (found.never.errors_without, found.never.errors_with))
    gain = "improve" if found.never.helps else "do not improve"
    yield Verdict(
        "note",
        f"{found.what} together: {names} had no electrode. Their excitation was estimated from {k} synergies of the "
        f"other muscles. In cross-validation they {gain} the prediction ({100 * without:.1f} % of the variance "
        f"unexplained without, {100 * with_them:.1f} % with them){'' if found.never.helps else ' and are not used'}. "
        f"R² on held-out recordings changes from {words}.",
    )


def _posterior_verdicts(found: TogetherFindings) -> Iterator[Verdict]:
    """Yield verdicts on the posterior: convergence, the parameters that the recording determines, predictions."""
    posterior = found.posterior
    if posterior is None:
        return
    who, determined = f"{found.what} together", find_determined_parameters(found)
    yield from posterior_verdicts(determined, posterior, posterior.confidence, who)
    if posterior.unsettled:
        return
    yield Verdict(
        "note",
        f"{who}: in the posterior, the recording determines {len(determined)} of {len(posterior)} parameters; the "
        "others vary as anatomy does among people.",
    )
    drawn = [s for s in found.beside if s.how == POSTERIOR_VARIANT]
    for name in dict.fromkeys(s.recording for s in drawn):
        own = [s for s in drawn if s.recording == name]
        by = {s.joint: s.score.r2 for s in found.scores if (s.how, s.recording) == (PLAIN_FIT, name)}
        words = ", ".join(
            f"{s.joint} R² {s.score.r2:.2f} (the calibration's {by[s.joint]:.2f}), {100.0 * s.coverage:.0f} % within"
            for s in own
        )
        held = all(VALID_COVERAGE_BOUNDS[0] <= s.coverage <= VALID_COVERAGE_BOUNDS[1] for s in own)
        yield Verdict(
            "good" if held else "warning",
            f"{who}, posterior mean and its {100.0 * ERROR_BAND.share:g} % band on {name.replace('_', ' ')}: {words}.",
        )


def together_verdicts(found: TogetherFindings | None, alone: CalibrationFindings) -> Iterator[Verdict]:
    """Yield verdicts on both fits: muscles, the EMG stream's offset, and the coverage of bands."""
    if found is None:
        return
    yield from muscle_verdicts(found.fit.fit, f"{found.what} together")
    yield _offset_verdict(found)
    for muscle, strengths in _shared_strength_words(found, alone).items():
        yield Verdict(
            "note",
            f"{muscle.replace('_', ' ')}, which crosses both joints: {strengths}, relative to the anatomical model.",
        )
    for how, words in FIT_WORDS.items():
        own = [s for s in found.scores if s.how == how]
        worst = max(own, key=lambda s: abs(s.coverage - np.mean(VALID_COVERAGE_BOUNDS)))
        shares = sorted(100.0 * s.coverage for s in own)
        where = f"; worst at the {worst.joint}, {worst.recording.replace('_', ' ') or 'cross-validation'}"
        held = VALID_COVERAGE_BOUNDS[0] <= worst.coverage <= VALID_COVERAGE_BOUNDS[1]
        yield Verdict(
            "good" if held else "warning",
            f"{found.what}, {words}: the {100.0 * ERROR_BAND.share:g} % prediction bands cover {shares[0]:.0f} to "
            f"{shares[-1]:.0f} % of each torque{where * (not held)}.",
        )
    yield from _unrecorded_verdicts(found)
    yield from _posterior_verdicts(found)


def _offset_verdict(found: TogetherFindings) -> Verdict:
    """Return the verdict on the offset of the EMG stream."""
    fit = found.fits[OFFSET_FIT]
    offset, r2 = fit.offset, _r2_words(found)
    span = f"{1e3 * offset.low:.0f} to {1e3 * offset.high:.0f} ms at 95 %"
    if next(p for p in fit.parameters if p.name == "delay").at_bound:
        return Verdict(
            "warning",
            f"{found.what} together: the time offset of the EMG stream reached the limit of its range and is not "
            "identifiable.",
            "Check whether EMG, angles and moments share a clock.",
        )
    if not offset.certain:
        text = (
            f"EMG and moments are synchronous: with a time offset of {span}, the muscle delays remain within 10 to "
            "100 ms."
        )
        return Verdict("good", f"{found.what} together: {text}")
    way = "ahead of" if offset.value > 0.0 else "behind"
    late = f"{abs(1e3 * offset.value):.0f} ms {way} the moments ({span})"
    if not found.offset_carries_over:
        text = (
            f"a time offset of the EMG, {late}, would fit better, but does not improve the cross-validated error; on "
            f"held-out recordings {r2}. It is therefore not attributed to the recording."
        )
        return Verdict("note", f"{found.what} together: {text}")
    return Verdict(
        "warning",
        f"{found.what} together: the EMG stream is {late}, in addition to muscle delays of 10 to 100 ms. This time "
        f"offset comes from the recording, not from the person. With the offset, {r2}.",
        "Check whether one stream was filtered causally and whether the streams share a clock.",
    )


def _r2_words(found: TogetherFindings) -> str:
    """Return R² without and with the offset in words, on the last test recording."""
    last = found.scores[-1].recording
    by = {(s.joint, s.how): s.score.r2 for s in found.scores if s.recording == last}
    joints = found.fit.joints
    parts = [f"{by[j, PLAIN_FIT]:.2f} to {by[j, OFFSET_FIT]:.2f} at the {j}" for j in joints]
    return f"R² goes from {', '.join(parts)}" + (f" ({last.replace('_', ' ')})" if last else "")


def _shared_strength_words(found: TogetherFindings, alone: CalibrationFindings) -> dict[str, str]:
    """Return the strength of each muscle across several joints in words, by each joint alone and together."""
    words_by_muscle = {}
    for muscle in found.fit.driven:
        name = f"strength.{muscle}"
        own = {
            joint: next((p for p in muscle_parameters(each.fit) if p.name == name), None)
            for joint, each in alone.muscles.items()
        }
        own = {joint: p for joint, p in own.items() if p is not None}
        if len(own) < 2:
            continue
        both = next(p for p in found.fit.parameters if p.name == name)
        parts = [f"{p.value:.2f}{' (on a bound)' * p.at_bound} by the {joint} alone" for joint, p in own.items()]
        words_by_muscle[muscle] = (
            f"strength {', '.join(parts)}, {both.value:.2f}{' (on a bound)' * both.at_bound} by both"
        )
    return words_by_muscle


def together_rows(
    study: str, found: TogetherFindings | None, alone: CalibrationFindings, trials: Sequence[TorqueTrial]
) -> tuple[ResultRow, ...]:
    """Return all result rows. Ids name the recording, except for the first held-out one."""
    rows: list[ResultRow] = []

    def add(name: str, value: float, unit: str, note: str, split: str = "fitted", recording: str = "") -> None:
        rows.append(ResultRow(f"{study}.together.{name}", value, unit, "calibrate", split, sums.get(recording), note))

    sums = {trial.name: trial.checksum for trial in trials}
    bound_count = sum(
        count_bounds_reported_as_estimates(each.fit, muscle_parameters(each.fit)) for each in alone.muscles.values()
    )
    if found is None:
        return ()
    first = found.scores[0].recording
    for s in (*found.scores, *found.beside):
        tail, note = "" if s.recording == first else f".{s.recording}", VARIANT_WORDS.get(s.how, "")
        if s.how in FIT_WORDS:
            choice = found.fits[s.how].choice
            note = f"{choice.timing.words}; weight of anatomy {choice.weight:g}"
        at = {"split": "heldout", "recording": s.recording}
        within = f"share of samples within the {100.0 * ERROR_BAND.share:g} % band"
        add(f"{s.joint}.{s.how}.r2{tail}", s.score.r2, "1", note, **at)
        add(f"{s.joint}.{s.how}.rmse{tail}", s.score.rmse, "N*m", note, **at)
        add(f"{s.joint}.{s.how}.coverage{tail}", s.coverage, "1", within, **at)
    for how, fit in found.fits.items():
        late = "from the recorded envelope to the force" if how != PLAIN_FIT else "sum of delay and lags"
        add(f"{how}.delay.largest", float(fit.delays.max()), "s", late)
        add(f"{how}.delay.smallest", float(fit.delays.min()), "s", late)
        add(f"{how}.at_bound", int(fit.fit.at_bound.sum()), "1", f"of {len(fit.fit.at_bound)}, undetermined")
        add(f"{how}.seconds", fit.fit.seconds, "s", "one calibration, all starts included")
        for joint, each in fit.choice.scores.items():
            add(f"{joint}.{how}.r2.cross_validated", each.r2, "1", "within the fitted recordings")
        bound_count += count_bounds_reported_as_estimates(fit.fit, fit.parameters)
    offset = found.fits[OFFSET_FIT].offset
    for name, value in (("", offset.value), (".low", offset.low), (".high", offset.high)):
        add(f"{OFFSET_FIT}.emg{name}", value, "s", "time by which the recorded EMG is ahead of the moments")
    words = "1: the time offset increases the cross-validated R², averaged over joints"
    add(f"{OFFSET_FIT}.carries_over", float(found.offset_carries_over), "1", words)
    if found.never is not None:
        words = "1: muscles without an electrode improve the cross-validated prediction"
        add("never_recorded.helps", float(found.never.helps), "1", words)
    if found.posterior is not None:
        plain = ResultRow("", None, "1", "calibrate", "fitted", None, found.posterior.settled)
        rows.extend(
            posterior_rows(f"{study}.together", find_determined_parameters(found), found.posterior.confidence, plain)
        )
        add(
            "posterior.told",
            len(find_determined_parameters(found)),
            "1",
            f"of {len(found.posterior)} parameters, determined by the recording",
        )
    words = "parameters on a bound that were reported as estimates, in the fits of each joint and of all joints"
    add(f"{PLAIN_FIT}.at_bound_unreported", bound_count, "1", words)
    return tuple(rows)


def together_cards(
    study: Study, found: TogetherFindings | None, trials: Sequence[TorqueTrial]
) -> dict[str, ParameterCard]:
    """Return the cards of both fits, with their covariance in the parameters' units."""
    cards = {}
    for how, fit in found.fits.items() if found else ():
        name = "muscles_together" if how == PLAIN_FIT else "muscles_together_offset"
        offset, choice = fit.offset, fit.choice
        ahead = {} if offset is None else {"emg_offset": offset.value, "emg_offset.low": offset.low,
                                           "emg_offset.high": offset.high}  # fmt: skip
        settings = {
            "weight": choice.weight, **ahead,
            **{f"residual_sd.{joint}": each.rmse for joint, each in choice.scores.items()},
            **{f"delay.{m}": float(late) for m, late in zip(fit.driven, fit.delays, strict=True)},
        }  # fmt: skip
        words = f"{choice.timing.words}, weight of anatomy {choice.weight:g}"
        cards[name] = muscle_card(study, name, fit.card_content(), fit.fit, fit.parameters, settings, words, trials)
    return cards


def together_figure_data(found: TogetherFindings | None) -> TogetherFigureData | None:
    """Return the data for figures; None without a calibration over all joints."""
    if found is None:
        return None
    fit, first = found.fit, found.traces[0].recording
    summary = summarise_muscles(f"{found.what} together", fit.fit, tuple(fit.driven), first, (), (), ())
    told = find_determined_parameters(found)[:MAX_DRAWN_PARAMETERS]
    return TogetherFigureData(summary, found.traces, told, found.posterior)
