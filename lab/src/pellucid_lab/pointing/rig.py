"""Virtual people who point and the robot that they wear: their experiment, its recordings and its study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from threading import Lock
from typing import Any, ClassVar, Self

import numpy as np

from pellucid import _core
from pellucid._errors import StudyError

from ..elbow.rig import ElbowRig
from ..recorded_table import MAIN_STREAM, MARKER_STREAM, Column, emg_columns, marker_columns
from ..rig import Store, Streams, Taken, Trial
from ..shipped_rigs import shipped_rig
from .constants import ParticipantsConstants, PeopleConstants, PointingConstants
from .instruments import COMMON_COLUMNS, FOREARM_MARKERS, record_blocks
from .people import PERSONAL_TABLES, Person, draw_people, personal_parameter_names
from .plant import PointingPlant
from .session import CONTROL_CONDITION, Conditions, PointingSession, RobotLaw, simulate_session

PUBLISHED_CONDITIONS = (CONTROL_CONDITION, "FC", "PCFr", "CLPC")
"""Names of the paper's conditions."""


ONE_RECORDING = Lock()
"""Held while a session is recorded: its raw EMG takes several times the memory of the session itself."""

COMMENTS = {
    "": "People who point with the forearm, free and strapped to an elbow robot. Nothing below tells them from"
    "\nreal ones.",
    "streams.emg.channels": "raw, as the converter counts",
    "optical": "motion capture, on its own clock",
}
"""Comments of study.toml on tables and keys."""


@dataclass(frozen=True)
class PointingTrial(Trial):
    """One person in one condition; pauses divide it into recordings."""

    person: Person = field(kw_only=True)
    number: int = 0  # position in the experiment, counted from 0


@dataclass(frozen=True)
class PointingRig(PointingPlant):
    """People who point, of a file like ``rigs/elbow-participants.toml``, and the robot that they wear."""

    conditions: Conditions | None = None  # law of each condition; known once the rig is `prepared`

    kind = "elbow-participants"
    constants_type: ClassVar[type[PointingConstants]] = ParticipantsConstants
    comments = COMMENTS
    parallel = True  # The core releases Python's lock while it simulates arms.

    @classmethod
    def parse(cls, text: str, name: str, robot: ElbowRig | None = None) -> Self:
        """Return the people that the text of a file describes, who wear `robot`, or the one that the file names."""
        constants: Any = cls.read_constants(text, name)
        if robot is None:
            robot = ElbowRig.parse(shipped_rig(constants.robot.rig), constants.robot.rig)
        return cls(name, constants, robot)

    def under(self, conditions: Conditions) -> Self:
        """Return the same people under other conditions."""
        return replace(self, conditions=conditions)

    def prepared(self, controllers: Sequence[str] | None = None, seed: int = 1) -> Self:
        """Return the rig with the laws that people wear, built from an identification of the robot."""
        from .conditions import build_study_conditions

        return self.under(build_study_conditions(self, controllers, seed=seed))

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """Return the columns of the main file, the cameras' and the EMG amplifier's; a worn robot adds its channels."""
        return {
            MAIN_STREAM: COMMON_COLUMNS,
            MARKER_STREAM: marker_columns(FOREARM_MARKERS),
            "emg": emg_columns(self.constants.emg),
        }

    def trials(self, seed: int = 1) -> tuple[PointingTrial, ...]:
        """Return a trial of each person in each condition, in random order; `seed` draws people and orders."""
        rng = np.random.default_rng(seed)
        made: list[PointingTrial] = []
        for person in draw_people(self, rng):
            # Learning starts anew in each: two minutes' pause and another law lie in between, and nobody is told which.
            for condition in rng.permutation(list(self.conditions or PUBLISHED_CONDITIONS)).tolist():
                whose = {"participant": person.name, "condition": condition, "person": person, "number": len(made)}
                made.append(PointingTrial(f"{person.name}_{condition}", "pointing", **whose))
        return tuple(made)

    def draws(self, trials: Sequence[PointingTrial], seed: int) -> Iterator[dict[str, Any]]:
        """Return the generators of person and instruments for each of `trials`, from `seed` and the trial's number."""
        for trial in trials:
            of_person, of_instruments = (
                np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=(trial.number,)))
                for entropy in (seed, [seed, 1])
            )
            yield {"rng": of_person, "instruments": of_instruments}

    def session(
        self, trial: PointingTrial, rng: np.random.Generator, controller: RobotLaw | None = None
    ) -> PointingSession:
        """Simulate a trial without instruments; a `controller` takes the place of the condition's own."""
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
        """Record one trial; a `controller` replaces the condition's own. `Taken.inside` is a `PointingSession`."""
        return self.record_and_store(
            trial, lambda name, streams: streams, rng=rng, controller=controller, instruments=instruments
        )

    def record_and_store(
        self,
        trial: PointingTrial,
        store: Store,
        *,
        rng: np.random.Generator,
        controller: RobotLaw | None = None,
        instruments: np.random.Generator | None = None,
    ) -> Taken:
        """Do one trial as `record` does; `store` gets each recording before the next one is made."""
        instruments = rng.spawn(1)[0] if instruments is None else instruments
        session = self.session(trial, rng, controller)
        files: dict[str, Streams] = {}
        with ONE_RECORDING:
            for name, streams in record_blocks(self, session, instruments):
                files[name] = store(name, streams)
                del streams  # released before the next recording is made
        return Taken(trial, files, truth={"fault": session.fault}, inside=session)

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """Return the contents of study.toml for the recordings that were `made`."""
        emg, order = self.constants.emg, list(self.conditions or PUBLISHED_CONDITIONS)
        # Tables and figures follow study.toml, so conditions have one order for all people.
        named = sorted(made, key=lambda taken: order.index(taken.trial.condition))
        people = {taken.trial.participant: taken.trial.person for taken in made}

        def of(group: str) -> list[str]:
            return [m for m, g in zip(emg.muscles, emg.groups, strict=True) if g == group]

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
        """Return the robot, and the people that a `seed` draws."""
        people = draw_people(self, np.random.default_rng(seed))
        return {"robot": self.robot.name, "people": [asdict(person) for person in people]}


@dataclass(frozen=True)
class PeopleRig(PointingRig):
    """People who differ in how they move, of a file like ``rigs/elbow-people.toml``."""

    kind = "elbow-people"
    constants: PeopleConstants
    constants_type = PeopleConstants

    @classmethod
    def read_constants(cls, text: str, name: str) -> PeopleConstants:
        """Return the constants of a file's text; raise a StudyError where the model of people lacks a number."""
        constants: Any = super().read_constants(text, name)
        return cls._require_model(constants, name)

    @staticmethod
    def _require_model(constants: PeopleConstants, name: str) -> PeopleConstants:
        """Return the constants; raise a StudyError if the model is unknown or one of its numbers is missing."""
        model = constants.people.model
        if model not in _core.PERSON_MODELS:
            known = ", ".join(_core.PERSON_MODELS)
            raise StudyError(f"rig {name}: [people] model: found {model!r}, expected one of {known}")
        tables = [constants.get(table, {}) for table in (*PERSONAL_TABLES, model)]
        lacking = [key for key in personal_parameter_names(model) if not any(key in table for table in tables)]
        if lacking:
            raise StudyError(f'rig {name}: [people] model = "{model}" lacks {", ".join(lacking)}')
        return constants

    def modelled(self, model: str) -> Self:
        """Return the same people, who move as another `model` of the core's `PERSON_MODELS` says."""
        made = self.changed({"people.model": model}, f"{self.name}-{model}")
        self._require_model(made.constants, self.name)
        return made


def elbow_people(robot: ElbowRig | None = None) -> PeopleRig:
    """Return the people of ``rigs/elbow-people.toml``, who wear `robot`, or the one that the file names."""
    return PeopleRig.parse(shipped_rig(PeopleRig.kind), PeopleRig.kind, robot)


def elbow_participants(robot: ElbowRig | None = None) -> PointingRig:
    """Return the people of ``rigs/elbow-participants.toml``, who wear `robot`, or the one that the file names."""
    return PointingRig.parse(shipped_rig(PointingRig.kind), PointingRig.kind, robot)
