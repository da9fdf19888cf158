r"""Torque that a wearer applies to an orthosis through compliant straps.

Under 10 N m a strap turns by tens of degrees, and the limb's weight acts at the limb's own angle. The strap's torque
follows from the orthosis's balance of torques. The strap's model gives the limb's angle and the torque on the limb,
which differs if the strap sits askew. The wearer's torque follows from the limb's balance:

.. math::
    \theta_k = \text{the core's response to } \tau_c, \theta_e, \qquad
    \tau_k = I_k\ddot\theta_k + b_k\dot\theta_k + m_{sh} g l_{sh}\sin\theta_k + \tau_c / a'(\theta_e)

In the gap of a slack strap, no torque tells the limb's angle. It is interpolated monotonically across the gap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

from ... import _core
from ...numerics.filters import central_difference, zero_phase_lowpass
from .strap_fit import REVERSAL_MARGIN_S
from .strap_model import CORE_NAMES, StrapModel
from .strap_torque import Limb, Orthosis, StrappedSwing, from_orthosis

GAP_TORQUE_SHARE = 0.02
"""A slack strap is in its gap if its torque is at most this share of the torque's standard deviation.

Chosen by judgement; no measurement is recorded.
"""


@dataclass(frozen=True, eq=False)
class StrappedBodies:
    """Orthosis and limb as two bodies, and the compliant strap between them."""

    orthosis: Orthosis
    limb: Limb
    model: StrapModel
    strap: np.ndarray  # Parameters of the strap in the core's order, shape (p,)


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
    """Return the wearer's torque about the joint, shape (n,) [N m].

    `time` [s], the orthosis's `position` [rad] and its `torque` [N m] have shape (n,). `strap` holds the strap's
    parameters in the core's order (``StrapModel.core``), shape (p,). `lowpass` is a cut-off [Hz].
    """
    nowhere = np.zeros(0)
    trial = StrappedSwing("", "fitted", time, position, torque, nowhere, nowhere)
    limb_position, _, against, _ = _core.strap_response(
        strap, position, from_orthosis(trial, orthosis).torque, period=1.0 / trial.fs, still=0.0, active=[]
    )
    if strap[CORE_NAMES.index("strap_slack")] > 0.0:
        limb_position = position + _interpolate_gap(limb_position - position, against, trial.fs)
    angle, through = zero_phase_lowpass(np.column_stack([limb_position, against]), lowpass, 4, trial.fs).T
    velocity = central_difference(angle, trial.fs)
    own = limb.inertia * central_difference(velocity, trial.fs) + limb.viscous * velocity
    return own + limb.gravity * np.sin(angle - limb.zero) + through


def _interpolate_gap(ahead: np.ndarray, against: np.ndarray, fs: float) -> np.ndarray:
    """Return the limb's angle relative to the orthosis, interpolated where the strap is in its gap, shape (n,) [rad].

    `ahead` is this angle by the strap's model, and `against` the strap's torque, both of shape (n,).
    """
    reach = max(1, round(REVERSAL_MARGIN_S * fs))
    free = np.convolve(np.abs(against) <= GAP_TORQUE_SHARE * np.std(against), np.ones(2 * reach + 1), "same") > 0.5
    on_flank = np.flatnonzero(~free)
    if not free.any() or len(on_flank) < 2:
        return ahead
    at = np.clip(np.arange(len(ahead)), on_flank[0], on_flank[-1])
    return np.where(free, PchipInterpolator(on_flank, ahead[on_flank])(at), ahead)
