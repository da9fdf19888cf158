"""Find activations in every test recording, and score them by removing each electrode in turn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...._atomic import write_text_atomically
from ...._errors import IdentificationError
from ....models.estimates import Verdict
from ....study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step, answer_of_parts
from ....study.procedures.findings import MIN_EXPLAINED_PERCENT
from ....study.procedures.procedure import Progress, quiet
from ....study.procedures.result import FigureTable, Result
from ....study.results import ResultRow
from ....study.study import Study
from ...estimators.cross_validation import Score, score
from ...estimators.hill import TrialByJoint, fit_hill, fit_together
from ...estimators.muscle_trials import count_warm_up_samples
from ...estimators.torque_trial import MUSCLE_BY_CHANNEL_ALIAS, TorqueTrial
from ...estimators.unrecorded import (
    FILLING_METHODS,
    TORQUE_INFORMED_METHODS,
    AssistanceWeights,
    CalibratedMuscleSet,
    EnvelopeFiller,
    FillingScore,
    SingleJointMuscles,
    choose_trust,
    make_assisted_muscles,
    score_filling_methods,
    torque_standard_deviations,
)
from ..emg_torque.emg_torque_table import EmgTorqueTable
from ..emg_torque.trial_sources import moment_trials
from .activations_table import ActivationsTable

MAX_BRIEF_ROWS = 8
"""Largest number of rows of each table on a terminal without ``-v``."""

JOINTS_TOGETHER_ID = "together"
"""Part of row ids and file names for the muscles of several joints."""


def make_joint_id(what: str) -> str:
    """Return the id of a joint, or `JOINTS_TOGETHER_ID` for several joints in words."""
    return JOINTS_TOGETHER_ID if " and " in what else what


@dataclass(frozen=True, eq=False)
class AssistedRecording:
    """Activations and torques in one recording."""

    what: str  # Joint, or several joints in words
    recording: str
    muscles: tuple[str, ...]  # Names of the muscles
    filled: tuple[str, ...]  # Names of the muscles without EMG
    trust: AssistanceWeights
    emg_driven: Mapping[str, Score]  # Score of EMG-driven muscles on the held-out torque, by joint
    assisted: Mapping[str, Score]  # Score of EMG-assisted muscles, which see this torque, by joint
    moved: float  # RMS difference of assisted activations from those by EMG
    checksum: str
    time: np.ndarray = field(repr=False)  # Time, shape (n,) [s]
    torque: Mapping[str, np.ndarray] = field(repr=False)  # Measured torque by joint, shape (n,) [N m]
    driven: Mapping[str, np.ndarray] = field(repr=False)  # Torque of EMG-driven muscles by joint, shape (n,) [N m]
    followed: Mapping[str, np.ndarray] = field(repr=False)  # Torque of assisted muscles by joint, shape (n,) [N m]
    by_emg: np.ndarray = field(repr=False)  # Activation by EMG, shape (m, n)
    activation: np.ndarray = field(repr=False)  # Assisted activation, shape (m, n)

    @property
    def file(self) -> str:
        """Name of the file of activations in ``tables/``."""
        return f"activations_{make_joint_id(self.what)}_{self.recording}.csv"

    def named(self, joint: str) -> str:
        """Return the part of row ids for a joint in this recording."""
        own = make_joint_id(self.what)
        return f"{own if joint in (self.what, own) else f'{own}.{joint}'}.{self.recording}"


@dataclass(frozen=True, kw_only=True, repr=False)
class ActivationsResult(Result):
    """Result of `activations`."""

    recordings: tuple[AssistedRecording, ...] = field(default=(), repr=False)
    # Scores of filling methods for removed electrodes, each with its joint, or joints in words
    left_out: tuple[tuple[str, FillingScore], ...] = field(default=(), repr=False)

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return activations_answer(self)

    def written(self, study: Study) -> str:
        return f"Activations over time in {study.made / 'tables'}"

    def save_more(self, study: Study) -> None:
        folder = study.place("tables")
        folder.mkdir(parents=True, exist_ok=True)
        for each in self.recordings:
            heads, columns = ["time_s"], [each.time]
            for joint in each.torque:
                part = "" if joint == each.what else f"_{joint}"
                heads += [f"{name}{part}_Nm" for name in ("torque", "emg_driven", "assisted")]
                columns += [each.torque[joint], each.driven[joint], each.followed[joint]]
            heads += [f"{m}_{how}" for how in ("emg", "assisted") for m in each.muscles]
            table = np.vstack((*columns, each.by_emg, each.activation)).T
            lines = [",".join(heads), *(",".join(f"{x:.6g}" for x in row) for row in table)]
            write_text_atomically(folder / each.file, "\n".join(lines) + "\n")


def find_activations(study: Study, tell: Progress = quiet) -> ActivationsResult:
    """Find activations near EMG that reproduce the measured torques.

    Muscles of several joints are calibrated over all of them, if their torques are in the same recordings. `study`
    [activations].
    """
    table, config = study.find_table(ActivationsTable), study.find_table(EmgTorqueTable)
    if table is None or config is None:
        raise IdentificationError(f"{study.folder}: found no tables [activations] and [emg_torque], expected both")
    recordings, left_out, checksums, remarks = [], [], {}, []
    trials = {joint: moment_trials(study, joint) for joint in config.joints}
    checksums |= {trial.name: trial.checksum for own in trials.values() for trial in own}
    parts = [tuple(trials)] if _have_same_recordings(trials) else [(joint,) for joint in trials]
    if len(parts) > 1:
        remarks.append(
            Verdict("note", f"{', '.join(trials)}: different recordings, so each joint is calibrated alone.")
        )
    for i, joints in enumerate(parts):
        what = " and ".join(joints)
        splits = _split_recordings(study, {joint: trials[joint] for joint in joints})
        for k, (fitted, judged) in enumerate(splits):
            at = (i + k / len(splits)) / len(parts)
            tell(f"{what}, calibrating muscles", at)
            found = _calibrate_muscles(fitted)
            stated = None if table.trust is None else AssistanceWeights(table.trust, table.effort, chosen=False)
            trust = stated or choose_trust(found, fitted)
            tell(f"{what}, removing electrodes", at + 0.3 / len(splits) / len(parts))
            judged = (
                [EnvelopeFiller(fitted).fill_in(t, table.lost, table.fill) for t in judged] if table.lost else judged
            )
            recordings += [_assist_recording(what, found, fitted, trial, trust, table) for trial in judged]
            left_out += [(what, each) for each in score_filling_methods(found, fitted, judged, trust, table.lost)]
    return ActivationsResult(
        study=study.name,
        headline=_headline(recordings, left_out),
        tables=(_table(recordings), *_left_out_tables(left_out)),
        verdicts=(*remarks, *_verdicts(recordings, left_out)),
        rows=tuple(_rows(study.name, recordings, left_out)),
        cards={},
        checksums=checksums,
        recordings=tuple(recordings),
        left_out=tuple(left_out),
    )


def activations_answer(result: ActivationsResult) -> Answer:
    """Return whether the activation of a muscle whose electrode was removed is predicted, at each joint."""
    parts, numbers = [], []
    for joint in _joints_left_out(result.left_out):
        r2 = median_scores(result.left_out, joint, _best_emg_method(result.left_out, joint))[0]
        text = f"R² {r2:.2f} (median)"
        parts.append(AnswerPart(joint, "yes" if r2 >= MIN_EXPLAINED_PERCENT / 100.0 else "no", text))
        numbers.append(AnswerNumber(f"median R2 of a removed electrode, {joint}", r2, "1"))
    count, judged = len(result.checksums), {each.recording for each in result.recordings}
    return answer_of_parts(
        "Is the activation of a muscle whose electrode was removed predicted, with R² of "
        f"{MIN_EXPLAINED_PERCENT / 100.0:g} or more?",
        result.headline,
        parts,
        numbers,
        Basis(count, count, judged=f"{len(judged)} recordings that were not fitted"),
        improve=(
            Step("Keep an electrode on every muscle: the other electrodes and the torque do not predict its activation")
            if parts
            else Step("Record the torque and EMG of three muscles or more of a joint"),
            Step("Record other loads and speeds, so that muscles of a joint are not always active together"),
        ),
        without_parts="no electrode could be removed",
    )


def _have_same_recordings(trials: Mapping[str, Sequence[TorqueTrial]]) -> bool:
    """Return whether every joint's torque is known in the same recordings."""
    return len({tuple(t.name for t in own) for own in trials.values()}) == 1


def _calibrate_muscles(fitted: Sequence[TrialByJoint]) -> CalibratedMuscleSet:
    """Calibrate muscles of one joint, or of several at once."""
    by_joint = {joint: [each[joint] for each in fitted] for joint in fitted[0]}
    return fit_together(by_joint) if len(by_joint) > 1 else SingleJointMuscles(fit_hill(next(iter(by_joint.values()))))


def _split_recordings(
    study: Study, trials: Mapping[str, Sequence[TorqueTrial]]
) -> list[tuple[list[TrialByJoint], list[TrialByJoint]]]:
    """Return pairs of fitted and test recordings: as the study says, or by cross-validation over recordings."""
    across = [dict(zip(trials, each, strict=True)) for each in zip(*trials.values(), strict=True)]
    held = [next(iter(each.values())).heldout for each in across]
    fitted = [each for each, out in zip(across, held, strict=True) if not out]
    judged = [each for each, out in zip(across, held, strict=True) if out]
    if fitted and judged:
        return [(fitted, judged)]
    if len(fitted) > 1:
        return [
            ([each for each in fitted if each is not out], [{j: replace(t, heldout=True) for j, t in out.items()}])
            for out in fitted
        ]
    raise IdentificationError(
        f"{study.folder}, joint {' and '.join(trials)}: found {len(across)} recordings with channels "
        f"{' and '.join(f'moment.{joint}' for joint in trials)} and EMG, {len(fitted)} of them to be fitted, expected "
        "one to fit and one held out, or two to fit for cross-validation"
    )


def _assist_recording(
    what: str,
    found: CalibratedMuscleSet,
    fitted: Sequence[TrialByJoint],
    trial: TrialByJoint,
    trust: AssistanceWeights,
    table,
) -> AssistedRecording:
    """Find the assisted activations of one recording and score their torque."""
    muscles, own = make_assisted_muscles(found, trial, torque_standard_deviations(fitted))
    names, one = tuple(found.driven), next(iter(trial.values()))
    channels = {MUSCLE_BY_CHANNEL_ALIAS.get(name, name) for name in one.envelopes}
    without = tuple(i for i, name in enumerate(names) if name not in channels)
    lost = tuple(name for name in names if set(found.driven[name]) & set(table.lost))
    static = without if table.unrecorded == "static" else ()
    activation = muscles.find_activations(static, trust=trust.trust, effort=trust.effort)
    by_emg, kept = muscles.recorded, slice(count_warm_up_samples(one), None)
    predicted, torque = found.predict(trial), {joint: trial[joint].torque for joint in found.joints}
    followed = dict(zip(found.joints, muscles.torque(activation)[:, own], strict=True))
    return AssistedRecording(
        what, one.name, names, tuple(dict.fromkeys((*(names[i] for i in without), *lost))), trust,
        {joint: score(torque[joint][kept], predicted[joint][kept]) for joint in torque},
        {joint: score(torque[joint][kept], followed[joint][kept]) for joint in torque},
        float(np.sqrt(np.mean((activation - by_emg)[:, own] ** 2))), one.checksum, one.time, torque, predicted,
        followed, by_emg[:, own], activation[:, own],
    )  # fmt: skip


def median_scores(
    left_out: Sequence[tuple[str, FillingScore]], joint: str, way: str
) -> tuple[float, float, float | None]:
    """Return medians over electrodes and recordings: R2 and correlation of activations, and R2 of the torque."""
    own = [each for j, each in left_out if j == joint and each.way == way]
    torque = [np.mean([s.r2 for s in each.torque.values()]) for each in own if each.torque is not None]
    return (
        float(np.median([each.r2 for each in own])),
        float(np.median([each.correlation for each in own])),
        float(np.median(torque)) if torque else None,
    )


def find_scored_methods(left_out: Sequence[tuple[str, FillingScore]], joint: str) -> list[str]:
    """Return the filling methods that were scored at a joint."""
    present = {each.way for j, each in left_out if j == joint}
    return [way for way in FILLING_METHODS if way in present]


def _best_emg_method(left_out: Sequence[tuple[str, FillingScore]], joint: str) -> str:
    """Return the filling method with the largest median R2 among those that do not see the torque."""
    return max(
        (w for w in find_scored_methods(left_out, joint) if w not in TORQUE_INFORMED_METHODS),
        key=lambda w: median_scores(left_out, joint, w)[0],
    )


def _joints_left_out(left_out: Sequence[tuple[str, FillingScore]]) -> list[str]:
    """Return the joints with removed electrodes."""
    return list(dict.fromkeys(joint for joint, _ in left_out))


def _headline(recordings: Sequence[AssistedRecording], left_out: Sequence[tuple[str, FillingScore]]) -> str:
    """Return the headline: the median scores of filling in a removed electrode, by joint."""
    sentences = []
    for joint in _joints_left_out(left_out):
        way = _best_emg_method(left_out, joint)
        own, assisted = (median_scores(left_out, joint, each)[0] for each in (way, "assisted"))
        sentences.append(
            f"{joint}: after removal of its electrode, the activation of a muscle is predicted with R² {own:.2f} by "
            f"the {FILLING_METHODS[way]} and {assisted:.2f} by EMG-assisted muscles"
        )
    if not sentences:
        return (
            f"Activations of {len(recordings)} recordings, without a test: no channel has the name of a muscle that it "
            "drives, or [activations] lost lists all such channels."
        )
    return "; ".join(sentences) + " (median)."


def _verdicts(
    recordings: Sequence[AssistedRecording], left_out: Sequence[tuple[str, FillingScore]]
) -> Iterator[Verdict]:
    """Yield notes on torques, trusts and muscles without EMG, and a warning if static optimisation fails."""
    for joint in dict.fromkeys(each.what for each in recordings):
        own = [each for each in recordings if each.what == joint]
        for of in own[0].torque:
            met = float(np.median([each.assisted[of].r2 for each in own]))
            driven = float(np.median([each.emg_driven[of].r2 for each in own]))
            yield Verdict(
                "note",
                f"{joint if of == joint else f'{joint}, {of}'}: assisted activations reproduce the torque with R² "
                f"{met:.3f}; EMG-driven activations predict it with {driven:.3f}. Assisted activations are computed "
                "from this torque, so that their R² is not a test.",
            )
        if joint in _joints_left_out(left_out):
            median_score = median_scores(left_out, joint, "assisted")[0]
            if median_score < 0.0:
                best = _best_emg_method(left_out, joint)
                yield Verdict(
                    "warning",
                    f"{joint}: static optimisation predicts the activation of a muscle without EMG worse than the "
                    f"muscle's mean (R² {median_score:.2f}). Fill it in with the {FILLING_METHODS[best]}, and do not "
                    "interpret activations from static optimisation.",
                )
        trusts = {(each.trust.trust, each.trust.effort, each.trust.chosen) for each in own}
        for trust, effort, chosen in sorted(trusts):
            how = "chosen within the fitted recordings" if chosen else "given by the study"
            text = f"{joint}: weight of EMG {trust:g}, weight of activation without EMG {effort:g}, {how}."
            yield Verdict("note", text)
        without = sorted({muscle for each in own for muscle in each.filled})
        if without:
            yield Verdict("note", f"{joint}: no EMG of {', '.join(without).replace('_', ' ')}.")


def _table(recordings: Sequence[AssistedRecording]) -> FigureTable:
    """Return the table of torque scores by joint and recording."""
    heads = ("Joint", "Recording", "EMG-driven R²", "assisted R² (told)", "activations moved")
    rows = tuple(
        (joint, e.recording.replace("_", " "), e.emg_driven[joint].r2, e.assisted[joint].r2, e.moved)
        for e in recordings
        for joint in e.torque
    )
    return FigureTable("Torque from EMG-driven and EMG-assisted activations", heads, rows, MAX_BRIEF_ROWS)


def _left_out_tables(left_out: Sequence[tuple[str, FillingScore]]) -> list[FigureTable]:
    """Return a table of median scores by filling method for each joint."""
    made = []
    for joint in _joints_left_out(left_out):
        heads = ("Filled in by", "R²", "correlation", "R² of the torque")
        rows = tuple(
            (FILLING_METHODS[way], *median_scores(left_out, joint, way)) for way in find_scored_methods(left_out, joint)
        )
        title = f"Removed electrode, {joint}: median over electrodes and recordings"
        made.append(FigureTable(title, heads, rows, MAX_BRIEF_ROWS))
    return made


def _rows(
    study: str, recordings: Sequence[AssistedRecording], left_out: Sequence[tuple[str, FillingScore]]
) -> Iterator[ResultRow]:
    """Yield all result rows."""
    checksums = {each.recording: each.checksum for each in recordings}

    def row(name: str, value: float, recording: str, note: str = "") -> ResultRow:
        checksum = checksums.get(recording)
        return ResultRow(f"{study}.{name}", value, "1", "activations", "heldout", checksum, note)

    for each in recordings:
        for joint in each.torque:
            base, told = each.named(joint), "computed from the torque, not a test"
            yield row(f"{base}.emg_driven.r2", each.emg_driven[joint].r2, each.recording)
            yield row(f"{base}.assisted.r2", each.assisted[joint].r2, each.recording, told)
        base = each.named(make_joint_id(each.what))
        yield row(f"{base}.assisted.moved", each.moved, each.recording, "RMS difference of activations from EMG")
    for joint in _joints_left_out(left_out):
        for way in find_scored_methods(left_out, joint):
            base, medians = f"{make_joint_id(joint)}.left_out.{way}", median_scores(left_out, joint, way)
            input_note = "; uses the measured torque" if way in TORQUE_INFORMED_METHODS else ""
            note = f"median over removed electrodes and recordings{input_note}"
            for name, value in zip(("r2", "correlation", "torque.r2"), medians, strict=True):
                if value is not None:
                    yield row(f"{base}.{name}", value, "", note)
    for joint, each in left_out:
        base = f"{make_joint_id(joint)}.{each.recording}.left_out.{each.channel}.{each.way}"
        yield row(f"{base}.r2", each.r2, each.recording)
        yield row(f"{base}.correlation", each.correlation, each.recording)
