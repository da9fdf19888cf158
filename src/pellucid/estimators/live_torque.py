"""Torque of joints while a session runs: samples with times go in, torques with what they are worth come out.

The state is the core's, the same that a microcontroller steps and that batches run through, so that what was judged
offline is what is used live.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import nan

import numpy as np

from .. import _core
from .._errors import PellucidError
from ..models.emg_estimator import EmgEstimatorCard
from ..units import to_si_factor


@dataclass(frozen=True)
class LiveEstimate:
    """What one step gives."""

    torque: Mapping[str, float]  # By joint [N m], finite and within its limit whatever came in
    fault: str  # The gravest of `FAULTS`, or "none": as good as its calibration
    lost: tuple[str, ...] = ()  # Channels silent for too long, taken for muscles at rest
    above: tuple[str, ...] = ()  # Channels above what the calibration knew of them, cut off
    blind: tuple[str, ...] = ()  # Angles that are lost: every torque is 0

    @property
    def valid(self) -> bool:
        """Whether the calibration stands behind it."""
        return self.fault in ("none", "restarted")


FAULTS = tuple(_core.EMG_FAULTS)
"""none, configuration, time, angle, channel, ceiling, limit, restarted; ``include/pellucid/emg_estimator.hpp`` says
what each means."""


class LiveTorque:
    """A calibrated estimator at work.

    Parameters
    ----------
    card : EmgEstimatorCard
        Of `calibrate`.
    period : float or None
        From one step to the next [s]; None: that of the recordings it was calibrated on.
    angle_unit : str
        Of the angles that will be given.

    Examples
    --------
    Of a study that was calibrated:

    >>> from pellucid.models.emg_estimator import read_estimator_card
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

    def listen(self, emg: Mapping[str, np.ndarray]) -> None:
        """Raw EMG by channel, (n,) [V] each, at the card's rate; NaN where an electrode was not heard."""
        if self.card.chain == "none":
            raise PellucidError(f"card {self.card.name}: found raw EMG, expected envelopes with every step")
        self._core.listen(np.column_stack(self._rows("EMG", self.channels, emg)))

    def step(self, time: float, emg: Mapping[str, float], angles: Mapping[str, float]) -> LiveEstimate:
        """One period: the time [s], envelopes by channel (none where raw EMG goes through `listen`), angles by joint.
        What is missing or NaN was not heard.
        """
        if not np.isfinite(time) or abs(time) > 9e9:
            raise PellucidError(f"time: found {time:g} s, expected seconds on a clock that only goes on")
        envelope = self._rows("EMG", self.channels, emg)
        angle = self._gain * np.array(self._rows("angles", self.card.angles, angles), float)
        torque, fault, lost, above, blind = self._core.step(round(1e6 * time), envelope, angle)
        return LiveEstimate(
            dict(zip(self.joints, torque.tolist(), strict=True)),
            FAULTS[fault],
            _named(self.channels, lost),
            _named(self.channels, above),
            _named(self.card.angles, blind),
        )

    def run(
        self, time: np.ndarray, emg: Mapping[str, np.ndarray], angles: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Periods one after another, going on from the state; torque by joint, (n,) [N m]."""
        n = len(time)

        def rows(what: str, names: tuple[str, ...], given: Mapping[str, np.ndarray]) -> np.ndarray:
            found = [np.broadcast_to(np.asarray(x, float), n) for x in self._rows(what, names, given)]
            return np.array(found).reshape(len(names), n)

        angle = self._gain * rows("angles", self.card.angles, angles)
        torque = self._core.run(np.round(1e6 * np.asarray(time, float)), rows("EMG", self.channels, emg), angle)[0]
        return dict(zip(self.joints, torque, strict=True))

    def stiffness(self) -> tuple[np.ndarray, np.ndarray]:
        """Of the joints at the last step, at once and by Hill's slope; row by the torque, column by the angle, (j, j)
        each [N m/rad].
        """
        return self._core.stiffness()

    @property
    def activations(self) -> dict[str, float]:
        """Of each muscle at the last step [1]."""
        return dict(zip((m.name for m in self.card.muscles), self._core.activations.tolist(), strict=True))

    def reset(self) -> None:
        """Forget every sample."""
        self._core.reset()

    def _rows(self, what: str, names: tuple[str, ...], given: Mapping) -> list:
        unknown = [name for name in given if name not in names]
        if unknown:
            raise PellucidError(
                f"{what}: found {', '.join(map(str, unknown))}, expected some of {', '.join(names) or 'none'}"
            )
        return [given.get(name, nan) for name in names]


def _named(names: tuple[str, ...], bits: int) -> tuple[str, ...]:
    return tuple(name for i, name in enumerate(names) if bits >> i & 1)
