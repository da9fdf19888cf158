"""The leg in an exoskeleton, and its wearer's torque, from swings of the exoskeleton empty and with the leg in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..._errors import IdentificationError
from ..parameter import Parameter
from .loaded_swing import Swing, SwingFit


def leg_alone(empty: SwingFit, loaded: SwingFit) -> tuple[Parameter, Parameter]:
    """Inertia and weight moment of the leg, by difference. Gives `inertia`, `weight_moment` [kg m^2], [kg m]."""

    def less(with_leg: Parameter, without: Parameter) -> Parameter:
        value = with_leg.value - without.value
        sd = float(np.hypot(with_leg.standard_error, without.standard_error))
        held = with_leg.at_bound or without.at_bound
        return Parameter(with_leg.name, with_leg.unit, value, sd, held, abs(value) > 1.96 * sd > 0.0)

    return less(loaded.inertia, empty.inertia), less(loaded.weight_moment, empty.weight_moment)


@dataclass(frozen=True, eq=False)
class WearerTorque:
    """A wearer's torque at the knee, by balance."""

    # time, torque, standard_error: (n,) [s], [N m], and how sure it is as far as the parameters' covariances say [N m]
    time: np.ndarray
    torque: np.ndarray
    standard_error: np.ndarray


def torque_of_a_bare_leg(empty: SwingFit, loaded: SwingFit, motion: Swing) -> WearerTorque:
    """What a leg takes to swing by itself: loaded less empty (eq. 12 of the paper).

    It is the wearer's torque where the exoskeleton takes none of it: taken off, or fully compensated by its motor.
    """
    if empty.form != loaded.form:
        raise IdentificationError(
            f"found the terms {', '.join(empty.form.terms)} empty and {', '.join(loaded.form.terms)} loaded, expected "
            "one form for both, with one angle of rest"
        )
    matrix = loaded.form.regressor(motion)
    return _wearer(motion, matrix @ (loaded.coefficients - empty.coefficients), matrix, loaded, empty)


def torque_in_a_worn_exoskeleton(loaded: SwingFit, motion: Swing) -> WearerTorque:
    """What leg and exoskeleton take to swing, less what the motor gave.

    It is the wearer's torque where the exoskeleton is worn: passive, with a motor that gives nothing or little.
    """
    matrix = loaded.form.regressor(motion)
    return _wearer(motion, matrix @ loaded.coefficients - motion.torque, matrix, loaded)


def _wearer(motion: Swing, torque: np.ndarray, matrix: np.ndarray, *fits: SwingFit) -> WearerTorque:
    covariance = sum(fit.covariance for fit in fits)
    return WearerTorque(motion.time, torque, np.sqrt(np.einsum("ni,ij,nj->n", matrix, covariance, matrix)))
