"""Run the whole workflow in a minute: a real joint, a virtual robot, people who wear it, and its exported controller.

Each chapter is an ordinary study in a folder of its own, so that every command can be tried on it afterwards.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

from pellucid._atomic import write_text_atomically
from pellucid._errors import PellucidError
from pellucid._given import require_folder
from pellucid._processes import processes
from pellucid.controllers.control_law import ControlLaw
from pellucid.controllers.elbow_controllers import BEST_CONTROLLER, BEST_SENSED_CONTROLLER, ELBOW_CONTROLLERS
from pellucid.controllers.export.c_folder import check_on_host
from pellucid.controllers.export.elbow_values import lowest_resonance
from pellucid.controllers.export.export import export
from pellucid.controllers.export.microcontroller import measure, missing_tools, save_measured
from pellucid.joint.slider.slider_fit import SliderFit
from pellucid.joint.study.joint_result import JointResult
from pellucid.models.slider_joint import SliderCard, read_slider_card
from pellucid.people.study.assessment_result import AssessmentResult
from pellucid.study.datasets.registry import names, shipped
from pellucid.study.instruments_table import RUN_FOLDER
from pellucid.study.procedures.registry import asked, open_study
from pellucid.study.procedures.run import assess, identify
from pellucid.study.results import ResultRow, read_rows, write_rows
from pellucid.study.study import RESULTS_FILE, STUDY_FILE, Study

from ..elbow.protocol import ElbowTrial, trials
from ..elbow.rig import ElbowRig, able_elbow
from ..pointing.conditions import controller_builder
from ..pointing.people import Person
from ..pointing.rig import PointingRig, elbow_participants
from ..pointing.session import CONTROL_CONDITION
from ..study import write_study
from .beside import count_coverage, identify_machine, write_kept_report
from .coverage import Coverage
from .demonstration import Demonstration
from .replayed_session import ReplayedSession, record_and_replay
from .story import write_story

COMMAND_NAME = "demo"
"""Name of the command in the rows of results.json."""

SEED = 11
"""Seed of every random draw."""

ELBOW_STUDY = "elbow"
"""Name and folder of the virtual robot's study."""

PEOPLE_STUDY = "people"
"""Name and folder of the study of simulated people who wear the robot."""

WORN_CONTROLLERS = ("clpc", BEST_CONTROLLER, BEST_SENSED_CONTROLLER)
"""Controllers that people wear: the published one of the robot's maker, and the best without and with a force
sensor."""

PEOPLE_COUNT = 3
"""Number of simulated people, which is enough for a demonstration but far too few for a proof."""

REPETITION_COUNT = 1
"""Number of repetitions of every movement by each person. A second one adds 30 MB of recordings, and so few people
prove nothing with it either."""

COVERAGE_REPETITIONS = 100
"""Number of identifications from which the coverage of intervals is estimated."""

HELD_OUT_PLACE_COUNT = 2
"""Number of positions of the carriage at which held-out trials are recorded."""

SESSION_CONTROLLER = WORN_CONTROLLERS[0]
"""Controller of the recorded session."""

DEMO_FILE = "demo.txt"
"""File that marks a folder whose studies a demo may replace."""

DEMO_FILE_TEXT = (
    "The other folders here were made by: pellucid demo. The next demo in this folder replaces them.\n"
)
"""Text of the file that marks a demo's folder."""

Tell = Callable[[str, float], None]


def demo(out: Path | str, *, on_progress: Tell | None = None) -> Demonstration:
    """Run the whole workflow in a folder.

    Parameters
    ----------
    out : path
        Folder, which is created if it does not exist; studies of an earlier demo in it are replaced.
    on_progress : callable, optional
        Function that is called with a text and the share done, 0 to 1.

    Returns
    -------
    Demonstration

    Raises
    ------
    PellucidError
        If `out` contains a file that no demo made.

    Examples
    --------
    >>> import pellucid as pl
    >>> made = pl.demo("a-demonstration")                                    # doctest: +SKIP
    """
    tell = on_progress or (lambda text, share: None)
    out, robot = require_folder(Path(out), "a folder for the demo's studies"), able_elbow()
    notes: list[str] = []
    real_name = next(name for name in names() if shipped(name) is not None)
    folders = {name: out / name for name in (real_name, ELBOW_STUDY, PEOPLE_STUDY)}
    _clear_folders(tuple(folders.values()), out)
    # A second process identifies the real machine, counts what intervals hold and draws reports, while this one moves
    # the virtual robot and its people: two cores are busy all the time. Results go by what every command keeps.
    with processes(1) as helper:
        tell(f"a real machine, {real_name}, is identified in parallel with all other steps", 0.0)
        machine = helper.submit(identify_machine, folders[real_name], real_name)
        counted = helper.submit(count_coverage, COVERAGE_REPETITIONS)
        elbow, fit = _identified_elbow(folders[ELBOW_STUDY], robot, _progress_part(tell, 0.02, 0.35))
        reports = [helper.submit(write_kept_report, elbow.folder)]
        people, findings = _assessed_people(folders[PEOPLE_STUDY], robot, elbow, _progress_part(tell, 0.35, 0.75))
        reports.append(helper.submit(write_kept_report, people.folder))
        tell(f"its controller {BEST_SENSED_CONTROLLER} is exported, in parallel with a recorded session", 0.75)
        # The session takes its seconds in real time, most of which a process of its own spends waiting.
        with ThreadPoolExecutor(1) as beside:
            recorded = beside.submit(_replayed_session, elbow, elbow.folder / RUN_FOLDER / ELBOW_STUDY, notes)
            controller = export(elbow, controller=BEST_SENSED_CONTROLLER)
            played, absent = check_on_host(controller), missing_tools()
            cost = None if absent else measure(controller)
            save_measured(elbow, controller, cost, controller=BEST_SENSED_CONTROLLER)
            if absent:
                notes.append(f"The exported controller was not run on a Cortex-M4F: {', '.join(absent)} not installed.")
            replayed = recorded.result()
        tell("the reports of every chapter are drawn", 0.9)
        machine.result()
        coverages = counted.result()
        for written in reports:
            written.result()
    real, real_fit = _kept_machine(folders[real_name])
    write_rows(out / "results.json", COMMAND_NAME, [_coverage_row(found) for found in coverages])
    tell("the page that tells it all", 0.96)
    made = Demonstration(
        page=out, robot=robot, elbow=elbow, fit=fit, people=people, findings=findings, controller=controller, cost=cost,
        played=played, coverages=tuple(coverages), real=real, real_fit=real_fit, notes=tuple(notes), replayed=replayed,
    )  # fmt: skip
    made = replace(made, page=write_story(out, made))
    tell("done", 1.0)
    return made


def elbow_trials(robot: ElbowRig) -> tuple[ElbowTrial, ...]:
    """Return the robot's trials: constant velocities and sweeps for the fit; both and slow movements held out."""
    made = [
        trial for trial in trials(robot) if trial.protocol in ("constant_velocity", "swept_sine", "slow", "reversals")
    ]
    unseen = [t for t in made if t.name.startswith("unseen")]
    places = sorted({t.slider for t in unseen})[:: -(-len({t.slider for t in unseen}) // HELD_OUT_PLACE_COUNT)]
    return tuple(t for t in made if t.use == "fit" or (t in unseen and t.slider in places))


def few_people(robot: ElbowRig) -> PointingRig:
    """Return the rig of simulated people with fewer people and repetitions, and otherwise unchanged."""
    return elbow_participants(robot).changed({"people.count": PEOPLE_COUNT, "pointing.repetitions": REPETITION_COUNT})


def _kept_machine(folder: Path) -> tuple[Study, JointResult]:
    """Return the real machine's study and its kept identification, which is repeated if it was not kept."""
    study = open_study(folder)
    kept = next((found for each in asked(study) if (found := JointResult.kept(study, each)) is not None), None)
    return study, identify(study) if kept is None else kept


def _identified_elbow(folder: Path, robot: ElbowRig, tell: Tell) -> tuple[Study, SliderFit]:
    tell("a virtual elbow exoskeleton moves", 0.0)
    study = write_study(folder, robot, name=ELBOW_STUDY, seed=SEED, trials=elbow_trials(robot))
    fit = identify(study, on_progress=lambda text, share: tell(f"{ELBOW_STUDY}: {text}", 0.3 + 0.7 * share))
    fit.save(study)
    return study, fit.fit


def _replayed_session(elbow: Study, folder: Path, notes: list[str]) -> ReplayedSession | None:
    """Record a session and compute it again; None, with a note, where this system cannot run one."""
    try:
        return record_and_replay(_read_cards(elbow), SESSION_CONTROLLER, folder)
    except PellucidError as error:
        notes.append(f"No session was recorded: {error}")
        return None


def _read_cards(elbow: Study) -> dict[str, SliderCard]:
    """Return the cards on disk that the worn controllers are made from, by method."""
    needed = {controller.method: controller.card for controller in map(ELBOW_CONTROLLERS.get, WORN_CONTROLLERS)}
    return {method: read_slider_card(elbow.models_dir / card) for method, card in needed.items()}


def worn_controllers(elbow: Study) -> dict[str, Callable[[Person, float], ControlLaw]]:
    """Return functions that build what people wear from the cards on disk, by name.

    The gain on the interaction torque is that of an export of the same study.
    """
    cards = _read_cards(elbow)
    stated = lowest_resonance(elbow)
    return {name: controller_builder(cards, name, lowest_resonance=stated) for name in WORN_CONTROLLERS}


def _assessed_people(folder: Path, robot: ElbowRig, elbow: Study, tell: Tell) -> tuple[Study, AssessmentResult]:
    """Let people point without the robot and with controllers built from the cards on disk, and assess them."""
    conditions = {CONTROL_CONDITION: None, **worn_controllers(elbow)}
    tell(f"{PEOPLE_COUNT} simulated people point without and with the robot", 0.0)
    study = write_study(
        folder,
        few_people(robot).under(conditions),
        name=PEOPLE_STUDY,
        seed=SEED,
        threads=2,
        on_progress=lambda text, share: tell(text, 0.5 * share),
    )
    findings = assess(study, on_progress=lambda text, share: tell(f"{PEOPLE_STUDY}: {text}", 0.5 + 0.5 * share))
    findings.save(study)
    return study, findings


def _progress_part(tell: Tell, start: float, stop: float) -> Tell:
    """Return a progress function that maps shares of 0 to 1 to shares of `start` to `stop` for `tell`."""
    return lambda text, share: tell(text, start + share * (stop - start))


def _coverage_row(found: Coverage) -> ResultRow:
    each = ", ".join(f"{name} {share:.1f}" for name, share in found.by_parameter.items())
    return ResultRow(
        id=f"virtual.symmetric.coverage.{found.colour}",
        value=found.lowest,
        unit="%",
        command=COMMAND_NAME,
        split="simulated",
        data_checksum="",
        note=(
            f"lowest coverage over the parameters of nominal 95 % intervals, {found.repetitions} seeded repetitions: "
            f"{each}; textbook intervals {found.textbook:.1f}"
        ),
    )


def _clear_folders(folders: Sequence[Path], out: Path) -> None:
    """Remove the folders of an earlier demo; raise a PellucidError, before any is removed, if no demo made them."""
    found = [folder for folder in folders if folder.exists()]
    results = out / RESULTS_FILE
    made = (out / DEMO_FILE).is_file() or (
        results.is_file() and any(r.command == COMMAND_NAME for r in read_rows(results))
    )
    for folder in found:
        if not folder.is_dir() or (any(folder.iterdir()) and not (made and (folder / STUDY_FILE).is_file())):
            raise PellucidError(
                f"{folder}: found something that no demo made, expected nothing or an earlier demo's study; name "
                "another folder with --out"
            )
    write_text_atomically(out / DEMO_FILE, DEMO_FILE_TEXT)
    for folder in found:
        shutil.rmtree(folder)
    for folder in folders:
        folder.parent.mkdir(parents=True, exist_ok=True)
