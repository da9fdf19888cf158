"""What a demonstration made, for those who tell of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..deployment.microcontroller import OnCortexM4
from ..fit.slider.slider_fit import SliderFit
from ..lab.elbow.rig import ElbowRig
from ..procedures.assessment.assessment_result import AssessmentResult
from ..procedures.joint.joint_result import JointResult
from ..recordings.study import Study
from .coverage import Coverage


@dataclass(frozen=True)
class Demonstration:
    """What `demo` made.

    Attributes
    ----------
    page : Path
        That tells it in order.
    robot : ElbowRig
        The virtual robot as it truly is.
    elbow : Study
    fit : SliderFit
        What was identified of it.
    people : Study
    findings : AssessmentResult
        What its controllers do to them.
    controller : Path
        Folder of the exported one.
    cost : OnCortexM4 or None
        None where tools are missing.
    played : tuple of int or None
        Steps of the test vector on this machine and those that were wrong; None without a compiler.
    coverages : tuple of Coverage
    real : Study
        Of a real machine, whose recordings come with the package.
    real_fit : JointResult
    notes : tuple of str
        What was left out, and why.
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
