r"""Change of a value by a condition, estimated by a linear mixed model of movements within people.

.. math::
   y_{ij} = \beta_0 + \beta_1 c_{ij} + x_{ij}^T \gamma + u_{0i} + u_{1i} c_{ij} + \varepsilon_{ij}

for movement j of participant i: c is 1/2 in the condition and -1/2 in control, so that :math:`\beta_1` is the change; x
are covariates about their mean, such as amplitude, direction, trial and period, also times c where they are to act
differently; each participant has a level and a change of their own, u, normal with any covariance [1]_. It is fitted by
restricted likelihood, by statsmodels. Without the participants' own changes movements would count as if each were a
participant's, and "within" be said far too often.

Student's t with n - 1 degrees of freedom compares the change of n participants with a margin. This number is exact for
balanced data, whose estimate and standard error are those of the participants' mean differences. It is conservative
for others: Satterthwaite's and Kenward and Roger's approximations are not in statsmodels.

Where no optimiser comes to rest, or the standard error is no number, the model says so and nothing else: its answer is
then that anything is possible. A variance that comes to rest at 0 is an answer, not a failure.

Thirds of a session (`thirds`) say whether movements were still changing.

.. [1] N. M. Laird, J. H. Ware, "Random-effects models for longitudinal data", Biometrics 38, 1982.
"""

from __future__ import annotations

import warnings
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from math import nan

import numpy as np
import scipy

from .._errors import PellucidError, missing_package
from .equivalence import Equivalence, Margin, equivalence_of_estimate, unknown_equivalence

MIN_PARTICIPANTS = 3
"""The model needs this many participants: with fewer, their own changes cannot be separated from scatter."""

OPTIMISER_SEQUENCE = ("lbfgs", "powell")
"""Optimisers in the order in which they are tried. Gradients often fail to converge if a variance is 0; Powell's search
without gradients then converges."""


@dataclass(frozen=True)
class Coefficient:
    """One fixed effect, in the unit of the values over that of its covariate."""

    value: float
    error: float  # standard error
    p_value: float  # two-sided p value of the test against 0


@dataclass(frozen=True)
class MixedModel:
    """Fitted linear mixed model of a condition's change."""

    participants: int
    movements: int
    change: float  # change by the condition, in the unit of the values; NaN if there is `trouble`
    error: float  # standard error of the change
    spread: float  # standard deviation of participants' own changes
    scatter: float  # standard deviation of movements
    covariates: Mapping[str, Coefficient]
    trouble: str = ""  # reason why the fit failed

    @property
    def degrees(self) -> int:
        """Degrees of freedom: one fewer than participants."""
        return self.participants - 1

    def equivalence(self, margin: Margin, alpha: float = 0.05) -> Equivalence:
        """Return the test of the change against a margin in its unit."""
        if self.trouble:
            return unknown_equivalence(margin, self.participants, "mixed_model", alpha)
        return equivalence_of_estimate(
            self.change, self.error, self.degrees, margin, alpha=alpha, method="mixed_model", pairs=self.participants
        )


def failed_model(participants: int, movements: int, trouble: str) -> MixedModel:
    """Return the result of a model that could not be fitted, with the reason as `trouble`."""
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
        Values of movements, all in the same unit.
    participant : ndarray, shape (n,)
        Label of each movement's participant.
    condition : ndarray of bool, shape (n,), or None
        True for movements under the condition, False under control; None: all are under the condition, and "change" is
        the level.
    covariates : mapping of str to ndarray, shape (n,) each
        Covariates of the movements. Constant ones, and linear combinations of others, are excluded.

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
        raise PellucidError(f"mixed model: found the shapes {y.shape} and {shapes}, expected equal ones without NaN")
    people = int(who.max()) + 1
    if under is not None:
        there = np.zeros((people, 2), bool)
        there[who, under.astype(int)] = True
        if not there.all():
            raise PellucidError("mixed model: found a participant without control or condition, expected both")
    if people < MIN_PARTICIPANTS:
        return failed_model(people, len(y), f"found {people} participants, expected at least {MIN_PARTICIPANTS}")
    slope = np.ones(len(y)) if under is None else under - 0.5
    heads = [slope] if under is None else [np.ones(len(y)), slope]
    kept = _independent_covariates(heads, covariates)
    design = np.column_stack([*heads, *kept.values()])
    start = np.linalg.lstsq(design, y, rcond=None)[0]
    scale = float(np.std(y - design @ start))
    if scale == 0.0:
        return failed_model(people, len(y), "found no scatter at all")
    fitted, trouble = _fit_restricted_likelihood(y / scale, design, who, np.column_stack(heads), start / scale)
    if fitted is None:
        return failed_model(people, len(y), trouble)
    at = len(heads) - 1
    value, error = scale * np.asarray(fitted.fe_params), scale * np.asarray(fitted.bse_fe)
    told = {
        name: Coefficient(
            float(value[i]), float(error[i]), float(2.0 * scipy.stats.t.sf(abs(value[i] / error[i]), people - 1))
        )
        for i, name in enumerate(kept, len(heads))
    }
    spread = scale * float(np.sqrt(max(float(np.asarray(fitted.cov_re)[at, at]), 0.0)))
    scatter = scale * float(np.sqrt(fitted.scale))
    return MixedModel(people, len(y), float(value[at]), float(error[at]), spread, scatter, told)


def _independent_covariates(heads: list[np.ndarray], covariates: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the covariates about their mean, without those that are linear combinations of others."""
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


def _fit_restricted_likelihood(y, design, who, random, start):
    """Return the fit of statsmodels and "", or None and the reason of the failure."""
    try:
        from statsmodels.regression.mixed_linear_model import MixedLM, MixedLMParams
    except ModuleNotFoundError:
        return None, str(missing_package("mixed model", "statsmodels", "statistics"))
    k = random.shape[1]
    begin = MixedLMParams.from_components(fe_params=start, cov_re=np.diag([0.5, 0.1][:k]))
    model = MixedLM(y, design, groups=who, exog_re=random)
    for optimiser in OPTIMISER_SEQUENCE:
        try:
            # Warnings are silenced, because convergence is checked below.
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                found = model.fit(reml=True, method=[optimiser], start_params=begin)
                errors = np.asarray(found.bse_fe)
        except (np.linalg.LinAlgError, ValueError, ZeroDivisionError):
            continue
        if found.converged and np.isfinite(errors).all() and (errors > 0.0).all():
            return found, ""
    return None, f"did not come to rest ({' and '.join(OPTIMISER_SEQUENCE)} were tried)"


MIN_MOVEMENTS = 9
"""Thirds are compared only if a condition has at least this many movements, three in each third."""


@dataclass(frozen=True)
class Thirds:
    """Means of the first and the last third of a participant's movements, less the mean of similar movements."""

    first: float
    last: float

    @property
    def drift(self) -> float:
        """Change from the first third to the last."""
        return self.last - self.first


def thirds(values: Sequence[float], cells: Sequence[Hashable]) -> Thirds | None:
    """Return the first and the last third of `values`, (n,), in the order of recording; None with too few.

    `cells` assigns each value to its cell of similar movements.
    """
    y = np.asarray(values, float)
    if len(y) < MIN_MOVEMENTS:
        return None
    kinds = {cell: i for i, cell in enumerate(dict.fromkeys(cells))}
    which = np.array([kinds[cell] for cell in cells])
    rest = y - (np.bincount(which, y) / np.bincount(which))[which]
    part = len(y) // 3
    return Thirds(float(rest[:part].mean()), float(rest[-part:].mean()))
