"""Check any lab's log with the supervisor: stops, limited samples, and the energy delivered.

The log's torque passes through the gate and the supervisor as if a control law of Pellucid had commanded it. The
supervisor needs a clock for speeds and rates. A log without a clock is checked at several assumed rates, which each
verdict states. The energy needs no clock, because it is the integral of torque over angle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .._errors import PellucidError
from ..controllers.control_law import JOINT_LAW, ControlLaw, Limits, gate_values
from ..controllers.instruments import Instruments
from ..controllers.supervised import SupervisedLaw, body_of, supervised
from ..controllers.supervisor_faults import NO_FAULT
from . import layout

ASSUMED_RATES_HZ = (50.0, 100.0, 200.0, 500.0, 1000.0)
"""Assumed rates for a log without a clock: those of published controllers of wearable robots."""

RESPONSE_WORDS = ("a damped stop", "no power")
"""What a supervisor does when it stops."""

NO_BODY_INERTIA = 0.05
"""Inertia that the passed-through law states where no model of the robot is known [kg m^2].

Thresholds that follow from it are those of the raw encoder alone."""


@dataclass(frozen=True)
class LogVerdict:
    """What gate and supervisor would have made of a log."""

    samples: int
    rate: float  # sampling rate at which it was judged [Hz]
    is_rate_assumed: bool  # whether the log has no clock
    stopped_at: int | None  # sample at which the supervisor would have stopped; None: nowhere
    fault: str  # why, "none" where it would not have
    response: str  # "a damped stop" or "no power", "" where it would not have stopped
    cut: int  # samples whose torque the gate would have cut, in size or in rate
    first_cut: int | None  # the first of them
    largest_torque: float  # largest torque of the log [N m]
    energy_before: float  # energy that the torque gave to the joint until the stop, or in the whole log [J]
    energy_after: float  # energy that it gave after the stop; 0 without one [J]
    largest_gift: float  # largest energy that it gave between any two samples [J]

    def sentence(self) -> str:
        """Return the verdict in sentences."""
        rate = f"{self.rate:g} Hz" + (" (assumed, because the log has no clock)" if self.is_rate_assumed else "")
        if self.stopped_at is None:
            said = f"At {rate}, the supervisor would not have stopped any of the {self.samples} samples."
        else:
            said = (
                f"At {rate}, the supervisor would have stopped at sample {self.stopped_at} of {self.samples}: "
                f'fault "{self.fault}", response {self.response}.'
            )
        said += f" The torque delivered {self.energy_before:.3g} J to the person"
        said += " in the whole log" if self.stopped_at is None else f" before, and {self.energy_after:.3g} J after"
        said += f"; at most {self.largest_gift:.3g} J between two samples."
        if self.cut:
            said += f" The gate would have limited {self.cut} samples, the first at {self.first_cut}."
        return said


def given_energy(angle: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Return the energy that a torque has given to a joint until each sample, shape (n,) [J].

    It needs no clock: over each step of the angle [rad] acts the mean of the torques [N m] at its ends. Steps with a
    missing number give nothing.
    """
    work = 0.5 * (torque[1:] + torque[:-1]) * np.diff(angle)
    return np.concatenate([[0.0], np.cumsum(np.where(np.isfinite(work), work, 0.0))])


def largest_gift(energy: np.ndarray) -> float:
    """Return the largest rise of an energy, shape (n,), from any sample to a later one [J]."""
    return float(np.max(energy - np.minimum.accumulate(energy)))


def passed_through(limits: Limits, period: float, instruments: Instruments | None = None) -> SupervisedLaw:
    """Return a law that asks for its number "offset", under a supervisor that knows no model of the robot.

    Parameters
    ----------
    limits : Limits
        Limits of the gate.
    period : float
        Between two samples [s].
    instruments : Instruments or None
        What the robot measures; None: an encoder alone.
    """
    numbers = JOINT_LAW.defaults | gate_values(limits, period) | {
        "inertia": NO_BODY_INERTIA,
        "velocity_width": 0.1,
        "gravity_share": 1.0,
        "friction_share": 0.0,
        "bandwidth": min(JOINT_LAW.defaults["bandwidth"], 0.5 / period),
        "max_repeats": 0.0,  # every sample of a log is a new one, however often its values repeat
    }
    law = ControlLaw(JOINT_LAW.name, numbers)
    return supervised(law, instruments=instruments, body=dict.fromkeys(body_of(law), 0.0), start_up=False)


def judge_log(
    angle: np.ndarray,
    torque: np.ndarray,
    *,
    limits: Limits,
    time: np.ndarray | None = None,
    rates: Sequence[float] = ASSUMED_RATES_HZ,
    instruments: Instruments | None = None,
    supervision: Mapping[str, float] | None = None,
) -> list[LogVerdict]:
    """Return the response of gate and supervisor to a log's torque.

    Parameters
    ----------
    angle : ndarray, shape (n,)
        Joint angle [rad].
    torque : ndarray, shape (n,)
        Torque that was asked of the robot, on the joint [N m], positive where it drives the angle up.
    limits : Limits
        Limits that the gate would have had.
    time : ndarray, shape (n,), optional
        Sample times [s]; without them, the log is checked once at each of the `rates`.
    rates : sequence of float
        Assumed rates [Hz].
    instruments : Instruments or None
        What the robot measures; None: an encoder alone.
    supervision : mapping, optional
        Numbers of the supervisor that replace those that follow from the limits, by name, SI.

    Returns
    -------
    list of LogVerdict
        One for a log with a clock, or one a rate.

    Raises
    ------
    PellucidError
        If the arrays are not of one length of at least two, or the clock does not go on.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> from pellucid.live.log_verdict import judge_log
    >>> t = np.arange(0.0, 2.0, 0.005)
    >>> angle = 0.8 + 0.3 * np.sin(2.0 * t)
    >>> verdict, = judge_log(angle, np.cos(2.0 * t), time=t, limits=pl.Limits(effort=5.0))
    >>> verdict.fault, round(verdict.largest_gift, 2)
    ('none', 0.5)
    """
    angle, torque = np.asarray(angle, float), np.asarray(torque, float)
    if angle.ndim != 1 or angle.shape != torque.shape or len(angle) < 2:
        raise PellucidError(
            f"log: found an angle of shape {angle.shape} and a torque of shape {torque.shape}, expected one number a "
            "sample of both, and at least two samples"
        )
    if time is not None:
        time = np.asarray(time, float)
        if time.shape != angle.shape or not np.all(np.diff(time) > 0.0):
            raise PellucidError(
                "log: found a time that does not increase or differs in length, expected an increasing time per sample"
            )
        return [_judge(angle, torque, time, float(np.median(np.diff(time))), False, limits, instruments, supervision)]
    return [
        _judge(angle, torque, np.arange(len(angle)) / rate, 1.0 / rate, True, limits, instruments, supervision)
        for rate in rates
    ]


def _judge(
    angle: np.ndarray,
    torque: np.ndarray,
    time: np.ndarray,
    period: float,
    assumed: bool,
    limits: Limits,
    instruments: Instruments | None,
    supervision: Mapping[str, float] | None,
) -> LogVerdict:
    law = passed_through(limits, period, instruments).changed(**(supervision or {}))
    running, numbers = law.start(), law.parameters
    offset = list(law.values).index("offset")
    stopped: int | None = None
    fault, response = NO_FAULT, ""
    for i in range(len(angle)):
        if not np.isfinite(torque[i]):
            stopped, fault, response = i, "not_finite", RESPONSE_WORDS[-1]
            break
        numbers[offset] = torque[i]
        running.adjust(numbers)
        running.step(float(time[i] - time[0]), float(angle[i]) if np.isfinite(angle[i]) else None)
        if running.mode in layout.MODES[3:]:
            stopped, fault, response = i, running.fault, RESPONSE_WORDS[running.mode != "damped_stop"]
            break
    energy = given_energy(angle, torque)
    at = len(angle) - 1 if stopped is None else stopped
    steps = np.abs(np.diff(torque, prepend=torque[0]))
    cut = np.flatnonzero((np.abs(torque) > limits.effort) | (steps > limits.rate * period) | ~np.isfinite(torque))
    return LogVerdict(
        samples=len(angle),
        rate=1.0 / period,
        is_rate_assumed=assumed,
        stopped_at=stopped,
        fault=fault,
        response=response,
        cut=len(cut),
        first_cut=int(cut[0]) if len(cut) else None,
        largest_torque=float(np.nanmax(np.abs(torque))),
        energy_before=float(energy[at]),
        energy_after=float(energy[-1] - energy[at]),
        largest_gift=largest_gift(energy),
    )
