r"""A joint's torque from raw EMG as it arrives: fitted to recordings here, run sample by sample by the core.

Every channel is band-passed, rectified and low-passed, forwards only. The torque is linear in these envelopes
:math:`e_m` and in their products with the joint's angle :math:`q`:

.. math::
    \tau = w_{00} + w_{01} q + \sum_m e_m (w_{m0} + w_{m1} q)

A ridge regression finds the weights; cross-validation chooses its penalty. An envelope far outside the fitted range
cannot come from a muscle. The core then reports that EMG is not valid.

Period of a movement that repeats, such as a stride or a lift, from the autocorrelation of a signal of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib.metadata import version
from math import nan
from typing import Any

import numpy as np

from ... import _core
from ..._errors import IdentificationError, PellucidError
from ...models.card import CardParameter
from ...models.parameter_card import ParameterCard
from ...numerics.filters import zero_phase_lowpass
from .cross_validation import first_best

CARD_KIND = "causal_emg_map"
"""Kind of the parameter card that holds a causal map."""


@dataclass(frozen=True)
class CausalMapSettings:
    """How a causal map is fitted, and where its EMG is no muscle's.

    No measurement is recorded for what is chosen by judgement.
    """

    # Corner frequencies of the band-pass before rectification [Hz]. Chosen by judgement.
    band_hz: tuple[float, float] = (30.0, 450.0)
    # Cut-off of the zero-phase low-pass on the angle, before a trial's fastest motion is determined [Hz]. Chosen by
    # judgement.
    angle_lowpass_hz: float = 6.0
    settling_s: float = 2.0  # Duration that is left out at the start of a trial [s], until the filters have settled
    # A trial is left out if its joint ever turns faster than this [rad/s]: the joint was then not held. Chosen by
    # judgement.
    max_joint_speed_rad_s: float = 3.0
    rate_hz: float = 20.0  # Rate at which samples enter the regression [Hz]. Envelopes hold nothing faster.
    # Candidate penalties of the ridge regression. Repetitions left out choose among them.
    penalties: tuple[float, ...] = (0.0, 1.0, 10.0, 100.0)
    # EMG is declared invalid after this many samples in a row outside floor and ceiling. Chosen by judgement.
    patience_samples: int = 400


CAUSAL_FIT = CausalMapSettings()

@dataclass(frozen=True)
class EmgSettings:
    """Free constants of the chain."""

    # Cut-off of the low-pass after rectification, order 2 [Hz]. At 4 Hz it is 56 ms late; muscles are some 50 ms late
    corner: float = 4.0
    ceiling: float = 2.0  # Largest valid envelope, as a multiple of the largest one in the trials [1]
    floor: float = 0.2  # Smallest valid envelope, as a multiple of the smallest one in the trials [1]


@dataclass(frozen=True, eq=False)
class EmgTrial:
    """One recording that a causal map is fitted to."""

    repetition: str  # Repetition of the trial; all its trials are left out together
    time: np.ndarray  # Time of the motion, shape (n,) [s]
    position: np.ndarray  # Angle of the joint, shape (n,) [rad]
    torque: np.ndarray  # Torque of the joint, shape (n,) [N m]
    emg_time: np.ndarray  # Time of the EMG, shape (k,) [s]
    emg: np.ndarray  # Raw EMG, shape (k, muscles) [V]


@dataclass(frozen=True, eq=False)
class CausalMap:
    """A causal filter chain and an identified map, as the core takes them."""

    fs: float  # Sampling rate of the EMG [Hz]
    corner: float  # Cut-off of the low-pass after rectification [Hz]
    # Weights of the angle's powers, shape (muscles + 1, powers). Row 0 is without EMG [N m/rad^p]; the others are by
    # muscle [N m/(V rad^p)]
    weights: np.ndarray
    floor: np.ndarray  # Smallest valid envelope of each muscle, shape (muscles,) [V]
    ceiling: np.ndarray  # Largest valid envelope of each muscle, shape (muscles,) [V]
    torque_limit: float  # Largest torque of the fitted trials [N m]; a larger one means that an electrode came off
    rmse: float = nan  # RMSE on repetitions that the map was not fitted to [N m]
    muscles: tuple[str, ...] = field(default=())  # Names of the channels, in the order of the samples
    # Number of samples in a row outside floor and ceiling before EMG is invalid
    patience: int = CAUSAL_FIT.patience_samples

    def parameters(self) -> dict[str, Any]:
        """Return the arguments of the core's chain by name.

        They are its band-pass and its low-pass as second-order sections, shape (k, 6) each, weights and limits.
        """
        band, envelope = _design_filters(self.fs, self.corner)
        own = {name: getattr(self, name) for name in ("weights", "floor", "ceiling", "patience", "torque_limit")}
        return {"band": band, "envelope": envelope, **own}

    def build(self) -> _core.EmgTorque:
        """Build the core's chain, at rest."""
        return _core.EmgTorque(**self.parameters())

    def card(self, study: str, name: str, checksums: Mapping[str, str] | None = None, **settings: str) -> ParameterCard:
        """Return the map as a parameter card, which `from_card` reads again."""
        muscles = self.muscles or tuple(f"emg{m}" for m in range(len(self.floor)))
        parameters = [
            CardParameter(_weight_name(muscle, power), _weight_unit(muscle, power), float(w), nan, (nan, nan))
            for muscle, row in zip(("", *muscles), self.weights, strict=True)
            for power, w in enumerate(row)
        ]
        limits = {
            f"{end}.{m}": float(x)
            for end, values in (("floor", self.floor), ("ceiling", self.ceiling))
            for m, x in zip(muscles, values, strict=True)
        }
        chain = {"fs": self.fs, "corner": self.corner, "patience": self.patience, "torque_limit": self.torque_limit}
        low, high = CAUSAL_FIT.band_hz
        return ParameterCard(
            kind=CARD_KIND,
            study=study,
            name=name,
            parameters=tuple(parameters),
            settings={"muscles": " ".join(muscles), **chain, "rmse": self.rmse, **limits, **settings},
            processing=f"{low:g} to {high:g} Hz, rectified, {self.corner:g} Hz, order 2 each, forwards only",
            checksums=dict(checksums or {}),
            pellucid=version("pellucid"),
        )

    @classmethod
    def from_card(cls, card: ParameterCard) -> CausalMap:
        """Return the map that a parameter card holds."""
        if card.kind != CARD_KIND:
            raise PellucidError(f'the card {card.name} is of kind "{card.kind}", expected "{CARD_KIND}"')
        settings, values = card.settings, card.values
        try:
            muscles = tuple(str(settings["muscles"]).split())
            powers = len(values) // (1 + len(muscles))
            weights = [[values[_weight_name(muscle, power)] for power in range(powers)] for muscle in ("", *muscles)]
            floor, ceiling = (
                np.array([_number_setting(card, f"{end}.{m}") for m in muscles]) for end in ("floor", "ceiling")
            )
            return cls(
                fs=_number_setting(card, "fs"),
                corner=_number_setting(card, "corner"),
                weights=np.array(weights),
                floor=floor,
                ceiling=ceiling,
                torque_limit=_number_setting(card, "torque_limit"),
                rmse=nan if settings["rmse"] is None else _number_setting(card, "rmse"),
                muscles=muscles,
                patience=int(_number_setting(card, "patience")),
            )
        except KeyError as error:
            raise PellucidError(f"the card {card.name}: found no {error}, expected one") from None


def _number_setting(card: ParameterCard, name: str) -> float:
    """Return a number among the settings of a card; refuse a text in its place."""
    value = card.settings[name]
    if isinstance(value, str):
        raise PellucidError(f"the card {card.name}, {name}: found {value!r}, expected a number")
    return value


def fit_causal_map(
    trials: Sequence[EmgTrial], settings: EmgSettings | None = None, *, muscles: Sequence[str] = ()
) -> CausalMap:
    """Fit a causal map, linear in envelopes and in envelopes times angle."""
    from scipy.signal import sosfilt

    from .ridge import Ridge

    settings = settings or EmgSettings()
    trials = [t for t in trials if _max_speed(t) < CAUSAL_FIT.max_joint_speed_rad_s]
    if len({t.repetition for t in trials}) < 2:
        raise IdentificationError("causal EMG map: found fewer than two repetitions that were held, expected two")
    fs = _sampling_rate(trials[0].emg_time)
    band, envelope = _design_filters(fs, settings.corner)
    rows, torques, levels, repetition = [], [], [], []
    for t in trials:
        level = sosfilt(envelope, np.abs(sosfilt(band, t.emg, axis=0)), axis=0)
        level = np.column_stack([np.interp(t.time, t.emg_time, column) for column in level.T])
        own = _sampling_rate(t.time)
        kept = slice(round(CAUSAL_FIT.settling_s * own), None, max(1, round(own / CAUSAL_FIT.rate_hz)))
        q, e = t.position[kept], level[kept]
        rows.append(np.column_stack([q, *(column for m in e.T for column in (m, m * q))]))
        torques.append(t.torque[kept])
        levels.append(e)
        repetition += [t.repetition] * len(q)
    x, y, seen, group = np.vstack(rows), np.concatenate(torques), np.vstack(levels), np.array(repetition)

    def left_out(penalty: float) -> float:
        error = [
            y[group == g] - Ridge(penalty).fit(x[group != g], y[group != g]).predict(x[group == g])
            for g in np.unique(group)
        ]
        return float(np.sqrt(np.mean(np.concatenate(error) ** 2)))

    errors = [left_out(penalty) for penalty in CAUSAL_FIT.penalties]
    best = first_best(errors)
    fitted = Ridge(CAUSAL_FIT.penalties[best]).fit(x, y)
    terms = list(fitted.unscaled_coefficients([str(i) for i in range(x.shape[1])]).values())
    return CausalMap(
        fs,
        settings.corner,
        np.array(terms).reshape(1 + seen.shape[1], 2),  # Columns: the term alone, and times q. Row 0 is without EMG
        settings.floor * seen.min(axis=0),
        settings.ceiling * seen.max(axis=0),
        torque_limit=float(np.abs(y).max()),
        rmse=errors[best],
        muscles=tuple(muscles),
    )


def _design_filters(fs: float, corner: float) -> tuple[np.ndarray, np.ndarray]:
    """Return band-pass and low-pass as second-order sections, shape (k, 6) each."""
    from scipy.signal import butter

    return butter(2, CAUSAL_FIT.band_hz, "bandpass", fs=fs, output="sos"), butter(2, corner, fs=fs, output="sos")


def _max_speed(trial: EmgTrial) -> float:
    """Return the largest speed of a trial's joint, low-passed [rad/s]."""
    fs = _sampling_rate(trial.time)
    return float(np.max(np.abs(np.diff(zero_phase_lowpass(trial.position, CAUSAL_FIT.angle_lowpass_hz, 4, fs)))) * fs)


def _sampling_rate(time: np.ndarray) -> float:
    """Return the sampling rate of times [Hz]."""
    return (len(time) - 1) / float(time[-1] - time[0])


def _weight_name(muscle: str, power: int) -> str:
    """Return the name of a weight: the muscle, if any, times the angle if its `power` is above 0."""
    factors = [factor for factor in (muscle, *(["angle"] * power)) if factor]
    return " * ".join(factors) or "offset"


def _weight_unit(muscle: str, power: int) -> str:
    """Return the unit of a weight."""
    below = [*(["V"] if muscle else []), *(["rad"] * power)]
    return "N*m" if not below else f"N*m/({'*'.join(below)})"


@dataclass(frozen=True)
class StrideSearch:
    """When a signal counts as periodic.

    No measurement is recorded for what is chosen by judgement.
    """

    min_period_s: float = 0.4  # Shortest period of a movement that is looked for [s]. Chosen by judgement.
    min_count: int = 4  # Smallest number of periods that a signal must hold. Chosen by judgement.
    # A signal counts as periodic if its autocorrelation reaches at least this value at the period. Chosen by judgement.
    min_autocorrelation: float = 0.5


STRIDE_SEARCH = StrideSearch()


def find_period(signal: np.ndarray, fs: float) -> int:
    """Return the period of a signal, shape (n,) at `fs` [Hz], in samples; 0 if it does not repeat often enough."""
    n = len(signal)
    r = np.fft.irfft(np.abs(np.fft.rfft(signal - signal.mean(), 2 * n)) ** 2)[:n] / np.arange(n, 0, -1)
    first, last = round(STRIDE_SEARCH.min_period_s * fs), n // STRIDE_SEARCH.min_count
    period = first + int(np.argmax(r[first:last])) if last > first else 0
    return period if period and r[period] >= STRIDE_SEARCH.min_autocorrelation * r[0] else 0
