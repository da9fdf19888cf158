"""Identify the limb without the strap: gravity on a rigid plate with relaxed muscles, inertia from body proportions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..._errors import IdentificationError
from ...models.anthropometry import Segment
from ...models.parameter import Parameter
from ...numerics.gravity_holds import GravityFit, Hold, added_gravity, find_holds
from ..input_output import InputOutput
from .strap_torque import Limb

INERTIA_SPREAD_SHARE = 0.10
"""Relative standard deviation of a shank's inertia around anthropometric tables: the difference between the tables."""

KNEE_DAMPING_SPREAD = 0.2
"""Prior standard deviation of a relaxed knee's damping, which no recording here measures [N m s/rad]."""


@dataclass(frozen=True, eq=False)
class LimbFit:
    """The identified shank and foot of one wearer."""

    gravity: Parameter  # gravity torque m g l [N m]
    zero: Parameter  # angle at which the limb hangs [rad]
    inertia: Parameter  # inertia about the knee, from body proportions and the measured gravity [kg m^2]
    trials: tuple[tuple[Hold, ...], ...] = field(repr=False)  # holds of limb and orthosis together, by trial
    refused: Mapping[str, str] = field(repr=False)  # reasons why trials were not used, by trial
    # segments by table: ``"winter"`` (knee to ankle), ``"published"`` (Winter's proportions of the length from knee to
    # heel), ``"de_leva"``; only the tables whose inputs are known of the participant
    segments: Mapping[str, Segment] = field(repr=False)

    @property
    def limb(self) -> Limb:
        """The parameters as the strap's torque needs them; the damping is unknown and taken as 0."""
        spread = np.diag([self.inertia.standard_error, self.gravity.standard_error, KNEE_DAMPING_SPREAD])
        return Limb(self.inertia.value, self.gravity.value, 0.0, spread**2, self.zero.value)


def fit_limb(
    relaxed: Sequence[InputOutput],
    alone: GravityFit,
    segments: Mapping[str, Segment],
    *,
    at_work: Mapping[str, str] | None = None,
) -> LimbFit:
    """Identify the limb: the gravity of limb and orthosis on a rigid plate, minus that of the orthosis `alone`.

    `at_work` gives the reasons why trials are refused because the muscles were active, by trial.
    """
    refused = dict(at_work or {})
    used = [r for r in relaxed if r.recording not in refused]
    if not used:
        why = "; ".join(refused.values()) or "none was recorded"
        raise IdentificationError(f"the limb's gravity: found no relaxed trial to use, expected one or more: {why}")
    trials = tuple(find_holds(r.time, r.output, r.input, recording=r.recording) for r in used)
    gravity, zero = added_gravity(trials, alone)
    return LimbFit(gravity, zero, _inertia(gravity, segments), trials, refused, dict(segments))


def _inertia(gravity: Parameter, segments: Mapping[str, Segment]) -> Parameter:
    """Return the inertia from the measured gravity and the ratio I/(m g l) of the anthropometric tables."""
    if not segments:
        return Parameter("inertia", "kg*m^2", float("nan"), float("nan"), identifiable=False)
    # The ratio of inertia to gravity depends on the length alone, which the tables predict better than the mass.
    ratios = [s.inertia / s.gravity() for s in segments.values()]
    value = float(np.mean(ratios)) * gravity.value
    return Parameter("inertia", "kg*m^2", value, INERTIA_SPREAD_SHARE * value)
