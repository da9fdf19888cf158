"""Input of the findings of a joint: the study, its motions, and every family fitted to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ...models.parameter import Parameter
from ...numerics.motion import Motion
from ...numerics.posterior.posterior import Posterior
from ...numerics.regression import Stack
from ...study.study import Study
from ..fit.family_choice import FamilyContest
from ..fit.friction_family import FamilyFit
from ..fit.load_shares import LoadShares
from ..fit.presliding import Presliding
from ..fit.replay import Machine
from ..fit.unknown_payload import UnknownPayload


@dataclass(frozen=True)
class JointCase:
    """An identified joint, from which the findings are derived."""

    study: Study
    motions: tuple[Motion, ...]  # motions of every recording, fitted and held out
    data: Stack  # fitted motions
    excerpt: tuple[Motion, ...]  # all motions, or parts of each if there are hours, for methods that search
    fits: Mapping[str, FamilyFit]  # fit of each family
    best: str  # name of the best family
    contest: FamilyContest | None = None  # choice among the families; None if there was none
    machine: Machine = field(default_factory=Machine)
    failures: Mapping[str, str] = field(default_factory=dict)  # reasons, by family, why it could not be fitted
    constant: Parameter | None = None  # drive constant from payloads, divided by the stated one if that is known
    no_constant: str = ""  # reason why the payloads give no drive constant
    posterior: Posterior | None = None  # posterior of the best family, if requested
    no_posterior: str = ""  # reason why a requested posterior is missing
    presliding: Presliding | None = None  # estimate of the presliding travel; None if not requested
    shares: LoadShares = field(default_factory=lambda: LoadShares(False, "no known load"))  # decision on load shares
    # payload of each recording that study.toml says to carry an unknown one; None where it cannot be estimated
    payloads: Mapping[str, UnknownPayload | None] = field(default_factory=dict)

    @property
    def fit(self) -> FamilyFit:
        """Fit of the best family."""
        return self.fits[self.best]

    @property
    def level(self) -> float:
        """Confidence level of the study's intervals."""
        return self.study.model.confidence

    @property
    def judged_on_held_out(self) -> bool:
        """Whether any recording was held out."""
        return any(m.split == "heldout" for m in self.motions)

    @property
    def rotary(self) -> bool:
        """Whether the joint is rotary."""
        return self.study.rig.motion == "rotary"
