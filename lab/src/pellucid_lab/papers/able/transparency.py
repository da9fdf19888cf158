r"""The published comparison of control laws, repeated with simulated people: predictions and printed results.

The people's parameters come from movement without a robot, and were frozen before the simulation with one. The control
laws are built from an identification of the robot. No choice depends on the paper's results with its robot.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from pellucid._errors import RecordingError
from pellucid.controllers.elbow_controllers import BEST_CONTROLLER, BEST_SENSED_CONTROLLER
from pellucid.people.study.assess import assess_recordings
from pellucid.people.study.assessment_result import AssessmentResult
from pellucid.people.study.assessment_table import AssessmentTable
from pellucid.people.survival import Survival, survival

from ...pointing.conditions import (
    Cards,
    choose_exponents,
    controller_builder,
    offered_controller,
    published_conditions,
)
from ...pointing.movement_choice import preferred_duration
from ...pointing.people import Person, draw_people
from ...pointing.predicted_indices import change
from ...pointing.rig import PointingRig, PointingTrial
from ...pointing.session import CONTROL_CONDITION, Conditions
from ...pointing.session_indices import PUBLISHED_RULE, SessionIndices, session_indices
from ...study import record_in_memory

LAWS = ("FC", "PCFr", "CLPC")
"""Conditions of the paper other than control, in the paper's order."""

OWN_LAWS = (BEST_CONTROLLER, BEST_SENSED_CONTROLLER)
"""The toolkit's best laws: with an encoder alone, and with a force sensor."""


@dataclass(frozen=True)
class VirtualStudy:
    """Indices of all people in all conditions, from their true motion and excitation, without instruments."""

    seed: int
    taken: tuple[SessionIndices, ...]

    @property
    def conditions(self) -> tuple[str, ...]:
        """Names of the conditions, control first."""
        found = dict.fromkeys(t.condition for t in self.taken)
        return (CONTROL_CONDITION, *sorted((c for c in found if c != CONTROL_CONDITION), key=_order))

    def of(self, condition: str) -> list[SessionIndices]:
        """Return the indices of every person in one condition, in the order of people."""
        return sorted((t for t in self.taken if t.condition == condition), key=lambda t: t.person)

    def values(self, index: str, condition: str, rule: str = PUBLISHED_RULE) -> np.ndarray:
        """Return one index of every person in a condition, shape (people,)."""
        means = [t.means[rule] for t in self.of(condition)]
        return np.array([m.r2[index] if index in m.r2 else getattr(m, index) for m in means])

    def change(self, index: str, condition: str, rule: str = PUBLISHED_RULE) -> float:
        """Return the change of an index from control [%]."""
        return float(change(index, self.values(index, condition, rule), self.values(index, CONTROL_CONDITION, rule)))

    def settling(self, condition: str) -> Survival:
        """Return the survival curve of movements: the share that still goes on after a time, over all people."""
        return survival(*np.concatenate([t.lasted for t in self.of(condition)]).T)

    def given(self, condition: str) -> float:
        """Return the 99 % quantile of the energy that the robot gives over a closed cycle [J]."""
        return float(np.quantile(np.concatenate([t.given for t in self.of(condition)]), 0.99))


def _order(condition: str) -> tuple[int, str]:
    """Return the sort key of a condition: the paper's laws, then the toolkit's, then others by name."""
    known = (*LAWS, *OWN_LAWS)
    return (known.index(condition) if condition in known else len(known), condition)


def simulate_study(rig: PointingRig, conditions: Conditions, *, seed: int, threads: int = 2) -> VirtualStudy:
    """Simulate all people in all conditions; only the indices of each session are kept."""
    rig = rig.under(conditions)
    trials = rig.trials(seed)

    def one(trial: PointingTrial, drawn: Mapping[str, np.random.Generator]) -> SessionIndices:
        return session_indices(rig.session(trial, drawn["rng"]))

    with ThreadPoolExecutor(threads) as pool:
        return VirtualStudy(seed, tuple(pool.map(one, trials, rig.draws(trials, seed))))


def content_on_target(rig: PointingRig) -> PointingRig:
    """Return the same people with a tolerance of the whole target; as drawn, they correct towards its middle.

    The tolerance hardly matters without a robot, so the control condition does not show it. It decides how long people
    struggle with a robot that sticks.
    """
    return rig.changed({"vision.tolerance": rig["pointing"]["tolerance"]})


def required_resistance(rig: PointingRig, people: Sequence[Person], slower: float = 0.2) -> dict[str, float]:
    """Return the additional inertia, viscous or Coulomb friction, each alone, that prolongs movements by a share.

    Keys are ``inertia`` [kg*m^2], ``viscous`` [N*m*s/rad] and ``coulomb`` [N*m]. The durations are those that the
    people choose; NaN says that no value within the searched range suffices.
    """
    width, choice = rig["planning"]["sign_width"], rig["choice"]

    def mean(extra: tuple[float, float, float]) -> float:
        return float(
            np.mean(
                [
                    preferred_duration(
                        np.deg2rad(amplitude),
                        (p.forearm.inertia + extra[0], rig["arm"]["viscous"] + extra[1], extra[2]),
                        p.reward,
                        choice,
                        width,
                    )
                    for p in people
                    for amplitude in rig["pointing"]["amplitudes"]
                ]
            )
        )

    goal = (1.0 + slower) * mean((0.0, 0.0, 0.0))
    found = {}
    for i, (name, most) in enumerate((("inertia", 2.0), ("viscous", 20.0), ("coulomb", 20.0))):
        low, high = 0.0, most
        for _ in range(24):
            middle = 0.5 * (low + high)
            extra = tuple(middle if j == i else 0.0 for j in range(3))
            low, high = (middle, high) if mean(extra) < goal else (low, middle)
        found[name] = high if high < most * 0.999 else float("nan")
    return found


@dataclass(frozen=True)
class RecordedStudy:
    """One study as a lab would record and assess it."""

    study: VirtualStudy  # Indices from the true motion
    findings: AssessmentResult | None  # Assessment of its recordings; None if the assessment refuses them
    refused: str  # Reason of the refusal; "" if there is none
    seconds: float  # Computing time of people, robots and instruments [s]


def record_study(rig: PointingRig, conditions: Conditions, *, seed: int, threads: int = 2) -> RecordedStudy:
    """Record all people in all conditions with markers, encoder and EMG, and assess the recordings."""
    begun = time.perf_counter()
    rig = rig.under(conditions)
    config, recordings, made = record_in_memory(
        rig, rig.trials(seed), seed=seed, threads=threads, keep=lambda taken: session_indices(taken.inside)
    )
    seconds = time.perf_counter() - begun
    study = VirtualStudy(seed, tuple(one.inside for one in made))
    try:
        return RecordedStudy(
            study, assess_recordings("virtual-able", recordings, config.table(AssessmentTable)), "", seconds
        )
    except RecordingError as error:
        # People who cannot hold a robot at all leave nothing to assess; their true motion still counts.
        return RecordedStudy(study, None, str(error), seconds)


@dataclass(frozen=True)
class Transparency:
    """The comparison of the paper's laws, with simulated people."""

    exponents: tuple[float, float]  # k of equation 8, upwards and downwards
    torques: dict[float, tuple[float, float]]  # Interaction torque by k, by which five other people chose k [N*m]
    recorded: RecordedStudy  # Study of the first seed, recorded with instruments
    studies: tuple[VirtualStudy, ...]  # Study of every seed under the paper's laws
    own: tuple[VirtualStudy, ...]  # Studies of the same people in control and under the toolkit's own laws
    content: tuple[VirtualStudy, ...]  # Studies under all these laws with a tolerance of the whole target
    required: dict[str, float]  # Additional resistance from `required_resistance`

    def with_law(self, law: str) -> tuple[VirtualStudy, ...]:
        """Return the studies in which a law is a condition."""
        return self.own if law in OWN_LAWS else self.studies


def compare_laws(
    rig: PointingRig,
    cards: Cards,
    *,
    seeds: Sequence[int],
    threads: int = 2,
    on_progress: Callable[[str, float], None] | None = None,
) -> Transparency:
    """Simulate the paper's four conditions and the toolkit's own laws with six people, once for each seed."""
    tell = on_progress or (lambda text, share: None)
    tell("five people choose the exponents of equation 8", 0.0)
    exponents, torques = choose_exponents(rig, cards, threads=threads)
    conditions = published_conditions(cards, exponents)
    own_conditions = {
        CONTROL_CONDITION: None,
        **{law: controller_builder(cards, offered_controller(cards, law)) for law in OWN_LAWS},
    }
    steps = len(seeds) + 2
    tell(f"{len(conditions)} conditions, recorded and assessed", 0.05)
    recorded = record_study(rig, conditions, seed=seeds[0], threads=threads)
    studies = [recorded.study]
    for i, seed in enumerate(seeds[1:], 1):
        tell(f"the same with other people, {i + 1} of {len(seeds)}", 0.05 + 0.95 * i / steps)
        studies.append(simulate_study(rig, conditions, seed=seed, threads=threads))
    tell("these people under the toolkit's own laws", 0.05 + 0.95 * len(seeds) / steps)
    own_studies = tuple(simulate_study(rig, own_conditions, seed=seed, threads=threads) for seed in seeds)
    tell("people who are content on the target", 0.05 + 0.95 * (len(seeds) + 1) / steps)
    content = tuple(
        simulate_study(content_on_target(rig), conditions | own_conditions, seed=seed, threads=threads)
        for seed in seeds
    )
    needed = required_resistance(rig, draw_people(rig, np.random.default_rng(seeds[0])))
    return Transparency(exponents, torques, recorded, tuple(studies), own_studies, content, needed)
