"""Reduction of interaction torque by online estimation of a worn orthosis's strap and friction: bound and result.

Twenty seconds of free swings are evaluated, after twenty in which the strap's estimator learns. The strap has
hardening, slack, creep and slip, which neither law nor estimator models. Simulated wearers are identified from
recordings of the tight strap. They then swing in a strap with 30 % lower stiffness, as after ten minutes of loosening.

All laws are the same residual compensator: with the identified card (fixed), with the strap estimated online
(`strap_estimator.hpp`), with the true strap and the same gains, and designed again for the true strap. The last two
bound the benefit of any estimate of the strap, without and with a new choice of gains. A design for a looser strap may
push harder. It is therefore tested on the tight strap, too: a reduction there is no benefit of online estimation.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from pellucid.study.results import ResultRow
from pellucid_lab.knee.chosen_constants import chosen, design_reproduced_law
from pellucid_lab.knee.drawn import drawn_rig
from pellucid_lab.knee.identified_wearer import WearerCard, card_with_coupling_errors, identify_wearer_of
from pellucid_lab.knee.rig import KneeRig, knee_orthosis
from pellucid_lab.knee.worn_compensator import WornCompensator
from pellucid_lab.papers.knee.controllers import controllers
from pellucid_lab.papers.knee.swings import swing
from pellucid_lab.processes import ordered_results
from research.benchmarks._size import sized

SEED = 7200
"""First seed of the simulated wearers; constants were chosen on wearers 101 to 106."""

WEARER_COUNT = sized(5, smallest=1)
"""Number of wearers, each with an orthosis of their own."""

LOOSE_SHARE = 0.7
"""Stiffness of the loosened strap over that of the tight one [1]."""

STIFF_FRICTION_FACTOR = 1.3
"""Dry friction of the drive after it has changed over that at the identification [1]."""

DURATION_S = 40.0
"""Duration of every session [s]."""

LEARNING_S = 20.0
"""First part of a session, which is excluded [s]: twice the time constant of wearers, once that of the estimator."""

NO_PHASES = (0.0, 4.4)
"""Centre [rad] and angular frequency [rad/s] of a swing, which these laws do not use."""

SESSION_COUNT = 10
"""Number of sessions of each wearer."""

LEARNT_LAW = "residual_strap_learnt"
"""Law whose strap is learnt while it is worn."""

TOLD_LAW = "residual_strap_told"
"""Law whose strap is set to that of the loosened one, with gains and observer of the tight one."""


def drift_rows(count: int = WEARER_COUNT) -> Iterator[ResultRow]:
    """Every figure of drift."""
    tried = ordered_results([(try_wearer, SEED + i) for i in range(count)])
    found = {key: np.array([one[key] for one in tried]) for key in tried[0]}
    fixed, loose = found["tight.fixed"], found["loose.fixed"]
    yield _ratio("interaction_over_fixed", found["loose.learnt"], loose, "strap learnt over fixed card, loosened strap")
    yield _ratio("told_over_fixed", found["loose.told"], loose, "strap told, gains kept: a bound for any estimate")
    yield _ratio("designed_over_fixed", found["loose.designed"], loose, "designed again for the loosened strap")
    yield _ratio("designed_over_fixed_tight", found["tight.designed"], fixed, "the same design, tight strap")
    yield _ratio("healthy_over_fixed", found["tight.learnt"], fixed, "strap learnt over fixed card, tight strap")
    yield _ratio("loose_over_tight", loose, fixed, "what the loosened strap costs a fixed card")
    yield _ratio("none_over_fixed", found["loose.none"], loose, "zero impedance (reference method), loosened strap")
    yield _ratio(
        "friction_told_over_fixed", found["rubbing.told"], found["rubbing.fixed"],
        f"dry friction of the drive {STIFF_FRICTION_FACTOR:g} times as high: law with the true value over fixed card",
    )  # fmt: skip
    kept, low = found["tight.stiffness"], found["loose.stiffness"]
    yield _row(
        "stiffness_learnt", np.mean(low), "1",
        f"stiffness learnt on the loosened strap over the card's, {low.min():.2f} to {low.max():.2f}; on the tight "
        f"strap {kept.min():.2f} to {kept.max():.2f}; the estimator's lower bound is 0.7",
    )  # fmt: skip
    stopped = sum(one["stopped"] for one in tried)
    yield _row("stopped", stopped, "1", f"sessions of {SESSION_COUNT * count} that stopped")


def try_wearer(seed: int) -> dict[str, float]:
    """Return RMS strap torques [N*m] by strap and law, and the learnt stiffness over the card's, for one wearer."""
    rig, name, constants = drawn_rig(knee_orthosis(), seed), f"D{seed}", chosen()
    card = identify_wearer_of(rig, name, seed).card(constants.emg)
    strap = rig.subjects[name].strap.stiffness
    loosened = rig.changed({f"subjects.{name}.strap.stiffness": LOOSE_SHARE * strap})
    drive = rig.constants.actuator
    rubbing = rig.changed(
        {f"actuator.{key}": STIFF_FRICTION_FACTOR * drive[key] for key in ("coulomb_positive", "coulomb_negative")}
    )
    swung = partial(_swing, constants=constants, name=name, seed=seed)
    looser = card_with_coupling_errors(card, strap_stiffness=LOOSE_SHARE)
    stiffer = card_with_coupling_errors(card, actuator_coulomb=STIFF_FRICTION_FACTOR)
    made, faults = {}, 0
    for label, worn, law, used in (
        ("tight.fixed", rig, "residual", card),
        ("tight.learnt", rig, LEARNT_LAW, card),
        ("tight.designed", rig, "residual", looser),
        ("loose.none", loosened, "zero_impedance", card),
        ("loose.fixed", loosened, "residual", card),
        ("loose.learnt", loosened, LEARNT_LAW, card),
        ("loose.told", loosened, TOLD_LAW, card),
        ("loose.designed", loosened, "residual", looser),
        ("rubbing.fixed", rubbing, "residual", card),
        ("rubbing.told", rubbing, "residual", stiffer),
    ):
        made[label], fault, stiffness = swung(worn, law=law, card=used)
        faults += fault != "none"
        if law == LEARNT_LAW:
            made[label.replace("learnt", "stiffness")] = stiffness / card.coupling.strap_stiffness
    return {**made, "stopped": float(faults)}


def _swing(rig: KneeRig, *, constants, name: str, seed: int, law: str, card: WearerCard) -> tuple[float, str, float]:
    """Return the RMS strap torque [N*m], the fault and the law's last stiffness [N*m/rad] of one session."""
    if law == TOLD_LAW:
        made = design_reproduced_law(card.coupling, rig.period, constants)
        kept = replace(made, coupling=card.coupling.scaled(strap_stiffness=LOOSE_SHARE))
        controller = WornCompensator(kept, card.emg.build())
    else:
        controller = controllers(card, rig.period, NO_PHASES, constants, only=(law,))[law].build()
    taken = swing(rig, name, seed, controller, duration=DURATION_S)
    torque = taken.truth.strap_torque[taken.time >= LEARNING_S]
    stiffness = float("nan") if controller is None else controller.strap[0]
    return float(np.sqrt(np.mean(torque**2))), "none" if controller is None else controller.fault, stiffness


def _ratio(name: str, over: np.ndarray, under: np.ndarray, words: str, *, draws: int = 2000) -> ResultRow:
    """Return a row with the ratio of mean torques and its 95 % interval over resampled wearers."""
    picks = np.random.default_rng(SEED).integers(0, len(over), (draws, len(over)))
    low, high = np.quantile(over[picks].mean(axis=1) / under[picks].mean(axis=1), (0.025, 0.975))
    interval = f"{len(over)} wearers, 95 % interval {low:.3f} to {high:.3f}"
    note = f"{words}; {interval}; {under.mean():.3f} to {over.mean():.3f} N*m"
    return _row(name, over.mean() / under.mean(), "1", note)


def _row(name: str, value: float, unit: str, note: str) -> ResultRow:
    return ResultRow(f"mission.drift.{name}", float(value), unit, "evidence", "simulated", None, note)
