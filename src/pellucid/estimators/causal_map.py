r"""A joint's torque from raw EMG as it arrives: fitted to recordings here, run sample by sample by the core.

Every channel is band-passed, rectified and low-passed, forwards only, and the torque is linear in these envelopes
:math:`e_m` and in their products with the joint's angle :math:`q`:

.. math::
    \tau = w_{00} + w_{01} q + \sum_m e_m (w_{m0} + w_{m1} q)

A ridge regression finds the weights; repetitions left out choose its penalty. An envelope far outside those that were
seen is no muscle's, and the core then says that EMG is not valid.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from math import nan

import numpy as np

from .. import _core
from .._errors import IdentificationError, PellucidError
from ..models.card import CardParameter
from ..models.parameter_card import ParameterCard
from ..signals.filters import zero_phase_lowpass
from .cross_validation import first_best
from .ridge import Ridge

KIND = "causal_emg_map"
"""Of its card."""

BAND = (30.0, 450.0)
"""Corners of the band-pass before rectification [Hz]."""

MOTION = 6.0
"""Cut-off of the zero-phase low-pass on the angle by which a trial is examined [Hz]."""

SETTLED = 2.0
"""Left out at the start of a trial [s]."""

LOST = 3.0
"""A trial in which the joint ever turns faster was not held, and is left out [rad/s]."""

RATE = 20.0
"""Samples a second that enter the regression: the envelopes have no more."""

PENALTIES = (0.0, 1.0, 10.0, 100.0)
"""Of the ridge regression, among which repetitions left out choose."""

PATIENCE = 400
"""Samples in a row outside floor and ceiling before EMG is not valid."""


@dataclass(frozen=True)
class EmgSettings:
    """Free constants of the chain."""

    # Of the low-pass after rectification, order 2 [Hz]. At 4 Hz it is 56 ms late, as muscles are some 50 ms
    corner: float = 4.0
    ceiling: float = 2.0  # Times the largest envelope of the trials: what is above is no muscle's [1]
    floor: float = 0.2  # Times the smallest: what is below is none either [1]


@dataclass(frozen=True, eq=False)
class EmgTrial:
    """One recording that a map is fitted to."""

    repetition: str  # Trials of one repetition are left out together
    time: np.ndarray  # time, position, torque: (n,) [s], [rad], of the joint [N m]
    position: np.ndarray
    torque: np.ndarray
    emg_time: np.ndarray  # (k,) [s]
    emg: np.ndarray  # (k, muscles) Raw [V]


@dataclass(frozen=True, eq=False)
class CausalMap:
    """A causal chain and an identified map, as the core takes them."""

    fs: float  # Of the EMG [Hz]
    corner: float  # Of the low-pass after rectification [Hz]
    # (muscles + 1, powers) Of the angle's powers: row 0 without EMG [N m/rad^p], then by muscle [N m/(V rad^p)]
    weights: np.ndarray
    floor: np.ndarray  # floor, ceiling: (muscles,) Envelopes outside are no muscle's [V]
    ceiling: np.ndarray
    torque_limit: float  # More than was ever seen is an electrode that comes off [N m]
    rmse: float = nan  # On repetitions that the map was not fitted to [N m]
    muscles: tuple[str, ...] = field(default=())  # Channels, in the order of the samples
    patience: int = PATIENCE  # Samples in a row outside before EMG is not valid

    def parameters(self) -> dict[str, np.ndarray | float | int]:
        """What the core's chain takes, by name: its filters as second-order sections, then weights and limits."""
        band, envelope = _filters(self.fs, self.corner)
        return {
            "band": band,
            "envelope": envelope,
            "weights": self.weights,
            "floor": self.floor,
            "ceiling": self.ceiling,
            "patience": self.patience,
            "torque_limit": self.torque_limit,
        }

    def build(self) -> _core.EmgTorque:
        """The core's chain, at rest."""
        return _core.EmgTorque(**self.parameters())

    def card(self, study: str, name: str, checksums: Mapping[str, str] | None = None, **settings: str) -> ParameterCard:
        """The map as a card that `of_card` reads again."""
        muscles = self.muscles or tuple(f"emg{m}" for m in range(len(self.floor)))
        parameters = [
            CardParameter(_term(muscle, power), _unit(muscle, power), float(w), nan, (nan, nan))
            for muscle, row in zip(("", *muscles), self.weights, strict=True)
            for power, w in enumerate(row)
        ]
        limits = {
            f"{end}.{m}": float(x)
            for end, values in (("floor", self.floor), ("ceiling", self.ceiling))
            for m, x in zip(muscles, values, strict=True)
        }
        chain = {"fs": self.fs, "corner": self.corner, "patience": self.patience, "torque_limit": self.torque_limit}
        low, high = BAND
        return ParameterCard(
            kind=KIND,
            study=study,
            name=name,
            parameters=tuple(parameters),
            settings={"muscles": " ".join(muscles), **chain, "rmse": self.rmse, **limits, **settings},
            processing=f"{low:g} to {high:g} Hz, rectified, {self.corner:g} Hz, order 2 each, forwards only",
            checksums=dict(checksums or {}),
            pellucid=version("pellucid"),
        )

    @classmethod
    def of_card(cls, card: ParameterCard) -> CausalMap:
        """The map of a card."""
        if card.kind != KIND:
            raise PellucidError(f'the card {card.name} is of kind "{card.kind}", expected "{KIND}"')
        settings, values = card.settings, card.values
        try:
            muscles = tuple(str(settings["muscles"]).split())
            powers = len(values) // (1 + len(muscles))
            weights = [[values[_term(muscle, power)] for power in range(powers)] for muscle in ("", *muscles)]
            floor, ceiling = (np.array([settings[f"{end}.{m}"] for m in muscles]) for end in ("floor", "ceiling"))
            rmse = nan if settings["rmse"] is None else settings["rmse"]
            return cls(
                settings["fs"], settings["corner"], np.array(weights), floor, ceiling, settings["torque_limit"], rmse,
                muscles, settings["patience"],
            )  # fmt: skip
        except KeyError as error:
            raise PellucidError(f"the card {card.name}: found no {error}, expected one") from None


def fit_causal_map(
    trials: Sequence[EmgTrial], settings: EmgSettings | None = None, *, muscles: Sequence[str] = ()
) -> CausalMap:
    """Fit a map, linear in envelopes and in envelopes times angle."""
    from scipy.signal import sosfilt

    settings = settings or EmgSettings()
    trials = [t for t in trials if _fastest(t) < LOST]
    if len({t.repetition for t in trials}) < 2:
        raise IdentificationError("causal EMG map: found fewer than two repetitions that were held, expected two")
    fs = _rate(trials[0].emg_time)
    band, envelope = _filters(fs, settings.corner)
    x, y, levels, repetition = [], [], [], []
    for t in trials:
        level = sosfilt(envelope, np.abs(sosfilt(band, t.emg, axis=0)), axis=0)
        level = np.column_stack([np.interp(t.time, t.emg_time, column) for column in level.T])
        own = _rate(t.time)
        kept = slice(round(SETTLED * own), None, max(1, round(own / RATE)))
        q, e = t.position[kept], level[kept]
        x.append(np.column_stack([q, *(column for m in e.T for column in (m, m * q))]))
        y.append(t.torque[kept])
        levels.append(e)
        repetition += [t.repetition] * len(q)
    x, y, seen, group = np.vstack(x), np.concatenate(y), np.vstack(levels), np.array(repetition)

    def left_out(penalty: float) -> float:
        error = [
            y[group == g] - Ridge(penalty).fit(x[group != g], y[group != g]).predict(x[group == g])
            for g in np.unique(group)
        ]
        return float(np.sqrt(np.mean(np.concatenate(error) ** 2)))

    errors = [left_out(penalty) for penalty in PENALTIES]
    best = first_best(errors)
    terms = list(Ridge(PENALTIES[best]).fit(x, y).plain([str(i) for i in range(x.shape[1])]).values())
    return CausalMap(
        fs,
        settings.corner,
        np.array(terms).reshape(1 + seen.shape[1], 2),  # 1 and q; then each envelope, and the same times q
        settings.floor * seen.min(axis=0),
        settings.ceiling * seen.max(axis=0),
        torque_limit=float(np.abs(y).max()),
        rmse=errors[best],
        muscles=tuple(muscles),
    )


def _filters(fs: float, corner: float) -> tuple[np.ndarray, np.ndarray]:
    """Band-pass and low-pass as second-order sections, shape (k, 6) each."""
    from scipy.signal import butter

    return butter(2, BAND, "bandpass", fs=fs, output="sos"), butter(2, corner, fs=fs, output="sos")


def _fastest(trial: EmgTrial) -> float:
    """[rad/s]"""
    fs = _rate(trial.time)
    return float(np.max(np.abs(np.diff(zero_phase_lowpass(trial.position, MOTION, 4, fs)))) * fs)


def _rate(time: np.ndarray) -> float:
    return (len(time) - 1) / float(time[-1] - time[0])


def _term(muscle: str, power: int) -> str:
    factors = [factor for factor in (muscle, *(["angle"] * power)) if factor]
    return " * ".join(factors) or "offset"


def _unit(muscle: str, power: int) -> str:
    below = [*(["V"] if muscle else []), *(["rad"] * power)]
    return "N*m" if not below else f"N*m/({'*'.join(below)})"
