"""Table ``[transfer_function]`` of study.toml."""

from __future__ import annotations

from typing import ClassVar, Literal

from pydantic import Field, model_validator

from ....study.study_fields import ProcedureTable, Word, quantity


class TransferFunctionTable(ProcedureTable):
    """A linear model from one channel to another: ``[transfer_function]``.

    Attributes
    ----------
    input : str
        Channel of the input.
    output : str
        Channel of the output.
    poles : int
        Order of the denominator.
    zeros : int
        Order of the numerator, below `poles`.
    hold : str
        Course of the input between its samples: ``"first"`` (straight lines) or ``"zero"`` (steps).
    reference : str, optional
        Channel without noise that drives input and output, such as a controller's reference.
    period : float, optional
        Period of the recordings of protocol ``random_phase_multisine`` [s]. Noise and distortion are then separated.
    confidence : float
        Confidence level of the intervals, in (0, 1).
    """

    alone: ClassVar[bool] = True

    input: Word = "torque"
    output: Word = "position"
    poles: int = Field(ge=1, le=8)
    zeros: int = Field(0, ge=0)
    hold: Literal["first", "zero"] = "first"
    reference: Word | None = None
    period: quantity("s", gt=0) | None = None
    confidence: float = Field(0.95, gt=0, lt=1)

    def reads(self, channel: str, stream: str) -> bool:
        """Input, output and reference."""
        return not stream and channel in (self.input, self.output, self.reference)

    @model_validator(mode="after")
    def _proper(self) -> TransferFunctionTable:
        if self.zeros >= self.poles:
            raise ValueError(f"found zeros = {self.zeros} with poles = {self.poles}, expected fewer zeros than poles")
        return self
