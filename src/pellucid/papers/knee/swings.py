"""Swings on the virtual orthosis, and whether a controller sways its wearer: in the simulation, with all that a linear
loop leaves out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...lab.knee.instruments import Mounting
from ...lab.knee.protocol import Faults, KneeTrial, swing_trial
from ...lab.knee.rig import KneeRig
from ...lab.knee.trial import Controller, KneeReadings, run_trial
from ...lab.knee.wearer import relaxed
from .controllers import DELAY, GAIN_DB

SETTLING = 4.0
"""Not scored at the start of a swing [s]: adaptation and the wearer's own learning."""

STRAINED = 10.0
"""Length of the swings in which margins are tried [s]."""

REST_SPEED, LET_GO = 0.1, 0.5
"""What counts as rest, a degree at 1 Hz, or twice what zero-impedance mode leaves if that is more [rad/s]; and where a
relaxed leg is let go [rad]."""


class Strained:
    """A controller whose command is too strong and too late: what margins are asked for; gain [1]."""

    def __init__(self, controller: Controller, gain: float = 1.0, late: int = 0):
        self._controller, self._gain, self._waiting = controller, gain, [0.0] * late

    @property
    def fault(self) -> str:
        """As of the controller's gate."""
        return self._controller.fault

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """One period; time [s], position [rad], torque [N m], emg [V]; gives [N m]."""
        self._waiting.append(self._gain * self._controller.step(time, position, torque, emg))
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
    """A free swing at the rig's own pace; duration [s]."""
    trial = swing_trial(rig, "swing", rig.subjects[name], duration=duration, faults=faults or Faults())
    return run_trial(rig, trial, rng=np.random.default_rng([seed, 7]), controller=controller, mounting=session)


def driven_back(rig: KneeRig) -> KneeRig:
    """The same orthosis without any control: the motor has no current, and the wearer drives it back."""
    return rig.changed({f"torque_loop.{gain}": 0.0 for gain in ("kp", "ki", "kd")})


def root_mean_square(taken: KneeReadings) -> tuple[float, float]:
    """Of mismatch and strap torque, after they settled; gives [rad], [N m]."""
    late = taken.time >= SETTLING
    truth = taken.truth
    return float(np.sqrt(np.mean(truth.mismatch[late] ** 2))), float(np.sqrt(np.mean(truth.strap_torque[late] ** 2)))


def let_go(rig: KneeRig, name: str, controller: Controller | None, *, duration: float = 12.0) -> KneeReadings:
    """A relaxed leg, let go where it does not hang; duration [s]."""
    reference = np.zeros(round(duration / rig.period))
    leg = relaxed(rig.subjects[name])
    trial = KneeTrial("let_go", "free_swing", reference=reference, mode="torque", wearer=leg, start=LET_GO)
    return run_trial(rig, trial, rng=np.random.default_rng([5, 7]), controller=controller)


def last_speed(taken: KneeReadings) -> float:
    """How fast a leg that was let go still moves in its last 3 s, RMS [rad/s]: muscles at rest are not quite still."""
    last = taken.time >= taken.time[-1] - 3.0
    return float(np.sqrt(np.mean(taken.truth.limb_velocity[last] ** 2)))


@dataclass(frozen=True)
class WithoutControl:
    """What zero-impedance mode leaves of one wearer, which sway is measured by."""

    torque: float  # Of the strap in a swing, RMS [N m]
    rest: float  # Speed of a relaxed leg that counts as rest [rad/s]


def without_control(rig: KneeRig, name: str, seed: int = 31) -> WithoutControl:
    """Zero-impedance mode of one wearer."""
    torque = root_mean_square(swing(rig, name, seed, None, duration=STRAINED))[1]
    return WithoutControl(torque, max(REST_SPEED, 2.0 * last_speed(let_go(rig, name, None))))


def settles(rig: KneeRig, name: str, build: Callable[[], Controller], plain: WithoutControl) -> bool:
    """Whether a relaxed leg that is let go comes to rest under a controller as it is."""
    controller = build()
    return last_speed(let_go(rig, name, controller)) <= plain.rest and controller.fault == "none"


def holds_margins(
    rig: KneeRig, name: str, build: Callable[[], Controller], plain: WithoutControl, *, seed: int = 31
) -> bool:
    """Whether the margins asked for hold in the simulation: the command 6 dB too strong, or 20 ms late."""
    for gain, late in ((10 ** (GAIN_DB / 20), 0), (1.0, round(DELAY / rig.period))):
        resting, swinging = Strained(build(), gain, late), Strained(build(), gain, late)
        if last_speed(let_go(rig, name, resting)) > plain.rest:
            return False
        torque = root_mean_square(swing(rig, name, seed, swinging, duration=STRAINED))[1]
        if torque > 1.5 * plain.torque or {resting.fault, swinging.fault} != {"none"}:
            return False
    return True
