"""One trial of a torque map: envelopes, joint angles and the reference torque on one clock.

Torque that a wearer applies to an orthosis, from the orthosis's own torque and the inertia and weight of both.

With limb and orthosis moving as one, the strap's torque cancels between them:

    tau_k = (I_e + I_k) q'' + (b_e + b_k) q' + G_e sin(q - z_e) + G_k sin(q - z_k) - tau_e

with z the angles at which they hang. Dry friction is omitted, because in a hold it can take any value up to its level.
The wearer counteracts: when holding still at q = 0, tau_k = -tau_e.

Sources of the lengths, moment arms and constants of a trial's muscles, and the EMG that drives each muscle.

Features of a trial for torque maps: envelopes, earlier envelopes, joint angles and their derivatives.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..._errors import IdentificationError, RecordingError
from ...files.recording import Recording
from ...numerics.filters import central_difference, zero_phase_lowpass
from ...numerics.low_pass import butterworth, filter_settled
from ..models.hill import HillMuscle
from ..models.muscle_geometry import MusclePolynomial, muscle_table


@dataclass(frozen=True)
class MovedBody:
    """A body that moves about the joint: limb and orthosis together, or one of them."""

    gravity: float  # Torque of its weight at 90 deg from the angle at which it hangs [N m]
    inertia: float = 0.0  # Moment of inertia [kg m²]
    viscous: float = 0.0  # Viscous friction [N m s/rad]
    zero: float = 0.0  # Angle at which it hangs [rad]
    offset: float = 0.0  # Torque that the spring shows without load [N m]

    def __add__(self, other: MovedBody) -> MovedBody:
        # The sum of two sines of the same angle is one sine.
        pull = self.gravity * np.exp(1j * self.zero) + other.gravity * np.exp(1j * other.zero)
        return MovedBody(
            float(np.abs(pull)),
            self.inertia + other.inertia,
            self.viscous + other.viscous,
            float(np.angle(pull)),
            self.offset + other.offset,
        )

    @property
    def words(self) -> str:
        """Sentence that describes the model of the body."""
        return (
            "Limb and orthosis are modelled as one rigid body, because there is no model card of the strap. A "
            "compliant strap causes an error, since the limb's angle, and so its gravity torque, differs."
        )

    def wearer_torque(self, recording: Recording, lowpass: float) -> np.ndarray:
        """Return the wearer's torque about the joint, shape (n,) [N m], low-passed at `lowpass` [Hz]."""
        return human_torque(recording["position"], recording["torque"], self, lowpass=lowpass, fs=recording.fs)


def human_torque(
    position: np.ndarray, orthosis_torque: np.ndarray, body: MovedBody, *, lowpass: float, fs: float
) -> np.ndarray:
    """Return the wearer's torque about the joint, shape (n,) [N m], positive along `position`.

    `position` [rad] is 0 where the limb hangs. `orthosis_torque` is the torque of the spring on the orthosis [N m].
    `body` is limb and orthosis together. Both signals, shape (n,) at `fs` [Hz], pass a zero-phase low-pass of order 4
    at `lowpass` [Hz].
    """
    q = zero_phase_lowpass(np.asarray(position, float), lowpass, 4, fs)
    v = central_difference(q, fs)
    own = zero_phase_lowpass(np.asarray(orthosis_torque, float), lowpass, 4, fs)
    return (
        body.inertia * central_difference(v, fs)
        + body.viscous * v
        + body.gravity * np.sin(q - body.zero)
        - own
        + body.offset
    )


FIBRE_DAMPING = 0.05
"""Damping of every muscle fibre, in F_0 over v_max l_o.

Published models have 0.01 to 0.1. The value was chosen by cross-validation within fitted trials of walking.
"""

MUSCLE_BY_CHANNEL_ALIAS: Mapping[str, str] = {
    "biceps_femoris": "biceps_femoris_long",
    "lateral_hamstring": "biceps_femoris_long",
    "medial_hamstring": "semitendinosus",
    "gastrocnemius": "gastrocnemius_medialis",
}
"""Muscle under an electrode, by the more general name that an EMG channel may have."""

COMPANION_MUSCLES: Mapping[str, tuple[str, ...]] = {
    "vastus_intermedius": ("vastus_lateralis", "vastus_medialis"),
    "vastus_medialis": ("vastus_lateralis",),
    "vastus_lateralis": ("vastus_medialis",),
    "semitendinosus": ("semimembranosus",),
    "semimembranosus": ("semitendinosus",),
    "biceps_femoris_short": ("biceps_femoris_long",),
    "gastrocnemius_lateralis": ("gastrocnemius_medialis",),
    "gastrocnemius_medialis": ("gastrocnemius_lateralis",),
}
"""Neighbours in the same group, by muscle. Their mean EMG stands in for a muscle without an electrode."""

SEATED_POSTURE_RAD = {"hip": np.radians(85.0), "ankle": 0.0}
"""Angles of joints that were not recorded, for a sitting person [rad], in the geometry's signs."""

STANDING_POSTURE_RAD = {"hip": 0.0, "ankle": 0.0}
"""Angles of joints that were not recorded, for a standing person [rad], in the geometry's signs."""


@dataclass(frozen=True, eq=False)
class MuscleSource:
    """Constants and geometry of the muscles across a joint."""

    constants: Mapping[str, HillMuscle]  # Anatomical constants by muscle
    # Length [m], rate [m/s] and moment arm [m] by muscle, shape (n,) each, if the study has them; empty: from angles
    recorded: Mapping[str, tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=dict, repr=False)
    # Lengths as functions of the study's angles, by muscle, of the study's own model; empty: those of the leg model
    polynomials: Mapping[str, MusclePolynomial] = field(default_factory=dict, repr=False)
    sign: float = 1.0  # -1 if the study's knee angle grows with flexion: the geometry's grows with extension
    # Angles of joints that the trial lacks [rad]
    posture: Mapping[str, float] = field(default_factory=lambda: dict(STANDING_POSTURE_RAD))
    # Whether envelopes are relative to a maximal contraction; False: to the largest one seen, maybe at little effort
    maximal: bool = True
    relative: bool = True  # Whether envelopes are relative at all, and not in V

    def crossing(self, joint: str) -> tuple[str, ...]:
        """Return the names of the muscles across a joint."""
        if self.recorded:
            return tuple(self.recorded)
        paths = self.polynomials or muscle_table().geometry
        return tuple(name for name, path in paths.items() if joint in path.angles)

    def driven(self, joint: str, envelopes: Mapping[str, np.ndarray]) -> dict[str, tuple[str, ...]]:
        """Return the muscles across a joint that some EMG drives, each with the channels whose mean drives it."""
        channels = {MUSCLE_BY_CHANNEL_ALIAS.get(name, name): name for name in envelopes}
        found = {}
        for muscle in self.crossing(joint):
            if muscle not in self.constants:
                continue
            own = (muscle,) if muscle in channels else COMPANION_MUSCLES.get(muscle, ())
            present = tuple(channels[m] for m in own if m in channels)
            if present:
                found[muscle] = present
        return found

    def path(
        self, muscle: str, joint: str, angles: Mapping[str, np.ndarray], rates: Mapping[str, np.ndarray]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return length [m], rate [m/s] and moment arm [m] of `muscle`, each of shape (n,).

        `angles` [rad] and `rates` [rad/s] by joint are in the study's signs. The arm about `joint` is positive if the
        muscle pulls along the study's positive angle.
        """
        if muscle in self.recorded:
            return self.recorded[muscle]
        geometry, count = (self.polynomials or muscle_table().geometry)[muscle], len(next(iter(angles.values())))
        turned = self.sign if not self.polynomials else 1.0
        signs = {name: turned if name == "knee" else 1.0 for name in geometry.angles}
        q = {
            name: signs[name] * angles[name] if name in angles else np.full(count, self.posture.get(name, 0.0))
            for name in geometry.angles
        }
        v = {name: signs[name] * rates[name] if name in rates else np.zeros(count) for name in geometry.angles}
        arms = {name: geometry.moment_arm(name, q) for name in geometry.angles}
        rate = -sum(arms[name] * v[name] for name in geometry.angles)
        return geometry.length(q), rate, signs.get(joint, 1.0) * arms.get(joint, np.zeros(count))


@dataclass(frozen=True, eq=False)
class TorqueTrial:
    """A trial that a torque map is fitted to or scored on."""

    name: str  # Name of the recording
    joint: str  # Joint of the torque
    time: np.ndarray  # Time, shape (n,) [s]
    envelopes: Mapping[str, np.ndarray] = field(repr=False)  # Envelopes by muscle, shape (n,) each: relative [1] or [V]
    # Angles by joint, shape (n,) each [rad]; the joint itself must be among them, the others are its neighbours
    angles: Mapping[str, np.ndarray] = field(repr=False)
    torque: np.ndarray = field(repr=False)  # Reference torque, shape (n,), in `unit`
    group: str = ""  # Repetition; trials of one repetition are left out together in cross-validation
    heldout: bool = False  # Whether the trial is held out and never fitted
    participant: str | None = None
    checksum: str = ""  # SHA-256 of the file
    # Source of the muscles' lengths, moment arms and constants; None if they are not known
    muscles: MuscleSource | None = field(default=None, repr=False)
    # Envelopes of the same muscles before the first sample, at the same rate, shape (k,) each; empty if there are none
    lead: Mapping[str, np.ndarray] = field(default_factory=dict, repr=False)
    unit: str = "N*m"  # Unit of the torque; "MVC": shares of a maximal contraction
    piece_of: str = ""  # Name of the recording that the trial is a piece of, between two cuts; "" for a whole one

    def __post_init__(self):
        if self.joint not in self.angles:
            raise RecordingError(
                f"recording {self.name}: found the angles {', '.join(self.angles) or 'of no joint'}, expected the "
                f"{self.joint}'s own among them"
            )
        named = {"torque": self.torque, **{f"emg.{m}": x for m, x in self.envelopes.items()}}
        for name, x in {**named, **{f"angle.{j}": x for j, x in self.angles.items()}}.items():
            if np.shape(x) != np.shape(self.time):
                raise RecordingError(
                    f"recording {self.name}, channel {name}: found shape {np.shape(x)}, expected "
                    f"{np.shape(self.time)} as in time"
                )
            if not np.isfinite(x).all():
                raise RecordingError(
                    f"recording {self.name}, channel {name}: found missing samples (NaN), the first at index "
                    f"{int(np.flatnonzero(~np.isfinite(x))[0])}, expected a number in every sample"
                )

    def __len__(self) -> int:
        return len(self.time)

    @property
    def recording(self) -> str:
        """Name of the whole recording."""
        return self.piece_of or self.name

    @property
    def known_muscles(self) -> MuscleSource:
        """Source of the muscles' lengths, moment arms and constants, of a trial that must have one."""
        if self.muscles is None:
            raise IdentificationError(
                f"trial {self.name}: found no lengths of muscles across the {self.joint}, expected streams length, "
                "lengthening and moment_arm, or a joint of the leg's model"
            )
        return self.muscles

    @property
    def fs(self) -> float:
        """Sampling rate [Hz]."""
        return (len(self.time) - 1) / float(self.time[-1] - self.time[0])


def leg_constants() -> dict[str, HillMuscle]:
    """Return the constants of the leg model's muscles, with damped fibres."""
    return {name: replace(muscle, damping=FIBRE_DAMPING) for name, muscle in muscle_table().constants.items()}


def divide_rows(
    parts: Sequence[np.ndarray],
    groups: Sequence[str],
    joint: str,
    time: np.ndarray,
    envelopes: Mapping[str, np.ndarray],
    angles: Mapping[str, np.ndarray],
    torque: np.ndarray,
    muscles: MuscleSource | None,
) -> list[TorqueTrial]:
    """Return a trial for each part of the rows of some arrays, (n,) each, in its group; None: muscles of the leg."""
    source = MuscleSource(leg_constants()) if muscles is None else muscles
    return [
        TorqueTrial(
            f"rows {rows[0]} to {rows[-1]}", joint, time[rows], {m: x[rows] for m, x in envelopes.items()},
            {j: q[rows] for j, q in angles.items()}, torque[rows], group, muscles=source,
        )
        for rows, group in zip(parts, groups, strict=True)
    ]  # fmt: skip


def group_pieces(trials: Sequence[TorqueTrial]) -> dict[str, list[TorqueTrial]]:
    """Return the pieces of each recording in order, by the recording's name; a whole recording is its only piece."""
    found: dict[str, list[TorqueTrial]] = {}
    for trial in trials:
        found.setdefault(trial.recording, []).append(trial)
    return found


def join_pieces(trials: Sequence[TorqueTrial]) -> list[TorqueTrial]:
    """Return a trial of each recording, with the samples of its pieces one after another.

    It is for statistics of a recording's samples. A filter would run over the cuts between them.
    """
    return [pieces[0] if len(pieces) == 1 else _joined(name, pieces) for name, pieces in group_pieces(trials).items()]


def _joined(name: str, pieces: Sequence[TorqueTrial]) -> TorqueTrial:
    """Return one trial of several pieces, without the source of its muscles, which may hold samples."""
    first = pieces[0]
    return replace(
        first, name=name, piece_of="", muscles=None, time=np.concatenate([p.time for p in pieces]),
        torque=np.concatenate([p.torque for p in pieces]),
        envelopes={m: np.concatenate([p.envelopes[m] for p in pieces]) for m in first.envelopes},
        angles={j: np.concatenate([p.angles[j] for p in pieces]) for j in first.angles},
    )  # fmt: skip


MOTION_LOWPASS_HZ = 6.0
"""Cut-off of the low-pass on joint angles before they are differentiated [Hz]. Gait has little power above it."""

CAUSAL_MOTION_LOWPASS_HZ = 12.0
"""Cut-off of the causal low-pass on joint angles, of order 2 [Hz].

Its delay is 19 ms, where 6 Hz would have 37 ms; in exchange, it passes somewhat more noise.
"""

ENVELOPE_LAGS_S = (0.05, 0.1)
"""Lags of the earlier envelopes among the features [s]. A muscle's force follows its EMG by 10 to 100 ms."""


@dataclass(frozen=True)
class FeatureSet:
    """A set of features that a map uses."""

    # Whether it holds the other joints' angles: muscles cross two joints, and moments pass from one to the next
    neighbours: bool = False
    velocities: bool = False  # Whether it holds the velocity of every joint in it
    accelerations: bool = False  # Whether it holds the acceleration of every joint in it
    lags: tuple[float, ...] = ()  # Lags of the earlier envelopes, beside the present ones [s]
    muscles: bool = True  # Whether it holds EMG; without it, a map shows what motion alone can predict

    def __str__(self) -> str:
        parts = ["EMG"] if self.muscles else []
        parts += ["now and " + " and ".join(f"{1e3 * lag:.0f} ms" for lag in self.lags) + " ago"] if self.lags else []
        parts.append("angles" if self.neighbours else "the joint's angle")
        parts += ["velocities"] if self.velocities else []
        parts += ["accelerations"] if self.accelerations else []
        return ", ".join(parts)


def list_feature_sets(*, neighbours: bool, lags: bool | None = None, muscles: bool = True) -> tuple[FeatureSet, ...]:
    """Return the feature sets to choose from, the smallest first.

    `neighbours`: whether sets with the other joints' angles are among them. `lags`: whether sets hold earlier
    envelopes; None: some do. `muscles`: whether sets hold EMG.
    """
    motions = [{}, {"velocities": True}, {"velocities": True, "accelerations": True}]
    if neighbours:
        motions = [{}, *({"neighbours": True, **motion} for motion in motions)]
    seen = {None: ((), ENVELOPE_LAGS_S), False: ((),), True: (ENVELOPE_LAGS_S,)}[lags if muscles else False]
    return tuple(FeatureSet(**motion, lags=each, muscles=muscles) for each in seen for motion in motions)


@dataclass(frozen=True, eq=False)
class Features:
    """Features of a trial."""

    x: np.ndarray  # Values, shape (n, k)
    names: tuple[str, ...]  # Names of the columns
    motion: tuple[int, ...]  # Indices of the columns that are angles or their derivatives


def compute_features(trial: TorqueTrial, chosen: FeatureSet, *, causal: bool = False) -> Features:
    """Return a trial's features of the `chosen` set.

    `causal` features use the past alone. Before the trial, every signal is taken to have its first value.
    """
    fs, columns, names = trial.fs, [], []
    for muscle, envelope in trial.envelopes.items() if chosen.muscles else ():
        for lag in (0.0, *chosen.lags):
            late = min(round(lag * fs), len(envelope))
            columns.append(np.concatenate((np.full(late, envelope[0]), envelope[: len(envelope) - late])))
            names.append(f"emg.{muscle}" + (f" {1e3 * lag:.0f} ms ago" if lag else ""))
    first = len(columns)
    joints = [trial.joint, *(j for j in trial.angles if j != trial.joint)] if chosen.neighbours else [trial.joint]
    for joint in joints:
        q, v, a = filter_and_differentiate(np.asarray(trial.angles[joint], float), fs, causal=causal)
        columns.append(q)
        names.append(f"angle.{joint}")
        if chosen.velocities:
            columns.append(v)
            names.append(f"velocity.{joint}")
        if chosen.accelerations:
            columns.append(a)
            names.append(f"acceleration.{joint}")
    return Features(np.column_stack(columns), tuple(names), tuple(range(first, len(columns))))


def filter_and_differentiate(q: np.ndarray, fs: float, *, causal: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return an angle low-passed [rad], its velocity and its acceleration, each of shape (n,).

    `q` is the angle, shape (n,) [rad], sampled at `fs` [Hz]. `causal` filters use the past alone.
    """
    if not causal:
        q = zero_phase_lowpass(q, MOTION_LOWPASS_HZ, 4, fs)
        v = central_difference(q, fs)
        return q, v, central_difference(v, fs)
    q = filter_settled(butterworth(2, 2.0 * CAUSAL_MOTION_LOWPASS_HZ / fs)[0], q)
    v = fs * np.diff(q, prepend=q[0])
    return q, v, fs * np.diff(v, prepend=v[0])
