r"""The torque that a wearer gives against an orthosis through straps, which yield.

Against 10 N m a strap turns by tens of degrees, and the limb's weight acts at the limb's own angle. The orthosis's
balance tells the strap's torque, the strap tells where the limb is and what it feels of that torque where the strap
sits askew, and the limb's balance gives the wearer's:

.. math::
    \theta_k = \text{the core's response to } \tau_c, \theta_e, \qquad
    \tau_k = I_k\ddot\theta_k + b_k\dot\theta_k + m_{sh} g l_{sh}\sin\theta_k + \tau_c / a'(\theta_e)

In the gap of a slack strap no torque tells where the limb is; it is led through from flank to flank, monotonically.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from .. import _core
from ..fit.strap.strap_fit import REVERSAL_MARGIN_S
from ..fit.strap.strap_model import CORE_NAMES, StrapModel
from ..fit.strap.strap_torque import Limb, Orthosis, StrappedSwing, from_orthosis
from ..signals.filters import central_difference, zero_phase_lowpass

STILL = 0.02
"""Share of its spread below which a slack strap's torque says nothing of where the limb is."""


@dataclass(frozen=True, eq=False)
class StrappedBodies:
    """What is moved where a strap yields: orthosis and limb, each by itself."""

    orthosis: Orthosis
    limb: Limb
    model: StrapModel
    strap: np.ndarray  # (p,) As the core names it


def strapped_torque(
    time: np.ndarray,
    position: np.ndarray,
    torque: np.ndarray,
    *,
    orthosis: Orthosis,
    limb: Limb,
    strap: np.ndarray,
    lowpass: float,
) -> np.ndarray:
    """Torque of the wearer about the joint. `time`, `position`, `torque` (n,) [s], [rad], [N m]; `strap`
    (p,) as the core names it (``StrapModel.core``); `lowpass` [Hz]; gives (n,) [N m]."""
    nowhere = np.zeros(0)
    trial = StrappedSwing("", "fitted", time, position, torque, nowhere, nowhere)
    limb_position, _, against, _ = _core.strap_response(
        strap, position, from_orthosis(trial, orthosis).torque, period=1.0 / trial.fs, still=0.0, active=[]
    )
    if strap[CORE_NAMES.index("strap_slack")] > 0.0:
        limb_position = position + _through_the_gap(limb_position - position, against, trial.fs)
    angle, through = zero_phase_lowpass(np.column_stack([limb_position, against]), lowpass, 4, trial.fs).T
    velocity = central_difference(angle, trial.fs)
    own = limb.inertia * central_difference(velocity, trial.fs) + limb.viscous * velocity
    return own + limb.gravity * np.sin(angle - limb.zero) + through


def _through_the_gap(ahead: np.ndarray, against: np.ndarray, fs: float) -> np.ndarray:
    """How far the limb is ahead, what lies between the flanks of a gap led through it; (n,) [rad]."""
    reach = max(1, round(REVERSAL_MARGIN_S * fs))
    free = np.convolve(np.abs(against) <= STILL * np.std(against), np.ones(2 * reach + 1), "same") > 0.5
    on_flank = np.flatnonzero(~free)
    if not free.any() or len(on_flank) < 2:
        return ahead
    at = np.clip(np.arange(len(ahead)), on_flank[0], on_flank[-1])
    return np.where(free, PchipInterpolator(on_flank, ahead[on_flank])(at), ahead)
