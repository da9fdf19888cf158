"""Exporters of the controllers of one joint, and of a robot of several joints."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from ..._errors import PellucidError
from ...study.exporter import ExportRequest
from ..joint_compensation import DEFAULT_PERIOD_S
from ..study.rig_instruments import rig_instruments
from .controller_exporter import ControllerExporter, LawExporter, own_folder
from .controller_values import ControllerValues
from .elbow_values import elbow_values
from .joint_values import joint_values
from .tree_folder import write_tree_folder
from .tree_values import tree_values


class JointExporter(LawExporter):
    """Compensation of one joint, with or without a carriage."""

    order: ClassVar[int] = 40
    default_name: ClassVar[str] = "compensation"

    def values(self, request: ExportRequest) -> ControllerValues:
        """Return the numbers of the law."""
        study, period = request.study, request.period
        if request.controller not in (None, "compensation"):
            if request.card is not None:
                raise PellucidError(f"export of {study.name}: found a card and a controller, expected one of them")
            return elbow_values(
                study, request.controller, slider=request.slider, participant=request.participant,
                exponents=request.exponents, load=request.load, held=request.held, period=period,
            )  # fmt: skip
        if request.participant is not None:
            raise PellucidError(
                f"export of {study.name}: found a participant, expected none: nobody wears this joint"
            )
        if request.exponents is not None:
            raise PellucidError(f"export of {study.name}: found exponents without a controller, expected fc or pcfr")
        if request.load is not None or request.held is not None:
            raise PellucidError(
                f"export of {study.name}: found a load without a controller, expected one that carries a body"
            )
        given = {} if period is None else {"period": period}
        return joint_values(
            study, card=request.card, slider=request.slider, allow_outside=request.allow_outside, **given
        )


class ArmExporter(ControllerExporter):
    """A controller that carries a robot of several joints."""

    order: ClassVar[int] = 10
    unused: ClassVar[tuple[str, ...]] = ("slider", "participant", "exponents", "load", "held", "probe")
    why_unused: ClassVar[str] = "this robot has several joints"

    def fits(self, request: ExportRequest) -> bool:
        """Return whether the study is of a robot of several joints."""
        return request.study.has_table("tree")

    def export(self, request: ExportRequest) -> Path:
        """Write the folder of the controller."""
        study, out = request.study, self.folder(request)
        tree = tree_values(
            study, card=request.card, controller=request.controller,
            period=DEFAULT_PERIOD_S if request.period is None else request.period,
            allow_outside=request.allow_outside, instruments=[rig_instruments(joint) for joint in study.rig.joints],
        )  # fmt: skip
        with own_folder(out, study, request.controller or "carried", tree.cards, overwrite=request.overwrite):
            return write_tree_folder(study.name, tree, out)
