"""What the thesis left for later: the residual impedance of a worn orthosis cancelled, beside the alternatives.

A wearer is recorded and identified, every controller is built from the cards and from constants chosen on other
wearers, and all of them go through the same swings. The truth is used to judge alone.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from .._errors import PellucidError
from ..lab.knee_drawn import drawn_rig
from ..lab.knee_instruments import Session
from ..lab.knee_protocol import Faults, KneeTrial, swing_trial
from ..lab.knee_rig import KneeRig, changed
from ..lab.knee_study import sessions_of
from ..lab.knee_trial import Controller, KneeTaken, run_trial
from ..lab.knee_wearer import relaxed
from .knee_cards import Identified, WearerCard, identify_wearer_of, mistaken, weakened
from .knee_controllers import DELAY, GAIN_DB, NAMES, Built, Chosen, chosen, controllers

SETTLING = 4.0
"""Not scored at the start of a swing [s]: adaptation and the wearer's own learning."""

TUNING, FRESH = tuple(range(101, 107)), tuple(range(201, 207))
"""Seeds of drawn wearers: on whom constants were chosen, and on whom they were judged."""

SWINGS, DURATION = (31, 32, 33), 20.0
"""Seeds of the judged swings, and how long one lasts [s]."""

REPRODUCED = ("S1", "S2", "S3", *(f"D{seed}" for seed in FRESH[:2]))
"""Who is judged in a reproduction, whose time is short; the others are judged by `main` of `knee_residual_rows`."""

RECORDED = 5
"""Seed of the recordings that the rig's own subjects are identified from; a drawn wearer's is their own."""

STRAINED = 10.0
"""Length of the swings in which margins are tried [s]."""

REST_SPEED, LET_GO = 0.1, 0.5
"""What counts as rest, a degree at 1 Hz, or twice what zero-impedance mode leaves if that is more [rad/s]; and where a
relaxed leg is let go [rad]."""


@dataclass(frozen=True)
class ControllerRow:
    """One controller on one wearer, in one swing.

    Attributes
    ----------
    controller : str
        Of `NAMES`.
    subject : str
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
    holds : bool or None
        Whether, in the simulation, neither twice the command nor one 20 ms late makes a relaxed leg or a swing sway;
        None where it was not tried.
    fault : str
        Of its gate at the end.
    """

    controller: str
    subject: str
    seed: int
    mismatch: float
    strap_torque: float
    ratio: float
    gain_db: float | None = None
    delay: float | None = None
    holds: bool | None = None
    fault: str = "none"


class Strained:
    """A controller whose command is too strong and too late: what margins are asked for.

    Parameters
    ----------
    controller : Controller
    gain : float
        On its command [1].
    late : int
        Periods that the command waits.
    """

    def __init__(self, controller: Controller, gain: float = 1.0, late: int = 0):
        self._controller, self._gain, self._waiting = controller, gain, [0.0] * late

    @property
    def fault(self) -> str:
        """As of the controller's gate."""
        return self._controller.fault

    def step(self, time: float, position: float, torque: float, emg: Sequence[tuple[float, float]] = ()) -> float:
        """One period, as `Controller.step`."""
        self._waiting.append(self._gain * self._controller.step(time, position, torque, emg))
        return self._waiting.pop(0)


def session_of(identified: Identified) -> Session:
    """How the instruments sat while a wearer was identified: electrodes stay on for the swings."""
    return sessions_of(identified.rig, identified.seed)[identified.name]


def swing(
    rig: KneeRig,
    name: str,
    seed: int,
    controller: Controller | None,
    *,
    duration: float,
    session: Session | None = None,
    faults: Faults | None = None,
) -> KneeTaken:
    """A free swing at the rig's own pace.

    Parameters
    ----------
    rig : KneeRig
        The virtual orthosis.
    name : str
        Who wears it.
    seed : int
        Of the wearer and of all noise.
    controller : Controller or None
        None: zero-impedance mode.
    duration : float
        [s].
    session : Session, optional
        How the instruments sit; drawn anew if None.
    faults : Faults, optional
        What goes wrong.

    Returns
    -------
    KneeTaken
        With its truth.
    """
    trial, wearer = swing_trial(rig, "swing", rig.subjects[name], duration=duration, faults=faults or Faults())
    return run_trial(rig, wearer, trial, rng=np.random.default_rng([seed, 7]), controller=controller, session=session)


def driven_back(rig: KneeRig) -> KneeRig:
    """The same orthosis without any control: the motor has no current, and the wearer drives it back."""
    return changed(rig, {f"torque_loop.{gain}": 0.0 for gain in ("kp", "ki", "kd")})


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


def let_go(rig: KneeRig, name: str, controller: Controller | None, *, duration: float = 12.0) -> KneeTaken:
    """A relaxed leg, let go where it does not hang.

    Parameters
    ----------
    rig : KneeRig
    name : str
    controller : Controller or None
    duration : float
        [s].

    Returns
    -------
    KneeTaken
    """
    reference = np.zeros(round(duration / rig.period))
    trial = KneeTrial("let_go", "free_swing", "fit", "torque", reference, start=LET_GO)
    return run_trial(rig, relaxed(rig.subjects[name]), trial, rng=np.random.default_rng([5, 7]), controller=controller)


def last_speed(taken: KneeTaken) -> float:
    """How fast a leg that was let go still moves in its last 3 s, RMS [rad/s]: muscles at rest are not quite still."""
    last = taken.time >= taken.time[-1] - 3.0
    return float(np.sqrt(np.mean(taken.truth.limb_velocity[last] ** 2)))


@dataclass(frozen=True)
class WithoutControl:
    """What zero-impedance mode leaves of one wearer, which sway is measured by.

    Attributes
    ----------
    torque : float
        Of the strap in a swing, RMS [N m].
    rest : float
        Speed of a relaxed leg that counts as rest [rad/s].
    """

    torque: float
    rest: float


def without_control(rig: KneeRig, name: str, seed: int = SWINGS[0]) -> WithoutControl:
    """Zero-impedance mode of one wearer, in the swing of a seed."""
    torque = root_mean_square(swing(rig, name, seed, None, duration=STRAINED))[1]
    return WithoutControl(torque, max(REST_SPEED, 2.0 * last_speed(let_go(rig, name, None))))


def holds_margins(
    rig: KneeRig, name: str, build: Callable[[], Controller], plain: WithoutControl, *, seed: int = SWINGS[0]
) -> bool:
    """Whether the margins asked for hold in the simulation: the command 6 dB too strong, or 20 ms late.

    Parameters
    ----------
    rig : KneeRig
    name : str
    build : callable
        Makes the controller.
    plain : WithoutControl
        Of the same wearer and seed.
    seed : int
        Of a swing.

    Returns
    -------
    bool
        A relaxed leg comes to rest, no gate trips, and a swing's strap torque stays below 1.5 times zero-impedance
        mode's.
    """
    for gain, late in ((10 ** (GAIN_DB / 20), 0), (1.0, round(DELAY / rig.period))):
        resting, swinging = Strained(build(), gain, late), Strained(build(), gain, late)
        if last_speed(let_go(rig, name, resting)) > plain.rest:
            return False
        torque = root_mean_square(swing(rig, name, seed, swinging, duration=STRAINED))[1]
        if torque > 1.5 * plain.torque or {resting.fault, swinging.fault} != {"none"}:
            return False
    return True


def compare(
    identified: Identified,
    seeds: Sequence[int] = SWINGS,
    *,
    only: Sequence[str] = tuple(NAMES),
    constants: Chosen | None = None,
    card: WearerCard | None = None,
    rig: KneeRig | None = None,
    session: Session | None = None,
    faults: Faults | None = None,
    duration: float = DURATION,
    stability: bool = True,
) -> list[ControllerRow]:
    """Controllers on one wearer, on the same swings.

    Parameters
    ----------
    identified : Identified
    seeds : sequence of int
        One swing each.
    only : sequence of str
        Of `NAMES`.
    constants : Chosen, optional
        Those of the file if None.
    card : WearerCard, optional
        In place of the one identified.
    rig : KneeRig, optional
        In place of the one that was identified: something has changed since.
    session : Session, optional
        In place of electrodes that stay on.
    faults : Faults, optional
        What goes wrong in every swing.
    duration : float
        Of a swing [s].
    stability : bool
        Whether margins are computed and tried.

    Returns
    -------
    list of ControllerRow
        Seed by seed.
    """
    constants, rig = constants or chosen(), rig or identified.rig
    card, session = card or identified.card(constants.emg), session or session_of(identified)
    name, pace = identified.name, rig["swing"]
    built = controllers(card, rig.period, (pace["centre"], np.pi * sum(pace["frequency"])), constants, only)
    if "no_control" in only:
        built["no_control"] = Built(lambda: None)
    margins, held = {}, {}
    plain = without_control(rig, name) if stability else None
    for kind, one in built.items() if stability else ():
        margins[kind] = one.margins() if one.margins else None
        if kind not in ("zero_impedance", "no_control"):
            held[kind] = holds_margins(rig, name, one.build, plain)
    rows = []
    for seed in seeds:

        def judge(where: KneeRig, controller: Controller | None, seed: int = seed) -> tuple[float, float]:
            taken = swing(where, name, seed, controller, duration=duration, session=session, faults=faults)
            return root_mean_square(taken)

        alone = judge(rig, None)
        for kind, one in built.items():
            controller = one.build()
            if kind == "zero_impedance":
                mismatch, torque = alone
            else:
                mismatch, torque = judge(driven_back(rig) if kind == "no_control" else rig, controller)
            left = margins.get(kind)
            gain, delay = (left.gain_db, left.delay) if left else (None, None)
            fault = getattr(controller, "fault", "none")
            rows.append(
                ControllerRow(kind, name, seed, mismatch, torque, torque / alone[1], gain, delay, held.get(kind), fault)
            )
    return rows


# ---------------------------------------------------------------------------------------------- who is judged, and how


def wearer(rig: KneeRig, name: str) -> Identified:
    """Record and identify one of the rig's own subjects, or a drawn wearer ``D<seed>``.

    Parameters
    ----------
    rig : KneeRig
    name : str

    Returns
    -------
    Identified
    """
    if name in rig.subjects:
        return identify_wearer_of(rig, name, RECORDED)
    if not (name.startswith("D") and name[1:].isdigit()):
        raise PellucidError(f"found the wearer {name!r}, expected one of {', '.join(rig.subjects)} or D<seed>")
    seed = int(name[1:])
    return identify_wearer_of(drawn_rig(rig, seed), name, seed)


def judge_wearer(rig: KneeRig, name: str, seeds: Sequence[int] = SWINGS) -> tuple[ControllerRow, ...]:
    """Everything about one wearer, from recordings to rows.

    Parameters
    ----------
    rig : KneeRig
    name : str
        As in `wearer`.
    seeds : sequence of int
        Of the swings.

    Returns
    -------
    tuple of ControllerRow
    """
    return tuple(compare(wearer(rig, name), seeds))


def changes(identified: Identified, card: WearerCard, duration: float) -> dict[str, dict]:
    """What is not as it was identified, each as arguments of `compare`.

    Parameters
    ----------
    identified : Identified
    card : WearerCard
        As identified.
    duration : float
        Of a swing [s].

    Returns
    -------
    dict of str to dict
    """
    rig, half = identified.rig, duration / 2
    muscles, foresight = rig["muscles"]["delay"], rig["wearer"]["foresight"]
    anew = sessions_of(rig, identified.seed + 5000)[identified.name]
    made: dict[str, dict] = {"nothing": {}}
    for k, b in ((0.7, 0.7), (0.7, 1.3), (1.3, 0.7), (1.3, 1.3)):
        made[f"strap taken for k x {k:g}, b x {b:g}"] = {"card": mistaken(card, strap_stiffness=k, strap_damping=b)}
    for late in (-0.020, 0.020):
        values = {"muscles.delay": muscles + late, "wearer.foresight": foresight + late}
        made[f"EMG leads by {1e3 * late:+.0f} ms more"] = {"rig": changed(rig, values)}
    for factor in (0.8, 1.25):
        # A tired muscle sends more EMG for its torque, a drying electrode less.
        made[f"EMG gain drifts to {factor:g}"] = {"card": weakened(card, {0: factor, 1: factor})}
    made["electrodes put on anew"] = {"session": anew}
    made["slack of 0.05 rad"] = {"rig": changed(rig, {"strap.slack": 0.05})}
    made["slip of 0.1 rad in mid-swing"] = {"faults": Faults(slip=(half, 0.1))}
    made["both electrodes off from mid-swing"] = {"faults": Faults(emg_detached={0: half, 1: half})}
    return made


def robustness(
    identified: Identified,
    seeds: Sequence[int] = SWINGS[:1],
    *,
    only: Sequence[str] = ("residual", "residual_strap_learnt", "residual_no_emg"),
    constants: Chosen | None = None,
    duration: float = DURATION,
) -> dict[str, list[ControllerRow]]:
    """The residual compensator where something is not as it was identified.

    Parameters
    ----------
    identified, seeds, only, constants, duration
        As `compare` takes them.

    Returns
    -------
    dict of str to list of ControllerRow
        By what has changed; "nothing" first.
    """
    constants = constants or chosen()
    card = identified.card(constants.emg)
    return {
        what: compare(
            identified, seeds, only=only, constants=constants, duration=duration, stability=False,
            **{"card": card, **arguments},
        )
        for what, arguments in changes(identified, card, duration).items()
    }  # fmt: skip


def judge_changes(rig: KneeRig, name: str) -> dict[str, list[ControllerRow]]:
    """`robustness` of one wearer, from recordings to rows.

    Parameters
    ----------
    rig : KneeRig
    name : str
        As in `wearer`.

    Returns
    -------
    dict of str to list of ControllerRow
    """
    return robustness(wearer(rig, name))
