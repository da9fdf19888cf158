"""What findings of a joint look at: the study, its motions, and every family fitted to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from ...fit.block_test import HeldOutComparison
from ...fit.joint.friction_family import FamilyFit
from ...fit.joint.load_shares import LoadShares
from ...fit.joint.presliding import Presliding
from ...fit.joint.replay import Machine
from ...fit.parameter import Parameter
from ...fit.posterior.posterior import Posterior
from ...fit.regression import Stack
from ...recordings.study import Study
from ...signals.motion import Motion


@dataclass(frozen=True)
class JointCase:
    """A joint as identified, before anything is said of it."""

    study: Study
    motions: tuple[Motion, ...]  # Of every recording, fitted and held out
    data: Stack  # The fitted ones
    excerpt: tuple[Motion, ...]  # All of them, or parts of each where there are hours: for what searches
    fits: Mapping[str, FamilyFit]
    best: str
    contest: HeldOutComparison | None = None  # Of the families; None where there was none
    machine: Machine = field(default_factory=Machine)
    failures: Mapping[str, str] = field(default_factory=dict)  # Families that could not be fitted, and why
    constant: Parameter | None = None  # The drive's, from known payloads; over the stated one where that is known
    no_constant: str = ""  # Why the payloads give none
    posterior: Posterior | None = None  # Of the best family, if it was asked for
    no_posterior: str = ""  # Why there is none although it was asked for
    presliding: Presliding | None = None  # Of friction below slip; None where nobody asked
    shares: LoadShares = field(default_factory=lambda: LoadShares(False, "no known load"))  # Of load friction

    @property
    def fit(self) -> FamilyFit:
        """The best family."""
        return self.fits[self.best]

    @property
    def level(self) -> float:
        """Confidence of the study's intervals."""
        return self.study.model.confidence

    @property
    def judged_on_held_out(self) -> bool:
        """Whether anything was held out."""
        return any(m.split == "heldout" for m in self.motions)

    @property
    def rotary(self) -> bool:
        """Whether the joint turns."""
        return self.study.rig.motion == "rotary"
