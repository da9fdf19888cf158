"""What makes trials unfit for muscles: each refused by trial and channel, with what was found and expected."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .._errors import RecordingError
from .torque_trial import TorqueTrial

NEGATIVE = 0.1
"""Of the largest value: an envelope further below 0 is none. Low-passes undershoot by a few percent."""

DEGREES = 2.0 * np.pi
"""No joint bends further than this [rad]."""

SILENT = 5e-3
"""Of a maximal contraction: an envelope that never rises above this is no muscle's."""

AGAINST = 0.3
"""Correlation with the torque beyond which muscles pull the wrong way."""

ALIKE = 1e-3
"""Maxima of different files that are closer than this were each made 1."""


def refuse_unfit(trials: Sequence[TorqueTrial]) -> None:
    """Refuse trials that no muscle could have made."""
    for trial in trials:
        for joint, angle in trial.angles.items():
            if np.abs(angle).max() > DEGREES:
                raise RecordingError(
                    f"trial {trial.name}, channel angle.{joint}: found {np.abs(angle).max():.4g} rad, expected at most "
                    f"{DEGREES:.3g} rad; is it in degrees?"
                )
        for muscle, envelope in trial.envelopes.items():
            _refuse_envelope(f"trial {trial.name}, channel emg.{muscle}", envelope)
    _refuse_own_maxima(trials)
    _refuse_swapped(trials)


def _refuse_envelope(where: str, envelope: np.ndarray) -> None:
    top, low = float(envelope.max()), float(envelope.min())
    if low < -NEGATIVE * max(top, -low):
        raise RecordingError(f"{where}: found {low:.3g} in an envelope, expected none below 0; was it rectified?")
    if top > 1.5:
        raise RecordingError(
            f"{where}: found {top:.3g} times the maximum, expected an envelope relative to a maximal contraction"
        )


def _refuse_own_maxima(trials: Sequence[TorqueTrial]) -> None:
    """Silence is that of all trials: a muscle may rest in one."""
    for muscle in trials[0].envelopes:
        tops = [float(t.envelopes[muscle].max()) for t in trials if muscle in t.envelopes]
        if max(tops) < SILENT:
            raise RecordingError(
                f"trials {', '.join(t.name for t in trials)}, channel emg.{muscle}: found at most {max(tops):.2g} of "
                f"the maximum, expected more than {SILENT:g}; is the electrode attached?"
            )
    people = dict.fromkeys(t.participant for t in trials)
    for person in people:
        own = [t for t in trials if t.participant == person]
        files = {t.checksum or t.name: t for t in own}
        if len(files) < 2:
            continue
        tops = np.array([[float(t.envelopes[m].max()) for m in t.envelopes] for t in files.values()])
        if np.all(np.abs(tops - 1.0) < ALIKE):
            raise RecordingError(
                f"trials {', '.join(t.name for t in files.values())}: found a largest envelope of 1 for every muscle "
                "in every trial: each was normalised by its own maximum. Expected one maximum for each muscle of a "
                "participant, or an effort cannot be compared between trials"
            )


def _refuse_swapped(trials: Sequence[TorqueTrial]) -> None:
    """Muscles on either side of the joint, as their moment arms say, against the torque that they should make."""
    sides: dict[bool, list[np.ndarray]] = {True: [], False: []}
    torque = np.concatenate([t.torque for t in trials])
    first = trials[0]
    driven = first.muscles.driven(first.joint, first.envelopes) if first.muscles is not None else {}
    for muscle, channels in driven.items():
        rates = {name: np.zeros(len(first)) for name in first.angles}
        arm = first.muscles.path(muscle, first.joint, first.angles, rates)[2]
        if len(channels) == 1:
            sides[bool(np.mean(arm) > 0.0)].append(np.concatenate([t.envelopes[channels[0]] for t in trials]))
    if not all(sides.values()) or np.std(torque) == 0.0:
        return
    along, against = (float(np.corrcoef(np.mean(sides[side], axis=0), torque)[0, 1]) for side in (True, False))
    if along < -AGAINST and against > AGAINST:
        raise RecordingError(
            f"trials {', '.join(t.name for t in trials)}: found muscles that pull along the {first.joint}'s angle to "
            f"correlate with its torque by {along:.2f}, and those against it by {against:.2f}; expected the other way "
            "round: are flexor and extensor channels swapped?"
        )
