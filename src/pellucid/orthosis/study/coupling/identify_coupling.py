"""Identify a wearer strapped to an orthosis in the published order: orthosis, IMU, limb, muscles, strap.

Every stage uses the results of those before it. If a stage fails for one participant, this is reported and the others
continue.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ...._errors import IdentificationError, PellucidError
from ....emg.signals.emg_chain import EmgChain, emg_chain
from ....files.fault import Fault, warn_if_held_out
from ....files.recording import Recording
from ....models.anthropometry import Segment, known_segments
from ....numerics.posterior.ensemble import require_sampler
from ....numerics.wrapping import unwrap
from ....study.procedures.procedure import Progress, quiet
from ....study.study import Study
from ....study.study_file import Participant, StudyFile
from ...imu.imu_angle import inertial
from ...input_output import InputOutput, input_output
from ...strap.limb import (
    JointAxis,
    Levels,
    MuscleTorque,
    at_work,
    calibrate_imu,
    envelopes,
    find_joint_axis,
    find_levels,
    fit_limb,
    fit_muscle_torque,
    limb_angle_by_imu,
)
from ...strap.orthosis_alone import OrthosisFit, fit_orthosis
from ...strap.strap_model import StrappedSwing
from ...strap.wearer_coupling import identify_wearer
from .cards import actuator_card, emg_cards
from .coupling_result import CouplingResult, WearerStages, coupling_result
from .coupling_table import CouplingTable

EMG_CHAIN_NAME = "knee"
"""EMG chain from raw EMG to envelopes. It is zero-phase, because the processing is offline."""

ORTHOSIS_CHANNELS = ("torque", "position")
"""Channels of the orthosis: torque of its spring, and its angle."""

MAX_RANGE_EXCESS_RAD = np.radians(30.0)
"""Largest distance of a worn orthosis from the angles at which it was identified alone [rad]."""

MAX_HELD_TRIALS = 3
"""Largest number of trials with held torques that are used for a strap."""

RECORDING_PROTOCOLS = (
    "gravity_holds",
    "sine_tracking",
    "imu_on_orthosis",
    "relaxed_holds",
    "mvc",
    "torque_steps",
    "free_swing",
)
"""Protocols of the recordings that the procedure may use."""


def identify_coupling(study: Study, tell: Progress = quiet) -> CouplingResult:
    """Identify orthosis, limbs and straps of a study with ``[coupling]``.

    The protocol distinguishes the recordings: ``gravity_holds``, ``sine_tracking``, ``imu_on_orthosis``,
    ``relaxed_holds``, ``mvc``, ``torque_steps``, ``free_swing``. Recordings marked ``"validate"`` are never fitted and
    only evaluated.
    """
    if study.table(CouplingTable).posterior:
        require_sampler()
    tell("reading recordings", 0.0)
    recordings = study.recordings()
    found = identify_worn(study.config, recordings, tell=lambda text, share: tell(text, 0.3 + 0.7 * share))
    made = emg_cards(study, recordings, found.orthosis.orthosis, found.wearers)
    actuator = actuator_card(study.name, recordings)
    if actuator is not None:
        made[actuator.name] = actuator
    return replace(found, cards={**found.cards, **made})


def identify_worn(
    config: StudyFile, recordings: Sequence[Recording], *, tell: Progress = quiet
) -> CouplingResult:
    """Identify a study from recordings in memory; `config` has the table [coupling]."""
    asked = config.table(CouplingTable)
    trials = _Trials(recordings)
    tell("the orthosis alone", 0.0)
    trials.learn_range()
    orthosis = fit_orthosis(
        [trials.actuator(r) for r in trials.fitted("gravity_holds")],
        [trials.actuator(r) for r in trials.fitted("sine_tracking")],
        [trials.actuator(r) for r in trials.of("sine_tracking", use="validate")],
    )
    wearers: dict[str, WearerStages] = {}
    refused: dict[str, str] = {}
    everyone = trials.participants()
    for i, who in enumerate(everyone):
        tell(who, 0.2 + 0.75 * i / len(everyone))
        try:
            wearers[who] = _wearer(trials, who, orthosis, asked, config.participants.get(who))
        except PellucidError as error:
            refused[who] = str(error)
    if not wearers:
        raise IdentificationError(
            "no participant's strap can be identified:\n" + ("\n".join(refused.values()) or "no free_swing is recorded")
        )
    tell("writing down", 0.95)
    checksums = {r.name: r.checksum for r in trials.recordings}
    people = {r.name: r.participant for r in trials.recordings}
    return coupling_result(config.name, orthosis, wearers, refused, trials.notes, checksums, people, asked.confidence)


def faults(study: Study) -> list[Fault]:
    """Return the faults of the recordings of a study with [coupling], and notes on corrections."""
    asked = study.table(CouplingTable)
    found: list[Fault] = []

    def add(severity: str, kind: str, r: Recording, channel: str, text: str) -> None:
        where = f"{r.path.name} (recording {r.name})"
        message = text if text.startswith(r.path.stem) else f"{where}: {text}"
        fault = Fault(severity, kind, r.path.name, channel, text, "a trial as its protocol has it", message)
        found.append(warn_if_held_out(fault, r.use))

    trials = _Trials(study.recordings())
    with suppress(PellucidError):  # told below, where the recording's turn comes
        trials.learn_range()
    for r in trials.recordings:
        if r.protocol not in RECORDING_PROTOCOLS:
            continue
        try:
            # Torque steps may be held at any angle.
            record = trials.actuator(r)
            if r.protocol in ("relaxed_holds", "free_swing"):
                trials.require_range(r, record)
        except PellucidError as error:
            add("refuse", "magnitude", r, "position", str(error))
        if r.protocol in ("imu_on_orthosis", "free_swing"):
            try:
                trials.imu(r, asked)
            except PellucidError as error:
                add("refuse", "gap", r, asked.imu, str(error))
    for name, text in trials.notes.items():
        add("note", "wrap", next(r for r in trials.recordings if r.name == name), "position", text)
    for who in trials.participants():
        for name, text in _not_relaxed(trials, who, asked).items():
            add("refuse", "not_relaxed", next(r for r in trials.recordings if r.name == name), asked.emg, text)
    return found


class _Trials:
    """A study's recordings by protocol and participant, prepared on request."""

    def __init__(self, recordings: Sequence[Recording]):
        self.recordings = tuple(recordings)
        self.notes: dict[str, str] = {}
        self.low, self.high = -np.inf, np.inf

    def of(self, protocol: str, participant: str | None = None, use: str | None = None) -> list[Recording]:
        return [
            r
            for r in self.recordings
            if r.protocol == protocol and r.participant == participant and use in (None, r.use)
        ]

    def fitted(self, protocol: str, participant: str | None = None) -> list[Recording]:
        """Return the recordings that may reach a fit or a scale."""
        return self.of(protocol, participant, "fit")

    def participants(self) -> list[str]:
        return list(dict.fromkeys(r.participant for r in self.recordings if r.participant is not None))

    def actuator(self, recording: Recording) -> InputOutput:
        """Return torque (input) and unwrapped angle (output) of a recording."""
        made = input_output(recording, ORTHOSIS_CHANNELS)
        undone = unwrap(made.output)
        remarks = [undone.said("position", made.time).rstrip("."), *made.notes]
        if any(remarks):
            self.notes[recording.name] = "; ".join(filter(None, remarks))
        # Angles that differ by whole turns are the same hanging angle.
        turns = np.round(np.median(undone.angle) / (2.0 * np.pi))
        return replace(made, output=undone.angle - 2.0 * np.pi * turns)

    def learn_range(self) -> None:
        """Set the range of angles over which the orthosis is identified."""
        alone = [self.actuator(r).output for r in (*self.fitted("gravity_holds"), *self.fitted("sine_tracking"))]
        if alone:
            self.low, self.high = (float(f([f(q) for q in alone])) for f in (min, max))

    def worn(self, recording: Recording) -> InputOutput:
        """Return the actuator's record of a trial with a wearer; fitted ones stay in the identified range of angles."""
        record = self.actuator(recording)
        if recording.use == "fit":
            self.require_range(recording, record)
        return record

    def require_range(self, recording: Recording, record: InputOutput) -> None:
        """Refuse angles outside the range in which the orthosis is identified alone."""
        low, high = float(record.output.min()), float(record.output.max())
        if low < self.low - MAX_RANGE_EXCESS_RAD or high > self.high + MAX_RANGE_EXCESS_RAD:
            raise IdentificationError(
                f"{recording.path.name} (recording {recording.name}), channel position: found {np.degrees(low):.0f} to "
                f"{np.degrees(high):.0f} deg, expected angles near those at which the orthosis was identified, "
                f"{np.degrees(self.low):.0f} to {np.degrees(self.high):.0f} deg: the encoder's zero has moved"
            )

    def imu(self, recording: Recording, asked: CouplingTable):
        stream = recording.stream(asked.imu)
        return inertial(stream, "imu", magnetometer=asked.magnetometer)


def _wearer(
    trials: _Trials, who: str, orthosis: OrthosisFit, asked: CouplingTable, participant: Participant | None
) -> WearerStages:
    """Run all stages for one participant."""
    chosen = {"method": asked.orientation, "axes": 9 if asked.magnetometer else 6}
    notes: list[str] = []
    calibration = None
    for recording in trials.fitted("imu_on_orthosis", who):
        calibration = calibrate_imu(trials.imu(recording, asked), trials.actuator(recording), **chosen)
    limb, muscles = None, None
    working = _not_relaxed(trials, who, asked, use="fit")
    try:
        relaxed = [trials.worn(r) for r in trials.fitted("relaxed_holds", who)]
        limb = fit_limb(relaxed, orthosis.gravity, _segments(participant), at_work=working)
        muscles = _muscles(trials, who, asked, orthosis.gravity.gravity.value + limb.gravity.value)
    except PellucidError as error:
        notes.append(str(error))
    swings, dropped, turning = [], {}, None
    for recording in trials.of("free_swing", who):
        try:
            swing, axis = _swing(trials, recording, asked, muscles, chosen)
            swings.append(swing)
            # Held-out swings must not reach the angles of held torques, which are fitted.
            turning = axis if recording.use == "fit" else turning
        except PellucidError as error:
            dropped[recording.name] = str(error)
    if not swings:
        raise IdentificationError(f"{who}: no free swing can be used: " + ("; ".join(dropped.values()) or "none found"))
    known = limb.limb if limb is not None and np.isfinite(limb.inertia.value) else None
    sd = calibration.sd if calibration is not None else float("nan")
    posterior_options = {"posterior": asked.posterior, "level": asked.confidence}
    steps = _held_trials(trials, who, asked, turning, chosen)
    coupling = identify_wearer(who, swings, orthosis.orthosis, limb=known, imu_sd=sd, steps=steps, **posterior_options)
    return WearerStages(calibration, limb, muscles, coupling, working, dropped, tuple(notes))


def _swing(
    trials: _Trials, recording: Recording, asked: CouplingTable, muscles: MuscleTorque | None, chosen: Mapping
) -> tuple[StrappedSwing, JointAxis]:
    record, imu = trials.worn(recording), trials.imu(recording, asked)
    turning = find_joint_axis(imu, record)
    torque = None
    if muscles is not None and asked.emg in recording.streams:
        torque = muscles(_at(recording.stream(asked.emg), emg_chain(EMG_CHAIN_NAME), record.time), record.output)
    return _strapped(recording, record, *limb_angle_by_imu(imu, turning, **chosen), torque), turning


def _strapped(recording: Recording, record: InputOutput, time, angle, torque=None) -> StrappedSwing:
    return StrappedSwing(recording.name, record.split, record.time, record.output, record.input, time, angle, torque)


def _held_trials(
    trials: _Trials, who: str, asked: CouplingTable, turning: JointAxis | None, chosen: Mapping
) -> list[StrappedSwing]:
    """Return a few trials with held torques, which show relaxation slower than a swing."""
    every = [r for r in trials.fitted("torque_steps", who) if asked.imu in r.streams]
    made: list[StrappedSwing] = []
    if turning is None:
        return made
    for recording in every[:: max(1, len(every) // MAX_HELD_TRIALS)][:MAX_HELD_TRIALS]:
        with suppress(PellucidError):  # swings alone tell the rest
            record = trials.worn(recording)
            time, angle = limb_angle_by_imu(trials.imu(recording, asked), turning, **chosen)
            made.append(_strapped(recording, record, time, angle))
    return made


def _levels(trials: _Trials, who: str, asked: CouplingTable, chain: EmgChain) -> Levels | None:
    maximal = [r.streams[asked.emg] for r in trials.fitted("mvc", who) if asked.emg in r.streams]
    return find_levels(maximal, chain) if maximal else None


def _not_relaxed(trials: _Trials, who: str, asked: CouplingTable, use: str | None = None) -> dict[str, str]:
    """Return the relaxed trials, of a `use` or of all, with active muscles, each with the observation."""
    chain = emg_chain(EMG_CHAIN_NAME)
    recorded = [r for r in trials.of("relaxed_holds", who, use) if asked.emg in r.streams]
    activity: dict[str, str] = {}
    try:
        levels = _levels(trials, who, asked, chain) if recorded else None
    except PellucidError as error:
        return {r.name: str(error) for r in recorded}
    for r in recorded if levels is not None else ():
        try:
            activity[r.name] = at_work(r.streams[asked.emg], chain, levels)
        except PellucidError as error:
            activity[r.name] = str(error)
    return {name: text for name, text in activity.items() if text}


def _muscles(trials: _Trials, who: str, asked: CouplingTable, gravity: float) -> MuscleTorque | None:
    """Fit the plain map from EMG to torque; return None without recordings of EMG and torque."""
    chain = emg_chain(EMG_CHAIN_NAME)
    steps = [r for r in trials.fitted("torque_steps", who) if asked.emg in r.streams]
    levels = _levels(trials, who, asked, chain)
    if not steps or levels is None:
        return None
    records = [trials.actuator(r) for r in steps]
    made = [_at(r.streams[asked.emg], chain, record.time) for r, record in zip(steps, records, strict=True)]
    fs = (len(records[0]) - 1) / float(records[0].time[-1] - records[0].time[0])
    return fit_muscle_torque([r.output for r in records], [r.input for r in records], made, levels, fs, gravity)


def _at(emg: Recording, chain: EmgChain, time: np.ndarray) -> dict[str, np.ndarray]:
    """Return a stream's envelopes at the actuator's times."""
    return {muscle: np.interp(time, emg.time, envelope) for muscle, envelope in envelopes(emg, chain).items()}


def _segments(participant: Participant | None) -> dict[str, Segment]:
    p = participant
    return {} if p is None else known_segments(p.mass, p.height, p.sex, p.shank_length)
