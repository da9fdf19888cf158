"""Virtual people who point, and the robot that they wear: their rig file, their experiment, and its study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Self

import numpy as np

from ... import _core
from ..._errors import StudyError
from ..elbow.rig import ElbowRig
from ..known_rigs import shipped_rig
from ..recorded_table import MAIN_STREAM, MARKER_STREAM, Column, emg_columns, marker_columns
from ..rig import Rig, Taken, Trial, parse_tables
from .instruments import COMMON_COLUMNS, FOREARM_MARKERS, record_blocks
from .people import PERSONAL_TABLES, Person, draw_people, personal_parameter_names
from .session import CONTROL_CONDITION, Conditions, PointingSession, RobotLaw, simulate_session

PUBLISHED = (CONTROL_CONDITION, "FC", "PCFr", "CLPC")
"""Conditions of the paper."""


NEEDED = {
    "robot": ("rig", "strap_stiffness", "strap_damping", "splint"),
    "people": ("count", "age", "height", "mass"),
    "arm": ("viscous", "passive_torque", "passive_angle", "passive_scale", "flexion", "extension"),
    "muscles": ("stiffness", "damping", "reflex_stiffness", "reflex_damping", "reflex_delay", "muscle_delay",
                "activation_time", "cocontraction", "noise_share", "noise_time"),
    "vision": ("delay", "tolerance", "check_share", "correction_share", "correction_least"),
    "planning": ("reach", "reach_spread", "pace_spread", "reaction", "sign_width"),
    "choice": ("reward", "reward_spread", "resting_power", "efficiency", "torque_rate_cost", "discount", "shortest",
               "longest"),
    "learning": ("rate", "trust", "felt_noise"),
    "emg": ("muscles", "groups", "share", "gains", "gain_spread", "rate"),
    "force_sensor": ("noise", "offset", "drift", "delay"),
    "pointing": ("reference", "amplitudes", "repetitions", "block", "hold", "tolerance", "longest"),
    "cameras": ("rate", "noise", "quantum", "clock_drift", "elbow"),
}  # fmt: skip
"""What a rig file must say, table by table."""

NEEDED_OF_PEOPLE = {
    **{table: keys for table, keys in NEEDED.items() if table not in ("muscles", "vision")},
    "people": ("model", *NEEDED["people"]),
    "impedance": ("posture_stiffness", "movement_stiffness", "posture_damping_ratio", "movement_damping_ratio",
                  "movement_speed", "stiffness_per_torque"),
    "muscles": ("reflex_stiffness", "reflex_damping", "reflex_delay", "muscle_delay", "activation_time", "noise_share",
                "noise_time"),
    "cocontraction": ("cocontraction", "cocontraction_most", "cocontraction_rise", "cocontraction_decay", "late_time",
                      "fatigue_rate", "recovery_rate"),
    "vision": ("delay", "visual_noise", "tolerance_share", "check_share", "correction_share", "correction_least",
               "correction_gain", "correction_discount", "refractory_time", "patience", "failures_most"),
}  # fmt: skip
"""And what one of people who hold as well as reach must say."""

COMMENTS = {
    "": "People who point with the forearm, free and strapped to an elbow robot. Nothing below tells them from"
    "\nreal ones.",
    "streams.emg.channels": "raw, as the converter counts",
    "optical": "motion capture, on its own clock",
}
"""What its study.toml says beside a table or a key."""


@dataclass(frozen=True)
class PointingTrial(Trial):
    """One person in one condition; pauses divide it into recordings."""

    person: Person = field(kw_only=True)
    number: int = 0  # Its place in the experiment, from 0


@dataclass(frozen=True)
class PointingRig(Rig):
    """The tables of a file like ``lab/rigs/elbow-participants.toml``, and the robot that its people wear."""

    robot: ElbowRig
    conditions: Conditions | None = None  # A law by condition, as `Conditions`; known once the rig is `prepared`

    kind = "elbow-participants"
    needed = NEEDED
    comments = COMMENTS
    parallel = True  # the core leaves Python alone while it moves arms

    @classmethod
    def parse(cls, text: str, name: str, robot: ElbowRig | None = None) -> Self:
        """As `Rig.parse` of `text` and `name`; people wear `robot`, or the one that the file names."""
        tables = cls.checked(parse_tables(text, f"rig {name}"), name)
        if robot is None:
            strapped = tables["robot"]["rig"]
            robot = ElbowRig.parse(shipped_rig(strapped), strapped)
        return cls(name, tables, robot)

    @property
    def period(self) -> float:
        """Of control [s]."""
        return 1.0 / self.robot["sampling"]["rate"]

    @property
    def strap(self) -> np.ndarray:
        """The core's parameters of the strap, shape (11,), SI; what the file does not say of it is not there."""
        return np.array([self["robot"].get(name, 0.0) for name in _core.STRAP_PARAMETER_NAMES], float)

    def strapped(self, values: Mapping[str, float]) -> Self:
        """Return the same people with some constants of the strap changed, as `without_strap_options` gives them."""
        robot = {**self["robot"], **{f"strap_{name}": value for name, value in values.items()}}
        return replace(self, tables={**self.tables, "robot": robot})

    def under(self, conditions: Conditions) -> Self:
        """The same people under these conditions."""
        return replace(self, conditions=conditions)

    def prepared(self, controllers: Sequence[str] | None = None, seed: int = 1) -> Self:
        """Identify the robot, and build of what is found the laws that people wear."""
        from .conditions import build_study_conditions

        return self.under(build_study_conditions(self, controllers, seed=seed))

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """Time and target, the cameras' file, and the EMG amplifier's; where a robot is worn, its channels beside."""
        return {
            MAIN_STREAM: COMMON_COLUMNS,
            MARKER_STREAM: marker_columns(FOREARM_MARKERS),
            "emg": emg_columns(self["emg"]),
        }

    def trials(self, seed: int = 1) -> tuple[PointingTrial, ...]:
        """Everybody in every condition, in an order of their own; `seed` draws people and orders."""
        rng, made = np.random.default_rng(seed), []
        for person in draw_people(self, rng):
            # Learning starts anew in each: two minutes' pause and another law lie in between, and nobody is told which.
            for condition in rng.permutation(list(self.conditions or PUBLISHED)).tolist():
                whose = {"participant": person.name, "condition": condition, "person": person, "number": len(made)}
                made.append(PointingTrial(f"{person.name}_{condition}", "pointing", **whose))
        return tuple(made)

    def draws(self, trials: Sequence[PointingTrial], seed: int) -> Iterator[dict[str, Any]]:
        """Generators of people and of instruments for each of `trials`, from `seed` and its place in the experiment."""
        for trial in trials:
            of_person, of_instruments = (
                np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=(trial.number,)))
                for entropy in (seed, [seed, 1])
            )
            yield {"rng": of_person, "instruments": of_instruments}

    def session(
        self, trial: PointingTrial, rng: np.random.Generator, controller: RobotLaw | None = None
    ) -> PointingSession:
        """What truly happens in a trial, before any instrument; under a controller in place of the condition's own, if
        given."""
        if controller is None and trial.condition != CONTROL_CONDITION:
            make = (self.conditions or {}).get(trial.condition)
            if make is None:
                raise StudyError(
                    f"rig {self.name}: found no law for {trial.condition}, expected a rig that is prepared"
                )
            controller = make(trial.person, trial.person.slider(self))
        return simulate_session(self, trial.person, trial.condition, controller, rng)

    def record(
        self,
        trial: PointingTrial,
        rng: np.random.Generator,
        controller: RobotLaw | None = None,
        *,
        instruments: np.random.Generator | None = None,
    ) -> Taken:
        """Do one trial under a controller in place of the condition's own, if given; `Taken.inside` is a
        `PointingSession`."""
        instruments = rng.spawn(1)[0] if instruments is None else instruments
        session = self.session(trial, rng, controller)
        return Taken(trial, record_blocks(self, session, instruments), truth={"fault": session.fault}, inside=session)

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """The study.toml of what was `made`."""
        emg, order = self["emg"], list(self.conditions or PUBLISHED)
        # As they were named, not as each person met them: tables and figures follow study.toml.
        named = sorted(made, key=lambda taken: order.index(taken.trial.condition))
        people = {taken.trial.participant: taken.trial.person for taken in made}

        def of(group: str) -> list[str]:
            return [m for m, g in zip(emg["muscles"], emg["groups"], strict=True) if g == group]

        return {
            **super().study(named),
            "rig": {"joint": "elbow", "motion": "rotary", "lifts": "flexion"},
            "participants": {
                name: {
                    "mass": f"{p.mass:.1f} kg",
                    "height": f"{p.height:.2f} m",
                    "age": round(p.age),
                    "sex": p.sex,
                }
                for name, p in people.items()
            },
            "assessment": {
                "control": CONTROL_CONDITION,
                "segment": list(FOREARM_MARKERS),
                "agonists": of("flexor"),
                "antagonists": of("extensor"),
                "interaction": "interaction",
            },
        }

    def truth(self, seed: int = 1) -> dict[str, Any]:
        """The robot, and the people that a `seed` draws."""
        people = draw_people(self, np.random.default_rng(seed))
        return {"robot": self.robot.name, "people": [asdict(person) for person in people]}


@dataclass(frozen=True)
class PeopleRig(PointingRig):
    """The tables of a file like ``lab/rigs/elbow-people.toml``: people who differ in how they move, by its spreads."""

    kind = "elbow-people"
    needed = NEEDED_OF_PEOPLE

    @classmethod
    def checked(cls, tables: dict, name: str) -> dict:
        """As `Rig.checked`; and every number of the model that its people are is there."""
        tables = super().checked(tables, name)
        model = tables["people"]["model"]
        if model not in _core.PERSON_MODELS:
            known = ", ".join(_core.PERSON_MODELS)
            raise StudyError(f"rig {name}: [people] model: found {model!r}, expected one of {known}")
        lacking = [
            key
            for key in personal_parameter_names(model)
            if not any(key in tables.get(table, {}) for table in (*PERSONAL_TABLES, model))
        ]
        if lacking:
            raise StudyError(f'rig {name}: [people] model = "{model}" lacks {", ".join(lacking)}')
        return tables

    def modelled(self, model: str) -> Self:
        """The same people, who move as another `model` of the core's `PERSON_MODELS` says."""
        tables = {**self.tables, "people": {**self["people"], "model": model}}
        return replace(self, name=f"{self.name}-{model}", tables=type(self).checked(tables, self.name))


def elbow_people(robot: ElbowRig | None = None) -> PeopleRig:
    """The people of ``lab/rigs/elbow-people.toml``, who wear `robot`, or the one that the file names."""
    return PeopleRig.parse(shipped_rig(PeopleRig.kind), PeopleRig.kind, robot)


def elbow_participants(robot: ElbowRig | None = None) -> PointingRig:
    """The people of ``lab/rigs/elbow-participants.toml``, who wear `robot`, or the one that the file names."""
    return PointingRig.parse(shipped_rig(PointingRig.kind), PointingRig.kind, robot)
