"""The thesis's further work: compensation of a worn orthosis's residual impedance, and alternatives.

A wearer is recorded and identified. Every controller is built from the cards and from constants chosen on other
wearers, and all of them make the same swings. The truth serves to compute errors alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pellucid._errors import PellucidError

from ...knee.chosen_constants import ChosenConstants, chosen
from ...knee.drawn import drawn_rig
from ...knee.identified_wearer import (
    IdentifiedWearer,
    WearerCard,
    card_with_channel_gains,
    card_with_coupling_errors,
    identify_wearer_of,
)
from ...knee.instruments import Mounting
from ...knee.protocol import Faults
from ...knee.rig import KneeRig
from ...knee.trial import Controller
from .controllers import CONTROLLER_WORDS, BuiltController, controllers
from .swings import holds_margins, rms_mismatch_and_torque, swing, without_control, without_power

TUNING_WEARER_SEEDS = tuple(range(101, 107))
"""Seeds of the simulated wearers on whom constants were chosen."""

TEST_WEARER_SEEDS = tuple(range(201, 207))
"""Seeds of the simulated wearers on whom controllers are compared."""

SWING_SEEDS = (31, 32, 33)
"""Seeds of the swings in which controllers are compared."""

SWING_DURATION_S = 20.0
"""Duration of each of these swings."""

REPRODUCED_WEARERS = ("S1", "S2", "S3", f"D{TEST_WEARER_SEEDS[0]}")
"""Wearers whom a reproduction compares. They are few to save time; `main` of `residual_rows` compares all."""

RECORDING_SEED = 5
"""Seed of the recordings from which the rig's own subjects are identified; a simulated one has that of its name."""


@dataclass(frozen=True)
class ControllerRow:
    """One controller on one wearer, in one swing."""

    controller: str  # Name in `CONTROLLER_WORDS`
    subject: str
    seed: int  # Seed of the swing
    mismatch: float  # RMS of the angle between limb and orthosis [rad]
    strap_torque: float  # RMS of the interaction torque [N m]
    ratio: float  # Strap torque over that of zero-impedance mode on the same swing [1]
    # Margins are the smallest with the strap as identified and 30 % off; None if the controller has no linear form.
    gain_db: float | None = None  # Gain margin [dB]; infinite beyond 40 dB
    delay: float | None = None  # Delay margin [s]; infinite beyond 100 ms
    # True if, in the simulation, neither twice the command nor one that is 20 ms late makes a relaxed leg or a swing
    # sway; None if it was not tried
    holds: bool | None = None
    fault: str = "none"  # Fault of its safety gate at the end


def session_of(identified: IdentifiedWearer) -> Mounting:
    """Return the instruments' mounting while a wearer was identified: electrodes stay on for the swings."""
    return identified.rig.mountings(identified.seed)[identified.name]


def compare(
    identified: IdentifiedWearer,
    seeds: Sequence[int] = SWING_SEEDS,
    *,
    only: Sequence[str] = tuple(CONTROLLER_WORDS),
    constants: ChosenConstants | None = None,
    card: WearerCard | None = None,
    rig: KneeRig | None = None,
    session: Mounting | None = None,
    faults: Faults | None = None,
    duration: float = SWING_DURATION_S,
    stability: bool = True,
) -> list[ControllerRow]:
    """Simulate every controller of `only` on one wearer, on the same swings; `duration` [s]."""
    constants, rig = constants or chosen(), rig or identified.rig
    card, session = card or identified.card(constants.emg), session or session_of(identified)
    name, pace = identified.name, rig["swing"]
    built = controllers(card, rig.period, (pace["centre"], np.pi * sum(pace["frequency"])), constants, only)
    if "no_control" in only:
        built["no_control"] = BuiltController(lambda: None)
    margins, steady = {}, {}
    plain = without_control(rig, name) if stability else None
    for kind, one in built.items() if stability else ():
        margins[kind] = one.margins() if one.margins else None
        if kind not in ("zero_impedance", "no_control"):
            steady[kind] = holds_margins(rig, name, one.build, plain)
    rows = []
    for seed in seeds:

        def left(where: KneeRig, controller: Controller | None, seed: int = seed) -> tuple[float, float]:
            taken = swing(where, name, seed, controller, duration=duration, session=session, faults=faults)
            return rms_mismatch_and_torque(taken)

        alone = left(rig, None)
        for kind, one in built.items():
            controller = one.build()
            if kind == "zero_impedance":
                mismatch, torque = alone
            else:
                mismatch, torque = left(without_power(rig) if kind == "no_control" else rig, controller)
            found = margins.get(kind)
            gain, delay = (found.gain_db, found.delay) if found else (None, None)
            fault = getattr(controller, "fault", "none")
            rows.append(
                ControllerRow(
                    kind, name, seed, mismatch, torque, torque / alone[1], gain, delay, steady.get(kind), fault
                )
            )
    return rows


# --- wearers and perturbations --------------------------------------------------------------------------------------


def identify_by_name(rig: KneeRig, name: str) -> IdentifiedWearer:
    """Record and identify one of the rig's own subjects, or a simulated wearer ``D<seed>``."""
    if name in rig.subjects:
        return identify_wearer_of(rig, name, RECORDING_SEED)
    if not (name.startswith("D") and name[1:].isdigit()):
        raise PellucidError(f"found the wearer {name!r}, expected one of {', '.join(rig.subjects)} or D<seed>")
    seed = int(name[1:])
    return identify_wearer_of(drawn_rig(rig, seed), name, seed)


def evaluate_wearer(rig: KneeRig, name: str, seeds: Sequence[int] = SWING_SEEDS[:2]) -> tuple[ControllerRow, ...]:
    """Record and identify one wearer, and compare the controllers on that wearer."""
    return tuple(compare(identify_by_name(rig, name), seeds))


def perturbations(identified: IdentifiedWearer, card: WearerCard, duration: float) -> dict[str, dict]:
    """Return each deviation from the identified system, by its words, as arguments of `compare`; `duration` [s]."""
    rig, half = identified.rig, duration / 2
    muscles, foresight = rig["muscles"]["delay"], rig["wearer"]["foresight"]
    anew = rig.mountings(identified.seed + 5000)[identified.name]
    made: dict[str, dict] = {"nothing": {}}
    for k, b in ((0.7, 0.7), (0.7, 1.3), (1.3, 0.7), (1.3, 1.3)):
        made[f"strap taken for k x {k:g}, b x {b:g}"] = {
            "card": card_with_coupling_errors(card, strap_stiffness=k, strap_damping=b)
        }
    for late in (-0.020, 0.020):
        values = {"muscles.delay": muscles + late, "wearer.foresight": foresight + late}
        made[f"EMG leads by {1e3 * late:+.0f} ms more"] = {"rig": rig.changed(values)}
    for factor in (0.8, 1.25):
        # A tired muscle sends more EMG for its torque, a drying electrode less.
        made[f"EMG gain drifts to {factor:g}"] = {"card": card_with_channel_gains(card, {0: factor, 1: factor})}
    made["electrodes put on anew"] = {"session": anew}
    made["slack of 0.05 rad"] = {"rig": rig.strapped({"slack": 0.05})}
    made["slip of 0.1 rad in mid-swing"] = {"faults": Faults(slip=(half, 0.1))}
    made["both electrodes off from mid-swing"] = {"faults": Faults(emg_detached={0: half, 1: half})}
    return made


def robustness(
    identified: IdentifiedWearer,
    seeds: Sequence[int] = SWING_SEEDS[:1],
    *,
    only: Sequence[str] = ("residual", "residual_strap_learnt", "residual_no_emg"),
    constants: ChosenConstants | None = None,
    duration: float = SWING_DURATION_S,
) -> dict[str, list[ControllerRow]]:
    """Compare controllers under each of `perturbations`, where the system is not as it was identified."""
    constants = constants or chosen()
    card = identified.card(constants.emg)
    return {
        what: compare(
            identified, seeds, only=only, constants=constants, duration=duration, stability=False,
            **{"card": card, **arguments},
        )
        for what, arguments in perturbations(identified, card, duration).items()
    }  # fmt: skip


def evaluate_changes(rig: KneeRig, name: str) -> dict[str, list[ControllerRow]]:
    """Record and identify one wearer, and compare controllers under each perturbation."""
    return robustness(identify_by_name(rig, name))
