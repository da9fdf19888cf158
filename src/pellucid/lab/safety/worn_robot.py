"""A drawn robot, a drawn wearer and a supervised law: minutes or hours of reaching, healthy or with one fault."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ... import _core
from ...control.control_law import ControlLaw
from ...control.elbow_controllers import ELBOW_CONTROLLERS
from ...control.elbow_laws import ELBOW_LIMITS
from ...control.joint_compensation import compensation
from ...control.supervised import Instruments, SupervisedLaw, body_of, supervised
from ...models.simulate import substeps_for
from ...models.slider_card import SliderCard
from ..drive_reading import EXACT_READING, DriveReading
from ..pointing.people import Person
from ..pointing.rig import PointingRig

LAWS: tuple[str, ...] = (*ELBOW_CONTROLLERS, "compensation")
"""Every law that the elbow robot can wear."""

TASK_MOVEMENT_COUNT = 40
"""Movements of a task, after which it begins again."""

SLOT_RANGE_S = (1.3, 2.2)
"""Shortest and longest time of a movement with its rest [s]."""

DURATION_RANGE_S = (0.45, 1.4)
"""Of a movement [s]."""

TREMOR = ((0.0, 0.6), (4.0, 10.0))
"""Amplitude [N m] and frequency [Hz] of a wearer's tremor, from and to."""

MEAN_STOP_INTERVAL_S = 11.0
"""Mean time between sudden stops of a wearer [s]."""

COMMON_EXPONENTS = (-0.5, -0.5)
"""Of equation 8, as five people chose them on most of the robots that thresholds were chosen on."""

NOISE_PERIOD_COUNT = 5000
"""Periods of noise that is drawn; then it is heard again."""


@dataclass(frozen=True)
class WornRobot:
    """One robot on one wearer, with what was identified of it, and the wearer's habits."""

    rig: PointingRig
    person: Person
    cards: Mapping[str, SliderCard]
    tasks: np.ndarray  # (k, 5) As `WornElbow.live` takes them
    noise: np.ndarray  # (n, 5)
    sensor_error: np.ndarray  # (n,) [N m]
    tremor: tuple[float, float]  # Amplitude [N m], angular frequency [rad/s]
    emg_gains: np.ndarray  # (2,)
    seed: int
    answer: float | None = None  # Work of the test's wave when the robot was commissioned, by somebody else [J]
    reading: DriveReading = EXACT_READING  # How its drive measures its own effort

    def commissioned(self, other: Person) -> WornRobot:
        """The same robot, whose test's answer was written down while somebody else wore it, without tremor."""
        still = replace(self, person=other, tremor=(0.0, 0.0))
        said = still.live(still.law("compensation"), longest=3.0)
        return replace(self, answer=said["answer"])

    def law(self, name: str, **supervision: float) -> SupervisedLaw:
        """A law of `LAWS` for this robot and wearer, under a supervisor that knows its encoder and its drive."""
        place = self.person.slider(self.rig)
        if name == "compensation":
            law: ControlLaw = compensation(self.cards["load"], slider=place, limits=ELBOW_LIMITS)
        else:
            named = ELBOW_CONTROLLERS[name]
            limb = {"limb": self.person.forearm} if named.wearer else {}
            exponents = {"exponents": COMMON_EXPONENTS} if named.exponents else {}
            law = named.build(self.cards[named.method], place, **limb, **exponents)
        return self.watched(law, **supervision)

    def watched(self, law: ControlLaw, **supervision: float) -> SupervisedLaw:
        """A law made for this robot and wearer under such a supervisor."""
        # What was identified of the robot is known whatever law it runs.
        place = self.person.slider(self.rig)
        body = body_of(compensation(self.cards["load"], slider=place, limits=ELBOW_LIMITS))
        return supervised(law, instruments=self.instruments(), body=body, answer=self.answer, **supervision)

    def instruments(self) -> Instruments:
        """What the robot measures."""
        robot = self.rig.robot
        resolution = robot.quantum + 4.0 * robot["encoder"]["noise"]
        return Instruments(
            resolution, drive=True, drive_limit=robot.gain * robot["motor"]["current_limit"], force_range=25.0
        )

    def live(
        self,
        law: SupervisedLaw,
        fault: str = "none",
        *,
        onset: float = 0.0,
        seconds: float = 10.0,
        longest: float = 3600.0,
        stops: Sequence[float] = (),
        seed: int = 0,
    ) -> dict:
        """What `WornElbow.live` says of this wearer under a law, with a `fault` at an `onset` [s] that is watched for
        so many `seconds`; `stops` of the wearer in [s]."""
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
        )


def make_worn_robot(rig: PointingRig, person: Person, cards: Mapping[str, SliderCard], seed: int) -> WornRobot:
    """Somebody's habits, drawn with a `seed`, in a robot that was identified as `cards` say."""
    rng = np.random.default_rng([seed, 9])
    here, planning, sensor = rig["pointing"]["reference"], rig["planning"], rig["force_sensor"]
    amplitudes = np.deg2rad(rng.choice(rig["pointing"]["amplitudes"], TASK_MOVEMENT_COUNT // 2))
    tasks = []
    for lift in amplitudes:
        for goal, way in ((here + lift, lift), (here, -lift)):
            reaction = max(planning["reaction"][0] + planning["reaction"][1] * rng.standard_normal(), 0.12)
            duration = rng.uniform(*DURATION_RANGE_S)
            slot = max(rng.uniform(*SLOT_RANGE_S), reaction + duration + 0.2)
            reach = planning["reach"] + planning["reach_spread"] * rng.standard_normal()
            tasks.append((goal, reach * way, duration, reaction, round(slot / rig.period) * rig.period))
    noise = rng.standard_normal((NOISE_PERIOD_COUNT, 5)) * np.array([1.0, 1.0, rig.robot["encoder"]["noise"], 1.0, 1.0])
    error = sensor["offset"] * rng.standard_normal() + sensor["noise"] * rng.standard_normal(NOISE_PERIOD_COUNT)
    tremor = rng.uniform(*TREMOR[0]), 2.0 * np.pi * rng.uniform(*TREMOR[1])
    return WornRobot(
        rig, person, cards, np.array(tasks), noise, error, tremor, 1.0 + 0.1 * rng.standard_normal(2), seed
    )


def draw_sudden_stops(seconds: float, rng: np.random.Generator) -> np.ndarray:
    """When a wearer stops suddenly within a time [s], shape (m,) [s]."""
    count = rng.poisson(seconds / MEAN_STOP_INTERVAL_S)
    return np.sort(rng.uniform(1.0, seconds, count))
