"""Trials of a torque map from a study's recordings: moments known from elsewhere, or the wearer against an orthosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..._errors import IdentificationError, RecordingError
from ...estimators.features import MOTION_LOWPASS
from ...estimators.strapped_reference import StrappedBodies, strapped_torque
from ...estimators.torque_reference import MovedBody, human_torque
from ...estimators.torque_trial import TorqueTrial
from ...fit.strap.strap_model import PLAIN, StrapModel
from ...fit.strap.strap_torque import Limb, Orthosis
from ...models.parameter_card import ParameterCard, read_parameter_card
from ...recordings.recording import Recording
from ...recordings.study import Study
from ...signals.emg_chain import EmgChain, emg_chain
from ...signals.filters import zero_phase_lowpass
from .emg_faults import trial_faults
from .known_muscles import muscle_source

STEPS = "torque_steps"
"""Protocol in which a wearer counteracts an orthosis's torque."""

KEPT_RATE = 100.0
"""Rate at which samples of torque steps are kept [Hz]; nothing in them is faster than the low-pass on the torque."""

SAME_ANGLE = 0.1
"""Medians that are no further apart [rad] are of the same angle held."""


def moment_trials(study: Study, joint: str) -> list[TorqueTrial]:
    """Recordings whose joint moments were found by inverse dynamics.

    Whatever is filtered is cut to the recording's window first: nothing beyond its ends is seen.

    `study` [emg_torque].
    """
    spec = study.config.emg_torque
    found = [r for r in study.recordings() if f"moment.{joint}" in _stream(r, spec.moments)]
    top = maxima_of(study, [r for r in found if r.use == "fit"])
    trials = []
    for recording in found:
        channel = f"moment.{joint}"
        moments = _stream(recording, spec.moments)
        inside = _inside(moments, recording, channel)
        time, torque = moments.time[inside], moments[channel][inside]
        if spec.reference_lowpass is not None:
            torque = zero_phase_lowpass(torque, spec.reference_lowpass, 4, moments.fs)
        angles = {n.removeprefix("angle."): recording[n] for n in recording.channels if n.startswith("angle.")}
        trials.append(
            TorqueTrial(
                name=recording.name,
                joint=joint,
                time=recording.time,
                envelopes=relative_envelopes(study, recording, top, causal=False),
                angles=angles,
                torque=np.interp(recording.time, time, torque),
                group=recording.name,
                heldout=recording.use != "fit",
                participant=recording.participant,
                checksum=recording.checksum,
                muscles=muscle_source(study, recording, joint),
                lead=_lead(study, recording),
            )
        )
    return trials


def step_trials(
    study: Study,
    participant: str | None,
    body: MovedBody | StrappedBodies,
    *,
    causal: bool = False,
    joint: str = "knee",
) -> list[TorqueTrial]:
    """Recordings in which a wearer counteracts an orthosis's torque, grouped by repetition. `study` [emg_torque]."""
    spec = study.config.emg_torque
    own = [r for r in study.recordings() if r.participant == participant]
    found = [r for r in own if r.protocol == STEPS]
    top = maxima_of(study, [r for r in own if r.protocol == "mvc"] or found)
    lowpass, repetition = spec.reference_lowpass or MOTION_LOWPASS, repetitions(found)
    trials = []
    for recording in found:
        torque = _wearer_torque(recording, body, lowpass)
        envelopes = relative_envelopes(study, recording, top, causal=causal)
        every = slice(None, None, max(1, round(recording.fs / KEPT_RATE)))
        trials.append(
            TorqueTrial(
                name=recording.name,
                joint=joint,
                time=recording.time[every],
                envelopes={muscle: x[every] for muscle, x in envelopes.items()},
                angles={joint: recording["position"][every]},
                torque=torque[every],
                group=str(repetition[recording.name]),
                participant=participant,
                checksum=recording.checksum,
                muscles=muscle_source(study, recording, joint),
            )
        )
    return trials


def repetitions(recordings: Sequence[Recording]) -> dict[str, int]:
    """Which repetition each recording is: as study.toml says, else the n-th in its order at the same angle."""
    angles, made = [], {}
    for recording in recordings:
        angle = float(np.nanmedian(recording["position"]))
        earlier = sum(abs(angle - other) < SAME_ANGLE for other in angles)
        made[recording.name] = recording.repetition or earlier + 1
        angles.append(angle)
    return made


def _wearer_torque(recording: Recording, body: MovedBody | StrappedBodies, lowpass: float) -> np.ndarray:
    position, torque = recording["position"], recording["torque"]
    if isinstance(body, MovedBody):
        return human_torque(position, torque, body, lowpass=lowpass, fs=recording.fs)
    return strapped_torque(
        recording.time, position, torque, orthosis=body.orthosis, limb=body.limb, strap=body.strap, lowpass=lowpass
    )


def moved_body(study: Study, participant: str | None) -> MovedBody | StrappedBodies:
    """Limb and orthosis from the cards that `identify` wrote: apart where it found their strap, else as one."""
    read = {
        path.stem: read_parameter_card(path)
        for path in study.cards()
        if path.stem.split(".")[-1] in ("orthosis", "limb", "coupling", "strap")
    }
    orthosis = [c for c in read.values() if c.kind == "orthosis"]
    own = [c for c in read.values() if participant in (None, c.settings.get("participant"))]
    limbs = [c for c in own if c.kind == "limb"]
    straps = [c for kind in ("strap", "coupling") for c in own if c.kind == kind]
    if not orthosis or not limbs:
        lacking = "an orthosis" if not orthosis else f"the limb of {participant}"
        raise IdentificationError(
            f"{study.models_dir}: found the cards {', '.join(read) or 'of no body'}, expected one of {lacking}: the "
            f"torque of the wearer needs what is moved; use: pellucid identify {study.folder}"
        )
    bodies = _body(orthosis[0]), _body(limbs[0])
    if not straps:
        return bodies[0] + bodies[1]
    robot, limb = bodies
    model = StrapModel.named(str(straps[0].settings.get("model", PLAIN)))
    return StrappedBodies(
        Orthosis(
            robot.inertia, robot.viscous, robot.gravity, orthosis[0].values.get("coulomb", 0.0), zero=robot.zero,
            offset=robot.offset,
        ),
        Limb(limb.inertia, limb.gravity, limb.viscous, zero=limb.zero),
        model,
        model.core(straps[0].values),
    )  # fmt: skip


def _body(card: ParameterCard) -> MovedBody:
    values = {name.removeprefix(f"{card.kind}_"): value for name, value in card.values.items()}
    return MovedBody(
        values["gravity"],
        values.get("inertia", 0.0),
        values.get("damping", 0.0),
        float(card.settings.get("zero", 0.0)),
        float(card.settings.get("torque_offset", 0.0)),
    )


def _stream(recording: Recording, name: str) -> Recording:
    return recording.streams.get(name, recording)


def _inside(stream: Recording, recording: Recording, channel: str) -> np.ndarray:
    """The stream's samples within the recording's window; it must have recorded all of it."""
    start, end, step = recording.time[0], recording.time[-1], 1.0 / stream.fs
    if stream.time[0] > start + 1.5 * step or stream.time[-1] < end - 1.5 * step:
        raise RecordingError(
            f"{stream.path.name} (recording {recording.name}), channel {channel}: found samples from "
            f"{stream.time[0]:.4g} s to {stream.time[-1]:.4g} s, expected {start:.4g} s to {end:.4g} s as in "
            f"{recording.path.name}"
        )
    return (stream.time > start - 0.5 * step) & (stream.time < end + 0.5 * step)


def _muscles(study: Study, stream: Recording) -> list[str]:
    wanted = study.config.emg_torque.muscles
    present = [name.removeprefix("emg.") for name in stream.channels if name.startswith("emg.")]
    missing = [m for m in wanted if m not in present]
    if missing or not present:
        raise RecordingError(
            f"{stream.path.name} (recording {stream.name}): found EMG of {', '.join(present) or 'no muscle'}, expected "
            f"{', '.join(missing) or 'channels emg.<muscle>'}"
        )
    return list(wanted) or present


def _chain(study: Study) -> EmgChain | None:
    name = study.config.emg_torque.chain
    return None if name == "none" else emg_chain(name)


def relative_envelopes(
    study: Study, recording: Recording, top: Mapping[str, float], *, causal: bool
) -> dict[str, np.ndarray]:
    """Envelopes on the recording's clock, refused where EMG is not fit to be used. `study` [emg_torque]; gives (n,)."""
    stream, chain = _stream(recording, study.config.emg_torque.emg), _chain(study)
    # A stream that ends early is refused below, muscle by muscle.
    faults = [fault.message for fault in trial_faults(recording, stream, whole=False) if fault.severity == "refuse"]
    if faults:
        raise RecordingError("\n".join(faults))
    made = {}
    for muscle in _muscles(study, stream):
        channel = f"emg.{muscle}"
        inside = _inside(stream, recording, channel)
        x = stream[channel][inside]
        if chain is not None:
            if stream.channels[channel].unit != "V":
                raise RecordingError(
                    f"{stream.path.name} (recording {recording.name}), channel {channel}: found the unit "
                    f'{stream.channels[channel].unit}, expected V for the chain {chain.name}; use chain = "none" '
                    "where envelopes were recorded"
                )
            chain.require_rate(stream.fs, f"{stream.path.name} (recording {recording.name}), channel {channel}")
            x = (chain.causal if causal else chain.zero_phase)(x, stream.fs, maximum=top.get(muscle, 1.0))
        made[muscle] = np.interp(recording.time, stream.time[inside], x)
    return made


def _lead(study: Study, recording: Recording) -> dict[str, np.ndarray]:
    """Envelopes before the recording's first sample, where envelopes were recorded and the recording is no window."""
    stream = _stream(recording, study.config.emg_torque.emg)
    spec = next(each for each in study.config.recordings if each.name == recording.name)
    count = int((recording.time[0] - stream.time[0]) * recording.fs)
    if study.config.emg_torque.chain != "none" or spec.window is not None or count < 1:
        return {}
    time = recording.time[0] - np.arange(count, 0, -1) / recording.fs
    return {muscle: np.interp(time, stream.time, stream[f"emg.{muscle}"]) for muscle in _muscles(study, stream)}


def maxima_of(study: Study, recordings: Sequence[Recording]) -> dict[str, float]:
    """Largest envelope of each muscle, where the chain makes envelopes relative."""
    chain = _chain(study)
    if chain is None or not any(stage.kind == "normalise" for stage in chain.stages):
        return {}
    top: dict[str, float] = {}
    for recording in recordings:
        for muscle, envelope in relative_envelopes(study, recording, {}, causal=False).items():
            top[muscle] = max(top.get(muscle, 0.0), float(envelope.max()))
    return top
