"""A joint with friction, driven by a motor: what of it is done with moving, held and locked joints."""

from __future__ import annotations

from typing import TYPE_CHECKING, TypeVar

from ...study.procedures.procedure import Progress, quiet
from ...study.study import Study

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ...files.fault import Fault
    from ...study.pages.page import Page
    from .joint_result import JointResult
    from .solve_joint import SolvedJoint
    from .spring_result import SpringResult
    from .static_postures import PostureResult

Found = TypeVar("Found")


def is_joint_asked(study: Study) -> bool:
    """Return whether a study describes a driven joint without a carriage, and no other procedure that runs alone."""
    return _has_drive(study) and study.rig.slider is None


def is_each_joint_asked(study: Study) -> bool:
    """Return whether a study describes several driven joints, and nothing that takes them together."""
    return study.config.identifies_each_joint


def is_slider_asked(study: Study) -> bool:
    """Return whether a study describes a driven joint with a carriage, and no other procedure that runs alone."""
    return _has_drive(study) and study.rig.slider is not None


def _has_drive(study: Study) -> bool:
    # A rig of several joints refuses to be asked for a drive.
    is_alone = any(table.alone for table in study.config.procedures.values())
    return not is_alone and len(study.rig.joints) == 1 and study.rig.drive is not None


def faults(study: Study) -> list[Fault]:
    """Return the faults of recordings of a moving joint, a held one, or a locked spring."""
    from .held_joint import is_held_throughout, is_locked_spring, with_spring_advice

    if is_locked_spring(study):
        from .spring_recordings import spring_faults

        return spring_faults(study)
    if is_held_throughout(study):
        from .static_postures import posture_faults

        return with_spring_advice(study, posture_faults(study))
    from .joint_faults import joint_faults

    return with_spring_advice(study, joint_faults(study))


def run(
    study: Study, tell: Progress = quiet, *, families: Sequence[str] | None = None, thorough: bool = True
) -> JointResult | PostureResult | SpringResult:
    """Identify a moving joint, a held one, or a locked spring."""

    def identify() -> JointResult:
        from .identify_joint import identify_joint

        return identify_joint(study, tell, families=families, thorough=thorough)

    return _found(study, identify)


def solve(
    study: Study, families: Sequence[str] | None = None, *, thorough: bool = True
) -> SolvedJoint | PostureResult | SpringResult:
    """Do as `run`, but do not report a moving joint."""

    def solve_moving() -> SolvedJoint:
        from .solve_joint import solve_joint

        return solve_joint(study, families=families, thorough=thorough)

    return _found(study, solve_moving)


def _found(study: Study, identify: Callable[[], Found]) -> Found | PostureResult | SpringResult:
    """Return what is found of a study's joint, by `identify` if it moves; errors advise on a locked spring."""
    from ..._errors import IdentificationError
    from ..fit.recording_agreement import StatedValueError
    from .held_joint import is_held_throughout, is_locked_spring, spring_advice
    from .joint_faults import ReversedSignError

    if is_locked_spring(study):
        from .spring_recordings import identify_spring

        return identify_spring(study)
    try:
        if is_held_throughout(study):
            from .static_postures import identify_postures

            return identify_postures(study)
        return identify()
    except StatedValueError:
        raise  # whatever the joint is, the stated value is wrong
    except IdentificationError as error:
        advice = spring_advice(study)
        if not advice:
            raise
        if isinstance(error, ReversedSignError):
            raise ReversedSignError(error.found, error.do, advice) from error
        raise IdentificationError(f"{error}; {advice}") from error


def page(study: Study, found: JointResult | PostureResult | SpringResult) -> Page:
    """Return the part of the report that shows a moving joint, a held one, or a locked spring."""
    from . import joint_page, spring_recordings, static_postures
    from .spring_result import SpringResult

    if isinstance(found, SpringResult):
        return spring_recordings.spring_page(study, found)
    if isinstance(found, static_postures.PostureResult):
        return static_postures.posture_page(study, found)
    return joint_page.page(study, found)


def notes(study: Study) -> list[Fault]:
    """Return the stretches that are too short, and the notes on clocks."""
    from ...study.quality import clock_faults
    from ...study.recorded_motions import short_stretch_faults

    clocks = (fault for recording in study.recordings() for fault in clock_faults(recording, study))
    return [*short_stretch_faults(study), *clocks]
