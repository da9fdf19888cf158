"""A walking wearer under transparency laws: a thigh that moves, ground under the foot, three speeds.

Strides are recorded (3.6 and 8.1 km/h of one person; 5.4 km/h is the slower recording played 1.5 times as fast), people
and orthoses drawn with seeds on which nothing was chosen. Every wearer is identified as in the paper, sitting with the
thigh at rest, and every law is built from these cards alone. The plant has what no law knows: a thigh that turns and
accelerates, a foot that the ground pushes and holds, an elastic drive with its torque loop, friction, a strap that
hardens, relaxes and slips, muscles that tire. It shares with the laws that bodies are rigid.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
from benchmarks._size import sized

from pellucid._processes import ordered_results
from pellucid.lab.knee.chosen_constants import chosen
from pellucid.lab.knee.drawn import drawn_rig
from pellucid.lab.knee.identified_wearer import WearerCard, identify_wearer_of
from pellucid.lab.knee.moving_thigh import LawWithThighSensor, MovingThigh, thigh_trial, walking_thigh
from pellucid.lab.knee.rig import KneeRig, knee_orthosis
from pellucid.lab.knee.trial import run_trial
from pellucid.papers.knee.controllers import controllers
from pellucid.papers.knee.swings import swing
from pellucid.studies.results import ResultRow

from ._loads import mean_interval, ratio_interval

SEED = 8300
"""First seed of the drawn wearers; constants were chosen on wearers 101 to 106."""

WEARER_COUNT = sized(3, smallest=1)
"""Number of wearers, each with an orthosis of their own."""

DURATION_S = sized(12.0, smallest=6.0)
"""Duration of every session [s]."""

SETTLING_S = 4.0
"""First part of a session that is not judged [s]."""

SPEEDS: Mapping[str, tuple[float, bool]] = {"3.6": (1.0, False), "5.4": (1.5, False), "8.1": (1.0, True)}
"""Speed [km/h], with the pace at which a recording is played and whether it is that of the faster one."""

LAWS = ("zero_impedance", "body", "residual_no_emg", "residual", "amplification")
"""Laws that know no thigh, as the paper's chapter has them."""

THIGH_LAWS = {"body_thigh_sensor": "body", "residual_thigh_sensor": "residual"}
"""The same with an inertial sensor on the thigh, by the law that is extended."""

NO_PHASES = (0.0, 4.4)
"""Centre [rad] and angular frequency [rad/s] of a swing, which these laws do not use."""


def walking_rows(count: int = WEARER_COUNT) -> Iterator[ResultRow]:
    """Every figure of walking wearers."""
    tried = ordered_results([(try_walker, SEED + i) for i in range(count)])
    found = {key: np.array([one[key] for one in tried]) for key in tried[0]}
    names = (*LAWS, *THIGH_LAWS)
    source = walking_thigh(100.0, 6.0, np.random.default_rng(1)).source
    yield _row("speeds", len(SPEEDS), "1", f"{', '.join(SPEEDS)} km/h; {source}")
    yield _row("laws", len(names), "1", ", ".join(names))
    for speed in ("sitting", *SPEEDS):
        base = found[f"{speed}.zero_impedance"]
        low, high = mean_interval(base, SEED)
        note = f"RMS strap torque without control, {speed}; {count} wearers, 95 % interval {low:.2f} to {high:.2f}"
        yield _row(f"{speed}.zero_impedance", base.mean(), "N*m", note)
        for name in names[1:]:
            if (speed, name) not in {("sitting", law) for law in THIGH_LAWS}:
                yield _ratio(f"{speed}.{name}", found[f"{speed}.{name}"], base, f"{name} over zero impedance, {speed}")
    for speed in SPEEDS:
        stance, swing_ = (found[f"{speed}.residual.{part}"] for part in ("stance", "swing"))
        yield _ratio(f"{speed}.stance_over_swing", stance, swing_, "residual law, RMS in stance over that in swing")
        emg = found[f"{speed}.residual"]
        yield _ratio(f"{speed}.emg", emg, found[f"{speed}.residual_no_emg"], "residual law over the same without EMG")
        for name in ("zero_impedance", "residual", "residual_thigh_sensor"):
            error = found[f"{speed}.{name}.error"]
            yield _row(f"{speed}.{name}.error", np.degrees(error.mean()), "deg", "RMS of knee from what was meant")
    free = found["3.6.free_foot"]
    yield _ratio("free_foot", free, found["3.6.residual"], "residual law at 3.6 km/h, ground that holds no foot")
    for speed in SPEEDS:
        for name in names[1:]:
            stopped = found[f"{speed}.{name}.stopped"].sum()
            yield _row(f"{speed}.{name}.stopped", stopped, "1", f"sessions of {count} that the law's gate stopped")
    sessions = count * (len(names) * len(SPEEDS) + 1)
    yield _row("stopped", sum(one["faults"] for one in tried), "1", f"sessions of {sessions} that a gate stopped")


def try_walker(seed: int) -> dict[str, float]:
    """Return RMS strap torques [N*m] and errors [rad] by speed and law of one wearer, and how many sessions stopped."""
    rig, name, constants = drawn_rig(knee_orthosis(), seed), f"D{seed}", chosen()
    card = identify_wearer_of(rig, name, seed).card(constants.emg)
    built = controllers(card, rig.period, NO_PHASES, constants, only=LAWS)
    made: dict[str, float] = {"faults": 0.0}
    for law in LAWS:
        taken = swing(rig, name, seed, built[law].build(), duration=DURATION_S)
        made[f"sitting.{law}"] = _rms(taken.truth.strap_torque[taken.time >= SETTLING_S])
    for speed, (pace, running) in SPEEDS.items():
        rate = 1.0 / rig.period
        thigh = walking_thigh(rate, DURATION_S, np.random.default_rng([seed, 3]), pace=pace, running=running)
        for law in (*LAWS, *THIGH_LAWS):
            made |= _walk(rig, name, card, built, law, thigh, f"{speed}.{law}", made, seed)
    thigh = walking_thigh(1.0 / rig.period, DURATION_S, np.random.default_rng([seed, 3]))
    made |= _walk(rig, name, card, built, "residual", thigh, "3.6.free_foot", made, seed, holds=0.0)
    return made


def _walk(
    rig: KneeRig,
    name: str,
    card: WearerCard,
    built,
    law: str,
    thigh: MovingThigh,
    key: str,
    made,
    seed: int,
    holds: float = 1.0,
) -> dict[str, float]:
    controller = built[THIGH_LAWS.get(law, law)].build()
    if law in THIGH_LAWS:
        controller = LawWithThighSensor(controller, card.coupling, thigh, rig.period)
    trial = thigh_trial(key, rig.subjects[name], thigh, rig, holds)
    taken = run_trial(rig, trial, rng=np.random.default_rng([seed, 7]), controller=controller)
    judged = taken.time >= SETTLING_S
    torque, bearing = taken.truth.strap_torque, thigh.bearing > 0.5
    error = taken.truth.limb_position - thigh.flexion
    fault = "none" if controller is None else controller.fault
    return {
        key: _rms(torque[judged]), f"{key}.stance": _rms(torque[judged & bearing]),
        f"{key}.swing": _rms(torque[judged & ~bearing]), f"{key}.error": _rms(error[judged]),
        "faults": made["faults"] + (fault != "none"), f"{key}.stopped": float(fault != "none"),
    }  # fmt: skip


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _ratio(name: str, over: np.ndarray, under: np.ndarray, words: str) -> ResultRow:
    ratio, low, high = ratio_interval(over, under)
    note = f"{words}; {len(over)} wearers, 95 % interval {low:.3f} to {high:.3f}; {over.mean():.3f} N*m"
    return _row(name, ratio, "1", note)


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"mission.walking.{name}", float(value), unit, "evidence", "simulated", None, note)
