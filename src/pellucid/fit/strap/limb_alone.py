"""The limb without its strap: gravity on a rigid plate while the muscles rest, inertia from shares of the body."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..._errors import IdentificationError
from ...models.anthropometry import Segment
from ...signals.input_output import InputOutput
from ..joint.gravity_holds import GravityFit, Hold, added_gravity, find_holds
from ..parameter import Parameter
from .strap_torque import Limb

INERTIA_SPREAD = 0.10
"""Share by which a person's shank differs from tables of shares, one standard deviation: what tables differ by."""
VISCOUS_SPREAD = 0.2
"""Of a relaxed knee's damping, which nothing here measures [N m s/rad]."""


@dataclass(frozen=True, eq=False)
class LimbFit:
    """What is known of one wearer's shank and foot."""

    gravity: Parameter  # gravity, zero: m g l [N m], and the angle at which it hangs [rad]
    zero: Parameter
    inertia: Parameter  # About the knee, from shares of the body and the gravity found [kg m^2]
    trials: tuple[tuple[Hold, ...], ...] = field(repr=False)  # Limb and orthosis together, trial by trial
    refused: Mapping[str, str] = field(repr=False)  # Trials that were not used, and why
    # By table: ``"winter"`` (knee to ankle), ``"published"`` (Winter's shares of the length from knee to heel),
    # ``"de_leva"``; those that what is known of the participant allows
    segments: Mapping[str, Segment] = field(repr=False)

    @property
    def limb(self) -> Limb:
        """Ready for the strap's torque; its damping is not known."""
        spread = np.diag([self.inertia.standard_error, self.gravity.standard_error, VISCOUS_SPREAD])
        return Limb(self.inertia.value, self.gravity.value, 0.0, spread**2, self.zero.value)


def fit_limb(
    relaxed: Sequence[InputOutput],
    alone: GravityFit,
    segments: Mapping[str, Segment],
    *,
    at_work: Mapping[str, str] | None = None,
) -> LimbFit:
    """Gravity of the limb: that of limb and orthosis on a rigid plate, less the orthosis's own."""
    refused = dict(at_work or {})
    used = [r for r in relaxed if r.recording not in refused]
    if not used:
        why = "; ".join(refused.values()) or "none was recorded"
        raise IdentificationError(f"the limb's gravity: found no relaxed trial to use, expected one or more: {why}")
    trials = tuple(find_holds(r.time, r.output, r.input, recording=r.recording) for r in used)
    gravity, zero = added_gravity(trials, alone)
    return LimbFit(gravity, zero, _inertia(gravity, segments), trials, refused, dict(segments))


def _inertia(gravity: Parameter, segments: Mapping[str, Segment]) -> Parameter:
    """Shares say how inertia goes with gravity, I/(m g l); the gravity itself was measured."""
    if not segments:
        return Parameter("inertia", "kg*m^2", float("nan"), float("nan"), identifiable=False)
    # Per unit of gravity the inertia grows with the length alone, which tables know better than the mass.
    ratios = [s.inertia / s.gravity() for s in segments.values()]
    value = float(np.mean(ratios)) * gravity.value
    return Parameter("inertia", "kg*m^2", value, INERTIA_SPREAD * value)
