"""What the thesis left for later: the residual impedance of a worn orthosis cancelled, beside the alternatives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..controllers.coupling import Coupling
from ..controllers.disturbance_observer import DisturbanceObserver
from ..controllers.fuzzy import FuzzyCompensation
from ..controllers.pid_tuning import tune_pid
from ..controllers.rbf import RbfCompensation
from ..controllers.residual_compensator import Law, ResidualDesign, design, with_strap_gain, worst_margins
from ..controllers.stability import Margins, margins
from ..controllers.worn import StrapLearning, WornCompensator
from ..lab.knee_protocol import Faults, swing_trial
from ..lab.knee_rig import KneeRig, changed
from ..lab.knee_trial import Controller, KneeTaken, run_trial
from .knee_cards import WearerCard

SPEEDS = (0.1, 0.5, 1.5, 4.0)
"""At which friction is linearised for the margins [rad/s]."""

WANTED_GAIN_DB, WANTED_DELAY = 6.0, 0.020
"""Margins that are asked of every controller [dB], [s]."""

SETTLING = 4.0
"""Not scored at the start of a swing [s]: adaptation and the wearer's own learning."""

CANDIDATES = tuple(
    Law(0.8, 0.8, friction, 0.7, proportional=proportional, torque_gain=torque)
    for friction in (0.4, 0.5)
    for proportional in (0.5, 1.0, 1.5)
    for torque in (0.0, 0.3)
)
"""Laws among which `choose_law` takes one."""


@dataclass(frozen=True)
class ControllerRow:
    """One controller on one wearer.

    Attributes
    ----------
    controller, subject : str
        Which.
    seed : int
        Of the swing.
    mismatch : float
        RMS of the angle between limb and orthosis [rad].
    strap_torque : float
        RMS of the interaction torque [N m].
    ratio : float
        Of that to zero-impedance mode alone, on the same swing [1].
    gain_db, delay : float or None
        Smallest margins with the strap as identified and 30 % off [dB], [s], infinite beyond 40 dB and 100 ms; None
        where the controller has no linear form.
    fault : str
        Of its gate at the end.
    """

    controller: str
    subject: str
    seed: int
    mismatch: float
    strap_torque: float
    ratio: float
    gain_db: float | None
    delay: float | None
    fault: str


def uncertain_straps(coupling: Coupling) -> list[Coupling]:
    """The coupling, and with stiffness and damping of the strap 30 % off in each combination.

    Parameters
    ----------
    coupling : Coupling
        As identified.

    Returns
    -------
    list of Coupling
        Five.
    """
    return [coupling] + [coupling.scaled(strap_stiffness=k, strap_damping=b) for k in (0.7, 1.3) for b in (0.7, 1.3)]


def swing(
    rig: KneeRig, subject: str, seed: int, controller: Controller | None, *, duration: float, faults: Faults
) -> KneeTaken:
    """A free swing at the rig's own pace.

    Parameters
    ----------
    rig : KneeRig
        The virtual orthosis.
    subject : str
        Who wears it.
    seed : int
        Of the wearer and of all noise.
    controller : Controller or None
        None: zero-impedance mode.
    duration : float
        [s].
    faults : Faults
        What goes wrong.

    Returns
    -------
    KneeTaken
        With its truth.
    """
    trial, wearer = swing_trial(rig, "swing", rig.subjects[subject], duration=duration, faults=faults)
    return run_trial(rig, wearer, trial, rng=np.random.default_rng([seed, 7]), controller=controller)


def root_mean_square(taken: KneeTaken) -> tuple[float, float]:
    """Of mismatch and strap torque, after they settled.

    Parameters
    ----------
    taken : KneeTaken
        With its truth.

    Returns
    -------
    tuple of float
        [rad], [N m].
    """
    late = taken.time >= SETTLING
    truth = taken.truth
    return float(np.sqrt(np.mean(truth.mismatch[late] ** 2))), float(np.sqrt(np.mean(truth.strap_torque[late] ** 2)))


def choose_law(rig: KneeRig, cards: Mapping[str, WearerCard], seeds: Sequence[int], *, duration: float = 12.0) -> Law:
    """The law that leaves the least strap torque on these wearers, among those whose margins hold on all of them.

    Parameters
    ----------
    rig : KneeRig
        With wearers on whom nothing is judged afterwards.
    cards : mapping of str to WearerCard
        Theirs.
    seeds : sequence of int
        Of their swings.
    duration : float
        Of a swing [s].

    Returns
    -------
    Law
        One of `CANDIDATES`.
    """
    best, least = Law(), np.inf
    for law in CANDIDATES:
        made = {name: design(card.coupling, rig.period, law=law) for name, card in cards.items()}
        left = [worst_margins(m, uncertain_straps(m.coupling), SPEEDS) for m in made.values()]
        if not all(m.stable and m.gain_db >= WANTED_GAIN_DB + 1 and m.delay >= WANTED_DELAY for m in left):
            continue
        ratios = []
        for name, card in cards.items():
            for seed in seeds:
                plain = root_mean_square(swing(rig, name, seed, None, duration=duration, faults=Faults()))[1]
                worn = WornCompensator(made[name], card.emg)
                ratios.append(
                    root_mean_square(swing(rig, name, seed, worn, duration=duration, faults=Faults()))[1] / plain
                )
        if np.mean(ratios) < least:
            best, least = law, float(np.mean(ratios))
    return best


def phase_gains(taken: KneeTaken, made: ResidualDesign) -> tuple[float, ...]:
    """Gains over a swing from what a recorded compensator still left to the strap, by its own estimate of phase.

    In each eighth of the circle of angle and velocity the gain is least squares of command plus missing torque on the
    command, within 0.8 and 1.25: what the ratio that varies with the swing's phase comes to for this wearer.

    Parameters
    ----------
    taken : KneeTaken
        Under the compensator with gains of 1.
    made : ResidualDesign
        That compensator.

    Returns
    -------
    tuple of 8 float
        [1].
    """
    m, q = made.coupling, taken.position
    v = np.gradient(q, taken.time)
    kernel = np.ones(25) / 25
    v = np.convolve(v, kernel, mode="same")
    a = np.convolve(np.gradient(v, taken.time), kernel, mode="same")
    missing = m.orthosis_inertia * a + m.orthosis_viscous * v + m.orthosis_gravity * np.sin(q) - taken.torque
    x, y = q - made.swing[0], v / made.swing[1]
    place = (np.round(np.arctan2(y, x) / (np.pi / 4)).astype(int)) % 8
    gains = []
    for i in range(8):
        here = (place == i) & (taken.time > SETTLING)
        u = taken.command[here]
        share = float(u @ missing[here] / (u @ u)) if here.sum() > 100 else 0.0
        gains.append(float(np.clip(1 + share, 0.8, 1.25)))
    return tuple(gains)


def within_margins(made: ResidualDesign, gains: tuple[float, ...]) -> tuple[ResidualDesign, Margins]:
    """Gains over a swing, the large ones lowered until their largest, all through the swing, leaves the margins wanted.

    Parameters
    ----------
    made : ResidualDesign
        With gains of 1, which leave them.
    gains : tuple of 8 float
        Wanted [1].

    Returns
    -------
    ResidualDesign
        With gains that may be.
    Margins
        With the largest of them throughout.
    """
    for most in np.arange(1.25, 0.99, -0.05):
        lowered = tuple(min(gain, float(most)) for gain in gains)
        constant = replace(made, law=replace(made.law, phase_gain=(max(lowered),) * 8))
        left = worst_margins(constant, uncertain_straps(made.coupling), SPEEDS)
        if left.gain_db >= WANTED_GAIN_DB and left.delay >= WANTED_DELAY:
            break
    return replace(made, law=replace(made.law, phase_gain=lowered)), left


def for_wearer(coupling: Coupling, period: float, law: Law) -> ResidualDesign:
    """A law on one wearer's card: its gain on the strap torque lowered until the margins wanted are there.

    Parameters
    ----------
    coupling : Coupling
        As identified.
    period : float
        [s].
    law : Law
        Chosen on others.

    Returns
    -------
    ResidualDesign
        With margins on every strap of `uncertain_straps`.
    """
    gains = [share * law.proportional for share in (0.0, 0.25, 0.5, 0.75, 1.0)]
    made = design(coupling, period, law=law)
    return with_strap_gain(
        made, gains, uncertain_straps(coupling), gain_db=WANTED_GAIN_DB, delay=WANTED_DELAY, speeds=SPEEDS
    )


def compare_controllers(
    rig: KneeRig,
    cards: Mapping[str, WearerCard],
    subjects: Sequence[str],
    seeds: Sequence[int],
    *,
    law: Law | None = None,
    duration: float = 20.0,
    faults: Faults | None = None,
    only: Sequence[str] | None = None,
) -> list[ControllerRow]:
    """Every controller on every wearer, on the same swings.

    Parameters
    ----------
    rig : KneeRig
        The virtual orthosis.
    cards : mapping of str to WearerCard
        What was identified of each subject; controllers see nothing else.
    subjects : sequence of str
        On whom is judged.
    seeds : sequence of int
        One swing each.
    law : Law, optional
        Of the residual compensator, chosen on other wearers; the default one if None.
    duration : float
        Of a swing [s].
    faults : Faults, optional
        What goes wrong in every swing.
    only : sequence of str, optional
        Names of controllers; all if None.

    Returns
    -------
    list of ControllerRow
        The first of each subject and seed is "zero impedance".
    """
    rows, law, faults = [], law or Law(), faults or Faults()
    for subject in subjects:
        card = cards[subject]
        made = _controllers(card, rig, law, only)
        if only is None or "gain by phase" in only:
            first = replace(for_wearer(card.coupling, rig.period, law), swing=(rig["swing"]["centre"], 4.4))
            # Its gains are learnt on a swing of the same wearer that is not judged.
            learnt = swing(rig, subject, 9001, WornCompensator(first, card.emg), duration=duration, faults=Faults())
            phased = replace(first, law=replace(law, phase_gain=phase_gains(learnt, first)))
            phased, left = within_margins(first, phase_gains(learnt, first))
            made["gain by phase"] = (left, lambda p=phased, c=card: WornCompensator(p, c.emg))
        for seed in seeds:
            mismatch, plain = root_mean_square(swing(rig, subject, seed, None, duration=duration, faults=faults))
            rows.append(
                ControllerRow("zero impedance", subject, seed, mismatch, plain, 1.0, float("inf"), float("inf"), "none")
            )
            for name, (left, build) in made.items():
                controller = build()
                taken = swing(rig, subject, seed, controller, duration=duration, faults=faults)
                mismatch, torque = root_mean_square(taken)
                gain, delay = (left.gain_db, left.delay) if left else (None, None)
                rows.append(
                    ControllerRow(name, subject, seed, mismatch, torque, torque / plain, gain, delay, controller.fault)
                )
    return rows


def _controllers(
    card: WearerCard, rig: KneeRig, law: Law, only: Sequence[str] | None
) -> dict[str, tuple[Margins | None, Callable[[], Controller]]]:
    """Everything but the gain by phase that is wanted: margins, and how to build it."""
    coupling, period = card.coupling, rig.period
    plants = uncertain_straps(coupling)
    made = for_wearer(coupling, period, law)
    left = worst_margins(made, plants, SPEEDS)
    found: dict[str, tuple[Margins | None, Callable[[], Controller]]] = {
        "residual compensator": (left, lambda: WornCompensator(made, card.emg)),
        "without EMG": (left, lambda: WornCompensator(made)),
        "strap learnt online": (left, lambda: WornCompensator(made, card.emg, StrapLearning())),
        "fuzzy": (None, lambda: FuzzyCompensation(coupling, period)),
        "neural (RBF)": (None, lambda: RbfCompensation(coupling, period)),
    }
    if only is None or "PID" in only:
        pid = tune_pid(made, plants, gain_db=WANTED_GAIN_DB, delay=WANTED_DELAY)
        found["PID"] = (worst_margins(pid, plants, SPEEDS), lambda: WornCompensator(pid, card.emg))
    if only is None or "disturbance observer" in only:
        observer = _observer(coupling, period)
        found["disturbance observer"] = (_observer_margins(observer), lambda: _observer(coupling, period))
    return {name: entry for name, entry in found.items() if only is None or name in only}


def _observer(coupling: Coupling, period: float) -> DisturbanceObserver:
    """The strongest disturbance observer that leaves the margins wanted, as the compensator is chosen."""
    for gain in (1.5, 1.0, 0.75, 0.5, 0.25, 0.0):
        for friction in (0.5, 0.4, 0.3):
            observer = DisturbanceObserver(coupling, period, gain=gain, friction=friction)
            left = _observer_margins(observer)
            if left.gain_db >= WANTED_GAIN_DB and left.delay >= WANTED_DELAY:
                return observer
    return observer


def _observer_margins(observer: DisturbanceObserver) -> Margins:
    found = [
        margins(plant, observer.linear(speed), observer.period, speed=speed)
        for plant in uncertain_straps(observer.coupling)
        for speed in SPEEDS
    ]
    return Margins(
        all(m.stable for m in found),
        min(m.gain_db for m in found),
        min(m.delay for m in found),
        max(m.radius for m in found),
    )


def robustness(
    rig: KneeRig,
    cards: Mapping[str, WearerCard],
    subjects: Sequence[str],
    seeds: Sequence[int],
    *,
    law: Law | None = None,
    duration: float = 20.0,
) -> dict[str, list[ControllerRow]]:
    """The residual compensator where something is not as it was identified.

    Parameters
    ----------
    rig, cards, subjects, seeds, law, duration
        As `compare_controllers` takes them.

    Returns
    -------
    dict of str to list of ControllerRow
        By what is wrong.
    """
    muscles, wearer = rig["muscles"]["delay"], rig["wearer"]["foresight"]
    found = {}

    def judge(name: str, where: KneeRig, known: Mapping[str, WearerCard], faults: Faults) -> None:
        found[name] = compare_controllers(
            where, known, subjects, seeds, law=law, duration=duration, faults=faults, only=("residual compensator",)
        )

    for k, b in ((0.7, 0.7), (0.7, 1.3), (1.3, 0.7), (1.3, 1.3)):
        wrong = {
            name: replace(card, coupling=card.coupling.scaled(strap_stiffness=k, strap_damping=b))
            for name, card in cards.items()
        }
        judge(f"strap identified as k x {k:g}, b x {b:g}", rig, wrong, Faults())
    for late in (-0.020, 0.020):
        other = changed(rig, {"muscles.delay": muscles + late, "wearer.foresight": wearer + late})
        judge(f"EMG leads by {1e3 * late:+.0f} ms more", other, cards, Faults())
    judge("slack of 0.05 rad", changed(rig, {"strap.slack": 0.05}), cards, Faults())
    judge("slip of 0.1 rad", rig, cards, Faults(slip=(duration / 2, 0.1)))
    judge("electrode detached", rig, cards, Faults(emg_detached={0: duration / 2, 1: duration / 2}))
    return found
