"""Result of `identify` for several joints, each on its own: a table of all, then what was found of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ...models.estimates import Parameter, Verdict
from ...study.pages.quantities import percent, unit_text, value_and_half_interval
from ...study.procedures.result import FigureTable, HeldOutEffort, Result
from ...study.study import Study
from .joint_result import JointResult
from .joint_views import joint_views

MAX_PARAMETER_COLUMNS = 6
"""The table of joints has at most so many parameters; those that most joints have are shown."""


@dataclass(frozen=True, kw_only=True, repr=False)
class EachJointResult(Result):
    """Result of `identify` for several joints, each identified on its own."""

    joints: Mapping[str, Result] = field(repr=False)  # what was found of each joint that was identified
    resting: Mapping[str, str] = field(default_factory=dict)  # joints that show nothing, and what was found of them
    left_out: Mapping[str, str] = field(default_factory=dict)  # joints that were not identified, and why

    @property
    def estimates(self) -> Mapping[str, Parameter]:
        """Parameters by joint and name, such as ``"hip.inertia"``."""
        return {f"{joint}.{name}": p for joint, found in self.joints.items() for name, p in found.estimates.items()}

    @property
    def held_out(self) -> tuple[HeldOutEffort, ...]:
        """Efforts of joints on held-out recordings, measured and predicted."""
        return tuple(replace(held, joint=joint) for joint, found in self.joints.items() for held in found.held_out)

    @property
    def prose(self) -> str:
        """Sentences of all joints for a paper."""
        return "\n\n".join(found.prose for found in self.joints.values() if found.prose)

    def for_page(self) -> EachJointResult:
        return replace(self, joints={joint: found.for_page() for joint, found in self.joints.items()})


def complete_each_joint(
    study: Study,
    joints: Mapping[str, Result],
    resting: Mapping[str, str],
    left_out: Mapping[str, str],
    verdicts: tuple[Verdict, ...],
) -> EachJointResult:
    """Return the result of a study whose `joints` were identified."""
    return EachJointResult(
        study=study.name,
        headline=_headline(joints, resting, left_out),
        tables=(
            joint_table(study, joints, resting, left_out),
            *(replace(t, title=f"{joint}: {t.title}") for joint, found in joints.items() for t in found.tables),
        ),
        verdicts=verdicts,
        rows=tuple(row for found in joints.values() for row in found.rows),
        cards={_card_name(name, joint): card for joint, found in joints.items() for name, card in found.cards.items()},
        checksums={name: digest for found in joints.values() for name, digest in found.checksums.items()},
        confidence=study.model.confidence,
        joints=joints,
        resting=resting,
        left_out=left_out,
    )


def _card_name(name: str, joint: str) -> str:
    """Return the name of a joint's card: ``joint_hip.load`` for ``joint.load``."""
    kind, dot, rest = name.partition(".")
    return f"{kind}_{joint}{dot}{rest}"


def heldout_text(found: Result) -> str:
    """Return the error on held-out recordings in words, or that on fitted ones where none is held out; "" if neither
    was found."""
    if not isinstance(found, JointResult):
        return ""
    one = found.headlined
    if np.isfinite(one.heldout_effort_error):
        return f"{percent(one.heldout_effort_error)} %"
    return f"{percent(one.fitted_effort_error)} % (fitted)"


def headline_parameters(found: Result) -> dict[str, Parameter]:
    """Return the parameters that a joint's result tells first."""
    if isinstance(found, JointResult):
        return {p.name: p for p in found.headlined.estimate.parameters}
    return {name: p for name, p in found.estimates.items() if "." not in name}


def joint_table(
    study: Study, joints: Mapping[str, Result], resting: Mapping[str, str], left_out: Mapping[str, str]
) -> FigureTable:
    """Return the table of all joints: parameters with half their intervals, and the error on held-out recordings."""
    found = {joint: headline_parameters(result) for joint, result in joints.items()}
    counts = Counter(name for own in found.values() for name in own)
    most = {name for name, _ in counts.most_common(MAX_PARAMETER_COLUMNS)}
    names = [name for name in counts if name in most]
    level, rows = study.model.confidence, []
    for joint in joint_views(study):
        own = found.get(joint, {})
        cells = [_cell(own.get(name), level) for name in names]
        state = heldout_text(joints[joint]) if joint in joints else "not moved" if joint in resting else "left out"
        rows.append((joint, *cells, state))
    heads = ("joint", *(name.replace("_", " ") for name in names), "held-out error")
    return FigureTable(
        f"Joints, each identified on its own, with half their {100 * level:g} % intervals", heads, tuple(rows)
    )


def _cell(parameter: Parameter | None, level: float) -> str:
    if parameter is None:
        return "–"
    return f"{value_and_half_interval(parameter, level)} {unit_text(parameter.unit)}".rstrip()


def _headline(joints: Mapping[str, Result], resting: Mapping[str, str], left_out: Mapping[str, str]) -> str:
    count = len(joints) + len(resting) + len(left_out)
    held = all(isinstance(r, JointResult) and np.isfinite(r.headlined.heldout_effort_error) for r in joints.values())
    errors = ", ".join(f"{joint} {heldout_text(found) or 'without'}" for joint, found in joints.items())
    text = f"{len(joints)} of {count} joints identified, each on its own; {'held-out ' * held}effort error: {errors}"
    text += f"; not moved: {', '.join(resting)}" if resting else ""
    return text + (f"; left out, for the reasons below: {', '.join(left_out)}" if left_out else "")
