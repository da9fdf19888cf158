"""Write an identified joint or robot as a folder that a simulator reads: MJCF or URDF, ranges and friction."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

from ..._atomic import write_text_atomically
from ..._errors import PellucidError
from ...models.card import ModelCard, read_card, read_table
from ...models.cards import LibraryCard
from ...models.tree_card import TreeCard, read_tree_card
from ...study.exporter import Exporter, ExportRequest
from ...study.procedures.card_sources import require_fresh
from ...study.study import Study
from ...study.study_file import JointLimits
from .actuator_folder import ACTUATOR_PROGRAMS, ACTUATORS_FILE, actuators_of, describe_actuators, write_actuators
from .c_folder import mark_own_folder, require_own_folder
from .simulator_model import (
    SimulatorModel,
    joint_simulator_model,
    mjcf_text,
    ranges_table,
    tree_simulator_model,
    urdf_text,
)

SIMULATOR_FILES = {"mjcf": "model.xml", "urdf": "model.urdf"}
"""Name of the model's file for each language of simulators."""

FILES_BESIDE = ("ranges.json", "README.md", "friction.py")
"""Names of the files written with the model."""

TREE_CARD_NAMES = ("tree.consistent.json", "tree.best.json")
"""File names of the cards of a robot that can be exported; the first one that exists is used."""

FRICTION_SOURCE = Path(__file__).parent / "templates" / "simulator" / "friction.py.j2"
"""Program written with an MJCF model."""

README_TEXT = {
    "mjcf": """# {name} in MuJoCo

`model.xml` has armature, damping and frictionloss; `friction.py` sets, before each step, what friction has beyond
these: direction, load, the rise towards rest, the root of speed. Its first lines say how. `ranges.json` has the
value and the {confidence:.0%} interval of every number and their covariance, for domain randomisation: `sample`
draws from them, `apply` gives a model what was drawn.
""",
    "urdf": """# {name} as URDF

`model.urdf` has damping and friction of each joint, level and slope as they are on average of both directions. URDF
has no place for a rotor's inertia, for load-dependent friction, for a parallel spring or for intervals: `ranges.json`
has armature, friction and spring of each joint, and the value and {confidence:.0%} interval of every number with their
covariance. In Pinocchio, set `model.armature` from it.
""",
}
"""Text of the README.md of each model."""


def write_simulator_folder(model: SimulatorModel, to: str, folder: Path) -> Path:
    """Write a model for simulators, ``"mjcf"`` or ``"urdf"``, into a folder, and return the folder."""
    texts = {
        SIMULATOR_FILES[to]: mjcf_text(model) if to == "mjcf" else urdf_text(model),
        "ranges.json": json.dumps(ranges_table(model), indent=1) + "\n",
        "README.md": README_TEXT[to].format(name=model.name, confidence=model.confidence),
    }
    if to == "mjcf":
        texts["friction.py"] = FRICTION_SOURCE.read_text(encoding="utf-8")
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in texts.items():
        write_text_atomically(folder / file, text)
    return folder


def write_card_for_simulator(
    card: ModelCard | TreeCard, to: str, folder: Path, *, limits: JointLimits | None = None, load_inertia: float = 0.0
) -> Path:
    """Write what a simulator reads of a card into a folder, and return the folder; see `actuators_of`."""
    if to in ACTUATOR_PROGRAMS:
        return write_actuators(actuators_of(card, limits, load_inertia), to, folder)
    model = (
        tree_simulator_model(card)
        if isinstance(card, TreeCard)
        else joint_simulator_model(card, JointLimits() if limits is None else limits)
    )
    return write_simulator_folder(model, to, folder)


def export_library_card(card: LibraryCard, to: str, out: Path | None = None) -> Path:
    """Write what a simulator reads of a card of the library; `out` is a folder, None for one named after the card."""
    if to not in SimulatorExporter.kinds:
        names = " or ".join(f'"{name}"' for name in SimulatorExporter.kinds)
        raise PellucidError(f'export of the card {card.name}: found to = "{to}", expected {names}')
    folder = Path(f"{card.name}-{to}") if out is None else Path(out)
    try:
        return write_card_for_simulator(card.card, to, folder, load_inertia=card.load_inertia)
    except PellucidError as error:
        raise PellucidError(f"export of the card {card.name}: {error}") from None


def simulated_card(study: Study, card: str | None = None) -> tuple[str, ModelCard | TreeCard]:
    """Return the file name and the content of the card that is exported.

    `card` is a file name in the models folder; None for that of the joint, or for a robot's with consistent inertias.
    """
    if study.has_table("tree"):
        name = card or next((n for n in TREE_CARD_NAMES if study.card(n).is_file()), TREE_CARD_NAMES[0])
        path = study.card(name)
        return name, require_fresh(study, path, read_tree_card(path))
    study.rig.limits  # noqa: B018  # a machine of several joints without [tree] refuses, and says what to do
    name = card or "joint.json"
    path = study.card(name)
    kind = read_table(path).get("kind")
    if kind is not None:
        raise PellucidError(f"{name}: found the card of a {kind}, expected that of a joint or robot")
    return name, require_fresh(study, path, read_card(path))


def describe_simulator_model(folder: Path) -> str:
    """Return a sentence about an exported model, and one about what it was not chosen for."""
    table = json.loads((folder / "ranges.json").read_text(encoding="utf-8"))
    joints = len(table["joints"])
    said = f"{folder}: {joints} joint{'s' if joints > 1 else ''}, {len(table['parameters'])} numbers with intervals."
    if table["purpose"] == "torque":
        said += (
            " Its numbers were chosen for the torque. Those that simulate the motion best come with [model] purpose = "
            '"simulation" in study.toml and pellucid identify.'
        )
    return said


class SimulatorExporter(Exporter):
    """A model for simulators."""

    kinds: ClassVar[tuple[str, ...]] = (*SIMULATOR_FILES, *ACTUATOR_PROGRAMS)
    order: ClassVar[int] = 60
    unused: ClassVar[tuple[str, ...]] = (
        "slider", "participant", "controller", "exponents", "load", "held", "period", "probe", "unmeasured", "fmi",
    )  # fmt: skip
    why_unused: ClassVar[str] = "a model for simulators has none"

    def describe(self, request: ExportRequest, place: Path) -> str:
        """Return in a sentence what was written."""
        return describe_simulator_model(place) if request.to in SIMULATOR_FILES else describe_actuators(place)

    def export(self, request: ExportRequest) -> Path:
        """Write the folder of the model."""
        study, to = request.study, request.to
        if request.allow_outside:
            study = replace(study, allow_outside=True)
        name, card = simulated_card(study, request.card)
        folder = study.place(to) if request.out is None else Path(request.out)
        owner = {"controller": f"model for simulators, {to}", "participant": "", "study": study.name, "cards": name}
        names = [*SIMULATOR_FILES.values(), *FILES_BESIDE, *ACTUATOR_PROGRAMS.values(), ACTUATORS_FILE]
        require_own_folder(folder, owner, names, overwrite=request.overwrite)
        limits = None if isinstance(card, TreeCard) else study.rig.limits
        try:
            write_card_for_simulator(card, to, folder, limits=limits)
        except PellucidError as error:
            raise PellucidError(f"{name}: {error}") from None
        mark_own_folder(folder, owner)
        return folder
