"""Parameters of a leg in an exoskeleton and its wearer's torque, from swings of the exoskeleton without and with the
leg."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ...models.parameter import Parameter
from .loaded_swing import Swing, SwingFit


def leg_alone(empty: SwingFit, loaded: SwingFit) -> tuple[Parameter, Parameter]:
    """Return the leg's inertia [kg m^2] and weight moment [kg m], the difference between loaded and empty swings."""

    def less(with_leg: Parameter, without: Parameter) -> Parameter:
        value = with_leg.value - without.value
        sd = float(np.hypot(with_leg.standard_error, without.standard_error))
        held = with_leg.at_bound or without.at_bound
        return Parameter(with_leg.name, with_leg.unit, value, sd, held, abs(value) > 1.96 * sd > 0.0)

    return less(loaded.inertia, empty.inertia), less(loaded.weight_moment, empty.weight_moment)


@dataclass(frozen=True, eq=False)
class WearerTorque:
    """A wearer's torque at the knee from the balance of torques; arrays of shape (n,)."""

    time: np.ndarray  # [s]
    torque: np.ndarray  # [N m]
    standard_error: np.ndarray  # standard error due to the parameters' covariances [N m]


def bare_leg_torque(empty: SwingFit, loaded: SwingFit, motion: Swing) -> WearerTorque:
    """Return the torque that a leg needs to swing by itself: loaded minus empty (eq. 12 of the paper).

    This is the wearer's torque if the exoskeleton takes none of it: it is taken off, or its motor compensates it fully.
    """
    if empty.form != loaded.form:
        raise IdentificationError(
            f"found the terms {', '.join(empty.form.terms)} empty and {', '.join(loaded.form.terms)} loaded, expected "
            "one form for both, with one angle of rest"
        )
    matrix = loaded.form.regressor(motion)
    return _wearer_torque(motion, matrix @ (loaded.coefficients - empty.coefficients), matrix, loaded, empty)


def worn_exoskeleton_torque(loaded: SwingFit, motion: Swing) -> WearerTorque:
    """Return the torque that leg and exoskeleton need to swing, minus the motor's torque.

    This is the wearer's torque in a worn exoskeleton whose motor gives little or no torque.
    """
    matrix = loaded.form.regressor(motion)
    return _wearer_torque(motion, matrix @ loaded.coefficients - motion.torque, matrix, loaded)


def _wearer_torque(motion: Swing, torque: np.ndarray, matrix: np.ndarray, *fits: SwingFit) -> WearerTorque:
    covariance = sum(fit.covariance for fit in fits)
    return WearerTorque(motion.time, torque, np.sqrt(np.einsum("ni,ij,nj->n", matrix, covariance, matrix)))
