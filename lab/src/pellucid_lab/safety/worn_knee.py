"""Every single fault under the law of a worn knee orthosis, on simulated wearers.

The law commands the torque of a series spring, and the same spring measures it. Wearers exert torques as large as those
of faults, and the spring deviates from its command by as much. Therefore the supervisor checks raw data, command and
memory, and uses no model of the wearer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from pellucid import _core
from pellucid.controllers.coupling import Coupling
from pellucid.controllers.residual_compensator import ResidualDesign
from pellucid.controllers.supervised import SupervisedLaw
from pellucid.controllers.supervisor_faults import NO_FAULT
from pellucid.controllers.worn import design_worn_law, watched_worn

from ..drive_reading import EXACT_READING, DriveReading, stated_readings
from ..knee.drawn import drawn_rig
from ..knee.rig import KneeRig, knee_orthosis
from ..knee.wearer import Acting, swinging
from ..processes import ordered_results
from .fault_table import FAULT_KINDS, MAX_WATCH_S, ONSET_RANGE_S, FaultTable, FaultTrial, HealthyLife, join_tables

JUDGED_WEARERS = 901
"""Seed of the first wearer of the test set; thresholds were chosen on the wearers of the seeds 301 to 320."""

LAWS = {"worn": True, "worn_without_emg": False}
"""Whether each law that is tried uses EMG: the residual compensator as it is exported, and the same without EMG."""

KINDS = tuple(
    kind
    for kind in FAULT_KINDS
    if kind.needs != "interaction" and not kind.at_start and not kind.needs_elbow_rig
    and not any(other.name == f"{kind.name}_two" for other in FAULT_KINDS)
)  # fmt: skip
"""Faults that a worn knee orthosis can have.

It has no force sensor and no start-up test. It always has two encoders, so that a fault with a version for two encoders
is tried in that version. Its rig has neither a table that blocks the wearer nor a strap that opens."""

IDENTIFIED_ACTUATOR = {"actuator_frequency": 200.0, "actuator_damping": 0.7, "actuator_inertia": 0.055,
            "actuator_viscous": 0.1, "actuator_coulomb": 2.6, "actuator_leak": 1.8}  # fmt: skip
"""Parameters of the actuator as identified from sines of the rig's orthosis without a wearer, SI."""

KNOWLEDGE_LOG_SD = {"orthosis": 0.02, "limb": 0.08, "strap": 0.1, "actuator": 0.1, "emg": 0.15}
"""Standard deviation of the logarithm of each part's identified parameters over the true ones.

Chosen by judgement; no measurement is recorded."""

POWER_OFF_PERIODS = 3
"""Number of control periods after which the power stage must have obeyed a command to switch off."""


LawCommand = Callable[[float, float, float], float]
"""Function that gives an effort [N m] at a time [s] and an angle [rad], with the spring's torque [N m].

An input is NaN where its sensor says nothing. Time that goes back to 0 begins anew."""


@dataclass(frozen=True, kw_only=True)
class KneeInUse:
    """A wearer in the orthosis, who swings the shank under any law."""

    rig: KneeRig  # a rig with a single wearer
    emg_gain: float  # torque estimated from EMG over the true torque of the muscles [1]
    seed: int
    reading: DriveReading = EXACT_READING  # measurement of the spring's torque for the supervisor

    def wear(
        self, law: SupervisedLaw, periods: int, command: LawCommand | None = None
    ) -> tuple[_core.WornOrthosis, Acting]:
        """Return the orthosis under a `law` and the wearer at rest, before `periods` control periods of swinging.

        `command` gives the effort of a `commanded_law`.
        """
        rig = self.rig
        (subject,) = rig.subjects.values()
        position, loop = rig["swing"]["centre"], rig["torque_loop"]
        plant = _core.WornOrthosis(
            rig.plant(subject), period=rig.period, substeps=loop["substeps"], delay=loop["delay"],
            torque_span=loop["torque_span"], position0=position, law=law.kind, law_parameters=law.parameters,
            supervisor=law.supervisor, drive_reading=self.reading.numbers, command=command,
        )  # fmt: skip
        load = -rig.orthosis_load(position)
        acting = Acting(rig, swinging(subject), periods, position, load, np.random.default_rng([self.seed, 1]))
        return plant, acting


@dataclass(frozen=True, kw_only=True)
class WornKnee(KneeInUse):
    """A wearer in the orthosis, and the controller that was designed for them."""

    known: ResidualDesign  # controller, designed from imperfectly identified parameters

    def law(self) -> SupervisedLaw:
        """Return the controller under its supervisor."""
        return watched_worn(self.known.control_law(), self.rig.instruments)

    def start(self, periods: int) -> tuple[_core.WornOrthosis, Acting]:
        """Return the orthosis and the wearer at rest, before `periods` control periods of swinging."""
        return self.wear(self.law(), periods)


def draw_worn_knee(seed: int) -> WornKnee:
    """Draw a wearer and an orthosis, and the errors with which an identification knows them."""
    rig, rng = drawn_rig(knee_orthosis(), seed), np.random.default_rng([seed, 2])
    (subject,) = rig.subjects.values()
    error = {name: np.exp(sd * rng.standard_normal()) for name, sd in KNOWLEDGE_LOG_SD.items()}
    strap = {f"strap_{name}": error["strap"] * subject.strap[name] for name in ("stiffness", "damping")}
    known = Coupling(
        orthosis_inertia=error["orthosis"] * rig.constants.orthosis.inertia,
        orthosis_viscous=rig.constants.orthosis.bearing_viscous,
        orthosis_gravity=error["orthosis"] * float(np.hypot(*rig.orthosis_gravity)),
        coulomb=rig.constants.orthosis.bearing_coulomb,
        limb_inertia=error["limb"] * subject.inertia,
        limb_viscous=subject.limb.viscous,
        limb_gravity=error["limb"] * subject.gravity,
        delay=rig.period,
        **strap,
        **{
            name: value if name.endswith(("frequency", "damping", "leak")) else error["actuator"] * value
            for name, value in IDENTIFIED_ACTUATOR.items()
        },
    )
    return WornKnee(rig=rig, known=design_worn_law(known, rig.period), emg_gain=error["emg"], seed=seed)


def _simulate_periods(
    worn: KneeInUse, listens: bool, plant: _core.WornOrthosis, acting: Acting, first: int, periods: int
) -> Iterator[tuple[float, float, float, float]]:
    """Simulate `periods` control periods from period `first` on, under a law that `listens` to EMG or does not.

    Each yields the power on the limb [W], the torques of strap and spring [N m], and the orthosis's velocity [rad/s].
    """
    emg_gain = worn.emg_gain if listens else float("nan")
    noise = worn.reading.draw_noise(worn.seed)
    position, velocity, strap, spring, orthosis_velocity = plant.step(0.0, float("nan")) if first == 0 else acting.last
    for k in range(first, first + periods):
        muscle = acting.step(k, position, velocity, strap)
        acting.last = plant.step(muscle, emg_gain * muscle, noise[k % len(noise)])
        position, velocity, strap, spring, orthosis_velocity = acting.last
        yield -strap * velocity, strap, spring, orthosis_velocity


def _copy_wearer(acting: Acting) -> Acting:
    """Return a copy of a wearer that can be simulated on by itself."""
    twin = copy(acting)
    for name, value in vars(acting).items():
        if isinstance(value, list):
            setattr(twin, name, list(value))
    return twin


def try_wearer(worn: WornKnee, hours: float) -> FaultTable:
    """Try every fault that a worn law can have, and `hours` of healthy swinging, divided among the laws.

    All faults of a law begin in the same period of the same healthy simulation.
    """
    trials, healthy, period = [], [], worn.rig.period
    for name, listens in LAWS.items():
        rng = np.random.default_rng([worn.seed, 3, len(name)])
        onset, watched = round(rng.uniform(*ONSET_RANGE_S) / period), round(MAX_WATCH_S / period)
        last = max(round(3600.0 * hours / len(LAWS) / period), onset + watched)
        plant, acting = worn.start(last + 1)
        periods_before_alarm, work = 0, 0.0
        for _ in _simulate_periods(worn, listens, plant, acting, 0, onset):
            periods_before_alarm += plant.fault == NO_FAULT
        at_onset = plant.copy(), _copy_wearer(acting)
        early = plant.fault != NO_FAULT
        healthy_work = np.zeros(watched)
        for k, (power, *_) in enumerate(_simulate_periods(worn, listens, plant, acting, onset, last - onset)):
            work += period * max(power, 0.0)
            periods_before_alarm += plant.fault == NO_FAULT
            if k < watched:
                healthy_work[k] = work
            elif plant.fault != NO_FAULT:
                break
        duration = period * max(periods_before_alarm, 1)
        healthy.append(HealthyLife(name, worn.seed, duration / 3600.0, plant.fault, work / duration, {}))
        for kind in KINDS:
            if kind.needs == "muscle" and not listens:
                continue
            plant, acting = at_onset[0].copy(), _copy_wearer(at_onset[1])
            plant.begin(kind.name, int(rng.integers(1, 2**60)))
            trials.append(_try_fault(worn, name, listens, kind.name, plant, acting, onset, healthy_work, early))
    return FaultTable(tuple(trials), tuple(healthy))


def try_worn_law(
    worn: KneeInUse, name: str, law: SupervisedLaw, *, listens: bool = False, command: LawCommand | None = None
) -> Iterator[FaultTrial]:
    """Try every fault that one supervised law can have on a wearer, each begun and drawn alike under every law.

    Parameters
    ----------
    worn : KneeInUse
    name : str
        Name of the law in the trials.
    law : SupervisedLaw
        Law of the core that reads encoder, spring and EMG.
    listens : bool
        Whether it reads EMG, whose faults are then tried.
    command : callable, optional
        What gives the effort of a `commanded_law`. It is run from the start again for every fault, since what it
        remembers cannot be copied.
    """
    period = worn.rig.period
    rng = np.random.default_rng([worn.seed, 5])
    onset, watched = round(rng.uniform(*ONSET_RANGE_S) / period), round(MAX_WATCH_S / period)

    def at_onset() -> tuple[_core.WornOrthosis, Acting]:
        plant, acting = worn.wear(law, onset + watched + 1, command)
        for _ in _simulate_periods(worn, listens, plant, acting, 0, onset):
            pass
        return plant, acting

    plant, acting = at_onset()
    kept, early = (plant.copy(), _copy_wearer(acting)), plant.fault != NO_FAULT
    power = [power for power, *_ in _simulate_periods(worn, listens, plant, acting, onset, watched)]
    healthy_work = period * np.cumsum(np.maximum(power, 0.0))
    for kind in KINDS:
        drawn = int(rng.integers(1, 2**60))
        if kind.needs == "muscle" and not listens:
            continue
        plant, acting = (kept[0].copy(), _copy_wearer(kept[1])) if command is None else at_onset()
        plant.begin(kind.name, drawn)
        yield _try_fault(worn, name, listens, kind.name, plant, acting, onset, healthy_work, early)


def _try_fault(
    worn: KneeInUse, name: str, listens: bool, kind: str, plant: _core.WornOrthosis, acting: Acting, onset: int,
    healthy_work: np.ndarray, early: bool,
) -> FaultTrial:  # fmt: skip
    """Simulate a fault from its onset until the output is safe; `healthy_work` is that of the run without it [J]."""
    period, work, excess, peak, impulse = worn.rig.period, 0.0, 0.0, 0.0, 0.0
    found = safe = float("nan")
    fault, onset_speed = NO_FAULT, 0.0
    for k, (power, strap, spring, velocity) in enumerate(
        _simulate_periods(worn, listens, plant, acting, onset, len(healthy_work))
    ):
        work += period * max(power, 0.0)
        excess = max(excess, work - healthy_work[k])
        peak = max(peak, abs(strap))
        impulse += period * abs(spring)
        onset_speed = abs(velocity) if k == 0 else onset_speed
        acted = plant.fault != NO_FAULT
        if (acted or plant.off > 0) and np.isnan(found):
            found, fault = k * period, plant.fault if acted else "watchdog"
        if not np.isnan(found) and (plant.mode in ("damped_stop", "degraded") or plant.off >= POWER_OFF_PERIODS):
            safe = k * period
            break
    return FaultTrial(
        kind, name, worn.seed, early, found, safe, fault, plant.mode, excess, peak, impulse, onset_speed,
    )  # fmt: skip


def with_stated_reading(worn: WornKnee, index: int) -> WornKnee:
    """Return the same knee with a spring that is measured as badly as the stated accuracy permits.

    The `index` chooses one of the eight `stated_readings`.
    """
    readings = stated_readings(worn.law().values["effort_limit"])
    return replace(worn, reading=readings[index % len(readings)])


def _one_wearer_table(seed: int, hours: float, inexact: bool) -> FaultTable:
    """Return the table of one simulated wearer."""
    worn = draw_worn_knee(seed)
    return try_wearer(with_stated_reading(worn, seed) if inexact else worn, hours)


def knee_table(
    wearers: int = 20,
    hours: float = 1.0,
    workers: int | None = None,
    first: int = JUDGED_WEARERS,
    *,
    inexact: bool = False,
) -> FaultTable:
    """Return the table of `wearers` simulated wearers with the seeds from `first` on, with `hours` of healthy swinging.

    Springs are measured exactly; if `inexact`, each has one of `stated_readings`.
    """
    jobs = [(_one_wearer_table, seed, hours / wearers, inexact) for seed in range(first, first + wearers)]
    return join_tables(ordered_results(jobs, workers))
