"""How the constants of ``chosen.toml`` are chosen: on drawn wearers, none of whom is compared afterwards.

The criterion is the same for every controller: the least strap torque, as a share of zero-impedance mode's on the same
swing, mean over the tuning wearers; and on each of them a controller must bear twice its command and 20 ms more delay,
by its linear loop with the strap 30 % off where it has one, and in the simulation where it has none. What carries the
body by model alone holds no such margin with friction that matters (a fifth of it swayed two of six); of these a leg
let go must come to rest. Constants are searched one at a time, in the order of `SEARCHED`, each over a few values.

Run as ``python -m pellucid.papers.knee.tuning``; it writes the file anew.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from ..._atomic import write_text_atomically
from ..._errors import PellucidError
from ..._processes import processes
from ...control.residual_compensator import Law, Noise, ResidualDesign
from ...control.worn import WornCompensator
from ...estimators.causal_map import EmgSettings
from ...lab.knee.rig import knee_orthosis
from ...lab.knee.trial import KneeReadings
from .cards import Identified, WearerCard, mistaken
from .controllers import BODY_NAMES, Chosen, body_controllers, controllers, for_wearer
from .residual import TUNING, session_of, wearer
from .swings import (
    SETTLING,
    WithoutControl,
    holds_margins,
    root_mean_square,
    settles,
    swing,
    without_control,
)

SWING, DURATION = 21, 14.0
"""Seed and length of the swing on which constants are chosen [s]."""

ROUNDS = 1
"""Most of them."""

SEARCHED: Mapping[str, Mapping[str, tuple[float, ...]]] = {
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
"""By controller: constants and their values."""

START = Chosen(
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
"""Where an earlier, wider search by the same criterion on the same wearers ended: it also tried widths of friction from
0.02 to 2.5 rad/s, shares of inertia and viscous friction from 0 to 1, derivative gains, corners of the envelope from 3
to 5.5 Hz, and noise of the limb and of the EMG's drift up to 8 times as large. The share of what rules say is the
elbow's for fuzzy ones, and amplification carries as much friction as the body: neither was searched at the knee."""

WRONG_STRAPS = (0.75, 1.25)
"""What the learning of a strap is chosen on: cards whose stiffness is that much off, and the card as it is."""

SLACK = 0.03
"""The same: a strap that has come loose [rad]."""


def with_value(constants: Chosen, path: str, value: float) -> Chosen:
    """Constants with one changed."""
    table, name = path.split(".")
    old = getattr(constants, table)
    new = {**old, name: value} if isinstance(old, Mapping) else replace(old, **{name: value})
    return replace(constants, **{table: new})


@cache
def _wearer(seed: int) -> Identified:
    """Once a process."""
    return wearer(knee_orthosis(), f"D{seed}")


@cache
def _card(seed: int, settings: EmgSettings) -> WearerCard:
    return _wearer(seed).card(settings)


@cache
def _plain(seed: int, slack: float | None = None) -> float:
    """Strap torque of zero-impedance mode [N m]; a slack [rad] other than the strap's own if given."""
    one = _wearer(seed)
    rig = one.rig if slack is None else one.rig.strapped({"slack": slack})
    return root_mean_square(swing(rig, one.name, SWING, None, duration=DURATION, session=session_of(one)))[1]


@cache
def _without(seed: int) -> WithoutControl:
    one = _wearer(seed)
    return without_control(one.rig, one.name, SWING)


def left_to_strap(kind: str, constants: Chosen, seed: int) -> float:
    """What a controller leaves of one tuning wearer's strap torque; infinite where its linear margins do not hold.

    gives [1].
    """
    one, card = _wearer(seed), _card(seed, constants.emg)

    def ratio(known: WearerCard, slack: float | None = None) -> float:
        try:
            built = controllers(known, one.rig.period, (0.0, 1.0), constants, (kind,))[kind]
        except PellucidError:
            return float("inf")
        controller, rig = built.build(), one.rig if slack is None else one.rig.strapped({"slack": slack})
        taken = swing(rig, one.name, SWING, controller, duration=DURATION, session=session_of(one))
        if controller.fault != "none":
            return float("inf")
        return root_mean_square(taken)[1] / _plain(seed, slack)

    if kind == "residual_strap_learnt":
        wrong = [ratio(mistaken(card, strap_stiffness=k)) for k in WRONG_STRAPS]
        return float(np.mean([ratio(card), ratio(card, SLACK), *wrong]))
    return ratio(card)


def keeps_margins(kind: str, constants: Chosen, seed: int) -> bool:
    """Whether a controller without a linear form bears what is asked, in the simulation; others do already."""
    one = _wearer(seed)
    if kind in BODY_NAMES:
        built = body_controllers(_card(seed, constants.emg), one.rig.period, constants, (kind,))[kind]
        return settles(one.rig, one.name, built.build, _without(seed))
    built = controllers(_card(seed, constants.emg), one.rig.period, (0.0, 1.0), constants, (kind,))[kind]
    return built.margins is not None or holds_margins(one.rig, one.name, built.build, _without(seed), seed=SWING)


def search(
    kind: str, start: Chosen, seeds: Sequence[int], mapped: Callable, tell: Callable[[str], None]
) -> tuple[Chosen, float]:
    """Choose one controller's constants, one at a time; gives [1]."""

    def mean(constants: Chosen) -> float:
        return float(np.mean(list(mapped(partial(left_to_strap, kind, constants), seeds))))

    def keeps(constants: Chosen) -> bool:
        return all(mapped(partial(keeps_margins, kind, constants), seeds))

    best, least = start, mean(start) if keeps(start) else float("inf")
    tell(f"{kind}: {least:.4f} at first")
    for _ in range(ROUNDS):
        before = best
        for path, values in SEARCHED[kind].items():
            table, name = path.split(".")
            for value in values:
                now = getattr(best, table)
                if value == (now[name] if isinstance(now, Mapping) else getattr(now, name)):
                    continue
                tried = with_value(best, path, value)
                reached = mean(tried)
                tell(f"{kind}: {reached:.4f} at {path} = {value:g}")
                if reached < least and keeps(tried):
                    best, least = tried, reached
        if best == before:
            break
    return best, least


def phase_gains(taken: KneeReadings, made: ResidualDesign) -> tuple[float, ...]:
    """Gains over a swing from what a recorded compensator still left to the strap, by its own estimate of phase.

    In each eighth of the circle of angle and velocity the gain is least squares of command plus missing torque on the
    command, within 0.8 and 1.25.

    gives [1].
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
        here = (place == i) & (taken.time > SETTLING)
        u = taken.command[here]
        share = float(u @ missing[here] / (u @ u)) if here.sum() > 100 else 0.0
        gains.append(float(np.clip(1 + share, 0.8, 1.25)))
    return tuple(gains)


def gains_of(constants: Chosen, seed: int) -> tuple[float, ...]:
    """`phase_gains` of one tuning wearer."""
    one, pace = _wearer(seed), knee_orthosis()["swing"]
    made = for_wearer(one.coupling, one.rig.period, constants)
    made = replace(made, swing=(pace["centre"], np.pi * sum(pace["frequency"])))
    controller = WornCompensator(made, one.card(constants.emg).emg.build())
    taken = swing(one.rig, one.name, SWING, controller, duration=20.0, session=session_of(one))
    return phase_gains(taken, made)


def tune(seeds: Sequence[int] = TUNING, *, mapped: Callable = map, tell: Callable[[str], None] = print) -> Chosen:
    """Choose all constants."""
    constants = START
    for kind in SEARCHED:
        constants, reached = search(kind, constants, seeds, mapped, tell)
        tell(f"{kind}: {reached:.4f} in the end")
    each = list(mapped(partial(gains_of, constants), seeds))
    return replace(constants, phase_gain=tuple(float(g) for g in np.round(np.median(each, axis=0), 2)))


def text(constants: Chosen, seeds: Sequence[int]) -> str:
    """The file, as `parse_chosen` reads it."""
    lines = [
        "# Constants of the controllers that are compared on the virtual knee orthosis. Written by",
        f"# `python -m pellucid.papers.knee.tuning` from drawn wearers {seeds[0]} to {seeds[-1]}; nobody who is",
        "# compared is among them. Change the search, not this file.",
    ]
    for table, values in constants.tables().items():
        lines += ["", f"[{table}]"]
        lines += [f"{name} = {list(v) if isinstance(v, tuple) else v!r}" for name, v in values.items()]
    return "\n".join(lines) + "\n"


def main() -> None:
    """Choose, and write the file."""
    # Each process keeps its own wearers: identifying one takes longer than a swing.
    with processes(1) as even, processes(1) as odd:

        def mapped(make: Callable, seeds: Sequence[int]) -> list:
            return [one.result() for one in [(odd if seed % 2 else even).submit(make, seed) for seed in seeds]]

        constants = tune(mapped=mapped, tell=lambda line: print(line, flush=True))
    write_text_atomically(Path(__file__).with_name("chosen.toml"), text(constants, TUNING))


if __name__ == "__main__":
    main()
