"""What a wearer's compensator is built from: identified cards of both bodies, strap and actuator, and a causal EMG map.

Nothing of the simulation's truth enters: only what its instruments wrote. One number is not identified, the dead time
of the torque loop, which is a property of the actuator's hardware that its maker states: one sample.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from ..._errors import IdentificationError
from ...controllers.coupling import Coupling
from ...controllers.worn import EmgMap
from ...estimators.ridge import Ridge
from ...estimators.strapped_reference import strapped_torque
from ...fit.joint.actuator_residual import actuator_residual
from ...lab.knee.rig import KneeRig
from ...procedures.coupling.identify_coupling import identify_worn
from ...recordings.recording import Recording
from ...signals.filters import zero_phase_lowpass
from .trials import STRAP_ONLY, KneeSession, take

BAND = (30.0, 450.0)
"""Corners of the causal chain before it rectifies [Hz]."""

DEAD_SAMPLES = 1
"""Of the actuator's torque loop, from reading to current, as its maker states."""

MOTION = 6.0
"""Cut-off of the zero-phase low-pass on the torque that the map is fitted to [Hz]."""

SETTLED = 2.0
"""Left out at the start of a recording [s]."""

LOST = 3.0
"""A repetition in which the orthosis ever turns faster was not held, and is left out [rad/s]."""

RATE = 20.0
"""Samples a second that enter the regression: the envelopes have no more."""

PENALTIES = (0.0, 1.0, 10.0, 100.0)
"""Of the ridge regression, among which repetitions left out choose."""


@dataclass(frozen=True)
class EmgSettings:
    """Free constants of the EMG chain."""

    # Of the low-pass after rectification, order 2 [Hz]. At 4 Hz it is 56 ms late, as muscles are some 50 ms.
    corner: float = 4.0
    ceiling: float = 2.0  # Times the largest envelope of the torque steps: what is above is no muscle's [1]
    floor: float = 0.2  # Times the smallest: what is below is none either [1]


@dataclass(frozen=True)
class WearerCard:
    """One wearer in one orthosis."""

    coupling: Coupling  # Orthosis, actuator, strap and limb
    emg: EmgMap  # From raw EMG to torque
    emg_rmse: float  # Of the map, on repetitions that it was not fitted to [N m]


@dataclass(frozen=True, eq=False)
class Step:
    """One recording that EMG maps are fitted to."""

    repetition: str
    # time, position, torque: (n,) [s], [rad]; of the knee, by orthosis, strap and limb as identified [N m].
    time: np.ndarray
    position: np.ndarray
    torque: np.ndarray
    emg_time: np.ndarray  # (k,) [s]
    emg: np.ndarray  # (k, muscles) Raw [V]


@dataclass(frozen=True, eq=False)
class Identified:
    """What was identified of a wearer, and the recordings that EMG maps are fitted to."""

    name: str  # The wearer
    rig: KneeRig  # In which to swing afterwards
    seed: int  # Of the recordings, and of how the instruments sit
    coupling: Coupling  # By the cards of orthosis, limb and strap, and by the actuator's sines
    steps: tuple[Step, ...]

    def card(self, settings: EmgSettings | None = None) -> WearerCard:
        """Everything a controller may know, the EMG chain with some settings."""
        return WearerCard(self.coupling, *emg_map(self.steps, settings or EmgSettings()))


def identify_wearer_of(rig: KneeRig, name: str, seed: int) -> Identified:
    """Record everything that one wearer does, and identify it."""
    taken = take(rig, seed, [name], protocols=(*STRAP_ONLY, "mvc", "torque_steps"))
    return identified(rig, name, seed, taken)


def identified(rig: KneeRig, name: str, seed: int, taken: KneeSession) -> Identified:
    """The same from recordings that are there already."""
    used = [r for r in taken.recordings if r.protocol != "torque_steps"]  # for the EMG map alone
    findings = identify_worn(taken.config, used)
    cards, stages = findings.cards, findings.wearers.get(name)
    if f"{name}.limb" not in cards:
        why = findings.refused.get(name) or "; ".join(stages.notes)
        raise IdentificationError(f"{name}: found no card of limb and strap, expected both: {why}")
    sines = taken.of("sine_tracking", "fit")
    actuator = actuator_card(sines) | {"delay": DEAD_SAMPLES / sines[0].fs}
    coupling = Coupling.of_cards(cards["orthosis"], cards[f"{name}.limb"], cards[f"{name}.coupling"], actuator)
    strap = stages.coupling.orthosis_side

    def step(r: Recording) -> Step:
        emg = r.streams["emg"]
        torque = strapped_torque(
            r.time, r["position"], r["torque"], orthosis=findings.orthosis.orthosis, limb=stages.limb.limb,
            stiffness=strap.stiffness.value, damping=strap.damping.value, lowpass=MOTION,
        )  # fmt: skip
        raw = np.column_stack([emg[channel] for channel in emg.channels if channel.startswith("emg.")])
        return Step(r.name.rsplit("_", 1)[-1], r.time, r["position"], torque, emg.time, raw)

    return Identified(name, rig, seed, coupling, tuple(map(step, taken.of("torque_steps"))))


def actuator_card(sines: Sequence[Recording]) -> dict[str, float]:
    """The actuator's lag and what its torque loop lets through, from recordings of the orthosis alone."""
    channels = ("command", "torque", "position", "motor_position")
    found = actuator_residual([tuple(r[c] for c in channels) for r in sines], sines[0].fs)
    known = {field.name for field in fields(Coupling)}
    return {name: value for name, value in found.items() if name in known}


def emg_map(steps: Sequence[Step], settings: EmgSettings) -> tuple[EmgMap, float]:
    """A causal torque map, linear in envelopes and in envelopes times angle, as the core runs it; gives [N m]."""
    from scipy.signal import butter, sosfilt

    steps = [s for s in steps if np.max(np.abs(np.diff(zero_phase_lowpass(s.position, MOTION, 4, _rate(s.time)))))
             * _rate(s.time) < LOST]  # fmt: skip
    if len({s.repetition for s in steps}) < 2:
        raise IdentificationError("emg_map: found torque steps of fewer than two repetitions held, expected two")
    fs, muscles = _rate(steps[0].emg_time), range(steps[0].emg.shape[1])
    band = butter(2, BAND, "bandpass", fs=fs, output="sos")
    envelope = butter(2, settings.corner, fs=fs, output="sos")
    x, y, levels, repetition = [], [], [], []
    for s in steps:
        level = sosfilt(envelope, np.abs(sosfilt(band, s.emg, axis=0)), axis=0)
        level = np.column_stack([np.interp(s.time, s.emg_time, column) for column in level.T])
        own = _rate(s.time)
        kept = slice(round(SETTLED * own), None, max(1, round(own / RATE)))
        q, e = s.position[kept], level[kept]
        x.append(np.column_stack([q, *(column for m in e.T for column in (m, m * q))]))
        y.append(s.torque[kept])
        levels.append(e)
        repetition += [s.repetition] * len(q)
    x, y, seen, group = np.vstack(x), np.concatenate(y), np.vstack(levels), np.array(repetition)

    def left_out(penalty: float) -> float:
        error = [
            y[group == g] - Ridge(penalty).fit(x[group != g], y[group != g]).predict(x[group == g])
            for g in np.unique(group)
        ]
        return float(np.sqrt(np.mean(np.concatenate(error) ** 2)))

    errors = {penalty: left_out(penalty) for penalty in PENALTIES}
    best = min(errors, key=errors.get)
    terms = list(Ridge(best).fit(x, y).plain([str(i) for i in range(x.shape[1])]).values())
    weights = np.array(terms).reshape(1 + len(muscles), 2)  # 1 and q; then each envelope, and the same times q
    made = EmgMap(
        band,
        envelope,
        weights,
        settings.floor * seen.min(axis=0),
        settings.ceiling * seen.max(axis=0),
        torque_limit=float(np.abs(y).max()),  # more than was ever seen is an electrode that comes off
    )
    return made, errors[best]


def _rate(time: np.ndarray) -> float:
    return (len(time) - 1) / float(time[-1] - time[0])


def mistaken(card: WearerCard, **factors: float) -> WearerCard:
    """A card with some parameters wrong; factors [1]."""
    return replace(card, coupling=card.coupling.scaled(**factors))


def weakened(card: WearerCard, factors: Mapping[int, float]) -> WearerCard:
    """A card whose EMG map takes channels for stronger or weaker than they are: as after new electrodes, or fatigue.

    factors [1].
    """
    weights = card.emg.weights.copy()
    for channel, factor in factors.items():
        weights[1 + channel] *= factor
    return replace(card, emg=replace(card.emg, weights=weights))
