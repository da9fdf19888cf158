"""Swings on the virtual orthosis, and a test in the simulation of whether a controller makes its wearer sway.

The simulation contains the effects that a linear loop leaves out.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...knee.chosen_constants import REQUIRED_DELAY_MARGIN_S, REQUIRED_GAIN_MARGIN_DB
from ...knee.instruments import Mounting
from ...knee.protocol import Faults, KneeTrial, swing_trial
from ...knee.rig import KneeRig
from ...knee.trial import Controller, KneeReadings, run_trial
from ...knee.wearer import relaxed

SETTLING_TIME_S = 4.0
"""The first seconds of a swing are not scored: controllers adapt in them, and the wearer learns."""

MARGIN_SWING_DURATION_S = 10.0
"""Duration of the swings in which margins are tried."""

MIN_REST_SPEED_RAD_S = 0.1
"""A relaxed leg rests below this RMS speed, which is 1 degree at 1 Hz.

If zero-impedance mode leaves more than half of it, twice what that leaves counts instead.
"""

RELEASE_ANGLE_RAD = 0.5
"""A relaxed leg is released at this angle from hanging."""


class StrainedController:
    """A controller whose command is multiplied by `gain` [1] and delayed by `late` periods, to test its margins."""

    def __init__(self, controller: Controller, gain: float = 1.0, late: int = 0):
        self._controller, self._gain, self._waiting = controller, gain, [0.0] * late

    @property
    def fault(self) -> str:
        """Fault that the controller's safety gate has latched; "none" if there is none."""
        return self._controller.fault

    @property
    def reads_motor_encoder(self) -> bool:
        """Whether the controller also gets the motor's encoder."""
        return getattr(self._controller, "reads_motor_encoder", False)

    def step(
        self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = (), **more: float
    ) -> float:
        """Return the strained command [N m] of one period; `time` [s], `position` [rad], `torque` [N m], `emg` [V]."""
        self._waiting.append(self._gain * self._controller.step(time, position, torque, emg, **more))
        return self._waiting.pop(0)


def swing(
    rig: KneeRig,
    name: str,
    seed: int,
    controller: Controller | None,
    *,
    duration: float,
    session: Mounting | None = None,
    faults: Faults | None = None,
) -> KneeReadings:
    """Simulate a free swing at the rig's own pace; `duration` [s]."""
    trial = swing_trial(rig, "swing", rig.subjects[name], duration=duration, faults=faults or Faults())
    return run_trial(rig, trial, rng=np.random.default_rng([seed, 7]), controller=controller, mounting=session)


def without_power(rig: KneeRig) -> KneeRig:
    """Return the same orthosis without any control: the motor has no current, and the wearer backdrives it."""
    return rig.changed({f"torque_loop.{gain}": 0.0 for gain in ("kp", "ki", "kd")})


def rms_mismatch_and_torque(taken: KneeReadings) -> tuple[float, float]:
    """Return the RMS of mismatch [rad] and strap torque [N m] after the first `SETTLING_TIME_S`."""
    late = taken.time >= SETTLING_TIME_S
    truth = taken.truth
    return float(np.sqrt(np.mean(truth.mismatch[late] ** 2))), float(np.sqrt(np.mean(truth.strap_torque[late] ** 2)))


def release_leg(rig: KneeRig, name: str, controller: Controller | None, *, duration: float = 12.0) -> KneeReadings:
    """Simulate a relaxed leg that is released at `RELEASE_ANGLE_RAD`; `duration` [s]."""
    reference = np.zeros(round(duration / rig.period))
    leg = relaxed(rig.subjects[name])
    trial = KneeTrial("let_go", "free_swing", reference=reference, mode="torque", wearer=leg, start=RELEASE_ANGLE_RAD)
    return run_trial(rig, trial, rng=np.random.default_rng([5, 7]), controller=controller)


def last_speed(taken: KneeReadings) -> float:
    """Return the RMS speed of a released leg in its last 3 s [rad/s]; muscles at rest are not quite still."""
    last = taken.time >= taken.time[-1] - 3.0
    return float(np.sqrt(np.mean(taken.truth.limb_velocity[last] ** 2)))


@dataclass(frozen=True)
class WithoutControl:
    """Zero-impedance mode on one wearer: the reference to which sway is compared."""

    torque: float  # RMS of the strap's torque in a swing [N m]
    rest: float  # RMS speed below which a relaxed leg rests [rad/s]


def without_control(rig: KneeRig, name: str, seed: int = 31) -> WithoutControl:
    """Simulate zero-impedance mode on one wearer."""
    torque = rms_mismatch_and_torque(swing(rig, name, seed, None, duration=MARGIN_SWING_DURATION_S))[1]
    return WithoutControl(torque, max(MIN_REST_SPEED_RAD_S, 2.0 * last_speed(release_leg(rig, name, None))))


def comes_to_rest(rig: KneeRig, name: str, build: Callable[[], Controller], plain: WithoutControl) -> bool:
    """Return whether a relaxed leg that is released comes to rest under a controller, without extra gain or delay."""
    controller = build()
    return last_speed(release_leg(rig, name, controller)) <= plain.rest and controller.fault == "none"


def holds_margins(
    rig: KneeRig, name: str, build: Callable[[], Controller], plain: WithoutControl, *, seed: int = 31
) -> bool:
    """Return whether the required margins hold in the simulation: the command 6 dB too strong, or 20 ms late."""
    for gain, late in ((10 ** (REQUIRED_GAIN_MARGIN_DB / 20), 0), (1.0, round(REQUIRED_DELAY_MARGIN_S / rig.period))):
        resting, swinging = StrainedController(build(), gain, late), StrainedController(build(), gain, late)
        if last_speed(release_leg(rig, name, resting)) > plain.rest:
            return False
        torque = rms_mismatch_and_torque(swing(rig, name, seed, swinging, duration=MARGIN_SWING_DURATION_S))[1]
        if torque > 1.5 * plain.torque or {resting.fault, swinging.fault} != {"none"}:
            return False
    return True
