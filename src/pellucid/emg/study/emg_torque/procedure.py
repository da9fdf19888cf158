"""Torque of joints from EMG, by several methods, on held-out data."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from ....study.procedures.procedure import Procedure, Progress, quiet
from ....study.study import Study
from .emg_torque_table import BODY_CARD_NAMES, EmgTorqueTable

if TYPE_CHECKING:
    from ....files.fault import Fault
    from ....study.pages.page import Page
    from .calibrate import CalibrationResult

MIN_PIECE_S = 1.0
"""Pieces of a recording between two cuts are used from this length on [s].

It is ten times the memory of the slowest filter of angles and torques, which runs on each piece by itself. Chosen by
judgement; no measurement is recorded.
"""


class EmgTorqueProcedure(Procedure[EmgTorqueTable, "CalibrationResult"]):
    """Torque of joints from EMG, by several methods, on held-out data."""

    name, command = "emg_torque", "calibrate"
    whole = True
    shortest_piece = MIN_PIECE_S
    table = EmgTorqueTable

    def faults(self, study: Study, table: EmgTorqueTable) -> list[Fault]:
        from .study_faults import study_faults

        return study_faults(study)

    def run(self, study: Study, table: EmgTorqueTable, tell: Progress = quiet) -> CalibrationResult:
        from .calibrate import calibrate

        return calibrate(study, tell)

    def page(self, study: Study, found: CalibrationResult) -> Page:
        from .calibration_page import page

        return page(study, found)

    def inputs(self, study: Study) -> Iterable[Path]:
        """Yield the cards from which the wearer's torque is computed, and the file of the muscles' constants."""
        yield from (p for p in study.cards() if p.stem.split(".")[-1] in BODY_CARD_NAMES)
        constants = study.table(EmgTorqueTable).muscle_file
        if constants is not None:
            yield study.inside(constants, "[emg_torque] muscle_file")
