"""Identify a hinge between two IMUs: its axis and centre from the first seconds, its angle from then on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...._errors import IdentificationError, PellucidError
from ....files.fault import Fault
from ....files.recording import Recording
from ....models.parameter import Parameter, Verdict
from ....models.parameter_card import ParameterCard
from ....numerics.clocks import Alignment, clock_drift
from ....study.procedures.result import FigureTable, ParameterTable, Result
from ....study.results import ResultRow
from ....study.study import Study
from ...imu.hinge import Hinge, find_hinge
from ...imu.hinge_angle import HingeAngle, hinge_angle
from ...imu.inertial import Inertial, inertial
from .hinge_reference import HingeReference, HingeScore, clock_delay, has_reference, hinge_reference, score
from .hinge_table import HingeTable

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


@dataclass(frozen=True, kw_only=True, repr=False)
class HingeResult(Result):
    """What `identify` found on hinges, one trial for each recording."""

    trials: tuple[HingeTrial, ...] = ()


def identify_hinge(study: Study, on_progress: Callable[[str, float], None] | None = None) -> HingeResult:
    """Find hinge and angle in every recording, and judge the angle where there is a reference. `study` [hinge]."""
    table = study.table(HingeTable)
    if table.score_from < table.calibration:
        raise IdentificationError(
            f"[hinge]: found score_from = {table.score_from:g} s before the end of calibration, "
            f"{table.calibration:g} s: the angle would be judged on what it was calibrated with"
        )
    recordings = study.recordings()
    trials, failures = [], {}
    for i, recording in enumerate(recordings):
        if on_progress:
            on_progress(recording.name, i / len(recordings))
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
    return HingeResult(
        study=study.name,
        headline=_headline(trials),
        tables=(*_error_tables(trials), *(_parameters(trial) for trial in trials)),
        verdicts=tuple(_verdicts(trials, failures, table)),
        rows=tuple(rows),
        cards={f"hinge_{trial.name}": _card(study, trial, table, checksums) for trial in trials},
        checksums=checksums,
        trials=tuple(trials),
    )


def faults(study: Study) -> list[Fault]:
    """What keeps recordings from being used, and what is bridged in them. `study` [hinge]."""
    table = study.table(HingeTable)
    found = []
    for recording in study.recordings():
        file, where = recording.path.name, f"{recording.path.name} (recording {recording.name})"
        length = float(recording.time[-1] - recording.time[0])
        if length <= table.score_from:
            text, wanted = f"{length:.4g} s", f"more than the {table.score_from:g} s after which the angle is judged"
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
    common = {
        "calibration": start + table.calibration,
        "score_from": start + table.score_from,
        "sense": float(np.sign(alignment.gain)),
    }
    scores = {
        "offline": score(trial.offline, reference, delay=delay, **common),
        "causal": score(trial.causal, reference, delay=delay, **common),
        "aligned": score(trial.offline, reference, delay=alignment.delay, **common),
        "unaligned": score(trial.offline, reference, delay=0.0, **common),
        "gyroscopes": score(gyroscopes, reference, delay=delay, **common),
    }
    return replace(
        trial, reference=reference, alignment=alignment, clock_drift=clock_drift(alignment, late), scores=scores
    )


def _rows(study: str, trial: HingeTrial, checksum: str) -> list[ResultRow]:
    def row(what, value, unit, split, note=""):
        return ResultRow(f"{study}.{what}.{trial.name}", value, unit, COMMAND_NAME, split, checksum, note)

    found = [
        row(f"axis.{side}.{c}", trial.hinge.axes[i, k], "1", "fitted")
        for i, side in enumerate(("proximal", "distal"))
        for k, c in enumerate("xyz")
    ]
    found += [
        row(f"centre_to_{side}.{c}", trial.hinge.arms[i, k], "m", "fitted")
        for i, side in enumerate(("proximal", "distal"))
        for k, c in enumerate("xyz")
    ]
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
    found += [
        row("angle.largest_deg", np.degrees(trial.scores["offline"].largest), "deg", "heldout"),
        row("reference.excluded", trial.reference.excluded, "1", "heldout", _excluded(trial)),
        row("clock.delay", trial.alignment.delay, "s", "fitted", f"first seconds; +- {1e3 * error:.2g} ms (95 %)"),
        row(
            "clock.drift", drift[0], "s/s", "fitted", f"first to last seconds; +- {1.96 * drift[1]:.2g} (95 %); unused"
        ),
    ]
    return found


def _delay(trial: HingeTrial) -> str:
    return f"IMUs taken as {1e3 * trial.scores['offline'].delay:.3g} ms later than the reference"


def _excluded(trial: HingeTrial) -> str:
    parts = [f"{a:.2f} to {b:.2f} s" for a, b in trial.reference.excluded_between()]
    return "reference jumps more than the joint can: " + ", ".join(parts) if parts else "no impossible jump"


def _headline(trials: list[HingeTrial]) -> str:
    evaluated = [np.degrees(t.scores["offline"].rms) for t in trials if t.scores]
    what = f"{len(trials)} recording{'s' if len(trials) > 1 else ''} of a hinge between two IMUs"
    if not evaluated:
        return f"{what}: axis, centre and angle found; no reference to judge the angle by."
    return f"{what}: the angle is within {min(evaluated):.2f} to {max(evaluated):.2f} deg RMS of the reference."


def _error_tables(trials: list[HingeTrial]) -> list[FigureTable]:
    evaluated = [t for t in trials if t.scores]
    if not evaluated:
        return []
    ways = ("offline", "causal", "own delay", "no delay", "rates alone")
    heads = ("recording", *(f"{estimate} [deg]" for estimate in ways), "delay found [ms]", "excluded samples")
    rows = tuple(
        (
            t.name,
            *(float(np.degrees(t.scores[estimate].rms)) for estimate in SCORED_ANGLES),
            1e3 * t.alignment.delay,
            t.reference.excluded,
        )
        for t in evaluated
    )
    return [FigureTable("RMS error of the angle, after the calibration", heads, rows)]


def _parameters(trial: HingeTrial) -> ParameterTable:
    hinge, parameters = trial.hinge, []
    # A tilt across the axis moves its components by no more than itself.
    tilt = [float(np.max(hinge.standard_errors[2 * i : 2 * i + 2])) for i in range(2)]
    for i, side in enumerate(("proximal", "distal")):
        for k, c in enumerate("xyz"):
            across = np.sqrt(max(1.0 - hinge.axes[i, k] ** 2, 0.0))
            parameters.append(Parameter(f"axis_{side}_{c}", "1", float(hinge.axes[i, k]), tilt[i] * float(across)))
    for i, side in enumerate(("proximal", "distal")):
        for k, c in enumerate("xyz"):
            error = float(hinge.standard_errors[4 + 3 * i + k])
            parameters.append(Parameter(f"centre_to_{side}_{c}", "m", float(hinge.arms[i, k]), error))
    parameters.append(Parameter("drift", "rad/s", hinge.drift, float(hinge.standard_errors[10])))
    return ParameterTable(f"Hinge of {trial.name}, from its first {hinge.seconds:.3g} s", tuple(parameters))


def _verdicts(trials: list[HingeTrial], failures: dict[str, str], table: HingeTable) -> list[Verdict]:
    found = []
    for trial in trials:
        if trial.scores:
            scores = trial.scores
            degrees = {estimate: float(np.degrees(scores[estimate].rms)) for estimate in SCORED_ANGLES}
            found.append(
                Verdict(
                    "good" if degrees["offline"] < 0.5 * degrees["gyroscopes"] else "note",
                    f"{trial.name}: {degrees['offline']:.2f} deg RMS from {table.score_from:g} s on "
                    f"({degrees['causal']:.2f} without later samples, {degrees['gyroscopes']:.2f} by "
                    "gyroscopes alone).",
                )
            )
            found.append(
                Verdict(
                    "note",
                    f"{trial.name}: {_delay(trial)}; the rates of the first {table.calibration:g} s say "
                    f"{1e3 * trial.alignment.delay:.1f} ms, and the two clocks drift apart by "
                    f"{1e6 * trial.clock_drift[0]:.0f} us every second. With the delay of those first seconds the "
                    f"error is {degrees['aligned']:.2f} deg, with none {degrees['unaligned']:.2f} deg.",
                )
            )
            if trial.reference.excluded:
                found.append(
                    Verdict(
                        "warning",
                        f"{trial.name}: {trial.reference.excluded} reference samples are not judged; "
                        f"{_excluded(trial)}.",
                    )
                )
        if trial.interpolated:
            found.append(Verdict("warning", f"{trial.name}: {trial.interpolated} missing IMU samples were bridged."))
        if not trial.hinge.rested:
            found.append(
                Verdict("note", f"{trial.name}: no rest in the calibration, so gyroscope offsets were not read.")
            )
    found += [Verdict("warning", f"{name} cannot be used: {why}.") for name, why in failures.items()]
    return found


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
