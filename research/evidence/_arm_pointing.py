"""People who point with four joints, and adapt, in simulated robots with laws built from cards: duration, EMG/Acc,
torque.

Each robot is identified from its own recordings. Robots and people have held-out seeds; the same people
point at the same targets without a robot. The plant has effects that no card has: elastic cables, cuffs, a shoulder off
the robot's centre, reflexes, a carriage. Excitations are those of the joints' muscles: arms have no electrodes.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pellucid.study.results import ResultRow
from pellucid_lab.arm.card_law import CardLaw, card_of, identified, sensor_points
from pellucid_lab.arm.human_motion import JOINTS
from pellucid_lab.arm.pointing import PointingBlock, draw_targets, point
from pellucid_lab.arm.rig import able_arm, drawn_arms
from pellucid_lab.arm.wearer import drawn_people
from pellucid_lab.papers.able.arm_worn import LAWS, LAWS_WITH_FORCE_SENSOR, PUBLISHED_LAW
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

ROBOT_SEED, PERSON_SEED = 20261130, 20261131
"""Seeds of the robots, and of their wearers."""

ROBOT_COUNT = sized(2, smallest=1)
"""Number of robots."""

PEOPLE_PER_ROBOT = sized(3, smallest=1)
"""Number of people who wear each robot."""

TARGET_COUNT = sized(28, smallest=4)
"""Number of targets."""

ADAPTING_COUNT = sized(8, smallest=0)
"""Number of first movements that are excluded because people adapt in them."""

ASKED_SPEED_SHARE = 0.75
"""Share of the robot's largest joint velocities that people were asked to keep to, with and without it [1].

A law's supervisor stops at 1.5 times these velocities, which people of this model exceed at their own pace."""

MIN_JUDGED_COUNT = sized(8, smallest=2)
"""Smallest number of evaluated movements, if a block ended early."""

BOOTSTRAP_DRAWS = 2000
"""Number of resampled sets of pairs for an interval."""

KINDS = {"up": (True, False), "up_fast": (True, True), "down": (False, False), "down_fast": (False, True)}
"""Kinds of movement: whether upwards, and whether fast."""


def arm_pointing_rows() -> Iterator[ResultRow]:
    """Every figure of pointing with four joints."""
    robots = drawn_arms(able_arm(), ROBOT_COUNT, ROBOT_SEED)
    people = drawn_people(ROBOT_COUNT * PEOPLE_PER_ROBOT, PERSON_SEED)
    jobs = [(try_robot, rig, people[i * PEOPLE_PER_ROBOT : (i + 1) * PEOPLE_PER_ROBOT]) for i, rig in enumerate(robots)]
    pairs = [pair for found in ordered_results(jobs) for pair in found]
    yield _row("laws", len(LAWS), "1", f"{', '.join(LAWS)}; {len(pairs)} pairs of a person and a robot")
    for law in LAWS:
        done = [pair for pair in pairs if f"{law}.duration" in pair]
        stopped, gated = (sum(pair[f"{law}.{what}"] for pair in pairs) for what in ("stopped", "gate"))
        words = f"of {len(pairs)} pairs stopped by the law's supervisor ({gated:.0f}) or by an arm that left its plan"
        yield _row(f"{law}.stopped", stopped, "1", words)
        movements = sum(pair[f"{law}.made"] for pair in pairs)
        words = f"movements made, of {len(pairs) * TARGET_COUNT}; {len(done)} pairs made enough for evaluation"
        yield _row(f"{law}.movements", movements, "1", words)
        if not done:
            continue
        for what, (unit, words) in MEASURES.items():
            yield _mean(f"{law}.{what}", [pair[f"{law}.{what}"] for pair in done], unit, words)
        for kind in KINDS:
            words = (
                f"EMG/Acc of moving joints, {kind.replace('_', ', ')}, relative to no robot; {len(done)} evaluated "
                "pairs"
            )
            yield _mean(f"{law}.emg_per_acc.{kind}", [pair[f"{law}.{kind}"] for pair in done], "1", words)
            words = f"the same with both sides of every joint, {kind.replace('_', ', ')}"
            yield _mean(f"{law}.emg_per_acc_both.{kind}", [pair[f"{law}.{kind}.both"] for pair in done], "1", words)
    for law in LAWS:
        both = [(p[f"{law}.torque"], p[f"{PUBLISHED_LAW}.torque"]) for p in pairs
                if f"{law}.torque" in p and f"{PUBLISHED_LAW}.torque" in p]  # fmt: skip
        if law != PUBLISHED_LAW and both:
            ratios = [own / published for own, published in both]
            yield _mean(f"{law}.torque_over_{PUBLISHED_LAW}", ratios, "1", "interaction torque of the same pairs")


MEASURES = {
    "duration": ("%", "change of the movements' duration from no robot"),
    "peak_velocity": ("%", "change of the hand's peak velocity from no robot"),
    "corrections": ("1", "additional corrections per movement relative to no robot"),
    "torque": ("N*m", "RMS torque of the robot on the wearer's joints"),
    "torque_learnt": ("1", "the same in the evaluated movements over that in the first ones"),
}
"""What is measured of every law: unit and words."""


def try_robot(rig, people) -> list[dict[str, float]]:
    """Return every measure of some people in one robot, by law."""
    card = card_of(rig, identified(rig))
    return [_try_pair(rig, card, person, i) for i, person in enumerate(people)]


def _try_pair(rig, card, person, index: int) -> dict[str, float]:
    targets = draw_targets(TARGET_COUNT, np.random.default_rng([ROBOT_SEED, index]))
    asked = ASKED_SPEED_SHARE * np.array([rig.constants.joint[name].velocity for name in JOINTS])
    control, made, skip = point(rig, person, None, targets, seed=index, asked_speed=asked), {}, ADAPTING_COUNT
    for name, build in LAWS.items():
        points = sensor_points(person) if name in LAWS_WITH_FORCE_SENSOR else None
        law = CardLaw(build(card), points)
        block = point(rig, person, law, targets, seed=index, asked_speed=asked)
        made |= {f"{name}.stopped": float(block.stopped), f"{name}.made": float(len(block.movements))}
        made[f"{name}.gate"] = float(law.stopped_by != "none")
        if len(block.movements) < skip + MIN_JUDGED_COUNT:
            continue
        same = PointingBlock(control.movements[: len(block.movements)], control.stopped)
        made |= {f"{name}.{what}": value for what, value in _measures(block, same, skip).items()}
    return made


def _measures(block: PointingBlock, control: PointingBlock, skip: int) -> dict[str, float]:
    def change(what: str) -> float:
        return 100.0 * (block.mean(what, skip=skip) / control.mean(what, skip=skip) - 1.0)

    first = PointingBlock(block.movements[: max(skip, 2)], stopped=False)
    made = {
        "duration": change("duration"), "peak_velocity": change("peak_velocity"),
        "corrections": block.mean("corrections", skip=skip) - control.mean("corrections", skip=skip),
        "torque": block.mean("interaction", skip=skip),
        "torque_learnt": block.mean("interaction", skip=skip) / first.mean("interaction"),
    }  # fmt: skip
    for kind, (upward, fast) in KINDS.items():
        how = {"upward": upward, "fast": fast, "skip": skip}
        made[kind] = block.emg_per_acceleration(control, **how)
        made[f"{kind}.both"] = block.emg_per_acceleration(control, both_sides=True, **how)
    return made


def _mean(name: str, values: list[float], unit: str, words: str) -> ResultRow:
    known = np.array([v for v in values if np.isfinite(v)])
    if not len(known):
        return ResultRow(f"mission.arm_pointing.{name}", None, unit, "evidence", "simulated", None, words)
    picks = np.random.default_rng(PERSON_SEED).choice(known, (BOOTSTRAP_DRAWS, len(known))).mean(axis=1)
    low, high = np.quantile(picks, (0.025, 0.975))
    return _row(name, known.mean(), unit, f"{words}; mean of {len(known)}, 95 % interval {low:.3g} to {high:.3g}")


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"mission.arm_pointing.{name}", float(value), unit, "evidence", "simulated", None, note)
