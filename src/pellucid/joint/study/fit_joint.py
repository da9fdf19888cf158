"""Identify a joint from arrays, as `pellucid identify` does from files.

The arrays become a study in memory. One code then decides on defects, clocks, delay, friction family, estimator,
held-out error and verdicts of both.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ..._errors import ArgumentError, IdentificationError, PellucidError, RecordingError
from ..._processes import with_one_blas_thread
from ...models.card import ModelCard
from ...models.causes import Cause
from ...models.estimates import Verdict
from ...models.joint import DEFAULT_FAMILIES, FAMILIES, SYMBOLS_BY_NAME, UNITS
from ...numerics.arguments import choice, number, shown, whole_number, with_checked_arguments
from ...numerics.motion import Filtering, settling_samples, shortest
from ...study.array_study import ArrayStudy, array_study, parse_tables
from ...study.procedures.procedure import take_recordings
from ...study.quality import require_sound
from ...study.study_file import RecordingEntry, StudyFile
from ...units import si_text, to_si_factor
from ..domain import PROCEDURE_ENTRIES
from ..fit.friction_family import FamilyFit
from ..fit.headline_choice import HeadlineChoice
from ..fit.joint_estimate import JointEstimate
from ..fit.replay import Prediction, pool_errors, predict
from .aligned_motions import Alignment, aligned_motions, find_alignments
from .array_recordings import ArrayRecording, collect_recordings, hold_out
from .joint_faults import ReversedSignError
from .procedure import solve
from .solve_joint import SolvedJoint

if TYPE_CHECKING:
    from .joint_result import JointResult

EFFORT_UNITS = {"rotary": "N*m", "prismatic": "N"}
"""SI unit of the effort of each kind of joint."""

EFFORT_CHANNELS = {"N*m": ("torque", "torque"), "N": ("torque", "force"), "A": ("current", "current"),
                   "V": ("voltage", "voltage")}  # fmt: skip
"""Kind of drive and name of its channel, by the SI unit of the effort."""

ALL_FAMILIES = "auto"
"""Value of `friction` with which all friction families are compared that a study compares."""


@dataclass(frozen=True, eq=False, repr=False)
class JointScore:
    """How well a joint predicts the effort of recordings that were not fitted.

    Attributes
    ----------
    effort_error : float
        100 ||effort - model|| / ||effort|| over the scored samples [%].
    r2 : float
        Coefficient of determination.
    coverage : float
        Share of samples within the prediction band.
    predictions : tuple of Prediction
        Measured and predicted effort of each recording.
    """

    effort_error: float
    r2: float
    coverage: float
    predictions: tuple[Prediction, ...] = field(repr=False)

    def __repr__(self) -> str:
        return f"held-out effort error {self.effort_error:.3g} %, R2 {self.r2:.3f}, coverage {self.coverage:.2f}"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class JointFit(JointEstimate):
    """A joint identified from arrays: the chosen estimate, and the full report of `pellucid identify`.

    Attributes
    ----------
    study : ArrayStudy
        The recordings and the settings as a study in memory.
    choice : HeadlineChoice
        Chosen friction family and estimator, and why.
    families : mapping of str to FamilyFit
        Fit of each friction family that was compared, by its name.

    The other attributes are those of `JointEstimate`.
    """

    study: ArrayStudy = field(repr=False)
    choice: HeadlineChoice = field(repr=False)
    families: Mapping[str, FamilyFit] = field(repr=False)
    _report: Callable[[], JointResult] = field(repr=False)

    @cached_property
    def result(self) -> JointResult:
        """Result of `identify`: all families, tables and verdicts. It is computed when it is first read."""
        return self._report()

    @property
    def family(self) -> str:
        """Name of the chosen friction family."""
        return self.choice.family

    @property
    def headlined(self) -> FamilyFit:
        """Chosen family with the values of the chosen estimator."""
        return self.families[self.family].headline

    @property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts on the estimate and on the recordings, the worst first."""
        return tuple(self.result.verdicts)

    @property
    def causes(self) -> tuple[Cause, ...]:
        """Causes of what the model misses, or would miss without a term, the one that explains most first."""
        return self.result.causes

    @property
    def heldout_effort_error(self) -> float:
        """Error of the effort of the held-out recordings [%]; NaN without one."""
        return float(self.headlined.heldout_effort_error)

    @property
    def heldout_r2(self) -> float:
        """Coefficient of determination of the effort of the held-out recordings; NaN without one."""
        return float(self.headlined.heldout_r2)

    @property
    def delays(self) -> tuple[Alignment, ...]:
        """Estimated delays of the effort against the position, for all recordings or for one."""
        return find_alignments(self.study)

    @property
    def delay(self) -> float:
        """Time by which the effort of all recordings was late, and was shifted [s]; 0 if it was not."""
        return next((float(each.moved) for each in self.delays if not each.recording), 0.0)

    def score(
        self, time: Any, position: ArrayLike | None = None, effort: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
    ) -> JointScore:  # fmt: skip
        """Compare the predicted with the measured effort of recordings that were not fitted.

        The recordings are checked, aligned and filtered as the fitted ones were, so that the error is that of a
        recording that was held out from the start.

        Parameters
        ----------
        time : array_like, shape (n,), or sequence of array_like, or one or several tables
            Time [s]; or tables, as `fit_joint` takes them.
        position : array_like, shape (n,), or sequence of array_like, optional
            Position [rad or m, or the unit of the fit].
        effort : array_like, shape (n,), or sequence of array_like, optional
            Effort, in the unit of the fit.
        velocity : array_like, shape (n,), or sequence of array_like, optional
            Recorded velocity, if the fit used one.

        Returns
        -------
        JointScore
            Error of the effort [%], R2, coverage, and the predictions.

        Raises
        ------
        ArgumentError
            If an argument has a wrong type.
        RecordingError
            If a recording is not fit to be used.
        """
        config = self.study.config
        units = {str(spec.column): spec.unit for spec in config.channels.values()}
        given = collect_recordings("score", time, position, effort, velocity, units=units, stem="scored")
        for each in given:
            if "velocity" in config.channels and "velocity" not in each.columns:
                raise RecordingError(f"score: {each.name}: found no velocity, expected one as in the fitted recordings")
        entries = tuple(
            RecordingEntry.model_validate({"name": each.name, "file": each.name, "use": "validate"}) for each in given
        )
        arrays = {each.name: _read_columns(each, config) for each in given}
        half_width = self.headlined.predictions[0].half_width
        try:
            scored = array_study(config.model_copy(update={"recordings": entries}), arrays, "score")
            scored.found["alignments"] = tuple(each for each in self.delays if not each.recording)
            for recording in scored.recordings():
                require_sound(recording, scored)
            motions = [self.choice.direction.apply(m) for m in aligned_motions(scored)]
            made = predict(self.model, self.array, motions, half_width)
        except PellucidError as error:
            raise _of_arrays("score", config, error) from None
        if not made:
            raise RecordingError("score: found no sample that moves and is long enough, expected a longer recording")
        effort_error, r2 = pool_errors(made, "heldout")
        weights = [len(each.effort) for each in made]
        return JointScore(effort_error, r2, float(np.average([each.coverage for each in made], weights=weights)), made)

    def card(self, name: str = "joint", lifts: str = "") -> ModelCard:
        """Return the model card that `pellucid export` and `pellucid.controller` read.

        Parameters
        ----------
        name : str
            Name on the card instead of a study's name.
        lifts : str
            Effect of positive motion, in words.

        Returns
        -------
        ModelCard
        """
        held = self.heldout_effort_error
        return replace(super().card(name, lifts), heldout_effort_error=held if np.isfinite(held) else None)

    def _facts(self) -> tuple[str, ...]:
        held = () if np.isnan(self.heldout_effort_error) else (
            f"held-out effort error {self.heldout_effort_error:.3g} %, R2 {self.heldout_r2:.3f}",
        )  # fmt: skip
        told = tuple(f"{each.kind}: {each.said}" for each in self.verdicts if each.kind in ("wrong", "warning"))
        return (*super()._facts(), *held, *told)


@with_checked_arguments
@with_one_blas_thread
def fit_joint(
    time: Any,
    position: Any = None,
    effort: Any = None,
    velocity: Any = None,
    *,
    held_out: Any = None,
    friction: str | Sequence[str] = "symmetric",
    lowpass: float | str | None,
    order: int = 4,
    decimate: int = 1,
    resample: float | str | None = None,
    dead_band: float | str = 0.0,
    trim: int | None = None,
    delay: float | str | None = None,
    motion: str = "rotary",
    gravity: str | None = None,
    effort_unit: str | None = None,
    units: Mapping[str, str] | None = None,
    known: Mapping[str, float | str] | None = None,
    moving_mass: float | str | None = None,
    purpose: str = "torque",
    confidence: float = 0.95,
    thorough: bool = True,
) -> JointFit:
    r"""Identify a joint from recorded motions and the effort they took, as `pellucid identify` does from files.

    Filtered data are fitted with physical bounds,

    .. math::  \tau = J\ddot q + g_s\sin q + g_c\cos q + f(\dot q, \cdot) + \tau_0 ,

    with both sides passed through the same zero-phase low-pass. Standard errors allow for coloured residuals. Defects
    and missing samples are cut out, time stamps that jitter are smoothed, and the delay of the effort is corrected.
    The friction family and the estimator are chosen on blocks of the fitted recordings.

    Parameters
    ----------
    time : array_like, shape (n,), or sequence of array_like, or one or several tables
        Time [s], or dates. Several recordings are a sequence of arrays for each quantity. Instead of arrays, `time` may
        be a table with the columns ``time``, ``position``, ``effort`` and optionally ``velocity`` (a mapping, a data
        frame, a structured array), a sequence of tables, or a mapping of names to tables.
    position : array_like, shape (n,) or (n, 1), or sequence of array_like, optional
        Angle [rad], 0 where the joint hangs; or displacement [m].
    effort : array_like, shape (n,) or (n, 1), or sequence of array_like, optional
        Effort at the joint [N*m or N], or in the drive's own unit (see `effort_unit`); positive drives positive motion.
    velocity : array_like, shape (n,) or (n, 1), or sequence of array_like, optional
        Recorded velocity [rad/s or m/s], which takes the place of the derivative of the position.
    held_out : float, int, str, sequence of int or str, or one or several tables, optional
        Held-out recordings, which test the model and are never fitted. Further recordings are tables, or a tuple of the
        arrays (time, position, effort). Numbers from 0 or names select some of the given recordings. A share holds out
        the last recordings, or the last samples of a single recording.
    friction : str or sequence of str
        One friction family, several, or "auto" for those that a study compares. Families are "symmetric",
        "directional", "load", "stribeck" and "combined".
    lowpass : float or str or None
        Cut-off of the low-pass [Hz], or a text with its unit such as "10 Hz"; about five times the fastest motion. None
        if the arrays are smooth already.
    order : int
        Order of one pass of the filter.
    decimate : int
        Decimation factor after filtering. Samples 1 / (2 `lowpass`) apart lose nothing.
    resample : float or str, optional
        Uniform rate for interpolation before filtering [Hz], if the clock jitters.
    dead_band : float or str
        Speed below which samples are excluded [rad/s or m/s], because a sticking joint does not show its friction.
    trim : int, optional
        Number of samples dropped at either end; two periods of `lowpass` by default.
    delay : float or str, optional
        Delay of the effort behind `time` [s]; by default it is estimated, and corrected if it is certain.
    motion : {"rotary", "prismatic"}
        Kind of joint.
    gravity : {"sine", "sine+cosine", "none"}, optional
        Variation of gravity with position; by default "sine" for a rotary joint and "none" for a prismatic one.
    effort_unit : {"N*m", "N", "A", "V"}, optional
        Unit of `effort`; "N*m" or "N", by `motion`, by default. With "A" or "V" parameters are per ampere or per volt.
    units : mapping of str to str, optional
        Units of the arrays that are not in SI, such as ``{"position": "deg", "effort": "mN*m"}``.
    known : mapping of str to float or str, optional
        Parameters that are known beforehand, SI or with their unit, such as ``{"gravity": 1.5}``.
    moving_mass : float or str, optional
        Upper limit of the moving mass [kg]. It bounds the inertia from below by this gravity torque.
    purpose : {"torque", "simulation"}
        Purpose for which the estimator is chosen.
    confidence : float
        Confidence level of the intervals.
    thorough : bool
        Whether to add weighted, robust and output-error estimates and simulations to least squares.

    Returns
    -------
    JointFit
        Parameters by name (``fit["inertia"].value``, ``fit["inertia"].interval(0.95)``), their covariance, the held-out
        error, verdicts, `predict`, `simulate` and `score`.

    Raises
    ------
    ArgumentError
        If an argument has a wrong type or unit.
    RecordingError
        If arrays differ in shape, time does not increase, too much is missing, or too little is left.
    IdentificationError
        If an option is unknown, the effort has the opposite sign, or the motion cannot tell the parameters apart; the
        message names them.

    References
    ----------
    .. [1] M. Gautier, W. Khalil, "Modeling, Identification and Control of Robots", Hermes Penton, 2002, chapter 12.

    Examples
    --------
    >>> import numpy as np
    >>> import pellucid as pl
    >>> t = np.arange(0.0, 20.0, 0.005)
    >>> q = 0.6 * np.sin(0.8 * t) + 0.3 * np.sin(3.1 * t) + 0.1 * np.sin(7.0 * t)
    >>> v = np.gradient(q, t)
    >>> a = np.gradient(v, t)
    >>> effort = 0.05 * a + 1.5 * np.sin(q) + 0.3 * np.sign(v) + 0.08 * v
    >>> fit = pl.fit_joint(t, q, effort, lowpass="10 Hz", decimate=5, held_out=0.25)
    >>> round(fit["inertia"].value, 3), fit["inertia"].unit
    (0.05, 'kg*m^2')
    >>> list(fit)
    ['inertia', 'gravity', 'viscous', 'coulomb', 'offset']
    >>> fit.predict(t, q).shape, fit.heldout_effort_error < 3.0
    ((4000,), True)
    >>> fit.simulate(t, effort, position=q[0], velocity=v[0]).position.shape
    (4000,)
    """
    where = "fit_joint"
    choice(where, "motion", motion, EFFORT_UNITS)
    units = _units_of(where, motion, effort_unit, units)
    own = si_text(units["effort"])
    given = collect_recordings(where, time, position, effort, velocity, units=units)
    recordings = hold_out(where, given, held_out, units)
    has_velocity = _has_velocity(where, recordings)
    families = _families_of(where, friction)
    kind, channel = EFFORT_CHANNELS[own]
    gravity_options = ("none",) if motion == "prismatic" else ("none", "sine", "sine+cosine")
    if gravity is not None and gravity not in gravity_options:
        raise IdentificationError(f"{where}: gravity is {shown(gravity)}; expected one of {', '.join(gravity_options)}")
    level = number(where, "confidence", confidence)
    if not 0.0 < level < 1.0:
        raise IdentificationError(f"{where}: confidence: found {level:g}, expected between 0 and 1")
    if not isinstance(thorough, (bool, np.bool_)):
        raise ArgumentError(f"{where}: thorough: found {shown(thorough)}, expected True or False")
    processing: dict[str, Any] = {
        "order": whole_number(where, "order", order, 1, 12),
        "decimate": whole_number(where, "decimate", decimate, 1),
        "dead_band": f"{_at_least_0(where, 'dead_band', dead_band, UNITS[motion]['velocity'])!r} "
        f"{UNITS[motion]['velocity']}",
        "velocity": "recorded" if has_velocity else "differentiated",
    }
    if resample is not None:
        processing["resample"] = f"{number(where, 'resample', resample, unit='Hz', above=0.0)!r} Hz"
    cutoff = None if lowpass is None else number(where, "lowpass", lowpass, unit="Hz")
    if cutoff is not None:
        processing["lowpass"] = f"{cutoff!r} Hz"
    if "resample" in processing:
        rates = [number(where, "resample", processing["resample"], unit="Hz")] * len(recordings)
    else:
        seconds = to_si_factor(units["time"], "s")[0]
        rates = [each.rate / seconds for each in recordings]
    trims = [_trim_of(where, cutoff, rate, trim) for rate in rates]
    for recording, own_trim in zip(recordings, trims, strict=True):
        least = shortest(Filtering(cutoff, decimate=processing["decimate"], trim=own_trim))
        n = len(recording.columns["time"])
        if n < least and "resample" not in processing and not recording.is_held_out:
            raise RecordingError(f"{where}: time: found {n} samples, expected at least {least}")
    processing["trim"] = trims[0]
    raw: dict[str, Any] = {
        "name": where,
        "rig": {"motion": motion, "drive": {"kind": kind}},
        "channels": {
            "time": {"column": "time", "unit": units["time"]},
            "position": {"column": "position", "unit": units["position"]},
            channel: {"column": "effort", "unit": units["effort"]},
        },
        "processing": processing,
        "model": {
            "purpose": choice(where, "purpose", purpose, ("torque", "simulation")),
            "confidence": level,
            "known": _known_of(where, known, motion, own),
        },
        "recordings": [
            {"name": each.name, "file": each.name, "use": "validate" if each.is_held_out else "fit"}
            | ({} if own_trim == trims[0] else {"processing": {"trim": own_trim}})
            for each, own_trim in zip(recordings, trims, strict=True)
        ],
    }
    if gravity is not None:
        raw["model"]["gravity"] = gravity
    if moving_mass is not None:
        raw["rig"]["moving_mass"] = f"{number(where, 'moving_mass', moving_mass, unit='kg', above=0.0)!r} kg"
    if delay is not None:
        raw["channels"][channel]["delay"] = f"{number(where, 'delay', delay, unit='s')!r} s"
    if has_velocity:
        raw["channels"]["velocity"] = {"column": "velocity", "unit": units["velocity"]}
    config = parse_tables(raw, where)
    try:
        study = array_study(config, {each.name: _read_columns(each, config) for each in recordings}, where)
        procedure = next(each for each in PROCEDURE_ENTRIES if each.name == "joint")
        taken = take_recordings(procedure, study)
        solved = solve(taken, families, thorough=bool(thorough))
    except ReversedSignError as error:
        raise IdentificationError(
            f"{where}: effort: {error.found}: the effort has the opposite sign of the position, expected a positive "
            f"effort to drive the joint in the positive direction; give -effort, or -position{error.advice}"
        ) from None
    except PellucidError as error:
        raise _of_arrays(where, config, error) from None
    if not isinstance(solved, SolvedJoint):
        raise IdentificationError(
            f"{where}: position: found a joint that is held in every recording: inertia and friction cannot be "
            "identified; expected one that moves"
        )

    @with_one_blas_thread
    def report() -> JointResult:
        from ...study.procedures.run import complete_result
        from .identify_joint import report_joint

        try:
            return complete_result(procedure, study, report_joint(solved), taken.left_out)
        except PellucidError as error:
            raise _of_arrays(where, config, error) from None

    head = solved.headlined.estimate
    chosen = {each.name: getattr(head, each.name) for each in fields(head)}
    return JointFit(**chosen, study=study, choice=solved.choice, families=solved.fits, _report=report)


def _of_arrays(where: str, config: StudyFile, error: PellucidError) -> PellucidError:
    """Return an error of a study as one of the function `where`, in words of its arguments."""
    channel = next(name for name, spec in config.channels.items() if spec.column == "effort")
    text = re.sub(rf"\b(channels?|in) {channel}\b", r"\1 effort", str(error))
    return type(error)(f"{where}: {text}")


def _units_of(where: str, motion: str, effort_unit: Any, units: Any) -> dict[str, str]:
    """Return the unit of each column."""
    si = EFFORT_UNITS[motion]
    made = {"time": "s", **{n: UNITS[motion][n] for n in ("position", "velocity")}, "effort": effort_unit or si}
    if effort_unit is not None and effort_unit not in (si, "A", "V"):
        raise IdentificationError(
            f"{where}: effort_unit: found {shown(effort_unit)}, expected one of {si}, A, V for a {motion} joint"
        )
    if units is None:
        return made
    if not isinstance(units, Mapping):
        raise ArgumentError(f'{where}: units: found {shown(units)}, expected a mapping such as {{"position": "deg"}}')
    for name, unit in units.items():
        if name not in made:
            raise ArgumentError(f"{where}: units: found {shown(name)}, expected any of {', '.join(made)}")
        if not isinstance(unit, str):
            raise ArgumentError(f"{where}: units: {name}: found {shown(unit)}, expected a unit such as {made[name]}")
        try:
            dimension = si_text(unit)
        except PellucidError as error:
            raise ArgumentError(f"{where}: units: {name}: {error}") from None
        allowed = (si, "A", "V") if name == "effort" and effort_unit is None else (made[name],)
        if dimension not in allowed:
            raise ArgumentError(f"{where}: units: {name}: found {unit!r}, expected a unit of {' or '.join(allowed)}")
    return {**made, **units}


def _has_velocity(where: str, recordings: Sequence[ArrayRecording]) -> bool:
    having = [each.name for each in recordings if "velocity" in each.columns]
    lacking = [each.name for each in recordings if "velocity" not in each.columns]
    if having and lacking:
        raise RecordingError(
            f"{where}: velocity: found one in {', '.join(having)} and none in {', '.join(lacking)}, expected it in all "
            "or in none"
        )
    return bool(having)


def _families_of(where: str, friction: Any) -> tuple[str, ...]:
    if isinstance(friction, str):
        names = DEFAULT_FAMILIES if friction == ALL_FAMILIES else (friction,)
    elif isinstance(friction, (list, tuple)) and friction and all(isinstance(each, str) for each in friction):
        names = tuple(dict.fromkeys(friction))
    else:
        raise ArgumentError(
            f"{where}: friction: found {shown(friction)}, expected {ALL_FAMILIES!r}, or one or several of "
            f"{', '.join(FAMILIES)}"
        )
    for name in names:
        if name not in FAMILIES:
            raise IdentificationError(
                f"{where}: friction: unknown friction family {name!r}; known: {', '.join(FAMILIES)}, or {ALL_FAMILIES}"
            )
    return names


def _known_of(where: str, known: Any, motion: str, effort_unit: str) -> dict[str, str]:
    """Return known parameters as texts with their units."""
    if known is not None and not isinstance(known, Mapping):
        raise ArgumentError(f'{where}: known: found {shown(known)}, expected a mapping such as {{"gravity": 1.5}}')
    made = {}
    for name, given in (known or {}).items():
        if name not in SYMBOLS_BY_NAME:
            raise IdentificationError(
                f"{where}: known: found {shown(name)}, expected any of {', '.join(SYMBOLS_BY_NAME)}"
            )
        unit = SYMBOLS_BY_NAME[name].unit(motion, effort_unit)
        value = number(where, f"known: {name}", given, unit=unit)
        low, high = SYMBOLS_BY_NAME[name].lower, SYMBOLS_BY_NAME[name].upper
        if not low <= value <= high:
            raise IdentificationError(f"{where}: known: found {name} = {value:g}, expected {low:g} to {high:g}")
        made[name] = f"{value!r} {unit}"
    return made


def _at_least_0(where: str, name: str, value: Any, unit: str) -> float:
    found = number(where, name, value, unit=unit)
    if found < 0.0:
        raise IdentificationError(f"{where}: {name}: found {found:g}, expected 0 or more")
    return found


def _trim_of(where: str, cutoff: float | None, rate: float, trim: Any) -> int:
    """Return the number of samples at a `rate` [Hz] that are dropped at either end; refuse a `cutoff` above it [Hz]."""
    if cutoff is not None and not 0.0 < cutoff < (0.5 * rate if np.isfinite(rate) else np.inf):
        raise IdentificationError(
            f"{where}: lowpass: found {cutoff:g} Hz, expected above 0 and below {rate / 2:g} Hz, half the rate "
            "(time is in s, or in the unit that `units` states)"
        )
    if trim is not None:
        return whole_number(where, "trim", trim, 0)
    if cutoff is None or not np.isfinite(rate):
        return 0
    return settling_samples(cutoff, rate)


def _read_columns(recording: ArrayRecording, config: StudyFile) -> dict[str, np.ndarray]:
    """Return the columns of a recording that the channels of `config` read."""
    read = {spec.column for spec in config.channels.values()}
    return {name: samples for name, samples in recording.columns.items() if name in read}
