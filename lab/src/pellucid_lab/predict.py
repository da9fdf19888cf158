"""The command `predict`: effects of controllers on movement, predicted with intervals by simulated experiments."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from inspect import signature
from pathlib import Path
from typing import Any

from pellucid._errors import PellucidError, StudyError
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS, stated_load
from pellucid.people.study.assessment_tables import people_words
from pellucid.study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step
from pellucid.study.pages.quantities import number
from pellucid.study.pages.values import Value
from pellucid.study.procedures.result import FigureTable, Result
from pellucid.study.results import ResultRow, write_rows

from .known_rigs import parse_rig
from .pointing.predicted_indices import PREDICTED_INDICES, PredictedIndex, leading_predicted_index
from .pointing.prediction import (
    CARRYING_CONTROLLERS,
    NOTHING_CARRIED,
    PUBLISHED_CONTROLLERS,
    STUDY_INTERVAL_SHARE,
    CarriedWeight,
    DrawnStudies,
    Prediction,
    condition_words,
    predict_effects,
)
from .pointing.rig import PointingRig
from .shipped_rigs import text_of_rig
from .simulate import rig_file, study_name

PREDICTION_FILE = Path("lab") / "prediction.json"
"""Path of the predicted figures, relative to the study's folder."""


@dataclass(frozen=True, kw_only=True, repr=False)
class Predicted(Result):
    """The result of `predict`, which prints like the result of any procedure.

    Attributes
    ----------
    prediction : Prediction
        Indices of movement of every pair of a person and a robot.
    studies : DrawnStudies
        Virtual studies that were drawn from these pairs.
    participants : int
        Number of people in a simulated study.
    carried : CarriedWeight
        Load on the robot, load in the hand, and share of the limb that controllers carry.
    needed : dict of str to int or None
        People with whom enough studies would show the change of the leading index, by each law that does not show it
        with `participants`; None if more than a forecast tries.
    folder : str
        First folder of the command.
    options : tuple of str
        Further folders, and options of the command other than numbers of people.
    """

    prediction: Prediction = field(repr=False)
    studies: DrawnStudies = field(repr=False)
    participants: int = 0
    carried: CarriedWeight = NOTHING_CARRIED
    needed: Mapping[str, int | None] = field(default_factory=dict)
    folder: str = ""
    options: tuple[str, ...] = ()

    def make_answer(self) -> Answer:
        """Return whether a study would show that controllers change the leading index."""
        return _answer(self)


def predict(
    folder: str | os.PathLike,
    *others: str | os.PathLike,
    people: int = 12,
    robots: int = 12,
    movements: int = 20,
    participants: int = 6,
    controllers: Sequence[str] | None = None,
    load: tuple[float, float] | None = None,
    held: tuple[float, float] | None = None,
    support: float | None = None,
    seed: int = 1,
    executor: Executor | None = None,
    on_progress: Callable[[str, float], None] | None = None,
) -> Predicted:
    """Predict how controllers change people's movements, with intervals over simulated people and robots.

    Every robot is identified and then worn by every person of its model. Studies are drawn from these pairs. The
    figures are written to ``lab/prediction.json`` of the first folder. The same seed gives the same figures.

    Parameters
    ----------
    folder, others : path-like
        Folders that `init` made with a rig of people who point. Several folders share the robots evenly, so that the
        intervals include the disagreement between their models of people. The robots are those of the first folder.
    people : int
        Number of simulated people for each model.
    robots : int
        Total number of simulated robots.
    movements : int
        Number of movements of every person without a robot and under each controller. It is even, because movements go
        there and back.
    participants : int
        Number of people in a simulated study.
    controllers : sequence of str, optional
        Controllers by their names in `export`; by default the published three, or `transparent`, `force_sensor`
        and `support` if a weight is to be carried.
    load : tuple of float, optional
        Load that is fastened to the robot once it is identified: mass [kg] and distance from the axis [m]. Controllers
        carry it; each is also worn without carrying it.
    held : tuple of float, optional
        Load in the hand, with a robot and without: mass [kg] and distance from the axis [m]. Controllers carry its
        weight; each is also worn without carrying it.
    support : float, optional
        Share of the forearm's weight that the controller `support` carries, 0 to 1; by default its own share.
    seed : int
        Seed of every random draw, at least 0.
    executor : concurrent.futures.Executor, optional
        Executor that runs a job for each robot, for instance a Dask cluster's; by default this machine's processes.
    on_progress : callable, optional
        Function that is called with a text and the share of the work that is done, 0 to 1.

    Returns
    -------
    Predicted

    Raises
    ------
    StudyError
        If a folder has no rig file, its rig is not one of people who point, or a controller is not known.
    PellucidError
        If there are fewer people than a study needs, fewer robots than folders, or an odd number of movements.

    Examples
    --------
    >>> import pellucid as pl
    >>> _ = pl.init("some-people", rig="elbow-participants")
    >>> found = pl.predict("some-people", people=3, robots=2, participants=3)        # doctest: +SKIP
    >>> low, middle, high = found.studies.interval("vmax", "CLPC")                   # doctest: +SKIP
    """
    rigs = [_read_rig(Path(each)) for each in (folder, *others)]
    _require_counts(len(rigs), people=people, robots=robots, movements=movements, participants=participants, seed=seed)
    unknown = [name for name in controllers or () if name not in ELBOW_CONTROLLERS]
    if unknown:
        raise StudyError(
            f'controllers: found no controller "{unknown[0]}", expected some of {", ".join(ELBOW_CONTROLLERS)}'
        )
    carried = CarriedWeight(
        stated_load("predict", "load", load), stated_load("predict", "held", held), _read_share(support)
    )
    asked = bool(controllers)
    if not controllers and carried != NOTHING_CARRIED:
        loaded = carried.load is not None or carried.held is not None
        controllers = CARRYING_CONTROLLERS if loaded else ("support",)
    named = {name: name for name in controllers} if controllers else PUBLISHED_CONTROLLERS
    _require_carriers(named, carried)
    made = predict_effects(
        rigs, people=people, robots=robots, movements=movements, controllers=named, carried=carried, seed=seed,
        executor=executor, on_progress=on_progress,
    )  # fmt: skip
    studies = made.studies(size=participants)
    given = {"robots": robots, "movements": movements, "seed": seed, "load": load, "held": held, "support": support}
    options = _options(others, given, controllers if asked else ())
    found = _make_result(
        study_name(Path(folder)), made, studies, participants, carried=carried, folder=os.fspath(folder),
        options=options,
    )  # fmt: skip
    write_rows(Path(folder) / PREDICTION_FILE, "predict", found.rows)
    return found


def _options(
    others: Sequence[str | os.PathLike], given: Mapping[str, Any], controllers: Sequence[str]
) -> tuple[str, ...]:
    """Return further folders, and the options of the command that differ from its defaults."""
    defaults = signature(predict).parameters
    made = [os.fspath(each) for each in others]
    for name, value in given.items():
        if value != defaults[name].default:
            made += [f"--{name}", *map(str, value if isinstance(value, tuple) else (value,))]
    return (*made, *(part for name in controllers for part in ("--controller", name)))


def _require_counts(folders: int, *, people: int, robots: int, movements: int, participants: int, seed: int) -> None:
    """Raise a PellucidError for numbers with which no study can be drawn; nothing has been simulated yet."""
    if seed < 0:
        raise PellucidError(f"predict: found the seed {seed}, expected 0 or more")
    if participants < 1 or people < participants:
        raise PellucidError(
            f"predict: found {people} people and {participants} participants of a study, expected 1 participant or "
            "more "
            "and at least as many people"
        )
    if robots < folders:
        raise PellucidError(f"predict: found {robots} robots for {folders} models of people, expected one for each")
    if movements < 2 or movements % 2:
        raise PellucidError(f"predict: found {movements} movements, expected an even number: there and back")


def _read_share(given: float | None) -> float | None:
    """Return a share of the forearm's weight; raise a PellucidError if it is not within 0 and 1."""
    if given is not None and not 0.0 < given <= 1.0:
        raise PellucidError(f"predict: found a support of {given:g}, expected a share above 0, up to 1")
    return given


def _require_carriers(controllers: Mapping[str, str], carried: CarriedWeight) -> None:
    """Raise a StudyError if a controller cannot carry what is to be carried; nothing has been simulated yet."""
    if carried.load is not None or carried.held is not None:
        unable = [name for name in controllers.values() if not ELBOW_CONTROLLERS[name].carries_load]
        if unable:
            able = ", ".join(name for name, one in ELBOW_CONTROLLERS.items() if one.carries_load)
            raise StudyError(f'controllers: found "{unable[0]}", which carries no load, expected some of {able}')
    if carried.support is not None and not any(ELBOW_CONTROLLERS[name].assists for name in controllers.values()):
        raise StudyError(f'controllers: found {", ".join(controllers.values())} with a support, expected "support"')


def _read_rig(folder: Path) -> PointingRig:
    """Read the rig of a folder; raise a StudyError if its people do not point."""
    path = rig_file(folder)
    rig = parse_rig(text_of_rig(path), study_name(folder))
    if not isinstance(rig, PointingRig):
        raise StudyError(f"{path}: found a rig of kind {rig.kind}, expected people who point: {PointingRig.kind}")
    return rig


def _make_result(
    name: str, made: Prediction, studies: DrawnStudies, participants: int, *, carried: CarriedWeight, folder: str,
    options: tuple[str, ...],
) -> Predicted:  # fmt: skip
    """Return the table and the rows of a prediction."""
    rows, table = [], []
    drawn = f"{len(made.worn)} robots x {made.people} people of {' and '.join(made.models)}"
    drawn += f", {carried}" if carried != NOTHING_CARRIED else ""
    for index in PREDICTED_INDICES:
        for law in made.laws:
            low, middle, high = studies.interval(index.name, law)
            table.append((index.words, condition_words(law), middle, low, high, high - low))
            for what, value in (("", middle), (".low", low), (".high", high)):
                row = f"{name}.predicted.{index.name}.{law.lower()}{what}"
                rows.append(ResultRow(row, value, "%", "predict", "simulated", note=drawn))
    leading = leading_predicted_index().name
    shown = studies.shown(leading)
    for law, share in shown.items():
        row = f"{name}.predicted.{leading}.{law.lower()}.shown"
        rows.append(ResultRow(row, 100.0 * share, "%", "predict", "simulated", note=f"of studies; {drawn}"))
    hidden = [law for law, share in shown.items() if not share >= STUDY_INTERVAL_SHARE]
    needed = made.people_needed(leading, hidden, above=participants, share=STUDY_INTERVAL_SHARE)
    for law, count in needed.items():
        if count is not None:
            row = f"{name}.predicted.{leading}.{law.lower()}.people_needed"
            rows.append(ResultRow(row, count, "1", "predict", "simulated", note=drawn))
    rate = made.movements / made.cpu
    rows += [
        ResultRow(f"{name}.predicted.movements", made.movements, "1", "predict", "simulated", note="in robots"),
        ResultRow(f"{name}.predicted.movements_per_cpu_second", rate, "1/s", "predict", "simulated"),
        ResultRow(f"{name}.predicted.seconds", made.wall, "s", "predict", "simulated", note="this run"),
    ]
    heads = ("index", "controller", "median [%]", "from [%]", "to [%]", "width")
    title = f"Change from no robot, and {100.0 * STUDY_INTERVAL_SHARE:.0f} % of studies of {participants} people"
    headline = (
        f"{drawn}, {made.movements} movements in {made.wall:.0f} s; {rate:.0f} movements per second of a processor"
    )
    return Predicted(
        study=name, headline=headline, tables=(FigureTable(title, heads, tuple(table)),), verdicts=(),
        rows=tuple(rows), cards={}, checksums={}, confidence=STUDY_INTERVAL_SHARE, command="predict",
        prediction=made, studies=studies, participants=participants, carried=carried, needed=needed, folder=folder,
        options=options,
    )  # fmt: skip


def _answer(found: Predicted) -> Answer:
    """Return whether a study would show that controllers change the leading index, by its own tests."""
    index, needed = leading_predicted_index(), 100.0 * found.confidence
    parts, numbers, shown = [], [], found.studies.shown(index.name)
    for law, share in shown.items():
        low, middle, high = found.studies.interval(index.name, law)
        words, percent = condition_words(law), 100.0 * share
        parts.append(AnswerPart(words, "yes" if percent >= needed else "no", f"shown in {percent:.0f} % of studies"))
        row = row_id(found, index, law)
        numbers.append(AnswerNumber(f"studies that show {words}", percent, "%", id=f"{row}.shown"))
        numbers.append(AnswerNumber(f"{index.words}, {words}", middle, "%", (low, high), row_id(found, index, law)))
    robots, people = len(found.prediction.worn), found.prediction.people
    studies = f"{len(found.studies.robot):,} sampled studies, each of {found.participants} people on one robot"
    is_shown = any(part.verdict == "yes" for part in parts)
    return Answer(
        f"Would a study of {found.participants} people show that these controllers change {index.words}, against no "
        "robot?",
        "yes" if is_shown else "no",
        _headline(found, index, shown),
        "" if is_shown else f"each change is shown in fewer than {needed:.0f} % of simulated studies",
        tuple(parts),
        tuple(numbers),
        Basis(robots, robots, "robot", studies, is_simulated=True, wearers=people),
        next=(_next_step(found, is_shown),),
    )


def _next_step(found: Predicted, is_shown: bool) -> Step:
    """Return to record people where a study would show a change, or with how many it would."""
    record = "pellucid init my-session --session elbow"
    if is_shown:
        return Step("Record people of your own", line=record)
    counts = ", ".join(f"{condition_words(law)} {people_words(count)}" for law, count in found.needed.items())
    told = f"People with whom {10.0 * found.confidence:g} of 10 studies would show it: {counts}"
    known = [count for count in found.needed.values() if count is not None]
    if not known:
        return Step(f"{told}. Record a pilot study, because people may vary less than the simulated ones", line=record)
    people = ("--people", str(max(found.prediction.people, min(known))), "--participants", str(min(known)))
    return Step(f"{told}. Predict the smallest such study", "predict", (*found.options, *people), found.folder)


def _headline(found: Predicted, index: PredictedIndex, shown: Mapping[str, float]) -> str:
    """Return in which share of studies, by law, the change of an index is `shown`, and the change itself."""
    needed = f"{100.0 * found.confidence:.0f} %"
    shares = ", ".join(
        f"{condition_words(law)} {Value(f'{row_id(found, index, law)}.shown', 100.0 * x, f'{100.0 * x:.0f}')} %"
        for law, x in shown.items()
    )
    parts = []
    for law in found.prediction.laws:
        low, middle, high = found.studies.interval(index.name, law)
        row = row_id(found, index, law)
        ends = (Value(f"{row}{end}", x, number(x, digits=3)) for end, x in ((".low", low), (".high", high)))
        told = " to ".join(map(str, ends))
        parts.append(f"{condition_words(law)} {Value(row, middle, number(middle, digits=3))} % ({told})")
    return (
        f"Friedman's and Nemenyi's tests show it in this share of simulated studies: {shares}; yes needs {needed}. "
        f"Change, and what {needed} of simulated studies measure: {', '.join(parts)}."
    )


def row_id(found: Predicted, index: PredictedIndex, law: str) -> str:
    """Return the id of a change's row in lab/prediction.json."""
    return f"{found.study}.predicted.{index.name}.{law.lower()}"
