"""Choose the constants of ``chosen.toml`` on simulated wearers, none of whom is compared afterwards.

The criterion is the same for every controller: the smallest strap torque relative to zero-impedance mode on the same
swing, mean over the tuning wearers. On each of them a controller must also be stable with twice its command and 20 ms
more delay. A linear loop with a strap error of 30 % shows this if the controller has one, otherwise the simulation.
Controllers that compensate the body by a model alone do not keep these margins with any useful share of friction (a
fifth of it made two of six wearers sway). With them a released leg must come to rest. Constants are searched one at a
time, in the order of `SEARCHED_VALUES`.

Run as ``python -m pellucid_lab.papers.knee.tuning``; it writes the file anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np

from pellucid._atomic import write_text_atomically
from pellucid._errors import PellucidError
from pellucid._processes import processes
from pellucid.controllers.residual_compensator import Law, Noise, ResidualDesign
from pellucid.emg.estimators.causal_map import EmgSettings

from ...knee.chosen_constants import CONSTANTS_FILE, ChosenConstants, design_reproduced_law
from ...knee.identified_wearer import IdentifiedWearer, WearerCard, card_with_coupling_errors
from ...knee.rig import knee_orthosis
from ...knee.trial import KneeReadings
from ...knee.worn_compensator import WornCompensator
from .controllers import BODY_LAW_WORDS, body_controllers, controllers
from .residual import TUNING_WEARER_SEEDS, identify_by_name, session_of
from .swings import (
    SETTLING_TIME_S,
    WithoutControl,
    comes_to_rest,
    holds_margins,
    rms_mismatch_and_torque,
    swing,
    without_control,
)

TUNING_SWING_SEED = 21
"""Seed of the swing on which constants are chosen."""

TUNING_SWING_DURATION_S = 14.0
"""Duration of the swing on which constants are chosen."""

MAX_SEARCH_ROUNDS = 1
"""The search goes through all constants of a controller at most this often."""

SEARCHED_VALUES: Mapping[str, Mapping[str, tuple[float, ...]]] = {
    "residual": {
        "law.integral": (1.5, 3.0, 5.0),
        "law.proportional": (1.0, 2.0, 3.0),
        "law.friction": (0.2, 0.3, 0.4),
        "law.gravity": (0.0, 0.8),
        "law.torque_gain": (0.3, 0.45),
        "noise.emg_drift": (2.0, 4.0),
        "noise.orthosis_torque": (0.4, 0.8),
    },
    "disturbance_observer": {
        "observer.bandwidth": (20.0, 40.0, 80.0),
        "observer.gain": (1.5, 2.5, 4.0),
        "observer.friction": (0.0, 0.3),
    },
    "fuzzy": {
        "fuzzy.largest": (4.0, 6.0),
        "fuzzy.torque_scale": (1.0, 2.0),
        "fuzzy.velocity_scale": (1.0, 2.0, 4.0),
    },
    "rbf": {
        "rbf.bound": (0.5, 1.0, 1.5),
        "rbf.rate": (1.0, 2.0, 4.0),
        "rbf.leak": (0.2, 1.0),
    },
    "body": {
        "body.friction": (0.2, 0.3, 0.4),
        "body.width": (0.15, 0.3, 0.6),
        "body.inertia": (0.0, 0.3, 0.6),
    },
    "oscillator": {
        "oscillator.friction": (0.2, 0.3, 0.4),
        "oscillator.inertia": (0.3, 0.6, 0.9),
        "oscillator.lead": (0.0, 0.02, 0.04),
    },
    "residual_strap_learnt": {
        "learning.forgetting": (5.0, 10.0, 20.0),
        "learning.prior_mismatch": (0.05, 0.1, 0.2),
    },
}  # fmt: skip
"""Values that are tried for each constant (``table.name``), by controller."""

START_CONSTANTS = ChosenConstants(
    law=Law(gravity=0.0, friction=0.3, proportional=2.0, integral=3.0, torque_gain=0.3),
    noise=Noise(orthosis_torque=0.4, limb_torque=2.0, emg_drift=4.0),
    widths={"width": 0.02, "assist_width": 0.3},
    emg=EmgSettings(corner=3.0),
    observer={"bandwidth": 40.0, "gain": 2.5, "friction": 0.0, "gravity": 0.5, "assist_width": 0.6},
    fuzzy={"largest": 4.0, "torque_scale": 1.0, "velocity_scale": 2.0},
    rbf={"rate": 1.0, "bound": 0.5, "leak": 1.0},
    body={"gravity": 0.5, "friction": 0.2, "inertia": 0.3, "width": 0.15, "bandwidth": 60.0},
    oscillator={"share": 1.0, "lead": 0.02, "inertia": 0.6, "friction": 0.2},
    rules={"share": 0.5},
    amplification={"alpha": 1.25, "width": 0.15, "bandwidth": 60.0},
)
"""Constants from which the search starts.

They are the result of an earlier, wider search by the same criterion on the same wearers. It also tried widths of
friction from 0.02 to 2.5 rad/s, shares of inertia and viscous friction from 0 to 1, derivative gains, corners of the
envelope from 3 to 5.5 Hz, and noise of the limb and of the EMG's drift up to 8 times as large. Two constants were not
searched at the knee: the share of the rules' torque is that of the elbow's fuzzy rules, and amplification carries as
much friction as the body's law.
"""

STRAP_STIFFNESS_FACTORS = (0.75, 1.25)
"""Constants of the strap's learning are chosen on the identified card and on cards with these factors on stiffness."""

LOOSE_STRAP_SLACK_RAD = 0.03
"""They are also chosen on a strap that has come loose by this angle."""


def change_constant(constants: ChosenConstants, path: str, value: float) -> ChosenConstants:
    """Return constants with one of them, ``table.name``, set to `value`."""
    table, name = path.split(".")
    old = getattr(constants, table)
    new = {**old, name: value} if isinstance(old, Mapping) else replace(old, **{name: value})
    return replace(constants, **{table: new})


@cache
def _identify_tuning_wearer(seed: int) -> IdentifiedWearer:
    """Record and identify a tuning wearer, once in each process."""
    return identify_by_name(knee_orthosis(), f"D{seed}")


@cache
def _card_of_wearer(seed: int, settings: EmgSettings) -> WearerCard:
    """Return a tuning wearer's card, its EMG map fitted under `settings`."""
    return _identify_tuning_wearer(seed).card(settings)


@cache
def _unassisted_strap_torque(seed: int, slack: float | None = None) -> float:
    """Return the strap torque of zero-impedance mode [N m], with another `slack` [rad] of the strap if given."""
    one = _identify_tuning_wearer(seed)
    rig = one.rig if slack is None else one.rig.strapped({"slack": slack})
    return rms_mismatch_and_torque(
        swing(rig, one.name, TUNING_SWING_SEED, None, duration=TUNING_SWING_DURATION_S, session=session_of(one))
    )[1]


@cache
def _without_control_of(seed: int) -> WithoutControl:
    """Simulate zero-impedance mode on a tuning wearer, once in each process."""
    one = _identify_tuning_wearer(seed)
    return without_control(one.rig, one.name, TUNING_SWING_SEED)


def strap_torque_share(kind: str, constants: ChosenConstants, seed: int) -> float:
    """Return a controller's strap torque on one tuning wearer over that of zero-impedance mode [1].

    It is infinite if the linear margins do not hold or the gate finds a fault.
    """
    one, card = _identify_tuning_wearer(seed), _card_of_wearer(seed, constants.emg)

    def ratio(known: WearerCard, slack: float | None = None) -> float:
        try:
            built = controllers(known, one.rig.period, (0.0, 1.0), constants, (kind,))[kind]
        except PellucidError:
            return float("inf")
        controller, rig = built.build(), one.rig if slack is None else one.rig.strapped({"slack": slack})
        taken = swing(
            rig, one.name, TUNING_SWING_SEED, controller, duration=TUNING_SWING_DURATION_S, session=session_of(one)
        )
        if controller.fault != "none":
            return float("inf")
        return rms_mismatch_and_torque(taken)[1] / _unassisted_strap_torque(seed, slack)

    if kind == "residual_strap_learnt":
        wrong = [ratio(card_with_coupling_errors(card, strap_stiffness=k)) for k in STRAP_STIFFNESS_FACTORS]
        return float(np.mean([ratio(card), ratio(card, LOOSE_STRAP_SLACK_RAD), *wrong]))
    return ratio(card)


def keeps_margins(kind: str, constants: ChosenConstants, seed: int) -> bool:
    """Return whether a controller without a linear form holds the margins in the simulation.

    Controllers with a linear form hold them by design; laws of the body must only let a released leg come to rest.
    """
    one = _identify_tuning_wearer(seed)
    if kind in BODY_LAW_WORDS:
        built = body_controllers(_card_of_wearer(seed, constants.emg), one.rig.period, constants, (kind,))[kind]
        return comes_to_rest(one.rig, one.name, built.build, _without_control_of(seed))
    built = controllers(_card_of_wearer(seed, constants.emg), one.rig.period, (0.0, 1.0), constants, (kind,))[kind]
    return built.margins is not None or holds_margins(
        one.rig, one.name, built.build, _without_control_of(seed), seed=TUNING_SWING_SEED
    )


def search(
    kind: str, start: ChosenConstants, seeds: Sequence[int], mapped: Callable, tell: Callable[[str], None]
) -> tuple[ChosenConstants, float]:
    """Choose one controller's constants, one at a time; return them and the mean share of strap torque [1]."""

    def mean(constants: ChosenConstants) -> float:
        return float(np.mean(list(mapped(partial(strap_torque_share, kind, constants), seeds))))

    def keeps(constants: ChosenConstants) -> bool:
        return all(mapped(partial(keeps_margins, kind, constants), seeds))

    best, least = start, mean(start) if keeps(start) else float("inf")
    tell(f"{kind}: {least:.4f} at first")
    for _ in range(MAX_SEARCH_ROUNDS):
        before = best
        for path, values in SEARCHED_VALUES[kind].items():
            table, name = path.split(".")
            for value in values:
                now = getattr(best, table)
                if value == (now[name] if isinstance(now, Mapping) else getattr(now, name)):
                    continue
                tried = change_constant(best, path, value)
                reached = mean(tried)
                tell(f"{kind}: {reached:.4f} at {path} = {value:g}")
                if reached < least and keeps(tried):
                    best, least = tried, reached
        if best == before:
            break
    return best, least


def phase_gains(taken: KneeReadings, made: ResidualDesign) -> tuple[float, ...]:
    """Return the gain in each eighth of a swing, from the torque that a recorded compensator still left to the strap.

    The eighths divide the plane of angle and velocity, as the compensator estimates its phase. Each gain [1] is the
    least-squares coefficient of command plus missing torque on the command, limited to 0.8 to 1.25.
    """
    m, q = made.coupling, taken.position
    kernel = np.ones(25) / 25
    v = np.convolve(np.gradient(q, taken.time), kernel, mode="same")
    a = np.convolve(np.gradient(v, taken.time), kernel, mode="same")
    missing = m.orthosis_inertia * a + m.orthosis_viscous * v + m.orthosis_gravity * np.sin(q) - taken.torque
    x, y = q - made.swing[0], v / made.swing[1]
    place = (np.round(np.arctan2(y, x) / (np.pi / 4)).astype(int)) % 8
    gains = []
    for i in range(8):
        here = (place == i) & (taken.time > SETTLING_TIME_S)
        u = taken.command[here]
        share = float(u @ missing[here] / (u @ u)) if here.sum() > 100 else 0.0
        gains.append(float(np.clip(1 + share, 0.8, 1.25)))
    return tuple(gains)


def phase_gains_of_wearer(constants: ChosenConstants, seed: int) -> tuple[float, ...]:
    """Return `phase_gains` of one tuning wearer."""
    one, pace = _identify_tuning_wearer(seed), knee_orthosis()["swing"]
    made = design_reproduced_law(one.coupling, one.rig.period, constants)
    made = replace(made, swing=(pace["centre"], np.pi * sum(pace["frequency"])))
    controller = WornCompensator(made, one.card(constants.emg).emg.build())
    taken = swing(one.rig, one.name, TUNING_SWING_SEED, controller, duration=20.0, session=session_of(one))
    return phase_gains(taken, made)


def tune(
    seeds: Sequence[int] = TUNING_WEARER_SEEDS, *, mapped: Callable = map, tell: Callable[[str], None] = print
) -> ChosenConstants:
    """Choose all constants."""
    constants = START_CONSTANTS
    for kind in SEARCHED_VALUES:
        constants, reached = search(kind, constants, seeds, mapped, tell)
        tell(f"{kind}: {reached:.4f} in the end")
    each = list(mapped(partial(phase_gains_of_wearer, constants), seeds))
    return replace(constants, phase_gain=tuple(float(g) for g in np.round(np.median(each, axis=0), 2)))


def write_toml(constants: ChosenConstants, seeds: Sequence[int]) -> str:
    """Return the text of ``chosen.toml``, as `parse_chosen` reads it."""
    lines = [
        "# Constants of the controllers that are compared on the virtual knee orthosis. Written by",
        f"# `python -m pellucid_lab.papers.knee.tuning` from simulated wearers {seeds[0]} to {seeds[-1]};",
        "# no compared wearer is among them. Change the search, not this file.",
    ]
    for table, values in constants.tables().items():
        lines += ["", f"[{table}]"]
        lines += [f"{name} = {list(v) if isinstance(v, tuple) else v!r}" for name, v in values.items()]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Choose all constants, and write ``chosen.toml``."""
    # Each process keeps its own wearers: identifying one takes longer than a swing.
    with processes(1) as even, processes(1) as odd:

        def mapped(make: Callable, seeds: Sequence[int]) -> list:
            return [one.result() for one in [(odd if seed % 2 else even).submit(make, seed) for seed in seeds]]

        constants = tune(mapped=mapped, tell=lambda line: print(line, flush=True))
    write_text_atomically(CONSTANTS_FILE, write_toml(constants, TUNING_WEARER_SEEDS))


if __name__ == "__main__":
    main()
