"""The residual compensator of one wearer: designed with margins, and put under a supervisor of a spring's drive."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from .control_law import ControlLaw, Limits
from .coupling import Coupling
from .instruments import CompleteInstruments, Instruments
from .residual_compensator import ResidualDesign, design, within
from .supervised import SupervisedLaw, body_of, supervised

WORN_ENCODER_RESOLUTION = 1e-3
"""Error of one reading of the output's encoder if none is stated [rad]."""

SPRING_TOLERANCE = 0.5
"""Largest difference between the spring's torque and its command, as a share of the law's effort limit [1]; the dry
friction of the drive before the spring is added, against which its torque loop may not follow."""

SPRING_INERTIA_FACTOR = 1.4
"""Largest ratio of the inertia that the drive's torque loop leaves to the one on the card [1].

The inertia takes energy while a leg speeds up and returns it while the leg slows down, whatever the command. With an
account of it by the motor's own encoder healthy starts on 80 foreign drives of 20261103 and 20261105 to 20261107 came
to at most a quarter of the energy that any drive may add; without the account to twenty times as much."""

SURPLUS_TRAVEL_WITHOUT_MOTOR_ENCODER = 0.02
"""Energy that a drive before a spring may give beyond its command if no encoder is the motor's: the work of the effort
limit over this distance [rad].

The joint's velocity then stands for the motor's, from which it differs while the spring bends. Healthy starts on the
drives of `SPRING_INERTIA_FACTOR` came to 0.12 J, with an effort limit of 10 N m."""

SPRING_FRICTION_FACTOR = 1.4
"""Largest ratio of that friction to the one on the card [1].

A law that does not swing does not shake a drive loose. On 300 foreign drives of 20261103 and 20261105 to 20261107 five
stuck beyond the tolerance with 1.0, all of the roughest ones, and none with this."""

SPRING_SHARE = 0.25
"""Further difference allowed, as a share of the command [1]."""

SPRING_LAG = 0.04
"""Time for which the difference may exceed both [s]. Twenty sampled wearers exceeded them for at most two thirds of it.
"""

SPRING_LATE = 0.024
"""Delay of a spring's response [s]. While a strap crosses its slack the command turns faster than that. Counted against
the command at once those wearers got up to 2.0 of the energy that a drive may add, counted so late 0.5 of it."""


SPRING_OFFSET_SHARE = 0.002
"""Offset of a spring's measured torque that is no fault, as a share of the law's limit of effort [1].

A spring is tared where it is slack. A knee's command is small against its limit: with the 0.01 of other drives one of
six drives with three times the effort was not found within 10 s and gave 2.9 J. With 0.002 all of 40 were found, after
0.7 J at most. Healthy springs whose reading was off by 0.01 of the limit had no alarm in 3.2 h."""


def completed_by_spring(instruments: Instruments, effort_limit: float) -> CompleteInstruments:
    """Return the instruments of a drive with a spring with a number for each accuracy that is not stated.

    `effort_limit` is the law's [N m].
    """
    return instruments.completed(
        effort_limit, encoder_resolution=WORN_ENCODER_RESOLUTION, drive_offset_share=SPRING_OFFSET_SHARE
    )


def watched_worn(
    law: ControlLaw, instruments: Instruments | None = None, *, actuator: Mapping[str, float] | None = None
) -> SupervisedLaw:
    """Return a worn law under a supervisor whose thresholds follow from its limits and its `instruments`.

    The law commands the torque of a series spring. If the drive is measured, the measurement is the spring's torque. A
    second encoder is on the motor, the first on the output: both differ by the twist of the spring, whose stiffness the
    instruments state. None are an output encoder alone.

    Raw data, command and memory are checked. No model check applies to the motion, because the strap adds to it. EMG
    may come and go, and its noise in the command does not count as ringing. The wave of a test at start-up
    would meet the spring's own torque loop. `actuator` has the drive's ``actuator_coulomb`` and
    ``actuator_inertia``, SI, for a law without these numbers; what neither has is 0.
    """
    effort, period, more = law.values["effort_limit"], law.values["period"], {}
    drive = {**(actuator or {}), **law.values}
    measured = completed_by_spring(instruments or Instruments(), effort)
    if measured.spring_stiffness is not None:
        twist = 2.0 * effort / measured.spring_stiffness
        measured = replace(measured, joint_tolerance=max(measured.joint_tolerance, twist))
    if measured.drive:
        more = {
            "drive_tolerance": SPRING_TOLERANCE * effort + SPRING_FRICTION_FACTOR * drive.get("actuator_coulomb", 0.0),
            "drive_inertia": SPRING_INERTIA_FACTOR * drive.get("actuator_inertia", 0.0),
            **({} if measured.joint_encoder else {"drive_surplus": SURPLUS_TRAVEL_WITHOUT_MOTOR_ENCODER * effort}),
            "drive_share": SPRING_SHARE,
            "drive_cycles": float(round(SPRING_LAG / period)),
            "drive_late": math.exp(-period / SPRING_LATE),
        }
    nothing = dict.fromkeys(body_of(law), 0.0)
    # A spring's own loop is as late as a late drive, and foreign ones cannot be told from it while they are worn.
    more |= {"muscle_expected": 0.0, "ringing_limit": math.inf, "drive_delay": math.inf}
    return supervised(law, instruments=measured, body=nothing, start_up=False).changed(**more)


MIN_GAIN_MARGIN_DB = 6.0
"""Gain margin that the loop keeps with every strap of `STRAP_FACTORS` [dB]."""

MIN_DELAY_MARGIN_S = 0.020
"""Delay margin that the loop keeps with every strap of `STRAP_FACTORS` [s]."""

STRAP_FACTORS = (0.7, 1.6)
"""Factors on the identified stiffness and damping of the strap, in every combination [1].

A strap hardens as it is pulled. With 1.3 the loop swung by itself on two of ten foreign straps of 20261101, which are
0.7 to 1.4 times as stiff as identified and twice as stiff at 0.05 to 0.12 rad."""

INERTIA_FACTORS = (0.7, 1.4)
"""Factors on the identified inertia of the orthosis with which the loop still comes to rest, on every such strap [1].

Without them the loop swung at its limit of rate, at 7 to 13 Hz, on 11 of 300 foreign orthoses of 20261103 and 20261105
to 20261107, and their drive's watch stopped it. They do not follow from the card's interval, which says how well
recordings of the empty orthosis tell its inertia, and nothing of a shell, a cuff or a longer shank that is put on
later. Nor may a loop swing on each tenth wearer, whose interval does not hold."""


def other_straps(coupling: Coupling) -> list[Coupling]:
    """Return the identified coupling and those with the straps of `STRAP_FACTORS`."""
    straps = [coupling.scaled(strap_stiffness=k, strap_damping=b) for k in STRAP_FACTORS for b in STRAP_FACTORS]
    return [coupling, *straps]


def other_orthoses(coupling: Coupling) -> list[Coupling]:
    """Return those of `other_straps`, and each with the inertias of `INERTIA_FACTORS`."""
    straps = other_straps(coupling)
    return [*straps, *(one.scaled(orthosis_inertia=factor) for one in straps for factor in INERTIA_FACTORS)]


def design_worn_law(coupling: Coupling, period: float, limits: Limits | None = None) -> ResidualDesign:
    """Return the residual compensator of one wearer, weakened until it is safe with other straps and orthoses.

    Parameters
    ----------
    coupling : Coupling
        Orthosis, actuator, strap and limb as they were identified.
    period : float
        Control period [s].
    limits : Limits, optional
        Limits of the safety gate, which the study states.
    """
    return within(
        design(coupling, period, limits=limits),
        other_straps(coupling),
        gain_db=MIN_GAIN_MARGIN_DB,
        delay=MIN_DELAY_MARGIN_S,
        wrong_plants=other_orthoses(coupling),
    )
