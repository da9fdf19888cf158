"""The results of a demonstration, for the page and the command line."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pellucid.controllers.export.microcontroller import OnCortexM4
from pellucid.joint.slider.slider_fit import SliderFit
from pellucid.joint.study.joint_result import JointResult
from pellucid.people.study.assessment_result import AssessmentResult
from pellucid.study.study import Study

from ..elbow.rig import ElbowRig
from .coverage import Coverage
from .replayed_session import ReplayedSession


@dataclass(frozen=True)
class Demonstration:
    """Results of `demo`.

    Attributes
    ----------
    page : Path
        Page of the demonstration.
    robot : ElbowRig
        The virtual robot with its true parameters.
    elbow : Study
        Study of the virtual robot.
    fit : SliderFit
        Identified model of the virtual robot.
    people : Study
        Study of simulated people who wear the robot.
    findings : AssessmentResult
        Effects of the controllers on the people.
    controller : Path
        Folder of the exported controller.
    cost : OnCortexM4 or None
        Cost of the exported controller on a Cortex-M4F; None if tools are missing.
    played : tuple of int or None
        Number of steps of the test vector on this machine, and number of wrong ones; None without a compiler.
    coverages : tuple of Coverage
        Coverage of the intervals, for white and for coloured residuals.
    real : Study
        Study of a real machine, whose recordings come with the package.
    real_fit : JointResult
        Identified model of the real machine.
    notes : tuple of str
        Omitted parts, with the reasons.
    replayed : ReplayedSession or None
        A few seconds of a live session, computed again; None where this system cannot run one.
    """

    page: Path
    robot: ElbowRig
    elbow: Study
    fit: SliderFit
    people: Study
    findings: AssessmentResult
    controller: Path
    cost: OnCortexM4 | None
    played: tuple[int, int] | None
    coverages: tuple[Coverage, ...]
    real: Study
    real_fit: JointResult
    notes: tuple[str, ...]
    replayed: ReplayedSession | None = None
