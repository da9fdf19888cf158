"""Activations of every recording that judges, and what taking each electrode away says of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._atomic import write_text_atomically
from ..._errors import IdentificationError
from ...estimators.cross_validation import Score, score
from ...estimators.hill import HillMap, fit_hill
from ...estimators.muscle_source import ALIASES
from ...estimators.muscle_trials import warm
from ...estimators.torque_trial import TorqueTrial
from ...estimators.unrecorded import (
    TOLD,
    WAYS,
    FilledIn,
    Filling,
    Trust,
    assisted_muscles,
    choose_trust,
    filled_in,
    scale_of,
)
from ...fit.parameter import Verdict
from ...recordings.results import ResultRow
from ...recordings.study import Study
from ..emg_torque.trial_sources import moment_trials
from ..procedure import Progress, quiet
from ..result import FigureTable, Result


@dataclass(frozen=True, eq=False)
class AssistedRecording:
    """What muscles do in one recording."""

    joint: str
    recording: str
    muscles: tuple[str, ...]
    filled: tuple[str, ...]  # Of these, without EMG
    trust: Trust
    emg_driven: Score  # Held out
    assisted: Score  # Told the torque
    moved: float  # RMS by which activations left their EMG
    checksum: str
    time: np.ndarray = field(repr=False)  # time, torque, driven, followed: (n,) [s], [N m]
    torque: np.ndarray = field(repr=False)
    driven: np.ndarray = field(repr=False)
    followed: np.ndarray = field(repr=False)
    by_emg: np.ndarray = field(repr=False)  # by_emg, activation: (m, n)
    activation: np.ndarray = field(repr=False)

    @property
    def file(self) -> str:
        """Its name in ``tables/``."""
        return f"activations_{self.joint}_{self.recording}.csv"


@dataclass(frozen=True, kw_only=True)
class ActivationsResult(Result):
    """What `activations` found."""

    recordings: tuple[AssistedRecording, ...] = field(default=(), repr=False)
    left_out: tuple[tuple[str, FilledIn], ...] = field(default=(), repr=False)  # By joint

    def written(self, study: Study) -> str:
        return f"Activations over time in {study.made / 'tables'}"

    def save_more(self, study: Study) -> None:
        folder = study.place("tables")
        folder.mkdir(parents=True, exist_ok=True)
        for each in self.recordings:
            heads = ["time_s", "torque_Nm", "emg_driven_Nm", "assisted_Nm"]
            heads += [f"{m}_{how}" for how in ("emg", "assisted") for m in each.muscles]
            columns = np.vstack((each.time, each.torque, each.driven, each.followed, each.by_emg, each.activation)).T
            lines = [",".join(heads), *(",".join(f"{x:.6g}" for x in row) for row in columns)]
            write_text_atomically(folder / each.file, "\n".join(lines) + "\n")


def find_activations(study: Study, tell: Progress = quiet) -> ActivationsResult:
    """Activations near EMG with which the torque of each joint follows. `study` [activations]."""
    table, config = study.config.activations, study.config.emg_torque
    if table is None or config is None:
        raise IdentificationError(f"{study.folder}: found no tables [activations] and [emg_torque], expected both")
    recordings, left_out, checksums = [], [], {}
    for i, joint in enumerate(config.joints):
        trials = moment_trials(study, joint)
        checksums |= {trial.name: trial.checksum for trial in trials}
        splits = _splits(study, joint, trials)
        for k, (fitted, judged) in enumerate(splits):
            at = (i + k / len(splits)) / len(config.joints)
            tell(f"{joint}, calibrating muscles", at)
            found = fit_hill(fitted)
            stated = None if table.trust is None else Trust(table.trust, table.effort, chosen=False)
            trust = stated or choose_trust(found, fitted)
            tell(f"{joint}, taking electrodes away", at + 0.3 / len(splits) / len(config.joints))
            judged = [Filling(fitted).without(t, table.lost, table.fill) for t in judged] if table.lost else judged
            recordings += [_assisted(found, fitted, trial, trust, table) for trial in judged]
            left_out += [(joint, each) for each in filled_in(found, fitted, judged, trust, table.lost)]
    return ActivationsResult(
        study=study.name,
        headline=_headline(recordings, left_out),
        tables=(_table(recordings), *_left_out_tables(left_out)),
        verdicts=_verdicts(recordings, left_out),
        rows=tuple(_rows(study.name, recordings, left_out)),
        cards={},
        checksums=checksums,
        recordings=tuple(recordings),
        left_out=tuple(left_out),
    )


def _splits(
    study: Study, joint: str, trials: Sequence[TorqueTrial]
) -> list[tuple[list[TorqueTrial], list[TorqueTrial]]]:
    """What is fitted and what judges: as the study says, or each trial left out in turn where all may be fitted."""
    fitted, judged = [t for t in trials if not t.heldout], [t for t in trials if t.heldout]
    if fitted and judged:
        return [(fitted, judged)]
    if len(fitted) > 1:
        return [([t for t in fitted if t is not out], [replace(out, heldout=True)]) for out in fitted]
    raise IdentificationError(
        f"{study.folder}, joint {joint}: found {len(trials)} recordings with channels moment.{joint} and EMG, "
        f"{len(fitted)} of them to be fitted, expected one to fit and one to judge, or two to leave out in turn"
    )


def _assisted(
    found: HillMap, fitted: Sequence[TorqueTrial], trial: TorqueTrial, trust: Trust, table
) -> AssistedRecording:
    muscles, own = assisted_muscles(found, trial, scale_of(fitted))
    driven = trial.muscles.driven(trial.joint, trial.envelopes)
    channels = {ALIASES.get(name, name) for name in trial.envelopes}
    without = tuple(i for i, name in enumerate(found.muscles) if name not in channels)
    lost = tuple(name for name in found.muscles if set(driven[name]) & set(table.lost))
    static = without if table.unrecorded == "static" else ()
    activation = muscles.assisted(static, trust=trust.trust, effort=trust.effort)
    by_emg, kept = muscles.recorded, slice(warm(trial), None)
    told, followed = found.predict(trial), muscles.torque(activation)[0, own]
    return AssistedRecording(
        trial.joint, trial.name, found.muscles, tuple(dict.fromkeys((*(found.muscles[i] for i in without), *lost))),
        trust, score(trial.torque[kept], told[kept]), score(trial.torque[kept], followed[kept]),
        float(np.sqrt(np.mean((activation - by_emg)[:, own] ** 2))), trial.checksum, trial.time, trial.torque, told,
        followed, by_emg[:, own], activation[:, own],
    )  # fmt: skip


def pooled(left_out: Sequence[tuple[str, FilledIn]], joint: str, way: str) -> tuple[float, float, float | None]:
    """Medians over electrodes and recordings: R2 and correlation of activations, R2 of the torque."""
    own = [each for j, each in left_out if j == joint and each.way == way]
    torque = [each.torque.r2 for each in own if each.torque is not None]
    return (
        float(np.median([each.r2 for each in own])),
        float(np.median([each.correlation for each in own])),
        float(np.median(torque)) if torque else None,
    )


def ways_of(left_out: Sequence[tuple[str, FilledIn]], joint: str) -> list[str]:
    """Ways that were tried at a joint."""
    present = {each.way for j, each in left_out if j == joint}
    return [way for way in WAYS if way in present]


def _best(left_out: Sequence[tuple[str, FilledIn]], joint: str) -> str:
    """Of the ways that are told no torque, the one with the largest median R2."""
    return max((w for w in ways_of(left_out, joint) if w not in TOLD), key=lambda w: pooled(left_out, joint, w)[0])


def _joints(left_out: Sequence[tuple[str, FilledIn]]) -> list[str]:
    return list(dict.fromkeys(joint for joint, _ in left_out))


def _headline(recordings: Sequence[AssistedRecording], left_out: Sequence[tuple[str, FilledIn]]) -> str:
    said = []
    for joint in _joints(left_out):
        way = _best(left_out, joint)
        said.append(
            f"{joint}: a muscle whose electrode was taken away is told with R² {pooled(left_out, joint, way)[0]:.2f} "
            f"by the {WAYS[way]}, {pooled(left_out, joint, 'assisted')[0]:.2f} by what the torque asks for"
        )
    if not said:
        return f"Activations of {len(recordings)} recordings; no electrode could be taken away to judge them."
    return "; ".join(said) + " (median)."


def _verdicts(recordings: Sequence[AssistedRecording], left_out: Sequence[tuple[str, FilledIn]]) -> tuple[Verdict, ...]:
    said = []
    for joint in dict.fromkeys(each.joint for each in recordings):
        own = [each for each in recordings if each.joint == joint]
        met = float(np.median([each.assisted.r2 for each in own]))
        driven = float(np.median([each.emg_driven.r2 for each in own]))
        said.append(
            Verdict(
                "note",
                f"{joint}: assisted activations meet the torque with R² {met:.3f}, EMG-driven ones predict it with "
                f"{driven:.3f}. The first are told it: that is no evidence of them.",
            )
        )
        if joint in _joints(left_out):
            told = pooled(left_out, joint, "assisted")[0]
            if told < 0.0:
                best = _best(left_out, joint)
                said.append(
                    Verdict(
                        "warning",
                        f"{joint}: what the torque asks of a muscle without EMG is further from what it did than its "
                        f"mean is (R² {told:.2f}). Fill it in by the {WAYS[best]}, and do not read activations that "
                        "static optimisation found.",
                    )
                )
        trusts = {(each.trust.trust, each.trust.effort, each.trust.chosen) for each in own}
        for trust, effort, chosen in sorted(trusts):
            how = "chosen within what was fitted" if chosen else "stated"
            said.append(Verdict("note", f"{joint}: trust in EMG {trust:g}, effort without it {effort:g}, {how}."))
        without = sorted({muscle for each in own for muscle in each.filled})
        if without:
            said.append(Verdict("note", f"{joint}: no EMG of {', '.join(without)}."))
    return tuple(said)


def _table(recordings: Sequence[AssistedRecording]) -> FigureTable:
    heads = ("Joint", "Recording", "EMG-driven R²", "assisted R² (told)", "activations moved")
    rows = tuple((e.joint, e.recording, e.emg_driven.r2, e.assisted.r2, e.moved) for e in recordings)
    return FigureTable("Torque by EMG, and by activations that are told it", heads, rows)


def _left_out_tables(left_out: Sequence[tuple[str, FilledIn]]) -> list[FigureTable]:
    made = []
    for joint in _joints(left_out):
        heads = ("Filled in by", "R²", "correlation", "R² of the torque")
        rows = tuple((WAYS[way], *pooled(left_out, joint, way)) for way in ways_of(left_out, joint))
        made.append(FigureTable(f"Electrode taken away, {joint}: median over electrodes and recordings", heads, rows))
    return made


def _rows(
    study: str, recordings: Sequence[AssistedRecording], left_out: Sequence[tuple[str, FilledIn]]
) -> list[ResultRow]:
    made, checksums = [], {each.recording: each.checksum for each in recordings}

    def row(name: str, value: float, split: str, recording: str, note: str = "") -> None:
        checksum = checksums.get(recording)
        made.append(ResultRow(f"{study}.{name}", value, "1", "activations", split, checksum, note))

    for each in recordings:
        base = f"{each.joint}.{each.recording}"
        row(f"{base}.emg_driven.r2", each.emg_driven.r2, "heldout", each.recording)
        row(f"{base}.assisted.r2", each.assisted.r2, "fitted", each.recording, "told the torque: no evidence")
        row(f"{base}.assisted.moved", each.moved, "fitted", each.recording, "RMS by which activations left EMG")
    for joint in _joints(left_out):
        for way in ways_of(left_out, joint):
            r2, together, torque = pooled(left_out, joint, way)
            told = ", told the torque" if way in TOLD else ""
            note = f"median over electrodes taken away and recordings{told}"
            row(f"{joint}.left_out.{way}.r2", r2, "heldout", "", note)
            row(f"{joint}.left_out.{way}.correlation", together, "heldout", "", note)
            if torque is not None:
                row(f"{joint}.left_out.{way}.torque.r2", torque, "heldout", "", note)
    for joint, each in left_out:
        base = f"{joint}.{each.recording}.left_out.{each.channel}.{each.way}"
        row(f"{base}.r2", each.r2, "heldout", each.recording)
        row(f"{base}.correlation", each.correlation, "heldout", each.recording)
    return made
