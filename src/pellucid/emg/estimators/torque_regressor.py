"""Scikit-learn estimator of torque from arrays of EMG and motion, by any of the methods."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.model_selection import GroupKFold, KFold
from sklearn.utils import Tags
from sklearn.utils.validation import check_is_fitted, validate_data

from ..._errors import IdentificationError
from .cross_validation import first_best, weighted_rmse
from .families import ESTIMATOR_FAMILIES, find_family
from .families.family import Family
from .feature_scale import find_trial_weights
from .torque_trial import Features, MuscleSource, TorqueTrial, divide_rows

MOTION_COLUMN_PREFIXES = ("angle.", "velocity.", "acceleration.")
"""Prefixes of the columns that hold motion, not EMG."""


class TorqueRegressor(RegressorMixin, BaseEstimator):
    """Estimator of a joint's torque from EMG envelopes and motion.

    Settings (penalties, sizes of trees) are chosen by cross-validation within the fitted rows; then all rows are fitted
    once. Works with scikit-learn's ``clone``, ``cross_val_score``, ``Pipeline`` and ``GridSearchCV``.

    Parameters
    ----------
    method : str
        ``"ridge"``, ``"linear"``, ``"boosting"``, ``"bagging"``, ``"tree"``, ``"hill"`` (muscles, which need
        `columns`), or another of `methods`.
    columns : sequence of str, optional
        Names of the columns of X, which methods made of muscles need: ``"time"`` [s], ``"emg.<muscle>"`` (envelopes
        relative to a maximal contraction), ``"angle.<joint>"`` [rad]. Other methods use them to tell motion from EMG:
        products of columns that begin with ``angle.``, ``velocity.`` or ``acceleration.`` are then among ridge
        regression's candidates.
    joint : str, optional
        Name of the torque's joint; by default the joint of the first column ``angle.<joint>``.
    muscles : MuscleSource, optional
        Constants and paths of muscles; by default those of a leg model, whose knee angle grows with extension.
    settings : mapping, optional
        Settings to use, without a choice.
    folds : int
        Number of folds of the cross-validation, at least 2. Folds are made of the groups given to `fit`, otherwise of
        consecutive blocks of rows.
    causal : bool
        Whether methods made of muscles filter angles from the past alone.

    Attributes
    ----------
    settings_ : dict
        Chosen settings.
    tried_ : dict of str to float
        RMSE of every candidate in cross-validation, in the torque's unit.
    regressor_ : object
        Fitted scikit-learn estimator, or calibrated muscles.
    n_features_in_ : int
        Number of columns of X.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> from sklearn.model_selection import GroupKFold, cross_val_score
    >>> rng = np.random.default_rng(0)
    >>> envelopes, angle = rng.uniform(0.0, 1.0, (300, 2)), rng.uniform(-1.0, 1.0, 300)
    >>> torque = envelopes @ [30.0, -25.0] + 5.0 * np.sin(angle) + rng.normal(0.0, 0.5, 300)
    >>> X, repetition = np.column_stack([envelopes, angle]), np.repeat(np.arange(6), 50)
    >>> estimator = pl.TorqueRegressor("ridge").fit(X, torque, groups=repetition)
    >>> estimator.settings_
    {'products': 'none', 'penalty': 0.1}
    >>> r2 = cross_val_score(estimator, X, torque, groups=repetition, cv=GroupKFold(3))
    >>> bool(r2.min() > 0.99)
    True
    """

    def __init__(
        self,
        method: str = "ridge",
        *,
        columns: Sequence[str] | None = None,
        joint: str | None = None,
        muscles: MuscleSource | None = None,
        settings: Mapping[str, Any] | None = None,
        folds: int = 5,
        causal: bool = False,
    ):
        self.method = method
        self.columns = columns
        self.joint = joint
        self.muscles = muscles
        self.settings = settings
        self.folds = folds
        self.causal = causal

    def __sklearn_tags__(self) -> Tags:
        tags = super().__sklearn_tags__()
        # Methods made of muscles need to know what each column is: an array without names tells them nothing.
        known = ESTIMATOR_FAMILIES.items()
        family = next((each for name, each in known if self.method in (name, *each.aliases)), None)
        needs_names = family is not None and family.fit_trials is not None
        tags.input_tags.two_d_array = not needs_names or self.columns is not None
        return tags

    @staticmethod
    def methods() -> dict[str, str]:
        """Return the name and description of every method.

        Returns
        -------
        dict of str to str
            Description by name.

        Examples
        --------
        >>> import pellucid as pl
        >>> pl.TorqueRegressor.methods()["ridge"]
        'ridge regression'
        """
        return {name: family.description for name, family in ESTIMATOR_FAMILIES.items()}

    def fit(self, X: np.ndarray, y: np.ndarray, groups: np.ndarray | None = None) -> TorqueRegressor:
        """Choose settings and fit.

        Parameters
        ----------
        X : array_like, shape (n, k)
            Features, with rows in the order of time.
        y : array_like, shape (n,)
            Torque [N m].
        groups : array_like, shape (n,), optional
            Repetition, trial or person of each row. Rows of one group are held out together while settings are chosen,
            and groups are weighed so that those with the largest torques do not decide. Published methods weigh none.

        Returns
        -------
        TorqueRegressor
            The fitted estimator itself.

        Raises
        ------
        IdentificationError
            If there is no such method, or X lacks what it needs.
        ValueError
            If X, y and groups do not fit together, or a value is missing.

        Examples
        --------
        >>> import numpy as np
        >>> import pellucid as pl
        >>> X = np.random.default_rng(0).normal(size=(50, 3))
        >>> pl.TorqueRegressor("linear").fit(X, X @ [1.0, 2.0, 3.0]).predict([[1.0, 1.0, 1.0]]).round(6)
        array([6.])
        """
        name, family = find_family(self.method)
        X, y = validate_data(self, X, y, dtype=np.float64, y_numeric=True)
        if groups is not None and np.shape(groups) != y.shape:
            raise IdentificationError(f"torque: found groups of shape {np.shape(groups)}, expected {y.shape} as of y")
        names = self._column_names(X)
        if family.fit_trials is not None:
            self.settings_: dict[str, Any] = {}
            self.tried_: dict[str, float] = {}
            self.regressor_ = family.fit_trials(self._divide_into_trials(X, y, names, groups), name, self.causal)
            return self
        motion = tuple(i for i, column in enumerate(names) if column.startswith(MOTION_COLUMN_PREFIXES))
        seen = Features(X, tuple(names), motion)
        weight = _group_weights(y, groups) if family.weight_argument else None
        self.settings_, self.tried_ = self._choose_settings(family, seen, y, groups, weight)
        self.regressor_ = family.make(self.settings_, seen).fit(X, y, **family.weights(weight))
        return self

    def predict(self, X: np.ndarray) -> np.ndarray:
        """Predict the torque.

        Parameters
        ----------
        X : array_like, shape (n, k)
            Features with the same columns as in `fit`.

        Returns
        -------
        ndarray, shape (n,)
            Torque [N m].

        Raises
        ------
        ValueError
            If X has other columns than in `fit`, a value is missing, or `fit` was not called.

        Examples
        --------
        >>> import numpy as np
        >>> import pellucid as pl
        >>> X = np.random.default_rng(0).normal(size=(50, 1))
        >>> pl.TorqueRegressor("tree").fit(X, np.sign(X[:, 0])).predict([[-2.0], [2.0]])
        array([-1.,  1.])
        """
        check_is_fitted(self)
        X = validate_data(self, X, dtype=np.float64, reset=False)
        if find_family(self.method)[1].fit_trials is None:
            return self.regressor_.predict(X)
        trials = self._divide_into_trials(X, np.zeros(len(X)), self._column_names(X), None)
        return np.concatenate([self.regressor_.predict(trial) for trial in trials])

    def _choose_settings(
        self, family: Family, seen: Features, y: np.ndarray, groups, weight: np.ndarray | None
    ) -> tuple[dict, dict[str, float]]:
        """Return the settings chosen by cross-validation, and the RMSE of every candidate by its description."""
        candidates: dict[str, Mapping[str, Any]] = {}
        for settings in family.settings if self.settings is None else (self.settings,):
            # Without columns of motion, some candidates are equal.
            candidates.setdefault(repr(sorted(family.make(settings, seen).get_params().items())), settings)
        count = len(y) if groups is None else len(np.unique(groups))
        folds = min(self.folds, count)
        if len(candidates) == 1 or folds < 2 or len(y) < 2 * folds:
            return dict(next(iter(candidates.values()))), {}
        divided = (KFold(folds) if groups is None else GroupKFold(folds)).split(seen.x, y, groups)
        parts = list(divided)
        tried, predicted = list(candidates.values()), np.empty((len(candidates), len(y)))
        for fitted, out in parts:
            within = replace(seen, x=seen.x[fitted])
            own_weight = None if weight is None else weight[fitted]
            predicted[:, out] = family.fit_and_predict(tried, within, within.x, y[fitted], seen.x[out], own_weight)
        errors = [weighted_rmse(y, own, weight) for own in predicted]
        words = [", ".join(f"{key} {value}" for key, value in each.items()) for each in tried]
        best = first_best(errors)
        return dict(tried[best]), dict(zip(words, errors, strict=True))

    def _column_names(self, X: np.ndarray) -> list[str]:
        """Return the names of the columns of X."""
        if self.columns is None:
            return list(getattr(self, "feature_names_in_", [f"x{i}" for i in range(X.shape[1])]))
        if len(self.columns) != X.shape[1]:
            raise IdentificationError(
                f"torque: found {len(self.columns)} names of columns ({', '.join(self.columns)}), expected "
                f"{X.shape[1]} as X has columns"
            )
        return list(self.columns)

    def _divide_into_trials(self, X: np.ndarray, y: np.ndarray, names: Sequence[str], groups) -> list[TorqueTrial]:
        """Divide rows into trials. A new trial begins where the group changes, or where time jumps."""
        columns = dict(zip(names, X.T, strict=True))
        time = columns.get("time")
        lacking = [] if time is not None else ["time"]
        for head in ("emg.", "angle."):
            lacking += [] if any(name.startswith(head) for name in names) else [f"{head}<name>"]
        if time is None or lacking:
            raise IdentificationError(
                f"{self.method}: found the columns {', '.join(names)}, expected {', '.join(lacking)} among `columns`"
            )
        angles = {n.removeprefix("angle."): x for n, x in columns.items() if n.startswith("angle.")}
        joint = self.joint or next(iter(angles))
        steps = np.diff(time)
        ahead = steps[steps > 0.0]
        if not len(ahead):
            raise IdentificationError(f"{self.method}: found no two rows whose time increases, expected rows in order")
        new = (steps <= 0.0) | (steps > 1.5 * np.median(ahead))
        if groups is not None:
            new |= np.asarray(groups)[1:] != np.asarray(groups)[:-1]
        parts = np.split(np.arange(len(time)), np.flatnonzero(new) + 1)
        of = [f"{i}" if groups is None else f"{np.asarray(groups)[rows[0]]}" for i, rows in enumerate(parts)]
        envelopes = {n.removeprefix("emg."): x for n, x in columns.items() if n.startswith("emg.")}
        return divide_rows(parts, of, joint, time, envelopes, angles, y, self.muscles)


def _group_weights(y: np.ndarray, groups: np.ndarray | None) -> np.ndarray | None:
    """Return the weight of each row by its group's torque, shape (n,), or None if all count the same."""
    if groups is None:
        return None
    names, member = np.unique(groups, return_inverse=True)
    weights = find_trial_weights([y[member == i] for i in range(len(names))])
    return None if weights is None else weights[member]
