"""Hill-type muscles calibrated from arrays of envelopes, angles and torque."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import IdentificationError
from ...models.estimates import Estimates
from ...numerics.arguments import with_checked_arguments
from ..fit.muscle_posterior import muscle_parameters, reported_covariance
from .hill import HillMap, fit_hill
from .torque_trial import MuscleSource, TorqueTrial, divide_rows


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class CalibratedTorque(Estimates):
    """Calibrated muscles: a mapping from parameter to estimate, and a predictor of the joint's torque.

    Attributes
    ----------
    muscles : HillMap
        The calibrated muscles and how they were chosen.
    source : MuscleSource
        Constants and paths of the muscles.
    joint : str
        Name of the joint.
    """

    muscles: HillMap = field(repr=False)
    source: MuscleSource = field(repr=False)
    joint: str

    def predict(
        self, time: ArrayLike, envelopes: Mapping[str, ArrayLike], angles: Mapping[str, ArrayLike]
    ) -> np.ndarray:
        """Predict the joint's torque.

        Parameters
        ----------
        time : array_like, shape (n,)
            Evenly sampled [s].
        envelopes : mapping of str to array_like, shape (n,)
            Envelopes by muscle, normalised as in the calibration.
        angles : mapping of str to array_like, shape (n,)
            Joint angles [rad].

        Returns
        -------
        ndarray, shape (n,)
            Torque [N m].

        Raises
        ------
        RecordingError
            If shapes differ or a sample is missing.
        """
        zero = np.zeros(np.shape(time))
        t, muscles = np.asarray(time, float), self.source
        return self.muscles.predict(
            TorqueTrial("prediction", self.joint, t, _arrays(envelopes), _arrays(angles), zero, muscles=muscles)
        )


@with_checked_arguments
def calibrate_muscles(
    time: ArrayLike,
    envelopes: Mapping[str, ArrayLike],
    angles: Mapping[str, ArrayLike],
    torque: ArrayLike,
    *,
    joint: str | None = None,
    muscles: MuscleSource | None = None,
    groups: ArrayLike | None = None,
    causal: bool = False,
) -> CalibratedTorque:
    """Calibrate Hill-type muscles so that they explain a measured joint torque.

    Bounded least squares over strength, fibre and tendon lengths, activation dynamics, delay and passive tissue, with
    an anatomical prior. Cross-validation within the given samples chooses the prior's weight.

    Parameters
    ----------
    time : array_like, shape (n,)
        Time [s], evenly sampled within a group.
    envelopes : mapping of str to array_like, shape (n,)
        EMG envelopes by muscle, relative to a maximal contraction [1]; names as in the leg model, such as
        ``"vastus_lateralis"`` or ``"biceps_femoris_long"``.
    angles : mapping of str to array_like, shape (n,)
        Joint angles [rad], that of `joint` among them. The knee's angle grows with extension.
    torque : array_like, shape (n,)
        Measured torque of the joint [N m], positive along its angle.
    joint : str, optional
        Name of the joint; the first of `angles` by default.
    muscles : MuscleSource, optional
        Constants and paths of the muscles; those of a leg model (gait2392) by default.
    groups : array_like, shape (n,), optional
        Trial or repetition of each sample; cross-validation leaves out whole groups.
    causal : bool
        Whether angles are filtered from past samples only.

    Returns
    -------
    CalibratedTorque
        Parameters by name with standard errors, and `predict`.

    Raises
    ------
    IdentificationError
        If no muscle across the joint has an envelope, or the torque is constant.
    RecordingError
        If shapes differ or a sample is missing.

    Examples
    --------
    >>> envelopes = {"vastus_lateralis": extensor, "semitendinosus": flexor}            # doctest: +SKIP
    >>> fit = pl.calibrate_muscles(t, envelopes, {"knee": angle}, torque)                # doctest: +SKIP
    >>> fit["strength.vastus_lateralis"].value                                          # doctest: +SKIP
    """
    if not angles:
        raise IdentificationError("calibrate_muscles: found no angle, expected the joint's own")
    name = next(iter(angles)) if joint is None else joint
    t = np.asarray(time, float)
    parts = [np.arange(len(t))]
    if groups is not None:
        each = np.asarray(groups)
        if each.shape != t.shape:
            raise IdentificationError(f"calibrate_muscles: found groups of shape {each.shape}, expected {t.shape}")
        parts = np.split(np.arange(len(t)), np.flatnonzero(each[1:] != each[:-1]) + 1)
    of = ["" if groups is None else str(np.asarray(groups)[rows[0]]) for rows in parts]
    trials = divide_rows(parts, of, name, t, _arrays(envelopes), _arrays(angles), np.asarray(torque, float), muscles)
    found = fit_hill(trials, causal=causal)
    return CalibratedTorque(
        parameters=muscle_parameters(found.fit),
        covariance=reported_covariance(found.fit),
        title=f"Calibrated muscles of the {name}",
        muscles=found,
        source=trials[0].known_muscles,
        joint=name,
    )


def _arrays(columns: Mapping[str, ArrayLike]) -> dict[str, np.ndarray]:
    return {name: np.asarray(x, float) for name, x in columns.items()}
