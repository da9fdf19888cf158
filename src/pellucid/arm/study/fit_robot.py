"""Identify a robot of several joints from arrays; predict, simulate and score with what was identified."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ... import _core
from ..._errors import ArgumentError, IdentificationError, PellucidError, RecordingError
from ...files.defects.magnitude import find_implausible, has_constant_speeds
from ...files.recording import Channel
from ...models.causes import Cause
from ...models.joint import PARALLEL_STIFFNESS
from ...models.kinematic_tree import Tree
from ...models.robot import Robot
from ...models.simulate import substeps_for
from ...numerics.arguments import (
    held_out_names,
    held_out_share,
    is_table,
    number,
    real_array,
    shown,
    table_columns,
    whole_number,
    with_checked_arguments,
)
from ...numerics.motion import Filtering, settling_samples, shortest
from ...numerics.sampled import sampled
from ...study.answer import AnswerPart
from ...study.cause_words import cause_sentence
from ...units import to_si_factor
from ..fit.fit_tree import heldout_errors, identify_tree
from ..fit.inertia_prior import fit_consistent
from ..fit.tree_estimate import TreeEstimate
from ..fit.tree_families import FURTHER_MOTOR_TERMS, FURTHER_TERMS
from ..fit.tree_regression import TreeModel
from ..tree_motion import TreeMotion, tree_motion_of
from ..urdf import read_robot
from .joint_answers import answer_joints
from .recorded_tree import SIGN_THRESHOLDS, friction_power_shares

COLUMNS = ("position", "effort", "velocity")
"""Columns of a recording other than time."""


@dataclass(frozen=True, eq=False)
class RobotTrace:
    """Simulated motion of a robot.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Time [s].
    position, velocity : ndarray, shape (n, m)
        Motion of each joint [rad or m, and per second].
    """

    time: np.ndarray
    position: np.ndarray
    velocity: np.ndarray


@dataclass(frozen=True, eq=False)
class RobotScore:
    """How well a robot's model predicts the efforts of recordings that were not fitted.

    Attributes
    ----------
    errors : mapping of str to float
        RMS error of each joint, divided by its RMS effort, over the rows in which it moves [%].
    r2 : mapping of str to float
        Coefficient of determination of each joint.
    """

    errors: Mapping[str, float]
    r2: Mapping[str, float]

    @property
    def mean_error(self) -> float:
        """Mean of the joints' errors [%]."""
        return float(np.mean(list(self.errors.values())))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class RobotFit(TreeEstimate):
    """A robot identified from arrays.

    Attributes
    ----------
    filtering : Filtering
        Filtering and decimation of both sides.
    dead_band : tuple of float
        Speed of each joint below which samples are excluded [rad/s or m/s].
    units : mapping of str to str
        Units of the arrays that are not in SI.

    effort_lowpass : float, optional
        Cut-off of the low-pass on effort, where it is another than the motion's [Hz].
    consistent : TreeEstimate, optional
        The same model with physically consistent bodies, near the stated ones where the efforts tell little; None if
        there are none, with the reason among the notes. `simulate` takes these bodies.
    heldout : RobotScore, optional
        Errors on the held-out recordings; None without one.
    answers : tuple of AnswerPart
        Whether the model predicts each joint: "yes", "no" or "cannot say", with the reason.
    causes : tuple of Cause
        Causes of what the model misses at each joint, such as a parallel spring, the one that explains most first.
        Each has ``joint``, ``name``, ``size``, ``unit`` and ``share``. A spring is a term too, unless `plain`.

    The other attributes are those of `TreeEstimate`.
    """

    filtering: Filtering
    dead_band: tuple[float, ...]
    units: Mapping[str, str] = field(default_factory=dict)
    effort_lowpass: float | None = None
    consistent: TreeEstimate | None = None
    heldout: RobotScore | None = None
    answers: tuple[AnswerPart, ...] = ()
    causes: tuple[Cause, ...] = ()

    def _facts(self) -> tuple[str, ...]:
        return (*map(cause_sentence, self.causes), *super()._facts())

    @property
    def heldout_effort_error(self) -> float:
        """Mean of the joints' errors on the held-out recordings [%]; NaN without one."""
        return float("nan") if self.heldout is None else self.heldout.mean_error

    @property
    def heldout_r2(self) -> float:
        """Mean of the joints' coefficients of determination on the held-out recordings; NaN without one."""
        return float("nan") if self.heldout is None else float(np.mean(list(self.heldout.r2.values())))

    def predict(self, time: ArrayLike, position: ArrayLike, velocity: ArrayLike | None = None) -> np.ndarray:
        """Predict the efforts of a motion, filtered as the fitted efforts were.

        Parameters
        ----------
        time : array_like, shape (n,)
            Evenly sampled time [s].
        position : array_like, shape (n, m)
            Position of each joint [rad or m].
        velocity : array_like, shape (n, m), optional
            Recorded velocity [rad/s or m/s]; by default that of the position.

        Returns
        -------
        ndarray, shape (n, m)
            Effort of each joint's motor, at the joint [N m or N].

        Raises
        ------
        ArgumentError
            If an argument is no array of real numbers.
        RecordingError
            If the arrays do not fit the robot or each other, or a number is missing.
        """
        position = real_array("predict", "position", position)
        given = {"time": time, "position": position, "effort": np.zeros(position.shape)}
        given |= {} if velocity is None else {"velocity": velocity}
        columns = _columns_of(self.robot, given, "predict", {})
        whole = Filtering(self.filtering.lowpass, self.filtering.order)
        made = self.effort(_motion_of(self.robot, columns, "predict", whole, self.dead_band))
        return np.linalg.solve(self.robot.turns_array.T, made.T).T if self.robot.shared else made

    def simulate(
        self, time: ArrayLike, effort: ArrayLike, position: ArrayLike | None = None, velocity: ArrayLike | None = None
    ) -> RobotTrace:
        """Simulate the motion that efforts cause, with true stiction and without drive ripple.

        The bodies are those of `consistent`, if there are any.

        Parameters
        ----------
        time : array_like, shape (n,)
            Evenly sampled time [s].
        effort : array_like, shape (n, m)
            Effort of each joint's motor, at the joint [N m or N]; each sample is held until the next one.
        position : array_like, shape (m,), optional
            Position at the first sample [rad or m]; 0 by default.
        velocity : array_like, shape (m,), optional
            Velocity at the first sample [rad/s or m/s]; 0 by default.

        Returns
        -------
        RobotTrace
            Position and velocity of each joint, each of shape (n, m).

        Raises
        ------
        ArgumentError
            If an argument is no array of real numbers.
        RecordingError
            If the arrays do not fit the robot or each other, or a number is missing.
        IdentificationError
            If the estimate is no possible body, or the simulated robot diverges.
        """
        (clock,) = sampled("simulate", time)
        drive = _samples_of_joints(self.robot, "simulate", "effort", effort, len(clock))
        m = len(self.robot.names)
        start = {}
        for name, each in (("position", position), ("velocity", velocity)):
            start[name] = np.zeros(m) if each is None else real_array("simulate", name, each)
            if start[name].shape != (m,) or not np.isfinite(start[name]).all():
                raise RecordingError(
                    f"simulate: {name}: found shape {start[name].shape}, expected ({m},) finite numbers: one for each "
                    f"of {', '.join(self.robot.names)}"
                )
        period = float(clock[-1] - clock[0]) / (len(clock) - 1)
        turns, model = self.robot.turns_array, self.consistent or self
        masses = _core.KinematicTree(model.links(), np.array(self.robot.tree.gravity, float)).mass_matrix(
            start["position"][None]
        )
        if not np.linalg.eigvalsh(masses[0]).min() > 0.0:
            raise IdentificationError(
                "simulate: found a mass matrix with a negative eigenvalue, which no robot has; expected the identified "
                "parameters to describe possible bodies: identify with motions that move each joint more"
            )
        plant = _core.DrivenTree(
            model.links(), np.array(self.robot.tree.gravity, float), model.joints(), period=period,
            substeps=substeps_for(period), turns=turns if self.robot.shared else None, motors=model.motors(),
        )  # fmt: skip
        plant.reset(start["position"], start["velocity"])
        made, speed = _run_with_springs(plant, drive, self)
        if not np.isfinite(made).all():
            raise IdentificationError(
                "simulate: effort: found one at which the simulated robot diverges, expected a bounded motion: check "
                "the signs and units of the efforts and the start"
            )
        return RobotTrace(clock, made, speed)

    def score(self, recordings: Sequence[Mapping[str, ArrayLike]] | Mapping[str, ArrayLike]) -> RobotScore:
        """Compare the predicted with the measured efforts of recordings that were not fitted.

        Parameters
        ----------
        recordings : sequence of mapping, or one mapping
            Recordings as `fit_robot` takes them.

        Returns
        -------
        RobotScore
            Error [%] and R2 of each joint.

        Raises
        ------
        ArgumentError
            If an argument has a wrong type.
        RecordingError
            If an array is missing, shapes do not fit the robot, or a sample is missing.
        IdentificationError
            If a joint never moves.
        """
        motions = [
            _motion_of(
                self.robot, _columns_of(self.robot, each, f"score, {name}", self.units), name, self.filtering,
                self.dead_band, use="validate", effort_lowpass=self.effort_lowpass,
            )
            for name, each in _recordings_of("score", recordings)
        ]  # fmt: skip
        return score_motions(self, motions)


def _run_with_springs(
    plant: _core.DrivenTree, drive: np.ndarray, estimate: TreeEstimate
) -> tuple[np.ndarray, np.ndarray]:
    """Return position and velocity, (n, m) each, of a robot under the efforts `drive`, (n, m), and its springs.

    The plant has no springs. Their effort is held over each sample, as the efforts of the motors are.
    """
    each = range(len(estimate.robot.names))
    stiffness = np.array([estimate.joint_numbers(k).get(PARALLEL_STIFFNESS, 0.0) for k in each])
    if not stiffness.any():
        return plant.run(drive)
    of_motors = np.linalg.solve(estimate.robot.turns_array.T, np.diag(stiffness))
    rows = [plant.run((effort - of_motors @ plant.position)[None]) for effort in drive]
    position, velocity = zip(*rows, strict=True)
    return np.concatenate(position), np.concatenate(velocity)


def score_motions(estimate: TreeEstimate, motions: Sequence[TreeMotion]) -> RobotScore:
    """Return the errors of an estimate on motions that were not fitted."""
    errors, r2 = heldout_errors(estimate, motions), {}
    predicted = [estimate.effort(motion) for motion in motions]
    for k, name in enumerate(estimate.robot.names):
        effort = np.concatenate([m.effort[m.moving[:, k], k] for m in motions])
        model = np.concatenate([each[m.moving[:, k], k] for m, each in zip(motions, predicted, strict=True)])
        spread = float(np.sum((effort - effort.mean()) ** 2))
        r2[name] = 1.0 - float(np.sum((effort - model) ** 2)) / spread if spread > 0.0 else float("nan")
    return RobotScore(dict(zip(estimate.robot.names, errors.tolist(), strict=True)), r2)


@with_checked_arguments
def fit_robot(
    robot: Robot | Tree | str | os.PathLike,
    recordings: Sequence[Mapping[str, ArrayLike]] | Mapping[str, ArrayLike] | Mapping[str, Mapping[str, ArrayLike]],
    *,
    lowpass: float | str | None,
    order: int = 4,
    decimate: int = 1,
    dead_band: float | str | Sequence[float] = 0.0,
    trim: int | None = None,
    velocity_width: float = 0.0,
    plain: bool = False,
    units: Mapping[str, str] | None = None,
    held_out: Any = None,
) -> RobotFit:
    """Identify base inertial parameters and friction of a robot from its motion and efforts.

    Weighted least squares on filtered data over the base parameters. Cross-validation over segments of the fitted
    recordings chooses friction terms beyond Coulomb and viscous friction. `RobotFit.consistent` has physically
    consistent bodies, close to those of `robot` where the efforts carry little information.

    Parameters
    ----------
    robot : Robot, Tree, or path-like
        Kinematics and stated bodies, for instance of `pellucid.read_robot`; or the path of a URDF file.
    recordings : sequence of mapping, one mapping, or a mapping of them by name
        For each recording ``time``, shape (n,), evenly sampled [s] or dates, ``position``, (n, m) [rad or m], and
        ``effort``, (n, m) [N m or N], in the order of the robot's moving joints; optionally ``velocity``, (n, m).
        A data frame has a column for each joint, such as ``position.elbow``.
    lowpass : float, str or None
        Cut-off of the zero-phase low-pass on both sides [Hz], or a text such as "10 Hz"; None if the arrays are smooth
        already.
    order : int
        Order of one pass of the filter.
    decimate : int
        Decimation factor after filtering.
    dead_band : float, str or sequence of float
        Speed below which samples are excluded, for all joints or each [rad/s or m/s].
    trim : int, optional
        Samples dropped at either border; two periods of `lowpass` by default.
    velocity_width : float
        Width of the smooth sign of velocity in friction [rad/s or m/s]; 0 for the true sign.
    plain : bool
        Whether friction is Coulomb and viscous only, without a choice of further terms.
    units : mapping of str to str, optional
        Units of the arrays that are not in SI, such as ``{"position": "deg", "effort": "mN*m"}``.
    held_out : float, int, str, sequence of int or str, or one or several recordings, optional
        What is not fitted and tests the model: the numbers or names of recordings, further recordings, or a share
        between 0 and 1. A share holds out the last recordings, or the last samples of a single one.

    Returns
    -------
    RobotFit
        Parameters by name, such as ``fit["joint_2.coulomb"]``, with intervals and covariance, the held-out error, a
        verdict on each joint, consistent bodies, `predict`, `simulate` and `score`.

    Raises
    ------
    ArgumentError
        If an argument has a wrong type or unit.
    RecordingError
        If an array is missing, shapes do not fit the robot, or a sample is missing.
    IdentificationError
        If a joint never moves, or its effort has the opposite sign.

    References
    ----------
    .. [1] M. Gautier, "Numerical calculation of the base inertial parameters of robots", J. Robotic Systems 8, 1991.
    .. [2] P. M. Wensing, S. Kim, J.-J. E. Slotine, "Linear matrix inequalities for physically consistent inertial
       parameter identification", IEEE Robot. Autom. Lett. 3, 2018.

    Examples
    --------
    >>> recording = {"time": t, "position": q, "effort": u}                          # doctest: +SKIP
    >>> fit = pl.fit_robot("arm.urdf", recording, lowpass="10 Hz", held_out=0.25)    # doctest: +SKIP
    >>> fit.heldout_effort_error, [str(each) for each in fit.answers]                # doctest: +SKIP
    >>> fit.consistent["link_2.mass"].value                                          # doctest: +SKIP
    >>> fit.score({"time": t2, "position": q2, "effort": u2}).errors                  # doctest: +SKIP
    """
    where = "fit_robot"
    whole = _robot_of(robot)
    factors = _units_of(where, whole, units)
    cutoff = None if lowpass is None else number(where, "lowpass", lowpass, unit="Hz")
    order, decimate = whole_number(where, "order", order, 1, 12), whole_number(where, "decimate", decimate, 1)
    slow = _dead_bands(where, whole, dead_band)
    width = number(where, "velocity_width", velocity_width)
    if width < 0.0:
        raise IdentificationError(f"{where}: velocity_width: found {width:g}, expected 0 or more")
    if not isinstance(plain, (bool, np.bool_)):
        raise ArgumentError(f"{where}: plain: found {shown(plain)}, expected True or False")
    trimmed = None if trim is None else whole_number(where, "trim", trim, 0)
    motions, filtering = [], None
    for name, each, use in _with_held_out(where, _recordings_of(where, recordings), held_out):
        columns = _columns_of(whole, each, f"{where}, {name}", factors)
        if "position" not in factors:
            _require_plausible(whole, columns, f"{where}, {name}")
        filtering = filtering or _filtering_of(where, columns["time"], cutoff, order, decimate, trimmed)
        least = shortest(filtering)
        if len(columns["time"]) < least:
            raise RecordingError(
                f"{where}, {name}: time: found {len(columns['time'])} samples, expected at least {least}"
            )
        motions.append(_motion_of(whole, columns, name, filtering, slow, use))
    assert filtering is not None
    judged = [motion for motion in motions if motion.use == "validate"]
    motions = [motion for motion in motions if motion.use == "fit"]
    notes = _require_signs(where, whole, motions)
    terms = () if plain else FURTHER_TERMS + FURTHER_MOTOR_TERMS
    found = identify_tree(whole, motions, width=width, leave_out=False, terms=terms, ripple=False)
    chosen = found.base if plain else found.best
    consistent = None
    try:
        model = TreeModel(whole, found.rows.base, chosen.families, None if plain else found.choice.speeds)
        consistent, _ = fit_consistent(model, found.rows)
    except IdentificationError as error:
        notes = (*notes, f"no consistent bodies: {error}")
    heldout = score_motions(chosen, judged) if judged else None
    moving = np.concatenate([motion.moving for motion in motions]).mean(axis=0)
    errors = None if heldout is None else list(heldout.errors.values())
    own = {each.name: getattr(chosen, each.name) for each in fields(chosen)}
    own["notes"] = (*chosen.notes, *notes)
    return RobotFit(
        **own, filtering=filtering, dead_band=slow, units=dict(units or {}), consistent=consistent, heldout=heldout,
        answers=answer_joints(whole.names, errors, "held-out recordings", moving.tolist()), causes=found.causes,
    )  # fmt: skip


def _robot_of(robot: Any) -> Robot:
    if isinstance(robot, Robot):
        return robot
    if isinstance(robot, Tree):
        return Robot(robot)
    if isinstance(robot, (str, os.PathLike)):
        return read_robot(robot)
    raise ArgumentError(f"fit_robot: robot: found {shown(robot)}, expected a Robot, a Tree, or the path of a URDF file")


def _recordings_of(where: str, recordings: Any) -> list[tuple[str, Any]]:
    """Return each recording with its name."""
    if isinstance(recordings, Mapping) and recordings and all(map(is_table, recordings.values())):
        return [(str(name), each) for name, each in recordings.items()]
    if is_table(recordings):
        return [("recording 1", recordings)]
    if not isinstance(recordings, (list, tuple)):
        raise ArgumentError(
            f"{where}: recordings: found {shown(recordings)}, expected mappings with time, position and effort"
        )
    if not recordings:
        raise IdentificationError(f"{where}: found no recording, expected one or more")
    for each in recordings:
        if not is_table(each):
            raise ArgumentError(
                f"{where}: recordings: found {shown(each)}, expected mappings with time, position and effort"
            )
    return [(f"recording {i + 1}", each) for i, each in enumerate(recordings)]


def _with_held_out(where: str, given: list[tuple[str, Any]], held_out: Any) -> list[tuple[str, Any, str]]:
    """Return recordings with their names and uses, "fit" or "validate"."""
    fitted = [(name, each, "fit") for name, each in given]
    if held_out is None:
        return fitted
    if is_table(held_out) or _are_tables(held_out):
        further = _recordings_of(where, held_out)
        return fitted + [(f"held-out {name}", each, "validate") for name, each in further]
    share = held_out_share(where, held_out)
    if share is not None and len(given) == 1:
        return _split_recording(where, *given[0], share)
    judged = held_out_names(where, [name for name, _ in given], held_out)
    return [(name, each, "validate" if name in judged else "fit") for name, each in given]


def _are_tables(value: Any) -> bool:
    """Return whether a value holds recordings, in a sequence or by name."""
    each = list(value.values()) if isinstance(value, Mapping) else value
    return isinstance(each, (list, tuple)) and bool(each) and all(map(is_table, each))


def _split_recording(where: str, name: str, table: Any, share: float) -> list[tuple[str, Any, str]]:
    """Return the first samples of a recording, which are fitted, and the last `share` of them."""
    columns = {column: table[column] for column in table_columns(table)}
    count = len(real_array(where, "time", columns["time"])) if "time" in columns else 0
    first = count - round(share * count)
    parts = ((name, slice(0, first), "fit"), (f"{name}, held out", slice(first, count), "validate"))
    return [(part, {n: np.asarray(x)[rows] for n, x in columns.items()}, use) for part, rows, use in parts]


def _columns_of(robot: Robot, table: Any, where: str, units: Mapping[str, str]) -> dict[str, np.ndarray]:
    """Return the columns of a recording in SI: ``time``, (n,), and the others, (n, m)."""
    present, names = table_columns(table), robot.names
    of_joints = {key: [f"{key}.{name}" for name in names] for key in COLUMNS}
    taken = {key: table[key] for key in ("time", *COLUMNS) if key in present}
    for key, columns in of_joints.items():
        if key not in taken and all(column in present for column in columns):
            taken[key] = np.column_stack([real_array(where, column, table[column]) for column in columns])
    missing = [key for key in ("time", "position", "effort") if key not in taken]
    if missing:
        raise RecordingError(f"{where}: found {', '.join(present) or 'nothing'}, expected {', '.join(missing)} too")
    factors = {key: to_si_factor(unit, None)[0] for key, unit in units.items()}
    clock = real_array(where, "time", taken["time"])
    (time,) = sampled(where, factors.get("time", 1.0) * clock, least=3)
    of_all = {
        key: factors.get(key, 1.0) * _samples_of_joints(robot, where, key, taken[key], len(time))
        for key in COLUMNS
        if key in taken
    }
    return {"time": time, **of_all}


def _samples_of_joints(robot: Robot, where: str, name: str, values: Any, count: int) -> np.ndarray:
    """Return samples of all joints, (n, m); those of a single joint may be (n,)."""
    samples = real_array(where, name, values)
    wanted = (count, len(robot.names))
    if samples.ndim == 1 and wanted[1] == 1:
        samples = samples[:, None]
    if samples.shape != wanted:
        raise RecordingError(
            f"{where}, {name}: found shape {samples.shape}, expected {wanted}: one column for each of "
            f"{', '.join(robot.names)}"
        )
    if not np.isfinite(samples).all():
        raise RecordingError(f"{where}, {name}: found missing samples (NaN), expected none")
    return samples


def _motion_of(
    robot: Robot, columns: Mapping[str, np.ndarray], name: str, filtering: Filtering, dead_band: Sequence[float],
    use: Any = "fit", effort_lowpass: float | None = None,
) -> TreeMotion:  # fmt: skip
    return tree_motion_of(
        columns["time"], columns["position"], columns["effort"], filtering,
        velocity=columns.get("velocity"), dead_band=dead_band, turns=robot.turns_array, recording=name, use=use,
        effort_lowpass=effort_lowpass,
    )  # fmt: skip


def _filtering_of(
    where: str, time: np.ndarray, cutoff: float | None, order: int, decimate: int, trim: int | None
) -> Filtering:
    fs = (len(time) - 1) / float(time[-1] - time[0])
    if cutoff is not None and not 0.0 < cutoff < 0.5 * fs:
        raise IdentificationError(
            f"{where}: lowpass: found {cutoff:g} Hz, expected above 0 and below {fs / 2:g} Hz, half the rate"
        )
    settling = 0 if cutoff is None else settling_samples(cutoff, fs)
    return Filtering(cutoff, order, decimate, 0.0, settling if trim is None else trim)


def _dead_bands(where: str, robot: Robot, dead_band: Any) -> tuple[float, ...]:
    """Return the dead band of each joint."""
    count = len(robot.names)
    if isinstance(dead_band, (list, tuple, np.ndarray)) and np.ndim(dead_band):
        if len(dead_band) != count:
            raise ArgumentError(f"{where}: dead_band: found {len(dead_band)} numbers, expected 1 or {count}")
        each = list(dead_band)
    else:
        each = [dead_band] * count
    made = tuple(
        number(where, "dead_band", x, unit=f"{unit}/s") for x, (unit, _) in zip(each, robot.units, strict=True)
    )
    if min(made) < 0.0:
        raise IdentificationError(f"{where}: dead_band: found {min(made):g}, expected 0 or more")
    return made


def _units_of(where: str, robot: Robot, units: Any) -> dict[str, str]:
    """Return the stated units of columns, each a unit of all joints."""
    if units is None:
        return {}
    if not isinstance(units, Mapping):
        raise ArgumentError(f'{where}: units: found {shown(units)}, expected a mapping such as {{"position": "deg"}}')
    si = {
        "time": {"s"},
        "position": {unit for unit, _ in robot.units},
        "velocity": {f"{unit}/s" for unit, _ in robot.units},
        "effort": {effort for _, effort in robot.units},
    }
    for name, unit in units.items():
        if name not in si:
            raise ArgumentError(f"{where}: units: found {shown(name)}, expected any of {', '.join(si)}")
        if not isinstance(unit, str):
            raise ArgumentError(f"{where}: units: {name}: found {shown(unit)}, expected a unit")
        for expected in si[name]:
            try:
                to_si_factor(unit, expected, "")
            except PellucidError as error:
                raise ArgumentError(f"{where}: units: {name}: {error}") from None
    return dict(units)


def _require_plausible(robot: Robot, columns: Mapping[str, np.ndarray], where: str) -> None:
    """Refuse positions that no joint has, such as degrees taken for radians."""
    for k, (name, (unit, _)) in enumerate(zip(robot.names, robot.units, strict=True)):
        samples = columns["position"][:, k]
        wrong = find_implausible(Channel("position", samples, unit, k))
        if wrong is None or has_constant_speeds(columns["time"], samples):
            continue
        looks = f", which looks like {wrong.probable_unit} taken for {unit}" if wrong.probable_unit else ""
        raise RecordingError(
            f"{where}, position: found a magnitude of {wrong.largest:.4g} {unit} of joint {name}{looks}, expected at "
            f'most {wrong.limit:.4g} {unit}; state units={{"position": ...}} if it moves that far or has another unit'
        )


def _require_signs(where: str, robot: Robot, motions: Sequence[TreeMotion]) -> tuple[str, ...]:
    """Refuse efforts of the opposite sign, and return notes on those that may have it."""
    shares = friction_power_shares(robot, motions)
    notes = []
    for name, share in zip(robot.names, shares, strict=True):
        found = f"friction of joint {name} that delivers energy, {-100 * share:.2g} % of its effort times its speed"
        if share < -SIGN_THRESHOLDS.sensor_power_threshold:
            raise IdentificationError(
                f"{where}: effort: found {found}: the effort has the opposite sign of the position, expected "
                "a positive effort to drive the joint in the positive direction"
            )
        if share < -SIGN_THRESHOLDS.motor_power_threshold:
            notes.append(f"found {found}: if a motor gives the effort, its sign is wrong")
    return tuple(notes)
