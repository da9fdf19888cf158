"""Calibrate every estimator of torque from EMG on the fitted recordings and score it on held-out ones.

Without held-out recordings, estimators are scored by cross-validation over trials: recordings with moments, or
repetitions of leg extensions.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...._domains import offered
from ...._errors import IdentificationError, listed_names
from ...._processes import keep_helpers
from ....models.estimates import Verdict
from ....numerics.posterior.ensemble import require_sampler
from ....study.answer import (
    PAPER_STEP,
    Answer,
    AnswerNumber,
    AnswerPart,
    AnswerVerdict,
    Basis,
    Step,
    reason_of_parts,
    verdict_of_parts,
)
from ....study.procedures.findings import MAX_IMPROVING_STEPS
from ....study.procedures.procedure import CostedSteps, Progress, quiet
from ....study.procedures.result import FigureTable, Result
from ....study.study import Study
from ...estimators.condition_choice import ERROR_BAND, Examination, run_tests_if_candidate
from ...estimators.cross_validation import Score, score
from ...estimators.emg_worth import EmgWorth
from ...estimators.families import ESTIMATOR_FAMILIES, STACKED, named_family
from ...estimators.feature_scale import smoothing_delay
from ...estimators.hill import HillMap
from ...estimators.joint_stiffness import JointStiffness
from ...estimators.torque_map import CrossValidated, MapJob, cross_validate_torque_maps, fit_torque_map, fit_torque_maps
from ...estimators.torque_trial import TorqueTrial, group_pieces
from ...models.emg_estimator import ESTIMATOR_KINDS, EmgEstimatorCard, best_estimator
from ..muscle_channels import mains_verdicts, study_chain
from . import together as across_joints
from . import torque_findings as findings
from .emg_torque_table import EmgTorqueTable
from .estimator_cards import estimator_cards, misfit_verdicts, torque_card, watch_rows, watch_verdicts
from .live_scores import (
    HOLD_OUT_TEXT,
    MIN_TORQUE_R2,
    LiveScore,
    export_qualifier,
    limits_of,
    live_rows,
    live_tables,
    scores_words,
)
from .relative_envelopes import find_scales, normalisation_words, scale_rows, scale_verdicts
from .sessions import LIVE_ESTIMATORS, compare_sessions, invalidity_words, session_tables, session_verdicts
from .study_muscles import ignored_channel_verdicts
from .together import TogetherFigureData
from .torque_findings import (
    BASELINE_ESTIMATOR,
    CAUSAL_ESTIMATORS,
    FORMULA_KIND,
    MAX_NAMED_GAINS,
    REPORTED_ESTIMATORS,
    STEP_KIND,
    TRIALS_KIND,
    CalibrationFindings,
    ConditionScore,
    EstimatorEvaluation,
    MuscleSummary,
    RecommendedEstimator,
    RecordingWorth,
    TorqueTrace,
    recording_words,
)
from .trial_sources import (
    EXTENSION_PROTOCOL,
    STEP_PROTOCOL,
    geometry_verdicts,
    leg_extension_trials,
    moment_trials,
    moved_body,
    step_trials,
)


def leave_out_recordings(study: Study, tell: Progress) -> CalibrationFindings:
    """Predict each recording with moments by estimators fitted to the others. `study` [emg_torque]."""
    found, joints = CalibrationFindings(), study.table(EmgTorqueTable).joints
    found.verdicts.append(Verdict("note", normalisation_words(study)))
    found.verdicts.extend((*ignored_channel_verdicts(study), *mains_verdicts(study, study.table(EmgTorqueTable))))
    for i, joint in enumerate(joints):
        found.across[joint] = moment_trials(study, joint)
        _evaluate_trials(found, found.across[joint], joint, TRIALS_KIND, 1.0, _part_progress(tell, i, len(joints)))
    return found


def leave_out_repetitions(study: Study, tell: Progress) -> CalibrationFindings:
    """Predict each repetition of leg extensions by estimators fitted to the same person's others.

    `study` [emg_torque].
    """
    found = CalibrationFindings()
    people = list(dict.fromkeys(r.participant for r in study.recordings() if r.protocol == EXTENSION_PROTOCOL))
    for i, person in enumerate(people):
        trials, weight = leg_extension_trials(study, person)
        progress = _part_progress(tell, i, len(people))
        _evaluate_trials(
            found, trials, person or "knee", FORMULA_KIND, weight, progress, is_one_of_several=len(people) > 1
        )
    formula_text = (
        "No torque was recorded. The reference is a formula in the angle and its acceleration, dominated by the sine "
        "of the angle, and a regression on the angle alone reproduces it. A small error is therefore no evidence for "
        "EMG. Compare only the estimators with muscles with each other."
    )
    found.verdicts.append(Verdict("warning", formula_text))
    if any(t.muscles is not None and not t.muscles.maximal for t in found.trials):
        effort_text = (
            "No maximal contraction was recorded (protocol mvc). Envelopes are relative to the largest recorded "
            "effort, whose share of a maximal one is estimated together with the muscles. The estimated strengths are "
            "therefore not maximal muscle strengths."
        )
        found.verdicts.append(Verdict("warning", effort_text))
    return found


def _evaluate_trials(
    found: CalibrationFindings,
    trials: list[TorqueTrial],
    what: str,
    kind: str,
    unit: float,
    tell: Progress,
    *,
    is_one_of_several: bool = False,
) -> None:
    """Score every estimator by cross-validation over trials; `unit` [N m] divides RMSE. Results go to `found`."""
    if len(trials) < 3:
        raise IdentificationError(
            f"{what}: found {len(trials)} trials ({', '.join(t.name for t in trials)}), expected at least three for "
            "cross-validation"
        )
    names = findings.find_applicable_estimators(trials, what, found, is_one_of_several=is_one_of_several)
    results = cross_validate_torque_maps(
        trials,
        names,
        on_progress=lambda text, share: tell(f"{what}, {text}", share),
        examine=run_tests_if_candidate,
    )
    own = _left_out_evaluations(results, trials, what, kind, unit=unit)
    found.evaluated.extend(own)
    found.chosen[what] = findings.recommend_by_fold(trials, results, own)
    # The recommended estimator's worst trial is drawn with its band.
    chosen = found.chosen[what]
    worst = max(trials, key=lambda t: chosen.judged[0].by_trial[t.name].rmse)
    made = {name: result.predicted[worst.name] for name, result in results.items()}
    if chosen.by[worst.name] == STACKED:
        made[STACKED] = chosen.predicted[worst.name]
    band = {chosen.by[worst.name]: np.full(len(worst), chosen.half_width[worst.name])}
    found.traces.append(TorqueTrace(what, worst.name, worst.time, worst.torque, made, band, ERROR_BAND.share))
    found.trials.extend(trials)
    if any(ESTIMATOR_FAMILIES[name].fit_trials is not None for name in names):
        found.muscles[what], found.shown[what] = fit_torque_map(trials, "hill"), worst


def _left_out_evaluations(
    results: Mapping[str, CrossValidated],
    trials: Sequence[TorqueTrial],
    what: str,
    kind: str,
    *,
    causal: bool = False,
    unit: float = 1.0,
) -> list[EstimatorEvaluation]:
    """Return the evaluation of every estimator by cross-validation over trials; `unit` [N m] divides RMSE."""
    own = []
    for name, result in results.items():
        every, whole = {t: Score(s.rmse / unit, s.r2) for t, s in result.by_trial.items()}, result.score
        if kind != STEP_KIND:
            whole = findings.mean_score(every.values())
        words = " / ".join(dict.fromkeys(choice.words for choice in result.choices))
        own.append(
            EstimatorEvaluation(
                what, name, causal, "", whole, None, words, kind=kind, by_trial=every, torque_unit=trials[0].unit
            )
        )
    return own


def _part_progress(tell: Progress, i: int, count: int) -> Progress:
    """Return a progress function for part `i` of `count`."""
    return lambda text, share: tell(text, (i + share) / count)


INVALID_BANDS_FINDING = "bands"
"""Identifier of the finding that error bands are not known to hold."""

MIN_LEFT_OUT_COVERAGE = 0.8
"""Smallest share of a left-out fitted trial within the 90 % band of the others, below which a band is not trusted."""

MAX_BRIEF_NAMED_ROWS = 6
"""Largest number of rows of the table of recommended estimators on a terminal without ``-v``."""

WORTH_VERDICTS: dict[str, AnswerVerdict] = {"worth it": "yes", "not worth it": "no", "cannot say": "cannot say"}
"""Verdict of each answer to whether EMG adds to angles."""

CARD_ESTIMATOR = "ridge"
"""Estimator whose causal map becomes a card. It is a sum of products, which a robot can compute."""

TOGETHER_COST = 0.3
"""Cost of fitting the muscles of all joints together, relative to that of every estimator of each joint."""


@dataclass(frozen=True, kw_only=True, repr=False)
class CalibrationResult(Result):
    """Result of a calibration, with the data for its figures."""

    # Scores of every estimator on every recording
    evaluated: tuple[EstimatorEvaluation, ...] = field(default=(), repr=False)
    chosen: tuple[RecommendedEstimator, ...] = field(default=(), repr=False)  # Recommended, by joint or participant
    worth: tuple[RecordingWorth, ...] = field(default=(), repr=False)  # Gain over angles alone, by joint and recording
    traces: tuple[TorqueTrace, ...] = field(default=(), repr=False)  # Stretches of held-out torque
    muscles: tuple[MuscleSummary, ...] = field(default=(), repr=False)  # Calibrated muscles, by joint or participant
    stiffness: tuple[JointStiffness, ...] = field(default=(), repr=False)  # Stiffness of each joint by its muscles
    together: TogetherFigureData | None = field(default=None, repr=False)  # Muscles of all joints calibrated at once
    # Scores of the causal estimators that `export` writes, by the card's name
    live: Mapping[str, tuple[LiveScore, ...]] = field(default_factory=dict, repr=False)
    computed: str = ""  # How the reference torque was computed; "" where it was measured

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return calibration_answer(self)


def calibrate(study: Study, on_progress: Progress | None = None) -> CalibrationResult:
    """Calibrate maps from EMG to torque and score them on recordings that were not fitted.

    Recordings with moments are fitted or held out as the study says. Torque steps against an orthosis are scored by
    cross-validation over repetitions; they need the model cards of the orthosis and of the limb.

    `study` [emg_torque].
    """
    table = study.table(EmgTorqueTable)
    if table.posterior:
        require_sampler()  # A missing sampler is reported before minutes of calibration
    tell = on_progress or quiet
    with keep_helpers():
        steps = CostedSteps(tell, {"estimators": 1.0, "muscles together": TOGETHER_COST * (len(table.joints) > 1)})
        found = _choose_evaluation(study)(study, steps.part("estimators"))
        together = across_joints.calibrate_together(found, steps.part("muscles together"), table.posterior)
    evaluated, trials = found.evaluated, found.trials
    for what in dict.fromkeys(each.what for each in evaluated if each.what not in found.chosen):
        found.chosen[what] = findings.recommend_estimator(evaluated, what, found.traces, found.refused)
    chosen, bands = tuple(found.chosen.values()), [*_invalid_band_sentences(found)]
    evaluated = [*evaluated, *(e for each in chosen for e in each.judged if e.estimator == STACKED and not each.by)]
    valid = [t for t in found.traces if t.recording not in found.sessions or found.sessions[t.recording].is_valid]
    fitted = {trial.recording for trial in trials if not trial.heldout}
    founded = findings.is_answer_founded(len(fitted), len(study.left_out))
    names = {trial.name: trial.recording for trial in trials}
    worth = findings.find_worth(chosen, valid, table.worthwhile_gain, names, is_founded=founded)
    stepped = estimator_cards(study, found, together)
    scales = find_scales(study)
    stiffness = findings.find_stiffness(found, stepped)
    found.verdicts.extend(Verdict("warning", each, finding=INVALID_BANDS_FINDING) for each in bands)
    return CalibrationResult(
        study=study.name,
        headline=" ".join(
            text.strip()
            for text in (_invalid_recordings_sentence(found), _headline(chosen), findings.worth_sentence(worth), *bands)
            if text
        ),
        tables=(
            *findings.worth_tables(worth),
            *_chosen_tables(chosen, found.refused),
            *live_tables(found.live),
            *_error_tables(evaluated, chosen),
            *_repair_tables(evaluated),
            *_condition_test_tables(evaluated),
            *session_tables(found.sessions),
            *findings.muscle_tables(found.muscles),
            *across_joints.together_tables(together, evaluated),
            *findings.stiffness_tables(stiffness),
        ),
        verdicts=(
            *calibration_verdicts(study, evaluated, trials, chosen),
            *scale_verdicts(scales),
            *watch_verdicts(stepped),
            *misfit_verdicts(found),
            *geometry_verdicts(study),
            *findings.calibrated_muscle_verdicts(found),
            *across_joints.together_verdicts(together, found),
            *findings.stiffness_verdicts(stiffness),
        ),
        rows=(
            *findings.calibration_rows(study.name, evaluated, trials, found.sessions, chosen, worth),
            *scale_rows(study.name, scales),
            *watch_rows(study.name, stepped),
            *live_rows(study.name, found.live, {trial.recording: trial.checksum for trial in trials}),
            *across_joints.together_rows(study.name, together, found, trials),
            *findings.stiffness_rows(study.name, stiffness, {trial.name: trial.checksum for trial in trials}),
        ),
        cards={
            **found.cards,
            **findings.muscle_cards(study, found.muscles, trials),
            **across_joints.together_cards(study, together, trials),
            **stepped,
            **findings.stiffness_cards(study, stiffness),
        },
        checksums={trial.name: trial.checksum for trial in trials},
        evaluated=tuple(evaluated),
        chosen=chosen,
        worth=worth,
        traces=tuple(found.traces),
        muscles=findings.muscle_summaries(found),
        together=across_joints.together_figure_data(together),
        live=found.live,
        computed=stream.computed if (stream := study.config.streams.get(table.moments)) else "",
        stiffness=stiffness,
    )


def calibration_answer(result: CalibrationResult) -> Answer:
    """Return how well torque is estimated on recordings that were not fitted, then whether EMG adds to angles."""
    joints, numbers = [], []
    for each in result.chosen:
        worst = each.judged[0]
        where = _judged_on(each)
        verdict: AnswerVerdict = "yes" if worst.score.r2 >= MIN_TORQUE_R2 else "no"
        text = f"{_error_words(worst)}{where}"
        if worst.kind == FORMULA_KIND:
            verdict, text = "cannot say", f"no torque was recorded; error against the formula used instead: {text}"
        joints.append(AnswerPart(each.what, verdict, text))
        unit = worst.row_unit
        numbers += [
            AnswerNumber(f"RMS error of the torque, {each.what}{where}", worst.score.rmse, unit),
            AnswerNumber(f"R2 of the torque, {each.what}{where}", worst.score.r2, "1"),
        ]
    adds = [
        AnswerPart(f"EMG over angles alone, {each.words}", WORTH_VERDICTS[each.worth.answer], _gain_words(each.worth))
        for each in result.worth
    ]
    verdict = verdict_of_parts(joints)
    count = len(result.checksums)
    more, exports = _worth_steps(result), _export_steps(result)
    steps = (*exports[:1], *more, *exports[1:])
    if verdict != "yes":
        steps = (*_improving(result, joints), *more, *(step for step in exports if step is HOLD_OUT_STEP))
    limits = {what: limits_of(result.live[card.name]) for what, card in _best_cards(result).items()}
    clock = tuple(
        Step(f"Check that EMG and torque share a clock, and that no causal filter delays the torque: {sentence}")
        for sentence in (v.text.partition(". ")[0] for v in result.verdicts if v.finding == findings.CLOCK_FINDING)
    )
    return Answer(
        f"Is torque estimated on held-out recordings with R² of {MIN_TORQUE_R2:g} or more?",
        verdict,
        result.headline,
        reason_of_parts(joints) or ("" if joints else "no recording was held out"),
        (*joints, *adds),
        tuple(numbers),
        Basis(count, count, judged=_judged_words(result), held_out=len(_held_out_names(result)),
              computed=result.computed),
        next=(*clock, *steps),
        qualifier=export_qualifier(limits) if verdict == "yes" else "",
    )


LOADS_TEXT = (
    "EMG adds to angles where torque does not follow from the motion: record other loads and speeds, and hold some of "
    'them out (`use = "validate"`)'
)
"""Next step where EMG does not add to angles."""


HOLD_OUT_STEP = Step(f"To export an estimator, {HOLD_OUT_TEXT} and calibrate again")
"""Next step where cross-validation was over all recordings, which writes no card to export."""


def _best_cards(result: CalibrationResult) -> dict[str, EmgEstimatorCard]:
    """Return the estimator to export of each joint that has one: the best in cross-validation."""
    names = {each.what: [f"emg_{each.what}_{kind}" for kind in ESTIMATOR_KINDS] for each in result.chosen}
    best = {what: best_estimator(result.cards[n] for n in own if n in result.live) for what, own in names.items()}
    return {what: card for what, card in best.items() if card is not None}


def _export_steps(result: CalibrationResult) -> tuple[Step, ...]:
    """Return the exports of causal estimators with their own held-out figures; a paper where none can be exported.

    The recommended estimator may see the future, and a robot cannot run it. An estimator that is too poor, or no better
    than angles alone, is not recommended for export.
    """
    good, limited, cards = [], [], _best_cards(result)
    for each in result.chosen:
        if each.what not in cards:
            continue
        name = cards[each.what].name
        scores = result.live[name]
        if limits := limits_of(scores):
            limited.append(Step(
                f"Do not rely on the causal estimator of {each.what} ({name}.json): {', '.join(limits)}. Fit more "
                f"varied recordings before you export it; now: {scores_words(scores)}"
            ))  # fmt: skip
            continue
        words = named_family(name.rpartition("_")[2]).description
        good.append(Step(
            f"Export the causal estimator of {each.what} that is best in cross-validation ({words}): "
            f"{scores_words(scores)}; R² {each.judged[0].score.r2:.3f} belongs to {each.brief}, which runs offline "
            "only",
            "export", ("--card", f"{name}.json"),
        ))  # fmt: skip
    if any(each.judged[0].kind == TRIALS_KIND for each in result.chosen):
        limited.append(HOLD_OUT_STEP)
    steps = (*good, *limited)[:MAX_IMPROVING_STEPS]
    return steps if good else (*steps, PAPER_STEP)


def _worth_steps(result: CalibrationResult) -> tuple[Step, ...]:
    """Return what to do where EMG does not add to angles, or where nobody can say whether it does."""
    answers: dict[str, set[str]] = {}
    for each in result.worth:
        answers.setdefault(each.what, set()).add(each.worth.answer)
    if result.worth and all(own == {"worth it"} for own in answers.values()):
        return ()
    bare = [what for what, own in answers.items() if own == {"not worth it"}]
    alone = f"Angles alone may do for {listed_names(bare, MAX_NAMED_GAINS)}: EMG adds nothing there. " if bare else ""
    return (Step(alone + LOADS_TEXT),)


def _improving(result: CalibrationResult, joints: Sequence[AnswerPart]) -> tuple[Step, ...]:
    """Return what improves the estimate of torque: a recorded torque, a held-out recording, or more alike ones."""
    if not joints:
        return (Step('Hold out a recording (`use = "validate"` in study.toml)'),)
    steps = []
    if any(part.verdict == "cannot say" for part in joints):
        steps.append(Step("Record the torque itself in one recording or more: with a dynamometer or a force plate"))
    poor = [each for each, part in zip(result.chosen, joints, strict=True) if part.verdict == "no"]
    for each in poor[:MAX_IMPROVING_STEPS]:
        by_trial = each.judged[0].by_trial
        name = each.judged[0].recording or max(by_trial, key=lambda t: by_trial[t].rmse, default="")
        where = f" of {_spoken(name)}" if name else ""
        steps.append(Step(
            f"Record and fit more trials of {each.what} with the loads, speeds and angles{where}, where the error is "
            "largest"
        ))  # fmt: skip
    return tuple(steps)


def _judged_words(result: CalibrationResult) -> str:
    """Return the data of the errors in words, with their number."""
    held = _held_out_names(result)
    if held:
        return "one held-out recording" if len(held) == 1 else f"{len(held)} held-out recordings"
    trials = len({name for each in result.chosen for e in each.judged for name in e.by_trial}) or len(result.checksums)
    return f"{trials} trials by cross-validation"


def _held_out_names(result: CalibrationResult) -> set[str]:
    """Return the held-out recordings that the errors are of."""
    return {e.recording for each in result.chosen for e in each.judged} - {""}


def _gain_words(worth: EmgWorth) -> str:
    """Return the gain of EMG in R² with its interval, in words."""
    ends = f", 95 % interval {worth.low:+.2f} to {worth.high:+.2f}" if np.isfinite(worth.low) else ""
    return f"gain in R² {worth.gain:+.2f}{ends}; required gain {worth.margin:g}"


def _choose_evaluation(study: Study) -> Callable[[Study, Progress], CalibrationFindings]:
    """Return the evaluation that suits the study's protocols and held-out recordings."""
    protocols = {recording.protocol for recording in study.recordings()}
    if STEP_PROTOCOL in protocols:
        return _evaluate_by_repetition
    if EXTENSION_PROTOCOL in protocols:
        return leave_out_repetitions
    for evaluation in offered("TORQUE_EVALUATIONS"):
        if evaluation.suits(study):
            return evaluation.evaluate
    if len(study.recordings()) > 2 and all(recording.use == "fit" for recording in study.recordings()):
        return leave_out_recordings
    return _evaluate_by_recording


def _split_trials(study: Study, joint: str, trials: list[TorqueTrial]) -> tuple[list[TorqueTrial], list[TorqueTrial]]:
    """Return the fitted and the held-out trials of a joint, at least one of each."""
    parts = [t for t in trials if not t.heldout], [t for t in trials if t.heldout]
    if not all(parts):
        raise IdentificationError(
            f"{study.folder}, joint {joint}: found {len(parts[0])} recordings to fit and {len(parts[1])} held out, "
            "expected at least one of each"
        )
    return parts


def _evaluate_by_recording(study: Study, tell: Progress) -> CalibrationFindings:
    """Fit every estimator to the fitted recordings and score it on each held-out one."""
    found, table = CalibrationFindings(), study.table(EmgTorqueTable)
    joints, rescale = table.joints, table.rescale
    again = rescale is not None
    trials = {joint: moment_trials(study, joint) for joint in joints}
    parts = {joint: _split_trials(study, joint, trials[joint]) for joint in joints}
    runs = [
        (joint, name, causal)
        for causal, names in ((False, REPORTED_ESTIMATORS), (True, CAUSAL_ESTIMATORS))
        for joint in joints
        for name in findings.find_applicable_estimators(trials[joint], joint, found, names)
    ]
    # Watches of the maps that run live say which channels changed, before any estimator is scored.
    watching = [run for run in runs if run[2] and run[1] in LIVE_ESTIMATORS]
    scored = [run for run in runs if run not in watching]
    fits = _fit_runs(watching, [MapJob(parts[joint][0], name, True) for joint, name, _ in watching], tell, 0, len(runs))
    maps = {(joint, name): fit for (joint, name, _), (fit, _) in fits.items()}
    session, compared = compare_sessions(study, *parts[joints[0]], maps)
    found.sessions.update(compared)
    for joint, (fitted, held) in parts.items():
        judged = [session.repair(t, rescale, c) if again and (c := compared[t.recording]).changed else t for t in held]
        found.across[joint] = [*fitted, *judged]
    found.verdicts.extend(session_verdicts(found.sessions, again))
    found.verdicts.append(Verdict("note", normalisation_words(study)))
    found.verdicts.extend((*ignored_channel_verdicts(study), *mains_verdicts(study, table)))
    judged = {
        joint: tuple(zip(parts[joint][1], (t for t in own if t.heldout), strict=True))
        for joint, own in found.across.items()
    }
    examine = {run: Examination(judged[run[0]], run[2]) for run in runs}
    fits = {run: (fit, examine[run](fit, parts[run[0]][0])) for run, (fit, _) in fits.items()}
    jobs = [MapJob(parts[joint][0], name, causal, examine[joint, name, causal]) for joint, name, causal in scored]
    fits |= _fit_runs(scored, jobs, tell, len(watching), len(runs))
    traces: dict[tuple[str, str], TorqueTrace] = {}
    for joint, name, causal in runs:
        fit, (away, predicted) = fits[joint, name, causal]
        fitted, held = parts[joint]
        if causal and name in LIVE_ESTIMATORS:
            found.causal[joint, name], found.stiffness_trials[joint] = fit, fitted[0]
        if causal and name == CARD_ESTIMATOR:
            found.cards[f"torque_map_{joint}"] = torque_card(study, fit, fitted, f"torque_map_{joint}")
        if isinstance(fit, HillMap) and ESTIMATOR_FAMILIES[name].shows_muscles and not causal:
            found.muscles[joint], found.shown[joint] = fit, held[0]
        for recording, pieces in group_pieces(held).items():
            # A filter ends at a cut, so that each piece is predicted alone; the recording has one score.
            changed, torque = found.sessions[recording].changed, _together(t.torque for t in pieces)
            without = None
            if changed and ESTIMATOR_FAMILIES[name].muscles and len(changed) < len(session.muscles):
                filled = (fit.predict(session.predict_channels(t, changed)) for t in pieces)
                without = score(torque, _together(filled))
            used = [predicted[t.name] for t in pieces]
            made = _together(each for _, _, each in used)
            repaired = tuple(dict.fromkeys(muscle for _, muscles, _ in used for muscle in muscles))
            shows = ESTIMATOR_FAMILIES[name].shows_muscles
            half = _together(fit.half_width(t) for t, _, _ in used) if shows else None
            unrepaired = _together(fit.predict(t) for t in pieces) if changed and again else None
            found.evaluated.append(
                findings.evaluate_on_recording(
                    joint, name, causal, recording, torque, made, fit, away, half,
                    without_changed=without,
                    as_recorded=None if unrepaired is None else score(torque, unrepaired),
                    repaired=repaired,
                    torque_unit=pieces[0].unit,
                )
            )  # fmt: skip
            if not causal:
                time = _together(t.time for t in pieces)
                empty = TorqueTrace(joint, recording, time, torque, {}, {}, ERROR_BAND.share)
                trace = traces.setdefault((joint, recording), empty)
                trace.predicted[name] = made
                if away is not None and found.sessions[recording].is_valid:
                    trace.half_width[name] = np.full(len(made), away.half_width)
    found.traces.extend(
        traces[joint, name] for joint in joints for name in group_pieces(trials[joint]) if (joint, name) in traces
    )
    # All joints have the same recordings.
    found.trials.extend(trials[joints[0]])
    return found


_Run = tuple[str, str, bool]
"""Joint, name of the estimator, and whether it is causal."""


def _fit_runs(
    runs: Sequence[_Run], jobs: Sequence[MapJob], tell: Progress, done: int, count: int
) -> dict[_Run, tuple[Any, Any]]:
    """Return the fitted map and the examination of each run, after `done` of `count` runs."""
    made = fit_torque_maps(
        jobs,
        lambda i, share: tell(
            f"{runs[i][0]}, {ESTIMATOR_FAMILIES[runs[i][1]].description}", (done + share * len(runs)) / count
        ),
    )
    return dict(zip(runs, made, strict=True))


def _together(parts: Iterable[np.ndarray]) -> np.ndarray:
    """Return the samples of a recording's pieces one after another, shape (n,)."""
    return np.concatenate([np.atleast_1d(part) for part in parts])


def _evaluate_by_repetition(study: Study, tell: Progress) -> CalibrationFindings:
    """Score every estimator on torque steps against an orthosis by cross-validation over repetitions."""
    steps = [recording for recording in study.recordings() if recording.protocol == STEP_PROTOCOL]
    people = list(dict.fromkeys(recording.participant for recording in steps))
    found = CalibrationFindings()
    for i, person in enumerate(people):
        body, joint = moved_body(study, person), study.table(EmgTorqueTable).joints[0]
        what = person or joint
        found.verdicts.append(Verdict("note", f"{what}: {body.words}"))
        for causal, names in ((False, REPORTED_ESTIMATORS), (True, CAUSAL_ESTIMATORS)):
            trials = step_trials(study, person, body, causal=causal, joint=joint)
            base, span = (i + 0.8 * causal) / len(people), (0.2 if causal else 0.8) / len(people)
            names = findings.find_applicable_estimators(trials, what, found, names, is_one_of_several=len(people) > 1)
            results = cross_validate_torque_maps(
                trials,
                names,
                causal=causal,
                on_progress=lambda text, share, b=base, s=span, p=person: tell(f"{p}, {text}", b + s * share),
                examine=None if causal else run_tests_if_candidate,
            )
            own = _left_out_evaluations(results, trials, what, STEP_KIND, causal=causal)
            found.evaluated.extend(own)
            if causal:
                card = f"torque_map_{what}"
                found.cards[card] = torque_card(
                    study, fit_torque_map(trials, CARD_ESTIMATOR, causal=True), trials, card
                )
            else:
                found.chosen[what] = findings.recommend_by_fold(trials, results, own)
                found.trials.extend(trials)
                # Up to three trials are drawn: the one with the largest error, then easier ones, evenly spaced.
                worst = sorted(trials, key=lambda t: -results[names[0]].by_trial[t.name].rmse)[
                    :: max(1, len(trials) // 3)
                ]
                found.traces.extend(
                    TorqueTrace(what, t.name, t.time, t.torque, {n: r.predicted[t.name] for n, r in results.items()})
                    for t in worst[:3]
                )
    return found


def _error_tables(
    evaluated: Sequence[EstimatorEvaluation], chosen: Sequence[RecommendedEstimator]
) -> tuple[FigureTable, ...]:
    """Return a table of errors for each joint or person and each recording, angles alone first.

    Estimators that see the measured torque are in tables of their own, after the others. Errors are compared with that
    of the best estimator without EMG, as the answer compares them.
    """
    alone = {(each.what, e.recording): e.score.rmse for each in chosen for e in each.bare}
    titles = {False: "Torque from EMG", True: "Torque from EMG and the measured torque (not comparable)"}
    made: dict[bool, list[FigureTable]] = {told: [] for told in titles}
    for what, recording in dict.fromkeys((each.what, each.recording) for each in evaluated):
        own = [each for each in evaluated if (each.what, each.recording) == (what, recording)]
        bare = alone.get((what, recording))
        own.sort(key=lambda e: e.estimator != BASELINE_ESTIMATOR)
        where = recording.replace("_", " ") or "cross-validation"
        for told, title in titles.items():
            peers = [e for e in own if e.family.sees_measured_torque == told]
            rows = tuple(
                (
                    e.words, e.score.rmse, e.score.r2, e.score.rmse / bare if bare else None,
                    None if e.within is None else e.within.r2,
                )
                for e in peers
            )  # fmt: skip
            if rows:
                heads = ("Estimator", f"RMSE ({peers[0].unit})", "R²", "RMSE / RMSE without EMG", "R² in fitted data")
                made[told].append(FigureTable(f"{title}: {what}, {where}", heads, rows, max_brief_rows=0))
    return (*made[False], *made[True])


def _chosen_tables(chosen: Sequence[RecommendedEstimator], refused: Collection[str] = ()) -> tuple[FigureTable, ...]:
    """Return tables of the recommended estimators by condition or trial with the baseline, one for each unit.

    Recordings without a valid estimate, `refused`, have no prediction band.
    """

    def coverage(one: ConditionScore) -> str | None:
        if one.name in refused:
            return "none stated"
        return None if one.held is None else f"{100.0 * one.held:.0f} %"

    made = []
    for unit in dict.fromkeys(each.judged[0].unit for each in chosen):
        band = f"{100 * ERROR_BAND.share:g} % band"
        heads = ("Held out", "Estimator", f"RMSE ({unit})", "R²", "RMSE without EMG", f"coverage of the {band}")
        rows = tuple(
            (
                f"{each.what}, {one.name.replace('_', ' ')}", named_family(one.estimator).description,
                one.score.rmse, one.score.r2, None if one.bare is None else one.bare.rmse, coverage(one),
            )
            for each in chosen
            if each.judged[0].unit == unit
            for one in each.by_condition()
        )  # fmt: skip
        made.append(FigureTable("Recommended estimators", heads, rows, MAX_BRIEF_NAMED_ROWS))
    return tuple(made)


def _repair_tables(evaluated: Sequence[EstimatorEvaluation]) -> tuple[FigureTable, ...]:
    """Return tables of R² before and after repairs: the best estimator on each recording, then each recording's own."""
    heads = ("Estimator", "R² as recorded", "R² repaired", "Repaired", "R² without the changed channels")
    own = [e for e in evaluated if e.as_recorded is not None]
    best: dict[tuple[str, str], EstimatorEvaluation] = {}
    for e in own:
        place = e.what, e.recording
        is_comparable = e.repaired and not e.family.sees_measured_torque
        if is_comparable and (place not in best or e.score.r2 > best[place].score.r2):
            best[place] = e
    rows = tuple(
        (f"{what}, {_spoken(recording)}", e.words, e.as_recorded.r2, e.score.r2, _spoken(", ".join(e.repaired)))
        for (what, recording), e in best.items()
    )
    made = [
        FigureTable("Effect of rescale on the best repaired estimator", ("Held out", *heads[:4]), rows,
                    max_brief_rows=MAX_BRIEF_NAMED_ROWS)
    ][: len(rows)]  # fmt: skip
    for what, recording in dict.fromkeys((e.what, e.recording) for e in own):
        rows = tuple(
            (
                e.words, e.as_recorded.r2, e.score.r2,
                ", ".join(m.replace("_", " ") for m in e.repaired) or "none: the torque hardly changes",
                None if e.without_changed is None else e.without_changed.r2,
            )
            for e in own
            if (e.what, e.recording) == (what, recording)
        )  # fmt: skip
        title = f"Effect of rescale: {what}, {recording.replace('_', ' ')}"
        made.append(FigureTable(title, heads, rows, max_brief_rows=0))
    return tuple(made)


def _condition_test_tables(evaluated: Sequence[EstimatorEvaluation]) -> tuple[FigureTable, ...]:
    """Return tables of the condition tests that chose the estimator.

    Cross-validation over trials has no such table, because each fold has its own tests.
    """
    made = []
    for what in dict.fromkeys(e.what for e in evaluated if e.examined is not None):
        own = {e.estimator: e for e in evaluated if e.what == what and e.examined is not None}
        first = next(iter(own.values()))
        heads = ("Estimator", "All", *(word[0].upper() + word[1:] for word in first.examined.words))
        rows = tuple((e.family.description, e.examined.mean, *e.examined.rmse) for e in own.values())
        unit, place = first.torque_unit, "in tests within the fitted recordings"
        made.append(FigureTable(f"Estimator choice: {what}, RMSE ({unit}) {place}", heads, rows, max_brief_rows=0))
    return tuple(made)


def _invalid_recordings_sentence(found: CalibrationFindings) -> str:
    """Return sentences that name recordings on which no estimate is valid; empty if there are none."""
    away = [f"{name} ({invalidity_words(c)})" for name, c in found.sessions.items() if not c.is_valid]
    return f"No estimate is valid on {', '.join(away)}. " if away else ""


def _invalid_band_sentences(found: CalibrationFindings) -> Iterator[str]:
    """Yield sentences that name where error bands are not known to hold.

    They follow from EMG and angles alone, without any reference torque.
    """
    chosen = found.chosen.values()
    changed = [
        f"{name} ({', '.join(m.replace('_', ' ') for m in c.changed)})"
        for name, c in found.sessions.items()
        if c.is_valid and c.changed
    ]
    if changed:
        yield f"Prediction bands are not valid on {', '.join(changed)}, because EMG channels changed."
    few = {each.what: each.conditions for each in chosen if 1 < each.conditions < ERROR_BAND.min_conditions}
    if few:
        lacking = ERROR_BAND.min_conditions - min(few.values())
        yield (
            f"The prediction band is based on too few fitted trials: "
            f"{', '.join(f'{what}, {count}' for what, count in few.items())}. Record {lacking} more "
            f"trial{'s' if lacking > 1 else ''}."
        )
    narrow = [
        f"{each.what} ({100.0 * each.fitted_coverage:.0f} %)"
        for each in chosen
        if each.fitted_coverage is not None and each.fitted_coverage < MIN_LEFT_OUT_COVERAGE
    ]
    if narrow:
        share = f"{100 * ERROR_BAND.share:g} %"
        yield f"In cross-validation, the {share} prediction bands cover too little: {', '.join(narrow)}."


def _headline(chosen: Sequence[RecommendedEstimator]) -> str:
    """Return the headline: errors of the recommended estimators and of angles alone, the worst recording first."""
    sentences = []
    if len(chosen) > 3:
        words = " or ".join(dict.fromkeys(each.brief for each in chosen))
        worst = max(chosen, key=lambda each: each.judged[0].score.rmse)
        one = worst.judged[0]
        least = min(e.score.rmse for each in chosen for e in each.judged)
        bare = [each.bare[0].score.rmse for each in chosen if each.bare]
        sentences.append(
            f"{', '.join(each.what for each in chosen)}: RMS error from {least:.3g} to {_error_words(one)} "
            f"({worst.what}) with {words}"
            + (f"; angles alone, without EMG: {min(bare):.3g} to {max(bare):.3g} {one.unit}" if bare else "")
        )
        chosen = ()
    for each in chosen:
        judged = [(_recording_words(e), _error_words(e)) for e in each.judged[:3]]
        first = f"{judged[0][1]}{_judged_on(each)}"
        others = [f"{figure}{place}" for place, figure in judged[1:]]
        if len(each.judged) > 3:
            others = [f"{_error_words(each.judged[-1])} at best"]
        by_trial = each.judged[0].by_trial
        if by_trial:
            name = max(by_trial, key=lambda t: by_trial[t].rmse)
            own = f"{by_trial[name].rmse:.3g} {each.judged[0].unit} (R² {by_trial[name].r2:.3f})"
            alone = each.bare[0].by_trial.get(name) if each.bare else None
            beside = f"; angles alone there: {alone.rmse:.3g} {each.judged[0].unit}" if alone is not None else ""
            worst_words = f"; the worst trial is {_spoken(name)}, with {own}{beside}"
        else:
            worst_words = ""
        bare = " and ".join(f"{e.score.rmse:.3g}" for e in each.bare[:3])
        sentences.append(
            f"{each.what}: RMS error {' and '.join([first, *others])}, with {each.brief}"
            + (f" (angles alone, without EMG: {bare} {each.judged[0].unit})" if bare else "")
            + worst_words
        )
    recordings = {e.recording for each in chosen for e in each.judged} - {""}
    where = f", on the {len(recordings)} held-out recordings" if len(recordings) > 1 else ""
    is_said = any(each.by for each in chosen)
    return "; ".join(sentences) + (where or ("" if is_said else ", on held-out data")) + "."


def _error_words(judged: EstimatorEvaluation) -> str:
    """Return an estimator's error in words."""
    return f"{judged.score.rmse:.3g} {judged.unit} (R² {judged.score.r2:.3f})"


def _recording_words(judged: EstimatorEvaluation) -> str:
    """Return the words that name the recording of an error."""
    return f" on {recording_words(judged.recording)}" if judged.recording else ""


def _judged_on(each: RecommendedEstimator) -> str:
    """Return the words that follow the first error of an estimator: its recording, or how trials are put together."""
    worst = each.judged[0]
    if worst.by_trial:
        return f", {'pooled' if worst.kind == STEP_KIND else 'mean'} over {len(worst.by_trial)} held-out trials"
    return _recording_words(worst) + (f" (the worst of {len(each.judged)})" if len(each.judged) > 1 else "")


def _spoken(name: str) -> str:
    """Return the name of a recording or trial as a sentence has it."""
    return name.replace("_", " ")


def calibration_verdicts(
    study: Study,
    evaluated: Sequence[EstimatorEvaluation],
    trials: Sequence[TorqueTrial],
    chosen: Sequence[RecommendedEstimator] = (),
) -> Iterator[Verdict]:
    """Yield warnings and notes on the recommended estimators and on their test recordings."""
    for each in chosen:
        for best in each.judged:
            yield from _estimator_verdicts(each, best)
    judged = {each.recording for each in evaluated} | {trial.name for trial in trials}
    idle = [
        r.name
        for r in study.recordings("validate")
        if any(name.startswith("emg.") for s in (r, *r.streams.values()) for name in s.channels)
        and not any(f"{name}_".startswith(f"{r.name}_") for name in judged)
    ]
    if idle:
        yield Verdict(
            "warning",
            f"{', '.join(idle)}: held out, but not used, because no torque was recorded there. The reported errors "
            "do not apply to such movements.",
        )
    late = smoothing_delay(0.05, trials[0].fs)
    table = study.table(EmgTorqueTable)
    chain = study_chain(study, table)
    stream = next((r.streams[table.emg] for r in study.recordings() if table.emg in r.streams), None)
    if chain is None:
        yield Verdict(
            "note",
            "Envelopes were recorded, not EMG, so that their delay is unknown. Results marked causal filter the "
            f"angles causally; smoothing delays tree ensembles by {1e3 * late:.0f} ms.",
        )
    elif stream is not None:
        yield Verdict(
            "note",
            f'The causal chain "{chain.name}" delays EMG by {1e3 * chain.delay(stream.fs).filters:.0f} ms; smoothing '
            f"delays tree ensembles by another {1e3 * late:.0f} ms.",
        )


def _estimator_verdicts(each: RecommendedEstimator, best: EstimatorEvaluation) -> Iterator[Verdict]:
    """Yield warnings where angles alone err no more on a recording, or where R² falls there."""
    bare = next((e for e in each.bare if e.recording == best.recording), None)
    if bare is not None and bare.score.rmse <= best.score.rmse:
        on = f" on {best.recording}" if best.recording else ""
        yield Verdict(
            "warning",
            f"{each.what}{on}: joint angles alone have an RMS error of {bare.score.rmse:.3g} {bare.unit}, no larger "
            f"than the estimator with EMG ({best.score.rmse:.3g} {best.unit}). In these movements the torque follows "
            "from the motion, and the estimator may miss an effort that does not move the joint.",
        )
    if best.within is not None and best.score.r2 < best.within.r2 - 0.1:
        yield Verdict(
            "warning",
            f"{each.what}: R² falls from {best.within.r2:.3f} in the fitted recordings to {best.score.r2:.3f} on "
            f"{best.recording}: record more movements, and more varied ones, to fit.",
        )
