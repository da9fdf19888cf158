"""Joules of the worst single fault under a controller of the knee orthosis.

Every controller, of the toolkit and foreign, wears the supervisor that `export` puts around a law of this orthosis,
with the instruments that the rig states. A controller that is not a law of the core gives the effort of a commanded
one.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing

import numpy as np

from pellucid.controllers.supervised import SupervisedLaw
from pellucid.controllers.supervisor_faults import NO_FAULT

from ..knee.rig import KneeRig
from ..knee.trial import Controller
from ..knee.worn_compensator import WornCompensator
from ..papers.knee.body_laws import BodyLaw
from ..processes import tell_job_share
from ..safety.fault_table import DETECTABLE_FAULTS, FAULT_KINDS
from ..safety.worn_knee import KNOWLEDGE_LOG_SD, KneeInUse, LawCommand, try_worn_law
from .foreign_law import ForeignLaw, ForeignProcess
from .watched_knee import IdentifiedDrive, watched, watched_command


def knee_in_use(rig: KneeRig, seed: int) -> KneeInUse:
    """Return a rig's wearer, whose EMG tells a torque with an error that the `seed` draws."""
    error = KNOWLEDGE_LOG_SD["emg"] * np.random.default_rng([seed, 2]).standard_normal()
    return KneeInUse(rig=rig, emg_gain=float(np.exp(error)), seed=seed)


def worst_knee_fault(
    worn: KneeInUse, name: str, build: Callable[[], Controller | None], drive: IdentifiedDrive
) -> float | None:
    """Return the most energy that a single fault gives the wearer under a controller until the robot is safe [J].

    None without a controller, with one that learns while it is worn, which no law of the core is, and with one that the
    supervisor stops before any fault begins.
    """
    one = build()
    if one is None or (isinstance(one, WornCompensator) and one.learns):
        return None
    if isinstance(one, (WornCompensator, BodyLaw)):
        listens = isinstance(one, WornCompensator) and one.listens
        return _worst_energy(worn, name, watched(one.law, worn.rig, drive), listens=listens)
    return _worst_energy(worn, name, watched_command(worn.rig, drive), command=_command_of(build))


def worst_foreign_knee_fault(worn: KneeInUse, law: ForeignLaw, drive: IdentifiedDrive) -> float | None:
    """Return the same of a foreign law; None if it was stopped for what it answers."""
    with closing(ForeignProcess(law)) as process:
        if process.fault != NO_FAULT or "knee" not in process.robots:
            return None
        return _worst_energy(worn, law.name, watched_command(worn.rig, drive), command=process.command_of("knee"))


def _command_of(build: Callable[[], Controller | None]) -> LawCommand:
    """Return what gives a controller's effort; it is built anew whenever time begins anew."""
    controller, last = None, float("inf")

    def command(time: float, position: float, torque: float) -> float:
        nonlocal controller, last
        if controller is None or time < last:
            controller = build()
        last = time
        return 0.0 if controller is None or not np.isfinite(position) else controller.step(time, position, torque, ())

    return command


def _worst_energy(
    worn: KneeInUse, name: str, law: SupervisedLaw, *, listens: bool = False, command: LawCommand | None = None
) -> float | None:
    """Return the largest energy [J]; None if the supervisor stopped the law before any fault began."""
    trials = []
    for trial in try_worn_law(worn, name, law, listens=listens, command=command):
        trials.append(trial)
        tell_job_share(min(len(trials) / len(FAULT_KINDS), 1.0))
    if any(trial.early for trial in trials):
        return None
    return max(trial.excess for trial in trials if trial.kind in DETECTABLE_FAULTS)
