"""Estimate the torque of joints while a session runs: samples with times go in, torques with their validity come out.

The core holds the state. A microcontroller and the offline evaluation step the same core, so that the live estimator is
the one that was evaluated offline.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, nan

import numpy as np

from ... import _core
from ..._errors import PellucidError
from ...units import to_si_factor
from ..models.emg_estimator import ESTIMATOR_FAULTS_BY_NAME, WATCH_DEFAULTS, EmgEstimatorCard


@dataclass(frozen=True)
class LiveEstimate:
    """Torque and faults after one step."""

    torque: Mapping[str, float]  # Torque by joint [N m], always finite and within its limit
    fault: str  # Gravest of the `FAULTS`; "none" if the estimate is as good as the calibration
    lost: tuple[str, ...] = ()  # Channels missing for too long: a pattern replaces them, or rest
    above: tuple[str, ...] = ()  # Channels above their largest value in the calibration, which were clipped
    blind: tuple[str, ...] = ()  # Lost angles, without which every torque is 0
    changed: tuple[str, ...] = ()  # Channels unlike the calibration, whose patterns by the movement take their places
    widening: float = 1.0  # Error of the torque over its calibrated error; 1 if channels are as in the calibration
    # Half width of the 90 % interval about each torque by joint [N m]. It is infinite where a fault makes every torque
    # 0, and empty if the card knows no calibrated error
    half_width: Mapping[str, float] = field(default_factory=dict)

    @property
    def valid(self) -> bool:
        """Whether the estimate is as good as the calibration."""
        return ESTIMATOR_FAULTS_BY_NAME[self.fault].keeps_validity


FAULTS = tuple(_core.EMG_FAULTS)
"""Names of the faults: none, configuration, time, angle, channel, ceiling, limit, restarted, changed, unlike and
uncertain.

``include/pellucid/emg_estimator.hpp`` defines each.
"""


class LiveTorque:
    """A calibrated estimator that runs sample by sample.

    Parameters
    ----------
    card : EmgEstimatorCard
        Card that `calibrate` wrote.
    period : float or None
        Time from one step to the next [s]; None: the period of the recordings it was calibrated on.
    angle_unit : str
        Unit of the angles passed to `step` and `run`.

    Examples
    --------
    Read the card of a calibrated study and step it:

    >>> from pellucid.emg.models.emg_estimator import read_estimator_card
    >>> live = LiveTorque(read_estimator_card(path), angle_unit="deg")
    >>> live.step(12.34, {"soleus": 0.21}, {"knee": -14.0, "ankle": 6.0}).valid
    False
    """

    def __init__(self, card: EmgEstimatorCard, *, period: float | None = None, angle_unit: str = "rad"):
        self.card, self.period = card, card.at(period)
        self.channels = tuple(channel.name for channel in card.channels)
        self.joints = tuple(joint.name for joint in card.joints)
        self._gain, _ = to_si_factor(angle_unit, "rad", "angle_unit")
        self._core = card.build(period)
        self._gives_torque = False
        errors = () if card.watch is None else card.watch.errors
        self._half_width = {
            joint: WATCH_DEFAULTS.band_quantile * error for joint, error in zip(self.joints, errors, strict=False)
        }

    def listen(self, emg: Mapping[str, np.ndarray]) -> None:
        """Pass raw EMG by channel, shape (n,) [V] each, at the card's rate. NaN marks missing samples."""
        if self.card.chain == "none":
            raise PellucidError(f"card {self.card.name}: found raw EMG, expected envelopes with every step")
        self._core.listen(np.column_stack(self._ordered_values("EMG", self.channels, emg)))

    def step(self, time: float, emg: Mapping[str, float], angles: Mapping[str, float]) -> LiveEstimate:
        """Advance one period and return the estimate.

        `time` is in seconds; `emg` holds envelopes by channel, none if raw EMG goes through `listen`; `angles` holds
        angles by joint. A value that is absent or NaN counts as missing.
        """
        if not np.isfinite(time) or abs(time) > 9e9:
            raise PellucidError(f"time: found {time:g} s, expected the time of a monotonic clock, in seconds")
        envelope = self._ordered_values("EMG", self.channels, emg)
        angle = self._gain * np.array(self._ordered_values("angles", self.card.angles, angles), float)
        torque, fault, lost, above, blind = self._core.step(round(1e6 * time), envelope, angle)
        widening = self._core.widening
        if not (known := ESTIMATOR_FAULTS_BY_NAME[FAULTS[fault]]).repeats:
            self._gives_torque = not known.stops
        return LiveEstimate(
            dict(zip(self.joints, torque.tolist(), strict=True)),
            FAULTS[fault],
            _names_of_set_bits(self.channels, lost),
            _names_of_set_bits(self.channels, above),
            _names_of_set_bits(self.card.angles, blind),
            _names_of_set_bits(self.channels, self._core.changed),
            widening,
            {joint: widening * half if self._gives_torque else inf for joint, half in self._half_width.items()},
        )

    def run(
        self, time: np.ndarray, emg: Mapping[str, np.ndarray], angles: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Advance several periods from the present state and return the torque by joint, shape (n,) [N m] each."""
        torque = self._core.run(*self._input_rows(time, emg, angles))[0]
        return dict(zip(self.joints, torque, strict=True))

    def find_stops(
        self, time: np.ndarray, emg: Mapping[str, np.ndarray], angles: Mapping[str, np.ndarray]
    ) -> np.ndarray:
        """Advance as `run` does and return where a fault made every torque 0, shape (n,) bool."""
        faults = self._core.run(*self._input_rows(time, emg, angles))[1].astype(int)
        return np.array([ESTIMATOR_FAULTS_BY_NAME[name].stops for name in FAULTS])[faults]

    def find_valid(
        self, time: np.ndarray, emg: Mapping[str, np.ndarray], angles: Mapping[str, np.ndarray]
    ) -> np.ndarray:
        """Advance as `run` does and return where the estimate is as good as the calibration, shape (n,) bool."""
        faults = self._core.run(*self._input_rows(time, emg, angles))[1].astype(int)
        return np.array([ESTIMATOR_FAULTS_BY_NAME[name].keeps_validity for name in FAULTS])[faults]

    def find_changes(
        self, time: np.ndarray, emg: Mapping[str, np.ndarray], angles: Mapping[str, np.ndarray]
    ) -> dict[str, tuple[int, float]]:
        """Advance as `run` does and return, by channel that the watch names, its first index and its largest loss."""
        found: dict[str, tuple[int, float]] = {}
        times, envelopes, turned = self._input_rows(time, emg, angles)
        steps = zip(times.astype(int).tolist(), envelopes.T.copy(), turned.T.copy(), strict=True)
        for i, (at, envelope, angle) in enumerate(steps):
            self._core.step(at, envelope, angle)
            if changed := self._core.changed:
                losses = self.losses
                for channel in _names_of_set_bits(self.channels, changed):
                    first, largest = found.get(channel, (i, 0.0))
                    found[channel] = first, max(largest, losses[channel])
        return found

    def _input_rows(
        self, time: np.ndarray, emg: Mapping[str, np.ndarray], angles: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return times, shape (n,) [us], envelopes with a row per channel, and angles with a row per joint [rad]."""
        n = len(time)

        def rows(what: str, names: tuple[str, ...], given: Mapping[str, np.ndarray]) -> np.ndarray:
            found = [np.broadcast_to(np.asarray(x, float), n) for x in self._ordered_values(what, names, given)]
            return np.array(found).reshape(len(names), n)

        angle = self._gain * rows("angles", self.card.angles, angles)
        return np.round(1e6 * np.asarray(time, float)), rows("EMG", self.channels, emg), angle

    @property
    def losses(self) -> dict[str, float]:
        """Share of the torque's variance that each channel's change may cost, by the watch's last step [1]."""
        return dict(zip(self.channels, self._core.losses.tolist(), strict=True))

    def stiffness(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the joints' short-range stiffness and the slope of the Hill forces at the last step.

        Each has shape (j, j) [N m/rad]: the row is the torque's joint, the column the angle's.
        """
        return self._core.stiffness()

    @property
    def activations(self) -> dict[str, float]:
        """Activation of each muscle at the last step [1]."""
        return dict(zip((m.name for m in self.card.muscles), self._core.activations.tolist(), strict=True))

    def reset(self) -> None:
        """Forget every sample."""
        self._core.reset()

    def _ordered_values(self, what: str, names: tuple[str, ...], given: Mapping) -> list:
        """Return the values of `given` in the order of `names`, NaN for absent ones; refuse unknown names."""
        unknown = [name for name in given if name not in names]
        if unknown:
            raise PellucidError(
                f"{what}: found {', '.join(map(str, unknown))}, expected some of {', '.join(names) or 'none'}"
            )
        return [given.get(name, nan) for name in names]


def _names_of_set_bits(names: tuple[str, ...], bits: int) -> tuple[str, ...]:
    """Return the names whose bits are set."""
    return tuple(name for i, name in enumerate(names) if bits >> i & 1)
