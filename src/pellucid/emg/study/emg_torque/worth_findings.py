"""Say for each joint and recording whether EMG is worth it over joint angles alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....study.procedures.result import FigureTable
from ...estimators.emg_worth import MIN_TRIALS_FOR_INTERVAL, EmgWorth, worth_on_recording, worth_over_trials
from .chosen import BASELINE_ESTIMATOR, RecommendedEstimator
from .evaluated import TorqueTrace

MAX_BRIEF_WORTH_ROWS = 6
"""Largest number of joints and recordings in the table on a terminal without ``-v``."""

TOO_FEW_TRIALS_SENTENCE = (
    f"Fewer than {MIN_TRIALS_FOR_INTERVAL} trials are left to fit: too few to say whether EMG is worth it. "
)
"""Sentence before the figures of maps that were fitted to too few of the study's trials."""


@dataclass(frozen=True)
class RecordingWorth:
    """What EMG is worth for one joint or person, on one recording or over all trials left out in turn."""

    what: str  # Joint or participant
    recording: str  # Recording that was not fitted; "" for all trials left out in turn
    worth: EmgWorth

    @property
    def words(self) -> str:
        """Joint or participant, and the recording or the number of trials, in words."""
        return f"{self.what}, {self.recording.replace('_', ' ') or f'{self.worth.blocks} trials'}"


def find_worth(
    chosen: Sequence[RecommendedEstimator],
    traces: Sequence[TorqueTrace],
    margin: float,
    recordings: Mapping[str, str],
    *,
    is_founded: bool = True,
) -> tuple[RecordingWorth, ...]:
    """Return the gain of every recommended estimator over angles alone; no answer of it if that is not `is_founded`.

    A recording's answer uses the predictions on that recording and nothing else. `traces` holds the predictions on
    every test recording on which estimates are valid, `recordings` the recording's name of each trial: pieces of one
    recording are no independent trials.
    """
    found, made = [], {(trace.what, trace.recording): trace for trace in traces}
    for each in chosen:
        if each.by:
            scores = [one for one in each.by_condition() if one.bare is not None]
            if scores:
                pieces: dict[str, list[tuple[float, float]]] = {}
                for one in scores:
                    pair = (one.score.r2, one.bare.r2 if one.bare else np.nan)
                    pieces.setdefault(recordings.get(one.name, one.name), []).append(pair)
                means = np.array([np.mean(pairs, axis=0) for pairs in pieces.values()])
                worth = worth_over_trials(means[:, 0].tolist(), means[:, 1].tolist(), margin)
                found.append(RecordingWorth(each.what, "", worth))
            continue
        for judged in each.judged:
            trace = made.get((each.what, judged.recording))
            if trace is not None and BASELINE_ESTIMATOR in trace.predicted:
                predicted = trace.predicted[judged.estimator], trace.predicted[BASELINE_ESTIMATOR]
                fs = (len(trace.time) - 1) / float(trace.time[-1] - trace.time[0])
                worth = worth_on_recording(trace.reference, *predicted, fs, margin)
                found.append(RecordingWorth(each.what, judged.recording, worth))
    return tuple(replace(each, worth=replace(each.worth, is_founded=is_founded)) for each in found)


def is_answer_founded(fitted: int, lost: int) -> bool:
    """Return whether `fitted` trials suffice to answer whether EMG is worth it, where `lost` ones were not used.

    A study whose trials are all used answers for the trials that it planned. Where some were lost, the ones that are
    left must be as many as an interval over trials requires.
    """
    return not lost or fitted >= MIN_TRIALS_FOR_INTERVAL


def _signed(value: float) -> str:
    """Return a gain with its sign."""
    return f"{value:+.2f}"


def worth_sentence(worth: Sequence[RecordingWorth]) -> str:
    """Return the first sentence of the headline: for which joints and recordings EMG is worth it; empty without any."""
    if not worth:
        return ""
    by_answer: dict[str, list[str]] = {}
    for each in worth:
        where = f" on {each.recording.replace('_', ' ')}" if each.recording else ""
        made = each.worth
        figure = f"{'' if by_answer else 'gain in '}R² {_signed(made.gain)}"
        if np.isfinite(made.low):
            level = "" if by_answer else "95 % interval "
            figure += f", {level}{_signed(made.low)} to {_signed(made.high)}"
        by_answer.setdefault(made.answer, []).append(f"{each.what}{where} ({figure})")
    words = {
        "worth it": "EMG is worth it over angles alone for",
        "not worth it": "EMG is not worth it over angles alone for",
        "cannot say": "Whether EMG is worth it cannot be said for",
    }
    few = "" if all(each.worth.is_founded for each in worth) else TOO_FEW_TRIALS_SENTENCE
    return few + "".join(f"{words[answer]} {_list_with_end(parts)}. " for answer, parts in by_answer.items())


def _list_with_end(parts: Sequence[str], most: int = 3) -> str:
    """Return the first parts in words, and how many more there are."""
    more = f" and {len(parts) - most} more" if len(parts) > most else ""
    return ", ".join(parts[:most]) + more


def worth_tables(worth: Sequence[RecordingWorth]) -> tuple[FigureTable, ...]:
    """Return the table of what EMG is worth, the first of a calibration."""
    if not worth:
        return ()
    rows = tuple(
        (
            each.words,
            each.worth.gain,
            None if not np.isfinite(each.worth.low) else f"{_signed(each.worth.low)} to {_signed(each.worth.high)}",
            each.worth.answer,
        )
        for each in worth
    )
    heads = ("Judged on", "Gain in R²", "95 % interval", f"EMG, by a margin of {worth[0].worth.margin:g}")
    return (FigureTable("What EMG is worth over angles alone", heads, rows, MAX_BRIEF_WORTH_ROWS),)
