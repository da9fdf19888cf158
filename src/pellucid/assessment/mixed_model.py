r"""How much a condition changes a value, from every movement: a linear mixed model of movements within people.

.. math::
   y_{ij} = \beta_0 + \beta_1 c_{ij} + x_{ij}^T \gamma + u_{0i} + u_{1i} c_{ij} + \varepsilon_{ij}

for movement j of participant i: c is 1/2 in the condition and -1/2 in control, so that :math:`\beta_1` is the change; x
are covariates about their mean, such as amplitude, direction, trial and period, also times c where they are to act
differently; each participant has a level and a change of their own, u, normal with any covariance [1]_. It is fitted by
restricted likelihood, by statsmodels. Without the participants' own changes movements would count as if each were a
participant's, and "within" be said far too often.

The change is held against a margin by Student's t with n - 1 degrees of freedom for n participants. That is what
balanced data have exactly, whose estimate and standard error are those of the participants' mean differences, and few
for others: Satterthwaite's and Kenward and Roger's approximations are not in statsmodels.

Where no optimiser comes to rest, or the standard error is no number, the model says so and nothing else: its answer is
then that anything is possible. A variance that comes to rest at 0 is an answer, not a failure.

.. [1] N. M. Laird, J. H. Ware, "Random-effects models for longitudinal data", Biometrics 38, 1982.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from math import nan

import numpy as np
from scipy import stats

from .._errors import PellucidError
from .equivalence import Equivalence, Margin, equivalence_of_estimate, nothing_known

FEWEST = 3
"""Participants without whom changes of their own cannot be told from scatter."""

OPTIMISERS = ("lbfgs", "powell")
"""Tried in turn: gradients first; where a variance is 0 these often do not come to rest, and a search without them
does."""


@dataclass(frozen=True)
class Coefficient:
    """One fixed effect, in the unit of the values over that of its covariate."""

    value: float
    error: float
    p_value: float  # That it is 0, two-sided


@dataclass(frozen=True)
class MixedModel:
    """What movements say of a condition's change."""

    participants: int
    movements: int
    change: float  # Of the condition, in the unit of the values; NaN where there is `trouble`
    error: float  # Its standard error
    spread: float  # Standard deviation of participants' own changes
    scatter: float  # And of movements
    covariates: Mapping[str, Coefficient]
    trouble: str = ""  # Why there is no answer

    @property
    def degrees(self) -> int:
        """Of freedom: one fewer than participants."""
        return self.participants - 1

    def equivalence(self, margin: Margin, alpha: float = 0.05) -> Equivalence:
        """The change against a margin in its unit."""
        if self.trouble:
            return nothing_known(margin, self.participants, "mixed_model", alpha)
        return equivalence_of_estimate(
            self.change, self.error, self.degrees, margin, alpha=alpha, method="mixed_model", pairs=self.participants
        )


def no_model(participants: int, movements: int, trouble: str) -> MixedModel:
    """What is left of a model that could not be fitted, and why."""
    return MixedModel(participants, movements, nan, nan, nan, nan, {}, trouble)


def mixed_model(
    values: np.ndarray,
    participant: np.ndarray,
    condition: np.ndarray | None,
    covariates: Mapping[str, np.ndarray],
) -> MixedModel:
    """Fit the model.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Of movements, in any one unit.
    participant : ndarray, shape (n,)
        Whose each is: any labels.
    condition : ndarray of bool, shape (n,), or None
        Whether it is under the condition, or under control; None: all are under the condition, and "change" is the
        level.
    covariates : mapping of str to ndarray, shape (n,) each
        What else acts. Those that are constant, or combinations of others, are left out.

    Returns
    -------
    MixedModel

    Raises
    ------
    PellucidError
        If shapes differ, a value is no number, or a participant lacks control or condition.

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(1)
    >>> who, under = np.repeat(np.arange(8), 20), np.tile([False, True], 80)
    >>> own = rng.normal(0.1, 0.05, 8)[who] * under + rng.normal(0.0, 0.1, 160)
    >>> found = mixed_model(own, who, under, {"trial": np.tile(np.arange(20.0), 8)})
    >>> abs(found.change - 0.1) < 3.0 * found.error, found.degrees
    (True, 7)
    """
    y, who = np.asarray(values, float), np.unique(participant, return_inverse=True)[1]
    under = None if condition is None else np.asarray(condition, bool)
    shapes = {np.shape(each) for each in (participant, *((under,) if under is not None else ()), *covariates.values())}
    if y.ndim != 1 or shapes != {y.shape} or not all(np.isfinite(each).all() for each in (y, *covariates.values())):
        raise PellucidError(f"mixed model: found values {y.shape} and {shapes}, expected as many numbers of all")
    people = int(who.max()) + 1
    if under is not None:
        there = np.zeros((people, 2), bool)
        there[who, under.astype(int)] = True
        if not there.all():
            raise PellucidError("mixed model: found a participant without control or condition, expected both")
    if people < FEWEST:
        return no_model(people, len(y), f"found {people} participants, expected at least {FEWEST}")
    slope = np.ones(len(y)) if under is None else under - 0.5
    heads = [slope] if under is None else [np.ones(len(y)), slope]
    kept = _independent(heads, covariates)
    design = np.column_stack([*heads, *kept.values()])
    start = np.linalg.lstsq(design, y, rcond=None)[0]
    scale = float(np.std(y - design @ start))
    if scale == 0.0:
        return no_model(people, len(y), "found no scatter at all")
    fitted, trouble = _fitted(y / scale, design, who, np.column_stack(heads), start / scale)
    if fitted is None:
        return no_model(people, len(y), trouble)
    at = len(heads) - 1
    value, error = scale * np.asarray(fitted.fe_params), scale * np.asarray(fitted.bse_fe)
    told = {
        name: Coefficient(
            float(value[i]), float(error[i]), float(2.0 * stats.t.sf(abs(value[i] / error[i]), people - 1))
        )
        for i, name in enumerate(kept, len(heads))
    }
    spread = scale * float(np.sqrt(max(float(np.asarray(fitted.cov_re)[at, at]), 0.0)))
    scatter = scale * float(np.sqrt(fitted.scale))
    return MixedModel(people, len(y), float(value[at]), float(error[at]), spread, scatter, told)


def _independent(heads: list[np.ndarray], covariates: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Covariates about their mean and of size 1, without those that others make up."""
    kept: dict[str, np.ndarray] = {}
    basis = np.linalg.qr(np.column_stack([np.ones(len(heads[0])), *heads[1:]]))[0]
    for name, each in covariates.items():
        own = np.asarray(each, float) - np.mean(each)
        size = float(np.linalg.norm(own))
        rest = own - basis @ (basis.T @ own)
        if size > 0.0 and np.linalg.norm(rest) > 1e-6 * size:
            kept[name] = own
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    return kept


def _fitted(y, design, who, random, start):
    """Statsmodels' fit, or None and why there is none."""
    from statsmodels.regression.mixed_linear_model import MixedLM, MixedLMParams

    k = random.shape[1]
    begin = MixedLMParams.from_components(fe_params=start, cov_re=np.diag([0.5, 0.1][:k]))
    model = MixedLM(y, design, groups=who, exog_re=random)
    for optimiser in OPTIMISERS:
        try:
            # A fit tells its state by warnings alone; it is asked for it below.
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = model.fit(reml=True, method=[optimiser], start_params=begin)
                errors = np.asarray(found.bse_fe)
        except (np.linalg.LinAlgError, ValueError, ZeroDivisionError):
            continue
        if found.converged and np.isfinite(errors).all() and (errors > 0.0).all():
            return found, ""
    return None, f"did not come to rest ({' and '.join(OPTIMISERS)} were tried)"
