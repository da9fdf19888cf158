"""The paper's three steps on the virtual shank exoskeleton: Tables 2 to 5 and Figs. 5 to 11, beside what it prints."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from ...lab.seated.protocol import SeatedTrial, seated_trials
from ...lab.seated.rig import SeatedRig, load_seated_rig
from ...lab.seated.study import record_seated, seated_recording
from ...lab.seated.subject import subjects
from ...recordings.results import ResultRow
from ..printed import PrintedPaper, printed
from ..processes import finished
from ..reproduction import Reproduced, write_results
from .recomputed import recomputed
from .rows import step_rows, torque_rows, training_rows
from .steps import BodyFound, LegFound, find_body, find_leg
from .torque import TorqueFound, find_torque
from .training import Training, train
from .trials import active_swing, driven_swing, take_subject

SEED = 1
"""Of all noise."""

COMMAND = "reproduce hill"

FITTED = ("hill.adam.", "hill.swarm.", "hill.order.", "hill.parameters.")
"""Beginnings of ids that are judged on what was fitted; p and q on the rig's own constants; the rest is held out."""

SIMULATED = ("hill.recomputed.", "hill.p.", "hill.q.", "hill.empty.")


@dataclass(frozen=True, eq=False)
class SubjectFound:
    """All three steps of one subject."""

    name: str
    leg: LegFound
    torque: TorqueFound
    training: Training


@dataclass(frozen=True, eq=False)
class HillReproduction:
    """Everything `reproduce_hill` computed."""

    rows: tuple[Reproduced, ...]
    results: tuple[ResultRow, ...]
    rig: SeatedRig
    paper: PrintedPaper
    empty: BodyFound
    subjects: Mapping[str, SubjectFound]


def reproduce_hill(
    out: Path,
    *,
    names: Sequence[str] | None = None,
    seed: int = SEED,
    workers: int | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> HillReproduction:
    """Do the paper's experiments on the virtual shank exoskeleton, and write results.json and reproduction.json."""
    tell = on_progress or (lambda text, share: None)
    rig, paper = load_seated_rig(), printed("hill")
    chosen = tuple(rig["subjects"]) if names is None else tuple(names)
    tell("a swing that shows inertia", 0.0)
    made = seated_trials(rig, chosen)
    tell("the exoskeleton alone", 0.03)
    alone = [t for t in made if t.subject is None]
    empty = find_body(
        {
            k.trial.name.removeprefix("empty_"): driven_swing(seated_recording(rig, k))
            for k in record_seated(rig, alone, seed)
        }
    )
    found = {}
    for i, subject in finished([(_subject, rig, made, empty, name, seed) for name in chosen], workers):
        found[chosen[i]] = subject
        tell(f"subject {chosen[i]}", 0.05 + 0.9 * len(found) / len(chosen))
    people = {name: found[name] for name in chosen}
    rows = (
        *step_rows(empty, {n: s.leg for n, s in people.items()}, paper),
        *torque_rows({n: s.torque for n, s in people.items()}, paper),
        *training_rows(empty, {n: (s.leg, s.training, s.torque) for n, s in people.items()}, paper),
        *recomputed(paper),
    )
    results = write_results(out, COMMAND, rows, _split)
    return HillReproduction(rows, results, rig, paper, empty, people)


def _subject(rig: SeatedRig, made: list[SeatedTrial], empty: BodyFound, name: str, seed: int) -> SubjectFound:
    taken = take_subject(rig, made, subjects(rig)[name], seed)
    leg = find_leg(empty, taken)
    torque = find_torque(empty, leg, taken)
    fitted = active_swing(taken, "swing_1", leg.body.corrected["rich"], flexors=True)
    return SubjectFound(name, leg, torque, train(fitted.trial, torque.hill.choice.weight))


def _split(row: str) -> str:
    if row.startswith(SIMULATED):
        return "simulated"
    return "fitted" if row.startswith(FITTED) else "heldout"
