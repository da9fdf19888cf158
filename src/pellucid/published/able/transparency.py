r"""The published comparison of control laws, held again with virtual people: predictions beside what was printed.

The people were set by how they move without a robot, and frozen before one was strapped on; the laws are built from
what an identification of the robot found. Nothing here was chosen by what the paper reports of its robot.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from ..._errors import RecordingError
from ...assessment.assess import assess_recordings
from ...assessment.assessment_findings import AssessmentFindings
from ...controllers.elbow_laws import ElbowLaw
from ...controllers.law_fuzz import fuzz
from ...lab.elbow.rig import ElbowRig
from ...lab.pointing.conditions import Cards, chosen_exponents, interaction_rms, own_laws, published_laws
from ...lab.pointing.movement_choice import preferred_duration
from ...lab.pointing.people import Person, PointingRig, draw_people, elbow_participants
from ...lab.pointing.session import Session
from ...lab.pointing.study import CONTROL, pointing_config, record_pointing, study_text, take_part
from ...recordings.results import ResultRow
from ...signals.movements import MovementRule, Stretch, kinematics, movements

PUBLISHED = {
    "duration": {"FC": 2.4, "PCFr": 20.2, "CLPC": 18.6},
    "vmax": {"FC": -5.0, "PCFr": -19.1, "CLPC": -21.2},
}
"""Change from control in the means of Tables III and IV [%]; of EMG/Acc only the order is printed, FC < PCFr < CLPC."""


def injected_energy(session: Session) -> np.ndarray:
    """Energy that the robot gave the wearer over each movement there and back, shape (n,) [J]; below 0 it took some."""
    flow = -session.signals["interaction"] * session.signals["link"] / session.fs
    pairs = zip(session.movements[::2], session.movements[1::2], strict=True)
    return np.array([flow[there.begin : back.end].sum() for there, back in pairs])


def required_resistance(rig: PointingRig, people: Sequence[Person], slower: float = 0.2) -> dict[str, float]:
    """What would make these people choose movements longer by a share, each by itself.

    Parameters
    ----------
    rig : PointingRig
    people : sequence of Person
    slower : float
        Of the mean duration.

    Returns
    -------
    dict of str to float
        coulomb [N*m], viscous [N*m*s/rad], inertia [kg*m^2].
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


def session_means(session: Session) -> dict[str, float]:
    """Published indices of one session, from its true motion and excitation: no instrument stands in between.

    Parameters
    ----------
    session : Session

    Returns
    -------
    dict of str to float
        duration [s], vmax [rad/s], emg_per_acc [s^2/rad] upwards, and left_out [1], the share of movements that the
        rule cannot use.
    """
    seconds = np.arange(len(session.target)) / session.fs
    motion = kinematics(seconds, session.signals["position"], MovementRule())
    stretches = [Stretch(m.begin / session.fs, m.end / session.fs, m.amplitude) for m in session.movements]
    found, without = movements(motion, stretches, MovementRule())
    advance = round(0.1 * session.fs)
    ratios = []
    for one in found:
        if one.direction > 0:
            part = slice(max(one.first - advance, 0), max(one.last - advance, 0) + 1)
            level = np.sqrt(np.mean(session.signals["flexor"][part] ** 2))
            ratios.append(level / one.peak_acceleration)
    return {
        "duration": float(np.mean([one.duration for one in found])),
        "vmax": float(np.mean([one.peak_velocity for one in found])),
        "emg_per_acc": float(np.mean(ratios)),
        "left_out": len(without) / len(stretches),
    }


def changes(sessions: Sequence[Session], control: str = CONTROL) -> dict[str, dict[str, float]]:
    """Change from control of every condition, by index [%]; EMG/Acc is the mean of each person's own.

    Parameters
    ----------
    sessions : sequence of Session
        Everybody in every condition.
    control : str

    Returns
    -------
    dict of str to dict of str to float
        duration, vmax, emgacc; then by condition.
    """
    means = {(s.person.name, s.condition): session_means(s) for s in sessions}
    people = sorted({person for person, _ in means})
    found: dict[str, dict[str, float]] = {"duration": {}, "vmax": {}, "emgacc": {}}
    for condition in dict.fromkeys(s.condition for s in sessions):
        if condition == control:
            continue
        for index in ("duration", "vmax"):
            over, under = (np.mean([means[p, c][index] for p in people]) for c in (condition, control))
            found[index][condition] = float(100.0 * (over / under - 1.0))
        ratios = [means[p, condition]["emg_per_acc"] / means[p, control]["emg_per_acc"] for p in people]
        found["emgacc"][condition] = float(100.0 * (np.mean(ratios) - 1.0))
    return found


@dataclass(frozen=True)
class Comparison:
    """One study of the published conditions and the toolkit's own.

    Attributes
    ----------
    seed : int
    changes : dict
        As `changes` gives them.
    findings : AssessmentFindings or None
        As any lab would assess the recordings; None where the assessment refuses them.
    refused : str
        Why it does.
    exponents : tuple of float
    seconds : float
        That people, robots and instruments took [s].
    movements : int
    energy : dict of str to float
        By condition, the most that the robot gave over a closed cycle [J], of 99 % of cycles.
    """

    seed: int
    changes: dict[str, dict[str, float]]
    findings: AssessmentFindings | None
    refused: str
    exponents: tuple[float, float]
    seconds: float
    movements: int
    energy: dict[str, float]


def compare_laws(
    cards: Cards,
    exponents: tuple[float, float],
    *,
    seed: int,
    rig: PointingRig | None = None,
    threads: int = 2,
    laws: Mapping[str, Callable[[Person, float], ElbowLaw] | None] | None = None,
) -> Comparison:
    """Six people in every condition, assessed as any lab's recordings are.

    Parameters
    ----------
    cards : mapping
        Of the robot, by method.
    exponents : tuple of float
        Of equation 8.
    seed : int
        Draws people, orders and noise.
    rig : PointingRig, optional
        The package's if left out.
    threads : int
    laws : mapping, optional
        Conditions; the paper's four if left out.

    Returns
    -------
    Comparison
    """
    rig = rig or elbow_participants()
    conditions = published_laws(cards, exponents) if laws is None else laws
    begun = time.perf_counter()
    recordings, sessions = record_pointing(rig, conditions, seed=seed, threads=threads)
    seconds = time.perf_counter() - begun
    people = [s.person for s in sessions[:: len(conditions)]]
    spec = pointing_config(study_text(rig, people, (), "virtual-able")).assessment
    energy = {}
    for name, law in conditions.items():
        if law is not None:
            given = np.concatenate([injected_energy(s) for s in sessions if s.condition == name])
            energy[name] = float(np.quantile(given, 0.99))
    made = sum(len(s.movements) for s in sessions)
    findings, refused = None, ""
    try:
        findings = assess_recordings("virtual-able", recordings, spec)
    except RecordingError as error:
        # People who cannot hold a robot still end where no target is, and their recordings are not fit to be used.
        refused = str(error)
    return Comparison(seed, changes(sessions), findings, refused, exponents, seconds, made, energy)


def torque_ratios(
    robots: Sequence[tuple[ElbowRig, Cards]], *, seed: int, count: int = 3, threads: int = 2
) -> dict[str, np.ndarray]:
    """Interaction torque of the toolkit's laws over that of FC, on robots that they were not chosen on.

    Parameters
    ----------
    robots : sequence of (ElbowRig, mapping)
        Each with what its own identification found.
    seed : int
    count : int
        People who try each.
    threads : int

    Returns
    -------
    dict of str to ndarray, shape (robots,)
        By law.
    """
    found: dict[str, list[float]] = {}
    for robot, cards in robots:
        rig = elbow_participants(robot)
        people = draw_people(rig, np.random.default_rng(seed), count=count)
        exponents = chosen_exponents(rig, cards, threads=threads)[0]
        laws = {"FC": published_laws(cards, exponents)["FC"], **own_laws(cards)}
        torque = {}
        for name, make in laws.items():
            sessions = take_part(rig, {name: make}, seed=seed, people=people, threads=threads)
            torque[name] = float(np.mean([interaction_rms(s) for s in sessions]))
        for name in laws:
            found.setdefault(name, []).append(torque[name] / torque["FC"])
    return {name: np.array(ratios) for name, ratios in found.items()}


def mean_interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Mean of several studies and its 95 % interval by a normal law."""
    x = np.asarray(values, float)
    half = NormalDist().inv_cdf(0.975) * x.std(ddof=1) / np.sqrt(len(x)) if len(x) > 1 else float("nan")
    return float(x.mean()), float(x.mean() - half), float(x.mean() + half)


def transparency_rows(made: Sequence[Comparison], note: str) -> list[ResultRow]:
    """Rows of results.json: mean change from control of every published law over several studies.

    Parameters
    ----------
    made : sequence of Comparison
    note : str
        How it was made.

    Returns
    -------
    list of ResultRow
    """
    rows = []
    for index in ("duration", "vmax", "emgacc"):
        for condition in ("FC", "PCFr", "CLPC"):
            drawn = [one.changes[index][condition] for one in made]
            mean, low, high = mean_interval(drawn)
            printed = PUBLISHED.get(index, {}).get(condition)
            beside = f"; the paper {printed:+.1f} %" if printed is not None else ""
            text = f"mean of {len(made)} virtual studies, 95 % interval {low:.1f} to {high:.1f} %{beside}; {note}"
            rows.append(
                ResultRow(f"transparency.{index}.{condition.lower()}", mean, "%", "reproduce", "simulated", None, text)
            )
    seconds = float(np.median([one.seconds for one in made]))
    rows.append(
        ResultRow(
            "study.seconds", seconds, "s", "reproduce", "simulated", None, f"{made[0].movements} movements; {note}"
        )
    )
    return rows


def torque_rows(ratios: Mapping[str, np.ndarray], note: str) -> list[ResultRow]:
    """Rows of results.json: interaction torque of the toolkit's laws over that of FC.

    Parameters
    ----------
    ratios : mapping of str to ndarray, shape (robots,)
        From `torque_ratios`.
    note : str
        How it was made.

    Returns
    -------
    list of ResultRow
    """
    rows = []
    for law, name in (("best", "best_over_fc"), ("best_sensed", "best_over_fc.force_sensor")):
        drawn = ratios[law]
        text = f"median of {len(drawn)} robots, from {drawn.min():.3f} to {drawn.max():.3f}; {note}"
        rows.append(
            ResultRow(f"transparency.torque.{name}", float(np.median(drawn)), "1", "reproduce", "simulated", None, text)
        )
    return rows


def safety_row(laws: Mapping[str, ElbowLaw], *, cycles: int = 10_000_000, seed: int = 1) -> ResultRow:
    """Row of results.json: unsafe commands of all laws together among nonsense.

    Parameters
    ----------
    laws : mapping of str to ElbowLaw
        By condition.
    cycles : int
        Of each.
    seed : int

    Returns
    -------
    ResultRow
    """
    found = {name: fuzz(law, cycles, seed=seed) for name, law in laws.items()}
    faults, slowest = sum(f.faults for f in found.values()), max(f.slowest for f in found.values())
    text = f"{cycles} cycles of each of {', '.join(found)}; {faults} faults, safe after at most {slowest} cycle"
    return ResultRow("safety.unsafe", sum(f.unsafe for f in found.values()), "1", "reproduce", "simulated", None, text)
