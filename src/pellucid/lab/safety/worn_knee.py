"""Every single fault on the law of a worn knee orthosis, on drawn wearers: a table of its own.

Its effort is what a spring is asked for, its sensor that spring. Its wearers give it as much as faults do, and the
spring differs from what it was asked for by as much: raw data, command and memory are watched, no model of the wearer.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace

import numpy as np

from ... import _core
from ..._processes import ordered_results
from ...control.coupling import Coupling
from ...control.residual_compensator import ResidualDesign, design, within
from ...control.supervised import SupervisedLaw
from ...control.worn import watched_worn
from ..drive_reading import EXACT_READING, DriveReading, stated_readings
from ..knee.drawn import drawn_rig
from ..knee.rig import KneeRig, knee_orthosis
from ..knee.wearer import Acting, swinging
from .fault_table import FAULT_KINDS, MAX_WATCH_S, ONSET_RANGE_S, FaultTable, FaultTrial, HealthyLife

JUDGED_WEARERS = 901
"""First of the drawn wearers that are judged; thresholds were chosen on 301 to 320."""

LAWS = ("worn", "worn_without_emg")
"""The residual compensator as it is exported, and without EMG."""

KINDS = tuple(
    kind
    for kind in FAULT_KINDS
    if kind.needs != "interaction" and not kind.at_start and kind.name not in ("wearer_blocked", "strap_opens")
    and not any(two.name == f"{kind.name}_two" for two in FAULT_KINDS)
)  # fmt: skip
"""Faults that it can have: it has no force sensor and no test at start-up, but always two encoders; and its rig has
neither a table nor a strap that opens."""

IDENTIFIED_ACTUATOR = {"actuator_frequency": 200.0, "actuator_damping": 0.7, "actuator_inertia": 0.055,
            "actuator_viscous": 0.1, "actuator_coulomb": 2.6, "actuator_leak": 1.8}  # fmt: skip
"""As sines of the rig's orthosis alone show it, SI."""

KNOWLEDGE_LOG_SD = {"orthosis": 0.02, "limb": 0.08, "strap": 0.1, "actuator": 0.1, "emg": 0.15}
"""Standard deviations of what is known of each [1]."""

MARGINS = {"gain_db": 6.0, "delay": 0.02}
"""That the exported law keeps [dB], [s]."""


@dataclass(frozen=True)
class WornKnee:
    """Somebody in the orthosis, what a controller knows of them, and how far their EMG is off."""

    rig: KneeRig
    known: ResidualDesign
    emg_gain: float
    seed: int
    reading: DriveReading = EXACT_READING  # How the torque of its spring is measured for the supervisor

    def law(self) -> SupervisedLaw:
        """Under the supervisor that goes with it."""
        return watched_worn(
            self.known.control_law(), self.rig["spring"]["stiffness"], self.rig["actuator"]["torque_limit"]
        )

    def begun(self, periods: int) -> tuple[_core.WornOrthosis, Acting]:
        """Orthosis and wearer at rest, before so many periods of swinging."""
        rig, law = self.rig, self.law()
        (subject,) = rig.subjects.values()
        start, loop = rig["swing"]["centre"], rig["torque_loop"]
        plant = _core.WornOrthosis(
            rig.plant(subject), period=rig.period, substeps=loop["substeps"], delay=loop["delay"],
            torque_span=loop["torque_span"], position0=start, law=law.kind, law_parameters=law.parameters,
            supervisor=law.supervisor, drive_reading=self.reading.numbers,
        )  # fmt: skip
        load = -rig.orthosis_load(start)
        acting = Acting(rig, swinging(subject), periods, start, load, np.random.default_rng([self.seed, 1]))
        return plant, acting


def draw_worn_knee(seed: int) -> WornKnee:
    """A wearer and an orthosis, drawn, and known as well as an identification knows them."""
    rig, rng = drawn_rig(knee_orthosis(), seed), np.random.default_rng([seed, 2])
    (subject,) = rig.subjects.values()
    off = {name: np.exp(sd * rng.standard_normal()) for name, sd in KNOWLEDGE_LOG_SD.items()}
    of_strap = {f"strap_{name}": off["strap"] * subject.strap[name] for name in ("stiffness", "damping")}
    known = Coupling(
        orthosis_inertia=off["orthosis"] * rig["orthosis"]["inertia"],
        orthosis_viscous=rig["orthosis"]["bearing_viscous"],
        orthosis_gravity=off["orthosis"] * float(np.hypot(*rig.orthosis_gravity)),
        coulomb=rig["orthosis"]["bearing_coulomb"],
        limb_inertia=off["limb"] * subject.inertia,
        limb_viscous=subject.limb["viscous"],
        limb_gravity=off["limb"] * subject.gravity,
        delay=rig.period,
        **of_strap,
        **{
            n: x if n.endswith(("frequency", "damping", "leak")) else off["actuator"] * x
            for n, x in IDENTIFIED_ACTUATOR.items()
        },
    )
    straps = [known.scaled(strap_stiffness=k, strap_damping=b) for k in (0.7, 1.3) for b in (0.7, 1.3)]
    made = within(design(known, rig.period), [known, *straps], **MARGINS)
    return WornKnee(rig, made, off["emg"], seed)


def _simulate_periods(
    worn: WornKnee, name: str, plant: _core.WornOrthosis, acting: Acting, first: int, periods: int
) -> Iterator[tuple[float, float, float, float]]:
    """Period by period: power on the limb [W], strap and spring torque [N m], and the orthosis's velocity [rad/s]."""
    hears = worn.emg_gain if name == "worn" else float("nan")
    noise = worn.reading.draw_noise(worn.seed)
    position, velocity, strap, spring, own = plant.step(0.0, float("nan")) if first == 0 else acting.last
    for k in range(first, first + periods):
        muscle = acting.step(k, position, velocity, strap)
        position, velocity, strap, spring, own = acting.last = plant.step(muscle, hears * muscle, noise[k % len(noise)])
        yield -strap * velocity, strap, spring, own


def _copy_wearer(acting: Acting) -> Acting:
    twin = copy(acting)
    for name, value in vars(acting).items():
        if isinstance(value, list):
            setattr(twin, name, list(value))
    return twin


def try_wearer(worn: WornKnee, hours: float) -> FaultTable:
    """Every fault that a worn law can have, and some `hours` of healthy swinging, shared among the laws."""
    trials, healthy, period = [], [], worn.rig.period
    for name in LAWS:
        rng = np.random.default_rng([worn.seed, 3, len(name)])
        first, watched = round(rng.uniform(*ONSET_RANGE_S) / period), round(MAX_WATCH_S / period)
        alive = max(round(3600.0 * hours / len(LAWS) / period), first + watched)
        plant, acting = worn.begun(alive + 1)
        well, given = 0, 0.0  # Periods before any alarm
        for _ in _simulate_periods(worn, name, plant, acting, 0, first):
            well += plant.fault == "none"
        before = plant.copy(), _copy_wearer(acting)
        early = plant.fault != "none"
        same = np.zeros(watched)
        for k, (power, *_) in enumerate(_simulate_periods(worn, name, plant, acting, first, alive - first)):
            given += period * max(power, 0.0)
            well += plant.fault == "none"
            if k < watched:
                same[k] = given
            elif plant.fault != "none":
                break
        took = period * max(well, 1)
        healthy.append(HealthyLife(name, worn.seed, took / 3600.0, plant.fault, given / took, {}))
        for kind in KINDS:
            if kind.needs == "muscle" and name != "worn":
                continue
            plant, acting = before[0].copy(), _copy_wearer(before[1])
            plant.begin(kind.name, int(rng.integers(1, 2**60)))
            trials.append(_try_fault(worn, name, kind.name, plant, acting, first, same, early))
    return FaultTable(tuple(trials), tuple(healthy))


def _try_fault(worn, name, kind, plant, acting, first, same, early) -> FaultTrial:
    period, work, excess, peak, impulse = worn.rig.period, 0.0, 0.0, 0.0, 0.0
    found = safe = float("nan")
    fault, speed = "none", 0.0
    for k, (power, strap, spring, own) in enumerate(_simulate_periods(worn, name, plant, acting, first, len(same))):
        work += period * max(power, 0.0)
        excess, peak, impulse = max(excess, work - same[k]), max(peak, abs(strap)), impulse + period * abs(spring)
        speed = abs(own) if k == 0 else speed
        acted = plant.fault != "none"
        if (acted or plant.off > 0) and found != found:
            found, fault = k * period, plant.fault if acted else "watchdog"
        if found == found and (plant.mode in ("damped_stop", "degraded") or plant.off >= 3):
            safe = k * period
            break
    return FaultTrial(
        kind, name, worn.seed, early, found, safe, fault, plant.mode, excess, peak, impulse, speed,
    )  # fmt: skip


def with_stated_reading(worn: WornKnee, index: int) -> WornKnee:
    """The same knee, whose spring is measured as inaccurately as stated; the `index` chooses one of eight readings."""
    readings = stated_readings(worn.law().values["effort_limit"])
    return replace(worn, reading=readings[index % len(readings)])


def _one_wearer_table(seed: int, hours: float, inexact: bool) -> FaultTable:
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
    """The whole table on so many drawn `wearers` from the `first` on, and so many `hours` of healthy swinging.

    Springs are measured exactly, or, if `inexact`, each by one of `stated_readings`."""
    made = ordered_results(
        [(_one_wearer_table, seed, hours / wearers, inexact) for seed in range(first, first + wearers)], workers
    )
    return FaultTable(
        tuple(trial for one in made for trial in one.trials), tuple(life for one in made for life in one.healthy)
    )
