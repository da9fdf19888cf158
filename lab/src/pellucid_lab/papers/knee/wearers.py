"""Orthosis and wearers identified as `identify` does it, and compared with the simulation's truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pellucid.models.anthropometry import de_leva, shank_length, winter
from pellucid.models.estimates import Parameter
from pellucid.numerics.gravity_holds import cosine_moment, line_of_best_fit
from pellucid.orthosis.imu.imu_angle import inertial
from pellucid.orthosis.input_output import input_output
from pellucid.orthosis.strap.limb import find_joint_axis, limb_angle_by_imu
from pellucid.orthosis.strap.orthosis_alone import SPRING_HOLD, OrthosisFit, fit_orthosis
from pellucid.orthosis.strap.strap_model import StrappedSwing
from pellucid.orthosis.strap.wearer_coupling import SWING_EDGE_S, WearerCoupling, identify_wearer
from pellucid.orthosis.study.coupling.coupling_result import WearerStages
from pellucid.orthosis.study.coupling.coupling_table import CouplingTable
from pellucid.orthosis.study.coupling.identify_coupling import identify_worn
from pellucid.orthosis.transfer.fit_transfer_function import TransferFit, fit_percent, fit_records

from ...knee.recorded_session import STRAP_PROTOCOLS, KneeSession, hold_angles, take
from ...knee.rig import KneeRig
from ...knee.subject import KneeSubject

STRAP_PARAMETERS = ("stiffness", "damping", "inertia")
"""Fitted parameters of a strap; the true inertia is 0."""


@dataclass(frozen=True, eq=False)
class Bench:
    """The orthosis alone."""

    fit: OrthosisFit
    brief: TransferFit  # Fit of the thesis's form to its own 5 s of each frequency
    angle: np.ndarray  # (k,) Angles of the holds [rad]
    torque: np.ndarray  # (k,) Torques of the holds [N m]
    gravity: float  # True gravity torque [N m]
    inertia: float  # True inertia [kg m^2]

    @property
    def as_published(self) -> dict[str, float]:
        """Gravity torque [N m] by the thesis's trend line (its slope) and by its cosine."""
        return {
            "line": line_of_best_fit(self.angle, self.torque).slope,
            "cosine": cosine_moment(self.angle, self.torque),
        }


@dataclass(frozen=True, eq=False)
class Mismatch:
    """Angle of the limb less that of the orthosis in one swing."""

    recording: str
    split: str
    time: np.ndarray  # (n,) [s]
    true: np.ndarray  # (n,) True mismatch [rad]
    predicted: np.ndarray  # (n,) Mismatch by the strap's model from the orthosis's torque balance [rad]
    published: np.ndarray | None  # (n,) Mismatch by the thesis's form [rad]
    seen_time: np.ndarray  # (m,) Times of the IMU's samples [s]
    seen: np.ndarray  # (m,) Mismatch by the IMU [rad]

    def fit(self, model: str = "predicted") -> float:
        """Return how well a `model` fits the true mismatch [%]: "predicted", "published", or "seen" for the IMU."""
        if model == "seen":
            return fit_percent(np.interp(self.seen_time, self.time, self.true), self.seen)
        return fit_percent(self.true[self._inside], getattr(self, model)[self._inside])

    def rmse(self, model: str = "predicted") -> float:
        """Return the RMS error of a `model` [rad]."""
        return float(np.sqrt(np.mean((self.true - getattr(self, model))[self._inside] ** 2)))

    @property
    def _inside(self) -> np.ndarray:
        """Samples away from the swing's ends, where the preceding motion is not known, shape (n,)."""
        return (self.time >= self.time[0] + SWING_EDGE_S) & (self.time <= self.time[-1] - SWING_EDGE_S)


@dataclass(frozen=True, eq=False)
class WearerIdentification:
    """One identified subject."""

    name: str
    seed: int
    stages: WearerStages  # Identification with all nine axes of the IMU
    swings: tuple[Mismatch, ...]
    subject: KneeSubject  # The simulated subject, with the truth
    six_axes: WearerStages | None = None  # Identification without the IMU's magnetometer
    six_axes_swings: tuple[Mismatch, ...] = ()
    best_published: tuple[Mismatch, ...] = ()  # Mismatch by the thesis's form, given the muscles' true torque
    # (k,) Angles [rad] and torques [N m] of the relaxed leg's holds
    holds_of_leg: tuple[np.ndarray, np.ndarray] = field(default=(np.zeros(0), np.zeros(0)))

    def of(self, axes: int) -> tuple[WearerStages, tuple[Mismatch, ...]]:
        """Return identification and swings with an IMU of 9 or 6 `axes`."""
        return (self.stages, self.swings) if axes == 9 else (self.six_axes, self.six_axes_swings)

    def holds(self, name: str) -> bool:
        """Return whether the 95 % interval of a parameter of `STRAP_PARAMETERS` contains the true value."""
        low, high = self.stages.coupling.parameter(name).interval()
        return bool(low <= self.subject.strap.get(name, 0.0) <= high)


def mean_fit(swings: Sequence[Mismatch], model: str = "predicted", split: str = "heldout") -> float:
    """Return the mean fit of the swings of one split [%]."""
    return float(np.mean([s.fit(model) for s in swings if s.split == split]))


@dataclass(frozen=True)
class WearerErrors:
    """Errors and fits of one subject and seed against the truth."""

    subject: str
    seed: int
    gravity_error: float  # Signed error of the limb's gravity torque [%]
    fit: float  # Fit of the mismatch in held-out swings to the true one [%]
    rmse: float  # RMS error of the mismatch in held-out swings [rad]
    fit_to_imu: float  # Fit of the mismatch to the IMU's [%]
    ceiling: float  # Largest fit to the IMU's mismatch that the IMU's error allows [%]
    strap: Mapping[str, Parameter]  # Parameters of `STRAP_PARAMETERS`
    holds: Mapping[str, bool]  # True where a parameter's interval contains the true value


def drawn_from(found: WearerIdentification) -> WearerErrors:
    """Return a wearer's figures against the truth."""
    coupling = found.stages.coupling
    return WearerErrors(
        found.name,
        found.seed,
        100.0 * (found.stages.limb.gravity.value / found.subject.gravity - 1.0),
        mean_fit(found.swings),
        float(np.mean([s.rmse() for s in found.swings if s.split == "heldout"])),
        coupling.mean_fit(),
        coupling.mean_ceiling(),
        {name: coupling.parameter(name) for name in STRAP_PARAMETERS},
        {name: found.holds(name) for name in STRAP_PARAMETERS},
    )


def identify_bench(rig: KneeRig, seed: int) -> Bench:
    """Record the orthosis alone, and identify it."""
    taken = take(rig, seed)
    holds = taken.responses("gravity_holds")
    fit = fit_orthosis(holds, *(taken.responses("sine_tracking", use) for use in ("fit", "validate")))
    brief = fit_records(taken.responses("sine_brief"), 2, 0, hold=SPRING_HOLD, units=("N*m", "rad"))
    gravity = float(np.hypot(*rig.orthosis_gravity))
    return Bench(fit, brief, *hold_angles(holds), gravity, rig["orthosis"]["inertia"])


def identify_straps(rig: KneeRig, seed: int) -> list[WearerIdentification]:
    """Record of all subjects what their straps need, and identify them."""
    taken = take(rig, seed, list(rig.subjects), protocols=STRAP_PROTOCOLS)
    found = identify_worn(taken.config, taken.recordings)
    return [
        WearerIdentification(name, seed, stages, _mismatches(taken, stages.coupling), rig.subjects[name])
        for name, stages in found.wearers.items()
    ]


def identify_subject(rig: KneeRig, name: str, seed: int) -> tuple[WearerIdentification, KneeSession]:
    """Record everything that one subject does, and identify limb and strap with six and with nine axes."""
    taken = take(rig, seed, [name])
    asked = taken.config.table(CouplingTable)
    without = taken.config.model_copy(update={"coupling": asked.model_copy(update={"magnetometer": False})})
    found, six = (identify_worn(config, taken.recordings) for config in (taken.config, without))
    stages, other = found.wearers[name], six.wearers[name]
    made = WearerIdentification(
        name, seed, stages, _mismatches(taken, stages.coupling), rig.subjects[name], other,
        _mismatches(taken, other.coupling), _with_true_torque(taken, found.orthosis, stages),
        hold_angles(taken.responses("relaxed_holds")),
    )  # fmt: skip
    return made, taken


def tape_measure(subject: KneeSubject) -> dict[str, float]:
    """Return the gravity torque of shank and foot by tables of shares [N m]."""
    return {
        "winter": winter(subject.weight, shank_length(subject.height)).gravity(),
        "published": winter(subject.weight, subject.shank_length).gravity(),
        "de_leva": de_leva(subject.weight, subject.height, subject.sex).gravity(),
    }


def _mismatches(taken: KneeSession, coupling: WearerCoupling) -> tuple[Mismatch, ...]:
    by_name = {r.name: r for r in taken.recordings}
    return tuple(
        Mismatch(
            j.recording, j.split, by_name[j.recording].time, taken.truth[j.recording].mismatch, j.predicted,
            j.published, j.time, j.seen,
        )
        for j in coupling.evaluated
    )  # fmt: skip


def _with_true_torque(taken: KneeSession, orthosis: OrthosisFit, stages: WearerStages) -> tuple[Mismatch, ...]:
    """What the thesis's form could reach if EMG told the muscles' torque without any error."""
    made = []
    for recording in taken.of("free_swing"):
        record = input_output(recording, ("torque", "position"))
        imu = inertial(recording.streams["imu"])
        time, angle = limb_angle_by_imu(imu, find_joint_axis(imu, record), method="vqf", axes=6)
        torque = taken.truth[recording.name].muscle_torque
        made.append(
            StrappedSwing(recording.name, record.split, record.time, record.output, record.input, time, angle, torque)
        )
    return _mismatches(taken, identify_wearer("", made, orthosis.orthosis, limb=stages.limb.limb))
