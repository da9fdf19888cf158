"""Table ``[tree]`` of study.toml: a robot whose joints are identified together."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, field_validator, model_validator

from ...study.study_fields import ProcedureTable, RelativePath, Word, quantity
from ...study.study_file import RigJoint
from ...units import parse_quantity

if TYPE_CHECKING:
    from ...study.study import Study
    from ...study.study_file import StudyFile

READ_QUANTITIES = frozenset(
    ("position", "motor_position", "velocity", "torque", "force", "current", "voltage", "duty", "supply", "enabled")
)
"""Quantities of the channels that are read; the channel's name ends in a joint's name."""

FURTHER_TERMS = ("load", "square_root", "stribeck", "directional")
"""Friction terms that a joint may have in addition to viscous and dry friction and an offset."""


class TreeTable(ProcedureTable):
    """A robot whose joints are identified together: ``[tree]``.

    ``init --urdf FILE`` writes a study with this table. Motors that move two joints require torque constants.

    Attributes
    ----------
    urdf : str or None
        Path of the robot's URDF file, from the study's folder; None if ``[[rig.joints]]`` state positions and axes.
        Meshes are not needed, and bodies without mass are assumed to have 1 kg.
    dh : str or None
        Convention of the joints' Denavit-Hartenberg rows, ``"classic"`` or ``"modified"``; None without rows.
    gravity : tuple of float
        Direction of gravity in the base's frame, of length 1.
    held : dict[str, float]
        Joints of the file that did not move, and their positions: ``{ finger = "20 mm" }``.
    effort_lowpass : float or None
        Cut-off of the low-pass on effort, if it differs from that of the motion [Hz].
    velocity_width : float
        Width of the smooth sign of velocity in friction, tanh(velocity / width); 0 for the sign itself [rad/s; m/s].
    segments : str, int or dict
        Segments that are held out together for intervals and for the choice of terms: stretches between common stops
        (``"automatic"``), a number of equal parts of each recording, or the ends of each segment by recording [s].
    families : tuple of str
        Candidate friction terms of each joint in addition to viscous and dry friction and an offset.
    ripple : bool
        Whether each drive is searched for ripple of unknown order.
    inertia_prior : bool
        Whether the bodies stated in the study or the robot's file are the prior of the consistent ones; otherwise the
        prior is guessed from the positions of the joints.
    gains : str
        Source of the drives' gains: ``"stated"`` in ``[[rig.joints]]``; ``"desired"`` from the channels
        ``desired_current`` and ``desired_torque``; ``"payload"`` from fitted recordings with and without a known mass.
    confidence : float
        Confidence level of the intervals, in (0, 1).
    published : dict[str, dict[str, float]]
        Published values by joint and parameter, in SI; shown for comparison only.
    """

    alone: ClassVar[bool] = True
    several: ClassVar[bool] = True
    bridges: ClassVar[bool] = False

    urdf: RelativePath | None = None
    dh: Literal["classic", "modified"] | None = None
    gravity: tuple[float, float, float] = (0.0, 0.0, -1.0)
    held: dict[str, Annotated[float, Field(json_schema_extra={"type": "string"})]] = Field({})
    effort_lowpass: quantity("Hz", gt=0) | None = None
    velocity_width: quantity("<velocity>", ge=0) = 0.0
    segments: Literal["automatic"] | Annotated[int, Field(ge=2, le=1000)] | dict[Word, tuple[quantity("s"), ...]] = (
        "automatic"
    )
    families: tuple[Literal[FURTHER_TERMS], ...] = FURTHER_TERMS
    ripple: bool = True
    inertia_prior: bool = True
    gains: Literal["stated", "desired", "payload"] = "stated"
    confidence: float = Field(0.95, gt=0, lt=1)
    published: dict[str, dict[str, Annotated[float, Field(json_schema_extra={"type": "string"})]]] = Field({})

    def named_files(self) -> tuple[str, ...]:
        """Return the file of the robot, if there is one."""
        return () if self.urdf is None else (self.urdf,)

    @field_validator("gravity")
    @classmethod
    def _unit_length(cls, gravity: tuple[float, float, float]) -> tuple[float, float, float]:
        length = math.hypot(*gravity)
        if length == 0.0:
            raise ValueError("found [0, 0, 0], which points nowhere, expected a direction such as [0, 0, -1]")
        return (gravity[0] / length, gravity[1] / length, gravity[2] / length)

    @field_validator("held", mode="before")
    @classmethod
    def _coordinates(cls, held: Any) -> Any:
        if not isinstance(held, dict):
            return held
        return {name: parse_quantity(text, ("rad", "m"), name) for name, text in held.items()}

    @field_validator("published", mode="before")
    @classmethod
    def _in_si(cls, published: Any) -> Any:
        if not isinstance(published, dict) or not all(isinstance(table, dict) for table in published.values()):
            return published
        return {
            joint: {name: parse_quantity(text, None, f"{joint}.{name}") for name, text in table.items()}
            for joint, table in published.items()
        }

    @field_validator("segments")
    @classmethod
    def _ends_in_order(cls, segments: Any) -> Any:
        for name, ends in segments.items() if isinstance(segments, dict) else ():
            if len(ends) < 2 or any(b <= a for a, b in pairwise(ends)):
                raise ValueError(f"{name}: found ends {list(ends)}, expected at least two times that increase")
        return segments

    @model_validator(mode="after")
    def _families_once(self) -> TreeTable:
        if len(set(self.families)) < len(self.families):
            raise ValueError(f"families: found {list(self.families)}, expected each once")
        return self

    def reads(self, channel: str, stream: str) -> bool:
        """Return whether a channel of motion or drive is read, also in a joined stream."""
        head, _, joint = channel.rpartition(".")
        return (head or joint) in READ_QUANTITIES

    def require_in(self, config: StudyFile) -> None:
        """Refuse a study whose robot is not described, or described twice."""
        for message in self._missing(config):
            raise ValueError(message)

    def _missing(self, config: StudyFile) -> Iterator[str]:
        joints = config.rig.joints
        names = [joint.joint for joint in joints]
        for joint in joints:
            where = f"[[rig.joints]] {joint.joint}"
            if not isinstance(joint, RigJoint):
                yield "[tree] found [rig] of one joint, expected [[rig.joints]]: a table for each, also of one alone"
            if joint.drive is None:
                yield f"{where}: found no [rig.joints.drive], expected one that says how its effort is known"
            own = [key for key in ("parent", *FRAME_KEYS, "body") if key in joint.model_fields_set]
            if self.urdf is not None and own:
                yield f"{where}: found {own[0]} and [tree] urdf, expected one of them: the file states it"
            if self.urdf is None and isinstance(joint, RigJoint):
                yield from self._missing_of(joint, where)
            if self.urdf is None and joint.parent not in (None, "base", *names):
                yield f'{where}: found parent = "{joint.parent}", expected "base" or one of {", ".join(names)}'
        unlike = len({joint.motion for joint in joints}) > 1
        if unlike and config.processing.dead_band and any(joint.dead_band is None for joint in joints):
            yield (
                "[processing] dead_band: found one for joints that turn and joints that slide, expected dead_band of "
                "each in [[rig.joints]]"
            )
        if self.urdf is None:
            yield from _unlike_frames(joints)
        if self.urdf is None and self.held:
            yield "[tree] held: found joints of a robot's file, expected [tree] urdf to name the file"
        entries = [entry.name for entry in config.recordings]
        for name in self.segments if isinstance(self.segments, dict) else ():
            if name not in entries:
                yield f'[tree] segments: found "{name}", expected names of [[recordings]]: {", ".join(entries)}'
        for name in self.published:
            if name not in names:
                yield f'[tree.published] found "{name}", expected joints: {", ".join(names)}'
        for entry in config.recordings:
            if config.processing_of(entry.name).lowpass is None:
                yield '[processing] lowpass: found none, expected a cut-off such as "10 Hz": look at the spectrum'

    def _missing_of(self, joint: RigJoint, where: str) -> Iterator[str]:
        """Yield what keeps the frame of a joint from being known, where no robot's file says it."""
        stated = [key for key in FRAME_KEYS if key in joint.model_fields_set]
        if set(stated) not in FRAME_KEY_SETS:
            found = " and ".join(stated) or "no place"
            yield (
                f"{where}: found {found}, expected place and axis (with turned where the frame is), dh, or through "
                'and axis of each joint, or [tree] urdf = "FILE"'
            )
        elif joint.dh is not None and self.dh is None:
            yield (
                f'{where}: found a row of Denavit and Hartenberg, expected [tree] dh = "classic" (a row turns about '
                'the z axis before it) or "modified" (about the one behind it)'
            )


FRAME_KEYS = ("place", "turned", "axis", "through", "dh")
"""Keys of ``[[rig.joints]]`` that say where a joint is."""

FRAME_KEY_SETS = ({"place", "axis"}, {"place", "turned", "axis"}, {"through", "axis"}, {"dh"})
"""Those of them that say it together."""


def _unlike_frames(joints: Sequence[object]) -> Iterator[str]:
    """Yield what joints must have in common, where no robot's file says it."""
    told = [joint for joint in joints if isinstance(joint, RigJoint)]
    bare = [joint.name for joint in told if joint.body is None]
    if bare and len(bare) < len(told):
        yield f"[[rig.joints]] {bare[0]}: found no body, expected one of each joint, or of none"
    for key in ("through", "dh"):
        other = [joint.name for joint in told if getattr(joint, key) is None]
        if other and len(other) < len(told):
            yield f"[[rig.joints]] {other[0]}: found no {key}, which other joints have; expected it of each, or of none"


def robot_files(study: Study) -> Iterator[Path]:
    """Yield the file of the robot, if a study names one."""
    for file in study.table(TreeTable).named_files():
        yield study.inside(file, "[tree] urdf")
