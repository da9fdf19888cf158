"""A calibrated estimator of torque as a card: channels, muscles or a map, joints, and all that stepping it needs.

The core steps it (``include/pellucid/emg_estimator.hpp``): live from Python, in batches and off the PC, always the same
code.

Catalogue of the faults that a live estimator of torque reports: words, and whether the estimate is still good.

The core's ``emg_estimator.hpp`` has their names and their order, from the least to the gravest.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from math import inf
from pathlib import Path

import numpy as np

from ... import _core
from ..._atomic import write_text_atomically
from ..._errors import PellucidError
from ...models.card import CARD_FORMAT, CardParameter, read_table
from ...models.card_schema import MAX_CARD_NUMBER, fields_of, require_between, require_sound
from ...models.fields import model_fields
from ...numerics.low_pass import butterworth
from .hill import MUSCLE_QUANTITIES
from .muscle_geometry import MuscleSurface

KIND = "emg_estimator"


@dataclass(frozen=True)
class WatchDefaults:
    """Defaults of an estimator that waits for samples, and of the watch of its channels."""

    patience_s: float = 0.05  # A channel or an angle keeps its last value for this time before it counts as lost [s]
    # Time constant of the watch's means [s]: a stride of walking. After 2 s they hold 0.86 of a change.
    memory_s: float = 1.0
    # Share of the torque's variance that a changed channel may cost a torque. It was chosen by its consequence: half of
    # the loss of 0.2 in R² that a wearer should never meet.
    max_loss: float = 0.1
    # Share of the torque's variance above which a running estimator adds up evidence of a channel's change. It is a
    # fifth of `max_loss`, so that a change which costs `max_loss` is named within 2 s although it enters the means
    # slowly and a muscle may be silent in half of the time.
    named_loss: float = 0.02
    # Smallest share of the torque's variance that counts as unexplained. An estimator that fits its recordings exactly
    # is otherwise distrusted for what hardly costs it anything.
    min_residual: float = 0.04
    # Factor by which all envelopes together may change, up or down, beyond what the fitted recordings show.
    max_common_change: float = 3.0
    band_quantile: float = 1.645  # Half width of a 90 % interval in standard deviations


WATCH_DEFAULTS = WatchDefaults()


@dataclass(frozen=True)
class ShortRangeStiffness:
    """Short-range stiffness of a fibre, and the strain of the tendon in series with it."""

    # Short-range stiffness of a fibre, in its force over l_o: one number for six muscles of cats (Cui et al. 2008).
    stiffness: float = 23.4
    # Standard error of that stiffness as a share of it. Single muscles lie within 30 % (Cui et al. 2008).
    error_share: float = 0.15
    tendon_strain: float = 0.033  # Strain of a tendon under the force F_0 [1]


SHORT_RANGE = ShortRangeStiffness()



@dataclass(frozen=True)
class EstimatorChannel:
    """One channel of EMG."""

    name: str
    scale: float  # scale of the envelope that the chain makes, or that is given
    rest: float  # Envelope of a channel that is lost
    ceiling: float  # Above it no muscle's, cut off there


@dataclass(frozen=True)
class EstimatorMuscle:
    """One muscle."""

    name: str
    numbers: Mapping[str, float]  # value of each of `MUSCLE_QUANTITIES`, SI
    shares: Mapping[str, float]  # share of each channel's envelope in the muscle's excitation
    surface: MuscleSurface


@dataclass(frozen=True)
class EstimatorTerm:
    """Weight times one feature or two, by their names; times none: an offset."""

    weight: float
    first: str = ""
    second: str = ""


@dataclass(frozen=True)
class EstimatorJoint:
    """A joint and its own tissue: offset - stiffness q - damping dq/dt."""

    name: str
    offset: float  # [N m]
    stiffness: float  # [N m/rad]
    damping: float  # [N m s/rad]
    limit: float  # largest |torque| [N m]
    terms: tuple[EstimatorTerm, ...] = ()


@dataclass(frozen=True)
class WatchedChannel:
    """A channel as it was in the calibration; the core's `WatchedChannelParams`."""

    consequence: float  # Share of the torque's variance by squared error of the envelope
    usual: float  # Largest mean square error of its pattern in the fitted recordings
    square: float  # Mean square of the envelope
    product: float  # Mean product of envelope and pattern
    pattern_square: float  # Mean square of the pattern
    pattern: tuple[EstimatorTerm, ...]  # Envelope by angles and their rates
    margin: float = 0.0  # Mean square error by which other recordings may exceed it by chance
    floor: float = 0.0  # Envelope below which the channel gives no signal
    floor_seconds: float = 0.0  # Time below it that is a change [s]; 0: none is
    idle: float = 0.0  # Envelope below which its muscle is not active
    idle_seconds: float = 0.0  # Time below it that is a change [s]; 0: none is

    @property
    def numbers(self) -> tuple[float, ...]:
        """Numbers of the core's `WatchedChannelParams`, in its order."""
        return tuple(getattr(self, one.name) for one in model_fields("watched_channel"))


@dataclass(frozen=True)
class WatchedAngle:
    """Range of an angle in the calibration, with a margin."""

    low: float  # [rad]
    high: float  # [rad]
    slowest: float  # [rad/s]
    fastest: float  # [rad/s]


@dataclass(frozen=True)
class EstimatorWatch:
    """Reference values with which an estimator's channels and angles are compared while it runs."""

    channels: tuple[WatchedChannel, ...]  # In the order of the card's channels
    angles: tuple[WatchedAngle, ...]  # In the order of the card's angles
    seconds: float = WATCH_DEFAULTS.memory_s  # Time constant of its means [s]
    max_loss: float = WATCH_DEFAULTS.named_loss  # Share of the torque's variance at which a channel has changed
    # Share of the torque's variance that the calibration leaves unexplained, of the joint that is best; 0: not known
    residual: float = 0.0
    # RMSE of each joint's torque in cross-validation [N m]; empty: not known
    errors: tuple[float, ...] = ()
    # Common scale of all envelopes below and above which no torque holds
    common_low: float = 1.0 / WATCH_DEFAULTS.max_common_change
    common_high: float = WATCH_DEFAULTS.max_common_change
    # Pairs of channels whose exchange costs torque and is not detected: the movement hardly tells them apart
    alike: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class EmgEstimatorCard:
    """Everything that stepping an estimator needs."""

    study: str
    name: str
    channels: tuple[EstimatorChannel, ...]
    angles: tuple[str, ...]  # Joints whose angles it needs
    muscles: tuple[EstimatorMuscle, ...]
    joints: tuple[EstimatorJoint, ...]
    period: float  # From one step to the next [s]
    motion_lowpass: float  # On angles before they are differentiated, order 2 [Hz]
    lags: tuple[float, ...] = ()  # How much earlier a map sees envelopes too [s]
    patience: float = WATCH_DEFAULTS.patience_s  # [s]
    chain: str = "none"  # From raw EMG to the envelope; none: envelopes are given
    emg_rate: float = 0.0  # sampling rate of raw EMG [Hz]
    before: tuple[tuple[float, ...], ...] = ()  # before, after: Second-order sections of the chain at this rate
    after: tuple[tuple[float, ...], ...] = ()
    watch: EstimatorWatch | None = None  # What its channels are held against; None: they are not watched
    # RMSE of the torque in cross-validation within the fitted recordings [N m]; None: not known
    cross_validated_rmse: float | None = None
    gamma: float = SHORT_RANGE.stiffness
    tendon_strain: float = SHORT_RANGE.tendon_strain
    notes: tuple[str, ...] = ()
    checksums: Mapping[str, str] = field(default_factory=dict)
    pellucid: str = ""
    made_from: Mapping[str, str] = field(default_factory=dict)  # Checksums of what it was made from, by name
    kind: str = KIND
    parameters: tuple[CardParameter, ...] = ()
    covariance: tuple[tuple[float, ...], ...] = ()
    confidence: float = 0.95
    format: int = CARD_FORMAT

    def write(self, path: Path) -> Path:
        """Write the card as JSON, atomically."""
        return write_estimator_card(path, self)

    @property
    def features(self) -> tuple[str, ...]:
        """Names of what a map may multiply, in the core's order."""
        lags = ("", *(f" {1e3 * lag:.0f} ms ago" for lag in self.lags))
        return (
            *(f"emg.{channel.name}{lag}" for channel in self.channels for lag in lags),
            *(f"{what}.{angle}" for angle in self.angles for what in ("angle", "velocity", "acceleration")),
        )

    def of_envelopes(self) -> EmgEstimatorCard:
        """Return the card that is stepped with envelopes as trials hold them: made and scaled already."""
        return replace(self, chain="none", channels=tuple(replace(each, scale=1.0) for each in self.channels))

    def at(self, period: float | None) -> float:
        """The period to step at, its own where none is given [s]."""
        return self.period if period is None else period

    def periods(self, seconds: float, period: float | None = None) -> int:
        """Whole periods nearest to a time [s]."""
        return round(seconds / self.at(period))

    def arrays(self, period: float | None = None) -> dict:
        """Arguments of the core's estimator, by name."""
        names, step, count = [channel.name for channel in self.channels], self.at(period), len(MUSCLE_QUANTITIES)
        known = {name: i for i, name in enumerate(self.features)} | {"": -1}
        return {
            "channels": np.array([(c.scale, c.rest, c.ceiling) for c in self.channels]).reshape(-1, 3),
            "angles": len(self.angles),
            "muscles": np.array([[m.numbers[q] for q in MUSCLE_QUANTITIES] for m in self.muscles]).reshape(-1, count),
            "shares": np.array([[m.shares.get(n, 0.0) for n in names] for m in self.muscles]).reshape(-1, len(names)),
            "axes": np.array([m.surface.rows(self.angles) for m in self.muscles]).reshape(-1, 2, 6),
            "surfaces": [np.array(m.surface.coefficients) for m in self.muscles],
            "joints": [(self.angles.index(j.name), j.offset, j.stiffness, j.damping, j.limit) for j in self.joints],
            "terms": [[(t.weight, known[t.first], known[t.second]) for t in j.terms] for j in self.joints],
            "lags": [self.periods(lag, step) for lag in self.lags],
            "motion": butterworth(2, 2.0 * self.motion_lowpass * step),
            "before": np.array(self.before).reshape(-1, 6) if self.chain != "none" else None,
            "after": np.array(self.after).reshape(-1, 6) if self.chain != "none" else None,
            "gamma": self.gamma,
            "tendon_strain": self.tendon_strain,
            "period": step,
            "patience": max(1, self.periods(self.patience, step)),
            **self._watch_arrays(known, step),
        }

    def _watch_arrays(self, known: Mapping[str, int], step: float) -> dict:
        """What the core's module takes of the watch, by name; empty without one."""
        if self.watch is None:
            return {}
        channels = self.watch.channels
        return {
            "watch": np.array([c.numbers for c in channels]),
            "patterns": [[(t.weight, known[t.first], known[t.second]) for t in c.pattern] for c in channels],
            "ranges": np.array([(a.low, a.high, a.slowest, a.fastest) for a in self.watch.angles]),
            "forgetting": min(1.0, step / self.watch.seconds),
            "max_loss": self.watch.max_loss,
            "residual": self.watch.residual,
            "common": (self.watch.common_low, self.watch.common_high),
        }

    @property
    def misfit(self) -> str:
        """Why the core cannot step the estimator; "" if it can."""
        try:
            _core.EmgEstimator(**self.arrays())
        except ValueError as error:
            return str(error)
        return ""

    def build(
        self, period: float | None = None, *, single: bool = False
    ) -> _core.EmgEstimator | _core.EmgEstimatorFloat:
        """The core's estimator, at rest; `single` in float, as a microcontroller has it."""
        try:
            return (_core.EmgEstimatorFloat if single else _core.EmgEstimator)(**self.arrays(period))
        except ValueError as error:
            raise PellucidError(f"card {self.name}: no estimator that can be stepped: {error}") from None


def write_estimator_card(path: Path, card: EmgEstimatorCard) -> Path:
    """Write a card as JSON, atomically; a list of numbers stays on its line."""
    table = asdict(card)
    surfaces = [m["surface"].pop("coefficients") for m in table["muscles"]]
    text = json.dumps(table, indent=1, ensure_ascii=False, allow_nan=False)
    parts = text.split('"surface": {')
    made = [
        f'"coefficients": {json.dumps(c)},'.join(('"surface": {\n    ', p))
        for c, p in zip(surfaces, parts[1:], strict=True)
    ]
    return write_text_atomically(path, "".join((parts[0], *made)) + "\n")


def read_estimator_card(path: Path) -> EmgEstimatorCard:
    """Read a card again."""
    table = read_table(path)
    if table.get("kind") != KIND:
        raise PellucidError(
            f"{path}: not the card of an estimator of torque from EMG, expected one that calibrate writes"
        )
    try:
        card = EmgEstimatorCard(**fields_of(EmgEstimatorCard, table))
        _require_estimator(card)
    except ValueError as error:
        raise PellucidError(f"{path}: not a card that can be used: {error}") from None
    require_sound(path, card)
    return card


def _require_estimator(card: EmgEstimatorCard) -> None:
    """ValueError where parts of a card do not fit each other."""
    require_between("period", card.period, 1e-5, 1.0)
    require_between("motion_lowpass", card.motion_lowpass, 1e-3, 0.499 / card.period)
    names, angles = [c.name for c in card.channels], set(card.angles)
    for kind, all_of in (("channels", names), ("angles", card.angles), ("muscles", [m.name for m in card.muscles])):
        if len(set(all_of)) != len(all_of):
            raise ValueError(f"{kind}: found a name twice, expected each once")
    for m in card.muscles:
        if set(m.numbers) != set(MUSCLE_QUANTITIES) or not set(m.shares) <= set(names):
            raise ValueError(
                f"{m.name}: found other numbers or channels, expected {', '.join((*MUSCLE_QUANTITIES, *names))}"
            )
        if {a.angle for a in m.surface.axes} - angles - {""}:
            raise ValueError(f"{m.name}: found a surface over other angles, expected {', '.join(card.angles)}")
        for x in m.surface.coefficients:
            require_between(f"{m.name}, surface", x, -MAX_CARD_NUMBER, MAX_CARD_NUMBER)
    if card.cross_validated_rmse is not None:
        require_between("cross_validated_rmse", card.cross_validated_rmse, 0.0, MAX_CARD_NUMBER)
    if card.watch is not None:
        found = (len(card.watch.channels), len(card.watch.angles))
        if found != (len(names), len(card.angles)):
            raise ValueError(f"watch: found {found[0]} channels and {found[1]} angles, expected those of the card")
        require_between("watch, seconds", card.watch.seconds, card.period, 1e4)
        require_between("watch, max_loss", card.watch.max_loss, 1e-6, 1e6)
        require_between("watch, residual", card.watch.residual, 0.0, 1e6)
        require_between("watch, common_low", card.watch.common_low, 1e-6, card.watch.common_high)
        require_between("watch, common_high", card.watch.common_high, card.watch.common_low, 1e6)
        if {name for pair in card.watch.alike for name in pair} - set(names):
            raise ValueError("watch, alike: found other channels, expected those of the card")
        if card.watch.errors and len(card.watch.errors) != len(card.joints):
            raise ValueError(f"watch: found {len(card.watch.errors)} errors, expected one for each joint")
        for joint, error in zip(card.joints, card.watch.errors, strict=False):
            require_between(f"watch, error of {joint.name}", error, 0.0, MAX_CARD_NUMBER)
        motion = {f"{what}.{a}" for a in card.angles for what in ("angle", "velocity", "acceleration")}
        unknown = {x for c in card.watch.channels for t in c.pattern for x in (t.first, t.second)} - motion - {""}
        if unknown:
            raise ValueError(f"watch: found {', '.join(sorted(unknown))}, expected angles of the card and their rates")
    for joint in card.joints:
        wrong = {x for t in joint.terms for x in (t.first, t.second)} - set(card.features) - {""}
        if joint.name not in angles or wrong:
            raise ValueError(f"{joint.name}: found {', '.join(sorted(wrong)) or 'no angle of it'}, expected features")


@dataclass(frozen=True)
class EstimatorFault:
    """A fault of a live estimator."""

    name: str  # name of the core
    words: str  # what was found and what the estimator then does
    keeps_validity: bool = False  # whether the estimate is as good as the calibration in spite of it
    stops: bool = False  # whether every torque is 0, which is no estimate
    repeats: bool = False  # whether the last output is repeated, be it an estimate or not


ESTIMATOR_KINDS = ("hill", "ridge")
"""Kinds of estimators that can be exported."""

MAX_NAMED_PAIRS = 3
"""Largest number of pairs of channels that a sentence names."""


def unwatched_words(pairs: Sequence[tuple[str, str]]) -> str:
    """Return the pairs of channels whose exchange would not be detected, in words."""
    said = [f"{one} and {other}" for one, other in pairs[:MAX_NAMED_PAIRS]]
    more = len(pairs) - len(said)
    return ", or of ".join(said) + (f", or of {more} more pairs" if more else "")


def best_estimator(cards: Iterable[EmgEstimatorCard]) -> EmgEstimatorCard | None:
    """Return the card with the smallest error in cross-validation, the first of equal ones; None without a card.

    Errors on held-out recordings do not choose, because then they would no longer show what the chosen one is worth.
    """
    known = ((inf if card.cross_validated_rmse is None else card.cross_validated_rmse, card) for card in cards)
    return min(known, key=lambda one: one[0], default=(inf, None))[1]


ESTIMATOR_FAULTS: tuple[EstimatorFault, ...] = (
    EstimatorFault(_core.EMG_FAULTS[0], "no fault: valid as calibrated", keeps_validity=True),
    EstimatorFault("configuration", "the configuration is invalid: every torque is 0", stops=True),
    EstimatorFault("time", "the time did not advance: the last output is repeated", repeats=True),
    EstimatorFault("angle", "an angle is missing or was never received: every torque is 0", stops=True),
    EstimatorFault(
        "channel", "an EMG channel is missing: its pattern for the movement replaces it, or rest if it has no pattern"
    ),
    EstimatorFault("ceiling", "an envelope was above the range of a muscle and was limited"),
    EstimatorFault("limit", "a torque was beyond its limit and was limited"),
    EstimatorFault(
        "restarted", "first step, or first step after a gap: lags and rates were reset", keeps_validity=True
    ),
    EstimatorFault("changed", "a channel changed since calibration and is replaced by its pattern for the movement"),
    EstimatorFault(
        "unlike", "most channels changed, or the movement differs from calibration: every torque is 0", stops=True
    ),
    EstimatorFault("uncertain", "channels depart from their patterns: the torque's interval is too wide"),
)
"""Every fault, in the core's order."""

ESTIMATOR_FAULTS_BY_NAME: Mapping[str, EstimatorFault] = {fault.name: fault for fault in ESTIMATOR_FAULTS}
