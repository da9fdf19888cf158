"""Export calibrated muscles to other programs: as a copy of the study's OpenSim model, or as a CEINMS subject."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

import numpy as np

from ..._errors import PellucidError, RecordingError
from ..._given import require_folder
from ..._printed_command import printed_command
from ...models.parameter_card import ParameterCard, read_parameter_card
from ...study.exporter import Exporter, ExportRequest
from ...study.procedures.card_sources import require_fresh
from ...study.study import Study
from ..files.muscle_remark import MuscleRemark, exported_study, read_calibrated, write_osim, write_subject
from ..models.hill import MUSCLE_QUANTITIES
from ..models.muscle import CARD_KIND, CalibratedMuscles, calibrated_muscles
from ..models.muscle_geometry import muscle_table
from .emg_torque.emg_torque_table import EmgTorqueTable
from .emg_torque.study_muscles import study_coordinates
from .emg_torque.trial_sources import muscle_source

ENDINGS = {"osim": ".osim", "ceinms": ".xml"}
"""Ending of the file for each program to which muscles can be exported."""

JOINT_CARD_NAME = "muscles_together"
"""Name of the card with muscles that were calibrated over all joints."""

MAX_PERIOD_S = 1.0
"""Largest accepted period of a subject's recursion [s]."""


def export_subject(
    study: Study,
    to: str,
    out: Path | None = None,
    *,
    card: str | None = None,
    period: float | None = None,
    overwrite: bool = False,
) -> Path:
    """Write the study's calibrated muscles to a file, ``"osim"`` or ``"ceinms"``.

    `out` is a folder, or a file with the right ending. `period` is that of a subject's recursion [s]; None for the
    recordings' own. `study` [emg_torque]. A file that no export of this study wrote is replaced only if `overwrite`.
    """
    if study.find_table(EmgTorqueTable) is None:
        raise PellucidError(f"export of {study.name}: found no [emg_torque], expected the study of muscles for {to}")
    if period is not None and not 0.0 < period <= MAX_PERIOD_S:
        raise PellucidError(f"export: found a period of {period:g} s, expected one above 0 and up to 1 s")
    kept = calibrated_muscles(_card(study, card))
    folder = study.place("subject") if out is None else Path(out)
    path = folder if folder.suffix.lower() == ENDINGS[to] else folder / f"{study.name}{ENDINGS[to]}"
    require_folder(path.parent, "a folder to write to")
    if path.exists() and not overwrite and exported_study(path) != study.name:
        raise PellucidError(
            f"{path}: found a file that no export of {study.name} wrote, expected one that did, or nothing. "
            "Name another with --out, or let it be replaced: --overwrite (overwrite=True)"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    if to == "osim":
        return write_osim(path, _model(study), MuscleRemark(kept, _names(study, kept), study=study.name))
    step = period or float(np.median([1.0 / r.fs for r in study.recordings()]))
    remark = MuscleRemark(kept, _names(study, kept), step, study.name)
    return write_subject(path, remark, _muscles_by_coordinate(study, kept))


def _card(study: Study, name: str | None) -> ParameterCard:
    if name is not None:
        path = study.card(name)
        return require_fresh(study, path, read_parameter_card(path))
    read = {path: read_parameter_card(path) for path in study.cards("muscles_*.json")}
    found = [card for card in read.values() if card.kind == CARD_KIND]
    if not found:
        raise PellucidError(
            f"{study.models_dir}: found no card of muscles, expected one: {printed_command('calibrate', study.folder)}"
        )
    # One set of muscles over all joints is preferred to several sets for one joint each.
    joint_count = max(len(calibrated_muscles(card).joints) for card in found)
    widest = [card for card in found if len(calibrated_muscles(card).joints) == joint_count]
    # A card that uses the recorded times of the EMG is preferred to one that shifts them to fit this recording.
    widest = [card for card in widest if card.name == JOINT_CARD_NAME] or widest
    if len(widest) > 1:
        raise PellucidError(
            f"export of {study.name}: found the cards {', '.join(c.name for c in widest)}, expected one: say which by "
            f"--card {widest[0].name}.json"
        )
    return next(require_fresh(study, path, card) for path, card in read.items() if card is widest[0])


def _model(study: Study) -> Path:
    muscle_file = study.table(EmgTorqueTable).muscle_file
    if muscle_file is None or not muscle_file.lower().endswith(".osim"):
        raise PellucidError(
            f"export of {study.name}: found {muscle_file or 'no muscle_file'}, expected [emg_torque] muscle_file to "
            "name the OpenSim model (.osim) that is copied"
        )
    path = study.inside(muscle_file, "[emg_torque] muscle_file")
    if not path.is_file():
        raise RecordingError(f"{path}: not readable: no such file")
    return path


def _names(study: Study, kept: CalibratedMuscles) -> dict[str, str]:
    """Return the name of each muscle in other programs, from study.toml or from the package's own leg."""
    stated_names, table = study.table(EmgTorqueTable).muscle_names, muscle_table().labels
    own = study.table(EmgTorqueTable).muscle_file is None
    return {m.name: stated_names.get(m.name, table.get(m.name, m.name) if own else m.name) for m in kept.muscles}


def _muscles_by_coordinate(study: Study, kept: CalibratedMuscles) -> dict[str, list[str]]:
    """Return the muscles that move each joint, by the coordinate's name, or by the joint's name if that is unknown."""
    recording, coordinates = study.recordings()[0], study_coordinates(study)
    moved = {}
    for joint in kept.joints:
        source = muscle_source(study, recording, joint)
        crossing = source.crossing(joint) if source is not None else {m.name for m in kept.muscles}
        name = coordinates.get(joint, joint).removeprefix("-")
        moved[name] = [m.name for m in kept.muscles if m.name in crossing]
    return moved


def describe_muscles(path: Path, to: str) -> str:
    """Return a sentence about the calibrated muscles in a file, and one about what only the remark keeps."""
    kept = read_calibrated(path)
    lacking = ["the joints' own tissue"] if any(any(numbers) for numbers in kept.tissue.values()) else []
    lacking += ["delays"] if any(m.delay for m in kept.muscles) else []
    lacking += ["the share of a maximal contraction"] if kept.effort != 1.0 else []
    lacking += ["activation and curves, which are its own"] if to == "osim" else []
    shared = ("optimal_length_shift", "damping", *MUSCLE_QUANTITIES[-4:], "force_length_width", "passive_scale")
    if to == "ceinms" and any(len({getattr(m, q) for m in kept.muscles}) > 1 for q in shared):
        lacking.append("curves of each muscle: it has the mean's")
    end = f" Kept as a remark alone: {', '.join(lacking)}." if lacking else ""
    return f"{len(kept.muscles)} calibrated muscles of the {' and '.join(kept.joints)}.{end}"


class MusclesExporter(Exporter):
    """A person's calibrated muscles, for a program that knows muscles."""

    kinds: ClassVar[tuple[str, ...]] = tuple(ENDINGS)
    order: ClassVar[int] = 50
    unused: ClassVar[tuple[str, ...]] = (
        "slider", "participant", "controller", "exponents", "load", "held", "probe", "unmeasured", "fmi",
    )  # fmt: skip
    why_unused: ClassVar[str] = "muscles have none"

    question: ClassVar[str] = "Can these muscles be exported?"

    def describe(self, request: ExportRequest, place: Path) -> str:
        """Return in a sentence what was written."""
        return describe_muscles(place, request.to)

    def export(self, request: ExportRequest) -> Path:
        """Write the file of the muscles."""
        return export_subject(
            request.study, request.to, request.out, card=request.card, period=request.period,
            overwrite=request.overwrite,
        )  # fmt: skip
