"""One control step of the elbow's laws: the core and the same law in Python, as a lab would write it.

Both drive the same virtual robot on a person's arm first, and must command the same torque. Then single steps are
timed, both implementations by turns. The rows report the median and the 99.9th percentile over all steps.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

import numpy as np

from pellucid import _core
from pellucid.controllers.control_law import ControlLaw, step_times
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.models.simulate import substeps_for
from pellucid_lab.pointing.people import draw_people
from pellucid_lab.pointing.rig import elbow_participants

from ._plain_laws import PLAIN_LAWS
from ._size import sized
from .export import elbow_card
from .identification import _row

LAWS = {"FC": "fc", "PCFr": "pcfr", "CLPC": "clpc", "best": "transparent", "best with force sensor": "force_sensor"}
"""Names of the measured controllers, by their names in the table."""

TURN_COUNT = sized(7, smallest=1)
"""Number of turns, in each of which both sides are timed."""

STEP_COUNT = sized(20_000, smallest=2_000)
"""Number of steps of each side in a turn."""

MAX_DIFFERENCE_NM = 1e-9
"""Largest difference between the two sides [N*m]."""

CEINMS_RT_S = {"p50": 58e-6, "p99": 1.5e-3}
"""Time of CEINMS-RT's whole pipeline from EMG to torques on two cores [s].

These are reported figures, not run here, and for other work."""


def worn(law: ControlLaw) -> Callable[[int, float], tuple[np.ndarray, ...]]:
    """A person's arm in the robot under a law; moves there and back, and returns what the core does."""
    rig = elbow_participants()
    person = draw_people(rig, np.random.default_rng(1))[0]
    robot, motor = rig.robot, rig.robot["motor"]
    here, noise = rig["pointing"]["reference"], np.random.default_rng(2).standard_normal((5000, 5))
    noise[:, 2] *= robot["encoder"]["noise"]
    arm = _core.WornElbow(
        person.vector(rig), np.zeros(5), position0=here, robot=robot.plant(person.slider(rig)),
        strap=rig.strap,
        # One newton metre per ampere, and no limit of the current: the torque is what the law asked for.
        drive=[1.0, 1e3, motor["ripple_amplitude"], motor["ripple_wave_number"], robot.quantum],
        law=law.kind, law_parameters=law.parameters, emg_gains=[1.0, 1.0], substeps=substeps_for(rig.period),
    )  # fmt: skip

    def move(periods: int, lift: float) -> tuple[np.ndarray, ...]:
        return arm.move(
            target=here + max(lift, 0.0), amplitude=lift, duration=0.7, reaction=0.2, load=np.zeros(5), tolerance=0.0,
            hold=1e9, noise=noise, longest=periods, sensor_error=np.zeros(5000) if law.sensed else None,
        )  # fmt: skip

    return move


def driven(law: ControlLaw) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Encoder [rad], interaction torque and command of the core [N*m] over ten movements; (n,) each."""
    move = worn(law)
    moved = [move(2000, 0.6 if i % 2 == 0 else -0.6) for i in range(10)]
    return tuple(np.concatenate([one[i] for one in moved]) for i in (3, 4, 5))


def plain_times(law: ControlLaw, m, q: np.ndarray, felt: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Torques [N*m] of the plain law, and the time of each step [s]."""
    plain, clock = PLAIN_LAWS[law.kind](m, law.values), time.perf_counter_ns
    torques, took = np.empty(len(q)), np.empty(len(q))
    micros = round(1e6 * law.values["period"])
    for i, (position, torque) in enumerate(zip(q.tolist(), felt.tolist(), strict=True)):
        begun = clock()
        torques[i] = plain.step(position, torque, i * micros, i)
        took[i] = clock() - begun
    return torques, 1e-9 * took


def periods_per_second(law: ControlLaw, threads: int) -> list[float]:
    """Periods of person, robot and law a second, in each turn."""
    arms = [worn(law) for _ in range(threads)]
    rates = []
    with ThreadPoolExecutor(threads) as pool:
        for turn in range(TURN_COUNT):
            begun = time.perf_counter()
            list(pool.map(lambda move, lift=0.6 if turn % 2 == 0 else -0.6: move(STEP_COUNT, lift), arms))
            rates.append(threads * STEP_COUNT / (time.perf_counter() - begun))
    return rates


def run() -> list[dict]:
    """Rows of name, value, unit, note."""
    rows = []
    for name, controller in LAWS.items():
        named = ELBOW_CONTROLLERS[controller]
        law = named.build(elbow_card(named.method), 0.2)
        q, felt, asked = driven(law)
        core, plain = [], {"Python": [], "NumPy": []}
        for _ in range(TURN_COUNT):
            core.append(step_times(law, STEP_COUNT))
            for words, m in (("Python", math), ("NumPy", np)):
                torques, took = plain_times(law, m, q, felt)
                plain[words].append(took)
                apart = float(np.max(np.abs(torques - asked)))
                if not apart <= MAX_DIFFERENCE_NM:
                    raise AssertionError(f"{name}: {words} and core differ by {apart} N*m")
        note = f"{TURN_COUNT * STEP_COUNT} steps; same torque within {MAX_DIFFERENCE_NM:g} N*m over {len(q)} steps"
        for words, turns in {"core": core, **plain}.items():
            steps = 1e9 * np.concatenate(turns)
            for label, share in (("p50", 50.0), ("p99.9", 99.9)):
                rows.append(_one(f"law: {name}, {words}, {label}", float(np.percentile(steps, share)), "ns", note))
        for words, turns in plain.items():
            ratio = [float(np.median(b) / np.median(a)) for a, b in zip(core, turns, strict=True)]
            rows.append(_row(f"law: {name}, {words} over core", ratio, "1", "medians, turn by turn"))
        rows.append(_one(f"law: {name}, steps a second", 1.0 / float(np.median(core)), "1/s", "one core, law alone"))
    fc = ELBOW_CONTROLLERS["fc"]
    law = fc.build(elbow_card(fc.method), 0.2)
    for threads in (1, 2):
        words = f"law: person, robot and FC, {threads} core{'s' * (threads > 1)}"
        rows.append(_row(words, periods_per_second(law, threads), "1/s", "periods of 1 ms"))
    for label, seconds in CEINMS_RT_S.items():
        rows.append(
            _one(f"law: CEINMS-RT, {label}", 1e9 * seconds, "ns", "reported, two cores, EMG to torques; not run here")
        )
    return rows


def _one(name: str, value: float, unit: str, note: str) -> dict:
    return {"name": name, "value": value, "unit": unit, "note": note}
