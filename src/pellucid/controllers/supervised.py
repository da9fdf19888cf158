"""Put a law under the core's supervisor: rules for the thresholds on raw data, sensors, drive, energy and memory.

Every threshold follows from the law's own numbers (the card's body and the limits) and from the specification of the
sensors. The constants below were chosen on robots and wearers that do not enter docs/validation/supervisor.md.
Thresholds against false alarms are the smallest values at which all of these ran without an alarm, plus a fifth; the
tolerance for the force sensor's gain has no such margin.

Amplitude and window of the supervisor's probe, from the body, the encoder, the control period and the limit.

The probe is a wave of effort with three frequencies. The encoder's acceleration must answer it, so that a
reversed, dead, late or wrongly scaled drive or encoder is found without a measurement of the drive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .. import _core
from .._errors import ArgumentError, PellucidError
from ..models.fields import friction_coefficients, model_fields
from ..numerics.arguments import shown, with_checked_arguments
from .control_law import LAWS, ControlLaw
from .elbow_laws import LOOP_BANDWIDTH
from .instruments import (
    DRIVE_GAIN_ERROR,
    DRIVE_LAG_S,
    DRIVE_NOISE_SHARE,
    DRIVE_OFFSET_SHARE,
    FORCE_OFFSET_SHARE,
    SHORTEST_PROBE_WINDOW_S,
    CompleteInstruments,
    Instruments,
)

PROBE_WINDOWS_S = (SHORTEST_PROBE_WINDOW_S, 0.2)
"""Shortest and longest duration of a window of the probe. Its waves have 42, 75 and 108 Hz, above strap and ringing
band, to 25, 45 and 65 Hz."""

MAX_PROBE_PERIOD_S = 0.002
"""Longest control period at which a law may probe: the highest wave then has more than four samples a cycle."""

MAX_PROBE_SHARE = 0.25
"""Largest value of the whole wave, as a share of the law's effort limit [1].

A law whose limit is the effort that it needs takes all of it: with 0.15, a window shows little more of such a law's
drive than of the encoder's noise."""

PROBE_CREST = math.sqrt(5.0)
"""Largest value of the whole wave, relative to the amplitude of one of its three waves [1]."""

PROBE_CYCLES = (5, 9, 13)
"""Number of cycles of each wave in a window, as in the core."""

PROBE_ACCELERATION = 9.0
"""Amplitude of the acceleration that each wave would cause on the robot as one rigid body [rad/s^2 or m/s^2]. It is
less where the wave would be above `MAX_PROBE_SHARE`."""

MIN_PROBE_ACCELERATION = 3.0
"""Smallest such acceleration, chosen by judgement: friction and motion hide less. With 4 rad/s^2 faults were found on
tuning robots; less was not tried [rad/s^2 or m/s^2]."""

PROBE_READING_ERRORS = 4.0
"""Number of standard deviations of the encoder in `Instruments.encoder_resolution` [1]."""

MIN_PROBE_SIGNAL_TO_NOISE = 4.0
"""Smallest power of a window's lock-in over that of the encoder's noise, summed over the three waves [1]."""

PROBE_SIGNAL_TO_NOISE = 39.0
"""Such power up to which a window becomes longer than the shortest: elbows have as much. With 19, on a robot of 44 N m
with an encoder of 14 to 16 bits, healthy legs were not heard three times as often."""

PROBE_SPEED_MARGIN = 2.0
"""The joint moves if it is faster than this multiple of the speed that the whole wave causes [1]."""

MIN_PROBE_SPEED = 0.1
"""Speed below which friction may swallow the wave at any amplitude [rad/s or m/s]."""


UNHEARD_S = (0.093, 0.16)
"""Times at the velocity limit whose ways are the shortest and the longest that the joint may go, forth or back, while
its drive is not heard: see `STUCK_ENERGY_J`. They are those of the shortest window and grow with it. The shortest is
more than the 0.075 s of way that windows of the probe hold which have not ended yet; at 8 rad/s a drive stuck at
6.7 N m gives 5 J on it."""

MIN_UNHEARD_WAY = 0.7
"""Shortest such way where the longest one is not shorter [rad or m]: less stops slow healthy robots.

With a limit of 4.5 rad/s, 0.62 rad stopped 2 of 144 tuning wearers whom the longest let go on. With 4 rad/s on a robot
of 44 N m, 0.37 rad stopped 28 times in 8 h, mostly one of 96 robots, and the longest never."""

STUCK_ENERGY_J = 4.6
"""Energy that a drive which is stuck at half of its largest effort gives on that way, between both bounds [J].

A law that needs little effort makes no drive weaker, so that its own limit counts only where that of the drive is not
known. The robot's weight, which a stuck drive leaves to the wearer, adds to it."""


MAX_UNHEARD_ENERGY_J = 4.0
"""Smallest energy that a drive with three times the gain may add before it is detected and the law's effort is 0 [J].

It adds more until the power is off; the energy delivered to the wearer should stay below 5 J. A heavier robot gives
more while it carries itself over the way that its drive may go unheard: with less it would drop its weight."""


PROBE_ANSWER_ERROR = 0.1
"""Mean square by which a healthy robot answers otherwise than at its commissioning, relative to that answer [1]."""

PROBE_ANSWER_NAMES: tuple[str, ...] = tuple(
    f"probe_answer_{wave}_{part}" for wave in ("low", "middle", "high") for part in ("real", "imaginary")
)
"""The supervisor's numbers of the answers at commissioning, in the order of `Instruments.probe_answer`."""


def commissioned_answers(answer: Sequence[float] | None) -> Mapping[str, float]:
    """Return the supervisor's numbers of a probe's `answer` at commissioning, by name; none without an answer."""
    if answer is None:
        return {}
    return {"probe_answer_error": PROBE_ANSWER_ERROR, **dict(zip(PROBE_ANSWER_NAMES, answer, strict=True))}


def probe_signal_to_noise(
    amplitude: float, inertia: float, resolution: float, period: float, samples: int | None = None
) -> float:
    """Return the power of a window's lock-in over that of the encoder's noise, summed over the three waves [1].

    `amplitude` [N m or N] is that of each wave; all others are SI. The window has `samples`; None for the shortest.
    """
    samples = samples or probe_samples(period)
    total = 0.0
    for cycles in PROBE_CYCLES:
        noise = resolution / PROBE_READING_ERRORS * 2.0 * (1.0 - math.cos(2.0 * math.pi * cycles / samples))
        total += (0.25 * samples * amplitude) ** 2 / (0.375 * samples * (inertia * noise / period**2) ** 2)
    return total


def probe_samples(period: float, window: float = PROBE_WINDOWS_S[0]) -> int:
    """Return the number of periods in a window [s], a multiple of four."""
    return 4 * round(0.25 * window / period)


def stuck_effort(drive_limit: float, limit: float) -> float:
    """Return the effort at which a drive is assumed to be stuck, half of its largest one, else of the law's `limit`."""
    return 0.5 * (drive_limit if math.isfinite(drive_limit) else limit)


def probe_numbers(
    inertia: float,
    resolution: float,
    *,
    limit: float,
    period: float,
    steady: float = 0.0,
    speed_limit: float = math.inf,
    drive_limit: float = math.inf,
) -> Mapping[str, float]:
    """Return the supervisor's numbers of the probe by name, SI.

    Parameters
    ----------
    inertia : float
        Inertia of the robot that the drive accelerates [kg m^2 or kg].
    resolution : float
        Error of one encoder reading [rad or m].
    limit : float
        Effort limit of the law [N m or N].
    period : float
        Control period [s].
    steady : float
        Largest effort with which the law carries the robot's own weight and friction [N m or N].
    speed_limit : float
        Velocity limit of the law [rad/s or m/s]; infinite where it has none, and the way is not bounded then.
    drive_limit : float
        Largest effort of the drive at the joint [N m or N]; infinite where it is not known.

    Raises
    ------
    PellucidError
        If the control rate is below 500 Hz, the inertia is not known, or the wave that the encoder can resolve is
        larger than `MAX_PROBE_SHARE` of the effort limit.
    """
    if period > MAX_PROBE_PERIOD_S * (1.0 + 1e-9):
        raise PellucidError(
            f"probe: found a control rate of {1.0 / period:.4g} Hz, expected at least {1.0 / MAX_PROBE_PERIOD_S:g} Hz"
        )
    if not inertia > 0.0:
        raise PellucidError(f"probe: found a body with an inertia of {inertia:g}, expected a known inertia above 0")
    wanted, largest = PROBE_ACCELERATION * inertia, MAX_PROBE_SHARE * limit / PROBE_CREST
    signal = probe_signal_to_noise(wanted, inertia, resolution, period)
    needed = wanted * max(math.sqrt(MIN_PROBE_SIGNAL_TO_NOISE / signal), MIN_PROBE_ACCELERATION / PROBE_ACCELERATION)
    if needed > largest:
        raise PellucidError(
            f"probe: found that inertia and encoder need a wave of {PROBE_CREST * needed:.3g} (SI), expected at most "
            f"{MAX_PROBE_SHARE * limit:.3g}, {MAX_PROBE_SHARE:g} of the effort limit"
        )
    amplitude = max(needed, min(wanted, largest))
    shortest_window, longest_window = (probe_samples(period, window) for window in PROBE_WINDOWS_S)

    def is_clear(samples: int) -> bool:
        return probe_signal_to_noise(amplitude, inertia, resolution, period, samples) >= PROBE_SIGNAL_TO_NOISE

    samples = next(filter(is_clear, range(shortest_window, longest_window, 4)), longest_window)
    slowest = 2.0 * math.pi * PROBE_CYCLES[0] / (samples * period)
    speed = PROBE_CREST * amplitude / (inertia * slowest)
    stuck = stuck_effort(drive_limit, limit)
    shortest, longest = (time * speed_limit * samples / shortest_window for time in UNHEARD_S)
    travel = min(max(STUCK_ENERGY_J / stuck, shortest, MIN_UNHEARD_WAY), longest)
    way = travel if math.isfinite(travel) else STUCK_ENERGY_J / stuck
    return {
        "probe_effort": amplitude,
        "probe_samples": float(samples),
        "probe_inertia": inertia,
        "probe_noise": resolution / PROBE_READING_ERRORS,
        "probe_moving": max(MIN_PROBE_SPEED, PROBE_SPEED_MARGIN * speed),
        "probe_travel": travel,
        "probe_energy": max(MAX_UNHEARD_ENERGY_J, 2.0 * steady * way),
    }


MIN_DRIVEN_INERTIA_SHARE = 0.1
"""Smallest share of the inertia that the drive may accelerate by itself, behind its transmission [1]."""

POSITION_RANGE_MARGIN = 0.15
"""Distance beyond the law's position limits at which a position is a fault: a wearer may overrun a limit [rad or m]."""

MAX_GRIP_DECELERATION = 500.0
"""Largest deceleration of a joint that somebody grips [rad/s^2 or m/s^2]."""

RATE_WINDOW_S = 0.25
"""Time over which the mean interval of the control task is checked: half the rate is detected within 0.45 s."""

RATE_TOLERANCE = 0.2
"""Largest relative difference of that mean from the period [1]."""

STILL_S = 0.4
"""Time of equal readings after which a wave asks the joint. It grows for as long, and is whole for as long again."""

ENCODER_FREEZE_S = 0.02
"""An encoder is frozen if its value has not changed for this time although the joint moves."""

SENSOR_QUIET_S = 0.05
"""A force or EMG sensor is silent if its value has not changed for this time."""

TEST_HALF_WAVE_S = 0.032
"""Duration of half a wave of the start-up test."""

TEST_REST_S = 0.1
"""The joint must rest for this time before the start-up test."""

TEST_SAMPLE_BOUNDS = next(
    (int(each.lower), int(each.upper)) for each in model_fields("supervisor") if each.name == "test_samples"
)
"""Smallest and largest number of periods in half a wave of the test that the core accepts."""

WEARER_TORQUE_SHARE = 0.15
"""Largest lasting torque of a wearer on a robot that is carried, as a share of the law's effort limit [1]."""

WEARER_PUSH_SHARE = 0.96
"""Largest momentary torque of a wearer, as a share of the law's effort limit [1]."""

WEARER_ACCELERATION_TIMES_S = (0.5, 0.065)
"""Times in which a wearer may accelerate the robot alone to its velocity limit, by a lasting and by a momentary
torque."""

FORCE_TOLERANCE_SHARE = 0.066
"""Largest lasting difference between force sensor and model, as a share of the law's effort limit [1]."""

FORCE_BURST_SHARE = 0.8
"""Largest momentary difference between force sensor and model, as a share of the law's effort limit [1]."""

FORCE_EXCESS_SHARE = 0.022
"""Largest difference due to a wrong gain of the force sensor, as a share of the law's effort limit [1]."""

WEARER_ACCELERATIONS = (27.0, 75.0)
"""Lasting and momentary acceleration that a wearer gives a robot by their own force [rad/s^2 or m/s^2].

Chosen with `MODEL_WEIGHT_ERROR_SHARE` and `DRIVE_RESPONSE_S` on exported controllers that 192 foreign plants of seed
20261101 wore for 48 h. With 20 and 60 rad/s^2 two lives came up to 1 % beyond the lasting torque, and one beyond the
momentary one."""

MODEL_WEIGHT_ERROR_SHARE = 0.4
"""Largest error of the weight that the model states, as a share of it [1]."""

LOAD_WEIGHT_ERROR_SHARE = 0.1
"""Largest error of the weight of a load that is stated or was estimated, as a share of it [1].

An estimate of one lift was within 5 % in the virtual lab (`research.evidence mission`). The smaller this is, the
lighter a load may be whose fall is found."""

MODEL_INERTIA_ERROR_SHARE = 0.4
"""Largest error of the inertia that the model states, as a share of it [1]."""

FORCE_WEIGHT_SHARE = 0.2
"""Share of the weight that the wearer carries which is added to both tolerances of the force sensor [1]."""

DRIVE_TOLERANCE_SHARE = 0.05
"""Largest error of the drive's measured effort, as a share of the law's effort limit [1].

It applies to a measurement with the default offset and noise of `Instruments`; larger stated values are added."""

DRIVE_NOISE_FACTOR = 3.0
"""Standard deviations of the drive's noise that are added to the tolerance beyond the usual noise [1].

White noise exceeds three in one period of 370, and in four in a row, which make a fault, once in 2e10 periods."""

DRIVE_LAG_FACTOR = math.log(10.0)
"""Time for which a slow measurement may stand outside the tolerance, over its lag beyond the usual lag [1].

In that time a tenth is left of a step of the command. It is never less than half a wave of the start-up test, which
such a measurement follows outside the tolerance. Without that, six of nine lives whose measurement was 7 ms late had an
alarm, on robots of 20261101 to 20261103. With it none of 48 lives of 40 s had one, with lags of 3, 7, 12 and 20 ms on
robots of 20261101 to 20261106."""

DRIVE_RESPONSE_S = 4.5e-3
"""How late the measured effort of a usual drive follows its command: a dead cycle, the current loop, the hold and the
lag of the measurement [s]."""

DRIVE_SURPLUS_TRAVEL = 0.005
"""Energy that a drive may give beyond its command: the work of the effort limit over this distance [rad or m]."""

DRIVE_FORGET_S = 10.0
"""Time constant with which the energy that a drive gave beyond its command is forgotten."""

DRIVE_DELAY_S = 0.012
"""Largest delay of a drive's response to its command, in addition to a period [s]: half of a fault of 20 ms or more,
and six times the lag of a slow measurement."""

DRIVE_DELAY_RATE_SHARE = 0.08
"""Smallest standard deviation of the command's rate to check that delay, as a share of the limit of effort [1/s].

Noise of a hundredth of the limit, read every 2 ms, then leaves a standard error of 2.5 ms."""

DRIVE_DELAY_SMOOTHING = 20.0
"""Bandwidth of the command used to check a delay [rad/s]: a delay of 20 ms is 0.4 rad there. At 60 rad/s the estimated
delay is too short, and the fault was detected in one of 16 runs."""

DRIVE_DELAY_FORGET = 0.4
"""Rate at which what was seen of a drive's delay is forgotten [1/s]."""

DRIVE_DELAY_SHARE = 0.5
"""Share of what is wrong with a drive's answer that being late must explain [1]. Several joints need none: their
commands vary enough."""

TEST_ACCELERATION = 50.0
"""Acceleration that the wave of the start-up test causes beyond friction [rad/s^2 or m/s^2].

The larger it is, the less tremor and friction change its work. On 399 foreign plants of 20261103, commissioned on other
wearers, 99 % of healthy robots did at most 2.09 times their work with 30 rad/s^2, and 1.70 times with this; drives with
three times the effort did at least 1.69 and 2.11 times."""

SLOW_TEST_ACCELERATION = 30.0
"""The same where the law's limit of rate would keep the effort behind a larger wave, so that it were still pushing when
the wave ends [rad/s^2 or m/s^2]."""

MIN_TEST_WORK_SHARE = 0.1
"""Half a wave must do at least this share of the smallest work on the robot alone; with an arm the robot moves less
[1]."""

MAX_TEST_WORK_RATIO = 2.5
"""Half a wave may do at most this multiple of the work on the robot without friction [1].

A light rotor before a soft transmission moves more than the robot as one rigid body would: 800 foreign plants of
20261101 and 20261103 did at most 2.40 of it."""

KNOWN_FRICTION_SHARE = 0.7
"""The body's friction is at least this share of the true friction of a moving joint, as the core assumes [1]."""

TEST_GROWTH_FACTOR = 1.1
"""Effort and duration of the wave grow by this factor until the encoder resolves the motion that it causes [1]."""

MIN_TEST_TRAVEL_READINGS = 4.0
"""The wave must move a robot with the largest believable friction by this many errors of one encoder reading [1]."""

FRICTION_POWERS: Mapping[str, tuple[float, float]] = {
    "coulomb": (0.0, 0.0), "load": (0.0, 1.0), "viscous": (1.0, 0.0), "square_root": (0.5, 0.0),
}  # fmt: skip
"""Powers of speed and load in each friction term of the supervisor's body."""

COMMISSIONED_WORK_BOUNDS = (0.2, 1.75)
"""Bounds of the test's work relative to its work at commissioning, for any wearer [1].

On foreign plants of 20261101 to 20261106, healthy drives did at most 2.3 in one wave. The least of five exceeded 1.75
in 0.4 % under the law with the weakest wave, and never under others. Drives with three times the effort did at least
1.87, and 1.72 on a heavy leg."""

RINGING_LIMIT_SHARE = 0.138
"""Largest mean effort at frequencies above those of human motion, as a share of the law's effort limit [1]."""

REVERSAL_SPEED_SHARE = 0.1
"""Speeds up to this share of the velocity limit count as a reversal, where friction changes within the ringing band
[1]."""

REVERSAL_RINGING_SHARE = 0.22
"""Mean effort in the ringing band due to compensated friction, relative to the effort's change at a reversal [1].

The joint reverses four times a second: 4/s (1/20 - 1/100) s, and a third more for the variation around the mean.
"""

SHAKING_TIME_S = 0.016
"""Largest travel of an oscillation from turn to turn, over the velocity limit [s].

On 440 foreign plants of 20261101 and 20261103, in 55 h, wearers who reach, stop suddenly, hit things and have spasms
made four and five travels in a row of at most 0.055 rad, at a velocity limit of 8 rad/s. On those of 20261115, in 48 h,
one made four of 0.09 rad."""

SHAKING_SQUARE_S2 = 7e-4
"""Largest travel of an oscillation over the acceleration that the drive can give the robot [s^2]: a heavy robot and its
wearer oscillate less. The elbow's drive gives 190 rad/s^2, that of a leg of 44 N m 100 rad/s^2."""

MIN_SHAKING_SHARE = 0.5
"""Smallest travel, as a share of the one by the velocity limit [1]: with a quarter, no one of 48 legs was stopped in
4 h."""

ENERGY_STORE_SPEED_SHARE = 0.575
"""Size of the energy budget: the kinetic energy of robot and limb at this share of the velocity limit [1]."""

ENERGY_STORE_LIFT = 0.66
"""Added to the energy budget: the energy to lift the load that the wearer carries by this angle or distance [rad or
m]."""

POWER_LIMIT_SHARE = 0.5
"""Largest power of a command, as a share of effort limit times velocity limit [1]."""

ENERGY_BUDGET_POWER_SHARE = 0.01
"""Rate at which the energy budget refills, as a share of effort limit times velocity limit [1]."""

GRAVITY_SWING = 2.0
"""Largest difference of a joint's potential energy, over the largest effort of its gravity [rad].

It is that from straight down to straight up. Within a shorter range the difference is at most that range times the
effort."""

HOLD_DAMPING_SHARE = 0.05
"""Damping of a stop, as a share of the damping that would halve the velocity in two periods [1]."""

SUPERVISOR_NAMES: tuple[str, ...] = tuple(field.name for field in model_fields("supervisor"))
"""The supervisor's numbers, in the core's order."""


@dataclass(frozen=True)
class SupervisedLaw:
    """A control law with a supervisor, as `supervised` returns and as simulations and `export` use.

    Attributes
    ----------
    law : ControlLaw
        What it watches.
    supervision : mapping of str to float
        The supervisor's numbers by name, SI.

    Examples
    --------
    >>> import pellucid as pl
    >>> from pellucid.controllers.control_law import LAWS, ControlLaw
    >>> law = ControlLaw("joint", LAWS["joint"].defaults | {
    ...     "inertia": 0.05, "gravity_sine": 1.5, "velocity_width": 0.1, "effort_limit": 5.0, "rate_limit": 500.0,
    ...     "velocity_limit": 10.0, "position_min": -2.0, "position_max": 2.0, "max_age": 0.005, "period": 0.001})
    >>> safe = pl.supervised(law, start_up=False)
    >>> efforts = [safe.step(0.001 * i, 0.5) for i in range(100)]
    >>> round(efforts[-1], 3), safe.mode
    (0.719, 'running')
    >>> _ = safe.step(0.1, 2.5)
    >>> safe.fault, safe.enable
    ('jump', False)
    """

    law: ControlLaw
    supervision: Mapping[str, float]

    def __post_init__(self):
        if set(self.supervision) != set(SUPERVISOR_NAMES):
            wrong = sorted(set(self.supervision) ^ set(SUPERVISOR_NAMES))
            raise PellucidError(
                f"supervisor: found no number, or one too many, for {', '.join(wrong)}, expected one for each"
            )

    @property
    def kind(self) -> str:
        """Kind of the law, one of `LAWS`."""
        return self.law.kind

    @property
    def parameters(self) -> np.ndarray:
        """Parameters of the law, shape (k,), in the core's order."""
        return self.law.parameters

    @property
    def supervisor(self) -> np.ndarray:
        """The supervisor's numbers, shape (m,), in the core's order."""
        return np.array([self.supervision[name] for name in SUPERVISOR_NAMES])

    @property
    def values(self) -> Mapping[str, float]:
        """The law's numbers by name, SI."""
        return self.law.values

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of what `step` takes after the time, in order."""
        return self.law.sensors

    @property
    def sensed(self) -> bool:
        """Whether the law makes use of a force sensor."""
        return self.law.sensed

    @property
    def emg(self) -> bool:
        """Whether the law makes use of EMG."""
        return self.law.emg

    def changed(self, **supervision: float) -> SupervisedLaw:
        """The same law under a supervisor some of whose numbers are others, at rest.

        Parameters
        ----------
        **supervision : float
            By name, SI.

        Returns
        -------
        SupervisedLaw

        Raises
        ------
        PellucidError
            If the supervisor has no such number.
        """
        return replace(self, supervision={**self.supervision, **supervision})

    def start(self, *, single: bool = False) -> _core.Supervised:
        """One more of it at rest, to be stepped by itself; `single` in float32, as on a microcontroller."""
        return _core.supervised(self.kind, self.parameters, self.supervisor, single)

    @cached_property
    def _running(self) -> _core.Supervised:
        return self.start()

    def step(
        self,
        time: float,
        *samples: float | None,
        drive: float | None = None,
        joint: float | None = None,
        token: int = 0,
    ) -> float:
        """Run one control period.

        Parameters
        ----------
        time : float
            When everything was measured [s].
        *samples : float or None
            In the order of `sensors`, SI; None, NaN or missing: no valid reading.
        drive, joint : float or None
            The effort that the drive measures [N m, or N], and a second encoder at the joint [rad, or m].
        token : int
            The `challenge`, from an operator who asks for a reset; 0: nobody asks.

        Returns
        -------
        float
            Effort for the drive [N m, or N]; it must have no power unless `enable`.
        """
        return self._running.step(time, *samples, drive=drive, joint=joint, token=token)

    def stop(self) -> None:
        """From the next step on it stops, and stays stopped until a reset."""
        self._running.stop()

    def record(self, records: int, decimation: int = 1, after: int = 0) -> None:
        """Keep what was read, asked for and watched in the last periods; a stop of the supervisor freezes it.

        Parameters
        ----------
        records : int
            How many records are kept; 0: none.
        decimation : int
            Periods of one record. Of each watch a record keeps the period nearest to the threshold.
        after : int
            Records after the one in which the supervisor stops.
        """
        self._running.record(records, decimation, after)

    def incident(self, *, slides: bool = False) -> bytes:
        """Return what was recorded, as the bytes of a file that `pellucid.incident` reads; the record begins anew.

        Parameters
        ----------
        slides : bool
            Whether the joint is prismatic: positions are then in m and efforts in N.

        Returns
        -------
        bytes
            Content of the file, to be written as it is.
        """
        return self._running.incident(slides)

    @property
    def fault(self) -> str:
        """Why it stopped or goes on with less; "none" while all is well."""
        return self._running.fault

    @property
    def mode(self) -> str:
        """What it does: "start_up", "running", "degraded", "damped_stop", "zero" or "latched"."""
        return self._running.mode

    @property
    def enable(self) -> bool:
        """Whether the drive may have power."""
        return self._running.enable

    @property
    def challenge(self) -> int:
        """Token that a reset needs; 0 without a fault."""
        return self._running.challenge

    @property
    def probe_answer(self) -> tuple[float, ...] | None:
        """Answers to the probe's three waves since the start, real and imaginary parts; None before any is learnt.

        Those of a robot whose drive and encoder are known to be right are `Instruments.probe_answer`.
        """
        answer, windows = self._running.probe_answer
        return answer if windows else None

    @property
    def log(self) -> list[tuple[int, str, str]]:
        """The last faults, the latest first: period, fault, and what was then done."""
        return self._running.log


@with_checked_arguments
def supervised(
    law: ControlLaw,
    *,
    instruments: Instruments | None = None,
    body: Mapping[str, float] | None = None,
    start_up: bool = True,
    rest_friction: float | None = None,
    **supervision: float,
) -> SupervisedLaw:
    """Put a law under a supervisor whose thresholds follow from the law's body, limits and instruments.

    Without a fault the law's effort passes bit for bit. The supervisor answers a single fault of sensor, drive, wearer,
    clock or memory with a law that does without the lost sensor, a damped stop, or no effort and no power
    (docs/explanation/supervision.md).

    Parameters
    ----------
    law : ControlLaw
        A law that `controller` returned.
    instruments : Instruments or None
        What the robot measures, and how well; None: one encoder of ordinary resolution.
    body : mapping of str to float or None
        The robot without a wearer: inertia, gravity_sine, gravity_cosine, offset, coulomb, load, viscous, square_root,
        SI; missing numbers are 0. None takes the body from the law's own numbers. An inertia of 0 switches off the
        watches that need a model. A load that the law states is added.
    start_up : bool
        Whether a wave of effort tests polarity and gain at start-up. There is no test where the law's effort
        limit is too small to move the joint; the supervisor's number ``test_effort`` is then 0.
    rest_friction : float or None
        Friction of the joint at rest as it was identified, which the wave of that test must overcome [N m or N]; None
        takes the body's, of which a law that must not drive may carry less than there is.
    **supervision : float
        Numbers of the supervisor that replace those of the rules, by name, SI.

    Returns
    -------
    SupervisedLaw
        The supervised law, at rest.

    Raises
    ------
    PellucidError
        If the supervisor has no such number.

    Examples
    --------
    >>> import pellucid as pl
    >>> from pellucid.controllers.control_law import LAWS, ControlLaw
    >>> law = ControlLaw("joint", LAWS["joint"].defaults | {
    ...     "inertia": 0.05, "gravity_sine": 1.5, "velocity_width": 0.1, "effort_limit": 5.0, "rate_limit": 500.0,
    ...     "velocity_limit": 10.0, "position_min": -2.0, "position_max": 2.0, "max_age": 0.005, "period": 0.001})
    >>> safe = pl.supervised(law)
    >>> safe.supervision["raw_speed_limit"]
    10.0
    """
    if not isinstance(law, ControlLaw):
        raise ArgumentError(f"supervised: law: found {shown(law)}, expected what pellucid.controller returns")
    known = dict(body_of(law) if body is None else loaded_body(body, law))
    made = supervision_of(law, instruments or Instruments(), known, start_up, rest_friction)
    return SupervisedLaw(law, made).changed(**supervision)


def body_of(law: ControlLaw) -> dict[str, float]:
    """Return the robot without a wearer from a law's numbers, SI; numbers that the law lacks are 0.

    The body has inertia, gravity_sine, gravity_cosine, offset, and the friction terms of `FRICTION_POWERS`.
    """
    v = law.values

    def mean(name: str) -> float:
        both = [v[n] for n in (name, f"{name}_up", f"{name}_down", f"orthosis_{name}") if n in v]
        return sum(both) / len(both) if both else 0.0

    gravity = "orthosis_gravity" if "orthosis_gravity" in v else None
    # A law of position control has no inertia, but its stiffness is the inertia times the squared bandwidth.
    inertia = max(mean("inertia"), 0.0) or v.get("stiffness", 0.0) / LOOP_BANDWIDTH**2
    body = {
        "inertia": inertia + v.get("actuator_inertia", 0.0),
        "gravity_sine": (v[gravity] if gravity else mean("gravity_sine")) - law.supported,
        "gravity_cosine": mean("gravity_cosine"),
        "offset": v.get("offset", 0.0),
    }
    return body | body_friction(law, weight_of(body))


def loaded_body(body: Mapping[str, float], law: ControlLaw) -> dict[str, float]:
    """Return a robot's `body` with the load that a law states, SI."""
    made = dict(body)
    if law.load is not None:
        made["inertia"] = made.get("inertia", 0.0) + law.load.inertia
        made["gravity_sine"] = made.get("gravity_sine", 0.0) + law.load.gravity()
    return made


def weight_of(body: Mapping[str, float]) -> float:
    """Return the largest effort of a body's gravity and offset, SI."""
    return math.hypot(body["gravity_sine"], body["gravity_cosine"]) + abs(body["offset"])


def carried_weight(values: Mapping[str, float], weight: float) -> float:
    """Return what a law of these `values` carries of the robot's `weight`, by its share of gravity and its limit."""
    return min(values.get("gravity_share", 1.0) * weight, values["effort_limit"])


def unheard_energies(numbers: Mapping[str, float]) -> tuple[float, float, float]:
    """Return the energies that faults of a drive may give over the way that it may go unheard [J].

    They are of a drive stuck at half of its largest effort, of a reversed one or one with three times the gain, and of
    one without effort, with the friction at the velocity limit. Without a probe the way is the range of positions, or
    1 rad or m where that is unlimited. `numbers` are those of a law and of its supervisor, by name.
    """
    body = {name.removeprefix("body_"): value for name, value in numbers.items() if name.startswith("body_")}
    weight, limit, travel = weight_of(body), numbers["effort_limit"], numbers["probe_travel"]
    if not numbers["probe_effort"] > 0.0:
        span = numbers["position_max"] - numbers["position_min"]
        travel = span if math.isfinite(span) else 1.0
    exchanged = numbers["push_limit"] - limit  # weight of the wearer that the law carries, or of the robot left
    speed = numbers["velocity_limit"]
    moving = body_resistance(body, speed, weight) if math.isfinite(speed) else math.inf
    largest = min(carried_weight(numbers, weight) + moving + exchanged, limit)
    return stuck_effort(numbers["drive_limit"], limit) * travel, 2.0 * largest * travel, largest * travel


def body_friction(law: ControlLaw, weight: float) -> dict[str, float]:
    """Return the friction in a law's numbers, by the terms of `FRICTION_POWERS`, SI.

    A term with other powers is added to the term with the next lower power of speed, with its value at the velocity
    limit and under the whole `weight` [effort], so that friction is never underestimated.
    """
    made, fastest = dict.fromkeys(FRICTION_POWERS, 0.0), law.values["velocity_limit"]
    for (speed, load), value in friction_coefficients(LAWS[law.kind].fields, law.values).items():
        name = next((name for name, powers in FRICTION_POWERS.items() if powers == (speed, load)), None)
        if name is None and value > 0.0:
            if not math.isfinite(fastest):
                raise PellucidError(
                    f"supervisor: found friction with speed^{speed:g} and no velocity limit, expected a velocity limit"
                )
            lower = {n: power for n, (power, loaded) in FRICTION_POWERS.items() if power <= speed and loaded == 0.0}
            name = max(lower, key=lower.__getitem__)
            value = value * weight**load * fastest ** (speed - lower[name])
        if name is not None:
            made[name] += float(value)
    return made | {"load": min(made["load"], 1.0)}


def body_resistance(body: Mapping[str, float], speed: float, load: float) -> float:
    """Return the friction of a supervisor's `body` at a `speed` [rad/s or m/s] under a `load`, in the load's unit."""
    return sum(body.get(name, 0.0) * speed**power * load**loaded for name, (power, loaded) in FRICTION_POWERS.items())


@dataclass(frozen=True)
class StartUpWave:
    """The wave of effort that tests polarity and gain at start-up."""

    effort: float  # amplitude; 0 for no test [N m or N]
    samples: int  # number of periods in half a wave
    least: float  # smallest work of half a wave with the right polarity [J]
    most: float  # largest work of half a wave with the right gain [J]


def start_up_wave(
    inertia: float, friction: float, resolution: float, *, limit: float, rate: float, period: float
) -> StartUpWave:
    """Return the wave of the start-up test for a robot's `inertia` and its known `friction` at rest, SI.

    `limit` and `rate` limit the effort and its rate. The wave has no effort if the limit cannot move the robot by more
    than the encoder's `resolution` shows.
    """
    fewest, most = TEST_SAMPLE_BOUNDS
    samples = max(fewest, min(most, round(TEST_HALF_WAVE_S / period)))
    followed = rate * samples * period / math.pi
    quick, slow = (friction + a * inertia for a in (TEST_ACCELERATION, SLOW_TEST_ACCELERATION))
    effort = min(max(slow, min(quick, followed)), limit)
    largest = friction / KNOWN_FRICTION_SHARE
    work, travel = _half_wave(effort, samples, period, rate, largest, inertia)
    while travel < MIN_TEST_TRAVEL_READINGS * resolution and (effort < limit or samples < most):
        effort, samples = min(TEST_GROWTH_FACTOR * effort, limit), min(math.ceil(TEST_GROWTH_FACTOR * samples), most)
        work, travel = _half_wave(effort, samples, period, rate, largest, inertia)
    frictionless = 2.0 * (effort * samples * period / math.pi) ** 2 / inertia
    if travel < MIN_TEST_TRAVEL_READINGS * resolution:
        return StartUpWave(0.0, samples, MIN_TEST_WORK_SHARE * frictionless, MAX_TEST_WORK_RATIO * frictionless)
    return StartUpWave(effort, samples, MIN_TEST_WORK_SHARE * work, MAX_TEST_WORK_RATIO * frictionless)


def _half_wave(
    effort: float, samples: int, period: float, rate: float, friction: float, inertia: float
) -> tuple[float, float]:
    """Work [J] and way [rad or m] of half a wave on a robot at rest whose friction stands against it."""
    pushed = speed = work = travel = 0.0
    for i in range(samples):
        wanted = effort * math.sin(math.pi * (i + 1) / samples)
        pushed += max(-rate * period, min(rate * period, wanted - pushed))
        speed = max(speed + period * (pushed - friction) / inertia, 0.0)
        work += period * pushed * speed
        travel += period * speed
    return work, travel


def commissioned_bounds(answer: float) -> tuple[float, float]:
    """Return the smallest and largest work of the test's wave after a commissioning that gave `answer` [J]."""
    least, most = COMMISSIONED_WORK_BOUNDS
    return least * answer, most * answer


def encoder_watch(instruments: CompleteInstruments, low: float, high: float, period: float) -> dict[str, float]:
    """Return the numbers of the watch of a joint's encoders, whose law may go from `low` to `high`, SI."""
    return {
        "range_min": low - POSITION_RANGE_MARGIN,
        "range_max": high + POSITION_RANGE_MARGIN,
        "encoder_resolution": instruments.encoder_resolution,
        "freeze_speed": MAX_GRIP_DECELERATION * period + instruments.encoder_resolution / period,
        "freeze_samples": max(2.0, round(ENCODER_FREEZE_S / period)),
        "joint_expected": float(instruments.joint_encoder),
        "joint_tolerance": instruments.joint_tolerance,
    }


def drive_watch(instruments: CompleteInstruments, effort: float, period: float) -> dict[str, float]:
    """Return the numbers of the drive watch that follow from its measurement, SI, but for how late a drive may be.

    `effort` is the law's limit and `period` that of the control. The usual accuracy gives the usual numbers; what
    exceeds it widens them.
    """
    known = {field.name: field.default for field in model_fields("supervisor")}
    offset = max(instruments.drive_offset - DRIVE_OFFSET_SHARE * effort, 0.0)
    noise = max(instruments.drive_noise - DRIVE_NOISE_SHARE * effort, 0.0)
    lag = max(instruments.drive_lag - DRIVE_LAG_S, 0.0)
    slow = max(DRIVE_LAG_FACTOR * lag, TEST_HALF_WAVE_S) if lag > 0.0 else 0.0
    return {
        "drive_expected": float(instruments.drive),
        "drive_limit": instruments.drive_limit,
        "drive_answer": instruments.drive_answer,
        "drive_surplus": DRIVE_SURPLUS_TRAVEL * effort,
        "drive_gain": instruments.drive_gain_error,
        "drive_offset": instruments.drive_offset,
        "drive_forget": -math.expm1(-period / DRIVE_FORGET_S),
        "drive_delay_rate": DRIVE_DELAY_RATE_SHARE * effort,
        "drive_delay_smoothing": min(DRIVE_DELAY_SMOOTHING, 0.2 / period),
        "drive_delay_forget": min(DRIVE_DELAY_FORGET, 0.2 / period),
        "drive_tolerance": DRIVE_TOLERANCE_SHARE * effort + offset + DRIVE_NOISE_FACTOR * noise,
        "drive_share": min(known["drive_share"] + max(instruments.drive_gain_error - DRIVE_GAIN_ERROR, 0.0), 1.0),
        "drive_cycles": known["drive_cycles"] + math.ceil(slow / period),
    }


def unexplained_energy(
    body: Mapping[str, float], instruments: CompleteInstruments, *, span: float, speed: float, period: float
) -> float:
    """Return the largest energy that errors of a `body`'s model lend and take back [J], for the watch of the drive.

    `span` is the range of positions [rad or m] and `speed` the velocity limit [rad/s or m/s]; both may be infinite.
    The model may be wrong in weight and inertia. A velocity may be wrong by two errors of the encoder in two periods.
    """
    if not math.isfinite(speed):
        return math.inf
    swung = math.hypot(body["gravity_sine"], body["gravity_cosine"]) * min(span, GRAVITY_SWING)
    usual, blur = ENERGY_STORE_SPEED_SHARE * speed, instruments.encoder_resolution / period
    moving = body["inertia"] * usual * (0.5 * MODEL_INERTIA_ERROR_SHARE * usual + blur)
    return MODEL_WEIGHT_ERROR_SHARE * swung + moving


def supervision_of(
    law: ControlLaw,
    instruments: Instruments,
    body: Mapping[str, float],
    start_up: bool,
    rest_friction: float | None = None,
) -> dict[str, float]:
    """Return the supervisor's numbers by name, SI, by the rules of this file."""
    v, known = law.values, {field.name: field.default for field in model_fields("supervisor")}
    period, effort, speed = v["period"], v["effort_limit"], v["velocity_limit"]
    complete = instruments.completed(effort)
    force_offset = max(complete.force_offset - FORCE_OFFSET_SHARE * effort, 0.0)
    inertia = body["inertia"]
    weight = weight_of(body)
    friction = body_resistance(body, 0.0, weight)
    carried_share, reversing = v.get("friction_share", 1.0), friction
    if math.isfinite(speed):
        reversing = body_resistance(body, REVERSAL_SPEED_SHARE * speed, weight)
    # Weight that the law leaves to the wearer, because of its share of gravity or its effort limit.
    left = max(weight - carried_weight(v, weight), 0.0)
    # Weight that wearer and robot exchange: what the law leaves, or what it carries of the wearer.
    exchanged = left + law.supported + law.unstated
    load_weight = 0.0 if law.load is None else law.load.gravity()
    wrong_weight = (
        MODEL_WEIGHT_ERROR_SHARE * max(weight - load_weight, 0.0) + LOAD_WEIGHT_ERROR_SHARE * load_weight + law.unstated
    )
    made = {
        "raw_speed_limit": speed,
        **encoder_watch(complete, v["position_min"], v["position_max"], period),
        **{f"body_{name}": value for name, value in body.items()},
        "residual_bandwidth": min(known["residual_bandwidth"], 0.2 / period),
        "residual_slow": min(known["residual_slow"], 0.05 / period),
        "force_expected": float(law.sensed),
        "force_range": instruments.force_range,
        "force_quiet_samples": max(2.0, round(SENSOR_QUIET_S / period)),
        "muscle_expected": float(law.emg),
        "muscle_range": instruments.emg_range,
        "muscle_quiet_samples": max(2.0, round(SENSOR_QUIET_S / period)),
        **drive_watch(complete, effort, period),
        "drive_late": math.exp(-period / (DRIVE_RESPONSE_S + max(complete.drive_lag - DRIVE_LAG_S, 0.0))),
        "drive_delay": DRIVE_DELAY_S + period + max(complete.drive_lag - DRIVE_LAG_S, 0.0)
        if instruments.drive
        else math.inf,
        "drive_delay_share": DRIVE_DELAY_SHARE,
        "push_limit": effort + exchanged,
        "ringing_limit": max(
            RINGING_LIMIT_SHARE * effort, REVERSAL_RINGING_SHARE * 2.0 * min(carried_share * reversing, effort)
        ),
        **{f"ringing_{name}": min(known[f"ringing_{name}"], 0.2 / period) for name in ("slowest", "fastest", "memory")},
        "shaking_slow": min(known["shaking_slow"], 0.2 / period),
        "power_limit": effort * speed,
        "budget_power": 0.0,
        "test_rest": max(2.0, round(TEST_REST_S / period)),
        "rate_samples": max(10.0, round(RATE_WINDOW_S / period)),
        "rate_tolerance": RATE_TOLERANCE,
        "degrades": float(v.get("gravity_share", 1.0) > 0.5),
    }
    if instruments.shaking:
        usual, strongest = SHAKING_TIME_S * speed, instruments.drive_limit / inertia if inertia > 0.0 else math.inf
        made["shaking_limit"] = min(max(SHAKING_SQUARE_S2 * strongest, MIN_SHAKING_SHARE * usual), usual)
    if math.isfinite(speed):
        # The law may always use the power that carries weight and friction at the velocity limit.
        due = min(effort, weight - left + law.supported + body_resistance(body, speed, weight))
        made |= {
            "power_limit": max(POWER_LIMIT_SHARE * effort, due) * speed,
            "budget_power": ENERGY_BUDGET_POWER_SHARE * effort * speed,
        }
    if inertia > 0.0:
        sticking = friction if rest_friction is None else max(friction, rest_friction)
        wave = start_up_wave(
            inertia, sticking, complete.encoder_resolution, limit=effort, rate=v["rate_limit"], period=period
        )
        speeds_up = inertia * speed if math.isfinite(speed) else 0.0
        span = v["position_max"] - v["position_min"]
        unexplained = unexplained_energy(body, complete, span=span, speed=speed, period=period)
        unexplained += min(span, GRAVITY_SWING) * law.unstated
        torque, push = (
            max(share * effort + exchanged, speeds_up / duration + exchanged, acceleration * inertia + wrong_weight)
            for share, duration, acceleration in zip(
                (WEARER_TORQUE_SHARE, WEARER_PUSH_SHARE), WEARER_ACCELERATION_TIMES_S, WEARER_ACCELERATIONS, strict=True
            )
        )
        # A force sensor may contradict the model by its own error at the wearer's largest torque.
        lasting_error, burst_error = instruments.force_gain_error * torque, instruments.force_gain_error * push
        made |= {
            "raw_acceleration_limit": effort / (MIN_DRIVEN_INERTIA_SHARE * inertia),
            "wearer_torque": torque,
            "wearer_push": push,
            "force_tolerance": FORCE_TOLERANCE_SHARE * effort
            + FORCE_WEIGHT_SHARE * exchanged
            + force_offset
            + lasting_error
            + wrong_weight,
            "budget_store": inertia * (ENERGY_STORE_SPEED_SHARE * speed) ** 2
            + ENERGY_STORE_LIFT * left
            + min(span, GRAVITY_SWING) * (law.supported + law.unstated)
            if math.isfinite(speed)
            else math.inf,
            "force_burst": FORCE_BURST_SHARE * effort
            + FORCE_WEIGHT_SHARE * exchanged
            + force_offset
            + burst_error
            + wrong_weight,
            "force_excess": FORCE_EXCESS_SHARE * effort + force_offset + wrong_weight,
            "unexplained_limit": unexplained if law.sensed else math.inf,
            "unexplained_gain": min(instruments.force_gain_error, 1.0),
            "unexplained_offset": FORCE_OFFSET_SHARE * effort
            + force_offset
            + MODEL_WEIGHT_ERROR_SHARE * abs(body["offset"]),
            "hold_damping": HOLD_DAMPING_SHARE * inertia / period,
            "hold_limit": min(effort, 1.5 * weight + friction),
            "test_effort": wave.effort if start_up else 0.0,
            "test_samples": float(wave.samples),
            "test_least": wave.least,
            "test_most": wave.most,
        }
    answer = instruments.answer_to(made.get("test_effort", math.nan))
    if answer is not None:
        made["test_least"], made["test_most"] = commissioned_bounds(answer)
    if instruments.probe:
        resolution = complete.encoder_resolution
        made |= probe_numbers(
            inertia, resolution, limit=effort, period=period, speed_limit=speed, drive_limit=instruments.drive_limit,
            steady=min(carried_weight(v, weight) + friction, effort),
        )  # fmt: skip
        made |= commissioned_answers(instruments.answer_to_probe(made["probe_samples"] * period))
    if inertia > 0.0 and instruments.asks_at_rest:
        made |= {
            "still_samples": round(STILL_S / period),
            "still_effort": wave.effort,
            "still_half_wave": float(wave.samples),
        }
    return known | {name: float(value) for name, value in made.items()}
