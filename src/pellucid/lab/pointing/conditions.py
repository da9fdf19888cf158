"""Conditions of the pointing experiment: laws built from what an identification of the robot finds, and nothing else.

The exponents of equation 8 are chosen as the paper did, by five people who take no other part: here by the smallest
interaction torque, which contains both the resistance and the shaking that the paper's people were asked about.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..._errors import PellucidError, StudyError
from ...control.control_law import ControlLaw
from ...control.elbow_controllers import BEST_CONTROLLER, ELBOW_CONTROLLERS, UNDITHERED_CONTROLLER
from ...control.elbow_laws import full_compensation
from ...control.transparent_laws import known_travel
from ...fit.slider.slider_fit import SliderFit
from ...models.slider_card import SliderCard
from ...procedures.slider.identify_slider import fit_slider
from ...procedures.slider.slider_result import slider_card
from ...signals.movements import MovementRule, movements
from ..elbow.protocol import trials
from ..elbow.rig import ElbowRig
from ..study import record_in_memory
from .people import Person, draw_people
from .session import CONTROL_CONDITION, Conditions, PointingSession, simulate_sessions, true_motion

if TYPE_CHECKING:
    from .rig import PointingRig

EXPONENT_CANDIDATES = (-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0)
"""Of equation 8, from which each direction's is chosen."""

TUNER_COUNT = 5
"""People who choose them, and take no other part."""

TUNING_SEED = 900

Cards = Mapping[str, SliderCard]


def identify_robot(robot: ElbowRig, *, seed: int = 1) -> tuple[SliderFit, Cards]:
    """What an identification of a robot finds, and the same as cards by method; `seed` is of its recordings' noise."""
    protocols = ("constant_velocity", "swept_sine", "slow", "reversals")
    made = tuple(trial for trial in trials(robot) if trial.protocol in protocols)
    config, recordings, _ = record_in_memory(robot, made, seed=seed)
    fit = fit_slider(config, recordings)
    return fit, {method: slider_card(config, fit, estimate) for method, estimate in fit.estimates.items()}


def identify_cards(robot: ElbowRig, *, seed: int = 1) -> Cards:
    """The cards of `identify_robot`."""
    return identify_robot(robot, seed=seed)[1]


def controller_builder(
    cards: Cards, controller: str, *, exponents: tuple[float, float] | None = None, **settings
) -> Callable[[Person, float], ControlLaw]:
    """A controller of a robot for whoever wears it: takes a person and the place of the carriage [m]; exponents are of
    equation 8, settings as its law takes them."""
    named = ELBOW_CONTROLLERS[controller]
    if exponents is not None and named.exponents:
        settings["exponents"] = exponents

    def build(person: Person, place: float) -> ControlLaw:
        limb = {"limb": person.forearm} if named.wearer else {}
        return named.build(cards[named.method], place, **limb, **settings)

    return build


def offered_controller(cards: Cards, controller: str) -> str:
    """The controller, or what takes its place where its card refuses dither."""
    if controller != BEST_CONTROLLER:
        return controller
    try:
        known_travel(cards[ELBOW_CONTROLLERS[controller].method])
    except PellucidError:
        return UNDITHERED_CONTROLLER
    return controller


def published_conditions(cards: Cards, exponents: tuple[float, float]) -> Conditions:
    """The paper's four conditions, of `cards` by method and the `exponents` of equation 8, upwards and downwards."""
    return {
        CONTROL_CONDITION: None,
        "FC": controller_builder(cards, "fc", exponents=exponents),
        "PCFr": controller_builder(cards, "pcfr", exponents=exponents),
        "CLPC": controller_builder(cards, "clpc"),
    }


def interaction_rms(session: PointingSession, direction: int = 0) -> float:
    """Interaction torque during the movements of a session, in a `direction` (1 upwards, -1 downwards, 0 both): RMS of
    each, mean over them [N*m]; NaN where none came to an end."""
    found = []
    rule = MovementRule()
    for one in movements(*true_motion(session, rule), rule)[0]:
        if direction in (0, one.direction):
            part = slice(one.first, one.last + 1)
            found.append(np.sqrt(np.mean(session.signals["interaction"][part] ** 2)))
    return float(np.mean(found)) if found else float("nan")


def choose_exponents(
    rig: PointingRig, cards: Cards, *, seed: int = TUNING_SEED, threads: int = 1
) -> tuple[tuple[float, float], dict[float, tuple[float, float]]]:
    """k of equation 8 upwards and downwards: the ones with the smallest interaction torque over five people; and by k
    that torque, RMS [N*m], infinite where somebody came to no end in a movement."""
    people = draw_people(rig, np.random.default_rng(seed), count=TUNER_COUNT)
    lifts = np.deg2rad(rig["pointing"]["amplitudes"])
    torques = {}
    for k in EXPONENT_CANDIDATES:
        jobs = []
        for person, rng in zip(people, np.random.default_rng(seed).spawn(TUNER_COUNT), strict=True):
            law = full_compensation(cards["dissociated"], person.slider(rig), exponents=(k, k))
            jobs.append((rig, person, "FC", law, rng, lifts))
        sessions = simulate_sessions(jobs, threads=threads)
        mean = (float(np.mean([interaction_rms(s, direction) for s in sessions])) for direction in (1, -1))
        torques[k] = tuple(np.inf if np.isnan(torque) else torque for torque in mean)
    return tuple(min(EXPONENT_CANDIDATES, key=lambda k: torques[k][i]) for i in (0, 1)), torques


def build_study_conditions(rig: PointingRig, names: Sequence[str] | None = None, *, seed: int = 1) -> Conditions:
    """Conditions on a robot that is identified for them."""
    unknown = [name for name in names or () if name not in ELBOW_CONTROLLERS]
    if unknown or len(set(names or ())) < len(names or ()):
        found = f'found no controller "{unknown[0]}"' if unknown else "found a controller twice"
        raise StudyError(f"conditions: {found}, expected some of {', '.join(ELBOW_CONTROLLERS)}")
    cards = identify_cards(rig.robot, seed=seed)
    if BEST_CONTROLLER in (names or ()):
        known_travel(cards[ELBOW_CONTROLLERS[BEST_CONTROLLER].method])  # rather now than after an hour of movements
    by_direction = not names or any(ELBOW_CONTROLLERS[name].exponents for name in names)
    exponents = choose_exponents(rig, cards, threads=2)[0] if by_direction else None
    if not names:
        return published_conditions(cards, exponents)
    return {CONTROL_CONDITION: None, **{name: controller_builder(cards, name, exponents=exponents) for name in names}}
