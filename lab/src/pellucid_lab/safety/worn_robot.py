"""A simulated robot and wearer under a supervised law: minutes or hours of reaching, healthy or with one fault."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pellucid import _core
from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.elbow_laws import ELBOW_LIMITS
from pellucid.controllers.instruments import Instruments
from pellucid.controllers.joint_compensation import compensation, rest_friction
from pellucid.controllers.supervised import SupervisedLaw, body_of, supervised
from pellucid.models.simulate import substeps_for
from pellucid.models.slider_joint import SliderCard

from ..drive_reading import EXACT_READING, DriveReading
from ..pointing.people import Person
from ..pointing.rig import PointingRig
from ..pointing.session import EMG_GAIN_SD, MIN_REACTION_S

LAWS: tuple[str, ...] = (*ELBOW_CONTROLLERS, "compensation")
"""Names of all laws for the elbow robot: the controllers by name, and the compensation of a joint."""

TASK_MOVEMENT_COUNT = 40
"""Number of movements after which a wearer's list of tasks begins again.

Chosen by judgement; no measurement is recorded."""

SLOT_RANGE_S = (1.3, 2.2)
"""Shortest and longest time from one movement's target to the next [s].

Chosen by judgement; no measurement is recorded."""

DURATION_RANGE_S = (0.45, 1.4)
"""Shortest and longest duration of a movement [s].

Chosen by judgement; no measurement is recorded."""

TREMOR_AMPLITUDE_RANGE_NM = (0.0, 0.6)
"""Smallest and largest amplitude of a wearer's tremor [N m].

Chosen by judgement; no measurement is recorded."""

TREMOR_FREQUENCY_RANGE_HZ = (4.0, 10.0)
"""Lowest and highest frequency of a wearer's tremor [Hz].

Chosen by judgement; no measurement is recorded."""

MEAN_STOP_INTERVAL_S = 11.0
"""Mean time between two sudden stops of a wearer [s].

Chosen by judgement; no measurement is recorded."""

COMMON_EXPONENTS = (-0.5, -0.5)
"""Exponents k of equation 8 of Verdel et al. (Robotica 39, 2021), upwards and downwards.

Five simulated people chose these values on most of the robots on which thresholds were chosen."""

NOISE_PERIOD_COUNT = 5000
"""Number of control periods of noise that are drawn before the noise repeats."""


@dataclass(frozen=True)
class WornRobot:
    """One robot on one wearer, with the robot's identified cards and the wearer's habits."""

    rig: PointingRig
    person: Person
    cards: Mapping[str, SliderCard]  # identified models of the robot, by method
    tasks: np.ndarray  # (k, 5) target, amplitude [rad], duration, reaction time and time to the next target [s]
    noise: np.ndarray  # (n, 5) noise of person and encoder, as `_core.WornElbow.live` takes it
    sensor_error: np.ndarray  # (n,) error of the force sensor [N m]
    tremor: tuple[float, float]  # amplitude [N m] and angular frequency [rad/s]
    emg_gains: np.ndarray  # (2,) torque estimated from EMG over the true torque, of flexors and extensors [1]
    seed: int
    answer: float | None = None  # work of the start-up test's wave when the robot was commissioned [J]
    reading: DriveReading = EXACT_READING  # measurement of the drive's own effort

    def commissioned(self, other: Person) -> WornRobot:
        """Return the same robot with the start-up test's work as measured on another wearer, who has no tremor."""
        commissioning = replace(self, person=other, tremor=(0.0, 0.0))
        run = commissioning.live(commissioning.law("compensation"), longest=3.0)
        return replace(self, answer=run["answer"])

    def law(self, name: str, *, start_up: bool = True, **supervision: float) -> SupervisedLaw:
        """Return a law of `LAWS` for this robot and wearer, under a supervisor that knows the encoder and the drive."""
        place = self.person.slider(self.rig)
        if name == "compensation":
            law: ControlLaw = compensation(self.cards["load"], slider=place, limits=ELBOW_LIMITS)
        else:
            named = ELBOW_CONTROLLERS[name]
            own: dict[str, Any] = {"limb": self.person.forearm} if named.wearer else {}
            own |= {"exponents": COMMON_EXPONENTS} if named.exponents else {}
            law = named.build(self.cards[named.method], place, **own)
        return self.watched(law, start_up=start_up, **supervision)

    def watched(self, law: ControlLaw, *, start_up: bool = True, **supervision: float) -> SupervisedLaw:
        """Return a law made for this robot and wearer, under a supervisor that knows the encoder and the drive."""
        # The supervisor's model of the robot is the identified one, whichever law runs.
        place = self.person.slider(self.rig)
        card = self.cards["load"]
        body = body_of(compensation(card, slider=place, limits=ELBOW_LIMITS))
        made = supervised(
            law, instruments=self.instruments.decided(has_force_sensor=law.sensed), body=body, start_up=start_up,
            rest_friction=rest_friction(card, place),
        )  # fmt: skip
        return made.changed(**supervision)

    @property
    def instruments(self) -> Instruments:
        """What the robot measures, with the start-up test's work at its commissioning."""
        return replace(self.rig.robot.instruments, start_up_answer=self.answer)

    def live(
        self,
        law: SupervisedLaw,
        fault: str = "none",
        *,
        onset: float = 0.0,
        seconds: float = 10.0,
        longest: float = 3600.0,
        stops: Sequence[float] | np.ndarray = (),
        seed: int = 0,
    ) -> dict:
        """Simulate this wearer under a law, and return what `_core.WornElbow.live` reports.

        Parameters
        ----------
        law : SupervisedLaw
        fault : str
            Name of a fault of `_core.single_faults`, or "none".
        onset : float
            Time at which the fault begins [s].
        seconds : float
            Longest time after the onset for which an undetected fault is simulated [s].
        longest : float
            Longest simulated time in all [s].
        stops : sequence of float
            Times at which the wearer stops suddenly, ascending [s].
        seed : int
            Seed of what the fault draws.
        """
        rig, robot, motor = self.rig, self.rig.robot, self.rig.robot["motor"]
        arm = _core.WornElbow(
            self.person.vector(rig),
            np.zeros(5),
            position0=float(rig["pointing"]["reference"]),
            robot=robot.plant(self.person.slider(rig)),
            strap=rig.strap,
            drive=[robot.gain, motor["current_limit"], motor["ripple_amplitude"], motor["ripple_wave_number"],
                   robot.quantum],
            law=law.kind,
            law_parameters=law.parameters,
            emg_gains=self.emg_gains,
            substeps=substeps_for(rig.period),
            sensor_delay=round(rig["force_sensor"]["delay"] / rig.period),
            supervisor=law.supervisor,
            drive_reading=self.reading.numbers,
        )  # fmt: skip
        return arm.live(
            tasks=self.tasks,
            noise=self.noise,
            sensor_error=self.sensor_error if law.sensed else None,
            emg=law.emg,
            tremor=self.tremor,
            stops=stops,
            fault=fault,
            onset=onset,
            seconds=seconds,
            longest=round(longest / rig.period),
            seed=seed,
            drive_noise=self.reading.draw_noise(self.seed) if self.reading.noise > 0.0 else None,
            command=getattr(law, "command", None),
        )


def make_worn_robot(rig: PointingRig, person: Person, cards: Mapping[str, SliderCard], seed: int) -> WornRobot:
    """Draw a wearer's habits, and put them into a robot whose identified models are `cards`."""
    rng = np.random.default_rng([seed, 9])
    reference, planning, sensor = rig["pointing"]["reference"], rig["planning"], rig["force_sensor"]
    amplitudes = np.deg2rad(rng.choice(rig["pointing"]["amplitudes"], TASK_MOVEMENT_COUNT // 2))
    tasks = []
    for lift in amplitudes:
        for target, amplitude in ((reference + lift, lift), (reference, -lift)):
            reaction = max(planning["reaction"][0] + planning["reaction"][1] * rng.standard_normal(), MIN_REACTION_S)
            duration = rng.uniform(*DURATION_RANGE_S)
            slot = max(rng.uniform(*SLOT_RANGE_S), reaction + duration + 0.2)
            reach = planning["reach"] + planning["reach_spread"] * rng.standard_normal()
            tasks.append((target, reach * amplitude, duration, reaction, round(slot / rig.period) * rig.period))
    noise = rng.standard_normal((NOISE_PERIOD_COUNT, 5)) * np.array([1.0, 1.0, rig.robot["encoder"]["noise"], 1.0, 1.0])
    error = sensor["offset"] * rng.standard_normal() + sensor["noise"] * rng.standard_normal(NOISE_PERIOD_COUNT)
    tremor = rng.uniform(*TREMOR_AMPLITUDE_RANGE_NM), 2.0 * np.pi * rng.uniform(*TREMOR_FREQUENCY_RANGE_HZ)
    return WornRobot(
        rig, person, cards, np.array(tasks), noise, error, tremor, 1.0 + EMG_GAIN_SD * rng.standard_normal(2), seed
    )


def draw_sudden_stops(seconds: float, rng: np.random.Generator) -> np.ndarray:
    """Draw the times of a wearer's sudden stops within so many `seconds`, ascending, shape (m,) [s]."""
    count = rng.poisson(seconds / MEAN_STOP_INTERVAL_S)
    return np.sort(rng.uniform(1.0, seconds, count))
