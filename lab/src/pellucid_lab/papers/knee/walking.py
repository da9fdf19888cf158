"""A walking wearer under the laws of the thesis: a thigh that moves, ground under the foot, three speeds.

The thesis is about walking (title, 1.5, 4.2) and measures a leg whose thigh rests. Here wearers are identified sitting,
as in the thesis, and laws that are built from these cards alone are worn while walking. Strides are recorded (3.6 and
8.1 km/h of one person; 5.4 km/h is the slower recording played 1.5 times as fast) or generated where the recordings are
not on this machine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.supervised import SupervisedLaw
from pellucid.controllers.worn import watched_worn
from pellucid.study.pages.forest import Row, number_table
from pellucid.study.pages.page import Section

from ...knee.chosen_constants import chosen
from ...knee.identified_wearer import WearerCard
from ...knee.moving_thigh import LawWithFootSwitch, LawWithThighSensor, MovingThigh, thigh_trial, walking_thigh
from ...knee.rig import KneeRig
from ...knee.trial import Controller, run_trial
from ...knee.worn_compensator import WornCompensator
from ..figure import Reproduced, figure
from .controllers import BODY_LAW_WORDS, CONTROLLER_WORDS, BuiltController, controllers
from .residual import RECORDING_SEED, identify_by_name
from .swings import SETTLING_TIME_S, swing

WALKING_WEARERS = ("D8300", "D8301", "D8302")
"""Drawn wearers who walk; constants were chosen on wearers 101 to 106."""

WALKING_DURATION_S = 12.0
"""Duration of every session [s]."""

SITTING_CONDITION = "sitting"
"""Name of the condition in which the wearer swings the shank with the thigh at rest, as in the thesis."""

WALKING_SPEEDS: Mapping[str, tuple[float, bool]] = {"3.6": (1.0, False), "5.4": (1.5, False), "8.1": (1.0, True)}
"""Speed [km/h], with the pace at which a recording is played and whether it is that of the faster one."""

FREE_FOOT = "3.6.free_foot"
"""Name of the condition in which the ground pushes the foot at 3.6 km/h, but does not hold it."""

SITTING_LAWS = ("zero_impedance", "body", "residual_no_emg", "residual", "amplification")
"""Laws that know no thigh, as the thesis's chapter has them."""

THIGH_LAWS: Mapping[str, str] = {"body_thigh_sensor": "body", "residual_thigh_sensor": "residual"}
"""The same with an inertial sensor on the thigh, by the law that is extended."""

GAIT_LAWS: Mapping[str, str] = {"residual_walking_gate": "residual", "residual_foot_switch": "residual"}
"""Laws for a walking wearer, by the law that they extend: limits of power for walking, and a factor in stance."""

STANCE_FACTOR = 0.5
"""Factor in stance of the law that follows the gait's phase.

Over wearers 101 to 103 and three speeds none of 0, 0.25, 0.5 and 0.75 left less than 1 does; 0.75 is too near to 1."""

LAW_WORDS: Mapping[str, str] = {
    **{name: {**CONTROLLER_WORDS, **BODY_LAW_WORDS}[name] for name in SITTING_LAWS},
    "residual_no_emg": "residual compensator without EMG",
    "body_thigh_sensor": "body by model, thigh's motion carried",
    "residual_thigh_sensor": "residual compensator, thigh's motion carried",
    "residual_walking_gate": "residual compensator, limits for walking",
    "residual_foot_switch": "the same, half of it in stance",
}
"""Words for the laws, by their name in ids."""

EXTENDED_LAWS: Mapping[str, str] = {**THIGH_LAWS, **GAIT_LAWS}
"""Laws that are worn walking only, by the law that they extend."""

NO_PHASES = (0.0, 4.4)
"""Centre [rad] and angular frequency [rad/s] of a swing, which these laws do not use."""

_row = partial(figure, "knee.walking")


@dataclass(frozen=True)
class WalkedRow:
    """One law on one wearer in one condition, after `SETTLING_TIME_S`."""

    law: str  # name in `LAW_WORDS`
    subject: str
    condition: str  # `SITTING_CONDITION`, `FREE_FOOT` or a speed of `WALKING_SPEEDS`
    torque: float  # RMS of the strap's torque [N*m]
    stance: float = float("nan")  # the same while the foot bears weight [N*m]; NaN sitting
    swing: float = float("nan")  # the same while it does not [N*m]; NaN sitting
    error: float = float("nan")  # RMS of the knee from what was meant [rad]; NaN sitting
    fault: str = "none"  # fault of the law's gate at the end


def evaluate_walker(
    rig: KneeRig,
    name: str,
    *,
    speeds: Sequence[str] = tuple(WALKING_SPEEDS),
    laws: Sequence[str] = tuple(LAW_WORDS),
    duration: float = WALKING_DURATION_S,
) -> tuple[WalkedRow, ...]:
    """Identify a wearer sitting, and return what each law leaves sitting and at each speed; `duration` [s]."""
    seed = RECORDING_SEED if name in rig.subjects else int(name[1:])
    identified = identify_by_name(rig, name)
    rig, constants = identified.rig, chosen()
    card = identified.card(constants.emg)
    plain = tuple(law for law in SITTING_LAWS if law in {EXTENDED_LAWS.get(one, one) for one in laws})
    built = controllers(card, rig.period, NO_PHASES, constants, only=plain)
    made = []
    for law in laws:
        if law in EXTENDED_LAWS:
            continue
        controller = built[law].build()
        taken = swing(rig, name, seed, controller, duration=duration)
        torque = taken.truth.strap_torque[taken.time >= SETTLING_TIME_S]
        made.append(WalkedRow(law, name, SITTING_CONDITION, _rms(torque), fault=_fault(controller)))
    walk = partial(_walk, rig, name, seed, card, built)
    for speed in speeds:
        pace, running = WALKING_SPEEDS[speed]
        thigh = walking_thigh(
            1.0 / rig.period, duration, np.random.default_rng([seed, 3]), pace=pace, running=running
        )  # fmt: skip
        made += [walk(law, thigh, speed) for law in laws]
        if FREE_FOOT.startswith(speed) and "residual" in laws:
            made.append(walk("residual", thigh, FREE_FOOT, holds=0.0))
    return tuple(made)


def _walk(
    rig: KneeRig,
    name: str,
    seed: int,
    card: WearerCard,
    built: Mapping[str, BuiltController],
    law: str,
    thigh: MovingThigh,
    condition: str,
    holds: float = 1.0,
) -> WalkedRow:
    """Return what a law leaves of one wearer's walk; `holds` is a factor on what holds a loaded foot."""
    controller = built[EXTENDED_LAWS.get(law, law)].build()
    if law in THIGH_LAWS:
        controller = LawWithThighSensor(controller, card.coupling, thigh, rig.period)
    if law in GAIT_LAWS:
        assert isinstance(controller, WornCompensator)
        controller.core = watched_walking(controller.law).start()
        if law == "residual_foot_switch":
            controller = LawWithFootSwitch(controller, thigh, rig.period, STANCE_FACTOR)
    trial = thigh_trial(condition, rig.subjects[name], thigh, rig, holds)
    taken = run_trial(rig, trial, rng=np.random.default_rng([seed, 7]), controller=controller)
    judged = taken.time >= SETTLING_TIME_S
    torque, bearing = taken.truth.strap_torque, thigh.bearing > 0.5
    error = taken.truth.limb_position - thigh.flexion
    return WalkedRow(
        law, name, condition, _rms(torque[judged]), _rms(torque[judged & bearing]), _rms(torque[judged & ~bearing]),
        _rms(error[judged]), _fault(controller),
    )  # fmt: skip


def watched_walking(law: ControlLaw) -> SupervisedLaw:
    """Return a law that may give the power of both its limits together, effort and velocity, as walking asks for."""
    limit = law.values["effort_limit"] * law.values["velocity_limit"]
    return watched_worn(law).changed(power_limit=limit)


def _fault(controller: Controller | None) -> str:
    return str(getattr(controller, "fault", "none"))


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def source_of_strides() -> str:
    """Return in words where the strides are from."""
    return walking_thigh(100.0, 6.0, np.random.default_rng(1)).source


def walked(rows: Sequence[WalkedRow], law: str, condition: str) -> list[WalkedRow]:
    """Return the rows of one law in one condition, in the order of wearers."""
    return [row for row in rows if (row.law, row.condition) == (law, condition)]


def walking_rows(rows: Sequence[WalkedRow]) -> list[Reproduced]:
    """Return strap torque of zero-impedance mode, its share under each law, and how many sessions stopped, by speed."""
    made: list[Reproduced] = []
    source = source_of_strides() if rows else ""
    for condition in dict.fromkeys(row.condition for row in rows if row.condition != FREE_FOOT):
        plain = walked(rows, "zero_impedance", condition)
        where = condition if condition == SITTING_CONDITION else f"{condition} km/h"
        motion = "thigh at rest" if condition == SITTING_CONDITION else f"strides {source}"
        note = f"RMS; {len(plain)} simulated wearers; {motion}"
        words = f"Interaction torque, zero impedance, {where}"
        made.append(_row(f"{condition}.zero_impedance", words, "N*m", [row.torque for row in plain], None, note))
        for law, words in LAW_WORDS.items():
            own = walked(rows, law, condition)
            if law == "zero_impedance" or not own:
                continue
            ratios = [a.torque / b.torque for a, b in zip(own, plain, strict=True)]
            stopped = sum(row.fault != "none" for row in own)
            more = f"; stopped by its gate: {stopped} of {len(own)}"
            made.append(
                _row(
                    f"{condition}.{law}", f"Interaction torque as a share of zero impedance's, {words}, {where}", "1",
                    ratios, None, note + more,
                )
            )  # fmt: skip
    return made


def walking_section(rows: Sequence[WalkedRow]) -> Section:
    """Return the page's section on walking wearers."""
    found = {row.id: row for row in walking_rows(rows)}
    conditions = list(dict.fromkeys(row.condition for row in rows if row.condition != FREE_FOOT))

    def cell(law: str, condition: str) -> str:
        row = found.get(f"knee.walking.{condition}.{law}")
        if row is None:
            return "–"
        own = walked(rows, law, condition)
        stopped = sum(one.fault != "none" for one in own)
        return f"{row.ours:.2f} ({row.lower:.2f} to {row.upper:.2f})" + (f", {stopped} stopped" if stopped else "")

    table = [
        Row((words + (" (N·m)" if law == "zero_impedance" else ""), *(cell(law, c) for c in conditions)))
        for law, words in LAW_WORDS.items()
        if any(row.law == law for row in rows)
    ]
    heads = ("", *(c if c == SITTING_CONDITION else f"{c} km/h" for c in conditions))
    count = len({row.subject for row in rows})
    return Section(
        "walking",
        "The thesis's purpose: worn while walking",
        (
            "The thesis's title and aim are locomotion; its measurements are of a leg whose thigh rests. Here the "
            f"same laws, built from recordings of {count} sitting wearers, are worn on a thigh that moves, with ground "
            "under the foot. The residual compensator has the reproduction's constants, not those of an export. "
            f"Strides: {source_of_strides()}. Strap torque is that of zero impedance, and a share of "
            "it under each law; a session that a law's own gate stopped ends as zero impedance.",
        ),
        (number_table(heads, table, "Medians and ranges over wearers; the thesis prints no such figure."),),
    )  # fmt: skip
