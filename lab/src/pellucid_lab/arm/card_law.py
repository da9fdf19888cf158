"""Laws of several joints as the virtual arm wears them, and the card that its own recordings give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib.metadata import version

import numpy as np

from pellucid.arm.fit.fit_tree import fit_best_model, make_tree_estimate
from pellucid.arm.fit.tree_estimate import TreeEstimate
from pellucid.arm.fit.tree_regression import collect_rows
from pellucid.arm.tree_motion import TreeMotion, tree_motion_of
from pellucid.controllers.tree_laws import TreeLaw
from pellucid.models.tree_card import JointRange, TreeCard
from pellucid.numerics.motion import Filtering

from .human_motion import JOINTS
from .protocol import ArmTrial
from .rig import ArmRig
from .wearer import HANDLE_AT, UPPER_CUFF_AT, Person

STUDY_FILTERING = Filtering(8.0, 4, 20, 0.05, 500)
"""Filters of the rig's study: low-pass [Hz], order, decimation, dead band [rad/s], trim [samples]."""

SENSOR_LINKS = (JOINTS.index("internal_rotation"), JOINTS.index("elbow_flexion"))
"""Indices of the links that bear the force sensors of cuff and handle."""

Point = tuple[float, float, float]


class CardLaw:
    """A controller built from a card, stepped with the arm's sensor readings; it implements `worn_trial.ArmLaw`.

    `points` are the positions of both force sensors in their links [m], which convert readings to joint torques.
    """

    def __init__(self, law: TreeLaw, points: tuple[Point, Point] | None = None):
        self.law, self.points = law, points
        self.reset()

    def reset(self) -> None:
        """One more of it, at rest."""
        self.running = self.law.start()

    @property
    def stopped_by(self) -> str:
        """Fault that the law has latched; "none" if there is none."""
        return str(self.running.fault)

    def step(self, time: float, position: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """Torque asked of each joint, shape (4,) [N m]."""
        if self.points is None:
            return self.running.step(time, position, wrench=wrench[1])
        return self.running.step(time, position, interaction=self.felt(position, wrench))

    def felt(self, position: np.ndarray, wrench: np.ndarray) -> np.ndarray:
        """What both force sensors read, at the joints, shape (4,) [N m]."""
        tree, felt = self.law.card.tree, np.zeros(len(JOINTS))
        frames = tree.placements(position)
        for link, point, read in zip(SENSOR_LINKS, self.points, wrench, strict=True):
            turn = frames[link, :, :3]
            jacobian = tree.jacobian(position, link, np.array(point))
            felt += jacobian[:3].T @ (turn @ read[:3]) + jacobian[3:].T @ (turn @ read[3:])
        return felt


def sensor_points(person: Person) -> tuple[Point, Point]:
    """Where the force sensors of cuff and handle are in the links of upper arm and forearm, as a tape finds it [m]."""
    return (0.0, 0.0, -round(UPPER_CUFF_AT * person.upper_arm, 2)), (0.0, 0.0, -round(HANDLE_AT * person.forearm, 2))


def motions_of(rig: ArmRig, trials: Sequence[ArmTrial], seed: int) -> list[TreeMotion]:
    """What recordings of `trials` are once they are made ready; `seed` draws the instruments' noise."""
    made, first = [], 0
    for trial, drawn in zip(trials, rig.draws(trials, seed), strict=True):
        (streams,) = rig.record(trial, **drawn).files.values()
        (stored,) = streams.values()
        motion = tree_motion_of(
            stored.values[:, 0], stored.values[:, 1:5] * rig.quanta, 1e-3 * stored.values[:, 5:9], STUDY_FILTERING,
            gain=rig.gains, recording=trial.name, use=trial.use, protocol=trial.protocol,
        )  # fmt: skip
        numbered = np.where(motion.segment < 0, -1, motion.segment + first)
        first = max(first, int(numbered.max(initial=-1)) + 1)
        made.append(replace(motion, segment=numbered))
    return made


def identified(rig: ArmRig, seed: int = 1) -> TreeEstimate:
    """The best model of an arm, of the recordings of its protocol that are fitted."""
    motions = motions_of(rig, [trial for trial in rig.trials(seed) if trial.use == "fit"], seed)
    rows = collect_rows(rig.robot, motions)
    _, _, found, at = fit_best_model(rows, motions[0].rate)
    return make_tree_estimate("best", rows, found, at)


def card_of(rig: ArmRig, estimate: TreeEstimate) -> TreeCard:
    """The card of a model of an arm."""
    said = [rig.constants.joint[name] for name in JOINTS]
    ranges = tuple(
        JointRange(s.low, s.high, s.velocity * 1.5, float(most), None, None, s.velocity)
        for s, most in zip(said, rig.limits, strict=True)
    )
    return TreeCard(
        study=rig.name,
        family=estimate.name,
        method=estimate.method,
        names=JOINTS,
        bodies=JOINTS,
        links=_rows(estimate.links()),
        gravity=tuple(float(x) for x in estimate.robot.tree.gravity),
        joints=_rows(estimate.joints()),
        turns=_rows(np.eye(len(JOINTS))),
        motors=(),
        gains=tuple(rig.gains.tolist()),
        gains_known=(True,) * len(JOINTS),
        drive_units=("A",) * len(JOINTS),
        effort_units=("N*m",) * len(JOINTS),
        ranges=ranges,
        families=estimate.families,
        consistent=estimate.name == "consistent",
        parameters=(),
        covariance=(),
        heldout_error=(),
        processing="in memory",
        confidence=0.95,
        notes=(),
        checksums={},
        pellucid=version("pellucid"),
    )


def _rows(values: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(map(tuple, np.asarray(values, float).tolist()))
