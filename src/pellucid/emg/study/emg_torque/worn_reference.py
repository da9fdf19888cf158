"""What other domains offer to `calibrate`: bodies on which a wearer acts, and evaluations of their own protocols."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ....files.recording import Recording
from ....study.study import Study
from .calibration_findings import CalibrationFindings


class WornBody(Protocol):
    """A body that the wearer moves."""

    @property
    def words(self) -> str:
        """How the body is modelled, as a sentence."""

    def wearer_torque(self, recording: Recording, lowpass: float) -> np.ndarray:
        """Return the wearer's torque about the joint, shape (n,) [N m], low-passed at `lowpass` [Hz]."""


@dataclass(frozen=True)
class TorqueEvaluation:
    """An evaluation of `calibrate` for studies of one protocol."""

    protocol: str
    table: str  # name of the table in study.toml that the protocol needs
    evaluate: Callable[[Study, Callable[[str, float], None]], CalibrationFindings]

    def suits(self, study: Study) -> bool:
        """Return whether a study has the protocol and the table."""
        return study.has_table(self.table) and any(one.protocol == self.protocol for one in study.recordings())
