"""Findings on muscles calibrated over all joints: tables, verdicts, rows, cards, and the data for figures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

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
from ...estimators.condition_choice import BAND
from ...estimators.families import ESTIMATOR_FAMILIES
from ...estimators.torque_trial import TorqueTrial
from ...fit.calibration_posterior import CalibrationPosterior
from ...fit.muscle_posterior import (
    count_bounds_reported_as_estimates,
    covariance,
    muscle_parameters,
    muscle_verdicts,
    reported_covariance,
)
from ...models.muscle import CARD_KIND
from .evaluation import EstimatorEvaluation, TorqueTrace
from .together import (
    FIT_WORDS,
    OFFSET_FIT,
    PLAIN_FIT,
    POSTERIOR_VARIANT,
    UNRECORDED_VARIANT,
    VARIANT_WORDS,
    TogetherFindings,
)
from .torque_findings import CalibrationFindings, MuscleSummary


@dataclass(frozen=True, eq=False)
class TogetherFigureData:
    """Data for the figures of a calibration over all joints."""

    summary: MuscleSummary
    traces: tuple[TorqueTrace, ...]  # Torque of each joint in one recording, predicted by the fits in `FIT_WORDS`
    told: tuple[ComparedPosterior, ...] = ()  # Posterior parameters that the recording determines best
    posterior: CalibrationPosterior | None = None


VALID_COVERAGE_BOUNDS = (0.8, 0.97)
"""A band at the level `BAND.share` is said to hold if its share of held-out torque is between these two.

Chosen by judgement; no measurement is recorded.
"""

MAX_DRAWN_PARAMETERS = 12
"""Largest number of posterior parameters in a figure: those that the recording determines best."""


def together_tables(found: TogetherFindings | None, evaluated: Sequence[EstimatorEvaluation]) -> tuple:
    """Return tables of both fits' errors, beside muscles of each joint alone among `evaluated`, and of parameters."""
    if found is None:
        return ()
    alone = {
        (e.what, e.recording): e.score
        for e in evaluated
        if ESTIMATOR_FAMILIES[e.estimator].shows_muscles and not e.causal
    }
    rows = []
    for joint, recording in dict.fromkeys((s.joint, s.recording) for s in found.scores):
        where = recording.replace("_", " ") or "each left out"
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
        f"Within the {100.0 * BAND.share:g} % band (%)",
    )
    return (
        FigureTable(f"Muscles of {found.what} together: 10 to 100 ms from envelope to force", heads, tuple(rows), 0),
        ParameterTable(f"Muscles together: {found.what}", found.fit.parameters, max_brief_rows=0),
        *_posterior_tables(found),
    )


def find_determined_parameters(found: TogetherFindings) -> tuple[ComparedPosterior, ...]:
    """Return parameters that the recording determines more than anatomy does, beside the fit's intervals.

    The parameters with the smallest share of the prior come first.
    """
    compared = pair_with_posterior(found.fit.parameters, found.posterior) if found.posterior else ()
    determined = [one for one in compared if not one.drawn.told_by_prior]
    return tuple(sorted(determined, key=lambda one: one.drawn.prior_share))


def _posterior_tables(found: TogetherFindings) -> tuple[FigureTable, ...]:
    """Return the table of the posterior; empty without one."""
    if found.posterior is None:
        return ()
    title = f"Posterior of muscles together: {found.what}, what the recording tells"
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
        f"{found.what} together: {names} had no electrode. Excited by {k} synergies of the others, fitted to the "
        f"torque, they {gain} the prediction of fitted parts left out in turn ({100 * without:.1f} % of the variance "
        f"unexplained without, {100 * with_them:.1f} % with them){'' if found.never.helps else ' and are not used'}. "
        f"R² on held-out recordings goes from {words}.",
    )


def _posterior_verdicts(found: TogetherFindings) -> Iterator[Verdict]:
    """Yield verdicts on the posterior: its convergence, what the recording determines, and its predictions."""
    posterior = found.posterior
    if posterior is None:
        return
    who, determined = f"{found.what} together", find_determined_parameters(found)
    yield from posterior_verdicts(determined, posterior, posterior.confidence, who)
    if posterior.unsettled:
        return
    yield Verdict(
        "note",
        f"{who}: in the posterior the recording determines {len(determined)} of {len(posterior)} parameters; the "
        "others have the spread of anatomy among people.",
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
            f"{who}, mean of the posterior's draws and their {100.0 * BAND.share:g} % band on "
            f"{name.replace('_', ' ')}: "
            f"{words}.",
        )


def together_verdicts(found: TogetherFindings | None, alone: CalibrationFindings) -> tuple[Verdict, ...]:
    """Return verdicts on both fits: muscles, the EMG stream's offset, and the coverage of bands."""
    if found is None:
        return ()
    verdicts = [*muscle_verdicts(found.fit.fit, f"{found.what} together")]
    verdicts.append(_offset_verdict(found))
    for muscle, strengths in _shared_strength_words(found, alone).items():
        verdicts.append(
            Verdict(
                "note",
                f"{muscle.replace('_', ' ')}: {strengths}, relative to the anatomical model. It is the same muscle at "
                "every joint.",
            )
        )
    for how, words in FIT_WORDS.items():
        own = [s for s in found.scores if s.how == how]
        worst = max(own, key=lambda s: abs(s.coverage - np.mean(VALID_COVERAGE_BOUNDS)))
        shares = sorted(100.0 * s.coverage for s in own)
        where = f"; farthest off at the {worst.joint}, {worst.recording.replace('_', ' ') or 'each left out'}"
        held = VALID_COVERAGE_BOUNDS[0] <= worst.coverage <= VALID_COVERAGE_BOUNDS[1]
        verdicts.append(
            Verdict(
                "good" if held else "warning",
                f"{found.what}, {words}: {shares[0]:.0f} to {shares[-1]:.0f} % of each torque lies within the "
                f"{100.0 * BAND.share:g} % band that was stated beforehand{where * (not held)}.",
            )
        )
    return (*verdicts, *_unrecorded_verdicts(found), *_posterior_verdicts(found))


def _offset_verdict(found: TogetherFindings) -> Verdict:
    """Return the verdict on the offset of the EMG stream."""
    fit = found.fits[OFFSET_FIT]
    offset, r2 = fit.offset, _r2_words(found)
    span = f"{1e3 * offset.low:.0f} to {1e3 * offset.high:.0f} ms at 95 %"
    if next(p for p in fit.parameters if p.name == "delay").at_bound:
        return Verdict(
            "warning",
            f"{found.what} together: the offset of the EMG's stream ends on the limit of its range and is "
            "undetermined.",
            "Check whether EMG, angles and moments have the same clock.",
        )
    if not offset.certain:
        text = f"EMG and moments are in time: an offset of {span} leaves muscles their 10 to 100 ms."
        return Verdict("good", f"{found.what} together: {text}")
    way = "ahead of" if offset.value > 0.0 else "behind"
    late = f"{abs(1e3 * offset.value):.0f} ms {way} the moments ({span})"
    if not found.offset_carries_over:
        text = (
            f"EMG that runs {late} would fit better, but predicts parts of the fitted trials that are left out in turn "
            f"no better; on what was not fitted {r2}. It is therefore not "
        )
        return Verdict("note", f"{found.what} together: {text}attributed to the recording.")
    return Verdict(
        "warning",
        f"{found.what} together: the EMG's stream runs {late}, whatever from 10 to 100 ms each muscle takes. That is "
        f"the recording's own, not the person's; with it {r2}.",
        "Look for filters that are late on one side, and for clocks that were joined.",
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
        within = f"share of samples within the {100.0 * BAND.share:g} % band"
        add(f"{s.joint}.{s.how}.r2{tail}", s.score.r2, "1", note, **at)
        add(f"{s.joint}.{s.how}.rmse{tail}", s.score.rmse, "N*m", note, **at)
        add(f"{s.joint}.{s.how}.coverage{tail}", s.coverage, "1", within, **at)
    for how, fit in found.fits.items():
        late = "from the recorded envelope on" if how != PLAIN_FIT else "delay and lags together"
        add(f"{how}.delay.largest", float(fit.delays.max()), "s", late)
        add(f"{how}.delay.smallest", float(fit.delays.min()), "s", late)
        add(f"{how}.at_bound", int(fit.fit.at_bound.sum()), "1", f"of {len(fit.fit.at_bound)}, undetermined")
        add(f"{how}.seconds", fit.fit.seconds, "s", "one calibration, all starts included")
        for joint, each in fit.choice.scores.items():
            add(f"{joint}.{how}.r2.cross_validated", each.r2, "1", "within what was fitted")
        bound_count += count_bounds_reported_as_estimates(fit.fit, fit.parameters)
    offset = found.fits[OFFSET_FIT].offset
    for name, value in (("", offset.value), (".low", offset.low), (".high", offset.high)):
        add(f"{OFFSET_FIT}.emg{name}", value, "s", "the recording's EMG runs ahead of its moments by so much")
    words = "1: R² is larger with it on parts of the fitted trials left out in turn, in the mean over joints"
    add(f"{OFFSET_FIT}.carries_over", float(found.offset_carries_over), "1", words)
    if found.never is not None:
        words = "1: parts of what was fitted, left out in turn, are told better with muscles that had no electrode"
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
            f"of {len(found.posterior)} parameters, by the recording",
        )
    words = "parameters on a bound told as estimates, joint by joint and together"
    add(f"{PLAIN_FIT}.at_bound_unreported", bound_count, "1", words)
    return tuple(rows)


def together_cards(
    study: Study, found: TogetherFindings | None, trials: Sequence[TorqueTrial]
) -> dict[str, ParameterCard]:
    """Return the cards of both fits, with their covariance in the parameters' units."""
    cards = {}
    for how, fit in found.fits.items() if found else ():
        name = "muscles_together" if how == PLAIN_FIT else "muscles_together_offset"
        offset = fit.offset
        ahead = {} if offset is None else {"emg_offset": offset.value, "emg_offset.low": offset.low,
                                           "emg_offset.high": offset.high}  # fmt: skip
        cards[name] = ParameterCard(
            kind=CARD_KIND,
            study=study.name,
            name=name,
            parameters=tuple(p.on_card(0.95) for p in fit.parameters),
            covariance=tuple(map(tuple, reported_covariance(fit.fit).tolist())),
            settings={
                **fit.card_content().settings(),
                "weight": fit.choice.weight,
                **ahead,
                **{f"residual_sd.{joint}": each.rmse for joint, each in fit.choice.scores.items()},
                **{f"delay.{m}": float(late) for m, late in zip(fit.driven, fit.delays, strict=True)},
            },
            processing="factors of the anatomical model's strength, tendon slack length and optimal fibre length; "
            f"{fit.choice.timing.words}, weight of anatomy {fit.choice.weight:g}",
            checksums={trial.name: trial.checksum for trial in trials if not trial.heldout},
            pellucid=version("pellucid"),
        )
    return cards


def together_figure_data(found: TogetherFindings | None) -> TogetherFigureData | None:
    """Return the data for figures; None without a calibration over all joints."""
    if found is None:
        return None
    fit = found.fit
    half = 1.96 * np.sqrt(np.diag(covariance(fit.fit)))
    summary = MuscleSummary(
        f"{found.what} together", fit.fit.problem.names, tuple(map(float, fit.fit.z)), tuple(map(float, half)),
        tuple(map(bool, fit.fit.at_bound)), tuple(fit.driven), found.traces[0].recording, (), (), (),
    )  # fmt: skip
    return TogetherFigureData(
        summary, found.traces, find_determined_parameters(found)[:MAX_DRAWN_PARAMETERS], found.posterior
    )
