"""Identify a robot of several joints from arrays, and say what published friction would predict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import IdentificationError, RecordingError
from ...models.kinematic_tree import BODY_QUANTITIES, Tree
from ...models.robot import Robot
from ...numerics.motion import Filtering
from ...numerics.sampled import sampled
from ..tree_motion import TreeMotion, tree_motion_of
from .fit_tree import identify_tree
from .tree_estimate import TreeEstimate
from .tree_families import FURTHER_MOTOR_TERMS, FURTHER_TERMS
from .tree_regression import TreeModel


def published_parameters(model: TreeModel, published: Mapping[str, Mapping[str, float]]) -> np.ndarray | None:
    """Return the model's parameters, (p,), from `published` values by joint and name, and the stated links.

    Returns None if dry or viscous friction of any joint is missing.
    """
    base, robot = model.base, model.robot
    said = {f"{joint}.{name}": value for joint, table in published.items() for name, value in table.items()}
    if any(f"{joint}.{name}" not in said for joint in robot.names for name in ("coulomb", "viscous")):
        return None
    bodies = len(BODY_QUANTITIES) * len(robot.tree.order)
    numbers = [*robot.tree.parameters, *(said.get(name, 0.0) for name in base.members[bodies:])]
    return np.concatenate([base.combination @ numbers, [said.get(n, 0.0) for n in model.names[len(base.names) :]]])


SETTLING_PERIODS = 2.0
"""Samples within this many periods of the low-pass's cut-off are dropped at either border by default."""


def fit_robot(
    robot: Robot | Tree,
    recordings: Sequence[Mapping[str, ArrayLike]] | Mapping[str, ArrayLike],
    *,
    lowpass: float | None,
    order: int = 4,
    decimate: int = 1,
    dead_band: float | Sequence[float] = 0.0,
    trim: int | None = None,
    velocity_width: float = 0.0,
    plain: bool = False,
) -> TreeEstimate:
    """Identify base inertial parameters and friction of a robot from its motion and efforts.

    Weighted least squares on filtered data over the base parameters. Friction terms beyond Coulomb and viscous friction
    are chosen within the given recordings, by segments left out in turn.

    Parameters
    ----------
    robot : Robot or Tree
        Kinematics and stated bodies, for instance of `pellucid.read_robot`.
    recordings : sequence of mapping, or one mapping
        For each recording ``time``, shape (n,), evenly sampled [s], ``position``, (n, m) [rad or m], and ``effort``,
        (n, m) [N m or N], in the order of the robot's moving joints; optionally ``velocity``, (n, m).
    lowpass : float or None
        Cut-off of the zero-phase low-pass on both sides [Hz]; None if the arrays are smooth already.
    order : int
        Order of one pass of the filter.
    decimate : int
        Decimation factor after filtering.
    dead_band : float or sequence of float
        Speed below which samples are excluded, for all joints or each [rad/s or m/s].
    trim : int, optional
        Samples dropped at either border; two periods of `lowpass` by default.
    velocity_width : float
        Width of the smooth sign of velocity in friction [rad/s or m/s]; 0 for the true sign.
    plain : bool
        Whether friction is Coulomb and viscous only, without a choice of further terms.

    Returns
    -------
    TreeEstimate
        Parameters by name, such as ``fit["joint_2.coulomb"]``, with intervals and covariance.

    Raises
    ------
    RecordingError
        If an array is missing, shapes do not fit the robot, or a sample is missing.
    IdentificationError
        If a joint never moves.

    Examples
    --------
    >>> robot = pl.read_robot("arm.urdf")                                             # doctest: +SKIP
    >>> fit = pl.fit_robot(robot, {"time": t, "position": q, "effort": u}, lowpass=10.0)    # doctest: +SKIP
    >>> fit.to_frame()                                                               # doctest: +SKIP
    """
    whole = robot if isinstance(robot, Robot) else Robot(robot)
    if isinstance(recordings, Mapping):
        recordings = [recordings]
    if not recordings:
        raise IdentificationError("fit_robot: found no recording, expected one or more")
    motions = [
        _motion(whole, each, f"recording {i + 1}", lowpass, order, decimate, dead_band, trim)
        for i, each in enumerate(recordings)
    ]
    terms = () if plain else FURTHER_TERMS + FURTHER_MOTOR_TERMS
    found = identify_tree(whole, motions, width=velocity_width, leave_out=False, terms=terms, ripple=False)
    return found.base if plain else found.best


def _motion(robot: Robot, arrays, name: str, lowpass, order, decimate, dead_band, trim) -> TreeMotion:
    """Check the arrays of one recording and turn them into a filtered motion."""
    missing = [key for key in ("time", "position", "effort") if key not in arrays]
    if missing:
        raise RecordingError(
            f"fit_robot, {name}: found {', '.join(map(str, arrays))}, expected {', '.join(missing)} too"
        )
    (time,) = sampled(f"fit_robot, {name}", arrays["time"], least=3)
    wanted = (len(time), len(robot.names))
    found = {key: np.asarray(arrays[key], float) for key in ("position", "effort", "velocity") if key in arrays}
    for key, values in found.items():
        if values.shape != wanted:
            raise RecordingError(
                f"fit_robot, {name}, {key}: found shape {values.shape}, expected {wanted}: one column for each of "
                f"{', '.join(robot.names)}"
            )
        if not np.isfinite(values).all():
            raise RecordingError(f"fit_robot, {name}, {key}: found missing samples (NaN), expected none")
    fs = (len(time) - 1) / float(time[-1] - time[0])
    if lowpass is not None and not 0.0 < lowpass < 0.5 * fs:
        raise IdentificationError(
            f"fit_robot: lowpass: found {lowpass:g} Hz, expected above 0 and below {fs / 2:g} Hz, half the rate"
        )
    settling = 0 if lowpass is None else int(np.ceil(SETTLING_PERIODS * fs / lowpass))
    filtering = Filtering(lowpass, order, decimate, 0.0, settling if trim is None else trim)
    return tree_motion_of(
        time, found["position"], found["effort"], filtering, velocity=found.get("velocity"), dead_band=dead_band,
        turns=robot.turns_array, recording=name,
    )  # fmt: skip
