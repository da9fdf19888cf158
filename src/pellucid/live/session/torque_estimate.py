"""The torque on the robot, estimated from EMG during a session by the estimator that `calibrate` and robots use.

After each accepted trial, the causal map by ridge regression is fitted again to the session's trials: from envelopes
and the angle to the interaction torque that the robot measures. Its card has the watch of its channels, and
`LiveTorque` steps it. It is a preview; `calibrate` fits and tests the estimator that a robot may use.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf, isfinite

import numpy as np

from ...emg.estimators.emg_session import add_channel_watch
from ...emg.estimators.live_torque import LiveEstimate, LiveTorque
from ...emg.estimators.torque_map import fit_torque_map
from ...emg.estimators.torque_trial import TorqueTrial
from ...emg.models.emg_estimator import ESTIMATOR_FAULTS_BY_NAME, WATCH_DEFAULTS, EmgEstimatorCard
from ...emg.study.emg_torque.estimator_cards import envelope_map_card
from ...numerics.filters import runs

JOINT = "joint"
"""Name of the session's joint in trials and cards."""

PERIOD_S = 0.02
"""Time from one step of the estimator to the next [s]. Its low-pass on the angle needs at least 25 steps a second."""

MAX_AGE_S = 0.25
"""A sample is used for at most this time [s]; steps wait as long for EMG, which comes in batches."""

MAX_GAP_S = 1.0
"""Longest time of missed steps that are made up for [s]."""

MIN_TRIALS = 2
"""Smallest number of trials for an estimate, which needs one to hold out."""

MAX_TRIALS = 12
"""Number of trials, the last ones, that are fitted. It bounds the time of a fit, and electrodes drift."""

MAX_FOLDS = 4
"""Largest number of groups of trials that are held out in turn."""

MAX_ERROR_SHARE = 0.9
"""Largest error in held-out trials of an estimate that is shown, as a share of the mean's error there.

Without a relation to EMG, the chosen penalties make the map nearly the mean, so that chance decides which is better.
"""

MAX_REFUSED_SHARE = 0.1
"""Largest share of the fitted samples for which a watch may refuse a torque. Chosen by judgement."""

UNWATCHED_WORDS = "EMG does not follow the movement in this session, so changes of its channels are not detected"
"""What the page says of an estimate without a watch."""

MIN_PIECE_S = 1.0
"""Shortest part of a trial without a missing sample that is fitted [s]."""


class TorqueSamples:
    """Measurements at the steps of the estimator: at each step, the last ones until then."""

    def __init__(self) -> None:
        self.muscles: tuple[str, ...] = ()
        self._robot, self._emg = np.empty((0, 3)), np.empty((0, 1))
        self._next = 0  # number of the next step since the clock's zero

    def take(self, robot: np.ndarray, emg_time: np.ndarray, envelopes: Mapping[str, np.ndarray]) -> np.ndarray:
        """Take new samples and return the rows of all steps that are complete.

        `robot` has time [s], angle [rad] and torque [N m] in its columns, shape (n, 3); `envelopes` have shape (m,)
        [V]. A row has time, angle, torque and the envelope of each muscle, NaN where a sample is missing.
        """
        if envelopes:
            if tuple(envelopes) != self.muscles:
                self.muscles, self._emg = tuple(envelopes), np.empty((0, 1 + len(envelopes)))
            self._emg = np.vstack([self._emg, np.column_stack([emg_time, *envelopes.values()])])
        self._robot = np.vstack([self._robot, robot])
        if not len(self._robot):
            return np.empty((0, 3 + len(self.muscles)))
        last = self._robot[-1, 0]
        heard = self._emg[-1, 0] if len(self._emg) else -np.inf
        until = int(min(last, max(heard, last - MAX_AGE_S)) / PERIOD_S)
        self._next = max(self._next, until - round(MAX_GAP_S / PERIOD_S))
        times = PERIOD_S * np.arange(self._next, until + 1)
        self._next += len(times)
        rows = np.column_stack([times, _last_values(self._robot, times), _last_values(self._emg, times)])
        self._robot, self._emg = (
            table[max(np.searchsorted(table[:, 0], PERIOD_S * self._next) - 1, 0) :]
            for table in (self._robot, self._emg)
        )
        return rows


def _last_values(table: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the values at `times` of a table with its times in the first column; NaN where the last one is too old."""
    if not len(table):
        return np.full((len(times), table.shape[1] - 1), np.nan)
    index = np.searchsorted(table[:, 0], times, side="right") - 1
    values = table[np.maximum(index, 0), 1:]
    values[(index < 0) | (times - table[np.maximum(index, 0), 0] > MAX_AGE_S)] = np.nan
    return values


@dataclass(frozen=True)
class FittedEstimate:
    """An estimator and its errors in trials that were held out."""

    card: EmgEstimatorCard
    error: float  # RMS error [N*m]
    error_of_mean: float  # RMS error of the other trials' mean there, the simplest baseline [N*m]


@dataclass(frozen=True)
class TorqueEstimate:
    """The torque now."""

    torque: float  # [N*m]
    half_width: float  # half of the 90 % interval [N*m]


class TorqueEstimator:
    """Keeps trials, and steps the estimator that was fitted to them."""

    def __init__(self) -> None:
        self._muscles: tuple[str, ...] = ()
        self._trials: list[list[np.ndarray]] = []
        self._live: LiveTorque | None = None
        self._last: LiveEstimate | None = None
        self.card: EmgEstimatorCard | None = None
        self.error = float("nan")  # RMS error in held-out trials [N*m]
        self.error_of_mean = float("nan")  # RMS error of the other trials' mean there [N*m]

    @property
    def is_useful(self) -> bool:
        """Whether the fit predicts held-out trials clearly better than the other trials' mean does."""
        return self.error < MAX_ERROR_SHARE * self.error_of_mean

    def add_trial(self, muscles: Sequence[str], rows: np.ndarray) -> bool:
        """Keep the rows of a trial; return whether there is something new to fit."""
        # A torque that never changes comes from a robot without a sensor.
        pieces = [piece for piece in _sound_pieces(rows) if np.ptp(piece[:, 2]) > 0.0]
        if not muscles or not pieces or (self._trials and self._muscles != tuple(muscles)):
            return False
        self._muscles = tuple(muscles)
        self._trials = [*self._trials, pieces][-MAX_TRIALS:]
        return len(self._trials) >= MIN_TRIALS

    def session_trials(self) -> tuple[list[TorqueTrial], dict[str, float]]:
        """Return the pieces of all trials, and the largest envelope of each muscle [V], whose shares they hold."""
        top = np.max([piece[:, 3:].max(axis=0) for pieces in self._trials for piece in pieces], axis=0)
        top = np.where(top > 0.0, top, 1.0)
        made = [
            TorqueTrial(
                f"trial {i + 1}, piece {j + 1}", JOINT, piece[:, 0],
                dict(zip(self._muscles, (piece[:, 3:] / top).T, strict=True)), {JOINT: piece[:, 1]}, piece[:, 2],
                group=str(i % MAX_FOLDS),
            )
            for i, pieces in enumerate(self._trials) for j, piece in enumerate(pieces)
        ]  # fmt: skip
        return made, dict(zip(self._muscles, top.tolist(), strict=True))

    def use(self, fitted: FittedEstimate) -> None:
        """Step this estimator from now on."""
        self.card, self.error, self.error_of_mean = fitted.card, fitted.error, fitted.error_of_mean
        self._live = LiveTorque(fitted.card)
        self._last = None

    def estimate(self, muscles: Sequence[str], rows: np.ndarray) -> TorqueEstimate | None:
        """Step through rows and return the torque at the last one.

        It is None before enough trials, where a sample is missing, where a mean does better, or where nothing tells
        which channel is right.
        """
        self._last = None
        if self._live is None or tuple(muscles) != self._muscles:
            return None
        for time, angle, _, *envelopes in rows.tolist():
            self._last = self._live.step(time, dict(zip(muscles, envelopes, strict=True)), {JOINT: angle})
        is_complete = len(rows) > 0 and bool(np.isfinite(np.delete(rows[-1], 2)).all())
        if self._last is None or not self.is_useful or not is_complete:
            return None
        bare = WATCH_DEFAULTS.band_quantile * self.error if self._last.valid else inf
        half_width = self._last.half_width.get(JOINT, bare)
        return TorqueEstimate(self._last.torque[JOINT], half_width) if isfinite(half_width) else None

    @property
    def changed(self) -> tuple[str, ...]:
        """Channels that are unlike those of the fitted trials."""
        return () if self._last is None else self._last.changed

    @property
    def fault(self) -> str:
        """What is wrong with the estimate, in words; empty if nothing is."""
        if self._last is None:
            return ""
        if self._last.valid:
            return UNWATCHED_WORDS if self.card is not None and self.card.watch is None else ""
        return ESTIMATOR_FAULTS_BY_NAME[self._last.fault].words.partition(":")[0]


def fit_estimate(trials: Sequence[TorqueTrial], largest: Mapping[str, float]) -> FittedEstimate:
    """Fit the estimator to trials of shares of the `largest` envelopes, and compute its errors in held-out groups."""
    errors, of_mean = [], []
    for group in dict.fromkeys(trial.group for trial in trials):
        others = [trial for trial in trials if trial.group != group]
        mean = np.concatenate([trial.torque for trial in others]).mean()
        found = fit_torque_map(others, "ridge", causal=True)
        for trial in trials:
            if trial.group == group:
                errors.append(found.predict(trial) - trial.torque)
                of_mean.append(mean - trial.torque)
    error, error_of_mean = (float(np.sqrt(np.mean(np.concatenate(each) ** 2))) for each in (errors, of_mean))
    bare = envelope_map_card("session", "session", fit_torque_map(trials, "ridge", causal=True), trials, largest)
    card = add_channel_watch(bare, {JOINT: trials}, {JOINT: error})
    return FittedEstimate(card if _has_usable_watch(card, trials, largest) else bare, error, error_of_mean)


def _has_usable_watch(card: EmgEstimatorCard, trials: Sequence[TorqueTrial], largest: Mapping[str, float]) -> bool:
    """Return whether a watch lets its card estimate the torque of nearly all fitted samples.

    Where a task changes the effort at one posture, no movement shows what a channel should be.
    """
    if card.watch is None:
        return False
    refused = [
        LiveTorque(card).find_stops(trial.time, {m: largest[m] * x for m, x in trial.envelopes.items()}, trial.angles)
        for trial in trials
    ]
    return bool(np.mean(np.concatenate(refused)) <= MAX_REFUSED_SHARE)


def _sound_pieces(rows: np.ndarray) -> list[np.ndarray]:
    """Return the parts of a trial's rows without a missing sample that are long enough."""
    late = 1 + np.flatnonzero(np.diff(rows[:, 0]) > 1.5 * PERIOD_S)
    pieces = [part[span] for part in np.split(rows, late) for span in runs(np.isfinite(part).all(axis=1))]
    return [piece for piece in pieces if len(piece) * PERIOD_S >= MIN_PIECE_S]
