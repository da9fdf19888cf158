"""Check a recorded velocity against the position: its sign, its unit and its delay."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ..._errors import RecordingError, UnfitRecordingError
from ...files.fault import Fault, warn_if_held_out
from ...files.recording import Recording
from ...numerics.motion import differentiate, lowpassed, shortest
from ...study.recorded_motions import filtering_of, stretches_of
from ...study.study import Study
from ...study.study_file import Processing

MIN_CORRELATION = 0.7
"""A velocity follows the position if its correlation with the position's derivative is at least this."""

MAX_SCALE_DIFFERENCE = 0.1
"""Largest relative difference of a velocity's scale from that of the position's derivative."""

MAX_DELAY_S = 0.1
"""Largest delay in the search [s]."""

MAX_COMPARED_SAMPLES = 10_000
"""Number of samples that are compared, from the middle of the longest stretch."""

UNIT_CONFUSIONS = {
    math.degrees(1.0): "deg/s given as rad/s", math.radians(1.0): "rad/s given as deg/s", 1e3: "mm/s given as m/s",
    1e-3: "m/s given as mm/s", 60.0 / (2.0 * math.pi): "rpm given as rad/s", math.pi / 30.0: "rad/s given as rpm",
}  # fmt: skip
"""Confusions of units, by the factor by which they enlarge the velocity."""

MAX_STEADY_SPREAD_SHARE = 0.02
"""A speed counts as one throughout if its standard deviation is below this share of its mean."""


def velocity_faults(study: Study) -> list[Fault]:
    """Return the faults of every recorded velocity."""
    return [
        warn_if_held_out(fault, recording.use)
        for recording in study.recordings()
        if "velocity" in recording and "position" in study.specs_of(recording)
        for fault in _faults(recording, study.processing_of(recording))
    ]


def require_velocity(study: Study) -> None:
    """Refuse recorded velocities that are to be used but do not follow the position."""
    refused = [fault.message for fault in velocity_faults(study) if fault.severity == "refuse"]
    if refused:
        raise UnfitRecordingError("\n".join(refused))


def _faults(recording: Recording, processing: Processing) -> Iterator[Fault]:
    from ...numerics.clocks import align  # imported late, because it loads SciPy's optimisers

    longest = max(stretches_of(recording, processing), key=lambda s: len(s.time), default=None)
    filtering = filtering_of(processing)
    if longest is None or len(longest.time) < shortest(filtering):
        return
    measured, fs = longest.recording, longest.fs
    try:
        expected = differentiate(measured["position"], fs, filtering)[1]
        recorded = lowpassed(measured["velocity"], fs, filtering)
    except ValueError:
        return  # too short for its filter, which is reported elsewhere
    used = processing.velocity == "recorded"
    thin = max(int(fs / (10.0 * filtering.lowpass)), 1) if filtering.lowpass else 1
    first = max((len(expected) - MAX_COMPARED_SAMPLES * thin) // 2, 0)
    part = slice(first, first + MAX_COMPARED_SAMPLES * thin, thin)
    time, expected, recorded = longest.time[part], expected[part], recorded[part]

    def fault(kind: str, found: str, wanted: str, severity: str = "refuse" if used else "note") -> Fault:
        message = (
            f"{recording.path.name} (recording {recording.name}), channel velocity: found {found}, expected {wanted}"
        )
        return Fault(severity, kind, recording.path.name, "velocity", found, wanted, message)

    if all(float(np.std(x)) < MAX_STEADY_SPREAD_SHARE * abs(float(np.mean(x))) for x in (expected, recorded)):
        return  # one speed throughout, as in a map of friction: nothing varies that could be compared
    moving = float(np.std(expected)) > 0.0 and float(np.std(recorded)) > 0.0
    try:
        lies = align(time, expected, time, recorded, longest=MAX_DELAY_S) if moving else None
    except RecordingError:
        lies = None
    if lies is None or abs(lies.correlation) < MIN_CORRELATION:
        found = f"a correlation of {lies.correlation:.2f} with" if lies is not None else "no likeness to"
        yield fault("velocity_mismatch", f"{found} the position's derivative", "one that follows the position")
        return
    size = abs(lies.gain)
    if lies.gain < 0.0:
        yield fault(
            "velocity_sign", "the position's derivative reversed", "its sign: set sign = -1 on channel velocity"
        )
    if abs(size - 1.0) > MAX_SCALE_DIFFERENCE:
        like = next(
            (
                f", which looks like {text}"
                for by, text in UNIT_CONFUSIONS.items()
                if abs(size / by - 1.0) < MAX_SCALE_DIFFERENCE
            ),
            "",
        )
        yield fault(
            "velocity_scale", f"{size:.4g} times the position's derivative{like}", "the same: its unit or scale"
        )
    late = lies.delay
    if abs(late) > 1.0 / recording.fs and abs(late) > 4.0 * lies.delay_error:
        what = f"it {1e3 * abs(late):.3g} ms {'late' if late > 0.0 else 'early'} against the position"
        reach = f"(95 % interval {1e3 * (late - 1.96 * lies.delay_error):.3g} to "
        reach += f"{1e3 * (late + 1.96 * lies.delay_error):.3g} ms)"
        write = f'none, or velocity = {{ delay = "{1e3 * late:.3g} ms" }} in [channels]'
        yield fault("velocity_delay", f"{what} {reach}", write, "note")
