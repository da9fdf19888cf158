"""Write the actuators of an identified joint or robot as configurations of Isaac Lab and MJX, with ranges.

Both read the same ``actuators.json``: armature, damping, frictionloss and load friction of each joint, each with the
range that its interval allows, for domain randomisation.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..._atomic import write_text_atomically
from ..._errors import PellucidError
from ...models.card import CardParameter, ModelCard
from ...models.friction_terms import COULOMB_FRICTION, LOAD_FRICTION, TERMS, TERMS_BY_NAME, VISCOUS_FRICTION
from ...models.joint import NAMES, SYMBOLS_BY_NAME
from ...models.tree_card import COLUMNS, TreeCard
from ...study.study_file import JointLimits
from .c_folder import template_folder
from .simulator_model import LINK_SHARE, SHAPING_FIELDS

ACTUATOR_PROGRAMS: dict[str, str] = {"isaaclab": "isaaclab_actuators.py", "mjx": "mjx_actuators.py"}
"""Program for each simulator, in the folder of ``actuators.json``."""

ACTUATORS_FILE = "actuators.json"
"""File with the numbers."""

QUANTITIES: Mapping[str, tuple[str, ...]] = {
    "damping": VISCOUS_FRICTION.targets,
    "frictionloss": COULOMB_FRICTION.targets,
    "load_friction": LOAD_FRICTION.targets,
    **{name: (name,) for name in ("square_root", "stribeck", "stribeck_velocity")},
}
"""Numbers of friction of an actuator, each the mean of these numbers of the core."""

README_TEXT = """# {name}: actuators for {simulator}

`{program}` configures the joints {joints}; its first lines show how. `actuators.json` has armature, damping,
frictionloss and load friction of each joint: the value, and the range of its {confidence:.0%} interval for domain
randomisation. A range of one value has no interval.

{notes}

{tried}
"""

TRIED = {
    "isaaclab": "Written for Isaac Lab 2.3 with Isaac Sim 5, where joint friction is an effort. It has been run "
    "against stand-ins for Isaac Lab's classes only, not in Isaac Lab.",
    "mjx": "Written for MJX 3 (`pip install mujoco-mjx`).",
}
"""Tests of the exported actuators, for each simulator."""


@dataclass(frozen=True)
class Range:
    """A number and the range in which it may be drawn."""

    value: float
    low: float
    high: float

    def plus(self, other: Range) -> Range:
        """Return the range of a sum."""
        return Range(self.value + other.value, self.low + other.low, self.high + other.high)


@dataclass(frozen=True)
class JointActuator:
    """Parameters of a joint's actuator for a simulator, in SI units."""

    name: str
    motion: str  # "rotary" or "prismatic"
    quantities: Mapping[str, Range]  # armature and `QUANTITIES`
    effort: float | None = None  # largest effort
    velocity: float | None = None  # largest velocity


@dataclass(frozen=True)
class Actuators:
    """The actuators of a joint or robot."""

    name: str
    joints: tuple[JointActuator, ...]
    confidence: float
    notes: tuple[str, ...]


def actuators_of(card: ModelCard | TreeCard, limits: JointLimits | None = None, load_inertia: float = 0.0) -> Actuators:
    """Return the actuators of a card; `limits` are the study's, `load_inertia` that of a known load [kg m^2; kg]."""
    if isinstance(card, TreeCard):
        return _tree_actuators(card)
    _require_effort(card.effort_unit)
    core = dict(zip(NAMES, card.model().vector(card.values).tolist(), strict=True))
    given = {target: p for p in card.parameters for target in SYMBOLS_BY_NAME[p.name].targets}
    inertia = _range(core, given, ("inertia",))
    if load_inertia:
        armature = Range(*(max(0.0, x - load_inertia) for x in (inertia.value, inertia.low, inertia.high)))
        note = f"The armature is the identified inertia without the known load of {load_inertia:g} in SI units."
    else:
        armature = Range(*((1.0 - LINK_SHARE) * x for x in (inertia.value, inertia.low, inertia.high)))
        note = (
            f"The joint's own motion does not divide its inertia between link and rotor. The armature is "
            f"{1.0 - LINK_SHARE:.0%} of it, as in the MJCF model of `pellucid export --to mjcf`."
        )
    joint = JointActuator(
        card.joint, card.motion, {"armature": armature, **_frictions(core, given)},
        None if limits is None else limits.effort, None if limits is None else limits.velocity,
    )  # fmt: skip
    return Actuators(card.study, (joint,), card.confidence, (note,))


def _tree_actuators(card: TreeCard) -> Actuators:
    links = [dict(zip(COLUMNS["links"], row, strict=True)) for row in card.links]
    rotors = [link["rotor_inertia"] for link in links if link["joint"]]
    motors = [dict(zip(COLUMNS["motors"], row, strict=True)) for row in card.motors]
    joints, unknown = [], []
    for i, name in enumerate(card.names):
        _require_effort(card.effort_units[i])
        own = {key: float(column[i]) for key, column in card.joint_columns.items()}
        given: dict[str, CardParameter] = {}
        for p in card.parameters:
            joint, _, field = p.name.rpartition(".")
            if joint == name:
                given |= dict.fromkeys(TERMS_BY_NAME[field].targets if field in TERMS_BY_NAME else (field,), p)
        drive = {} if not motors else {key: x for key, x in motors[i].items() if key in own}
        moved = {target: given[f"motor_{term.name}"] for term in TERMS if f"motor_{term.name}" in given
                 for target in term.targets}  # fmt: skip
        quantities = _frictions(own, given)
        if any(drive.values()):
            added = _frictions(own | drive, moved)
            quantities = {
                key: value if key in SHAPING_FIELDS else value.plus(added[key]) for key, value in quantities.items()
            }
        armature = _range({"rotor_inertia": rotors[i]}, given, ("rotor_inertia",))
        if motors and motors[i].get("motor_inertia"):
            armature = armature.plus(_range(motors[i], given, ("motor_inertia",)))
        if "rotor_inertia" not in given:
            unknown.append(name)
        span = card.ranges[i]
        joints.append(JointActuator(
            name, "prismatic" if card.motion[i] == "p" else "rotary", {"armature": armature, **quantities},
            span.effort, span.velocity,
        ))  # fmt: skip
    notes = []
    if unknown:
        notes.append(
            f"The recordings do not separate the armature of {', '.join(unknown)} from the links' inertia: use the "
            "maker's value."
        )
    if card.motors:
        notes.append("The rotor inertia of a motor that is coupled to several joints is added at its own joint only.")
    return Actuators(card.study, tuple(joints), card.confidence, tuple(notes))


def _require_effort(unit: str) -> None:
    if unit not in ("N*m", "N"):
        raise PellucidError(
            f"found an effort in {unit}, expected N*m or N: a simulator needs the drive's constant, [rig.drive] "
            "torque_constant"
        )


def _frictions(core: Mapping[str, float], given: Mapping[str, CardParameter]) -> dict[str, Range]:
    return {name: _range(core, given, targets) for name, targets in QUANTITIES.items()}


def _range(core: Mapping[str, float], given: Mapping[str, CardParameter], targets: tuple[str, ...]) -> Range:
    """Return the mean of numbers of the core, with the range of the intervals of those that were identified.

    None is below 0: a simulator accepts no negative friction.
    """
    values = [core[target] for target in targets]
    lows = [given[target].interval[0] if target in given else core[target] for target in targets]
    highs = [given[target].interval[1] if target in given else core[target] for target in targets]
    value, low, high = (max(0.0, sum(each) / len(targets)) for each in (values, lows, highs))
    return Range(value, min(low, value), max(high, value))


def actuator_texts(actuators: Actuators, to: str) -> dict[str, str]:
    """Return the texts of the files for a simulator, ``"isaaclab"`` or ``"mjx"``, by name."""
    program = ACTUATOR_PROGRAMS[to]
    source = template_folder() / "simulator" / f"{program}.j2"
    readme = README_TEXT.format(
        name=actuators.name, simulator={"isaaclab": "Isaac Lab", "mjx": "MJX"}[to], program=program,
        joints=", ".join(joint.name for joint in actuators.joints), confidence=actuators.confidence,
        notes="\n".join(f"- {note}" for note in actuators.notes), tried=TRIED[to],
    )  # fmt: skip
    return {
        ACTUATORS_FILE: json.dumps(actuators_table(actuators), indent=1) + "\n",
        program: source.read_text(encoding="utf-8"),
        "README.md": readme,
    }


def actuators_table(actuators: Actuators) -> dict[str, Any]:
    """Return what ``actuators.json`` says."""
    return {
        "name": actuators.name,
        "confidence": actuators.confidence,
        "notes": list(actuators.notes),
        "joints": {
            joint.name: {
                "motion": joint.motion,
                "effort_limit": joint.effort,
                "velocity_limit": joint.velocity,
                **{name: {"value": r.value, "low": r.low, "high": r.high} for name, r in joint.quantities.items()},
            }
            for joint in actuators.joints
        },
    }


def write_actuators(actuators: Actuators, to: str, folder: Path) -> Path:
    """Write the configuration for a simulator into a folder, and return the folder."""
    for file, text in actuator_texts(actuators, to).items():
        write_text_atomically(folder / file, text)
    return folder


def describe_actuators(folder: Path) -> str:
    """Return a sentence about an exported configuration."""
    table = json.loads((folder / ACTUATORS_FILE).read_text(encoding="utf-8"))
    count = len(table["joints"])
    return f"{folder}: actuators of {count} joint{'s' if count > 1 else ''} with ranges. Read README.md there."
