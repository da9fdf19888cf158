"""Virtual people who point with the shank and the orthosis that they wear: experiment, recordings and study."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from ..knee.drawn import drawn_rig
from ..knee.identified_wearer import IdentifiedWearer, identify_wearer_of
from ..knee.instruments import draw_mounting
from ..knee.rig import KneeRig
from ..knee.subject import EXTENSOR_MUSCLE, FLEXOR_MUSCLE
from ..pointing.instruments import COMMON_COLUMNS, ROBOT_COLUMNS, film_segment
from ..processes import ordered_results
from ..recorded_table import MAIN_STREAM, MARKER_STREAM, Column, StoredTable, emg_columns, marker_columns, store_emg
from ..rig import Rig, Taken, Trial
from ..shipped_rigs import shipped_rig
from .conditions import LegCondition, leg_conditions
from .constants import KneePointingConstants
from .session import CONTROL_CONDITION, LegLaw, LegSession, simulate_leg_session

SHANK_MARKERS = ("knee", "ankle")
"""Names of the markers on the shank."""

FIRST_PERSON = 6000
"""Number of the first simulated wearer of seed 1. No constant of a controller was chosen on these wearers."""

PEOPLE_PER_SEED = 1000
"""Difference between the numbers of the first wearers of two successive seeds."""

COMMENTS = {
    "": "People who point with the shank, free and in a knee orthosis. Nothing below tells them from real ones.",
    "streams.emg.channels": "raw, as the converter counts",
    "optical": "motion capture, on its own clock",
    "assessment.margins": "stated before anybody was recorded",
}
"""Comments of study.toml on tables and keys."""


@dataclass(frozen=True)
class LegPerson:
    """One virtual person."""

    name: str  # "P1", "P2" and so on
    number: int  # number of the drawn wearer, `knee.drawn.drawn_rig`
    reward: float  # value of arriving at a target [J]; the larger it is, the faster the person moves


@dataclass(frozen=True)
class LegTrial(Trial):
    """One person in one condition."""

    person: LegPerson = field(kw_only=True)
    number: int = 0  # position in the experiment, counted from 0
    period: int = 1  # position among the person's own conditions, counted from 1


@dataclass(frozen=True)
class KneePointingRig(Rig):
    """People who point with the shank, of a file like ``rigs/knee-participants.toml``."""

    constants: KneePointingConstants
    conditions: Mapping[str, LegCondition] = field(default_factory=lambda: leg_conditions(None))
    identified: Mapping[str, IdentifiedWearer] = field(default_factory=dict)  # by person; known once `prepared`

    kind = "knee-participants"
    constants_type: ClassVar[type[KneePointingConstants]] = KneePointingConstants
    comments = COMMENTS

    @cached_property
    def robot(self) -> KneeRig:
        """The orthosis."""
        name = self.constants.robot.rig
        return KneeRig.parse(shipped_rig(name), name)

    def people(self, seed: int) -> list[LegPerson]:
        """Return the people that a `seed` draws."""
        choice, rng = self.constants.choice, np.random.default_rng([seed, 21])
        rewards = choice.reward * np.exp(choice.reward_spread * rng.standard_normal(self.constants.people.count))
        first = FIRST_PERSON + PEOPLE_PER_SEED * (seed - 1)
        return [LegPerson(f"P{i + 1}", first + i, float(reward)) for i, reward in enumerate(rewards)]

    def worn_by(self, person: LegPerson) -> KneeRig:
        """Return the orthosis with a person in it: the same orthosis for all."""
        drawn = drawn_rig(self.robot, person.number)
        own = self.robot.constants
        values: dict[str, object] = {f"actuator.{key}": value for key, value in own.actuator.items()}
        values |= {f"orthosis.{key}": value for key, value in own.orthosis.items()}
        return drawn.changed(values)

    def prepared(self, controllers: Sequence[str] | None = None, seed: int = 1) -> Self:
        """Return the rig with the conditions that are worn, and with every person identified if a law asks for it."""
        conditions = leg_conditions(controllers)
        if all(one.build is None for one in conditions.values()):
            return replace(self, conditions=conditions)
        people = self.people(seed)
        found = ordered_results([(identify_wearer_of, self.worn_by(p), f"D{p.number}", p.number) for p in people])
        return replace(self, conditions=conditions, identified={p.name: i for p, i in zip(people, found, strict=True)})

    def streams(self) -> Mapping[str, Sequence[Column]]:
        """Return the columns of the main file, the cameras' and the EMG amplifier's; a worn orthosis adds channels."""
        emg = emg_columns(self.robot.constants.emg)
        return {MAIN_STREAM: COMMON_COLUMNS, MARKER_STREAM: marker_columns(SHANK_MARKERS), "emg": emg}

    def trials(self, seed: int = 1) -> tuple[LegTrial, ...]:
        """Return a trial of each person in each condition, in random order; `seed` draws people and orders."""
        rng, made = np.random.default_rng([seed, 22]), []
        for person in self.people(seed):
            for period, condition in enumerate(rng.permutation([CONTROL_CONDITION, *self.conditions]).tolist()):
                whose = {"participant": person.name, "condition": condition, "person": person}
                name = f"{person.name}_{condition}"
                made.append(LegTrial(name, "pointing", **whose, number=len(made), period=period + 1))
        return tuple(made)

    def draws(self, trials: Sequence[LegTrial], seed: int) -> Iterator[dict[str, Any]]:
        """Return the generators of person and instruments for each of `trials`, from `seed` and the trial's number."""
        for trial in trials:
            yield {
                "rng": np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(trial.number,))),
                "instruments": np.random.default_rng(np.random.SeedSequence([seed, 1], spawn_key=(trial.number,))),
            }

    def session(self, trial: LegTrial, rng: np.random.Generator, controller: LegLaw | None = None) -> LegSession:
        """Simulate a trial without instruments; a `controller` takes the place of the condition's own."""
        rig, worn = self.worn_by(trial.person), trial.condition != CONTROL_CONDITION
        # Electrodes stay on from the recordings that identified a person.
        mounting = draw_mounting(rig, np.random.default_rng([trial.person.number, 1, 0]))
        law = controller
        if worn:
            condition = self.conditions[trial.condition]
            law = controller or condition.law(self.identified.get(trial.person.name))
            rig = condition.orthosis(rig)
        return simulate_leg_session(
            rig, self.constants, trial.person.reward, law, rng, worn=worn, mounting=mounting
        )  # fmt: skip

    def record(
        self, trial: LegTrial, rng: np.random.Generator, controller: LegLaw | None = None, *,
        instruments: np.random.Generator | None = None,
    ) -> Taken:  # fmt: skip
        """Record one trial; a `controller` replaces the condition's own. `Taken.inside` is a `LegSession`."""
        instruments = rng.spawn(1)[0] if instruments is None else instruments
        session = self.session(trial, rng, controller)
        files = {trial.name: self._files(trial, session, instruments)}
        return Taken(trial, files, {"period": trial.period}, truth={"fault": session.fault}, inside=session)

    def _files(self, trial: LegTrial, session: LegSession, rng: np.random.Generator) -> dict[str, StoredTable]:
        camera, sensor, n = self.constants.cameras, self.constants.force_sensor, len(session.target)
        (subject,) = self.worn_by(trial.person).subjects.values()
        time = np.arange(n) / session.fs
        main = StoredTable.of(COMMON_COLUMNS, time, session.target)
        if session.worn:
            error = sensor.offset * rng.standard_normal() + sensor.noise * rng.standard_normal(n)
            # The sensor measures the torque of the orthosis on the person.
            measured = -session.signals["interaction"] + error
            columns = (*COMMON_COLUMNS, *ROBOT_COLUMNS)
            main = StoredTable.of(columns, time, session.target, session.signals["encoder"], measured)
        clock, markers = film_segment(
            camera, np.array(camera.knee), subject.shank_length, SHANK_MARKERS, time, session.signals["position"], rng
        )
        optical = StoredTable.of(marker_columns(SHANK_MARKERS), clock, *(markers[name] for name in SHANK_MARKERS))
        emg = store_emg(session.emg_time, session.emg, self.robot.constants.emg)
        return {MAIN_STREAM: main, MARKER_STREAM: optical, "emg": emg}

    def study(self, made: Sequence[Taken]) -> dict[str, Any]:
        """Return the contents of study.toml for the recordings that were `made`."""
        order = [CONTROL_CONDITION, *self.conditions]
        named = sorted(made, key=lambda taken: order.index(taken.trial.condition))
        people = {taken.trial.participant: taken.trial.person for taken in made}
        bodies = {name: next(iter(self.worn_by(person).subjects.values())) for name, person in people.items()}
        return {
            **super().study(named),
            "rig": {"joint": "knee", "motion": "rotary", "lifts": "flexion"},
            "participants": {
                name: {"mass": f"{b.weight:.1f} kg", "height": f"{b.height:.2f} m", "age": b.age, "sex": b.sex}
                for name, b in bodies.items()
            },
            "assessment": {
                "control": CONTROL_CONDITION,
                "segment": list(SHANK_MARKERS),
                "agonists": [FLEXOR_MUSCLE],
                "antagonists": [EXTENSOR_MUSCLE],
                "interaction": "interaction",
                "margins": dict(self.constants.margins),
                "justification": dict(self.constants.justification),
            },
        }

    def truth(self, seed: int = 1) -> dict[str, Any]:
        """Return the orthosis's name and the people that a `seed` draws."""
        return {"robot": self.robot.name, "people": [vars(person) for person in self.people(seed)]}
