"""Identify a hinge between two IMUs in each recording, and compare its angle with a reference's.

Axis and centre come from the first seconds, the angle from then on. A reference is the turn between two bodies'
recorded orientations, without samples that jump more than the joint can.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from ...._errors import IdentificationError, PellucidError
from ....files.fault import Fault
from ....files.recording import Recording
from ....models.estimates import Parameter, Verdict
from ....models.parameter_card import ParameterCard
from ....numerics.clocks import Alignment, align, clock_drift
from ....study.answer import Answer, AnswerNumber, AnswerPart, Basis, Step, answer_of_parts
from ....study.procedures.procedure import Progress, quiet
from ....study.procedures.result import FigureTable, ParameterTable, Result
from ....study.results import ResultRow
from ....study.study import Study
from ...imu.hinge import Hinge, HingeAngle, find_hinge, hinge_angle
from ...imu.imu_angle import Inertial, angular_steps, conjugate, continuous, inertial, multiply, twist
from .hinge_table import HingeTable

JUMP_MARGIN_S = 0.05
"""Samples within this time of a jump are excluded: cameras see a body badly just before and after they lose it."""

MAX_CLOCK_DELAY_S = 0.2
"""The delay between the clocks of IMUs and cameras is searched up to this value."""


@dataclass(frozen=True, eq=False)
class HingeReference:
    """A hinge's angle from two bodies' orientations."""

    time: np.ndarray  # (n,) [s]
    angle: np.ndarray  # (n,) [rad]; from one believable stretch to the next it may be off by whole turns
    believable: np.ndarray  # (n,) False near a jump that the joint cannot make
    axis: np.ndarray  # (3,) Unit vector of the relative rotation's axis, in the proximal body's frame
    share: float  # Share of the squared relative rotation that is about the axis: 1 for a perfect hinge

    @property
    def excluded(self) -> int:
        """Number of samples that are not credible."""
        return int(np.sum(~self.believable))

    def excluded_between(self) -> tuple[tuple[float, float], ...]:
        """Return the first and last time of each stretch of samples that are not credible [s]."""
        from ....numerics.filters import runs

        return tuple((float(self.time[r.start]), float(self.time[r.stop - 1])) for r in runs(~self.believable))


def has_reference(recording: Recording, proximal: str, distal: str) -> bool:
    """Return whether a `recording` has orientations of the `proximal` and the `distal` body in addition to the IMUs."""
    return all(f"{prefix}.orientation.{c}" in recording for prefix in (proximal, distal) for c in "wxyz")


def hinge_reference(recording: Recording, proximal: str, distal: str, jump: float) -> HingeReference:
    """Return the angle between two bodies about their main axis of relative rotation.

    The axis is the first right-singular vector of their relative angular velocity. It is a part of the ground truth,
    so that all credible samples of the recording enter it. The angle is the twist about it. A sample is not credible
    if it is within 0.05 s of a step of more than `jump`, before or after it.

    `jump` [rad].
    """
    bodies = [np.stack([recording[f"{p}.orientation.{c}"] for c in "wxyz"], axis=-1) for p in (proximal, distal)]
    where = f"{recording.path.name} (recording {recording.name})"
    for prefix, body in zip((proximal, distal), bodies, strict=True):
        length = np.linalg.norm(body, axis=1)
        bad = np.flatnonzero(~(np.abs(length - 1.0) < 0.05))
        if len(bad):
            raise IdentificationError(
                f"{where}: channel {prefix}.orientation: found a norm of {length[bad[0]]:.3g} at "
                f"{recording.time[bad[0]]:.3f} s, expected unit quaternions"
            )
    time = np.asarray(recording.time)
    relative = continuous(multiply(conjugate(bodies[0]), bodies[1]))
    relative /= np.linalg.norm(relative, axis=1, keepdims=True)
    steps = angular_steps(relative)
    # A body that cameras lose seems to turn about any axis, so the axis is found without such steps.
    believable = ~_samples_near_jumps(time, np.linalg.norm(steps, axis=1) > jump)
    kept = believable[1:] & believable[:-1]
    if kept.sum() < 3:
        raise IdentificationError(f"{where}: found no believable step of the reference angle, expected most below jump")
    _, size, directions = np.linalg.svd(steps[kept], full_matrices=False)
    angle = twist(relative, directions[0])
    return HingeReference(time, angle, believable, directions[0], float(size[0] ** 2 / np.sum(size**2)))


def _samples_near_jumps(time: np.ndarray, jumps: np.ndarray) -> np.ndarray:
    """Return which samples lie within `JUMP_MARGIN_S` of a step marked in `jumps` (n - 1,), shape (n,)."""
    near = np.zeros(len(time), bool)
    for i in np.flatnonzero(jumps):
        near |= (time >= time[i] - JUMP_MARGIN_S) & (time <= time[i + 1] + JUMP_MARGIN_S)
    return near


@dataclass(frozen=True, eq=False)
class HingeScore:
    """An estimated angle compared with the reference."""

    angle: np.ndarray  # (n,) Estimate at the reference's times, sense and offset corrected [rad]; NaN outside its span
    error: np.ndarray  # (n,) Estimate less reference, in (-pi, pi] [rad]; NaN outside the estimate's span
    scored: np.ndarray  # (n,) True for samples that are scored
    delay: float  # Time by which the IMUs' clock is late [s]; 0 where no delay was allowed
    offset: float  # Angle added to the estimate [rad]
    rms: float  # Root mean square of the error over the scored samples [rad]
    largest: float  # Largest absolute error over the scored samples [rad]


def clock_delay(found: HingeAngle, reference: HingeReference, start: float, stop: float) -> Alignment:
    """Return the delay of the IMUs' clock against the cameras', from the angular rates between `start` and `stop`
    [s]."""
    part = (reference.time >= start) & (reference.time < stop)
    rate = np.where(reference.believable, np.gradient(reference.angle, reference.time), np.nan)[part]
    return align(
        reference.time[part], rate, found.time, np.gradient(found.angle, found.time), longest=MAX_CLOCK_DELAY_S
    )


def score(
    found: HingeAngle, reference: HingeReference, *, calibration: float, score_from: float, sense: float, delay: float
) -> HingeScore:
    """Score an angle against the reference from `score_from` on, with the offset found before `calibration`.

    `calibration`, `score_from` and `delay` are in seconds; `sense` is 1 or -1.
    """
    time = reference.time
    angle = sense * CubicSpline(found.time, found.angle, extrapolate=False)(time + delay)
    usable = reference.believable & np.isfinite(angle)
    early, scored = usable & (time < calibration), usable & (time >= score_from)
    if not early.any() or not scored.any():
        raise IdentificationError(
            f"hinge: {early.sum()} believable reference samples before {calibration:g} s and {scored.sum()} after "
            f"{score_from:g} s, expected some of both"
        )
    miss = angle - reference.angle
    offset = -float(np.angle(np.mean(np.exp(1j * miss[early]))))
    offset -= float(np.mean(_wrapped(miss[early] + offset)))
    error = _wrapped(miss + offset)
    return HingeScore(
        angle=reference.angle + error,
        error=error,
        scored=scored,
        delay=float(delay),
        offset=offset,
        rms=float(np.sqrt(np.mean(error[scored] ** 2))),
        largest=float(np.max(np.abs(error[scored]))),
    )


def _wrapped(angle: np.ndarray) -> np.ndarray:
    """Return an angle in (-pi, pi]."""
    return np.pi - (np.pi - angle) % (2.0 * np.pi)


COMMAND_NAME = "identify"
"""Every row names this command as its origin."""

PROCESSING_NOTE = (
    "rates and their derivatives by cubic splines; angle by a Kalman filter run forwards and back over gyroscopes, the "
    "acceleration of the joint's centre and the rates across the axis"
)
"""Page and cards describe the signal processing with this sentence."""

SCORED_ANGLES = ("offline", "causal", "aligned", "unaligned", "gyroscopes")
"""Estimates of the angle that are scored.

``offline`` is the one that is reported, ``causal`` uses no later samples, ``aligned`` takes the clock delay from the
calibration's rates, ``unaligned`` assumes no delay, and ``gyroscopes`` integrates rates alone.
"""


@dataclass(frozen=True, eq=False)
class HingeTrial:
    """One recording of a hinge."""

    name: str
    hinge: Hinge  # Axes, centres and offsets from the recording's first seconds
    offline: HingeAngle
    causal: HingeAngle
    interpolated: int = 0  # Samples of the IMUs that were missing and were bridged
    reference: HingeReference | None = None
    alignment: Alignment | None = None  # Delay of the IMUs' clock against the reference's, from the first seconds
    # Drift of the two clocks against each other, and its standard error, from the first and the last seconds [s/s].
    # It corrects nothing: it says for how long a delay that was found early still holds.
    clock_drift: tuple[float, float] | None = None
    scores: dict[str, HingeScore] | None = None  # Scores by name in `SCORED_ANGLES`; empty without a reference


MAX_ANGLE_ERROR_DEG = 5.0
"""Largest error of a joint angle that counts as right [deg].

McGinley et al., Gait & Posture 29, 2009, call errors of up to 5 deg acceptable in gait analysis, and larger ones
misleading.
"""


@dataclass(frozen=True, kw_only=True, repr=False)
class HingeResult(Result):
    """What `identify` found on hinges, one trial for each recording."""

    trials: tuple[HingeTrial, ...] = ()

    def make_answer(self) -> Answer:
        """Return the answer that the result gives, before the study completes it."""
        return hinge_answer(self)


def identify_hinge(study: Study, tell: Progress = quiet) -> HingeResult:
    """Estimate hinge and angle in every recording, and evaluate the angle where a reference exists. `study` [hinge]."""
    table = study.table(HingeTable)
    if table.score_from < table.calibration:
        raise IdentificationError(
            f"[hinge]: found score_from = {table.score_from:g} s before the end of calibration, "
            f"{table.calibration:g} s: expected it later, because calibration data do not test the angle"
        )
    recordings = study.recordings()
    trials, failures = [], {}
    for i, recording in enumerate(recordings):
        tell(recording.name, i / len(recordings))
        try:
            trials.append(hinge_trial(recording, table))
        except PellucidError as error:
            failures[recording.name] = str(error)
    if not trials:
        raise IdentificationError("; ".join(failures.values()) or f"{study.name}: no recording")
    checksums = {r.name: r.checksum for r in recordings}
    rows = [row for trial in trials for row in _rows(study.name, trial, checksums[trial.name])]
    rows += [
        ResultRow(f"{study.name}.angle.rmse_deg.{name}", None, "deg", COMMAND_NAME, "heldout", checksums[name], why)
        for name, why in failures.items()
    ]
    found = HingeResult(
        study=study.name,
        headline="",
        tables=(*_error_tables(trials), *(_parameters(trial) for trial in trials)),
        verdicts=tuple(_verdicts(trials, failures, table)),
        rows=tuple(rows),
        cards={f"hinge_{trial.name}": _card(study, trial, table, checksums) for trial in trials},
        checksums=checksums,
        trials=tuple(trials),
    )
    return replace(found, headline=hinge_answer(found).sentence)


def faults(study: Study) -> list[Fault]:
    """What keeps recordings from being used, and what is bridged in them. `study` [hinge]."""
    table = study.table(HingeTable)
    found = []
    for recording in study.recordings():
        file, where = recording.path.name, f"{recording.path.name} (recording {recording.name})"
        length = float(recording.time[-1] - recording.time[0])
        if length <= table.score_from:
            text, wanted = f"{length:.4g} s", f"more than the {table.score_from:g} s after which the angle is evaluated"
            message = f"{where}, channel time: found {text}, expected {wanted}"
            found.append(Fault("refuse", "too_few_samples", file, "time", text, wanted, message))
        for prefix in (table.proximal, table.distal):
            wanted = "an IMU's samples at every step"
            try:
                bridged = inertial(recording, prefix)
            except PellucidError as error:
                found.append(Fault("refuse", "gap", file, prefix, str(error), wanted, str(error)))
                continue
            if bridged.interpolated:
                start, stop = max(bridged.gaps, key=lambda gap: gap[1] - gap[0])
                text = f"{bridged.interpolated} missing samples, the longest stretch from {start:.3f} to {stop:.3f} s"
                message = f"{where}, channels {prefix}: found {text}, expected {wanted}; they are bridged"
                found.append(Fault("note", "gap", file, prefix, text, wanted, message))
    return found


def hinge_trial(recording: Recording, table: HingeTable) -> HingeTrial:
    """Hinge and angle of one recording. `table` [hinge]."""
    imus = [inertial(recording, prefix) for prefix in (table.proximal, table.distal)]
    start = float(recording.time[0])
    hinge = find_hinge(*(imu.between(start, start + table.calibration) for imu in imus))
    offline, causal = (hinge_angle(*imus, hinge, offline=offline) for offline in (True, False))
    trial = HingeTrial(recording.name, hinge, offline, causal, sum(imu.interpolated for imu in imus))
    if not has_reference(recording, table.proximal, table.distal):
        return trial
    return _evaluated(trial, recording, imus, table, start)


def _evaluated(
    trial: HingeTrial, recording: Recording, imus: list[Inertial], table: HingeTable, start: float
) -> HingeTrial:
    reference = hinge_reference(recording, table.proximal, table.distal, table.jump)
    alignment = clock_delay(trial.offline, reference, start, start + table.calibration)
    end = float(reference.time[-1])
    late = clock_delay(trial.offline, reference, max(end - table.calibration, start + table.calibration), end)
    delay = alignment.delay if table.delay is None else table.delay
    gyroscopes = hinge_angle(*imus, trial.hinge, directions=False)
    estimates = (
        (trial.offline, delay), (trial.causal, delay), (trial.offline, alignment.delay), (trial.offline, 0.0),
        (gyroscopes, delay),
    )  # fmt: skip
    scores = {
        name: score(
            estimate, reference, calibration=start + table.calibration, score_from=start + table.score_from,
            sense=float(np.sign(alignment.gain)), delay=late_by,
        )
        for name, (estimate, late_by) in zip(SCORED_ANGLES, estimates, strict=True)
    }  # fmt: skip
    return replace(
        trial, reference=reference, alignment=alignment, clock_drift=clock_drift(alignment, late), scores=scores
    )


def _rows(study: str, trial: HingeTrial, checksum: str) -> list[ResultRow]:
    def row(what, value, unit, split, note=""):
        return ResultRow(f"{study}.{what}.{trial.name}", value, unit, COMMAND_NAME, split, checksum, note)

    found = [row(name, value, unit, "fitted") for name, unit, value, _ in _places(trial.hinge)]
    if not trial.scores:
        return found
    notes = {
        "offline": f"zero-phase; one offset from the calibration's seconds; {_delay(trial)}",
        "causal": f"no later sample used; offset and delay as for the zero-phase angle; {_delay(trial)}",
        "aligned": "zero-phase; delay, to a fraction of a sample, and offset from the calibration's seconds",
        "unaligned": "zero-phase; one offset, no delay",
        "gyroscopes": "integrated rates alone, as they drift; offset and delay as for the zero-phase angle",
    }
    ids = {"offline": "angle.rmse_deg"} | {estimate: f"angle.{estimate}_rms_deg" for estimate in SCORED_ANGLES[1:]}
    found += [
        row(ids[estimate], np.degrees(trial.scores[estimate].rms), "deg", "heldout", notes[estimate])
        for estimate in SCORED_ANGLES
    ]
    error, drift = 1.96 * trial.alignment.delay_error, trial.clock_drift
    spread = 1.96 * drift[1]
    found += [
        row("angle.largest_deg", np.degrees(trial.scores["offline"].largest), "deg", "heldout"),
        row("reference.excluded", trial.reference.excluded, "1", "heldout", _excluded(trial)),
        row("clock.delay", trial.alignment.delay, "s", "fitted", f"first seconds; +- {1e3 * error:.2g} ms (95 %)"),
        row("clock.drift", drift[0], "s/s", "fitted", f"first to last seconds; +- {spread:.2g} (95 %); unused"),
    ]
    return found


def _places(hinge: Hinge) -> Iterator[tuple[str, str, float, float]]:
    """Yield name, unit, value and standard error of the components of both axes, then of both arms."""
    sides = tuple(enumerate(("proximal", "distal")))
    for i, side in sides:
        # A tilt across the axis moves its components by no more than itself.
        tilt = float(np.max(hinge.standard_errors[2 * i : 2 * i + 2]))
        for k, c in enumerate("xyz"):
            across = float(np.sqrt(max(1.0 - hinge.axes[i, k] ** 2, 0.0)))
            yield f"axis.{side}.{c}", "1", float(hinge.axes[i, k]), tilt * across
    for i, side in sides:
        for k, c in enumerate("xyz"):
            yield f"centre_to_{side}.{c}", "m", float(hinge.arms[i, k]), float(hinge.standard_errors[4 + 3 * i + k])


def _delay(trial: HingeTrial) -> str:
    return f"IMUs taken as {1e3 * trial.scores['offline'].delay:.3g} ms later than the reference"


def _excluded(trial: HingeTrial) -> str:
    parts = [f"{a:.2f} to {b:.2f} s" for a, b in trial.reference.excluded_between()]
    return "reference jumps more than the joint can: " + ", ".join(parts) if parts else "no impossible jump"


def hinge_answer(found: HingeResult) -> Answer:
    """Return whether the angle is that of the reference; without a reference, whether the axis is determined."""
    judged = [trial for trial in found.trials if trial.scores]
    count = len(found.checksums)
    what = f"{len(found.trials)} recording{'s' if len(found.trials) > 1 else ''} of a hinge between two IMUs"
    if judged:
        errors = {trial.name: float(np.degrees(trial.scores["offline"].rms)) for trial in judged}
        text = f"the angle is within {min(errors.values()):.2f} to {max(errors.values()):.2f} deg RMS of the reference"
        question = f"Do two IMUs measure the hinge's angle within {MAX_ANGLE_ERROR_DEG:g} deg RMS of the reference?"
        quantity, where = "RMS error of the angle", "the seconds after the calibration, which were not fitted"
    else:
        errors = {trial.name: _axis_tilt_deg(trial) for trial in found.trials}
        text = (
            f"axis and centre are identified; the error of the axis is at most {max(errors.values()):.2f} deg (95 % "
            "confidence)"
        )
        text += "; the angle is not evaluated, because no recording has a reference"
        question = f"Do the IMUs identify the axis of the hinge within {MAX_ANGLE_ERROR_DEG:g} deg?"
        quantity, where = "half the 95 % interval of the axis", ""
    parts = [
        AnswerPart(name, "yes" if error <= MAX_ANGLE_ERROR_DEG else "no", f"{quantity} {error:.2f} deg")
        for name, error in errors.items()
    ]
    return answer_of_parts(
        question,
        f"{what}: {text}.",
        parts,
        [AnswerNumber(f"{quantity}, {name}", error, "deg") for name, error in errors.items()],
        Basis(len(found.trials), count, judged=where),
        improve=(
            Step("Turn the hinge faster and over a larger range while it is calibrated, in several postures"),
            Step("Fasten both IMUs to rigid parts: soft tissue under a sensor moves it against the bone"),
        ),
    )


def _axis_tilt_deg(trial: HingeTrial) -> float:
    """Return half the 95 % interval of the tilt of the axis, the worse of both IMUs [deg]."""
    return float(np.degrees(1.96 * np.max(trial.hinge.standard_errors[:4])))


def _error_tables(trials: list[HingeTrial]) -> list[FigureTable]:
    evaluated = [t for t in trials if t.scores]
    if not evaluated:
        return []
    ways = ("offline", "causal", "own delay", "no delay", "rates alone")
    heads = ("recording", *(f"{estimate} [deg]" for estimate in ways), "delay found [ms]", "excluded samples")
    rows = tuple(
        (t.name, *(float(np.degrees(t.scores[e].rms)) for e in SCORED_ANGLES), 1e3 * t.alignment.delay,
         t.reference.excluded)
        for t in evaluated
    )  # fmt: skip
    return [FigureTable("RMS error of the angle, after the calibration", heads, rows)]


def _parameters(trial: HingeTrial) -> ParameterTable:
    hinge = trial.hinge
    parameters = [Parameter(name.replace(".", "_"), *rest) for name, *rest in _places(hinge)]
    parameters.append(Parameter("drift", "rad/s", hinge.drift, float(hinge.standard_errors[10])))
    return ParameterTable(f"Hinge of {trial.name}, from its first {hinge.seconds:.3g} s", tuple(parameters))


def _verdicts(trials: list[HingeTrial], failures: dict[str, str], table: HingeTable) -> Iterator[Verdict]:
    for trial in trials:
        who = trial.name
        if trial.scores:
            degrees = {estimate: float(np.degrees(trial.scores[estimate].rms)) for estimate in SCORED_ANGLES}
            yield Verdict(
                "good" if degrees["offline"] < 0.5 * degrees["gyroscopes"] else "note",
                f"{who}: from {table.score_from:g} s on, the angle has an error of {degrees['offline']:.2f} deg RMS "
                f"({degrees['causal']:.2f} from past samples only, {degrees['gyroscopes']:.2f} from gyroscopes alone).",
            )
            yield Verdict(
                "note",
                f"{who}: {_delay(trial)}; the angular rates of the first {table.calibration:g} s give "
                f"{1e3 * trial.alignment.delay:.1f} ms, and the two clocks drift apart by "
                f"{1e6 * trial.clock_drift[0]:.0f} us every second. With the delay of those first seconds the "
                f"error is {degrees['aligned']:.2f} deg, with none {degrees['unaligned']:.2f} deg.",
            )
            if excluded := trial.reference.excluded:
                yield Verdict(
                    "warning",
                    f"{who}: {excluded} reference samples are excluded from the evaluation; {_excluded(trial)}.",
                )
        if trial.interpolated:
            yield Verdict("warning", f"{who}: {trial.interpolated} missing IMU samples were bridged.")
        if not trial.hinge.rested:
            yield Verdict("note", f"{who}: no rest in the calibration, so that gyroscope offsets were not measured.")
    for name, why in failures.items():
        yield Verdict("warning", f"{name} cannot be used: {why}.")


def _card(study: Study, trial: HingeTrial, table: HingeTable, checksums) -> ParameterCard:
    return ParameterCard(
        kind="hinge",
        study=study.name,
        name=f"hinge_{trial.name}",
        parameters=tuple(p.on_card(0.95) for p in _parameters(trial).parameters),
        settings={
            "proximal": table.proximal,
            "distal": table.distal,
            "calibration_s": table.calibration,
            **{f"gyroscope_offset_{s}_{c}": float(trial.hinge.offsets[i, k])
               for i, s in enumerate(("proximal", "distal")) for k, c in enumerate("xyz")},
        },
        processing=PROCESSING_NOTE,
        checksums={trial.name: checksums[trial.name]},
    )  # fmt: skip
