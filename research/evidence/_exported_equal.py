"""Comparison of an exported supervisor with that of the virtual lab, number by number.

Each law of a simulated robot and of a simulated knee is exported. The study's table ``[rig]`` is that of the virtual
rig, with the lab's limits, the robot's commissioning response and the lab's identified cards. The numbers are read from
``pellucid_constants.h``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from pellucid.controllers.coupling import ON_CARDS
from pellucid.controllers.elbow_controllers import ELBOW_CONTROLLERS
from pellucid.controllers.elbow_laws import ELBOW_LIMITS
from pellucid.controllers.export.c_folder import read_constants
from pellucid.controllers.export.export import export
from pellucid.controllers.supervised import SUPERVISOR_NAMES
from pellucid.models.card import CardParameter, write_card
from pellucid.models.parameter_card import ParameterCard, write_parameter_card
from pellucid.study.procedures.registry import open_study
from pellucid.study.study import Study
from pellucid_lab.knee.chosen_constants import chosen
from pellucid_lab.knee.identified_wearer import WearerCard
from pellucid_lab.knee_pointing.conditions import LEG_CONDITIONS
from pellucid_lab.ranking.knee import ranked_controllers
from pellucid_lab.safety.fault_table import draw_worn_robot
from pellucid_lab.safety.worn_knee import LAWS as KNEE_LAWS
from pellucid_lab.safety.worn_knee import WornKnee, draw_worn_knee
from pellucid_lab.safety.worn_robot import COMMON_EXPONENTS, LAWS, WornRobot
from pellucid_lab.study_text import study_text

FLOAT32_TOLERANCE = 1e-6
"""Largest relative difference that rounding to float32 explains: half a unit in its last place is 6e-8 [1]."""

TUNING_ROBOT_SEED = 20281101
"""Seed of the robot whose laws are compared; it belongs to the tuning set."""

TUNING_KNEE_SEED = 301
"""Seed of the knee whose laws are compared; it belongs to the tuning set."""


@cache
def _drawn_robot(seed: int) -> WornRobot:
    return draw_worn_robot(0, seed)


@cache
def _drawn_knee(seed: int) -> WornKnee:
    return draw_worn_knee(seed)


def compare_supervisors(
    robot_seed: int = TUNING_ROBOT_SEED, knee_seed: int = TUNING_KNEE_SEED
) -> tuple[int, list[tuple[str, str, float, float]]]:
    """Compare the lab's supervisors with the exported ones.

    Returns
    -------
    count : int
        Number of laws that were compared.
    differing : list of tuple
        Law, name of the number, the lab's value and the exported one [SI], for each number that differs.
    """
    pairs = [*_elbow_pairs(_drawn_robot(robot_seed)), *_knee_pairs(_drawn_knee(knee_seed))]
    differing = [
        (law, name, lab[name], exported[name])
        for law, lab, exported in pairs
        for name in SUPERVISOR_NAMES
        if not _is_same(lab[name], exported[name])
    ]
    return len(pairs), differing


def _is_same(lab: float, exported: float) -> bool:
    """Return whether two numbers are the same but for float32 rounding; infinities must be equal."""
    if not (math.isfinite(lab) and math.isfinite(exported)):
        return lab == exported
    return math.isclose(lab, exported, rel_tol=FLOAT32_TOLERANCE, abs_tol=1e-30)


def _exported(study: Study, out: Path, **asked: Any) -> Mapping[str, float]:
    """Return the numbers of an export of `study`, whose test vector is not played: numbers alone are compared."""
    with patch("pellucid.controllers.export.c_folder.record_outputs", return_value=[]):
        return read_constants(export(study, out=out, **asked))


def _elbow_pairs(worn: WornRobot) -> Iterator[tuple[str, Mapping[str, float], Mapping[str, float]]]:
    """Yield the name, the lab's supervisor and the exported numbers of each law of a worn robot."""
    with TemporaryDirectory() as folder:
        study = elbow_study(worn, Path(folder))
        for name in LAWS:
            asked: dict[str, Any] = {"slider": worn.person.slider(worn.rig)}
            if name in ELBOW_CONTROLLERS:
                named = ELBOW_CONTROLLERS[name]
                asked |= {"controller": name}
                asked |= {"participant": worn.person.name} if named.wearer else {}
                asked |= {"exponents": COMMON_EXPONENTS} if named.exponents else {}
            yield name, worn.law(name).supervision, _exported(study, Path(folder) / name, **asked)


def elbow_study(worn: WornRobot, folder: Path) -> Study:
    """Write the identified study of a worn robot, without recordings, and open it."""
    limits = ELBOW_LIMITS
    tables = worn.rig.robot.study(())
    tables["rig"]["limits"] = {
        "position_min": f"{limits.position[0]} rad",
        "position_max": f"{limits.position[1]} rad",
        "velocity": f"{limits.velocity} rad/s",
        "effort": f"{limits.effort} N*m",
    }
    if worn.answer is not None:
        tables["rig"]["instruments"]["start_up_answer"] = f"{worn.answer} J"
    person = worn.person
    tables["participants"] = {person.name: {"mass": f"{person.mass} kg", "height": f"{person.height} m"}}
    study = _write_study(folder, tables, "elbow")
    for method, card in worn.cards.items():
        write_card(study.models_dir / f"slider.{method}.json", card)
    return study


def compare_knee_laws(knee_seed: int = TUNING_KNEE_SEED) -> list[tuple[str, str, float, float]]:
    """Compare every number of each worn residual compensator with the exported one.

    Returns
    -------
    differing : list of tuple
        Place of use ("lab", "ranking" or "pointing"), name of the number, its value there and the exported one [SI].
    """
    worn = _drawn_knee(knee_seed)
    with TemporaryDirectory() as folder:
        exported = _exported(knee_study(worn, Path(folder)), Path(folder) / "law")
    coupling, rig = worn.known.coupling, worn.rig
    deaf = SimpleNamespace(build=lambda: None)  # stands for the map from EMG, which is no number of the law
    identified = SimpleNamespace(coupling=coupling, rig=rig, card=lambda settings: SimpleNamespace(emg=deaf))
    card = WearerCard(coupling, deaf)
    ranked = ranked_controllers(card, rig, chosen(), ("residual", "residual_no_emg", "residual_strap_learnt"))
    laws = {"lab": worn.law().law, "pointing": LEG_CONDITIONS["residual_default"].law(identified).law}
    laws |= {f"ranking, {name}": one.build().law for name, one in ranked.items() if name != "no_control"}
    return [
        (who, name, value, exported[name])
        for who, law in laws.items()
        for name, value in law.values.items()
        if not _is_same(value, exported[name])
    ]


def _knee_pairs(worn: WornKnee) -> Iterator[tuple[str, Mapping[str, float], Mapping[str, float]]]:
    """Yield the name, the lab's supervisor and the exported numbers of each law of a worn knee."""
    with TemporaryDirectory() as folder:
        study = knee_study(worn, Path(folder))
        for name in KNEE_LAWS:
            # The law without EMG has the same numbers: its wearer's EMG is absent.
            yield name, worn.law().supervision, _exported(study, Path(folder) / name)


def knee_study(worn: WornKnee, folder: Path) -> Study:
    """Write the identified study of a worn knee, without recordings, and open it."""
    (subject,) = worn.rig.subjects
    study = _write_study(folder, worn.rig.study(()), "knee")
    known = asdict(worn.known.coupling)
    files = {"orthosis": "orthosis", "limb": f"{subject}.limb", "coupling": f"{subject}.coupling"}
    for kind, name in files.items():
        values = {parameter: known[field] for parameter, field in ON_CARDS[kind].items()}
        _write_parameters(study, kind, name, values)
    actuator = {name: value for name, value in known.items() if name.startswith("actuator_")}
    _write_parameters(study, "actuator", "actuator", actuator, period=worn.rig.period)
    return study


def _write_parameters(study: Study, kind: str, name: str, values: Mapping[str, float], **settings: float) -> None:
    made = tuple(CardParameter(parameter, "1", value, 0.0, (value, value)) for parameter, value in values.items())
    card = ParameterCard(kind, study.name, name, made, settings=settings)
    write_parameter_card(study.models_dir / f"{name}.json", card)


def _write_study(folder: Path, tables: Mapping[str, Any], name: str) -> Study:
    """Write study.toml and an empty folder of cards, and open the study; cards of other recordings are accepted."""
    (folder / "models").mkdir()
    (folder / "study.toml").write_text(study_text({**tables, "name": name}, {}), encoding="utf-8")
    return open_study(folder, accept_stale=True)
