r"""Trials of a torque map from a study's recordings: with recorded moments, or of a wearer against an orthosis.

Constants and geometry of a study's muscles: recorded lengths and moment arms, or those of a model.

Repetitions of a leg extended from sitting without a recorded torque. The reference is computed from the motion.

A shank that hangs at rest and is extended by :math:`\alpha` needs the torque (eq. 12 of the paper `hill`, with the
angle at rest taken for the hanging angle)

.. math::  \frac{\tau}{m g l} = \frac{I}{m g l}\,\ddot\alpha + \sin\alpha

where :math:`I/(m g l)` follows from the shank's length alone by anthropometric shares. The mass is unknown, so the
torque is relative.

What other domains offer to `calibrate`: bodies on which a wearer acts, and evaluations of their own protocols.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...._domains import offered
from ...._errors import IdentificationError, RecordingError
from ...._printed_command import printed_command
from ....files.recording import MAXIMAL_PROTOCOL, Recording
from ....models.anthropometry import shank_length, winter
from ....models.estimates import Verdict
from ....models.parameter_card import ParameterCard, read_parameter_card
from ....numerics.filters import central_difference, zero_phase_lowpass
from ....study.procedures.card_sources import require_fresh
from ....study.study import Study
from ...estimators.torque_trial import (
    FIBRE_DAMPING,
    MOTION_LOWPASS_HZ,
    SEATED_POSTURE_RAD,
    STANDING_POSTURE_RAD,
    MovedBody,
    MuscleSource,
    TorqueTrial,
    leg_constants,
)
from ...models.hill import HillMuscle
from ...models.muscle_geometry import muscle_table
from ...signals.repetitions import find_repetitions
from .emg_torque_table import BODY_CARD_NAMES, EmgTorqueTable
from .relative_envelopes import find_maxima, find_window, is_maximal, is_relative, relative_envelopes
from .study_muscles import find_used_muscles, study_geometry, study_muscles
from .torque_findings import CalibrationFindings


@dataclass(frozen=True)
class PolynomialLimits:
    """RMS errors beyond which a muscle's polynomial is reported as poor.

    Both were chosen by judgement; no measurement is recorded.
    """

    # A muscle's polynomial is reported as poor if the RMS error of its length exceeds this [m]. Chosen by judgement.
    max_length_error_m: float = 1e-3
    # A muscle's polynomial is reported as poor if the RMS error of its moment arm exceeds this [m]. Chosen by
    # judgement.
    max_arm_error_m: float = 2e-3


POLYNOMIAL_LIMITS = PolynomialLimits()


def muscle_source(study: Study, recording: Recording, joint: str) -> MuscleSource | None:
    """Return the source of the muscles across a joint in a recording; None without a geometry of the joint.

    Recorded lengths and moment arms have precedence, then those of the study's own model, then those of the leg model.

    `study` [emg_torque].
    """
    constants = leg_constants()
    for name, found in study_muscles(study).items():
        constants[name] = HillMuscle(
            name, found.optimal_fibre_length, found.tendon_slack_length, found.largest_force, found.pennation,
            damping=FIBRE_DAMPING,
        )  # fmt: skip
    recorded = _recorded_paths(recording, joint)
    model = None if recorded else study_geometry(study)
    paths = muscle_table().geometry if model is None else model.polynomials
    if not recorded and not any(joint in path.angles for path in paths.values()):
        return None
    posture = SEATED_POSTURE_RAD if recording.protocol in ("leg_extension", "seated_swing") else STANDING_POSTURE_RAD
    return MuscleSource(
        constants,
        recorded,
        maximal=is_maximal(study, recording.participant),
        sign=-1.0 if joint == "knee" and study.config.rig.lifts == "flexion" else 1.0,
        relative=is_relative(study),
        polynomials={} if model is None else model.polynomials,
        posture=posture if model is None else {j: model.signs.get(j, 1.0) * q for j, q in posture.items()},
    )


def _recorded_paths(recording: Recording, joint: str) -> dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Return length, rate and moment arm of muscles that have all three among the streams, on the recording's clock."""
    every = {
        name: (stream.time, channel.samples)
        for stream in recording.streams.values()
        for name, channel in stream.channels.items()
    }
    heads = ("length.", "lengthening.", f"moment_arm.{joint}.")
    muscles = [name.removeprefix("length.") for name in every if name.startswith("length.")]
    return {
        muscle: tuple(np.interp(recording.time, *every[head + muscle]) for head in heads)
        for muscle in muscles
        if all(head + muscle in every for head in heads)
    }


def geometry_verdicts(study: Study) -> Iterator[Verdict]:
    """Yield verdicts on the polynomials of the study's own model: their errors, and muscles that were refused."""
    joints = study.table(EmgTorqueTable).joints
    recorded = all(_recorded_paths(r, joint) for r in study.recordings() for joint in joints)
    model = None if recorded else study_geometry(study)
    if model is None:
        return
    far = max(model.polynomials.values(), key=lambda p: p.error.arm)
    held = ", ".join(f"{name} {value:.3g}" for name, value in model.held.items())
    yield Verdict(
        "note",
        f"Polynomials in {', '.join(model.coordinates)} represent the lengths and moment arms of "
        f"{len(model.polynomials)} muscles of {model.source}. Their largest RMS errors on held-out poses are "
        f"{1e3 * max(p.error.length for p in model.polynomials.values()):.2g} mm in length and "
        f"{1e3 * far.error.arm:.2g} mm in moment arm ({far.muscle})"
        + (f"; the model's other coordinates are fixed: {held}." if held else "."),
    )
    limits = POLYNOMIAL_LIMITS
    for name, p in model.polynomials.items():
        if p.error.length > limits.max_length_error_m or p.error.arm > limits.max_arm_error_m:
            yield Verdict(
                "warning",
                f"{model.source}, muscle {name}: the polynomial has an error of {1e3 * p.error.length:.2g} mm in "
                f"length and {1e3 * p.error.arm:.2g} mm in moment arm. The muscle path probably jumps within the "
                "ranges of the coordinates.",
                "Narrow the coordinates' <range> in the model to the recorded range.",
            )
    for why in model.refused.values():
        yield Verdict("warning", f"{model.source}, {why}; the muscle is not used.")


class WornBody(Protocol):
    """A body that the wearer moves."""

    @property
    def words(self) -> str:
        """Sentence that describes the model of the body."""

    def wearer_torque(self, recording: Recording, lowpass: float) -> np.ndarray:
        """Return the wearer's torque about the joint, shape (n,) [N m], low-passed at `lowpass` [Hz]."""


@dataclass(frozen=True)
class TorqueEvaluation:
    """An evaluation of `calibrate` for studies of one protocol."""

    protocol: str
    table: str  # name of the table in study.toml that the protocol needs
    evaluate: Callable[[Study, Callable[[str, float], None]], CalibrationFindings]

    def suits(self, study: Study) -> bool:
        """Return whether a study has the protocol and the table."""
        return study.has_table(self.table) and any(one.protocol == self.protocol for one in study.recordings())


STEP_PROTOCOL = "torque_steps"
"""Protocol in which a wearer counters an orthosis's torque."""


@dataclass(frozen=True)
class TrialClock:
    """How recordings become trials on one clock.

    No measurement is recorded for what is chosen by judgement.
    """

    # Rate to which faster recordings are thinned [Hz]. Envelopes and movements have nothing above half of it.
    kept_rate_hz: float = 100.0
    # Recordings below this rate are interpolated to `kept_rate_hz` [Hz]. Angles are filtered at up to 12 Hz and
    # envelopes looked at 50 ms apart, which a slower clock cannot hold.
    min_rate_hz: float = 50.0
    # Two recordings are at the same held angle if their median angles differ by less than this [rad]. Chosen by
    # judgement.
    angle_tolerance_rad: float = 0.1
    # Duration of the EMG before each repetition that is passed to muscles [s], since their force depends on it
    emg_lead_s: float = 0.3


TRIAL_CLOCK = TrialClock()


def moment_trials(study: Study, joint: str, *, causal: bool = False) -> list[TorqueTrial]:
    """Return the recordings with joint moments as trials. `causal`: raw EMG is filtered forwards only.

    EMG is filtered with the samples around the recording's window. The reference torque is filtered within the window
    alone, so that no test sample influences a fitted one.

    `study` [emg_torque].
    """
    spec = study.table(EmgTorqueTable)
    found = [
        r
        for r in study.recordings()
        if f"moment.{joint}" in r.stream_or_self(spec.moments) and r.protocol != MAXIMAL_PROTOCOL
    ]
    fitted = [r for r in found if r.use == "fit"]
    top = {
        person: find_maxima(study, person, [r for r in fitted if r.participant == person] or fitted)
        for person in dict.fromkeys(r.participant for r in found)
    }
    trials = []
    for recording in map(_at_trial_rate, found):
        channel = f"moment.{joint}"
        moments = recording.stream_or_self(spec.moments)
        inside = find_window(moments, recording, channel)
        time, torque = moments.time[inside], moments[channel][inside]
        if spec.reference_lowpass is not None:
            torque = zero_phase_lowpass(torque, spec.reference_lowpass, 4, moments.fs)
        unit = moments.channels[channel].unit
        if unit == "MVC" and joint in spec.largest_moment:
            torque, unit = spec.largest_moment[joint] * torque, "N*m"
        if unit != (trials[0].unit if trials else unit):
            raise RecordingError(
                f"{moments.path.name} (recording {recording.name}), channel {channel}: found the unit {unit}, expected "
                f"{trials[0].unit} as in the recording {trials[0].name}"
            )
        angles = {n.removeprefix("angle."): recording[n] for n in recording.channels if n.startswith("angle.")}
        envelopes = relative_envelopes(study, recording, top[recording.participant], causal=causal)
        torque = np.interp(recording.time, time, torque)
        trials.append(
            _make_trial(
                study, recording, joint, slice(None), envelopes, angles, torque, group=recording.trial, unit=unit,
                heldout=recording.use != "fit", lead=_lead_envelopes(study, recording),
            )
        )  # fmt: skip
    return [_thin_trial(trial) for trial in trials]


def _make_trial(
    study: Study,
    recording: Recording,
    joint: str,
    part: slice,
    envelopes: Mapping[str, np.ndarray],
    angles: Mapping[str, np.ndarray],
    torque: np.ndarray,
    **others: Any,
) -> TorqueTrial:
    """Return a `part` of a recording's samples as a trial; `others` are further fields of it."""
    known = {"name": recording.name, "participant": recording.participant, "checksum": recording.checksum,
             "muscles": muscle_source(study, recording, joint), "piece_of": recording.piece_of}  # fmt: skip
    return TorqueTrial(
        joint=joint, time=recording.time[part], torque=torque[part],
        envelopes={muscle: x[part] for muscle, x in envelopes.items()},
        angles={name: q[part] for name, q in angles.items()}, **{**known, **others},
    )  # fmt: skip


def _at_trial_rate(recording: Recording) -> Recording:
    """Return a recording whose own clock is even and at least `TRIAL_CLOCK.min_rate_hz`, interpolated if it is not.

    Short gaps were left in it, over which angles and moments are interpolated. Interpolation keeps the shape of an
    angle between its samples: it never overshoots.
    """
    if recording.fs >= TRIAL_CLOCK.min_rate_hz and recording.steps_within(recording.longest_step):
        return recording
    old = recording.time
    rate = max(recording.fs, TRIAL_CLOCK.kept_rate_hz)
    time = old[0] + np.arange(int((old[-1] - old[0]) * rate) + 1) / rate
    channels = {
        name: replace(each, samples=time if name == "time" else PchipInterpolator(old, each.samples)(time))
        for name, each in recording.channels.items()
    }
    return replace(recording, channels=channels)


def _thin_trial(trial: TorqueTrial) -> TorqueTrial:
    """Thin a trial at the rate of raw EMG to about `TRIAL_CLOCK.kept_rate_hz`, with a low-pass against aliasing."""
    every = round(trial.fs / TRIAL_CLOCK.kept_rate_hz)
    if every < 2:
        return trial

    def slow(x: np.ndarray) -> np.ndarray:
        return zero_phase_lowpass(x, 0.4 * trial.fs / every, 4, trial.fs)[::every]

    source = trial.muscles
    if source is not None and source.recorded:
        recorded = {muscle: tuple(x[::every] for x in path) for muscle, path in source.recorded.items()}
        source = replace(source, recorded=recorded)
    return replace(
        trial,
        time=trial.time[::every],
        envelopes={muscle: np.maximum(slow(x), 0.0) for muscle, x in trial.envelopes.items()},
        angles={joint: q[::every] for joint, q in trial.angles.items()},
        torque=slow(trial.torque),
        lead={muscle: x[::-1][every - 1 :: every][::-1] for muscle, x in trial.lead.items()},
        muscles=source,
    )


def step_trials(
    study: Study,
    participant: str | None,
    body: WornBody,
    *,
    causal: bool = False,
    joint: str = "knee",
) -> list[TorqueTrial]:
    """Return the recordings in which a wearer counters an orthosis's torque as trials, grouped by repetition.

    `study` [emg_torque].
    """
    spec = study.table(EmgTorqueTable)
    own = [r for r in study.recordings() if r.participant == participant]
    found = [r for r in own if r.protocol == STEP_PROTOCOL]
    top = find_maxima(study, participant, found)
    lowpass, repetition = spec.reference_lowpass or MOTION_LOWPASS_HZ, number_repetitions(found)
    trials = []
    for recording in found:
        torque = body.wearer_torque(recording, lowpass)
        envelopes = relative_envelopes(study, recording, top, causal=causal)
        every = slice(None, None, max(1, round(recording.fs / TRIAL_CLOCK.kept_rate_hz)))
        angles, group = {joint: recording["position"]}, str(repetition[recording.name])
        trials.append(_make_trial(study, recording, joint, every, envelopes, angles, torque, group=group))
    return trials


def number_repetitions(recordings: Sequence[Recording]) -> dict[str, int]:
    """Return the repetition of each recording: as study.toml says, or the number of recordings so far at its angle."""
    angles: dict[str, float] = {}  # by trial: pieces of one recording are of one repetition
    made: dict[str, int] = {}
    for recording in recordings:
        angle = float(np.nanmedian(recording["position"]))
        earlier = sum(
            abs(angle - a) < TRIAL_CLOCK.angle_tolerance_rad for t, a in angles.items() if t != recording.trial
        )
        made[recording.name] = recording.repetition or earlier + 1
        angles.setdefault(recording.trial, angle)
    return made


def moved_body(study: Study, participant: str | None) -> WornBody:
    """Return limb and orthosis from the cards that `identify` wrote, with the strap between them if there is a card.

    Without a strap's card, limb and orthosis are one body.
    """
    read = {path: read_parameter_card(path) for path in study.cards() if path.stem.split(".")[-1] in BODY_CARD_NAMES}
    orthosis = [c for c in read.values() if c.kind == "orthosis"]
    own = [c for c in read.values() if participant in (None, c.settings.get("participant"))]
    limbs = [c for c in own if c.kind == "limb"]
    if not orthosis or not limbs:
        lacking = "an orthosis" if not orthosis else f"the limb of {participant}"
        raise IdentificationError(
            f"{study.models_dir}: found the cards {', '.join(p.stem for p in read) or 'of no body'}, expected one of "
            f"{lacking}, which is needed to compute the wearer's torque. Run: "
            f"{printed_command('identify', study.folder)}"
        )
    strapped = next(
        (found for of in offered("WORN_BODIES") if (found := of(orthosis[0], limbs[0], own)) is not None), None
    )
    used = (orthosis[0], limbs[0]) if strapped is None else (orthosis[0], limbs[0], strapped[1])
    for path, card in read.items():
        if any(card is each for each in used):
            require_fresh(study, path, card)
    return body_of_card(orthosis[0]) + body_of_card(limbs[0]) if strapped is None else strapped[0]


def body_of_card(card: ParameterCard) -> MovedBody:
    """Return the body that a card describes."""
    values = {name.removeprefix(f"{card.kind}_"): value for name, value in card.values.items()}
    return MovedBody(
        values["gravity"],
        values.get("inertia", 0.0),
        values.get("damping", 0.0),
        float(card.settings.get("zero", 0.0)),
        float(card.settings.get("torque_offset", 0.0)),
    )


def _lead_envelopes(study: Study, recording: Recording) -> dict[str, np.ndarray]:
    """Return envelopes before the recording's first sample, if they were recorded and the recording is not a window."""
    stream = recording.stream_or_self(study.table(EmgTorqueTable).emg)
    spec = study.config.entry_of(recording.name)
    count = int((recording.time[0] - stream.time[0]) * recording.fs)
    if study.table(EmgTorqueTable).chain != "none" or (spec is not None and spec.window is not None) or count < 1:
        return {}
    time = recording.time[0] - np.arange(count, 0, -1) / recording.fs
    return {
        muscle: np.interp(time, stream.time, stream[f"emg.{muscle}"]) for muscle in find_used_muscles(study, stream)
    }


EXTENSION_PROTOCOL = "leg_extension"
"""Protocol in which a sitting person extends the leg, again and again."""

DEFAULT_MASS_AND_HEIGHT = (70.0, 1.7)
"""Mass [kg] and height [m] of a person without a stated body. Height sets I/(m g l); mass sets a unit that cancels."""


def leg_extension_trials(study: Study, participant: str | None) -> tuple[list[TorqueTrial], float]:
    """Return one person's repetitions, each a trial and a group of its own, and the weight torque of the leg [N m].

    `study` [emg_torque].
    """
    own = [r for r in study.recordings() if r.participant == participant]
    found = [r for r in own if r.protocol == EXTENSION_PROTOCOL]
    person = study.config.participants.get(participant) if participant else None
    mass = getattr(person, "mass", None) or DEFAULT_MASS_AND_HEIGHT[0]
    height = getattr(person, "height", None) or DEFAULT_MASS_AND_HEIGHT[1]
    leg = winter(mass, shank_length(height))
    sign = 1.0 if study.config.rig.lifts == "flexion" else -1.0
    top = find_maxima(study, participant, found)
    trials = []
    for recording in found:
        where = f"{recording.path.name} (recording {recording.name}), channel angle.knee"
        repetitions = find_repetitions(recording["angle.knee"], recording.fs, where=where)
        angle = zero_phase_lowpass(recording["angle.knee"], MOTION_LOWPASS_HZ, 4, recording.fs)
        extension = -sign * (angle - repetitions.rest)
        acceleration = central_difference(central_difference(extension, recording.fs), recording.fs)
        torque = -sign * (leg.inertia * acceleration + leg.gravity() * np.sin(extension))
        flexion = sign * (0.5 * np.pi - extension)
        envelopes = relative_envelopes(study, recording, top, causal=False)
        every = max(1, round(recording.fs / TRIAL_CLOCK.kept_rate_hz))
        reach = round(TRIAL_CLOCK.emg_lead_s * recording.fs)
        for i, repetition in enumerate(repetitions.each, start=1):
            kept = slice(repetition.start, repetition.end, every)
            ahead = np.arange(repetition.start - every, max(repetition.start - reach, -1), -every)[::-1]
            name = f"{recording.name}_{i}"
            lead = {muscle: x[ahead] for muscle, x in envelopes.items()} if len(ahead) else {}
            trials.append(
                _make_trial(
                    study, recording, "knee", kept, envelopes, {"knee": flexion}, torque, name=name, group=name,
                    lead=lead, piece_of="",
                )
            )  # fmt: skip
    return trials, leg.gravity()
