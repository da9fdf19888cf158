"""Amplitude and window of the supervisor's probe, from the body, the encoder, the control period and the limit.

The probe is a small wave of effort with three frequencies. The encoder's acceleration must answer it, so that a
reversed, dead, late or wrongly scaled drive or encoder is found without a measurement of the drive.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from .._errors import PellucidError

PROBE_WINDOW_S = 0.12
"""Duration of a window of the probe; its waves have 42, 75 and 108 Hz, above strap and ringing band."""

MAX_PROBE_PERIOD_S = 0.002
"""Longest control period at which a law may probe: the highest wave then has more than four samples a cycle."""

MAX_PROBE_SHARE = 0.1
"""Largest value of the whole wave, as a share of the law's effort limit [1]."""

PROBE_CREST = math.sqrt(5.0)
"""Largest value of the whole wave, relative to the amplitude of one of its three waves [1]."""

PROBE_CYCLES = (5, 9, 13)
"""Number of cycles of each wave in a window, as in the core."""

PROBE_ACCELERATION = 6.0
"""Amplitude of the acceleration that each wave would cause on the robot as one rigid body [rad/s^2 or m/s^2]. It is
less where the wave would be above `MAX_PROBE_SHARE`."""

MIN_PROBE_ACCELERATION = 3.0
"""Smallest such acceleration, chosen by judgement: friction and motion hide less. With 4 rad/s^2 faults were found on
tuning robots; less was not tried [rad/s^2 or m/s^2]."""

PROBE_READING_ERRORS = 4.0
"""Number of standard deviations of the encoder in `Instruments.encoder_resolution` [1]."""

MIN_PROBE_SIGNAL_TO_NOISE = 4.0
"""Smallest power of a window's lock-in over that of the encoder's noise, summed over the three waves [1]."""

PROBE_SPEED_MARGIN = 2.0
"""The joint moves if it is faster than this multiple of the speed that the whole wave causes [1]."""

MIN_PROBE_SPEED = 0.1
"""Speed below which friction may swallow the wave at any amplitude [rad/s or m/s]."""


MAX_UNHEARD_S = 0.1625
"""Time at the velocity limit whose way is the longest that the joint may go while its drive is not heard.

It is 1.3 rad for a limit of 8 rad/s, a fifth more than healthy wearers needed on foreign plants of the tuning seeds."""


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


def probe_signal_to_noise(amplitude: float, inertia: float, resolution: float, period: float) -> float:
    """Return the power of a window's lock-in over that of the encoder's noise, summed over the three waves [1].

    `amplitude` [N m or N] is that of each wave; all others are SI.
    """
    samples = probe_samples(period)
    total = 0.0
    for cycles in PROBE_CYCLES:
        noise = resolution / PROBE_READING_ERRORS * 2.0 * (1.0 - math.cos(2.0 * math.pi * cycles / samples))
        total += (0.25 * samples * amplitude) ** 2 / (0.375 * samples * (inertia * noise / period**2) ** 2)
    return total


def probe_samples(period: float) -> int:
    """Return the number of periods in a window, which is even."""
    return 2 * round(0.5 * PROBE_WINDOW_S / period)


def probe_numbers(
    inertia: float, resolution: float, *, limit: float, period: float, speed_limit: float = math.inf
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
    speed_limit : float
        Velocity limit of the law [rad/s or m/s]; infinite where it has none, and the way is not bounded then.

    Raises
    ------
    PellucidError
        If the control rate is below 500 Hz, the inertia is not known, or the wave that the encoder can resolve is
        larger than a tenth of the effort limit.
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
            f"probe: found a wave of {PROBE_CREST * needed:.3g} (SI) that inertia and encoder need, expected at most a "
            f"tenth of the effort limit, {MAX_PROBE_SHARE * limit:.3g}"
        )
    amplitude = max(needed, min(wanted, largest))
    samples = probe_samples(period)
    slowest = 2.0 * math.pi * PROBE_CYCLES[0] / (samples * period)
    speed = PROBE_CREST * amplitude / (inertia * slowest)
    return {
        "probe_effort": amplitude,
        "probe_samples": float(samples),
        "probe_inertia": inertia,
        "probe_noise": resolution / PROBE_READING_ERRORS,
        "probe_moving": max(MIN_PROBE_SPEED, PROBE_SPEED_MARGIN * speed),
        "probe_travel": MAX_UNHEARD_S * speed_limit,
    }
