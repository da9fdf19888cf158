"""Users' control laws and indices: ranking, required stops, and choice of the index.

- A C file and a Python class with the same law drive the virtual knee in comparison with the lab's plain modes, the
virtual elbow
  and an arm of four joints; their commands are compared bit by bit. Four hostile laws must be stopped on each robot:
  one never answers, one crashes, one asks for 4 GB, one answers no number.
- The worst single fault under them at the knee and at the arm, in joules, compared with own laws.
- The certificate of the law at the elbow, on twelve simulated people, compared with the robot without power and the
toolkit's
  law with a force sensor.
- The indices of `transparency_indices` on the same sessions: which orders of controllers they give, how far these agree
  with those by indices of other kinds, and how far pairs of people and robots agree on the order. The robot's friction
  has the form that the models suppose, as in the whole ranking.
"""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import pellucid_lab.ranking.elbow as elbow
from pellucid.people.certificate import CANNOT_SAY
from pellucid.study.results import ResultRow
from pellucid_lab.elbow.rig import able_elbow, drawn_rigs
from pellucid_lab.knee.protocol import swing_trial
from pellucid_lab.knee.rig import knee_orthosis
from pellucid_lab.knee.trial import run_trial
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants
from pellucid_lab.pointing.session import simulate_session
from pellucid_lab.processes import ordered_results
from pellucid_lab.ranking.arm import ArmInUse, arm_pair, draw_arm_in_use
from pellucid_lab.ranking.foreign_elbow import elbow_law_of
from pellucid_lab.ranking.foreign_law import ForeignLaw, ForeignLaws, ForeignProcess, stopped_words
from pellucid_lab.ranking.knee import knee_pair
from pellucid_lab.ranking.law_certificate import CERTIFICATE_VALUES, certificate_note, certify_controller
from pellucid_lab.ranking.strategies import SWING_TASK
from pellucid_lab.ranking.transparency_indices import TRANSPARENCY_INDICES, IndexComparison, index_values
from pellucid_lab.ranking.tried import ControllerTrial
from pellucid_lab.ranking.watched_knee import IdentifiedDrive, WatchedController
from pellucid_lab.safety.fault_table import draw_worn_robot
from pellucid_lab.safety.worn_knee import IDENTIFIED_ACTUATOR
from pellucid_lab.safety.worn_robot import WornRobot
from research.benchmarks._size import sized

from ._parts import run_parts

EXAMPLES = Path(__file__).parents[2] / "examples" / "laws"
"""Folder of the example of a foreign law, in C and in Python."""

SEED = 29
"""Seed of people, robots and noise."""

PAIR_COUNT = sized(6, smallest=1)
"""Number of pairs of a person and a robot whose sessions indices are computed on."""

LIFTS_RAD = np.array([0.4])
"""Movement of the elbow in which foreign laws are compared [rad]."""

TRIAL_S = sized(12.0, smallest=2.0)
"""Duration of a trial at the knee [s]."""

INDEX_CONTROLLERS = ("unpowered", "clpc", "pcfr", "fc", "transparent", "dithered", "amplification", "force_sensor",
                     "residual")  # fmt: skip
"""Controllers whose order is compared between indices."""

ARM_CONTROLLERS = sized(("unpowered", "fc", "force_sensors"), smallest=("unpowered",))
"""Own controllers that are compared with foreign laws at the arm."""

ARM_PERIODS = sized(3000, smallest=400)
"""Number of control periods in which foreign laws are compared at the arm, of 1 ms."""

CERTIFIED_PEOPLE = sized(12, smallest=2)
"""Number of simulated people of the certificates."""

HOSTILE_LAWS = {
    "hangs": "while True: pass",
    "crashes": "import ctypes; ctypes.string_at(0)",
    "takes_4_gb": "self.held = bytearray(4 * 1024**3)",
    "answers_nan": "return float('nan')",
}
"""What each hostile law does after a fifth of a second."""


def rows() -> Iterator[ResultRow]:
    """Every figure."""
    yield from run_parts("ranking", {
        "foreign laws": foreign_rows,
        "arms": arm_rows,
        "certificates": certificate_rows,
        "hostile laws": hostile_rows,
        "indices": index_rows,
    })  # fmt: skip


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"ranking.{name}", float(value), unit, "evidence", "simulated", None, note)


def foreign_rows() -> Iterator[ResultRow]:
    """Foreign laws in the ranking, and their bits."""
    laws, plain = example_laws(), ("no_control", "zero_impedance", "body")
    tried = knee_pair(0, SEED, only=plain, laws=laws)
    found = {one.controller: one for one in tried if one.task == SWING_TASK}
    ranked = [law for law in laws if np.isfinite(found[law.name].torque)]
    yield _row("foreign_laws", len(ranked), "1", f"ranked with {', '.join(plain)} on one simulated wearer")
    for name, one in found.items():
        yield _row(f"swings.torque.{_plain(name)}", one.torque, "N*m", "RMS, strap")
        if one.fault_energy is not None:
            yield _row(f"swings.fault_energy.{_plain(name)}", one.fault_energy, "J", "worst single fault, one wearer")
    worn, wrong, of = draw_worn_robot(0, SEED), 0, 0
    arm = compared_arm()
    for answered in (_commands, partial(_elbow_commands, worn), partial(_arm_commands, arm)):
        commands = [answered(law)[0] for law in laws]
        wrong += int(np.sum(commands[0].view(np.int64) != commands[1].view(np.int64)))
        of += len(commands[0])
    yield _row("foreign_law.wrong_bits", wrong, "1", f"of {of} commands at knee, elbow and arm, C against Python")


@cache
def compared_arm() -> ArmInUse:
    """Return the drawn arm at which commands of foreign laws are compared."""
    return draw_arm_in_use(0, SEED, ())


def example_laws() -> list[ForeignLaw]:
    """Return the example of a foreign law in C and in Python."""
    return [ForeignLaw.from_file(EXAMPLES / f"spring_to_zero{ending}") for ending in (".c", ".py")]


def _plain(controller: str) -> str:
    """Return a controller's name for an id."""
    return controller.replace("law:", "").replace(".", "_")


def arm_rows() -> Iterator[ResultRow]:
    """Yield torque and worst single fault of a foreign law and of own laws on one simulated arm."""
    for one in arm_pair(0, SEED, ARM_CONTROLLERS, example_laws()):
        yield _row(f"reaching.torque.{_plain(one.controller)}", one.torque, "N*m", "RMS over joints, one wearer")
        if one.fault_energy is not None:
            yield _row(f"reaching.fault_energy.{_plain(one.controller)}", one.fault_energy, "J", "worst single fault")


def certificate_rows() -> Iterator[ResultRow]:
    """Yield the certificate's verdicts on a foreign law and on own laws, for simulated people who point."""
    jobs = [(_certified_pair, i) for i in range(CERTIFIED_PEOPLE)]
    tried = [one for made in ordered_results(jobs) for one in made]
    for name in dict.fromkeys(one.controller for one in tried):
        own = [one for one in tried if one.controller == name]
        found = certify_controller(own)
        value = CERTIFICATE_VALUES[CANNOT_SAY if found is None else found.verdict]
        note = CANNOT_SAY if found is None else certificate_note(found, len(own))
        yield _row(f"certificate.{_plain(name)}", value, "1", note)


def _certified_pair(index: int) -> list[ControllerTrial]:
    robot = drawn_rigs(able_elbow(), index + 1, seed=elbow.ROBOTS_SEED + SEED)[index]
    rig = elbow_participants(robot)
    person = draw_people(rig, np.random.default_rng([elbow.ROBOTS_SEED, SEED]), count=CERTIFIED_PEOPLE)[index]
    return elbow.try_elbow(
        rig, person, index, SEED, only=("unpowered", "force_sensor"), laws=example_laws()[:1], faults=False
    )  # fmt: skip


def hostile_rows() -> Iterator[ResultRow]:
    """Hostile laws that were not stopped."""
    survived, said, worn, arm = 0, [], draw_worn_robot(0, SEED), compared_arm()
    with TemporaryDirectory() as place:
        for name, does in HOSTILE_LAWS.items():
            path = Path(place) / f"{name}.py"
            body = f"self.n += 1\n        if self.n > 100:\n            {does}\n        return 1.0"
            head = "class Law:\n    def reset(self): self.n = 0\n    def step(self, *sample):\n        "
            arm_step = "def arm_step(self, *sample):\n        return [self.step()] * 4"
            path.write_text(f"{head}{body}\n    elbow_step = step\n    {arm_step}\n")
            law = ForeignLaw.from_file(path)
            # At the elbow a damped stop holds the robot with little effort, at the arm against the weight too.
            for (commands, fault), most in (
                (_commands(law), 1e-9), (_elbow_commands(worn, law), 0.1), (_arm_commands(arm, law), 30.0)
            ):  # fmt: skip
                survived += fault == "none" or not np.isfinite(commands).all() or abs(commands[-1]) > most
                said.append(f"{name}: {stopped_words(fault)}")
    yield _row("hostile_laws.survived", survived, "1", "; ".join(said))


def _commands(law: ForeignLaw) -> tuple[np.ndarray, str]:
    rig = knee_orthosis()
    subject = next(iter(rig.subjects.values()))
    drive = IdentifiedDrive(IDENTIFIED_ACTUATOR["actuator_coulomb"], IDENTIFIED_ACTUATOR["actuator_inertia"])
    with ForeignLaws(law) as build:
        controller = WatchedController(build(), rig, drive)
        trial = swing_trial(rig, "swing", subject, duration=TRIAL_S)
        readings = run_trial(rig, trial, rng=np.random.default_rng(SEED), controller=controller)
    return readings.command, controller.fault


def _elbow_commands(worn: WornRobot, law: ForeignLaw) -> tuple[np.ndarray, str]:
    with closing(ForeignProcess(law)) as process:
        supervised = elbow_law_of(process, worn, start_up=False)
        session = simulate_session(worn.rig, worn.person, "worn", supervised, np.random.default_rng(SEED), LIFTS_RAD)
    return session.signals["command"], process.fault


def _arm_commands(arm: ArmInUse, law: ForeignLaw) -> tuple[np.ndarray, str]:
    short = replace(arm, motion=replace(arm.motion, position=arm.motion.position[:ARM_PERIODS]))
    with closing(ForeignProcess(law)) as process:
        effort = short.wear(short.commanded(process)).effort
    return effort.ravel(), process.fault


def index_pair(index: int) -> dict[str, dict[str, float]]:
    """Return every index by controller on one pair of a simulated person and a simulated robot."""
    robot = drawn_rigs(able_elbow(), index + 1, seed=elbow.ROBOTS_SEED + SEED)[index]
    rig = elbow_participants(robot)
    person = draw_people(rig, np.random.default_rng([elbow.ROBOTS_SEED, SEED]), count=max(PAIR_COUNT, 6))[index]
    laws, _ = elbow.elbow_laws(robot, rig, person, INDEX_CONTROLLERS)
    free = elbow.point(rig, person, None, [SEED, index])
    return {name: index_values(elbow.point(rig, person, law, [SEED, index]), free) for name, law in laws.items()}


def index_rows() -> Iterator[ResultRow]:
    """Agreement of every index with the others, and of pairs by every index."""
    found = ordered_results([(index_pair, i) for i in range(PAIR_COUNT)])
    names = [index.name for index in TRANSPARENCY_INDICES]
    values = {name: np.array([[pair[c][name] for c in INDEX_CONTROLLERS] for pair in found]) for name in names}
    compared = IndexComparison(INDEX_CONTROLLERS, values)
    yield _row("indices", len(values), "1", f"{PAIR_COUNT} pairs, {len(INDEX_CONTROLLERS)} controllers")
    for i in TRANSPARENCY_INDICES:
        note = f"{i.kind}: {i.words} ({i.source}); order: {', '.join(compared.order(i.name))}"
        yield _row(f"index.{i.name}.agreement", compared.mean_agreement(i.name), "1", note)
        yield _row(f"index.{i.name}.concordance", compared.concordance(i.name), "1", "Kendall's W over pairs")
        yield _row(f"index.{i.name}.with_torque_rms", compared.agreement(i.name, "torque_rms"), "1", "Kendall's tau")
