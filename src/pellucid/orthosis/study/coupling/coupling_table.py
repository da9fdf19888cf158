"""Table ``[coupling]`` of study.toml."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field

from ....study.study_fields import ProcedureTable, Word


class CouplingTable(ProcedureTable):
    """A wearer strapped to an orthosis: ``[coupling]``.

    Attributes
    ----------
    imu, emg : str
        Streams of the limb's IMU and of the muscles.
    orientation : str
        Filter of the IMU: ``"vqf"`` or ``"madgwick"``.
    magnetometer : bool
        Whether that filter uses the magnetometer.
    confidence : float
        Confidence level of the intervals, in (0, 1).
    posterior : bool
        Whether a posterior of each strap is sampled in addition to its confidence intervals.
    """

    alone: ClassVar[bool] = True

    imu: Word = "imu"
    emg: Word = "emg"
    orientation: Literal["vqf", "madgwick"] = "vqf"
    magnetometer: bool = True
    confidence: float = Field(0.95, gt=0, lt=1)
    posterior: bool = False

    def reads(self, channel: str, stream: str) -> bool:
        """Torque and angle of the orthosis, and the limb's IMU."""
        return stream == self.imu if stream else channel in ("torque", "position")
