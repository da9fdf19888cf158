"""Result rows of a calibration by their ids."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ....study.results import ResultRow
from ...estimators.emg_session import ChannelComparison
from ...estimators.torque_trial import TorqueTrial
from .evaluation import EstimatorEvaluation, RecommendedEstimator
from .torque_findings import RecordingWorth


def calibration_rows(
    study: str,
    evaluated: Sequence[EstimatorEvaluation],
    trials: Sequence[TorqueTrial],
    sessions: Mapping[str, ChannelComparison] | None = None,
    chosen: Sequence[RecommendedEstimator] = (),
    worth: Sequence[RecordingWorth] = (),
) -> tuple[ResultRow, ...]:
    """Return all result rows. Ids name the recording, except for the first held-out one."""
    sums = {trial.name: trial.checksum for trial in trials}
    first = next((trial.name for trial in trials if trial.heldout), "")
    rows: list[ResultRow] = []

    def add(name: str, value: float, unit: str, note: str, *, split: str = "heldout", recording: str = "") -> None:
        rows.append(ResultRow(f"{study}.{name}", value, unit, "calibrate", split, sums.get(recording), note))

    for each in evaluated:
        how, note = each.estimator + (".causal" if each.causal else ""), each.choice
        if each.kind == "steps":
            add(f"emg.{each.what}.rmse.{how}", each.score.rmse, each.torque_unit, note)
            add(f"emg.{each.what}.r2.{how}", each.score.r2, "1", note)
        elif each.kind == "normalised":
            add(f"{each.what}.{how}.rmse_normalised", each.score.rmse, "1", f"of the leg's own weight; {note}")
            add(f"{each.what}.{how}.r2", each.score.r2, "1", note)
        elif each.kind == "trials":
            add(f"{each.what}.{how}.rmse", each.score.rmse, each.torque_unit, f"mean over trials left out; {note}")
            add(f"{each.what}.{how}.r2", each.score.r2, "1", note)
        else:
            tail = "" if each.recording == first else f".{each.recording}"
            add(f"{each.what}.{how}.r2{tail}", each.score.r2, "1", note, recording=each.recording)
            add(f"{each.what}.{how}.rmse{tail}", each.score.rmse, each.torque_unit, note, recording=each.recording)
            if each.as_recorded is not None:
                words = (
                    f"without rescale, which repairs {', '.join(each.repaired) or 'nothing: its torque hardly changes'}"
                )
                add(
                    f"{each.what}.{how}.r2.as_recorded{tail}", each.as_recorded.r2, "1", words, recording=each.recording
                )
            if each.without_changed is not None:
                words = "channels that changed replaced by what the others tell"
                add(f"{each.what}.{how}.r2.without_changed{tail}", each.without_changed.r2, "1", words,
                    recording=each.recording)  # fmt: skip
            if each.coverage is not None:
                words = "share of samples within the 95 % interval"
                add(f"{each.what}.{how}.coverage{tail}", each.coverage, "1", words, recording=each.recording)
            for name, words, value in zip(
                ("positive", "truncated"),
                ("where the reference pulls along its main direction", "both torques cut off at 0"),
                each.partial,
                strict=False,
            ):
                add(f"{each.what}.{how}.rmse.{name}{tail}", value, each.torque_unit, words, recording=each.recording)
            if not tail:
                if each.examined is not None:
                    words = f"root mean square over tests within what was fitted: {', '.join(each.examined.words)}"
                    add(f"{each.what}.{how}.rmse.tested", each.examined.mean, each.torque_unit, words, split="fitted")
                if each.within is not None:
                    words = "cross-validation within what was fitted"
                    add(f"{each.what}.{how}.r2.cross_validated", each.within.r2, "1", words, split="fitted")
                if each.seconds is not None:
                    words = "one calibration, all starts included"
                    add(f"{each.what}.{how}.seconds", each.seconds, "s", words, split="fitted")
    refused = {name for name, compared in (sessions or {}).items() if not compared.is_valid}
    for named in chosen:
        for judged in named.judged:
            tail = "" if judged.recording in (first, "") else f".{judged.recording}"
            note = f"chosen within what was fitted: {named.words}"
            unit = "1" if judged.kind == "normalised" else judged.torque_unit
            add(f"{named.what}.chosen.rmse{tail}", judged.score.rmse, unit, note, recording=judged.recording)
            add(f"{named.what}.chosen.r2{tail}", judged.score.r2, "1", note, recording=judged.recording)
        if named.fitted_coverage is not None:
            words = "smallest share of fitted trials, left out in turn, within the 90 % band that the others give"
            add(f"{named.what}.chosen.coverage90.fitted", named.fitted_coverage, "1", words, split="fitted")
        for one in named.by_condition():
            tail = f".{one.name}" if named.by or one.name != first else ""
            if named.by:
                add(f"{named.what}.chosen.rmse{tail}", one.score.rmse, unit, f"by {one.estimator}", recording=one.name)
            if one.held is not None:
                words = "share of samples within the 90 % band"
                if one.name in refused:
                    words = "share of samples within a 90 % band that is not stated, since no estimate holds there"
                add(f"{named.what}.chosen.coverage90{tail}", one.held, "1", words, recording=one.name)
    for gained in worth:
        tail, made = "" if gained.recording in (first, "") else f".{gained.recording}", gained.worth
        note = f"R² beyond that of angles alone: {made.answer}, by a margin of {made.margin:g}"
        for end, value in (("", made.gain), (".low", made.low), (".high", made.high)):
            if np.isfinite(value):
                name = f"{gained.what}.gain_over_angles{end}{tail}"
                add(name, value, "1", note if not end else "end of its 95 % interval", recording=gained.recording)
    for recording, compared in (sessions or {}).items():
        at = {"recording": recording}
        add(f"session.{recording}.channels_changed", len(compared.changed), "1", ", ".join(compared.changed), **at)
        add(f"session.{recording}.elsewhere", compared.outside_share, "1", "share of time beyond what was fitted", **at)
        add(f"session.{recording}.holds", float(compared.is_valid), "1", "1: what was fitted may be asked of it", **at)
    return tuple(rows)
